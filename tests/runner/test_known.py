"""Lists of known failures: what they excuse, what they refuse, and how one is made of results."""

import tomllib
import xml.etree.ElementTree as ET
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from result_entries import changed, results_of

from hapticeval.api import Results
from hapticeval.errors import InputError
from hapticeval.phenomena.verdict import Finding, Level, Metric, Outcome, Verdict
from hapticeval.reports import junit
from hapticeval.runner.known import UNEXPLAINED, Known, KnownEntry, read_known, write_known
from hapticeval.runner.results import VerdictEntry
from hapticeval.suite.reading import load_suite

PLACE = "s/c/memoryless"
LISTED = KnownEntry(renderer="r", reason="a limit of the method", verdicts=(PLACE,))
KNOWN = Known({("r", PLACE): LISTED}, "known.toml")


def verdict(outcome=Outcome.FAIL, *, case="c", level=Level.MUST, value=2e-3, published=None, message="what was seen"):
    finding = Finding(outcome, message, Metric("jump", value, "m"), 1e-3)
    return VerdictEntry.of(Verdict("r", "s", case, "memoryless", level, finding, published))


def gate(*verdicts, strict=False):
    return Results(results_of(*map(KNOWN.marked, verdicts), strict=strict)).exit_code


@pytest.mark.parametrize(
    ("outcome", "code", "strict_code", "standing"),
    [
        (Outcome.FAIL, 0, 0, "known"),
        (Outcome.INCONCLUSIVE, 1, 1, "unexpected"),
        (Outcome.PASS, 0, 1, "outdated"),
        (Outcome.NOT_APPLICABLE, 0, 1, "outdated"),
        (Outcome.ERROR, 1, 1, "unexpected"),
    ],
)
def test_what_a_known_failure_excuses(outcome, code, strict_code, standing):
    assert gate(verdict(outcome)) == code
    assert gate(verdict(outcome), strict=True) == strict_code
    assert KNOWN.marked(verdict(outcome)).standing == standing


def test_a_known_warning_does_not_warn_in_a_strict_run():
    assert gate(verdict(level=Level.SHOULD), strict=True) == 0
    assert gate(verdict(level=Level.SHOULD, case="d"), strict=True) == 1


def test_what_a_suite_publishes_yields_to_the_list():
    assert gate(verdict(published=Outcome.PASS)) == 0


def test_a_renewed_list_has_what_stops_the_gate_and_nothing_that_passes():
    others = {("r", f"s/{case}/memoryless"): changed(LISTED, verdicts=(f"s/{case}/memoryless",)) for case in "de"}
    known = Known({**KNOWN.entries, **others}, "known.toml")
    seen = [verdict(), verdict(Outcome.PASS, case="d"), verdict(case="f"), verdict(case="g", value=9e-3, message="far")]
    renewed = known.renewed(results_of(*map(known.marked, [*seen, verdict(case="h", level=Level.SHOULD)])))
    assert {place.split("/")[1] for _, place in renewed.entries} == {"c", "e", "f", "g"}, "e has not run, h only warns"
    assert renewed.entries["r", PLACE] == LISTED
    assert renewed.entries["r", "s/f/memoryless"].reason == f"{UNEXPLAINED}: far (s/g)"
    assert all(renewed.marked(each).standing in ("known", "") for each in seen)


@pytest.mark.parametrize(
    ("outcome", "strict", "kinds", "words"),
    [
        (Outcome.FAIL, True, ["system-out"], "fails, and is known: a limit of the method"),
        (Outcome.PASS, False, [], ""),
        (Outcome.PASS, True, ["failure"], "pass, and on the list of known failures (a limit of the method)"),
    ],
)
def test_a_known_failure_passes_in_junit_with_its_reason(outcome, strict, kinds, words):
    root = ET.fromstring(junit(results_of(KNOWN.marked(verdict(outcome)), strict=strict)))
    found = [child for case in root.iter("testcase") for child in case]
    assert [child.tag for child in found] == kinds
    assert all(words in (child.get("message") or child.text) for child in found)


def test_a_reason_is_short():
    long = "pop-through: the IHIP jumps 33.3 mm at t = 4 s, and the jump stays; besides, it lies 30.6 mm off"
    known = Known(source="known.toml").renewed(results_of(verdict(message=long), verdict(case="d", message="ha" * 99)))
    (first,) = {each.reason for each in known.entries.values()}
    assert first == f"{UNEXPLAINED}: pop-through: the IHIP jumps 33.3 mm at t = 4 s (s/c)"


