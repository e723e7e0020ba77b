"""What a setting costs: time per step, time to build, and memory, each measured alone."""

from __future__ import annotations

import gc
import os
import platform
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path as FilePath
from types import FunctionType, MethodType, ModuleType
from typing import Any

import numpy as np

from hapticeval.kernel_cache import sharing_nothing
from hapticeval.recordings.recording import backward_difference
from hapticeval.renderer import RendererFactory
from hapticeval.scene import Scene
from hapticeval.stimulus.stimulus import Path
from hapticeval.types import Array, IntArray
from hapticeval.workers import cores

WARM_UP = 200  # steps before each round of timing, outside the clock
LONG_BUILD = 0.3  # s above which a build, with what it is given, is timed once


@dataclass(frozen=True, eq=False)
class Track:
    """A path as rows of HIP (N,), m, and velocity (N,), m/s, so that nothing but the renderer's step is timed."""

    hips: Array
    rows: list[tuple[Array, Array]]
    dt: float


def sample_track(path: Path, dt: float) -> Track:
    """Sample the positions and velocities along a path."""
    at, hips = path.sampled(dt)
    # Rows are split before: slicing an array takes as long as a quick step.
    return Track(hips, list(zip(hips, backward_difference(hips, at), strict=True)), dt)


@contextmanager
def without_garbage_collection() -> Iterator[None]:
    """Switch garbage collection off in the block: its pauses are Python's, not the renderer's."""
    enabled = gc.isenabled()
    # Collected now, so that the block begins without garbage.
    gc.collect()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


def step_times(renderer: Any, along: Track, count: int, *, first: int) -> IntArray:
    """Time each of `count` steps called from Python, from row `first` on, after a warm-up: (count,), ns.

    A library is called from a compiled loop, as closed loops do, and its step has no Python in it. The clock's own cost
    is in every sample: see `DoesNothing`.
    """
    from hapticeval.adapters.library import LibraryRenderer

    rows, dt, clock, step = along.rows, along.dt, time.perf_counter_ns, renderer.step
    samples = np.empty(count, dtype=np.int64)
    # As far as the path is long enough the timed stretch does not wrap round its end.
    first = min(first, max(len(rows) - count - WARM_UP, 0))
    renderer.reset(rows[first][0].copy())
    if isinstance(renderer, LibraryRenderer):
        timed = [rows[(first + k) % len(rows)] for k in range(WARM_UP + count)]
        hips, velocities = (np.array(column) for column in zip(*timed, strict=True))
        renderer.time_steps(hips[:1], velocities[:1], dt)  # the loop is compiled in the first call
        in_loop = renderer.time_steps(hips, velocities, dt)
        if in_loop is not None:
            return in_loop[WARM_UP:]
    # Caches, branch prediction and the contact's state are as in the middle of a run.
    for k in range(WARM_UP):
        hip, velocity = rows[(first + k) % len(rows)]
        step(hip.copy(), velocity.copy(), dt)
    for k in range(count):
        # Copies, which a step may change.
        hip, velocity = (column.copy() for column in rows[(first + WARM_UP + k) % len(rows)])
        begun = clock()
        step(hip, velocity, dt)
        samples[k] = clock() - begun
    return samples


class DoesNothing:
    """A renderer that answers nothing: what its step takes is in the time of every other."""

    def reset(self, hip: Array) -> None:
        """Start nothing with the hand at `hip` (N,), m."""

    def step(self, hip: Array, velocity: Array, dt: float) -> None:
        """Answer nothing to `hip` (N,), m, and `velocity` (N,), m/s, in a tick of `dt` (s)."""


def time_builds(
    factory: RendererFactory, prepare: Callable[[Scene], Scene], scenes: Iterator[Scene], repeats: int
) -> tuple[Any, list[float], list[float]]:
    """Build a renderer again and again, each time for what `prepare` makes of a new scene.

    Return the first, the seconds of each build, and the seconds of making what it was given. What takes long is not
    repeated.
    """
    clock = time.perf_counter_ns
    build_seconds: list[float] = []
    before: list[float] = []
    first_built: Any = None
    while len(build_seconds) < repeats and (not build_seconds or before[0] + build_seconds[0] < LONG_BUILD):
        scene = next(scenes)
        with without_garbage_collection(), sharing_nothing():
            # Making the mesh and building the renderer are timed apart: the user may have the mesh already.
            preparing = clock()
            prepared = prepare(scene)
            begun = clock()
            built = factory(prepared)
            build_seconds.append((clock() - begun) * 1e-9)
            before.append((begun - preparing) * 1e-9)
        first_built = built if first_built is None else first_built
    return first_built, build_seconds, before


def array_bytes(root: object) -> int:
    """Count the bytes of all arrays that can be reached from an object through attributes, containers and slots.

    Memory that two arrays share counts once. Python's own objects and what compiled libraries hold do not count. A
    memory-mapped file counts whole, as it would be if all of it were read.
    """
    visited: set[int] = set()
    buffers: dict[int, int] = {}
    stack = [root]
    while stack:
        current = stack.pop()
        if id(current) in visited:
            continue
        visited.add(id(current))
        if isinstance(current, np.ndarray):
            owner = current
            # A view's memory is its base's: counted once, by the address of the owner's data.
            while isinstance(owner.base, np.ndarray):
                owner = owner.base
            buffers[owner.__array_interface__["data"][0]] = owner.nbytes
        elif isinstance(current, Mapping):
            stack += current.values()
        elif isinstance(current, list | tuple | set | frozenset):
            stack += current
        elif isinstance(current, FunctionType):
            # What a closure holds, such as the tables of a compiled step.
            stack += [cell.cell_contents for cell in current.__closure__ or () if cell.cell_contents is not None]
        elif isinstance(current, MethodType):
            stack.append(current.__self__)
        elif not isinstance(current, type | ModuleType) and not type(current).__module__.startswith("numba"):
            stack += vars(current).values() if hasattr(current, "__dict__") else []
            stack += [getattr(current, name) for name in _slots(current) if hasattr(current, name)]
    return sum(buffers.values())


def _slots(instance: object) -> list[str]:
    named = [getattr(kind, "__slots__", ()) for kind in type(instance).__mro__]
    return [name for slots in named for name in ((slots,) if isinstance(slots, str) else slots)]


def machine() -> dict[str, Any]:
    """Describe what times depend on beside the versions: processor, cores that may be used, and other work."""
    processor = platform.processor() or platform.machine()
    # platform.processor() is empty on many Linux systems.
    cpuinfo = FilePath("/proc/cpuinfo")
    if cpuinfo.exists():
        named = [line.partition(":")[2].strip() for line in cpuinfo.read_text().splitlines() if "model name" in line]
        processor = named[0] if named else processor
    return {
        "processor": processor,
        "cores": cores(),
        "load_average": os.getloadavg()[0] if hasattr(os, "getloadavg") else None,
    }
