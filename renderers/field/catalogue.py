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

local_plane = Tunable(
    summary="a plane under the hand, renewed at 60 Hz, Adachi 1995; with recovery of the force, Mark 1996",
    make="local_plane:LocalPlane",
    settings={"rate": 60.0, "recovery_time": 8e-3},
    regulations=("plain", "recovery"),
    regulation="plain",
    representations=("30hz", "60hz", "100hz"),
    representation="60hz",
    presets={"30hz": {"rate": 30.0}, "60hz": {"rate": 60.0}, "100hz": {"rate": 100.0}},
    knobs={
        "rate": Knob(
            values=(15.0, 30.0, 60.0, 100.0, 250.0, 500.0, 1000.0),
            quick=(30.0, 100.0, 1000.0),
            unit="Hz",
            meaning="planes a second",
        ),
        "recovery_time": Knob(
            values=(32e-3, 16e-3, 8e-3, 4e-3),
            quick=(16e-3,),
            unit="s",
            meaning="time in which a new plane comes to its place but for 1/e, with recovery",
        ),
    },
)
"""The local plane."""

coupled = Tunable(
    summary="virtual coupling to a simulated tool with penalty contact, Colgate, Stanley and Brown 1995",
    make="coupled:Coupled",
    settings={"ratio": 10.0},
    knobs={
        "ratio": Knob(
            values=(2.0, 5.0, 10.0, 20.0, 50.0),
            quick=(5.0, 50.0),
            unit="",
            meaning="stiffness of the contact in those of the coupling",
        )
    },
)
"""The virtual coupling to a simulated tool."""

neighbourhood = Tunable(
    summary="nearest point among the faces around the last one, Ho, Basdogan and Srinivasan 1999",
    make="neighbourhood:Neighbourhood",
    settings={},
    knobs={},
)
"""The neighbourhood watch."""

implicit = Tunable(
    summary="a contact point led over tangent planes of S = 0, Salisbury and Tarr 1997; forces of distance fields",
    make="implicit:implicit",
    settings={"grid": 100.0},
    regulations=("tracked", "normal", "gradient"),
    regulation="tracked",
    representations=("exact", "grid"),
    representation="exact",
    knobs={
        "grid": Knob(
            values=(25.0, 50.0, 100.0, 200.0, 400.0),
            quick=(50.0, 200.0),
            unit="",
            meaning="nodes of the sampled distance along the model's longest side, on the grid",
        )
    },
)
"""The implicit surface."""
