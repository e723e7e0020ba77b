"""Logs of encoders and motors: what the hand did, against the recording that they come from."""

from __future__ import annotations

import numpy as np
import pytest
from robots import recorded, twin_of, wired

from hapticeval.cli import main
from hapticeval.errors import HapticevalError
from hapticeval.hardware.wiring import OUTSIDE_WORKSPACE, at_the_hand
from hapticeval.recordings.importing.convert import load
from hapticeval.recordings.recording import Recording

CYCLES = 400
TURNED = {"torque_per_command": 0.35}


def logged(folder, run, wiring, *, angles=False, gap=False):
    """A rig's own log of a run: a text with its time, encoders and motors, and the mapping that goes with it."""
    size = wiring.device.dimension
    raw = np.rad2deg(run.channels["joint_position"]) if angles else run.channels["raw"]
    columns = [run.time * 1e3, *raw.T, *wiring.commands(run.channels["joint_torque"]).T]
    names = ["t", *(f"e{k}" for k in range(size)), *(f"u{k}" for k in range(size))]
    rows = [",".join(f"{value:.17g}" for value in row) for row in np.column_stack(columns)]
    if gap:
        rows[100] = rows[100].split(",")[0] + "," + ",".join([""] * (2 * size))
    (folder / "log.csv").write_text("\n".join([",".join(names), *rows]) + "\n")
    channel = ("joint_position", "deg") if angles else ("raw", "counts")
    device = wiring.description()
    table = "\n".join(f"{key} = {value!r}".replace("'", '"') for key, value in device.items())
    (folder / "rig.toml").write_text(
        f'[time]\ncolumn = "t"\nunit = "ms"\n'
        f'[channels.{channel[0]}]\ncolumns = {names[1 : size + 1]}\nunit = "{channel[1]}"\nsign = 1\n'
        f'[channels.command]\ncolumns = {names[size + 1 :]}\nunit = "V"\nsign = 1\n'
        f"[device]\n{table}\n"
    )
    return folder / "log.csv", folder / "rig.toml"


@pytest.mark.parametrize("angles", [False, True], ids=["counts", "degrees"])
@pytest.mark.parametrize(
    "wiring",
    [
        wired(2),
        wired(2, offsets=(1210.0, -340.0), directions=(-1, 1), **TURNED),
        wired(3, offsets=(5.0, -70_000.0, 12.0), directions=(1, -1, -1), **TURNED),
    ],
    ids=["straight", "turned", "3-dof"],
)
def test_a_log_is_the_run_that_it_was_taken_from(tmp_path, wiring, angles):
    _, run = recorded(tmp_path, twin_of(wiring), wiring, cycles=CYCLES)
    log, mapping = logged(tmp_path, run, wiring, angles=angles)
    made = at_the_hand(load(log, mapping=mapping))
    assert np.any(run.force != 0.0)
    # Degrees with 17 digits are angles to rounding; counts are exact. A difference over a tick of 1 ms makes 1e3 of it.
    np.testing.assert_allclose(made.hip, run.hip, rtol=0.0, atol=1e-14)
    np.testing.assert_allclose(made.velocity, run.velocity, rtol=0.0, atol=1e-10)
    np.testing.assert_allclose(made.channels["joint_torque"], run.channels["joint_torque"], rtol=1e-14)
    # Within the workspace the Jacobian's condition is under 100.
    np.testing.assert_allclose(made.force, run.force, rtol=0.0, atol=1e-12 * np.abs(run.force).max() * 100)
    assert made.signals["force"].sign.startswith("static")


@pytest.mark.system
@pytest.mark.usefixtures("in_process")
def test_the_command_converts_a_log_that_can_be_replayed(undrawn, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    wiring = wired(2, offsets=(1210.0, -340.0), directions=(-1, 1), **TURNED)
    _, run = recorded(tmp_path, twin_of(wiring), wiring, cycles=1200)
    logged(tmp_path, run, wiring)
    assert main(["convert", "log.csv", "--mapping", "rig.toml", "-o", "log.h5"]) == 0
    assert main(["inspect", "log.h5"]) == 0, capsys.readouterr().out
    assert main(["inspect", "log.csv", "--mapping", "rig.toml", "--model", "circle:size=0.2"]) == 0
    replayed = ["replay", "log.h5", "-r", "minimum-distance+pp-pd", "--model", "circle:size=0.2", "-o", "out"]
    assert main([*replayed, "--scene", "stiffness=300", "--scene", "damping=1"]) in (0, 1)
    assert "force" in capsys.readouterr().out


def test_rows_without_a_number_are_left_out_and_bridged(tmp_path):
    wiring = wired()
    _, run = recorded(tmp_path, twin_of(wiring), wiring, cycles=CYCLES)
    log, mapping = logged(tmp_path, run, wiring, gap=True)
    made = at_the_hand(load(log, mapping=mapping))
    assert np.flatnonzero(~made.valid).tolist() == [100]
    keep = made.valid
    np.testing.assert_allclose(made.hip[keep], run.hip[keep], rtol=0.0, atol=1e-14)
    speed = np.linalg.norm(made.velocity[keep] - run.velocity[keep], axis=1)
    assert speed[:100].max() < 1e-10
    # After a gap the filter has taken two ticks in one, which fades with its time constant of 1.6 ticks.
    assert speed[120:].max() < 1e-4


def test_a_row_outside_is_marked(tmp_path):
    wiring = wired()
    _, run = recorded(tmp_path, twin_of(wiring), wiring, cycles=50)
    raw = np.array(run.channels["raw"])
    raw[20] = (80_000.0, 0.0)
    made = at_the_hand(Recording(run.time, {"raw": raw}, run.meta, signals={"raw": run.signals["raw"]}))
    assert np.flatnonzero(~made.valid).tolist() == [20]
    assert made.meta["import"]["left out"] == {OUTSIDE_WORKSPACE: 1}
    assert "force" not in made.channels
    assert at_the_hand(run) is run  # which has a HIP


@pytest.mark.parametrize(
    "change",
    [
        ("kind = \"parallelogram-2dof\"", "kind = \"parallelogram-3dof\""),
        ("l1 = 0.3\n", "l9 = 0.3\n"),
        ("directions = [1, 1]", "directions = [1, 0]"),
        ("counts_per_turn = 262144\n", ""),
        ("offsets = [0.0, 0.0]", "offsets = [80000.0, 0.0]"),
    ],
)  # fmt: skip
def test_a_device_that_does_not_fit_says_so(refused, tmp_path, change):
    wiring = wired()
    _, run = recorded(tmp_path, twin_of(wiring), wiring, cycles=50)
    log, mapping = logged(tmp_path, run, wiring)
    text = mapping.read_text()
    assert change[0] in text
    mapping.write_text(text.replace(*change))
    with refused(HapticevalError):
        at_the_hand(load(log, mapping=mapping))
