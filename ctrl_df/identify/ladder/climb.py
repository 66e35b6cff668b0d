"""The ladder: effects added one at a time, looked at again, taken back; at its end all neighbours.

From rung to rung the effect that explains most is added, and all those before it are looked at again beside
it. Where nothing more is found, every model that differs by one effect is tried; a better one, or one as good
and plainer, is where the ladder goes on. No structure is visited twice, so that it ends.

Where something remains that no effect explains, an effect taken early may have stood in for several: the
ladder then begins again from what came next at its own step, and the better end counts.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import islice
from typing import Any

from ...blocks.effect import Effect
from ...cached import cached_property
from ...numerals import percent
from ..course import COMPLETE, UNDER_WAY, Course
from ..results.diagnosis import NONE, UNKNOWN, CandidateEffect, Diagnosis, rivals
from ..results.ladder import Step, Study, last_diagnosis, outcome
from ..results.neighbours import ADD, Neighbour, Neighbours
from ..selection.long_prediction import LongPrediction, long_prediction
from ..selection.search import Search
from ..selection.thresholds import CONFIRMED, SHOWS_HARDLY
from ..selection.verdict import Diagnosed, diagnosed, worth
from ..thresholds import FLOOR
from .neighbours import Around, Look
from .revision import Revision, revised
from .structure import Structure, plainness
from .thresholds import BRANCHES, STEPS_COMPARED


@dataclass(frozen=True, eq=False)
class Rung:
    """A model of the ladder and what was asked of it.

    Attributes
    ----------
    structure : Structure
        Refitted.
    search : Search
    found : Diagnosis
    steps : tuple of Step
        How it was come to, errors over the data that judge it; the last one is its own.
    before : Rung or None
        From which it was come to.
    refused : str
        Id of an effect that was to be added next, and is not.
    """

    structure: Structure
    search: Search
    found: Diagnosis
    steps: tuple[Step, ...]
    before: Rung | None = None
    refused: str = ""

    @property
    def next(self) -> CandidateEffect | None:
        """The effect to be added; None where there is none."""
        ranking = self.found.ranking
        if self.refused or not ranking or self.found.verdict == NONE:
            return None
        long = self._long
        if long is not None and long.better:  # the best of them, or nothing where that is the model without
            return next((c for c in ranking if c.id == long.better[0]), None)
        return plainest(ranking) if worth(ranking[0], self.search) else None

    @cached_property
    def _long(self) -> LongPrediction | None:
        """How the first candidate does over long stretches, beside others and the model without it.

        While several effects are missing, one whose hidden states are fitted anew in every segment may stand
        in for all of them there, and follow nothing beyond. What is ahead in free prediction of data held out
        need not be so in short segments: where something remains unexplained it needs no evidence there.
        """
        least = -math.inf if self.found.verdict == UNKNOWN else self.search.significant
        return long_prediction(self.found.ranking, self.found.baseline, least)

    @property
    def way(self) -> list[Rung]:
        """The rungs that led to it, itself the last."""
        return [*(self.before.way if self.before else ()), self]

    def refusing(self, effect: str, doubt: str) -> Rung:
        """Return the same where what was to be added next is not, and why."""
        remains = f"{self.found.remains} {doubt}" if self.found.remains else ""
        found = replace(
            self.found,
            verdict=UNKNOWN,
            doubts=(*self.found.doubts, doubt),
            explanation=doubt,
            remains=remains,
        )
        steps = (*self.steps[:-1], replace(self.steps[-1], diagnosis=found))
        return replace(self, found=found, steps=steps, refused=effect)


def plainest(ranking) -> CandidateEffect:
    """Return the plainest of the candidates that the data hardly tell from the first."""
    first, near = ranking[0], rivals(ranking)
    same = [c for c in near if c.id in first.equivalents]
    fewer = [c for c in near if plainness(c.effect)[0] < plainness(first.effect)[0]]
    return min([first, *same, *fewer], key=lambda c: plainness(c.effect))


class Climb:
    """The way up, and back where it was wrong.

    Parameters
    ----------
    dataset : Dataset
    start : Mechanism
    classes : sequence of effect classes
        To be tried; what is found does not depend on their order.
    free : callable
        Parameters of a block that may be refitted.
    max_effects : int
        Most effects added.
    executor : concurrent.futures.Executor or None
    course : Course
        Hears of the `Study` as it stands.
    """

    def __init__(self, dataset, start, classes, free: Callable, max_effects: int, executor, course: Course):
        self.dataset, self.free, self.executor, self.course = dataset, free, executor, course
        self.classes = sorted(dict.fromkeys(classes), key=lambda c: c.id)
        self.max_effects = max_effects
        self.start = Structure(start, len(start.effects))
        self.rungs: dict[tuple[str, ...], Rung] = {}

    def to_the_end(self) -> Study:
        """Return the end of the ladder and its neighbours."""
        end, around = self._settled(self._up(self.start, None))
        for rung, effect in islice(self._rivals(end), BRANCHES):
            if end.found.verdict != UNKNOWN:
                break
            other = self._again(end, rung, effect, self._study(end.steps, end.search, UNDER_WAY, around))
            if other is not None:
                end, around = self._settled(self._on(other))
        steps = self._in_full(end)
        around = replace(around, nrmse=steps[-1].nrmse, nrmse_holdout=steps[-1].nrmse_holdout)
        return self._study(steps, end.search, COMPLETE, around)

    def _in_full(self, end: Rung) -> tuple[Step, ...]:
        """Return the steps to an end, the last with the parameters that a whole refit finds.

        Where parts of the records are held out that fit has seen them: what is told of them is of the last
        one that has not.
        """
        *steps, last = end.steps
        self.course.stage("the parameters of the last model")
        refitted = end.search.in_full()
        again = None if refitted is None else end.search.final([refitted], self.free)
        if again is None:
            return end.steps
        ((model, error, held),) = again
        held = held if self.dataset.validation else last.nrmse_holdout
        return (
            *steps,
            replace(last, model=model, nrmse=error, nrmse_holdout=held, parameters=_values(model)),
        )

    # --- up -------------------------------------------------------------------------------------------

    def _up(self, structure: Structure, before: Rung | None, how: dict | None = None) -> Rung:
        """Climb from a structure until nothing more is found."""
        return self._on(self._rung(structure, before, how or {}))

    def _on(self, rung: Rung) -> Rung:
        while (best := rung.next) is not None:
            step = _step(rung.found, best.model, (best.nrmse, best.nrmse_holdout), _added(best))
            self._known((*rung.steps, step), rung.search)
            self.course.stage("earlier effects looked at again")
            revision = self._beside(rung, best)
            if revision.structure.key in self.rungs:
                break
            how = _added(best) | {"dropped": revision.dropped, "instead": revision.instead}
            ahead = self._rung(revision.structure, rung, how, step)
            gain, held = self._compared(_reached(ahead), rung.structure.block, ahead.search)
            # what has dropped or replaced others does not need the evidence of an effect more
            least = rung.search.significant * (-1 if revision.dropped or revision.instead else 1)
            if gain < least or held[0] > FLOOR * held[1]:
                rung = rung.refusing(best.id, _refused(best, held))
                self.rungs[rung.structure.key] = rung
                break
            rung = ahead
        return rung

    def _rung(
        self,
        structure: Structure,
        before: Rung | None,
        how: dict,
        step: Step | None = None,
        best: Study | None = None,
    ) -> Rung:
        """Ask of a structure what it misses.

        `step`: what is told of it until that is known; `best`: what is known of a better one meanwhile.
        """
        steps = before.steps if before else ()
        self.course.stage(f"step {len(steps)}: the model refitted")
        search = self.dataset.search(structure.block, self.free(structure.block))
        last = step or (steps[-1] if steps else None)

        def told(found: Diagnosis) -> Step:
            errors = found.nrmse, found.nrmse_holdout
            if last is not None and not math.isfinite(errors[1]):  # not tried on what is held out yet
                errors = last.nrmse, last.nrmse_holdout
            return _step(found, found.model, errors, how)

        def so_far(known: Diagnosed) -> Study:
            return best or self._study((*steps, told(known.diagnosis)), known.search, UNDER_WAY)

        room = len(structure.added) < self.max_effects
        known = diagnosed(search, self.classes if room else [], self.executor, self.course.within(so_far))
        found = known.diagnosis
        self.course.stage("all models over the same data")
        steps = self._judged((*steps, told(found)), known.search)
        rung = Rung(structure.at(found.model), known.search, found, steps, before)
        self.rungs[structure.key] = rung
        return rung

    def _judged(self, steps: tuple[Step, ...], search: Search) -> tuple[Step, ...]:
        """Return steps with the errors of their models over the data that judge the last one."""
        again = search.final([s.model for s in steps], self.free)
        if again is None:
            return steps
        return tuple(
            replace(s, model=m, nrmse=e, nrmse_holdout=h, parameters=_values(m))
            for s, (m, e, h) in zip(steps, again, strict=True)
        )

    def _beside(self, rung: Rung, effect: CandidateEffect) -> Revision:
        """Add an effect, and look again at those before it."""
        others = [c.effect for c in rung.found.ranking if c is not effect and c.confirmed]
        return revised(rung.structure.plus(effect.model, others), rung.search, self.free)

    # --- about ----------------------------------------------------------------------------------------

    def _settled(self, end: Rung) -> tuple[Rung, Neighbours]:
        """Go on to better neighbours until there are none."""
        refound: set[tuple[str, ...]] = set()
        for _ in range(self.max_effects):
            around, table = self._around(end)
            better = around.better(self.rungs, end.structure.key not in refound)
            if better is None:
                return end, table
            structure, how = better
            if structure.key == end.structure.key:
                refound.add(structure.key)
            end = self._up(structure, end, _exchanged(how))
        return end, self._around(end)[1]

    def _around(self, end: Rung) -> tuple[Around, Neighbours]:
        """Look at every neighbour of a model in which nothing more was found."""
        self._known(end.steps, end.search)
        self.course.stage("every effect left out in turn")
        around = Around(end.structure, end.search, self.free)
        around.add(end.found, end.refused)
        around.drop_each()
        if end.found.verdict == UNKNOWN and len(end.structure.added) < self.max_effects:
            around.add_again(self._seen(end))
        errors = end.search.errors(around.own)
        for place in reversed(range(len(end.structure.added))):
            self._known(end.steps, end.search, Neighbours(around.rows(), *errors, complete=False))
            self.course.stage(f"others in place of {end.structure.added[place].id.replace('_', ' ')}")
            around.exchange(place, self._look(end, place))
        around.merge()
        table = Neighbours(around.rows(), *errors)
        self._known(end.steps, end.search, table)
        return around, table

    def _look(self, end: Rung, place: int) -> Look:
        """Return what was tried in the place of an effect: when it was added, or now."""
        less, old = end.structure.without(place), end.structure.added[place]
        rung = self.rungs.get(less.key)
        if rung is not None and rung.found.ranking:
            return _looked(rung, old)
        search = self.dataset.search(less.block, self.free(less.block))
        model = end.structure.block
        return Look(less, search.rivals(model, self.free(model), self.classes, self.executor), search.errors)

    def _seen(self, end: Rung) -> list[Effect]:
        """Return effects that left less error at an earlier step, with the values of the last such one."""
        found: dict[str, Effect] = {}
        for rung in reversed(end.way[:-1]):
            ranking = sorted(rung.found.ranking, key=lambda c: c.nrmse)
            for c in ranking:
                if c.confirmed and c.nrmse < rung.found.nrmse:
                    found.setdefault(c.id, c.effect)
        return list(found.values())[:CONFIRMED]

    # --- again from below -----------------------------------------------------------------------------

    def _rivals(self, end: Rung) -> Iterator[tuple[Rung, CandidateEffect]]:
        """Yield what was not followed on the way to an end, the first of every step before the second of any.

        Within a step by the error left: of several effects that are missing none need show by itself.
        """
        found = []
        for rung in end.way:
            followed = rung.next
            named = {followed.id, *followed.equivalents} if followed is not None else set()
            ranking = sorted((c for c in rung.found.ranking if c.confirmed), key=lambda c: c.nrmse)
            rank = 0
            for c in ranking:
                if c.id in named or not c.nrmse < SHOWS_HARDLY * rung.found.nrmse:
                    continue
                named |= {c.id, *c.equivalents}
                key = rung.structure.plus(c.model).key
                found.append(((rank, c.nrmse / rung.found.nrmse, key), rung, c))
                rank += 1
        for (_, _, key), rung, c in sorted(found, key=lambda f: f[0]):
            if key not in self.rungs:
                yield rung, c

    def _again(self, end: Rung, rung: Rung, effect: CandidateEffect, best: Study) -> Rung | None:
        """Ask of the model with a rival of an earlier step; return it if it, or what follows, is better.

        `best`: what is known meanwhile.
        """
        structure = self._beside(rung, effect).structure
        if structure.key in self.rungs:
            return None
        gone, new = [e.id for e in end.structure.added], [e.id for e in structure.added]
        how = {
            "dropped": tuple(e for e in gone if e not in new),
            "instead": tuple(e for e in new if e not in gone),
            "evidence": effect.evidence - max(rung.found.ranking[0].evidence, 0.0),
        }
        other = self._rung(structure, end, how, best=best)
        return other if self._beats(_reached(other), end.structure.block, other.search) else None

    def _beats(self, block, end, search: Search) -> bool:
        """Whether a model does better than another on the data of a search, held out too."""
        evidence, held = self._compared(block, end, search)
        return evidence > search.significant and not held[0] > FLOOR * held[1]

    def _compared(self, block, other, search: Search) -> tuple[float, tuple[float, float]]:
        """Return the evidence for a model over another on the data of a search, and both errors held out."""
        old, new = (search.fitted(b, self.free(b), STEPS_COMPARED) for b in (other, block))
        judged = search.ranked_over(old, [new])[0]
        return judged.evidence, (search.errors(new)[1], search.errors(old)[1])

    # --- what is known --------------------------------------------------------------------------------

    def _known(self, steps, search: Search, neighbours: Neighbours | None = None) -> None:
        self.course.known(self._study(steps, search, UNDER_WAY, neighbours))

    def _study(self, steps, search: Search, status: str, neighbours: Neighbours | None = None) -> Study:
        return Study(
            tuple(steps), steps[-1].model, outcome(steps), search.relative(last_diagnosis(steps).noise),
            self.start.block, self.dataset.records, self.dataset.validation, self.course.seconds, status,
            neighbours or Neighbours(complete=False),
        )  # fmt: skip


def _step(found: Diagnosis, model, errors, how: dict) -> Step:
    return Step(
        model=model,
        nrmse=errors[0],
        nrmse_holdout=errors[1],
        parameters=_values(model),
        diagnosis=found,
        **how,
    )


def _values(model) -> dict[str, float]:
    return {k: p.value for k, p in model.parameters.items()}


def _reached(rung: Rung):
    """Return the model of a rung with what is to be added next: over long segments one may need the other."""
    return rung.structure.block if rung.next is None else rung.next.model


def _refused(effect: CandidateEffect, held: tuple[float, float]) -> str:
    """Return why an effect was not added; `held`: errors held out with it and what follows, and without."""
    name = effect.id.replace("_", " ")
    return (
        f"{name.capitalize()} did better on the data that judged the model without it, but not on those that "
        f"judge the model with it: held out that errs by {percent(held[0])}, the model without it by "
        f"{percent(held[1])}. It was not added."
    )


def _added(effect: CandidateEffect) -> dict:
    return {"effect": effect.id, "evidence": effect.evidence, "equivalents": effect.equivalents}


def _exchanged(n: Neighbour) -> dict:
    if n.dropped == (n.added,):  # the same in a better minimum
        return {"evidence": n.evidence}
    if n.change == ADD:
        return {"effect": n.added, "evidence": n.evidence}
    return {"dropped": n.dropped, "instead": (n.added,) if n.added else (), "evidence": n.evidence}


def _looked(rung: Rung, old) -> Look:
    """Return what was asked of a structure as a look at what may stand for an effect that was then added."""
    first = {t.key: t.evidence for t in rung.search.first_look}
    own = next((c for c in rung.found.ranking if c.confirmed and c.id == old.id), rung.found.ranking[0])
    entries = []
    for c in rung.found.ranking:
        # those confirmed are judged by other segments than at the first look
        ahead = c.evidence - own.evidence if c.confirmed else first[c.id] - max(first.get(old.id, 0.0), 0.0)
        entries.append(_Entry(c.model, ahead, (c.nrmse, c.nrmse_holdout), c.confirmed))
    entries.sort(key=lambda e: (not e.confirmed, -e.evidence))
    return Look(rung.structure, entries, lambda e: e.errors)


@dataclass(frozen=True, eq=False)
class _Entry:
    block: Any
    evidence: float
    errors: tuple[float, float]
    confirmed: bool
