"""Height and bump maps along the path: the force and the IHIP of every tick are those that the scene's relief makes."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from hapticeval.effects.catalogue import BUMP_MAP, HEIGHT_MAP
from hapticeval.effects.effect import Stage
from hapticeval.phenomena.check import Check, Runs, not_alone, nothing_pressed
from hapticeval.phenomena.decisions import TELLING_SHARE
from hapticeval.phenomena.lag import beside_straight, resting_ticks
from hapticeval.phenomena.measures.effect_law import EffectLaw
from hapticeval.phenomena.observed import Observed
from hapticeval.phenomena.sampling import lengths_of, steps_to, worst_row
from hapticeval.phenomena.verdict import Finding, Metric, compared, undecided
from hapticeval.scene import Scene
from hapticeval.types import Array


class Deviation(NamedTuple):
    """The tick at which a channel is farthest off the law: by how much, what is allowed there, and its lag (ticks).

    `share` is how much of what the relief adds the channel shows over all ticks: 1 where it is right, 0 without one,
    and None where it adds nothing.
    """

    channel: str
    tick: int
    off: float
    allowed: float
    lag: float
    share: float | None

    @property
    def ratio(self) -> float:
        """How many times what is allowed it is off."""
        return self.off / self.allowed


def judge(runs: Runs, scene: Scene) -> Finding:
    """Compare force and IHIP of every tick with those that the relief makes of the path."""
    base = runs.observed(scene)
    relief: Any = next(effect for effect in scene.effects if effect.kind in CHECK.effects)
    reason = not_alone(scene, relief.kind, because="whose force is another") or nothing_pressed(base)
    if reason is not None:
        return reason
    plain = None if runs.without is None else Observed(runs.without(relief.kind), scene)
    if plain is None and scene.damping > 0.0:
        return undecided("the force without the relief is not known: the hand is not led along a path that we give")
    if any(effect.stage is Stage.SENSE for effect in scene.effects):
        return undecided("the renderer answers what its sensors show, and not where the hand is")
    law = EffectLaw(relief, base, plain)
    force = _deviation(law, "force", relief)
    # A bump map turns the force alone: its IHIP is compared where it is known without the relief, and well enough.
    ihip = _deviation(law, "ihip", relief) if plain is not None or law.raises else None
    if force is None or (ihip is None and law.raises):
        return undecided("what the relief changes is smaller than what rounding and the declared lengths leave open")
    worst = force
    # An IHIP that is off beside a force of twice what is allowed is of the same fault.
    if ihip is not None and force.ratio < 2.0 and ihip.ratio > force.ratio:
        worst = ihip
    amount = f"{worst.off:.3g} N" if worst.channel == "force" else f"{1e6 * worst.off:.3g} um"
    evidence = base.evidence_at(worst.tick)
    if worst.share is None:
        share_shown = f"a {relief.kind} leaves it where it is"
    else:
        evidence["share"] = worst.share
        share_shown = f"over all ticks the {worst.channel} shows {worst.share:.2g} of what the relief adds"
    right_channels = "the force is that" if ihip is None else "force and IHIP are those"
    return compared(
        Metric(f"{worst.channel} off that of the relief", worst.off, "N" if worst.channel == "force" else "m"),
        worst.allowed,
        {**evidence, "lag_ticks": worst.lag},
        passes=f"{right_channels} of the {relief.kind} in every tick",
        fails=(
            f"the {worst.channel} is {amount} off that of the {relief.kind} at t = {base.time[worst.tick]:.4g} s (tick "
            f"{worst.tick}); {share_shown}"
        ),
    )


def _deviation(law: EffectLaw, channel: str, relief: Any) -> Deviation | None:
    """Compare a channel with the law at its one lag; None where the relief is hidden by what is open."""
    base, rows, lags = law.base, law.known_rows, law.find_lags(channel)
    answers = law.answers(lags)
    right, bare = (answers.force, answers.bare_force) if channel == "force" else (answers.ihip, answers.bare_ihip)
    # A proxy that moves in every second tick only answers the HIP of the tick before while it rests.
    doubt = law.rounding + base.believed_standoff + base.resolution + resting_ticks(base.ihip) * steps_to(base.hip)
    late: Array | float = 0.0
    if law.between_ticks(lags):  # what is between two ticks may be the HIP, or the answer
        doubt, late = doubt + beside_straight(base.hip), beside_straight(right)
    per_metre = base.scene.stiffness if channel == "force" else 1.0
    allowed = law.steepness(channel, lags) * doubt + late + base.rounding_floor(lengths_of(right), per_metre)
    # What the relief adds, and how much of it the channel shows: <recorded - bare, change> / |change|^2
    change = (right - bare)[rows]
    changes = bool(change.any())
    # Ticks in which a tenth of the relief's largest effect can be told: of an IHIP that it leaves, of its height.
    clear = allowed[rows] <= TELLING_SHARE * (float(lengths_of(change).max()) if changes else relief.highest)
    if not clear.any():
        return None
    recorded = base.channels[channel]
    deviation = np.where(clear, lengths_of(recorded - right)[rows], 0.0)
    # Of a channel that is right to the last digit the tick counts in which the relief changes most.
    worst = worst_row(deviation / allowed[rows] if deviation.any() else np.where(clear, lengths_of(change), -1.0))
    share = float(np.sum((recorded - bare)[rows] * change) / np.sum(change**2)) if changes else None
    tick = int(law.rows[rows][worst])
    return Deviation(channel, tick, float(deviation[worst]), float(allowed[tick]), lags.hip or lags.ihip, share)


CHECK = Check(
    id="texture-relief",
    phenomenon="none of the six: height and bump maps, thesis 4.3.2",
    formula="F = K (d + h)(n - (I - d W)^-1 grad h), IHIP = foot + h n; a bump map: F_n along unit(n - grad h)",
    citation="thesis 4.3.2, (4.16)",
    channels=("hip", "ihip", "force"),
    siblings={"without": "the same path in the scene without the relief"},
    effects=(HEIGHT_MAP, BUMP_MAP),
    metric="force off that of the relief",
    unit="N",
    judge=judge,
)
