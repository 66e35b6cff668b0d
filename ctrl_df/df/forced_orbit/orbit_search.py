"""The search for one forced periodic orbit that attracts: Newton's method, and what to try where it fails."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...simulate.engine import State
from ...simulate.kernel.run import reasons
from ...simulate.program import layout
from ...status import Status
from ..threads import go_on
from ..thresholds import (
    EVENLY,
    FIRST_STEP,
    GAP_PERIODS,
    GAP_STARTS,
    LINEAR,
    NUDGE,
    NUDGED,
    RTOL_FOLLOWED,
    RTOL_SHOTS,
    RUNS_AWAY,
    SETTLED_AT_FIRST,
    SETTLED_AT_LAST,
    SETTLED_BETTER,
    SHOTS_ALONE,
    SHOTS_AT_ONCE,
    SHOTS_COUNTED,
)
from .forced_map import ForcedMap, OutOfWork
from .fourier import fourier
from .kernel import shooting
from .kernel.shooting import CLOSED, SPENT, UNSTABLE, solve_periodic
from .regimes import TOUCH


@dataclass(frozen=True, eq=False)
class ClosedOrbit:
    """A periodic orbit and what its last shot has measured.

    Attributes
    ----------
    state : State
        At t = 0.
    error : float
        Of the state, relative.
    mirrored : bool
        Whether it was closed over half a period: it then has half-wave symmetry.
    integrals, ends, kinds
        As `ctrl_df.df.forced_orbit.forced_map.Image` and `fourier` have them, of the output described.
    stuck : bool
        Whether every body is held at the end.
    """

    state: State
    error: float
    mirrored: bool
    integrals: np.ndarray
    ends: np.ndarray
    kinds: int
    stuck: bool

    def coefficients(self, forced_map: ForcedMap, periods: int = 1):
        """Fourier coefficients Y_k of the output, without delays and offsets."""
        return fourier(
            self.integrals, self.ends, forced_map.force.omega,
            periods=periods, mirrored=self.mirrored, free=forced_map.laws.free_row,
        )  # fmt: skip


def close_orbit(
    forced_map: ForcedMap, state: State, periods: int = 1, orders: int = 9, *, repelling=False, near=False
) -> tuple[ClosedOrbit | None, bool]:
    """Close an orbit by secant steps from a state nearby.

    Parameters
    ----------
    forced_map : ForcedMap
    state : State
    periods : int
        Of the force in one of the orbit.
    orders : int
        Highest harmonic integrated.
    repelling : bool
        Whether an orbit that does not attract will do.
    near : bool
        Whether to begin with the Jacobian of the orbit closed before.

    Returns
    -------
    orbit : ClosedOrbit or None
    repels : bool
        Whether there is an orbit that does not attract.
    """
    state, at = state.copy(), forced_map.laws.period_map
    spectrum = np.zeros((forced_map.block.row + 1, orders + 1), complex)
    if not near:
        forced_map.laws.forget_jacobian()
    at.clock[2] = FIRST_STEP * forced_map.force.period
    outcome, error = solve_periodic(
        shooting.address(), at.at, forced_map.force.drive, forced_map.span(periods), state.x, state.mode,
        forced_map.mirrored, RTOL_SHOTS, 0.0, forced_map.longest_step(orders), spectrum,
        forced_map.work.left, SHOTS_ALONE, False,
    )  # fmt: skip
    repels = outcome == UNSTABLE
    forced_map.work.spend(SHOTS_COUNTED * int(at.clock[3]))
    go_on()
    forced_map.block.raise_if_raised()
    if outcome == SPENT:
        raise forced_map.stopped(reasons.STEPS, state)
    forced_map.reset_failed()
    if outcome != CLOSED and not (repelling and repels):
        return None, repels
    if not forced_map.mirrored:
        forced_map.check_free_speed(at.trial[1])
    if forced_map.block.quantized:  # the harmonics of the centred motion
        forced_map.apply(state, RTOL_SHOTS, periods, spectrum)
    return _measured(forced_map, state, error, spectrum), repels


def measure(
    forced_map: ForcedMap, state: State, error: float, periods: int, orders: int, rtol: float
) -> ClosedOrbit:
    """Return the orbit of a state that is known to close, measured by one shot."""
    spectrum = np.zeros((forced_map.block.row + 1, orders + 1), complex)
    end = forced_map.apply(state, rtol, periods, spectrum).end
    forced_map.check_free_speed(forced_map.laws.symmetries.transform @ (end.x - state.x))
    return _measured(forced_map, state, error, spectrum)


def _measured(forced_map, state, error, spectrum):
    at, row = forced_map.laws.period_map, forced_map.block.row
    ends, kinds, stuck = at.ends[:, row].copy(), int(at.tally[2]), bool(at.tally[5])
    return ClosedOrbit(state, error, forced_map.mirrored, spectrum[row], ends, kinds, stuck)


def follow(
    forced_map: ForcedMap, state: State, periods: int, orders: int, *, transient: int, repels: bool
) -> tuple[ClosedOrbit | None, State]:
    """Follow a motion for some periods, and close its orbit where it seems to have settled.

    It is tried as well each time the motion has been followed twice as long as before, from `transient`
    periods on, unless the orbit found there `repels`. A motion that repeats after two half periods, and not
    after one, is closed over whole periods. Returns an attracting orbit or None, and where the motion was
    left.
    """
    settled, a_period = [SETTLED_AT_FIRST] * 2, forced_map.a_period
    left, wait = a_period * periods, a_period * max(transient, 1)
    ahead = wait  # shots to the next attempt, settled or not
    while left > 0:
        some = forced_map.iterates(state, min(left, ahead, SHOTS_AT_ONCE), RTOL_FOLLOWED, settled)
        state, repeats = some.end, some.repeats
        left, ahead = left - some.done, ahead - some.done
        if repeats == 0 and left > 0 and ahead > 0:
            continue
        alternates = repeats == 2
        if repeats > 0 and settled[alternates] > 0:
            settled[alternates] *= SETTLED_BETTER if settled[alternates] > SETTLED_AT_LAST else 0.0
        if alternates and not forced_map.mirrored:
            continue
        if ahead == 0:
            wait = ahead = 2 * wait
            if repels and repeats == 0 and left > 0:
                continue  # there is an orbit here that the motion leaves: it has to settle first
        mirrored = forced_map.mirrored and not alternates
        orbit, repels = close_orbit(forced_map.over(mirrored=mirrored), state, orders=orders)
        if orbit is not None:
            return orbit, state
    return None, state


def nudged(forced_map: ForcedMap, state: State) -> State:
    """Return the state a little off: no motion stays on a repelling orbit by the grace of rounding."""
    s = forced_map.laws.symmetries
    y = s.transform @ state.x
    y[s.free] += NUDGE * forced_map.laws.period_map.size[s.free]
    return forced_map.state_at(y, state.mode)


def orbit_in_contact(forced_map: ForcedMap, orders: int) -> tuple[ClosedOrbit | None, State | None]:
    """Look for an orbit whose bodies touch, for a block found moving freely within its gap.

    A motion without contact coexists with others at moderate force and is what a centred start leads
    to. Returns the orbit or None, and a state from which the bodies keep touching or None.
    """
    block, prog, keeps = forced_map.block, forced_map.block.engine.program, None
    node = next(m for m in block.mechanisms if prog.par[m[layout.PAR] + layout.P_GAP] > 0)
    at, gap = node[layout.X], prog.par[node[layout.PAR] + layout.P_GAP]
    A, omega = forced_map.force.A, forced_map.force.omega
    speed = gap * omega + A / (prog.par[node[layout.PAR] + layout.P_M0 + 1] * omega)
    whole, first = forced_map.over(mirrored=False), forced_map.over(mirrored=forced_map.laws.odd)
    for face, leaving in GAP_STARTS:
        y = np.zeros(block.engine.nstates)
        y[at + 2], y[at + 3] = face * gap, leaving * speed
        forced_map.reset_sizes()
        some = first.iterates(first.state_at(y), first.a_period * GAP_PERIODS, RTOL_FOLLOWED)
        if not some.kinds & TOUCH:
            continue
        orbit, _ = close_orbit(first, some.end, orders=orders)
        if orbit is None and forced_map.laws.odd:
            some = whole.iterates(nudged(whole, some.end), NUDGED, RTOL_FOLLOWED)
            if not some.kinds & TOUCH:
                continue
            orbit, _ = close_orbit(whole, some.end, orders=orders)
        if orbit is not None and orbit.kinds & TOUCH:
            return orbit, some.end
        if orbit is None:
            keeps = some.end if keeps is None else keeps
    return None, keeps


def stop_if_running_away(forced_map: ForcedMap, samples) -> None:
    """Raise where a state grows out of all bounds, or a free body steadily gains speed.

    `samples` (n, states): coordinates before consecutive shots.
    """
    y = samples / forced_map.block.free_motion(forced_map.force.A, forced_map.force.omega)
    half = len(y) // 2
    begin, middle, end = (np.max(np.abs(y[k])) for k in (0, half, -1))
    if end > RUNS_AWAY * middle > RUNS_AWAY**2 * begin:
        raise OutOfWork(Status.DIVERGED)
    s = forced_map.laws.symmetries
    for i in range(len(s.power)):
        if s.power[i] != 1 or not s.positions[i - 1]:
            continue
        early, late = y[half, i] - y[0, i], y[-1, i] - y[-1 - half, i]
        spread = np.max(np.abs(np.diff(y[:, i]) - early / half))
        if abs(early) > LINEAR and abs(late / early - 1) < LINEAR and spread < EVENLY * abs(early / half):
            raise OutOfWork(Status.DIVERGED)
