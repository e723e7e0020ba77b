"""What begins with a contact: on time, with the impulse that it should have, and ringing as it should."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from hapticeval.effects.catalogue import CONTACT_IMPULSE, CONTACT_TRANSIENT, RECORDED_IMPULSE
from hapticeval.phenomena.check import Check, Runs, required
from hapticeval.phenomena.decisions import (
    CONFIDENCE_WIDTHS,
    FIT_SAMPLES,
    IMPULSE_CLOSE,
    IMPULSE_DECAYS,
    LAG_TICKS,
    LATE_START,
    SENSOR_NOISE,
    SINGLE_ROUNDINGS,
    TELLING_SHARE,
)
from hapticeval.phenomena.lag import between_ticks
from hapticeval.phenomena.observed import Observed
from hapticeval.phenomena.sampling import rounding as rounding_of
from hapticeval.phenomena.sampling import worst_of, worst_row
from hapticeval.phenomena.verdict import Finding, Metric, compared, undecided
from hapticeval.recordings.quantization import are_singles
from hapticeval.recordings.recording import DOUBLE, SINGLE, runs_of
from hapticeval.scene import Scene
from hapticeval.types import Array


class Vibration(NamedTuple):
    """A fitted sinusoid: decay (1/s), frequency (Hz), what is open of each, and the residual as a share of the peak."""

    decay: float
    decay_open: float
    frequency: float
    frequency_open: float
    residual: float


def fit(values: Array, dt: float, decay: float, frequency: float) -> Vibration | None:
    """Fit e^(-Bt)(a cos wt + b sin wt) to `values` (n,), taken every `dt` s; None for too few.

    By least squares, from Prony's estimate and from the given numbers: the better of both. What is open is the half
    width of the interval that holds the true number with 99 per cent, by the covariance s^2 (J'J)^-1.
    """
    from scipy.optimize import least_squares

    peak = float(np.max(np.abs(values), initial=0.0))
    if values.size < FIT_SAMPLES or peak == 0.0:
        return None
    time, scaled = dt * np.arange(values.size), values / peak

    def wave(parameters: Array) -> Array:
        """Return the model (n,), as a share of the peak, of a, b, B (1/s) and w (rad/s)."""
        a, b, rate, omega = parameters
        return np.asarray(np.exp(-rate * time) * (a * np.cos(omega * time) + b * np.sin(omega * time)))

    def off(parameters: Array) -> Array:
        """Return the residuals (n,), as shares of the peak, of parameters (4,)."""
        return wave(parameters) - scaled

    def solve(start: tuple[float, float]) -> Any:
        """Return the least squares fit that begins at a decay (1/s) and w (rad/s)."""
        # Amplitudes by linear least squares; the model is analytic, so that complex steps give its derivatives.
        columns = np.column_stack([wave(np.array([*amplitudes, *start])) for amplitudes in np.eye(2)])
        begin = np.array([*np.linalg.lstsq(columns, scaled, rcond=None)[0], *start])
        return least_squares(off, begin, jac="cs", x_scale="jac", xtol=1e-15, ftol=1e-15, gtol=1e-15)

    # Two starts, for a fit of a frequency has many local minima.
    starts = (prony(scaled, dt), (decay, 2.0 * math.pi * frequency))
    best = min((solve(start) for start in starts if start is not None), key=lambda solution: solution.cost)
    # s^2 = sum of squares / (n - 4); the cost is half of the sum
    residual = math.sqrt(2.0 * best.cost / (values.size - 4))
    steep = best.jac
    size = np.linalg.norm(steep, axis=0)
    if not np.all(size > 0.0):
        return None
    # Square roots of the diagonal of s^2 (J'J)^-1, with columns scaled to unit length.
    spread = max(residual, SENSOR_NOISE) * np.sqrt(np.diag(np.linalg.pinv((steep / size).T @ (steep / size)))) / size
    turn = 2.0 * math.pi
    return Vibration(
        float(best.x[2]),
        CONFIDENCE_WIDTHS * float(spread[2]),
        abs(float(best.x[3])) / turn,
        CONFIDENCE_WIDTHS * float(spread[3]) / turn,
        residual,
    )


def prony(values: Array, dt: float) -> tuple[float, float] | None:
    """Estimate decay (1/s) and w (rad/s) of `values` (n,), taken every `dt` s, without a start; None where none rings.

    Prony's method: least squares of x[k+2] = p x[k+1] + q x[k], whose root is e^((-B + i w) dt).
    """
    columns = np.column_stack([values[1:-1], values[:-2]])
    p, q = np.linalg.lstsq(columns, values[2:], rcond=None)[0]
    # Complex root of x^2 = p x + q; a real one does not ring.
    root = complex(0.5 * p, math.sqrt(max(-q - 0.25 * p * p, 0.0)))
    if root.imag == 0.0:
        return None
    # ln(root) / dt = -B + i w
    return -math.log(abs(root)) / dt, math.atan2(root.imag, root.real) / dt


TRANSIENT_EFFECTS = (CONTACT_IMPULSE, CONTACT_TRANSIENT, RECORDED_IMPULSE)
"""The kinds of effects that these checks are of."""


class StruckContact(NamedTuple):
    """One contact: its ticks [begin, end), and the force (n,), N, added along the normal in these ticks.

    - `across` (N s): the impulse that is added along the surface.
    - `speed` (m/s): that of the approach.
    - `expected` (N s): the impulse that the effect gives it in `needs` seconds.
    - `granted`: ticks that the force may begin after the contact.
    - `rounding` (n,), N: what number formats leave open of the added force.
    """

    begin: int
    end: int
    added: Array
    across: float
    speed: float
    expected: float
    needs: float
    granted: int
    rounding: Array

    @property
    def late(self) -> int | None:
        """Ticks until a force is added; None where none is."""
        starts = np.flatnonzero(np.abs(self.added) > self.rounding)
        return int(starts[0]) if starts.size else None


def impulse_of(effect: Any, scene: Scene, place: Array, normal: Array, speed: float) -> tuple[float, float]:
    """Return the impulse (N s) that a contact at `place` (N,) is given, and the seconds until it has it."""
    from hapticeval.devices.device import apparent_mass

    if effect.kind == CONTACT_IMPULSE:
        # (4.21) with J_n = n' J: (1 + c_r) v / (n' J M^-1 J' n)
        impulse = (1.0 + scene.restitution) * apparent_mass(scene.robot, place, normal) * speed
        effort, lasts = impulse, scene.sampling_time
    elif effect.kind == CONTACT_TRANSIENT:
        omega = 2.0 * math.pi * effect.frequency
        # Integral of L v e^(-B t) sin(w t) over all time: L v w / (B^2 + w^2)
        impulse = effect.amplitude * speed * omega / (effect.decay**2 + omega**2)
        effort, lasts = effect.amplitude * speed / effect.decay, IMPULSE_DECAYS / effect.decay
    else:
        # A recorded pulse: its samples times their step.
        impulse = math.fsum(effect.pulse) * effect.step
        effort, lasts = math.fsum(map(abs, effect.pulse)) * effect.step, (len(effect.pulse) + 1) * effect.step
    # A cap spreads the effort over as much longer.
    return impulse, lasts + (0.0 if math.isinf(effect.cap) else effort / effect.cap)


def find_contacts(base: Observed, plain: Observed, effect: Any) -> list[StruckContact]:
    """Return the contacts that begin with an approach, by a recording of the scene without the effect.

    A hand that is on the surface to single precision may be in contact or not: one that adds a force there begins it.
    """
    scene = base.scene
    dt, boundary = base.dt, base.boundary
    touches = plain.contact
    velocity = base.velocity
    added = base.force - plain.force
    # A recording in single precision is one in which every force is a single number.
    single = are_singles(base.force)
    largest = np.maximum(*(recording.force_size for recording in (base, plain)))
    # N, of the larger of both forces.
    rounding = base.rounding_floor(largest, scene.stiffness, share=SINGLE_ROUNDINGS * (SINGLE if single else DOUBLE))
    struck = []
    for touch, end in runs_of(touches):
        # A contact that is there at once does not begin.
        if touch == 0:
            continue
        grazes = boundary.signed_distance(base.hip[touch - 1 : touch])[0] <= rounding_of(scene)
        begin = touch - 1 if grazes and np.linalg.norm(added[touch - 1]) > rounding[touch - 1] else touch
        # A late renderer gives a force some ticks after its hand is inside: what the contact starts may be as late.
        late_force = plain.force_size[touch : min(touch + LAG_TICKS + LATE_START + 1, end)] > 0.0
        granted = LATE_START + int(np.argmax(late_force))
        rows = slice(begin, end)
        normal = boundary.closest_point(plain.ihip[begin : begin + 1]).normal[0]
        along = added[rows] @ normal
        # An impulse along the surface, N s, which the effect has none of.
        across = float(np.linalg.norm((added[rows] - along[:, np.newaxis] * normal).sum(axis=0))) * dt
        impulse = float(np.sum(along)) * dt
        # One that answers a tick late may know speed and place of that tick.
        answer_ticks = range(begin, min(begin + LATE_START + 1, end))
        speeds = [max(-float(velocity[tick] @ normal), 0.0) for tick in answer_ticks]
        totals = [
            (*impulse_of(effect, scene, base.hip[tick], normal, speed), speed)
            for tick, speed in zip(answer_ticks, speeds, strict=True)
        ]
        # The tick in which the answer fits best counts.
        expected, needs, speed = min(totals, key=lambda total: abs(total[0] - impulse))
        if speeds[0] > 0.0:
            struck.append(
                StruckContact(begin, end, along, across, speed, expected, needs + granted * dt, granted, rounding[rows])
            )
    return struck


def judge_each(
    judge: Callable[[Runs, Scene, Any, Observed], Finding], kinds: tuple[str, ...], runs: Runs, scene: Scene
) -> Finding:
    """Judge each effect of `kinds` that the scene calls for; return the worst finding."""
    without = required(runs.without)
    effects = [effect for effect in scene.effects if effect.kind in kinds]
    return max(
        (judge(runs, scene, effect, Observed(without(effect.kind), scene)) for effect in effects), key=_rank_of_finding
    )


def _rank_of_finding(finding: Finding) -> tuple[int, float]:
    order = ("not-applicable", "pass", "inconclusive", "fail", "error")
    # Of two of one outcome the smaller margin is worse.
    margin = finding.margin
    return order.index(finding.outcome), -margin if margin is not None else 0.0


NONE = "no contact begins: the hand does not come from free space, or never touches"


def judge_onset(runs: Runs, scene: Scene, effect: Any, plain: Observed) -> Finding:
    """Measure the ticks from the one in which a contact begins to the first force that is added."""
    base = runs.observed(scene)
    struck = find_contacts(base, plain, effect)
    if not struck:
        return undecided(NONE)
    # Without a force, and out of the surface by more than single precision.
    free = ~plain.contact & ~plain.force.any(axis=1)
    free &= plain.distance > plain.rounding
    stray = np.where(free, np.linalg.norm(base.force - plain.force, axis=1), 0.0)
    if stray.max() > base.force_floor:
        tick = int(np.argmax(stray > base.force_floor))
        ticks_away = min(max(contact.begin - tick, tick - contact.end + 1) for contact in struck)
        message = f"the {effect.kind} acts in free space: {stray[tick]:.3g} N at t = {base.time[tick]:.4g} s"
        metric = Metric("ticks from a contact to a force without one", float(ticks_away), "ticks")
        return compared(metric, 0.0, base.evidence_at(tick), passes="", fails=message)
    if all(contact.end - contact.begin <= contact.granted for contact in struck):
        return undecided("no contact lasts longer than what it starts may be late")
    late = [contact.end - contact.begin if contact.late is None else contact.late for contact in struck]
    worst = worst_row(np.array([ticks - contact.granted for ticks, contact in zip(late, struck, strict=True)]))
    begin = struck[worst].begin
    contact = f"the contact that begins at t = {base.time[begin]:.4g} s starts"
    return compared(
        TRANSIENT_ONSET.measured(late[worst]),
        float(struck[worst].granted),
        {**base.evidence_at(begin), "contacts": len(struck)},
        passes=f"{len(struck)} contacts start a {effect.kind} each, {late[worst]} ticks after they begin at the latest",
        fails=f"{contact} no {effect.kind}" if struck[worst].late is None else f"{contact} it {late[worst]} ticks late",
    )


def judge_impulse(runs: Runs, scene: Scene, effect: Any, plain: Observed) -> Finding:
    """Compare the impulse that is added in each contact with the effect's."""
    base, dt = runs.observed(scene), runs.base.dt
    all_contacts = find_contacts(base, plain, effect)
    if not all_contacts:
        return undecided(NONE)
    lasting = [
        contact
        for contact in all_contacts
        if (contact.end - contact.begin) * dt >= contact.needs * (1.0 - IMPULSE_CLOSE)
    ]
    if not lasting:
        longest = max(all_contacts, key=lambda contact: contact.end - contact.begin)
        return undecided(
            f"no contact lasts as long as the {effect.kind} needs: {longest.needs:.3g} s, and the longest is "
            f"{(longest.end - longest.begin) * dt:.3g} s"
        )
    impulses = np.array([float(np.sum(contact.added)) * dt for contact in lasting])
    expected, across = (
        np.array([contact.expected for contact in lasting]),
        np.array([contact.across for contact in lasting]),
    )
    # Off along the normal, or given along the surface: the larger counts, N s.
    deviation = np.maximum(np.abs(impulses - expected), across)
    allowed = np.array(
        [IMPULSE_CLOSE * abs(contact.expected) + float(np.sum(contact.rounding)) * dt for contact in lasting]
    )
    peak = max(float(np.max(np.abs(contact.added))) for contact in lasting)
    worst = worst_row(deviation - allowed)
    if allowed[worst] > TELLING_SHARE * abs(expected[worst]):
        return undecided("rounding may make a tenth of the impulse")
    contact = lasting[worst]
    evidence = {
        **base.evidence_at(contact.begin),
        "speed_m_s": contact.speed,
        "impulse_Ns": float(impulses[worst]),
        "expected_Ns": float(expected[worst]),
        "peak_N": peak,
        "contacts": len(lasting),
    }
    if peak > effect.cap * (1.0 + IMPULSE_CLOSE) + float(max(np.max(every.rounding) for every in lasting)):
        message = f"the {effect.kind} reaches {peak:.4g} N, and its cap is {effect.cap:.4g} N"
        metric = Metric("force that is added", peak, "N")
        return compared(metric, effect.cap, evidence, passes="", fails=message)
    times = impulses[worst] / expected[worst] if expected[worst] != 0.0 else math.nan
    return compared(
        TRANSIENT_IMPULSE.measured(deviation[worst]),
        float(allowed[worst]),
        evidence,
        passes=(
            f"a contact at {contact.speed:.4g} m/s is given {1e3 * impulses[worst]:.5g} mN s, as it should be, and "
            f"{peak:.4g} N at the most"
        ),
        fails=(
            f"the contact that begins at t = {base.time[contact.begin]:.4g} s at {contact.speed:.4g} m/s is given "
            f"{1e3 * impulses[worst]:.5g} mN s for {1e3 * expected[worst]:.5g} mN s, {times:.4g} times as much"
            + (f", and {1e3 * across[worst]:.3g} mN s along the surface" if across[worst] > allowed[worst] else "")
        ),
    )


def judge_vibration(runs: Runs, scene: Scene, effect: Any, plain: Observed) -> Finding:
    """Fit a decaying sinusoid to the force that the longest contact adds, and compare its frequency and decay."""
    base = runs.observed(scene)
    struck = find_contacts(base, plain, effect)
    if not struck:
        return undecided(NONE)
    if not math.isinf(effect.cap):
        peak = max(float(np.max(np.abs(contact.added))) for contact in struck)
        if peak >= effect.cap * (1.0 - IMPULSE_CLOSE):
            return undecided(f"the cap of {effect.cap:.4g} N holds the vibration back: it is no decaying sinusoid")
    longest = max(struck, key=lambda contact: contact.end - contact.begin)
    if longest.late is None:
        return undecided("no force is added that could ring")
    # From the first force on, of which a lag between ticks shows a part, as long as the vibration lasts: after that
    # there is only rounding.
    first = longest.late + between_ticks(*plain.lag)
    wave = longest.added[first:][: math.ceil(IMPULSE_DECAYS / effect.decay / base.dt)]
    fitted = fit(wave, base.dt, effect.decay, effect.frequency)
    if fitted is None:
        return undecided("the contact is too short for a decaying sinusoid to be fitted to it")
    shares = {
        "decay": (fitted.decay / effect.decay - 1.0, fitted.decay_open / effect.decay),
        "frequency": (fitted.frequency / effect.frequency - 1.0, fitted.frequency_open / effect.frequency),
    }
    evidence = {
        **base.evidence_at(longest.begin),
        "decay_1_s": fitted.decay,
        "decay_open_1_s": fitted.decay_open,
        "frequency_Hz": fitted.frequency,
        "frequency_open_Hz": fitted.frequency_open,
        "samples": int(wave.size),
        "residual_share": fitted.residual,
    }
    heard = (
        f"rings at {fitted.frequency:.5g} Hz (known to {fitted.frequency_open:.2g}) and decays at {fitted.decay:.5g} "
        f"(known to {fitted.decay_open:.2g}) 1/s"
    )
    if any(open_ > TELLING_SHARE for _, open_ in shares.values()):
        return undecided(f"{heard}: the fit leaves more than a tenth open", evidence=evidence)
    # Whichever of decay and frequency is farther off, in what is open of it.
    name, (deviation, open_) = worst_of(
        list(shares.items()), lambda named_share: abs(named_share[1][0]) / named_share[1][1]
    )
    return compared(
        Metric(f"{name} less the scene's, as a share of it", abs(deviation), ""),
        open_,
        evidence,
        passes=heard,
        fails=f"{heard}, where the scene has {effect.frequency:.5g} Hz and {effect.decay:.5g} 1/s",
    )


check_of_transient = partial(
    Check,
    channels=("hip", "ihip", "force"),
    reads_also=("velocity",),
    siblings={"without": "the same path in the scene without that effect"},
    needs={
        "without": undecided("the force without the effect is not known: the hand is not led along a path that we give")
    },
)
TRANSIENT_ONSET = check_of_transient(
    id="transient-onset",
    phenomenon="none of the six: what a contact starts, thesis 3.2.2 and 4.3.4",
    formula="first tick with a force added - first tick of contact <= 1, and none added in free space",
    citation="thesis 4.3.4",
    effects=TRANSIENT_EFFECTS,
    metric="ticks from the contact to the force that it adds",
    unit="ticks",
    judge=partial(judge_each, judge_onset, TRANSIENT_EFFECTS),
)
TRANSIENT_IMPULSE = check_of_transient(
    id="transient-impulse",
    phenomenon="none of the six: what a contact starts, thesis 3.2.2 and 4.3.4",
    formula=(
        "sum of F dt = (1 + c_r) v / (n' J M^-1 J' n), or L v w / (B^2 + w^2) over 21/B s, or that of the pulse; "
        "|F| <= cap"
    ),
    citation="thesis (4.21) with J_n = n' J, 4.3.4",
    effects=TRANSIENT_EFFECTS,
    metric="impulse less the effect's",
    unit="N s",
    judge=partial(judge_each, judge_impulse, TRANSIENT_EFFECTS),
)
TRANSIENT_VIBRATION = check_of_transient(
    id="transient-vibration",
    phenomenon="none of the six: how a struck surface rings, thesis 4.3.4",
    formula="F = L v e^(-Bt) sin(2 pi f t + p): B and f of the least squares fit, with 99 % confidence",
    citation="thesis 4.3.4",
    effects=(CONTACT_TRANSIENT,),
    metric="frequency or decay less the scene's, as a share of it",
    unit="",
    judge=partial(judge_each, judge_vibration, (CONTACT_TRANSIENT,)),
)
CHECKS = (TRANSIENT_ONSET, TRANSIENT_IMPULSE, TRANSIENT_VIBRATION)
"""The checks of this module."""
