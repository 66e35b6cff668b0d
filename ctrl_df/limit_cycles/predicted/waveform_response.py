"""The steady-state response of a block to a periodic waveform: harmonics out for harmonics in."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import control as ct
import numpy as np

from ...blocks.elements.element import Element
from ...blocks.primitives import PiecewiseAffine, Play, Quantizer
from ...df.describing import quiet_describing_function
from ...df.dispatch import method_for
from ...df.forced_orbit.periodic_response import ForcedState, PeriodicResponse
from ...df.methods import ElementIntegrals, Method
from ...df.thresholds import EVEN_SEEN, JUMPS
from .thresholds import (
    CHORD_POINTS,
    DYNAMIC_HARMONICS,
    JUMP_DENSER,
    STATIC_HARMONICS,
    STEP_LEFT,
    WAVE_FLAT,
    WAVE_SAMPLES,
)


def response_of(F, method: Method) -> tuple[Response, int] | None:
    """Return the block's steady-state response to waveforms, and the harmonics to keep; None: not known."""
    if isinstance(method, ElementIntegrals):
        cells = _element_cells(method.block)
        return None if cells is None else (SampledResponse(cells), STATIC_HARMONICS)
    law = method.law()
    if law is not None:
        return SampledResponse(_cell_means(_pointwise(law))), STATIC_HARMONICS
    if method.dynamic and isinstance(F, ct.NonlinearIOSystem):
        return PeriodicResponse(F, method.output), DYNAMIC_HARMONICS
    return None


def response_of_block(block, output=None) -> tuple[Response, int] | None:
    """Return what `response_of` does, by the method that suits the block."""
    return response_of(block, method_for(block, output))


def described_gain(block, amplitude: float, omega: float | None = None) -> complex:
    """Return N of a block at one point, NaN where it has none."""
    return complex(quiet_describing_function(block, amplitude, omega))


def has_mean(Y: np.ndarray) -> bool:
    """Whether harmonics Y_k have a mean that no rounding explains."""
    return bool(abs(Y[0]) > EVEN_SEEN * np.abs(Y).max())


class Response(Protocol):
    """Steady-state response of a block: harmonics out for harmonics in."""

    def __call__(
        self, U: np.ndarray, omega: float, motion: ForcedState | None = None
    ) -> tuple[np.ndarray | None, ForcedState | None]:
        """Return Y_k, k < len(U), for the input ``Re sum U_k exp(j k omega t)``, and the block's motion.

        A block with dynamics may have several motions: the one near `motion` is sought. Y_k is None where
        the block has no periodic response.
        """
        ...

    def nearest(
        self, U: np.ndarray, omega: float, apart: Callable, near: float
    ) -> tuple[np.ndarray | None, ForcedState | None]:
        """Return of several responses the one least ``apart(Y)``; the first one `near`."""
        ...


@dataclass(frozen=True)
class SampledResponse:
    """Response of a law on waveforms; `cells` maps samples of the input to means of the output between them.

    Means, not samples: the response then changes smoothly with the place of a jump.
    """

    cells: Callable

    def __call__(self, U, omega, motion=None):
        """See `Response`; there is no motion."""
        full = np.zeros(WAVE_SAMPLES // 2 + 1, dtype=complex)
        full[: U.size] = U * WAVE_SAMPLES / 2
        full[0] *= 2
        k = np.arange(U.size)
        Y = np.fft.rfft(self.cells(np.fft.irfft(full, WAVE_SAMPLES)))[: U.size] * 2 / WAVE_SAMPLES
        Y *= np.sinc(k / WAVE_SAMPLES) * np.exp(-1j * np.pi * k / WAVE_SAMPLES)
        Y[0] /= 2
        return Y, None

    def nearest(self, U, omega, apart, near):
        """See `Response`: there is one."""
        return self(U, omega)


def jumps(method: Method, amplitude: float) -> bool:
    """Whether a law without time jumps under a sine of that amplitude; a hysteresis switches, so it does."""
    primitive = getattr(method.block, "primitive", None)
    if getattr(primitive, "hysteretic", False):
        return True
    law = getattr(primitive, "value", None)
    if law is None:
        law = method.law()
        if law is None:
            return False
        law = _pointwise(law)
    coarse, fine = (
        np.abs(np.diff(np.asarray(law(amplitude * np.cos(np.linspace(0, 2 * np.pi, n))), dtype=float))).max()
        for n in (WAVE_SAMPLES, JUMP_DENSER * WAVE_SAMPLES)
    )
    return bool(fine > STEP_LEFT * coarse)


def _cell_means(law):
    """Means of a static law between samples: trapezoids, but where it jumps many points of the chord."""

    def cells(u):
        after = np.roll(u, -1)
        y = np.asarray(law(u), dtype=float)
        ahead = np.roll(y, -1)
        mean = 0.5 * (y + ahead)
        rise = np.abs(ahead - y)
        jumps = rise > JUMPS * np.median(rise) + WAVE_FLAT * np.abs(y).max()
        if jumps.any():
            chord = u[jumps, None] + (after - u)[jumps, None] * (np.arange(CHORD_POINTS) + 0.5) / CHORD_POINTS
            mean[jumps] = np.asarray(law(chord.ravel()), dtype=float).reshape(chord.shape).mean(axis=1)
        return mean

    return cells


def _element_cells(block: Element):
    """Map samples of one period to means of the steady output between them."""
    primitive = block.primitive
    if isinstance(primitive, Play):
        return lambda u: _between(_played(u, primitive.gap / 2))
    if isinstance(primitive, PiecewiseAffine) and primitive.hysteretic:
        return (lambda u: _switched(u, primitive)) if len(primitive.slope) == 2 else None
    if isinstance(primitive, PiecewiseAffine):
        return _exact_means(primitive.value, _broken_line_integral(primitive))
    if isinstance(primitive, Quantizer):
        return _exact_means(primitive.value, _staircase_integral(primitive.step))
    value = getattr(primitive, "value", None)
    return None if value is None else _cell_means(value)


def _exact_means(law, integral):
    """Means of a law over the chords between samples, by its integral: smooth however the law jumps."""

    def cells(u):
        after = np.roll(u, -1)
        rise = after - u
        flat = np.abs(rise) < WAVE_FLAT * np.abs(u).max()
        with np.errstate(all="ignore"):
            mean = (integral(after) - integral(u)) / rise
        return np.where(flat, law(0.5 * (u + after)), mean)

    return cells


def _broken_line_integral(line: PiecewiseAffine):
    corners = np.array(line.corners)
    slope, intercept = np.array(line.slope), np.array(line.intercept)
    steps = np.diff(corners)
    inner = intercept[1:-1] * steps + 0.5 * slope[1:-1] * (corners[1:] ** 2 - corners[:-1] ** 2)
    upto = np.concatenate([[0.0], np.cumsum(inner)])  # integral from the first corner to each

    def integral(u):
        i = np.searchsorted(corners, u)
        base = np.clip(i - 1, 0, None)
        at = corners[base]
        return upto[base] + intercept[i] * (u - at) + 0.5 * slope[i] * (u * u - at * at)

    return integral


def _staircase_integral(step: float):
    def integral(u):
        stairs = np.floor(np.abs(u) / step + 0.5)
        return step * stairs * (np.abs(u) - 0.5 * step * stairs)

    return integral


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
