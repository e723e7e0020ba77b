"""The projection of a renderer as a function of the HIP, and the document of its field."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from hapticeval.discovery import resolve
from hapticeval.errors import InputError
from hapticeval.files import file_stem
from hapticeval.geometry.curve import Curve, as_curve
from hapticeval.geometry.model import Model
from hapticeval.renderer import Renderer, configured, wrapped
from hapticeval.scene import Scene
from hapticeval.simulation.answers import make_renderer
from hapticeval.simulation.checked_calls import reset_checked, step_checked
from hapticeval.simulation.playback import answers_along
from hapticeval.study.projection_field.field import Field, extent, field_of, shallow_angles
from hapticeval.types import Array

MEMORY_TRIALS = 64
START_DEPTH = 1e-6
"""Depth of a hand that starts a contact, as a share of the model's size."""


def study_field(
    renderer: str,
    model: Model,
    *,
    within: float,
    name: str | None = None,
    origin: Array | None = None,
    knobs: Mapping[str, float] | None = None,
    cells: int = 300,
) -> tuple[Field, dict[str, Any]]:
    """Find the projection field of a renderer, and its numbers as JSON values with a `title` and a file `stem`.

    - `within` (m): the distance of the share near a discontinuity;
    - `origin` (2,), m: for a renderer with memory, the point that its tool was nearest to;
    - `name`: the model's in title and stem, else its kind.

    Raises `InputError` and `UnknownNameError` for what does not exist or does not fit, and `RendererError` where the
    renderer breaks.
    """
    settings = dict(knobs or {})
    scene = Scene(model=model)
    built = make_renderer(configured(resolve(renderer), settings, name=renderer), scene)
    if not built.steps:
        raise InputError(
            f"'{renderer}' has no projection to draw", why="it answers a whole stimulus, not a HIP at a time"
        )
    surface = surface_of(built, model.curve)
    # The tool is on the surface: the nearest point of it stands for the given one.
    at = None if origin is None else surface.position(surface.nearest(origin[np.newaxis]))[0]
    project = make_projector(built, surface, dt=scene.sampling_time, origin=at)
    field = field_of(project, surface, cells=cells, start=at)
    # From one previous IHIP the far side is out of reach, and its angles are not those of the projection.
    shallow = shallow_angles(project, surface) if at is None else ()
    label = " ".join([renderer, *(f"{knob} {value:g}" for knob, value in settings.items())])
    model_name = name or model.name
    title, tail = f"{label} on {model_name}", ""
    if at is not None:
        title += f", previous IHIP at ({1e3 * at[0]:.3g}, {1e3 * at[1]:.3g}) mm"
        tail = f"-from-{1e3 * at[0]:.4g}-{1e3 * at[1]:.4g}mm"
    document = {
        "title": title,
        "stem": "field-" + file_stem(re.sub(r"[ :=,@]+", "-", f"{label} {model_name}") + tail),
        "renderer": renderer,
        "settings": settings,
        "model": {"kind": model.name, "parameters": dict(model.parameters)},
        "memoryless": at is None,
        "shallow_angle_deg": [asdict(angles) for angles in shallow],
        **field.summary(within=within),
    }
    return field, document


class Projector:
    """A renderer as a projection: HIPs (n, 2) to IHIPs (n, 2), m, each HIP as if it were the next tick.

    In free space the IHIP is the HIP. With `origin` (2,), m, every HIP is reached in one tick from a hand that rests
    there, just under the surface, so that the tool is there too. Raises `RendererError` as `playback.play` does.
    """

    def __init__(self, renderer: Renderer, *, dt: float, origin: Array | None = None) -> None:
        self._renderer = renderer
        self._dt = dt
        self._origin = origin

    def __call__(self, hips: Array) -> Array:
        """Return the IHIPs (n, 2), m, of HIPs (n, 2), m."""
        # All HIPs as one path: without memory the order does not matter.
        if self._origin is None:
            return answers_along(self._renderer, hips, self._dt).ihip if len(hips) else hips
        ihips = np.empty_like(hips)
        still = np.zeros(hips.shape[1])
        for row, hip in enumerate(hips):
            # With memory each HIP is the one tick after a rest at the origin.
            reset_checked(self._renderer, self._origin)
            ihips[row], _ = step_checked(self._renderer, row, hip, still, self._dt)
        return ihips


def surface_of(renderer: object, curve: Curve) -> Curve:
    """Return the curve that a renderer really renders: its own where it has one, else the model's."""
    surface = wrapped(renderer).surface
    return as_curve(surface) or curve


def point_under(surface: Curve, at: Array) -> Array:
    """Return the point (2,), m, just under the surface that is nearest to `at` (2,), m."""
    u = surface.nearest(at[np.newaxis])
    inward: Array = (surface.position(u) - START_DEPTH * extent(surface) * surface.normal(u))[0]
    return inward


def has_memory(renderer: Renderer, surface: Curve, *, dt: float) -> bool:
    """Return whether the answer to a HIP depends on where the hand was before, tried from two places, seeded."""
    xmin, ymin, xmax, ymax = surface.bounds
    drawn = np.random.default_rng(0).uniform((xmin, ymin), (xmax, ymax), (8 * MEMORY_TRIALS, 2))
    hips = drawn[surface.contains(drawn)][:MEMORY_TRIALS]
    start_u, end_u = surface.u_range
    # Two places well apart on the surface, on no axis of symmetry.
    places = [point_under(surface, surface.position(start_u + share * (end_u - start_u))) for share in (0.137, 0.629)]
    one, other = (Projector(renderer, dt=dt, origin=place)(hips) for place in places)
    # What is below 1e-9 of the model's width is rounding.
    return bool(np.max(np.abs(one - other), initial=0.0) > 1e-9 * (xmax - xmin))


def make_projector(renderer: Renderer, surface: Curve, *, dt: float, origin: Array | None) -> Projector:
    """Make the projection of a renderer, from `origin` (2,), m, if it has memory.

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
    return Projector(renderer, dt=dt, origin=None if origin is None else point_under(surface, origin))
