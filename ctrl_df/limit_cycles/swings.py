"""A loop simulated from kicks of many sizes, swing by swing: the search for cycles without a guess."""

from __future__ import annotations

from typing import Any, NamedTuple

import control as ct
import numpy as np

from ..blocks.core import level
from ..blocks.element import Element
from ..simulate import driver
from ..simulate.engine import Engine, State
from ..simulate.layout import DELAY, H_OUT, KIND, X
from ..simulate.sampled import Sampled

_WORK = 300_000  # integration steps of one simulation
_FEW = 12  # swings within that work, below which it is no use
_QUIET = 40  # strides without a passage after which a loop is called at rest
_DEAD = 1e-9  # of the largest state met, below which a loop without passages is at rest
_SAMPLES = 1024  # in a stride, where passages are looked for among samples
_GONE = 1e4  # times the largest kick: a loop beyond it has run away


class Lap(NamedTuple):
    """An upward passage of the signal watched: when, in which state, and the largest state there."""

    time: float
    state: np.ndarray
    peak: float


class Swings:
    """Simulations of one loop from starts of its own choice.

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
        self.held = by_input and bool(
            getattr(self.parts, "dt", 0)
        )  # a held input steps: no passage to locate
        ints = engine.program.ints
        self._signal = int(ints[ints[ints[H_OUT] + self.row] + 1])
        self.kicks = list(self._kicks())
        self._farthest = _GONE * max(float(np.max(np.abs(x), initial=0.0)) for x in self.kicks)

    def follow(
        self, start, count: int, longest: float | None = None, until_repeated: bool = True
    ) -> list[Lap]:
        """Upward passages from a start on, until they repeat, the loop rests, or the bound on work is hit.

        Parameters
        ----------
        start : ndarray or State
            State of the loop; a `State` goes on with the history of its delays.
        count : int
            Passages at most.
        longest : float, optional
            Simulated time at most [s].
        until_repeated : bool
            End as soon as the passages repeat.

        Returns
        -------
        list of Lap
            Empty if the loop runs away, or spends all its work within a few swings.
        """
        state = start if isinstance(start, State) else self.start(start)
        laps, quiet, work, largest = [], 0, 0, float(np.max(np.abs(state.x), initial=0.0))
        limit = np.inf if longest is None else longest
        bound = max(self._farthest, _GONE * float(np.max(np.abs(state.x), initial=0.0)))
        stride = self._by_samples if self.held else self._by_passage
        while len(laps) < count and state.time < limit and quiet <= _QUIET and work <= _WORK:
            run, found = stride(state, laps, limit)
            state, work = run.state, work + run.steps
            if not run.status.ok or not np.max(np.abs(state.x)) < bound:
                return []
            laps += found
            quiet = 0 if found else quiet + 1
            size = float(np.max(np.abs(state.x), initial=0.0))
            largest = max(largest, size)
            if quiet and size < _DEAD * largest:
                break
            if until_repeated and len(laps) > 12 and repeats(laps, self.tight):
                break
        if work > _WORK and len(laps) < _FEW:
            return []  # it creeps or chatters, thousands of steps a swing: no orbit that could be refined
        return laps

    def start(self, x0) -> State:
        """Return a fresh state; what the engine does not move (lags that stand for delays elsewhere) is 0."""
        state = self.engine.start(x0)
        for node in self.engine.program.nodes:
            if node[KIND] == DELAY:
                state.x[node[X]] = 0.0
        return state

    def _by_passage(self, state, laps, limit):
        # ahead in bounded strides: a loop at rest never crosses again
        ahead = 4 * (laps[-1].time - laps[-2].time) if len(laps) >= 2 else self._time_scale()
        run = self.engine.run(
            state, min(state.time + ahead, limit), rtol=1e-8, watch=self._signal, direction=1, log=1,
            max_steps=400_000,
        )  # fmt: skip
        after = run.state
        return run, [_lap(after.time, after.x)] if run.reason == driver.SECTION else []

    def _by_samples(self, state, laps, limit):
        """Passages between the samples of a held signal, looked at between the ticks."""
        dt = self.parts.dt
        times = (round(state.time / dt) + 0.5 + np.arange(_SAMPLES)) * dt
        times = times[times <= max(limit, times[1])]
        run = self.engine.run(state, times[-1], times=times, rtol=1e-8, log=1, max_steps=400_000)
        y = run.outputs[:, self.row]
        ups = np.flatnonzero((y[:-1] < 0) & (y[1:] >= 0))
        passing = times[ups] - y[ups] * dt / (y[ups + 1] - y[ups])
        return run, [_lap(t, x) for t, x in zip(passing, run.states[ups + 1], strict=True)]

    def _time_scale(self) -> float:
        """Return a time within which the loop moves: ten over its fastest plausible rate."""
        if self.parts is not None:
            omega = _corner_frequency(self.parts)
            if omega:
                return 20 * np.pi / omega
            controller = self.loop.syslist[0]
            if isinstance(controller, ct.StateSpace) and controller.nstates:
                fastest = float(np.max(np.abs(controller.poles())))
                if fastest > 0:
                    return 40 * np.pi / fastest
        return 10.0

    # --- starts ---------------------------------------------------------------------------------------------

    def _kicks(self):
        """Displaced starts at rest, from far below to far above the scale of the block's nonlinearity."""
        block = self.parts.block if self.parts is not None else None
        core = getattr(block, "core", None)
        if core is None:
            size = self._state_size(block)
            for factor in (1.0, 0.1, 10.0, 0.01):
                yield factor * size * np.ones(self.engine.nstates)
            return
        offset = self.loop.syslist[0].nstates or 0
        scale = _length_scale(core, self.parts)
        pace = _corner_frequency(self.parts) or 1.0
        # nothing drives a loop closed on the velocity back to a place
        by_speed = self.loop.output_labels[0].startswith("v")
        for factor in (0.3, 1.0, 0.1, 3.0, 0.03, 10.0):
            x = np.zeros(self.engine.nstates)
            x[offset] = factor * scale
            if core.bodies == 2:
                x[offset + 2] = factor * scale + 0.5 * core.gap
            if by_speed:
                x[offset + 1 : offset + 2 * core.bodies : 2] = factor * scale * pace
            if core.stop is not None:
                low, high = core.stop.span
                places = slice(offset, offset + 2 * core.bodies, 2)
                x[places] = np.clip(x[places], 0.9 * low, 0.9 * high)
            yield x

    def _state_size(self, block) -> float:
        """Size of the controller's states that bring the input of an element to its corners.

        States of canonical forms may be millions of times their output.
        """
        controller = None if block is None else self.loop.syslist[0]
        c = controller.sampled[2] if isinstance(controller, Sampled) else getattr(controller, "C", None)
        gain = 0.0 if c is None else float(np.abs(np.asarray(c)).sum())
        law = getattr(block, "primitive", None)
        corners = [abs(corner) for corner in getattr(law, "corners", ())]
        size = max([*corners, getattr(law, "step", 0.0), getattr(law, "gap", 0.0)])
        return (size or 1.0) / (gain or 1.0)


