"""How large a residual is, and whether anything of the model is left in it.

Residual means measured minus simulated. Every test here allows for what records really are: long, finely
sampled, driven by smooth inputs, with coloured noise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...thresholds import NOTHING
from ..shooting.noise_model import noise_model
from ..thresholds import LEVEL
from .thresholds import (
    DECORRELATED,
    INPUT_LAGS,
    LAGS_APART,
    LAGS_FORGOTTEN,
    LAGS_SHARE,
    LAGS_TESTED,
    TWO_SIDED,
    WHITENESS_LAGS,
)


def rmse(residual) -> float:
    """Return the rms of the residual, in its unit."""
    r = _series(residual)
    return float(np.sqrt(np.mean(r * r)))


def nrmse(measured, simulated) -> float:
    """Return the rms of the residual over that of the centred measured output; 0 is perfect, 1 a constant."""
    y = _series(measured)
    spread = float(np.std(y))
    return rmse(y - _series(simulated)) / spread if spread > 0 else math.inf


def fit_percent(measured, simulated) -> float:
    """Return MATLAB's fit: 100 % (1 - nrmse); it may be negative."""
    return 100.0 * (1.0 - nrmse(measured, simulated))


def autocorrelation(residual, lags: int) -> np.ndarray:
    """Return the autocorrelation at lags 0 ... `lags` (biased estimate, mean removed)."""
    r = _series(residual)
    r = r - r.mean()
    return _crosscovariance(r, r, lags)[lags:] / max(float(np.mean(r * r)), NOTHING)


def _crosscovariance(a, b, lags):
    """Return mean(a[t] b[t+k]) for k = -lags ... lags."""
    n = len(a)
    size = 1 << (2 * n - 1).bit_length()
    product = np.fft.irfft(np.conj(np.fft.rfft(a, size)) * np.fft.rfft(b, size), size)
    return np.concatenate((product[-lags:], product[: lags + 1])) / n if lags else product[:1] / n


# --- whiteness ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Whiteness:
    """Result of the Ljung-Box test.

    `statistic` ~ chi-squared with `dof` degrees of freedom if the residual is white; `p_value`; `white` at
    the level asked; `lags`, `autocorrelation` (lags 1 ...) and its 95 % `band` for the picture.
    """

    statistic: float
    dof: int
    p_value: float
    white: bool
    lags: np.ndarray
    autocorrelation: np.ndarray
    band: float

    def __bool__(self) -> bool:
        return self.white


