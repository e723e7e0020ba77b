"""The contract of effects: what a scene may call for, such as a device's imperfections or a surface's friction.

An effect is a frozen dataclass. Its fields are its numbers; `number` declares each with a unit and what it may be. The
class attributes and methods of `Effect` are all that the rest of the package knows of it, and each has a default.

An effect that takes part in a tick has a `stage` and a `Part`: a plain function over arrays, which is compiled when a
scene first calls for it, and what it works on.

Those of the device take part in the closed loop. Those of the surface change each answer of a renderer that does not
show them by itself, along a path and in closed loop alike.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, field, fields
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Protocol

import numpy as np

from hapticeval.errors import InputError
from hapticeval.quantity import format_quantity
from hapticeval.types import Array

if TYPE_CHECKING:
    from hapticeval.devices.device import Device
    from hapticeval.geometry.model import Model

PER_JOINT = {"force": ("N m", "N"), "position": ("rad", "m")}
"""Units that depend on the device: (of a joint that turns, of the point mass, whose joints are its position)."""


class Stage(StrEnum):
    """Where in a tick of the closed loop an effect takes part, and what the vectors `first` and `second` are there."""

    SENSE = "sense"
    """Change the joint positions and rates (N,) that the controller is given."""
    FEEL = "feel"
    """Change the hand's force (N,), N, as measured; `second` is not used."""
    COMMAND = "command"
    """Change the joint torques (N,) that the motors give from now on.

    Return the seconds into the tick until which they still give those in `second`, which is then to be written.
    """
    JOINTS = "joints"
    """Give Coulomb friction to the joints: `params` (N,), without a function."""
    ANSWER = "answer"
    """Change the answer of a renderer that does not declare to support the effect, see `Effect.change`.

    A force that is not zero is contact to the effects of this stage. So those that act outside of contact, such as a
    magnet, have `Alters.FREE_SPACE`, by which `catalogue.in_order` puts them behind all others.
    """


class Alters(StrEnum):
    """What an effect of the surface changes of what a rigid, frictionless contact is like, as checks ask of it."""

    CONTACT_POINT = "a contact point that stays behind the hand"
    MOTION = "a force against the motion along the surface"
    FREE_SPACE = "a force outside of the solid"


class Part(NamedTuple):
    """What an effect adds to a tick, assembled for one run: by `Effect.part` of a loop, by `Effect.change` else.

    `function` writes in place; it is plain Python over arrays that numba can compile, and calls nothing of the package
    but compiled functions. Either method says how it is called.

    `params` (k,) are its numbers, and `samples` (ticks, N) what it is given at each tick. `state` (2D) is what one tick
    leaves to the next, and has in a part the numbers with which every run begins.
    """

    function: Callable[..., float] | None
    params: Array
    samples: Array = np.empty((0, 0))
    state: Array = np.empty((0, 0))


def number(
    unit: str,
    *,
    zero: bool = False,
    finite: bool = True,
    default: Any = MISSING,
    compare: bool = True,
    short: str = "",
) -> Any:
    """Declare a field of an effect that is a number with a `unit` (or a key of `PER_JOINT`) and a range.

    It must be positive, or may be `zero`, too; and it must be finite unless it need not be. `short` is its name in the
    scene's table, where `catalogue.Entry.short` has one.
    """
    metadata = {"unit": unit, "zero": zero, "finite": finite, "short": short}
    return field(metadata=metadata, default=default, compare=compare)


