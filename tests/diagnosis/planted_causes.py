"""Contacts along drawn hand paths, and faults planted in them as a renderer or a log would have them, tick by tick."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from hapticeval import resolve
from hapticeval.diagnosis import RightContact, right_contact
from hapticeval.geometry.catalogue import make_model
from hapticeval.geometry.model import Model
from hapticeval.scene import Scene
from hapticeval.simulation.answers import make_renderer
from hapticeval.simulation.playback import play
from hapticeval.stimulus.stimulus import Path
from hapticeval.types import Array

MODELS: Mapping[str, Mapping[str, Any]] = {
    "circle": {},
    "cassinian": {},
    "ellipse": {},
    "star": {},
    "sphere": {},
    "ellipsoid": {},
    "cube": {},
    "icosphere": {"subdivisions": 2},
    "wedge": {},
}
FACETED = ("star", "cube", "wedge", "icosphere")


class Planted(NamedTuple):
    """What a fault makes of a right contact: force (n, N), N, and contact points (n, N), m; None where not recorded."""

    force: Array
    ihip: Array | None


@dataclass(frozen=True)
class Situation:
    """A right contact and the model it is with."""

    contact: RightContact
    model: Model
    rng: np.random.Generator
    faceted: bool
    damping: float

    def lead(self, hip: Array) -> Array | None:
        """Return the contact points of a right renderer led along `hip` (n, N), m; None where they are the nearest."""
        return lead(self.model, hip) if self.faceted else None


def lead(model: Model, hip: Array) -> Array:
    scene = Scene(model=model, stiffness=1.0, damping=0.0)
    return play(make_renderer(resolve("constraint"), scene), Path(np.arange(len(hip)) / 1e3, hip), 1e-3).ihip


def draw_situation(rng: np.random.Generator, *, seconds: float | None = None) -> Situation:
    """Draw a model, a hand that presses and slides on it, and the right contact along its path."""
    kind = str(rng.choice(list(MODELS)))
    model = make_model(kind, **MODELS[kind])
    stiffness, damping = float(rng.choice([200.0, 500.0, 1000.0])), float(rng.choice([0.0, 0.0, 2.0]))
    dimension = model.boundary.dimension
    duration = float(rng.uniform(2.0, 6.0)) if seconds is None else seconds
    time = np.arange(int(1e3 * duration)) / 1e3
    while True:
        start = model.boundary.points(200)[rng.integers(200)]
        at = model.boundary.closest_point(start[None])
        normal = at.normal[0]
        hip = np.tile(start, (time.size, 1))
        for axis in np.linalg.svd(normal[None])[2][1:]:
            rate, phase = rng.uniform(0.3, 1.2), rng.uniform(0.0, 2.0 * np.pi)
            hip += np.outer(
                rng.uniform(0.08, 0.25) * model.size * (np.sin(2 * np.pi * rate * time + phase) - np.sin(phase)), axis
            )
        rate, phase = rng.uniform(0.5, 2.0), rng.uniform(0.0, 2.0 * np.pi)
        second = rng.uniform(1.1, 2.3)
        deep = 0.03 * model.size * rng.uniform(0.5, 1.5)
        wave = np.sin(2 * np.pi * rate * time + phase) + 0.5 * np.sin(2 * np.pi * rate * second * time)
        # follows the surface: what the slide adds to the distance is taken off
        closest = model.boundary.closest_point(hip)
        hip = hip - np.outer(deep * (wave + 0.4), normal)
        if kind not in FACETED:
            hip = closest.foot - (deep * (wave + 0.4))[:, None] * closest.normal
        touching = model.boundary.signed_distance(hip) < 0.0
        # starts in free space, as a renderer's reset asks for
        if touching.mean() > 0.15 and touching.mean() < 0.9:
            first = int(np.argmin(touching))
            hip = hip[first:]
            break
    time = np.arange(len(hip)) / 1e3
    velocity = np.vstack([np.zeros(dimension), np.diff(hip, axis=0)]) * 1e3
    points = None
    if kind in FACETED:
        points = lead(model, hip)
    contact = right_contact(model.boundary, time, hip, velocity, stiffness=stiffness, damping=damping, points=points)
    return Situation(contact, model, rng, kind in FACETED, damping)


def asked_of(contact: RightContact, points: Array) -> Array:
    """Return the spring's force to other contact points, with the damper where they are off the hand, (n, N), N."""
    damper = contact.force - contact.stiffness * (contact.point - contact.hip)
    return contact.stiffness * (points - contact.hip) + np.where(
        np.any(points != contact.hip, axis=1)[:, None], damper, 0.0
    )


