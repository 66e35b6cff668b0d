"""Two effects at once: where one alone stands in for two, the right ones may be far behind it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ...blocks.effect import Effect
from ..results.diagnosis import CandidateEffect
from ..selection.search import Search
from ..selection.verdict import errs_more
from ..thresholds import RULED_OUT
from .structure import Structure, exchanged, parameters_of, plainness
from .thresholds import PAIR_PROMISES, STEPS_NEIGHBOUR


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


def two_at_once(
    structure: Structure, ranking: Sequence[CandidateEffect], one, search: Search, free: Callable, classes
) -> Two | None:
    """Return the best model with two effects more, where it explains significantly more than that with one.

    Parameters
    ----------
    structure : Structure
    ranking : sequence of CandidateEffect
        Single effects: those of two that are not proportional to their size also begin as fitted alone.
    one : Mechanism
        The model with the best single effect, or without one where none is significant.
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

    none = fitted(structure.block)
    single = none if one is structure.block else fitted(one)
    most = PAIR_PROMISES * (search.errors(single)[0] / search.errors(none)[0]) ** 2
    known = {c.id: c.effect for c in ranking if c.confirmed and not c.effect.proportional}
    begun = [block for block, left in promising if left < most]
    begun += [again for block in begun if (again := _with_known(block, known)) is not None]
    tried = [fitted(block) for block in begun]
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
    less = both.block.with_effects(both.block.effects[:-1])
    first = search.ranked_over(none, [fitted(less)])[0]
    (both,) = search.ranked_over(first, [both])
    return Two(structure.plus(first.block).plus(both.block), first, both)


def _with_known(block, known: Mapping[str, Effect]):
    """Return a model of which the last two effects are as they are known; None where neither is."""
    *others, first, second = block.effects
    if not {first.id, second.id} & set(known):
        return None
    block = block.with_effects(others)
    for effect in (first, second):
        block = None if block is None else exchanged(block, known.get(effect.id, effect))
    return block


def _plain(tried) -> tuple:
    """Return the key that puts plain pairs first."""
    effects = tried.block.effects[-2:]
    return sum(map(parameters_of, effects)), sorted(map(plainness, effects))
