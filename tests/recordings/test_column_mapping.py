"""Mappings: units, signs and clocks are stated, never guessed; and a file goes out and comes back."""

import math
import tomllib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticeval.errors import InputError, UnknownNameError
from hapticeval.recordings.channels import Signal
from hapticeval.recordings.formats import Table, read_table
from hapticeval.recordings.hdf5 import read_recording
from hapticeval.recordings.importing.convert import convert, export, is_ours, load
from hapticeval.recordings.importing.mapping import parse_mapping, read_mapping
from hapticeval.recordings.importing.proposal import clocks, propose
from hapticeval.recordings.importing.units import UNITS, parse_quantity, parse_unit
from hapticeval.recordings.integrity.report import examine
from hapticeval.recordings.quantization import coarsest
from hapticeval.recordings.recording import Recording

ROWS = 40
K = np.arange(ROWS)
HIP = {"columns": ["px", "pz"], "unit": "mm", "sign": [1, -1]}


def table(**more):
    return Table({"t": K * 2.0, "px": K * 1.0, "pz": K * -3.0, "tau": K * 0.15, "pen": (K % 10 > 2) * 1, **more})


def document(**changes):
    """A complete mapping, with some entries changed: `hip__unit="m"` is the unit of [channels.hip]."""
    made = {"title": "rig", "time": {"column": "t", "unit": "ms"}, "channels": {"hip": dict(HIP)}}
    for place, value in changes.items():
        section, _, key = place.partition("__")
        holder = made if not key else made["time"] if section == "time" else made["channels"][section]
        holder[key or section] = value
    return made


def converted(source=None, **changes):
    return convert(source or table(), parse_mapping(document(**changes)))


def test_units_signs_and_time_come_out_in_si():
    made = converted()
    assert np.allclose(made.time, K * 2e-3, atol=1e-12)
    assert np.allclose(made.hip, np.column_stack([K * 1e-3, K * 3e-3]), atol=1e-15)
    assert made.meta["source"] == "file"
    assert made.signals["hip"].sign == "sign as mapped: [1, -1]"


def test_vectors_in_turned_axes_come_into_those_of_the_model():
    table = Table({"t": [0.0, 1.0], "x": [20.0, 106.6], "y": [50.0, 100.0], "z": [7.0, 9.0]})
    # Of a file turned by 30 degrees, whose origin lies at (20, 50) mm.
    hip = {"columns": ["x", "y"], "unit": "mm", "sign": 1, "offset": ["-20 mm", "-50 mm"]}
    turned = converted(table, channels={"hip": {**hip, "axes": [[0.866, 0.5], [-0.5, 0.866]]}})
    np.testing.assert_allclose(turned.hip, [[0.0, 0.0], [0.1, 0.0]], atol=2e-5)
    flat = {"columns": ["x", "y", "z"], "unit": "mm", "sign": 1, "axes": [[0, 0, 1], [0, 1, 0]]}
    assert converted(table, channels={"hip": flat}).hip == pytest.approx(np.array([[0.007, 0.05], [0.009, 0.1]]))


@pytest.mark.parametrize("round_off", [lambda hip: hip.astype(np.float32), lambda hip: np.rint(hip / 2.5e-4) * 2.5e-4])
def test_turned_vectors_are_as_coarse_as_their_columns(round_off):
    angle = np.linspace(0.0, 3.0, 1000)
    hip = round_off(np.column_stack([np.cos(angle), np.sin(angle)])).astype(float)
    columns = {"t": angle, "x": hip[:, 0], "y": hip[:, 1]}
    spec = {"columns": ["x", "y"], "unit": "m", "sign": 1, "axes": [[0.866, 0.5], [-0.5, 0.866]], "offset": "0.0123 m"}
    turned = converted(Table(columns), channels={"hip": spec}, time__unit="s")
    assert coarsest(turned.hip) == pytest.approx(coarsest(hip), rel=1e-6)


