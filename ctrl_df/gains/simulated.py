"""What a loop really does at given gains: simulated from starts of many sizes, its cycles closed exactly."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field

from ..limit_cycles.exact.basins import Fate
from ..limit_cycles.exact.orbit import Orbit
from ..limit_cycles.finder import OrbitFinder
from ..simulate.parallel import require_compiled, side_by_side
from .controller import Structure
from .thresholds import ORDER


@dataclass(frozen=True)
class Simulated:
    """One pair of gains, simulated.

    Attributes
    ----------
    gains : dict
        All three gains.
    rests, cycles, diverges : bool
        Whether any of the starts ends so.
    orbit : Orbit or None
        The cycle that most of the starts end on.
    fate : Fate
        A row a start.
    """

    gains: Mapping[str, float]
    rests: bool
    cycles: bool
    diverges: bool
    orbit: Orbit | None = None
    fate: Fate = field(default_factory=Fate, repr=False)

    @property
    def verdict(self) -> str:
        """``rests``, ``cycles``, ``diverges``, several of them joined by "or", or ``undecided``."""
        return worded(self.rests, self.cycles, self.diverges)


def worded(rests, cycles, diverges) -> str:
    """Say in words which fates there are."""
    named = zip(("rests", "cycles", "diverges"), (rests, cycles, diverges), strict=True)
    return " or ".join(name for name, there in named if there) or "undecided"


def simulated(structure: Structure, gains: Mapping[str, float]) -> Simulated:
    """Simulate a loop from all starts."""
    finder = OrbitFinder(structure.loop(gains))
    require_compiled(finder.engine)
    fate = finder.explorer.explore(edges=False, factors=ORDER)
    orbits = [row.orbit for row in fate.cycles if row.orbit is not None]
    most = max(orbits, key=lambda o: sum(o is other for other in orbits)) if orbits else None
    return Simulated(dict(gains), bool(fate.rests), bool(fate.cycles), bool(fate.diverges), most, fate)


def all_simulated(
    structure: Structure, many: Iterable[Mapping[str, float]], after_each: Callable[[], object] = lambda: None
) -> list[Simulated]:
    """Simulate loops side by side, on all processors; `after_each` is called after each."""

    def one(gains):
        found = simulated(structure, gains)
        after_each()
        return found

    return side_by_side(one, many)
