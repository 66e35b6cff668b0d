"""What candidates of a search over records are compared with: the data, the refitted model, the noise."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ...cached import cached_property
from ..estimation.common_friction import dry_level, inertia, viscous_slope
from ..estimation.fit import FitResult
from ..estimation.multistart import trimmed
from ..estimation.segmented import CandidateFit, SegmentedData
from ..estimation.thresholds import RESTARTS_KEPT
from ..prediction.segments import facts
from ..prediction.values import with_values
from ..residuals.input_noise import made_by_input_noise
from ..residuals.left_open import curved_by_what_is_open, moved_by_starts
from ..shooting.noise_model import NoiseModel
from ..starting.read_again import read_again
from ..starting.regression import force_regression, motion_of
from ..thresholds import ONLY_NOISE, UNMOVED
from .evidence import ranked
from .thresholds import BASE_LONGER_STEPS, BASE_STEPS, GROWN, by_chance


@dataclass(frozen=True, eq=False)
class Reference:
    """What models are compared with at one stage of a search.

    Attributes
    ----------
    segmentations : sequence of SegmentedData
        The data in segments of three lengths, the shortest first.
    data : SegmentedData
        The segmentation that candidates are compared over.
    base : CandidateFit
        The model refitted.
    nearest : FitResult
        The model over the shortest segments, over which nearly every model fits, unless disturbance forces
        act.
    noise : NoiseModel
        Of the best model's residual.
    floor : float
        Least error that a fit can reach; 0 where it is not known yet.
    least : FitResult or None
        The fit over the shortest segments that errs least; None where it is not known yet.
    longer : sequence of FitResult or None
        The model refitted over the two longer lengths for validation, where it is; none: not known yet.
    regressed : mapping of str to float
        Its free parameters from a regression of the force.
    leaves_only_noise : bool
        Whether the model leaves only noise: it is in its right minimum, and what is missing, if anything is,
        is so small that it acts in proportion to its size.
    """

    segmentations: Sequence[SegmentedData]
    data: SegmentedData
    base: CandidateFit
    nearest: FitResult
    noise: NoiseModel
    floor: float = 0.0
    least: FitResult | None = None
    longer: Sequence[FitResult | None] = ()
    regressed: Mapping[str, float] = field(default_factory=dict)
    leaves_only_noise: bool = False

    @property
    def stroke(self) -> float:
        """The longest stroke of a record fitted [m]."""
        return max(float(np.ptp(facts(r).place)) for r in self.data.train.records)

    @cached_property
    def grown_over(self) -> tuple[FitResult, SegmentedData] | None:
        """The model over the longest segments over which it errs by more than slow noise does; None: nowhere.

        Over fewer and longer segments more may be chance: noise of the input makes a random walk in each.
        """
        if self.data.disturbed:
            return None
        longer = [*zip(self.longer, self.segmentations[1:], strict=False)]
        known = ((fit, data) for fit, data in reversed(longer) if fit is not None)
        return next(((fit, data) for fit, data in known if self.grew(self.nearest, fit, data)), None)

    def unmoved(self, significant: float) -> bool:
        """Whether disturbance forces prevail and the model explains no motion.

        Then its accelerations explain those recorded no better than zero would, or it does not follow the
        shortest segments: accelerations that are mostly noise are no evidence for such a model.

        `significant`: evidence that is significant [nats].
        """
        if not self.data.disturbed:
            return False
        base = self.base.train
        return self.nearest.nrmse > UNMOVED or -base.count * math.log(base.nrmse) < significant

    def noise_model(self, noise: NoiseModel) -> NoiseModel:
        """Return the noise model if its memory is within the shortest segments, else white noise.

        Slower noise cannot be distinguished from something that is missing, and is not assumed.
        """
        shortest = min(int(np.min(w.stop - w.first)) for w in self.nearest.segments)
        return noise if noise.memory <= shortest else NoiseModel(np.zeros(0), noise.sigma)

    def by_noise(self, fit: FitResult, noise: NoiseModel) -> float:
        """Return the error over the segments of a fit that noise alone may make, slow noise too."""
        return self.floor * (GROWN if self.least is None else self.grown(self.least, fit, noise))

    def grew(self, near: FitResult, far: FitResult, longest: SegmentedData) -> bool:
        """Whether a model errs over the longest segments by more than noise of sensor and input may make.

        The noise that shows over the shortest leaves initial states open.

        `near`, `far`: its fits over the shortest, and over the longest segments, which are `longest`.
        """
        most = self.grown(near, far) * near.rmse
        if far.rmse <= most:
            return False
        if far.rmse <= (most := math.hypot(most, made_by_input_noise(far, longest))):
            return False
        return far.rmse > math.hypot(most, moved_by_starts(far, longest, near.rmse))

    def runs_apart(self, near: FitResult, found: FitResult, far: FitResult, longest: SegmentedData) -> bool:
        """Whether a model does not follow the longest segments, and would not if it were the right one.

        Within what shorter ones leave open of it its motion goes on otherwise by as much as it errs.

        `near`, `found`, `far`: its fits over the shortest, over longer and over the longest segments.
        """
        follows = far.rmse <= self.grown(near, far) * near.rmse
        return not follows and curved_by_what_is_open(found, longest) >= far.rmse

    def grown(self, near: FitResult, far: FitResult, noise: NoiseModel | None = None) -> float:
        """Return how many times larger noise alone may be over longer segments, by its memory and by chance.

        Initial states absorb a part of slow noise, the more of it the more segments there are. `noise`: None:
        that of the reference.
        """
        if near.sensitivity is None or far.sensitivity is None:
            return GROWN
        noise_model = self.noise_model(noise or self.noise)
        left = far.sensitivity.left_by_starts(noise_model) / near.sensitivity.left_by_starts(noise_model)
        return max(GROWN, math.sqrt(left) * by_chance(far.spanned / noise_model.memory))

    def by_accelerations(self, free: tuple[str, ...]) -> Reference:
        """Return the same where disturbance forces dominate the error over longer segments.

        `free`: parameters of the model that are refitted.
        """
        segmentations = self.segmentations[0].with_process_noise.segmentations
        data = segmentations[0]
        base = CandidateFit("", data.fit(self.nearest.model, free))
        return replace(self, segmentations=segmentations, data=data, base=base, noise=ranked(base, ())[1])

    def rebased(self, found: Sequence[CandidateFit], free: tuple[str, ...]) -> Reference:
        """Refit the model from its parameters in the best candidates: it may be in a wrong minimum."""
        base = refitted_from(found, self.base.train, self.data, free)
        return replace(self, base=CandidateFit("", base))


def refitted_from(
    found: Sequence[CandidateFit], base: FitResult, data: SegmentedData, free: tuple[str, ...]
) -> FitResult:
    """Return a model refitted over segments from its parameters in the best candidates, or as it is."""
    for best in found[:2]:
        values = {k: best.block.parameters[k].value for k in free}
        again = data.fit(with_values(base.model, values), free, iterations=BASE_STEPS)
        base = min(base, again, key=lambda f: f.rmse)
    return base


def reference_of(block, segmentations: Sequence[SegmentedData], free: tuple[str, ...]) -> Reference:
    """Fit a model from its own values and from a regression of the force; return the better one."""
    shortest, data = segmentations[:2]
    guesses = [block]
    names = (inertia(block), dry_level(block), viscous_slope(block))
    plain, own, *_ = force_regression(motion_of(data.train, data.decimation, block), data.scales, block)
    guess = {k: float(v) for k, v in zip(names, plain, strict=True) if k and v > 0} | own
    guess = {k: v for k, v in guess.items() if k in free}
    read = {k: v for k, v in read_again(block, data).items() if k in free}
    guesses += [with_values(block, values) for values in (guess, read) if values]
    short = [shortest.fit(b, free, iterations=BASE_STEPS) for b in guesses]
    best = min(short, key=lambda f: f.rmse)
    near = shortest.with_levels(best)
    short += [] if near is best else [near]
    fits = [data.moved(f, BASE_LONGER_STEPS) for f in short]
    if block.many_minima and free:
        # from its own values directly, too: a model that was fitted before stays in its minimum
        fits.append(data.fit(block, free, iterations=BASE_LONGER_STEPS, followed=RESTARTS_KEPT))
    if block.nonsmooth and free:
        fits += _past_events(min(short, key=lambda f: f.rmse), shortest, data)
    base = CandidateFit("", min(fits, key=lambda f: f.rmse))
    noise = ranked(base, ())[1]
    return Reference(segmentations, data, base, shortest.moved(base.train), noise, regressed=guess)


def input_steps(at: Reference) -> int:
    """Return how many samples a step of the input may take: longer ones move the model as every sample does.

    That is, within what its error over the shortest segments hides.
    """
    longest, hides = at.segmentations[-1], at.nearest.rmse

    def motion(step) -> np.ndarray:
        fit = replace(longest, decimation=step).fit(at.base.block, (), iterations=0)
        return np.concatenate(fit.simulated)

    step, exact = longest.decimation, motion(1)
    while step > 1 and math.hypot(hides, np.std(motion(step) - exact)) > ONLY_NOISE * hides:
        step //= 2
    return step


def _past_events(found: FitResult, shortest: SegmentedData, data: SegmentedData) -> list[FitResult]:
    """Return a model refitted past events; none where short segments leave only noise.

    Where impacts come and go, initial states in a wrong minimum bias the parameters, and every effect is
    compared with the model: initial states are therefore sought carefully, here once for all candidates.
    """
    if found.rmse <= ONLY_NOISE * data.noise:
        return []
    near = shortest.fit(found.model, found.names, iterations=BASE_STEPS, followed=RESTARTS_KEPT)
    near = trimmed(near, shortest)
    far = data.fit(near.model, near.names, iterations=BASE_LONGER_STEPS, followed=RESTARTS_KEPT)
    return [trimmed(far, data)]
