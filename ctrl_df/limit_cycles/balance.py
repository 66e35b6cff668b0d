"""Harmonic balance with the harmonics that return: how far a describing function's solution is off.

The describing function keeps the fundamental alone. Here the harmonics that H returns to the block's input
are kept too, u = a cos(omega t) + Re sum U_k exp(j k omega t) with U_k = -H(j k omega) Y_k(u), and the cycle
is solved for again from the prediction. What that moves is the error of the prediction. The exact orbit is
another matter (`ctrl_df.find_limit_cycle`): this is the same approximation with more terms.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import control as ct
import numpy as np

from ..blocks.element import Element
from ..blocks.primitives import PiecewiseAffine, Play
from ..df.dispatch import Method

SAMPLES = 2048
STATIC_HARMONICS, DYNAMIC_HARMONICS = 63, 21
_ROUNDS, _MEMORY = 40, 8


@dataclass(frozen=True)
class Balance:
    """Corrected amplitude and frequency, with the block's input as Fourier coefficients, or why none."""

    solution: tuple[float, float] | None
    reason: str = ""
    waveform: np.ndarray | None = None


def balance(respond: Callable, harmonics: int, linear, amplitude, omega, jacobian) -> Balance:
    """Solve for the cycle with `harmonics` harmonics, starting from the describing function's solution.

    Parameters
    ----------
    respond : callable
        ``respond(U, omega) -> Y``: coefficients k = 0..harmonics of the block's steady output for those of
        its input; None where the block has no periodic answer.
    harmonics : int
    linear : LinearPart
    amplitude, omega : float
        Where the search starts.
    jacobian : ndarray, shape (2, 2)
        Derivatives of D = 1 + N H by (ln a, ln omega) there.
    """
    x = np.array([np.log(amplitude), np.log(omega)])
    start, U = x.copy(), np.zeros(harmonics + 1, dtype=complex)
    slope = np.array(jacobian, dtype=float)
    previous = None
    for _ in range(25):
        D, U = _defect(respond, linear, float(np.exp(x[0])), float(np.exp(x[1])), U)
        if D is None:
            return Balance(None, "the harmonics do not settle")
        value = np.array([D.real, D.imag])
        if previous is not None:  # Broyden's update keeps the matrix true where the curves bend
            moved, gained = x - previous[0], value - previous[1]
            if moved @ moved > 0:
                slope = slope + np.outer(gained - slope @ moved, moved) / (moved @ moved)
        try:
            step = -np.linalg.solve(slope, value)
        except np.linalg.LinAlgError:
            return Balance(None, "the curves are tangent")
        step *= min(1.0, 0.15 / max(np.abs(step).max(), 1e-300))
        previous, x = (x, value), x + step
        if np.abs(x - start).max() > 1.5:
            return Balance(None, "with its harmonics the cycle moves out of reach")
        if np.abs(step).max() < 1e-5:
            return Balance((float(np.exp(x[0])), float(np.exp(x[1]))), waveform=U)
    if abs(D) < 1e-3:
        return Balance((float(np.exp(x[0])), float(np.exp(x[1]))), waveform=U)
    return Balance(None, "with its harmonics no cycle is found near")


def responder(F, method: Method) -> tuple[Callable, int] | None:
    """Return how the block answers a waveform, and the harmonics to keep; None where that is not known."""
    if method.name == "element":
        cells = _element_cells(method.subject)
        return None if cells is None else (_sampled(cells), STATIC_HARMONICS)
    if method.name == "law" and callable(method.subject):
        return _sampled(_cell_means(_pointwise(method.subject))), STATIC_HARMONICS
    if method.name in ("friction", "backlash", "orbit") and isinstance(F, ct.NonlinearIOSystem):
        return _orbits(F, method.output), DYNAMIC_HARMONICS
    return None


def _defect(respond, linear, a, omega, U):
    """1 + N H with the harmonics settled at (a, omega); starts from those of the last call."""
    k = np.arange(U.size)
    H, _ = linear.clamped(np.maximum(k, 1) * omega)
    H = np.where(np.isfinite(H), H, 0)
    H[0] = 0 if np.isnan(linear.static_gain) else linear.static_gain
    U = U.copy()
    U[1] = a
    inputs: list[np.ndarray] = []
    excesses: list[np.ndarray] = []
    best, Y = np.inf, None
    for _ in range(_ROUNDS):
        Y = respond(U, omega)
        if Y is None or not np.isfinite(Y).all():
            return None, U
        fresh = -H * Y
        fresh[1] = a
        change = float(np.abs(fresh - U).max() / a)
        best = min(best, change)
        if change < 1e-6 or not np.isfinite(change) or change > 1e3:
            break
        inputs, excesses = [*inputs[-_MEMORY:], U], [*excesses[-_MEMORY:], fresh - U]
        U = _mixed(inputs, excesses)
        U[1] = a
    if not best < 3e-3 or Y is None:
        return None, U
    return 1 + Y[1] / a * H[1], U


