"""Deliberately broken renderers: the ideal rigid contact, each with one fault.

Each lets the ideal contact answer and spoils its recording in one way. What a fault must not touch is as important
as what it does: a mutant that fails two checks cannot tell which of them works.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np

from hapticeval.recordings.recording import Recording
from hapticeval.rigid_contact import ideal
from hapticeval.rigid_contact.contact import IdealContact
from hapticeval.scene import Scene
from hapticeval.stimulus.stimulus import Experiment, Path, Stimulus
from hapticeval.suite.case import Case
from hapticeval.suite.reading import load_suite

Spoil = Callable[[dict[str, np.ndarray], Recording, Scene, Stimulus], None]


class Mutant:
    """The ideal contact with its channels spoiled."""

    supports = IdealContact.supports

    def __init__(self, scene: Scene, spoil: Spoil) -> None:
        self.scene = scene
        self.spoil = spoil
        self.contact = ideal(scene)

    def simulate(self, stimulus: Stimulus, dt: float) -> Recording:
        true = self.contact.simulate(stimulus, dt)
        return Recording(true.time, self.spoiled(true, stimulus), true.meta)

    def spoiled(self, true: Recording, stimulus: Stimulus) -> dict[str, np.ndarray]:
        channels = {name: np.array(values) for name, values in true.channels.items()}
        self.spoil(channels, true, self.scene, stimulus)
        return channels


@cache
def answered(case: str, suite: str = "thesis") -> tuple[Scene, Stimulus, Recording]:
    """What the ideal contact answers in a case, once for all faults."""
    (found,) = [each for each in load_suite(suite).cases if each.name == case]
    scene = found.build_scene()
    contact = ideal(scene)
    stimulus = found.build_stimulus(scene, contact)
    return scene, stimulus, contact.simulate(stimulus, scene.sampling_time)


def touches(name: str, case: Case) -> bool:
    """Whether a fault changes anything in a case."""
    scene, stimulus, true = answered(case.name)
    spoiled = factory(name)(scene).spoiled(true, stimulus)
    return any(not np.array_equal(spoiled[channel], values) for channel, values in true.channels.items())


def _curved(scene: Scene) -> bool:
    curve = scene.model.curve
    return curve.closed and not curve.corners


def _along_surface(scene: Scene, points: np.ndarray, shift: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Surface points `shift` metres further along than `points`, and their normals."""
    curve = scene.model.curve
    u = curve.parameter(curve.arc_length(curve.nearest(points)) + shift)
    return np.asarray(curve.position(u)), np.asarray(curve.normal(u))


def _moved(channels: dict[str, np.ndarray], true: Recording, scene: Scene, shift: np.ndarray) -> None:
    """Shift the contact point along the surface, and the force's direction with it."""
    touching = true.contact
    position, normal = _along_surface(scene, true.ihip[touching], shift[touching])
    channels["ihip"][touching] = position
    strength = np.linalg.norm(true.force[touching], axis=1)
    outwards = np.sign(np.sum(true.force[touching] * np.asarray(_normals(scene, true.ihip[touching])), axis=1))
    channels["force"][touching] = normal * (strength * outwards)[:, None]


def _normals(scene: Scene, points: np.ndarray) -> np.ndarray:
    curve = scene.model.curve
    return np.asarray(curve.normal(curve.nearest(points)))


def jumps(channels, true, scene, stimulus):
    """Sliding freely on a curve, the contact point stands 6 mm further along in every second centimetre of arc."""
    if _curved(scene) and isinstance(stimulus, Experiment):
        curve = scene.model.curve
        s = curve.arc_length(curve.nearest(true.ihip))
        _moved(channels, true, scene, np.where(np.floor(s / 0.01) % 2 == 0, 6e-3, 0.0))


def skews(channels, true, scene, stimulus):
    """The force points 2 degrees aside: less than a corner's check calls a turn."""
    angle = np.radians(2.0)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    channels["force"] = true.force @ turn.T


def weakens(channels, true, scene, stimulus):
    """The force is a fifth too small while the operator pushes on a plane."""
    if not scene.model.curve.closed and not scene.bilateral:
        channels["force"] = 0.8 * true.force


def lingers(channels, true, scene, stimulus):
    """The virtual tool hangs on a convex corner, with its last force, for 200 ticks after the hand has left it."""
    tips = [corner.position for corner in scene.model.curve.corners if corner.convex]
    touching = np.flatnonzero(true.contact)
    if not tips or not touching.size:
        return
    last = int(touching[-1])
    tip = min(tips, key=lambda position: float(np.linalg.norm(true.ihip[last] - position)))
    if last + 201 < len(true) and np.linalg.norm(true.ihip[last] - tip) < 1e-3:
        channels["force"][last : last + 200] = true.force[last - 1]
        channels["ihip"][last : last + 200] = tip


