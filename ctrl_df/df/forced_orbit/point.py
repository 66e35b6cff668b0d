"""One point of a family: the steady motion under one force, from where the point before was."""

from __future__ import annotations

import numpy as np

from ..thresholds import CHANGES_SEEN, EVENS, LATER, LATEST
from .damped import close_damped
from .forced_map import ForcedMap
from .irregular import irregular_motion
from .motion import Motion, Start, changes, motion_of, slow
from .orbit_search import close_orbit, follow, nudged, orbit_in_contact
from .regimes import TOUCH


def steady_motion(
    forced_map: ForcedMap, start: Start, orders: int, *, transient: int, averages: int
) -> Motion:
    """Find the steady motion under one force.

    Parameters
    ----------
    forced_map : ForcedMap
    start : Start
        With the laws of the shots.
    orders, transient, averages : int
        As in `ctrl_df.df.forced_orbit.orbits.orbit_family`.

    Raises
    ------
    OutOfWork
        The state ran away, or the bound on work was hit.
    """
    laws = forced_map.laws
    first = forced_map.over(mirrored=laws.odd and not (start.asymmetric and start.state is not None))
    orbit, repels = None, False
    if start.state is None:
        state = first.at_rest()
    else:
        state = start.state
        orbit, repels = close_orbit(first, state, orders=orders)
    if orbit is None:
        state = first.after(state, transient)
        if not repels:
            orbit, repels = close_orbit(first, state, orders=orders)
    if orbit is None:
        later = max(LATER - transient, 1)
        orbit, state = follow(first, state, later, orders, transient=transient, repels=repels)
    if orbit is None:
        samples, state, *_ = first.iterates(state, CHANGES_SEEN + 1)
        orbit, _ = close_orbit(first, state, orders=orders)
        if orbit is None and first.mirrored and _alternates(laws, samples):
            orbit, _ = close_orbit(first.over(mirrored=False), state, orders=orders)
        if orbit is None:
            orbit = close_damped(first, state, orders=orders, patient=slow(laws, samples))
    if orbit is None and laws.odd:
        whole = first.over(mirrored=False)
        state = nudged(whole, state)
        orbit, state = follow(whole, state, LATEST, orders, transient=transient, repels=False)
    if forced_map.block.gap and orbit is not None and not orbit.kinds & TOUCH:
        within = orbit
        orbit, touching = orbit_in_contact(forced_map, orders)
        if touching is None:
            state = within.state
            orbit, _ = close_orbit(forced_map.over(mirrored=within.mirrored), state, orders=orders)
        else:
            state = touching
    if orbit is None:
        return irregular_motion(forced_map.over(mirrored=False), state, orders, averages)
    return motion_of(forced_map, orbit, orbit.coefficients(forced_map))


def _alternates(laws, samples):
    """Whether a motion repeats after two of the shots it is followed by, and not after one."""
    once, twice = (np.max(np.abs(changes(laws, samples, k)[-1]), initial=0.0) for k in (1, 2))
    return bool(twice < EVENS * once and once > EVENS)
