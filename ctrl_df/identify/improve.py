"""The ladder: one effect at a time while held-out error falls beyond noise, and back where it was wrong."""

from __future__ import annotations

from ..checks import count
from ..checks import executor as checked_executor
from .arguments import (
    check_candidates,
    check_quantities,
    effect_classes,
    known_beforehand,
    mechanism_of,
    own_parameters,
    with_those,
)
from .datasets.choice import dataset_of
from .ladder.stepwise import StepwiseSelection
from .ladder.visits import Visits
from .monitor import Monitor
from .results.ladder import Step, Study

__all__ = ["Step", "Study", "improve"]


def improve(
    model,
    train,
    holdout=None,
    max_effects=5,
    *,
    candidates=None,
    free=None,
    own=None,
    prior=None,
    executor=None,
    progress=None,
    callback=None,
    budget=None,
) -> Study:
    """Add the effects a model misses, one at a time, as long as held-out error falls beyond noise.

    After each, those added before are examined again; at the end every model that differs by one effect is
    tried (`Study.neighbours`), and the ladder goes on from one that is better, or as good and simpler.
    Effects of the given model stay.

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
    candidates, free, own, prior, executor, progress
        As for `diagnose`.
    callback : callable or None
        Receives the `Study` as it stands, for the first time within seconds. An exception that it raises
        ends the ladder.
    budget : float or None
        Seconds after which the ladder returns what is known, its `status` ``"budget spent"``; the first
        screened ranking is waited for in any case. None: as many as it takes.

    Returns
    -------
    Study
        ``steps[-1].diagnosis`` is the `Diagnosis` of the final model: its `ranking`, `regions` and `doubts`.
        Ctrl-C returns what is known, its `status` ``"interrupted"``: before the first result that is the
        model as given, its verdict ``"unknown"``, errors NaN.

    Raises
    ------
    TypeError, ValueError
        As `diagnose`; also `max_effects` < 0.

    Examples
    --------
    >>> t = np.arange(0, 4, 0.01)
    >>> F = 9 * np.sin(3 * t) + 5 * np.sin(8 * t)
    >>> machine = cdf.friction_mass(2.2, 3.0, 6.0).with_effect(cdf.ConstantForce(1.0))
    >>> x = np.asarray(cdf.event_response(machine, t, F, input_hold="zoh").outputs)[0]
    >>> record = cdf.Measurement(t, F, x + 1e-4 * np.random.default_rng(1).standard_normal(t.size))
    >>> study = cdf.improve(cdf.friction_mass(2.0, 2.5, 5.0), record, candidates=["constant_force"])
    >>> study.verdict, study.effects
    ('effect', ('constant_force',))
    """
    max_effects = count("improve", "max_effects", max_effects, least=0, meaning="longest ladder")
    checked_executor("improve", executor)
    monitor = Monitor("improve", progress, callback, budget)
    dataset = dataset_of(model, train, holdout, "train").driven_by_force(model)
    start, classes = mechanism_of(model), effect_classes(candidates)
    check_candidates(classes, start)
    check_quantities(start, (*dataset.records, *dataset.validation))
    own = own_parameters(start, own)
    names = with_those(dataset.free_parameters(start, free), own)
    kept = frozenset(start.parameters) - set(names)
    dataset = dataset.with_prior(known_beforehand(start, names, prior)).begun_with(start)
    start = dataset.with_own(start, own)

    def free_of(block) -> list[str]:
        return dataset.estimated_parameters(block, kept)

    visits = Visits(dataset, start, classes, free_of, max_effects, executor, monitor)

    def nothing():
        return Study.unknown(dataset.diagnosis.unknown(start, dataset.records, dataset.validation, {}))

    return monitor.run(StepwiseSelection(visits).run, nothing)
