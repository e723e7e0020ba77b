"""What effects of the surface do to the force, a panel for each.

A panel is drawn from the recording of a run whose scene calls for that effect of the surface alone.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from hapticeval.effects.catalogue import make_effect
from hapticeval.effects.effect import Effect, Stage
from hapticeval.errors import HapticevalError
from hapticeval.geometry.model import Model
from hapticeval.recordings.recording import Recording, runs_of
from hapticeval.reports.canvas import MM
from hapticeval.reports.chart import Axis, Chart, Curve, charts_data
from hapticeval.runner.results import ResultsDocument, RunEntry, VerdictEntry
from hapticeval.types import Array

# ruff: noqa: ARG001 - every chart has these arguments

WELCH_SAMPLES = 256
"""Samples of a segment of Welch's spectra."""

WORK_ROUNDING = 1e-9
"""Share of the work to and fro below which what is left of it after a lap is rounding."""

SECONDS_BEFORE, SECONDS_AFTER = 0.005, 0.12
"""Seconds before and after the start of a contact that are drawn of a transient."""


@dataclass(frozen=True)
class EffectPlot:
    """One panel: the effect in words, the run that it shows, and the verdicts on that run that are about the effect."""

    kind: str
    words: str
    run: RunEntry
    verdicts: Sequence[VerdictEntry]
    data: str = ""
    problem: str = ""


def effect_plots(directory: Path, results: ResultsDocument) -> list[EffectPlot]:
    """Return a panel for each effect of the surface that a scene of the results calls for alone."""
    from hapticeval.phenomena.registry import CHECKS

    plots = []
    for effect, run in effects_alone(results):
        verdicts = results.verdicts_of.get(run.key, [])
        of_effect = [
            verdict for verdict in verdicts if verdict.check in CHECKS and effect.kind in CHECKS[verdict.check].effects
        ]
        words = effect.describe(turning=run.scene.device is not None and run.scene.device.turning)
        try:
            data = charts_data([effect_chart(effect, *read_run(directory, run))])
        except HapticevalError as error:
            plots.append(EffectPlot(effect.kind, words, run, of_effect, problem=error.what))
        else:
            plots.append(EffectPlot(effect.kind, words, run, of_effect, data))
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


def effect_chart(effect: Effect, recording: Recording, model: Model) -> Chart:
    """Return the chart of what an effect of `PANELS` does in a recording."""
    return PANELS[effect.kind](recording, model, effect)


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


def _slip(recording: Recording, model: Model, effect: Effect) -> Chart:
    """The force along over that across, against how far the hand has slid: Coulomb friction is a constant."""
    travelled, along, across = sliding_motion(recording, model)
    # Friction is a ratio only where the surface is pressed.
    pressed = across > 0.0
    ratio = np.where(pressed, along / np.where(pressed, across, 1.0), np.nan)
    return Chart(
        title="friction against the way of the hand",
        x=Axis(label="way of the hand along the surface (mm)"),
        y=Axis(label="force along over force across"),
        curves=[Curve(x=MM * travelled, y=ratio, role="hip")],
    )


def _drag(recording: Recording, model: Model, effect: Effect) -> Chart:
    travelled, along, _ = sliding_motion(recording, model)
    return Chart(
        title="drag against the speed of the hand",
        x=Axis(label="speed of the hand along the surface (mm/s)"),
        y=Axis(label="force along (N)"),
        curves=[Curve(x=MM * np.gradient(travelled, recording.time), y=along, role="hip")],
    )


