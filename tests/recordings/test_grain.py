"""How finely a column is told: texts of so many digits, single precision, encoders, and none of them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticeval.recordings.integrity.consistency import inverse_checks
from hapticeval.recordings.quantization import grain
from hapticeval.recordings.recording import Recording

RNG = np.random.default_rng(2)
SIGNAL = RNG.normal(size=500)


def written(values, how):
    return np.array([float(how.format(value)) for value in values])


@given(digits=st.integers(3, 14), scale=st.floats(1e-6, 1e6))
def test_the_digits_of_a_text_are_found(digits, scale):
    kept = written(scale * SIGNAL, f"{{:.{digits - 1}e}}")
    found = grain(kept)
    assert found == pytest.approx(10.0 ** (np.floor(np.log10(np.abs(kept).max())) - digits + 1))
    assert np.abs(kept - scale * SIGNAL).max() <= 0.5 * found + np.spacing(np.abs(kept).max())


@given(digits=st.integers(3, 12), factor=st.sampled_from([1e-3, 1e-2, 25.4e-3, -1.0]))
def test_a_change_of_unit_hides_no_digits(digits, factor):
    kept = factor * written(SIGNAL, f"{{:.{digits - 1}e}}")
    assert grain(kept) >= 0.9 * 10.0 ** (np.floor(np.log10(np.abs(SIGNAL).max())) - digits + 1) * abs(factor) or (
        factor == 25.4e-3  # then the digits are no longer decimal ones
    )


@given(scale=st.floats(1e-6, 1e6))
def test_single_precision_is_found(scale):
    kept = (scale * SIGNAL).astype(np.float32).astype(float)
    assert grain(kept) == np.spacing(np.float32(np.abs(kept).max()))


@given(scale=st.floats(1e-6, 1e6))
def test_double_precision_tells_everything(scale):
    assert grain(scale * SIGNAL) == 0.0


@given(step=st.floats(1e-6, 1e-2))
def test_an_encoder_is_as_coarse_as_its_step(step):
    assert grain(step * np.round(SIGNAL / step)) == pytest.approx(step, rel=1e-6)


@pytest.mark.parametrize("values", [np.zeros(100), np.array([0.1, 0.2, 0.3]), np.array([]), np.full(9, np.nan)])
def test_of_few_numbers_nothing_is_said(values):
    assert grain(values) < 0.11  # three numbers are at most a lattice


@pytest.mark.parametrize("digits", [4, 6, 9])
def test_a_spring_written_with_few_digits_is_still_one(digits):
    """Rounding of hip, ihip and force adds up; a stiffness that is off by a per cent does not hide behind it."""
    hip = 0.05 * SIGNAL[:, None]
    ihip = hip + 0.004 * RNG.uniform(size=hip.shape)
    channels = {"hip": hip, "ihip": ihip, "force": 800.0 * (ihip - hip)}
    kept = {name: written(values[:, 0], f"{{:.{digits - 1}e}}")[:, None] for name, values in channels.items()}
    recording = Recording(1e-3 * np.arange(500), kept)
    assert inverse_checks(recording, stiffness=800.0)[0].faults == ()
    if digits > 4:
        assert inverse_checks(recording, stiffness=792.0)[0].faults
