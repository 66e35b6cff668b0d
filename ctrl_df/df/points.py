"""N at scattered pairs (A, omega), grouped so that methods that like grids see grids."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .methods import Method, Quadrature
from .threads import go_on
from .thresholds import NO_GAIN, SMALL_AMPLITUDES, UNBOUNDED

_RECTANGLE = 4  # the grid of distinct A and omega is computed whole up to so many times the points asked


@dataclass(frozen=True, eq=False)
class AtPairs:
    """N of one method at pairs of amplitude and frequency: what a finished family is asked off its grid."""

    method: Method

    @property
    def light(self) -> bool:
        """Whether points cost so little that pictures may ask for hundreds."""
        return self.method.quick or self.method.between

    def __call__(self, A, omega) -> tuple[np.ndarray, np.ndarray]:
        """Return N and regime at pairs of `A` and `omega`, which broadcast."""
        A, omega = np.broadcast_arrays(np.asarray(A, dtype=float), np.asarray(omega, dtype=float))
        N, regime, _ = points(self.method, A, omega if self.method.needs_omega else None)
        return N, regime


def points(method: Method, A, omega, zero_check=False):
    """N, regime and residual at pairs (A, omega), grouped so that grid solvers see grids.

    Parameters
    ----------
    method : Method
    A, omega : ndarray of one shape; omega may be None for a memoryless block
    zero_check : bool
        As in `describing_function`.

    Returns
    -------
    N : ndarray of complex
    regime : ndarray of str
    residual : ndarray
    """
    N, regime, residual = (
        np.empty(A.shape, dtype=complex),
        np.full(A.shape, "", dtype="U24"),
        np.zeros(A.shape),
    )
    flat, names, errors, a = N.reshape(-1), regime.reshape(-1), residual.reshape(-1), A.reshape(-1)
    zero = a == 0
    if zero.any():
        flat[zero] = _slope_at_zero(method, a.max(), zero_check)
    live = np.nonzero(~zero)[0]
    if not live.size:
        return N, regime, residual
    levels, row = np.unique(a[live], return_inverse=True)
    if not method.needs_omega or omega is None:
        y, kind, error = compute_part(method, levels, None, 1)
        flat[live], names[live], errors[live] = y[row, 0, 1], kind[row, 0], error[row, 0]
        return N, regime, residual
    w = omega.reshape(-1)[live]
    frequencies, column = np.unique(w, return_inverse=True)
    if levels.size * frequencies.size <= _RECTANGLE * live.size:
        y, kind, error = compute_part(method, levels, frequencies, 1)
        flat[live], names[live] = y[row, column, 1], kind[row, column]
        errors[live] = error[row, column]
        return N, regime, residual
    for k, frequency in enumerate(frequencies):
        mine = np.nonzero(column == k)[0]
        some, where = np.unique(row[mine], return_inverse=True)
        y, kind, error = compute_part(method, levels[some], np.array([frequency]), 1)
        flat[live[mine]], names[live[mine]] = y[where, 0, 1], kind[where, 0]
        errors[live[mine]] = error[where, 0]
    return N, regime, residual


def _slope_at_zero(method, largest, zero_check):
    """Limit of N for A -> 0: the slope at the origin, infinite across a jump."""
    if method.needs_omega:
        raise ValueError(
            "a dynamic block has no describing function at A = 0; got A=0. Leave zero out, or use "
            "ct.linearize."
        )
    if isinstance(method, Quadrature) and method.own_method is not None:
        return complex(method.own_method(0.0))
    if zero_check and isinstance(method, Quadrature):
        at_zero = np.squeeze(np.asarray(method.block(0.0), dtype=float))
        if at_zero != 0:
            raise ValueError(
                f"function must evaluate to zero at zero; got f(0) = {at_zero}. "
                "Subtract the bias, or pass zero_check=False."
            )
    small = (largest or 1.0) * np.array(SMALL_AMPLITUDES)
    N = method.harmonics(small, None, 1)[0][:, 0, 1]
    if abs(N[0]) > UNBOUNDED * abs(N[1]):
        return complex(np.inf)
    return N[0] if abs(N[0]) > NO_GAIN * abs(N[2]) else 0j


def compute_part(method: Method, A, omega, orders):
    """Compute a few lines of a family; a plain function, so that it can be sent to another process.

    Compiled closed forms ignore Ctrl-C: they are asked for some points at a time.
    """
    most = method.at_once
    if most is None or A.size * omega.size <= most:
        return (method.copied() or method).harmonics(A, omega, orders)
    rows = max(1, most // omega.size)
    pieces = [
        _row_of_pieces(method, A[i : i + rows], omega, orders, max(1, most // rows))
        for i in range(0, A.size, rows)
    ]
    return pieces[0] if len(pieces) == 1 else [np.concatenate(p) for p in zip(*pieces, strict=True)]


def _row_of_pieces(method, A, omega, orders, most):
    pieces = []
    for k in range(0, omega.size, most):
        go_on()
        pieces.append(method.harmonics(A, omega[k : k + most], orders))
    return [np.concatenate(p, axis=1) for p in zip(*pieces, strict=True)]
