"""Binary formats: MATLAB 5 and 7.3, HDF5, NPZ, ROS bags."""

import contextlib
import re
import sqlite3
import struct
import sys
import tomllib

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from recording_files import matlab73, matrix73
from scipy.io import savemat
from scipy.sparse import csc_matrix

from hapticeval.errors import HapticevalError, InputError
from hapticeval.extras import install_command
from hapticeval.recordings.formats import read_table
from hapticeval.recordings.importing.convert import convert
from hapticeval.recordings.importing.mapping import parse_mapping
from hapticeval.recordings.importing.proposal import propose

T = np.arange(12) * 0.5e-3
POSITIONS = np.column_stack([np.arange(12.0), -np.arange(12.0)])


def mat5(path, **how):
    """As Simulink's `Structure With Time` saves a scope with two inputs, beside an object that only MATLAB reads."""
    signals = np.empty((1, 2), dtype=[("values", object), ("dimensions", object), ("label", object)])
    signals[0, 0] = (POSITIONS, 2, "Lever positions (rad)")
    signals[0, 1] = (np.arange(12.0)[:, None], 1, "Lever")
    savemat(path, {"scope": {"time": T[:, None], "signals": signals}, "Ts": 5e-4, "name": "rig"}, **how)
    path.write_bytes(path.read_bytes() + opaque("ts", "timeseries") + opaque("plant_model", "ss"))


def opaque(name, kind):
    """A MATLAB object as a MAT-file holds it: flags of class 17, then name, system and class, each a text element."""

    def text(word):
        return struct.pack("<II", 1, len(word)) + word.encode() + bytes(-len(word) % 8)

    handle = struct.pack("<IIII", 6, 8, 13, 0) + struct.pack("<IIII", 5, 8, 6, 1) + struct.pack("<II", 1, 0)
    handle += struct.pack("<II6I", 6, 24, 0xDD000000, 2, 1, 1, 1, 1)
    body = struct.pack("<IIII", 6, 8, 17, 0) + text(name) + text("MCOS") + text(kind)
    body += struct.pack("<II", 14, len(handle)) + handle
    return struct.pack("<II", 14, len(body)) + body


def mat73(path):
    with matlab73(path) as file:
        refs, scope = file.create_group("#refs#"), file.create_group("scope")
        matrix73(scope, "time", T[None, :])
        signals = scope.create_group("signals")
        text = np.array([[ord(letter)] for letter in "Lever positions (rad)"], dtype=np.uint16)
        for name, kind, parts in (
            ("values", "double", (POSITIONS.T, np.arange(12.0)[None, :])),
            ("label", "char", (text, text[:5])),
        ):
            made = [matrix73(refs, f"{name}{k}", part, kind).ref for k, part in enumerate(parts)]
            signals.create_dataset(name, data=np.array([made], dtype=h5py.ref_dtype).T, dtype=h5py.ref_dtype)
        matrix73(file, "Ts", np.array([[5e-4]]))
        matrix73(file, "name", np.array([[ord(letter)] for letter in "rig"], dtype=np.uint16), "char")
        odd = matrix73(file, "ts", np.zeros((1, 6), dtype=np.uint32), "timeseries")
        odd.attrs["MATLAB_object_decode"] = 3


@pytest.mark.parametrize(
    ("write", "format"),
    [(mat5, "matlab5"), (lambda path: mat5(path, do_compression=True), "matlab5"), (mat73, "matlab73")],
    ids=["5", "5 packed", "7.3"],
)
def test_a_structure_with_time_becomes_columns(tmp_path, write, format):
    write(tmp_path / "a.mat")
    table = read_table(tmp_path / "a.mat")
    assert table.format == format
    one, two, three = "scope.signals[0].values[0]", "scope.signals[0].values[1]", "scope.signals[1].values"
    assert sorted(table.columns) == [one, two, three, "scope.time"]
    assert table[two].tolist() == POSITIONS[:, 1].tolist()
    assert table[three].tolist() == list(range(12))
    assert table.notes == {
        one: "label: Lever positions (rad)",
        two: "label: Lever positions (rad)",
        three: "label: Lever",
    }
    assert (table.attributes["Ts"], table.attributes["name"]) == (5e-4, "rig")
    assert (dict(table.units), table.warnings) == ({}, ())
    assert "ts (timeseries)" in table.remarks[0]
    assert ("plant_model (ss)" in table.remarks[0]) == (format == "matlab5")


def test_samples_lie_along_the_axis_that_the_time_vector_shows(tmp_path):
    path, wide = tmp_path / "a.mat", np.arange(48.0).reshape(2, 2, 12)
    log = {"time": np.arange(30.0), "data": np.arange(390.0).reshape(13, 30)}
    savemat(path, {"ts": {"Time": T, "Data": wide, "Name": "hip"}, "log": log})
    table = read_table(path)
    assert table["ts.Time"].tolist() == T.tolist()
    assert table["ts.Data[1]"].tolist() == wide[0, 1].tolist()
    assert table["log.data[12]"].tolist() == list(range(360, 390))
    assert "13 x 30: its 13 rows are taken for the signals" in table.remarks[0]


