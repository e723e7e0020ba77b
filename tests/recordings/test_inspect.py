"""`hapticeval inspect` and `convert`: exit codes, pictures, and words; and contacts in one dimension."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hapticeval.cli import main
from hapticeval.errors import InputError
from hapticeval.recordings.hdf5 import write_recording
from hapticeval.recordings.integrity.contacts import Impacts, impacts
from hapticeval.recordings.recording import Clock, Recording

DT = 5e-4


def smooth(rows=400):
    turn = np.arange(rows) * 0.01
    hip = 0.1 * np.column_stack([np.cos(turn), np.sin(turn)])
    return {"hip": hip, "ihip": hip * 1.01, "force": 1000.0 * (hip * 1.01 - hip)}


def saved(path, channels, **meta):
    rows = len(next(iter(channels.values())))
    write_recording(path, Recording(np.arange(rows) * 1e-3, channels, {"dt": 1e-3, **meta}))


def inspected(capsys, *arguments):
    """The exit code of `hapticeval inspect`, and what it prints."""
    code = main(["inspect", *arguments])
    return code, capsys.readouterr().out


def test_a_sound_recording_ends_with_0_and_a_picture_and_a_suspicious_one_with_1(here, capsys):
    saved(here / "run.h5", smooth(), scene={"stiffness": 1000.0, "model": {"kind": "circle", "size": 0.202}})
    code, shown = inspected(capsys, "run.h5")
    assert code == 0
    assert "nothing found" in shown
    assert (here / "integrity-run.png").read_bytes().startswith(b"\x89PNG")
    channels = smooth()
    channels["hip"][200, 0] += 0.05
    (here / "run.h5").rename(here / "run.journal")  # another of that name
    saved(here / "run.h5", channels)
    code, shown = inspected(capsys, "run.h5")
    assert code == 1
    assert (here / "integrity-run-h5.png").exists()
    assert "suspicious: spike hip.x (row 200, 0.2 s)" in shown
    assert "left out: 1 row in 1 place: spike in hip.x" in shown


@pytest.mark.usefixtures("unpictured")
@pytest.mark.parametrize(
    ("option", "words"),
    [
        (["--stiffness", "900"], "the force is 1.11 times what is asked, as of 1000 N/m"),
        (["--model", "circle:size=0.21"], "surface ihip"),
        (["--against", "other.h5"], "it is that of other.h5"),
    ],
)
def test_what_an_option_finds(here, capsys, option, words):
    for name in ("run.h5", "other.h5"):
        saved(here / name, smooth())
    code, shown = inspected(capsys, "run.h5", *option)
    assert code == 1
    assert words in shown


def pressed(rows=600, radius=0.05, stiffness=600.0):
    """A hand that goes to a disc, presses and slides around it, logged without an IHIP."""
    depth = np.interp(np.arange(rows), [0, 100, 200, 500, rows], [-0.02, 0.0, 0.002, 0.002, -0.02])
    turn = np.linspace(0.0, 1.2, rows)
    outward = np.column_stack([np.cos(turn), np.sin(turn)])
    force = stiffness * np.maximum(depth, 0.0)[:, None] * outward
    return {"hip": np.round((radius - depth)[:, None] * outward, 7), "force": np.round(force, 4)}


@pytest.mark.usefixtures("unpictured")
@pytest.mark.parametrize(
    ("options", "code", "words"),
    [
        (["--model", "circle:size=0.1", "--stiffness", "600"], 0, "spring and surface  HIP + F / K_p on the model"),
        (["--model", "circle:size=0.1", "--stiffness", "60"], 1, "the force is 10 times what is asked, as of "),
        (["--model", "circle:size=0.1", "--stiffness", "606"], 1, "the force is 0.99 times what is asked, as of "),
        (["--model", "circle:size=0.2"], 1, "no force though the HIP goes deeper inside the model"),
        (["--model", "circle:size=0.09"], 1, "a force though the HIP is outside the model"),
        (["--model", "circle:size=0.1"], 0, "not checked: surface: the log has no ihip"),
        (["--stiffness", "600"], 0, "not checked: spring: the log has no ihip"),
        ([], 0, "inverse checks: none"),
    ],
)
def test_without_an_ihip_hip_and_force_are_held_to_model_and_stiffness(here, capsys, options, code, words):
    saved(here / "run.h5", pressed())
    assert main(["inspect", "run.h5", *options]) == code
    shown = capsys.readouterr().out
    assert words in shown
    assert ("nothing found; what 1 of the inverse checks would find is open" in shown) == (
        code == 0 and len(options) == 2
    )


@pytest.mark.usefixtures("unpictured")
@pytest.mark.parametrize(
    ("factor", "words"),
    [
        (1e3, "1 Hz, and a hand that moves at 0."),
        (1e3, "were the times in ms, and taken for s, it would be 1000 Hz"),
        (1e-3, "were the times in s, and taken for ms, it would be 1000 Hz"),
        (1e-6, "1e+09 Hz"),
        (1e-6, "were the times in s, and taken for us"),
        (1.0, ""),
    ],
)
def test_a_wrong_unit_of_time_is_suspected(here, capsys, factor, words):
    """A hand at a decimetre a second in a loop of 1 kHz, its clock in another unit than the mapping says."""
    time = np.arange(600) * 1e-3 * factor
    write_recording(here / "run.h5", Recording(time, pressed(), {"source": "file"}))
    assert main(["inspect", "run.h5"]) == (words != "")
    shown = capsys.readouterr().out
    assert words in shown
    assert ("suspicious: unit time" in shown) == (words != "")


def test_a_masked_or_empty_row_is_one_event_and_a_conversion_ends_with_1(unpictured, here, capsys):
    lines = [f"{0.001 * row:.3f},{0.001 * row:.5f},{0.002 * row + 1e-4 * row**2:.5f}" for row in range(60)]
    lines[20:23] = [line.partition(",")[0] + ",," for line in lines[20:23]]
    lines[40] = lines[39]
    (here / "a.csv").write_text("t [s],x [m],y [m]\n" + "\n".join(lines) + "\n")
    (here / "m.toml").write_text(
        '[time]\ncolumn = "t [s]"\nunit = "s"\ndisorder = "mask"\n'
        '[channels.hip]\ncolumns = ["x [m]", "y [m]"]\nunit = "m"\nsign = 1\n'
    )
    assert main(["convert", "a.csv", "--mapping", "m.toml", "-o", "a.h5"]) == 1
    shown = capsys.readouterr().out
    assert "no measurement: 3 rows without a number" in shown
    assert "no measurement: 1 row time out of order" in shown
    assert main(["inspect", "a.h5"]) == 1
    found = [line for line in capsys.readouterr().out.splitlines() if line.startswith(("fault", "suspicious"))]
    assert [line.partition(" (")[0] for line in found] == ["fault: no number hip", "fault: duplicate time"]


def test_where_most_cycles_lack_a_row_gaps_are_as_long_as_their_cycles(here, capsys):
    keep = np.delete(np.arange(0, 400, 4), [2])
    channels = {name: each[keep] for name, each in smooth().items()}
    clock = Clock(keep * 1_000_000, sequence=keep)
    write_recording(here / "run.h5", Recording.clocked(clock, channels, {"dt": 1e-3}))
    code, shown = inspected(capsys, "run.h5")
    assert code == 1
    assert "7 rows missing (0.007 s)" in shown
    assert "sound: 0 to 0.004 s (but for 3 rows missing in 1 short gap), 0.012 to 0.396 s (but for 288 rows" in shown
    assert "and 93 more, marked in the picture: gap time" in shown
    assert main(["convert", "run.h5", "-o", "run.csv"]) == 1
    assert "missed: 298 cycles of the loop without a row" in capsys.readouterr().out


def test_what_the_recording_declares_and_cannot_be_checked_is_named(unpictured, here, capsys):
    gains = {"stiffness": 1000.0, "damping": 2.0}
    saved(here / "run.h5", {**smooth(), "joint_position": smooth()["hip"]}, device="rig 7", gains=gains)
    shown = inspected(capsys, "run.h5")[1]
    assert "not checked: spring: the recording has a damping K_d of 2 N s/m" in shown
    assert "not checked: forward kinematics: the device 'rig 7' is none whose kinematics are known" in shown
    for declared in ({"spring": "normal"}, {"spring": "error", "stiffness_least": 0.4, "stiffness_largest": 1.6}):
        saved(here / f"{len(declared)}.h5", smooth(), gains={"stiffness": 300.0}, **declared)
        code, shown = inspected(capsys, f"{len(declared)}.h5")
        assert code == 0
        assert "not checked: spring: the renderer declares a force along the normal, or a stiffness" in shown


def test_of_one_row_there_is_a_picture_and_no_rate(here, capsys):
    saved(here / "row.h5", smooth(rows=1))
    code, shown = inspected(capsys, "row.h5")
    assert code == 0
    assert "clock: no two rows follow each other" in shown


def test_a_foreign_file_that_is_cut_ends_with_1(here, capsys):
    (here / "a.csv").write_text("t [s],x\n0,1\n0.001,2\n0.002,33")
    assert main(["inspect", "a.csv", "--write-mapping", "m.toml"]) == 1
    shown = capsys.readouterr().out
    assert "suspicious: the file ends within line 4, which is left out" in shown
    assert main(["inspect", "a.csv", "--write-mapping", "m.toml"]) == 2  # nothing is written over


def test_a_recording_is_converted_for_other_programs_and_back(unpictured, here):
    saved(here / "run.h5", smooth())
    for suffix in ("npz", "mat"):
        assert main(["convert", "run.h5", "-o", f"run.{suffix}"]) == 0
        assert main(["inspect", f"run.{suffix}", "--write-mapping", f"{suffix}.toml"]) == 0
        assert main(["convert", f"run.{suffix}", "--mapping", f"{suffix}.toml", "-o", f"{suffix}.h5"]) == 0
        assert main(["inspect", f"{suffix}.h5", "--against", "run.h5"]) == 1  # the same signals, and so it says
    assert main(["convert", "run.h5", "-o", "run.h5"]) == 2


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["inspect", "picture.h5"], ["is a PNG picture"]),
        (["inspect", "none.h5"], ["none.h5"]),
        (["inspect", "."], ["is a folder, no recording", "it holds: header.csv, run.h5"]),
        (["inspect", "header.csv"], ["is text without a row of numbers, no recording"]),
        (["inspect", "run.h5", "--model", "sphere"], ["the recording is in 2D, the model 'sphere' in 3D"]),
        (["inspect", "run.h5", "--stiffness", "-4"], ["--stiffness -4", "what to do: "]),
        (["inspect", "run.h5", "-o", "run.h5"], ["cannot write into run.h5"]),
        (["convert", "run.h5", "-o", "run.h5/other.h5"], ["cannot write the recording run.h5/other.h5", "why: "]),
        (["convert", "run.h5", "-o", "run.h5/other.csv"], ["cannot write run.h5/other.csv", "why: "]),
    ],
)
def test_what_cannot_be_read_or_written_is_named(here, capsys, arguments, words):
    saved(here / "run.h5", smooth())
    (here / "header.csv").write_text("t,x\n")
    if "picture.h5" in arguments:
        (here / "picture.h5").write_bytes(b"\x89PNG\r\n\x1a\n")
    assert main(arguments) in (1, 2)
    shown = capsys.readouterr().err
    assert all(word in shown for word in words)
    assert "Traceback" not in shown
    assert ".tmp" not in shown


def bounce(stiffness, restitution, speed, *, mass=0.3, rows=2400, bias=0.0, step=0.0, into=1.0):
    """A tool that flies at a wall at 0, is thrown back by a spring that is softer on the way out, and flies on."""
    time = np.arange(rows) * DT
    touch = 0.4
    frequency = np.sqrt(stiffness / mass)
    back = np.pi / 2 / frequency
    away = back / restitution
    depth = speed / frequency
    x = np.where(time < touch, speed * (time - touch), 0.0)
    pressing = (time >= touch) & (time < touch + back)
    x[pressing] = depth * np.sin(frequency * (time[pressing] - touch))
    leaving = (time >= touch + back) & (time < touch + back + away)
    x[leaving] = depth * np.cos(frequency * restitution * (time[leaving] - touch - back))
    gone = time >= touch + back + away
    x[gone] = -speed * restitution * (time[gone] - touch - back - away)
    press = np.where(pressing, stiffness * x, 0.0) + np.where(leaving, stiffness * restitution**2 * x, 0.0)
    x = np.round(x / step) * step if step else x
    channels = {"hip": into * x[:, None], "force": -into * (press + bias)[:, None]}
    made = Recording(time, channels, {"force_floor": 0.3 * stiffness * depth})
    impulse = mass * speed * (1.0 + restitution)
    return made, impulse


@settings(max_examples=40)
@given(
    stiffness=st.floats(2000.0, 20_000.0),
    restitution=st.floats(0.5, 0.9),
    speed=st.floats(0.05, 0.5),
    bias=st.floats(-0.02, 0.02),
    into=st.sampled_from([1.0, -1.0]),
)
def test_a_bounce_has_the_impulse_stiffness_and_restitution_it_was_made_with(stiffness, restitution, speed, bias, into):
    made, impulse = bounce(stiffness, restitution, speed, bias=bias, into=into, step=1e-7)
    (contact,) = impacts(made).contacts
    # Below a twentieth of the peak the contact is left out: of the way out, whose press is e^2 of the way in, that is
    # e (1 - cos(asin(0.05 / e^2))) / (1 + e) of the impulse, 0.7 % for e = 0.5. And the press drops by 1 - e^2 of the
    # peak between two ticks at the turn: half a tick of it is w dt (1 - e^2) / 2 / (1 + e), w = sqrt(k / m). And each
    # end may lack one tick more, in which the press goes from a twentieth to w dt beyond it.
    ticks = DT * np.sqrt(stiffness / 0.3)
    assert contact.impulse == pytest.approx(impulse, rel=0.008 + ticks / 4 + 2.0 * ticks * (0.05 + ticks) / 1.5)
    assert contact.stiffness == pytest.approx(stiffness, rel=0.01)
    assert contact.speed_before == pytest.approx(speed, rel=0.01 + 1e-4 / speed)
    assert contact.restitution == pytest.approx(restitution, rel=0.02 + 1e-3 / speed)


def test_a_contacts_own_errors_are_those_that_repeats_scatter_by():
    """The scatter of 60 contacts that differ by the sensor's noise, whose standard deviation is known to 1 in 11, and
    that of as many that differ by where between two quanta the wall is."""
    random = np.random.default_rng(3)
    clean, _ = bounce(5000.0, 0.7, 0.2)
    noisy = [
        replace(
            clean, channels={"hip": clean.hip, "force": clean.force + random.normal(scale=0.3, size=clean.force.shape)}
        )
        for _ in range(60)
    ]
    ones = [impacts(each).contacts[0] for each in noisy]
    error = np.mean([each.stiffness_error for each in ones])
    assert np.std([each.stiffness for each in ones], ddof=1) == pytest.approx(error, rel=0.3)
    step = 2e-5
    coarse = [
        replace(clean, channels={"hip": np.round(clean.hip / step + shift) * step, "force": clean.force})
        for shift in np.linspace(0.0, 1.0, 60, endpoint=False)
    ]
    ones = [impacts(each).contacts[0] for each in coarse]
    error = np.mean([each.restitution_error for each in ones])
    assert 0.0 < np.std([each.restitution for each in ones], ddof=1) < 1.5 * error


def test_each_contact_is_shown_with_its_errors(unpictured, here, capsys):
    made, _ = bounce(5000.0, 0.7, 0.2, step=1e-6)
    write_recording(here / "run.h5", made)
    assert main(["inspect", "run.h5"]) in (0, 1)
    lines = capsys.readouterr().out.splitlines()
    (head,) = [k for k, line in enumerate(lines) if line.startswith("begin s")]
    names, cells = lines[head].split("  "), lines[head + 1].split()
    (contact,) = impacts(made).contacts
    row = dict(zip([name.strip() for name in names if name.strip()], cells, strict=False))
    assert [name.strip() for name in names if name.strip()].count("std. error") == 2
    assert float(cells[6]) == pytest.approx(contact.stiffness_error, rel=0.05)
    assert float(cells[10]) == pytest.approx(contact.restitution_error, rel=0.05)
    assert float(row["stiffness N/m"]) == pytest.approx(contact.stiffness, rel=0.005)


@pytest.mark.parametrize(("count", "point"), [(2, 12.706), (12, 2.201), (31, 2.042)])
def test_the_interval_about_a_mean_is_students(count, point):
    """Tabulated two-sided 95 % points of Student's t for 1, 11 and 30 degrees of freedom."""
    made, _ = bounce(5000.0, 0.7, 0.2)
    (contact,) = impacts(made).contacts
    impulses = np.linspace(1.0, 2.0, count)
    several = Impacts(tuple(replace(contact, impulse=each) for each in impulses), (), 0.0)
    mean, half = several.mean("impulse")
    assert mean == pytest.approx(1.5)
    assert half == pytest.approx(point * np.std(impulses, ddof=1) / np.sqrt(count), rel=1e-3)


def test_a_force_while_the_tool_leaves_is_no_contact(refused):
    time = np.arange(1000) * DT
    x = -0.1 * time[:, None]
    push = np.where((time > 0.2) & (time < 0.22), 2.0, 0.0)[:, None]
    found = impacts(Recording(time, {"hip": x, "force": -push}, {"force_floor": 0.5}))
    assert found.contacts == ()
    assert found.unexplained == (pytest.approx(0.2005),)
    with refused(InputError):
        impacts(Recording(np.arange(400) * 1e-3, smooth()))
