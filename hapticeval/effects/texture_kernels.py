"""Compiled stochastic textures: counter-based noise, interpolated line spectra, and the change of an answer by them."""

from __future__ import annotations

import math

from hapticeval.compiled import borrowing
from hapticeval.laws import NORMAL, ChangeData, Closest
from hapticeval.records import as_record, record_type
from hapticeval.types import Array

TEXTURE = record_type("mass", "rate", "seed", "poles", "zeros", "filters", "direction")
"""`params`: the mass (kg) that is shaken, the filters' rate (Hz), the noise's seed, the orders of both filters, the
number of filters in `samples`, and the direction, `ALONG` or one after it."""

ALONG, ACROSS, NORMALLY = 0.0, 1.0, 2.0

FILTER = record_type("speed", "press")
"""What a filter's row in `samples` begins with: the speed (m/s) and the force (N) that it belongs to."""

VARIANCE, GAIN, FIRST_FREQUENCY = range(2, 5)
"""Further columns of it, of which means are taken; the frequencies begin with the last."""

TRIANGLE = record_type(corners=3, shares=6, hull=3, scale=2)
"""A triangle's row: its filters, their shares, which sides are of the hull, and the scale of the plane (m/s, N)."""

PHASE, VIBRATION, SMOOTHED = record_type("samples", "number"), record_type("triangle", "value"), FILTER
"""Records in rows of `state`: phase, and number of the next noise; triangle and vibration (m/s^2); speed and force as
low-passed, the speed negative before a contact."""

PHASE_ROW, VIBRATION_ROW, SMOOTHED_ROW, DIRECTION_ROW, BEFORE = range(2, 7)
"""Rows of `state` behind the frame: those three, the direction of the vibration, and from the last on what was:
vibrations in column 0, excitations in column 1, and behind them the scratch of `filter_past`."""

HALF_WORD = 0xFFFF
WORD = 0xFFFFFFFF
MULTIPLIER, WEYL, PHILOX_ROUNDS = 0xD256D193, 0x9E3779B9, 10
"""Of philox2x32-10: the masks of half a word and of a word, its multiplier, what the key grows by, and its rounds."""

LONGEST_WORK = 36
"""Rows of scratch: more than the largest order and two."""

CUTOFF = 20.0
"""Frequency (Hz) above which speed and force do not change the filter, as in the published toolkit's programs. A filter
that jumps with each reading of an encoder may run away, though each of those that it jumps between is stable."""

INSIDE = -1e-12
"""Least share of a corner at a point inside of a triangle: rounding."""

ON_TIME = 1e-6
"""Samples by which a tick may be early."""


@borrowing
def philox(low: int, high: int, key: int) -> tuple[int, int]:
    """Return two random 32-bit words of a counter of two words and a key: philox2x32-10 of Salmon et al. (2011)."""
    for _ in range(PHILOX_ROUNDS):
        # 32 by 32 bits into 64, by halves: no product overflows a signed integer of 64 bits
        product_low, product_high = MULTIPLIER * (low & HALF_WORD), MULTIPLIER * (low >> 16)
        product = (((product_high & HALF_WORD) << 16) + product_low) & WORD
        low, high = ((product_high + (product_low >> 16)) >> 16) ^ key ^ high, product
        key = (key + WEYL) & WORD
    return low, high


@borrowing
def normal_noise(number: int, seed: int) -> float:
    """Return the `number`-th sample of white noise with variance 1: Box and Muller's of two uniform words."""
    one, two = philox(number & WORD, number >> 32, seed)
    return math.sqrt(-2.0 * math.log((one + 0.5) / 4294967296.0)) * math.cos(2.0 * math.pi * (two / 4294967296.0))


