"""The closed-loop dynamics as the report prints them, in the manner of thesis Tables 6.1 and 6.2."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from hapticeval.closed_forms import ClosedForm

SYMBOLS: Mapping[str, str] = MappingProxyType(
    {
        "line": "n is the distance from the line, s the way along it.",
        "circle": "r is the distance from the centre, R the circle's radius, θ the polar angle.",
        "sphere": "r is the distance from the centre, R the sphere's radius, θ the angle along the great circle.",
        "curve": (
            "n is the distance from the curve, s the arc length of its foot, κ the curvature there, and "
            "w = (1 + n κ) s′ the tool's speed along the curve."  # noqa: RUF001
        ),
    }
)
"""What the letters of `equations` mean on each shape."""


def equations(name: str) -> tuple[str, ...]:
    """The equations of the closed form `name`, a line each; none for a name that this version does not know."""
    form = _form(name)
    if form is None:
        return ()
    return {"line": _line, "circle": _polar, "sphere": _polar, "curve": _curve}[form.shape](form)


def letters(name: str) -> str:
    """What the letters of the closed form `name` mean; "" for a name that this version does not know."""
    form = _form(name)
    return "" if form is None else SYMBOLS[form.shape]


def _form(name: str) -> ClosedForm | None:
    # Loads geometry, and compiles: not for a page without closed forms.
    from hapticeval.closed_forms import CLOSED_FORMS

    return CLOSED_FORMS.get(name)


def _line(form: ClosedForm) -> tuple[str, ...]:
    along = {"pp-v": "−d s′", "set-stabilisation": "−b s′"}.get(form.scheme, "0")  # noqa: RUF001
    return f"s″ = {along}", f"n″ = −k n{_damping(form, 'n')}"  # noqa: RUF001


def _polar(form: ClosedForm) -> tuple[str, ...]:
    if form.scheme == "set-stabilisation":
        return "r″ = −k (r − R) − d r′", "θ″ = −b θ′"  # noqa: RUF001
    drag = {"pp-v": "(2 r′ + d r)", "pp-d": "(2 r′ + d (r − R))"}.get(form.scheme, "2 r′")  # noqa: RUF001
    given = " − (r θ′)² / R" if form.scheme == "pp-pd-c" else ""  # noqa: RUF001
    return f"r″ = −k (r − R) + r θ′²{given}{_damping(form, 'r')}", f"θ″ = −{drag} θ′ / r"  # noqa: RUF001


def _curve(form: ClosedForm) -> tuple[str, ...]:
    if form.scheme == "set-stabilisation":
        return "n″ = −k n − d n′", "s″ = −b s′"  # noqa: RUF001
    drag = {"pp-v": " − d w", "pp-d": " − d n κ s′"}.get(form.scheme, "")  # noqa: RUF001
    given = " − κ w²" if form.scheme == "pp-pd-c" else ""  # noqa: RUF001
    return f"n″ = κ w s′{given} − k n{_damping(form, 'n')}", f"w′ = −κ n′ s′{drag}"  # noqa: RUF001


def _damping(form: ClosedForm, across: str) -> str:
    return "" if form.scheme == "pp" else f" − d {across}′"  # noqa: RUF001