@pytest.mark.parametrize(
    "axes", [[[0.87, 0.5], [0.5, 0.87]], [[1000.0, 0.0], [0.0, 1000.0]], [[1.0, 0.0, 0.0]], [[0, 1]] * 3]
)
def test_what_is_no_axes_of_a_vector_is_refused(refused, axes):
    table = Table({"t": [0.0, 1.0], "x": [0.0, 1.0], "y": [0.0, 1.0]})
    with refused(InputError):
        converted(table, channels={"hip": {"columns": ["x", "y"], "unit": "mm", "sign": 1, "axes": axes}})


def test_a_torque_at_a_lever_is_a_force_and_an_angle_a_length():
    lever = {"columns": ["tau"], "unit": "N m", "sign": -1, "divide": "0.075 m"}
    angle = {"columns": ["px"], "unit": "deg", "sign": 1, "scale": "0.075 m/rad", "offset": "2 mm"}
    made = converted(channels={"force": lever, "hip": angle})
    assert np.allclose(made.force[:, 0], -K * 0.15 / 0.075)
    assert np.allclose(made.hip[:, 0], np.radians(K) * 0.075 + 2e-3)


@pytest.mark.parametrize(
    "changes",
    [
        {"hip__unit": "?"},
        {"hip__sign": "?"},
        {"hip__unit": "deg"},
        {"hip__unit": "furlong"},
        {"hip__sign": 2},
        {"channels": {"hip": {"columns": ["px"], "unit": "mm"}}},
        {"hip__columns": []},
        {"hip__sign": [1]},
        {"time__unit": "?"},
        {"time__unit": "mm"},
        {"time__rate": 1000},
        {"time": {"rate": -1}},
        {"hip__sgn": 1},
        {"hip__becomes": "mm"},
        {"hip__scale": "much"},
        {"device": {"counts_per_turn": 4096}},
        {"channels": {}},
    ],
)
def test_what_is_not_stated_is_refused_with_its_place(refused, changes):
    with refused(InputError):
        converted(**changes)


def test_a_channel_of_ones_own_is_described(refused):
    own = {"columns": ["tau"], "unit": "V", "sign": 1, "scale": "2 N/V"}
    with refused(InputError):
        converted(channels={"grip": own})
    made = converted(channels={"grip": {**own, "becomes": "N", "meaning": "grip force"}})
    assert made.channels["grip"].tolist() == (K * 0.3).tolist()
    assert made.signals["grip"].meaning == "grip force"


def test_a_missing_column_suggests_the_closest(refused):
    with refused(UnknownNameError):
        converted(hip__columns=["px", "pzz"])
    with pytest.raises(UnknownNameError) as unlike:
        converted(hip__columns=["px", "height"])
    # Where it is named, and what the file calls its columns.
    assert unlike.value.what.startswith("[channels.hip]: unknown column 'height'")
    assert " px, " in unlike.value.todo


def test_rows_out_of_order_without_a_number_or_in_a_gap_are_kept_and_not_valid(refused):
    times, positions = K * 2.0, K * 1.0
    times[[7, 20, 21]] = times[[6, 3, 4]]
    positions[25] = math.nan
    source = table(t=times, px=positions)
    with refused(InputError):
        converted(source)
    made = converted(source, time__disorder="mask")
    assert np.flatnonzero(~made.valid).tolist() == [7, 20, 21, 25]
    assert made.meta["import"]["left out"] == {"time out of order": 3, "without a number": 1}
    assert made.hip[8, 0] == 8e-3
    up = converted(gaps={"column": "pen", "where": 0})
    assert [(rows.start, rows.stop) for rows in up.sound_rows()] == [(3, 10), (13, 20), (23, 30), (33, 40)]
    assert up.time[3] == 0.0  # zero is the first valid row


