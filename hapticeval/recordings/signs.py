"""Whether a force has the sign that it says: by energy, by where it points in contact, and by when a wall pushes.

Nothing here changes a sign, and nothing but physics is taken for granted: that the environment of the hand is passive
(`port_energy`), that a surface pushes towards the tool that is on it, and that a wall pushes what moves into it.

1.  Energy decides where it can: one sign is of a passive environment, and the other is not.
2.  Else, of a recording with an IHIP: a rigid surface pushes outwards, and so does friction on it (at an angle to that)
    and damping (which may not pull). So F . (IHIP - HIP) >= 0 in all of contact, and with the wrong sign it is negative
    in all of it. A sum within a twentieth of either extreme, -|F| |IHIP - HIP| or the other, tells. (The tool of a
    teleoperator that lags or leads is no such IHIP, and its sum is in between, unless its energy has told already. A
    surface that holds from both sides may pull, too: a scene that is `bilateral` is left out.)
3.  Of the wall of `impact`, whose sensor may read as much in free motion as to hide its energy: a force can rise only
    while the tool moves in. Were the sign left to chance, each rise would come in either way with the same
    probability; where as few of them come on the way in as has a probability below `LEVEL`, the sign is suspected.
    Rises at which the tool moves by no more than its quantum do not count.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from hapticeval.errors import InputError
from hapticeval.recordings.finding import Fault, Severity
from hapticeval.recordings.impact import declared_floor, impacts, wall_channel
from hapticeval.recordings.metadata import is_bilateral
from hapticeval.recordings.port_energy import Balance, Gift, balance
from hapticeval.recordings.recording import Recording
from hapticeval.recordings.resolution import resolution
from hapticeval.recordings.stretches import Stretch, stretches

PORTS = (("force", "hip", 1.0), ("operator_force", "hip", -1.0), ("wall_force", "ihip", 1.0))
"""A force, the place where it acts, and whether it acts on what is there, or is that which acts."""

EXTREME = 0.95
"""Of the sum of the sizes: how near the sum of F . (IHIP - HIP) is to it where all of a force points one way."""

QUANTA = 3.0
"""A tool that is nearer to the HIP than so many times what the numbers resolve is in no direction of it."""

LEVEL = 0.05

ADVICE = "see its sign in the mapping, and what the sensor calls positive; no sign was changed"


@dataclass(frozen=True)
class Sign:
    """What is known of the sign of a force `channel`: 1 as it is, -1 the other, 0 not told; and why, in `words`."""

    channel: str
    sign: int
    words: str


def force_signs(recording: Recording) -> tuple[tuple[Sign, ...], list[Fault]]:
    """What tells the sign of each force of a recording, and a suspicion of each that seems to have the wrong one."""
    signs, faults = [], []
    for channel, place, sense in PORTS:
        if not {channel, place} <= recording.channels.keys() or _twice(recording, channel):
            continue
        told, fault = _energy(recording, channel, place, sense)
        if told.sign == 0 and channel == "force":
            told, fault = _pointing(recording, told)
        if told.sign == 0 and recording.dimension == 1:
            told, fault = _approach(recording, told)
        signs.append(told)
        faults += [] if fault is None else [fault]
    return tuple(signs), faults


def _twice(recording: Recording, channel: str) -> bool:
    """Whether it is the force on the hand, turned: one column, mapped to both."""
    force = recording.channels.get("force")
    return channel == "operator_force" and force is not None and np.array_equal(recording.channels[channel], -force)


def _energy(recording: Recording, channel: str, place: str, sense: float) -> tuple[Sign, Fault | None]:
    """By the stretch that tells the most."""
    floor = _floor(recording, channel)
    found: list[tuple[Stretch, Balance]] = []
    unclear: list[Balance] = []
    for stretch in stretches(recording):
        rows = stretch.rows
        force = sense * recording.channels[channel][rows]
        lags = balance(recording.channels[place][rows], force, recording.time[rows], floor=floor)
        if lags and abs(sum(each.sign for each in lags)) == len(lags):
            found.append((stretch, min(lags, key=_margin)))
        elif lags:
            unclear.append(lags[0])
    if not found:
        return Sign(channel, 0, _unclear(unclear)), None
    if len({each.sign for _, each in found}) > 1:
        return Sign(channel, 0, "energy tells one sign in one part of the run and the other in another"), None
    stretch, best = max(found, key=lambda each: _margin(each[1]))
    active = best.turned if best.sign > 0 else best.given
    first, last = stretch.first + active.first, stretch.first + active.last
    times = float(recording.time[first]), float(recording.time[last])
    would = f"the environment would have given {active.energy:.3g} J to the hand"
    if channel == "wall_force":
        would = f"the wall would have given {active.energy:.3g} J to the tool"
    where = (
        f"between {times[0]:.4g} and {times[1]:.4g} s ({active.how}), and noise, rounding and delay explain "
        f"no more than {active.open:.2g} J of it"
    )
    if best.sign > 0:
        return Sign(channel, 1, f"right: with the opposite sign {would} {where}"), None
    fault = Fault(
        "force sign",
        Severity.SUSPICIOUS,
        f"the sign seems wrong: with it {would} {where}; with the opposite sign it takes energy",
        f"{ADVICE}. A motor, a magnet or another hand behind it may give energy, too",
        channel,
        first,
        last + 1,
        times,
        {"energy": active.energy, "open": active.open},
    )
    return Sign(channel, -1, f"seems wrong: {would}"), fault


def _margin(balance: Balance) -> float:
    """How far the active one of both signs is beyond what is open."""
    active: Gift = balance.turned if balance.sign > 0 else balance.given
    return active.energy - active.open


def _unclear(found: list[Balance]) -> str:
    if not found:
        return "not told: the hand is not at rest twice, and was never free of force for long"
    best = max(found, key=lambda each: max(each.given.energy, each.turned.energy))
    if not best.given.passive and not best.turned.passive:
        return "not told: with either sign the environment gives energy"
    larger = max(best.given, best.turned, key=lambda each: each.energy)
    return (
        f"not told: with neither sign would the environment give energy beyond doubt: {max(larger.energy, 0.0):.2g} J "
        f"at most, and noise, rounding and delay explain up to {larger.open:.2g} J"
    )


def _pointing(recording: Recording, told: Sign) -> tuple[Sign, Fault | None]:
    """Rule 2."""
    if "ihip" not in recording.channels or is_bilateral(recording.meta):
        return told, None
    keep = recording.measured
    reach, force = recording.ihip - recording.hip, recording.force
    sizes = np.linalg.norm(reach, axis=1) * np.linalg.norm(force, axis=1)
    rows = keep & (np.linalg.norm(reach, axis=1) > QUANTA * resolution(recording).position) & (sizes > 0.0)
    if not rows.any():
        return told, None
    along = np.sum(force * reach, axis=1)[rows]
    share = float(np.sum(along) / np.sum(sizes[rows]))
    if share >= EXTREME:
        return Sign(told.channel, 1, "right: in contact it points from the HIP to the IHIP"), None
    if share > -EXTREME:
        return told, None
    first, last = int(np.argmax(rows)), int(rows.size - 1 - np.argmax(rows[::-1]))
    count = int(np.sum(along < 0.0))
    words = f"it points away from the IHIP, into what is touched, in {count} of {along.size} rows of contact"
    fault = Fault(
        "force sign",
        Severity.SUSPICIOUS,
        f"the sign seems wrong: {words}",
        f"{ADVICE}. It is to be the force on the hand",
        told.channel,
        first,
        last + 1,
        (float(recording.time[first]), float(recording.time[last])),
        {"share": share},
    )
    return Sign(told.channel, -1, f"seems wrong: {words}"), fault


def _approach(recording: Recording, told: Sign) -> tuple[Sign, Fault | None]:
    """Rule 3, of the force that `impact` takes for the wall's."""
    if told.channel != wall_channel(recording):
        return told, None
    try:
        found = impacts(recording)
    except InputError:
        return told, None
    into, out = len(found.contacts), len(found.retreats)
    if _chance(out, into + out) < LEVEL:
        return Sign(told.channel, 1, f"right: {into} of {into + out} pushes begin as the tool moves in"), None
    if not _chance(into, into + out) < LEVEL:
        return told, None
    words = f"{out} of {into + out} pushes begin as the tool moves away from what pushes it"
    fault = Fault(
        "force sign",
        Severity.SUSPICIOUS,
        f"the sign seems wrong: {words}, at {', '.join(f'{each:.4g} s' for each in found.retreats[:8])}",
        ADVICE,
        told.channel,
        measures={"into": into, "out": out},
    )
    return Sign(told.channel, -1, f"seems wrong: {words}"), fault


def _chance(few: int, count: int) -> float:
    """The probability of so few heads or fewer in `count` tosses of a coin."""
    return sum(math.comb(count, k) for k in range(few + 1)) / 2.0**count


def _floor(recording: Recording, channel: str) -> float:
    """What the sensor may read in free motion: declared of the force that `impact` takes for the wall's."""
    return declared_floor(recording) or 0.0 if channel == wall_channel(recording) else 0.0
