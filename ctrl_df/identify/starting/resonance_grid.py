"""Where an elastic joint may resonate: stiffness and share of load tried over the plane, starts fitted.

A joint is no small change of the model, and over short segments its free states follow anything: descents
that begin a factor away from the resonance end in other minima. Its frequency is what the cost knows most
about.
"""

from __future__ import annotations

import math

import numpy as np

from ..estimation.fit import FitResult
from ..prediction.sensed import sensed
from ..thresholds import GIVE_UP
from .extend import extended
from .screen import Screen
from .thresholds import (
    JOINT_DAMPING,
    JOINT_GAIN,
    JOINTS_TRIED,
    RESONANCE_SAMPLES,
    RESONANCE_STEP,
    RESONANCES,
)


def is_joint(cls, screen: Screen) -> bool:
    """Whether effects of a class divide the mass by an elastic joint."""
    return cls.from_spring(1.0, 1.0, 0.5, screen.scales.of) is not None


def rates(screen: Screen) -> np.ndarray:
    """Return the resonances tried [rad/s]: from about the rate of the motion to the fastest that shows.

    A joint is bent by the force over the mass, over the square of its resonance: more than the noise. (Of a
    velocity it is the rate of that.)
    """
    scales, (low, high) = screen.scales, RESONANCES
    motion = scales.speed / scales.position
    differentiated = sensed(screen.view.records[0]).columns[0]
    bent = (scales.force / scales.mass / screen.data.noise) ** (1 / (2 - differentiated))
    shown = min(bent, 2 * math.pi / (RESONANCE_SAMPLES * screen.motion.dt)) / motion
    steps = math.floor(math.log(max(high, shown) / low, RESONANCE_STEP) + 0.5)
    return low * motion * RESONANCE_STEP ** np.arange(steps + 1)


def resonating(cls, screen: Screen, share: float, count: int) -> list[FitResult]:
    """Return the baseline with the joints that fit best, as many as `count`: initial states alone fitted.

    `share`: of the mass, behind the joint; one of `LOAD_SHARES`. Initial states are all but linear: one step
    tells which joints to look at again.
    """
    scales, found, give_up = screen.scales, [], GIVE_UP * screen.base.rmse
    reduced = share * (1 - share) * scales.mass
    for rate in rates(screen):
        stiffness, damping = reduced * rate**2, 2 * JOINT_DAMPING * reduced * rate
        joint = cls.from_spring(stiffness, damping, share, scales.of)
        block = None if joint is None else extended(screen.block, joint)
        if block is not None:
            found.append(screen.data.fit(block, (), iterations=1, give_up=give_up, restarts=False))
    near = sorted(found, key=lambda f: f.rmse)[:JOINTS_TRIED]
    again = [
        screen.data.fit(f.model, (), starts=f.starts, iterations=2, tolerance=JOINT_GAIN, give_up=give_up)
        for f in near
    ]
    return sorted(again, key=lambda f: f.rmse)[:count]
