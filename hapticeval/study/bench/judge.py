"""What follows from a bench's numbers, and all of it in words: fronts, orders, the cheapest setting, what changed."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import Literal

import numpy as np
from msgspec.structs import replace

from hapticeval import quantity
from hapticeval.errors import in_mm
from hapticeval.study.bench.document import (
    QUIET_RATIO,
    TICK,
    Answer,
    BenchResults,
    Change,
    OrderEntry,
    SettingEntry,
    Times,
)

WITHIN, BUDGET = 1e-4, 1e-5  # the question that is always answered: 0.1 mm within 10 us
ALIKE_SHARE = 0.05  # share by which two times of one bench may differ by luck
ERROR_WORTH = 1e-6  # errors are not random: they have changed where they differ by more than this share
TIME_WORTH = 0.10
"""A ratio of times closer to one than this is no change: two benches of the same code reached 0.03."""


def judge_bench(results: BenchResults, *, within: float | None = None, budget: float | None = None) -> BenchResults:
    """Add fronts, orders and answers to the results of a sweep.

    Fronts and answers are among settings on one model whose errors count from one reference: others have no winner.
    Errors are the largest of the IHIP, over all contact that was measured, as far as they are proven. `within` (m) and
    `budget` (s) replace the question that is always answered. Times are medians: what lies far above is the machine's.
    """
    on_front: set[str] = set()
    answers = []
    # A tolerance of the user's own without a budget has none: the budget belongs to the question that is always asked.
    tolerance, limit = within or WITHIN, budget or (BUDGET if within is None else math.inf)
    for model, settings in results.by_model().items():
        # A model without any error still has its answer: no setting.
        references = list(dict.fromkeys(setting.reference for setting in settings if setting.claims)) or [None]
        for reference in references:
            usable = [
                (setting, setting.step.median, setting.claims["ihip"]["max"])
                for setting in settings
                if setting.claims is not None and setting.reference == reference and setting.step is not None
            ]
            medians, claims = [median for _, median, _ in usable], [claim for *_, claim in usable]
            on_front.update(usable[index][0].key for index in pareto_front(medians, claims))
            best = cheapest_setting(medians, claims, within=tolerance, budget=limit)
            entry = None if best is None else usable[best][0]
            answers.append(
                Answer(
                    model=model,
                    within_m=tolerance,
                    budget_s=limit if math.isfinite(limit) else None,
                    key=None if entry is None else entry.key,
                    label=None if entry is None else entry.label,
                    reference=reference,
                )
            )
    settings = [replace(setting, front=setting.key in on_front) for setting in results.settings]
    return replace(results, settings=settings, answers=answers, orders=list(convergence_orders(results.settings)))


def describe_missed(
    results: BenchResults, *, within: float, budget: float | None = None, together: bool = False
) -> Iterator[str]:
    """Yield a sentence for each renderer that was measured now, and each model on which no setting of it will do.

    With `together` one for each model on which no setting of any renderer will do. A setting will do where its IHIP
    error is at most `within` (m) and its single step takes at most `budget` (s). A renderer whose every setting was
    refused, or broke, is passed over.
    """
    will_do: dict[tuple[str, str], bool] = {}
    for setting in results.settings:
        if not setting.kept and setting.problem is None:
            good = (
                setting.claims is not None
                and setting.claims["ihip"]["max"] <= within
                and setting.step is not None
                and setting.step.median <= (budget or math.inf)
            )
            key = "any renderer" if together else setting.renderer, setting.model
            will_do[key] = will_do.get(key, False) or good
    for (renderer, model), good in will_do.items():
        if not good:
            yield f"no setting of {renderer} on the {model} meets --within"


def convergence_orders(settings: Sequence[SettingEntry]) -> Iterator[OrderEntry]:
    """Yield the order of each error by each knob, from the proven errors of settings that differ in that knob alone."""
    groups: dict[tuple[str, str, str, tuple[tuple[str, float], ...]], list[SettingEntry]] = {}
    for setting in settings:
        for knob in setting.settings if setting.proven else ():
            # Settings with the other knobs equal form one series of refinements.
            other_knobs = tuple((name, value) for name, value in setting.settings.items() if name != knob)
            groups.setdefault((setting.renderer, setting.model, knob, other_knobs), []).append(setting)
    for (renderer, model, knob, other_knobs), group in groups.items():
        values, errors = [setting.settings[knob] for setting in group], [setting.errors or {} for setting in group]
        order_by_metric = {
            metric: convergence_order(values, [error[metric]["rms"] for error in errors]) for metric in errors[0]
        }
        if any(value is not None for value in order_by_metric.values()):
            yield OrderEntry(
                renderer=renderer,
                model=model,
                knob=knob,
                others=dict(other_knobs),
                values=values,
                orders=order_by_metric,
            )


def describe_unproven(results: BenchResults) -> Iterator[str]:
    """Yield a sentence for each renderer and model whose reference has not converged far enough to prove the errors."""
    for reference in results.references:
        measured = [setting for setting in results.by_model().get(reference.model, []) if not setting.problem]
        measured = [setting for setting in measured if setting.renderer == reference.renderer]
        refused = [setting for setting in measured if setting.proven is False]
        name = f"{reference.renderer} on the {reference.model}"
        if reference.what is None and measured:
            yield f"{name}: no error is measured: it has no exact form, and no knob to refine it by"
        elif refused and reference.disagreement is not None:
            apart = reference.disagreement["ihip"]["max"]
            back = (setting.label.removeprefix(setting.renderer).strip() or "its one setting" for setting in refused)
            yield (
                f"{name}: the reference ({reference.what}) has not converged far enough: its last refinement still "
                f"moves the IHIP by {apart:.2g} m, so no setting is called more accurate than {10.0 * apart:.2g} m "
                f"(held back: {', '.join(back)})"
            )


def pareto_front(times: Sequence[float], errors: Sequence[float]) -> list[int]:
    """Return the indices of settings that none beats in both time and error, from the quickest to the most accurate.

    Of settings that are equal in both the first counts. Settings with a number that is not finite never do.
    """
    # By time: each setting that is more accurate than all quicker ones is on the front.
    order = sorted(range(len(times)), key=lambda index: (times[index], errors[index], index))
    best, front_indices = np.inf, []
    for index in order:
        if np.isfinite(times[index]) and errors[index] < best:
            best = errors[index]
            front_indices.append(index)
    return front_indices


def cheapest_setting(
    times: Sequence[float], errors: Sequence[float], *, within: float, budget: float = math.inf
) -> int | None:
    """Return the setting with the least time, at most `budget`, whose error is at most `within`; None if there is none.

    Times within `ALIKE_SHARE` of the least count as equal: of those the most accurate wins, then the first.
    """
    good = [index for index, error in enumerate(errors) if error <= within and times[index] <= budget]
    shortest = min((times[index] for index in good), default=np.inf)
    # Times that differ by less than luck are equal: accuracy decides between them.
    alike = [index for index in good if times[index] <= shortest * (1.0 + ALIKE_SHARE)]
    return min(alike, key=lambda index: (errors[index], index), default=None)


def convergence_order(values: Sequence[float], errors: Sequence[float]) -> float | None:
    """Return the observed order of convergence: the slope of log error against log refinement, positive if it falls.

    `values` of a knob go from coarse to fine, in whatever direction. None for fewer than three different values with
    a positive error.
    """
    # A logarithm is taken of both.
    usable = [(value, error) for value, error in zip(values, errors, strict=True) if error > 0.0 and value > 0.0]
    if len({value for value, _ in usable}) < 3:
        return None
    # log |h / h0| grows with the refinement, whether a knob counts cells or measures their size.
    refinement = np.abs(np.log([value / usable[0][0] for value, _ in usable]))
    slope = np.polyfit(refinement, np.log([error for _, error in usable]), 1)[0]
    # error = C h^p has the slope -p against the refinement.
    return float(-slope)


length, duration = partial(quantity.format_length, micro="u"), partial(quantity.format_duration, micro="u")
"""On a terminal, units are spelt as options take them."""

TAIL = "99%"
"""The column of a step's time that a busy machine decides: left out where it was not quiet."""

