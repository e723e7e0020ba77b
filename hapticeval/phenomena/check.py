"""What a check is: a function of the runs and the scene, with data on what it reads, needs and applies to."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from enum import StrEnum
from functools import cache, cached_property, partial
from typing import Any, Protocol, TypeVar

from hapticeval.effects.effect import Alters
from hapticeval.errors import InputError, UnknownNameError
from hapticeval.geometry.boundary import Boundary
from hapticeval.geometry.mesh import Mesh
from hapticeval.geometry.motion import Motion
from hapticeval.phenomena.observed import Observed
from hapticeval.phenomena.sampling import LED
from hapticeval.phenomena.verdict import Finding, Level, Metric, Outcome, not_applicable, undecided
from hapticeval.recordings.recording import Recording
from hapticeval.scene import Scene
from hapticeval.types import Array

Required = TypeVar("Required")


class Refinable(Protocol):
    """A path of which any part can be run again in finer steps: see `hapticeval.simulation.playback.Closeup`."""

    recording: Recording

    def refined(self, first: int, last: int, factor: int, *, lag: int) -> Refinable:
        """Run rows `first` to `last`, each step in `factor`; the hand rests before, and for `lag` ticks after."""


@dataclass(frozen=True, eq=False)
class Runs:
    """The recording that is judged, and how to record its siblings where the runner can make them.

    Each sibling is None where it cannot be had: a recorded hardware run has none. This is the one table of siblings: a
    check names by these names what it may use, and who runs it gives them by these names.

    Raises `InputError` for a recording with rows that are not valid.
    """

    base: Recording
    refine: Callable[[int], Recording] | None = None
    """`refine(k)`: the same stimulus at k times the sampling rate."""
    reverse: Callable[[], Recording] | None = None
    """The hand is led backwards along the same points."""
    at_speed: Callable[[float], Recording] | None = None
    """`at_speed(f)`: the experiment starts f times as fast."""
    closed_form: str | None = None
    """The name of a closed form (`hapticeval.closed_forms`), which the case gives or the renderer declares."""
    again: Callable[[], Recording] | None = None
    """Once more through the same renderer, which is reset in between."""
    fresh: Callable[[int], Recording] | None = None
    """`fresh(n)`: once more through a renderer that is made for it, the n-th of these."""
    look: Refinable | None = None
    """`base` with a way to refine a part of it."""
    moved: Callable[[Motion, tuple[float, ...]], Recording | None] | None = None
    """`moved(motion, nudge)`: the stimulus, shifted by the vector `nudge` (N,), m, and then moved with the scene.

    The recording is moved back. It is None where the model cannot be moved so or the renderer refuses it there.
    """
    led_on: Callable[[int, int, int], Runs] | None = None
    """`led_on(laps, first, period)`: the path up to row `first`, then the `period` rows after that, `laps` times."""
    without: Callable[[str], Recording] | None = None
    """`without(kind)`: the same path, of a closed loop the recorded HIPs, without the effect of that kind."""
    reordered: Callable[[], Recording | None] | None = None
    """The path with the model's vertices in another order; None like `moved`."""
    cut: Callable[[], Recording | None] | None = None
    """The path on the mesh with its faces cut into other triangles; None like `moved`."""
    dropped_out: Callable[[int], tuple[Array | None, Array | None]] | None = None
    """`dropped_out(tick)`: the forces (N,), N, in a tick whose HIP is not finite, and in the next, which has the HIP of
    the path again; None for one that is refused."""
    subdivided: Callable[[], Recording] | None = None
    """Each step of the hand in two of half the time; both rows of a step are returned."""
    in_turns: Callable[[], Recording] | None = None
    """The path through a renderer that takes turns with another of the same factory, which is led backwards on a model
    of half the size."""
    pieces: Boundary | None = None
    """The edges or triangles that the renderer was given for a smooth model."""

    def __post_init__(self) -> None:
        # `valid` is only there where some rows are not.
        if self.base.valid is not None:
            raise InputError(
                "a recording with gaps cannot be judged as a whole",
                why="rows that are not valid hold numbers that nobody measured",
                todo="judge its sound stretches: part(rows) of each sound_rows()",
            )

    @cached_property
    def observed(self) -> Callable[[Scene], Observed]:
        """`observed(scene)`: `base` in that scene, one object for all checks: each quantity is computed once."""
        return cache(partial(Observed, self.base, fresh=self.fresh))

    def remembered(self) -> Runs:
        """The same runs, each sibling made once at the most."""
        siblings: dict[str, Any] = {field.name: getattr(self, field.name) for field in fields(self)}
        # A sibling with arguments is cached by them: `refine(2)` and `refine(4)` are two runs.
        caching: dict[str, Any] = {name: cache(make) for name, make in siblings.items() if callable(make)}
        return replace(self, **caching)


