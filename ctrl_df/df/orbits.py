"""Forced periodic orbits on the event engine: N(a, omega) of anything that has no closed form.

The block is driven by ``A cos(omega t)`` and the state that repeats after one period (after half of one, mirrored,
where block and motion are odd) is found by Newton's method on the engine's period map, not by waiting for transients.
Where that fails, or finds an orbit that is unstable, the motion is followed and named: a longer period
(``subharmonic``), or none at all (``aperiodic``, with harmonics averaged over many periods).
"""

from __future__ import annotations

import numpy as np

from ..blocks.mechanism import Mechanism
from ..simulate.engine import Engine, harmonic_drive
from ..simulate.layout import EVENT_KINDS
from ..status import Status

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
)
_CODE = {name: i for i, name in enumerate(ORBIT_REGIMES)}

RTOL = 1e-10
_ODD = {
    "viscous", "coulomb", "stiction", "stribeck", "bristle", "quadratic_drag", "linear_spring", "cubic_spring",
    "input_saturation", "input_dead_zone", "input_gain", "input_lag", "load_friction", "compliance", "hard_stop",
}  # fmt: skip
_TRANSPARENT = {"input_delay", "sensor_delay", "sensor_offset", "drift"}
_ANCHORED = {"linear_spring", "cubic_spring", "position_ripple", "hard_stop"}


def orbit_family(block, A, omega, *, orders=9, output=None, transient=4, averages=64, max_steps=200_000):
    """Harmonics of the steady motion on a grid, by forced periodic orbits.

    Parameters
    ----------
    block : ct.NonlinearIOSystem
        One input.
    A, omega : (na,), (nw,) arrays
        Amplitudes and frequencies [rad/s], > 0.
    orders : int
        Highest harmonic.
    output : str
        Output described, the first by default.
    transient : int
        Periods followed before the first Newton step.
    averages : int
        Periods averaged where the motion has no period.
    max_steps : int
        Bound on the work of one point, in integration steps.

    Returns
    -------
    harmonics : (na, nw, orders + 1) complex
        Y_k / A; index 0 the mean.
    regime : (na, nw) int
        Index into `ORBIT_REGIMES`.
    residual : (na, nw)
        Mismatch after the period relative to the size of the orbit; for averaged motions the relative change of the
        fundamental between the halves of the average.
    """
    A, omega = np.atleast_1d(np.asarray(A, float)), np.atleast_1d(np.asarray(omega, float))
    harmonics = np.full((len(A), len(omega), orders + 1), np.nan + 0j)
    regime = np.zeros((len(A), len(omega)), np.int8)
    residual = np.full((len(A), len(omega)), np.nan)
    solver = OrbitSolver(block, output, transient=transient, averages=averages, max_steps=max_steps)
    for k, w in enumerate(omega):
        solver.forget()
        for i in np.argsort(A)[::-1]:  # downwards: large motions are the simple ones
            harmonics[i, k], name, residual[i, k] = solver.solve(A[i], w, orders)
            regime[i, k] = _CODE[name]
    return harmonics, regime, residual


