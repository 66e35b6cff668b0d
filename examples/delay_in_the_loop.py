r"""
How much delay does a position loop tolerate?
=============================================

**Problem.** A drive of 9 kg with friction is controlled over a field bus: every command arrives late. The
amplifier gives 60 N at most. From which delay on does the loop oscillate, and is it the delay alone that
decides?

.. code-block:: text

    r = 0 --->( + )---[ kp + kd s ]---[ delay ]---[ 60 N at most ]--->[ 9 kg, friction ]---+---> x
               - ^                                                                        |
                 +------------------------------------------------------------------------+

**Equations.** :math:`F(t) = \operatorname{sat}_{60}\, c(t - \tau)`, :math:`c = -k_p x - k_d \dot x`,
:math:`M \dot v = F - B v - K \operatorname{sign} v`.

**Method.** A delay shifts the phase of a sine and nothing else: the describing function includes it exactly.
The state of such a loop is a piece of its past, so that no exact orbit is computed; the prediction is checked
by simulation, which keeps the past exactly.
"""

import matplotlib.pyplot as plt
import numpy as np

import ctrl_df as cdf

pid = cdf.pid(2000, 0, 130)


def drive(delay):
    axis = cdf.friction_mass(mass=9, coulomb=5, viscous=0.5)
    return axis.with_effect(cdf.InputSaturation(60)).with_effect(cdf.InputDelay(delay))


found = {}
for delay in (0.02, 0.04, 0.06, 0.08):
    box = np.geomspace(5.2, 2000, 60), np.geomspace(4, 60, 90)
    found[delay] = cdf.describing_function_response(pid, drive(delay), *box)
    print(f"{1e3 * delay:.0f} ms: {found[delay].limit_cycles or 'no limit cycle'}")

found[0.06].plot()

# %%
# **Result.** With 60 ms there are two cycles, a small unstable one and a large stable one. Motions smaller
# than the first die out, as friction damps them; larger ones end in the second, which the amplifier bounds.
# So delay and initial disturbance decide together.

check = cdf.verify(found[0.06])
print(check.table())
print(check.fate)

# %%
# **Check.** A simulation from either side of the border. The prediction corrected by the harmonics that it
# dropped agrees with the motion to which the simulation settles.

loop = cdf.closed_loop(pid, drive(0.06))
t = np.linspace(0, 20, 10_001)
figure, ax = plt.subplots(layout="constrained")
small, large = found[0.06].limit_cycles
ends = {}
for share in (0.7, 1.5):
    start = np.zeros(loop.nstates)
    start[[name.endswith("_x") for name in loop.state_labels]] = share * small.output_amplitude
    x = 1e3 * np.asarray(cdf.event_response(loop, t, 0, start).outputs)[0]
    ends[share] = float(np.abs(x[t > 18]).max())
    ax.plot(t, x, lw=0.8, label=f"pushed by {share:g} times the border")
ax.set_xlabel("time [s]")
ax.set_ylabel("position [mm]")
figure.legend(loc="outside upper center", ncols=2, frameon=False)
corrected = large.corrected[1]
print(f"corrected: {corrected:.3f} rad/s; simulated: {check.rows[1].simulated[0]:.3f} rad/s")
assert not found[0.02].limit_cycles and not found[0.04].limit_cycles
assert ends[0.7] < 5 / 2000 * 1e3 + 1e-6 and ends[1.5] > 50
assert abs(corrected / check.rows[1].simulated[0] - 1) < 1e-3
plt.show()
