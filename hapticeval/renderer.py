"""The renderer contract: what anything must offer to be run and judged. No base class to inherit."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol, TypeAlias, runtime_checkable

from hapticeval.recordings.recording import Recording
from hapticeval.scene import Scene
from hapticeval.stimulus import Stimulus
from hapticeval.types import Array


class Response(NamedTuple):
    """A renderer's answer to one HIP: the IHIP (N,), m, and the force on the hand (N,), N."""

    ihip: Array
    force: Array


@runtime_checkable
class Renderer(Protocol):
    """Answers a HIP with an IHIP and a force, a tick at a time (DESIGN section 5).

    A renderer may also have

    - `run(hips, dt) -> (ihips, forces)`: the whole trajectory at once, when that is faster;
    - `resolution` and `standoff` (m): how coarse its own representation of the model is, see `Recording`;
    - `surface`: the `Curve` that it really renders, where that is not the model's own.
    """

    def reset(self, hip: Array) -> None:
        """Start a run with the hand at `hip` (N,)."""

    def step(self, hip: Array, velocity: Array, dt: float) -> Response:
        """One tick: `hip` (N,), m; `velocity` (N,), m/s; `dt`, s. In free space the IHIP is the HIP."""


@runtime_checkable
class Batch(Protocol):
    """A renderer that can take a whole trajectory at once: equal to a `reset` and then a `step` a row."""

    def run(self, hips: Array, dt: float) -> tuple[Array, Array]:
        """`hips` (n, N) to IHIPs (n, N) and forces (n, N)."""


@runtime_checkable
class SelfDriven(Protocol):
    """A renderer with tool physics of its own, which answers a stimulus whole instead of tick by tick.

    The ideal rigid contact is one: a rigid tool's position follows from forces, not from a sampled HIP.
    """

    def answer(self, stimulus: Stimulus, dt: float) -> Recording:
        """The whole run, sampled every `dt` seconds."""


RendererFactory: TypeAlias = Callable[[Scene], Renderer | SelfDriven]
