"""What the closed loop does in continuous time, where mathematics says it: Tables 6.1 and 6.2, (7.28) and (7.38)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from hapticeval.closed_forms.equations import (
    CURVE_LETTERS,
    LINE_LETTERS,
    POLAR_LETTERS,
    Formula,
    Gains,
    curve_formula,
    curve_rates,
    drag,
    integrated,
    line_formula,
    polar_formula,
    polar_rates,
    sliding,
    transversal,
)
from hapticeval.effects.viscosity import viscosity_of
from hapticeval.errors import InputError
from hapticeval.geometry.curve import Curve
from hapticeval.scene import Scene
from hapticeval.types import Array

SCHEMES = ("pp", "pp-v", "pp-d", "pp-pd", "pp-pd-c", "set-stabilisation")
"""The laws that have closed forms, by the names of their regulation schemes; `pp-pd-c` adds m kappa w^2 to PP+PD."""


_FORMULAS: Mapping[str, Callable[[str], Formula]] = MappingProxyType(
    {"line": line_formula, "circle": polar_formula, "sphere": polar_formula, "curve": curve_formula}
)
_LETTERS: Mapping[str, str] = MappingProxyType(
    {
        "line": LINE_LETTERS,
        "circle": POLAR_LETTERS.format(shape="circle", angle="polar angle"),
        "sphere": POLAR_LETTERS.format(shape="sphere", angle="angle along the great circle"),
        "curve": CURVE_LETTERS,
    }
)


class Motion(NamedTuple):
    """Where the tool is and how fast: `hip` (n, N), m, and `velocity` (n, N), m/s."""

    hip: Array
    velocity: Array


@dataclass(frozen=True)
class ClosedForm:
    """The motion that `scheme` gives on a bilateral constraint of `shape`, with no hand and nothing sampled.

    It is that of the point mass, and of any robot behind an ideal feedback linearisation (6.7), which moves alike.
    `name` is the equation's number, or scheme and shape where the thesis has none.
    """

    name: str
    scheme: str
    shape: str
    citation: str

    @property
    def formula(self) -> Formula:
        """The equations of motion across the surface and along it, an equation each, as people write them."""
        return _FORMULAS[self.shape](self.scheme)

    @property
    def letters(self) -> str:
        """What the letters of `formula` mean."""
        return _LETTERS[self.shape]

    def check(self, scene: Scene) -> None:
        """Raise `InputError` for a scene that this form is not about."""
        name = scene.model.name
        fits = {
            "line": name == "line",
            "circle": name == "circle",
            "sphere": name == "sphere",
            "curve": scene.model.dimension == 2 and not scene.model.curve.corners,
        }[self.shape]
        if not fits:
            raise InputError(
                f"the closed form {self.name} is about a {self.shape}, and the model is '{name}'",
                why="it holds for smooth curves alone" if self.shape == "curve" else "",
                todo=f"for this shape there are: {', '.join(_about(name))}" if _about(name) else "leave it out",
            )
        if not scene.bilateral:
            raise InputError(
                f"the closed form {self.name} is about a constraint that holds from both sides",
                why="where contact breaks the equations change",
                todo="say bilateral = true in the scene",
            )

    def motion(self, scene: Scene, position: Array, velocity: Array, time: Array) -> Motion:
        """From `position` (N,), m, with `velocity` (N,), m/s, at each of `time` (n,), s, which starts at zero.

        Raises `InputError` for a scene that this form is not about.
        """
        self.check(scene)
        gains = Gains(*(gain / scene.mass for gain in (scene.stiffness, scene.damping, viscosity_of(scene))))
        frame = scene.model.boundary.frame(np.asarray(position, dtype=np.float64)[np.newaxis])
        normal, distance, foot = frame.normal[0], float(frame.distance[0]), frame.foot[0]
        across = float(velocity @ normal)
        along = velocity - across * normal
        if self.shape == "curve":
            return _on_curve(self.scheme, gains, scene.model.curve, foot, (distance, across), velocity, time)
        speed = float(np.linalg.norm(along))
        tangent = along / speed if speed > 0.0 else _any_tangent(normal)
        if self.shape == "line":
            n, n_rate = transversal(gains, self.scheme, distance, across, time)
            s, s_rate = sliding(drag(self.scheme, gains), speed, time)
            return Motion(
                foot + np.outer(s, tangent) + np.outer(n, normal), np.outer(s_rate, tangent) + np.outer(n_rate, normal)
            )
        radius = float((frame.foot.shape[1] - 1) / np.trace(frame.shape[0]))
        centre = foot - radius * normal
        polar = _polar(self.scheme, gains, radius, (radius + distance, across, speed / (radius + distance)), time)
        r, r_rate, angle, rate = polar
        out = np.outer(np.cos(angle), normal) + np.outer(np.sin(angle), tangent)
        aside = np.outer(np.cos(angle), tangent) - np.outer(np.sin(angle), normal)
        return Motion(centre + r[:, np.newaxis] * out, r_rate[:, np.newaxis] * out + (r * rate)[:, np.newaxis] * aside)


def _any_tangent(normal: Array) -> Array:
    if normal.size == 2:
        return np.array([-normal[1], normal[0]])
    axis = np.zeros(3)
    axis[int(np.argmin(np.abs(normal)))] = 1.0
    tangent = np.cross(normal, axis)
    return np.asarray(tangent / np.linalg.norm(tangent))


def _polar(
    scheme: str, gains: Gains, radius: float, start: tuple[float, float, float], time: Array
) -> tuple[Array, Array, Array, Array]:
    """(r, r', theta, theta') from (r, r', theta') at angle zero."""
    r, r_rate, rate = start
    if scheme == "set-stabilisation":
        n, n_rate = transversal(gains, scheme, r - radius, r_rate, time)
        angle, turning = sliding(gains.b, rate, time)
        return radius + n, n_rate, angle, turning
    solved = integrated(polar_rates(scheme, gains, radius), (r, r_rate, 0.0, rate), time)
    return solved[0], solved[1], solved[2], solved[3]


def _on_curve(
    scheme: str, gains: Gains, curve: Curve, foot: Array, start: tuple[float, float], velocity: Array, time: Array
) -> Motion:
    u = float(curve.nearest(foot[np.newaxis])[0])
    s0, kappa = float(curve.arc_length(u)), float(curve.curvature(u))
    w0 = float(velocity @ curve.tangent(u))
    if scheme == "set-stabilisation":
        n, n_rate = transversal(gains, scheme, *start, time)
        travelled, rate = sliding(gains.b, w0 / (1.0 + start[0] * kappa), time)
        s = s0 + travelled
        w = rate * (1.0 + n * curve.curvature(curve.parameter(s)))
    else:
        n, n_rate, s, w = integrated(curve_rates(scheme, gains, curve), (*start, s0, w0), time)
    at = curve.parameter(s)
    normal, tangent = curve.normal(at), curve.tangent(at)
    return Motion(
        curve.position(at) + n[:, np.newaxis] * normal, w[:, np.newaxis] * tangent + n_rate[:, np.newaxis] * normal
    )


def _about(model: str) -> list[str]:
    shapes = {"line": ("line", "curve"), "circle": ("circle", "curve"), "sphere": ("sphere",)}.get(model, ("curve",))
    return [form.name for form in CLOSED_FORMS.values() if form.shape in shapes]


def _forms() -> list[ClosedForm]:
    numbered = [
        ClosedForm("6.19", "pp", "line", "thesis Table 6.1, (6.19)"),
        ClosedForm("6.20", "pp-v", "line", "thesis Table 6.1, (6.20)"),
        ClosedForm("6.21", "pp-pd", "line", "thesis Table 6.1, (6.21), PP+D and PP+PD"),
        ClosedForm("6.24", "pp", "circle", "thesis Table 6.2, (6.24)"),
        ClosedForm("6.25", "pp-v", "circle", "thesis Table 6.2, (6.25)"),
        ClosedForm("6.26", "pp-pd", "circle", "thesis Table 6.2, (6.26)"),
        ClosedForm("6.27", "pp-d", "circle", "thesis Table 6.2, (6.27)"),
        ClosedForm("7.28", "set-stabilisation", "line", "thesis (7.28), with (7.18)"),
        ClosedForm("7.38", "set-stabilisation", "circle", "thesis (7.38), with (7.18)"),
    ]
    curved = [
        ClosedForm(f"{scheme}-on-curve", scheme, "curve", "thesis 6.3 and 7.2 in the curve's own frame")
        for scheme in SCHEMES
    ]
    round_ = [
        ClosedForm(f"{scheme}-on-sphere", scheme, "sphere", "thesis 7.4: along a great circle, as on the circle")
        for scheme in SCHEMES
    ]
    return [*numbered, *curved, *round_]


CLOSED_FORMS: Mapping[str, ClosedForm] = MappingProxyType({form.name: form for form in _forms()})
"""Every closed form by the name that a suite gives it."""
