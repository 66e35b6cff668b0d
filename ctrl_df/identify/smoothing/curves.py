"""A force as a curve over one quantity, beside what known regressors could do: a partial residual.

Source of partial residuals: Larsen & McCleary, Technometrics 14 (1972) 781.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...thresholds import NOTHING
from ..residuals.residual_tests import autocorrelation
from ..thresholds import DEPENDENT
from .thresholds import CURVE_ALONE, CURVE_BINS, CURVE_LEAST, UNLIKE


@dataclass(frozen=True)
class Curve:
    """A force over a quantity.

    Attributes
    ----------
    at, force, std : (m,) arrays
        The curve: places, mean force and its standard error.
    points : (2, n) array
        Quantity and force of every instant.
    share : float
        Of the variance that the regressors leave, how much the curve explains, 0 to 1.
    p_value : float
        Probability of a share as large by chance.
    evidence : float
        Log likelihood ratio [nats] less Schwarz's penalty for the steps, of the instants that know of
        different forces.
    """

    at: np.ndarray
    force: np.ndarray
    std: np.ndarray
    points: np.ndarray
    share: float
    p_value: float = 1.0
    evidence: float = 0.0


def explained_shares(force, std, own, known) -> tuple[float, float]:
    """Return the share of a force's square that own regressors make, and that which a constant adds."""
    root, use = 1.0 / std[known], known
    y, columns = force[use] * root, _weighed(own[use], root)
    whole = max(float(y @ y), NOTHING)
    left = []
    for regressors in (columns, np.column_stack([columns, root])):
        rest = y - regressors @ np.linalg.lstsq(regressors, y, rcond=DEPENDENT)[0]
        left.append(float(rest @ rest) / whole)
    return 1.0 - left[0], left[0] - left[1]


def curve_over(values, force, std, own, beside, known) -> Curve:
    """Fit a force by a step curve over a quantity and by the model's own parameters together.

    Parameters
    ----------
    values, force, std : (n,) arrays
        Quantity, force and its standard deviation.
    own : (n, p) array
        Regressors of the model's own parameters: what they do alone is no share of a curve.
    beside : (n, q) array
        Those of them that can be distinguished from a curve over this quantity.
    known : (n,) bool array
        Which instants count.
    """
    from scipy.stats import f as f_distribution

    use = np.flatnonzero(known & np.isfinite(values))
    none = np.zeros(0)
    if len(use) < 2 * CURVE_LEAST:
        return Curve(none, none, none, np.zeros((2, 0)), 0.0)
    order = np.argsort(values[use], kind="stable")
    root = 1.0 / std[use]
    rest = _weighed(beside[use], root)
    y, count, correlation_length = force[use] * root, CURVE_BINS, 1.0
    bins, both, fit, left = np.zeros(len(use), int), rest, np.zeros(0), y
    # the autocorrelation of what neither explains gives the independent instants, and so the bins
    for _ in range(2):
        bins = np.empty(len(use), int)
        bins[order] = np.arange(len(use)) * count // len(use)
        both = np.column_stack([rest, (bins[:, None] == np.arange(count)) * root[:, None]])
        fit = np.linalg.lstsq(both, y, rcond=DEPENDENT)[0]
        left = y - both @ fit
        correlation_length = _correlation_length(left)
        count = int(np.clip(len(use) / correlation_length / CURVE_ALONE, CURVE_LEAST, count))
    count = int(bins.max()) + 1
    alone = np.column_stack([_weighed(own[use], root), root])
    before = y - alone @ np.linalg.lstsq(alone, y, rcond=DEPENDENT)[0]
    free = max(len(use) / correlation_length, both.shape[1] + 2.0) - np.array([alone.shape[1], both.shape[1]])
    power = np.array([before @ before, left @ left])
    share = 1.0 - power[1] / free[1] / max(power[0] / free[0], NOTHING)
    more = max(both.shape[1] - alone.shape[1], 1)
    ratio = (power[0] - power[1]) / more / max(power[1] / free[1], NOTHING)
    independent = len(use) / correlation_length
    gain = math.log(max(power[0], NOTHING) / max(power[1], NOTHING))
    evidence = 0.5 * (independent * gain - more * math.log(independent))
    partial = (y - rest @ fit[: rest.shape[1]]) / root
    weight = root**2
    total = np.bincount(bins, weight, count)
    at = np.bincount(bins, weight * values[use], count) / total
    mean = np.bincount(bins, weight * partial, count) / total
    error = np.sqrt(correlation_length / total)
    share, p_value = float(np.clip(share, 0.0, 1.0)), float(f_distribution.sf(ratio, more, free[1]))
    return Curve(at, mean, error, np.array([values[use], partial]), share, p_value, evidence)


def _weighed(columns, root) -> np.ndarray:
    scale = np.linalg.norm(columns, axis=0)
    return columns[:, scale > 0] / scale[scale > 0] * root[:, None]


def _correlation_length(d) -> float:
    """Return over how many samples a force is much the same: they count as one."""
    rho = autocorrelation(d, max(len(d) // 4 - 1, 0))
    first = np.argmax(rho < UNLIKE) if np.any(rho < UNLIKE) else len(rho)
    return 1.0 + 2.0 * float(np.sum(rho[1:first]))
