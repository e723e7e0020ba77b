"""Lists of known failures: what they excuse, what they refuse, and how one is made of results."""

import math
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
from hapticeval.runner.known import UNEXPLAINED, Known, KnownEntry, KnownVerdict, read_known, write_known
from hapticeval.runner.results import VerdictEntry
from hapticeval.suite.reading import load_suite

PLACE = "s/c/memoryless"
LISTED = KnownEntry(renderer="r", reason="a limit of the method", verdicts=(PLACE,))
KNOWN = Known({("r", PLACE): LISTED}, "known.toml")


def verdict(
    outcome=Outcome.FAIL, *, case="c", level=Level.MUST, value=2e-3, published=None, message="what was seen",
    metric="IHIP apart", **evidence,
):  # fmt: skip
    bound = max(1e-3, value) if outcome is Outcome.PASS else 1e-3
    finding = Finding(outcome, message, Metric(metric, value, "m"), bound, evidence)
    return VerdictEntry.of(Verdict("r", "s", case, "memoryless", level, finding, published))


def gate(*verdicts, strict=False):
    return Results(results_of(*map(KNOWN.marked, verdicts), strict=strict)).exit_code


@pytest.mark.parametrize(
    ("outcome", "code", "strict_code", "standing"),
    [
        (Outcome.FAIL, 0, 0, "known"),
        (Outcome.INCONCLUSIVE, 1, 1, "undecided"),
        (Outcome.PASS, 0, 1, "outdated"),
        (Outcome.NOT_APPLICABLE, 0, 1, "outdated"),
        (Outcome.ERROR, 1, 1, "error"),
    ],
)
def test_what_a_known_failure_excuses(outcome, code, strict_code, standing):
    assert gate(verdict(outcome)) == code
    assert gate(verdict(outcome), strict=True) == strict_code
    assert KNOWN.marked(verdict(outcome)).standing == standing


SIZED = Known().renewed(results_of(verdict(value=2e-3, kind="mini", region="surface")))
"""A list of one failure of 2 mm, whose check grants 1 mm to the sampling."""


@pytest.mark.parametrize(
    ("now", "beyond"),
    [
        ({}, ""),
        ({"value": 1.5e-3}, ""),
        ({"value": 2.99e-3}, ""),
        ({"value": 3.01e-3}, "worse than known: 3.01 mm, and known is 2 mm"),
        ({"value": math.inf}, "worse than known: not finite, and known is 2 mm"),
        ({"kind": "major"}, "another failure than the known one: 'major', and known is 'mini'"),
        ({"region": "convex corner"}, "at another place than the known one: 'convex corner', and known is 'surface'"),
    ],
)
def test_a_known_failure_excuses_none_that_is_worse_of_another_kind_or_elsewhere(now, beyond):
    """Two measures of one fault differ by what the check grants to the sampling, its bound, at the most."""
    marked = SIZED.marked(verdict(**{"kind": "mini", "region": "surface"} | now))
    assert (marked.standing, marked.as_expected) == (("fail", False) if beyond else ("known", True))
    assert (marked.beyond_known or "").startswith(beyond)
    assert marked.measured.endswith(f"{beyond} ({SIZED.entries['r', PLACE].reason})" if beyond else "bound 1 mm")


def test_a_failure_that_is_measured_by_another_metric_is_another():
    assert SIZED.marked(verdict(kind="", region="surface", metric="distance off")).standing == "fail"
    listed = Known().renewed(results_of(verdict(metric="distance off")))
    assert listed.marked(verdict(metric="distance off")).standing == "known"


def test_an_infinite_failure_is_known_as_such(tmp_path):
    write_known(tmp_path / "known.toml", Known().renewed(results_of(verdict(value=math.inf))))
    listed = read_known(tmp_path / "known.toml")
    assert [listed.marked(verdict(value=value)).standing for value in (1.0, math.inf)] == ["known"] * 2


def test_a_list_without_sizes_excuses_any_and_says_so():
    assert KNOWN.marked(verdict(value=9.0)).standing == "known"
    (remark,) = KNOWN.unsized()
    assert remark.startswith("known.toml lists 1 failure without a size, and so excuses them at any size: ")
    assert SIZED.unsized() == Known().unsized() == ()


