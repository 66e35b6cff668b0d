"""Arclength continuation: the tangent of a curve, and the correction onto it.

Two least-squares solutions of bordered linear equations, and nothing of what the equations say: prediction
and exact orbit may both have them, as they have NumPy.
"""

from __future__ import annotations

import numpy as np

from .thresholds import CURVE_RANK


def tangent(J, along):
    """Direction in which the equations with Jacobian J (n, n + 1) stay fulfilled, the side of `along`."""
    right = np.zeros(J.shape[0] + 1)
    right[-1] = 1.0
    t = np.linalg.lstsq(np.vstack([J, along]), right, rcond=CURVE_RANK)[0]
    return t / np.linalg.norm(t)


def correction(J, border, defect, beyond):
    """Newton step onto the curve within the plane across `border`, `beyond` which the point lies."""
    return np.linalg.lstsq(np.vstack([J, border]), -np.append(defect, beyond), rcond=CURVE_RANK)[0]
