"""Change one operator, comparison or number of a module at a time, and see whether a test fails.

    make mutants                                        all of phenomena, judging, suites and recordings: hours
    make mutants SAMPLE=60 SEED=1                       so many of them, drawn by a seed
    .venv/bin/python tests/mutate.py --sample 20 hapticeval/phenomena/checks/broken_contact.py

First all tests run once, the recorded verdicts of whole suites among them, to see which of them reach which line, and
how long each takes. Of each mutant those that reach its line run then, the shortest first, until one fails: the mutant
is killed. What survives is a test that is missing, or a mutant that computes the same: these stand in `survivors.toml`
with the reason why, and are not counted.

No file is changed: each mutant is tried in a process of its own, which imports the changed module in place of the file.
Exit code 1 where a mutant survives that is not on the list.
"""

from __future__ import annotations

import argparse
import ast
import contextlib
import importlib.abc
import importlib.machinery
import importlib.util
import itertools
import os
import random
import signal
import sys
import time
import tomllib
import traceback
from collections import defaultdict
from collections.abc import Callable, Iterator
from pathlib import Path
from types import CodeType, FrameType
from typing import Any, NamedTuple

ROOT = Path(__file__).parents[1]
TARGETS = ("hapticeval/phenomena", "hapticeval/runner/judging.py", "hapticeval/suite", "hapticeval/recordings")
TESTS = ("tests/phenomena", "tests/meta", "tests/suite", "tests/recordings", "tests/suites", "tests/runner")
SURVIVORS = Path(__file__).with_name("survivors.toml")
MARKED = "not slow and not browser and not docs"
"""Of the tests that `make test` leaves out, those of whole suites are taken too: they hold metrics and bounds."""
PATIENCE = 3.0, 60.0
"""A mutant is ended, and counts as killed, after so many times what its tests take, and so many seconds more."""

# The last is the opposite; those before it differ where both sides are equal, which is asked of counts alone.
COMPARISONS: dict[type[ast.cmpop], tuple[type[ast.cmpop], ...]] = {
    ast.Lt: (ast.LtE, ast.Gt),
    ast.LtE: (ast.Lt, ast.GtE),
    ast.Gt: (ast.GtE, ast.Lt),
    ast.GtE: (ast.Gt, ast.LtE),
    ast.Eq: (ast.NotEq,),
    ast.NotEq: (ast.Eq,),
    ast.Is: (ast.IsNot,),
    ast.IsNot: (ast.Is,),
    ast.In: (ast.NotIn,),
    ast.NotIn: (ast.In,),
}
OPERATORS: dict[type[ast.AST], type[ast.AST]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd,
    ast.And: ast.Or,
    ast.Or: ast.And,
}
OPPOSITES = {"min": "max", "any": "all", "argmin": "argmax", "minimum": "maximum", "less": "greater", "floor": "ceil"}
OPPOSITES |= {opposite: name for name, opposite in OPPOSITES.items()}


class Mutant(NamedTuple):
    """A change of a module: where it is, the expression before and after, and the source of the whole."""

    file: str
    line: int
    before: str
    after: str
    source: str

    @property
    def words(self) -> str:
        return f"{self.file}:{self.line}: {self.before}  ->  {self.after}"


def _counts(side: ast.expr) -> bool:
    """Return whether a side of a comparison is a whole number, by its looks: measured ones are never just equal."""
    words = ast.unparse(side)
    whole = isinstance(side, ast.Constant) and isinstance(side.value, int)
    counts = words.startswith("len(") or words.endswith((".size", "tick", "ticks", "count"))
    return whole or (counts and not words.endswith("model.size"))  # a model's size is a length


def changes(node: ast.AST) -> Iterator[Callable[[], None]]:
    """Yield what may be changed of a node itself, each as a function that does so."""
    if isinstance(node, ast.Compare):
        counts = any(_counts(side) for side in (node.left, *node.comparators))
        for place, operator in enumerate(node.ops):
            others = COMPARISONS[type(operator)]
            for other in others if counts else others[-1:]:
                yield lambda place=place, other=other: node.ops.__setitem__(place, other())  # type: ignore[misc]
    elif isinstance(node, ast.BinOp | ast.BoolOp | ast.AugAssign) and type(node.op) in OPERATORS:
        yield lambda: setattr(node, "op", OPERATORS[type(node.op)]())
    elif isinstance(node, ast.UnaryOp):
        yield lambda: setattr(node, "operand", ast.UnaryOp(type(node.op)(), node.operand))  # taken back
    elif isinstance(node, ast.Constant) and type(node.value) in (int, float):
        yield lambda: setattr(node, "value", node.value + 1)
        if node.value:
            yield lambda: setattr(node, "value", 2 * node.value)
    elif isinstance(node, ast.Constant) and isinstance(node.value, bool):
        yield lambda: setattr(node, "value", not node.value)
    elif isinstance(node, ast.Name) and node.id in OPPOSITES:
        yield lambda: setattr(node, "id", OPPOSITES[node.id])
    elif isinstance(node, ast.Attribute) and node.attr in OPPOSITES:
        yield lambda: setattr(node, "attr", OPPOSITES[node.attr])


