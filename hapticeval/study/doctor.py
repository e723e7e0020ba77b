"""Examine whether a renderer keeps the contract, on a model in the plane and one in space, question by question.

Each question is put to the renderer in a process beside this one, so that it may crash or hang.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from enum import StrEnum
from functools import lru_cache
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from hapticeval.adapters.outside import Outside
from hapticeval.diagnosis import diagnose, right_contact
from hapticeval.discovery import resolve
from hapticeval.errors import (
    HapticevalError,
    RefusalError,
    RendererError,
    describe_error,
    origin,
    place_in_stack,
    renderer_errors,
)
from hapticeval.geometry.catalogue import make_model
from hapticeval.geometry.mesh import Mesh
from hapticeval.phenomena.checks.drop_out import fault_without_hip
from hapticeval.phenomena.decisions import LAG_TICKS
from hapticeval.phenomena.sampling import farthest_standoff, force_floor, mm, note_cut_standoff
from hapticeval.quantity import format_duration
from hapticeval.recordings.recording import path_velocities, single_rounding
from hapticeval.renderer import Declaration, WrappedRenderer
from hapticeval.runner.results import Problem
from hapticeval.scene import Scene
from hapticeval.simulation.answers import make_renderer
from hapticeval.simulation.checked_calls import ask_without_hip, check_answer, reset_checked, step_checked
from hapticeval.simulation.playback import answers_along
from hapticeval.types import Array
from hapticeval.workers import Overdue, ProcessEnded, Workers

TRIED_MODELS = {"plane": "circle", "space": "cube"}
SPACE_WORDS = {"plane": "the plane", "space": "space"}

MODEL_PATIENCE = 600.0
"""Seconds for what is asked of no renderer: the models' kernels may have to be compiled."""

POLL_PERIOD = 0.1

LEAD_DEPTH, LEAD_STEP, LEAD_REST_TICKS = 1e-2, 1e-3, 20
"""How deep the hand is led in, and how far it goes in a tick, in sizes of the model; and ticks that it rests there."""

SIDES = 12
"""Points of a curve at which the hand is pressed in."""

HALF_STROKES, STROKE_TICKS, STROKE_DEPTH = 6, 600, 0.1
"""Half strokes of the hand in which a lag is looked for, three into the surface; their ticks, and depth in sizes."""

TIMED_TICKS = 500
"""Ticks that are timed."""


class State(StrEnum):
    """The outcome of a question."""

    OK = "ok"
    NOTE = "note"
    MISSING = "missing"
    BROKE = "broke"


class ContractFinding(NamedTuple):
    """An answer: what was asked, on which kind of model ("plane", "space" or ""), its state, and the words.

    `hip` (N,), m, is the hand's position at which the renderer broke, where it broke in a tick.
    """

    what: str
    kind: str
    state: State
    text: str
    hip: tuple[float, ...] | None = None


StateAndText = tuple[State, str]
"""What a question returns."""

Waiting = Callable[[str, float, float], None]
"""Takes what is waited for, for how many seconds so far, and for how many at the most."""


class RendererBroke(Exception):
    """The renderer broke at a question: `text` says how, `cause` what such breaks have in common, `hip` (m) where."""

    def __init__(self, text: str, cause: object, hip: tuple[float, ...] | None = None, *, last: bool = False) -> None:
        super().__init__(text, cause, hip)  # its arguments are what travels between processes
        self.text, self.cause, self.hip, self.last = text, cause, hip, last


class HandPath(NamedTuple):
    """A hand's path `hips` (n, N), m: in from free space, a rest inside, and out again.

    `deep` is the last row of the rest, `out` the first of the rest outside; `foot` (N,), m, and `normal` (N,) are the
    surface's point on the way and its outward normal.
    """

    hips: Array
    deep: int
    out: int
    foot: Array
    normal: Array


class Case(NamedTuple):
    """A renderer in a scene, and a path for its hand."""

    renderer: WrappedRenderer
    scene: Scene
    path: HandPath


