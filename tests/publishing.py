"""What `make tables` asks for: whether tests write the tables anew that they compare, and of which check alone.

HAPTICEVAL_PUBLISH=1 writes all. `make tables CHECK=ID` sets it to the id of a check: then only what asks that check is
judged, of that check alone, and the rest of the tables stays. A table is written after each test, and whole or not at
all, so that a run that dies keeps what it has judged.
"""

from __future__ import annotations

import os
from collections.abc import Iterable

from msgspec.structs import replace

from hapticeval.errors import UnknownNameError
from hapticeval.phenomena.registry import OWN_CHECKS
from hapticeval.suite.case import Case

WISH = os.environ.get("HAPTICEVAL_PUBLISH", "")
if WISH not in ("", "1", *OWN_CHECKS):
    raise UnknownNameError("check whose tables are to be written", WISH, OWN_CHECKS)


def publishing() -> bool:
    """Whether tables are to be written."""
    return bool(WISH)


def only_check() -> str | None:
    """The check of which alone tables are to be written; None where it is of all."""
    return WISH if WISH in OWN_CHECKS else None


def concerned(cases: Iterable[Case]) -> tuple[Case, ...]:
    """Return the cases that are to be judged, with the checks that are to be asked there."""
    only = only_check()
    if only is None:
        return tuple(cases)
    return tuple(replace(case, checks=(only,)) for case in cases if only in case.checks)
