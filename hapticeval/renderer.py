"""The renderer contract: what anything must offer to be run and judged. No base class to inherit."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, NamedTuple, Protocol, TypeAlias, runtime_checkable

from hapticeval.compiled import LawData
from hapticeval.effects.force_sensor import ForceSensor
from hapticeval.errors import RefusalError, RendererError, UnknownNameError, renderer_errors
from hapticeval.recordings.channels import Signal
from hapticeval.recordings.recording import Recording
from hapticeval.scene import PLANE, SPACE, Scene, requirements
from hapticeval.stimulus.stimulus import Stimulus
from hapticeval.types import Array


class Spring(StrEnum):
    """What a renderer's force is K_p times of, the scene's stiffness, where nothing damps it."""

    ERROR = "error"
    """F = -K_p e_p, with e_p = HIP - IHIP: a spring from the HIP to the IHIP, as pp of (4.8)."""
    NORMAL = "normal"
    """F = -K_p (n.e_p) n, with n the surface's normal: a spring across the surface, as transversal of (5.21)."""


@dataclass(frozen=True, kw_only=True)
class Declaration:
    """What a renderer promises of its answers, so that a check may hold it to that: its attribute `declares`.

    `spring` says that its force is proportional to a depth; a damper with the scene's K_d may add to it. After a
    `reset` the same way gives the same answers again, to the bit, or as far as `ihip_scatter` (m) and `force_scatter`
    (N) allow.
    """

    spring: Spring | None = None
    ihip_scatter: float = 0.0
    force_scatter: float = 0.0


class Response(NamedTuple):
    """A renderer's answer to one HIP: the IHIP (N,), m, and the force on the hand (N,), N."""

    ihip: Array
    force: Array


@runtime_checkable
class Renderer(Protocol):
    """Answers a HIP with an IHIP and a force, a tick at a time; made from a scene, by any callable that takes one.

    N is 2, or 3 where the model is a surface in space: `scene.model.boundary.frame(points)` works in both, and
    `scene.model.curve` refuses a surface. The force acts on the hand, and is zero in free space.

    A renderer may also have

    - `run(hips, dt) -> (ihips, forces)`: the whole trajectory at once, when that is faster;
    - `resolution` and `standoff` (m): how coarse its own representation of the model is, see `Recording`;
    - `surface`: the `Curve` that it really renders, where that is not the model's own;
    - `supports`: names of what it can beside a unilateral contact without viscosity, see `supported`; its factory may
      have that instead;
    - `declares`: the `Declaration` of what its answers keep to;
    - `law`, `feel` and `signals`: see `Compiled`, `Feeling` and `Explaining`.

    A step that is led out of where the renderer is defined raises `DomainError`, which ends an experiment there.
    """

    def reset(self, hip: Array) -> None:
        """Start a run with the hand at `hip` (N,).

        Along a path of a suite or of a recording the tool is free then, and with the hand: where the path begins inside
        a model that only pushes, the hand is led in from the nearest point of the surface, and what the renderer
        answers on that way is not recorded. Elsewhere (single points, a closed loop, hardware) the hand may start
        inside: put the tool to the nearest point of the surface.
        """

    def step(self, hip: Array, velocity: Array, dt: float) -> Response:
        """One tick: `hip` (N,), m; `velocity` (N,), m/s; `dt`, s. In free space the IHIP is the HIP."""


@runtime_checkable
class Batch(Renderer, Protocol):
    """A renderer that can take a whole trajectory at once: equal to a `reset` and then a `step` a row."""

    def run(self, hips: Array, dt: float) -> tuple[Array, Array]:
        """`hips` (n, N) to IHIPs (n, N) and forces (n, N)."""


@runtime_checkable
class SelfDriven(Protocol):
    """A renderer with tool physics of its own, which answers a stimulus whole instead of tick by tick.

    The ideal rigid contact is one: a rigid tool's position follows from forces, not from a sampled HIP. A `Renderer`
    that has an `answer` too is asked tick by tick.
    """

    def answer(self, stimulus: Stimulus, dt: float) -> Recording:
        """The whole run, sampled every `dt` seconds."""