def test_a_row_without_a_time_is_no_step_back_and_leaves_no_gap():
    times = K * 2.0 - 20.0
    times[[9, 30]] = math.nan
    run = converted(table(t=times), time__disorder="mask")
    assert run.clock.nanoseconds[[8, 9, 10, 29, 30]].tolist() == [-4_000_000, -4_000_000, 0, 38_000_000, 38_000_000]
    assert np.flatnonzero(~run.valid).tolist() == [9, 30]
    assert {(issue.kind, issue.measures.get("missing")) for issue in examine(run).issues} == {
        ("duplicate", None), ("gap", 1),
    }  # fmt: skip


@pytest.mark.parametrize(
    ("row", "time", "what", "todo"),
    [
        (5, math.nan, "is not a number at row 5", "mark them"),
        (5, 3.0, "does not increase at row 5: 0.008 s, then 0.003 s", "mark them"),
        (5, 0.0, "does not increase at row 5: 0.008 s, then 0 s", "make a file of each run"),
    ],
)
def test_why_a_time_is_refused_and_what_to_do(row, time, what, todo):
    times = K * 2.0
    times[row] = time
    with pytest.raises(InputError) as caught:
        converted(table(t=times))
    assert what in caught.value.what
    assert caught.value.why.startswith("1 row out of order or without a time")
    assert caught.value.todo.startswith(todo)


@pytest.mark.parametrize("start", ["zero", "file"])
def test_nanoseconds_of_a_wall_clock_lose_nothing(start):
    first = 1_700_000_000_123_456_789
    stamps = first + K * 1_000_003
    made = converted(table(t=stamps), time__unit="ns", time__start=start)
    assert made.clock.nanoseconds.tolist() == stamps.tolist()
    assert made.time[0] == (0.0 if start == "zero" else first / 1e9)


def test_without_a_clock_the_rate_is_stated():
    assert np.allclose(np.diff(converted(time={"rate": 500}).time), 2e-3)


def test_another_clock_is_refused_or_brought_over_as_stated(refused):
    slow = table(t2=np.arange(0.0, 80.0, 5.0), f=np.arange(16.0))

    def made(**how):
        return converted(slow, channels={"hip": HIP, "force": {"columns": ["f"] * 2, "unit": "N", "sign": 1, **how}})

    with refused(InputError):
        made()
    with refused(InputError):
        made(time="t2")
    held = made(time="t2", resample="hold")
    assert held.force[:, 0].tolist()[:6] == [0.0, 0.0, 0.0, 1.0, 1.0, 2.0]
    assert np.allclose(made(time="t2", resample="linear").force[:38, 0], np.arange(38) * 0.4)
    assert held.valid.tolist() == [True] * 38 + [False] * 2  # after the last stamp nothing is known
    assert held.meta["import"]["resampled"] == {"force": "hold"}


@pytest.mark.parametrize("name", ["monotonic_timestamp", "ros_time", "t", "Time [ms]", "sensor.stamp"])
def test_a_time_under_any_name_is_a_clock(name):
    assert clocks(Table({name: np.arange(5.0), "x": np.arange(5.0), "time_constant": np.arange(5.0)})) == [name]


def test_two_topics_are_never_put_on_one_clock_by_their_number_of_messages(refused):
    columns = {"/a.received": np.arange(5) * 1_000_000, "/a.x": np.arange(5.0)}
    columns |= {"/b.received": np.arange(5) * 1_300_000 + 7, "/b.f": 10.0 * np.arange(5.0)}
    units = {"/a.received": "ns", "/b.received": "ns"}
    table = Table(columns, units=units, topics={name: name[:2] for name in columns})
    proposed = tomllib.loads(propose(table))["channels"]["force"]
    assert (proposed["time"], proposed["resample"]) == ("/b.received", "?")  # its own, and nothing says how

    def made(**more):
        force = {"columns": ["/b.f"], "unit": "N", "sign": 1, **more}
        hip = {"columns": ["/a.x"], "unit": "mm", "sign": 1}
        return converted(table, time={"column": "/a.received", "unit": "ns"}, channels={"hip": hip, "force": force})

    with refused(InputError):
        made()
    with refused(InputError):
        made(time="/a.received", resample="hold")
    held = made(time="/b.received", resample="hold")
    assert held.force[1:4, 0].tolist() == [0.0, 10.0, 20.0]
    assert held.valid.tolist() == [False, True, True, True, True]


