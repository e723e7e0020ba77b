"""What verdicts amount to: states, tiles, the grids, the worst; and that their colours can be told apart."""

from __future__ import annotations

import itertools
import re
from importlib import resources

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reports_synthetic import HOSTILE, synthetic_results, synthetic_run, verdict
from result_entries import changed

from hapticeval.phenomena.verdict import Finding, Level, Metric, Outcome
from hapticeval.reports.cards import hard_card
from hapticeval.reports.grid import (
    Tile,
    bound_share,
    case_grid,
    digit_families,
    gravest_first,
    hard_cases,
    headline,
    is_sound,
    phenomenon_grid,
    worst_verdicts,
)
from hapticeval.reports.pages import ReportView
from hapticeval.runner.results import Measure, Problem, SuiteEntry
from hapticeval.runner.standing import Standing, count_standings


def make_verdict(
    outcome="pass",
    value=0.5,
    bound=1.0,
    *,
    published=None,
    level=Level.MUST,
    check="continuous-contact",
    known=None,
    **names,
):
    finding = Finding(Outcome(outcome), "why", None if value is None else Metric("metric", value, "m"), bound)
    place = {"case": "lobe", "renderer": "plain", **names}
    entry = verdict(place["case"], place["renderer"], check, finding, level, published and Outcome(published))
    return entry if known is None else changed(entry, known=known, as_expected=True)


@pytest.mark.parametrize(
    ("outcome", "published", "level", "expected"),
    [
        ("pass", None, "must", "pass"),
        ("pass", "pass", "must", "pass"),
        ("pass", "fail", "must", "differs"),
        ("fail", None, "must", "fail"),
        ("fail", "fail", "must", "fail"),
        ("fail", "pass", "must", "differs"),
        ("fail", None, "should", "warning"),
        ("fail", None, "info", "not-judged"),
        ("fail", "fail", "info", "not-judged"),
        ("pass", None, "info", "not-judged"),
        ("inconclusive", None, "must", "undecided"),
        ("inconclusive", None, "should", "warning"),
        ("inconclusive", "inconclusive", "must", "undecided"),
        ("not-applicable", None, "must", "not-applicable"),
        ("error", None, "must", "error"),
        ("error", "fail", "must", "error"),
        ("error", None, "info", "error"),
    ],
)
def test_a_state_compares_the_outcome_with_what_was_expected(outcome, published, level, expected):
    assert make_verdict(outcome, published=published, level=Level(level)).standing == expected


@given(outcome=st.sampled_from(Outcome), published=st.sampled_from([None, *Outcome]), level=st.sampled_from(Level))
def test_a_state_is_grave_exactly_where_the_verdict_is_not_as_expected(outcome, published, level):
    each = make_verdict(outcome, published=published, level=level)
    assert each.standing.unexpected is not each.as_expected


def test_a_tile_shows_its_gravest_state_and_there_the_worst():
    given = [
        make_verdict(value=0.2),
        make_verdict("fail", 3.0, known="a limit"),
        make_verdict("fail", 8.0, known="a limit"),
        make_verdict(value=0.9),
    ]
    tile = Tile(given)
    assert (tile.standing, tile.worst, tile.counts[Standing.KNOWN], tile.total) == (Standing.KNOWN, given[2], 2, 4)
    assert (tile.margin, tile.heat) == ("8×", 2)  # noqa: RUF001
    assert (Tile(given[:1]).margin, Tile(given[:1]).heat) == ("80 % left", 1)
    assert (Tile(given[3:]).margin, Tile(given[3:]).heat) == ("10 % left", 3)
    run = synthetic_run("lobe", "plain", "circle")
    assert (Tile(given, [run]).standing, Tile(given, [run]).worst) == (Standing.ERROR, run)


