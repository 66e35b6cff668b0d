"""Exact limit cycles: Newton on the event-located flow, with Floquet multipliers."""

from __future__ import annotations

from typing import Any

import control as ct
import numpy as np

from ..df.describing import describing_function
from ..simulate.engine import Engine, Event, State
from ..simulate.layout import AUX, KIND, MECHANISM, MODE, NX, X
from ..status import Status
from .forced_start import harmonic_start
from .monodromy import RTOL, Tracer
from .orbit import Orbit
from .swings import Swings

_STILL = 1e-6  # swing, relative to the motion that Newton started from, below which there is no orbit


def find_limit_cycle(
    loop, guess=None, *, max_iterations=40, search_time=None, raise_on_failure=False, **keywords
):
    """Find an exact periodic orbit of an autonomous loop (input r = 0).

    Parameters
    ----------
    loop : ct.InterconnectedSystem
        From `closed_loop`, or any interconnection that `event_response` runs; with loops of one's own the
        first output is taken as the output and the last one as the block's input.
    guess : LimitCycle, Orbit, (amplitude, omega), state array, or None
        Where to start. A prediction starts from the block's forced motion at its amplitude and frequency;
        None searches from simulations of several sizes and returns the first orbit found, stable ones first.
    max_iterations : int
        Bound on Newton steps.
    search_time : float
        Longest simulation of the search [s]; by default some hundred swings.
    raise_on_failure : bool
        Raise RuntimeError (with the best estimate as ``.orbit``) instead of returning an orbit whose status
        says why.

    Returns
    -------
    Orbit or None
        None if no orbit was found at all. Otherwise look at ``status`` and ``residual``.
    """
    if keywords:
        raise TypeError(f"unrecognized keyword(s): {', '.join(keywords)}")
    finder = OrbitFinder(loop, max_iterations)
    if guess is None:
        found = finder.search(search_time)
        orbit = next(iter(sorted(found, key=lambda o: o.stable is not True)), None)
    else:
        orbit = finder.from_guess(guess)
    if raise_on_failure and (orbit is None or not orbit.status.ok):
        error = RuntimeError(str(orbit.status if orbit else Status.NOT_CONVERGED))
        error.orbit = orbit  # type: ignore[attr-defined]
        raise error
    return orbit


