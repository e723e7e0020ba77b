"""Stochastic textures: vibrations with the spectrum that the scene's texture has at that speed and force."""

from __future__ import annotations

import math
from functools import partial
from typing import NamedTuple

import numpy as np

from hapticeval.effects.catalogue import STOCHASTIC_TEXTURE
from hapticeval.phenomena.check import Check, Runs, not_alone, required
from hapticeval.phenomena.decisions import (
    APART_DECIBELS,
    CHANCE_OF_FAILURE,
    CLEAR_DECIBELS,
    HAND_ROUNDING,
    POWER_PARTS,
    SHORTEST_STRETCH,
    SLOWEST_LOW_PASS,
    STEADY_SHARE,
    TELLING_SHARE,
    TEXTURE_SETTLES,
    WELCH_WINDOW,
    WHOLE_SAMPLE,
)
from hapticeval.phenomena.measures.surface_force import along_surface
from hapticeval.phenomena.observed import Observed
from hapticeval.phenomena.sampling import unit_vectors, worst_row
from hapticeval.phenomena.verdict import Finding, compared, undecided
from hapticeval.recordings.recording import backward_difference
from hapticeval.scene import Scene
from hapticeval.types import Array, BoolArray

DECIBELS = 10.0 / math.log(10.0)


class Stretch(NamedTuple):
    """Vibrations (n,), m/s^2, a sample of the texture each, at one speed (m/s) and press (N), from row `first` on."""

    first: int
    speed: float
    press: float
    vibration: Array


def find_stretches(runs: Runs, scene: Scene) -> list[Stretch] | Finding:
    """Return the stretches of steady speed and force, longest first, or the finding that says why there is none."""
    base, effect = runs.observed(scene), scene.effect(STOCHASTIC_TEXTURE)
    reason = not_alone(scene, STOCHASTIC_TEXTURE, because="which answer vibrations")
    if reason is not None:
        return reason
    # Only a whole number lets the texture's samples be picked.
    ticks_per_sample = _ticks_per_sample(base)
    if abs(ticks_per_sample - round(ticks_per_sample)) > WHOLE_SAMPLE:
        return undecided(f"the recording has {ticks_per_sample:.4g} ticks a sample of the texture: no whole number")
    plain = Observed(required(runs.without)(STOCHASTIC_TEXTURE), scene)
    normal = scene.model.boundary.closest_point(plain.ihip).normal
    press = np.sum(plain.force * normal, axis=1)
    velocity = backward_difference(base.hip, base.time)
    slide = along_surface(velocity, normal)
    speed = np.linalg.norm(slide, axis=1)
    direction = unit_vectors(slide)
    if effect.direction != "along":
        direction = normal if effect.direction == "normal" else np.cross(direction, normal)
    # The texture's own acceleration: what it adds along its direction, over its mass, m/s^2
    shaken = np.sum((base.force - plain.force) * direction, axis=1) / effect.mass
    settles = math.ceil(TEXTURE_SETTLES / base.dt)
    steady_stretches = []
    for first, last in _steady_spans(speed, press, plain.pressed & (speed > 0.0)):
        rows = slice(first + settles, last, round(ticks_per_sample))
        # The first part of a stretch is still under the one before.
        if last - first > settles + 1:
            means = float(speed[first + 1 : last].mean()), float(press[first + 1 : last].mean())
            steady_stretches.append(Stretch(first + settles, *means, shaken[rows]))
    if not steady_stretches:
        message = f"the hand never slides for {TEXTURE_SETTLES:g} s at a steady speed and force: nothing to be measured"
        return undecided(message)
    return sorted(steady_stretches, key=lambda stretch: -stretch.vibration.size)


def _ticks_per_sample(base: Observed) -> float:
    """Return how many ticks of a recording a sample of the scene's texture lasts."""
    return 1.0 / (float(base.scene.effect(STOCHASTIC_TEXTURE).model.rate) * base.dt)


