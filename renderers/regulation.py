"""Regulation schemes: from where the hand is, and where the virtual tool is, to a force (thesis section 4.2).

Each law is a pure function of the gains and of four vectors, given as tuples of components, so that one text serves
a tick (components are floats) and a whole trajectory (components are columns), and both agree to the last bit.

| name          | F_r                                                              | thesis           |
|---------------|------------------------------------------------------------------|------------------|
| `pp`          | -K_p e_p                                                         | (4.8)            |
| `pp-v`        | -K_p e_p - K_d ẏ                                                 | (4.10)           |
| `pp-d`        | -K_p e_p - K_d ė_p                                               | (4.12)           |
| `pp-pd`       | -K_p e_p - K_d (n·ẏ) n                                           | (4.14)           |
| `transversal` | -K_p (n·e_p) n - K_d (n·ẏ) n                                     | (5.21), corrected |
| `pp-pd-c`     | -K_p e_p - K_d (n·ẏ) n - m κ v_t^2 n                             | chapter 7        |
| `square-root` | -(e_p/e) (k_p e^(1/2) + k_d e^(1/2) sgn(ė) abs(ė)^(1/2))         | end of 4.2       |

The laws of Table 4.1 are kept to the letter. Contact is unilateral, but none of them is clipped: with damping, a hand
that leaves fast enough is pulled back in its last ticks of contact. That is a property of the schemes, to be seen.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from operator import mul
from types import MappingProxyType
from typing import Any, Protocol, TypeAlias

import numpy as np

from hapticeval.renderer import Spring

Components: TypeAlias = tuple[Any, ...]
"""A vector by its components: floats for one tick, columns of shape (n,) for a trajectory."""

REFERENCE_DEPTH = 1e-3
"""Depth (m) at which the square-root spring gives the linear spring's force."""

REFERENCE_RATE = 0.1
"""Speed of penetration (m/s) at which, at the reference depth, the square-root damper gives the linear one's force."""


class Law(Protocol):
    """A regulation scheme as a function; the vectors have N components each."""

    def __call__(
        self,
        stiffness: float,
        damping: float,
        error: Components,
        normal: Components,
        velocity: Components,
        rate: Components,
    ) -> Components:
        """The force on the hand, N.

        `stiffness` K_p, N/m; `damping` K_d, N s/m; `error` e_p = HIP - IHIP of (4.5), m; `normal` outward unit normal
        n_e at the IHIP; `velocity` ẏ of the HIP, m/s; `rate` ė_p, m/s, backwards in time over one tick.
        """


@dataclass(frozen=True)
class Regulation:
    """A law with its name, where the thesis states it, and what it needs beside: the error's rate.

    `spring` is what its force at rest is K_p times of, None where it is proportional to neither.

    With `bends`, the force that bends the tool's way along the surface, -m κ v_t^2 n (3.8), is added to the law's: the
    cheap alternative to set stabilisation that chapter 7 mentions. On the surface both are the same. Off it they are
    not: this leaves n̈ + (K_p n + K_d ṅ)/m = κ v_t^2 (1/(1 + n κ) - 1) and, as its force has no part along the surface,
    s̈ = -(2 κ ṅ ṡ + n κ' ṡ^2)/(1 + n κ), where set stabilisation makes all three zero. As all laws here it may pull.
    """

    name: str
    law: Law
    citation: str
    needs_rate: bool = False
    bends: bool = False
    spring: Spring | None = None


def pp(
    stiffness: float,
    damping: float,  # noqa: ARG001
    error: Components,
    normal: Components,  # noqa: ARG001
    velocity: Components,  # noqa: ARG001
    rate: Components,  # noqa: ARG001
) -> Components:
    """Projected proportional: a spring from the HIP to the IHIP (4.8)."""
    return tuple([-stiffness * e for e in error])


def pp_v(
    stiffness: float,
    damping: float,
    error: Components,
    normal: Components,  # noqa: ARG001
    velocity: Components,
    rate: Components,  # noqa: ARG001
) -> Components:
    """The spring, and a damper on all motion of the hand, along the surface too (4.10)."""
    return tuple([-stiffness * e - damping * v for e, v in zip(error, velocity, strict=True)])


