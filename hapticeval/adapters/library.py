"""A renderer in a shared library, `lib:./libmine.so`, by the C ABI of `hapticeval.h`.

A child process loads the library first and asks what it can: one that crashes or hangs costs that child only. Compiled
loops call its step by its address, without Python.
"""

from __future__ import annotations

import ctypes
import json
import re
import subprocess
import sys
import time
import weakref
from collections.abc import Callable
from ctypes import POINTER, byref, c_char_p, c_double, c_int32, c_uint32, c_void_p
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from hapticeval.adapters.outside import Outside
from hapticeval.compiled import borrowing
from hapticeval.errors import DomainError, InputError, RefusalError, RendererError, in_m
from hapticeval.geometry.pose import Pose
from hapticeval.laws import LawData, law_data
from hapticeval.pulse import PENDING_SIZE, pending_memory
from hapticeval.renderer import RANGE_WORDS, CompiledStep, Declaration, Response, Spring
from hapticeval.scene import Scene
from hapticeval.types import Array, IntArray
from hapticeval.workers import describe_exit

HEADER = Path(__file__).with_name("hapticeval.h")

ABI = 1
CONTACT_FLAG, REFUSES_MODEL, REFUSES_HIP = 1, 1, 2
BILATERAL_FLAG, SPRING_FLAG, FORCE_ONLY_FLAG, MEMORYLESS_FLAG, SMOOTH_ONLY_FLAG = 4, 16, 32, 64, 128
MOVING_FLAG = 256
REQUIREMENT_FLAGS = {1: "plane", 2: "space", BILATERAL_FLAG: "bilateral", 8: "viscosity", MOVING_FLAG: "moving"}
"""Flags of the header by which a library supports scenes with these requirements."""

REQUIRED_FUNCTIONS = ("hr_abi", "hr_info_get", "hr_create", "hr_reset", "hr_step", "hr_destroy")

REASON_BYTES = 1024
"""Bytes that a library has to write why it refuses a model."""

LOADING_PATIENCE = 30.0
"""Seconds in which a library must load and say what it can."""

REFUSAL = "the library refuses the HIP"
"""What `REFUSES_HIP` says: a library's word where the hand has left its domain, or is not finite."""

ANSWER = PENDING_SIZE - 1
"""Place in a law's state of what `hr_step` returned."""


class SceneStruct(ctypes.Structure):
    """`hr_scene` of the header."""

    _fields_ = [
        *((name, c_uint32) for name in ("size", "dimension", "flags", "n_vertices", "n_cells")),
        *((name, c_double) for name in ("stiffness", "damping", "mass", "restitution", "viscosity", "sampling_time")),
        ("vertices", POINTER(c_double)),
        ("cells", POINTER(c_uint32)),
        ("chord_error", c_double),
    ]


class InfoStruct(ctypes.Structure):
    """`hr_info` of the header."""

    _fields_ = [
        *((name, c_uint32) for name in ("size", "flags")),
        *((name, c_double) for name in ("max_error", "standoff", "resolution")),
        *((name, c_double) for name in ("stiffness_least", "stiffness_largest", "force_resolution")),
    ]


PROBE_PROGRAM = """
import ctypes, json, sys
path, names, fields = sys.argv[1], sys.argv[2].split(), sys.argv[3].split()
class Info(ctypes.Structure):
    _fields_ = [(name, ctypes.c_uint32) for name in fields[:2]] + [(name, ctypes.c_double) for name in fields[2:]]
try:
    library = ctypes.CDLL(path)
except OSError as error:
    found = {"error": str(error)}
else:
    found = {"missing": [name for name in names if not hasattr(library, name)]}
    if "hr_abi" not in found["missing"]:
        library.hr_abi.restype = ctypes.c_uint32
        found["abi"] = library.hr_abi()
    if not found["missing"] and found["abi"] == int(sys.argv[4]):
        info = Info(ctypes.sizeof(Info))
        found["status"] = library.hr_info_get(None, ctypes.byref(info))
        found["info"] = {name: getattr(info, name) for name in fields}
print("\\nhapticeval", json.dumps(found), flush=True)
"""
"""The program of the child that loads a library and asks it. Only its last line counts: a library may print."""


