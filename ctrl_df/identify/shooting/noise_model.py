"""Noise of any spectrum: an autoregressive model of residuals, and what is left of them once it is taken out.

Residuals come in pieces, one a segment: each begins from an initial state of its own, so nothing ties the
last sample of one to the first of the next.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import sparse

from ...thresholds import NOTHING
from .thresholds import (
    IMPULSE_END,
    IMPULSE_FIRST,
    IMPULSE_GONE,
    IMPULSE_LONGER,
    IMPULSE_LONGEST,
    NOISE_ORDER,
    NOISE_ORDER_LEFT,
    NOISE_ORDER_MOST,
)

Pieces = Sequence[np.ndarray]


@dataclass(frozen=True)
class NoiseModel:
    """Autoregressive noise ``e[t] = sum a_i e[t-i] + w[t]`` with white w of rms `sigma`.

    Of the means of every `step` samples where that is more than one.
    """

    a: np.ndarray
    sigma: float
    step: int = 1

    @property
    def order(self) -> int:
        """Number of coefficients."""
        return len(self.a)

    def whiten(self, x) -> np.ndarray:
        """Filter signals (n,) or (n, m) by ``1 - sum a_i z^-i``; the residual itself becomes white."""
        from scipy.signal import lfilter

        x = np.asarray(x, dtype=float)
        if not self.order or not x.size:
            return x
        return np.asarray(lfilter(np.concatenate(([1.0], -self.a)), [1.0], x, axis=0))

    def filtered(self, x, segments) -> np.ndarray:
        """Return what counts of signals (n,) or (n, m) that restart in each of `segments` (slices).

        The mean of every `step` samples, whitened; values that would mix two segments are left out.
        """
        blocks, firsts = averaged(x, segments, self.step)
        age = np.arange(len(blocks)) - np.repeat(firsts, np.diff([*firsts, len(blocks)]))
        return self.whiten(blocks)[age >= self.order]

    def weighed(self, x, piece: int) -> np.ndarray:
        """Return what counts of one piece of several."""
        return self.filtered(x, [slice(0, len(x))])

    def matrix(self, segments) -> sparse.csr_array:
        """Return `filtered` as a matrix, of signals of which every sample counts by itself (`step` 1)."""
        parts = []
        for i, w in enumerate(segments):
            n, model = w.stop - w.start, self.of(i)
            scale = self.sigma / max(model.sigma, NOTHING) if model is not self else 1.0
            weights = scale * np.concatenate(([1.0], -model.a))
            # what a unit impulse becomes stands below the diagonal
            offsets: Any = -np.arange(len(weights))
            diagonals: Any = sparse.diags(list(weights), offsets, shape=(n, n), format="csr")
            parts.append(diagonals[model.order :])
        return sparse.csr_array(sparse.block_diag(parts, format="csr"))

    def of(self, piece: int) -> NoiseModel:
        """Return the model of one piece of several."""
        return self

    def cost(self, count: int, parameters: int = 0) -> float:
        """Return Schwarz's criterion of this noise of `count` samples beside so many parameters."""
        return 2 * count * math.log(max(self.sigma, NOTHING)) + (self.order + parameters) * math.log(count)

    def rows(self, segments) -> np.ndarray:
        """Return the sample in the middle of each value that `filtered` returns of signals in `segments`."""
        found = []
        for w in segments:
            values = np.arange(self.order, (w.stop - w.start) // self.step)
            # a filter of k values is about the middle one
            found.append(w.start + ((values - 0.5 * self.order + 0.5) * self.step).astype(int))
        return np.concatenate(found)

    def spectrum(self, omega_dt) -> np.ndarray:
        """Return the density at ``omega dt`` [rad a sample]; constant sigma^2 for white noise."""
        k = np.arange(1, self.order + 1)
        z = np.exp(-1j * np.multiply.outer(np.asarray(omega_dt, float), k))
        return self.sigma**2 / np.abs(1 - z @ self.a) ** 2

    def correlation(self, count: int) -> np.ndarray:
        """Return the correlation of values 0 to ``count - 1`` samples apart."""
        impulse = self._impulse()
        power = np.abs(np.fft.rfft(impulse, 2 * max(len(impulse), count))) ** 2
        found = np.fft.irfft(power)[:count]
        return found / found[0]

    @property
    def memory(self) -> float:
        """Variance of the mean square over that of white noise: samples per sample that tells it.

        References
        ----------
        Bartlett (1946).
        """
        rho = self.correlation(len(self._impulse()))
        return float(2 * rho @ rho - 1)

    def _impulse(self):
        from scipy.signal import lfilter

        n, b = IMPULSE_FIRST, [1.0]
        while True:
            h = np.asarray(lfilter(b, np.concatenate(([1.0], -self.a)), np.r_[1.0, np.zeros(n - 1)]))
            if n >= IMPULSE_LONGEST or np.max(np.abs(h[-n // IMPULSE_END :])) < IMPULSE_GONE * np.max(
                np.abs(h)
            ):
                return h
            n *= IMPULSE_LONGER


@dataclass(frozen=True)
class OutputNoise(NoiseModel):
    """Noise of records of several outputs, whose pieces follow in turn: a model of each, beside the first.

    What it filters is over the noise of its own output, times that of the first: one sum of squares serves.
    """

    others: tuple[NoiseModel, ...] = ()

    def of(self, piece: int) -> NoiseModel:
        """Return the model of one piece of several."""
        at = piece % (1 + len(self.others))
        return NoiseModel(self.a, self.sigma, self.step) if at == 0 else self.others[at - 1]

    def cost(self, count: int, parameters: int = 0) -> float:
        """Return that of all outputs together, of `count` samples in all."""
        each = [self.of(i) for i in range(1 + len(self.others))]
        return sum(n.cost(count // len(each)) for n in each) + parameters * math.log(count)

    def filtered(self, x, segments) -> np.ndarray:
        """Return what counts of signals, as for one output; `segments` are those of each output in turn."""
        x = np.asarray(x, dtype=float)
        return np.concatenate([self.weighed(x[w], i) for i, w in enumerate(segments)])

    def weighed(self, x, piece: int) -> np.ndarray:
        """Return what counts of one piece of several."""
        model = self.of(piece)
        return model.filtered(x, [slice(0, len(x))]) * (self.sigma / max(model.sigma, NOTHING))


def noise_of_outputs(pieces: Pieces, outputs: int, max_order: int = NOISE_ORDER_MOST) -> NoiseModel:
    """Fit a noise model to pieces of records of one output, or of several in turn."""
    first, *others = [noise_model(pieces[i::outputs], max_order) for i in range(outputs)]
    return OutputNoise(first.a, first.sigma, first.step, tuple(others)) if others else first


def noise_model(residual: np.ndarray | Pieces, max_order: int = NOISE_ORDER_MOST) -> NoiseModel:
    """Fit an autoregressive model by Burg's method, its order chosen by Schwarz's criterion.

    Parameters
    ----------
    residual : (n,) array or sequence of such
        Evenly sampled; in pieces that do not follow each other.
    max_order : int
        Highest order tried.

    References
    ----------
    Burg (1975); Schwarz (1978).
    """
    pieces = [residual] if isinstance(residual, np.ndarray) else residual
    n, best = sum(map(len, pieces)), (math.inf, NoiseModel(np.zeros(0), 0.0))
    for a, left in _burg(pieces, max_order):
        if left > 0:
            tried = NoiseModel(a, math.sqrt(left))
            best = min(best, (tried.cost(n), tried), key=lambda x: x[0])
    return best[1]


def prediction_errors(pieces: Pieces, max_order: int) -> np.ndarray:
    """Return the rms errors with which the last 0, 1, ... `max_order` values predict the next one.

    Fewer where pieces are short, or nothing is left.
    """
    return np.sqrt([max(left, 0.0) for _, left in _burg(pieces, max_order)])


def _burg(pieces: Pieces, max_order: int) -> Iterator[tuple[np.ndarray, float]]:
    """Yield coefficients and mean squared prediction error of order 0, 1, ..., by Burg's method."""
    pieces = [np.asarray(r, dtype=float) for r in pieces]
    n = sum(map(len, pieces))
    mean = sum(float(r.sum()) for r in pieces) / n
    forward = backward = [r - mean for r in pieces]
    left, a = power(forward) / n, np.zeros(0)
    yield a, left
    for _ in range(min(max_order, min(map(len, pieces)) // 4)):
        forward, backward = [f[1:] for f in forward], [b[:-1] for b in backward]
        norm = power(forward) + power(backward)
        if norm <= 0:
            return
        k = 2 * sum(float(f @ b) for f, b in zip(forward, backward, strict=True)) / norm
        forward, backward = (
            [f - k * b for f, b in zip(forward, backward, strict=True)],
            [b - k * f for f, b in zip(forward, backward, strict=True)],
        )
        a = np.append(a - k * a[::-1], k)
        left *= 1 - k * k
        if left <= 0:
            return
        yield a, left


def averaged(x, segments, step: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the means of every `step` samples within each of `segments` (slices), and where each begins."""
    x = np.asarray(x, dtype=float)
    counts = [(w.stop - w.start) // step for w in segments]
    firsts = np.cumsum([0, *counts[:-1]])
    if step == 1:
        return x, firsts
    parts = [x[w.start : w.start + n * step] for w, n in zip(segments, counts, strict=True)]
    means = [p.reshape(n, step, *x.shape[1:]).mean(axis=1) for p, n in zip(parts, counts, strict=True)]
    return np.concatenate(means), firsts


def acceleration_filter(step: int, column: int = 0) -> NoiseModel:
    """Return the filter that makes accelerations of residuals: second differences of those in position.

    Where disturbance forces, integrated twice, make the residuals, their slow parts are the largest and tell
    the least; the forces themselves are level over the frequencies at which machines move. `step`: samples a
    value; what is faster than twice that does not count. `column`: 1 for residuals in velocity, of which
    first differences do.
    """
    return NoiseModel(np.array([2.0, -1.0] if column == 0 else [1.0]), 1.0, step)


def prediction_error_filter(pieces: Pieces, plain: NoiseModel | None = None, outputs: int = 1) -> NoiseModel:
    """Return the noise model that residuals are whitened by for evidence.

    Of the longest record; `plain`: the `acceleration_filter` of fits, then of these in all segments.
    """
    if plain is None:
        longest = int(np.argmax([len(r) for r in pieces])) // outputs * outputs
        return noise_of_outputs(pieces[longest : longest + outputs], outputs, max_order=NOISE_ORDER)
    left = noise_model([plain.filtered(r, [slice(0, len(r))]) for r in pieces], max_order=NOISE_ORDER_LEFT)
    both = np.convolve(np.append(1.0, -plain.a), np.append(1.0, -left.a))
    return NoiseModel(-both[1:], left.sigma, plain.step)


def whitened_power(pieces: Pieces, noise: NoiseModel) -> tuple[float, int]:
    """Return the sum of squares of the whitened residuals, and their number."""
    white = [noise.weighed(r, i) for i, r in enumerate(pieces)]
    return power(white), sum(map(len, white))


def power(pieces: Pieces) -> float:
    """Return the sum of squares."""
    return sum(float(r @ r) for r in pieces)