def _late(signal: Array, ticks: int, first: Array) -> Array:
    past, answers = [first] * ticks, []
    for row in signal:
        past.append(row)
        answers.append(past[-1 - ticks])
    return np.array(answers)


def _low_passed(signal: Array, seconds: float, step: float, first: Array) -> Array:
    share, state, answers = 1.0 - np.exp(-step / seconds), first, []
    for row in signal:
        state = state + share * (row - state)
        answers.append(state)
    return np.array(answers)


def _held(signal: Array, ticks: int) -> Array:
    answers = []
    for tick, row in enumerate(signal):
        if tick % ticks == 0:
            current = row
        answers.append(current)
    return np.array(answers)


def _factor(rng: np.random.Generator) -> float:
    """A gain that is off by 5 % to a factor of 3, and no unit's."""
    return float(np.exp(rng.choice([-1.0, 1.0]) * rng.uniform(0.05, 0.7)))


def _rotation(rng: np.random.Generator, dimension: int) -> Array:
    angle = rng.choice([-1.0, 1.0]) * rng.uniform(np.radians(5.0), np.radians(80.0))
    turn = np.eye(dimension)
    i, j = rng.choice(dimension, 2, replace=False)
    turn[i, i] = turn[j, j] = np.cos(angle)
    turn[i, j], turn[j, i] = -np.sin(angle), np.sin(angle)
    return turn


Fault = Callable[[Situation], Planted]
FAULTS: dict[str, Fault] = {}


def fault(name: str) -> Callable[[Fault], Fault]:
    def register(plant: Fault) -> Fault:
        FAULTS[name] = plant
        return plant

    return register


def _force_only(change: Callable[[Array, RightContact, np.random.Generator], Array]) -> Fault:
    return lambda situation: Planted(
        change(situation.contact.force.copy(), situation.contact, situation.rng), situation.contact.point
    )


def _size(force: Array) -> float:
    return float(np.linalg.norm(force, axis=1).max())


