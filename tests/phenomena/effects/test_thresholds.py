"""Thresholds that decide in checks of effects: a recording on each side of every one."""

from __future__ import annotations

import numpy as np
import pytest
from made import FAIL, PASS, UNDECIDED, changed, found, outcome, recorded
from msgspec import structs
from scipy.optimize import brentq
from scipy.special import polygamma
from scipy.stats import chi2, norm
from textured import variance_of_mean_square

from hapticeval.discovery import resolve
from hapticeval.effects.friction import Friction
from hapticeval.effects.line_spectra import line_spectrum
from hapticeval.effects.reliefs import BumpMap
from hapticeval.effects.sensors import VelocityFilter
from hapticeval.effects.stochastic_texture import StochasticTexture
from hapticeval.effects.texture import autocovariance
from hapticeval.effects.transients import ContactImpulse
from hapticeval.effects.viscous_friction import ViscousFriction
from hapticeval.geometry.catalogue import make_model
from hapticeval.phenomena.check import Runs
from hapticeval.phenomena.checks import texture
from hapticeval.phenomena.checks.texture import Stretch, find_stretches, spectrum_bound
from hapticeval.phenomena.checks.transient import fit, judge_each
from hapticeval.phenomena.verdict import Finding, Metric
from hapticeval.scene import Scene
from hapticeval.simulation.answers import make_renderer
from hapticeval.simulation.playback import play
from hapticeval.stimulus.stimulus import Path

LINE = make_model("line")
DRY = Scene(model=LINE, effects=(Friction(0.5, 0.3),))
DEPTH = 1e-3


def pulled(share, ticks=50, creep=0.0):
    """A tool that is pressed with 1 N and pulled by `share` of that, and creeps at `creep` m/s."""
    tool = np.column_stack([0.0123 + 1e-3 * creep * np.arange(ticks), np.zeros(ticks)])
    hand = np.column_stack([tool[:, 0] + share * DEPTH, np.full(ticks, -DEPTH)])
    return recorded(hand, tool, np.tile([-share, 1.0], (ticks, 1))), DRY


def slid(ticks, off=0.0):
    """A tool that slides for so many ticks, braked by mu_k F_n but for a share `off` of it."""
    way = 4e-5 * np.maximum(np.arange(ticks + 5) - 4, 0)
    tool = np.column_stack([0.0123 + way, np.zeros_like(way)])
    brake = 0.3 * (1.0 + off)
    return recorded(tool + np.array([brake * DEPTH, -DEPTH]), tool, np.tile([-brake, 1.0], (way.size, 1))), DRY


def strike(late, factor=1.0):
    """A tool of 0.1 kg that meets a line at 0.2 m/s, and is given its 20 mN s `late` ticks after that; and without."""
    height = 1.01e-3 - 2e-4 * np.arange(12)
    hand = np.column_stack([np.full(12, 0.0123), height])
    plain = recorded(hand, np.column_stack([hand[:, 0], np.maximum(height, 0.0)]))
    blow = np.zeros((12, 2))
    blow[int(np.argmax(height < 0.0)) + late, 1] = 20.0 * factor
    return changed(plain, force=plain.force + blow, velocity=np.tile([0.0, -0.2], (12, 1))), plain


def struck(late, factor=1.0, numbers=np.float64):
    run, plain = (changed(each, force=each.force.astype(numbers).astype(float)) for each in strike(late, factor))
    return Runs(run, without=lambda kind: plain), Scene(model=LINE, effects=(ContactImpulse(),))


def test_a_blow_of_a_hand_on_the_surface_is_along_the_normal_of_its_tick():
    """By rounding it touches a tick before the bare contact, and that one's contact point is 40 nm beside."""
    scene = Scene(model=make_model("circle", size=0.1), effects=(ContactImpulse(),))
    height = 1e-10 + 0.05 - 2e-4 * np.arange(-4, 8)
    hand = np.column_stack([np.zeros(12), height])
    tool = np.column_stack([np.where(height < 0.05, 4e-8, 0.0), np.maximum(height, 0.05)])
    plain = recorded(hand, tool)
    blow = np.zeros((12, 2))
    blow[4, 1] = 20.0
    run = changed(plain, force=plain.force + blow, velocity=np.tile([0.0, -0.2], (12, 1)))
    assert found("transient-impulse", Runs(run, without=lambda kind: plain), scene).outcome is PASS


