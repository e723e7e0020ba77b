"""What effects of the surface do to the force, a panel for each; and what they cost, beside an engine that tests flags.

A panel is drawn from the recording of a run whose scene calls for that effect of the surface alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hapticeval.effects.catalogue import make_effect
from hapticeval.effects.effect import Effect, Stage
from hapticeval.errors import HapticevalError
from hapticeval.geometry.model import Model
from hapticeval.recordings.recording import Recording, runs_of
from hapticeval.reports.canvas import MM, drawn, figure, page_svg
from hapticeval.runner.results import ResultsDocument, RunEntry, VerdictEntry
from hapticeval.study.effects.document import EffectsDocument, Ladder
from hapticeval.types import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SEGMENT = 256
"""Samples of a segment of Welch's spectra."""

BEFORE, AFTER = 0.005, 0.12
"""Seconds before and after the start of a contact that are drawn of a transient."""

WIDTH, HEIGHT = 4.2, 2.6
PLACE = (0.15, 0.18, 0.82, 0.76)


@dataclass(frozen=True)
class EffectPlot:
    """One panel: the effect in words, the run that it shows, and the verdicts on that run that are about the effect."""

    kind: str
    words: str
    run: RunEntry
    verdicts: Sequence[VerdictEntry]
    svg: str = ""
    problem: str = ""


def effect_plots(directory: Path, results: ResultsDocument) -> list[EffectPlot]:
    """Return a panel for each effect of the surface that a scene of the results calls for alone."""
    return list(_plots(directory, results))


def _plots(directory: Path, results: ResultsDocument) -> Iterator[EffectPlot]:
    from hapticeval.geometry.catalogue import make_model
    from hapticeval.phenomena.registry import CHECKS
    from hapticeval.recordings.hdf5 import read_recording

    drawn_kinds: set[str] = set()
    for run in results.runs:
        effect = _alone(run)
        if effect is None or effect.kind in drawn_kinds or effect.kind not in PANELS or run.recording is None:
            continue
        about = [
            each
            for each in results.verdicts_of.get(run.key, [])
            if each.check in CHECKS and effect.kind in CHECKS[each.check].effects
        ]
        words = effect.describe(turning=run.scene.device is not None and run.scene.device.kind != "point-mass")
        drawn_kinds.add(effect.kind)
        try:
            recording = read_recording(directory / run.recording)
            model = make_model(run.model["kind"], **run.model_parameters)
            title = f"{words}: {run.renderer} in {run.suite}/{run.case}"
            svg = effect_svg(effect.kind, recording, model, prefix=f"e{len(drawn_kinds)}", title=title)
        except HapticevalError as error:
            yield EffectPlot(effect.kind, words, run, about, problem=error.what)
        else:
            yield EffectPlot(effect.kind, words, run, about, svg)


def _alone(run: RunEntry) -> Effect | None:
    """Return the effect of the surface that a run's scene calls for, where it is one."""
    if not run.scene.effects or run.error or run.refusal:
        return None
    found = [each for each in map(make_effect, run.scene.effects) if each.stage is Stage.ANSWER]
    return found[0] if len(found) == 1 else None


def effect_svg(kind: str, recording: Recording, model: Model, *, prefix: str, title: str) -> str:
    """Return the panel of an effect as an SVG element for a page."""
    with figure(WIDTH, HEIGHT, page=True) as made:
        axes = made.add_axes(PLACE)
        PANELS[kind](axes, recording, model)
        axes.grid(True)
        return page_svg(made, prefix=prefix, title=title)


def slip(recording: Recording, model: Model) -> tuple[Array, Array, Array]:
    """Return, of a hand in contact, its way along the surface (n,), m, and the force along it and across, (n,), N.

    The way is the sum of the hand's steps along the surface; its sense, and that of the force, is that of the first of
    them that counts.
    """
    normal = model.boundary.closest_point(recording.hip).normal
    steps = np.diff(recording.hip, axis=0, prepend=recording.hip[:1])
    steps -= np.sum(steps * normal, axis=1)[:, np.newaxis] * normal
    along = _directions(steps, normal)
    across = np.sum(recording.force * normal, axis=1)
    return np.cumsum(np.sum(steps * along, axis=1)), np.sum(recording.force * along, axis=1), across


def _directions(steps: Array, normal: Array) -> Array:
    """Return a unit vector along the surface at each row, (n, N), that turns with it and never reverses with the hand.

    In the plane it is the normal's right angle; in space the hand's largest step, carried along.
    """
    if normal.shape[1] == 2:
        turned = np.column_stack([-normal[:, 1], normal[:, 0]])
        largest = int(np.argmax(np.linalg.norm(steps, axis=1)))
        return turned * (1.0 if steps[largest] @ turned[largest] >= 0.0 else -1.0)
    ahead = steps[int(np.argmax(np.linalg.norm(steps, axis=1)))]
    carried = ahead - (normal @ ahead)[:, np.newaxis] * normal
    return np.asarray(carried / np.maximum(np.linalg.norm(carried, axis=1), 1e-300)[:, np.newaxis])


def contacts(recording: Recording) -> list[tuple[int, int]]:
    """Return the first and the last row but one of each stretch in which the renderer answers with a force."""
    return list(runs_of(np.linalg.norm(recording.force, axis=1) > 0.0))


def given(recording: Recording) -> Array:
    """Return the work that the hand has got of the force, (n,), J: the force times the hand's way, trapezoidal."""
    mean = 0.5 * (recording.force[1:] + recording.force[:-1])
    return np.append(0.0, np.cumsum(np.sum(mean * np.diff(recording.hip, axis=0), axis=1)))


