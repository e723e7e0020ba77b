"""Compile inner loops with numba, here and nowhere else, so that every kernel is cached and typed alike.

Compiling all kernels takes longer than most runs. So each is compiled once: for one type of its arguments, see
`for_kernels`, and by one process, see `compiled`.

How a function is compiled:

- `compiled`: it makes arrays of its own.
- `borrowing`: it makes none, and counts no references to those that it is given.
- `inner`: like `borrowing`, and a part of each kernel that calls it: what is short, or left out for an argument None.
- `compiled_once`: at its first use and not where it is defined, in a module that is imported without numba.

How compiled code gets at another function:

- By its name: it is compiled for that one.
- By `first_class` as an argument, and for a renderer's law by `law_value`: it is compiled once for all of a signature.
- Python calls a kernel in each tick by `specialised`: the types of its arguments are not looked up again.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache, lru_cache
from pathlib import Path
from typing import Any, NamedTuple, ParamSpec, TypeVar

import numba
import numpy as np
from llvmlite import ir
from llvmlite.binding import Linkage, parse_assembly
from numba import types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.compiler_lock import global_compiler_lock
from numba.core.sigutils import normalize_signature
from numba.core.typing.typeof import typeof_impl
from numba.experimental.function_type import _get_wrapper_address
from numba.extending import intrinsic, lower_builtin, type_callable
from numba.np.arrayobj import make_array
from numpy.typing import ArrayLike, NDArray

from hapticeval.kernel_cache import folder_of, lock_file
from hapticeval.pulse import compiling
from hapticeval.types import Array

P = ParamSpec("P")
R = TypeVar("R")
T = TypeVar("T", bound=np.generic)

VECTOR = types.Array(types.float64, 1, "C")
MATRIX = types.Array(types.float64, 2, "C")

KINEMATICS = types.void(VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, MATRIX, VECTOR)
"""(parameters, joints, rates, out position, out velocity, out Jacobian J, out J̇ rates) of a device."""

DYNAMICS = types.void(VECTOR, VECTOR, VECTOR, MATRIX, VECTOR)
"""(parameters, joints, rates, out inertia M, out bias): M q̈ + bias = τ."""

MARGIN = types.float64(VECTOR, VECTOR)
"""(parameters, joints): positive inside the functional configuration space, see `Device.margin`."""

EFFECT = types.float64(VECTOR, MATRIX, MATRIX, types.int64, types.float64, VECTOR, VECTOR)
"""(params, samples, state, tick, dt, first, second): one tick of an effect, see `hapticeval.effects.effect.Part`."""


ENVIRONMENT = "_ZN08NumbaEnv"
"""How the names of numba's environments begin, one a kernel: what it needs of Python."""

LINKS_IN, LINKS_BEFORE = (0, 61), (0, 69)
"""The versions of numba in which `_LinkedLibrary` does its work, by inner methods; in others numba does all."""

EMPTY_TABLE: Array = np.empty((0, 0))
"""The table that a law has no use for."""


class LawData(NamedTuple):
    """What a renderer's compiled step works on, in arrays that are writable and contiguous: any may be empty.

    - `params` (k,): gains and other numbers.
    - `segments`, `joints`, `lookup`, `vertices` and `tree`, all (rows, columns): the surface. They are its pieces, what
      belongs to the joints between them, a table in which the nearest point is looked for, an outline of straight edges
      and its search tree.
    - `state` (m,): what the renderer keeps between ticks. Its `reset` prepares it, and each tick of the law goes on
      from it.
    """

    params: Array
    segments: Array
    joints: Array
    lookup: Array
    vertices: Array
    tree: Array
    state: Array


