"""A projection and a regulation scheme make a renderer: the kind that thesis chapter 4 describes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from hapticeval.compiled import (
    LAW,
    LawData,
    as_record,
    borrowing,
    compiled,
    first_class,
    for_kernels,
    law_data,
    room_for,
)
from hapticeval.geometry.boundary import Boundary
from hapticeval.recordings.recording import path_velocities
from hapticeval.renderer import SCHEMES, STIFFNESS_LIMITS, CompiledStep, Declaration, Response
from hapticeval.renderers.law import (
    GAINS,
    OWN,
    PAST,
    REFERENCE_DEPTH,
    LawRenderer,
    as_rows,
    gains,
    regulate,
    release,
)
from hapticeval.renderers.potential import POTENTIAL, potential_record, stiffness_range, stretch_at
from hapticeval.renderers.regulation import GRADIENT, SQUARE_ROOT, Regulation
from hapticeval.scene import Scene
from hapticeval.types import Array, BoolArray


class Projected(NamedTuple):
    """Where a projection leads HIPs: the one form of it, for a single HIP (N,) and for HIPs (n, N), a row each.

    - `ihip` (N,) or (n, N), m: the tool on the surface; out of contact the HIP itself.
    - `normal` (N,) or (n, N): the outward unit normal there; out of contact zero.
    - `contact`, a truth or (n,): whether the tool is held. A bilateral projection always holds it.
    """

    ihip: Array
    normal: Array
    contact: BoolArray


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


def regulated(projection: Projection, regulation: Regulation, scene: Scene) -> ProjectiveRenderer | ProjectedRenderer:
    """Return the renderer that a projection makes with a scheme and the scene's gains."""
    if isinstance(projection, CompiledProjection):
        return ProjectiveRenderer(projection, regulation, scene)
    return ProjectedRenderer(projection, regulation, scene)


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
        params = np.concatenate([np.zeros(OWN), np.asarray(own, dtype=np.float64)])
        as_record(params, GAINS).bilateral = bilateral  # the other gains come with a scheme: see `data`
        self._data = law_data(params, state=room_for(state), **tables)

    def project(self, hip: Array) -> Projected:
        """Project a HIP (N,), m, in one tick: for a projection without memory."""
        return Projected(*(column[0] for column in self.trace(hip[np.newaxis])))

    def trace(self, hips: Array) -> Projected:
        """Project HIPs (n, N), m, a tick a row, from a free start."""
        data, hips = self.data(self._data.params[:OWN]), as_rows(hips)  # without gains: no force is wanted
        if self.begin is not None:
            self.begin(data, hips[0])
        return Projected(*_trace(first_class(self.law, LAW), data, hips))

    def data(self, gains: Array) -> LawData:
        """Return what the law works on with `gains` (OWN,), of the units N/m, N s/m and kg, in a state of its own."""
        params = np.concatenate([gains, self._data.params[OWN:]])
        return self._data._replace(params=params, state=np.zeros_like(self._data.state))


class ProjectiveRenderer(LawRenderer):
    """Projects the HIP (4.4), and regulates the position error (4.5) with the scene's gains (4.6), in compiled code.

    In free space the IHIP is the HIP and the force zero.
    """

    def __init__(self, projection: CompiledProjection, regulation: Regulation, scene: Scene) -> None:
        # each renderer has a state of its own, and shares the tables with its projection
        law = CompiledStep(projection.law, projection.data(gains(regulation, scene)), refusals={}, rows=projection.rows)
        lengths = {"resolution": projection.resolution, "standoff": projection.standoff}
        super().__init__(law, projection.surface, **lengths)
        self.projection = projection
        self.regulation = regulation
        # the error of nearest points on the exact surface follows the closed forms of section 6.3
        has_closed_form = projection.exact and regulation.name in SCHEMES
        closed_form = regulation.name if has_closed_form else None
        self.declares = replace(declaration_of(projection, regulation, scene), closed_form=closed_form)

    def reset(self, hip: Array) -> None:
        """Start a run with the hand at `hip` (N,), m: inside the model it starts in contact."""
        super().reset(hip)
        if self.projection.begin is not None:
            self.projection.begin(self.law.data, as_rows(hip))


class ProjectedRenderer:
    """Projects the HIP in Python, and regulates in compiled code: for a projection without memory that is no kernel.

    `step` and `run` agree to the last bit.
    """

    def __init__(self, projection: Projection, regulation: Regulation, scene: Scene) -> None:
        self.projection = projection
        self.regulation = regulation
        self.surface, self.resolution, self.standoff = projection.surface, projection.resolution, projection.standoff
        self.declares = declaration_of(projection, regulation, scene)
        self._params = gains(regulation, scene)
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
        rows = tuple(for_kernels(column) for column in projected)
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
            known = stretch_at(as_record(params, POTENTIAL, OWN), hips[row], ihips[row], normals[row])
        regulate(params, state, hips[row], velocities[row], known, dt[row], ihips[row], forces[row])
