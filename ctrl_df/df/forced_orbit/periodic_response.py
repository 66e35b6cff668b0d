"""The steady-state response of a block with dynamics to a waveform of more than its fundamental."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...blocks.mechanism import Mechanism
from ...simulate.engine import Engine, State
from ...simulate.program import layout
from ..thresholds import (
    RTOL_FOLLOWED,
    WAVE_PERIODS,
    WAVE_PERIODS_GAP,
    WAVE_PERIODS_MORE,
    WAVE_STARTS,
    WAVE_STEPS,
)
from ..transparent import without_delays
from .damped import close_damped
from .driven_block import DrivenBlock, Laws
from .forced_map import Force, ForcedMap, OutOfWork, Work
from .fourier import shifted
from .orbit_search import ClosedOrbit, close_orbit

# Steps, delays and samplers respond to small changes of the state not at all, later, or at their ticks.
_UNSUITED = (layout.QUANTIZER, layout.DELAY, layout.SAMPLED)


@dataclass(frozen=True, eq=False)
class ForcedState:
    """A forced periodic motion: its state at t = 0, and the laws for motions of its size."""

    state: State
    laws: Laws


class PeriodicResponse:
    """Forced periodic motions of one block.

    Under one force there may be several. Who follows one of them passes on the motion that the last answer
    came with; without one, several starts are tried.

    Parameters
    ----------
    block : ct.NonlinearIOSystem
    output : str
        Output described.
    max_steps : int
        Bound on the work of one motion, in integration steps.
    """

    def __init__(self, block, output, max_steps=WAVE_STEPS):
        self.max_steps = max_steps
        self.core: Any = block.core if isinstance(block, Mechanism) else None
        inner = without_delays(block)[0] if self.core is not None else block
        suited = not np.isin(Engine(inner).program.nodes[:, layout.KIND], _UNSUITED).any()
        self.block: Any = DrivenBlock(block, output) if suited else None

    def __call__(self, U, omega: float, motion: ForcedState | None = None):
        """Return Y_k, k < len(U), for the input ``Re sum U_k exp(j k omega t)``, and its motion.

        None and the motion given where there is no response.
        """
        return next(self._responses(U, omega, motion), (None, motion))

    def nearest(self, U, omega: float, apart: Callable, near: float):
        """Return of the responses from all starts the one least ``apart(Y)``; the first one `near`."""
        best, least = (None, None), np.inf
        for Y, motion in self._responses(U, omega, None):
            if apart(Y) < least:
                best, least = (Y, motion), apart(Y)
            if least < near:
                break
        return best

    def _responses(self, U, omega, motion):
        U, omega, block = np.asarray(U, dtype=complex), float(omega), self.block
        if block is None:
            return
        force = Force.of(U, omega)
        laws = block.laws_for(force.A, omega, None if motion is None else motion.laws)
        if motion is None or laws is not motion.laws:
            laws.reset()
        forced_map = ForcedMap(block, laws, force, Work(self.max_steps))
        for state, sought in self._starts(forced_map, motion):
            orbit = self._closed(forced_map, state, U.size - 1, **sought)
            if orbit is not None:
                y = orbit.coefficients(forced_map)
                offset = 0.0 if laws.free_row else block.offset
                yield shifted(y, omega, delay=block.delay, offset=offset), ForcedState(orbit.state, laws)

    def _starts(self, forced_map, motion) -> Iterator[tuple[Any, dict[str, Any]]]:
        """States to start from: a motion; without one, rest, or some speed between the faces of a gap."""
        core, engine = self.core, self.block.engine
        gap = 0.0 if core is None else core.gap
        if motion is not None:
            yield motion.state, dict(near=True)
            if gap > 0:  # any other start may lead to another motion
                yield motion.state, dict(periods=WAVE_PERIODS_GAP)
                return
        n = engine.nstates
        if core is None or gap == 0:
            for periods in (WAVE_PERIODS, WAVE_PERIODS_MORE):
                yield engine.start(np.zeros(n)), dict(periods=periods)
            return
        omega = forced_map.force.omega
        driven = forced_map.force.A / (sum(core.masses) * omega)
        crossing = gap * omega / np.pi  # one gap in half a period: the two-impact motion
        for of_driven, of_crossing in WAVE_STARTS:
            x = np.zeros(n)
            x[2], x[3] = 0.5 * gap, of_driven * driven + of_crossing * crossing
            yield engine.start(x), dict(periods=WAVE_PERIODS_GAP, far=True)

    def _closed(self, forced_map, state, orders, periods=0, near=False, far=False) -> ClosedOrbit | None:
        """Close an orbit, attracting or not, from where a state is after some periods."""
        try:
            if periods:
                forced_map.reset_sizes()
                state = forced_map.after(state, periods, RTOL_FOLLOWED)
            orbit, _ = close_orbit(forced_map, state, orders=orders, repelling=True, near=near)
            if orbit is None and far:
                orbit = close_damped(forced_map, state, orders=orders, patient=False, repelling=True)
        except OutOfWork:
            return None
        return orbit