def examine(name: str, *, patience: float, waiting: Waiting | None = None) -> Iterator[ContractFinding]:
    """Examine the renderer of that name, and yield a finding for each question. Raises as `resolve` does.

    An answer is waited for at most `patience` seconds; one that does not come is the last. What breaks in the same way
    as at an earlier question only names that one.
    """
    resolve(name)
    refused = 0
    first: dict[object, str] = {}
    with Workers(_put_question, 1) as crew:
        for kind in TRIED_MODELS:
            # Once a model: what compiles here is not waited for at the renderer's cost.
            _await_answer(crew, MODEL_PATIENCE, waiting, f"preparing the {TRIED_MODELS[kind]}", name, kind, "")
            for what in QUESTIONS:
                place = f"'{what}' in {SPACE_WORDS[kind]}"
                hip = None
                try:
                    state, text = _await_answer(crew, patience, waiting, f"waiting for {place}", name, kind, what)
                except RendererBroke as broke:
                    state, text, hip = State.BROKE, broke.text, broke.hip
                    # The same fault breaks most questions: it is told once.
                    if broke.cause in first:
                        text = f"as at {first[broke.cause]}"
                    first.setdefault(broke.cause, place)
                    if broke.last:
                        yield ContractFinding(what, kind, state, text)
                        return
                yield ContractFinding(what, kind, state, text, hip)
                # A renderer that was not made can be asked nothing on this model.
                if what == "made" and state is not State.OK:
                    refused += state is State.NOTE
                    break
    if refused == len(TRIED_MODELS):
        yield ContractFinding(
            "dimension", "", State.MISSING, "it refuses models in the plane and in space: there is no other"
        )


def _await_answer(
    crew: Workers[StateAndText], patience: float, waiting: Waiting | None, asked_for: str, *question: str
) -> StateAndText:
    """Have a question put, wait for its answer and return it. Raises `RendererBroke` where none comes."""
    crew.begin(0, *question)
    begun, starved = time.monotonic(), crew.starved(0)
    while not (answers := crew.answers(POLL_PERIOD) or crew.give_up(patience)):
        if waiting is not None:
            # Time that the process has waited for a processor is not the renderer's.
            waiting(asked_for, time.monotonic() - begun - (crew.starved(0) - starved), patience)
    answer = answers[0]
    if isinstance(answer.error, Overdue):
        place = place_in_stack(answer.error.stack)
        raise RendererBroke(
            f"no answer in {patience:g} s: it hangs{place and f', {place}'}; no more is asked", None, last=True
        )
    if isinstance(answer.error, ProcessEnded):
        text = f"it ends the process that it runs in: {answer.error.how}"
        raise RendererBroke(text, text)
    if answer.error is not None:
        raise answer.error
    assert answer.value is not None
    return answer.value


def _put_question(name: str, kind: str, what: str) -> StateAndText:
    """Put one question, in a process of its own; "" only prepares. Raises `RendererBroke` for all that it raises."""
    if not what:
        _scene(kind)
        return State.OK, ""
    try:
        if what == "made":
            return _check_made(name, kind)
        return QUESTIONS[what](_case(name, kind))
    except HapticevalError as error:
        hip = error.hip if isinstance(error, RendererError) else None
        text = "; ".join(filter(None, (error.what, error.why, error.todo)))
        raise RendererBroke(text, Problem.of(error).kind, hip) from None
    except Exception as error:  # of a property, or of what an answer was taken for
        text = f"it raised {describe_error(error)}; {origin(error)}"
        raise RendererBroke(text, text) from None


@lru_cache(maxsize=2)
def _case(name: str, kind: str) -> Case:
    scene = _scene(kind)
    renderer = make_renderer(resolve(name), scene)
    return Case(renderer, scene, _hand_path(scene, renderer.standoff))


@lru_cache
def _scene(kind: str) -> Scene:
    """Make a scene, and ask its model all that the questions will: what has to be compiled is compiled now."""
    scene = Scene(model=make_model(TRIED_MODELS[kind]))
    Outside(scene).tool(scene.model.boundary.points(1)[0])
    _hand_path(scene, 0.0)
    return scene


