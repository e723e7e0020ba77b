"""A check of another package: found by its entry point, chosen in a suite file, judged, explained and shown."""

from __future__ import annotations

import dataclasses
import json
from pkgutil import iter_modules

import numpy as np
import pytest

from hapticeval.cli import main
from hapticeval.errors import InputError, UnknownNameError
from hapticeval.geometry.catalogue import circle, star
from hapticeval.phenomena import checks
from hapticeval.phenomena.check import SIBLINGS, Check, Runs, Situation
from hapticeval.phenomena.checks import relations
from hapticeval.phenomena.registry import CHECKS, OWN_CHECKS, PHENOMENA
from hapticeval.phenomena.verdict import Metric, Outcome, compared, undecided
from hapticeval.recordings.recording import Recording
from hapticeval.scene import Scene

TOY = """
from hapticeval.phenomena.check import Check
from hapticeval.phenomena.verdict import Metric, compared

def judge(runs, scene):
    strongest = float(abs(runs.base.force).max())
    return compared(Metric("largest force", strongest, "N"), 0.5, {}, passes="weak", fails="too strong")

CHECK = Check(
    id="toy-strength", phenomenon="none", formula="|F| <= 0.5 N", citation="a toy",
    channels=("force",), metric="largest force", unit="N", judge=judge,
    page="# toy-strength\\n\\nIs it weak?\\n\\n## Bound\\n\\nhalf a newton\\n",
)
OTHER = 3
"""

SUITE = """
title = "toys"
[[case]]
name = "press"
title = "Press"
model = { kind = "circle" }
checks = ["toy-strength", "reset-clears"]
trajectory = { kind = "points", points = [[0.11, 0.0], [0.098, 0.0]], duration = 0.05 }
"""


@pytest.fixture
def toy(tmp_path, monkeypatch):
    """A folder on the path with a distribution that registers one good check and three that are none."""
    (tmp_path / "toychecks.py").write_text(TOY)
    info = tmp_path / "toychecks-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: toychecks\nVersion: 1.0\n")
    names = {
        "toy-strength": "CHECK",
        "toy-other": "OTHER",
        "toy-renamed": "CHECK",
        "passivity": "CHECK",
        "toy-gone": "X",
    }
    lines = [f"{name} = toychecks:{value}" for name, value in names.items()]
    (info / "entry_points.txt").write_text("[hapticeval.checks]\n" + "\n".join(lines))
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.chdir(tmp_path)
    (tmp_path / "toys.toml").write_text(SUITE)
    return tmp_path


@pytest.fixture
def command(capsys):
    def run(*words):
        main(list(words))
        shown = capsys.readouterr()
        return " ".join((shown.out + shown.err).split())

    return run


def test_an_installed_check_is_listed_explained_judged_and_reported(toy, command):
    assert "toy-strength" not in OWN_CHECKS
    assert "Is it weak?" in command("list", "checks")
    assert "half a newton" in command("explain", "toy-strength")
    ran = command("run", "toys.toml", "-r", "minimum-distance", "-o", "out")
    verdicts = json.loads((toy / "out" / "results.json").read_text())["verdicts"]
    found = {verdict["check"]: (verdict["outcome"], verdict["metric"]["unit"]) for verdict in verdicts}
    assert found == {"toy-strength": ("fail", "N"), "reset-clears": ("pass", "N")}
    assert (toy / "out" / "report" / "index.html").exists(), ran
    assert "half a newton" in (toy / "out" / "report" / "reading.html").read_text()


@pytest.mark.parametrize("name", ["toy-other", "toy-renamed", "toy-gone"])
def test_an_entry_point_that_is_no_such_check_is_refused_by_name(refused, toy, command, name):
    with refused(InputError):
        CHECKS[name]
    assert "broken" in command("list", "checks")


def test_the_six_phenomena_are_listed_first_and_in_the_thesis_s_order():
    plain = [check for check in OWN_CHECKS.values() if not check.effects and not check.holds]
    of_phenomena = [check.phenomenon for check in plain if check.phenomenon in PHENOMENA]
    assert [check.phenomenon for check in plain][: len(of_phenomena)] == of_phenomena
    assert list(dict.fromkeys(of_phenomena)) == [name for name in PHENOMENA if name in of_phenomena]
    assert len(set(of_phenomena)) >= 5


