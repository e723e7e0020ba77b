"""Who may import whom, read off the source (ARCHITECTURE.md, "Layers"), what that costs, and whose a constant is."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
parsed = cache(ast.parse)

LAYERS = (
    {"types", "pulse", "kernel_cache"},
    {"errors", "compiled", "records", "extras", "registrations"},
    {"bracket", "laws"},
    {"documents"},
    {"files", "geometry", "quantity", "workers"},
    {"diagnosis"},
    {"devices", "recordings", "table"},
    {"effects"},
    {"stimulus"},
    {"scene"},
    {"strategies"},
    {"renderer"},
    {"closed_forms"},
    {"simulation"},
    {"adapters"},
    {"phenomena"},
    {"discovery", "hardware", "rigid_contact", "suite"},
    {"runner"},
    {"search", "study"},
    {"replay"},
    {"api"},
    {"commands", "pytest_plugin"},
    {"cli"},
    {"__main__"},
)
"""From the bottom up. A unit (a module or a subpackage) imports from lower layers, and from itself."""

RENDERERS_MAY = set().union(*LAYERS[: 1 + next(row for row, units in enumerate(LAYERS) if "renderer" in units)])
"""The reference renderers know geometry, devices and the protocol: all that a third party's may know."""

RUNNING = {
    "adapters",
    "api",
    "simulation",
    "discovery",
    "hardware",
    "rigid_contact",
    "runner",
    "search",
    "study",
    "replay",
    "commands",
    "pytest_plugin",
    "cli",
    "__main__",
}
RESULTS = {
    "runner.events",
    "runner.diff",
    "runner.results",
    "runner.standing",
    "study.bench.document",
    "study.projection_field.field",
    "study.thesis.printed",
}
"""Modules of running units that only hold what a run leaves: they import no more than reports do."""

REPORTS_MAY = (set().union(*LAYERS) - RUNNING) | RESULTS
"""Reports read results and never run anything."""

SATELLITES = {
    "checks": ("phenomena.checks", "phenomena.measures"),
    "effects": tuple(
        f"effects.{file.stem}"
        for file in sorted((ROOT / "hapticeval" / "effects").glob("*.py"))
        if file.stem not in ("__init__", "catalogue", "effect")
    ),
    "ideal": ("rigid_contact",),
    "search": ("search",),
    "lab": (
        "hardware",
        "recordings.formats",
        "recordings.importing",
        "recordings.integrity",
        "recordings.journal",
        "recordings.recorder",
        "replay",
        "reports.integrity_figure",
    ),
    "study": ("study",),
    "cluster": ("runner.cluster",),
}
"""Rooms beside the core, which imports none of them: whoever follows a verdict from a suite to a report reads none but
those that the verdict is about, one check of all, one renderer, the effects of its scene."""

DOORS = {
    ("runner.execution", "runner.cluster"): "where a scheduler is named",
    ("api", "search.counterexample"): "where counterexamples are listed",
    ("reports.effects_figure", "effects.texture"): "where the spectrum of a texture is drawn",
    ("reports.effects_figure", "phenomena.measures.closed_paths"): "where the work round a lap is",
}
"""What the core opens on demand, inside a function; the commands of a satellite do so too."""

REGISTRIES = {("phenomena.registry", "phenomena.checks")}
"""Who imports a folder to look for modules in it, and none of them by its name."""

SOURCES = [
    (file, file.relative_to(ROOT / folder).parts[0].removesuffix(".py") if folder == "hapticeval" else folder)
    for folder in ("hapticeval", "renderers", "reports")
    for file in sorted((ROOT / folder).rglob("*.py"))
    if file != ROOT / "hapticeval" / "__init__.py"
]
ROOT_INIT = (ROOT / "hapticeval" / "__init__.py").read_text(encoding="utf-8")


def allowed(unit: str) -> set[str]:
    """The units that `unit` may import."""
    if unit in ("renderers", "reports"):
        return {unit} | (RENDERERS_MAY if unit == "renderers" else REPORTS_MAY)
    level = next((level for level, layer in enumerate(LAYERS) if unit in layer), None)
    if level is None:
        raise AssertionError(f"'{unit}' has no layer: give it one here and in ARCHITECTURE.md")
    return {unit}.union(*LAYERS[:level])


