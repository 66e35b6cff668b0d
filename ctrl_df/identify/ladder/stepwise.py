"""The ladder: stepwise selection of effects, then a local search among the neighbours of its last model.

In each step the effect that explains most is added (forward selection), and all earlier ones are examined
again with it in the model (backward elimination). Where nothing more is found, every model that differs by
one effect is tried; a better one, or one as good with fewer parameters, is where the ladder continues. No
structure is visited twice, so that it ends.

Where something remains that no effect explains, an effect added early may have stood in for several: the
ladder then branches off again from the next best candidates of each step, and the better end counts.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

from ...blocks.effect import Effect
from ...cached import cached_property
from ...numerals import percent
from ..monitor import COMPLETE, UNDER_WAY, Monitor
from ..results.diagnosis import AMBIGUOUS, NONE, UNKNOWN, CandidateEffect, Diagnosis, rivals
from ..results.explain import named
from ..results.ladder import Step, Study, last_diagnosis, outcome
from ..results.neighbours import ADD, Neighbour, Neighbours
from ..selection.long_prediction import LongPrediction, long_prediction
from ..selection.search import Search, TooFewData
from ..selection.thresholds import CONFIRMED, REFUTED_MOST, SHOWS_HARDLY, STOPPED_EARLY
from ..selection.verdict import Diagnosed, diagnosed, is_significant
from ..thresholds import FLOOR
from .neighbours import Alternatives, Neighbourhood
from .revision import Revision, revised
from .several_at_once import several_at_once
from .structure import Structure, plainness
from .thresholds import BRANCHES, STEPS_COMPARED, STEPS_NEIGHBOUR


@dataclass(frozen=True, eq=False)
class Node:
    """A model that the ladder has visited, with its diagnosis.

    Attributes
    ----------
    structure : Structure
        Refitted.
    search : Search
    diagnosis : Diagnosis
    steps : tuple of Step
        The steps that led to it, with errors over the data on which it is validated; the last one is its own.
    parent : Node or None
        The node that it was reached from.
    refused : str
        Id of the best candidate where it was not added; empty where it may be.
    set_aside : tuple of CandidateEffect
        What the search was repeated without, as it is provisional.
    """

    structure: Structure
    search: Search
    diagnosis: Diagnosis
    steps: tuple[Step, ...]
    parent: Node | None = None
    refused: str = ""
    set_aside: tuple[CandidateEffect, ...] = ()

    @property
    def next(self) -> CandidateEffect | None:
        """The effect to be added; None where there is none."""
        ranking = self.diagnosis.ranking
        if self.refused or not ranking or self.diagnosis.verdict == NONE:
            return None
        long = self._long_prediction
        if long is not None and long.better:  # the best of them, or nothing where that is the model without
            return next((c for c in ranking if c.id == long.better[0]), None)
        return plainest(ranking) if is_significant(ranking[0], self.search) else None

    @cached_property
    def _long_prediction(self) -> LongPrediction | None:
        """How the first candidate predicts over long horizons, compared with others and the model without it.

        While several effects are missing, one whose hidden states are re-estimated in every segment may stand
        in for all of them there, and predict nothing beyond. What predicts held-out data best need not be
        best in short segments: where something remains unexplained it needs no evidence there.
        """
        least = -math.inf if self.unexplained else self.search.significant
        return long_prediction(self.diagnosis.ranking, self.diagnosis.baseline, least)

    @property
    def unexplained(self) -> bool:
        """Whether something remains that a model fitted to these data could explain."""
        return self.diagnosis.verdict == UNKNOWN and not self.diagnosis.held_out_only

    @property
    def incomplete(self) -> bool:
        """Whether something is missing that no single effect explains: also where none may be added."""
        return self.unexplained or (self.diagnosis.verdict == AMBIGUOUS and self.next is None)

    @property
    def path(self) -> list[Node]:
        """The nodes from the first to this one."""
        return [*(self.parent.path if self.parent else ()), self]

    def refusing(self, effect: str, doubt: str) -> Node:
        """Return the same node with its best candidate not added, and the reason."""
        found = replace(
            self.diagnosis,
            verdict=UNKNOWN,
            doubts=(*self.diagnosis.doubts, doubt),
            explanation=doubt,
        )
        steps = (*self.steps[:-1], replace(self.steps[-1], diagnosis=found))
        return replace(self, diagnosis=found, steps=steps, refused=effect)


def _key(node: Node, effect: CandidateEffect) -> tuple[str, ...]:
    """Return the key of the structure of a node with a candidate added."""
    return node.structure.plus(effect.model).key


def plainest(ranking) -> CandidateEffect:
    """Return the simplest of the candidates that the data hardly distinguish from the first."""
    first, near = ranking[0], rivals(ranking)
    same = [c for c in near if c.id in first.equivalents]
    fewer = [c for c in near if plainness(c.effect)[0] < plainness(first.effect)[0]]
    return min([first, *same, *fewer], key=lambda c: plainness(c.effect))


class StepwiseSelection:
    """The search for the effects of a model: forward, backward, among neighbours, and along other branches.

    Parameters
    ----------
    dataset : Dataset
    start : Mechanism
    classes : sequence of effect classes
        Candidates; what is found does not depend on their order.
    free : callable
        Parameters of a block that may be refitted.
    max_effects : int
        Most effects added.
    executor : concurrent.futures.Executor or None
    monitor : Monitor
        Receives the `Study` as it stands.
    """

    def __init__(self, dataset, start, classes, free: Callable, max_effects: int, executor, monitor: Monitor):
        self.dataset, self.free, self.executor, self.monitor = dataset, free, executor, monitor
        self.classes = sorted(dict.fromkeys(classes), key=lambda c: c.id)
        self.max_effects = max_effects
        self.start = Structure(start, len(start.effects))
        self.visited: dict[tuple[str, ...], Node] = {}
        self.leapt: set[tuple[str, ...]] = set()  # keys of nodes left with several effects
        self.alternatives: dict[tuple[tuple[str, ...], int], Alternatives] = {}

    def run(self) -> Study:
        """Return the end of the ladder and its neighbours."""
        end, neighbourhood = self._local_best(self._search_from(self.start, None))
        refused: set[tuple[str, ...]] = set()
        while end.incomplete and len(refused) < BRANCHES:
            untried = next(self._untried(end, refused), None)
            if untried is None:
                break
            best = self._study(end.steps, end.search, UNDER_WAY, neighbourhood)
            other = self._branch(end, *untried, best)
            if other is None:
                refused.add(_key(*untried))
            else:
                end, neighbourhood = self._local_best(self._forward(other))
        steps = self._refitted_in_full(end)
        neighbourhood = replace(neighbourhood, nrmse=steps[-1].nrmse, nrmse_holdout=steps[-1].nrmse_holdout)
        return self._study(steps, end.search, COMPLETE, neighbourhood)

    def _refitted_in_full(self, end: Node) -> tuple[Step, ...]:
        """Return the steps to an end, the last with the parameters of a refit to the whole records.

        Where parts of the records are held out, that refit has seen them: the held-out error is then that of
        the last fit that has not.
        """
        *steps, last = end.steps
        self.monitor.stage("the parameters of the last model")
        refitted = end.search.in_full()
        again = None if refitted is None else end.search.final([refitted], self.free)
        if again is None:
            return end.steps
        ((model, error, held_out),) = again
        held_out = held_out if self.dataset.validation else last.nrmse_holdout
        return (
            *steps,
            replace(last, model=model, nrmse=error, nrmse_holdout=held_out, parameters=_values(model)),
        )

    # --- forward, with backward elimination -------------------------------------------------------------

    def _search_from(self, structure: Structure, parent: Node | None, how: dict | None = None) -> Node:
        """Return the node at which selection from a structure ends."""
        return self._forward(self._visit(structure, parent, how or {}))

    def _forward(self, node: Node) -> Node:
        """Add effects until nothing more is found; return the last node."""
        while (best := node.next) is not None or node.incomplete:
            ahead = self._with_several(node, best)
            if ahead is not None:
                node = ahead
                continue
            if best is None:
                break
            step = _step(node.diagnosis, best.model, (best.nrmse, best.nrmse_holdout), _addition(best))
            self._publish((*node.steps, step), node.search)
            self.monitor.stage("earlier effects examined again")
            revision = self._revised(node, best, self._in_place_at(node))
            if revision.structure.key in self.visited:
                break
            how = _addition(best) | {"dropped": revision.dropped, "instead": revision.instead}
            try:
                ahead = self._visit(revision.structure, node, how, step)
            except TooFewData as too_few:
                node = node.refusing(best.id, f"{named(best).capitalize()} was not added: {too_few}")
                self.visited[node.structure.key] = node
                break
            gain, held_out = self._compared(_extended_model(ahead), node.structure.block, ahead.search)
            # a step that dropped or replaced others does not need the evidence of an additional effect
            least = node.search.significant * (-1 if revision.dropped or revision.instead else 1)
            if gain < least or held_out[0] > FLOOR * held_out[1]:
                node = node.refusing(best.id, _refusal(best, held_out))
                self.visited[node.structure.key] = node
                break
            node = ahead
        return node

    def _with_several(self, node: Node, best: CandidateEffect | None) -> Node | None:
        """Return the node of several effects at once, where two explain more than the best one, and hold.

        Beside a second effect that is missing the best candidate may stand in for both, and the right ones be
        far behind it; or none is significant alone.
        """
        search, at = node.search, node.structure
        room = self.max_effects - len(at.added)
        if room < 2:
            return None
        self.monitor.stage("several effects at once")
        found, one, alone = node.diagnosis, at.block, 1.0
        if best is not None:
            one, alone = best.model, best.nrmse / found.nrmse
        several = several_at_once(at, found.ranking, one, alone, search, self.free, self.classes, room)
        if several is None:
            return None
        revision = revised(several.structure, search, self.free, lambda *_: ())
        new = {t.block.effects[-1].id for t in several.fits}
        if revision.structure.key in self.visited or new & set(revision.dropped):
            return None
        *begun, step = (_step_to(node.diagnosis, t, search) for t in several.fits)
        begun = [replace(s, diagnosis=None) for s in begun]
        self._publish((*node.steps, *begun, step), search)
        how = {"effect": step.effect, "evidence": step.evidence}
        how |= {"dropped": revision.dropped, "instead": revision.instead}
        try:
            ahead = self._visit(revision.structure, node, how, step, between=tuple(begun))
        except TooFewData:
            return None
        if not self._beats(_extended_model(ahead), at.block, ahead.search):
            return None
        self.leapt.add(at.key)
        return ahead

    def _visit(
        self,
        structure: Structure,
        parent: Node | None,
        how: dict,
        step: Step | None = None,
        best: Study | None = None,
        between: tuple[Step, ...] = (),
    ) -> Node:
        """Refit a structure and diagnose what it misses.

        `step`: reported until that is known; `best`: reported meanwhile in its place, where a better model is
        known; `between`: steps that lead to it from the parent.
        """
        steps = (*(parent.steps if parent else ()), *between)
        self.monitor.stage(f"step {len(steps)}: the model refitted")
        search = self.dataset.search(structure.block, self.free(structure.block))
        if parent is not None:
            search = search.following(parent.search)
        last = step or (steps[-1] if steps else None)

        def step_of(found: Diagnosis) -> Step:
            errors = found.nrmse, found.nrmse_holdout
            if last is not None and not math.isfinite(errors[1]):  # not tried on what is held out yet
                errors = last.nrmse, last.nrmse_holdout
            return _step(found, found.model, errors, how)

        def so_far(known: Diagnosed) -> Study:
            return best or self._study((*steps, step_of(known.diagnosis)), known.search, UNDER_WAY)

        room = len(structure.added) < self.max_effects

        def searched(without: frozenset[str] = frozenset(), set_aside=()) -> tuple[Node, frozenset[str]]:
            classes = [c for c in self.classes if c.id not in without] if room else []
            part = self.monitor.within(so_far)
            known = diagnosed(search, classes, self.executor, part, clear=STOPPED_EARLY)
            found = known.diagnosis
            at = structure.at(found.model)
            node = Node(at, known.search, found, (*steps, step_of(found)), parent, set_aside=set_aside)
            return node, without.union(known.refuted)

        node = self._firmly(searched)
        self.monitor.stage("all models over the same data")
        node = replace(node, steps=self._on_common_data(node.steps, node.search))
        self.visited[structure.key] = node
        return node

    def _firmly(self, searched: Callable[..., tuple[Node, frozenset[str]]]) -> Node:
        """Return a node whose next effect is of a size that the data determine, where one explains anything.

        Hidden states and a parameter of the model at its bound may stand in for several effects at once: a
        joint against a motor mass too large to move is a spring and a damper, of no size of its own. Such a
        candidate errs so much less than any single one of them that these are given up, and no later step
        leads back. The search is therefore repeated without it, and takes smaller steps; it remains an
        alternative.

        `searched`: ``searched(without, set_aside)``, the node as a search without these ids finds it, and all
        ids that another search can do without.
        """
        node, without = searched()
        first, aside = node, ()
        while (best := node.next) is not None and best.size_undetermined:
            if len(aside) == REFUTED_MOST:
                return first
            aside = (*aside, best)
            self.monitor.stage(f"the search repeated without {best.id.replace('_', ' ')}: provisional")
            node, without = searched(without | {best.id}, aside)
        return first if node.next is None else node

    def _on_common_data(self, steps: tuple[Step, ...], search: Search) -> tuple[Step, ...]:
        """Return steps with the errors of their models over the data on which the last one is validated."""
        again = search.final([s.model for s in steps], self.free)
        if again is None:
            return steps
        return tuple(
            replace(s, model=m, nrmse=e, nrmse_holdout=h, parameters=_values(m))
            for s, (m, e, h) in zip(steps, again, strict=True)
        )

    def _revised(self, node: Node, effect: CandidateEffect, in_place: Callable | None = None) -> Revision:
        """Return the structure with an effect added and the earlier ones examined again.

        `in_place`: see `revised`; None: rivals of their own steps alone.
        """
        others = [c.effect for c in node.diagnosis.ranking if c is not effect and c.confirmed]
        structure = node.structure.plus(effect.model, others)
        return revised(structure, node.search, self.free, in_place or (lambda *_: ()))

    def _in_place_at(self, node: Node) -> Callable[[Structure, int, Any], list]:
        """Return what finds models with another effect in the place of one, over the data of a node."""

        def in_place(structure: Structure, place: int, less) -> list:
            self.monitor.stage(f"exchanges of {structure.added[place].id.replace('_', ' ')}")
            found = self._alternatives(structure, place, node.search, less)
            return [t.block for t in found.candidates]

        return in_place

    # --- local search -----------------------------------------------------------------------------------

    def _local_best(self, end: Node) -> tuple[Node, Neighbours]:
        """Move to better neighbours until there are none; return the last node and its neighbours."""
        refound: set[tuple[str, ...]] = set()
        for _ in range(self.max_effects):
            neighbourhood, table = self._neighbourhood(end)
            better = neighbourhood.better(self.visited, end.structure.key not in refound)
            if better is None:
                return end, table
            structure, how = better
            if structure.key == end.structure.key:
                refound.add(structure.key)
            end = self._search_from(structure, end, _exchange(how))
        return end, self._neighbourhood(end)[1]

    def _neighbourhood(self, end: Node) -> tuple[Neighbourhood, Neighbours]:
        """Fit every neighbour of a model in which nothing more was found."""
        self._publish(end.steps, end.search)
        self.monitor.stage("every effect left out in turn")
        neighbourhood = Neighbourhood(end.structure, end.search, self.free)
        neighbourhood.add(end.diagnosis, end.refused)
        neighbourhood.drop_each()
        if end.incomplete and len(end.structure.added) < self.max_effects:
            neighbourhood.add_restarted(self._effects_on_path(end))
        errors, left = end.search.errors(neighbourhood.own), {node.structure.key for node in end.path[:-1]}
        for place in reversed(range(len(end.structure.added))):
            so_far = Neighbours(neighbourhood.rows(left), *errors, complete=False)
            self._publish(end.steps, end.search, so_far)
            self.monitor.stage(f"exchanges of {end.structure.added[place].id.replace('_', ' ')}")
            neighbourhood.exchange(place, self._alternatives(end.structure, place, end.search))
        neighbourhood.merge()
        table = Neighbours(neighbourhood.rows(left), *errors)
        self._publish(end.steps, end.search, table)
        return neighbourhood, table

    def _alternatives(self, structure: Structure, place: int, search: Search, less=None) -> Alternatives:
        """Return the candidates in the place of an effect, those of the step that added it or new ones.

        `search`: of the model without the last effect, or of the model; `less`: the model without the effect
        of that place as fitted there, where it is known.
        """
        without, old = structure.without(place), structure.added[place]
        node = self.visited.get(without.key)
        if node is not None and node.diagnosis.ranking:
            return _alternatives_at(node, old)
        key = (tuple(e.id for e in structure.added), place)
        if key not in self.alternatives:
            names = self.free(without.block)
            less = less or search.fitted(without.block, names, STEPS_NEIGHBOUR)
            other, model = search.based_on(without.block, less, names), structure.block
            found = other.rivals(model, self.free(model), self.classes, self.executor)
            self.alternatives[key] = Alternatives(without, found, other.errors)
        return self.alternatives[key]

    def _effects_on_path(self, end: Node) -> list[Effect]:
        """Return effects that left less error at an earlier step, with the values of the last such one."""
        found: dict[str, Effect] = {}
        for node in reversed(end.path[:-1]):
            ranking = sorted(node.diagnosis.ranking, key=lambda c: c.nrmse)
            for c in ranking:
                if c.confirmed and c.nrmse < node.diagnosis.nrmse:
                    found.setdefault(c.id, c.effect)
        return list(found.values())[:CONFIRMED]

    # --- other branches ---------------------------------------------------------------------------------

    def _untried(self, end: Node, refused: set[tuple[str, ...]]) -> Iterator[tuple[Node, CandidateEffect]]:
        """Yield candidates not followed on a path: the best of every step before the second of any.

        `refused`: keys of structures that are left out, as are those visited.
        Within a step they are in order of error: where several effects are missing none need stand out alone.
        """
        found = []
        for node in end.path:
            followed = None if node.structure.key in self.leapt else node.next
            named = {followed.id, *followed.equivalents} if followed is not None else set()
            ranking = sorted((c for c in node.diagnosis.ranking if c.confirmed), key=lambda c: c.nrmse)
            ranking += node.set_aside
            rank = 0
            for c in ranking:
                if c.id in named or not c.nrmse < SHOWS_HARDLY * node.diagnosis.nrmse:
                    continue
                named |= {c.id, *c.equivalents}
                found.append(((rank, c.nrmse / node.diagnosis.nrmse, _key(node, c)), node, c))
                rank += 1
        for (_, _, key), node, c in sorted(found, key=lambda f: f[0]):
            if key not in self.visited and key not in refused:
                yield node, c

    def _branch(self, end: Node, node: Node, effect: CandidateEffect, best: Study) -> Node | None:
        """Visit the model with a rival of an earlier step; return it if it, or its best extension, is better.

        `best`: reported meanwhile.
        """
        structure = self._revised(node, effect).structure
        if structure.key in self.visited:
            return None
        gone, new = [e.id for e in end.structure.added], [e.id for e in structure.added]
        how = {
            "dropped": tuple(e for e in gone if e not in new),
            "instead": tuple(e for e in new if e not in gone),
            "evidence": effect.evidence - max(node.diagnosis.ranking[0].evidence, 0.0),
        }
        try:
            other = self._visit(structure, end, how, best=best)
        except TooFewData:
            return None
        return other if self._beats(_extended_model(other), end.structure.block, other.search) else None

    def _beats(self, block, end, search: Search) -> bool:
        """Whether a model is better than another on the data of a search, and no worse on those held out."""
        evidence, held_out = self._compared(block, end, search)
        return evidence > search.significant and not held_out[0] > FLOOR * held_out[1]

    def _compared(self, block, other, search: Search) -> tuple[float, tuple[float, float]]:
        """Return the evidence for a model over another on the data of a search, and both errors held out."""
        old, new = (search.fitted(b, self.free(b), STEPS_COMPARED) for b in (other, block))
        ranked = search.ranked_over(old, [new])[0]
        return ranked.evidence, (search.errors(new)[1], search.errors(old)[1])

    # --- reporting --------------------------------------------------------------------------------------

    def _publish(self, steps, search: Search, neighbours: Neighbours | None = None) -> None:
        self.monitor.known(self._study(steps, search, UNDER_WAY, neighbours))

    def _study(self, steps, search: Search, status: str, neighbours: Neighbours | None = None) -> Study:
        return Study(
            tuple(steps), steps[-1].model, outcome(steps), search.relative(last_diagnosis(steps).noise),
            self.start.block, self.dataset.records, self.dataset.validation, self.monitor.seconds, status,
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


def _step_to(found: Diagnosis, tried, search: Search) -> Step:
    """Return the step to a model fitted in a search; `found`: the diagnosis that led to it."""
    how = {"effect": tried.block.effects[-1].id, "evidence": tried.evidence}
    return _step(found, tried.block, search.errors(tried), how)


def _values(model) -> dict[str, float]:
    return {k: p.value for k, p in model.parameters.items()}


def _extended_model(node: Node):
    """Return the model of a node with its best candidate: over long segments one may need the other."""
    return node.structure.block if node.next is None else node.next.model


def _refusal(effect: CandidateEffect, held_out: tuple[float, float]) -> str:
    """Return why an effect was not added; `held_out`: errors on held-out data, with it and without."""
    return (
        f"{named(effect).capitalize()} was not added: it improves the model on the segments on which the "
        f"previous model was validated, but not on those chosen for the model with it (held-out error "
        f"{percent(held_out[0])} with it, {percent(held_out[1])} without)."
    )


def _addition(effect: CandidateEffect) -> dict:
    return {"effect": effect.id, "evidence": effect.evidence, "equivalents": effect.equivalents}


def _exchange(n: Neighbour) -> dict:
    if n.dropped == (n.added,):  # the same in a better minimum
        return {"evidence": n.evidence}
    if n.change == ADD:
        return {"effect": n.added, "evidence": n.evidence}
    return {"dropped": n.dropped, "instead": (n.added,) if n.added else (), "evidence": n.evidence}


def _alternatives_at(node: Node, old) -> Alternatives:
    """Return the diagnosis of a node as the candidates in the place of an effect that was then added."""
    first = {t.key: t.evidence for t in node.search.screened}
    own = next(
        (c for c in node.diagnosis.ranking if c.confirmed and c.id == old.id), node.diagnosis.ranking[0]
    )
    entries = []
    for c in (*node.set_aside, *node.diagnosis.ranking):
        # those confirmed are validated on other segments than those screened
        ahead = c.evidence - own.evidence if c.confirmed else first[c.id] - max(first.get(old.id, 0.0), 0.0)
        entries.append(_Entry(c.model, ahead, (c.nrmse, c.nrmse_holdout), c.confirmed))
    entries.sort(key=lambda e: (not e.confirmed, -e.evidence))
    return Alternatives(node.structure, entries, lambda e: e.errors)


@dataclass(frozen=True, eq=False)
class _Entry:
    block: Any
    evidence: float
    errors: tuple[float, float]
    confirmed: bool
