"""A scene in words: gains, the robot and how it is driven, what is wrong with it; and why a run ended early."""

from __future__ import annotations

import re

from hapticeval.devices.point_mass import PointMass
from hapticeval.effects.catalogue import make_effect
from hapticeval.effects.effect import Stage
from hapticeval.quantity import format_quantity
from hapticeval.runner.results import RunEntry, SceneEntry

GAINS = {"stiffness": "N/m", "damping": "N s/m", "mass": "kg", "restitution": ""}
"""A scene's gains and their units."""

INNER_LOOPS = {
    "static": "static inner loop, torques Jᵀ F (2.8)",
    "compensated": "inner loop with dynamic compensation (2.11)",
    "linearised": "inner loop by feedback linearisation (6.7)",
}
"""Inner loops in words, with the thesis's equation."""

SURFACE_STAGES = (None, Stage.ANSWER)
"""Stages of the surface's effects."""

CITED_FIGURES = re.compile(r"Figures? \d+\.\d+(?:(?:,| and| to) \d+\.\d+)*")
"""One citation of figures, as in Figure 6.5, Figures 6.3 to 6.5, or Figures 6.22 and 7.3."""


def scene_words(run: RunEntry) -> str:
    """The scene of a run document in one line, every number with its unit."""
    scene = run.scene
    # A gain of zero is not part of the scene.
    words = [
        f"{name} {format_quantity(getattr(scene, name), unit)}" for name, unit in GAINS.items() if getattr(scene, name)
    ]
    words += _effects(scene, of_surface=True)
    if scene.sampling_time:
        words.append(format_quantity(1.0 / scene.sampling_time, "Hz"))
    return ", ".join([*words, "bilateral" if scene.bilateral else "unilateral"])


def robot_words(run: RunEntry) -> str:
    """The device of an experiment, its dynamics, inner loop and imperfections, in one line; "" where none is told."""
    scene = run.scene
    device = scene.device
    if device is None:
        return ""
    words = [device.kind]
    # The robot with a locked base has constant inertia: neither choice makes any difference to it.
    if device.kind == "parallelogram-3dof":
        dynamics = {"lagrangian": "Lagrangian dynamics", "printed": "dynamics as printed (2.26)"}
        words += [dynamics.get(device.dynamics or "", device.dynamics or ""), f"d₀ with {device.base_inertia}² x₃"]
    if device.kind != "point-mass" and scene.inner_loop is not None:
        words.append(INNER_LOOPS[scene.inner_loop])
    wrong = _effects(scene, of_surface=False)
    return f"{', '.join(words)}; {', '.join(wrong) if wrong else 'no imperfections'}"


def _effects(scene: SceneEntry, *, of_surface: bool) -> list[str]:
    """Describe each effect that the scene calls for, of the surface or of the robot."""
    turning = scene.device is not None and scene.device.kind != PointMass.name
    effects = (make_effect(effect) for effect in scene.effects)
    return [effect.describe(turning=turning) for effect in effects if (effect.stage in SURFACE_STAGES) == of_surface]


def ended_words(run: RunEntry) -> str:
    """When and why a run ended before its time, in one sentence; "" where it did not."""
    ended = run.ended
    if not ended:
        return ""
    why = f" ({ended.why})" if ended.why else ""
    return f"ended early at t = {ended.time:.4g} s, tick {ended.tick}: {ended.what}{why}"


def figures_cited(run: RunEntry) -> str:
    """The figures of the thesis that a case's citation names, for instance "Figures 6.22 and 7.3"; "" for none."""
    cited = [citation.split(" ", 1)[1] for citation in CITED_FIGURES.findall(run.citation or "")]
    if not cited:
        return ""
    # Also one entry may name several, as "6.3 to 6.5".
    several = len(cited) > 1 or not re.fullmatch(r"\d+\.\d+", cited[0])
    return f"Figure{'s' if several else ''} {' and '.join(cited)}"
