"""Change one operator, comparison or number of a module at a time, and see whether a test fails.

    make mutants                                        all of phenomena, judging, suites and recordings: hours
    make mutants SAMPLE=60 SEED=1                       so many of them, drawn by a seed
    make mutants SAMPLE=20 TARGETS=hapticeval/phenomena/checks/broken_contact.py
    python tests/mutate.py --sample 60 --without tests/meta/test_felt.py     may these tests go?

First all tests run once, the recorded verdicts of whole suites among them, to see which of them reach which line, and
how long each takes; what is known of a file of tests stays known while the file is the same. Of each mutant those that
reach its line run then, the shortest first, until one fails: the mutant is killed. What survives is a test that is
missing, or a mutant that computes the same: these stand in `survivors.toml` with the reason why, and are not counted.
What checks measure is compared too, as by `make measures`, so that a number of a message or of the evidence counts.
Only the tests of the first `SECONDS` run: what longer ones alone would kill survives as well.

With `--without` mutants are of the lines alone that the tests of these files, or these tests, are known to reach. Each
is tried on all other tests. Where it survives them, each of these tests is tried, and all that kill it are told: a test
whose name is not told may go.

No file is changed. Each mutant is tried in a fork of a process that has collected all tests: there the functions are
given the mutant's code. Where what runs on import changes, a new process imports the mutant in place of the file.
Exit code 1 where a mutant survives that is not on the list.
"""

from __future__ import annotations

import argparse
import ast
import gc
import hashlib
import importlib.abc
import importlib.machinery
import importlib.util
import inspect
import itertools
import mmap
import os
import pickle
import random
import resource
import signal
import sys
import tempfile
import time
import tomllib
import traceback
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any, NamedTuple

ROOT = Path(__file__).parents[1]
TARGETS = (
    "hapticeval/phenomena",
    "hapticeval/runner/judging.py",
    "hapticeval/runner/siblings.py",
    "hapticeval/suite",
    "hapticeval/recordings/*.py",
)
"""Files, folders with all that is in them, and patterns: of recordings the type and its file, not what others wrote."""
TESTS = (
    "tests/phenomena",
    "tests/meta",
    "tests/suite",
    "tests/recordings",
    "tests/suites",
    "tests/runner",
    "tests/simulation",
    "tests/devices",
    "tests/test_value_types.py",
)
SURVIVORS = Path(__file__).with_name("survivors.toml")
REACHED = ROOT / ".venv" / "reached.pickle"
"""What is known of files of tests, by name and content: see `Reach`."""
MARKED = "not slow and not browser and not docs"
"""Of the tests that `make test` leaves out, those of whole suites are taken too: they hold metrics and bounds."""
SECONDS = 60.0
"""So many seconds of tests are run of a mutant."""
PATIENCE = 5.0, 10.0
"""A mutant whose test takes so many times what it takes as it is, and so many seconds more, is killed: it hangs."""
KILLED = 3
"""What a process returns in which a test failed."""
WARMED_BY = 0.05, 0.5, 15.0
"""Tests that take between so many seconds, up to so many in all, load the kernels before mutants are tried."""

ALIKE = 1e5
"""From this number on one more is the same number to all digits that a message shows, and a tolerance tells."""

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
SHOWN = ast.expr | ast.Assign | ast.AnnAssign | ast.AugAssign
"""What a mutant is shown in."""
OPPOSITES = {"min": "max", "any": "all", "argmin": "argmax", "minimum": "maximum", "less": "greater", "floor": "ceil"}
OPPOSITES |= {opposite: name for name, opposite in OPPOSITES.items()}