@pytest.mark.parametrize("save", ["matlab5", "matlab5-packed", "hdf5", "npz"])
@settings(max_examples=15)
@given(cut=st.floats(0.01, 0.99))
def test_a_foreign_file_that_is_cut_is_refused_with_the_place(tmp_path_factory, save, cut):
    path = tmp_path_factory.mktemp("cut") / "a.dat"
    values = {f"v{k}": np.random.default_rng(k).normal(size=50) for k in range(6)}
    if save.startswith("matlab5"):
        savemat(path, values, do_compression=save.endswith("packed"), appendmat=False)
    elif save == "npz":
        with path.open("wb") as file:
            np.savez(file, **values)
    else:
        with h5py.File(path, "w") as file:
            for name, array in values.items():
                file[name] = array
    data = path.read_bytes()
    kept = max(512, round(cut * len(data)))
    path.write_bytes(data[:kept])
    if save.startswith("matlab5") and kept in _borders(data):
        return  # between two variables nothing shows that others followed
    with pytest.raises(InputError) as caught:
        read_table(path, format=save.partition("-")[0])
    assert re.search(r"\d|index", caught.value.why), caught.value.why


EVERYTHING = {
    "run": {"t": T, "x": 2 * T, "inner": {"y": T}},
    "matrix": np.arange(30.0).reshape(10, 3),
    "cube": np.arange(60.0).reshape(3, 4, 5),
    "short": np.arange(12, dtype=np.int16),
    "flags": T[3] < T,
    "name": "hello",
    "words": np.array(["ab", "cd "]),
    "letters": "Größe",
    "empty": np.zeros((0, 3)),
    "cells": np.array([[T, "ab"], [T[:3], {"q": T}]], dtype=object),
    "several": np.array([(T, "a"), (T + 1.0, "b")], dtype=[("u", object), ("v", object)]),
}


@settings(max_examples=60)
@given(
    hurt=st.lists(
        st.tuples(
            st.floats(0.0, 1.0, exclude_max=True),
            st.sampled_from([b"\xff", *(bytes([k]) for k in (0, 1, 3, 9, 14, 15, 127))]),
        ),
        min_size=1,
        max_size=4,
    )
)
def test_a_damaged_matlab_file_is_read_or_refused(tmp_path_factory, hurt):
    """One in sixty of these ends a process by a segmentation fault in scipy's reader."""
    path = tmp_path_factory.mktemp("mat") / "a.mat"
    savemat(path, EVERYTHING | {"sparse": csc_matrix(np.eye(4)), "both": T + 1j * T})
    data = bytearray(path.read_bytes())
    for where, byte in hurt:
        data[128 + int(where * (len(data) - 128))] = byte[0]
    path.write_bytes(data)
    with contextlib.suppress(InputError):
        read_table(path, format="matlab5")


def test_a_matlab_file_that_keeps_its_reader_busy_is_refused(tmp_path, monkeypatch, refused):
    """A structure of 2 x 1 that says that it has 50,331,650 x 1."""
    savemat(tmp_path / "a.mat", EVERYTHING)
    data = bytearray((tmp_path / "a.mat").read_bytes())
    sizes = struct.pack("<IIii", 5, 8, 1, 2)
    at = data.index(b"several") - 24
    assert bytes(data[at : at + 16]) == sizes
    data[at + 15] = 3
    (tmp_path / "a.mat").write_bytes(data)
    monkeypatch.setattr("hapticeval.recordings.formats.matlab.LEAST_PATIENCE", 0.5)
    with refused(InputError):
        read_table(tmp_path / "a.mat")


def test_what_is_no_column_is_named(tmp_path):
    savemat(tmp_path / "a.mat", {"t": T, "sparse": csc_matrix(np.eye(4)), "both": T + 1j * T})
    table = read_table(tmp_path / "a.mat")
    assert list(table.columns) == ["t"]
    assert sorted(table.warnings) == [
        "'both' holds complex numbers, which are left out",
        "'sparse' is a sparse matrix, which is left out",
    ]


def test_what_is_whole_outside_and_broken_inside_is_refused(refused, tmp_path):
    path = tmp_path / "a.mat"
    savemat(path, {"x": np.random.default_rng(1).normal(size=500)}, do_compression=True)
    data = path.read_bytes()
    path.write_bytes(data[:132] + struct.pack("<I", len(data) - 136 - 40) + data[136:-40])
    with refused(InputError):
        read_table(path)
    np.savez(tmp_path / "inner.npz", x=np.arange(9.0))
    (tmp_path / "a.npz").write_bytes(b"PK\x03\x04 x.npy" + (tmp_path / "inner.npz").read_bytes())
    with refused(InputError):
        read_table(tmp_path / "a.npz")


