"""Runs in one dimension against a wall: placed before it, replayed, judged; also those of a real rig."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hapticeval.cli import main
from hapticeval.errors import InputError
from hapticeval.geometry.catalogue import make_model
from hapticeval.recordings.hdf5 import write_recording
from hapticeval.recordings.integrity.report import examine
from hapticeval.recordings.provenance import before_the_wall
from hapticeval.recordings.recording import Recording
from hapticeval.runner.results import read_results

ROOT = Path(__file__).parents[2]
DATA = ROOT.parent / "shared" / "data" / "tue_1dof_teleop"
STIFFNESS = 800.0


def pressed(*, at=0.0, outward=1, **meta):
    """A hand that goes into a wall and out of it twice, with the force of a spring."""
    depth = 3e-3 * np.sin(np.arange(1200) * 0.0105)
    hip = at - outward * depth
    ihip = np.where(depth > 0.0, at, hip)
    force = STIFFNESS * (ihip - hip)
    channels = {name: values[:, None] for name, values in (("hip", hip), ("ihip", ihip), ("force", force))}
    wall = {"wall": {"at": at, "outward": outward}} if (at, outward) != (0.0, 1) else {}
    return Recording(np.arange(1200) * 1e-3, channels, {"source": "file", **wall, **meta})


@pytest.mark.parametrize(("at", "outward"), [(0.0, 1), (0.02, 1), (-0.01, -1)])
def test_places_are_measured_from_the_wall_and_forces_turned_with_it(at, outward):
    placed = before_the_wall(pressed(at=at, outward=outward))
    plain = before_the_wall(pressed())
    for name in ("hip", "ihip", "force"):
        np.testing.assert_allclose(placed.channels[name], plain.channels[name], atol=1e-12)
    assert not placed.hip[:, 0].any()
    assert placed.hip[100, 1] < 0.0 < placed.force[100, 1]
    run, line = pressed(at=at, outward=outward), make_model("line")
    assert {issue.severity for issue in examine(run, model=line, stiffness=STIFFNESS).issues} <= {"note"}
    moved = replace(run, meta={**run.meta, "wall": {"at": at + 0.5e-3, "outward": outward}})
    assert {"surface", "contact"} <= {issue.kind for issue in examine(moved, model=line).issues}


@pytest.mark.parametrize("wall", [{"at": "left"}, {"outward": 2}, {"place": 0.1}, {"at": float("nan")}])
def test_a_wall_that_is_none_is_refused(refused, wall):
    with refused(InputError):
        before_the_wall(pressed(wall=wall))


def test_a_replay_before_a_wall_gives_verdicts(undrawn, tmp_path, capsys):
    write_recording(tmp_path / "run.h5", pressed(at=0.01, outward=-1))
    scene = ["--scene", f"stiffness={STIFFNESS:g}"]
    assert main(["replay", "run.h5", "--model", "circle", *scene]) == 2
    assert "--model line" in capsys.readouterr().err
    main(["replay", "run.h5", "--model", "line", *scene, "-r", "constraint", "-o", "out"])
    verdicts = read_results(tmp_path / "out").verdicts
    outcomes = {(each.renderer, each.check): each.outcome for each in verdicts}
    for check in ("continuous-contact", "contact-normal-force"):
        assert outcomes["recorded", check] == outcomes["constraint", check] == "pass"


@pytest.mark.skipif(not DATA.is_dir(), reason="needs shared/data/tue_1dof_teleop beside the repository")
def test_a_real_contact_log_gets_verdicts(undrawn, tmp_path):
    mapping = ROOT / "examples" / "tue_1dof_teleop.toml"
    log = DATA / "question1a_rigid.mat"
    given = ["--mapping", str(mapping), "--model", "line", "--scene", "stiffness=2000", "-r", "constraint", "-o", "out"]
    assert main(["replay", str(log), *given]) == 1  # its slave is no proxy, and its hand pulls
    verdicts = read_results(tmp_path / "out").verdicts
    outcomes = {(each.renderer, each.check): each.outcome for each in verdicts}
    assert outcomes["constraint", "continuous-contact"] == outcomes["constraint", "contact-normal-force"] == "pass"
    assert outcomes["recorded", "contact-normal-force"] == "fail"