class Mutant(NamedTuple):
    """A change of a module: where it is, the expression before and after, and the source of the whole.

    `function` is the qualified name of the function whose body it is in, and None where it changes what is imported.
    """

    file: str
    line: int
    before: str
    after: str
    source: str
    function: str | None

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
        if abs(node.value) < ALIKE:
            yield lambda: setattr(node, "value", node.value + 1)
        if node.value:
            yield lambda: setattr(node, "value", 2 * node.value)
    elif isinstance(node, ast.Constant) and isinstance(node.value, bool):
        yield lambda: setattr(node, "value", not node.value)
    elif isinstance(node, ast.Name) and node.id in OPPOSITES:
        yield lambda: setattr(node, "id", OPPOSITES[node.id])
    elif isinstance(node, ast.Attribute) and node.attr in OPPOSITES:
        yield lambda: setattr(node, "attr", OPPOSITES[node.attr])


class Place(NamedTuple):
    """A node of a module, its line, the smallest part that shows it in words, and the function whose body it is in."""

    node: ast.AST
    line: int
    shown: ast.AST
    function: str | None


def places(tree: ast.AST) -> Iterator[Place]:
    """Yield each node that may be changed, but those of annotations, format specifications and `strict` of `zip`.

    That one only guards against what is a defect elsewhere, and nothing that is right shows it.
    """
    stack: list[tuple[ast.AST, int, ast.AST, str | None, str]] = [(tree, 1, tree, None, "")]
    while stack:
        node, line, shown, function, prefix = stack.pop()
        line = getattr(node, "lineno", line) if not isinstance(shown, ast.JoinedStr) else line
        small = isinstance(node, ast.Constant | ast.Name) and isinstance(shown, SHOWN)
        if isinstance(node, SHOWN) and not (small or isinstance(shown, ast.JoinedStr)):
            shown = node
        if isinstance(node, ast.keyword) and node.arg == "strict":
            continue
        yield Place(node, line, shown, function)
        for name, value in ast.iter_fields(node):
            if name in ("annotation", "returns", "format_spec"):
                continue
            inside, below = function, prefix
            if function is None and name == "body" and isinstance(node, ast.FunctionDef):
                inside = prefix + node.name
            elif isinstance(node, ast.ClassDef):
                below = f"{prefix}{node.name}."
            children = value if isinstance(value, list) else [value]
            stack += [(child, line, shown, inside, below) for child in children if isinstance(child, ast.AST)]


def count_in(file: Path) -> int:
    """Return how many mutants a module has."""
    return sum(len(list(changes(place.node))) for place in places(ast.parse(file.read_text(encoding="utf-8"))))


def mutant_of(file: Path, number: int) -> Mutant:
    """Return the mutant of a module with that number, from 0."""
    tree = ast.parse(file.read_text(encoding="utf-8"))
    ordered = ((change, place) for place in places(tree) for change in changes(place.node))
    change, place = next(itertools.islice(ordered, number, None))
    before = ast.unparse(place.shown)
    change()
    source = ast.unparse(ast.fix_missing_locations(tree))
    name = file.relative_to(ROOT).as_posix()
    return Mutant(name, place.line, before, ast.unparse(place.shown), source, place.function)


def reached_places(files: Iterable[Path], reach: Reach, tests: Sequence[str]) -> list[tuple[Path, int]]:
    """Return the mutants, by module and number, in lines of functions that tests are known to reach."""
    drawn = []
    for file in files:
        ordered = (place for place in places(ast.parse(file.read_text(encoding="utf-8"))) for _ in changes(place.node))
        for number, place in enumerate(ordered):
            line = reach.line(str(file), place.function, place.line) if place.function else None
            if line and any(test.startswith(tuple(tests)) for test in reach.lines.get(line, ())):
                drawn.append((file, number))
    return drawn


class Line(NamedTuple):
    """A line of a module by what it says, so that it is known again where others were written above it."""

    file: str
    function: str
    text: str


