"""A real pen stroke: a path with gaps, and no force."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hapticeval.cli import main
from hapticeval.errors import InputError
from hapticeval.recordings.importing.convert import load
from hapticeval.recordings.integrity.report import examine, sound_intervals

ROOT = Path(__file__).parents[2]
DATA = ROOT.parent / "shared" / "data" / "handwriting_svc"
MAPPING = ROOT / "examples" / "handwriting.toml"

pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason="needs shared/data/handwriting_svc beside the repository")


def test_a_stroke_is_a_path_with_gaps_where_the_pen_is_up():
    made = load(DATA / "signal.svc", mapping=MAPPING)
    raw = np.loadtxt(DATA / "signal.svc", skiprows=1)
    assert np.array_equal(made.valid, raw[:, 3] == 1)
    assert np.allclose(made.hip, raw[:, :2] * 1e-3, atol=1e-12)
    assert np.allclose(made.time, raw[:, 2], atol=1e-9)
    assert list(made.channels) == ["hip"]
    with pytest.raises(InputError, match="lacks the channel 'force'"):
        _ = made.force


def test_its_report_has_notes_only():
    made = load(DATA / "signal.svc", mapping=MAPPING)
    report = examine(made)
    assert not report.suspicious
    assert {fault.kind for fault in report.faults} == {"gap"}
    assert report.timing.step == pytest.approx(0.008)
    assert report.timing.rate == pytest.approx(133.1, abs=0.1)
    assert report.timing.jitter[3] == pytest.approx(1e-3)
    intervals = sound_intervals(made, report).sound
    assert len(intervals) == 5
    assert sum(each.end - each.first for each in intervals) == 819


def test_from_file_to_report_by_commands(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["convert", str(DATA / "signal.svc"), "--mapping", str(MAPPING), "-o", "stroke.h5"]) == 0
    assert "559 rows in a gap" in capsys.readouterr().out
    assert main(["inspect", "stroke.h5"]) == 0
    assert "819 of 1378 rows are measurements" in capsys.readouterr().out
    assert (tmp_path / "integrity-stroke.svg").is_file()
