"""The causes that a force or a contact point may be off by, each with what it leaves unexplained and a sentence."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import combinations, permutations, product
from typing import Any

import numpy as np
from scipy.ndimage import binary_dilation

from hapticeval.diagnosis.contact import RightContact, dot_rows, stretches_of, unit_rows
from hapticeval.diagnosis.fits import (
    delayed,
    fit_curve,
    fit_delay,
    fit_delay_within,
    fit_hold,
    fit_interval,
    fit_level,
    fit_low_pass,
    low_passed,
    power,
    search,
)
from hapticeval.quantity import format_number
from hapticeval.types import Array, BoolArray

MISTAKEN_UNITS: Mapping[str, float] = {
    "mN for N, or mm for m": 1e3,
    "N for mN, or m for mm": 1e-3,
    "N for kgf": 9.80665,
    "kgf for N": 1.0 / 9.80665,
    "gf for N": 1e3 / 9.80665,
    "N for lbf": 4.4482216,
    "lbf for N": 1.0 / 4.4482216,
    "kg for lb": 0.45359237,
    "lb for kg": 1.0 / 0.45359237,
    "mm for inch": 25.4,
    "inch for mm": 1.0 / 25.4,
    "cm for m": 1e2,
    "m for cm": 1e-2,
}
"""What a number is multiplied by where one unit is taken for another."""

SPIKE_SHARE, SPIKE_TICKS = 0.05, 3
"""Share of the contact up to which ticks are off one by one, and ticks of a kick; *chosen*."""

LEAST_BEND = 0.01
"""An exponent of the depth that is nearer to one than this is a spring's; *chosen*."""

LEAST_OFFSET = 1e-9
"""m: a surface that is off by less is where it should be: rounding of positions of a metre; *chosen*."""

MOST_DELAY = 0.3
"""s: the longest delay that is looked for; a hand takes as long to react; *chosen*."""

LEAST_DELAY, LEAST_LOGGED_DELAY = 0.02, 1.5
"""ticks: less is a force that is in time; *chosen*. In a log the hand's own velocity is half a tick late, and a damper
that is off looks like a tick."""

LEAST_GAIN = 0.01
"""A gain that is nearer to one is none in a log, beside another cause; *chosen*: as an effect that is as small."""

FEWEST_LOGGED = 0.01
"""Share of the rows in contact that an edge may take from a log, which passes it some ticks late; *chosen*."""

SMALLEST_SHARE = 1e-3
"""Share of the largest force below which a row tells nothing of a gain."""


@dataclass(frozen=True)
class Cause:
    """One explanation: its `kind`, a `sentence` with numbers and units, and how well it explains.

    `left` is the sum of squares that it leaves unexplained (N^2, or m^2 of a contact point), `cost` what it counts for
    beside others: its parameters, and more for one that chooses its own rows.
    """

    kind: str
    sentence: str
    left: float
    cost: float
    numbers: Mapping[str, Any]


@dataclass(frozen=True, eq=False)
class Deviation:
    """A force (n, N), N, that is not the one that its contact asks for; `noisy` where it was measured.

    `counted` (n,) are the rows in which it is compared: not those of a log in which the contact leaps.
    """

    force: Array
    contact: RightContact
    noisy: bool
    counted: BoolArray
    noise: float = 0.0

    @property
    def right_force(self) -> Array:
        """The force that the contact asks for, (n, N), N."""
        return self.contact.force

    def is_one(self, gain: float) -> bool:
        """Whether a gain is none, in a log."""
        return self.noisy and abs(gain - 1.0) < LEAST_GAIN

    def left_by(self, force: Array) -> float:
        """Return the sum of squares that another force (n, N), N, leaves."""
        return power((self.force - force)[self.counted])


def text(value: float) -> str:
    """Return a number as sentences give it."""
    return format_number(value, 3)


def vector(values: Array) -> str:
    """Return a vector (N,) as sentences give it."""
    return f"({', '.join(text(float(value)) for value in values)})"


def late(ticks: float, step: float) -> str:
    """Return words for a delay of so many ticks of `step` s."""
    return f"{text(1e3 * abs(ticks) * step)} ms {'late' if ticks > 0 else 'early'} ({text(abs(ticks))} ticks)"


