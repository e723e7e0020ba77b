"""What a page says of a replay: the differences, the clock, and that the hand would have reacted."""

from __future__ import annotations

import html
import re
from dataclasses import asdict

import numpy as np
import pytest
from reports_synthetic import synthetic_results

from hapticeval.replay import OPEN_LOOP
from hapticeval.reports.html import render_html
from hapticeval.reports.replay_section import COLUMNS, replay_section
from hapticeval.reports.table import matrix
from hapticeval.runner.results import Results, validate

APART = {"rms": 1e-4, "max": 2.5e-3, "time": 1.25, "row": 1250}


def document(note: str, difference: object, **more: object) -> dict[str, object]:
    return {
        "file": "run<7>.h5",
        "note": note,
        "clock": "irregular, 7 to 8 ms",
        "stretches": 3,
        "rows": 4000,
        "rows_left_out": 20,
        "left_out": ["spike in hip.x, 1.2 to 1.3 s"],
        "seconds": 4.0,
        "difference": difference,
        **more,
    }


@pytest.fixture
def replayed() -> Results:
    """The synthetic results, with the runs of their first case as a replay."""
    results = synthetic_results()
    first = results.runs[0]["case"]
    notes = iter(
        [
            document("as it was", None),
            document(OPEN_LOOP, {"ihip": APART, "force": None, "rows": 4000, "contact": None}),
            document(OPEN_LOOP, {"ihip": {**APART, "max": 0.0, "rms": 0.0}, "force": APART, "rows": 9, "contact": 0.1}),
        ]
    )
    for run in results.runs:
        if run["case"] == first:
            run["replay"] = next(notes)
    return results


def test_the_page_tells_how_far_each_renderer_is_and_that_it_is_open_loop(replayed: Results) -> None:
    validate(asdict(replayed))
    page = render_html(replayed, {})
    words = html.unescape(re.sub(r"\s+", " ", re.sub(r"<[^>]*>", " ", page)))
    assert "2.5 mm t = 1.25 s, row 1250" in words
    assert "not recorded" in words
    assert OPEN_LOOP in words
    assert "in 3 stretches, the renderer reset at the start of each" in words
    assert "20 rows are left out (spike in hip.x, 1.2 to 1.3 s)" in words
    assert "irregular, 7 to 8 ms" in words
    assert "run<7>" not in page
    assert "run&lt;7&gt;.h5" in page


def test_other_cases_have_no_such_section() -> None:
    results = synthetic_results()
    assert replay_section(results.runs) is None
    assert "Distance from the recorded run" not in render_html(results, {})


def test_rows_have_a_cell_a_column(replayed: Results) -> None:
    section = replay_section([run for run in replayed.runs if "replay" in run])
    assert section is not None
    assert section.rows
    assert {len(row) for row in section.rows} == {len(COLUMNS)}


def test_a_path_without_answers_has_no_table(replayed: Results) -> None:
    runs = [run for run in replayed.runs if "replay" in run]
    for run in runs:
        if run["replay"]["difference"] is not None:
            run["replay"]["difference"] |= {"ihip": None, "force": None}
    section = replay_section(runs)
    assert section is not None
    assert section.rows == []


def test_no_line_leads_over_a_gap() -> None:
    from matplotlib.figure import Figure

    from hapticeval.reports.figures import _trace

    axes = Figure().add_subplot()
    time = np.concatenate([np.arange(900), 5000.0 + np.arange(900)]) * 1e-3
    _trace(axes, time, np.sin(time), "", "ink")
    across, _ = axes.lines[0].get_data()
    assert np.isnan(across).sum() == 1
    lower, upper = across[: np.argmax(np.isnan(across))], across[np.argmax(np.isnan(across)) + 1 :]
    assert lower.max() < 1.0
    assert upper.min() >= 5.0


def test_a_row_of_the_matrix_has_the_heaviest_of_its_levels(replayed: Results) -> None:
    first = replayed.verdicts[0]
    key = (first["suite"], first["case"], first["check"])
    same = [each for each in replayed.verdicts if (each["suite"], each["case"], each["check"]) == key]
    assert len(same) > 1
    for each in same:
        each["level"] = "must"
    first["level"] = "info"
    row = next(row for row in matrix(replayed) if (row.suite, row.case, row.check) == key)
    assert row.level == "must"
