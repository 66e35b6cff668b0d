"""Where a yes turns into a no over a plane, from few answers: triangles between them, cut on the border."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.ndimage import distance_transform_edt, label
from scipy.spatial import Delaunay, KDTree
from scipy.stats import qmc

from ..limit_cycles.predicted.thresholds import ON_EDGE
from .thresholds import CORNER_SHARE, CUTS_APART, EDGE_COARSE, POINTS_APART, ROUND, WITHIN_RIM, WORTH


def spread_points(count: int, seed: int) -> np.ndarray:
    """Points that fill the unit square evenly, (count, 2); the corners are the first four."""
    corners = np.array([[0.0, 0.0], [1.0, 1.0], [0.0, 1.0], [1.0, 0.0]])
    generator: Any = qmc.Halton  # seed is called rng from SciPy 1.15 on
    inner = generator(2, seed=seed).random(max(count - 4, 0))
    return np.concatenate([corners, inner])[:count]


def deep_points(predicted) -> np.ndarray:
    """Return the innermost point of every connected region of a map of predictions, in the unit square."""
    predicted = np.asarray(predicted)
    found = []
    for value in np.unique(predicted):
        regions, count = label(predicted == value)  # pyright: ignore[reportGeneralTypeIssues]
        for k in range(1, count + 1):
            inside = np.pad(regions == k, 1)
            depth: Any = distance_transform_edt(inside)
            depth = depth[1:-1, 1:-1]
            found.append((depth.max(), np.unravel_index(np.argmax(depth), depth.shape)))
    found.sort(key=lambda f: -f[0])
    size = np.maximum(np.array(predicted.shape) - 1, 1)
    return np.array([place for _, place in found]).reshape(-1, 2) / size


def distinct(points) -> np.ndarray:
    """Return points of the unit square (n, 2) without those that lie as good as on one before them."""
    near = KDTree(points).query_pairs(POINTS_APART)
    return np.delete(points, list({later for _, later in near}), axis=0)


class Border:
    """Answers at points of the unit square, and what they say between.

    Lines across which everything may change are known beforehand: their sides never speak for each other.

    Parameters
    ----------
    points : ndarray, shape (n, 2)
    answers : ndarray, shape (n, k)
        Booleans; the first column is the one whose border is sought.
    side : ndarray of int, shape (n,)
        On which side of these lines a point lies; -1: on a line itself, apart from all beside it.
    predicted : ndarray of bool, shape (n,)
        What a model says in the place of the first answer: where it is right all around, it also tells where
        between the points the answer changes.
    """

    def __init__(self, points, answers, side, predicted):
        self.points, self.answers = np.asarray(points, float), np.asarray(answers, float)
        self.side, self.predicted = np.asarray(side, int), np.asarray(predicted, bool)
        self.right = self.predicted == (self.answers[:, 0] > 0.5)
        self.inner = np.flatnonzero(self.side >= 0)
        self._near = KDTree(self.points)
        self.mesh = Delaunay(self.points[self.inner], qhull_options="QJ")

    def __call__(self, places, side, predicted) -> np.ndarray:
        """Return the answers at places (m, 2), given their sides and predictions (m,), as booleans (m, k).

        Where the corners of the triangle around a place disagree, the model's answer if it is right at all of
        them; else linear between those on the same side; where none is, the answers of the nearest point that
        lies there, or of the nearest of all.
        """
        places = np.clip(np.atleast_2d(places), self.mesh.min_bound, self.mesh.max_bound)
        simplex = self.mesh.find_simplex(places, tol=ON_EDGE)
        lost = simplex < 0  # on the rim, by rounding
        if lost.any():
            simplex[lost] = self.mesh.find_simplex(
                0.5 + (places[lost] - 0.5) * (1 - WITHIN_RIM), tol=WITHIN_RIM
            )
        turn, corners = self.mesh.transform[simplex], self.inner[self.mesh.simplices[simplex]]
        share = np.einsum("nij,nj->ni", turn[:, :2], places - turn[:, 2])
        share = np.column_stack([share, 1 - share.sum(axis=1)])
        own = self.side[corners] == side[:, None]
        alike = (self.answers[corners] == self.answers[corners][:, :1]).all(axis=(1, 2))
        share = np.where(own | (alike & (side >= 0))[:, None], np.maximum(share, CORNER_SHARE), 0.0)
        weight = share.sum(axis=1)
        with np.errstate(invalid="ignore", divide="ignore"):
            out = np.einsum("nc,nck->nk", share, self.answers[corners]) / weight[:, None] > 0.5
        for here in np.unique(side):
            mine = np.flatnonzero((weight == 0) & (side == here))
            known = np.flatnonzero(self.side == here)
            known = known if known.size else np.arange(self.side.size)
            if mine.size:
                out[mine] = self.answers[known[KDTree(self.points[known]).query(places[mine])[1]]] > 0.5
        trusted = self.right[corners].all(axis=1) & np.ptp(self.answers[corners, 0], axis=1).astype(bool)
        trusted &= side >= 0
        out[trusted, 0] = np.asarray(predicted, bool)[trusted]
        return out

    def worst_edges(self, count: int) -> np.ndarray:
        """Middles of the edges most worth a further question, far from each other, (<= count, 2)."""
        tri = self.inner[self.mesh.simplices]
        edges = np.concatenate([tri[:, [0, 1]], tri[:, [1, 2]], tri[:, [2, 0]]])
        one, other = np.unique(np.sort(edges, axis=1), axis=0).T
        length = np.linalg.norm(self.points[one] - self.points[other], axis=1)
        across = self.side[one] != self.side[other]
        # across a line known beforehand it is asked whether the answers change there, not where
        differ = (self.answers[one, 0] != self.answers[other, 0]) & (~across | (length > EDGE_COARSE))
        foreseen = differ & self.right[one] & self.right[other]
        doubted = (self.predicted[one] != self.predicted[other]) | across | foreseen
        worth = length * np.where(differ & ~foreseen, WORTH[0], np.where(doubted, WORTH[1], WORTH[2]))
        chosen: list[np.ndarray] = []
        for k in np.argsort(-worth):
            middle = 0.5 * (self.points[one[k]] + self.points[other[k]])
            if self._near.query(middle)[0] < POINTS_APART:
                continue  # one on a line known beforehand, of which the mesh does not know
            if all(np.linalg.norm(middle - c) > CUTS_APART * length[k] for c in chosen):
                chosen.append(middle)
            if len(chosen) == count:
                break
        return np.array(chosen).reshape(-1, 2)


def refined(
    first: np.ndarray,
    budget: int,
    ask: Callable[[np.ndarray], np.ndarray],
    predict: Callable[[np.ndarray], np.ndarray],
    side: Callable[[np.ndarray], np.ndarray],
) -> Border:
    """Ask at given points, then where the answers leave the border most open.

    Parameters
    ----------
    first : ndarray, shape (n, 2)
    budget : int
        Questions in all.
    ask : callable
        Answers (m, k) at points (m, 2).
    predict, side : callable
        Predictions (m,) and sides (m,) at points.
    """
    border = Border(first, ask(first), side(first), predict(first))
    part = max(1, -(-(budget - len(first)) // ROUND))
    while len(border.points) < budget:
        new = border.worst_edges(min(part, budget - len(border.points)))
        if not len(new):
            break
        answers = np.concatenate([border.answers > 0.5, ask(new)])
        sides, predictions = (
            np.append(a, b) for a, b in ((border.side, side(new)), (border.predicted, predict(new)))
        )
        border = Border(np.concatenate([border.points, new]), answers, sides, predictions)
    return border
