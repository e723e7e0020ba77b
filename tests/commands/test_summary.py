"""The closing summary, without a run: what it shows at once, what with -v, and on a narrow terminal."""

from functools import partial
from pathlib import Path

import pytest
from result_entries import changed, results_of, run_entry

from hapticeval.commands import summary as module
from hapticeval.commands.summary import VERDICTS_SHOWN, github_annotations, summary
from hapticeval.errors import RefusalError
from hapticeval.phenomena.verdict import Finding, Level, Metric, Outcome, Verdict
from hapticeval.reports.table import markdown
from hapticeval.runner.results import Problem, VerdictEntry


def verdict(outcome, *, metric=None, bound=None, known=None, evidence=None, **more):
    names = {"renderer": "r", "suite": "s", "case": "c", "check": "memoryless", "level": Level.MUST}
    finding = Finding(outcome, "what was seen", metric=metric, bound=bound, evidence=evidence or {})
    made = Verdict(**{**names, "finding": finding, **more})
    return changed(VerdictEntry.of(made), known=known, **({"as_expected": True} if known else {}))


def jump(metres, **more):
    return verdict(Outcome.FAIL, metric=Metric("jump", metres, "m"), bound=0.001, **more)


def test_warnings_are_shown_and_counted():
    should = verdict(Outcome.FAIL, level=Level.SHOULD)
    relaxed = summary(results_of(should), [])
    assert "warning: fail: r on s/c/" in relaxed
    assert "1 warn; none not as expected\n" in relaxed
    assert "1 warn; 1 not as expected (by --strict: 1 warn)\n" in summary(results_of(should, strict=True), [])


def test_what_is_inherent_is_counted_and_shown_with_its_reason_on_demand():
    limited = results_of(jump(0.1, inherent="a spring's force begins at zero"))
    assert "1 inherent; none not as expected (-v shows what is known or inherent)\n" in summary(limited, [])
    shown = summary(limited, [], verbose=True)
    assert "inherent: fail: r on s/c/memoryless\n" in shown
    assert "  inherent because: a spring's force begins at zero\n" in shown


def test_an_unexpected_failure_names_who_fails_alike():
    assert "  fail here too: constraint, mapping\n" in summary(
        results_of(jump(0.1, alike=("constraint", "mapping"))), []
    )


def test_a_failure_that_would_be_inherent_names_what_a_renderer_has_to_declare_and_no_other_does():
    hint = "  may be inherent: in a renderer that declares spring, see hapticeval explain impulsive-collision\n"
    soft = {"impulse_in_window_Ns": 0.01, "impulse_wanted_Ns": 0.03, "stopped_after_ms": 16.0}
    struck = partial(jump, 0.1, check="impulsive-collision")
    assert hint in summary(results_of(struck(evidence=soft)), [])
    assert hint not in summary(results_of(struck(evidence=soft, inherent="a spring")), [], verbose=True)
    # An impulse of the wrong sign is no spring's, and a point off the surface no nearest one's.
    wrong = struck(evidence={**soft, "impulse_in_window_Ns": -0.01})
    off = jump(
        0.1, check="continuous-contact", evidence={"off_surface_m": 0.1, "nearest_jump_m": 1.0, "region": "medial axis"}
    )
    for failed in (wrong, off, jump(0.1)):
        assert "may be inherent" not in summary(results_of(failed), [])


def test_the_whole_of_it():
    done = results_of(
        verdict(Outcome.PASS, case="b"),
        jump(0.0123456),
        verdict(Outcome.NOT_APPLICABLE),
        verdict(Outcome.NOT_APPLICABLE, case="d"),
        planned=5,
        complete=False,
        reason="interrupted by the user",
        table={"Resists": {"one": "Yes", "another": "No"}, "Suitable": {"one": "No"}},
        published_table={"Resists": {"another": "Yes"}, "Suitable": {"one": "No"}},
    )
    shown = [
        "   r",
        "s  1/2 !1",
        "passed/judged; !n are not as expected",
        "",
        "          another              one",
        "Resists   No (published: Yes)  Yes",
        "Suitable  --                   No",
        "",
        "fail: r on s/c/memoryless",
        "  jump = 12.35 mm, bound 1 mm",
        "  what was seen",
        "  see: 1. The renderer keeps a proxy (the most common cause): hapticeval explain memoryless",
        "",
        "4 of 5 planned verdicts ran (incomplete: interrupted by the user): 1 failed, 1 passed, 2 not applicable; "
        "1 not as expected",
        "simulated 6.0 s in 2.0 s: 3.0 times real time",
        "",
        "wrote out/report.html",
    ]
    assert summary(done, [Path("out/report.html")]).splitlines() == shown
    more = ["not applicable: memoryless (2 times): what was seen", ""]
    assert summary(done, [Path("out/report.html")], verbose=True).splitlines() == [*shown[:13], *more, *shown[13:]]


