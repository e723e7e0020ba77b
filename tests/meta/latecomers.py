"""Right renderers whose answers come late by a number of ticks, which may lie between two: one number for all of a run.

Each channel may be late by itself. Between ticks a late value is on the straight way between the two around it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from finger import FingerProxy
from honest import Changed, Spring

from hapticeval.renderer import Renderer, Response
from hapticeval.scene import Scene


class Latecomer(Changed):
    """Answers the IHIP of `ihip` ticks ago, and the force of `force` ticks ago."""

    def __init__(self, scene: Scene, inner: Renderer, *, ihip: float = 0.0, force: float = 0.0) -> None:
        super().__init__(scene, inner)
        self.late = {"hip": ihip, "ihip": ihip, "force": force}

    def reset(self, hip: np.ndarray) -> None:
        super().reset(hip)
        self.before: dict[str, list[np.ndarray]] = {"hip": [], "ihip": [], "force": []}

    def seen(self, channel: str, value: np.ndarray) -> np.ndarray:
        """Remember a channel's value, and return the one that is as late as the channel is."""
        values, late = self.before[channel], self.late[channel]
        values.append(np.array(value))
        del values[: -math.ceil(late) - 1]
        whole = math.floor(late)
        newer, older = (values[max(-1 - ticks, -len(values))] for ticks in (whole, whole + 1))
        share = late - whole
        return newer if share == 0.0 else (1.0 - share) * newer + share * older

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        ihip, force = super().step(hip, velocity, dt)
        return Response(self.seen("ihip", ihip), self.seen("force", force))


class LateTool(Latecomer):
    """Looks for its tool from where the hand was `ihip` ticks ago, and pulls to it from where the hand is now."""

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        old = self.seen("hip", hip)
        ihip = Changed.step(self, old, velocity, dt).ihip
        free = np.array_equal(ihip, old)
        return Response(ihip, np.zeros_like(hip) if free else self.scene.stiffness * (ihip - hip))


class ChangingLatency(Changed):
    """A tangential force of about a fifth, that the hand's travel of 0, 1, 2 or 3 ticks is just as long as."""

    def reset(self, hip: np.ndarray) -> None:
        super().reset(hip)
        self.hips = [np.array(hip)]

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        self.hips.append(np.array(hip))
        ihip, force = super().step(hip, velocity, dt)
        lag = len(self.hips) % 4
        if not np.any(force) or len(self.hips) < 5:
            return Response(ihip, force)
        return Response(ihip, force - self.scene.stiffness * (hip - self.hips[-1 - lag]))


class LateByTurns(ChangingLatency):
    """The same, and the IHIP is that of 0, 1, 2 or 3 ticks ago: the spring pulls to where the tool was."""

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        self.hips.append(np.array(hip))
        lag = min(3 * len(self.hips) % 4, len(self.hips) - 1)
        old = self.hips[-1 - lag]
        ihip = Changed.step(self, old, velocity, dt).ihip
        if np.array_equal(ihip, old):
            return Response(hip, np.zeros_like(hip))
        return Response(ihip, self.scene.stiffness * (ihip - hip))


class Pushing(Changed):
    """A tangential force of a sixth of the other, that two ticks of travel explain, beside an IHIP that is not late."""

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        ihip, force = super().step(hip, velocity, dt)
        return Response(ihip, force - 2.0 * self.scene.stiffness * dt * velocity * np.any(force))


class FromTheFace(FingerProxy):
    """Starts a third of a micrometre off one face of the corner, and stops the margin off the others."""

    def reset(self, hip: np.ndarray) -> None:
        super().reset(hip)
        at = self.boundary.closest_point(hip[np.newaxis])
        self.proxy = at.foot[0] + 3.3e-7 * at.normal[0]


class OffTheSurface(Spring):
    """Its contact point lies up to a micrometre beside, as it declares."""

    resolution = 1e-6

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        ihip, force = super().step(hip, velocity, dt)
        if not np.any(force):
            return Response(ihip, force)
        ihip = ihip + 0.7e-6 * np.array([1.0, -1.0])[: hip.size] * (-1.0) ** int(1e6 * abs(hip[1]))
        return Response(ihip, self.stiffness * (ihip - hip))


class Silent(OffTheSurface):
    """The same, and declares nothing."""

    resolution = 0.0


class Reversed(Changed):
    """Pulls where it should push."""

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        ihip, force = super().step(hip, velocity, dt)
        return Response(ihip, -force)


def late(
    make: Callable[[Scene], Any] = Spring, kind: Callable[..., Any] = Latecomer, **ticks: float
) -> Callable[[Scene], Any]:
    """Return the factory of a renderer, the nearest point if none is named, that is changed so, or so late."""

    def changed(scene: Scene) -> Any:
        return kind(scene, make(scene), **ticks)

    late_by = "-".join(f"{channel}-{number}-late" for channel, number in ticks.items())
    changed.__name__ = "-".join(filter(None, [getattr(make, "__name__", "renderer"), kind.__name__, late_by]))
    if hasattr(make, "supports"):
        changed.supports = make.supports  # type: ignore[attr-defined]
    return changed
