"""What effects of the surface do to the force, a panel for each; and what they cost, beside an engine that tests flags.

A panel is drawn from the recording of a run whose scene calls for that effect of the surface alone.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hapticeval.effects.catalogue import make_effect
from hapticeval.effects.effect import Effect, Stage
from hapticeval.errors import HapticevalError
from hapticeval.geometry.model import Model
from hapticeval.recordings.recording import Recording, runs_of
from hapticeval.reports.canvas import MM, colour_of, figure, page_svg
from hapticeval.runner.results import ResultsDocument, RunEntry, VerdictEntry
from hapticeval.study.effects_cost import EffectsDocument, Ladder
from hapticeval.types import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# ruff: noqa: ARG001 - every panel has these arguments

WELCH_SAMPLES = 256
"""Samples of a segment of Welch's spectra."""

WORK_ROUNDING = 1e-9
"""Share of the work to and fro below which what is left of it after a lap is rounding."""

SECONDS_BEFORE, SECONDS_AFTER = 0.005, 0.12
"""Seconds before and after the start of a contact that are drawn of a transient."""

PANEL_WIDTH, PANEL_HEIGHT = 4.2, 3.0
"""Inches of a panel."""

PANEL_AREA = (0.18, 0.18, 0.79, 0.74)
"""Left, bottom, width and height of a panel's axes, as shares of the figure."""


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
    from hapticeval.phenomena.registry import CHECKS

    plots = []
    for number, (effect, run) in enumerate(effects_alone(results)):
        verdicts = results.verdicts_of.get(run.key, [])
        of_effect = [
            verdict for verdict in verdicts if verdict.check in CHECKS and effect.kind in CHECKS[verdict.check].effects
        ]
        words = effect.describe(turning=run.scene.device is not None and run.scene.device.turning)
        title = f"{words}: {run.renderer} in {run.suite}/{run.case}"
        try:
            svg = effect_svg(effect, *read_run(directory, run), prefix=f"e{number}", title=title)
        except HapticevalError as error:
            plots.append(EffectPlot(effect.kind, words, run, of_effect, problem=error.what))
        else:
            plots.append(EffectPlot(effect.kind, words, run, of_effect, svg))
    return plots


def effects_alone(results: ResultsDocument) -> list[tuple[Effect, RunEntry]]:
    """Return each effect of `PANELS` with the first recorded run whose scene calls for no other of the surface."""
    alone_by_kind: dict[str, tuple[Effect, RunEntry]] = {}
    for run in results.runs:
        if not run.scene.effects or run.refusal or run.recording is None:
            continue
        # Effects of device and sensors may be there as well: they belong to the robot.
        surface_effects = [effect for effect in map(make_effect, run.scene.effects) if effect.stage is Stage.ANSWER]
        if len(surface_effects) == 1 and surface_effects[0].kind in PANELS:
            alone_by_kind.setdefault(surface_effects[0].kind, (surface_effects[0], run))
    return list(alone_by_kind.values())


def read_run(directory: Path, run: RunEntry) -> tuple[Recording, Model]:
    """Read a run's recording, and make its model. Raises `InputError` as `read_recording` does."""
    from hapticeval.recordings.hdf5 import read_recording

    assert run.recording is not None
    recording = read_recording(directory / run.recording)
    return recording, run.build_model(recording)


def effect_svg(effect: Effect, recording: Recording, model: Model, *, prefix: str, title: str) -> str:
    """Return the panel of an effect as an SVG element for a page."""
    with figure(PANEL_WIDTH, PANEL_HEIGHT, page=True) as fig:
        draw_effect(fig.add_axes(PANEL_AREA), effect, recording, model)
        return page_svg(fig, prefix=prefix, title=title)


def draw_effect(axes: Axes, effect: Effect, recording: Recording, model: Model) -> None:
    """Draw what an effect of `PANELS` does in a recording."""
    PANELS[effect.kind](axes, recording, model, effect)
    axes.grid(True)


def sliding_motion(recording: Recording, model: Model) -> tuple[Array, Array, Array]:
    """Return how far a hand in contact has slid (n,), m, and the force along the surface and across it, (n,), N.

    The way is the sum of the hand's steps along the surface; its sense, and that of the force, is that of the first of
    them that counts.
    """
    normal = model.boundary.closest_point(recording.hip).normal
    steps = np.diff(recording.hip, axis=0, prepend=recording.hip[:1])
    # m: the step's part along the surface.
    steps -= np.sum(steps * normal, axis=1)[:, np.newaxis] * normal
    along = _sliding_directions(steps, normal)
    across = np.sum(recording.force * normal, axis=1)
    return np.cumsum(np.sum(steps * along, axis=1)), np.sum(recording.force * along, axis=1), across


