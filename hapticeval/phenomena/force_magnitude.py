"""Force magnitude: the force is as large as the scene's stiffness makes it at that depth, always and everywhere."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hapticeval.phenomena.check import Check, Runs
from hapticeval.phenomena.sampling import (
    LAG_TICKS,
    TELLS,
    believed_standoff,
    hip_step,
    lacks_ihip,
    loaded,
    place,
    rounding,
    standoff,
    touching,
)
from hapticeval.phenomena.verdict import Finding, Level, Metric, Outcome
from hapticeval.recordings.recording import SINGLE, Recording, backward_difference
from hapticeval.renderer import Spring
from hapticeval.scene import Scene
from hapticeval.types import Array, BoolArray, IntArray

SPIKES = 0.1
"""Ticks that are off are spikes up to this share of all: more of them are what the renderer does as a rule."""

HALF = 0.5
"""Of what nine tenths of the samples span: what makes as much of it is named."""

SOME = 8
"""So few samples make no median worth comparing."""


@dataclass(frozen=True)
class Measured:
    """The apparent stiffness, as a share of the scene's, at `ticks` (n,) of a recording.

    `ratio` is that of HIP and IHIP of the same tick; `low` and `high` are its ends over all that a lag may have done,
    and `allowed` what a damper, the way's curvature and rounding may add. `rate` is that of the depth, m/s.
    """

    ticks: IntArray
    ratio: Array
    low: Array
    high: Array
    allowed: Array
    depth: Array
    rate: Array

    @property
    def excess(self) -> Array:
        """How far a share is from one beyond what is allowed: (n,)."""
        return np.asarray(np.maximum(np.maximum(self.low - 1.0, 1.0 - self.high), 0.0) - self.allowed)

    @property
    def told(self) -> Measured:
        """The samples where what is allowed is little."""
        clear = self.allowed <= TELLS
        return Measured(*(getattr(self, name)[clear] for name in self.__dataclass_fields__))


def judge(runs: Runs, scene: Scene) -> Finding:
    """Measure the stiffness at every tick in contact, and look for what its deviations go with."""
    base = runs.base
    if not loaded(base, scene).any():
        return Finding(Outcome.INCONCLUSIVE, "no force above the floor: the tool never presses on the surface")
    declared = base.meta.get("spring")
    level = Level.MUST if declared is not None else Level.SHOULD
    if lacks_ihip(base, scene):
        return replace(_without_ihip(base, scene), level=Level.SHOULD)
    depths = np.linalg.norm(base.hip - base.ihip, axis=1)
    if not depths[loaded(base, scene)].any():
        message = "a rigid contact: its force comes without a depth, and has no stiffness that could be measured"
        return Finding(Outcome.NOT_APPLICABLE, message, level=level)
    springs = tuple(Spring) if declared is None else (Spring(declared),)
    found = [_measure(base, scene, spring).told for spring in springs]
    # One who does not declare a law is measured by the one that fits better.
    return replace(_finding(base, scene, min(found, key=_misfit)), level=level)


def _misfit(measured: Measured) -> tuple[bool, float, float]:
    off = measured.excess > 0.0
    return (not off.size, float(off.mean()) if off.size else 0.0, float(measured.excess.max(initial=0.0)))


def _measure(base: Recording, scene: Scene, spring: Spring) -> Measured:
    ticks = np.flatnonzero(touching(base, scene))
    force = base.force[ticks]
    rows = len(base)
    now = ticks

    def error(hip: IntArray, ihip: IntArray) -> Array:
        return np.asarray(base.hip[hip] - base.ihip[ihip])

    lagging = [error(now, now)]
    for lag in range(1, LAG_TICKS + 1):
        before, after = np.maximum(now - lag, 0), np.minimum(now + lag, rows - 1)
        lagging += [error(before, now), error(before, before), error(now, after)]
    shares = np.array([_share(force, each, scene.stiffness, spring) for each in lagging])
    along, depth = _along(force, lagging[0], spring)
    # A spring that gives nothing has no direction of its own: what it should have given is along the error.
    granted = LAG_TICKS * hip_step(base, scene) + believed_standoff(base, scene)
    idle = ~loaded(base, scene)[ticks] & (np.linalg.norm(lagging[0], axis=1) > granted)
    shares[:, idle] = [_share(force[idle], each[idle], scene.stiffness, Spring.ERROR) for each in lagging]
    along[idle], depth[idle] = _along(force[idle], lagging[0][idle], Spring.ERROR)
    open_ends = np.isnan(shares).any(axis=0)
    velocity = base.velocity if "velocity" in base.channels else backward_difference(base.hip, base.time)
    sinking = backward_difference(base.hip - base.ihip, base.time)[ticks]
    speed = np.abs(np.sum(along * velocity[ticks], axis=1))
    spreading = np.abs(np.sum(along * sinking, axis=1))
    allowed = scene.damping * np.maximum(speed, spreading)
    if "spring" not in base.meta:
        allowed = allowed + scene.mass * _bending(base, scene, velocity, ticks)
    apart = 4.0 * SINGLE * (float(np.max(np.abs(base.hip))) + depth)
    with np.errstate(divide="ignore"):
        allowed = (allowed / scene.stiffness + apart) / depth
    return Measured(
        ticks,
        shares[0],
        np.where(open_ends, -np.inf, shares.min(axis=0)),
        np.where(open_ends, np.inf, shares.max(axis=0)),
        allowed,
        depth,
        np.sum(along * sinking, axis=1),
    )


def _along(force: Array, error: Array, spring: Spring) -> tuple[Array, Array]:
    """The direction in which the depth is measured, (n, N), and the depth, (n,), m; zero where there is none."""
    direction = error if spring is Spring.ERROR else -force
    size = np.linalg.norm(direction, axis=1)
    unit = np.divide(direction, size[:, np.newaxis], out=np.zeros_like(direction), where=size[:, np.newaxis] > 0.0)
    return unit, np.abs(np.sum(unit * error, axis=1))


def _share(force: Array, error: Array, stiffness: float, spring: Spring) -> Array:
    """The apparent stiffness as a share of the scene's, (n,): -F.e / e^2, or F^2 / -F.e across the surface."""
    push = -np.sum(force * error, axis=1)
    above, below = (push, np.sum(error**2, axis=1)) if spring is Spring.ERROR else (np.sum(force**2, axis=1), push)
    share = np.full(push.size, np.nan)
    return np.asarray(np.divide(above, stiffness * below, out=share, where=below != 0.0))