def test_a_pass_that_reports_its_bound_as_its_value_shows_no_share_but_how_long_the_steps_are():
    refined = changed(make_verdict(value=0.999), evidence={"amplification": 1.25})
    tile = Tile([refined])
    assert (tile.margin, tile.heat) == ("step 1.2×", 1)  # noqa: RUF001
    assert Tile([changed(refined, outcome=Outcome.FAIL)]).margin == "0 % left", "of a failure the metric is one"


@pytest.mark.parametrize(
    ("value", "bound", "share"),
    [(0.5, 1.0, 0.5), (-2.0, 1.0, 0.0), (0.0, 0.0, 0.0), (1.0, 0.0, np.inf), (1.0, -1.0, None), (np.inf, 1.0, np.inf)],
)
def test_the_share_of_a_bound(value, bound, share):
    outcome = "pass" if value <= bound else "fail"
    assert bound_share(make_verdict(outcome, value=value, bound=bound)) == share
    assert bound_share(make_verdict(value=None)) is None


@pytest.mark.parametrize(
    ("value", "words"),
    [(1.26, "1.3×"), (48.2, "48×"), (4321.0, "4300×"), (9e6, "9e6×"), (np.inf, "∞×"), (0.999, "0 % left")],  # noqa: RUF001
)
def test_a_margin_reads_well(value, words):
    assert Tile([make_verdict("pass" if value <= 1.0 else "fail", value=value)]).margin == words


def test_renderers_by_phenomena(results):
    grid = phenomenon_grid(results)
    assert [name for name, _ in grid.rows] == ["plain", "broken", HOSTILE]
    assert grid.columns[:2] == ["Continuous Contact Point", "Contact Normal Force"]
    assert grid.columns[-1] == "Other properties", "memoryless is none of the six"
    total = sum(tile.total for _, tiles in grid.rows for tile in tiles if tile)
    assert total == len(results.verdicts), "every verdict is in one cell"
    plain, broken = grid.rows[0][1], grid.rows[1][1]
    assert [tile and tile.standing for tile in plain[:2]] == [Standing.KNOWN, Standing.DIFFERS]
    assert broken[0].standing is Standing.ERROR
    assert broken[1] is None


def test_cases_by_renderers_show_a_run_that_broke_before_any_check(results):
    grid = case_grid(results, "synthetic")
    tiles = {case: dict(zip(grid.columns, row, strict=True)) for case, row in grid.rows}
    assert tiles["tip"]["plain"].standing is Standing.ERROR
    assert tiles["tip"]["broken"] is None
    assert tiles["lobe"]["plain"].total == 6


def test_the_worst_come_first_and_once_for_each_check_of_a_renderer(results):
    given = worst_verdicts(results, 99)
    keys = [(each.check, each.renderer) for each in given]
    assert len(keys) == len(set(keys))
    assert [each.standing for each in given] == sorted(
        (verdict.standing for verdict in given), key=list(Standing).index
    )
    known = [each for each in results.verdicts if each.standing is Standing.KNOWN]
    again = [changed(each, case="again", metric=changed(each.metric, value=0.005)) for each in known]
    only = worst_verdicts(synthetic_results(verdicts=[*again, *known]), 99)
    assert [each.check for each in only] == ["continuous-contact"]
    assert only[0].case != "again"


def test_the_headline_and_the_exit_code_agree(results):
    assert not is_sound(results)
    fine = [each for each in results.verdicts if each.as_expected]
    runs = [run for run in results.runs if not run.error]
    assert headline(synthetic_results(verdicts=fine, runs=runs)) == "Every verdict is as expected, 2 known"
    assert is_sound(synthetic_results(verdicts=fine, runs=runs))
    assert not is_sound(synthetic_results(verdicts=fine, runs=runs, strict=True)), "a warning counts"
    assert sum(count for _, count in count_standings(verdict.standing for verdict in results.verdicts)) == len(
        results.verdicts
    )


