"""Laws with events make the cost rough: a fit is begun again from either side of where it ended.

An impact more or less, a mass that sticks or breaks away: each changes the output by a jump, so that the cost over
a gap, a restitution or a static level has many valleys side by side. The next ones are a hop away.
"""

from __future__ import annotations

from collections.abc import Callable

from .candidate import Candidate
from .simulator import feasible

_ROUGH = ("backlash.", "hard_stop.", "stiction.", "stribeck.")
_HOPS = (0.6, 0.8, 1.25, 1.6)
_SMALL = (
    0.8,
    0.95,
    0.985,
    0.995,
    1.005,
    1.015,
    1.05,
    1.25,
)  # static levels: thresholds that single samples pass
_WORTH = 0.99  # error over the one before that counts as a better valley
_SAME = 1.001  # error over the least that counts as the same floor
_REACH = (0.0025, 0.005, 0.01, 0.02, 0.04)  # how far the floor about a threshold is sought


def rough(found: Candidate) -> list[str]:
    """Return the free parameters over which the cost has many valleys."""
    return [name for name in found.names if name.startswith(_ROUGH)]


def hopped(found: Candidate, fit: Callable[..., Candidate], iterations: int = 4) -> Candidate:
    """Return the best of the fits that begin beside `found`, one rough parameter moved at a time; or itself.

    Parameters
    ----------
    found : Candidate
    fit : callable
        ``fit(model, names, starts=, iterations=)`` over the windows of `found`.
    iterations : int
        Of each fit.
    """
    for name in rough(found):
        at, best = found.parameters[name], found
        for factor in _SMALL if name.endswith(".level") else _HOPS:
            moved = found.model.with_parameters(
                feasible(found.model, {name: _within(found, name, factor * at)})
            )
            near = fit(moved, (), starts=found.starts, iterations=iterations)
            if near.rmse > 3 * found.rmse:
                continue
            tried = fit(moved, found.names, starts=near.starts, iterations=iterations)
            if tried.rmse < _WORTH * best.rmse:
                best = tried
        found = best
    return centred(found, fit)


def centred(found: Candidate, fit: Callable[..., Candidate]) -> Candidate:
    """Move static levels to the middle of the range over which they make no difference: they are known no better."""
    for name in ("stiction.level", "stribeck.level"):
        if name in found.names:
            found = _centred(found, fit, name)
    return found


def _centred(found, fit, name) -> Candidate:
    at, edges = found.parameters[name], []
    for sign in (-1, 1):
        edge = 1.0
        for reach in _REACH:
            factor = 1 + sign * reach
            moved = found.model.with_parameters(feasible(found.model, {name: factor * at}))
            if fit(moved, (), starts=found.starts, iterations=2).rmse > _SAME * found.rmse:
                break
            edge = factor
        edges.append(edge)
    if edges == [1.0, 1.0]:
        return found
    value = 0.5 * sum(edges) * at
    moved = found.model.with_parameters(feasible(found.model, {name: value}))
    tried = fit(moved, found.names, starts=found.starts, iterations=1)
    return tried if tried.rmse < _SAME * found.rmse else found


def _within(found, name, value):
    p = found.model.parameters[name]
    return min(max(value, p.lower), p.upper)
