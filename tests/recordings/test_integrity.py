"""Faults that are planted in a clean recording are found, each by its name and where it is; clean ones have none."""

from functools import lru_cache

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from hapticeval.devices.parallelogram import ENCODER_STEP, Parallelogram2
from hapticeval.geometry.catalogue import make_model
from hapticeval.recordings.integrity.consistency import inverse_checks
from hapticeval.recordings.integrity.relations import derivative_fit, matched
from hapticeval.recordings.integrity.report import examine, sound_intervals
from hapticeval.recordings.quantization import numeric_step, quantization_step
from hapticeval.recordings.recording import Clock, Recording
from hapticeval.recordings.stretches import stretches

ROWS = 600
STIFFNESS = 1000.0
DEVICE = Parallelogram2()
MODEL = make_model("circle", size=0.1)
SEEDS = (0, 11, 42)


@lru_cache(maxsize=256)
def simulated_channels(seed, quantised):
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


def parts(seed=0, keep=None, *, quantised=True, noise=0.0):
    """A copy of what `simulated_channels` makes, of the channels to `keep`; with the `noise` of a force sensor."""
    stamps, channels = simulated_channels(seed, quantised)
    channels = {name: values.copy() for name, values in channels.items() if keep is None or name in keep}
    if noise:
        channels["force"] += np.random.default_rng(seed).normal(scale=noise, size=(ROWS, 2))
    return stamps.copy(), channels


def recording(stamps, channels, *, valid=None, sequence=None, **meta):
    return Recording.clocked(Clock(stamps, sequence=sequence), channels, {"dt": 1e-3, **meta}, valid=valid)


def full(given, **more):
    return examine(given, device=DEVICE, model=MODEL, stiffness=STIFFNESS, **more)


def planted(change, *keep, seed=0, noise=0.0, **meta):
    """What is found, without inverse checks, after `change` was made to the channels to `keep`, all unless named."""
    stamps, channels = parts(seed, keep or None, noise=noise)
    change(channels)
    return examine(recording(stamps, channels, **meta))


def fault_rows(report):
    return [(issue.kind, issue.channel, issue.first, issue.end) for issue in report.issues]


def kinds(report):
    return {issue.kind for issue in report.issues}


def spans(soundness):
    return [(each.first, each.end) for each in soundness.sound]


@settings(max_examples=6)
@example(seed=3, quantised=False, noise=0.0)  # of doubles: nothing but the rounding of the chain is off
@given(seed=st.integers(0, 99), quantised=st.booleans(), noise=st.sampled_from([0.0, 0.02]))
def test_a_clean_recording_has_no_issues(seed, quantised, noise):
    run = recording(*parts(seed, quantised=quantised, noise=noise))
    report = full(run)
    assert report.issues == ()
    assert not report.suspicious
    assert spans(sound_intervals(run, report)) == [(0, ROWS)]


@pytest.mark.parametrize("numbered", [False, True])
@pytest.mark.parametrize("missing", [1, 2, 3, 4, 50])
def test_a_gap_has_the_rows_it_lacks_and_the_advice_on_what_becomes_of_it(missing, numbered):
    """A hole of up to four steps is gone across, and one of exactly four too, however its seconds were rounded."""
    for tick in (1, 7):
        stamps, channels = parts(2, ["hip"])
        keep = np.ones(ROWS, dtype=bool)
        keep[200 : 200 + missing] = False
        run = recording(
            stamps[keep] // 10 * tick, {"hip": channels["hip"][keep]},
            sequence=np.flatnonzero(keep) if numbered else None,
        )  # fmt: skip
        report = examine(run)
        (gap,) = [issue for issue in report.issues if issue.kind == "gap"]
        bridged = len(stretches(run)) == 1
        assert bridged == (missing <= 3)
        assert (gap.first, gap.end, gap.measures) == (199, 201, {"missing": missing, "bridged": bridged})
        assert gap.time == pytest.approx((199e-4 * tick, (200 + missing) * 1e-4 * tick))
        assert ("go on across it" in gap.todo) == bridged
        assert ("begin anew after it" in gap.todo) != bridged
        count = ROWS - missing
        assert spans(sound_intervals(run, report)) == ([(0, count)] if bridged else [(0, 200), (200, count)])


@pytest.mark.parametrize("late", [1, 600_000, 999_999])
def test_a_row_that_is_late_is_jitter_and_no_gap(late):
    stamps, channels = parts(keep=["hip"])
    stamps[200] += late
    report = examine(recording(stamps, channels))
    assert report.issues == ()
    assert report.timing.jitter[3] == pytest.approx(late * 1e-9)
    assert report.timing.rate == pytest.approx(1000.0)


