"""All models that differ from one by one effect: an effect less, another in its place, one more."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from ...simulate.parallel import side_by_side
from ..results.diagnosis import NONE, Diagnosis
from ..results.ladder import Step
from ..results.neighbours import ADD, BETTER, DROP, EQUAL, EXCHANGE, UNCONFIRMED, WORSE, Neighbour
from ..selection.search import Search
from ..selection.verdict import errs_more, is_significant
from ..thresholds import RULED_OUT
from .alternatives import Alternatives
from .structure import Structure, bare, exchanged, parameters_of, plainness
from .thresholds import RIVALS, STEPS_NEIGHBOUR


@dataclass(frozen=True, eq=False)
class Move:
    """The way to a neighbour that is to be fitted: the change, and the structure after it.

    `others`: further blocks to begin from.
    """

    change: str
    dropped: tuple[str, ...]
    added: str
    structure: Structure
    given: bool = False
    others: tuple[Any, ...] = ()


class Neighbourhood:
    """The neighbours of a model, refitted where screening leaves them near.

    Parameters
    ----------
    structure : Structure
        The model.
    search : Search
        In which nothing more was found.
    free : callable
        Parameters of a block that may be refitted.
    visited : callable
        ``visited(structure)``: the node of a structure that the ladder has visited, or None.
    """

    def __init__(self, structure: Structure, search: Search, free: Callable, visited: Callable):
        self.structure, self.search, self.free, self.visited = structure, search, free, visited
        self.own = search.fitted(structure.block, free(structure.block), STEPS_NEIGHBOUR)
        self.refitted: list[tuple[Move, Any]] = []
        self.screened: list[Neighbour] = []

    def fit(self, moves: Sequence[Move]) -> None:
        """Fit neighbours to the data on which the model is validated; of several starts keep the best."""
        self.refitted.extend(zip(moves, side_by_side(self._fitted, moves), strict=True))

    def _fitted(self, move: Move):
        blocks = (move.structure.block, *move.others)
        fits = [self.search.fitted(b, self.free(b), STEPS_NEIGHBOUR, self.own) for b in blocks]
        best = self.search.ranked_over(self.own, fits)[0].block if move.others else fits[0].block
        return next(f for f in fits if f.block is best)

    # --- an effect less ---------------------------------------------------------------------------------

    def drop_each(self) -> None:
        """Leave out every effect in turn; those of the user's model are reported only, and stay."""
        at, moves = self.structure, []
        for place, effect in enumerate(at.block.effects):
            own = place < at.given
            less = at.at(bare(at.block, place)) if own else at.without(place - at.given)
            before = None if own else self.visited(less)  # with the values that it had there
            others = () if before is None else (before.structure.block,)
            moves.append(Move(DROP, (effect.id,), "", less, own, others))
        self.fit(moves)

    def less(self, place: int):
        """Return the model without the effect of that place, once left out."""
        left_out = [t for move, t in self.refitted if move.change == DROP and not move.given]
        return left_out[place]

    # --- another in its place ---------------------------------------------------------------------------

    def exchange(self, place: int, alternatives: Alternatives) -> None:
        """Fit the nearest alternatives to an effect; of the others keep the result of screening."""
        old = self.structure.added[place]
        others = [t for t in alternatives.candidates if t.block.effects[-1].id != old.id]
        again = [
            t
            for t in alternatives.candidates
            if t.block.effects[-1].id == old.id and t.evidence > self.search.significant
        ]
        nearest, moves = others[:RIVALS], []
        for t in [*again, *nearest]:
            rivals = (old, *(o.block.effects[-1] for o in nearest if o is not t))
            new = t.block.effects[-1]
            begun = tuple(self._in_place(place, new) if t in nearest else ())
            there = alternatives.less.plus(t.block, rivals)
            moves.append(Move(EXCHANGE, (old.id,), new.id, there, others=begun))
        self.fit(moves)
        for t in others[RIVALS:]:
            added = t.block.effects[-1].id
            self.screened.append(
                _row(EXCHANGE, (old.id,), added, t.evidence, alternatives.errors(t), WORSE, False, t.block)
            )

    def _in_place(self, place: int, effect) -> list:
        """Return the model as it is with an effect that acts as the one of that place; none where none can.

        A spring is a pendulum over a small angle: of its own start its fit may not come as far.
        """
        at = self.structure.at(self.own.block)
        like = self.search.acting_as(effect, at.added[place])
        block = None if like is None else exchanged(at.without(place).block, like)
        return [] if block is None else [block]

    def merge(self) -> None:
        """Drop a second effect where an exchange is no worse than the model: one effect may replace two.

        A model with an effect less never fits better, so that other exchanges need no such fit.
        """
        moves = dict[tuple[str, ...], Move]()
        for move, t in self._ranked():
            if move.change != EXCHANGE or t.evidence < -self.search.significant:
                continue
            structure = move.structure.at(t.block)
            for place, other in enumerate(structure.added[:-1]):
                gone, less = (*move.dropped, other.id), structure.without(place)
                known = moves.setdefault(less.key, replace(move, dropped=gone, structure=less, others=()))
                if known.structure is not less:  # two exchanges lead to it: one model, begun at both
                    moves[less.key] = replace(known, others=(*known.others, less.block))
        self.fit(list(moves.values()))

    # --- one more ---------------------------------------------------------------------------------------

    def add(self, found: Diagnosis, refused: str = "") -> None:
        """Add what the diagnosis of the model says of every additional effect; one may have been `refused`.

        Where nothing is missing none is better: it explains noise, such as the rounding of a record.
        """
        for c in found.ranking:
            verdict = WORSE if c.evidence < -RULED_OUT else EQUAL
            if c.confirmed and c.evidence > self.search.significant:
                if not is_significant(c, self.search):
                    verdict = UNCONFIRMED
                elif found.verdict != NONE:
                    verdict = BETTER if c.id != refused else UNCONFIRMED
            errors = c.nrmse, c.nrmse_holdout
            self.screened.append(_row(ADD, (), c.id, c.evidence, errors, verdict, c.confirmed, c.model))

    def add_restarted(self, effects) -> None:
        """Fit additional effects from the values that they had at earlier steps."""
        blocks = ((effect, exchanged(self.structure.block, effect)) for effect in effects)
        self.fit([Move(ADD, (), e.id, self.structure.plus(b)) for e, b in blocks if b is not None])

    # --- results ----------------------------------------------------------------------------------------

    def _ranked(self) -> list[tuple[Move, Any]]:
        ranked = self.search.ranked_over(self.own, [t for _, t in self.refitted])
        by_block = {id(t.block): t for t in ranked}
        return [(move, by_block[id(t.block)]) for move, t in self.refitted]

    def with_equivalents(self, steps: Sequence[Step]) -> tuple[Step, ...]:
        """Return the steps to the model with what makes the same output in the place of their effects.

        However an effect has come into the model: at its own step others were missing.
        """
        tried, same = dict[str, set[str]](), dict[str, list[str]]()
        for move, t in self._ranked():
            if move.change == EXCHANGE and len(move.dropped) == 1 and move.added not in move.dropped:
                tried.setdefault(*move.dropped, set()).add(move.added)
                if self.search.alike(self.own, t):
                    same.setdefault(*move.dropped, []).append(move.added)

        def told(step: Step) -> Step:
            own = [e for e in (step.effect, *step.instead) if e in tried]
            kept = [e for e in step.equivalents if not any(e in tried[o] for o in own)]
            return replace(step, equivalents=(*kept, *(e for o in own for e in same.get(o, ()))))

        return tuple(told(step) for step in steps)

    def rows(self, known=()) -> tuple[Neighbour, ...]:
        """Return all of them, those that were fitted first, by evidence.

        `known`: keys of structures from which the ladder has gone on. One of them that is better than the
        model here, as the model was from there, by the noise of either, is neither: the two are equal.
        """
        others = [(move, t) for move, t in self._ranked() if move.structure.key != self.structure.key]
        rows = [(self._row_of(move, t), move.structure.key in known) for move, t in others]
        refitted = [replace(n, verdict=EQUAL) if left and n.verdict == BETTER else n for n, left in rows]
        found = sorted([*refitted, *self.screened], key=lambda n: -n.evidence)
        # an effect more may have been screened, and fitted again as it was at an earlier step
        added = {n.added: n for n in reversed(found) if n.change == ADD}
        found = [n for n in found if n.change != ADD or n is added[n.added]]
        return tuple(sorted(found, key=lambda n: not n.refitted))

    def _row_of(self, move: Move, t) -> Neighbour:
        errors = self.search.errors(t)
        verdict = self._verdict(move, t)
        return _row(
            move.change, move.dropped, move.added, t.evidence, errors, verdict, True, t.block, move.given
        )

    def _verdict(self, move: Move, t) -> str:
        """Return the verdict on a neighbour: an additional effect needs the evidence of any effect.

        None is better that errs more on held-out data, as no step of the ladder may.
        """
        fewer = len(move.dropped) > bool(move.added)
        more = len(move.dropped) < bool(move.added)
        alone = (
            t.evidence_fitted > self.search.significant
            and t.evidence_validation > self.search.significant_validation
        )
        if t.evidence > self.search.significant:
            held_out = (self.search.errors(f)[1] for f in (t, self.own))
            return BETTER if (alone or not more) and not errs_more(t.block, *held_out) else EQUAL
        return WORSE if t.evidence < -(self.search.significant if fewer else RULED_OUT) else EQUAL

    def better(self, known, again: bool = True) -> tuple[Structure, Neighbour] | None:
        """Return the neighbour to go to: the best of those that do better, else the simplest of the equals.

        `known`: keys of structures that the ladder has visited; `again`: whether the model itself in a better
        minimum, with other values, counts.
        """
        found = []
        for move, t in self._ranked():
            verdict = self._verdict(move, t)
            same = move.structure.key == self.structure.key
            if move.given or verdict == WORSE or not (again if same else move.structure.key not in known):
                continue
            structure = move.structure.at(t.block)
            if verdict == EQUAL and _plain(structure) >= _plain(self.structure):
                continue
            order = (0, -t.evidence, ()) if verdict == BETTER else (1, 0.0, _plain(structure))
            found.append((order, structure, self._row_of(move, t)))
        return min(found, key=lambda f: f[0])[1:] if found else None


def _plain(structure: Structure) -> tuple:
    """Return the key that sorts equally good structures, the simplest first."""
    kinds = sorted(plainness(e) for e in structure.added)
    return sum(parameters_of(e) for e in structure.added), len(structure.added), tuple(kinds)


def _row(change, dropped, added, evidence, errors, verdict, refitted, block, given=False) -> Neighbour:
    values = {k: p.value for k, p in block.parameters.items()}
    nrmse, nrmse_holdout = errors
    return Neighbour(
        change, tuple(dropped), added, float(evidence), float(nrmse), float(nrmse_holdout), verdict, refitted,
        given, values, block,
    )  # fmt: skip
