"""What mkdocs makes of other files: the README, ARCHITECTURE.md, a list of the public names, and pictures.

`make docs` runs the pages first, and takes the pictures that their commands draw. Those that pages link are kept in the
repository, for who reads the pages there; `make pictures` renews them.
"""

from __future__ import annotations

import json
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

import hapticeval
from hapticeval.phenomena.check import Check
from hapticeval.phenomena.registry import CHECKS

ROOT = Path(__file__).parents[1]
PAGES = ROOT / "build" / "pages"
"""Where the pages were run."""

THESIS = ROOT / "results" / "thesis"
"""Where `make run` puts what the thesis shows."""

PICTURE = re.compile(r"\]\(pictures/([\w.-]+\.svg)\)")

USES = {
    "Judge": ("judge", "run", "RunOptions", "Results", "load_suite", "known_renderers", "resolve"),
    "Write a renderer": (
        "Renderer", "RendererFactory", "Response", "TrajectoryRenderer", "Declaration", "Spring", "Scene",
    ),
    "Touch a model": ("make_model",),
    "Draw and read": ("plot_document", "read_recording", "Recording", "results_schema"),
    "Write a check": ("Check", "Runs", "Finding", "Outcome", "Level", "Metric", "Verdict", "compared", "undecided"),
    "Lead a hand": ("Stimulus", "Path", "Experiment", "hand_paths"),
    "Errors": (
        "HapticevalError", "InputError", "UnknownNameError", "NothingSelectedError", "RefusalError", "RendererError",
    ),
}  # fmt: skip
"""The public names by what they are for, the most used first."""

SOURCE = re.compile(r"\[([^\]]+)\]\(\.\./[^)]+\)")


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the generated pages."""
    readme = (ROOT / "README.md").read_text(encoding="utf-8").replace("](docs/", "](")
    pages = {
        "index.md": linked(readme),
        "architecture.md": (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8"),
        "contributing.md": (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8").replace("](docs/", "]("),
        "changelog.md": (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"),
        "api.md": "\n".join(reference()),
        "notebooks.md": "\n".join(notebooks()),
        "reports.md": "\n".join(report_links()),
    }
    draw_missing()
    for name, content in pages.items():
        files.append(File.generated(config, name, content=content))
    for drawn in sorted(PAGES.glob("*/pictures/*.svg")):
        address = f"pictures/{drawn.name}"
        if (kept := files.get_file_from_path(address)) is not None:
            files.remove(kept)
        files.append(File.generated(config, address, abs_src_path=str(drawn)))
    # The report of results/ links it as ../thesis/index.html.
    thesis = {"thesis": THESIS} if (THESIS / "index.html").exists() else {}
    for name, folder in (reports() | thesis).items():
        for file in sorted(path for path in folder.rglob("*") if path.is_file()):
            address = f"reports/{name}/{file.relative_to(folder).as_posix()}"
            files.append(File.generated(config, address, abs_src_path=str(file)))
    return files


def draw_missing() -> None:
    """Draw the pictures that no run of the pages has left, by the commands and scripts that the pages name."""
    for page in sorted((ROOT / "docs").glob("*.md")):
        text, folder = page.read_text(encoding="utf-8"), PAGES / page.stem
        wanted = set(PICTURE.findall(text))
        drawn = {path.name for path in PAGES.glob("*/pictures/*.svg")}
        if wanted - drawn - {path.name for path in PAGES.glob("*.py/pictures/*")}:
            # A line of a page that draws says where to: -o pictures.
            for line in re.findall(r"^hapticeval .*-o pictures.*$", text, re.MULTILINE):
                _type(line.partition("#")[0], folder)
    for script in sorted((ROOT / "docs" / "pictures").glob("*.py")):
        if not list((PAGES / script.name).glob("pictures/*.svg")):
            _type(f"{sys.executable} {script}", PAGES / script.name)


def _type(line: str, folder: Path) -> None:
    """Type a line in a folder, with this interpreter's commands first. A study that finds something ends with 1."""
    folder.mkdir(parents=True, exist_ok=True)
    commands = {**os.environ, "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}
    done = subprocess.run(shlex.split(line), cwd=folder, env=commands, capture_output=True, text=True, check=False)
    if done.returncode > 1:
        raise PluginError(f"{line}: exit code {done.returncode}\n{done.stderr}")


def reports() -> dict[str, Path]:
    """Return the folders of the reports that go into the site: those of results*/ beside the documentation."""
    return {
        folder.parent.name: folder
        for folder in sorted(ROOT.glob("results*/report"))
        if (folder / "index.html").exists()
    }


def report_links() -> Iterator[str]:
    """Yield the page that lists the reports."""
    yield "# Reports\n"
    yield "What `hapticeval run` found of the built-in renderers, each verdict with its place.\n"
    for name in reports():
        yield f'- <a href="../reports/{name}/index.html">{name}</a>'
    if (THESIS / "index.html").exists():
        yield '- <a href="../reports/thesis/index.html">The thesis by number</a>, computed and compared'
    if not reports():
        yield "None is in this copy of the site. `make site` judges the built-in renderers and puts their report here."


def notebooks() -> Iterator[str]:
    """Yield a page of the notebooks: their text and code. `make docs` runs them."""
    yield "# Notebooks\n"
    yield "They come with the package, in `hapticeval/examples/notebooks`, and run from their top to their end.\n"
    for path in sorted((ROOT / "examples" / "notebooks").glob("*.ipynb")):
        yield f"## {path.name}\n"
        for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]:
            source = "".join(cell["source"])
            # Its headings stand below the notebook's own.
            text = re.sub(r"^#", "###", source, flags=re.MULTILINE)
            yield f"```python\n{source}\n```\n" if cell["cell_type"] == "code" else f"{text}\n"


