"""Exact limit cycles: Newton on the event-located flow, with Floquet multipliers."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import control as ct
import numpy as np

from ..df.describing import describing_function
from ..simulate import driver
from ..simulate.engine import Engine, Event, State, harmonic_drive
from ..simulate.layout import AUX, H_OUT, KIND, MECHANISM, MODE, NX, X
from ..status import Status
from .monodromy import RTOL, Tracer


@dataclass(frozen=True, eq=False)
class Orbit:
    """A periodic orbit of a closed loop.

    Attributes
    ----------
    omega, period : float
        Fundamental frequency [rad/s] and period [s].
    amplitude : float
        Fundamental amplitude at the block's input (peak).
    output_amplitude : float
        Fundamental amplitude of the loop's first output.
    floquet : ndarray of complex
        Multipliers without the trivial one, largest first; zeros where sticking or contact lose a direction.
    stable : bool or None
        All multipliers inside the unit circle; None where they are not known (sampled loops).
    residual : float
        Mismatch after one period relative to the size of the orbit.
    events : tuple of Event
        Those of one period, times from its start.
    status : Status
        CONVERGED, or why the figures are only estimates.
    grazing : float
        How squarely the events are crossed, 1 to 0; near 0 the multipliers are not to be trusted.
    time, outputs, states : ndarray
        One period, sampled; outputs (ny, nt), states (n, nt).
    """

    omega: float
    period: float
    amplitude: float
    output_amplitude: float
    floquet: np.ndarray
    stable: bool | None
    residual: float
    events: tuple[Event, ...]
    status: Status
    grazing: float
    time: np.ndarray
    outputs: np.ndarray
    states: np.ndarray
    loop: Any = field(repr=False, default=None)

    @property
    def peak(self) -> float:
        """Half of the peak-to-peak swing of the first output."""
        return float(np.ptp(self.outputs[0]) / 2)

    @property
    def multiplier(self) -> float:
        """Largest |Floquet multiplier|, nan if unknown."""
        return float(np.max(np.abs(self.floquet))) if len(self.floquet) else float("nan")

    def same_as(self, other: Orbit, tolerance: float = 1e-4) -> bool:
        """Whether two orbits are one, up to a shift in time."""
        return (
            abs(self.omega / other.omega - 1) < tolerance
            and abs(self.amplitude / other.amplitude - 1) < 10 * tolerance
            and abs(self.output_amplitude / other.output_amplitude - 1) < 10 * tolerance
        )

    def plot(self, **keywords) -> ct.ControlPlot:
        """Draw one period of outputs and the phase portrait."""
        from ..plot.orbit import orbit_plot

        return orbit_plot(self, **keywords)


def find_limit_cycle(loop, guess=None, *, max_iterations=40, search_time=None, raise_on_failure=False, **keywords):
    """Find an exact periodic orbit of an autonomous loop (input r = 0).

    Parameters
    ----------
    loop : ct.InterconnectedSystem
        From `closed_loop`, or any interconnection that `event_response` runs; with loops of one's own the first output
        is taken as the output and the last one as the block's input.
    guess : LimitCycle, Orbit, (amplitude, omega), state array, or None
        Where to start. A prediction starts from the block's forced motion at its amplitude and frequency; None searches
        from simulations of several sizes and returns the first orbit found, stable ones first.
    max_iterations : int
        Bound on Newton steps.
    search_time : float
        Longest simulation of the search [s]; by default some hundred swings.
    raise_on_failure : bool
        Raise RuntimeError (with the best estimate as ``.orbit``) instead of returning an orbit whose status says why.

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
            raise TypeError(f"find_limit_cycle needs a loop, e.g. closed_loop(pid, block); got {type(loop).__name__}.")
        self.loop: Any = loop
        self.engine = Engine(loop)
        self.tracer = Tracer(self.engine)
        self.max_iterations = max_iterations
        self.parts: Any = getattr(loop, "parts", None)
        self.sampled = bool(getattr(self.parts, "dt", 0))
        self.force_row = self.engine.noutputs - 1

    # --- starts -----------------------------------------------------------------------------------------

    def from_guess(self, guess) -> Orbit | None:
        """Refine a guess; for a sampled loop simulate from it instead (its cycles are not periodic to the sample)."""
        if isinstance(guess, Orbit):
            return self._from_state(guess.states[:, 0], guess.period)
        if isinstance(guess, np.ndarray) and guess.shape == (self.engine.nstates,):
            return self._from_simulation(guess)
        amplitude, omega = _amplitude_omega(guess)
        wanted = getattr(guess, "output_amplitude", None)
        if wanted is None and self.parts is not None:
            gain = abs(complex(describing_function(self.parts.block, amplitude, omega)))
            wanted = gain * amplitude if np.isfinite(gain) else None
        start = self.harmonic_start(amplitude, omega, wanted)
        if self.sampled:
            return self._from_simulation(start)
        orbit = self._from_state(start, 2 * np.pi / omega)
        better, waveform = getattr(guess, "corrected", None), getattr(guess, "waveform", None)
        if orbit is None and better is not None and waveform is not None:
            orbit = self._from_state(self.harmonic_start(waveform, better[1]), 2 * np.pi / better[1])
        return orbit if orbit is not None else self._from_simulation(start)

    def harmonic_start(self, amplitude, omega: float, output_amplitude=None) -> np.ndarray:
        """State of the loop at t = 0 when its block is driven by ``amplitude cos(omega t)``.

        `amplitude` may be an array of Fourier coefficients U_k of the block's input, k = 0, 1, ...
        """
        if self.parts is None:
            raise ValueError(
                "a guess of amplitude and frequency needs a loop made by closed_loop; give a state instead, or no guess."
            )
        U = np.array([0.0, amplitude], complex) if np.ndim(amplitude) == 0 else np.asarray(amplitude, complex)
        x_block, Y = self._forced_motion(U, omega, output_amplitude)
        controller = self.loop.syslist[0]
        nc = controller.nstates or 0
        x_control = np.zeros(nc)
        if nc and isinstance(controller, ct.StateSpace):
            a, b = np.asarray(controller.A), np.asarray(controller.B)
            for k in range(1, len(Y)):
                inputs = np.array([-Y[k], 1j * k * omega * Y[k]])[: controller.ninputs]
                x_control = x_control + np.real(np.linalg.solve(1j * k * omega * np.eye(nc) - a, b @ inputs))
        return np.concatenate([x_control, x_block])

    def _forced_motion(self, U, omega, wanted=None):
        """Block alone under the guessed input: its state at t = 0, mean position removed, and its output's coefficients.

        Several motions may coexist; the one nearest to the output amplitude wanted is taken, else the largest.
        """
        block, amplitude = self.parts.block, abs(U[1])
        if not block.nstates:
            return np.zeros(0), np.array([0.0, complex(describing_function(block, amplitude)) * U[1]])
        engine = Engine(block)
        core = getattr(block, "core", None)
        starts = [np.zeros(engine.nstates)]
        if core is not None:
            # the bare mass moves with v = (a / m w) sin wt: at rest at t = 0
            reach = amplitude / (sum(core.masses) * omega**2)
            starts[0][0] = -reach
            if core.bodies == 2:
                starts[0][2] = -reach
                for stretch, speed in ((0.1, 0.0), (0.5, 3.0), (0.5, -3.0)):
                    x = starts[0].copy()
                    x[2] += stretch * core.gap
                    x[3] = speed * core.gap * omega
                    x[1] = -core.masses[1] / core.masses[0] * x[3]  # no net momentum: the pair must not drift away
                    starts.append(x)
        found = [self._forced_from(engine, core, x, U, omega) for x in starts]
        if wanted is not None:
            return min(found, key=lambda f: abs(abs(f[1][1]) - wanted))
        return max(found, key=lambda f: abs(f[1][1]))

    @staticmethod
    def _forced_from(engine, core, x0, U, omega, periods=40):
        drive, period = harmonic_drive([U], omega), 2 * np.pi / omega
        options = dict(rtol=1e-8, max_step=period / 8 / (len(U) - 1) ** 0.5, log=1, max_steps=400_000)
        state = engine.run(engine.start(x0), periods * period, drive, **options).state
        if not np.all(np.isfinite(state.x)):
            return np.zeros(engine.nstates), np.zeros(2, complex)
        state.time, state.fresh = 0.0, True
        spectrum = np.zeros((engine.noutputs, len(U)), complex)
        run = engine.run(state, period, drive, np.array([0.0, period]), spectrum=spectrum, omega=omega, **options)
        x, Y = run.state.x.copy(), 2 * spectrum[0] / period
        drift = run.outputs[-1, 0] - run.outputs[0, 0]
        k = np.arange(1, len(U))
        Y[1:] -= 1j * drift / (np.pi * k)
        if core is not None:
            x[: 2 * core.bodies : 2] -= Y[0].real / 2 + drift / 2
        return x, Y

    def search(self, search_time=None) -> list[Orbit]:
        """Orbits that simulations from kicks of many sizes end on."""
        found: list[Orbit] = []
        irregular: list[Orbit] = []
        for x0 in self._kicks():
            orbit = self._from_simulation(x0, search_time)
            if orbit is None:
                continue
            known, tolerance = (found, 1e-4) if orbit.status.ok else (irregular, 2e-2)
            if not any(orbit.same_as(o, tolerance) for o in known):
                known.append(orbit)
        # averages over irregular motion are an answer only where nothing repeats
        return found or irregular[:1]

    def _kicks(self):
        """Displaced starts at rest, from far below to far above the scale of the block's nonlinearity."""
        block = self.parts.block if self.parts is not None else None
        core = getattr(block, "core", None)
        if core is not None:
            offset = self.loop.syslist[0].nstates or 0
            scale = _length_scale(core, self.loop)
            for factor in (0.3, 1.0, 0.1, 3.0, 0.03, 10.0):
                x = np.zeros(self.engine.nstates)
                x[offset] = factor * scale
                if core.bodies == 2:
                    x[offset + 2] = factor * scale + 0.5 * core.gap
                if core.stop is not None:
                    low, high = core.stop.span
                    x[offset : offset + 2 * core.bodies : 2] = np.clip(
                        x[offset : offset + 2 * core.bodies : 2], 0.9 * low, 0.9 * high
                    )
                yield x
            return
        for factor in (1.0, 0.1, 10.0, 0.01):
            yield factor * np.ones(self.engine.nstates)

    def _from_simulation(self, x0, search_time=None, swings=1000) -> Orbit | None:
        """Follow the loop until its swings repeat, or to the bound; then refine."""
        laps = self._swings(x0, swings, search_time)
        if len(laps) < 6:
            return None
        times = np.array([t for t, _, _ in laps])
        states = np.array([x for _, x, _ in laps])
        peaks = np.array([p for _, _, p in laps])
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

    def _swings(self, x0, count, search_time):
        """Upward passages of the first output through its mean level: (time, state, peak since the last)."""
        engine = self.engine
        state = engine.start(x0)
        watch = self._output_signal()
        laps, quiet, work = [], 0, 0
        bound = 1e4 * max(float(np.max(np.abs(k))) for k in [x0, *self._kicks()])
        limit = search_time if search_time is not None else np.inf
        while len(laps) < count and state.time < limit:
            # ahead in bounded strides: a loop at rest never crosses again
            t_end = min(state.time + self._stride(laps), limit)
            run = engine.run(state, t_end, rtol=1e-8, watch=watch, direction=1, log=1, max_steps=400_000)
            state, work = run.state, work + run.steps
            if not run.status.ok or not np.max(np.abs(state.x)) < bound:
                return []
            if work > 300_000:
                break
            if run.reason == driver.SECTION:
                laps.append((state.time, state.x.copy(), float(np.max(np.abs(state.x)))))
                quiet = 0
                if len(laps) > 12 and self._repeats(laps):
                    break
            else:
                quiet += 1
                if quiet > 40:
                    break
        return laps

    def _stride(self, laps):
        if len(laps) >= 2:
            return 4 * (laps[-1][0] - laps[-2][0])
        return self._time_scale()

    def _time_scale(self):
        """Return a time within which the loop moves: ten over its fastest plausible rate, from the controller's corner."""
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

    def _repeats(self, laps):
        a, b = laps[-1][1], laps[-2][1]
        size = np.max(np.abs([x for _, x, _ in laps[-6:]]), axis=0) + 1e-300
        return bool(np.all(np.abs(a - b) < 1e-7 * np.max(size)))

    def _output_signal(self):
        """Signal index of the loop's first output, or of its last where the block is static (its output may jump)."""
        ints = self.engine.program.ints
        static = self.parts is not None and not self.parts.block.nstates
        return int(ints[ints[ints[H_OUT] + (self.engine.noutputs - 1 if static else 0)] + 1])

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
                count += int(m[0] == 0) + (int(m[1] == 0) if bodies == 2 else 0) + int(m[2] != 0) + int(m[3] != 0)
        return count

    def _at_rest(self, start, lap):
        """Whether Newton ended on an equilibrium, which is periodic with any period."""
        speed = np.abs(self.tracer.rate(start.time, start.x, start.mode))
        moved = np.max([np.abs(s.start.x - start.x) for s in lap.segments], axis=0)
        return bool(np.max(speed) < 1e-9 * (1e-3 + np.max(np.abs(start.x)))) and bool(np.max(moved) < 1e-9)

    def _rebuilt(self, start, x):
        """Return the moved start in freshly settled modes; rigid joints kept closed, gaps and stops respected."""
        state = self.tracer.settle(self.engine.start(self.feasible(x)))
        return state if np.all(np.isfinite(state.x)) else None

    def feasible(self, x):
        """Return the nearest state with rigid joints closed, stretches within gaps and bodies within stops."""
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

    def _finished(self, start, period, lap, size, status) -> Orbit:
        times = np.linspace(0.0, period, 1025)
        omega = 2 * np.pi / period
        spectrum = np.zeros((self.engine.noutputs, 2), complex)
        run = self.engine.run(start, period, times=times, rtol=RTOL, spectrum=spectrum, omega=omega, max_step=period / 8)
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
        """Average the figures of a motion that never quite repeats (sampled or aperiodic) over many swings."""
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
        run = self.engine.run(state, t0 + span, times=times, rtol=1e-8, spectrum=spectrum, omega=omega, max_step=period / 8)
        if not run.status.ok:
            return None
        amplitudes = 2 * np.abs(spectrum[:, 1]) / span
        return Orbit(
            omega, period, float(amplitudes[self.force_row]), float(amplitudes[0]), np.zeros(0, complex), None, np.nan,
            tuple(self.engine.name_events(run.events))[:200], Status.NO_PERIOD, np.nan, times - t0,
            run.outputs.T, run.states.T, self.loop,
        )  # fmt: skip


