"""Binary formats: MATLAB 5 and 7.3, HDF5, NPZ, ROS bags."""

from __future__ import annotations

import builtins
import contextlib
import re
import sqlite3
import struct

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.io import savemat

from hapticeval.errors import HapticevalError, InputError
from hapticeval.recordings.formats import Table, read_table
from hapticeval.recordings.importing.convert import convert
from hapticeval.recordings.importing.mapping import parse_mapping, propose

T = np.arange(12) * 0.5e-3
POSITIONS = np.column_stack([np.arange(12.0), -np.arange(12.0)])


def scope():
    """As Simulink's `Structure With Time` saves a scope with two inputs."""
    signals = np.empty((1, 2), dtype=[("values", object), ("dimensions", object), ("label", object)])
    signals[0, 0] = (POSITIONS, 2, "Lever positions (rad)")
    signals[0, 1] = (np.arange(12.0)[:, None] + 0.5, 1, "")
    return {"time": T[:, None], "signals": signals, "blockName": "rig/Scope"}


@pytest.mark.parametrize("compressed", [True, False])
def test_a_structure_with_time_becomes_columns(tmp_path, compressed):
    path = tmp_path / "a.mat"
    savemat(path, {"scope": scope(), "Ts": 5e-4, "name": "rig"}, do_compression=compressed)
    table = read_table(path)
    assert table.format == "matlab5"
    assert list(table.columns) == [
        "scope.time",
        "scope.signals[0].values[0]",
        "scope.signals[0].values[1]",
        "scope.signals[1].values",
    ]
    assert table["scope.signals[0].values[1]"].tolist() == POSITIONS[:, 1].tolist()
    assert table.notes["scope.signals[0].values[0]"] == "label: Lever positions (rad)"
    assert (table.attributes["Ts"], table.attributes["name"]) == (5e-4, "rig")
    assert dict(table.units) == {}


def test_a_timeseries_saved_as_a_structure_and_matrices_along_the_last_axis(tmp_path):
    path = tmp_path / "a.mat"
    wide = np.arange(48.0).reshape(2, 2, 12)
    savemat(path, {"ts": {"Time": T, "Data": wide, "Name": "hip"}})
    table = read_table(path)
    assert table["ts.Time"].tolist() == T.tolist()
    assert table["ts.Data[1]"].tolist() == wide[0, 1].tolist()


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
    with pytest.raises(InputError, match="is cut short or damaged") as caught:
        read_table(path, format=save.partition("-")[0])
    assert "copy it again" in caught.value.todo
    assert re.search(r"\d|index", caught.value.why), caught.value.why


def _borders(data):
    place, borders = 128, set()
    while place < len(data):
        place += 8 + struct.unpack("<I", data[place + 4 : place + 8])[0]
        borders.add(place)
    return borders


def opaque(name: str, kind: str) -> bytes:
    """A MATLAB object as a MAT-file holds it: flags of class 17, then name, system and class, each a text element."""

    def text(word):
        return struct.pack("<II", 1, len(word)) + word.encode() + bytes(-len(word) % 8)

    body = struct.pack("<IIII", 6, 8, 17, 0) + text(name) + text("MCOS") + text(kind)
    return struct.pack("<II", 14, len(body)) + body


def test_an_object_that_only_matlab_reads_is_named_and_the_rest_is_read(tmp_path):
    path = tmp_path / "a.mat"
    savemat(path, {"before": np.arange(12.0)}, do_compression=False)
    path.write_bytes(path.read_bytes() + opaque("position_log", "timeseries") + opaque("plant_model", "ss"))
    table = read_table(path)
    assert list(table.columns) == ["before"]
    assert "position_log (timeseries), plant_model (ss)" in table.remarks[0]


def mat73(path):
    with h5py.File(path, "w", userblock_size=512) as file:

        def put(group, name, values, kind="double"):
            dataset = group.create_dataset(name, data=values)
            dataset.attrs["MATLAB_class"] = np.bytes_(kind)
            return dataset

        refs = file.create_group("#refs#")
        scope = file.create_group("scope")
        scope.attrs["MATLAB_class"] = np.bytes_("struct")
        put(scope, "time", T[None, :])
        signals = scope.create_group("signals")
        signals.attrs["MATLAB_class"] = np.bytes_("struct")
        references = np.array(
            [[put(refs, "a", POSITIONS.T).ref], [put(refs, "b", np.arange(12.0)[None, :]).ref]], dtype=h5py.ref_dtype
        )
        signals.create_dataset("values", data=references, dtype=h5py.ref_dtype)
        text = np.array([[ord(letter)] for letter in "Lever positions (rad)"], dtype=np.uint16)
        labels = np.array(
            [[put(refs, "c", text, "char").ref], [put(refs, "d", text[:5], "char").ref]], dtype=h5py.ref_dtype
        )
        signals.create_dataset("label", data=labels, dtype=h5py.ref_dtype)
        put(file, "Ts", np.array([[5e-4]]))
        odd = put(file, "ts", np.zeros((1, 6), dtype=np.uint32), "timeseries")
        odd.attrs["MATLAB_object_decode"] = 3
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")