@lru_cache(maxsize=32)
def _probe(path: Path, changed: int) -> dict[str, Any]:  # noqa: ARG001 - a library that is built anew is asked again
    """Load a library in a child, and return what it lacks, its ABI, and its flags and lengths. Raises `InputError`."""
    fields = " ".join(name for name, *_ in InfoStruct._fields_)
    # -I: neither PYTHON variables nor the folder that this runs in change what the child imports.
    command = [sys.executable, "-I", "-c", PROBE_PROGRAM, str(path), " ".join(REQUIRED_FUNCTIONS), fields, str(ABI)]
    try:
        done = subprocess.run(
            command,
            capture_output=True,
            stdin=subprocess.DEVNULL,
            timeout=LOADING_PATIENCE,
            check=False,
            errors="replace",
        )
    except subprocess.TimeoutExpired as error:
        raise InputError(
            f"the library {path} gives no answer in {LOADING_PATIENCE:g} s",
            why="what it does when it is loaded, hr_abi() or hr_info_get(NULL, info) hangs",
            todo="do the work in hr_create",
        ) from error
    answer = done.stdout.rpartition("\nhapticeval ")[2]
    if done.returncode or not answer.startswith("{"):
        raise InputError(
            f"the library {path} ends the process that loads it: {describe_exit(done.returncode)}",
            why="what it does when it is loaded, hr_abi() or hr_info_get(NULL, info) crashes",
            todo="hr_info_get is first called with self NULL, before a scene: write flags and max_error then",
        )
    description: dict[str, Any] = json.loads(answer)
    return description


class Info(NamedTuple):
    """What a library says of itself before it gets a scene.

    Its flags, and the largest distance (m) that it allows between a smooth model and its facets, 0 for any.
    """

    flags: int
    max_error: float

    @property
    def supports(self) -> frozenset[str]:
        """What its flags declare."""
        return frozenset(name for flag, name in REQUIREMENT_FLAGS.items() if self.flags & flag)


def info_of(path: Path) -> Info:
    """Ask a library what it is. Raises `InputError`, with the reason, for what is no library of our ABI."""
    if not path.is_file():
        raise InputError(
            f"no library {path}",
            why="there is no such file",
            todo="build it first, and give its path: lib:./libmine.so. A Python module is named package.module:factory",
        )
    description = _probe(path, path.stat().st_mtime_ns)
    if "error" in description:
        raise InputError(
            f"{path} cannot be loaded as a library",
            why=_demangled(description["error"]),
            todo="build a shared library for this machine: cc -shared -fPIC -o libmine.so mine.c. Of what it needs "
            "itself, `ldd` shows what is not found",
        )
    if description["missing"]:
        raise InputError(
            f"the library {path} has no {', '.join(description['missing'])}",
            why="these functions of hapticeval.h are not optional, and it does not export them",
            todo='define them; in C++ as extern "C", which including hapticeval.h does; see `hapticeval header`',
        )
    if description["abi"] != ABI:
        raise InputError(
            f"the library {path} has the ABI {description['abi']}",
            why=f"this version of hapticeval calls libraries of ABI {ABI}",
            todo="build it anew with the header that `hapticeval header` prints, and let hr_abi() return HR_ABI",
        )
    info = description["info"]
    if description["status"]:
        raise InputError(
            f"the library {path}: hr_info_get(NULL, info) returned {description['status']}",
            why="it is called with self NULL first, before a scene",
            todo="write flags and max_error then, and return 0",
        )
    # MOVING_FLAG is the highest flag of this header: above it are those of a later one.
    if info["flags"] >= 2 * MOVING_FLAG:
        raise InputError(
            f"the library {path} has the flags {info['flags']:#x}",
            why="this version of hapticeval does not know all of them",
            todo="use the flags of the header that `hapticeval header` prints",
        )
    # false for NaN too
    if not 0.0 <= info["max_error"] < np.inf:
        raise InputError(
            f"the library {path} asks for max_error = {info['max_error']!r} m",
            why="it is a length: finite and not negative",
        )
    return Info(int(info["flags"]), float(info["max_error"]))


