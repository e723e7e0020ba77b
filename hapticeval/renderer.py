"""The renderer contract: what anything must offer to be run and judged. No base class to inherit."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, TypeAlias, runtime_checkable

import numpy as np

from hapticeval.effects.catalogue import FORCE_SENSOR
from hapticeval.errors import InputError, RefusalError, RendererError, UnknownNameError, renderer_errors
from hapticeval.geometry.boundary import Boundary, is_boundary
from hapticeval.geometry.pose import Pose, resting_pose
from hapticeval.recordings.recording import Recording
from hapticeval.scene import MOVING, PLANE, SPACE, Scene, requirements
from hapticeval.stimulus.stimulus import Stimulus
from hapticeval.types import Array

if TYPE_CHECKING:
    from hapticeval.laws import LawData
    from hapticeval.recordings.channels import Signal


SOLVED_LAWS = ("pp", "pp-v", "pp-d", "pp-pd", "pp-pd-c", "set-stabilisation")
"""The laws that have closed forms, by the names of their regulation schemes; `pp-pd-c` adds m kappa w^2 to PP+PD."""


STIFFNESS_LIMITS = 1.0 / 32.0, 32.0
"""Shares of the scene's stiffness between which a declared range of stiffness has to lie.

*Chosen*: a force that goes with the root of the depth, or with its power 3/2, stays within them over three decades of
depth on either side of where it has the scene's stiffness, as from 1 um to 1 m about 1 mm: 1000^(1/2) = 32. Doubled,
these are 3.6 decades. Beyond, a range would ask nothing of the force."""

RANGE_WORDS = "with 1/32 <= least <= 1 <= largest <= 32: a wider range would ask nothing of the force"
"""What a range has to be, for messages."""


class Spring(StrEnum):
    """The kind of spring that a renderer's undamped force is, with the scene's stiffness K_p."""

    ERROR = "error"
    """F = -K_p e_p, with e_p = HIP - IHIP: a spring from the HIP to the IHIP, as pp of (4.8)."""
    NORMAL = "normal"
    """F = -K_p (n.e_p) n, with n the surface's normal: a spring across the surface, as transversal of (5.21)."""


@dataclass(frozen=True, kw_only=True)
class Declaration:
    """What a renderer promises of its answers, so that a check may hold it to that: its attribute `declares`.

    - `spring`: its force is proportional to a depth; a damper with the scene's K_d may add to it.
    - `stiffness_range`: where the stiffness varies with the place or the depth, its least and its largest, as shares of
      the scene's. One is between them, and both lie within `STIFFNESS_LIMITS`.
    - `force_resolution` (N): how coarse the force is, as of a quantum or a dead band.
    - `closed_form`: the law that it claims to be, one of `SOLVED_LAWS`. Where that has a closed form, a loop with the
      renderer in it has to move so, see the check `closed-form`.
    - `ihip_scatter` (m) and `force_scatter` (N): how far the answers to the same path may differ after a `reset`; zero
      is to the bit.
    - `force_only`: it has no contact point, as a potential field. Its IHIP is always the HIP, and checks of the contact
      point are not applicable.
    - `memoryless`: its IHIP depends on the HIP alone, as the nearest point does.
    - `smooth_only`: it is made for surfaces without corners.

    What a theorem denies to a renderer that declares such things does not stop a gate: see `phenomena.inherent`.
    """

    spring: Spring | None = None
    stiffness_range: tuple[float, float] | None = None
    force_resolution: float = 0.0
    closed_form: str | None = None
    ihip_scatter: float = 0.0
    force_scatter: float = 0.0
    force_only: bool = False
    memoryless: bool = False
    smooth_only: bool = False

    @property
    def faults(self) -> list[str]:
        """What is wrong with its values, each named: empty where all are of the types and in the ranges asked for."""
        # Declarations come from foreign code: no type is trusted.
        length = "must be a number that is finite and not negative"
        expected = {
            "spring": (self.spring in (None, *Spring), "is neither a Spring nor None"),
            "stiffness_range": (
                self.stiffness_range is None or _is_range(self.stiffness_range),
                f"is neither None nor (least, largest) as shares of the scene's stiffness, {RANGE_WORDS}",
            ),
            "force_resolution": (_is_length(self.force_resolution), length),
            "closed_form": (
                self.closed_form in (None, *SOLVED_LAWS),
                f"is neither None nor one of {', '.join(SOLVED_LAWS)}",
            ),
            "ihip_scatter": (_is_length(self.ihip_scatter), length),
            "force_scatter": (_is_length(self.force_scatter), length),
            "force_only": (isinstance(self.force_only, bool), "is neither True nor False"),
            "memoryless": (isinstance(self.memoryless, bool), "is neither True nor False"),
            "smooth_only": (isinstance(self.smooth_only, bool), "is neither True nor False"),
        }
        return [f"{name} = {getattr(self, name)!r} {wrong}" for name, (right, wrong) in expected.items() if not right]

    @property
    def meta(self) -> dict[str, Any]:
        """The declaration as metadata of a recording."""
        entries: dict[str, Any] = {} if self.spring is None else {"spring": Spring(self.spring).value}
        if self.stiffness_range is not None:
            smallest, largest = map(float, self.stiffness_range)
            entries |= {"stiffness_least": smallest, "stiffness_largest": largest}
        entries |= {"contact_point": "none"} if self.force_only else {}
        entries |= {} if self.closed_form is None else {"closed_form": self.closed_form}
        entries |= {"memory": "none"} if self.memoryless else {}
        entries |= {"surfaces": "smooth"} if self.smooth_only else {}
        scatters = {"ihip_scatter": float(self.ihip_scatter), "force_scatter": float(self.force_scatter)}
        return entries | {"force_resolution": float(self.force_resolution)} | scatters


