"""Arc length on a smooth closed curve, and its inverse, by panels on which a quadrature rule is exact to rounding.

Pieces (9,) are as in `kernels`. This is done once for a curve, so it is numpy over few kernels: compiling takes longer.
"""

from __future__ import annotations

import numpy as np

from hapticeval.compiled import for_kernels
from hapticeval.geometry.curve_kernels import speed_integrals
from hapticeval.geometry.kernels import PIECE, evaluate_many
from hapticeval.records import as_record
from hapticeval.types import Array, IntArray

MOST_HALVINGS, MOST_PANELS = 48, 100_000
"""How often a panel is halved, and the number of panels from which on none is: rounding ends it long before."""

MOST_NEWTON_STEPS = 60
"""Steps of Newton's method, where each that would leave the bracket halves it."""


def cut_into_panels(piece: Array, count: int) -> Array:
    """Return a smooth piece (9,) cut so finely that the 16-point rule is exact to rounding: rows (m, 2) of u and s, m.

    It begins with `count` equal panels, and halves each on which the rule is not.
    """
    _, first, last = as_record(piece, PIECE)
    edges = first + np.arange(count + 1) * ((last - first) / count)
    edges[-1] = last
    starts, ends = edges[:-1], edges[1:]
    # a first estimate: errors count as a share of the whole length
    total_length = float(speed_integrals(piece, starts, ends).sum())
    fine_ends, fine_lengths = [edges[:1]], [np.zeros(1)]
    for halving in range(MOST_HALVINGS + 1):
        middles = 0.5 * (starts + ends)
        halves = speed_integrals(piece, starts, middles) + speed_integrals(piece, middles, ends)
        # the nodes are rounded to 5e-16 rad, which the change of speed makes an error of the length
        speed_change = np.abs(_speeds(piece, ends) - _speeds(piece, starts))
        rounding = 4e-16 * total_length + 4e-16 * halves + 1e-15 * speed_change
        # the rule on the panel agrees with that on its halves
        fine = np.abs(speed_integrals(piece, starts, ends) - halves) <= rounding
        if halving == MOST_HALVINGS or sum(map(len, fine_ends)) + 2 * starts.size > MOST_PANELS:
            fine[:] = True
        fine_ends.append(ends[fine])
        fine_lengths.append(halves[fine])
        starts, ends = np.append(starts[~fine], middles[~fine]), np.append(middles[~fine], ends[~fine])
        if not starts.size:
            break
    u = np.concatenate(fine_ends)
    in_order = np.argsort(u)
    return np.column_stack([u[in_order], _compensated_sums(np.concatenate(fine_lengths)[in_order])])


def arc_lengths(piece: Array, panels: Array, us: Array) -> Array:
    """Return the arc length (n,), m, from the start of a smooth piece (9,) to each of `us` (n,) in its range.

    `panels` (m, 2) are those of `cut_into_panels`.
    """
    panel = _panel_of(panels[:, 0], us)
    # up to the panel by the table, within it by the rule
    return np.asarray(panels[panel, 1] + speed_integrals(piece, panels[panel, 0], for_kernels(us)))


def parameters_at(piece: Array, panels: Array, lengths: Array) -> Array:
    """Return the u (n,) at each of the arc `lengths` (n,), m, of a smooth piece (9,), by safeguarded Newton.

    `panels` (m, 2) are those of `cut_into_panels`. On a panel, which 16 nodes resolve to rounding, a step of 1e-9 of
    its width leaves the square of that.
    """
    panel = _panel_of(panels[:, 1], lengths)
    begin, length_before = panels[panel, 0], panels[panel, 1]
    low, high = begin, panels[panel + 1, 0]
    tolerance = np.maximum(1e-9 * (high - low), 2e-16 * (1.0 + np.abs(high)))
    # start as if the speed were constant on the panel
    u = low + (high - low) * (lengths - length_before) / (panels[panel + 1, 1] - length_before)
    moving = np.ones(u.shape, dtype=bool)
    for _ in range(MOST_NEWTON_STEPS):
        excess = length_before + speed_integrals(piece, begin, u) - lengths
        low, high = np.where(excess > 0.0, low, u), np.where(excess > 0.0, u, high)
        # Newton: ds/du is the speed |c'|; half-way where that leaves the bracket
        proposed = u - excess / _speeds(piece, u)
        inside = (low <= proposed) & (proposed <= high)
        last, u = u, np.where(moving, np.where(inside, proposed, 0.5 * (low + high)), u)
        moving &= np.abs(u - last) > tolerance
        if not moving.any():
            break
    return np.asarray(u)


def sample_panels(piece: Array, panels: Array, cuts: int) -> Array:
    """Return the table (m, 8) that `curve_kernels.project` needs: each panel of a piece (9,) in `cuts` steps of u.

    `panels` (k, 2) are those of `cut_into_panels`; a row is u, s (m), position (m) and two derivatives by u.
    """
    row = np.arange((panels.shape[0] - 1) * cuts + 1)
    panel = np.minimum(row // cuts, panels.shape[0] - 2)
    begin = panels[panel, 0]
    u = begin + (panels[panel + 1, 0] - begin) * (row - panel * cuts) / cuts
    s = panels[panel, 1] + speed_integrals(piece, begin, u)
    return np.column_stack([u, s, evaluate_many(piece[np.newaxis], u)])


def _panel_of(starts: Array, values: Array) -> IntArray:
    """Return the number of the panel (n,) in which each of `values` (n,) lies, of panels between `starts` (m,)."""
    # np.clip takes five times as long for a single value
    return np.minimum(np.maximum(np.searchsorted(starts, values, "right") - 1, 0), starts.size - 2)


def _speeds(piece: Array, us: Array) -> Array:
    """Return |c'| (n,), m per unit of u, at `us` (n,)."""
    derivatives = evaluate_many(piece[np.newaxis], us)[:, 2:4]
    return np.hypot(derivatives[:, 0], derivatives[:, 1])


def _compensated_sums(terms: Array) -> Array:
    """Return the sum of the terms (n,) up to each, by Kahan: a thousand panels must not cost three digits."""
    sums, carry = np.empty(terms.size), 0.0
    sums[0] = terms[0]
    for i in range(1, terms.size):
        # `carry` is what the last addition lost
        increment = terms[i] - carry
        sums[i] = sums[i - 1] + increment
        carry = (sums[i] - sums[i - 1]) - increment
    return sums
