"""What the sampling of a recording allows to be told apart: the tolerances that every bound is made of."""

from __future__ import annotations

import math
import weakref
from collections.abc import Callable, Sequence
from functools import wraps
from typing import TypeVar

import numpy as np

from hapticeval.phenomena.decisions import (
    COARSEST_RESOLUTION,
    FARTHEST_STANDOFF,
    FORCE_DEPTH,
    LAG_TICKS,
    PLACE_ROUNDING,
    SINGLE_ROUNDINGS,
    TIE_SHARE,
)
from hapticeval.quantity import format_number
from hapticeval.recordings.channels import SIMULATED
from hapticeval.recordings.quantization import quantization_step
from hapticeval.recordings.recording import DOUBLE, SINGLE, Recording, backward_difference, runs_of, single_rounding
from hapticeval.scene import Scene
from hapticeval.types import Array, BoolArray, IntArray

Found = TypeVar("Found")
"""What is found of a recording in a scene."""

Candidate = TypeVar("Candidate")
"""One of several of which the worst is named."""

LED = ("playback", "replay")
"""Sources of recordings in which the hand was led along a given path, whatever the force."""


def lengths_of(vectors: Array) -> Array:
    """Return the lengths (n,) of `vectors` (n, N), m or N, to the bit those of `np.linalg.norm`, five times as fast."""
    # column by column: numpy is slow along an axis of two or three numbers
    return np.asarray(np.sqrt(sum(np.square(vectors).T)))


def unit_vectors(vectors: Array) -> Array:
    """Return `vectors` (n, N), m or N, divided by their lengths; one of no length stays zero."""
    lengths = lengths_of(vectors)[:, np.newaxis]
    return np.asarray(np.divide(vectors, lengths, out=np.zeros_like(vectors), where=lengths > 0.0))


def steps_to(points: Array) -> Array:
    """Return how far `points` (n, N), m, move to each row from the one before, and 0 to the first: (n,), m."""
    return lengths_of(np.diff(points, axis=0, prepend=points[:1]))


def hip_steps(recording: Recording) -> Array:
    """Return the distance that the HIP moves from each sample to the next: (n - 1,), m."""
    return steps_to(recording.hip)[1:]


def hand_velocity(recording: Recording) -> Array:
    """Return the hand's velocity (n, N), m/s: as recorded, else the difference to the row before."""
    if "velocity" in recording.channels:
        return recording.velocity
    return backward_difference(recording.hip, recording.time)


def once_a_recording(find: Callable[[Recording, Scene], Found]) -> Callable[[Recording, Scene], Found]:
    """Return a function of a recording and a scene that finds its answer once, for the scene that was asked last.

    The answer lasts as long as the recording, and is shared: it must not be written to.
    """
    answers: weakref.WeakKeyDictionary[Recording, tuple[weakref.ref[Scene], Found]] = weakref.WeakKeyDictionary()

    @wraps(find)
    def found_once(recording: Recording, scene: Scene) -> Found:
        known = answers.get(recording)
        if known is None or known[0]() is not scene:
            known = answers[recording] = weakref.ref(scene), find(recording, scene)
        return known[1]

    return found_once


def touching(recording: Recording, scene: Scene) -> BoolArray:
    """Return where the tool is in contact, (n,): what all checks mean by contact, found once for a recording.

    On a bilateral constraint that is always, also where no force is called for. On a surface that only pushes:

    - a force above the floor, whatever is reported;
    - without one, what the renderer reports;
    - of one that reports nothing, an IHIP apart from the HIP that does not trail the hand: see `trailing`.
    """
    return _touching(recording, scene).copy()


@once_a_recording
def _touching(recording: Recording, scene: Scene) -> BoolArray:
    """Find what `touching` returns."""
    if scene.bilateral:
        return np.ones(len(recording), dtype=bool)
    if "force" not in recording.channels:
        return recording.contact
    # A force is contact whatever else is said; the others only add rows without one.
    contact = above_force_floor(recording, scene)
    if "contact" in recording.channels:
        contact |= recording.contact
    elif "ihip" in recording.channels:
        contact |= recording.apart & ~trailing(recording, scene)
    return contact


