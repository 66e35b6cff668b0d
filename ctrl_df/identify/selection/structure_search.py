"""The search over records: the baseline, every candidate fitted, the best confirmed at the full rate."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from ...blocks.core import level
from ...blocks.effect import static_levels
from ...simulate.crew import side_by_side
from ..estimation.common_friction import dry_level, inertia, viscous_slope
from ..estimation.fit import FitResult
from ..estimation.multistart import (
    all_restarted,
    begun_as,
    beyond,
    cross_started,
    own,
    restarted,
    thresholds_refined,
)
from ..estimation.refit_records import blurred
from ..estimation.segmented import CandidateFit, SegmentedData, prepare
from ..prediction.segments import facts
from ..prediction.sensed import POSITION, sensed
from ..prediction.simulator import feasible
from ..starting.regression import force_regression, motion_of
from ..starting.screen import Screen
from ..thresholds import BY_CHANCE, GROWTH, HOPELESS, PROCESS_NOISE, SIGNIFICANT, STILL_POSSIBLE, UNMOVED
from .attempts import itself, own_names, tried
from .equivalence import indistinguishable
from .evidence import ranked, rounds
from .remaining import located, remainder
from .search import Remainder, Search, Words
from .thresholds import (
    BUMP_LEFT,
    CONFIRMED,
    CONFIRMED_FORCED,
    EFFORT_CONFIRMED,
    EFFORT_ENDED,
    EFFORT_MOVED,
    EXACT,
    EXPLAINS_LITTLE,
    FLOOR,
    LEFT,
    PASSED,
    PROMISING,
    SHOWS_HARDLY,
    SIGNIFICANT_HELD,
    SIZE_KNOWN,
    STOPPED_EARLY,
    STRUCTURE_LEAST,
)


class StructureSearch(Search):
    """The fits of one diagnosis over time.

    Parameters
    ----------
    block : Mechanism
        The model as it stands.
    records, held : sequences of Measurement
        To fit; to validate on (may be empty).
    free : tuple of str
        Parameters of the model that may be refitted.
    """

    significant = SIGNIFICANT
    significant_validation = SIGNIFICANT_HELD
    words = Words("data", "the noise of these data", "", "an input", " It shows as {}.")

    def __init__(self, block, records, validation, free):
        self.block, self.free = block, tuple(free)
        data = prepare(block, records, validation)
        self.nominal = {k: p.value for k, p in block.parameters.items()}
        self._look_at(data, 1)
        self.base = self._baseline(block)
        self.floor = 0.0  # error that a fit can come down to at best, from `confirm` on
        # over the shortest segments nearly every model follows, unless forces disturb it
        self.nearest = self.segmentations[0].moved(self.base.train)
        self.noise = ranked(self.base, ())[1]  # of the best model's residual

    def disturbs(self, error: float, data: SegmentedData) -> bool:
        """Whether an error over the shortest segments is one that disturbance forces make."""
        return error > PROCESS_NOISE * data.noise and not data.noise_free

    def _look_at(self, data: SegmentedData, which: int):
        self.segmentations = data.segmentations
        self.data = self.segmentations[which]

    def _baseline(self, block) -> CandidateFit:
        """Fit the baseline from its own values and from a regression of the force; keep the better."""
        shortest, data = self.segmentations[:2]
        begins = [block]
        names = (inertia(block), dry_level(block), viscous_slope(block))
        plain, own, *_ = force_regression(motion_of(data.train, data.thin, block), data.scales, block)
        guess = {k: float(v) for k, v in zip(names, plain, strict=True) if k and v > 0} | own
        guess = {k: v for k, v in guess.items() if k in self.free}
        if guess:
            begins.append(block.with_parameters(feasible(block, guess)))
        found = []
        for begin in begins:
            found.append(data.moved(shortest.fit(begin, self.free, iterations=8), 12))
        return CandidateFit("", min(found, key=lambda f: f.rmse))

    @property
    def records(self):
        """The records to fit, and those held out; none where parts of the former are."""
        validation = (
            () if self.data.validation.records is self.data.train.records else self.data.validation.records
        )
        return self.data.train.records, validation

    @property
    def placed(self) -> bool:
        """Whether a sensor told the place."""
        return all(POSITION in sensed(r).columns for r in self.data.train.records)

    @property
    def measure(self) -> str:
        """What errors are of: the output, or its acceleration where disturbance forces outweigh the noise."""
        return "acceleration" if self.data.disturbed else "output"

    # --- every effect, coarsely -----------------------------------------------------------------------

    def candidates(self, classes, executor=None) -> list[CandidateFit]:
        """Return every effect that can be added, fitted, the one with most evidence first."""
        if not self.placed:  # sensors' effects are of the place
            classes = [c for c in classes if c.role != "output"]
        self.course.stage(f"{len(classes)} effects tried over short segments")
        base, found = self._look(classes, executor, self.data.sampled, self.course.known)
        self.course.known(found)
        if self._disturbed(found):
            # a disturbance force drowns all else over longer segments
            self._look_at(self.segmentations[0].with_process_noise, 0)
            self.base = CandidateFit("", self.data.fit(self.nearest.model, self.free))
            self.noise = ranked(self.base, ())[1]
            self.course.stage("the same by accelerations: disturbance forces outweigh the noise")
            base, found = self._look(classes, executor, self.data.sampled)
            self.course.known(found)
        longest = self.segmentations[-1]
        there = base if self.data.disturbed else longest.reached(base)
        if there.rmse > GROWTH * base.rmse:
            # Short segments show nothing, long ones do: what is missing acts seldom, or slowly.
            self.course.stage("the same over long segments")
            near, self.base = self.base, CandidateFit("", there)
            moved = self._over_long_windows(base.rmse, there.rmse, found)
            if moved is not None:
                base, again = self._look(classes, executor, longest)
                found = _best_of(base, [*moved, *again])
                self.course.known(found)
            # what it is compared with from here on errs over these segments
            self.base = min(near, CandidateFit("", self.data.moved(there)), key=lambda t: t.train.rmse)
        if found:
            self._rebase(found)
        return found

    def _disturbed(self, found) -> bool:
        """Whether forces disturb the machine that no effect accounts for.

        The baseline then errs over the shortest segments by far more than the sensor's noise, and so does the
        best candidate; an effect that is missing would take most of that away.
        """
        least, shortest = self.nearest.rmse, self.segmentations[0]
        if not self.disturbs(least, self.data):
            return False
        best = sorted(found, key=lambda t: t.train.rmse)[:2]
        moved = side_by_side(lambda t: shortest.moved(t.train, hopeless=least), best)
        return all(self.disturbs(f.rmse, self.data) and f.rmse > LEFT * least for f in moved)

    def _over_long_windows(self, here, there, found) -> list[CandidateFit] | None:
        """Return the best by error moved to the longest segments; None where they explain enough there.

        `here`, `there`: error of the baseline where the trials were fitted, and over the longest segments.
        """
        if found and found[0].train.rmse <= EXPLAINS_LITTLE * here:
            return None
        longest = self.segmentations[-1]
        best = sorted(found, key=lambda t: t.train.rmse)[:CONFIRMED]
        moved = side_by_side(lambda t: replace(t, train=longest.moved(t.train, *EFFORT_MOVED)), best)
        shows = found and found[0].train.rmse <= SHOWS_HARDLY * here
        return None if shows and min(t.train.rmse for t in moved) <= 0.5 * there else moved

    def _look(self, classes, executor, data: SegmentedData, screened=None):
        """Fit every effect over one set of segments; return baseline and effects there, best first.

        `screened` takes the effects before they are fitted.
        """
        base, found = self._tried(classes, executor, data, screened)
        return base, ranked(CandidateFit("", base), found)[0]

    def _tried(self, classes, executor, data: SegmentedData, screened=None, reached: float = math.inf):
        base = data.moved(self.base.train, 3)
        if not classes:
            return base, []
        screen = Screen(base, data)
        nominal = {k: self.nominal[k] for k in self.free if k in screen.block.parameters}
        # where short segments show noise alone (its rms, but for chance) no minimum is right
        most = (1 + BY_CHANCE / math.sqrt(2 * self.nearest.count)) * self.data.noise
        shows = self.nearest.rmse > most or self.data.disturbed
        short = self.segmentations[0].sampled if shows else data
        return base, tried(classes, screen, short, self.free, nominal, executor, screened, reached)

    def rivals(self, model, names, classes, executor=None):
        """Return effects that may do what the model of one effect more does, with evidence over it."""
        data = self.data.sampled
        known = data.fit(model, names, iterations=4)
        _, found = self._tried(classes, executor, data, reached=known.rmse)
        more = len(names) - len(self.free)
        return ranked(CandidateFit("", known), [replace(t, extra=t.extra - more) for t in found])[0]

    def _rebase(self, found):
        """Refit the baseline from what the best candidates say of its parameters: it may have been stuck."""
        for best in found[:2]:
            values = {k: best.block.parameters[k].value for k in self.free}
            block = self.base.block
            again = self.data.fit(block.with_parameters(feasible(block, values)), self.free, iterations=8)
            if again.rmse < self.base.train.rmse:
                self.base = CandidateFit("", again)

    # --- the best, carefully --------------------------------------------------------------------------

    def confirm(self, found) -> list[CandidateFit]:
        """Refit baseline and best candidates at the full rate; return these candidates, best first.

        The segments are of the length that suits these data (`_longest_coherent`).
        """
        self.course.stage("the best refitted over segments of every length")
        # Disturbance forces let the first look tell little.
        found = _promising(found, CONFIRMED_FORCED, 0.0) if self.data.disturbed else _promising(found)
        stages, floor = self._stages([self.base.train, *(t.train for t in found)])
        self.floor = floor
        levels, at = list(self.segmentations), _longest_coherent(stages)
        if at == 0 and not self.data.disturbed:
            # Longer segments show what no candidate explains: hidden states, fitted anew in many short ones,
            # would pass for it.
            levels[0] = levels[0].continued
            short = levels[0]
            stages[0] = side_by_side(
                lambda f: short.moved(f) if f is not None and short.carries(f.model) else f, stages[0]
            )
            at = _longest_coherent(stages)
        # An error of whole steps of the sensor is averaged out by long segments, followed by short ones.
        averaged = bool(found) and rounds(found[0]) and not self.data.disturbed
        if averaged:
            at = len(stages) - 1
        self.course.stage("the best refitted at the full rate, and tried on what is held out")
        tried = (self.base, *found)
        best = _validated(levels[at], tried, stages[at])
        while at and not averaged and _held_out_by_luck(best, levels[at - 1], stages[at - 1]):
            at -= 1
            best = _validated(levels[at], tried, stages[at])
        self.data = levels[at]
        base, *others = [t for t in best if t is not None]
        # what contains the baseline never errs more where both are fitted as well
        self.base = begun_as(base, min([base, *others], key=lambda t: t.size), self.data.fine)
        chosen, self.noise = ranked(self.base, others)
        if not chosen:
            return []
        self.course.known(chosen)
        self.course.stage("near ones begun again where the best one ended")
        chosen = self._again(chosen, chosen[:1])
        # Near equals are told apart by fits that have come to an end, and in the right minimum.
        near = [t for t in chosen if chosen[0].evidence - t.evidence < STOPPED_EARLY]
        least = min(t.train.rmse for t in chosen)
        close = [t for t in chosen if t in near or t.evidence > 0.5 * chosen[0].evidence]
        close = [t for t in close if t.train.rmse < HOPELESS * least]
        ended = side_by_side(lambda t: self._ended(t, t in near and len(near) > 1, floor, least), close)
        if any(a is not b for a, b in zip(ended, close, strict=True)):
            chosen = self._again([*ended, *(t for t in chosen if t not in close)], ended)
        span = max(float(np.ptp(facts(r).place)) for r in self.data.train.records)
        chosen, self.noise = ranked(self.base, [t for t in chosen if itself(t, span)])
        return chosen

    def _stages(self, fits):
        """Return the fits in segments of every length that may judge, the shortest first, and their floor.

        The floor is the error that a fit can come down to at best: over short segments nearly every model
        follows. Where disturbance forces prevail the shortest segments alone may judge. None stands for fits
        without a chance.
        """
        shortest, middle, longest = self.segmentations
        short = side_by_side(shortest.moved, fits)
        floor = FLOOR * min(f.rmse for f in short)
        if self.data.disturbed:
            return [short], floor
        near = self._stage(middle, fits, short, floor)
        return [short, near, self._stage(longest, near, near, floor)], floor

    def _stage(self, data: SegmentedData, fits, before, floor) -> list[FitResult | None]:
        """Move the baseline and the best candidate to other segments, then those with a chance against them.

        `before`: the fits in segments that these are made of: no fit over longer ones can err less than that
        over the parts of them.
        """
        errors = [math.inf if f is None else f.rmse for f in before]
        ahead = [0, *([1 + int(np.argmin(errors[1:]))] if len(errors) > 1 else [])]
        found: list[Any] = [None] * len(fits)
        for i, f in zip(ahead, side_by_side(data.reached, [fits[i] for i in ahead]), strict=True):
            found[i] = f
        hopeless = HOPELESS * min(found[i].rmse for i in ahead)
        others = [i for i, e in enumerate(errors) if i not in ahead and e < hopeless]
        moved = side_by_side(lambda i: data.moved(fits[i], hopeless=hopeless), others)
        for i, f in zip(others, moved, strict=True):
            found[i] = f
        there = [i for i, f in enumerate(found) if f is not None]
        for i, f in zip(there, all_restarted([found[i] for i in there], data, floor), strict=True):
            found[i] = f
        return found

    def _ended(self, tried: CandidateFit, exactly: bool, floor: float, least: float) -> CandidateFit:
        """Return a candidate in its best minimum, unless nothing better is possible.

        `exactly`: iterated to the end first. `least`: error of the best of all [m].
        """
        fine, fit = self.data.fine, tried.train
        if exactly:
            fit = fine.moved(fit, *EFFORT_ENDED)
        if own(fit) and fit.rmse > floor and least > floor and not fine.disturbed:
            fit = restarted(fit, fine.fit, own(fit), beyond(fit, least))
        return thresholds_refined(
            tried if fit is tried.train else fine.validate(replace(tried, train=fit)), fine
        )

    def _again(self, chosen, those) -> list[CandidateFit]:
        """Begin candidates once more where each of `those` ended; keep every effect's best, best first."""
        fine = self.data.fine
        pairs = [(t, best) for best in those for t in chosen if t is not best]
        begun = side_by_side(lambda pair: cross_started(pair[0], pair[1], fine), pairs)
        judged, _ = ranked(self.base, [*chosen, *(t for t in begun if t is not None)])
        return [next(t for t in judged if t.key == key) for key in dict.fromkeys(t.key for t in judged)]

    def alike(self, a: CandidateFit, b: CandidateFit) -> bool:
        """Whether two candidates make the same of these data, within noise or as the limit of each other."""
        if all(self._breaks_away_only(t) for t in (a, b)):
            return True
        return indistinguishable(a.outputs, b.outputs, self.noise)

    def _breaks_away_only(self, tried: CandidateFit) -> bool:
        """Whether a candidate is a static level whose bump over speed is passed within a sample."""
        effect = tried.block.effects[-1]
        if effect.role != "friction" or not static_levels(type(effect)):
            return False
        beside = [e for e in tried.block.effects if e.role == "friction" and e.side == effect.side]
        beside.sort(key=lambda e: e.rank)
        without, speed = [e for e in beside if e is not effect], PASSED * self.data.scales.speed
        kinetic = level(without, 1.0, 1.0, speed)
        bump = level(beside, 1.0, 1.0, speed) - kinetic
        return bump <= BUMP_LEFT * (level(beside, 0.0, 1.0, 0.0) - kinetic)

    # --- what it comes to -----------------------------------------------------------------------------

    def errors(self, judged):
        """Return nrmse over the segments fitted, and over those held out."""
        return judged.train.nrmse, judged.validation.nrmse if judged.validation is not None else math.nan

    def standard_errors(self, judged):
        """Return the standard errors of a fit that came to its end."""
        return judged.train.standard_errors if len(judged.train.covariance) else {}

    def undetermined(self, judged):
        """Return the parameters of the newest effect at a bound, or known to worse than their size."""
        fit = judged.train
        if not judged.confirmed or not len(fit.covariance):
            return ()
        # a bound that the records prove, where a body has been, is what they tell of the parameter
        proved = {f"{judged.block.newest}.{k}" for k in judged.block.effects[-1].bounds(self.data.filtered)}
        at_bound = {k for k, bound in zip(fit.names, fit.at_bound, strict=True) if bound}
        doubtful = (at_bound - proved) | blurred(fit)
        # a static level is found by trying, as single samples pass it: slopes know nothing of it
        table, errors, values = judged.block.parameters, fit.standard_errors, fit.parameters
        own = [k for k in own_names(judged.block) if not table[k].threshold]
        # the size of an effect, its first parameter, is measured by itself
        size = set(own_names(judged.block)[:1]).intersection(own)
        doubtful |= {k for k in size if k in values and errors[k] > SIZE_KNOWN * abs(values[k])}
        return tuple(k.rpartition(".")[2] for k in own if k in doubtful)

    def predicted(self, judged):
        """Return the model and the records held out (angles as these have them), or those fitted."""
        fitted, held = self.records
        if held and judged.validation is not None:
            return judged.validation.model, held
        return judged.block, held or fitted

    def so_far(self, judged):
        """Return the noise of the sensor, and what a model errs by beyond it."""
        noise, error = self.data.noise, judged.train.rmse
        if self.data.disturbed:
            return Remainder(0.0, error, False)
        return Remainder(min(noise, error), math.sqrt(max(error**2 - noise**2, 0.0)), False)

    def exact(self):
        """Whether the model errs by rounding alone."""
        return self.base.train.nrmse < EXACT and not self.data.disturbed

    def remainder(self, best, significant):
        """Return what the best model leaves."""
        left = remainder(self.base, best, self.data.fine, self.noise, self.floor, self.significant)
        if self.data.disturbed and not significant and self.nearest.nrmse > UNMOVED:
            # accelerations that are mostly noise do not speak for a model that does not even move
            return replace(left, unexplained=True)
        return left

    def located(self, best, remainder, unknown):
        """Return where the error is."""
        return located(
            self.base, best, self.data.fine, self.noise, remainder, unknown=unknown,
            significant=self.significant, measure=self.measure,
        )  # fmt: skip

    def fitted(self, block, names, iterations):
        """Return a block with these parameters fitted, and run over the segments held out."""
        found = self.data.fit(block, names, iterations=iterations)
        return self.data.validate(
            CandidateFit(block.newest if block.effects else "", found, extra=len(names))
        )

    def ranked(self, base, judged):
        """Return models with their evidence over `base`, best first."""
        return ranked(base, judged)[0]

    def final(self, models, free):
        """Return the models with their errors at the full rate, over the segments that the last one bears.

        Where disturbance forces blur parameters they are fitted over shorter segments first.
        """
        common = self.data.fine
        if common.disturbed:
            models = [self._sharpened(m, common, free) for m in models]
        return [(m, *common.errors(m)) for m in models]

    @staticmethod
    def _sharpened(model, data: SegmentedData, free):
        if data.carries(model):
            return model
        return data.short_segments.fit(model, free(model)).model

    def relative(self, noise):
        """Return noise over the rms of the centred output, or of the acceleration."""
        return noise * self.base.train.nrmse / self.base.train.rmse


