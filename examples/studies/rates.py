"""What a faster loop buys (thesis 8.2.4): each phenomenon's error and the largest stable stiffness, by rate.

Run it as `python -m hapticeval.examples.studies.rates -o pictures`.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import msgspec
import numpy as np

from hapticeval.cli import run_program
from hapticeval.commands.arguments import Folder, renderers_option
from hapticeval.commands.terminal import Terminal, paragraphs, say, wrote_lines
from hapticeval.devices.catalogue import device_named
from hapticeval.discovery import own_renderers, resolve
from hapticeval.phenomena.verdict import Outcome
from hapticeval.quantity import align_columns
from hapticeval.reports.canvas import CURVES, colour_of, figure, save_figure
from hapticeval.runner.judging import judge
from hapticeval.runner.results import environment
from hapticeval.study.limits.loop import Place, SampledLoop, passive_stiffness, robot_at
from hapticeval.study.limits.search import eigenvalue_limit, family_of, finite_or_none
from hapticeval.study.limits.study import Progress
from hapticeval.suite.reading import case_named

RATES_CODES = """\b
Exit codes:
  0  measured; a renderer that refuses a case or breaks in it has the reason in its row
  2  wrong usage or input
"""


RATES = (1e3, 3e3, 1e4, 3e4, 1e5, 3e5, 1e6)
"""Sampling rates (Hz)."""

CASES: Mapping[str, str] = {
    "continuous-contact": "thesis/cassinian-shallow-slide",
    "contact-normal-force": "thesis/cassinian-shallow-slide",
    "broken-contact": "thesis/star-convex-corner",
    "abrupt-switch": "thesis/star-concave-corner",
    "impulsive-collision": "thesis/plane-impact",
    "centripetal-force": "thesis/circle-slide",
}
"""A case of the thesis for each phenomenon."""

PRESS_CASE, ROBOT, SPRING_RENDERER = "thesis/plane-press", "parallelogram-2dof", "minimum-distance"
"""The limit is that of the robot against a plane, under a spring: the same for every renderer with one."""

LONGEST_RUN = 20.0
"""Seconds for one renderer and phenomenon beyond which a rate is left out, as the two rates before predict them."""


def study_rates(renderers: Sequence[str], rates: Sequence[float], progress: Progress) -> dict[str, Any]:
    """Judge renderers at each rate (Hz), each phenomenon in a case of the thesis, as a document in SI units.

    Metrics are those of the checks, at the stiffness of the case. Raises as `resolve` does; a renderer that refuses a
    case or breaks in it has the reason in its row.
    """
    factories = {name: resolve(name) for name in renderers}
    total = len(factories) * len(CASES)
    rows = []
    for done, (name, check) in enumerate((name, check) for name in factories for check in CASES):
        progress(done, total, f"{name}: {check}")
        rows += _judge_at_rates(name, factories[name], check, rates)
    progress(total, total, "")
    return {
        "environment": environment(),
        "rates": list(rates),
        "cases": dict(CASES),
        "rows": rows,
        "limit": {"device": ROBOT, "place": PRESS_CASE, "rows": [_stiffness_limit(rate) for rate in rates]},
    }


def _judge_at_rates(name: str, factory: Any, check: str, rates: Sequence[float]) -> list[dict[str, Any]]:
    """Judge a renderer by one check at each rate (Hz), a row each; a rate that would take too long is left out."""
    case = case_named(CASES[check])
    rows: list[dict[str, Any]] = []
    took: list[tuple[float, float]] = []
    for rate in rates:
        row: dict[str, Any] = {"renderer": name, "check": check, "rate": rate}
        # A rate that is left out keeps its row, which says why.
        if (expected := _expected_seconds(took, rate)) > LONGEST_RUN:
            rows.append({**row, "left_out": f"it would take some {expected:.0f} s"})
            continue
        # The same case and gains, its one check, another sampling time 1 / rate.
        faster = msgspec.structs.replace(case, checks=(check,), scene={**case.scene, "sampling_time": 1.0 / rate})
        begun = time.perf_counter()
        judged = judge(factory, name, "rates", faster)
        took.append((rate, time.perf_counter() - begun))
        finding = judged.verdicts[0].finding
        row |= {"outcome": finding.outcome.value, "message": finding.message}
        if finding.metric is not None:
            row |= {"metric": msgspec.to_builtins(finding.metric), "bound": finding.bound}
        rows.append(row)
        # What refuses or breaks at one rate is not tried at the next.
        if finding.outcome in (Outcome.ERROR, Outcome.NOT_APPLICABLE):
            break
    return rows


def _expected_seconds(took: Sequence[tuple[float, float]], rate: float) -> float:
    """Extrapolate seconds from the last two of `took`, each a rate and its seconds; 0 where there are no two."""
    if len(took) < 2:
        return 0.0
    (first, quick), (second, slow) = took[-2:]
    # A straight line through the last two: the ticks grow with the rate, and so does the time.
    return slow + max(slow - quick, 0.0) / (second - first) * (rate - second)


def _stiffness_limit(rate: float) -> dict[str, float | None]:
    """Find the largest stiffness (N/m) of the robot's loop at a rate: by its eigenvalues, and by (2.40)."""
    case = case_named(PRESS_CASE)
    scene = replace(case.build_scene(), device=device_named(ROBOT), sampling_time=1.0 / rate)
    # The point of the plane nearest to the origin.
    frame = scene.model.boundary.closest_point(np.zeros((1, scene.model.dimension)))
    place = Place(frame.foot[0], frame.normal[0])
    robot = robot_at(scene.robot, place.point)
    stable = eigenvalue_limit(SampledLoop(scene, robot), family_of(resolve(SPRING_RENDERER), scene, place))
    return {"rate": rate, "stable": finite_or_none(stable), "passive": passive_stiffness(scene, robot, place.normal)}


