"""Screening: every effect fitted coarsely over short segments, or on accelerations, or over long segments."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from ...simulate.parallel import side_by_side
from ..estimation.fit import FitResult
from ..estimation.segmented import CandidateFit, SegmentedData
from ..estimation.thresholds import RESTARTS_KEPT
from ..fits.fit_effects import fit_effects
from ..fits.thresholds import EFFORT_MOVED
from ..starting.screen import Screen
from ..thresholds import BY_CHANCE, GROWTH
from .equivalence import restarted_from_better, told_by_held_out, with_level_sought
from .evidence import promising, ranked
from .reference import Reference, refitted_from
from .thresholds import (
    CONFIRMED,
    EXPLAINS_LITTLE,
    EXPLAINS_LONG,
    LEFT,
    RIVAL_BASE_STEPS,
    RIVAL_STEPS,
    SHOWS_HARDLY,
)

_Screened = tuple[Reference, FitResult, list[CandidateFit]]


@dataclass(frozen=True, eq=False)
class Screening:
    """How every effect is screened.

    Attributes
    ----------
    classes : sequence of effect classes
    free : tuple of str
        Parameters of the model that are refitted.
    nominal : mapping
        Values of the model as the user has them.
    disturbs : callable
        ``disturbs(error, data)``: whether an error over the shortest segments is one that disturbance forces
        make.
    forced : bool
        Whether such forces act as in the search before: then accelerations are asked first.
    executor : concurrent.futures.Executor or None
    """

    classes: list
    free: tuple[str, ...]
    nominal: dict[str, float]
    disturbs: Callable[[float, SegmentedData], bool]
    forced: bool = False
    executor: object = None

    def run(self, at: Reference, report: Callable, stage: Callable) -> tuple[Reference, list[CandidateFit]]:
        """Return the reference of the search and every effect that can be added, fitted, best evidence first.

        Parameters
        ----------
        at : Reference
            With which the search starts.
        report : callable
            ``report(at, found)`` receives intermediate results.
        stage : callable
            Receives the name of every stage.
        """
        at, base, found = self._screened(at, report, stage)
        if at.leaves_only_noise and at.base.train.rmse <= GROWTH * base.rmse:
            return at, found
        # noise is alike in all segments: where one errs by more it acts rarely
        at = replace(at, leaves_only_noise=False)
        longest = at.segmentations[-1]
        there = base if at.data.disturbed else longest.reached(base)
        if there.rmse > GROWTH * (base.rmse if at.data.disturbed else min(base.rmse, at.nearest.rmse)):
            # Short segments show nothing, long ones do: what is missing acts rarely, or slowly.
            stage("screening repeated over long segments")
            far = replace(at, base=CandidateFit("", there))
            moved, enough = _over_long_segments(far, base.rmse, found)
            if enough:
                # A minimum that long segments lead to may be one of short ones that these did not lead to.
                found = _best_of(base, [*found, *_moved_to(at.data.sampled, enough)])
            elif moved or not found:
                # Over long segments what is missing biases the parameters; short ones give them right.
                again = self._fitted_over(far, longest, there, longest.as_it_is(base), None)
                found = _best_of(there, [*moved, *again])
                report(far, found)
            # further comparisons are over these segments
            back = CandidateFit("", at.data.moved(there))
            at = replace(at, base=min(at.base, back, key=lambda t: t.train.rmse))
        return (at.rebased(found, self.free) if found else at), found

    def _screened(self, at: Reference, report: Callable, stage: Callable) -> _Screened:
        """Return reference, model and effects, over outputs or, where disturbance forces act, accelerations.

        Effects that follow the outputs from where accelerations lead show that no such forces act: it was a
        wrong minimum of the first fit that erred like these.
        """
        again = None
        if self.forced:
            stage(f"{len(self.classes)} effects screened on accelerations, as before")
            forced, again = self._by_accelerations(at, report)
            if forced is not None:
                return forced
        stage(f"{len(self.classes)} effects screened over short segments")
        base, found = self._sampled(at, lambda screened: report(at, screened))
        report(at, found)
        if again is None and self._disturbed(at, found):
            stage("screening repeated on accelerations: disturbance forces outweigh the noise")
            forced, again = self._by_accelerations(at, report)
            if forced is not None:
                return forced
        return at, base, _best_of(base, [*found, *again]) if again else found

    def _by_accelerations(
        self, at: Reference, report: Callable
    ) -> tuple[_Screened | None, list[CandidateFit]]:
        """Return what is found on accelerations, and the best of it fitted to outputs.

        None in place of the first where one of these follows the outputs.
        """
        forced = at.by_accelerations(self.free)
        moving, found = self._sampled(forced)
        again = _by_outputs(at, found)
        if not self._disturbed(at, again):
            return None, again
        report(forced, found)
        return (forced, moving, found), again

    def rivals(self, at: Reference, model, names) -> list[CandidateFit]:
        """Return effects that may replace the last one of a model, with evidence over it.

        Each is begun as on any model, and from values with which it acts as the one that it replaces.
        """
        data = at.data.sampled
        known = data.fit(model, names, iterations=RIVAL_STEPS, followed=RESTARTS_KEPT)
        about = data.moved(at.base.train, RIVAL_BASE_STEPS)
        found = self._fit_effects(at, data, about, self._short(at, data), reached=known.rmse)
        more = data.count(model, names) - data.count(at.base.block, self.free)
        before = CandidateFit("", known)
        _, *found = restarted_from_better([before, *found], data, about.model, 1)
        return _decided(before, ranked(before, [replace(t, extra=t.extra - more) for t in found])[0], data)

    def _sampled(self, at: Reference, screened=None) -> tuple[FitResult, list[CandidateFit]]:
        """Return the model and every effect fitted over every second of the segments for validation."""
        data = at.data.sampled
        base = data.moved(at.base.train, RIVAL_BASE_STEPS)
        found = self._fitted_over(at, data, base, base, self._short(at, data), screened)
        # these segments may lack what bends the model in all of them: a stop that is seldom reached
        base = refitted_from(found, base, data, self.free)
        return base, ranked(CandidateFit("", base), found)[0]

    def _fitted_over(
        self,
        at: Reference,
        data: SegmentedData,
        base: FitResult,
        about: FitResult,
        short: SegmentedData | None,
        screened=None,
    ) -> list[CandidateFit]:
        """Fit every effect over one set of segments; return them with evidence over `base`, best first.

        `about`: the model about which start values are sought; `short`, `screened`: see `fit_effects`.
        """
        before = CandidateFit("", base)
        fitted = with_level_sought(self._fit_effects(at, data, about, short, screened), data)
        found = _decided(before, ranked(before, fitted)[0], data)
        return ranked(before, restarted_from_better(found, data, about.model))[0]

    def _fit_effects(
        self,
        at: Reference,
        data: SegmentedData,
        about: FitResult,
        short: SegmentedData | None,
        screened=None,
        reached: float = math.inf,
    ) -> list[CandidateFit]:
        if not self.classes:
            return []
        screen = Screen(about, data)
        nominal = {k: self.nominal[k] for k in self.free if k in screen.block.parameters}
        return fit_effects(
            self.classes, screen, short, self.free, nominal, self.executor, screened, reached,
            small=at.leaves_only_noise,
        )  # fmt: skip

    @staticmethod
    def _short(at: Reference, data: SegmentedData) -> SegmentedData:
        """Return the segments in which fits of effects with many minima begin: short ones, or `data`."""
        # where short ones show noise alone (its rms, within chance) no minimum is right
        most = (1 + BY_CHANCE / math.sqrt(2 * at.nearest.count)) * at.data.noise
        shows = at.nearest.rmse > most or at.data.disturbed
        return at.segmentations[0].sampled if shows else data

    def _disturbed(self, at: Reference, found) -> bool:
        """Whether disturbance forces act that no effect explains.

        The baseline then errs over the shortest segments by far more than the sensor's noise, and so does the
        best candidate; an effect that is missing would take most of that away.
        """
        least, shortest = at.nearest.rmse, at.segmentations[0]
        if not self.disturbs(least, at.data):
            return False
        best = sorted(found, key=lambda t: t.train.rmse)[:2]
        moved = side_by_side(lambda t: shortest.moved(t.train, give_up=least), best)
        return all(self.disturbs(f.rmse, at.data) and f.rmse > LEFT * least for f in moved)


def _decided(base: CandidateFit, found: Sequence[CandidateFit], data: SegmentedData) -> list[CandidateFit]:
    """Let held-out data decide between fits of one effect that err alike, of every effect to be confirmed.

    No other fit is used: an effect that is not confirmed is neither named nor has it a probability, and the
    evidence of fits that are not told apart differs by less than what does that (`DISTINGUISHED`).
    """
    while open_ones := [t for t in promising(found) if t.beside]:
        told = side_by_side(lambda t: told_by_held_out(t, data), open_ones)
        known = {t.key: t for t in told}
        found = ranked(base, [known.get(t.key, t) for t in found])[0]
    return list(found)


def _by_outputs(at: Reference, found: Sequence[CandidateFit]) -> list[CandidateFit]:
    """Return the first candidates fitted to outputs from the values that accelerations give them."""
    data = at.data.sampled
    return side_by_side(lambda t: t.with_fit(data.fit(t.block, t.train.names)), found[:2])


def _over_long_segments(at: Reference, here: float, found) -> tuple[list[CandidateFit], list[CandidateFit]]:
    """Return the best by error moved to the longest segments, and those that explain enough there.

    Neither where short segments show the best clearly. `here`: error of the baseline where the trials were
    fitted; that of `at` is over the longest segments.
    """
    if found and found[0].train.rmse <= EXPLAINS_LITTLE * here:
        return [], []
    best = sorted(found, key=lambda t: t.train.rmse)[:CONFIRMED]
    moved = _moved_to(at.segmentations[-1], best)
    shows = found and found[0].train.rmse <= SHOWS_HARDLY * here
    return moved, [t for t in moved if shows and t.train.rmse <= EXPLAINS_LONG * at.base.train.rmse]


def _moved_to(data: SegmentedData, found) -> list[CandidateFit]:
    """Return effects fitted over other segments, from where they are."""
    return side_by_side(lambda t: t.with_fit(data.moved(t.train, *EFFORT_MOVED)), found)


def _best_of(base: FitResult, trials) -> list[CandidateFit]:
    """Return every effect's best fit, best first."""
    best: dict[str, CandidateFit] = {}
    for t in trials:
        if t.key not in best or t.train.rmse < best[t.key].train.rmse:
            best[t.key] = t
    return ranked(CandidateFit("", base), best.values())[0]
