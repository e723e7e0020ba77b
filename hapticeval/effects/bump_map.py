"""Bump maps: only the normal is turned, as computer graphics does and as (4.16) of the thesis has it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from hapticeval.effects.effect import Calling, Part
from hapticeval.effects.height_map import Relief


@dataclass(frozen=True)
class BumpMap(Relief):
    """Turn the force's part along the normal n to n' = (n - grad h) / |n - grad h|, as large as it is.

    That is (4.16) with A = -grad h and the normal renormalised, on the answer of any renderer.

    The depth does not change, so that the force is no gradient: round a loop between depths d1 and d2, a quarter of a
    wave long, it gives or takes K (d2 - d1) (wavelength / 2 pi) atan a - K (d2^2 - d1^2) (1 - cos atan a) / 2 with a =
    2 pi amplitude / wavelength.
    """

    kind: ClassVar[str] = "bump-map"

    def change(self, scene: Calling) -> Part:
        """See `Effect.change`."""
        from hapticeval.effects.relief_kernels import turn_normal

        return self._part(scene, turn_normal)

    def active(self, damping: float) -> str | None:  # noqa: ARG002 - as every effect
        """Return why it gives energy away, which it does with any renderer."""
        return "turning only the normal, as (4.16), is the force of no potential"
