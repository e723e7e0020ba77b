"""One table of renderers, right and wrong, that suites or users once met: what each fails where, and what it does not.

The kill matrix (`test_kill_matrix.py`) has those whose every verdict is known; here are verdicts that are asked alone.
"""

from __future__ import annotations

from functools import partial

import force_sizes
import honest
import jumping
import numpy as np
import pytest
from asked import Row, case_at, hold, rows
from broken import late_force, scaled, spoiled
from finger import Coarse, FingerProxy, Undeclared, Unswept
from flights import LEGS, LandsElsewhere, Leaps, UndeclaredBall, flying, grazing
from force_only import Afar, Aside, DeadBand, Dodging, Field, Interrupted, Kicking, Late, Mute, Pulling, Silent, Stiff
from force_sizes import faulty
from honest import Spring, declaring
from jumping import Bends, Rises, SteepAndBroken, led_by, single
from latecomers import (
    ChangingLatency,
    FromTheFace,
    LateByTurns,
    LateTool,
    OffTheSurface,
    Pushing,
    Reversed,
    late,
)
from latecomers import Silent as SilentlyOff
from lawbreakers import Stabilised, other_gains
from led_astray import (
    DAMPED,
    ForceOfBody,
    ForgetsPose,
    OfLastTick,
    Shifted,
    SubStepped,
    Swept,
    Turned,
    WorldsVelocity,
    late_in_body,
    of,
)
from misblamed import CORNERS, FLOOR, LATE, NEAR, OUTSIDE, RIGHT, THIN_PLATE, DropsForce, Haunts, Sticks
from misplaced import ASTRAY, Hop, HopsWhileSlow, SinksWhileSlow, single_hop, slowly
from msgspec.structs import replace
from mutants import Mutant, cushions
from overlooked import (
    OVERLOOKED,
    VARIES,
    Claiming,
    Raised,
    by_depth,
    by_place,
    endowed,
    jumps_to_a_third_face,
    pops_beside,
    promising,
    remembers,
    trembles,
    wanders,
)
from pieces import Chosen, GodObject, Hopping, Nearest, Unhurried
from places import ARC, BALL_OF_2_CM, FAST_AND_SLOW, GRAZING, SLIDING_OFF, TO_THE_CENTRE, beside_the_centre
from reporting import ALWAYS, NEVER, TRUE, Banded, Dropping, Rounded
from rubbing import CASES as FRICTION
from rubbing import Chatters, Grips, Rubbing, Thins
from unvisited import UNVISITED, Damped

from hapticeval.discovery import resolve
from hapticeval.phenomena.verdict import Outcome
from hapticeval.renderer import AtRest
from hapticeval.renderer import Spring as Along
from hapticeval.runner.judging import judge

FACETS, BALL = "solids/icosphere-1280", resolve("virtual-proxy")
FIELD = [
    Row(Field, FACETS),
    *rows([DeadBand, Late], [FACETS], passes="force-magnitude"),
    Row(Silent, FACETS, undecided="contact-kept"),
    *rows([Pulling, Aside], [FACETS], "contact-normal-force"),
    Row(Interrupted, FACETS, "force-magnitude", words="the force is missing for"),
    *rows([Stiff, Mute], [FACETS], "force-magnitude"),
    Row(Dodging, FACETS, "continuous-contact"),
    Row(Afar, FACETS, "contact-kept"),
]
"""Of those with a force and no contact point."""

SLIDES = [f"unilateral-surfaces/{case}" for case in ("torus-slide", "sphere-deep", "ellipsoid-deep", "torus-deep")]
PIECES = [
    *rows([GodObject], SLIDES, passes="continuous-contact"),
    Row(Unhurried, "unilateral-surfaces/sphere-deep", passes="continuous-contact"),
    *rows([Hopping, Chosen], ["unilateral-surfaces/sphere-deep"], "continuous-contact"),
    Row(Nearest, "unilateral-surfaces/torus-deep", "continuous-contact"),
]
"""What follows from the triangles that a renderer was given is not held against it, and all else is."""