def law_data(
    params: ArrayLike = (),
    *,
    segments: ArrayLike = EMPTY_TABLE,
    joints: ArrayLike = EMPTY_TABLE,
    lookup: ArrayLike = EMPTY_TABLE,
    vertices: ArrayLike = EMPTY_TABLE,
    tree: ArrayLike = EMPTY_TABLE,
    state: int = 0,
) -> LawData:
    """Return what a law works on, of the type that `LAW` asks for, from what a renderer has.

    `params` (k,) are its numbers; the tables are (rows, columns) with lengths in m, see `LawData`; `state` is the size
    of the state, all zeros. Tables that have the type already are shared, for a mesh has many megabytes of them; the
    few numbers are copied.
    """
    tables = (for_kernels(np.asarray(table, dtype=np.float64)) for table in (segments, joints, lookup, vertices, tree))
    return LawData._make([np.array(params, dtype=np.float64), *tables, np.zeros(state)])


LAW_DATA = types.NamedTuple((VECTOR, MATRIX, MATRIX, MATRIX, MATRIX, MATRIX, VECTOR), LawData)  # type: ignore[no-untyped-call]

LAW = types.int64(LAW_DATA, VECTOR, VECTOR, VECTOR, types.float64, VECTOR, VECTOR)
"""(data, hip, velocity, push, dt, out ihip, out force): one tick of a renderer.

Returns 0, or where the hand has left the law's domain the number that `CompiledStep.domain_exits` words. `push` is the
hand's force as sensed, zero where there is no sensor.
"""


class Closest(NamedTuple):
    """The closest point of a boundary as compiled code: `function`, of signature `CLOSEST`, over its own `data`."""

    function: Callable[..., float]
    data: LawData


FOOT, NORMAL, SHAPE = 0, 1, 2
"""Rows of a frame that `CLOSEST` writes: see there."""

CLOSEST = types.float64(LAW_DATA, VECTOR, MATRIX)
"""(data, point, out frame): the signed distance (m) of a point (N,), and as many rows of N as the frame has.

Row `FOOT` is the closest point, `NORMAL` the outward unit normal there, the N rows from `SHAPE` on the shape operator
(1/m), and the first number of the row after it, in the plane, the arc length (m) from the curve's start.
"""


class Numbers(NamedTuple):
    """The arrays that an effect's change of an answer works on: fields of the effect's `Part`."""

    params: Array
    samples: Array
    state: Array


_NUMBERS_TYPE = types.NamedTuple((VECTOR, MATRIX, MATRIX), Numbers)  # type: ignore[no-untyped-call]
_CLOSEST_TYPE = types.NamedTuple((types.FunctionType(CLOSEST), LAW_DATA), Closest)  # type: ignore[no-untyped-call]
CHANGE = types.int64(_NUMBERS_TYPE, _CLOSEST_TYPE, VECTOR, VECTOR, types.float64, VECTOR, VECTOR)
"""(numbers, closest, hip, velocity, dt, ihip, force): an effect's change of an answer, in place, after each tick.

Returns 0, or where the hand has left the effect's domain the number that its `domain_exits` words.
"""


class Change(NamedTuple):
    """An effect's change of an answer: `function`, of signature `CHANGE`, and what it works on."""

    function: Callable[..., int]
    numbers: Numbers


class Composed(NamedTuple):
    """A renderer's compiled `law` with the effects' `changes` of its answers, in order: the data of the whole step."""

    law: Callable[..., int]
    data: LawData
    changes: tuple[Change, ...]
    closest: Closest


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


def record_type(*names: str, base: np.dtype[Any] | None = None, **sizes: int) -> np.dtype[Any]:
    """Return the type of a record of float64: what `base` has, then the numbers `names`, then vectors of some `sizes`.

    A vector of space, 3, serves the plane too, where its last number is not used.
    """
    first = [] if base is None else [(name, base[name]) for name in base.names or ()]
    numbers = [(name, np.dtype(np.float64)) for name in names]
    return np.dtype([*first, *numbers, *((name, np.float64, size) for name, size in sizes.items())], align=True)


