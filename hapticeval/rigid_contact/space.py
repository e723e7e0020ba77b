"""A tool in space: its state, what the operator does to it, how it flies, and the log of what happens to it.

All grounds in space share it. Each has the loop from event to event for itself, and so has the plane:

- a loop that took a ground's steps as arguments would be compiled anew in every process, for the cache on disk knows a
  kernel again by its name, and not where it is an argument;
- the plane's tool is another: a place on a piece of the curve, without which short hops would lose their digits.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from hapticeval.compiled import compiled
from hapticeval.geometry.triples import Triple, plus, put_triple, triple_of
from hapticeval.records import numbers_of, record_type
from hapticeval.rigid_contact.force import FLIGHT, Stretches, fly_along_axis, oscillation_of
from hapticeval.types import Array, IntArray

SPACE_TOOL = record_type("mode", "triangle", "feature", position=3, velocity=3)
"""The state of a tool in space: FLIGHT, SLIDE or REST, position (m) and velocity (m/s); on a mesh also a triangle and
which feature of it the tool is on."""


class Tool(NamedTuple):
    """What the steps of one run in space read and write.

    - `state`: of the tool, the record `SPACE_TOOL`;
    - `load`: of the stretch, see `force`;
    - `sums` (6,), N s: the contact's and the operator's impulse since the sample;
    - `log` (n, 8): time, kind, place and impulse of the events, and `tally` (1,) how many there were, kept or not.
    """

    state: Any
    load: Any
    sums: Array
    log: Array
    tally: IntArray


def state_in_flight(point: Array, velocity: Array) -> Array:
    """Return the numbers of a `SPACE_TOOL` that flies from a point (3,), m, with a velocity (3,), m/s."""
    return numbers_of(SPACE_TOOL, mode=FLIGHT, triangle=0.0, feature=0.0, position=point, velocity=velocity)


@compiled
def force_in_space(load: Any, tau: float, p: Triple, v: Triple) -> Triple:
    """Return the operator's force (N) on a tool at p (m) with velocity v (m/s), `tau` (s) into a `load`."""
    pushed = plus(triple_of(load.g0), tau, triple_of(load.g1))
    return plus(plus(pushed, -load.spring, p), -load.damper, v)


@compiled
def fly_in_space(p: Triple, v: Triple, tau: float, h: float, load: Any) -> tuple[Triple, Triple]:
    """Return position (m) and velocity (m/s) after h seconds of free flight, `tau` (s) into a `load`."""
    even, odd = oscillation_of(load, h)
    push, rate = plus(triple_of(load.g0), tau, triple_of(load.g1)), triple_of(load.g1)
    x, vx = fly_along_axis(p[0], v[0], push[0], rate[0], h, load, even, odd)
    y, vy = fly_along_axis(p[1], v[1], push[1], rate[1], h, load, even, odd)
    z, vz = fly_along_axis(p[2], v[2], push[2], rate[2], h, load, even, odd)
    return (x, y, z), (vx, vy, vz)


@compiled
def move_tool(tool: Tool, p: Triple, v: Triple, contact: Triple) -> None:
    """Take the tool to p (m) and v (m/s); of the change of momentum `contact` (N s) is the contact's."""
    state, mass = tool.state, tool.load.mass
    for axis in range(3):
        tool.sums[axis] += contact[axis]
        # the operator's impulse is the change of momentum less the contact's
        tool.sums[3 + axis] += mass * (v[axis] - state.velocity[axis]) - contact[axis]
    put_triple(state.position, 0, p)
    put_triple(state.velocity, 0, v)


@compiled
def strike_tool(tool: Tool, v: Triple) -> Triple:
    """Give the tool a velocity (m/s) at once, and return the impulse (N s) of the contact that this took."""
    state, mass = tool.state, tool.load.mass
    impulse = (
        mass * (v[0] - state.velocity[0]),
        mass * (v[1] - state.velocity[1]),
        mass * (v[2] - state.velocity[2]),
    )
    for axis in range(3):
        tool.sums[axis] += impulse[axis]
    put_triple(state.velocity, 0, v)
    return impulse


@compiled
def log_in_space(tool: Tool, kind: int, tau: float, impulse: Triple) -> None:
    """Log an event at the tool's place, `tau` (s) into the stretch; beyond the log's length it is only counted."""
    k, log = tool.tally[0], tool.log
    if k < log.shape[0]:
        log[k, 0], log[k, 1] = tool.load.began + tau, kind
        put_triple(log[k], 2, triple_of(tool.state.position))
        put_triple(log[k], 5, impulse)
    # counted even where the log is full: the caller then takes a longer one
    tool.tally[0] = k + 1


@compiled
def where_given_up(tool: Tool, tau: float) -> Array:
    """Return the time in the run (s), `tau` (s) into the stretch, and the tool's place (m): (4,)."""
    place = np.empty(4)
    place[0] = tool.load.began + tau
    put_triple(place, 1, triple_of(tool.state.position))
    return place


@compiled
def begin_stretch(tool: Tool, stretches: Stretches, i: int, out: Array) -> None:
    """Load stretch i. Where it begins a new sample, close that before and write the new one's row of `out` (n, 12)."""
    for axis in range(3):
        tool.load.g0[axis], tool.load.g1[axis] = stretches.forces[i, axis], stretches.forces[i, 3 + axis]
    tool.load.began = stretches.began[i]
    sample = stretches.samples[i]
    if i > 0 and sample == stretches.samples[i - 1]:
        return
    if i > 0:
        # the impulses so far are those of the sample before
        close_sample(tool, stretches, i - 1, out)
    put_triple(out[sample], 0, triple_of(tool.state.position))
    put_triple(out[sample], 3, triple_of(tool.state.velocity))


@compiled
def close_sample(tool: Tool, stretches: Stretches, i: int, out: Array) -> None:
    """Write the impulses (N s) since the sample of stretch i into its row of `out` (n, 12), and count anew."""
    out[stretches.samples[i], 6:12] = tool.sums
    tool.sums[:] = 0.0
