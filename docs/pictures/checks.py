"""Draw the pictures of the page of every check into `pictures`: a renderer that passes it, and a broken one that fails.

The broken ones are those that test the checks, in `tests/meta`.
"""

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

sys.path.append(str(Path(__file__).parents[2] / "tests" / "meta"))

import lawbreakers
import mutants
import outsiders
import rubbing
import struck_and_shaded
import textured
from msgspec.structs import replace

import hapticeval
from hapticeval.phenomena.registry import OWN
from hapticeval.rigid_contact import ideal
from hapticeval.suite.case import Case
from hapticeval.suite.reading import load_suite
from hapticeval.suite.suite import Suite

PICTURES = Path("pictures")
PICTURES.mkdir(exist_ok=True)
GROUPS = (outsiders, rubbing, struck_and_shaded, textured)

Contest = tuple[Any, str, Any, tuple[Case, ...]]
"""What is right, the name of what is broken, what is broken, and the cases that may show it."""


def contests(check: str) -> Iterator[Contest]:
    """Yield the broken renderers that a check has to stop."""
    for name, (stopped_by, _) in mutants.MUTANTS.items():
        if stopped_by == check:
            cases = tuple(case for case in load_suite("thesis").cases if case.judged and "device" not in case.scene)
            yield ideal, name, mutants.factory(name), cases
    for name, (stopped_by, _) in lawbreakers.LAWBREAKERS.items():
        if stopped_by == check:
            cases = tuple(case for case in load_suite("dynamics-circle").cases if "device" not in case.scene)
            yield lawbreakers.factory("faultless"), name, lawbreakers.factory(name), cases
    for group in GROUPS:
        for name, broken in group.BROKEN.items():
            if next(iter(broken.fails), None) == check:
                right = next(iter(group.HONEST.values()))
                yield right.make, name, broken.make, tuple(group.CASES[each] for each in broken.cases)


def judged(name: str, factory: Any, case: Case, check: str) -> hapticeval.Results:
    """Judge a renderer in a case by one check."""
    alone = Suite(
        name="shown",
        title="",
        citation="",
        cases=(replace(case, checks=(check,), published={}),),
        rows=(),
        renderers=(),
    )
    return hapticeval.run({name: factory}, suites=alone)


for check in OWN:
    for right, name, broken, cases in contests(check):
        shown = next(
            (
                (passes, fails)
                for case in cases
                if check in case.checks
                and (fails := judged(name, broken, case, check)).verdicts[0].outcome == "fail"
                and (passes := judged("right", right, case, check)).verdicts[0].outcome == "pass"
            ),
            None,
        )
        if shown:
            for word, results in zip(("passes", "fails"), shown, strict=True):
                results.plot().savefig(PICTURES / f"check-{check}-{word}.svg", metadata={"Date": None})
            break
    else:
        print(f"{check}: no picture")
