"""What follows from the numbers: Pareto fronts, orders of convergence, and the cheapest setting that will do."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

from hapticeval.bench.pareto import cheapest, front, order
from hapticeval.costs import Costs

KINDS = ("step", "batch")
WITHIN, BUDGET = 1e-4, 1e-5
"""The question that is always answered: 0.1 mm within 10 us."""

Entry = Mapping[str, Any]


def judged(costs: Costs, *, within: float | None = None, budget: float | None = None) -> Costs:
    """The same with fronts, orders and answers.

    Errors are the 99 per cent quantiles of the IHIP error, as far as they are proven. `within` (m) and `budget` (s)
    replace the question that is always answered. Times are medians: what lies far above them is the machine's.
    """
    models = list(dict.fromkeys(each["model"] for each in costs.settings))
    on_front: dict[str, list[str]] = {}
    answers = []
    for model in models:
        for kind in KINDS:
            usable = [each for each in costs.settings if each["model"] == model and each["claims"] and each[kind]]
            times = [each[kind]["median"] for each in usable]
            claims = [each["claims"]["ihip"]["p99"] for each in usable]
            for index in front(times, claims):
                on_front.setdefault(usable[index]["key"], []).append(kind)
            asked, limit = within or WITHIN, budget or (BUDGET if within is None else math.inf)
            best = cheapest(times, claims, within=asked, budget=limit)
            answers.append(
                {
                    "model": model,
                    "what": kind,
                    "within_m": asked,
                    "budget_s": limit if math.isfinite(limit) else None,
                    "key": None if best is None else usable[best]["key"],
                    "label": None if best is None else usable[best]["label"],
                }
            )
    settings = [{**each, "front": on_front.get(each["key"], [])} for each in costs.settings]
    return replace(costs, settings=settings, answers=answers, orders=list(orders(costs.settings)))


def orders(settings: Sequence[Entry]) -> Iterator[dict[str, Any]]:
    """The order of each error by each knob, from the proven errors of settings that differ in it alone."""
    groups: dict[tuple[str, str, str, str], list[Entry]] = {}
    for each in settings:
        if each["proven"]:
            for knob in each["settings"]:
                rest = json.dumps({name: value for name, value in each["settings"].items() if name != knob})
                groups.setdefault((each["renderer"], each["model"], knob, rest), []).append(each)
    for (renderer, model, knob, rest), group in groups.items():
        values = [each["settings"][knob] for each in group]
        found = {
            metric: order(values, [each["errors"][metric]["rms"] for each in group]) for metric in group[0]["errors"]
        }
        if any(each is not None for each in found.values()):
            yield {
                "renderer": renderer,
                "model": model,
                "knob": knob,
                "others": json.loads(rest),
                "values": values,
                "orders": found,
            }


def unproven(costs: Costs) -> Iterator[str]:
    """A sentence a renderer and model whose reference has not converged as far as its errors would need."""
    for reference in costs.references:
        held = [
            each
            for each in costs.settings
            if (each["renderer"], each["model"]) == (reference["renderer"], reference["model"]) and not each["problem"]
        ]
        refused = [each for each in held if each["proven"] is False]
        name = f"{reference['renderer']} on the {reference['model']}"
        if reference["what"] is None and held:
            yield f"{name}: no error is measured: it has no exact form, and no knob to refine it by"
        elif refused:
            apart = reference["disagreement"]["ihip"]["p99"]
            yield (
                f"{name}: the reference ({reference['what']}) has not converged far enough: its last refinement still "
                f"moves the IHIP by {apart:.2g} m, so no setting is called more accurate than {10.0 * apart:.2g} m "
                f"(held back: {', '.join(_values(each) for each in refused)})"
            )


def _values(entry: Entry) -> str:
    return str(entry["label"]).removeprefix(str(entry["renderer"])).strip() or "its one setting"