def test_a_proposal_marks_what_it_does_not_know_and_cannot_be_used_as_it_is(refused, tmp_path):
    source = Table({"time": np.arange(9.0), "pos.x": np.arange(9.0), "pos.y": np.arange(9.0), "force": np.arange(9.0)})
    text = propose(source, file="run.csv")
    made = tomllib.loads(text)
    assert made["time"] == {"column": "time", "unit": "?", "start": "zero"}
    assert made["channels"]["hip"] == {"columns": ["pos.x", "pos.y"], "unit": "?", "sign": 1}
    assert made["channels"]["force"]["sign"] == "?"
    (tmp_path / "m.toml").write_text(text)
    with refused(InputError):
        read_mapping(tmp_path / "m.toml")


def test_a_proposal_is_complete_once_its_questions_are_answered():
    rows = np.arange(12.0)
    source = Table({"tick": rows, **{f"{g}.{a}": rows for g in ("force", "position", "velocity") for a in "xyz"}})
    text = propose(source).replace('scale = "?"', 'scale = "0.001 s/tick"').replace('sign = "?"', "sign = 1")
    text = text.replace('unit = "?"', 'unit = "N"', 1).replace('unit = "?"', 'unit = "mm"', 1)
    made = convert(source, parse_mapping(tomllib.loads(text.replace('unit = "?"', 'unit = "mm/s"'))))
    assert np.allclose(made.time, rows * 1e-3)
    assert set(made.channels) == {"hip", "velocity", "force"}
    assert np.allclose(made.hip[:, 2], rows * 1e-3)


def test_a_proposal_takes_units_from_headers_and_labels(tmp_path):
    (tmp_path / "a.csv").write_text("t/s,Pos X (mm),F_x/N\n0,1,2\n0.001,2,3\n0.002,3,4\n")
    text = propose(read_table(tmp_path / "a.csv"))
    assert "[channels.force]" in text
    assert 'columns = ["F_x/N"]\nunit = "N"' in text
    table = Table({"t": np.arange(9.0), "s": np.arange(9.0)}, notes={"s": "ee position [mm]"})
    assert 'columns = ["s"]\nunit = "mm"' in propose(table)


def test_a_proposal_takes_units_from_the_ends_of_names():
    rows = np.arange(9.0)
    names = ("time_ms", "x_mm", "y_mm", "force_N", "x_s")
    proposed = tomllib.loads(propose(Table(dict.fromkeys(names, rows + 1700000000.0))))
    assert (proposed["time"]["column"], proposed["time"]["unit"]) == ("time_ms", "ms")
    assert proposed["channels"]["hip"] == {"columns": ["x_mm", "y_mm"], "unit": "mm", "sign": 1}
    assert proposed["channels"]["force"]["unit"] == "N"
    text = propose(Table({"t_s": rows + 1.7e9, "x_m": rows, "y_m": rows}))
    assert 'column = "t_s"  # 9 rows, 1700000000 to 1700000008\nunit = "s"' in text
    # Of master and slave, not metres and seconds.
    assert "channels" not in tomllib.loads(text)


def test_a_proposal_reads_topics_that_slashes_part():
    names = ("__time", "/arm/pose/position/x", "/arm/pose/position/y", "/arm/wrench/force/x", "/arm/wrench/force/y")
    proposed = tomllib.loads(propose(Table({name: np.arange(9.0) for name in names})))
    assert proposed["channels"]["hip"]["columns"] == list(names[1:3])
    assert proposed["channels"]["force"]["columns"] == list(names[3:])