def room_for(record: np.dtype[Any]) -> int:
    """Return how many numbers a record takes."""
    return record.itemsize // np.dtype(np.float64).itemsize


def numbers_of(record: np.dtype[Any], **fields: ArrayLike) -> Array:
    """Return the numbers (k,) of a record in a row, as kernels take them, of all its fields: numbers and vectors.

    A vector may be shorter than its field: the rest is zero.
    """
    numbers = np.zeros(room_for(record))
    for name in record.names or ():
        start = record.fields[name][1] // numbers.itemsize  # type: ignore[index]
        values = np.ravel(fields.pop(name))
        numbers[start : start + values.size] = values
    assert not fields, fields
    return numbers


def as_record(numbers: Array, record: np.dtype[Any], at: int = 0) -> Any:
    """Return the record that begins at `numbers[at]`, of numbers (k,) or of rows (n, k): `state.normal[0]`.

    Their units, N, m or none, are those of the record's fields.

    Nothing is copied: a field is read and written where it is. So numbers have names inside of kernels, and to the
    outside one type: what takes them is compiled once, whatever record they are.

    A kernel takes it of arrays that it is given: one of its own may be gone before the record, which does not hold it.
    """
    # Its numbers in a row, as one record, whose fields are attributes.
    return numbers[at:].reshape(-1)[: room_for(record)].view(record).view(np.recarray)[0]


def as_records(rows: Array, record: np.dtype[Any]) -> Any:
    """Return the record that each of the rows (n, k) begins with, in their order: `joints.turn` is (n,).

    Their units, N, m or none, are those of the record's fields. Nothing is copied; kernels ask for one row's record.
    """
    return rows[:, : room_for(record)].view(record)[:, 0].view(np.recarray)


@type_callable(as_record)
def _type_record(_context: Any) -> Any:
    """Tell numba the type of what `as_record` gives."""

    def type_of(numbers: Any, record: Any, at: Any = None) -> Any:  # noqa: ARG001 - as the call has them
        return record.dtype

    return type_of


