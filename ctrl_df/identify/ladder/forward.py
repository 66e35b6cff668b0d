"""Forward selection: the effect that explains most is added, or several at once, as long as one does.

With each step all earlier effects are examined again (backward elimination).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from ..results.diagnosis import CandidateEffect
from ..results.explain import named
from ..results.ladder import Step
from ..selection.search import TooFewData
from ..thresholds import ONLY_NOISE
from .alternatives import AlternativesSearch
from .node import Node
from .revision import Revision, revised
from .several_at_once import Trials, several_at_once
from .steps import addition, refusal, step_of, step_to
from .structure import Structure
from .visits import Visits


class ForwardSelection:
    """Forward selection from any model.

    Parameters
    ----------
    visits : Visits
    alternatives : AlternativesSearch
    """

    def __init__(self, visits: Visits, alternatives: AlternativesSearch):
        self.visits, self.alternatives = visits, alternatives

    def end_of(self, node: Node) -> Node:
        """Add effects until nothing more is found; return the last node."""
        visits = self.visits
        while (best := node.next) is not None or node.incomplete:
            # time may end before several effects are found, which are better
            begun = [self._step_with(node, best)] if best is not None else []
            self._report(node, begun)
            ahead = self._with_several(node, best)
            if ahead is not None:
                node = ahead
                continue
            if best is None:
                break
            self._report(node, begun)
            visits.monitor.stage("earlier effects examined again")
            revision = self.revised(node, best, self._in_place_at(node))
            if revision.structure.key in visits:
                break
            how = addition(best) | {"dropped": revision.dropped, "instead": revision.instead}
            try:
                ahead = visits.visit(revision.structure, node, how, begun[0])
            except TooFewData as too_few:
                doubt = f"{named(best.effect).capitalize()} was not added: {too_few}"
                return visits.keep(node.refusing(best.id, doubt))
            gain, held_out = visits.compared(ahead.extended, node.structure.block, ahead.search)
            # a step that dropped or replaced others does not need the evidence of an additional effect
            least = node.search.significant * (-1 if revision.dropped or revision.instead else 1)
            if gain < least or held_out[0] > ONLY_NOISE * held_out[1]:
                return visits.keep(node.refusing(best.id, refusal(best, held_out)))
            node = ahead
        return node

    def _step_with(self, node: Node, best: CandidateEffect) -> Step:
        return step_of(node.diagnosis, best.model, (best.nrmse, best.nrmse_holdout), addition(best))

    def _report(self, node: Node, begun: list[Step]) -> None:
        if begun:
            self.visits.publish_begun((*node.steps, *begun), node.search)

    def _with_several(self, node: Node, best: CandidateEffect | None) -> Node | None:
        """Return the node of several effects at once, where two explain more than the best one, and hold.

        Beside a second effect that is missing the best candidate may stand in for both, and the right ones be
        far behind it; or none is significant alone.
        """
        visits, search, at = self.visits, node.search, node.structure
        room = visits.max_effects - len(at.added)
        if room < 2 or node.leaves_only_noise:
            return None
        visits.monitor.stage("several effects at once")
        found, one, alone = node.diagnosis, at.block, 1.0
        if best is not None:
            one, alone = best.model, best.nrmse / found.nrmse
        trials = Trials(search, visits.free, visits.classes)
        several = several_at_once(at, found.ranking, one, alone, trials, room)
        if several is None:
            return None
        revision = revised(several.structure, search, visits.free, lambda *_: ())
        new = {t.block.effects[-1].id for t in several.fits}
        if revision.structure.key in visits or new & set(revision.dropped):
            return None
        *begun, step = (step_to(node.diagnosis, t, search) for t in several.fits)
        begun = [replace(s, diagnosis=None) for s in begun]
        visits.publish_begun((*node.steps, *begun, step), search)
        how = {"effect": step.effect, "evidence": step.evidence}
        how |= {"dropped": revision.dropped, "instead": revision.instead}
        try:
            ahead = visits.visit(revision.structure, node, how, step, between=tuple(begun))
        except TooFewData:
            return None
        return ahead if visits.beats(ahead.extended, at.block, ahead.search) else None

    def revised(self, node: Node, effect: CandidateEffect, in_place: Callable | None = None) -> Revision:
        """Return the structure with an effect added and the earlier ones examined again.

        `in_place`: see `revised`; None: rivals of their own steps alone.
        """
        others = [c.effect for c in node.diagnosis.ranking if c is not effect and c.confirmed]
        structure = node.structure.plus(effect.model, others)
        return revised(structure, node.search, self.visits.free, in_place or (lambda *_: ()))

    def _in_place_at(self, node: Node) -> Callable[[Structure, int, Any], list]:
        """Return what finds models with another effect in the place of one, over the data of a node."""

        def in_place(structure: Structure, place: int, less) -> list:
            self.visits.monitor.stage(f"exchanges of {structure.added[place].id.replace('_', ' ')}")
            found = self.alternatives.at(structure, place, node.search, less)
            return [t.block for t in found.candidates]

        return in_place
