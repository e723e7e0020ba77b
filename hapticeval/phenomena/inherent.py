"""Failures that follow from what a renderer declares, by a theorem of the thesis: shown with their reason, not gating.

A spring cannot turn momentum round at once, and a contact point that depends on the hand alone has to jump somewhere
inside a closed surface. A renderer that declares to be such is not stopped for it; one that declares nothing is.

What a corner breaks is another fault than what a face does: a theorem may ask for the `Region` where something happens.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from enum import StrEnum
from typing import Any, NamedTuple

import numpy as np

from hapticeval.phenomena.decisions import IMPULSE_ROUNDING, LAG_TICKS, TELLING_SHARE
from hapticeval.phenomena.observed import Observed
from hapticeval.phenomena.verdict import Finding, Outcome


class Region(StrEnum):
    """A class of places of the hand."""

    FREE = "free space"
    CONVEX = "convex corner"
    CONCAVE = "concave corner"
    MEDIAL = "medial axis"
    """Where the model's own nearest point jumps."""
    SURFACE = "surface"


def region_of(recording: Observed, tick: int) -> Region:
    """Return where the HIP is at a tick, by the model alone, whatever the renderer answers.

    As near as a contact point can be placed at all, three HIP steps and the standoff, counts as there; corners are
    those of a model in the plane. The nearest point jumps where it moves farther than that since the tick before.
    """
    boundary = recording.boundary
    # Nothing finer can be placed on the surface than a lag's way and the standoff.
    near = LAG_TICKS * recording.hip_step + recording.believed_standoff
    frame = boundary.closest_point(recording.hip[max(tick - 1, 0) : tick + 1])
    if frame.distance[-1] > near:
        return Region.FREE
    # The model's own nearest point jumps, be it from notch to notch: what a renderer does here is about two branches.
    if np.linalg.norm(frame.foot[-1] - frame.foot[0]) > near:
        return Region.MEDIAL
    for corner in boundary.corners:
        if np.linalg.norm(frame.foot[-1] - corner.position) <= near:
            return Region.CONVEX if corner.convex else Region.CONCAVE
    return Region.SURFACE


def nearest_jump(recording: Observed, tick: int) -> float:
    """Return how far the nearest point of the surface as it is rendered moves from the tick before to `tick`, m."""
    points = recording.nearest_as_rendered(slice(max(tick - 1, 0), tick + 1))
    return float(np.linalg.norm(points[-1] - points[0]))


Declared = Mapping[str, Any]
"""What a renderer declares, as the metadata of its recordings have it: see `Declaration.meta`."""

FED_FORWARD = ("pp-pd-c", "set-stabilisation")
"""Laws that give the force of the curvature, m kappa v^2, without an error of position."""


class Limit(NamedTuple):
    """What no renderer of a `declared` kind can do: the `checks` that fail for it, whether it `applies`, and why."""

    declared: str
    checks: frozenset[str]
    applies: Callable[[Declared, Finding], bool]
    because: str


def _strikes_as_a_spring(declared: Declared, finding: Finding) -> bool:
    """Return whether a spring takes the momentum: less at first than is asked for, in the end all of it.

    It takes more only where the depths make it so: as much as the declared spring, held at them, gives.
    """
    # Laws that feed the curvature's force forward press by a spring, too.
    if "spring" not in declared and declared.get("closed_form") not in FED_FORWARD:
        return False
    facts = finding.facts
    impulse, rigid_impulse = facts.impulse_in_window_Ns, facts.impulse_wanted_Ns
    if impulse is None or rigid_impulse is None:
        return False
    # A soft spring may not have stopped a tool yet that slides off its face.
    if facts.stopped_after_ms is None and not facts.pressed_until_left:
        return False
    return 0.0 <= impulse <= max(rigid_impulse, (1.0 + IMPULSE_ROUNDING) * (facts.spring_impulse_Ns or 0.0))


def _pulls_along_the_error(declared: Declared, _finding: Finding) -> bool:
    return declared.get("spring") == "error"


def _sinks_as_a_spring(declared: Declared, finding: Finding) -> bool:
    """Return whether the error is a spring's, m kappa v^2 / K with the least K declared, up to `TELLING_SHARE`."""
    if finding.metric is None or "spring" not in declared or declared.get("closed_form") in FED_FORWARD:
        return False
    # The theorem is about the spring that is declared: a force of another size is not that one's.
    if finding.facts.force_over_spring is not None:
        return False
    # Where the stiffness varies, the error is the softest spring's.
    softest = float(declared.get("stiffness_least", 1.0))
    return finding.metric.value <= 1.0 / softest + TELLING_SHARE


def _projects_across_the_medial_axis(declared: Declared, finding: Finding) -> bool:
    return declared.get("memory") == "none" and finding.facts.region == Region.MEDIAL


def _tunnels_without_memory(declared: Declared, finding: Finding) -> bool:
    """Return whether contact is lacking only where the hand is outside, having come through, or at the medial axis.

    No theorem excuses a contact that is let go: the nearest point exists wherever the hand is inside.
    """
    facts = finding.facts
    if declared.get("memory") != "none" or facts.fault != "tunnelled":
        return False
    # Through a plate that is thinner than three steps of the hand the nearest point hardly moves.
    return facts.deepest_m == 0.0 or facts.region == Region.MEDIAL


