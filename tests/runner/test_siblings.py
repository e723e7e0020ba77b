"""The further recordings that checks may ask for are what `Runs` says of them: which HIPs, when, how many seconds."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
import pytest
from honest import Spring
from msgspec import structs
from outsiders import CASES

from hapticeval.errors import RefusalError
from hapticeval.geometry.motion import rigid_motion, scaling
from hapticeval.phenomena.check import Runs
from hapticeval.phenomena.observed import Observed
from hapticeval.phenomena.verdict import Finding, Level, Metric, Outcome
from hapticeval.recordings.recording import Recording
from hapticeval.renderer import Response
from hapticeval.runner.judging import (
    describe_end,
    error_verdicts,
    finding_of_check,
    finding_of_runaway,
    judge,
    verdicts_of_findings,
    with_region,
)
from hapticeval.runner.siblings import SiblingRuns, answers_the_hip
from hapticeval.suite.reading import load_suite

THESIS = load_suite("thesis")
PRESS = CASES["slide"]
"""A hand that is led along under a circle."""
DT = 1e-3


class Asked(Spring):
    """A spring that keeps what it is asked, and by what it is asked: HIPs and steps."""

    asked: ClassVar[list[list[tuple[np.ndarray, float]]]] = []

    def reset(self, hip):
        super().reset(hip)
        self.asked.append([])

    def step(self, hip, velocity, dt):
        self.asked[-1].append((np.array(hip), dt))
        return super().step(hip, velocity, dt)


@pytest.fixture
def siblings():
    Asked.asked = []
    scene = PRESS.build_scene()
    return SiblingRuns(Asked, scene, PRESS, "asked")


def asked_last():
    hips, steps = zip(*Asked.asked[-1], strict=True)
    return np.array(hips), np.array(steps)


class TestOfAPath:
    def test_the_base_is_the_path_at_the_scene_s_rate_and_all_seconds_are_counted(self, siblings):
        runs = siblings.runs()
        times, hips = siblings.stimulus.sampled(DT)
        np.testing.assert_array_equal(runs.base.hip, hips)
        assert siblings.simulated == pytest.approx(times.size * DT)
        fine = runs.refine(4)
        assert len(fine) == 4 * (times.size - 1) + 1
        np.testing.assert_allclose(fine.hip[::4], hips, atol=1e-15)
        assert fine.dt == pytest.approx(DT / 4)
        assert siblings.simulated == pytest.approx(times.size * DT + len(fine) * DT / 4)
        assert runs.refine(4) is fine, "made once"

    def test_the_way_back_has_the_very_same_hips(self, siblings):
        runs = siblings.runs()
        np.testing.assert_array_equal(runs.reverse().hip, runs.base.hip[::-1])
        np.testing.assert_array_equal(runs.reverse().time, runs.base.time)
        np.testing.assert_array_equal(runs.again().force, runs.base.force)

    def test_a_subdivided_path_has_another_hip_half_way(self, siblings):
        runs = siblings.runs()
        twice = runs.subdivided()
        np.testing.assert_array_equal(twice.hip[::2], runs.base.hip)
        np.testing.assert_array_equal(twice.hip[1::2], 0.5 * (runs.base.hip[1:] + runs.base.hip[:-1]))
        np.testing.assert_allclose(np.diff(twice.time), DT / 2)

    def test_a_path_is_led_on_by_laps(self, siblings):
        runs = siblings.runs()
        longer = runs.led_on(3, 10, 4)
        hips = runs.base.hip
        np.testing.assert_array_equal(longer.base.hip, np.concatenate([hips[:11], *[hips[11:15]] * 3]))
        assert longer.base.time[-1] == pytest.approx((len(longer.base) - 1) * DT)
        assert longer.refine(2).dt == pytest.approx(DT / 2)

    def test_a_dropped_hip_is_asked_for_after_the_ticks_before_it(self, siblings):
        runs = siblings.runs()
        lost, next_force = runs.dropped_out(20)
        hips, _ = asked_last()
        np.testing.assert_array_equal(hips[-22:-2], runs.base.hip[:20])
        assert np.isnan(hips[-2]).all()
        np.testing.assert_array_equal(hips[-1], runs.base.hip[20])
        assert next_force is not None
        assert lost is None or lost.shape == (2,)

    @pytest.mark.parametrize(
        "motion",
        [scaling(2.0, 2), rigid_motion(0.3, [0.1, -0.05]), scaling(0.5, 2)],
        ids=["larger", "turned", "smaller"],
    )
    def test_a_moved_scene_is_moved_back(self, siblings, motion):
        runs = siblings.runs()
        moved = runs.moved(motion, (0.0, 0.0))
        np.testing.assert_allclose(moved.hip, runs.base.hip, atol=1e-14)
        np.testing.assert_allclose(moved.ihip, runs.base.ihip, atol=1e-14)
        np.testing.assert_allclose(moved.force, runs.base.force, atol=1e-9)
        hips, _ = asked_last()
        np.testing.assert_allclose(hips[-len(moved) :], motion(runs.base.hip), atol=1e-14)
        nudged = runs.moved(motion, (1e-3, 0.0))
        np.testing.assert_allclose(nudged.hip, runs.base.hip + np.array([1e-3, 0.0]), atol=1e-14)
        before = siblings.simulated
        runs.moved(motion, (2e-3, 0.0))
        assert siblings.simulated == pytest.approx(before + len(moved) * DT)

    def test_what_is_declared_in_metres_shrinks_with_the_scene(self):
        class Declaring(Spring):
            resolution, standoff = 2e-3, 1e-3

        runs = SiblingRuns(Declaring, PRESS.build_scene(), PRESS, "declares").runs()
        meta = runs.moved(scaling(4.0, 2), (0.0, 0.0)).meta
        assert (meta["resolution"], meta["standoff"]) == (pytest.approx(0.5e-3), pytest.approx(0.25e-3))

    def test_a_renderer_that_shares_nothing_answers_in_turns_as_alone(self, siblings):
        runs = siblings.runs()
        before = siblings.simulated
        turns = runs.in_turns()
        np.testing.assert_array_equal(turns.force, runs.base.force)
        assert siblings.simulated == pytest.approx(before + 2.0 * len(turns) * DT)


FILTER, VISCOSITY = {"kind": "velocity-filter", "cutoff": 100.0}, {"kind": "viscosity", "coefficient": 1.0}


@pytest.mark.parametrize("damping", [0.0, 1.0])
@pytest.mark.parametrize(
    ("effects", "exact"),
    [
        ((), True),
        ((VISCOSITY,), True),
        ((FILTER,), False),
        ((FILTER, VISCOSITY), False),
        ((VISCOSITY, FILTER), False),
    ],
)
def test_a_loop_is_asked_again_without_an_effect_where_its_places_tell_all(effects, exact, damping):
    """Along the recorded HIPs a renderer answers as in the loop only if it was given these, and no velocity."""
    case = CASES["press"]
    scene = structs.replace(case, scene={**case.scene, "effects": list(effects), "damping": damping}).build_scene()
    assert answers_the_hip(scene) is (exact and damping == 0.0)


class TestFindings:
    BASE = Recording(DT * np.arange(5), {"hip": np.zeros((5, 2)), "ihip": np.zeros((5, 2)), "force": np.zeros((5, 2))})
    ENDED: ClassVar[dict[str, object]] = {"tick": 3, "time": 0.003, "what": "it left", "why": "so", "ran_away": False}
    FAILED = Finding(Outcome.FAIL, "off", Metric("m", 2.0, "m"), 1.0, {"tick": 2, "time": 0.002})

    def test_an_end_is_told_with_its_time(self):
        assert describe_end(self.ENDED) == "the run ended at t = 0.003 s: it left"

    def test_a_loop_that_ran_away_fails_a_must(self):
        bare = finding_of_runaway(self.ENDED)
        assert (bare.outcome, bare.level, bare.evidence["tick"]) == (Outcome.FAIL, Level.MUST, 3)
        passed = finding_of_runaway(self.ENDED, Finding(Outcome.PASS, "well"))
        assert passed.message == "the run ended at t = 0.003 s: it left"
        failed = finding_of_runaway(self.ENDED, self.FAILED)
        assert failed.message == "off; the run ended at t = 0.003 s: it left"
        assert (failed.level, failed.metric, failed.evidence["tick"]) == (Level.MUST, self.FAILED.metric, 2)
        said = Finding(Outcome.FAIL, "said", evidence={"ended": {}})
        assert (finding_of_runaway(self.ENDED, said).message, finding_of_runaway(self.ENDED, said).level) == (
            "said",
            Level.MUST,
        )

    @pytest.mark.parametrize(("tick", "placed"), [(4, True), (5, False), ("2", False)])
    def test_a_failure_s_region_is_that_of_a_tick_of_the_recording(self, tick, placed):
        finding = Finding(Outcome.FAIL, "off", evidence={"tick": tick})
        assert ("region" in with_region(finding, Observed(self.BASE, PRESS.build_scene())).evidence) is placed
        passed = Finding(Outcome.PASS, "well", evidence={"tick": 2})
        assert with_region(passed, Observed(self.BASE, PRESS.build_scene())) is passed

    def ended_early(self, monkeypatch, finding, ended, **meta):
        monkeypatch.setattr("hapticeval.runner.judging.CHECKS", {"contact-kept": lambda runs, scene: finding})
        base = Recording(self.BASE.time, self.BASE.channels, meta if ended is None else {"ended": ended, **meta})
        return finding_of_check("contact-kept", Runs(base), PRESS.build_scene())

    def test_a_pass_up_to_an_early_end_is_undecided_and_a_failure_stays(self, monkeypatch):
        passed = Finding(Outcome.PASS, "well", evidence={"n": 1})
        finding = self.ended_early(monkeypatch, passed, self.ENDED)
        assert (finding.outcome, finding.message) == (Outcome.INCONCLUSIVE, describe_end(self.ENDED))
        assert finding.evidence == {"n": 1, "ended": self.ENDED}
        assert self.ended_early(monkeypatch, passed, None) is passed
        assert self.ended_early(monkeypatch, self.FAILED, self.ENDED).outcome is Outcome.FAIL
        asked = Finding(Outcome.NOT_APPLICABLE, "not here")
        assert self.ended_early(monkeypatch, asked, self.ENDED) is asked
        away = self.ended_early(monkeypatch, passed, {**self.ENDED, "ran_away": True})
        assert (away.outcome, away.level) == (Outcome.FAIL, Level.MUST)

    @pytest.mark.parametrize(("share", "noted"), [(0.99, False), (1.01, True)])
    def test_a_failure_alone_says_that_a_standoff_of_more_than_a_fiftieth_counts_in_part(
        self, monkeypatch, share, noted
    ):
        declared = share * PRESS.build_scene().model.size / 50.0
        failed = self.ended_early(monkeypatch, self.FAILED, None, standoff=declared)
        assert failed.message.startswith("off; it declares a standoff") if noted else failed.message == "off"
        passed = Finding(Outcome.PASS, "well")
        assert self.ended_early(monkeypatch, passed, None, standoff=declared) is passed

    def test_the_others_that_fail_alike_are_named_for_a_failure_alone(self):
        for case in THESIS.cases:
            for check, outcomes in (
                (check, [(name, table[check]) for name, table in case.published.items() if check in table])
                for check in case.checks
            ):
                failing = [name for name, outcome in outcomes if outcome == "fail"]
                if failing:
                    findings = [
                        Finding(Outcome.FAIL, "") if check == other else Finding(Outcome.PASS, "")
                        for other in case.checks
                    ]
                    verdicts = {
                        verdict.check: verdict
                        for verdict in verdicts_of_findings(findings, failing[0], "thesis", case, {})
                    }
                    assert verdicts[check].alike == tuple(failing[1:])
                    assert verdicts[check].published is Outcome.FAIL
                    assert all(not verdict.alike for name, verdict in verdicts.items() if name != check)
                    return
        raise AssertionError("no case of the thesis has a published failure")

    def test_a_process_that_is_gone_is_an_error_of_every_check(self):
        judged = error_verdicts(RefusalError("gone", why="crashed"), "mine", "thesis", PRESS)
        assert {verdict.outcome for verdict in judged.verdicts} == {Outcome.ERROR}
        assert [verdict.finding.message for verdict in judged.verdicts] == ["gone; crashed"] * len(PRESS.checks)
        assert (judged.simulated_seconds, judged.recording) == (0.0, None)

    def test_a_renderer_that_refuses_is_not_applicable_and_one_that_breaks_an_error_of_all(self):
        def refusing(scene):
            raise RefusalError("no lines", why="today")

        judged = judge(refusing, "refuses", "thesis", PRESS)
        assert {verdict.outcome for verdict in judged.verdicts} == {Outcome.NOT_APPLICABLE}
        assert judged.verdicts[0].finding.message == "the renderer refuses: no lines"

        class Breaking(Spring):
            def step(self, hip, velocity, dt):
                return Response(hip, np.full_like(hip, np.nan))

        broken = judge(lambda scene: Breaking(scene), "breaks", "thesis", PRESS)
        assert {verdict.outcome for verdict in broken.verdicts} == {Outcome.ERROR}

    def test_a_renderer_that_breaks_in_a_sibling_is_an_error_of_the_check_that_asked_for_it_and_of_no_other(self):
        """The way back begins on the other side: it is what `memoryless` asks for, before four others judge."""

        class BackBreaks(Spring):
            def reset(self, hip):
                self.back = hip[1] > 0.05

            def step(self, hip, velocity, dt):
                if self.back:
                    raise ValueError("no way back")
                return super().step(hip, velocity, dt)

        judged = judge(lambda scene: BackBreaks(scene), "breaks", "thesis", PRESS)
        outcomes = {verdict.check: verdict.outcome for verdict in judged.verdicts}
        assert outcomes.pop("memoryless") is Outcome.ERROR
        assert outcomes == dict.fromkeys(set(PRESS.checks) - {"memoryless"}, Outcome.PASS)
        assert "no way back" in judged.error.why
        assert judged.recording is not None


class Random(Spring):
    """A spring whose force has a millionth of noise of its own in each run."""

    def __init__(self, scene):
        super().__init__(scene)
        self.noise = np.random.default_rng()

    def step(self, hip, velocity, dt):
        ihip, force = super().step(hip, velocity, dt)
        return Response(ihip, force * (1.0 + 1e-6 * self.noise.standard_normal()))


class LeftOver(Spring):
    """A spring that is harder in every run after the first."""

    runs = 0

    def reset(self, hip):
        super().reset(hip)
        self.runs += 1

    def step(self, hip, velocity, dt):
        ihip, force = super().step(hip, velocity, dt)
        return Response(ihip, force * (1.0 + 1e-6 * self.runs))


@pytest.mark.parametrize(
    ("renderer", "words"), [(Random, "it is random: the force of two new"), (LeftOver, "a reset leaves something")]
)
def test_what_is_random_is_not_taken_for_what_a_reset_leaves(renderer, words):
    judged = judge(renderer, "mine", "outsiders", PRESS)
    (verdict,) = [verdict for verdict in judged.verdicts if verdict.check == "reset-clears"]
    assert (verdict.outcome, verdict.level) == (Outcome.FAIL, Level.MUST)
    assert verdict.finding.message.startswith(words)
