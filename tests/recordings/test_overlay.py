"""`hapticeval compare`: two recordings laid over each other, and what is apart."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hapticeval.cli import main
from hapticeval.errors import InputError
from hapticeval.geometry.catalogue import make_model
from hapticeval.recordings.hdf5 import write_recording
from hapticeval.recordings.overlay import overlay
from hapticeval.recordings.recording import Recording

CIRCLE = make_model("circle", size=0.2)
META = {"model": {"kind": "circle", "size": 0.2}, "gains": {"stiffness": 1000.0, "damping": 0.0}}


def sliding(*, delay=0.0, gain=1.0, speed=1.0, aside=0.0, start=0.0, **keywords):
    """A tool that slides once round a circle of 200 mm in 2 s at 1 m/s of phase, the hand up to 2 mm below it.

    `delay` (s) and `gain` are those of hand and force, `aside` (m) moves the hand along x, `start` (rad) the way.
    """
    time = np.arange(int(2000 / speed)) * 1e-3
    phase = speed * (time - delay)
    angle = start + 2.5 * phase
    normal = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    depth = 1e-3 * (1.0 + 0.5 * np.sin(9.0 * phase) + 0.3 * np.sin(23.0 * phase))[:, None]
    hip = (0.1 - depth) * normal + [aside, 0.0]
    channels = {"hip": hip, "ihip": 0.1 * normal, "force": gain * 1000.0 * depth * normal}
    return Recording(time, channels, META, **keywords)


def test_a_run_and_itself_are_not_apart():
    laid = overlay(sliding(), sliding())
    assert len(laid.along) == 2000
    for gap in laid.gaps.values():
        assert (gap.rms, gap.largest, gap.delay, gap.gain) == (0.0, 0.0, None, None)


@settings(max_examples=15, deadline=None)
@given(delay=st.floats(0.002, 0.06), sign=st.sampled_from([1.0, -1.0]))
def test_a_planted_delay_comes_out(delay, sign):
    gaps = overlay(sliding(), sliding(delay=sign * delay)).gaps
    for name in ("hip", "ihip", "force"):
        # Between rows of 1 ms it is interpolated.
        assert gaps[name].delay == pytest.approx(sign * delay, abs=2e-4)
        assert gaps[name].gain is None
        assert gaps[name].left < 0.05 * gaps[name].rms


@settings(max_examples=15, deadline=None)
@given(gain=st.floats(0.3, 3.0).filter(lambda gain: abs(gain - 1.0) > 0.01))
def test_a_planted_gain_comes_out(gain):
    gaps = overlay(sliding(), sliding(gain=gain)).gaps
    assert gaps["force"].gain == pytest.approx(gain, rel=1e-9)
    assert gaps["force"].delay is None
    assert gaps["hip"].largest == 0.0


def test_a_delay_and_a_gain_come_out_together():
    force = overlay(sliding(), sliding(delay=0.03, gain=1.4)).gaps["force"]
    assert force.delay == pytest.approx(0.03, abs=2e-4)
    assert force.gain == pytest.approx(1.4, rel=1e-3)


@pytest.mark.parametrize("size", [0.8, 0.05])
def test_the_largest_place_is_where_it_was_planted_and_nothing_explains_it(size):
    first = sliding()
    force = first.force.copy()
    force[700] += [0.0, size]
    gap = overlay(first, Recording(first.time, {**first.channels, "force": force}, META)).gaps["force"]
    assert gap.largest == pytest.approx(size)
    assert gap.place == pytest.approx(0.7)
    assert gap.hip == pytest.approx(first.hip[700])
    assert gap.delay is gap.gain is None


@pytest.mark.parametrize("start", [0.0, 2.0, -0.4, 6.1])
@pytest.mark.parametrize("speed", [0.5, 0.8, 1.7])
def test_over_the_way_two_speeds_are_alike(speed, start):
    laid = overlay(sliding(start=start), sliding(speed=speed, start=start), curve=CIRCLE.curve)
    assert np.count_nonzero(laid.rows) > 1900
    # The second is interpolated on chords of at most 0.5 mm of a circle of 100 mm: s^2 / 8 R = 0.3 um.
    assert laid.gaps["ihip"].largest < 1e-6
    assert laid.gaps["force"].largest < 2e-3
    assert overlay(sliding(start=start), sliding(speed=speed, start=start)).gaps["ihip"].largest > 0.01


def test_over_the_way_a_hand_may_come_from_the_other_side():
    first = sliding()
    back = Recording(first.time, {name: values[::-1] for name, values in first.channels.items()}, META)
    assert overlay(first, back, curve=CIRCLE.curve).gaps["force"].largest < 1e-9


def test_what_is_no_measurement_is_not_compared():
    first, valid = sliding(), np.ones(2000, dtype=bool)
    valid[500:600] = False
    spoilt = {name: np.where(valid[:, None], values, 9.0) for name, values in first.channels.items()}
    laid = overlay(first, Recording(first.time, spoilt, META, valid=valid))
    assert np.array_equal(laid.rows, valid)
    assert max(gap.largest for gap in laid.gaps.values()) == 0.0


def test_contact_apart_is_told():
    first = sliding()
    touching = first.time < 1.5
    channels = {**first.channels, "contact": touching.astype(float)}
    laid = overlay(first, Recording(first.time, channels, META))
    assert np.array_equal(laid.touches[0] != laid.touches[1], ~touching)


def test_what_cannot_be_compared_is_refused(refused):
    plane = sliding()
    line = Recording(plane.time, {"hip": plane.hip[:, :1]})
    joints = Recording(plane.time, {"joint_position": plane.hip})
    later = Recording(plane.time + 10.0, dict(plane.channels), META)
    free = Recording(plane.time, {"hip": plane.hip, "ihip": plane.hip}, META)
    with refused(InputError):
        overlay(plane, line)
    with refused(InputError):
        overlay(plane, joints)
    with refused(InputError):
        overlay(plane, later)
    with refused(InputError):
        overlay(plane, free, curve=CIRCLE.curve)
    short = plane.part(slice(0, 200)), plane.part(slice(1000, 1200))
    with refused(InputError):
        overlay(*short, curve=CIRCLE.curve)


def test_the_command_tells_numbers_verdicts_and_draws(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_recording(tmp_path / "a.h5", sliding())
    write_recording(tmp_path / "b.h5", sliding(delay=0.02, gain=1.25))
    assert main(["compare", "a.h5", "b.h5", "-o", "both.svg"]) == 0
    out = capsys.readouterr().out
    assert "hand: b is 20 ms late; " in out
    assert "force: b is 20 ms late and 1.25 times as large; " in out
    assert any(row.split()[1:5:2] == ["continuous-contact", "pass,"] for row in out.splitlines() if "| cont" in row)
    assert "wrote both.svg" in out
    assert "<svg" in (tmp_path / "both.svg").read_text(encoding="utf-8")
    assert main(["compare", "a.h5", "b.h5", "--over", "way"]) == 0
    assert "mm of way" in capsys.readouterr().out


def test_the_command_refuses_what_it_cannot_do(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_recording(tmp_path / "a.h5", sliding())
    plane = sliding()
    write_recording(tmp_path / "b.h5", Recording(plane.time, dict(plane.channels)))
    for arguments, words in [
        (["--over", "way"], "do not follow the same curve"),
        (["--over", "phase"], "none of time, way"),
        (["-o", "both.txt"], "a figure is .pdf, .svg, .png"),
    ]:
        assert main(["compare", "a.h5", "b.h5", *arguments]) == 2
        assert words in capsys.readouterr().err
    assert main(["compare", "a.h5", "b.h5", "--over", "way", "--model", "circle:size=0.2"]) == 0
    assert "Not judged" in capsys.readouterr().out


def test_two_runs_of_the_simulated_robot_are_compared(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for name, renderer in (("a.h5", "minimum-distance"), ("b.h5", "constraint")):
        assert main(["record", "--model", "cassinian", "--seconds", "0.5", "-r", renderer, "-o", name]) == 0
    capsys.readouterr()
    assert main(["compare", "a.h5", "b.h5"]) == 0
    out = capsys.readouterr().out
    assert "b against a: 500 rows, 0 to 0.499 s" in out
    assert "continuous-contact" in out
