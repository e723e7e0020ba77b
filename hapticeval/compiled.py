"""The one place where inner loops are compiled, so that every kernel is cached and typed alike."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any, ParamSpec, TypeVar

import numba
from numba import types
from numba.core.typing.typeof import typeof_impl
from numba.experimental.function_type import _get_wrapper_address

P = ParamSpec("P")
R = TypeVar("R")

VECTOR = types.Array(types.float64, 1, "C")
MATRIX = types.Array(types.float64, 2, "C")

KINEMATICS = types.void(VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, MATRIX, VECTOR)
"""(parameters, joints, rates, out position, out velocity, out Jacobian J, out J̇ rates) of a device."""

DYNAMICS = types.void(VECTOR, VECTOR, VECTOR, MATRIX, VECTOR)
"""(parameters, joints, rates, out inertia M, out bias): M q̈ + bias = τ."""

MARGIN = types.float64(VECTOR, VECTOR)
"""(parameters, joints): positive inside the functional configuration space, see `Device.margin`."""

LAW = types.int64(VECTOR, MATRIX, MATRIX, VECTOR, VECTOR, VECTOR, VECTOR, types.float64, VECTOR, VECTOR)
"""(reals, pieces, samples, memory, hip, velocity, push, dt, out ihip, out force): one tick of a renderer.

Gives 0, or the number of the refusal that `CompiledLaw.refusals` words. `memory` is the renderer's own between ticks,
zero at the start of a run; `push` is the hand's force as sensed, zero where there is no sensor.
"""


def compiled(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a numeric function with numba on its first call and keep the code on disk.

    No fast-math: the same command must give the same verdicts, bit for bit, on the same machine.
    """
    kernel: Callable[P, R] = numba.njit(cache=True, error_model="numpy")(function)
    return kernel


class FirstClass(types.WrapperAddressProtocol):
    """A compiled function as a value that other compiled code takes as an argument.

    Code that takes it is compiled once for the signature, not once a function, and its cache on disk holds for all.
    Arrays must be writable and contiguous, as the signatures above say.
    """

    def __init__(self, kernel: Callable[..., Any], signature: Any) -> None:
        kernel.compile(signature.args)  # type: ignore[attr-defined]
        self.kernel = kernel
        self.type = types.FunctionType(signature)
        self._signature = signature
        self._address = int(_get_wrapper_address(kernel, signature))  # type: ignore[no-untyped-call]

    def __call__(self, *arguments: Any) -> Any:
        """Call it from Python."""
        return self.kernel(*arguments)

    def __wrapper_address__(self) -> int:
        """Where the machine code lies: numba's protocol."""
        return self._address

    def signature(self) -> Any:
        """What it takes and gives: numba's protocol."""
        return self._signature


@typeof_impl.register(FirstClass)
def _typeof(value: FirstClass, _context: object) -> Any:
    """Numba would make the type anew at each call, which costs a tick from Python more than the kernel."""
    return value.type


@lru_cache(maxsize=128)
def first_class(kernel: Callable[..., Any], signature: Any) -> FirstClass:
    """`kernel`, made by `compiled`, as a value of the given signature (`LAW`, `KINEMATICS`, ...)."""
    return FirstClass(kernel, signature)
