"""Renderers whose step is compiled: one kernel answers a tick from Python, a whole path, and a closed loop.

Beside them `regulate`, the kernel of all regulation schemes: see `regulation`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from copy import copy
from typing import Any, Self, TypeVar
from weakref import WeakKeyDictionary

import numpy as np

from hapticeval.compiled import (
    as_record,
    for_kernels,
    inner,
    numbers_of,
    record_type,
    room_for,
)
from hapticeval.errors import DomainError, InputError
from hapticeval.geometry.boundary import Boundary
from hapticeval.geometry.model import Model
from hapticeval.recordings.recording import path_velocities
from hapticeval.renderer import Answers, CompiledStep, Response
from hapticeval.renderers.regulation import (
    GRADIENT,
    PP,
    PP_D,
    PP_PD,
    PP_PD_C,
    PP_V,
    SQUARE_ROOT,
    TRANSVERSAL,
    Regulation,
)
from hapticeval.scene import Scene
from hapticeval.types import Array

T = TypeVar("T")


def once(model: Model, key: object, make: Callable[[], T]) -> T:
    """Return what `make` makes of a model under `key`: made at the first call, and kept as long as the model."""
    values = _KEPT.setdefault(model, {})
    if key not in values:
        values[key] = make()
    return values[key]  # type: ignore[no-any-return]


_KEPT: WeakKeyDictionary[Model, dict[object, Any]] = WeakKeyDictionary()


class LawRenderer:
    """Answers by `law`, with the same bits in `step`, in `run` and in a compiled loop.

    `surface` is the curve, or surface in space, that is really rendered, `resolution` (m) the length of it over which
    the representation is blurred, and `standoff` (m) how far it may lie off the model.
    """

    def __init__(
        self,
        law: CompiledStep,
        surface: Boundary,
        *,
        resolution: float = 0.0,
        standoff: float = 0.0,
    ) -> None:
        self.law = law
        self.surface = surface
        self.resolution = resolution
        self.standoff = standoff
        self._push = np.zeros(surface.dimension)

    def reset(self, hip: Array) -> None:  # noqa: ARG002 - the protocol's
        """Start a run with the hand at `hip` (N,), m: nothing is touched yet, and nothing felt."""
        self.law.data.state[:] = 0.0
        self._push[:] = 0.0

    def step(self, hip: Array, velocity: Array, dt: float) -> Response:
        """One tick: `hip` (N,), m; `velocity` (N,), m/s; `dt`, s. Raises `DomainError` where the law is not defined."""
        hip, velocity = checked_hand(hip), as_rows(velocity)
        ihip, force = np.empty_like(self._push), np.empty_like(self._push)
        refusal = self.law.function(self.law.data, hip, velocity, self._push, dt, ihip, force)
        if refusal:
            raise self.led_out(hip, self.law.refusals[refusal])
        return Response(ihip, force)

    def run(self, hips: Array, dt: float) -> tuple[Array, Array]:
        """Answer a whole path: `reset` at the first row of `hips` (n, N), m, and a `step` a row, every `dt` s.

        The velocity is the difference backwards in time, as a recording has it. Returns IHIPs (n, N), m, and forces
        (n, N), N. Raises as `step` does.
        """
        hips = as_rows(hips)
        answers = Answers.room(hips)
        self.reset(hips[0])
        row, refusal = self.law.lead(hips, path_velocities(hips, dt), np.full(len(hips), dt), answers)
        if refusal:
            raise self.led_out(hips[row], self.law.refusals[refusal])
        return answers.ihip, answers.force

    def led_out(self, hip: Array, what: str) -> DomainError:
        """Return the error for a hand at `hip` (N,), m, where the law is not defined, as `what` says."""
        return DomainError(f"{what}: ({', '.join(f'{x:.6g}' for x in hip)}) m")

    def __deepcopy__(self, memo: Mapping[int, Any]) -> Self:
        """Copy what a tick changes, and share the rest, which nothing does."""
        twin, data = copy(self), self.law.data
        twin.law = self.law._replace(data=data._replace(state=data.state.copy()))
        twin._push = self._push.copy()
        return twin


def checked_hand(hip: Array) -> Array:
    """Return a hand's position (N,), m, as kernels take it. Raises `InputError` for one that is not finite."""
    hip = as_rows(hip)
    if not math.isfinite(hip @ hip):  # a search would have no end
        raise InputError(
            f"the HIP is {tuple(hip.tolist())}", why="no point is near to it", todo="see what gives the positions"
        )
    return hip


def as_rows(values: Array) -> Array:
    """Return rows (n, N), or one (N,), of any unit (m, N, s) as kernels take them: float64, writable and contiguous."""
    return for_kernels(np.asarray(values, dtype=np.float64))


REFERENCE_DEPTH = 1e-3
"""Depth (m) at which the square-root spring gives the linear spring's force."""

