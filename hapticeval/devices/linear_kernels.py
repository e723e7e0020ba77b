"""Small linear systems for compiled loops."""

from __future__ import annotations

from hapticeval.compiled import compiled
from hapticeval.types import Array


@compiled
def solve(matrix: Array, vector: Array) -> None:
    """Replace `vector` (N,) by matrix⁻¹ vector; `matrix` (N, N) is overwritten. Elimination with row exchange."""
    size = vector.shape[0]
    for column in range(size - 1):
        pivot = column
        for i in range(column + 1, size):
            if abs(matrix[i, column]) > abs(matrix[pivot, column]):
                pivot = i
        if pivot != column:
            for k in range(column, size):
                matrix[column, k], matrix[pivot, k] = matrix[pivot, k], matrix[column, k]
            vector[column], vector[pivot] = vector[pivot], vector[column]
        for i in range(column + 1, size):
            if matrix[i, column] != 0.0:
                factor = matrix[i, column] / matrix[column, column]
                for k in range(column + 1, size):
                    matrix[i, k] -= factor * matrix[column, k]
                vector[i] -= factor * vector[column]
    for i in range(size - 1, -1, -1):
        total = vector[i]
        for k in range(i + 1, size):
            total -= matrix[i, k] * vector[k]
        vector[i] = total / matrix[i, i]
