"""Every check has its page, and what is printed of it is what stands there."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest
from refusals import Refusals

from hapticeval.errors import InputError
from hapticeval.phenomena.pages import parse_page, read_page
from hapticeval.phenomena.registry import OWN_CHECKS

FOLDER = Path(__file__).parents[2] / "docs" / "checks"
HEADINGS = ["Bound", "What it does not see", "When it fails"]
LONGEST_TITLE = 70
"""Characters: titles stand in one row of what `hapticeval explain` prints, and beside verdicts."""

TOY = "# toy\n\nIs it *weak*,\nas `toys` are?\n\n## Bound\n\nHalf a [newton](x.md).\n\nNo more.\n\n- derivation\n"


def test_every_check_has_a_page_and_every_page_a_check() -> None:
    assert {file.stem for file in FOLDER.glob("*.md")} == set(OWN_CHECKS)


@pytest.mark.parametrize("check", OWN_CHECKS)
def test_a_page_has_the_parts_that_a_reader_looks_for(check: str) -> None:
    text = (FOLDER / f"{check}.md").read_text(encoding="utf-8")
    page = read_page(OWN_CHECKS[check])
    assert text.startswith(f"# {check}\n\n{page.question[:10]}")
    assert re.findall(r"^## (.+)$", text, re.MULTILINE) == [*["Also called"] * bool(page.also_called), *HEADINGS]
    assert page.question.endswith("?")
    assert page.items
    assert all(item.title and len(item.title) <= LONGEST_TITLE for item in page.items)
    # A kind leads to one item.
    kinds = [kind for item in page.items for kind in item.kinds]
    assert len(kinds) == len(set(kinds))
    assert "" not in kinds
    assert page.text == text


@pytest.mark.parametrize("check", OWN_CHECKS)
def test_the_bound_is_said_in_a_few_lines(check: str) -> None:
    assert len(read_page(OWN_CHECKS[check]).bound.split()) <= 65


@pytest.mark.parametrize("check", OWN_CHECKS)
def test_a_page_names_checks_and_pages_that_exist(check: str) -> None:
    text = (FOLDER / f"{check}.md").read_text(encoding="utf-8")
    assert all((FOLDER / link).is_file() for link in re.findall(r"\]\(([^)]+\.md)\)", text))
    prefixes = ("shading-", "texture-", "friction-", "transient-", "contact-normal", "broken-", "abrupt-")
    named = set(re.findall(r"`([a-z]+(?:-[a-z]+)+)`", text))
    assert {name for name in named if name.startswith(prefixes)} <= set(OWN_CHECKS)


def test_a_page_is_read_as_plain_text() -> None:
    page = parse_page(TOY + "\n## When it fails\n\n1. **Heavy.** Take `less`. <!-- mass -->\n2. Other. See x.\n")
    assert page.question == "Is it weak, as toys are?"
    assert page.bound == "Half a newton. No more."
    assert [(item.number, item.title, item.text, item.kinds) for item in page.items] == [
        (1, "Heavy", "Heavy. Take less.", ("mass",)),
        (2, "Other", "Other. See x.", ()),
    ]
    assert page.also_called == ()


def test_a_page_may_say_what_others_call_it() -> None:
    page = parse_page(TOY.replace("## Bound", "## Also called\nlight weight,\n*slack*\n\n## Bound"))
    assert page.also_called == ("light weight", "slack")
    assert page.question == "Is it weak, as toys are?"


def test_a_page_may_list_no_causes() -> None:
    assert parse_page(TOY).items == ()
    assert parse_page(TOY).item_of({}) is None


@pytest.mark.parametrize(
    ("evidence", "number"),
    [
        ({}, 1),
        ({"cause": "gain"}, 1),
        ({"cause": "gain + drag"}, 1),
        ({"cause": "gain at depths"}, 2),
        ({"cause": "gain at depths + lag"}, 2),
        ({"cause": "gains"}, None),
        ({"cause": "lag"}, None),
        ({"kind": "let go"}, 2),
        ({"kind": "let go", "cause": "gain"}, 1),
        ({"kind": "let go", "cause": "unexplained"}, 2),
        ({"cause": "unexplained"}, None),
    ],
)
def test_a_finding_leads_to_the_item_of_its_kind(evidence: dict[str, str], number: int | None) -> None:
    items = "1. **One.** <!-- gain -->\n2. **Two.** <!-- gain at depths, let go -->\n"
    item = parse_page(f"{TOY}\n## When it fails\n\n{items}").item_of(evidence)
    assert (item and item.number) == number


@pytest.mark.parametrize(
    "text", ["", "# toy\n", "# toy\n\nIs it weak?\n", "## Bound\n\nHalf.\n", TOY.replace("## B", "## b")]
)
def test_a_page_without_a_question_or_a_bound_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="begins with its question"):
        parse_page(text)


def test_a_check_without_a_page_is_refused_by_name(refused: Refusals) -> None:
    check = replace(OWN_CHECKS["drift"], id="no-such-check")
    with refused(InputError):
        read_page(check)


def test_a_check_of_another_package_brings_its_page() -> None:
    assert read_page(replace(OWN_CHECKS["drift"], id="toy", page=TOY)).question == "Is it weak, as toys are?"