def imports(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Line and unit of every import of ours, lazy ones and those for typing too; relative ones are refused."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"line {node.lineno}: a relative import hides what it depends on"
            if node.module == "hapticeval":
                yield from ((node.lineno, alias.name) for alias in node.names)
            elif node.module is not None and node.module.startswith("hapticeval."):
                yield node.lineno, _unit(node.module)
        elif isinstance(node, ast.Import):
            for alias in node.names:
                if alias.name.split(".")[0] == "hapticeval":
                    yield node.lineno, _unit(f"{alias.name}.")


def _unit(module: str) -> str:
    name = module.removeprefix("hapticeval.")
    return name if name in RESULTS else name.split(".")[0]


def violations(source: str, unit: str) -> list[str]:
    """The imports in `source` that `unit` may not have. The version is free to all."""
    free = allowed(unit) | {"__version__"}
    if unit in RUNNING:
        free |= {name for name in RESULTS if name.split(".")[0] in free}
    tree = parsed(source)
    found = [f"line {line}: {unit} imports {name}" for line, name in imports(tree) if name not in free]
    return [text for text in found if not _lazy_reports(tree, text, unit)]


def _lazy_reports(tree: ast.AST, text: str, unit: str) -> bool:
    """Only the command line may write reports, and it imports them inside the function that does."""
    line = int(text.removeprefix("line ").partition(":")[0])
    inside = any(
        isinstance(node, ast.FunctionDef) and node.lineno < line <= (node.end_lineno or 0) for node in ast.walk(tree)
    )
    return unit in ("api", "cli", "commands") and text.endswith(" imports reports") and inside


def test_imports_point_downwards() -> None:
    upwards = {file: violations(file.read_text(encoding="utf-8"), unit) for file, unit in SOURCES}
    assert {file: lines for file, lines in upwards.items() if lines} == {}


def satellite_of(module: str) -> str | None:
    """The satellite that a module of the package belongs to; None in the core."""
    return next(
        (name for name, rooms in SATELLITES.items() for room in rooms if f"{module}.".startswith(f"{room}.")), None
    )


def opened_satellites(source: str) -> Iterator[tuple[str, bool]]:
    """Yield the modules of satellites that a source imports, and whether it does so at once, when it is imported."""
    tree = parsed(source)
    # Within a function, or for types alone: not when the module is imported.
    late = {
        line
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef) or (isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test))
        for line in range(node.lineno, (node.end_lineno or 0) + 1)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("hapticeval."):
            module = (node.module or "").removeprefix("hapticeval.")
            # A module may be named in what is imported: from hapticeval.recordings import formats.
            names = [module, *(f"{module}.{alias.name}" for alias in node.names)]
            named = next((name for name in names if satellite_of(name)), None)
            if named is not None:
                yield named, node.lineno not in late


