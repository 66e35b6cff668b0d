r"""
An amplifier that saturates and an axis with friction: two nonlinearities in one loop
=====================================================================================

**Problem.** Textbooks give describing functions of one nonlinearity. Here a saturating amplifier, a slow
motor and an axis with friction follow each other. Does the loop oscillate?

.. code-block:: text

    0 --->( + )---[ PD ]---u--->[ 60 N at most ]---[ motor, 40 ms ]---F--->[ 9 kg, friction ]---+---> x
           - ^                                                                                  |
             +----------------------------------------------------------------------------------+

**Equations.** :math:`\tau^2 \ddot F + 2 \tau \dot F + F = \operatorname{sat}_{60} u`,
:math:`M \dot v = F - B v - K \operatorname{sign} v`.

**Method.** Connect the parts by ``ct.interconnect``; the whole is one block with one describing function,
computed from its periodic responses.
"""

import control as ct
import matplotlib.pyplot as plt
import numpy as np

import ctrl_df as cdf

amplifier = cdf.saturation(60.0, name="amplifier")
motor = ct.ss(ct.tf([1], [0.04**2, 2 * 0.04, 1]), name="motor", inputs="u", outputs="F")
axis = cdf.friction_mass(mass=9, coulomb=5, viscous=0.5, name="axis")
drive = ct.interconnect(
    [amplifier, motor, axis],
    connections=[["motor.u", "amplifier.y"], ["axis.F", "motor.F"]],
    inplist=["amplifier.u"],
    inputs=["command"],
    outlist=["axis.x", "axis.v"],
    outputs=["x", "v"],
    name="drive",
)

pd = cdf.pid(2000, 0, 130)
resp = cdf.describing_function_response(pd, drive, np.geomspace(5.6, 1000, 60), np.geomspace(4, 40, 60))
for cycle in resp.limit_cycles:
    print(f"{cycle.amplitude:6.1f} N at {cycle.omega:6.3f} rad/s, stable: {cycle.stable}, {cycle.grade}")
plane = resp.plot(point_label="%.4g N @ %.4g rad/s").axes[0, 0]
plane.set(xlabel="Real part [N/m]", ylabel="Imaginary part [N/m]")

# %%
# **Result.** Two cycles: an unstable one (friction damps smaller motions) and a stable one (the amplifier
# bounds it). The large one is graded unreliable, and the exact orbit is half as large again:

check = cdf.verify(resp)
large = next(row for row in check if row.exact is not None and row.exact.stable)
print(
    f"exact: {large.exact.amplitude:.1f} N at {large.exact.omega:.4f} rad/s, "
    f"multiplier {large.exact.multiplier:.3f}"
)
title = f"stable limit cycle, {large.exact.omega:.5g} rad/s, {large.exact.peak:.4g} m"
output, command, portrait = large.exact.plot(title=title).axes.ravel()
output.set_ylabel("x [m]")
command.set_ylabel("command [N]")
portrait.set(xlabel="command [N]", ylabel="rate of command [N/s]")

# %%
# **Check.** The loop simulated from displacements on either side of the small cycle, predicted at 10.6 mm:

loop = cdf.closed_loop(pd, drive)
place = next(k for k, name in enumerate(loop.state_labels) if name.endswith("axis_x"))
t = np.linspace(0, 40, 20_001)
ends = {}
for push in (5e-3, 40e-3):
    start = np.zeros(loop.nstates)
    start[place] = push
    x = np.asarray(cdf.event_response(loop, t, 0, start).outputs)[0]
    ends[push] = float(np.abs(x[t > 30]).max())
    print(f"pushed by {1e3 * push:.0f} mm: ends at {1e3 * ends[push]:.1f} mm")
assert ends[5e-3] < 2.6e-3  # within what friction holds
assert abs(ends[40e-3] / large.exact.peak - 1) < 0.01
plt.show()