def _best_of(base, trials) -> list[CandidateFit]:
    """Return every effect's best fit, best first."""
    best: dict[str, CandidateFit] = {}
    for t in trials:
        if t.key not in best or t.train.rmse < best[t.key].train.rmse:
            best[t.key] = t
    return ranked(CandidateFit("", base), best.values())[0]


def _promising(found, most=CONFIRMED, share=PROMISING) -> list[CandidateFit]:
    """Return the candidates to confirm: the first two, and all near the best by evidence or by error.

    `most`: of them by evidence, `share` of the best one's that is near.
    """
    close = sorted(found, key=lambda t: t.train.rmse)[:3]
    close = [t for t in close if t.train.rmse < STILL_POSSIBLE * close[0].train.rmse]
    likely = found[:2] + [t for t in found[2:most] if t.evidence > share * found[0].evidence]
    return likely + [t for t in close if not any(t is o for o in likely)]


def _validated(data: SegmentedData, tried, fits) -> list[CandidateFit | None]:
    """Return models at the full rate, from their fits in some segments, and run on what is held out.

    None stands for those that have no fit there.
    """
    fine = data.fine

    def at_full_rate(pair):
        t, fit = pair
        train = fit and fine.moved(fit, *EFFORT_CONFIRMED)
        return train and fine.validate(replace(t, train=train, confirmed=True))

    return side_by_side(at_full_rate, zip(tried, fits, strict=True))