def _demangled(text: str) -> str:
    """Return a message with the C++ names in it spelt out behind them, where this system's C++ library can do that."""
    try:
        demangle = ctypes.CDLL("libstdc++.so.6").__cxa_demangle
    except (OSError, AttributeError):
        return text
    demangle.restype, demangle.argtypes = c_char_p, [c_char_p, c_void_p, c_void_p, c_void_p]

    def spelt(match: re.Match[str]) -> str:
        name = demangle(match[0].encode(), None, None, None)  # its few bytes are not freed: the run ends here
        return match[0] if name is None else f"{match[0]}, which is {name.decode(errors='replace')}"

    return re.sub(r"\b_Z\w+", spelt, text)


@dataclass(frozen=True)
class LibraryFactory:
    """Makes the renderers of a library; it can be pickled for other processes."""

    path: Path
    info: Info

    @property
    def summary(self) -> str:
        """In a line what it makes."""
        return f"the library {self.path.name}"

    @property
    def supports(self) -> frozenset[str]:
        """What its flags declare."""
        return self.info.supports

    def __call__(self, scene: Scene) -> LibraryRenderer:
        """Make the renderer of a scene."""
        return LibraryRenderer(_load(self.path), self.info, Outside(scene, self.info.max_error))


def library(place: str) -> LibraryFactory:
    """Return the factory of the library at `place`. Raises as `info_of` does."""
    path = Path(place).resolve()
    return LibraryFactory(path, info_of(path))


@lru_cache(maxsize=32)
def _load(path: Path) -> ctypes.CDLL:
    """Load a library into this process, with the types of the header's functions."""
    library = ctypes.CDLL(str(path))
    # Arrays go as their addresses, of N doubles a row.
    point = c_void_p
    library.hr_info_get.argtypes = [c_void_p, POINTER(InfoStruct)]
    library.hr_create.argtypes = [POINTER(SceneStruct), POINTER(c_void_p), c_char_p, c_uint32]
    library.hr_reset.argtypes = [c_void_p, point, point]
    library.hr_step.argtypes = [c_void_p, point, point, c_double, point, point]
    library.hr_destroy.argtypes, library.hr_destroy.restype = [c_void_p], None
    names = ["hr_info_get", "hr_create", "hr_reset", "hr_step"]
    if hasattr(library, "hr_place"):  # the one function that is optional
        library.hr_place.argtypes = [c_void_p, point]
        names.append("hr_place")
    for name in names:
        getattr(library, name).restype = c_int32
    return library


@borrowing
def ask(
    data: LawData, hip: Array, velocity: Array, push: Array, dt: float, ihip: Array, force: Array  # noqa: ARG001
) -> int:  # fmt: skip
    """Ask a library for one tick, from a compiled loop: a law of signature `LAW`.

    `hip` (N,), m, and `velocity` (N,), m/s, of the hand; `dt`, s. Writes `ihip` (N,), m, and `force` (N,), N: not
    finite where the library does not. `push` is not used. `data.params` holds the addresses of `hr_step` and of the
    library's self. `data.state` is the memory of the step under way (`pulse.PendingStep`): a library that ends the
    process leaves there what it was asked; its last number gets what `hr_step` returned. Returns 0, a number of the
    law's `domain_exits`, or one below 0 where the library broke.
    """
    # What the library leaves unwritten is then not finite, and never the last answer.
    for i in range(hip.shape[0]):
        ihip[i] = force[i] = np.nan
        data.state[2 + i] = hip[i]
    data.state[1] += 1.0  # the tick
    data.state[0] = hip.shape[0]
    # Two addresses as the bits of float64: those of hr_step and of the library's self.
    addresses = data.params.view(np.uint64)
    answer = call_step(
        addresses[0], addresses[1], hip.ctypes.data, velocity.ctypes.data, dt, ihip.ctypes.data, force.ctypes.data
    )
    data.state[0] = 0.0
    data.state[ANSWER] = answer
    if 0 <= answer <= CONTACT_FLAG:
        return 0
    return REFUSES_HIP if answer == REFUSES_HIP else -abs(int(answer))