def test_the_grid_counts_what_is_judged():
    done = results_of(
        verdict(Outcome.PASS),
        verdict(Outcome.PASS, renderer="q"),
        verdict(Outcome.FAIL, renderer="q", level=Level.INFO),
        jump(0.1, renderer="q", inherent="a theorem"),
        jump(0.1, renderer="q", known="a limit"),
        jump(0.1, renderer="q", level=Level.SHOULD),
        verdict(Outcome.ERROR, renderer="q"),
        verdict(Outcome.NOT_APPLICABLE, suite="t"),
        verdict(Outcome.PASS, suite="t", renderer="p"),
    )
    assert summary(done, []).splitlines()[:4] == [
        "   r    q                p",
        "s  1/1  1/5 !1 ~1 *1 ?1",
        "t  -                     1/1",
        "passed/judged; !n are not as expected; ~n fail and are known; "
        "*n fail by what the renderer declares to be (inherent); ?n warn",
    ]


def test_a_narrow_terminal_gets_lists():
    names = [f"package.module:Renderer{number}" for number in range(3)]
    done = results_of(
        *(verdict(Outcome.PASS, renderer=name) for name in names), table={"Row": dict.fromkeys(names, "No")}
    )
    shown = summary(done, [], width=40)
    assert max(map(len, shown.splitlines()[:8])) <= 40
    assert shown.splitlines()[:4] == ["s", *(f"  {name}  1/1" for name in names)]
    assert "Row\n" + "\n".join(f"  {name}  No" for name in names) in shown


def test_the_worst_come_first_and_the_rest_with_v():
    many = [jump(0.002 * (1 + number), case=f"c{number:02}") for number in range(VERDICTS_SHOWN + 2)]
    shown = summary(results_of(*many, verdict(Outcome.ERROR, case="broken")), [])
    heads = [line for line in shown.splitlines() if " on s/" in line]
    last = len(many) - 1
    assert heads[:2] == ["error: r on s/broken/memoryless", f"fail: r on s/c{last}/memoryless"]
    assert len(heads) == VERDICTS_SHOWN
    assert "and 3 verdicts more that are not as expected: -v shows them, and so does a report" in shown
    assert len([line for line in summary(results_of(*many), [], verbose=True).splitlines() if " on s/" in line]) == 12


def broke(case, tick, *, renderer="r", line="in mine.py, line 7"):
    what = f"the renderer's step() raised KeyError: 'x{tick}' at tick {tick} (counted from 0), HIP (0, {tick}) m"
    return run_entry(renderer=renderer, case=case, error=Problem(what=what, why=line, todo=""))


def test_one_cause_is_one_message_with_the_verdicts_that_it_took_away():
    runs = [broke(f"c{k}", k) for k in range(5)]
    runs += [broke("c5", 1, line="in mine.py, line 9"), broke("c5", 1, renderer="q")]
    lost = [
        verdict(Outcome.ERROR, case=run.case, renderer=run.renderer, check=check)
        for run in runs
        for check in ("broken-contact", "contact-kept")
    ]
    done = results_of(*lost, verdict(Outcome.FAIL, case="c0"), runs=runs)
    shown = summary(done, [])
    assert [line for line in shown.splitlines() if line.startswith(("broke", "error", "fail", "  first"))] == [
        "broke: r on 5 cases: 10 verdicts lost",
        "  first on s/c0, then s/c1, then s/c2, and 2 others",
        "broke: r on s/c5: 2 verdicts lost",
        "broke: q on s/c5: 2 verdicts lost",
        "fail: r on s/c0/memoryless",
    ]
    assert "HIP (0, 0)" in shown
    assert "then s/c3, then s/c4\n" in summary(done, [], verbose=True)
    table = markdown(done)
    assert table.count(" lost; ") == 3
    assert "on s/c0/memoryless: error" not in table