def _held_out_by_luck(best, shorter: SegmentedData, fits) -> bool:
    """Whether the nearest model's error grows from shorter segments where they are held out, but not fitted.

    Motion that is sensitive to where it begins is followed where start and parameters are fitted; held out
    it is luck whether a model does, and no merit.

    `best`: models in these segments; `shorter`, `fits`: the next shorter ones, and the fits there.
    """
    i = min((i for i, t in enumerate(best) if t is not None), key=lambda i: best[i].train.rmse)
    there = shorter.fine.validate(best[i]).validation_rmse
    fitted = max(best[i].train.rmse / fits[i].rmse, 1.0)
    return best[i].validation_rmse > GROWTH * fitted * there


def _longest_coherent(stages) -> int:
    """Return the level to judge at: the longest segments over which the best model's error does not grow.

    `stages`: fits per level, short segments first, the baseline's and then the candidates'. Where the
    best grows with the length (motion that is sensitive to its start, force noise in a real machine, an
    effect outside the library) short segments are clearer, provided that they show what is missing as well
    as long ones do.
    """
    errors = [[math.inf if f is None else f.rmse for f in stage] for stage in stages]
    base, best = [e[0] for e in errors], [min(e) for e in errors]
    at = 0
    while at + 1 < len(errors) and best[at + 1] <= GROWTH * best[at]:
        at += 1
    if (
        at + 1 < len(errors)
        and best[at] > EXPLAINS_LITTLE * base[at]
        and _left(base, best, at) > _left(base, best, -1)
    ):
        return len(errors) - 1
    return at


def _left(base, best, at) -> float:
    """Return the share of the baseline's error beyond noise that the best leaves; 1 where hardly any is."""
    noise = best[0] ** 2
    there = base[at] ** 2 - noise
    return math.sqrt(max(best[at] ** 2 - noise, 0.0) / there) if there > STRUCTURE_LEAST * noise else 1.0
