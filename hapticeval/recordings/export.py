"""Recordings as files for other programs: .mat, .csv, .npz, and our own .h5, by the name's ending."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from hapticeval.errors import HapticevalError, InputError, UnknownNameError
from hapticeval.files import creating, plain
from hapticeval.recordings.hdf5 import write_recording
from hapticeval.recordings.recording import Recording
from hapticeval.types import Array

AXES = "xyz"
LONGEST_NAME = 31
"""Names in MATLAB 5 files end here."""


def export(path: Path | str, recording: Recording) -> Path:
    """Write a recording as the ending of `path` says; each column states its unit.

    Only .h5 keeps everything; the others keep the stamps, the channels, which rows are valid, and the meta as JSON
    where they have a place for it. Raises `InputError` where the file is there already, `UnknownNameError` for another
    ending, and `HapticevalError` where it cannot be written.
    """
    path = Path(path)
    write = WRITERS.get(path.suffix.lower())
    if write is None:
        raise UnknownNameError("file ending", path.suffix, WRITERS)
    refuse_existing(path)
    if write is write_recording:
        write(path, recording)  # which itself gives the file whole or not at all
        return path
    try:
        with creating(path) as temporary:
            write(temporary, recording)
    except OSError as error:
        raise HapticevalError(f"cannot write {path}", why=error.strerror or str(error)) from error
    return path


def refuse_existing(path: Path) -> None:
    """Raise `InputError` where something stands at `path`: a recording is never written over."""
    if path.exists() or path.is_symlink():
        raise InputError(
            f"{path} is there already",
            why="nothing is written over a recording",
            todo="choose another name, or move it",
        )


def _columns(recording: Recording) -> dict[str, tuple[Array, str]]:
    """Every column by name, with its unit: `hip.x`, `joint_torque.0`, `grip`."""
    found: dict[str, tuple[Array, str]] = {"time": (recording.time, "s")}
    for name, values in recording.channels.items():
        signal = recording.signals[name]
        if values.ndim == 1:
            found[name] = (values, signal.unit)
        else:
            parts = AXES if signal.frame == "world" else [str(k) for k in range(values.shape[1])]
            found |= {f"{name}.{parts[k]}": (values[:, k], signal.unit) for k in range(values.shape[1])}
    if recording.valid is not None:
        found["valid"] = (recording.valid.astype(np.float64), "1")
    return found


def _meta(recording: Recording) -> str:
    return json.dumps(plain(recording.meta, "meta"), sort_keys=True)


def _csv(path: Path, recording: Recording) -> None:
    columns = _columns(recording)
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write(",".join(f"{name} [{unit}]" for name, (_, unit) in columns.items()) + "\n")
        for row in zip(*(values.tolist() for values, _ in columns.values()), strict=True):
            file.write(",".join(map(repr, row)) + "\n")


def _npz(path: Path, recording: Recording) -> None:
    arrays: dict[str, Any] = {"hapticeval": np.array(_meta(recording))}
    for name, (values, unit) in _columns(recording).items():
        arrays[name] = values
        arrays[f"unit:{name}"] = np.array(unit)
    with path.open("wb") as file:
        np.savez_compressed(file, **arrays)


def _mat(path: Path, recording: Recording) -> None:
    """A structure `recording` with `time`, a field a channel, `units` of the same fields, and `meta` as JSON."""
    from scipy.io import savemat

    for name in recording.channels:
        if len(name) > LONGEST_NAME or not name.replace("_", "").isalnum():
            raise InputError(
                f"the channel '{name}' cannot be a field of a MATLAB structure",
                why=f"fields have letters, digits and '_', {LONGEST_NAME} at the most",
                todo="write .h5, .npz or .csv",
            )
    fields: dict[str, Any] = {"time": recording.time[:, None], **recording.channels}
    if recording.valid is not None:
        fields["valid"] = recording.valid.astype(np.uint8)[:, None]
    units = {"time": "s", **{name: recording.signals[name].unit for name in recording.channels}}
    with path.open("wb") as file:
        stream: Any = file
        savemat(
            stream,
            {"recording": fields, "units": units, "hapticeval": _meta(recording)},
            do_compression=True,
            oned_as="column",
        )


WRITERS: Mapping[str, Callable[[Path, Recording], None]] = {
    ".h5": write_recording,
    ".hdf5": write_recording,
    ".mat": _mat,
    ".csv": _csv,
    ".npz": _npz,
}
"""How each ending is written."""
