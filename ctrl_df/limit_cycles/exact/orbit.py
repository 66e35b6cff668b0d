"""An exact limit cycle as a value, and the result where none was found."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import control as ct
import numpy as np

from ...drawing import draw
from ...simulate.engine import Event
from ...status import Status
from ...table import Table
from .thresholds import SAME_ORBIT, SAME_SIZES


@dataclass(frozen=True, eq=False)
class Orbit:
    """A periodic orbit of a closed loop.

    Attributes
    ----------
    omega, period : float
        Fundamental frequency [rad/s] and period [s].
    amplitude : float
        Fundamental amplitude at the block's input (peak), of the signal the block sees: under a sampled
        controller that of the held steps, or, for a law without time, of the sequence of their values.
    output_amplitude : float
        Fundamental amplitude of the loop's first output.
    floquet : ndarray of complex
        Multipliers without the trivial ones (a shift in time, and of a position on which nothing depends),
        largest first; zeros where sticking or contact lose a direction.
    stable : bool or None
        All multipliers inside the unit circle; None where they are not known (sampled loops), or where one
        stands on the circle.
    residual : float
        Mismatch after one period relative to the size of the orbit, a drift of free positions left out.
    events : tuple of Event
        Those of one period, times from its start.
    status : Status
        CONVERGED, or why the figures are only estimates.
    grazing : float
        How transversally the events are crossed, from 1 to 0 (tangentially); near 0 the multipliers are not
        to be trusted.
    time, outputs, states : ndarray
        One period, sampled; outputs (ny, nt), states (n, nt).
    note : str
        Empty, or that the guess led to another orbit than the one it speaks of.

    Examples
    --------
    >>> axis = cdf.friction_mass(mass=9, coulomb=5, viscous=0.5, static=5.5)
    >>> orbit = cdf.find_limit_cycle(cdf.closed_loop(cdf.pid(2000, 44250, 130), axis), guess=(8.0, 11.6))
    >>> print(f"{orbit.period:.4f} s, {1e3 * orbit.peak:.3f} mm, multiplier {orbit.multiplier:.4f}")
    0.5403 s, 2.375 mm, multiplier 0.9875
    >>> [e.kind for e in orbit.events]
    ['stick', 'breakaway', 'stick', 'breakaway']
    """

    omega: float
    period: float
    amplitude: float
    output_amplitude: float
    floquet: np.ndarray
    stable: bool | None
    residual: float
    events: tuple[Event, ...] = field(repr=False)
    status: Status
    grazing: float
    time: np.ndarray = field(repr=False)
    outputs: np.ndarray = field(repr=False)
    states: np.ndarray = field(repr=False)
    loop: Any = field(repr=False, default=None)
    note: str = ""

    def __repr__(self) -> str:
        """Return amplitude, frequency and stability."""
        stable = {True: "stable", False: "unstable", None: "irregular"}[self.stable]
        return f"<Orbit: {self.amplitude:.7g} @ {self.omega:.7g} rad/s, {stable}>"

    @property
    def peak(self) -> float:
        """Half of the peak-to-peak value of the first output."""
        return float(np.ptp(self.outputs[0]) / 2)

    @property
    def multiplier(self) -> float:
        """Largest |Floquet multiplier|; nan if unknown, 0 if the orbit is all there is (one state)."""
        if not len(self.floquet):
            return float("nan") if self.stable is None else 0.0
        return float(np.max(np.abs(self.floquet)))

    def same_as(self, other: Orbit, tolerance: float = SAME_ORBIT) -> bool:
        """Whether two orbits are one, up to a shift in time."""
        return (
            abs(self.omega / other.omega - 1) < tolerance
            and abs(self.amplitude / other.amplitude - 1) < SAME_SIZES * tolerance
            and abs(self.output_amplitude / other.output_amplitude - 1) < SAME_SIZES * tolerance
        )

    def plot(self, **keywords) -> ct.ControlPlot:
        """Draw one period of outputs and the phase portrait."""
        return draw("orbit", self, **keywords)


class Try(NamedTuple):
    """Where an orbit was sought, and what came of it, in words."""

    start: str
    outcome: str


@dataclass(frozen=True, repr=False)
class NoOrbit:
    """The result of a search that found no periodic orbit; false as a truth value.

    Attributes
    ----------
    status : Status
        NOT_FOUND: nothing was reached, which proves nothing. NO_SUCH_ORBIT: the prediction was shown to
        belong to no orbit. CENTRE: motions of every size repeat, none of them a limit cycle.
    tried : tuple of Try
        Every start, and how it ended.
    proof : str
        Of NO_SUCH_ORBIT: what shows it, in a sentence.

    Examples
    --------
    >>> result = cdf.find_limit_cycle(cdf.closed_loop(cdf.pid(2000, 0, 130), cdf.friction_mass(9, 5)))
    >>> bool(result), {outcome for start, outcome in result.tried}
    (False, {'comes to rest'})
    """

    status: Status
    tried: tuple[Try, ...] = ()
    proof: str = ""

    def __bool__(self) -> bool:
        """Return False."""
        return False

    def __getattr__(self, name: str):
        """Say that there is no orbit to be asked."""
        if name.startswith("_"):
            raise AttributeError(name)
        raise AttributeError(f"no orbit was found, so there is no {name!r}; .status and .tried tell more")

    def __repr__(self) -> str:
        """Return the status and the number of tries."""
        return f"<NoOrbit: {self.status.name.lower().replace('_', ' ')}, {len(self.tried)} starts tried>"

    def _repr_html_(self) -> str:
        return Table(("no orbit found from", "what came of it"), self.tried)._repr_html_()

    def __str__(self) -> str:
        """Return the status, then a line for each try."""
        lines = [f"no orbit: {self.status}"]
        return "\n".join(lines + [f"  from {t.start}: {t.outcome}" for t in self.tried])
