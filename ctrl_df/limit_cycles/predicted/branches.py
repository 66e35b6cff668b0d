"""Solutions of 1 + N H = 0 on further branches of N: motions of the block that its N does not name.

`ctrl_df.df.branch` says what a branch is. It is searched over its own parameter s and ln omega, where it is
smooth also at folds; what is found is carried back to (ln a, ln omega).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...df.branch import Branch
from ...df.points import points
from ..thresholds import LOG_NUDGE
from .crossings import Crossing, find_crossings
from .scan_grid import refined_omega
from .thresholds import (
    BRANCH_AGREES,
    BRANCH_FAR,
    BRANCH_FOLD,
    BRANCH_NEAR,
    BRANCH_POINTS,
    BRANCH_SAME,
    ON_EDGE,
)


@dataclass(frozen=True)
class BranchCrossing:
    """A solution on a branch.

    Attributes
    ----------
    crossing : Crossing
        With derivatives along the branch.
    branch : Branch
    s : float
        Its parameter there.
    multiplier : float
        Of the motion under the force alone, over one period.
    named : bool
        Whether the describing function names this motion there.
    defect : float
        |1 + N H| for the N of the motion that the describing function names there; NaN without one.
    rivals : tuple of str
        Other branches that attract under the same force.
    """

    crossing: Crossing
    branch: Branch
    s: float
    multiplier: float
    named: bool
    defect: float
    rivals: tuple[str, ...] = ()

    @property
    def attracts(self) -> bool:
        """Whether the block settles on this motion from near it."""
        return self.multiplier < 1.0


def branch_crossings(method, linear, family, grid, values, known, refine=True) -> list[BranchCrossing]:
    """Find the solutions on all branches of a method that are not among those known.

    Parameters
    ----------
    method : Method
    linear : LinearPart
    family : Family
        Of the box.
    grid : (log_a, log_w)
        That was scanned.
    values : ndarray
        1 + N H there.
    known : list of Crossing
        What the scan found.
    refine : bool
        Whether those are converged; on branches solutions always are.
    """
    if not method.needs_omega or min(values.shape) < 2:
        return []
    step = min(max(np.diff(grid[0])) + 2 * max(np.diff(np.log(family.omega))), BRANCH_FAR)
    with np.errstate(invalid="ignore"):
        i, k = np.nonzero(np.abs(values) < BRANCH_NEAR + step)
    branches = method.branches(family.amplitudes, family.omega, np.exp(grid[0][i]), np.exp(grid[1][k]))
    if not branches:
        return []
    omega = refined_omega(linear, _filled(family.omega))
    rough = BRANCH_SAME if refine else step
    box = (family.amplitudes.min(), family.amplitudes.max())
    found: list[BranchCrossing] = []
    for branch in branches:
        for one in _on_branch(branch, method, linear, omega, box):
            listed = one.named and any(_at_one_place(one.crossing, k, rough) for k in known)
            if not listed and not any(_at_one_place(one.crossing, f.crossing) for f in found):
                found.append(replace(one, rivals=_rivals(one, branches)))
    return found


def _rivals(one, branches):
    """Names of the other branches that attract at a solution."""
    names = []
    for branch in branches:
        if branch is one.branch:
            continue
        at = branch.motions(branch.grid, np.full(branch.grid.size, one.crossing.omega), 1)
        above = at.amplitude > one.crossing.amplitude
        passed = np.nonzero(above[1:] != above[:-1])[0]
        if (at.exists & (at.multiplier < 1))[passed].any():
            names.append(branch.name)
    return tuple(names)


def _filled(omega):
    """Give the range of a coarse grid more points: a closed form costs little."""
    if omega.size >= BRANCH_POINTS:
        return omega
    return np.unique(np.concatenate([omega, np.geomspace(omega[0], omega[-1], BRANCH_POINTS)]))


def _on_branch(branch, method, linear, omega, box):
    log_w = np.log(omega)

    def D(s, q):
        w = np.exp(q)
        with np.errstate(all="ignore"):
            return 1 + branch.motions(s, w, 1).harmonics[:, 1] * linear.clamped(w)[0]

    s, q = (g.ravel() for g in np.meshgrid(branch.grid, log_w, indexing="ij"))
    scan = find_crossings(D, branch.grid, log_w, D(s, q).reshape(branch.grid.size, log_w.size))
    for crossing in scan.crossings:
        one = _solution(branch, method, linear, crossing, box)
        if one is not None:
            yield one


def _solution(branch, method, linear, crossing, box):
    """Carry a zero over (s, ln omega) back to (ln a, ln omega); None where the motion is not possible."""
    s, w = np.log([crossing.amplitude]), np.array([crossing.omega])  # it took s for a logarithm
    at = branch.motions(s, w, 1)
    a = at.amplitude
    if not at.exists[0] or not box[0] * (1 - ON_EDGE) <= a[0] <= box[1] * (1 + ON_EDGE):
        return None
    slope = [
        float(np.log(branch.motions(s + d, w * np.exp(e), 1).amplitude[0] / a[0])) / LOG_NUDGE
        for d, e in ((LOG_NUDGE, 0.0), (0.0, LOG_NUDGE))
    ]
    by_s, by_w = crossing.jacobian[:, 0], crossing.jacobian[:, 1]
    by_a = by_s / (slope[0] if abs(slope[0]) > BRANCH_FOLD else BRANCH_FOLD)  # at a fold s moves a no more
    J = np.stack([by_a, by_w - slope[1] * by_a], axis=1)
    N = points(method, a, w)[0][0]
    mine = at.harmonics[0, 1]
    return BranchCrossing(
        Crossing(float(a[0]), crossing.omega, crossing.residual, J),
        branch,
        float(s[0]),
        float(at.multiplier[0]),
        bool(abs(N - mine) <= BRANCH_AGREES * abs(mine)),
        float(abs(1 + N * linear.clamped(w)[0][0])),
    )


def _at_one_place(one, other, near=BRANCH_SAME):
    return abs(np.log(one.amplitude / other.amplitude)) < near and abs(np.log(one.omega / other.omega)) < near