def test_hard_cases_show_the_digits_that_are_kept():
    digits = {"plain": 15.6, "mine": 3.2}
    given = [
        changed(make_verdict(check="numerical-stability", renderer=name), evidence={"digits": count})
        for name, count in digits.items()
    ]
    results = synthetic_results(verdicts=[*given, make_verdict()], runs=[synthetic_run("lobe", "plain", "circle")])
    names, rows = hard_cases(results)
    assert names == ["plain", "mine"]
    assert [[count for count, _ in row.cells] for row in rows] == [[15, 3]]
    assert hard_cases(synthetic_results()) == ([], [])


# Colours. Signs and words stand beside them; beyond that, each can be read, and read by colour-blind eyes.

BLIND = {
    "as they are": np.eye(3),
    "protanopia": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deuteranopia": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "tritanopia": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
}
"""Machado, Oliveira and Fernandes 2009, at full severity, on linear light."""

WHITE = np.array([0.2126, 0.7152, 0.0722])


def colours():
    """The variables of either theme."""
    text = (resources.files("hapticeval.reports") / "report.css").read_text(encoding="utf-8")
    blocks = re.findall(r":root[^{]*{(.*?)}", text, re.DOTALL)
    assert len(blocks) == 2
    return [dict(re.findall(r"--([\w-]+): (#\w{6})", block)) for block in blocks]


def linear_light_seen(colour, eyes):
    """Linear light of a colour as these eyes see it."""
    value = np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)]) / 255.0
    linear = np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)
    return np.clip(np.asarray(BLIND[eyes]) @ linear, 0.0, 1.0)


def contrast(one, two, eyes):
    """The ratio of WCAG 2.1."""
    low, high = sorted(float(WHITE @ linear_light_seen(each, eyes)) for each in (one, two))
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize("eyes", BLIND)
@pytest.mark.parametrize("theme", colours(), ids=["light", "dark"])
def test_every_state_can_be_read(theme, eyes):
    pairs = [
        ("pass", "pass-1"), ("pass", "pass-2"), ("pass", "pass-3"),
        ("known", "known-1"), ("known", "known-2"), ("known", "known-3"),
        ("fail", "fail-1"), ("error", "error-1"), ("warning", "warning-1"), ("undecided", "undecided-1"),
        ("aside", "aside-1"), ("aside", "paper"), ("quiet", "paper"), ("quiet", "ground"), ("ink", "paper"),
        ("link", "paper"), ("link", "ground"), ("good", "paper"), ("bad", "paper"),
    ]  # fmt: skip
    for text, ground in pairs:
        assert contrast(theme[text], theme[ground], eyes) >= 4.5, (text, ground)


@pytest.mark.parametrize("eyes", BLIND)
@pytest.mark.parametrize("theme", colours(), ids=["light", "dark"])
def test_a_failure_is_far_in_lightness_from_what_needs_no_attention(theme, eyes):
    for other in ("pass-1", "pass-3", "known-1", "known-3", "aside-1"):
        assert contrast(theme["fail-1"], theme[other], eyes) >= 2.0, other


def test_no_two_states_share_a_sign_or_a_word():
    assert len({standing.symbol for standing in Standing}) == len(Standing)
    assert len({standing.meaning for standing in Standing}) == len(Standing)
    assert all(one.words != two.words and one.plural != two.plural for one, two in itertools.combinations(Standing, 2))


def test_what_broke_is_shown_once_with_the_checks_that_it_took_away():
    nothing = Finding(Outcome.ERROR, "it raised")
    runs = [
        synthetic_run(
            case, name, "circle", recording=False, error=Problem(what=f"it raised at tick {k}", why=why, todo="")
        )
        for k, (case, name, why) in enumerate(
            [("one", "bad", "line 7"), ("two", "bad", "line 7"), ("one", "worse", "line 9"), ("two", "worse", "line 8")]
        )
    ]
    lost = [
        verdict(case, "bad", check, nothing)
        for case, check in (("one", "passivity"), ("two", "passivity"), ("two", "broken-contact"))
    ]
    results = synthetic_results(runs=runs, verdicts=lost)
    found = results.breakdowns
    assert [[run.case for run in each.runs] for each in found] == [["one", "two"], ["one"], ["two"]]
    assert found[0].checks == ["passivity", "broken-contact"]
    assert worst_verdicts(results, 10) == [], "none of them is a failure that was measured"


