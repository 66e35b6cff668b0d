"""Forced periodic orbits on the event engine: N(a, omega) of anything that has no closed form.

The block is driven by ``A cos(omega t)`` and the state that repeats after one period (after half of one,
mirrored, where the laws are odd) is found by Newton's method on the engine's period map, not by waiting for
transients. Where that fails, or finds an orbit that repels, the motion is followed and named: not half-wave
symmetric (``asymmetric``), repeating after several periods (``subharmonic``), or not at all (``aperiodic``,
averaged).
"""

from __future__ import annotations

import threading

import numpy as np

from ...blocks.mechanism import Mechanism
from ...simulate.engine import State
from ...simulate.program import layout
from ...status import Status
from ..thresholds import (
    BLOCKS,
    EVEN_LEAST,
    EVEN_MISS,
    EVENS,
    LATER,
    LATEST,
    LONGER_BETTER,
    LONGER_LEAST,
    LONGEST_PERIOD,
    NOTHING,
    RTOL,
    SLOW_CHANGE,
    STEADY_SLOPE,
    TRAVEL,
    WAITS,
)
from .damped import close_damped
from .line import Line
from .orbit_search import BIT, TOUCH, OrbitSearch, OutOfWork

ORBIT_REGIMES = (
    "slip",
    "stick-slip",
    "stuck",
    "impact",
    "contact",
    "asymmetric",
    "subharmonic",
    "aperiodic",
    "smooth",
    "diverged",
    "work limit",
    "drifting",
    "free",
    "resonance",
    *(f"subharmonic {k}" for k in range(2, LONGEST_PERIOD + 1)),
)
"""Names of the answers: a sliding mass that never rests; one that does; nothing moves (N is NaN); impacts
without and with sustained contact; one period but no half-wave symmetry although the laws have it; several
periods, with their number; none; no dry friction and no contact; the state runs away (NaN); the bound on
work was hit (NaN); the mass travels steadily besides swinging (the ramp is no part of the harmonics);
a load never touched; an undamped linear mechanism driven at its natural frequency, which swings wider and
wider (NaN)."""
_CODE = {name: i for i, name in enumerate(ORBIT_REGIMES)}


def orbit_family(block, A, omega, *, orders=9, output=None, transient=4, averages=64, max_steps=1_000_000):
    """Harmonics of the steady motion on a grid, by forced periodic orbits.

    Each point starts from its neighbour, from large amplitudes downwards; where motions coexist the answer
    is the one reached that way.

    Parameters
    ----------
    block : ct.NonlinearIOSystem or LTI system
        One input.
    A, omega : (na,), (nw,) arrays
        Amplitudes and frequencies [rad/s], > 0.
    orders : int
        Highest harmonic, >= 1.
    output : str or int
        Output described, the first by default.
    transient : int
        Periods followed before the first Newton step of a point without a neighbour.
    averages : int
        Periods averaged where the motion has no period, >= 8.
    max_steps : int
        Bound on the work of one point, in integration steps.

    Returns
    -------
    harmonics : (na, nw, orders + 1) complex
        Y_k / A; index 0 the mean (zero for the position of a free mass, which may be anywhere).
    regime : (na, nw) int
        Index into `ORBIT_REGIMES`.
    residual : (na, nw)
        Mismatch after the period relative to the size of the orbit; for averaged motions twice the standard
        error of the fundamental, relative. NaN where there is no answer.

    Raises
    ------
    ValueError
        A block with several inputs, with time-dependent laws, or in discrete time.
    RuntimeError
        A law raised or returned NaN; carries the exception.
    """
    A, omega = np.atleast_1d(np.asarray(A, float)), np.atleast_1d(np.asarray(omega, float))
    harmonics = np.full((len(A), len(omega), orders + 1), np.nan + 0j)
    regime = np.full((len(A), len(omega)), _CODE["work limit"], np.int16)
    residual = np.full((len(A), len(omega)), np.nan)
    solver = solver_for(block, output, transient, averages, max_steps)
    a_order = np.argsort(A)[::-1]  # downwards: large motions are the simple ones
    w_order = np.argsort(omega)
    along_a = len(A) > 1
    solver.forget()
    for line in w_order if along_a else [0]:
        row, column = (a_order, np.full(len(A), line)) if along_a else (np.zeros(len(omega), int), w_order)
        solver.line(A[row], omega[column], harmonics, regime, residual, row, column)
    return harmonics, regime, residual


