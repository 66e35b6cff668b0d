"""Forced periodic orbits on the event engine: N(a, omega) of anything that has no closed form.

The block is driven by ``A cos(omega t)`` and the state that repeats after one period (after half of one,
mirrored, where the laws are odd) is found by Newton's method on the engine's period map, not by waiting for
transients. Where that fails, or finds an orbit that repels, the motion is followed and named: not half-wave
symmetric (``asymmetric``), repeating after several periods (``subharmonic``), or not at all (``aperiodic``,
averaged).
"""

from __future__ import annotations

import threading
from dataclasses import dataclass

import numpy as np

from ...blocks.mechanism import Mechanism
from ...simulate.engine import State
from ..thresholds import AVERAGES, BLOCKS, ORBIT_STEPS, TRANSIENT
from .driven_block import DrivenBlock
from .forced_map import Force, ForcedMap, OutOfWork, Work
from .fourier import even_share, fourier, shifted
from .line import Line
from .motion import Start
from .point import steady_motion
from .regimes import CODE, regime_of


def orbit_family(
    block, A, omega, *, orders=9, output=None, transient=TRANSIENT, averages=AVERAGES, max_steps=ORBIT_STEPS
):
    """Harmonics of the steady motion on a grid, by forced periodic orbits.

    Each point starts from its neighbour, from large amplitudes downwards; where motions coexist the result
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
        error of the fundamental, relative. NaN where there is no response.

    Raises
    ------
    ValueError
        A block with several inputs, with time-dependent laws, or in discrete time.
    RuntimeError
        A law raised or returned NaN; carries the exception.
    """
    A, omega = np.atleast_1d(np.asarray(A, float)), np.atleast_1d(np.asarray(omega, float))
    harmonics = np.full((len(A), len(omega), orders + 1), np.nan + 0j)
    regime = np.full((len(A), len(omega)), CODE["work limit"], np.int16)
    residual = np.full((len(A), len(omega)), np.nan)
    solver = solver_for(block, output, transient, averages, max_steps)
    a_order = np.argsort(A)[::-1]  # downwards: large motions are the simple ones
    w_order = np.argsort(omega)
    along_a, before = len(A) > 1, None
    for line in w_order if along_a else [0]:
        row, column = (a_order, np.full(len(A), line)) if along_a else (np.zeros(len(omega), int), w_order)
        before = solver.line(A[row], omega[column], harmonics, regime, residual, row, column, before)
    return harmonics, regime, residual


_kept = threading.local()


def solver_for(
    block, output=None, transient=TRANSIENT, averages=AVERAGES, max_steps=ORBIT_STEPS
) -> OrbitSolver:
    """Return a solver, the one of the last call in this thread where it is for an equal block."""
    key = (block, output, transient, averages, max_steps)
    last = getattr(_kept, "last", None)
    if last is not None and last[0][1:] == key[1:]:
        known = last[0][0]
        if known is block or (isinstance(block, Mechanism) and known == block):
            return last[1]
    solver = OrbitSolver(
        DrivenBlock(block, output), int(transient), max(int(averages), BLOCKS), int(max_steps)
    )
    _kept.last = (key, solver)
    return solver


@dataclass(frozen=True, eq=False)
class FirstOrbit:
    """The first orbit of a line, in units of the motion of a free inertia: the next line starts from it."""

    scaled: np.ndarray
    mode: np.ndarray
    asymmetric: bool


@dataclass(frozen=True, eq=False)
class LineEnds:
    """What a line has left for the next one: its first orbit, if it closed, and the start after its last."""

    first: FirstOrbit | None
    last: Start


@dataclass(frozen=True, eq=False)
class Point:
    """What was found at a point: Y_k / A for k = 0..orders, regime, residual, start of the next point."""

    harmonics: np.ndarray
    regime: str
    residual: float
    after: Start


