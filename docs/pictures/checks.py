"""Draw the pictures of the page of every check into `pictures`: a renderer that passes it, and a broken one that fails.

The broken ones are those that test the checks, in `tests/meta`.
"""

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

sys.path.append(str(Path(__file__).parents[2] / "tests" / "meta"))

import field_bugs
import lawbreakers
import mutants
import numpy as np
import outsiders
import rubbing
import struck_and_shaded
import textured
from matplotlib.figure import Figure
from msgspec.structs import replace

import hapticeval
from hapticeval.closed_forms import CLOSED_FORMS
from hapticeval.phenomena.registry import OWN_CHECKS
from hapticeval.reports.run_figure import SCREEN_WIDTH, DrawnRun, run_figure
from hapticeval.rigid_contact import ideal
from hapticeval.suite.case import Case
from hapticeval.suite.reading import load_suite
from hapticeval.suite.suite import Suite

PICTURES = Path("pictures")
PICTURES.mkdir(exist_ok=True)
GROUPS = (outsiders, rubbing, struck_and_shaded, textured, field_bugs)

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


LAW = "set-stabilisation"
"""The renderer whose law those of `lawbreakers` are: its closed form is theirs."""


def judged(name: str, factory: Any, case: Case, check: str) -> hapticeval.Results:
    """Judge a renderer in a case by one check."""
    forms = {name: case.closed_form[LAW]} if LAW in case.closed_form else {}
    alone = Suite(
        name="shown",
        title="",
        citation="",
        cases=(replace(case, checks=(check,), published={}, closed_form=forms),),
        rows=(),
        renderers=(),
    )
    return hapticeval.run({name: factory}, suites=alone)


def drawn(results: hapticeval.Results, case: Case) -> Figure:
    """Draw a run; one that is held against a closed form beside that, for as long as it comes home."""
    law = results.verdicts[0].evidence.get("law")
    if law is None:
        return results.plot()
    scene, recording, closed_form = case.build_scene(), results.recording(), CLOSED_FORMS[law]
    motion = closed_form.motion(scene, recording.hip[0], recording.velocity[0], recording.time)
    far = np.abs(scene.model.boundary.signed_distance(motion.hip))
    name = results.verdicts[0].renderer
    drawing = run_figure(
        [DrawnRun(name, recording)], scene.model, title=f"{name} on shown/{case.name}", width=SCREEN_WIDTH
    )
    depth = drawing.axes[2]
    depth.plot(recording.time, 1e3 * far, "k--", linewidth=0.9, label=f"closed form ({law})")
    depth.set_xlim(0.0, 1.5 * recording.time[np.argmax(far < 0.01 * far[0])])
    depth.legend(loc="upper right", fontsize="x-small", frameon=False)
    return drawing


for check in OWN_CHECKS:
    for right, name, broken, cases in contests(check):
        shown = next(
            (
                (case, passes, fails)
                for case in cases
                if check in case.checks
                and (fails := judged(name, broken, case, check)).verdicts[0].outcome == "fail"
                and (passes := judged("right", right, case, check)).verdicts[0].outcome == "pass"
            ),
            None,
        )
        if shown:
            for word, results in zip(("passes", "fails"), shown[1:], strict=True):
                drawn(results, shown[0]).savefig(PICTURES / f"check-{check}-{word}.svg", metadata={"Date": None})
            break
    else:
        print(f"{check}: no picture")
