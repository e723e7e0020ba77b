"""Which cause explains what is off: the simplest whose residual is left to chance; else none of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from hapticeval.diagnosis.causes import EXPLAINERS, FEWEST_LOGGED, Cause, Deviation
from hapticeval.diagnosis.contact import RightContact
from hapticeval.diagnosis.fits import power, rounding_variance, white_noise
from hapticeval.diagnosis.placement import placement_causes, tool_causes
from hapticeval.geometry.boundary import Boundary
from hapticeval.types import Array

EXPLAINED = 0.95
"""Share of the residual's power, less the noise's, that a cause explains: nine tenths and a half; *chosen*."""

MOSTLY = 0.5
"""Share of what is off that is random where two runs differ by it: one run tells its size to a factor; *chosen*."""

EXPLAINED_EXACTLY = 1.0 - 1e-6
"""Share of a simulated force's deviation that its cause explains: what explains less may only look like it."""

EXACT = 1e-6
"""Share of the force that single precision may leave of a right one: the floor of a channel without noise."""

SAMPLES = 300.0
"""Independent rows that a noise-free run counts for: there the ratio of residuals says it all; *chosen*."""

LOGGED_SAMPLES = 500.0
"""The same of a log, at most: edges and encoders make 2 % of its noise uncertain, which is as many rows' worth."""

CLEARLY_LESS = 10.0
"""Causes nearer than this by the Bayesian information criterion are not told apart: odds of e^5, 150 to one."""

RIGHT_LOG, ALL_BUT_NOISE = 1.3, 1.15
"""Times the noise's power that a right log may have, and that a cause may leave; *chosen*."""

SMALLEST_EFFECT = 3e-3
"""Share of the force's rms: a smaller effect in a log may be its encoders'; *chosen*."""

LARGEST_FITTED = 1e50
"""N or m: larger numbers are no force and no place, and products of them may be beyond all numbers; *chosen*."""

FEWEST_TOUCHING = 5
"""Rows in contact below which nothing is fitted."""

MISSING_FOR_A_REASON = ("early release", "dead band")
"""Causes for which a force is missing: where they explain enough, they are named in its place."""

NEXT_TO_NO_FORCE = 0.01
"""Gain below which a force is missing, within what noise leaves of it; *chosen*."""

SECOND_EFFECT = 0.01
"""Share of the force by which a wider cause has to be better than a part of it in a log; *chosen*, as what encoders
leave of the force of a hand that is pressed."""

TELLS_APART = (
    ({"gain", "unit", "limit", "offset", "power of the depth"}, "a press that deepens slowly would tell"),
    ({"lag", "low-pass", "hold", "normal damping"}, "strokes that reverse would tell"),
    ({"drag", "friction", "damping"}, "slides at two speeds and two depths would tell"),
    ({"gain at times", "gain where"}, "the same way twice, from both sides, would tell"),
    (
        {"crosstalk", "rotation", "axes", "gain of an axis", "gain per axis"},
        "contact with faces of other directions would tell",
    ),
    ({"bias", "constant", "offset"}, "a second in free space would tell"),
    ({"dead band", "early release"}, "a slow press would tell"),
)
"""Causes that some paths do not tell apart, and the path that would."""


@dataclass(frozen=True)
class Diagnosis:
    """Why a contact is off: its `cause`, None where nothing is off or nothing explains it, and what it is like.

    `off` says that there is something to explain; `share` of its power is explained. `alike` are causes that explain
    it as well. `of` is what is off: "force", "contact point", or "both".
    """

    off: bool
    of: str = ""
    cause: Cause | None = None
    share: float = 0.0
    alike: Sequence[Cause] = field(default=())

    @property
    def kind(self) -> str:
        """The cause's kind; "none" where nothing is off, "unexplained" where no cause explains it."""
        return "none" if not self.off else "unexplained" if self.cause is None else self.cause.kind

    @property
    def sentence(self) -> str:
        """What is off, in words."""
        if not self.off:
            return "nothing is off"
        if self.cause is None:
            return "no known cause explains it"
        return self.cause.sentence

    @property
    def remedy(self) -> str:
        """What it is not told from on this path, and the path that would tell; empty where it is told."""
        if self.cause is None or not self.alike:
            return ""
        kinds = {self.cause.kind, *(cause.kind for cause in self.alike)}
        for group, path in TELLS_APART:
            if sum(any(kind.startswith(name) for name in group) for kind in kinds) > 1:
                return f"not told from {self.alike[0].kind}: {path}"
        return f"not told from {self.alike[0].kind}"


