"""A relief on the surface (thesis 4.3.2): a height map is felt as a spring's potential, a bump map turns the normal."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from hapticeval.effects.effect import Ask, Calling, Effect, Part, Stage, number
from hapticeval.errors import InputError, RefusalError
from hapticeval.files import file_below
from hapticeval.geometry.boundary import distance_between
from hapticeval.quantity import format_quantity
from hapticeval.types import Array

FEWEST = 4
"""Heights of a profile at the least: fewer make no periodic cubic."""

FAINT = 0.01
"""Share of a profile's largest harmonic below which one is not felt, and may be aliased."""

BARE_PROBES, SHALLOW, TWICE = 16, 1e-4, 2.0
"""Places at which a renderer is asked for its bare answer, the depth there as a share of the model's size, and the
share of the hand's step by which a foot that jumps is told from one that moves."""

ALIKE = 1e-3
"""Share of the depth, and of K times the depth, by which a bare answer may differ from the nearest point's."""


@dataclass(frozen=True)
class Relief(Effect):
    """Base of height and bump maps: heights h (m) above the surface that repeat every `wavelength` (m).

    They are a sine of `amplitude` (m), or a `profile` of heights (m) that are evenly spaced over one wavelength, joined
    by a periodic cubic spline; in a suite also those of the column h of a `file` below its folder.

    - On a plane curve h is a function of the arc length; round a closed one the wavelength is rounded so that a whole
      number closes up.
    - In space h is a function of the foot's coordinate along `direction`, the x axis where none is given: plane waves
      that the surface cuts through, so that they close up on any surface.
    """

    wavelength: float = number("m")
    amplitude: float | None = number("m", zero=True, default=None)
    profile: tuple[float, ...] = ()
    direction: tuple[float, ...] = ()

    stage: ClassVar[Stage] = Stage.ANSWER
    linear: ClassVar[bool] = False

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("profile", "direction"):
            object.__setattr__(self, name, tuple(float(component) for component in getattr(self, name)))
            if not np.isfinite(getattr(self, name)).all():
                raise InputError(f"the {self.kind}'s {name} has numbers that are not finite")
        if (self.amplitude is None) is (not self.profile):
            raise InputError(
                f"a {self.kind} with {'neither' if self.amplitude is None else 'both'} an amplitude and a profile",
                why="its heights are those of a sine, or of a profile",
                todo="give one of them",
            )
        if self.profile and len(self.profile) < FEWEST:
            raise InputError(
                f"a {self.kind} with a profile of {len(self.profile)} heights",
                why=f"a periodic cubic goes through at least {FEWEST}",
                todo="give more of them, evenly spaced over a wavelength",
            )

    @classmethod
    def read(cls, numbers: Mapping[str, Any], folder: Path) -> Mapping[str, Any]:
        """Return the numbers of a table, with the profile of the `file` that it names: a table's column h, m."""
        if "file" not in numbers:
            return numbers
        from hapticeval.recordings.formats import read_table

        heights = read_table(file_below(folder, str(numbers["file"])))["h"]
        return {name: value for name, value in numbers.items() if name != "file"} | {"profile": heights}

    @property
    def off(self) -> bool:
        """Whether it is flat."""
        return not any(self.profile) if self.profile else self.amplitude == 0.0

    @property
    def finest(self) -> float:
        """The shortest wavelength (m) that is felt: of a profile that of its highest harmonic that is not faint."""
        if not self.profile:
            return self.wavelength
        harmonics = np.abs(np.fft.rfft(self.profile))[1:]
        return self.wavelength / float(1 + np.flatnonzero(harmonics >= FAINT * harmonics.max())[-1])

    @property
    def highest(self) -> float:
        """How far (m) the relief is off the bare surface at the most."""
        return self.amplitude if self.amplitude is not None else float(np.max(np.abs(self.profile)))

    def fastest(self, dt: float) -> float:
        """Return the speed (m/s) along the waves beyond which samples every `dt` s alias them: finest / (2 dt)."""
        return self.finest / (2.0 * dt)

    def describe(self, *, turning: bool) -> str:  # noqa: ARG002 - as every effect
        """Describe the relief with its size and wavelength."""
        amplitude = self.amplitude if self.amplitude is not None else 0.5 * float(np.ptp(self.profile))
        wavelength = format_quantity(1e3 * self.wavelength, "mm")
        return f"{self.kind} of {format_quantity(1e6 * amplitude, 'um')} every {wavelength}"

    def fits(self, scene: Calling) -> None:
        """Raise `InputError` for a direction in the plane, and for one in space that is none."""
        size = scene.model.dimension
        if not self.direction:
            return
        if size == 2 or len(self.direction) != size or not any(self.direction):
            raise InputError(
                f"a {self.kind} along {list(self.direction)} on model '{scene.model.name}'",
                why="waves run along the curve in the plane" if size == 2 else "a direction in space is three numbers",
                todo="leave direction out",
            )

    def check_path(self, scene: Calling, hips: Array) -> None:
        """Raise `InputError` where HIPs (n, N), m, cross the waves faster than their samples can show."""
        dt, boundary = scene.sampling_time, scene.model.boundary
        surface = boundary.closest_point(hips)
        highest = self.amplitude if self.amplitude is not None else max(self.profile)
        pressed = (surface.distance < highest) | scene.bilateral
        foot_step = np.diff(surface.foot, axis=0)
        # Between two samples the foot moves by at most the hand's step over 1 - kappa d, or it jumped to another branch
        # of the surface: that is not motion along the waves.
        curvature = np.abs(np.linalg.eigvalsh(surface.shape)).max(axis=1)
        stretch = np.maximum(1.0 - curvature * np.abs(surface.distance), ALIKE)
        foot_length, hand_length = np.linalg.norm(foot_step, axis=1), np.linalg.norm(np.diff(hips, axis=0), axis=1)
        slides = (
            pressed[1:] & pressed[:-1] & (foot_length <= TWICE * hand_length / np.minimum(stretch[1:], stretch[:-1]))
        )
        crossed = np.abs(foot_step @ self._unit) if scene.model.dimension == 3 else foot_length
        speed = np.where(slides, crossed, 0.0) / dt
        worst = int(np.argmax(speed, axis=0)) if speed.size else 0
        if not speed.size or speed[worst] <= self.fastest(dt) * (1.0 + ALIKE):
            return
        # the frequency folded at multiples of the sampling rate: what samples make of it, Hz
        frequency = float(speed[worst]) / self.finest
        alias = abs(frequency - round(frequency * dt) / dt)
        raise InputError(
            f"the path crosses the {self.kind}'s waves of {1e3 * self.finest:g} mm at {speed[worst]:.4g} m/s, "
            f"{worst * dt:.4g} s after its start",
            why=f"that is {frequency:.4g} Hz: sampled every {1e3 * dt:g} ms it would be felt as {alias:.4g} Hz",
            todo=f"stay below wavelength / (2 dt) = {self.fastest(dt):.4g} m/s, sample faster, or take longer waves",
        )

    @property
    def _unit(self) -> Array:
        direction = np.array(self.direction or (1.0, 0.0, 0.0))
        return np.asarray(direction / np.linalg.norm(direction))

    def _part(self, scene: Calling, function: Callable[..., int]) -> Part:
        """Assemble a change: `params` as `relief_kernels` names them, the spline's cells, and rows of N to work in."""
        from hapticeval.effects.relief_kernels import RELIEF
        from hapticeval.geometry.boundary import closest_of
        from hapticeval.records import numbers_of

        boundary, size = scene.model.boundary, scene.model.dimension
        wavelength, unit = self.wavelength, self._unit
        if size == 2:
            if closest_of(boundary) is None:
                raise RefusalError(
                    f"a {self.kind} on model '{scene.model.name}'",
                    why="its heights are a function of the arc length, which the boundary does not give",
                )
            unit = np.zeros(3)
            if boundary.closed:  # a whole number of waves, so that the relief closes up
                wavelength = boundary.girth / max(1, round(boundary.girth / wavelength))
        cells = np.empty((0, 0))
        if self.profile:
            from scipy.interpolate import CubicSpline

            count = len(self.profile)
            spline = CubicSpline(np.arange(count + 1.0), [*self.profile, self.profile[0]], bc_type="periodic")
            cells = np.ascontiguousarray(spline.c.T)
        params = numbers_of(
            RELIEF, stiffness=scene.stiffness, bilateral=scene.bilateral, wave=wavelength,
            amplitude=self.amplitude or 0.0, unit=unit,
        )  # fmt: skip
        return Part(function, params, cells, np.zeros((5 + size, size)))