@pytest.mark.parametrize("numbers", [np.float64, np.float32])
def test_of_an_impulse_a_billionth_and_the_rounding_of_its_forces_are_granted(numbers):
    run, _ = strike(0)
    first = int(np.argmax(run.hip[:, 1] < 0.0))
    largest = np.linalg.norm(run.force, axis=1)[first:] + 1000.0 * np.abs(run.hip).max()
    rounding = 4.0 * np.finfo(numbers).eps * largest
    bound = found("transient-impulse", *struck(0, numbers=numbers)).bound
    assert bound == pytest.approx(1e-9 * 0.02 + rounding.sum() * 1e-3, rel=1e-7, abs=0.0)


def test_a_force_that_begins_far_behind_its_contact_grants_no_more():
    """Late by up to three ticks a renderer's force may begin: one that begins five ticks after it is something else."""
    run, plain = strike(5)
    silent = slice(int(np.argmax(run.hip[:, 1] < 0.0)) + 5)
    force = plain.force.copy()
    force[silent] = 0.0
    blow = run.force - plain.force
    plain = changed(plain, force=force)
    run = changed(run, force=force + blow)
    scene = Scene(model=LINE, effects=(ContactImpulse(),))
    assert outcome("transient-onset", Runs(run, without=lambda kind: plain), scene) is FAIL


@pytest.mark.parametrize(("lasts", "expected"), [(1, UNDECIDED), (2, FAIL)])
def test_a_contact_that_ends_before_its_answer_is_late_decides_nothing(lasts, expected):
    run, plain = strike(5)
    rows = slice(int(np.argmax(run.hip[:, 1] < 0.0)) + lasts)
    cut, without = changed(run, rows=rows), changed(plain, rows=rows)
    scene = Scene(model=LINE, effects=(ContactImpulse(),))
    assert outcome("transient-onset", Runs(cut, without=lambda kind: without), scene) is expected


def test_an_impulse_that_is_wrong_is_told_in_millinewton_seconds():
    message = found("transient-impulse", *struck(0, 2.0)).message
    assert message.endswith("at 0.2 m/s is given 40 mN s for 20 mN s, 2 times as much")


def test_eight_samples_are_a_fit_of_four_numbers():
    time = 1e-3 * np.arange(8)
    wave = np.exp(-90.0 * time) * np.sin(2.0 * np.pi * 100.0 * time)
    assert fit(wave[:7], 1e-3, 90.0, 100.0) is None
    assert fit(wave, 1e-3, 90.0, 100.0).frequency == pytest.approx(100.0)


def test_a_fit_is_as_close_to_small_forces_as_to_large_ones():
    rng, time = np.random.default_rng(3), 1e-3 * np.arange(60)
    wave = np.exp(-50.0 * time) * np.sin(600.0 * time) + 1e-3 * rng.standard_normal(60)
    large, small = (fit(size * wave, 1e-3, 60.0, 90.0) for size in (1.0, 1e-6))
    np.testing.assert_allclose([*small], [*large], rtol=1e-6)
    assert fit(0.0 * wave, 1e-3, 60.0, 90.0) is None


RINGS = {"ar": tuple(line_spectrum([-2.0 * 0.999 * np.cos(0.8), 0.999**2]).tolist()), "ma": ()}
"""A filter whose poles have the radius 0.999: a time constant of a second."""


