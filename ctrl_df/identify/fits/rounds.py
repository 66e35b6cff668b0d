"""Rounds in which attempts at many effects compete: a few steps each, the best completed, then the rest.

The rest are given up as soon as they are hopeless against the best. Which fits are completed follows from the
data alone, so that results do not depend on how many run at once.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from ..estimation.fit import FitResult
from ..estimation.per_record import start_with_angles
from ..estimation.segmented import CandidateFit, SegmentedData
from ..thresholds import GIVE_UP, STILL_POSSIBLE
from .attempts import Attempt, Places, own_names
from .compared import nearest
from .thresholds import BEGUN, EFFORT_MOVED, PROMISES


@dataclass(frozen=True, eq=False)
class Best:
    """The best fit of every effect so far, and the least error of any model."""

    fits: Mapping[str, CandidateFit]
    least: float

    def near(self, key: str) -> bool:
        """Whether an effect may yet turn out to be the right one."""
        return key in self.fits and self.fits[key].train.rmse < STILL_POSSIBLE * self.least

    def promises(self, key: str, base: float) -> bool:
        """Whether an effect fits so well that one which contains it may be the right one.

        `base`: error of the model without it.
        """
        if key not in self.fits:
            return False
        error = self.fits[key].train.rmse
        explained, most = base**2 - error**2, base**2 - self.least**2
        return error < GIVE_UP * self.least and explained > PROMISES * most


@dataclass(frozen=True, eq=False)
class Rounds:
    """Rounds in which the fits of many effects compete.

    Attributes
    ----------
    run : callable
        Runs jobs in parallel.
    places : Places
    span : float
        Stroke of the records [m].
    kept : int
        Fits of an effect that are continued after the first steps.
    within : float
        Those within so many times the error of the best are continued, too.
    near : float
        Error above which a fit is given up.
    """

    run: Callable
    places: Places
    span: float
    kept: int
    within: float
    near: float

    def fitted(self, attempts: list[Attempt], best: Best) -> Best:
        """Complete the attempts that may be the best of their effect; return the best of all effects."""
        # those of few steps first: their errors show which of the others can be given up early
        started = self._run(_first_steps, [a for a in attempts if not a.multimodal], self.near)
        least = min([best.least, *(a.error for a in started)])
        started += self._run(_first_steps, [a for a in attempts if a.multimodal], GIVE_UP * least)
        started = [a for a in started if distinct(a.trial, self.span)]
        kept = best_of_each_effect(started, self.kept, self.within)
        # a few steps from the user's values show little: the baseline may have ended in another minimum
        own = [a for a in started if a.nominal]
        own = [
            a for short in (False, True) for a in best_of_each_effect([a for a in own if a.short is short], 1)
        ]
        started = [*kept, *(a for a in own if not any(a is o for o in kept))]
        ahead = best_of_each_effect(started, 1)[:2]
        found = self._run(_completed, ahead, self.near)
        least = min([least, *(t.train.rmse for t in found)])
        rest = [a for a in started if not any(a is o for o in ahead)]
        found += self._run(_completed, rest, GIVE_UP * least)
        fits = dict(best.fits)
        for t in found:
            known = fits.get(t.key)
            if distinct(t, self.span):
                fits[t.key] = t if known is None else nearest(t, known)
        return Best(fits, min([least, *(t.train.rmse for t in found)]))

    def _run(self, function: Callable, attempts, give_up: float) -> list:
        there = self.places.screen.data
        return self.run(function, [(a, self.places.data(a), there, give_up) for a in attempts])


def distinct(fitted: CandidateFit, span) -> bool:
    """Whether the newest effect is what its name says over the stroke `span` [m]."""
    own = fitted.block.newest + "."
    at_bound = {name.removeprefix(own) for name in fitted.train.names_at_bound if name.startswith(own)}
    return fitted.block.effects[-1].distinct(span, at_bound)


def best_of_each_effect(attempts, count, within=0.0) -> list[Attempt]:
    """Return the best of each effect, the best first: so many, and all within so many times its error."""
    kept = []
    for a in sorted(attempts, key=lambda a: a.error):
        same = [o for o in kept if o.key == a.key]
        if len(same) < count or a.error <= within * same[0].error:
            kept.append(a)
    return kept


def _first_steps(job) -> Attempt:
    """Take the first steps; fewer where the rate of descent excludes an error below `give_up`."""
    attempt, data, _, give_up = job
    block = attempt.block

    def fit(model, names, starts, iterations) -> FitResult:
        return data.fit(model, names, starts=starts, iterations=iterations)

    block, starts = start_with_angles(block, own_names(block), data.train.records, attempt.starts, fit)
    attempt = replace(attempt, block=block, starts=starts)
    return _continued(attempt, data, min(BEGUN, attempt.steps), give_up)


def _continued(attempt: Attempt, data: SegmentedData, steps, give_up) -> Attempt:
    fit = data.fit(
        attempt.block, attempt.names, starts=attempt.starts, iterations=steps, tolerance=attempt.tolerance,
        give_up=give_up, steps_left=attempt.steps if steps < attempt.steps else 0,
    )  # fmt: skip
    left = 0 if fit.converged else attempt.steps
    return replace(attempt, block=fit.model, fit=fit, starts=fit.starts, steps=left)


def _completed(job) -> CandidateFit:
    """Take the steps that are left, then those over the segments of the screen.

    They are left out where the rate of descent excludes an error below `give_up`.
    """
    attempt, begun, there, give_up = job
    if attempt.steps:
        attempt = _continued(attempt, begun, attempt.steps, give_up)
    trial = attempt.trial
    if not attempt.short:
        return trial
    return replace(trial, train=there.moved(trial.train, *EFFORT_MOVED, give_up))
