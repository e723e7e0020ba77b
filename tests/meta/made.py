"""Recordings made by hand, and checks asked about them."""

from __future__ import annotations

from typing import Any

import numpy as np

from hapticeval.phenomena.check import Runs
from hapticeval.phenomena.registry import CHECKS
from hapticeval.phenomena.verdict import Finding, Outcome
from hapticeval.recordings.recording import Recording
from hapticeval.scene import Scene

STIFFNESS = 1000.0
PASS, FAIL, UNDECIDED, NO = Outcome.PASS, Outcome.FAIL, Outcome.INCONCLUSIVE, Outcome.NOT_APPLICABLE


def recorded(
    hip: Any, ihip: Any = None, force: Any = None, *, dt: float = 1e-3, meta: Any = None, **more: Any
) -> Recording:
    """A recording of HIPs (n, N); the IHIP is the HIP, and the force a spring of 1,000 N/m, where none is given."""
    hip = np.asarray(hip, dtype=np.float64)
    ihip = hip if ihip is None else np.asarray(ihip, dtype=np.float64)
    force = STIFFNESS * (ihip - hip) if force is None else force
    return Recording(dt * np.arange(len(hip)), {"hip": hip, "ihip": ihip, "force": force, **more}, meta or {})


def changed(recording: Recording, meta: Any = None, rows: slice = slice(None), **channels: Any) -> Recording:
    """The rows of a recording, with some channels or metadata replaced."""
    kept = {name: values[rows] for name, values in (dict(recording.channels) | channels).items()}
    return Recording(recording.time[rows], kept, {**recording.meta, **(meta or {})})


def found(check: str, runs: Runs | Recording, scene: Scene) -> Finding:
    """What a check finds."""
    return CHECKS[check](runs if isinstance(runs, Runs) else Runs(runs), scene)


def outcome(check: str, runs: Runs | Recording, scene: Scene) -> Outcome:
    return found(check, runs, scene).outcome