def test_refused_runs_are_named_with_the_reason():
    refusals = {"a": "a small model", "b": "a small model", "c": "no edges", "d": "no holes", "e": "no rims"}
    runs = [run_entry(case=case, refusal=Problem.of(RefusalError(what))) for case, what in refusals.items()]
    done = results_of(verdict(Outcome.PASS), runs=[run_entry(case="judged"), *runs])
    assert (
        "\nrefused: r on s/a, s/b: a small model\nrefused: r on s/c: no edges\nrefused: r on s/d: no holes\n"
        "refused: 1 reason more, -v shows them\n"
    ) in summary(done, [])
    assert "refused: r on s/e: no rims\n" in summary(done, [], verbose=True)


def test_what_is_known_is_counted_and_what_is_no_more_is_shown():
    done = results_of(jump(0.1, known="a limit of the method"), verdict(Outcome.PASS, case="d", known="a bug"))
    shown = summary(done, [])
    assert "known, and pass now: r on s/d/memoryless\n  take it off the list: a bug" in shown
    assert "1 listed as known, and passed, 1 failed as known; none not as expected (-v shows" in shown
    assert "a limit of the method" not in shown
    assert "known because: a limit of the method" in summary(done, [], verbose=True)


def test_a_metric_that_json_cannot_hold_is_left_to_the_message():
    assert "jump =" not in summary(results_of(jump(float("inf"))), [])


@pytest.mark.parametrize(
    ("tty", "environment", "coloured"),
    [(True, {}, True), (False, {}, False), (True, {"NO_COLOR": "1"}, False), (True, {"TERM": "dumb"}, False)],
)
def test_colours_are_for_terminals(monkeypatch, tty, environment, coloured):
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setenv("TERM", "xterm")
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr(module.sys.stdout, "isatty", lambda: tty, raising=False)
    assert ("\x1b[31m" in summary(results_of(jump(0.1)), [])) is coloured


def test_what_stops_a_gate_is_an_annotation_of_a_job_the_worst_first():
    done = results_of(jump(0.002), jump(0.1, case="d"), verdict(Outcome.PASS, case="e"), jump(0.1, case="f", known="x"))
    assert github_annotations(done).splitlines() == [
        "::error title=r on s/d/memoryless::fail: what was seen; jump = 100 mm, bound 1 mm",
        "::error title=r on s/c/memoryless::fail: what was seen; jump = 2 mm, bound 1 mm",
    ]


def test_where_all_is_refused_that_is_the_annotation():
    runs = [run_entry(case=case, refusal=Problem.of(RefusalError("a model in space"))) for case in "ab"]
    done = results_of(verdict(Outcome.NOT_APPLICABLE), runs=runs)
    assert github_annotations(done) == "::error title=r refuses s/a%2C and 1 other::a model in space"
    judged = results_of(verdict(Outcome.PASS), runs=[*runs, run_entry(case="c")])
    assert github_annotations(judged) == ""


def test_a_renderer_that_is_too_slow_for_the_sampling_rate_is_named():
    runs = [
        run_entry(renderer="slow", case="a", step_seconds=1.5e-3),
        run_entry(renderer="slow", case="b", step_seconds=2.5e-3),
        run_entry(renderer="quick", case="a", step_seconds=0.9e-3),
        run_entry(renderer="in-batch", case="a"),
    ]
    shown = summary(results_of(verdict(Outcome.PASS), runs=runs), [])
    assert [line for line in shown.splitlines() if "too slow" in line] == [
        "too slow: half of the steps of slow take 2.5 ms or more, 2.5 times the sampling time of 1 ms, on s/b, "
        "and too slow in 1 other case; timed beside the other work of this run"
    ]