def _borders(data):
    place, borders = 128, set()
    while place < len(data):
        place += 8 + struct.unpack("<I", data[place + 4 : place + 8])[0]
        borders.add(place)
    return borders


def test_any_hdf5_file_is_columns_by_path(tmp_path):
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file.attrs["operator"] = "A"
        file.create_dataset("rig/x", data=POSITIONS).attrs["units"] = "mm"
        file.create_dataset("log", data=np.array([(0.0, 1), (0.1, 2)], dtype=[("t", float), ("n", int)]))
        file.create_dataset("words", data=np.array([b"a", b"b"]))
    table = read_table(path)
    assert set(table.columns) == {"rig/x[0]", "rig/x[1]", "log.t", "log.n"}
    assert dict(table.units) == {"rig/x[0]": "mm", "rig/x[1]": "mm"}
    assert table.attributes["@operator"] == "A"
    assert "'words'" in table.remarks[0]


@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
@settings(max_examples=40)
@given(where=st.floats(0.0, 1.0, exclude_max=True), bit=st.integers(0, 7))
def test_a_wrong_byte_in_an_archive_is_never_read_as_a_number(tmp_path_factory, save, where, bit):
    path = tmp_path_factory.mktemp("npz") / "a.npz"
    values = {"t": np.arange(200.0), "x": np.random.default_rng(1).normal(size=(200, 2))}
    save(path, **values)
    data = bytearray(path.read_bytes())
    data[int(where * len(data))] ^= 1 << bit
    path.write_bytes(bytes(data))
    written = {"t": values["t"], "x[0]": values["x"][:, 0], "x[1]": values["x"][:, 1]}
    with contextlib.suppress(InputError):
        table = read_table(path, format="npz")
        assert all(np.array_equal(table[name], written.get(name, table[name])) for name in table.columns)


def test_npz_arrays_are_columns_and_pickles_are_not_opened(tmp_path):
    path = tmp_path / "a.npz"
    np.savez(path, t=T, hip=POSITIONS, dt=0.001, who=np.array("A"), odd=np.array([{}], dtype=object))
    table = read_table(path)
    assert set(table.columns) == {"t", "hip[0]", "hip[1]"}
    assert table.attributes["who"] == "A"
    assert "'odd'" in table.warnings[0]


START = 1_700_000_000_999_000_000