def trailing(recording: Recording, scene: Scene) -> BoolArray:
    """Return where the IHIP is apart from the HIP in free space, (n,): there a tool does not follow the hand.

    There is no force above the floor, no contact is reported, and the HIP is outside of the model, or the IHIP farther
    outside than any contact point may lie. Nowhere on a bilateral constraint, and where force or IHIP was not recorded.
    """
    trails = np.zeros(len(recording), dtype=bool)
    if scene.bilateral or not {"ihip", "force"} <= recording.channels.keys():
        return trails
    reported = recording.channels.get("contact", np.zeros(len(recording))) != 0.0
    silent = np.flatnonzero(recording.apart & ~above_force_floor(recording, scene) & ~reported)
    if silent.size:
        distance = scene.model.boundary.signed_distance
        trails[silent] = (distance(recording.hip[silent]) > 0.0) | clear_of_surface(recording, silent, scene)
    return trails


def clear_of_surface(recording: Recording, rows: IntArray, scene: Scene) -> BoolArray:
    """Return at which of `rows` (k,) the IHIP is farther outside, in m, than a contact point may be, (k,).

    It may be off by what is declared, and late; where the renderer says itself that it has no contact, it is not late.
    """
    late = LAG_TICKS * float(hip_steps(recording).max(initial=0.0))
    says_free = ~recording.contact[rows] if "contact" in recording.channels else np.zeros(rows.size, dtype=bool)
    farthest = np.where(says_free, 0.0, late) + believed_standoff(recording, scene) + rounding(scene)
    return np.asarray(scene.model.boundary.signed_distance(recording.ihip[rows]) > farthest)


def lingering(recording: Recording, scene: Scene) -> BoolArray:
    """Return where a force is still felt though the tool is free again, (n,): what a late force leaves of a contact.

    The IHIP is with the HIP outside of the model, and was apart from it `LAG_TICKS` ticks ago at the most; a force that
    stays longer is none of these. There is no contact point there.
    """
    late = np.zeros(len(recording), dtype=bool)
    if scene.bilateral or not {"ihip", "force"} <= recording.channels.keys():
        return late
    # A force with the IHIP at the HIP, after a contact whose IHIP was elsewhere: the force alone is late.
    free = above_force_floor(recording, scene) & ~recording.apart
    for first, end in runs_of(free):
        rows = slice(first, end)
        # The contact is within the lag of the last of these rows, and so of all.
        if recording.apart[max(end - 1 - LAG_TICKS, 0) : first].any():
            late[rows] = np.all(scene.model.boundary.signed_distance(recording.hip[rows]) >= 0.0)
    return late


def pushed_in_free_space(recording: Recording, scene: Scene) -> BoolArray:
    """Return where a hand feels a force above the floor in free space, with the tool at it, (n,).

    The IHIP is the HIP, so that no solid is between them, and the HIP is outside, both for three ticks either way: past
    a corner the HIP may be outside long before the contact ends, and the force may come late.
    """
    pushed = np.zeros(len(recording), dtype=bool)
    if "force" not in recording.channels:
        return pushed
    pushed = above_force_floor(recording, scene) & ~recording.apart
    if not pushed.any():
        return pushed
    outside = scene.model.boundary.signed_distance(recording.hip) > across_allowed(recording, scene)
    # All of seven ticks; before and after the recording nothing contradicts.
    around = np.pad(outside & ~recording.apart, LAG_TICKS, constant_values=True)
    return np.asarray(pushed & np.lib.stride_tricks.sliding_window_view(around, 2 * LAG_TICKS + 1).all(axis=1))


@once_a_recording
def holding(recording: Recording, scene: Scene) -> BoolArray:
    """Return where the surface holds a contact point, (n,): in contact, but for where only a late force lingers.

    A tool that stands off rounds each convex edge by an arc, and is kept there until the hand is past the edge by as
    much. Meanwhile it goes round, by the whole depth: the rigid contact is over once the hand is out of the model. So
    with the hand outside, as near to it as standoff and lag allow, the tool is free but for what is declared.
    """
    holds = touching(recording, scene) & ~lingering(recording, scene)
    if scene.bilateral or recording.standoff == 0.0:
        return holds
    near = position_tolerance(recording, scene) + rounding(scene)
    beside_hand = np.flatnonzero(holds & (np.linalg.norm(recording.ihip - recording.hip, axis=1) <= near))
    distance = scene.model.boundary.signed_distance(recording.hip[beside_hand])
    holds[beside_hand] = (distance <= 0.0) | (distance > near)
    return holds


def as_sensed(base: Recording) -> Recording:
    """Return a recording with HIP and velocity as sensors that are not exact gave them to the renderer."""
    sensed = {"hip": "measured_hip", "velocity": "measured_velocity"}
    sensed_channels = {name: base.channels[channel] for name, channel in sensed.items() if channel in base.channels}
    return Recording(base.time, dict(base.channels) | sensed_channels, base.meta) if sensed_channels else base


