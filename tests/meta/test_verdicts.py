"""One table of renderers, right and wrong, that suites or users once met: what each fails where, and what it does not.

The kill matrix (`test_kill_matrix.py`) has those whose every verdict is known; here are verdicts that are asked alone.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
import pytest
from asked import case_at, verdicts
from finger import Coarse, FingerProxy, Undeclared, Unswept
from flights import LEGS, LandsElsewhere, Leaps, UndeclaredBall, flying, grazing
from force_only import Afar, Aside, DeadBand, Dodging, Field, Interrupted, Late, Mute, Pulling, Silent, Stiff
from honest import Spring
from latecomers import (
    ChangingLatency,
    FromTheFace,
    LateByTurns,
    LateTool,
    OffTheSurface,
    Pushing,
    Reversed,
    late,
)
from latecomers import Silent as SilentlyOff
from made import FAIL, NO, PASS, UNDECIDED
from misblamed import CORNERS, FLOOR, LATE, NEAR, OUTSIDE, RIGHT, THIN_PLATE, DropsForce, Haunts, Sticks
from msgspec.structs import replace
from outsiders import case
from overlooked import OVERLOOKED, VARIES, Claiming, Raised, by_depth, by_place, endowed, late_force, promising
from pieces import Chosen, GodObject, Hopping, Nearest, Unhurried
from reporting import ALWAYS, NEVER, TRUE, Banded, Dropping, Rounded
from rubbing import CASES as FRICTION
from rubbing import Chatters, Grips, Rubbing, Thins
from unvisited import UNVISITED, Damped

from hapticeval.discovery import resolve
from hapticeval.phenomena.verdict import Level, Outcome
from hapticeval.runner.judging import judge
from hapticeval.scene import Scene
from hapticeval.suite.case import Case


class Row(NamedTuple):
    """A renderer in a case: the checks that it fails or that leave it undecided there, and those that it passes.

    - `fails`, `passes` and `undecided` name checks, with blanks between. Where none is named, all of the case are
      asked, and none blames it; where it passes "the rest", it fails those that are named alone.
    - `words`: a pattern that is in the message of each that it fails, or else of each that it passes.
    - `metric`, `evidence`: what each that it fails measures, to a hundredth, and some of the evidence.
    - `name`: of the renderer, where its factory has none.
    - `stops`: whether what fails is a must, and excused by no theorem.
    """

    make: Callable[[Scene], Any]
    place: str | Case
    fails: str = ""
    passes: str = ""
    undecided: str = ""
    words: str = ""
    metric: float | None = None
    evidence: Mapping[str, Any] = {}
    stops: bool = True
    name: str = ""


def rows(makes: Any, places: Any, *verdicts: Any, **more: Any) -> list[Row]:
    """Return a row of each renderer in each of some places."""
    return [Row(make, place, *verdicts, **more) for make in makes for place in places]


FACETS, BALL = "solids/icosphere-1280", resolve("virtual-proxy")
FIELD = [
    Row(Field, FACETS),
    *rows([DeadBand, Late], [FACETS], passes="force-magnitude"),
    Row(Silent, FACETS, undecided="contact-kept"),
    *rows([Pulling, Aside], [FACETS], "contact-normal-force"),
    Row(Interrupted, FACETS, "force-magnitude", words="the force is missing for"),
    *rows([Stiff, Mute], [FACETS], "force-magnitude"),
    Row(Dodging, FACETS, "continuous-contact"),
    Row(Afar, FACETS, "contact-kept"),
]
"""Of those with a force and no contact point."""

SLIDES = [f"unilateral-surfaces/{case}" for case in ("torus-slide", "sphere-deep", "ellipsoid-deep", "torus-deep")]
PIECES = [
    *rows([GodObject], SLIDES, passes="continuous-contact"),
    Row(Unhurried, "unilateral-surfaces/sphere-deep", passes="continuous-contact"),
    *rows([Hopping, Chosen], ["unilateral-surfaces/sphere-deep"], "continuous-contact"),
    Row(Nearest, "unilateral-surfaces/torus-deep", "continuous-contact"),
]
"""What follows from the triangles that a renderer was given is not held against it, and all else is."""

FINGER = [
    Row(FingerProxy, "solids/cube-edge", passes="broken-contact"),
    Row(FingerProxy, "solids/cube-edge", passes="continuous-contact", words="0.1 mm of the declared standoff"),
    Row(Undeclared, "solids/cube-edge", "continuous-contact"),
    *rows([FingerProxy], ["solids/cube-vertex", "solids/wedge-30"], passes="broken-contact"),
    Row(FingerProxy, "solids/inner-corner", "abrupt-switch", "continuous-contact", stops=False),
    Row(FingerProxy, "solids/icosphere-chord", "continuous-contact", words="pop-through", metric=1.24e-3),
    # Over an arc of the margin round the notch, which 90 degrees of the force take.
    Row(FingerProxy, "solids/l-block-notch", "abrupt-switch", metric=0.5 * np.pi * 0.9, stops=False),
    Row(FingerProxy, FACETS, "continuous-contact", evidence={"severity": "major"}),
    Row(Coarse, FACETS, "continuous-contact", words="mini", evidence={"severity": "mini"}, stops=False),
    Row(FingerProxy, "solids/plate", passes="contact-kept"),
    Row(Unswept, "solids/plate", "contact-kept", evidence={"kind": "tunnelled"}),
    Row(FingerProxy, "solids/cube-impact", "impulsive-collision", stops=False),
    Row(FingerProxy, "unilateral-surfaces/sphere-pressed", "centripetal-force", "contact-kept", stops=False),
    Row(FingerProxy, "thesis/circle-slide", "centripetal-force", stops=False),
]
"""A finger proxy as haptic libraries have it gets the verdicts of physics, and its margin is no fault."""

REPORTING = [
    # A hand that is off its tool by rounding is in free space; a force is contact, whatever is denied.
    *rows(
        [Rounded, Banded, TRUE, NEVER],
        ["solids/cube-edge"],
        passes="contact-kept continuous-contact",
    ),
    Row(ALWAYS, "solids/cube-edge", "continuous-contact"),
    Row(Dropping, "solids/cube-edge", "contact-kept", evidence={"kind": "let go"}),
]
"""Who reports contact beside IHIP and force."""

FLIGHTS = [
    row
    for model in LEGS
    for row in (
        *rows(
            [resolve("constraint")], [flying(model, aslant) for aslant in (0.0, 5e-3, -5e-3)], "", "continuous-contact"
        ),
        *rows([Leaps, LandsElsewhere], [flying(model)], "continuous-contact", words="pop-through", metric=0.06),
        Row(resolve("minimum-distance"), flying(model), "continuous-contact", stops=False),
    )
]
FLIGHTS += [
    Row(BALL, grazing(), passes="broken-contact"),
    Row(UndeclaredBall, grazing(), "broken-contact", stops=False),
]
"""A tool that is let go at an edge flies to the next face: no pop-through, as a leap while it is pressed is one."""

COUPLED = resolve("coupled")
OF_THE_FIELD = [
    *rows([BALL], [f"solids/{case}" for case in ("cube-edge", "cube-vertex", "nut-rim")], passes="continuous-contact"),
    *rows([Claiming, Raised], ["solids/cube-edge"], "continuous-contact", words="pop-through"),
    Row(BALL, "solids/fine-ball", "continuous-contact", words="declares a standoff of 0.5 mm, of which 0.4 mm count"),
    Row(resolve("conformal+pc"), "thesis/cassinian-loops", passes="passivity", words="spent"),
    *rows(
        [resolve("conformal"), endowed], ["thesis/cassinian-loops"], "passivity", words="^((?!spent).)*$", stops=False
    ),
    # The hand's depth under the plate's upper face.
    Row(COUPLED, "solids/plate", "contact-kept", metric=0.01925, evidence={"kind": "tunnelled"}),
    *rows(
        [COUPLED],
        ["solids/cube-edge", "thesis/cassinian-shallow-slide", "thesis/star-convex-corner"],
        passes="contact-kept",
    ),
]
"""True renderers of other publications are not blamed for what they declare, and what they do wrong is named."""

LAGS = [{"force": 1.0}, {"force": 0.4}, {"ihip": 0.4}, {"ihip": 0.4, "force": 0.4}, {"ihip": 2.3, "force": 2.3}]
LATE_FRICTION = [
    *(
        Row(late(Rubbing, **lag), FRICTION[place])
        for place in ("plane-to-and-fro", "circle-to-and-fro")
        for lag in (
            {"force": 1.0},
            {"force": 0.4},
            {"ihip": 0.4},
            {"ihip": 0.4, "force": 0.4},
            {"ihip": 2.3, "force": 2.3},
        )
    ),
    *(
        Row(late(kind, **lag), FRICTION[place], check, stops=False)
        for kind, place, check in (
            (Grips, "circle-to-and-fro", "friction-cone"),
            (Chatters, "plane-to-and-fro", "friction-sliding"),
            (Thins, "viscous-plane", "friction-work"),
        )
        for lag in ({}, {"force": 0.4})
    ),
]
"""Friction may be late by one lag for the run, also between two ticks; one that is wrong besides is found."""

PRESSED = ["slide", "unilateral-surfaces/sphere-pressed", "unilateral-surfaces/torus-press", "solids/l-block-notch"]
LATECOMERS = [
    *rows(
        [late(kind=kind) for kind in (ChangingLatency, LateByTurns, Pushing)],
        ["slide"],
        "contact-normal-force",
        words=r"\([^)]*(?<![\d.])([4-9]|\d\d)[\d.]* degrees\) off every true normal",
    ),
    *rows([late(kind=LateTool, ihip=lag) for lag in (0.5, 1.0, 2.3)], PRESSED, passes="contact-normal-force"),
    *rows([FingerProxy, FromTheFace], ["solids/corner-press"], passes="contact-normal-force"),
    Row(OffTheSurface, "press", passes="contact-normal-force"),
    Row(SilentlyOff, "press", "contact-normal-force"),
    Row(late(kind=Reversed), "slide", "contact-normal-force", words="it pulls where it should push"),
    # 10 mm under a face of the star's tip the hand leaves through the other face long before the corner.
    *rows(
        [late(resolve("constraint"), force=lag) for lag in (1.0, 3.0)],
        ["thesis/star-convex-corner"],
        passes="contact-kept",
    ),
    Row(late(resolve("constraint"), DropsForce), THIN_PLATE, "contact-kept", words="the force is dropped"),
    Row(late(resolve("minimum-distance"), Sticks), FLOOR, "contact-kept", words="the tool stays on the surface though"),
    Row(late(kind=Haunts), "slide", "contact-kept", words="^((?!no IHIP).)*$"),
    *rows([late(Field, force=lag) for lag in (0.0, 0.5, 1.0, 3.0)], ["thesis/cassinian-loops"], passes="passivity"),
]
"""Who is late by one number of ticks is not blamed; a latency that changes, or that does not show, hides nothing."""

WRONG = [
    row
    for name, wrong in OVERLOOKED.items()
    # Who declares nothing is not held to pushing alone.
    for row in rows(
        [wrong.make], wrong.places, wrong.check, words=wrong.words, stops=wrong.check != "never-pulls", name=name
    )
]
"""What suites once let pass."""

RIGHTLY = [
    *(row for name, right in RIGHT.items() for row in rows([right.make], right.places, name=name)),
    *rows([resolve(name) for name in ("minimum-distance", "constraint", "ideal")], [OUTSIDE]),
    *rows([OVERLOOKED["pushes-from-afar"].make], [OUTSIDE], passes="contact-kept"),
    *rows([OVERLOOKED["pushes-from-afar"].make], [NEAR], "contact-kept"),
    *(
        row
        for name, make in LATE.items()
        for row in rows([make], CORNERS, "contact-kept", "continuous-contact", words="N in free space", name=name)
    ),
    *rows([Damped], UNVISITED["velocity-left"].cases, passes="reset-clears"),
    *rows(
        [
            promising(late_force(fault, ticks), **VARIES)
            for fault in (by_place, by_depth)
            for ticks in (0.0, 2.0, 2.6, 3.0)
        ],
        ["field/press-and-leave", "solids/pebble"],
        passes="force-magnitude",
    ),
    # The package's own effect on the nearest point.
    *(
        Row(resolve("minimum-distance"), place, passes=unvisited.check)
        for unvisited in UNVISITED.values()
        for place in unvisited.cases
        if place.startswith("effects-")
    ),
]
"""What suites once blamed: a nearest point may jump across the medial axis, by a theorem, and no farther."""

EDGES = {"solids/box-off-origin", *UNVISITED["lingers"].cases}
RIGHTLY += [
    # The nearest point jumps at an edge (4.1.2), wherever that is, and in a loop too.
    Row(Spring, place, "continuous-contact broken-contact" if place in EDGES else "", "the rest", stops=False)
    for place in sorted({place for unvisited in UNVISITED.values() for place in unvisited.cases})
    if not place.startswith("effects-")
]

# A tolerance in metres shows where a mesh is looked at smaller: triangles of 1 mm^2, and of 0.02 mm^2.
BALL_OF_2_CM = case(
    "ball",
    {"kind": "icosphere", "size": 0.02, "subdivisions": 3},
    ("numerical-stability", "contact-kept"),
    trajectory={"kind": "points", "points": [[-0.006, 0.001, 0.01], [0.006, 0.002, 0.008]], "duration": 0.1},
)
WRONG += [
    Row(
        UNVISITED["small-triangles"].make,
        BALL_OF_2_CM,
        "numerical-stability",
        "contact-kept",
        evidence={"motion": "a seventh as large"},
        stops=False,
    )
]

VISITS = [
    row
    for name, unvisited in UNVISITED.items()
    for row in rows([unvisited.make], unvisited.cases, unvisited.check, name=name)
]
"""Faults that show in one place only are stopped where a suite goes there."""


def name_of(row: Row) -> str:
    make = row.name or getattr(row.make, "__name__", type(row.make).__name__)
    place = row.place if isinstance(row.place, str) else row.place.name
    return f"{make}-{place}-{(row.fails or row.passes or row.undecided or 'all').replace(' ', '+')}"


def hold(row: Row) -> None:
    """Assert that a renderer gets the verdicts of its row."""
    fails, passes, undecided = row.fails.split(), row.passes.split(), row.undecided.split()
    all_others = row.passes == "the rest" or not fails + passes + undecided
    judged = verdicts(row.make, row.place, *([] if all_others else fails + passes + undecided))
    if all_others:
        passes = [check for check, verdict in judged.items() if verdict.outcome is not NO and not verdict.inherent]
        passes = [check for check in passes if check not in fails]
        assert passes
    expected = dict.fromkeys(fails, FAIL) | dict.fromkeys(passes, PASS) | dict.fromkeys(undecided, UNDECIDED)
    messages = {check: verdict.finding.message for check, verdict in judged.items()}
    assert {check: judged[check].outcome for check in expected} == expected, messages
    for check in fails or passes:
        assert re.search(row.words, messages[check])
    for verdict in map(judged.__getitem__, fails):
        found = verdict.finding
        assert row.metric is None or found.metric.value == pytest.approx(row.metric, rel=0.01)
        assert {name: found.evidence.get(name) for name in row.evidence} == row.evidence
        assert not row.stops or (verdict.level is Level.MUST and not verdict.inherent)


@pytest.mark.parametrize(
    "row",
    [
        *(FIELD + PIECES + FINGER + REPORTING + FLIGHTS + OF_THE_FIELD + LATE_FRICTION),
        *(LATECOMERS + WRONG + RIGHTLY),
    ],
    ids=name_of,
)
def test_each_gets_its_verdicts(row):
    hold(row)


@pytest.mark.system
@pytest.mark.parametrize("row", VISITS, ids=name_of)
def test_a_fault_is_stopped_where_a_suite_visits_it(row):
    hold(row)


SENSED = {"imperfections": {"encoder_counts": 262144}}


def test_a_check_of_what_a_sensor_gave_keeps_the_channels_that_a_renderer_adds():
    """The atlas of set stabilisation records its chart."""
    asked = case_at("dynamics-sphere/sphere-robot")
    asked = replace(asked, checks=("continuous-contact", "force-magnitude"), scene={**asked.scene, **SENSED})
    judged = judge(resolve("set-stabilisation@atlas"), "atlas", "any", asked)
    assert judged.recording is not None
    assert "chart" in judged.recording.channels
    assert [verdict.finding.message for verdict in judged.verdicts if verdict.outcome is Outcome.ERROR] == []
