"""The model of a ladder as a structure: what the user gave, what was added, and what else was in question."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

from ...blocks.effect import Effect
from ...blocks.stated import ROLES
from ..starting.extend import applicable, extended


@dataclass(frozen=True)
class Structure:
    """A block whose first effects are the user's; the others were added.

    Effects are known by their place: names of several of a kind change as soon as one of them goes.

    Attributes
    ----------
    block : Mechanism
    given : int
        How many effects are the user's.
    rivals : tuple of tuple of Effect
        Of each effect added those that were in question in its place, the best first.
    """

    block: Any
    given: int
    rivals: tuple[tuple[Effect, ...], ...] = ()

    @property
    def added(self) -> tuple[Effect, ...]:
        """The effects that were added."""
        return self.block.effects[self.given :]

    @property
    def key(self) -> tuple[str, ...]:
        """The same for structures of the same effects, in whatever order."""
        return tuple(sorted(e.id for e in self.added))

    @property
    def parameters(self) -> int:
        """How many parameters the effects added have."""
        return sum(parameters_of(e) for e in self.added)

    def at(self, block) -> Structure:
        """Return the same structure with other parameters."""
        return replace(self, block=block)

    def without(self, place: int) -> Structure:
        """Return the structure without the effect of that place among those added."""
        rivals = (*self.rivals[:place], *self.rivals[place + 1 :])
        return replace(self, block=bare(self.block, self.given + place), rivals=rivals)

    def plus(self, block, rivals: Iterable[Effect] = ()) -> Structure:
        """Return the structure of a block that has one effect more, at its end."""
        return replace(self, block=block, rivals=(*self.rivals, tuple(rivals)))


def exchanged(block, effect: Effect):
    """Return a block with an effect more; None where the two contradict each other."""
    return extended(block, effect) if applicable(type(effect), block) else None


def bare(block, place: int):
    """Return a block without the effect of that place."""
    effects = block.effects
    return block.with_effects((*effects[:place], *effects[place + 1 :]))


def parameters_of(effect: Effect) -> int:
    """Return how many parameters of an effect a fit may move."""
    return sum(p.estimated for p in effect.parameters.values())


def plainness(effect: Effect) -> tuple:
    """Return what puts plain effects first: fewer parameters, then forces before friction before joints.

    The id makes the order complete, so that it does not depend on how effects are listed.
    """
    return parameters_of(effect), ROLES.index(effect.role), effect.id
