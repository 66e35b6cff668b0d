"""Whether the best candidate is ahead of all others however far ahead it has to predict.

Evidence is of segments that are restarted, some motions long. A model of other physics may fit those, from
states that are estimated in each; over longer horizons, with hidden states continued, it falls behind one
that is right, or behind the model without it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...simulate.parallel import side_by_side
from ..residuals.horizons import noise_of
from ..results.diagnosis import Baseline, CandidateEffect
from ..thresholds import GROWTH, UNMOVED
from .thresholds import LEFT, LONG_RIVALS


@dataclass(frozen=True)
class LongPrediction:
    """How the first of some models predicts over long horizons.

    Attributes
    ----------
    horizon : float
        The longest over which the best of them explains the motion [s], or the one where the first falls
        behind most; 0: none explains the motion over any.
    errors : mapping of str to float
        nrmse there, by id; that of the baseline has an empty one.
    better : tuple of str
        Ids of those that err clearly less than the first, the best first.
    refuted : bool
        Whether the first is none of the right ones: the model without it is ahead, or the first explains no
        motion where one of these explains nearly all of it.
    """

    horizon: float
    errors: Mapping[str, float]
    better: tuple[str, ...]
    refuted: bool = False

    @property
    def ahead(self) -> bool:
        """Whether the first explains the motion there, and none does so better."""
        return self.horizon > 0 and not self.better


def compared(ranking: Sequence[CandidateEffect], significant: float) -> list[CandidateEffect]:
    """Return what is compared with the baseline: the first of a ranking, and those nearest to it."""
    first, *others = ranking
    near = [c for c in others if c.confirmed and c.evidence > significant and c.id not in first.equivalents]
    return [first, *near[:LONG_RIVALS]]


def long_prediction(
    ranking: Sequence[CandidateEffect], base: Baseline, significant: float
) -> LongPrediction | None:
    """Compare the first of a ranking with its rivals over all horizons up to the longest that one predicts.

    Errors count by their geometric mean over these lengths, each as much as any other: what follows long ones
    by chance fails over others, and one period of a ripple too far, at the end of a segment, is one length's.
    Where nothing pulls a model back, small errors of parameters drift apart in time: beyond some length no
    model predicts anything, and there nothing is compared. Nor is a model over lengths at which noise that
    leaves the state open where a segment begins comes to half of the motion: an unstable machine, which a
    controller held when it was recorded, is not predicted by the right model either, and by wrong ones well.

    Parameters
    ----------
    ranking : sequence of CandidateEffect
        The best of these are compared, those that the first equals left aside.
    base : Baseline
        Compared as well; its name is empty.
    significant : float
        Evidence that a rival needs [nats].

    Returns
    -------
    LongPrediction or None
        None where there is nothing to predict.
    """
    first = ranking[0]
    if first.predicted is None:
        return None
    models = compared(ranking, significant)
    curves = side_by_side(lambda m: m.error_by_horizon, [base, *models])
    names = ["", *(c.id for c in models)]
    table = np.maximum([c.nrmse for c in curves], noise_of(first.predicted[1]))  # errors below tell nothing
    tells = np.array([c.by_noise for c in curves]) < UNMOVED
    tells[:, 0] = True
    predicted = np.flatnonzero((np.min(table, axis=0) < UNMOVED) & tells[1])
    if not predicted.size:
        return LongPrediction(0.0, dict(zip(names, table[:, 0].tolist(), strict=True)), ())
    table, tells = table[:, : predicted[-1] + 1], tells[:, : predicted[-1] + 1]
    usual_ratio = np.average(np.log(table / table[1]), axis=1, weights=tells & tells[1])
    ratio = dict(zip(names, np.exp(usual_ratio).tolist(), strict=True))
    better = sorted((n for n in names if GROWTH * ratio[n] < 1), key=ratio.__getitem__)
    others = np.array([n != first.id for n in names])
    shown = int(np.argmax(table[1] / np.min(table[others], axis=0))) if better else len(table[0]) - 1
    errors = dict(zip(names, table[:, shown].tolist(), strict=True))
    farthest = dict(zip(names, table[:, -1].tolist(), strict=True))
    nothing = farthest[first.id] >= UNMOVED and any(farthest[n] < LEFT for n in better)
    return LongPrediction(float(curves[0].horizon[shown]), errors, tuple(better), "" in better or nothing)