SETTING_COLUMNS: Mapping[str, Callable[[SettingEntry], str | None]] = {
    "": lambda setting: "*" if setting.front else "",
    "setting": lambda setting: setting.label,
    "IHIP worst": lambda setting: (
        ("~" if setting.proven is False else "") + length(setting.claims["ihip"]["max"]) if setting.claims else None
    ),
    # The hand there: a renderer may be off at one edge or jump alone.
    "at": lambda setting: in_mm(round(x, 4) for x in setting.worst_at) if setting.worst_at else None,
    "normal 99%": lambda setting: f"{setting.claims['normal']['p99']:.2g} deg" if setting.claims else None,
    "force 99%": lambda setting: f"{setting.claims['force']['p99']:.2g} N" if setting.claims else None,
    "step median": lambda setting: duration(setting.step.median) if setting.step else None,
    TAIL: lambda setting: duration(setting.step.p99) if setting.step else None,
    "of tick": lambda setting: (
        f"{quantity.format_number(100 * setting.step.median / TICK, 2)} %" if setting.step else None
    ),
    "memory": lambda setting: None if setting.memory_bytes is None else quantity.format_size(setting.memory_bytes),
    # The shortest of several builds: the others waited for the machine.
    "mesh": lambda setting: duration(min(setting.mesh_seconds)) if setting.mesh_seconds else None,
    "build": lambda setting: duration(min(setting.build_seconds)) if setting.build_seconds else None,
}
"""The columns of a table of settings; what is not known is None, and a column of that alone is left out."""

