"""Exact motions of the closed loop in continuous time, to compare with: Tables 6.1 and 6.2, (7.28) and (7.38).

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
from hapticeval.renderer import SOLVED_LAWS
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
    """Gains per unit mass of the tool, as Tables 6.1 and 6.2 have them.

    `k` = K_p / m is in 1/s^2, `d` = K_d / m and `b` = b_d / m in 1/s.
    """

    k: float
    d: float
    b: float


def formula(shape: str, scheme: str) -> tuple[str, str]:
    """Return the equations of motion across the surface and along it, as people write them.

    Those of `transversal` and `sliding` about a line, of `polar_rates` on circle and sphere, and of `curve_rates`; of
    set stabilisation on a curve `transversal` and `sliding`, a law of s and not of w.
    """
    # On a sphere the tool stays on the great circle through its start: there the motion is that of the circle.
    polar = shape in ("circle", "sphere")
    # The spring alone, PP, damps nothing; every other law damps the motion across the surface by d.
    damping = "" if scheme == "pp" else f" − d {'r' if polar else 'n'}′"  # noqa: RUF001
    adds_centripetal = scheme == "pp-pd-c"
    if scheme == "set-stabilisation":
        # Set stabilisation cancels the coupling: across (7.28) or (7.38), along the viscous drag b of (7.18).
        return ("r″ = −k (r − R) − d r′", "θ″ = −b θ′") if polar else ("n″ = −k n − d n′", "s″ = −b s′")  # noqa: RUF001
    if shape == "line":
        # (6.19) to (6.21): on a line the two directions are decoupled.
        return f"n″ = −k n{damping}", f"s″ = {'−d s′' if scheme == 'pp-v' else '0'}"  # noqa: RUF001
    if polar:
        # (6.24) to (6.27): PP+V damps the tool's own speed r θ′, PP+D the turning error, of length r − R.
        drag = {"pp-v": "(2 r′ + d r)", "pp-d": "(2 r′ + d (r − R))"}.get(scheme, "2 r′")  # noqa: RUF001
        return f"r″ = −k (r − R) + r θ′²{' − (r θ′)² / R' if adds_centripetal else ''}{damping}", f"θ″ = −{drag} θ′ / r"  # noqa: RUF001
    # The same in the curve's own frame, with w the speed along the curve and n κ s′ that of the turning error.
    drag = {"pp-v": " − d w", "pp-d": " − d n κ s′"}.get(scheme, "")  # noqa: RUF001
    return f"n″ = κ w s′{' − κ w²' if adds_centripetal else ''} − k n{damping}", f"w′ = −κ n′ s′{drag}"  # noqa: RUF001


def drag(scheme: str, gains: Gains) -> float:
    """Return the rate (1/s) at which the speed along a straight surface decays: K_d / m (PP+V) or b_d / m of (7.18)."""
    return {"pp-v": gains.d, "set-stabilisation": gains.b}.get(scheme, 0.0)


def sliding_motion(drag: float, speed: float, time: Array) -> tuple[Array, Array]:
    """Return how far a tool slides along a straight surface, and how fast, where viscous drag alone slows it.

    s(t) (n,), m, and s'(t) (n,), m/s, at `time` (n,), s, of s'' = -drag s' with s(0) = 0 and s'(0) = `speed` (m/s).
    `drag` is in 1/s. (6.20) and (7.28) with (7.18) along the line.
    """
    # Without drag the limit of the formula below, which divides by it.
    if drag == 0.0:
        return speed * time, np.full_like(time, speed)
    return -speed / drag * np.expm1(-drag * time), speed * np.exp(-drag * time)


def transversal_motion(gains: Gains, scheme: str, start: float, rate: float, time: Array) -> tuple[Array, Array]:
    """Return the tool's distance from the surface, a damped spring's motion, where no curvature drives it.

    n(t) (n,), m, and n'(t) (n,), m/s, at `time` (n,), s, of n'' = -k n - d n' from `start` (m) and `rate` (m/s):
    (7.28), (7.38), and (6.19) to (6.21). Under PP d counts for nothing (6.19).
    """
    d = 0.0 if scheme == "pp" else gains.d
    # Roots of λ² + d λ + k = 0: λ = -d/2 ± sqrt(d²/4 - k), complex where the motion swings.
    half = 0.5 * d
    root = np.sqrt(complex(half * half - gains.k))
    # Critically damped, a double root: n = exp(-d t/2) (n0 + (n0' + d n0/2) t). The formula below would divide by zero.
    if abs(root) < 1e-6 * math.sqrt(gains.k):
        slope = rate + half * start
        decay = np.exp(-half * time)
        return decay * (start + slope * time), decay * (slope - half * (start + slope * time))
    fast, slow = -half - root, -half + root
    # n = p exp(slow t) + q exp(fast t), with p and q from n(0) and n'(0).
    p, q = (rate - fast * start) / (slow - fast), (slow * start - rate) / (slow - fast)
    # Complex roots are conjugate, and so the imaginary parts cancel.
    grown, faded = p * np.exp(slow * time), q * np.exp(fast * time)
    return np.real(grown + faded), np.real(slow * grown + fast * faded)


def polar_rates(scheme: str, gains: Gains, radius: float) -> Rates:
    """Return the equations of motion about a circle of a `radius` (m), in polar coordinates, for an integrator.

    They are d/dt (r, r', theta, theta') by (6.24) PP, (6.25) PP+V, (6.26) PP+PD, (6.27) PP+D and (7.38) set
    stabilisation. PP+PD with the centripetal force added has (6.26) less (r theta')^2 / r_c.
    """
    k, d, b = gains

    def rates(time: float, state: Array) -> Sequence[float]:  # noqa: ARG001 - the integrator's
        """Return the derivative (4,) of the `state` (4,): r (m), r' (m/s), theta (rad) and theta' (rad/s)."""
        r, r_rate, _, rate = state
        if scheme == "set-stabilisation":
            # (7.38), with the viscous drag of (7.18): radius and angle are decoupled.
            return r_rate, -k * (r - radius) - d * r_rate, rate, -b * rate
        damping = 0.0 if scheme == "pp" else d * r_rate
        # (6.25): the force -K_d ẏ has the tangential part d r θ'. (6.27): the error turns with the tool, d (r - R) θ'.
        drag = {"pp-v": d * r, "pp-d": d * (r - radius)}.get(scheme, 0.0)
        # (3.8) at the surface: the speed squared over the radius of curvature.
        centripetal = (r * rate) ** 2 / radius if scheme == "pp-pd-c" else 0.0
        # (6.24) to (6.27): r'' = -k (r - R) + r θ'² - damping, θ'' = -(2 r' + drag) θ' / r.
        return r_rate, -k * (r - radius) + r * rate**2 - centripetal - damping, rate, -(2.0 * r_rate + drag) * rate / r

    return rates


def curve_rates(scheme: str, gains: Gains, curve: Curve) -> Rates:
    """Return the equations of motion of a projective scheme about a smooth curve, in its own frame, for an integrator.

    They are d/dt (n, n', s, w), w = (1 + n kappa) s' being the tool's own speed along the curve, with a the scheme's
    tangential acceleration:

    - n'' = kappa (1 + n kappa) s'^2 - k n - d n';
    - (1 + n kappa) s'' + 2 kappa n' s' + n kappa_s s'^2 = a, or w' = a - kappa n' s', free of the curvature's slope.
    """
    k, d, _ = gains

    def rates(time: float, state: Array) -> Sequence[float]:  # noqa: ARG001 - the integrator's
        """Return the derivative (4,) of the `state` (4,): n (m), n' (m/s), s (m) and w (m/s)."""
        n, n_rate, s, w = state
        kappa = float(curve.curvature(curve.parameter(s)))
        # s': a tool at the distance n moves 1 + n κ times as fast as its foot on the curve.
        rate = w / (1.0 + n * kappa)
        damping = 0.0 if scheme == "pp" else d * n_rate
        # PP+V brakes the tool's speed w; PP+D the error n, whose turning with the normal has the speed n κ s'.
        drag = {"pp-v": d * w, "pp-d": d * n * kappa * rate}.get(scheme, 0.0)
        centripetal = kappa * w * w if scheme == "pp-pd-c" else 0.0
        # n'' = κ w s' - centripetal - k n - damping, w' = -κ n' s' - drag: the frame turns at the rate κ s'.
        return n_rate, kappa * w * rate - centripetal - k * n - damping, rate, -kappa * n_rate * rate - drag

    return rates


def integrate_rates(rates: Rates, start: Sequence[float], time: Array) -> Array:
    """Integrate equations of motion from `start`, where no formula solves them, by DOP853 at its tightest tolerance.

    Returns the states (k, n), one column for each of `time` (n,), s; `start` (k,) holds the state at its first one.
    Raises `InputError` where the integrator cannot go on.
    """
    from scipy.integrate import solve_ivp

    # The integrator needs an interval; one sample is the start itself.
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
        """Return where the tool is and how fast, (n, N) each, at each of `time` (n,), s, which starts at zero.

        It starts from `position` (N,), m, with `velocity` (N,), m/s.

        Raises `InputError` for a scene that this form is not about.
        """
        self.check(scene)
        # Tables 6.1 and 6.2 leave the mass out: they hold for K / m.
        gains = Gains(*(gain / scene.mass for gain in (scene.stiffness, scene.damping, scene.viscosity)))
        frame = scene.model.boundary.closest_point(np.asarray(position, dtype=np.float64)[np.newaxis])
        normal, distance, foot = frame.normal[0], float(frame.distance[0]), frame.foot[0]
        # The start in the surface's own coordinates: distance n, its rate, and the velocity along the surface.
        across = float(velocity @ normal)
        along = velocity - across * normal
        if self.shape == "curve":
            return _motion_on_curve(self.scheme, gains, scene.model.curve, foot, (distance, across), velocity, time)
        speed = float(np.linalg.norm(along))
        # Without speed along the surface any tangent will do: nothing moves along it.
        tangent = along / speed if speed > 0.0 else _any_tangent(normal)
        if self.shape == "line":
            n, n_rate = transversal_motion(gains, self.scheme, distance, across, time)
            s, s_rate = sliding_motion(drag(self.scheme, gains), speed, time)
            return Motion(
                foot + np.outer(s, tangent) + np.outer(n, normal), np.outer(s_rate, tangent) + np.outer(n_rate, normal)
            )
        # The trace of the shape operator is (N - 1) / R on a circle (N = 2) and on a sphere (N = 3).
        radius = float((frame.foot.shape[1] - 1) / np.trace(frame.shape[0]))
        centre = foot - radius * normal
        polar = _polar_motion(
            self.scheme, gains, radius, (radius + distance, across, speed / (radius + distance)), time
        )
        r, r_rate, angle, rate = polar
        # The unit vectors of the polar frame, e_r outwards and e_θ along, in the plane of normal and tangent.
        out = np.outer(np.cos(angle), normal) + np.outer(np.sin(angle), tangent)
        aside = np.outer(np.cos(angle), tangent) - np.outer(np.sin(angle), normal)
        # y = c + r e_r and ẏ = r' e_r + r θ' e_θ.
        return Motion(centre + r[:, np.newaxis] * out, r_rate[:, np.newaxis] * out + (r * rate)[:, np.newaxis] * aside)


def _any_tangent(normal: Array) -> Array:
    if normal.size == 2:
        return np.array([-normal[1], normal[0]])
    # The axis farthest from the normal: its cross product with it is never close to zero.
    axis = np.zeros(3)
    axis[int(np.argmin(np.abs(normal)))] = 1.0
    tangent = np.cross(normal, axis)
    return np.asarray(tangent / np.linalg.norm(tangent))


def _polar_motion(
    scheme: str, gains: Gains, radius: float, start: tuple[float, float, float], time: Array
) -> tuple[Array, Array, Array, Array]:
    """Return r (m), r' (m/s), theta (rad) and theta' (rad/s) at `time` (n,), from r, r' and theta' at angle zero."""
    r, r_rate, rate = start
    if scheme == "set-stabilisation":
        # (7.38) is linear: it needs no integration.
        n, n_rate = transversal_motion(gains, scheme, r - radius, r_rate, time)
        angle, turning = sliding_motion(gains.b, rate, time)
        return radius + n, n_rate, angle, turning
    solved = integrate_rates(polar_rates(scheme, gains, radius), (r, r_rate, 0.0, rate), time)
    return solved[0], solved[1], solved[2], solved[3]


def _motion_on_curve(
    scheme: str, gains: Gains, curve: Curve, foot: Array, start: tuple[float, float], velocity: Array, time: Array
) -> Motion:
    # The start in the curve's coordinates: arc length s0 of the foot, and the tool's speed w0 along the tangent.
    u = float(curve.nearest(foot[np.newaxis])[0])
    s0, kappa = float(curve.arc_length(u)), float(curve.curvature(u))
    w0 = float(velocity @ curve.tangent(u))
    if scheme == "set-stabilisation":
        n, n_rate = transversal_motion(gains, scheme, *start, time)
        # s'' = -b s' of the foot, which moves at s' = w / (1 + n κ).
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
    *((f"{scheme}-on-curve", scheme, "curve", "thesis 6.3 and 7.2 in the curve's own frame") for scheme in SOLVED_LAWS),
    *(
        (f"{scheme}-on-sphere", scheme, "sphere", "thesis 7.4: along a great circle, as on the circle")
        for scheme in SOLVED_LAWS
    ),
)
CLOSED_FORMS: Mapping[str, ClosedForm] = MappingProxyType({row[0]: ClosedForm(*row) for row in FORM_ROWS})
"""Every closed form by the name that a suite gives it."""

ALIKE_ON_A_LINE = ("pp-d", "pp-pd", "pp-pd-c")
"""Laws that differ on curved surfaces alone: about a line all are (6.21)."""


def form_of(scheme: str, scene: Scene) -> ClosedForm | None:
    """Return the closed form that a law has in a scene, the thesis's own before a general one, or None.

    There is none where a robot moves that nothing linearises, or that is taken for another, or an effect acts that no
    form knows.
    """
    if scene.believed is not None:
        return None
    linear = scene.inner_loop is InnerLoop.LINEARISED or scene.robot == PointMass(scene.mass, scene.model.dimension)
    if not linear or not {effect.kind for effect in scene.effects} <= {VISCOSITY, FORCE_SENSOR}:
        return None
    law = "pp-pd" if scene.model.name == "line" and scheme in ALIKE_ON_A_LINE else scheme
    for form in CLOSED_FORMS.values():
        # The forms of the thesis come first in the table, and so are preferred to the general ones.
        if form.scheme == law:
            with suppress(InputError):
                form.check(scene)
                return form
    return None
