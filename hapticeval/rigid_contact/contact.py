"""The ideal rigid contact as a renderer with tool physics of its own: a stimulus in, a recording out."""

from __future__ import annotations

import math
from typing import Any, NamedTuple, Protocol

import numpy as np

from hapticeval.errors import InputError, RefusalError, in_m
from hapticeval.recordings.recording import Recording
from hapticeval.records import as_record, room_for
from hapticeval.rigid_contact.force import (
    EVENT_KINDS,
    HOP_SHARE,
    LOAD,
    MOST_SAMPLE_STEPS,
    POSITION_ROUNDING,
    SKIN_SHARE,
    Stretches,
)
from hapticeval.scene import Scene
from hapticeval.stimulus.stimulus import Experiment, Path, Stimulus, sample_times
from hapticeval.types import Array, IntArray

ON_BOUNDARY = 1e-9
"""Distance (m) from the boundary up to which a start counts as being on it: coordinates have nine digits or so."""

FIRST_EVENTS, MORE_EVENTS = 256, 8
"""Events that there is room for in a first run, and how many times as many in each one after it."""

MOST_CONTACT_EVENTS = 4_000_000
"""Room for events from which on a run that needs more is given up."""

KNOT_ROUNDING = 1e-9
"""Share of a sample up to which a knot of the stimulus counts as being on it."""


class Ground(Protocol):
    """A model's boundary prepared for the tool: a plane curve, a triangle mesh, or a smooth surface.

    It is made of a scene, once, and raises `RefusalError` there for what it cannot do, by name and place. A state is
    the numbers of a record of its own, for its own `carry` alone. N is the model's dimension.
    """

    def in_flight(self, point: Array, velocity: Array) -> Array:
        """Return the state of a tool that flies from a point (N,), m, outside, with a velocity (N,), m/s."""

    def on_boundary(self, point: Array, velocity: Array) -> Array:
        """Return the state of a tool at the boundary's nearest point of a point (N,), m, with a velocity (N,), m/s.

        The velocity need not be along the boundary: what the boundary does to it, the first step of `carry` does.
        """

    def carry(
        self, start: Array, stretches: Stretches, gains: Array, rows: int, limit: int
    ) -> tuple[Array, Array, int, Array]:
        """Carry the tool from a state through all stretches; both `start` and `gains` are changed.

        `start` is a state of this ground. `gains` (k,) are the numbers of a `LOAD`, its constants filled in. Returns
        `samples`, `events`, `count` and `given_up_at`:

        - `samples` (rows, 4 N): position (m) and velocity (m/s) at each sample, before an impact at that very time,
          then the contact's and the operator's impulse (N s) until the next.
        - `events` (k, 2 + 2 N): time (s), number in `EVENT_KINDS`, position (m) and impulse (N s).
        - `count` of events. Those above `limit` are not kept; they end the run.
        - `given_up_at`, empty, or the time (s) and place (m), (1 + N,), at which the run was given up:
          `MOST_SAMPLE_STEPS`.
        """


class _Drive(NamedTuple):
    """What moves the tool over a run: the operator's force at its knots, or the places of a hand that draws the tool.

    - `time` (n,), s: the samples.
    - `knots` (k,), s, with `values` and `slopes` (k, N), N and N/s: the prescribed force, straight from knot to knot.
      Where it `holds_places` they are those of the hand, m and m/s.
    - `start`: the state of the `Ground` in which the run starts.
    - `spring` (N/m) and `damper` (N s/m): between hand and tool.
    """

    time: Array
    knots: Array
    values: Array
    slopes: Array
    start: Array
    spring: float
    damper: float
    holds_places: bool

    def cut_into_stretches(self, dt: float) -> Stretches:
        """Return the run in stretches within which the operator's force is linear in time; samples are `dt` s apart."""
        began, lasts, samples = _cut_at_knots(self.time, self.knots, dt)
        # the knot before the middle of each stretch; -1 before the first: the force is held there
        segment = np.searchsorted(self.knots, began + 0.5 * lasts, side="right") - 1
        knot = np.maximum(segment, 0)
        slope = np.where(segment[:, np.newaxis] < 0, 0.0, self.slopes[knot])
        value = self.values[knot] + slope * (began - self.knots[knot])[:, np.newaxis]
        if self.holds_places:
            # a spring to the hand's path: g0 = k y_d + d y_d', g1 = k y_d'
            value, slope = self.spring * value + self.damper * slope, self.spring * slope
        return Stretches(began, lasts, np.hstack([value, slope]), samples)