class Reach:
    """Which lines of the targets each test reaches, and its seconds of the processor: a plugin of pytest measures it.

    `lines` has the tests by line, `seconds` the seconds by test, `contents` a digest by file of tests.
    """

    def __init__(self, files: Iterable[str]) -> None:
        self.files = {file: Path(file).read_text(encoding="utf-8").splitlines() for file in files}
        self.lines: dict[Line, set[str]] = defaultdict(set)
        self.seconds: dict[str, float] = {}
        self.contents: dict[str, str] = {}
        self.failed: set[str] = set()
        self.functions = {file: functions_by_line(Path(file).read_text(encoding="utf-8")) for file in self.files}
        self.present = {
            self.line(file, self.functions[file].get(number, ""), number)
            for file, lines in self.files.items()
            for number in range(1, len(lines) + 1)
        }

    def measure(self, item: Any, following: Any) -> None:
        """Run a test, and note what it reaches."""
        from coverage import Coverage

        tracer = Coverage(data_file=None, include=list(self.files), messages=False)
        tracer.set_option("run:disable_warnings", ["no-data-collected"])
        began = time.process_time()
        tracer.start()
        passed = run_item(item, following)
        tracer.stop()
        self.seconds[item.nodeid] = time.process_time() - began
        (self.failed.discard if passed else self.failed.add)(item.nodeid)
        data = tracer.get_data()
        for file in data.measured_files():
            for number in data.lines(file) or ():
                self.lines[self.line(file, self.functions[file].get(number, ""), number)].add(item.nodeid)

    def line(self, file: str, function: str, number: int) -> Line:
        return Line(Path(file).relative_to(ROOT).as_posix(), function, self.files[file][number - 1].strip())

    def forget(self, file: str) -> None:
        """Forget what is known of a file of tests."""
        gone = {test for test in self.seconds if test.partition("::")[0] == file}
        self.failed -= gone
        for test in gone:
            del self.seconds[test]
        for reaching in self.lines.values():
            reaching -= gone

    def tests_of(self, mutant: Mutant) -> set[str]:
        """Return the tests that reach a mutant: its line, or its function, or what uses its name, or its file."""
        file = str(ROOT / mutant.file)
        outside: set[str] = set()
        if mutant.function is not None and file in self.files:
            line = self.line(file, mutant.function, mutant.line)
            alike = self.union(lambda other: other[:2] == line[:2] and other not in self.present)
            if tests := self.lines.get(line):
                # What reached lines that were written anew since may reach this one.
                return (tests | alike) - self.failed
            tests = self.union(lambda other: other[:2] == line[:2])
        else:
            name = mutant.before.partition(" ")[0].rstrip(":")
            tests = self.union(lambda other: name.isupper() and name in other.text)
            # What is imported is looked at by tests that run none of it: of tables, pages, types.
            outside = self.seconds.keys() - self.union(lambda _: True)
        return ((tests or self.union(lambda other: other.file == mutant.file)) | outside) - self.failed

    def union(self, chosen: Callable[[Line], bool]) -> set[str]:
        return {test for line, tests in self.lines.items() if chosen(line) for test in tests}

    def load(self) -> None:
        if REACHED.exists():
            self.lines, self.seconds, self.contents, self.failed = pickle.loads(REACHED.read_bytes())

    def save(self) -> None:
        REACHED.write_bytes(pickle.dumps((self.lines, self.seconds, self.contents, self.failed)))


def functions_by_line(source: str) -> dict[int, str]:
    """Return the qualified name of the outermost function that each line of a module is in."""
    names: dict[int, str] = {}
    stack: list[tuple[ast.AST, str]] = [(ast.parse(source), "")]
    while stack:
        node, prefix = stack.pop()
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.FunctionDef):
                lines = range(child.lineno, (child.end_lineno or child.lineno) + 1)
                names |= dict.fromkeys(lines, prefix + child.name)
            else:
                stack.append((child, f"{prefix}{child.name}." if isinstance(child, ast.ClassDef) else prefix))
    return names


def digest(file: str) -> str:
    return hashlib.sha256((ROOT / file).read_bytes()).hexdigest()


class Changed(importlib.machinery.SourceFileLoader):
    """Loads a module from the source of a mutant."""

    source = ""

    def get_code(self, fullname: str) -> CodeType:
        return compile(self.source, self.path, "exec", dont_inherit=True)


def module_of(file: str) -> str:
    return file.removesuffix(".py").removesuffix("/__init__").replace("/", ".")


