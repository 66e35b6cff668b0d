r"""
How fast must a digital controller be?
======================================

**Problem.** The hunting axis of :doc:`hunting`, under a controller that computes every few milliseconds and
holds its output in between. What is the influence of the sample time?

.. code-block:: text

    r = 0 --->( + )---/ dt ---[ kp + ki/s + kd s, sampled ]---[ hold ]---F--->[ 9 kg, friction ]---+---> x
               - ^                                                                                |
                 +--------------------------------------------------------------------------------+

**Equations.** Between ticks F is constant; at a tick :math:`t_k = k\,\Delta t` the controller reads x and
v. A hold delays by half a sample on average: :math:`\Delta t / 2`.

**Method.** ``closed_loop(pid, axis, dt=...)``. The sample time and the period of the oscillation are
incommensurable, so the motion never repeats exactly: ``find_limit_cycle``, started at the continuous orbit,
gives averages over many swings, and ``stable`` is None.
"""

import matplotlib.pyplot as plt
import numpy as np

import ctrl_df as cdf

axis = cdf.friction_mass(mass=9, coulomb=5, viscous=0.5, static=5.5)
pid = cdf.pid(2000, 44250, 130)
continuous = cdf.find_limit_cycle(cdf.closed_loop(pid, axis))
print(f"continuous: {continuous.omega:.4f} rad/s, {1e3 * continuous.output_amplitude:.3f} mm")

sampled, about = {}, (continuous.amplitude, continuous.omega)  # where to begin: N, rad/s
for dt in (0.001, 0.004):
    sampled[dt] = orbit = cdf.find_limit_cycle(cdf.closed_loop(pid, axis, dt=dt), guess=about)
    print(
        f"{1e3 * dt:8.0f} ms: {orbit.omega:.4f} rad/s, {1e3 * orbit.output_amplitude:.3f} mm, "
        f"stable: {orbit.stable}"
    )

# %%
# **Result.** Sampling slows the hunting and makes it smaller: a delay of half a sample shifts the
# controller's phase, as :doc:`delay_in_the_loop` does. A millisecond shifts the frequency by some per cent;
# this loop is that sensitive.

figure, ax = plt.subplots(layout="constrained")
ax.plot([0, *(1e3 * dt for dt in sampled)], [continuous.omega, *(o.omega for o in sampled.values())], "ko-")
ax.set_xlabel("sample time [ms]")
ax.set_ylabel("hunting [rad/s]")

# %%
# **Check.** The same loop simulated for two minutes, and the time from stop to stop measured, half a period:

loop = cdf.closed_loop(pid, axis, dt=0.004)
start = [1.5e-3 if name.endswith("_x") else 0.0 for name in loop.state_labels]
run = cdf.event_response(loop, [0, 120], 0, start)
stops = [e.time for e in run.events if e.kind == "stick" and e.time > 80]
measured = np.pi / np.mean(np.diff(stops))
print(f"4 ms: averaged {sampled[0.004].omega:.3f} rad/s, from stop to stop {measured:.3f} rad/s")
assert abs(measured / sampled[0.004].omega - 1) < 0.02
assert all(o.stable is None and o.omega < continuous.omega for o in sampled.values())
plt.show()
