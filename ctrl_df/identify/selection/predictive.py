"""Likelihood of held-out residuals of a model whose parameters are known only so far.

A record held out may move much farther than those fitted: there what a standard error of a stiffness changes
outweighs the noise. The residual has the covariance of the noise and of what the parameters are uncertain by,
``s^2 (I + J C J')``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...thresholds import NOTHING
from ..estimation.segmented import CandidateFit
from ..estimation.thresholds import UNDETERMINED
from ..shooting.noise_model import NoiseModel


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Whitened residuals of segments held out, and what the parameters may change there.

    Attributes
    ----------
    white : list of (n,) arrays
        Residuals, by piece.
    changes : list of (n, k) arrays
        Their changes by one standard error along each principal axis of the parameters, for noise of unit
        power.
    """

    white: list[np.ndarray]
    changes: list[np.ndarray]


@dataclass(frozen=True)
class Power:
    """Squares of whitened residuals that their covariance leaves.

    Attributes
    ----------
    squares : float
        The quadratic form of the residuals with the inverse of their covariance, in that of the noise: what
        remains once parameters move as far as the residuals and the segments fitted together ask for.
    number : int
        Of residuals.
    widening : float
        Half the logarithm of the determinant of the covariance, over that of the noise [nats].
    """

    squares: float
    number: int
    widening: float = 0.0


def held_out(tried: CandidateFit, noise: NoiseModel) -> HeldOut:
    """Return the residuals of a validated model held out, and what is uncertain about them.

    Parameters of which the segments fitted tell nothing stay as they are.
    """
    assert tried.validation is not None
    white = _whitened(tried.validation.residual_pieces, noise)
    there = tried.validation_slopes
    # else records have parameters of their own
    if there is not None and len(there.slopes) == len(tried.train.slopes):
        fitted = _whitened(tried.train.response_pieces, noise)
        validation = _whitened(there.response_pieces, noise)
        if fitted and validation and all(np.all(np.isfinite(p)) for p in (*fitted, *validation)):
            root = _standard_errors(np.concatenate(fitted))
            return HeldOut(white, [h @ root for h in validation])
    return HeldOut(white, [np.zeros((len(w), 0)) for w in white])


def power_of(white, changes) -> Power:
    """Return the power of residuals (n,) with their changes (n, k) by parameters.

    References
    ----------
    Gelman et al. (2013), sec. 14.3: the predictive distribution of linear regression.
    """
    along, size, _ = np.linalg.svd(changes, full_matrices=False)
    wider = 1 + size**2
    taken = (along.T @ white) ** 2 * (1 - 1 / wider)
    return Power(float(white @ white - np.sum(taken)), len(white), 0.5 * float(np.sum(np.log(wider))))


def _standard_errors(slopes) -> np.ndarray:
    """Return a root (p, k) of the inverse of ``slopes' slopes``, within the directions that it determines."""
    size = np.sqrt(np.maximum(np.sum(slopes**2, axis=0), NOTHING))
    eigen, vectors = np.linalg.eigh((slopes / size).T @ (slopes / size))
    known = eigen >= UNDETERMINED * max(float(eigen[-1]), NOTHING)
    return vectors[:, known] / np.sqrt(eigen[known]) / size[:, None]


def _whitened(pieces, noise: NoiseModel) -> list[np.ndarray]:
    return [noise.weighed(p, i) for i, p in enumerate(pieces)]
