"""Where compiled kernels, and what else takes long to make, are kept on disk: nothing outlives the code that made it.

Numba looks at the file of a kernel alone: not at the files of the kernels that it calls, and not at the constants that
it was compiled with. So each module has a folder of its own, named by a digest of all that goes into its kernels.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import sys
import time
import zipfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from contextvars import ContextVar
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from platformdirs import user_cache_path

try:
    import fcntl
except ImportError:  # not on Windows
    fcntl = None  # type: ignore[assignment]

IMPORT = re.compile(r"^from ([\w.]+) import (\([^)]*\)|.*)$", re.MULTILINE)
"""An import at the top of a module: the package, and the names."""

UNUSED = 7 * 86400.0
"""Seconds after which a folder that nothing was written to is removed, when its module has another: a week, chosen.

Who goes to and fro between two states of the code compiles each of them once.
"""


def kernel_folder() -> Path:
    """Return where the compiled kernels of this installation are kept.

    That is a folder of its own in the user's cache folder, or in the one that NUMBA_CACHE_DIR names. Each environment
    has its own, since it may have another numba.
    """
    all_installations = Path(os.environ.get("NUMBA_CACHE_DIR") or user_cache_path("hapticeval") / "kernels")
    return all_installations / hashlib.sha256(f"{Path(__file__).parent} {sys.prefix}".encode()).hexdigest()[:12]


def folder_of(module: str) -> Path:
    """Return the folder for the kernels of a module, by its name: another as soon as what goes into them changes.

    Folders that code of before left behind are removed, unless they were used not long ago.
    """
    folder = kernel_folder() / f"{module}-{digest_of(module)}"
    if not folder.exists():
        for other in folder.parent.glob(f"{module}-*"):
            with suppress(OSError):
                if time.time() - other.stat().st_mtime > UNUSED:
                    shutil.rmtree(other)
    return folder


@cache
def digest_of(module: str) -> str:
    """Return a digest of what the kernels of a module, which is imported by name, are compiled from.

    That is its source, that of modules with kernels which it imports from, and of those they import from, and the
    numbers that they import, which numba takes as constants.
    """
    digest = hashlib.sha256()
    included, to_do = {module}, [module]
    while to_do:
        own_text, with_kernels = _part_of(to_do.pop())
        digest.update(own_text)
        to_do.extend(name for name in with_kernels if name not in included)
        included.update(with_kernels)
    return digest.hexdigest()[:16]


@cache
def _part_of(module: str) -> tuple[bytes, tuple[str, ...]]:
    """Return a module's source with the numbers that it imports, and which of what it imports from has kernels."""
    source = _source(module)
    texts, imported_from = [f"{module}\n{source}"], set()
    for package, names_text in IMPORT.findall(source):
        names = re.findall(r"\w+", names_text)
        for name in names:
            value = getattr(sys.modules.get(module), name, None)
            if isinstance(value, bool | int | float | str | tuple | np.ndarray | np.dtype):
                texts.append(f"{name} = {value!r}\n")
        imported_from.update([package, *(f"{package}.{name}" for name in names)])
    return "".join(texts).encode(), tuple(sorted(name for name in imported_from if "compiled" in _source(name)))


@cache
def _source(module: str) -> str:
    """Return the source of an imported module; nothing for what has none, such as a session at a prompt."""
    with suppress(OSError, TypeError, UnicodeDecodeError):
        return Path(getattr(sys.modules.get(module), "__file__", None)).read_text()  # type: ignore[arg-type]
    return ""


@contextmanager
def lock_file(path: Path) -> Iterator[None]:
    """Hold a lock on a file, at which other processes wait. The system lets go of it when the process ends.

    Where a file system has no locks, nobody waits.
    """
    with ExitStack() as stack:
        if fcntl is not None:
            with suppress(OSError):
                path.parent.mkdir(parents=True, exist_ok=True)
                fcntl.flock(stack.enter_context(path.open("a")), fcntl.LOCK_EX)
        yield


_SHARES: ContextVar[bool] = ContextVar("_SHARES", default=True)


@contextmanager
def sharing_nothing() -> Iterator[None]:
    """While it lasts `shared_arrays` makes what it is asked for: the time that this takes can be measured."""
    token = _SHARES.set(False)
    try:
        yield
    finally:
        _SHARES.reset(token)


def shared_arrays(
    module: str, name: bytes, make: Callable[[], Mapping[str, NDArray[Any]]]
) -> Mapping[str, NDArray[Any]]:
    """Return the arrays that `make` gives, from disk where they have been made: by this code, and on such a machine.

    `name` tells them from others that the `module`, imported by its name, has made. One process makes them, and those
    that want them at the same time wait.
    """
    if not _SHARES.get():
        return make()
    digest = hashlib.sha256(name + repr(_platform()).encode()).hexdigest()[:32]
    file = folder_of(module) / f"{digest}.npz"
    with lock_file(file.with_suffix(".lock")):
        with (
            suppress(OSError, ValueError, EOFError, zipfile.BadZipFile),
            file.open("rb") as stream,  # numpy leaves one open of a file that is cut
            np.load(stream, allow_pickle=False) as archive,  # no pickles: what is read runs no code
        ):
            return dict(archive)
        arrays = make()
        # Where nothing can be written each process makes its own.
        with suppress(OSError):
            temporary = file.with_suffix(f".{os.getpid()}.npz")
            np.savez(temporary, **arrays)  # type: ignore[arg-type]
            temporary.replace(file)
    return arrays


@cache
def _platform() -> tuple[str, ...]:
    """Return what else the last digit of an array depends on: the libraries that computed it, and the processor."""
    import llvmlite.binding as llvm

    versions = [metadata.version(library) for library in ("numpy", "scipy", "numba", "llvmlite")]
    return (*versions, llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten())
