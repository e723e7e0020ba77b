"""Run again whenever a file changes: each time in a process of its own, which imports the renderer afresh."""

from __future__ import annotations

import multiprocessing
import shlex
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from importlib.util import find_spec
from pathlib import Path

from hapticeval.discovery import ADAPTERS, known_renderers, parse, see_current_directory
from hapticeval.errors import HapticevalError, printable
from hapticeval.quantity import plural
from hapticeval.runner.interrupts import Interrupts
from hapticeval.workers import FORKS

FILES_LOOK_SECONDS = 0.2
"""Seconds between two looks at the files."""


def run_again(once: Callable[[], int], files: Callable[[], Iterable[Path]]) -> int:
    """Call `once` now and after every change of the files, until Ctrl-C; return what it last returned.

    The process that calls it is a copy of this one, made before anything of the renderer is imported here.
    """
    if not FORKS:
        raise HapticevalError(
            "--watch runs on Linux and macOS alone", why="it copies its process", todo="run the command again by hand"
        )
    with Interrupts() as interrupts:
        while True:
            # Before the run: a change during it starts the next one.
            stamps = _file_stamps(files())
            # A fork keeps what is imported of hapticeval, and nothing of the renderer is imported here.
            process = multiprocessing.get_context("fork").Process(target=_exit_with, args=(once,))
            process.start()
            process.join()
            code = process.exitcode or 0
            if interrupts.count:
                return code
            print(f"exit code {code}; watching {plural(len(stamps), 'file')}, Ctrl-C ends it", file=sys.stderr)
            while _file_stamps(files()) == stamps:
                if interrupts.count:
                    return code
                time.sleep(FILES_LOOK_SECONDS)


def _exit_with(once: Callable[[], int]) -> None:
    """Run once in this process, and end it with the exit code of the command."""
    try:
        code = once()
    except HapticevalError as error:
        print(printable(f"error: {error}"), file=sys.stderr)
        code = error.exit_code
    sys.exit(code)


def _file_stamps(files: Iterable[Path]) -> dict[Path, tuple[int, int]]:
    """Return time and size of those files that are there."""
    stamps = {}
    for file in files:
        try:
            status = file.stat()
        except OSError:
            continue
        stamps[file] = (status.st_mtime_ns, status.st_size)
    return stamps


def files_behind(renderers: Iterable[str]) -> list[Path]:
    """Return the source files of renderers: the folder of their package, or the modules beside theirs.

    Nothing is imported: of a module in a package the package is found. A name whose module is not found has none.
    """
    return sorted({file for name in renderers for file in _source_files(parse(name).base)})


def _source_files(base: str) -> Iterator[Path]:
    """Yield the files of a library or command, or the Python sources of a renderer's package."""
    kind, _, words = base.partition(":")
    if kind in ADAPTERS:  # a library, or a command with files among its words
        yield from (file for word in shlex.split(words) if (file := Path(word)).is_file())
        return
    entry = known_renderers().get(base)
    module = (base if entry is None else entry.value).partition(":")[0].strip()
    if not module:
        return
    see_current_directory()
    spec = find_spec(module.partition(".")[0])
    if spec is None:
        return
    # A package: all its modules. A single module: those in its folder, which it may import.
    if spec.submodule_search_locations:
        for folder in spec.submodule_search_locations:
            yield from Path(folder).rglob("*.py")
    elif spec.origin is not None and spec.has_location:
        yield from Path(spec.origin).parent.glob("*.py")
