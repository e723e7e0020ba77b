"""A tool in space: its state, what the operator does to it, how it flies, and the log of what happens to it.

Grounds in space share it; each keeps what else it knows of the tool's place from `OWN` on in the state.
"""

from __future__ import annotations

from typing import NamedTuple

from hapticeval.compiled import compiled, inner
from hapticeval.geometry.surface import Triple, plus
from hapticeval.rigid_contact.force import (
    BEGAN,
    DAMPER,
    MASS,
    PUSH,
    SPRING,
    Stretches,
    fly_along_axis,
    oscillation_of,
)
from hapticeval.types import Array, IntArray

MODE, POSITION, VELOCITY, OWN = 0, 1, 4, 7
"""Places in the state of a tool in space: FLIGHT, SLIDE or REST; three of position (m); three of velocity (m/s)."""

RATE = PUSH + 3
"""Place in a `load` (12,) of a tool in space from which g1 (N/s) stands, by axis; g0 stands from PUSH on."""


class Tool(NamedTuple):
    """What the steps of one run in space read and write.

    - `state` (OWN + k,): of the tool, with the k places that its ground adds;
    - `load` (12,): of the stretch, see `force`;
    - `sums` (6,), N s: the contact's and the operator's impulse since the sample;
    - `log` (n, 8): time, kind, place and impulse of the events, and `tally` (1,) how many there were, kept or not.
    """

    state: Array
    load: Array
    sums: Array
    log: Array
    tally: IntArray


@inner
def triple_at(row: Array, first: int) -> Triple:
    """Return the vector that stands in a row (n,) from place `first` on."""
    return row[first], row[first + 1], row[first + 2]


@inner
def put_triple(row: Array, first: int, a: Triple) -> None:
    """Write a vector into a row (n,) from place `first` on."""
    row[first], row[first + 1], row[first + 2] = a


@compiled
def force_in_space(load: Array, tau: float, p: Triple, v: Triple) -> Triple:
    """Return the operator's force (N) on a tool at p (m) with velocity v (m/s), `tau` (s) into a `load` (12,)."""
    pushed = plus(triple_at(load, PUSH), tau, triple_at(load, RATE))
    return plus(plus(pushed, -load[SPRING], p), -load[DAMPER], v)


@compiled
def fly_in_space(p: Triple, v: Triple, tau: float, h: float, load: Array) -> tuple[Triple, Triple]:
    """Return position (m) and velocity (m/s) after h seconds of free flight, `tau` (s) into a `load` (12,)."""
    even, odd = oscillation_of(load, h)
    push, rate = plus(triple_at(load, PUSH), tau, triple_at(load, RATE)), triple_at(load, RATE)
    x, vx = fly_along_axis(p[0], v[0], push[0], rate[0], h, load, even, odd)
    y, vy = fly_along_axis(p[1], v[1], push[1], rate[1], h, load, even, odd)
    z, vz = fly_along_axis(p[2], v[2], push[2], rate[2], h, load, even, odd)
    return (x, y, z), (vx, vy, vz)


@compiled
def move_tool(tool: Tool, p: Triple, v: Triple, contact: Triple) -> None:
    """Take the tool to p (m) and v (m/s); of the change of momentum `contact` (N s) is the contact's."""
    state, mass = tool.state, tool.load[MASS]
    for axis in range(3):
        tool.sums[axis] += contact[axis]
        # the operator's impulse is the change of momentum less the contact's
        tool.sums[3 + axis] += mass * (v[axis] - state[VELOCITY + axis]) - contact[axis]
    put_triple(state, POSITION, p)
    put_triple(state, VELOCITY, v)


@compiled
def strike_tool(tool: Tool, v: Triple) -> Triple:
    """Give the tool a velocity (m/s) at once, and return the impulse (N s) of the contact that this took."""
    state, mass = tool.state, tool.load[MASS]
    impulse = (
        mass * (v[0] - state[VELOCITY]),
        mass * (v[1] - state[VELOCITY + 1]),
        mass * (v[2] - state[VELOCITY + 2]),
    )
    for axis in range(3):
        tool.sums[axis] += impulse[axis]
    put_triple(state, VELOCITY, v)
    return impulse


@compiled
def log_in_space(tool: Tool, kind: int, tau: float, impulse: Triple) -> None:
    """Log an event at the tool's place, `tau` (s) into the stretch; beyond the log's length it is only counted."""
    k, log = tool.tally[0], tool.log
    if k < log.shape[0]:
        log[k, 0], log[k, 1] = tool.load[BEGAN] + tau, kind
        put_triple(log[k], 2, triple_at(tool.state, POSITION))
        put_triple(log[k], 5, impulse)
    # counted even where the log is full: the caller then takes a longer one
    tool.tally[0] = k + 1


@compiled
def begin_stretch(tool: Tool, stretches: Stretches, i: int, out: Array) -> None:
    """Load stretch i. Where it begins a new sample, close that before and write the new one's row of `out` (n, 12)."""
    tool.load[PUSH:] = stretches.forces[i]
    tool.load[BEGAN] = stretches.began[i]
    sample = stretches.samples[i]
    if i > 0 and sample == stretches.samples[i - 1]:
        return
    if i > 0:
        # the impulses so far are those of the sample before
        close_sample(tool, stretches, i - 1, out)
    out[sample, 0:6] = tool.state[POSITION:OWN]


@compiled
def close_sample(tool: Tool, stretches: Stretches, i: int, out: Array) -> None:
    """Write the impulses since the sample of stretch i into its row of `out` (n, 12), and count anew."""
    out[stretches.samples[i], 6:12] = tool.sums
    tool.sums[:] = 0.0
