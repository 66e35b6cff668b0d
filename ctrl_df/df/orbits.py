"""Forced periodic orbits on the event engine: N(a, omega) of anything that has no closed form.

The block is driven by ``A cos(omega t)`` and the state that repeats after one period (after half of one, mirrored,
where the laws are odd) is found by Newton's method on the engine's period map, not by waiting for transients.
Where that fails, or finds an orbit that repels, the motion is followed and named: not half-wave symmetric
(``asymmetric``), repeating after several periods (``subharmonic``), or not at all (``aperiodic``, averaged).
"""

from __future__ import annotations

import threading

import control as ct
import numpy as np

from ..blocks.mechanism import Mechanism
from ..simulate import driver, layout, pointers
from ..simulate.engine import Engine, State, harmonic_drive
from ..simulate.layout import EVENT_KINDS
from ..status import Status
from . import shooting
from .shooting import CLOSED, SPENT, close_orbit, make_shot, shoot, sweep
from .symmetries import Probe, find_symmetries

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
)
"""Names of the answers: a sliding mass that never rests; one that does; nothing moves (N is NaN); impacts without and
with sustained contact; one period but no half-wave symmetry although the laws have it; several periods; none;
no dry friction and no contact; the state runs away (NaN); the bound on work was hit (NaN); the mass travels
steadily besides swinging (its mean motion is no part of the harmonics); a load that is never touched."""
_CODE = {name: i for i, name in enumerate(ORBIT_REGIMES)}

RTOL = 5e-10
_COARSE = 1e-7  # tolerance while a transient is followed
_LONGEST = 12  # periods of a subharmonic motion that is recognised
_BLOCKS = 8  # an average's spread is estimated from that many parts
_BIT = {name: 1 << i for i, name in enumerate(EVENT_KINDS)}
_TOUCH = _BIT["impact"] | _BIT["contact"] | _BIT["release"]


def orbit_family(
    block, A, omega, *, orders=9, output=None, transient=4, averages=64, max_steps=200_000, **keywords
):
    """Harmonics of the steady motion on a grid, by forced periodic orbits.

    Each point starts from its neighbour, from large amplitudes downwards; where motions coexist the answer is the one
    reached that way. `orbit_attractors` lists the others.

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
        Mismatch after the period relative to the size of the orbit; for averaged motions twice the standard error of
        the fundamental, relative. NaN where there is no answer.

    Raises
    ------
    ValueError
        A block with several inputs, with time-dependent laws, or in discrete time.
    RuntimeError
        A law raised or returned NaN; carries the exception.
    """
    if keywords:
        raise TypeError(f"unrecognized keyword(s): {', '.join(keywords)}")
    A, omega = np.atleast_1d(np.asarray(A, float)), np.atleast_1d(np.asarray(omega, float))
    harmonics = np.full((len(A), len(omega), orders + 1), np.nan + 0j)
    regime = np.full((len(A), len(omega)), _CODE["work limit"], np.int8)
    residual = np.full((len(A), len(omega)), np.nan)
    solver = solver_for(block, output, transient=transient, averages=averages, max_steps=max_steps)
    a_order = np.argsort(A)[::-1]  # downwards: large motions are the simple ones
    w_order = np.argsort(omega)
    along_a = len(A) > 1
    for line in w_order if along_a else [0]:
        solver.forget()
        row, column = (a_order, np.full(len(A), line)) if along_a else (np.zeros(len(omega), int), w_order)
        solver.line(A[row], omega[column], harmonics, regime, residual, row, column)
    return harmonics, regime, residual


_kept = threading.local()


def solver_for(block, output=None, **options) -> OrbitSolver:
    """Return a solver, the one of the last call in this thread where it is for an equal block."""
    key = (block, output, tuple(sorted(options.items())))
    last = getattr(_kept, "last", None)
    if last is None or last[0][0] is not block and not (isinstance(block, Mechanism) and last[0][0] == block) or last[0][1:] != key[1:]:
        last = _kept.last = (key, OrbitSolver(block, output, **options))
    return last[1]


