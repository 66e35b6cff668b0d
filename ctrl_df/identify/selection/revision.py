"""A later effect may do what earlier ones stood in for: they are looked at again beside it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from ..estimation.variables import default_free
from ..starting.extend import extended
from .search import Search


@dataclass(frozen=True)
class Revision:
    """A model of a ladder after each of its effects was looked at again.

    Attributes
    ----------
    block : Mechanism
    dropped, instead : tuple of str
        Names of effects that are no more in it, and of those in the place of some of them.
    """

    block: Any
    dropped: tuple[str, ...] = ()
    instead: tuple[str, ...] = ()


def revised(block, start, search: Search, kept, rivals: Mapping[str, Sequence]) -> Revision:
    """Look again at effects added to `start` earlier, beside the last one of the block.

    Those without which the error stays as it is are dropped. Those that stood in for something else, too,
    give way to another candidate of their own step that does better now, or as well with fewer parameters:
    `rivals`, effects by the name chosen. `kept`: parameters that are not to be refitted.
    """
    dropped: list[str] = []
    instead: list[str] = []

    def fitted(model, iterations):
        return search.fitted(model, [k for k in default_free(model) if k not in kept], iterations)

    for key in [k for k in list(block.named_effects)[:-1] if k not in start.named_effects]:
        less = fitted(block.without_effect(key), 8)
        tried = [fitted(block, 4)]
        for effect in rivals.get(key, ()):
            other = extended(less.block, effect)
            if other is not None:
                tried.append(fitted(other, 8))
        tried = [replace(t, extra=t.extra - less.extra) for t in tried]
        judged = search.ranked(less, tried)
        best, own = judged[0], next(t for t in judged if t.block is tried[0].block)
        if best.evidence < search.significant:
            block = less.block
            dropped.append(key)
        elif best.evidence > own.evidence + (0.0 if best.extra < own.extra else search.significant):
            block = best.block
            dropped.append(key)
            instead.append(block.newest)
    return Revision(block, tuple(dropped), tuple(instead))