def _sliding_directions(steps: Array, normal: Array) -> Array:
    """Return a unit vector along the surface at each row, (n, N), that turns with it and never reverses with the hand.

    In the plane it is the normal's right angle; in space the hand's largest step, carried along.
    """
    if normal.shape[1] == 2:
        # The normal turned by 90 degrees, forwards in the sense of the longest step.
        turned = np.column_stack([-normal[:, 1], normal[:, 0]])
        largest = int(np.argmax(np.linalg.norm(steps, axis=1)))
        return turned * (1.0 if steps[largest] @ turned[largest] >= 0.0 else -1.0)
    ahead = steps[int(np.argmax(np.linalg.norm(steps, axis=1)))]
    # The one direction projected onto each tangent plane, then normalised.
    carried = ahead - (normal @ ahead)[:, np.newaxis] * normal
    return np.asarray(carried / np.maximum(np.linalg.norm(carried, axis=1), 1e-300)[:, np.newaxis])


def contact_stretches(recording: Recording) -> list[tuple[int, int]]:
    """Return the first row of each stretch in which the renderer answers with a force, and the row after its last."""
    return list(runs_of(np.linalg.norm(recording.force, axis=1) > 0.0))


def work_on_hand(recording: Recording) -> Array:
    """Return the work that the force has done on the hand up to each sample, (n,), J, by the trapezoidal rule."""
    # W = sum of (F_k + F_k+1) / 2 . (x_k+1 - x_k), J.
    mean = 0.5 * (recording.force[1:] + recording.force[:-1])
    return np.append(0.0, np.cumsum(np.sum(mean * np.diff(recording.hip, axis=0), axis=1)))


def _draw_slip(axes: Axes, recording: Recording, model: Model, effect: Effect) -> None:
    """Draw the force along over that across, against how far the hand has slid: Coulomb friction is a constant."""
    travelled, along, across = sliding_motion(recording, model)
    # Friction is a ratio only where the surface is pressed.
    pressed = across > 0.0
    ratio = np.where(pressed, along / np.where(pressed, across, 1.0), np.nan)
    axes.plot(MM * travelled, ratio, color=colour_of("hip"))
    axes.set(xlabel="way of the hand along the surface (mm)", ylabel="force along over force across")


def _draw_drag(axes: Axes, recording: Recording, model: Model, effect: Effect) -> None:
    travelled, along, _ = sliding_motion(recording, model)
    axes.plot(MM * np.gradient(travelled, recording.time), along, color=colour_of("hip"))
    axes.set(xlabel="speed of the hand along the surface (mm/s)", ylabel="force along (N)")


def _draw_spectrum(axes: Axes, recording: Recording, model: Model, effect: Any) -> None:
    """Draw the spectrum of the steadiest force beside what the texture's filter has at the mean speed and force."""
    from scipy.signal import welch

    from hapticeval.effects.texture import power_spectrum

    # The longest contact, of which the first WELCH_SAMPLES are left to settle.
    first, end = max(contact_stretches(recording), key=lambda rows: rows[1] - rows[0], default=(0, 0))
    travelled, along, across = sliding_motion(recording, model)
    values = (across if effect.direction == "normal" else along)[first + WELCH_SAMPLES : end]
    if values.size < WELCH_SAMPLES:
        axes.annotate("too short a contact for a spectrum", (0.5, 0.5), xycoords="axes fraction", ha="center")
        return
    rate = 1.0 / recording.dt
    frequency, power = welch(values, fs=rate, nperseg=WELCH_SAMPLES)
    # m/s, over the same samples as the spectrum.
    speed = float(np.mean(np.abs(np.gradient(travelled, recording.time)[first + WELCH_SAMPLES : end])))
    # The filter makes accelerations, m/s²: force is mass times that, its power mass² times.
    model_power = effect.mass**2 * power_spectrum(
        effect.model.between(speed, float(np.mean(across[first + WELCH_SAMPLES : end]))), rate, frequency
    )
    for density, role, style, label in (
        (power, "hip", "-", f"the force, Welch of {WELCH_SAMPLES}"),
        (model_power, "ihip", (0, (4, 1.2)), "the texture's filter"),
    ):
        # The first entry is the mean, not a vibration.
        axes.plot(frequency[1:], 10.0 * np.log10(density[1:]), color=colour_of(role), linestyle=style, label=label)
    axes.set(xlabel="frequency (Hz)", ylabel="force (dB of 1 N²/Hz)")
    axes.legend(loc="upper right")


