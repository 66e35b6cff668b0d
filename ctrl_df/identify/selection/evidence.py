"""Evidence of candidates over the baseline.

Log likelihood ratios of whitened residuals, less a price of parameters; a sensor that rounds is judged by how
probable the recorded values are.
"""

from __future__ import annotations

import math
from dataclasses import replace

from ..estimation.segmented import CandidateFit
from ..shooting.noise_model import NoiseModel, prediction_error_filter, whitened_power
from .rounding import rounding_evidence
from .thresholds import REFUTED


def ranked(base: CandidateFit, trials) -> tuple[list[CandidateFit], NoiseModel]:
    """Return the trials with their evidence over the baseline, best first, and the noise that judged it.

    What held-out data speak against comes after all that they do not. The noise model is of the residuals of
    the best one, a sensor that rounds left aside.
    """
    best = min([base, *(t for t in trials if not rounds(t))], key=lambda t: t.size)
    noise = prediction_error_filter(best.residuals, base.train.error_filter, base.train.outputs)
    before = _powers(base, noise)
    judged = []
    for t in trials:
        gain, gain_held = _rounded_gains(base, t) if rounds(t) else _gains(before, _powers(t, noise))
        # hardly more than starts was fitted to the segments to validate on: their gain also stands alone
        price = 0.5 * t.extra * math.log(sum(n for _, n in before))
        judged.append(replace(t, evidence=gain - price, evidence_validation=gain_held))
    return sorted(judged, key=lambda t: (t.evidence_validation < -REFUTED, -t.evidence)), noise


def rounds(tried: CandidateFit) -> bool:
    """Whether what a candidate adds is a sensor that rounds: its errors are no noise."""
    return bool(tried.key) and _step(tried) > 0


def _step(tried: CandidateFit) -> float:
    """Return the step to which the newest effect rounds; 0 if it does not."""
    steps = (p.value for p in tried.block.effects[-1].parameters.values() if p.stepped)
    return next(steps, 0.0)


def _powers(tried: CandidateFit, noise: NoiseModel):
    """Return power and number of whitened residuals of the segments fitted, and of those held out."""
    validation = tried.validation.residual_pieces if tried.validation is not None else []
    return whitened_power(tried.train.residual_pieces, noise), whitened_power(validation, noise)


def _gains(before, after) -> tuple[float, float]:
    """Return the log likelihood ratio of all segments, and of those held out."""
    (fitted, n), (validation, n_held) = before
    (fitted_t, _), (held_t, _) = after
    gain_held = 0.5 * n_held * math.log(validation / held_t) if n_held else 0.0
    return 0.5 * (n + n_held) * math.log((fitted + validation) / (fitted_t + held_t)), gain_held


def _rounded_gains(base: CandidateFit, tried: CandidateFit) -> tuple[float, float]:
    """Return the same for a sensor that rounds: against the baseline's residual under its own noise model."""
    step = _step(tried)
    noise = prediction_error_filter(base.residuals, None, base.train.outputs)
    gains = []
    for fit, power in zip((base.train, base.validation), _powers(base, noise), strict=True):
        if fit is None:
            gains.append(0.0)
            continue
        # for as many samples as the rounding is judged by: a density has a unit, a ratio of two has none
        samples = sum(len(r) for r in fit.residual)
        plain = -0.5 * samples * math.log(2 * math.pi * math.e * power[0] / power[1])
        measured = [a + b for a, b in zip(fit.simulated, fit.residual, strict=True)]
        gains.append(rounding_evidence(measured, fit.simulated, step) - plain)
    return sum(gains), gains[1]
