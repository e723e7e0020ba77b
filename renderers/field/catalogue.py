"""The factories behind the names of the field's renderers, with their knobs."""

from __future__ import annotations

from hapticeval.knob import Knob
from hapticeval.renderers.field.tunable import Tunable

virtual_proxy = Tunable(
    summary="a ball that the hand leads and obstacles stop, Ruspini, Kolarov and Khatib 1997; stands off by its radius",
    make="virtual_proxy:VirtualProxy",
    settings={"radius": 0.5e-3},
    knobs={
        "radius": Knob(
            values=(4e-3, 2e-3, 1e-3, 0.5e-3, 0.25e-3, 0.125e-3),
            quick=(2e-3, 0.5e-3, 0.125e-3),
            unit="m",
            meaning="radius of the ball: the proxy stands off by it",
        )
    },
)
"""The virtual proxy."""