def _bending(base: Recording, scene: Scene, velocity: Array, ticks: IntArray) -> Array:
    """|kappa| v^2 of the way along the surface (3.8), m/s^2, (n,): what the force of a law that knows it may differ by.

    With v the speed of the hand or of the IHIP, whichever is larger.
    """
    shape = scene.model.boundary.frame(base.ihip[ticks]).shape
    largest = np.max(np.abs(np.linalg.eigvalsh(shape)), axis=1)
    sliding = backward_difference(base.ihip, base.time)
    speed = np.maximum(*(np.linalg.norm(each[ticks], axis=1) for each in (velocity, sliding)))
    return np.asarray(largest * speed**2)


def _without_ihip(base: Recording, scene: Scene) -> Finding:
    """Of a force without an IHIP: against the depth of the HIP under the model, the least that any IHIP could have.

    A tool that lags behind is farther away, and makes a larger force of it: only one that is too soft is seen.
    """
    ticks = np.flatnonzero(loaded(base, scene))
    depth = np.maximum(-scene.model.boundary.signed_distance(base.hip), 0.0)
    late = np.array([depth[np.maximum(ticks - lag, 0)] for lag in range(LAG_TICKS + 1)])
    size = np.linalg.norm(base.force[ticks], axis=1)
    shares = np.divide(size, scene.stiffness * late, out=np.full(late.shape, np.inf), where=late > 0.0)
    placed = rounding(scene) + standoff(base, scene)
    velocity = base.velocity if "velocity" in base.channels else backward_difference(base.hip, base.time)
    speed = np.linalg.norm(velocity[ticks], axis=1)
    with np.errstate(divide="ignore"):
        allowed = (scene.damping * speed / scene.stiffness + placed) / late[0]
    high = shares.max(axis=0)
    rate = backward_difference(depth[:, np.newaxis], base.time)[ticks, 0]
    measured = Measured(ticks, shares[0], np.minimum(high, 1.0), high, allowed, late[0], rate).told
    note = "no IHIP was given: measured against the depth of the HIP under the model"
    finding = _finding(base, scene, measured)
    if finding.outcome is Outcome.PASS:
        message = f"the force is nowhere too small for its depth; {note}, which does not tell one that is too large"
        return replace(finding, outcome=Outcome.INCONCLUSIVE, message=message)
    return replace(finding, message=f"{finding.message} ({note})")