def modules_of(file: Path) -> Iterator[str]:
    """Yield the modules of ours that a file imports, lazily and for types too: each as a path below the root."""
    for node in ast.walk(parsed(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("hapticeval."):
            parts = (node.module or "").split(".")[1:]
            for alias in node.names:
                yield from (".".join(module) for module in ([*parts, alias.name], parts))


def circles(imported: Mapping[str, set[str]]) -> list[str]:
    """Return the modules on a circle of imports, or between two: what is left without those at either end of all."""
    left = {module: others - {module} for module, others in imported.items()}
    while True:
        needed = set().union(*left.values())
        kept = {
            module: others & left.keys() for module, others in left.items() if module in needed and others & left.keys()
        }
        if kept == left:
            return sorted(left)
        left = kept


def test_no_file_is_imported_by_what_it_imports() -> None:
    names = {
        file: ".".join(file.relative_to(ROOT).with_suffix("").parts).removeprefix("hapticeval.") for file, _ in SOURCES
    }
    # A package is imported with each module in it: only what is a file of its own counts.
    files = {name: set(modules_of(file)) for file, name in names.items() if file.name != "__init__.py"}
    assert circles(files) == []


def test_a_circle_of_files_is_seen() -> None:
    assert circles({"a": {"b"}, "b": {"c"}, "c": set()}) == []
    assert circles({"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"a"}, "e": set()}) == ["a", "b", "c"]


CORE = {
    module: file
    for file, unit in SOURCES
    for module in [".".join(file.relative_to(ROOT).with_suffix("").parts).removeprefix("hapticeval.")]
    if unit != "renderers" and not satellite_of(module)
}


def test_the_core_imports_no_satellite() -> None:
    for module, file in CORE.items():
        opened = [
            (room, at_once)
            for room, at_once in opened_satellites(file.read_text(encoding="utf-8"))
            if (module, room) not in REGISTRIES
        ]
        # What only holds results may be read by anyone who shows them.
        assert [room for room, at_once in opened if at_once and room not in RESULTS] == [], module
        if not module.startswith("commands."):
            doors = {room for opener, room in DOORS if opener == module}
            assert {room for room, _ in opened} - RESULTS == doors, module


def test_a_satellite_in_the_core_is_seen() -> None:
    at_once = "from hapticeval.recordings.integrity.report import examine"
    assert list(opened_satellites(at_once)) == [("recordings.integrity.report", True)]
    assert list(opened_satellites(f"def f():\n    {at_once}")) == [("recordings.integrity.report", False)]
    assert list(opened_satellites("from hapticeval.recordings import formats")) == [("recordings.formats", True)]


def test_what_only_holds_results_runs_nothing() -> None:
    files = {name: ROOT / "hapticeval" / f"{name.replace('.', '/')}.py" for name in RESULTS}
    running = {name: violations(file.read_text(encoding="utf-8"), "reports") for name, file in files.items()}
    assert {name: lines for name, lines in running.items() if lines} == {}


def test_the_page_on_architecture_shows_these_layers() -> None:
    page = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8").split("\n## Layers\n")[1].split("\n## ")[0]
    rows = [set(re.findall(r"`(\w+)`", line)) for line in page.splitlines() if line.startswith("| ")][1:]
    assert rows == [{"__main__", "cli"}, *reversed(LAYERS[:-2])]


def test_the_package_itself_knows_no_renderer_and_no_report() -> None:
    units = {name for _, name in imports(parsed(ROOT_INIT))}
    assert units <= set().union(*LAYERS) | RESULTS


@pytest.mark.parametrize(
    ("source", "unit"),
    [
        ("from hapticeval.devices.point_mass import PointMass", "geometry"),
        ("from hapticeval.runner import plan", "phenomena"),
        ("import hapticeval.renderers.constraint", "runner"),
        ("def f():\n    from hapticeval import renderers", "cli"),
        ("from hapticeval.reports import write_reports", "cli"),
        ("def f():\n    from hapticeval.reports import write_reports", "runner"),
        ("from hapticeval.runner import execute", "reports"),
        ("from hapticeval.study.bench.sweep import Sweep", "reports"),
        ("from hapticeval.phenomena.registry import CHECKS", "renderers"),
        ("import hapticeval", "geometry"),
    ],
)
def test_a_breach_is_seen(source: str, unit: str) -> None:
    assert violations(source, unit)


def test_the_command_line_may_import_reports_when_it_writes_them() -> None:
    assert violations("def f():\n    from hapticeval.reports import write_reports", "cli") == []


def test_every_folder_of_the_package_is_installed() -> None:
    listed = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["setuptools"]["packages"]
    folders = {file.parent.relative_to(ROOT) for file in (ROOT / "hapticeval").rglob("*.py")}
    portions = {
        "hapticeval.check_pages",
        "hapticeval.examples",
        "hapticeval.examples.engines",
        "hapticeval.examples.studies",
        "hapticeval.renderers",
        "hapticeval.renderers.field",
        "hapticeval.renderers.maps",
        "hapticeval.reports",
        "hapticeval.suites",
    }
    assert {".".join(folder.parts) for folder in folders} | portions == set(listed)


MODULES = {
    re.sub(r"^(?!hapticeval\b)", "hapticeval.", ".".join(file.relative_to(ROOT).with_suffix("").parts)): file
    for folder in ("hapticeval", "renderers", "reports")
    for file in (ROOT / folder).rglob("*.py")
}
"""The package's modules by their dotted names."""

NO_MODULES = {
    "h": "the header for C",
    "checks": "a group of entry points",
    "formats": "likewise",
    "modifiers": "likewise",
}


def unknown_names(text: str) -> list[str]:
    """Return the dotted names in backticks, `hapticeval.MODULE.NAME`, that no module defines or takes from another."""
    return [
        dotted
        for dotted in re.findall(r"`(hapticeval(?:\.\w+)+)[`(]", text)
        if dotted.split(".")[1] not in NO_MODULES and not is_known(dotted)
    ]


def is_known(dotted: str) -> bool:
    """Return whether a dotted name is a module, a folder, or what the module before its last part names."""
    if any(f"{module}.".startswith(f"{dotted}.") for module in MODULES):
        return True
    module, _, name = dotted.rpartition(".")
    file = MODULES.get(module) or MODULES.get(f"{module}.__init__")
    if file is None:
        return "." in module and is_known(module)
    nodes = ast.walk(parsed(file.read_text(encoding="utf-8")))
    return name in {getattr(node, "name", getattr(node, "id", None)) for node in nodes}


def test_what_a_text_refers_to_is_there() -> None:
    unknown = {module: unknown_names(file.read_text(encoding="utf-8")) for module, file in MODULES.items()}
    assert {module: names for module, names in unknown.items() if names} == {}


def test_a_reference_to_what_has_moved_is_seen() -> None:
    assert unknown_names("see `hapticeval.compiled.LAW` and `hapticeval.laws.LAW`") == ["hapticeval.compiled.LAW"]


CONVENTIONS = {
    "CHECK": "the check of a module, by which it is registered",
    "CHECKS": "the checks of a family's module, likewise, and of the registry all of them",
    "EXIT_CODES": "the end of a command's --help",
    "FORMAT_VERSION": "the version of the file that a module writes and reads",
    "T": "a type that a function is generic in",
    "R": "likewise, of what it returns",
}
"""Names that many modules define, since whoever looks for them looks in every module."""


def constants(source: str) -> set[str]:
    """Return the names of the constants that a module defines, without those that it takes from another by its name."""
    names = set()
    for node in parsed(source).body:
        targets = (
            node.targets if isinstance(node, ast.Assign) else [node.target] if isinstance(node, ast.AnnAssign) else []
        )
        for target in targets:
            for name in target.elts if isinstance(target, ast.Tuple) else [target]:
                taken = isinstance(node.value, ast.Attribute) and node.value.attr == getattr(name, "id", None)
                if isinstance(name, ast.Name) and name.id.isupper() and not taken:
                    names.add(name.id)
    return names


def shared_constants(sources: Mapping[str, str]) -> dict[str, list[str]]:
    """Return the constants that several of the modules (name -> source) define, with the modules' names."""
    modules: dict[str, list[str]] = {}
    for module, source in sources.items():
        for name in constants(source):
            modules.setdefault(name, []).append(module)
    return {name: places for name, places in modules.items() if len(places) > 1 and name not in CONVENTIONS}


def test_a_constant_is_defined_in_one_module_of_the_package() -> None:
    """One name has one meaning: what means the same is imported, what does not is called what it is."""
    assert (
        shared_constants({str(file.relative_to(ROOT)): file.read_text(encoding="utf-8") for file, _ in SOURCES}) == {}
    )


@pytest.mark.parametrize(
    "second", ["ROUNDING = 1e-6", "ROUNDING: float = 1e-6", "FREE, ROUNDING = 0, 1", "ROUNDING = kernels.FREE"]
)
def test_a_constant_of_two_modules_is_seen(second: str) -> None:
    assert shared_constants({"a": "ROUNDING = 1e-9", "b": second}) == {"ROUNDING": ["a", "b"]}


@pytest.mark.parametrize(
    "second", ["CHECK = 1", "ROUNDING = stretches.ROUNDING", "from a import ROUNDING", "rounding = 1"]
)
def test_a_convention_and_what_is_taken_from_another_module_may_stand_in_two(second: str) -> None:
    assert shared_constants({"a": "ROUNDING = 1e-9\nCHECK = 2", "b": second}) == {}


IMPORTS = """
import sys
import hapticeval, hapticeval.cli, hapticeval.pytest_plugin
import hapticeval.discovery, hapticeval.renderers, hapticeval.reports
hapticeval.cli.main(["list", "cases"])
print(*sys.modules, sep="\\n")
"""


def test_imports_the_names_of_renderers_and_a_list_of_cases_load_nothing_heavy() -> None:
    done = subprocess.run([sys.executable, "-c", IMPORTS], capture_output=True, text=True, check=True)
    loaded = set(done.stdout.splitlines())
    assert "hapticeval.commands.listing" in loaded
    heavy = {"numba", "scipy", "matplotlib", "h5py", "pandas", "shapely", "jsonschema", "jinja2"}
    assert not loaded & (heavy | {"hapticeval.adapters.library"})


def test_every_public_name_can_be_had() -> None:
    import hapticeval

    missing = [name for name in hapticeval.__all__ if not hasattr(hapticeval, name)]
    assert missing == []
    assert dir(hapticeval) == sorted(hapticeval.__all__)


def test_an_unknown_public_name_is_an_attribute_error() -> None:
    import hapticeval

    with pytest.raises(AttributeError, match="no attribute 'Scnee'"):
        hapticeval.Scnee  # noqa: B018