class OrbitSolver:
    """Finds forced periodic orbits of one block, each started from the one before."""

    def __init__(self, block, output=None, *, transient=4, averages=64, max_steps=200_000):
        self.transient, self.averages, self.max_steps = transient, averages, max_steps
        self.delay_in, self.delay_out = 0.0, 0.0
        self.symmetric, self.anchored, self.core = False, True, None
        row = 0 if output is None else block.output_labels.index(output) if isinstance(output, str) else output
        if isinstance(block, Mechanism):
            block = self._without_transparent(block, row)
            self.core = block.core
            ids = {e.id for e in block.effects}
            centered = all(getattr(e, "center", 0.0) == 0.0 and getattr(e, "lower", None) is None for e in block.effects)
            self.symmetric = ids <= _ODD and centered
            known = _ODD | {"backlash", "constant_force", "asymmetric_coulomb", "asymmetric_viscous"}
            self.anchored = bool(ids & _ANCHORED) or not ids <= known
        self.row = row
        self.engine = Engine(block)
        self.block = block
        self.nothing = None
        self.previous = None
        self._coordinates()

    def _without_transparent(self, block, row):
        """Delays turn the phase, offset and drift do not enter: all exactly, outside the simulation."""
        for effect in block.effects:
            if effect.id == "input_delay":
                self.delay_in += effect.delay
            elif effect.id == "sensor_delay" and row == 0:
                self.delay_out += effect.delay
        return type(block)._make(
            block._values, [e for e in block.effects if e.id not in _TRANSPARENT], block.measured
        )

    def _coordinates(self):
        """States that must repeat: all, but for free positions; a two-mass block by load, stretch and speeds."""
        n = self.engine.nstates
        self.transform = np.eye(n)
        free = np.ones(n, bool)
        if self.core is not None:
            if not self.anchored:
                free[0] = False
            if self.core.bodies == 2:
                self.transform[2, 0] = -1.0  # stretch x_motor - x
                if self.core.joint == "rigid":
                    self.transform[3, 1] = -1.0
                    free[2:4] = False
        self.inverse = np.linalg.inv(self.transform)
        self.free = np.flatnonzero(free)

    def forget(self):
        """Start the next point from rest."""
        self.previous = None

    # --- one point ------------------------------------------------------------------------------------------

    def solve(self, A: float, omega: float, orders: int):
        """Return (Y_k/A for k = 0..orders, regime name, residual)."""
        self.omega, self.period = omega, 2 * np.pi / omega
        self.drive = harmonic_drive([[0.0, A]], omega)
        self.flipped = harmonic_drive([[0.0, -A]], omega)
        self.budget = self.max_steps
        state = self.previous.copy() if self.previous is not None else self._start(A)
        state.time = 0.0
        state.fresh = True
        try:
            orbit = self._periodic(state)
            if orbit is None:
                state = self._follow(state, 30)
                orbit = self._periodic(state)
            if orbit is not None:
                state, mismatch = orbit
                y, kinds, moved = self._harmonics(state, A, orders, 1)
                self.previous = state
                return y, self._name(kinds, moved, y, 1), mismatch
            return self._unperiodic(state, A, orders)
        except _OutOfWork as stop:
            y = np.full(orders + 1, np.nan + 0j)
            return y, "diverged" if stop.status is Status.DIVERGED else "work limit", np.nan

    def _start(self, A):
        """Near the orbit of the bare mass: velocity in quadrature with the force, joint a little off its faces."""
        x = np.zeros(self.engine.nstates)
        if self.core is not None:
            if self.core.gap > 0:
                x[2] = 0.3 * self.core.gap
            elif self.core.joint is None and not self.anchored:
                pass
        return self.engine.start(x)

    def _run(self, state, t_end, drive, **options):
        run = self.engine.run(state, t_end, drive, rtol=RTOL, max_step=self.period / 8, log=1, max_steps=self.budget, **options)
        self.budget -= run.steps
        if not run.status.ok or self.budget <= 0 or not np.all(np.isfinite(run.state.x)):
            raise _OutOfWork(run.status if not run.status.ok else Status.WORK_LIMIT)
        return run

    def _map(self, state):
        """State after one period, or mirrored after half of one; time set back to zero."""
        if not self.symmetric:
            after = self._run(state, self.period, self.drive).state
            after.time = 0.0
            return after
        after = self._run(state, self.period / 2, self.drive).state
        after.time = 0.0
        after.x = -after.x
        after.mode = after.mode.copy()
        self._mirror_modes(after.mode)
        after.fresh = True
        return after

    def _mirror_modes(self, mode):
        mode[:] = self.engine._modes
        self._keep_contacts = True

    def _follow(self, state, periods):
        for _ in range(periods):
            state = self._map(state)
        return state

    def _periodic(self, state):
        """Newton on the period map; (state, mismatch) of a stable orbit, or None."""
        state = self._follow(state, self.transient if self.previous is None else 2)
        if self.free.size == 0:
            return state, 0.0
        size = None
        best = np.inf
        jacobian = None
        for iteration in range(12):
            after = self._map(state)
            y0, y1 = self.transform @ state.x, self.transform @ after.x
            step = y1 - y0
            size = self._size(state, after) if size is None else np.maximum(size, self._size(state, after))
            mismatch = np.max(np.abs(step[self.free]) / size[self.free])
            if mismatch < 1e-11 or (mismatch < 1e-9 and mismatch >= 0.5 * best):
                return (after, mismatch) if jacobian is None or self._attracts(jacobian) else None
            if mismatch > 0.7 * best:
                if mismatch < 1e-8:
                    return (after, mismatch) if self._attracts(jacobian) else None
                jacobian = None
                if iteration > 6:
                    return None
            best = min(best, mismatch)
            if jacobian is None:
                jacobian = self._jacobian(state, after, size)
            try:
                change = np.linalg.solve(np.eye(len(self.free)) - jacobian, step[self.free])
            except np.linalg.LinAlgError:
                return None
            if not np.all(np.isfinite(change)) or np.any(np.abs(change) > 3 * size[self.free]):
                state = after
                jacobian = None
                continue
            y0 = y0.copy()
            y0[self.free] += change
            state = self._moved(state, y0)
        return None

    def _attracts(self, jacobian):
        return bool(np.max(np.abs(np.linalg.eigvals(jacobian))) < 1.0 + 1e-6)

    def _size(self, state, after):
        """Size of every coordinate over the orbit; speeds set the scale of positions and the reverse."""
        y = np.maximum(np.abs(self.transform @ state.x), np.abs(self.transform @ after.x))
        if self.core is not None:
            speed = np.max(y[1 : 2 * self.core.bodies : 2])
            speed = max(speed, np.abs(self.drive.harmonics[0, 1]) / (sum(self.core.masses) * self.omega))
            y[1 : 2 * self.core.bodies : 2] = speed
            y[0 : 2 * self.core.bodies : 2] = np.maximum(y[0 : 2 * self.core.bodies : 2], speed / self.omega)
        floor = np.max(y) * 1e-6
        return np.maximum(y, floor if floor > 0 else 1.0)

    def _moved(self, state, y):
        """The state at other coordinates, in the open modes a moved state may have."""
        new = state.copy()
        new.x = self.inverse @ y
        new.fresh = True
        new.mode = self.engine._modes.copy()
        core = self.core
        if core is not None:
            if core.joint == "impact":
                new.x[2] = new.x[0] + min(max(new.x[2] - new.x[0], 0.0), core.gap)
            if core.stop is not None:
                low, high = core.stop.span
                b = 2 * core.driven
                new.x[b] = min(max(new.x[b], low), high)
        return new

    def _jacobian(self, state, after, size):
        """One-sided differences of the map over its free coordinates."""
        y0 = self.transform @ state.x
        y1 = (self.transform @ after.x)[self.free]
        columns = []
        for i in self.free:
            h = 1e-6 * size[i]
            y = y0.copy()
            y[i] += h if y0[i] <= 0 else -h
            moved = self._moved(state, y)
            h = (self.transform @ moved.x)[i] - y0[i]
            columns.append(((self.transform @ self._map(moved).x)[self.free] - y1) / h if h else 0 * y1)
        return np.array(columns).T

    # --- what was found ---------------------------------------------------------------------------------------

    def _harmonics(self, state, A, orders, periods):
        """Fourier coefficients over whole periods, free of the mean and of a steady drift."""
        spectrum = np.zeros((self.engine.noutputs, orders + 1), complex)
        span = periods * self.period
        first = state.copy()
        first.time = 0.0
        first.fresh = True
        run = self.engine.run(
            first, span, self.drive, np.array([0.0, span]), rtol=RTOL, max_step=self.period / 8, spectrum=spectrum,
            omega=self.omega, max_steps=max(self.budget, 1000),
        )  # fmt: skip
        if not run.status.ok:
            raise _OutOfWork(run.status)
        self.budget -= run.steps
        y = spectrum[self.row] * 2 / span
        k = np.arange(1, orders + 1)
        drift = run.outputs[-1, self.row] - run.outputs[0, self.row]
        y[0] /= 2
        y[0] -= drift / 2
        # the ramp drift t / span has the coefficients j drift / (pi k periods)
        y[1:] -= 1j * drift / (np.pi * k * periods)
        if self.core is not None and not self.anchored and self.row in (0, 2):
            y[0] = 0.0  # a free mass has no mean position of its own
        turn = np.exp(-1j * np.arange(orders + 1) * self.omega * (self.delay_in + self.delay_out))
        moved = bool(np.any(run.events[0] >= 0)) or self._moving(first, run)
        kinds = {EVENT_KINDS[i] for i in np.unique(run.events[2])}
        return y * turn / A, kinds, moved

    def _moving(self, first, run):
        return bool(np.any(np.abs(run.state.x) > 0) or np.any(np.abs(first.x) > 0))

    def _name(self, kinds, moved, y, periods):
        if periods > 1:
            return "subharmonic"
        if self.core is None:
            base = "smooth"
        elif not moved or (kinds <= {"corner"} and abs(y[1]) == 0.0):
            return "stuck"
        elif kinds & {"contact", "stop contact"} and self.core.joint != "elastic":
            base = "contact"
        elif kinds & {"impact", "stop"}:
            base = "impact"
        elif kinds & {"stick", "breakaway"}:
            base = "stick-slip"
        elif "reversal" in kinds:
            base = "slip"
        else:
            base = "smooth"
        even = np.max(np.abs(y[2::2]), initial=0.0)
        odd_law = self.symmetric or (self.core is not None and {e.id for e in self.block.effects} <= _ODD | {"backlash"})
        if odd_law and even > 1e-6 * abs(y[1]):
            return "asymmetric"
        return base

    def _unperiodic(self, state, A, orders):
        """Look for a longer period; else average over many."""
        was_symmetric, self.symmetric = self.symmetric, False
        try:
            state.fresh = True
            state = self._follow(state, 20)
            trail = [state]
            for _ in range(8):
                trail.append(self._map(trail[-1]))
            size = self._size(trail[0], trail[-1])
            y = [(self.transform @ s.x)[self.free] / size[self.free] for s in trail]
            self.previous = trail[-1]
            for periods in range(1, 9):
                gap = np.max(np.abs(y[-1] - y[-1 - periods]))
                if gap < 1e-5:
                    c, kinds, moved = self._harmonics(trail[-1], A, orders, periods)
                    return c, self._name(kinds, moved, c, periods), gap
            half = self.averages // 2
            first, _, _ = self._harmonics(trail[-1], A, orders, half)
            state = self._run(trail[-1], half * self.period, self.drive).state
            second, _, _ = self._harmonics(state, A, orders, half)
            mean = (first + second) / 2
            return mean, "aperiodic", float(abs(first[1] - second[1]) / max(abs(mean[1]), 1e-300))
        finally:
            self.symmetric = was_symmetric


class _OutOfWork(Exception):
    def __init__(self, status):
        super().__init__(str(status))
        self.status = status


