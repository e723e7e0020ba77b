"""The folder that a command writes into: made, or recognised as one of ours, and locked meanwhile."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from hapticeval.errors import InputError

try:
    import fcntl
except ImportError:  # not on Windows
    fcntl = None  # type: ignore[assignment]

DOCUMENTS = {
    "results.json": {"planned", "verdicts"},
    "bench.json": {"settings", "references"},
}
"""What hapticeval leaves in a folder, and entries by which it is recognised, of whatever version."""

LOCK = "run.lock"
"""The file that locks a folder where the system cannot lock the folder itself; it holds the process that writes."""

REPORTS = ("table.md", "junit.xml", "report.html", "report", "tables")
"""What reports leave in a folder: the next run there removes them."""

COUNTEREXAMPLES = "counterexamples"
"""The folder of a search in a folder of results: reports show what lies there."""


@contextmanager
def locked_folder(directory: Path | None, *, for_results: bool = True) -> Iterator[None]:
    """Make a folder for results, or take one that is empty or holds an earlier run or bench of ours, and lock it.

    Within the block no other command may write there. A folder that is made here and holds nothing at the end goes
    again. Without one nothing is done. A folder that is not `for_results` may hold other files: who writes there says
    which of them may be overwritten.

    Raises `InputError` for a folder with other files, where nothing can be written, and where another command does.
    """
    if directory is None:
        yield
        return
    # Before anything is created: a folder that is not ours stays untouched.
    if for_results or not directory.is_dir():
        _check(directory)
    created = not directory.exists()
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise _unwritable(directory, error) from error
    try:
        with _locked(directory):
            yield
    finally:
        if created and directory.is_dir() and not any(directory.iterdir()):
            directory.rmdir()


_open: set[int] = set()
"""Descriptors of the folders that this process has locked."""


def _let_go() -> None:
    """Give up inherited locks in a forked worker: else they would outlive a run that was killed."""
    for descriptor in _open:
        os.close(descriptor)
    _open.clear()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_let_go)


def holds_results(directory: Path) -> bool:
    """Whether a folder holds an earlier run or bench of ours."""
    return any(_ours(directory / name) for name in DOCUMENTS)


def _check(directory: Path) -> None:
    """Raise `InputError` for what is not a folder, and for a folder with files that are none of ours."""
    if directory.exists() and not directory.is_dir():
        raise InputError(f"'{directory}' is a file", why="results go into a folder", todo="name another with -o")
    contents = {path.name for path in directory.iterdir()} - {LOCK} if directory.is_dir() else set()
    if contents and not holds_results(directory):
        raise InputError(
            f"'{directory}' is not empty and holds no results.json of an earlier run",
            why="files that hapticeval did not write are never overwritten",
            todo="name a new or an empty folder with -o",
        )


@contextmanager
def _locked(directory: Path) -> Iterator[None]:
    """Lock a folder within the block; by a file in it where the system has no such lock, as Windows.

    Raises `InputError` where another process has locked it.
    """
    if fcntl is None:
        with _lock_file(directory):
            yield
        return
    try:
        # The lock belongs to an open descriptor of the folder itself, and leaves no file behind.
        descriptor = os.open(directory, os.O_RDONLY)
    except OSError as error:
        raise _unwritable(directory, error) from error
    _open.add(descriptor)
    try:
        _lock(directory, descriptor)
        yield
    finally:
        _open.discard(descriptor)
        os.close(descriptor)  # which gives the lock back, as the end of the process does


@contextmanager
def _lock_file(directory: Path) -> Iterator[None]:
    """Lock a folder within the block by a file that only one process can make. A run that is killed leaves it behind.

    Raises `InputError` where the file is there, with the process that it names.
    """
    path = directory / LOCK
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(f"{os.getpid()}\n")
    except FileExistsError as error:
        other = path.read_text(encoding="utf-8", errors="replace").strip()[:20]
        raise InputError(
            f"another command writes into '{directory}': process {other}",
            why="two in one folder would mix what they write",
            todo=f"wait until it has ended, or name another folder with -o; if it was killed, remove {path}",
        ) from error
    except OSError as error:
        raise _unwritable(directory, error) from error
    try:
        yield
    finally:
        path.unlink(missing_ok=True)


def _lock(directory: Path, descriptor: int) -> None:
    """Lock an open folder. Raises `InputError`, with the other's process where the system tells it."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        other = _locker(os.fstat(descriptor).st_ino)
        raise InputError(
            f"another command writes into '{directory}'" + (f": process {other}" if other else ""),
            why="two in one folder would mix what they write",
            todo="wait until it has ended, end it, or name another folder with -o",
        ) from error
    except OSError:
        return  # a file system without locks


def _locker(inode: int) -> str:
    """Return the process that has locked a file, as Linux lists it; "" where nothing is known of it."""
    try:
        rows = [row.split() for row in Path("/proc/locks").read_text().splitlines()]
    except OSError:
        return ""
    # A row of /proc/locks: ordinal, kind, mode, access, process, major:minor:inode, start, end.
    return next((row[4] for row in rows if row[5].endswith(f":{inode}") and int(row[4]) > 0), "")


def _unwritable(directory: Path, error: OSError) -> InputError:
    why = error.strerror or str(error)
    return InputError(f"cannot write into the folder '{directory}'", why=why, todo="name another with -o")


def remove_reports(directory: Path) -> None:
    """Remove the reports of an earlier run, which must not stand beside the results of this one.

    Raises `InputError` where they cannot be removed.
    """
    try:
        for report in (directory / name for name in REPORTS):
            # From a link to a folder it removes the link, never what that leads to.
            if report.is_dir() and not report.is_symlink():
                shutil.rmtree(report)
            else:
                report.unlink(missing_ok=True)
    except OSError as error:
        raise _unwritable(directory, error) from error


def _ours(file: Path) -> bool:
    """Whether a file is a document that hapticeval wrote, of whatever version."""
    try:
        document = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return False
    return isinstance(document, dict) and document.keys() >= DOCUMENTS[file.name] | {"format_version"}