def test_missed_cycles_and_late_rows_do_not_change_the_rate():
    random = np.random.default_rng(4)
    keep = np.concatenate([[True], random.random(5000) > 0.1, [True]])
    sequence = np.flatnonzero(keep)
    # Whoever was late reads the newest packet: the row after a gap comes up to a cycle late, the next one in time.
    late = np.concatenate([[False], np.diff(sequence) > 1]) * random.uniform(0.0, 0.9, sequence.size)
    late[-1] = 0.0
    clock = Clock(np.rint(1e6 * (sequence + late)).astype(np.int64), sequence=sequence)
    signals = {"grip": ("N", "grip")}
    report = examine(Recording.clocked(clock, {"grip": np.zeros(sequence.size)}, {"dt": 1e-3}, signals=signals))
    assert report.timing.rate == pytest.approx(1000.0, rel=1e-6)
    assert "rate" not in kinds(report)
    missing = np.diff(sequence) - 1
    gaps = [issue.measures["missing"] for issue in report.issues if issue.kind == "gap"]
    assert set(gaps) <= set(missing[missing > 0].tolist())
    assert sum(gaps) == report.timing.missing
    clock = Clock((1.05e6 * np.arange(1000)).astype(np.int64), sequence=np.arange(1000))
    wrong = Recording.clocked(clock, {"grip": np.zeros(1000)}, {"dt": 1e-3}, signals=signals)
    assert kinds(examine(wrong)) == {"rate"}


@pytest.mark.parametrize(("dt", "expected"), [(1e-3, set()), (1.004e-3, set()), (1.02e-3, {"rate"}), (2e-3, {"rate"})])
def test_a_declared_rate_is_held_against_the_clock(dt, expected):
    assert kinds(planted(lambda c: None, "hip", dt=dt)) == expected


@pytest.mark.parametrize(("back", "kind"), [(0, "duplicate"), (30_000, "reversal")])
def test_stamps_that_repeat_or_go_back_are_named(back, kind):
    stamps, channels = parts(keep=["hip"])
    stamps[77] = stamps[76] - back
    run = recording(stamps, channels, valid=np.arange(ROWS) != 77)
    issues = [issue for issue in examine(run).issues if issue.severity == "fault"]
    assert [(f.kind, f.first, f.end) for f in issues] == [(kind, 77, 78)]
    assert "marked as no measurement already" in issues[0].todo


def test_declared_rows_and_missed_cycles_are_named():
    report = planted(lambda c: None, "hip", rows=ROWS + 7)
    assert [issue.message for issue in report.issues] == [f"{ROWS + 7} rows are declared, {ROWS} are there"]
    stamps, channels = parts(keep=["hip"])
    sequence = np.arange(ROWS) + (np.arange(ROWS) > 100) * 3
    assert kinds(examine(recording(stamps, channels, sequence=sequence))) == {"missed"}


def at(name, rows, change):
    """A change of one column's rows, as in `hip.x`."""
    channel, _, part = name.partition(".")

    def plant(channels):
        column = "xy".find(part) if part in "xy" else int(part)
        channels[channel][rows, column] = change(channels[channel][:, column], channels[channel][rows, column])

    return plant


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("size", [5e-3, -5e-3, 1.0])
@pytest.mark.parametrize("name", ["hip.x", "ihip.y"])
def test_a_spike_is_found_in_its_row(seed, size, name):
    report = planted(at(name, slice(310, 311), lambda _, x: x + size), "hip", "ihip", seed=seed)
    assert ("spike", name, 310, 311) in fault_rows(report)
    assert kinds(report) <= {"spike", "unit"}


@settings(max_examples=20)
@given(seed=st.integers(0, 99), row=st.integers(20, ROWS - 80), rows=st.integers(20, 60), column=st.integers(0, 1))
def test_a_frozen_sensor_is_found_over_its_rows(seed, row, rows, column):
    stamps, channels = parts(seed, ["joint_position"])
    joints = channels["joint_position"]
    speed = np.abs(np.diff(joints[:, column]))[row - 9 : row + rows + 9]
    gone = abs(joints[row + rows, column] - joints[row - 1, column])
    joints[row : row + rows, column] = joints[row - 1, column]
    report = examine(recording(stamps, channels))
    if gone > 4.5 * max(speed.max(), ENCODER_STEP):  # else it hardly moved: a hand at rest looks the same
        ((channel, first, end),) = [rest for kind, *rest in fault_rows(report) if kind == "stuck"]
        assert channel == f"joint_position.{column}"
        assert first <= row
        assert end == row + rows
    assert kinds(report) <= {"stuck", "saturated"}  # at a turn it looks clipped too


