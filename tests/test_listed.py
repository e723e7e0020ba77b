"""The lists of every check and of every effect in `docs/`: as the code has them.

To write them anew: `make tables`, or HAPTICEVAL_PUBLISH=1 pytest tests/test_listed.py.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path

from publishing import publishing

from hapticeval.effects.catalogue import EFFECTS
from hapticeval.effects.effect import unit_of
from hapticeval.phenomena.pages import read_page
from hapticeval.phenomena.registry import OWN_CHECKS

DOCS = Path(__file__).parents[1] / "docs"
CHECKS_HEAD = """# Every check

A metric up to the bound passes. Each page has the bound with its derivation, what the check does not see,
and common causes of a fail. `hapticeval explain CHECK` prints the short of it, also
for a word of the field such as `jitter`. A check of level `must` decides the exit code, `should` warns,
and `info` is shown.

The site that `make docs` builds, `build/site/index.html`, has for most checks a picture of a renderer that passes
and of one that fails.

| check | level | what it asks |
|---|---|---|
"""
BEFORE, AFTER = "<!-- the table of effects, by make tables -->\n", "<!-- up to here -->\n"


def escaped(text: str) -> str:
    """Return text in which markdown finds nothing to set; what stands in back quotes is taken as it is."""
    parts = text.split("`")
    return "`".join([re.sub(r"([*_|<\[\]])", r"\\\1", part) if not at % 2 else part for at, part in enumerate(parts)])


def checks() -> Iterator[str]:
    """Yield a row for each check: its name with a link to its page, its level and its question."""
    for name, check in OWN_CHECKS.items():
        yield f"| [{name}](checks/{name}.md) | {check.level.value} | {escaped(read_page(check).question)} |\n"


def effects() -> Iterator[str]:
    """Yield a row for each effect: what it does, from its docstring, and its numbers with their units."""
    yield "| kind | what it does | numbers |\n|---|---|---|\n"
    for kind, entry in EFFECTS.items():
        first_sentence = " ".join((entry.of.__doc__ or "").split()).partition(". ")[0]
        said = first_sentence.rstrip(".").removesuffix("; see the module")
        numbers = [
            f"`{number.name}`" + (f" ({unit_of(unit)})" if (unit := number.metadata.get("unit")) else "")
            for number in fields(entry.of)
            if number.compare
        ]
        yield f"| `{kind}` | {escaped(said)} | {', '.join(numbers)} |\n"


def written(page: Path, text: str) -> str:
    """Return what a page says, after it has been written anew where that is asked for."""
    if publishing():
        page.write_text(text, encoding="utf-8")
    return page.read_text(encoding="utf-8")


def test_the_page_is_the_table_of_checks() -> None:
    text = CHECKS_HEAD + "".join(checks())
    assert written(DOCS / "checks.md", text) == text, "make tables writes it anew"


def test_the_page_is_the_table_of_effects() -> None:
    page = DOCS / "effects.md"
    before, _, after = page.read_text(encoding="utf-8").partition(BEFORE)
    text = before + BEFORE + "\n" + "".join(effects()) + "\n" + AFTER + after.partition(AFTER)[2]
    assert written(page, text) == text, "make tables writes it anew"
