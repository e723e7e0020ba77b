"""What follows from the numbers: Pareto fronts, orders of convergence, and the cheapest setting that will do."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from msgspec.structs import replace

from hapticeval.study.bench.document import Answer, BenchResults, Kind, OrderEntry, SettingEntry

KINDS: tuple[Kind, ...] = ("step", "batch")
WITHIN, BUDGET = 1e-4, 1e-5  # the question that is always answered: 0.1 mm within 10 us
ALIKE = 0.05  # share by which two times of one bench may differ by luck


def judged(results: BenchResults, *, within: float | None = None, budget: float | None = None) -> BenchResults:
    """Add fronts, orders and answers to the results of a sweep.

    Errors are the 99 per cent quantiles of the IHIP error, as far as they are proven. `within` (m) and `budget` (s)
    replace the question that is always answered. Times are medians: what lies far above them is the machine's.
    """
    on_front: dict[str, list[Kind]] = {}
    answers = []
    asked, limit = within or WITHIN, budget or (BUDGET if within is None else math.inf)
    for model, settings in results.by_model().items():
        for kind in KINDS:
            usable = [
                (each, times.median, each.claims["ihip"]["p99"])
                for each in settings
                if each.claims is not None and (times := each.times(kind)) is not None
            ]
            medians, claims = [median for _, median, _ in usable], [claim for *_, claim in usable]
            for index in front(medians, claims):
                on_front.setdefault(usable[index][0].key, []).append(kind)
            best = cheapest(medians, claims, within=asked, budget=limit)
            entry = None if best is None else usable[best][0]
            answers.append(
                Answer(
                    model=model,
                    what=kind,
                    within_m=asked,
                    budget_s=limit if math.isfinite(limit) else None,
                    key=None if entry is None else entry.key,
                    label=None if entry is None else entry.label,
                )
            )
    settings = [replace(each, front=on_front.get(each.key, [])) for each in results.settings]
    return replace(results, settings=settings, answers=answers, orders=list(orders(results.settings)))


def orders(settings: Sequence[SettingEntry]) -> Iterator[OrderEntry]:
    """Yield the order of each error by each knob, from the proven errors of settings that differ in that knob alone."""
    groups: dict[tuple[str, str, str, tuple[tuple[str, float], ...]], list[SettingEntry]] = {}
    for each in settings:
        for knob in each.settings if each.proven else ():
            rest = tuple((name, value) for name, value in each.settings.items() if name != knob)
            groups.setdefault((each.renderer, each.model, knob, rest), []).append(each)
    for (renderer, model, knob, rest), group in groups.items():
        values, errors = [each.settings[knob] for each in group], [each.errors or {} for each in group]
        found = {metric: order(values, [each[metric]["rms"] for each in errors]) for metric in errors[0]}
        if any(each is not None for each in found.values()):
            yield OrderEntry(renderer=renderer, model=model, knob=knob, others=dict(rest), values=values, orders=found)


def unproven(results: BenchResults) -> Iterator[str]:
    """Yield one sentence per renderer and model whose reference is not converged enough to certify the errors."""
    for reference in results.references:
        held = [each for each in results.by_model().get(reference.model, []) if not each.problem]
        held = [each for each in held if each.renderer == reference.renderer]
        refused = [each for each in held if each.proven is False]
        name = f"{reference.renderer} on the {reference.model}"
        if reference.what is None and held:
            yield f"{name}: no error is measured: it has no exact form, and no knob to refine it by"
        elif refused and reference.disagreement is not None:
            apart = reference.disagreement["ihip"]["p99"]
            back = (each.label.removeprefix(each.renderer).strip() or "its one setting" for each in refused)
            yield (
                f"{name}: the reference ({reference.what}) has not converged far enough: its last refinement still "
                f"moves the IHIP by {apart:.2g} m, so no setting is called more accurate than {10.0 * apart:.2g} m "
                f"(held back: {', '.join(back)})"
            )


def front(times: Sequence[float], errors: Sequence[float]) -> list[int]:
    """Return the indices of settings that none beats in both time and error, from the quickest to the most accurate.

    Of settings that are equal in both the first counts. Settings with a number that is not finite never do.
    """
    order = sorted(range(len(times)), key=lambda index: (times[index], errors[index], index))
    best, kept = np.inf, []
    for index in order:
        if np.isfinite(times[index]) and errors[index] < best:
            best = errors[index]
            kept.append(index)
    return kept


def cheapest(times: Sequence[float], errors: Sequence[float], *, within: float, budget: float = math.inf) -> int | None:
    """Return the setting with the least time, at most `budget`, whose error is at most `within`; None if there is none.

    Times within `ALIKE` of the least count as equal: of those the most accurate wins, then the first.
    """
    good = [index for index, error in enumerate(errors) if error <= within and times[index] <= budget]
    least = min((times[index] for index in good), default=np.inf)
    alike = [index for index in good if times[index] <= least * (1.0 + ALIKE)]
    return min(alike, key=lambda index: (errors[index], index), default=None)


def order(values: Sequence[float], errors: Sequence[float]) -> float | None:
    """Return the observed order of convergence: the slope of log error against log refinement, positive if it falls.

    `values` of a knob go from coarse to fine, in whatever direction. None for fewer than three different values with
    a positive error.
    """
    kept = [(value, error) for value, error in zip(values, errors, strict=True) if error > 0.0 and value > 0.0]
    if len({value for value, _ in kept}) < 3:
        return None
    refinement = np.abs(np.log([value / kept[0][0] for value, _ in kept]))
    slope = np.polyfit(refinement, np.log([error for _, error in kept]), 1)[0]
    return float(-slope)