ORDERS = {"ihip": "IHIP", "normal": "normal", "force": "force"}


def describe(results: BenchResults) -> str:
    """Describe a bench for the terminal: tables, orders, the answers, and the comparison."""
    left_out, earlier = results.left_out(), sum(setting.kept for setting in results.settings)
    parts = [
        *_tables(results),
        "\n".join(_orders(results)),
        "\n".join(describe_unproven(results)),
        "\n".join(_in_compiled_loops(results)),
        _noise_words(results.empty),
        "\n".join(["Not measured:", *(f"   {sentence}" for sentence in left_out)]) if left_out else "",
        "\n".join(_answers(results)),
        "\n".join(_comparison(results.comparison)),
        f"{len(results.settings)} settings in {results.timing['wall_seconds']:.3g} s, {results.rounds} rounds of timing"
        + (f"; {earlier} of them kept from an earlier bench" if earlier else "")
        + ("" if results.complete else f"; incomplete: {results.reason}"),
    ]
    return "\n\n".join(part for part in parts if part)


def _tables(results: BenchResults) -> Iterator[str]:
    for model, settings in results.by_model().items():
        measured = [setting for setting in settings if not setting.problem]
        cells = {title: cell for title, cell in SETTING_COLUMNS.items() if results.is_quiet or title != TAIL}
        columns = {title: [cell(setting) for setting in measured] for title, cell in cells.items()}
        # A column that no setting fills, such as meshes in the plane, is left out.
        filled = {title: cells for title, cells in columns.items() if any(cell is not None for cell in cells)}
        if not filled:
            continue
        rows = [["-" if cell is None else cell for cell in row] for row in zip(*filled.values(), strict=True)]
        head = f"{model} (* on the Pareto front of its reference, ~ an upper bound: not proven)"
        yield "\n".join([head, *quantity.align_columns([list(filled), *rows], left=2)])


def _in_compiled_loops(results: BenchResults) -> Iterator[str]:
    """Say of shared libraries that their steps are timed as closed loops call them, without Python."""
    for label in dict.fromkeys(entry.label for entry in results.settings if entry.renderer.startswith("lib:")):
        yield f"steps of {label} are timed in a compiled loop, as closed loops call them: no Python is in them"


def _orders(results: BenchResults) -> Iterator[str]:
    for entry in results.orders:
        orders = ", ".join(f"{ORDERS[name]} {value:.2f}" for name, value in entry.orders.items() if value is not None)
        yield f"order of convergence, {entry.renderer} on the {entry.model} by {entry.knob}: {orders}"


