"""Strategies of hypothesis for what a renderer may meet: hand paths, pushes, models, how they move, scenes, effects.

For anyone's tests:

    from hypothesis import given
    from hapticeval import make_model, play
    from hapticeval.strategies import hand_paths

    STAR = make_model("star")

    @given(hand_paths(STAR))
    def test_the_force_stays_small(moves):
        hips = moves.path().sampled(1e-3)[1]
        ...

Examples print as code that can be pasted. When hypothesis shrinks one it gets simpler: fewer parts, shallower, nearer
to where the model's outline begins.

All numbers come from small whole ones. Hypothesis draws some larger numbers from the source of whatever modules are
loaded, so that the same seed would give other examples in another program.
"""

from hapticeval.strategies.hand import PARTS, hand_paths, laps, pushes
from hapticeval.strategies.models import (
    MESHES,
    PLANE_MODELS,
    SURFACES,
    effects,
    meshes,
    motions,
    plane_models,
    scenes,
    surfaces,
)
from hapticeval.strategies.seeded import examples

__all__ = [
    "MESHES",
    "PARTS",
    "PLANE_MODELS",
    "SURFACES",
    "effects",
    "examples",
    "hand_paths",
    "laps",
    "meshes",
    "motions",
    "plane_models",
    "pushes",
    "scenes",
    "surfaces",
]
