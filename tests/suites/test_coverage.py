"""What the suites ask where: docs/coverage.md counts the cases of each check, and says of each empty cell why."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

from publishing import publishing

from hapticeval.devices.point_mass import PointMass
from hapticeval.phenomena.check import Situation
from hapticeval.phenomena.registry import OWN_CHECKS
from hapticeval.suite.outline import find_suites
from hapticeval.suite.reading import load_suite

PAGE = Path(__file__).parents[2] / "docs" / "coverage.md"
SPACES, HANDS = ("plane", "space"), ("led", "loop", "robot")
CELLS = [(space, hand) for space in SPACES for hand in HANDS]

OF_A_PATH = {"reverse", "reordered", "subdivided", "in_turns", "cut", "dropped_out"}
"""Siblings that only a given path has."""

NEVER: dict[str, tuple[str, ...]] = {"comes-to-rest": ("led",)}
"""Beside what a check's data say: a hand that is led stops where its path ends."""


def counted() -> Counter[tuple[str, str, str]]:
    """The number of judged cases by check, space and hand."""
    cases: Counter[tuple[str, str, str]] = Counter()
    for suite in find_suites():
        for case in load_suite(suite).cases:
            if not case.judged:
                continue
            scene = case.build_scene()
            space = SPACES[scene.model.dimension - 2]
            moves = "loop" if isinstance(scene.robot, PointMass) else "robot"
            cases.update((check, space, "led" if case.experiment is None else moves) for check in case.checks)
    return cases


def can_be_asked(check: str, hand: str) -> bool:
    """Whether a check can be asked of such a hand at all, by its own data."""
    data = OWN_CHECKS[check]
    if hand == "led":
        closed = {"closed_form", "at_speed"} & data.needs.keys()
        return not (closed or {Situation.LED, Situation.PLAYBACK} & data.not_for.keys() or hand in NEVER.get(check, ()))
    return not (OF_A_PATH & data.needs.keys())


def table() -> str:
    cases = counted()
    lines = [
        "| check | " + " | ".join(f"{space}, {hand}" for space, hand in CELLS) + " |",
        "|---|" + "---:|" * len(CELLS),
    ]
    for check in OWN_CHECKS:
        cells = [str(cases[check, *cell] or ("" if can_be_asked(check, cell[1]) else "·")) for cell in CELLS]
        lines.append(f"| `{check}` | " + " | ".join(cells) + " |")
    return "\n".join(lines)


OF_THE_ANSWER = "it is about the answer to a hand, wherever that comes from: a given path shows it most plainly"
SHOWN_ONCE = (
    "an effect changes the answer to a hand: paths show it, and a loop, where one is asked, that a tool feels it"
)
"""Why a check that a path is asked about leaves cells empty, where nothing else is said: of effects, the second."""

NOT_VISITED: dict[str, str] = {
    "impulsive-collision": "a robot that is linearised is the point mass of the loops; else its own inertia hits",
    "drift": "a hand that pushes repeats a lap only once the tool has settled: asked of the point mass on a cube, "
    "whose robot settles more slowly than laps can be compared; in the plane the loop is the same code",
    "numerical-stability": "a robot cannot be moved and scaled with its scene; a point mass is in the plane, by the "
    "same loop as in space",
    "constraint-distance": "of bilateral surfaces in space the dynamics suites ask whether the distance dies out; the "
    "experiments that it ranks were made in the plane, on the robot",
    "seams": "a curve has no triangles",
    "friction-sticking": "a tool that sticks under a push is asked of: a hand that is led goes where it is led",
    "texture-amplitude": SHOWN_ONCE + "; speed and press are those of texture-spectrum, which is asked in space",
}
"""Why no suite visits the empty cells of a check, where it is another reason than those two."""


def why_not_visited(check: str) -> str:
    """Return why no suite visits the empty cells of a check."""
    return NOT_VISITED.get(check, SHOWN_ONCE if OWN_CHECKS[check].effects else OF_THE_ANSWER)


def empty_cells() -> dict[str, list[str]]:
    """The cells that could be asked and are not, by check."""
    cases = counted()
    empty = {
        check: [
            f"{space}, {hand}" for space, hand in CELLS if not cases[check, space, hand] and can_be_asked(check, hand)
        ]
        for check in OWN_CHECKS
    }
    return {check: cells for check, cells in empty.items() if cells}


def reasons() -> str:
    lines = ["| check | not asked | why |", "|---|---|---|"]
    lines += [
        f"| `{check}` | {'; '.join(cells)} | {why_not_visited(check)} |" for check, cells in empty_cells().items()
    ]
    return "\n".join(lines)


HEAD = """# Coverage

How many judged cases of the suites that come with the package ask each check, of plane models and in space. It says
where the hand is *led* along a path, where a point mass moves in a closed *loop*, and where the *robot* does.
A dot marks what cannot be asked there, by what the check itself needs; an empty cell is one that no suite visits, for
the reason below the table.

`tests/suites/test_coverage.py` compares this page with the suites; `HAPTICEVAL_PUBLISH=1` writes it anew.

"""


def test_the_page_counts_the_cases_of_the_suites():
    page = HEAD + table() + "\n\n## What no suite visits, and why\n\n" + reasons() + "\n"
    if publishing():
        PAGE.write_text(page)
    assert PAGE.read_text() == page


def test_a_check_with_an_empty_cell_has_its_reason():
    """Those that most checks have are of checks that a path can show, and a path does; others are listed."""
    assert set(NOT_VISITED) <= set(empty_cells()), "a reason for a check without an empty cell"
    cases = counted()
    led = {check for check in OWN_CHECKS if any(cases[check, space, "led"] for space in SPACES)}
    assert set(empty_cells()) - led <= set(NOT_VISITED), "a check that no path is asked about has a reason of its own"


def test_each_check_is_asked_in_the_plane_and_in_space_wherever_it_can_be():
    """The least that a suite owes: led or moving, in either dimension."""
    cases = counted()
    missing = {
        (check, space)
        for check in OWN_CHECKS
        for space in SPACES
        if not any(cases[check, space, hand] for hand in HANDS)
    }
    assert missing == MISSING
    assert {check for check, _ in missing} <= set(NOT_VISITED)


MISSING = {("texture-amplitude", "space"), ("seams", "plane"), ("constraint-distance", "space")}
"""Checks without a case in the plane or in space; `NOT_VISITED` has the reason."""
