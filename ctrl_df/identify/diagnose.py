"""Which effect is missing: the library screened, the best confirmed by refitting and by held-out data."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..blocks.effect import Effect, effect_class, effect_library
from ..blocks.mechanism import Mechanism
from .equivalence import coloured_floor, indistinguishable, whitened_power, whitener
from .measurement import Measurement
from .screen import Start, applicable, attach, force_regression, make_screen, starts_for
from .trial import Fitted, as_run, fit, scales_of, thinning, windowed, with_values

EFFECT, AMBIGUOUS, NONE, UNKNOWN = "effect", "ambiguous", "none", "unknown"

SIGNIFICANT = 20.0
"""Evidence [nats] an effect needs: e^20 to 1, ample for the few hundred shapes that screening tries."""

_SAMPLES = 2000  # of a record while screening
_CONFIRM = 6
# Effects whose error has many valleys over long windows: short ones first.
_CURVED = frozenset({"stribeck", "stiction", "bristle", "backlash", "compliance", "position_ripple"})


@dataclass(frozen=True, eq=False)
class CandidateEffect:
    """One effect of the library, fitted to the data.

    Attributes
    ----------
    effect : Effect
        With fitted parameters.
    id : str
        Canonical id.
    nrmse, nrmse_holdout : float
        Error of the block with this effect on training and on held-out data, over the rms of the centred output.
    evidence : float
        Log likelihood ratio [nats] over the refitted baseline, less the price of its parameters (Schwarz).
    probability : float
        Among all candidates and "nothing missing", equal before the data.
    parameters : dict
        Fitted parameters of the effect.
    equivalents : tuple of str
        Ids that make the same of these data, within noise.
    model : block
        The refitted block with the effect.
    confirmed : bool
        Whether it was refitted at the full rate and tried on held-out data (the best few are).
    """

    effect: Effect
    id: str
    nrmse: float
    nrmse_holdout: float
    evidence: float
    probability: float
    parameters: Mapping[str, float]
    equivalents: tuple[str, ...] = ()
    model: Any = None
    confirmed: bool = False
    outputs: tuple = field(default=(), repr=False)
    errors: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """What is missing in a model, or that nothing is.

    Attributes
    ----------
    verdict : {'effect', 'ambiguous', 'none', 'unknown'}
        One effect (or one class of equivalent effects); several that remain; nothing; something outside the library.
    ranking : tuple of CandidateEffect
        Best first.
    baseline : CandidateEffect-like
        The refitted baseline's errors: `nrmse`, `nrmse_holdout`.
    noise, structure : float
        Of the best candidate's residual: rms of noise and of what the model still misses [output unit].
    """

    verdict: str
    ranking: tuple[CandidateEffect, ...]
    model: Any
    baseline: Any
    nrmse: float
    nrmse_holdout: float
    noise: float
    structure: float
    explanation: str
    regions: tuple[str, ...]
    where: Any
    train: tuple[Measurement, ...]
    holdout: tuple[Measurement, ...]
    seconds: float = 0.0
    limits: Mapping[str, float] = field(default_factory=dict)

    @property
    def best(self) -> CandidateEffect | None:
        """The first of the ranking; None where nothing is missing."""
        return None if self.verdict == NONE or not self.ranking else self.ranking[0]

    @property
    def remaining(self) -> tuple[CandidateEffect, ...]:
        """Candidates the data leave open."""
        if self.verdict == NONE:
            return ()
        return tuple(c for c in self.ranking if c.confirmed and c.probability > 0.01)[:4] or self.ranking[:2]

    @property
    def next_experiment(self):
        """The input that would separate the candidates that remain; see `ctrl_df.identify.experiment`."""
        from .experiment import next_experiment

        return next_experiment(self)

    def table(self, rows: int = 8) -> str:
        """Return the ranking as text."""
        lines = [f"{'effect':<22} {'nrmse':>9} {'held out':>9} {'evidence':>9} {'prob.':>6}  parameters"]
        lines.append(f"{'(none: refitted)':<22} {self.nrmse:>9.3g} {self.nrmse_holdout:>9.3g} {0:>9.1f}")
        for c in self.ranking[:rows]:
            values = ", ".join(f"{k} {v:.4g}" for k, v in c.parameters.items())
            name = c.id + (" = " + ", ".join(c.equivalents) if c.equivalents else "")
            lines.append(
                f"{name:<22} {c.nrmse:>9.3g} {c.nrmse_holdout:>9.3g} {c.evidence:>9.1f} {c.probability:>6.1%}  {values}"
            )
        return "\n".join(lines)

    def plot(self, **keywords):
        """Draw the ranking and the residual before and after; returns a ``ct.ControlPlot``."""
        from ..plot.diagnosis import plot_diagnosis

        return plot_diagnosis(self, **keywords)

    def __str__(self) -> str:
        return f"{self.verdict}: {self.explanation}\n{self.table()}"


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
    data : Measurement or sequence of Measurement
        Training records.
    holdout : Measurement, sequence or None
        Records to confirm on; None: every third part of the training records is held out.
    candidates : sequence of str or None
        Effect ids to consider; None: the whole library.
    free : sequence of str or None
        Parameters of the model that may be refitted; None: all that are free.
    executor : concurrent.futures.Executor or None
        Runs candidates side by side.
    limits : mapping or None
        ``force`` [N] and ``stroke`` [m] for `next_experiment`.

    Returns
    -------
    Diagnosis

    Raises
    ------
    TypeError, ValueError
        Data that are no measurements, an unknown effect id, a model that is no block.
    """
    import time

    if keywords:
        raise TypeError(f"unrecognized keyword(s): {', '.join(keywords)}")
    began = time.perf_counter()
    from .frequency_measurement import FrequencyMeasurement

    records = as_records(data, "data")
    if any(isinstance(r, FrequencyMeasurement) for r in records):
        raise NotImplementedError(
            "diagnose needs records over time (Measurement); a FrequencyMeasurement cannot be diagnosed yet."
        )
    held = as_records(holdout, "holdout") if holdout is not None else ()
    block = block_of(model)
    free = free_names(block, free)
    study = _Study(block, records, held, free)
    found = study.candidates(_classes(candidates), executor)
    return study.verdict(found, began, limits)