def whiteness(
    residual, lags: int | None = None, *, fitted: int = 0, alpha: float = LEVEL, band: float = 1.0
) -> Whiteness:
    """Test whether a residual is white noise.

    Parameters
    ----------
    residual : array_like, shape (n,)
        Evenly sampled.
    lags : int or None
        Number of lags; None: min(25, n/5).
    fitted : int
        Number of noise-model parameters fitted to this residual (lost degrees of freedom); 0 for parameters
        of an output-error model, which take next to none.
    alpha : float
        Level of the test.
    band : float
        Share of the Nyquist frequency that the signal fills: below it, noise may be white or not. The test is
        of as many samples as that takes.

    References
    ----------
    Ljung & Box (1978), eq. (1.3).
    """
    from scipy.signal import resample
    from scipy.stats import chi2

    r = _series(residual)
    if band < 1.0:
        r = np.asarray(resample(r, int(band * len(r))))
    n = len(r)
    lags = min(WHITENESS_LAGS, max(n // LAGS_SHARE[0], 1)) if lags is None else int(lags)
    if not 0 < lags < n or fitted >= lags:
        raise ValueError(
            f"whiteness needs 0 <= fitted < lags < {n} (the samples); got lags={lags}, fitted={fitted}."
        )
    rho = autocorrelation(r, lags)[1:]
    k = np.arange(1, lags + 1)
    statistic = float(n * (n + 2) * np.sum(rho**2 / (n - k)))
    dof = lags - fitted
    p = float(chi2.sf(statistic, dof))
    return Whiteness(statistic, dof, p, p >= alpha, k, rho, TWO_SIDED / math.sqrt(n))


# --- coloured noise ---------------------------------------------------------------------------------------


# --- is the input still in it? --------------------------------------------------------------------


@dataclass(frozen=True)
class InputTest:
    """Whether the residual still depends on the input.

    `statistic` is F(`rank`, `dof`) of the regression of the whitened residual on lagged inputs; `p_value`;
    `independent` at the level asked. `lags` [samples], `correlation` (residual after input; both prewhitened
    by the residual's noise model) and its 95 % `band`.
    """

    statistic: float
    rank: int
    dof: int
    p_value: float
    independent: bool
    lags: np.ndarray
    correlation: np.ndarray
    band: float

    def __bool__(self) -> bool:
        return self.independent


def input_residual_test(u, residual, lags=None, *, alpha: float = LEVEL, fitted: int = 0) -> InputTest:
    """Test whether the residual is uncorrelated with past inputs.

    The spectrum of the residual is taken out of both signals first, and the test is an exact F test given the
    input, so that neither coloured noise nor a smooth input (whose neighbouring lags say the same) gives
    false alarms.

    Parameters
    ----------
    u, residual : array_like, shape (n,)
        Evenly sampled.
    lags : sequence of int or None
        Lags [samples], not negative; None: 20 from one sample on, spread over five correlation times of the
        input. A sampled controller answers the noise of a sample within that sample; an input acts after its.
    alpha : float
        Level of the test.
    fitted : int
        Parameters fitted to these data, taken off the degrees of freedom of the input's directions: a refit
        has already made that many of them orthogonal to the residual.

    References
    ----------
    Ljung (1999), sec. 16.6; Box & Jenkins (1976), sec. 11.3 (prewhitening).
    """
    from scipy.stats import f as f_distribution

    u, r = _series(u), _series(residual)
    if len(u) != len(r):
        raise ValueError(
            f"input_residual_test needs equal lengths; u has {len(u)} and the residual {len(r)} samples."
        )
    model = noise_model(r)
    e, x = model.whiten(r)[model.order :], model.whiten(u)[model.order :]
    lags = _spread_lags(u) if lags is None else np.unique(np.asarray(lags, dtype=int))
    top, n = int(lags[-1]), len(e)
    if lags[0] < 0 or top > n // 2:
        raise ValueError(f"input_residual_test needs lags between 0 and {n // 2}; got {lags[0]} to {top}.")
    columns = np.column_stack([x[top - k : n - k] for k in lags])
    target = e[top:] - e[top:].mean()
    columns = columns - columns.mean(axis=0)
    spread = np.sqrt(np.mean(columns**2, axis=0)) * max(float(np.sqrt(np.mean(target**2))), NOTHING)
    correlation = columns.T @ target / len(target) / np.maximum(spread, NOTHING)
    basis, s, _ = np.linalg.svd(columns, full_matrices=False)
    basis = basis[:, s > LAGS_APART * s[0]] if s[0] > 0 else basis[:, :0]
    rank = max(basis.shape[1] - fitted, 1)
    explained = float(np.sum((basis.T @ target) ** 2))
    left, dof = float(target @ target) - explained, len(target) - basis.shape[1] - 1
    statistic = explained / rank / max(left / dof, NOTHING)
    p = float(f_distribution.sf(statistic, rank, dof)) if basis.shape[1] else 1.0
    band = TWO_SIDED / math.sqrt(len(target))
    return InputTest(statistic, rank, dof, p, p >= alpha, lags, correlation, band)


def _spread_lags(u, count=LAGS_TESTED):
    top = max(min(len(u) // LAGS_SHARE[1], INPUT_LAGS), 1)
    rho = autocorrelation(u, top)
    below = np.flatnonzero(rho < DECORRELATED)
    reach = min(max(LAGS_FORGOTTEN * int(below[0]) if len(below) else top, count), len(u) // LAGS_SHARE[2])
    return np.unique(np.linspace(1, max(reach, 1), count).round().astype(int))


def _series(values) -> np.ndarray:
    array = np.asarray(values, dtype=float)
    if array.ndim != 1 or len(array) < 2:
        raise ValueError(f"residual tests need a 1-D array of 2 samples or more; got shape {array.shape}.")
    if not np.all(np.isfinite(array)):
        raise ValueError(
            "residual tests need finite numbers; got NaN or infinity: has the simulation diverged?"
        )
    return array
