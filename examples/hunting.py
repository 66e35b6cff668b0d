r"""
Why does my axis hunt, when theory says it should not?
======================================================

**Problem.** A mass of 9 kg with Coulomb friction of 5 N under a PID controller with much integral action.
At standstill the integral winds up until the force exceeds the *static* level; the mass jumps, overshoots,
sticks again. How little static friction is enough?

.. code-block:: text

    r = 0 --->( + )---[ kp + ki/s + kd s ]---F--->[ 9 kg, friction ]---+---> x
               - ^                                                     |
                 +-----------------------------------------------------+

**Equations.** With the static level :math:`K_s` and the kinetic level K,

.. math::

    M \dot v = F - B v - K \operatorname{sign} v \quad (v \ne 0), \qquad
    \dot v = 0 \quad \text{while } v = 0 \text{ and } |F| \le K_s .

**Method.** The exact periodic motion, found without a guess: the loop is simulated from displacements of many
sizes, and the motion to which it settles is refined by Newton's method.
"""

import matplotlib.pyplot as plt
import numpy as np

import ctrl_df as cdf

pid = cdf.pid(2000, 44250, 130)
exact = {}
for static in (5.25, 5.5, 5.75):
    plant = cdf.friction_mass(mass=9, coulomb=5, viscous=0.5, static=static)
    exact[static] = orbit = cdf.find_limit_cycle(cdf.closed_loop(pid, plant))
    stable = "stable" if orbit.stable else "unstable"
    print(f"static {static:4.2f} N: hunts at {orbit.omega:.6f} rad/s, {1e3 * orbit.peak:.3f} mm, {stable}")

exact[5.5].plot()

# %%
# **Result.** Five per cent between static and kinetic friction are enough. The describing function predicts
# 13.06 to 13.13 rad/s for all three, and the same 13.05 rad/s without any stiction, where there is no such
# motion at all: it averages over a whole period, in which the short instant of breakaway counts little.

for static in (5.0, 5.25, 5.5, 5.75):
    plant = cdf.friction_mass(mass=9, coulomb=5, viscous=0.5, static=static)
    resp = cdf.describing_function_response(pid, plant, np.geomspace(5.8, 30, 20), np.geomspace(8, 40, 30))
    print(f"static {static:4.2f} N: predicted {min(c.omega for c in resp.limit_cycles):.2f} rad/s")

# %%
# **Check.** The frequencies against those of other code (maps from one breakaway to the next, integrated
# apart):

assert abs(exact[5.25].omega - 8.600097) < 1e-5
assert abs(exact[5.5].omega - 11.628680) < 1e-5
assert abs(exact[5.75].omega - 13.175267) < 1e-5
assert all(orbit.stable for orbit in exact.values())
plt.show()
