"""What a stiffness that is off goes with: in words the plainest cause, for whoever mends it."""

from __future__ import annotations

from typing import Any

import numpy as np

from hapticeval.phenomena.decisions import (
    CAUSE_SHARE,
    END_SHARE,
    FINE_GROUPS,
    GROUP_SAMPLES,
    LAG_TICKS,
    RATIO_DIGITS,
    SPIKE_SHARE,
    TELLING_SHARE,
)
from hapticeval.phenomena.measures.stiffness import ApparentStiffness
from hapticeval.phenomena.observed import Observed
from hapticeval.phenomena.sampling import mm, newtons, worst_row
from hapticeval.quantity import format_number
from hapticeval.scene import Scene
from hapticeval.types import Array, BoolArray, IntArray


def describe_pattern(base: Observed, measured: ApparentStiffness, deviates: BoolArray) -> tuple[str, dict[str, Any]]:
    """Return what the deviations go with, in words, and the numbers that show it."""
    ticks, numbers = measured.ticks[deviates], {"share_off": float(deviates.mean())}
    if measured.begins[deviates].all():
        largest = float(np.linalg.norm(base.force[ticks], axis=1).max())
        return f"a kick where the contact begins or ends: up to {newtons(largest)}", numbers | {"kicks": ticks.size}
    inner = measured.rows(~measured.begins)
    deviates = deviates[~measured.begins]
    constant = _low_pass_constant(base, inner.ticks)
    if constant is not None:
        filtered = f"it comes late by {1e3 * constant:.3g} ms, as behind a low-pass filter"
        return filtered, numbers | {"low_pass_ms": 1e3 * constant}
    damping = _fit_damper(base.scene, inner)
    if damping is not None:
        damped = f"it is damped by {damping:.3g} N s/m, where the scene has K_d = {base.scene.damping:g} N s/m"
        return damped, numbers | {"damping_N_s_m": damping}
    # The plainest cause first: a missing force, then what goes with direction, depth, time or place.
    quiet = _describe_missing_force(base, inner, deviates)
    if quiet is not None:
        return quiet, numbers
    limit = _limit_of_force(base, inner.rows(deviates))
    if limit is not None:
        return f"it levels off at {newtons(limit)}, however deep the hand is", numbers | {"limit_N": limit}
    middle = float(np.median(inner.ratio))
    # The same everywhere: the spread is small beside the deviation.
    uniform = np.max(np.abs(inner.ratio - middle)) <= CAUSE_SHARE * abs(middle - 1.0)
    medians, explained = _explain_by_causes(base, inner, GROUP_SAMPLES)
    if max(explained.values()) < CAUSE_SHARE and inner.ticks.size >= FINE_GROUPS * GROUP_SAMPLES:
        explained = _explain_by_causes(base, inner, FINE_GROUPS)[1]
    # Rounded, so that of causes that explain alike the first counts.
    cause = max(explained, key=lambda name: round(explained[name], 2))
    if deviates.mean() <= SPIKE_SHARE and (uniform or explained[cause] < CAUSE_SHARE):
        return _describe_stretches(base, inner.ticks[deviates]), numbers | {"spikes": ticks.size}
    numbers |= {f"share_{key}": share for key, share in medians.items()}
    if uniform and middle < 0.0:
        return f"it pulls where it should push, {format_number(abs(middle), 3)} times as hard", numbers
    if uniform:
        percent = abs(1e2 * (middle - 1.0))
        return f"{'stiffer' if middle > 1.0 else 'softer'} throughout, by {format_number(percent, 3)} per cent", numbers
    if explained[cause] < CAUSE_SHARE:
        return "it scatters", numbers
    if cause in ("time", "place") and abs(explained["time"] - explained["place"]) <= TELLING_SHARE:
        along_path = "it changes along the way, with time or with the place, which this path does not tell apart"
        return f"{along_path} ({_describe_extremes(base, inner)})", numbers
    # No drift, where it ends as it began: the difference is small beside the spread of nine tenths of the samples.
    low, high = np.percentile(inner.ratio, (5, 95))
    if cause == "time" and abs(medians["first"] - medians["last"]) <= CAUSE_SHARE * (high - low):
        return _describe_stretches(base, inner.ticks[deviates]), numbers
    if cause == "place":
        return f"it depends on the place ({_describe_extremes(base, inner)})", numbers
    first_side, second_side, verb = {
        "direction": ("inwards", "outwards", "depends on the"),
        "depth": ("shallow", "deep", "depends on the"),
        "time": ("first", "last", "drifts with"),
    }[cause]
    first, second = medians[first_side], medians[second_side]
    return (
        f"it {verb} {cause} ({first:.3g} of the scene's stiffness {SIDES[first_side]}, {second:.3g} "
        f"{SIDES[second_side]})",
        numbers,
    )