def _check_made(name: str, kind: str) -> StateAndText:
    """Check that the factory makes a renderer of the scene, and tell what that declares."""
    try:
        case = _case(name, kind)
    except RefusalError as refusal:
        return State.NOTE, f"it refuses the model: {refusal.what}; {refusal.why}"
    abilities = case.renderer
    if not abilities.steps:
        return State.NOTE, "it answers a stimulus whole, by simulate(): there are no ticks to ask for"
    parts = [f"model '{case.scene.model.name}'"]
    parts += [
        f"{length} {getattr(abilities, length):.3g} m"
        for length in ("standoff", "resolution")
        if getattr(abilities, length)
    ]
    parts.append(
        f"supports {', '.join(sorted(abilities.supports)) if abilities.supports else 'what every renderer must'}"
    )
    if abilities.declares is not None and abilities.declares.spring is not None:
        parts.append(f"a spring along the {abilities.declares.spring}")
    parts.append("asked in a compiled loop, by its law" if abilities.law else "asked tick by tick, by its step()")
    return State.OK, "; ".join(parts)


def _hand_path(scene: Scene, standoff: float) -> HandPath:
    """Make a path along a normal, away from corners, that begins where a tool with this `standoff` (m) is free."""
    model = scene.model
    size = model.size
    low, high = np.reshape(model.boundary.bounds, (2, -1))
    # Beside the middle of a face, a little off its axes of symmetry: the closest point is on no corner or edge.
    start = 0.5 * (low + high) + 0.05 * size * np.arange(1, low.size + 1) / low.size
    # Outside the box, so that the closest point is on the surface towards +x.
    start[0] = high[0] + 0.1 * size
    frame = model.boundary.closest_point(start[np.newaxis])
    foot, normal = frame.foot[0], frame.normal[0]
    # Height over the foot: half the depth and the standoff above the surface, down to the depth, a rest, and back.
    heights = np.arange(0.5 * LEAD_DEPTH + standoff / size, -LEAD_DEPTH, -LEAD_STEP) * size
    heights = np.concatenate(
        [heights, np.full(LEAD_REST_TICKS, -LEAD_DEPTH * size), heights[::-1], np.full(LEAD_REST_TICKS, heights[0])]
    )
    # argmin is the first row of the rest at the deepest point; this is its last one.
    deep = int(np.argmin(heights)) + LEAD_REST_TICKS - 1
    return HandPath(foot + heights[:, np.newaxis] * normal, deep, len(heights) - LEAD_REST_TICKS, foot, normal)


def _answers_along(case: Case, hips: Array, dt: float) -> tuple[Array, Array]:
    """Return IHIPs (n, N), m, and forces (n, N), N, of a reset and a step for each of `hips` (n, N), m; `dt` in s."""
    # As the runner does: the velocity from this sample and the last one.
    velocity = path_velocities(hips, dt)
    reset_checked(case.renderer, hips[0])
    answers = [step_checked(case.renderer, k, hip, velocity[k], dt) for k, hip in enumerate(hips)]
    return np.array([ihip for ihip, _ in answers]), np.array([force for _, force in answers])


def _check_free_space(case: Case) -> StateAndText:
    """Check that in free space the IHIP is the HIP, and the force zero."""
    hips = case.path.hips[:3]
    ihips, forces = _answers_along(case, hips, case.scene.sampling_time)
    off, force = float(np.linalg.norm(ihips - hips, axis=1).max()), float(np.linalg.norm(forces, axis=1).max())
    if force > 0.0:
        return State.MISSING, f"a force of {force:.3g} N in free space: return zero there"
    # Millimetres for metres is the likeliest cause, and has an advice of its own.
    if off > single_rounding(hips):
        if _is_thousandfold(ihips, hips):
            return State.MISSING, "the IHIP is a thousand times the HIP: points are in m, not in mm"
        advice = (
            "step() changes the hip that it is given: change a copy" if _changes_hip(case) else "return the HIP there"
        )
        return State.MISSING, f"the IHIP is {1e3 * off:.3g} mm from the HIP in free space: {advice}"
    if case.renderer.contact:
        return State.MISSING, "it reports contact in free space"
    return State.OK, "the IHIP is the HIP, and the force zero"


