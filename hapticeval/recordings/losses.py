"""What a damaged file has lost, and what could be had of it."""

from __future__ import annotations

from dataclasses import dataclass

from hapticeval.recordings.recording import Recording


@dataclass(frozen=True)
class Loss:
    """A part that cannot be read: `what` and `where` in words, and how many `rows` and `seconds` are missing.

    They are None where nobody can know: what followed the end of a file that was never closed.
    """

    what: str
    where: str
    rows: int | None
    seconds: float | None

    def __str__(self) -> str:
        if self.rows is None:
            return f"{self.what}, {self.where}"
        span = "" if self.seconds is None else f" ({self.seconds:.3g} s)"
        return f"{self.what}, {self.where}: {self.rows} rows{span}"


LOST = "lost"
"""The kind of the events that tell of losses, so that a recording made of a damaged file goes on saying so."""


def told_losses(recording: Recording) -> tuple[str, ...]:
    """What of the file that a recording was made of is lost, in words."""
    return tuple(event.text for event in recording.events if event.kind == LOST)


def told_warnings(recording: Recording) -> tuple[str, ...]:
    """What the import of a foreign file warned of: rows that are cut off, cells without a number."""
    return tuple(str(text) for text in recording.meta.get("import", {}).get("warnings", ()))


MISSING = ("time out of order", "without a number")
"""Of what an import leaves out, the rows that the file should have had: gaps are as they were meant."""


def incomplete(recording: Recording) -> bool:
    """Whether rows of a recording are lost or masked, cycles have no row, the run ended early, or the import warned."""
    left_out = recording.meta.get("import", {}).get("left out", {})
    ended = any(event.kind == "ended" for event in recording.events)
    missed = recording.clock is not None and recording.clock.missed
    return bool(missed or ended or told_losses(recording) or told_warnings(recording) or left_out.keys() & set(MISSING))


@dataclass(frozen=True)
class Salvaged:
    """What is whole of a file, as a recording, and the `losses`; of a sound file there are none."""

    recording: Recording
    losses: tuple[Loss, ...]
