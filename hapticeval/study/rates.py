"""What a faster loop buys (thesis 8.2.4): each phenomenon's error and the largest stable stiffness, by rate."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import msgspec
import numpy as np

from hapticeval.devices.catalogue import device_named
from hapticeval.discovery import resolve
from hapticeval.phenomena.verdict import Outcome
from hapticeval.runner.judging import judge
from hapticeval.runner.results import environment
from hapticeval.study.limits.loop import Place, SampledLoop, passive_stiffness, robot_at
from hapticeval.study.limits.search import eigenvalue_limit, family_of, finite_or_none
from hapticeval.study.limits.study import Progress
from hapticeval.suite.reading import case_named

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
