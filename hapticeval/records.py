"""Names for the numbers of compiled code: records in arrays of float64, read and written where they are."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import types
from numba.extending import lower_builtin, type_callable
from numba.np.arrayobj import make_array
from numpy.typing import ArrayLike

from hapticeval.types import Array


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
    row = numbers[at:].reshape(-1)[: room_for(record)]  # the record's own numbers, of rows too
    one_record = row.view(record)  # the same memory with the record's type
    return one_record.view(np.recarray)[0]  # fields as attributes


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
