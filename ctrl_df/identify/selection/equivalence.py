"""Effects that are the same map on these data: found by comparing what they make of the output."""

from __future__ import annotations

from ...blocks.core import level
from ...blocks.stated import static_levels
from ..estimation.segmented import CandidateFit
from ..shooting.noise_model import NoiseModel, whitened_power
from ..thresholds import NOTHING, TOLD_APART
from .thresholds import BUMP_LEFT, PASSED


def indistinguishable(first, second, noise: NoiseModel, *, nats: float = TOLD_APART) -> bool:
    """Whether two candidates' outputs differ by no more than the noise lets one see.

    Parameters
    ----------
    first, second : sequence of arrays
        Simulated outputs, as evidence takes them (`CandidateFit.outputs`).
    noise : NoiseModel
        Of the better one's residual.
    nats : float
        Log likelihood ratio that would tell them apart.
    """
    difference = [a - b for a, b in zip(first, second, strict=True)]
    power, _ = whitened_power(difference, noise)
    return 0.5 * power / max(noise.sigma, NOTHING) ** 2 < nats


def breaks_away_only(tried: CandidateFit, speed: float) -> bool:
    """Whether a candidate is a static level whose bump over speed is passed within a sample.

    `speed`: typical of the records [m/s].
    """
    effect = tried.block.effects[-1]
    if effect.role != "friction" or not static_levels(type(effect)):
        return False
    beside = [e for e in tried.block.effects if e.role == "friction" and e.side == effect.side]
    beside.sort(key=lambda e: e.rank)
    without, passed = [e for e in beside if e is not effect], PASSED * speed
    kinetic = level(without, 1.0, 1.0, passed)
    bump = level(beside, 1.0, 1.0, passed) - kinetic
    return bump <= BUMP_LEFT * (level(beside, 0.0, 1.0, 0.0) - kinetic)