def _steady(means, sizes) -> bool:
    """Whether averages over consecutive blocks scatter and do not tend anywhere.

    A slope is believed from four times its standard error: for eight blocks one steady motion in 200 is then
    followed longer than need be.
    """
    at = np.arange(len(means)) - 0.5 * (len(means) - 1)
    size = np.max(np.abs(means))
    for found, scale in ((means.real, size), (means.imag, size), (sizes, np.max(sizes))):
        values = found / scale if scale > 0 else found  # squares of a motion that runs away are no numbers
        slope = at @ values / (at @ at)
        rest = values - values.mean() - slope * at
        error = np.sqrt(rest @ rest / (len(at) - 2) / (at @ at))
        if abs(slope) > 4 * error and abs(slope) * len(at) > STEADY_SLOPE:
            return False
    return True


def _even(y):
    """Largest even harmonic over the fundamental."""
    return np.max(np.abs(y[..., 2::2]), axis=-1, initial=0.0) / np.maximum(np.abs(y[..., 1]), NOTHING)


_kept = threading.local()


def solver_for(block, output=None, transient=4, averages=64, max_steps=1_000_000) -> OrbitSolver:
    """Return a solver, the one of the last call in this thread where it is for an equal block."""
    key = (block, output, transient, averages, max_steps)
    last = getattr(_kept, "last", None)
    if last is not None and last[0][1:] == key[1:]:
        known = last[0][0]
        if known is block or (isinstance(block, Mechanism) and known == block):
            return last[1]
    search = OrbitSearch(block, output, transient=transient, averages=averages, max_steps=max_steps)
    solver = OrbitSolver(search)
    _kept.last = (key, solver)
    return _kept.last[1]


