"""The ways in which a curve shortening flow gives no map of a model, each said with where and what to use instead."""

from __future__ import annotations

from hapticeval.errors import RefusalError

INSTEAD = "use the renderer 'conformal', which maps every model without holes"


class FlowError(RefusalError):
    """The flow gives no map: `position` (m) says where that was seen, `time` when, `count` how often."""

    def __init__(self, what: str, *, position: tuple[float, float], time: float, count: int, why: str) -> None:
        self.position: tuple[float, ...] | None = position
        self.time = time
        self.count = count
        x, y = (round(c, 9) + 0.0 for c in position)  # to a nanometre: a centre is at zero
        super().__init__(f"{what} at ({x:.4g}, {y:.4g}) m, flow time {time:.4g}", why=why, todo=INSTEAD)


class FlowSplitError(FlowError):
    """The front fell apart into several (Figure 5.9); `count` of them."""


class FlowCollapseError(FlowError):
    """The front shrinks to a segment instead of a point, or vanished before it was round."""


class FoldedGridError(FlowError):
    """Cells of the grid are turned over: lines crossed, and the map is not one-to-one; `count` of them."""