def gain_words(gain: float) -> str:
    """Return words for a force that is `gain` times what is asked."""
    if gain < 0.0:
        return f"the force pulls, {text(-gain)} times as hard as it should push"
    return f"the force is {text(gain)} times what is asked"


def units(deviation: Deviation) -> Iterator[Cause]:
    """Yield a force that is reversed, and one in a unit that is taken for another."""
    yield Cause(
        "sign",
        "the force is reversed: it pulls where it should push",
        deviation.left_by(-deviation.right_force),
        0.5,
        {},
    )
    force, right_force = deviation.force[deviation.counted], deviation.right_force[deviation.counted]
    common, own, total = float(np.sum(force * right_force)), power(right_force), power(force)
    for name, factor in MISTAKEN_UNITS.items():
        left = total - 2.0 * factor * common + factor**2 * own
        # The difference of large numbers is rounded: the best is worked out exactly.
        if left < 0.01 * total + 1e-300:
            left = deviation.left_by(factor * deviation.right_force)
        words = f"the unit is wrong ({name}): {text(factor)} times the force"
        yield Cause("unit", words, max(left, 0.0), 0.5, {"gain": factor})


def delays(deviation: Deviation) -> Iterator[Cause]:
    """Yield a force that comes late, alone and with a gain."""
    force, right_force, step = deviation.force, deviation.right_force, deviation.contact.step
    max_ticks = int(min(MOST_DELAY / step, len(force) // 3))
    for free_gain in (False, True):
        fit = fit_delay(force, right_force, max_ticks=max_ticks, early=deviation.noisy, free_gain=free_gain)
        if abs(fit.ticks) <= (LEAST_LOGGED_DELAY if deviation.noisy else LEAST_DELAY):
            continue
        words, numbers = f"the force comes {late(fit.ticks, step)}", {"ticks": fit.ticks, "seconds": fit.ticks * step}
        # A renderer that starts in contact has no past: what it answers then is its first answer, or nothing.
        model = delayed(right_force, fit.ticks)
        unseen = int(np.ceil(max(fit.ticks, 0.0)))
        left = deviation.left_by(fit.gain * model)
        if unseen < len(force) // 20 and not deviation.noisy:
            left = min(left, power((force - fit.gain * model)[unseen:]) + 1e-300)
        if not free_gain:
            yield Cause("lag", words, left, 1.0, numbers)
            touches = deviation.contact.touches
            ticks = fit_delay_within(force, right_force, touches, max_ticks=max_ticks)
            if ticks:  # late in contact alone: in free space it is what the hand is given now
                in_contact = deviation.left_by(np.where(touches[:, None], delayed(right_force, ticks), 0.0))
                contact_words = f"the force comes {late(ticks, step)} in contact"
                yield Cause("lag", contact_words, in_contact, 1.5, {"ticks": float(ticks), "seconds": ticks * step})
            # The delay and a constant force: the mean of what is left.
            bias = (force - model)[deviation.counted].mean(axis=0)
            left = deviation.left_by(model + bias)
            yield Cause("lag + bias", f"{words}, and {vector(bias)} N are added", left, 2.5 + len(bias), numbers)
        elif not deviation.is_one(fit.gain):
            yield Cause("lag + gain", f"{words}, and {gain_words(fit.gain)}", left, 2.5, numbers | {"gain": fit.gain})


def filters(deviation: Deviation) -> Iterator[Cause]:
    """Yield a force behind a first-order low-pass filter, alone, with a gain, and with a constant force."""
    force, right_force, step = deviation.force, deviation.right_force, deviation.contact.step
    for free_gain, biased in ((False, False), (True, False), (False, True)):
        fit = fit_low_pass(force, right_force, exact=not deviation.noisy, free_gain=free_gain, biased=biased)
        if fit.share >= 0.9999:
            continue
        left = fit.left
        if deviation.noisy:
            left = deviation.left_by(fit.gain * low_passed(right_force, fit.share) + fit.bias)
        constant = step * (1.0 - fit.share) / fit.share  # as a step of the implicit Euler method has it
        rate = text(0.5 / np.pi / constant)
        words = f"the force is low-passed, with a time constant of {text(1e3 * constant)} ms ({rate} Hz)"
        numbers: dict[str, Any] = {"seconds": constant}
        if biased:
            words += f", and {vector(fit.bias)} N are added"
            cost = 2.5 + len(fit.bias)
            yield Cause("low-pass + bias", words, left, cost, numbers | {"bias": fit.bias.tolist()})
        elif free_gain and not deviation.is_one(fit.gain):
            words += f", and {gain_words(fit.gain)}"
            yield Cause("low-pass + gain", words, left, 2.5, numbers | {"gain": fit.gain})
        elif not free_gain:
            yield Cause("low-pass", words, left, 1.0, numbers)


def filters_in_contact(deviation: Deviation) -> Iterator[Cause]:
    """Yield a force behind a first-order low-pass filter that begins at zero with each contact."""
    force, right_force, touches = deviation.force, deviation.right_force, deviation.contact.touches
    if deviation.noisy:
        return
    before = np.concatenate([np.zeros((1, force.shape[1])), force[:-1]])
    rows = np.flatnonzero(touches)
    driven = right_force[rows] - before[rows]
    share = float(np.clip(np.sum((force - before)[rows] * driven) / max(power(driven), 1e-300), 1e-4, 1.0))
    if share >= 0.9999:
        return
    model = np.zeros_like(force)
    for first, end in stretches_of(touches):
        model[first:end] = low_passed(right_force[first:end], share, np.zeros(force.shape[1]))
    constant = deviation.contact.step * (1.0 - share) / share
    rate = text(0.5 / np.pi / constant)
    words = f"the force is low-passed in contact, with a time constant of {text(1e3 * constant)} ms ({rate} Hz)"
    yield Cause("low-pass", words, deviation.left_by(model), 1.2, {"seconds": constant})


def holds(deviation: Deviation) -> Iterator[Cause]:
    """Yield a force that is renewed at a lower rate than the hand."""
    around = None
    if deviation.noisy:
        step = deviation.contact.step
        max_ticks = int(min(MOST_DELAY / step, len(deviation.force) // 3, 30))
        fit = fit_delay(deviation.force, deviation.right_force, max_ticks=max_ticks, early=True, free_gain=False)
        # Renewed every T ticks, it is (T - 1) / 2 ticks late on average.
        if fit.ticks < 0.5 * LEAST_LOGGED_DELAY:
            return
        around = round(2.0 * fit.ticks + 1.0)
    hold = fit_hold(deviation.force, deviation.right_force, around)
    if hold is not None:
        ticks, model = hold
        rate = text(1.0 / (ticks * deviation.contact.step))
        words = f"the force is renewed every {ticks} ticks alone ({rate} Hz)"
        yield Cause("hold", words, deviation.left_by(model), 1.0, {"ticks": ticks})


def sums(deviation: Deviation) -> Iterator[Cause]:
    """Yield what adds up: a gain, constant and growing forces, drag, friction, dampers; each of them, and pairs."""
    contact, force, right_force = deviation.contact, deviation.force, deviation.right_force
    dimension, on = force.shape[1], contact.touches[:, None]
    size = np.linalg.norm(right_force, axis=1, keepdims=True)
    seconds = contact.time - contact.time[0]
    # Under noise the direction of a slow slide is not known: 1 mm/s softens it.
    speed = np.sqrt(np.sum(contact.slide**2, axis=1, keepdims=True) + (1e-6 if deviation.noisy else 0.0))
    along = np.divide(contact.slide, speed, out=np.zeros_like(force), where=speed > 0.0)
    axes = np.eye(dimension)
    columns: dict[str, list[Array]] = {
        "gain": [right_force],
        "bias": [np.broadcast_to(axis, force.shape) for axis in axes],
        "drift": [np.outer(seconds, axis) for axis in axes],
        "drag": [-contact.slide],
        "friction": [-along * size],
        "damping": [-contact.velocity * on],
        "damping everywhere": [-contact.velocity],
        "normal damping": [-(contact.normal_speed * contact.touches)[:, None] * contact.normal],
        "gain with time": [right_force * seconds[:, None]],
        "gain with depth": [right_force * np.maximum(contact.depth, 0.0)[:, None]],
        "gain with place": [
            right_force * (contact.point - contact.point[0])[:, axis, None] for axis in range(dimension)
        ],
    }
    if not deviation.noisy:  # the steps of a log's contact points are its encoders'
        columns["coupling damping"] = [contact.point_velocity - contact.velocity]
    counted = deviation.counted
    basis = np.array([column[counted].ravel() for group in columns.values() for column in group])
    products, common = basis @ basis.T, basis @ (force - right_force)[counted].ravel()
    total = deviation.left_by(right_force)
    places, start = {}, 0
    for kind, group in columns.items():
        places[kind] = list(range(start, start + len(group)))
        start += len(group)

    def solve(rows: list[int]) -> tuple[Array, float]:
        square = products[np.ix_(rows, rows)]
        scale = np.sqrt(np.maximum(np.diag(square), 1e-300))
        numbers = np.linalg.lstsq(square / np.outer(scale, scale), common[rows] / scale, rcond=1e-12)[0] / scale
        return numbers, max(total - float(numbers @ (2.0 * common[rows] - square @ numbers)), 0.0)

    dampers = {"drag", "damping", "damping everywhere", "normal damping"}
    for kind, rows in places.items():
        numbers, left = solve(rows)
        yield Cause(kind, _sum_words(kind, numbers), left, float(len(rows)), {kind: numbers.tolist()})
    for one, other in combinations(places, 2):
        if {one, other} <= dampers:
            continue  # one spans the other
        rows = places[one] + places[other]
        numbers, left = solve(rows)
        split = len(places[one])
        words = f"{_sum_words(one, numbers[:split])}, and {_sum_words(other, numbers[split:])}"
        named = {one: numbers[:split].tolist(), other: numbers[split:].tolist()}
        yield Cause(f"{one} + {other}", words, left, len(rows) + 1.5, named)
    if contact.cornered.any():
        yield from _drag_into_a_notch(deviation)


def _sum_words(kind: str, numbers: Array) -> str:
    """Return the words of one summand."""
    if kind == "gain":
        return gain_words(1.0 + float(numbers[0]))
    if kind in ("bias", "drift"):
        return (
            f"a constant force is added: {vector(numbers)} N"
            if kind == "bias"
            else f"a force that grows is added: {vector(numbers)} N/s"
        )
    number = text(float(numbers[0]))
    return {
        "drag": f"it drags along the surface, by {number} N s/m",
        "friction": f"it has friction along the surface, {number} of the normal force",
        "damping": f"a damper of {number} N s/m acts on the whole velocity in contact",
        "damping everywhere": f"a damper of {number} N s/m acts in free space too",
        "normal damping": f"its damper along the normal is off by {number} N s/m",
        "coupling damping": f"a damper of {number} N s/m acts between tool and hand",
        "gain with time": f"it drifts: the stiffness grows by {number} of what is asked a second",
        "gain with depth": f"the stiffness grows by {text(1e-3 * float(numbers[0]))} of what is asked a mm of depth",
        "gain with place": f"the stiffness changes by {vector(1e-3 * numbers)} of what is asked a mm of way",
    }[kind]


def _drag_into_a_notch(deviation: Deviation) -> Iterator[Cause]:
    """Yield drag along the face on which the hand came into a corner, in which the contact's own normal turns."""
    contact = deviation.contact
    last = np.maximum.accumulate(np.where(contact.touches & ~contact.cornered, np.arange(len(contact.time)), 0))
    face = contact.normal[last]
    slide = (contact.velocity - dot_rows(contact.velocity, face)[:, None] * face) * contact.touches[:, None]
    damper = float(np.sum((deviation.right_force - deviation.force) * slide)) / max(power(slide), 1e-300)
    words = f"it drags along the surface, by {text(damper)} N s/m"
    yield Cause("drag", words, deviation.left_by(deviation.right_force - damper * slide), 1.2, {"drag": [damper]})


def signed_axes(dimension: int) -> list[Array]:
    """Return the matrices (N, N) that swap or mirror N axes; the first leaves them as they are."""
    return [
        np.diag(signs) @ np.eye(dimension)[list(order)]
        for order in permutations(range(dimension))
        for signs in product((1.0, -1.0), repeat=dimension)
    ]


def matrices(deviation: Deviation) -> Iterator[Cause]:
    """Yield other axes, other signs, a turned frame, a gain of each axis, and crosstalk: a matrix on what is asked."""
    force, right_force = deviation.force[deviation.counted], deviation.right_force[deviation.counted]
    dimension = force.shape[1]
    names = "xyz"
    common, own, total = force.T @ right_force, right_force.T @ right_force, power(force)

    def left_by(matrix: Array) -> float:
        """Return what a matrix (N, N) leaves, N^2, to about 1e-16 of the whole power."""
        return max(total - 2.0 * float(np.sum(matrix * common)) + float(np.sum((matrix @ own) * matrix)), 0.0)

    def exactly(matrix: Array) -> float:
        """Return what a matrix (N, N) leaves, N^2, row by row."""
        return power(force - right_force @ matrix.T)

    best = min((matrix for matrix in signed_axes(dimension) if abs(np.trace(matrix)) < dimension - 0.5), key=left_by)
    axes = [("-" if row.sum() < 0.0 else "") + names[int(np.argmax(np.abs(row)))] for row in best]
    words = f"its axes are swapped or mirrored: ({', '.join(names[:dimension])}) of the force are ({', '.join(axes)})"
    yield Cause("axes", words, exactly(best), 0.9, {"axes": axes})
    left_vectors, _, right_vectors = np.linalg.svd(common)
    handed = np.sign(np.linalg.det(left_vectors @ right_vectors)) or 1.0
    turn = left_vectors @ np.diag([1.0] * (dimension - 1) + [handed]) @ right_vectors
    angle = float(np.degrees(np.arccos(np.clip((np.trace(turn) - (dimension - 2)) / 2.0, -1.0, 1.0))))
    words = f"its frame is turned by {text(angle)} degrees"
    yield Cause("rotation", words, exactly(turn), 1.0 if dimension == 2 else 3.0, {"degrees": angle})
    is_pressed = np.diag(own) > 1e-9 * np.trace(own)
    gains = np.where(is_pressed, np.diag(common) / np.where(is_pressed, np.diag(own), 1.0), 1.0)
    words = f"the force along {', '.join(names[:dimension])} is {vector(gains)} times what is asked"
    yield Cause("gain per axis", words, exactly(np.diag(gains)), float(dimension), {"gains": gains.tolist()})
    for axis in np.flatnonzero(is_pressed):
        matrix = np.eye(dimension)
        matrix[axis, axis] = gains[axis]
        words = f"the force along {names[axis]} is {text(float(gains[axis]))} times what is asked"
        yield Cause("gain of an axis", words, exactly(matrix), 1.2, {"axis": names[axis], "gain": float(gains[axis])})
    for to, source in permutations(range(dimension), 2):
        if is_pressed[source]:
            share = float((force[:, to] - right_force[:, to]) @ right_force[:, source] / own[source, source])
            matrix = np.eye(dimension)
            matrix[to, source] = share
            words = f"crosstalk: {text(share)} of the force along {names[source]} acts along {names[to]} too"
            yield Cause(
                "crosstalk", words, exactly(matrix), 1.5, {"from": names[source], "to": names[to], "share": share}
            )
    # What the path does not show of a matrix stays as it should be.
    matrix = np.eye(dimension) + (common - own) @ np.linalg.pinv(own, rcond=1e-9)
    words = "its axes are mixed: crosstalk between several of them"
    yield Cause("crosstalk", words, exactly(matrix), float(dimension**2), {"matrix": matrix.tolist()})
    mean = force.mean(axis=0)
    words = f"the force is {vector(mean)} N, whatever the contact is"
    yield Cause("constant", words, power(force - mean), float(dimension), {})


def limits(deviation: Deviation) -> Iterator[Cause]:
    """Yield a force that stays below a level, and one that is silent up to one: as a whole, and axis by axis."""
    force, right_force = deviation.force[deviation.counted], deviation.right_force[deviation.counted]
    size = np.linalg.norm(right_force, axis=1)
    if not size.any():
        return

    def left_by(model: Array) -> float:
        """Return what forces (n, N), N, of a model leave, N^2."""
        return power(force - model)

    level = fit_level(dot_rows(force, unit_rows(right_force)), size)
    if level < 0.9999 * size.max():
        model = right_force * np.divide(level, size, out=np.ones_like(size), where=size > level)[:, None]
        yield Cause("limit", f"the force never exceeds {text(level)} N", left_by(model), 1.0, {"newtons": level})
    level = fit_level((force * np.sign(right_force)).ravel(), np.abs(right_force).ravel())
    if level < 0.9999 * np.abs(right_force).max():
        words = f"each component of the force is cut at {text(level)} N"
        yield Cause("limit of each axis", words, left_by(np.clip(right_force, -level, level)), 1.0, {"newtons": level})
    for kind, sizes in (("dead band", size[:, None]), ("dead band of each axis", np.abs(right_force))):
        # The level below which silence saves most: sorted by size, what it saves is a running sum.
        sizes_of_all = np.broadcast_to(sizes, right_force.shape).ravel()
        order = np.argsort(sizes_of_all)
        saved = np.concatenate([[0.0], np.cumsum((force**2 - (force - right_force) ** 2).ravel()[order])])
        silent = int(np.argmin(saved))
        if saved[silent] < 0.0 and 0 < silent < sizes_of_all.size:
            level = float(sizes_of_all[order][silent - 1])
            model = np.where(sizes <= level, 0.0, right_force)
            words = f"{kind}: no force where less than {text(level)} N are asked"
            yield Cause(kind, words, left_by(model), 1.1, {"newtons": level})


def depths(deviation: Deviation) -> Iterator[Cause]:
    """Yield a surface that is farther out or in than the model's, and a power of the depth in place of a spring."""
    contact, force = deviation.contact, deviation.force
    deep = contact.touches & (contact.depth > 1e-9) & deviation.counted
    if np.count_nonzero(deep) <= 10:
        return
    along = dot_rows(force, contact.normal)
    offset = float(np.median(along[deep] / contact.stiffness - contact.depth[deep]))
    for _ in range(8):
        on = (contact.depth + offset > 0.0) & deviation.counted
        if not on.any():
            break
        offset = float(np.mean(along[on] / contact.stiffness - contact.depth[on]))
    model = contact.stiffness * np.maximum(contact.depth + offset, 0.0)[:, None] * contact.normal
    place = f"{text(1e3 * abs(offset))} mm {'outside' if offset > 0 else 'inside'} the model"
    if abs(offset) > LEAST_OFFSET:
        yield Cause("offset", f"the force begins {place}", deviation.left_by(model), 1.0, {"metres": offset})
    middle = float(np.median(contact.depth[deep]))
    share = np.where(contact.touches, contact.depth / middle, 0.0)

    def powered(exponent: float) -> Array:
        shape = (share**exponent * contact.touches)[:, None] * contact.normal
        return shape * (float(np.sum(force * shape)) / max(power(shape), 1e-300))

    felt = deep & (along > 0.0)
    if deviation.noisy or np.count_nonzero(felt) < 10:
        exponent = search(lambda exponent: deviation.left_by(powered(exponent)), 0.3, 4.0, 9)
    else:
        # the slope of the logarithms; of one depth alone there is none
        logs = [values - values.mean() for values in (np.log(contact.depth[felt]), np.log(along[felt]))]
        exponent = float(np.clip(logs[0] @ logs[1] / max(float(logs[0] @ logs[0]), 1e-12), 0.0, 8.0))
    if abs(exponent - 1.0) < LEAST_BEND:
        return
    words = f"the force grows with the depth to the power {text(exponent)}"
    if exponent < LEAST_BEND:
        words = f"the force in contact is {text(float(np.median(along[felt])))} N at any depth"
    yield Cause("power of the depth", words, deviation.left_by(powered(exponent)), 2.0, {"exponent": exponent})


def gains_by(deviation: Deviation) -> Iterator[Cause]:
    """Yield a gain that differs where a depth, a speed, a place, a normal or the time is within an interval."""
    contact, force, right_force = deviation.contact, deviation.force, deviation.right_force
    size = np.linalg.norm(right_force, axis=1)
    rows = np.flatnonzero(contact.touches & deviation.counted & (size > SMALLEST_SHARE * size.max()))
    if rows.size <= 50:
        return
    common, own = dot_rows(force[rows], right_force[rows]), size[rows] ** 2
    names = "xyz"[: force.shape[1]]
    seconds = contact.time - contact.time[0]
    quantities = {
        "at depths": (contact.depth, "mm", 4.0),
        "at speeds into the model": (-contact.normal_speed, "mm/s", 4.0),
        "at speeds along the surface": (np.linalg.norm(contact.slide, axis=1), "mm/s", 4.0),
        **{f"where {name}, in mm, is": (contact.point[:, axis], "mm", 4.0) for axis, name in enumerate(names)},
        **{f"where the normal's {name} is": (contact.normal[:, axis], "", 4.0) for axis, name in enumerate(names)},
        "at times": (seconds, "s", 4.3),
        "where two faces hold the tool": (contact.cornered.astype(float), "", 2.0),
    }
    if contact.cornered.any():
        quantities["beside a notch"] = (contact.beside_corner, "", 2.5)
    for kind, (values_of_all, unit, cost) in quantities.items():
        values = values_of_all[rows]
        largest = max(float(np.abs(values).max()), 1e-12)
        if np.ptp(values) < 1e-9 * largest:
            continue
        # Values that differ by rounding alone are one.
        grain = 1e-7 * largest
        if unit:
            gains = fit_curve(values, common, own)
            model = right_force.copy()
            model[rows] *= gains[:, None]
            measures = {"mm": "depth", "mm/s": "speed", "s": "time"}
            what = f"place along {kind[6]}" if "where" in kind else measures[unit]
            ends = text(float(gains.min())), text(float(gains.max()))
            words = f"the stiffness varies with the {what}, from {ends[0]} to {ends[1]} of what is asked"
            if ends[0] != ends[1]:
                yield Cause(f"varies {kind}", words, deviation.left_by(model), 16.0, {"smallest": float(gains.min())})
        interval = fit_interval(np.round(values / grain) * grain, common, own)
        if interval is None:
            continue
        inner, outer = (
            float(common[side].sum() / max(own[side].sum(), 1e-300)) for side in (interval.inside, ~interval.inside)
        )
        # Two gains that read the same are one, and a few rows of a log are an edge's.
        share = float(interval.inside.mean())
        if text(inner) == text(outer) or (deviation.noisy and min(share, 1.0 - share) < FEWEST_LOGGED):
            continue
        model = right_force.copy()
        model[rows] *= np.where(interval.inside, inner, outer)[:, None]
        gained = gain_words(inner) if abs(inner) > 1e-9 else "the force is missing"
        words = f"{gained} {_interval_words(kind, interval.low, interval.high, unit)}"
        if abs(outer - 1.0) > 1e-3:
            words += f", and {text(outer)} times elsewhere"
        numbers = {"low": interval.low, "high": interval.high, "inside": inner, "outside": outer}
        yield Cause(f"gain {kind}", words, deviation.left_by(model), cost, numbers)


def _interval_words(kind: str, low: float, high: float, unit: str) -> str:
    if kind.endswith("tool"):
        return kind
    if kind == "beside a notch":
        return f"within {text(1e3 * high)} mm of where two faces hold the tool"
    if kind == "at speeds into the model" and low * high >= 0.0:
        return "on the way in" if high > 0.0 else "on the way out"
    scale = 1e3 if unit.startswith("mm") else 1.0
    return f"{kind} from {text(scale * low)} to {text(scale * high)} {'' if 'in mm' in kind else unit}".rstrip()


def beginnings_and_ends(deviation: Deviation) -> Iterator[Cause]:
    """Yield a force that outlasts the contact, one that is gone before it ends, and one that is missing within."""
    contact, force, right_force = deviation.contact, deviation.force, deviation.right_force
    size, felt = np.linalg.norm(right_force, axis=1), np.linalg.norm(force, axis=1)
    if not contact.touches.any():
        return
    silent_below = 4.0 * deviation.noise + 1e-9 * float(size.max())
    rows = np.arange(len(felt))
    since = rows - np.maximum.accumulate(np.where(contact.touches, rows, -len(rows)))
    after = ~contact.touches & (felt > silent_below) & deviation.counted
    if after.any() and (since[after] < len(rows)).all():
        model = right_force.copy()
        model[after] = force[after]
        seconds, largest = float(since[after].max()) * contact.step, float(felt[after].max())
        words = f"a force of up to {text(largest)} N outlasts the contact by {text(1e3 * seconds)} ms"
        yield Cause("residue", words, deviation.left_by(model), 3.0, {"seconds": seconds, "newtons": largest})
    leaving = np.flatnonzero(contact.touches & (contact.normal_speed > 0.0) & deviation.counted)
    if leaving.size:
        # The depth below which silence on the way out saves most.
        order = leaving[np.argsort(contact.depth[leaving])]
        saved = np.cumsum(
            dot_rows(force[order], force[order]) - dot_rows((force - right_force)[order], (force - right_force)[order])
        )
        last = int(np.argmin(saved))
        if saved[last] < 0.0:
            model = right_force.copy()
            model[order[: last + 1]] = 0.0
            depth = float(contact.depth[order[last]])
            words = f"the force lets go on the way out, {text(1e3 * depth)} mm below the surface"
            yield Cause("early release", words, deviation.left_by(model), 1.2, {"metres": depth})
    missing = contact.touches & (felt <= silent_below) & (size > silent_below) & deviation.counted
    fewest = FEWEST_LOGGED * np.count_nonzero(contact.touches) if deviation.noisy else 0.0
    if np.count_nonzero(missing) <= fewest:
        return
    stretches = 1 + int(np.count_nonzero(np.diff(missing.astype(int)) > 0))
    seconds = np.count_nonzero(missing) * contact.step
    words = f"the force is missing for {text(1e3 * seconds)} ms of the contact"
    model = np.where(missing[:, None], 0.0, right_force)
    yield Cause("missing force", words, deviation.left_by(model), 3.0 * stretches, {"seconds": float(seconds)})


def spikes(deviation: Deviation) -> Iterator[Cause]:
    """Yield a force that is right but for a few ticks: kicks where contact begins or ends, spikes, short stretches."""
    contact, step = deviation.contact, deviation.contact.step
    if deviation.noisy:
        return
    residual = np.linalg.norm(deviation.force - deviation.right_force, axis=1)
    off = residual > 1e-6 * max(float(residual.max()), float(np.linalg.norm(deviation.right_force, axis=1).max()))
    count = int(np.count_nonzero(off))
    if count == 0 or count > SPIKE_SHARE * int(np.count_nonzero(contact.touches)):
        return
    starts = np.flatnonzero(np.diff(off.astype(int), prepend=0) == 1)
    changes = np.diff(contact.touches.astype(int), prepend=int(contact.touches[0])) != 0
    near_change = binary_dilation(changes, np.ones(2 * SPIKE_TICKS + 1, dtype=np.bool_))
    size, worst = text(float(residual.max())), int(np.argmax(residual))
    silent = np.linalg.norm(deviation.force[off], axis=1).max() == 0.0
    what = "the force is missing" if silent else f"the force is off by up to {size} N"
    numbers = {"ticks": count, "stretches": len(starts), "newtons": float(residual.max())}
    cost = 3.5
    if near_change[off].all():
        cost = 3.0
        words, kind = f"a kick of up to {size} N where the contact begins or ends", "kick"
    else:
        gaps = np.diff(starts)
        even = gaps.size > 1 and np.ptp(gaps) <= 0.1 * gaps.mean()
        period = f", every {round(float(gaps.mean()))} ticks" if even else ""
        words = f"{what} in {count} ticks{period}, first at {text(float(contact.time[starts[0]]))} s"
        kind = "spikes"
        if len(starts) == 1 and count > SPIKE_TICKS:
            cost = 4.4  # a gain within an interval says more
            words = f"{what} for {text(1e3 * count * step)} ms from {text(float(contact.time[starts[0]]))} s"
    yield Cause(kind, words, float(np.sum(residual[~off] ** 2)), cost, numbers | {"worst": worst})


EXPLAINERS = (
    units,
    delays,
    filters,
    filters_in_contact,
    holds,
    sums,
    matrices,
    limits,
    depths,
    gains_by,
    beginnings_and_ends,
    spikes,
)
"""Each yields causes of its family for a force that is off."""
