"""Where a yes turns into a no over a plane, from few answers: triangles between them, cut where they disagree."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.ndimage import distance_transform_edt, label
from scipy.spatial import Delaunay
from scipy.stats import qmc

# An edge is cut by its length times this: between different answers, between different predictions, between none.
# At the ends of the range an edge of 0.2 that nothing is known against waits for borders of 0.025 to be resolved.
_WORTH = (1.0, 0.35, 0.125)
_ROUND = 8  # rounds of cutting


def spread_points(count: int, seed: int) -> np.ndarray:
    """Points that fill the unit square evenly, (count, 2); the corners are the first four."""
    corners = np.array([[0.0, 0.0], [1.0, 1.0], [0.0, 1.0], [1.0, 0.0]])
    inner = qmc.Halton(2, seed=seed).random(max(count - 4, 0))
    return np.concatenate([corners, inner])[:count]


def deep_points(predicted) -> np.ndarray:
    """The point farthest from all others of every connected region of a map of predictions, in the unit square."""
    predicted = np.asarray(predicted)
    found = []
    for value in np.unique(predicted):
        regions, count = label(predicted == value)  # pyright: ignore[reportGeneralTypeIssues]
        for k in range(1, count + 1):
            inside = np.pad(regions == k, 1)
            depth = distance_transform_edt(inside)[1:-1, 1:-1]  # pyright: ignore[reportOptionalSubscript]
            found.append((depth.max(), np.unravel_index(np.argmax(depth), depth.shape)))
    found.sort(key=lambda f: -f[0])
    size = np.maximum(np.array(predicted.shape) - 1, 1)
    return np.array([place for _, place in found]).reshape(-1, 2) / size


class Border:
    """Answers at points of the unit square, and what they say between.

    Parameters
    ----------
    points : ndarray, shape (n, 2)
    answers : ndarray, shape (n, k)
        Booleans; the first column is the one whose border is sought.
    """

    def __init__(self, points, answers):
        self.points, self.answers = np.asarray(points, float), np.asarray(answers, float)
        self.mesh = Delaunay(self.points, qhull_options="QJ")

    def __call__(self, places) -> np.ndarray:
        """Return the answers at places (m, 2), as booleans (m, k): linear between the corners of triangles."""
        places = np.clip(np.atleast_2d(places), 0.0, 1.0)
        simplex = self.mesh.find_simplex(places, tol=1e-9)
        lost = simplex < 0  # on the rim, by rounding
        if lost.any():
            simplex[lost] = self.mesh.find_simplex(0.5 + (places[lost] - 0.5) * (1 - 1e-6), tol=1e-6)
        turn = self.mesh.transform[simplex]
        share = np.einsum("nij,nj->ni", turn[:, :2], places - turn[:, 2])
        share = np.column_stack([share, 1 - share.sum(axis=1)])
        return np.einsum("nc,nck->nk", share, self.answers[self.mesh.simplices[simplex]]) > 0.5

    def worst_edges(self, count: int, predicted) -> np.ndarray:
        """Middles of the edges most worth a further question, far from each other, (<= count, 2)."""
        tri = self.mesh.simplices
        edges = np.unique(np.sort(np.concatenate([tri[:, [0, 1]], tri[:, [1, 2]], tri[:, [2, 0]]]), axis=1), axis=0)
        one, other = edges.T
        length = np.linalg.norm(self.points[one] - self.points[other], axis=1)
        differ = self.answers[one, 0] != self.answers[other, 0]
        doubted = predicted[one] != predicted[other]
        worth = length * np.where(differ, _WORTH[0], np.where(doubted, _WORTH[1], _WORTH[2]))
        chosen: list[np.ndarray] = []
        for k in np.argsort(-worth):
            middle = 0.5 * (self.points[one[k]] + self.points[other[k]])
            if all(np.linalg.norm(middle - c) > 0.5 * length[k] for c in chosen):
                chosen.append(middle)
            if len(chosen) == count:
                break
        return np.array(chosen).reshape(-1, 2)


def refined(
    first: np.ndarray,
    budget: int,
    ask: Callable[[np.ndarray], np.ndarray],
    predict: Callable[[np.ndarray], np.ndarray],
) -> Border:
    """Ask at given points, then where the answers leave the border most open.

    Parameters
    ----------
    first : ndarray, shape (n, 2)
    budget : int
        Questions in all.
    ask : callable
        Answers (m, k) at points (m, 2).
    predict : callable
        Predictions (m,) at points.
    """
    border = Border(first, ask(first))
    part = max(1, -(-(budget - len(first)) // _ROUND))
    while len(border.points) < budget:
        new = border.worst_edges(min(part, budget - len(border.points)), predict(border.points))
        if not len(new):
            break
        answers = np.concatenate([border.answers > 0.5, ask(new)])
        border = Border(np.concatenate([border.points, new]), answers)
    return border
