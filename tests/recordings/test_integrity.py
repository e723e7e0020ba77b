"""Faults that are planted in a clean recording are found, each by its name and where it is; clean ones have none."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hapticeval.devices.parallelogram import ENCODER_STEP, Parallelogram2
from hapticeval.geometry.catalogue import make_model
from hapticeval.recordings.integrity.issue import Severity
from hapticeval.recordings.integrity.relations import matched
from hapticeval.recordings.integrity.report import examine, sound_intervals
from hapticeval.recordings.quantization import quantum
from hapticeval.recordings.recording import Clock, Recording
from hapticeval.recordings.stretches import stretches

ROWS = 600
STIFFNESS = 1000.0
DEVICE = Parallelogram2()
MODEL = make_model("circle", size=0.1)


def parts(seed=0, *, quantised=True):
    """A copy of what `made` makes, to plant faults in."""
    stamps, channels = made(seed, quantised)
    return stamps.copy(), {name: values.copy() for name, values in channels.items()}


@lru_cache(maxsize=256)
def made(seed, quantised):
    """Stamps (ns) and channels of a hand that slides around a disc, pressing: every channel follows from the joints."""
    random = np.random.default_rng(seed)
    stamps = 5_000_000_000 + np.arange(ROWS) * 1_000_000
    turn = random.uniform(0.0, 6.0) + 1.3 * np.sin(np.arange(ROWS) * 4e-3 + random.uniform(0.0, 6.0))
    depth = 2e-3 + 1e-3 * np.sin(np.arange(ROWS) * 0.017 + random.uniform(0.0, 6.0))
    outward = np.column_stack([np.cos(turn), np.sin(turn)])
    joints = np.array([DEVICE.joints(point) for point in (0.05 - depth)[:, None] * outward])
    if quantised:
        joints = np.round(joints / ENCODER_STEP) * ENCODER_STEP
    hip = np.array([DEVICE.position(row) for row in joints])
    ihip = 0.05 * hip / np.linalg.norm(hip, axis=1)[:, None]
    force = STIFFNESS * (ihip - hip)
    torque = np.array([DEVICE.jacobian(row).T @ f for row, f in zip(joints, force, strict=True)])
    velocity = np.gradient(hip, 1e-3, axis=0)
    velocity += random.normal(scale=0.02 * velocity.std(), size=velocity.shape)
    return stamps, {
        "hip": hip,
        "ihip": ihip,
        "force": force,
        "velocity": velocity,
        "joint_position": joints,
        "joint_torque": torque,
    }


def recording(stamps, channels, *, valid=None, **meta):
    return Recording.clocked(Clock(stamps), channels, {"dt": 1e-3, **meta}, valid=valid)


def full(given, **more):
    return examine(given, device=DEVICE, model=MODEL, stiffness=STIFFNESS, **more)


def found(report):
    return [(fault.kind, fault.channel, fault.first, fault.end) for fault in report.faults]


@settings(max_examples=30)
@given(seed=st.integers(0, 99), quantised=st.booleans())
def test_a_clean_recording_has_no_findings(seed, quantised):
    run = recording(*parts(seed, quantised=quantised))
    report = full(run)
    assert report.faults == ()
    assert not report.suspicious
    assert [(i.first, i.end) for i in sound_intervals(run, report).sound] == [(0, ROWS)]


@settings(max_examples=20)
@given(seed=st.integers(0, 99), row=st.integers(5, ROWS - 10), missing=st.integers(1, 50))
def test_a_gap_is_found_with_the_rows_it_lacks(seed, row, missing):
    stamps, channels = parts(seed)
    stamps[row:] += missing * 1_000_000
    run = recording(stamps, {"hip": channels["hip"]})
    (fault,) = examine(run).faults
    assert (fault.kind, fault.first, fault.measures["missing"]) == ("gap", row - 1, missing)
    assert fault.time == pytest.approx(((row - 1) * 1e-3, (row + missing) * 1e-3))
    # an answer that is three ticks late reaches over a hole of as many rows, and not over a longer one
    spans = [(0, row), (row, ROWS)] if missing > 3 else [(0, ROWS)]
    assert [(i.first, i.end) for i in sound_intervals(run).sound] == spans


@settings(max_examples=40)
@given(row=st.integers(5, ROWS - 20), missing=st.integers(1, 8), numbered=st.booleans(), tick=st.sampled_from([1, 7]))
def test_the_advice_on_a_gap_is_what_becomes_of_it(row, missing, numbered, tick):
    """A hole of up to four steps is gone across, and one of exactly four too, however its seconds were rounded."""
    stamps, channels = parts(2)
    keep = np.ones(ROWS, dtype=bool)
    keep[row : row + missing] = False
    clock = Clock(stamps[keep] // 10 * tick, sequence=np.flatnonzero(keep) if numbered else None)
    run = Recording.clocked(clock, {"hip": channels["hip"][keep]})
    (gap,) = [fault for fault in examine(run).faults if fault.kind == "gap"]
    bridged = len(stretches(run)) == 1
    assert bridged == (missing + 1 <= 4)
    assert gap.measures == {"missing": missing, "bridged": bridged}
    assert ("go on across it" in gap.todo) == bridged
    assert ("begin anew after it" in gap.todo) != bridged


@given(row=st.integers(1, ROWS - 5), late=st.integers(1, 999_999))
def test_a_row_that_is_late_is_jitter_and_no_gap(row, late):
    stamps, channels = parts()
    stamps[row] += late
    report = examine(recording(stamps, {"hip": channels["hip"]}))
    assert report.faults == ()
    assert report.timing.jitter[3] == pytest.approx(late * 1e-9)
    assert report.timing.rate == pytest.approx(1000.0)


@given(row=st.integers(1, ROWS - 2), back=st.integers(0, 50))
def test_stamps_that_repeat_or_go_back_are_named(row, back):
    stamps, channels = parts()
    stamps[row] = stamps[row - 1] - back * 1_000
    run = recording(stamps, {"hip": channels["hip"]}, valid=np.arange(ROWS) != row)
    faults = [fault for fault in examine(run).faults if fault.severity is Severity.FAULT]
    assert [(f.kind, f.first, f.end) for f in faults] == [("reversal" if back else "duplicate", row, row + 1)]


@settings(max_examples=30)
@given(
    seed=st.integers(0, 99),
    row=st.integers(10, ROWS - 12),
    size=st.floats(5e-3, 1.0) | st.floats(-1.0, -5e-3),
    channel=st.sampled_from(["hip", "ihip"]),
    column=st.integers(0, 1),
)
def test_a_spike_is_found_in_its_row(seed, row, size, channel, column):
    stamps, channels = parts(seed)
    channels[channel][row, column] += size
    kept = {name: channels[name] for name in ("hip", "ihip")}
    report = examine(recording(stamps, kept))
    assert ("spike", f"{channel}.{'xy'[column]}", row, row + 1) in found(report)
    assert {kind for kind, *_ in found(report)} <= {"spike", "unit"}


@settings(max_examples=30)
@given(seed=st.integers(0, 99), row=st.integers(20, ROWS - 80), rows=st.integers(20, 60), column=st.integers(0, 1))
def test_a_frozen_sensor_is_found_over_its_rows(seed, row, rows, column):
    stamps, channels = parts(seed)
    joints = channels["joint_position"]
    speed = np.abs(np.diff(joints[:, column]))[row - 9 : row + rows + 9]
    gone = abs(joints[row + rows, column] - joints[row - 1, column])
    joints[row : row + rows, column] = joints[row - 1, column]
    report = examine(recording(stamps, {"joint_position": joints}))
    name = f"joint_position.{column}"
    if gone > 4.5 * max(speed.max(), ENCODER_STEP):  # else it hardly moved: a hand at rest looks the same
        ((channel, first, end),) = [rest for kind, *rest in found(report) if kind == "stuck"]
        assert channel == name
        assert first <= row
        assert end == row + rows
    assert {kind for kind, *_ in found(report)} <= {"stuck", "saturated"}  # at a turn it looks clipped too


@settings(max_examples=20)
@given(seed=st.integers(0, 99), share=st.floats(0.6, 0.85))
def test_a_clipped_column_is_found(seed, share):
    random = np.random.default_rng(seed)
    values = np.sin(np.arange(ROWS) * 0.05 + random.uniform(0, 6))[:, None]
    clipped = 0.1 * np.clip(values, -share, share)
    report = examine(recording(np.arange(ROWS) * 1_000_000, {"hip": clipped}))
    assert {fault.kind for fault in report.faults} == {"saturated"}
    spans = [(fault.first, fault.end) for fault in report.faults]
    inside = np.abs(values[:, 0]) >= share
    assert all(inside[first:end].all() for first, end in spans)
    assert len(spans) >= 5


def test_no_force_between_two_contacts_is_no_limit():
    pressed = np.maximum(np.sin(np.linspace(0.0, 4.0 * np.pi, ROWS)), 0.0)[:, None]
    report = examine(recording(np.arange(ROWS) * 1_000_000, {"hip": -1e-3 * pressed, "force": pressed}))
    assert "saturated" not in {fault.kind for fault in report.faults if fault.channel.startswith("force")}


def test_clipped_motors_are_a_note():
    torque = np.clip(np.sin(np.arange(ROWS) * 0.05)[:, None], -0.7, 0.7)
    report = examine(recording(np.arange(ROWS) * 1_000_000, {"joint_torque": torque}))
    assert {fault.kind for fault in report.faults} == {"saturated"}
    assert not report.suspicious


@given(rows=st.sets(st.integers(0, ROWS - 1), min_size=1, max_size=20))
def test_rows_without_a_number_are_counted_and_left_out(rows):
    stamps, channels = parts()
    channels["hip"][sorted(rows)] = np.nan
    valid = ~np.isnan(channels["hip"][:, 0])
    run = recording(stamps, {"hip": channels["hip"]}, valid=valid)
    faults = [fault for fault in examine(run).faults if fault.kind == "no number"]
    assert {fault.channel for fault in faults} == {"hip"}
    assert [row for fault in faults for row in range(fault.first, fault.end)] == sorted(rows)
    assert all(f"row{'s' * (fault.end - fault.first > 1)} without a number (x, y)" in fault.message for fault in faults)
    beside = np.concatenate([[False], valid, [False]])
    found = sound_intervals(run)
    assert found.rows(ROWS).tolist() == (valid & (beside[:-2] | beside[2:])).tolist()
    assert sum(span.end - span.first for span, _ in found.left_out) + found.rows(ROWS).sum() == ROWS


@settings(max_examples=30)
@given(step=st.floats(1e-7, 1e-3), seed=st.integers(0, 99))
def test_the_quantum_of_an_encoder_is_found(step, seed):
    random = np.random.default_rng(seed)
    counts = np.cumsum(random.integers(-3, 4, size=400))
    assert quantum(counts * step + random.normal()) == pytest.approx(step, rel=1e-6)


@given(seed=st.integers(0, 99))
def test_a_signal_that_no_encoder_made_has_no_quantum(seed):
    assert quantum(np.random.default_rng(seed).normal(size=500)) is None


@settings(max_examples=25)
@given(lag=st.integers(-250, 250), seed=st.integers(0, 99))
def test_a_column_that_is_another_one_shifted_is_found(lag, seed):
    long = np.cumsum(np.random.default_rng(seed).normal(size=ROWS + 250))
    begin = max(0, lag)
    a, b = long[begin : begin + ROWS], long[begin - lag : begin - lag + ROWS]
    assert matched(a, b, 0.9).lag == lag
    stamps, channels = parts()
    channels = {"hip": channels["hip"], "force": np.column_stack([a, b])}
    kinds = [(fault.kind, fault.channel) for fault in examine(recording(stamps, channels)).faults]
    assert kinds == [("shifted copy" if lag else "copy", "force.y")]


def test_an_independent_column_is_no_copy():
    random = np.random.default_rng(0)
    assert matched(random.normal(size=400), random.normal(size=400), 0.1) is None


def test_a_signal_of_another_run_is_found():
    one, other = (recording(*parts(seed)) for seed in (1, 2))
    assert full(one, others={"run 2": other}).faults == ()
    mixed = dict(one.channels) | {"force": other.channels["force"]}
    faults = examine(recording(parts(1)[0], mixed), others={"run 2": other}).faults
    assert {(fault.kind, fault.channel) for fault in faults} == {
        ("from another run", "force.x"),
        ("from another run", "force.y"),
    }


@pytest.mark.parametrize(
    ("factor", "kinds"), [(1.0, set()), (-1.0, {"velocity"}), (1e-3, {"velocity"}), (57.3, {"velocity"})]
)
def test_a_velocity_is_the_derivative_of_its_position(factor, kinds):
    stamps, channels = parts(3)
    channels["velocity"] = channels["velocity"] * factor
    report = examine(recording(stamps, {name: channels[name] for name in ("hip", "velocity")}))
    assert {fault.kind for fault in report.faults} == kinds


def test_a_velocity_of_something_else_is_found():
    stamps, channels = parts(3)
    channels["velocity"] = np.random.default_rng(0).normal(size=(ROWS, 2))
    report = examine(recording(stamps, {name: channels[name] for name in ("hip", "velocity")}))
    assert {fault.kind for fault in report.faults} == {"velocity"}


@pytest.mark.parametrize("lag", [-12, -2, 0, 3, 5, 15])
def test_a_force_that_lags_is_found(lag):
    stamps, channels = parts(4)
    random = np.random.default_rng(0)
    reach = np.cumsum(random.normal(size=(ROWS + 40, 2)), axis=0) * 1e-4
    hip = channels["hip"]
    run = {"hip": hip, "ihip": hip + reach[20 : 20 + ROWS], "force": 1e3 * reach[20 - lag : 20 - lag + ROWS]}
    faults = [fault for fault in examine(recording(stamps, run)).faults if fault.kind == "force lag"]
    assert [fault.measures["lag"] for fault in faults] == ([lag] if abs(lag) > 3 else [])


@pytest.mark.parametrize(
    ("channel", "factor", "kind"),
    [("hip", 1e3, "unit"), ("joint_position", 180.0 / np.pi, "unit"), ("force", 1e6, "unit"), ("hip", 1e-6, "unit")],
)
def test_a_unit_that_no_device_has_is_suspected(channel, factor, kind):
    stamps, channels = parts(5)
    report = examine(recording(stamps, {channel: channels[channel] * factor}))
    assert {fault.kind for fault in report.faults} == {kind}
    assert {fault.channel.partition(".")[0] for fault in report.faults} == {channel}


@pytest.mark.parametrize(("dt", "kinds"), [(1e-3, set()), (1.004e-3, set()), (1.02e-3, {"rate"}), (2e-3, {"rate"})])
def test_a_declared_rate_is_held_against_the_clock(dt, kinds):
    stamps, channels = parts()
    assert {fault.kind for fault in examine(recording(stamps, {"hip": channels["hip"]}, dt=dt)).faults} == kinds


def test_declared_rows_and_missed_cycles_are_told():
    stamps, channels = parts()
    run = recording(stamps, {"hip": channels["hip"]}, rows=ROWS + 7)
    assert [fault.message for fault in examine(run).faults] == [f"{ROWS + 7} rows are declared, {ROWS} are there"]
    sequence = np.arange(ROWS) + (np.arange(ROWS) > 100) * 3
    counted = Recording.clocked(Clock(stamps, sequence=sequence), {"hip": channels["hip"]})
    assert [fault.kind for fault in examine(counted).faults] == ["missed"]


def planted(change):
    stamps, channels = parts(6)
    change(channels)
    return full(recording(stamps, channels))


def of_kind(report, *kinds):
    return {fault.kind: fault for fault in report.faults if fault.kind in kinds}


@pytest.mark.parametrize(
    ("change", "kinds"),
    [
        (lambda c: c["joint_position"].__iadd__([0.01, 0.0]), {"forward kinematics", "torque"}),
        (lambda c: c["hip"].__iadd__([1e-4, 0.0]), {"forward kinematics", "spring"}),
        (lambda c: c["joint_torque"].__imul__([1.0, -1.0]), {"torque"}),
        (lambda c: c["force"].__imul__(-1.0), {"torque", "spring", "force sign"}),
        (lambda c: c["force"].__imul__(1.001), {"torque", "spring"}),
        (lambda c: c["ihip"].__iadd__([0.0, 1e-4]), {"spring", "surface"}),
    ],
)
def test_what_does_not_follow_is_found(change, kinds):
    report = planted(change)
    assert {fault.kind for fault in report.faults} == kinds
    assert all("off by up to" in fault.message for fault in report.faults if fault.kind != "force sign")


def test_residuals_are_told_in_quanta_and_the_stiffness_that_fits():
    report = planted(lambda c: c["hip"].__iadd__([1e-4, 0.0]))
    assert "quanta" in of_kind(report, "forward kinematics")["forward kinematics"].message
    report = planted(lambda c: c["force"].__imul__(1.25))
    assert of_kind(report, "spring")["spring"].measures["stiffness"] == pytest.approx(1250.0)


def test_a_residual_is_placed():
    def change(channels):
        channels["force"][200:300] *= 1.5

    fault = of_kind(planted(change), "spring")["spring"]
    assert (fault.first, fault.end) == (200, 300)
    assert fault.measures["rows"] == 100


def test_left_out_rows_are_named_with_their_reason():
    stamps, channels = parts(7)
    channels["hip"][50, 0] += 0.5
    valid = np.arange(ROWS) // 100 != 2
    run = recording(stamps, {"hip": channels["hip"]}, valid=valid)
    soundness = sound_intervals(run)
    assert [(i.first, i.end) for i in soundness.sound] == [(0, 50), (51, 200), (300, ROWS)]
    reasons = [(i.first, i.end, why) for i, why in soundness.left_out]
    assert reasons == [(50, 51, "spike in hip.x"), (200, 300, "no measurement")]


def sensed(seed=0):
    """As `parts`, with a force that a sensor measured: noise in every row."""
    stamps, channels = parts(seed)
    channels["force"] += np.random.default_rng(seed).normal(scale=0.02, size=(ROWS, 2))
    return stamps, {name: channels[name] for name in ("hip", "force")}


@settings(max_examples=20)
@given(seed=st.integers(0, 99))
def test_a_live_sensor_is_not_frozen(seed):
    assert examine(recording(*sensed(seed))).faults == ()


@settings(max_examples=20)
@given(seed=st.integers(0, 99), first=st.sampled_from([0, 100, 260]), both=st.booleans())
def test_a_component_that_is_frozen_is_found_from_the_first_row_on(seed, first, both):
    """340 rows, within the rounding of a turned frame, and no jump needed where it wakes."""
    stamps, channels = sensed(seed)
    end, random = first + 340, np.random.default_rng(1)
    for column in range(1 + both):
        channels["force"][first:end, column] = channels["force"][end - 1, column]
    channels["force"][first:end] += 2e-14 * random.uniform(-1.0, 1.0, (end - first, 2))
    report = examine(recording(stamps, channels))
    stuck = [fault for fault in report.faults if fault.kind == "stuck"]
    assert [(fault.channel, fault.first, fault.end) for fault in stuck] == [
        (f"force.{'xy'[column]}", first, end) for column in range(1 + both)
    ]
    assert all("while hip moves" in fault.message for fault in stuck)
    assert report.suspicious
    run = recording(stamps, channels)
    assert not sound_intervals(run, report).rows(ROWS)[first:end].any()


@pytest.mark.parametrize(("value", "severity"), [(1.7, Severity.SUSPICIOUS), (0.0, Severity.NOTE)])
def test_a_force_that_never_changes_while_the_hand_moves(value, severity):
    stamps, channels = sensed()
    channels["force"][:, 1] = value * (1.0 + 1e-15 * np.random.default_rng(0).normal(size=ROWS))
    faults = [fault for fault in examine(recording(stamps, channels)).faults if fault.kind == "constant"]
    assert [(fault.channel, fault.severity) for fault in faults] == [("force.y", severity)]
    still = dict(channels, hip=np.tile(channels["hip"][0], (ROWS, 1)))
    assert not [fault for fault in examine(recording(stamps, still)).faults if fault.channel == "force.y"]


def test_what_keeps_its_value_by_nature_is_left_alone():
    """Free motion, a coarse converter in free motion, and a limit that is reached again and again."""
    stamps = np.arange(ROWS) * 1_000_000
    turn = np.linspace(0.0, 8.0 * np.pi, ROWS)
    hip = 0.05 * np.column_stack([np.sin(turn), np.cos(1.3 * turn)])
    press = np.maximum(np.sin(turn), 0.0)
    for force in (press, np.minimum(press, 0.6), np.round(press / 0.05) * 0.05 + 0.05):
        report = examine(recording(stamps, {"hip": hip, "force": np.column_stack([force, 0.5 * force])}))
        assert not [fault for fault in report.faults if fault.kind in ("stuck", "constant")]
    at_a_notch = {"hip": hip, "ihip": np.tile([0.06, 0.0], (ROWS, 1))}
    assert not examine(recording(stamps, at_a_notch)).suspicious


@settings(max_examples=20)
@given(seed=st.integers(0, 99), share=st.floats(0.05, 0.5))
def test_rows_that_a_logger_wrote_again_are_counted(seed, share):
    stamps, channels = parts(seed)
    channels["force"] += np.random.default_rng(seed).normal(scale=0.02, size=(ROWS, 2))
    again = np.flatnonzero(np.random.default_rng(seed).random(ROWS - 20) < share) + 10
    again = again[np.diff(again, prepend=0) > 1]
    for row in again:
        for values in channels.values():
            values[row] = values[row - 1]
    faults = [fault for fault in examine(recording(stamps, channels)).faults if fault.kind == "repeated rows"]
    assert [fault.measures["rows"] for fault in faults] == [again.size]
    assert f"{again.size} of {ROWS} rows repeat the row before in all 12 columns" in faults[0].message


def test_slow_motion_repeats_rows_by_itself():
    stamps = np.arange(4000) * 1_000_000
    turn = np.arange(4000) * 2e-3
    hip = np.round(0.01 * np.column_stack([np.sin(turn), np.sin(0.7 * turn)]) / 5e-5) * 5e-5
    assert not [fault for fault in examine(recording(stamps, {"hip": hip})).faults if fault.kind == "repeated rows"]


@pytest.mark.parametrize("lag", [0, 7])
def test_a_signal_of_another_run_in_most_rows_is_found(lag):
    one, other = (recording(*sensed(seed)) for seed in (1, 2))
    force = np.roll(other.channels["force"], lag, axis=0)
    force[[30, 90]] += 0.1
    mixed = recording(sensed(1)[0], {"hip": one.hip, "force": force})
    faults = [fault for fault in examine(mixed, others={"run 2": other}).faults if fault.kind == "from another run"]
    assert [fault.channel for fault in faults] == ["force.x", "force.y"]
    rows = ROWS - lag - 1
    assert f" in {rows - 2} of {rows} rows, bit for bit" in faults[0].message


@settings(max_examples=20)
@given(seed=st.integers(0, 99), row=st.integers(20, ROWS - 20), sign=st.sampled_from([-1, 1]))
def test_a_counter_that_overflows_is_a_jump_and_parts_the_run(seed, row, sign):
    """16 bits of an encoder: the place goes on elsewhere, at the same speed."""
    stamps, channels = parts(seed)
    joints = channels["joint_position"]
    joints[row:, 1] += sign * 65_536 * ENCODER_STEP
    run = recording(stamps, {"joint_position": joints})
    report = examine(run)
    assert found(report) == [("jump", "joint_position.1", row, row + 1)]
    assert [(each.first, each.end) for each in sound_intervals(run, report).sound] == [(0, row), (row + 1, ROWS)]


def test_a_proxy_may_jump():
    stamps, channels = parts()
    channels["ihip"][300:] += 0.02
    kept = {name: channels[name] for name in ("hip", "ihip")}
    assert not examine(recording(stamps, kept)).suspicious