def _is_number(value: object) -> bool:
    # bool is a subclass of int.
    return isinstance(value, int | float) and not isinstance(value, bool)


def _is_length(value: object) -> bool:
    return _is_number(value) and 0.0 <= value < math.inf  # type: ignore[operator]


def _is_range(shares: object) -> bool:
    """Return whether these are two shares of a stiffness, a least and a largest, with 1 between them, and no more."""
    return (
        isinstance(shares, Sequence)
        and len(shares) == 2
        and all(map(_is_number, shares))
        and STIFFNESS_LIMITS[0] <= shares[0] <= 1.0 <= shares[1] <= STIFFNESS_LIMITS[1]
    )


class Response(NamedTuple):
    """A renderer's answer to one HIP: the IHIP (N,), m, and the force on the hand (N,), N."""

    ihip: Array
    force: Array


@runtime_checkable
class Renderer(Protocol):
    """Answers a HIP with an IHIP and a force, a tick at a time; made from a scene, by any callable that takes one.

    N is 2, or 3 where the model is a surface in space: `scene.model.boundary.closest_point(points)` works in both, and
    `scene.model.curve` refuses a surface. The force acts on the hand, and is zero in free space.

    What it may offer beside is in `WrappedRenderer`. A step that is led out of where the renderer is defined raises
    `DomainError`, which ends the run there.
    """

    def reset(self, hip: Array) -> None:
        """Start a run with the hand at `hip` (N,).

        Along a path of a suite or of a recording the tool is free then, and with the hand. Where the path begins inside
        a model that only pushes, the hand is led in from the nearest point of the surface; those answers are not
        recorded.

        Elsewhere (single points, a closed loop, hardware) the hand may start inside: put the tool to the nearest point
        of the surface.
        """

    def step(self, hip: Array, velocity: Array, dt: float) -> Response:
        """Answer one tick: `hip` (N,), m; `velocity` (N,), m/s; `dt`, s. In free space the IHIP is the HIP."""


@runtime_checkable
class TrajectoryRenderer(Protocol):
    """A renderer with tool physics of its own, which answers a stimulus whole instead of tick by tick.

    The ideal rigid contact is one: a rigid tool's position follows from forces, not from a sampled HIP. A `Renderer`
    that has a `simulate` too is asked tick by tick.
    """

    def simulate(self, stimulus: Stimulus, dt: float) -> Recording:
        """Return the recording of the whole run, sampled every `dt` seconds."""


