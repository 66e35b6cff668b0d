"""One period of an event-driven orbit and its linearization, saltation matrices included.

Between events the perturbation of a state is carried by the flow of the mode, differentiated here by central
differences (exact to rounding where the flow is linear). At an event it is carried by the saltation matrix
``S = R + (f+ - R f-) n^T / (n f-)`` with f the rates before and after, R the derivative of the reset (impact,
or the loss of a velocity to sticking) and n the gradient of the event's margin (Leine & Nijmeijer 2004, ch.
7). S loses rank where a body sticks, and is singular where the margin is grazed. An event whose margin stands
beyond zero as its segment begins is forced by the one before, at the same instant for all states nearby: the
two are one event, with the reset of both.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...simulate.engine import Drive, Engine, State, constant_drive
from ...simulate.kernel import driver
from ...simulate.kernel.evaluation import evaluate, jump
from ...simulate.kernel.run import reasons
from ...simulate.mode_flow import flow
from ...simulate.program import layout
from ...status import Status
from ...thresholds import NOTHING
from .thresholds import (
    COUPLED,
    EVENT_NUDGE,
    FLOW_NUDGE,
    FORCED,
    PERIOD_EVENTS,
    PERIOD_REACH,
    PERIOD_RTOL,
    PERIOD_STEPS,
    SLOPE_NUDGE,
)


@dataclass(frozen=True)
class Segment:
    """A segment in one mode: its start, its length, and the event that ends it."""

    start: State
    length: float
    event: str
    node: str


@dataclass(frozen=True)
class _Crossing:
    """An event that was crossed: the linearization up to it, and what its saltation is made of."""

    before: np.ndarray  # (n, n)
    reset: np.ndarray  # (n, n)
    rates: np.ndarray  # f-, (n,)
    normal: np.ndarray  # n / (n f-), (n,): minus the derivative of the time of the event; zeros: not crossed

    def linearized(self, rates) -> np.ndarray:
        """Return the linearization up to behind the event, where the rates (n,) are these."""
        return (self.reset + np.outer(rates - self.reset @ self.rates, self.normal)) @ self.before


@dataclass(frozen=True)
class PeriodTrace:
    """An orbit followed over one period: end state, linearization (n, n), the segments, total time."""

    end: State
    monodromy: np.ndarray
    segments: tuple[Segment, ...]
    status: Status
    reach: float  # [s] over which event margins look ahead
    grazing: float  # smallest |n f-| relative to |n||f-|: 0 at grazing


class Tracer:
    """Follows orbits of one engine and differentiates them."""

    def __init__(self, engine: Engine, drive: Drive | None = None, max_events: int = PERIOD_EVENTS):
        self.engine = engine
        self.drive = drive if drive is not None else constant_drive(np.zeros(engine.ninputs))
        self.max_events = max_events
        self.n = engine.nstates
        self._work, *_ = driver.workspace(engine.program)
        self._g = np.zeros(int(engine.program.ints[layout.H_NG]) + 1)
        self._none = np.zeros(0)

    def settle(self, state: State) -> State:
        """Return the state with its modes in line (no time passes)."""
        return self.engine.run(state, state.time, self.drive, rtol=PERIOD_RTOL).state

    def rate(self, t, x, mode) -> np.ndarray:
        """Rates of a state in a mode."""
        return self.rate_and_margins(t, x, mode, 0.0)[0]

    def rate_and_margins(self, t, x, mode, reach: float) -> tuple[np.ndarray, np.ndarray]:
        """Rates of a state in a mode, and its event margins, which look `reach` [s] ahead."""
        dx = np.zeros(self.n)
        evaluate(
            self.engine.program, self.drive, t, x, mode, self._work, dx, self._g, self._none, False, reach
        )
        return dx, self._g.copy()

    def trace(self, state: State, length: float, differentiate: bool = True, size=None) -> PeriodTrace:
        """Follow the orbit for `length` seconds from `state`."""
        t_end = state.time + length
        reach = PERIOD_REACH * length
        now = self.settle(state) if state.fresh else state.copy()
        phi = np.eye(self.n)
        segments, grazing, crossing = [], 1.0, None
        status = Status.CONVERGED
        size = self.sizes(now, length, np.abs(now.x)) if size is None else size
        while now.time < t_end:
            if len(segments) >= self.max_events:
                status = Status.WORK_LIMIT
                break
            run = self.engine.run(
                now, t_end, self.drive, rtol=PERIOD_RTOL, stop_at_event=True, log=2, max_steps=PERIOD_STEPS
            )
            if not run.status.ok:
                status = run.status
                break
            span = run.state.time - now.time
            if differentiate and span > 0:
                phi = self._flow_derivative(now, span, size) @ phi
            kind = node = ""
            if run.reason == reasons.EVENT:
                kind = layout.EVENT_KINDS[int(run.events[2][0])] if len(run.events[2]) else "event"
                node = self.engine.node_names[self._owner(run.margin)]
                if differentiate:
                    forced = crossing if span <= 0 else None
                    crossing, transversal = self._crossing(run, now.mode, size, reach, phi, forced)
                    grazing = float(min(grazing, transversal))
                    phi = crossing.linearized(self.rate(run.state.time, run.state.x, run.state.mode))
            segments.append(Segment(now, span, kind, node))
            now = run.state
        return PeriodTrace(now, phi, tuple(segments), status, reach, grazing)

    def sizes(self, state: State, length: float, largest) -> np.ndarray:
        """Sizes of the states on an orbit, none smaller than what the others could tell apart.

        A state that ought to be zero is rounding; its scale is what the other states move it by in a period.

        Parameters
        ----------
        state : State
            A point of the orbit.
        length : float
            Period [s].
        largest : (n,) array
            Largest absolute values met.
        """
        size = np.array(largest, float)
        here = self.rate(state.time, state.x, state.mode)
        slope = np.zeros((self.n, self.n))
        for j in np.flatnonzero(size):
            x = state.x.copy()
            x[j] += SLOPE_NUDGE * size[j]
            slope[:, j] = np.abs(self.rate(state.time, x, state.mode) - here) / SLOPE_NUDGE
        coupled = COUPLED * length * np.where(np.isfinite(slope), slope, 0.0).sum(axis=1)
        size = np.maximum(size, np.maximum(coupled, COUPLED * length * np.abs(here)))
        size[size == 0.0] = 1.0  # a state that is zero throughout may be measured by anything
        return size

    def _owner(self, margin):
        for i, node in enumerate(self.engine.program.nodes):
            if node[layout.G] <= margin < node[layout.G] + node[layout.NG]:
                return i
        return 0

    def _flow_derivative(self, state, span, size):
        h = np.diag(FLOW_NUDGE * size)
        ends = flow(self.engine, state, np.vstack([state.x + h, state.x - h]), span, self.drive, PERIOD_RTOL)
        return ((ends[: self.n] - ends[self.n :]) / (2 * FLOW_NUDGE * size)[:, None]).T

    def _crossing(self, run, mode, size, reach, phi, last: _Crossing | None) -> tuple[_Crossing, float]:
        """Return an event up to which the linearization is `phi`, and how transversal it is.

        `last`: the event at the same instant that led here, if one did.
        """

        def margin_at(t, x):
            return self.rate_and_margins(t, x, mode, reach)[1][run.margin]

        t, before = run.state.time, run.before
        f_minus = self.rate(t, before, mode)
        normal = np.zeros(self.n)
        for j in range(self.n):
            h = EVENT_NUDGE * size[j]
            values = []
            for sign in (1.0, -1.0):
                x = before.copy()
                x[j] += sign * h
                values.append(margin_at(t, x))
            normal[j] = (values[0] - values[1]) / (2 * h)
        reset, gradient = self._reset(run, mode, size, reach), float(np.linalg.norm(normal * size))
        if last is not None and margin_at(t, before) < -FORCED * gradient:
            return replace(last, reset=reset @ last.reset), 1.0
        # rate of the margin along the flow, its own dependence on time included
        h = EVENT_NUDGE / max(float(np.max(np.abs(f_minus) / size)), NOTHING)
        ahead = margin_at(t + h, before + h * f_minus)
        behind = margin_at(t - h, before - h * f_minus)
        speed = (ahead - behind) / (2 * h)
        scale = gradient * float(np.linalg.norm(f_minus / size))
        transversal = float(abs(speed)) / scale if scale > 0 else 0.0
        normal = normal / speed if speed != 0.0 else np.zeros(self.n)
        return _Crossing(phi, reset, f_minus, normal), transversal

    def _reset(self, run, mode, size, reach):
        """Differentiate the jump at the event, by differences of the engine's own event map."""
        columns = []
        for j in range(self.n):
            h = EVENT_NUDGE * size[j]
            ends = []
            for sign in (1.0, -1.0):
                x = run.before.copy()
                x[j] += sign * h
                ends.append(self._jump(run, mode, x, reach))
            columns.append((ends[0] - ends[1]) / (2 * h))
        return np.array(columns).T

    def _jump(self, run, mode, x, reach):
        program, mode = self.engine.program, mode.copy()
        node = self._owner(run.margin)
        x = x.copy()
        dx = np.zeros(self.n)
        slot = run.margin - int(program.nodes[node, layout.G])
        jump(program, self.drive, run.state.time, x, mode, self._work, dx, self._g, node, slot, reach)
        return x