def test_worst_first_is_what_a_hand_feels(results):
    """A pop-through of 17 mm stands before 0.019 N, though that is 1.4e6 of its bounds."""
    fails = [each for each in results.verdicts if each.outcome is Outcome.FAIL and each.metric]
    jump = changed(fails[0], metric=Measure(name="IHIP jump", value=0.017, unit="m"), bound=1e-3)
    drag = changed(jump, case="drag", metric=Measure(name="force", value=0.019, unit="N"), bound=0.019 / 1.4e6)
    angle = Measure(name="angle", value=60.0, unit="deg")
    turned = changed(jump, case="turned", metric=angle, evidence={"force_N": 20.0})
    share = changed(jump, case="share", metric=Measure(name="less", value=0.5, unit=""), evidence={"force_N": 10.0})
    work = changed(jump, case="work", metric=Measure(name="work", value=9.0, unit="J"), bound=1e-9)
    mixed = gravest_first([work, drag, share, jump, turned])
    assert [each.felt for each in mixed] == pytest.approx([20.0, 17.0, 5.0, 0.019, 0.0])
    assert mixed[0].case == "turned"
    assert max([drag, jump], key=lambda verdict: verdict.severity) is jump


def test_a_renderer_that_breaks_in_one_line_counts_once(results):
    broke = [run for run in results.runs if run.error][:1]
    first = changed(results.verdicts[0], level=Level.MUST, known=None, published=None, inherent="")
    lost = [changed(first, outcome=Outcome.ERROR, as_expected=False)] * 14
    cases = [f"c{number}" for number in range(14)]
    runs = [changed(broke[0], case=case, renderer="mine") for case in cases]
    verdicts = [changed(each, case=case, renderer="mine") for each, case in zip(lost, cases, strict=True)]
    broken = synthetic_results(verdicts=verdicts, runs=runs)
    assert headline(broken) == "mine broke in 14 runs, which lost 14 verdicts"
    assert ReportView(broken).unexpected_count == 1
    assert not is_sound(broken)


def test_families_of_hard_cases_come_with_the_fewest_digits_first_and_coarse_models_apart(results):
    digits = changed(results.verdicts[0], check="numerical-stability", published=None)

    def kept(case, renderer, count, declared=0.0):
        return changed(digits, case=case, renderer=renderer, evidence={"digits": count, "declared_m": declared})

    verdicts = [
        kept("lobe", "plain", 12.9), kept("lobe", "broken", 0.4, 0.016), kept("tip", "plain", 8.2),
        kept("tip", "broken", -3.0, 0.016),
    ]  # fmt: skip
    suite = SuiteEntry(
        name="synthetic", title="Hard", citation="", rows=[],
        cells={
            "Keeps its digits at any scale": ["lobe/numerical-stability"],
            "Keeps its digits at any angle": ["tip/numerical-stability", "tip/contact-kept"],
            "Comes to rest": ["lobe/comes-to-rest"],
        },
    )  # fmt: skip
    given = changed(synthetic_results(verdicts=verdicts), suites=[suite])
    families = digit_families(given)
    assert [(each.title, each.digits, each.coarse_digits) for each in families] == [
        ("at any angle", 8, 0),
        ("at any scale", 12, 0),
    ]
    assert [row.case for row in hard_cases(given)[1]] == ["tip", "lobe"]
    card = hard_card(families)
    assert card.sentence.startswith("At least 8 of 16 digits are kept, fewest at any angle: The tip")
    assert "coarse" in card.sentence
    assert hard_card([]) is None
