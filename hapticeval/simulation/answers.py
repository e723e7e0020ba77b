"""Effects of the surface, put on the answers of any renderer that does not show them by itself.

A scene without such effects keeps the renderer that its factory made. With them each answer goes through the changes
of the effects, in the order of the catalogue: the same compiled code from Python, along a path and in closed loop.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from hapticeval.effects.effect import Effect, Part, Stage
from hapticeval.errors import DomainError, RefusalError, in_m, renderer_errors
from hapticeval.geometry.boundary import Boundary
from hapticeval.renderer import (
    CompiledStep,
    RendererFactory,
    Response,
    WrappedRenderer,
    check_support,
    choices_of,
    wrapped,
)
from hapticeval.scene import Scene
from hapticeval.simulation.in_the_world import in_the_world
from hapticeval.types import Array

if TYPE_CHECKING:
    from hapticeval.laws import Change, Closest
    from hapticeval.recordings.channels import Signal
    from hapticeval.recordings.recording import Recording


def make_renderer(factory: RendererFactory, scene: Scene) -> WrappedRenderer:
    """Return the renderer that a factory makes for a scene, with the scene's effects; all are made and wrapped here.

    One of a body that moves is asked in the frame of the body: see `in_the_world`.

    Raises `RefusalError` where the scene asks for what neither factory nor renderer declares to support, and
    `RendererError` for what is no renderer.
    """
    declared = choices_of(factory).supports
    # What the factory declares refuses a scene before anything is built.
    if declared is not None:
        check_support(scene, declared)
    with renderer_errors("factory"):
        own_renderer = factory(scene)
    renderer = wrapped(own_renderer)
    # Only the renderer itself could say what it supports; where it says nothing, it supports no extra.
    if declared is None:
        check_support(scene, renderer.supports or frozenset())
    return with_effects(in_the_world(renderer, scene), scene)


def with_effects(renderer: WrappedRenderer, scene: Scene) -> WrappedRenderer:
    """Return a renderer that shows the surface effects of its scene: itself where there are none that it lacks.

    Raises `RefusalError` for a renderer that answers a stimulus whole: there is no answer to a tick to change.
    """
    supported = renderer.supports or frozenset()
    missing = [effect for effect in scene.effects if effect.stage is Stage.ANSWER and effect.kind not in supported]
    if not missing:
        return renderer
    if not renderer.steps:
        kinds = ", ".join(effect.kind for effect in missing)
        raise RefusalError(
            f"the scene calls for {kinds}",
            why="the renderer answers a stimulus whole and does not declare to support that",
            todo="choose a renderer that answers tick by tick; one of your own that shows it declares it in supports",
        )
    # before anything is compiled: a base that an effect cannot be put on is refused at once
    for effect in missing:
        effect.check_base(scene, partial(_answer_at_rest, renderer))
    affected = Affected(renderer, missing, scene)
    # What checks and loops ask of it is the renderer's own, but for its stiffness, which the effects change.
    promise = renderer.declares
    promise = None if promise is None else replace(promise, spring=None, stiffness_range=None)
    return replace(renderer, renderer=affected, declares=promise, law=affected.law)


REST_TICKS = 10
"""Ticks that a hand rests when a bare answer is asked for: more than any granted lag."""


def _answer_at_rest(renderer: WrappedRenderer, start: Array, hip: Array) -> tuple[Array, Array]:
    """Return the answer to a hand that comes from `start` (N,), m, and rests at `hip`: IHIP and force."""
    renderer.reset(start.copy())
    standstill, dt = np.zeros_like(hip), 1e-3
    # it comes from `start`, and a lagging proxy has caught up by the last tick
    for point in (start, *[hip] * REST_TICKS):
        ihip, force = renderer.step(point.copy(), standstill, dt)
    return np.array(ihip, dtype=np.float64), np.array(force, dtype=np.float64)


class Known:
    """A renderer whose answers are known: `ihips` (n, N), m, and `forces` (n, N), N, one after the other."""

    def __init__(self, ihips: Array, forces: Array) -> None:
        from hapticeval.laws import give_next, law_data

        self.law = CompiledStep(give_next, law_data(pieces=ihips, joins=forces, state=1), domain_exits={})
        self.ihips, self.forces = self.law.data.pieces, self.law.data.joins

    def reset(self, hip: Array) -> None:  # noqa: ARG002 - as every renderer
        """Start with the first answer, wherever the hand `hip` (N,), m, is."""
        self.law.data.state[0] = 0.0

    def step(self, hip: Array, velocity: Array, dt: float) -> Response:
        """Give the next answer, wherever `hip` (N,), m, is, whatever `velocity` (N,), m/s, and `dt` (s) are."""
        answer = Response(np.empty_like(hip), np.empty_like(hip))
        self.law.function(self.law.data, hip, velocity, velocity, dt, *answer)
        return answer


def put_on_answers(
    effect: Effect, scene: Scene, count: int
) -> Callable[[Array, Array, Array], tuple[Array, Array]]:  # fmt: skip
    """Return what an effect makes of so many answers without it, which a run has from its reset on.

    That is a function of HIPs and IHIPs, m, and forces, N, `(count, N)` each, that returns IHIPs and forces. It raises
    `DomainError` where the effect is not defined. Raises `RefusalError` for a scene that the effect does not fit.
    """
    from hapticeval.simulation.playback import answers_along

    known = Known(*np.empty((2, count, scene.model.dimension)))
    affected = wrapped(Affected(wrapped(known), (effect,), scene))

    def change(hips: Array, ihips: Array, forces: Array) -> tuple[Array, Array]:
        """Return IHIPs (n, N), m, and forces (n, N), N, with the effect, of a hand (n, N), m, and what they were."""
        known.ihips[:], known.forces[:] = ihips, forces
        answers = answers_along(affected, hips, scene.sampling_time)
        return answers.ihip, answers.force

    return change


class Affected:
    """A renderer with `effects` on its answers. `law` is its compiled step, where the renderer has one."""

    def __init__(self, renderer: WrappedRenderer, effects: Sequence[Effect], scene: Scene) -> None:
        from hapticeval.compiled import specialised
        from hapticeval.geometry.boundary import closest_of
        from hapticeval.laws import EXITS_PER_EFFECT, change_row

        self.base = renderer
        self.effects = tuple(effects)
        self.domain_exits = {
            EXITS_PER_EFFECT * k + number: words
            for k, effect in enumerate(effects, 1)
            for number, words in effect.domain_exits.items()
        }
        parts = [effect.change(scene) for effect in effects]
        boundary = scene.model.boundary
        self._compiled = closest_of(boundary) is not None
        self._initial_states = [part.state.copy() for part in parts]
        self._closest, self._changes = _compile_changes(parts, boundary)
        if self._compiled:
            # To look the types of nested arrays up takes a hundred times as long as a tick.
            row = np.empty(scene.model.dimension)
            self._change_row = specialised(change_row, self._changes, self._closest, row, row, 0.0, row, row)
        else:  # the boundary is in Python, and so is all that asks it
            self._change_row = getattr(change_row, "py_func", change_row)
        self.law = self._composed(renderer.law)
        self.contact: bool | None = None

    def reset(self, hip: Array) -> None:
        """Start a run with the hand at `hip` (N,), m: the effects begin as they were made."""
        for change, state in zip(self._changes, self._initial_states, strict=True):
            change.data.state[:] = state
        self.base.reset(hip.copy())

    def step(self, hip: Array, velocity: Array, dt: float) -> Response:
        """Answer one tick: `hip` (N,), m; `velocity` (N,), m/s; `dt`, s.

        Raises `DomainError` where an effect is not defined.
        """
        ihip, force = self._bare_step(hip, velocity, dt)
        self.contact = self.base.contact
        hip, velocity = (np.array(vector, dtype=np.float64) for vector in (hip, velocity))
        exit_number = self._change_row(self._changes, self._closest, hip, velocity, dt, ihip, force)
        if exit_number:
            words = self.domain_exits.get(exit_number, f"an effect's kernel returned {exit_number}")
            raise DomainError(f"{words}: {in_m(hip)}")
        return Response(ihip, force)

    def observe_force(self, push: Array) -> None:
        """Hand the hand's measured force (N,), N, on; asked where the base observes it."""
        self.base.observe_force(push)

    def diagnostics(self, recording: Recording) -> Mapping[str, tuple[Signal, Array]]:
        """Return the base's own channels of a run; asked where it has any."""
        return self.base.diagnostics(recording)

    def _bare_step(self, hip: Array, velocity: Array, dt: float) -> tuple[Array, Array]:
        """Return the bare answer, IHIP and force (N,), to a tick.

        It gets copies and gives some: what the renderer does to its arguments, and to its answers later, stays its own.
        """
        ihip, force = self.base.step(hip.copy(), velocity.copy(), dt)
        return np.array(ihip, dtype=np.float64), np.array(force, dtype=np.float64)

    def _composed(self, law: CompiledStep | None) -> CompiledStep | None:
        if law is None or not self._compiled:
            return None
        from hapticeval.laws import Composed, answer, law_value

        base = law_value(law.function, law.data)
        data: Any = Composed(base, law.data, self._changes, self._closest)
        return CompiledStep(answer, data, {**law.domain_exits, **self.domain_exits}, law.contact)


def _compile_changes(parts: Sequence[Part], boundary: Boundary) -> tuple[Closest, tuple[Change, ...]]:
    """Return the closest point and the changes as kernels take them; in Python where the boundary is in Python."""
    from hapticeval.compiled import as_python, compiled_on_demand, first_class
    from hapticeval.geometry.boundary import closest_in_python, closest_of
    from hapticeval.laws import CHANGE, CLOSEST, Change, ChangeData, Closest, law_data

    compiled_closest = closest_of(boundary)
    changes = []
    for part in parts:
        assert part.function is not None
        data = ChangeData(part.params, np.atleast_2d(part.samples), np.array(np.atleast_2d(part.state), order="C"))
        function: Any = (
            as_python(part.function)
            if compiled_closest is None
            else first_class(compiled_on_demand(part.function), CHANGE)
        )
        changes.append(Change(function, data))
    if compiled_closest is None:
        return Closest(closest_in_python(boundary), law_data()), tuple(changes)
    return Closest(first_class(compiled_closest.function, CLOSEST), compiled_closest.data), tuple(changes)