MARKERS = ("o", "s", "^", "D", "v", "P", "X")
"""One marker for each renderer, in turns."""

SMALLEST_SHARE = 1e-7
"""Share of the largest value at which nothing, which no logarithm reaches, is drawn."""


def write_rates(directory: Path, document: Mapping[str, Any]) -> list[Path]:
    """Draw the document of `study_rates` into `directory` as SVG and PNG, with the numbers as JSON.

    Return the paths written. Raises `HapticevalError` where a file cannot be written.
    """
    names = list(dict.fromkeys(row["renderer"] for row in document["rows"]))
    checks = list(document["cases"])
    with figure(13.0, 3.4 * ((len(checks) + 1 + 3) // 4), layout="constrained") as fig:
        panels = fig.subplots((len(checks) + 1 + 3) // 4, 4).ravel()
        for axes, check in zip(panels, checks, strict=False):
            check_rows = [row for row in document["rows"] if row["check"] == check and "metric" in row]
            # 1 where nothing was measured or all is zero: a logarithmic axis needs some scale.
            top = max((row["metric"]["value"] for row in check_rows), default=1.0) or 1.0
            for k, name in enumerate(names):
                rows_of_curve = [row for row in check_rows if row["renderer"] == name]
                if rows_of_curve:
                    values = [max(row["metric"]["value"], SMALLEST_SHARE * top) for row in rows_of_curve]
                    axes.plot(
                        [row["rate"] for row in rows_of_curve], values, label=name,
                        color=colour_of(CURVES[k % len(CURVES)]), marker=MARKERS[k % len(MARKERS)], markersize=4,
                        linewidth=1.0,
                    )  # fmt: skip
            unit = check_rows[0]["metric"]["unit"] if check_rows else ""
            axes.set(xscale="log", yscale="log", title=check, ylabel=f"metric ({unit})" if unit else "metric (share)")
            smallest = min((row["metric"]["value"] for row in check_rows), default=top)
            axes.set_ylim(0.5 * max(smallest, SMALLEST_SHARE * top), 3.0 * top)
        # The panel after the checks' has the stiffness; a row of four may have empty ones.
        limit, *unused = panels[len(checks) :]
        rows = document["limit"]["rows"]
        for entry, style in (("stable", "-"), ("passive", "--")):
            # None: no limit was found, and nothing is drawn there.
            rows_of_curve = [row for row in rows if row[entry] is not None]
            limit.plot(
                [row["rate"] for row in rows_of_curve], [row[entry] for row in rows_of_curve], style, label=entry
            )
        limit.set(xscale="log", yscale="log", title="largest stiffness of the robot's loop", ylabel="N/m")
        limit.legend(fontsize=7)
        for axes in panels[: len(checks) + 1]:
            axes.set(xlabel="sampling rate (Hz)", xlim=(0.7 * min(document["rates"]), 1.4 * max(document["rates"])))
            axes.grid(True, which="major")
        for axes in unused:
            axes.remove()
        fig.legend(*panels[0].get_legend_handles_labels(), loc="lower right", fontsize=8)
        return save_figure(fig, directory, "rates", document=document)


def rates(
    renderers: Annotated[list[str] | None, renderers_option("the built-in ones")] = None,
    directory: Folder = Path(),
) -> None:
    """Measure what a faster loop buys: each phenomenon's error by rate.

    From 1 kHz to 1 MHz, the metric of each of the six phenomena in a case of
    the thesis, and the largest stable stiffness of the robot's loop. What
    would take more than some 20 s is left out.

    \b
    Examples:
      python -m hapticeval.examples.studies.rates -r minimum-distance@lut -r constraint -o pictures
      python -m hapticeval.examples.studies.rates -r mymodule:factory
    """
    with Terminal() as terminal:
        document = study_rates(renderers or own_renderers(), RATES, terminal.working)
    cells_by_row: dict[tuple[str, str], dict[float, str]] = {}
    for row in document["rows"]:
        cell = row.get("outcome", "left out") + (f" {row['metric']['value']:.2g}" if "metric" in row else "")
        cells_by_row.setdefault((row["renderer"], row["check"]), {})[row["rate"]] = cell
    head = ["", "", *(f"{1e-3 * rate:g} kHz" for rate in RATES)]
    table = [[*key, *(cells.get(rate, "-") for rate in RATES)] for key, cells in cells_by_row.items()]
    # N/m at each rate.
    limit = ["stable stiffness", "N/m"] + [
        "none" if row["stable"] is None else f"{row['stable']:.4g}" for row in document["limit"]["rows"]
    ]
    say(
        paragraphs(
            "\n".join(align_columns([head, *table, limit], left=2)), wrote_lines(write_rates(directory, document))
        )
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program and return its exit code."""
    return run_program(rates, RATES_CODES, arguments)


if __name__ == "__main__":
    sys.exit(main())
