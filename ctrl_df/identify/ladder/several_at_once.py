"""Several effects at once: where one effect stands in for two, the right ones may rank far behind it.

Pairs have three sources: what two effects together change in the output, effects that are significant each
alone, and a further effect beside the best single ones. They are fitted and compared; unless the best one
leaves only noise, each of its effects is fitted once more, from new start values beside the other, and pairs
that share one with the best are fitted from its values. A pair may stand in for three effects. The effects
that promise most beside the best pairs are therefore added and fitted, and the search goes on from the best
of these models as long as it is significantly better. Only the last one is diagnosed.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from ...blocks.effect import Effect
from ...simulate.parallel import side_by_side
from ..results.diagnosis import CandidateEffect
from ..selection.search import Search
from ..selection.verdict import errs_more
from ..thresholds import GIVE_UP, GROWTH, RULED_OUT
from .alternatives import begun_beside
from .structure import Structure, bare, exchanged, parameters_of, plainness
from .thresholds import (
    FITTED_BEYOND,
    LOOKED_BEYOND,
    PAIR_PROMISES,
    PAIR_STEPS,
    PAIRS_FITTED,
    PROMISED_BEYOND,
    STEPS_NEIGHBOUR,
)


@dataclass(frozen=True, eq=False)
class Several:
    """A model with several effects more.

    Attributes
    ----------
    structure : Structure
    fits : tuple of Candidate
        The models with one, two, ... of the effects, each with evidence over the one before.
    """

    structure: Structure
    fits: tuple[Any, ...]


@dataclass(frozen=True, eq=False)
class Trials:
    """Fits of models with several effects more, in one search.

    Attributes
    ----------
    search : Search
    free : callable
        Parameters of a block that may be refitted.
    classes : sequence of effect classes
    """

    search: Search
    free: Callable
    classes: Sequence

    def fitted(self, block):
        """Return a model fitted, and validated on the data held out."""
        return self.search.fitted(block, self.free(block), STEPS_NEIGHBOUR)

    def begun(self, blocks, iterations=STEPS_NEIGHBOUR) -> list:
        """Return models fitted with less care, to be compared over the data fitted."""
        return side_by_side(lambda block: self.search.begun(block, self.free(block), iterations), blocks)

    def best(self, block, alone: Sequence, pairs: Sequence, most: int) -> tuple[Any, bool]:
        """Return the best model with two effects more than `block`, or several; whether it leaves only noise.

        None where none is significant. A pair need not be better than the best single effect: that may stand
        in for three, and leave less than two of the three do.

        Parameters
        ----------
        block : Mechanism
        alone : sequence of Mechanism
            Models with an effect that is significant by itself: it may hide another one (a Stribeck curve a
            ripple), which is sought beside each of the best.
        pairs : sequence of Mechanism
            Models with two effects more that promise enough.
        most : int
            Effects more, at most.
        """
        search, first = self.search, len(block.effects)
        (none,) = self.begun([block])
        singles = search.ranked_over(none, self.begun(alone))
        pairs = [*pairs, *(self.extended(singles) if singles else ())]
        near = _best_of_each(search.ranked_over(none, self.begun(pairs, PAIR_STEPS)))[:PAIRS_FITTED]
        found = _better(none, self.begun([t.block for t in near]), search)
        settled = bool(found) and search.leaves_only_noise(found[0])
        if found and not settled:
            again = side_by_side(lambda t: self.restarted(t.block, first), _near(found, search))
            found = _better(none, [*found, *self.begun(itertools.chain(*again))], search)
            like_best = _begun_as_best(_near(found, search), first) if found else []
            found = _better(none, [*found, *self.begun(like_best)], search)
        best = None
        while found:
            best = self.reduced(_plainest(found), first)
            if len(best.block.effects) - first >= most or settled or search.errs_as_sensor(best):
                break
            found = _better(best, self.begun(self.extended(found, PROMISED_BEYOND)), search)
        return best, settled

    def restarted(self, block, first: int) -> list:
        """Return models with one of the effects, from `first` on, fitted from new starts beside the others.

        What was sought without another effect may lie in another minimum: a joint whose resonance that one
        hides. Of an effect that has a size alone, to which it is proportional, there is one minimum.
        """

        def again(place: int) -> list:
            effect, others = block.effects[place], bare(block, place)
            (less,) = self.begun([others])
            same, _ = begun_beside(others, effect, less, self.search, self.free, [type(effect)])
            return [t.block for t in same]

        new = enumerate(block.effects[first:], first)
        places = [i for i, e in new if not (e.proportional and parameters_of(e) == 1)]
        return list(itertools.chain(*side_by_side(again, places)))

    def reduced(self, tried, first: int):
        """Return a model of three effects or more without one that it does not need.

        The third may show that one of the two stood in for it. An effect stays with the evidence that it
        would need to be added. `first`: place of the first of them.
        """
        effects = tried.block.effects
        if len(effects) - first <= 2:
            return tried
        less = self.begun([bare(tried.block, place) for place in range(first, len(effects) - 1)])
        best = self.search.ranked_over(tried, less)[0]
        return _as_fitted(best, tried) if best.evidence > -self.search.significant else tried

    def extended(self, found: Sequence, most: float = 1.0) -> list:
        """Return the models with a further effect that promise to err least, by the linear estimate.

        What a model promises is no error of it: only fits are compared. `found`: best first; `most`: share of
        the residual's power that the effect may leave.
        """
        search, near = self.search, _near(found, self.search)
        further = side_by_side(lambda t: search.singles(t, self.classes), near)
        beyond = [
            (search.errors(t)[0] * left**0.5, more)
            for t, singles in zip(near, further, strict=True)
            for more, left in singles
            if left < most
        ]
        return [more for _, more in sorted(beyond, key=lambda b: b[0])[:FITTED_BEYOND]]


def several_at_once(
    structure: Structure, ranking: Sequence[CandidateEffect], one, left: float, trials: Trials, most: int
) -> Several | None:
    """Return a model with at least two effects more that explain significantly more than the best one.

    Parameters
    ----------
    structure : Structure
    ranking : sequence of CandidateEffect
        Single effects: two that are significant are fitted as a pair, and of any pair those that are not
        proportional to their size also begin as fitted alone.
    one : Mechanism
        The model with the best single effect, or without one where none is significant.
    left : float
        Share of the error that it leaves, 1 without one.
    trials : Trials
        In the search in which that was found.
    most : int
        Effects added at most, >= 2.

    Returns
    -------
    Several or None
        None where no two explain more, and where the best one, with the values that it has alone, is one of
        two and noise is not all that they leave: with it in the model the search for the second is a whole
        diagnosis.
    """
    search = trials.search
    significant = [c.effect for c in ranking if c.confirmed and c.evidence > search.significant]
    known = {c.id: c.effect for c in ranking if c.confirmed and not c.effect.proportional}
    share = PAIR_PROMISES * left**2
    pairs = [pair for pair, least in search.pairs(trials.classes) if least < share]
    if pairs:
        pairs += [_with_known(pair, known) for pair in pairs]
        pairs += [_with_both(structure.block, *two) for two in itertools.combinations(significant, 2)]
        pairs = [pair for pair in pairs if pair is not None]
    alone = [block for e in significant if (block := exchanged(structure.block, e)) is not None]
    several, settled = [], False
    for at in search.lengths() if pairs else ():
        end, settled = replace(trials, search=at).best(structure.block, alone, pairs, most)
        if end is not None:
            several.append(trials.fitted(end.block))
            if settled or search.errors(several[-1])[0] <= GROWTH * at.errors(end)[0]:
                break  # what acts slowly would show over longer segments
    found = _better(trials.fitted(one), several, search) if several else ()
    if not found:
        return None
    best, new = (_ids(block) - _ids(structure.block) for block in (one, found[0].block))
    if len(new - best) == 1 and not settled:
        beside = trials.fitted(_with_others_of(found[0].block, one))
        if not (_better(beside, found[:1], search) or search.leaves_only_noise(found[0])):
            return None
    first, fits = len(structure.block.effects), [found[0]]
    while len(fits[0].block.effects) > first:
        fits.insert(0, trials.fitted(fits[0].block.with_effects(fits[0].block.effects[:-1])))
    for fit in fits[1:]:
        structure = structure.plus(fit.block)
    steps = (search.ranked_over(a, [b])[0] for a, b in itertools.pairwise(fits))
    return Several(structure, tuple(steps))


def _better(than, tried: Sequence, search: Search) -> list:
    """Return those models that are significantly better than another, the best fit of each, best first."""
    found = []
    for t in search.ranked_over(than, tried):
        held_out = (search.errors(f)[1] for f in (t, than))
        significant = min(t.evidence, t.evidence_fitted) > search.significant
        if significant and not errs_more(t.block.effects[-1], *held_out):
            found.append(_as_fitted(t, than))
    return _best_of_each(found)


def _as_fitted(ranked, over):
    """Return a model ranked over another one as it was fitted, to be ranked again."""
    return replace(ranked, extra=ranked.extra + over.extra)


def _near(found: Sequence, search: Search) -> list:
    """Return the first models, those that err far more than the best left out; `found`: best first."""
    most = GIVE_UP * search.errors(found[0])[0]
    return [t for t in found if search.errors(t)[0] <= most][:LOOKED_BEYOND]


def _best_of_each(ranked: Sequence) -> list:
    """Return the first fit of every combination of effects, in their order."""
    first: dict[tuple[str, ...], Any] = {}
    for t in ranked:
        first.setdefault(tuple(sorted(e.id for e in t.block.effects)), t)
    return list(first.values())


def _plainest(found: Sequence):
    """Return the plainest of the models that data hardly tell apart from the best; `found`: best first."""
    return min((t for t in found if t.evidence > found[0].evidence - RULED_OUT), key=_plain)


def _begun_as_best(found: Sequence, first: int) -> list:
    """Return models that share an effect, from `first` on, with the best, begun with its values.

    The cost of a gap has many minima: beside an effect that stands in for the right one its fit may have come
    to the right minimum, and beside that one not. `found`: best first.
    """
    best, begun = found[0].block, []
    for block in (t.block for t in found[1:]):
        shared = [e for e in best.effects if e.id in _ids(block)]
        if first < len(shared) < len(block.effects):
            begun.append(_with_others_of(block, best.with_effects(shared)))
    return begun


def _with_others_of(block, one):
    """Return a model with what another one has besides, as far as it takes it."""
    for effect in block.effects:
        if effect.id not in _ids(one):
            one = exchanged(one, effect) or one
    return one


def _ids(block) -> set[str]:
    return {effect.id for effect in block.effects}


def _with_known(block, known: Mapping[str, Effect]):
    """Return a model of which the last two effects are as they are known; None where neither is."""
    *others, first, second = block.effects
    if not {first.id, second.id} & set(known):
        return None
    known_or_begun = (known.get(effect.id, effect) for effect in (first, second))
    return _with_both(block.with_effects(others), *known_or_begun)


def _with_both(block, first: Effect, second: Effect):
    """Return a model with two effects more; None where one contradicts the other."""
    block = exchanged(block, first)
    return None if block is None else exchanged(block, second)


def _plain(tried) -> tuple:
    """Return the key that puts plain effects first, of the last two of a model."""
    effects = tried.block.effects[-2:]
    return sum(map(parameters_of, effects)), sorted(map(plainness, effects))
