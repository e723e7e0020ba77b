"""Implicit surfaces: the contact point is led along S(p) = 0 by S and its gradient alone.

Salisbury, K., Tarr, C. (1997): Haptic rendering of surfaces defined by implicit functions, ASME DSC 61.

With S < 0 inside, h the hand, s the contact point, n the unit normal there, and K the stiffness:

1. A contact begins where S(h) <= 0; s is where S = 0 on the hand's way, by bisection.
2. The tangent plane at s: q = h - ((h - s) . n) n is the point of it nearest to the hand.
3. Back to the surface: s <- q - S(q) grad S(q) / |grad S(q)|^2, a few times; then 2 anew, four times a tick.
4. F = K (s - h). The contact ends when (h - s) . n > 0.

S is the signed distance: that of the model itself (`@exact`), or one that is sampled on a grid and interpolated
between its nodes (`@grid`). On the grid two laws go without a contact point that remembers, as of engines that hold
distance fields, with phi = S(h) < 0 and s = h - phi n: `+normal`, F = -K phi n with n = grad phi / |grad phi|, and
`+gradient`, F = -K phi grad phi, which is the gradient of K phi^2 / 2. The first is not a gradient where |grad phi| is
not 1.

Predicted from the equations, before any run:

- continuous contact: `tracked` passes on smooth models, also deep, where s stays on its sheet; at edges q jumps off
  the face by no more than the hand moves, and s turns the edge at once to the next face: fails there, as by the
  nearest point. The other two follow the nearest point: they fail at medial axes, which the grid smears over a cell,
  so that a fine enough path sees a steep move and no jump.
- contact normal force: `tracked` passes on the model, for n is its normal; on the grid all are off by the grid's
  normals, one cell's turn, kappa a, which the declared resolution covers.
- broken contact: fails for all at convex edges, where no plane is left before the way is open, or s goes round.
- abrupt switch: `tracked` fails: s rests at the corner or chatters between the two faces.
- impulsive collision, centripetal force: fail, as for every spring.
- force magnitude: passes for `tracked` and `normal`, K times the error; `gradient` fails near medial axes, where |grad
  phi| < 1.
- passivity: `gradient` passes, a potential; `normal` fails beside medial axes on the grid; `tracked` is open.
- memoryless: `tracked` fails deep in a lobe, the others pass.
- contact kept: thin plates under two cells are not on the grid at all; a hand that passes a plate in a tick is missed
  by all.

Measured on the suites `thesis` and `solids`, grids with 100 nodes along the longest side:

- continuous contact: `tracked` passes 30 of 42, with all five sweeps along the Cassinian, down to 45 mm. At convex
  edges of solids it is let go of in time, and passes: wrong, since there q is off the face before s has turned. It
  fails in notches, 1 to 5 mm, where s chatters between two faces, and in lobes, 11 mm. On the grid 14 of 41, and 9 for
  the other two laws: steps of 0.07 to 3 mm are those of the normal from cell to cell, which the declared cell does not
  excuse as continuous.
- contact normal force: `tracked` 33 of 39, 48 degrees in the star's notch for the same chatter; on the grid 29 of 37.
- broken contact: wrong for `tracked`, seven of nine pass, and the two thin wedges miss by 0.2 mm; the others fail.
- abrupt switch, impulsive collision, centripetal force: fail, as predicted.
- force magnitude: as predicted; `gradient` is up to 0.5 off at the star's tip, its slope on the axis, and to 1.0 at a
  vertex of the cube.
- passivity: the pair comes out: `normal` gives the hand 0.7, 0.2 and 11.5 mJ in the loops of Cassinian, ellipse and
  star, and `gradient` nothing. `tracked` gives nothing.
- contact kept: the plate is missed by all, 19 mm; `tracked` also lets go in the niche of three faces, for a tick.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from hapticeval.errors import InputError, RefusalError
from hapticeval.geometry.boundary import Boundary
from hapticeval.geometry.representations import MARGIN_CELLS
from hapticeval.renderer import Declaration, Response, Spring
from hapticeval.renderers.law_renderer import checked_hand
from hapticeval.renderers.projective import once
from hapticeval.types import Array

if TYPE_CHECKING:
    from hapticeval.scene import Scene


BATCH = 65_536
"""Nodes whose distance is asked for at once."""


class DistanceGrid:
    """phi(p) and its gradient, exact for the multilinear interpolant of the nodes: `cell` (m) is a.

    Between nodes phi is off by O(a^2) where the distance is smooth, and by O(a) at its medial axis, which is smeared
    over a cell. Beyond the grid is free space. Raises `InputError` for fewer than eight nodes along the longest side,
    and `RefusalError` for an unbounded model.
    """

    def __init__(self, boundary: Boundary, nodes: int) -> None:
        if nodes < 8:
            raise InputError(f"a grid of {nodes} nodes", why="it needs an inside and a margin", todo="give 8 or more")
        if not boundary.closed:
            raise RefusalError(
                f"model '{boundary.name}' is unbounded", why="a grid covers a bounded area", todo="use implicit@exact"
            )
        low, high = np.reshape(boundary.bounds, (2, boundary.dimension))
        self.cell = float((high - low).max()) / (nodes - 1 - 2 * MARGIN_CELLS)
        counts = np.ceil((high - low) / self.cell).astype(np.int64) + 1 + 2 * MARGIN_CELLS
        # the middle of the grid is the model's, so that a mirrored model has a mirrored grid
        self.origin = 0.5 * (low + high) - 0.5 * self.cell * (counts - 1)
        axes = [start + self.cell * np.arange(count) for start, count in zip(self.origin, counts, strict=True)]
        points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, boundary.dimension)
        parts = [boundary.signed_distance(points[start : start + BATCH]) for start in range(0, len(points), BATCH)]
        self.values, self._last = np.concatenate(parts).reshape(counts), counts - 1

    def __call__(self, point: Array) -> tuple[float, Array]:
        """Return phi (m) and grad phi (N,) at a point (N,), m."""
        place = (np.asarray(point, dtype=np.float64) - self.origin) / self.cell
        inside = np.minimum(np.maximum(place, 0.0), self._last)
        first = np.minimum(inside.astype(np.int64), self._last - 1)
        around = self.values[tuple(slice(start, start + 2) for start in first.tolist())]
        value, slopes = _between(around.tolist(), (inside - first).tolist())
        # off the grid the nearest value, and as far beyond it as the point is
        off = place - inside
        off_distance = math.sqrt(off @ off)
        if off_distance > 0.0:
            return value + self.cell * off_distance, off / off_distance
        return value, np.array(slopes) / self.cell


def _between(nodes: Any, shares: Sequence[float]) -> tuple[float, list[float]]:
    """Return the multilinear interpolant of the nodes (2, ..., 2) of a cell, and its slopes along the axes a cell."""
    if not shares:
        return nodes, []
    share, others = shares[0], shares[1:]
    (low, low_slopes), (high, high_slopes) = _between(nodes[0], others), _between(nodes[1], others)
    slopes = [one + share * (two - one) for one, two in zip(low_slopes, high_slopes, strict=True)]
    return low + share * (high - low), [high - low, *slopes]


GRID = "grid"
TRACKED, GRADIENT_FORCE = "tracked", "gradient"
TURNS, RETURNS, ENTRY_HALVINGS = 4, 4, 40
"""Tangent planes a tick, steps back to the surface on each, and halvings of the way in to the first contact."""


class Implicit(Protocol):
    """S(p) (m) and its gradient (N,) at a point (N,)."""

    def __call__(self, point: Array) -> tuple[float, Array]:
        """Return both."""


class ExactDistance:
    """The signed distance of a boundary, whose gradient is the way from the nearest point."""

    def __init__(self, boundary: Boundary) -> None:
        self.boundary = boundary

    def __call__(self, point: Array) -> tuple[float, Array]:
        """Return S (m) and grad S (N,)."""
        near = self.boundary.closest_point(point[np.newaxis])
        distance, normal = float(near.distance[0]), near.normal[0]
        off = point - near.foot[0]
        # off an edge the gradient is the way there; on the surface the normal
        return distance, off / distance if abs(distance) > 1e-12 * (1.0 + float(np.abs(point).max())) else normal


def implicit(scene: Scene, *, regulation: str, representation: str, grid: float) -> Tracked | Field:
    """Return the renderer: `grid` is how many nodes the sampled distance has along the model's longest side."""
    surface: Implicit = ExactDistance(scene.model.boundary)
    cell = 0.0
    if representation == GRID:
        surface = once(scene.model, ("distance grid", grid), lambda: DistanceGrid(scene.model.boundary, int(grid)))
        cell = surface.cell
    if regulation == TRACKED:
        return Tracked(scene, surface, cell)
    return Field(scene, surface, cell, regulation == GRADIENT_FORCE)


