"""Height and bump maps along the path: the force and the IHIP of every tick are those that the scene's relief makes."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from hapticeval.effects.catalogue import BUMP_MAP, HEIGHT_MAP
from hapticeval.effects.effect import Stage
from hapticeval.phenomena.check import Check, Runs, not_alone, nothing_pressed
from hapticeval.phenomena.decisions import LAG_TICKS, TELLING_SHARE, WHOLE_LAG
from hapticeval.phenomena.lag import believed_lag, beside_straight, delayed, resting_ticks
from hapticeval.phenomena.observed import Observed
from hapticeval.phenomena.sampling import lengths_of, steps_to, worst_row
from hapticeval.phenomena.verdict import Finding, Metric, compared, undecided
from hapticeval.recordings.recording import SINGLE, Recording
from hapticeval.scene import Scene
from hapticeval.types import Array, IntArray

if TYPE_CHECKING:
    from hapticeval.effects.reliefs import Relief


class ReliefAnswer(NamedTuple):
    """What a scene's relief makes of some ticks: forces (n, N), N, and IHIPs (n, N), m, and both on the bare surface.

    `stiff` (n,), N/m, and `moving` (n,) are how much force and IHIP change at the most for a HIP that is elsewhere:
    asked for at the lag that is found, for eigenvalues take longer than the answer.
    """

    force: Array
    ihip: Array
    bare_force: Array
    bare_ihip: Array
    stiff: Callable[[], Array]
    moving: Callable[[], Array]


class Waves:
    """Heights (m) and slopes of a scene's relief, computed anew from its numbers, beside the effect's own code."""

    def __init__(self, relief: Relief, scene: Scene) -> None:
        from scipy.interpolate import CubicSpline

        self.boundary, self.model = scene.model.boundary, scene.model
        self.wave = relief.wavelength
        if scene.model.dimension == 2 and self.boundary.closed:
            # A whole number of waves closes up.
            self.wave = self.boundary.girth / max(1, round(self.boundary.girth / self.wave))
        direction = np.array(relief.direction or (1.0, 0.0, 0.0))
        self.direction = direction / np.linalg.norm(direction)
        # Wave number, rad/m.
        turn = 2.0 * np.pi / self.wave
        if relief.profile:
            heights = np.array([*relief.profile, relief.profile[0]])
            spline = CubicSpline(np.linspace(0.0, self.wave, heights.size), heights, bc_type="periodic")
            self.height: Callable[[Array], Any] = spline
            self.rise: Callable[[Array], Any] = spline.derivative()
            # A cubic's second derivative is largest at a knot.
            self.bend = float(np.max(np.abs(spline.derivative(2)(spline.x))))
            # Its slope is zero somewhere, and no farther than half a wave from anywhere.
            self.steep = 0.5 * self.bend * self.wave
            self.highest = float(np.max(np.abs(relief.profile)))
        else:
            high = relief.amplitude or 0.0
            self.height, self.rise = (lambda at: high * np.sin(turn * at)), (lambda at: high * turn * np.cos(turn * at))
            self.steep, self.bend, self.highest = high * turn, high * turn**2, high

    def over(self, points: Array, foot: Array, normal: Array) -> tuple[Array, Array]:
        """Return heights (n,), m, and their gradient (n, N) along the surface, at the feet of `points` (n, N), m."""
        if self.model.dimension == 2:
            curve = self.model.curve
            # In the plane the relief goes with the arc length, in space with the place along a direction.
            at = curve.arc_length(curve.nearest(points))
            along = np.column_stack([-normal[:, 1], normal[:, 0]])
        else:
            at = foot @ self.direction
            # The gradient of that place, seen along the surface.
            along = self.direction - (normal @ self.direction)[:, np.newaxis] * normal
        within = np.mod(at, self.wave)
        return np.asarray(self.height(within)), np.asarray(self.rise(within))[:, np.newaxis] * along


def height_map_answer(waves: Waves, scene: Scene, hips: Array, plain: Array | None) -> ReliefAnswer:
    """Return what a height map makes of HIPs (n, N): F = K (d + h)(n - (I - d W)^-1 grad h) where d + h > 0.

    What the renderer's own force `plain` (n, N), N, has beside its spring K d n, as a damper's, is kept.
    """
    frame = waves.boundary.closest_point(hips)
    depth, normal, stiffness = -frame.distance, frame.normal, scene.stiffness
    height, gradient = waves.over(hips, frame.foot, normal)
    # I - d W: the hand moves by so much where its foot moves by one.
    hand_stretch = np.eye(hips.shape[1]) - depth[:, np.newaxis, np.newaxis] * frame.shape
    slope = np.linalg.solve(hand_stretch, gradient[..., np.newaxis])[..., 0]
    spring = stiffness * np.where(scene.bilateral, depth, np.maximum(depth, 0.0))[:, np.newaxis] * normal
    inside = (depth + height > 0.0) | scene.bilateral
    other_force = 0.0 if plain is None else plain - spring
    # F = -grad U with U = K (d + h)^2 / 2
    force = stiffness * (depth + height)[:, np.newaxis] * (normal - slope) + other_force
    pushes = inside[:, np.newaxis]

    def stretch() -> Array:
        """Return how far (n,) the foot moves at the most for a metre of the hand."""
        return np.asarray(1.0 / np.min(np.abs(np.linalg.eigvalsh(hand_stretch)), axis=1))

    def stiff() -> Array:
        """Return K |grad (d + h)|^2 + K (d + h) |grad^2 (d + h)| (n,), N/m: of U the force changes by so much."""
        steep, bend = waves.steep * stretch(), (waves.bend + _largest_curvature(frame.shape)) * stretch() ** 2
        return np.asarray(stiffness * (1.0 + steep**2 + np.abs(depth + height) * bend))

    bare_pushes = (depth > 0.0) | scene.bilateral
    return ReliefAnswer(
        np.where(pushes, force, 0.0),
        np.where(pushes, frame.foot + height[:, np.newaxis] * normal, hips),
        spring + other_force,
        np.where(bare_pushes[:, np.newaxis], frame.foot, hips),
        stiff,
        lambda: stretch() + waves.steep * stretch(),
    )


def _largest_curvature(shape: Array) -> Array:
    """Return the largest curvature (n,), 1/m, of the surface at points with shape operators (n, N, N)."""
    return np.asarray(np.max(np.abs(np.linalg.eigvalsh(shape)), axis=1))


def bump_map_answer(waves: Waves, ihips: Array, forces: Array | None, recorded: Array) -> ReliefAnswer:
    """Return what a bump map makes of the answers of a renderer, (n, N): its normal force along unit(n - grad h).

    `ihips` are (n, N), m, forces (n, N), N. Where the `forces` without the relief are not known, the part of the
    `recorded` ones along that direction is all.
    """
    frame = waves.boundary.closest_point(ihips)
    _, gradient = waves.over(ihips, frame.foot, frame.normal)
    # unit(n - grad h), as bump mapping turns a normal (4.16)
    tilted = frame.normal - gradient
    tilted /= np.linalg.norm(tilted, axis=1)[:, np.newaxis]
    if forces is None:
        press = np.sum(recorded * tilted, axis=1)
        bare_force = press[:, np.newaxis] * frame.normal
    else:
        press, bare_force = np.sum(forces * frame.normal, axis=1), forces
    force = bare_force + press[:, np.newaxis] * (tilted - frame.normal)
    return ReliefAnswer(
        force,
        ihips,
        bare_force,
        ihips,
        lambda: np.abs(press) * (waves.bend + _largest_curvature(frame.shape)),
        lambda: np.ones(len(ihips)),
    )


def judge(runs: Runs, scene: Scene) -> Finding:
    """Compare force and IHIP of every tick with those that the relief makes of the path."""
    base = runs.observed(scene)
    relief: Any = next(effect for effect in scene.effects if effect.kind in CHECK.effects)
    reason = not_alone(scene, relief.kind, because="whose force is another") or nothing_pressed(base)
    if reason is not None:
        return reason
    plain = None if runs.without is None else runs.without(relief.kind)
    if plain is None and scene.damping > 0.0:
        return undecided("the force without the relief is not known: the hand is not led along a path that we give")
    if any(effect.stage is Stage.SENSE for effect in scene.effects):
        return undecided("the renderer answers what its sensors show, and not where the hand is")
    # Compared from the tick on in which a late renderer's queue is filled.
    rows = np.arange(LAG_TICKS, len(base), dtype=np.int64)
    # both channels look for their lag, from the same ticks on
    waves = Waves(relief, scene)
    felt = cache(_relief_law(waves, base, plain, rows))
    place = base.rounding + SINGLE * float(np.max(np.abs(base.hip)))
    # A proxy that moves in every second tick only answers the HIP of the tick before while it rests.
    resting = resting_ticks(base.ihip) * steps_to(base.hip)
    doubt = place + base.believed_standoff + base.resolution + resting[rows]
    turns_answers = relief.kind == BUMP_MAP

    def compare(channel: str) -> Deviation | None:
        """Compare a channel with the relief's law: see `_compare_channel`."""
        return _compare_channel(felt, base, rows, doubt, channel, waves.highest, turns_answers=turns_answers)

    force = compare("force")
    # A bump map turns the force alone: its IHIP is compared where it is known without the relief, and well enough.
    ihip = compare("ihip") if plain is not None or not turns_answers else None
    if force is None or (ihip is None and not turns_answers):
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


