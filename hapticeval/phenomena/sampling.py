"""What the sampling of a recording allows to be told apart: the tolerances that every bound is made of."""

from __future__ import annotations

import numpy as np

from hapticeval.recordings.recording import Recording
from hapticeval.scene import Scene
from hapticeval.types import Array, BoolArray

LAG_TICKS = 3
"""A proxy may answer up to three ticks late without being wrong, as peers do."""

FORCE_DEPTH = 1e-6
"""Depth (m) whose spring force is the floor under which a force has no direction worth judging."""


def hip_steps(recording: Recording) -> Array:
    """Distance that the HIP moves from each sample to the next: (n - 1,), m."""
    return np.asarray(np.linalg.norm(np.diff(recording.hip, axis=0), axis=1))


def hip_step(recording: Recording) -> float:
    """The largest HIP step of a recording, m: nothing finer can be placed on the surface."""
    steps = hip_steps(recording)
    return float(steps.max()) if steps.size else 0.0


def placement(recording: Recording) -> float:
    """How well a contact point can be placed: three ticks of lag and the declared standoff, m."""
    return LAG_TICKS * hip_step(recording) + recording.standoff


def touching(recording: Recording, scene: Scene) -> BoolArray:
    """Where the tool is in contact, (n,): on a bilateral constraint always, also where no force is called for."""
    return np.ones(len(recording), dtype=bool) if scene.bilateral else recording.contact


def force_floor(scene: Scene) -> float:
    """Below this force (N) no direction is judged: the spring's force at a depth of one micrometre."""
    return scene.stiffness * FORCE_DEPTH


def loaded(recording: Recording, scene: Scene) -> BoolArray:
    """Where the force is above the floor: (n,)."""
    strong: BoolArray = np.linalg.norm(recording.force, axis=1) > force_floor(scene)
    return strong


def place(recording: Recording, tick: int) -> dict[str, object]:
    """Evidence: when and where a sample is, as JSON values."""
    return {
        "time": float(recording.time[tick]),
        "tick": int(tick),
        "hip": [float(x) for x in recording.hip[tick]],
        "ihip": [float(x) for x in recording.ihip[tick]],
    }