@lower_builtin(as_record, types.Array, types.DType)  # type: ignore[no-untyped-call, untyped-decorator]
@lower_builtin(as_record, types.Array, types.DType, types.Integer)  # type: ignore[no-untyped-call, untyped-decorator]
def _lower_record(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    """Give the record as numba has one, by its address: that of the number or the row, which are contiguous."""
    own_array: Any = make_array
    rows = own_array(signature.args[0])(context, builder, arguments[0])
    start = rows.data
    if len(arguments) == 3:
        index = context.cast(builder, arguments[2], signature.args[2], types.intp)
        columns = builder.extract_value(rows.shape, 1) if signature.args[0].ndim == 2 else index.type(1)
        start = builder.gep(start, [builder.mul(index, columns)])
    return builder.bitcast(start, context.get_value_type(signature.return_type))


def law_value(function: Callable[..., Any], data: Any) -> FirstClass:
    """Return a compiled step as a value: of signature `LAW`, with the type of its own data in place of `LawData`."""
    # Another tuple, of a law with effects, has a type of its own, and so the kernel a signature of its own.
    if isinstance(data, LawData):
        return first_class(function, LAW)
    return first_class(function, types.int64(numba.typeof(data), *LAW.args[1:]))  # type: ignore[no-untyped-call]


def compiled(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a numeric function with numba on its first call and keep the code on disk.

    No fast-math: the same command must give the same verdicts, bit for bit, on the same machine.

    Of several processes that want a kernel at the same time one compiles it, and the others wait for what it keeps.
    Else each would do all the work, and two that write to a cache at once may leave an index that leads to other code.
    """
    return _compile_once_on_disk(function, _nrt=True)


@cache
def compiled_once(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a plain function as `compiled` does, at its first use: its module is imported without numba.

    `compiled` decorates a function where it is defined. Here every caller gets the same kernel.
    """
    return compiled(function)


def borrowing(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function that makes no arrays: it borrows those that it is given, and counts no references to them.

    A kernel that is given a tuple of many arrays would else spend more time on counting than on its work.
    """
    return _compile_once_on_disk(function, _nrt=False)


def inner(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function that borrows its arrays, as a part of the kernels that call it by its name."""
    return _compile_once_on_disk(function, _nrt=False, forceinline=True)


@contextmanager
def _cached_in(folder: Path) -> Iterator[None]:
    """While it lasts, numba places what it caches below a folder: kernels of other packages stay where theirs are."""
    before = numba.config.CACHE_DIR  # type: ignore[attr-defined]
    numba.config.CACHE_DIR = str(folder)  # type: ignore[attr-defined]
    try:
        yield
    finally:
        numba.config.CACHE_DIR = before  # type: ignore[attr-defined]


def _compile_once_on_disk(function: Callable[P, R], **options: Any) -> Callable[P, R]:
    """Return the kernel of a function, which Python calls, with a second one for the kernels that call it by its name.

    The second, `called`, is without numba's ways in from Python and from C, which are a third of the work of compiling.
    Each has a cache of its own.

    Numba asks a kernel twice for what another one calls: `get_call_template` types the call, `get_overload` gives the
    code. Both are replaced, so that they answer from `called`; and from the kernel itself for types with which Python
    has called it already.
    """
    folder = folder_of(function.__module__)
    kernel = _dispatcher(function, folder, **options)
    if not hasattr(kernel, "compile"):  # NUMBA_DISABLE_JIT is set
        return function
    called = _dispatcher(
        function,
        folder / "called",
        **options,
        no_cpython_wrapper=True,
        no_cfunc_wrapper=True,
        pipeline_class=_LinkedCompiler if LINKS_IN <= numba.version_info.short < LINKS_BEFORE else Compiler,
    )
    kernel.called = called
    own_call_template, own_overload = kernel.get_call_template, kernel.get_overload

    plain_type: Any = types.unliteral
    types_in: Any = normalize_signature

    def call_template(arguments: Any, keywords: Any) -> Any:
        # a constant has a type of its own, for which the kernel would be compiled once more
        arguments = tuple(map(plain_type, arguments))
        keywords = {name: plain_type(argument) for name, argument in keywords.items()}
        _, signature = kernel._compiler.fold_argument_types(arguments, keywords)
        # what Python has called already is there with all its ways in
        template = own_call_template if tuple(signature) in kernel.overloads else called.get_call_template
        return template(arguments, keywords)

    def overload(signature: Any) -> Any:
        arguments, _ = types_in(signature)
        return (called.get_overload if tuple(arguments) in called.overloads else own_overload)(signature)

    kernel.get_call_template, kernel.get_overload = call_template, overload
    return kernel  # type: ignore[no-any-return]


class _LinkedLibrary(JITCodeLibrary):
    """The code of a kernel that others call: it becomes a part of theirs, so no machine code is made of it alone.

    Numba makes machine code of each such kernel too, which nothing runs.
    """

    def _optimize_final_module(self) -> None:
        # The first of numba's two rounds: who calls it has both run over all that it is linked with.
        codegen: Any = self._codegen
        manager = codegen._module_pass_manager(
            loop_vectorize=codegen._loopvect, slp_vectorize=False, opt=codegen._opt_level, cost="cheap"
        )
        passes, *builder = manager if isinstance(manager, tuple) else (manager,)  # numba 0.61 has no builder
        passes.run(self._final_module, *builder)

    def _finalize_final_module(self) -> None:
        self._shared_module = linked = self._final_module
        for function in linked.functions:
            if not function.is_declaration and function.linkage == Linkage.external:
                function.linkage = "linkonce_odr"  # as numba has it: each of those that it is linked with has a copy
        # Numba sets the environment of each kernel that it compiles or loads: that alone gets a place in memory.
        places = [str(place) for place in linked.global_variables if place.name.startswith(ENVIRONMENT)]
        codegen: Any = self._codegen
        self._final_module = parse_assembly("\n".join([str(codegen._create_empty_module(self.name)), *places]))
        super()._finalize_final_module()  # type: ignore[no-untyped-call]


class _LinkedCompiler(Compiler):
    """Numba's compiler, into a `_LinkedLibrary`."""

    def compile_extra(self, func: Callable[..., Any]) -> Any:
        """Compile a function, as numba calls this."""
        library: Any = _LinkedLibrary
        self.state.library = library(self.state.targetctx.codegen(), func.__qualname__)
        self.state.library.enable_object_caching()
        return super().compile_extra(func)  # type: ignore[no-untyped-call]


def _dispatcher(function: Callable[..., Any], folder: Path, **options: Any) -> Any:
    """Return what compiles a function for the types of its arguments, and keeps the code below a folder."""
    with _cached_in(folder):  # numba settles where it caches a kernel when it decorates it
        kernel: Any = numba.njit(cache=True, error_model="numpy", **options)(function)
    if not hasattr(kernel, "compile"):
        return kernel
    compile_ = kernel.compile
    lock = Path(kernel.stats.cache_path, f"{function.__module__}.{function.__qualname__}.lock")

    def compile_alone(signature: Any) -> Any:
        # Compiled already in this process: nothing to lock for.
        if signature in kernel.overloads:
            return compile_(signature)
        # A process that compiles a kernel waits for nothing but what that calls: no two wait for each other. Nor do two
        # threads of one, which take numba's own lock first.
        with global_compiler_lock, compiling(), lock_file(lock):
            return compile_(signature)

    kernel.compile = compile_alone
    return kernel


def specialised(kernel: Callable[P, R], *arguments: Any) -> Callable[P, R]:
    """Return the code of a kernel for arguments of these types alone: calls of it do not look types up."""
    if not hasattr(kernel, "overloads"):  # NUMBA_DISABLE_JIT is set
        return kernel
    signature = tuple(numba.typeof(argument) for argument in arguments)  # type: ignore[no-untyped-call]
    kernel.compile(signature)  # type: ignore[attr-defined]
    return kernel.overloads[signature].entry_point  # type: ignore[no-any-return]


def machine_code(kernel: Callable[..., Any], *arguments: Any) -> bytes:
    """Return the machine code of a kernel for such arguments, values or their types, as bytes.

    They hold what it calls by name, and not what it is given as `first_class`. Numba gives up the object that it loads
    or makes; its cache keeps it.
    """
    from llvmlite.binding import ObjectFileRef

    own: Any = kernel
    typeof: Any = numba.typeof
    signature = tuple(argument if isinstance(argument, types.Type) else typeof(argument) for argument in arguments)
    own.compile(signature)
    # Numba's private cache, by the key that it would look for itself.
    cache_entry = own._cache._cache_file.load(own._cache._index_key(signature, own.targetctx.codegen()))
    (_, _, (code, _)), *_ = cache_entry
    return b"".join(section.data() for section in ObjectFileRef.from_data(code).sections() if section.is_text())


def for_kernels(values: NDArray[T]) -> NDArray[T]:
    """Return an array as kernels take it, writable and contiguous: a copy, unless it is so already.

    `values` have any shape, (n,) or (rows, columns), and any unit, m or N or none; the result has the same.

    To numba an array that is locked, or a slice with gaps, has a type of its own, for which a kernel and all that it
    calls would be compiled again. Value types lock what they show; what they give to kernels goes through here.
    """
    # carray: contiguous, aligned and writable.
    return values if values.flags.carray else np.require(values, requirements=["C", "W"])


class FirstClass(types.WrapperAddressProtocol):
    """A compiled function as a value that other compiled code takes as an argument.

    Code that takes it is compiled once for the signature, not once a function, and its cache on disk holds for all.
    Arrays must be writable and contiguous, as the signatures above say.
    """

    def __init__(self, kernel: Callable[..., Any], signature: Any) -> None:
        # The address exists only for a signature that is compiled.
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
    """Return the type that is kept: numba would make it anew at each call, which takes longer than a kernel's tick."""
    return value.type


@lru_cache(maxsize=128)
def first_class(kernel: Callable[..., Any], signature: Any) -> FirstClass:
    """Return a `kernel`, made by `compiled`, as a value of the given signature (`LAW`, `KINEMATICS`, ...)."""
    return FirstClass(kernel, signature)


@borrowing
def lead_by_law(
    law: Callable[..., Any], data: Any, push: Array, hips: Array, velocities: Array, dt: Array, ihips: Array,
    forces: Array, reported: Array, contact: Array,
) -> tuple[int, int]:  # fmt: skip
    """Answer each row of a path by a law, a tick a row, from the state that it has.

    `hips` (n, N), m, and `velocities` (n, N), m/s, are the hand's, and `push` (N,), N, what it is sensed to push; tick
    k lasts `dt[k]` s. Writes `ihips` (n, N), m, and `forces` (n, N), N. What the law leaves in `reported` (1,), unless
    that is empty, goes to `contact` (n,). Returns the row at which the hand leaves the law's domain or the law
    breaks, and its number; else n and 0.
    """
    for row in range(hips.shape[0]):
        number = law(data, hips[row], velocities[row], push, dt[row], ihips[row], forces[row])
        if number != 0:
            return row, number
        for i in range(reported.shape[0]):
            contact[row] = reported[i]
    return hips.shape[0], 0


EXITS_PER_EFFECT = 1000
"""Domain exits of the k-th effect, from 1, are numbered from EXITS_PER_EFFECT k on."""


@borrowing
def change_row(
    changes: tuple[Change, ...], closest: Closest, hip: Array, velocity: Array, dt: float, ihip: Array, force: Array
) -> int:
    """Let the scene's effects change one answer in place, in their order; return 0, or a domain exit's number.

    `hip` (N,), m, and `velocity` (N,), m/s, are the hand's; `ihip` (N,), m, and `force` (N,), N, are changed.
    """
    for k in range(len(changes)):
        change = changes[k]
        exit_number = change.function(change.numbers, closest, hip, velocity, dt, ihip, force)
        if exit_number != 0:  # numbered so that it tells the effect too
            return EXITS_PER_EFFECT * (k + 1) + exit_number
    return 0


@borrowing
def change_rows(
    changes: tuple[Change, ...], closest: Closest, hips: Array, velocities: Array, dt: float, ihips: Array,
    forces: Array,
) -> tuple[int, int]:  # fmt: skip
    """Change the answers to a path row by row; return the row where the hand leaves a domain, and the number, or 0.

    `hips` (n, N), m, and `velocities` (n, N), m/s, are the hand's; `ihips` (n, N), m, and `forces` (n, N), N, are
    changed.
    """
    for row in range(hips.shape[0]):
        exit_number = change_row(changes, closest, hips[row], velocities[row], dt, ihips[row], forces[row])
        if exit_number != 0:
            return row, exit_number
    return hips.shape[0], 0


@borrowing
def answer(
    data: Composed, hip: Array, velocity: Array, push: Array, dt: float, ihip: Array, force: Array
) -> int:  # fmt: skip
    """One tick of a renderer with effects, of signature `LAW` but for its data: its own law, then the changes.

    `hip` (N,), m, `velocity` (N,), m/s, and `push` (N,), N, are the hand's; `ihip` (N,), m, and `force` (N,), N, are
    written.
    """
    exit_number = data.law(data.data, hip, velocity, push, dt, ihip, force)
    if exit_number != 0:
        return exit_number
    return change_row(data.changes, data.closest, hip, velocity, dt, ihip, force)
