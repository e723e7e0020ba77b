"""Renderers of moving bodies, wrong and right: each takes the pose in another way.

Wrong ones do what libraries have done: a pose of the last tick, half of a pose, a proxy that stays behind in the world.
Right ones apply it by sub-steps, or answer late in the frame of the body.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from honest import Late

from hapticeval.discovery import resolve
from hapticeval.geometry.pose import Pose, resting_pose
from hapticeval.renderer import AtRest, Response
from hapticeval.scene import Scene

SIDE_STEPS = 32
"""Points of a sweep at which it is asked whether the tool is inside."""


class OfLastTick(AtRest):
    """Takes hand and answer by the pose of the tick before."""

    def place(self, rotation, translation):
        super().place(rotation, translation)
        self.now, self.pose = self.pose, self.before

    def step(self, hip, velocity, dt):
        answer = super().step(hip, velocity, dt)
        self.pose = self.now
        return answer


class Turned(AtRest):
    """Applies the rotation of a pose, and no translation."""

    def place(self, rotation, translation):
        super().place(rotation, 0.0 * translation)


class Shifted(AtRest):
    """Applies the translation of a pose, and no rotation."""

    def place(self, rotation, translation):
        super().place(np.eye(translation.size), translation)


class ForceOfBody(AtRest):
    """Leaves the force in the body's axes."""

    def step(self, hip, velocity, dt):
        answer = super().step(hip, velocity, dt)
        return Response(answer.ihip, self.pose.turned_back(answer.force))


class WorldsVelocity(AtRest):
    """Damps the velocity in the world, not that relative to the body."""

    def step(self, hip, velocity, dt):
        pose = self.pose
        ihip, force = self.renderer.step(pose.to_body(hip), pose.turned_back(velocity), dt)
        return Response(pose.to_world(ihip), pose.turned(force))


class ForgetsPose(AtRest):
    """Forgets the pose in a reset: the tool starts where the hand would be in a body at rest."""

    def reset(self, hip):
        self.pose = resting_pose(hip.size)
        super().reset(hip)


class SubStepped(AtRest):
    """Right: moves from pose to pose in four steps, and the hand along with it."""

    def step(self, hip, velocity, dt):
        early, late, resting = self.before, self.pose, hip - velocity * dt
        start, end = early.to_body(resting), late.to_body(hip)
        relative = late.velocity_in_body(early, end, velocity, dt)
        for share in (0.25, 0.5, 0.75, 1.0):
            ihip, force = self.renderer.step(start + share * (end - start), relative, 0.25 * dt)
        return Response(late.to_world(np.asarray(ihip)), late.turned(np.asarray(force)))


class Swept:
    """A proxy that is swept to the hand, and stays on the surface while the hand is inside.

    It moves with the body before it is swept, from where it was. Not `carried` it is left behind in the world: the body
    runs into it, and it takes itself for free. Swept `by_hand` it goes the way of the hand alone. For convex bodies.
    """

    supports = frozenset({"moving"})

    def __init__(self, scene: Scene, *, carried: bool = True, by_hand: bool = False) -> None:
        self.boundary, self.stiffness = scene.model.boundary, scene.stiffness
        self.carried, self.by_hand = carried, by_hand
        self.pose: Pose | None = None
        self.proxy: np.ndarray | None = None

    def place(self, rotation, translation):
        pose = Pose(rotation, translation)
        if self.carried and self.pose is not None and self.proxy is not None:
            self.proxy = pose.to_world(self.pose.to_body(self.proxy))
        self.pose = pose

    def reset(self, hip):
        self.proxy, self.hip, self.touches = hip.copy(), hip.copy(), False

    def step(self, hip, velocity, dt):
        start, goal = (self.pose.to_body(point) for point in (self.hip if self.by_hand else self.proxy, hip))
        way = start + np.linspace(0.0, 1.0, SIDE_STEPS)[:, np.newaxis] * (goal - start)
        inside = self.boundary.signed_distance(way) < -1e-9
        self.touches = bool(inside[-1]) and (not inside[0] or (self.by_hand and self.touches))
        ihip = self.boundary.closest_point(goal[np.newaxis]).foot[0] if self.touches else goal
        self.proxy, self.hip = self.pose.to_world(ihip), hip.copy()
        return Response(self.proxy.copy(), self.pose.turned(self.stiffness * (ihip - goal)))


def of(kind, base="constraint"):
    """The factory of a way to take poses, around a renderer of ours at rest."""

    def make(scene: Scene):
        return kind(resolve(base)(replace(scene, motion=None)))

    make.supports = {"moving", "plane", "space"}
    make.__name__ = kind.__name__
    return make


class ThriceLate(Late):
    """Answers with what it found three ticks ago."""

    ticks = 3


def late_in_body(scene: Scene):
    """Right: late by three ticks in the frame of the body."""
    still = replace(scene, motion=None)
    return AtRest(ThriceLate(still, resolve("constraint")(still)))


late_in_body.supports = {"moving", "plane", "space"}

DAMPED = "constraint+pp-v"
"""A law whose damper brakes along the surface too: its tangential drag is of the relative velocity."""