SIBLINGS = tuple(field.name for field in fields(Runs) if field.name != "base")
"""The names of the siblings: what a check may use beside the recording that it judges."""


class Situation(StrEnum):
    """Runs and scenes for which a check may have no question."""

    PLAYBACK = "a hand led along a given path"
    LED = "a hand led along a given or a recorded path"
    UNILATERAL = "a surface that only pushes"
    BILATERAL = "a surface that holds the tool from both sides"
    NO_CONVEX_CORNER = "a model without a convex corner"
    NO_CONCAVE_CORNER = "a model without a concave corner"


def situations(runs: Runs, scene: Scene) -> frozenset[Situation]:
    """Return the situations that runs in a scene are in: checks name those in which they have no question."""
    source = runs.base.meta.get("source")
    # Corners of the model itself, whatever a renderer was given.
    convex, concave = _has_corners(scene.model.boundary)
    holds = {
        Situation.PLAYBACK: source == "playback",
        Situation.LED: source in LED,
        Situation.UNILATERAL: not scene.bilateral,
        Situation.BILATERAL: scene.bilateral,
        Situation.NO_CONVEX_CORNER: not convex,
        Situation.NO_CONCAVE_CORNER: not concave,
    }
    return frozenset(situation for situation, holds_here in holds.items() if holds_here)


def _has_corners(boundary: Boundary) -> tuple[bool, bool]:
    """Return whether a boundary has convex corners or edges, and whether it has concave ones."""
    if isinstance(boundary, Mesh):
        return True, boundary.concave  # a closed mesh has convex edges
    convex = [corner.convex for corner in boundary.corners]
    return any(convex), not all(convex)


FREE_THROUGHOUT = "the hand stays in free space, and feels nothing there"
"""What is so of a whole case that a right renderer answers by nothing."""

NOBODY = "a recording shows one run only, and nobody can be asked for another"
"""Why a check that needs a sibling is not asked of a recording."""


def required(value: Required | None) -> Required:
    """Return what is there wherever a check is asked: a sibling that it `needs`, or an effect that it is of."""
    assert value is not None
    return value


LACKING_CHANNEL = "lacks"
"""The entry of the evidence that names a channel which the check reads and the recording lacks."""


def without_channel(channel: str) -> Finding:
    """Return the finding for a recording without a channel that the check reads."""
    message = f"the recording has no channel '{channel}', which this check reads"
    return Finding(Outcome.INCONCLUSIVE, message, evidence={LACKING_CHANNEL: channel})


def without_ihip(base: Observed) -> Finding:
    """Return the finding of a check of the contact point for a renderer that gives none: see `Observed.lacks_ihip`.

    Not applicable where that is declared; else nobody knows whether one was forgotten.
    """
    if base.declares_force_only:
        message = "the renderer declares that it has a force and no contact point, which this check is about"
        return not_applicable(message)
    # Nothing was declared: an IHIP may have been forgotten, and what it would show is open.
    return undecided("the renderer gives a force but no IHIP: its contact point cannot be judged")


def not_alone(scene: Scene, *kinds: str, because: str) -> Finding | None:
    """Return that a check of effects of these `kinds` has no question where others change the answer too; else None.

    `because` says of the others why they spoil it.
    """
    others = scene.answer_effects_except(*kinds)
    if not others:
        return None
    message = f"the scene calls for {' and '.join(others)} too, {because}: the effect is judged alone"
    return not_applicable(message)