@borrowing
def time_rows(
    data: LawData, push: Array, hips: Array, velocities: Array, dt: float, clock: int, number: int, stamp: IntArray,
    answers: Array, nanoseconds: IntArray,
) -> int:  # fmt: skip
    """Ask a library for ticks as a closed loop does, and time each; return the row at which it refuses or broke, or n.

    `hips` (n, N), m, and `velocities` (n, N), m/s, in steps of `dt` (s). `clock` is the address of C's clock_gettime
    and `number` the clock's; `stamp` (2,) takes its s and ns, `answers` (2, N) IHIP (m) and force (N). Writes
    `nanoseconds` (n,).
    """
    for row in range(hips.shape[0]):
        call_clock(clock, number, stamp.ctypes.data)
        begun = stamp[0] * 1_000_000_000 + stamp[1]
        if ask(data, hips[row], velocities[row], push, dt, answers[0], answers[1]) != 0:
            return row
        call_clock(clock, number, stamp.ctypes.data)
        nanoseconds[row] = stamp[0] * 1_000_000_000 + stamp[1] - begun
    return int(hips.shape[0])


def _declaration(info: Info, answer: InfoStruct) -> Declaration:
    """Return what a library promises by its flags and by what it wrote for a scene. Raises `RendererError`."""
    # both zero where the stiffness does not vary
    shares = float(answer.stiffness_least), float(answer.stiffness_largest)
    promise = Declaration(
        spring=Spring.ERROR if info.flags & SPRING_FLAG else None,
        force_only=bool(info.flags & FORCE_ONLY_FLAG),
        memoryless=bool(info.flags & MEMORYLESS_FLAG),
        smooth_only=bool(info.flags & SMOOTH_ONLY_FLAG),
        stiffness_range=shares if any(shares) else None,
        force_resolution=float(answer.force_resolution),
    )
    if promise.faults:
        raise RendererError(
            f"the library's hr_info_get() has stiffness_least = {shares[0]!r}, stiffness_largest = {shares[1]!r} and "
            f"force_resolution = {promise.force_resolution!r} N",
            why=f"the first two are shares of the scene's stiffness, {RANGE_WORDS}, or both zero; the third is finite "
            "and not negative",
            todo="leave zero what does not vary, and what is not coarse",
        )
    return promise


