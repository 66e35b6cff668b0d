"""Evidence of candidates over the baseline.

Log likelihood ratios of whitened residuals, less a price of parameters; a sensor that rounds is judged by how
probable the recorded values are.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

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
        price = 0.5 * t.extra * math.log(before.count + int(before.counts.sum()))
        judged.append(replace(t, evidence=gain - price, evidence_validation=gain_held))
    return sorted(judged, key=lambda t: (t.evidence_validation < -REFUTED, -t.evidence)), noise


def rounds(tried: CandidateFit) -> bool:
    """Whether what a candidate adds is a sensor that rounds: its errors are no noise."""
    return bool(tried.key) and _step(tried) > 0


def _step(tried: CandidateFit) -> float:
    """Return the step to which the newest effect rounds; 0 if it does not."""
    steps = (p.value for p in tried.block.effects[-1].parameters.values() if p.stepped)
    return next(steps, 0.0)


@dataclass(frozen=True, eq=False)
class _Powers:
    """Power and number of whitened residuals: of the segments fitted, and of each one held out."""

    fitted: float
    count: int
    held: np.ndarray
    counts: np.ndarray

    def over(self, kept: np.ndarray, held_alone: bool = False) -> tuple[float, int]:
        """Return power and number, of the segments held out only those `kept`."""
        fitted, count = (0.0, 0) if held_alone else (self.fitted, self.count)
        return fitted + float(self.held[kept].sum()), count + int(self.counts[kept].sum())


def _powers(tried: CandidateFit, noise: NoiseModel) -> _Powers:
    held = tried.validation
    validation = [noise.weighed(r, i) for i, r in enumerate(held.residual_pieces)] if held else []
    # a filter leaves out the first samples of a piece
    owners = [o[len(o) - len(r) :] for o, r in zip(held.segment_of, validation, strict=True)] if held else []
    owner = np.concatenate([*owners, np.empty(0, int)])
    squares = np.concatenate([*(r * r for r in validation), np.empty(0)])
    return _Powers(
        *whitened_power(tried.train.residual_pieces, noise), np.bincount(owner, squares), np.bincount(owner)
    )


def _gains(before: _Powers, after: _Powers) -> tuple[float, float]:
    """Return the log likelihood ratio of all segments, and of those held out, the one most for it left out.

    Held out a model may follow, or fail, in a single segment by luck, with an error that outweighs all
    others: no effect may rest on one.
    """
    number = len(before.held)
    without = ~np.eye(number, dtype=bool) if number > 1 else np.ones((1, number), dtype=bool)
    return tuple(
        min(_gain(before.over(kept, alone), after.over(kept, alone)) for kept in without)
        for alone in (False, True)
    )  # pyright: ignore[reportReturnType]


def _gain(before: tuple[float, int], after: tuple[float, int]) -> float:
    (power, n), (power_t, _) = before, after
    return 0.5 * n * math.log(power / power_t) if n else 0.0


def _rounded_gains(base: CandidateFit, tried: CandidateFit) -> tuple[float, float]:
    """Return the same for a sensor that rounds: against the baseline's residual under its own noise model."""
    step = _step(tried)
    noise = prediction_error_filter(base.residuals, None, base.train.outputs)
    gains = []
    powers = _powers(base, noise)
    held = float(powers.held.sum()), int(powers.counts.sum())
    for fit, power in ((base.train, (powers.fitted, powers.count)), (base.validation, held)):
        if fit is None:
            gains.append(0.0)
            continue
        # for as many samples as the rounding is judged by: a density has a unit, a ratio of two has none
        samples = sum(len(r) for r in fit.residual)
        plain = -0.5 * samples * math.log(2 * math.pi * math.e * power[0] / power[1])
        measured = [a + b for a, b in zip(fit.simulated, fit.residual, strict=True)]
        gains.append(rounding_evidence(measured, fit.simulated, step) - plain)
    return sum(gains), gains[1]
