"""Whether a log's own IHIP and force follow from its HIP by the renderer that it names, and if not, why.

A channel may deviate by rounding, a lag, its sign, a gain, or from a tick on.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hapticeval.discovery import resolve, resolve_installed
from hapticeval.errors import InputError
from hapticeval.phenomena.sampling import LED
from hapticeval.quantity import plural
from hapticeval.recordings.integrity.relations import lagged
from hapticeval.recordings.recording import SINGLE, Recording
from hapticeval.recordings.stretches import Stretch
from hapticeval.replay.rerender import concatenated, hand_path, rerender
from hapticeval.replay.subject import ReplayCase
from hapticeval.scene import Scene
from hapticeval.simulation.answers import make_renderer
from hapticeval.types import Array

LIVE_SOURCE = "hardware"
"""The source of what our own loop recorded."""

DECIMAL_PLACES = range(1, 13)
"""Decimal places that a log may have been rounded to."""

LONGEST_LAG = 20
"""Ticks up to which a lag is looked for, either way: 20 ms at 1 kHz, more than any loop that anyone could feel with."""

EXPLAINED_SHARE = 0.99
"""Share of the samples that a lag or a gain must bring within the tolerance to explain the deviation."""


@dataclass(frozen=True)
class Deviation:
    """One channel of a log against its computation.

    `largest` (m or N) is the largest distance, `tolerance` what rounding allows. `first` is the first row beyond that,
    None where there is none; `lag` (ticks, positive where the log is late) and `gain` explain it where they can.
    """

    channel: str
    largest: float
    tolerance: float
    first: int | None = None
    first_time: float | None = None
    share_beyond: float = 0.0
    lag: int = 0
    gain: float = 1.0
    explained: bool = False

    @property
    def follows(self) -> bool:
        """Whether the log is its computation, to rounding."""
        return self.first is None

    def describe(self) -> str:
        """Describe the deviation in one line."""
        scale, unit = (1e3, "mm") if self.channel == "ihip" else (1.0, "N")
        name = self.channel.replace("ihip", "IHIP")
        if self.largest == 0.0:
            return f"{name}: follows to the last bit"
        size, bound = (f"{scale * distance:.3g} {unit}" for distance in (self.largest, self.tolerance))
        if self.follows:
            return f"{name}: follows to rounding: {size} at most, where rounding may make {bound}"
        causes = []
        if self.lag:
            causes.append(f"the log is {plural(abs(self.lag), 'tick')} {'late' if self.lag > 0 else 'early'}")
        if self.gain != 1.0:
            causes.append("its sign is turned" if self.gain == -1.0 else f"its gain is {self.gain:.6g}")
        return (
            f"{name}: does not follow: {size} apart, where rounding makes {bound}; from row {self.first} on "
            f"(t = {self.first_time:.6g} s), in {100.0 * self.share_beyond:.3g} % of the samples; "
            + (" and ".join(causes) if self.explained else "neither a lag, nor a sign, nor a gain explains it")
        )


def deviation(channel: str, computed: Array, logged: Array, time: Array, *, tolerance: float) -> Deviation:
    """Compare a logged channel (n, N), m or N, with its computation, and look for the simplest explanation of the rest.

    In this order: nothing; the sign; a gain (of forces); a lag up to `LONGEST_LAG` ticks; a lag with a sign or gain.
    `time` (n,) is in s; `tolerance`, in the channel's unit, is what rounding alone may make.
    """
    # m or N at each sample.
    distance = np.linalg.norm(logged - computed, axis=1)
    exceeds = distance > tolerance
    if not exceeds.any():
        return Deviation(channel, float(distance.max()), tolerance)
    first = int(np.argmax(exceeds))
    unexplained = Deviation(channel, float(distance.max()), tolerance, first, float(time[first]), float(exceeds.mean()))
    gains = channel == "force"
    lags = sorted(range(-LONGEST_LAG, LONGEST_LAG + 1), key=lambda lag: (abs(lag), lag < 0))[1:]
    # The simplest explanation first: it is taken as soon as it fits.
    for lag, gained in [(0, True), *((lag, False) for lag in lags), *((lag, True) for lag in lags)]:
        mine, theirs = lagged(computed, logged, lag)
        gain = _gain(mine, theirs) if gained else 1.0
        # A gain of 1 explains nothing, and only a force may have another.
        if len(mine) < 2 or (gained and (not gains or gain == 1.0)):
            continue
        left = np.linalg.norm(theirs - gain * mine, axis=1) <= tolerance * max(1.0, abs(gain))
        # What is zero or at rest fits any lag and gain; those samples that deviate must be brought to fit.
        moved = exceeds[max(lag, 0) : exceeds.size + min(lag, 0)]
        if moved.any() and np.mean(left[moved]) >= EXPLAINED_SHARE and np.mean(left) >= EXPLAINED_SHARE:
            return replace(unexplained, lag=lag, gain=gain, explained=True)
    return unexplained


def _gain(computed: Array, logged: Array) -> float:
    """Return the least-squares gain of the log, rounded where it is whole to single precision; 1 of nothing."""
    # Least squares of logged = gain computed: gain = sum logged computed / sum computed^2.
    power = float(np.sum(computed**2))
    gain = float(np.sum(logged * computed)) / power if power else 1.0
    return float(np.round(gain)) if abs(gain - np.round(gain)) < 1e-6 else gain


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
        """Whether every channel follows from the renderer, to rounding, over the whole log."""
        return bool(self.channels) and all(channel.follows for channel in self.channels) and not self.ended

    def describe(self) -> str:
        """Describe the comparison, one line per channel."""
        head = f"{self.file} as recorded: {self.renderer} computed again over {self.rows} samples"
        ends = (f"  the renderer gives no answer from {interval}" for interval in self.ended)
        return "\n".join([head, *(f"  {channel.describe()}" for channel in self.channels), *ends])


def as_recorded(replay_case: ReplayCase, renderers: Sequence[str] = ()) -> AsRecorded:
    """Compute the recorded renderer again along the log's own HIP, and compare with the log's IHIP and force.

    The renderer is the recording's (`meta["renderer"]`) or the one of `renderers`. Raises `InputError` where neither
    or several are named, where the log has neither IHIP nor force, and for a renderer with tool physics of its own:
    its recorded HIP is its tool, not the hand that it was given.
    """
    names = list(renderers) or _named(replay_case.recording)
    if len(names) != 1:
        raise InputError(
            f"{replay_case.file} does not say its renderer" if not names else "more than one renderer is named",
            why="the log is compared with one renderer's answer",
            todo="name it: --as-recorded -r constraint",
        )
    scene = replay_case.case.build_scene()
    renderer = make_renderer(
        resolve(names[0]) if renderers else resolve_installed(names[0], source=replay_case.file), scene
    )
    if not renderer.steps:
        raise InputError(
            f"'{names[0]}' cannot be computed again from {replay_case.file}",
            why="it has tool physics of its own: the recorded HIP is its tool, and what led it was not recorded",
            todo="run its case again, which is repeatable",
        )
    path = hand_path(replay_case)
    log, step = path.recording, path.recording.meta.get("dt")
    if log.meta.get("source") == LIVE_SOURCE and log.valid is None and step is not None:
        # Our own loop gives a renderer the same step each cycle and never resets it, also where cycles were missed.
        path = replace(path, stretches=(Stretch(0, len(log)),), dt=float(step))
    # A hand that was not led began where it was.
    parts = rerender(renderer, path, scene if log.meta.get("source") in LED else None)
    again = concatenated([part.recording for part in parts])
    # Only the samples that the renderer answered can be compared.
    log = concatenated(
        [log.part(slice(part.stretch.first, part.stretch.first + len(part.recording))) for part in parts]
    )
    bounds = _rounding(log, scene)
    deviations = tuple(
        deviation(channel, again.channels[channel], log.channels[channel], log.time, tolerance=bounds[channel])
        for channel in ("ihip", "force")
        if channel in log.channels
    )
    if not deviations:
        raise InputError(
            f"{replay_case.file} has neither IHIP nor force",
            why="there is nothing to compare the renderer's answer with",
        )
    ended = tuple(part.ended for part in parts if part.ended)
    return AsRecorded(replay_case.file, names[0], len(log), deviations, ended, path.suspicious)


def unstated_renderer(recording: Recording, renderers: Sequence[str]) -> Mapping[str, str]:
    """Return what is not known of the renderer to compare with, and how to give it; empty where it is known."""
    return {} if renderers or _named(recording) else {"its renderer": "-r constraint"}


def _named(recording: Recording) -> list[str]:
    name = recording.meta.get("renderer")
    return [name] if isinstance(name, str) and name else []


def _rounding(log: Recording, scene: Scene) -> dict[str, float]:
    """Return how far apart rounding alone may set log and computation: m for the IHIP, N for the force.

    Positions of the model's size kept in single precision are known to SINGLE * size, a text with d decimals to half
    of 10^-d a coordinate. Either reaches the IHIP from the HIP and from its own rounding; four times and twice that
    allow for a projection that stretches its HIP's rounding threefold. A spring makes a force of both positions.
    """
    size = float(max(scene.model.size, np.max(np.abs(log.hip))))
    texts = {name: _last_place(log.channels[name]) for name in ("hip", "ihip", "force") if name in log.channels}
    # m: single precision at the size of the model, and the last place of a text.
    ihip = 4.0 * SINGLE * size + 2.0 * (texts["hip"] + texts.get("ihip", 0.0))
    strongest = float(np.max(np.abs(log.force))) if "force" in log.channels else 0.0
    return {"ihip": ihip, "force": 2.0 * scene.stiffness * ihip + 4.0 * SINGLE * strongest + texts.get("force", 0.0)}


def _last_place(values: Array) -> float:
    """Return 10^-d where every number has at most d decimals, as in a text file; 0 where they have more."""
    scale = max(1.0, float(np.max(np.abs(values))))
    for decimals in DECIMAL_PLACES:
        place = 10.0**-decimals
        # Whole numbers of the last place, but for the rounding of the division; whole values are not a sign of a text.
        if np.max(np.abs(values / place - np.round(values / place))) <= 8.0 * np.finfo(float).eps * scale / place:
            return 0.0 if np.all(values == np.round(values)) else place
    return 0.0
