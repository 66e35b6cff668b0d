"""What a loop does from starts of many sizes, and what stands between starts of different fate."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from ...thresholds import NOTHING
from .known_orbits import KnownOrbits
from .orbit import Orbit
from .poincare import CYCLES, DIVERGES, RESTS, UNDECIDED, PoincareSearch, Trajectory
from .thresholds import (
    CLOSED_AFTER,
    CROSSINGS,
    EDGE_HALVINGS,
    FACTORS,
    LINGERING,
    LINGERS,
    WIDTH,
    WIND_UP_LEAST,
)


@dataclass(frozen=True)
class Start:
    """One start and what the loop does from it.

    Attributes
    ----------
    size : float
        Displacement at rest [m], or amplitude at the input of an element.
    fate : str
        ``rests`` (or slows down without end, each period longer than the last by a steady ratio), ``cycles``,
        ``diverges``, or ``undecided`` within the bound on work.
    orbit : Orbit or None
        The one it cycles on.
    growth : float
        Ratio of the amplitudes in the last quarter of the trajectory to those in the quarter before.
    wind_up : float
        Factor by which the controller's integral outgrew the block's output, where it did; else 1.
    """

    size: float
    fate: str
    orbit: Orbit | None = None
    growth: float = float("nan")
    wind_up: float = 1.0

    @property
    def told(self) -> str:
        """The fate in words."""
        if self.fate == CYCLES and self.orbit is not None:
            return f"cycles at {self.orbit.omega:.5g} rad/s, amplitude {self.orbit.amplitude:.5g}"
        if self.fate == DIVERGES:
            return "diverges" + (", the controller's integral winding up" if self.wind_up > 1 else "")
        return {RESTS: "comes to rest"}.get(self.fate, "has not settled by the end of the simulation")


@dataclass(frozen=True)
class Border:
    """Two sizes of start, as near as simulations tell, with different fates.

    Attributes
    ----------
    below, above : float
        Sizes on either side.
    fates : tuple of str
        Below and above.
    orbit : Orbit or None
        The unstable orbit on the border, if one was closed.
    """

    below: float
    above: float
    fates: tuple[str, str]
    orbit: Orbit | None = None


@dataclass(frozen=True, eq=False)
class Fate:
    """What a loop does from the starts tried, a row a start, by size.

    Attributes
    ----------
    rows : tuple of Start
    borders : tuple of Border
        Where the fate changes along the starts: the size of the regions of attraction, as far as these starts
        show it.
    unit : str
        Of the sizes.
    orbits : list of Orbit
        All that were met, those on borders last.
    """

    rows: tuple[Start, ...] = ()
    borders: tuple[Border, ...] = ()
    unit: str = ""
    orbits: list[Orbit] = field(default_factory=list, repr=False)

    def __iter__(self):
        return iter(self.rows)

    def __len__(self) -> int:
        return len(self.rows)

    def _of(self, fate):
        return tuple(row for row in self.rows if row.fate == fate)

    @property
    def rests(self) -> tuple[Start, ...]:
        """Starts from which the loop comes to rest."""
        return self._of(RESTS)

    @property
    def cycles(self) -> tuple[Start, ...]:
        """Starts from which it ends on a cycle."""
        return self._of(CYCLES)

    @property
    def diverges(self) -> tuple[Start, ...]:
        """Starts from which it grows without end."""
        return self._of(DIVERGES)

    def __str__(self) -> str:
        """Return a sentence: what the loop does from which starts."""
        if not self.rows:
            return "no simulation was made"
        runs: list[list[Start]] = []
        for row in self.rows:
            same = runs and runs[-1][-1].told == row.told
            if same:
                runs[-1].append(row)
            else:
                runs.append([row])
        parts = []
        for run in runs:
            low, high = run[0].size, run[-1].size
            sizes = f"{low:.3g}" if low == high else f"{low:.3g} to {high:.3g}"
            parts.append(f"{run[0].told} from {sizes}")
        text = (
            f"from starts of {self.rows[0].size:.3g} to {self.rows[-1].size:.3g} {self.unit} the loop "
            + "; ".join(parts)
        )
        for border in self.borders:
            text += f"; the border lies at a start of {0.5 * (border.below + border.above):.4g} {self.unit}"
        return text


class Explorer:
    """Simulations of one loop from starts of many sizes.

    Parameters
    ----------
    search : PoincareSearch
    close : callable
        ``close(x0, trajectory, complete) -> Orbit or None``: the orbit that a trajectory comes near.
    """

    def __init__(self, search: PoincareSearch, close: Callable):
        self.search, self.close = search, close

    def explore(self, longest=None, edges=True, known: KnownOrbits | None = None, factors=FACTORS) -> Fate:
        """Simulate every start; with `edges` close in on the borders between starts of different fate.

        `factors` are the sizes of the starts, in units of that at which the block's nonlinearity matters.

        Starts whose trajectory ends on an orbit of `known` are not followed to its end, nor closed again.
        """
        starts, met = self.search.starts, []
        known = KnownOrbits(self.search, []) if known is None else known
        rows = []
        for size, x0 in starts.all(factors):
            trajectory = self.search.iterate(x0, CROSSINGS, longest, decided=known.ending)
            orbit = known.reached(trajectory) or known.kept(self.close(x0, trajectory, True))
            rows.append(self._row(size, trajectory, orbit, x0))
            _append_new(met, orbit)
        rows.sort(key=lambda row: row.size)
        borders = []
        if edges:
            for low, high in zip(rows[:-1], rows[1:], strict=True):
                if low.fate != high.fate and UNDECIDED not in (low.fate, high.fate):
                    borders.append(self._border(low, high, longest, known))
                    _append_new(met, borders[-1].orbit)
        return Fate(tuple(rows), tuple(borders), starts.unit, met)

    def _row(self, size, trajectory, orbit, x0) -> Start:
        fate = trajectory.fate
        if orbit is not None and orbit.stable is not False and fate == UNDECIDED:
            fate = CYCLES
        elif fate == CYCLES and orbit is None:
            fate = UNDECIDED
        on = orbit if fate == CYCLES else None
        return Start(
            size, fate, on, trajectory.growth, self._wind_up(trajectory, x0) if fate == DIVERGES else 1.0
        )

    def _wind_up(self, trajectory, x0) -> float:
        """Factor by which controller states outgrew the block's during a divergence; 1 where they did not."""
        nc = self.search.loop.syslist[0].nstates or 0 if self.search.parts is not None else 0
        core = self.search.starts.core
        if not nc or core is None or not trajectory.crossings:
            return 1.0
        if not any(getattr(e, "corners", ()) for e, _ in core.input_channel):
            return 1.0
        gains = np.abs(trajectory.end) / self.search.units
        return float(max(gains[:nc].max() / max(gains[nc:].max(), NOTHING), 1.0 + WIND_UP_LEAST))

    def _border(self, low: Start, high: Start, longest, known) -> Border:
        below, above, fates, orbit = low.size, high.size, (low.fate, high.fate), None
        for count in range(1, EDGE_HALVINGS + 1):
            if orbit is not None and above < (1 + WIDTH) * below:
                break
            middle = float(np.sqrt(below * above))
            if not below < middle < above:
                break
            x0 = self.search.starts.state(middle)
            trajectory = self.search.iterate(x0, CROSSINGS, longest, decided=known.ending)
            if trajectory.fate == fates[0]:
                below = middle
            elif trajectory.fate == fates[1]:
                above = middle
            else:
                break
            if orbit is None and count in CLOSED_AFTER:
                orbit = self._slowest(x0, trajectory, known)
        return Border(below, above, fates, orbit)

    def _slowest(self, x0, trajectory: Trajectory, known) -> Orbit | None:
        """Unstable orbit near which a trajectory lingers: its crossings change least there."""
        crossings = trajectory.crossings
        if len(crossings) < 4:
            return None
        change = [
            float(np.max(np.abs(b.state - a.state) / self.search.units) / max(b.peak, NOTHING))
            for a, b in zip(crossings[:-1], crossings[1:], strict=True)
        ]
        k = int(np.argmin(change))
        orbit = known.beside(crossings[k])
        if orbit is not None or change[k] > LINGERS:
            return orbit
        near = crossings[max(k + 2 - LINGERING, 0) : k + 2]
        padded = [near[0]] * (LINGERING - len(near)) + near
        orbit = self.close(x0, Trajectory(padded, UNDECIDED, 1.0, trajectory.end), False)
        return known.kept(orbit) if orbit is not None and orbit.stable is False else None


def _append_new(orbits, orbit):
    """Append an orbit to those met, unless it is among them."""
    if orbit is not None and not any(orbit is other for other in orbits):
        orbits.append(orbit)