def _changes_hip(case: Case) -> bool:
    """Return whether a step changes the array that it is given; what it answers with that is no hand position."""
    hip = case.path.hips[0]
    reset_checked(case.renderer, hip)
    given_hip = hip.copy()
    case.renderer.step(given_hip, np.zeros_like(hip), case.scene.sampling_time)
    return not np.array_equal(given_hip, hip)


def _check_contact(case: Case) -> StateAndText:
    """Check that under the surface the IHIP is on it, and the force pushes out."""
    scene, path = case.scene, case.path
    ihips, forces = _answers_along(case, path.hips[: path.deep + 1], scene.sampling_time)
    touches = case.renderer.contact
    depth = LEAD_DEPTH * scene.model.size
    # The part of the force along the outward normal, N.
    outwards = float(forces[-1] @ path.normal)
    if not forces[-1].any() and np.linalg.norm(ihips[-1] - path.hips[path.deep]) <= single_rounding(path.hips):
        return (
            State.MISSING,
            f"no contact {1e3 * depth:.3g} mm under the surface: neither a force nor an IHIP of its own",
        )
    if not outwards > 0.0:
        return State.MISSING, f"the force {forces[-1]} N does not push the hand out, along {path.normal}: turn its sign"
    if touches is False:
        return State.MISSING, f"it reports free space {1e3 * depth:.3g} mm under the surface"
    # Distance of the IHIP from the true surface, m: what a standoff would have to declare.
    off = abs(float(scene.model.boundary.signed_distance(ihips[-1:])[0]))
    abilities = case.renderer
    cut_standoff = note_cut_standoff(abilities.standoff, scene)
    force = f"{outwards:.3g} N at {1e3 * depth:.3g} mm, of {scene.stiffness * depth:.3g} N of a spring"
    if np.array_equal(ihips[-1], path.hips[path.deep]):
        return State.NOTE, f"{force}; it has no IHIP of its own: {_advise_without_ihip(abilities.declares)}"
    if _is_thousandfold(ihips[-1], path.foot):
        return State.MISSING, "the IHIP is a thousand times the surface point: points are in m, not in mm"
    if cut_standoff:
        return (
            State.MISSING,
            f"{cut_standoff}: what lies farther off is another surface. A smaller tool, or a larger model, is judged "
            "fairly",
        )
    # A thousandth of the depth for a renderer that holds the surface coarsely.
    if off > abilities.standoff + single_rounding(path.hips) + 1e-3 * depth:
        believed = farthest_standoff(scene)
        advice = (
            "declare a standoff of that, or put it there"
            if off <= believed
            else f"put it there; of a standoff {1e3 * believed:.3g} mm count here at the most"
        )
        return State.MISSING, f"the IHIP is {1e3 * off:.3g} mm off the surface: {advice}"
    # Compared with a spring of the scene's stiffness, either way: N/mm for N/m, or N/m for N/mm.
    if _is_thousandfold(scene.stiffness * depth * path.normal, forces[-1]) or _is_thousandfold(
        forces[-1], scene.stiffness * depth * path.normal
    ):
        return State.NOTE, f"{force}: a factor of 1000, as where N/m are taken for N/mm; all units are SI"
    wrong_side = _find_wrong_side(case)
    if wrong_side:
        return State.MISSING, wrong_side
    return State.OK, f"{force}; the IHIP is {1e3 * off:.2g} mm off the surface, and all sides push out"