def test_a_proposal_reads_german_words_and_points():
    names = ("Zeit (s)", "Weg x (mm)", "Weg y (mm)", "Kraft x (N)", "Kraft y (N)")
    proposed = tomllib.loads(propose(Table({name: np.arange(9.0) for name in names})))
    assert proposed["channels"]["hip"]["columns"] == list(names[1:3])
    assert proposed["channels"]["force"]["columns"] == list(names[3:])
    names = ("time", "/tip/point/x", "/tip/point/y")
    proposed = tomllib.loads(propose(Table({name: np.arange(9.0) for name in names})))
    assert proposed["channels"]["hip"]["columns"] == list(names[1:])


def test_the_torque_of_a_wrench_is_no_motor_s():
    names = ("time", "/ft.wrench.force.x", "/ft.wrench.torque.x", "/ft.wrench.torque.y")
    assert tomllib.loads(propose(Table({name: np.arange(9.0) for name in names})))["channels"].keys() == {"force"}


def test_a_proposal_without_a_hand_has_its_lines_to_fill_in(tmp_path):
    table = Table({"time": np.arange(9.0), "a": np.arange(9.0), "b": np.arange(9.0)})
    text = propose(table)
    assert "# [channels.hip]" in text
    filled = text.replace("# [channels.hip]", "[channels.hip]").replace(
        '# columns = ["?", "?"]', 'columns = ["a", "b"]'
    )
    filled = filled.replace('# unit = "?"', 'unit = "mm"').replace("# sign = 1", "sign = 1").replace('"?"', '"s"')
    assert parse_mapping(tomllib.loads(filled)).channels["hip"].columns == ("a", "b")
    assert "# [channels.hip]" not in propose(Table({"time": np.arange(9.0), "x": np.arange(9.0)}))


def recording(valid=None):
    rows = np.arange(30.0)
    points = np.column_stack([np.sin(rows), np.cos(rows)])
    channels = {"hip": points, "ihip": points * 1.1, "force": -points, "joint_torque": points[:, :1] * 0.1}
    return Recording(rows * 1e-3, channels, {"device": "Größe", "dt": 1e-3}, valid=valid)


@pytest.mark.parametrize("suffix", [".csv", ".npz", ".mat"])
def test_an_exported_recording_comes_back_bit_for_bit(tmp_path, suffix):
    valid = np.arange(30) != 4
    source = read_table(export(tmp_path / f"run{suffix}", recording(valid)))
    text = propose(source)
    if suffix == ".csv":  # CSV has no place to state who wrote it
        text = text.replace('sign = "?"', "sign = 1") + '\n[gaps]\ncolumn = "valid [1]"\nwhere = 0\n'
    made = convert(source, parse_mapping(tomllib.loads(text)))
    assert set(made.channels) == set(recording().channels)
    for name, values in recording().channels.items():
        assert np.array_equal(made.channels[name], values)
    assert np.array_equal(made.valid, valid)
    assert np.array_equal(made.clock.nanoseconds, np.arange(30) * 1_000_000)


def test_our_own_format_keeps_everything(tmp_path):
    path = export(tmp_path / "run.h5", recording())
    assert is_ours(path)
    assert dict(read_recording(path).meta) == dict(load(path).meta) == dict(recording().meta)


def test_what_cannot_be_exported_is_refused(refused, tmp_path):
    with refused(UnknownNameError):
        export(tmp_path / "run.xls", recording())
    odd = Recording([0.0, 1.0], {"grip.left": [1.0, 2.0]}, signals={"grip.left": Signal("N", "grip")})
    with refused(InputError):
        export(tmp_path / "run.mat", odd)
    assert list(tmp_path.iterdir()) == []


def test_a_foreign_file_needs_a_mapping_for_its_format(refused, tmp_path):
    np.savez(tmp_path / "a.npz", t=np.arange(9), x=np.arange(9.0))
    with refused(InputError):
        load(tmp_path / "a.npz")
    mapping = tmp_path / "m.toml"
    for text in (
        "this is = = not toml",
        'format = "csv"\n[time]\nrate = 1000\n[channels.hip]\ncolumns = ["x"]\nunit = "m"\nsign = 1\n',
    ):
        mapping.write_text(text)
        with refused(InputError):
            load(tmp_path / "a.npz", mapping=mapping)
    with refused(InputError):
        read_mapping(tmp_path / "none.toml")


