"""Strategies for numbers, made of small whole ones, so that a seed gives the same in every program."""

from __future__ import annotations

import math

from hypothesis import strategies as st


def rounded(value: float, size: float) -> float:
    """Return a length (m) rounded to about 5e-6 of `size` (m), so that it can be read and pasted."""
    # five decimals after the first digit of the size
    return round(float(value), 5 - math.floor(math.log10(size)))


def share() -> st.SearchStrategy[float]:
    """Draw 0, 0.01, ..., 0.99."""
    return st.integers(0, 99).map(lambda percent: percent / 100.0)


def signed() -> st.SearchStrategy[float]:
    """Draw -0.99, ..., 0.99; smaller ones are simpler."""
    return st.integers(-99, 99).map(lambda percent: percent / 100.0)


def sizes() -> st.SearchStrategy[float]:
    """Draw a size of a model, m."""
    return st.sampled_from([0.2, 0.1, 0.05, 0.4])