def _find_wrong_side(case: Case) -> str:
    """Say where around the model the force does not push the hand out, along the normal there; "" for nowhere.

    The hand is pressed in at the middle of each triangle, on a curve at `SIDES` points.
    """
    boundary, size = case.scene.model.boundary, case.scene.model.size
    middles = (
        boundary.vertices[boundary.triangles].mean(axis=1) if isinstance(boundary, Mesh) else boundary.points(SIDES)
    )
    frame = boundary.closest_point(middles)
    heights = case.path.hips[: case.path.deep + 1] - case.path.foot
    # The heights over the foot of the first press, m, along another normal.
    along = heights @ case.path.normal
    for foot, normal in zip(frame.foot, frame.normal, strict=True):
        force = _answers_along(case, foot + along[:, np.newaxis] * normal, case.scene.sampling_time)[1][-1]
        if not float(force @ normal) > 0.0:
            where = f"{mm(LEAD_DEPTH * size)} under the surface at {mm(*foot)}"
            return f"the force {force} N does not push the hand out, along {normal}, {where}; elsewhere it does"
    return ""


def _advise_without_ihip(declared: Declaration | None) -> str:
    """Say what becomes of checks of the contact point where the IHIP is always the HIP."""
    if declared is not None and declared.force_only:
        return "checks of the contact point are not applicable, as declared"
    return "checks of the contact point are inconclusive, until it declares force_only"


def _is_thousandfold(values: Array, right: Array) -> bool:
    """Return whether numbers are a thousand times the right ones, as where mm are taken for m."""
    # Within a tenth: another law than a spring differs by some per cent, a unit by 1000.
    return bool(np.linalg.norm(values - 1e3 * right) <= 0.1 * np.linalg.norm(1e3 * right))


def _check_leaving(case: Case) -> StateAndText:
    """Check that it lets go of a hand that has left, within the lag that is granted."""
    path = case.path
    ihips, forces = _answers_along(case, path.hips, case.scene.sampling_time)
    # The rest outside, without the ticks in which a contact may still end.
    last = slice(path.out + LAG_TICKS, None)
    if forces[last].any() or np.linalg.norm(ihips[last] - path.hips[last], axis=1).max() > single_rounding(path.hips):
        return State.MISSING, "it still holds the hand that has left the model: compare with the surface in each tick"
    return State.OK, "it lets go of the hand"


def _check_reset(case: Case) -> StateAndText:
    """Check that a reset clears everything: the same path gives the same answers, to the bit or as declared."""
    dt = case.scene.sampling_time
    first = _answers_along(case, case.path.hips[: case.path.deep + 1], dt)
    second = _answers_along(case, case.path.hips[: case.path.deep + 1], dt)
    # The largest difference of an IHIP (m) and of a force (N).
    apart = [float(np.abs(a - b).max()) for a, b in zip(first, second, strict=True)]
    declared = case.renderer.declares
    allowed = (0.0, 0.0) if declared is None else (declared.ihip_scatter, declared.force_scatter)
    if any(by > may for by, may in zip(apart, allowed, strict=True)):
        return (
            State.MISSING,
            f"the same way after a reset differs by {apart[0]:.3g} m and {apart[1]:.3g} N: clear it all",
        )
    return State.OK, "a reset begins anew"


def _check_reset_inside(case: Case) -> StateAndText:
    """Check that a reset with the hand inside, as closed loops do, begins in contact."""
    hip = case.path.hips[case.path.deep]
    # The hand rests inside for as long as an answer may be late.
    _, forces = _answers_along(case, np.repeat(hip[np.newaxis], LAG_TICKS + 1, axis=0), case.scene.sampling_time)
    if forces[-1] @ case.path.normal < 0.0:
        return State.MISSING, "after a reset with the hand inside the force pulls the hand in: turn its sign"
    if not forces[-1] @ case.path.normal > 0.0:
        return State.MISSING, "no force after a reset with the hand inside: start the tool at the nearest surface point"
    return State.OK, "a reset with the hand inside begins in contact"


