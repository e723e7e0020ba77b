"""A projection and a regulation scheme make a renderer: the kind that thesis chapter 4 describes.

`regulate` is the kernel of all regulation schemes: see `regulation`. A renderer whose step is compiled, `LawRenderer`,
answers a tick from Python, a whole path and a closed loop by one kernel.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import replace
from typing import Any, NamedTuple, Protocol, Self, TypeVar
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike

from hapticeval.compiled import borrowing, compiled, first_class, for_kernels, inner
from hapticeval.errors import DomainError, InputError, in_m
from hapticeval.geometry.boundary import Boundary
from hapticeval.geometry.model import Model
from hapticeval.laws import LAW, LawData, law_data
from hapticeval.recordings.recording import path_velocities
from hapticeval.records import as_record, numbers_of, record_type, room_for
from hapticeval.renderer import SOLVED_LAWS, STIFFNESS_LIMITS, Answers, CompiledStep, Declaration, Response
from hapticeval.renderers.potential import POTENTIAL, potential_record, stiffness_range, stretch_at
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
from hapticeval.types import Array, BoolArray

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
        exit_number = self.law.function(self.law.data, hip, velocity, self._push, dt, ihip, force)
        if exit_number:
            raise self.led_out(hip, self.law.domain_exits[exit_number])
        return Response(ihip, force)

    def run(self, hips: Array, dt: float) -> tuple[Array, Array]:
        """Answer a whole path: `reset` at the first row of `hips` (n, N), m, and a `step` a row, every `dt` s.

        The velocity is the difference backwards in time, as a recording has it. Returns IHIPs (n, N), m, and forces
        (n, N), N. Raises as `step` does.
        """
        hips = as_rows(hips)
        answers = Answers.room(hips)
        self.reset(hips[0])
        row, exit_number = self.law.lead(hips, path_velocities(hips, dt), np.full(len(hips), dt), answers)
        if exit_number:
            raise self.led_out(hips[row], self.law.domain_exits[exit_number])
        return answers.ihip, answers.force

    def led_out(self, hip: Array, what: str) -> DomainError:
        """Return the error for a hand at `hip` (N,), m, where the law is not defined, as `what` says."""
        return DomainError(f"{what}: {in_m(hip)}")

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

FIRST_OWN = room_for(GAINS)
"""Where in `params` a projection's own numbers begin."""

PAST = record_type("in_contact", error=3, normal=3)
"""What the `state` of a law begins with: whether there was contact at the tick before, its position error (m), and the
outward unit normal at the IHIP, which a projection writes before it regulates."""


def gains_of(regulation: Regulation, scene: Scene) -> Array:
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


class Projected(NamedTuple):
    """Where a projection leads HIPs: the one form of it, for a single HIP (N,) and for HIPs (n, N), a row each.

    - `ihip` (N,) or (n, N), m: the tool on the surface; out of contact the HIP itself.
    - `normal` (N,) or (n, N): the outward unit normal there; out of contact zero.
    - `contact`, a truth or (n,): whether the tool is held. A bilateral projection always holds it.
    """

    ihip: Array
    normal: Array
    contact: BoolArray | bool

    def row(self, number: int) -> Projected:
        """Return one of the rows, as of a single HIP."""
        return Projected(self.ihip[number], self.normal[number], bool(np.atleast_1d(self.contact)[number]))


class Projection(Protocol):
    """HIP to IHIP (4.4): the first half of a projective renderer, from the hand to the virtual tool (thesis 4.1).

    - `surface`: the curve, or surface in space, that is really rendered.
    - `resolution` (m): the length of it over which the projection is blurred, and `standoff` (m) how far it may lie off
      the model: both zero where it is exact.
    - `potential`: the numbers of the one that is made with it, see the module of that name, and `support_range` the
      least and the largest support distance (m) of the surface about its centre; both are empty without one.
    """

    resolution: float
    standoff: float
    potential: Sequence[float]
    support_range: Sequence[float]

    @property
    def surface(self) -> Boundary:
        """What is really rendered."""

    def project(self, hip: Array) -> Projected:
        """Project a HIP (N,), m, in one tick: for a projection without memory."""

    def trace(self, hips: Array) -> Projected:
        """Project HIPs (n, N), m, a tick a row, from a free start: a row as `project` where there is no memory."""


def regulated(projection: Projection, regulation: Regulation, scene: Scene) -> CompiledRenderer | RendererInPython:
    """Return the renderer that a projection makes with a scheme and the scene's gains."""
    if isinstance(projection, CompiledProjection):
        return CompiledRenderer(projection, regulation, scene)
    return RendererInPython(projection, regulation, scene)


