"""A measured texture: filters that make vibrations of noise, each at a speed along the surface and a normal force."""

from __future__ import annotations

import math
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from msgspec import Struct, json, structs

from hapticeval.documents import convert, read_toml
from hapticeval.effects.line_spectra import coefficients_of
from hapticeval.errors import InputError, UnknownNameError, at
from hapticeval.types import Array, IntArray

LONGEST = 32
"""Most frequencies of one filter."""


LOUDEST = 1e100
"""(m/s^2)^2: most power of the noise of a filter, *chosen*, so that its squares stay inside the float range."""


class Filter(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Vibrations at one speed (m/s) along the surface and one normal force (N).

    y = gain B/A sqrt(variance) w, m/s^2, of white noise w with variance 1. `ar` and `ma` are line spectral frequencies
    (rad) of A and B, see `line_spectra`, and `variance` is in (m/s^2)^2.
    """

    speed: float
    force: float
    variance: float
    ar: tuple[float, ...] = ()
    ma: tuple[float, ...] = ()
    gain: float = 1.0


class Texture(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Filters at points of the (speed, force) plane, made for samples at `rate` (Hz).

    Between them, line spectral frequencies, variances and gains are interpolated over `triangles` of filters, counted
    from 0; where none are given they are Delaunay's, of speeds and forces as shares of the largest.

    `friction` is the coefficient that was measured with them, for who combines them with a friction. Raises
    `InputError` for what is not finite, negative, unstable, or no triangulation.
    """

    title: str
    rate: float
    filters: tuple[Filter, ...]
    friction: float | None = None
    triangles: tuple[tuple[int, int, int], ...] = ()

    def __post_init__(self) -> None:
        with at(f"texture '{self.title}'"):
            if not (math.isfinite(self.rate) and self.rate > 0.0):
                raise InputError(f"rate = {self.rate!r} Hz", why="it must be finite and positive")
            if self.friction is not None and not (math.isfinite(self.friction) and self.friction >= 0.0):
                raise InputError(f"friction = {self.friction!r}", why="it must be finite and not negative")
            for number, filter_ in enumerate(self.filters):
                with at(f"filter {number}"):
                    _check(filter_, self.filters[0])
            corners = np.array(self.triangles, dtype=np.int64).reshape(-1, 3)
            if corners.size and not (corners.min() >= 0 and corners.max() < len(self.filters)):
                raise InputError(
                    f"its triangles name filters {corners.min()} to {corners.max()}",
                    why=f"there are {len(self.filters)}, counted from 0",
                )
            if len(self.filters) < 3 or not np.all(np.abs(self._areas(self.corners())) > 0.0):
                raise InputError(
                    f"its {len(self.filters)} filters span no triangles",
                    why="speed and force are interpolated between three filters that are not in a line",
                    todo="give filters at three or more points of the (speed, force) plane",
                )

    def corners(self) -> IntArray:
        """Return the filters at the corners of each triangle, (t, 3)."""
        if self.triangles:
            return np.array(self.triangles, dtype=np.int64)
        from scipy.spatial import Delaunay, QhullError

        try:
            return np.asarray(Delaunay(self.places() / self.scale()).simplices, dtype=np.int64)
        except QhullError:
            return np.zeros((1, 3), dtype=np.int64)

    def places(self) -> Array:
        """Return the speeds (m/s) and normal forces (N) that the filters were measured at, (m, 2)."""
        return np.array([(filter_.speed, filter_.force) for filter_ in self.filters], dtype=np.float64)

    def scale(self) -> Array:
        """Return the largest speed and force, (2,), in shares of which the plane is measured."""
        return np.asarray(np.maximum(self.places().max(axis=0), np.finfo(np.float64).tiny))

    def _areas(self, corners: IntArray) -> Array:
        a, b, c = np.moveaxis((self.places() / self.scale())[corners], 1, 0)
        return np.asarray((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])

    def between(self, speed: float, force: float) -> Filter:
        """Return the filter at a speed (m/s) and force (N), as the kernel interpolates it."""
        from hapticeval.effects.texture_kernels import filters_at

        rows = self.rows()
        triangle, *shares = filters_at(rows, len(self.filters), speed, force, 0)
        mixed = np.zeros(rows.shape[1])
        for corner, share in zip(rows[len(self.filters) + triangle, :3], shares, strict=True):
            mixed += share * rows[int(corner)]
        p, q = len(self.filters[0].ar), len(self.filters[0].ma)
        return Filter(
            speed=float(mixed[0]),
            force=float(mixed[1]),
            variance=float(mixed[2]),
            gain=float(mixed[3]),
            ar=tuple(mixed[4 : 4 + p].tolist()),
            ma=tuple(mixed[4 + p : 4 + p + q].tolist()),
        )

    def rows(self) -> Array:
        """Return the filters, and then the triangles, as `texture_kernels` takes them: (m + t, k)."""
        first, corners = self.filters[0], self.corners()
        count, width = len(self.filters), max(4 + len(first.ar) + len(first.ma), 14)
        rows = np.zeros((count + len(corners), width))
        for row, filter_ in zip(rows, self.filters, strict=False):
            row[: 4 + len(filter_.ar) + len(filter_.ma)] = (
                filter_.speed, filter_.force, filter_.variance, filter_.gain, *filter_.ar, *filter_.ma,
            )  # fmt: skip
        sorted_edges = [
            tuple(sorted((one, other))) for a, b, c in corners.tolist() for one, other in ((b, c), (c, a), (a, b))
        ]
        scaled = self.places() / self.scale()
        for k, triangle in enumerate(corners):
            row = rows[count + k]
            row[:3] = triangle
            # the affine functions that are 1 at one corner of the triangle and 0 at the two others
            # Share i of a point is rows[3 + 3 i] + rows[4 + 3 i] speed + rows[5 + 3 i] force; the third is the rest.
            inverse = np.linalg.inv(np.column_stack([np.ones(3), scaled[triangle]])).T
            for i in range(2):
                row[3 + 3 * i : 6 + 3 * i] = inverse[i] / np.array([1.0, *self.scale()])
            # The sides that no other triangle shares are the hull: of each the corner that it lies across from.
            row[9:12] = [sorted_edges.count(sorted_edges[3 * k + i]) == 1 for i in range(3)]
        rows[count:, 12:14] = self.scale()
        return rows


def _check(filter_: Filter, first: Filter) -> None:
    for name, value in (("speed", filter_.speed), ("force", filter_.force), ("variance", filter_.variance)):
        if not (math.isfinite(value) and value >= 0.0):
            raise InputError(f"{name} = {value!r}", why="it must be finite and not negative")
    if not filter_.gain * filter_.gain * filter_.variance <= LOUDEST:
        raise InputError(
            f"gain = {filter_.gain!r}, variance = {filter_.variance!r}",
            why=f"gain squared times the variance must be finite, and {LOUDEST:g} (m/s^2)^2 at the most",
        )
    for name, spectrum, spectrum_of_first in (("ar", filter_.ar, first.ar), ("ma", filter_.ma, first.ma)):
        if len(spectrum) != len(spectrum_of_first) or len(spectrum) > LONGEST:
            raise InputError(
                f"{name} has {len(spectrum)} frequencies, and that of the first filter {len(spectrum_of_first)}",
                why=f"all filters of a texture have as many, {LONGEST} at the most",
            )
        if not np.all(np.diff([0.0, *spectrum, math.pi]) > 0.0):
            raise InputError(
                f"{name} = {list(spectrum)}",
                why="line spectral frequencies ascend between 0 and pi, or the filter's "
                f"{'poles' if name == 'ar' else 'zeros'} are not inside the unit circle: it is unstable",
                todo="give those of a stable filter, see line_spectra.line_spectrum",
            )


def power_spectrum(filter_: Filter, rate: float, frequencies: Array) -> Array:
    """Return how a filter's vibrations are spread over frequencies (k,), Hz, at its sampling `rate` (Hz).

    That is the one-sided power spectral density (k,), (m/s^2)^2/Hz: 2 / rate gain^2 variance |B|^2 / |A|^2.
    """
    unit_delay = np.exp(-2j * np.pi * frequencies / rate)
    numerator, denominator = (
        np.abs(np.polynomial.polynomial.polyval(unit_delay, np.concatenate([[1.0], coefficients_of(spectrum)]))) ** 2
        for spectrum in (filter_.ma, filter_.ar)
    )
    return np.asarray(2.0 / rate * filter_.gain**2 * filter_.variance * numerator / denominator)


def autocovariance(filter_: Filter, count: int) -> Array:
    """Return the covariance (count,), (m/s^2)^2, of a filter's vibrations with themselves 0, 1, ... samples later.

    It is the inverse Fourier transform of the power spectrum (Wiener and Khinchin).
    """
    fft_length = 16 * max(count, 4096)
    # sampled finely, so that what wraps round is the covariance of some 60,000 samples apart or more
    half = power_spectrum(filter_, 1.0, np.arange(fft_length // 2 + 1) / fft_length)
    return np.asarray(np.fft.irfft(0.5 * half, fft_length)[:count])


def shipped() -> dict[str, Path]:
    """Return our own textures: name -> file."""
    folder = Path(str(files("hapticeval.effects"))) / "textures"
    return {file.stem: file for file in sorted(folder.glob("*.toml"))}


@cache
def named(name: str) -> Texture:
    """Return our own texture of that name. Raises `UnknownNameError`, with the closest."""
    known = shipped()
    if name not in known:
        raise UnknownNameError("texture", name, known)
    return read_texture(known[name])


def read_texture(file: Path) -> Texture:
    """Read a texture from a TOML file. Raises `InputError`, naming it, for what is not a texture."""
    return convert(read_toml(file), Texture, file.name, todo="see docs/effects.md")


def as_document(texture: Texture) -> dict[str, Any]:
    """Return a texture as JSON values, without what has its default."""
    document: dict[str, Any] = json.decode(json.encode(texture))
    defaults = {field.name: field.default for field in structs.fields(Texture)}
    return {name: value for name, value in document.items() if value not in (defaults[name], [])}
