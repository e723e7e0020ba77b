"""A file of any kind as a recording: ours, the journal of a recorder, or a foreign one through its mapping."""

from __future__ import annotations

from pathlib import Path

from hapticeval.errors import InputError
from hapticeval.recordings.conversion import is_recording, load_recording
from hapticeval.recordings.formats.registry import first_bytes
from hapticeval.recordings.hdf5 import DamagedError
from hapticeval.recordings.journal import MAGIC, MARK
from hapticeval.recordings.recording import Recording


def load(
    path: Path | str, *, mapping: Path | str | None = None, format: str | None = None, salvaging: bool = False
) -> Recording:
    """The recording in a file.

    A journal gives what is whole of it. So does one of our files that is cut short or damaged where `salvaging` is
    asked for; otherwise it is an error. Either way the recording's events of kind `lost` say what is missing.
    Raises `InputError` for a mapping of a file that needs none, and as `recover`, `read_recording`, `salvage` and
    `load_recording` do.
    """
    path = Path(path)
    if not is_ours(path):
        return load_recording(path, mapping=mapping, format=format)
    if mapping is not None:
        raise InputError(f"{path} is a recording already", why="it needs no mapping", todo="leave --mapping out")
    if is_journal(path):
        from hapticeval.recordings.recovery import recover

        return recover(path).recording
    try:
        return load_recording(path)
    except DamagedError:
        if not salvaging:
            raise
        from hapticeval.recordings.salvage import salvage

        return salvage(path).recording


def is_ours(path: Path | str) -> bool:
    """Whether a file is a recording or a journal that hapticeval wrote, and so says itself what is in it.

    Raises `InputError` where it is missing or empty.
    """
    return is_journal(Path(path)) or is_recording(Path(path))


def is_journal(path: Path) -> bool:
    """Whether a file begins as journals do, or its first block does: one wrong byte hides no journal.

    Raises `InputError` where it is missing or empty.
    """
    head = first_bytes(path)
    return head.startswith(MAGIC) or head[len(MAGIC) :].startswith(MARK)
