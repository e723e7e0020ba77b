"""Velocities against their positions: honest filters pass, wrong signs, units, shifts and strangers do not."""

from __future__ import annotations

import numpy as np
import pytest

from hapticeval.recordings.integrity.relations import derivative_fit
from hapticeval.recordings.integrity.report import examine
from hapticeval.recordings.recording import Recording

DT = 1e-3
QUANTUM = 5e-6


def filtered(position, cutoff):
    """What a controller makes of encoder readings: differences through a first-order low-pass (Hz)."""
    share = 1.0 - np.exp(-2.0 * np.pi * cutoff * DT)
    out = np.zeros_like(position)
    for k in range(1, len(position)):
        out[k] = out[k - 1] + share * ((position[k] - position[k - 1]) / DT - out[k - 1])
    return out


def moved(rows=4000, *, slow=0.4, shake=0.0):
    """A stroke to and fro at `slow` Hz, 50 mm wide, with a shaking of so many metres at 70 Hz, as encoders see it."""
    time = DT * np.arange(rows)
    position = 0.05 * np.sin(2.0 * np.pi * slow * time) + shake * np.sin(2.0 * np.pi * 70.0 * time)
    return time, QUANTUM * np.round(position / QUANTUM)


def kinds(time, position, speed):
    run = Recording(time, {"hip": position[:, None], "velocity": speed[:, None]})
    return {fault.kind for fault in examine(run).faults}


@pytest.mark.parametrize("cutoff", [20.0, 50.0, 100.0, 1e4])
@pytest.mark.parametrize("shake", [0.0, 3e-4])
@pytest.mark.parametrize("slow", [0.05, 0.4, 3.0])
def test_an_honest_filter_is_sound(cutoff, shake, slow):
    time, position = moved(slow=slow, shake=shake)
    assert kinds(time, position, filtered(position, cutoff)) == set()


@pytest.mark.parametrize("cutoff", [50.0, 100.0, 1e4])
@pytest.mark.parametrize("shake", [0.0, 3e-4])
@pytest.mark.parametrize("factor", [-1.0, 1e-3, 1e3, 180.0 / np.pi, 0.7, 1.3])
def test_a_wrong_sign_or_unit_is_found(cutoff, shake, factor):
    time, position = moved(shake=shake)
    assert kinds(time, position, factor * filtered(position, cutoff)) >= {"velocity"}
    fit = derivative_fit(position, factor * filtered(position, cutoff), time, np.ones(time.size, dtype=bool))
    assert fit is not None
    assert fit.ratio == pytest.approx(factor, rel=0.05)


@pytest.mark.parametrize("rows", [-200, -15, 15, 200])
def test_a_shift_is_found(rows):
    time, position = moved(6000, slow=0.7)
    speed = np.roll(filtered(position, 100.0), rows)[300:-300]
    assert kinds(time[300:-300], position[300:-300], speed) == {"velocity"}


def test_a_lag_is_measured():
    time, position = moved(slow=0.7)
    speed = np.roll(np.gradient(position, DT), 6)
    fit = derivative_fit(position[50:-50], speed[50:-50], time[50:-50], np.ones(time.size - 100, dtype=bool))
    assert fit is not None
    assert fit.lag in (5, 6)  # a central difference is half a row early


def test_a_stranger_is_found():
    time, position = moved()
    assert kinds(time, position, np.cos(2.0 * np.pi * 1.3 * time)) == {"velocity"}
    assert kinds(time, position, position) == {"velocity"} | {"copy"}


def test_rest_tells_nothing():
    time, _ = moved()
    dither = QUANTUM * (np.arange(time.size) // 7 % 2)
    assert derivative_fit(dither, filtered(dither, 100.0), time, np.ones(time.size, dtype=bool)) is None


def test_a_gap_is_not_integrated_across():
    time, position = moved(slow=1.0)
    keep = (time < 1.0) | (time > 1.6)
    assert kinds(time[keep], position[keep], filtered(position, 100.0)[keep]) == {"gap"}