def as_records(data, name) -> tuple:
    """Return records as a tuple; TypeError for anything else."""
    from .frequency_measurement import FrequencyMeasurement

    kinds = (Measurement, FrequencyMeasurement)
    records = (data,) if isinstance(data, kinds) else data
    if not isinstance(records, Sequence) or not records or not all(isinstance(r, kinds) for r in records):
        raise TypeError(
            f"{name} must be a Measurement or a sequence of them; got {data!r}. "
            "Wrap arrays: ctrl_df.Measurement(t, u, y)."
        )
    return tuple(records)


def block_of(model) -> Mechanism:
    """Return the mechanism of a block or of a closed loop."""
    if isinstance(model, Mechanism):
        return model
    part = getattr(getattr(model, "parts", None), "block", None)
    if isinstance(part, Mechanism):
        return part
    raise TypeError(
        f"diagnose needs a block made of an inertia and effects, or a closed_loop of one; got {type(model).__name__}. "
        "Effects can only be added to ctrl_df.Mass and ctrl_df.TwoMass."
    )


def free_names(block, free=None) -> tuple[str, ...]:
    """Return the parameters that a refit moves."""
    table = block.parameters
    if free is None:
        return tuple(k for k, p in table.items() if p.free and not k.endswith("quantization.step"))
    for name in free:
        if name not in table:
            raise ValueError(f"a free parameter must be one of {', '.join(table)}; got {name!r}.")
    return tuple(free)


