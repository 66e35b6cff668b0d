"""Steps of parameters that lead past events.

Where impacts come and go, a step that is right for most segments leaves a few of them on the other side of an
event, in a wrong minimum over where they begin, and is refused for their sake: a descent ends far from where
its own steps point. Here the segments that are followed give the step; those that it makes worse restart,
and what all of them then come to decides.

`stage` is a `least_squares.Stage`, `found` the `Solution` that it has come to.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .elimination import rounded_moves
from .noise_model import power
from .states import find_states
from .thresholds import BETTER_MINIMUM, DAMPING, OUTLYING_SEGMENT, RIGHT_SHARE, SHARES_PAST


def step_past_events(stage, found):
    """Return what a step past events leads to; None where it does not lead to a better minimum."""
    problem = stage.problem
    base = [m - e for m, e in zip(stage.measured, found.residual, strict=True)]
    jp, js = stage.jacobian(found.theta, found.states, base)
    products = stage.products(jp, js, found.residual, stage.trusts(found))
    h, g, back = stage.normal(products, found.states, DAMPING)
    error = power(found.residual) / sum(map(len, found.residual))
    known = problem.precision * error
    pull = known * (found.theta - problem.about)
    h += np.diag(known)
    step = stage.step(h, g - pull, found.theta, DAMPING)
    for share in SHARES_PAST:
        moves = rounded_moves(share * step, 1.0, np.diag(h), error)
        moved = zip(problem.variables, found.theta + moves, strict=True)
        theta = np.array([v.clip(q) for v, q in moved])
        trial = _restarted(stage, theta, back(theta - found.theta), found)
        if power(trial.residual) < BETTER_MINIMUM**2 * power(found.residual):
            return trial
    return None


def _restarted(stage, theta, states, found):
    """Return the stage at other parameters; segments that err more than before, or than most, are restarted.

    `states`: where the segments begin if no event is passed.
    """
    states, residual = stage.followed_states(theta, states)
    values, reach = [a.copy() for a in states.values], [p.copy() for p in states.reach]
    for k, segments in enumerate(stage.segments):
        errors, before = segments.means(residual[k] ** 2), segments.means(found.residual[k] ** 2)
        worse = (errors > before) | (errors > OUTLYING_SEGMENT**2 * np.quantile(errors, RIGHT_SHARE))
        if not worse.any() or not values[k].size:
            continue
        some, samples = segments.only(worse), segments.spread(worse)
        alone = stage.alone(theta, None, slice(k, k + 1)).over([some], None)
        starts = find_states(alone)[0]
        restarted = alone.residual(np.zeros(0), [starts])[0]
        stage.problem.count_beside(alone.problem.nfev * len(some) / len(segments))
        better = some.means(restarted**2) < errors[worse]
        rows = np.flatnonzero(worse)[better]
        values[k][rows] = starts[better]
        kept = residual[k][samples]
        residual[k][samples] = np.where(some.spread(better), restarted, kept)
    return replace(
        found,
        theta=theta,
        states=replace(states, values=values, reach=reach).widened,
        residual=residual,
        slopes=None,
        converged=False,
    )
