"""A projection and a regulation scheme make a renderer: the kind that thesis chapter 4 describes.

A projection is a kernel that leads the hand to the tool and lets `regulate` make the force, see `regulation_kernel`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, TypeVar
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike

from hapticeval.compiled import compiled
from hapticeval.geometry.boundary import Boundary
from hapticeval.geometry.model import Model
from hapticeval.laws import LawData, law_data, law_value
from hapticeval.records import as_record, room_for
from hapticeval.renderer import SOLVED_LAWS, STIFFNESS_LIMITS, CompiledStep, Declaration
from hapticeval.renderers.law_renderer import LawRenderer, as_rows
from hapticeval.renderers.potential import stiffness_range
from hapticeval.renderers.regulation import SQUARE_ROOT, Regulation
from hapticeval.renderers.regulation_kernel import FIRST_OWN, GAINS, PAST, REFERENCE_DEPTH, gains_of
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


class Projected(NamedTuple):
    """Where a projection leads HIPs, a row each.

    - `ihip` (n, N), m: the tool on the surface; out of contact the HIP itself.
    - `normal` (n, N): the outward unit normal there; out of contact zero.
    - `contact` (n,): whether the tool is held. A bilateral projection always holds it.
    """

    ihip: Array
    normal: Array
    contact: BoolArray


class Projection:
    """HIP to IHIP (4.4): the first half of a projective renderer, from the hand to the virtual tool (thesis 4.1).

    It is the kernel `law`, of signature `LAW`, that projects and lets `regulate` make the force.

    - `surface`: the curve, or surface in space, that is really rendered.
    - `resolution` (m): the length of it over which the projection is blurred, and `standoff` (m) how far it may lie off
      the model: both zero where it is exact.
    - `tables`: fields of its `LawData`, whose `params` begin with the gains; `own` follows. `arrange` makes of that
      what the law works on, where it needs more: a tuple with `params` and `state` too.
    - `state`: the record that the law's state is, which begins with `PAST`, and `begin` (data, hip) what prepares it at
      the start of a run, for a projection with memory.
    - `potential`: the numbers of the one that is made with it, see the module of that name, and `support_range` the
      least and the largest support distance (m) of the surface about its centre; both are empty without one.
    - `exact`: whether it goes to the nearest point of the exact surface: what a scheme does with that has closed forms.
    - `smooth_only`: whether it is made for surfaces without corners.
    - `rendered_as`: its name, where it stands in for a projection that the model does not allow.
    """

    rendered_as: str = ""

    def __init__(
        self,
        law: Callable[..., Any],
        surface: Boundary,
        *,
        bilateral: bool,
        own: ArrayLike = (),
        state: np.dtype[Any] = PAST,
        begin: Callable[[LawData, Array], None] | None = None,
        resolution: float = 0.0,
        standoff: float = 0.0,
        potential: Sequence[float] = (),
        support_range: Sequence[float] = (),
        exact: bool = False,
        smooth_only: bool = False,
        arrange: Callable[[LawData], Any] | None = None,
        **tables: ArrayLike,
    ) -> None:
        self.law, self.exact, self.smooth_only = law, exact, smooth_only
        self.surface, self.resolution, self.standoff = surface, resolution, standoff
        self.begin, self.potential, self.support_range = begin, potential, support_range
        params = np.concatenate([np.zeros(FIRST_OWN), np.asarray(own, dtype=np.float64)])
        as_record(params, GAINS).bilateral = bilateral  # the other gains come with a scheme: see `data`
        data = law_data(params, state=room_for(state), **tables)
        self._data: Any = data if arrange is None else arrange(data)

    @property
    def gains(self) -> Array:
        """Those of a projection alone (FIRST_OWN,): none but whether it is bilateral, for no force is wanted."""
        gains: Array = self._data.params[:FIRST_OWN]
        return gains

    def trace(self, hips: Array) -> Projected:
        """Project HIPs (n, N), m, a tick a row, from a free start."""
        data, hips = self.data(self.gains), as_rows(hips)
        if self.begin is not None:
            self.begin(data, hips[0])
        return Projected(*_trace(law_value(self.law, data), data, hips))

    def data(self, gains: Array) -> Any:
        """Return what the law works on with `gains` (FIRST_OWN,), in N/m, N s/m and kg, in a state of its own."""
        params = np.concatenate([gains, self._data.params[FIRST_OWN:]])
        return self._data._replace(params=params, state=np.zeros_like(self._data.state))


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
    # the error of nearest points on the exact surface follows the closed forms of section 6.3
    has_closed_form = projection.exact and regulation.name in SOLVED_LAWS
    return Declaration(
        spring=regulation.spring,
        stiffness_range=shares,
        memoryless=projection.begin is None,  # what begins a run keeps something of it
        smooth_only=projection.smooth_only,
        closed_form=regulation.name if has_closed_form else None,
    )


class ProjectiveRenderer(LawRenderer):
    """Projects the HIP (4.4), and regulates the position error (4.5) with the scene's gains (4.6).

    In free space the IHIP is the HIP and the force zero.
    """

    def __init__(self, projection: Projection, regulation: Regulation, scene: Scene) -> None:
        # each renderer has a state of its own, and shares the tables with its projection
        law = CompiledStep(projection.law, projection.data(gains_of(regulation, scene)), domain_exits={})
        lengths = {"resolution": projection.resolution, "standoff": projection.standoff}
        super().__init__(law, projection.surface, **lengths)
        self.projection, self.rendered_as = projection, projection.rendered_as
        self.regulation = regulation
        self.declares = declaration_of(projection, regulation, scene)

    def reset(self, hip: Array) -> None:
        """Start a run with the hand at `hip` (N,), m: inside the model it starts in contact."""
        super().reset(hip)
        if self.projection.begin is not None:
            self.projection.begin(self.law.data, as_rows(hip))


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
