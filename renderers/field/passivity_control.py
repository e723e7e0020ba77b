"""The passivity controller: what a renderer gives the hand beyond what the hand has put in is damped away.

Hannaford, B., Ryu, J.-H. (2002): Time-domain passivity control of haptic interfaces, IEEE Transactions on Robotics and
Automation 18(1).

With F the inner renderer's force on the hand, v the hand's velocity and T the tick:

1. The observer: E <- E - F . v T is what the hand has put in and has not got back.
2. Where E < 0, the controller: alpha = -E / (T v . v).
3. F' = F - alpha v, so that E <- E + alpha v . v T = 0.
4. A reset sets E = 0.

Because E >= 0 before each tick, the damper takes at most the part of F that moves the hand, F . v / |v|: it gives no
spikes. The IHIP stays the inner renderer's.

Predicted from the equations, before any run:

- passivity: passes for all it is put around, but for what a force that is held for a tick gives: v is the way up to
  the tick, and the force acts after it.
- contact normal force: fails where E runs out, and only there: alpha v drags along the surface.
- force magnitude: the same; no spring is declared any more.
- All checks of the IHIP: as for the inner renderer.
- memoryless: as for the inner renderer, for it asks the IHIP; the force now depends on the past.

Measured on the suite `thesis`, around `conformal`, whose map gives the hand energy:

- passivity: passes. Three laps in the Cassinian give 15.1 mJ each, as without a controller, for the way in has put
  53 mJ into the observer. Led on, the fourth lap spends it; from the fifth on a lap gives 0.14 mJ, what holding the
  force gives, and the force is turned by up to 45 degrees. In the ellipse, with 2.4 mJ a lap, it takes 28 laps.
- contact normal force: passes in ten of ten, for it never acts there.
- force magnitude: fails in two of nine, where it acts: on the way out of the loop under the star's tip, and for a tick.
- All else: as `conformal`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from hapticeval.errors import RefusalError
from hapticeval.renderer import Response, WrappedRenderer, at_rest, choices_of, wrapped

if TYPE_CHECKING:
    from hapticeval.renderer import Renderer, RendererFactory
    from hapticeval.scene import Scene
    from hapticeval.types import Array


@dataclass(frozen=True, kw_only=True)
class PassivityControlled:
    """A factory of renderers, each within a passivity controller."""

    inner: RendererFactory

    @property
    def summary(self) -> str:
        """What it makes, in a line."""
        return f"{choices_of(self.inner).summary}; within a passivity controller, Hannaford and Ryu 2002"

    @property
    def supports(self) -> frozenset[str] | None:
        """What the inner factory declares."""
        return choices_of(self.inner).supports

    @property
    def knobs(self) -> Any:
        """The inner factory's."""
        return choices_of(self.inner).knobs

    def with_knobs(self, **values: float) -> PassivityControlled:
        """The same around the inner factory with some knobs set."""
        choices = choices_of(self.inner)
        return replace(self, inner=choices.with_knobs(**values)) if choices.with_knobs is not None else self

    def __call__(self, scene: Scene) -> Renderer:
        """The renderer for a scene. Raises `RefusalError` for one that answers no hand tick by tick."""
        # what it observes is the work against the body, which is at rest for both
        inner = wrapped(self.inner(replace(scene, motion=None)))
        if not inner.steps:
            raise RefusalError(
                "a passivity controller around a tool with physics of its own",
                why="there is no force a tick to observe",
                todo="put +pc behind a renderer that has reset and step",
            )
        promise = inner.declares
        # A damper is no spring: what remains is whether there is a contact point, and how coarse answers are.
        promise = promise and replace(promise, spring=None, stiffness_range=None, closed_form=None)
        # The compiled step and the diagnostics are of the inner answers; all else holds of the changed ones too.
        changed = replace(inner, renderer=Controlled(inner), declares=promise, law=None, has_diagnostics=False)
        return at_rest(changed, scene)


def passivity_controlled(inner: RendererFactory) -> PassivityControlled:
    """Give the hand no more energy than it has put in, by a passivity controller (Hannaford and Ryu 2002)."""
    return PassivityControlled(inner=inner)


class Controlled:
    """A renderer's answers, with the energy (J) that the hand has put in kept at zero or above."""

    def __init__(self, inner: WrappedRenderer) -> None:
        self.inner = inner
        self.energy = 0.0

    @property
    def contact(self) -> bool | None:
        """Whether the last step was in contact, as the inner renderer reports it; asked where it does."""
        return self.inner.contact

    def observe_force(self, push: Array) -> None:
        """Hand the hand's measured force (N,), N, on; asked where the inner renderer observes it."""
        self.inner.observe_force(push)

    def reset(self, hip: Array) -> None:
        """Start a run with the hand at `hip` (N,), m: nothing is stored."""
        self.energy = 0.0
        self.inner.reset(hip)

    def step(self, hip: Array, velocity: Array, dt: float) -> Response:
        """One tick: `hip` (N,), m, its `velocity` (N,), m/s, and `dt`, s; IHIP (N,), m, and force (N,), N."""
        ihip, force = self.inner.step(hip, velocity.copy(), dt)
        force = np.asarray(force, dtype=np.float64)
        self.energy -= float(force @ velocity) * dt
        speed2 = float(velocity @ velocity)
        if self.energy < 0.0 and speed2 > 0.0:
            alpha = -self.energy / (dt * speed2)
            force = force - alpha * velocity
            self.energy = 0.0
        return Response(ihip, force)