class Finder(importlib.abc.MetaPathFinder):
    """Finds the module of a mutant's file in the mutant."""

    def __init__(self, mutant: Mutant) -> None:
        self.mutant = mutant
        self.module = module_of(mutant.file)

    def find_spec(self, fullname: str, path: Any = None, target: Any = None) -> Any:
        if fullname != self.module:
            return None
        loader = Changed(fullname, str(ROOT / self.mutant.file))
        loader.source = self.mutant.source
        return importlib.util.spec_from_file_location(fullname, loader.path, loader=loader)


def codes_in(code: CodeType) -> Iterator[CodeType]:
    """Yield a code object, and all that are defined in it."""
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from codes_in(constant)


class Loaded:
    """What of the targets and of the tests is loaded, however it is wrapped, once tests are collected.

    `functions` has the functions of the targets by file and qualified name; `caches` what remembers answers of both.
    """

    def __init__(self, files: Iterable[Path]) -> None:
        for file in files:
            importlib.import_module(module_of(file.relative_to(ROOT).as_posix()))
        names = {str(file) for file in files}
        self.functions: dict[tuple[str, str], list[FunctionType]] = defaultdict(list)
        self.caches: list[Any] = []
        for thing in gc.get_objects():
            if isinstance(thing, FunctionType) and thing.__code__.co_filename in names:
                self.functions[thing.__code__.co_filename, thing.__code__.co_qualname].append(thing)
            elif hasattr(type(thing), "cache_clear"):
                code = getattr(inspect.unwrap(thing), "__code__", None)
                if code is not None and (code.co_filename in names or code.co_filename.startswith(str(ROOT / "tests"))):
                    self.caches.append(thing)


def replacements(mutant: Mutant, loaded: Loaded) -> list[tuple[FunctionType, CodeType]]:
    """Return the functions that a mutant changes with their new code; none where they are not loaded as defined.

    What such a function has defined and returned on import, as one that makes checks does, is changed too.
    """
    file = str(ROOT / mutant.file)
    changed: dict[str, list[CodeType]] = defaultdict(list)
    for code in codes_in(compile(mutant.source, file, "exec", dont_inherit=True)):
        if code.co_qualname == mutant.function or code.co_qualname.startswith(f"{mutant.function}.<locals>."):
            # A property and its setter have one name, and follow each other in both.
            changed[code.co_qualname].append(code)
    pairs: list[tuple[FunctionType, CodeType]] = []
    for name, codes in changed.items():
        by_line: dict[int, list[FunctionType]] = defaultdict(list)
        for function in loaded.functions[file, name]:
            by_line[function.__code__.co_firstlineno].append(function)
        if len(by_line) == len(codes):
            alike = (functions for _, functions in sorted(by_line.items()))
            pairs += [(function, code) for code, functions in zip(codes, alike, strict=True) for function in functions]
        elif name == mutant.function:
            return []
    return pairs


def put_in_place(function: FunctionType, code: CodeType) -> None:
    """Give a function other code; one that is compiled is called without being compiled from then on."""
    function.__code__ = code
    module = sys.modules[function.__module__]
    if getattr(getattr(module, function.__name__, None), "py_func", None) is function:
        setattr(module, function.__name__, function)


def run_item(item: Any, following: Any) -> bool:
    """Run a test that was collected, and return whether it passed; `following` comes next, None for the last."""
    reports: list[Any] = []
    noting = type("Noting", (), {"pytest_runtest_logreport": lambda _, report: reports.append(report)})()
    item.config.pluginmanager.register(noting)
    try:
        item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
    finally:
        item.config.pluginmanager.unregister(noting)
    return not any(report.failed for report in reports)


def be_silent() -> None:
    if not os.environ.get("LOUD"):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, 1)
        os.dup2(nowhere, 2)


