"""A model that the ladder has visited, with what its diagnosis says is to be added."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from ...cached import cached_property
from ..results.diagnosis import AMBIGUOUS, NONE, UNKNOWN, CandidateEffect, Diagnosis, rivals
from ..results.ladder import Step
from ..selection.long_prediction import LongPrediction, long_prediction
from ..selection.search import Search
from ..selection.thresholds import LEFT
from ..selection.verdict import is_significant
from .structure import Structure, plainness


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
    def leaves_only_noise(self) -> bool:
        """Whether the best candidate leaves hardly more than noise, which no second effect explains."""
        found = self.diagnosis
        return not self.incomplete and found.structure <= LEFT * math.hypot(found.noise, found.structure)

    @property
    def path(self) -> list[Node]:
        """The nodes from the first to this one."""
        return [*(self.parent.path if self.parent else ()), self]

    @property
    def extended(self):
        """The model with the best candidate, if it has one: over long segments one may need the other."""
        return self.structure.block if self.next is None else self.next.model

    def key_with(self, effect: CandidateEffect) -> tuple[str, ...]:
        """Return the key of the structure with a candidate added."""
        return self.structure.plus(effect.model).key

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


def plainest(ranking) -> CandidateEffect:
    """Return the simplest of the candidates that the data hardly distinguish from the first."""
    first, near = ranking[0], rivals(ranking)
    same = [c for c in near if c.id in first.equivalents]
    fewer = [c for c in near if plainness(c.effect)[0] < plainness(first.effect)[0]]
    return min([first, *same, *fewer], key=lambda c: plainness(c.effect))
