"""`hapticeval view`: recordings of every dimension on a page, judged where their scene is known."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from hapticeval.cli import main
from hapticeval.recordings.hdf5 import write_recording
from hapticeval.recordings.recording import Recording

ROOT = Path(__file__).parents[2]
DATA = ROOT.parent / "shared" / "data"
META = {"source": "hardware", "gains": {"stiffness": 1000.0, "damping": 0.0}}


def pressing(dimension, **meta):
    """A hand that presses 1 mm into the half space below zero and lets go, sampled for a second."""
    time = np.arange(1000) * 1e-3
    hip = np.zeros((1000, dimension))
    hip[:, 0] = 0.02 * time
    hip[:, -1] = 0.001 * np.cos(2.0 * np.pi * time)
    ihip = hip.copy()
    ihip[:, -1] = np.maximum(hip[:, -1], 0.0)
    return Recording(time, {"hip": hip, "ihip": ihip, "force": 1000.0 * (ihip - hip)}, {**META, **meta})


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def written_page(capsys):
    path = Path(capsys.readouterr().out.strip().splitlines()[-1].removeprefix("wrote "))
    return path.read_text(encoding="utf-8")


def test_a_recording_of_one_dimension_is_drawn_and_judged(here, capsys):
    write_recording(here / "wall.h5", pressing(1))
    assert main(["view", "wall.h5"]) == 0
    text = written_page(capsys)
    assert "place (mm)" in text
    assert 'id="recorded/contact-normal-force"' in text
    assert "Model: line" in text


def test_a_recording_in_the_plane_is_judged_before_the_model_that_is_given(here, capsys):
    write_recording(here / "run.h5", pressing(2))
    assert main(["view", "run.h5", "--model", "line", "-o", "page"]) == 0
    text = written_page(capsys)
    assert (here / "page" / "assets" / "case.js").is_file()
    assert 'id="recorded/continuous-contact"' in text


def test_without_model_or_stiffness_it_is_shown_and_the_reason_given(here, capsys):
    write_recording(here / "run.h5", Recording(np.arange(50) * 1e-3, {"hip": np.zeros((50, 3))}))
    assert main(["view", "run.h5"]) == 0
    out = capsys.readouterr().out
    assert "Not judged, for want of the model that was touched" in out
    assert "--scene stiffness=1000" in out
    assert "No check gave a verdict" in (here / "view-run" / "index.html").read_text(encoding="utf-8")


def test_a_model_of_another_dimension_is_refused(here, capsys):
    write_recording(here / "run.h5", pressing(2))
    assert main(["view", "run.h5", "--model", "sphere"]) == 2
    assert "the recording is in 2D" in capsys.readouterr().err


def test_two_recordings_lie_on_one_page_with_the_verdicts_of_both(here, capsys):
    write_recording(here / "a.h5", pressing(2))
    # The tool stands still: its contact point is not under the hand.
    still = pressing(2)
    channels = {**still.channels, "ihip": np.where(still.channels["ihip"] > 0.0, still.channels["ihip"], 0.0)}
    channels["ihip"][:, 0] = 0.0
    softer = {"gains": {"stiffness": 500.0, "damping": 0.0}}
    write_recording(here / "b.h5", Recording(still.time, channels, {**META, **softer}))
    assert main(["view", "a.h5", "b.h5", "--model", "line"]) == 0
    assert (here / "view-a-b" / "index.html").is_file()
    text = written_page(capsys)
    for run in ("a", "b"):
        assert f'id="{run}/contact-normal-force"' in text
        assert f"<code>{run}.h5</code>" in text
    assert "recorded/" not in text
    assert "Recordings a and b" in text
    assert re.search(r"b: [^.]*500 N/m", text)


def test_two_recordings_on_different_models_are_not_laid_over_each_other(here, capsys):
    write_recording(here / "a.h5", pressing(2, model={"kind": "line"}))
    write_recording(here / "b.h5", pressing(2, model={"kind": "circle", "size": 0.2}))
    assert main(["view", "a.h5", "b.h5"]) == 2
    assert "the two recordings are not on the same model" in capsys.readouterr().err
    assert not (here / "view-a-b").exists()


@pytest.mark.skipif(not DATA.is_dir(), reason="needs shared/data beside the repository")
@pytest.mark.parametrize(
    ("file", "mapping", "judged"),
    [
        ("tue_1dof_teleop/question1a_rigid.mat", "tue_1dof_teleop.toml", True),
        ("handwriting_svc/signal.svc", "handwriting.toml", False),
    ],
)
def test_foreign_files_are_shown_through_a_mapping(here, capsys, file, mapping, judged):
    more = ["--scene", "stiffness=2000"] if judged else []
    assert main(["view", str(DATA / file), "--mapping", str(ROOT / "examples" / mapping), *more, "-o", "page"]) == 0
    text = written_page(capsys)
    assert ("<li id=" in text) == judged
    assert "case-data" in text