class OrbitSolver:
    """Solves points and lines of a family, each started from the one before, and names what it finds.

    Parameters
    ----------
    search : OrbitSearch
        Finds the orbits of the block.

    Attributes
    ----------
    previous : State or None
        The orbit of the point before.
    simple : bool
        Whether that point closed as an orbit of one period.
    """

    def __init__(self, search: OrbitSearch):
        self.search = search
        self._forget_points()

    def forget(self):
        """Start the next point from rest."""
        self.search.forget()
        self._forget_points()

    def _forget_points(self):
        self.previous: State | None = None
        self.first: tuple | None = None
        self.broken = self.simple = False

    # --- lines and points -----------------------------------------------------------------------------------

    def line(self, A, omega, harmonics, regime, residual, row, column):
        """Solve consecutive points, compiled as long as they close, one by one where they do not."""
        orders, n = harmonics.shape[-1] - 1, len(A)
        if self.search.acquaint(A[n // 2], omega[n // 2], whatever_before=True):
            self._forget_points()
        line, power = Line(self.search, A, omega, orders), self.search.symmetries.power
        p = 0
        if self.previous is not None and self.first is not None:  # the line before starts where this one does
            x, mode, units, self.broken = self.first
            self.previous = State(0.0, x / units * A[0] / omega[0] ** power, mode)
        while p < n:
            # the point by itself: its start, its regime, its checks
            harmonics[row[p], column[p]], name, residual[row[p], column[p]] = self.solve(
                A[p], omega[p], orders
            )
            regime[row[p], column[p]] = _CODE[name]
            if p == 0:
                self.first = None
                if self.previous is not None and self.simple and name not in ("stuck", "free"):
                    self.first = (self.previous.x, self.previous.mode, A[0] / omega[0] ** power, self.broken)
            p += 1
            if p == n or self.previous is None or not self.simple:
                continue
            while p < n:
                done = self._take_over(line, p, harmonics, regime, residual, row, column)
                if done:
                    p += done
                    self.previous = line.state(p - 1)
                if not (done and line.symmetrical):
                    break

    def _take_over(self, line, p, harmonics, regime, residual, row, column):
        """Close points of a line from `p` on by compiled code; return how many need no second look."""
        self.search.mirrored = self.search.symmetric and not self.broken
        done = line.close(p, self.previous)
        self.search.forget_flight()
        if line.symmetrical:
            self.search.shot.jacobian[:] = np.nan  # it is of shots twice as long
        some, A, omega = slice(p, p + done), line.A, line.omega
        row_of, mirrored = self.search.row, self.search.mirrored
        integrals, ends = line.integrals[some, row_of], line.ends[some, :, row_of]
        y = self.search.fourier(integrals, ends, 1, mirrored, omega[some])
        finished, even = self.search.turned(y, omega[some]) / A[some, None], _even(y)
        for q in range(p, p + done):
            self.search.kinds, self.search.still = int(line.kinds[q]), bool(line.still[q])
            name = self._name(y[q - p, 1], even[q - p], line.ends[q, :, row_of], line.miss[q])
            if name in ("stuck", "free"):  # these need a second look
                line.symmetrical = False
                return q - p
            harmonics[row[q], column[q]] = finished[q - p]
            regime[row[q], column[q]], residual[row[q], column[q]] = _CODE[name], line.miss[q]
        if line.symmetrical:
            self.broken = False
        return done

    def solve(self, A: float, omega: float, orders: int):
        """Return (Y_k/A for k = 0..orders, regime name, residual)."""
        if self.search.aim([0.0, A], omega):
            self._forget_points()
        if self.search.linear is not None:
            self.simple = False
            y, name, x = self.search.linear.answer(A, omega, orders)
            self.previous = None if x is None else State(0.0, x, self.search.engine.modes.copy())
            return self._finished(y, name), name, np.nan if np.isnan(y[1]) else 0.0
        try:
            y, name, residual = self._answer(orders)
        except OutOfWork as stop:
            self.previous, self.simple = None, False
            return np.full(orders + 1, np.nan + 0j), stop.regime, np.nan
        return self._finished(y, name), name, residual

    # --- one point --------------------------------------------------------------------------------

    def _answer(self, orders):
        """Coefficients Y_k, regime and residual at the present aim."""
        broken, self.search.repels = self.broken and self.previous is not None, False
        self.search.mirrored, self.simple, self.broken = self.search.symmetric and not broken, True, False
        state = self.previous or self.search.at_rest(self.search.A)
        state = state.copy()
        orbit = self.search.periodic(state, orders=orders) if self.previous is not None else None
        if orbit is None:
            state = self.search.iterate(state, self.search.transient)
            orbit = None if self.search.repels else self.search.periodic(state, orders=orders)
        if orbit is None:
            orbit = self.search.followed(state, max(LATER - self.search.transient, 1), orders)
        if orbit is None:
            trail = self.search.trail(state, 5)
            orbit = self.search.periodic(state, orders=orders)
            if orbit is None and self.search.mirrored and self._alternates(trail):
                self.search.mirrored = False
                orbit = self.search.periodic(state, orders=orders)
                self.search.mirrored = orbit is None
            if orbit is None:
                orbit = close_damped(self.search, state, orders=orders, patient=self._slow(trail))
        if orbit is None and self.search.symmetric:
            self.search.mirrored = self.search.repels = False
            state = self.search.nudged(state)
            orbit = self.search.followed(state, LATEST, orders)
        if self.search.gap and orbit is not None and not self.search.kinds & TOUCH:
            mirrored, within = self.search.mirrored, orbit[0]
            touching, state = self.search.touching(orders)
            if touching is not None or state is not None:
                orbit = touching
            else:
                self.search.mirrored, state = mirrored, within
                orbit = self.search.periodic(within, orders=orders)
        if orbit is None:
            return self._unperiodic(state, orders)
        self.previous = orbit[0]
        y = self.search.fourier(self.search.integrals, self.search.ends, 1, self.search.mirrored)
        self._remember_symmetry(y)
        return y, self._name(y[1], _even(y), self.search.ends, orbit[1]), orbit[1]

    def _remember_symmetry(self, y):
        """Keep whether the orbit has lost the symmetry of half periods: the next one begins as it does.

        Without even harmonics asked for that is not known.
        """
        if self.search.symmetric and not self.search.mirrored:
            self.broken = len(y) < 3 or bool(_even(y) > EVEN_LEAST)
            if not self.broken:
                self.search.shot.jacobian[:] = np.nan  # it is of shots twice as long

    def _unperiodic(self, state, orders):
        """Look for a longer period; else follow the motion until it is steady, and average."""
        self.search.mirrored, self.simple = False, False
        state = self.search.iterate(state, LATEST, RTOL)
        y = self.search.trail(state, 2 * LONGEST_PERIOD + 1)
        self.search.stop_if_running_away(y)
        found = self._longer_period(state, y, orders)
        if found is not None:
            return found
        orbit = close_damped(self.search, state, orders=orders, patient=self._slow(y))
        if orbit is None:
            for periods in WAITS:
                means, sizes = self._averages(state, orders)
                if (self.search.gap and not self.touched) or _steady(means[:, 1], sizes):
                    break
                state = self.search.iterate(state, periods)
                orbit = self.search.periodic(state, orders=orders)
                orbit = orbit or close_damped(self.search, state, orders=orders)
                if orbit is not None:
                    break
            else:  # still on its way
                grows = np.all(np.diff(sizes) > 0) and np.ptp(np.diff(sizes)) < 0.5 * np.mean(np.diff(sizes))
                raise OutOfWork(Status.DIVERGED if grows else Status.WORK_LIMIT)
        if orbit is not None:
            self.previous, self.simple = orbit[0], True
            y = self.search.fourier(self.search.integrals, self.search.ends, 1, False)
            self._remember_symmetry(y)
            return y, self._name(y[1], _even(y), self.search.ends, orbit[1]), orbit[1]
        self.previous = state
        mean = means.mean(axis=0)
        if self.search.gap and not self.touched:
            return mean, "free", 0.0
        error = np.std(means[:, 1], ddof=1) / np.sqrt(BLOCKS)
        return mean, "aperiodic", float(2 * error / max(abs(mean[1]), NOTHING))

    def _alternates(self, y):
        """Whether a motion repeats after two of the shots it is followed by, and not after one."""
        once, twice = (np.max(np.abs(self._apart(y, k)[-1]), initial=0.0) for k in (1, 2))
        return bool(twice < EVENS * once and once > EVENS)

    def _apart(self, y, shots):
        """Return changes over so many shots of the coordinates that have to repeat, in their sizes."""
        s, steps = self.search.symmetries, y[shots:] - y[:-shots]
        wrap = np.where(s.wrap > 0, s.wrap, 1.0)
        steps -= np.where(s.wrap > 0, np.round(steps / wrap) * wrap, 0.0)
        return (steps / np.maximum(np.max(np.abs(y), axis=0), NOTHING))[:, s.free]

    def _slow(self, y):
        """Whether a motion changes little, and steadily, from shot to shot: a transient, not chaos."""
        steps = np.max(np.abs(self._apart(y, 1)), axis=1, initial=0.0)[-4:]
        return bool(np.max(steps) < SLOW_CHANGE and np.max(steps) < 2 * np.min(steps))

    def _longer_period(self, state, y, orders):
        """Coefficients, regime and residual of a motion that repeats after several periods, or None."""
        s = self.search.symmetries
        size = np.where(self.search.shot.size > 0, self.search.shot.size, 1.0)
        least = LONGER_LEAST
        for periods in range(1, LONGEST_PERIOD + 1):
            gap = (y[-1] - y[-1 - periods]) / size
            gap -= np.where(
                s.wrap > 0, np.round(gap * size / np.where(s.wrap > 0, s.wrap, 1)) * s.wrap / size, 0
            )
            apart = np.max(np.abs(gap[s.free]), initial=0.0)
            if apart < LONGER_BETTER * least:
                least = apart
                orbit = self.search.periodic(state, periods, orders)
                if orbit is not None:
                    self.previous, self.simple = orbit[0], periods == 1
                    c = self.search.fourier(self.search.integrals, self.search.ends, periods, False)
                    if self.simple:
                        self._remember_symmetry(c)
                    name = (
                        f"subharmonic {periods}"
                        if periods > 1
                        else self._name(c[1], _even(c), self.search.ends, orbit[1])
                    )
                    return c, name, orbit[1]
        return None

    def _averages(self, state, orders):
        """Follow the state, in place, over `averages` periods; coefficients and size of every block."""
        length, parts, sizes, self.touched = self.search.averages // BLOCKS, [], [], False
        for _ in range(BLOCKS):
            mean, size = np.zeros(orders + 1, complex), 0.0
            for _ in range(length):
                part = np.zeros((self.search.row + 1, orders + 1), complex)
                self.touched |= bool(self.search.shoot(state, RTOL, 1, part) & TOUCH)
                ends = self.search.shot.ends[:, self.search.row]
                mean += self.search.fourier(part[self.search.row], ends, 1, False) / length
                with np.errstate(over="ignore"):  # a motion that runs away is seen by its size
                    y = np.abs(self.search.symmetries.transform @ state.x) / self.search.unit
                size += np.max(y[self.search.symmetries.free], initial=0.0) / length
            parts.append(mean)
            sizes.append(size)
        return np.array(parts), np.array(sizes)

    # --- what was found -------------------------------------------------------------------------------

    def _finished(self, y, name):
        return np.full(len(y), np.nan + 0j) if name == "stuck" else self.search.turned(y) / self.search.A

    def _name(self, fundamental, even, ends, miss):
        """Regime of a motion of one period."""
        s, kinds = self.search.symmetries, self.search.kinds
        if self.search.still and not kinds & ~(BIT["corner"] | BIT["switch"]):
            return "stuck"
        if self.search.gap and not kinds & TOUCH:
            return "free"
        drift = abs(ends[1] - ends[0]) if not self.search.mirrored else 0.0
        if drift > TRAVEL * abs(fundamental) and (s.wrap.any() or (s.shifts and not s.inertial.any())):
            return "drifting"
        if self.search.symmetric and even > max(EVEN_LEAST, EVEN_MISS * miss):
            return "asymmetric"
        rigid = kinds & (BIT["impact"] | BIT["stop"])
        if kinds & BIT["stop contact"] or (kinds & BIT["contact"] and not self._elastic()):
            return "contact"
        if rigid:
            return "impact"
        if kinds & (BIT["stick"] | BIT["breakaway"]):
            return "stick-slip"
        return "slip" if kinds & BIT["reversal"] else "smooth"

    def _elastic(self):
        prog, mechanisms = self.search.engine.program, self.search.mechanisms
        return any(prog.ints[n[layout.AUX] + layout.A_JOINT] == layout.J_ELASTIC for n in mechanisms)