def _amplitude_omega(guess):
    if hasattr(guess, "amplitude"):
        return float(guess.amplitude), float(guess.omega)
    try:
        amplitude, omega = (float(v) for v in guess)
    except (TypeError, ValueError):
        raise TypeError(
            f"a guess must be a predicted limit cycle, an orbit, a pair (amplitude, omega), or a state; got {guess!r}."
        ) from None
    return amplitude, omega


def _corner_frequency(parts):
    """Frequency at which the controller balances the block's inertia, |H(jw)| = m w^2 [rad/s]."""
    core = getattr(parts.block, "core", None)
    if core is None or not callable(parts.controller):
        return None
    omega = np.geomspace(1e-2, 1e4, 400)
    s = 1j * omega if not getattr(parts.controller, "dt", 0) else np.exp(1j * omega * float(parts.controller.dt))
    gain = np.abs(np.asarray(parts.controller(s)).ravel())
    above = gain > sum(core.masses) * omega**2
    return float(omega[np.flatnonzero(above)[-1]]) if above.any() else float(omega[0])


def _length_scale(core, loop):
    """Displacement at which the block's nonlinearity matters."""
    from ..blocks.core import level

    omega = _corner_frequency(loop.parts) or 1.0
    scales = [core.gap]
    dry = sum(level(chain, 0.0, 1.0, 0.0) for chain in core.friction)
    scales.append(dry / (sum(core.masses) * omega**2))
    for element, _ in core.input_channel:
        corners = getattr(element, "corners", ())
        scales += [abs(c) / (sum(core.masses) * omega**2) for c in corners]
        scales.append(getattr(element, "step", 0.0))
    for element, _ in core.output_channel:
        scales.append(getattr(element, "step", 0.0))
    if core.stop is not None:
        scales.append(0.5 * (core.stop.span[1] - core.stop.span[0]))
    scale = max(scales)
    return scale if scale > 0 else 1e-3
