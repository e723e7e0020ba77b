"""Coulomb friction: the surface holds the tool, which slides as far as the friction cone makes it (4.17)-(4.20).

Three points matter, all in m: the hand's HIP; the renderer's IHIP p, where the tool would be without friction; and the
tool's own place s on the surface, which lags behind p.

The friction adds K (s - p) to the renderer's force F_b, with the scene's stiffness K. With F_b = K (p - HIP) of (4.8)
the sum is K (s - HIP), the thesis's spring from the tool to the hand.

It fits any other renderer as well: the energy that the lag stores is K |s - HIP|^2 / 2 - K |p - HIP|^2 / 2, which is
not negative where p is the nearest point.

The normal force F_n and the tangential force F_t are the parts of F_b + K (s - p) across and along the surface at s, so
that the cone stands on the tool's own place, on round surfaces too.

On a flat surface that gives (4.17)-(4.19), which assume one. At its first tick of contact the tool is put to p.

Of F_b only what presses the tool counts: its part along p - HIP or along the normal at p, whichever is larger. What a
damper or another effect adds along the surface does not.

- A tool that sticks stays at s while |F_t| <= mu_s |F_n| (4.18).
- Otherwise it slides along the surface towards p until |F_t| = mu_k |F_n| (4.20). Its way is the chord from s to p,
  bent over an edge or into a hollow (`friction_kernels.bulge_path`), and projected on to the surface. A corner stops it
  where it is pulled back from the other side. Where the renderer's own force leaves the cone at p, as that of a facet
  may, it goes on past p. Where the hand pulls the tool the other way, as when the renderer's point has jumped past a
  tip, it slides back on its own side.
- A tool that slides goes on doing so while |F_t| > mu_k |F_n|, and sticks again at |F_t| <= `stick` mu_k |F_n|.

The thesis gives no rule for the last. Its text, taken literally, tests the static cone at every tick: that is `stick` =
1, where a tool that has come to rest on the kinetic cone sticks at once.

The tool then moves in jumps of (mu_s - mu_k) d, with a sawtooth of v / ((mu_s - mu_k) d) in the force: 250 Hz at 50
mm/s for mu = 0.5 / 0.3 and d = 1 mm, and a mean force between both.

With the default 0.6 a hand that goes on feels mu_k, and one that has turned back feels mu_s again before it slides.

The tool never moves to where it is farther from the hand. So the hand gets at most K sum of |dHIP|^2 / 2 out of it,
which is what a spring gives whose force is held for a tick.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from hapticeval.effects.effect import Alters, Calling, Effect, Part, Stage, number
from hapticeval.errors import InputError


@dataclass(frozen=True)
class Friction(Effect):
    """Hold the tool with the coefficient `mu_s` where it sticks and `mu_k` where it slides, both without a unit.

    A tool that slides sticks again at the share `stick` of the kinetic cone, which is above 0 and at most 1; 1 tests
    the static cone at every tick. The module tells the rules, (4.17) to (4.20). Raises `InputError` for numbers out of
    range and mu_k > mu_s.
    """

    mu_s: float = number("", zero=True)
    mu_k: float = number("", zero=True)
    stick: float = number("", default=0.6)

    kind: ClassVar[str] = "friction"
    stage: ClassVar[Stage] = Stage.ANSWER
    alters: ClassVar[frozenset[Alters]] = frozenset({Alters.CONTACT_POINT, Alters.MOTION})
    linear: ClassVar[bool] = False
    words: ClassVar[str] = "friction with mu_s {mu_s} and mu_k {mu_k}"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.mu_k > self.mu_s:
            raise InputError(
                f"the friction's mu_k = {self.mu_k!r} is above mu_s = {self.mu_s!r}",
                why="a tool that slides is not held harder than one that sticks: it would stop at once, and stick",
                todo="give mu_k <= mu_s",
            )
        if self.stick > 1.0:
            raise InputError(
                f"the friction's stick = {self.stick!r}",
                why="it is the share of the kinetic cone at which a sliding tool sticks, and 1 lets it stick at once",
                todo="give a share up to 1",
            )

    @property
    def off(self) -> bool:
        """Whether mu_s is zero, and so mu_k: it then changes nothing."""
        return self.mu_s == 0.0

    def change(self, scene: Calling) -> Part:
        """Assemble the tool's lag behind the renderer's IHIP: `params` and `state` as `slide` takes them."""
        from hapticeval.effects.friction_kernels import CONE, FRICTION_ROWS, slide
        from hapticeval.records import numbers_of

        params = numbers_of(
            CONE, stiffness=scene.stiffness, mu_s=self.mu_s, mu_k=self.mu_k, stick=self.stick, bilateral=scene.bilateral
        )
        return Part(slide, params, state=np.zeros((FRICTION_ROWS, scene.model.dimension)))