def diagnose(
    contact: RightContact,
    force: Array,
    ihip: Array | None = None,
    *,
    noisy: bool = False,
    tolerance: float = 0.0,
    again: Callable[[], Array] | None = None,
    boundary: Boundary | None = None,
) -> Diagnosis:
    """Say why a force (n, N), N, or contact points `ihip` (n, N), m, are not those of the `contact`.

    `noisy` is a measured log. `tolerance` (m) is how far the surface may lie off the model. `again` gives the force
    (k, N), N, of another new renderer on the same path; it is called where nothing else explains this one. With the
    `boundary`, positions in another unit or frame are tried of a log.
    """
    right_force = contact.force
    given = (force, right_force) if ihip is None else (force, right_force, ihip)
    if max(np.abs(channel).max(initial=0.0) for channel in given) > LARGEST_FITTED:
        return Diagnosis(True, "force")
    scale = max(power(right_force), 1e-30)
    too_few = np.count_nonzero(contact.touches) < FEWEST_TOUCHING
    # Of one row not even the sampling time is known.
    if len(force) == 1 or (too_few and not (noisy and boundary is not None)):
        return Diagnosis(False)
    counted = contact.told if noisy else np.ones(len(force), dtype=bool)
    count = int(np.count_nonzero(counted))
    noise = white_noise(force - right_force) if noisy else np.zeros(force.shape[1])
    noise_power = float(np.sum(noise**2)) * count
    encoder_power = 0.0
    if noisy:
        hand_rounding = contact.stiffness**2 * rounding_variance(contact.hip)
        noise_power = max(noise_power, (rounding_variance(force) + hand_rounding) * count)
        # A filter of the hand's noise saves that much by chance.
        hand_noise = contact.stiffness**2 * float(np.sum(white_noise(contact.hip) ** 2))
        encoder_power = max(hand_noise, hand_rounding) * count
    floor = EXACT**2 * scale + encoder_power + (contact.stiffness * tolerance) ** 2 * count
    total = power((force - right_force)[counted])
    force_is_right = not noisy and total <= 4.0 * floor
    tool = None if ihip is None else _diagnose_tool(contact, ihip, tolerance)
    # The force is right in spite of the contact point, or that of a spring to it.
    follows = ihip is not None and power(force - _spring_to(ihip, contact)) <= 4.0 * floor
    if tool is not None and (force_is_right or follows):
        return tool
    if force_is_right:
        return Diagnosis(False)
    deviation = Deviation(force, contact, noisy, counted, float(np.linalg.norm(noise)))
    causes = [] if too_few else [cause for explain in EXPLAINERS for cause in explain(deviation)]
    # A log may have the hand elsewhere. Asked where nothing else leaves its noise alone: it takes longer.
    if (
        boundary is not None
        and noisy
        and min([cause.left for cause in causes], default=total) > ALL_BUT_NOISE * noise_power
    ):
        causes += placement_causes(contact, force, boundary)
    if not causes:  # nothing touches, and nothing but noise is felt
        return Diagnosis(False)
    diagnosis = _diagnose_force(deviation, causes, total, scale, floor, noise_power, encoder_power)
    if diagnosis.off and diagnosis.cause is None and again is not None:
        diagnosis = _random(force, again(), total, scale) or diagnosis
    if tool is not None and diagnosis.off:
        return replace(diagnosis, of="both")
    return diagnosis


def _random(force: Array, other_force: Array, total: float, scale: float) -> Diagnosis | None:
    """Return that what is off, `total` (N^2), is random, as the force of another run shows; None where it does not.

    Two forces that are off by chance, and by as much, are apart by twice the power of that.
    """
    if other_force.shape != force.shape:
        return None
    scattered = 0.5 * power(force - other_force)
    if scattered < MOSTLY * total:
        return None
    share = float(np.sqrt(scattered / scale))
    words = f"it is random: two new renderers differ by {100.0 * share:.2g} % of the force"
    cause = Cause("random", words, max(total - scattered, 0.0), 0.0, {"share": share})
    return Diagnosis(True, "force", cause, min(scattered / total, 1.0))


def _spring_to(ihip: Array, contact: RightContact) -> Array:
    """Return the spring's force to contact points of one's own, with the damper of the right contact, (n, N), N."""
    spring = contact.stiffness * (ihip - contact.hip)
    damper = contact.force - contact.stiffness * (contact.point - contact.hip)
    return np.asarray(spring + np.where(np.any(ihip != contact.hip, axis=1)[:, None], damper, 0.0))


def _diagnose_tool(contact: RightContact, ihip: Array, tolerance: float) -> Diagnosis | None:
    """Say why contact points are off; None where they are right."""
    total = power(ihip - contact.point)
    centred = power(contact.point - contact.point.mean(axis=0))
    floor = EXACT**2 * centred + (1e-12**2 + tolerance**2) * len(ihip)
    if total <= 4.0 * floor:
        return None
    causes = list(tool_causes(ihip, contact))
    ranked = _rank(causes, total, floor, SAMPLES)
    return _choose(ranked, total, 0.0, "contact point", SAMPLES, floor)


