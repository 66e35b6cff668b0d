"""The ladder: stepwise selection of effects, then a local search among the neighbours of its last model.

In each step the effect that explains most is added (forward selection), and all earlier ones are examined
again with it in the model (backward elimination). Where nothing more is found, every model that differs by
one effect is tried; a better one, or one as good with fewer parameters, is where the ladder continues. No
structure is visited twice, so that it ends.

Where something remains that no effect explains, an effect added early may have stood in for several: the
ladder then branches off again from the next best candidates of each step, and the better end counts.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import replace

from ...blocks.effect import Effect
from ..monitor import COMPLETE, UNDER_WAY
from ..results.diagnosis import CandidateEffect
from ..results.ladder import Step, Study
from ..results.neighbours import Neighbours
from ..selection.search import TooFewData
from ..selection.thresholds import CONFIRMED, SHOWS_HARDLY
from .alternatives import AlternativesSearch
from .forward import ForwardSelection
from .neighbours import Neighbourhood
from .node import Node
from .steps import addition, exchange, with_model
from .thresholds import BRANCHES
from .visits import Visits


class StepwiseSelection:
    """The search for the effects of a model: forward, backward, among neighbours, and along other branches.

    Parameters
    ----------
    visits : Visits
        None yet.
    """

    def __init__(self, visits: Visits):
        self.visits = visits
        self.alternatives = AlternativesSearch(self.visits)
        self.forward = ForwardSelection(self.visits, self.alternatives)

    def run(self) -> Study:
        """Return the end of the ladder and its neighbours."""
        visits = self.visits
        end, neighbourhood = self._local_best(self.forward.end_of(visits.visit(visits.start, None, {})))
        refused: set[tuple[str, ...]] = set()
        while end.incomplete and len(refused) < BRANCHES:
            untried = next(self._untried(end, refused), None)
            if untried is None:
                break
            best = visits.study(end.steps, end.search, UNDER_WAY, neighbourhood)
            node, effect = untried
            other = self._branch(end, node, effect, best)
            if other is None:
                refused.add(node.key_with(effect))
            else:
                end, neighbourhood = self._local_best(self.forward.end_of(other))
        steps = self._refitted_in_full(end)
        neighbourhood = replace(neighbourhood, nrmse=steps[-1].nrmse, nrmse_holdout=steps[-1].nrmse_holdout)
        return visits.study(steps, end.search, COMPLETE, neighbourhood)

    def _refitted_in_full(self, end: Node) -> tuple[Step, ...]:
        """Return the steps to an end, the last with the parameters of a refit to the whole records.

        Where parts of the records are held out, that refit has seen them: the held-out error is then that of
        the last fit that has not.
        """
        *steps, last = end.steps
        self.visits.monitor.stage("the parameters of the last model")
        refitted = end.search.in_full()
        again = None if refitted is None else end.search.final([refitted], self.visits.free)
        if again is None:
            return end.steps
        ((model, error, held_out),) = again
        held_out = held_out if self.visits.dataset.validation else last.nrmse_holdout
        return *steps, with_model(last, model, error, held_out)

    # --- local search -----------------------------------------------------------------------------------

    def _local_best(self, end: Node) -> tuple[Node, Neighbours]:
        """Move to better neighbours until there are none; return the last node and its neighbours."""
        refound: set[tuple[str, ...]] = set()
        for _ in range(self.visits.max_effects):
            neighbourhood, table = self._neighbourhood(end)
            better = neighbourhood.better(self.visits, end.structure.key not in refound)
            if better is None:
                break
            structure, how = better
            if structure.key == end.structure.key:
                refound.add(structure.key)
            end = self.forward.end_of(self.visits.visit(structure, end, exchange(how)))
        else:
            neighbourhood, table = self._neighbourhood(end)
        return replace(end, steps=neighbourhood.with_equivalents(end.steps)), table

    def _neighbourhood(self, end: Node) -> tuple[Neighbourhood, Neighbours]:
        """Fit every neighbour of a model in which nothing more was found."""
        visits, stage = self.visits, self.visits.monitor.stage
        visits.publish(end.steps, end.search)
        stage("every effect left out in turn")
        neighbourhood = Neighbourhood(end.structure, end.search, visits.free, visits.node)
        neighbourhood.add(end.diagnosis, end.refused)
        neighbourhood.drop_each()
        if end.incomplete and len(end.structure.added) < visits.max_effects:
            neighbourhood.add_restarted(self._effects_on_path(end))
        errors, left = end.search.errors(neighbourhood.own), {node.structure.key for node in end.path[:-1]}
        for place in reversed(range(len(end.structure.added))):
            so_far = Neighbours(neighbourhood.rows(left), *errors, complete=False)
            visits.publish(end.steps, end.search, so_far)
            stage(f"exchanges of {end.structure.added[place].id.replace('_', ' ')}")
            alternatives = self.alternatives.at(end.structure, place, end.search, neighbourhood.less(place))
            neighbourhood.exchange(place, alternatives)
        neighbourhood.merge()
        table = Neighbours(neighbourhood.rows(left), *errors)
        visits.publish(end.steps, end.search, table)
        return neighbourhood, table

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
        for node, ahead in itertools.zip_longest(end.path, end.path[1:]):
            # several effects at once are more than one step
            followed = None if ahead is not None and len(ahead.steps) > len(node.steps) + 1 else node.next
            named = {followed.id, *followed.equivalents} if followed is not None else set()
            ranking = sorted((c for c in node.diagnosis.ranking if c.confirmed), key=lambda c: c.nrmse)
            ranking += node.set_aside
            rank = 0
            for c in ranking:
                if c.id in named or not c.nrmse < SHOWS_HARDLY * node.diagnosis.nrmse:
                    continue
                named |= {c.id, *c.equivalents}
                found.append(((rank, c.nrmse / node.diagnosis.nrmse, node.key_with(c)), node, c))
                rank += 1
        for (_, _, key), node, c in sorted(found, key=lambda f: f[0]):
            if key not in self.visits and key not in refused:
                yield node, c

    def _branch(self, end: Node, node: Node, effect: CandidateEffect, best: Study) -> Node | None:
        """Visit the model with a rival of an earlier step; return it if it, or its best extension, is better.

        `best`: reported meanwhile.
        """
        visits, structure = self.visits, self.forward.revised(node, effect).structure
        if structure.key in visits:
            return None
        gone, new = [e.id for e in end.structure.added], [e.id for e in structure.added]
        dropped, instead = ([e for e in a if e not in b] for a, b in ((gone, new), (new, gone)))
        how = addition(effect)
        if dropped:
            over_followed = effect.evidence - max(node.diagnosis.ranking[0].evidence, 0.0)
            how = {"dropped": tuple(dropped), "instead": tuple(instead), "evidence": over_followed}
        try:
            other = visits.visit(structure, end, how, best=best)
        except TooFewData:
            return None
        return other if visits.beats(other.extended, end.structure.block, other.search) else None