def write_bag(path, rows=5, storage="SQLITE3"):
    """A bag of either version: forces, and joints at every second time."""
    pytest.importorskip("rosbags", reason="needs the extra hapticeval[ros]")
    from rosbags import rosbag1, rosbag2
    from rosbags.typesys import Stores, get_typestore

    first = path.suffix == ".bag"
    store = get_typestore(Stores.ROS1_NOETIC if first else Stores.ROS2_HUMBLE)
    kinds = store.types
    Stamp, Header = kinds["builtin_interfaces/msg/Time"], kinds["std_msgs/msg/Header"]
    Vector, Stamped = kinds["geometry_msgs/msg/Vector3"], kinds["geometry_msgs/msg/Vector3Stamped"]
    Joints = kinds["sensor_msgs/msg/JointState"]
    serialize = store.serialize_ros1 if first else store.serialize_cdr
    with (
        rosbag1.Writer(path)
        if first
        else rosbag2.Writer(path, version=8, storage_plugin=rosbag2.StoragePlugin[storage]) as writer
    ):
        force = writer.add_connection("/force", Stamped.__msgtype__, typestore=store)
        joints = writer.add_connection("/joints", Joints.__msgtype__, typestore=store)
        for k in range(rows):
            when = START + k * 1_000_000
            count = {"seq": k} if first else {}
            header = Header(stamp=Stamp(sec=when // 10**9, nanosec=when % 10**9), frame_id="base", **count)
            message = Stamped(header=header, vector=Vector(x=0.5 * k, y=0.0, z=-1.0))
            writer.write(force, when + 300, serialize(message, Stamped.__msgtype__))
            if k % 2 == 0:
                none, position = np.empty(0), np.array([0.1 * k, 0.2])
                state = Joints(header=header, name=["a", "b"], position=position, velocity=none, effort=none)
                writer.write(joints, when + 500, serialize(state, Joints.__msgtype__))


@pytest.mark.parametrize("name", ["bag", "run.bag"])
def test_a_ros_bag_has_columns_and_clocks_per_topic(tmp_path, name):
    write_bag(tmp_path / name)
    table = read_table(tmp_path / name)
    assert table.format == "rosbag"
    assert table["/force.vector.x"].tolist() == [0.0, 0.5, 1.0, 1.5, 2.0]
    assert table["/joints.position[0]"].tolist() == [0.0, 0.2, 0.4]
    assert table["/force.header.stamp"].tolist() == [START + k * 1_000_000 for k in range(5)]
    assert table["/force.received"].tolist() == [START + k * 1_000_000 + 300 for k in range(5)]
    assert table.units["/force.received"] == table.units["/force.header.stamp"] == "ns"
    assert table.warnings == ()


def test_the_proposal_for_a_bag_has_channels_of_each_topic_with_its_clock(tmp_path):
    write_bag(tmp_path / "bag", rows=20)
    table = read_table(tmp_path / "bag")
    proposed = propose(table)
    document = tomllib.loads(proposed)
    assert document["time"]["column"] == "/force.received"
    assert "time" not in document["channels"]["force"]
    joints = document["channels"]["joint_position"]
    assert joints["columns"] == ["/joints.position[0]", "/joints.position[1]"]
    assert (joints["time"], joints["resample"]) == ("/joints.received", "?")
    chosen = (
        proposed.replace('resample = "?"', 'resample = "linear"').replace('"?"', "1").replace("unit = 1", 'unit = "1"')
    )
    chosen = chosen.replace("force (N)", "").split("[channels.joint_position]")
    rad, newton = chosen[1].replace('unit = "1"', 'unit = "rad"'), chosen[0].replace('unit = "1"', 'unit = "N"')
    text = f"{newton}[channels.joint_position]{rad}"
    recording = convert(table, parse_mapping(tomllib.loads(text)))
    np.testing.assert_allclose(recording.channels["joint_position"][:4, 0], [np.nan, 0.07, 0.17, 0.27], atol=0.1)


def test_what_a_bag_holds_now_and_then_is_a_remark(tmp_path):
    pytest.importorskip("rosbags", reason="needs the extra hapticeval[ros]")
    from rosbags import rosbag2
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    Joints, Stamp = store.types["sensor_msgs/msg/JointState"], store.types["builtin_interfaces/msg/Time"]
    with rosbag2.Writer(tmp_path / "bag", version=8) as writer:
        joints = writer.add_connection("/joints", Joints.__msgtype__, typestore=store)
        for k in range(5):
            header = store.types["std_msgs/msg/Header"](stamp=Stamp(sec=k, nanosec=0), frame_id="base")
            position, effort = np.array([0.1 * k, 0.2]), np.zeros(k % 2)
            state = Joints(header=header, name=["a", "b"], position=position, velocity=np.empty(0), effort=effort)
            writer.write(joints, k * 10**9, store.serialize_cdr(state, Joints.__msgtype__))
    table = read_table(tmp_path / "bag")
    assert table.warnings == ()
    assert table.remarks == ("'/joints.effort[0]' is not in every message of its topic, and is left out",)


@settings(max_examples=15)
@given(cut=st.floats(0.0, 1.0, exclude_max=True))
def test_a_ros_1_bag_that_is_cut_has_lost_its_index(tmp_path_factory, cut):
    path = tmp_path_factory.mktemp("bag") / "run.bag"
    write_bag(path, rows=100)
    data = path.read_bytes()
    path.write_bytes(data[: int(cut * len(data))])
    with pytest.raises(InputError) as caught:
        read_table(path)
    assert len(path.read_bytes()) < 13 or "rosbag reindex run.bag" in caught.value.todo


def test_a_bag_that_lacks_messages_reports_how_many(tmp_path):
    write_bag(tmp_path / "bag")
    (file,) = (tmp_path / "bag").glob("*.db3")
    with contextlib.closing(sqlite3.connect(file)) as base:
        third = "(SELECT timestamp FROM messages ORDER BY timestamp DESC LIMIT 1 OFFSET 2)"
        base.execute(f"DELETE FROM messages WHERE timestamp > {third}")  # the fifth force and its joints
        base.commit()
    table = read_table(tmp_path / "bag")
    assert table["/force.vector.x"].tolist() == [0.0, 0.5, 1.0, 1.5]
    assert "lacks 1 of the 5 messages of '/force'" in table.warnings[0]


def test_a_bag_that_cannot_be_read_is_refused(refused, tmp_path, monkeypatch):
    pytest.importorskip("rosbags", reason="needs the extra hapticeval[ros]")
    (tmp_path / "bag").mkdir()
    (tmp_path / "bag" / "metadata.yaml").write_text("rosbag2_bagfile_information:\n")
    with refused(InputError):
        read_table(tmp_path / "bag")
    for module in [name for name in sys.modules if name.partition(".")[0] == "rosbags"]:
        monkeypatch.setitem(sys.modules, module, None)
    with refused(HapticevalError) as caught:
        read_table(tmp_path / "bag")
    assert caught.value.todo == install_command("ros")