FINGER = [
    Row(FingerProxy, "solids/cube-edge", passes="broken-contact"),
    Row(FingerProxy, "solids/cube-edge", passes="continuous-contact", words="0.1 mm of the declared standoff"),
    Row(Undeclared, "solids/cube-edge", "continuous-contact"),
    *rows([FingerProxy], ["solids/cube-vertex", "solids/wedge-30"], passes="broken-contact"),
    Row(FingerProxy, "solids/inner-corner", "abrupt-switch", "continuous-contact"),
    Row(FingerProxy, "solids/icosphere-chord", "continuous-contact", words="pop-through", metric=1.24e-3),
    # Over an arc of the margin round the notch, which 90 degrees of the force take.
    Row(FingerProxy, "solids/l-block-notch", "abrupt-switch", metric=0.5 * np.pi * 0.9),
    Row(FingerProxy, FACETS, "continuous-contact", evidence={"severity": "major"}),
    Row(Coarse, FACETS, "continuous-contact", words="mini", evidence={"severity": "mini"}),
    Row(FingerProxy, "solids/plate", passes="contact-kept"),
    Row(Unswept, "solids/plate", "contact-kept", evidence={"kind": "tunnelled"}),
    Row(FingerProxy, "solids/cube-impact", "impulsive-collision"),
    Row(FingerProxy, "unilateral-surfaces/sphere-pressed", "centripetal-force", "contact-kept"),
    Row(FingerProxy, "thesis/circle-slide", "centripetal-force"),
]
"""A finger proxy as haptic libraries have it gets the verdicts of physics, and its margin is no fault."""

REPORTING = [
    # A hand that is off its tool by rounding is in free space; a force is contact, whatever is denied.
    *rows(
        [Rounded, Banded, TRUE, NEVER],
        ["solids/cube-edge"],
        passes="contact-kept continuous-contact",
    ),
    Row(ALWAYS, "solids/cube-edge", "continuous-contact"),
    Row(Dropping, "solids/cube-edge", "contact-kept", evidence={"kind": "let go"}),
]
"""Who reports contact beside IHIP and force."""

FLIGHTS = [
    row
    for model in LEGS
    for row in (
        *rows(
            [resolve("constraint")], [flying(model, aslant) for aslant in (0.0, 5e-3, -5e-3)], "", "continuous-contact"
        ),
        *rows([Leaps, LandsElsewhere], [flying(model)], "continuous-contact", words="pop-through", metric=0.06),
        Row(resolve("minimum-distance"), flying(model), "continuous-contact", level="inherent"),
    )
]
FLIGHTS += [
    Row(BALL, grazing(), passes="broken-contact"),
    Row(UndeclaredBall, grazing(), "broken-contact"),
]
"""A tool that is let go at an edge flies to the next face: no pop-through, as a leap while it is pressed is one."""

COUPLED = resolve("coupled")
OF_THE_FIELD = [
    *rows([BALL], [f"solids/{case}" for case in ("cube-edge", "cube-vertex", "nut-rim")], passes="continuous-contact"),
    *rows([Claiming, Raised], ["solids/cube-edge"], "continuous-contact", words="pop-through"),
    Row(BALL, "solids/fine-ball", "continuous-contact", words="declares a standoff of 0.5 mm, of which 0.4 mm count"),
    Row(resolve("conformal+pc"), "thesis/cassinian-loops", passes="passivity", words="spent"),
    *rows([resolve("conformal"), endowed], ["thesis/cassinian-loops"], "passivity", words="^((?!spent).)*$"),
    # The hand's depth under the plate's upper face.
    Row(COUPLED, "solids/plate", "contact-kept", metric=0.01925, evidence={"kind": "tunnelled"}),
    *rows(
        [COUPLED],
        ["solids/cube-edge", "thesis/cassinian-shallow-slide", "thesis/star-convex-corner"],
        passes="contact-kept",
    ),
]
"""True renderers of other publications are not blamed for what they declare, and what they do wrong is named."""

