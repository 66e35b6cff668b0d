"""A motion that does not repeat after a period of the force: subharmonic, or averaged if it has no period."""

from __future__ import annotations

import numpy as np

from ...simulate.engine import State
from ...status import Status
from ...thresholds import NOTHING
from ..thresholds import (
    BLOCKS,
    EVENLY,
    LATEST,
    LONGER_BETTER,
    LONGER_LEAST,
    LONGEST_PERIOD,
    RTOL_SHOTS,
    STEADY_ERRORS,
    STEADY_SLOPE,
    WAITS,
)
from .damped import close_damped
from .forced_map import ForcedMap, OutOfWork
from .fourier import fourier
from .motion import Motion, Start, motion_of, slow
from .orbit_search import close_orbit, stop_if_running_away
from .regimes import TOUCH


def irregular_motion(forced_map: ForcedMap, state: State, orders: int, averages: int) -> Motion:
    """Look for a longer period; else follow the motion until it is steady, and average.

    Parameters
    ----------
    forced_map : ForcedMap
        Over whole periods.
    state : State
        Where the search for one period has ended.
    orders, averages : int
        As in `ctrl_df.df.forced_orbit.orbits.orbit_family`.
    """
    samples, state, *_ = forced_map.iterates(
        forced_map.after(state, LATEST, RTOL_SHOTS), 2 * LONGEST_PERIOD + 1
    )
    stop_if_running_away(forced_map, samples)
    found = _longer_period(forced_map, state, samples, orders)
    if found is not None:
        return found
    orbit = close_damped(forced_map, state, orders=orders, patient=slow(forced_map.laws, samples))
    if orbit is not None:
        return motion_of(forced_map, orbit, orbit.coefficients(forced_map))
    for periods in WAITS:
        means, sizes, touched, state = _averages(forced_map, state, orders, averages)
        free = forced_map.block.gap and not touched
        if free or _steady(means[:, 1], sizes):
            break
        state = forced_map.after(state, periods)
        orbit, _ = close_orbit(forced_map, state, orders=orders)
        orbit = orbit or close_damped(forced_map, state, orders=orders)
        if orbit is not None:
            return motion_of(forced_map, orbit, orbit.coefficients(forced_map))
    else:  # still on its way
        grows = np.all(np.diff(sizes) > 0) and np.ptp(np.diff(sizes)) < EVENLY * np.mean(np.diff(sizes))
        raise OutOfWork(Status.DIVERGED if grows else Status.WORK_LIMIT)
    mean, after = means.mean(axis=0), Start(forced_map.laws, state)
    if free:
        return Motion(mean, "free", 0.0, after)
    error = np.std(means[:, 1], ddof=1) / np.sqrt(BLOCKS)
    return Motion(mean, "aperiodic", float(2 * error / max(abs(mean[1]), NOTHING)), after)


def _longer_period(forced_map, state, samples, orders):
    """Motion that repeats after several periods, or None."""
    laws = forced_map.laws
    s, known = laws.symmetries, laws.period_map.size
    size = np.where(known > 0, known, 1.0)
    least = LONGER_LEAST
    for periods in range(1, LONGEST_PERIOD + 1):
        gap = (samples[-1] - samples[-1 - periods]) / size
        gap -= np.where(s.wrap > 0, np.round(gap * size / np.where(s.wrap > 0, s.wrap, 1)) * s.wrap / size, 0)
        apart = np.max(np.abs(gap[s.free]), initial=0.0)
        if apart < LONGER_BETTER * least:
            least = apart
            orbit, _ = close_orbit(forced_map, state, periods, orders)
            if orbit is not None:
                y = orbit.coefficients(forced_map, periods)
                if periods == 1:
                    return motion_of(forced_map, orbit, y)
                return Motion(y, f"subharmonic {periods}", orbit.error, Start(laws, orbit.state))
    return None


def _averages(forced_map, state, orders, averages):
    """Follow the state over some periods.

    Returns coefficients and size of every block of them, whether bodies touch, and the state at the end.
    """
    block, laws, omega = forced_map.block, forced_map.laws, forced_map.force.omega
    unit, free = block.free_motion(forced_map.force.A, omega), laws.symmetries.free
    length, parts, sizes, touched = averages // BLOCKS, [], [], False
    for _ in range(BLOCKS):
        mean, size = np.zeros(orders + 1, complex), 0.0
        for _ in range(length):
            part = np.zeros((block.row + 1, orders + 1), complex)
            state, kinds, ends = forced_map.apply(state, RTOL_SHOTS, 1, part)
            touched |= bool(kinds & TOUCH)
            mean += fourier(part[block.row], ends, omega, free=laws.free_row) / length
            with np.errstate(over="ignore"):  # a motion that runs away is seen by its size
                y = np.abs(laws.symmetries.transform @ state.x) / unit
            size += np.max(y[free], initial=0.0) / length
        parts.append(mean)
        sizes.append(size)
    return np.array(parts), np.array(sizes), touched, state


def _steady(means, sizes) -> bool:
    """Whether averages over consecutive blocks scatter and do not tend anywhere."""
    at = np.arange(len(means)) - 0.5 * (len(means) - 1)
    size = np.max(np.abs(means))
    for found, scale in ((means.real, size), (means.imag, size), (sizes, np.max(sizes))):
        values = found / scale if scale > 0 else found  # squares of a motion that runs away are no numbers
        slope = at @ values / (at @ at)
        rest = values - values.mean() - slope * at
        error = np.sqrt(rest @ rest / (len(at) - 2) / (at @ at))
        if abs(slope) > STEADY_ERRORS * error and abs(slope) * len(at) > STEADY_SLOPE:
            return False
    return True
