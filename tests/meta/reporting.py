"""Renderers that report contact beside IHIP and force, as libraries and processes do: rightly, and wrongly."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from finger import FingerProxy

from hapticeval.renderer import Response


class Rounded(FingerProxy):
    """In free space its tool is where the hand is but for rounding, as after a way that was gone in parts. Honest."""

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        ihip, force = super().step(hip, velocity, dt)
        free = not np.any(force)
        return Response(np.nextafter(hip, np.inf) if free else ihip, force)


class Banded(FingerProxy):
    """Gives no force in a band of 0.1 mm under its surface, and reports the contact there. Honest."""

    contact = False

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        ihip, force = super().step(hip, velocity, dt)
        self.contact = bool(np.any(ihip != hip))
        stretch = float(np.linalg.norm(force)) / self.stiffness
        return Response(ihip, force * max(0.0, 1.0 - 1e-4 / stretch) if stretch else force)


def reporting(report: Callable[[bool, np.ndarray], bool]) -> type[FingerProxy]:
    """Return a finger proxy that reports `report(touches, hip)`."""

    class Reporting(FingerProxy):
        contact = False

        def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
            ihip, force = super().step(hip, velocity, dt)
            self.contact = report(bool(np.any(force)), hip)
            return Response(ihip, force)

    return Reporting


TRUE = reporting(lambda touches, hip: touches)
ALWAYS = reporting(lambda touches, hip: True)
NEVER = reporting(lambda touches, hip: False)


class Dropping(FingerProxy):
    """Keeps its tool on the surface and says that it is free where the hand is over 5 mm deep. Wrong."""

    contact = False

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        ihip, force = super().step(hip, velocity, dt)
        drops = bool(self.boundary.signed_distance(hip[np.newaxis])[0] < -5e-3)
        self.contact = bool(np.any(force)) and not drops
        return Response(ihip, np.zeros_like(force) if drops else force)