def _finding(base: Recording, scene: Scene, measured: Measured) -> Finding:
    if measured.ticks.size == 0:
        message = "a damper or the rounding of the numbers may make a tenth of the force or more throughout"
        return Finding(Outcome.INCONCLUSIVE, f"{message}: its stiffness cannot be told")
    excess = measured.excess
    worst = int(np.argmax(excess))
    tick = int(measured.ticks[worst])
    share = float(measured.ratio[worst])
    metric = Metric("apparent stiffness less the scene's, as a share of it", abs(share - 1.0), "")
    bound = float(measured.allowed[worst])
    low, middle, high = (scene.stiffness * float(each) for each in np.percentile(measured.ratio, (5, 50, 95)))
    deepest = int(np.argmax(measured.depth))
    size = float(np.linalg.norm(base.force[measured.ticks[deepest]]))
    evidence: dict[str, object] = {
        **place(base, tick),
        "apparent_stiffness_N_m": middle,
        "stiffness_05_N_m": low,
        "stiffness_95_N_m": high,
        "samples": int(measured.ticks.size),
        "force_N": size,
        "depth_m": float(measured.depth[deepest]),
        "depth_asked_m": size / scene.stiffness,
    }
    depth = (
        f"{size:.3g} N at {1e3 * float(measured.depth[deepest]):.4g} mm, where K = {scene.stiffness:g} N/m asks for "
        f"{1e3 * size / scene.stiffness:.4g} mm"
    )
    if excess[worst] <= 0.0:
        # Within a lag's reach the ends of the share enclose one, wherever the present HIP alone would put it.
        metric = replace(metric, value=float(np.maximum(excess + measured.allowed, 0.0)[worst]))
        message = f"the force fits the depth, with an apparent stiffness of {middle:.4g} N/m; at the deepest {depth}"
        return Finding(Outcome.PASS, message, metric, bound, evidence)
    how, more = _pattern(base, measured)
    message = (
        f"{how}: an apparent stiffness of {scene.stiffness * share:.4g} N/m at t = {base.time[tick]:.4g} s (tick "
        f"{tick}), {middle:.4g} in the middle, from {low:.4g} to {high:.4g} in nine tenths of the samples, for the "
        f"scene's {scene.stiffness:g}; at the deepest {depth}"
    )
    return Finding(Outcome.FAIL, message, metric, bound, evidence | more)