def strokes(first, second=None, seconds=3.0, texture="ribbed"):
    """A texture under a hand of a speed (m/s), or of one after the other, for so long each."""
    speeds = [speed for speed in (first, second) if speed is not None]
    scene = Scene(model=LINE, effects=(StochasticTexture(mass=0.05, texture=texture),))
    time = seconds * np.arange(len(speeds) + 1.0)
    way = np.concatenate([[0.0], seconds * np.cumsum(speeds)])
    path = Path(time, np.column_stack([way, np.full(time.size, -DEPTH)]))

    def run(chosen):
        return play(make_renderer(resolve("minimum-distance"), chosen), path, 1e-3, scene=chosen)

    return Runs(run(scene), without=lambda kind: run(scene.without(kind))), scene


def stuck(share, seconds, creep):
    return pulled(share, round(1e3 * seconds) + 1, creep)


@pytest.mark.parametrize(
    ("check", "made", "arguments", "expected"),
    [
        # The cone of mu_s F_n = 0.5 N is filled to a tenth, and not left by more than rounding.
        ("friction-cone", pulled, (0.0499,), UNDECIDED),
        ("friction-cone", pulled, (0.0501,), PASS),
        ("friction-cone", pulled, (0.5 * (1.0 + 5e-13),), PASS),
        ("friction-cone", pulled, (0.5 * (1.0 + 1e-11),), FAIL),
        # A tool sticks for a second, by 0.1 um a second, from a tenth to 0.6 of mu_k F_n = 0.3 N.
        ("friction-sticking", stuck, (0.1, 1.5, 0.9e-7), PASS),
        ("friction-sticking", stuck, (0.1, 1.5, 1.1e-7), FAIL),
        ("friction-sticking", stuck, (0.1799, 1.5, 1.0), FAIL),
        ("friction-sticking", stuck, (0.1801, 1.5, 1.0), UNDECIDED),
        ("friction-sticking", stuck, (0.0299, 1.5, 1.0), UNDECIDED),
        ("friction-sticking", stuck, (0.0301, 1.5, 1.0), FAIL),
        ("friction-sticking", stuck, (0.1, 0.999, 1.0), UNDECIDED),
        ("friction-sticking", stuck, (0.1, 1.0, 1.0), FAIL),
        # A slide of ten ticks is judged to a billionth.
        ("friction-sliding", slid, (9,), UNDECIDED),
        ("friction-sliding", slid, (10,), PASS),
        ("friction-sliding", slid, (10, 5e-10), PASS),
        ("friction-sliding", slid, (10, 5e-9), FAIL),
        ("friction-sliding", slid, (10, -5e-9), FAIL),
        # A contact is answered a tick late at the latest, and its impulse is judged to a billionth.
        ("transient-onset", struck, (-1,), FAIL),
        ("transient-onset", struck, (0,), PASS),
        ("transient-onset", struck, (1,), PASS),
        ("transient-onset", struck, (2,), FAIL),
        ("transient-impulse", struck, (0, 1.0 + 5e-10), PASS),
        ("transient-impulse", struck, (0, 1.0 - 5e-10), PASS),
        ("transient-impulse", struck, (0, 1.0 + 5e-9), FAIL),
        ("transient-impulse", struck, (0, 1.0 - 5e-9), FAIL),
        # Powers of stretches of a second and a half are compared, settled for a quarter of a second.
        ("texture-amplitude", strokes, (0.1, 0.2, 1.7), UNDECIDED),
        ("texture-amplitude", strokes, (0.1, 0.2, 1.8), PASS),
        # A rest is judged after as long; from its first sample, if the hand rests from the start.
        ("texture-rest", strokes, (0.1, 0.0, 0.25), UNDECIDED),
        ("texture-rest", strokes, (0.1, 0.0, 0.26), PASS),
        ("texture-rest", strokes, (0.0, 0.1, 0.25), UNDECIDED),
        ("texture-rest", strokes, (0.0, 0.1, 0.251), PASS),
    ],
)
def test_on_each_side_of_a_threshold(check, made, arguments, expected):
    assert outcome(check, *made(*arguments)) is expected