def _classes(candidates: Any) -> list[Any]:
    if candidates is None:
        return list(effect_library().values())
    return [
        c if isinstance(c, type) and issubclass(c, Effect) else effect_class(c)  # pyright: ignore[reportArgumentType]
        for c in candidates
    ]


# --- the study ------------------------------------------------------------------------------------


@dataclass(eq=False)
class _Tried:
    """A candidate on its way: fitted to the training runs, held-out outputs."""

    effect_key: str
    fitted: Fitted
    extra: int  # parameters beyond the baseline's
    held: Fitted | None = None
    evidence: float = 0.0
    confirmed: bool = False

    @property
    def block(self):
        return self.fitted.block


class _Study:
    """Everything one diagnosis needs."""

    def __init__(self, block, records, held, free):
        self.block, self.records, self.held, self.free = block, records, held, free
        thin = thinning(records, _SAMPLES)
        whole = self._runs(records, thin)
        self.scales = scales_of(block, whole)
        # Short windows first: over a long free run a wrong model drifts away, and its error says little.
        self.coarse = [windowed(run) for run in whole]
        self.coarse_held = [windowed(as_run(r, thinning(held, _SAMPLES))) for r in held]
        self.base = _Tried("", self._fit_base(), 0)
        self._hold(self.base, self.coarse_held)

    def _runs(self, records, thin):
        runs = []
        for r in records:
            use = np.ones(len(r), bool)
            if not self.held:
                part = (np.arange(len(r)) * 9) // len(r)
                use = part % 3 != 2
            runs.append(as_run(r, thin, use))
        return runs

    def _fit_base(self):
        """Fit the baseline from its own values and from a regression of the force on motion; keep the better."""
        short = [windowed(r, 4 * len(r.windows)) for r in self.coarse]
        begins = [self.block]
        table = self.block.parameters
        w, _ = force_regression(self.coarse, self.scales)
        guess = dict(zip(("mass", "coulomb.level", "viscous.coefficient"), w, strict=False))
        guess = {k: float(v) for k, v in guess.items() if k in table and k in self.free and v > 0}
        if guess:
            begins.append(with_values(self.block, guess))
        found = []
        for begin in begins:
            near = fit(begin, short, self.free, self.scales, iterations=10)
            found.append(fit(near.block, self.coarse, self.free, self.scales, iterations=20))
        return min(found, key=lambda f: f.rms)

    def _rebase(self, found):
        """Refit the baseline from what the best candidates say of its parameters: it may have been stuck."""
        for tried in found[:2]:
            values = {k: tried.block.parameters[k].value for k in self.free}
            again = fit(
                with_values(self.base.block, values), self.coarse, self.free, self.scales, iterations=10
            )
            if again.rms < self.base.fitted.rms:
                self.base = _Tried("", again, 0)
                self._hold(self.base, self.coarse_held)

    def _hold(self, tried, runs, starts=None):
        if runs:
            tried.held = fit(tried.block, runs, (), self.scales, starts=starts, iterations=4, tolerance=1e-2)

    def _residuals(self, tried):
        held = tried.held.residuals if tried.held is not None else ()
        return [*tried.fitted.residuals, *held]

    def _outputs(self, tried):
        held = tried.held.outputs if tried.held is not None else ()
        return [*tried.fitted.outputs, *held]

    # every effect, coarsely

    def candidates(self, classes, executor):
        # Start values are read off short windows: there even a strong effect changes the output nearly linearly.
        short = [windowed(r, 4 * len(r.windows)) for r in self.coarse]
        near = fit(self.base.block, short, self.free, self.scales, iterations=6)
        screen = make_screen(near, short, self.scales)
        kinds = [c for c in classes if applicable(c, screen.block)]
        run = map if executor is None else executor.map
        jobs = [(cls, screen, self.free, self.coarse, self.scales) for cls in kinds]
        span = max(float(np.ptp(r.y)) for r in self.coarse)
        fitted = [t for t in run(_try, jobs) if t is not None and _periodic_enough(t, span)]
        for tried in fitted:
            self._hold(tried, self.coarse_held)
        self._judge(fitted, self.base)
        fitted.sort(key=lambda t: -t.evidence)
        self._rebase(fitted)
        self._judge(fitted, self.base)
        fitted.sort(key=lambda t: -t.evidence)
        return fitted

    def _judge(self, tried, base):
        """Set the evidence of every candidate from residuals whitened by the best one's noise model."""
        everyone = [base, *tried]
        sizes = [float(sum(np.sum(r * r) for r in self._residuals(t))) for t in everyone]
        best = everyone[int(np.argmin(sizes))]
        noise = whitener(self._residuals(best))
        self.noise = noise
        base_power, count = whitened_power(self._residuals(base), noise)
        for t in tried:
            power, _ = whitened_power(self._residuals(t), noise)
            t.evidence = 0.5 * count * math.log(base_power / power) - 0.5 * t.extra * math.log(count)

    # the best, carefully

    def confirm(self, found):
        thin = max(thinning(self.records, 10_000), 1)
        fine = [
            windowed(run, len(old.windows))
            for run, old in zip(self._runs(self.records, thin), self.coarse, strict=True)
        ]
        thin = max(thinning(self.held, 10_000), 1) if self.held else 1
        fine_held = [
            windowed(as_run(r, thin), len(old.windows))
            for r, old in zip(self.held, self.coarse_held, strict=True)
        ]
        base = self._polish(self.base, fine, fine_held)
        chosen = [self._polish(t, fine, fine_held) for t in found[:_CONFIRM]]
        self._judge(chosen, base)
        chosen.sort(key=lambda t: -t.evidence)
        self.fine, self.fine_held = fine, fine_held
        return base, chosen

    def _polish(self, tried, runs, held):
        free = tried.fitted.names
        better = fit(
            tried.block, runs, free, self.scales, starts=tried.fitted.starts, iterations=3, tolerance=1e-3
        )
        new = _Tried(tried.effect_key, better, tried.extra, confirmed=True)
        self._hold(new, held, tried.held.starts if tried.held is not None else None)
        return new

    def errors(self, tried, runs, held) -> tuple[float, float]:
        spread = math.sqrt(np.mean([np.var(r.y) for r in runs]))
        inside = np.concatenate([e[r.use] for e, r in zip(tried.fitted.residuals, runs, strict=True)])
        if tried.held is not None:
            outside = np.concatenate(tried.held.residuals)
            spread_held = math.sqrt(np.mean([np.var(r.y) for r in held]))
        else:
            outside = np.concatenate([e[~r.use] for e, r in zip(tried.fitted.residuals, runs, strict=True)])
            spread_held = spread
        rms = [math.sqrt(float(np.mean(e * e))) for e in (inside, outside)]
        return rms[0] / spread, rms[1] / spread_held

    def verdict(self, found, began, limits):
        import time

        base, chosen = self.confirm(found)
        best = chosen[0] if chosen else base
        split = [coloured_floor(e, r.v, r.record.dt) for e, r in self._pairs(best)]
        noise, structure = (math.sqrt(float(np.mean([s[i] ** 2 for s in split]))) for i in (0, 1))
        split0 = [coloured_floor(e, r.v, r.record.dt) for e, r in self._pairs(base)]
        structure0 = math.sqrt(float(np.mean([s[1] ** 2 for s in split0])))
        base_errors = self.errors(base, self.fine, self.fine_held)
        rest = [t for t in found if t.effect_key not in {c.effect_key for c in chosen}]
        evidences = np.array([t.evidence for t in chosen] + [0.0])
        weights = np.exp(np.clip(evidences - evidences.max(), -700, 0))
        weights /= weights.sum()
        ranking = []
        for i, t in enumerate(chosen):
            alike = tuple(o.effect_key for j, o in enumerate(chosen) if j != i and self._alike(t, o))
            ranking.append(
                self._entry(t, self.errors(t, self.fine, self.fine_held), float(weights[i]), alike)
            )
        for t in rest:
            ranking.append(self._entry(t, self.errors(t, self.coarse, self.coarse_held), 0.0, ()))
        first = ranking[0] if ranking else None
        significant = (
            first is not None
            and first.evidence > SIGNIFICANT
            and first.nrmse_holdout < 0.995 * base_errors[1]
        )
        if self._unexplained(noise, structure, structure0):
            verdict = UNKNOWN
        elif first is None or not significant:
            verdict = NONE
        else:
            others = [c for c in ranking[1:] if c.confirmed and first.evidence - c.evidence < 5.0]
            verdict = EFFECT if all(c.id in first.equivalents for c in others) else AMBIGUOUS
        from .explain import explain, find_regions

        where = find_regions(best if verdict == UNKNOWN else base, self.fine)
        kinds = tuple(where.kinds) if where is not None else ()
        result = Diagnosis(
            verdict, tuple(ranking), base.block, self.block, *base_errors, noise, structure, "", kinds, where,
            tuple(self.records), tuple(self.held), time.perf_counter() - began, dict(limits or {}),
        )  # fmt: skip
        object.__setattr__(result, "explanation", explain(result, structure0))
        return result

    def _unexplained(self, noise, structure, structure0):
        """Whether the best candidate leaves most of the structure.

        Noise of a colour within the band of motion makes up to 2.5 times the noise seen above that band. A test
        of the residual against the input would be sharper, but under feedback the input knows the noise.
        """
        return structure > 3.0 * noise and structure > 0.2 * structure0

    def _pairs(self, tried):
        yield from zip(tried.fitted.residuals, self.fine, strict=True)
        if tried.held is not None:
            yield from zip(tried.held.residuals, self.fine_held, strict=True)

    def _alike(self, a, b):
        return indistinguishable(self._outputs(a), self._outputs(b), self.noise)

    def _entry(self, t, errors: tuple[float, float], probability, alike):
        effect = t.block.effects[-1]
        values = {k: p.value for k, p in effect.parameters.items()}
        return CandidateEffect(
            effect, effect.id, *errors, t.evidence, probability, values, alike, t.block, t.confirmed,
            tuple(t.fitted.outputs),
        )  # fmt: skip


