"""Two effects at once, from what each alone would change in the output.

Where two effects are missing, the one that explains most alone may be neither of them: it stands in for both.
The residual of the refitted model is therefore regressed on what two effects change, for all pairs of start
values. What the model's own parameters explain is projected out, as for single effects (`screen`); that is
linear algebra alone.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...blocks.effect import Effect
from .extend import applicable, extended
from .proposals import proposals
from .screen import Screen, scaled
from .thresholds import PAIR_DEPENDENT


@dataclass(frozen=True)
class Extended:
    """A model with effects more, and the share of the power of the residual that they should leave."""

    block: Any
    left: float


@dataclass(frozen=True, eq=False)
class _Change:
    """What an effect changes in the output, of unit power; `size`: of the change itself."""

    effect: Effect
    direction: np.ndarray
    size: float

    @property
    def signed(self) -> bool:
        """Whether the effect may act the other way round."""
        return self.effect.proportional and next(iter(self.effect.parameters.values())).lower < 0


def pairs(classes: Sequence[type[Effect]], screen: Screen, most: int) -> list[Extended]:
    """Return the pairs of effects that explain most of the residual, each with its best start values.

    Parameters
    ----------
    classes : sequence of effect classes
    screen : Screen
        Of the model without them.
    most : int
        How many.

    Returns
    -------
    list of Extended
        Best first; those of which the block takes only one effect are left out.
    """
    changes = [change for cls in classes for change in _changes(cls, screen)]
    if len(changes) < 2 or not screen.power:
        return []
    directions = np.array([c.direction for c in changes])
    along, common = directions @ screen.residual, directions @ directions.T
    first, second = np.tril_indices(len(changes), -1)
    between = common[first, second]
    independent = np.maximum(1 - between**2, PAIR_DEPENDENT)
    one = (along[first] - between * along[second]) / independent
    other = (along[second] - between * along[first]) / independent
    left = 1 - (one * along[first] + other * along[second]) / screen.power
    kinds = [c.effect.id for c in changes]
    number, signed = np.unique(kinds, return_inverse=True)[1], np.array([c.signed for c in changes])
    possible = (
        (number[first] != number[second]) & ((one > 0) | signed[first]) & ((other > 0) | signed[second])
    )
    found: dict[tuple[str, ...], Extended] = {}
    for i in np.flatnonzero(possible)[np.argsort(left[possible])]:
        members = [(changes[first[i]], one[i]), (changes[second[i]], other[i])]
        key = tuple(sorted((kinds[first[i]], kinds[second[i]])))
        if key in found:
            continue
        block = _with_all(screen.block, members)
        if block is not None:
            found[key] = Extended(block, float(left[i]))
        if len(found) == most:
            break
    return list(found.values())


def singles(classes: Sequence[type[Effect]], screen: Screen) -> list[Extended]:
    """Return the model with every single effect that can be added, the one that should leave least first."""
    found = []
    for cls in classes:
        tried = []
        for change in _changes(cls, screen):
            along = float(change.direction @ screen.residual)
            block = _with_all(screen.block, [(change, along)])
            if block is not None:
                tried.append(Extended(block, max(1 - along**2 / screen.power, 0.0) if screen.power else 1.0))
        if tried:
            found.append(min(tried, key=lambda t: t.left))
    return sorted(found, key=lambda t: t.left)


def _changes(cls, screen: Screen) -> Iterator[_Change]:
    """Yield what the start values of a class change beyond what the model's own parameters explain."""
    if not applicable(cls, screen.block):
        return
    for effect in proposals(cls, screen):
        block = extended(screen.block, effect)
        change = None if block is None else screen.change(block)
        if block is None or change is None:
            continue
        change = screen.project(change)
        size = math.sqrt(float(change @ change))
        if size > 0:
            yield _Change(block.effects[-1], change / size, size)


def _with_all(block, members):
    """Return a block with further effects, each by as much as it takes; None where it does not take all.

    One whose sign excludes that explains the residual by what it cannot do. One that is not proportional to
    its size stays as it is: its start values go from small to large.
    """
    for change, weight in members:
        effect, factor = change.effect, weight / change.size
        if effect.proportional:
            effect = scaled(effect, factor)
        if effect is None or factor <= 0 and effect is change.effect or not applicable(type(effect), block):
            return None
        block = extended(block, effect)
        if block is None:
            return None
    return block
