"""The ladder: one effect at a time while held-out error falls beyond noise."""

from __future__ import annotations

import math
from dataclasses import replace

from ..checks import count, unknown_keywords
from ..checks import executor as checked_executor
from .arguments import check_quantities, effect_classes, free_parameters, mechanism_of
from .course import COMPLETE, UNDER_WAY, Course
from .datasets.choice import dataset_of
from .results.diagnosis import NONE
from .results.ladder import Step, Study, last_diagnosis, outcome
from .selection.revision import Revision, revised
from .selection.verdict import diagnosed, worth
from .thresholds import RIVALS

__all__ = ["Step", "Study", "improve"]


def improve(
    model,
    train,
    holdout=None,
    max_effects=5,
    *,
    candidates=None,
    free=None,
    executor=None,
    progress=None,
    callback=None,
    budget=None,
    **keywords,
) -> Study:
    """Add the effects a model misses, one at a time, as long as held-out error falls beyond noise.

    Parameters
    ----------
    model : block or closed loop
        Where to begin.
    train : Measurement, FrequencyMeasurement or sequence of them
        Records, or tables N(A, omega), to fit.
    holdout : as `train`, or None
        Records to confirm on; None: every third part of the training records, or point of the tables.
    max_effects : int
        Longest ladder, >= 0.
    candidates, free, executor, progress
        As for `diagnose`.
    callback : callable or None
        Takes the `Study` as it stands, first within seconds. What it raises ends the ladder.
    budget : float or None
        Seconds after which the ladder returns what is known, its `status` ``"budget spent"``; the first
        screened ranking is waited for in any case. None: as many as it takes.

    Returns
    -------
    Study
        Ctrl-C returns what is known, its `status` ``"interrupted"``.

    Raises
    ------
    KeyboardInterrupt
        Ctrl-C before anything is known.

    Examples
    --------
    >>> names = ["constant_force", "quadratic_drag"]
    >>> t = np.arange(0, 4, 0.01)
    >>> F = 9 * np.sin(3 * t) + 5 * np.sin(8 * t)
    >>> machine = cdf.friction_mass(2.2, 3.0, 6.0).with_effect(cdf.ConstantForce(1.0))
    >>> x = np.asarray(cdf.event_response(machine, t, F, input_hold="zoh").outputs)[0]
    >>> record = cdf.Measurement(t, F, x + 1e-4 * np.random.default_rng(1).standard_normal(t.size))
    >>> study = cdf.improve(cdf.friction_mass(2.0, 2.5, 5.0), record, candidates=names)
    >>> study.verdict, study.effects
    ('effect', ('constant_force',))
    """
    unknown_keywords(keywords)
    max_effects = count("improve", "max_effects", max_effects, least=0, meaning="longest ladder")
    checked_executor("improve", executor)
    course = Course("improve", progress, callback, budget)
    dataset = dataset_of(train, holdout, "train")
    start, classes = mechanism_of(model), effect_classes(candidates)
    check_quantities(start, (*dataset.records, *dataset.validation))
    kept = frozenset(start.parameters) - set(free_parameters(start, free))
    climb = _Climb(start, classes, kept, dataset, executor, course)
    return course.run(lambda: climb.to(max_effects))


class _Climb:
    """One ladder, on its way."""

    def __init__(self, start, classes, kept, dataset, executor, course: Course):
        self.start, self.classes, self.kept, self.dataset = start, classes, kept, dataset
        self.executor, self.course = executor, course

    def to(self, most: int) -> Study:
        """Climb `most` steps at the most."""
        rivals: dict[str, list] = {}
        steps: list[Step] = []
        added, revision = None, Revision(self.start)
        while True:
            search, found = self._asked(revision, added, steps, most)
            steps.append(_step(found, added, revision))
            best = found.ranking[0] if found.ranking else None
            if best is None or found.verdict == NONE or not worth(best, search):
                break
            self.course.known(self._study([*steps, _next(best, found)], search, UNDER_WAY))
            self.course.stage("earlier effects looked at again")
            confirmed = [
                c.effect for c in found.ranking[1:] if c.confirmed and c.evidence > search.significant
            ]
            rivals[best.model.newest] = confirmed[:RIVALS]
            added, revision = best, revised(best.model, self.start, search, self.kept, rivals)
        self.course.known(self._study(steps, search, UNDER_WAY))
        self.course.stage("all models over the same data")
        again = search.final([s.model for s in steps], self.kept)
        if again is not None:
            steps = [
                replace(s, model=m, nrmse=e, nrmse_holdout=h, parameters=_values(m))
                for s, (m, e, h) in zip(steps, again, strict=True)
            ]
        return self._study(steps, search, COMPLETE)

    def _asked(self, revision: Revision, added, steps, most):
        """Ask what the model of a step misses."""
        block = revision.block
        self.course.stage(f"step {len(steps)}: the model refitted")
        search = self.dataset.search(block, [k for k in free_parameters(block) if k not in self.kept])

        def so_far(found):
            return self._study([*steps, _step(found, added, revision)], search, UNDER_WAY)

        classes = self.classes if len(steps) < most else []
        return search, diagnosed(search, classes, self.executor, self.course.within(so_far))

    def _study(self, steps, search, status) -> Study:
        noise = search.relative(last_diagnosis(steps).noise)
        return Study(
            tuple(steps), steps[-1].model, outcome(steps), noise, self.start, self.dataset.records,
            self.dataset.validation, self.course.seconds, status,
        )  # fmt: skip


def _next(best, found) -> Step:
    """Return the step that a diagnosis leads to, before earlier effects are looked at again."""
    return Step(
        best.id, (), best.model, best.nrmse, best.nrmse_holdout, best.evidence, _values(best.model),
        best.equivalents, found,
    )  # fmt: skip


def _step(found, added, revision: Revision) -> Step:
    effect, evidence, same = ("", 0.0, ()) if added is None else (added.id, added.evidence, added.equivalents)
    errors = found.nrmse, found.nrmse_holdout
    if added is not None and not math.isfinite(errors[1]):  # not tried on what is held out yet
        errors = added.nrmse, added.nrmse_holdout
    return Step(
        effect, revision.dropped, found.model, *errors, evidence,
        _values(found.model), same, found, revision.instead,
    )  # fmt: skip


def _values(model) -> dict[str, float]:
    return {k: p.value for k, p in model.parameters.items()}