LAGS = {
    "force-1": {"force": 1.0},
    "force-0.4": {"force": 0.4},
    "ihip-0.4": {"ihip": 0.4},
    "both-0.4": {"ihip": 0.4, "force": 0.4},
    "both-2.3": {"ihip": 2.3, "force": 2.3},
}
LATE_FRICTION = [
    *rows(
        {f"rubbing-{name}": late(Rubbing, **lag) for name, lag in LAGS.items()},
        [FRICTION["plane-to-and-fro"], FRICTION["circle-to-and-fro"]],
    ),
    *(
        row
        for kind, place, check in (
            (Grips, "circle-to-and-fro", "friction-cone"),
            (Chatters, "plane-to-and-fro", "friction-sliding"),
            (Thins, "viscous-plane", "friction-work"),
        )
        for row in rows([late(kind), late(kind, force=0.4)], [FRICTION[place]], check)
    ),
]
"""Friction may be late by one lag for the run, also between two ticks; one that is wrong besides is found."""

PRESSED = ["slide", "unilateral-surfaces/sphere-pressed", "unilateral-surfaces/torus-press", "solids/l-block-notch"]
LATECOMERS = [
    *rows(
        [late(kind=kind) for kind in (ChangingLatency, LateByTurns, Pushing)],
        ["slide"],
        "contact-normal-force",
        words=r"\([^)]*(?<![\d.])([4-9]|\d\d)[\d.]* degrees\) off every true normal",
    ),
    *rows([late(kind=LateTool, ihip=lag) for lag in (0.5, 1.0, 2.3)], PRESSED, passes="contact-normal-force"),
    Row(late(kind=LateTool, ihip=3.0), "slide", passes="force-magnitude reset-clears"),
    *rows([FingerProxy, FromTheFace], ["solids/corner-press"], passes="contact-normal-force"),
    Row(OffTheSurface, "press", passes="contact-normal-force"),
    Row(SilentlyOff, "press", "contact-normal-force"),
    Row(late(kind=Reversed), "slide", "contact-normal-force", words="it pulls where it should push"),
    # 10 mm under a face of the star's tip the hand leaves through the other face long before the corner.
    *rows(
        [late(resolve("constraint"), force=lag) for lag in (1.0, 3.0)],
        ["thesis/star-convex-corner"],
        passes="contact-kept",
    ),
    Row(late(resolve("constraint"), DropsForce), THIN_PLATE, "contact-kept", words="the force is dropped"),
    Row(late(resolve("minimum-distance"), Sticks), FLOOR, "contact-kept", words="the tool stays on the surface though"),
    Row(late(kind=Haunts), "slide", "contact-kept", words="^((?!no IHIP).)*$"),
    *rows([late(Field, force=lag) for lag in (0.0, 0.5, 1.0, 3.0)], ["thesis/cassinian-loops"], passes="passivity"),
]
"""Who is late by one number of ticks is not blamed; a latency that changes, or that does not show, hides nothing."""

WRONG = [
    row
    for name, wrong in OVERLOOKED.items()
    for row in rows({name: wrong.make}, wrong.places, wrong.check, words=wrong.words)
]
"""What suites once let pass."""