@pytest.mark.parametrize(("speed", "count"), [(0.1009, 1), (0.0991, 1), (0.1011, 2), (0.0989, 2)])
def test_a_stretch_is_steady_within_a_hundredth(speed, count):
    assert len(find_stretches(*strokes(0.1, speed))) == count


@pytest.mark.parametrize("more", [0, 1])
def test_a_spectrum_is_judged_where_chance_makes_less_than_a_decibel(more):
    count = next(count for count in range(2000, 9000) if spectrum_bound(count) <= 1.0)
    runs, scene = strokes(0.1, seconds=1e-3 * (count + 249 + more))
    (stretch,) = find_stretches(runs, scene)
    assert stretch.vibration.size == count - 1 + more
    assert outcome("texture-spectrum", runs, scene) is (PASS if more else UNDECIDED)


@pytest.mark.parametrize(("decibels", "expected"), [(2.95, UNDECIDED), (3.05, PASS)])
def test_powers_are_compared_where_three_decibels_are_asked_for(decibels, expected):
    model = StochasticTexture(mass=0.05, texture="ribbed").model

    def level(speed):
        return 10.0 * np.log10(autocovariance(model.between(speed, 1.0), 2)[0])

    fast = brentq(lambda speed: level(speed) - level(0.1) - decibels, 0.1, 0.2)
    assert outcome("texture-amplitude", *strokes(0.1, fast)) is expected


@pytest.mark.parametrize(("roundings", "expected"), [(2.0, PASS), (6.0, UNDECIDED)])
def test_a_hand_far_from_the_origin_rests_while_it_moves_by_rounding(roundings, expected):
    """By so many units of double precision of 40 m, to and fro."""
    runs, scene = strokes(0.1, 0.0, seconds=0.5)
    moved, jitter = np.array([40.0, 0.0]), 40.0 * roundings * np.finfo(float).eps * np.array([1.0, 0.0])

    def there(recording):
        aside = moved + (np.arange(len(recording)) % 2)[:, np.newaxis] * jitter
        return changed(recording, hip=recording.hip + aside, ihip=recording.ihip + aside)

    far = Runs(there(runs.base), without=lambda kind: there(runs.without(kind)))
    assert outcome("texture-rest", far, scene) is expected


