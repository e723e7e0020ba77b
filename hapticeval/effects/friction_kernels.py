"""The tool of Coulomb friction as compiled code, (4.17) to (4.20): what it does stands in `friction`."""

from __future__ import annotations

import math

from hapticeval.bracket import narrow_bracket
from hapticeval.compiled import inner
from hapticeval.laws import ChangeData, Closest
from hapticeval.records import as_record, record_type
from hapticeval.types import Array

CONE = record_type("stiffness", "mu_s", "mu_k", "stick", "bilateral")
"""`params`: K (N/m), both coefficients, the share of the kinetic cone at which a sliding tool sticks, and 1 where the
surface is bilateral."""

FRICTION_ROWS = 12
"""Rows of `state`: place (m) and outward unit normal of the tool, of p, of a trial place, and of the end of a slide,
two each; then the pressing force (N), a point to be projected (m), the flags [in contact, sliding], and the bulge (m)
of the path."""

MOST_SLIDE_TRIALS, MOST_SECANTS = 64, 16
"""Most places at which a slide tests the kinetic cone, and the trial from which on it bisects instead of secants."""

AT_TOOL, AT_END, BEYOND_END = range(3)
"""The first trials of a slide: the tool's place s, then its end, p or a place the other way, then a place past that."""

BEYOND_LAGS = 2.0
"""How far past the end that place is, and how far from s the end is where the hand pulls the tool away from p: so many
times the lag at which the spring makes the force along the surface. *Chosen*: where the force leaves the cone there
too, the tool stays at the end."""

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


@inner
def measure_pressing_force(hip: Array, ihip: Array, force: Array, normal: Array, pressing_force: Array) -> float:
    """Write the `pressing_force` (N,), N: the part along p - HIP, or along the normal at p, of the renderer's `force`.

    `force` (N,) is in N, `hip` and `ihip` (N,), m, are the HIP and p, `normal` (N,) is the outward unit normal at p.
    Returns the size of the part, N, positive where it pushes the hand outwards. Of both the larger counts: a damper's
    along the surface does not.
    """
    error_squared, force_squared, error_outwards, force_dot_error, press_on_normal = 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(hip.shape[0]):
        error = ihip[i] - hip[i]  # (4.5) from the hand to p, m
        error_squared += error**2
        force_squared += force[i] ** 2
        error_outwards += error * normal[i]
        force_dot_error += force[i] * error
        press_on_normal += force[i] * normal[i]
    # along p - HIP, turned outwards: from a hand outside of a bilateral surface p - HIP points inwards
    outwards = 1.0 if error_outwards > 0.0 else -1.0
    press_on_error = force_dot_error * (outwards / math.sqrt(error_squared) if error_squared > 0.0 else 0.0)
    by_normal = error_squared == 0.0 or abs(press_on_normal) > abs(press_on_error)
    press = press_on_normal if by_normal else press_on_error
    # a force that is nothing but pressing is taken to the bit, without the rounding of its projection
    all_press = abs(press) >= (1.0 - ALL_ALONG) * math.sqrt(force_squared)
    for i in range(hip.shape[0]):
        direction = normal[i] if by_normal else (ihip[i] - hip[i]) * outwards / math.sqrt(error_squared)
        pressing_force[i] = force[i] if all_press else press * direction
    return press


@inner
def bulge_path(tool: Array, target: Array, chord_squared: float, bulge: Array) -> None:
    """Write the `bulge` (N,), m, by which the path from s to p leaves its chord: out over an edge, or into a hollow.

    `tool` and `target` (2, N) are places (m) and normals at s and p, `chord_squared` (m^2) is |p - s|^2. The path is
    the chord plus share (1 - share) bulge, projected on to the surface: its closest points pass by a corner.
    """
    bending, normals_squared = 0.0, 0.0  # (p - s).(n_p - n_s), m, above zero over an edge; |n_s + n_p|^2
    for i in range(bulge.shape[0]):
        bending += (target[0, i] - tool[0, i]) * (target[1, i] - tool[1, i])
        normals_squared += (target[1, i] + tool[1, i]) ** 2
    # halfway, at share (1 - share) = 1/4, the path is |c| / |n_s + n_p| = c / (2 sin a) off the chord: OPPOSITE_SIDES
    sign = 1.0 if bending > 0.0 else (-1.0 if bending < 0.0 else 0.0)
    factor = 4.0 * sign * math.sqrt(chord_squared) / normals_squared if normals_squared > OPPOSITE_SIDES else 0.0
    for i in range(bulge.shape[0]):
        bulge[i] = factor * (target[1, i] + tool[1, i])