class Tracked:
    """A contact point that is led over tangent planes: steps 1 to 4."""

    declares = Declaration(spring=Spring.ERROR)

    def __init__(self, scene: Scene, surface: Implicit, cell: float) -> None:
        self.surface_function, self.stiffness, self.resolution, self.standoff = surface, scene.stiffness, cell, cell
        self.grain = 1e-9 * scene.model.size

    def reset(self, hip: Array) -> None:
        """Start a run with the hand at `hip` (N,), m: inside, s is found from there along the gradient."""
        self._hand = checked_hand(hip).copy()
        value, _ = self.surface_function(self._hand)
        self._point: Array | None = self._back(self._hand) if value < 0.0 else None

    def _back(self, point: Array) -> Array:
        """Return the point (N,) led to S = 0: p <- p - S grad S / |grad S|^2."""
        for _ in range(RETURNS):
            value, gradient = self.surface_function(point)
            if abs(value) <= self.grain:
                break
            point = point - value / max(float(gradient @ gradient), 1e-6) * gradient
        return point

    def _met(self, hip: Array) -> Array:
        """Return where S = 0 on the way of the hand from the last tick, which ends inside: by bisection."""
        outside, inside = self._hand, hip
        for _ in range(ENTRY_HALVINGS):
            middle = 0.5 * (outside + inside)
            outside, inside = (outside, middle) if self.surface_function(middle)[0] <= 0.0 else (middle, inside)
        return outside

    def step(self, hip: Array, velocity: Array, dt: float) -> Response:  # noqa: ARG002 - the protocol's
        """One tick: `hip` (N,), m; IHIP (N,), m, and force (N,), N."""
        hip = checked_hand(hip).copy()
        point = self._point
        if point is None and self.surface_function(hip)[0] <= 0.0:
            point = self._met(hip)
        self._hand = hip
        for _ in range(TURNS):
            if point is None:
                break
            gradient = self.surface_function(point)[1]
            normal = gradient / np.linalg.norm(gradient)
            above = float((hip - point) @ normal)
            # step 4: let go; else step 2 and 3, onto the tangent plane and back to the surface
            point = None if above > 0.0 else self._back(hip - above * normal)
        self._point = point
        if point is None:
            return Response(hip, np.zeros_like(hip))
        return Response(point, self.stiffness * (point - hip))


class Field:
    """The force of the distance at the hand itself, along the unit normal, or of the energy K phi^2 / 2."""

    def __init__(self, scene: Scene, surface: Implicit, cell: float, energy: bool) -> None:
        self.surface_function, self.stiffness, self.resolution, self.standoff = surface, scene.stiffness, cell, cell
        self.energy = energy
        self.declares = Declaration(spring=None if energy else Spring.ERROR, memoryless=True)

    def reset(self, hip: Array) -> None:
        """Start a run with the hand at `hip` (N,), m: there is nothing to remember."""
        checked_hand(hip)

    def step(self, hip: Array, velocity: Array, dt: float) -> Response:  # noqa: ARG002 - the protocol's
        """One tick: `hip` (N,), m; IHIP (N,), m, and force (N,), N."""
        hip = checked_hand(hip)
        value, gradient = self.surface_function(hip)
        if value >= 0.0:
            return Response(hip, np.zeros_like(hip))
        normal = gradient / max(float(np.linalg.norm(gradient)), 1e-12)
        ihip = hip - value * normal
        return Response(ihip, -self.stiffness * value * gradient if self.energy else self.stiffness * (ihip - hip))
