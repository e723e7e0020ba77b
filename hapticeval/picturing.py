"""From the names that a user gives to a projection field and its document."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, cast

import numpy as np

from hapticeval.bench.settings import chosen_values
from hapticeval.discovery import resolve
from hapticeval.errors import InputError, UnknownNameError
from hapticeval.fields.field import Field, field_of
from hapticeval.fields.shallow import shallow_angles
from hapticeval.files import file_stem
from hapticeval.geometry.catalogue import MODELS, from_geojson, from_wkt, make_model
from hapticeval.geometry.model import Model
from hapticeval.judging import built
from hapticeval.knob import turned
from hapticeval.projecting import projector, surface_of
from hapticeval.renderer import Renderer, RendererFactory
from hapticeval.scene import Scene
from hapticeval.types import Array


def pictured(
    renderer: str,
    model: str,
    *,
    within: float,
    origin: str | None = None,
    arc: float | None = None,
    knobs: Sequence[str] = (),
    cells: int = 300,
) -> tuple[Field, dict[str, Any]]:
    """The field of a renderer on a model and its numbers as JSON values, with a `title` and a file `stem`.

    `within` (m) is the distance of the share near a discontinuity; `origin` ("X,Y") or `arc`, m, say where the tool of
    a renderer with memory was; `knobs` are as on the command line, with one value each. Raises `InputError` and
    `UnknownNameError` for what is not there or does not fit, and `RendererError` where the renderer breaks.
    """
    settings = {knob: values[0] for knob, values in chosen_values(knobs).items()}
    shape = model_named(model)
    scene = Scene(model=shape)
    made = built(cast("RendererFactory", turned(resolve(renderer), settings, name=renderer)), scene)
    if not isinstance(made, Renderer):
        raise InputError(
            f"'{renderer}' has no projection to draw", why="it answers a whole stimulus, not a HIP at a time"
        )
    surface = surface_of(made, shape.curve)
    start = _start(shape, origin, arc)
    at = None if start is None else surface.position(surface.nearest(start[np.newaxis]))[0]
    project = projector(made, surface, dt=scene.sampling_time, origin=at)
    found = field_of(project, surface, cells=cells, start=at)
    # From one previous IHIP the far side is out of reach, and its angles say nothing about the projection.
    shallow = shallow_angles(project, surface) if at is None else ()
    label = " ".join([renderer, *(f"{knob} {value:g}" for knob, value in settings.items())])
    told = "" if at is None else f", previous IHIP at ({1e3 * at[0]:.3g}, {1e3 * at[1]:.3g}) mm"
    name = Path(model).stem if Path(model).is_file() else model
    document = {
        "title": f"{label} on {name}{told}",
        "stem": "field-" + file_stem(re.sub(r"[ :=,@]+", "-", f"{label} {name}") + _tail(at)),
        "renderer": renderer,
        "settings": settings,
        "model": {"kind": shape.name, "parameters": dict(shape.parameters)},
        "memoryless": at is None,
        "shallow_angle_deg": [asdict(angles) for angles in shallow],
        **found.summary(within=within),
    }
    return found, document


def _tail(at: Array | None) -> str:
    return "" if at is None else f"-from-{1e3 * at[0]:.4g}-{1e3 * at[1]:.4g}mm"


def model_named(text: str) -> Model:
    """A model by `kind`, `kind:name=value,...`, or the name of a WKT or GeoJSON file.

    Raises `UnknownNameError` for a kind that there is none of and no such file, `InputError` for values that are no
    numbers, and as the catalogue does.
    """
    file = Path(text)
    if file.suffix in (".wkt", ".geojson", ".json") or file.is_file():
        try:
            content = file.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise InputError(f"cannot read the model file {file}", why=str(error)) from error
        return (from_wkt if file.suffix == ".wkt" else from_geojson)(content, name=file.stem)
    kind, _, rest = text.partition(":")
    drawable = {name for name in MODELS if name not in ("polygon", "wkt", "geojson")}
    if kind not in drawable:
        raise UnknownNameError("model", kind, drawable)
    parameters: dict[str, float] = {}
    for part in rest.split(",") if rest else []:
        name, equals, value = part.partition("=")
        try:
            parameters[name.strip()] = float(value)
        except ValueError:
            equals = ""
        if not equals:
            raise InputError(
                f"model '{text}': '{part}' is not name=number", todo="write for instance star:points=6,tip_angle=40"
            )
    return make_model(kind, **parameters)


def _start(model: Model, origin: str | None, arc: float | None) -> Array | None:
    if origin is not None and arc is not None:
        raise InputError("both --from and --s are given", why="both say where the tool was", todo="give one of them")
    if arc is not None:
        return model.curve.position(model.curve.parameter(arc))
    if origin is None:
        return None
    try:
        point = np.array([float(part) for part in origin.split(",")])
    except ValueError:
        point = np.empty(0)
    if point.shape != (2,) or not np.isfinite(point).all():
        raise InputError(f"--from {origin}", why="it is not two numbers", todo="write metres: --from 0.1,0")
    return point
