"""Backward elimination: effects added earlier are examined again with the last one in the model.

One that stood in for what was missing beside it is found out here, before a model with it is diagnosed, and
one whose values made up for it gets those that it has beside it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from ...simulate.parallel import side_by_side
from ..selection.search import Search
from ..thresholds import DISTINGUISHED
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


def revised(
    structure: Structure,
    search: Search,
    free: Callable,
    in_place: Callable[[Structure, int, Any], Sequence[Any]],
) -> Revision:
    """Examine effects added earlier again, with the last one in the model.

    Those without which the error stays the same are dropped. Those that also stood in for the last one are
    replaced by a rival that is better now, or as good with fewer parameters: one of their own step, or one
    that only beside the last effect shows what it explains. One that was found without the last effect may
    have other values beside it: it is fitted from new starts as well.

    Parameters
    ----------
    structure : Structure
    search : Search
        In which the last effect was found.
    free : callable
        Parameters of a block that may be refitted.
    in_place : callable
        ``in_place(structure, place, less)``: models with another effect in that place, roughly fitted, the
        best first; `less`: the model without it, as fitted in `search`.
    """
    dropped: list[str] = []
    instead: list[str] = []

    def fitted(block, iterations, near=None):
        return search.fitted(block, free(block), iterations, near)

    def all_fitted(blocks, near):
        return side_by_side(lambda block: fitted(block, STEPS_NEIGHBOUR, near), blocks)

    place = 0
    for _ in structure.added[:-1]:
        old, rivals = structure.added[place], structure.rivals[place]
        same = fitted(structure.block, STEPS_SAME)
        less = fitted(structure.without(place).block, STEPS_NEIGHBOUR, same)
        known = (exchanged(less.block, effect) for effect in rivals[:RIVALS])
        tried = all_fitted([block for block in known if block is not None], same)
        ranked = search.ranked_over(less, [same, *tried])
        if ranked[0].evidence < search.significant:
            structure = structure.without(place).at(less.block)
            dropped.append(old.id)
            continue
        begun = in_place(structure, place, less)
        anew = [b for b in begun if b.effects[-1].id == old.id][:1]
        others = [b for b in begun if b.effects[-1].id != old.id][:RIVALS]
        tried += all_fitted([*anew, *others], same)
        ranked = search.ranked_over(less, [same, *tried])
        kept = next(t for t in ranked if t.block is same.block)
        better = (t for t in ranked if t.evidence > kept.evidence + DISTINGUISHED)
        own = next((t for t in better if t.block.effects[-1].id == old.id), kept)
        best = ranked[0]
        if best.evidence <= own.evidence + (0.0 if best.extra < own.extra else search.significant):
            best = own
        if best.block is same.block:
            place += 1
            continue
        new = best.block.effects[-1]
        others_known = (e for e in rivals if e.id != new.id)
        if best is own:
            structure = structure.without(place).plus(best.block, others_known)
            continue
        structure = structure.without(place).plus(best.block, (old, *others_known))
        dropped.append(old.id)
        instead.append(new.id)
    return Revision(structure, tuple(dropped), tuple(instead))
