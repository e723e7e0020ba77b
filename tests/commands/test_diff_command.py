"""`hapticeval diff` and `hapticeval badge` on folders of results: formats, exit codes, wrong usage."""

import json
import xml.etree.ElementTree as ET

import pytest
from result_entries import changed, results_of

from hapticeval.cli import main
from hapticeval.phenomena.verdict import Finding, Level, Metric, Outcome, Verdict
from hapticeval.runner.results import VerdictEntry, write_results
from hapticeval.study.bench.document import BenchResults, SettingEntry, Times, write_bench


def verdict(case, outcome=Outcome.PASS, value=1e-4):
    finding = Finding(outcome, "50 % | <seen>", Metric("jump", value, "m"), 1e-3)
    return VerdictEntry.of(Verdict("mine:R", "s", case, "memoryless", Level.MUST, finding))


@pytest.fixture
def runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("old", "same", "new", "known"):
        (tmp_path / name).mkdir()
    known = changed(verdict("a", Outcome.FAIL, 4e-3), known="a limit", as_expected=True)
    before = results_of(verdict("a"), verdict("b"))
    write_results(tmp_path / "old", before)
    write_results(tmp_path / "same", before)
    write_results(tmp_path / "new", results_of(verdict("a", Outcome.FAIL, 4e-3), verdict("b", value=2e-4)))
    write_results(tmp_path / "known", results_of(known, verdict("b")))
    return tmp_path


def run_diff(capsys, *arguments):
    code = main(["diff", *arguments])
    return code, capsys.readouterr().out


def test_for_people(runs, capsys):
    code, text = run_diff(capsys, "old", "new/results.json")
    assert code == 1
    assert text.splitlines() == [
        "worse: mine:R on s/a/memoryless: pass, now fail",
        "  50 % | <seen>",
        "",
        "margin: mine:R on s/a/memoryless: jump 0.1 mm, now 4 mm: 3.9 bounds nearer to failing",
        "margin: mine:R on s/b/memoryless: jump 0.1 mm, now 0.2 mm: 0.1 bounds nearer to failing",
        "",
        "2 verdicts in both runs: 1 worse; 2 margins moved",
    ]


def test_nothing_that_changed_is_a_line(runs, capsys):
    assert run_diff(capsys, "old", "same", "--strict") == (
        0,
        "2 verdicts in both runs: none changed; 0 margins moved\n",
    )


def test_runs_of_two_names_say_why_nothing_is_compared(runs, capsys):
    (runs / "other").mkdir()
    write_results(runs / "other", results_of(changed(verdict("a"), renderer="mine:New")))
    code, text = run_diff(capsys, "old", "other")
    assert code == 0
    assert text.splitlines()[-1] == (
        "0 verdicts in both runs: 2 gone, 1 new; 0 margins moved; the runs have no renderer in common: give the old "
        "and the new version one name"
    )


def test_runs_of_other_cases_say_why_nothing_is_compared(runs, capsys):
    (runs / "other").mkdir()
    write_results(runs / "other", results_of(changed(verdict("a"), case="another")))
    code, text = run_diff(capsys, "old", "other")
    assert code == 0
    assert text.splitlines()[-1].endswith(
        "; the runs have no check of one case in common: give both the same suites and -k"
    )


def test_as_annotations_of_github(runs, capsys):
    code, text = run_diff(capsys, "old", "new", "--format", "github")
    assert code == 1
    assert text.splitlines() == [
        "::error title=mine%3AR on s/a/memoryless::worse: pass, now fail: 50 %25 | <seen>",
        "::notice title=hapticeval::2 verdicts in both runs: 1 worse; 2 margins moved",
    ]


def test_as_markdown_that_no_message_can_break(runs, capsys):
    _, text = run_diff(capsys, "old", "new", "--format", "markdown")
    assert text.startswith("**hapticeval**: 2 verdicts in both runs: 1 worse; 2 margins moved\n")
    assert "| worse | mine:R" in text
    assert "50 % \\| &lt;seen>" in text


def test_as_json(runs, capsys):
    document = json.loads(run_diff(capsys, "old", "new", "--format", "json")[1])
    assert document["compared"] == 2
    assert [(each["standing"], each["now"]) for each in document["verdicts"]] == [("worse", "fail")]
    assert [round(each["by"], 9) for each in document["margins"]] == [-3.9, -0.1]
    assert document["times"] == []