def in_child(work: Callable[[], int], seconds: float = 600.0, *, alone: bool = True) -> int:
    """Return what work in a process of its own returns; not 0 where it is ended, or takes longer than it may.

    What it starts ends with it, if `alone`.
    """
    child = os.fork()
    if child == 0:
        code = 1
        try:
            if alone:
                os.setsid()
            code = work()
        except BaseException:
            traceback.print_exc()
        finally:
            sys.stdout.flush()
            os._exit(code)
    end = time.monotonic() + seconds
    done = 0
    try:
        while time.monotonic() < end:
            done, status = os.waitpid(child, os.WNOHANG)
            if done:
                return os.waitstatus_to_exitcode(status)
            time.sleep(0.02)
    finally:
        if not done:
            (os.killpg if alone else os.kill)(child, signal.SIGKILL)
            os.waitpid(child, 0)
    return -signal.SIGKILL


def fail(items: Sequence[Any], seconds: dict[str, float], reached: Any) -> int:
    """Run tests in this process until one fails; return `KILLED` then, and 0 where none does.

    `reached` is memory that is shared with the process that asks: the number of the test that runs is written there.
    One that hangs ends the process.
    """
    factor, more = PATIENCE
    for number, (item, following) in enumerate(itertools.zip_longest(items, items[1:])):
        reached[:4] = number.to_bytes(4, "little")
        _, hard = resource.getrlimit(resource.RLIMIT_CPU)
        limit = int(time.process_time() + factor * seconds[item.nodeid] + more) + 1
        resource.setrlimit(resource.RLIMIT_CPU, (limit, hard))
        if not run_item(item, following):
            return KILLED
    return 0


class Trial:
    """A pytest plugin that tries mutants on the tests that were collected, in place of running them."""

    def __init__(self, work: Callable[[dict[str, Any], Loaded], int], files: Iterable[Path], missing: int) -> None:
        self.work, self.files = work, files
        self.code = missing

    def pytest_collection_modifyitems(self, items: list[Any]) -> None:
        self.loaded = Loaded(self.files)

    def pytest_runtestloop(self, session: Any) -> bool:
        self.code = self.work({item.nodeid: item for item in session.items}, self.loaded)
        return True


def with_tests(
    tests: Iterable[str],
    work: Callable[[dict[str, Any], Loaded], int],
    files: Iterable[Path] = (),
    *,
    missing: int = 1,
) -> int:
    """Collect tests, and return what `work` returns, given them by name and what of `files` is loaded.

    It is `missing` where they cannot be collected.
    """
    import pytest

    trial = Trial(work, files, missing)
    options = ["-q", "-s", "-p", "no:cacheprovider", "-p", "no:xdist", "-p", "no:faulthandler", "--assert=plain"]
    pytest.main([*options, "-m", MARKED, "-o", "timeout=0", *tests], plugins=[trial])
    return trial.code


def know_tests(reach: Reach, items: dict[str, Any]) -> int:
    """Run the tests of files that are not known, or changed, and write down what they reach."""
    reach.load()
    contents = {file: digest(file) for file in sorted({name.partition("::")[0] for name in items})}
    for file, content in contents.items():
        same = reach.contents.get(file) == content
        if not same:
            reach.forget(file)
        # What failed may have done so for what is mended since, and tests may have other names.
        unknown = [
            item
            for name, item in items.items()
            if name.partition("::")[0] == file and (not same or name in reach.failed or name not in reach.seconds)
        ]
        for item, following in itertools.zip_longest(unknown, unknown[1:]):
            reach.measure(item, following)
        if unknown:
            reach.contents[file] = content
            reach.save()
    return 0


def warm_up(reach: Reach, items: dict[str, Any], loaded: Loaded) -> None:
    """Run some tests, so that kernels are loaded; what they keep of the modules that are changed is forgotten."""
    shortest, longest, budget = WARMED_BY
    some = {name.partition("[")[0]: name for name in items if shortest < reach.seconds.get(name, 0.0) < longest}
    for name in some.values():
        if budget > 0.0:
            budget -= reach.seconds[name]
            run_item(items[name], None)
    for cache in loaded.caches:
        cache.cache_clear()


