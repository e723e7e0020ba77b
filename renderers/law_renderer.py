"""A renderer that is a compiled law: what it answers tick by tick is what a compiled loop runs."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from hapticeval.errors import DomainError
from hapticeval.renderer import CompiledLaw, Response
from hapticeval.types import Array


class LawRenderer(ABC):
    """The step of `law` in `dimension` N = 2 or 3, one tick at a time, with its memory and the hand's sensed force."""

    def __init__(self, law: CompiledLaw, dimension: int) -> None:
        self._law = law
        self._memory = np.zeros(law.memory)
        self._push = np.zeros(dimension)

    @property
    def law(self) -> CompiledLaw:
        """The same step for compiled loops."""
        return self._law

    def reset(self, hip: Array) -> None:  # noqa: ARG002 - the protocol's
        """Start a run: nothing is touched yet, and nothing felt."""
        self._memory[:] = 0.0
        self._push[:] = 0.0

    def feel(self, push: Array) -> None:
        """The measured force of the hand on the tool (N,), N, for the ticks that follow."""
        self._push[:] = push

    def step(self, hip: Array, velocity: Array, dt: float) -> Response:
        """One tick: `hip` (N,), m; `velocity` (N,), m/s; `dt`, s. Raises `DomainError` where the law is not defined."""
        ihip, force = np.empty_like(self._push), np.empty_like(self._push)
        law, hip = self._law, np.array(hip, dtype=np.float64)
        velocity = np.array(velocity, dtype=np.float64)
        refusal = law.function(
            law.reals, law.pieces, law.samples, self._memory, hip, velocity, self._push, dt, ihip, force
        )
        if refusal:
            raise self.led_out(hip, law.refusals[refusal])
        return Response(ihip, force)

    @abstractmethod
    def led_out(self, hip: Array, what: str) -> DomainError:
        """The error for a hand at `hip` (N,), m, where the law says `what` and is not defined."""