RIGHTLY = [
    *(row for name, right in RIGHT.items() for row in rows({name: right.make}, right.places)),
    *rows([resolve(name) for name in ("minimum-distance", "constraint", "ideal")], [OUTSIDE]),
    *rows([OVERLOOKED["pushes-from-afar"].make], [OUTSIDE], passes="contact-kept"),
    *rows([OVERLOOKED["pushes-from-afar"].make], [NEAR], "contact-kept"),
    *rows(LATE, CORNERS, "contact-kept", "continuous-contact", words="N in free space"),
    *rows([Damped], UNVISITED["velocity-left"].cases, passes="reset-clears"),
    *rows(
        {
            f"{fault.__name__}-{ticks}-late": promising(late_force(fault, ticks), **VARIES)
            for fault in (by_place, by_depth)
            for ticks in (0.0, 2.0, 2.6, 3.0)
        },
        ["field/press-and-leave", "solids/pebble"],
        passes="force-magnitude",
    ),
    # The package's own effect on the nearest point.
    *(
        Row(resolve("minimum-distance"), place, passes=unvisited.check)
        for unvisited in UNVISITED.values()
        for place in unvisited.cases
        if place.startswith("effects-")
    ),
]
"""What suites once blamed: a nearest point may jump across the medial axis, by a theorem, and no farther."""

EDGES = {"solids/box-off-origin", *UNVISITED["lingers"].cases}
RIGHTLY += [
    # The nearest point jumps at an edge (4.1.2), wherever that is, and in a loop too.
    Row(Spring, place, "continuous-contact broken-contact" if place in EDGES else "", "the rest")
    for place in sorted({place for unvisited in UNVISITED.values() for place in unvisited.cases})
    if not place.startswith("effects-")
]

# A tolerance in metres shows where a mesh is looked at smaller: triangles of 1 mm^2, and of 0.02 mm^2.
WRONG += [
    Row(
        UNVISITED["small-triangles"].make,
        BALL_OF_2_CM,
        "numerical-stability",
        "contact-kept",
        evidence={"motion": "a seventh as large"},
        level="should",
    )
]

VISITS = [
    row
    for name, unvisited in UNVISITED.items()
    for row in rows({name: unvisited.make}, unvisited.cases, unvisited.check)
]
"""Faults that show in one place only are stopped where a suite goes there."""


# Jumps, and what looks like one

CONTINUOUS = "continuous-contact"
STEEPEST = "^steep.* in a HIP step 4194304 times finer than the path's"
MEMORIES = {name: jumping.factory(name) for name in jumping.HONEST}
"""What comes late, eases or relaxes: it goes on while the hand rests already."""


def slope_of(exponent: float):
    return {"slope": pytest.approx(exponent, abs=0.02)}


def rising(*times: float):
    """What jumps by 10 mm, rounded over so many times 5e-8 m, to which single precision holds the coordinates."""
    return {f"rises-over-{number}": led_by(partial(Rises, 5e-8 * number)) for number in times}