@pytest.mark.parametrize("share", [0.6, 0.85])
@pytest.mark.parametrize("channel", ["hip", "joint_torque"])
def test_a_clipped_column_is_found_and_clipped_motors_are_a_note(channel, share):
    values = np.sin(np.arange(ROWS) * 0.05 + 1.0)[:, None]
    report = examine(recording(np.arange(ROWS) * 1_000_000, {channel: 0.1 * np.clip(values, -share, share)}))
    assert kinds(report) == {"saturated"}
    assert len(report.issues) >= 5
    assert all(np.all(np.abs(values[issue.first : issue.end]) >= share) for issue in report.issues)
    assert report.suspicious == (channel == "hip")


@settings(max_examples=30)
@given(rows=st.sets(st.integers(0, ROWS - 1), min_size=1, max_size=20))
def test_rows_without_a_number_are_counted_and_left_out(rows):
    stamps, channels = parts(keep=["hip"])
    channels["hip"][sorted(rows)] = np.nan
    valid = ~np.isnan(channels["hip"][:, 0])
    run = recording(stamps, channels, valid=valid)
    issues = [issue for issue in examine(run).issues if issue.kind == "no number"]
    assert {issue.channel for issue in issues} == {"hip"}
    assert [row for issue in issues for row in range(issue.first, issue.end)] == sorted(rows)
    assert all(f"row{'s' * (issue.end - issue.first > 1)} without a number (x, y)" in issue.message for issue in issues)
    beside = np.concatenate([[False], valid, [False]])
    soundness = sound_intervals(run)
    assert soundness.rows(ROWS).tolist() == (valid & (beside[:-2] | beside[2:])).tolist()
    assert sum(span.end - span.first for span, _ in soundness.left_out) + soundness.rows(ROWS).sum() == ROWS


@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize("seed", SEEDS)
def test_a_counter_that_overflows_is_a_jump_and_parts_the_run(seed, sign):
    """16 bits of an encoder: the place goes on elsewhere, at the same speed. A proxy may jump."""
    stamps, channels = parts(seed, ["joint_position"])
    channels["joint_position"][222:, 1] += sign * 65_536 * ENCODER_STEP
    run = recording(stamps, channels)
    report = examine(run)
    assert fault_rows(report) == [("jump", "joint_position.1", 222, 223)]
    assert spans(sound_intervals(run, report)) == [(0, 222), (223, ROWS)]
    assert not planted(lambda c: c["ihip"][300:].__iadd__(0.02), "hip", "ihip", seed=seed).suspicious


@pytest.mark.parametrize(("rows", "value"), [(2, 0.0), (5, -9.999), (9, None), (10, 0.0), (40, 0.0)])
@pytest.mark.parametrize("noise", [0.0, 1e-5])
def test_a_place_that_is_lost_for_a_while_is_left_out_as_one_dropout(rows, value, noise):
    """A tracker that loses its mark gives zero, or another number, or another place, and then the right one again."""
    stamps, channels = parts(1, ["hip"])
    channels["hip"] += noise * np.random.default_rng(rows).standard_normal((ROWS, 2))
    lost = channels["hip"][300 : 300 + rows, 0]
    lost[:] = lost + 0.5 if value is None else value
    run = recording(stamps, channels)
    report = examine(run)
    faults = [fault for fault in fault_rows(report) if fault[0] != "unit"]
    assert faults == [("dropout", "hip.x", 300, 300 + rows)]
    assert spans(sound_intervals(run, report)) == [(0, 300), (300 + rows, ROWS)]


def test_dropouts_close_to_each_other_do_not_hide_each_other_nor_what_lies_between_them():
    stamps, channels = parts(1, ["hip"])
    for first in (300, 306):
        channels["hip"][first : first + 3, 1] = 0.0
    faults = fault_rows(examine(recording(stamps, channels)))
    assert faults == [("dropout", "hip.y", 300, 303), ("dropout", "hip.y", 306, 309)]


def test_a_proxy_may_rest_on_a_face_and_leap_off_its_edge_or_pop_for_a_tick_and_is_all_judged():
    """A cube's proxy is at z = 5 cm until the hand leaves past an edge, 5 mm lower, where its push ends with a step."""
    sway = np.sin(np.arange(ROWS) * 0.02)
    hip = np.column_stack([0.06 * sway, 0.02 * np.cos(np.arange(ROWS) * 0.013), 0.045 + 1e-3 * sway])
    inside = np.abs(hip[:, 0]) < 0.05
    ihip = np.where(inside[:, None], hip * [1, 1, 0] + [0, 0, 0.05], hip)
    popped = ROWS - 10  # into contact
    assert inside[popped - 3 : popped + 4].all()
    ihip[popped, 0] += 0.02
    run = recording(np.arange(ROWS) * 1_000_000, {"hip": hip, "ihip": ihip, "contact": inside[:, None].astype(float)})
    report = examine(run)
    assert fault_rows(report) == [("spike", "ihip.x", popped, popped + 1)]
    assert not report.suspicious
    assert spans(sound_intervals(run, report)) == [(0, ROWS)]