def _spectrum(recording: Recording, model: Model, effect: Any) -> Chart:
    """The spectrum of the steadiest force beside what the texture's filter has at the mean speed and force."""
    from scipy.signal import welch

    from hapticeval.effects.texture import power_spectrum

    chart = Chart(
        title="spectrum of the force",
        x=Axis(label="frequency (Hz)"),
        y=Axis(label="force (dB of 1 N²/Hz)"),
        curves=[],
    )
    # The longest contact, of which the first WELCH_SAMPLES are left to settle.
    first, end = max(contact_stretches(recording), key=lambda rows: rows[1] - rows[0], default=(0, 0))
    travelled, along, across = sliding_motion(recording, model)
    values = (across if effect.direction == "normal" else along)[first + WELCH_SAMPLES : end]
    if values.size < WELCH_SAMPLES:
        return replace(chart, title="too short a contact for a spectrum")
    rate = 1.0 / recording.dt
    frequency, power = welch(values, fs=rate, nperseg=WELCH_SAMPLES)
    # m/s, over the same samples as the spectrum.
    speed = float(np.mean(np.abs(np.gradient(travelled, recording.time)[first + WELCH_SAMPLES : end])))
    # The filter makes accelerations, m/s²: force is mass times that, its power mass² times.
    model_power = effect.mass**2 * power_spectrum(
        effect.model.between(speed, float(np.mean(across[first + WELCH_SAMPLES : end]))), rate, frequency
    )
    lines = (
        (power, "hip", (), f"the force, Welch of {WELCH_SAMPLES}"),
        (model_power, "ihip", (6, 2), "the texture's filter"),
    )
    # The first entry is the mean, not a vibration.
    curves = [
        Curve(x=frequency[1:], y=10.0 * np.log10(density[1:]), role=role, dash=dash, label=label)
        for density, role, dash, label in lines
    ]
    return replace(chart, curves=curves)


def _work(recording: Recording, model: Model, effect: Effect) -> Chart:
    """The work over the laps that the hand does one after the other, with a mark at the end of each."""
    from hapticeval.phenomena.measures.closed_paths import laps

    work, hip = 1e3 * work_on_hand(recording), recording.hip
    first, period, number = next(iter(laps(hip, model.size)), (0, len(recording) - 1, 1))
    # Whole laps only, the closing sample included; the whole run where there is no lap.
    rows = slice(first, first + number * period + 1)
    travelled = MM * np.append(0.0, np.cumsum(np.linalg.norm(np.diff(hip[rows], axis=0), axis=1)))
    work = work[rows] - work[first]
    # mJ: positive where the effect gives energy to the hand.
    a_lap = (work[-1] - work[0]) / number
    words = f"{a_lap:+.3g} mJ a lap" if abs(a_lap) > WORK_ROUNDING * np.ptp(work) else "nothing in a lap"
    return Chart(
        title=f"work on the hand: {words}",
        x=Axis(label="way of the hand (mm)"),
        y=Axis(label="work that the hand has got (mJ)"),
        curves=[
            Curve(x=travelled, y=work, role="hip", label=words),
            Curve(x=travelled[::period], y=work[::period], role="mark", marker="o", line=False),
        ],
    )


def _transient(recording: Recording, model: Model, effect: Effect) -> Chart:
    """The force and the depth round the beginning of a contact, against ms since then."""
    # The first contact whose beginning was recorded.
    contact_row = next((first for first, _ in contact_stretches(recording) if first > 0), 0)
    start = recording.time[contact_row]
    in_window = (recording.time >= start - SECONDS_BEFORE) & (recording.time <= start + SECONDS_AFTER)
    _, _, across = sliding_motion(recording, model)
    # m: 0 outside the model.
    depth = np.maximum(-model.boundary.closest_point(recording.hip).distance, 0.0)
    time = 1e3 * (recording.time[in_window] - start)
    return Chart(
        title="force and depth since the beginning of a contact",
        x=Axis(label="time since contact (ms)"),
        y=Axis(label="force across (N)"),
        right=Axis(label="depth (mm)"),
        curves=[
            Curve(x=time, y=across[in_window], role="hip", label="force across", steps=True),
            Curve(x=time, y=MM * depth[in_window], role="ihip", dash=(6, 2), label="depth of the hand", right=True),
        ],
    )


PANELS: Mapping[str, Callable[[Recording, Model, Effect], Chart]] = {
    "friction": _slip,
    "viscous-friction": _drag,
    "lugre": _slip,
    "height-map": _work,
    "bump-map": _work,
    "stochastic-texture": _spectrum,
    "shading": _work,
    "contact-impulse": _transient,
    "contact-transient": _transient,
    "recorded-impulse": _transient,
}
"""What is drawn of an effect, by kind."""
