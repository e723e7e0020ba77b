"""The sphere's two charts along a run, in the manner of thesis Figures 7.6 to 7.8.

From the top, with a chart shaded where it is not the active one, and broken lines at the switches:

- distance from the surface and its rate (7.6)
- the coordinates of each chart (7.7)
- the torque of one joint by either chart (7.8)
"""

from __future__ import annotations

from typing import Any

import numpy as np

from hapticeval.geometry.model import Model
from hapticeval.quantity import plural
from hapticeval.recordings.recording import Recording, runs_of
from hapticeval.reports.canvas import MM
from hapticeval.reports.chart import Axis, Chart, Curve, Rule
from hapticeval.types import Array

FIGURE_JOINT = 1
"""The joint of Figure 7.8: the second."""

TORQUE_ROUNDING = 1e-9
"""Torques this share of the largest apart are the same: rounding makes less."""

CHART_HEIGHT = 170
"""Pixels of each chart on a page."""

DASHES = (6, 2)
"""Lengths of line and gap of the second curve of each."""

CHART_CHANNELS = ("chart", "eta1", "eta2", "torque1", "torque2")
"""What set stabilisation by an atlas records: the active chart, and coordinates and torques by either chart."""


def has_charts(recording: Recording) -> bool:
    """Return whether the renderer recorded charts, and a robot followed them."""
    return all(name in recording.channels for name in CHART_CHANNELS)


def charts_words(recording: Recording) -> str:
    """Describe how often the charts take turns, and how far apart their torques are."""
    time, chart = recording.time, recording.channels["chart"]
    # The largest torque difference of any joint at each sample (ticks,), N m.
    differences = np.max(np.abs(recording.channels["torque1"] - recording.channels["torque2"]), axis=1)
    largest = float(np.max(np.abs(recording.channels["joint_torque"])))
    # Negated <=, so that a torque that is not finite counts as disagreeing.
    disagreeing = np.flatnonzero(~(differences <= TORQUE_ROUNDING * largest))
    agreeing = np.delete(differences, disagreeing)
    words = [f"The charts take turns {plural(int(np.count_nonzero(np.diff(chart))), 'time')}."]
    if agreeing.size:
        words.append(f"Their torques agree to {float(agreeing.max()):.1g} N m, of {largest:.3g} N m at the most.")
    if not disagreeing.size:
        return " ".join([*words, "The chart that is not at work does not spike near its pole; in print it does."])
    angle = np.where(chart == 1.0, recording.channels["eta2"][:, 2], recording.channels["eta1"][:, 2])[disagreeing]
    # A chart is singular where its polar angle is 0 or pi: how far the idle one is from the nearer, at the most.
    pole = float(np.degrees(np.max(np.minimum(angle, np.pi - angle))))
    first, last = time[disagreeing[[0, -1]]]
    when = f"at t = {first:.4g} s" if disagreeing.size == 1 else f"between t = {first:.4g} and {last:.4g} s"
    words.append(
        f"Not so in {disagreeing.size} of {time.size} samples, {when}, with the chart that is not at work "
        f"within {pole:.2g}° of its own pole: there they are up to "
        f"{float(np.max(differences[disagreeing])):.3g} N m apart."
    )
    return " ".join(words)


def atlas_charts(recording: Recording, model: Model) -> list[Chart]:
    """Return the charts of the signals that set stabilisation by an atlas records, from the top."""
    time, chart = recording.time, recording.channels["chart"]
    frame = model.boundary.closest_point(recording.hip)
    # xi_2, the derivative of the distance: the velocity's part along the outward normal.
    rate = np.sum(recording.velocity * frame.normal, axis=1)
    switches = [Rule(x=float(switch), role="quiet", dash=(3, 2)) for switch in time[1:][np.diff(chart) != 0.0]]
    across = Axis(label="time (s)", tight=True)

    def curve(values: Array, role: str, label: str, **style: Any) -> Curve:
        """Return `values` (n,), mm or mm/s, over time as a curve."""
        return Curve(x=time, y=values, role=role, label=label, **style)

    distance = Chart(
        title="distance from the surface and its rate",
        x=across,
        y=Axis(label="distance (mm)"),
        right=Axis(label="rate (mm/s)"),
        curves=[
            curve(MM * frame.distance, "hip", "ξ₁, distance"),
            curve(MM * rate, "ihip", "ξ₂, its rate", dash=DASHES, right=True),
        ],
        rules=switches,
        height=CHART_HEIGHT,
    )
    coordinates = []
    for number in (1, 2):
        eta = np.degrees(recording.channels[f"eta{number}"])
        curves = [
            curve(eta[:, 0], "one", "t̂₁, around the axis"),
            curve(eta[:, 2], "two", "t̂₂, from the axis", dash=DASHES),
        ]
        # Shaded where the other chart is at work.
        shades = [(float(time[begin]), float(time[min(end, time.size - 1)])) for begin, end in runs_of(chart != number)]
        coordinates.append(
            Chart(
                title=f"coordinates of chart {number}",
                x=across,
                y=Axis(label=f"chart {number} (°)", range=(-190.0, 190.0)),
                curves=curves,
                rules=switches,
                shades=shades,
                height=CHART_HEIGHT,
            )
        )
    # What the motors really gave and a margin: a chart that spikes beside its own singularity is cut off.
    motor_torque = recording.channels["joint_torque"][:, FIGURE_JOINT]
    pad = 0.25 * max(np.ptp(motor_torque), 1e-3)
    torques = Chart(
        title="torque of the second joint by either chart",
        x=across,
        y=Axis(
            label=f"torque {FIGURE_JOINT + 1} (N m)",
            range=(float(motor_torque.min() - pad), float(motor_torque.max() + pad)),
        ),
        curves=[
            curve(recording.channels[f"torque{number}"][:, FIGURE_JOINT], role, f"by chart {number}", dash=dash)
            for number, role, dash in ((1, "hip", ()), (2, "ihip", DASHES))
        ],
        rules=switches,
        height=CHART_HEIGHT,
    )
    return [distance, *coordinates, torques]
