"""Checks of textures: bounds that chance sets, and what they say where there is nothing to be measured."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from asked import verdicts
from msgspec import structs
from outsiders import case
from scipy.signal import lfilter, welch
from textured import variance_of_mean_square

from hapticeval.discovery import resolve
from hapticeval.effects.line_spectra import coefficients_of, line_spectrum
from hapticeval.effects.stochastic_texture import StochasticTexture
from hapticeval.effects.texture import Filter, Texture, as_document, autocovariance
from hapticeval.phenomena.checks.texture import spectrum_bound, welch_of
from hapticeval.phenomena.decisions import WELCH_WINDOW
from hapticeval.phenomena.registry import CHECKS
from hapticeval.phenomena.verdict import Level, Outcome
from hapticeval.renderer import wrapped
from hapticeval.simulation.answers import with_effects

TEXTURES = ("texture-spectrum", "texture-stationary", "texture-amplitude")
STROKE = {"kind": "points", "points": [[0.0, -1e-3], [1.05, -1e-3]], "duration": 10.5}
RIBBED = {"kind": "stochastic-texture", "texture": "ribbed", "mass": 0.05}


def judged(checks, trajectory, *effects, make="minimum-distance", model="line", **scene):
    scene = {"effects": effects, **scene}
    asked = case("it", {"kind": model}, checks, trajectory=trajectory, scene=scene)
    return verdicts(resolve(make) if isinstance(make, str) else make, asked)


def outcomes(*arguments, **more):
    return [verdict.outcome for verdict in judged(*arguments, **more).values()]


def resonance(frequency, radius=0.97, noise=1.0):
    """A texture of one resonance (Hz) at any speed and force."""
    poles = [1.0, -2 * radius * math.cos(2 * math.pi * frequency / 1e3), radius**2]
    one = Filter(speed=0.0, force=0.0, variance=noise, ar=tuple(line_spectrum(poles[1:]).tolist()))
    filters = (one, structs.replace(one, speed=1.0), structs.replace(one, force=10.0))
    return Texture(title="a resonance", rate=1e3, filters=filters)


def test_bounds_are_what_chance_makes():
    """Over 200 runs of 10 s of a resonance: the spectrum's rms error and the power's variance are as derived."""
    at = resonance(120.0).filters[0]
    rng = np.random.default_rng(5)
    covariance = autocovariance(at, WELCH_WINDOW)
    asked, errors, powers = welch_of(covariance), [], []
    for _ in range(200):
        vibration = lfilter([1.0], [1.0, *coefficients_of(at.ar)], rng.standard_normal(10_500))[500:]
        _, power = welch(vibration, 1.0, nperseg=WELCH_WINDOW)
        errors.append(np.sqrt(np.mean((10 * np.log10(power / asked)[2:-1]) ** 2)))
        powers.append(np.mean(vibration[:1250] ** 2))
    bound = spectrum_bound(10_000)
    assert bound == pytest.approx(0.63, abs=0.005)
    assert np.quantile(errors, 0.99) < bound
    assert max(errors) < 1.03 * bound
    assert np.quantile(errors, 0.99) > 0.9 * bound, "and not much more"
    assert np.mean(powers) == pytest.approx(covariance[0], rel=0.05)
    assert np.var(powers) / covariance[0] ** 2 == pytest.approx(variance_of_mean_square(covariance, 1250), rel=0.3)


def claiming(texture):
    """Return the factory of a renderer that shows this texture, whatever the scene's is."""

    class Claims:
        supports = frozenset({"stochastic-texture"})

        def __init__(self, scene):
            effect = scene.effect(StochasticTexture)
            self.inner = resolve("minimum-distance")(scene)
            if effect is not None:
                self.inner = with_effects(wrapped(self.inner), scene.with_effects(replace(effect, texture=texture)))

        def reset(self, hip):
            self.inner.reset(hip)

        def step(self, hip, velocity, dt):
            return self.inner.step(hip, velocity, dt)

    return Claims


@pytest.mark.parametrize(("shown", "asked", "outcome"), [(120.0, 120.0, "pass"), (126.0, 120.0, "fail")])
def test_another_resonance_is_found(shown, asked, outcome):
    """126 Hz in place of 120 Hz, as loud."""
    effect = {"kind": "stochastic-texture", "texture": as_document(resonance(asked)), "mass": 0.05}
    found = judged(TEXTURES[:1], STROKE, effect, make=claiming(resonance(shown)))["texture-spectrum"]
    assert found.outcome == outcome, found.finding.message


