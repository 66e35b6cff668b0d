"""Vectors and small matrices in compiled code."""

from __future__ import annotations

from ..compiler.compiled import part


@part(inline=True)
def copy(source, target):
    """Copy a vector in place."""
    for i in range(source.shape[0]):
        target[i] = source[i]


@part(inline=True)
def row_times(first, column, value, row, z):
    """One row of a matrix kept without its zeros, times z."""
    total = 0.0
    for i in range(first[row], first[row + 1]):
        total += value[i] * z[column[i]]
    return total


@part
def multiply(a, b, out):
    """Write a b to `out`; zeros of `a` cost nothing."""
    for i in range(a.shape[0]):
        for j in range(b.shape[1]):
            out[i, j] = 0.0
        for q in range(b.shape[0]):
            if a[i, q] != 0.0:
                for j in range(b.shape[1]):
                    out[i, j] += a[i, q] * b[q, j]
