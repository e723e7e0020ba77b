"""What the closed loop does in continuous time, where mathematics says it: Tables 6.1 and 6.2, (7.28) and (7.38).

The equations of motion, each beside the formula that is printed of it, and the motions that follow. In the formulas k,
d and b are `Gains`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from hapticeval.devices.inner_loop import InnerLoop
from hapticeval.devices.point_mass import PointMass
from hapticeval.effects.catalogue import FORCE_SENSOR, VISCOSITY
from hapticeval.errors import InputError
from hapticeval.geometry.curve import Curve
from hapticeval.renderer import SCHEMES
from hapticeval.scene import Scene
from hapticeval.types import Array

RELATIVE_TOLERANCE, ABSOLUTE_TOLERANCE = 3e-14, 1e-16
"""Tolerances of the integration (DOP853) where no formula solves the equations."""

Rates = Callable[[float, Array], Sequence[float]]

POLAR = "r is the distance from the centre, R the {shape}'s radius, θ the {angle}."
LETTERS: Mapping[str, str] = MappingProxyType(
    {
        "line": "n is the distance from the line, s the way along it.",
        "circle": POLAR.format(shape="circle", angle="polar angle"),
        "sphere": POLAR.format(shape="sphere", angle="angle along the great circle"),
        "curve": "n is the distance from the curve, s the arc length of its foot, κ the curvature there, and "
        "w = (1 + n κ) s′ the tool's speed along the curve.",  # noqa: RUF001
    }
)
"""What the letters of a formula mean, by shape."""


class Gains(NamedTuple):
    """Per unit mass of the tool, as Tables 6.1 and 6.2 have them: `k` = K_p / m (1/s^2), `d` = K_d / m and `b` =
    b_d / m (1/s)."""

    k: float
    d: float
    b: float


def formula(shape: str, scheme: str) -> tuple[str, str]:
    """Return the equations of motion across the surface and along it, as people write them.

    Those of `transversal` and `sliding` about a line, of `polar_rates` on circle and sphere, and of `curve_rates`; of
    set stabilisation on a curve `transversal` and `sliding`, a law of s and not of w.
    """
    polar = shape in ("circle", "sphere")
    damping = "" if scheme == "pp" else f" − d {'r' if polar else 'n'}′"  # noqa: RUF001
    adds_centripetal = scheme == "pp-pd-c"
    if scheme == "set-stabilisation":
        return ("r″ = −k (r − R) − d r′", "θ″ = −b θ′") if polar else ("n″ = −k n − d n′", "s″ = −b s′")  # noqa: RUF001
    if shape == "line":
        return f"n″ = −k n{damping}", f"s″ = {'−d s′' if scheme == 'pp-v' else '0'}"  # noqa: RUF001
    if polar:
        drag = {"pp-v": "(2 r′ + d r)", "pp-d": "(2 r′ + d (r − R))"}.get(scheme, "2 r′")  # noqa: RUF001
        return f"r″ = −k (r − R) + r θ′²{' − (r θ′)² / R' if adds_centripetal else ''}{damping}", f"θ″ = −{drag} θ′ / r"  # noqa: RUF001
    drag = {"pp-v": " − d w", "pp-d": " − d n κ s′"}.get(scheme, "")  # noqa: RUF001
    return f"n″ = κ w s′{' − κ w²' if adds_centripetal else ''} − k n{damping}", f"w′ = −κ n′ s′{drag}"  # noqa: RUF001


def drag(scheme: str, gains: Gains) -> float:
    """The rate (1/s) at which the speed along a straight surface decays."""
    return {"pp-v": gains.d, "set-stabilisation": gains.b}.get(scheme, 0.0)


def sliding_motion(drag: float, speed: float, time: Array) -> tuple[Array, Array]:
    """s(t) and its rate for s'' = -drag s', s(0) = 0."""
    if drag == 0.0:
        return speed * time, np.full_like(time, speed)
    return -speed / drag * np.expm1(-drag * time), speed * np.exp(-drag * time)


def transversal_motion(gains: Gains, scheme: str, start: float, rate: float, time: Array) -> tuple[Array, Array]:
    """n(t) and its rate for n'' = -k n - d n' (7.28), (7.38); d counts for nothing under PP (6.19)."""
    d = 0.0 if scheme == "pp" else gains.d
    half = 0.5 * d
    root = np.sqrt(complex(half * half - gains.k))
    if abs(root) < 1e-6 * math.sqrt(gains.k):
        slope = rate + half * start
        decay = np.exp(-half * time)
        return decay * (start + slope * time), decay * (slope - half * (start + slope * time))
    fast, slow = -half - root, -half + root
    p, q = (rate - fast * start) / (slow - fast), (slow * start - rate) / (slow - fast)
    grown, faded = p * np.exp(slow * time), q * np.exp(fast * time)
    return np.real(grown + faded), np.real(slow * grown + fast * faded)


