"""The god-object against the ideal contact of a tool that weighs next to nothing: one answer, tick by tick.

A tool of mass m behind the critically damped spring of (3.1) goes after the hand at omega = sqrt(K / m). As m falls it
is at each instant where the spring's energy is least on its side of the surface: there the god-object is, (4.3). What
is left between the two is bounded by what the hand does:

- lag: the damper holds back a tool that slides faster or slower than the hand, by 2 / omega times the difference. It is
  the larger, the softer the place is, which is how much farther than the hand the tool goes. Of this first order thrice
  as much is allowed. A hand that accelerates is ahead by a / omega^2.
- flight: a tool whose velocity changes by v, where it is let go, is after it by v / (e omega) at the most; at a corner
  it is let go some way from the hand, and flies it.
- jump: a minimum on a face ends at its edge, and the tool may have all the way to the next face to go.
- force: the ideal contact's is the mean over a tick, with the damper's share in it; the god-object's is the spring's at
  the tick.

Where a minimum of the distance ends the god-object jumps (4.1.3), and the light tool takes its time. It may come down
in another minimum: then the god-object is put there, and both go on. But for such jumps they agree.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from hapticeval.geometry.mesh import Mesh
from hapticeval.recordings.recording import Recording
from hapticeval.renderer import RendererFactory
from hapticeval.scene import Scene
from hapticeval.simulation.answers import make_renderer
from hapticeval.simulation.playback import play
from hapticeval.stimulus.stimulus import Path
from hapticeval.types import Array, BoolArray

MASS = 1e-5
"""Mass of the tool, kg: behind 1000 N/m it follows within 0.3 ms."""

OFF_TIES = 1e-7 * np.sqrt([2.0, 3.0, 5.0])
"""By how much a path is shifted, m: a drawn hand may go in the very plane of a face, where rounding decides."""

LATE_TICKS = 3
"""Ticks for which an event may be ahead or late, as a contact's begin may lie just before or behind a sample."""

STEEP = 10.0
"""How much farther than the hand a tool goes from which on it counts as jumping."""

LEAST_HELD = 1e-3
"""Share of K with which a tool is held at the least: none, or less, is where a minimum of the distance ends."""

MOST_BEHIND = 1e-3
"""How far a tool may still be on its way, m, where the god-object is put beside it after a jump."""

ROUNDING = 1e-9
"""What two ways to the same place differ by at the most, m."""


class Agreement(NamedTuple):
    """What a comparison found: where the two differ, in words, and after how many jumps they came down apart."""

    differences: list[str]
    partings: int


def lengths(rows: Array) -> Array:
    """Return the length of each row (n, N)."""
    return np.asarray(np.linalg.norm(rows, axis=-1))


def widened(rows: Array, ticks: int) -> Array:
    """Return the largest of each of the rows (n,) and those up to `ticks` before and after it."""
    windows = np.lib.stride_tricks.sliding_window_view(np.pad(rows, ticks, mode="edge"), 2 * ticks + 1)
    return np.asarray(windows.max(axis=1))


def softness_of(hips: Array, tools: Array, scene: Scene) -> Array:
    """Return how much farther than the hand at `hips` (n, N), m, the tool at `tools` goes in each tick (n - 1,).

    On a curve the spring holds it with K (1 - kappa depth) alone; on a mesh, which is flat, its steps show it.
    """
    curvature = np.linalg.eigvalsh(scene.model.boundary.closest_point(tools).shape)[:, -1]
    held = np.clip(1.0 - curvature * lengths(tools - hips), LEAST_HELD, 1.0)
    hand_steps, tool_steps = lengths(np.diff(hips, axis=0)), lengths(np.diff(tools, axis=0))
    return np.asarray(np.maximum(1.0 / held[1:], tool_steps / np.maximum(hand_steps, ROUNDING)))