@pytest.mark.parametrize("digits", [17, 4])
def test_a_force_on_a_hand_that_is_led_along_a_face_at_one_depth_is_not_stuck(digits):
    """In through a cube's face, 5 mm under it, and out past its edge, where the force ends."""
    along = np.linspace(-0.03, 0.06, ROWS)
    height = np.maximum(0.045, 0.052 - 1e-4 * np.arange(ROWS))
    hip = np.round(np.column_stack([along, 0.1 * along, height]), digits)
    inside = ((along < 0.05) & (height < 0.05))[:, None]
    ihip = np.where(inside, hip * [1, 1, 0] + [0, 0, 0.05], hip)
    channels = {"hip": hip, "ihip": ihip, "force": STIFFNESS * (ihip - hip)}
    assert "stuck" not in kinds(examine(recording(np.arange(ROWS) * 1_000_000, channels)))
    # The same without the contact point, and with a hand that goes deeper: a sensor may be frozen.
    without = {name: channels[name] for name in ("hip", "force")}
    assert "stuck" in kinds(examine(recording(np.arange(ROWS) * 1_000_000, without)))
    deeper = {**channels, "hip": hip - [[0, 0, 1e-3]] * np.linspace(0.0, 1.0, ROWS)[:, None]}
    assert "stuck" in kinds(examine(recording(np.arange(ROWS) * 1_000_000, deeper)))


def test_left_out_rows_are_named_with_their_reason():
    stamps, channels = parts(7, ["hip"])
    channels["hip"][50, 0] += 0.5
    soundness = sound_intervals(recording(stamps, channels, valid=np.arange(ROWS) // 100 != 2))
    assert spans(soundness) == [(0, 50), (51, 200), (300, ROWS)]
    reasons = [(each.first, each.end, why) for each, why in soundness.left_out]
    assert reasons == [(50, 51, "spike in hip.x"), (200, 300, "no measurement")]


@pytest.mark.parametrize("step", [1e-7, 3.7e-5, 1e-3])
def test_the_quantum_of_an_encoder_is_found_and_other_signals_have_none(step):
    random = np.random.default_rng(4)
    counts = np.cumsum(random.integers(-3, 4, size=400))
    assert numeric_step(counts * step + random.normal()) == pytest.approx(step, rel=1e-6)
    assert numeric_step(random.normal(size=500)) is None


@pytest.mark.parametrize(("count", "found"), [(3, None), (4, 0.5)])
def test_a_lattice_shows_in_four_different_numbers(count, found):
    assert numeric_step(0.5 * np.arange(count)) == found


@settings(max_examples=15)
@given(lag=st.integers(-250, 250), seed=st.integers(0, 99))
def test_a_column_that_is_another_one_shifted_is_found(lag, seed):
    long = np.cumsum(np.random.default_rng(seed).normal(size=ROWS + 250))
    begin = max(0, lag)
    a, b = long[begin : begin + ROWS], long[begin - lag : begin - lag + ROWS]
    assert matched(a, b, 0.9).lag == lag
    assert matched(np.random.default_rng(seed).normal(size=ROWS), a, 0.1) is None
    stamps, channels = parts(keep=["hip"])
    report = examine(recording(stamps, channels | {"force": np.column_stack([a, b])}))
    assert [each[:2] for each in fault_rows(report)] == [("shifted copy" if lag else "copy", "force.y")]


@pytest.mark.parametrize("lag", [0, 7])
def test_a_signal_of_another_run_is_found(lag):
    one, other = (recording(*parts(seed, ["hip", "force"], noise=0.02)) for seed in (1, 2))
    assert examine(one, others={"run 2": other}).issues == ()
    force = np.roll(other.channels["force"], lag, axis=0)
    force[[30, 90]] += 0.1
    mixed = recording(parts(1)[0], {"hip": one.hip, "force": force})
    issues = [issue for issue in examine(mixed, others={"run 2": other}).issues if issue.kind == "from another run"]
    assert [issue.channel for issue in issues] == ["force.x", "force.y"]
    rows = ROWS - lag - 1
    assert f" in {rows - 2} of {rows} rows, bit for bit" in issues[0].message


@pytest.mark.parametrize("lag", [-12, -2, 0, 3, 5, 15])
def test_a_force_that_lags_is_found(lag):
    stamps, channels = parts(4, ["hip"])
    reach = np.cumsum(np.random.default_rng(0).normal(size=(ROWS + 40, 2)), axis=0) * 1e-4
    ihip, force = channels["hip"] + reach[20 : 20 + ROWS], 1e3 * reach[20 - lag : 20 - lag + ROWS]
    issues = examine(recording(stamps, {**channels, "ihip": ihip, "force": force})).issues
    lags = [issue.measures["lag"] for issue in issues if issue.kind == "force lag"]
    assert lags == ([lag] if abs(lag) > 3 else [])


@pytest.mark.parametrize(
    ("channel", "factor"), [("hip", 1e3), ("joint_position", 180.0 / np.pi), ("force", 1e6), ("hip", 1e-6)]
)
def test_a_unit_that_no_device_has_is_suspected(channel, factor):
    report = planted(lambda c: c[channel].__imul__(factor), channel, seed=5)
    assert {(issue.kind, issue.channel.partition(".")[0]) for issue in report.issues} == {("unit", channel)}


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (lambda c: c["joint_position"].__iadd__([0.01, 0.0]), {"forward kinematics", "torque"}),
        (lambda c: c["hip"].__iadd__([1e-4, 0.0]), {"forward kinematics", "spring"}),
        (lambda c: c["joint_torque"].__imul__([1.0, -1.0]), {"torque"}),
        (lambda c: c["force"].__imul__(-1.0), {"torque", "spring"}),
        (lambda c: c["force"].__imul__(1.001), {"torque", "spring"}),
        (lambda c: c["ihip"].__iadd__([0.0, 1e-4]), {"spring", "surface"}),
    ],
)
def test_what_does_not_follow_is_found(change, expected):
    stamps, channels = parts(6)
    change(channels)
    report = full(recording(stamps, channels))
    assert kinds(report) == expected
    assert all("off by up to" in issue.message for issue in report.issues)
    assert all("quanta" in issue.message for issue in report.issues if issue.kind == "forward kinematics")


