"""Why engines fail: a sentence for a column and a check, which docs/engines.md has beside the numbers."""

from __future__ import annotations

from collections.abc import Mapping

NEAREST_FACE = "The deepest contact is that of the nearest face, so under the bisector of two faces it changes sides."
THROUGH_IN_A_TICK = "At 2 m/s the hand is past the plate in one tick, and contacts are looked for at ticks only."
SPRING_IMPACT = "A spring takes the momentum out over its own half period, and not at once."
SPRING_ORBIT = "A spring holds the hand on its circle by a position error alone."
FREE_TOOL = "a force that the hand feels of a free tool counts as contact, and in contact the tool sinks in."
THROWN_OUT = "The run begins inside of the convex hull, in free space of the model, and is thrown out."

IN_THE_HULL = "A hand in a notch is inside of the convex hull, and pushed in free space of the model."
FELT_BY_COUPLING = "A tool that is not at the hand in free space is felt by the coupling."
CORNER_OF_A_SPRING = (
    "The tool rests in the corner, where the spring to it turns with the hand. Where the hand's way bends, the "
    "coupling's damper tilts the force as well."
)

DEEP_DEPTH = "Of a body of 5,120 facets the depth is off: deep in the ellipsoid up to 1.74 times the true one."
LEAPS = "The path leaps between far places in a tick, and a tool that has mass is still on its way."
BALL_AS_LARGE = "The ball of 0.1 mm is as large as the model, and stands off by that."

QUERY = {
    "broken-contact": NEAREST_FACE,
    "centripetal-force": SPRING_ORBIT,
    "contact-kept": THROUGH_IN_A_TICK,
    "continuous-contact": NEAREST_FACE,
    "impulsive-collision": SPRING_IMPACT,
    "numerical-stability": BALL_AS_LARGE,
}

COUPLED = {
    "broken-contact": "At the start of a path the hand feels the tool's inertia, along no face; past the edge the tool "
    "swings on.",
    "centripetal-force": "Hand and tool together weigh twice the scene's mass, and leave the surface.",
    "contact-normal-force": "The hand feels the tool's inertia and the coupling's damper too, inwards and along the "
    "surface.",
    "force-magnitude": "The coupling's damper answers a change of the hand's speed at once: at a path's start by 20 "
    "times the spring.",
    "impulsive-collision": SPRING_IMPACT,
    "numerical-stability": LEAPS,
    "never-pulls": "The coupling's damper goes to the hand unclipped: that is the adapter's choice, not the engine's.",
}

MUJOCO_COUPLED = {
    **COUPLED,
    "contact-kept": f"{IN_THE_HULL} {THROUGH_IN_A_TICK} {FELT_BY_COUPLING}",
    "continuous-contact": f"{THROWN_OUT} On convex models {FREE_TOOL}",
    "passivity": THROWN_OUT,
}

BY_COLUMN: Mapping[str, Mapping[str, str]] = {
    "mujoco-query": {
        **QUERY,
        "contact-kept": f"{IN_THE_HULL} {THROUGH_IN_A_TICK}",
        "contact-normal-force": "In a notch the contact is with the convex hull. Elsewhere the normal is as good as "
        "`ccd_tolerance`: on a cube 3e-4 degrees off with the default of 1e-6, and 1e-9 with 1e-12.",
        "continuous-contact": f"{NEAREST_FACE} In a notch it is the convex hull's, off the model.",
    },
    "mujoco-coupled": MUJOCO_COUPLED,
    "mujoco-stiff": {
        **MUJOCO_COUPLED,
        "contact-kept": f"{THROWN_OUT} {IN_THE_HULL} {THROUGH_IN_A_TICK} {FELT_BY_COUPLING}",
    },
    "fcl-triangles": {
        "broken-contact": "Where the hand goes out by the other face, the ball touches that one from inside.",
        "contact-kept": "Triangles have no inside: a ball that is through the surface by its radius touches nothing.",
        "contact-normal-force": "A triangle has two sides: a ball that comes to it from inside is pushed inwards.",
        "impulsive-collision": "The ball goes through the surface: triangles have no inside.",
        "numerical-stability": BALL_AS_LARGE,
        "continuous-contact": "A triangle has two sides: the ball jumps by its diameter from one to the other.",
    },
    "fcl-convex": {
        **QUERY,
        "contact-normal-force": "The normal of a body of 5,120 facets is 1 degree off in the median and up to 35: the "
        "iteration for it ends early.",
        "passivity": DEEP_DEPTH,
    },
    "fcl-coupled": {
        **COUPLED,
        "contact-kept": f"{THROUGH_IN_A_TICK} {FELT_BY_COUPLING}",
        "continuous-contact": "On the ellipsoid the normal is up to 35 degrees off, and a steady push slides. On "
        f"models with plane faces {FREE_TOOL}",
    },
    "bullet-query": {
        **QUERY,
        "contact-normal-force": "On fine meshes the normal is up to 3 degrees off. The small ball is no larger than "
        "the hull's margin of 1 mm.",
    },
    "bullet-coupled": {
        **COUPLED,
        "abrupt-switch": CORNER_OF_A_SPRING,
        "contact-kept": "Triangles have two sides: a tool that is through them stays inside, and holds the hand that "
        f"leaves. {FELT_BY_COUPLING}",
        "continuous-contact": f"At the start of a path {FREE_TOOL}",
        "drift": "The solver ends early: with 500 iterations and no threshold a twentieth of it is left.",
        "passivity": "In free space the hand feels the tool's inertia: where it slows down it gets energy back.",
    },
}

CAUSES = {(column, check): cause for column, causes in BY_COLUMN.items() for check, cause in causes.items()}
"""The sentence for a column and a check."""