class IdealContact:
    """A point tool of `scene.mass` on the rigid, frictionless model: the ground truth of all verdicts.

    - It flies by m y'' = F_o.
    - It slides by thesis (3.1) with the contact force N = -F_o.nu - m v.S v along the outward normal ((3.3), (3.8)), S
      the shape operator (kappa in the plane), and leaves where N reaches zero, or at a convex edge or corner.
    - It collides by (3.5), and rests in a concave corner while the force points into its zone.

    A bilateral scene holds the tool on the boundary: it never leaves, N has any sign, and at a corner the velocity
    across the next face is lost.

    The tool is all that moves, whatever robot the scene names; `ground` is the scene's boundary.
    """

    supports = frozenset({"bilateral", "force-sensor", "moving", "plane", "space"})
    """Not viscosity: (3.1) slides without friction. The hand's force moves the tool, so that no sensor is needed."""

    def __init__(self, scene: Scene, ground: Ground) -> None:
        self.scene = scene
        self._ground = ground

    def simulate(self, stimulus: Stimulus, dt: float) -> Recording:
        """Return the tool's motion, sampled every `dt` seconds.

        - An `Experiment` pushes the tool, and its hand draws it by its own spring.
        - Along a `Path` the hand holds it through the critically damped spring F_o = K (path - y) + 2 sqrt(K m) (path'
          - y') with the scene's stiffness.

        The tool starts on the path with the path's velocity, or, if that is inside the model or the scene is bilateral,
        at rest on the nearest point of the boundary.

        Channels:

        - `hip` = `ihip` = the tool, which cannot penetrate;
        - `velocity` at the sample, before an impact at that very time;
        - `force` (of the contact on the tool) and `operator_force` as means until the next sample, impulses included,
          so that (force + operator_force) dt adds up to the change of momentum.

        `meta["events"]` lists impacts, departures, corners and rests: `time`, `kind`, `position` (N numbers, m),
        `impulse` (N numbers, N s).

        Raises `InputError` for a stimulus of another dimension than the model's and a sampling time that is not
        positive, and `RefusalError` for a hand that only brakes and an experiment that starts inside a
        unilateral model.
        """
        self._refuse_unfit(stimulus, dt)
        gains = self._gains_without_hand()
        load = as_record(gains, LOAD)  # the same numbers, by name: what is written below is for `carry`
        drive = self._along_path(stimulus, dt) if isinstance(stimulus, Path) else self._by_experiment(stimulus, dt)
        load.spring, load.damper = drive.spring, drive.damper
        out, events = self._follow_stretches(drive.start, drive.cut_into_stretches(dt), gains, drive.time.size)
        return self._as_recording(stimulus, drive.time, out, events, dt)

    def _refuse_unfit(self, stimulus: Stimulus, dt: float) -> None:
        """Raise `InputError` for a sampling time, s, or a stimulus that no run can be made of."""
        dimension = self.scene.model.dimension
        if not (math.isfinite(dt) and dt > 0.0):
            raise InputError(f"a sampling time of {dt!r} s", todo="give a positive one")
        if stimulus.dimension != dimension:
            raise InputError(
                f"the stimulus has {stimulus.dimension} dimensions",
                why=f"the model '{self.scene.model.name}' has {dimension}",
                todo="project a path in space onto a plane model; give one in the plane a third coordinate",
            )

    def _along_path(self, path: Path, dt: float) -> _Drive:
        """Return what moves the tool along a path, sampled every `dt` s: a critically damped spring, 2 sqrt(k m)."""
        knots, places = path.time - path.time[0], path.points
        # The hand goes on straight beyond the path's end: a stop would be felt in the last sample's mean force.
        rates = _slopes(knots, places)
        rates[-1] = rates[-2]
        return _Drive(
            time=path.sampled(dt)[0],
            knots=knots,
            values=places,
            slopes=rates,
            start=self._start_of_path(places[0], rates[0]),
            spring=self.scene.stiffness,
            damper=2.0 * math.sqrt(self.scene.stiffness * self.scene.mass),
            holds_places=True,
        )

    def _by_experiment(self, experiment: Experiment, dt: float) -> _Drive:
        """Return what moves the tool in an experiment, sampled every `dt` s; refuses one as `simulate` says."""
        hand = experiment.hand
        # a damper alone has no closed form here, see `fly_for`
        if hand is not None and hand.stiffness == 0.0 < hand.damping:
            raise RefusalError(
                "the hand only brakes", why="the ideal contact flies in closed form under a spring or a push"
            )
        knots, forces, rates = _prescribed_forces(experiment)
        return _Drive(
            time=sample_times(experiment.duration, dt),
            knots=knots,
            values=forces,
            slopes=rates,
            start=self._start_of_experiment(experiment),
            spring=0.0 if hand is None else hand.stiffness,
            damper=0.0 if hand is None else hand.damping,
            holds_places=False,
        )

    def _gains_without_hand(self) -> Array:
        """Return the numbers of a `LOAD` as the scene gives them, without spring and damper of the hand."""
        gains = np.zeros(room_for(LOAD))
        load = as_record(gains, LOAD)
        load.mass, load.restitution = self.scene.mass, self.scene.restitution
        load.bilateral = float(self.scene.bilateral)
        size, farthest = self.scene.model.size, float(np.abs(self.scene.model.boundary.bounds).max())
        load.hop = HOP_SHARE * size
        # a line has no end: its coordinates are those of its size
        load.rounding = POSITION_ROUNDING * (farthest if math.isfinite(farthest) else size)
        load.skin = SKIN_SHARE * size + load.rounding
        return gains

    def _as_recording(
        self, stimulus: Stimulus, time: Array, out: Array, events: list[dict[str, Any]], dt: float
    ) -> Recording:
        """Return the recording of the samples `out` (n, 4 N) at `time` (n,), s, of `Ground.carry`, and the events."""
        # position and velocity at each sample, both impulses until the next
        place, velocity, contact_impulse, operator_impulse = np.split(out, 4, axis=1)
        channels = {
            "hip": place,
            "ihip": place,
            "velocity": velocity,
            # mean over the sample: impulse by its length
            "force": contact_impulse / dt,
            "operator_force": operator_impulse / dt,
        }
        meta: dict[str, Any] = {
            "source": "playback" if isinstance(stimulus, Path) else "experiment",
            "dt": dt,
            "model": self.scene.model.name,
            "resolution": 0.0,
            "standoff": 0.0,
            "events": events,
        }
        if isinstance(stimulus, Experiment):
            meta["quiet_from"] = stimulus.quiet_from
        return Recording(time, channels, meta)

    def _follow_stretches(
        self, start: Array, stretches: Stretches, gains: Array, rows: int
    ) -> tuple[Array, list[dict[str, Any]]]:
        """Return the samples (rows, 4 N) of the run and its events, with a log as long as it takes.

        Raises `RefusalError`, with time and place, where one sample takes more than `MOST_SAMPLE_STEPS` steps.
        """
        limit = FIRST_EVENTS
        while True:
            out, log, count, given_up_at = self._ground.carry(start.copy(), stretches, gains.copy(), rows, limit)
            if given_up_at.size:
                raise RefusalError(
                    f"the ideal contact with '{self.scene.model.name}' takes more than {MOST_SAMPLE_STEPS} steps "
                    f"within one sample, {given_up_at[0]:.6g} s into the run, at {in_m(given_up_at[1:])}",
                    why="its hops do not come to an end, rounding changes what holds it again and again, or it turns "
                    "far faster than it is sampled",
                    todo="choose a restitution further below 1, a softer or slower hand, or move the stimulus by more "
                    "than rounding",
                )
            if count <= limit:
                break
            if limit >= MOST_CONTACT_EVENTS:
                raise InputError(
                    f"the tool touches the model '{self.scene.model.name}' more than {limit} times",
                    why="its hops do not come to an end",
                    todo="shorten the run, or choose a restitution further below 1",
                )
            # run again with a longer log
            limit *= MORE_EVENTS
        return out, [
            {
                "time": row[0],
                "kind": EVENT_KINDS[int(row[1])],
                "position": row[2 : 2 + self.scene.model.dimension],
                "impulse": row[2 + self.scene.model.dimension :],
            }
            for row in log[:count].tolist()
        ]

    def _start_of_experiment(self, experiment: Experiment) -> Array:
        """Return the state in which an experiment starts. Raises `RefusalError` for one inside the model."""
        distance = self._signed_distance(experiment.position)
        if distance < -ON_BOUNDARY and not self.scene.bilateral:
            raise RefusalError(
                f"the experiment starts {-distance:.6g} m inside the model '{self.scene.model.name}'",
                why="a rigid object cannot be entered",
                todo="start outside or on the boundary",
            )
        if self.scene.bilateral or distance <= ON_BOUNDARY:
            return self._ground.on_boundary(experiment.position, experiment.velocity)
        return self._ground.in_flight(experiment.position, experiment.velocity)

    def _start_of_path(self, point: Array, velocity: Array) -> Array:
        """Return the state at a path's first point (N,), m: in flight, or at rest on the boundary."""
        if self.scene.bilateral or self._signed_distance(point) <= 0.0:
            return self._ground.on_boundary(point, np.zeros_like(point))
        return self._ground.in_flight(point, velocity)

    def _signed_distance(self, point: Array) -> float:
        """Return the signed distance (m) of a point (N,), m, from the boundary."""
        return float(self.scene.model.boundary.signed_distance(point[np.newaxis])[0])


