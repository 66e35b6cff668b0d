r"""
At what gain does a saturating servo start to swing, and how far?
=================================================================

**Problem.** The gain of a third-order loop is 8, its critical gain 3: the linear loop is unstable. The
amplifier saturates at 1. How large does the oscillation grow?

.. code-block:: text

    0 --->( + )---[ saturation at 1 ]---u--->[ 8 / (s^3 + 2 s^2 + 2 s + 1) ]---+---> y
           - ^                                                                 |
             +-----------------------------------------------------------------+

**Equations.** N of a saturation falls from 1 as the amplitude grows. The loop swings where

.. math:: N(a)\, H(j\omega) = -1 .

The phase of H is -180 degrees at :math:`\sqrt 2` rad/s whatever the amplitude, where H is -8/3: N has to
come down to 3/8.
"""

import control as ct
import matplotlib.pyplot as plt
import numpy as np

import ctrl_df as cdf

H = ct.tf([8], [1, 2, 2, 1])
resp = cdf.describing_function_response(H, cdf.saturation(1), np.linspace(1, 5, 20))
cycle = resp.limit_cycles[0]
print(f"predicted: {cycle.amplitude:.6f} at {cycle.omega:.6f} rad/s ({cycle.grade})")

# %%
# -1/N leaves -1 to the left along the real axis and meets the Nyquist curve at -8/3:

resp.plot()

# %%
# **Result.** The clipped wave has a small third harmonic, which H attenuates 20-fold, so the exact orbit is
# near the prediction:

orbit = cdf.find_limit_cycle(cdf.closed_loop(H, cdf.saturation(1)), guess=cycle)
print(f"exact:     {orbit.amplitude:.6f} at {orbit.omega:.6f} rad/s, multiplier {orbit.multiplier:.4f}")

# %%
# **Check.** The prediction against the closed form, the orbit against a long integration by other code.

assert abs(cycle.omega - np.sqrt(2)) < 1e-9
assert abs(cycle.amplitude - 3.343998730) < 1e-7
assert abs(orbit.omega - 1.40670188630) < 1e-6  # DOP853 after long settling
plt.show()