def _limit_of_force(base: Observed, deviating: ApparentStiffness) -> float | None:
    """Return the force, N, at which it stays where it is too soft, as that of a motor at its limit; None where none is.

    There the depth varies by a hundredth or more of the largest, and the force by a tenth of that share at the most.
    """
    if deviating.ticks.size < GROUP_SAMPLES or deviating.ratio.max() >= 1.0:
        return None
    sizes = np.linalg.norm(base.force[deviating.ticks], axis=1)
    depth_spread = float(np.ptp(deviating.depth) / deviating.depth.max())
    levels_off = np.ptp(sizes) <= TELLING_SHARE * depth_spread * sizes.max()
    return float(sizes.max()) if depth_spread > TELLING_SHARE**2 and levels_off else None


def _fit_damper(scene: Scene, measured: ApparentStiffness) -> float | None:
    """Return the damper b (N s/m), above the scene's, of a force max(K d + b d', 0), d' being the rate of the depth d.

    By least squares, where the force pushes at all. None where more than a tenth of |F - K d|^2 is left by that, or in
    ticks without a force; and for a smaller b, which a force that comes late looks like.
    """
    pushes = measured.ratio > 0.0
    spring, rate = scene.stiffness * measured.depth, measured.rate
    unexplained = ((measured.ratio - 1.0) * spring - scene.damping * rate)[pushes]
    power, common = float(np.sum(rate[pushes] ** 2)), float(np.sum(unexplained * rate[pushes]))
    if common <= 0.0:
        return None
    # At the best b' = common / power what is left of it, less b' d', is |unexplained|^2 - common^2 / power.
    damping = scene.damping + common / power
    missing = np.maximum(spring + damping * rate, 0.0)[~pushes]
    residual = float(np.sum(unexplained**2)) - common**2 / power + float(np.sum(missing**2))
    return damping if residual <= TELLING_SHARE * float(np.sum(unexplained**2)) else None


def _low_pass_constant(base: Observed, ticks: IntArray) -> float | None:
    """Return the time constant T (s) of a low-pass filter F + T F' = s behind which the force is the spring's s.

    By least squares over `ticks` (n,). None where that leaves more than a tenth of |s - F|^2, and without an IHIP.
    """
    if "ihip" not in base.channels:
        return None
    ticks = ticks[np.isin(ticks - 1, ticks)]
    missing = base.scene.stiffness * (base.ihip[ticks] - base.hip[ticks]) - base.force[ticks]
    change = (base.force[ticks] - base.force[ticks - 1]) / base.dt
    power, common = float(np.sum(change**2)), float(np.sum(missing * change))
    # |s - F - T F'|^2 at the T that makes it least is |s - F|^2 less common^2 / power.
    if common <= 0.0 or common**2 < (1.0 - TELLING_SHARE) * power * float(np.sum(missing**2)):
        return None
    return common / power


SIDES = {
    "inwards": "on the way in",
    "outwards": "on the way out",
    "shallow": "at little depth",
    "deep": "deep inside",
    "first": "at first",
    "last": "in the end",
}
"""Words for the samples of which medians are compared."""


def _explain_by_causes(
    base: Observed, measured: ApparentStiffness, count: int
) -> tuple[dict[str, float], dict[str, float]]:
    """Return medians of the stiffness on both sides of what it may go with, and the share that each explains.

    Depths, times and places are divided into `count` groups.
    """
    time = base.time[measured.ticks]
    shallow, deep = _ends_of(measured.depth)
    first, last = _ends_of(time)
    sides = {
        "inwards": measured.rate > 0.0,
        "outwards": measured.rate < 0.0,
        "shallow": shallow,
        "deep": deep,
        "first": first,
        "last": last,
    }
    medians = {name: _median(measured.ratio, rows) for name, rows in sides.items()}
    both_ways = np.isfinite(medians["inwards"] - medians["outwards"])
    groups = {
        "depth": _rank_groups(measured.depth, count),
        "time": _rank_groups(time, count),
        "place": _place_groups(base.ihip[measured.ticks], count) if "ihip" in base.channels else None,
    }
    # At one depth the hand goes neither in nor out: these samples show nothing of the direction.
    moving = measured.rate != 0.0
    explained = {
        "direction": _explained_share(measured.ratio[moving], measured.rate[moving] > 0.0) if both_ways else 0.0
    }
    explained |= {
        name: 0.0 if group is None else _explained_share(measured.ratio, group) for name, group in groups.items()
    }
    return medians, explained


def _ends_of(values: Array) -> tuple[BoolArray, BoolArray]:
    """Return which of `values` (n,) are the smallest tenth, and which the largest, of equal ones the first: (n,) each.

    `GROUP_SAMPLES` at least, where there are as many.
    """
    ends = np.zeros((2, values.size), dtype=bool)
    count = max(int(END_SHARE * (values.size - 1)) + 1, GROUP_SAMPLES)
    for end, key in zip(ends, (values, -values), strict=True):
        end[np.argsort(key, kind="stable")[:count]] = True
    return ends[0], ends[1]


