"""Terminal, first page, Markdown, badge and JUnit say the same of how many verdicts there are of each standing."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET

import pytest
from hypothesis import given
from hypothesis import strategies as st
from reports_synthetic import synthetic_results, synthetic_run, verdict
from result_entries import changed

from hapticeval.api import Results
from hapticeval.commands.summary import summary
from hapticeval.phenomena.verdict import Finding, Level, Metric, Outcome
from hapticeval.reports.badge import badge_words
from hapticeval.reports.grid import is_sound
from hapticeval.reports.junit import junit
from hapticeval.reports.pages import ReportView, render_pages
from hapticeval.reports.table import markdown
from hapticeval.runner.standing import Standing, count_standings, counts_in_words

ENTRIES = {
    Standing.ERROR: {"outcome": Outcome.ERROR},
    Standing.FAIL: {"outcome": Outcome.FAIL},
    Standing.DIFFERS: {"outcome": Outcome.FAIL, "published": Outcome.PASS},
    Standing.UNDECIDED: {"outcome": Outcome.INCONCLUSIVE},
    Standing.WARNING: {"outcome": Outcome.FAIL, "level": Level.SHOULD},
    Standing.OUTDATED: {"outcome": Outcome.PASS, "known": "a limit"},
    Standing.KNOWN: {"outcome": Outcome.FAIL, "known": "a limit"},
    Standing.INHERENT: {"outcome": Outcome.FAIL, "inherent": "a theorem"},
    Standing.PASS: {"outcome": Outcome.PASS},
    Standing.NOT_JUDGED: {"outcome": Outcome.FAIL, "level": Level.INFO},
    Standing.NOT_APPLICABLE: {"outcome": Outcome.NOT_APPLICABLE},
}


def entry(standing, number):
    given = {"level": Level.MUST, "published": None, "known": None, "inherent": "", **ENTRIES[standing]}
    finding = Finding(given.pop("outcome"), "seen", Metric("m", 1.0, "m"), 1.0)
    made = verdict(f"c{number}", "plain", "continuous-contact", finding, given.pop("level"), given.pop("published"))
    excused = bool(given["known"] or given["inherent"])
    return changed(made, **given, as_expected=made.as_expected or excused)


@pytest.mark.parametrize("standing", Standing)
def test_each_standing_can_be_had(standing):
    assert entry(standing, 0).standing is standing


def results_with(standings, *, strict=False):
    verdicts = [entry(standing, number) for number, standing in enumerate(standings)]
    runs = [synthetic_run(f"c{number}", "plain", "circle") for number in range(len(standings))]
    return synthetic_results(verdicts=verdicts, runs=runs, strict=strict)


@given(standings=st.lists(st.sampled_from(Standing), min_size=1, max_size=12), strict=st.booleans())
def test_texts_count_as_not_as_expected_what_the_exit_code_stops_for(standings, strict):
    results = results_with(standings, strict=strict)
    stops = sum(results.stops(verdict) for verdict in results.verdicts)
    assert Results(results).exit_code == int(stops > 0)
    strict_only = [Standing.WARNING, Standing.OUTDATED] if strict else []
    words = counts_in_words(standing for standing in standings if standing in strict_only)
    reason = f" (by --strict: {words})" if set(standings) & set(strict_only) else ""
    assert f"; {stops or 'none'} not as expected{reason}" in summary(results, [])
    title = markdown(results).splitlines()[0]
    assert (f" not as expected{reason}" in title) == (stops > 0)
    assert ("Every verdict is as expected" in title) == (stops == 0)
    assert is_sound(results) == (stops == 0)
    assert (badge_words(results)[1] == "red") == (stops > 0)
    view = ReportView(results)
    assert view.unexpected_count == sum(standing in view.unexpected_standings for standing in standings) == stops
    assert any(section.grave for section in view.suites) == (stops > 0)
    failed = sum(child.tag in ("failure", "error") for case in ET.fromstring(junit(results)).iter() for child in case)
    assert failed == stops


@given(standings=st.lists(st.sampled_from(Standing), min_size=1, max_size=12))
def test_one_count_and_one_set_of_words(standings):
    results = results_with(standings)
    words = counts_in_words(standings)
    assert f"verdicts ran: {words}" in summary(results, []).replace("verdict ran", "verdicts ran")
    assert f"verdicts ran: {words}" in markdown(results).replace("verdict ran", "verdicts ran")
    page = re.sub(r"\s+", " ", re.sub(r"<[^>]*>", "", render_pages(ReportView(results))["index.html"]))
    for standing, count in count_standings(standings):
        assert f"{count} {standing.plural}" in page
    text, _ = badge_words(results)
    judged = [standing for standing in standings if standing.judged]
    assert (f"{judged.count(Standing.PASS)}/{len(judged)} pass" in text) == bool(judged)
    for standing in (Standing.KNOWN, Standing.INHERENT):
        if standing in judged:
            assert f"{judged.count(standing)} {standing.words}" in text
    cases = list(ET.fromstring(junit(results)).iter("testcase"))
    assert len(cases) == len(standings)
    failed = sum(child.tag in ("failure", "error") for case in cases for child in case)
    assert failed == sum(standing.unexpected for standing in standings)
