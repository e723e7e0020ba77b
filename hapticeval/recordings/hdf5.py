"""Recordings as HDF5 files, checksummed throughout, so that a damaged file is never read as a run.

Every dataset carries the fletcher32 filter, and the 1.10 file format checksums what lies between them: names,
units, shapes. Texts are of fixed length: those of variable length lie in a heap that has no checksum, where one
wrong byte can keep the HDF5 library reading for ever. A file holds

    /                attributes `format` = "hapticeval recording", `format_version` = 1
    /time            (n,) float64, attribute `unit` = "s"
    /<channel>       (n, N) float64, attribute `unit`: one dataset a channel of `Recording`
    /meta            (m,) uint8: `Recording.meta` as JSON in UTF-8
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from hapticeval.errors import HapticevalError, InputError
from hapticeval.files import plain, replacing
from hapticeval.recordings.recording import CHANNELS, REQUIRED, Recording

FORMAT = "hapticeval recording"
FORMAT_VERSION = 1
SIGNATURE = b"\x89HDF\r\n\x1a\n"
ROWS_A_CHUNK = 8192


def write_recording(path: Path, recording: Recording) -> None:
    """Write a recording so that it reads back bit for bit; the file is replaced whole or not at all.

    The same recording gives the same bytes. Raises `InputError`, naming the key, for a `meta` that JSON cannot
    hold, and `HapticevalError` where the file cannot be written.
    """
    import h5py

    try:
        meta = json.dumps(plain(recording.meta, "meta"), allow_nan=False, sort_keys=True)
    except ValueError as error:
        raise InputError(f"the meta of a recording holds a number that is not finite: {error}") from error
    try:
        with replacing(Path(path)) as temporary, h5py.File(temporary, "w", libver=("v110", "v110")) as file:
            file.attrs["format"] = np.bytes_(FORMAT)
            file.attrs["format_version"] = FORMAT_VERSION
            _write(file, "time", recording.time, unit="s")
            for name, values in recording.channels.items():
                _write(file, name, values, unit=CHANNELS[name][0])
            _write(file, "meta", np.frombuffer(meta.encode(), dtype=np.uint8))
    except OSError as error:
        raise HapticevalError(f"cannot write the recording {path}", why=str(error)) from error


def _write(file: Any, name: str, values: Any, *, unit: str | None = None) -> None:
    dataset = file.create_dataset(
        name,
        data=values,
        chunks=(min(len(values), ROWS_A_CHUNK), *values.shape[1:]),
        compression="gzip",
        compression_opts=4,
        shuffle=True,
        fletcher32=True,
        track_times=False,
    )
    if unit is not None:
        dataset.attrs["unit"] = np.bytes_(unit)


def read_recording(path: Path) -> Recording:
    """Read a recording that `write_recording` wrote.

    Raises `InputError` that says which: the file is missing, is no HDF5 file, is cut short or damaged, is
    someone else's HDF5 file, was written by a newer format, or holds a channel in a unit other than ours.
    """
    import h5py

    path = Path(path)
    try:
        with path.open("rb") as opened:
            signature = opened.read(len(SIGNATURE))
    except OSError as error:
        raise InputError(
            f"cannot read the recording {path}", why=error.strerror or str(error), todo="check the path"
        ) from error
    if signature != SIGNATURE:
        raise InputError(
            f"{path} is not an HDF5 file" if signature else f"{path} is empty",
            why="a recording starts with the HDF5 signature",
            todo="give a recording that hapticeval wrote",
        )
    try:
        with h5py.File(path, "r") as file:
            _check_format(path, file)
            time = _read(path, file, "time", "s")
            names = [name for name in CHANNELS if name in file]
            missing = [name for name in REQUIRED if name not in file]
            if missing:
                raise _damaged(path, f"it has no channel '{missing[0]}'")
            channels = {name: _read(path, file, name, CHANNELS[name][0]) for name in names}
            meta = json.loads(bytes(file["meta"][:]).decode())
    except HapticevalError:
        raise
    # h5py speaks of one and the same damage in all of these, by where it strikes
    except (OSError, KeyError, RuntimeError, ValueError, TypeError, AttributeError, OverflowError) as error:
        raise _damaged(path, str(error)) from error
    return Recording(time, channels, meta)


def _check_format(path: Path, file: Any) -> None:
    if _text(file, "format") != FORMAT:
        raise InputError(
            f"{path} is an HDF5 file, but not a hapticeval recording",
            why=f"it lacks the attribute format = '{FORMAT}'; it holds: {', '.join(file) or 'nothing'}",
            todo="give a recording that hapticeval wrote",
        )
    version = int(file.attrs["format_version"])
    if version != FORMAT_VERSION:
        raise InputError(
            f"{path} has recording format {version}; this hapticeval reads format {FORMAT_VERSION}",
            why="a newer hapticeval wrote it" if version > FORMAT_VERSION else "no such format was released",
            todo="update hapticeval" if version > FORMAT_VERSION else "record it again",
        )


def _read(path: Path, file: Any, name: str, unit: str) -> Any:
    dataset = file[name]
    if _text(dataset, "unit") != unit:
        raise InputError(
            f"{path}: '{name}' is in {_text(dataset, 'unit')!r}, not in {unit!r}",
            why="recordings are in SI units",
            todo="write the file with hapticeval",
        )
    if dataset.dtype != np.float64:
        raise _damaged(path, f"'{name}' is of type {dataset.dtype}, not float64")
    return dataset[()]


def _text(holder: Any, name: str) -> str | None:
    value = holder.attrs.get(name)
    return value.decode() if isinstance(value, bytes) else value


def _damaged(path: Path, why: str) -> InputError:
    return InputError(f"the recording {path} is cut short or damaged", why=why, todo="run or copy the recording again")