def expressions(tree: ast.AST) -> Iterator[tuple[ast.AST, int, ast.AST]]:
    """Yield each node that may be changed, its line, and the smallest part that shows it in words.

    Not those of annotations and of format specifications.
    """
    stack: list[tuple[ast.AST, int, ast.AST]] = [(tree, 1, tree)]
    while stack:
        node, line, shown = stack.pop()
        line = getattr(node, "lineno", line) if not isinstance(shown, ast.JoinedStr) else line
        small = isinstance(node, ast.Constant | ast.Name) and isinstance(shown, ast.expr | ast.Assign | ast.AnnAssign)
        if isinstance(node, ast.expr | ast.Assign | ast.AnnAssign) and not (small or isinstance(shown, ast.JoinedStr)):
            shown = node
        yield node, line, shown
        for name, value in ast.iter_fields(node):
            if name in ("annotation", "returns", "format_spec"):
                continue
            children = value if isinstance(value, list) else [value]
            stack += [(child, line, shown) for child in children if isinstance(child, ast.AST)]


def count_in(file: Path) -> int:
    """Return how many mutants a module has."""
    return sum(len(list(changes(node))) for node, _, _ in expressions(ast.parse(file.read_text(encoding="utf-8"))))


def mutant_of(file: Path, number: int) -> Mutant:
    """Return the mutant of a module with that number, from 0."""
    tree = ast.parse(file.read_text(encoding="utf-8"))
    ordered = ((change, line, shown) for node, line, shown in expressions(tree) for change in changes(node))
    change, line, shown = next(itertools.islice(ordered, number, None))
    before = ast.unparse(shown)
    change()
    source = ast.unparse(ast.fix_missing_locations(tree))
    return Mutant(file.relative_to(ROOT).as_posix(), line, before, ast.unparse(shown), source)


class Reach:
    """A pytest plugin that notes which lines of the targets each test reaches, and its seconds."""

    def __init__(self, files: set[str]) -> None:
        self.files = files
        self.lines: dict[tuple[str, int], set[str]] = defaultdict(set)
        self.seconds: dict[str, float] = defaultdict(float)
        self.test = ""

    def trace(self, frame: FrameType, event: str, argument: Any) -> Any:
        file = frame.f_code.co_filename
        if file not in self.files:
            return None
        self.lines[file, frame.f_lineno].add(self.test)
        return self.trace

    def pytest_runtest_logstart(self, nodeid: str) -> None:
        self.test, self.began = nodeid, time.perf_counter()
        sys.settrace(self.trace)

    def pytest_runtest_logfinish(self) -> None:
        sys.settrace(None)
        self.seconds[self.test] += time.perf_counter() - self.began


class Changed(importlib.machinery.SourceFileLoader):
    """Loads a module from the source of a mutant."""

    source = ""

    def get_code(self, fullname: str) -> CodeType:
        return compile(self.source, self.path, "exec", dont_inherit=True)


class Finder(importlib.abc.MetaPathFinder):
    """Finds the module of a mutant's file in the mutant."""

    def __init__(self, mutant: Mutant) -> None:
        self.mutant = mutant
        self.module = mutant.file.removesuffix(".py").removesuffix("/__init__").replace("/", ".")

    def find_spec(self, fullname: str, path: Any = None, target: Any = None) -> Any:
        if fullname != self.module:
            return None
        loader = Changed(fullname, str(ROOT / self.mutant.file))
        loader.source = self.mutant.source
        return importlib.util.spec_from_file_location(fullname, loader.path, loader=loader)