class TestStretches:
    """Vibrations of stretches that were found, of a ribbed texture at 1 kHz."""

    SCENE = Scene(model=LINE, effects=(StochasticTexture(mass=0.05, texture="ribbed"),))
    SPEED, PRESS = 0.1, 1.0

    @pytest.fixture
    def judged(self, monkeypatch):
        def judge(check, *vibrations, speeds=(self.SPEED,)):
            stretches = [
                Stretch(250, speed, self.PRESS, vibration) for speed, vibration in zip(speeds, vibrations, strict=True)
            ]
            monkeypatch.setattr(texture, "find_stretches", lambda runs, scene: stretches)
            base, _ = pulled(0.1, 1000)
            return found(check, Runs(base, without=lambda kind: base), self.SCENE)

        return judge

    def covariance(self, speed, count=256):
        return autocovariance(StochasticTexture(mass=0.05, texture="ribbed").model.between(speed, self.PRESS), count)

    @pytest.mark.parametrize(("part", "gain"), [(2, 3.0), (5, 0.2), (7, 0.0)])
    def test_the_part_whose_power_is_off_by_most_is_told_with_what_chance_makes(self, judged, part, gain):
        """Of eight parts: two-sided, by chance once in a thousand in any. A sum of squares is a chi square's."""
        size = 400
        parts = np.random.default_rng(4).standard_normal((8, size))
        parts[part] *= gain
        finding = judged("texture-stationary", np.append(parts, [9.0, 9.0]))
        assert finding.outcome is FAIL
        power = np.mean(parts**2, axis=1)
        with np.errstate(divide="ignore"):
            decibels = np.maximum(10.0 * np.log10(power / power.mean()), -1000.0)
        np.testing.assert_allclose(finding.evidence["parts_dB"], decibels)
        assert finding.metric.value == pytest.approx(abs(decibels[part]))
        assert finding.message.startswith(f"part {part + 1} of 8 of the stretch has {decibels[part]:+.3g} dB")
        freedom = 2.0 / variance_of_mean_square(self.covariance(self.SPEED), size)
        ends = chi2.ppf([0.5e-3 / 8, 1.0 - 0.5e-3 / 8], freedom) / freedom
        assert finding.bound == pytest.approx(np.abs(10.0 * np.log10(ends)).max(), rel=1e-6)

    def test_parts_of_less_than_a_window_and_no_vibrations_are_not_compared(self, judged):
        noise = np.random.default_rng(4).standard_normal(8 * 256)
        assert judged("texture-stationary", noise).outcome is not UNDECIDED
        assert "too short" in judged("texture-stationary", noise[1:]).message
        assert "no vibrations" in judged("texture-stationary", 0.0 * noise).message

    def test_the_frequency_at_which_a_spectrum_is_off_by_most_is_told(self, judged):
        tone = 1e3 * np.sin(2.0 * np.pi * 40.0 / 256.0 * np.arange(8000))
        noise = np.sqrt(self.covariance(self.SPEED, 1)) * np.random.default_rng(4).standard_normal(8000)
        finding = judged("texture-spectrum", tone + noise)
        assert finding.outcome is FAIL
        assert finding.evidence["worst_at_Hz"] == pytest.approx(1000.0 * 40.0 / 256.0)
        assert f"{finding.evidence['worst_error_dB']:+.3g} dB near 156 Hz" in finding.message
        assert "over 8 s" in finding.message
        assert finding.bound == pytest.approx(spectrum_bound(8000))

    def test_a_spectrum_without_power_is_off_by_a_thousand_decibels(self, judged):
        finding = judged("texture-spectrum", np.zeros(8000))
        assert (finding.outcome, finding.metric.value) == (FAIL, pytest.approx(1000.0, rel=1e-9))
        assert finding.evidence["mean_error_dB"] == pytest.approx(-1000.0, abs=1e-9)

    def test_of_two_stretches_one_without_power_is_a_thousand_decibels_down(self, judged):
        """Less the mean of both, 500 dB each."""
        noise = np.random.default_rng(4).standard_normal(6000)
        evidence = judged("texture-amplitude", noise, 0.0 * noise, speeds=(0.05, 0.1)).evidence
        assert [stretch["off_dB"] for stretch in evidence["stretches"]] == pytest.approx([500.0, -500.0], abs=10.0)

    @pytest.mark.parametrize("worst", [0, 1, 2])
    def test_the_stretch_that_is_off_by_most_beside_chance_is_told(self, judged, worst):
        """Two long ones and a short one, of which that is known less well."""
        counts, speeds, gains = (6000, 2000, 4000), (0.05, 0.1, 0.2), np.ones(3)
        gains[worst] = 2.0
        random = np.random.default_rng(5)
        levels = [float(self.covariance(speed, 1)[0]) for speed in speeds]
        vibrations = [
            gain * np.sqrt(level) * random.standard_normal(count)
            for gain, level, count in zip(gains, levels, counts, strict=True)
        ]
        finding = judged("texture-amplitude", *vibrations, speeds=speeds)
        power = np.array([np.mean(vibration**2) for vibration in vibrations])
        off = 10.0 * np.log10(power / levels)
        off -= off.mean()
        shares = [variance_of_mean_square(self.covariance(speed), n) for speed, n in zip(speeds, counts, strict=True)]
        variances = np.array([float(polygamma(1, 1.0 / share)) for share in shares])
        # Of a stretch less the mean of three, two-sided
        scatter = 10.0 / np.log(10.0) * np.sqrt(variances * (1.0 - 2.0 / 3.0) + variances.sum() / 9.0)
        allowed = norm.isf(0.5e-3 / 3) * scatter
        assert int(np.argmax(np.abs(off) / allowed)) == worst
        assert finding.outcome is FAIL
        assert finding.metric.value == pytest.approx(abs(off[worst]))
        assert finding.bound == pytest.approx(allowed[worst], rel=1e-6)
        assert [one["off_dB"] for one in finding.evidence["stretches"]] == pytest.approx(off.tolist())
        assert finding.message.startswith(f"at {speeds[worst]:.3g} m/s and 1 N the rms is {off[worst]:+.3g} dB")


