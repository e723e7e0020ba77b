"""What all checks of friction open with: that the force along the surface is friction's alone; a lag is granted."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from hapticeval.effects.catalogue import FRICTION, LUGRE, VISCOUS_FRICTION
from hapticeval.phenomena.check import Check, Runs, not_alone, nothing_pressed
from hapticeval.phenomena.decisions import LAG_TICKS
from hapticeval.phenomena.lag import beside_straight, delayed, likely_force_lags
from hapticeval.phenomena.measures.surface_force import SurfaceForce, surface_force_of
from hapticeval.phenomena.verdict import Finding, Outcome, not_applicable
from hapticeval.quantity import plural
from hapticeval.scene import Scene

FRICTIONS = (FRICTION, VISCOUS_FRICTION, LUGRE)
"""The effects that brake a tool along the surface."""

LAWS_OF_SPEED = (VISCOUS_FRICTION, LUGRE)
"""Those whose force is a law of the hand's speed: the tool does not stay behind."""

HAND = ("hip", "velocity")
"""The channels that are of the hand, and so on time."""


def check_of_friction(
    judge: Callable[[Runs, SurfaceForce, Scene], Finding],
    *,
    damped: bool = True,
    on_time: tuple[tuple[str, ...], ...] = (),
    **data: Any,
) -> Check:
    """Return a check of friction: it opens as all of them do, and then asks `judge`, which is given the force's parts.

    - `damped`: it is asked of a scene with a damper too.
    - `on_time`: the channels that may be on time where the others are late, see `judge_with_lag`.
    """

    def judge_friction(runs: Runs, scene: Scene) -> Finding:
        because = "whose force along the surface is no friction"
        reason = not_alone(scene, *FRICTIONS, because=because) or nothing_pressed(runs.observed(scene))
        if reason is None and not damped and scene.damping > 0.0:
            reason = not_applicable(f"a damper of {scene.damping:g} N s/m brakes the tool too")
        return reason or judge_with_lag(
            runs, lambda runs, surface_force: judge(runs, surface_force, scene), on_time, scene
        )

    data = {"effects": (FRICTION,), "unit": ""} | data
    return Check(judge=judge_friction, channels=("hip", "ihip", "force"), reads_also=("velocity",), **data)


def judge_with_lag(
    runs: Runs, judge: Callable[[Runs, SurfaceForce], Finding], on_time: tuple[tuple[str, ...], ...], scene: Scene
) -> Finding:
    """Judge a recording, and where it fails, one with channels held back by up to three ticks: a lag is granted.

    Each of `on_time` are channels that may be on time where the others are late. A renderer that is late gives and
    takes energy for that alone: see `passivity`. Where all fail, the finding is that without a lag.
    """
    finding = judge(runs, surface_force_of(runs.observed(scene)))
    if finding.outcome is not Outcome.FAIL or not on_time:
        return finding
    for lag in range(1, LAG_TICKS + 1):
        for names in on_time:
            # Held back by `lag` rows, so that they meet the late ones.
            held_back = _hold_back(runs, dict.fromkeys(names, float(lag)))
            again = judge(held_back, surface_force_of(held_back.observed(scene)))
            if again.outcome is Outcome.PASS:
                # The answer's channels that were not held back are those that are late.
                late_channels = [word for name, word in (("ihip", "IHIP"), ("force", "force")) if name not in names]
                late_words = f"{' and '.join(late_channels)} {'are' if len(late_channels) > 1 else 'is'}"
                return replace(again, message=f"{again.message}; the {late_words} {plural(lag, 'tick')} late")
    return _judge_between_ticks(runs, judge, scene) or finding


def _judge_between_ticks(runs: Runs, judge: Callable[[Runs, SurfaceForce], Finding], scene: Scene) -> Finding | None:
    """Return a pass with the answers earlier by one lag between two ticks; None where the law is kept with none.

    The hand stays as it is, so that its laps close.
    """
    for hip, ihip in likely_force_lags(runs.base, runs.observed(scene).pressed):
        early = _hold_back(runs, {"force": -hip, "ihip": ihip - hip})
        # Between ticks it is not known which values the renderer had.
        open_between_ticks = np.maximum(
            *(
                beside_straight(base.force) + scene.stiffness * beside_straight(base.ihip)
                for base in (runs.base, early.base)
            )
        )
        finding = judge(early, surface_force_of(early.observed(scene), open_between_ticks))
        if finding.outcome is Outcome.PASS:
            return replace(finding, message=f"{finding.message}; the answer is {max(hip, -ihip):.2g} ticks late")
    return None


def _hold_back(runs: Runs, ticks: Mapping[str, float]) -> Runs:
    """Return the runs with some channels of the base held back by so many ticks each; a negative number is earlier."""
    base = runs.base
    rows = np.arange(len(base), dtype=np.int64)
    channels = {name: delayed(base.channels[name], rows, late) for name, late in ticks.items() if name in base.channels}
    return replace(runs, base=base.with_channels(**channels))