FAULTS |= {
    "gain": _force_only(lambda f, c, r: _factor(r) * f),
    "unit": _force_only(
        lambda f, c, r: float(r.choice([1e3, 1e-3, 9.80665, 1 / 9.80665, 4.4482216, 1 / 4.4482216, 25.4])) * f
    ),
    "sign": _force_only(lambda f, c, r: -f),
    "bias": _force_only(lambda f, c, r: f + r.uniform(0.02, 0.3) * _size(f) * _direction(r, f.shape[1])),
    "drift": _force_only(
        lambda f, c, r: f + np.outer(c.time, r.uniform(0.01, 0.1) * _size(f) * _direction(r, f.shape[1]))
    ),
    "drag": _force_only(lambda f, c, r: f - r.uniform(0.3, 5.0) * c.slide),
    "friction": _force_only(lambda f, c, r: f - r.uniform(0.03, 0.4) * np.linalg.norm(f, axis=1)[:, None] * _along(c)),
    "damping": _force_only(lambda f, c, r: f - r.uniform(0.3, 5.0) * c.velocity * c.touches[:, None]),
    "damping everywhere": _force_only(lambda f, c, r: f - r.uniform(0.3, 5.0) * c.velocity),
    "normal damping": _force_only(
        lambda f, c, r: f - r.uniform(0.3, 5.0) * (c.normal_speed * c.touches)[:, None] * c.normal
    ),
    "lag": _force_only(lambda f, c, r: _late(f, int(r.integers(4, 40)), f[0])),
    "low-pass": _force_only(
        lambda f, c, r: _low_passed(f, float(np.exp(r.uniform(np.log(5e-4), np.log(0.03)))), c.step, f[0])
    ),
    "hold": _force_only(lambda f, c, r: _held(f, int(r.integers(3, 25)))),
    "limit": _force_only(lambda f, c, r: _cut(f, r.uniform(0.3, 0.9) * _size(f))),
    "limit of each axis": _force_only(
        lambda f, c, r: np.clip(f, *(np.array([-1, 1]) * r.uniform(0.3, 0.9) * np.abs(f).max()))
    ),
    "dead band": _force_only(
        lambda f, c, r: np.where(np.linalg.norm(f, axis=1, keepdims=True) < r.uniform(0.05, 0.4) * _size(f), 0.0, f)
    ),
    "gain of an axis": _force_only(lambda f, c, r: f * _one_axis(r, f.shape[1], _factor(r))),
    "axes": _force_only(lambda f, c, r: f @ _signed(r, f.shape[1]).T),
    "rotation": _force_only(lambda f, c, r: f @ _rotation(r, f.shape[1]).T),
    "crosstalk": _force_only(lambda f, c, r: f @ _crosstalk(r, f.shape[1]).T),
    "power of the depth": _force_only(lambda f, c, r: _powered(c, float(r.choice([0.5, 1.5, 2.0, 3.0])))),
    "gain at depths": _force_only(lambda f, c, r: _gain_beyond(f, c.depth, c, r)),
    "gain at speeds into the model": _force_only(
        lambda f, c, r: np.where((c.normal_speed < 0.0)[:, None], f, _factor(r) * f)
    ),
    "gain where": _force_only(lambda f, c, r: _gain_beyond(f, c.point[:, int(r.integers(f.shape[1]))], c, r)),
    "gain at times": _force_only(lambda f, c, r: _gain_beyond(f, c.time, c, r)),
    "gain where two faces hold the tool": _force_only(lambda f, c, r: np.where(c.cornered[:, None], _factor(r) * f, f)),
    "lag + gain": _force_only(lambda f, c, r: _factor(r) * _late(f, int(r.integers(4, 40)), f[0])),
    "low-pass + bias": _force_only(
        lambda f, c, r: (
            _low_passed(f, float(np.exp(r.uniform(np.log(2e-3), np.log(0.03)))), c.step, f[0])
            + r.uniform(0.02, 0.3) * _size(f) * _direction(r, f.shape[1])
        )
    ),
    "gain + drag": _force_only(lambda f, c, r: _factor(r) * f - r.uniform(0.5, 5.0) * c.slide),
    "bias + gain": _force_only(
        lambda f, c, r: _factor(r) * f + r.uniform(0.02, 0.3) * _size(f) * _direction(r, f.shape[1])
    ),
}


@fault("offset")
def _(situation: Situation) -> Planted:
    contact, rng = situation.contact, situation.rng
    offset = float(rng.choice([-1.0, 1.0]) * rng.uniform(0.05, 0.5)) * float(contact.depth.max()) * 0.5
    beyond = np.maximum(contact.depth + offset, 0.0)
    force = contact.stiffness * beyond[:, None] * contact.normal
    return Planted(force, contact.hip + beyond[:, None] * contact.normal)


@fault("early release")
def _(situation: Situation) -> Planted:
    contact, rng = situation.contact, situation.rng
    depth = rng.uniform(0.1, 0.5) * contact.depth.max()
    gone = (contact.depth < depth) & (contact.normal_speed > 0.0)
    force = np.where(gone[:, None], 0.0, contact.force)
    return Planted(force, np.where(gone[:, None], contact.hip, contact.point))


@fault("residue")
def _(situation: Situation) -> Planted:
    """The last force and contact point stay for some ticks."""
    contact, rng = situation.contact, situation.rng
    ticks, force = int(rng.integers(4, 30)), contact.force.copy()
    since = 10**6
    last = np.zeros(force.shape[1])
    for tick in range(len(force)):
        since = 0 if contact.touches[tick] else since + 1
        if since == 0:
            last = contact.force[tick]
        elif since <= ticks:
            force[tick] = last
    return Planted(force, contact.point)


def _both(change: Callable[[Array, RightContact, np.random.Generator], Array]) -> Fault:
    """A fault of the contact point, with the spring's force to it."""

    def plant(situation: Situation) -> Planted:
        points = change(situation.contact.point, situation.contact, situation.rng)
        return Planted(asked_of(situation.contact, points), points)

    return plant


def _all_late(situation: Situation) -> Planted:
    ticks = int(situation.rng.integers(4, 40))
    contact = situation.contact
    return Planted(_late(contact.force, ticks, contact.force[0]), _late(contact.point, ticks, contact.point[0]))


