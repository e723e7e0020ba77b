"""Whether a log's own IHIP and force follow from its HIP by the renderer that it names."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hapticeval.discovery import resolve, resolve_installed
from hapticeval.errors import InputError
from hapticeval.phenomena.sampling import LED
from hapticeval.recordings.recording import SINGLE, Recording
from hapticeval.recordings.stretches import Stretch
from hapticeval.renderer import Renderer
from hapticeval.replay.explain import Deviation, deviation
from hapticeval.replay.job import hand_path
from hapticeval.replay.rerender import HandPath, Part, joined, rerendered
from hapticeval.replay.subject import Subject
from hapticeval.runner.judging import built
from hapticeval.scene import Scene

LIVE = "hardware"
"""The source of what our own loop recorded."""

DECIMALS = range(1, 13)
"""Decimal places that a log may have been rounded to."""


@dataclass(frozen=True)
class AsRecorded:
    """The channels of a log against what its renderer makes of its HIP; `rows` were compared.

    `suspicious` is what the recording's examination found.
    """

    file: str
    renderer: str
    rows: int
    channels: tuple[Deviation, ...]
    ended: tuple[str, ...] = ()
    suspicious: tuple[str, ...] = ()

    @property
    def follows(self) -> bool:
        """Whether every channel does, to rounding, over the whole log."""
        return bool(self.channels) and all(each.follows for each in self.channels) and not self.ended

    def told(self) -> str:
        """A line a channel."""
        head = f"{self.file} as recorded: {self.renderer} computed again over {self.rows} samples"
        ends = (f"  the renderer gives no answer from {each}" for each in self.ended)
        return "\n".join([head, *(f"  {each.told()}" for each in self.channels), *ends])


def as_recorded(subject: Subject, renderers: Sequence[str] = ()) -> AsRecorded:
    """Compute the recorded renderer again along the log's own HIP, and compare with the log's IHIP and force.

    The renderer is the recording's (`meta["renderer"]`) or the one of `renderers`. Raises `InputError` where neither
    or several are named, where the log has neither IHIP nor force, and for a renderer with tool physics of its own:
    its recorded HIP is its tool, not the hand that it was given.
    """
    name = _name(subject, renderers)
    scene = subject.case.build_scene()
    factory = resolve(name) if renderers else resolve_installed(name, source=subject.file)
    renderer = built(factory, scene)
    if not isinstance(renderer, Renderer):
        raise InputError(
            f"'{name}' cannot be computed again from {subject.file}",
            why="it has tool physics of its own: the recorded HIP is its tool, and what led it was not recorded",
            todo="run its case again, which is repeatable",
        )
    path, sound = hand_path(subject)
    log, told = path.recording, path.recording.meta.get("dt")
    if log.meta.get("source") == LIVE and log.valid is None and told is not None:
        # Our own loop tells a renderer the same step each cycle and never resets it, also where cycles were missed.
        path = HandPath(log, (Stretch(0, len(log)),), dt=float(told))
    # A hand that was not led began where it was.
    parts = rerendered(renderer, path, scene if log.meta.get("source") in LED else None)
    again = joined([part.recording for part in parts])
    log = joined([path.recording.part(_answered(part)) for part in parts])
    bounds = _rounding(log, scene)
    found = tuple(
        deviation(channel, again.channels[channel], log.channels[channel], log.time, tolerance=bounds[channel])
        for channel in ("ihip", "force")
        if channel in log.channels
    )
    if not found:
        raise InputError(
            f"{subject.file} has neither IHIP nor force", why="there is nothing to compare the renderer's answer with"
        )
    ended = tuple(part.ended for part in parts if part.ended)
    return AsRecorded(subject.file, name, len(log), found, ended, sound.suspicious)


def _answered(part: Part) -> slice:
    return slice(part.stretch.first, part.stretch.first + len(part.recording))


def unsaid(recording: Recording, renderers: Sequence[str]) -> Mapping[str, str]:
    """What is not known of the renderer to compare with, and how to give it; empty where it is known."""
    said = recording.meta.get("renderer")
    return {} if renderers or (isinstance(said, str) and said) else {"its renderer": "-r constraint"}


def _name(subject: Subject, renderers: Sequence[str]) -> str:
    said: Any = subject.recording.meta.get("renderer")
    names = list(renderers) or ([said] if isinstance(said, str) and said else [])
    if len(names) != 1:
        raise InputError(
            f"{subject.file} does not say its renderer" if not names else "more than one renderer is named",
            why="the log is compared with one renderer's answer",
            todo="name it: --as-recorded -r constraint",
        )
    return names[0]


def _rounding(log: Recording, scene: Scene) -> dict[str, float]:
    """How far apart rounding alone may set log and computation: m for the IHIP, N for the force.

    Positions of the model's size kept in single precision are known to SINGLE * size, a text with d decimals to half
    of 10^-d a coordinate. Either reaches the IHIP from the HIP and from its own rounding; four times and twice that
    allow for a projection that stretches its HIP's rounding threefold. A spring makes a force of both positions.
    """
    size = float(max(scene.model.size, np.max(np.abs(log.hip))))
    texts = {name: _last_place(log.channels[name]) for name in ("hip", "ihip", "force") if name in log.channels}
    ihip = 4.0 * SINGLE * size + 2.0 * (texts["hip"] + texts.get("ihip", 0.0))
    strongest = float(np.max(np.abs(log.force))) if "force" in log.channels else 0.0
    return {"ihip": ihip, "force": 2.0 * scene.stiffness * ihip + 4.0 * SINGLE * strongest + texts.get("force", 0.0)}


def _last_place(values: Any) -> float:
    """10^-d where every number has at most d decimals, as in a text file; 0 where they have more than a text keeps."""
    scale = max(1.0, float(np.max(np.abs(values))))
    for decimals in DECIMALS:
        place = 10.0**-decimals
        if np.max(np.abs(values / place - np.round(values / place))) <= 8.0 * np.finfo(float).eps * scale / place:
            return 0.0 if np.all(values == np.round(values)) else place
    return 0.0