def ordered_tests(mutant: Mutant, reach: Reach, without: tuple[str, ...]) -> list[str]:
    """Return the tests that a mutant is tried on, the shortest first, up to `SECONDS` in all."""
    others = (test for test in reach.tests_of(mutant) if not test.startswith(without))
    ordered = sorted(others, key=lambda test: reach.seconds[test])
    ends = itertools.accumulate(reach.seconds[test] for test in ordered)
    return [test for test, end in zip(ordered, ends, strict=True) if end <= SECONDS]


Run = Callable[[Sequence[str], Mutant | None, Any], int]
"""Runs tests on a mutant, or as all is, in this process; see `fail` for what it is given and returns."""


class Court:
    """Tells of mutants whether they survive their tests. A test that fails as all is kills nothing.

    `without` has the tests that may go, by how their names begin.
    """

    def __init__(self, reach: Reach, run: Run, without: tuple[str, ...]) -> None:
        self.reach, self.run, self.without = reach, run, without
        self.trusted: set[str] = set()

    def survives(self, mutant: Mutant) -> bool | None:
        """Return whether all tests that reach a mutant pass; None where no test reaches it."""
        tests = ordered_tests(mutant, self.reach, self.without)
        if not tests:
            return None
        while tests:
            failed = self.failed(tests, mutant)
            if failed is None:
                break
            test = tests[failed]
            if test in self.trusted or self.failed([test], None) is None:
                self.trusted.add(test)
                return False
            print(f"fails there as it is, and is left out: {test}", flush=True)
            self.reach.failed.add(test)
            tests = tests[failed + 1 :]
        return True

    def killers(self, mutant: Mutant) -> list[str]:
        """Return all of the tests that may go that kill a mutant."""
        tests = sorted(test for test in self.reach.tests_of(mutant) if test.startswith(self.without))
        killers = []
        while (failed := self.failed(tests, mutant) if tests else None) is not None:
            if self.failed([tests[failed]], None) is None:
                killers.append(tests[failed])
            tests = tests[failed + 1 :]
        return killers

    def failed(self, tests: Sequence[str], mutant: Mutant | None) -> int | None:
        """Return which of the tests fails first, and None where none does."""
        reached = mmap.mmap(-1, 4)

        def work() -> int:
            be_silent()
            return self.run(tests, mutant, reached)

        code = in_child(work)
        # What ends the process, as a hang does, is no failure of a test, and kills a mutant all the same.
        if code != KILLED and code >= 0:
            if code > 0:
                raise SystemExit(f"cannot be tried: {'the tests as they are' if mutant is None else mutant.words}")
            return None
        return int.from_bytes(reached[:4], "little")


def listed() -> dict[tuple[str, str, str], str]:
    """Return the survivors that are known, and the reason of each."""
    entries = tomllib.loads(SURVIVORS.read_text(encoding="utf-8")).get("survivor", [])
    return {(entry["file"], entry["before"], entry["after"]): entry["reason"] for entry in entries}


def modules(targets: Iterable[str]) -> list[Path]:
    """Return the files of targets, see `TARGETS`."""
    paths = [path for target in targets for path in ROOT.glob(str(target))]
    return sorted(file for path in paths for file in (path.rglob("*.py") if path.is_dir() else [path]))


