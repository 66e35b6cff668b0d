"""The phase of a ripple belongs to the record: an encoder's zero is chosen anew at every start."""

from __future__ import annotations

import math

from .candidate import Candidate

TRIED = 6
"""Phases from which one is sought."""

WORTH = 50.0
"""Log likelihood ratio [nats, for white noise] that another phase must bring, or the model's own stands."""


def rephased(near: Candidate, fit) -> Candidate:
    """Return a model with the phases of its ripples as a record has them, where that record says so.

    Parameters
    ----------
    near : Candidate
        The model with its initial states fitted.
    fit : callable
        ``fit(block, names, starts, iterations)`` over the same windows.
    """
    best = near
    for key in [k for k in near.model.named_effects if k.startswith("position_ripple")]:
        name = f"{key}.phase"
        own, found = best.model.parameters[name].value, best
        for i in range(1, TRIED):
            block = best.model.with_parameters({name: own + 2 * math.pi * i / TRIED})
            tried = fit(block, (), best.starts, 1)
            found = min(found, tried, key=lambda f: f.rmse)
        found = fit(found.model, (name,), found.starts, 5)
        if found.count * math.log(best.rmse / found.rmse) > WORTH:
            best = found
    return best