def test_a_renderer_that_does_not_run_is_named_with_what_may_be_meant():
    places = {("mine:Nearst", f"s/{case}/memoryless"): LISTED for case in "cd"}
    known = Known({**places, ("constraint", PLACE): LISTED, ("r", PLACE): LISTED}, "known.toml")
    assert known.unplanned(["r", "mine:Nearest"], ["s"]) == (
        "known.toml lists 'mine:Nearst' (2 verdicts), which does not run here: did you mean mine:Nearest?",
    )


def test_a_suite_that_does_not_run_is_named_with_what_may_be_meant():
    """A sibling of a suite of the user's own is no misspelt one: the list serves runs of either."""
    sibling, misspelt, installed = (f"{name}/c/memoryless" for name in ("walls-3d", "thesys", "generated"))
    known = Known({("r", place): LISTED for place in (sibling, misspelt, installed)}, "known.toml")
    known.check([replace(load_suite("thesis"), name="walls-2d"), load_suite("thesis")])
    assert known.unplanned(["r"], ["walls-2d", "thesis"]) == (
        "known.toml lists suite 'walls-3d' (1 verdict), which does not run here: did you mean walls-2d?",
        "known.toml lists suite 'thesys' (1 verdict), which does not run here: did you mean thesis?",
    )


TEXT = st.text(st.characters(codec="utf-8"), min_size=1).filter(str.strip)
NAME = st.text(st.characters(codec="utf-8", exclude_characters="/"), min_size=1)


@given(st.dictionaries(st.tuples(TEXT, st.tuples(NAME, NAME, NAME).map("/".join)), st.tuples(TEXT, st.booleans())))
def test_what_is_written_is_read_again(tmp_path_factory, listed):
    file = tmp_path_factory.mktemp("known") / "known.toml"
    entries = {
        (renderer, place): KnownEntry(
            renderer=renderer, reason=reason, verdicts=(place,), outcome="fail" if fails else "inconclusive"
        )
        for (renderer, place), (reason, fails) in listed.items()
    }
    write_known(file, Known(entries))
    found = read_known(file).entries
    assert {place: (each.reason, each.outcome) for place, each in found.items()} == {
        place: (each.reason, each.outcome) for place, each in entries.items()
    }
    before = file.read_bytes()
    write_known(file, read_known(file))
    assert file.read_bytes() == before


ENTRY = '[[known]]\nrenderer = "r"\nreason = "why"\nverdicts = ["s/c/memoryless"]\n'


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (ENTRY.replace("why", " "), "known.toml: known[0]: the reason why 's/c/memoryless' is known to fail is empty"),
        (ENTRY.replace("reason", "raeson"), "did you mean reason?"),
        (ENTRY.replace('reason = "why"\n', ""), "missing required field `reason`"),
        (ENTRY.replace("s/c/memoryless", "c/memoryless"), "'c/memoryless' names no verdict"),
        (ENTRY.replace('["s/c/memoryless"]', "[]"), "known.toml: known[0].verdicts"),
        (ENTRY + 'outcome = "pass"\n', "known: fail, inconclusive"),
        (ENTRY + ENTRY.replace("why", "another"), "'s/c/memoryless' of r is listed twice"),
        ("[[known]\n", "known.toml is not TOML"),
        ("[known]\n", "known.toml: known"),
    ],
)
def test_what_cannot_be_meant_is_refused(tmp_path, text, message):
    file = tmp_path / "known.toml"
    file.write_text(text)
    with pytest.raises(InputError) as caught:
        read_known(file)
    assert message in str(caught.value)


def test_an_empty_list_knows_nothing(tmp_path):
    (tmp_path / "known.toml").write_text("")
    assert not read_known(tmp_path / "known.toml").entries


@pytest.mark.parametrize(
    ("place", "meant"),
    [("thesis/star-convex-cornr/memoryless", "star-convex-corner"), ("thesis/plane-press/memoryles", "reset-clears")],
)
def test_an_entry_without_its_case_or_check_is_refused(place, meant):
    entries = {("r", place): changed(LISTED, verdicts=(place,))}
    with pytest.raises(InputError, match=meant):
        Known(entries, "known.toml").check([load_suite("thesis")])
    Known(entries).check([load_suite("generated")])


def test_the_worst_is_an_error_then_what_is_the_most_bounds_away():
    least, most = verdict(value=1.1e-3), verdict(value=float("inf"))
    error = verdict(Outcome.ERROR)
    assert sorted([most, error, least], key=lambda each: each.severity) == [least, most, error]


def test_the_file_that_is_written_explains_itself(tmp_path):
    write_known(tmp_path / "known.toml", KNOWN)
    text = (tmp_path / "known.toml").read_text()
    assert text.startswith("# Known failures")
    assert tomllib.loads(text)["known"] == [
        {"renderer": "r", "outcome": "fail", "reason": LISTED.reason, "verdicts": [PLACE]}
    ]