class Tally:
    """Tells what comes of each mutant, and what came of all."""

    def __init__(self, total: int) -> None:
        self.total, self.told, self.killed, self.known = total, 0, 0, listed()
        self.survivors: list[Mutant] = []
        self.needed: Counter[str] = Counter()

    def tell(self, mutant: Mutant, survives: bool | None, killers: Sequence[str], seconds: float) -> None:
        reason = self.known.get((mutant.file, mutant.before, mutant.after))
        self.told += 1
        self.killed += survives is False
        words = {False: "killed", True: "survives", None: "survives, reached by no test"}[survives]
        because = f" ({reason})" if reason and survives is not False else ""
        print(f"[{self.told}/{self.total}] {words}{because}: {mutant.words} ({seconds:.0f} s)", flush=True)
        for test in killers:
            print(f"    killed by {test}", flush=True)
        self.needed.update(killers)
        if survives is not False and reason is None:
            self.survivors.append(mutant)

    def tell_all(self) -> None:
        counted = self.killed + len(self.survivors)
        share = 100.0 * self.killed / max(counted, 1)
        print(f"{self.killed} of {counted} killed ({share:.0f} %), {self.total - counted} as listed")
        for mutant in self.survivors:
            print(f"survives: {mutant.words}")
        for test, count in sorted(self.needed.items()):
            print(f"needed for {count}: {test}")


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("targets", nargs="*", default=TARGETS)
    parser.add_argument("--sample", type=int, help="try so many of the mutants")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--tests", nargs="+", default=TESTS)
    parser.add_argument(
        "--without", nargs="+", default=(), metavar="TESTS", help="files of tests, or tests, that may go"
    )
    options = parser.parse_args(arguments)
    for name in ("numpy", "scipy.optimize", "scipy.spatial", "scipy.interpolate", "numba", "shapely", "h5py"):
        importlib.import_module(name)  # once, before each process is forked
    files = modules(options.targets)
    reach = Reach(str(file) for file in modules(TARGETS) + files)
    without = tuple(options.without)
    if without:
        reach.load()
        drawn = reached_places(files, reach, without)
    else:
        drawn = [(file, number) for file in files for number in range(count_in(file))]
    if options.sample is not None:
        drawn = random.Random(options.seed).sample(drawn, min(options.sample, len(drawn)))
    mutants = [mutant_of(*place) for place in drawn]
    print(f"{len(mutants)} mutants of {len(files)} modules", flush=True)
    tally, left = Tally(len(mutants)), []

    def try_on(court: Court, mutant: Mutant) -> None:
        began = time.monotonic()
        survives = court.survives(mutant)
        killers = [] if survives is False else court.killers(mutant)
        tally.tell(mutant, survives, killers, time.monotonic() - began)

    def try_those_in_functions(items: dict[str, Any], loaded: Loaded) -> int:
        def run_here(tests: Sequence[str], mutant: Mutant | None, reached: Any) -> int:
            for function, code in () if mutant is None else replacements(mutant, loaded):
                put_in_place(function, code)
            return fail([items[test] for test in tests], reach.seconds, reached)

        if in_child(lambda: know_tests(reach, items), seconds=7200.0):
            raise SystemExit("the tests cannot be run")
        reach.load()
        reach.failed |= reach.seconds.keys() - items.keys()  # those that are not collected
        for test in sorted(reach.failed & items.keys()):
            print(f"fails as it is, and is left out: {test}", flush=True)
        warm_up(reach, items, loaded)
        court = Court(reach, run_here, without)
        for mutant in mutants:
            if replacements(mutant, loaded):
                try_on(court, mutant)
            else:
                left.append(mutant)
        state = tally.told, tally.killed, tally.survivors, tally.needed, reach.failed, left
        told.write_bytes(pickle.dumps(state))
        return 0

    def run_anew(tests: Sequence[str], mutant: Mutant | None, reached: Any) -> int:
        if mutant is not None:
            sys.meta_path.insert(0, Finder(mutant))
        names = sorted({test.partition("::")[0] for test in tests})
        return with_tests(
            names, lambda items, _: fail([items[test] for test in tests], reach.seconds, reached), missing=KILLED
        )

    with tempfile.TemporaryDirectory() as folder:
        told = Path(folder) / "told"
        # This process imports nothing that is changed.
        if in_child(lambda: with_tests(options.tests, try_those_in_functions, files), seconds=1e6, alone=False):
            return 2
        tally.told, tally.killed, tally.survivors, tally.needed, gone, left = pickle.loads(told.read_bytes())
    reach.load()
    reach.failed |= gone
    court = Court(reach, run_anew, without)
    for mutant in left:
        try_on(court, mutant)
    tally.tell_all()
    return int(bool(tally.survivors))


if __name__ == "__main__":
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.environ.setdefault("MPLBACKEND", "Agg")
    os.environ.setdefault("HAPTICEVAL_MEASURES", "1")
    os.chdir(ROOT)
    sys.exit(main(sys.argv[1:]))
