"""Real recordings: a teleoperation rig, its units, signs and contacts; and a pen stroke, a path with gaps."""

import shutil
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

from hapticeval.cli import main
from hapticeval.errors import InputError
from hapticeval.recordings.formats import read_table
from hapticeval.recordings.hdf5 import read_recording
from hapticeval.recordings.importing.convert import load
from hapticeval.recordings.integrity.contacts import impacts
from hapticeval.recordings.integrity.report import examine, sound_intervals

ROOT = Path(__file__).parents[2]
DATA = ROOT.parent / "shared" / "data" / "tue_1dof_teleop"
STROKE = ROOT.parent / "shared" / "data" / "handwriting_svc" / "signal.svc"
MAPPING = ROOT / "examples" / "tue_1dof_teleop.toml"
MAPPING_M2 = ROOT / "examples" / "tue_1dof_teleop_m2.toml"
PEN = ROOT / "examples" / "handwriting.toml"
RIGID, FOAM, FREE = "question1a_rigid", "m2_question1a_foam", "question1a_free_motion"
LEVER = 0.075
QUANTUM = 2.0 * np.pi / 300_000

pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason="needs shared/data beside the repository")


@lru_cache
def run(name):
    return load(DATA / f"{name}.mat", mapping=MAPPING_M2 if name == FOAM else MAPPING)


def test_objects_that_only_matlab_reads_are_named_and_the_scopes_are_read():
    table = read_table(DATA / f"{RIGID}.mat")
    assert table.warnings == ()
    assert "Zm (tf)" in table.remarks[0]
    assert "scope.signals[0].values[1]" in table.columns
    assert "scope.signals[0].values[2]" not in table.columns  # the wall, which the label promises
    assert table["scope.time"][0] == pytest.approx(23.3715)


@pytest.mark.parametrize("name", [RIGID, FOAM, FREE])
def test_units_signs_and_clock(name):
    made = run(name)
    assert made.time[0] == 0.0
    assert np.all(np.diff(made.clock.nanoseconds) == 500_000)
    assert np.max(np.abs(made.hip)) < 0.7 * LEVER  # the lever's range
    assert np.array_equal(made.channels["operator_force"], -made.force)
    report = examine(made)
    assert report.columns["hip.x"].quantum == pytest.approx(QUANTUM * LEVER, rel=1e-6)
    assert report.columns["joint_position.1"].quantum == pytest.approx(QUANTUM, rel=1e-6)


@pytest.mark.parametrize("name", [RIGID, FOAM, FREE])
def test_real_measurements_raise_no_suspicion(name):
    report = examine(run(name))
    assert [(issue.kind, issue.severity) for issue in report.issues] == [("copy", "note")]  # the mapping uses it twice
    (interval,) = sound_intervals(run(name), report).sound
    assert (interval.first, interval.end) == (0, len(run(name)))


def test_an_impact_throws_the_hand_back():
    made = run(RIGID)
    for contact in impacts(made).contacts:
        force = made.force[contact.first : contact.end, 0]
        assert force[np.argmax(np.abs(force))] < -4.0


def test_on_foam_the_signs_are_those_of_the_rigs_balance_and_of_energy():
    """Held still, the hand balances the master's motor and the wall the slave's; and a lever gives no energy away."""
    made = run(FOAM)
    still = np.abs(made.velocity[:, 0]) < 4e-3
    motors = made.channels["joint_torque"] / LEVER
    hand = np.polyfit(motors[still, 0], made.channels["operator_force"][still, 0], 1)[0]
    wall = np.polyfit(motors[still, 1], made.channels["wall_force"][still, 0], 1)[0]
    assert hand == pytest.approx(-1.0, abs=0.1)
    assert wall == pytest.approx(-1.0, abs=0.1)
    received = (made.channels["operator_force"][:, 0] + motors[:, 0]) * made.velocity[:, 0]
    assert np.sum(received) * made.dt > 0.0


