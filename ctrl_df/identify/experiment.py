"""The next experiment: the input that separates the candidates that remain."""

from __future__ import annotations

from .arguments import check_limits, limit_units
from .datasets.choice import dataset_of
from .results.experiment import Experiment

__all__ = ["Experiment", "next_experiment"]


def next_experiment(diagnosis, *, duration=None, dt=None, loop=None, **limits) -> Experiment | None:
    """Choose the input that separates the remaining candidates best.

    Where one candidate is left it is separated from the model without it.

    Parameters
    ----------
    diagnosis : Diagnosis
        Of records over time, or of frequency tables: the input is then a sequence of sines.
    duration, dt : float or None
        [s]; None: as the first record (tables: what the sines need).
    loop : loop of `ctrl_df.closed_loop` or None
        Where the drive must stay under control: its controller moves every candidate, and the input is the
        reference [m or rad].
    **limits : float
        ``force`` [N] and ``stroke`` [m] from the start, or as `diagnose` names them for the machine; those
        left out: as given to `diagnose`, else what the records reached, and twice the stroke of the first.

    Returns
    -------
    Experiment or None
        None where nothing remains to be separated (verdict ``none``).

    Raises
    ------
    ValueError
        Limits that are not positive, or those of another machine; candidates that leave the stroke under
        every input.
    """
    remaining = [c for c in diagnosis.remaining if c.model is not None]
    if diagnosis.verdict == "none" or not remaining:
        return None
    given = check_limits("next_experiment", diagnosis.model, limits)
    force, stroke = ((diagnosis.limits | given).get(word) for word in limit_units(diagnosis.model))
    models = [diagnosis.model] if len(remaining) == 1 else []
    models += [c.model for c in remaining]
    names = tuple(c.id for c in remaining)
    return dataset_of(diagnosis.model, diagnosis.train).plan(
        diagnosis, models, names, force=force, stroke=stroke, duration=duration, dt=dt, loop=loop
    )
