"""Compiled height and bump maps: heights and slopes over a foot point, and the changes of an answer by them.

The changes are plain Python, which is compiled for the scenes that call for them; what they call is compiled already.
"""

from __future__ import annotations

import math

from hapticeval.compiled import borrowing
from hapticeval.laws import FOOT, NORMAL, SHAPE, ChangeData, Closest
from hapticeval.records import as_record, record_type
from hapticeval.types import Array

RELIEF = record_type("stiffness", "bilateral", "wave", "amplitude", unit=3)
"""`params`: K (N/m), whether the surface holds from both sides, wavelength and amplitude of a sine (m), and the unit
direction of waves in space."""

NEAR = 0.1
"""Share of the wavelength by which an IHIP may be off the nearest point: a tenth of a turn of the phase."""

FLAT = 1e-9
"""Least determinant of I - d W: at the medial axis it is zero."""


@borrowing
def height_and_slope(params: Array, cells: Array, frame: Array, slope: Array) -> float:
    """Return the relief's height over a surface point, and write its gradient along the surface, which has no unit.

    `params` are as named above; `cells` (k, 4) are the cubics of a profile over one wavelength, m, empty for a sine;
    `frame` (3 + N, N) is that of the point's closest point, see `CLOSEST`; the gradient goes to `slope` (N,). The
    height is in m.
    """
    count, relief, foot, normal = slope.shape[0], as_record(params, RELIEF), frame[FOOT], frame[NORMAL]
    wave, unit, amplitude = relief.wave, relief.unit, relief.amplitude
    unit_on_normal = 0.0
    # where the point lies along the waves, m: by arc length in the plane, in space by its coordinate along the unit
    if count == 2:
        coordinate = frame[SHAPE + 2, 0]
    else:
        coordinate = 0.0
        for i in range(count):
            coordinate += unit[i] * foot[i]
            unit_on_normal += unit[i] * normal[i]
    # the height h, m, and dh / d(coordinate): a sine, or a cubic of the periodic spline
    if cells.shape[0] == 0:
        angle = 2.0 * math.pi * (coordinate / wave)
        height, rise_rate = (
            amplitude * math.sin(angle),
            amplitude * 2.0 * math.pi / wave * math.cos(angle),
        )
    else:
        turns = coordinate / wave
        x = (turns - math.floor(turns)) * cells.shape[0]  # cells into this wavelength
        k = min(int(x), cells.shape[0] - 1)  # rounding may put x on the end
        x -= k
        height = ((cells[k, 0] * x + cells[k, 1]) * x + cells[k, 2]) * x + cells[k, 3]
        rise_rate = ((3.0 * cells[k, 0] * x + 2.0 * cells[k, 1]) * x + cells[k, 2]) * cells.shape[0] / wave
    # grad h along the surface: times the tangent (-n_y, n_x), or times the unit's part along the surface
    if count == 2:
        slope[0], slope[1] = -rise_rate * normal[1], rise_rate * normal[0]
    else:
        for i in range(count):
            slope[i] = rise_rate * (unit[i] - unit_on_normal * normal[i])
    return float(height)