def test_impacts_on_the_rigid_wall():
    found = impacts(run(RIGID))
    assert len(found.contacts) == 7
    mass = 1.5839e-3 / LEVER**2  # the lever's inertia at the tip
    for each in found.contacts:
        assert each.duration < 0.02
        # J = m (v before - v after), but for the motor and the hand, which push during the impact
        assert each.impulse == pytest.approx(mass * (each.speed_before - each.speed_after), rel=0.2)
        assert 0.35 < each.restitution < 0.55
        assert 2e4 < each.stiffness < 6e4
    assert found.mean("restitution")[0] == pytest.approx(0.467, abs=0.01)
    assert len(found.unexplained) == 1  # the sensor reads a force while the tool leaves


def test_foam_is_some_forty_times_softer_and_gives_no_restitution():
    found = impacts(run(FOAM))
    assert len(found.contacts) == 5
    assert found.mean("stiffness")[0] < impacts(run(RIGID)).mean("stiffness")[0] / 30.0
    assert all(np.isnan(each.restitution) for each in found.contacts)
    assert all(1e-3 < each.depth < 4e-3 for each in found.contacts)


def test_free_motion_is_no_contact():
    assert impacts(run(FREE)).contacts == ()


def test_a_file_cut_short_is_refused_with_the_place(refused, tmp_path):
    data = (DATA / f"{FOAM}.mat").read_bytes()
    path = tmp_path / "cut.mat"
    path.write_bytes(data[: len(data) // 2])
    with refused(InputError) as caught:
        read_table(path)
    assert f"it ends at byte {len(data) // 2}, within the variable that starts at byte" in caught.value.why


def test_from_file_to_report_by_commands(tmp_path, capsys):
    shutil.copy(DATA / f"{RIGID}.mat", tmp_path / "rigid.mat")
    assert main(["inspect", "rigid.mat", "--write-mapping", "proposed.toml"]) == 0
    assert main(["convert", "rigid.mat", "--mapping", "proposed.toml", "-o", "wrong.h5"]) == 2
    assert "is not known" in capsys.readouterr().err  # units are never guessed
    assert main(["convert", "rigid.mat", "--mapping", str(MAPPING), "-o", "rigid.h5"]) == 0
    assert np.array_equal(read_recording(tmp_path / "rigid.h5").hip, run(RIGID).hip)
    assert main(["inspect", "rigid.h5", "-o", "pictures"]) == 0
    shown = capsys.readouterr().out
    assert "contacts above 0.5 N: 7" in shown
    assert "restitution: 0.467" in shown
    assert (tmp_path / "pictures" / "integrity-rigid-h5.png").is_file()


def test_a_pen_stroke_is_a_path_with_gaps_where_the_pen_is_up_and_its_report_has_notes_only(refused):
    made = load(STROKE, mapping=PEN)
    raw = np.loadtxt(STROKE, skiprows=1)
    assert np.array_equal(made.valid, raw[:, 3] == 1)
    assert np.allclose(made.hip, raw[:, :2] * 1e-3, atol=1e-12)
    assert np.allclose(made.time, raw[:, 2], atol=1e-9)
    assert list(made.channels) == ["hip"]
    with refused(InputError):
        _ = made.force
    report = examine(made)
    assert not report.suspicious
    assert {issue.kind for issue in report.issues} == {"gap"}
    assert report.timing.step == pytest.approx(0.008)
    assert report.timing.rate == pytest.approx(133.1, abs=0.1)
    assert report.timing.jitter[3] == pytest.approx(1e-3)
    intervals = sound_intervals(made, report).sound
    assert len(intervals) == 5
    assert sum(each.end - each.first for each in intervals) == 819


def test_from_stroke_to_report_by_commands(tmp_path, capsys):
    assert main(["convert", str(STROKE), "--mapping", str(PEN), "-o", "stroke.h5"]) == 0
    assert "559 rows in a gap" in capsys.readouterr().out
    assert main(["inspect", "stroke.h5"]) == 0
    assert "819 of 1378 rows are measurements" in capsys.readouterr().out
    assert (tmp_path / "integrity-stroke.svg").is_file()
