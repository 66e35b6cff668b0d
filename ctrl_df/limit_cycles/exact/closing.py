"""An exact orbit from a state near it: Newton on the event-located flow, with Floquet multipliers."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...simulate.engine import Engine, Event
from ...simulate.program.layout import AUX, KIND, MECHANISM, MODE
from ...status import Status
from ...thresholds import NEWTON_FAR, NOTHING, ROUNDED
from .monodromy import Tracer
from .multiple_shooting import close_pieces
from .orbit import Orbit
from .shift_invariance import shift_directions, transverse
from .thresholds import (
    ACCEPTED,
    CLOSED,
    FREE_POINTS,
    MOST_ROUNDS,
    NEWTON_LONGEST,
    ON_CIRCLE,
    ORBIT_POINTS,
    PERIOD_CHANGE,
    PERIOD_RTOL,
    REPEATED,
    STALLED,
    STALLS,
    STEPS_A_PERIOD,
    STILL,
    TRAJECTORY_RTOL,
)


class NoClosure(Exception):
    """No orbit was closed: the message says why, `mismatch` how near it came."""

    def __init__(self, why: str, mismatch: float = np.inf):
        super().__init__(why)
        self.mismatch = mismatch


class Centre(NoClosure):
    """Motions of every size repeat: a multiplier 1 beside that of a shift in time."""


class Closing:
    """Closes orbits of one loop.

    Parameters
    ----------
    loop : ct.NonlinearIOSystem
    engine : Engine
        Of that loop, without pure delays.
    max_iterations : int
        Bound on Newton steps.
    """

    def __init__(self, loop, engine: Engine, max_iterations: int = NEWTON_FAR):
        self.loop, self.engine, self.max_iterations = loop, engine, max_iterations
        self.tracer = Tracer(engine)
        self.parts: Any = getattr(loop, "parts", None)

    def close(self, x0, period: float, stay: bool = False) -> Orbit:
        """Newton from a state near the orbit and an estimate of the period; NoClosure if it fails.

        With `stay` from that very state: it is so near that moving along the orbit would spoil it.
        """
        start, size = self.free_state(np.array(x0, float), period, stay)
        status, best, grown, first = Status.NOT_CONVERGED, np.inf, 0, period
        traced = beside = None
        for _ in range(self.max_iterations):
            traced = self.tracer.trace(start, period, size=size)
            if not traced.status.ok or not np.all(np.isfinite(traced.monodromy)):
                raise NoClosure(_not_traced(traced))
            if beside is None:
                # shifts that the loop does not notice: an orbit closes up to them
                free = shift_directions(self.tracer, traced, size)
                beside = np.eye(self.tracer.n) - free @ free.T
            residual = beside @ ((traced.end.x - start.x) / size)
            mismatch = float(np.max(np.abs(residual)))
            if mismatch < CLOSED:
                status, best = Status.CONVERGED, mismatch
                break
            if mismatch > STALLED * best:
                grown += 1
                if grown > STALLS:
                    break
            best = min(best, mismatch)
            step = self._newton(start, traced, period, size, beside, residual)
            period += step[-1]
            if not first / PERIOD_CHANGE < period < first * PERIOD_CHANGE:
                raise NoClosure("Newton's method went to another period", best)
            start = self.rebuilt(start.x + step[:-1])
        if traced is None or self._at_rest(start, traced, period, size):
            raise NoClosure("Newton ended at rest")
        if status is not Status.CONVERGED and best > ACCEPTED:
            raise NoClosure(f"Newton's method left a mismatch of {best:.1g} of the orbit's size", best)
        traced, period = self._single(start, period, traced, size, beside)
        return self._finished(start, period, traced, size)

    def close_along(self, states, period: float) -> Orbit:
        """Close an orbit from states at equal steps of time along it, by multiple shooting."""
        largest = np.abs(states).max(axis=0)
        size = self.tracer.sizes(self.rebuilt(states[0]), period, largest)
        met = close_pieces(self.tracer, self.rebuilt, np.asarray(states, float), period, size)
        if met is None:
            raise NoClosure("the pieces of multiple shooting do not meet")
        return self.close(*met)

    def _newton(self, start, traced, period, size, beside, residual):
        """Step of state and period, bounded to three tenths of the orbit's size."""
        n = self.tracer.n
        f_end = self.tracer.rate(traced.end.time, traced.end.x, traced.end.mode)
        f_start = self.tracer.rate(start.time, start.x, start.mode)
        system = np.zeros((n + 1, n + 1))
        scale = np.append(size, period)
        # in units of the orbit: states by their sizes, time by the period
        system[:n, :n] = traced.monodromy * size / size[:, None] - np.eye(n)
        system[:n, n] = f_end * period / size
        system[n, :n] = f_start * period / size
        system[:n] = beside @ system[:n]
        change = np.linalg.lstsq(system, -np.append(residual, 0.0), rcond=ROUNDED)[0]
        shorten = min(1.0, NEWTON_LONGEST / max(float(np.max(np.abs(change))), NOTHING))
        return shorten * change * scale

    def _single(self, start, period, traced, size, beside):
        """Return trace and period of an orbit that may have been closed after going round several times."""
        parts = np.arange(MOST_ROUNDS, 1, -1)
        run = self.engine.run(start, period, times=np.sort(period / parts), rtol=PERIOD_RTOL, log=1)
        mismatch = np.max(np.abs(((run.states - start.x) / size) @ beside.T), axis=1)
        for k in np.argsort(period / parts):  # the shortest first
            part = int(parts[k])
            if mismatch[k] < REPEATED * ACCEPTED:
                short = self.tracer.trace(start, period / part, size=size)
                if np.max(np.abs(beside @ ((short.end.x - start.x) / size))) < REPEATED * ACCEPTED:
                    return short, period / part
        return traced, period

    def free_state(self, x0, period, stay=False) -> tuple[Any, Any]:
        """Move along the orbit to the middle of its longest interval free of sticking and contact."""
        state = self.engine.start(x0)
        traced = self.tracer.trace(state, period, differentiate=False)
        if not traced.status.ok or not traced.segments:
            raise NoClosure(_not_traced(traced))
        times = np.linspace(0, period, FREE_POINTS)[1:]
        run = self.engine.run(self.engine.start(x0), period, times=times, rtol=TRAJECTORY_RTOL, log=1)
        largest = np.max(np.abs([s.start.x for s in traced.segments] + [traced.end.x]), axis=0)
        largest = np.maximum(largest, np.nanmax(np.abs(run.states), axis=0))
        if stay:
            begin = traced.segments[0].start
            return begin, self.tracer.sizes(begin, period, largest)
        constraints = [self._constraints(s.start.mode) for s in traced.segments]
        least = min(constraints)
        length, k = max((s.length, i) for i, s in enumerate(traced.segments) if constraints[i] == least)
        begin = traced.segments[k].start
        size = self.tracer.sizes(begin, period, largest)
        until = begin.time + 0.5 * length
        middle = self.engine.run(begin, until, rtol=PERIOD_RTOL, locate=False, log=1).state
        middle.time, middle.mode = 0.0, begin.mode.copy()
        middle.fresh = True
        return self.tracer.settle(middle), size

    def _constraints(self, mode):
        """Count the constraints active in a mode: stuck bodies, closed impact joints, walls."""
        count = 0
        program = self.engine.program
        for node in program.nodes:
            if node[KIND] == MECHANISM:
                m = mode[node[MODE] : node[MODE] + 4]
                bodies = program.ints[node[AUX]]
                count += (
                    int(m[0] == 0) + (int(m[1] == 0) if bodies == 2 else 0) + int(m[2] != 0) + int(m[3] != 0)
                )
        return count

    def _at_rest(self, start, traced, period, size):
        """Whether Newton ended on an equilibrium, which is periodic with any period."""
        speed = np.abs(self.tracer.rate(start.time, start.x, start.mode)) * period
        moved = np.max([np.abs(s.start.x - start.x) for s in traced.segments], axis=0)
        return bool(np.max(speed / size) < STILL) and bool(np.max(moved / size) < STILL)

    def rebuilt(self, x):
        """Return a state in freshly settled modes: rigid joints closed, within gaps and stops."""
        state = self.tracer.settle(self.engine.start(self.feasible(x)))
        if not np.all(np.isfinite(state.x)):
            raise NoClosure("Newton's method diverged")
        return state

    def feasible(self, x):
        """Return the nearest state with rigid joints closed, within gaps and stops."""
        core = getattr(self.parts.block, "core", None) if self.parts is not None else None
        x = np.array(x, dtype=float)
        if core is None:
            return x
        o = self.loop.syslist[0].nstates or 0
        if core.stop is not None:
            at = o + 2 * core.driven
            x[at] = np.clip(x[at], *core.stop.span)
        if core.joint == "rigid":
            x[o : o + 2] = x[o + 2 : o + 4]
        elif core.joint == "impact":
            x[o + 2] = x[o] + np.clip(x[o + 2] - x[o], 0.0, core.gap)
        return x

    def _finished(self, start, period, traced, size) -> Orbit:
        times = np.linspace(0.0, period, ORBIT_POINTS)
        omega = 2 * np.pi / period
        spectrum = np.zeros((self.engine.noutputs, 2), complex)
        run = self.engine.run(
            start,
            period,
            times=times,
            rtol=PERIOD_RTOL,
            spectrum=spectrum,
            omega=omega,
            max_step=period / STEPS_A_PERIOD,
        )
        if np.max(np.ptp(run.states, axis=0) / size) < STILL:
            raise NoClosure("Newton ended at rest")  # an equilibrium, periodic with any period
        # multipliers of what the loop notices: neither those of a free position nor of states nothing reads
        across = transverse(shift_directions(self.tracer, traced, size))
        carried = across.T @ (traced.monodromy * size / size[:, None]) @ across
        values = np.linalg.eigvals(carried)
        trivial = int(np.argmin(np.abs(values - 1.0)))
        floquet = np.delete(values, trivial)
        floquet = floquet[np.argsort(-np.abs(floquet))]
        if np.any(np.abs(floquet - 1.0) < ON_CIRCLE):
            raise Centre("motions of every size repeat (a centre)")
        outside = np.abs(floquet) - 1.0
        stable = None if np.any(np.abs(outside) < ON_CIRCLE) else bool(np.all(outside < 0.0))
        residual = float(np.max(np.abs(across.T @ ((traced.end.x - start.x) / size)), initial=0.0))
        events, t = [], 0.0
        for s in traced.segments:
            t += s.length
            if s.event:
                events.append(Event(t, s.node, s.event))
        amplitudes = 2 * np.abs(spectrum[:, 1]) / period
        return Orbit(
            float(omega), float(period), float(amplitudes[-1]), float(amplitudes[0]), floquet, stable,
            residual, tuple(events), Status.CONVERGED, traced.grazing, times, run.outputs.T, run.states.T,
            self.loop,
        )  # fmt: skip


def _not_traced(traced) -> str:
    return f"no period could be followed ({traced.status.name.lower().replace('_', ' ')})"
