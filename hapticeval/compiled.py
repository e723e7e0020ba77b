"""The one place where inner loops are compiled, so that every kernel is cached and typed alike."""

from __future__ import annotations

from collections.abc import Callable
from typing import ParamSpec, TypeVar

import numba

P = ParamSpec("P")
R = TypeVar("R")


def compiled(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a numeric function with numba on its first call and keep the code on disk.

    No fast-math: the same command must give the same verdicts, bit for bit, on the same machine.
    """
    kernel: Callable[P, R] = numba.njit(cache=True, error_model="numpy")(function)
    return kernel
