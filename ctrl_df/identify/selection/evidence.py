"""Evidence of candidates over the baseline.

Log likelihood ratios of whitened residuals, less a penalty for parameters; for a sensor that rounds the
probability of the recorded values.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ...thresholds import NOTHING
from ..data.measurement import Measurement
from ..data.signals import rounded_to
from ..estimation.fit import FitResult
from ..estimation.segmented import CandidateFit
from ..prediction.sensed import POSITION, sensed
from ..residuals.rounding import rounding_evidence
from ..residuals.thresholds import ROUNDING_COARSE
from ..shooting.noise_model import NoiseModel, prediction_error_filter, whitened_power
from ..thresholds import BY_CHANCE, SIGNIFICANT, STILL_POSSIBLE
from .predictive import Power, held_out, power_of
from .thresholds import CONFIRMED, FINE_STEP, PROMISING, REFUTED


def ranked(base: CandidateFit, trials) -> tuple[list[CandidateFit], NoiseModel]:
    """Return the trials with their evidence over the baseline, best first, and the noise model.

    Candidates that held-out data speak against come last. The noise model is of the residuals of
    the best one, a sensor that rounds left aside.
    """
    best = min([base, *(t for t in trials if not rounds(t))], key=lambda t: t.size)
    noise = prediction_error_filter(best.residuals, base.train.error_filter, base.train.outputs)
    before = _powers(base, noise)
    found = []
    for t in trials:
        gains = _rounded_gains(base, t) if rounds(t) else _gains(before, _powers(t, noise))
        # hardly more than initial states is fitted to validation segments: their gain also counts by itself
        penalty = 0.5 * t.extra * math.log(before.fitted.number + before.number_held_out)
        fitted = _taken(t.train, base.train)
        validation = _taken(t.validation_slopes, base.validation_slopes)
        found.append(
            replace(
                t, evidence=gains.together - penalty - _gain_by_chance(fitted + validation),
                evidence_fitted=gains.fitted - penalty - _gain_by_chance(fitted),
                evidence_validation=gains.held_out - _gain_by_chance(validation),
            )
        )  # fmt: skip
    return sorted(found, key=lambda t: (t.evidence_validation < -REFUTED, -t.evidence)), noise


def promising(found: Sequence[CandidateFit], most=CONFIRMED, share=PROMISING) -> list[CandidateFit]:
    """Return the candidates to confirm: the first two, and all near the best by evidence or by error.

    Where none shows at screening what may yet be significant, errors differ by chance: the least is enough.

    `found`: best first; `most`: of them by evidence, `share` of what they may come to that shows here.
    """
    if not found:
        return []
    least = share * max(found[0].evidence, SIGNIFICANT)
    close = sorted(found, key=lambda t: t.train.rmse)[: 3 if found[0].evidence > least else 1]
    close = [t for t in close if t.train.rmse < STILL_POSSIBLE * close[0].train.rmse]
    likely = [*found[:2], *(t for t in found[2:most] if t.evidence > least)]
    return likely + [t for t in close if not any(t is o for o in likely)]


def _taken(fit: FitResult | None, base: FitResult | None) -> float:
    """Return how many values the initial states of a fit take away of noise, beyond those of the baseline."""
    maps = [f.sensitivity for f in (fit, base) if f is not None]
    if len(maps) < 2 or maps[0] is None or maps[1] is None:
        return 0.0
    return maps[0].taken_by_starts - maps[1].taken_by_starts


def _gain_by_chance(taken: float) -> float:
    """Return the log likelihood that so many initial states gain by chance at most [nats].

    Where there is nothing to explain it is half of chi-squared with as many degrees of freedom, whose mean is
    half of them, and so is its variance. Where the mean alone counted, a joint bent again in each of 24
    segments was ahead of the dead time that acted, by 13 nats.
    """
    return 0.5 * taken + BY_CHANCE * math.sqrt(0.5 * max(taken, 0.0))


def rounds(tried: CandidateFit) -> bool:
    """Whether what a candidate adds is a sensor that rounds: its errors are no noise."""
    return bool(tried.key) and _step(tried) > 0


def step_as_recorded(tried: CandidateFit, records: Sequence[Measurement]) -> float:
    """Return the resolution of the records where it is what a candidate adds, and fine; else 0.

    All values lie on the grid, which shows without a model: rounding is then noise, and nothing is missing.
    Values that only cluster about the lines of a grid have a noise of their own; a coarse grid changes the
    measurement itself. A sensor is fine for the largest motion of all records: it is the same in the others.
    """
    step = _step(tried) if rounds(tried) else 0.0
    outputs = [
        pair for known in map(sensed, records) for pair in zip(known.values, known.columns, strict=True)
    ]
    places = [y for y, column in outputs if column == POSITION]
    fine = step <= FINE_STEP * max((float(np.std(y)) for y in places), default=math.inf)
    return step if fine and all(rounded_to(y, step) for y in places) else 0.0


def misses_lines(tried: CandidateFit) -> bool:
    """Whether a sensor that rounds has a model that errs by too much, held out, to tell the lines apart."""
    return rounds(tried) and tried.validation_rmse > ROUNDING_COARSE * _step(tried)


def rounding_error(tried: CandidateFit) -> float:
    """Return the rms of the error that the rounding of a candidate makes; 0 if it does not round."""
    return _step(tried) / math.sqrt(12) if rounds(tried) else 0.0


def _step(tried: CandidateFit) -> float:
    """Return the step to which the newest effect rounds; 0 if it does not."""
    steps = (p.value for p in tried.block.effects[-1].parameters.values() if p.stepped)
    return next(steps, 0.0)


@dataclass(frozen=True, eq=False)
class _Powers:
    """Power of whitened residuals.

    Attributes
    ----------
    fitted : Power
        Of the segments fitted.
    without : list of Power
        Of those held out but one: each of them in turn. Where there is but one: of that one.
    number_held_out : int
        Number of residuals held out.
    """

    fitted: Power
    without: list[Power]
    number_held_out: int


def _powers(tried: CandidateFit, noise: NoiseModel) -> _Powers:
    fitted = Power(*whitened_power(tried.train.residual_pieces, noise))
    if tried.validation is None:
        return _Powers(fitted, [Power(0.0, 0)], 0)
    whitened = held_out(tried, noise)
    owners = list(zip(tried.validation.segment_of, whitened.white, strict=True))
    # a whitened value sees samples before it, too: across the bounds of segments it is of both
    last = np.concatenate([o[len(o) - len(r) :] for o, r in owners])
    first = np.concatenate([o[: len(r)] for o, r in owners])
    white, changes = np.concatenate(whitened.white), np.concatenate(whitened.changes)
    number = 1 + int(np.max(last, initial=0))
    some = [(last != i) & (first != i) for i in range(number)] if number > 1 else [np.full(len(last), True)]
    return _Powers(fitted, [power_of(white[o], changes[o]) for o in some], len(white))


class _Gains(NamedTuple):
    """Log likelihood ratios of all segments together, of those held out alone, and of those fitted alone.

    Together they have one noise. Where what is missing acts in those held out, that noise is large, and what
    explains some of it there seems to explain as much of the segments fitted: they count by themselves, too.
    """

    together: float
    held_out: float
    fitted: float


def _gains(before: _Powers, after: _Powers) -> _Gains:
    """Return the log likelihood ratios, of those held out less the one most for it.

    Held out a model may follow, or fail, in a single segment by luck, with an error that outweighs all
    others: no effect may rest on one. What parameters are uncertain by is priced in that of all segments.
    """
    fitted, fitted_t = before.fitted, after.fitted
    alone = _gain(fitted.squares, fitted.number, fitted_t.squares)
    return min(
        _Gains(
            _gain(fitted.squares + p.squares, fitted.number + p.number, fitted_t.squares + q.squares),
            _gain(p.squares, p.number, q.squares) + p.widening - q.widening,
            alone,
        )
        for p, q in zip(before.without, after.without, strict=True)
    )


def _gain(power: float, number: int, power_t: float) -> float:
    return 0.5 * number * math.log(max(power, NOTHING) / max(power_t, NOTHING))


def _rounded_gains(base: CandidateFit, tried: CandidateFit) -> _Gains:
    """Return the same for a sensor that rounds: against the baseline's residual under its own noise model.

    Parameters count as they are, those of the baseline too.
    """
    step = _step(tried)
    noise = prediction_error_filter(base.residuals, None, base.train.outputs)
    powers = _powers(replace(base, linear=None), noise)
    # where a model errs by more than a step a sample counts as stray: luck is where the baseline errs most
    luckiest = min(range(len(powers.without)), key=lambda i: powers.without[i].squares)
    left_out = luckiest if len(powers.without) > 1 else -1
    gains = []
    for fit, plain, out in (
        (base.train, powers.fitted, -1),
        (base.validation, powers.without[luckiest], left_out),
    ):
        if fit is None or not plain.number:
            gains.append(0.0)
            continue
        kept = [segment != out for segment in fit.segment_of]
        simulated = [y[k] for y, k in zip(fit.simulated_pieces, kept, strict=True)]
        measured = [y + e[k] for y, e, k in zip(simulated, fit.residual_pieces, kept, strict=True)]
        # over the samples of the rounding's likelihood: a density has a unit, a ratio of two has none
        samples = sum(map(len, measured))
        variance = max(plain.squares, NOTHING) / plain.number
        gauss = -0.5 * samples * math.log(2 * math.pi * math.e * variance)
        gains.append(rounding_evidence(measured, simulated, step) - gauss)
    fitted, held_out = gains
    return _Gains(fitted + held_out, held_out, fitted)
