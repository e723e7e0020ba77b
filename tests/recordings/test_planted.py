"""Of every planted fault something is found where the model is known, and of the clean logs nothing: the page's table.

`make tables` writes the tables of docs/logs.md anew.
"""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import pytest
from planted import CLEAN, CUBE, PLANTED, STIFFNESS
from publishing import publishing

from hapticeval.files import replacing
from hapticeval.recordings.integrity.issue import Severity
from hapticeval.recordings.integrity.report import examine

PAGE = Path(__file__).parents[2] / "docs" / "logs.md"


@cache
def found(name: str, modelled: bool) -> str:
    """What an examination complains of first in words of a table's cell: the kinds, each once, in its order."""
    run = (CLEAN | PLANTED)[name]()
    report = examine(run, model=CUBE, stiffness=STIFFNESS) if modelled else examine(run)
    kinds = [issue.kind for issue in report.issues if issue.severity is not Severity.NOTE]
    return ", ".join(dict.fromkeys(kinds)) or "nothing"


@pytest.mark.parametrize("modelled", [True, False], ids=["model", "alone"])
@pytest.mark.parametrize("name", CLEAN)
def test_nothing_is_found_in_a_clean_log(name, modelled):
    assert found(name, modelled) == "nothing"


@pytest.mark.parametrize("name", PLANTED)
def test_every_planted_fault_is_found_with_the_model(name):
    assert found(name, True) != "nothing"


def table(title: str, names: dict) -> str:
    rows = [f"| {name} | {found(name, True)} | {found(name, False)} |" for name in names]
    return "\n".join([f"| {title} | with the model | without |", "|---|---|---|", *rows])


def test_the_page_has_the_tables_of_what_is_found():
    text = PAGE.read_text(encoding="utf-8")
    for mark, names in (("planted", PLANTED), ("clean", CLEAN)):
        block = f"<!-- {mark} -->\n{table(mark, names)}\n<!-- end -->"
        written = re.sub(rf"<!-- {mark} -->.*?<!-- end -->", lambda _, block=block: block, text, flags=re.DOTALL)
        assert block in written
        if publishing():
            text = written
        assert written == text, "make tables"
    counts = [sum(found(name, modelled) != "nothing" for name in PLANTED) for modelled in (True, False)]
    seen = f"Of {len(PLANTED)} planted faults {counts[0]} are seen with the model, {counts[1]} without"
    stated = f"{seen}; of {len(CLEAN)} clean logs none."
    if publishing():
        text = re.sub(r"Of \d+ planted faults .*? none\.", lambda _: stated, text)
        with replacing(PAGE) as temporary:
            temporary.write_text(text, encoding="utf-8")
    assert stated in text