def polar_rates(scheme: str, gains: Gains, radius: float) -> Rates:
    """d/dt (r, r', theta, theta'): (6.24) PP, (6.25) PP+V, (6.26) PP+PD, (6.27) PP+D, (7.38) set stabilisation.

    PP+PD with the centripetal force added has (6.26) less (r theta')^2 / r_c.
    """
    k, d, b = gains

    def rates(time: float, state: Array) -> Sequence[float]:  # noqa: ARG001 - the integrator's
        r, r_rate, _, rate = state
        if scheme == "set-stabilisation":
            return r_rate, -k * (r - radius) - d * r_rate, rate, -b * rate
        damping = 0.0 if scheme == "pp" else d * r_rate
        drag = {"pp-v": d * r, "pp-d": d * (r - radius)}.get(scheme, 0.0)
        centripetal = (r * rate) ** 2 / radius if scheme == "pp-pd-c" else 0.0
        return r_rate, -k * (r - radius) + r * rate**2 - centripetal - damping, rate, -(2.0 * r_rate + drag) * rate / r

    return rates


def curve_rates(scheme: str, gains: Gains, curve: Curve) -> Rates:
    """d/dt (n, n', s, w) of a projective scheme on any smooth curve, w = (1 + n kappa) s' being the tool's own speed.

    n'' = kappa (1 + n kappa) s'^2 - k n - d n' and (1 + n kappa) s'' + 2 kappa n' s' + n kappa_s s'^2 = the scheme's
    tangential acceleration. In w the second reads w' = that - kappa n' s', free of the curvature's slope.
    """
    k, d, _ = gains

    def rates(time: float, state: Array) -> Sequence[float]:  # noqa: ARG001 - the integrator's
        n, n_rate, s, w = state
        kappa = float(curve.curvature(curve.parameter(s)))
        rate = w / (1.0 + n * kappa)
        damping = 0.0 if scheme == "pp" else d * n_rate
        drag = {"pp-v": d * w, "pp-d": d * n * kappa * rate}.get(scheme, 0.0)
        centripetal = kappa * w * w if scheme == "pp-pd-c" else 0.0
        return n_rate, kappa * w * rate - centripetal - k * n - damping, rate, -kappa * n_rate * rate - drag

    return rates