@given(name=st.sampled_from(sorted(UNITS)), power=st.integers(1, 3))
def test_units_are_powers_and_quotients_of_words(name, power):
    one = parse_unit(name)
    assert parse_unit(f"{name}^{power}").factor == pytest.approx(one.factor**power)
    assert parse_unit(f"{name}/{name}").dimension == (0,) * 6
    assert parse_quantity(f"2.5 {name}").factor == pytest.approx(2.5 * one.factor)


RIGS = {"N cm": 1e-2, "deg/s": math.pi / 180, "0.1 deg": math.pi / 1800, "mm/s^2": 1e-3, "rev/min": math.pi / 30}


@pytest.mark.parametrize(("text", "factor"), RIGS.items())
def test_units_of_rigs(text, factor):
    assert parse_unit(text).factor == pytest.approx(factor)


@pytest.mark.parametrize(
    ("time", "hip"),
    [
        ({"rate": 1e-300}, {}),
        ({"rate": 1e-10}, {}),
        ({"column": "t", "unit": "min", "scale": "1e12"}, {}),
        ({"rate": 10**400}, {}),
        ({"rate": 1000.0}, {"divide": "1e-320 m"}),
        ({"rate": 1000.0}, {"unit": "mm^-99999"}),
        ({"rate": 1000.0}, {"offset": 10**400}),
    ],
)
def test_numbers_that_nothing_holds_are_refused_by_name(refused, time, hip):
    table = Table({"t": np.arange(1, 9), "x": np.arange(8.0)})
    channel = {"columns": ["x"], "unit": "m", "sign": 1, **hip}
    with refused(InputError):
        convert(table, parse_mapping({"time": time, "channels": {"hip": channel}}))


def proposed(*names, values=None, **more):
    """The channels that are proposed for columns of these names, and the columns of each."""
    moving = np.cumsum(np.random.default_rng(1).standard_normal((len(names), 40)), axis=1)
    columns = {"time": 1e-3 * np.arange(40), **dict(zip(names, moving if values is None else values, strict=True))}
    channels = tomllib.loads(propose(Table(columns, **more))).get("channels", {})
    return {channel: spec["columns"] for channel, spec in channels.items()}


def axes(stem, parts="xyz"):
    return [f"{stem}{part}" for part in parts]


def test_words_count_whole_and_the_best_vector_is_the_hand():
    """What `ros2 bag` gives beside a pose: a level is no velocity, a sequence number no torque and no hand."""
    pose, force = axes("/tip_pose.pose.position."), axes("/ft.wrench.force.")
    names = ["/rosout.level", "/tip_pose.header.seq", *pose, *axes("/tip_pose.pose.orientation.", "xyzw")]
    assert proposed(*names, *force, *axes("/ft.wrench.torque.")) == {"hip": pose, "force": force}


def test_a_quaternion_is_no_set_of_joints_and_a_goal_no_hand():
    hand = axes("ee_pos_")
    assert proposed(*axes("q", "xyzw"), *axes("goal_pos_"), *hand) == {"hip": hand}
    assert proposed(*axes("q")) == {}
    assert proposed("q1", "q2", "tau1", "tau2") == {"joint_position": ["q1", "q2"], "joint_torque": ["tau1", "tau2"]}


def test_nothing_is_proposed_where_no_name_is_like_a_channel():
    assert proposed("velvet", "positron", "forceps", "hipster", "level", "battery_voltage") == {}


def test_a_unit_of_something_else_excludes_a_channel():
    assert proposed("pos_x", "pos_y", units={"pos_x": "N", "pos_y": "N"}) == {}
    assert proposed("grip", units={"grip": "N"}, notes={"grip": "finger force"}) == {"force": ["grip"]}


