"""`hapticeval cache`: where the compiled kernels of this installation are kept, and how to be rid of them."""

from __future__ import annotations

import shutil
from typing import Annotated

import typer

from hapticeval.commands.terminal import say
from hapticeval.errors import HapticevalError
from hapticeval.quantity import format_size, plural

EXIT_CODES = """\b
Exit codes:
  0  shown, or removed
  2  wrong usage, or they cannot be removed
"""


def cache(
    clear: Annotated[bool, typer.Option("--clear", help="Remove them: the next run compiles anew.")] = False,
) -> None:
    """Show where compiled kernels are kept, and how much they take; or remove them, as before an uninstall.

    They lie in the user's cache folder, or where NUMBA_CACHE_DIR says.

    \b
    Examples:
      hapticeval cache
      hapticeval cache --clear
    """
    from hapticeval.kernel_cache import kernel_folder

    folder = kernel_folder()
    files = [file for file in folder.rglob("*") if file.is_file()]
    size = format_size(sum(file.stat().st_size for file in files))
    content = f"{plural(len(files), 'file')}, {size}"
    if not clear:
        say(f"{folder}: {content}")
        return
    try:
        # A folder that is not there yet is as empty as one that was removed.
        if folder.exists():
            shutil.rmtree(folder)
    except OSError as error:
        raise HapticevalError(f"cannot remove {folder}", why=error.strerror or str(error)) from error
    say(f"removed {content}, of {folder}")