def nothing_pressed(base: Observed) -> Finding | None:
    """Return why a check of how a tool is pressed has no answer: no force above the floor, or no IHIP; else None."""
    if not base.pressed.any():
        return undecided("no force above the floor: the tool never presses on the surface")
    return without_ihip(base) if base.lacks_ihip else None


@dataclass(frozen=True, kw_only=True)
class Check:
    """A phenomenon as a check: call it with runs and a scene; `hapticeval explain` prints its data.

    `judge` returns a finding whose metric has the check's `unit`, or one of its own. It is called only where the check
    applies:

    - `channels`: each of them was recorded; `reads_also` are channels that it reads where they were.
    - `needs`: each sibling can be had; the value is the finding without it. `siblings` describes all that it may use,
      by their names in `SIBLINGS`.
    - `not_for`: the run is in none of these situations; the value says why it is not applicable there.
    - `effects`: the scene calls for one of these kinds, where any are given: a check of how that effect is shown.
    - `not_with`: no effect of the scene alters one of these. By default it is asked only where free space has no force.

    What it asks, allows and why stands on its page, see `hapticeval.phenomena.pages`. A check of another package brings
    its own as `page`, in Markdown. Two marks say of which runs it is asked:

    - `needs_loop`: it is about how hand and force act on each other. A hand led along a recorded path does not show it,
      so that an undecided verdict stops no gate.
    - `holds`: it is asked of a closed loop that is set up for it, as Problem 7.1 does of one on a bilateral constraint,
      and of other runs only where a case names it.
    """

    id: str
    phenomenon: str
    formula: str
    citation: str
    channels: tuple[str, ...]
    metric: str
    unit: str
    judge: Callable[[Runs, Scene], Finding]
    reads_also: tuple[str, ...] = ()
    siblings: Mapping[str, str] = field(default_factory=dict)
    needs: Mapping[str, Finding] = field(default_factory=dict)
    not_for: Mapping[Situation, str] = field(default_factory=dict)
    effects: tuple[str, ...] = ()
    not_with: tuple[Alters, ...] = (Alters.FREE_SPACE,)
    needs_loop: bool = False
    holds: bool = False
    level: Level = Level.MUST
    page: str = ""

    def __post_init__(self) -> None:
        for name in {*self.siblings, *self.needs}:
            if name not in SIBLINGS:
                raise UnknownNameError("sibling", name, SIBLINGS, todo=f"choose one of: {', '.join(SIBLINGS)}")

    def measured(self, value: float) -> Metric:
        """Return what the check measures, in its `unit`."""
        return Metric(self.metric, float(value), self.unit)

    @property
    def needs_closed_form(self) -> bool:
        """Whether the check compares with a closed form."""
        return "closed_form" in self.needs

    def __call__(self, runs: Runs, scene: Scene) -> Finding:
        """Judge `runs` in `scene`, where the check applies and has what it needs."""
        # In this order: what the scene does not ask, what this run cannot show, what is missing.
        if self.effects and not any(effect.kind in self.effects for effect in scene.effects):
            return not_applicable(f"the scene calls for no {' or '.join(self.effects)}")
        altered = [(effect, what) for effect in scene.effects for what in self.not_with if what in effect.alters]
        for effect, what in altered:
            message = f"the scene calls for {effect.kind}, {what}, and the check is about a surface without"
            return not_applicable(message)
        present = situations(runs, scene) if self.not_for else ()
        for situation, why in self.not_for.items():
            if situation in present:
                return not_applicable(why)
        for sibling, finding in self.needs.items():
            if getattr(runs, sibling) is None:
                return finding
        for channel in self.channels:
            if channel not in runs.base.channels:
                return without_channel(channel)
        finding = self.judge(runs, scene)
        if finding.outcome is Outcome.INCONCLUSIVE and runs.observed(scene).stays_free:
            # What a right renderer leaves undecided there is no fault of its.
            return replace(finding, outcome=Outcome.NOT_APPLICABLE, message=f"{FREE_THROUGHOUT}: {finding.message}")
        return finding