IHIP_FAULTS: dict[str, Fault] = {
    "lag": _all_late,
    "lag ": _both(lambda p, c, r: np.where(c.touches[:, None], _late(p, int(r.integers(4, 30)), p[0]), c.hip)),
    "hold": _both(lambda p, c, r: _held(p, int(r.integers(3, 20)))),
    "low-pass": _both(lambda p, c, r: _low_passed(p, float(r.uniform(2e-3, 0.03)), c.step, p[0])),
}


def with_coupled_tool(situation: Situation) -> Situation:
    """Return a situation whose tool is late and sinks in, as a coupling has it: its points are those to compare with.

    The contact point of a rigid tool on a flat face stands still along the normal, where a damper between tool and hand
    and one along the normal are the same.
    """
    led, rng = situation.contact, situation.rng
    late = _low_passed(led.point, float(rng.uniform(0.01, 0.1)), led.step, led.point[0])
    points = late + rng.uniform(0.02, 0.1) * (led.hip - led.point)
    points = np.where(led.touches[:, None], points, led.hip)
    boundary, damping = situation.model.boundary, situation.damping
    contact = right_contact(
        boundary, led.time, led.hip, led.velocity, stiffness=led.stiffness, damping=damping, points=points
    )
    return replace(situation, contact=contact)


def _coupling_damper(contact: RightContact, rng: np.random.Generator) -> Array:
    damper: Array = rng.uniform(0.3, 5.0) * (contact.point_velocity - contact.velocity)
    return damper


COUPLED_FAULTS: dict[str, Fault] = {
    "coupling damping": _force_only(lambda f, c, r: f + _coupling_damper(c, r)),
    "gain + coupling damping": _force_only(lambda f, c, r: _factor(r) * f + _coupling_damper(c, r)),
}
"""Faults of tools that are tied to the hand, see `with_coupled_tool`. A log has no points of its tool."""


def _direction(rng: np.random.Generator, dimension: int) -> Array:
    vector = rng.standard_normal(dimension)
    return vector / np.linalg.norm(vector)


def _along(contact: RightContact) -> Array:
    speed = np.linalg.norm(contact.slide, axis=1, keepdims=True)
    return np.divide(contact.slide, speed, out=np.zeros_like(contact.slide), where=speed > 0.0)


def _cut(force: Array, level: float) -> Array:
    size = np.linalg.norm(force, axis=1, keepdims=True)
    return force * np.minimum(1.0, level / np.maximum(size, 1e-300))


def _one_axis(rng: np.random.Generator, dimension: int, factor: float) -> Array:
    gains = np.ones(dimension)
    gains[rng.integers(dimension)] = factor
    return gains


def _signed(rng: np.random.Generator, dimension: int) -> Array:
    while True:
        matrix = np.diag(rng.choice([-1.0, 1.0], dimension)) @ np.eye(dimension)[rng.permutation(dimension)]
        if abs(np.trace(matrix)) < dimension - 0.5:
            return matrix


def _crosstalk(rng: np.random.Generator, dimension: int) -> Array:
    matrix = np.eye(dimension)
    i, j = rng.choice(dimension, 2, replace=False)
    matrix[i, j] = rng.choice([-1.0, 1.0]) * rng.uniform(0.05, 0.4)
    return matrix


def _powered(contact: RightContact, exponent: float) -> Array:
    top = contact.depth.max()
    share = np.where(contact.touches, np.maximum(contact.depth, 0.0) / top, 0.0)
    return contact.stiffness * top * (share**exponent)[:, None] * contact.normal


def _gain_beyond(force: Array, values: Array, contact: RightContact, rng: np.random.Generator) -> Array:
    low = np.quantile(values[contact.touches], rng.uniform(0.25, 0.75))
    return np.where((values > low)[:, None], _factor(rng) * force, force)


def as_logged(planted: Planted, situation: Situation) -> tuple[Array, Array]:
    """Return hand (n, N), m, and force (n, N), N, as sensors give them: 0.01 to 0.05 N of noise, steps of 10 um."""
    rng = situation.rng
    noise = rng.uniform(0.01, 0.05)
    hip = np.round(situation.contact.hip / 1e-5) * 1e-5
    return hip, planted.force + noise * rng.standard_normal(planted.force.shape)


def is_planted(kind: str, name: str) -> bool:
    """Return whether the `name` of a cause is that of the planted `kind`."""
    kind = kind.strip()
    return name.startswith(kind) if kind == "gain where" else set(kind.split(" + ")) == set(name.split(" + "))
