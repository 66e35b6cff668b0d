"""Which effect is missing, from measured tables N(A, omega): each effect leaves its print on the plane.

The course is that of the diagnosis over time: refit the model, try every effect of the library from start
values of several magnitudes, confirm the best on all points, and say what remains. Points of a table are
taken to err independently; what neighbours have in common is structure.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...drawing import draw
from ..data.records import as_tables
from ..diagnose import block_of, effect_classes, free_names
from ..estimation.common_friction import inertia
from ..results.diagnosis import AMBIGUOUS, EFFECT, NONE, UNKNOWN, CandidateEffect, Diagnosis, rivals
from ..starting.attach import applicable
from .candidate import fit_either, try_effect
from .compare import plane_regions
from .explain import explain_tables
from .fit import (
    QUICK,
    FittedTable,
    Points,
    counted,
    fit_table,
    log_density,
    outlying,
    points_of,
    relative_error,
    rms,
    simulate_table,
    slopes_of,
    table_scales,
)
from .refit import uncertainty

SIGNIFICANT = 12.0
"""Evidence [nats] an effect needs on the points fitted; fewer shapes are tried than over time."""

HELD = 2.0
"""Evidence [nats] it needs on the points held out; there are few of them."""

_SCREEN = 20  # points while screening, those where the model errs most in their part of the plane
_ROUGH = 10  # of effects whose orbits take many times as long
_CONFIRM = 5


@dataclass(frozen=True, eq=False)
class FrequencyDiagnosis(Diagnosis):
    """A `Diagnosis` from tables; `noise` and `structure` are relative to ``|N|``.

    Attributes
    ----------
    before, after : FrequencyComparison
        The refitted model, and that with the first of the ranking, beside all tables.
    """

    before: Any = None
    after: Any = None

    def plot(self, **keywords):
        """Draw the ranking and the error on the plane before and after; returns a ``ct.ControlPlot``."""
        return draw("table diagnosis", self, **keywords)


def diagnose_frequency(
    model, data, *, holdout=None, candidates=None, free=None, executor=None, limits=None, **keywords
) -> FrequencyDiagnosis:
    """Find the effect that a model misses from measured tables N(A, omega).

    Parameters
    ----------
    model : block or closed loop
        The model in use; of a loop its block.
    data : FrequencyMeasurement or sequence of them
    holdout : FrequencyMeasurement, sequence or None
        Tables to confirm on; None: every third point is held out.
    candidates, free, executor, limits
        As for `ctrl_df.diagnose`.

    Returns
    -------
    FrequencyDiagnosis
    """
    import time

    if keywords:
        raise TypeError(f"unrecognized keyword(s): {', '.join(keywords)}")
    began = time.perf_counter()
    records = as_tables(data)
    held = as_tables(holdout, "holdout") if holdout is not None else ()
    block = block_of(model)
    study = FrequencyStudy(block, records, held, free_names(block, free))
    study.screen(effect_classes(candidates), executor)
    return study.verdict(began, limits)


@dataclass(eq=False)
class _Tried:
    """A candidate: fitted to the points of the fit, its errors at all points."""

    id: str
    fitted: FittedTable
    extra: tuple[str, ...]  # its own parameters
    errors: np.ndarray
    table: np.ndarray
    evidence: float = 0.0
    held: float = 0.0  # of it on the points held out
    confirmed: bool = False

    @property
    def effect(self):
        return self.fitted.block.effects[-1]


class FrequencyStudy:
    """Everything one diagnosis of tables needs."""

    def __init__(self, block, records, held, free):
        self.block, self.records, self.held, self.free = block, records, held, tuple(free)
        self.points = points_of([*records, *held])
        self.train = _train_mask(self.points, len(records), bool(held))
        if np.count_nonzero(self.train) <= len(self.free) // 2 + 1:
            raise ValueError(
                f"a diagnosis needs more points than parameters; {int(self.train.sum())} points remain to "
                "fit "
                f"{len(self.free)} parameters. Measure more, or name fewer in free."
            )
        self.scales = table_scales(block, self.points)
        self.base = self._tried("", self._fit_base(), ())
        self.found: list[_Tried] = []

    def _fit_base(self) -> FittedTable:
        """Fit from the model's values, and from the mass that high frequencies suggest; keep the better."""
        inside = self.points.take(self.train)
        begins = [self.block]
        heavy = inertia(self.block)
        if heavy in self.free:
            moved = inside.take(inside.N != 0)
            top = moved.omega >= np.quantile(moved.omega, 0.8)
            mass = float(np.median(1 / (np.abs(moved.N[top]) * moved.omega[top] ** 2)))
            begins.append(self.block.with_parameters({heavy: mass}))
        fits = [fit_table(b, inside, self.free, self.scales, iterations=25, tolerance=1e-4) for b in begins]
        return min(fits, key=lambda f: float(f.weighted @ f.weighted))

    def _tried(self, name, fitted, extra, work=None) -> _Tried:
        table = simulate_table(fitted.block, self.points, work)
        return _Tried(name, fitted, extra, relative_error(table, self.points), table)

    def screen(self, classes, executor):
        """Try every effect, roughly on some points, the best then on all of them."""
        inside = self.points.take(self.train)
        size = np.abs(inside.weight * self.base.errors[self.train])
        few, fewer = inside.thinned(_SCREEN, size), inside.thinned(_ROUGH, size)
        kinds = [c for c in classes if applicable(c, self.base.fitted.block)]
        block, slopes = self.base.fitted.block, {}
        for some in (few, fewer):
            slopes[len(some)] = slopes_of(block, some, self.free, self.scales, QUICK)
        jobs = []
        for c in kinds:
            some = fewer if c.costly else few
            jobs.append((c, block, some, self.free, self.scales, slopes[len(some)]))
        run = map if executor is None else executor.map
        rough = [self._tried(*r, work=QUICK) for r in run(try_effect, jobs) if r is not None]
        self._judge(rough)
        rough.sort(key=lambda t: -t.evidence)
        # what explains next to nothing of a few points will not explain all of them
        promising = [t for t in rough[:_CONFIRM] if t.evidence > -20.0]
        best = [self._confirmed(t, inside) for t in promising]
        self._rebase(best, inside)
        self._judge([*best, *rough])
        best.sort(key=lambda t: -t.evidence)
        done = {t.id for t in best}
        self.found = [*best, *(t for t in rough if t.id not in done)]

    def _confirmed(self, tried, inside):
        kind = tried.effect
        iterations = 3 if kind.costly else 12
        names = (*self.free, *tried.extra)
        work = QUICK if kind.costly or kind.multimodal else None
        fitted = fit_either(
            tried.fitted.block, inside, names, self.scales, iterations=iterations, budget=120, work=work
        )
        again = self._tried(tried.id, fitted, tried.extra)
        again.confirmed = True
        return again

    def _rebase(self, best, inside):
        """Refit the model from what the best say of its parameters: it may have been stuck."""
        for tried in best[:2]:
            values = {k: tried.fitted.block.parameters[k].value for k in self.free}
            try:
                begin = self.base.fitted.block.with_parameters(values)
            except ValueError:
                continue
            again = fit_table(begin, inside, self.free, self.scales, iterations=10)
            if float(again.weighted @ again.weighted) < float(
                self.base.fitted.weighted @ self.base.fitted.weighted
            ):
                self.base = self._tried("", again, ())

    def _likelihood(self, tried) -> tuple[np.ndarray, float]:
        return log_density(self.points.weight * tried.errors, self._floor())

    def evidence(self, better, worse) -> float:
        """Return the log likelihood ratio [nats] at all points."""
        return float(np.sum(self._likelihood(better)[0] - self._likelihood(worse)[0]))

    def refitted(self, block, names) -> _Tried:
        """Return a block with these parameters refitted to the points of the fit."""
        inside = self.points.take(self.train)
        return self._tried("", fit_table(block, inside, names, self.scales, iterations=12), ())

    def _judge(self, tried):
        """Set the evidence: likelihood ratio of independent complex errors, less Schwarz's price."""
        price = 0.5 * math.log(2 * len(self.points))
        base = self._likelihood(self.base)[0]
        for t in tried:
            gain = self._likelihood(t)[0] - base
            t.held = float(np.sum(gain[~self.train]))
            t.evidence = float(np.sum(gain)) - len(t.extra) * price

    def _floor(self) -> float:
        """Return the variance below which no model gets: by the stated noise, or by how exact orbits are."""
        stated = self.points.noise if math.isfinite(self.points.noise) else 0.0
        return max(0.5 * stated, 1e-6) ** 2

    # --- what it comes to -----------------------------------------------------------------------------

    def verdict(self, began, limits) -> FrequencyDiagnosis:
        """Return the diagnosis."""
        import time

        from .compare import comparison_of_tables

        best = self.found[0] if self.found else self.base
        weights = np.array([t.evidence for t in self.found if t.confirmed] + [0.0])
        weights = np.exp(np.clip(weights - weights.max(), -700, 0))
        weights /= weights.sum()
        ranking = []
        for i, t in enumerate(self.found):
            alike = [
                o.id for o in self.found if o is not t and t.confirmed and o.confirmed and self._alike(t, o)
            ]
            ranking.append(self._entry(t, float(weights[i]) if t.confirmed else 0.0, tuple(alike)))
        first = ranking[0] if ranking else None
        noise, structure = self._split(best)
        _, structure0 = self._split(self.base)
        errors = self._errors(self.base)
        significant = first is not None and worth(first)
        if self._unexplained(best if significant else self.base, noise, structure, structure0):
            verdict = UNKNOWN
        elif first is None or not significant:
            verdict = NONE
        else:
            others = rivals(ranking)
            verdict = EFFECT if all(c.id in first.equivalents for c in others) else AMBIGUOUS
        shown = best if verdict == UNKNOWN else self.base
        where = plane_regions(self.points, shown.errors)
        tables = [*self.records, *self.held]
        before = comparison_of_tables(self.base.fitted.block, tables)
        after = before if best is self.base else comparison_of_tables(best.fitted.block, tables)
        result = FrequencyDiagnosis(
            verdict, tuple(ranking), self.base.fitted.block, self.block, *errors, noise, structure, "",
            where.kinds, where, tuple(self.records), tuple(self.held), time.perf_counter() - began,
            dict(limits or {}), "N",
            before=before, after=after,
        )  # fmt: skip
        object.__setattr__(
            result, "explanation", explain_tables(result, before if verdict == NONE else after)
        )
        return result

    def _entry(self, t, probability, alike):
        effect = t.effect
        values = {k: p.value for k, p in effect.parameters.items()}
        names = {f"{k}": e for k, e in uncertainty(t.fitted)[1].items()} if t.confirmed else {}
        errors = {n.rpartition(".")[2]: names[n] for n in t.extra if n in names}
        return CandidateEffect(
            effect, t.id, *self._errors(t), t.evidence, probability, values, alike, t.fitted.block,
            t.confirmed, (t.table,), errors, t.held,
        )  # fmt: skip

    def _errors(self, t) -> tuple[float, float]:
        good = ~outlying(t.errors)
        return rms(t.errors[self.train & good]), rms(t.errors[~self.train & good])

    def _split(self, t) -> tuple[float, float]:
        """Split the relative error into scatter and what neighbours on the plane have in common."""
        p, e = self.points, np.where(outlying(t.errors), 0.0, t.errors)
        differences = []
        for record in np.unique(p.record):
            at = np.flatnonzero(p.record == record)
            for a in np.unique(p.A[at]):
                line = at[p.A[at] == a]
                line = line[np.argsort(p.omega[line])]
                if len(line) >= 3:
                    # second differences see scatter six times as strong as a smooth print
                    differences.append(e[line[2:]] - 2 * e[line[1:-1]] + e[line[:-2]])
        total = rms(e)
        stated = p.noise if math.isfinite(p.noise) else 0.0
        if not differences:
            return (stated, math.sqrt(max(total**2 - stated**2, 0.0))) if stated else (total, 0.0)
        rough = float(np.median(np.abs(np.concatenate(differences)))) / math.sqrt(6 * math.log(2))
        noise = min(max(rough, stated), total) if stated == 0 else min(stated, total)
        return noise, math.sqrt(max(total**2 - noise**2, 0.0))

    def _unexplained(self, t, noise, structure, structure0) -> bool:
        from .compare import scatter

        if structure <= 2.0 * noise or structure <= 0.2 * structure0:
            return False
        grid = [np.where(np.isfinite(r.N), 0, np.nan).astype(complex) for r in [*self.records, *self.held]]
        for i, table in enumerate(grid):
            record = [*self.records, *self.held][i]
            here = self.points.record == i
            table[counted(record)] = np.where(outlying(t.errors)[here], np.nan, t.errors[here])
        return not scatter(grid)

    def _alike(self, a, b) -> bool:
        """Whether two candidates' tables differ by less than the scatter lets one see."""
        both = np.isfinite(a.table) & np.isfinite(b.table)
        if np.any(np.isfinite(a.table) != np.isfinite(b.table)):
            return False
        sigma2 = min(self._likelihood(a)[1], self._likelihood(b)[1])
        gap = self.points.weight * np.abs(a.table - b.table) / self.points.scale
        return float(np.sum(gap[both] ** 2)) / sigma2 < 6.0


def worth(candidate: CandidateEffect) -> bool:
    """Whether the points fitted speak for an effect, and those held out by themselves too."""
    return candidate.evidence_fitted > SIGNIFICANT and candidate.evidence_holdout > HELD


def _train_mask(points: Points, records: int, held: bool) -> np.ndarray:
    """Return which points are fitted: those of the training tables, or two of three over the plane."""
    if held:
        return points.record < records
    i = np.searchsorted(np.unique(points.A), points.A)
    k = np.searchsorted(np.unique(points.omega), points.omega)
    mask = (i + k) % 3 != 2
    return mask if 0 < np.count_nonzero(mask) < len(mask) else np.arange(len(points)) % 3 != 2