class LibraryRenderer:
    """A renderer of a library: `step` and compiled loops both call `hr_step`, and so agree to the last bit.

    `contact` is whether the last `step` gave HR_CONTACT.
    """

    def __init__(self, library: ctypes.CDLL, info: Info, outside: Outside) -> None:
        self._library, self._outside = library, outside
        self._self = c_void_p()
        self._create()
        # When the renderer goes, not only when the process ends.
        weakref.finalize(self, library.hr_destroy, self._self)
        lengths = InfoStruct(ctypes.sizeof(InfoStruct))
        # Asked again, of a self: lengths may depend on the scene that it was made for.
        status = library.hr_info_get(self._self, byref(lengths))
        if status:
            raise RendererError(f"the library's hr_info_get() returned {status}", why="0 is what all is well with")
        for name in ("standoff", "resolution"):
            if not 0.0 <= getattr(lengths, name) < np.inf:
                raise RendererError(
                    f"the library's hr_info_get() has {name} = {getattr(lengths, name)!r} m",
                    why="it is a length: finite and not negative",
                    todo="leave it zero, or write metres",
                )
        self._margin = float(lengths.standoff)
        # Attributes that a renderer has only where they hold: see `Outside.lengths`.
        self.__dict__.update(outside.lengths(float(lengths.standoff), float(lengths.resolution)))
        self.supports = info.supports
        self._pose: Pose | None = None
        if hasattr(library, "hr_place"):
            self.place = self._place
        promise = _declaration(info, lengths)
        if promise != Declaration():
            self.declares = promise
        # A law's parameters are float64: the addresses travel as their bits.
        addresses = np.array([ctypes.cast(library.hr_step, c_void_p).value, self._self.value or 0], dtype=np.uint64)
        pending = pending_memory()
        state = np.zeros(len(pending)) if isinstance(pending, list) else np.frombuffer(pending)  # type: ignore[call-overload]
        data = law_data(addresses.view(np.float64))._replace(state=state)
        self.law = CompiledStep(ask, data, {REFUSES_HIP: REFUSAL}, contact=state[ANSWER:])
        self.contact = False

    def _create(self) -> None:
        """Give the library the scene and its facets. Raises `RefusalError` and `RendererError`."""
        scene, facets = self._outside.scene, self._outside.facets
        # As the header lays them out: vertices (n, N), m, row by row, and cells as indices of them.
        vertices = np.ascontiguousarray(facets.vertices, dtype=np.float64)
        cells = np.ascontiguousarray(facets.cells, dtype=np.uint32)
        self._kept = vertices, cells  # the library reads them as long as it lives
        struct = SceneStruct(
            size=ctypes.sizeof(SceneStruct),
            dimension=scene.model.dimension,
            flags=(BILATERAL_FLAG if scene.bilateral else 0) | (0 if scene.motion is None else MOVING_FLAG),
            n_vertices=len(vertices),
            n_cells=len(cells),
            vertices=vertices.ctypes.data_as(POINTER(c_double)),
            cells=cells.ctypes.data_as(POINTER(c_uint32)),
            **self._outside.numbers,
        )
        why = ctypes.create_string_buffer(REASON_BYTES)
        status = self._library.hr_create(byref(struct), byref(self._self), why, REASON_BYTES)
        text = why.raw.split(b"\0", 1)[0].decode(errors="replace").strip()
        if status == REFUSES_MODEL:
            raise RefusalError(
                f"the library refuses the model '{scene.model.name}'",
                why=text or "it does not say why",
                todo="choose another case" if text else "write the reason to `why` in hr_create",
            )
        if status:
            raise RendererError(f"the library's hr_create() returned {status}", why=text)

    def _place(self, rotation: Array, translation: Array) -> None:
        """Give the library the pose of the body, see `WrappedRenderer.place`; it is `place` where it has `hr_place`."""
        self._pose = Pose(rotation, translation)
        numbers = np.concatenate([np.ravel(rotation), translation])
        status = self._library.hr_place(self._self, numbers.ctypes.data)
        if status:
            raise RendererError(f"the library's hr_place() returned {status}", why="0 is what all is well with")

    def reset(self, hip: Array) -> None:
        """Start a run with the hand at `hip` (N,), m. Raises `DomainError` where the library refuses it."""
        self.contact = False
        hip = np.array(hip, dtype=np.float64)
        tool = np.array(self._outside.tool(hip, self._margin, self._pose), dtype=np.float64)
        status = self._library.hr_reset(self._self, hip.ctypes.data, tool.ctypes.data)
        if status:
            self._refuse("hr_reset", status, hip)

    def step(self, hip: Array, velocity: Array, dt: float) -> Response:
        """One tick: `hip` (N,), m; `velocity` (N,), m/s; `dt`, s. Raises `DomainError` where the library refuses it."""
        hip, velocity = (np.array(vector, dtype=np.float64) for vector in (hip, velocity))
        ihip, force = np.full_like(hip, np.nan), np.full_like(hip, np.nan)
        answer = self._library.hr_step(
            self._self, hip.ctypes.data, velocity.ctypes.data, dt, ihip.ctypes.data, force.ctypes.data
        )
        self.contact = bool(answer == CONTACT_FLAG)
        if not 0 <= answer <= CONTACT_FLAG:
            self._refuse("hr_step", answer, hip)
        return Response(ihip, force)

    def time_steps(self, hips: Array, velocities: Array, dt: float) -> IntArray | None:
        """Return how long steps at `hips` (n, N), m, with `velocities` (n, N), m/s, take in a compiled loop: (n,), ns.

        None where this system has no clock that such a loop can read. Raises `RendererError` where a step fails.
        """
        if not hasattr(time, "CLOCK_MONOTONIC"):
            return None
        clock = ctypes.cast(ctypes.CDLL(None).clock_gettime, c_void_p).value or 0
        nanoseconds, stamp = np.zeros(len(hips), dtype=np.int64), np.zeros(2, dtype=np.int64)
        answers, push = np.zeros((2, hips.shape[1])), np.zeros(hips.shape[1])
        row = time_rows(
            self.law.data, push, hips, velocities, dt, clock, time.CLOCK_MONOTONIC, stamp, answers, nanoseconds
        )
        if row < len(hips):
            self._refuse("hr_step", int(self.law.data.state[ANSWER]), hips[row])
        return nanoseconds

    def _refuse(self, function: str, status: int, hip: Array) -> NoReturn:
        """Raise `DomainError` where the library refuses a HIP, and `RendererError` where it broke."""
        if status == REFUSES_HIP:
            raise DomainError(f"{REFUSAL}: {in_m(hip)}", why=f"{function} returned HR_REFUSES_HIP")
        raise RendererError(
            f"the library's {function}() returned {status}", why="it is below 0, or none of the header's: it broke"
        )


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
