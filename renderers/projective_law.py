"""Projective renderers as compiled laws: minimum distance with every regulation scheme, answering as `step` does.

The sums and products are those of `regulation`, in the same order, so that both agree to the last bit.
"""

from __future__ import annotations

import math

import numpy as np

from hapticeval.compiled import LawData, compiled, law_data
from hapticeval.geometry.curve_kernels import project
from hapticeval.geometry.kernels import KIND, U0, U1, UNBOUNDED, piece_of
from hapticeval.geometry.polygon_kernels import nearest_kernel, side_kernel
from hapticeval.geometry.surface_kernels import place
from hapticeval.renderer import CompiledLaw
from hapticeval.renderers.nearest import MinimumDistanceProjection, NearestOnSurface, falling, falling_in_space
from hapticeval.renderers.outline import Boundary, frame
from hapticeval.renderers.projection import Projection
from hapticeval.renderers.regulation import REGULATIONS, Regulation, root_gains
from hapticeval.types import Array

SCHEME, BILATERAL, STIFFNESS, DAMPING, MASS, SPRING, DAMPER, JOINTS = range(8)
"""Where the gains are in `reals`: SPRING and DAMPER are those of the square root. The turns of the n joints
come last, and after them a polygon's vertices (n, 2)."""

NUMBERS = {name: float(number) for number, name in enumerate(REGULATIONS)}
PP, PP_V, PP_D, PP_PD, TRANSVERSAL, SQUARE_ROOT, PP_PD_C = (
    NUMBERS[name] for name in ("pp", "pp-v", "pp-d", "pp-pd", "transversal", "square-root", "pp-pd-c")
)

HELD, ERROR = 0, 1
"""In `memory`: whether there was contact at the tick before, and its error; then room for the normal and the rate."""

TREE = 6
"""Columns of the `samples` that are a polygon's search tree."""


def law_of(
    projection: Projection, regulation: Regulation, *, stiffness: float, damping: float, mass: float
) -> CompiledLaw | None:
    """The law of a projective renderer, or None for a projection that has no compiled form."""
    if isinstance(projection, MinimumDistanceProjection):
        b = projection.boundary
        function, pieces = in_the_plane, b.pieces
        samples = b.tree if _edges(b) else b.samples
        joints = np.append(b.joints, b.vertices) if _edges(b) else b.joints
    elif isinstance(projection, NearestOnSurface):
        function, pieces, joints = in_space, projection.surface.row[np.newaxis], np.empty(0)
        samples = np.empty((0, 0))
    else:
        return None
    gains = (NUMBERS[regulation.name], float(projection.bilateral), stiffness, damping, mass)
    params = np.concatenate([gains, root_gains(stiffness, damping), joints])
    data = law_data(params, segments=pieces, lookup=samples, state=1 + 3 * projection.surface.dimension)
    return CompiledLaw(function, data, refusals={})


def _edges(b: Boundary) -> bool:
    """Whether the nearest point is looked for in the tree of the edges, as `nearest_on` does."""
    return b.closed and b.stray == 0.0


@compiled
def in_the_plane(
    data: LawData,
    hip: Array,
    velocity: Array,
    push: Array,  # noqa: ARG001 - every law has it
    dt: float,
    ihip: Array,
    force: Array,
) -> int:
    """One tick on a curve or a polygon, of signature `LAW`."""
    reals, pieces, samples, memory = data.params, data.segments, data.lookup, data.state
    x, y = hip[0], hip[1]
    closed = pieces[0, KIND] != UNBOUNDED
    if samples.shape[1] == TREE:
        count = pieces.shape[0]
        vertices = reals[JOINTS + count : JOINTS + 3 * count].reshape((count, 2))
        k, along, distance2 = nearest_kernel(vertices, samples, x, y)
        u = pieces[k, U0] + along * (pieces[k, U1] - pieces[k, U0])
        side = side_kernel(vertices, k, along, x, y) if distance2 > 0.0 else 1.0
    else:
        u, _, side = project(pieces, samples, x, y)
        k = piece_of(pieces, u)
    if reals[BILATERAL] == 0.0 and not side < 0.0:
        _free(memory, hip, ihip, force)
        return 0
    ihip[0], ihip[1], memory[3], memory[4] = frame(pieces, reals[JOINTS:], closed, k, u, x, y)
    fall = falling(pieces, k, u, velocity[0], velocity[1]) if reals[SCHEME] == PP_PD_C else 0.0
    _regulate(reals, memory, hip, velocity, fall, dt, ihip, force)
    return 0


