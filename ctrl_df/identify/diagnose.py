"""Which effect is missing: the library screened, the best confirmed by refitting and by held-out data."""

from __future__ import annotations

import time

from ..checks import executor as checked_executor
from ..checks import unknown_keywords
from .arguments import check_limits, check_quantities, effect_classes, free_parameters, mechanism_of
from .datasets.choice import dataset_of
from .results.diagnosis import Diagnosis
from .selection.verdict import verdict_of

__all__ = ["Diagnosis", "diagnose"]


def diagnose(
    model, data, *, holdout=None, candidates=None, free=None, executor=None, limits=None, **keywords
) -> Diagnosis:
    """Find the effect that a model misses.

    The model is refitted first: an effect counts only beyond what better parameters of the model explain.
    Every effect of the library (user-registered ones included) is then screened, refitted from start values
    read off the residual, and the best are confirmed at the full rate and on held-out data.

    Parameters
    ----------
    model : block or closed loop
        The model in use. Of a loop its block is diagnosed, driven by the recorded force.
    data : Measurement, FrequencyMeasurement or sequence of them
        Training records, or tables N(A, omega): every effect leaves its print on the plane, too.
    holdout : as `data`, or None
        Records to confirm on; None: every third part of the training records (every third point of the
        tables) is held out.
    candidates : sequence of str or None
        Effect ids to consider; None: the whole library.
    free : sequence of str or None
        Parameters of the model that may be refitted, by name or by effect id, as for `refit`; None: all that
        are free.
    executor : concurrent.futures.Executor or None
        Runs candidates side by side; None: threads of this process do.
    limits : mapping or None
        ``force`` [N] and ``stroke`` [m] for `next_experiment`.

    Returns
    -------
    Diagnosis
        For tables a `FrequencyDiagnosis`.

    Raises
    ------
    TypeError, ValueError
        Data that are no measurements, an unknown effect id, a model that is no block.
    """
    unknown_keywords(keywords)
    checked_executor("diagnose", executor)
    check_limits(limits)
    classes = effect_classes(candidates)
    began = time.perf_counter()
    dataset = dataset_of(data, holdout)
    block = mechanism_of(model)
    check_quantities(block, (*dataset.records, *dataset.held))
    search = dataset.search(block, free_parameters(block, free))
    return verdict_of(search, search.candidates(classes, executor), began, limits)