def test_a_73_file_has_the_column_names_of_a_5_file(tmp_path):
    path = tmp_path / "a.mat"
    mat73(path)
    table = read_table(path)
    assert table.format == "matlab73"
    assert table["scope.signals[0].values[1]"].tolist() == POSITIONS[:, 1].tolist()
    assert table["scope.signals[1].values"].tolist() == list(range(12))
    assert table.notes["scope.signals[0].values[0]"] == "label: Lever positions (rad)"
    assert table.attributes["Ts"] == 5e-4
    assert "ts (timeseries)" in table.remarks[0]


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


def write_bag(folder):
    pytest.importorskip("rosbags", reason="needs the extra hapticeval[ros]")
    from rosbags.rosbag2 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    kinds = store.types
    Stamp, Header = kinds["builtin_interfaces/msg/Time"], kinds["std_msgs/msg/Header"]
    Vector, Wrench = kinds["geometry_msgs/msg/Vector3"], kinds["geometry_msgs/msg/Wrench"]
    Stamped, Joints = kinds["geometry_msgs/msg/WrenchStamped"], kinds["sensor_msgs/msg/JointState"]
    with Writer(folder, version=8) as writer:
        force = writer.add_connection("/wrench", Stamped.__msgtype__, typestore=store)
        joints = writer.add_connection("/joints", Joints.__msgtype__, typestore=store)
        for k in range(5):
            when = 1_700_000_000_000_000_000 + k * 1_000_000
            header = Header(stamp=Stamp(sec=when // 10**9, nanosec=when % 10**9), frame_id="base")
            zero = Vector(x=0.0, y=0.0, z=0.0)
            wrench = Stamped(header=header, wrench=Wrench(force=Vector(x=1.0 * k, y=0.0, z=-1.0), torque=zero))
            writer.write(force, when + 300, store.serialize_cdr(wrench, Stamped.__msgtype__))
            if k % 2 == 0:
                state = Joints(
                    header=header,
                    name=["a", "b"],
                    position=np.array([0.1 * k, 0.2]),
                    velocity=np.empty(0),
                    effort=np.empty(0),
                )
                writer.write(joints, when + 500, store.serialize_cdr(state, Joints.__msgtype__))


def test_a_ros_bag_has_columns_and_clocks_a_topic(tmp_path):
    write_bag(tmp_path / "bag")
    table = read_table(tmp_path / "bag")
    assert table.format == "rosbag"
    assert table["/wrench.wrench.force.x"].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert table["/joints.position[0]"].tolist() == [0.0, 0.2, 0.4]
    start = 1_700_000_000_000_000_000
    assert table["/wrench.header.stamp"].tolist() == [start + k * 1_000_000 for k in range(5)]
    assert table["/wrench.received"].tolist() == [start + k * 1_000_000 + 300 for k in range(5)]
    assert table.units["/wrench.received"] == "ns"


def write_bag1(path, rows=5):
    pytest.importorskip("rosbags", reason="needs the extra hapticeval[ros]")
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    kinds = store.types
    Time, Header = kinds["builtin_interfaces/msg/Time"], kinds["std_msgs/msg/Header"]
    Vector, Stamped = kinds["geometry_msgs/msg/Vector3"], kinds["geometry_msgs/msg/Vector3Stamped"]
    with Writer(path) as writer:
        force = writer.add_connection("/force", Stamped.__msgtype__, typestore=store)
        for k in range(rows):
            when = 1_700_000_000_999_000_000 + k * 1_000_000
            header = Header(seq=k, stamp=Time(sec=when // 10**9, nanosec=when % 10**9), frame_id="base")
            message = Stamped(header=header, vector=Vector(x=0.5 * k, y=0.0, z=-1.0))
            writer.write(force, when + 300, store.serialize_ros1(message, Stamped.__msgtype__))


def test_a_ros_1_bag_has_the_same_columns(tmp_path):
    write_bag1(tmp_path / "run.bag")
    table = read_table(tmp_path / "run.bag")
    assert table.format == "rosbag"
    assert table["/force.vector.x"].tolist() == [0.0, 0.5, 1.0, 1.5, 2.0]
    assert table["/force.header.seq"].tolist() == list(range(5))
    start = 1_700_000_000_999_000_000
    assert table["/force.header.stamp"].tolist() == [start + k * 1_000_000 for k in range(5)]
    assert table["/force.received"].tolist() == [start + k * 1_000_000 + 300 for k in range(5)]
    assert table.units["/force.header.stamp"] == "ns"
    assert table.warnings == ()


@settings(max_examples=15)
@given(cut=st.floats(0.0, 1.0, exclude_max=True))
def test_a_ros_1_bag_that_is_cut_says_that_its_index_is_lost(tmp_path_factory, cut):
    path = tmp_path_factory.mktemp("bag") / "run.bag"
    write_bag1(path, rows=100)
    data = path.read_bytes()
    path.write_bytes(data[: int(cut * len(data))])
    with pytest.raises(InputError) as caught:
        read_table(path)
    assert len(path.read_bytes()) < 13 or "rosbag reindex run.bag" in caught.value.todo


def test_a_bag_that_lacks_messages_says_how_many(tmp_path):
    write_bag(tmp_path / "bag")
    (file,) = (tmp_path / "bag").glob("*.db3")
    with contextlib.closing(sqlite3.connect(file)) as base:
        last = (
            "(SELECT timestamp FROM messages ORDER BY timestamp DESC LIMIT 1 OFFSET 2)"  # the fifth wrench and joints
        )
        base.execute(f"DELETE FROM messages WHERE timestamp > {last}")
        base.commit()
    table = read_table(tmp_path / "bag")
    assert table["/wrench.wrench.force.x"].tolist() == [0.0, 1.0, 2.0, 3.0]
    assert "lacks 1 of the 5 messages of '/wrench'" in table.warnings[0]


def test_a_bag_without_the_extra_says_what_to_install(tmp_path, monkeypatch):
    (tmp_path / "bag").mkdir()
    (tmp_path / "bag" / "metadata.yaml").write_text("rosbag2_bagfile_information:\n")
    real = builtins.__import__

    def refuse(name, *rest, **more):
        if name.startswith("rosbags"):
            raise ImportError("No module named 'rosbags'")
        return real(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", refuse)
    with pytest.raises(HapticevalError, match=r"hapticeval\[ros\]"):
        read_table(tmp_path / "bag")


def test_a_bag_that_is_no_bag_says_so(tmp_path):
    pytest.importorskip("rosbags", reason="needs the extra hapticeval[ros]")
    (tmp_path / "bag").mkdir()
    (tmp_path / "bag" / "metadata.yaml").write_text("rosbag2_bagfile_information:\n")
    with pytest.raises(InputError, match="cannot be read as a ROS bag"):
        read_table(tmp_path / "bag")


def test_two_topics_are_never_put_on_one_clock_by_their_number_of_messages(tmp_path):
    columns = {"/a.received": np.arange(5) * 1_000_000, "/a.x": np.arange(5.0)}
    columns |= {"/b.received": np.arange(5) * 1_300_000 + 7, "/b.f": 10.0 * np.arange(5.0)}
    table = Table(
        columns, units={"/a.received": "ns", "/b.received": "ns"}, topics={name: name[:2] for name in columns}
    )
    assert '"/b.f"' not in propose(table).partition("# Columns that no channel")[0]

    def mapping(**more):
        channel = {"columns": ["/b.f"], "unit": "N", "sign": 1, **more}
        hip = {"columns": ["/a.x"], "unit": "mm", "sign": 1}
        time = {"column": "/a.received", "unit": "ns"}
        return parse_mapping({"time": time, "channels": {"hip": hip, "force": channel}})

    with pytest.raises(InputError, match=r"'/b\.f' is not on the clock of the time '/a\.received'") as caught:
        convert(table, mapping())
    assert "as many rows are not the same times" in caught.value.why
    with pytest.raises(InputError, match=r"the clock '/a\.received' of 'force' is not that of its column"):
        convert(table, mapping(time="/a.received", resample="hold"))
    held = convert(table, mapping(time="/b.received", resample="hold"))
    assert held.force[1:4, 0].tolist() == [0.0, 10.0, 20.0]
    assert held.valid.tolist() == [False, True, True, True, True]


def test_signals_in_rows_beside_a_time_vector_are_turned(tmp_path):
    path = tmp_path / "a.mat"
    savemat(path, {"log": {"time": np.arange(30.0), "data": np.arange(390.0).reshape(13, 30)}})
    table = read_table(path)
    assert table["log.data[12]"].tolist() == list(range(360, 390))
    assert "13 x 30: its 13 rows are taken for the signals" in table.remarks[0]