def pp_d(
    stiffness: float,
    damping: float,
    error: Components,
    normal: Components,  # noqa: ARG001
    velocity: Components,  # noqa: ARG001
    rate: Components,
) -> Components:
    """The spring, and a damper on the motion between HIP and IHIP (4.12).

    ė_p is the difference backwards over one tick, and zero on the first tick of contact: before it there was no
    error to subtract. A jump of the IHIP is therefore felt as a kick.
    """
    return tuple([-stiffness * e - damping * r for e, r in zip(error, rate, strict=True)])


def pp_pd(
    stiffness: float,
    damping: float,
    error: Components,
    normal: Components,
    velocity: Components,
    rate: Components,  # noqa: ARG001
) -> Components:
    """The spring, and a damper on the motion across the surface only (4.14)."""
    across = damping * _dot(normal, velocity)
    return tuple([-stiffness * e - across * n for e, n in zip(error, normal, strict=True)])


def transversal(
    stiffness: float,
    damping: float,
    error: Components,
    normal: Components,
    velocity: Components,
    rate: Components,  # noqa: ARG001
) -> Components:
    """Spring and damper both along the normal (5.21): the force is normal however the projection is curved.

    The thesis prints (5.21) without the minus signs; as printed it is positive feedback, and it would not equal
    (4.14) where the projection is straight and normal, which the text says it does. Even in n.
    """
    push = -stiffness * _dot(normal, error) - damping * _dot(normal, velocity)
    return tuple([push * n for n in normal])


def square_root(
    stiffness: float,
    damping: float,
    error: Components,
    normal: Components,  # noqa: ARG001
    velocity: Components,  # noqa: ARG001
    rate: Components,
) -> Components:
    """A spring and damper that are stiff when shallow and grow slowly when deep (end of section 4.2).

    The thesis prints F_r = k_p e^(1/2) + k_d e^(1/2) ė^(1/2) and gives neither direction, nor a meaning for ė < 0, nor
    units or gains. Decided here: e is the length of e_p and ė its rate; the force points from HIP to IHIP; a hand on
    its way out is damped with the opposite sign, sgn(ė) abs(ė)^(1/2), so that the damper never drives; and
    k_p = K_p (e_0)^(1/2), k_d = K_d (ė_0 / e_0)^(1/2), so that the linear law's force comes out at the depth
    e_0 = 1 mm, its damping part at the rate ė_0 = 0.1 m/s there. Zero at zero depth.
    """
    depth = np.sqrt(_dot(error, error))
    safe = np.where(depth > 0.0, depth, 1.0)
    closing = _dot(error, rate) / safe
    spring, damper = root_gains(stiffness, damping)
    size = np.sqrt(depth) * (spring + damper * np.copysign(np.sqrt(np.abs(closing)), closing))
    return tuple([-size * (e / safe) for e in error])


def root_gains(stiffness: float, damping: float) -> tuple[float, float]:
    """k_p and k_d of the square-root scheme."""
    return stiffness * REFERENCE_DEPTH**0.5, damping * (REFERENCE_RATE / REFERENCE_DEPTH) ** 0.5


def _dot(first: Components, second: Components) -> Any:
    return sum(map(mul, first, second))


REGULATIONS: Mapping[str, Regulation] = MappingProxyType(
    {
        regulation.name: regulation
        for regulation in (
            Regulation("pp", pp, "thesis (4.8)", spring=Spring.ERROR),
            Regulation("pp-v", pp_v, "thesis (4.10)", spring=Spring.ERROR),
            Regulation("pp-d", pp_d, "thesis (4.12)", needs_rate=True, spring=Spring.ERROR),
            Regulation("pp-pd", pp_pd, "thesis (4.14)", spring=Spring.ERROR),
            Regulation("transversal", transversal, "thesis (5.21), signs corrected", spring=Spring.NORMAL),
            Regulation("square-root", square_root, "thesis section 4.2", needs_rate=True),
            Regulation("pp-pd-c", pp_pd, "thesis chapter 7, (3.8)", bends=True),
        )
    }
)
"""Every regulation scheme by its name."""