def _steady_spans(speed: Array, press: Array, where: BoolArray) -> list[tuple[int, int]]:
    """Return first and last row, exclusive, of spans in which both stay within `STEADY_SHARE` of how they begin."""
    spans, row = [], 0
    while row < speed.size:
        if not where[row]:
            row += 1
            continue
        # From this row on as far as both quantities stay close to what they are here.
        near = where[row:].copy()
        for quantity in (speed, press):
            near &= np.abs(quantity[row:] - quantity[row]) <= STEADY_SHARE * abs(quantity[row])  # a force may pull
        count = int(np.argmin(near)) if not near.all() else near.size
        spans.append((row, row + count))
        row += count
    return spans


def _texture_covariance(scene: Scene, stretch: Stretch, count: int) -> Array:
    """Return the autocovariance (count,), (m/s^2)^2, that the scene's texture has at a stretch's speed and force."""
    from hapticeval.effects.texture import autocovariance

    return autocovariance(scene.effect(STOCHASTIC_TEXTURE).model.between(stretch.speed, stretch.press), count)


def _mean_square_variance(covariance: Array, count: int) -> float:
    """Return the variance of the mean square of `count` samples, as a share of its mean squared.

    By Isserlis's theorem for a Gaussian process of autocovariance `covariance` (k,), (m/s^2)^2.
    """
    lags = np.arange(1, min(covariance.size, count))
    # 2 / n (1 + 2 sum over lags of (r_k / r_0)^2 (1 - k / n))
    share = (covariance[lags] / covariance[0]) ** 2 * (1.0 - lags / count)
    return float(2.0 / count * (1.0 + 2.0 * share.sum()))


def _stretch_evidence(stretch: Stretch, base: Observed) -> dict[str, object]:
    """Return as evidence where a stretch is and what its power is and should be."""
    covariance = _texture_covariance(base.scene, stretch, 1)
    return {
        **base.evidence_at(stretch.first),
        "seconds": float(stretch.vibration.size * base.dt),
        "speed_m_s": stretch.speed,
        "force_N": stretch.press,
        "rms_m_s2": float(np.sqrt(np.mean(stretch.vibration**2))),
        "rms_of_the_texture_m_s2": math.sqrt(float(covariance[0])),
    }


def welch_of(covariance: Array) -> Array:
    """Return what Welch's estimate of a process tends to, (129,), by its `covariance` (256,), a sample a unit of time.

    The sum of the covariance times the window's correlation with itself.
    """
    from scipy.signal import get_window

    window = get_window("hann", WELCH_WINDOW)
    # r_k times the window's correlation with itself, normalised to one at lag 0.
    lags = covariance[:WELCH_WINDOW] * np.correlate(window, window, "full")[WELCH_WINDOW - 1 :] / (window @ window)
    # Even in the lag: negative lags stand behind, as the transform expects them.
    two_sided = np.concatenate([lags, [0.0], lags[:0:-1]])
    return np.asarray(2.0 * np.fft.rfft(two_sided).real[::2])


