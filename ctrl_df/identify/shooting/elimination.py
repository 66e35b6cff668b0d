"""Initial states eliminated: segment by segment, from products of what the output does.

Z = [derivatives by the states, whatever else is asked about] of a segment; each segment has few states, and
shares none. All segments are solved at once.
"""

from __future__ import annotations

import numpy as np

from ...thresholds import NOTHING
from ..prediction.segments import Segments
from .thresholds import COARSEST, RESOLVED


def products_of(states, others, weights, segments: Segments) -> np.ndarray:
    """Return Z' W Z of every segment, (nw, q, q), for Z = [states, others] (n, q)."""
    z = np.column_stack((states, others))
    weighted = z if weights is None else z * weights[:, None]
    products = np.empty((len(segments), z.shape[1], z.shape[1]))
    for i in range(z.shape[1]):
        column = segments.sums(weighted[:, i:] * z[:, i : i + 1])
        products[:, i, i:] = products[:, i:, i] = column
    return products


def states_for(products, precision, damping: float | np.ndarray = 0.0, off=None) -> np.ndarray:
    """Return the states (nw, ns, m) of every segment that come nearest to each of the other columns.

    Parameters
    ----------
    products : (nw, ns + m, ns + m) array
        Of `products_of`.
    precision : (nw, ns) array
        What is known of the states beforehand, in units of one sample.
    damping : float or (nw,) array
        Of Levenberg and Marquardt.
    off : (nw, ns) array or None
        How far the states are from what they are about; the last column is the residual.
    """
    ns = precision.shape[1]
    i = np.arange(ns)
    square, right = products[:, :ns, :ns].copy(), products[:, :ns, ns:].copy()
    square[:, i, i] += precision
    square[:, i, i] *= 1 + np.reshape(damping, (-1, 1))
    if off is not None:
        right[:, :, -1] -= precision * off
    # of one size, whatever the units: pivots are then chosen alike
    size = np.sqrt(square[:, i, i])[:, :, None]
    return np.linalg.solve(square / (size * size.transpose(0, 2, 1)), right / size) / size


def rounded_moves(moves, unit, curvature, power) -> np.ndarray:
    """Return moves rounded to what they matter by: a grid that does not depend on how arithmetic rounds.

    Laws with events pass a difference in the last digit on from step to step, larger and larger. Grids are
    powers of two of `unit`, so that sums of rounded moves are exact.

    Parameters
    ----------
    moves : array
    unit : float or array
        Size of what moves.
    curvature : array
        Of the cost, along each.
    power : float or array
        Mean squared error of a sample.
    """
    grid = RESOLVED * np.sqrt(power / np.maximum(curvature, NOTHING)) / unit
    grid = unit * np.exp2(np.floor(np.log2(np.clip(grid, NOTHING, COARSEST))))
    return np.round(moves / grid) * grid
