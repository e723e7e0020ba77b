"""How far a renderer's answers are from a reference's: IHIP, direction of the force, and the force itself.

All renderers are asked at the same hand positions, which follow from the geometry alone. The reference is the
renderer's own projection computed another way, else on the exact curve, or else its finest setting, as far as these
have converged.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path as FilePath
from typing import Any, cast

import numpy as np

from hapticeval.discovery import own_renderers, resolve
from hapticeval.errors import HapticevalError, InputError, RefusalError
from hapticeval.geometry.boundary import Boundary
from hapticeval.geometry.catalogue import make_model
from hapticeval.geometry.mesh import Mesh
from hapticeval.geometry.model import Model
from hapticeval.geometry.representations import triangulate_surface
from hapticeval.phenomena.decisions import LAG_TICKS
from hapticeval.phenomena.sampling import force_floor
from hapticeval.renderer import Knob, Renderer, RendererFactory, Settings, choices_of, configured
from hapticeval.scene import Scene
from hapticeval.simulation.checked_calls import reset_checked, step_checked
from hapticeval.simulation.playback import play
from hapticeval.stimulus.experiments import build_path
from hapticeval.stimulus.stimulus import Path
from hapticeval.study.bench.document import Errors
from hapticeval.study.projection_field.field import sample_projection, singular_geometry, singular_set
from hapticeval.types import Array

MODEL_SIZE = 0.2
CLEARANCE = 2e-3  # distance (m) of the points from discontinuities
JUMP_CELLS = 100  # lattice steps in which these are looked for
SLIDE_SECONDS = 2.0
REFERENCE_AGREEMENT = 10.0  # refinements of the reference must agree to the tenth of an error for it to be believed
LEAST_ERROR_SHARE = 1e-10  # errors below this share of a model's size are rounding, or of `fresh_scene`
SLOWEST_GAIN, SECOND_ORDER_GAIN = 0.1, 3.0  # r - 1 of refinements by two: believed at the least, and h^2
STATISTICS = ("rms", "p99", "max")

PLANE_PATHS: Mapping[str, Mapping[str, Any]] = {
    "cassinian": {"kind": "scaled", "depth": 0.004, "from_angle": -45, "to_angle": 45},
    "star": {"kind": "corner", "corner": 1, "depth": 0.004, "before": 0.030, "after": 0.030},
}
"""The plane models, and the path that the hand slides along: a lobe of the Cassinian, a notch of the star."""

SPACE_MODELS = ("sphere", "torus")
"""The models in space: renderers are given meshes of them, and errors count from the smooth surface."""

DEEPEST_HAND = 0.010
"""Depth (m) of a hand in space: 10 N at 1 kN/m. No common desktop device pushes back with more."""

SLIDE_DEPTH = 0.004
"""Depth (m) at which the hand slides under a surface."""


@dataclass(frozen=True, eq=False)
class Workload:
    """Hand positions on one model: `points` (n, N), m, each a run of its own, and the path `slide`."""

    name: str
    scene: Scene
    points: Array
    slide: Path

    @property
    def dt(self) -> float:
        """Sampling time (s)."""
        return self.scene.sampling_time


def workload(kind: str, *, points: int, seed: int) -> Workload:
    """Make the workload of a model, of so many points: see `interior_points`, and in space `points_under`."""
    scene = fresh_scene(kind, 0)
    boundary = scene.model.boundary
    if kind in PLANE_PATHS:
        # Single points anywhere inside, for accuracy, and a path for the time: times need a hand that moves.
        at = interior_points(scene.model, points, seed=seed)
        table = {**PLANE_PATHS[kind], "duration": SLIDE_SECONDS}
    else:
        at = points_under(boundary, points, seed=seed)
        table = {"kind": "points", "points": path_under(boundary).tolist(), "duration": SLIDE_SECONDS}
    return Workload(kind, scene, at, build_path(table, boundary, FilePath()))


def fresh_scene(kind: str, number: int) -> Scene:
    """Make a scene with a model of its own, that no renderer has prepared for, not even one that compares by value.

    Model number n is n parts in 1e12 larger than the others.
    """
    # 1e-12 of 0.2 m is far below every error that is measured, and enough for another hash.
    grown = 1.0 + 1e-12 * number
    sizes = {"major": 0.07 * grown, "minor": 0.03 * grown} if kind == "torus" else {"size": MODEL_SIZE * grown}
    return Scene(model=make_model(kind, **sizes))


def with_mesh(scene: Scene, finer: float) -> Scene:
    """Return the scene with a mesh of its model, `finer` than the coarsest: see `triangulate_surface`."""
    model = scene.model
    mesh = Mesh(model.name, *triangulate_surface(model.surface, finer))
    return replace(scene, model=Model(model.name, model.parameters, mesh))


def points_under(boundary: Boundary, count: int, *, seed: int) -> Array:
    """Draw `count` points evenly in the layer of 10 mm under a surface in space, (count, 3), m."""
    low, high = np.reshape(boundary.bounds, (2, 3))
    random = np.random.default_rng(seed)
    points = np.empty((0, 3))
    while points.shape[0] < count:
        drawn = random.uniform(low, high, (4 * count, 3))
        # Rejection: uniform in the box, kept in the layer 0 < depth < 10 mm.
        depth = -boundary.signed_distance(drawn)
        points = np.vstack([points, drawn[(depth > 0.0) & (depth < DEEPEST_HAND)]])
    return np.ascontiguousarray(points[:count])


def path_under(boundary: Boundary) -> Array:
    """Return a path of points (n, 3), m, 4 mm under a surface, below a straight line beside it, askew to all axes."""
    reach = np.array(boundary.bounds[3:])
    # A line on which one coordinate stays at 1.2 of the reach: it passes beside the model.
    along = np.linspace(-0.5, 0.5, 41)[:, np.newaxis]
    at = boundary.closest_point(reach * (np.array([0.3, 0.5, 1.2]) + along * np.array([1.0, 0.5, 0.0])))
    # x = foot - depth n: straight under the closest point of each.
    return np.asarray(at.foot - SLIDE_DEPTH * at.normal)


def interior_points(model: Model, count: int, *, seed: int) -> Array:
    """Draw `count` points inside a closed model, (count, 2), m, where a renderer's error means something.

    No discontinuity of the exact nearest point is within 2 mm.
    """
    import shapely

    curve = model.curve

    def nearest(points: Array) -> Array:
        """Return the points of the curve nearest to `points` (n, 2), (n, 2), m."""
        return curve.position(curve.nearest(points))

    # Beside a jump of the exact projection a small error of a renderer picks the other side, and counts as a large one.
    jumps = singular_geometry(singular_set(nearest, sample_projection(nearest, curve, cells=JUMP_CELLS)))
    xmin, ymin, xmax, ymax = curve.bounds
    random = np.random.default_rng(seed)
    points = np.empty((0, 2))
    while points.shape[0] < count:
        drawn = random.uniform((xmin, ymin), (xmax, ymax), (2 * count, 2))
        # Two rejections: outside the model, then within 2 mm of a jump.
        drawn = drawn[curve.contains(drawn)]
        points = np.vstack([points, drawn[~shapely.dwithin(jumps, shapely.points(drawn), CLEARANCE)]])
    return np.ascontiguousarray(points[:count])


@dataclass(frozen=True, eq=False)
class Answers:
    """A renderer's IHIPs (n, N), m, and forces (n, N), N: for each point of a workload, then along its slide."""

    ihip: Array
    force: Array


