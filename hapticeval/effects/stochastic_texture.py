"""Stochastic textures: vibrations that a measured model makes of noise, by speed and normal force (thesis 4.3.2)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from hapticeval.documents import convert
from hapticeval.effects.effect import Calling, Effect, Part, Stage, number
from hapticeval.effects.texture import Texture, as_document, named, read_texture
from hapticeval.errors import InputError
from hapticeval.files import file_below
from hapticeval.quantity import format_quantity

VIBRATION_DIRECTIONS = ("along", "across", "normal")

SLOW = 1e-3
"""Share of a sample by which a tick may be longer than the texture's, as clocks differ."""

SEEDS = 2**32


@dataclass(frozen=True)
class StochasticTexture(Effect):
    """Shake the hand by vibrations of a texture, m/s^2, times a `mass` (kg), while the renderer presses on it.

    - `texture`: the name of one of ours, or a whole one as a table, see `texture.Texture`; a suite may name a `file` of
      one below its folder instead.
    - `direction`: "along" the hand's motion; "across" it in the surface, as the published toolkit has it, which does no
      work on the stroke and needs space; or along the "normal", where it never pulls.
    - `seed`: of the noise, which is the same after each reset.
    - `mass`: what makes forces of a published model's accelerations, which were measured on a tool. The toolkit's own
      programs take 0.05 kg, the hand's handle with some of the hand, or 0.5 kg.

    The filters are those of the hand's speed along the surface and the normal force, both low-passed at 20 Hz, by line
    spectral frequencies that are interpolated at each sample. A sample is held until the next where the loop is faster
    than the texture.
    """

    mass: float = number("kg", zero=True)
    texture: str | Texture = ""
    direction: str = "along"
    seed: int = 1

    kind: ClassVar[str] = "stochastic-texture"
    stage: ClassVar[Stage] = Stage.ANSWER
    linear: ClassVar[bool] = False

    def __post_init__(self) -> None:
        super().__post_init__()
        if isinstance(self.texture, Mapping):
            object.__setattr__(self, "texture", convert(self.texture, Texture, "texture", todo="see docs/effects.md"))
        if self.direction not in VIBRATION_DIRECTIONS:
            raise InputError(
                f"a {self.kind} with direction = {self.direction!r}",
                todo=f"choose one of: {', '.join(VIBRATION_DIRECTIONS)}",
            )
        if isinstance(self.seed, bool) or not isinstance(self.seed, int) or not 0 <= self.seed < SEEDS:
            raise InputError(f"a {self.kind} with seed = {self.seed!r}", why=f"it is a whole number below {SEEDS}")
        _ = self.model  # raises for an unknown name now, not in the middle of a run

    @classmethod
    def read(cls, numbers: Mapping[str, Any], folder: Path) -> Mapping[str, Any]:
        """Return the numbers of a table, with the texture of the `file` (TOML) that it names."""
        if "file" not in numbers:
            return numbers
        if "texture" in numbers:
            raise InputError(f"a {cls.kind} with a file and a texture", todo="give one or the other")
        texture = read_texture(file_below(folder, str(numbers["file"])))
        return {name: value for name, value in numbers.items() if name != "file"} | {"texture": texture}

    @property
    def model(self) -> Texture:
        """The texture itself. Raises `UnknownNameError` for a name that there is not."""
        return named(self.texture) if isinstance(self.texture, str) else self.texture

    @property
    def off(self) -> bool:
        """Whether it shakes nothing."""
        return self.mass == 0.0

    def document(self) -> dict[str, Any]:
        """See `Effect.document`: a texture that is not ours is written whole."""
        written = super().document()
        return written | ({} if isinstance(self.texture, str) else {"texture": as_document(self.texture)})

    def describe(self, *, turning: bool) -> str:  # noqa: ARG002 - as every effect
        """Describe the texture by its title."""
        return f"texture '{self.model.title}' {self.direction} the way, shaking {format_quantity(self.mass, 'kg')}"

    def fits(self, scene: Calling) -> None:
        """Raise `InputError` where its direction is none of the model's, or the loop is slower than its samples."""
        if self.direction == "across" and scene.model.dimension == 2:
            raise InputError(
                f"a {self.kind} across the way on model '{scene.model.name}'",
                why="in the plane a hand that slides has no way across but the normal",
                todo="choose direction = 'along' or 'normal', or a model in space",
            )
        if scene.sampling_time * self.model.rate > 1.0 + SLOW:
            raise InputError(
                f"texture '{self.model.title}' has {self.model.rate:g} samples a second, and the scene "
                f"{1.0 / scene.sampling_time:g}",
                why="a loop that leaves samples out would alias them",
                todo="sample the scene as fast, or take a texture that was resampled",
            )

    def change(self, scene: Calling) -> Part:
        """See `Effect.change`."""
        from hapticeval.effects import texture_kernels as kernels
        from hapticeval.records import as_record, numbers_of

        model, first = self.model, self.model.filters[0]
        params = numbers_of(
            kernels.TEXTURE, mass=self.mass, rate=model.rate, seed=self.seed, poles=len(first.ar), zeros=len(first.ma),
            filters=len(model.filters), direction=VIBRATION_DIRECTIONS.index(self.direction),
        )  # fmt: skip
        rows = kernels.BEFORE + max(len(first.ar), len(first.ma), 1) + kernels.LONGEST_WORK
        state = np.zeros((rows, scene.model.dimension))
        as_record(state, kernels.SMOOTHED, kernels.SMOOTHED_ROW).speed = -1.0  # below zero: no contact yet
        return Part(kernels.vibrate, params, model.rows(), state)

    def active(self, damping: float) -> str | None:  # noqa: ARG002 - as every effect
        """Return why it gives energy away, which it does at times with any renderer."""
        return "a stochastic texture shakes the hand with noise"
