"""Backward elimination: effects added earlier are examined again with the last one in the model."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from ..selection.search import Search
from .structure import Structure, exchanged
from .thresholds import RIVALS, STEPS_NEIGHBOUR, STEPS_SAME


@dataclass(frozen=True)
class Revision:
    """A model of a ladder after each of its effects was examined again.

    Attributes
    ----------
    structure : Structure
    dropped, instead : tuple of str
        Ids of effects that are no more in it, and of those in the place of some of them.
    """

    structure: Structure
    dropped: tuple[str, ...] = ()
    instead: tuple[str, ...] = ()


def revised(structure: Structure, search: Search, free: Callable) -> Revision:
    """Examine effects added earlier again, with the last one in the model.

    Those without which the error stays the same are dropped. Those that also stood in for the last one are
    replaced by a rival of their own step that is better now, or as good with fewer parameters.

    Parameters
    ----------
    structure : Structure
    search : Search
        In which the last effect was found.
    free : callable
        Parameters of a block that may be refitted.
    """
    dropped: list[str] = []
    instead: list[str] = []

    def fitted(block, iterations):
        return search.fitted(block, free(block), iterations)

    place = 0
    for _ in structure.added[:-1]:
        old, rivals = structure.added[place], structure.rivals[place]
        less = fitted(structure.without(place).block, STEPS_NEIGHBOUR)
        own, tried = fitted(structure.block, STEPS_SAME), []
        for effect in rivals[:RIVALS]:
            other = exchanged(less.block, effect)
            if other is not None:
                tried.append((effect, fitted(other, STEPS_NEIGHBOUR)))
        ranked = search.ranked_over(less, [own, *(t for _, t in tried)])
        own = next(t for t in ranked if t.block is own.block)
        best = ranked[0]
        if best.evidence < search.significant:
            structure = structure.without(place).at(less.block)
            dropped.append(old.id)
        elif best.evidence > own.evidence + (0.0 if best.extra < own.extra else search.significant):
            new = next(effect for effect, t in tried if t.block is best.block)
            others = (old, *(e for e in rivals if e is not new))
            structure = structure.without(place).plus(best.block, others)
            dropped.append(old.id)
            instead.append(new.id)
        else:
            place += 1
    return Revision(structure, tuple(dropped), tuple(instead))
