"""A model beside what was measured: how far off, whether beyond noise, and where."""

from __future__ import annotations

from ..checks import unknown_keywords
from .arguments import check_quantities
from .datasets.choice import dataset_of
from .residuals.compared import Compared
from .results.comparison import Comparison

__all__ = ["Comparison", "compare"]


def compare(model, data, *, mode: str = "auto", window: float | None = None, **keywords) -> Compared:
    """Simulate a model on records with the event engine and compare.

    Parameters
    ----------
    model : block or loop of `ctrl_df.closed_loop`
        A block runs on the recorded force. A loop runs on the reference: the record's channel ``reference``,
        or its input where there is no such channel.
    data : Measurement, FrequencyMeasurement or sequence of them
        What was recorded; tables N(A, omega) are compared with the describing function of the block.
    mode : {'auto', 'free', 'windows'}
        One run from a fitted initial state; or windows, each from an initial state of its own. Auto: a free
        run for loops, for models that a spring holds in place, and for short records; windows for the rest,
        as an inertia without a spring drifts whatever its parameters.
    window : float or None
        Length of the windows [s]; None: two to-and-fro motions.

    Returns
    -------
    Comparison
        For tables a `FrequencyComparison`.
    """
    unknown_keywords(keywords)
    dataset = dataset_of(data)
    check_quantities(model, dataset.records)
    return dataset.compare(model, mode, window)