@compiled
def in_space(
    data: LawData,
    hip: Array,
    velocity: Array,
    push: Array,  # noqa: ARG001 - every law has it
    dt: float,
    ihip: Array,
    force: Array,
) -> int:
    """One tick on a surface in space, whose row is that of `pieces`, of signature `LAW`."""
    reals, pieces, memory = data.params, data.segments, data.state
    foot, normal, distance = place(pieces[0], (hip[0], hip[1], hip[2]))
    if reals[BILATERAL] == 0.0 and not distance < 0.0:
        _free(memory, hip, ihip, force)
        return 0
    for i in range(3):
        ihip[i], memory[ERROR + 3 + i] = foot[i], normal[i]
    fall = 0.0
    if reals[SCHEME] == PP_PD_C:
        fall = falling_in_space(pieces[0], foot, normal, (velocity[0], velocity[1], velocity[2]))
    _regulate(reals, memory, hip, velocity, fall, dt, ihip, force)
    return 0


@compiled
def _free(memory: Array, hip: Array, ihip: Array, force: Array) -> None:
    """Out of contact."""
    memory[HELD] = 0.0
    for i in range(hip.shape[0]):
        ihip[i], force[i] = hip[i], 0.0


@compiled
def _regulate(
    reals: Array, memory: Array, hip: Array, velocity: Array, fall: float, dt: float, ihip: Array, force: Array
) -> None:
    """The force of the scheme, with the normal as it lies in `memory`; `fall` (m/s^2) is κ v_t^2 for `pp-pd-c`."""
    count = hip.shape[0]
    before, normal = memory[ERROR : ERROR + count], memory[ERROR + count : ERROR + 2 * count]
    rate = memory[ERROR + 2 * count : ERROR + 3 * count]
    for i in range(count):
        error = hip[i] - ihip[i]
        rate[i] = (error - before[i]) / dt if memory[HELD] != 0.0 else 0.0
        before[i] = error
    memory[HELD] = 1.0
    error = before
    scheme, stiffness, damping = reals[SCHEME], reals[STIFFNESS], reals[DAMPING]
    if scheme == TRANSVERSAL:
        size = -stiffness * _dot(normal, error) - damping * _dot(normal, velocity)
        for i in range(count):
            force[i] = size * normal[i]
        return
    if scheme == SQUARE_ROOT:
        depth = math.sqrt(_dot(error, error))
        safe = depth if depth > 0.0 else 1.0
        closing = _dot(error, rate) / safe
        size = math.sqrt(depth) * (reals[SPRING] + reals[DAMPER] * math.copysign(math.sqrt(abs(closing)), closing))
        for i in range(count):
            force[i] = -size * (error[i] / safe)
        return
    across = damping * _dot(normal, velocity) if scheme in (PP_PD, PP_PD_C) else 0.0
    for i in range(count):
        force[i] = -stiffness * error[i]
        if scheme == PP_V:
            force[i] = force[i] - damping * velocity[i]
        elif scheme == PP_D:
            force[i] = force[i] - damping * rate[i]
        elif scheme in (PP_PD, PP_PD_C):
            force[i] = force[i] - across * normal[i]
            if scheme == PP_PD_C:
                force[i] = force[i] - reals[MASS] * fall * normal[i]


@compiled
def _dot(first: Array, second: Array) -> float:
    total = 0.0
    for i in range(first.shape[0]):
        total += first[i] * second[i]
    return total
