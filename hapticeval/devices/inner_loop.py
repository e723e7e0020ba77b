"""Inner loops: how a Cartesian force becomes joint torques (thesis 2.5.3, 2.5.4, 6.3.1)."""

from __future__ import annotations

from enum import StrEnum


class InnerLoop(StrEnum):
    """The three of the thesis.

    `static`: τ = Jᵀ F (2.8). `compensated`: the Coriolis, damping and gravity terms are added back (2.11).
    `linearised`: feedback linearisation (6.7), so that the end-effector moves as the virtual tool's mass does.
    """

    STATIC = "static"
    COMPENSATED = "compensated"
    LINEARISED = "linearised"