def _relief_law(
    waves: Waves, base: Observed, plain: Recording | None, rows: IntArray
) -> Callable[[float], ReliefAnswer]:
    """Return the law of the relief at `rows` as a function of how many ticks ago the place is that it answers."""
    own_force = None if plain is None else plain.force[rows]
    if any(effect.kind == HEIGHT_MAP for effect in base.scene.effects):
        return lambda lag: height_map_answer(waves, base.scene, delayed(base.hip, rows, lag), own_force)
    tool = base.ihip if plain is None else plain.ihip
    return lambda lag: bump_map_answer(waves, delayed(tool, rows, lag), own_force, base.force[rows])


def _compare_channel(
    felt: Callable[[float], ReliefAnswer],
    base: Observed,
    rows: IntArray,
    doubt: Array,
    channel: str,
    highest: float,
    *,
    turns_answers: bool,
) -> Deviation | None:
    """Compare a channel with the law at the one lag that it has; None where the relief is hidden by what is open.

    `doubt` (n,), m, is what is open of the HIP; the relief is `highest` (m) high.
    """
    recorded = base.channels[channel][rows]

    def law(lag: float) -> tuple[Array, Array, Callable[[], Array]]:
        """Return the channel's values with and without the relief, and what tells what a HIP elsewhere changes."""
        answer = felt(lag)
        return (
            (answer.force, answer.bare_force, answer.stiff)
            if channel == "force"
            else (answer.ihip, answer.bare_ihip, answer.moving)
        )

    def misfit(lag: float) -> float:
        return float(lengths_of(recorded - law(lag)[0]).mean())

    # A misfit of rounding needs no lag to explain it.
    exact = float(np.min(doubt)) * (base.scene.stiffness if channel == "force" else 1.0)
    lag, late_misfit = believed_lag(misfit, exact)
    if turns_answers:  # an IHIP may be recorded later than the force that is made of it
        early, early_misfit = believed_lag(lambda lag: misfit(-lag), exact)
        lag = lag if late_misfit <= early_misfit else -early
    right, bare_answer, moves = law(lag)
    if abs(lag - round(lag)) > WHOLE_LAG:  # what is between two ticks may be the HIP, or the answer
        doubt = doubt + beside_straight(base.hip)[rows]
        late = beside_straight(right)
    else:
        late = np.zeros(len(rows))
    # What the relief adds, and how much of it the channel shows: <recorded - bare, change> / |change|^2
    change = right - bare_answer
    per_metre = base.scene.stiffness if channel == "force" else 1.0
    allowed = moves() * doubt + late + base.rounding_floor(np.linalg.norm(right, axis=1), per_metre)
    # Ticks in which a tenth of the relief's largest effect can be told: of an IHIP that it leaves, of its height.
    changes = bool(change.any())
    clear = allowed <= TELLING_SHARE * (float(np.max(np.linalg.norm(change, axis=1))) if changes else highest)
    if not clear.any():
        return None
    deviation = np.where(clear, np.linalg.norm(recorded - right, axis=1), 0.0)
    worst = worst_row(deviation / allowed)
    share = float(np.sum((recorded - bare_answer) * change) / np.sum(change**2)) if changes else None
    return Deviation(channel, int(rows[worst]), float(deviation[worst]), float(allowed[worst]), float(lag), share)


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
