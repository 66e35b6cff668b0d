r"""
How do I add physics that the library does not have?
====================================================

**Problem.** A carriage of 2 kg on a spring is slowed by a magnetic brake. Its drag grows with speed, has
its greatest value at a critical speed and falls again. No effect of the library does that.

**Equations.**

.. math:: F_\text{brake} = -2 P \, \frac{v/v_c}{1 + (v/v_c)^2}

**Method.** One class says it all: parameters with units, the role, the law. From then on it is an effect as
any other: simulated, described, fitted, diagnosed.
"""

from dataclasses import dataclass
from typing import ClassVar

import matplotlib.pyplot as plt
import numpy as np
from scipy.integrate import solve_ivp

import ctrl_df as cdf


@cdf.register_effect
@dataclass(frozen=True)
class EddyBrake(cdf.Effect):
    """Drag ``F = -2 peak (v/vc) / (1 + (v/vc)^2)``."""

    peak: float = cdf.parameter("N", meaning="greatest drag")
    velocity: float = cdf.parameter("m/s", strict=True, default=0.1, meaning="speed of the greatest drag")

    role: ClassVar[str] = "force"
    shows: ClassVar[str] = "drag that falls again at high speed"
    source: ClassVar[str] = "Smythe (1942)"

    @staticmethod
    def law(t, x, v, z, p, dz):
        ratio = v / p[1]
        return -2.0 * p[0] * ratio / (1.0 + ratio * ratio)


# %%
# The answer to sines of three amplitudes, over frequency:

block = cdf.Mass(2.0).with_effect(EddyBrake(3.0, velocity=0.1)).with_effect(cdf.LinearSpring(200.0))
family = cdf.describing_function_family(block, np.array([2.0, 4.0, 8.0]), np.geomspace(4, 20, 9))
print(family)
N = cdf.describing_function(block, 4.0, 8.0)
print(f"N(4 N, 8 rad/s) = {N:.6e} m/N")
family.plot()

# %%
# **Check.** A way that shares nothing with the engine: let SciPy integrate 200 periods, so that the start
# is forgotten, and take the fundamental.

omega, a = 8.0, 4.0
period = 2 * np.pi / omega


def rates(t, x):
    ratio = x[1] / 0.1
    return [x[1], (a * np.cos(omega * t) - 200 * x[0] - 6 * ratio / (1 + ratio**2)) / 2]


t = np.linspace(200 * period, 201 * period, 2049)
x = solve_ivp(rates, (0, t[-1]), [0, 0], "DOP853", t, rtol=1e-10, atol=1e-13).y[0]
brute = 2 / a * np.mean((x * np.exp(-1j * omega * t))[:-1])
print(f"difference from brute force: {abs(N / brute - 1):.1e}")
assert abs(N / brute - 1) < 1e-6
plt.show()