def _prescribed_forces(experiment: Experiment) -> tuple[Array, Array, Array]:
    """Return knots (k,), s, and from each on the prescribed force (N) and its rate (N/s), both (k, N).

    It is what the operator prescribes, and what of the hand's force comes from its path alone, k y_d + b y_d'.
    """
    hand = experiment.hand
    if hand is None:
        knots, values = experiment.force_time, experiment.force
        return knots, values, _slopes(knots, values)
    began = hand.path.time - hand.path.time[0]
    knots = np.union1d(experiment.force_time, began)
    drawn = np.column_stack([np.interp(knots, began, column) for column in hand.path.points.T])
    rates, values = _slopes(knots, drawn), experiment.operator_force(knots)
    slopes = _slopes(knots, values)
    return knots, values + hand.stiffness * drawn + hand.damping * rates, slopes + hand.stiffness * rates


def _slopes(knots: Array, values: Array) -> Array:
    """Return the rates (k, N) at which `values` (k, N) change from each of `knots` (k,) on; zero from the last."""
    return np.vstack([np.diff(values, axis=0) / np.diff(knots)[:, np.newaxis], np.zeros((1, values.shape[1]))])


def _cut_at_knots(time: Array, knots: Array, dt: float) -> tuple[Array, Array, IntArray]:
    """Return the run cut at samples and at the stimulus's knots: (s,) beginnings, lengths (s), and samples."""
    end = time[-1] + dt
    steps = knots / dt
    # knots that fall on samples, to rounding, cut nothing
    between = knots[(knots > 0.0) & (knots < end) & (np.abs(steps - np.round(steps)) > KNOT_ROUNDING)]
    cuts = np.union1d(np.append(time, end), between)
    began, lasts = cuts[:-1], np.diff(cuts)
    samples = np.searchsorted(time, began, side="right") - 1
    return began, lasts, samples.astype(np.int64)