def answers_to(renderer: Renderer, work: Workload) -> Answers:
    """Return a renderer's answers to a workload; every point is a run of its own, for a renderer may have memory.

    The hand rests at the point for as long as an answer may be late, and the last answer counts: a proxy gets there.

    Raises `RendererError` as `playback.play` does.
    """
    ihips, forces = np.empty_like(work.points), np.empty_like(work.points)
    still = np.zeros(work.points.shape[1])
    for row, hip in enumerate(work.points):
        reset_checked(renderer, hip)
        # At rest a proxy that lags gets there; the last of these answers is the one that stays.
        for _ in range(LAG_TICKS + 1):
            ihips[row], forces[row] = step_checked(renderer, row, hip, still, work.dt)
    slid = play(renderer, work.slide, work.dt)
    return Answers(np.vstack([ihips, slid.ihip]), np.vstack([forces, slid.force]))


def errors_against(measured: Answers, reference: Answers, *, floor: float) -> Errors:
    """Return how far answers are from a reference's: root mean square, 99 per cent quantile and maximum by metric.

    Where one tool is free its IHIP is at the hand, and counts there. Directions are compared where both forces exceed
    the `floor`, N.
    """
    # Directions of a force that is close to zero are noise: both must exceed the floor.
    size, reference_size = (np.linalg.norm(answers.force, axis=1) for answers in (measured, reference))
    pressed = np.minimum(size, reference_size) > floor
    a, b = (
        # Padded to 3D with zeros, so that one cross product serves plane and space.
        np.pad(answers.force[pressed], ((0, 0), (0, 3 - answers.force.shape[1])))
        for answers in (measured, reference)
    )
    # atan2(|a x b|, a . b) is exact for small angles, where the arc cosine loses half the digits.
    angle = np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), np.sum(a * b, axis=1)))
    return {
        "ihip": _summary(np.linalg.norm(measured.ihip - reference.ihip, axis=1)),
        "normal": _summary(angle),
        "force": _summary(np.linalg.norm(measured.force - reference.force, axis=1)),
    }