class CompiledStep(NamedTuple):
    """A renderer's step as compiled code, so that a path or a closed loop is answered without Python.

    It must answer as `step` does, to the last bit.

    - `function`: a kernel of signature `hapticeval.laws.LAW`.
    - `data`: the renderer's own, with the state that its last `reset` or `step` left. A loop resets the renderer and
      goes on from there. It may be another tuple than `LawData`, such as one with a map's tables, or with the effects
      that a scene puts on the answers, see `hapticeval.simulation.answers`.
    - `domain_exits`: where the hand has left the law's domain, in words, by the kernel's numbers above 0. One below 0
      is the renderer's own, and it broke.
    - `contact` (1,): where each tick leaves 1 if it reports contact, and else 0; None where it reports none.
    """

    function: Callable[..., Any]
    data: LawData
    domain_exits: Mapping[int, str]
    contact: Array | None = None


RendererFactory: TypeAlias = Callable[[Scene], Renderer | TrajectoryRenderer]


@dataclass(frozen=True, kw_only=True)
class WrappedRenderer:
    """A renderer as it is asked here: its methods, and what it offers beside the protocol, read once by `wrapped`.

    `steps` is true for a `Renderer`, false for a `TrajectoryRenderer`. The others are its attributes of the same name,
    all optional, and false or empty where it has none:

    - `observes_force`: whether it has `observe_force(push)`, and so wants the hand's measured force (N,), N, before
      each step of a scene with a force sensor (8.6);
    - `places`: whether it has `place(rotation, translation)`, see `place`;
    - `reports_contact`: whether it has `contact`: after a `step` True where that was in contact, else False, or None
      where it does not say;
    - `has_diagnostics`: whether it has `diagnostics(recording)`, which returns for a run in closed loop
      name -> (`Signal`, array), one row per sample: its own coordinates, answers that it did not use;
    - `law`: its step as compiled code, which stands for `step` along a path and in a closed loop;
    - `surface`: the `Boundary` that it really renders, where that is not the model's own;
    - `pieces`: the edges or triangles that it was given for a smooth model: what follows from them is not its fault;
    - `resolution` and `standoff` (m): how coarse its own representation of the model is, see `Recording`;
    - `declares`: the `Declaration` of what its answers keep to;
    - `rendered_as`: the projection that answers in place of the one that it is named for, where the model has none;
    - `supports`: names of what it can beside a unilateral contact without viscosity, see `check_support`.
    """

    renderer: Any
    steps: bool
    observes_force: bool = False
    places: bool = False
    reports_contact: bool = False
    has_diagnostics: bool = False
    law: CompiledStep | None = None
    surface: Boundary | None = None
    pieces: Boundary | None = None
    resolution: float = 0.0
    standoff: float = 0.0
    declares: Declaration | None = None
    rendered_as: str = ""
    supports: frozenset[str] | None = None

    @property
    def meta(self) -> dict[str, Any]:
        """What the renderer declares, as metadata of a recording."""
        entries: dict[str, Any] = {"resolution": self.resolution, "standoff": self.standoff}
        entries |= {"rendered_as": self.rendered_as} if self.rendered_as else {}
        return entries if self.declares is None else entries | self.declares.meta

    @property
    def contact(self) -> bool | None:
        """Whether the last step was in contact, as the renderer reports it; None where it is silent."""
        report = self.renderer.contact if self.reports_contact else None
        return bool(report) if isinstance(report, bool | np.bool_) else None

    def reset(self, hip: Array) -> None:
        """Start a run with the hand at `hip` (N,), m: see `Renderer`."""
        self.renderer.reset(hip)

    def step(self, hip: Array, velocity: Array, dt: float) -> Response:
        """Return the answer to a tick of `dt` (s) at `hip` (N,), m, moving by `velocity` (N,), m/s: see `Renderer`."""
        return self.renderer.step(hip, velocity, dt)  # type: ignore[no-any-return]

    def simulate(self, stimulus: Stimulus, dt: float) -> Recording:
        """Return whatever the renderer answers to a stimulus, sampled every `dt` (s): see `TrajectoryRenderer`."""
        return self.renderer.simulate(stimulus, dt)  # type: ignore[no-any-return]

    def place(self, rotation: Array, translation: Array) -> None:
        """Tell the renderer where the body is: x of the model's frame is at R x + t in the world; (N, N), and (N,), m.

        Asked before `reset` and before each `step` of a scene whose body moves. HIP, velocity and answers are then in
        the world.
        """
        self.renderer.place(rotation, translation)

    def observe_force(self, push: Array) -> None:
        """Hand the hand's measured force (N,), N, on; asked where the renderer observes it."""
        self.renderer.observe_force(push)

    def diagnostics(self, recording: Recording) -> Mapping[str, tuple[Signal, Array]]:
        """Return the renderer's own channels of a run in closed loop; asked where it has any."""
        return self.renderer.diagnostics(recording)  # type: ignore[no-any-return]