@borrowing
def filters_at(rows: Array, count: int, speed: float, force: float, guess: int) -> tuple[int, float, float, float]:
    """Return which filters are mixed at a speed (m/s) and force (N): a triangle of them, and its corners' shares.

    `rows` (n, k) are the `count` filters and then the triangles of `Texture.rows`; the search begins at the
    triangle `guess`. Outside of all triangles the nearest point of their hull stands for the speed and force.
    """
    triangles = rows.shape[0] - count
    for step in range(triangles):
        k = (guess + step) % triangles
        shares = as_record(rows, TRIANGLE, count + k).shares
        # barycentric shares, linear in speed and force
        one = shares[0] + shares[1] * speed + shares[2] * force
        two = shares[3] + shares[4] * speed + shares[5] * force
        three = 1.0 - one - two
        if one >= INSIDE and two >= INSIDE and three >= INSIDE:
            return k, one, two, three
    # outside: the nearest point of all sides of the hull, in speeds and forces as shares of the largest
    nearest_squared, nearest_triangle, nearest_side, nearest_share = math.inf, 0, 0, 0.0
    for k in range(triangles):
        triangle = as_record(rows, TRIANGLE, count + k)
        speed_scale, force_scale = triangle.scale[0], triangle.scale[1]
        for i in range(3):
            if triangle.hull[i] == 0.0:
                continue
            # side i is across from corner i, from filter a to filter b
            a = as_record(rows, FILTER, int(triangle.corners[(i + 1) % 3]))
            b = as_record(rows, FILTER, int(triangle.corners[(i + 2) % 3]))
            x, y = speed / speed_scale, force / force_scale
            ax, ay = a.speed / speed_scale, a.press / force_scale
            bx, by = b.speed / speed_scale - ax, b.press / force_scale - ay
            along = min(max(((x - ax) * bx + (y - ay) * by) / (bx * bx + by * by), 0.0), 1.0)
            distance_squared = (x - ax - along * bx) ** 2 + (y - ay - along * by) ** 2
            if distance_squared < nearest_squared:
                nearest_squared, nearest_triangle, nearest_side, nearest_share = distance_squared, k, i, along
    # the shares of that point: zero for the corner across, `nearest_share` for the side's second end
    first = 1.0 - nearest_share if nearest_side == 2 else (nearest_share if nearest_side == 1 else 0.0)
    second = 1.0 - nearest_share if nearest_side == 0 else (nearest_share if nearest_side == 2 else 0.0)
    return nearest_triangle, first, second, 1.0 - first - second


@borrowing
def mean_of_corners(
    rows: Array, count: int, location: tuple[int, float, float, float], column: int
) -> float:  # fmt: skip
    """Return the mean of a column of filters over a triangle's corners, by their shares, in the column's unit.

    `rows` (n, k) and `location` are what `filters_at` takes and gives; `count` is that of the filters. Units are the
    columns', such as m/s, N or rad.
    """
    row = count + location[0]
    total = 0.0
    for i in range(3):
        share = location[1] if i == 0 else (location[2] if i == 1 else location[3])
        total += share * rows[int(rows[row, i]), column]
    return total


@borrowing
def filter_past(
    rows: Array, count: int, location: tuple[int, float, float, float], first: int, order: int, work: Array, column: int
) -> float:  # fmt: skip
    """Return what a filter takes from its past, a_1 x_1 + ... + a_p x_p, m/s^2, at the mean of three filters.

    Its line spectral frequencies (rad) begin in column `first` of `rows` (n, k); p is `order`. x_1, ... are in a
    `column` of `work` (n, N); in its last rows the sums S and D of `line_spectra` are formed. Ascending frequencies
    make a stable filter, and so does their mean.
    """
    if order == 0:
        return 0.0
    scratch_row = work.shape[0] - LONGEST_WORK
    for part in range(2):  # S of the first, third, ... frequency, then D of the others: `coefficients_of`
        work[scratch_row, part] = 1.0
        degree = 0
        for k in range(part, order, 2):
            middle_coefficient = -2.0 * math.cos(mean_of_corners(rows, count, location, first + k))
            work[scratch_row + degree + 1, part], work[scratch_row + degree + 2, part] = 0.0, 0.0
            degree += 2
            # times 1 - 2 cos(w) z^-1 + z^-2, in place: from the highest power on
            for i in range(degree, 0, -1):
                before_last = work[scratch_row + i - 2, part] if i > 1 else 0.0
                work[scratch_row + i, part] += middle_coefficient * work[scratch_row + i - 1, part] + before_last
        # the zeros at z = 1 or -1 that S and D have beside the frequencies
        if order % 2 == 0:
            sign = 1.0 if part == 0 else -1.0
            work[scratch_row + degree + 1, part] = 0.0
            degree += 1
            for i in range(degree, 0, -1):
                work[scratch_row + i, part] += sign * work[scratch_row + i - 1, part]
        elif part == 1:
            work[scratch_row + degree + 1, part], work[scratch_row + degree + 2, part] = 0.0, 0.0
            degree += 2
            for i in range(degree, 1, -1):
                work[scratch_row + i, part] -= work[scratch_row + i - 2, part]
    total = 0.0
    for i in range(1, order + 1):  # a_i = (S_i + D_i) / 2
        total += 0.5 * (work[scratch_row + i, 0] + work[scratch_row + i, 1]) * work[i - 1, column]
    return total