REFERENCE_RATE = 0.1
"""Speed of penetration (m/s) at which, at the reference depth, the square-root damper gives the linear one's force."""

GAINS = record_type("scheme", "bilateral", "stiffness", "damping", "mass", "spring", "damper")
"""What the `params` of a law begin with: N/m, N s/m, kg; `spring` and `damper` are those of the square root."""

OWN = room_for(GAINS)
"""Where in `params` a projection's own numbers begin."""

PAST = record_type("in_contact", error=3, normal=3)
"""What the `state` of a law begins with: whether there was contact at the tick before, its position error (m), and the
outward unit normal at the IHIP, which a projection writes before it regulates."""


def gains(regulation: Regulation, scene: Scene) -> Array:
    """Return the `GAINS` of a law (7,), which its `params` begin with."""
    # k_p = K_p e_0^(1/2) and k_d = K_d (rate_0 / e_0)^(1/2), see `regulation` on the square root
    spring = scene.stiffness * REFERENCE_DEPTH**0.5
    damper = scene.damping * (REFERENCE_RATE / REFERENCE_DEPTH) ** 0.5
    return numbers_of(
        GAINS, scheme=regulation.number, bilateral=scene.bilateral, stiffness=scene.stiffness, damping=scene.damping,
        mass=scene.mass, spring=spring, damper=damper,
    )  # fmt: skip


@inner
def release(state: Array, hip: Array, ihip: Array, force: Array) -> int:
    """Answer in free space: `ihip` (N,) is the HIP, `hip` (N,), m, and `force` (N,), N, zero. Returns 0."""
    as_record(state, PAST).in_contact = 0.0
    for i in range(hip.shape[0]):
        ihip[i], force[i] = hip[i], 0.0
    return 0


@inner
def regulate(
    params: Array, state: Array, hip: Array, velocity: Array, known: float, dt: float, ihip: Array, force: Array
) -> int:
    """Write the regulation scheme's force (N,), N, on a hand in contact: the table in `regulation`. Returns 0.

    `hip` and `ihip` (N,), m, are the hand and the tool, `velocity` (N,), m/s, the hand's; the outward unit normal at
    the IHIP stands in `state`.

    `known` is what a projection knows beside them: κ v_t^2 (m/s^2) for `pp-pd-c`, p (m) for `gradient`. Sums and
    products have one order, so that all ways give the same bits.
    """
    count, gains, past = hip.shape[0], as_record(params, GAINS), as_record(state, PAST)
    scheme, stiffness, damping, normal = gains.scheme, gains.stiffness, gains.damping, past.normal
    was_in_contact = past.in_contact != 0.0
    normal_velocity, normal_error, depth_squared, error_dot_rate = 0.0, 0.0, 0.0, 0.0
    for i in range(count):
        # (4.5), and its difference backwards: zero in the first tick of contact, which has no error before it
        error = hip[i] - ihip[i]
        rate = (error - past.error[i]) / dt if was_in_contact else 0.0
        past.error[i] = error
        depth_squared += error * error
        error_dot_rate += error * rate
        force[i] = -stiffness * error  # (4.8)
        if scheme == PP_D:  # (4.12)
            force[i] = force[i] - damping * rate
    past.in_contact = 1.0
    if scheme == PP:
        return 0
    for i in range(count):
        normal_velocity += normal[i] * velocity[i]
        normal_error += normal[i] * past.error[i]
        if scheme == PP_V:  # (4.10)
            force[i] = force[i] - damping * velocity[i]
    if scheme in (TRANSVERSAL, GRADIENT):
        if gains.bilateral == 0.0:
            normal_error = min(normal_error, 0.0)  # a hand above the tangent at a distant foot is not pulled to it
        # (5.21) with its signs corrected, or K_p p n - K_d (n.v) n
        size = (-stiffness * normal_error if scheme == TRANSVERSAL else stiffness * known) - damping * normal_velocity
        for i in range(count):
            force[i] = size * normal[i]
    elif scheme == SQUARE_ROOT:
        # section 4.2: F = k_p e^(1/2) + k_d e^(1/2) e'^(1/2) from HIP to IHIP, e' with its sign
        depth = math.sqrt(depth_squared)
        safe = depth if depth > 0.0 else 1.0  # on the surface the error is zero, and so is the force
        error_rate = error_dot_rate / safe  # of the error's length, m/s
        size = math.sqrt(depth) * (gains.spring + gains.damper * math.copysign(math.sqrt(abs(error_rate)), error_rate))
        for i in range(count):
            force[i] = -size * (past.error[i] / safe)
    elif scheme in (PP_PD, PP_PD_C):
        size = damping * normal_velocity
        for i in range(count):
            force[i] = force[i] - size * normal[i]  # (4.14): damp along the normal only
            if scheme == PP_PD_C:  # (3.8): -m κ v_t^2 n
                force[i] = force[i] - gains.mass * known * normal[i]
    return 0
