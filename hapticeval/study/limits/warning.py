"""A warning before a robot runs: the sampled loop cannot hold the scene's stiffness."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hapticeval.effects.velocity_filter import VelocityFilter
from hapticeval.errors import DomainError
from hapticeval.renderer import RendererFactory
from hapticeval.scene import Scene
from hapticeval.study.limits.loop import Place, SampledLoop, robot_at
from hapticeval.study.limits.search import Family, eigenvalue_limit, family_of

PLACES = 12
"""Points of the boundary that are tried: the robot's inertia at the hand varies over centimetres."""

NOTHING = 1e-6
"""Share of the scene's stiffness below which a spring is rounding: gains are differences of forces."""


def too_stiff(factory: RendererFactory, scene: Scene, *, cutoff: float) -> str:
    """Describe where the loop with velocities of `cutoff` (Hz) is unstable without a hand; empty where it is stable.

    By the eigenvalues at rest at points of the boundary, of the motion across the surface: that a tool slides off a
    convex one is no matter of sampling. Empty too where they cannot decide: for a renderer whose gains do not grow with
    the stiffness, one without force, and one that breaks, which the run itself then reports.
    """
    boundary = scene.model.boundary
    sensed = scene.with_effects(VelocityFilter(cutoff))
    frame = boundary.frame(boundary.points(PLACES))
    places = [Place(*each) for each in zip(frame.foot, frame.normal, strict=True)]
    try:
        family = _across(family_of(factory, scene, places[0]))
    except Exception:
        return ""
    normal, gains = places[0].normal, family.at(scene.stiffness)
    spring = float(normal @ (gains.now + gains.before) @ normal)
    if not (np.isfinite(spring) and abs(spring) > NOTHING * scene.stiffness):
        return ""
    if spring < 0.0:
        return "the renderer's force pulls the hand into the surface; see its sign"
    found = []
    for place in places:
        try:
            loop = SampledLoop(sensed, robot_at(scene.robot, place.point))
        except DomainError:  # the part of an endless surface that the robot does not reach
            continue
        facing = family.facing(place)
        if loop.growth(facing.at(scene.stiffness)) >= 1.0:
            found.append((eigenvalue_limit(loop, facing, steps=12), place))
    if not found:
        return ""
    limit, place = min(found, key=lambda each: each[0])
    where = ", ".join(f"{1e3 * value:.4g}" for value in place.point)
    held = f"up to {limit:.4g} N/m; choose a lower --stiffness," if limit > 0.0 else "at no stiffness; choose"
    return (
        f"without a hand the sampled loop cannot hold {scene.stiffness:.4g} N/m: at ({where}) mm it is stable {held} "
        "a faster --rate, or another --damping"
    )


def _across(family: Family) -> Family:
    """Return the gains along the normal alone."""
    across = np.outer(family.place.normal, family.place.normal)
    return replace(family, offset=across @ family.offset @ across, slope=across @ family.slope @ across)
