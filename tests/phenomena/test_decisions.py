"""The one table of what decides a verdict: complete, each constant with its reason, its page as the module has it."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest
from publishing import publishing

from hapticeval.phenomena import decisions

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "decisions.md"
CHECKS = ROOT / "hapticeval" / "phenomena"
HEAD = """# What decides a verdict

A check compares what it measures with a bound, and the bound is made of the sampling, of what the renderer declares,
and of the constants on this page. Each has its derivation, or the word *chosen*, and what changes when it is doubled.
Those of the checks of effects come last. `hapticeval explain CHECK` prints the bound of a check.

The page is written of `hapticeval/phenomena/decisions.py`, which the checks import.
"""


def constants(file: Path) -> list[tuple[str, str, str]]:
    """Name, value as it is written, and docstring of each constant of a module."""
    body = ast.parse(file.read_text(encoding="utf-8")).body
    found = []
    for node, after in zip(body, [*body[1:], None], strict=True):
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]).strip("()").replace(", ", "").isupper():
            said = isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant)
            names = ast.unparse(node.targets[0]).strip("()")
            found.append((names, ast.unparse(node.value), " ".join(after.value.value.split()) if said else ""))
    return found


MAKES_A_CHECK = re.compile(r"(_?check_of_\w+|Check)\(|partial\(Check\b")
"""A call that makes a check, of a family's shared data or of all of it, or that shares data among a family."""


OF_A_MODULE_BELOW = re.compile(r"[a-z_]+\.[A-Z_]+")
TABLE = [
    (name, repr(getattr(decisions, name)) if OF_A_MODULE_BELOW.fullmatch(value) else value, said)
    for name, value, said in constants(Path(decisions.__file__))
]


def page() -> str:
    rows = [f"| `{name}` | `{value}` | {said.replace('|', chr(92) + '|')} |" for name, value, said in TABLE]
    return "\n".join([HEAD, "| constant | value | what it is, and why |", "|---|---|---|", *rows, ""])


@pytest.mark.parametrize(("name", "said"), [(name, said) for name, _, said in TABLE])
def test_each_says_whence_it_is_and_what_doubling_changes(name, said):
    words = said.lower()
    assert "derived" in words or "*chosen*" in words, name
    assert "double" in words or "twice" in words, name


def names_read(file: Path) -> set[str]:
    tree = ast.parse(file.read_text(encoding="utf-8"))
    return {node.id for node in ast.walk(tree) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load)}


def test_each_is_used_by_a_check_or_where_it_comes_from():
    """A module below the checks that measures for them has constants of its own, which the table repeats."""
    files_below = {
        ROOT / "hapticeval" / "recordings" / f"{value.split('.')[0]}.py"
        for _, value, _ in constants(Path(decisions.__file__))
        if OF_A_MODULE_BELOW.fullmatch(value)
    }
    read = set().union(*map(names_read, [*CHECKS.rglob("*.py"), *files_below]))
    for names, _, _ in TABLE:
        for name in names.split(", "):
            assert name in read, f"{name} decides nothing"


def test_no_name_has_two_meanings():
    tabled = [name for names, _, _ in TABLE for name in names.split(", ")]
    others = {
        f"{file.stem}.{name}"
        for file in CHECKS.rglob("*.py")
        if file.stem != "decisions"
        for names, _, _ in constants(file)
        for name in names.split(", ")
        if name in tabled
    }
    assert others == set()
    assert len(set(tabled)) == len(tabled)


def test_each_is_imported_from_the_table_and_under_its_own_name():
    names = {name for names, _, _ in TABLE for name in names.split(", ")}
    # Few files have any of the names: to parse the others takes seconds.
    named = re.compile(rf"\b(?:{'|'.join(names)})\b")
    files = [file for folder in (ROOT / "hapticeval", ROOT / "tests") for file in folder.rglob("*.py")]
    texts = {file: text for file in files if named.search(text := file.read_text(encoding="utf-8"))}
    elsewhere = [
        f"{file.relative_to(ROOT)}: {alias.name}"
        for file, text in texts.items()
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("hapticeval.phenomena")
        for alias in node.names
        if alias.name in names and (node.module != decisions.__name__ or alias.asname)
    ]
    assert elsewhere == []