def linked(readme: str) -> str:
    """Return the README with links to the site's pages."""
    for name in ("CHANGELOG", "ARCHITECTURE", "CONTRIBUTING"):
        readme = readme.replace(f"]({name}.md)", f"]({name.lower()}.md)")
    return readme


def on_page_markdown(markdown: str, page: Page, **_: object) -> str:
    """Turn links to the README into links to the first page; other files of the repository are named without one."""
    if page.file.src_uri.startswith("checks/"):
        return with_facts(markdown, CHECKS[Path(page.file.src_uri).stem])
    return SOURCE.sub(r"\1", markdown.replace("](../README.md", "](index.md"))


def with_facts(markdown: str, check: Check) -> str:
    """Return the page of a check with its pictures, formula and what else stands in the code, below its question."""
    facts = {
        "formula": f"`{check.formula}`",
        "metric": escaped(f"{check.metric} ({check.unit})" if check.unit else check.metric),
        "level": check.level.value,
        "reads": ", ".join(check.channels),
        "also runs": escaped("; ".join(check.siblings.values())),
        "source": escaped(check.citation),
    }
    lines = [f"**{title}** {text}\n" for title, text in facts.items() if text]
    drawn = {word: f"pictures/check-{check.id}-{word}.svg" for word in ("passes", "fails")}
    lines += [
        f"![A renderer that {word} {check.id}.](../{picture})\n"
        for word, picture in drawn.items()
        if (PAGES / "checks.py" / picture).exists()
    ]
    before, heading, after = markdown.partition("## ")
    return before + "\n".join(lines) + "\n" + heading + after


def reference() -> Iterator[str]:
    """Yield a page of every public name of the package, by its use, from the docstrings."""
    yield "# Reference\n"
    yield "All names are imported from `hapticeval` itself. Lengths are in m, times in s, forces in N.\n"
    listed = {name for names in USES.values() for name in names}
    others = [name for name in hapticeval.__all__ if name in hapticeval._LAZY and name not in listed]
    for use, names in {**USES, "Other names": others}.items():
        yield f"\n## {use}"
        for name in names:
            yield f"\n::: {hapticeval._LAZY[name]}.{name}\n    options:\n      heading: hapticeval.{name}"


def escaped(text: str) -> str:
    """Return text in which markdown finds nothing to set."""
    return re.sub(r"([*_|<\[\]])", r"\\\1", text)
