"""Where windows begin: tries of initial states that a descent from the estimate does not reach.

`problem` is a `shooting.Problem`; what is found goes into its `nuisance`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

# Speeds to begin a window with, over how far the estimate may be off.
_SPEEDS = (-1, -0.6, -0.3, -0.15, 0, 0.15, 0.3, 0.6, 1)


def rescue(problem, theta) -> bool:
    """Try other starts where single windows err far more than the rest; whether any was better.

    Stick and slip make the error of a window a rough function of the speed it begins with, and so does a gap
    of where in it and how fast the other body is: a start that is estimated badly may lie in another valley.
    What the window before ends with is tried first.
    """
    found, values = False, problem.values(theta)
    for k, simulator in enumerate(problem.simulators):
        if "v" not in simulator.nuisances or simulator.chained:
            continue
        column, windows, starts = simulator.nuisances.index("v"), problem.windows[k], problem.nuisance[k]
        rms = np.array([math.sqrt(float(np.mean(problem.last[k][w] ** 2))) for w in windows.slices])
        bad = (rms > 1.5 * np.quantile(rms, 0.25)) & (rms > 2 * problem.noise)
        if not bad.any():
            continue
        some = windows.only(bad)
        measured, least = problem.records[k].y[some.samples], 0.7 * rms[bad] ** 2
        problem.priors[k][bad, column] = problem.widest[k][bad, column]
        reach, chosen = problem.priors[k][bad, column], starts[bad].copy()
        before = simulator.carried_on(windows, values, starts)[bad]
        before = np.where(np.isfinite(before), before, starts[bad])
        tries: list[tuple[Any, Any]] = [
            (slice(None), before),
            (slice(None), simulator.at_rest(some, values)),
        ]
        tries += [(column, f * reach) for f in _SPEEDS]
        if "slack" in simulator.nuisances:
            at = simulator.nuisances.index("slack")
            tries += [(slice(at, at + 2), pair) for pair in _slacks(problem, k)]
        for which, value in tries:
            trial = starts[bad].copy()
            trial[:, which] = value
            e = measured - simulator.run(some, values, trial)
            for w, where in enumerate(some.slices):
                shift = 0.0 if simulator.tied else float(np.mean(e[where]))
                power = float(np.mean((e[where] - shift) ** 2))
                if power < least[w]:
                    least[w], chosen[w], found = power, trial[w], True
                    chosen[w, 0] += shift
        starts[bad] = chosen
        problem.count(len(tries) * len(some) / len(windows))
    return found


def scan_slack(problem, theta):
    """Find where in its gap each window begins, and how fast it crosses it (the cost has several minima)."""
    for k, simulator in enumerate(problem.simulators):
        if "slack" not in simulator.nuisances:
            continue
        at = simulator.nuisances.index("slack")
        windows, chosen = problem.windows[k], problem.nuisance[k].copy()
        least, values, tries = np.full(len(windows), np.inf), problem.values(theta), _slacks(problem, k)
        for place, rate in tries:
            trial = problem.nuisance[k].copy()
            trial[:, at], trial[:, at + 1] = place, rate
            e = problem.measured[k] - simulator.run(windows, values, trial)
            errors = np.array([np.sum((e[w] - e[w].mean()) ** 2) for w in windows.slices])
            better = errors < least
            chosen[better], least = trial[better], np.minimum(least, errors)
        problem.nuisance[k] = chosen
        problem.count(len(tries) / len(problem.simulators))


def _slacks(problem, k) -> list[tuple[float, float]]:
    """Return places in a gap (0 to 1), and rates [m/s] of crossing it, to begin a window with."""
    speed = problem.known[k].speed
    rates = [f * speed for f in (0.0, -0.2, 0.2, -0.7, 0.7)]
    return [(p, r) for p in (0.02, 0.25, 0.5, 0.75, 0.98) for r in rates]
