"""The steady-state response of a block with dynamics to a waveform of more than its fundamental."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from ...blocks.mechanism import Mechanism
from ...blocks.transparent import without_delays
from ...simulate.engine import Engine
from ...simulate.program import layout
from ..thresholds import WAVE_PERIODS, WAVE_PERIODS_GAP, WAVE_PERIODS_MORE
from .damped import close_damped
from .orbit_search import OrbitSearch, OutOfWork

# Steps, delays and samplers answer small changes of the state with none, later, or at their ticks: no Newton.
_UNSUITED = (layout.QUANTIZER, layout.DELAY, layout.SAMPLED)


class PeriodicResponse:
    """Forced periodic motions of one block, each started from the one before.

    Under one force there may be several. Who follows one of them keeps `motion` and sets it again before
    going on from another point; without one, several starts are tried.

    Parameters
    ----------
    block : ct.NonlinearIOSystem
    output : str
        Output described.
    max_steps : int
        Bound on the work of one motion, in integration steps.

    Attributes
    ----------
    motion : State or None
        The motion last answered with, at t = 0.
    """

    def __init__(self, block, output, max_steps=60_000):
        self.motion = None
        self.core: Any = block.core if isinstance(block, Mechanism) else None
        inner = without_delays(block)[0] if self.core is not None else block
        suited = not np.isin(Engine(inner).program.nodes[:, layout.KIND], _UNSUITED).any()
        self.search: Any = OrbitSearch(block, output, max_steps=max_steps) if suited else None

    def __call__(self, U, omega: float):
        """Return Y_k, k < len(U), for the input ``Re sum U_k exp(j k omega t)``, or None."""
        return next(self._answers(U, omega), None)

    def nearest(self, U, omega: float, apart: Callable, near: float):
        """Return of the answers from all starts the one least ``apart(Y)``; the first one `near`."""
        self.motion, best, least = None, None, np.inf
        motion = None
        for Y in self._answers(U, omega):
            if apart(Y) < least:
                best, least, motion = Y, apart(Y), self.motion
            if least < near:
                break
            self.motion = None
        self.motion = motion
        return best

    def _answers(self, U, omega):
        U, search = np.asarray(U, dtype=complex), self.search
        if search is None:
            return
        search.aim(U, float(omega))
        search.mirrored = False
        for state, sought in self._starts():
            orbit = self._closed(state, U.size - 1, **sought)
            if orbit is not None:
                self.motion = orbit
                yield search.coefficients()

    def _starts(self) -> Iterator[tuple[Any, dict[str, Any]]]:
        """States to start from: the last motion; if there is none, rest, or a knock against a gap's faces."""
        search, core = self.search, self.core
        gap = 0.0 if core is None else core.gap
        if self.motion is not None:
            yield self.motion, dict(near=True)
            if gap > 0:  # any other start may lead to another motion
                yield self.motion, dict(periods=WAVE_PERIODS_GAP)
                return
        n = search.engine.nstates
        if core is None or gap == 0:
            for periods in (WAVE_PERIODS, WAVE_PERIODS_MORE):
                yield search.engine.start(np.zeros(n)), dict(periods=periods)
            return
        driven = search.A / (sum(core.masses) * search.omega)
        crossing = gap * search.omega / np.pi  # one gap in half a period: the two-impact motion
        for speed in (3.0 * driven, crossing, -crossing, 2.0 * crossing, -driven):
            x = np.zeros(n)
            x[2], x[3] = 0.5 * gap, speed
            yield search.engine.start(x), dict(periods=WAVE_PERIODS_GAP, far=True)

    def _closed(self, state, orders, periods=0, near=False, far=False):
        """Close an orbit, attracting or not, from where a state is after some periods; its state or None."""
        search = self.search
        try:
            if periods:
                search.resize(search.A)
                state = search.iterate(state, periods)
            orbit = search.periodic(state, orders=orders, repelling=True, near=near)
            if orbit is None and far:
                orbit = close_damped(search, state, orders=orders, patient=False, repelling=True)
        except OutOfWork:
            return None
        return None if orbit is None else orbit[0]
