"""A renderer of a body that moves, as all else asks it: in the frame of the body, where it owes what it owes at rest.

Whoever leads it gives the hand in the body's frame. Each tick places the body, takes the hand into the world, and the
answer back. A renderer that answers a stimulus whole is asked in the body's frame itself: there and back again would be
two steps of ours.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from hapticeval.errors import RendererError, renderer_errors
from hapticeval.renderer import Response, WrappedRenderer
from hapticeval.types import Array

if TYPE_CHECKING:
    from hapticeval.geometry.pose import Pose
    from hapticeval.recordings.channels import Signal
    from hapticeval.recordings.recording import Recording
    from hapticeval.scene import Scene
    from hapticeval.stimulus.motions import BodyMotion


def in_the_world(renderer: WrappedRenderer, scene: Scene) -> WrappedRenderer:
    """Return a renderer that is placed as the scene moves its body; itself where that rests.

    Raises `RendererError` for one that declares to support it and cannot be placed.
    """
    if scene.motion is None or not renderer.steps:
        return renderer
    if not renderer.places:
        raise RendererError(
            "the renderer declares support for 'moving' and has no place",
            why="place(rotation, translation) tells it where the body is",
            todo="add place, in C hr_place; or wrap the renderer: hapticeval.AtRest(renderer)",
        )
    # a compiled step knows of no pose
    return replace(renderer, renderer=InTheWorld(renderer, scene.motion), law=None)


class InTheWorld:
    """A renderer whose body moves by `motion`: asked in the body's frame, it answers in the world. See `in_the_world`.

    The motion begins with each reset, at time 0.
    """

    def __init__(self, renderer: WrappedRenderer, motion: BodyMotion) -> None:
        self.base, self.motion = renderer, motion
        self.time = 0.0
        self.before = motion.pose(0.0)

    @property
    def contact(self) -> bool | None:
        """Whether the last step was in contact, as the renderer reports it."""
        return self.base.contact

    def reset(self, hip: Array) -> None:
        """Start a run with the hand at `hip` (N,), m, in the body's frame, and the body where its motion begins."""
        self.time = 0.0
        self.before = self._place()
        self.base.reset(self.before.to_world(hip))

    def step(self, hip: Array, velocity: Array, dt: float) -> Any:
        """Answer one tick, all in the body's frame: `hip` (N,), m; `velocity` (N,), m/s; `dt`, s."""
        pose = self._place()
        hip_in_world = pose.to_world(hip)
        velocity_in_world = pose.velocity_in_world(self.before, hip, velocity, dt)
        self.before = pose
        self.time += dt
        answer = self.base.step(hip_in_world, velocity_in_world, dt)
        try:
            ihip, force = (np.asarray(vector, dtype=np.float64) for vector in answer)
        except (TypeError, ValueError):
            return answer  # whoever asked says what is wrong with it
        if ihip.shape != hip.shape or force.shape != hip.shape:
            return answer
        # a tool that is with the hand is with it to the last bit
        tool = hip.copy() if np.array_equal(ihip, hip_in_world) else pose.to_body(ihip)
        return Response(tool, pose.turned_back(force))

    def observe_force(self, push: Array) -> None:
        """Hand the hand's measured force (N,), N, on in the world's axes; asked where the base observes it."""
        self.base.observe_force(self.motion.pose(self.time).turned(push))

    def diagnostics(self, recording: Recording) -> Mapping[str, tuple[Signal, Array]]:
        """Return the base's own channels of a run; asked where it has any."""
        return self.base.diagnostics(recording)

    def _place(self) -> Pose:
        """Give the renderer the pose of this instant, and return it."""
        pose = self.motion.pose(self.time)
        with renderer_errors("place()"):
            # copies: what a renderer does to its arguments must not reach the next tick
            self.base.place(np.array(pose.rotation), np.array(pose.translation))
        return pose
