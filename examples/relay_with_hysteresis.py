r"""
How much does the describing function miss for a thermostat?
============================================================

**Problem.** A relay with hysteresis drives an integrator with a lag. How far off is the predicted
oscillation?

.. code-block:: text

    0 --->( + )---[ relay, hysteresis 0.1 ]---u--->[ 1 / (s (s + 1)) ]---+---> y
           - ^                                                           |
             +-----------------------------------------------------------+

**Equations.** The relay's output is a square wave whatever the loop does, so that the exact frequency
follows from one equation (Tsypkin): at the instant of switching up the input stands at the hysteresis h,

.. math:: -\frac{4 L}{\pi} \sum_{k = 1, 3, \dots} \frac{\operatorname{Im} H(j k \omega)}{k} = h .

**Method.** Three ways: Tsypkin's equation, the describing function, the exact orbit.
"""

import control as ct
import matplotlib.pyplot as plt
import numpy as np
from scipy.optimize import brentq

import ctrl_df as cdf

H, level, hysteresis = ct.tf([1], [1, 1, 0]), 1.0, 0.1
k = np.arange(1, 20_001, 2)


def excess(omega):
    return -4 * level / np.pi * np.sum(np.imag(H(1j * k * omega)) / k) - hysteresis


tsypkin = brentq(excess, 0.5, 10)
print(f"Tsypkin:             {tsypkin:.6f} rad/s")

# %%
relay = cdf.relay_with_hysteresis(level, hysteresis)
resp = cdf.describing_function_response(H, relay, np.geomspace(0.11, 1, 20))
cycle = resp.limit_cycles[0]
low, high = cycle.omega_band
print(f"describing function: {cycle.omega:.6f} rad/s, band {low:.4f} to {high:.4f}")
resp.plot(max_curve_magnitude=0.8)  # of the Nyquist curve what is near the crossing

# %%
orbit = cdf.find_limit_cycle(cdf.closed_loop(H, relay), guess=cycle)
print(f"exact orbit:         {orbit.omega:.6f} rad/s, {'stable' if orbit.stable else 'unstable'}")
orbit.plot()

# %%
# **Result.** The square wave's harmonics are fed back through a plant that attenuates them by 9 or more: the
# prediction is off by less than the band it states.
#
# **Check.** The orbit against Tsypkin's equation:

error = cycle.omega / tsypkin - 1
print(f"error of the describing function: {100 * error:+.2f} %")
assert abs(orbit.omega / tsypkin - 1) < 1e-6
assert cycle.omega_band[0] < tsypkin < cycle.omega_band[1]
plt.show()
