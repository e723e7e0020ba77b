"""The causes that a contact point (IHIP) may be off by: late, filtered, held, at a depth, kept too long, let go."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from hapticeval.diagnosis.causes import LEAST_DELAY, MOST_DELAY, Cause, late, text
from hapticeval.diagnosis.contact import RightContact, dot_rows
from hapticeval.diagnosis.fits import delayed, fit_delay, fit_delay_within, fit_hold, fit_low_pass, power
from hapticeval.types import Array


def tool_causes(ihip: Array, contact: RightContact) -> Iterator[Cause]:
    """Yield causes for contact points `ihip` (n, N), m, that are not those of the `contact`."""
    hand, point, step = contact.hip, contact.point, contact.step
    right, apart = power(ihip - point), np.any(ihip != hand, axis=1)
    off = np.sum((ihip - point) ** 2, axis=1)
    start = hand[0]
    most = int(min(MOST_DELAY / step, len(hand) // 3))
    fit = fit_delay(ihip - start, point - start, most=most, early=False, free_gain=False)
    if fit.ticks > LEAST_DELAY:
        yield _lag(fit.ticks, step, fit.left)
        # What came before the first row is not known: those rows are left out, where they are few.
        whole = round(fit.ticks)
        if 0 < whole < len(hand) // 20:
            yield _lag(whole, step, power((ihip - delayed(point, whole))[whole:]), 1.3)
    # Late in contact alone: in free space the tool is at the hand of now.
    for rows in (contact.touches, apart):
        ticks = fit_delay_within(ihip - start, point - start, rows, most=most)
        if ticks:
            for touching in (contact.touches, apart):
                model = np.where(touching[:, None], delayed(point, ticks), hand)
                yield _lag(ticks, step, power(ihip - model))
    touching = apart & contact.touches
    if np.count_nonzero(touching) > 5:
        offset = float(np.mean(dot_rows(ihip - point, contact.normal)[touching]))
        beyond = contact.depth + offset
        model = np.where((beyond > 0.0)[:, None], hand + beyond[:, None] * contact.normal, hand)
        side = "outside" if offset > 0.0 else "inside"
        words = f"the contact point lies {text(1e3 * abs(offset))} mm {side} the model"
        yield Cause("offset", words, power(ihip - model), 1.0, {"metres": offset})
    hold = fit_hold(ihip, point)
    if hold is not None:
        ticks, left = hold
        yield Cause("hold", f"the contact point is renewed every {ticks} ticks alone", left, 1.0, {"ticks": ticks})
    fit_filter = fit_low_pass(ihip - start, point - start, exact=True)
    if fit_filter.share < 0.9999:
        constant = step * (1.0 - fit_filter.share) / fit_filter.share
        words = f"the contact point is low-passed, with a time constant of {text(1e3 * constant)} ms"
        yield Cause("low-pass", words, fit_filter.left, 1.0, {"seconds": constant})
    apart_in_free_space, lost_in_contact = apart & ~contact.touches, ~apart & contact.touches
    if apart_in_free_space.any():
        reach = float(np.sqrt(off[apart_in_free_space].max()))
        words = f"the contact point is up to {text(1e3 * reach)} mm off the hand in free space"
        yield Cause("residue", words, right - float(off[apart_in_free_space].sum()), 3.0, {"metres": reach})
    leaving = lost_in_contact & (contact.normal_speed > 0.0)
    if leaving.any():
        depth = float(contact.depth[leaving].max())
        words = f"the tool lets go on the way out, {text(1e3 * depth)} mm below the surface"
        yield Cause("early release", words, right - float(off[leaving].sum()), 2.0, {"metres": depth})
    if lost_in_contact.any():
        depth, seconds = float(contact.depth[lost_in_contact].max()), float(np.count_nonzero(lost_in_contact)) * step
        words = f"the contact is lost for {text(1e3 * seconds)} ms, up to {text(1e3 * depth)} mm inside the model"
        yield Cause("contact lost", words, right - float(off[lost_in_contact].sum()), 2.5, {"metres": depth})


def _lag(ticks: float, step: float, left: float, cost: float = 1.0) -> Cause:
    words = f"the contact point comes {late(ticks, step)}"
    return Cause("lag", words, left, cost, {"ticks": float(ticks), "seconds": ticks * step})
