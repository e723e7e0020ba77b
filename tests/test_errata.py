"""docs/errata.md: each correction in the code has a row, and each row names a file that cites its equation."""

import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "errata.md").read_text(encoding="utf-8")
NUMBERED = tomllib.loads((ROOT / "tests" / "thesis.toml").read_text(encoding="utf-8"))["equations"]
EQUATION = re.compile(r"\(([2-8]\.\d+)\)")
SOURCES = [file for folder in ("hapticeval", "renderers") for file in sorted((ROOT / folder).rglob("*.py"))]

CORRECTED = re.compile(r"correct|errat|as printed|than printed|the print of|renormalised|sign and factor")
"""What a comment or docstring says where it departs from the print."""


def rows(heading):
    """The rows of the table below a heading, each as its cells."""
    section = PAGE.split(f"\n## {heading}\n", 1)[1].partition("\n## ")[0]
    lines = [line for line in section.splitlines() if line.startswith("| ")]
    return [[cell.strip() for cell in line.strip("|").split(" | ")] for line in lines[1:]]


USED = rows("In the code")


def departures(source):
    """The equations beside what says that the print is not followed, in the same part of a sentence."""
    for sentence in re.split(r"\n\s*\n|\.\s|: |;|\n +- ", source):
        for match in CORRECTED.finditer(sentence):
            follows = match[0] == "the print of"
            cited = EQUATION.findall(sentence[match.end() :] if follows else sentence[: match.start()])
            yield from cited[:1] if follows else cited[-1:]


@pytest.mark.parametrize("row", USED, ids=lambda row: row[0])
def test_a_row_names_a_file_that_cites_its_equation(row):
    assert len(row) == 5
    (equation,) = EQUATION.findall(row[0])
    chapter, number = equation.split(".")
    assert int(number) <= NUMBERED[chapter]
    assert f"({equation})" in (ROOT / row[4].strip("`")).read_text(encoding="utf-8")


def test_each_correction_in_the_code_has_a_row():
    listed = {equation for row in USED for equation in EQUATION.findall(row[0])}
    missing = {
        f"{file.relative_to(ROOT)}: ({equation})"
        for file in SOURCES
        for equation in departures(file.read_text(encoding="utf-8"))
        if equation not in listed
    }
    assert missing == set()


def test_a_correction_without_a_row_is_seen():
    assert list(departures("v by (7.14) with its signs\n    corrected. And (2.3) is as it is.")) == ["7.14"]
    assert list(departures("the J̇ that the print of (2.9) lost")) == ["2.9"]
    assert list(departures("(4.15), renormalised")) == ["4.15"]
    assert list(departures("as (4.8) has it")) == []


def test_the_rows_of_the_code_are_in_order_and_said_once():
    numbers = [tuple(map(int, EQUATION.findall(row[0])[0].split("."))) for row in USED]
    assert numbers == sorted(set(numbers))