@pytest.mark.parametrize(("rows", "factor"), [(slice(200, 300), 1.5), (slice(0, ROWS), 1.25)])
def test_a_residual_is_placed_with_the_stiffness_that_fits(rows, factor):
    stamps, channels = parts(6)
    channels["force"][rows] *= factor
    (issue,) = [each for each in full(recording(stamps, channels)).issues if each.kind == "spring"]
    assert (issue.first, issue.end, issue.measures["rows"]) == (rows.start, rows.stop, rows.stop - rows.start)
    if rows.start == 0:
        assert issue.message.startswith("the force is 1.25 times what is asked, as of 1250 N/m")


@pytest.mark.parametrize("sigma", [0.01, 0.05, 0.5])
def test_noise_of_a_force_sensor_hides_no_fault_that_is_larger_and_is_none_itself(sigma):
    """Noise explains a residual up to a fifth of the largest force, 3 N: a force that is all noise explains nothing."""
    stamps, channels = parts(6, ["hip", "force"], noise=sigma)

    def contradicted(force):
        run = recording(stamps, {**channels, "force": force})
        return [bool(check.issues) for check in inverse_checks(run, model=MODEL, stiffness=STIFFNESS) if check.made]

    assert contradicted(channels["force"]) == [sigma > 0.1] * 2
    assert contradicted(1.5 * channels["force"])[0]
    assert contradicted(np.random.default_rng(1).standard_normal((ROWS, 2)))[0]


@pytest.mark.parametrize("ihip", [False, True])
@pytest.mark.parametrize(("side", "contradicted"), [(1.0, False), (-1.0, True)])
def test_a_tool_on_the_near_face_of_a_plate_holds_a_hand_that_has_come_out_of_the_far_one(ihip, side, contradicted):
    """The hand goes 6 mm down through a plate of 2 mm; a force that draws it farther down there is of no contact."""
    plate = make_model("polygon", vertices=[[-0.05, -0.002], [0.05, -0.002], [0.05, 0.0], [-0.05, 0.0]])
    depth = 0.003 + 0.003 * np.sin(np.linspace(-np.pi / 2, 3 * np.pi / 2, ROWS))
    hip, tool = np.column_stack([0.0 * depth, -depth]), np.zeros((ROWS, 2))
    force = STIFFNESS * (tool - hip)
    far = depth > 0.002
    force[far] *= side
    tool[far, 1] -= 0.002 * (side < 0.0)
    channels = {"hip": hip, "force": force} | ({"ihip": tool} if ihip else {})
    (check,) = [
        check for check in inverse_checks(recording(parts(0)[0], channels), model=plate) if check.name == "contact"
    ]
    assert bool(check.issues) == contradicted


@pytest.mark.parametrize(("axes", "signs", "words"), [
    ((0, 1), (-1, -1), "the force is reversed"), ((1, 0), (1, 1), "(x, y) of the force are (y, x)"),
    ((1, 0), (-1, 1), "(x, y) of the force are (-y, x)"), ((0, 1), (2, 2), "the force is 2 times what is asked"),
])  # fmt: skip
@pytest.mark.parametrize("ihip", [False, True])
def test_axes_and_signs_of_a_force_that_fit_are_named(axes, signs, words, ihip):
    stamps, channels = parts(6, ["hip", "force", *(["ihip"] if ihip else [])])
    channels["force"] = channels["force"][:, axes] * signs
    report = examine(recording(stamps, channels), model=MODEL, stiffness=STIFFNESS)
    (issue,) = [issue for issue in report.issues if issue.kind.startswith("spring")]
    assert words in issue.message