AnyRenderer: TypeAlias = Renderer | TrajectoryRenderer | WrappedRenderer
"""What those take that wrap a renderer themselves."""


def wrapped(renderer: object) -> WrappedRenderer:
    """Return a renderer with what it offers: each attribute is read once. One that is wrapped stays as it is.

    Raises `RendererError` for what is no renderer, for an attribute that raises or is not what it should be, and
    `UnknownNameError`, with the closest names, for a requirement that there is not.
    """
    if isinstance(renderer, WrappedRenderer):
        return renderer
    with renderer_errors("attributes"):
        return _wrap(renderer)


def _wrap(renderer: object) -> WrappedRenderer:
    # One with both reset and step, and simulate, is asked tick by tick.
    missing = [name for name in ("reset", "step") if not _has_method(renderer, name)]
    if missing and not _has_method(renderer, "simulate"):
        raise RendererError(
            f"the factory made a {type(renderer).__name__}, which is not a renderer: "
            f"it has no {' and no '.join(missing)}",
            why="a renderer has reset(hip) and step(hip, velocity, dt) -> (ihip, force)",
            todo="see docs/write-a-renderer.md",
        )
    # Each attribute is read once: a property may be expensive, or answer differently.
    surface, pieces, law, promise = (getattr(renderer, name, None) for name in ("surface", "pieces", "law", "declares"))
    for name, boundary in (("surface", surface), ("pieces", pieces)):
        if boundary is not None and not is_boundary(boundary):
            raise RendererError(
                f"the renderer's {name} is a {type(boundary).__name__}",
                todo=f"give the Boundary of hapticeval.geometry that it renders, or leave {name} out",
            )
    if law is not None and not isinstance(law, CompiledStep):
        raise RendererError(f"the renderer's law is a {type(law).__name__}", todo="give a CompiledStep, or None")
    if promise is not None and not isinstance(promise, Declaration):
        raise RendererError(
            f"the renderer's declares is a {type(promise).__name__}",
            todo="give a hapticeval.Declaration, or leave declares out",
        )
    if promise is not None and promise.faults:
        raise RendererError(
            f"the renderer's declaration is wrong: its {'; its '.join(promise.faults)}",
            todo="give other values, or leave out what is not promised",
        )
    rendered_as = getattr(renderer, "rendered_as", "")
    if not isinstance(rendered_as, str):
        raise RendererError(
            f"the renderer's rendered_as is a {type(rendered_as).__name__}",
            todo="give the name of a projection, or none",
        )
    return WrappedRenderer(
        renderer=renderer,
        steps=not missing,
        observes_force=_has_method(renderer, "observe_force"),
        places=_has_method(renderer, "place"),
        reports_contact=hasattr(renderer, "contact"),
        has_diagnostics=_has_method(renderer, "diagnostics"),
        law=law,
        surface=surface,
        pieces=pieces,
        resolution=_declared_length(renderer, "resolution"),
        standoff=_declared_length(renderer, "standoff"),
        declares=promise,
        rendered_as=rendered_as,
        supports=_declared_support(renderer),
    )


