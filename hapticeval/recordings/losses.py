"""What a damaged file has lost, and what could be had of it."""

from __future__ import annotations

from dataclasses import dataclass

from hapticeval.recordings.recording import Recording


@dataclass(frozen=True)
class Loss:
    """A part that cannot be read: `what` and `where` in words, and how many `rows` and `seconds` are missing.

    Rows and seconds are None where nobody can know: what followed the end of a file that was never closed.
    """

    what: str
    where: str
    rows: int | None
    seconds: float | None

    def __str__(self) -> str:
        if self.rows is None or self.seconds is None:
            return f"{self.what}, {self.where}"
        return f"{self.what}, {self.where}: {self.rows} rows ({self.seconds:.3g} s)"


@dataclass(frozen=True)
class Salvaged:
    """What is whole of a file, as a recording, and the `losses`; of a sound file there are none."""

    recording: Recording
    losses: tuple[Loss, ...]