@dataclass(frozen=True)
class HeightMap(Relief):
    """Raise the surface by h, with the spring's potential U = K (d + h)^2 / 2 at depth d under the bare surface.

    F = -grad U = K (d + h) (n - (I - d W)^-1 grad h), with W the shape operator of the bare surface and grad h along
    it: in the plane -K (d + h) h' / (1 - kappa d) along the curve.

    The tool is in contact where d + h > 0, and the IHIP is at foot + h n. What the renderer adds to its spring, such as
    a damper, is kept where it has contact itself.
    """

    kind: ClassVar[str] = "height-map"
    domain_exits: ClassVar[dict[int, str]] = {
        1: "a height map needs an IHIP that is the nearest point of the surface, and the renderer's is not",
        2: "a height map ends at the medial axis, where the surface has no nearest point",
    }

    def fits(self, scene: Calling) -> None:
        """Raise `InputError` for a model with corners too, where a slope has no direction."""
        super().fits(scene)
        if scene.model.boundary.corners:
            raise InputError(
                f"a {self.kind} on model '{scene.model.name}', which has corners",
                why="at a corner the surface has no one normal, and its relief no slope",
                todo="choose a smooth model, or a bump-map",
            )

    def check_base(self, scene: Calling, ask: Ask) -> None:
        """Raise `RefusalError` unless a hand at rest gets the nearest point, and K times the depth."""
        boundary = scene.model.boundary
        surface = boundary.closest_point(boundary.points(BARE_PROBES))
        depth = SHALLOW * scene.model.size
        for foot, normal in zip(surface.foot, surface.normal, strict=True):
            hip = foot - depth * normal
            ihip, force = ask(foot + depth * normal, hip)
            spring = scene.stiffness * (foot - hip)
            off_foot = distance_between(ihip, foot) / depth
            off_spring = distance_between(force, spring) / float(np.linalg.norm(spring))
            if max(off_foot, off_spring) > ALIKE:
                refusal = RefusalError(
                    "the scene calls for height-map",
                    why="that is the potential of a spring to the nearest point, and at "
                    f"({', '.join(f'{x:.4g}' for x in hip)}) m the renderer answers another IHIP or force",
                    todo="choose a renderer of the nearest point with a linear spring, such as minimum-distance; one "
                    "of your own that shows height maps declares so in supports",
                )
                refusal.position = tuple(float(x) for x in foot)
                raise refusal

    def change(self, scene: Calling) -> Part:
        """See `Effect.change`."""
        from hapticeval.effects.relief_kernels import raise_surface

        return self._part(scene, raise_surface)


@dataclass(frozen=True)
class BumpMap(Relief):
    """Turn the force's part along the normal n to n' = (n - grad h) / |n - grad h|, as large as it is.

    That is (4.16) with A = -grad h and the normal renormalised, on the answer of any renderer.

    The depth does not change, so that the force is not a gradient: round a loop between depths d1 and d2, a quarter of
    a wave long, it gives or takes K (d2 - d1) (wavelength / 2 pi) atan a - K (d2^2 - d1^2) (1 - cos atan a) / 2 with a
    = 2 pi amplitude / wavelength.
    """

    kind: ClassVar[str] = "bump-map"

    def change(self, scene: Calling) -> Part:
        """See `Effect.change`."""
        from hapticeval.effects.relief_kernels import turn_normal

        return self._part(scene, turn_normal)

    def active(self, damping: float) -> str | None:  # noqa: ARG002 - as every effect
        """Return why it gives energy away, which it does with any renderer."""
        return "turning the normal alone, (4.16), has no potential"