JUMPS = [
    # By half a millimetre; those that depend on the rate by 10 mm.
    *(
        Row(jumping.factory(name), ARC, CONTINUOUS, words="pop-through", metric=0.5e-3, name=name)
        for name in ("switches", "switches-late", "switches-in-thirds", "sticks")
    ),
    Row(jumping.factory("switches", single), ARC, CONTINUOUS, metric=0.5e-3, name="switches-single"),
    *(
        Row(jumping.factory(name), ARC, CONTINUOUS, words="depends on the sampling rate", metric=0.01, name=name)
        for name in ("rate-pop", "fine-pop")
    ),
    *rows(MEMORIES, [ARC, FAST_AND_SLOW], passes=CONTINUOUS),
    # A Hoelder map is continuous from the exponent 1/6 on, and half a millimetre more on the far side of one is seen.
    Row(led_by(partial(Bends, 1 / 2)), ARC, passes=CONTINUOUS, words="steep", name="root"),
    Row(led_by(partial(Bends, 1 / 3), single), ARC, passes=CONTINUOUS, words="steep", name="cube-root"),
    Row(led_by(partial(Bends, 1 / 6), single), ARC, passes=CONTINUOUS, words="steep", name="6th-root"),
    Row(led_by(partial(Bends, 0.13)), ARC, "", "", CONTINUOUS, STEEPEST, evidence=slope_of(0.13), name="exponent-0.13"),
    Row(led_by(partial(Bends, 0.05)), ARC, "", "", CONTINUOUS, STEEPEST, evidence=slope_of(0.05), name="exponent-0.05"),
    Row(led_by(partial(SteepAndBroken, 0.5)), ARC, CONTINUOUS, metric=pytest.approx(0.5e-3, rel=0.1), name="both"),
    *rows(rising(0.1, 0.5), [ARC], CONTINUOUS, metric=pytest.approx(0.01, rel=0.1)),
    *rows(rising(3, 10, 30, 1000), [ARC], passes=CONTINUOUS),
    *(
        Row(resolve("conformal"), beside_the_centre(kind), passes=CONTINUOUS, words="steep")
        for kind in ("cassinian", "dumbbell")
    ),
    # A tool that catches up with three ticks of the hand moves as far as this one hops.
    Row(Spring, FAST_AND_SLOW, passes=CONTINUOUS),
    Row(led_by(partial(Hop, 0.2, 2e-3)), FAST_AND_SLOW, passes=CONTINUOUS, name="hops-within-the-lag"),
    # At the origin, the centre of a circle, nothing is looked at closer than elsewhere.
    Row(Spring, TO_THE_CENTRE, CONTINUOUS, times=1000.0),
    # Along the surface, without a jump, and on it.
    *rows(ASTRAY, ["slide"], CONTINUOUS, words="not under the hand"),
]
"""What jumps is found, whatever its memory, and what does not jump is not."""
SLOW_JUMPS = [
    # A closer look begins behind it.
    Row(single_hop, "thesis/ellipse-slide", CONTINUOUS, metric=pytest.approx(0.115e-3, rel=0.2), name="single-hop"),
    # What a slow hand shows is not measured by its fastest step, nor is it on the paths that are drawn.
    Row(slowly(HopsWhileSlow), FAST_AND_SLOW, CONTINUOUS, words="pop-through", name="hops"),
    Row(slowly(SinksWhileSlow), FAST_AND_SLOW, CONTINUOUS, words="mm off the surface", name="sinks"),
    Row(slowly(HopsWhileSlow), "generated/line-hand", CONTINUOUS, name="hops"),
]
"""The same, of those that take longer."""

# The size of a force

CONVEX, LOOPS, PRESS, IMPACT = (
    f"thesis/{name}" for name in ("star-convex-corner", "cassinian-loops", "plane-press", "plane-impact")
)
"""Of a default suite: the case that the README runs first, which begins in contact, and one with a way in."""
SIZE = "force-magnitude"
KICKS = {name: faulty(name) for name in ("kick", "triple-kick", "hard-kick")}
OFF = {name: faulty(name) for name in ("tenth", "half", "tenfold", "dead-band", "slow", "outage")}
VARYING = ("thesis/cassinian-loops", "thesis/ellipse-loops", "thesis/cassinian-deep-slide")
LOW_PASS = {
    "cause": "low-pass",
    "cause_numbers": {"seconds": pytest.approx(1e-3 / np.expm1(2.0 * np.pi * 0.01), rel=1e-2)},
}
NOT_LATE = "^((?!low-pass).)*$"
HALF_AS_MUCH_MORE = {"stiffness_range": (0.5, 1.5)}
ANYTHING = {"stiffness_range": (1.0 / 32.0, 32.0)}