@pytest.mark.parametrize("both", [False, True])
@pytest.mark.parametrize("first", [0, 100, 260])
@pytest.mark.parametrize("seed", SEEDS)
def test_a_component_that_is_frozen_is_found_from_the_first_row_on(seed, first, both):
    """340 rows, within the rounding of a turned frame, and no jump needed where it wakes."""
    end, random = first + 340, np.random.default_rng(1)
    stamps, channels = parts(seed, ["hip", "force"], noise=0.02)
    channels["force"][first:end, : 1 + both] = channels["force"][end - 1, : 1 + both]
    channels["force"][first:end] += 2e-14 * random.uniform(-1.0, 1.0, (end - first, 2))
    run = recording(stamps, channels)
    report = examine(run)
    stuck = [issue for issue in report.issues if issue.kind == "stuck"]
    assert [(issue.channel, issue.first, issue.end) for issue in stuck] == [
        (f"force.{'xy'[column]}", first, end) for column in range(1 + both)
    ]
    assert all("while hip moves" in issue.message for issue in stuck)
    assert report.suspicious
    assert not sound_intervals(run, report).rows(ROWS)[first:end].any()


@pytest.mark.parametrize(("value", "severity"), [(1.7, "suspicious"), (0.0, "note")])
def test_a_force_that_never_changes_while_the_hand_moves(value, severity):
    stamps, channels = parts(0, ["hip", "force"], noise=0.02)
    channels["force"][:, 1] = value * (1.0 + 1e-15 * np.random.default_rng(0).normal(size=ROWS))
    issues = [issue for issue in examine(recording(stamps, channels)).issues if issue.kind == "constant"]
    assert [(issue.channel, issue.severity) for issue in issues] == [("force.y", severity)]
    channels["hip"] = np.tile(channels["hip"][0], (ROWS, 1))
    assert not [issue for issue in examine(recording(stamps, channels)).issues if issue.channel == "force.y"]


@pytest.mark.parametrize(("count", "found"), [(2, True), (3, False)])
def test_what_stands_out_again_and_again_is_the_signal_and_no_spike(count, found):
    """Of 600 rows eight may bend as spikes do, and each spike bends three."""
    stamps, channels = parts(keep=["hip"], quantised=False)
    channels["hip"][100 + 50 * np.arange(count), 0] += 5e-3
    assert ("spike" in kinds(examine(recording(stamps, channels)))) is found


