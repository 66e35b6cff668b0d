"""Newton's method damped: for orbits far off, or badly conditioned by light damping and slow transients.

A mechanism that loses a part d of its motion in a period needs 1/d periods to settle, and multiplies by 1/d
what a shot does not know exactly. The secant steps of `shooting` are made for the common case: they give up
where a step leads far, and integrate only as finely as that case needs. Here shots are finer, the Jacobian is
taken by central differences at every step, and a step of any length is made if the next one it promises is
shorter (Deuflhard's natural monotonicity test, which asks in the unknowns, not in the badly conditioned
mismatch). That costs several times as many shots: it is asked only where secant steps have failed.
"""

from __future__ import annotations

import numpy as np

from ...simulate.engine import State
from ..thresholds import (
    BETTER,
    CENTRAL,
    DAMPED_SETTLED,
    DAMPED_STEPS,
    FINE,
    FINE_LATE,
    GOOD,
    GOOD_LATE,
    LEAST_SHARE,
    NEUTRAL,
    POOR,
    REACH,
    RTOL,
    SHORTENED,
    SQUARINGS_FINE,
)
from .newton import mismatch_of, newton_step_of, spectral_radius_of
from .orbit_search import OutOfWork


def close_damped(
    search, state: State, periods: int = 1, orders: int = 9, patient: bool = True, repelling: bool = False
):
    """Close an orbit from a state far off; return (state, error) of one that attracts, or None.

    Parameters
    ----------
    search : OrbitSearch
        Aimed at its point; keeps integrals, ends and event kinds of the orbit found.
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
    if not len(search.symmetries.free):
        return None
    known = search.shot.size.copy(), search.shot.jacobian.copy()  # left as the secant steps had them
    shots = _Shots(search, state.mode, periods, FINE if patient else RTOL)
    try:
        found = _solved(shots, search.symmetries.transform @ state.x, patient)
        if found is None:
            return None
        y, error = found
        radius = spectral_radius_of(search.shot.at, SQUARINGS_FINE)
        if not repelling and not radius < 1.0 + NEUTRAL:
            return None
        orbit = search.state_at(y, state.mode)
        if search.mirrored and search.symmetries.shifts:
            _center(search, orbit)
        search.measure(orbit, periods, orders, FINE)
    except RanOff:
        return None
    finally:
        search.shot.size[:], search.shot.jacobian[:] = known
    return orbit, error


def _solved(shots, y, patient):
    """Return coordinates of an orbit and the error that they have, or None; its Jacobian is the last one."""
    f = shots.missed(y)
    best, error, last = y, np.inf, np.inf
    for _ in range(DAMPED_STEPS):
        size = shots.shot.size.copy()
        step = shots.step(f) if shots.differentiate(y, f) else None
        if step is None:
            return None
        now = shots.length(step, size)
        if not patient and now > REACH:
            return None
        if now < error:
            best, error = y, now
        rounding = now < DAMPED_SETTLED[0] and now > DAMPED_SETTLED[1] * last
        if now < BETTER * GOOD or rounding:
            break
        last = now
        shorter = _shortened(shots, y, step, size, LEAST_SHARE[patient])
        if shorter is None:
            break
        y, f = shorter
        if shots.rtol > FINE:
            shots.rtol = FINE
            f = shots.missed(y)
    if shots.rtol > FINE:
        return None
    miss = shots.length(shots.missed(best), size)
    closed = error < GOOD_LATE * GOOD or (error < POOR and miss < FINE_LATE * FINE)
    return (best, float(error)) if closed else None


def _shortened(shots, y, step, size, least):
    """Return coordinates a share of the step ahead, and what they miss; None where no share leads nearer.

    Nearer: with the same Jacobian the next step is shorter than this one, in sizes of where it began.
    """
    share, now = 1.0, shots.length(step, size)
    while share >= least:
        trial = shots.clipped(y + share * step)
        shots.shot.size[:] = size
        try:
            f = shots.missed(trial)
            ahead = shots.step(f)
        except RanOff:
            ahead = None
        if ahead is not None and shots.length(ahead, size) <= (1 - 0.25 * share) * now:
            return trial, f
        share *= 0.5 if share > SHORTENED else 0.25
    return None


def _center(search, orbit):
    """Move free positions, in place, to where half a period mirrors them onto themselves."""
    end = orbit.copy()
    search.shoot(end, FINE)
    for direction in search.symmetries.shifts:
        at = np.flatnonzero(direction)[0]
        orbit.x[direction] += 0.5 * (end.x[at] - orbit.x[at])


class RanOff(Exception):
    """A trial shot left every bound."""


class _Shots:
    """Shots of a search from coordinates, at a tolerance `rtol`."""

    def __init__(self, search, mode, periods, rtol):
        self.search, self.mode, self.periods, self.rtol = search, mode.copy(), periods, rtol
        self.free, self.shot = search.symmetries.free, search.shot
        self.shot.size[:] = 0.0

    def clipped(self, y):
        return np.clip(y, self.search.symmetries.lower, self.search.symmetries.upper)

    def missed(self, y):
        """Return end less start of one shot from y, in all coordinates; takes note of sizes."""
        search, transform = self.search, self.search.symmetries.transform
        state = search.state_at(y, self.mode)
        begin = transform @ state.x
        try:
            search.shoot(state, self.rtol, self.periods)
        except OutOfWork as stop:
            if search.budget <= 0:
                raise
            raise RanOff from stop
        except RuntimeError as error:  # a law asked where no motion leads may fail
            raise RanOff from error
        end = transform @ state.x
        mismatch_of(self.shot.at, begin, end)
        return end

    def differentiate(self, y, f):
        """Take the Jacobian at y, whose shot misses by f; False where a shot fails."""
        search, state = self.search, self.search.state_at(y, self.mode)
        return search.differentiated(state, f, self.rtol, self.periods, CENTRAL)

    def step(self, f):
        """Return Newton's step in all coordinates, zero where they are not free; None where singular."""
        change, step = np.zeros(len(self.free)), np.zeros(len(f))
        if not newton_step_of(self.shot.at, f, change) or not np.all(np.isfinite(change)):
            return None
        step[self.free] = change
        return step

    def length(self, step, size):
        return float(np.max(np.abs(step[self.free]) / size[self.free]))