def _lap(time, x) -> Lap:
    return Lap(float(time), np.array(x), float(np.max(np.abs(x))))


def repeats(laps, tight=False) -> bool:
    """Whether the last two passages met the same state; `tight`: near enough to be the answer."""
    size = np.max(np.abs([lap.state for lap in laps[-6:]]), axis=0)
    largest = float(np.max(size)) + 1e-300
    bound = 1e-9 * np.maximum(size, 1e-6 * largest) if tight else 1e-7 * largest
    return bool(np.all(np.abs(laps[-1].state - laps[-2].state) < bound))


def _corner_frequency(parts):
    """Frequency at which the controller balances the block's inertia, |H(jw)| = m w^2 [rad/s].

    A loop closed on the velocity has its corner elsewhere, for which this serves as well as a scale.
    """
    core = getattr(parts.block, "core", None)
    if core is None or not callable(parts.controller):
        return None
    omega = np.geomspace(1e-2, 1e4, 400)
    dt = getattr(parts.controller, "dt", 0)
    s = 1j * omega if not dt else np.exp(1j * omega * float(dt))
    gain = np.abs(np.asarray(parts.controller(s)).ravel())
    above = gain > sum(core.masses) * omega**2
    return float(omega[np.flatnonzero(above)[-1]]) if above.any() else float(omega[0])


def _length_scale(core, parts) -> float:
    """Displacement at which the block's nonlinearity matters [m]."""
    stiffness = sum(core.masses) * (_corner_frequency(parts) or 1.0) ** 2
    scales = [core.gap, sum(level(chain, 0.0, 1.0, 0.0) for chain in core.friction) / stiffness]
    for element, _ in core.input_channel:
        scales += [abs(c) / stiffness for c in getattr(element, "corners", ())]
        scales.append(getattr(element, "step", 0.0))
    scales += [getattr(element, "step", 0.0) for element, _ in core.output_channel]
    if core.stop is not None:
        scales.append(0.5 * (core.stop.span[1] - core.stop.span[0]))
    return max(scales) if max(scales) > 0 else 1e-3