def worst_place(measured: Answers, reference: Answers, work: Workload) -> Array:
    """Return the HIP (N,), m, of a workload at which a renderer's IHIP is farthest from the reference's."""
    # As `answers_to` asks: the points, then the slide.
    hips = np.vstack([work.points, work.slide.sampled(work.dt)[1]])
    return cast("Array", hips[np.argmax(np.linalg.norm(measured.ihip - reference.ihip, axis=1))])


def _summary(values: Array) -> dict[str, float]:
    if values.size == 0:
        # No pair of forces to compare: no error in direction.
        return dict.fromkeys(STATISTICS, 0.0)
    return {
        "rms": float(np.sqrt(np.mean(values**2))),
        "p99": float(np.quantile(values, 0.99)),
        "max": float(np.max(values)),
    }


@dataclass(frozen=True, eq=False)
class Reference:
    """The answers that errors count from; `disagreement` is how far they may be off, None if exact.

    That is how far the last refinement moved them, or where they are `extrapolated` what that leaves by Richardson.

    `what` says what it is to the renderer that is measured, `source` names it for all: renderers of one source share a
    reference.
    """

    what: str
    source: str
    answers: Answers
    disagreement: Errors | None
    extrapolated: bool = False

    def claims(self, measured: Errors) -> Errors:
        """Return the errors that can be claimed: none smaller than ten times the reference's own disagreement."""
        if self.disagreement is None:
            return measured
        return {
            # What is below ten times the reference's own error cannot be told from it.
            metric: {
                statistic: max(value[statistic], REFERENCE_AGREEMENT * self.disagreement[metric][statistic])
                for statistic in STATISTICS
            }
            for metric, value in measured.items()
        }

    def proves(self, measured: Errors) -> bool:
        """Return whether the reference has converged to a tenth of the IHIP errors found."""
        return self.disagreement is None or all(
            measured["ihip"][statistic] >= REFERENCE_AGREEMENT * self.disagreement["ihip"][statistic]
            for statistic in STATISTICS
        )


def on_the_exact_curve(factory: RendererFactory) -> RendererFactory:
    """Return the same renderer on the exact curve, where it has a choice of representations; else itself."""
    choices = choices_of(factory)
    if choices.variant is None or "curve" not in (choices.representations or ()):
        return factory
    return choices.variant(representation="curve")


def equal_by_value(one: Any, other: Any) -> bool:
    """Return whether two factories are one, or equal by value: they share a reference then."""
    return bool(one is other or (type(one) is type(other) and one == other))


def reference_of(name: str, factory: RendererFactory, work: Workload, *, quick: bool = False) -> Reference | None:
    """Build the reference of a renderer on a workload; None for one that has neither an exact form nor a knob.

    With knobs the finest setting is the reference, and the one before it shows how far that has converged: see
    `refinements`. Where the factory has a `reference` of its own that is asked, if it takes the model.
    """
    exact = on_the_exact_curve(factory)
    # Which renderer of ours that is, else its own name.
    own = next((own for own in own_renderers() if equal_by_value(on_the_exact_curve(resolve(own)), exact)), name)
    knobs = choices_of(exact).knobs
    if (independent := choices_of(exact).reference) is not None:
        with suppress(RefusalError):  # of a model that only the renderer itself takes
            return _independent_reference(independent, own, work, quick=quick)
    if not knobs:
        known = choices_of(exact).representation == "curve"
        if not known:
            return None
        return Reference("the exact curve", f"{own} on the exact curve", _answers_of_factory(exact, work), None)
    before, last = refinements(knobs, quick=quick)
    # The change from the last refinement but one to the last bounds the error that is left.
    coarse, fine = (_answers_of_factory(configured(exact, settings, name=name), work) for settings in (before, last))
    finest = ", ".join(f"{knob} {value:g}" for knob, value in last.items())
    return Reference(
        f"itself at {finest}",
        f"{own} at {finest}",
        fine,
        errors_against(coarse, fine, floor=force_floor(work.scene)),
    )