def _mixed(inputs, excesses):
    """Anderson's mixing: the combination of the last rounds whose excess is least, then a step along it."""
    if len(inputs) == 1:
        return inputs[0] + 0.7 * excesses[0]
    real = np.array([np.concatenate([e.real, e.imag]) for e in excesses])
    change = np.diff(real, axis=0).T
    weights = np.linalg.lstsq(change, real[-1], rcond=1e-8)[0]
    moved = np.diff(np.array(inputs), axis=0).T @ weights
    gained = np.diff(np.array(excesses), axis=0).T @ weights
    return inputs[-1] + excesses[-1] - moved - gained


def _sampled(cells):
    """Answer of a law on waveforms; `cells` maps samples of the input to means of the output between them.

    Means, not samples: a jump then moves the answer smoothly with its place instead of from sample to sample.
    """

    def respond(U, omega):
        full = np.zeros(SAMPLES // 2 + 1, dtype=complex)
        full[: U.size] = U * SAMPLES / 2
        full[0] *= 2
        k = np.arange(U.size)
        Y = np.fft.rfft(cells(np.fft.irfft(full, SAMPLES)))[: U.size] * 2 / SAMPLES
        Y *= np.sinc(k / SAMPLES) * np.exp(-1j * np.pi * k / SAMPLES)
        Y[0] /= 2
        return Y

    return respond


_INSIDE = (np.arange(64) + 0.5) / 64


def _cell_means(law):
    """Means of a static law between samples: trapezoids, but where it jumps many points of the chord."""

    def cells(u):
        after = np.roll(u, -1)
        y = np.asarray(law(u), dtype=float)
        ahead = np.roll(y, -1)
        mean = 0.5 * (y + ahead)
        rise = np.abs(ahead - y)
        jumps = rise > 20 * np.median(rise) + 1e-9 * np.abs(y).max()
        if jumps.any():
            chord = u[jumps, None] + (after - u)[jumps, None] * _INSIDE
            mean[jumps] = np.asarray(law(chord.ravel()), dtype=float).reshape(chord.shape).mean(axis=1)
        return mean

    return cells


def _orbits(block, output):
    """Answer of a block with dynamics: its forced periodic orbit under the whole waveform."""
    from .waveform import WaveformOrbit

    solver = WaveformOrbit(block, output)

    def respond(U, omega):
        return solver.respond(U, omega)

    return respond


def _element_cells(block: Element):
    """Map samples of one period to means of the steady output between them."""
    primitive = block.primitive
    if isinstance(primitive, Play):
        return lambda u: _between(_played(u, primitive.gap / 2))
    if isinstance(primitive, PiecewiseAffine) and primitive.hysteretic:
        return (lambda u: _switched(u, primitive)) if len(primitive.slope) == 2 else None
    value = getattr(primitive, "value", None)
    return None if value is None else _cell_means(value)


def _between(y):
    return 0.5 * (y + np.roll(y, -1))


def _pointwise(f):
    def law(u):
        try:
            y = np.asarray(f(u), dtype=float)
            if y.shape == u.shape and y[0] == f(float(u[0])):
                return y
        except Exception:  # written for scalars: whatever it raises on an array, it is asked point by point
            pass
        return np.array([float(np.squeeze(f(float(v)))) for v in u])

    return law


def _played(u, half):
    center, out = 0.0, np.empty_like(u)
    for _ in range(2):
        for i, v in enumerate(u.tolist()):
            center = v - half if center < v - half else v + half if center > v + half else center
            out[i] = center
    return out


def _switched(u, loop: PiecewiseAffine):
    """Relay with hysteresis: the branch last forced, filled forward; switchings lie between samples."""
    n = u.size
    twice = np.concatenate([u, u])
    forced = np.where(twice > loop.high[0], 1, np.where(twice < loop.low[1], 0, -1))
    last = np.maximum.accumulate(np.where(forced >= 0, np.arange(2 * n), -1))[n:]
    upper = np.where(last >= 0, forced[np.maximum(last, 0)], 1) == 1
    before = np.where(upper, 1, 0)
    after = np.roll(before, -1)
    edge = np.where(after == 1, loop.high[0], loop.low[1])
    span = np.roll(u, -1) - u
    with np.errstate(all="ignore"):
        share = np.where(
            before == after, 1.0, np.clip((edge - u) / span, 0, 1)
        )  # of the cell on the old branch
    slope, intercept = np.array(loop.slope), np.array(loop.intercept)
    middle = 0.5 * (u + np.roll(u, -1))
    old, new = (intercept[i] + slope[i] * middle for i in (before, after))
    return share * old + (1 - share) * new
