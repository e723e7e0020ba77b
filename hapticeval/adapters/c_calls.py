"""Calls of C functions at an address, from compiled code: a library's step, and the clock that times it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic


def _call_step(
    _context: Any, step: Any, self: Any, hip: Any, velocity: Any, dt: Any, ihip: Any, force: Any
) -> tuple[Any, Callable[..., Any]]:  # fmt: skip
    """Call the function of a C library at the address `step`, `int32_t (*)(void *, const double *, ...)`: a tick.

    All are addresses but `dt`: it returns what the library returns.
    """
    # An address is a 64-bit integer to numba; dt alone is a double.
    place, integer = ir.IntType(64), ir.IntType(32)
    kind = ir.FunctionType(integer, [place, place, place, ir.DoubleType(), place, place])

    def code(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        # An address is no function to LLVM until it is cast to a pointer of the function's type.
        return builder.call(builder.inttoptr(arguments[0], kind.as_pointer()), arguments[1:])

    return types.int32(step, self, hip, velocity, dt, ihip, force), code


call_step: Callable[..., int] = intrinsic(_call_step)


def _call_clock(_context: Any, clock: Any, number: Any, stamp: Any) -> tuple[Any, Callable[..., Any]]:
    """Call `int clock_gettime(clockid_t, struct timespec *)` at the address `clock`, as `_call_step` calls a step."""
    place, integer = ir.IntType(64), ir.IntType(32)
    kind = ir.FunctionType(integer, [integer, place])

    def code(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        function = builder.inttoptr(arguments[0], kind.as_pointer())
        return builder.call(function, [builder.trunc(arguments[1], integer), arguments[2]])

    return types.int32(clock, number, stamp), code


call_clock: Callable[..., int] = intrinsic(_call_clock)
