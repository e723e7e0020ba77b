"""What the suites ask where: docs/coverage.md counts the cases of each check, and says of each empty cell why."""

from __future__ import annotations

import os
from collections import Counter
from pathlib import Path

from hapticeval.devices.point_mass import PointMass
from hapticeval.phenomena.check import Situation
from hapticeval.phenomena.registry import OWN
from hapticeval.suite.installed import find_suites
from hapticeval.suite.reading import load_suite

PAGE = Path(__file__).parents[2] / "docs" / "coverage.md"
SPACES, HANDS = ("plane", "space"), ("led", "loop", "robot")
CELLS = [(space, hand) for space in SPACES for hand in HANDS]

OF_A_PATH = {"reverse", "reordered", "subdivided", "in_turns"}
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
    data = OWN[check]
    if hand == "led":
        closed = {"law", "at_speed"} & data.needs.keys()
        return not (closed or {Situation.LED, Situation.PLAYBACK} & data.not_for.keys() or hand in NEVER.get(check, ()))
    return not (OF_A_PATH & data.needs.keys())


def table() -> str:
    cases = counted()
    lines = [
        "| check | " + " | ".join(f"{space}, {hand}" for space, hand in CELLS) + " |",
        "|---|" + "---:|" * len(CELLS),
    ]
    for check in OWN:
        cells = [str(cases[check, *cell] or ("" if can_be_asked(check, cell[1]) else "·")) for cell in CELLS]
        lines.append(f"| `{check}` | " + " | ".join(cells) + " |")
    return "\n".join(lines)


HEAD = """# Coverage

How many judged cases of the suites that come with the package ask each check, of plane models and in space. It says
where the hand is *led* along a path, where a point mass moves in a closed *loop*, and where the *robot* does.
A dot marks what cannot be asked there, by what the check itself needs; an empty cell is one that no suite visits.

`tests/suites/test_coverage.py` compares this page with the suites; `HAPTICEVAL_PUBLISH=1` writes it anew.

"""


def test_the_page_counts_the_cases_of_the_suites():
    page = HEAD + table() + "\n"
    if os.environ.get("HAPTICEVAL_PUBLISH"):
        PAGE.write_text(page)
    assert PAGE.read_text() == page


def test_each_check_is_asked_in_the_plane_and_in_space_wherever_it_can_be():
    """The least that a suite owes: led or moving, in either dimension."""
    cases = counted()
    missing = {
        f"{check}, {space}" for check in OWN for space in SPACES if not any(cases[check, space, hand] for hand in HANDS)
    }
    assert missing == set(MISSING)


MISSING = {
    "texture-amplitude, space": "speed and press are those of texture-spectrum, which is asked there",
    "seams, plane": "a curve has no triangles",
}
"""Checks without a case in the plane or in space, with the reason."""
