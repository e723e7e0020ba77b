"""The first page's cards: what accuracy costs in time, hard cases and effects, each a picture and a sentence."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from hapticeval.quantity import format_duration, format_length, plural
from hapticeval.reports.bench_figure import MICROSECONDS, TARGET_ERROR, TICK_RULE, cheapest_by_renderer
from hapticeval.reports.canvas import MM
from hapticeval.reports.chart import Axis, Chart, Curve, Note, Rule, charts_data
from hapticeval.reports.grid import DigitFamily
from hapticeval.runner.results import ResultsDocument
from hapticeval.study.bench.document import TICK, BenchResults

DOUBLE_DIGITS = 16
"""Decimal digits of double precision."""

ASKED_DIGITS = 9
"""Digits that `numerical-stability` asks for, where no coarser resolution is declared."""

CARD_ROW, CARD_FRAME = 21, 50
"""Pixels of a row of a card's picture, and of what stands round the rows."""

LABEL_LENGTH = 28
"""Characters of a row's label for which a card has room."""

MOST_KINDS = 7
"""Kinds of effects that a card has a row for."""


class Card(NamedTuple):
    """A picture that answers at a glance, `data` of its chart, with a sentence; `page` is the page that it leads to."""

    page: str
    title: str
    sentence: str
    data: str


def accuracy_card(bench: BenchResults) -> Card | None:
    """Return the card of a bench: of each renderer the cheapest setting within 0.1 mm, or else the most accurate."""
    model, settings = next(iter(bench.by_model().items()))
    best = cheapest_by_renderer(settings)
    if not best:
        return None
    # What is off by rounding alone: from another computation, or from itself where there is none.
    refined = {entry.renderer for entry in bench.references if entry.model == model and entry.disagreement is not None}
    curves, notes, times, outside = [], [], [], []
    for row, (name, setting) in enumerate(best.items()):
        assert setting.claims is not None
        assert setting.step is not None
        error, time = setting.claims["ihip"]["max"], MICROSECONDS * setting.step.median
        is_within = MM * error <= TARGET_ERROR
        role = "hip" if is_within else "ihip"
        curves.append(Curve(x=[time], y=[row], line=False, role=role, marker="o", size=8.0, hollow=not is_within))
        notes.append(
            Note(
                time,
                row,
                format_length(error) if error else "exact" if setting.renderer in refined else "its own exact curve",
            )
        )
        if is_within:
            times.append(setting.step.median)
        else:
            outside.append(f"{name} is off by {format_length(error)} at its best")
    within = f"{len(times)} of {plural(len(best), 'renderer')} come within {TARGET_ERROR} mm of what they aim at"
    if times:
        share = 100.0 * max(times) / TICK
        within += f", in {format_duration(min(times))} to {format_duration(max(times))} a step: {share:.2g} % of a tick"
    title = f"time a step of each renderer's cheapest setting within {TARGET_ERROR} mm, on the {model}"
    across = Axis(label=f"time a step (µs); hollow: not within {TARGET_ERROR} mm", log=True, range=(1.0, 2000.0))
    data = _rows_data(title, across, list(best), curves, rules=[TICK_RULE], notes=notes)
    return Card("costs", "What accuracy costs in time", ". ".join([within, *outside]) + ".", data)


def hard_card(families: Sequence[DigitFamily]) -> Card | None:
    """Return the card of hard cases: the fewest digits that are kept in each family of them, the worst first."""
    if not families:
        return None
    rows = list(enumerate(families))
    dots = [(family.digits, "hip" if family.digits >= ASKED_DIGITS else "ihip", False, row) for row, family in rows]
    coarse = [(family.coarse_digits, "quiet", True, row) for row, family in rows if family.coarse_digits is not None]
    curves = [
        Curve(x=[digits], y=[row], line=False, role=role, marker="o", size=8.0, hollow=hollow)
        for digits, role, hollow, row in (*dots, *coarse)
    ]
    worst = families[0]
    sentence = f"At least {worst.digits:.0f} of {DOUBLE_DIGITS} digits are kept, fewest {worst.title}: {worst.case}."
    if coarse:
        sentence += " What declares a coarse model of its own (hollow) keeps as few as that gives."
    labels = [textwrap.shorten(family.title, LABEL_LENGTH, placeholder=" ...") for family in families]
    data = _rows_data(
        "fewest decimal digits that answers keep, by family of hard cases",
        Axis(label=f"digits kept; {ASKED_DIGITS} are asked for", range=(-0.5, DOUBLE_DIGITS + 0.5)),
        labels, curves, rules=[Rule(x=ASKED_DIGITS, role="mark", dash=(4, 2))],
    )  # fmt: skip
    return Card("hard-cases", "Hard cases", sentence, data)


def cases_by_effect(results: ResultsDocument) -> dict[str, list[tuple[str, str]]]:
    """Return the cases, by suite and name, that call for each kind of effect; those for "none" come first."""
    cases: dict[str, list[tuple[str, str]]] = {"none": []}
    for key, run in {(run.suite, run.case): run for run in results.runs}.items():
        for kind in dict.fromkeys(str(effect["kind"]) for effect in run.scene.effects) or ("none",):
            cases.setdefault(kind, []).append(key)
    return cases


def effects_card(cases: Mapping[str, Sequence[tuple[str, str]]], bench: BenchResults | None) -> Card | None:
    """Return the card of effects from their `cases_by_effect`, and what one costs that none calls for."""
    called = sorted((kind for kind in cases if kind != "none"), key=lambda kind: -len(cases[kind]))
    if not called:
        return None
    rows = {kind: len(cases[kind]) for kind in ("none", *called[: MOST_KINDS - 1])}
    left_out, count = len(called) - len(rows) + 1, len({case for keys in cases.values() for case in keys})
    sentence = f"{rows['none']} of {plural(count, 'case')} call for no effect{_uncalled_words(bench)}"
    sentence += f" {left_out} more kinds are called for." if left_out else ""
    bars = [
        Curve(x=[0.8, number], y=[row, row], role="hip" if row else "quiet", width=9.0)
        for row, number in enumerate(rows.values())
    ]
    across = Axis(label="cases that call for it", log=True, range=(0.8, 1.6 * max(rows.values())))
    notes = [Note(number, row, str(number)) for row, number in enumerate(rows.values())]
    return Card("effects", "Effects", sentence, _rows_data("cases by effect", across, list(rows), bars, notes=notes))


def _rows_data(title: str, across: Axis, names: Sequence[str], curves: Sequence[Curve], **marks: Any) -> str:
    """Return the data of a chart with a row for each name, as high as it needs."""
    height = CARD_FRAME + CARD_ROW * len(names)
    return charts_data(
        [Chart(title=title, x=across, y=Axis(label="", names=names), curves=curves, height=height, **marks)]
    )


def _uncalled_words(bench: BenchResults | None) -> str:
    """Return what an effect costs that a scene does not call for, as the bench has measured it."""
    if bench is None or bench.uncalled is None:
        return ", and run the renderer as its factory made it."
    same = "the same" if bench.uncalled.same_law else "another"
    return f": {same} law object runs as without the machinery, and takes {bench.uncalled.ratio:.2f} times as long."