@borrowing
def next_vibration(
    params: Array, rows: Array, location: tuple[int, float, float, float], number: int, work: Array
) -> float:
    """Return the next vibration, m/s^2, y = gain (w + b_1 w_1 + ...) - a_1 y_1 - ..., of white noise w.

    `params` (7,) and `rows` (n, k) are the texture's, `location` that of `filters_at`, and `number` counts the noise.
    `work` (n, N) holds the past y in column 0 and w in column 1, and is moved on by one.
    """
    texture = as_record(params, TEXTURE)
    poles, zeros, count = int(texture.poles), int(texture.zeros), int(texture.filters)
    excitation = math.sqrt(max(mean_of_corners(rows, count, location, VARIANCE), 0.0)) * normal_noise(
        number, int(texture.seed)
    )
    value = excitation + filter_past(rows, count, location, FIRST_FREQUENCY + poles, zeros, work, 1)
    value = mean_of_corners(rows, count, location, GAIN) * value - filter_past(
        rows, count, location, FIRST_FREQUENCY, poles, work, 0
    )
    for i in range(work.shape[0] - LONGEST_WORK - 1, 0, -1):
        work[i, 0], work[i, 1] = work[i - 1, 0], work[i - 1, 1]
    work[0, 0], work[0, 1] = value, excitation
    return value


def vibrate(
    data: ChangeData, closest: Closest, hip: Array, velocity: Array, dt: float, ihip: Array, force: Array
) -> int:
    """Shake the hand with the texture's vibrations times the mass, as `StochasticTexture` has it.

    The signature is that of `Effect.change`: `hip` and `ihip` (N,), m, `velocity` (N,), m/s, `force` (N,), N; what
    `data` holds stands above. Returns 0: it is defined everywhere.
    """
    rows, state, count, texture = data.samples, data.state, hip.shape[0], as_record(data.params, TEXTURE)
    frame, normal, work, direction = state[:2], state[NORMAL], state[BEFORE:], state[DIRECTION_ROW]
    phase, vibration = as_record(state, PHASE, PHASE_ROW), as_record(state, VIBRATION, VIBRATION_ROW)
    smoothed = as_record(state, SMOOTHED, SMOOTHED_ROW)
    normal_force = 0.0
    for i in range(count):
        normal_force += abs(force[i])
    if normal_force > 0.0:
        closest.function(closest.data, ihip, frame)
        normal_force, velocity_on_normal = 0.0, 0.0
        for i in range(count):
            normal_force += force[i] * normal[i]
            velocity_on_normal += velocity[i] * normal[i]
    if normal_force <= 0.0:  # what rings is gone by the next contact
        for i in range(work.shape[0]):
            work[i, 0], work[i, 1] = 0.0, 0.0
        vibration.value, smoothed.speed = 0.0, -1.0
        return 0
    speed_squared = 0.0
    for i in range(count):
        speed_squared += (velocity[i] - velocity_on_normal * normal[i]) ** 2
    speed = math.sqrt(speed_squared)  # along the surface, m/s
    if texture.direction == NORMALLY:
        for i in range(count):
            direction[i] = normal[i]
    elif speed > 0.0:  # a hand that rests keeps the direction that it had
        for i in range(count):
            direction[i] = (velocity[i] - velocity_on_normal * normal[i]) / speed
        if texture.direction == ACROSS:
            # direction x normal: in the surface, at right angles to the motion
            x, y, z = direction[0], direction[1], direction[2]
            direction[0] = y * normal[2] - z * normal[1]
            direction[1] = z * normal[0] - x * normal[2]
            direction[2] = x * normal[1] - y * normal[0]
    # in samples of the texture: a tick may be shorter than one, and then holds the last
    phase.samples += dt * texture.rate
    # a first-order low-pass at CUTOFF, which a contact begins at its own values
    smoothing = 1.0 if smoothed.speed < 0.0 else -math.expm1(-2.0 * math.pi * CUTOFF / texture.rate)
    while phase.samples >= 1.0 - ON_TIME:
        smoothed.speed += smoothing * (speed - smoothed.speed)
        smoothed.press += smoothing * (normal_force - smoothed.press)
        location = filters_at(rows, int(texture.filters), smoothed.speed, smoothed.press, int(vibration.triangle))
        vibration.triangle = location[0]
        vibration.value = next_vibration(data.params, rows, location, int(phase.number), work)
        phase.samples -= 1.0
        phase.number += 1.0
    push = texture.mass * vibration.value
    if texture.direction == NORMALLY:
        push = max(push, -normal_force)  # a surface does not pull
    for i in range(count):
        force[i] += push * direction[i]
    return 0
