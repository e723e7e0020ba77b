"""Numbers for people: metres as millimetres, four significant digits, the unit always beside."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def quantity(value: float | None, unit: str) -> str:
    """For instance `0.83 mm` for 0.00083 m; "not finite" for null, which stands for that in results."""
    if value is None:
        return "not finite"
    if unit == "m":
        value, unit = 1e3 * value, "mm"
    return f"{value:.4g} {unit}".rstrip()


def measured(verdict: Mapping[str, Any]) -> str:
    """Metric and bound of a verdict document, for instance `IHIP jump 4.1 mm, bound 0.1 mm`; "" without one."""
    metric = verdict["metric"]
    if metric is None:
        return ""
    text = f"{metric['name']} {quantity(metric['value'], metric['unit'])}"
    return text if verdict["bound"] is None else f"{text}, bound {quantity(verdict['bound'], metric['unit'])}"