def _check_law(case: Case) -> StateAndText:
    """Check that a compiled step answers as step() does, to the bit."""
    if case.renderer.law is None:
        return State.NOTE, "there is no law, its step as compiled code: each tick is a call from Python"
    hips, dt = case.path.hips, case.scene.sampling_time
    by_step = _answers_along(case, hips, dt)
    by_law = answers_along(case.renderer, hips, dt)
    apart = [float(np.abs(a - b).max()) for a, b in zip(by_step, by_law[:2], strict=True)]
    if any(apart):
        return State.MISSING, f"its law differs from step() by {apart[0]:.3g} m and {apart[1]:.3g} N"
    return State.OK, "its law is equal to step(), to the bit"


def _check_non_finite(case: Case) -> StateAndText:
    """Check that a HIP that is not finite gets no force or is refused, and leaves nothing behind."""
    dt, hips = case.scene.sampling_time, case.path.hips[: case.path.deep + 1]
    before = _answers_along(case, hips, dt)
    answer, after = ask_without_hip(case.renderer, hips[-1], dt)
    # Whatever it answered: after a reset it must be as before, to the bit.
    if not all(map(np.array_equal, before, _answers_along(case, hips, dt))):
        return State.MISSING, "after a HIP that is not finite, and a reset, it answers otherwise than before"
    _, fault = fault_without_hip(answer, after, force_floor(case.scene))
    if fault:
        return State.MISSING, f"{fault}: refuse it, or return no force, before any state is touched"
    return State.OK, f"a HIP that is missing {'is refused' if answer is None else 'gets no force'}"


def _check_lag(case: Case) -> StateAndText:
    """Check that force and IHIP are of the hand of now, and tell what else the diagnosis finds off in them."""
    scene, path = case.scene, case.path
    # Strokes into the surface and along it: without changes of the depth nothing is late.
    turn = np.linspace(0.0, HALF_STROKES * np.pi, STROKE_TICKS)
    along = np.roll(path.normal, 1) - path.normal * (np.roll(path.normal, 1) @ path.normal)
    deeper, aside = STROKE_DEPTH * scene.model.size * np.array([-np.sin(turn), 0.5 * np.sin(0.4 * turn)])
    hips = path.foot + deeper[:, np.newaxis] * path.normal + aside[:, np.newaxis] * along
    # From outside, where a tool with this standoff is free.
    hips += case.renderer.standoff * path.normal * (deeper > 0.0)[:, np.newaxis]
    dt = scene.sampling_time
    ihips, forces = _answers_along(case, hips, dt)
    declared = case.renderer.declares
    has_ihip = not (declared is not None and declared.force_only) and bool(np.any(ihips != hips))
    contact = right_contact(
        scene.model.boundary, np.arange(0.0, len(hips)) * dt, hips, path_velocities(hips, dt),
        stiffness=scene.stiffness, damping=scene.damping,
    )  # fmt: skip
    tolerance = case.renderer.standoff + case.renderer.resolution
    diagnosis = diagnose(contact, forces, ihips if has_ihip else None, tolerance=tolerance)
    if not diagnosis.off:
        return State.OK, "force and IHIP are of the hand of now"
    if diagnosis.cause is None:
        return State.NOTE, "its force is none of a spring to the surface, by nothing that is known; checks say where"
    ticks = float(diagnosis.cause.numbers.get("ticks", 0.0))
    if diagnosis.kind == "lag":
        granted = f"; {LAG_TICKS} ticks are granted"
        return (State.NOTE if ticks <= LAG_TICKS else State.MISSING), diagnosis.sentence + granted
    return State.NOTE, diagnosis.sentence


