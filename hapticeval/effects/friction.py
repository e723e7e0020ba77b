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

Of F_b only the load counts: its part along p - HIP or along the normal at p, whichever is larger. What a damper or
another effect adds along the surface does not press the tool.

- A tool that sticks stays at s while |F_t| <= mu_s |F_n| (4.18).
- Otherwise it slides along the surface towards p until |F_t| = mu_k |F_n| (4.20). It follows the line to p,
  projected on to the surface; a corner stops it where it is pulled back from the other side. Where the renderer's
  own force leaves the cone at p, as that of a facet may, it goes on past p.
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
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from hapticeval.effects.effect import Alters, Calling, Effect, Part, Stage, number
from hapticeval.errors import InputError
from hapticeval.types import Array

if TYPE_CHECKING:
    from hapticeval.compiled import Closest, Numbers

MOST_TRIALS, MOST_SECANTS = 64, 16
"""Most places at which a slide tests the kinetic cone, and the trial from which on it bisects instead of secants."""

SAME_PLACE = 1e-15
"""Width of the bracket, as a share of the chord from s to p, at which it is one place: a corner, where the pull turns
back at once and F_t = mu_k F_n has no root."""

OPPOSITE_SIDES = 1e-6
"""|n_s + n_p|^2 of the unit normals at s and p below which they lie on opposite sides, with no edge to lead round.

With an angle 2 a between two faces that sum is 2 sin a long, and the chord between points on them, c apart, is at most
c / (2 tan a) under the edge: a bulge of c / (2 sin a) halfway leads the path past it.
"""

ALL_ALONG = 1e-9
"""Share of a force that its part along a line may lack where the force counts as along that line, to 45 urad."""

ON_CONE = 1e-13
"""Share of the cone's force within which the tool is on it: at 1 mm of lag, ten roundings of a coordinate of 50 mm."""


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
        params = [scene.stiffness, self.mu_s, self.mu_k, self.stick, float(scene.bilateral)]
        return Part(slide, np.array(params), state=np.zeros((10, scene.model.dimension)))


