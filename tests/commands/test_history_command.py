"""`hapticeval history`: the first red run of each check, on the terminal and in the page."""

import pytest
from result_entries import results_of

from hapticeval.cli import main
from hapticeval.phenomena.verdict import Finding, Level, Outcome, Verdict
from hapticeval.runner.diff import histories_of
from hapticeval.runner.results import VerdictEntry, write_results

COMMITS = {name: character * 40 for name, character in (("one", "a"), ("two", "b"), ("three", "c"), ("four", "d"))}


def verdict(check, outcome, *, case="a", level=Level.MUST, renderer="mine:R"):
    return VerdictEntry.of(Verdict(renderer, "s", case, check, level, Finding(outcome, f"<{check}>")))


def results(number, stands, **changes):
    """Results of a day of May, with a verdict for each check: + passes, - fails, o has none."""
    outcomes = {"+": Outcome.PASS, "-": Outcome.FAIL}
    verdicts = [verdict(check, outcomes[sign]) for check, sign in stands.items() if sign != "o"]
    return results_of(*verdicts, date=f"2026-05-0{number}T10:00:00+00:00", **changes)


@pytest.fixture
def runs(tmp_path, monkeypatch):
    """Four runs; the names of their folders are not in the order of time."""
    monkeypatch.chdir(tmp_path)
    stands = {"turns": "++--", "always": "----", "mended": "+-++", "never": "++++", "asked-late": "oo+-"}
    for number, (name, commit) in enumerate(COMMITS.items(), 1):
        (tmp_path / name).mkdir()
        row = {check: signs[number - 1] for check, signs in stands.items()}
        write_results(tmp_path / name, results(number, row, commits={"mine:R": commit} if name != "four" else {}))
    (tmp_path / "two" / "report").mkdir()
    (tmp_path / "two" / "report" / "index.html").write_text("")
    return tmp_path


def test_it_names_the_first_red_commit_of_each_check(runs, capsys):
    assert main(["history", *COMMITS]) == 0
    assert capsys.readouterr().out.splitlines() == [
        "mine:R: 4 runs; now 3 checks red, the first from aaaaaaaaaa (one)",
        "  turns: red from cccccccccc (three), after bbbbbbbbbb (two)",
        "    s/a/turns: <turns>",
        "  always: red from aaaaaaaaaa (one), the first that asked it",
        "    s/a/always: <always>",
        "  asked-late: red from four, after cccccccccc (three)",
        "    s/a/asked-late: <asked-late>",
        "  mended: red from bbbbbbbbbb (two), after aaaaaaaaaa (one); green again in cccccccccc (three)",
        "",
        "wrote history.html",
    ]


def test_the_page_has_the_checks_over_the_runs_in_the_order_of_time(runs, capsys):
    assert main(["history", "four", "two", "one", "three", "-o", "pages/history.html"]) == 0
    page = (runs / "pages" / "history.html").read_text()
    names = [page.index(name) for name in ("aaaaaaaaaa<", "bbbbbbbbbb</a>", "cccccccccc<", "four<")]
    assert names == sorted(names)
    assert '<a href="../two/report/index.html">bbbbbbbbbb</a>' in page
    assert "<turns>" not in page
    assert "&lt;turns&gt;" in page
    assert page.count("<tr>") == 6


def test_the_order_may_be_the_one_that_is_given(runs, capsys):
    assert main(["history", "--as-given", "three", "two", "one"]) == 0
    assert "turns: red from cccccccccc (three), the first that asked it; green again in bbbbbbbbbb" in (
        capsys.readouterr().out
    )


def test_a_renderer_is_chosen_by_name(runs, capsys):
    assert main(["history", *COMMITS, "-r", "mine:r"]) == 2
    assert "mine:R" in capsys.readouterr().err
    assert not (runs / "history.html").exists()


def test_a_folder_without_results_is_named(runs, capsys):
    assert main(["history", "one", "nothing"]) == 2
    assert "nothing" in capsys.readouterr().err


def test_red_is_what_stops_the_gate_of_that_run(tmp_path):
    """A warning is red under --strict, and a known or inherent failure never is."""
    warning = verdict("soft", Outcome.FAIL, level=Level.SHOULD)
    lax, strict = (results_of(warning, strict=strict) for strict in (False, True))
    (shown,) = histories_of([(tmp_path / "lax", lax), (tmp_path / "strict", strict)])
    assert [stand.is_red for stand in shown.checks[0].stands] == [False, True]
    assert shown.first_red.folder.name == "strict"


def test_a_case_that_is_not_run_again_stays_red(tmp_path):
    """A run of other cases mends nothing: it is green where the case has passed."""
    asked = [[("a", Outcome.FAIL), ("b", Outcome.PASS)], [("b", Outcome.PASS)], [("a", Outcome.PASS)]]
    runs = [
        (tmp_path / str(number), results_of(*(verdict("c", outcome, case=case) for case, outcome in cases)))
        for number, cases in enumerate(asked)
    ]
    (partly,), (mended,) = histories_of(runs[:2]), histories_of(runs)
    assert [stand.is_red for stand in mended.checks[0].stands] == [True, True, False]
    assert partly.checks[0].words.endswith("the first that asked it; not run since: s/a")
    assert mended.checks[0].words.endswith(f"green again in {tmp_path / '2'}")


def test_the_page_may_be_put_into_a_folder(runs):
    assert main(["history", "one", "-o", "pages"]) == 0
    assert (runs / "pages" / "history.html").exists()


def test_a_check_counts_its_verdicts_and_shows_the_gravest(tmp_path):
    verdicts = [verdict("c", outcome, case=case) for case, outcome in
                (("a", Outcome.PASS), ("b", Outcome.FAIL), ("d", Outcome.FAIL))]  # fmt: skip
    (shown,) = histories_of([(tmp_path, results_of(*verdicts))])
    stand = shown.checks[0].stands[0]
    assert (stand.count, len(stand.verdicts), stand.gravest.case) == (2, 3, "b")
