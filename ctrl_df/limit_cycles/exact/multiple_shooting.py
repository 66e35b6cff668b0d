"""Multiple shooting: an orbit from states all along it, where single shooting would lose the guess.

Over a period errors grow by the largest multiplier, over an eighth of it only by its eighth root. Orbits that
repel strongly are therefore closed from the states along the predicted motion.

References
----------
Bock & Plitt (1984), A multiple shooting algorithm for direct solution of optimal control problems.
"""

from __future__ import annotations

import numpy as np

from ...thresholds import NEWTON_FAR, NOTHING, ROUNDED
from .thresholds import PIECE_HALVINGS, PIECES_CLOSED, PIECES_LONGEST, STALLED


def close_pieces(tracer, rebuilt, states, period: float, size) -> tuple[np.ndarray, float] | None:
    """Make the pieces of an orbit meet.

    Parameters
    ----------
    tracer : Tracer
    rebuilt : callable
        ``rebuilt(x) -> State`` with modes in line.
    states : (m, n) array
        Estimates at times 0, period/m, ...
    period : float
        Estimate [s].
    size : (n,) array
        Scale of each state.

    Returns
    -------
    (state, period) or None
        A point of the orbit, or None where the pieces do not meet.
    """
    m, n = states.shape
    z = np.append((states / size).ravel(), 0.0)  # the last one: logarithm of the period's change
    best = None
    for _ in range(NEWTON_FAR):
        pieces = _pieces(tracer, rebuilt, z, m, n, period, size)
        if pieces is None:
            return None
        residual, J = pieces
        worst = float(np.max(np.abs(residual)))
        if worst < PIECES_CLOSED:
            return z[:n] * size, period * float(np.exp(z[-1]))
        step = np.linalg.lstsq(J, -residual, rcond=ROUNDED)[0]
        step *= min(1.0, PIECES_LONGEST / max(float(np.max(np.abs(step))), NOTHING))
        norm = float(np.linalg.norm(residual))
        for _halving in range(PIECE_HALVINGS):  # shorter while the pieces come apart
            trial = _pieces(tracer, rebuilt, z + step, m, n, period, size, differentiate=False)
            if trial is not None and np.linalg.norm(trial[0]) < norm:
                break
            step *= 0.5
        else:
            if best is not None and worst > STALLED * best:
                return None
        best = worst if best is None else min(best, worst)
        z = z + step
        if abs(z[-1]) > 1.0:
            return None
    return None


def _pieces(tracer, rebuilt, z, m, n, period, size, differentiate=True):
    """Mismatch at all joints and the phase, with its derivatives; None where a piece cannot be followed."""
    span = period * np.exp(z[-1]) / m
    residual = np.zeros(m * n + 1)
    J = np.zeros((m * n + 1, m * n + 1))
    for i in range(m):
        start = rebuilt(z[i * n : (i + 1) * n] * size)
        traced = tracer.trace(start, span, differentiate=differentiate, size=size)
        if not traced.status.ok or not np.all(np.isfinite(traced.end.x)):
            return None
        after = (i + 1) % m
        rows = slice(i * n, (i + 1) * n)
        residual[rows] = traced.end.x / size - z[after * n : (after + 1) * n]
        if differentiate:
            if not np.all(np.isfinite(traced.monodromy)):
                return None
            J[rows, rows] += traced.monodromy * size / size[:, None]
            J[rows, after * n : (after + 1) * n] -= np.eye(n)
            J[rows, -1] = tracer.rate(traced.end.time, traced.end.x, traced.end.mode) * span / size
            if i == 0:
                rate = tracer.rate(start.time, start.x, start.mode) * period / size
                J[-1, :n] = rate / max(np.linalg.norm(rate), NOTHING)
    return residual, J
