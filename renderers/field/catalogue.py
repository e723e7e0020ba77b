"""The factories behind the names of the field's renderers, with their knobs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from importlib import import_module
from typing import TYPE_CHECKING

from hapticeval.errors import InputError, UnknownNameError
from hapticeval.geometry.validate import checked_number
from hapticeval.renderer import Knob, Settings, at_rest, refuse_unknown

if TYPE_CHECKING:
    from hapticeval.renderer import Renderer
    from hapticeval.scene import Scene


@dataclass(frozen=True, kw_only=True)
class Tunable:
    """A factory of renderers of another publication than the thesis, by `make`, as module:function of this package.

    `make(scene, **settings)` is called, with a setting for each knob; where there are `regulations` or
    `representations` to choose from it is given the chosen one under the name `regulation` or `representation`. A
    representation of `presets` stands for settings instead.
    """

    summary: str
    make: str
    settings: Settings
    knobs: Mapping[str, Knob]
    regulations: tuple[str, ...] = ()
    representations: tuple[str, ...] = ()
    presets: Mapping[str, Settings] = field(default_factory=dict)
    regulation: str | None = None
    representation: str | None = None
    supports: frozenset[str] = field(default=frozenset({"moving", "plane", "space", "force-sensor"}))

    def with_knobs(self, **values: float) -> Tunable:
        """The same with some knobs set.

        Raises `UnknownNameError` for one that it does not have, and `InputError` for a value that is not positive or
        not finite.
        """
        refuse_unknown(values, self.knobs, name=self.make.partition(":")[2])
        for knob, value in values.items():
            if checked_number(knob, value) <= 0.0:
                raise InputError(f"{knob} = {value!r} {self.knobs[knob].unit}".rstrip(), why="it must be positive")
        return replace(self, settings={**self.settings, **values})

    def variant(self, *, regulation: str | None = None, representation: str | None = None) -> Tunable:
        """The same with another law of force or representation. Raises `UnknownNameError` for one that is not known."""
        for name, offered in ((regulation, self.regulations), (representation, self.representations)):
            if name is not None and name not in offered:
                raise UnknownNameError(f"variant of {self.make.partition(':')[2]}", name, offered)
        return replace(
            self,
            regulation=regulation or self.regulation,
            representation=representation or self.representation,
            settings={**self.settings, **self.presets.get(representation or "", {})},
        )

    def __call__(self, scene: Scene) -> Renderer:
        """The renderer for a scene. Raises `RefusalError` for a model that it cannot work on."""
        module, _, function = self.make.partition(":")
        make: Callable[..., Renderer] = getattr(import_module(f"hapticeval.renderers.field.{module}"), function)
        chosen = {"regulation": self.regulation} if self.regulations else {}
        chosen |= {"representation": self.representation} if self.representations and not self.presets else {}
        return at_rest(make(scene, **chosen, **self.settings), scene)


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