def declaration_of(projection: Projection, regulation: Regulation, scene: Scene) -> Declaration:
    """Return what a renderer declares that checks may hold it to: along what it is a spring, how its stiffness varies.

    The square root's is (e_0 / e)^(1/2) times K, at errors e up to the model's size. No range is wider than it may be.
    """
    lowest, highest = STIFFNESS_LIMITS
    shares = None
    if regulation.potential:
        shares = stiffness_range(projection.potential, *projection.support_range)
    elif regulation.number == SQUARE_ROOT:
        shares = min(1.0, (REFERENCE_DEPTH / scene.model.size) ** 0.5), highest
    if shares is not None:
        shares = max(shares[0], lowest), min(shares[1], highest)
    return Declaration(
        spring=regulation.spring,
        stiffness_range=shares,
        memoryless=getattr(projection, "begin", None) is None,  # what begins a run keeps something of it
        smooth_only=getattr(projection, "smooth_only", False),
    )


class CompiledProjection:
    """A projection as the kernel `law`, of signature `LAW`, that projects and lets `regulate` make the force.

    - `tables`: fields of its `LawData`, whose `params` begin with the gains; `own` follows.
    - `state`: the record that the law's state is, which begins with `PAST`, and `begin` (data, hip) what prepares it at
      the start of a run, for a projection with memory.
    - `rows`: as of `CompiledStep`; `potential` and `support_range`: as of `Projection`.
    - `exact`: whether it goes to the nearest point of the exact surface: what a scheme does with that has closed forms.
    """

    def __init__(
        self,
        law: Callable[..., Any],
        surface: Boundary,
        *,
        bilateral: bool,
        own: ArrayLike = (),
        state: np.dtype[Any] = PAST,
        begin: Callable[[LawData, Array], None] | None = None,
        rows: Callable[..., tuple[int, int]] | None = None,
        resolution: float = 0.0,
        standoff: float = 0.0,
        potential: Sequence[float] = (),
        support_range: Sequence[float] = (),
        exact: bool = False,
        **tables: ArrayLike,
    ) -> None:
        self.law, self.exact = law, exact
        self.surface, self.resolution, self.standoff = surface, resolution, standoff
        self.begin, self.rows, self.potential, self.support_range = begin, rows, potential, support_range
        params = np.concatenate([np.zeros(FIRST_OWN), np.asarray(own, dtype=np.float64)])
        as_record(params, GAINS).bilateral = bilateral  # the other gains come with a scheme: see `data`
        self._data = law_data(params, state=room_for(state), **tables)

    def project(self, hip: Array) -> Projected:
        """Project a HIP (N,), m, in one tick: for a projection without memory."""
        return self.trace(hip[np.newaxis]).row(0)

    def trace(self, hips: Array) -> Projected:
        """Project HIPs (n, N), m, a tick a row, from a free start."""
        data, hips = self.data(self._data.params[:FIRST_OWN]), as_rows(hips)  # without gains: no force is wanted
        if self.begin is not None:
            self.begin(data, hips[0])
        return Projected(*_trace(first_class(self.law, LAW), data, hips))

    def data(self, gains: Array) -> LawData:
        """Return what the law works on with `gains` (FIRST_OWN,), in N/m, N s/m and kg, in a state of its own."""
        params = np.concatenate([gains, self._data.params[FIRST_OWN:]])
        return self._data._replace(params=params, state=np.zeros_like(self._data.state))


class CompiledRenderer(LawRenderer):
    """Projects the HIP (4.4), and regulates the position error (4.5) with the scene's gains (4.6), in compiled code.

    In free space the IHIP is the HIP and the force zero.
    """

    def __init__(self, projection: CompiledProjection, regulation: Regulation, scene: Scene) -> None:
        # each renderer has a state of its own, and shares the tables with its projection
        law = CompiledStep(
            projection.law, projection.data(gains_of(regulation, scene)), domain_exits={}, rows=projection.rows
        )
        lengths = {"resolution": projection.resolution, "standoff": projection.standoff}
        super().__init__(law, projection.surface, **lengths)
        self.projection = projection
        self.regulation = regulation
        # the error of nearest points on the exact surface follows the closed forms of section 6.3
        has_closed_form = projection.exact and regulation.name in SOLVED_LAWS
        closed_form = regulation.name if has_closed_form else None
        self.declares = replace(declaration_of(projection, regulation, scene), closed_form=closed_form)

    def reset(self, hip: Array) -> None:
        """Start a run with the hand at `hip` (N,), m: inside the model it starts in contact."""
        super().reset(hip)
        if self.projection.begin is not None:
            self.projection.begin(self.law.data, as_rows(hip))