@pytest.mark.parametrize(("rows", "frozen"), [(140, False), (160, True)])
def test_a_slow_sensor_is_frozen_once_it_should_have_changed_thirty_times(rows, frozen):
    """It changes every fifth row of an even motion, and keeps one value for so many rows: no jump ends that."""
    level = np.concatenate([np.arange(200) // 5, np.full(rows, 40), 41 + np.arange(ROWS - 200 - rows) // 5])
    hip = 1e-4 * np.column_stack([np.arange(ROWS), np.sin(np.arange(ROWS))])
    report = examine(recording(np.arange(ROWS) * 1_000_000, {"hip": hip, "force": np.column_stack([0.1 * level] * 2)}))
    assert ("stuck" in kinds(report)) is frozen


def test_what_keeps_its_value_by_nature_is_left_alone():
    """Free motion, a coarse converter in free motion, a limit that is reached again and again, a tool in a notch."""
    stamps = np.arange(ROWS) * 1_000_000
    turn = np.linspace(0.0, 8.0 * np.pi, ROWS)
    hip = 0.05 * np.column_stack([np.sin(turn), np.cos(1.3 * turn)])
    press = np.maximum(np.sin(turn), 0.0)
    for force in (press, np.minimum(press, 0.6), np.round(press / 0.05) * 0.05 + 0.05):
        report = examine(recording(stamps, {"hip": hip, "force": np.column_stack([force, 0.5 * force])}))
        assert not kinds(report) & {"stuck", "constant"}
        assert force is not press or "saturated" not in kinds(report)
    assert not examine(recording(stamps, {"hip": hip, "ihip": np.tile([0.06, 0.0], (ROWS, 1))})).suspicious


@pytest.mark.parametrize(("offset", "stuck"), [(1, False), (2, True)])
def test_a_coarse_converter_s_zero_is_within_a_step_of_none_also_where_it_does_not_come_back(offset, stuck):
    """Free for three quarters of the run, which ends in the press."""
    turn = np.linspace(0.0, 8.0 * np.pi, ROWS)
    press = np.where(turn < 6.0 * np.pi, 0.0, np.abs(np.sin(3.0 * turn)))
    force = 0.05 * (np.round(np.column_stack([press, 0.5 * press]) / 0.05) + offset)
    hip = 0.05 * np.column_stack([np.sin(turn), np.cos(1.3 * turn)])
    assert ("stuck" in kinds(examine(recording(np.arange(ROWS) * 1_000_000, {"hip": hip, "force": force})))) is stuck


@pytest.mark.parametrize("share", [0.05, 0.5])
@pytest.mark.parametrize("seed", SEEDS)
def test_rows_that_a_logger_wrote_again_are_counted(seed, share):
    stamps, channels = parts(seed, noise=0.02)
    again = np.flatnonzero(np.random.default_rng(seed).random(ROWS - 20) < share) + 10
    again = again[np.diff(again, prepend=0) > 1]
    for row in again:
        for values in channels.values():
            values[row] = values[row - 1]
    issues = [issue for issue in examine(recording(stamps, channels)).issues if issue.kind == "repeated rows"]
    assert [issue.measures["rows"] for issue in issues] == [again.size]
    assert f"{again.size} of {ROWS} rows repeat the row before in all 12 columns" in issues[0].message


@pytest.mark.parametrize(("count", "expected"), [(9, set()), (10, {"repeated rows"})])
def test_a_device_that_is_late_now_and_then_is_no_logger_that_repeats_rows(count, expected):
    stamps, channels = parts(noise=0.02)
    for row in np.linspace(20, ROWS - 20, count).astype(int):
        for values in channels.values():
            values[row] = values[row - 1]
    assert kinds(examine(recording(stamps, channels))) == expected


def test_slow_motion_repeats_rows_by_itself():
    turn = np.arange(4000) * 2e-3
    hip = np.round(0.01 * np.column_stack([np.sin(turn), np.sin(0.7 * turn)]) / 5e-5) * 5e-5
    assert "repeated rows" not in kinds(examine(recording(np.arange(4000) * 1_000_000, {"hip": hip})))


@pytest.mark.parametrize("digits", [None, 7])
def test_a_place_made_of_encoders_repeats_where_no_count_comes_and_is_sound(digits):
    """A count moves the place along x and y by lengths that change with the pose: neither has steps of one size."""
    swing = np.sin(np.arange(4000) * 1.5e-3) ** 3  # slow where it passes the middle, and where it turns
    joints = np.column_stack([-0.3 + 0.08 * swing, 0.2 * swing])
    hip = np.array([DEVICE.position(row) for row in np.round(joints / ENCODER_STEP) * ENCODER_STEP])
    hip = hip if digits is None else np.round(hip, digits)
    assert np.sum(~np.diff(hip, axis=0).any(axis=1)) > 100
    assert "repeated rows" not in kinds(examine(recording(np.arange(4000) * 1_000_000, {"hip": hip})))


DT, QUANTUM = 1e-3, 5e-6


def filtered(position, cutoff):
    """What a controller makes of encoder readings: differences through a first-order low-pass (Hz)."""
    share = 1.0 - np.exp(-2.0 * np.pi * cutoff * DT)
    out = np.zeros_like(position)
    for k in range(1, len(position)):
        out[k] = out[k - 1] + share * ((position[k] - position[k - 1]) / DT - out[k - 1])
    return out


def stroke(rows=4000, *, slow=0.4, shake=0.0):
    """To and fro at `slow` Hz, 50 mm wide, with a shaking of so many metres at 70 Hz, as encoders see it."""
    time = DT * np.arange(rows)
    position = 0.05 * np.sin(2.0 * np.pi * slow * time) + shake * np.sin(2.0 * np.pi * 70.0 * time)
    return time, QUANTUM * np.round(position / QUANTUM)


def moving(time, position, speed):
    return kinds(examine(Recording(time, {"hip": position[:, None], "velocity": speed[:, None]})))


def fitted(time, position, speed):
    return derivative_fit(position, speed, time)


@pytest.mark.parametrize("cutoff", [20.0, 100.0, 1e4])
@pytest.mark.parametrize(("shake", "slow"), [(0.0, 0.05), (3e-4, 0.05), (0.0, 3.0), (3e-4, 0.4)])
def test_the_velocity_of_an_honest_filter_is_sound(cutoff, shake, slow):
    time, position = stroke(slow=slow, shake=shake)
    assert moving(time, position, filtered(position, cutoff)) == set()


@pytest.mark.parametrize("shake", [0.0, 3e-4])
@pytest.mark.parametrize("factor", [-1.0, 1e-3, 1e3, 180.0 / np.pi, 0.7, 1.3])
def test_a_velocity_of_wrong_sign_or_unit_is_found(shake, factor):
    time, position = stroke(shake=shake)
    for cutoff in (50.0, 1e4):
        speed = factor * filtered(position, cutoff)
        assert moving(time, position, speed) >= {"velocity"}
        assert fitted(time, position, speed).ratio == pytest.approx(factor, rel=0.05)


def test_a_velocity_that_is_shifted_or_of_something_else_is_found():
    time, position = stroke(6000, slow=0.7)
    for rows in (-200, -15, 15, 200):
        speed = np.roll(filtered(position, 100.0), rows)
        assert moving(time[300:-300], position[300:-300], speed[300:-300]) == {"velocity"}
    late = np.roll(np.gradient(position, DT), 6)
    assert fitted(time[50:-50], position[50:-50], late[50:-50]).lag in (5, 6)  # central: half a row early
    assert moving(time, position, np.cos(2.0 * np.pi * 1.3 * time)) == {"velocity"}
    assert moving(time, position, position) == {"velocity", "copy"}
    dither = QUANTUM * (np.arange(time.size) // 7 % 2)
    assert fitted(time, dither, filtered(dither, 100.0)) is None
    keep = (time < 1.0) | (time > 1.6)  # a gap is not integrated across
    assert moving(time[keep], position[keep], filtered(position, 100.0)[keep]) == {"gap"}


SIGNAL = np.random.default_rng(2).normal(size=500)


def written(values, digits):
    return np.array([float(f"{value:.{digits - 1}e}") for value in values])


def last_place(values, digits):
    return 10.0 ** (np.floor(np.log10(np.abs(values).max())) - digits + 1)


@pytest.mark.parametrize("scale", [1e-6, 0.37, 25.4])
@pytest.mark.parametrize("digits", [3, 7, 14])
def test_the_grain_of_a_column_is_that_of_its_digits_its_precision_or_its_encoder(digits, scale):
    kept = written(scale * SIGNAL, digits)
    assert quantization_step(kept) == pytest.approx(last_place(kept, digits))
    if digits < 13:
        for factor in (1e-3, -1.0):  # a change of unit hides no digits
            assert quantization_step(factor * kept) >= 0.9 * abs(factor) * last_place(scale * SIGNAL, digits)
    single = (scale * SIGNAL).astype(np.float32).astype(float)
    assert quantization_step(single) == np.spacing(np.float32(np.abs(single).max()))
    assert quantization_step(scale * SIGNAL) == 0.0
    step = 1e-3 * scale
    assert quantization_step(step * np.round(scale * SIGNAL / step)) == pytest.approx(step, rel=1e-6)


@pytest.mark.parametrize("values", [np.zeros(100), np.array([0.1, 0.2, 0.3]), np.array([]), np.full(9, np.nan)])
def test_of_few_numbers_nothing_is_said(values):
    assert quantization_step(values) < 0.11  # three numbers are at most a lattice


@pytest.mark.parametrize("digits", [4, 6, 9])
def test_a_spring_written_with_few_digits_is_still_one(digits):
    """Rounding of hip, ihip and force adds up; a stiffness that is off by a per cent does not hide behind it."""
    hip = 0.05 * SIGNAL[:, None]
    ihip = hip + 0.004 * np.random.default_rng(3).uniform(size=hip.shape)
    channels = {"hip": hip, "ihip": ihip, "force": 800.0 * (ihip - hip)}
    kept = {name: written(values[:, 0], digits)[:, None] for name, values in channels.items()}
    run = Recording(1e-3 * np.arange(500), kept)
    assert inverse_checks(run, stiffness=800.0)[0].issues == ()
    assert digits == 4 or inverse_checks(run, stiffness=792.0)[0].issues


@settings(max_examples=60)
@example(rows=1, measured=1, gain=1.5, off=3e-4, seed=0)
@given(
    rows=st.integers(1, 12),
    measured=st.integers(1, 12),
    gain=st.sampled_from([1.0, 1.5]),
    off=st.sampled_from([0.0, 3e-4]),
    seed=st.integers(0, 2**32 - 1),
)
def test_what_is_off_is_found_in_a_few_rows_too_wherever_they_are(rows, measured, gain, off, seed):
    """There are fewer rows than any lag or window has, or few of them are valid."""
    random = np.random.default_rng(seed)
    stamps, channels = parts(int(random.integers(3)), quantised=False)
    channels["ihip"] += off
    channels["force"] = gain * STIFFNESS * (channels["ihip"] - channels["hip"])
    first = int(random.integers(ROWS - rows))
    part = slice(first, first + rows)
    valid = random.permutation(rows) < measured
    run = recording(stamps[part], {name: values[part] for name, values in channels.items()}, valid=valid)
    report = full(run)
    found = {check.name: bool(check.issues) for check in report.checks}
    assert found["spring"] is (gain != 1.0)
    assert found["surface"] is (off > 0.0)
    for each in sound_intervals(run, report).sound:
        assert 0 <= each.first < each.end <= rows