SIZES = [
    # By a factor of two or more, from who declares nothing.
    *rows(OFF, [CONVEX], SIZE, times=1.0),
    *rows(KICKS, [LOOPS], SIZE, times=1.0),
    *rows(KICKS, ["slide"], SIZE, words="a kick of up to"),
    Row(faulty("by-place"), CONVEX, SIZE, level="should", name="by-place"),
    Row(spoiled(force_sizes.FAULTS["by-place"]), CONVEX, SIZE, name="by-place-declared"),
    *rows({name: faulty(name) for name in ("half", "dead-band", "outage")}, [LOOPS], SIZE, words=NOT_LATE),
    Row(faulty("by-place"), LOOPS, SIZE, words=NOT_LATE, level="should", name="by-place"),
    # A low-pass of 10 Hz, of which a tick of 1 ms lets T = 1 ms / (exp(2 pi 10 Hz 1 ms) - 1) be late.
    *rows({"slow": faulty("slow")}, [PRESS, LOOPS, IMPACT], SIZE, evidence=LOW_PASS),
    # A damper that the scene does not ask for is named by what it is more: no dead band, and no force is missing.
    # None is too large that nobody feels: it makes 4 times the spring's force of the first 2.7 nm, which is 11 uN.
    Row(force_sizes.Damped, PRESS, SIZE, words="^a damper of 2 N s/m acts on the whole velocity", level="should"),
    Row(force_sizes.Damped, LOOPS, SIZE, words="^its damper along the normal is off by 2 N s/m"),
    Row(
        force_sizes.Damped,
        replace(case_at(PRESS), scene={**case_at(PRESS).scene, "damping": 0.5}),
        SIZE,
        words="^a damper of 1.5 N s/m acts on the whole velocity in contact",
        level="should",
    ),
    # A stiffness that varies as declared; and a range that is declared is held.
    *rows(
        [resolve(name) for name in ("homothetic", "combescure", "minimum-distance+square-root")],
        [*VARYING, "unilateral-surfaces/ellipsoid-deep"],
        passes=SIZE,
    ),
    Row(force_sizes.Declaring, "slide", passes=SIZE),
    Row(declaring(force_sizes.Declaring, stiffness_range=(0.8, 32.0)), "slide", SIZE, name="narrower"),
    # A kick of a thrown tool is not declared away by a range that says something.
    Row(declaring(faulty("hard-kick"), **HALF_AS_MUCH_MORE), IMPACT, "passivity", name="kick-in-a-range"),
    Row(declaring(faulty("hard-kick"), **ANYTHING), IMPACT, passes="passivity", name="kick-in-any-range"),
    # A converter turns a force by its quantum, and may if that is declared.
    Row(force_sizes.Quantized, CONVEX, passes="contact-normal-force numerical-stability"),
    Row(partial(force_sizes.Quantized, declared=False), CONVEX, "contact-normal-force", name="undeclared"),
    Row(
        partial(force_sizes.Quantized, declared=False), CONVEX, "numerical-stability", level="should", name="undeclared"
    ),
    # Late by half a tick a spring is damped by -K T / 2: exp(pi T sqrt(K / m) / 4) over half a period.
    Row(
        Spring,
        IMPACT,
        "impulsive-collision",
        words=r"leaves with restitution 1.08 \(a spring's force that is held for a tick gives 1.08\)",
        evidence={"apparent_restitution": pytest.approx(np.exp(0.25 * np.pi * 0.1), rel=0.01)},
    ),
    Row(faulty("slow"), IMPACT, "impulsive-collision", words=r"gives 1.08\)", name="slow"),
]
"""A force that is off in size: a must stops it whatever the renderer declares, and no other than what is declared."""

ENERGY = [
    # It pushes the hand along curves: no lag is taken for the cause that force and position do not show.
    Row(
        spoiled(force_sizes.along_curves, Spring),
        LOOPS,
        "passivity",
        words=r"^((?!ticks late).)*creates energy at 1 ms: .*, round \([-.\d]+, [-.\d]+\) mm until((?!ticks late).)*$",
        evidence={"lag_ticks": 0.0},
        name="along-curves",
    ),
    # A thrown tool gets more from a kick than a held spring gives, or than the lag explains that a force alone shows.
    Row(faulty("hard-kick"), IMPACT, "passivity", times=5.0, name="hard-kick"),
    Row(Kicking, IMPACT, "passivity", evidence={"lag_ticks": 1.0}, times=10.0),
    # What a lag that shows gives is granted, half a tick of who answers in every second one too.
    *rows(
        {f"late-{lag}": honest.factory(f"late-{lag}", Spring) for lag in (1, 2, 3)}, [LOOPS, IMPACT], "", "passivity"
    ),
    *rows([force_sizes.EverySecond], [LOOPS, IMPACT], passes="passivity"),
]
"""What gives the hand energy, and what is only late."""

