"""A renderer led along a path, as the suites lead one: what it answers."""

from __future__ import annotations

from hapticeval.renderer import AnyRenderer
from hapticeval.simulation.playback import answers_along
from hapticeval.types import Array


def led(renderer: AnyRenderer, hips: Array, dt: float) -> tuple[Array, Array]:
    """IHIPs (n, N), m, and forces (n, N), N, along HIPs (n, N), m, from a reset, every `dt` (s)."""
    answers = answers_along(renderer, hips, dt)
    return answers.ihip, answers.force
