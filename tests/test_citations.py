"""What the package cites of the thesis is there: its sections, equations, figures and tables, of `thesis.toml`."""

from __future__ import annotations

import io
import re
import tokenize
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
NUMBERED = tomllib.loads((ROOT / "tests" / "thesis.toml").read_text(encoding="utf-8"))
FOLDERS = ("hapticeval", "renderers", "reports", "suites", "docs")
FILES = sorted(
    file
    for folder in FOLDERS
    for file in (ROOT / folder).rglob("*")
    if file.suffix in (".py", ".toml", ".md") and "field" not in file.parts
)

NUMBER = r"[2-8A]\.\d+(?:\.\d+)*"
BRACKETED = re.compile(r"\(([2-8]\.\d{1,2}(?:\.\d)?)\)")
"""An equation is cited as (7.38), a section also as (6.3.2); numbers of more digits, or less than 2, are values."""

NAMED = re.compile(
    rf"(Figures?|Tables?|[Ss]ections?|thesis) ({NUMBER})((?:(?:,| and| to) {NUMBER}(?!\d| ?[a-zA-Z%]))*)"
)
CITATION = re.compile(r'\bcitation ?= ?"([^"]*)"')


def known(kind: str, number: str) -> bool:
    """Whether the thesis has a section, an equation, a figure or a table of that number."""
    if number.count(".") == 2:
        return number in NUMBERED["sections"]
    if kind in ("equation", "figure"):
        chapter, _, last = number.partition(".")
        return last.isdigit() and 1 <= int(last) <= NUMBERED[f"{kind}s"].get(chapter, 0)
    return number in NUMBERED[f"{kind}s"] + (NUMBERED["problems"] if kind == "section" else [])


def prose(file: Path) -> str:
    """What a file says to its readers: of Python strings and comments, of others all."""
    text = file.read_text(encoding="utf-8")
    if file.suffix != ".py":
        return text
    tokens = tokenize.generate_tokens(io.StringIO(text).readline)
    return "\n".join(token.string for token in tokens if token.type in (tokenize.COMMENT, tokenize.STRING))


def unknown(text: str) -> Iterator[str]:
    """What a text cites that is not there."""
    for match in BRACKETED.finditer(text):
        if not known("equation", match[1]):
            yield f"({match[1]})"
    for word, first, others in NAMED.findall(text):
        kind = {"f": "figure", "t": "table"}.get(word[0].lower(), "section") if word != "thesis" else "section"
        for number in (first, *re.findall(NUMBER, others)):
            if not known(kind, number):
                yield f"{word} {number}"


def unknown_in_citation(citation: str) -> Iterator[str]:
    """What a citation names that is not there: where nothing else is said, its numbers are sections."""
    kind = "section"
    for part in re.findall(rf"Figures?|Tables?|Problem|;|\({NUMBER}\)|(?<![\w.]){NUMBER}(?![\w.]*\d)", citation):
        if part[0] in "FTP;":
            kind = {"F": "figure", "T": "table"}.get(part[0], "section")
        elif part.startswith("("):
            kind = "section"
            if not known("equation", part[1:-1]):
                yield part
        elif not known(kind, part):
            yield f"{kind} {part}"


def test_what_is_cited_is_there():
    wrong = {file: list(unknown(prose(file))) for file in FILES}
    for file in FILES:
        for citation in CITATION.findall(file.read_text(encoding="utf-8")):
            wrong[file] += unknown_in_citation(citation)
    assert len(wrong) > 400
    assert {file: places for file, places in wrong.items() if places} == {}


@pytest.mark.parametrize(
    ("text", "wrong"),
    [
        ("as the delay (2.6.1) is", ["(2.6.1)"]),
        ("of (7.29), (7.68) and (2.40)", ["(7.68)"]),
        ("Figures 6.22 and 6.24, Table 6.3", ["Figures 6.24"]),
        ("thesis 6.3.2, 6.3.5", ["thesis 6.3.5"]),
        ("sections 3.2.1, 4.1.2 and 4.1.3", []),
    ],
)
def test_a_citation_of_what_is_not_there_is_seen(text, wrong):
    assert list(unknown(text)) == wrong


@pytest.mark.parametrize(
    ("citation", "wrong"),
    [
        ("2.6.1, 5.2", ["section 2.6.1"]),
        ("6.3.2, (6.17), Table 6.1; 7.3.1, (7.29)", []),
        ("6.3.2, Table 6.4; 7.1, Problem 7.1 (b)", ["table 6.4"]),
        ("6.1.2, Figures 6.6 and 6.7; 7.6", ["section 7.6"]),
        ("4.3.2 [99]", []),
    ],
)
def test_a_number_of_a_citation_that_is_not_there_is_seen(citation, wrong):
    assert list(unknown_in_citation(citation)) == wrong
