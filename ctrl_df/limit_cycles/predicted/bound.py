"""The rigorous error bound of Mees & Bergen for a predicted cycle, where its theorem applies."""

from __future__ import annotations

from typing import Any

import control as ct
import numpy as np

from ...blocks.primitives import PiecewiseAffine
from ...df.methods import ElementIntegrals
from ...thresholds import NOTHING, ROUNDED
from .thresholds import BESIDE_CORNER, BOUND_HARMONICS, BOUND_POINTS, WINDOWS


def mees_bergen(method, linear, crossing, others):
    """Return ((a low, a high), (omega low, omega high)) that holds a cycle, or None; and a remark.

    The remark is empty where the theorem says nothing of such a loop.

    For an odd memoryless block with slopes between alpha and beta, c = (alpha + beta)/2, r = (beta -
    alpha)/2, and rho(omega) = min |c + 1/H(jk omega)| over k = 3, 5, ..., the harmonics can move the
    crossing no farther than

        |N(a) + 1/H(j omega)| <= r^2 / (rho - r),    wherever rho > r.

    If the connected set of (a, omega) that satisfies this around the crossing is bounded, holds no other
    crossing, and the curves are not tangent, it holds a half-wave symmetric cycle. The set is found on a
    grid.

    Parameters
    ----------
    method : Method
    linear : LinearPart
    crossing : Crossing
    others : sequence of Crossing

    References
    ----------
    Mees & Bergen (1975), IEEE Trans. Automatic Control 20(4); Khalil (2002), Nonlinear Systems, sec. 7.2.
    """
    slopes = slope_bounds(method)
    if slopes is None or linear.dt or linear.measured or not _strictly_proper(linear.H):
        return None, ""
    for half in WINDOWS:
        box = _component(method, linear, crossing, slopes, half)
        if box == "open":
            continue
        if box is None or isinstance(box, str):
            break
        (a_low, a_high), (w_low, w_high) = box
        for other in others:
            if (
                other is not crossing
                and a_low <= other.amplitude <= a_high
                and w_low <= other.omega <= w_high
            ):
                return None, "no rigorous bound: the error set of Mees & Bergen holds two crossings"
        where = f"a in {a_low:.4g}..{a_high:.4g}, omega in {w_low:.4g}..{w_high:.4g}"
        return box, f"proven (Mees & Bergen): a cycle with {where}"
    return None, "no rigorous bound: the error set of Mees & Bergen is not closed here"


def slope_bounds(method) -> tuple[float, float] | None:
    """Least and greatest slope of an odd, continuous, memoryless broken line; None for anything else."""
    line = getattr(method.block, "primitive", None)
    if not isinstance(method, ElementIntegrals) or not isinstance(line, PiecewiseAffine) or line.hysteretic:
        return None
    corners = np.array(line.corners)
    left = np.array(line.intercept[:-1]) + np.array(line.slope[:-1]) * np.array(line.high[:-1])
    right = np.array(line.intercept[1:]) + np.array(line.slope[1:]) * np.array(line.low[1:])
    probe = np.concatenate([corners, corners + BESIDE_CORNER * (1 + np.abs(corners)), [0.0]])
    size = np.abs(line.value(probe)).max() + NOTHING
    continuous = np.allclose(left, right, atol=ROUNDED * size)
    odd = np.allclose(line.value(probe), -line.value(-probe), atol=ROUNDED * size)
    return (min(line.slope), max(line.slope)) if continuous and odd else None


def _component(method, linear, crossing, slopes, half):
    """Box around the error set's part at the crossing; ``open`` if it reaches the window's edge."""
    from scipy.ndimage import label

    p = np.log(crossing.amplitude) + np.linspace(-half, half, BOUND_POINTS)
    q = np.log(crossing.omega) + np.linspace(-half, half, BOUND_POINTS)
    c, r = 0.5 * (slopes[0] + slopes[1]), 0.5 * (slopes[1] - slopes[0])
    w = np.exp(q)
    with np.errstate(all="ignore"):
        rho = np.abs(c + 1 / linear(BOUND_HARMONICS[:, None] * w[None, :])).min(axis=0)
        sigma = np.where(rho > r, r**2 / (rho - r), np.inf)
        N = method.harmonics(np.exp(p), None, 1)[0][:, 0, 1]
        inside = np.abs(N[:, None] + 1 / linear(w)[None, :]) <= sigma[None, :]
    parts: Any = label(inside, structure=np.ones((3, 3)))[0]  # pyright: ignore[reportIndexIssue]
    mine = parts == parts[BOUND_POINTS // 2, BOUND_POINTS // 2]
    if not inside[BOUND_POINTS // 2, BOUND_POINTS // 2]:
        return None
    rows, columns = np.nonzero(mine.any(axis=1))[0], np.nonzero(mine.any(axis=0))[0]
    ends = rows[0], rows[-1], columns[0], columns[-1]
    if min(ends) == 0 or max(ends) == BOUND_POINTS - 1:
        return "open"
    a, w = np.exp(p), np.exp(q)  # one grid step of margin on each side
    return (float(a[rows[0] - 1]), float(a[rows[-1] + 1])), (
        float(w[columns[0] - 1]),
        float(w[columns[-1] + 1]),
    )


def _strictly_proper(H) -> bool:
    if isinstance(H, ct.StateSpace):
        return not np.any(H.D)
    return len(np.trim_zeros(H.num[0][0], "f")) < len(np.trim_zeros(H.den[0][0], "f"))