def _periodic_enough(tried, span) -> bool:
    """Refuse a ripple of which the stroke shows less than a period: that is a spring by another name."""
    return getattr(tried.block.effects[-1], "wavelength", 0.0) < 0.9 * span


def _try(job) -> _Tried | None:
    """Fit one effect class from its best start values (a job of its own, for executors)."""
    cls, screen, free, runs, scales = job
    best = None
    starts = starts_for(cls, screen)
    for i, start in enumerate(starts):
        if i and not starts[0].values and start.left > 1.5 * starts[0].left + 0.02:
            break
        tried = _fit_one(start, screen, free, runs, scales)
        if tried is not None and (best is None or tried.fitted.rms < best.fitted.rms):
            best = tried
    return best


def _fit_one(start: Start, screen, free, runs, scales) -> _Tried | None:
    base = with_values(screen.block, dict(start.values))
    block = attach(base, start.effect)
    if block is None:
        return None
    key = list(block._keys)[-1]
    own = [
        f"{key}.{n}"
        for n, p in start.effect.parameters.items()
        if p.free and f"{key}.{n}" in block.parameters
    ]
    rough = "sensor_quantization" in key
    names = (*free, *(() if rough else own))
    if start.effect.id in _CURVED:
        block = fit(
            block, screen.runs, names, scales, starts=screen.base.starts, iterations=8, tolerance=3e-3
        ).block
    fitted = fit(block, runs, names, scales, iterations=1 if rough else 12, tolerance=1e-3)
    return _Tried(start.effect.id, fitted, len(own))