def test_nobody_replaces_a_check_of_ours(toy):
    assert CHECKS["passivity"] is OWN_CHECKS["passivity"]
    assert list(CHECKS).count("passivity") == 1


def test_an_unknown_check_is_refused_with_the_closest(toy, command):
    (toy / "toys.toml").write_text(SUITE.replace("toy-strength", "toy-strenght"))
    assert "toy-strength" in command("run", "toys.toml", "-r", "minimum-distance")


# The data of a check

ROWS = np.zeros((3, 2))
NEEDY = Check(
    id="needy",
    phenomenon="",
    formula="",
    citation="",
    channels=("hip", "force"),
    siblings={"again": "the same again"},
    needs={"again": undecided("not again")},
    not_for={Situation.NO_CONVEX_CORNER: "no corner", Situation.BILATERAL: "held"},
    metric="",
    unit="",
    judge=lambda runs, scene: compared(Metric("", 0.0, ""), 0.0, {}, passes="judged", fails=""),
)


def recording(*channels):
    return Recording(1e-3 * np.arange(3), dict.fromkeys(channels, ROWS), {})


@pytest.mark.parametrize(
    ("model", "bilateral", "again", "channels", "expected"),
    [
        (circle(), False, True, ("hip", "force"), (Outcome.NOT_APPLICABLE, "no corner")),
        (star(), True, True, ("hip", "force"), (Outcome.NOT_APPLICABLE, "held")),
        (star(), False, False, ("hip",), (Outcome.INCONCLUSIVE, "not again")),
        (star(), False, True, ("hip",), (Outcome.INCONCLUSIVE, "no channel 'force'")),
        (star(), False, True, ("hip", "force"), (Outcome.PASS, "judged")),
    ],
)
def test_a_check_is_called_only_where_it_applies_and_has_what_it_needs(model, bilateral, again, channels, expected):
    base = recording(*channels)
    runs = Runs(base, again=(lambda: base) if again else None)
    finding = NEEDY(runs, Scene(model=model, bilateral=bilateral))
    assert finding.outcome is expected[0]
    assert expected[1] in finding.message


def test_a_sibling_that_there_is_not_is_refused_with_the_closest(refused):
    with refused(UnknownNameError):
        dataclasses.replace(NEEDY, siblings={"agian": "the same again"}, needs={})


@pytest.mark.parametrize("name", OWN_CHECKS)
def test_the_data_of_our_checks_is_of_one_piece(name):
    check = OWN_CHECKS[name]
    assert set(check.needs) <= set(check.siblings)
    assert not set(check.channels) & set(check.reads_also)
    for each in ("phenomenon", "formula", "citation", "metric"):
        assert getattr(check, each)
    assert check.needs_closed_form == (name == "closed-form")
    lacking = check(Runs(recording()), Scene(model=star()))
    assert lacking.outcome in (Outcome.INCONCLUSIVE, Outcome.NOT_APPLICABLE), "and breaks on none that lacks a channel"


def test_siblings_are_made_once():
    made = []
    runs = Runs(recording("hip"), refine=lambda factor: made.append(factor) or recording("hip")).remembered()
    assert runs.refine(2) is runs.refine(2)
    assert made == [2]
    assert set(SIBLINGS) == {each.name for each in dataclasses.fields(Runs)} - {"base"}


@pytest.mark.parametrize("check", OWN_CHECKS.values(), ids=OWN_CHECKS)
def test_a_module_is_named_after_its_check_or_the_family_of_effects_that_it_asks_of(check):
    """Who knows an id knows the file: `broken-contact` is in broken_contact.py, `friction-cone` in friction.py.

    Of the relations between runs, which are one family, any of its ids is found in relations.py.
    """
    name = check.id.replace("-", "_")
    names = [module.name for module in iter_modules(checks.__path__)]
    of_family = check.effects and name.split("_")[0] in names
    assert name in names or of_family or check in relations.CHECKS
