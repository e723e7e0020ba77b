"""Order of effects: each works on the answer that those before it in the catalogue have made."""

from __future__ import annotations

import numpy as np

from hapticeval.effects.catalogue import BUMP_MAP, FRICTION, SHADING, STOCHASTIC_TEXTURE
from hapticeval.phenomena.check import Check, Runs, required, without_ihip
from hapticeval.phenomena.decisions import LAG_TICKS, TOLD_APART
from hapticeval.phenomena.observed import Observed
from hapticeval.phenomena.sampling import worst_row
from hapticeval.phenomena.verdict import Finding, compared, not_applicable, undecided
from hapticeval.scene import Scene
from hapticeval.types import Array, BoolArray

BEFORE_FRICTION = (SHADING, BUMP_MAP)
"""Effects that take their turn before friction and leave the IHIP on the surface."""


def judge(runs: Runs, scene: Scene) -> Finding:
    """Compare what the later of friction and another effect adds to the answer of the earlier one with its law."""
    base = runs.observed(scene)
    others = scene.answer_effects_except(FRICTION)
    if len(others) != 1 or others[0] not in (*BEFORE_FRICTION, STOCHASTIC_TEXTURE):
        listed_effects = ", ".join((*BEFORE_FRICTION, STOCHASTIC_TEXTURE))
        message = f"it is asked of friction and one of {listed_effects}, not of {others or 'it alone'}"
        return not_applicable(message)
    if base.lacks_ihip:
        return without_ihip(base)
    # The catalogue's order: shading and bump maps, friction, texture.
    first, last = (FRICTION, STOCHASTIC_TEXTURE) if others[0] == STOCHASTIC_TEXTURE else (others[0], FRICTION)
    plain = Observed(required(runs.without)(last), scene)
    pressed = base.pressed & plain.pressed
    # A late renderer's queue is not filled before.
    pressed[:LAG_TICKS] = False
    strength = np.maximum(*(recording.force_size for recording in (base, plain)))
    allowed = base.rounding_floor(strength, scene.stiffness) + base.force_floor
    deviation, added = (
        _vibration_deviation(base, plain) if last == STOCHASTIC_TEXTURE else _drag_deviation(base, plain, pressed)
    )
    if not (pressed & (added > TOLD_APART * allowed)).any():
        return undecided(f"the {last} adds nothing to be told from rounding, where the tool is pressed")
    worst = worst_row(np.where(pressed, deviation - allowed, -np.inf))
    return compared(
        CHECK.measured(deviation[worst]),
        float(allowed[worst]),
        base.evidence_at(worst),
        passes=f"the {last} works on what the {first} has made",
        fails=(
            f"the {last} does not work on what the {first} has made: the force is {deviation[worst]:.3g} N off at "
            f"t = {base.time[worst]:.4g} s; in the catalogue the {first} comes first"
        ),
    )


def _drag_deviation(base: Observed, plain: Observed, pressed: BoolArray) -> tuple[Array, Array]:
    """Return how far the force is off F + K (s - p), and how much K (s - p) is, (n,), N.

    F and p are force and IHIP without friction. Of lags between force and IHIP the one counts that fits best.
    """
    fits = []
    for lag in range(-LAG_TICKS, LAG_TICKS + 1):
        rows = np.clip(np.arange(len(base)) - lag, 0, len(base) - 1)
        # K (s - p): what friction adds, which draws the IHIP from p to s
        drag = base.scene.stiffness * (base.ihip - plain.ihip)[rows]
        deviation = np.linalg.norm(base.force - plain.force - drag, axis=1)
        fits.append(
            (
                float(deviation[pressed].mean()) if pressed.any() else 0.0,
                abs(lag),
                deviation,
                np.linalg.norm(drag, axis=1),
            )
        )
    # The best fit, and of several alike the shortest lag.
    _, _, deviation, added = min(fits, key=lambda fit: fit[:2])
    return deviation, added


def _vibration_deviation(base: Observed, plain: Observed) -> tuple[Array, Array]:
    """Return what vibrations add across their direction, with K times how far they move the IHIP, and all they add."""
    scene = base.scene
    added = base.force - plain.force
    normal = base.boundary.closest_point(base.ihip).normal
    across = np.sum(added * normal, axis=1)[:, np.newaxis] * normal
    # What vibrations add beside their own direction is another effect's work.
    aside = added - across if scene.effect(STOCHASTIC_TEXTURE).direction == "normal" else across
    moved = scene.stiffness * np.linalg.norm(base.ihip - plain.ihip, axis=1)
    return np.linalg.norm(aside, axis=1) + moved, np.linalg.norm(added, axis=1)


CHECK = Check(
    id="effects-order",
    phenomenon="none of the six: effects of the surface, thesis 4.3",
    formula="F = F without friction + K (s - p); F - F without texture along the texture's direction, and s the same",
    citation="thesis 4.3",
    channels=("hip", "ihip", "force"),
    siblings={"without": "the same path in the scene without the later of the two effects"},
    needs={"without": undecided("the force without one of the effects is not known: the hand is led along no path")},
    effects=(FRICTION,),
    metric="force off what the later effect makes of the earlier one's answer",
    unit="N",
    judge=judge,
)
