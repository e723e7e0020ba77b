"""The hand positions at which every setting is measured: the same for all renderers, from the geometry alone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from hapticeval.fields.field import geometry
from hapticeval.fields.lattice import sampled
from hapticeval.fields.singular import singular_set
from hapticeval.geometry.catalogue import make_model
from hapticeval.geometry.model import Model
from hapticeval.scene import Scene
from hapticeval.stimulus import Path
from hapticeval.trajectories import build_path
from hapticeval.types import Array

POINTS = 1000
SIZE = 0.2
AWAY = 2e-3
"""Distance (m) of the points from discontinuities."""

CELLS = 100
"""Lattice steps in which these are looked for."""

SLIDE_SECONDS = 2.0

MODELS: Mapping[str, Mapping[str, Any]] = {
    "cassinian": {"kind": "scaled", "depth": 0.004, "from_angle": -45, "to_angle": 45},
    "star": {"kind": "corner", "corner": 1, "depth": 0.004, "before": 0.030, "after": 0.030},
}
"""What is benched on, with the path that the hand slides along: a lobe of the Cassinian, a notch of the star."""


@dataclass(frozen=True, eq=False)
class Workload:
    """A model's scene, `points` (n, 2), m, that the hand is put to one by one, and the `slide` it is led along."""

    name: str
    scene: Scene
    points: Array
    slide: Path

    @property
    def dt(self) -> float:
        """Sampling time (s)."""
        return self.scene.sampling_time


def workload(kind: str, *, seed: int) -> Workload:
    """The workload of a model of the catalogue.

    Its random points lie where a renderer's error means something: no discontinuity of the exact nearest point is
    within 2 mm.
    """
    scene = Scene(model=make_model(kind, size=SIZE))
    path = build_path({**MODELS[kind], "duration": SLIDE_SECONDS}, scene.model.curve, FilePath())
    return Workload(kind, scene, interior_points(scene.model, POINTS, seed=seed), path)


def fresh_scene(kind: str, number: int) -> Scene:
    """A scene of a model that nothing has been prepared for yet, not even for one that is equal to it.

    Model number n is n parts in 1e12 larger than the others: a renderer that keeps what it made of a model, by the
    model or by its values, builds anew.
    """
    return Scene(model=make_model(kind, size=SIZE * (1.0 + 1e-12 * number)))


def interior_points(model: Model, count: int, *, seed: int) -> Array:
    """`count` random points inside a closed model, away from discontinuities of the nearest point: (count, 2), m."""
    import shapely

    curve = model.curve

    def nearest(points: Array) -> Array:
        return curve.position(curve.nearest(points))

    jumps = geometry(singular_set(nearest, sampled(nearest, curve, cells=CELLS)))
    xmin, ymin, xmax, ymax = curve.bounds
    random = np.random.default_rng(seed)
    found = np.empty((0, 2))
    while found.shape[0] < count:
        drawn = random.uniform((xmin, ymin), (xmax, ymax), (2 * count, 2))
        drawn = drawn[curve.contains(drawn)]
        found = np.vstack([found, drawn[~shapely.dwithin(jumps, shapely.points(drawn), AWAY)]])
    return np.ascontiguousarray(found[:count])
