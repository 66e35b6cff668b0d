"""The candidates in the place of an effect: those of the step that added it, or of a search of its own."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from ..selection.search import Search
from .node import Node
from .structure import Structure
from .thresholds import STEPS_NEIGHBOUR
from .visits import Visits


@dataclass(frozen=True, eq=False)
class Alternatives:
    """The candidates in the place of an effect.

    Attributes
    ----------
    less : Structure
        The model without it.
    candidates : sequence of Candidate
        Blocks with another last effect, roughly fitted, best first; evidence over the model.
    errors : callable
        Errors of a candidate, on the data fitted and on those held out.
    """

    less: Structure
    candidates: Sequence[Any]
    errors: Callable[[Any], tuple[float, float]]


class AlternativesSearch:
    """The search for alternatives among all models of a ladder, each made once.

    Parameters
    ----------
    visits : Visits
    """

    def __init__(self, visits: Visits):
        self.visits = visits
        self._found: dict[tuple[tuple[str, ...], int], Alternatives] = {}

    def at(self, structure: Structure, place: int, search: Search, less=None) -> Alternatives:
        """Return the candidates in the place of an effect, those of the step that added it or new ones.

        `search`: of the model without the last effect, or of the model; `less`: the model without the effect
        of that place as fitted there, where it is known.
        """
        visits = self.visits
        without, old = structure.without(place), structure.added[place]
        node = visits.node(without)
        if node is not None and node.diagnosis.ranking:
            return _alternatives_at(node, old)
        key = (tuple(e.id for e in structure.added), place)
        if key not in self._found:
            less = less or search.fitted(without.block, visits.free(without.block), STEPS_NEIGHBOUR)
            beside = begun_beside(
                without.block, old, less, search, visits.free, visits.classes, visits.executor
            )
            self._found[key] = Alternatives(without, *beside)
        return self._found[key]


def begun_beside(others, effect, less, search: Search, free: Callable, classes, executor=None):
    """Return the candidates in the place of an effect, begun beside the others, and what tells their errors.

    Parameters
    ----------
    others : Mechanism
        The model without the effect, with its values beside it.
    effect : Effect
    less : Candidate
        The same model as fitted in `search`.
    free : callable
        Parameters of a block that may be refitted.
    classes : sequence of effect classes
    executor : concurrent.futures.Executor or None
    """
    beside, model = search.based_on(others, less, free(others)), others.with_effect(effect)
    return beside.rivals(model, free(model), classes, executor), beside.errors


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