# What is declared

PROMISES = {"spring": Along.ERROR, "memoryless": True}
PROMISED = declaring(Spring, **PROMISES)
NEAREST = {
    CONVEX: "continuous-contact broken-contact",
    "thesis/star-concave-corner": "abrupt-switch",
    IMPACT: "impulsive-collision",
    "thesis/circle-slide": "centripetal-force",
    # Thinner than three steps of the hand.
    "solids/plate": "contact-kept",
}
"""What the nearest point and a spring fail where."""


def breaking(fault, **declared):
    """The nearest point and a spring, with a fault, that declares to be just that."""
    return declaring(spoiled(fault, Spring), **PROMISES, **declared)


def stiffer(times: float):
    return breaking(scaled(lambda tick: times))


THEOREMS = [
    # One algorithm is judged by what it declares: without that each of these stops a gate, with it none does.
    *(Row(Spring, place, fails, "the rest") for place, fails in NEAREST.items()),
    *(Row(PROMISED, place, fails, "the rest", level="inherent", name="promised") for place, fails in NEAREST.items()),
    # A jump that is farther than the nearest point's, and pops that hide behind one that is the nearest point's.
    Row(breaking(jumps_to_a_third_face), CONVEX, CONTINUOUS, name="jumps-to-a-third-face"),
    Row(
        breaking(pops_beside),
        CONVEX,
        CONTINUOUS,
        words=r"it jumps 1\.7. mm .* nearest point does not",
        name="pops-beside",
    ),
    Row(breaking(remembers), "thesis/cassinian-deep-slide", "memoryless", name="remembers"),
    # On a curve no other check of the case asks how large the force is.
    Row(stiffer(4.0), "thesis/circle-slide", "centripetal-force", name="4-times"),
    Row(stiffer(0.95), "thesis/circle-slide", "centripetal-force", level="inherent", name="nearly"),
    # A spring gives what its depths make, pressed before it counts as contact, or where it pressed as declared.
    Row(
        PROMISED,
        GRAZING,
        "impulsive-collision",
        words=r"6\.8.e-07 N s of 6\.[23].*e-07",
        level="inherent",
        name="promised",
    ),
    Row(stiffer(1.25), GRAZING, "impulsive-collision", words=r"7\.8.e-07 N s of 3\.9.e-08", name="stiffer"),
    Row(PROMISED, SLIDING_OFF, "impulsive-collision", words="is not stopped", level="inherent", name="promised"),
    Row(stiffer(0.5), SLIDING_OFF, "impulsive-collision", words="is not stopped", name="half"),
]
"""What a declaration excuses, and what it does not: a failure is inherent only where a theorem makes it."""

CONVEX_MOVING = [f"moving/circle-{case}" for case in ("comes", "comes-fast", "jumps")]
MOVING = [
    *CONVEX_MOVING,
    *(f"moving/{case}" for case in ("circle-slides", "star-tip-turns", "plate-swings", "cube-corners-pass")),
]
BODIES = [
    Row(of(OfLastTick), "moving/circle-slides", CONTINUOUS),
    Row(of(Turned), "moving/circle-slides", "contact-kept"),
    Row(of(Shifted), "moving/star-notch-turns", "contact-normal-force"),
    Row(of(ForceOfBody), "moving/star-notch-turns", "contact-normal-force"),
    Row(of(ForgetsPose), "moving/star-begins-elsewhere", "contact-kept"),
    Row(of(WorldsVelocity, DAMPED), "moving/ellipse-laps", "passivity"),
    Row(partial(Swept, carried=False), "moving/circle-comes", "contact-kept", name="left-in-the-world"),
    Row(partial(Swept, by_hand=True), "moving/circle-comes", "contact-kept", name="swept-by-the-hand-alone"),
    # Rightly taken it fails nothing, as at rest.
    *rows([of(AtRest), of(SubStepped)], MOVING),
    *rows([late_in_body], [place for place in MOVING if "star" not in place]),
    Row(late_in_body, "moving/star-tip-turns", passes="the rest", undecided="never-pulls"),
    *rows([Swept], CONVEX_MOVING),
]
"""Bodies that move: each wrong way to take a pose is stopped by name, and the right ones are left alone."""

