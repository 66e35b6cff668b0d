"""Coexisting answers to one force: motions reached from many starts, each named once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...simulate.crew import processors
from ..threads import on_threads
from .orbits import solver_for

_TOGETHER = 4  # starts that one thread takes at a time


@dataclass(frozen=True)
class OrbitAttractor:
    """One of the motions that coexist at (A, omega).

    Attributes
    ----------
    regime : str
        As in `ctrl_df.df.forced_orbit.orbits.ORBIT_REGIMES`.
    harmonics : (orders + 1,) complex array
        Y_k / A; NaN where nothing moves or the motion runs away.
    residual : float
        As in `ctrl_df.df.forced_orbit.orbits.orbit_family`.
    share : float
        Part of the starts that led here, 0 to 1.
    """

    regime: str
    harmonics: np.ndarray
    residual: float
    share: float


def orbit_attractors(block, A, omega, *, starts=24, orders=9, output=None, seed=0, tol=1e-6, **options):
    """List the distinct motions of a block under ``A cos(omega t)``, most frequent first.

    Parameters
    ----------
    block : ct.NonlinearIOSystem
        One input.
    A, omega : float
        Amplitude and frequency [rad/s], > 0.
    starts : int
        States tried: rest, then random ones up to three times as large as the motion first found.
    orders, output
        As in `ctrl_df.df.forced_orbit.orbits.orbit_family`.
    seed : int
        Of the random states.
    tol : float
        Two motions are one if regime and harmonics agree within this, relative; a motion and its mirror image
        are one, aperiodic motions agree within their errors.
    **options
        `transient`, `averages`, `max_steps` as in `ctrl_df.df.forced_orbit.orbits.orbit_family`.

    Returns
    -------
    list of OrbitAttractor
    """
    solver = solver_for(block, output, **options)
    point = float(A), float(omega), int(orders)
    first = _answers(solver, [None], *point)
    size = np.maximum(solver.shot.size, A / solver.inertia / omega**solver.symmetries.power)
    tried = 3 * np.random.default_rng(seed).uniform(-1, 1, size=(int(starts) - 1, len(size))) * size
    shares = np.array_split(tried, max(len(tried) // _TOGETHER, 1))
    tasks = [(block, output, options, share, *point) for share in shares]
    threads = 1 if solver.engine.calls_python else processors()
    found: list[list] = []
    for harmonics, regime, residual in first + sum(on_threads(_share, tasks, threads), []):
        for entry in found:
            if _same(entry, harmonics, regime, residual, tol):
                entry[3] += 1
                break
        else:
            found.append([regime, harmonics, residual, 1])
    found.sort(key=lambda entry: -entry[3])
    return [OrbitAttractor(r, h, e, n / starts) for r, h, e, n in found]


def _share(block, output, options, tried, *point):
    """Answers from some starts, in the coordinates of the symmetries."""
    solver = solver_for(block, output, **options)
    return _answers(solver, [solver._state(y) for y in tried], *point)


def _answers(solver, states, A, omega, orders):
    answers = []
    for state in states:
        solver.forget()
        answers.append(solver.solve_from(state, A, omega, orders))
    return answers


def _same(entry, harmonics, regime, residual, tol):
    known_regime, known, known_residual, _ = entry
    if known_regime != regime:
        return False
    if np.isnan(known).any() or np.isnan(harmonics).any():
        return bool(np.isnan(known).all() and np.isnan(harmonics).all())
    if regime == "aperiodic":
        tol = max(tol, 3 * (residual + known_residual))
        return bool(abs(known[1] - harmonics[1]) <= tol * abs(known[1]))
    size = np.max(np.abs(known[1:]))
    mirrored = known * (-1.0) ** (np.arange(len(known)) + 1)
    return any(np.max(np.abs(harmonics - h)) <= tol * size for h in (known, mirrored))