def run_tests(arguments: list[str], plugin: object | None = None, *, quiet: bool = not os.environ.get("LOUD")) -> int:
    import pytest

    with contextlib.ExitStack() as stack:
        if quiet:
            nowhere = stack.enter_context(Path(os.devnull).open("w"))
            os.dup2(nowhere.fileno(), 1)
            os.dup2(nowhere.fileno(), 2)
        options = ["-x", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", "-p", "no:faulthandler", "--assert=plain"]
        options += ["-m", MARKED]
        return int(pytest.main([*options, *arguments], plugins=[plugin] if plugin else []))


def in_child(work: Callable[[], int], seconds: float) -> int:
    """Return what work in a process of its own returns; 1 where it takes longer and is ended."""
    child = os.fork()
    if child == 0:
        code = 1
        try:
            os.setsid()
            code = work()
        except BaseException:
            traceback.print_exc()
        finally:
            os._exit(code)
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(status)
        time.sleep(0.05)
    os.killpg(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return 1


def measured(files: set[str], tests: list[str]) -> Reach:
    """Run all tests once in a process of its own, and return what they reach."""
    import pickle
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        kept = Path(folder) / "reach"

        def work() -> int:
            reach = Reach(files)
            code = run_tests(tests, reach)
            kept.write_bytes(pickle.dumps((dict(reach.lines), dict(reach.seconds))))
            return code

        if in_child(work, 7200.0):
            raise SystemExit("the tests fail as they are: there is nothing to compare mutants with")
        reach = Reach(files)
        reach.lines, reach.seconds = pickle.loads(kept.read_bytes())
    return reach


def survives(mutant: Mutant, reach: Reach) -> bool | None:
    """Return whether all tests that reach a mutant pass; None where no test reaches its line."""
    file = str(ROOT / mutant.file)
    tests = set(reach.lines.get((file, mutant.line), ()))
    if "" in tests or not tests:  # what runs when the module is imported reaches all that use the module
        tests |= {test for (other, _), reached in reach.lines.items() if other == file for test in reached}
    tests -= {""}
    if not tests:
        return None
    ordered = sorted(tests, key=lambda test: reach.seconds[test])

    def work() -> int:
        sys.meta_path.insert(0, Finder(mutant))
        return run_tests(ordered)

    factor, more = PATIENCE
    return in_child(work, factor * sum(reach.seconds[test] for test in tests) + more) == 0


def listed() -> dict[tuple[str, str, str], str]:
    """Return the survivors that are known, and the reason of each."""
    entries = tomllib.loads(SURVIVORS.read_text(encoding="utf-8")).get("survivor", [])
    return {(entry["file"], entry["before"], entry["after"]): entry["reason"] for entry in entries}


def modules(targets: list[str]) -> list[Path]:
    """Return the files of targets, which are files and folders; without the formats of files, which have their own."""
    paths = [ROOT / target for target in targets]
    return sorted(file for path in paths for file in (path.rglob("*.py") if path.is_dir() else [path]))


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("targets", nargs="*", default=TARGETS)
    parser.add_argument("--sample", type=int, help="try so many of the mutants")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--tests", nargs="+", default=TESTS)
    given = parser.parse_args(arguments)
    for name in ("numpy", "scipy.optimize", "scipy.spatial", "scipy.interpolate", "numba", "shapely", "h5py"):
        importlib.import_module(name)  # once, before each mutant's process is forked
    files = modules(list(given.targets))
    drawn = [(file, number) for file in files for number in range(count_in(file))]
    total = len(drawn)
    if given.sample is not None:
        drawn = random.Random(given.seed).sample(drawn, min(given.sample, total))
    print(f"{len(drawn)} of {total} mutants of {len(files)} modules", flush=True)
    reach = measured({str(file) for file in files}, [str(test) for test in given.tests])
    known, survivors, killed = listed(), [], 0
    for number, place in enumerate(drawn, 1):
        began, mutant = time.monotonic(), mutant_of(*place)
        state = survives(mutant, reach)
        reason = known.get(mutant[:1] + mutant[2:4])
        killed += state is False
        words = {False: "killed", True: "survives", None: "survives, reached by no test"}[state]
        took = time.monotonic() - began
        print(f"[{number}/{len(drawn)}] {words}{f' ({reason})' if reason and state is not False else ''}: "
              f"{mutant.words} ({took:.0f} s)", flush=True)  # fmt: skip
        if state is not False and reason is None:
            survivors.append(mutant)
    counted = killed + len(survivors)
    print(f"{killed} of {counted} killed ({100.0 * killed / max(counted, 1):.0f} %), {len(drawn) - counted} as listed")
    for mutant in survivors:
        print(f"survives: {mutant.words}")
    return int(bool(survivors))


if __name__ == "__main__":
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.environ.setdefault("MPLBACKEND", "Agg")
    os.chdir(ROOT)
    sys.exit(main(sys.argv[1:]))
