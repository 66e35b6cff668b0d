"""The orbits already found of one loop, and whether a simulation is on its way to one of them."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from .orbit import Orbit
from .poincare import CYCLES, Crossing, PoincareSearch, Trajectory, upward_crossings
from .thresholds import APPROACHING, ON, ORBIT_SIZE, REACHED, REACHED_UNSTABLE, SAME_ORBIT, SAME_ROUGHLY


class KnownOrbits:
    """Orbits of one loop, each once.

    Parameters
    ----------
    search : PoincareSearch
        Whose crossings are compared with those of the orbits: the upward crossings of the signal it watches.
    orbits : list of Orbit
        Known from the start; further ones are appended to it.
    """

    def __init__(self, search: PoincareSearch, orbits: list[Orbit]):
        self.search, self.orbits = search, orbits
        # a crossing tells nothing where the state is a history, or crossings are looked for among samples
        self._comparable = not search.tight and not getattr(search.parts, "dt", 0)
        self._crossings: dict[int, tuple[np.ndarray, np.ndarray]] = {}

    def kept(self, orbit: Orbit | None) -> Orbit | None:
        """Return the known orbit that this one is, or the orbit itself, now known."""
        if orbit is None:
            return None
        for known in self.orbits:
            if orbit.same_as(known, SAME_ORBIT if orbit.status.ok else SAME_ROUGHLY):
                return known
        self.orbits.append(orbit)
        return orbit

    def approached(self, crossings: list[Crossing]) -> Orbit | None:
        """Return the stable orbit that the last crossings approach and have almost reached; or None."""
        if len(crossings) <= APPROACHING:
            return None
        for orbit in self.orbits:
            if orbit.stable and self._distance(orbit, crossings[-1]) < REACHED:
                apart = [self._distance(orbit, crossing) for crossing in crossings[-APPROACHING:]]
                if all(b < a for a, b in pairwise(apart)):
                    return orbit
        return None

    def repeated(self, crossings: list[Crossing]) -> Orbit | None:
        """Return the orbit that repeating crossings are on; None if it is not known."""
        if len(crossings) < 2:
            return None
        for orbit in self.orbits:
            if not orbit.status.ok:
                continue
            count = len(self._of(orbit)[0])
            if not count or len(crossings) <= count:
                continue
            elapsed = crossings[-1].time - crossings[-1 - count].time
            if abs(elapsed / orbit.period - 1) < ON and self._distance(orbit, crossings[-1]) < REACHED:
                return orbit
        return None

    def beside(self, crossing: Crossing) -> Orbit | None:
        """Return the unstable orbit that a crossing is beside; or None."""
        for orbit in self.orbits:
            if orbit.stable is False and self._distance(orbit, crossing) < REACHED_UNSTABLE:
                return orbit
        return None

    def ending(self, crossings: list[Crossing]) -> str:
        """Fate of crossings that end on a known orbit, empty for others; `decided` of a search asks it."""
        return CYCLES if self.approached(crossings) is not None else ""

    def reached(self, trajectory: Trajectory) -> Orbit | None:
        """Return the known orbit that a trajectory has ended on; None for any other."""
        if trajectory.fate != CYCLES:
            return None
        return self.approached(trajectory.crossings) or self.repeated(trajectory.crossings)

    def _distance(self, orbit: Orbit, crossing: Crossing) -> float:
        """Largest difference of a state from those of the orbit at its nearest crossing, in its sizes."""
        states, size = self._of(orbit)
        if not len(states) or not self._comparable:
            return np.inf
        return float((np.abs(states - crossing.state) / size).max(axis=1).min())

    def _of(self, orbit: Orbit):
        """States of an orbit where the signal watched passes zero upwards, and the size of each state."""
        found = self._crossings.get(id(orbit))
        if found is None:
            states = np.asarray(orbit.states)
            size = np.maximum(np.abs(states).max(axis=1), ORBIT_SIZE * self.search.units)
            y = np.asarray(orbit.outputs)[self.search.row]
            ups = upward_crossings(y)
            share = y[ups] / (y[ups] - y[ups + 1])
            met = states[:, ups] + share * (states[:, ups + 1] - states[:, ups])
            found = self._crossings[id(orbit)] = (met.T, size)
        return found