def _jumps_as_the_nearest_point(declared: Declared, finding: Finding) -> bool:
    """Return whether the IHIP jumps no farther than the model's nearest point does there, but for the check's bound."""
    jump, facts = finding.metric, finding.facts
    nearest = facts.nearest_jump_m
    if jump is None or finding.bound is None or nearest is None:
        return False
    # No theorem moves the point off the surface, nor makes it jump where the nearest point does not.
    if facts.off_surface_m is not None or facts.unexplained_jump_m is not None:
        return False
    return _projects_across_the_medial_axis(declared, finding) and jump.value <= nearest + finding.bound


def _rounds_corners(declared: Declared, finding: Finding) -> bool:
    return declared.get("surfaces") == "smooth" and finding.facts.region in (Region.CONVEX, Region.CONCAVE)


def _has_law(*schemes: str) -> Callable[[Declared, Finding], bool]:
    return lambda declared, _finding: declared.get("closed_form") in schemes


LIMITS = (
    Limit(
        "spring",
        frozenset({"impulsive-collision"}),
        _strikes_as_a_spring,
        "a spring's force begins at zero and grows with the depth, so it turns the momentum round in pi/2 sqrt(m / K) "
        "and not at once: thesis 3.2.2, (4.6)",
    ),
    Limit(
        "spring=Spring.ERROR",
        frozenset({"abrupt-switch"}),
        _pulls_along_the_error,
        "in a concave corner the proxy rests and the hand goes on: a spring between them turns with the hand, over the "
        "corner's turn times the depth, and not at once: thesis 3.2.2, (4.6)",
    ),
    Limit(
        "spring",
        frozenset({"centripetal-force"}),
        _sinks_as_a_spring,
        "a spring gives m kappa v^2 only at the depth m kappa v^2 / K: thesis 3.2.3, 6.3.3",
    ),
    Limit(
        "memoryless",
        frozenset({"continuous-contact"}),
        _jumps_as_the_nearest_point,
        "without memory the contact point depends on the hand alone, and the nearest one jumps across the medial "
        "axis by as much: thesis 3.2, 4.1.2",
    ),
    Limit(
        "memoryless",
        frozenset({"contact-kept"}),
        _tunnels_without_memory,
        "without memory a hand that has crossed the middle of a plate belongs to its other side: thesis 3.2, 4.1.2",
    ),
    Limit(
        "memoryless",
        frozenset({"broken-contact"}),
        _projects_across_the_medial_axis,
        "without memory the contact point depends on the hand alone, and the nearest one jumps across the medial axis: "
        "thesis 3.2, 4.1.2",
    ),
    Limit(
        "smooth_only",
        frozenset({"broken-contact", "abrupt-switch"}),
        _rounds_corners,
        "a map that is made for smooth surfaces turns a corner over a length: thesis 5.2, 6.2",
    ),
    Limit(
        "closed_form pp",
        frozenset({"constraint-stability"}),
        _has_law("pp"),
        "without a damper the law leaves an oscillation across the surface: thesis Table 6.1, (6.19)",
    ),
    Limit(
        "closed_form pp-pd",
        frozenset({"constraint-stability"}),
        _has_law("pp-pd"),
        "where nothing slows the tool it stays off by the error that gives the centripetal force: thesis (6.26)",
    ),
    Limit(
        "closed_form pp, pp-v, pp-d, pp-pd",
        frozenset({"output-invariance", "tangential-dynamics"}),
        _has_law("pp", "pp-v", "pp-d", "pp-pd"),
        "a force along the position error lets the tool off a curved surface, which then changes its speed: "
        "thesis Table 6.2",
    ),
    Limit(
        "closed_form pp, pp-v, pp-d, pp-pd, pp-pd-c",
        frozenset({"decoupling"}),
        _has_law("pp", "pp-v", "pp-d", "pp-pd", "pp-pd-c"),
        "the law leaves out the term 2 kappa n' s' that couples across and along: thesis Table 6.2, (7.38)",
    ),
)


def limits_of(check: str) -> dict[str, str]:
    """Return why failures of a check are inherent, by what a renderer declares for that; nothing where none are."""
    return {limit.declared: limit.because for limit in LIMITS if check in limit.checks}


def would_follow(check: str, finding: Finding) -> list[str]:
    """Return what a renderer has to declare for this very failure to be inherent, as `limits_of` names it."""
    return list(
        dict.fromkeys(
            limit.declared
            for limit in LIMITS
            if check in limit.checks and finding.facts.ended is None and limit.applies(_as_declared(limit), finding)
        )
    )


def _as_declared(limit: Limit) -> Declared:
    """Return what the recording of a renderer says that declares what a limit asks for."""
    name, _, value = limit.declared.partition(" ")
    return {
        "memoryless": {"memory": "none"},
        "smooth_only": {"surfaces": "smooth"},
        "closed_form": {"closed_form": value.split(", ")[0]},
    }.get(name, {"spring": "error"})


def declaration_words(declared: str) -> str:
    """Return the line of Python by which a renderer declares what a limit asks for, such as "spring"."""
    name, _, value = declared.replace("=", " ").partition(" ")
    if name == "spring":
        return "declares = Declaration(spring=Spring.ERROR)" + ("" if value else ", or Spring.NORMAL")
    if name == "closed_form":
        return f'declares = Declaration(closed_form="{value.split(", ")[0]}")'
    return f"declares = Declaration({name}=True)"


def reason_inherent(check: str, finding: Finding, declared: Declared) -> str:
    """Return why a failure follows from what the renderer declares, in a sentence; "" where it does not.

    A loop that ran away does not: no theorem makes it.
    """
    if finding.outcome is not Outcome.FAIL or finding.facts.ended is not None:
        return ""
    limits = (limit for limit in LIMITS if check in limit.checks and limit.applies(declared, finding))
    return next((limit.because for limit in limits), "")
