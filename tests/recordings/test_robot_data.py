"""Data sets of robots: pictures beside the signals, several trials in a file, Parquet, TDMS, a lone .mcap, .npy."""

import tomllib

import h5py
import numpy as np
import pytest
from scipy.io import savemat
from test_formats_binary import write_bag

from hapticeval.cli import main
from hapticeval.errors import InputError, UnknownNameError
from hapticeval.recordings.formats import Table, read_table
from hapticeval.recordings.formats.trials import trial_of, trials
from hapticeval.recordings.importing.convert import convert
from hapticeval.recordings.importing.mapping import parse_mapping
from hapticeval.recordings.integrity.report import examine
from hapticeval.recordings.recording import Recording

T = 1e-3 * np.arange(120)
HAND = 0.05 * np.column_stack([np.sin(7.0 * T), np.cos(5.0 * T), T])


def test_pictures_beside_the_signals_are_left_out_before_they_take_memory(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["time"], file["position"] = T, HAND
        file.create_dataset("camera", shape=(120, 2000, 2000, 3), dtype=np.uint8, chunks=(1, 2000, 2000, 3))
        file["jacobian"] = np.zeros((120, 3, 2))
    table = read_table(tmp_path / "a.h5")
    assert [name for name in table.columns if "jacobian" not in name] == [
        "position[0]",
        "position[1]",
        "position[2]",
        "time",
    ]
    assert table["jacobian[5]"].size == 120
    assert table.remarks == ("'camera' is 120 x 2000 x 2000 x 3: pictures are not channels, and are left out",)


def demos(path):
    with h5py.File(path, "w") as file:
        for number, rows in enumerate((100, 120, 90)):
            file[f"data/demo_{number}/obs/pos"] = HAND[:rows] + number
            file[f"data/demo_{number}/time"] = T[:rows]


@pytest.mark.parametrize("name", ["data/demo_1", "demo_1", "1"])
def test_a_trial_is_chosen_by_name_or_number(tmp_path, name):
    demos(tmp_path / "a.h5")
    table = read_table(tmp_path / "a.h5")
    assert trials(table) == ["data/demo_0", "data/demo_1", "data/demo_2"]
    trial = trial_of(table, name)
    assert list(trial.columns) == ["obs/pos[0]", "obs/pos[1]", "obs/pos[2]", "time"]
    assert trial["obs/pos[2]"].tolist() == (HAND[:, 2] + 1.0).tolist()


def test_an_unknown_trial_is_refused_with_those_that_there_are(refused, tmp_path):
    demos(tmp_path / "a.h5")
    with refused(UnknownNameError):
        trial_of(read_table(tmp_path / "a.h5"), "demo_7")


def test_trials_are_elements_of_a_structure_or_rows_that_a_column_numbers(tmp_path):
    elements = np.empty((1, 2), dtype=[("t", object), ("x", object)])
    elements[0, 0], elements[0, 1] = (T, HAND[:, 0]), (T, HAND[:, 1])
    savemat(tmp_path / "a.mat", {"trials": elements})
    table = read_table(tmp_path / "a.mat")
    assert trials(table) == ["trials[0]", "trials[1]"]
    assert trial_of(table, "1")["x"].tolist() == HAND[:, 1].tolist()
    numbered = Table({"time": np.tile(T[:40], 3), "episode_index": np.repeat([3, 4, 7], 40), "x": HAND[:, 0]})
    assert trials(numbered) == ["3", "4", "7"]
    assert trial_of(numbered, "4")["x"].tolist() == trial_of(numbered, "1")["x"].tolist() == HAND[40:80, 0].tolist()


def test_signals_of_one_scope_and_one_run_are_no_trials():
    assert trials(Table({"scope.time": T, "scope.signals[0].values": T, "scope.signals[1].values": T})) == []
    assert trials(Table({"t": T, "pos[0]": T, "pos[1]": T, "run": np.arange(120)})) == []


def test_a_trial_goes_from_file_to_recording_by_commands(tmp_path, capsys):
    demos(tmp_path / "a.h5")
    assert main(["inspect", "a.h5"]) == 0
    assert "it holds 3 trials, data/demo_0, data/demo_1, data/demo_2: choose one" in capsys.readouterr().out
    assert main(["inspect", "a.h5", "--trial", "2", "--write-mapping", "m.toml"]) == 0
    text = (tmp_path / "m.toml").read_text()
    assert tomllib.loads(text)["trial"] == "2"
    (tmp_path / "m.toml").write_text(text.replace('unit = "?"', 'unit = "s"', 1).replace('unit = "?"', 'unit = "m"'))
    for arguments, rows in (([], 90), (["--trial", "demo_1"], 120)):
        assert main(["convert", "a.h5", "--mapping", "m.toml", "-o", f"b{rows}.h5", *arguments]) == 0
        assert f"{rows} rows" in capsys.readouterr().out


def test_parquet_has_lists_as_columns_and_times_in_nanoseconds(tmp_path):
    arrow = pytest.importorskip("pyarrow", reason="needs the extra hapticeval[logs]")
    from pyarrow import parquet

    columns = {
        "observation.state": HAND.tolist(),
        "timestamp": T,
        "when": arrow.array((1e9 * T).astype("M8[ns]")),
        "task": ["press"] * 120,
        "ragged": [[0.0] * (1 + k % 2) for k in range(120)],
    }
    parquet.write_table(arrow.table(columns), tmp_path / "a.parquet", row_group_size=50)
    table = read_table(tmp_path / "a.parquet")
    assert table["observation.state[2]"].tolist() == HAND[:, 2].tolist()
    assert dict(table.units) == {"when": "ns"}
    assert table["when"].dtype == np.int64
    assert [remark.partition(",")[0].partition(" has ")[0] for remark in table.remarks] == [
        "'task' is of type string", "'ragged'",
    ]  # fmt: skip
    (tmp_path / "cut.parquet").write_bytes((tmp_path / "a.parquet").read_bytes()[:-300])
    with pytest.raises(InputError, match="cut short or damaged"):
        read_table(tmp_path / "cut.parquet")


def test_tdms_states_units_and_a_step(tmp_path):
    nptdms = pytest.importorskip("nptdms", reason="needs the extra hapticeval[logs]")
    stated = {"unit_string": "mm", "wf_increment": 1e-3, "wf_start_offset": 0.0}
    with nptdms.TdmsWriter(str(tmp_path / "a.tdms")) as writer:
        writer.write_segment([nptdms.ChannelObject("rig", "pos_x", HAND[:, 0], properties=stated)])
    table = read_table(tmp_path / "a.tdms")
    assert table["rig/pos_x"].tolist() == HAND[:, 0].tolist()
    assert table["rig/time"] == pytest.approx(T)
    assert dict(table.units) == {"rig/pos_x": "mm", "rig/time": "s"}


def test_an_mcap_without_its_folder_and_an_npy_are_read(tmp_path):
    write_bag(tmp_path / "bag", storage="MCAP")
    (file,) = (tmp_path / "bag").glob("*.mcap")
    file.rename(tmp_path / "alone.mcap")
    assert read_table(tmp_path / "alone.mcap")["/force.vector.x"].tolist() == [0.0, 0.5, 1.0, 1.5, 2.0]
    np.save(tmp_path / "a.npy", HAND)
    assert read_table(tmp_path / "a.npy")["array[1]"].tolist() == HAND[:, 1].tolist()


def test_equal_stamps_are_named_and_a_stated_rate_takes_their_place(refused, tmp_path):
    (tmp_path / "a.csv").write_text("t,x\n" + "".join(f"{t:.2f},{x:.6f}\n" for t, x in zip(T, HAND[:, 0], strict=True)))
    table = read_table(tmp_path / "a.csv")
    hip = {"columns": ["x"], "unit": "m", "sign": 1}
    with refused(InputError):
        convert(table, parse_mapping({"time": {"column": "t", "unit": "s"}, "channels": {"hip": hip}}))
    made = convert(table, parse_mapping({"time": {"rate": 1000.0}, "channels": {"hip": hip}}))
    assert np.allclose(made.time, T)


def test_what_explains_that_no_column_is_left_is_told(tmp_path):
    np.savez(tmp_path / "a.npz", camera=np.zeros((30, 50, 50)))
    with pytest.raises(InputError) as caught:
        read_table(tmp_path / "a.npz")
    assert "'camera' is 30 x 50 x 50: pictures" in caught.value.why


def test_a_recording_without_a_sound_row_is_examined():
    channels = {"hip": HAND, "force": np.full((120, 3), np.nan)}
    report = examine(Recording(T, channels, valid=np.zeros(120, dtype=bool)))
    assert [(issue.kind, issue.channel) for issue in report.issues] == [("no number", "force")]