def _describe_missing_force(base: Observed, measured: ApparentStiffness, deviates: BoolArray) -> str | None:
    """Return words for a force that is missing: up to a depth, or for stretches of time; None where it is there."""
    # A force that is small with its depth, and larger than the spring's, is not missing.
    silent = ~base.pressed[measured.ticks] & (measured.ratio < 1.0)
    if not (silent & deviates).any():
        return None
    depths = measured.depth
    if "ihip" in base.channels and base.apart.any():
        depths = np.linalg.norm(base.hip - base.ihip, axis=1)[measured.ticks]
    depth = float(depths[silent].max())
    # All that is silent is shallower than all that is not: a dead band.
    if depth <= float(depths[~silent].min(initial=np.inf)):
        gives = newtons(base.scene.stiffness * depth)
        return f"a dead band: no force up to a depth of {mm(depth)}, where the spring gives {gives}"
    if np.mean(silent[deviates]) < CAUSE_SHARE:
        return None
    ticks = measured.ticks[silent]
    longest, others_note = _longest_run(ticks)
    return f"no force {_describe_stretch(base, longest)}{others_note}"


def _describe_stretches(base: Observed, ticks: IntArray) -> str:
    """Return words for ticks that are off: spikes, where none lasts for longer than a lag, else a stretch."""
    longest, others_note = _longest_run(ticks)
    if longest.size > LAG_TICKS:
        return f"off {_describe_stretch(base, longest)}{others_note}"
    return f"spikes: {ticks.size} tick{'s' if ticks.size > 1 else ''} off{_describe_period(ticks)}"


def _describe_period(ticks: IntArray) -> str:
    """Return words for ticks (n,) that come every so many: their gaps differ by a tenth of the mean at the most."""
    gaps = np.diff(ticks)
    regular = gaps.size > 1 and gaps.mean() > 1.0 and np.ptp(gaps) <= TELLING_SHARE * gaps.mean()
    return f", every {round(gaps.mean())} ticks" if regular else ""


def _longest_run(ticks: IntArray) -> tuple[IntArray, str]:
    """Return the longest run of consecutive ticks, and words for that there are others."""
    stretches = np.split(ticks, np.flatnonzero(np.diff(ticks) > 1) + 1)
    period = _describe_period(np.array([stretch[0] for stretch in stretches]))
    others = f", the longest of {len(stretches)} such stretches{period}" if len(stretches) > 1 else ""
    return max(stretches, key=len), others


def _describe_stretch(base: Observed, ticks: IntArray) -> str:
    hand = f"with the hand round {mm(*base.hip[ticks].mean(axis=0))}"
    start, end = (f"{base.time[tick]:.4g} s" for tick in ticks[[0, -1]])
    if ticks.size == 1:
        return f"in the tick at t = {start}, {hand}"
    return f"for {ticks.size} ticks from t = {start} to {end}, {hand}"


def _describe_extremes(base: Observed, measured: ApparentStiffness) -> str:
    """Return words for where the stiffness is least and where it is largest."""
    group = _place_groups(base.ihip[measured.ticks], GROUP_SAMPLES)
    medians = np.array([np.median(measured.ratio[group == number]) for number in range(group.max() + 1)])
    words = []
    for number in (worst_row(-medians), worst_row(medians)):
        rows = measured.ticks[group == number]
        words.append(f"{medians[number]:.3g} of the scene's stiffness round {mm(*base.ihip[rows].mean(axis=0))}")
    return ", ".join(words)


def _rank_groups(values: Array, count: int) -> IntArray:
    """Return the group, of so many, of each value (n,): as many values in each, equal ones in one."""
    edges = np.quantile(values, np.linspace(0.0, 1.0, count + 1)[1:-1])
    return np.searchsorted(edges, values)


def _place_groups(points: Array, count: int) -> IntArray:
    """Return the group, of up to so many, of each point (n, N): the longest is halved across until there are enough."""
    group = np.zeros(len(points), dtype=np.int64)
    for number in range(1, count):
        spans = [float(np.ptp(points[group == other], axis=0).max()) for other in range(number)]
        if max(spans) == 0.0:
            break
        rows = np.flatnonzero(group == int(np.argmax(spans)))
        along = points[rows, int(np.argmax(np.ptp(points[rows], axis=0)))]
        # The longest group is cut in the middle of its longest side.
        group[rows[along > 0.5 * (along.min() + along.max())]] = number
    return group


def _explained_share(ratio: Array, group: IntArray) -> float:
    """Return the share of the variance of the ranks of `ratio` (n,) that groups (n,) explain, 0 to 1.

    Ranks, for a ratio may be of any size where the depth is next to nothing.
    """
    # 1 - (variance within the groups) / (variance of all), of ranks
    ranks = np.unique(np.round(ratio, RATIO_DIGITS), return_inverse=True)[1]
    group = np.unique(group, return_inverse=True)[1]
    count = np.bincount(group)
    means = np.bincount(group, ranks) / count
    variance = float(np.var(ranks))
    return float(np.var(means[group])) / variance if variance > 0.0 else 0.0


def _median(ratio: Array, where: BoolArray) -> float:
    return float(np.median(ratio[where])) if int(where.sum()) >= GROUP_SAMPLES else float("nan")