@inner
def force_at(
    place: Array, tool: Array, end: Array, target: Array, pressing_force: Array, stiffness: float, outward_sign: float
) -> tuple[float, float, bool]:
    """Return F_n and F_t (N) on the tool at a `place`, and whether the hand pulls it onwards there, to the `end`.

    `place`, `tool`, `end` and `target` (2, N) are places (m) and outward unit normals: on trial, of s, of the end of
    the slide, and of p. The force is `pressing_force` (N,), N, plus K (place - p), K the `stiffness` (N/m).
    `outward_sign` is -1 where F_n counts inwards.
    """
    normal_force, tangential_squared, pull_onwards = 0.0, 0.0, 0.0
    for i in range(pressing_force.shape[0]):  # (4.17): its part along the normal
        normal_force += (pressing_force[i] + stiffness * (place[0, i] - target[0, i])) * place[1, i]
    for i in range(pressing_force.shape[0]):  # (4.19): what remains
        tangential = pressing_force[i] + stiffness * (place[0, i] - target[0, i]) - normal_force * place[1, i]
        tangential_squared += tangential**2
        # the hand pulls the tool against the force that it feels: onwards along the chord where this is positive
        pull_onwards -= tangential * (end[0, i] - tool[0, i])
    return outward_sign * normal_force, math.sqrt(tangential_squared), pull_onwards > 0.0


@inner
def excess_of(normal_force: float, tangential_force: float, onwards: bool, kinetic: float, press: float) -> float:
    """Return |F_t| - mu_k F_n (N), (4.20): positive where the tool is pulled on, negative where it is held or back.

    Where nothing presses the tool there is no cone, and it goes on: by the pressing force's size `press` (N).
    """
    if normal_force <= 0.0:
        return abs(press)
    return (tangential_force if onwards else -tangential_force) - kinetic * normal_force


