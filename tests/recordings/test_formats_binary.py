"""Binary formats: MATLAB 5 and 7.3, HDF5, NPZ, ROS bags."""

from __future__ import annotations

import builtins
import contextlib
import sqlite3
import struct

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.io import savemat

from hapticeval.errors import HapticevalError, InputError
from hapticeval.recordings.formats import read_table

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


@pytest.mark.parametrize("compressed", [True, False])
@settings(max_examples=30)
@given(cut=st.floats(0.01, 0.99))
def test_a_cut_mat_file_gives_the_variables_that_are_whole(tmp_path_factory, compressed, cut):
    path = tmp_path_factory.mktemp("mat") / "a.mat"
    values = {f"v{k}": np.random.default_rng(k).normal(size=50) for k in range(6)}
    savemat(path, values, do_compression=compressed)
    data = path.read_bytes()
    path.write_bytes(data[: 128 + round(cut * (len(data) - 128))])
    first = min(_borders(data))
    if len(path.read_bytes()) < first:
        with pytest.raises(InputError, match="within the variable"):
            read_table(path)
        return
    table = read_table(path)
    assert all(np.array_equal(table[name], values[name]) for name in table.columns)
    left_out = next(name for name in values if name not in table.columns)
    ended_between = len(path.read_bytes()) in _borders(data)
    assert ended_between or f"'{left_out}'" in table.warnings[-1] or "'?'" in table.warnings[-1]


def test_a_cut_mat_file_says_how_much_of_which_variable_is_missing(tmp_path):
    path = tmp_path / "a.mat"
    savemat(path, {"t": 0.5 * np.arange(50.0)[:, None], "force": np.ones((50, 2))})
    path.write_bytes(path.read_bytes()[:-300])
    table = read_table(path)
    assert list(table.columns) == ["t"]
    assert "within the variable 'force', which is left out with all that followed: 50 x 2" in table.warnings[0]
    assert "556 of its 856 bytes are there" in table.warnings[0]
    assert (
        "of the 50 rows of 'force[0]', 'force[1]' none is there: 50 rows (25 in the unit of its clock)"
        in table.warnings[0]
    )


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
def test_a_cut_archive_gives_the_rows_before_the_cut_and_says_that_no_checksum_covers_them(tmp_path, save):
    path = tmp_path / "a.npz"
    values = np.random.default_rng(0).normal(size=(5000, 2))
    save(path, x=values)
    path.write_bytes(path.read_bytes()[:20000])
    table = read_table(path)
    rows = table.rows("x[0]")
    assert 1200 < rows < 1400
    assert np.array_equal(np.column_stack([table["x[0]"], table["x[1]"]]), values[:rows])
    assert f"of the 5000 rows of 'x[0]', 'x[1]' {rows} are there: {5000 - rows} rows missing" in table.warnings[0]
    assert f"{rows} whole rows are given, which no checksum covers any more" in table.warnings[1]


def test_a_cut_archive_without_a_whole_row_gives_nothing_and_says_so(tmp_path):
    path = tmp_path / "a.npz"
    np.savez(path, x=np.asfortranarray(np.random.default_rng(0).normal(size=(5000, 2))))
    path.write_bytes(path.read_bytes()[:20000])
    with pytest.raises(InputError, match="cut short or damaged") as caught:
        read_table(path)
    assert "of the 5000 rows of 'x[0]', 'x[1]' none is there: 5000 rows missing" in caught.value.why


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
    assert (table.warnings, dict(table.promised)) == ((), {})


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
    assert not table.promised  # nothing says that it was the last one
    assert table["/wrench.wrench.force.x"].tolist() == [0.0, 1.0, 2.0, 3.0]
    assert "of the 5 rows of '/wrench.received'" in table.warnings[0]
    assert "4 are there: 1 row (1e+06 ns) missing" in table.warnings[0]


def test_a_bag_that_breaks_off_says_how_many_messages_follow(tmp_path, monkeypatch):
    write_bag(tmp_path / "bag")
    from rosbags.highlevel import AnyReader

    whole = AnyReader.messages

    def breaking(reader):
        for number, message in enumerate(whole(reader)):
            if number == 5:  # two of /joints and three of /wrench have come
                raise RuntimeError("database disk image is malformed")
            yield message

    monkeypatch.setattr(AnyReader, "messages", breaking)
    table = read_table(tmp_path / "bag")
    assert (table.rows("/wrench.received"), table.promised["/wrench.received"]) == (3, 5)
    assert (table.rows("/joints.received"), table.promised["/joints.received"]) == (2, 3)
    assert "the bag breaks off after 5 messages" in table.warnings[1]


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