def slide(
    numbers: Numbers, closest: Closest, hip: Array, velocity: Array, dt: float, ihip: Array, force: Array  # noqa: ARG001
) -> int:  # fmt: skip
    """Hold the tool or let it slide for one tick, and add the spring K (s - p) of its lag to the force.

    The signature is that of `Effect.change`; the points HIP, p and s are the module's. Returns 0: it refuses nothing.

    - `hip` (N,), m: the HIP.
    - `ihip` (N,), m: on entry the renderer's IHIP p, on return the tool's place s.
    - `force` (N,), N: on entry the renderer's force F_b, on return F_b + K (s - p).
    - `numbers.params` (5,): K (N/m), mu_s, mu_k, the share of the kinetic cone at which a sliding tool sticks, and 1
      where the surface is bilateral.
    - `numbers.state` (10, N): place (m) and outward unit normal of the tool, of p, and of a trial place; then the load
      (N), a point to be projected (m), the flags [in contact, sliding], and the bulge (m) of the path.
    """
    stiffness, static, kinetic, stick = numbers.params[0], numbers.params[1], numbers.params[2], numbers.params[3]
    state, dimension = numbers.state, hip.shape[0]
    # each is two rows: a place on the surface (m), and the outward unit normal there
    tool, target, trial = state[0:2], state[2:4], state[4:6]
    load, point, mode, bulge = state[6], state[7], state[8], state[9]
    error_squared, force_squared = 0.0, 0.0  # |p - HIP|^2 of (4.5), m^2; |F_b|^2, N^2
    for i in range(dimension):
        error_squared += (ihip[i] - hip[i]) ** 2
        force_squared += force[i] ** 2
    if force_squared == 0.0:  # free space: the next contact begins anew
        mode[:] = 0.0
        return 0
    closest.function(closest.data, ihip, target)

    # 1. The load: the part of F_b along p - HIP or along the normal at p, whichever is larger. A damper's part along
    # the surface is left out. `press` (N) is that part's size, positive where it pushes the hand outwards.
    error_outwards, force_dot_error, press_on_normal, chord_squared = 0.0, 0.0, 0.0, 0.0
    for i in range(dimension):
        error_outwards += (ihip[i] - hip[i]) * target[1, i]
        force_dot_error += force[i] * (ihip[i] - hip[i])
        press_on_normal += force[i] * target[1, i]
        chord_squared += (target[0, i] - tool[0, i]) ** 2  # |p - s|^2, m^2
    # along p - HIP, turned outwards: from a hand outside of a bilateral surface p - HIP points inwards
    press_on_error = force_dot_error * (
        (1.0 if error_outwards > 0.0 else -1.0) / np.sqrt(error_squared) if error_squared > 0.0 else 0.0
    )
    by_normal = error_squared == 0.0 or abs(press_on_normal) > abs(press_on_error)
    press = press_on_normal if by_normal else press_on_error
    # a force that is nothing but load is taken to the bit, without the rounding of its projection
    all_load = abs(press) >= (1.0 - ALL_ALONG) * np.sqrt(force_squared)
    for i in range(dimension):
        direction = (
            target[1, i]
            if by_normal
            else (ihip[i] - hip[i]) * (1.0 if error_outwards > 0.0 else -1.0) / np.sqrt(error_squared)
        )
        load[i] = force[i] if all_load else press * direction
    # a bilateral surface also holds a tool that is pulled off it: F_n then counts inwards
    side = -1.0 if press < 0.0 and numbers.params[4] == 1.0 else 1.0
    # No lag: contact begins, s is p already, or nothing presses the tool on the surface.
    if mode[0] == 0.0 or chord_squared == 0.0 or side * press <= 0.0:
        tool[:] = target
        ihip[:] = target[0]
        mode[0], mode[1] = 1.0, 0.0
        return 0

    # 2. The path from s to p: the chord c plus share (1 - share) bulge, projected on to the surface. The bulge points
    # along n_s + n_p, out over an edge (`bending` > 0) or into a hollow, so that the closest points pass by the corner.
    bending, normals_squared = 0.0, 0.0  # (p - s).(n_p - n_s), m; |n_s + n_p|^2
    for i in range(dimension):
        bending += (target[0, i] - tool[0, i]) * (target[1, i] - tool[1, i])
        normals_squared += (target[1, i] + tool[1, i]) ** 2
    # halfway, at share (1 - share) = 1/4, the path is |c| / |n_s + n_p| = c / (2 sin a) off the chord: OPPOSITE_SIDES
    bulge_factor = (
        4.0 * np.sign(bending) * np.sqrt(chord_squared) / normals_squared if normals_squared > OPPOSITE_SIDES else 0.0
    )
    for i in range(dimension):
        bulge[i] = bulge_factor * (target[1, i] + tool[1, i])

    # 3. Find the share of the path at which |F_t| = mu_k F_n (4.20). `excess` = |F_t| - mu_k F_n (N) is positive at
    # `low`, where the tool is pulled on, and negative at `high`, where it is held or pulled back. Trial 0 is s itself,
    # trial 1 is p; then secants that halve the excess of an end that stays (Illinois), and bisection if these are slow.
    low, high, excess_low, excess_high = 0.0, 1.0, 0.0, 0.0
    share, last_end, past_target = 0.0, 0, False  # last_end: 1 if `low` moved last, -1 if `high` did
    for k in range(MOST_TRIALS):
        if k == 0:
            trial[:] = tool
        elif k == 1:
            share = 1.0
            trial[:] = target
        else:
            if k > 2 or not past_target:
                # where the line through both ends' excesses is zero
                share = low + (high - low) * (excess_low / (excess_low - excess_high) if k < MOST_SECANTS else 0.5)
            else:
                share = high
            for i in range(dimension):
                point[i] = tool[0, i] + share * (target[0, i] - tool[0, i]) + share * (1.0 - share) * bulge[i]
            closest.function(closest.data, point, trial)

        # The force at the trial place, load + K (trial - p): F_n along its normal (4.17), F_t the rest (4.19).
        normal_force, tangential_squared, pull_onwards = 0.0, 0.0, 0.0
        for i in range(dimension):
            normal_force += (load[i] + stiffness * (trial[0, i] - target[0, i])) * trial[1, i]
        for i in range(dimension):
            tangential = load[i] + stiffness * (trial[0, i] - target[0, i]) - normal_force * trial[1, i]
            tangential_squared += tangential**2
            # the hand pulls the tool against the force that it feels: onwards along the chord where this is positive
            pull_onwards -= tangential * (target[0, i] - tool[0, i])
        tangential_force, normal_force = np.sqrt(tangential_squared), side * normal_force

        if k == 0:
            # (4.18): a tool inside the static cone stays, and so does a sliding one inside the kinetic cone
            if normal_force > 0.0 and tangential_force <= (kinetic if mode[1] == 1.0 else static) * normal_force:
                break
            mode[1] = 1.0
        excess = (tangential_force if pull_onwards > 0.0 else -tangential_force) - kinetic * normal_force
        if normal_force <= 0.0:  # nothing presses the tool there: there is no cone, and it goes on
            excess = abs(press)
        if abs(excess) <= ON_CONE * kinetic * normal_force:
            break
        if excess > 0.0:
            if k == 2 and past_target:  # not even there does the force come back into the cone: stay at p
                trial[:] = target
                break
            if k == 1:
                # At p the lag is zero, and the renderer's own force is off the normal by more than the cone, as that of
                # a facet may be. The root is past p: try where K |s - p| is twice that force.
                past_target = True
                high = 1.0 + 2.0 * tangential_force / (stiffness * np.sqrt(chord_squared))
            excess_high *= 0.5 if last_end == 1 else 1.0
            low, excess_low, last_end = share, excess, 1
        else:
            excess_low *= 0.5 if last_end == -1 else 1.0
            high, excess_high, last_end = share, excess, -1
        if high - low <= SAME_PLACE:
            break

    # 4. A sliding tool whose F_t has fallen to the share `stick` of the kinetic cone sticks again; see the module.
    if mode[1] == 1.0 and (stick == 1.0 or tangential_force <= stick * kinetic * normal_force):
        mode[1] = 0.0
    tool[:] = trial
    for i in range(dimension):
        force[i] += stiffness * (tool[0, i] - target[0, i])  # F_b + K (s - p)
        ihip[i] = tool[0, i]
    return 0
