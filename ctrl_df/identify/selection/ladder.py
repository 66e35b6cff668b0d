"""The ladder: effects added one at a time, looked at again, taken back; at its end all neighbours.

From rung to rung the effect that explains most is added, and all those before it are looked at again beside
it. Where nothing more is found, every model one exchange away is tried; a better one, or one as good and
plainer, is where the ladder goes on. No structure is visited twice, so that it ends.

Where something remains that no effect explains, an effect taken early may have stood in for several: the
ladder then begins again from what came next at its own step, and the better end counts.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import islice
from typing import Any

from ..results.diagnosis import NONE, UNKNOWN, CandidateEffect, Diagnosis, rivals
from ..results.ladder import Step
from ..results.neighbours import Neighbour, Neighbours
from ..thresholds import BRANCHES, CONFIRMED
from .neighbours import Around, Look
from .revision import Revision, revised
from .search import Search
from .structure import Structure, plainness
from .verdict import verdict_of, worth


@dataclass(frozen=True, eq=False)
class Rung:
    """A model of the ladder and what was asked of it.

    Attributes
    ----------
    structure : Structure
        Refitted.
    search : Search
    trials : list
        Every effect besides, roughly fitted.
    found : Diagnosis
    steps : tuple of Step
        How it was come to; the last one is its own.
    """

    structure: Structure
    search: Search
    trials: list
    found: Diagnosis
    steps: tuple[Step, ...]

    @property
    def next(self) -> CandidateEffect | None:
        """The effect to be added; None where there is none."""
        if (
            not self.found.ranking
            or self.found.verdict == NONE
            or not worth(self.found.ranking[0], self.search)
        ):
            return None
        return plainest(self.found.ranking)


def plainest(ranking) -> CandidateEffect:
    """Return the plainest of the candidates that the data hardly tell from the first."""
    first = ranking[0]
    same = [c for c in rivals(ranking) if c.id in first.equivalents]
    fewer = [c for c in rivals(ranking) if plainness(c.effect)[0] < plainness(first.effect)[0]]
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
    known : callable
        Takes the steps and the neighbours as far as they are known.
    """

    def __init__(self, dataset, start, classes, free: Callable, max_effects: int, executor=None, known=None):
        self.dataset, self.free, self.executor = dataset, free, executor
        self.classes = sorted(dict.fromkeys(classes), key=lambda c: c.id)
        self.max_effects = max_effects
        self.known = known or (lambda steps, neighbours: None)
        self.start = Structure(start, len(start.effects))
        self.rungs: dict[tuple[str, ...], Rung] = {}
        self.looks: dict[tuple[str, ...], Look] = {}

    def run(self) -> tuple[Rung, Neighbours]:
        """Return the end of the ladder and its neighbours."""
        end, around = self._settled(self._up(self.start, ()))
        for rung, effect in islice(self._rivals(end), BRANCHES):
            if end.found.verdict != UNKNOWN:
                break
            other = self._again(end, rung, effect)
            if other is not None:
                end, around = self._settled(other)
        return end, around

    # --- up -------------------------------------------------------------------------------------------

    def _up(self, structure: Structure, steps, how: dict | None = None, rungs: float = math.inf) -> Rung:
        """Climb from a structure until nothing more is found, or so many rungs."""
        return self._on(self._rung(structure, steps, how or {}), rungs)

    def _on(self, rung: Rung, rungs: float = math.inf) -> Rung:
        while rung.next is not None and rungs > 0:
            revision = self._added(rung, rung.next)
            if revision.structure.key in self.rungs:
                break
            rung, rungs = self._rung(revision.structure, rung.steps, _told(rung.next, revision)), rungs - 1
        return rung

    def _rung(self, structure: Structure, steps, how: dict) -> Rung:
        """Ask of a structure what it misses."""
        asked, room = time.perf_counter(), len(structure.added) < self.max_effects
        search = self.dataset.search(structure.block, self.free(structure.block))
        trials = search.candidates(self.classes, self.executor) if room else []
        found = verdict_of(search, trials, asked)
        values = {k: p.value for k, p in found.model.parameters.items()}
        step = Step(
            model=found.model, nrmse=found.nrmse, nrmse_holdout=found.nrmse_holdout, parameters=values,
            diagnosis=found, **how,
        )  # fmt: skip
        rung = Rung(structure.at(found.model), search, trials, found, (*steps, step))
        self.rungs[structure.key] = rung
        self.known(rung.steps, None)
        return rung

    def _added(self, rung: Rung, effect: CandidateEffect) -> Revision:
        others = [c.effect for c in rung.found.ranking if c is not effect and c.confirmed]
        others = others[:CONFIRMED]
        return revised(rung.structure.plus(effect.model, others), rung.search, self.free)

    # --- about ----------------------------------------------------------------------------------------

    def _settled(self, end: Rung) -> tuple[Rung, Neighbours]:
        """Go on to better neighbours until there are none."""
        moves = 0
        while True:
            around = Around(end.structure, end.search, self.free)
            around.drop_each()
            for place in reversed(range(len(end.structure.added))):
                around.exchange(place, self._look(end, place))
            around.merge()
            around.add(end.found.ranking)
            table = Neighbours(around.rows(), *end.search.errors(around.own))
            self.known(end.steps, table)
            better = around.better(self.rungs)
            if better is None or moves == self.max_effects:
                return end, table
            structure, neighbour = better
            end = self._up(structure, end.steps, _exchanged(neighbour))
            moves += 1

    def _look(self, end: Rung, place: int) -> Look:
        """Return what was tried in the place of an effect: when it was added, or now."""
        less, old = end.structure.without(place), end.structure.added[place]
        rung = self.rungs.get(less.key)
        if rung is not None:
            return _looked(rung, old)
        search = self.dataset.search(less.block, self.free(less.block))
        trials = search.rivals(
            end.structure.block, self.free(end.structure.block), self.classes, self.executor
        )
        return Look(less, trials, search.errors)

    # --- again from below -----------------------------------------------------------------------------

    def _again(self, end: Rung, rung: Rung, effect: CandidateEffect) -> Rung | None:
        """Climb from a rival of an earlier step; return where that ends if it is better."""
        structure = self._added(rung, effect).structure
        if structure.key in self.rungs:
            return None
        gone, new = [e.id for e in end.structure.added], [e.id for e in structure.added]
        how = {
            "effect": "", "dropped": tuple(e for e in gone if e not in new),
            "instead": tuple(e for e in new if e not in gone),
            "evidence": effect.evidence - rung.found.ranking[0].evidence,
        }  # fmt: skip
        # one effect more has to show that it leads anywhere
        other = self._up(structure, end.steps, how, 1)
        return self._on(other) if self._beats(other, end) else None

    def _rivals(self, end: Rung) -> Iterator[tuple[Rung, CandidateEffect]]:
        """Yield rivals of steps of the way to the end that were not followed, the nearest first."""
        found = []
        for rung in self.rungs.values():
            if not any(rung.steps[-1] is s for s in end.steps):
                continue
            for c in rung.found.ranking[1:]:
                if c.confirmed and worth(c, rung.search):
                    found.append((c.evidence / rung.found.ranking[0].evidence, rung, c))
        for _, rung, c in sorted(found, key=lambda f: -f[0]):
            yield rung, c

    def _beats(self, other: Rung, end: Rung) -> bool:
        """Whether another end does better, on the data that judged it."""
        fits = [other.search.fitted(r.structure.block, self.free(r.structure.block), 6) for r in (end, other)]
        fits = [replace(t, extra=t.extra - fits[0].extra) for t in fits]
        judged = other.search.ranked(fits[0], [fits[1]])[0]
        return judged.evidence > other.search.significant


def _looked(rung: Rung, old) -> Look:
    """Return what was asked of a structure as a look at what may stand for an effect that was then added."""
    first = {t.key: t.evidence for t in rung.trials}
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


def _told(effect: CandidateEffect, revision: Revision) -> dict:
    return {
        "effect": effect.id, "dropped": revision.dropped, "instead": revision.instead,
        "evidence": effect.evidence, "equivalents": effect.equivalents,
    }  # fmt: skip


def _exchanged(n: Neighbour) -> dict:
    return {
        "effect": "", "dropped": n.dropped, "instead": (n.added,) if n.added else (), "evidence": n.evidence,
    }  # fmt: skip
