"""Vectors in space for compiled code: tuples of three numbers, which cost no memory."""

from __future__ import annotations

from typing import TypeAlias

from hapticeval.compiled import compiled, inner
from hapticeval.types import Array

Triple: TypeAlias = tuple[float, float, float]


@inner
def triple_of(vector: Array) -> Triple:
    """Return a vector (3,) of a record as three numbers of its unit, such as m."""
    return vector[0], vector[1], vector[2]


@compiled
def dot(a: Triple, b: Triple) -> float:
    """Return the scalar product of two vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled
def plus(a: Triple, factor: float, b: Triple) -> Triple:
    """Return a + factor b."""
    return a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2]


@inner
def minus(a: Triple, b: Triple) -> Triple:
    """Return a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@inner
def cross(a: Triple, b: Triple) -> Triple:
    """Return the vector product a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@inner
def scaled(factor: float, a: Triple) -> Triple:
    """Return factor a."""
    return factor * a[0], factor * a[1], factor * a[2]


@inner
def triple_at(row: Array, first: int) -> Triple:
    """Return the vector, of any unit such as m, that stands in a row (n,) from place `first` on."""
    return row[first], row[first + 1], row[first + 2]


@inner
def put_triple(row: Array, first: int, a: Triple) -> None:
    """Write a vector, of any unit such as m, into a row (n,) from place `first` on."""
    row[first], row[first + 1], row[first + 2] = a