def bounds(god: Recording, scene: Scene, behind: float) -> tuple[Array, Array, Array]:
    """Return how far the light tool may be from the god-object (n,), m, and its force (n - 1,), N; and jumps (n,).

    At the start the tool is `behind` by some m.
    """
    omega, dt = np.sqrt(scene.stiffness / scene.mass), god.dt
    hand, tool = np.diff(god.hip, axis=0), np.diff(god.ihip, axis=0)
    hand_steps, tool_steps = lengths(hand), lengths(tool)
    along = np.einsum("ij,ij->i", hand, tool) / np.maximum(tool_steps, ROUNDING)
    softness = softness_of(god.hip, god.ihip, scene)
    turns, kinks = (np.pad(lengths(np.diff(steps, axis=0)), (0, 1), mode="edge") for steps in (hand, tool))
    lag = softness * (6.0 / (omega * dt) * np.abs(tool_steps - along) + turns / (omega * dt) ** 2)
    # Let go at a corner it is away from the hand by all that the god-object then goes.
    touches = lengths(god.ihip - god.hip) > 0.0
    lag += np.where(touches[:-1] & ~touches[1:], tool_steps, 0.0)
    # A change within a tick shows in two differences: half of it is above v / (e omega) dt.
    # A minimum on a face ends at its edge, and the light tool may have all the jump to the next face to go.
    has_edges = isinstance(scene.model.boundary, Mesh) or len(scene.model.boundary.corners) > 0
    still_to_go = kinks if has_edges else kinks / (omega * dt)
    apart = widened(np.r_[lag[:1], lag + still_to_go], LATE_TICKS)
    # It dies away at omega / 2, or where the tool is held less at less.
    dying = np.exp(-0.5 * omega * dt / softness)
    apart[0] = max(apart[0], behind)
    for row in range(1, len(apart)):
        apart[row] = max(apart[row], apart[row - 1] * dying[row - 1])
    apart += ROUNDING
    # A spring that does not grow evenly within the tick: where contact begins or ends, and on what is curved.
    bends = np.pad(lengths(np.diff(god.ihip - god.hip, n=2, axis=0)), 1, mode="edge")
    share = 1.0 + 2.0 / (omega * dt)
    blow = scene.mass * widened(tool_steps + hand_steps, 1) / dt**2
    weaker = scene.stiffness * share * (apart + widened(bends, 1))[:-1] + blow
    return apart, weaker, np.r_[False, softness > STEEP]


def compare(case_scene: Scene, path: Path, god_object: RendererFactory, ideal: RendererFactory) -> Agreement:
    """Compare the god-object with the ideal contact of a light tool along a path in the frame of the body."""
    scene = replace(case_scene, mass=MASS)
    dt = scene.sampling_time
    _, hips = path.sampled(dt)
    hips = hips + OFF_TIES[: hips.shape[1]]
    times = dt * np.arange(len(hips))
    truth = play(make_renderer(ideal, scene), Path(times, hips), dt)
    steep = (softness_of(hips, truth.ihip, scene) > STEEP).astype(np.float64)
    renderer = make_renderer(god_object, scene)
    damper, first, partings = 2.0 * np.sqrt(scene.stiffness * MASS), 0, 0
    while True:
        # A later start is where the light tool is, a rounding outside: from there the hand goes in.
        stretched = truth.ihip[first] - hips[first]
        start = truth.ihip[first] + ROUNDING * stretched / max(float(lengths(stretched)), ROUNDING)
        led = np.vstack([start if first else hips[0], hips[first + (first == 0) :]])
        god, skipped = play(renderer, Path(dt * np.arange(len(led)), led), dt), int(first > 0)
        places = lengths(god.ihip[skipped:] - truth.ihip[first:])
        apart, weaker, jumps = bounds(god, scene, min(float(places[0]), MOST_BEHIND) if first else 0.0)
        spring = 0.5 * (god.force[1:] + god.force[:-1])
        drag = damper * np.diff(god.hip - god.ihip, axis=0) / dt
        forces = lengths((spring - drag)[skipped:] - truth.force[first:-1])
        off: BoolArray = places > apart[skipped:]
        off[:-1] |= forces > weaker[skipped:]
        if not off.any():
            return Agreement([], partings)
        row = int(np.argmax(off))
        # A light tool may hang for long at a minimum that has ended: jumps since the two were last together count.
        together = np.flatnonzero(places[:row] <= MOST_BEHIND)
        since = min(int(together[-1]) if together.size else 0, row - 2 * LATE_TICKS - 1)
        near = slice(max(since + skipped, 0), row + skipped + LATE_TICKS + 1)
        # The god-object has gone on, or the light tool stands where a minimum has ended.
        if not (jumps[near].any() or steep[first + max(since, 0) : first + row + 1].any()):
            force = f"{forces[row]:.3g} N, of {weaker[skipped:][row]:.3g} N" if row < len(forces) else ""
            return Agreement(
                [
                    f"at t = {times[first + row]:.3f} s the two are {1e3 * places[row]:.3g} mm apart, where "
                    f"{1e3 * apart[skipped:][row]:.3g} mm are explained; {force}"
                ],
                partings,
            )
        # Where a minimum has just ended the tool takes its time to leave: on from where it is held again.
        partings += 1
        held_again = np.flatnonzero(widened(steep, LATE_TICKS)[first + row + 2 * LATE_TICKS :] == 0.0)
        if held_again.size == 0:
            return Agreement([], partings)
        first += row + 2 * LATE_TICKS + int(held_again[0])