def test_a_wrong_spectrum_is_told_where_and_over_how_long():
    """At 2 kHz a texture of 1 kHz has a sample every two ticks: seconds and Hz are those of its samples."""
    claims = claiming(resonance(200.0))
    effect = {"kind": "stochastic-texture", "texture": as_document(resonance(120.0)), "mass": 0.05}
    short = {"kind": "points", "points": [[0.0, -1e-3], [0.6, -1e-3]], "duration": 6.0}
    finding = judged(TEXTURES[:1], short, effect, make=claims, sampling_time=5e-4)["texture-spectrum"].finding
    assert finding.outcome is Outcome.FAIL
    assert any(abs(finding.evidence["worst_at_Hz"] - frequency) < 20.0 for frequency in (120.0, 200.0))
    assert "over 5.75 s the spectrum is" in finding.message


def test_textures_across_the_way_and_along_the_normal_are_measured_there():
    angle = np.linspace(0.0, 2.0, 4000)
    points = 0.099 * np.column_stack([np.cos(angle), np.sin(angle), np.zeros(4000)])
    way = {"kind": "points", "points": points.tolist(), "duration": 5.0}
    for direction in ("across", "normal"):
        effect = RIBBED | {"direction": direction}
        assert outcomes(TEXTURES[:2], way, effect, model="sphere") == [Outcome.PASS] * 2


def test_a_loop_that_is_faster_than_the_texture_is_measured_at_the_texture_s_samples():
    short = {"kind": "points", "points": [[0.0, -1e-3], [0.6, -1e-3]], "duration": 6.0}
    assert outcomes(TEXTURES[:2], short, RIBBED, sampling_time=5e-4) == [Outcome.PASS] * 2
    assert outcomes(TEXTURES[:1], short, RIBBED, sampling_time=3e-4) == [Outcome.INCONCLUSIVE]


@pytest.mark.parametrize(
    ("trajectory", "words"),
    [
        ({"points": [[0.0, -1e-3], [0.1, -1e-3]], "duration": 1.0}, "samples|steady"),
        ({"points": [[0.0, -1e-4], [0.1, -3e-3]], "duration": 1.0}, "samples|steady"),
        ({"points": [[0.0, 1e-3], [0.1, 1e-3]], "duration": 1.0}, "never slides"),
    ],
)
def test_without_steady_excitation_nothing_is_decided(trajectory, words):
    found = judged(TEXTURES, {"kind": "points", **trajectory}, RIBBED)
    for verdict in found.values():
        assert verdict.outcome is (Outcome.NOT_APPLICABLE if words == "never slides" else Outcome.INCONCLUSIVE)
    assert any(word in found["texture-spectrum"].finding.message for word in words.split("|"))


def test_checks_of_textures_are_not_asked_where_there_is_none():
    way = {"kind": "points", "points": [[0.0, -1e-3], [0.01, -1e-3]], "duration": 0.2}
    assert set(outcomes((*TEXTURES, "texture-work"), way)) == {Outcome.NOT_APPLICABLE}
    bump = {"kind": "bump-map", "wavelength": 1e-3, "amplitude": 1e-5}
    found = judged(TEXTURES, way, RIBBED, bump)
    assert {verdict.outcome for verdict in found.values()} == {Outcome.NOT_APPLICABLE}
    assert "bump-map too" in found["texture-spectrum"].finding.message


LOOP = {
    "kind": "loop", "start": [0.00008, 0.002], "centre": [0.00008, -0.001], "radius": 0.0005, "laps": 2, "lap": 0.5,
    "approach": 0.1,
}  # fmt: skip
RELIEF = {"wavelength": 0.0005, "amplitude": 20e-6}


def test_the_work_of_a_relief_is_shown_in_millijoules():
    even = judged(["texture-work"], LOOP, {"kind": "height-map", **RELIEF})["texture-work"]
    assert even.outcome is Outcome.PASS
    assert abs(even.finding.metric.value) < 1e-13
    assert even.finding.evidence["aliases_above_m_s"] == pytest.approx(0.25)
    bumpy = judged(["texture-work"], LOOP, {"kind": "bump-map", **RELIEF})["texture-work"]
    assert (bumpy.outcome, bumpy.level) == (Outcome.FAIL, Level.INFO)
    assert bumpy.finding.metric.value == pytest.approx(1.368e-5, rel=1e-3)
    assert "0.01368 mJ" in bumpy.finding.message
    assert bumpy.as_expected
    free = LOOP | {"centre": [0.00008, -0.0003]}
    assert judged(["texture-work"], free, {"kind": "height-map", **RELIEF})["texture-work"].outcome is (
        Outcome.INCONCLUSIVE
    )


def test_damping_takes_work_and_is_no_fault():
    effect = {"kind": "height-map", **RELIEF}
    found = judged(["texture-work"], LOOP, effect, make="minimum-distance+pp-v", damping=1.0)["texture-work"]
    assert found.outcome is Outcome.PASS
    assert found.finding.metric.value < -1e-9


def test_each_check_explains_itself():
    for name in (*TEXTURES, "texture-work"):
        assert CHECKS[name].level is Level.MUST
        assert CHECKS[name].effects
    assert StochasticTexture(mass=0.1, texture="ribbed").active(0.0)
