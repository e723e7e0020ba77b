"""Reset: the same way after a reset gives the same answers, to the bit or to what the renderer declares."""

from __future__ import annotations

import numpy as np

from hapticeval.phenomena.check import NOBODY, Check, Runs, required
from hapticeval.phenomena.decisions import NOTABLE_FORCE_SHARE, TELLING_SHARE
from hapticeval.phenomena.observed import Observed
from hapticeval.phenomena.sampling import farthest_standoff, worst_row
from hapticeval.phenomena.verdict import Finding, Metric, Outcome, not_applicable, undecided
from hapticeval.recordings.recording import Recording
from hapticeval.scene import Scene
from hapticeval.types import Array


def judge(runs: Runs, scene: Scene) -> Finding:
    """Compare the run with another one through the same object, to the bit or to what the renderer declares."""
    base, again = runs.observed(scene), required(runs.again)()
    rows = min(len(base), len(again))
    scatter = _believed_scatter(base)
    lengths_differ = len(base) != len(again)
    if any(scatter.values()):
        # The hand answers to what the renderer may scatter, and from there on is elsewhere.
        parted = np.flatnonzero(_apart(base, again, "hip", rows))
        if parted.size:
            rows, lengths_differ = int(parted[0]), False
    if rows == 0:
        return undecided("the hand of the second run is elsewhere from the start")
    differences = {name: _apart(base, again, name, rows) for name in ("ihip", "force")}
    # To the bit without a declared scatter: a reset that leaves nothing repeats every operation.
    exceeds = {name: differences[name] > scatter[name] for name in differences}
    differs = exceeds["ihip"] | exceeds["force"]
    named, name, unit = ("IHIP", "ihip", "m") if exceeds["ihip"].any() and not exceeds["force"].any() else FORCE_CHANNEL
    worst = worst_row(differences[name])
    metric = Metric(f"{named} after a reset less that before", float(differences[name][worst]), unit)
    ratio = _force_ratio(base.force[:rows], again.force[:rows])
    evidence: dict[str, object] = {
        **base.evidence_at(worst),
        "ihip_apart_m": float(differences["ihip"].max()),
        "force_apart_N": float(differences["force"].max()),
        "force_ratio": ratio,
    }
    if not differs.any() and not lengths_differ:
        how = "as nearly as the renderer declares" if any(scatter.values()) else "to the bit"
        message = f"after a reset the same way gives the same answers, {how}"
        return Finding(Outcome.PASS, message, metric, scatter[name], evidence)
    random = _unlike_each_other(runs, base, scatter)
    if random is not None:
        return Finding(Outcome.FAIL, random, metric, scatter[name], {**evidence, "cause": "random"})
    evidence |= {"cause": "left over", "first_tick": int(np.argmax(differs)) if differs.any() else rows}
    message = (
        f"a reset leaves something behind: the second run is off by up to {metric.value:.3g} {metric.unit}, "
        f"first at tick {evidence['first_tick']}"
    )
    if ratio is not None and abs(ratio - 1.0) > NOTABLE_FORCE_SHARE:
        message += (
            f", and on the whole {abs(1e2 * (ratio - 1.0)):.3g} per cent {'softer' if ratio < 1.0 else 'stiffer'}"
        )
    if lengths_differ:
        message += f"; it has {len(again)} ticks, and the first {len(base)}"
    return Finding(Outcome.FAIL, message, metric, scatter[name], evidence)


def _unlike_each_other(runs: Runs, base: Observed, scatter: dict[str, float]) -> str | None:
    """Return that two new renderers answer the same way differently, which no reset has left; None if they do not."""
    if runs.fresh is None:
        return None
    first, second = Observed(runs.fresh(1), base.scene), runs.fresh(2)
    rows = min(len(first), len(second))
    for name, channel_words, unit in (("force", "force", "N"), ("ihip", "IHIP", "m")):
        differences = _apart(first, second, name, rows)
        if (differences > scatter[name]).any():
            worst = worst_row(differences)
            difference, where = f"{differences[worst]:.3g} {unit}", first.time_and_hip(worst)
            renderers = f"the {channel_words} of two new renderers, asked the same,"
            return f"it is random: {renderers} is up to {difference} apart, at {where}"
    return None


FORCE_CHANNEL = ("force", "force", "N")


def _believed_scatter(base: Observed) -> dict[str, float]:
    """Return the declared scatter of IHIP (m) and force (N), as far as it is believed.

    A scatter of the IHIP beyond a fiftieth of the model, or of the force beyond a tenth of its largest, could hide
    anything that a reset leaves.
    """
    largest = float(np.max(base.force_size, initial=0.0))
    limits = {"ihip": farthest_standoff(base.scene), "force": TELLING_SHARE * largest}
    # What is declared beyond that is cut off there, and so fails where it is used.
    return {name: min(float(base.meta.get(f"{name}_scatter", 0.0)), limit) for name, limit in limits.items()}


def _apart(base: Observed, again: Recording, name: str, rows: int) -> Array:
    """Return how far a channel of the two runs is apart in each of the first `rows` rows; 0 where one lacks it."""
    if name not in base.channels or name not in again.channels:
        return np.zeros(rows)
    return np.asarray(np.linalg.norm(base.channels[name][:rows] - again.channels[name][:rows], axis=1))


def _force_ratio(first: Array, second: Array) -> float | None:
    """Return the second run's force as a share of the first's (least squares); None without a force."""
    square = float(np.sum(first**2))
    # g of second = g first: <f, s> / <f, f>
    return float(np.sum(first * second)) / square if square > 0.0 else None


CHECK = Check(
    id="reset-clears",
    phenomenon="none of the six: a property of the renderer's `reset`",
    formula="(ihip, force) of the second run = (ihip, force) of the first, row by row",
    citation="the renderer protocol: reset(hip) starts a run",
    channels=("hip", "force"),
    reads_also=("ihip",),
    siblings={
        "again": "the same stimulus once more through the same renderer",
        "fresh": "where that differs, through two new ones",
    },
    needs={"again": not_applicable(NOBODY)},
    not_with=(),
    metric="force, or IHIP, after a reset less that before",
    unit="N",
    judge=judge,
)