class OrbitSolver:
    """Finds forced periodic orbits of one block, each started from the one before."""

    def __init__(self, block, output=None, *, transient=4, averages=64, max_steps=200_000):
        self.transient, self.averages, self.max_steps = int(transient), max(int(averages), _BLOCKS), int(max_steps)
        self.block = block
        if block.ninputs != 1:
            raise ValueError(
                f"a describing function needs one input; {block.name} has {block.ninputs}. Fix the others inside the block."
            )
        self.row = _row(block, output)
        self.delay, self.offset = 0.0, 0.0
        self.engine = Engine(self._without_transparent(block))
        prog = self.engine.program
        if np.any(prog.nodes[:, layout.KIND] == layout.SAMPLED):
            raise ValueError(
                f"forced periodic orbits need continuous time; {block.name} holds a sampled system, whose ticks have no "
                "common period with the forcing. Take its continuous equivalent here and simulate the sampled loop."
            )
        pointers.raised.clear()
        self.symmetries = s = find_symmetries(self.engine, block)
        self._check(s)
        self.symmetric = s.odd
        self.shot = make_shot(self.engine, s, self.row + 1)
        self.mechanisms = [n for n in prog.nodes if n[layout.KIND] == layout.MECHANISM]
        self.inertia = sum(
            prog.par[n[layout.PAR] + b] for n in self.mechanisms for b in range(prog.ints[n[layout.AUX]])
        ) or 1.0  # fmt: skip
        self.free_row = self._row_is_free(s)
        self.quantized = bool(np.any(prog.nodes[:, layout.KIND] == layout.QUANTIZER))
        self.gap = any(prog.par[n[layout.PAR] + layout.P_GAP] > 0 for n in self.mechanisms)
        self.contacts = self.gap or any(prog.ints[n[layout.AUX] + layout.A_STOP] == 1 for n in self.mechanisms)
        self.previous: State | None = None
        self.forget()

    def _without_transparent(self, block):
        """Delays turn the phase, offset and drift move the mean: all exactly, outside the simulation."""
        if isinstance(block, ct.TransferFunction):
            return ct.ss(block)
        if not isinstance(block, Mechanism):
            return block
        rounded = any(e.id == "sensor_quantization" for e in block.effects)
        kept = []
        for effect in block.effects:
            if effect.id == "input_delay":
                self.delay += effect.delay
            elif effect.id == "sensor_delay":
                self.delay += effect.delay if self.row == 0 else 0.0
            elif effect.id == "sensor_offset" and not rounded:
                self.offset += effect.offset if self.row == 0 else 0.0
            elif effect.id != "drift":
                kept.append(effect)
        return type(block)._make(block._values, kept, block.measured) if len(kept) < len(block.effects) else block

    def _check(self, s):
        if not s.autonomous:
            raise ValueError(
                f"a describing function needs laws that do not depend on time itself; those of {self.block.name} do. "
                "Make the time-dependent signal an input."
            )
        if pointers.raised and not np.any(np.isfinite(self._rates(np.zeros(self.engine.nstates)))):
            raise user_error(self.block, pointers.raised[-1])
        pointers.raised.clear()

    def _rates(self, x, force=0.0):
        return Probe(self.engine).at(x, force)[0]

    def _row_is_free(self, s):
        """Whether the output described shifts with a free position."""
        probe, x = Probe(self.engine), np.zeros(self.engine.nstates)
        at_zero = probe.at(x, 0.0)[2][self.row]
        return any(probe.at(x + 3.7 * d, 0.0)[2][self.row] != at_zero for d in s.shifts)

    def forget(self):
        """Start the next point from rest."""
        self.previous = None
        self.shot.jacobian[:] = np.nan
        self.shot.size[:] = 0.0

    # --- lines and points -----------------------------------------------------------------------------------

    def line(self, A, omega, harmonics, regime, residual, row, column):
        """Solve consecutive points, compiled as long as they close, one by one where they do not."""
        orders, n = harmonics.shape[-1] - 1, len(A)
        out = np.zeros((n, self.row + 1, orders + 1), complex)
        ends, miss = np.zeros((n, 2, self.row + 1)), np.zeros(n)
        kinds, still = np.zeros(n, np.int64), np.zeros(n, np.int64)
        samples, scratch = harmonic_drive([[0.0, 0.0]], 1.0), np.zeros((1, 2), complex)
        power, past = self.symmetries.power, np.zeros((4, max(self.engine.nstates, 1)))
        p = 0
        while p < n:
            # the point by itself: its start, its regime, its checks
            harmonics[row[p], column[p]], name, residual[row[p], column[p]] = self.solve(A[p], omega[p], orders)
            regime[row[p], column[p]] = _CODE[name]
            p += 1
            if p == n or self.previous is None or not self.simple:
                continue
            units = A[p - 1] / omega[p - 1] ** power
            past[0, : len(units)] = self.previous.x / units
            past[3, 0] = 0.02
            mode = self.previous.mode.copy()
            done, _, _ = sweep(
                self.shot, samples, scratch, A[p:], omega[p:], power, self.inertia, past, mode, 1, self.mirrored, RTOL,
                self._hmax(orders), self.max_steps, out[p:], ends[p:], miss[p:], kinds[p:], still[p:],
            )  # fmt: skip
            self._raise_if_raised()
            for q in range(p, p + done):
                self._aim(A[q], omega[q])
                y = self._coefficients(out[q, self.row], ends[q, :, self.row], 1, self.mirrored)
                self.kinds, self.still = int(kinds[q]), bool(still[q])
                name = self._name(y, ends[q, :, self.row], miss[q])
                if name in ("stuck", "free"):  # these need a second look
                    done = q - p
                    break
                harmonics[row[q], column[q]] = self._finished(y, name)
                regime[row[q], column[q]], residual[row[q], column[q]] = _CODE[name], miss[q]
            if done:
                p += done
                self.previous = State(0.0, past[0, : len(units)] * A[p - 1] / omega[p - 1] ** power, mode.copy())

    def solve(self, A: float, omega: float, orders: int):
        """Return (Y_k/A for k = 0..orders, regime name, residual)."""
        self._aim(A, omega)
        try:
            y, name, residual = self._answer(orders)
        except _OutOfWork as stop:
            self.previous, self.simple = None, False
            return np.full(orders + 1, np.nan + 0j), stop.regime, np.nan
        return self._finished(y, name), name, residual

    # --- the search -----------------------------------------------------------------------------------------

    def _aim(self, A, omega):
        self.A, self.omega, self.period, self.budget = A, omega, 2 * np.pi / omega, self.max_steps
        self.drive = harmonic_drive([[0.0, A]], omega)
        self.atol = shooting.floor(self.symmetries.power, self.inertia, A, omega)

    def _hmax(self, orders):
        """Longest step in periods: ten quadrature nodes a step must hold the highest harmonic.

        Impacts are located on the interpolant of a step, which is less exact than its end.
        """
        return min(1 / 16 if self.contacts else 1 / 8, 9 / 8 / orders)

    def _answer(self, orders):
        """Coefficients Y_k, regime and residual at the present aim."""
        self.mirrored, self.simple = self.symmetric, True
        state = self._start(self.A) if self.previous is None else self.previous.copy()
        orbit = self._periodic(state, orders=orders) if self.previous is not None else None
        if orbit is None:
            orbit = self._periodic(self._follow(state, self.transient), orders=orders)
        if orbit is None:
            state = self._follow(state, 30)
            orbit = self._periodic(state, orders=orders)
        if orbit is None and self.symmetric:
            self.mirrored = False
            state = self._follow(self._nudged(state), 40)
            orbit = self._periodic(state, orders=orders)
        if self.gap and orbit is not None and not self.kinds & _TOUCH:
            mirrored = self.mirrored
            touching, state = self._touching(orders)
            if touching is not None or state is not None:
                orbit = touching
            else:
                self.mirrored = mirrored
                orbit = self._periodic(orbit[0], orders=orders)
        if orbit is None:
            return self._unperiodic(state, orders)
        self.previous = orbit[0]
        y = self._coefficients(self.integrals, self.ends, 1, self.mirrored)
        return y, self._name(y, self.ends, orbit[1]), orbit[1]

    def _start(self, A):
        """At rest, a joint off its faces; the sizes of the states from the motion of a free inertia."""
        n = self.engine.nstates
        y = np.zeros(n)
        for node in self.mechanisms:
            if self.engine.program.ints[node[layout.AUX]] == 2:
                y[node[layout.X] + 2] = 0.3 * self.engine.program.par[node[layout.PAR] + layout.P_GAP]
        state = self._state(y)
        self._resize(A)
        return state

    def _resize(self, A):
        n = self.engine.nstates
        self.shot.space[6][:] = 1e-3 * A / self.inertia / self.omega ** self.symmetries.power if self.mechanisms else 0.0
        self.shot.size[:n] = 0.0
        self.shot.scale[:] = 1e-13
        self.shot.jacobian[:] = np.nan

    def _state(self, y, mode=None):
        """State at coordinates y."""
        x, mode = np.zeros(len(y)), self.engine._modes.copy() if mode is None else mode.copy()
        shooting.place(self.shot, np.array(y, float), x, mode)
        return State(0.0, x, mode)

    def _nudged(self, state):
        """The state a little off: no motion stays on a repelling orbit by the grace of rounding."""
        y = self.symmetries.transform @ state.x
        y[self.symmetries.free] += 1e-3 * self.shot.size[self.symmetries.free]
        return self._state(y, state.mode)

    def _follow(self, state, periods, rtol=_COARSE):
        """The state after some periods (twice as many shots where mirrored)."""
        state = state.copy()
        for _ in range(periods * 2 if self.mirrored else periods):
            self._shoot(state, rtol)
        return state

    def _shoot(self, state, rtol=RTOL, periods=1, spectrum=None):
        """One shot of the state, in place."""
        shot = self.shot
        orders = 1 if spectrum is None else spectrum.shape[1] - 1
        if not shot.clock[2] > 0.0 or shot.clock[2] > 0.1 * self.period:
            shot.clock[2] = 0.02 * self.period
        reason = shoot(
            shot, self.drive, self._span(periods), state.x, state.mode, self.mirrored, rtol, self.atol,
            self._hmax(orders) * self.period, shot.no_spectrum if spectrum is None else spectrum, self.budget,
        )  # fmt: skip
        self.budget -= int(shot.clock[3])
        self._raise_if_raised()
        if reason != driver.DONE or self.budget <= 0 or not np.all(np.isfinite(state.x)):
            raise self._stopped(reason, state)
        return int(shot.tally[2])

    def _span(self, periods):
        return self.period / 2 if self.mirrored else periods * self.period

    def _periodic(self, state, periods=1, orders=9):
        """Newton on the shot; (state, mismatch) of an attracting orbit, or None; its integrals are kept."""
        state, shot = state.copy(), self.shot
        spectrum = np.zeros((self.row + 1, orders + 1), complex)
        shot.jacobian[:] = np.nan
        shot.clock[2] = 0.02 * self.period
        outcome, miss = close_orbit(
            shot, self.drive, self._span(periods), state.x, state.mode, self.mirrored, RTOL, self.atol,
            self._hmax(orders) * self.period, spectrum, self.budget, 24, False,
        )  # fmt: skip
        self.budget -= int(shot.clock[3]) * 4
        self._raise_if_raised()
        if outcome == SPENT or outcome == shooting.FAILED:
            raise self._stopped(driver.STEPS if outcome == SPENT else int(shot.tally[4]), state)
        if outcome != CLOSED:
            return None
        gained = np.abs(shot.trial[1][self.symmetries.inertial]) if not self.mirrored else np.zeros(0)
        if np.max(gained, initial=0.0) > 1e-6 * self.A / (self.inertia * self.omega):
            raise _OutOfWork(Status.DIVERGED)  # nothing ties the mechanism to the ground, and something pushes it
        if self.quantized:  # the harmonics of the centred motion
            self._shoot(state.copy(), RTOL, periods, spectrum)
        self.integrals, self.ends = spectrum[self.row], shot.ends[:, self.row].copy()
        self.kinds, self.still = int(shot.tally[2]), bool(shot.tally[5])
        return state, miss

    def _touching(self, orders):
        """An orbit whose bodies touch, for a block with a gap that was found swinging freely within it.

        A motion without contact coexists with others at moderate force and is what a centred start leads to. Returns
        the orbit or None, and a state from which the bodies keep touching or None.
        """
        prog, keeps = self.engine.program, None
        node = next(m for m in self.mechanisms if prog.par[m[layout.PAR] + layout.P_GAP] > 0)
        at, gap = node[layout.X], prog.par[node[layout.PAR] + layout.P_GAP]
        speed = gap * self.omega + self.A / (prog.par[node[layout.PAR] + layout.P_M0 + 1] * self.omega)
        for face, leaving in ((0.0, 0.0), (0.0, 0.7), (1.0, -0.4), (0.0, 1.3), (1.0, -0.2)):
            self.mirrored = self.symmetric
            y = np.zeros(self.engine.nstates)
            y[at + 2], y[at + 3] = face * gap, leaving * speed
            self._resize(self.A)
            state = self._follow(self._state(y), 20)
            if not self.shot.tally[2] & _TOUCH:
                continue
            orbit = self._periodic(state, orders=orders)
            if orbit is None and self.symmetric:
                self.mirrored = False
                state = self._follow(self._nudged(state), 30)
                if not self.shot.tally[2] & _TOUCH:
                    continue
                orbit = self._periodic(state, orders=orders)
            if orbit is not None and self.kinds & _TOUCH:
                return orbit, state
            if orbit is None:
                keeps = state if keeps is None else keeps
        return None, keeps

    def _unperiodic(self, state, orders):
        """Look for a longer period; else average over many."""
        self.mirrored, self.simple = False, False
        state = self._follow(state, 40, RTOL)
        s, trail = self.symmetries, []
        for _ in range(2 * _LONGEST + 1):
            trail.append(s.transform @ state.x)
            self._shoot(state)
        y = np.array(trail)
        self._stop_if_running_away(y)
        size = np.where(self.shot.size > 0, self.shot.size, 1.0)
        self.previous = state
        for periods in range(1, _LONGEST + 1):
            gap = (y[-1] - y[-1 - periods]) / size
            gap -= np.where(s.wrap > 0, np.round(gap * size / np.where(s.wrap > 0, s.wrap, 1)) * s.wrap / size, 0)
            if np.max(np.abs(gap[s.free]), initial=0.0) < 1e-3:
                orbit = self._periodic(state, periods, orders)
                if orbit is not None:
                    self.previous, self.simple = orbit[0], periods == 1
                    c = self._coefficients(self.integrals, self.ends, periods, False)
                    name = "subharmonic" if periods > 1 else self._name(c, self.ends, orbit[1])
                    return c, name, orbit[1]
        length = self.averages // _BLOCKS
        parts, touched = [], 0
        for _ in range(_BLOCKS):
            spectrum = np.zeros((self.row + 1, orders + 1), complex)
            for _ in range(length):
                part = np.zeros_like(spectrum)
                touched |= self._shoot(state, RTOL, 1, part) & _TOUCH
                spectrum += part / length
                parts_ends = self.shot.ends[:, self.row].copy()
                spectrum[self.row] += self._ramp(parts_ends, orders, 1) * self.period / 2 / length
            parts.append(self._coefficients(spectrum[self.row], np.zeros(2), 1, False))
        parts = np.array(parts)
        mean = parts.mean(axis=0)
        if self.gap and not touched:
            return mean, "free", 0.0
        error = np.std(parts[:, 1], ddof=1) / np.sqrt(_BLOCKS)
        return mean, "aperiodic", float(2 * error / max(abs(mean[1]), 1e-300))

    def _stop_if_running_away(self, y):
        """Raise where a state grows out of all bounds, or a speed steadily: nothing holds the mass back."""
        half = len(y) // 2
        if np.max(np.abs(y[-1])) > 100 * np.max(np.abs(y[half])) > 1e4 * np.max(np.abs(y[0])):
            raise _OutOfWork(Status.DIVERGED)
        for i in np.flatnonzero(self.symmetries.power == 1):
            early, late = y[half, i] - y[0, i], y[-1, i] - y[-1 - half, i]
            spread = np.max(np.abs(np.diff(y[:, i]) - early / half))
            if abs(early) > 1e-3 * self.A / (self.inertia * self.omega) and abs(late / early - 1) < 1e-3 and spread < 0.5 * abs(early / half):
                raise _OutOfWork(Status.DIVERGED)

    # --- what was found ---------------------------------------------------------------------------------------

    def _coefficients(self, integrals, ends, periods, mirrored):
        """Fourier coefficients from the integrals of a shot, free of a steady drift and of a free mean."""
        k = np.arange(len(integrals))
        if mirrored:
            y = 4 / self.period * integrals
            center = (ends[0] + ends[1]) / 2
            # the integral of a constant over half a period is 2 / (j k omega)
            y[1::2] -= 4 / self.period * 2 * center / (1j * k[1::2] * self.omega)
            y[0::2] = 0.0
            y[0] = center
        else:
            y = integrals * 2 / (periods * self.period)
            y[0] /= 2
            y += self._ramp(ends, len(integrals) - 1, periods)
        if self.free_row:
            y[0] = 0.0
        return y

    def _ramp(self, ends, orders, periods):
        """What takes the ramp between the two ends out of the coefficients."""
        k, drift = np.arange(1, orders + 1), ends[1] - ends[0]
        return np.concatenate([[-drift / 2], -1j * drift / (np.pi * k * periods)])

    def _turned(self, y):
        """Delays turn the phase of every harmonic."""
        y = y * np.exp(-1j * np.arange(len(y)) * self.omega * self.delay)
        y[0] += 0.0 if self.free_row else self.offset
        return y

    def _finished(self, y, name):
        return np.full(len(y), np.nan + 0j) if name == "stuck" else self._turned(y) / self.A

    def _name(self, y, ends, miss):
        """Regime of a motion of one period."""
        s, kinds = self.symmetries, self.kinds
        if self.still and not kinds & ~(_BIT["corner"] | _BIT["switch"]):
            return "stuck"
        if self.gap and not kinds & _TOUCH:
            return "free"
        drift = abs(ends[1] - ends[0]) if not self.mirrored else 0.0
        if drift > 1e-6 * abs(y[1]) and (s.wrap.any() or (s.shifts and not s.inertial.any())):
            return "drifting"
        even = np.max(np.abs(y[2::2]), initial=0.0)
        if self.symmetric and even > max(1e-7, 1e3 * miss) * abs(y[1]):
            return "asymmetric"
        rigid = kinds & (_BIT["impact"] | _BIT["stop"])
        if kinds & _BIT["stop contact"] or (kinds & _BIT["contact"] and not self._elastic()):
            return "contact"
        if rigid:
            return "impact"
        if kinds & (_BIT["stick"] | _BIT["breakaway"]):
            return "stick-slip"
        return "slip" if kinds & _BIT["reversal"] else "smooth"

    def _elastic(self):
        prog = self.engine.program
        return any(prog.ints[n[layout.AUX] + layout.A_JOINT] == layout.J_ELASTIC for n in self.mechanisms)

    # --- how a search can fail --------------------------------------------------------------------------------

    def _raise_if_raised(self):
        if pointers.raised:
            error = pointers.raised[0]
            pointers.raised.clear()
            raise user_error(self.block, error)

    def _stopped(self, reason, state):
        """What to raise for a run that ended early."""
        if reason in (driver.STEPS, driver.DONE, driver.CHATTER, driver.FULL):
            return _OutOfWork(Status.WORK_LIMIT)
        x = state.x
        if np.all(np.isfinite(x)) and np.max(np.abs(x), initial=0.0) < 1e50:
            force = self.A * np.cos(self.omega * self.shot.clock[0])
            with np.errstate(all="ignore"):
                slope = self._rates(x, force)
                ahead = self._rates(x + slope * 1e-6 * self.period, force)
            pointers.raised.clear()
            if not (np.all(np.isfinite(slope)) and np.all(np.isfinite(ahead))):
                return user_error(self.block, ValueError(f"a law returned NaN or inf near the state {x}"))
        return _OutOfWork(Status.DIVERGED)


def user_error(block, error) -> RuntimeError:
    """Return the one error for a law that raises or returns NaN."""
    wrapped = RuntimeError(f"{Status.USER_ERROR} (block {block.name}: {error!r})")
    wrapped.__cause__ = error
    return wrapped


class _OutOfWork(Exception):
    def __init__(self, status):
        super().__init__(str(status))
        self.status = status
        self.regime = "diverged" if status is Status.DIVERGED else "work limit"


def _row(block, output) -> int:
    labels = list(block.output_labels)
    if output is None:
        return 0
    if isinstance(output, int | np.integer) and 0 <= output < len(labels):
        return int(output)
    if output in labels:
        return labels.index(output)
    raise ValueError(f"output must be one of {', '.join(labels)}; got {output!r}.")
