"""Verdicts as JUnit XML, which every CI service shows: a testsuite per (suite, renderer), a testcase per (case, check).

A testcase fails exactly where the verdict is not as expected, as the exit code of a run does:

- a failure that is published passes and says so
- an outcome that differs from the published one fails even if it is a pass
- a warning, as a check of level should gives, passes and says so, and fails where the run was strict
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET

from hapticeval.phenomena.verdict import Outcome
from hapticeval.reports.table import ran_words
from hapticeval.runner.results import ResultsDocument, RunEntry, VerdictEntry
from hapticeval.runner.standing import Standing

NOT_XML = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""Characters that XML 1.0 cannot hold."""


def junit(results: ResultsDocument) -> str:
    """Return the XML text; an incomplete run has a testcase of its own that is in error and says why."""
    root = ET.Element("testsuites", name="hapticeval", time=f"{results.timing.wall_seconds:.3f}")
    suites: dict[tuple[str, str], ET.Element] = {}
    ended = {run.key: run.ended_words for run in results.runs}

    def suite_of(entry: RunEntry | VerdictEntry) -> ET.Element:
        key = (entry.suite, entry.renderer)
        if key not in suites:
            suites[key] = ET.SubElement(root, "testsuite", name=_xml_text(": ".join(key)), time="0")
            _add_provenance(suites[key], results, entry)
        return suites[key]

    for run in results.runs:
        suite = suite_of(run)
        suite.set("time", f"{float(suite.get('time', '0')) + run.wall_seconds:.3f}")
        # With verdicts, each of them carries the error; without any, the run is a testcase.
        if run.error and run.key not in results.verdicts_of:
            text = "\n".join(filter(None, (run.error.why, run.error.todo)))
            _add_result(_add_testcase(suite, run, "run"), "error", run.error.what, text)
    for verdict in results.verdicts:
        case = _add_testcase(suite_of(verdict), verdict, verdict.check)
        _add_verdict(case, verdict, ended.get(verdict.key, ""), stopped=results.stops(verdict))
    if not results.complete:
        suite = ET.SubElement(root, "testsuite", name="hapticeval: completeness", time="0")
        case = ET.SubElement(suite, "testcase", classname="hapticeval", name="every planned verdict ran")
        _add_result(case, "error", ran_words(results), "Verdicts that did not run are not shown below or above.")
    # Counted last, when every testcase has its outcome; the root counts those of all suites.
    for element in (*root, root):
        for name, tag in (("tests", "testcase"), ("failures", "failure"), ("errors", "error"), ("skipped", "skipped")):
            element.set(name, str(sum(1 for _ in element.iter(tag))))
    ET.indent(root)
    return ET.tostring(root, encoding="unicode", xml_declaration=True) + "\n"


def _add_provenance(suite: ET.Element, results: ResultsDocument, entry: RunEntry | VerdictEntry) -> None:
    """Date, versions and commit, which a reader of the file alone wants to know."""
    if results.date:
        suite.set("timestamp", results.date)
    property_values = {
        "hapticeval": results.environment.versions.get("hapticeval"),
        "suite": results.suite_label(entry.suite),
        "commit": results.commits.get(entry.renderer),
    }
    properties = ET.SubElement(suite, "properties")
    for name, value in property_values.items():
        if value:
            ET.SubElement(properties, "property", name=name, value=_xml_text(value))


def _add_testcase(suite: ET.Element, entry: RunEntry | VerdictEntry, name: str) -> ET.Element:
    """The renderer is a part of the name: CI services tell testcases apart by class and name alone."""
    classname, name = _xml_text(f"{entry.suite}.{entry.case}"), _xml_text(f"{name} [{entry.renderer}]")
    return ET.SubElement(suite, "testcase", classname=classname, name=name)


def _add_verdict(case: ET.Element, verdict: VerdictEntry, ended: str, *, stopped: bool) -> None:
    """Add to a testcase what a verdict means for a gate: an error, a failure, a skip, or a word."""
    outcome, published = verdict.outcome, verdict.published
    figures = verdict.measured
    text = verdict.message + (f" ({figures})" if figures else "") + (f"; the run {ended}" if ended else "")
    standing = verdict.standing
    warning = "warning: " if standing is Standing.WARNING else ""
    if outcome is Outcome.ERROR:
        _add_result(case, "error", text)
    # What fails the gate, strict or not, is a failure here too.
    elif stopped:
        differs = f"{outcome}, published {published}: " if standing is Standing.DIFFERS else ""
        if standing is Standing.OUTDATED:
            differs = f"{outcome}, and on the list of known failures ({verdict.known}): "
        more = "The outcome differs from the published one." if standing is Standing.DIFFERS else ""
        _add_result(case, "failure", differs + text, more)
    elif outcome in (Outcome.INCONCLUSIVE, Outcome.NOT_APPLICABLE):
        _add_result(case, "skipped", f"{warning}{outcome}: {text}")
    elif outcome is Outcome.FAIL:
        why = {
            Standing.KNOWN: f"fails, and is known: {verdict.known}",
            Standing.INHERENT: f"fails, which is inherent: {verdict.inherent}",
        }.get(standing, f"fails; level {verdict.level} stops no gate")
        ET.SubElement(case, "system-out").text = _xml_text(f"{warning}{why}: {text}")


def _add_result(case: ET.Element, kind: str, message: str, text: str = "") -> None:
    """Add an outcome to a testcase, with its message and a longer text."""
    element = ET.SubElement(case, kind, message=_xml_text(message))
    # The schema has no type for what was skipped.
    if kind != "skipped":
        element.set("type", kind)
    element.text = _xml_text(text) or None


def _xml_text(text: str) -> str:
    """Without the characters that XML 1.0 has no way to write: a renderer's message may hold any."""
    return NOT_XML.sub("\ufffd", text)
