"""Which samples of a recording can be led through a renderer, which can be judged, and what is left out and why."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from hapticeval.geometry.model import Model
from hapticeval.recordings.channels import SIMULATED
from hapticeval.recordings.integrity.issue import Severity
from hapticeval.recordings.recording import Recording
from hapticeval.recordings.stretches import Stretch, stretches

if TYPE_CHECKING:
    from hapticeval.recordings.integrity.report import Integrity

SEEN = ("hip", "measured_hip")
"""Channels that a renderer is given: only their faults break the hand's path."""

TOLD = 12
"""So many left-out intervals are named; of more, the number."""


@dataclass(frozen=True)
class Usable:
    """`path` are the stretches that renderers are led along, `judged` those in which the recorded run is judged.

    A fault of the recorded force or IHIP takes its rows out of the second alone. `left_out` says what and when, and
    `suspicious` what else the examination found that a person should look at.
    """

    path: tuple[Stretch, ...]
    judged: tuple[Stretch, ...]
    left_out: tuple[str, ...]
    suspicious: tuple[str, ...] = ()


def usable(recording: Recording, *, model: Model | None = None, stiffness: float | None = None) -> Usable:
    """What of a recording can be used. A simulated one is examined for gaps only, any other as `inspect` does it, with
    the `model` and the `stiffness` (N/m, of a spring without damping) that it is replayed with.
    """
    if recording.meta.get("source") in SIMULATED:
        found = stretches(recording)
        return Usable(found, found, ())
    from hapticeval.recordings.integrity.report import LEFT_OUT, examine, sound_intervals

    report = examine(recording, model=model, stiffness=stiffness)
    soundness = sound_intervals(recording, report)
    hand = recording.measured.copy()
    for fault in report.faults:
        if fault.kind in LEFT_OUT and fault.channel.partition(".")[0] in SEEN and fault.first is not None:
            hand[fault.first : fault.end] = False
    told = [f"{why}, {each.time[0]:.4g} to {each.time[1]:.4g} s" for each, why in soundness.left_out]
    rest = len(told) - TOLD
    return Usable(
        stretches(recording, hand),
        tuple(Stretch(each.first, each.end) for each in soundness.sound),
        tuple(told if rest <= 0 else [*told[:TOLD], f"and {rest} more"]),
        _suspicious(report),
    )


def _suspicious(report: Integrity) -> tuple[str, ...]:
    """A line a kind of finding and channel: the first of them, and how many there are."""
    found: dict[tuple[str, str], list[str]] = {}
    for fault in report.faults:
        if fault.severity is not Severity.NOTE:
            place = "" if fault.place == "all" else f" ({fault.place})"
            name = " ".join(part for part in (fault.kind, fault.channel) if part)
            found.setdefault((fault.kind, fault.channel), []).append(f"{name}{place}: {fault.message}")
    return tuple(f"{each[0]}{f', and {len(each) - 1} more' if len(each) > 1 else ''}" for each in found.values())
