"""Two effects at once: where one alone stands in for two, the right ones may be far behind it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ..selection.search import Search
from ..selection.verdict import errs_more
from ..thresholds import RULED_OUT
from .structure import Structure, parameters_of, plainness
from .thresholds import STEPS_NEIGHBOUR


@dataclass(frozen=True, eq=False)
class Two:
    """A model with two effects more, and the same with the first of them alone, both as fitted.

    Attributes
    ----------
    structure : Structure
    first : Candidate
        With evidence over the model without them.
    both : Candidate
        With evidence over `first`.
    """

    structure: Structure
    first: Any
    both: Any


def two_at_once(structure: Structure, one, search: Search, free: Callable, classes) -> Two | None:
    """Return the best model with two effects more, where it explains significantly more than that with one.

    Parameters
    ----------
    structure : Structure
    one : Mechanism
        The model with the best single effect.
    search : Search
        In which that was found.
    free : callable
        Parameters of a block that may be refitted.
    classes : sequence of effect classes

    Returns
    -------
    Two or None
        Of those that the data hardly tell apart the plainest one.
    """
    promising = search.pairs(classes)
    if not promising:
        return None

    def fitted(block):
        return search.fitted(block, free(block), STEPS_NEIGHBOUR)

    none, single = fitted(structure.block), fitted(one)
    # what the changes of the output alone leave is more than a fit leaves
    most = (search.errors(single)[0] / search.errors(none)[0]) ** 2
    tried = [fitted(block) for block, left in promising if left < most]
    least = search.significant
    found = [
        t
        for t in search.ranked_over(single, tried)
        if t.evidence > least
        and t.evidence_fitted > least
        and not errs_more(t.block.effects[-1], search.errors(t)[1], search.errors(single)[1])
    ]
    if not found:
        return None
    both = min((t for t in found if t.evidence > found[0].evidence - RULED_OUT), key=_plain)
    begun = both.block.with_effects(both.block.effects[:-1])
    first = search.ranked_over(none, [fitted(begun)])[0]
    (both,) = search.ranked_over(first, [both])
    return Two(structure.plus(first.block).plus(both.block), first, both)


def _plain(tried) -> tuple:
    """Return the key that puts plain pairs first."""
    effects = tried.block.effects[-2:]
    return sum(map(parameters_of, effects)), sorted(map(plainness, effects))