def _independent_reference(factory: RendererFactory, own: str, work: Workload, *, quick: bool) -> Reference:
    """Return the finest of three settings of a factory as the reference, with its error by Richardson."""
    ((name, knob),) = choices_of(factory).knobs.items()
    values = knob.quick if quick else knob.values
    coarse, middle, fine = (_answers_of_factory(configured(factory, {name: n}, name=own), work) for n in values)
    floor = force_floor(work.scene)
    before, last = errors_against(coarse, middle, floor=floor), errors_against(middle, fine, floor=floor)
    words = f"another computation with {values[-1]:g} {name}"
    return Reference(f"{own}, {words}", f"{own} by {words}", fine, _remaining_errors(before, last), extrapolated=True)


def _remaining_errors(before: Errors, last: Errors) -> Errors:
    """Return what refinements after the last one would still move, if each moves the same share of the one before.

    last (1 / r + 1 / r^2 + ...) = last / (r - 1), with r = before / last: between slow, and of second order.
    """
    return {
        metric: {
            name: value / min(max(before[metric][name] / max(value, 1e-300) - 1.0, SLOWEST_GAIN), SECOND_ORDER_GAIN)
            for name, value in last[metric].items()
        }
        for metric in last
    }


def nearest_of_ours(measured: Answers, work: Workload, *, quick: bool = False) -> Reference | None:
    """Return the reference of that renderer of ours whose IHIPs on the exact curve are the nearest.

    For a renderer with neither an exact form nor a knob: most approximate a projection that one of ours computes.
    None where none of ours has an exact form on the model.
    """
    known = {}
    for name in own_renderers():
        exact = on_the_exact_curve(resolve(name))
        choices = choices_of(exact)
        if choices.representation == "curve" and not choices.knobs:
            with suppress(HapticevalError):
                known[name] = _answers_of_factory(exact, work)
    if not known:
        return None

    # The 99 per cent quantile: one point on the other side of a jump does not decide. Where two are alike in that but
    # for rounding, as two that part only where one has memory, the mean does.
    def ihip_error(name: str) -> tuple[float, float]:
        error = errors_against(measured, known[name], floor=force_floor(work.scene))["ihip"]
        return float(f"{error['p99']:.6g}"), error["rms"]

    nearest = min(known, key=ihip_error)
    reference = reference_of(nearest, resolve(nearest), work, quick=quick)
    assert reference is not None, "it has an exact form"
    return replace(reference, what=f"{reference.source}, of ours the nearest to it")


def refinements(knobs: Mapping[str, Knob], *, quick: bool = False) -> tuple[Settings, Settings]:
    """Return the finest settings of all knobs together, and before them the settings one step coarser.

    A quick sweep needs no finer reference than the value after its own last one. Raises `InputError` for a knob with
    one value only: nothing shows then whether it has converged.
    """
    chosen = {}
    for name, knob in knobs.items():
        # Coarse to fine, without doubles: `finest` may repeat the end of `values`.
        values = tuple(dict.fromkeys((*knob.values, *knob.finest)))
        if len(values) < 2:
            raise InputError(
                f"the knob '{name}' has one value only",
                why="a reference without an exact form needs a second, coarser one to show that it has converged",
                todo="give the knob at least two values",
            )
        # Quick: one refinement finer than the finest that is swept; else the finest of all.
        last = max(values.index(knob.quick[-1]) + 1, 1) if quick and knob.quick else -1
        chosen[name] = values[: last + 1][-2:] if 0 < last < len(values) else values[-2:]
    return {name: pair[0] for name, pair in chosen.items()}, {name: pair[1] for name, pair in chosen.items()}


def _answers_of_factory(factory: Callable[..., object], work: Workload) -> Answers:
    return answers_to(cast("Renderer", factory(work.scene)), work)
