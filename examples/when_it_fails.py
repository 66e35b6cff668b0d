r"""
When is the prediction wrong, and how does one see it beforehand?
=================================================================

**Problem.** The drive with play of :doc:`backlash_drive`, with hard steel instead of soft: impacts keep 0.8
of the relative speed. Everything else is the same. Is the prediction as good?

.. code-block:: text

    r = 0 --->( + )---[ PID ]---F--->[ motor | gap | load ]---+---> x
               - ^                                            |
                 +--------------------------------------------+

**Equations.** As there, with :math:`\varepsilon = 0.8`.

**Method.** Read the grade and the error bands of the prediction; then compute the exact orbit.
"""

import matplotlib.pyplot as plt
import numpy as np

import ctrl_df as cdf

drive = cdf.backlash_masses(motor_mass=1, load_mass=8, gap=0.018, restitution=0.8)
pid = cdf.pid(1800, 19500, 100)
resp = cdf.describing_function_response(pid, drive, np.geomspace(6, 30, 14), np.geomspace(80, 200, 14))
cycle = max(resp.limit_cycles, key=lambda c: c.omega)
print(f"predicted: {cycle.omega:.2f} rad/s, force {cycle.amplitude:.2f} N: {cycle.grade}")
print(f"  why: {cycle.why}")

# %%
# Three warnings before any simulation: the grade, the harmonics fed back, the error band.

assert cycle.grade == "unreliable"
print(f"harmonics fed back: {100 * cycle.distortion:.0f} % of the fundamental")
print(f"band of omega: {cycle.omega_band[0]:.0f} to {cycle.omega_band[1]:.0f} rad/s")

# %%
# **Result.** The exact orbit is a rattle of the motor within the gap, two impacts a period, a quarter
# faster than predicted.

orbit = cdf.find_limit_cycle(cdf.closed_loop(pid, drive), guess=cycle)
print(f"exact: {orbit.omega:.6f} rad/s, force {orbit.amplitude:.4f} N, multiplier {orbit.multiplier:.5f}")
orbit.plot()

# %%
# A multiplier this near to one also says that the rattle is reached slowly: minutes of irregular motion
# come first. Fig. 10 of the paper shows those.
#
# **Check.** The frequency against one computed by other code; the truth within the stated band.

assert abs(orbit.omega - 156.045031) < 1e-5
assert cycle.omega_band[0] < orbit.omega < cycle.omega_band[1]
print(f"error of the prediction: {100 * (cycle.omega / orbit.omega - 1):+.0f} %")
plt.show()
