"""What an examination of a recording finds: how bad it is, where, and what to do."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

from hapticeval.recordings.recording import Recording


class Severity(StrEnum):
    """`fault`: those rows are not a measurement; `suspicious`: a person should look; `note`: good to know."""

    FAULT = "fault"
    SUSPICIOUS = "suspicious"
    NOTE = "note"


@dataclass(frozen=True)
class Issue:
    """What is wrong somewhere: `kind` in a word or two, channel and column, rows [first, end), and the times there.

    `first` is None for what concerns the whole recording. `measures` are the numbers behind it.
    """

    kind: str
    severity: Severity
    message: str
    todo: str = ""
    channel: str = ""
    first: int | None = None
    end: int | None = None
    time: tuple[float, float] | None = None
    measures: Mapping[str, Any] = field(default_factory=dict)

    @property
    def place(self) -> str:
        """For instance `row 120 to 131, 0.12 to 0.131 s`."""
        if self.first is None or self.end is None or self.time is None:
            return "all"
        # The span's end is exclusive, what a reader sees is not.
        rows = f"row {self.first}" if self.end - self.first <= 1 else f"rows {self.first} to {self.end - 1}"
        begin, end = self.time
        return f"{rows}, {begin:.6g} s" if begin == end else f"{rows}, {begin:.6g} to {end:.6g} s"


MASK_DISORDER = 'convert with [time] disorder = "mask", which marks the row as no measurement; or mend the file'
COPY_AGAIN = "copy or record the file again"
WHICH_COLUMN = "which column of the file belongs here"

ADVICE: Mapping[str, str] = {
    "duplicate": MASK_DISORDER,
    "reversal": MASK_DISORDER,
    "gap": "see whether the loop or the logger was late",
    "rate": "see whether every cycle was logged, and whether the unit of time is right",
    "missed": "see the logger",
    "ended": "",
    # What a damaged file or an interrupted copy lacks comes back with a whole one.
    "lost": COPY_AGAIN,
    "import": COPY_AGAIN,
    "rows": COPY_AGAIN,
    "no number": "left out; see why the sensor gave none",
    "jump": "see whether a counter overflowed, or two logs were joined; replays begin anew there",
    "dropout": "leave those rows out; see whether the sensor lost sight of its mark, or a cable its contact",
    "stuck": "leave those rows out; see the sensor and its cable",
    "saturated": "there the limit of sensor or motor was recorded, not the signal",
    "spike": "leave it out; see the cable and the logger",
    "constant": f"see the sensor and its cable, and {WHICH_COLUMN}",
    "repeated rows": "the logger wrote old samples: see its rate and that of the device, and record again",
    "dropped rows": "see whether every cycle was logged, and give the file's own clock in place of a rate",
    "copy": f"see {WHICH_COLUMN}",
    "shifted copy": f"see {WHICH_COLUMN}",
    "from another run": "see which run was meant: a hand never moves the same way twice",
    "velocity": "see its column, unit and sign",
    "force lag": "see whether both were logged in the same tick, and the delay of the loop",
    "unit": "see the unit in the mapping",
    "forward kinematics": "see zero offsets, directions and lengths of the device, and the frame of the HIP",
    "torque": "see the signs of motors and force; an inner loop that adds its own dynamics differs too",
    "spring": "see the stiffness, the sign of the force, and whether all three were logged in the same tick",
    "surface": "see the model and its frame; a renderer with a coarser representation declares its resolution",
    "spring and surface": "see model, stiffness, damping and the axes of HIP and force; the log has no IHIP to "
    "separate them",
    "contact": "see the model, its size and its frame; a motor that is off or a force of something else does so too",
}
"""Every kind of issue, and what to do about it, unless its detector knows better."""

FAULT_KINDS = ("duplicate", "reversal", "no number")
"""Kinds that are faults. That a run ended is a note; all others are suspicious unless their detector knows better."""

LEFT_OUT_KINDS = ("stuck", "spike", "jump", "dropout")
"""Kinds, but for notes, of which `no_measurement` speaks."""


def no_measurement(issue: Issue) -> bool:
    """Return whether the rows of an issue are not a measurement, though they are valid: checks leave them out."""
    return issue.kind in LEFT_OUT_KINDS and issue.severity is not Severity.NOTE and issue.first is not None


def make_issue(
    recording: Recording,
    kind: str,
    message: str,
    channel: str = "",
    span: tuple[int, int] | None = None,
    *,
    severity: Severity | None = None,
    todo: str | None = None,
    **measures: Any,
) -> Issue:
    """Make an issue of a kind of `ADVICE` at the rows [first, end) of `span`; `measures` are the numbers behind it."""
    # A detector that knows better overrides severity and advice.
    usual = Severity.FAULT if kind in FAULT_KINDS else Severity.NOTE if kind == "ended" else Severity.SUSPICIOUS
    first, end = span or (None, None)
    # s, of the first and the last row of the span.
    time = None if span is None else (float(recording.time[span[0]]), float(recording.time[span[1] - 1]))
    advice = ADVICE[kind] if todo is None else todo
    return Issue(kind, severity or usual, message, advice, channel, first, end, time, measures)