@pytest.mark.parametrize(("change", "words"), [({"variance": 0.1}, "shakes a hand that rests"), (RINGS, "still ring")])
def test_a_texture_that_does_not_come_to_rest_decides_nothing(change, words):
    model = StochasticTexture(mass=0.05, texture="ribbed").model
    filters = tuple(structs.replace(one, **change) for one in model.filters)
    runs, scene = strokes(0.1, 0.0, seconds=0.5, texture=structs.replace(model, filters=filters))
    finding = found("texture-rest", runs, scene)
    assert finding.outcome is UNDECIDED
    assert words in finding.message


@pytest.mark.parametrize(
    ("check", "effect"),
    [("texture-relief", BumpMap(wavelength=2e-3, amplitude=4e-5)), ("friction-force", ViscousFriction(4.0))],
)
def test_what_sensors_show_is_not_the_hand(check, effect):
    scene = Scene(model=LINE, effects=(effect,))
    hand = np.column_stack([4e-5 * np.arange(100.0), np.full(100, -DEPTH)])
    run = play(
        make_renderer(resolve("minimum-distance"), scene), Path(1e-3 * np.arange(100.0), hand), 1e-3, scene=scene
    )
    assert outcome(check, run, scene) is PASS
    assert outcome(check, run, scene.with_effects(VelocityFilter(cutoff=50.0))) is UNDECIDED


@pytest.mark.parametrize(("raised", "expected"), [(0.0, PASS), (1e-12, PASS), (1e-6, FAIL), (1e-4, FAIL)])
def test_a_bump_map_leaves_the_ihip_where_it_is(raised, expected):
    """To a millionth of a metre: what rounding and single precision leave open is less."""
    scene = Scene(model=LINE, effects=(BumpMap(wavelength=2e-3, amplitude=4e-5),))
    hand = Path(1e-3 * np.arange(100.0), np.column_stack([4e-5 * np.arange(100.0), np.full(100, -DEPTH)]))
    base, plain = (
        play(make_renderer(resolve("minimum-distance"), felt_scene), hand, 1e-3, scene=felt_scene)
        for felt_scene in (scene, Scene(model=LINE))
    )
    lifted = changed(base, ihip=base.ihip + np.array([0.0, raised]))
    assert outcome("texture-relief", Runs(lifted, without=lambda kind: plain), scene) is expected
    assert outcome("texture-relief", Runs(base), scene) is PASS, "where the answer without the relief is not known"


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ((PASS, 1.0), (FAIL, 3.0)),
        ((PASS, 1.0), (PASS, 1.5)),
        ((UNDECIDED, 1.0), (FAIL, 2.1)),
        ((PASS, 1.9), (UNDECIDED, 1.0)),
    ],
)
def test_of_several_effects_the_worst_is_told(first, second):
    """In whatever order the scene has them: by outcome, then by how near the measured is to its bound, 2 mm."""
    findings = {
        kind: Finding(outcome, kind, Metric("IHIP jump", value, "m"), 2.0)
        for kind, (outcome, value) in (("contact-impulse", first), ("viscous-friction", second))
    }
    effects = (ContactImpulse(), ViscousFriction(1.0))
    without, _ = pulled(0.1)
    for order in (effects, effects[::-1]):
        worst = judge_each(
            lambda runs, scene, effect, plain: findings[effect.kind],
            tuple(findings),
            Runs(without, without=lambda kind: without),
            Scene(model=LINE, effects=order),
        )
        assert worst is findings["viscous-friction"]
