"""Values of parameters all about an estimate, as far off as the data leave them open."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .variables import Variable


def sigma_points(
    variables: Sequence[Variable], theta, precision, curvature, variance: float
) -> list[np.ndarray]:
    """Return the points one standard deviation off an estimate, to both sides along every principal axis.

    Parameters
    ----------
    variables : sequence of Variable
        p of them.
    theta : (p,) array
        The estimate, scaled.
    precision : (p,) array
        Of what is known beforehand (see `beforehand`).
    curvature : (p, p) array
        Of half the squared error: ``J.T @ J`` of the outputs' derivatives by scaled parameters.
    variance : float
        Of the error of a sample.

    Returns
    -------
    list of (p,) array
        2 p of them, scaled, within the bounds, and no farther than a factor of e, or (of what may be zero)
        its scale.

    References
    ----------
    Julier & Uhlmann (2004), the points of the unscented transformation.
    """
    information = curvature / variance + np.diag(precision)
    eigen, axes = np.linalg.eigh(information)
    found = []
    for e, axis in zip(eigen, axes.T, strict=True):
        for sign in (-1, 1):
            step = sign * axis / np.sqrt(max(float(e), 1.0))
            found.append(np.array([v.clip(q + d) for v, q, d in zip(variables, theta, step, strict=True)]))
    return found