def _diagnose_force(
    deviation: Deviation,
    causes: Sequence[Cause],
    total: float,
    scale: float,
    floor: float,
    noise_power: float,
    encoder_power: float,
) -> Diagnosis:
    """Say which of `causes` a force is off by: `total` (N^2) of it is not what is asked, and `noise_power` is white."""
    if total == 0.0:
        return Diagnosis(False)
    samples = SAMPLES
    if deviation.noisy:
        best = min(causes, key=lambda cause: cause.left * (1.0 + 0.01 * cause.cost))
        # What is left above the white noise is a model's error, which stays over many rows: it counts for fewer.
        samples = float(np.clip(LOGGED_SAMPLES / max(best.left / max(noise_power, 1e-300), 1.0), 50.0, LOGGED_SAMPLES))
    ranked = _rank(causes, total, floor, samples, noisy=deviation.noisy)
    best = ranked[0]
    if deviation.noisy:
        # A part of it that leaves hardly more is the cause: beside a gain of 9.81 a small damper is the encoders'.
        enough = best.left + SECOND_EFFECT**2 * power(deviation.force)
        if best.left < ALL_BUT_NOISE * noise_power:
            enough = best.left
        parts = [cause for cause in ranked[1:] if cause.left < enough and _contains(best.kind, cause.kind)]
        if parts:
            best = min(parts, key=lambda cause: cause.cost)
            ranked = [best, *(cause for cause in ranked if cause is not best)]
        count = int(np.count_nonzero(deviation.counted))
        beyond_chance = count * np.log(total / max(best.left, 1e-300)) > 20.0 + best.cost * np.log(count)
        effect = np.sqrt(max(total - best.left - encoder_power, 0.0) / scale)
        rest_is_noise = best.left < ALL_BUT_NOISE * noise_power
        if total < RIGHT_LOG * noise_power and not (beyond_chance and effect > SMALLEST_EFFECT and rest_is_noise):
            return Diagnosis(False)
    chosen = _choose(ranked, total, noise_power, "force", samples, floor, noisy=deviation.noisy)
    if deviation.noisy and chosen.cause is None:
        # What no cause explains, and is in a few rows alone, is an edge that the log passes some ticks late.
        off = (deviation.force - deviation.right_force)[deviation.counted]
        residual = np.sort(np.sum(off**2, axis=1))
        few = int(FEWEST_LOGGED * np.count_nonzero(deviation.contact.touches))
        if float(residual[: len(residual) - few].sum()) < RIGHT_LOG * noise_power + floor:
            return Diagnosis(False)
    return chosen


def _criterion(cause: Cause, total: float, floor: float, samples: float, noisy: bool) -> float:
    """Return the Bayesian information criterion of a cause, by how much it is better than none: less is better."""
    price = cause.cost * np.log(samples) * (1.0 if noisy else 2.0)
    return float(samples * np.log(max(cause.left + floor, 1e-300) / max(total + floor, 1e-300)) + price)


def _rank(causes: Sequence[Cause], total: float, floor: float, samples: float, *, noisy: bool = False) -> list[Cause]:
    return sorted(causes, key=lambda cause: _criterion(cause, total, floor, samples, noisy))


def _choose(
    ranked: Sequence[Cause],
    total: float,
    noise_power: float,
    of: str,
    samples: float,
    floor: float,
    *,
    noisy: bool = False,
) -> Diagnosis:
    """Return the first cause where it explains enough, with those that explain as much."""
    if not ranked:
        return Diagnosis(True, of)
    best, beyond_noise = ranked[0], max(total - noise_power, 1e-300)

    def share(cause: Cause) -> float:
        return 1.0 - max(cause.left - noise_power, 0.0) / beyond_noise

    def explains(cause: Cause) -> bool:
        return share(cause) > EXPLAINED or (noisy and cause.left < ALL_BUT_NOISE * noise_power and share(cause) > 0.5)

    if not explains(best):
        return Diagnosis(True, of, share=share(best))
    if _is_missing(best):  # with a reason it says more
        best = next((cause for cause in ranked if cause.kind in MISSING_FOR_A_REASON and explains(cause)), best)
    level = _criterion(best, total, floor, samples, noisy) + CLEARLY_LESS
    near = [
        cause for cause in ranked[1:9] if _criterion(cause, total, floor, samples, noisy) < level and explains(cause)
    ]
    rivals: dict[str, Cause] = {}
    for cause in near:
        if cause.kind != best.kind and not _contains(cause.kind, best.kind):
            rivals.setdefault(cause.kind, cause)
    return Diagnosis(True, of, best, share(best), tuple(rivals.values()))


def _is_missing(cause: Cause) -> bool:
    """Return whether a cause says only that the force is missing, somewhere or on the way out."""
    gain = cause.numbers.get("inside")
    return cause.kind == "missing force" or (
        cause.kind == "gain at speeds into the model" and gain is not None and abs(gain) < NEXT_TO_NO_FORCE
    )


def _contains(kind: str, best: str) -> bool:
    """Return whether the causes of a kind have the `best` one as a special case: then it is not a rival."""
    if best in ("unit", "sign", "gain"):
        wider = {"gain", "gain per axis", "crosstalk", "power of the depth"}
        return kind in wider or kind.startswith(("gain ", "gain +")) or (best == "sign" and kind == "rotation")
    if best in ("axes", "gain of an axis", "rotation", "gain per axis"):
        return kind in ("crosstalk", "gain per axis")
    return " + " in kind and best in kind.split(" + ")
