"""A renderer's projection as a function of the HIP: for one with memory, from a given place of the tool."""

from __future__ import annotations

import numpy as np

from hapticeval.errors import InputError
from hapticeval.geometry.curve import Curve
from hapticeval.playback import ask, play, start
from hapticeval.renderer import Batch, Renderer
from hapticeval.stimulus import Path
from hapticeval.types import Array

TRIES = 64
INSIDE = 1e-6
"""How far under the surface the hand starts a contact, as a share of the model's size."""


class Projector:
    """HIPs (n, 2) to IHIPs (n, 2), m, each as if it were the next tick; in free space the IHIP is the HIP.

    With `origin` (2,), m, every HIP is reached in one tick from a hand that rests there, just under the surface, so
    that the tool is there too. Raises `RendererError` as `playback.play` does.
    """

    def __init__(self, renderer: Renderer, *, dt: float, origin: Array | None = None) -> None:
        self._renderer = renderer
        self._dt = dt
        self._origin = origin

    def __call__(self, hips: Array) -> Array:
        """The IHIPs."""
        if self._origin is None and isinstance(self._renderer, Batch) and len(hips) > 1:
            time = self._dt * np.arange(len(hips), dtype=np.float64)
            return play(self._renderer, Path(time, hips), self._dt).ihip
        ihips = np.empty_like(hips)
        still = np.zeros(hips.shape[1])
        for row, hip in enumerate(hips):
            start(self._renderer, hip if self._origin is None else self._origin)
            ihips[row], _ = ask(self._renderer, row, hip, still, self._dt)
        return ihips


def surface_of(renderer: object, curve: Curve) -> Curve:
    """The curve that a renderer really renders: its own where it has one, else the model's."""
    surface = getattr(renderer, "surface", curve)
    return surface if isinstance(surface, Curve) else curve


def under(surface: Curve, at: Array) -> Array:
    """The point just under the surface that is nearest to `at` (2,), m."""
    xmin, ymin, xmax, ymax = surface.bounds
    u = surface.nearest(at[np.newaxis])
    inward: Array = (surface.position(u) - INSIDE * max(xmax - xmin, ymax - ymin) * surface.normal(u))[0]
    return inward


def has_memory(renderer: Renderer, surface: Curve, *, dt: float) -> bool:
    """Whether the answer to a HIP depends on where the hand was before: tried from two places, seeded."""
    xmin, ymin, xmax, ymax = surface.bounds
    drawn = np.random.default_rng(0).uniform((xmin, ymin), (xmax, ymax), (8 * TRIES, 2))
    hips = drawn[surface.contains(drawn)][:TRIES]
    start_u, end_u = surface.u_range
    places = [under(surface, surface.position(start_u + share * (end_u - start_u))) for share in (0.137, 0.629)]
    one, other = (Projector(renderer, dt=dt, origin=place)(hips) for place in places)
    return bool(np.max(np.abs(one - other), initial=0.0) > 1e-9 * (xmax - xmin))


def projector(renderer: Renderer, surface: Curve, *, dt: float, origin: Array | None) -> Projector:
    """The projection of a renderer, from `origin` (2,), m, if it has memory.

    Raises `InputError` for a renderer with memory and no origin, and for an origin where there is no memory.
    """
    remembers = has_memory(renderer, surface, dt=dt)
    if remembers and origin is None:
        raise InputError(
            "the renderer remembers where its tool was",
            why="its projection field is another one for every previous IHIP (thesis 4.1.3)",
            todo="say where the tool is with --from X,Y or --s ARC, in metres",
        )
    if origin is not None and not remembers:
        raise InputError(
            "the renderer has no memory",
            why="its field is the same wherever the tool was",
            todo="leave --from and --s out",
        )
    return Projector(renderer, dt=dt, origin=None if origin is None else under(surface, origin))
