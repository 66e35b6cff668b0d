"""The search over tables N(A, omega): each effect has its signature on the plane.

Points of a table are taken to err independently; what neighbours have in common is structure.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...numerals import percent
from ..estimation.common_friction import inertia
from ..monitor import Monitor
from ..results.explain import explains_nothing, places
from ..results.table_diagnosis import FrequencyDiagnosis
from ..selection.search import Located, Remainder, Search, TooFewData, Words
from ..selection.thresholds import LEFT
from ..starting.extend import applicable
from ..thresholds import DISTINGUISHED, UNMOVED
from .candidate import fit_either, try_effect
from .compare import comparison_of_tables, plane_regions, scatter
from .errors import log_density, outlying, rms
from .fit import FittedTable, fit_table, slopes_of
from .points import Points, counted, points_of, table_scales
from .simulated import relative_error, simulate_table
from .starts import balanced
from .thresholds import (
    CONFIRMED_ON_TABLE,
    GIVE_UP_ON_TABLE,
    POINTS,
    POINTS_COSTLY,
    SCATTER_LEAST,
    SIGNIFICANT_TABLE,
    SIGNIFICANT_TABLE_VALIDATION,
    STEPS_CONFIRMED,
    STEPS_COSTLY,
    STRUCTURE_SHOWS,
    TABLE_BUDGET,
    TABLE_ITERATIONS,
    TABLE_STEPS,
    TOP_FREQUENCIES,
    WORK_MEDIUM,
)
from .uncertainty import uncertainty


@dataclass(frozen=True, eq=False)
class TableCandidate:
    """A model fitted to the points of the fit, and what it makes of all of them."""

    key: str
    fitted: FittedTable
    extra: int  # parameters beyond the baseline's
    error: np.ndarray
    table: np.ndarray
    evidence: float = 0.0
    evidence_fitted: float = 0.0
    evidence_validation: float = 0.0
    confirmed: bool = False

    @property
    def block(self):
        """The fitted model."""
        return self.fitted.block

    @property
    def cost(self) -> float:
        """Sum of squares over the points fitted."""
        return float(self.fitted.weighted @ self.fitted.weighted)


class TableSearch(Search):
    """The fits of one diagnosis of tables.

    Parameters
    ----------
    block : Mechanism
        The model as it stands.
    records, validation : sequences of FrequencyMeasurement
        To fit; to validate on (may be empty: every third point is then held out).
    free : sequence of str
        Parameters of the model that may be refitted.
    """

    significant = SIGNIFICANT_TABLE
    significant_validation = SIGNIFICANT_TABLE_VALIDATION
    measure = "N"
    words = Words("tables", "scatter", " of |N|", "the points of the plane", "")
    kind = FrequencyDiagnosis

    def __init__(self, block, records, validation, free):
        self.block, self.free = block, tuple(free)
        self._records, self._validation = tuple(records), tuple(validation)
        self.points = points_of([*records, *validation])
        self.train = _train_mask(self.points, len(records), bool(validation))
        if np.count_nonzero(self.train) <= len(self.free) // 2 + 1:
            raise TooFewData(
                f"a diagnosis needs more points than parameters; {int(self.train.sum())} points remain to "
                f"fit {len(self.free)} parameters. Measure more, or name fewer in free."
            )
        self.inside = self.points.take(self.train)
        self.scales = table_scales(block, self.points)
        self._base = self._candidate("", self._fit_base(), 0)

    @property
    def base(self):
        """The model refitted."""
        return self._base

    @property
    def records(self):
        """The tables to fit, and those held out."""
        return self._records, self._validation

    def _fit_base(self) -> FittedTable:
        """Fit from the model's values, the mass at high frequencies, a balance of forces; keep the best."""
        inside = self.inside
        first_guesses = [self.block]
        heavy = inertia(self.block)
        if heavy in self.free:
            moved = inside.take(inside.N != 0)
            top = moved.omega >= np.quantile(moved.omega, TOP_FREQUENCIES)
            mass = float(np.median(1 / (np.abs(moved.N[top]) * moved.omega[top] ** 2)))
            first_guesses.append(self.block.with_parameters({heavy: mass}))
        first_guesses += balanced([self.block], self.free, inside, self.scales)
        fits = [
            fit_table(
                b,
                inside,
                self.free,
                self.scales,
                iterations=TABLE_ITERATIONS["refit"],
                tolerance=TABLE_STEPS["refit"],
            )
            for b in first_guesses
        ]
        return min(fits, key=lambda f: float(f.weighted @ f.weighted))

    def _candidate(self, key, fitted: FittedTable, extra: int, work=None, confirmed=False) -> TableCandidate:
        table = simulate_table(fitted.block, self.points, work)
        return TableCandidate(
            key, fitted, extra, relative_error(table, self.points), table, confirmed=confirmed
        )

    # --- every effect ---------------------------------------------------------------------------------

    def candidates(self, classes, executor=None, monitor=None):
        """Return every effect that can be added, fitted roughly to some points, the best first."""
        if not classes:
            return self, []
        monitor = monitor or Monitor()
        size = np.abs(self.inside.weight * self.base.error[self.train])
        few, fewer = self.inside.selected(POINTS, size), self.inside.selected(POINTS_COSTLY, size)
        block, slopes = self.base.block, {}
        for some in (few, fewer):
            slopes[len(some)] = slopes_of(block, some, self.free, self.scales, WORK_MEDIUM)
        jobs = []
        for c in classes:
            if applicable(c, block):
                some = fewer if c.costly else few
                jobs.append((c, block, some, self.free, self.scales, slopes[len(some)]))
        run = map if executor is None else executor.map
        found = []
        monitor.stage(f"{len(jobs)} effects screened on some of the points")
        for r in run(try_effect, jobs):
            monitor.done()
            if r is not None:
                found.append(self._candidate(*r, work=WORK_MEDIUM))
                monitor.known((self, self.ranked(self.base, found)))
        ranked = self.ranked(self.base, found)
        return self.after(screened=ranked), ranked

    def based_on(self, block, fitted, free):
        """Return a search over the same points for what another model misses."""
        return self.after(block=block, free=tuple(free), _base=replace(fitted, key="", extra=0))

    def confirm(self, found, monitor=None, clear=math.inf):
        """Fit the best to all points, and the baseline from what they say of it: it may have been stuck."""
        (monitor or Monitor()).stage("the best fitted to all points")
        base = self.base
        best = [self._confirmed(t) for t in found[:CONFIRMED_ON_TABLE] if t.evidence > GIVE_UP_ON_TABLE]
        for tried in best[:2]:
            values = {k: tried.block.parameters[k].value for k in self.free}
            try:
                begin = base.block.with_parameters(values)
            except ValueError:
                continue
            again = self._candidate(
                "",
                fit_table(begin, self.inside, self.free, self.scales, iterations=TABLE_ITERATIONS["rebase"]),
                0,
            )
            if again.cost < base.cost:
                base = again
        return self.after(_base=base), self.ranked(base, best)

    def _confirmed(self, tried: TableCandidate) -> TableCandidate:
        kind = tried.block.effects[-1]
        fitted = fit_either(
            tried.block, self.inside, tried.fitted.names, self.scales,
            iterations=STEPS_COSTLY if kind.costly else STEPS_CONFIRMED,
            budget=TABLE_BUDGET, work=WORK_MEDIUM if kind.costly or kind.multimodal else None,
        )  # fmt: skip
        return self._candidate(tried.key, fitted, tried.extra, confirmed=True)

    def fitted(self, block, names, iterations, near=None):
        """Return a block with these parameters fitted to the points of the fit."""
        found = fit_table(block, self.inside, names, self.scales, iterations=iterations)
        return self._candidate(block.newest if block.effects else "", found, len(names))

    # --- evidence -------------------------------------------------------------------------------------

    def ranked(self, base, candidates: Sequence[TableCandidate]):
        """Return models with their evidence over `base`, best first.

        That is the likelihood ratio of independent complex errors, less Schwarz's penalty for parameters.
        """
        penalty, before = 0.5 * math.log(2 * len(self.points)), self._likelihood(base)[0]
        found = []
        for t in candidates:
            gain = self._likelihood(t)[0] - before
            validation = float(np.sum(gain[~self.train]))
            fitted = float(np.sum(gain[self.train])) - t.extra * penalty
            found.append(
                replace(
                    t, evidence=fitted + validation, evidence_fitted=fitted, evidence_validation=validation
                )
            )
        return sorted(found, key=lambda t: -t.evidence)

    def _likelihood(self, tried) -> tuple[np.ndarray, float]:
        """Return the log density of every point, and the variance of scatter.

        No model gets below the stated noise, or below how exact orbits are.
        """
        return log_density(
            self.points.weight * tried.error, max(0.5 * self.points.stated, SCATTER_LEAST) ** 2
        )

    def equivalent(self, a, b):
        """Whether two candidates' tables differ by less than the scatter lets one see."""
        both = np.isfinite(a.table) & np.isfinite(b.table)
        if np.any(np.isfinite(a.table) != np.isfinite(b.table)):
            return False
        sigma2 = min(self._likelihood(a)[1], self._likelihood(b)[1])
        gap = self.points.weight * np.abs(a.table - b.table) / self.points.scale
        return float(np.sum(gap[both] ** 2)) / sigma2 < DISTINGUISHED

    def errors(self, candidate):
        """Return the rms of the relative errors of the points fitted, and of those held out."""
        good = ~outlying(candidate.error)
        return rms(candidate.error[self.train & good]), rms(candidate.error[~self.train & good])

    def standard_errors(self, candidate):
        """Return the standard errors of a candidate fitted to all points."""
        return uncertainty(candidate.fitted)[1] if candidate.confirmed else {}

    def undetermined(self, candidate):
        """Return the parameters of the newest effect at a bound, or known to worse than their size."""
        if not candidate.confirmed:
            return ()
        own, fitted = candidate.block.newest + ".", candidate.fitted
        table, doubtful = fitted.block.parameters, uncertainty(fitted)[2]
        named = [v for v in fitted.variables if v.name.startswith(own)]
        return tuple(
            v.name.rpartition(".")[2]
            for v in named
            if v.name in doubtful or table[v.name].value in (v.lower, v.upper)
        )

    # --- what it comes to -----------------------------------------------------------------------------

    def remainder(self, best, significant):
        """Split the error into scatter and structure, and decide whether the latter is explained."""
        noise, structure = self._split(best)
        there = self._split(self.base)[1]
        shown = best if significant else self.base
        unexplained = (
            structure > STRUCTURE_SHOWS * noise and structure > LEFT * there and not self._scattered(shown)
        )
        if not (unexplained or significant) and self.errors(self.base)[0] > UNMOVED:
            # on few points scatter may not be distinguished from structure: no table scatters that much
            return Remainder(noise, structure, unexplained=True, doubt=explains_nothing())
        return Remainder(noise, structure, unexplained)

    def _split(self, t) -> tuple[float, float]:
        """Split the relative error into scatter and what neighbours on the plane have in common."""
        p, e = self.points, np.where(outlying(t.error), 0.0, t.error)
        total, stated = rms(e), p.stated
        # the direction in which a signature is smoother tells more of the scatter
        rough = [
            r for along, at in ((p.omega, p.A), (p.A, p.omega)) if (r := _rough(e, along, (p.record, at)))
        ]
        if not rough:
            return (stated, math.sqrt(max(total**2 - stated**2, 0.0))) if stated else (total, 0.0)
        noise = min(stated or min(rough), total)
        return noise, math.sqrt(max(total**2 - noise**2, 0.0))

    def _scattered(self, t) -> bool:
        """Whether neighbours err independently."""
        grids = []
        for i, record in enumerate([*self._records, *self._validation]):
            grid, here = np.where(np.isfinite(record.N), 0, np.nan).astype(complex), self.points.record == i
            grid[counted(record)] = np.where(outlying(t.error)[here], np.nan, t.error[here])
            grids.append(grid)
        return bool(scatter(grids))

    def located(self, best, remainder, unknown):
        """Return the bands of amplitude and frequency where the error is."""
        where = plane_regions(self.points, (best if unknown else self.base).error)
        look = places(where) or "The error is spread over the whole plane."
        remains = (
            f"The errors of neighbouring points agree: structure of {percent(remainder.structure)} beside "
            f"scatter of {percent(remainder.noise)}. {look}"
        )
        far = np.count_nonzero(outlying(best.error))
        note = (
            f" {far} of {len(best.error)} points err by more than ten times the median and are left out of "
            "these figures: another motion that coexists, or a bad measurement."
        )
        return Located(where, where.kinds, remains if unknown else "", note if far else "")

    def answer(self, best):
        """Return the refitted model, and the best, beside all tables."""
        tables = [*self._records, *self._validation]
        before = comparison_of_tables(self.base.block, tables)
        return {
            "before": before,
            "after": before if best is self.base else comparison_of_tables(best.block, tables),
        }


def _rough(error, along, lines) -> float:
    """Return the scatter of errors by their second differences over `along`; 0 where there are none.

    Second differences see scatter six times as strong as a smooth signature. `lines`: values that points of
    one line have in common.
    """
    order = np.lexsort((along, *lines))
    error, lines = error[order], np.array(lines)[:, order]
    same = np.all((lines[:, 2:] == lines[:, 1:-1]) & (lines[:, 1:-1] == lines[:, :-2]), axis=0)
    differences = (error[2:] - 2 * error[1:-1] + error[:-2])[same]
    return float(np.median(np.abs(differences))) / math.sqrt(6 * math.log(2)) if len(differences) else 0.0


def _train_mask(points: Points, records: int, validation: bool) -> np.ndarray:
    """Return which points are fitted: those of the training tables, or two of three over the plane."""
    if validation:
        return points.record < records
    i = np.searchsorted(np.unique(points.A), points.A)
    k = np.searchsorted(np.unique(points.omega), points.omega)
    mask = (i + k) % 3 != 2
    return mask if 0 < np.count_nonzero(mask) < len(mask) else np.arange(len(points)) % 3 != 2
