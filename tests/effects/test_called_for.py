"""What a scene does not call for is not imported, not assembled and not run."""

from __future__ import annotations

import subprocess
import sys

import pytest

from hapticeval.effects.catalogue import EFFECTS

JUDGES = """
import sys
from hapticeval.discovery import resolve
from hapticeval.runner.judging import judge
from hapticeval.suite.reading import load_suite
case = next(each for each in load_suite({suite!r}).cases if each.name == {case!r})
found = judge(resolve({name!r}), {name!r}, {suite!r}, case)
assert found.verdicts
print(*sorted(each for each in sys.modules if each.startswith("hapticeval.effects.")))
"""


def imported(code):
    """Return the modules of effects that a process of its own has imported at the end, as it prints them."""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return {each.removeprefix("hapticeval.effects.") for each in done.stdout.split()}


@pytest.mark.parametrize("kind", EFFECTS)
def test_an_entry_leads_to_the_class_of_its_kind(kind):
    entry = EFFECTS[kind]
    assert entry.of.kind == kind
    fields = set(entry.of.__dataclass_fields__)
    assert set(entry.short.values()) <= {*fields, ""}


@pytest.mark.parametrize(
    ("name", "suite", "case", "called"),
    [
        ("minimum-distance", "thesis", "circle-slide", set()),
        ("set-stabilisation", "dynamics-surfaces", "ellipsoid-off-robot", set()),
        (
            "minimum-distance",
            "dynamics-line",
            "line",
            {"encoder", "velocity_filter", "delay", "saturation", "joint_friction"},
        ),
    ],
)
def test_a_process_imports_the_effects_that_its_suite_calls_for_and_no_other(name, suite, case, called):
    assert imported(JUDGES.format(name=name, suite=suite, case=case)) == {"catalogue", "effect"} | called
