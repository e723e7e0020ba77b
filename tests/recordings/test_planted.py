"""Of every planted fault something is found where the model is known, and of the clean logs nothing: the page's table.

`make tables` writes the tables of docs/logs.md anew.
"""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import pytest
from planted import CLEAN, CUBE, NAMED_AS, PLANTED, SHOWN_BY_COLUMNS, STIFFNESS
from publishing import publishing

from hapticeval.files import replacing
from hapticeval.recordings.integrity.issue import Issue, Severity
from hapticeval.recordings.integrity.report import examine

PAGE = Path(__file__).parents[2] / "docs" / "logs.md"


@cache
def found(name: str, modelled: bool) -> tuple[Issue, ...]:
    """What an examination complains of."""
    run = (CLEAN | PLANTED)[name]()
    report = examine(run, model=CUBE, stiffness=STIFFNESS) if modelled else examine(run)
    return tuple(issue for issue in report.issues if issue.severity is not Severity.NOTE)


def kinds(name: str, modelled: bool) -> str:
    """The kinds, each once, in their order: a table's cell."""
    return ", ".join(dict.fromkeys(issue.kind for issue in found(name, modelled))) or "nothing"


def named(name: str) -> str:
    """The cause that is named with the model: by the diagnosis, or a kind that the columns alone show; else nothing."""
    causes = [str(issue.measures["cause"]) for issue in found(name, True) if "cause" in issue.measures]
    shown = [issue.kind for issue in found(name, True) if issue.kind in SHOWN_BY_COLUMNS]
    return next((cause for cause in [*causes, *shown] if cause != "unexplained"), "")


@pytest.mark.parametrize("modelled", [True, False], ids=["model", "alone"])
@pytest.mark.parametrize("name", CLEAN)
def test_nothing_is_found_in_a_clean_log(name, modelled):
    assert found(name, modelled) == ()


@pytest.mark.parametrize("name", PLANTED)
def test_every_planted_fault_is_found_with_the_model_and_what_is_named_was_planted(name):
    assert found(name, True) != ()
    assert named(name) == NAMED_AS[name] if name in NAMED_AS else named(name) in {"", *SHOWN_BY_COLUMNS}


def table(title: str, names: dict) -> str:
    rows = [f"| {name} | {kinds(name, True)} | {named(name) or '-'} | {kinds(name, False)} |" for name in names]
    return "\n".join([f"| {title} | with the model | cause named | without |", "|---|---|---|---|", *rows])


def test_the_page_has_the_tables_of_what_is_found():
    text = PAGE.read_text(encoding="utf-8")
    for mark, names in (("planted", PLANTED), ("clean", CLEAN)):
        block = f"<!-- {mark} -->\n{table(mark, names)}\n<!-- end -->"
        written = re.sub(rf"<!-- {mark} -->.*?<!-- end -->", lambda _, block=block: block, text, flags=re.DOTALL)
        assert block in written
        if publishing():
            text = written
        assert written == text, "make tables"
    counts = [sum(found(name, modelled) != () for name in PLANTED) for modelled in (True, False)]
    causes = sum(named(name) != "" for name in PLANTED)
    seen = f"Of {len(PLANTED)} planted faults {counts[0]} are seen with the model, {counts[1]} without"
    stated = f"{seen}, and of {causes} the cause is named; of {len(CLEAN)} clean logs none is complained of."
    if publishing():
        text = re.sub(r"Of \d+ planted faults .*?(none is complained of|none)\.", lambda _: stated, text)
        with replacing(PAGE) as temporary:
            temporary.write_text(text, encoding="utf-8")
    assert stated in text