@pytest.mark.parametrize(
    ("arguments", "code"),
    [(["old", "known"], 0), (["old", "known", "--strict"], 1), (["new", "old"], 0), (["new", "old", "--strict"], 0)],
)
def test_exit_codes(runs, capsys, arguments, code):
    assert run_diff(capsys, *arguments)[0] == code


def bench(folder, factor):
    """A bench of three settings, the first of which takes `factor` times as long."""
    nothing = dict.fromkeys(("claims", "proven", "memory_bytes", "problem"))
    some = {
        "renderer": "r",
        "model": "star",
        "settings": {},
        "errors": {"ihip": {"p99": 1e-4, "max": 1e-4}},
        "build_seconds": [],
    }
    entries = []
    for key, median in enumerate((5e-6 * factor, 5e-6, 5e-6)):
        step = Times(median=median, p99=2.0 * median, rounds=[0.99 * median, 1.01 * median])
        entries.append(SettingEntry(**nothing, **some, step=step, label=f"setting {key}", key=f"s{key}", front=False))
    document = BenchResults(
        complete=True, reason=None, quick=True, seed=0, rounds=8, environment={}, machine={}, command={}, references=[],
        settings=entries, orders=[], answers=[], timing={},
    )  # fmt: skip
    write_bench(folder, document)


def test_times_of_benches_that_moved(runs, capsys):
    bench(runs / "old", 1.0)
    assert "time" not in run_diff(capsys, "old", "same")[1], "only one of the folders holds a bench"
    bench(runs / "same", 1.5)
    code, text = run_diff(capsys, "old", "same")
    assert code == 0
    assert "time: setting 0 on star: step 1.5 times what it was, worse" in text
    assert text.endswith("none changed; 0 margins moved, 1 time moved\n")
    assert run_diff(capsys, "old", "same", "--strict")[0] == 1
    assert "::warning title=time::setting 0 on star" in run_diff(capsys, "old", "same", "--format", "github")[1]
    assert "- setting 0 on star: step 1.5 times" in run_diff(capsys, "old", "same", "--format", "markdown")[1]
    document = json.loads(run_diff(capsys, "old", "same", "--format", "json")[1])
    assert [(each["what"], each["verdict"]) for each in document["times"]] == [("step", "worse")]
    assert run_diff(capsys, "same", "old", "--strict")[0] == 0, "better"


@pytest.mark.parametrize("arguments", [["old", "absent"], ["absent", "new"], ["old", "new", "--format", "xml"]])
def test_wrong_usage(runs, capsys, arguments):
    assert main(["diff", *arguments]) == 2


@pytest.mark.parametrize(
    ("folder", "message", "colour"),
    [("old", "2/2 pass", "brightgreen"), ("new", "1/2 pass", "red"), ("known", "1/2 pass, 1 known", "yellow")],
)
def test_a_badge(runs, folder, message, colour):
    assert main(["badge", folder, "-o", "badges"]) == 0
    shields = json.loads((runs / "badges" / "badge.json").read_text())
    assert shields == {"schemaVersion": 1, "label": "hapticeval", "message": message, "color": colour}
    picture = ET.fromstring((runs / "badges" / "badge.svg").read_text())
    assert picture.get("aria-label") == f"hapticeval: {message}"
    assert [each.text for each in picture.iter("{http://www.w3.org/2000/svg}text")] == ["hapticeval", message]


def test_a_badge_of_a_run_that_did_not_end_or_judged_nothing(runs):
    for name, results, message in (
        ("cut", results_of(verdict("a"), planned=2, complete=False, reason="killed"), "incomplete: 1/1 pass"),
        ("none", results_of(), "nothing judged"),
    ):
        (runs / name).mkdir()
        write_results(runs / name, results)
        assert main(["badge", name]) == 0
        assert json.loads((runs / name / "badge.json").read_text()) == {
            "schemaVersion": 1, "label": "hapticeval", "message": message, "color": "lightgrey"
        }  # fmt: skip


def test_a_badge_of_nothing(runs, capsys):
    assert main(["badge", "absent"]) == 2