def _has_method(renderer: object, name: str) -> bool:
    method = getattr(renderer, name, None)
    if method is not None and not callable(method):
        raise RendererError(f"the renderer's {name} is a {type(method).__name__}", why=f"{name}() is called")
    return method is not None


def _declared_length(renderer: object, name: str) -> float:
    value = getattr(renderer, name, 0.0)
    try:
        length = float(value)
    except (TypeError, ValueError):
        length = math.nan
    # NaN fails here too.
    if not 0.0 <= length < math.inf:
        raise RendererError(
            f"the renderer declares {name} = {value!r}",
            why="it is a length in metres: a finite number that is not negative",
            todo=f"give {name} as a float, or leave it out",
        )
    return length


def _declared_support(declaring: object) -> frozenset[str] | None:
    """Return the requirements that a renderer, or its factory, declares to support; None where it declares nothing."""
    names = getattr(declaring, "supports", None)
    if isinstance(declaring, type) and not isinstance(names, Collection):
        return None  # a property of what the class makes
    # A method says it: observe_force is what a force sensor is for.
    feels = {FORCE_SENSOR} if hasattr(declaring, "observe_force") else set()
    if names is None:
        return frozenset(feels) or None
    # A string is a collection of its letters.
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


class AtRest:
    """A renderer of a body that moves, made of one that knows of no motion; what else that offers it offers too.

    The proxy moves with the body before the hand's step, and sweeps the way of the hand relative to the body. So does
    the velocity that a damper brakes. Until it is placed it answers as the renderer does.
    """

    def __init__(self, renderer: Any) -> None:
        self.renderer = renderer
        self.supports = (wrapped(renderer).supports or frozenset()) | {MOVING}
        self.pose: Pose | None = None
        self.before: Pose | None = None

    def __getattr__(self, name: str) -> Any:
        if name == "renderer":  # of a copy that is not filled yet
            raise AttributeError(name)
        # what it does not have itself: contact, surface, declares, ... and none that the renderer lacks
        offered = getattr(self.renderer, name)
        return self._observe_force if name == "observe_force" else offered

    def place(self, rotation: Array, translation: Array) -> None:
        """Take the pose of the body: `rotation` (N, N), and `translation` (N,), m; before `reset` and each `step`."""
        pose = Pose(np.array(rotation, dtype=np.float64), np.array(translation, dtype=np.float64))
        self.before = pose if self.pose is None else self.pose
        self.pose = pose

    def reset(self, hip: Array) -> None:
        """Start a run with the hand at `hip` (N,), m, in the world."""
        self.renderer.reset(hip if self.pose is None else self.pose.to_body(hip))

    def step(self, hip: Array, velocity: Array, dt: float) -> Response:
        """Answer one tick, in the world: `hip` (N,), m; `velocity` (N,), m/s; `dt`, s."""
        if self.pose is None or self.before is None:
            return self.renderer.step(hip, velocity, dt)  # type: ignore[no-any-return]
        point = self.pose.to_body(hip)
        relative = self.pose.velocity_in_body(self.before, point, velocity, dt)
        ihip, force = (np.asarray(vector) for vector in self.renderer.step(point, relative, dt))
        # a tool that is with the hand stays so to the last bit
        tool = np.array(hip) if np.array_equal(ihip, point) else self.pose.to_world(ihip)
        return Response(tool, self.pose.turned(force))

    def _observe_force(self, push: Array) -> None:
        pose = self.pose or resting_pose(push.size)
        self.renderer.observe_force(pose.turned_back(push))


def at_rest(renderer: Renderer, scene: Scene) -> Renderer:
    """Return a renderer with `AtRest` where the scene's body moves, and else as it is."""
    return renderer if scene.motion is None else AtRest(renderer)


