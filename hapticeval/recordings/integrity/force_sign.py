"""Whether a force has the sign that its channel states: by energy, by direction in contact, by when a wall pushes.

Nothing here changes a sign, and nothing but physics is taken for granted: that the environment of the hand is passive,
that a surface pushes towards the tool that is on it, and that a wall pushes what moves into it.

1.  Energy decides where it can: one sign is of a passive environment, and the other is not. Where one of them makes
    the environment give energy, and the other does not, the environment is passive with the other. Where both do, it
    is active (a motor or another hand is in it); where neither does, it is lossless, or too little happened, and
    energy does not decide. `recordings.energy_balance` has what a passive environment may give, and what of that the
    numbers leave open.
2.  Else, of a recording with an IHIP: a rigid surface pushes outwards, and so does friction on it (at an angle to that)
    and damping (which may not pull). So F . (IHIP - HIP) >= 0 in all of contact, and with the wrong sign it is negative
    in all of it. A sum within a twentieth of either extreme, -|F| |IHIP - HIP| or the other, decides. (The tool of a
    teleoperator that lags or leads is no such IHIP, and its sum is in between, unless its energy has decided already. A
    surface that holds from both sides may pull, too: a scene that is `bilateral` is left out.)
3.  Of the wall of `contacts`, whose sensor may read as much in free motion as to hide its energy: a force can rise only
    while the tool moves in. Were the sign left to chance, each rise would come in either way with the same
    probability; where as few of them come on the way in as has a probability below `CHANCE_LEVEL`, the sign is
    suspected. Rises at which the tool moves by no more than its quantum do not count.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from hapticeval.errors import InputError
from hapticeval.recordings.energy_balance import PassivityTest, balance
from hapticeval.recordings.integrity.contacts import impacts, wall_channel
from hapticeval.recordings.integrity.issue import SEE_SIGN, Issue, make_issue
from hapticeval.recordings.provenance import declared_floor, is_bilateral
from hapticeval.recordings.recording import Recording
from hapticeval.recordings.stretches import stretches

PORTS = (("force", "hip", 1.0), ("operator_force", "hip", -1.0), ("wall_force", "ihip", 1.0))
"""A force, the place where it acts, and whether it acts on what is there, or is that which acts."""

# Of the sum of the sizes |F| |IHIP - HIP|: how near the sum of F . (IHIP - HIP) is to it where a force points one way.
ONE_WAY_SHARE = 0.95
CHANCE_LEVEL = 0.05  # of the probability that chance alone makes a wall push what leaves it


@dataclass(frozen=True)
class Sign:
    """What is known of the sign of a force `channel`: 1 as it is, -1 the other, 0 undecided; and why, in `words`.

    `issue` is of a sign that seems wrong.
    """

    channel: str
    sign: int
    words: str
    issue: Issue | None = None


def force_signs(recording: Recording) -> tuple[Sign, ...]:
    """Decide the sign of each force of a recording, as far as physics does, and suspect each that seems wrong."""
    signs = []
    for channel, place, sense in PORTS:
        force = recording.channels.get(channel)
        if force is None or place not in recording.channels:
            continue
        if channel == "operator_force" and np.array_equal(force, -recording.channels.get("force", np.nan)):
            continue  # one column, mapped to both
        decision = _energy(recording, channel, place, sense)
        # Energy left it open: rule 2, then rule 3, where their channels are there.
        if decision.sign == 0 and channel == "force":
            decision = _pointing(recording) or decision
        if decision.sign == 0 and recording.dimension == 1 and channel == wall_channel(recording):
            decision = _approach(recording, channel) or decision
        signs.append(decision)
    return tuple(signs)


def _energy(recording: Recording, channel: str, place: str, sense: float) -> Sign:
    """Decide by the stretch with the largest margin: rule 1."""
    floor = declared_floor(recording) or 0.0 if channel == wall_channel(recording) else 0.0
    decided: list[tuple[int, PassivityTest]] = []
    unclear: list[PassivityTest] = []
    for stretch in stretches(recording):
        rows = stretch.rows
        force = sense * recording.channels[channel][rows]
        lags = balance(recording.channels[place][rows], force, recording.time[rows], floor=floor)
        # All lags have to agree; of them the one with the smallest margin speaks.
        if lags and abs(sum(test.sign for test in lags)) == len(lags):
            decided.append((stretch.first, min(lags, key=lambda test: test.active.excess)))
        elif lags:
            unclear.append(lags[0])
    if not decided:
        return Sign(channel, 0, _unclear(unclear))
    if len({test.sign for _, test in decided}) > 1:
        return Sign(channel, 0, "energy shows one sign in one part of the run and the other in another")
    begin, best = max(decided, key=lambda candidate: candidate[1].active.excess)
    active, span = best.active, (begin + best.active.first, begin + best.active.last + 1)
    who, to = ("the wall", "tool") if channel == "wall_force" else ("the environment", "hand")
    claim = f"{who} would have given {active.energy:.3g} J to the {to}"
    where = (
        f"between {recording.time[span[0]]:.4g} and {recording.time[span[1] - 1]:.4g} s ({active.how}), and noise, "
        f"rounding and delay explain no more than {active.open:.2g} J of it"
    )
    if best.sign > 0:
        return Sign(channel, 1, f"right: with the opposite sign {claim} {where}")
    todo = f"{SEE_SIGN}. A motor, a magnet or another hand behind it may give energy, too"
    detail = f" {where}; with the opposite sign it takes energy"
    return _suspected(recording, channel, claim, detail, span, todo, energy=active.energy, open=active.open)


def _suspected(
    recording: Recording,
    channel: str,
    words: str,
    detail: str,
    span: tuple[int, int] | None,
    todo: str = SEE_SIGN,
    **measures: Any,
) -> Sign:
    """Return a sign that seems wrong, in `words`, with the issue, which has the `detail`."""
    message = f"the sign seems wrong: {words}{detail}"
    issue = make_issue(recording, "force sign", message, channel, span, todo=todo, **measures)
    return Sign(channel, -1, f"seems wrong: {words}", issue)


def _unclear(balances: list[PassivityTest]) -> str:
    """Describe why energy decides nothing: no bound, both signs active, or neither beyond doubt."""
    if not balances:
        return "undecided: the hand is not at rest twice, and was never free of force for long"
    best = max(balances, key=lambda test: max(test.as_logged.energy, test.turned.energy))
    if not best.as_logged.explained and not best.turned.explained:
        return "undecided: with either sign the environment gives energy"
    larger = max(best.as_logged, best.turned, key=lambda violation: violation.energy)
    return (
        f"undecided: with neither sign would the environment give energy beyond doubt: {max(larger.energy, 0.0):.2g} J "
        f"at most, and noise, rounding and delay explain up to {larger.open:.2g} J"
    )


def _pointing(recording: Recording) -> Sign | None:
    """Decide by the direction of the force in contact: rule 2."""
    if "ihip" not in recording.channels or is_bilateral(recording):
        return None
    reach, force = recording.ihip - recording.hip, recording.force
    sizes = np.linalg.norm(reach, axis=1) * np.linalg.norm(force, axis=1)
    rows = np.flatnonzero(recording.measured & (sizes > 0.0))
    if rows.size == 0:
        return None
    along = np.sum(force * reach, axis=1)[rows]
    # Mean cosine between F and IHIP - HIP, weighted with their sizes: 1 pushes out, -1 pulls in.
    share = float(np.sum(along) / np.sum(sizes[rows]))
    if share >= ONE_WAY_SHARE:
        return Sign("force", 1, "right: in contact it points from the HIP to the IHIP")
    if share > -ONE_WAY_SHARE:
        return None
    words = (
        f"it points away from the IHIP, into what is touched, in {np.sum(along < 0.0)} of {along.size} rows of contact"
    )
    span, todo = (int(rows[0]), int(rows[-1]) + 1), f"{SEE_SIGN}. It is to be the force on the hand"
    return _suspected(recording, "force", words, "", span, todo)


def _approach(recording: Recording, channel: str) -> Sign | None:
    """Decide by when the force that `contacts` takes for the wall's rises: rule 3."""
    from scipy.special import bdtr

    try:
        touches = impacts(recording)
    except InputError:
        return None
    into, out = len(touches.contacts), len(touches.retreats)
    if bdtr(out, into + out, 0.5) < CHANCE_LEVEL:  # so few heads or fewer in so many tosses of a coin
        return Sign(channel, 1, f"right: {into} of {into + out} pushes begin as the tool moves in")
    if not bdtr(into, into + out, 0.5) < CHANCE_LEVEL:
        return None
    words = f"{out} of {into + out} pushes begin as the tool moves away from what pushes it"
    places = ", at " + ", ".join(f"{time:.4g} s" for time in touches.retreats[:8])
    return _suspected(recording, channel, words, places, None)
