"""Coulomb friction: the surface holds the tool, which slides as far as the friction cone makes it (4.17)-(4.20).

The tool has a place of its own on the model's surface, s. The renderer's IHIP p is where it would be without friction,
and K (s - p) is added to the renderer's force F_b, with the scene's stiffness K. With F_b = K (p - HIP) of (4.8) that
is K (s - HIP), the spring from the tool to the hand of the thesis. It fits any other renderer as well: K |s - HIP|^2 /
2 - K |p - HIP|^2 / 2, which is not negative where p is the nearest point, is the energy that the lag stores.

The normal force F_n and the tangential force F_t are the parts of F_b + K (s - p) across and along the surface at s, so
that the cone stands on the tool's own place, on round surfaces too. (4.17)-(4.19), which assume that it is flat, follow
where it is. Of F_b counts the part along HIP - p or along the normal at p, whichever is larger: what a damper or
another effect adds along the surface is no load of the friction's. At its first tick of contact the tool is put to p.

- A tool that sticks stays at s while |F_t| <= mu_s |F_n| (4.18).
- Otherwise it slides along the surface towards p until |F_t| = mu_k |F_n| (4.20). The way is the line to p,
  projected on to the surface; a corner stops it where it is pulled back from beyond. Where the renderer's
  own force leaves the cone at p, as that of a facet may, it goes on past p.
- A tool that slides goes on doing so while |F_t| > mu_k |F_n|, and sticks again at |F_t| <= `stick` mu_k |F_n|.

The thesis gives no rule for the last. Its text, taken literally, tests the static cone at every tick: that is `stick` =
1, where a tool that has come to rest on the kinetic cone sticks at once. It then moves in jumps of (mu_s - mu_k) d,
with a sawtooth of v / ((mu_s - mu_k) d) in the force: 250 Hz at 50 mm/s for mu = 0.5 / 0.3 and d = 1 mm, and a mean
force between both. With the default 0.6 a hand that goes on feels mu_k, and one that has turned back feels mu_s again
before it slides.

The tool never moves to where it is farther from the hand. So the hand gets no more out than K sum of |dHIP|^2 / 2, what
holding the force of a spring for a tick gives.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from hapticeval.effects.effect import Calling, Effect, Part, Stage, number
from hapticeval.errors import InputError

SEARCH, SECANTS = 64, 16
"""Most places at which a slide looks for the kinetic cone, and those after which it halves what is left of the way."""

SAME = 1e-15
"""Share of the way to the renderer's IHIP within which two places are one: at a corner the pull turns back at once."""

SHARPEST = 1e-6
"""Square of the length of two unit normals' sum under which they are those of opposite sides: there is no edge between.

With an angle 2 a between two faces that sum is 2 sin a long, and the way between points on them, c apart, is at most
c / (2 tan a) under the edge: a bulge of c / (2 sin a) halfway leads it past.
"""

STRAIGHT = 1e-9
"""Share of a force by which its part along a line may be smaller where all of it is along that line, to 45 urad."""

ON_CONE = 1e-13
"""Share of the cone's force within which the tool is on it: a thousand roundings of a coordinate, at 1 mm of lag."""


@dataclass(frozen=True)
class Friction(Effect):
    """Hold the tool with the coefficient `mu_s` where it sticks and `mu_k` where it slides; see the module.

    A tool that slides sticks again at the share `stick` of the kinetic cone; 1 tests the static cone at every tick.
    Raises `InputError` for numbers out of range, mu_k > mu_s, and a share beyond 1.
    """

    mu_s: float = number("", at=True)
    mu_k: float = number("", at=True)
    stick: float = number("", default=0.6)

    kind: ClassVar[str] = "friction"
    stage: ClassVar[Stage] = Stage.ANSWER
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
        """Whether there is none."""
        return self.mu_s == 0.0

    def change(self, scene: Calling) -> Part:
        """Assemble the tool's lag behind the renderer's IHIP."""
        params = [scene.stiffness, self.mu_s, self.mu_k, self.stick, float(scene.bilateral)]
        return Part(slide, np.array(params), state=np.zeros((10, scene.model.dimension)))