@borrowing
def gradient_at_depth(frame: Array, depth: float, slope: Array) -> bool:
    """Turn a gradient on the surface into the one that a hand below it moves along: (I - depth W)^-1 times it.

    `slope` (N,) is replaced; `frame` (3 + N, N) holds the shape operator W (1/m) of the surface from row `SHAPE` on,
    and `depth` is in m. Returns False at or beyond the medial axis, where I - depth W has no inverse.
    """
    w = frame[SHAPE:]
    if slope.shape[0] == 2:
        # the trace of W is the curvature kappa, as the normal has no curvature: divide by 1 - depth kappa
        stretch = 1.0 - depth * (w[0, 0] + w[1, 1])
        if stretch <= FLAT:
            return False
        slope[0] /= stretch
        slope[1] /= stretch
        return True
    # [[a, b, c], [b, e, f], [c, f, i]] = I - depth W; p, q, r are the first row of its adjugate
    a, b, c = 1.0 - depth * w[0, 0], -depth * w[0, 1], -depth * w[0, 2]
    e, f, i = 1.0 - depth * w[1, 1], -depth * w[1, 2], 1.0 - depth * w[2, 2]
    p, q, r = e * i - f * f, c * f - b * i, b * f - c * e
    determinant = a * p + b * q + c * r
    if determinant <= FLAT:
        return False
    # the adjugate, which is symmetric, over the determinant
    x, y, z = slope[0], slope[1], slope[2]
    slope[0] = (p * x + q * y + r * z) / determinant
    slope[1] = (q * x + (a * i - c * c) * y + (b * c - a * f) * z) / determinant
    slope[2] = (r * x + (b * c - a * f) * y + (a * e - b * b) * z) / determinant
    return True


def raise_surface(
    data: ChangeData, closest: Closest, hip: Array, velocity: Array, dt: float, ihip: Array, force: Array  # noqa: ARG001
) -> int:  # fmt: skip
    """Change an answer of the nearest point to that of the raised surface, as `HeightMap` has it.

    The signature is that of `Effect.change`: `hip` and `ihip` (N,), m, `force` (N,), N. Returns 1 where the IHIP is not
    the nearest point, 2 at the medial axis, and else 0.
    """
    relief, count = as_record(data.params, RELIEF), hip.shape[0]
    frame, slope = data.state[: 3 + count], data.state[3 + count]
    foot, normal = frame[FOOT], frame[NORMAL]
    depth = -closest.function(closest.data, hip, frame)
    height = height_and_slope(data.params, data.samples, frame, slope)
    bilateral, stiffness = relief.bilateral != 0.0, relief.stiffness
    if not bilateral and depth + height <= 0.0:  # the hand is above the relief: free space
        for i in range(count):
            ihip[i], force[i] = hip[i], 0.0
        return 0
    in_contact, foot_error_squared = bilateral or depth > 0.0, 0.0
    for i in range(count):
        foot_error_squared += (ihip[i] - foot[i]) ** 2
    # between the bare surface and the relief the renderer has no contact, and its IHIP is the HIP
    if in_contact and math.sqrt(foot_error_squared) > NEAR * relief.wave:
        return 1
    if not gradient_at_depth(frame, depth, slope):
        return 2
    for i in range(count):
        # F = K (d + h) (n - (I - d W)^-1 grad h), of which K d n is the renderer's where it has contact
        renderer_force = force[i] if in_contact else stiffness * depth * normal[i]
        force[i] = renderer_force + stiffness * (height * normal[i] - (depth + height) * slope[i])
        ihip[i] = foot[i] + height * normal[i]
    return 0


def turn_normal(
    data: ChangeData, closest: Closest, hip: Array, velocity: Array, dt: float, ihip: Array, force: Array  # noqa: ARG001
) -> int:  # fmt: skip
    """Turn the force's part along the normal by the relief's slope, as `BumpMap` has it (4.16).

    The signature is that of `Effect.change`: `ihip` (N,), m, `force` (N,), N. Returns 0: it is defined everywhere.
    """
    count = hip.shape[0]
    frame, slope = data.state[: 3 + count], data.state[3 + count]
    normal = frame[NORMAL]
    closest.function(closest.data, ihip, frame)
    height_and_slope(data.params, data.samples, frame, slope)
    force_on_normal, slope_squared = 0.0, 0.0
    for i in range(count):
        force_on_normal += force[i] * normal[i]
        slope_squared += slope[i] * slope[i]
    length = math.sqrt(1.0 + slope_squared)  # of n - grad h, whose parts are at right angles
    for i in range(count):
        # (4.16) renormalised: from n to n' = (n - grad h) / |n - grad h|
        force[i] += force_on_normal * ((normal[i] - slope[i]) / length - normal[i])
    return 0