def _answers(results: BenchResults) -> Iterator[str]:
    by_key = {setting.key: setting for setting in results.settings}
    references = Counter(answer.model for answer in results.answers)
    for answer in results.answers:
        budget = f" within {duration(answer.budget_s)}" if answer.budget_s else ""
        words = "no setting"
        if answer.key is not None:
            entry = by_key[answer.key]
            claims, took = entry.claims, entry.step
            # Errors are those that the reference proves.
            if claims is not None and took is not None:
                error, median = length(claims["ihip"]["max"]), duration(took.median)
                tail = f", 99 % of steps in {duration(took.p99)}" if results.is_quiet else ""
                words = f"{answer.label} ({error} in {median}{tail})"
        reference = f", off from {answer.reference}" if references[answer.model] > 1 else ""
        yield f"{answer.model}{reference}, {length(answer.within_m)}{budget}: {words}"
    for model, count in references.items():
        if count > 1:
            yield (
                f"On the {model} errors count from {count} references, and settings are compared only where they share "
                "one: no renderer is the winner over the others."
            )


def _noise_words(empty: Times | None) -> str:
    """Say what a call costs that does nothing: a front tells no times apart that differ by less."""
    if empty is None:
        return ""
    return (
        f"a call that does nothing takes {duration(empty.median)}, and 99 % of them at most {duration(empty.p99)}: "
        "that is in every step, and times that differ by less are the same"
        + ("" if empty.p99 <= QUIET_RATIO * empty.median else "; the machine was not quiet, so that tails are left out")
    )


def _comparison(changes: Sequence[Change]) -> Iterator[str]:
    for change in changes:
        if change.verdict != "the same":
            # No ratio where the old error was zero.
            by = "" if change.ratio is None else f": {change.ratio:.3g} times"
            yield f"{change.verdict}: {change.label} on the {change.model}, {change.what}{by}"
    if changes:
        alike = sum(change.verdict == "the same" for change in changes)
        yield f"compared: {alike} of {len(changes)} the same"


def compare_benches(now: BenchResults, before: BenchResults) -> list[Change]:
    """Compare two benches, setting by setting: have times or errors changed?

    Returns a change for each setting that both timed, and one for each whose error has changed.
    """
    past = {(setting.model, setting.label): setting for setting in before.settings if setting.problem is None}
    pairs = [
        (setting, past[setting.model, setting.label])
        for setting in now.settings
        if setting.problem is None and (setting.model, setting.label) in past
    ]
    noise = max((bench.empty.p99 - bench.empty.median for bench in (now, before) if bench.empty), default=0.0)
    times = [
        Change(
            model=setting.model,
            label=setting.label,
            what="step",
            ratio=setting.step.median / old.step.median,
            verdict=judge_times(setting.step, old.step, noise=noise),
        )
        for setting, old in pairs
        if setting.step is not None and old.step is not None
    ]
    return times + [change for setting, old in pairs for change in _error_change(setting, old)]


def judge_times(now: Times, before: Times, *, noise: float) -> Literal["better", "worse", "the same"]:
    """Return whether a step takes more or less time than before.

    It does where every round of one bench is slower than every round of the other, for a slow stretch of the machine
    slows whole rounds; and where the medians differ by more than `TIME_WORTH`, and than the `noise` (s) of a call that
    does nothing.
    """
    if abs(math.log(now.median / before.median)) <= math.log1p(TIME_WORTH) or abs(now.median - before.median) <= noise:
        return "the same"
    if min(now.rounds) > max(before.rounds):
        return "worse"
    return "better" if max(now.rounds) < min(before.rounds) else "the same"


def _error_change(now: SettingEntry, before: SettingEntry) -> Iterator[Change]:
    if now.errors is None or before.errors is None:
        return
    new, old = now.errors["ihip"]["max"], before.errors["ihip"]["max"]
    # Errors are deterministic: a difference beyond rounding is a change.
    if abs(new - old) > ERROR_WORTH * max(new, old) + 1e-12:
        yield Change(
            model=now.model,
            label=now.label,
            what="IHIP error",
            ratio=new / old if old > 0.0 else None,
            verdict="better" if new < old else "worse",
        )
