"""Newton's method damped: for orbits far off, or badly conditioned by light damping and slow transients.

A mechanism that loses a part d of its motion in a period needs 1/d periods to settle, and multiplies by 1/d
what a shot does not know exactly. The secant steps of `shooting` are made for the common case: they give up
where a step leads far, and integrate only as finely as that case needs. Here shots are finer, the Jacobian is
taken by central differences at every step, and a step of any length is made if the next one it promises is
shorter (Deuflhard's natural monotonicity test, which asks in the unknowns, not in the badly conditioned
mismatch). That costs several times as many shots: it is asked only where secant steps have failed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...simulate.engine import State
from ...thresholds import NEWTON_FAR
from ..thresholds import (
    CENTRAL,
    DAMPED_LEAST,
    DAMPED_SETTLED,
    DESCENT,
    FINE_LATE,
    NEUTRAL,
    RTOL_FINE,
    RTOL_SHOTS,
    SHORTENED,
    SHORTENED_BY,
    SQUARINGS_FINE,
    STEP_ENDS,
    STEP_GOOD,
    STEP_GOOD_LATE,
    STEP_POOR,
    STEP_REACH,
)
from .forced_map import ForcedMap, OutOfWork
from .kernel.newton import mismatch_of, newton_step_of, spectral_radius_of
from .orbit_search import ClosedOrbit, measure


def close_damped(
    forced_map: ForcedMap,
    state: State,
    periods: int = 1,
    orders: int = 9,
    patient: bool = True,
    repelling: bool = False,
) -> ClosedOrbit | None:
    """Close an orbit from a state far off; return one that attracts, or None.

    Parameters
    ----------
    forced_map : ForcedMap
    state : State
    periods : int
        Of the force in one of the orbit.
    orders : int
        Highest harmonic integrated.
    patient : bool
        Whether to go on where steps must be cut short, as is worth while on a slow transient; irregular
        motion is given up at once.
    repelling : bool
        Whether one that does not attract will do.
    """
    s, forced_map = forced_map.laws.symmetries, forced_map.with_own_sizes()
    if not len(s.free):
        return None
    trials = _Trials(forced_map, state.mode.copy(), periods, RTOL_FINE if patient else RTOL_SHOTS)
    try:
        found = _solved(trials, s.transform @ state.x, patient)
        if found is None:
            return None
        y, error, jacobian = found
        radius = spectral_radius_of(forced_map.laws.period_map.at, jacobian, SQUARINGS_FINE)
        if not repelling and not radius < 1.0 + NEUTRAL:
            return None
        begin = forced_map.state_at(y, state.mode)
        if forced_map.mirrored and s.shifts:
            begin = _centred(forced_map, begin)
        return measure(forced_map, begin, error, periods, orders, RTOL_FINE)
    except RanAway:
        return None


def _solved(trials, y, patient):
    """Return coordinates of an orbit, the error that they have, and the last Jacobian; or None."""
    f = trials.mismatch(y)
    best, error, last = y, np.inf, np.inf
    for _ in range(NEWTON_FAR):
        size = trials.size.copy()
        jacobian = trials.jacobian(y, f)
        step = None if jacobian is None else trials.step(jacobian, f)
        if step is None:
            return None
        now = trials.length(step, size)
        if not patient and now > STEP_REACH:
            return None
        if now < error:
            best, error = y, now
        rounding = now < DAMPED_SETTLED[0] and now > DAMPED_SETTLED[1] * last
        if now < STEP_ENDS * STEP_GOOD or rounding:
            break
        last = now
        shorter = _shortened(trials, jacobian, y, step, size, DAMPED_LEAST[patient])
        if shorter is None:
            break
        y, f = shorter
        if trials.rtol > RTOL_FINE:
            trials = replace(trials, rtol=RTOL_FINE)
            f = trials.mismatch(y)
    if trials.rtol > RTOL_FINE:
        return None
    miss = trials.length(trials.mismatch(best), size)
    closed = error < STEP_GOOD_LATE * STEP_GOOD or (error < STEP_POOR and miss < FINE_LATE * RTOL_FINE)
    return (best, float(error), jacobian) if closed else None


def _shortened(trials, jacobian, y, step, size, least):
    """Return coordinates a share of the step ahead, and what they miss; None where no share leads nearer.

    Nearer: with the same Jacobian the next step is shorter than this one, in sizes of where it began.
    """
    share, now = 1.0, trials.length(step, size)
    while share >= least:
        trial = trials.clipped(y + share * step)
        trials.size[:] = size
        try:
            f = trials.mismatch(trial)
            ahead = trials.step(jacobian, f)
        except RanAway:
            ahead = None
        if ahead is not None and trials.length(ahead, size) <= (1 - DESCENT * share) * now:
            return trial, f
        share *= SHORTENED_BY[share <= SHORTENED]
    return None


def _centred(forced_map, state):
    """Return the state with free positions moved to where half a period mirrors them onto themselves."""
    end, centred = forced_map.apply(state, RTOL_FINE).end, state.copy()
    for direction in forced_map.laws.symmetries.shifts:
        at = np.flatnonzero(direction)[0]
        centred.x[direction] += 0.5 * (end.x[at] - state.x[at])
    return centred


class RanAway(Exception):
    """A trial shot left every bound."""


@dataclass(frozen=True, eq=False)
class _Trials:
    """Shots from coordinates in modes `mode`, over so many periods, at a tolerance `rtol`."""

    forced_map: ForcedMap
    mode: np.ndarray
    periods: int
    rtol: float

    @property
    def size(self):
        """Sizes of the coordinates, which shots take note of in the workspace."""
        return self.forced_map.laws.period_map.size

    @property
    def free(self):
        """Coordinates that have to repeat."""
        return self.forced_map.laws.symmetries.free

    def clipped(self, y):
        s = self.forced_map.laws.symmetries
        return np.clip(y, s.lower, s.upper)

    def mismatch(self, y):
        """Return end less start of one shot from y, in all coordinates; takes note of sizes."""
        transform = self.forced_map.laws.symmetries.transform
        state = self.forced_map.state_at(y, self.mode)
        try:
            end = self.forced_map.apply(state, self.rtol, self.periods).end
        except OutOfWork as stop:
            if self.forced_map.work.left <= 0:
                raise
            raise RanAway from stop
        except RuntimeError as error:  # a law asked where no motion leads may fail
            raise RanAway from error
        mismatch = transform @ end.x
        mismatch_of(self.forced_map.laws.period_map.at, transform @ state.x, mismatch)
        return mismatch

    def jacobian(self, y, f):
        """Return the Jacobian at y, whose shot misses by f; None where a shot fails."""
        state = self.forced_map.state_at(y, self.mode)
        return self.forced_map.jacobian(state, f, self.rtol, self.periods, CENTRAL)

    def step(self, jacobian, f):
        """Return Newton's step in all coordinates, zero where they are not free; None where singular."""
        change, step = np.zeros(len(self.free)), np.zeros(len(f))
        solved = newton_step_of(self.forced_map.laws.period_map.at, jacobian, f, change)
        if not solved or not np.all(np.isfinite(change)):
            return None
        step[self.free] = change
        return step

    def length(self, step, size):
        return float(np.max(np.abs(step[self.free]) / size[self.free]))