class OrbitFinder:
    """Shooting for the limit cycles of one loop."""

    def __init__(self, loop, max_iterations=40):
        if not isinstance(loop, ct.NonlinearIOSystem):
            raise TypeError(
                f"find_limit_cycle needs a loop, e.g. closed_loop(pid, block); got {type(loop).__name__}."
            )
        self.loop: Any = loop
        self.engine = Engine(loop)
        self.tracer = Tracer(self.engine)
        self.max_iterations = max_iterations
        self.parts: Any = getattr(loop, "parts", None)
        self.sampled = bool(getattr(self.parts, "dt", 0))
        self.force_row = self.engine.noutputs - 1
        self.swings = Swings(loop, self.engine)

    def from_guess(self, guess) -> Orbit | None:
        """Refine a guess; a sampled loop, not periodic to the sample, is simulated from it instead."""
        if isinstance(guess, Orbit):
            return self._from_state(guess.states[:, 0], guess.period)
        if isinstance(guess, np.ndarray) and guess.shape == (self.engine.nstates,):
            return self._from_simulation(guess)
        amplitude, omega = _amplitude_omega(guess, self.engine.nstates)
        wanted = getattr(guess, "output_amplitude", None)
        if wanted is None and self.parts is not None:
            gain = abs(complex(describing_function(self.parts.block, amplitude, omega)))
            wanted = gain * amplitude if np.isfinite(gain) else None
        start = harmonic_start(self.loop, amplitude, omega, wanted)
        if self.sampled:
            return self._from_simulation(start)
        orbit = self._from_state(start, 2 * np.pi / omega)
        better, waveform = getattr(guess, "corrected", None), getattr(guess, "waveform", None)
        if orbit is None and better is not None and waveform is not None:
            orbit = self._from_state(harmonic_start(self.loop, waveform, better[1]), 2 * np.pi / better[1])
        return orbit if orbit is not None else self._from_simulation(start)

    def search(self, search_time=None) -> list[Orbit]:
        """Orbits that simulations from kicks of many sizes end on."""
        found: list[Orbit] = []
        irregular: list[Orbit] = []
        for x0 in self.swings.kicks:
            orbit = self._from_simulation(x0, search_time)
            if orbit is None:
                continue
            known, tolerance = (found, 1e-4) if orbit.status.ok else (irregular, 2e-2)
            if not any(orbit.same_as(o, tolerance) for o in known):
                known.append(orbit)
        # averages over irregular motion are an answer only where nothing repeats
        return found or irregular[:1]

    def _from_simulation(self, x0, search_time=None, swings=1000) -> Orbit | None:
        """Follow the loop until its swings repeat, or to the bound; then refine."""
        laps = self.swings.follow(x0, swings, search_time)
        if len(laps) < 6:
            return None
        times, states, peaks = (np.array(column) for column in zip(*laps, strict=True))
        if peaks[-1] < 1e-6 * peaks.max() or not np.all(np.isfinite(states[-1])):
            return None
        if self.sampled:
            return self._averaged(x0, times, laps)
        size = np.maximum(np.abs(states[-12:]).max(axis=0), 1e-12)
        size = np.maximum(size, 1e-6 * np.max(size))
        for laps_per_period in range(1, 5):
            change = float(np.max(np.abs(states[-1] - states[-1 - laps_per_period]) / size))
            if change > 0.5:
                continue
            orbit = self._from_state(states[-1], times[-1] - times[-1 - laps_per_period])
            if orbit is not None and orbit.status.ok and orbit.output_amplitude > 1e-6 * np.max(size):
                return orbit
        half = len(peaks) // 2
        if len(laps) < swings or not 0.8 < np.mean(peaks[half:]) / np.mean(peaks[:half]) < 1.25:
            return None  # on its way to rest, or away
        return self._averaged(x0, times, laps)

    # --- refinement ---------------------------------------------------------------------------------------

    def _from_state(self, x0, period) -> Orbit | None:
        """Newton from a state near the orbit and an estimate of the period."""
        start, size = self._free_state(np.array(x0, float), period)
        if start is None:
            return None
        status, best, grown = Status.NOT_CONVERGED, np.inf, 0
        lap = None
        for _ in range(self.max_iterations):
            lap = self.tracer.lap(start, period, size=size)
            if not lap.status.ok or not np.all(np.isfinite(lap.monodromy)):
                return None
            residual = lap.end.x - start.x
            mismatch = float(np.max(np.abs(residual) / size))
            if mismatch < 3e-10:
                status = Status.CONVERGED
                break
            if mismatch > 0.9 * best:
                grown += 1
                if grown > 6:
                    break
            best = min(best, mismatch)
            f_end = self.tracer.rate(lap.end.time, lap.end.x, lap.end.mode)
            f_start = self.tracer.rate(start.time, start.x, start.mode)
            n = self.tracer.n
            system = np.zeros((n + 1, n + 1))
            scale = np.append(size, period)
            system[:n, :n] = lap.monodromy - np.eye(n)
            system[:n, n] = f_end
            system[n, :n] = f_start / size**2
            system = system * scale / np.append(size, 1.0)[:, None]
            change = np.linalg.lstsq(system, -np.append(residual / size, 0.0), rcond=1e-12)[0]
            shorten = min(1.0, 0.3 / max(float(np.max(np.abs(change))), 1e-300))
            step = shorten * change * scale
            period += step[n]
            if period <= 0:
                return None
            start = self._rebuilt(start, start.x + step[:n])
            if start is None:
                return None
        if lap is None or np.max(np.abs(start.x)) < 1e-9 * np.max(size) or self._at_rest(start, lap):
            return None
        if status is not Status.CONVERGED and best > 1e-7:
            return None
        return self._finished(start, period, lap, size, Status.CONVERGED if best < 1e-7 else status)

    def _free_state(self, x0, period) -> tuple[Any, Any]:
        """Move along the orbit to the middle of its longest stretch free of sticking and contact."""
        state = self.engine.start(x0)
        lap = self.tracer.lap(state, period, differentiate=False)
        if not lap.status.ok or not lap.segments:
            return None, None
        size = np.max(np.abs([s.start.x for s in lap.segments] + [lap.end.x]), axis=0)
        times = np.linspace(0, period, 65)[1:]
        run = self.engine.run(self.engine.start(x0), period, times=times, rtol=1e-8, log=1)
        size = np.maximum(size, np.nanmax(np.abs(run.states), axis=0))
        size = np.maximum(size, 1e-9 * np.max(size))
        constraints = [self._constraints(s.start.mode) for s in lap.segments]
        least = min(constraints)
        length, k = max((s.length, i) for i, s in enumerate(lap.segments) if constraints[i] == least)
        begin = lap.segments[k].start
        middle = self.engine.run(begin, begin.time + 0.5 * length, rtol=RTOL, locate=False, log=1).state
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

    def _at_rest(self, start, lap):
        """Whether Newton ended on an equilibrium, which is periodic with any period."""
        speed = np.abs(self.tracer.rate(start.time, start.x, start.mode))
        moved = np.max([np.abs(s.start.x - start.x) for s in lap.segments], axis=0)
        return bool(np.max(speed) < 1e-9 * (1e-3 + np.max(np.abs(start.x)))) and bool(np.max(moved) < 1e-9)

    def _rebuilt(self, start, x):
        """Return the moved start in freshly settled modes: rigid joints closed, within gaps and stops."""
        state = self.tracer.settle(self.engine.start(self.feasible(x)))
        return state if np.all(np.isfinite(state.x)) else None

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

    def _finished(self, start, period, lap, size, status) -> Orbit | None:
        times = np.linspace(0.0, period, 1025)
        omega = 2 * np.pi / period
        spectrum = np.zeros((self.engine.noutputs, 2), complex)
        run = self.engine.run(
            start, period, times=times, rtol=RTOL, spectrum=spectrum, omega=omega, max_step=period / 8
        )
        if np.max(np.ptp(run.states, axis=0) / size) < _STILL:
            return None  # an equilibrium, periodic with any period
        live = self._live_states()
        values = np.linalg.eigvals(lap.monodromy[np.ix_(live, live)])
        trivial = int(np.argmin(np.abs(values - 1.0)))
        floquet = np.delete(values, trivial)
        floquet = floquet[np.argsort(-np.abs(floquet))]
        residual = float(np.max(np.abs(lap.end.x - start.x) / size))
        events, t = [], 0.0
        for s in lap.segments:
            t += s.length
            if s.event:
                events.append(Event(t, s.node, s.event))
        amplitudes = 2 * np.abs(spectrum[:, 1]) / period
        return Orbit(
            omega, period, float(amplitudes[self.force_row]), float(amplitudes[0]), floquet,
            bool(np.all(np.abs(floquet) < 1.0)), residual, tuple(events), status, lap.grazing, times,
            run.outputs.T, run.states.T, self.loop,
        )  # fmt: skip

    def _live_states(self) -> Any:
        """States the engine moves; a block may carry others for ordinary solvers only."""
        nodes = self.engine.program.nodes
        live = np.zeros(self.engine.nstates, bool)
        for node in nodes:
            live[node[X] : node[X] + node[NX]] = True
        return np.flatnonzero(live)

    def _averaged(self, x0, times, laps, swings=40) -> Orbit | None:
        """Average over many swings of a motion that never quite repeats (sampled or aperiodic)."""
        if len(times) < 8:
            return None
        count = min(swings, len(times) - 1)
        begin, end = laps[-1 - count], laps[-1]
        period = (end[0] - begin[0]) / count
        omega = 2 * np.pi / period
        span = count * period
        state: State = self.engine.start(x0)
        state = self.engine.run(state, end[0], rtol=1e-8, log=1).state
        t0 = state.time
        spectrum = np.zeros((self.engine.noutputs, 2), complex)
        times = t0 + np.linspace(0, min(4, count) * period, 2049)
        run = self.engine.run(
            state, t0 + span, times=times, rtol=1e-8, spectrum=spectrum, omega=omega, max_step=period / 8
        )
        if not run.status.ok:
            return None
        amplitudes = 2 * np.abs(spectrum[:, 1]) / span
        return Orbit(
            omega, period, float(amplitudes[self.force_row]), float(amplitudes[0]), np.zeros(0, complex),
            None, np.nan, tuple(self.engine.name_events(run.events))[:200], Status.NO_PERIOD, np.nan,
            times - t0, run.outputs.T, run.states.T, self.loop,
        )  # fmt: skip


def _amplitude_omega(guess, nstates):
    if hasattr(guess, "amplitude"):
        return float(guess.amplitude), float(guess.omega)
    try:
        amplitude, omega = (float(v) for v in guess)
    except (TypeError, ValueError):
        raise TypeError(
            "a guess must be a predicted limit cycle, an orbit, a pair (amplitude, omega), or a state as an "
            f"array of shape ({nstates},); got {guess!r}."
        ) from None
    if not (0 < amplitude < np.inf and 0 < omega < np.inf):
        raise ValueError(
            "a guess needs amplitude > 0 and omega > 0 [rad/s], both finite; got "
            f"({amplitude:g}, {omega:g}). "
            "Leave the guess out to search."
        )
    return amplitude, omega
