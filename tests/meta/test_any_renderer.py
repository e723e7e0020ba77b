"""Whatever a renderer answers, it is judged: a verdict on every check, the same again, and none that a check broke on.

Renderers are made of oddities that harm nobody, of faults, and of answers that are none. The harmless are not blamed.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from honest import Late, Spring
from hypothesis import example, given, settings
from hypothesis import strategies as st
from outsiders import LED, case

from hapticeval.phenomena.verdict import Outcome
from hapticeval.runner.judging import judge
from hapticeval.runner.results import VerdictEntry
from hapticeval.suite.case import Case

REAL = st.one_of(st.floats(-1e100, 1e100), st.sampled_from([math.nan, math.inf]))
"""Any number whose square is one, and what is none."""


class Unprintable(Exception):
    def __str__(self) -> str:
        raise ValueError


def raising(error: Callable[[], BaseException]) -> Callable[..., Any]:
    def answer(ihip: np.ndarray, force: np.ndarray, hip: np.ndarray) -> Any:
        raise error()

    return answer


HARMLESS: dict[str, Callable[..., Any]] = {
    "tuple": lambda ihip, force, hip: (ihip, force),
    "lists": lambda ihip, force, hip: [ihip.tolist(), force.tolist()],
    "single": lambda ihip, force, hip: (ihip.astype(np.float32), force.astype(np.float32)),
    "strided": lambda ihip, force, hip: np.array([ihip, force], order="F"),
    "columns": lambda ihip, force, hip: map(list, (ihip, force)),
    "scribbles": lambda ihip, force, hip: (ihip, force, hip.fill(9.0))[:2],
}
"""Ways to give a right answer."""

NO_ANSWER: dict[str, Callable[..., Any]] = {
    "none": lambda ihip, force, hip: None,
    "one": lambda ihip, force, hip: ihip,
    "three": lambda ihip, force, hip: (ihip, force, hip),
    "rows": lambda ihip, force, hip: (ihip[None], force[None]),
    "empty": lambda ihip, force, hip: ([], []),
    "words": lambda ihip, force, hip: ("here", "there"),
    "ragged": lambda ihip, force, hip: ([0.0, [1.0]], force),
    "complex": lambda ihip, force, hip: (ihip * 1j, force),
    "objects": lambda ihip, force, hip: ([object(), None], force),
    "nan": lambda ihip, force, hip: (ihip, force * math.nan),
    "raises": raising(ZeroDivisionError),
    "exits": raising(lambda: SystemExit(3)),
    "stops": raising(StopIteration),
    "recurses": raising(RecursionError),
    "unprintable": raising(Unprintable),
}
"""Answers that are none."""


class Odd(Late):
    """A spring, some ticks late, that changes IHIP and force in some ticks, and from one on gives no answer."""

    def __init__(self, scene, traits):
        super().__init__(scene, Spring(scene))
        self.ticks = traits["lag"]
        self.traits = traits
        for name, value in traits["attributes"].items():
            setattr(self, name, value)

    def reset(self, hip):
        super().reset(hip)
        self.count = 0

    def step(self, hip, velocity, dt):
        ihip, force = super().step(hip.copy(), velocity, dt)
        traits, self.count = self.traits, self.count + 1
        if traits["every"] and self.count % traits["every"] == 0:
            ihip, force = ihip + traits["shift"], force * traits["factor"]
        how = HARMLESS[traits["kind"]] if self.count < traits["until"] else NO_ANSWER[traits["breaks"]]
        return how(ihip.copy(), force.copy(), hip)


BLAMES = (Outcome.FAIL, Outcome.ERROR)
MODELS: list[dict[str, Any]] = [
    {"kind": "circle"},
    {"kind": "star"},
    {"kind": "ellipse", "ratio": 5.0},
    {"kind": "dumbbell", "neck": 0.3},
    {"kind": "polygon", "vertices": [[0.0, 0.0], [0.1, 0.0], [0.1, 0.002], [0.0, 0.002]]},
]
places = st.integers(-120, 120).map(lambda mm: mm / 1000.0)


def led(model: dict[str, Any], points: list[list[float]], duration: float) -> Case:
    """A hand that is led along points, m, in so many seconds."""
    return case("any", model, LED, trajectory={"kind": "points", "points": points, "duration": duration})


cases = st.builds(
    led,
    st.sampled_from(MODELS),
    st.lists(st.tuples(places, places), min_size=2, max_size=4, unique=True).map(lambda made: [list(p) for p in made]),
    st.sampled_from([0.02, 0.06]),
)


@st.composite
def plain(draw: st.DrawFn) -> Any:
    """Into a circle or a line from free space, about under its surface, and out again: nothing there is hard."""
    depths = [-5, *draw(st.lists(st.integers(-5, 20), min_size=1, max_size=3)), -5]
    ways = draw(st.lists(st.integers(-40, 40), min_size=len(depths), max_size=len(depths)))
    along, under = np.cumsum(ways) / 1000.0, np.array(depths) / 1000.0
    model = draw(st.sampled_from(["circle", "line"]))
    if model == "line":
        points = np.column_stack([along, -under])
    else:
        angle = along / 0.1
        points = (0.1 - under)[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    path = {"kind": "points", "points": points.tolist(), "duration": draw(st.sampled_from([0.2, 0.5]))}
    return case("plain", {"kind": model}, LED, trajectory=path)


HONEST = {"attributes": {}, "every": 0, "shift": 0.0, "factor": 1.0, "until": math.inf, "breaks": "none"}
honest = st.fixed_dictionaries({"kind": st.sampled_from(list(HARMLESS)), "lag": st.integers(0, 3)}).map(HONEST.__or__)
odd = st.fixed_dictionaries(
    {
        "kind": st.sampled_from(list(HARMLESS)),
        "lag": st.integers(0, 30),
        "attributes": st.dictionaries(
            st.sampled_from(
                ["standoff", "resolution", "surface", "run", "observe_force", "law", "signals", "supports", "answer"]
            ),
            st.one_of(REAL, st.none(), st.just("1 mm"), st.just(lambda *anything: None)),
            max_size=2,
        ),
        "every": st.integers(0, 20),
        "shift": REAL,
        "factor": REAL,
        "until": st.integers(0, 120),
        "breaks": st.sampled_from(list(NO_ANSWER)),
    }
)


BEYOND_SINGLE = {"attributes": {}, "shift": 3.4028235677973472e38, "until": 109, "breaks": "none"}
"""An answer that rounding takes beyond the largest number of single precision."""


@example(
    traits={
        "kind": "tuple",
        "lag": 4,
        "every": 14,
        "factor": 5287454.0,
        **BEYOND_SINGLE,
        "shift": 127129.0,
        "until": 22,
    },
    judged=led({"kind": "circle"}, [[0.059, 0.102], [0.0, 0.0]], 0.02),
)
@example(
    traits={"kind": "tuple", "lag": 0, "every": 8, "factor": 0.0, **BEYOND_SINGLE},
    judged=led({"kind": "circle"}, [[0.0, 0.0], [0.0, 0.027]], 0.02),
)
@example(
    traits={"kind": "tuple", "lag": 0, "every": 1, "factor": 0.0, **BEYOND_SINGLE, "shift": 1.2095089001659893e75},
    judged=led({"kind": "circle"}, [[0.0, 0.0], [0.0, 0.03]], 0.02),
)
@example(
    traits={"kind": "tuple", "lag": 0, "every": 3, "factor": 1e100, **BEYOND_SINGLE, "shift": 1e100},
    judged=led({"kind": "star"}, [[0.0, 0.0], [0.0, 0.03], [0.05, 0.2]], 0.06),
)
@settings(max_examples=15)
@given(traits=odd, judged=cases)
def test_any_renderer_gets_a_verdict_on_every_check_and_the_same_again(traits, judged):
    found = []
    for _ in range(2):
        made = judge(lambda scene: Odd(scene, traits), "odd", "any", judged)
        assert [verdict.check for verdict in made.verdicts] == list(judged.checks)
        for verdict in made.verdicts:
            assert verdict.finding.message
            assert not verdict.finding.message.startswith("the check itself failed")
        found.append([VerdictEntry.of(verdict) for verdict in made.verdicts])
        str(made.error)
    assert found[0] == found[1]


@settings(max_examples=15)
@given(traits=honest, judged=cases)
# The force of a tool that just touched, in seven digits, comes with the depth of three ticks later.
@example(
    traits={**HONEST, "kind": "single", "lag": 3}, judged=led({"kind": "star"}, [[0.103, 0.063], [0.0, 0.0]], 0.02)
)
def test_no_check_depends_on_how_a_right_answer_is_given(traits, judged):
    """The verdicts are those of the bare spring, as late: what its projection deserves is another matter."""
    bare = judge(lambda scene: Odd(scene, {**traits, "kind": "tuple"}), "bare", "any", judged)
    made = judge(lambda scene: Odd(scene, traits), "made", "any", judged)
    assert bare.error is None
    assert [verdict.outcome for verdict in made.verdicts] == [verdict.outcome for verdict in bare.verdicts]


@settings(max_examples=10)
@given(traits=honest, judged=plain())
def test_an_honest_spring_is_not_blamed(traits, judged):
    made = judge(lambda scene: Odd(scene, traits), "made", "any", judged)
    blamed = {verdict.check: verdict.finding.message for verdict in made.verdicts if verdict.outcome in BLAMES}
    assert blamed == {}
