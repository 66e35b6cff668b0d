"""One effect tried on a table N(A, omega): from its best starts, with and without points that are far off."""

from __future__ import annotations

from ..shooting.scales import Scales
from .errors import log_density, outlying
from .fit import FittedTable, fit_table
from .simulated import relative_error, simulate_table
from .starts import best_starts
from .thresholds import STEPS_BEGUN, STEPS_ENDED, TABLE_STEPS, VARIANCE_LEAST, WORK_LOW, WORK_MEDIUM


def try_effect(job) -> tuple[str, FittedTable, int] | None:
    """Fit one effect class from its best starts (a job of its own, for executors)."""
    cls, block, points, free, scales, slopes = job
    scales = Scales(scales.force, scales.position, scales.speed, scales.mass, scales.drive)
    slow = cls.costly
    work = WORK_LOW if slow else WORK_MEDIUM
    grown, promising = best_starts(cls, block, points, slopes, free, scales, cls.table_starts, work)
    if not grown:
        return None
    own = tuple(k for k, p in grown[0].parameters.items() if k not in block.parameters and p.estimated)

    def fitted(start, iterations):
        return fit_either(
            start, points, (*free, *own), scales,
            again=False, iterations=iterations, tolerance=TABLE_STEPS["try"], work=work,
        )  # fmt: skip

    if not promising:
        return cls.id, fitted(grown[0], 0), len(own)
    first = [fitted(g, STEPS_BEGUN) for g in grown]
    best = max(first, key=_likelihood_of)
    return cls.id, best if slow or best.converged else fitted(best.block, STEPS_ENDED), len(own)


def fit_either(block, points, names, scales, *, again=True, **options) -> FittedTable:
    """Fit to all points and, where a few are far off, to the others; return the likeliest.

    `again` says whether to begin with those that are far off at the start, too.
    """
    fits = [fit_table(block, points, names, scales, **options)]
    first_guesses = [(fits[0].block, fits[0].error)]
    if again:
        table = simulate_table(block, points, options.get("work"))
        first_guesses.append((block, relative_error(table, points)))
    for start, error in first_guesses:
        far = outlying(error)
        if far.any():
            fits.append(fit_table(start, points.without(far), names, scales, **options))
    return max(fits, key=_likelihood_of)


def _likelihood_of(fitted: FittedTable) -> float:
    return float(log_density(fitted.error, VARIANCE_LEAST)[0].sum())
