"""Predictions held against the exact orbit and a plain simulation."""

from __future__ import annotations

import numpy as np

from ..checks import kind_of
from ..df.dispatch import translated
from ..simulate.loop import closed_loop
from ..status import Status
from .arguments import check_search
from .check import Check, Row, in_band
from .exact.basins import Fate
from .exact.known_orbits import KnownOrbits
from .exact.orbit import NoOrbit, Orbit
from .exact.thresholds import CROSSINGS_VERIFIED, STEPS_A_PERIOD, TRAJECTORY_RTOL
from .finder import OrbitFinder
from .predicted.grade import LimitCycle
from .thresholds import (
    AMPLITUDE_COUNTS,
    CONFIRMED_WITHIN,
    LEFT_ALONE,
    MET_LEAST,
    SAME_CYCLE,
    SET_ASIDE,
    STABILITY_COUNTS,
)

CONFIRMED, SHIFTED = "confirmed", "shifted"
NONE, NOT_FOUND, UNTESTED = "no such orbit", "not found", "not tested"
MISSED = "missed by the describing function"

DELAYED = "The loop contains a pure delay: no exact orbit is computed, only a simulation."

_UNHELD = "Newton's method from this motion finds no orbit near it"


def verify(resp, *, loop=None, search=True, search_time=None) -> Check:
    """Check every predicted limit cycle against the exact orbit and simulations of the closed loop.

    Parameters
    ----------
    resp : DescribingFunctionResponse
        From `ctrl_df.describing_function_response`.
    loop : ct.InterconnectedSystem, optional
        The loop to simulate; default ``closed_loop(resp.H, resp.block)``. Give the sampled loop to see what
        sampling does.
    search : bool
        Also simulate the loop from starts of many sizes: orbits that the prediction missed, and what the loop
        does from each start (``.fate``).
    search_time : float
        Longest simulation of that search [s].

    Returns
    -------
    Check
        ``.rows``, ``.table()``, ``.orbits``, ``.fate``. Where the loop cannot be simulated (H is measured
        points, or more improper than a PID) rows say ``not tested`` and ``.note`` why. In a loop with a pure
        delay, whose state is a history, no exact orbit is computed: the prediction is compared with a
        simulation, and ``.why`` says how. An unstable cycle cannot be seen that way and stays ``not tested``.

    Raises
    ------
    TypeError
        `resp` not from `ctrl_df.describing_function_response`, `loop` not a system.
    ValueError
        `search_time` not positive.

    Examples
    --------
    >>> H = ct.tf([8], [1, 2, 2, 1])
    >>> resp = cdf.describing_function_response(H, cdf.saturation(1), np.linspace(1, 5, 20))
    >>> [row.verdict for row in cdf.verify(resp)]
    ['confirmed']
    """
    check_search("verify", search_time=search_time, search=search)
    if not hasattr(resp, "limit_cycles"):
        raise TypeError(
            "verify needs the answer of describing_function_response; got "
            f"{kind_of(resp)}. python-control's own result does not keep H and the block: call "
            "ctrl_df.describing_function_response."
        )
    cycles = list(resp.limit_cycles)
    if loop is None:
        try:
            block = translated(resp.block)
            described = resp.family.output if resp.family is not None else None
            output = described if described in getattr(block, "output_labels", ()) else None
            loop = closed_loop(resp.H, block, output=output)
            finder = OrbitFinder(loop)
        except (ValueError, TypeError) as error:
            return Check(tuple(Row(c, None, None, UNTESTED) for c in cycles), [], f"not simulated: {error}")
    else:
        finder = OrbitFinder(loop)

    orbits: list[Orbit] = []
    known = KnownOrbits(finder.poincare, orbits)
    from_path: dict[int, Orbit] = {}
    searches: dict[int, NoOrbit] = {}
    # only a loop of closed_loop tells what is block, what controller, and so where a prediction begins
    for cycle in cycles if finder.parts is not None else []:
        found, searches[id(cycle)] = finder.from_guess(cycle)
        orbit = known.kept(found)
        if found is not None and orbit is not None and not found.note:
            from_path[id(cycle)] = orbit
    fate = Fate()
    if search:
        beside = KnownOrbits(finder.poincare, list(orbits))
        fate = finder.explorer.explore(search_time, edges=not finder.by_simulation, known=beside)
        for orbit in fate.orbits:
            if orbit.status.ok or not orbits:
                known.kept(orbit)
    partner = _pairs(cycles, orbits, from_path)
    if finder.engine.delayed:
        return Check(tuple(_by_simulation(cycles, orbits, partner)), [], DELAYED, loop, fate)
    rows = []
    for cycle in cycles:
        match = partner.get(id(cycle))
        if match is None:
            rows.append(_unpaired(cycle, searches.get(id(cycle))))
        else:
            rows.append(Row(cycle, match, simulated(finder, match), _verdict(cycle, match)))
    paired = {id(orbit) for orbit in partner.values()}
    for orbit in orbits:
        if id(orbit) not in paired:
            rows.append(Row(None, orbit, simulated(finder, orbit), MISSED))
    return Check(tuple(rows), orbits, loop=loop, fate=fate)