def rounds(channels, true, scene, stimulus):
    """While the tool rests in a concave corner the HIP goes on as the hand is led, and stays so much aside."""
    if not isinstance(stimulus, Path) or not any(event["kind"] == "rest" for event in true.meta["events"]):
        return
    led = stimulus.sampled(true.dt)[1]
    resting = true.contact & (np.linalg.norm(true.velocity, axis=1) == 0.0)
    corners = [corner.position for corner in scene.model.curve.corners if not corner.convex]
    resting &= np.min([np.linalg.norm(true.ihip - position, axis=1) for position in corners], axis=0) < 1e-9
    first, last = np.flatnonzero(resting)[[0, -1]]
    channels["hip"][first : last + 1] += led[first : last + 1] - led[first]
    channels["hip"][last + 1 :] += led[last] - led[first]


def cushions(channels, true, scene, stimulus):
    """A collision takes the normal momentum out over 20 ticks instead of at once."""
    touching = true.contact
    struck = int(np.argmax(touching))
    if not isinstance(stimulus, Experiment) or scene.bilateral or struck == 0:
        return
    normal = scene.model.boundary.closest_point(true.ihip[struck : struck + 1]).normal[0]
    change = (true.velocity[struck + 1] - true.velocity[struck]) @ normal
    for k in range(1, 21):
        channels["velocity"][struck + k] -= (1.0 - k / 20.0) * change * normal
    impulse = true.force[struck].copy()
    channels["force"][struck : struck + 20] = impulse / 20.0


def widens(channels, true, scene, stimulus):
    """The centripetal force is paid for with position error: the HIP stands kappa v^2 m / K_p outside."""
    if not _curved(scene) or not isinstance(stimulus, Experiment):
        return
    curve = scene.model.curve
    u = curve.nearest(true.ihip)
    speed = np.sum(true.velocity * np.asarray(curve.tangent(u)), axis=1)
    error = np.asarray(curve.curvature(u)) * speed**2 * scene.mass / scene.stiffness
    error[~true.contact] = 0.0
    channels["hip"] = true.hip + error[:, None] * np.asarray(curve.normal(u))


def remembers(channels, true, scene, stimulus):
    """The contact point lags 1 mm behind in the direction of travel, so it depends on the way taken."""
    if not _curved(scene) or not isinstance(stimulus, Path):
        return
    first, last = stimulus.points[0], stimulus.points[-1]
    direction = np.sign(first[0] * last[1] - first[1] * last[0])
    _moved(channels, true, scene, np.full(len(true), -1e-3 * direction))


def releases(channels, true, scene, stimulus):
    """Under the surface of an ellipse the tool is let go half way: it is the hand then, wherever that is led."""
    if isinstance(stimulus, Path) and scene.model.name == "ellipse":
        late = len(true) // 2
        led = stimulus.sampled(true.dt)[1]
        channels["hip"][late:] = channels["ihip"][late:] = led[late:]
        channels["force"][late:] = 0.0


MUTANTS: dict[str, tuple[str, Spoil]] = {
    "jumps": ("continuous-contact", jumps),
    "releases": ("contact-kept", releases),
    "skews": ("contact-normal-force", skews),
    "weakens": ("contact-normal-force", weakens),
    "lingers": ("broken-contact", lingers),
    "rounds": ("abrupt-switch", rounds),
    "cushions": ("impulsive-collision", cushions),
    "widens": ("centripetal-force", widens),
    "remembers": ("memoryless", remembers),
}
"""Mutant: the check that it must fail, and its fault."""

BESIDES: dict[str, dict[str, str]] = {
    "skews": {"passivity": "a force with a curl drives the hand round"},
    "lingers": {"force-magnitude": "the last force, at a growing distance"},
    "rounds": {"force-magnitude": "a rigid contact's force, at a depth"},
    "remembers": {
        "continuous-contact": "the IHIP is not under the hand, which is on the surface",
        "force-magnitude": "the IHIP is aside, and the force a rigid contact's",
        "passivity": "the force turns with the IHIP",
    },
}
"""Mutant: what it fails besides, and why."""


def factory(name: str) -> Callable[[Scene], Mutant]:
    """A renderer factory for one mutant."""
    return lambda scene: Mutant(scene, MUTANTS[name][1])
