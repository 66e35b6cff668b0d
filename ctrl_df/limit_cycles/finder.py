"""Exact limit cycles: Newton on the event-located flow, with Floquet multipliers."""

from __future__ import annotations

from typing import Any

import control as ct
import numpy as np

from ..checks import unknown_keywords
from ..df.describing import describing_function
from ..simulate.engine import Engine, Event
from ..simulate.layout import AUX, KIND, MECHANISM, MODE
from ..simulate.loop import answers_at_once
from ..status import Status
from .arguments import check_search, checked_guess
from .forced_start import harmonic_start
from .monodromy import RTOL, Tracer
from .orbit import Orbit
from .swings import Swings, repeats
from .symmetry import shift_directions, transverse

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

    Raises
    ------
    ValueError
        A pure delay stands in the loop: its state is a whole history, no vector that Newton could move. Its
        motion is found by simulation: `event_response`, or `verify`, whose rows tell what it settles to.
    """
    unknown_keywords(keywords)
    check_search(
        "find_limit_cycle", max_iterations=max_iterations, search_time=search_time,
        raise_on_failure=raise_on_failure,
    )  # fmt: skip
    guess = checked_guess(loop, guess)
    finder = OrbitFinder(loop, max_iterations)
    if finder.engine.delayed:
        raise ValueError(
            "find_limit_cycle needs a state of finitely many numbers; this loop has a pure delay inside, "
            "whose state is a whole history. Find its motion by simulation (event_response, or the rows of "
            "verify), or put a lag of the same time (input_lag) in its place."
        )
    if guess is None:
        found = finder.search(search_time)
        orbit = next(iter(sorted(found, key=lambda o: o.stable is not True)), None)
    else:
        orbit = finder.from_guess(guess)
    if raise_on_failure and (orbit is None or not orbit.status.ok):
        error = RuntimeError(str(orbit.status if orbit else Status.NO_ORBIT))
        error.orbit = orbit  # type: ignore[attr-defined]
        raise error
    return orbit


class OrbitFinder:
    """The limit cycles of one loop: by shooting, or by simulation alone where there is nothing to shoot with.

    A sampled loop has no period of its own, one with a pure delay no finite state: both are followed until
    their swings repeat or the bound on work is hit, and averaged.
    """

    def __init__(self, loop, max_iterations=40):
        if not isinstance(loop, ct.NonlinearIOSystem):
            raise TypeError(
                f"find_limit_cycle needs a loop, e.g. closed_loop(pid, block); got {type(loop).__name__}."
            )
        self.loop: Any = loop
        self.engine = Engine(loop)
        self.tracer: Any = None if self.engine.delayed else Tracer(self.engine)
        self.max_iterations = max_iterations
        self.parts: Any = getattr(loop, "parts", None)
        self.sampled = bool(getattr(self.parts, "dt", 0))
        self.by_simulation = self.sampled or self.engine.delayed
        self.force_row = self.engine.noutputs - 1
        self.swings = Swings(loop, self.engine)

    def from_guess(self, guess) -> Orbit | None:
        """Refine a guess; a loop that cannot be shot for is simulated from it instead."""
        if isinstance(guess, Orbit):
            if self.by_simulation:
                return self._from_simulation(guess.states[:, 0])
            return self._from_state(guess.states[:, 0], guess.period)
        if isinstance(guess, np.ndarray) and guess.shape == (self.engine.nstates,):
            return self._from_simulation(guess)
        amplitude, omega = _amplitude_omega(guess, self.engine.nstates)
        wanted = getattr(guess, "output_amplitude", None)
        if wanted is None and self.parts is not None:
            gain = abs(complex(describing_function(self.parts.block, amplitude, omega)))
            wanted = gain * amplitude if np.isfinite(gain) else None
        motion = getattr(guess, "motion", None)
        start = harmonic_start(self.loop, amplitude, omega, wanted, motion)
        if self.by_simulation:
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
        if self.by_simulation:
            return self._averaged(x0, laps) if repeats(laps, self.swings.tight) or _sustained(peaks) else None
        size = np.maximum(np.abs(states[-12:]).max(axis=0), 1e-12)
        size = np.maximum(size, 1e-6 * np.max(size))
        for laps_per_period in range(1, 5):
            change = float(np.max(np.abs(states[-1] - states[-1 - laps_per_period]) / size))
            if change > 0.5:
                continue
            orbit = self._from_state(states[-1], times[-1] - times[-1 - laps_per_period])
            if orbit is not None and orbit.status.ok and orbit.output_amplitude > 1e-6 * np.max(size):
                return orbit
        return self._averaged(x0, laps) if len(laps) >= swings and _sustained(peaks) else None

    # --- refinement ---------------------------------------------------------------------------------------

    def _from_state(self, x0, period) -> Orbit | None:
        """Newton from a state near the orbit and an estimate of the period."""
        start, size = self._free_state(np.array(x0, float), period)
        if start is None:
            return None
        status, best, grown = Status.NOT_CONVERGED, np.inf, 0
        lap = beside = None
        for _ in range(self.max_iterations):
            lap = self.tracer.lap(start, period, size=size)
            if not lap.status.ok or not np.all(np.isfinite(lap.monodromy)):
                return None
            if beside is None:
                # shifts that the loop does not notice: an orbit closes up to them
                free = shift_directions(self.tracer, lap.segments, size)
                beside = np.eye(self.tracer.n) - free @ free.T
            residual = beside @ ((lap.end.x - start.x) / size)
            mismatch = float(np.max(np.abs(residual)))
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
            system[:n] = beside @ system[:n]
            change = np.linalg.lstsq(system, -np.append(residual, 0.0), rcond=1e-12)[0]
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
        lap, period = self._single(start, period, lap, size, beside)
        return self._finished(start, period, lap, size, Status.CONVERGED if best < 1e-7 else status)

    def _single(self, start, period, lap, size, beside):
        """Return the lap and period of an orbit that may have been closed after going round several times."""
        for parts in (4, 3, 2):
            short = self.tracer.lap(start, period / parts, differentiate=False)
            if short.status.ok and np.max(np.abs(beside @ ((short.end.x - start.x) / size))) < 1e-7:
                return self.tracer.lap(start, period / parts, size=size), period / parts
        return lap, period

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
        # multipliers of what the loop notices: neither those of a free position nor of states nothing reads
        across = transverse(shift_directions(self.tracer, lap.segments, size))
        carried = across.T @ (lap.monodromy * size / size[:, None]) @ across
        values = np.linalg.eigvals(carried)
        trivial = int(np.argmin(np.abs(values - 1.0)))
        floquet = np.delete(values, trivial)
        floquet = floquet[np.argsort(-np.abs(floquet))]
        residual = float(np.max(np.abs(across.T @ ((lap.end.x - start.x) / size))))
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

    def _averaged(self, x0, laps, swings=40) -> Orbit | None:
        """Average over the swings after a transient, for motions that are followed only.

        The amplitude is that of the signal the block sees. A block that acts in continuous time sees the held
        steps of a sampled controller; a law without time sees their values alone, the sequence that the
        prediction of a discrete H speaks of, which is 1/sinc(omega dt/2) larger than the wave of steps.
        """
        settled = repeats(laps, self.swings.tight)
        begin = self.engine.run(self.swings.start(x0), laps[-1].time, rtol=1e-8, log=1).state
        later = self.swings.follow(begin, min(swings, len(laps)), until_repeated=False)
        count = len(later) - 1
        if count < 4:
            return None
        period = (later[-1].time - later[0].time) / count
        omega = 2 * np.pi / period
        t0, span = begin.time, count * period
        spectrum = np.zeros((self.engine.noutputs, 2), complex)
        times = t0 + np.linspace(0, min(4, count) * period, 2049)
        run = self.engine.run(
            begin, t0 + span, times=times, rtol=1e-8, spectrum=spectrum, omega=omega, max_step=period / 8
        )
        if not run.status.ok:
            return None
        amplitudes = 2 * np.abs(spectrum[:, 1]) / span
        if self.swings.held and answers_at_once(self.parts.block):
            amplitudes = amplitudes / np.sinc(omega * self.parts.dt / (2 * np.pi))
        exact = settled and self.engine.delayed and not self.sampled
        return Orbit(
            omega, period, float(amplitudes[self.force_row]), float(amplitudes[0]), np.zeros(0, complex),
            True if exact else None, np.nan, tuple(self.engine.name_events(run.events))[:200],
            Status.CONVERGED if exact else Status.NO_PERIOD, np.nan, times - t0, run.outputs.T, run.states.T,
            self.loop,
        )  # fmt: skip


def _sustained(peaks) -> bool:
    """Whether swings that do not repeat keep their size, rather than being on their way to rest, or away."""
    half = len(peaks) // 2
    return bool(0.8 < np.mean(peaks[half:]) / np.mean(peaks[:half]) < 1.25)


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
