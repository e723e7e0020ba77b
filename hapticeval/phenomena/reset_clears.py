"""Reset clears: a run leaves nothing behind in the renderer that a `reset` does not clear."""

from __future__ import annotations

import numpy as np

from hapticeval.phenomena.check import Check, Runs
from hapticeval.phenomena.sampling import place
from hapticeval.phenomena.verdict import Finding, Metric, Outcome
from hapticeval.recordings.recording import Recording
from hapticeval.scene import Scene
from hapticeval.types import Array

CHANNELS = ("hip", "ihip", "force")

NOTABLE = 1e-6
"""Share by which the forces of two runs differ in size, and not in single ticks alone."""


def judge(runs: Runs, scene: Scene) -> Finding:  # noqa: ARG001
    """Compare the run with another one through the same object, to the bit or to what the renderer declares."""
    base = runs.base
    if runs.again is None:
        return Finding(Outcome.NOT_APPLICABLE, "a recording shows one run only, and nobody can be asked for another")
    again = runs.again()
    rows = min(len(base), len(again))
    hip, ihip, force = (_apart(base, again, name, rows) for name in CHANNELS)
    scatter = {name: float(base.meta.get(f"{name}_scatter", 0.0)) for name in ("ihip", "force")}
    off = (ihip > scatter["ihip"]) | (force > scatter["force"])
    if any(scatter.values()) and hip.any():
        off[np.argmax(hip > 0.0) :] = False  # the hand answers to what the renderer may scatter, and is elsewhere now
    if np.any(force > scatter["force"]) or not np.any(ihip > scatter["ihip"]):
        worst, metric = int(np.argmax(force)), Metric("force after a reset less that before", float(force.max()), "N")
        bound = scatter["force"]
    else:
        worst, metric = int(np.argmax(ihip)), Metric("IHIP after a reset less that before", float(ihip.max()), "m")
        bound = scatter["ihip"]
    ratio = _ratio(base, again, rows)
    evidence: dict[str, object] = {
        **place(base, worst),
        "ihip_apart_m": float(ihip.max()),
        "force_apart_N": float(force.max()),
        "force_ratio": ratio,
    }
    if not off.any() and len(base) == len(again):
        to = "as nearly as the renderer declares" if any(scatter.values()) else "to the bit"
        return Finding(
            Outcome.PASS, f"after a reset the same way gives the same answers, {to}", metric, bound, evidence
        )
    first = int(np.argmax(off)) if off.any() else rows
    evidence["first_tick"] = first
    message = (
        f"a reset leaves something behind: the second run is off by up to {metric.value:.3g} {metric.unit}, "
        f"first at tick {first}"
    )
    if ratio is not None and abs(ratio - 1.0) > NOTABLE:
        message += (
            f", and on the whole {abs(1e2 * (ratio - 1.0)):.3g} per cent {'softer' if ratio < 1.0 else 'stiffer'}"
        )
    if len(base) != len(again):
        message += f"; it has {len(again)} ticks, and the first {len(base)}"
    return Finding(Outcome.FAIL, message, metric, bound, evidence)


def _apart(base: Recording, again: Recording, name: str, rows: int) -> Array:
    """How far a channel of the two runs is apart in each of the first `rows` rows; 0 where one lacks it."""
    if name not in base.channels or name not in again.channels:
        return np.zeros(rows)
    return np.asarray(np.linalg.norm(base.channels[name][:rows] - again.channels[name][:rows], axis=1))


def _ratio(base: Recording, again: Recording, rows: int) -> float | None:
    """The second run's force as a share of the first's (least squares); None without a force."""
    first, second = base.force[:rows], again.force[:rows]
    square = float(np.sum(first**2))
    return float(np.sum(first * second)) / square if square > 0.0 else None


CHECK = Check(
    id="reset-clears",
    phenomenon="none of the six: a property of the renderer's `reset`",
    asks="Does the same way give the same answers again after a reset?",
    formula="(ihip, force) of the second run = (ihip, force) of the first, row by row",
    citation="the renderer protocol: reset(hip) starts a run",
    channels=("hip", "ihip", "force"),
    siblings="the same stimulus once more through the same renderer",
    metric="force, or IHIP, after a reset less that before",
    unit="N",
    bound=(
        "Nothing: the same arithmetic on the same numbers gives the same bits. A renderer whose answers scatter, "
        "as one with noise in it or with threads, declares by how much (`Declaration`), and is held to that; in a "
        "closed loop as long as the hand is where it was in the first run. The finding names the first tick that "
        "differs, the largest difference, and the second run's force as a share of the first's."
    ),
    judge=judge,
)
