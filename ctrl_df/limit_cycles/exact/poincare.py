"""What becomes of a start: the loop simulated from crossing to crossing of a Poincaré section."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from ...blocks.elements.element import Element
from ...cached import cached_property
from ...simulate.engine import Engine, State
from ...simulate.program.layout import DELAY, H_OUT, KIND, X
from ...simulate.section import intervals
from ...simulate.thresholds import INTERVAL_STEPS, PEAK_SAMPLES, TICK
from ...status import Status
from ...thresholds import NOTHING
from ..thresholds import RECENT_CLOSED
from .starts import Starts
from .thresholds import (
    BEYOND,
    DEAD,
    DIVERGED_SIZE,
    FAINT,
    GROWTH_EVEN,
    INTERVAL_SAMPLES,
    LONGEST_INTERVAL,
    LOOK,
    LOOK_RTOL,
    LOOK_WORK,
    QUIET,
    QUIET_LONG,
    RECENT,
    REPEATS,
    REPEATS_EXACTLY,
    REPEATS_LEAST,
    SIZED,
    STEADY,
    STEPS,
    STRAIGHT_WITHIN,
    SUSTAINED_DECAY,
    SUSTAINED_GROWTH,
    TENFOLD,
    TRAJECTORY_RTOL,
    WORK,
)

RESTS, CYCLES, DIVERGES, UNDECIDED = "rests", "cycles", "diverges", "undecided"


class Crossing(NamedTuple):
    """A crossing of the section, where the signal watched passes zero upwards; its peak since the last."""

    time: float
    state: np.ndarray
    peak: float


@dataclass
class Trajectory:
    """What became of one start.

    Attributes
    ----------
    crossings : list of Crossing
    fate : str
        ``rests``, ``cycles`` (the crossings repeat), ``diverges``, or ``undecided`` within the bound on work.
    growth : float
        Change of the peaks over the second half, a ratio; nan with too few of them.
    end : ndarray
        State in which it ended.
    """

    crossings: list[Crossing]
    fate: str
    growth: float
    end: np.ndarray


class _Interval(NamedTuple):
    """Up to the next crossing, or some samples: the end, the steps, how it ended, the crossings in it."""

    time: float
    x: np.ndarray
    steps: int
    status: Status
    found: list[Crossing]


class PoincareSearch:
    """Simulations of one loop as iterations of its Poincaré map.

    The signal watched is the loop's first output; where the block is an element, whose output may jump or
    rest, it is the block's input.

    Parameters
    ----------
    loop : ct.NonlinearIOSystem
        From `closed_loop`, or an interconnection of one's own.
    engine : Engine
        Of that loop.
    """

    def __init__(self, loop, engine: Engine):
        self.loop, self.engine = loop, engine
        self.parts: Any = getattr(loop, "parts", None)
        block = None if self.parts is None else self.parts.block
        by_input = isinstance(block, Element) or (block is not None and not block.nstates)
        self.row = engine.noutputs - 1 if by_input else 0
        self.tight = engine.delayed  # no Newton follows
        self.sampled_input = by_input and bool(
            getattr(self.parts, "dt", 0)
        )  # a held input steps: no crossing to locate
        ints = engine.program.ints
        self._signal = int(ints[ints[ints[H_OUT] + self.row] + 1])
        self.starts = Starts(loop, engine)
        self.longest = LONGEST_INTERVAL * np.pi / self.starts.omega  # ten periods at the loop's own frequency

    @property
    def units(self) -> np.ndarray:
        """Unit of each state: the largest value in the first period from the largest start."""
        return self._first_period[0]

    @property
    def _unit(self) -> float:
        """What the signal watched is measured in, likewise."""
        return self._first_period[1]

    @cached_property
    def _first_period(self) -> tuple[np.ndarray, float]:
        x0 = self.starts.all()[-1][1]
        times = np.linspace(0.0, LOOK * self.longest, PEAK_SAMPLES)
        limits: Any = dict(rtol=LOOK_RTOL, log=1, max_steps=LOOK_WORK)
        run = self.engine.run(self.start(x0), times[-1], times=times, **limits)

        def largest(values):
            seen = np.abs(values[: max(run.recorded, 1)])
            return np.where(np.isfinite(seen), seen, 0.0).max(axis=0)

        states, peak = largest(run.states), float(largest(run.outputs)[self.row])
        units = np.where(states > 0, states, max(float(states.max(initial=0.0)), NOTHING))
        return units, peak if peak > 0 else 1.0

    def size(self, x) -> float:
        """Largest state in units of the loop."""
        return float((np.abs(x) / self.units).max(initial=0.0))

    def iterate(
        self,
        start,
        count: int,
        longest: float | None = None,
        until_repeated: bool = True,
        decided: Callable[[list[Crossing]], str] | None = None,
    ) -> Trajectory:
        """Crossings from a start on, until they repeat, the loop rests, or the bound on work is hit.

        Parameters
        ----------
        start : ndarray or State
            State of the loop; a `State` goes on with the history of its delays.
        count : int
            Crossings at most.
        longest : float, optional
            Simulated time at most [s].
        until_repeated : bool
            End as soon as the crossings repeat.
        decided : callable, optional
            Asked after every crossing for the fate of the crossings so far; empty: not yet known.

        Returns
        -------
        Trajectory
            Without crossings if all work is spent within a few periods.
        """
        state = start if isinstance(start, State) else self.start(start)
        crossings: list[Crossing] = []
        quiet, work, largest, highest = 0, 0, self.size(state.x), 0.0
        limit = np.inf if longest is None else longest
        bound = DIVERGED_SIZE * max(1.0, largest)
        intervals = self._by_samples(state, limit) if self.sampled_input else self._by_crossing(state, limit)
        fate, stopped, time, end = "", False, state.time, state.x
        while len(crossings) < count and time < limit and quiet <= QUIET_LONG and work <= WORK:
            run = next(intervals)
            if quiet > QUIET and self.size(run.x - end) < DEAD * largest:
                break
            time, end, work = run.time, run.x, work + run.steps
            if run.status is Status.DIVERGED or not self.size(end) < bound:
                return Trajectory(crossings, DIVERGES, np.inf, end)
            if not run.status.ok:
                stopped = True  # by its bound on work, or a motion that no step resolves: no fate
                break
            found = run.found
            crossings += found
            quiet = 0 if found else quiet + 1
            highest = max([highest, *(c.peak for c in found)])
            if found and crossings[-1].peak < FAINT * highest:
                fate = RESTS
                break
            size = self.size(end)
            largest = max(largest, size)
            if quiet and size < DEAD * largest:
                fate = RESTS
                break
            if found and crossings[-1].peak > BEYOND and _explodes(crossings):
                return Trajectory(crossings, DIVERGES, np.inf, end)
            if found and (_creeps(crossings) or self._fades(crossings)):
                fate = RESTS
                break
            if found and decided is not None:
                fate = decided(crossings)
                if fate:
                    break
            if until_repeated and len(crossings) > RECENT_CLOSED and self.repeats(crossings):
                fate = CYCLES if crossings[-1].peak > FAINT * max(c.peak for c in crossings) else RESTS
                break
        growth = _growth(crossings)
        if not fate:
            fate = RESTS if quiet > QUIET else UNDECIDED if stopped else _tendency(crossings)
        if (stopped or work > WORK) and len(crossings) < RECENT_CLOSED:
            crossings = []  # it creeps or chatters, thousands of steps a crossing: no orbit to refine
        return Trajectory(crossings, fate, growth, end)

    def start(self, x0) -> State:
        """Return a fresh state; what the engine does not move (lags that stand for delays elsewhere) is 0."""
        state = self.engine.start(x0)
        for node in self.engine.program.nodes:
            if node[KIND] == DELAY:
                state.x[node[X]] = 0.0
        return state

    def _fades(self, crossings) -> bool:
        """Whether the oscillation shrinks by a steady ratio where the block is linear: so it goes on."""
        if not max(c.peak for c in crossings[-STEPS:]) * self._unit < STRAIGHT_WITHIN * self.starts.straight:
            return False
        return _endless_of(crossings, _smallness, 1 / FAINT) > 0

    def repeats(self, crossings) -> bool:
        """Whether the last two crossings met the same state; closer if no Newton follows."""
        sizes = np.abs(np.array([c.state for c in crossings[-SIZED:]])).max(axis=0)
        largest = max(float((sizes / self.units).max()), NOTHING)
        bound = (
            REPEATS_EXACTLY * np.maximum(sizes, REPEATS_LEAST * largest * self.units)
            if self.tight
            else REPEATS * largest * self.units
        )
        return bool((np.abs(crossings[-1].state - crossings[-2].state) < bound).all())

    def _by_crossing(self, state, limit):
        # ahead in bounded intervals: a loop at rest never crosses again
        for s in intervals(self.engine, state, self._signal, self.row, self.longest, limit, TRAJECTORY_RTOL):
            found = [Crossing(s.time, s.x, s.peak / self._unit)] if s.crossed else []
            yield _Interval(s.time, s.x, s.steps, s.status, found)

    def _by_samples(self, state, limit):
        """Crossings between the samples of a held signal, looked at between the ticks."""
        dt = self.parts.dt
        while True:
            # from the sample before on, where the last interval ended: no crossing is lost between two
            first = np.ceil(state.time / dt - 0.5 - TICK)
            times = np.maximum((first + 0.5 + np.arange(INTERVAL_SAMPLES)) * dt, state.time)
            times = times[times <= max(limit, times[1])]
            run = self.engine.run(
                state, times[-1], times=times, rtol=TRAJECTORY_RTOL, log=1, max_steps=INTERVAL_STEPS
            )
            y = run.outputs[:, self.row]
            ups = upward_crossings(y)
            passing = times[ups] - y[ups] * dt / (y[ups + 1] - y[ups])
            found = []
            for k, (t, x) in enumerate(zip(passing, run.states[ups + 1], strict=True)):
                between = np.abs(y[ups[k - 1] if k else 0 : ups[k] + 1])
                found.append(
                    Crossing(float(t), np.array(x), float(np.max(between, initial=0.0)) / self._unit)
                )
            state = run.state
            yield _Interval(state.time, state.x, run.steps, run.status, found)


def upward_crossings(y) -> np.ndarray:
    """Return the samples after which a signal passes zero upwards."""
    return np.flatnonzero((y[:-1] < 0) & (y[1:] >= 0))


def _growth(crossings, ago: int = 0) -> float:
    """Mean peak in the last quarter over that in the quarter before; or earlier by `ago`."""
    quarter = len(crossings) // 4
    if quarter < 2:
        return float("nan")
    peaks = np.array([c.peak for c in crossings])[: len(crossings) - ago * quarter]
    before = np.mean(peaks[-2 * quarter : -quarter])
    return float(np.mean(peaks[-quarter:]) / before) if before > 0 else float("nan")


def _peaks(crossings) -> list[float]:
    return [c.peak for c in crossings]


def _smallness(crossings) -> list[float]:
    return [1 / max(c.peak, NOTHING) for c in crossings]


def _durations(crossings) -> list[float]:
    return [after.time - before.time for before, after in pairwise(crossings)]


def _endless_of(crossings, values: Callable[[list[Crossing]], list[float]], factor: float) -> int:
    """Return `_endless` of what is known of the last crossings; steady growths are two at least."""
    rises = [after > before for before, after in pairwise(values(crossings[-STEPS - 1 :]))]
    if len(rises) < 2 or not all(rises[-2:]):
        return 0
    return _endless(values(crossings[-RECENT:]), factor)


def _endless(values, factor: float) -> int:
    """How many of the last values grow so steadily that they will by `factor` at least; 0 if they do not.

    Growths (logarithmic) that differ by no more than a share e over n of them may at worst be falling off
    geometrically, by ``1 - e / (n - 1)`` each; what is then still to come sums to ``(n - 1) / e`` times the
    last one. A growth towards a limit less than `factor` away is told from one without.
    """
    growths = np.diff(np.log(np.maximum(values, NOTHING)))[::-1]
    high = np.maximum.accumulate(growths)
    low = np.minimum.accumulate(growths)
    count = np.arange(1, growths.size + 1)
    enough = (
        (low > (1 - GROWTH_EVEN) * high)
        & ((count >= STEPS) | ((count > 1) & (low > TENFOLD)))
        & ((count - 1) * low > GROWTH_EVEN * np.log(factor))
    )
    return int(count[enough][0]) + 1 if enough.any() else 0


def _explodes(crossings) -> bool:
    """Whether the oscillation grows at a steady ratio and without bound."""
    return _endless_of(crossings, _peaks, DIVERGED_SIZE) > 0


def _creeps(crossings) -> bool:
    """Whether every period takes longer than the one before by a steady ratio, while none is larger.

    So a motion ends whose speed falls by a ratio each time it crosses a gap: its position never settles, its
    speed does.
    """
    count = _endless_of(crossings, _durations, 1 / FAINT)
    if not count:
        return False
    recent = crossings[-RECENT:]
    durations = np.array(_durations(recent))
    slowing = np.log(durations[-1] / durations[-count])
    growth = np.log(max(recent[-1].peak, NOTHING) / max(recent[-count].peak, NOTHING))
    return bool(growth < GROWTH_EVEN * slowing)


def _tendency(crossings) -> str:
    """Fate of oscillations that grow or shrink without end: by a steady ratio, not towards some size."""
    now, earlier = _growth(crossings), _growth(crossings, 1)
    if not now > 0 or not earlier > 0 or max(now, 1 / now) < STEADY:
        return UNDECIDED
    sustained = np.log(now) / np.log(earlier) if earlier != 1.0 else 0.0
    if now > 1.0:
        return DIVERGES if sustained > SUSTAINED_GROWTH else UNDECIDED
    return RESTS if sustained > SUSTAINED_DECAY else UNDECIDED