def test_a_reason_that_nobody_has_given_excuses_and_is_told():
    listed = Known({}, "known.toml").renewed(results_of(verdict(value=9.0)))
    assert listed.marked(verdict(value=9.0)).standing == "known"
    assert listed.remarks(["mine:Nearest"], ["thesis"])[-1] == (
        "known.toml lists 1 verdict with a reason that is 'not explained yet': write why"
    )
    explained = Known({place: changed(entry, reason="why") for place, entry in listed.entries.items()})
    assert explained.unexplained() == ()


def test_what_could_not_be_decided_has_no_size():
    listed = Known().renewed(results_of(verdict(Outcome.INCONCLUSIVE)))
    assert listed.marked(verdict(Outcome.INCONCLUSIVE, value=9.0)).standing == "known"
    assert listed.unsized() == ()


@pytest.mark.parametrize(("now", "size"), [(1e-3, 1e-3), (2e-3, 2e-3), (2.9e-3, 2e-3)])
def test_renewing_a_list_takes_sizes_down_and_never_up(now, size):
    """Else a failure could grow by a bound with each renewal."""
    now = verdict(value=now, kind="mini", region="surface")
    (entry,) = SIZED.renewed(results_of(SIZED.marked(now))).entries.values()
    assert entry.verdicts[0].metric == size


def test_renewing_a_list_takes_what_is_worse_as_a_new_failure():
    worse = SIZED.marked(verdict(value=9e-3, kind="major", region="surface", message="far"))
    known = Known({place: changed(entry, reason="why") for place, entry in SIZED.entries.items()})
    (entry,) = known.renewed(results_of(worse)).entries.values()
    assert entry.verdicts[0].metric == 9e-3
    assert entry.reason == f"{UNEXPLAINED}: far (s/c)"


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
    assert renewed.entries["r", PLACE] == changed(LISTED, verdicts=(KnownVerdict.of(verdict()),)), "with its size"
    assert renewed.entries["r", "s/f/memoryless"].reason == f"{UNEXPLAINED}: far (s/g)"
    assert all(renewed.marked(each).standing in ("known", "pass") for each in seen)


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


SIZES = st.none() | st.fixed_dictionaries(
    {"metric": st.none() | st.floats(allow_nan=False), "unit": st.sampled_from(["", "m"]), "kind": TEXT, "region": TEXT}
)


@given(
    st.dictionaries(st.tuples(TEXT, st.tuples(NAME, NAME, NAME).map("/".join)), st.tuples(TEXT, st.booleans(), SIZES))
)
def test_what_is_written_is_read_again(tmp_path_factory, listed):
    file = tmp_path_factory.mktemp("known") / "known.toml"
    entries = {
        (renderer, place): KnownEntry(
            renderer=renderer,
            reason=reason,
            verdicts=(place if size is None else KnownVerdict(verdict=place, **size),),
            outcome="fail" if fails else "inconclusive",
        )
        for (renderer, place), (reason, fails, size) in listed.items()
    }
    write_known(file, Known(entries))
    assert read_known(file).entries == entries
    before = file.read_bytes()
    write_known(file, read_known(file))
    assert file.read_bytes() == before


ENTRY = '[[known]]\nrenderer = "r"\nreason = "why"\nverdicts = ["s/c/memoryless"]\n'


@pytest.mark.parametrize(
    "text",
    [
        ENTRY.replace("why", " "),
        ENTRY.replace("reason", "raeson"),
        ENTRY.replace('reason = "why"\n', ""),
        ENTRY.replace("s/c/memoryless", "c/memoryless"),
        ENTRY.replace('["s/c/memoryless"]', "[]"),
        ENTRY.replace('"s/c/memoryless"', '{ verdict = "s/c/memoryless", metric = nan }'),
        ENTRY.replace('"s/c/memoryless"', '{ verdict = "s/c/memoryless", matric = 1.0 }'),
        ENTRY + 'outcome = "pass"\n',
        ENTRY + ENTRY.replace("why", "another"),
        "[[known]\n",
        "[known]\n",
    ],
)
def test_what_cannot_be_meant_is_refused(refused, tmp_path, text):
    file = tmp_path / "known.toml"
    file.write_text(text)
    with refused(InputError):
        read_known(file)


def test_an_empty_list_knows_nothing(tmp_path):
    (tmp_path / "known.toml").write_text("")
    assert not read_known(tmp_path / "known.toml").entries


@pytest.mark.parametrize(
    "place",
    ["thesis/star-convex-cornr/memoryless", "thesis/plane-press/memoryles"],
)
def test_an_entry_without_its_case_or_check_is_refused(refused, place):
    entries = {("r", place): changed(LISTED, verdicts=(place,))}
    with refused(InputError):
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