def integrate_rates(rates: Rates, start: Sequence[float], time: Array) -> Array:
    """The states (k, n) at `time` (n,), by DOP853 at its tightest tolerance. Raises `InputError` where it cannot."""
    from scipy.integrate import solve_ivp

    if time.size < 2:
        return np.tile(np.array(start, dtype=np.float64)[:, np.newaxis], (1, time.size))
    solution = solve_ivp(
        rates,
        (time[0], time[-1]),
        start,
        method="DOP853",
        t_eval=time,
        rtol=RELATIVE_TOLERANCE,
        atol=ABSOLUTE_TOLERANCE,
    )
    if not solution.success:
        raise InputError("the closed form cannot be integrated", why=str(solution.message))
    return np.asarray(solution.y, dtype=np.float64)


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
    def formula(self) -> tuple[str, str]:
        """The equations of motion across the surface and along it, an equation each, as people write them."""
        return formula(self.shape, self.scheme)

    @property
    def letters(self) -> str:
        """What the letters of `formula` mean."""
        return LETTERS[self.shape]

    def check(self, scene: Scene) -> None:
        """Raise `InputError` for a scene that this form is not about."""
        name = scene.model.name
        fits = {
            "line": name == "line",
            "circle": name == "circle",
            "sphere": name == "sphere",
            "curve": scene.model.dimension == 2 and not scene.model.boundary.corners,
        }[self.shape]
        if not fits:
            raise InputError(
                f"the closed form {self.name} is about a {self.shape}, and the model is '{name}'",
                why="it holds for smooth curves alone" if self.shape == "curve" else "",
                todo=f"for this shape there are: {', '.join(_forms_about(name))}"
                if _forms_about(name)
                else "leave it out",
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
        gains = Gains(*(gain / scene.mass for gain in (scene.stiffness, scene.damping, scene.viscosity)))
        frame = scene.model.boundary.closest_point(np.asarray(position, dtype=np.float64)[np.newaxis])
        normal, distance, foot = frame.normal[0], float(frame.distance[0]), frame.foot[0]
        across = float(velocity @ normal)
        along = velocity - across * normal
        if self.shape == "curve":
            return _motion_on_curve(self.scheme, gains, scene.model.curve, foot, (distance, across), velocity, time)
        speed = float(np.linalg.norm(along))
        tangent = along / speed if speed > 0.0 else _any_tangent(normal)
        if self.shape == "line":
            n, n_rate = transversal_motion(gains, self.scheme, distance, across, time)
            s, s_rate = sliding_motion(drag(self.scheme, gains), speed, time)
            return Motion(
                foot + np.outer(s, tangent) + np.outer(n, normal), np.outer(s_rate, tangent) + np.outer(n_rate, normal)
            )
        radius = float((frame.foot.shape[1] - 1) / np.trace(frame.shape[0]))
        centre = foot - radius * normal
        polar = _polar_motion(
            self.scheme, gains, radius, (radius + distance, across, speed / (radius + distance)), time
        )
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


def _polar_motion(
    scheme: str, gains: Gains, radius: float, start: tuple[float, float, float], time: Array
) -> tuple[Array, Array, Array, Array]:
    """(r, r', theta, theta') from (r, r', theta') at angle zero."""
    r, r_rate, rate = start
    if scheme == "set-stabilisation":
        n, n_rate = transversal_motion(gains, scheme, r - radius, r_rate, time)
        angle, turning = sliding_motion(gains.b, rate, time)
        return radius + n, n_rate, angle, turning
    solved = integrate_rates(polar_rates(scheme, gains, radius), (r, r_rate, 0.0, rate), time)
    return solved[0], solved[1], solved[2], solved[3]


def _motion_on_curve(
    scheme: str, gains: Gains, curve: Curve, foot: Array, start: tuple[float, float], velocity: Array, time: Array
) -> Motion:
    u = float(curve.nearest(foot[np.newaxis])[0])
    s0, kappa = float(curve.arc_length(u)), float(curve.curvature(u))
    w0 = float(velocity @ curve.tangent(u))
    if scheme == "set-stabilisation":
        n, n_rate = transversal_motion(gains, scheme, *start, time)
        travelled, rate = sliding_motion(gains.b, w0 / (1.0 + start[0] * kappa), time)
        s = s0 + travelled
        w = rate * (1.0 + n * curve.curvature(curve.parameter(s)))
    else:
        n, n_rate, s, w = integrate_rates(curve_rates(scheme, gains, curve), (*start, s0, w0), time)
    at = curve.parameter(s)
    normal, tangent = curve.normal(at), curve.tangent(at)
    return Motion(
        curve.position(at) + n[:, np.newaxis] * normal, w[:, np.newaxis] * tangent + n_rate[:, np.newaxis] * normal
    )


def _forms_about(model: str) -> list[str]:
    shapes = {"line": ("line", "curve"), "circle": ("circle", "curve"), "sphere": ("sphere",)}.get(model, ("curve",))
    return [form.name for form in CLOSED_FORMS.values() if form.shape in shapes]


FORM_ROWS = (
    ("6.19", "pp", "line", "thesis Table 6.1, (6.19)"),
    ("6.20", "pp-v", "line", "thesis Table 6.1, (6.20)"),
    ("6.21", "pp-pd", "line", "thesis Table 6.1, (6.21), PP+D and PP+PD"),
    ("6.24", "pp", "circle", "thesis Table 6.2, (6.24)"),
    ("6.25", "pp-v", "circle", "thesis Table 6.2, (6.25)"),
    ("6.26", "pp-pd", "circle", "thesis Table 6.2, (6.26)"),
    ("6.27", "pp-d", "circle", "thesis Table 6.2, (6.27)"),
    ("7.28", "set-stabilisation", "line", "thesis (7.28), with (7.18)"),
    ("7.38", "set-stabilisation", "circle", "thesis (7.38), with (7.18)"),
    *((f"{scheme}-on-curve", scheme, "curve", "thesis 6.3 and 7.2 in the curve's own frame") for scheme in SCHEMES),
    *(
        (f"{scheme}-on-sphere", scheme, "sphere", "thesis 7.4: along a great circle, as on the circle")
        for scheme in SCHEMES
    ),
)
CLOSED_FORMS: Mapping[str, ClosedForm] = MappingProxyType({row[0]: ClosedForm(*row) for row in FORM_ROWS})
"""Every closed form by the name that a suite gives it."""

ALIKE_ON_A_LINE = ("pp-d", "pp-pd", "pp-pd-c")
"""Laws that differ on curved surfaces alone: about a line all are (6.21)."""


def form_of(scheme: str, scene: Scene) -> ClosedForm | None:
    """Return the closed form of a law in a scene, that in print before the general one; None where there is none.

    There is none where a robot moves that nothing linearises, or an effect acts that no form knows.
    """
    linear = scene.inner_loop is InnerLoop.LINEARISED or scene.robot == PointMass(scene.mass, scene.model.dimension)
    if not linear or not {effect.kind for effect in scene.effects} <= {VISCOSITY, FORCE_SENSOR}:
        return None
    law = "pp-pd" if scene.model.name == "line" and scheme in ALIKE_ON_A_LINE else scheme
    for form in CLOSED_FORMS.values():
        if form.scheme == law:
            with suppress(InputError):
                form.check(scene)
                return form
    return None
