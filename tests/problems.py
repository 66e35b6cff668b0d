"""Named problems with exact answers and where those come from.

``Problem.cycle`` is the exact cycle (fundamental amplitude at the block's input, frequency); None where
there is none near the prediction. ``Problem.predicted`` is the describing function's own exact solution
where it is known.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import control as ct
import numpy as np
from scipy.optimize import brentq

from ctrl_df.blocks.elements.hysteresis import relay_with_hysteresis
from ctrl_df.blocks.elements.memoryless import relay, saturation
from ctrl_df.blocks.mechanism import backlash_masses, friction_mass
from ctrl_df.blocks.pid import pid


@dataclass(frozen=True)
class Problem:
    """A loop, the box to search, the describing function's answer and the true one."""

    name: str
    H: Any
    block: Any
    A: Any
    omega: Any = None
    predicted: tuple[float, float] | None = None
    cycle: tuple[float, float] | None = None
    stable: bool | None = None
    source: str = field(kw_only=True)


def tsypkin_relay(H, level=1.0, hysteresis=0.0, low=0.05, high=50.0, harmonics=20_001):
    """Exact symmetric cycle of a relay loop: (fundamental amplitude, omega), by Tsypkin's condition.

    The relay's output is a square wave, so the loop's signal is known but for omega. At the upward
    switching, t = 0, the relay's input equals the hysteresis: -(4 level/pi) sum over odd k of Im H(jk
    omega)/k = hysteresis.
    """
    k = np.arange(1, harmonics, 2)

    def excess(omega):
        return -4 * level / math.pi * (np.imag(H(1j * k * omega)) / k).sum() - hysteresis

    grid = np.geomspace(low, high, 60)
    values = np.array([excess(w) for w in grid])
    change = np.nonzero(np.sign(values[1:]) != np.sign(values[:-1]))[0]
    if not change.size:
        return None
    omega = brentq(excess, grid[change[-1]], grid[change[-1] + 1], xtol=1e-12)
    return 4 * level / math.pi * abs(H(1j * omega)), omega


_THIRD = ct.tf([8], [1, 2, 2, 1])
_SERVO = ct.tf([20], [1, 3, 2, 0])
_RELAY = ct.tf([1], [1, 2, 1, 0])
_LAG = ct.tf([1], [1, 1, 0])

PROBLEMS = [
    Problem(
        "saturation, third order",
        _THIRD,
        saturation(1),
        np.linspace(1, 4, 10),
        predicted=(3.343998730206496, math.sqrt(2)),  # H(j sqrt 2) = -8/3, so N = 3/8
        cycle=(3.39494014929, 1.40670188630),
        stable=True,
        source="DOP853, rtol 1e-12, after 20 periods of settling",
    ),
    Problem(
        "saturation, servo above its critical gain 6",
        _SERVO,
        saturation(1),
        np.geomspace(1, 10, 20),
        cycle=(4.37665557144, 1.38692646218),
        stable=True,
        source="DOP853, rtol 1e-12, after 20 periods of settling",
    ),
    Problem(
        "saturation, servo below its critical gain",
        ct.tf([5.9], [1, 3, 2, 0]),
        saturation(1),
        np.geomspace(0.5, 10, 20),
        source="Routh: the linear loop is stable up to a gain of 6 and saturation only lowers it",
    ),
    Problem(
        "relay, integrator and double lag",
        _RELAY,
        relay(1),
        np.geomspace(0.05, 5, 20),
        predicted=(2 / math.pi, 1.0),  # H(j) = -1/2, N = 4/(pi a)
        cycle=tsypkin_relay(_RELAY),
        stable=True,
        source="Tsypkin (1984)",
    ),
    Problem(
        "relay with hysteresis, integrator and lag",
        _LAG,
        relay_with_hysteresis(1, 0.1),
        np.geomspace(0.05, 5, 20),
        cycle=tsypkin_relay(_LAG, hysteresis=0.1),
        stable=True,
        source="Tsypkin (1984)",
    ),
    Problem(
        "relay with hysteresis, first-order plant",  # has a cycle, T = 2 ln((1 + h)/(1 - h)), that N misses
        ct.tf([1], [1, 1]),
        relay_with_hysteresis(1, 0.1),
        np.geomspace(0.05, 5, 20),
        source="the Nyquist curve stays in the fourth quadrant, -1/N in the third",
    ),
    Problem(
        "friction mass under PID",
        pid(2000, 44250, 130),
        friction_mass(9, 5, 0.5),
        np.geomspace(5.5, 40, 30),
        omega=np.geomspace(5, 40, 30),
        predicted=(11.082170, 13.898109),
        cycle=(10.850004, 13.792124),
        stable=False,
        source="event-located shooting",
    ),
    Problem(
        "friction mass with stiction 5.5 under PID",
        pid(2000, 44250, 130),
        friction_mass(9, 5, 0.5, 5.5),
        np.geomspace(5.6, 10.5, 30),
        omega=np.geomspace(5, 40, 30),
        cycle=(math.nan, 11.628680),
        stable=True,
        source="event-located shooting",
    ),
    Problem(
        "backlash, restitution 0.2, under PID",
        pid(1800, 19500, 100),
        backlash_masses(1, 8, 0.018, 0.2),
        np.geomspace(5, 60, 30),
        omega=np.geomspace(8, 40, 30),
        predicted=(17.750443, 14.844564),
        cycle=(20.459998, 14.733968),
        stable=True,
        source="event-located shooting",
    ),
    Problem(
        "backlash, restitution 0.8, under PID",
        pid(1800, 19500, 100),
        backlash_masses(1, 8, 0.018, 0.8),
        np.geomspace(8, 13, 12),
        omega=np.geomspace(100, 160, 12),
        predicted=(10.278, 125.754),
        cycle=(12.717699, 156.045031),
        stable=True,
        source="event-located shooting",
    ),
]
