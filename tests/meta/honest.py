"""Right renderers as real ones differ: late, in single precision, answering lists, at a distance, or force only.

`Spring` is the plainest right renderer. Each change takes the factory of one and gives that of the same renderer so
changed. No check may blame the change: in every case the verdict is the bare renderer's, or one that decides less.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np

from hapticeval.renderer import AnyRenderer, Declaration, RendererFactory, Response, wrapped
from hapticeval.scene import Scene

STANDOFF = 1e-4
"""Distance (m) from the surface at which a tool may stop, declared."""


class Spring:
    """The nearest point of the surface while the hand is inside, and a spring to it: the renderer of the README."""

    def __init__(self, scene: Scene) -> None:
        self.boundary, self.stiffness = scene.model.boundary, scene.stiffness

    def reset(self, hip: np.ndarray) -> None:
        pass

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        at = self.boundary.closest_point(hip[np.newaxis])
        ihip = at.foot[0] if at.distance[0] < 0.0 else hip
        return Response(ihip, self.stiffness * (ihip - hip))


class SevenDigits(Spring):
    """The same with positions in single precision: right, but to seven digits only."""

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        return super().step(hip.astype(np.float32).astype(np.float64), velocity, dt)


class Snapping(Spring):
    """The same on a grid of 1 um about the origin."""

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        return super().step(np.rint(hip * 1e6) / 1e6, velocity, dt)


class Changed:
    """A renderer that asks another one and changes its answer; what that one declares, it declares too."""

    def __init__(self, scene: Scene, inner: AnyRenderer) -> None:
        self.scene = scene
        self.inner = wrapped(inner)

    def __getattr__(self, name: str) -> Any:
        if name == "observe_force" and self.inner.observes_force:
            return self.inner.observe_force
        if name in ("surface", "resolution", "standoff", "supports", "declares"):
            return getattr(self.inner, name)
        raise AttributeError(name)

    def reset(self, hip: np.ndarray) -> None:
        self.inner.reset(hip)

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Any:
        return self.inner.step(hip, velocity, dt)


class Late(Changed):
    """Answers with what it found `ticks` ago: IHIP and force."""

    ticks = 0

    def reset(self, hip: np.ndarray) -> None:
        super().reset(hip)
        self.found: deque[Response] = deque(maxlen=self.ticks + 1)

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        self.found.append(super().step(hip, velocity, dt))
        return self.found[0]


class LateTool(Late):
    """The tool comes three ticks late, and the spring pulls to it from where the hand is now.

    Right in size and energy alone, and no change of `HONEST`: the force points aside, to where the tool was.
    """

    ticks = 3

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        old = super().step(hip, velocity, dt).ihip
        if not self.scene.bilateral and np.array_equal(self.found[-1].ihip, hip):
            return Response(hip, np.zeros_like(hip))
        return Response(old, self.scene.stiffness * (old - hip))


class Single(Changed):
    """Takes and gives positions in single precision, and forms its spring's force of them, in single precision."""

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        seen = hip.astype(np.float32)
        ihip, force = super().step(seen.astype(float), velocity.astype(np.float32).astype(float), dt)
        tool = np.asarray(ihip, dtype=np.float32)
        if not np.any(force):
            return Response(tool, np.zeros_like(tool))
        # What the scheme adds to the spring is rounded as a force is.
        spring = np.float32(self.scene.stiffness) * (tool - seen)
        beside = np.asarray(force, dtype=float) - self.scene.stiffness * (np.asarray(ihip) - seen)
        return Response(tool, spring + beside.astype(np.float32))


class Lists(Changed):
    """Answers a list of two lists."""

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> list[list[float]]:
        ihip, force = super().step(hip, velocity, dt)
        return [np.asarray(ihip).tolist(), np.asarray(force).tolist()]


class Apart(Changed):
    """Stops the tool `STANDOFF` in front of the surface, and declares it: asks for the hand that much further in."""

    standoff = height = STANDOFF

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        frame = self.scene.model.boundary.closest_point(hip[np.newaxis])
        shift = self.height * frame.normal[0]
        if not self.scene.bilateral and frame.distance[0] >= self.height:
            return Response(hip, np.zeros_like(hip))
        ihip, force = super().step(hip - shift, velocity, dt)
        return Response(np.asarray(ihip) + shift, np.asarray(force))


class Sunk(Apart):
    """Stops the tool as far under the surface: asks for the hand that much further out."""

    height = -STANDOFF


class ForceOnly(Changed):
    """Keeps its tool to itself: the IHIP that it answers is the HIP."""

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        return Response(hip, super().step(hip, velocity, dt)[1])


HONEST: dict[str, type[Changed]] = {
    **{f"late-{ticks}": type(f"Late{ticks}", (Late,), {"ticks": ticks}) for ticks in (1, 2, 3)},
    "single": Single,
    "lists": Lists,
    "standoff": Apart,
    "sunk": Sunk,
    "force-only": ForceOnly,
}
"""Name of a change: the class that makes it."""


def factory(name: str, inner: RendererFactory) -> Callable[[Scene], Changed]:
    """Return the factory of what `inner` makes, changed so; it declares what `inner` does."""

    def make(scene: Scene) -> Changed:
        return HONEST[name](scene, inner(scene))

    if hasattr(inner, "supports"):
        make.supports = inner.supports  # type: ignore[attr-defined]
    return make


def declaring(inner: Callable[[Scene], Any], **declared: Any) -> Callable[[Scene], Any]:
    """Return the factory of what `inner` makes, which declares what is given in place of what it did."""

    def make(scene: Scene) -> Any:
        renderer = inner(scene)
        renderer.declares = Declaration(**declared)
        return renderer

    if hasattr(inner, "supports"):
        make.supports = inner.supports  # type: ignore[attr-defined]
    return make
