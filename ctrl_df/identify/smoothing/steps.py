"""Short runs of a block from many states at once, and the affine map with noise that is closest to them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ...blocks.core import IMPACT
from ...blocks.effect import Effect
from ...blocks.parameter import parameter
from ...blocks.primitives import Ramp
from ...simulate.groups import groups_of
from ...simulate.runs import run_many, sampled_drives
from ..data.measurement import Measurement
from ..prediction import initial_states
from ..prediction.batch import most_steps
from ..prediction.segments import facts_of
from ..prediction.sensed import POSITION, force_scale
from ..prediction.simulator import Simulator
from ..thresholds import UNPLACED
from .thresholds import HELD_BACK, SMOOTHER_NUDGE, SMOOTHER_RTOL, SMOOTHER_SAMPLES


@dataclass(frozen=True)
class Disturbance(Effect):
    """A force that no effect of the block knows of, constant over a short run, on the body that is driven.

    Parameters
    ----------
    force : float
        [N], positive along +x.
    """

    force: float = parameter("N", lower=-math.inf, meaning="force that no law knows of")

    role: ClassVar[str] = "force"
    place_free: ClassVar[bool] = True
    affine: ClassVar[bool] = True

    @staticmethod
    def law(t, x, v, z, p, dz):
        """Return the force [N]."""
        return p[0]


@dataclass(frozen=True)
class Linearized:
    """Steps s_(k+1) = a s_k + b + w and samples y = c s_k + e + noise within them.

    Attributes
    ----------
    a, b, q : (N, n, n), (N, n), (N, n, n) arrays
        The step of the states, and the covariance of what is not affine about it.
    c, e, r : (N, m, n), (N, m), (N, m) arrays
        The samples, and the variance of what is not affine about them; NaN where a step has fewer.
    """

    a: np.ndarray
    b: np.ndarray
    q: np.ndarray
    c: np.ndarray
    e: np.ndarray
    r: np.ndarray


@dataclass(frozen=True)
class StateErrors:
    """Standard deviations of position and velocity where steps begin, (N + 1,) each."""

    x_error: np.ndarray
    v_error: np.ndarray

    def __len__(self) -> int:
        return len(self.x_error)


class Steps:
    """A record cut into short steps, each from any state.

    The vector s holds the states of the block that are not known from the input alone (those of lags are),
    then the disturbance [N].

    Parameters
    ----------
    block : Mechanism
    record : Measurement
    every : int
        Samples a step.
    """

    def __init__(self, block, record: Measurement, every: int):
        model = block.with_effects([*block.effects, Disturbance(0.0)])
        self.simulator = Simulator(model, record, rtol=SMOOTHER_RTOL)
        self.part = self.simulator.models.ready(None)
        self.record = record
        self.edges = np.append(np.arange(0, len(record) - 1, every), len(record) - 1)
        # the samples of a step that are compared, counted from its begin
        self.samples = np.unique(np.linspace(0, every - 1, min(every, SMOOTHER_SAMPLES)).round().astype(int))
        self.known = facts_of(block, record)
        self.values = self._sensed()
        states = self.part.engine.nstates
        known = [state for state, _ in self.part.lags]
        self.free = np.array([i for i in range(states) if i not in known])
        core = self.part.core
        self._place = next(i for i, e in enumerate(model.effects) if isinstance(e, Disturbance))
        self._name = f"{list(model.named_effects)[self._place]}.force"
        self.core = core

    def __len__(self) -> int:
        return len(self.edges) - 1

    @property
    def times(self) -> np.ndarray:
        """Times at which steps begin and the last ends [s], (N + 1,): of the states, not of the sensor."""
        return self.record.t[self.edges] - self.late

    def _sensed(self) -> list[np.ndarray]:
        """Return the outputs, each over its own noise, without what sensors of the place add to it.

        A velocity is that of the instants at which a late sensor saw the place.
        """
        t, measured, late, outputs = self.record.t, self.simulator.sensed, self.late, []
        for column, y, weight in zip(measured.columns, measured.values, measured.weights, strict=True):
            y = np.array(y, float)
            for primitive, later in self.part.output if column == POSITION else ():
                if isinstance(primitive, Ramp):
                    y -= primitive.offset + primitive.rate * (t - later)
            if column != POSITION and late:
                y = np.interp(t - late, t, y)
            outputs.append(weight * y)
        return outputs

    @property
    def late(self) -> float:
        """How long after it was so a sensor sees the place [s]; 0 where there was none."""
        return self.part.late

    def guess(self) -> tuple[np.ndarray, np.ndarray]:
        """Return states and their standard deviations as the record alone has them, (N + 1, n) each."""
        known = self.known
        x, v, a = self._motion(known)
        states = np.zeros((len(self.edges), self.part.engine.nstates))
        initial_states.fill(states, self.core, {}, (x, v, a), known.speed)
        spread = self._spread(states, (x, v, a), known)
        d = np.zeros((len(self.edges), 1))
        return (
            np.hstack([states[:, self.free], d]),
            np.hstack([spread[:, self.free], d + known.force]),
        )

    def _spread(self, states, usual, known) -> np.ndarray:
        """Return how far states may be from the guess: what changes with each correction of it."""
        one = np.ones(len(states))
        slow = known.noise / math.sqrt(2 * known.half + 1)
        if self.simulator.sensed.columns[0] == POSITION:
            errors = StateErrors(slow * one, slow / (known.half * known.dt) * one)
        else:
            errors = StateErrors(UNPLACED * known.position * one, slow * one)
        names = initial_states.names(self.core)
        reach = initial_states.reach(names, self.core, known, errors)
        square = np.zeros_like(states)
        for name, offset in zip(names, reach.T, strict=True):
            changes = []
            for sign in (-1.0, 1.0):
                moved = states.copy()
                initial_states.fill(moved, self.core, {name: sign * offset}, usual, known.speed)
                changes.append(np.abs(moved - states))
            square += np.maximum(*changes) ** 2
        # states that no correction moves: those of laws that begin at rest
        square[:, np.max(square, axis=0) == 0] = known.force**2
        return np.sqrt(square)

    def _motion(self, known):
        from ..data.signals import automatic_cutoff, derivative

        t, y, column = self.record.t, self.values[0], self.simulator.sensed.columns[0]
        cutoff = automatic_cutoff(y - np.mean(y), known.dt)
        measured = self.record.velocity if column == POSITION else None
        v = derivative(t, y, 1 - column, cutoff) if measured is None else measured
        a = derivative(t, y, 2 - column, cutoff)
        x = y if column == POSITION else known.place
        usual = known.force / sum(self.core.masses)
        a = usual * np.tanh(a / usual)
        return x[self.edges], v[self.edges], a[self.edges]

    def own(self, mean: np.ndarray) -> np.ndarray:
        """Return what each of the block's parameters would do as a force per change of it, (N, p), by step.

        Each is changed a little, and the force taken that would change the speed of the body driven as much.
        What scales the force recorded is held: with it and all others any force could be made.
        """
        every, columns = np.arange(len(self)), []
        speed = int(np.flatnonzero(self.free == 2 * self.core.driven + 1)[0])
        parameters = self.simulator.block.parameters
        mine = [k for k, p in parameters.items() if p.free and k != self._name]
        pushed = SMOOTHER_NUDGE * self.known.force
        base = self.run(mean[:-1], every)[0][:, speed]
        up = mean[:-1].copy()
        up[:, -1] += pushed
        gain = (self.run(up, every)[0][:, speed] - base) / pushed
        gain = np.where(gain > HELD_BACK * np.max(gain), gain, np.inf)  # what sticks is moved by no force
        for name in mine:
            value = parameters[name].value
            nudge = SMOOTHER_NUDGE * (abs(value) or pushed)
            if self._scales(name, value + nudge):
                continue
            try:
                moved = self.run(mean[:-1], every, {name: value + nudge})[0][:, speed] - base
            except (ValueError, KeyError):  # taken out of the engine, or bound by another
                continue
            columns.append(moved / gain / nudge)
        return np.array(columns).reshape(len(columns), len(self)).T

    def _scales(self, name: str, value: float) -> bool:
        """Return whether this value of a parameter changes the force that a unit of the input makes."""
        block = self.simulator.block
        return force_scale(block) != force_scale(block.with_parameters({name: value}))

    def run(self, s: np.ndarray, step: np.ndarray, values=None) -> tuple[np.ndarray, np.ndarray]:
        """Run from states s (m, n) over the steps of these numbers (m,), with `values` of parameters.

        Returns
        -------
        (m, n - 1), (m, k) arrays
            States at the end, and outputs at `samples` of the steps, one after the other, each over its own
            noise; NaN where a step has fewer samples.
        """
        part, record = self.part, self.record
        runs = len(step)
        x0 = np.zeros((runs, part.engine.nstates))
        x0[:, self.free] = s[:, :-1]
        self._constrain(x0)
        begin, end = self.edges[step], self.edges[step + 1]
        for state, samples in part.lags:
            x0[:, state] = samples[begin]
        count = end - begin + 1
        first = np.concatenate(([0], np.cumsum(count)[:-1]))
        inside = np.arange(int(count.sum())) - np.repeat(first, count) + np.repeat(begin, count)
        every = record.t[inside] - self.late
        values = {self._name: s[:, -1].copy()} | {k: np.array([v]) for k, v in (values or {}).items()}
        groups = groups_of("a smoother", part.engine.system, values, runs)
        result = run_many(
            groups, x0, every[first], every[first + count - 1], every,
            sampled_drives(part.drive_time, part.drive_value[None, None], part.hold or record.input_hold),
            first=first, count=count, order=5, rtol=SMOOTHER_RTOL, max_steps=most_steps(count),
        )  # fmt: skip
        for error in result.errors.values():
            raise error
        measured = self.simulator.sensed
        outputs = np.full((len(measured.columns), runs, len(self.samples)), np.nan)
        for i, sample in enumerate(self.samples):
            has = count - 1 > sample
            for table, column, weight in zip(outputs, measured.columns, measured.weights, strict=True):
                table[has, i] = weight * result.outputs[first[has] + sample, column]
        return result.x[:, self.free], np.hstack(list(outputs))

    def _constrain(self, x):
        """Move states outside a gap or a stop to their border."""
        core = self.core
        if core.joint == IMPACT:
            deflection = np.clip(x[:, 2] - x[:, 0], 0.0, core.gap)
            if core.measured == 1:
                x[:, 0] = x[:, 2] - deflection
            else:
                x[:, 2] = x[:, 0] + deflection
        if core.stop is not None:
            low, high = core.stop.span
            for body in range(core.bodies):
                x[:, 2 * body] = np.clip(x[:, 2 * body], low, high)

    def linearized(self, mean: np.ndarray, cov: np.ndarray) -> Linearized:
        """Return the affine steps that are closest to the runs about Gaussian states (N + 1, n).

        By statistical linear regression over the 2 n points of the cubature of degree 3. Source:
        Garcia-Fernandez, Svensson, Morelande & Sarkka, IEEE Trans. Signal Process. 63 (2015) 5561.
        """
        steps, n = len(self), mean.shape[1]
        root = np.linalg.cholesky(cov[:-1]) * math.sqrt(n)
        offsets = np.concatenate([root, -root], axis=2).swapaxes(1, 2)  # (N, 2 n, n)
        points = mean[:-1, None, :] + offsets
        end, outputs = self.run(points.reshape(-1, n), np.repeat(np.arange(steps), 2 * n))
        end = end.reshape(steps, 2 * n, n - 1)
        outputs = outputs.reshape(steps, 2 * n, -1)
        inverse = np.linalg.inv(cov[:-1])
        a, b, q = _regressed(end, offsets, inverse, cov[:-1], mean[:-1])
        c, e, left = _regressed(outputs, offsets, inverse, cov[:-1], mean[:-1])
        return Linearized(a, b, q, c, e, np.maximum(np.diagonal(left, axis1=1, axis2=2), 0.0))


def _regressed(values, offsets, inverse, cov, mean):
    """Return slope, value at zero and covariance of what is left of values (N, 2 n, m) over points."""
    middle = values.mean(axis=1)
    beside = values - middle[:, None]
    cross = np.einsum("kpi,kpj->kij", beside, offsets) / values.shape[1]
    slope = cross @ inverse
    left = np.einsum("kpi,kpj->kij", beside, beside) / values.shape[1] - slope @ cov @ slope.swapaxes(1, 2)
    return slope, middle - np.einsum("kij,kj->ki", slope, mean), 0.5 * (left + left.swapaxes(1, 2))
