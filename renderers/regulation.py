"""Regulation schemes: from where the hand is, and where the virtual tool is, to a force (thesis section 4.2).

One kernel, `projective.regulate`, serves a tick from Python, a whole trajectory and a compiled closed loop.

| name          | F_r                                                              | thesis           |
|---------------|------------------------------------------------------------------|------------------|
| `pp`          | -K_p e_p                                                         | (4.8)            |
| `pp-v`        | -K_p e_p - K_d ẏ                                                 | (4.10)           |
| `pp-d`        | -K_p e_p - K_d ė_p                                               | (4.12)           |
| `pp-pd`       | -K_p e_p - K_d (n·ẏ) n                                           | (4.14)           |
| `transversal` | -K_p (n·e_p) n - K_d (n·ẏ) n                                     | (5.21), corrected |
| `pp-pd-c`     | -K_p e_p - K_d (n·ẏ) n - m κ v_t^2 n                             | chapter 7        |
| `gradient`    | K_p p n - K_d (n·ẏ) n                                            | `potential`      |
| `square-root` | -(e_p/e) (k_p e^(1/2) + k_d e^(1/2) sgn(ė) abs(ė)^(1/2))         | end of 4.2       |

e_p = HIP - IHIP is the error (4.5), n the outward unit normal at the IHIP and ẏ the velocity of the HIP. ė_p is the
error's difference backwards over one tick, and zero on the first tick of contact: before it there was no error to
subtract.

A jump of the IHIP is therefore felt as a kick by `pp-d`.

The schemes of Table 4.1 are kept to the letter. Contact is unilateral, but no damper is clipped: with damping, a hand
that leaves fast enough is pulled back in its last ticks of contact. That is a property of the schemes, to be seen.

The thesis prints (5.21) without the minus signs; as printed it is positive feedback, and it would not equal (4.14)
where the projection is straight and normal, which the text says it does. It is even in n.

A slanted projection may have its foot across a neck, and the hand above the tangent there, n·e_p > 0: the spring would
pull it to a surface that can only push. It gives nothing there, but in a bilateral scene.

For the square root the thesis prints F_r = k_p e^(1/2) + k_d e^(1/2) ė^(1/2) and gives neither direction, nor a meaning
for ė < 0, nor units or gains.

Decided here: e is the length of e_p and ė its rate; the force points from HIP to IHIP; a hand on its way out is damped
with the opposite sign, sgn(ė) abs(ė)^(1/2), so that the damper never drives; and k_p = K_p (e_0)^(1/2), k_d =
K_d (ė_0 / e_0)^(1/2), so that the linear law's force comes out at the depth e_0 = 1 mm, its damping part at the rate
ė_0 = 0.1 m/s there. Zero at zero depth.

`pp-pd-c` adds the force that bends the tool's way along the surface, -m κ v_t^2 n (3.8): the cheap alternative to set
stabilisation that chapter 7 mentions. On the surface both are the same.

Off it they are not: this leaves n̈ + (K_p n + K_d ṅ)/m = κ v_t^2 (1/(1 + n κ) - 1) and, as its force has no part along
the surface, s̈ = -(2 κ ṅ ṡ + n κ' ṡ^2)/(1 + n κ), where set stabilisation makes all three zero.

As all schemes here it may pull.

`gradient` is for projections that are made with a potential, and know with each IHIP by what length p its force is K_p
times, so that K_p p n is its gradient: see `potential`. Near the surface p is H^2 / h^2 or once the depth, for
`homothetic` and `combescure`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from hapticeval.renderer import Spring


@dataclass(frozen=True)
class Regulation:
    """A scheme's name, where the thesis states it, and its `number` in the kernels.

    `spring` is along what its force at rest is a spring, None where it is along neither. One that `bends` needs to know
    the curvature of the surface, and one of a `potential` a projection that has one.
    """

    name: str
    citation: str
    number: float
    bends: bool = False
    potential: bool = False
    spring: Spring | None = None


PP, PP_V, PP_D, PP_PD, TRANSVERSAL, SQUARE_ROOT, PP_PD_C, GRADIENT = (float(number) for number in range(8))

REGULATIONS: Mapping[str, Regulation] = MappingProxyType(
    {
        regulation.name: regulation
        for regulation in (
            Regulation("pp", "thesis (4.8)", PP, spring=Spring.ERROR),
            Regulation("pp-v", "thesis (4.10)", PP_V, spring=Spring.ERROR),
            Regulation("pp-d", "thesis (4.12)", PP_D, spring=Spring.ERROR),
            Regulation("pp-pd", "thesis (4.14)", PP_PD, spring=Spring.ERROR),
            Regulation("transversal", "thesis (5.21), signs corrected", TRANSVERSAL, spring=Spring.NORMAL),
            Regulation("square-root", "thesis section 4.2", SQUARE_ROOT),
            Regulation("pp-pd-c", "thesis chapter 7, (3.8)", PP_PD_C, bends=True),
            Regulation("gradient", "docs/continuous-and-passive.md", GRADIENT, potential=True, spring=Spring.NORMAL),
        )
    }
)
"""Every regulation scheme by its name."""
