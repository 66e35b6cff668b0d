"""The force that would have to be added at every instant, by iterated smoothing over the model's own runs.

The disturbance d is a Gaussian process with exp(-|lag| / time) as its correlation, or one that has a slope
(Matern's class of 3/2), whichever makes the record more probable; together with the states of the block it
is smoothed over the whole record. Size and time of the disturbance and the noise of the sensor maximize the
likelihood of the record. The noise is white or, where that is more probable, white and slow (of first order,
a state more for every output). Steps are linearized where, and as widely as, the smoother before says the
states are (iterated posterior linearization), so that friction that sticks within a step is met from both
sides. Sources: Garcia-Fernandez, Svensson & Sarkka, IEEE Trans. Automat. Contr. 62 (2017) 2056; Marino &
Cicirello on switching latent force models of dry friction (2023).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from ...blocks.mechanism import Mechanism
from ..data.measurement import Measurement
from ..prediction.segments import facts_of
from ..prediction.sensed import POSITION
from .kalman import smoothed
from .steps import Linearized, Steps
from .thresholds import (
    SLOPE_LEAST,
    SLOW_PRIOR,
    SMOOTHER_BEGIN,
    SMOOTHER_DAMPED,
    SMOOTHER_DRIVEN,
    SMOOTHER_ESTIMATED,
    SMOOTHER_EVALUATIONS,
    SMOOTHER_JITTER,
    SMOOTHER_LEAK,
    SMOOTHER_PRIOR,
    SMOOTHER_RANGE,
    SMOOTHER_ROUNDS,
    SMOOTHER_SPREADS,
    SMOOTHER_STEPS,
    SMOOTHER_STILL,
    SMOOTHER_TRIED,
    SMOOTHER_USUAL,
    STEPS_A_MOVE,
    UNLIKELY,
)


@dataclass(frozen=True)
class Smoothed:
    """What a smoother makes of a record.

    Attributes
    ----------
    time : (N,) array
        Middles of the steps [s]: a force that acts over a whole step is the one of its middle.
    states, force, std : (N, n), (N,), (N,) arrays
        There, the states of the block, the force missing and its standard deviation [N].
    own : (N, p) array
        Force that a small change of each of the block's parameters makes, over that change.
    size, memory, noise : float
        Standard deviation [N] and correlation time [s] of the process, and of the sensor's noise.
    evidence : float
        Log likelihood of the record, and of the record where nothing is missing.
    """

    time: np.ndarray
    states: np.ndarray
    force: np.ndarray
    std: np.ndarray
    own: np.ndarray
    size: float
    memory: float
    noise: float
    evidence: float


def smooth_record(block: Mechanism, record: Measurement) -> Smoothed:
    """Smooth the force that is missing of a block beside one record."""
    known = facts_of(block, record)
    moves = (len(record) - 1) * record.dt / known.period
    steps = Steps(block, record, math.ceil(len(record) / max(SMOOTHER_STEPS, STEPS_A_MOVE * moves)))
    mean, std = steps.guess()
    scale = np.median(std, axis=0)
    scale[-1] = known.force
    mean, cov = mean / scale, np.array([np.diag((row / scale) ** 2) for row in std])
    process_noise = _process_noise(steps, known, scale)
    first = cov[0]
    about = (steps, scale, process_noise, first, known)

    def begun(slow) -> _Estimate:
        return _Estimate(mean, cov, _usual(known, record.dt, SMOOTHER_BEGIN, slow))

    # slow noise would pass for a force, as large as it takes to move the machine by it
    white, slow = begun(False), begun(True)
    unequal = 0.5 * len(SLOW_PRIOR) * math.log(len(record))
    for done in range(1, SMOOTHER_TRIED + 1):
        white, slow = (_iterated(f, False, range(done - 1, done), *about) for f in (white, slow))
        likely = slow if slow.evidence > white.evidence + unequal else white
        if likely is white:
            break
    rough = _iterated(likely, False, range(done, SMOOTHER_ROUNDS), *about)
    # a law of friction changes at once, one of a place smoothly: the record tells which it is
    smooth = _iterated(rough, True, range(SMOOTHER_ROUNDS), *about)
    best = max((rough, smooth), key=lambda f: f.evidence)
    mean, cov, evidence = best.mean, best.cov, best.evidence
    size, memory, noise, *slow_noise = np.exp(best.sizes).tolist()
    return Smoothed(
        _middles(steps.times), _middles(mean[:, :-1] * scale[:-1]), mean[:-1, -1] * scale[-1],
        np.sqrt(cov[:-1, -1, -1]) * scale[-1], steps.own(mean * scale), size * scale[-1],
        memory, math.hypot(noise, *slow_noise[:1]), evidence,
    )  # fmt: skip


@dataclass(frozen=True)
class _Estimate:
    """Means and covariances of states and force, the sizes they go with, and their evidence."""

    mean: np.ndarray
    cov: np.ndarray
    sizes: np.ndarray
    evidence: float = -math.inf


def _iterated(
    initial: _Estimate, smooth: bool, rounds: range, steps: Steps, scale, process_noise, first, known
) -> _Estimate:
    """Linearize and smooth in turn, until the force stays; else return the most probable round."""
    mean, cov, sizes, best = initial.mean, initial.cov, initial.sizes, initial
    for iteration in rounds:
        try:
            lin = _scaled(steps.linearized(mean * scale, cov * np.outer(scale, scale)), scale)
        except np.linalg.LinAlgError:  # rounding has left no covariance
            break
        model = _Model(lin, steps, process_noise, mean[0], first, known, smooth, _has_slow_noise(sizes))
        if iteration < SMOOTHER_ESTIMATED:
            sizes = model.most_probable(sizes, SMOOTHER_DAMPED[min(iteration // 2, 1)])
        smoothed_mean, cov, _ = model.smoothed(sizes)
        evidence = model.evidence(sizes)
        variance = cov[:, -1, -1]
        there = variance > 0  # by rounding it may be less than none
        change = np.max(np.abs(smoothed_mean - mean)[there, -1] / np.sqrt(variance[there]), initial=0.0)
        mean = smoothed_mean
        found = _Estimate(mean, cov, sizes, evidence)
        best = max(best, found, key=lambda f: f.evidence)
        if iteration > 1 and change < SMOOTHER_STILL:
            return found
    return best


def _usual(known, dt, about, slow) -> np.ndarray:
    """Return the logarithms of usual sizes: the force and its time, white noise; slow noise and its time."""
    force, time = about
    sizes = [force, time * known.period, known.noise]
    return np.log([*sizes, known.noise, math.sqrt(dt * known.period)] if slow else sizes)


def _has_slow_noise(sizes) -> bool:
    """Whether the sizes are those of a model with slow noise, too."""
    return len(sizes) > len(SMOOTHER_PRIOR)


def _middles(at_edges) -> np.ndarray:
    return 0.5 * (at_edges[1:] + at_edges[:-1])


def _process_noise(steps: Steps, known, scale) -> np.ndarray:
    """Return variances that keep the covariances of the states regular, and change nothing else."""
    n = len(steps.free)
    place = known.noise if steps.simulator.sensed.columns[0] == POSITION else known.noise * known.period
    q = (SMOOTHER_JITTER * scale[:-1]) ** 2
    for body in range(steps.core.bodies):
        dt = float(np.median(np.diff(steps.times)))
        q[2 * body] = (SMOOTHER_LEAK * place) ** 2 / len(steps)
        q[2 * body + 1] = (SMOOTHER_DRIVEN * known.force * dt / sum(steps.core.masses)) ** 2
    return q[:n] / scale[:-1] ** 2


def _scaled(lin: Linearized, scale) -> Linearized:
    inner = scale[:-1]
    return Linearized(
        lin.a * scale / inner[:, None],
        lin.b / inner,
        lin.q / np.outer(inner, inner),
        lin.c * scale,
        lin.e,
        lin.r,
    )


class _Model:
    """A linear Gaussian state-space model of a record: its smoother and its likelihood."""

    def __init__(self, lin: Linearized, steps: Steps, process_noise, mean0, cov0, known, smooth, coloured):
        self.lin, self.known, self.smooth = lin, known, smooth
        self.dt, self.step = np.diff(steps.times), steps.record.dt
        count, n = lin.b.shape[0], lin.a.shape[2]
        self.force, inner = n - 1, np.arange(n - 1)
        states = n + 1 if smooth else n  # the slope of the force, over its usual size, is one more
        outputs = len(steps.values)
        self.slow = slice(states, states + outputs if coloured else states)  # slow noise of every output
        states = self.slow.stop
        self.mean0, self.cov0 = _widened(mean0, states), _widened(cov0, states, states)
        self.a, self.b = _widened(lin.a, count, states, states), _widened(lin.b, count, states)
        self.q = _widened(lin.q, count, states, states)
        self.q[:, inner, inner] += process_noise
        at = steps.edges[:-1, None] + steps.samples
        self.present = np.hstack([at < steps.edges[1:, None]] * outputs)
        # seconds from the begin of its step, and the output, of every sample
        self.age = np.tile(steps.samples * self.step, outputs)
        self.output = np.repeat(np.arange(outputs), len(steps.samples))
        y = np.hstack([y[np.minimum(at, len(y) - 1)] for y in steps.values])
        self.off = np.where(self.present, y - lin.e, 0.0)
        self.c = np.where(self.present[:, :, None], lin.c, 0.0)
        self.r = np.where(self.present, lin.r, 0.0)

    def smoothed(self, sizes, back=True):
        """Return means, covariances and evidence with log size [force], log time [s], log noise.

        And those of slow noise and its time, if it has any.
        """
        size, memory, noise, *slow = np.exp(np.clip(sizes, -SMOOTHER_RANGE, SMOOTHER_RANGE))
        a, q, mean0, cov0 = self.a.copy(), self.q.copy(), self.mean0.copy(), self.cov0.copy()
        self._let_force_vary(a, q, mean0, cov0, size, memory)
        c, correlated = self._let_noise_vary(a, q, cov0, *slow) if slow else (self.c, np.zeros(0))
        weighted, off, size_of_noise = self._weighed(c, noise**2 + self.r, correlated)
        (count, states), seen = self.b.shape, c.shape[2]
        info, info_vector = np.zeros((count + 1, states, states)), np.zeros((count + 1, states))
        info[:-1, :seen, :seen] = weighted.swapaxes(1, 2) @ c
        info_vector[:-1, :seen] = np.einsum("kmi,km->ki", weighted, self.off)
        mean, cov, evidence = smoothed(a, self.b, q, info, info_vector, mean0, cov0, back)
        evidence -= 0.5 * float(np.sum(off * self.off))
        # no record is more probable than one that errs nowhere: more is rounding
        evidence = evidence - 0.5 * size_of_noise if evidence <= 0 else -math.inf
        kept = slice(self.force + 1)
        return mean[:, kept], cov[:, kept, kept], evidence

    def _let_force_vary(self, a, q, mean0, cov0, size, memory):
        """Write how the force, and its slope if it has one, goes on, into a model without it."""
        last, states = self.force, slice(self.force, self.slow.start)
        cov0[last], cov0[:, last], mean0[last] = 0.0, 0.0, 0.0
        cov0[states, states] = size**2 * np.eye(self.slow.start - last)
        if self.smooth:
            kept = _with_slope(self.dt * math.sqrt(3) / memory)
            a[:, states, states] = kept
            q[:, states, states] = size**2 * (np.eye(2) - kept @ kept.swapaxes(1, 2))
            return
        a[:, last, last] = np.exp(-self.dt / memory)
        q[:, last, last] = size**2 * -np.expm1(-2 * self.dt / memory)
        # the mean over a step differs from the force at its middle: of a Brownian motion by a twelfth
        apart = size**2 * -np.expm1(-self.dt / (6 * memory))
        pushed = a[:, :last, last]
        q[:, :last, :last] += apart[:, None, None] * pushed[:, :, None] * pushed[:, None, :]

    def _let_noise_vary(self, a, q, cov0, spread, forgets):
        """Write how slow noise of the outputs goes on into a model without it.

        Returns the outputs' derivatives by all states, and the covariance (m, m) of what is new in the noise
        of samples since their step began.
        """
        states = np.arange(self.slow.start, self.slow.stop)
        a[:, states, states] = np.exp(-self.dt / forgets)[:, None]
        q[:, states, states] = spread**2 * -np.expm1(-2 * self.dt / forgets)[:, None]
        cov0[states, states] = spread**2
        kept = np.exp(-self.age / forgets)
        c = _widened(self.c, *self.c.shape[:2], self.slow.stop)
        c[:, np.arange(len(kept)), self.slow.start + self.output] = np.where(self.present, kept, 0.0)
        apart = np.exp(-np.abs(np.subtract.outer(self.age, self.age)) / forgets)
        alike = np.equal.outer(self.output, self.output)
        return c, spread**2 * np.where(alike, apart - np.outer(kept, kept), 0.0)

    def _weighed(self, c, variance, correlated):
        """Return c and what samples are off, over the covariance of noise, and the log determinant of that.

        `variance` (N, m): of each sample by itself; `correlated` (m, m): beside it, or nothing.
        """
        if not np.any(correlated):
            weight = np.where(self.present, 1.0 / variance, 0.0)
            return c * weight[:, :, None], weight * self.off, -float(np.sum(np.log(weight[self.present])))
        both = self.present[:, :, None] & self.present[:, None, :]
        covariance = np.where(both, correlated, 0.0)
        each = np.arange(len(correlated))
        covariance[:, each, each] += np.where(self.present, variance, 1.0)
        solved = np.linalg.solve(covariance, np.concatenate([c, self.off[:, :, None]], axis=2))
        return solved[:, :, :-1], solved[:, :, -1], float(np.sum(np.linalg.slogdet(covariance)[1]))

    def most_probable(self, sizes, width):
        """Return the sizes of most evidence, sought about those given."""
        corners = np.vstack([sizes, sizes + width * np.eye(len(sizes))])
        apart, gained = SMOOTHER_SPREADS
        how = {"initial_simplex": corners, "maxfev": SMOOTHER_EVALUATIONS, "xatol": apart, "fatol": gained}
        return minimize(lambda p: -self.evidence(p), sizes, method="Nelder-Mead", options=how).x

    def evidence(self, sizes) -> float:
        """Return log p(record | sizes) + log p(sizes): wide priors about the scales of the record."""
        usual = _usual(self.known, self.step, SMOOTHER_USUAL, _has_slow_noise(sizes))
        prior = np.array([*SMOOTHER_PRIOR, *SLOW_PRIOR])[: len(sizes)]
        value = self.smoothed(sizes, back=False)[2] - 0.5 * float(np.sum(((sizes - usual) / prior) ** 2))
        return value if math.isfinite(value) else UNLIKELY


def _widened(values, *shape: int) -> np.ndarray:
    """Return an array of that shape that begins with these values; the rest is 0."""
    found = np.zeros(shape)
    found[tuple(slice(n) for n in values.shape)] = values
    return found


def _with_slope(decay) -> np.ndarray:
    """Return what each step keeps (count, 2, 2) of a force and of its slope, over its usual size.

    They are those of a process of Matern's class, differentiable once. `decay`: of each step, over the
    process's time. Source: Hartikainen & Sarkka, IEEE MLSP (2010) 379.
    """
    x = np.maximum(decay, SLOPE_LEAST)
    return np.exp(-x)[:, None, None] * np.array([[1 + x, x], [-x, 1 - x]]).transpose(2, 0, 1)
