"""The god-object is the ideal contact of a tool without mass, on bodies that move too; and what is off is seen."""

from functools import cache

import pytest
from massless import compare

from hapticeval.discovery import resolve
from hapticeval.renderer import Response
from hapticeval.search.drawing import draw_cases


@cache
def turning_body(dimension):
    """A body that spins: in the plane a star, in space a cube."""
    cases = draw_cases((), ("continuous-contact",), 3, dimension=dimension, moving=True)
    return next(case for case in cases if abs(case.scene["motion"].get("rate", 0.0)) > 0.5)  # turns a second


class Spoiled:
    """A god-object whose answers a rule changes: `change(ihip, force)`."""

    supports = frozenset({"moving", "plane", "space"})

    def __init__(self, scene, change, stale):
        self.base, self.change, self.stale, self.poses = resolve("constraint")(scene), change, stale, []

    def place(self, rotation, translation):
        self.poses = [*self.poses[-1:], (rotation, translation)]
        self.base.place(*self.poses[0 if self.stale else -1])

    def reset(self, hip):
        self.base.reset(hip)

    def step(self, hip, velocity, dt):
        ihip, force = self.base.step(hip, velocity, dt)
        return Response(*self.change(ihip, force)) if force.any() else Response(ihip, force)


CHANGES = {
    "nothing": (lambda ihip, force: (ihip, force), False),
    "the pose of the last tick": (lambda ihip, force: (ihip, force), True),
    "5 % too stiff": (lambda ihip, force: (ihip, 1.05 * force), False),
    "a contact point 0.1 mm off": (lambda ihip, force: (ihip + 1e-4, force), False),
}


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("name", CHANGES)
def test_the_god_object_is_the_ideal_contact_without_mass(name, dimension):
    case = turning_body(dimension)
    scene = case.build_scene()
    change, stale = CHANGES[name]
    agreement = compare(
        scene, case.build_stimulus(scene, None), lambda scene: Spoiled(scene, change, stale), resolve("ideal")
    )
    assert bool(agreement.differences) == (name != "nothing"), agreement