class CompiledLaw(NamedTuple):
    """A renderer's step as compiled code, so that a whole closed loop runs without Python.

    `function` is a kernel of signature `hapticeval.compiled.LAW`, and `data` the renderer's own, with the state that
    its last `reset` or `step` left: a loop resets the renderer and goes on from there. `refusals` words what the
    kernel's numbers other than 0 mean. It must answer as `step` does, to the last bit.
    """

    function: Callable[..., Any]
    data: LawData
    refusals: Mapping[int, str]


@runtime_checkable
class Compiled(Protocol):
    """A renderer that offers its step as compiled code too; `law` is None where it cannot, in this scene."""

    @property
    def law(self) -> CompiledLaw | None:
        """The step for compiled loops."""


@runtime_checkable
class Feeling(Protocol):
    """A renderer that wants the hand's force, where the scene has a force sensor (8.6)."""

    def feel(self, push: Array) -> None:
        """Told before each step: the measured force of the hand on the tool (N,), N."""


@runtime_checkable
class Explaining(Protocol):
    """A renderer that can tell of a run what went on inside it: its own coordinates, the answers it did not use."""

    def signals(self, recording: Recording) -> Mapping[str, tuple[Signal, Array]]:
        """Name -> what it is, and its numbers a row of the recording: (n,) or (n, columns)."""


def stated(renderer: object, name: str, default: Any = None) -> Any:
    """Return what a renderer states of itself in an optional attribute, `default` where it has none.

    Raises `RendererError` where the attribute is a property that raises.
    """
    with renderer_errors(f"attribute '{name}'"):
        return getattr(renderer, name, default)


def supported(declaring: object) -> frozenset[str] | None:
    """The requirements that a renderer, or its factory, declares to support; None where it declares nothing.

    `declaring.supports` is a collection of names of `hapticeval.scene.requirements`. "plane" and "space" narrow the
    models: where neither is declared a renderer is given both kinds, and its own code refuses what it cannot take, as
    `scene.model.curve` does. A renderer that has `feel` supports "force-sensor" without declaring it.

    Raises `RendererError` for anything but a collection of strings, and `UnknownNameError`, with the closest names,
    for one that is no requirement.
    """
    names = stated(declaring, "supports")
    if isinstance(declaring, type) and not isinstance(names, Collection):
        return None  # a property of what the class makes
    feels = {ForceSensor.requirement} if isinstance(declaring, Feeling) else set()
    if names is None:
        return frozenset(feels) or None
    if isinstance(names, str) or not (isinstance(names, Collection) and all(isinstance(name, str) for name in names)):
        raise RendererError(
            f"the renderer declares supports = {names!r}",
            why="it is a collection of names",
            todo='write for instance supports = {"bilateral"}',
        )
    for name in names:
        if name not in requirements():
            raise UnknownNameError("requirement", name, requirements())
    return frozenset(names) | feels


def check_support(scene: Scene, supports: frozenset[str]) -> None:
    """Raise `RefusalError`, naming the requirements, where the scene asks for what is not among `supports`."""
    anywhere = supports.isdisjoint((PLANE, SPACE))
    lacking = {
        name: meaning
        for name, meaning in scene.requirements.items()
        if name not in supports and not (anywhere and name in (PLANE, SPACE))
    }
    if lacking:
        declared = ", ".join(name for name in requirements() if name in supports)
        raise RefusalError(
            "the scene asks for " + ", and for ".join(f"'{name}' ({meaning})" for name, meaning in lacking.items()),
            why="the renderer is for unilateral contact without viscosity"
            + (f", and declares support for {declared}" if declared else ", as it declares no more"),
            todo="choose another renderer or case; one of your own that can do it declares so: "
            f"supports = {{{', '.join(map(repr, lacking))}}}".replace("'", '"'),
        )


RendererFactory: TypeAlias = Callable[[Scene], Renderer | SelfDriven]
