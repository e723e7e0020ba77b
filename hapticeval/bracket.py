"""One bracketed root finder for compiled code: the chord by the Illinois rule, and Newton's method kept in a bracket.

A search narrows its bracket until no number lies between the ends, or until its own test is met.
"""

from __future__ import annotations

from hapticeval.compiled import compiled, inner

MOST_GUESSES = 120
"""Most guesses at a change of sign: every fourth halves what is left, and rounding ends it before."""


@compiled
def guess_between(low: float, high: float, a: float, b: float, i: int) -> float:
    """Return where to look next for the change of sign of a number that is a at `low` and b at `high`.

    By the chord, and by halves at every fourth `i`. The result is not between the two if no number lies there.
    """
    middle = low + 0.5 * (high - low)
    if i % 4 != 3 and a != b:
        # regula falsi; every fourth guess halves the bracket, so that it shrinks in any case
        by_chord = high - b * (high - low) / (b - a)
        if low < by_chord < high:
            return by_chord
    return middle


@compiled
def narrow_bracket(
    low: float, high: float, a: float, b: float, side_kept: int, middle: float, value: float, positive: bool
) -> tuple[float, float, float, float, int]:
    """Return `low`, `high`, their values a and b, and the side kept, after the `value` at `middle` was looked at.

    `positive` says whether the value at the first `low` was. By the Illinois rule the value of an end that is kept
    twice is halved, so that the chord leaves it; `side_kept` is 1 where `high` was kept last, 2 for `low`, 0 at first.
    """
    if (value > 0.0) == positive:
        return middle, high, value, b * (0.5 if side_kept == 1 else 1.0), 1
    return low, middle, a * (0.5 if side_kept == 2 else 1.0), value, 2


@inner
def step_within(low: float, high: float, proposed: float) -> float:
    """Return where Newton's method goes on: where it `proposed`, or half-way if that is outside of the bracket."""
    return proposed if low <= proposed <= high else 0.5 * (low + high)
