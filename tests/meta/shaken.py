"""Recordings of tests, shaken: the same run with one or two changes that are drawn, of any size and at any place.

What a test asks a check about is a run that shows one thing. Shaken, it shows others beside it: a second fault of
another size, a window that begins a tick later, a channel that comes late or not at all. What the check then finds is
not right or wrong by itself: `measured.py` holds it against what it found before.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from hapticeval.phenomena.check import Runs
from hapticeval.recordings.recording import Recording
from hapticeval.scene import Scene
from hapticeval.types import Array

Shake = Callable[[Recording, int], Recording]
"""Changes a recording that has so many rows for each tick of the one that is judged."""

ANSWERS = ("ihip", "force", "velocity", "operator_force", "contact", "hip")
OF_RUNS = ("refine", "reverse", "at_speed", "again", "without", "reordered", "cut", "subdivided", "in_turns")
"""The siblings that are recordings of the same path, with the position of a number of rows a tick, if they take it."""


def changed(recording: Recording, meta: Mapping[str, Any] | None = None, **channels: Any) -> Recording:
    kept = {name: values for name, values in (dict(recording.channels) | channels).items() if values is not None}
    signals = {name: recording.signals[name] for name in kept}
    return Recording(recording.time, kept, {**recording.meta, **(meta or {})}, signals=signals)


def sized(rng: np.random.Generator, smallest: float, largest: float) -> float:
    """Draw a size between two, all orders of magnitude alike."""
    return float(np.exp(rng.uniform(np.log(smallest), np.log(largest))))


def window(rng: np.random.Generator) -> tuple[float, int]:
    """Draw where a stretch begins, as a share of the run, and its ticks."""
    return float(rng.uniform()), int(rng.choice([1, 2, 3, 4, 7, 20, 100]))


def rows_of(recording: Recording, factor: int, stretch: tuple[float, int]) -> slice:
    begin = factor * int(stretch[0] * (len(recording) // factor))
    return slice(begin, begin + factor * stretch[1])


def bumped(name: str, parts: Sequence[tuple[tuple[float, int], float, Array]]) -> Shake:
    """Add to a channel, over each stretch, a vector of a length along a direction (3,)."""

    def shake(recording: Recording, factor: int) -> Recording:
        if name not in recording.channels:
            return recording
        values = np.array(recording.channels[name])
        for stretch, length, direction in parts:
            aside = direction[: values.shape[1]]
            values[rows_of(recording, factor, stretch)] += length * aside / np.linalg.norm(aside)
        return changed(recording, **{name: values})

    return shake


def twice(name: str, rng: np.random.Generator, size: float) -> Shake:
    """Add a vector of up to `size` to a channel over two stretches, of two sizes."""
    return bumped(name, [(window(rng), sized(rng, 1e-6 * size, size), rng.standard_normal(3)) for _ in range(2)])


def scattered(rng: np.random.Generator, scene: Scene) -> Shake:
    """Change IHIP or force in single ticks here and there by about as much: of several faults one is the worst."""
    name, length = str(rng.choice(ANSWERS[:2])), sized(rng, 1e-6, 0.3) * scene.model.size
    length *= scene.stiffness if name == "force" else 1.0
    ticks = [(float(rng.uniform()), int(rng.integers(1, 4))) for _ in range(int(rng.integers(3, 9)))]
    return bumped(name, [(tick, float(rng.uniform(0.5, 1.0)) * length, rng.standard_normal(3)) for tick in ticks])


def late(rng: np.random.Generator, scene: Scene) -> Shake:
    """Shift a channel by ticks, whole or not."""
    name, ticks = str(rng.choice(ANSWERS[:4])), float(rng.integers(1, 5))
    ticks = ticks if rng.integers(2) else float(rng.uniform(0.1, 3.9))

    def shake(recording: Recording, factor: int) -> Recording:
        if name not in recording.channels:
            return recording
        values, rows = recording.channels[name], np.maximum(np.arange(len(recording)) - factor * ticks, 0.0)
        before = np.floor(rows).astype(int)
        share = (rows - before)[:, np.newaxis]
        after = np.minimum(before + 1, len(recording) - 1)
        return changed(recording, **{name: (1.0 - share) * values[before] + share * values[after]})

    return shake


def at_borders(rng: np.random.Generator, scene: Scene) -> Shake:
    """Let go, hold or push for a tick or two beside those in which a contact, or the run, begins or ends."""
    share, offset, count = float(rng.uniform()), int(rng.integers(-5, 6)), int(rng.integers(1, 3))
    name, kind = str(rng.choice(ANSWERS[:2])), str(rng.choice(["let go", "hold", "push"]))
    aside = rng.standard_normal(3) * sized(rng, 1e-5, 0.1) * scene.model.size
    aside *= scene.stiffness if name == "force" else 1.0

    def shake(recording: Recording, factor: int) -> Recording:
        if name not in recording.channels or "hip" not in recording.channels:
            return recording
        borders = np.concatenate([[0], np.flatnonzero(np.diff(recording.contact)) + 1, [len(recording)]])
        border = int(borders[int(share * borders.size)]) + factor * offset
        begin = min(max(border, 0), len(recording) - 1)
        rows, values = slice(begin, begin + factor * count), np.array(recording.channels[name])
        if kind == "push":
            values[rows] += aside[: values.shape[1]]
        elif kind == "hold":
            values[rows] = values[max(begin - 1, 0)]
        else:
            values[rows] = 0.0 if name == "force" else recording.hip[rows]
        return changed(recording, **{name: values})

    return shake


def rounded(rng: np.random.Generator, scene: Scene) -> Shake:
    """Write a channel in steps, or in single precision."""
    name, share, single = str(rng.choice(("hip", *ANSWERS[:4]))), sized(rng, 1e-9, 1e-2), bool(rng.integers(2))

    def shake(recording: Recording, factor: int) -> Recording:
        if name not in recording.channels:
            return recording
        values = recording.channels[name]
        step = share * float(np.abs(values).max())
        coarse = values.astype(np.float32).astype(float) if single or step == 0.0 else step * np.rint(values / step)
        return changed(recording, **{name: coarse})

    return shake


def cut(rng: np.random.Generator, scene: Scene) -> Shake:
    """Leave out rows at the beginning and at the end: a few, or up to half."""
    few = bool(rng.integers(2))
    first, last = (int(rng.integers(0, 6)) if few else float(rng.uniform(0.0, 0.5)) for _ in range(2))

    def shake(recording: Recording, factor: int) -> Recording:
        ticks = len(recording) // factor
        begin, end = (int(part * ticks) if isinstance(part, float) else part for part in (first, last))
        rows = slice(factor * begin, max(len(recording) - factor * end, factor * begin + 2))
        return recording.part(rows) if rows.stop <= len(recording) else recording

    return shake


def scaled(rng: np.random.Generator, scene: Scene) -> Shake:
    """Make the force larger or smaller, from some place on."""
    begin, factors = (float(rng.uniform()) if rng.integers(2) else 0.0), rng.choice([-1.0, 1.0])
    share = 1.0 + factors * sized(rng, 1e-6, 0.9)

    def shake(recording: Recording, factor: int) -> Recording:
        if "force" not in recording.channels:
            return recording
        force = np.array(recording.force)
        force[int(begin * len(force)) :] *= share
        return changed(recording, force=force)

    return shake


def turned(rng: np.random.Generator, scene: Scene) -> Shake:
    """Turn the force in the plane of the first two axes, from some place on."""
    begin = float(rng.uniform()) if rng.integers(2) else 0.0
    angle = float(rng.choice([-1.0, 1.0])) * sized(rng, 1e-5, 1.5)

    def shake(recording: Recording, factor: int) -> Recording:
        if "force" not in recording.channels or recording.force.shape[1] < 2:
            return recording
        force = np.array(recording.force)
        rows = slice(int(begin * len(force)), None)
        turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        force[rows, :2] = force[rows, :2] @ turn
        return changed(recording, force=force)

    return shake


def dropped(rng: np.random.Generator, scene: Scene) -> Shake:
    """Let go for a stretch: no force, and the IHIP at the HIP."""
    stretch = window(rng)

    def shake(recording: Recording, factor: int) -> Recording:
        rows, answers = rows_of(recording, factor, stretch), {}
        for name, there in (("force", 0.0), ("ihip", recording.hip)):
            if name in recording.channels:
                answers[name] = np.array(recording.channels[name])
                answers[name][rows] = there if isinstance(there, float) else there[rows]
        return changed(recording, **answers)

    return shake


def still(rng: np.random.Generator, scene: Scene) -> Shake:
    """Hold all channels, or the answer alone, as they are at the beginning of a stretch."""
    stretch, names = window(rng), ANSWERS if rng.integers(2) else ANSWERS[:2]

    def shake(recording: Recording, factor: int) -> Recording:
        rows, answers = rows_of(recording, factor, stretch), {}
        for name in (name for name in names if name in recording.channels):
            answers[name] = np.array(recording.channels[name])
            answers[name][rows] = answers[name][rows.start]
        return changed(recording, **answers)

    return shake


def forgotten(rng: np.random.Generator, scene: Scene) -> Shake:
    name = str(rng.choice(ANSWERS[:5]))
    return lambda recording, factor: changed(recording, **{name: None}) if name in recording.channels else recording


def declaring(rng: np.random.Generator, scene: Scene) -> Shake:
    name, size = str(rng.choice(["standoff", "resolution"])), sized(rng, 1e-6, 0.1) * scene.model.size
    return lambda recording, factor: changed(recording, meta={name: size})


def shifted(rng: np.random.Generator, scene: Scene) -> Shake:
    """Move the hand by as much in every row: deeper, or out."""
    aside = rng.standard_normal(3)
    aside *= sized(rng, 1e-7, 0.05) * scene.model.size / np.linalg.norm(aside)
    return lambda recording, factor: changed(recording, hip=recording.hip + aside[: recording.dimension])


def noisy(rng: np.random.Generator, scene: Scene) -> Shake:
    name, size, seed = str(rng.choice(ANSWERS[:4])), sized(rng, 1e-9, 1e-2), int(rng.integers(1000))

    def shake(recording: Recording, factor: int) -> Recording:
        if name not in recording.channels:
            return recording
        values = recording.channels[name]
        noise = size * np.abs(values).max() * np.random.default_rng(seed).standard_normal(values.shape)
        return changed(recording, **{name: values + noise})

    return shake


def timed(rng: np.random.Generator, scene: Scene) -> Shake:
    """Make all of it slower or faster, the velocity too where it was recorded."""
    share = sized(rng, 0.2, 5.0)

    def shake(recording: Recording, factor: int) -> Recording:
        kept = dict(recording.channels)
        if "velocity" in kept:
            kept["velocity"] = kept["velocity"] / share
        return Recording(share * recording.time, kept, recording.meta, signals=recording.signals)

    return shake


def sourced(rng: np.random.Generator, scene: Scene) -> Shake:
    meta = {"source": str(rng.choice(["playback", "experiment", "replay"]))}
    return lambda recording, factor: changed(recording, meta=meta)


def moved_answer(rng: np.random.Generator, scene: Scene) -> Shake:
    return twice("ihip", rng, 0.3 * scene.model.size)


def moved_hand(rng: np.random.Generator, scene: Scene) -> Shake:
    return twice("hip", rng, 0.1 * scene.model.size)


def kicked(rng: np.random.Generator, scene: Scene) -> Shake:
    return twice("force", rng, sized(rng, 1e-3, 1.0) * scene.stiffness * scene.model.size)


def pushed(rng: np.random.Generator, scene: Scene) -> Shake:
    return twice("operator_force", rng, sized(rng, 1e-3, 1.0) * scene.stiffness * scene.model.size)


def thrown(rng: np.random.Generator, scene: Scene) -> Shake:
    return twice("velocity", rng, 1.0)


SHAKES = (
    *(late, cut, scaled, turned, dropped, still, forgotten, declaring, shifted, noisy, timed, sourced),
    *(moved_answer, moved_hand, kicked, pushed, thrown, scattered, at_borders, rounded),
)


def shaken(runs: Runs, scene: Scene, seed: int) -> Runs:
    """Return runs with one or two shakes: of the one that is judged, or of all its siblings alike."""
    rng = np.random.default_rng(seed)
    shakes = [make(rng, scene) for make in rng.choice(np.array(SHAKES, dtype=object), int(rng.integers(1, 3)))]
    alone = bool(rng.integers(2))

    def shake(recording: Recording | None, factor: int = 1) -> Recording | None:
        for change in shakes if recording is not None else ():
            recording = change(recording, factor)
        return recording

    base = shake(runs.base)
    assert base is not None
    look = None if rng.integers(2) else runs.look
    siblings: dict[str, Any] = {}
    for name in OF_RUNS if not alone else ():
        make = getattr(runs, name)
        if make is not None:
            siblings[name] = _wrapped(make, shake, name)
    return replace(runs, base=base, look=look, **siblings)


def _wrapped(make: Callable[..., Any], shake: Callable[..., Any], name: str) -> Callable[..., Any]:
    rows = {"refine": lambda arguments: arguments[0], "subdivided": lambda arguments: 2}.get(name, lambda arguments: 1)
    return lambda *arguments: shake(make(*arguments), rows(arguments))


def off_by_rounding(runs: Runs) -> Runs:
    """Return runs whose numbers are off by a few units in the last place; equal ones stay equal."""

    def shake(recording: Recording | None, factor: int = 1) -> Recording | None:
        if recording is None:
            return None
        channels = {
            name: values * (1.0 + 2.0**-50 * np.sin(1e6 * values)) for name, values in recording.channels.items()
        }
        return changed(recording, **channels)

    base = shake(runs.base)
    assert base is not None
    siblings = {name: _wrapped(getattr(runs, name), shake, name) for name in OF_RUNS if getattr(runs, name) is not None}
    return replace(runs, base=base, **siblings)
