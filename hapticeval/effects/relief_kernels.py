"""Compiled height and bump maps: heights and slopes over a foot point, and the changes of an answer by them.

The changes are plain Python, which is compiled for the scenes that call for them; what they call is compiled already.
"""

from __future__ import annotations

import math

from hapticeval.compiled import FOOT, NORMAL, SHAPE, Closest, Numbers, borrowing
from hapticeval.types import Array

STIFFNESS, BILATERAL, WAVE, AMPLITUDE, UNIT = 0, 1, 2, 3, 4
"""Numbers in `params`: K (N/m), whether the surface holds from both sides, wavelength and amplitude of a sine (m), and
the unit direction of waves in space."""

NEAR = 0.1
"""Share of the wavelength by which an IHIP may be off the nearest point: a tenth of a turn of the phase."""

FLAT = 1e-9
"""Least determinant of I - d W: at the medial axis it is zero."""


@borrowing
def relief(params: Array, cells: Array, frame: Array, slope: Array) -> float:
    """Return the height (m) over the foot of `frame` (see `CLOSEST`), and write its gradient along the surface (N,)."""
    count, wave = slope.shape[0], params[WAVE]
    unit_on_normal = 0.0
    if count == 2:
        coordinate = frame[SHAPE + 2, 0]
    else:
        coordinate = 0.0
        for i in range(count):
            coordinate += params[UNIT + i] * frame[FOOT, i]
            unit_on_normal += params[UNIT + i] * frame[NORMAL, i]
    if cells.shape[0] == 0:
        angle = 2.0 * math.pi * (coordinate / wave)
        height, rise_rate = (
            params[AMPLITUDE] * math.sin(angle),
            params[AMPLITUDE] * 2.0 * math.pi / wave * math.cos(angle),
        )
    else:
        turns = coordinate / wave
        x = (turns - math.floor(turns)) * cells.shape[0]
        k = min(int(x), cells.shape[0] - 1)
        x -= k
        height = ((cells[k, 0] * x + cells[k, 1]) * x + cells[k, 2]) * x + cells[k, 3]
        rise_rate = ((3.0 * cells[k, 0] * x + 2.0 * cells[k, 1]) * x + cells[k, 2]) * cells.shape[0] / wave
    if count == 2:
        slope[0], slope[1] = -rise_rate * frame[NORMAL, 1], rise_rate * frame[NORMAL, 0]
    else:
        for i in range(count):
            slope[i] = rise_rate * (params[UNIT + i] - unit_on_normal * frame[NORMAL, i])
    return float(height)


@borrowing
def spread(frame: Array, depth: float, slope: Array) -> bool:
    """Replace a gradient `slope` (N,) along the surface by (I - depth W)^-1 times it; return whether there is one."""
    if slope.shape[0] == 2:
        share = 1.0 - depth * (frame[SHAPE, 0] + frame[SHAPE + 1, 1])
        if share <= FLAT:
            return False
        slope[0] /= share
        slope[1] /= share
        return True
    a, b, c = 1.0 - depth * frame[SHAPE, 0], -depth * frame[SHAPE, 1], -depth * frame[SHAPE, 2]
    e, f, i = 1.0 - depth * frame[SHAPE + 1, 1], -depth * frame[SHAPE + 1, 2], 1.0 - depth * frame[SHAPE + 2, 2]
    p, q, r = e * i - f * f, c * f - b * i, b * f - c * e
    determinant = a * p + b * q + c * r
    if determinant <= FLAT:
        return False
    x, y, z = slope[0], slope[1], slope[2]
    slope[0] = (p * x + q * y + r * z) / determinant
    slope[1] = (q * x + (a * i - c * c) * y + (b * c - a * f) * z) / determinant
    slope[2] = (r * x + (b * c - a * f) * y + (a * e - b * b) * z) / determinant
    return True


def raise_surface(
    numbers: Numbers,
    closest: Closest,
    hip: Array,
    velocity: Array,  # noqa: ARG001 - as every change
    dt: float,  # noqa: ARG001
    ihip: Array,
    force: Array,
) -> int:
    """Change an answer of the nearest point as `HeightMap` has it: see `Effect.change`."""
    params, count = numbers.params, hip.shape[0]
    frame, slope = numbers.state[: 3 + count], numbers.state[3 + count]
    depth = -closest.function(closest.data, hip, frame)
    height = relief(params, numbers.samples, frame, slope)
    bilateral, stiffness = params[BILATERAL] != 0.0, params[STIFFNESS]
    if not bilateral and depth + height <= 0.0:
        for i in range(count):
            ihip[i], force[i] = hip[i], 0.0
        return 0
    in_contact, foot_error_squared = bilateral or depth > 0.0, 0.0
    for i in range(count):
        foot_error_squared += (ihip[i] - frame[FOOT, i]) ** 2
    if in_contact and math.sqrt(foot_error_squared) > NEAR * params[WAVE]:
        return 1
    if not spread(frame, depth, slope):
        return 2
    for i in range(count):
        renderer_force = force[i] if in_contact else stiffness * depth * frame[NORMAL, i]
        force[i] = renderer_force + stiffness * (height * frame[NORMAL, i] - (depth + height) * slope[i])
        ihip[i] = frame[FOOT, i] + height * frame[NORMAL, i]
    return 0


def turn_normal(
    numbers: Numbers,
    closest: Closest,
    hip: Array,
    velocity: Array,  # noqa: ARG001 - as every change
    dt: float,  # noqa: ARG001
    ihip: Array,
    force: Array,
) -> int:
    """Change an answer as `BumpMap` has it: see `Effect.change`."""
    count = hip.shape[0]
    frame, slope = numbers.state[: 3 + count], numbers.state[3 + count]
    closest.function(closest.data, ihip, frame)
    relief(numbers.params, numbers.samples, frame, slope)
    force_on_normal, slope_squared = 0.0, 0.0
    for i in range(count):
        force_on_normal += force[i] * frame[NORMAL, i]
        slope_squared += slope[i] * slope[i]
    length = math.sqrt(1.0 + slope_squared)
    for i in range(count):
        force[i] += force_on_normal * ((frame[NORMAL, i] - slope[i]) / length - frame[NORMAL, i])
    return 0