class RendererInPython:
    """Projects the HIP in Python, and regulates in compiled code: for a projection without memory that is no kernel.

    `step` and `run` agree to the last bit.
    """

    def __init__(self, projection: Projection, regulation: Regulation, scene: Scene) -> None:
        self.projection = projection
        self.regulation = regulation
        self.surface, self.resolution, self.standoff = projection.surface, projection.resolution, projection.standoff
        self.declares = declaration_of(projection, regulation, scene)
        self._params = gains_of(regulation, scene)
        if projection.potential:
            self._params = np.append(self._params, potential_record(projection.potential))
        self._state = np.zeros(room_for(PAST))

    def reset(self, hip: Array) -> None:  # noqa: ARG002 - the protocol's
        """Start a run with the hand at `hip` (N,), m: there was no contact yet."""
        self._state[:] = 0.0

    def step(self, hip: Array, velocity: Array, dt: float) -> Response:
        """One tick: `hip` (N,), m; `velocity` (N,), m/s; `dt`, s."""
        hip = as_rows(hip)
        # the same as a row of `lead`, but for what a projection saves with a single HIP
        ihip, normal, contact = self.projection.project(hip)
        projected = Projected(ihip[np.newaxis], normal[np.newaxis], np.array([contact]))
        forces = self._regulated(hip[np.newaxis], as_rows(velocity)[np.newaxis], np.array([dt]), projected)
        return Response(ihip, forces[0])

    def lead(self, hips: Array, velocities: Array, dt: Array) -> tuple[Array, Array]:
        """Answer a `step` a row from where the last one ended: HIPs (n, N), m, velocities (n, N), m/s, `dt` (n,), s.

        Returns IHIPs (n, N), m, and forces (n, N), N.
        """
        hips = as_rows(hips)
        projected = self.projection.trace(hips)
        return projected.ihip, self._regulated(hips, as_rows(velocities), as_rows(dt), projected)

    def run(self, hips: Array, dt: float) -> tuple[Array, Array]:
        """Answer a whole path: `reset` at the first of `hips` (n, N), m, and a `step` a row, as often as every `dt` s.

        The velocities are a recording's, differences backwards. Returns IHIPs (n, N), m, and forces (n, N), N.
        """
        self.reset(hips[0])
        return self.lead(hips, path_velocities(hips, dt), np.full(len(hips), dt))

    def _regulated(self, hips: Array, velocities: Array, dt: Array, projected: Projected) -> Array:
        """Return the forces (n, N), N, of projected rows, from the state that the last tick left."""
        forces = np.empty_like(hips)
        rows = for_kernels(projected.ihip), for_kernels(projected.normal), for_kernels(np.atleast_1d(projected.contact))
        _regulate_rows(self._params, self._state, hips, velocities, dt, rows, forces)
        return forces


@compiled
def _trace(law: Callable[..., Any], data: LawData, hips: Array) -> tuple[Array, Array, BoolArray]:
    """Answer each of `hips` (n, N) by a law for a hand at rest: IHIPs, normals and contact as its state has them."""
    count, size = hips.shape
    ihips, normals, contact = np.empty_like(hips), np.zeros_like(hips), np.empty(count, np.bool_)
    zero, force, past = np.zeros(size), np.empty(size), as_record(data.state, PAST)
    for row in range(count):
        # a hand at rest: only the projection counts, which the law leaves in the IHIP and in its state
        law(data, hips[row], zero, zero, 1.0, ihips[row], force)
        contact[row] = past.in_contact != 0.0
        if contact[row]:
            for i in range(size):
                normals[row, i] = past.normal[i]
    return ihips, normals, contact


@borrowing
def _regulate_rows(
    params: Array, state: Array, hips: Array, velocities: Array, dt: Array, projected: tuple[Array, Array, BoolArray],
    forces: Array,
) -> None:  # fmt: skip
    """Write the forces (n, N), N, of `Projected` rows, with their own `velocities` (n, N), m/s, and `dt` (n,), s."""
    ihips, normals, contact = projected
    past = as_record(state, PAST)
    for row in range(hips.shape[0]):
        if not contact[row]:
            release(state, hips[row], ihips[row], forces[row])
            continue
        for i in range(hips.shape[1]):  # where `regulate` reads the normal
            past.normal[i] = normals[row, i]
        known = 0.0
        if as_record(params, GAINS).scheme == GRADIENT:
            known = stretch_at(as_record(params, POTENTIAL, FIRST_OWN), hips[row], ihips[row], normals[row])
        regulate(params, state, hips[row], velocities[row], known, dt[row], ihips[row], forces[row])
