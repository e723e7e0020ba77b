"""How far a renderer's answers are from a reference's: IHIP, direction of the force, and the force itself."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from hapticeval.bench.workload import Workload
from hapticeval.playback import ask, play, start
from hapticeval.renderer import Renderer
from hapticeval.types import Array

FORCE_DEPTH = 1e-6
"""Depth (m) whose spring force is the least that has a direction."""

METRICS: Mapping[str, str] = {"ihip": "m", "normal": "degrees", "force": "N"}
STATISTICS = ("rms", "p99", "max")

Errors = dict[str, dict[str, float]]
"""By metric and statistic."""


@dataclass(frozen=True, eq=False)
class Answers:
    """A renderer's IHIPs (n, 2), m, and forces (n, 2), N: for each point of a workload, then along its slide."""

    ihip: Array
    force: Array


def answers(renderer: Renderer, work: Workload) -> Answers:
    """Ask a renderer for all of a workload. Every point is a run of its own, for one with memory as for any.

    Raises `RendererError` as `playback.play` does.
    """
    ihips, forces = np.empty_like(work.points), np.empty_like(work.points)
    still = np.zeros(2)
    for row, hip in enumerate(work.points):
        start(renderer, hip)
        ihips[row], forces[row] = ask(renderer, row, hip, still, work.dt)
    slid = play(renderer, work.slide, work.dt)
    return Answers(np.vstack([ihips, slid.ihip]), np.vstack([forces, slid.force]))


def errors(found: Answers, reference: Answers, *, stiffness: float) -> Errors:
    """Root mean square, 99 per cent and largest of each metric.

    A tool that is free where the reference's is in contact has its IHIP at the hand: the error counts as it is.
    Directions are compared where both forces are above the spring's force at a micrometre.
    """
    size, wanted = (np.linalg.norm(each.force, axis=1) for each in (found, reference))
    pressed = np.minimum(size, wanted) > stiffness * FORCE_DEPTH
    a, b = found.force[pressed], reference.force[pressed]
    angle = np.degrees(np.abs(np.arctan2(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0], np.sum(a * b, axis=1))))
    return {
        "ihip": _summary(np.linalg.norm(found.ihip - reference.ihip, axis=1)),
        "normal": _summary(angle),
        "force": _summary(np.linalg.norm(found.force - reference.force, axis=1)),
    }


def _summary(values: Array) -> dict[str, float]:
    if values.size == 0:
        return dict.fromkeys(STATISTICS, 0.0)
    return {
        "rms": float(np.sqrt(np.mean(values**2))),
        "p99": float(np.quantile(values, 0.99)),
        "max": float(np.max(values)),
    }