def slide(numbers: Any, closest: Any, hip: Any, velocity: Any, dt: float, ihip: Any, force: Any) -> int:  # noqa: ARG001 - an effect's
    """Hold or slide the tool, and add K (s - p) to the force: see `Effect.change`.

    `params` are K, mu_s, mu_k, the share at which it sticks, and whether the surface is bilateral. Rows of `state` are
    place and normal of the tool, of the renderer's IHIP and of a trial; the load, N; the point that is projected;
    [contact, sliding]; and how far the way to the renderer's IHIP bulges, m.
    """
    stiffness, static, kinetic, stick = numbers.params[0], numbers.params[1], numbers.params[2], numbers.params[3]
    state, size = numbers.state, hip.shape[0]
    tool, target, trial = state[0:2], state[2:4], state[4:6]
    load, point, mode, bulge = state[6], state[7], state[8], state[9]
    error, strength = 0.0, 0.0
    for i in range(size):
        error += (ihip[i] - hip[i]) ** 2
        strength += force[i] ** 2
    if strength == 0.0:
        mode[:] = 0.0
        return 0
    closest.function(closest.data, ihip, target)
    # The load: the force along the error or along the normal, whichever it is more along.
    outwards, press, across, apart = 0.0, 0.0, 0.0, 0.0
    for i in range(size):
        outwards += (ihip[i] - hip[i]) * target[1, i]
        press += force[i] * (ihip[i] - hip[i])
        across += force[i] * target[1, i]
        apart += (target[0, i] - tool[0, i]) ** 2
    press *= (1.0 if outwards > 0.0 else -1.0) / np.sqrt(error) if error > 0.0 else 0.0
    by_normal = error == 0.0 or abs(across) > abs(press)
    press = across if by_normal else press
    whole = abs(press) >= (1.0 - STRAIGHT) * np.sqrt(strength)
    for i in range(size):
        along = target[1, i] if by_normal else (ihip[i] - hip[i]) * (1.0 if outwards > 0.0 else -1.0) / np.sqrt(error)
        load[i] = force[i] if whole else press * along
    side = -1.0 if press < 0.0 and numbers.params[4] == 1.0 else 1.0
    if mode[0] == 0.0 or apart == 0.0 or side * press <= 0.0:
        tool[:] = target
        ihip[:] = target[0]
        mode[0], mode[1] = 1.0, 0.0
        return 0
    # The way to p: straight, but for a bulge out over an edge, or into a hollow, so that its feet pass by the corner.
    turn, wide = 0.0, 0.0
    for i in range(size):
        turn += (target[0, i] - tool[0, i]) * (target[1, i] - tool[1, i])
        wide += (target[1, i] + tool[1, i]) ** 2
    high_up = 4.0 * np.sign(turn) * np.sqrt(apart) / wide if wide > SHARPEST else 0.0
    for i in range(size):
        bulge[i] = high_up * (target[1, i] + tool[1, i])
    # Look for the share of the way to p at which the tool is on the kinetic cone: between `low`, where it is pulled on,
    # and `high`; by secants (Illinois), and by halves where these do not come near.
    low, high, above, below, share, last, past = 0.0, 1.0, 0.0, 0.0, 0.0, 0, False
    for k in range(SEARCH):
        if k == 0:
            trial[:] = tool
        elif k == 1:
            share = 1.0
            trial[:] = target
        else:
            if k > 2 or not past:
                share = low + (high - low) * (above / (above - below) if k < SECANTS else 0.5)
            else:
                share = high
            for i in range(size):
                point[i] = tool[0, i] + share * (target[0, i] - tool[0, i]) + share * (1.0 - share) * bulge[i]
            closest.function(closest.data, point, trial)
        normal, tangential, onwards = 0.0, 0.0, 0.0
        for i in range(size):
            normal += (load[i] + stiffness * (trial[0, i] - target[0, i])) * trial[1, i]
        for i in range(size):
            part = load[i] + stiffness * (trial[0, i] - target[0, i]) - normal * trial[1, i]
            tangential += part**2
            onwards -= part * (target[0, i] - tool[0, i])
        tangential, normal = np.sqrt(tangential), side * normal
        if k == 0:
            if normal > 0.0 and tangential <= (kinetic if mode[1] == 1.0 else static) * normal:
                break
            mode[1] = 1.0
        excess = (tangential if onwards > 0.0 else -tangential) - kinetic * normal
        if normal <= 0.0:
            excess = abs(press)
        if abs(excess) <= ON_CONE * kinetic * normal:
            break
        if excess > 0.0:
            if k == 2 and past:
                trial[:] = target
                break
            if k == 1:  # the renderer's own force leaves the cone at p, as a facet's may: its share of K (s - p) beyond
                past = True
                high = 1.0 + 2.0 * tangential / (stiffness * np.sqrt(apart))
            below *= 0.5 if last == 1 else 1.0
            low, above, last = share, excess, 1
        else:
            above *= 0.5 if last == -1 else 1.0
            high, below, last = share, excess, -1
        if high - low <= SAME:
            break
    if mode[1] == 1.0 and (stick == 1.0 or tangential <= stick * kinetic * normal):
        mode[1] = 0.0
    tool[:] = trial
    for i in range(size):
        force[i] += stiffness * (tool[0, i] - target[0, i])
        ihip[i] = tool[0, i]
    return 0