def test_the_page_is_the_table():
    """To write it anew: HAPTICEVAL_PUBLISH=1 pytest tests/phenomena/test_decisions.py."""
    if publishing():
        PAGE.write_text(page())
    assert PAGE.read_text() == page()


def test_the_page_has_the_values_that_are_imported():
    rows = [row.split("`") for row in PAGE.read_text().splitlines() if row.startswith("| `")]
    assert rows
    for _, names, _, value, *_ in rows:
        values = eval(value, dict(vars(decisions)))
        for name, number in zip(names.split(", "), values if "," in names else (values,), strict=True):
            assert getattr(decisions, name) == number, name


def test_no_check_keeps_a_number_of_its_own():
    """Whatever decides stands in the table; these shape what is shown, mark, or are facts of a double or a unit."""
    shown = {"closed_form.MOMENTS", "crossings.FACE_SAMPLES", "crossings.TOOL_RESTS", "crossings.UNDECIDED"}
    shown |= {"texture.DECIBELS", "lag.KINDS_OF_LAG"}
    shown.add("inherent.LIMITS")  # its only digits are the numbers of sections and equations
    kept = {
        f"{file.stem}.{name}"
        for file in CHECKS.rglob("*.py")
        if file.stem != "decisions"
        for names, value, _ in constants(file)
        for name in names.split(", ")
        if any(letter.isdigit() for letter in value)
        and not value.startswith(("'", '"', "{", "f'"))
        and not MAKES_A_CHECK.match(value)
    }
    assert kept - shown == set()


PLAIN_NUMBERS = {0, 0.5, 1, 2, 3}
"""Numbers that count, halve or double, in the code of a check: none of them was chosen."""


def deciding_numbers(source: str) -> list[str]:
    """Return where a comparison, what is allowed, or the bound of a verdict has a number that is not plain."""
    tree, deciding = ast.parse(source), []
    for node in ast.walk(tree):
        if isinstance(node, ast.Compare) or (
            isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) in ("allowed", "bound")
        ):
            deciding.append(node)
        elif isinstance(node, ast.Call) and ast.unparse(node.func) == "compared":
            deciding.append(node.args[1])
    return [
        ast.unparse(node)
        for node in deciding
        for number in ast.walk(node)
        if isinstance(number, ast.Constant) and type(number.value) in (int, float) and number.value not in PLAIN_NUMBERS
    ]


@pytest.mark.parametrize("file", sorted(CHECKS.rglob("*.py")), ids=lambda file: file.stem)
def test_no_number_decides_in_the_code_of_a_check(file):
    assert deciding_numbers(file.read_text(encoding="utf-8")) == []


@pytest.mark.parametrize("code", ["x <= 8.0 * y", "allowed = a + 4.0 * b", "compared(metric, 1.5 * dt, evidence)"])
def test_a_number_that_decides_in_code_would_be_seen(code):
    assert len(deciding_numbers(code)) == 1
    assert deciding_numbers(code.replace("8.0", "2.0").replace("4.0", "2.0").replace("1.5", "0.5")) == []


@pytest.mark.parametrize("file", sorted(CHECKS.rglob("*.py")), ids=lambda file: file.stem)
def test_the_data_of_a_check_hold_no_number(file):
    """Nor does what the checks of a family share: a number there would decide beside the table."""
    calls = [
        node
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call) and MAKES_A_CHECK.match(ast.unparse(node))
    ]
    numbers = [
        ast.unparse(constant)
        for call in calls
        for constant in ast.walk(call)
        if isinstance(constant, ast.Constant) and type(constant.value) in (int, float)
    ]
    assert numbers == []


def test_a_number_in_the_data_of_a_check_would_be_seen():
    assert MAKES_A_CHECK.match(ast.unparse(ast.parse("check_of_shading(id='a', judge=partial(f, 0.5))")))
    assert MAKES_A_CHECK.match("Check(id='a')")
    assert MAKES_A_CHECK.match("partial(Check, level=1)")
    assert not MAKES_A_CHECK.match("partial(judge_each, 3)")
