"""A recording in space from file to page: its own column, other renderers beside it, and where its renderer follows."""

from __future__ import annotations

import numpy as np
import pytest
from leading import led

from hapticeval.cli import main
from hapticeval.geometry.catalogue import make_model
from hapticeval.recordings.hdf5 import write_recording
from hapticeval.recordings.recording import Recording
from hapticeval.renderers import minimum_distance
from hapticeval.replay import RECORDED
from hapticeval.runner.results import read_results
from hapticeval.scene import Scene

pytestmark = pytest.mark.usefixtures("in_process")

SOLIDS = {
    "sphere": {"kind": "sphere", "size": 0.1},
    "ellipsoid": {"kind": "ellipsoid"},
    "torus": {"kind": "torus"},
}


def dipping(model, *, depth=3e-3, rows=600):
    """A hand that goes round near the surface, into it and out again."""
    time = 1e-3 * np.arange(rows)
    around = np.column_stack([np.cos(3.0 * time), np.sin(3.0 * time), 0.2 + 0.1 * np.sin(5.0 * time)])
    frame = model.boundary.closest_point(0.1 * around)
    dip = -depth * np.clip(np.sin(10.0 * time), -0.3, 1.0)
    return time, frame.foot + dip[:, np.newaxis] * frame.normal


def log_of(kind, folder, *, tilt=0.0):
    """A log by the minimum-distance renderer, whose force leans by `tilt` (rad) about the z axis."""
    model = make_model(**SOLIDS[kind])
    time, hip = dipping(model)
    ihip, force = led(minimum_distance(Scene(model=model)), hip, 1e-3)
    c, s = np.cos(tilt), np.sin(tilt)
    turned = np.asarray(force) @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    meta = {"renderer": "minimum-distance", "scene": {"stiffness": 1000.0, "model": SOLIDS[kind]}}
    write_recording(folder / "log.h5", Recording(time, {"hip": hip, "ihip": ihip, "force": turned}, meta))
    return folder / "log.h5"


def outcomes(folder):
    found = {}
    for verdict in read_results(folder).verdicts:
        found.setdefault(verdict.renderer, {})[verdict.check] = verdict.outcome
    return found


@pytest.mark.parametrize("kind", SOLIDS)
def test_a_log_in_space_is_judged_beside_other_renderers(undrawn, tmp_path, capsys, kind):
    log = log_of(kind, tmp_path)
    out = tmp_path / "out"
    assert main(["replay", str(log), "-r", "minimum-distance", "-r", "set-stabilisation", "-o", str(out)]) == 0
    found = outcomes(out)
    assert list(found) == [RECORDED, "minimum-distance", "set-stabilisation"]
    for renderer, checks in found.items():
        assert checks["continuous-contact"] == checks["contact-normal-force"] == "pass", renderer
        assert checks["broken-contact"] == checks["abrupt-switch"] == "not-applicable"
        assert checks["impulsive-collision"] == checks["centripetal-force"] == "inconclusive"
    first = read_results(out).runs[1].replay.difference
    assert first.ihip.max == first.force.max == 0.0
    assert main(["replay", str(log), "--as-recorded"]) == 0
    assert capsys.readouterr().out.count("follows to the last bit") == 2


def test_a_log_in_space_is_drawn(tmp_path):
    out = tmp_path / "out"
    assert main(["replay", str(log_of("torus", tmp_path)), "-r", "minimum-distance", "-o", str(out)]) == 0
    (page,) = (out / "report" / "cases").rglob("*.html")
    text = page.read_text()
    assert 'class="case-data"' in text, "what the browser draws"
    assert all(f'<figure class="{part}"' in text for part in ("plane", "plots")), (
        "the model, and what is felt against time"
    )


def test_a_force_in_space_that_leans_off_the_normal_fails_and_does_not_follow(undrawn, tmp_path, capsys):
    log = log_of("ellipsoid", tmp_path, tilt=0.3)
    out = tmp_path / "out"
    assert main(["replay", str(log), "-r", "minimum-distance", "-o", str(out)]) == 1
    assert outcomes(out)[RECORDED]["contact-normal-force"] == "fail"
    assert outcomes(out)["minimum-distance"]["contact-normal-force"] == "pass"
    assert main(["replay", str(log), "--as-recorded"]) == 1
    assert "force" in capsys.readouterr().out
