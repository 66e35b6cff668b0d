"""`find_limit_cycle`: where an exact orbit is sought, and how it is found."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import control as ct
import numpy as np

from ..simulate.engine import Engine
from ..simulate.loop import has_direct_feedthrough
from ..status import Status
from ..thresholds import NEWTON_FAR, NOTHING
from .arguments import check_search, checked_guess
from .exact.basins import Explorer
from .exact.closing import Centre, Closing, NoClosure
from .exact.orbit import NoOrbit, Orbit, Try
from .exact.poincare import CYCLES, DIVERGES, RESTS, UNDECIDED, PoincareSearch
from .exact.shrinking import Merged, trace
from .exact.thresholds import (
    CROSSINGS,
    CROSSINGS_AVERAGED,
    PIECES,
    REPEATS_LEAST,
    STEPS_A_PERIOD,
    TRAJECTORY_RTOL,
)
from .forced_start import harmonic_start, path_starts
from .pieces import by_pieces
from .predicted.linear import LinearPart
from .predicted.path import End, Path, corrected_near, follow_path
from .predicted.waveform_response import described_gain, response_of_block
from .thresholds import (
    AT_ITS_END,
    AVERAGE_POINTS,
    AVERAGED_LEAST,
    CROSSINGS_A_PERIOD,
    ENOUGH,
    EVENTS_KEPT,
    NEAR_MISS,
    RECENT_CLOSED,
    RETURN_GONE,
    RETURN_NEAR,
    RETURN_POINTS,
    RETURNS,
    SAME_AS_PATH,
    SAME_CYCLE,
)


def find_limit_cycle(
    loop, guess=None, *, max_iterations=NEWTON_FAR, search_time=None, raise_on_failure=False
) -> Orbit | NoOrbit:
    """Find an exact periodic orbit of an autonomous loop (input r = 0).

    Parameters
    ----------
    loop : ct.InterconnectedSystem
        From `closed_loop`, or any interconnection that `event_response` runs; with loops of one's own the
        first output is taken as the output and the last one as the block's input.
    guess : LimitCycle, Orbit, (amplitude, omega), state array, or None
        Where to start. From a prediction, or an amplitude at the block's input and a frequency [rad/s], the
        harmonics that the describing function drops are fed back gradually until none is missing, which
        reaches unstable orbits as well as stable ones. A state is the start of Newton's method, then of a
        simulation. None simulates from starts of several sizes, refines what they settle to and what
        separates starts with different outcomes, and returns the first orbit found, stable ones first.
    max_iterations : int
        Bound on Newton steps.
    search_time : float
        Longest simulation of the search [s]; by default some hundred periods.
    raise_on_failure : bool
        Raise RuntimeError (with the result as ``.orbit``) instead of returning a `NoOrbit`.

    Returns
    -------
    Orbit or NoOrbit
        An orbit whose ``note`` says if it is not the one guessed; or a `NoOrbit`, false in an ``if``, whose
        ``status`` and ``tried`` say what was tried and how each try ended. Not found is no proof.

    Raises
    ------
    ValueError
        The loop contains a pure delay: its state is a history, not a vector that Newton's method could solve
        for. Its motion is found by simulation: `event_response`, or `verify`, whose rows describe it.

    Examples
    --------
    >>> axis = cdf.friction_mass(mass=9, coulomb=5, viscous=0.5, static=5.5)
    >>> loop = cdf.closed_loop(cdf.pid(2000, 44250, 130), axis)
    >>> cdf.find_limit_cycle(loop, guess=(8.0, 11.6))
    <Orbit: 7.945402 @ 11.62868 rad/s, stable>
    """
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
    orbit, none = finder.search(search_time) if guess is None else finder.from_guess(guess)
    result = none if orbit is None else orbit
    if raise_on_failure and (not result or not result.status.ok):
        error = RuntimeError(str(result) if not result else str(result.status))
        error.orbit = result  # type: ignore[attr-defined]
        raise error
    return result


@dataclass
class _Attempts:
    """What was tried from one guess, or in one search, and how each try ended.

    `failures`: why tries closed no orbit; `merged`: the guess was shown to belong to none; `centre`: orbits
    of every amplitude lie side by side.
    """

    tried: list[Try] = field(default_factory=list)
    failures: list[NoClosure] = field(default_factory=list)

    @property
    def merged(self) -> str:
        """Why the guess belongs to no orbit; empty where that was not shown."""
        return next((str(why) for why in self.failures if isinstance(why, Merged)), "")

    @property
    def centre(self) -> bool:
        return any(isinstance(why, Centre) for why in self.failures)

    def note(self, start: str, outcome: str) -> None:
        """Take note of a try."""
        self.tried.append(Try(start, outcome))

    def failed(self, start: str, why: NoClosure) -> None:
        """Take note of a try that closed no orbit."""
        self.failures.append(why)
        self.note(start, str(why))

    def none(self) -> NoOrbit:
        """Return the result where nothing was found, with all that was tried."""
        status = Status.NOT_FOUND
        if self.merged:
            status = Status.NO_SUCH_ORBIT
        elif self.centre:
            status = Status.CENTRE
        return NoOrbit(status, tuple(self.tried), self.merged)


class OrbitFinder:
    """The limit cycles of one loop: by shooting, or by simulation alone where there is nothing to shoot with.

    A sampled loop has no period of its own, one with a pure delay no finite state: both are followed until
    they repeat or the bound on work is hit, and averaged.

    Parameters
    ----------
    loop : ct.NonlinearIOSystem
    max_iterations : int
        Bound on Newton steps.
    """

    def __init__(self, loop, max_iterations=NEWTON_FAR):
        if not isinstance(loop, ct.NonlinearIOSystem):
            raise TypeError(
                f"find_limit_cycle needs a loop, e.g. closed_loop(pid, block); got {type(loop).__name__}."
            )
        self.loop: Any = loop
        self.engine = Engine(loop)
        self.parts: Any = getattr(loop, "parts", None)
        self.sampled = bool(getattr(self.parts, "dt", 0))
        self.by_simulation = self.sampled or self.engine.delayed
        self.closing: Any = None if self.engine.delayed else Closing(loop, self.engine, max_iterations)
        self.poincare = PoincareSearch(loop, self.engine)
        self.explorer = Explorer(self.poincare, partial(self._orbit_near, _Attempts()))

    # --- from a guess -------------------------------------------------------------------------------------

    def from_guess(self, guess) -> tuple[Orbit | None, NoOrbit]:
        """Return the orbit that a guess, as `checked_guess` returns it, leads to, and what was tried."""
        attempts = _Attempts()
        return self._from_guess(attempts, guess), attempts.none()

    def _from_guess(self, attempts, guess) -> Orbit | None:
        if isinstance(guess, Orbit):
            return self._from_orbit(attempts, guess)
        if isinstance(guess, np.ndarray):
            return self._from_state(attempts, guess)
        amplitude, omega = (guess.amplitude, guess.omega) if hasattr(guess, "amplitude") else guess
        guessed = f"amplitude {amplitude:.5g}, omega {omega:.5g} rad/s"
        if self.by_simulation:
            orbit = self._simulated(attempts, self._start(guess, amplitude, omega), "the prediction")[0]
            return None if orbit is None else self._noted(orbit, amplitude, omega, guessed)
        others: list[Orbit] = []
        # the path's own orbit is the guess's, however far its harmonics have moved it
        for name, path in self._paths(guess, amplitude, omega):
            orbit = self._closed_path(attempts, path, name)
            if orbit is not None and self._belongs(orbit, path):
                return self._noted(orbit, amplitude, omega, guessed)
            others += [orbit] if orbit is not None else []
        if attempts.merged and not any(_near(o, amplitude, omega) for o in others):
            return None
        start = self._start(guess, amplitude, omega)
        orbit = self._closed(attempts, start, 2 * np.pi / omega, "the block's forced motion")
        others += [orbit] if orbit is not None else []
        if not any(_near(o, amplitude, omega) for o in others):
            orbit = self._simulated(attempts, start, "a simulation from there")[0]
            others += [orbit] if orbit is not None else []
        if not others:
            return None
        return self._noted(
            min(others, key=lambda o: _distance(o, amplitude, omega)), amplitude, omega, guessed
        )

    def _from_orbit(self, attempts, guess):
        start = guess.states[:, 0]
        if self.by_simulation:
            return self._simulated(attempts, start, "the orbit given")[0]
        orbit = self._closed(attempts, start, guess.period, "the orbit given")
        return orbit if orbit is not None else self._simulated(attempts, start, "a simulation from it")[0]

    def _from_state(self, attempts, x0):
        """Close the orbit that a state stands on or near; else what a simulation from it comes to."""
        if self.by_simulation:
            return self._simulated(attempts, x0, "the state given")[0]
        for period in self._returns(x0):
            orbit = self._closed(attempts, x0, period, f"the state given, period {period:.5g} s")
            if orbit is not None:
                return orbit
        return self._simulated(attempts, x0, "a simulation from the state given")[0]

    def _returns(self, x0, most=RETURNS):
        """Return times after which a simulation from a state comes near it again, nearest first."""
        trajectory = self.poincare.iterate(x0, RETURNS, until_repeated=False)
        span = trajectory.crossings[-1].time if trajectory.crossings else self.poincare.longest
        times = np.linspace(0.0, span, RETURN_POINTS)
        run = self.engine.run(self.engine.start(x0), span, times=times, rtol=TRAJECTORY_RTOL, log=1)
        states = run.states[: run.recorded]
        size = np.maximum(np.max(np.abs(states[np.isfinite(states).all(axis=1)]), axis=0), NOTHING)
        apart = np.max(np.abs(states - x0) / size, axis=1)
        lows = np.flatnonzero((apart[1:-1] <= apart[:-2]) & (apart[1:-1] < apart[2:])) + 1
        gone = np.flatnonzero(apart > RETURN_GONE)
        lows = lows[(lows > (gone[0] if gone.size else len(times))) & (apart[lows] < RETURN_NEAR)]
        return [float(times[k]) for k in lows[np.argsort(apart[lows])][:most]]

    def _paths(self, guess, amplitude, omega):
        """Waveforms that a guess leads to as its harmonics are fed back, one after the other."""
        path = getattr(guess, "path", None)
        if path is not None:
            yield "its path", path
        elif self.parts is not None and not getattr(guess, "branch", ""):
            response, linear = self._response()
            if response is None:
                return
            steady_state, count = response
            path = follow_path(steady_state, count, linear, amplitude, omega)
            if path.end is not End.REACHED:
                # no prediction stands at an arbitrary guess: to all its harmonics at once
                direct = corrected_near(steady_state, count, linear, amplitude, omega)
                if direct is not None:
                    yield "harmonic balance from the guess", direct
            yield "its path", path

    def _response(self):
        block = self.parts.block
        fed_back = self.loop.output_labels[0]
        output = fed_back if fed_back in getattr(block, "output_labels", ()) else None
        return response_of_block(block, output), LinearPart(self.parts.controller)

    def _closed_path(self, attempts, path: Path, name):
        if path.end is End.MERGED:
            a, w = path.solution
            why = (
                f"it merges with the prediction at {a:.5g} @ {w:.5g} rad/s once {path.share:.0%} of the "
                "harmonics are fed back"
            )
            attempts.failed(name, Merged(why))
            return None
        if path.end is not End.REACHED:
            attempts.note(name, f"{path.end.value} (at {path.share:.0%} of the harmonics)")
            return None
        earlier = len(attempts.failures)
        (start,), period = path_starts(self.loop, path, 1), 2 * np.pi / path.omega
        orbit = self._closed(attempts, start, period, name)
        if orbit is None:
            along = np.array(path_starts(self.loop, path, PIECES))
            orbit = self._closed(attempts, along, period, "states all along it", self.closing.close_along)
        if orbit is None or _distance(orbit, *path.solution) > AT_ITS_END:
            at = by_pieces(self.loop, path)
            exact = (
                None
                if at is None
                else self._closed(attempts, *at, "the pieces it runs through", self._close_here)
            )
            if exact is not None and (
                orbit is None or _distance(exact, *path.solution) < _distance(orbit, *path.solution)
            ):
                orbit = exact
        if (
            orbit is None
            and min((why.mismatch for why in attempts.failures[earlier:]), default=np.inf) < NEAR_MISS
        ):
            orbit = self._closed(
                attempts,
                start,
                period,
                "the mismatch after a period, let shrink",
                lambda *at: trace(self.closing, *at),
            )
        return orbit

    def _close_here(self, x0, period):
        return self.closing.close(x0, period, stay=True)

    def _belongs(self, orbit, path) -> bool:
        """Whether the orbit closed from the end of a path is the path's own."""
        amplitude, omega = path.solution
        return _near(orbit, amplitude, omega, SAME_AS_PATH)

    def _start(self, guess, amplitude, omega):
        wanted = getattr(guess, "output_amplitude", None)
        if wanted is None and self.parts is not None:
            gain = abs(described_gain(self.parts.block, amplitude, omega))
            wanted = gain * amplitude if np.isfinite(gain) else None
        return harmonic_start(self.loop, amplitude, omega, wanted, getattr(guess, "motion", None))

    def _noted(self, orbit, amplitude, omega, guessed):
        if _near(orbit, amplitude, omega):
            return orbit
        return replace(
            orbit,
            note=f"the guess ({guessed}) led to another orbit: amplitude {orbit.amplitude:.5g}, omega "
            f"{orbit.omega:.5g} rad/s",
        )

    # --- without a guess ----------------------------------------------------------------------------------

    def search(self, search_time=None) -> tuple[Orbit | None, NoOrbit]:
        """Return an orbit that simulations from starts of many sizes end on, or that parts their fates.

        And what was tried. Stable ones come first; averages over irregular motion are a result only where
        nothing repeats.
        """
        attempts = _Attempts()
        explorer = Explorer(self.poincare, partial(self._orbit_near, attempts))
        fate = explorer.explore(search_time, edges=not self.by_simulation)
        for row in fate:
            attempts.note(f"rest, displaced: {row.size:.3g} {self.poincare.starts.unit}", row.told)
        found = [o for o in fate.orbits if o.status.ok] or fate.orbits[:1]
        return min(found, key=lambda o: o.stable is not True, default=None), attempts.none()

    def _orbit_near(self, attempts, x0, trajectory, complete=True) -> Orbit | None:
        """Orbit near a trajectory: closed where it can be, else an average where the motion is sustained."""
        crossings = trajectory.crossings
        if len(crossings) < ENOUGH or trajectory.fate in (RESTS, DIVERGES):
            return None
        if not np.all(np.isfinite(crossings[-1].state)):
            return None
        if self.by_simulation:
            return self._averaged(x0, crossings, self.poincare.repeats(crossings))
        orbit = self._closed_crossings(attempts, crossings)
        if complete and trajectory.fate == UNDECIDED and orbit is not None and orbit.stable is False:
            orbit = None  # one of many that an irregular motion passes: rounding tells which
        if orbit is None and complete and trajectory.fate == UNDECIDED and len(crossings) >= CROSSINGS:
            return self._averaged(x0, crossings, False)
        return orbit

    def _closed_crossings(self, attempts, crossings):
        """Close the orbit that the crossings come nearest to repeating, after one period or a few."""
        recent = crossings[-RECENT_CLOSED:]
        least = REPEATS_LEAST * self.poincare.units
        size = np.maximum(np.max(np.abs([crossing.state for crossing in recent]), axis=0), least)
        for count in range(1, CROSSINGS_A_PERIOD + 1):
            apart = [
                float(np.max(np.abs(recent[k].state - recent[k - count].state) / size))
                for k in range(count, len(recent))
            ]
            if not apart:
                continue
            k = int(np.argmin(apart)) + count
            if apart[k - count] > RETURN_NEAR:
                continue
            try:
                return self.closing.close(recent[k].state, recent[k].time - recent[k - count].time)
            except NoClosure as why:
                if isinstance(why, Centre):
                    attempts.failures.append(why)
        return None

    def _simulated(self, attempts, x0, name, search_time=None):
        """Follow the loop from a start; close what it comes to. Returns (orbit or None, trajectory)."""
        trajectory = self.poincare.iterate(x0, CROSSINGS, search_time)
        orbit = self._orbit_near(attempts, x0, trajectory)
        words = {RESTS: "comes to rest", DIVERGES: "diverges", CYCLES: "repeats"}.get(
            trajectory.fate, "no period"
        )
        if orbit is not None:
            words = f"leads to the orbit {orbit.amplitude:.5g} @ {orbit.omega:.5g} rad/s"
        attempts.note(name, words)
        return orbit, trajectory

    def _closed(self, attempts, start, period, name, close=None) -> Orbit | None:
        try:
            orbit = (close or self.closing.close)(start, period)
        except NoClosure as why:
            attempts.failed(name, why)
            return None
        attempts.note(name, f"leads to the orbit {orbit.amplitude:.5g} @ {orbit.omega:.5g} rad/s")
        return orbit

    def feasible(self, x):
        """Return the nearest state with rigid joints closed, within gaps and stops."""
        return np.array(x, float) if self.closing is None else self.closing.feasible(x)

    # --- averages -----------------------------------------------------------------------------------------

    def _averaged(self, x0, crossings, settled, periods=CROSSINGS_AVERAGED) -> Orbit | None:
        """Average over the periods after a transient, for motions that can only be simulated.

        The amplitude is that of the signal the block sees. A block that acts in continuous time sees the held
        steps of a sampled controller; a law without time sees their values alone, the sequence that the
        prediction of a discrete H speaks of, which is 1/sinc(omega dt/2) larger than the wave of steps.
        """
        begin = self.engine.run(
            self.poincare.start(x0), crossings[-1].time, rtol=TRAJECTORY_RTOL, log=1
        ).state
        later = self.poincare.iterate(begin, min(periods, len(crossings)), until_repeated=False).crossings
        count = len(later) - 1
        if count < AVERAGED_LEAST:
            return None
        period = (later[-1].time - later[0].time) / count
        omega = 2 * np.pi / period
        t0, span = begin.time, count * period
        spectrum = np.zeros((self.engine.noutputs, 2), complex)
        times = t0 + np.linspace(0, min(AVERAGED_LEAST, count) * period, AVERAGE_POINTS)
        run = self.engine.run(
            begin,
            t0 + span,
            times=times,
            rtol=TRAJECTORY_RTOL,
            spectrum=spectrum,
            omega=omega,
            max_step=period / STEPS_A_PERIOD,
        )
        if not run.status.ok:
            return None
        amplitudes = 2 * np.abs(spectrum[:, 1]) / span
        if self.poincare.sampled_input and has_direct_feedthrough(self.parts.block):
            amplitudes = amplitudes / np.sinc(omega * self.parts.dt / (2 * np.pi))
        exact = settled and self.engine.delayed and not self.sampled
        return Orbit(
            float(omega), float(period), float(amplitudes[-1]), float(amplitudes[0]), np.zeros(0, complex),
            True if exact else None, np.nan, tuple(self.engine.name_events(run.events))[:EVENTS_KEPT],
            Status.CONVERGED if exact else Status.NO_PERIOD, np.nan, times - t0, run.outputs.T, run.states.T,
            self.loop,
        )  # fmt: skip


def _near(orbit, amplitude, omega, factors=SAME_CYCLE) -> bool:
    ratio_w, ratio_a = orbit.omega / omega, orbit.amplitude / amplitude
    return max(ratio_w, 1 / ratio_w) <= factors[0] and max(ratio_a, 1 / ratio_a) <= factors[1]


def _distance(orbit, amplitude, omega) -> float:
    return abs(np.log(orbit.omega / omega)) + 0.5 * abs(np.log(orbit.amplitude / amplitude))
