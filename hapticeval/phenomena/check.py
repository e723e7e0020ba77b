"""What a check is: a plain function of the runs and the scene, with its papers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Protocol

from hapticeval.errors import InputError
from hapticeval.phenomena.verdict import Finding, Level
from hapticeval.recordings.recording import Recording
from hapticeval.scene import Scene


class Closer(Protocol):
    """A recording of which any part can be looked at in finer steps: see `hapticeval.simulation.playback.Closeup`."""

    recording: Recording

    def closer(self, first: int, last: int, factor: int, *, lag: int) -> Closer:
        """From row `first` to row `last`, each step in `factor`; the hand rests before, and for `lag` ticks after."""


@dataclass(frozen=True, eq=False)
class Runs:
    """The recording that is judged, and the ways to get its siblings where the runner can make them.

    `refine(k)` runs the same stimulus at k times the sampling rate; `reverse()` leads the hand backwards along
    the same points; `at_speed(f)` starts the experiment f times as fast; `again()` runs it once more through the same
    renderer, which is reset in between; `look` is `base` with a way to refine a part of it. Each is None where it
    cannot be had: a recorded hardware run has no siblings. `law` names the closed form (`hapticeval.closed_forms`)
    that the case gives for this renderer, if it does. Raises `InputError` for a recording with rows that are not valid.
    """

    base: Recording
    refine: Callable[[int], Recording] | None = None
    reverse: Callable[[], Recording] | None = None
    at_speed: Callable[[float], Recording] | None = None
    law: str | None = None
    again: Callable[[], Recording] | None = None
    look: Closer | None = None

    def __post_init__(self) -> None:
        if self.base.valid is not None:
            raise InputError(
                "a recording with gaps cannot be judged as a whole",
                why="rows that are not valid hold numbers that nobody measured",
                todo="judge its sound stretches: part(rows) of each sound_rows()",
            )

    def remembered(self) -> Runs:
        """The same runs, each sibling made once at the most."""
        return Runs(
            self.base,
            None if self.refine is None else cache(self.refine),
            None if self.reverse is None else cache(self.reverse),
            None if self.at_speed is None else cache(self.at_speed),
            self.law,
            None if self.again is None else cache(self.again),
            self.look,
        )


@dataclass(frozen=True)
class Check:
    """A phenomenon as a check, with all that `hapticeval explain` prints."""

    id: str
    phenomenon: str
    asks: str
    formula: str
    citation: str
    channels: tuple[str, ...]
    siblings: str
    metric: str
    unit: str
    bound: str
    judge: Callable[[Runs, Scene], Finding]
    level: Level = Level.MUST
    section: str = ""
    """The section of a report that shows the evidence of these verdicts in a table of its own, if one does."""
