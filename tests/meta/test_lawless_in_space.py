"""Laws of a contact broken on solids, led and in a closed loop: each law's check passes the right one and stops it.

A rigid contact is spoiled in its recording, where a corner or a collision is; a spring in its answers, where the fault
has to move the tool.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from broken import Tick, spoiled

from hapticeval.phenomena.verdict import Outcome
from hapticeval.recordings.recording import Recording
from hapticeval.rigid_contact import ideal
from hapticeval.rigid_contact.contact import IdealContact
from hapticeval.runner.judging import judge
from hapticeval.suite.reading import load_suite


class SpoiledContact:
    """The ideal contact with its channels spoiled."""

    supports = IdealContact.supports

    def __init__(self, scene, spoil):
        self.scene, self.spoil, self.contact = scene, spoil, ideal(scene)

    def simulate(self, stimulus, dt):
        true = self.contact.simulate(stimulus, dt)
        channels = {name: np.array(values) for name, values in true.channels.items()}
        self.spoil(channels, true, self.scene)
        return Recording(true.time, channels, true.meta)


def lingers(channels, true, scene):
    """The tool hangs on the edge, with its last force, for 200 ticks after it has left it."""
    last = int(np.flatnonzero(true.contact)[-1])
    channels["force"][last : last + 200] = true.force[last - 1]
    channels["ihip"][last : last + 200] = true.ihip[last]


def cushions(channels, true, scene):
    """A collision takes the momentum out over 20 ticks instead of at once."""
    struck = int(np.argmax(true.contact))
    change = true.velocity[struck + 1] - true.velocity[struck]
    for k in range(1, 21):
        channels["velocity"][struck + k] -= (1.0 - k / 20.0) * change
    channels["force"][struck : struck + 20] = true.force[struck] / 20.0


def rounds(tick: Tick):
    """In a concave edge the spring turns with the hand, over an arc, and does not switch."""
    return tick.ihip, tick.force


def kicks(tick: Tick):
    """A tenth more force on the way out than on the way in."""
    return tick.ihip, (1.1 if float(tick.velocity @ tick.force) > 0.0 else 1.0) * tick.force


def wanders(tick: Tick):
    """The tool's place on the surface wanders by a micrometre a second; the force, which moves the hand, does not."""
    return tick.ihip + np.array([1e-6 * tick.time * tick.inside, 0.0, 0.0]), tick.force


def trembles(tick: Tick):
    """In contact the force swings along x, by half a newton and ten times a second."""
    swing = 0.5 * np.sin(20.0 * np.pi * tick.time) * tick.inside
    return tick.ihip, tick.force + np.array([swing, 0.0, 0.0])


LAWLESS = [
    ("broken-contact", "solids/cube-edge", lingers),
    ("broken-contact", "dynamics-unilateral/cube-edge", lingers),
    ("abrupt-switch", "solids/l-block-notch", rounds),
    ("abrupt-switch", "dynamics-unilateral/l-block-notch", rounds),
    ("impulsive-collision", "solids/cube-impact", cushions),
    ("passivity", "hard-cases-loops/laps-niche", kicks),
    ("passivity", "solids/cube-impact", kicks),
    ("drift", "hard-cases-loops/laps-niche", wanders),
    ("drift", "dynamics-unilateral/cube-laps", wanders),
    ("comes-to-rest", "dynamics-unilateral/cube-laps", trembles),
    ("comes-to-rest", "solids/inner-corner-rest", trembles),
]


@cache
def outcomes(place, fault):
    """What all checks of a case find: of the right contact without a fault, of a spring or a rigid one with one."""
    suite, name = place.split("/")
    if fault in (lingers, cushions):
        make = lambda scene: SpoiledContact(scene, fault)  # noqa: E731 - one of four factories
    elif fault is not None:
        make = spoiled(fault, "constraint")
    else:
        make = ideal
    judged = judge(make, "lawless", suite, load_suite(suite).case(name))
    assert judged.error is None
    return {verdict.check: verdict.outcome for verdict in judged.verdicts}


@pytest.mark.parametrize(("check", "place", "fault"), LAWLESS)
def test_a_broken_law_is_found_by_its_check_in_space(check, place, fault):
    assert outcomes(place, fault)[check] is Outcome.FAIL
    # a rigid tool's force is no answer to where it is, so that it cannot drift
    right = {Outcome.PASS, Outcome.INCONCLUSIVE} if check == "drift" else {Outcome.PASS}
    assert outcomes(place, None)[check] in right
