"""Compile inner loops with numba, here and nowhere else, so that every kernel is cached and typed alike.

Compiling all kernels takes longer than most runs. So each is compiled once: for one type of its arguments, see
`for_kernels`, and by one process, see `compiled`.

How a function is compiled:

- `compiled`: it makes arrays of its own.
- `borrowing`: it makes none, and counts no references to those that it is given.
- `inner`: like `borrowing`, and a part of each kernel that calls it: what is short, or left out for an argument None.
- `compiled_on_demand`: at its first use and not where it is defined, in a module that is imported without numba.

How compiled code gets at another function:

- By its name: it is compiled for that one.
- By `first_class` as an argument, and for a renderer's law by `laws.law_value`: it is compiled once for all of a
  signature.
- Python calls a kernel in each tick by `specialised`: the types of its arguments are not looked up again.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache, lru_cache
from pathlib import Path
from types import FunctionType
from typing import Any, ParamSpec, TypeVar

import numba
import numpy as np
from numba import types
from numba.core.compiler_lock import global_compiler_lock
from numba.core.sigutils import normalize_signature
from numba.core.typing.typeof import typeof_impl
from numba.experimental.function_type import _get_wrapper_address
from numpy.typing import NDArray

from hapticeval.kernel_cache import folder_of, lock_file
from hapticeval.pulse import compiling

P = ParamSpec("P")
R = TypeVar("R")
T = TypeVar("T", bound=np.generic)


def compiled(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a numeric function with numba on its first call and keep the code on disk.

    No fast-math: the same command must give the same verdicts, bit for bit, on the same machine.

    Of several processes that want a kernel at the same time one compiles it, and the others wait for what it keeps.
    Else each would do all the work, and two that write to a cache at once may leave an index that leads to other code.
    """
    return _compile_once_on_disk(function, _nrt=True)


@cache
def compiled_on_demand(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a plain function as `compiled` does, at its first use: its module is imported without numba.

    `compiled` decorates a function where it is defined. Here every caller gets the same kernel.
    """
    return compiled(function)


def as_python(function: Callable[P, R]) -> Callable[P, R]:
    """Return a plain function that calls the kernels of its module in Python too: for what no kernel takes.

    A kernel is given arrays and compiled functions. An answer of Python's, such as a boundary's of one's own, is none.
    """
    names = {name: getattr(value, "py_func", value) for name, value in function.__globals__.items()}
    return FunctionType(function.__code__, names, function.__name__)


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

    The second, `called`, is without numba's ways in from Python and from C: with them a start from an empty cache takes
    12 % more. Each has a cache of its own.

    Numba asks a kernel twice for what another one calls: `get_call_template` types the call, `get_overload` gives the
    code. Both are replaced, so that they answer from `called`; and from the kernel itself for types with which Python
    has called it already.
    """
    folder = folder_of(function.__module__)
    kernel = _dispatcher(function, folder, **options)
    if not hasattr(kernel, "compile"):  # NUMBA_DISABLE_JIT is set
        return function
    called = _dispatcher(function, folder / "called", **options, no_cpython_wrapper=True, no_cfunc_wrapper=True)
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
    Arrays must be writable and contiguous, as the signatures in `laws` say.
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
    """Return a `kernel`, made by `compiled`, as a value of a signature of `laws`."""
    return FirstClass(kernel, signature)