def slide(
    data: ChangeData, closest: Closest, hip: Array, velocity: Array, dt: float, ihip: Array, force: Array  # noqa: ARG001
) -> int:  # fmt: skip
    """Hold the tool or let it slide for one tick, and add the spring K (s - p) of its lag to the force.

    The signature is that of `Effect.change`; the points HIP, p and s are those of `friction`. Returns 0: it refuses
    nothing.

    - `hip` (N,), m: the HIP.
    - `ihip` (N,), m: on entry the renderer's IHIP p, on return the tool's place s.
    - `force` (N,), N: on entry the renderer's force F_b, on return F_b + K (s - p).
    - `data.params` is the record `CONE`, `data.state` (FRICTION_ROWS, N).
    """
    cone, state, dimension = as_record(data.params, CONE), data.state, hip.shape[0]
    # each is two rows: a place on the surface (m), and the outward unit normal there
    tool, target, trial, end = state[0:2], state[2:4], state[4:6], state[10:12]
    # mode: whether there is contact, and whether the tool slides
    pressing_force, point, mode, bulge = state[6], state[7], state[8], state[9]
    force_squared, chord_squared = 0.0, 0.0  # |F_b|^2, N^2; |p - s|^2, m^2
    for i in range(dimension):
        force_squared += force[i] ** 2
    if force_squared == 0.0:  # free space: the next contact begins anew
        mode[:] = 0.0
        return 0
    closest.function(closest.data, ihip, target)
    for i in range(dimension):
        chord_squared += (target[0, i] - tool[0, i]) ** 2
    press = measure_pressing_force(hip, ihip, force, target[1], pressing_force)
    # a bilateral surface also holds a tool that is pulled off it: F_n then counts inwards
    outward_sign = -1.0 if press < 0.0 and cone.bilateral == 1.0 else 1.0
    # No lag: contact begins, s is p already, or nothing presses the tool on the surface.
    if mode[0] == 0.0 or chord_squared == 0.0 or outward_sign * press <= 0.0:
        tool[:] = target
        ihip[:] = target[0]
        mode[0], mode[1] = 1.0, 0.0
        return 0
    bulge_path(tool, target, chord_squared, bulge)
    end[:] = target

    # The share of the path at which the excess |F_t| - mu_k F_n (4.20) is zero: above it at `low`, below it at `high`.
    # Secants (Illinois) follow the first trials, and bisection if these are slow.
    low, high, excess_low, excess_high = 0.0, 1.0, 0.0, 0.0
    share, side_kept, past_end = 0.0, 0, False
    for k in range(MOST_SLIDE_TRIALS):
        if k == AT_TOOL:
            trial[:] = tool
        elif k == AT_END:
            share = 1.0
            trial[:] = end
        else:
            if k == BEYOND_END and past_end:
                share = high
            else:
                # where the line through both ends' excesses is zero
                share = low + (high - low) * (excess_low / (excess_low - excess_high) if k < MOST_SECANTS else 0.5)
            for i in range(dimension):
                point[i] = tool[0, i] + share * (end[0, i] - tool[0, i]) + share * (1.0 - share) * bulge[i]
            closest.function(closest.data, point, trial)
        normal_force, tangential_force, onwards = force_at(
            trial, tool, end, target, pressing_force, cone.stiffness, outward_sign
        )
        if k == AT_TOOL:
            # (4.18): a tool inside the static cone stays, and so does a sliding one inside the kinetic cone
            coefficient = cone.mu_k if mode[1] == 1.0 else cone.mu_s
            if normal_force > 0.0 and tangential_force <= coefficient * normal_force:
                break
            mode[1] = 1.0
            if normal_force > 0.0 and not onwards:
                # The hand pulls the tool away from p, which the renderer has beyond a tip: it slides back that way.
                for i in range(dimension):  # -F_t / K is the way at whose end nothing pulls
                    pull = (target[0, i] - tool[0, i]) - (
                        pressing_force[i] - outward_sign * normal_force * tool[1, i]
                    ) / cone.stiffness
                    point[i] = tool[0, i] + BEYOND_LAGS * pull
                closest.function(closest.data, point, end)
                chord_squared = 0.0
                for i in range(dimension):
                    chord_squared += (end[0, i] - tool[0, i]) ** 2
                bulge_path(tool, end, chord_squared, bulge)
                onwards = True
        excess = excess_of(normal_force, tangential_force, onwards, cone.mu_k, press)
        if abs(excess) <= ON_CONE * cone.mu_k * normal_force:
            break
        if excess > 0.0:
            if k == BEYOND_END and past_end:  # not even there does the force come back into the cone: stay at the end
                trial[:] = end
                break
            if k == AT_END:
                # At p the lag is zero, and the renderer's own force is off the normal by more than the cone, as that of
                # a facet may be. The root is past p: try where K |s - p| is BEYOND_LAGS times that force.
                past_end = True
                high = 1.0 + BEYOND_LAGS * tangential_force / (cone.stiffness * math.sqrt(chord_squared))
        low, high, excess_low, excess_high, side_kept = narrow_bracket(
            low, high, excess_low, excess_high, side_kept, share, excess, True
        )
        if high - low <= SAME_PLACE:
            break

    # A sliding tool whose F_t has fallen to the share `stick` of the kinetic cone sticks again; see `friction`.
    if mode[1] == 1.0 and (cone.stick == 1.0 or tangential_force <= cone.stick * cone.mu_k * normal_force):
        mode[1] = 0.0
    tool[:] = trial
    for i in range(dimension):
        force[i] += cone.stiffness * (tool[0, i] - target[0, i])  # F_b + K (s - p)
        ihip[i] = tool[0, i]
    return 0
