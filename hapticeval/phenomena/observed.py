"""What checks, measures and the diagnosis read: a recording in its scene, with each quantity computed once.

All that checks mean by contact, by a step, and by a tolerance stands here. Every bound is made of these.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from hapticeval.geometry.boundary import Boundary, ClosestPoint
from hapticeval.phenomena.decisions import COARSEST_RESOLUTION, LAG_TICKS, PLACE_ROUNDING, SINGLE_ROUNDINGS, WIDE_RANGE
from hapticeval.phenomena.lag import Lag, find_lag, resting_ticks
from hapticeval.phenomena.sampling import (
    farthest_standoff,
    force_depth,
    force_floor,
    lengths_of,
    listed,
    mm,
    rounding,
    steps_to,
    unit_vectors,
    worst_row,
)
from hapticeval.recordings.channels import SIMULATED
from hapticeval.recordings.quantization import are_singles, quantization_step
from hapticeval.recordings.recording import SINGLE, Recording, runs_of, single_rounding
from hapticeval.renderer import STIFFNESS_LIMITS
from hapticeval.scene import Scene
from hapticeval.types import Array, BoolArray, IntArray

if TYPE_CHECKING:
    from hapticeval.diagnosis import Diagnosis

Shared = TypeVar("Shared", Array, BoolArray)


def _shared(values: Shared) -> Shared:
    """Return an array that nobody may write to from now on."""
    values.flags.writeable = False
    return values


@dataclass(frozen=True, eq=False)
class Observed:
    """A recording in its scene: the channels as recorded, and what they mean there; n counts ticks, N is the dimension.

    Arrays are shared by all that ask, and read-only.
    """

    recording: Recording
    scene: Scene
    fresh: Callable[[int], Recording] | None = None
    """The same through another renderer, see `Runs.fresh`: the diagnosis asks what is random."""

    def __len__(self) -> int:
        return len(self.recording)

    @property
    def time(self) -> Array:
        """The time base, (n,), s."""
        return self.recording.time

    @property
    def dt(self) -> float:
        """The sampling time, s."""
        return self.recording.dt

    @property
    def channels(self) -> Mapping[str, Array]:
        """All that was recorded, by name."""
        return self.recording.channels

    @property
    def meta(self) -> Mapping[str, Any]:
        """What the recording says of itself, and the renderer of itself."""
        return self.recording.meta

    @property
    def hip(self) -> Array:
        """Haptic interface point, (n, N), m."""
        return self.recording.hip

    @property
    def ihip(self) -> Array:
        """Ideal haptic interface point, (n, N), m."""
        return self.recording.ihip

    @property
    def force(self) -> Array:
        """Force on the hand, (n, N), N."""
        return self.recording.force

    @cached_property
    def velocity(self) -> Array:
        """The hand's velocity (n, N), m/s: as recorded, else the difference to the row before."""
        return self.recording.velocity

    @property
    def own_tool(self) -> bool:
        """Whether the positions are those of the renderer's own tool, which moves in forces."""
        return self.recording.own_tool

    @property
    def apart(self) -> BoolArray:
        """Where the IHIP is not the HIP, beyond single precision: (n,)."""
        return self.recording.apart

    @property
    def boundary(self) -> Boundary:
        """The boundary of the scene's model."""
        return self.scene.model.boundary

    @cached_property
    def nearest(self) -> ClosestPoint:
        """The model's point nearest to each HIP, with its normal, distance (m, negative inside) and shape operator."""
        return self.boundary.closest_point(self.hip)

    @cached_property
    def distance(self) -> Array:
        """How far the HIP is from the model, (n,), m, negative inside."""
        return _shared(self.boundary.signed_distance(self.hip))

    def nearest_as_rendered(self, rows: slice) -> Array:
        """Return the point nearest to each HIP of `rows` on the surface as it is rendered, (k, N), m.

        That is the model's own, and as far off it as the IHIP, within the standoff: of a ball the centre, whose places
        over two faces are farther apart than the feet on these.
        """
        hip = self.hip[rows]
        frame = self.boundary.closest_point(hip)
        inwards = frame.distance < -self.rounding
        away = np.where(inwards[:, np.newaxis], unit_vectors(frame.foot - hip), frame.normal)
        if not self.standoff:
            return frame.foot
        off = np.clip(self.boundary.signed_distance(self.ihip[rows]), -self.standoff, self.standoff)
        return np.asarray(frame.foot + off[:, np.newaxis] * away)

    # Forces

    @cached_property
    def force_size(self) -> Array:
        """The size of the force, (n,), N."""
        return _shared(lengths_of(self.force))

    @cached_property
    def pressed(self) -> BoolArray:
        """Where the force is above the floor of `force_floor`: (n,)."""
        return _shared(self.force_size > self.force_floor)

    @property
    def force_floor(self) -> float:
        """The force (N) below which no direction is judged: the spring's at `force_depth`."""
        return force_floor(self.scene)

    @property
    def force_depth(self) -> float:
        """The depth, m, under which nothing is judged."""
        return force_depth(self.scene)

    @cached_property
    def stiffness_range(self) -> tuple[float, float] | None:
        """The least and largest stiffness that the renderer declares, as shares of the scene's; None without.

        A file may say more than a renderer may: it counts up to `STIFFNESS_LIMITS`.
        """
        softest = self.meta.get("stiffness_least")
        if softest is None:
            return None
        lowest, highest = STIFFNESS_LIMITS
        return max(float(softest), lowest), min(float(self.meta.get("stiffness_largest", highest)), highest)

    @property
    def declares_wide_range(self) -> bool:
        """Whether the declared stiffness varies by so much that it says next to nothing of the force's size."""
        softest, stiffest = self.stiffness_range or (1.0, 1.0)
        return stiffest > WIDE_RANGE * softest

    # Contact

    @cached_property
    def contact(self) -> BoolArray:
        """Where the tool is in contact, (n,): what all checks mean by contact.

        On a bilateral constraint that is always, also where no force is called for. On a surface that only pushes:

        - a force above the floor, whatever is reported;
        - without one, what the renderer reports;
        - of one that reports nothing, an IHIP apart from the HIP that does not trail the hand: see `trailing`.
        """
        if self.scene.bilateral:
            return _shared(np.ones(len(self), dtype=bool))
        if "force" not in self.channels:
            return _shared(self.recording.contact)
        # A force is contact whatever else is said; the others only add rows without one.
        contact = self.pressed
        if "contact" in self.channels:
            contact = contact | self.recording.contact
        elif "ihip" in self.channels:
            contact = contact | (self.apart & ~self.trailing)
        return _shared(contact)

    @cached_property
    def trailing(self) -> BoolArray:
        """Where the IHIP is apart from the HIP in free space, (n,): there a tool does not follow the hand.

        There is no force above the floor, no contact is reported, and the HIP is outside of the model, or the IHIP
        farther outside than any contact point may lie. Nowhere on a bilateral constraint, and where force or IHIP was
        not recorded.
        """
        trails = np.zeros(len(self), dtype=bool)
        if not self.scene.bilateral and {"ihip", "force"} <= self.channels.keys():
            reported = self.channels.get("contact", np.zeros(len(self))) != 0.0
            silent = np.flatnonzero(self.apart & ~self.pressed & ~reported)
            if silent.size:
                outside = self.boundary.signed_distance(self.hip[silent]) > 0.0
                trails[silent] = outside | self.clear_of_surface(silent)
        return _shared(trails)

    def clear_of_surface(self, rows: IntArray) -> BoolArray:
        """Return at which of `rows` (k,) the IHIP is farther outside, in m, than a contact point may be, (k,).

        It may be off by what is declared, and late; where the renderer says itself that it has no contact, it is not
        late.
        """
        late = LAG_TICKS * float(self.hip_steps.max(initial=0.0))
        has_reports = "contact" in self.channels
        says_free = ~self.recording.contact[rows] if has_reports else np.zeros(rows.size, dtype=bool)
        farthest = np.where(says_free, 0.0, late) + self.believed_standoff + self.rounding
        return np.asarray(self.boundary.signed_distance(self.ihip[rows]) > farthest)

    @cached_property
    def lingering(self) -> BoolArray:
        """Where a force is still felt though the tool is free again, (n,): what a late force leaves of a contact.

        The IHIP is with the HIP outside of the model, after a contact in which it was apart. There a tool is where it
        should be, however long the force stays: that it does is for `contact-kept` to say.
        """
        late = np.zeros(len(self), dtype=bool)
        if not self.scene.bilateral and {"ihip", "force"} <= self.channels.keys():
            # A force with the IHIP at the HIP, after a contact whose IHIP was elsewhere: the force alone is late.
            for first, end in runs_of(self.pressed & ~self.apart):
                if self.apart[max(first - LAG_TICKS, 0) : first].any():
                    late[first:end] = np.logical_and.accumulate(
                        self.boundary.signed_distance(self.hip[first:end]) >= 0.0
                    )
        return _shared(late)

    @cached_property
    def pushed_in_free_space(self) -> BoolArray:
        """Where a hand feels a force above the floor in free space, with the tool at it, (n,).

        The IHIP is the HIP, so that no solid is between them, and the HIP is outside, both for three ticks either way:
        past a corner the HIP may be outside long before the contact ends, and the force may come late.
        """
        pushed = np.zeros(len(self), dtype=bool)
        if "force" in self.channels:
            pushed = self.pressed & ~self.apart
        if pushed.any():
            # All of seven ticks; before and after the recording nothing contradicts.
            outside = (self.distance > self.across_allowed) & ~self.apart
            around = np.pad(outside, LAG_TICKS, constant_values=True)
            pushed &= np.lib.stride_tricks.sliding_window_view(around, 2 * LAG_TICKS + 1).all(axis=1)
        return _shared(pushed)

    @cached_property
    def stays_free(self) -> bool:
        """Whether a simulated hand never comes to the model, and feels nothing: a case that asks for free space alone.

        The way from each HIP to the next is clear where the distances at its ends cover it, or the solid does not bar
        it. A recording of others does not say what was to be touched.
        """
        if self.scene.bilateral or self.meta.get("source") not in SIMULATED:
            return False
        if not {"ihip", "force"} <= self.channels.keys() or self.pressed.any() or self.contact.any():
            return False
        near = self.distance[1:] + self.distance[:-1] < self.hip_steps
        grain = PLACE_ROUNDING * self.scene.model.size
        return bool(np.all(self.distance > 0.0)) and not any(
            self.boundary.first_crossing(self.hip[row], self.hip[row + 1], grain=grain) is not None
            for row in np.flatnonzero(near).tolist()
        )

    @cached_property
    def holding(self) -> BoolArray:
        """Where the surface holds a contact point, (n,): in contact, but for where only a late force lingers.

        A tool that stands off rounds each convex edge by an arc, and is kept there until the hand is past the edge by
        as much. Meanwhile it goes round, by the whole depth: the rigid contact is over once the hand is out of the
        model. So with the hand outside, as near to it as standoff and lag allow, the tool is free but for what is
        declared.
        """
        holds = self.contact & ~self.lingering
        if not self.scene.bilateral and self.recording.standoff != 0.0:
            near = self.position_tolerance + self.rounding
            beside_hand = np.flatnonzero(holds & (np.linalg.norm(self.ihip - self.hip, axis=1) <= near))
            distance = self.boundary.signed_distance(self.hip[beside_hand])
            holds[beside_hand] = (distance <= 0.0) | (distance > near)
        return _shared(holds)

    @cached_property
    def lacks_ihip(self) -> bool:
        """Whether a renderer gives a force and no contact point: one inside the model, with the IHIP at the HIP.

        Or it declares that it gives none, and no IHIP contradicts that. These are no lack:

        - a rigid contact, which has a force and no depth: its HIP lies on the renderer's surface, which is off the
          model by as much everywhere, up to the declared standoff;
        - a force outside of the model, of a renderer that gives its IHIP elsewhere.
        """
        if "force" not in self.channels:
            return False
        with_hand = np.all(self.ihip == self.hip, axis=1)
        if self.declares_force_only and with_hand.all():
            return True
        # HIPs, (k, N), at which a force comes with an IHIP that is the HIP.
        distance = self.boundary.signed_distance(self.hip[self.pressed & with_hand])
        if self.apart.any():
            distance = distance[distance < 0.0]
        if distance.size == 0:
            return False
        depths = np.abs(distance)
        # What a rigid contact's HIPs may differ by in depth: a lag's way and rounding.
        tolerance = LAG_TICKS * self.hip_step + PLACE_ROUNDING * self.scene.model.size
        # Deeper than a declared standoff, or not equally deep: these HIPs lie on no surface of their own.
        return bool(depths.max() > tolerance + self.believed_standoff or np.ptp(depths) > tolerance)

    @property
    def declares_force_only(self) -> bool:
        """Whether the renderer declares that it has a force and no contact point."""
        return bool(self.meta.get("contact_point") == "none")

    # Steps

    @cached_property
    def hip_steps(self) -> Array:
        """How far the HIP moves from each sample to the next: (n - 1,), m."""
        return _shared(steps_to(self.hip)[1:])

    @cached_property
    def hip_step(self) -> float:
        """The largest HIP step in contact, m: nothing finer can be placed on the surface.

        Over the whole recording where no two samples in a row are in contact.
        """
        # Both ends in contact: the approach in free space may be faster.
        pressed = self.hip_steps[self.contact[1:] & self.contact[:-1]]
        return float((pressed if pressed.size else self.hip_steps).max(initial=0.0))

    @cached_property
    def contact_steps(self) -> Array:
        """How far the IHIP moves to each sample from the one before, where both are in contact, else 0: (n,), m.

        A contact ends with its contact point, though a late force may linger.
        """
        steps = steps_to(self.ihip)
        steps[1:][~(self.holding[1:] & self.holding[:-1])] = 0.0
        return _shared(steps)

    @cached_property
    def recent_steps(self) -> Array:
        """How far in a tick the hand has lately moved, up to each sample: (n,), m.

        A proxy may be late by `LAG_TICKS`. One that waits for them answers a step of the hand up to so many ticks after
        it. One that nears the hand with such a time constant does by a factor of e^(-1 / LAG_TICKS) in each tick
        beyond.
        """
        steps = steps_to(self.hip)
        # The longest of the step and of the LAG_TICKS before it.
        window = np.lib.stride_tricks.sliding_window_view(np.pad(steps, (LAG_TICKS, 0)), LAG_TICKS + 1).max(axis=1)
        ticks = np.arange(steps.size) / LAG_TICKS
        with np.errstate(divide="ignore"):
            # max over j <= i of step_j e^(-(i - j) / LAG_TICKS), as a running maximum in the logarithm
            fading = np.exp(np.maximum.accumulate(np.log(steps) + ticks) - ticks)
        # A step fades only behind the LAG_TICKS in which it counts whole.
        window[LAG_TICKS:] = np.maximum(window[LAG_TICKS:], fading[:-LAG_TICKS])
        return _shared(window)

    # Lag

    @cached_property
    def lag(self) -> Lag:
        """The lags of the run, in ticks: one number for each channel."""
        return find_lag(self.recording, self.scene, self.contact, self.pressed if "force" in self.channels else None)

    @cached_property
    def force_lag(self) -> float:
        """How many ticks late the force is, from 0 to `LAG_TICKS`: by position and force, one number for the run.

        A force that rests while HIP - IHIP changes is as much later. For a force alone see `lag.force_only_lag`.
        """
        resting = resting_ticks(self.force) - resting_ticks(self.hip - self.ihip)
        rests = np.maximum(resting, 0)[self.contact]
        return min(self.lag.force + float(rests.mean() if rests.size else 0.0), float(LAG_TICKS))

    # Tolerances

    @property
    def rounding(self) -> float:
        """How well single precision places two points of the model's size, m."""
        return rounding(self.scene)

    @cached_property
    def answered_rounding(self) -> float:
        """By how much rounding may move a contact point, m, that is answered in single precision; else 0.

        It is so answered where each coordinate of an IHIP apart from its HIP is a number of single precision.
        """
        points = self.ihip[self.apart]
        return single_rounding(points) if points.size > 0 and are_singles(points) else 0.0

    def rounding_floor(
        self, sizes: Array, per_metre: float | Array, *, share: float = SINGLE_ROUNDINGS * SINGLE
    ) -> Array:
        """Return by how much rounding may move numbers of `sizes` (n,), in their unit, that are made of positions.

        `per_metre` (a number or (n,)) is what a metre makes of them: K of a spring's force, K times the path of its
        work. The part `share` of all that is summed up in a number is open, and as much of its smallest part.
        """
        return np.asarray(share * (sizes + per_metre * float(np.max(np.abs(self.hip)))))

    def log_step(self, *channels: str) -> float:
        """Return the step in which a log gives the vectors of `channels`, in their unit: by so much they may be off.

        The root of the sum of squares over all components. It is 0 of a simulation, whose numbers are doubles, and of a
        channel that is not there.
        """
        if self.meta.get("source") in SIMULATED:
            return 0.0
        return math.hypot(*(self._log_step_of(name) for name in channels if name in self.channels))

    @cached_property
    def _log_step_of(self) -> Callable[[str], float]:
        return cache(lambda name: float(np.linalg.norm([quantization_step(line) for line in self.channels[name].T])))

    @cached_property
    def off_surface(self) -> tuple[float, int]:
        """How far the IHIP in contact lies off the model at the most, m, and at which tick (0 without contact).

        Where a force only lingers there is no contact point.
        """
        contact = np.flatnonzero(self.contact & ~self.lingering)
        if contact.size == 0:
            return 0.0, 0
        distance = np.abs(self.boundary.signed_distance(self.ihip[contact]))
        worst = worst_row(distance)
        return float(distance[worst]), int(contact[worst])

    @property
    def believed_standoff(self) -> float:
        """The declared standoff, m, as far as it is believed."""
        return min(self.recording.standoff, farthest_standoff(self.scene))

    @cached_property
    def standoff(self) -> float:
        """The declared standoff, m, as far as the IHIPs in contact really lie off the model: no licence beyond that."""
        return min(self.believed_standoff, self.off_surface[0]) if self.recording.standoff else 0.0

    @property
    def resolution(self) -> float:
        """The declared resolution, m, at most a sixteenth of the outline; in space that of a circle of its size."""
        return min(self.recording.resolution, COARSEST_RESOLUTION * self.boundary.girth)

    @property
    def hop_tolerance(self) -> float:
        """How far apart two contact points of one place may be, m: the standoff, and the resolution once at each end.

        A resolution above a HIP step is that of facets, over which no hop is excused.
        """
        resolution = self.recording.resolution
        return self.standoff + (2.0 * resolution if resolution <= self.hip_step else 0.0)

    @property
    def position_tolerance(self) -> float:
        """How well a contact point can be placed, m: three ticks of lag and the standoff."""
        return LAG_TICKS * self.hip_step + self.standoff

    @property
    def across_allowed(self) -> float:
        """How far the renderer's surface may lie off the model, m, with the rounding of positions.

        By what it declares: its standoff, or where it declares a resolution only, that.
        """
        return (self.believed_standoff or self.resolution) + self.rounding + self.log_step("hip", "ihip")

    # Causes

    @cached_property
    def diagnosis(self) -> Diagnosis:
        """Why force or contact point are off, asked for where a check fails.

        Compared with the renderer's own contact point first: what explains the force to the last digits is its cause.
        That point is where it is said to be, so that a standoff allows nothing there. Else with a rigid tool's that is
        led along the hand's path, whose nearest points hold a bilateral constraint.
        """
        # Asked for by a failure alone: what imports checks loads none of it.
        from hapticeval.diagnosis import Diagnosis, diagnose, right_contact
        from hapticeval.diagnosis.ranking import EXPLAINED_EXACTLY

        logged = self.meta.get("source") not in SIMULATED
        ihip = self.channels.get("ihip") if not self.lacks_ihip else None
        led = self.nearest.foot if self.scene.bilateral else None

        def compared_with(points: Array | None, tolerance: float, **options: Any) -> Diagnosis:
            """Compare the run with a right contact, its tool at `points` (n, N), m; None puts it where it is due.

            The surface may lie off the model by a `tolerance` (m).
            """
            contact = right_contact(
                self.boundary,
                self.time,
                self.hip,
                None if logged and "velocity" not in self.channels else self.velocity,
                stiffness=self.scene.stiffness,
                damping=self.scene.damping,
                points=points,
            )
            return diagnose(contact, self.force, noisy=logged, tolerance=tolerance, **options)

        def another_force() -> Array:
            assert self.fresh is not None
            return self.fresh(1).force

        own = Diagnosis(False) if ihip is None else compared_with(ihip, self.rounding + self.log_step("hip", "ihip"))
        if own.cause is not None and own.share > EXPLAINED_EXACTLY and not logged:
            return own
        right = compared_with(
            led,
            self.across_allowed,
            ihip=ihip,
            boundary=self.boundary if logged else None,
            again=None if self.fresh is None or logged else another_force,
        )
        return right if right.cause is not None or own.cause is None else own

    @property
    def cause(self) -> str:
        """The cause of what is off, in words; that none is known, where none explains it."""
        return self.diagnosis.sentence if self.diagnosis.off else "no known cause explains it"

    @property
    def cause_evidence(self) -> dict[str, Any]:
        """The cause as evidence: its kind and numbers, and what it is not told from on this path."""
        diagnosis = self.diagnosis
        evidence: dict[str, Any] = {"cause": diagnosis.kind if diagnosis.off else "unexplained"}
        if diagnosis.cause is not None:
            evidence["cause_numbers"] = dict(diagnosis.cause.numbers)
        if diagnosis.remedy:
            evidence["not_told_apart"] = diagnosis.remedy
        return evidence

    # Words

    @cached_property
    def as_sensed(self) -> Observed:
        """The same with HIP and velocity as sensors that are not exact gave them to the renderer."""
        sensed = {"hip": "measured_hip", "velocity": "measured_velocity"}
        channels = {name: self.channels[channel] for name, channel in sensed.items() if channel in self.channels}
        return self.with_channels(**channels) if channels else self

    def with_channels(self, **channels: Array) -> Observed:
        """Return the same with other `channels` in place of those of their names."""
        return Observed(self.recording.with_channels(**channels), self.scene, self.fresh)

    @cached_property
    def with_nearest_points(self) -> Observed:
        """The same, with the surface's point nearest to the hand inside as the IHIP that the renderer does not give."""
        inside = self.scene.bilateral | (self.nearest.distance[:, np.newaxis] < 0.0)
        return self.with_channels(ihip=np.where(inside, self.nearest.foot, self.hip))

    @property
    def open_loop_reason(self) -> str | None:
        """Why the recording cannot show how hand and force act on each other; None where it can.

        A simulated experiment without an operator's force had none; of any other run it is then not known.
        """
        source = self.meta.get("source")
        if source == "replay":
            return (
                "the hand's path was recorded under another force and does not answer this one: a fixed path cannot "
                "tell"
            )
        if source != "experiment" and "operator_force" not in self.channels:
            return "the operator's force was not recorded: its share in the motion cannot be told from the renderer's"
        return None

    def evidence_at(self, tick: int) -> dict[str, object]:
        """Return as evidence when and where a sample is; without the IHIP where none was recorded."""
        return {
            "time": float(self.time[tick]),
            "tick": int(tick),
            **{name: listed(self.channels[name][tick]) for name in ("hip", "ihip") if name in self.channels},
        }

    def time_and_hip(self, tick: int) -> str:
        """Return when and where a sample is, for a message: "t = 1.5 s, HIP (80, 12) mm"."""
        return f"t = {self.time[tick]:.4g} s, HIP {mm(*self.hip[tick])}"
