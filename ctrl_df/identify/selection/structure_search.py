"""The search over records: the baseline, every candidate fitted, the best confirmed at the full rate."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from ..estimation.fit import FitResult, in_null_directions
from ..estimation.refit_records import indistinguishable_parameters, undetermined
from ..estimation.segmented import CandidateFit, SegmentedData, prepare
from ..estimation.thresholds import RESTARTS_KEPT
from ..fits.attempts import own_names
from ..fits.compared import indistinguishable
from ..monitor import Monitor
from ..prediction.segments import facts
from ..prediction.sensed import POSITION, place_unit, sensed
from ..results.explain import explains_nothing, far_off, grows, runs_ahead
from ..shooting.known_fits import KnownFits
from ..starting.dead_times import lead
from ..starting.pairs import pairs, singles
from ..starting.screen import Screen
from ..starting.thresholds import PAIRS
from ..thresholds import GIVE_UP, GROWTH, ONLY_NOISE, PROCESS_NOISE, SIGNIFICANT
from .confirmation import confirmed, stages
from .equivalence import acts_as, breaks_away_only, matching_along
from .evidence import ranked, step_as_recorded
from .named import beyond_range, refitted, whole_refit
from .reference import Reference, input_steps, reference_of
from .remaining import located, remainder
from .screening import Screening
from .search import Remainder, Search, Words
from .thresholds import (
    EFFORT_CONFIRMED,
    LEFT_BY_ANSWER,
    NO_ERROR,
    RIVAL_BASE_STEPS,
    SIGNIFICANT_HELD,
    SIZE_KNOWN,
)


class StructureSearch(Search):
    """The fits of one diagnosis over time.

    Parameters
    ----------
    block : Mechanism
        The model as it stands.
    records, validation : sequences of Measurement
        To fit; to validate on (may be empty).
    free : tuple of str
        Parameters of the model that may be refitted.
    prior : mapping or None
        Value and standard deviation of parameters known beforehand, by name.
    known : KnownFits or None
        Fits made before for the same question.

    Attributes
    ----------
    at : Reference
        What models are compared with.
    divided : tuple of Measurement
        The records of which parts are held out; none where others are.
    forced : bool
        Whether disturbance forces act according to the search that this one follows.
    """

    significant = SIGNIFICANT
    significant_validation = SIGNIFICANT_HELD
    at: Reference
    forced = False

    def __init__(self, block, records, validation, free, prior=None, known: KnownFits | None = None):
        self.block, self.free, self.prior = block, tuple(free), prior
        self.divided = () if validation else tuple(records)
        self.at = self._reference(prepare(block, records, validation, prior, known=known))

    def _reference(self, data: SegmentedData) -> Reference:
        at = reference_of(self.block, self.segmentations(data), self.free)
        if (step := input_steps(at)) < data.decimation:
            data = replace(data, decimation=step)
            at = reference_of(self.block, self.segmentations(data), self.free)
        return at

    def following(self, before):
        """Return this search, which asks accelerations first where the one before has ended with them."""
        return self.after(forced=before.at.data.disturbed)

    def divided_otherwise(self):
        """Return the search with the parts held out next to those that are now; None: whole records are."""
        if not self.divided:
            return None
        data = prepare(self.block, self.divided, prior=self.prior, out=1, known=self.at.data.known)
        return self.after(at=self._reference(data))

    @property
    def base(self):
        """The model refitted."""
        return self.at.base

    def segmentations(self, data: SegmentedData) -> list[SegmentedData]:
        """Return the data in segments of three lengths, the shortest first."""
        return data.segmentations

    def disturbs(self, error: float, data: SegmentedData) -> bool:
        """Whether an error over the shortest segments is one that disturbance forces make."""
        return error > PROCESS_NOISE * data.noise and not data.noise_free

    @property
    def _still_forced(self) -> bool:
        """Whether disturbance forces act as in the search before."""
        return self.forced and self.disturbs(self.at.nearest.rmse, self.at.data)

    def stages(self, at: Reference, fits):
        """Return fits in segments of every length for validation, and the least error that they can reach."""
        return stages(at, fits)

    @property
    def records(self):
        """The records to fit, and those held out; none where parts of the former are."""
        data = self.at.data
        return data.train.records, () if data.parts_held_out else data.validation.records

    @property
    def placed(self) -> bool:
        """Whether a sensor measures the position."""
        return all(POSITION in sensed(r).columns for r in self.at.data.train.records)

    def applies(self, effect) -> bool:
        """Whether an effect (a class) can show in these records: those of sensors act on the position."""
        return self.placed or effect.role != "output"

    @property
    def measure(self) -> str:
        """What errors are of: the output, or its acceleration where disturbance forces outweigh the noise."""
        return "acceleration" if self.at.data.disturbed else "output"

    @property
    def words(self) -> Words:
        """The words of a verdict: errors that forces of the machine's own make are no noise of a sensor."""
        noise, of = "the noise of these data", ""
        if self.at.data.disturbed:
            noise = self.block.coordinates.text(
                "far beyond the noise of the sensor, but acts like forces that vary of themselves"
            )
            of = " of the acceleration"
        return Words("data", noise, of, "an input", " It shows as {}.")

    # --- the steps ------------------------------------------------------------------------------------

    def candidates(self, classes, executor=None, monitor=None):
        """Return every effect that can be added, fitted over short segments or those that they need."""
        monitor = monitor or Monitor()
        telling = [] if self._still_forced else self._noise_over(self.base)
        at = replace(self.at, leaves_only_noise=bool(telling), segmentations=telling or self.at.segmentations)
        at, found = self._screening(classes, executor).run(at, partial(self._report, monitor), monitor.stage)
        return self.after(at=at, screened=found), found

    def lengths(self):
        """Return this search over the two shorter lengths of segments, or the one that both are.

        Over short ones the shape of single events tells, over longer ones what acts slowly.
        """
        differ = {sum(map(len, data.train.segments)): data for data in self.at.segmentations[:2]}
        return [self.after(at=replace(self.at, data=data)) for data in differ.values()]

    def pairs(self, classes):
        """Return models with two effects more that promise most, over segments of the two longer lengths."""
        at, found = self.at, []
        classes = [c for c in classes if self.applies(c)]
        for data in at.segmentations[1:]:
            screen = Screen(data.moved(at.base.train, RIVAL_BASE_STEPS), data)
            found += [(pair.block, pair.left) for pair in pairs(classes, screen, PAIRS)]
        return sorted(found, key=lambda f: f[1])

    def singles(self, candidate, classes):
        """Return models with one effect more than one fitted here, over the same segments.

        Those are left out whose linear estimate, for white noise, is no significant evidence.
        """
        classes = [c for c in classes if self.applies(c)]
        screen = Screen(candidate.train, self.at.data)
        most = math.exp(-2 * self.significant / len(screen.residual))
        return [(s.block, s.left) for s in singles(classes, screen) if s.left < most]

    def based_on(self, block, fitted, free):
        """Return a search over the same data for what another model misses, fitted here."""
        near = self.at.segmentations[0].moved(fitted.train)
        at = replace(self.at, base=replace(fitted, key="", extra=0), nearest=near, leaves_only_noise=False)
        return self.after(block=block, free=tuple(free), at=at)

    def rivals(self, model, names, classes, executor=None):
        """Return effects that may replace the last one of a model, with evidence over it."""
        return self._screening(classes, executor).rivals(self.at, model, names)

    def confirm(self, found, monitor=None, clear=math.inf):
        """Refit baseline and best candidates at the full rate."""
        monitor = monitor or Monitor()
        at, chosen = confirmed(self.at, found, self.stages, partial(self._report, monitor), monitor.stage)
        monitor.stage("refit of the candidates that may be named")
        at, chosen = refitted(at, chosen, self.significant, self._whole_refit, clear)
        return self.after(at=at), chosen

    def in_full(self):
        """Return the model refitted over segments as long as it can predict."""
        found = self._whole_refit(self.at, self.base)
        return None if found is self.base else found.block

    def _whole_refit(self, at: Reference, tried: CandidateFit, seen: bool = False) -> CandidateFit:
        return whole_refit(at, tried, self.prior, seen or bool(self.records[1]))

    def _screening(self, classes, executor) -> Screening:
        nominal = {k: p.value for k, p in self.block.parameters.items()}
        classes = [c for c in classes if self.applies(c)]
        return Screening(classes, self.free, nominal, self.disturbs, self._still_forced, executor)

    def _report(self, monitor: Monitor, at: Reference, found) -> None:
        monitor.known((self.after(at=at), found))

    def equivalent(self, a: CandidateFit, b: CandidateFit) -> bool:
        """Whether two candidates are equivalent on these data, within noise or as a limit of each other."""
        if all(breaks_away_only(t, self.at.data.scales.speed) for t in (a, b)):
            return True
        if self.alike(a, b):
            return True
        better, other = sorted((a, b), key=lambda t: t.size)
        return acts_as(other, better, self.at.data.fine, self.at.base.block, self.at.noise)

    def alike(self, a, b):
        """Whether the outputs of two models agree within noise."""
        return indistinguishable(a.outputs, b.outputs, self.at.noise)

    def acting_as(self, effect, other):
        """Return an effect with the values with which it acts as another one along the motion; or None."""
        return matching_along(self.at.data, self.at.base.block)(effect, other)

    # --- results --------------------------------------------------------------------------------------

    def errors(self, candidate):
        """Return nrmse over the segments fitted, and over those held out."""
        return (
            candidate.train.nrmse,
            candidate.validation.nrmse if candidate.validation is not None else math.nan,
        )

    def standard_errors(self, candidate):
        """Return the standard errors of a fit that came to its end."""
        return candidate.train.standard_errors if len(candidate.train.covariance) else {}

    def takes_only_noise(self, candidate):
        """Whether all that a candidate takes of the error may be noise that its initial states absorb."""
        base, tried = self.at.base.train, candidate.train
        if base.sensitivity is None or tried.sensitivity is None:
            return True
        noise = self.at.noise_model(ranked(self.at.base, ())[1])
        share = tried.sensitivity.left_by_starts(noise) / base.sensitivity.left_by_starts(noise)
        return tried.rmse >= math.sqrt(share) * base.rmse / GROWTH

    def undetermined(self, candidate):
        """Return the parameters of the newest effect at a bound, or known to worse than their size."""
        fit = candidate.train
        if not candidate.confirmed or not len(fit.covariance):
            return ()
        # a bound that the records prove, where a body has been, determines the parameter
        proved = {
            f"{candidate.block.newest}.{k}"
            for k in candidate.block.effects[-1].bounds(self.at.data.record_scales)
        }
        doubtful = (fit.names_at_bound - proved) | undetermined(fit)
        # a static level is found by trying, as single samples pass it: it has no sensitivity
        table, errors, values = candidate.block.parameters, fit.standard_errors, fit.parameters
        own = [k for k in own_names(candidate.block) if not table[k].threshold]
        # the size of an effect, its first parameter, is measured by itself
        size = set(own_names(candidate.block)[:1]).intersection(own)
        doubtful |= {k for k in size if k in values and errors[k] > SIZE_KNOWN * abs(values[k])}
        if len(fit.null) <= len(self.at.base.train.null):
            # the model has these directions without the effect, too: sizes are known but for its scale
            doubtful -= in_null_directions(fit)
        # whatever its size, it is reversed
        doubtful -= {k for k in own if table[k].one_sign and values.get(k, 1.0) < 0}
        # of a stop that is hit at one end its place is known: the sum of its limit and its center
        for _, parts in fit.null:
            together = {name for name, _, _ in parts}
            if together <= set(own) and len(together) > len({table[k].unit for k in together}) == 1:
                doubtful -= together
        return tuple(k.rpartition(".")[2] for k in own if k in doubtful)

    def displaced(self, candidate):
        """Return the model's parameters at a bound with the newest effect that are within without it.

        Parameters within two standard errors of what the model states are left out.
        """
        stated, errors = self.block.parameters, self.standard_errors(candidate)
        fit, values = candidate.train, candidate.train.parameters
        moved = (fit.names_at_bound - self.at.base.train.names_at_bound) & stated.keys()
        far = (k for k in moved if SIZE_KNOWN * abs(values[k] - stated[k].value) > errors.get(k, math.inf))
        return tuple(sorted(far))

    def open_directions(self, candidate):
        """Return a sentence for every direction of a fit's parameters that leaves its output as it is."""
        return indistinguishable_parameters(candidate.train)

    def record_faults(self):
        """Return a sentence where the motion runs ahead of the force."""
        ahead = lead(self.at.data, self.at.base.block)
        return (self.block.coordinates.text(runs_ahead(ahead)),) if ahead else ()

    def predicted(self, candidate):
        """Return the model and the records held out (angles as these have them), or those fitted."""
        fitted, held_out = self.records
        if held_out and candidate.validation is not None:
            return candidate.validation.model, held_out
        return candidate.block, held_out or fitted

    def so_far(self, candidate):
        """Return the noise of the sensor, and what a model errs by beyond it."""
        noise, error = self.at.data.noise, candidate.train.rmse
        if self.at.data.disturbed:
            return Remainder(0.0, error, False)
        return Remainder(min(noise, error), math.sqrt(max(error**2 - noise**2, 0.0)), False)

    def leaves_only_noise(self, candidate):
        """Whether a model fitted here leaves only noise, as a diagnosis of it would say over any length."""
        return bool(self._noise_over(candidate))

    def _noise_over(self, candidate) -> Sequence[SegmentedData]:
        """Return the segmentations, if a model fitted here leaves only noise over all of them; else none.

        Without those over which its motion runs apart: they tell nothing of it.
        """
        data, levels = self.at.data, self.at.segmentations
        shortest, *_, longest = levels
        near = self.at.nearest if candidate is self.base else shortest.moved(candidate.train)
        at = replace(self.at, nearest=near, least=near, floor=ONLY_NOISE * near.rmse)
        if data.noise_free or data.lacks_more(near.rmse) or at.grew(near, candidate.train, data):
            return []
        if longest is data:
            return levels if self.after(at=at)._noise_alone_over((data, candidate.train)) else []
        # what acts slowly shows over long segments alone, fitted or held out
        far = longest.reached(candidate.train)
        both = (longest, far), (data, candidate.train)
        if not at.grew(near, far, longest) and self.after(at=at)._noise_alone_over(*both):
            return levels
        if not at.runs_apart(near, candidate.train, far, longest):
            return []
        shorter = [d for d in levels if d is not longest]
        # three all the same, as everywhere: the longest that tell something again
        shorter += (len(levels) - len(shorter)) * shorter[-1:]
        return self.after(at=replace(self.at, segmentations=shorter))._noise_over(candidate)

    def _noise_alone_over(self, *fits: tuple[SegmentedData, FitResult]) -> bool:
        """Whether fits of a model over some segments leave only noise at the full rate."""
        there = [self._at_full_rate(*f) for f in fits]
        # forces that are missing last: they take most of the time
        return all(t._noise_alone([]) for t in there) and all(t._noise_alone() for t in there)

    def _at_full_rate(self, data: SegmentedData, fit: FitResult):
        """Return this search over some segments at the full rate, from the model's fit there."""
        fine = data.fine
        base = fine.validate(replace(self.base, train=fine.moved(fit, *EFFORT_CONFIRMED)))
        return self.after(at=replace(self.at, data=data, base=base, noise=ranked(base, ())[1]))

    def _noise_alone(self, missed: list | None = None) -> bool:
        """Whether the model leaves only noise, beside forces that are known to be missing (None: sought)."""
        left = self._left(self.base, missed)
        return not (left.unexplained or left.uncertain)

    def as_recorded(self, candidate):
        """Return the resolution of the records, where a candidate adds just that; else nothing."""
        fitted, held_out = self.records
        step = step_as_recorded(candidate, (*fitted, *held_out))
        return f", whose values are rounded to {step:.3g} {place_unit(fitted[0])}" if step else ""

    def exact(self):
        """Whether the model errs by rounding alone."""
        return self.at.base.train.nrmse < NO_ERROR and not self.at.data.disturbed

    def remainder(self, best, significant):
        """Return what the best model leaves."""
        left = self._left(best)
        if left.more and not left.unexplained and best is not self.at.base:
            # the held-out error of a refit to whole records is that of the fit before it, with other values
            left = replace(left, more=self._left(self.at.data.fine.validate(best), left.about).more)
        if not significant and self.at.unmoved(self.significant):
            return left.doubted(explains_nothing(), unexplained=True)
        if far := beyond_range(self.at, best, self._whole_refit):
            other, names = far
            return left.doubted(far_off(other, names, self.block), unexplained=True)
        if self.at.grown_over is not None:
            return self._growing(left, best) if significant else self._growing(left)
        if not left.unexplained and self.as_recorded(best):
            return replace(left, noise=self.at.base.train.rmse, structure=0.0)
        return left

    def _left(self, tried: CandidateFit, missed: list | None = None) -> Remainder:
        """Return what a model leaves, by the noise of its residual, or by that of the best if it is another.

        `missed`: forces that it misses, where they are known.
        """
        noise = ranked(tried, ())[1] if tried is self.at.base else self.at.noise
        return remainder(
            self.at.base, tried, self.at.data.fine, noise, self.at.noise_model(noise),
            self.at.by_noise(tried.train, noise), self.significant, missed,
        )  # fmt: skip

    def _growing(self, left: Remainder, best: CandidateFit | None = None) -> Remainder:
        """Return what is left by a model whose error grows with the length of segments.

        `best`: what explains something beside it; None: nothing does. What grows with that as well is not
        all that is missing, though it is part of it.
        """
        assert self.at.grown_over is not None
        near, (far, longer) = self.at.nearest, self.at.grown_over
        without = far.rmse
        if best is not None:
            # at the full rate: what steps of the input hide beside all that is missing, they may not hide now
            shortest, longer = self.at.segmentations[0].fine, longer.fine
            near, far = shortest.moved(best.train), longer.reached(best.train)
            if not self.at.grew(near, far, longer):
                return left
        seconds = max(
            float(np.max(w.stop - w.first)) * facts(r).dt
            for r, w in zip(self.at.data.train.records, far.segments, strict=True)
        )
        error = math.sqrt(far.rmse**2 - near.rmse**2)
        if best is not None:
            doubt = grows(near.nrmse, far.nrmse, seconds, best.block.effects[-1])
            return left.doubted(doubt, more=left.more or error > LEFT_BY_ANSWER * without)
        doubt = grows(near.nrmse, far.nrmse, seconds)
        return left.doubted(doubt, structure=max(left.structure, error), unexplained=True)

    def located(self, best, remainder, unknown):
        """Return where the error is."""
        return located(
            self.at.base, best, self.at.data.fine, self.at.noise, remainder, unknown=unknown,
            significant=self.significant, measure=self.measure,
        )  # fmt: skip

    def fitted(self, block, names, iterations, near=None):
        """Return a block with these parameters fitted, and run over the segments held out."""
        found = self.at.data.fit(block, names, iterations=iterations, followed=RESTARTS_KEPT)
        key = block.newest if block.effects else ""
        tried = CandidateFit(key, found, extra=self.at.data.count(block, names))
        return self.at.data.validate(tried, math.inf if near is None else GIVE_UP * near.validation.rmse)

    def begun(self, block, names, iterations):
        """Return a block with these parameters fitted from measured initial states, not validated."""
        found = self.at.data.fit(block, names, iterations=iterations)
        key = block.newest if block.effects else ""
        return CandidateFit(key, found, extra=self.at.data.count(block, names))

    def ranked(self, base, candidates):
        """Return models with their evidence over `base`, best first."""
        return ranked(base, candidates)[0]

    def final(self, models, free):
        """Return the models with their errors at the full rate, over the segments that suit the last one."""
        return [self.at.data.fine.evaluated(self.sharpened(m, free)) for m in models]

    def sharpened(self, model, free):
        """Return a model, where disturbance forces blur parameters with those that short segments show."""
        data = self.at.data.fine
        if not data.disturbed or data.continues(model):
            return model
        return data.short_segments.fit(model, free(model)).model

    def relative(self, noise):
        """Return noise over the rms of the centred output, or of the acceleration."""
        return noise * self.at.base.train.nrmse / self.at.base.train.rmse
