"""Mappings: units, signs and clocks are said, never guessed; and a file goes out and comes back."""

from __future__ import annotations

import math
import tomllib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticeval.errors import HapticevalError, InputError, UnknownNameError
from hapticeval.recordings.formats import Table, read_table
from hapticeval.recordings.hdf5 import read_recording
from hapticeval.recordings.importing.convert import convert, export, is_ours, load
from hapticeval.recordings.importing.mapping import parse_mapping, propose, read_mapping
from hapticeval.recordings.importing.units import UNITS, parse_quantity, parse_unit
from hapticeval.recordings.recording import Recording, Signal

ROWS = 40


def table(**more):
    rows = np.arange(ROWS)
    columns = {"t": rows * 2.0, "px": rows * 1.0, "pz": -rows * 3.0, "tau": rows * 0.15, "pen": (rows % 10 > 2) * 1}
    return Table({**columns, **more})


def document(**changes):
    """A complete mapping, with some entries changed: `hip__unit="m"` is the unit of [channels.hip]."""
    made = {
        "title": "rig",
        "time": {"column": "t", "unit": "ms"},
        "channels": {
            "hip": {"columns": ["px", "pz"], "unit": "mm", "sign": [1, -1]},
            "velocity": {"columns": ["px", "pz"], "unit": "mm/s", "sign": 1},
        },
    }
    for place, value in changes.items():
        section, _, key = place.partition("__")
        holder = made["time"] if section == "time" else made["channels"].setdefault(section, {})
        if value is None:
            holder.pop(key)
        else:
            holder[key] = value
    return made


def converted(source=None, **changes):
    return convert(source or table(), parse_mapping(document(**changes)))


def test_units_signs_and_time_come_out_in_si():
    made = converted()
    assert np.allclose(made.time, np.arange(ROWS) * 2e-3, atol=1e-12)
    assert np.allclose(made.hip, np.column_stack([np.arange(ROWS) * 1e-3, np.arange(ROWS) * 3e-3]), atol=1e-15)
    assert made.meta["source"] == "file"
    assert made.signals["hip"].sign == "sign as mapped: [1, -1]"


def test_a_torque_at_a_lever_is_a_force_and_an_angle_a_length():
    lever = {"columns": ["tau"], "unit": "N m", "sign": -1, "divide": "0.075 m"}
    angle = {"columns": ["px"], "unit": "deg", "sign": 1, "scale": "0.075 m/rad", "offset": "2 mm"}
    made = convert(table(), parse_mapping({**document(), "channels": {"force": lever, "hip": angle}}))
    assert np.allclose(made.force[:, 0], -np.arange(ROWS) * 0.15 / 0.075)
    assert np.allclose(made.hip[:, 0], np.radians(np.arange(ROWS)) * 0.075 + 2e-3)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"hip__unit": "?"}, r"\[channels.hip\]: the unit '\?' is not known"),
        ({"hip__sign": "?"}, r"\[channels.hip\]: the sign is not known"),
        ({"hip__unit": "deg"}, "'deg' is no m"),
        ({"hip__unit": "N"}, "'N' is no m"),
        ({"hip__unit": "furlong"}, "unknown unit 'furlong'"),
        ({"hip__sign": 2}, "unknown choice '2'"),
        ({"hip__sign": None}, "missing required field `sign`"),
        ({"hip__sign": [1]}, "2 columns, 1 signs"),
        ({"time__unit": "?"}, r"\[time\]: the unit"),
        ({"time__unit": "mm"}, "'mm' is no s"),
        ({"hip__colour": "red"}, "unknown entry 'colour'"),
        ({"hip__becomes": "mm"}, "is in m, frame world"),
        ({"hip__scale": "much"}, "is no quantity"),
    ],
)
def test_what_is_not_said_is_refused_with_its_place(changes, words):
    with pytest.raises(InputError, match=words):
        converted(**changes)


def test_a_channel_of_ones_own_says_what_it_is():
    own = {"columns": ["tau"], "unit": "V", "sign": 1, "scale": "2 N/V"}
    with pytest.raises(InputError, match="no channel that hapticeval knows"):
        convert(table(), parse_mapping({**document(), "channels": {"grip": own}}))
    own |= {"becomes": "N", "meaning": "grip force"}
    made = convert(table(), parse_mapping({**document(), "channels": {"grip": own}}))
    assert made.channels["grip"].tolist() == (np.arange(ROWS) * 0.3).tolist()
    assert made.signals["grip"].meaning == "grip force"


def test_a_missing_column_suggests_the_closest():
    with pytest.raises(UnknownNameError) as caught:
        converted(hip__columns=["px", "pzz"])
    assert "pz" in caught.value.todo


