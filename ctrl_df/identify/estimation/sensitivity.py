"""A fitted model as a linear map: what its parameters and initial states can change in the output."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy import sparse
from scipy.linalg import matmul_toeplitz
from scipy.sparse.linalg import splu

from ...cached import cached_property
from ..shooting.elimination import products_of, states_for
from ..shooting.noise_model import NoiseModel
from ..thresholds import DEPENDENT, NEARLY_NOTHING
from .thresholds import OUTPUT_APART


class OutputSensitivity:
    """A fitted model as a linear map: what its parameters and initial states can change in the output.

    Parameters
    ----------
    parameters, states : list of (n, p) and (n, ns) arrays
        Per record, derivatives of the output at the samples within the segments.
    segments : list of Segments
    ridge : list of (nw, ns) arrays
        Precision of what is known of the initial states beforehand, in units of one sample.
    error_filter : NoiseModel or None
        What fits see of the output, where that is not the output itself.

    Attributes
    ----------
    responses : list of (n, p) arrays
        Per record, derivatives of the output where initial states are refitted as parameters move.
    parameters : list of (n, p) arrays
        What fits see of these.
    """

    def __init__(self, parameters, states, segments, ridge, error_filter=None):
        self.states, self.segments, self.ridge, self.error_filter = states, segments, ridge, error_filter
        self.responses = [self._without_starts(k, j) for k, j in enumerate(parameters)]
        self.parameters = [self._as_seen(k, r) for k, r in enumerate(self.responses)]
        stacked = np.concatenate(self.parameters)
        norms = np.linalg.norm(stacked, axis=0)
        stacked = stacked[:, norms > 0] / norms[norms > 0]
        u, s, _ = np.linalg.svd(stacked, full_matrices=False)
        self._basis = u[:, s > OUTPUT_APART * s[0]] if len(s) else u

    def _without_starts(self, k, columns):
        """Remove from the columns (n, m) of one record what its initial states can explain."""
        out = np.array(columns, dtype=float)
        states, segments = self.states[k], self.segments[k]
        if self.error_filter is None and states.shape[1]:
            solved = states_for(products_of(states, out, None, segments), self.ridge[k])
            for i, column in enumerate(states.T):
                for j in range(out.shape[1]):
                    out[:, j] -= column * segments.spread(solved[:, i, j])
        return out

    def _as_seen(self, k, columns):
        """Return what fits see of the columns (n, m) of one record."""
        if self.error_filter is None:
            return columns
        return self.error_filter.filtered(columns, self.segments[k].slices)

    def starts_open(self, k) -> np.ndarray:
        """Return how far the initial states of one record are open, (nw, ns, ns).

        ``root @ root.T`` is their covariance for white noise of variance 1, the parameters being known.
        """
        states, segments = self.states[k], self.segments[k]
        products = products_of(states, np.empty((len(states), 0)), None, segments)
        i = np.arange(states.shape[1])
        products[:, i, i] += self.ridge[k]
        size = np.sqrt(products[:, i, i])[:, :, None]
        eigen, vectors = np.linalg.eigh(products / (size * size.transpose(0, 2, 1)))
        return vectors / np.sqrt(np.maximum(eigen, NEARLY_NOTHING))[:, None, :] / size

    def absorbed_by_starts(self, k) -> np.ndarray:
        """Return columns B (n, m) of one record whose ``B @ B.T`` is what its initial states take away."""
        states, segments = self.states[k], self.segments[k]
        ns = states.shape[1]
        if self.error_filter is not None or not ns:
            return np.zeros((len(self.parameters[k]), 0))
        root = self.starts_open(k)
        found = np.zeros((len(states), len(segments), ns))
        for w, where in enumerate(segments.places):
            found[where, w] = states[where] @ root[w]
        return found.reshape(len(states), -1)

    @cached_property
    def taken_by_starts(self) -> float:
        """How many values of white noise initial states take away: their number, or fewer.

        One that is known well beforehand takes less than one.
        """
        taken = 0.0
        for k, (states, segments) in enumerate(zip(self.states, self.segments, strict=True)):
            ns = states.shape[1]
            if self.error_filter is None and ns:
                products = products_of(states, np.empty((len(states), 0)), None, segments)
                columns = np.concatenate([products, products], axis=2)
                shares = states_for(columns, self.ridge[k])
                taken += float(np.sum(np.trace(shares, axis1=1, axis2=2)))
        return taken

    def left_by_starts(self, noise: NoiseModel) -> float:
        """Return the share of the power of noise that fitted initial states leave.

        `noise`: of residuals at the full rate of the records.
        """
        taken = 0.0
        for k, segments in enumerate(self.segments):
            columns, ns = self.absorbed_by_starts(k), self.states[k].shape[1]
            if not columns.shape[1]:
                continue
            reach = (int(np.max(segments.counts)) - 1) * segments.step + 1
            known = [noise.of(i).correlation(reach)[:: segments.step] for i in range(segments.outputs)]
            for i, where in enumerate(segments.slices):
                output, w = divmod(i, len(segments))
                own = columns[where, w * ns : (w + 1) * ns]
                taken += float(np.sum(own * matmul_toeplitz(known[output][: len(own)], own)))
        return 1 - taken / sum(map(len, self.states))

    def beside(self, noise: NoiseModel) -> Callable[[np.ndarray], np.ndarray]:
        """Return what takes from whitened signals (n,) or (n, m) all that refitting could explain of them.

        Unlike `project` by the least squares that this noise asks for: of slow noise initial states take
        another part than plain squares see.
        """
        of_states = self._states_taken(noise)
        columns = of_states(noise.filtered(np.concatenate(self.parameters), self.pieces))
        norms = np.linalg.norm(columns, axis=0)
        basis, r = np.linalg.qr(columns[:, norms > 0] / norms[norms > 0])
        basis = basis[:, np.abs(np.diag(r)) > DEPENDENT]

        def taken(x):
            x = of_states(x)
            return x - basis @ (basis.T @ x)

        return taken

    def _states_taken(self, noise: NoiseModel) -> Callable[[np.ndarray], np.ndarray]:
        """Return what takes from whitened signals all that initial states could explain: sparse columns."""
        if self.error_filter is not None or not any(np.any(s) for s in self.states):
            return lambda x: x
        ours = [_orthonormal(*pair) for pair in zip(self.states, self.segments, strict=True)]
        z = sparse.csc_array(noise.matrix(self.pieces) @ sparse.block_diag(ours, format="csr"))
        norms = np.sqrt(np.asarray(z.multiply(z).sum(axis=0)).ravel())
        z = z[:, norms > 0] @ sparse.diags_array(1 / norms[norms > 0])
        solve = splu(sparse.csc_array(z.T @ z + NEARLY_NOTHING * sparse.eye_array(z.shape[1]))).solve
        return lambda x: x - z @ solve(z.T @ x)

    @property
    def pieces(self) -> list[slice]:
        """What `project` returns as evidence takes it: whole, or by segments where errors are of forces."""
        if self.error_filter is None:
            if all(w.outputs == 1 for w in self.segments):
                return [slice(0, sum(map(len, self.states)))]
            lengths = [b.stop - b.start for w in self.segments for b in w.blocks]
            return _end_to_end(lengths)
        lengths = [
            (w.stop - w.start) // self.error_filter.step - self.error_filter.order
            for segments in self.segments
            for w in segments.slices
        ]
        return _end_to_end(lengths)

    def project(self, signals: Sequence[np.ndarray]) -> np.ndarray:
        """Return what fits see of signals, one array for all records, less what refitting could explain."""
        joined = np.concatenate(
            [
                self._as_seen(k, self._without_starts(k, np.reshape(e, (-1, 1))))[:, 0]
                for k, e in enumerate(signals)
            ]
        )
        return joined - self._basis @ (self._basis.T @ joined)


def _end_to_end(lengths) -> list[slice]:
    """Return the places of parts of these lengths, one after another."""
    ends = np.cumsum([0, *lengths])
    return [slice(int(i), int(j)) for i, j in zip(ends[:-1], ends[1:], strict=True)]


def _orthonormal(states, segments) -> sparse.csr_array:
    """Return orthonormal columns that span what the initial states (n, ns) of every segment can do."""
    blocks, order = [], []
    for where in segments.places:
        part = states[where]
        size = np.linalg.norm(part, axis=0)
        u, s, _ = np.linalg.svd(part[:, size > 0] / size[size > 0], full_matrices=False)
        blocks.append(u[:, s > DEPENDENT * s[:1]])
        order.append(np.arange(len(states))[where])
    rows = np.argsort(np.concatenate(order))
    return sparse.csr_array(sparse.block_diag(blocks, format="csr"))[rows]