def hip_step(recording: Recording, scene: Scene) -> float:
    """Return the largest HIP step in contact, m: nothing finer can be placed on the surface.

    Over the whole recording where no two samples in a row are in contact.
    """
    steps, contact = hip_steps(recording), touching(recording, scene)
    # Both ends in contact: the approach in free space may be faster.
    pressed = steps[contact[1:] & contact[:-1]]
    return float((pressed if pressed.size else steps).max(initial=0.0))


def worst_row(values: Array) -> int:
    """Return the row at which `values` (n,), of any unit, are the largest: the first of those that are so to 1e-9.

    A path that repeats itself, or is symmetric, has several worst places: another machine names the same of them. What
    is a difference of nearly equal numbers, or rounding alone, may yet differ by more.
    """
    largest = float(np.max(values))
    return int(np.argmax(values >= largest - TIE_SHARE * abs(largest) if math.isfinite(largest) else values))


def worst_of(candidates: Sequence[Candidate], badness: Callable[[Candidate], float]) -> Candidate:
    """Return the candidate whose `badness`, of any unit, is the largest: of equally bad ones as `worst_row` does."""
    return candidates[worst_row(np.array([badness(candidate) for candidate in candidates]))]


@once_a_recording
def off_surface(recording: Recording, scene: Scene) -> tuple[float, int]:
    """Return how far the IHIP in contact lies off the model at the most, m, and at which tick (0 without contact).

    Where a force only lingers there is no contact point.
    """
    contact = np.flatnonzero(touching(recording, scene) & ~lingering(recording, scene))
    if contact.size == 0:
        return 0.0, 0
    distance = np.abs(scene.model.boundary.signed_distance(recording.ihip[contact]))
    worst = worst_row(distance)
    return float(distance[worst]), int(contact[worst])


def farthest_standoff(scene: Scene) -> float:
    """Return how far off the model, m, an IHIP may be declared: a fiftieth of its size; beyond is another object."""
    return FARTHEST_STANDOFF * scene.model.size


def note_cut_standoff(standoff: float, scene: Scene) -> str:
    """Say that not all of a declared `standoff` (m) is believed; empty where it is."""
    farthest = farthest_standoff(scene)
    if standoff <= farthest:
        return ""
    return f"it declares a standoff of {mm(standoff)}, of which {mm(farthest)} count, a fiftieth of the model's size"


def believed_standoff(recording: Recording, scene: Scene) -> float:
    """Return the declared standoff, m, as far as it is believed."""
    return min(recording.standoff, farthest_standoff(scene))


def standoff(recording: Recording, scene: Scene) -> float:
    """The declared standoff, m, as far as the IHIPs in contact really lie off the model: no licence beyond that."""
    if recording.standoff == 0.0:
        return 0.0
    return min(believed_standoff(recording, scene), off_surface(recording, scene)[0])


def rounding(scene: Scene) -> float:
    """Return how well single precision places two points of the model's size, m."""
    return SINGLE_ROUNDINGS * SINGLE * scene.model.size


def answered_rounding(recording: Recording) -> float:
    """Return by how much rounding may move a contact point, m, that is answered in single precision; else 0.

    It is so answered where each coordinate of an IHIP apart from its HIP is a number of single precision.
    """
    points = recording.ihip[recording.apart]
    answers_singles = points.size > 0 and np.array_equal(points, points.astype(np.float32))
    return single_rounding(points) if answers_singles else 0.0


def log_step(recording: Recording, *channels: str) -> float:
    """Return the step in which a log gives the vectors of `channels`, in their unit: by so much they may be off.

    The root of the sum of squares over all components. It is 0 of a simulation, whose numbers are doubles, and of a
    channel that is not there.
    """
    if recording.meta.get("source") in SIMULATED:
        return 0.0
    known = _LOG_STEPS.setdefault(recording, {})
    for name in set(channels).intersection(recording.channels) - set(known):
        known[name] = float(np.linalg.norm([quantization_step(column) for column in recording.channels[name].T]))
    return math.hypot(*(known.get(name, 0.0) for name in channels))


_LOG_STEPS: weakref.WeakKeyDictionary[Recording, dict[str, float]] = weakref.WeakKeyDictionary()


def resolution(recording: Recording, scene: Scene) -> float:
    """The declared resolution, m, at most a sixteenth of the outline; in space that of a circle of the model's size."""
    return min(recording.resolution, COARSEST_RESOLUTION * scene.model.boundary.girth)


def position_tolerance(recording: Recording, scene: Scene) -> float:
    """Return how well a contact point can be placed, m: three ticks of lag and the standoff."""
    return LAG_TICKS * hip_step(recording, scene) + standoff(recording, scene)