def test_a_time_that_turns_back_is_refused_or_marked_never_sorted():
    times = np.arange(ROWS) * 2.0
    times[[7, 20]] = times[[6, 3]]
    with pytest.raises(InputError, match="does not increase at row 7"):
        converted(table(t=times))
    made = converted(table(t=times), time__disorder="mask")
    assert np.flatnonzero(~made.valid).tolist() == [7, 20]
    assert made.meta["import"]["left out"] == {"time out of order": 2}
    assert made.hip[8, 0] == 8e-3


def test_rows_without_a_number_are_kept_and_not_valid():
    positions = np.arange(ROWS) * 1.0
    positions[5] = math.nan
    made = converted(table(px=positions))
    assert np.flatnonzero(~made.valid).tolist() == [5]
    assert made.meta["import"]["left out"] == {"without a number": 1}


def test_a_pen_that_is_up_leaves_gaps():
    made = convert(table(), parse_mapping({**document(), "gaps": {"column": "pen", "where": 0}}))
    assert [(rows.start, rows.stop) for rows in made.sound_rows()] == [(3, 10), (13, 20), (23, 30), (33, 40)]
    assert made.time[3] == 0.0  # zero is the first valid row


@pytest.mark.parametrize("start", ["zero", "file"])
def test_nanoseconds_of_a_wall_clock_lose_nothing(start):
    first = 1_700_000_000_123_456_789
    stamps = first + np.arange(ROWS) * 1_000_003
    made = converted(table(t=stamps), time__unit="ns", time__start=start)
    assert made.clock.nanoseconds.tolist() == stamps.tolist()
    assert made.time[0] == (0.0 if start == "zero" else first / 1e9)


def test_without_a_clock_the_rate_is_said():
    made = convert(table(), parse_mapping({**document(), "time": {"rate": 500}}))
    assert np.allclose(np.diff(made.time), 2e-3)


def test_another_clock_is_refused_or_brought_over_as_said():
    slow = {"t2": np.arange(0.0, 80.0, 5.0), "f": np.arange(16.0)}
    force = {"columns": ["f"], "unit": "N", "sign": 1}
    channels = {"force": force, "hip": {"columns": ["px"], "unit": "m", "sign": 1}}

    def made(**how):
        said = {**document(), "channels": {"hip": channels["hip"], "force": {**force, **how}}}
        return convert(table(**slow), parse_mapping(said))

    with pytest.raises(InputError, match="'f' has 16 rows, 't' has 40 rows"):
        made()
    with pytest.raises(InputError, match="on the clock 't2'"):
        made(time="t2")
    held = made(time="t2", resample="hold")
    assert held.force[:, 0].tolist()[:6] == [0.0, 0.0, 0.0, 1.0, 1.0, 2.0]
    assert np.allclose(made(time="t2", resample="linear").force[:38, 0], np.arange(38) * 0.4)
    assert held.valid.tolist() == [True] * 38 + [False] * 2  # after the last stamp nothing is known
    assert held.meta["import"]["resampled"] == {"force": "hold"}


def test_a_proposal_says_what_it_does_not_know_and_cannot_be_used_as_it_is(tmp_path):
    source = Table({"time": np.arange(9.0), "pos.x": np.arange(9.0), "pos.y": np.arange(9.0), "force": np.arange(9.0)})
    text = propose(source, file="run.csv")
    said = tomllib.loads(text)
    assert said["time"] == {"column": "time", "unit": "?", "start": "zero"}
    assert said["channels"]["hip"] == {"columns": ["pos.x", "pos.y"], "unit": "?", "sign": 1}
    assert said["channels"]["force"]["sign"] == "?"
    (tmp_path / "m.toml").write_text(text)
    with pytest.raises(InputError, match="not known"):
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


def recording(valid=None):
    rows = np.arange(30.0)
    points = np.column_stack([np.sin(rows), np.cos(rows)])
    channels = {"hip": points, "ihip": points * 1.1, "force": -points, "joint_torque": points[:, :1] * 0.1}
    return Recording(rows * 1e-3, channels, {"device": "Größe", "dt": 1e-3}, valid=valid)


@pytest.mark.parametrize("suffix", [".csv", ".npz", ".mat"])
def test_an_exported_recording_comes_back_bit_for_bit(tmp_path, suffix):
    valid = np.arange(30) != 4
    path = export(tmp_path / f"run{suffix}", recording(valid))
    source = read_table(path)
    text = propose(source)
    if suffix == ".csv":  # CSV has no place to say who wrote it
        text = text.replace('sign = "?"', "sign = 1") + '\n[gaps]\ncolumn = "valid [1]"\nwhere = 0\n'
    made = convert(source, parse_mapping(tomllib.loads(text)))
    assert set(made.channels) == set(recording().channels)
    for name, values in recording().channels.items():
        assert np.array_equal(made.channels[name], values)
    assert np.array_equal(made.valid, valid)
    assert np.array_equal(made.clock.nanoseconds, np.arange(30) * 1_000_000)