def test_counts_and_commands_are_proposed_with_the_device_that_gives_them_meaning(tmp_path):
    counts = np.rint(1000.0 * np.sin(np.arange(40) / 7.0)[None] * [[1], [2]]).astype(int)
    columns = {
        "t": 1e-3 * np.arange(40),
        "enc1": counts[0],
        "enc2": counts[1],
        "u1": 0.1 * counts[1],
        "u2": 0.2 * counts[0],
    }
    text = propose(Table(columns))
    document = tomllib.loads(text)
    assert document["channels"]["raw"] == {"columns": ["enc1", "enc2"], "unit": "counts"}
    assert document["channels"]["command"] == {"columns": ["u1", "u2"], "unit": "?"}
    device = document["device"]
    assert device.pop("kind") == "parallelogram-2dof"
    # What nobody can read off a log is asked for, a direction as well.
    assert set(device.values()) == {"?"}
    answered = text.replace('counts_per_turn = "?"', "counts_per_turn = 4000").replace('unit = "?"', 'unit = "N m"', 1)
    answered = answered.replace('torque_per_command = "?"', "torque_per_command = 1.0").replace(
        'unit = "?"', 'unit = "V"'
    )
    mapping = parse_mapping(tomllib.loads(answered.replace('unit = "N m"', 'unit = "s"', 1)))
    assert mapping.channels["raw"].factor == (1.0, 1.0)


@pytest.mark.parametrize(
    ("encoders", "commands"),
    [
        (["enc_shoulder", "enc_elbow"], ["pwm_shoulder", "pwm_elbow"]),
        (["q1_counts", "q2_counts"], ["u1_V", "u2_V"]),
        (["Encoder 1 (counts)", "Encoder 2 (counts)"], ["DAC1 [V]", "DAC2 [V]"]),
        (["enc_base", "enc_shoulder", "enc_elbow"], ["cmd_0", "cmd_1", "cmd_2"]),
    ],
)
def test_joints_by_number_or_by_name_make_one_channel_of_a_robot(encoders, commands):
    time = np.arange(40)
    columns = {"t": 1e-3 * time}
    columns |= {name: np.rint(1000.0 * np.sin(time / 7.0 + k)).astype(int) for k, name in enumerate(encoders)}
    columns |= {name: np.cos(time / 5.0 + k) for k, name in enumerate(commands)}
    document = tomllib.loads(propose(Table(columns)))
    assert document["channels"].keys() == {"raw", "command"}
    assert document["channels"]["raw"] == {"columns": encoders, "unit": "counts"}
    assert document["channels"]["command"]["columns"] == commands
    assert document["device"]["kind"] == f"parallelogram-{len(encoders)}dof"


def test_a_robot_of_as_many_joints_as_none_here_is_not_guessed():
    columns = {"t": 1e-3 * np.arange(40), "enc1": np.arange(40) % 7}
    assert tomllib.loads(propose(Table(columns)))["device"]["kind"] == "?"


def test_a_clock_without_a_name_is_one_by_its_even_step():
    columns = {"a": 7.0 + 0.002 * np.arange(50), "x": np.sin(np.arange(50.0)), "y": np.cos(np.arange(50.0))}
    text = propose(Table(columns))
    assert tomllib.loads(text)["time"]["column"] == "a"
    assert "rises by an even step" in text
    assert clocks(Table({"x": np.sin(np.arange(50.0))})) == []


@pytest.mark.parametrize(("unit", "factor"), [("s", 1), ("ms", 10**3), ("us", 10**6), ("ns", 10**9)])
def test_a_time_since_1970_shows_its_unit(unit, factor):
    stamps = 1_700_000_000 * factor + np.arange(50)
    text = propose(Table({"stamp": stamps, "x": np.sin(np.arange(50.0))}))
    assert tomllib.loads(text)["time"]["unit"] == unit
    assert "2023-11-14" in text