def spectrum_bound(count: int) -> float:
    """Return the 99.9 % quantile (dB) of the rms over bins by which Welch's estimate of `count` samples is off.

    - Of K windows that overlap by half, a bin's power has the variance v = (1 + 2 (1 - 1/K) / 36) / K, as a share of
      its mean squared: Hann's window correlates by 1/6 with itself half a window later.
    - Its logarithm has the variance of a gamma distribution's, trigamma(1/v).
    - Powers of neighbouring bins correlate by 4/9 and those beyond by 1/36, so that the mean of 126 squares has the
      freedom of 126 / (1 + 2 (4/9)^2 + 2 (1/36)^2) = 90 of them.
    """
    from scipy.special import polygamma
    from scipy.stats import chi2

    # Windows that overlap by half fit into `count` samples.
    windows = max((count - WELCH_WINDOW // 2) // (WELCH_WINDOW // 2), 1)
    share = (1.0 + 2.0 * (1.0 - 1.0 / windows) / 36.0) / windows
    # 126 bins, fewer by how much neighbours hang together.
    freedom = (WELCH_WINDOW // 2 - 2) / (1.0 + 2.0 * (4.0 / 9.0) ** 2 + 2.0 * (1.0 / 36.0) ** 2)
    deviation = DECIBELS * math.sqrt(float(polygamma(1, 1.0 / share)))
    return deviation * math.sqrt(float(chi2.ppf(1.0 - CHANCE_OF_FAILURE, freedom)) / freedom)


def judge_spectrum(runs: Runs, scene: Scene) -> Finding:
    """Compare Welch's estimate over the longest stretch with what it tends to for the texture."""
    from scipy.signal import welch

    candidates = find_stretches(runs, scene)
    if isinstance(candidates, Finding):
        return candidates
    longest = candidates[0]
    covariance = _texture_covariance(scene, longest, WELCH_WINDOW)
    if not covariance[0] > 0.0:
        return undecided("the texture is at rest at the speed and force of the longest steady stretch")
    count = longest.vibration.size
    bound = spectrum_bound(count)
    if bound > CLEAR_DECIBELS:
        return undecided(
            f"the longest steady stretch has {count} samples: by chance its spectrum is off by {bound:.3g} dB, and "
            f"{CLEAR_DECIBELS:g} dB is to be told"
        )
    # Without the bins of the mean and its neighbour, and the last: the window smears the mean.
    frequency, power = welch(longest.vibration, 1.0, nperseg=WELCH_WINDOW)
    with np.errstate(divide="ignore"):
        error = DECIBELS * np.log(power / welch_of(covariance))[2:-1]
    # A bin without power is -1000 dB, and not infinite.
    error = np.maximum(error, -1e3)
    rms, mean, worst = float(np.sqrt(np.mean(error**2))), float(error.mean()), worst_row(np.abs(error))
    rate = 1.0 / (runs.base.dt * round(_ticks_per_sample(runs.observed(scene))))
    evidence = _stretch_evidence(longest, runs.observed(scene)) | {
        "mean_error_dB": mean,
        "worst_error_dB": float(error[worst]),
        "worst_at_Hz": float(rate * frequency[2 + worst]),
    }
    where = f"at {longest.speed:.3g} m/s and {longest.press:.3g} N, over {count / rate:.3g} s"
    return compared(
        TEXTURE_SPECTRUM.measured(rms),
        bound,
        evidence,
        passes=f"{where} the spectrum is the texture's, {rms:.2g} dB off in the rms",
        fails=(
            f"{where} the spectrum is {rms:.3g} dB off in the rms, {mean:+.2g} dB in the mean, and {error[worst]:+.3g} "
            f"dB near {rate * frequency[2 + worst]:.3g} Hz; chance makes {bound:.2g} dB"
        ),
    )


def judge_stationary(runs: Runs, scene: Scene) -> Finding:
    """Compare the power in parts of the longest stretch with that in all of it."""
    from scipy.stats import gamma

    candidates = find_stretches(runs, scene)
    if isinstance(candidates, Finding):
        return candidates
    longest = candidates[0]
    size = longest.vibration.size // POWER_PARTS
    covariance = _texture_covariance(scene, longest, WELCH_WINDOW)
    if size < WELCH_WINDOW or not covariance[0] > 0.0:
        message = f"the longest steady stretch has {longest.vibration.size} samples: its parts are too short to compare"
        return undecided(message)
    # Mean square of each of the parts, (m/s^2)^2.
    power = np.mean(longest.vibration[: POWER_PARTS * size].reshape(POWER_PARTS, size) ** 2, axis=1)
    if not power.mean() > 0.0:
        return undecided("the longest steady stretch has no vibrations")
    # A mean square is about gamma distributed; its shape is one over the variance of its share.
    share = 1.0 / _mean_square_variance(covariance, size)
    # Two-sided, shared by all of the parts (Bonferroni).
    tail = 0.5 * CHANCE_OF_FAILURE / POWER_PARTS
    bound = max(abs(DECIBELS * math.log(float(gamma.ppf(p, share)) / share)) for p in (tail, 1.0 - tail))
    with np.errstate(divide="ignore"):
        part_decibels = np.maximum(DECIBELS * np.log(power / power.mean()), -1e3)
    worst = worst_row(np.abs(part_decibels))
    evidence = _stretch_evidence(longest, runs.observed(scene)) | {
        "parts_dB": [float(decibels) for decibels in part_decibels]
    }
    part = f"part {worst + 1} of {POWER_PARTS}"
    return compared(
        TEXTURE_STATIONARY.measured(abs(float(part_decibels[worst]))),
        bound,
        evidence,
        passes=f"at a steady speed and force the power stays the same, within {abs(part_decibels[worst]):.2g} dB",
        fails=f"{part} of the stretch has {part_decibels[worst]:+.3g} dB of the mean power, and chance makes "
        f"{bound:.2g} dB",
    )


def judge_amplitude(runs: Runs, scene: Scene) -> Finding:
    """Compare the powers of stretches of other speeds and forces with each other, as the texture's compare."""
    from scipy.special import polygamma
    from scipy.stats import norm

    candidates = find_stretches(runs, scene)
    if isinstance(candidates, Finding):
        return candidates
    shortest = SHORTEST_STRETCH * scene.effect(STOCHASTIC_TEXTURE).model.rate
    stretches_and_covariances = [
        (candidate, _texture_covariance(scene, candidate, WELCH_WINDOW))
        for candidate in candidates
        if candidate.vibration.size >= shortest
    ]
    stretches_and_covariances = [
        (candidate, covariance) for candidate, covariance in stretches_and_covariances if covariance[0] > 0.0
    ]
    level = np.array([DECIBELS * math.log(float(covariance[0])) for _, covariance in stretches_and_covariances])
    if level.size < 2 or np.ptp(level) < APART_DECIBELS:
        return undecided(
            f"{level.size} steady stretches of {SHORTEST_STRETCH:g} s whose rms should differ by "
            f"{float(np.ptp(level)) if level.size else 0.0:.2g} dB: {APART_DECIBELS:g} dB show if it follows speed and "
            "force"
        )
    with np.errstate(divide="ignore"):
        power = np.array([np.mean(candidate.vibration**2) for candidate, _ in stretches_and_covariances])
        error = np.maximum(DECIBELS * np.log(power), -1e3) - level
    # Variance of the logarithm of a gamma variable: trigamma(shape).
    log_variances = np.array(
        [
            polygamma(1, 1.0 / _mean_square_variance(covariance, candidate.vibration.size))
            for candidate, covariance in stretches_and_covariances
        ]
    )
    count = level.size
    # Of a stretch less the mean of all: v_j (1 - 2/n) + sum of v / n^2
    deviation = DECIBELS * np.sqrt(log_variances * (1.0 - 2.0 / count) + log_variances.sum() / count**2)
    allowed = float(norm.ppf(1.0 - 0.5 * CHANCE_OF_FAILURE / count)) * deviation
    error_from_mean = error - error.mean()
    worst = worst_row(np.abs(error_from_mean) / allowed)
    stretch = stretches_and_covariances[worst][0]
    evidence = _stretch_evidence(stretch, runs.observed(scene)) | {
        "stretches": [
            {"speed_m_s": candidate.speed, "force_N": candidate.press, "off_dB": float(gap)}
            for (candidate, _), gap in zip(stretches_and_covariances, error_from_mean, strict=True)
        ]
    }
    return compared(
        TEXTURE_AMPLITUDE.measured(abs(float(error_from_mean[worst]))),
        float(allowed[worst]),
        evidence,
        passes=(
            f"over {count} stretches, whose rms should differ by {np.ptp(level):.3g} dB, it follows speed and force "
            f"within {abs(error_from_mean[worst]):.2g} dB"
        ),
        fails=(
            f"at {stretch.speed:.3g} m/s and {stretch.press:.3g} N the rms is {error_from_mean[worst]:+.3g} dB from "
            f"what the other stretches make of it, and chance makes {allowed[worst]:.2g} dB"
        ),
    )


def judge_rest(runs: Runs, scene: Scene) -> Finding:
    """Compare the vibrations of a hand that has come to rest with those of the run before."""
    base, effect = runs.observed(scene), scene.effect(STOCHASTIC_TEXTURE)
    reason = not_alone(scene, STOCHASTIC_TEXTURE, because="which answer vibrations")
    if reason is not None:
        return reason
    plain = Observed(required(runs.without)(STOCHASTIC_TEXTURE), scene)
    added = np.linalg.norm(base.force - plain.force, axis=1)
    largest = float(np.max(np.abs(base.hip)))
    still = np.concatenate([[False], base.hip_steps <= HAND_ROUNDING * largest])
    settles = math.ceil(TEXTURE_SETTLES / base.dt)
    rows = np.arange(len(base))
    # Ticks since the hand last moved, or was off the surface.
    since = rows - np.maximum.accumulate(np.where(still & plain.pressed, -1, rows))
    rested = np.flatnonzero(since > settles)
    if not rested.size:
        return undecided(f"the hand nowhere rests on the surface for longer than {TEXTURE_SETTLES:g} s")
    tick = int(rested[worst_row(added[rested])])
    normal = scene.model.boundary.closest_point(plain.ihip[tick : tick + 1]).normal[0]
    if effect.model.between(0.0, float(plain.force[tick] @ normal)).variance > 0.0:
        return undecided("the scene's texture shakes a hand that rests, too")
    largest_moving = float(np.max(np.where(still, 0.0, added)))
    from hapticeval.effects.line_spectra import coefficients_of

    # The slowest pole of the texture's filters: they ring as radius^k.
    radius = max(float(np.max(np.abs(np.roots([1.0, *coefficients_of(one.ar)])))) for one in effect.model.filters)
    # The root of a speed that is low-passed, and a filter that rings: one after the other they fall as (1 + c t) e^-ct.
    fades = TEXTURE_SETTLES * min(math.pi * SLOWEST_LOW_PASS, -math.log(radius) * effect.model.rate)
    ringing_share = (1.0 + fades) * math.exp(-fades)
    if ringing_share > TELLING_SHARE:
        return undecided(
            f"the texture's own filters still ring with {ringing_share:.2g} of it {TEXTURE_SETTLES:g} s after a stop"
        )
    size = np.maximum(*(np.linalg.norm(recording.force, axis=1) for recording in (base, plain)))
    allowed = ringing_share * largest_moving + float(base.rounding_floor(size, scene.stiffness)[tick])
    return compared(
        TEXTURE_REST.measured(added[tick]),
        allowed,
        {**base.evidence_at(tick), "moving_N": largest_moving},
        passes=f"a hand that rests feels {added[tick]:.2g} N of vibrations that reach {largest_moving:.3g} N while it "
        "moves",
        fails=(
            f"the texture goes on at rest: {added[tick]:.3g} N at t = {base.time[tick]:.4g} s, "
            f"{since[tick] * base.dt:.3g} s after the hand has stopped"
        ),
    )


check_of_texture = partial(
    Check,
    phenomenon="none of the six: stochastic textures, thesis 4.3.2",
    citation="thesis 4.3.2 [99]",
    channels=("hip", "ihip", "force"),
    siblings={"without": "the same path in the scene without the texture"},
    needs={"without": undecided("the force without texture is not known: the hand is not led along a given path")},
    effects=(STOCHASTIC_TEXTURE,),
    unit="dB",
)
TEXTURE_SPECTRUM = check_of_texture(
    id="texture-spectrum",
    formula="rms over bins of 10 lg(P / E P) with P of Welch's method, windows of 256 samples",
    metric="rms error of the spectrum",
    judge=judge_spectrum,
)
TEXTURE_STATIONARY = check_of_texture(
    id="texture-stationary",
    formula="max over eighths i of |10 lg(P_i / mean P)|, P the mean square",
    metric="power of an eighth against the mean",
    judge=judge_stationary,
)
TEXTURE_AMPLITUDE = check_of_texture(
    id="texture-amplitude",
    formula="max over stretches j of |e_j - mean e|, e_j = 10 lg(P_j / r_0 of the texture at v_j and F_j)",
    metric="power of a stretch against the others",
    judge=judge_amplitude,
)
TEXTURE_REST = check_of_texture(
    id="texture-rest",
    formula="|F - F without the texture| <= (1 + c t) e^(-c t) max of it while the hand moves, at t = .25 s",
    metric="vibration of a hand that rests",
    judge=judge_rest,
    unit="N",
)
CHECKS = (TEXTURE_SPECTRUM, TEXTURE_STATIONARY, TEXTURE_AMPLITUDE, TEXTURE_REST)
"""The checks of this module."""