def _draw_slip(axes: Axes, recording: Recording, model: Model) -> None:
    way, along, across = slip(recording, model)
    held = across > 0.0
    ratio = np.where(held, along / np.where(held, across, 1.0), np.nan)
    axes.plot(MM * way, ratio, color=drawn("hip"))
    axes.set(xlabel="way of the hand along the surface (mm)", ylabel="force along over force across")


def _draw_drag(axes: Axes, recording: Recording, model: Model) -> None:
    way, along, _ = slip(recording, model)
    axes.plot(MM * np.gradient(way, recording.time), along, color=drawn("hip"))
    axes.set(xlabel="speed of the hand along the surface (mm/s)", ylabel="force along (N)")


def _draw_spectrum(axes: Axes, recording: Recording, model: Model) -> None:
    from scipy.signal import welch

    longest = max(contacts(recording), key=lambda each: each[1] - each[0], default=(0, 0))
    rows = slice(*longest)
    _, along, across = slip(recording, model)
    for values, role, label in ((along, "hip", "along"), (across, "ihip", "across")):
        if longest[1] - longest[0] < 8 or not np.ptp(values[rows]) > 0.0:
            continue
        size = min(SEGMENT, longest[1] - longest[0])
        frequency, power = welch(values[rows], fs=1.0 / recording.dt, nperseg=size)
        axes.plot(frequency[1:], 10.0 * np.log10(np.maximum(power[1:], 1e-30)), color=drawn(role), label=label)
    axes.set(xlabel="frequency (Hz)", ylabel="force (dB of 1 N²/Hz)")
    axes.legend(loc="upper right")
    low, high = axes.get_ylim()
    axes.set_ylim(max(low, high - 120.0), high)


def _draw_work(axes: Axes, recording: Recording, model: Model) -> None:  # noqa: ARG001 - as every panel
    work = 1e3 * given(recording)
    way = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(recording.hip, axis=0), axis=1)))
    axes.plot(MM * way, work, color=drawn("hip"))
    axes.plot(MM * way[-1], work[-1], "o", color=drawn("mark"), markersize=4)
    axes.annotate(f"{work[-1]:+.3g} mJ ", (MM * way[-1], work[-1]), ha="right", va="bottom")
    axes.set(xlabel="way of the hand (mm)", ylabel="work that the hand has got (mJ)")


def _draw_transient(axes: Axes, recording: Recording, model: Model) -> None:
    begins = next((first for first, _ in contacts(recording) if first > 0), 0)
    start = recording.time[begins]
    shown = (recording.time >= start - BEFORE) & (recording.time <= start + AFTER)
    _, _, across = slip(recording, model)
    depth = np.maximum(-model.boundary.closest_point(recording.hip).distance, 0.0)
    time = 1e3 * (recording.time[shown] - start)
    axes.step(time, across[shown], where="post", color=drawn("hip"), label="force across")
    axes.set_position((*PLACE[:2], 0.72, PLACE[3]))
    beside = axes.twinx()
    beside.plot(time, MM * depth[shown], color=drawn("ihip"), linestyle=(0, (4, 1.2)), label="depth of the hand")
    beside.set_ylabel("depth (mm)")
    beside.spines["right"].set_visible(True)
    axes.set(xlabel="time since contact (ms)", ylabel="force across (N)")
    handles = [each.get_legend_handles_labels() for each in (axes, beside)]
    axes.legend(handles[0][0] + handles[1][0], handles[0][1] + handles[1][1], loc="lower right")


PANELS: Mapping[str, Callable[[Axes, Recording, Model], None]] = {
    "friction": _draw_slip,
    "viscous-friction": _draw_drag,
    "lugre": _draw_slip,
    "height-map": _draw_spectrum,
    "bump-map": _draw_spectrum,
    "stochastic-texture": _draw_spectrum,
    "shading": _draw_work,
    "contact-impulse": _draw_transient,
    "contact-transient": _draw_transient,
    "recorded-impulse": _draw_transient,
}
"""What is drawn of an effect, by kind."""


def cost_svg(document: EffectsDocument) -> str:
    """Return the cost of an answer by the number of effects called for, as an SVG element; "" without a ladder."""
    if document.ladder is None:
        return ""
    with figure(WIDTH, HEIGHT, page=True) as made:
        axes = made.add_axes(PLACE)
        _draw_cost(axes, document.ladder)
        return page_svg(made, prefix="ec", title="Time of an answer by the number of effects that a scene calls for")


def _draw_cost(axes: Axes, ladder: Ladder) -> None:
    counts = range(len(ladder.rungs))
    for times, role, marker, label in (
        ([each.tested for each in ladder.rungs], "ihip", "s", "an engine with all of them, which tests flags"),
        ([each.composed for each in ladder.rungs], "hip", "o", "composed of those called for"),
    ):
        axes.plot(counts, [1e9 * each for each in times], marker=marker, markersize=4, color=drawn(role), label=label)
    for count, rung in enumerate(ladder.rungs[1:], start=1):
        axes.annotate(
            rung.kinds[-1], (count, 1e9 * rung.composed), xytext=(2, -9), textcoords="offset points", fontsize=6.5
        )
    axes.set(xlabel="effects of the surface called for", ylabel="an answer (ns)", xticks=list(counts))
    axes.set_ylim(bottom=0.0)
    axes.margins(x=0.12)
    axes.grid(True)
    axes.legend(loc="upper left")
