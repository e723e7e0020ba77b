"""The limits of a scene in words."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any


def describe(document: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return rows of name and text: the limits at the place, and what follows for the scene's own stiffness."""
    place = ", ".join(f"{1e3 * value:.4g}" for value in document["point"])
    normal = ", ".join(f"{value:.3g}" for value in document["normal"])
    return [
        ("scene", f"{document['scene']}, {document['renderer']}, K = {document['stiffness']:.6g} N/m, "
                  f"B = {document['damping']:.4g} N s/m, T = {1e3 * document['sampling_time']:.4g} ms"),
        ("device", f"{document['device']}, {document['inner_loop']} inner loop, at ({place}) mm, "
                   f"wall facing ({normal})"),
        ("", ""),
        ("bound (2.40)", _bound(document)),
        ("eigenvalues", f"{_stiffness(document['eigenvalues'])}  of the sampled loop, without a hand"),
        ("simulation", f"{_stiffness(document['simulated'])}  the sampled loop itself, run and bisected"),
        *([("", why_none(document))] if document["eigenvalues"] == 0.0 else []),
        ("", ""),
        ("the scene", verdict(document)),
    ]  # fmt: skip


def why_none(document: Mapping[str, Any]) -> str:
    """Explain why no stiffness is stable."""
    if document["port_damping"] == 0.0 and document["damping"] == 0.0 and document["inner_loop"] == "static":
        return (
            "no stiffness is stable: a spring held over a step gives back more than it took, and neither device nor "
            "renderer has damping to take it up (2.40)"
        )
    return "no stiffness is stable with this damping, sampling time and delay"


def verdict(document: Mapping[str, Any]) -> str:
    """Describe what the limits mean for the stiffness that the scene asks for."""
    stiffness, growth = document["stiffness"], document["growth"]
    dt = document["sampling_time"]
    parts = []
    passive = document["passive"]
    if passive is None:
        parts.append("the bound (2.40) says nothing about it")
    elif stiffness > passive:
        parts.append(f"its {stiffness:.4g} N/m exceed the bound (2.40) of {passive:.4g} N/m")
    else:
        parts.append(f"its {stiffness:.4g} N/m are within the bound (2.40)")
    if growth >= 1.0:
        parts.append(
            f"without a hand the loop is unstable: it grows by {100 * (growth - 1.0):.3g} % a tick, "
            f"tenfold in {_seconds(growth, dt)}"
        )
    else:
        parts.append(f"without a hand the loop settles, to a tenth in {_seconds(growth, dt)}")
    return "; ".join(parts)


def _seconds(growth: float, dt: float) -> str:
    if growth in (0.0, 1.0):
        return "no time to speak of"
    return f"{dt * math.log(10.0) / abs(math.log(growth)):.3g} s"


def _bound(document: Mapping[str, Any]) -> str:
    if document["passive"] is None:
        return f"none: a {document['inner_loop']} inner loop compensates the damping that it counts on"
    b = document["port_damping"]
    formula = f"2 (b - |B|) / (T + 2 delay) with b = {b:.4g} N s/m"
    return f"{_stiffness(document['passive'])}  {formula}, sufficient with any passive hand"


def _stiffness(value: float | None) -> str:
    return "no limit found  " if value is None else f"{value:11.1f} N/m"