def _check_speed(case: Case) -> StateAndText:
    """Check that a step takes less than the sampling time, in free space, at the entry and in contact."""
    dt, path = case.scene.sampling_time, case.path.hips
    # To and fro, each row an array of its own, which a step may change.
    hips = np.resize(path, (TIMED_TICKS, path.shape[1]))
    reset_checked(case.renderer, hips[0])
    still, spent, answers = np.zeros_like(hips[0]), [], []
    for k, hip in enumerate(hips):
        # Called bare, without the checks of `step_checked`: their time is not the renderer's.
        with renderer_errors("step()", tick=k, hip=hip):
            begun = time.perf_counter()
            answer = case.renderer.step(hip, still, dt)
            spent.append(time.perf_counter() - begun)
        answers.append(answer)
    for k, answer in enumerate(answers):
        check_answer(answer, k, hips[k])
    inside = case.scene.model.boundary.signed_distance(hips) < 0.0
    entry = inside & ~np.roll(inside, 1)
    seconds = np.array(spent)
    parts, usual = [], []
    for phase, rows in (("free space", ~inside), ("entry", entry), ("contact", inside & ~entry)):
        if rows.any():
            usual.append(float(np.median(seconds[rows])))
            parts.append(f"{format_duration(usual[-1])} in {phase}")
    # A quantile of so many ticks: one in a hundred that is over a tick is felt.
    slow = float(np.percentile(seconds, 99))
    words = f"{', '.join(parts)}; 99 % in {format_duration(slow)}, through Python; a tick has {format_duration(dt)}"
    if max(usual) >= dt:
        return State.MISSING, f"{words}: too slow for a robot, not for verdicts"
    return (State.OK, words) if slow < dt else (State.NOTE, f"{words}: one step in a hundred is too slow for a robot")


def _check_bilateral(case: Case) -> StateAndText:
    """Tell whether it declares to hold the tool from both sides."""
    if "bilateral" in (case.renderer.supports or ()):
        return State.OK, "declares that it holds the tool from both sides"
    return State.NOTE, "it does not declare 'bilateral': cases that hold the tool from both sides are not applicable"


QUESTIONS: Mapping[str, Callable[..., StateAndText]] = MappingProxyType(
    {
        "made": _check_made,
        "free space": _check_free_space,
        "contact": _check_contact,
        "leaving": _check_leaving,
        "reset": _check_reset,
        "reset inside": _check_reset_inside,
        "law": _check_law,
        "non-finite": _check_non_finite,
        "bilateral": _check_bilateral,
        "lag": _check_lag,
        "speed": _check_speed,
    }
)
"""All questions in order, by name; the first makes the renderer."""


def next_steps(name: str, findings: Sequence[ContractFinding]) -> list[str]:
    """Return lines on what to do about what broke first, with a program that asks the renderer there; else none."""
    broke = next((finding for finding in findings if finding.state is State.BROKE), None)
    if broke is None:
        return []
    steps = [f"next: mend what broke at '{broke.what}' first; what broke as it did goes with it"]
    if broke.what == "free space" and "shape" not in broke.text:
        steps.append("in free space hand and tool are one point: what divides by their distance divides by zero")
    # Kinds of models in which nothing broke, where it breaks in the other at once.
    broken_kinds = {finding.kind for finding in findings if finding.state is State.BROKE}
    others = [
        finding.kind
        for finding in findings
        if finding.what == "made" and finding.state is State.OK and finding.kind not in broken_kinds
    ]
    if broke.what in ("made", "free space") and others:
        steps.append(
            f"or, if it is for models in {SPACE_WORDS[others[0]]} alone, have it say so: supports = {{'{others[0]}'}}"
        )
    if broke.hip is not None:
        steps += [
            "to ask it there yourself, with prints or in a debugger:",
            "  import numpy as np",
            "  from hapticeval import Scene, make_model, resolve",
            f'  scene = Scene(model=make_model("{TRIED_MODELS[broke.kind]}"))',
            f"  renderer = resolve({name!r})(scene)",
            f"  hip = np.array({list(broke.hip)})",
            "  renderer.reset(hip)",
            "  print(renderer.step(hip, 0.0 * hip, scene.sampling_time))",
        ]
    return steps


def exit_code(findings: list[ContractFinding]) -> int:
    """Return the command's exit code: 3 where the renderer broke, 1 where something is missing, and else 0."""
    states = {finding.state for finding in findings}
    return 3 if State.BROKE in states else int(State.MISSING in states)