def across_allowed(base: Recording, scene: Scene) -> float:
    """Return how far the renderer's surface may lie off the model, m, with the rounding of positions.

    By what it declares: its standoff, or where it declares a resolution only, that.
    """
    digits = log_step(base, "hip", "ihip")
    return (believed_standoff(base, scene) or resolution(base, scene)) + rounding(scene) + digits


def force_depth(scene: Scene) -> float:
    """Return the depth, m, under which nothing is judged: `FORCE_DEPTH` of the model's size."""
    return FORCE_DEPTH * scene.model.size


def force_floor(scene: Scene) -> float:
    """Return the force (N) below which no direction is judged: the spring's at `force_depth`."""
    return scene.stiffness * force_depth(scene)


def above_force_floor(recording: Recording, scene: Scene) -> BoolArray:
    """Return where the force is above the floor of `force_floor`: (n,)."""
    return np.asarray(lengths_of(recording.force) > force_floor(scene))


def lacks_ihip(recording: Recording, scene: Scene) -> bool:
    """Return whether a renderer gives a force and no contact point: one inside the model, with the IHIP at the HIP.

    Or it declares that it gives none, and no IHIP contradicts that. These are no lack:

    - a rigid contact, which has a force and no depth: its HIP lies on the renderer's surface, which is off the model
      by as much everywhere, up to the declared standoff;
    - a force outside of the model, of a renderer that gives its IHIP elsewhere.
    """
    if "force" not in recording.channels:
        return False
    with_hand = np.all(recording.ihip == recording.hip, axis=1)
    if declares_force_only(recording) and with_hand.all():
        return True
    # HIPs, (k, N), at which a force comes with an IHIP that is the HIP.
    silent = np.flatnonzero(above_force_floor(recording, scene) & with_hand)
    distance = scene.model.boundary.signed_distance(recording.hip[silent])
    if recording.apart.any():
        distance = distance[distance < 0.0]
    if distance.size == 0:
        return False
    depths = np.abs(distance)
    # What a rigid contact's HIPs may differ by in depth: a lag's way and rounding.
    tolerance = LAG_TICKS * hip_step(recording, scene) + PLACE_ROUNDING * scene.model.size
    # Deeper than a declared standoff, or not equally deep: these HIPs lie on no surface of their own.
    return bool(depths.max() > tolerance + believed_standoff(recording, scene) or np.ptp(depths) > tolerance)


def declares_force_only(recording: Recording) -> bool:
    """Return whether the renderer declares that it has a force and no contact point."""
    return recording.meta.get("contact_point") == "none"


def open_loop_reason(recording: Recording) -> str | None:
    """Why a recording cannot show how hand and force act on each other; None where it can.

    A simulated experiment without an operator's force had none; of any other run it is then not known.
    """
    source = recording.meta.get("source")
    if source == "replay":
        return "the hand's path was recorded under another force and does not answer this one: a fixed path cannot tell"
    if source != "experiment" and "operator_force" not in recording.channels:
        return "the operator's force was not recorded: its share in the motion cannot be told from the renderer's"
    return None


def evidence_at(recording: Recording, tick: int) -> dict[str, object]:
    """Return as evidence when and where a sample is; without the IHIP where none was recorded."""
    return {
        "time": float(recording.time[tick]),
        "tick": int(tick),
        **{name: listed(recording.channels[name][tick]) for name in ("hip", "ihip") if name in recording.channels},
    }


def time_and_hip(recording: Recording, tick: int) -> str:
    """Return when and where a sample is, for a message: "t = 1.5 s, HIP (80, 12) mm"."""
    return f"t = {recording.time[tick]:.4g} s, HIP {mm(*recording.hip[tick])}"


def listed(point: Array) -> list[float]:
    """Return a point (N,) as a JSON value."""
    return [float(x) for x in point]


def digits_kept(change: float, size: float) -> float:
    """Return how many digits of a `size`, m, hold where answers change by so much, m: 16 at the most."""
    return -math.log10(max(change / size, DOUBLE))


def newtons(force: float, digits: int = 3) -> str:
    """Return the size of a force (N) to so many digits, for a message: "2.4 N", "12,000 N"."""
    return f"{format_number(force, digits)} N"


def mm(*lengths: float) -> str:
    """Return a length (m), or a point, in millimetres to three digits, for a message: "1.5 mm", "(80, 12) mm"."""
    numbers = ", ".join(format_number(1e3 * float(length), 3) for length in lengths)
    return f"{numbers} mm" if len(lengths) == 1 else f"({numbers}) mm"
