"""Harmonic balance with the harmonics that return: how far a describing function's solution is off.

The describing function keeps the fundamental alone. Here the harmonics that H returns to the block's input are kept
too, u = a cos(omega t) + Re sum U_k exp(j k omega t) with U_k = -H(j k omega) Y_k(u), and the cycle is solved for
again from the prediction. What that moves is the error of the prediction. The exact orbit is another matter
(`ctrl_df.find_limit_cycle`): this is the same approximation with more terms.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import control as ct
import numpy as np

from ..blocks.memoryless import Element
from ..blocks.primitives import PiecewiseAffine, Play
from ..df.dispatch import Method

SAMPLES = 2048
STATIC_HARMONICS, DYNAMIC_HARMONICS = 63, 21
_ROUNDS, _MEMORY = 40, 8


@dataclass(frozen=True)
class Balance:
    """The outcome: corrected amplitude and frequency, or None with the reason."""

    solution: tuple[float, float] | None
    reason: str = ""


def balance(respond: Callable, harmonics: int, linear, amplitude, omega, jacobian) -> Balance:
    """Solve for the cycle with `harmonics` harmonics, starting from the describing function's solution.

    Parameters
    ----------
    respond : callable
        ``respond(U, omega) -> Y``: coefficients k = 0..harmonics of the block's steady output for those of its input;
        None where the block has no periodic answer.
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
            return Balance((float(np.exp(x[0])), float(np.exp(x[1]))))
    if abs(D) < 5e-4:
        return Balance((float(np.exp(x[0])), float(np.exp(x[1]))))
    return Balance(None, "with its harmonics no cycle is found near")


def responder(F, method: Method) -> tuple[Callable, int] | None:
    """Return how the block answers a waveform, and the harmonics to keep; None where that is not known."""
    if method.name == "element":
        law = _waveform_law(method.subject)
        return None if law is None else (_sampled(law), STATIC_HARMONICS)
    if method.name == "law" and callable(method.subject):
        return _sampled(_pointwise(method.subject)), STATIC_HARMONICS
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


def _sampled(law):
    """Answer of a law on waveforms, by the discrete Fourier transform."""

    def respond(U, omega):
        full = np.zeros(SAMPLES // 2 + 1, dtype=complex)
        full[: U.size] = U * SAMPLES / 2
        full[0] *= 2
        Y = np.fft.rfft(np.asarray(law(np.fft.irfft(full, SAMPLES)), dtype=float))[: U.size] * 2 / SAMPLES
        Y[0] /= 2
        return Y

    return respond


def _orbits(block, output):
    """Answer of a block with dynamics: its forced periodic orbit under the whole waveform."""
    from .waveform import WaveformOrbit

    solver = WaveformOrbit(block, output)

    def respond(U, omega):
        return solver.respond(U, omega)

    return respond


def _waveform_law(block: Element):
    """Map of one period of input samples to one of steady output samples."""
    primitive = block.primitive
    if isinstance(primitive, Play):
        return lambda u: _played(u, primitive.gap / 2)
    if isinstance(primitive, PiecewiseAffine) and primitive.hysteretic:
        return (lambda u: _switched(u, primitive)) if len(primitive.slope) == 2 else None
    return getattr(primitive, "value", None)


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
    """Relay with hysteresis: the branch last forced, filled forward over two periods."""
    twice = np.concatenate([u, u])
    branch = np.where(twice > loop.high[0], 1, np.where(twice < loop.low[1], 0, -1))
    last = np.maximum.accumulate(np.where(branch >= 0, np.arange(twice.size), -1))[u.size :]
    upper = np.where(last >= 0, branch[np.maximum(last, 0)], 1) == 1
    return np.where(upper, loop.intercept[1] + loop.slope[1] * u, loop.intercept[0] + loop.slope[0] * u)