def _draw_work(axes: Axes, recording: Recording, model: Model, effect: Effect) -> None:
    """Draw the work over the laps that the hand does one after the other, with a mark at the end of each."""
    from hapticeval.phenomena.measures.closed_paths import laps

    work, hip = 1e3 * work_on_hand(recording), recording.hip
    first, period, number = next(iter(laps(hip, model.size)), (0, len(recording) - 1, 1))
    # Whole laps only, the closing sample included; the whole run where there is no lap.
    rows = slice(first, first + number * period + 1)
    travelled = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(hip[rows], axis=0), axis=1)))
    work = work[rows] - work[first]
    axes.plot(MM * travelled, work, color=colour_of("hip"))
    axes.plot(MM * travelled[::period], work[::period], "o", color=colour_of("mark"), markersize=4)
    # mJ: positive where the effect gives energy to the hand.
    a_lap = (work[-1] - work[0]) / number
    words = f"{a_lap:+.3g} mJ a lap" if abs(a_lap) > WORK_ROUNDING * np.ptp(work) else "nothing in a lap"
    axes.annotate(words, (1.0, 1.0), xycoords="axes fraction", ha="right", va="bottom")
    axes.set(xlabel="way of the hand (mm)", ylabel="work that the hand has got (mJ)")


def _draw_transient(axes: Axes, recording: Recording, model: Model, effect: Effect) -> None:
    """Draw the force and the depth round the beginning of a contact, against ms since then."""
    # The first contact whose beginning was recorded.
    contact_row = next((first for first, _ in contact_stretches(recording) if first > 0), 0)
    start = recording.time[contact_row]
    in_window = (recording.time >= start - SECONDS_BEFORE) & (recording.time <= start + SECONDS_AFTER)
    _, _, across = sliding_motion(recording, model)
    # m: 0 outside the model.
    depth = np.maximum(-model.boundary.closest_point(recording.hip).distance, 0.0)
    time = 1e3 * (recording.time[in_window] - start)
    axes.step(time, across[in_window], where="post", color=colour_of("hip"), label="force across")
    # Narrower, with room for the second axis on the right.
    axes.set_position((*PANEL_AREA[:2], 0.64, PANEL_AREA[3]))
    depth_axes = axes.twinx()
    depth_axes.plot(
        time, MM * depth[in_window], color=colour_of("ihip"), linestyle=(0, (4, 1.2)), label="depth of the hand"
    )
    depth_axes.set_ylabel("depth (mm)")
    depth_axes.spines["right"].set_visible(True)
    axes.set(xlabel="time since contact (ms)", ylabel="force across (N)")
    handles = [panel.get_legend_handles_labels() for panel in (axes, depth_axes)]
    axes.legend(handles[0][0] + handles[1][0], handles[0][1] + handles[1][1], loc="upper right")


PANELS: Mapping[str, Callable[[Axes, Recording, Model, Effect], None]] = {
    "friction": _draw_slip,
    "viscous-friction": _draw_drag,
    "lugre": _draw_slip,
    "height-map": _draw_work,
    "bump-map": _draw_work,
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
    with figure(6.4, 3.8, page=True) as fig:
        axes = fig.add_axes((0.12, 0.34, 0.86, 0.62))
        _draw_cost(axes, document.ladder)
        return page_svg(fig, prefix="ec", title="Time of an answer by the number of effects that a scene calls for")


def _draw_cost(axes: Axes, ladder: Ladder) -> None:
    """Draw the ns of an answer against the number of effects, composed and with flags that are tested."""
    counts = range(len(ladder.rungs))
    for times, role, marker, label in (
        # s an answer, with one effect more from rung to rung.
        ([rung.tested for rung in ladder.rungs], "ihip", "s", "an engine with all of them, which tests flags"),
        ([rung.composed for rung in ladder.rungs], "hip", "o", "composed of those called for"),
    ):
        axes.plot(
            counts,
            [1e9 * seconds for seconds in times],
            marker=marker,
            markersize=4,
            color=colour_of(role),
            label=label,
        )
    axes.set_xticks(list(counts), [f"+ {rung.kinds[-1]}" if rung.kinds else "none" for rung in ladder.rungs])
    axes.tick_params(axis="x", labelrotation=25.0)
    # Slanted names end at their tick.
    for text in axes.get_xticklabels():
        text.set(ha="right", rotation_mode="anchor")
    axes.set_ylabel("an answer (ns)")
    axes.set_ylim(bottom=0.0)
    axes.grid(True)
    axes.legend(loc="upper left")
