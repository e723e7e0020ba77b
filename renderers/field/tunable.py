"""The factories of the field's renderers: numbers that are knobs, and variants that a name chooses."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from importlib import import_module
from typing import TYPE_CHECKING

from hapticeval.errors import InputError, UnknownNameError
from hapticeval.geometry.validate import checked_number
from hapticeval.knob import Knob, Settings, refuse_unknown

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
    supports: frozenset[str] = field(default=frozenset({"plane", "space", "force-sensor"}))

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
        return make(scene, **chosen, **self.settings)