def check_support(scene: Scene, supports: frozenset[str]) -> None:
    """Raise `RefusalError`, naming the requirements, where the scene asks for what is not among `supports`.

    These are names of `hapticeval.scene.requirements()`. "plane" and "space" narrow the models: where neither is
    declared a renderer is given both kinds, and its own code refuses what it cannot take, as `scene.model.curve` does.

    A renderer that has `observe_force` supports "force-sensor" without declaring it.
    """
    # Neither kind of model declared: both are tried, and its own code refuses.
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
            f"supports = {{{', '.join(map(repr, lacking))}}}".replace("'", '"')
            + "; a library by flags, as HR_PLANE",
        )


@dataclass(frozen=True, kw_only=True)
class Knob:
    """One setting of a renderer, such as a cell's size, so that `hapticeval bench` can sweep it.

    `values`, the coarsest first, are in `unit` ("" for a count). A factory declares knobs by name, see `Choices`.

    `quick` are the values of a quick sweep, all `values` where it is empty.

    A renderer that has no exact form is measured against itself at the last of `finest`, and the one before shows how
    far that has converged; without `finest` these are the last two that are swept.

    Raises `InputError` for a knob without values.
    """

    values: tuple[float, ...]
    unit: str
    meaning: str
    quick: tuple[float, ...] = ()
    finest: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if not self.values:
            raise InputError("a knob without values", why="a sweep needs at least one", todo="give it values")


Settings = Mapping[str, float]
"""Values by knob."""


def refuse_unknown(settings: Mapping[str, object], known: Mapping[str, Knob], *, name: str) -> None:
    """Raise `UnknownNameError` for the first of `settings` that is no knob of the renderer `name`."""
    for knob in settings:
        if knob not in known:
            # Name the first of several: the user mends one word at a time.
            raise UnknownNameError(f"knob of {name}", knob, known)


@dataclass(frozen=True, kw_only=True)
class Choices:
    """What a factory offers beside being called with a scene, read by `choices_of`; all of it is optional.

    - `summary`: what it makes, in a line.
    - `supports`: as of `WrappedRenderer`; it refuses before anything is built.
    - `regulations` and `representations`: names that `variant(*, regulation, representation)` takes.
    - `representation`: the one that it has.
    - `knobs`: what can be set finer or coarser, by `with_knobs(**values)`.
    - `reference`: the same computed another way, a factory with one knob of three values: errors count from it.
    """

    summary: str = ""
    supports: frozenset[str] | None = None
    variant: Callable[..., RendererFactory] | None = None
    regulations: tuple[str, ...] | None = None
    representations: tuple[str, ...] | None = None
    representation: str | None = None
    knobs: Mapping[str, Knob]
    with_knobs: Callable[..., RendererFactory] | None = None
    reference: RendererFactory | None = None


def choices_of(factory: object) -> Choices:
    """Return what a factory offers. Raises `RendererError` for an attribute that raises or is not what it should be."""
    with renderer_errors("factory's attributes"):
        attributes: dict[str, Any] = {name: getattr(factory, name, None) for name in Choices.__dataclass_fields__}
        for name in ("regulations", "representations"):
            attributes[name] = None if attributes[name] is None else tuple(attributes[name])
        # What is no mapping, such as a method of that name, declares no knobs.
        knobs = attributes["knobs"] if isinstance(attributes["knobs"], Mapping) else {}
        if knobs and not callable(attributes["with_knobs"]):
            raise InputError(
                f"the factory {factory!r} declares the knobs {', '.join(knobs)} and cannot set them",
                why="it has no with_knobs(**values)",
                todo="add with_knobs(**values), which returns the factory with those values",
            )
        summary = attributes["summary"] or (factory.__doc__ or "").strip().partition("\n")[0]
        return Choices(**{**attributes, "summary": summary, "supports": _declared_support(factory), "knobs": knobs})


def configured(factory: RendererFactory, settings: Mapping[str, float], *, name: str) -> RendererFactory:
    """Return the factory with its knobs at `settings`; `name` is what the user called the renderer.

    Raises `UnknownNameError`, with the closest, for a knob that it does not have.
    """
    choices = choices_of(factory)
    refuse_unknown(settings, choices.knobs, name=name)
    return choices.with_knobs(**settings) if settings and choices.with_knobs is not None else factory