def _pattern(base: Recording, measured: Measured) -> tuple[str, dict[str, object]]:
    """What the deviations go with, in words, and the numbers that show it."""
    off = measured.excess > 0.0
    ratio = measured.ratio
    more: dict[str, object] = {"share_off": float(off.mean())}
    if off.mean() <= SPIKES:
        ticks = measured.ticks[off]
        more["spikes"] = int(ticks.size)
        gaps = np.diff(ticks)
        regular = gaps.size > 1 and gaps.mean() > 1.0 and np.ptp(gaps) <= TELLS * gaps.mean()
        every = f", every {round(gaps.mean())} ticks" if regular else ""
        return f"spikes: {ticks.size} tick{'s' if ticks.size > 1 else ''} off{every}", more
    inwards, outwards = _median(ratio, measured.rate > 0.0), _median(ratio, measured.rate < 0.0)
    time = base.time[measured.ticks]
    early, late = np.quantile(time, (0.1, 0.9))
    first, last = _median(ratio, time <= early), _median(ratio, time >= late)
    shallow, deep = np.quantile(measured.depth, (0.1, 0.9))
    above, below = _median(ratio, measured.depth <= shallow), _median(ratio, measured.depth >= deep)
    more |= {"share_inwards": inwards, "share_outwards": outwards, "share_first": first, "share_last": last}
    more |= {"share_shallow": above, "share_deep": below}
    middle = float(np.median(ratio))
    if max(abs(ratio - middle)) <= HALF * abs(middle - 1.0):
        return (
            f"{'stiffer' if middle > 1.0 else 'softer'} throughout, by {abs(1e2 * (middle - 1.0)):.3g} per cent",
            more,
        )
    named = {
        "it depends on the depth": (above, below, "where it is shallow", "where it is deep"),
        "it depends on the direction": (inwards, outwards, "on the way in", "on the way out"),
        "it drifts with time": (first, last, "at first", "in the end"),
    }
    spans = {name: abs(one - other) for name, (one, other, _, _) in named.items() if np.isfinite(one - other)}
    if spans:
        name = max(spans, key=spans.__getitem__)
        one, other, when, then = named[name]
        if spans[name] >= HALF * float(np.ptp(np.percentile(ratio, (5, 95)))):
            return f"{name} ({one:.3g} of the scene's stiffness {when}, {other:.3g} {then})", more
    return "it scatters", more


def _median(ratio: Array, where: BoolArray) -> float:
    return float(np.median(ratio[where])) if int(where.sum()) >= SOME else float("nan")


CHECK = Check(
    id="force-magnitude",
    phenomenon="none of the six: the regulation scheme's stiffness, (4.6) and (6.1)",
    asks="Is the force as large as the scene's stiffness asks for at that depth, in all directions and at all times?",
    formula="K = -F.e / e^2 with e = HIP - IHIP; along the normal, K = F^2 / (-F.e); K = K_p at every tick in contact",
    citation="thesis 4.2, (4.8), (5.21), (6.1)",
    channels=("hip", "ihip", "force", "velocity where it was recorded"),
    siblings="none",
    metric="apparent stiffness less the scene's, as a share of it",
    unit="",
    bound=(
        "Of a linear spring the force is K_p times the depth exactly, so that nothing is allowed but what is "
        "known to come on top, as a share of K_p times the depth d: a damper's K_d v, with v the speed along the "
        "direction in which the depth is measured, of the hand or of the error, whichever is larger; m kappa v^2 "
        "of the way along the surface (3.8), by HIP or IHIP, for a renderer that declares no spring; and single "
        "precision, 4 * 2^-23 (size of the coordinates / d + 1). Of HIPs and IHIPs up to three ticks apart, or "
        "both as late, any may belong to a force: K_p has to lie within what they span. Ticks where more than a "
        "tenth is allowed are not judged, nor those where a lag reaches to before the contact. A renderer may "
        "declare along what it is a spring (`Declaration`): then the level is must. Another is measured along the "
        "error or across the surface, as it fits better, and the level is should: a law that is not proportional, "
        "as the square root's, or one that knows the curvature, is no fault, but is not the scene's K_p either. A "
        "force without an IHIP is held against the depth under the model, which an honest tool's distance is "
        "never less than: too soft fails, the rest is not told. A failure says with what the deviation goes: "
        "single ticks (spikes), the depth, the direction, the time."
    ),
    judge=judge,
    level=Level.SHOULD,
)