@dataclass(frozen=True, eq=False)
class OrbitSolver:
    """Solves points and lines of a family, each started from the one before.

    Attributes
    ----------
    block : DrivenBlock
    transient, averages, max_steps : int
        As in `orbit_family`.
    """

    block: DrivenBlock
    transient: int = TRANSIENT
    averages: int = AVERAGES
    max_steps: int = ORBIT_STEPS

    def solve(self, A: float, omega: float, orders: int, start: Start | None = None) -> Point:
        """Solve one point, from rest where there is no start."""
        laws = self.block.laws_for(A, omega, None if start is None else start.laws)
        if start is None or laws is not start.laws:
            laws.reset()
            start = Start(laws)
        if laws.linear is not None:
            y, regime, x = laws.linear.response(A, omega, orders)
            state = None if x is None else State(0.0, x, self.block.engine.modes.copy())
            residual = np.nan if np.isnan(y[1]) else 0.0
            return Point(self._outer(y, A, omega, laws, regime), regime, residual, Start(laws, state))
        try:
            motion = steady_motion(
                self._forced_map(laws, A, omega),
                start,
                orders,
                transient=self.transient,
                averages=self.averages,
            )
        except OutOfWork as stop:
            return Point(np.full(orders + 1, np.nan + 0j), stop.regime, np.nan, Start(laws))
        y = self._outer(motion.coefficients, A, omega, laws, motion.regime)
        return Point(y, motion.regime, motion.residual, motion.after)

    def line(
        self, A, omega, harmonics, regime, residual, row, column, before: LineEnds | None = None
    ) -> LineEnds:
        """Solve consecutive points, compiled as long as they close, one by one where they do not.

        Point `p` goes to ``[row[p], column[p]]`` of the arrays; `before` are the ends of the line before.
        """
        orders, n, first = harmonics.shape[-1] - 1, len(A), None
        laws = self.block.laws_for(A[n // 2], omega[n // 2])
        if before is None or laws is not before.last.laws:
            laws.reset()
            start = Start(laws)
        else:
            start = before.last
            if start.state is not None and before.first is not None:  # it begins where this one does
                scaled, mode = before.first.scaled, before.first.mode
                state = State(0.0, scaled * A[0] / omega[0] ** self.block.power, mode)
                start = Start(laws, state, start.simple, before.first.asymmetric)
        line, p = Line(self.block, A, omega, orders), 0
        while p < n:
            # the point by itself: its start, its regime, its checks
            point = self.solve(A[p], omega[p], orders, start)
            harmonics[row[p], column[p]], residual[row[p], column[p]] = point.harmonics, point.residual
            regime[row[p], column[p]], start = CODE[point.regime], point.after
            state = start.state if start.simple else None
            if p == 0 and state is not None and point.regime not in ("stuck", "free"):
                scaled = state.x / (A[0] / omega[0] ** self.block.power)
                first = FirstOrbit(scaled, state.mode, start.asymmetric)
            p, closed = p + 1, state is not None
            forced_map = self._forced_map(start.laws, A[p - 1], omega[p - 1])
            while p < n and closed:
                done, start, again = self._line_from(
                    line, p, start, forced_map, harmonics, regime, residual, row, column
                )
                p += done
                closed = again
        return LineEnds(first, start)

    def _line_from(self, line, p, start, forced_map, harmonics, regime, residual, row, column):
        """Close points of a line from `p` on by compiled code.

        Returns how many need no second look, the start of the one after, and whether to go on from there
        over half periods.
        """
        A, omega, output = line.A, line.omega, self.block.row
        mirrored = start.laws.odd and not start.asymmetric
        found = line.close(p, start.state, start.laws, mirrored=mirrored, max_steps=self.max_steps)
        forced_map.reset_failed()
        if found.symmetric:
            start.laws.forget_jacobian()  # it is of shots twice as long
        some, done, symmetric = slice(p, p + found.count), found.count, found.symmetric
        integrals, ends = line.integrals[some, output], line.ends[some, :, output]
        y = fourier(integrals, ends, omega[some], mirrored=mirrored, free=start.laws.free_row)
        outer, even = self._shifted(y, omega[some], start.laws) / A[some, None], even_share(y)
        for q in range(p, p + found.count):
            name = regime_of(
                self.block, start.laws, mirrored=mirrored, kinds=int(line.kinds[q]),
                stuck=bool(line.stuck[q]), fundamental=y[q - p, 1], even=even[q - p],
                ends=line.ends[q, :, output], error=line.miss[q],
            )  # fmt: skip
            if name in ("stuck", "free"):  # these need a second look
                done, symmetric = q - p, False
                break
            harmonics[row[q], column[q]] = outer[q - p]
            regime[row[q], column[q]], residual[row[q], column[q]] = CODE[name], line.miss[q]
        if done:
            state = State(0.0, found.scaled * line.units(p + done - 1), found.mode.copy())
            start = Start(start.laws, state, True, start.asymmetric and not symmetric)
        return done, start, bool(done) and symmetric

    def _forced_map(self, laws, A, omega):
        return ForcedMap(self.block, laws, Force.of([0.0, A], omega), Work(self.max_steps))

    def _outer(self, y, A, omega, laws, regime):
        """Return Y_k / A with delays and offsets, NaN where nothing moves."""
        if regime == "stuck":
            return np.full(len(y), np.nan + 0j)
        return self._shifted(y, omega, laws) / float(abs(A))

    def _shifted(self, y, omega, laws):
        offset = 0.0 if laws.free_row else self.block.offset
        return shifted(y, omega, delay=self.block.delay, offset=offset)