def test_our_own_format_keeps_everything(tmp_path):
    path = export(tmp_path / "run.h5", recording())
    assert dict(read_recording(path).meta) == dict(recording().meta)
    assert is_ours(path)
    assert dict(load(path).meta)["device"] == "Größe"


@pytest.mark.parametrize("suffix", [".h5", ".csv", ".npz", ".mat"])
def test_nothing_is_written_over(tmp_path, suffix):
    path = tmp_path / f"run{suffix}"
    path.write_bytes(b"precious")
    with pytest.raises(InputError, match="is there already"):
        export(path, recording())
    assert path.read_bytes() == b"precious"


def test_what_cannot_be_exported_says_so(tmp_path):
    with pytest.raises(UnknownNameError, match="file ending"):
        export(tmp_path / "run.xls", recording())
    odd = Recording([0.0, 1.0], {"grip.left": [1.0, 2.0]}, signals={"grip.left": Signal("N", "grip")})
    with pytest.raises(InputError, match=r"grip\.left"):
        export(tmp_path / "run.mat", odd)
    assert list(tmp_path.iterdir()) == []


def test_a_foreign_file_needs_a_mapping(tmp_path):
    (tmp_path / "a.csv").write_text("t,x\n0,1\n1,2\n")
    with pytest.raises(InputError, match="is no recording of hapticeval's") as caught:
        load(tmp_path / "a.csv")
    assert "--write-mapping" in caught.value.todo


@given(name=st.sampled_from(sorted(UNITS)), power=st.integers(1, 3))
def test_units_are_powers_and_quotients_of_words(name, power):
    one = parse_unit(name)
    assert parse_unit(f"{name}^{power}").factor == pytest.approx(one.factor**power)
    assert parse_unit(f"{name}/{name}").dimension == (0,) * 6
    assert parse_quantity(f"2.5 {name}").factor == pytest.approx(2.5 * one.factor)


@pytest.mark.parametrize(
    ("text", "factor"),
    [
        ("N cm", 1e-2),
        ("deg/s", math.pi / 180),
        ("0.1 deg", math.pi / 1800),
        ("mm/s^2", 1e-3),
        ("rev/min", math.pi / 30),
    ],
)
def test_units_of_rigs(text, factor):
    assert parse_unit(text).factor == pytest.approx(factor)


def test_the_errors_are_the_users(tmp_path):
    (tmp_path / "m.toml").write_text("this is = = not toml")
    with pytest.raises(HapticevalError, match="is not TOML"):
        read_mapping(tmp_path / "m.toml")
    with pytest.raises(HapticevalError, match="cannot read"):
        read_mapping(tmp_path / "none.toml")


def test_a_misspelt_key_is_named_with_the_right_one():
    table = {"time": {"rate": 1000}, "channels": {"hip": {"columns": ["x"], "unit": "mm", "sgn": 1}}}
    with pytest.raises(InputError, match="unknown entry 'sgn'") as caught:
        parse_mapping(table)
    assert caught.value.todo == "did you mean sign?"


def test_a_mapping_for_another_format_is_told_before_any_byte_is_read_by_it(tmp_path):
    np.savez(tmp_path / "a.npz", t=np.arange(9), x=np.arange(9.0))
    (tmp_path / "m.toml").write_text(
        'format = "csv"\n[time]\nrate = 1000\n[channels.hip]\ncolumns = ["x"]\nunit = "m"\nsign = 1\n'
    )
    with pytest.raises(InputError, match=r"is in the format 'npz' .* is for 'csv'"):
        load(tmp_path / "a.npz", mapping=tmp_path / "m.toml")


def test_a_proposal_takes_units_from_headers_and_labels(tmp_path):
    (tmp_path / "a.csv").write_text("t/s,Pos X (mm),F_x/N\n0,1,2\n0.001,2,3\n0.002,3,4\n")
    text = propose(read_table(tmp_path / "a.csv"))
    assert "[channels.force]" in text
    assert 'columns = ["F_x/N"]\nunit = "N"' in text
    table = Table({"t": np.arange(9.0), "s": np.arange(9.0)}, notes={"s": "ee position [mm]"})
    assert 'columns = ["s"]\nunit = "mm"' in propose(table)