def _unpaired(cycle: LimitCycle, search: NoOrbit | None) -> Row:
    """Row of a prediction without an orbit: `no such orbit` only where that was shown."""
    if cycle.branch:
        return Row(cycle, None, None, NOT_FOUND, _UNHELD)
    if search is not None and search.status is Status.NO_SUCH_ORBIT:
        return Row(cycle, None, None, NONE, search.proof)
    tried = (
        ""
        if search is None or not search.tried
        else "; ".join(f"{t.start}: {t.outcome}" for t in search.tried)
    )
    return Row(cycle, None, None, NOT_FOUND, tried)


def _verdict(cycle: LimitCycle, truth: Orbit) -> str:
    worst = max(abs(cycle.omega / truth.omega - 1), abs(cycle.amplitude / truth.amplitude - 1))
    return CONFIRMED if worst <= CONFIRMED_WITHIN else SHIFTED


def _by_simulation(cycles, motions, partner):
    """Rows of a loop whose motions can only be followed, not solved for."""
    for cycle in cycles:
        motion = partner.get(id(cycle))
        if motion is not None:
            why = "simulation settles on it" if motion.status.ok else "simulation: irregular, averages"
            seen = (motion.omega, motion.output_amplitude)
            yield Row(cycle, None, seen, _verdict(cycle, motion), why, motion)
        elif cycle.stable is False:
            yield Row(cycle, None, None, UNTESTED, "no simulation stays on an unstable cycle")
        else:
            yield Row(cycle, None, None, NOT_FOUND, "no simulation settles near it")
    paired = {id(motion) for motion in partner.values()}
    for motion in motions:
        if id(motion) not in paired:
            why = "simulation settles on it" if motion.status.ok else "simulation: irregular, averages"
            yield Row(None, None, (motion.omega, motion.output_amplitude), MISSED, why, motion)


def _pairs(cycles, orbits, from_path) -> dict[int, Orbit]:
    """Pair predictions with orbits, each once: those their own path from_path to first, then the nearest.

    An orbit within a prediction's stated band, or near it, is taken for it; agreeing on stability brings the
    two nearer.
    """
    near = []
    for cycle in cycles:
        for orbit in orbits:
            own = from_path.get(id(cycle)) is orbit
            if own or _close(cycle, orbit) or in_band(cycle, orbit):
                distance = abs(np.log(cycle.omega / orbit.omega)) + AMPLITUDE_COUNTS * abs(
                    np.log(cycle.amplitude / orbit.amplitude)
                )
                disagree = (
                    orbit.stable is not None and cycle.stable is not None and orbit.stable != cycle.stable
                )
                distance *= STABILITY_COUNTS if disagree else 1.0
                near.append((not own, distance, len(near), cycle, orbit))
    partner: dict[int, Orbit] = {}
    taken: set[int] = set()
    for *_, cycle, orbit in sorted(near, key=lambda n: n[:3]):
        if id(cycle) not in partner and id(orbit) not in taken:
            partner[id(cycle)] = orbit
            taken.add(id(orbit))
    return partner


def simulated(
    finder: OrbitFinder, orbit: Orbit, crossings: int = CROSSINGS_VERIFIED, apart: float = SET_ASIDE
) -> tuple[float, float] | None:
    """Frequency and output amplitude of a simulation started `apart` beside the orbit; None if it leaves."""
    if orbit.stable is False:
        return None
    if orbit.stable is None:
        return orbit.omega, orbit.output_amplitude
    met = finder.poincare.iterate(finder.feasible(orbit.states[:, 0] * (1 + apart)), crossings).crossings
    if len(met) < MET_LEAST:
        return None
    t = np.array([s[0] for s in met])
    span = t[-1] - t[len(t) // 2]
    turns = round(span * orbit.omega / (2 * np.pi))
    if turns < 1:
        return None
    omega = 2 * np.pi * turns / span
    engine = finder.engine
    spectrum = np.zeros((engine.noutputs, 2), complex)
    period = 2 * np.pi / omega
    run = engine.run(
        engine.start(met[-1][1]),
        period,
        rtol=TRAJECTORY_RTOL,
        max_step=period / STEPS_A_PERIOD,
        spectrum=spectrum,
        omega=omega,
    )
    amplitude = 2 * abs(spectrum[0, 1]) / period
    if not run.status.ok or not LEFT_ALONE[0] < amplitude / orbit.output_amplitude < LEFT_ALONE[1]:
        return None
    return omega, float(amplitude)


def _close(cycle: LimitCycle, orbit: Orbit) -> bool:
    ratio_w, ratio_a = cycle.omega / orbit.omega, cycle.amplitude / orbit.amplitude
    return max(ratio_w, 1 / ratio_w) <= SAME_CYCLE[0] and max(ratio_a, 1 / ratio_a) <= SAME_CYCLE[1]
