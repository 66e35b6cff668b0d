"""Spectrum of the noise where parameters act, from residuals of which a fit has taken away a part.

Slow noise is the trouble: an autoregressive model, its order chosen over the whole band, is level below the
few frequencies at which a machine moves, and there fitted parameters and initial states have taken most of
the noise away. So the density is a sum of first-order noises, a corner in every octave, and what each would
leave of itself once the fit has had its part is known: that is what the periodogram is explained by.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...thresholds import NOTHING
from ..shooting.noise_model import noise_model
from .thresholds import NOISE_BAND, NOISE_KNOWN, NOISE_LEFT, NOISE_PASSES, NOISE_SHARE


@dataclass(frozen=True)
class NoiseSpectrum:
    """Density of the noise at evenly spaced frequencies from 0 to pi a sample.

    Attributes
    ----------
    parts : (m, nf) array
        Densities of the noises it is the sum of; white noise of rms sigma has sigma^2.
    errors : (m, m) array
        Covariance of their sizes, each relative to its own.
    """

    parts: np.ndarray
    errors: np.ndarray

    @property
    def density(self) -> np.ndarray:
        """Density of all parts together, (nf,)."""
        return np.sum(self.parts, axis=0)

    def product(self, columns) -> np.ndarray:
        """Return the covariance (p, p) of ``columns.T @ noise``."""
        transform = _transform(columns, self.parts.shape[1])
        return np.real((transform.conj() * _integral(self.density)[:, None]).T @ transform)

    def variances(self, columns) -> tuple[np.ndarray, np.ndarray]:
        """Return the variances of ``columns.T @ noise``, and those of what they are estimated to be, (p,)."""
        power = np.abs(_transform(columns, self.parts.shape[1])) ** 2
        each = _integral(self.parts) @ power
        return np.sum(each, axis=0), np.einsum("kp,kl,lp->p", each, self.errors, each)


def noise_spectrum(residual, absorbed, floor: float = 0.0) -> NoiseSpectrum:
    """Return the spectrum of stationary noise.

    Parameters
    ----------
    residual : (n,) array
        What a fit has left of it.
    absorbed : (n, m) array
        Columns whose ``absorbed @ absorbed.T`` is the projection that the fit has taken away.
    floor : float
        Density that there is at least, of rounding.

    References
    ----------
    Patterson & Thompson (1971), restricted maximum likelihood; Whittle (1953).
    """
    n = len(residual)
    count = (1 << (n - 1).bit_length()) // 2 + 1
    bins = _length(count) / n
    omega = np.linspace(0.0, math.pi, count)
    periodogram = np.abs(_transform(residual[:, None], count)[:, 0]) ** 2 / n
    corners = math.pi * 0.5 ** np.arange(1, math.log2(n) + 1)
    parts = [np.ones(count), *(c**2 / (c**2 + omega**2) for c in corners)]
    # lines and bands that no sum of these makes
    autoregressive = noise_model(residual)
    if autoregressive.sigma > 0:
        parts.append(autoregressive.spectrum(omega) / autoregressive.sigma**2)
    densities = np.array(parts)
    transform = _transform(absorbed, count)
    taken = np.sum(np.abs(transform) ** 2, axis=1) / n
    edges = _bands(count, bins)
    width = np.diff(edges)

    def mean(x):
        return np.add.reduceat(x, edges[:-1], axis=-1) / width

    seen, expected = mean(periodogram), mean(_expected(densities, transform, taken, n))
    weights = width / bins
    sizes = _sizes(seen, expected, weights)
    left = sizes[:, None] * expected / np.maximum(sizes @ expected, NOTHING)
    # Fisher's information of the logarithms of the sizes; each is known within a factor beforehand
    errors = np.linalg.inv((left * weights) @ left.T + np.eye(len(left)) / NOISE_KNOWN**2)
    return NoiseSpectrum(sizes[:, None] * densities + floor / len(densities), errors)


def _expected(densities, transform, taken, n) -> np.ndarray:
    """Return the periodograms that noises of these densities are expected to leave, (parts, nf).

    Of ``(1 - Q Q') Omega (1 - Q Q')``: what other frequencies hand over is counted where much is taken.
    """
    left = densities * np.maximum(1 - taken, NOISE_LEFT)
    much = np.flatnonzero(taken > NOISE_SHARE)
    there, weights = transform[much], _integral(np.ones(len(taken)))[much]
    for row, density in zip(left, densities[:, much], strict=True):
        inner = np.real((there.conj() * (density * weights)[:, None]).T @ there)
        handed = np.real(np.sum((there.conj() @ inner) * there, axis=1)) / n
        row[much] = np.maximum(density * (1 - 2 * taken[much]) + handed, NOISE_LEFT * density)
    return left


def _sizes(seen, expected, weights) -> np.ndarray:
    """Return the sizes (>= 0) of the parts under which what is seen is likeliest (each value exponential)."""
    sizes = np.mean(seen) / np.mean(expected, axis=1) / len(expected)
    if not np.any(sizes):
        return sizes
    for _ in range(NOISE_PASSES):
        density = sizes @ expected
        sizes = sizes * (expected @ (weights * seen / density**2)) / (expected @ (weights / density))
    return sizes


def _bands(count: int, bins: float) -> np.ndarray:
    """Return the edges of bands of frequencies: one independent value each, or an eighth of an octave."""
    edges = [0.0, 0.5 * bins]
    while edges[-1] < count:
        edges.append(max(edges[-1] + bins, edges[-1] * NOISE_BAND))
    return np.unique(np.minimum(np.ceil(edges).astype(int), count))


def _length(count: int) -> int:
    return 2 * (count - 1)


def _transform(columns, count: int) -> np.ndarray:
    return np.fft.rfft(columns, _length(count), axis=0)


def _integral(density) -> np.ndarray:
    """Return densities (..., nf) times how much their frequencies count: all but the ends stand for two."""
    count = density.shape[-1]
    twice = np.full(count, 2.0)
    twice[0] = twice[-1] = 1.0
    return density * twice / _length(count)
