"""A limit of a device's functional configuration space, as seen from one pose."""

from __future__ import annotations

import math
from typing import NamedTuple


class Limit(NamedTuple):
    """`distance` (rad) from a pose to a joint limit or a singularity: positive inside, negative beyond.

    `what` names it; `text` says where the pose stands to it; `singular` tells a singularity from a joint limit.
    """

    what: str
    distance: float
    text: str
    singular: bool = False

    @classmethod
    def between(cls, what: str, value: float, low: float, high: float, *, scale: float = 1.0) -> Limit:
        """An angle that must lie between `low` and `high`; `scale` makes joint-space distance of its excess."""
        slack, end = min((value - low, low), (high - value, high))
        side = "within" if slack > 0.0 else "beyond" if slack < 0.0 else "from, that is on,"
        text = f"{what} = {_angle(value)} is {_angle(abs(slack))} {side} its limit of {_angle(end)}"
        return cls(what, slack * scale, text)

    @classmethod
    def singularity(cls, what: str, metres: float, distance: float) -> Limit:
        """A singular set that the hand is `metres` away from."""
        side = "short of" if metres > 0.0 else "past" if metres < 0.0 else "from, that is on,"
        text = f"the hand is {abs(metres):.6g} m {side} {what} (a singularity; {_angle(abs(distance))} of the joints)"
        return cls(what, distance, text, True)


def _angle(value: float) -> str:
    value = round(value, 12) + 0.0  # rounding errors of an inverse are no angle, and nor is minus zero
    return f"{value:.6g} rad ({math.degrees(value):.4g} degrees)"
