"""Wirings as files: the `[device]` table of a TOML file, a mapping's or one of its own."""

from __future__ import annotations

import tomllib
from pathlib import Path

from hapticeval.errors import HapticevalError, InputError
from hapticeval.hardware.wiring import Wiring


def read_wiring(path: Path) -> Wiring:
    """The wiring in a TOML file. Raises `InputError`, naming the file, for one that has none or a wrong one."""
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"cannot read the wiring {path}", why=error.strerror or str(error)) from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{path.name} is not TOML", why=str(error)) from error
    table = document.get("device")
    if not isinstance(table, dict):
        raise InputError(f"{path.name} has no table [device]", todo='write for instance [device], and kind = "..."')
    try:
        return Wiring.described(table)
    except HapticevalError as error:
        raise InputError(f"{path.name}: [device]: {error.what}", why=error.why, todo=error.todo) from error
