"""A model beside what was measured: how far off, whether beyond noise, and where."""

from __future__ import annotations

from .arguments import check_quantities
from .datasets.choice import dataset_of
from .residuals.comparison_base import ComparisonBase
from .results.comparison import Comparison

__all__ = ["Comparison", "compare"]


def compare(model, data, *, mode: str = "auto", window: float | None = None) -> ComparisonBase:
    """Simulate a model on records with the event engine and compare.

    Parameters
    ----------
    model : block or loop of `ctrl_df.closed_loop`
        A block runs on the recorded force. A loop runs on the reference: the record's channel ``reference``,
        or its input where there is no such channel (a warning says where the output hardly follows it).
    data : Measurement, FrequencyMeasurement or sequence of them
        What was recorded; tables N(A, omega) are compared with the describing function of the block.
    mode : {'auto', 'free', 'windows'}
        One run from a fitted initial state; or segments, each from an initial state of its own. Auto: a free
        run for loops, for models that a spring holds in place, and for short records; segments for the rest:
        an inertia without a spring drifts whatever its parameters, and a chaotic motion (impacts between
        stops) is not to be predicted for long.
    window : float or None
        Length of the segments [s], from 20 samples to the longest record; None: two to-and-fro motions,
        and with "auto" less of a chaotic one.

    Returns
    -------
    Comparison
        For tables a `FrequencyComparison`.

    Raises
    ------
    TypeError
        Data that are no measurements, a model that is neither a block nor a loop.
    ValueError
        Records of a quantity that the model does not have, an unknown `mode`, a `window` shorter than 20
        samples or longer than the records, segments of tables.

    Warns
    -----
    RuntimeWarning
        The simulation ends before the record does (`ctrl_df.event_response` shows why).

    Examples
    --------
    >>> t = np.arange(0, 4, 0.01)
    >>> F = 9 * np.sin(3 * t) + 5 * np.sin(8 * t)
    >>> machine = cdf.friction_mass(2.2, 3.0, 6.0)
    >>> x = np.asarray(cdf.event_response(machine, t, F, input_hold="zoh").outputs)[0]
    >>> record = cdf.Measurement(t, F, x + 1e-4 * np.random.default_rng(1).standard_normal(t.size))
    >>> comparison = cdf.compare(cdf.friction_mass(2.0, 2.5, 5.0), record)
    >>> comparison.fit_percent < 90, bool(comparison.white)
    (True, False)
    """
    dataset = dataset_of(model, data)
    check_quantities(model, dataset.records)
    dataset.warn_of_doubts(model)
    return dataset.compare(model, mode, window)
