"""Where an elastic joint may resonate: stiffness and share of load tried over the plane, starts fitted.

A joint is no small change of the model, and over short windows its free states follow anything: descents that
begin a factor away from the resonance end in other valleys. Its frequency is what the cost knows most about.
"""

from __future__ import annotations

import itertools

import numpy as np

from ..blocks.effects import Compliance
from .attach import attach
from .candidate import Candidate
from .screen import Screen

SHARES = (0.15, 0.35, 0.6, 0.85)
RATES = np.geomspace(1.5, 40.0, 12)
"""Resonances tried, over the rate of the motion (its speed over its stroke)."""

DAMPING = 0.1


def resonant(screen: Screen, count: int) -> list[Candidate]:
    """Return the baseline with the joints that fit best, their parameters as tried, initial states fitted."""
    scales, found = screen.scales, []
    for share, rate in itertools.product(SHARES, RATES * scales.speed / scales.position):
        reduced = share * (1 - share) * scales.mass
        stiffness = reduced * rate**2
        block = attach(screen.block, Compliance(stiffness, 2 * DAMPING * reduced * rate, share))
        if block is not None:
            found.append(screen.data.fit(block, (), iterations=3, tolerance=3e-2))
    return sorted(found, key=lambda f: f.rmse)[:count]
