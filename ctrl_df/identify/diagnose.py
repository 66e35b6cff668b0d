"""Which effect is missing: the library screened, the best confirmed by refitting and by held-out data."""

from __future__ import annotations

from operator import attrgetter

from ..checks import executor as checked_executor
from .arguments import (
    check_candidates,
    check_limits,
    check_quantities,
    effect_classes,
    known_beforehand,
    mechanism_of,
    own_parameters,
    with_those,
)
from .datasets.choice import dataset_of
from .monitor import Monitor
from .results.diagnosis import Diagnosis
from .selection.verdict import diagnosed

__all__ = ["Diagnosis", "diagnose"]


def diagnose(
    model,
    data,
    *,
    holdout=None,
    candidates=None,
    free=None,
    own=None,
    prior=None,
    executor=None,
    limits=None,
    progress=None,
    callback=None,
    budget=None,
) -> Diagnosis:
    """Find the effect that a model misses.

    The model is refitted first: an effect counts only beyond what better parameters of the model explain.
    Every effect of the library (user-registered ones included) is then screened, refitted from start values
    read off the residual, and the best are confirmed at the full rate and on held-out data.

    Parameters
    ----------
    model : block or closed loop
        The model in use. Of a loop its block is diagnosed, driven by the recorded force; where the input is
        the reference (in m, not N), by the force that the controller makes of it and of the output. Where a
        gap or an elastic joint may be missing it says which side of it the sensor sees: the load, or, as
        ``model.with_measured("motor")``, the motor. The other side is not tried.
    data : Measurement, FrequencyMeasurement or sequence of them
        Training records, or tables N(A, omega): every effect leaves its signature on the plane, too.
    holdout : as `data`, or None
        Records to confirm on; None: every third part of the training records (every third point of the
        tables) is held out.
    candidates : sequence of str or None
        Effect ids to consider; None: the whole library.
    free : sequence of str or None
        Parameters of the model that may be refitted, by name or by effect id, as for `refit`; None: all that
        are free.
    own : sequence of str or None
        Parameters of the model that differ between records, as for `refit`: they are re-estimated on
        held-out records.
    prior : mapping or None
        What is known of parameters besides the records, as for `refit`; also of those of effects that the
        model may be given, ``{"stribeck.level": (9.0, 0.5)}``.
    executor : concurrent.futures.Executor or None
        Runs candidates side by side; None: threads of this process do.
    limits : mapping or None
        For `next_experiment`: ``force`` [N] and ``stroke`` [m]; of a machine that turns ``torque`` [N m] and
        ``angle`` [rad]; of one driven by a motor ``voltage`` [V] or ``current`` [A] instead.
    progress : bool, callable or None
        Whether to report progress on stderr (None: if that is a terminal); or a function that takes a line
        of text. The logger ``ctrl_df`` has the same lines.
    callback : callable or None
        Receives the `Diagnosis` as it stands, for the first time when every effect is screened: within
        seconds. An exception that it raises ends the diagnosis.
    budget : float or None
        Seconds after which the diagnosis returns what is known, its `status` ``"budget spent"``; the
        screened ranking is waited for in any case. None: as many as it takes.

    Returns
    -------
    Diagnosis
        For tables a `FrequencyDiagnosis`. Ctrl-C returns what is known, its `status` ``"interrupted"``:
        before the first result that is the model as given, its verdict ``"unknown"``, errors NaN.

    Raises
    ------
    TypeError, ValueError
        Data that are no measurements, an unknown effect id, a model that is no block.

    Examples
    --------
    >>> names = ["constant_force", "quadratic_drag"]
    >>> t = np.arange(0, 4, 0.01)
    >>> F = 9 * np.sin(3 * t) + 5 * np.sin(8 * t)
    >>> machine = cdf.friction_mass(2.2, 3.0, 6.0).with_effect(cdf.ConstantForce(1.0))
    >>> x = np.asarray(cdf.event_response(machine, t, F, input_hold="zoh").outputs)[0]
    >>> record = cdf.Measurement(t, F, x + 1e-4 * np.random.default_rng(1).standard_normal(t.size))
    >>> diagnosis = cdf.diagnose(cdf.friction_mass(2.0, 2.5, 5.0), record, candidates=names)
    >>> diagnosis.verdict, diagnosis.best.id, round(diagnosis.best.parameters["force"], 1)
    ('effect', 'constant_force', 1.0)
    """
    checked_executor("diagnose", executor)
    classes = effect_classes(candidates)
    monitor = Monitor("diagnose", progress, callback, budget)
    dataset = dataset_of(model, data, holdout).driven_by_force(model)
    block = mechanism_of(model)
    check_candidates(classes, block)
    limits = check_limits("diagnose", block, limits)
    check_quantities(block, (*dataset.records, *dataset.validation))
    own = own_parameters(block, own)
    names = with_those(dataset.free_parameters(block, free), own)
    dataset = dataset.with_prior(known_beforehand(block, names, prior))
    block = dataset.with_own(block, own)

    kept = frozenset(block.parameters) - set(names)

    def search_with(model):
        return dataset.search(model, dataset.estimated_parameters(model, kept))

    def work():
        monitor.stage("the model refitted")
        part = monitor.within(attrgetter("diagnosis"))
        search = dataset.search(block, names)
        return diagnosed(search, classes, executor, part, limits, search_with).diagnosis

    def nothing():
        return dataset.diagnosis.unknown(block, dataset.records, dataset.validation, limits)

    return monitor.run(work, nothing)