LOOPS_OFF_THE_SURFACE = [
    f"dynamics-{case}"
    for case in ("circle/circle-off", "circle/circle-off-robot", "line/line", "sphere/sphere-off-robot")
]
"""Cases in which a law of this kind has to come home to the surface."""
SET_STABILISATION = resolve("set-stabilisation")
CLAIMS = [
    # Gains that nothing else tells: all else is asked of any gains.
    *rows(
        {
            "half-of-K_p": other_gains(stiffness=0.5),
            "three-times-K_d": other_gains(damping=3.0),
            "2-percent-more-of-K_d": other_gains(damping=1.02),
        },
        LOOPS_OFF_THE_SURFACE,
        "closed-form",
        "the rest",
    ),
    # The law itself is not blamed, whoever wrote it.
    *rows(
        [SET_STABILISATION, honest.factory("lists", SET_STABILISATION)],
        LOOPS_OFF_THE_SURFACE,
        passes="closed-form the rest",
    ),
    *rows([Stabilised], LOOPS_OFF_THE_SURFACE[:3], passes="closed-form the rest"),
]
"""Who declares to be a law is held to its closed form."""

LAWS_IN_SPACE = [
    *rows(
        [resolve("constraint")],
        ["solids/l-block-notch", "dynamics-unilateral/l-block-notch"],
        "abrupt-switch",
        level="inherent",
    ),
    Row(lambda scene: Mutant(scene, cushions), "solids/cube-impact", "impulsive-collision", name="cushions"),
    *rows(
        {"kicks": spoiled("kicks", "constraint")}, ["hard-cases-loops/laps-niche", "solids/cube-impact"], "passivity"
    ),
    *rows(
        {"wanders": spoiled(wanders, "constraint")},
        ["hard-cases-loops/laps-niche", "dynamics-unilateral/cube-laps"],
        "drift",
        level="should",
    ),
    *rows(
        {"trembles": spoiled(trembles, "constraint")},
        ["dynamics-unilateral/cube-laps", "solids/inner-corner-rest"],
        "comes-to-rest",
    ),
]
"""Laws of a contact that are broken on solids, led and in closed loop; in the suites the ideal contact passes them."""


@pytest.mark.parametrize(
    "row",
    [
        *(FIELD + PIECES + FINGER + REPORTING + FLIGHTS + OF_THE_FIELD + LATE_FRICTION),
        *(LATECOMERS + WRONG + RIGHTLY + JUMPS + SIZES + ENERGY + THEOREMS + BODIES + CLAIMS),
    ],
    ids=str,
)
def test_each_gets_its_verdicts(row):
    hold(row)


@pytest.mark.system
@pytest.mark.parametrize("row", VISITS + SLOW_JUMPS + LAWS_IN_SPACE, ids=str)
def test_those_that_take_longer_get_theirs(row):
    hold(row)


SENSED = {"imperfections": {"encoder_counts": 262144}}


def test_a_check_of_what_a_sensor_gave_keeps_the_channels_that_a_renderer_adds():
    """The atlas of set stabilisation records its chart."""
    asked = case_at("dynamics-sphere/sphere-robot")
    asked = replace(asked, checks=("continuous-contact", "force-magnitude"), scene={**asked.scene, **SENSED})
    judged = judge(resolve("set-stabilisation@atlas"), "atlas", "any", asked)
    assert judged.recording is not None
    assert "chart" in judged.recording.channels
    assert [verdict.finding.message for verdict in judged.verdicts if verdict.outcome is Outcome.ERROR] == []
