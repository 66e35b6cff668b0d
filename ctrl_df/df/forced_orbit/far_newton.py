"""Newton's method for orbits far off or badly conditioned: light damping, slow transients.

A mechanism that loses a part d of its motion in a period needs 1/d periods to settle, and multiplies by 1/d
what a shot does not know exactly. The compiled search of `shooting` is made for the common case:
it distrusts long steps and integrates only as finely as that case needs. Here shots are finer, the Jacobian
is taken by central differences, and a step of any length is made if the next one it promises is shorter
(Deuflhard's natural monotonicity test, which asks in the unknowns, not in the badly conditioned mismatch).
"""

from __future__ import annotations

import numpy as np

from ...simulate.engine import State
from ..thresholds import (
    BETTER,
    FAR_FORGETS,
    FAR_ITERATIONS,
    FAR_SETTLED,
    FAR_STEP,
    FINE,
    FINE_LATE,
    GOOD,
    GOOD_LATE,
    HOPELESS,
    LEAST_SHARE,
    NEUTRAL,
    POOR,
    RTOL,
    SHORTENED,
)
from .orbit_search import OutOfWork


def close_far(
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
    s = search.symmetries
    free = s.free
    if not len(free):
        return None
    map_ = _Map(search, state.mode, periods)
    y = map_.coordinates(state.x)
    map_.rtol = FINE if patient else RTOL  # shows as well whether it is worth while
    try:
        f = map_.mismatch(y)
        size = map_.size.copy()
        best, error, last, jacobian = None, np.inf, np.inf, None
        for _ in range(FAR_ITERATIONS):
            size = np.maximum(map_.size, FAR_FORGETS * size)
            jacobian = map_.jacobian(y, size)
            step = _solve(jacobian, f, size[free])
            if step is None:
                return None
            now = _length(step, size[free])
            if not patient and now > HOPELESS:
                return None
            if best is None or now < error:
                best, error = y, now
            rounding = now < FAR_SETTLED[0] and now > FAR_SETTLED[1] * last
            if now < BETTER * GOOD or rounding:
                break
            last = now
            share = 1.0
            while True:
                trial = y.copy()
                trial[free] += share * step
                trial = map_.clipped(trial)
                try:
                    f_trial = map_.mismatch(trial)
                    ahead = _solve(jacobian, f_trial, size[free])
                except RanOff:
                    f_trial, ahead = f, None
                if ahead is not None and _length(ahead, size[free]) <= (1 - 0.25 * share) * now:
                    break
                share *= 0.5 if share > SHORTENED else 0.25
                if share < LEAST_SHARE[patient]:
                    trial = None
                    break
            if trial is None:
                break
            y, f = trial, f_trial
            if map_.rtol > FINE:
                map_.rtol = FINE
                f = map_.mismatch(y)
        if best is None or jacobian is None or map_.rtol > FINE:
            return None
        y = best
        miss = _length(map_.mismatch(y), size[free])
        if not (error < GOOD_LATE * GOOD or (error < POOR and miss < FINE_LATE * FINE)):
            return None
        radius = np.max(np.abs(np.linalg.eigvals(jacobian * size[free] / size[free][:, None])))
        if not repelling and not radius < 1.0 + NEUTRAL:
            return None
        found = search._state(y, state.mode)
        if search.mirrored and s.shifts:
            end = found.copy()
            search._shoot(end, FINE)
            for direction in s.shifts:
                at = np.flatnonzero(direction)[0]
                found.x[direction] += 0.5 * (end.x[at] - found.x[at])
        search.measure(found, periods, orders, FINE)
    except RanOff:
        return None
    return found, float(error)


class RanOff(Exception):
    """A trial shot left every bound."""


class _Map:
    """The map of a shot in coordinates, and the sizes met."""

    def __init__(self, search, mode, periods):
        self.search, self.mode, self.periods = search, mode.copy(), periods
        self.s = search.symmetries
        self.size = np.zeros(len(self.s.transform))
        self.rtol = FINE

    def coordinates(self, x):
        return self.s.transform @ x

    def clipped(self, y):
        return np.clip(y, self.s.lower, self.s.upper)

    def shot(self, y):
        """Coordinates after one shot from y."""
        state = self.search._state(y, self.mode)
        begin = self.coordinates(state.x)
        try:
            self.search._shoot(state, self.rtol, self.periods)
        except OutOfWork as stop:
            if self.search.budget <= 0:
                raise
            raise RanOff from stop
        except RuntimeError as error:  # a law asked where no motion leads may fail
            raise RanOff from error
        end = self.coordinates(state.x)
        return begin, end

    def mismatch(self, y):
        """Return end less start of the free coordinates; takes note of sizes."""
        begin, end = self.shot(y)
        inside, omega = self.search.shot.space.size, self.search.omega
        size = np.maximum(np.abs(begin), np.abs(end))
        mixed = np.count_nonzero(self.s.transform, axis=1) > 1
        # a coordinate may be near zero at both ends and swing in between
        size = np.where(
            mixed & (self.s.power != 1), size, np.maximum(size, np.abs(self.s.transform) @ inside)
        )
        stretch = np.flatnonzero(mixed & (self.s.power == 2))
        size[stretch] = np.maximum(size[stretch], size[stretch + 1] / omega)
        self.size = size
        gap = self.s.upper - self.s.lower
        self.size = np.where(np.isfinite(gap), gap, self.size)
        self.size = np.where(self.size > 0, self.size, 1.0)
        return self._wrapped(end - begin)[self.s.free]

    def jacobian(self, y, size):
        """Central differences of the shot over the free coordinates."""
        free = self.s.free
        out = np.empty((len(free), len(free)))
        for c, i in enumerate(free):
            ends, spread = [], 0.0
            for side in (-1, 1):
                z = y.copy()
                z[i] += side * FAR_STEP * size[i]
                z = self.clipped(z)
                spread += side * z[i]
                ends.append(self.shot(z)[1])
            out[:, c] = self._wrapped(ends[1] - ends[0])[free] / spread
        return out

    def _wrapped(self, step):
        wrap = np.where(self.s.wrap > 0, self.s.wrap, 1.0)
        return step - np.where(self.s.wrap > 0, np.round(step / wrap) * wrap, 0.0)


def _solve(jacobian, f, size):
    """Return the step (1 - J)^-1 f in units of the states, or None where singular."""
    matrix = (np.eye(len(f)) - jacobian) * size / size[:, None]
    try:
        step = size * np.linalg.solve(matrix, f / size)
    except np.linalg.LinAlgError:
        return None
    return step if np.all(np.isfinite(step)) else None


def _length(step, size):
    return float(np.max(np.abs(step) / size))
