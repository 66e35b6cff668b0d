"""Motion in, force out: what a block answers with along a motion that is imposed on it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..blocks.core import Core
from ..thresholds import FEW_ROUNDED, SQRT_EPS
from .kernel.imposed import force_along, work_arrays
from .parallel import Elsewhere, Stopped, flag
from .program.imposed import laws_of
from .program.pointers import raise_kept
from .thresholds import IMPOSED_RTOL


@dataclass(frozen=True, eq=False)
class Path:
    """A motion between its samples: a cubic from each to the next, its reversals found.

    Attributes
    ----------
    nodes : (m, 5) array
        Time [s], position [m], speed [m/s], acceleration [m/s^2], direction (+-1) of the piece before, at the
        samples and at the reversals between them.
    samples : (m,) int array
        The sample at each node; -1 at reversals.
    open : (q,) int array
        Samples at which the direction is not known.
    """

    nodes: np.ndarray
    samples: np.ndarray
    open: np.ndarray

    @property
    def count(self) -> int:
        """Number of samples."""
        return int(self.samples.max()) + 1

    def between(self, first: int, last: int) -> Path:
        """Return the motion from sample `first` to before `last`."""
        begin, end = np.flatnonzero((self.samples == first) | (self.samples == last - 1))
        nodes, samples = self.nodes[begin : end + 1].copy(), self.samples[begin : end + 1]
        nodes[0, 4] = nodes[1, 4]  # no piece is before the first
        inside = (self.open >= first) & (self.open < last)
        return Path(nodes, np.where(samples < 0, -1, samples - first), self.open[inside] - first)


def path_of(t, x, v=None, *, still: float = 0.0, slow: float = 0.0) -> Path:
    """Return the motion through positions x (n,) at times t (n,).

    Without speeds it is a cubic spline, whose acceleration is continuous but where motion begins or ends:
    three equal positions or more are a standstill. With them each piece is Hermite's cubic through positions
    and speeds, and the acceleration that of a spline through the speeds. Where it stands still the direction
    is that of the motion before (at the begin: of the motion to come). `still`: a way back no longer than
    that is noise [m], and changes no direction. `slow`: speeds up to that may be noise [m/s]: their direction
    is not known.
    """
    t, x = np.asarray(t, float), np.asarray(x, float)
    moves = _moving(x) if v is None else [(0, len(t))]
    v = _slopes(t, x, moves, "clamped") if v is None else np.asarray(v, float)
    a = _slopes(t, v, moves, "not-a-knot")
    h = np.diff(t)
    mean = np.diff(x) / h
    # speed over the piece, s from 0 to 1: v0 + b s + c s^2
    b, c = 6 * mean - 4 * v[:-1] - 2 * v[1:], 3 * (v[:-1] + v[1:] - 2 * mean)
    pieces, at = _turns(v[:-1], b, c)
    h, v0, b, c = h[pieces], v[pieces], b[pieces], c[pieces]
    turned = np.column_stack([
        t[pieces] + at * h,
        x[pieces] + h * at * (v0 + at * (b / 2 + at * c / 3)),
        np.zeros(len(at)),
        (b + 2 * c * at) / h,
    ])  # fmt: skip
    every = np.concatenate([np.column_stack([t, x, v, a]), turned])
    number = np.concatenate([np.arange(len(t)), np.full(len(at), -1)])
    order = np.argsort(every[:, 0], kind="stable")
    every, number = every[order], number[order]
    unknown = np.flatnonzero(np.abs(v) <= slow) if slow > 0 else np.zeros(0, int)
    return Path(np.column_stack([every, _directions(every[:, 1], still)]), number, unknown)


def _moving(x) -> list[tuple[int, int]]:
    """Return the first sample and the one after the last of every stretch of motion, those at rest shared."""
    still = np.diff(x) == 0.0
    beside = np.concatenate([[False], still[:-1] & still[1:], [False]])
    pieces = np.concatenate([[0], ~(still & (beside[:-1] | beside[1:])), [0]])
    edges = np.flatnonzero(np.diff(pieces))
    return [(int(first), int(last) + 1) for first, last in edges.reshape(-1, 2)]


def _slopes(t, values, moves, end: str) -> np.ndarray:
    """Return the slopes of splines through stretches of values (n,); zero elsewhere.

    `end`: what a spline does where its stretch ends within the record, as SciPy calls it.
    """
    from scipy.interpolate import CubicSpline

    slopes = np.zeros(len(t))
    for first, last in moves:
        ends: Any = ("not-a-knot" if first == 0 else end, "not-a-knot" if last == len(t) else end)
        part = slice(first, last)
        slopes[part] = CubicSpline(t[part], values[part], bc_type=ends)(t[part], 1)
    return slopes


def sine_path(amplitude: float, omega: float, phase: np.ndarray) -> Path:
    """Return the motion ``amplitude cos(omega t)`` through its places at phases omega t (n,), with speeds."""
    return path_of(phase / omega, amplitude * np.cos(phase), -amplitude * omega * np.sin(phase))


def harmonics(values: np.ndarray, phase: np.ndarray, orders: int) -> np.ndarray:
    """Return the harmonics Y_k (..., orders + 1) of values (..., n) at even phases over whole periods."""
    y = 2.0 / len(phase) * (values @ np.exp(-1j * np.outer(phase, np.arange(orders + 1))))
    y[..., 0] *= 0.5
    return y


def _turns(v0, b, c):
    """Return the pieces in which v0 + b s + c s^2 changes sign within 0 < s < 1, and where."""
    with np.errstate(divide="ignore", invalid="ignore"):
        root = np.sqrt(b * b - 4 * c * v0)
        q = -0.5 * (b + np.where(b >= 0, root, -root))
        found = [q / c, v0 / q]
    inside = [np.isfinite(s) & (s > SQRT_EPS) & (s < 1 - SQRT_EPS) & (root > 0) for s in found]
    pieces = np.concatenate([np.flatnonzero(i) for i in inside])
    return pieces, np.concatenate([s[i] for s, i in zip(found, inside, strict=True)])


def _directions(x, still: float) -> np.ndarray:
    """Return the direction of the piece before each node, (m,), by the positions x at the nodes."""
    # what rounding leaves of a place is no motion either
    least = max(still, FEW_ROUNDED * float(np.max(np.abs(x))))
    steps = np.sign(np.diff(x))
    turns = np.flatnonzero(np.diff(steps)) + 1
    way = np.ones(len(x))
    begin, now, top = 0, 0.0, 0  # `top`: the farthest node in the direction `now`
    for i in [*turns.tolist(), len(x) - 1]:
        if now == 0.0:
            low, high = int(np.argmin(x[: i + 1])), int(np.argmax(x[: i + 1]))
            if x[high] - x[low] > least:
                now, top = (1.0, i) if x[i] - x[low] > least else (-1.0, i)
            continue
        if now * (x[i] - x[top]) >= 0.0:
            top = i
        elif now * (x[top] - x[i]) > least:
            way[begin + 1 : top + 1] = now
            begin, now, top = top, -now, i
    way[begin + 1 :] = now or 1.0
    way[0] = way[1]
    return way


def imposed_forces(
    cores: Sequence[Core], path: Path, z0: np.ndarray, *, rtol: float = IMPOSED_RTOL, states: bool = False
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the forces of blocks that differ in their values alone, and their hidden states.

    Parameters
    ----------
    cores : sequence of Core
        Of one body each.
    path : Path
        The motion of all.
    z0 : (rows, nz) array
        Hidden states at its begin.
    rtol : float
        Of hidden states.
    states : bool
        Whether these are returned.

    Returns
    -------
    (rows, n), (rows, q), (rows, n, nz) arrays
        [N], NaN from where a state ran away; the force by the other direction at samples whose direction is
        not known; states, of no rows where they are not asked for.
    """
    laws = laws_of(cores)
    stop = flag()
    if stop is not None and laws.calls_python:
        raise Elsewhere
    rows, n = len(cores), path.count
    out = np.empty((rows, n))
    kept = np.empty((rows, n, laws.states) if states else (0, 0, 0))
    stop = np.zeros(1, np.int64) if stop is None else stop
    open_at, back = np.full(n, -1), np.empty((rows, len(path.open)))
    open_at[path.open] = np.arange(len(path.open))
    done = force_along(
        laws.table, laws.par, laws.mass, laws.span, laws.asked, laws.presliding, path.nodes, path.samples,
        np.array(z0, dtype=float, order="C").reshape(rows, laws.states),  # a copy: machine code of one kind
        rtol, stop, work_arrays(laws.states), out, open_at, back, kept,
    )  # fmt: skip
    raise_kept()
    if not done:
        raise Stopped
    return out, back, kept
