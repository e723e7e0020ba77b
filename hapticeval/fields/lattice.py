"""The inside of a model sampled on a square lattice, and where its nodes are projected to."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from hapticeval.errors import InputError
from hapticeval.geometry.curve import Curve
from hapticeval.types import Array, BoolArray

Project: TypeAlias = Callable[[Array], Array]
"""HIPs (n, 2) to IHIPs (n, 2), m; out of contact the IHIP is the HIP."""

OFFSET = (0.3819660, 0.2763932)
"""Where in its cell the lattice starts, so that neither nodes nor lines lie on a model's axes of symmetry."""


@dataclass(frozen=True, eq=False)
class Lattice:
    """Nodes at x (nx,), y (ny,), m, a step `h` (m) apart; `held` (ny, nx) where the HIP is inside and in contact.

    `ihip` (ny, nx, 2), m, and its arc length `s` (ny, nx), m, on `surface` are NaN elsewhere; `inside` (ny, nx) is
    where the HIP is inside the surface, in contact or not.
    """

    surface: Curve
    x: Array
    y: Array
    h: float
    inside: BoolArray
    held: BoolArray
    ihip: Array
    s: Array

    @property
    def nodes(self) -> Array:
        """(ny, nx, 2), m."""
        return np.stack(np.meshgrid(self.x, self.y), axis=-1)

    @property
    def size(self) -> float:
        """The surface's largest extent (m)."""
        return extent(self.surface)


def extent(surface: Curve) -> float:
    """The largest extent (m) of a surface along x or y."""
    xmin, ymin, xmax, ymax = surface.bounds
    return max(xmax - xmin, ymax - ymin)


def sampled(project: Project, surface: Curve, *, cells: int) -> Lattice:
    """A lattice of `cells` steps along the longer side of a closed surface, projected.

    Raises `InputError` for an unbounded surface and for one in which no node is in contact.
    """
    if not surface.closed:
        raise InputError("a projection field needs a closed model", todo="choose another model than the line")
    xmin, ymin, xmax, ymax = surface.bounds
    h = extent(surface) / cells
    x = np.arange(xmin - (1.0 - OFFSET[0]) * h, xmax + h, h)
    y = np.arange(ymin - (1.0 - OFFSET[1]) * h, ymax + h, h)
    nodes = np.stack(np.meshgrid(x, y), axis=-1)
    inside = surface.contains(nodes.reshape(-1, 2)).reshape(nodes.shape[:2])
    ihip = np.full_like(nodes, np.nan)
    ihip[inside] = project(nodes[inside])
    held = inside & np.any(ihip != nodes, axis=-1)
    if not held.any():
        raise InputError("no hand inside the model is in contact", why="there is no projection to draw")
    ihip[~held] = np.nan
    s = np.full(inside.shape, np.nan)
    s[held] = arc_lengths(surface, ihip[held])
    return Lattice(surface, x, y, h, inside, held, ihip, s)


def arc_lengths(surface: Curve, ihips: Array) -> Array:
    """Where on the surface IHIPs (n, 2) are: (n,), m."""
    return surface.arc_length(surface.nearest(ihips))


def apart(s: Array, other: Array | float, length: float) -> Array:
    """The way along a closed surface from `other` to s, the shorter way round: between -length/2 and length/2."""
    way: Array = np.mod(s - other + 0.5 * length, length) - 0.5 * length
    return way