@dataclass(frozen=True)
class Effect:
    """One effect of a scene. Raises `InputError` for a number that is out of its range."""

    kind: ClassVar[str] = ""
    """Its name in suites, results and recordings."""
    stage: ClassVar[Stage | None] = None
    """Where in a tick it takes part; None for what only renderers and checks know of."""
    domain_exits: ClassVar[Mapping[int, str]] = {}
    """Where the hand has left its domain, in words, by the numbers that its change of an answer returns beside 0."""
    words: ClassVar[str] = ""
    """The effect in a few words, with its numbers by name in braces: see `describe`."""
    channels: ClassVar[tuple[str, ...]] = ()
    """Channels that a closed loop records because of it."""
    linear: ClassVar[bool] = True
    """Whether the sampled loop around rest stays linear with it."""
    alters: ClassVar[frozenset[Alters]] = frozenset()
    """What it changes that a check may not be asked with: see `phenomena.check.Check.not_with`."""

    def __post_init__(self) -> None:
        for number_field in fields(self):
            value, allowed = getattr(self, number_field.name), number_field.metadata
            if not allowed or value is None:  # no `number`, or one that is not given
                continue
            sound = isinstance(value, int | float) and (value >= 0.0 if allowed["zero"] else value > 0.0)
            if not sound or (allowed["finite"] and not math.isfinite(value)):
                bound = "not negative" if allowed["zero"] else "positive"
                raise InputError(
                    f"{self.named(number_field.name)} = {value!r} {unit_of(allowed['unit'])}".rstrip(),
                    why=f"it must be {'finite and ' if allowed['finite'] else ''}{bound}",
                    todo="leave it out for none",
                )

    @classmethod
    def read(cls, numbers: Mapping[str, Any], folder: Path) -> Mapping[str, Any]:  # noqa: ARG003 - an effect's
        """Return its numbers of a suite's table, with what files hold that the table names, which count from `folder`.

        Raises `InputError` for a file that cannot be read.
        """
        return numbers

    @classmethod
    def named(cls, name: str) -> str:
        """Return what messages call a field: its short form in suites where it has one, else kind and field."""
        return cls.__dataclass_fields__[name].metadata.get("short") or f"the {cls.kind}'s {name}"

    @property
    def off(self) -> bool:
        """Whether its numbers are such that it changes nothing: a scene leaves it out then."""
        return False

    @property
    def late(self) -> float:
        """Seconds that it adds between a sample and the motors' answer."""
        return 0.0

    def check(self, device: Device) -> None:
        """Raise `InputError` where the effect makes no sense on the scene's device."""

    def fits(self, scene: Calling) -> None:
        """Raise `InputError` where the effect makes no sense in the scene."""

    def check_path(self, scene: Calling, hips: Array) -> None:
        """Raise `InputError` where a hand that is led along HIPs (n, N), m, a tick each, asks for what cannot be."""

    def check_base(self, scene: Calling, ask: Ask) -> None:
        """Raise `RefusalError` where it cannot be put on a renderer's answers, of which `ask` gives any."""

    def part(self, ticks: int, size: int, dt: float) -> Part:
        """Assemble what it adds to a closed loop of so many ticks of `dt` s, on a device of `size` = N joints.

        `function(params, samples, state, tick, dt, first, second)` is given two arrays (N,) that depend on the `stage`,
        writes in place, and returns a float.
        """
        raise NotImplementedError(f"{type(self).__name__} has the stage {self.stage} and no part")

    def change(self, scene: Calling) -> Part:
        """Assemble what it does to each answer of a renderer of `scene`, at the stage `ANSWER`.

        `function(numbers, closest, hip, velocity, dt, ihip, force)` is given the fields `params`, `samples` and `state`
        of the part as `numbers`, the scene's boundary as `closest`, see `hapticeval.laws.CLOSEST`, and the answer
        to `hip` (N,), m, which it changes in place: `ihip` (N,), m, and `force` (N,), N. It returns 0, or the number of
        one of `domain_exits`.

        At the reset that begins a run `state` is put back to the numbers of the part.
        """
        raise NotImplementedError(f"{type(self).__name__} has the stage {self.stage} and no change")

    def active(self, damping: float) -> str | None:  # noqa: ARG002 - an effect's
        """Return why the loop gives energy away with any renderer of `damping` N s/m; None where it need not."""
        return None

    def document(self) -> dict[str, Any]:
        """Return kind and numbers as JSON values, without those that have their default."""
        value_of = {field.name: getattr(self, field.name) for field in fields(self)}
        return {"kind": self.kind} | {
            field.name: value_of[field.name]
            for field in fields(self)
            if field.compare and value_of[field.name] is not None and value_of[field.name] != field.default
        }

    def describe(self, *, turning: bool) -> str:
        """Describe the effect in a few words, numbers with units; `turning`: the device has joints that turn."""
        return (self.words or self.kind).format(
            **{
                field.name: format_quantity(getattr(self, field.name), unit_of(field.metadata["unit"], turning=turning))
                for field in fields(self)
                if field.metadata
            }
        )


Ask = Callable[[Array, Array], tuple[Array, Array]]
"""Ask a renderer: (from, to) -> IHIP and force, (N,) each, for a hand that comes from one point and rests at one."""


class Calling(Protocol):
    """What calls for effects: a scene, see `hapticeval.scene.Scene`."""

    @property
    def effects(self) -> tuple[Effect, ...]:
        """The effects that it calls for."""

    @property
    def model(self) -> Model:
        """The rigid model."""

    @property
    def stiffness(self) -> float:
        """K_p, N/m."""

    @property
    def mass(self) -> float:
        """The mass (kg) of the virtual tool."""

    @property
    def restitution(self) -> float:
        """c_r of (3.5)."""

    @property
    def bilateral(self) -> bool:
        """Whether the surface holds the tool from both sides."""

    @property
    def sampling_time(self) -> float:
        """The sampling time (s) of the haptic thread."""

    @property
    def robot(self) -> Device:
        """The device of an experiment."""


def unit_of(unit: str, *, turning: bool = True) -> str:
    """Return the unit of a number whose unit may depend on the device."""
    return PER_JOINT[unit][not turning] if unit in PER_JOINT else unit
