r"""
Can I keep my python-control script and only get better numbers?
================================================================

**Problem.** A script predicts the oscillation of a sampled loop with saturation by
``ct.describing_function_response``. Does it run unchanged, and what does it gain?

.. code-block:: text

    0 --->( + )---[ saturation at 1 ]---u--->[ H(z), 10 ms ]---+---> y
           - ^                                                 |
             +-------------------------------------------------+

**Method.** The same call from the other module; H may be discrete. A linear check tells who is right.
"""

import control as ct
import matplotlib.pyplot as plt
import numpy as np

import ctrl_df as cdf

H = ct.c2d(ct.tf([8], [1, 2, 2, 1]), 0.01)
F = ct.saturation_nonlinearity(1)
A = np.linspace(1, 5, 20)
mine = cdf.describing_function_response(H, F, A)
a, omega = mine.intersections[0]
print(f"ctrl_df: {a:.5f} at {omega:.5f} rad/s")
mine.plot()

# %%
# python-control 0.10.2 evaluates the refined crossing of a discrete H on the imaginary axis instead of the
# unit circle. At the true crossing the phase of H is -180 degrees:

phase = np.degrees(np.angle(H(np.exp(1j * omega * 0.01))))
print(f"phase of H there: {phase:.6f} degrees")

# %%
# A block is a python-control system: linearize it, and interconnect it by the names of its signals.

axis = cdf.friction_mass(mass=9, coulomb=5, viscous=0.5, name="axis")
linear = ct.linearize(cdf.friction_mass(mass=9, coulomb=0, viscous=0.5), np.zeros(2), np.zeros(1))
print("poles of the frictionless mass:", np.sort(linear.poles().real))

controller = ct.tf([130, 2000], [1e-3, 1], name="pd", inputs="e", outputs="F")
error = ct.summing_junction(["r", "-x"], "e")
loop = ct.interconnect([controller, axis, error], inputs="r", outputs=["x", "v"])
t = np.linspace(0, 1, 501)
theirs = ct.input_output_response(loop, t, np.full_like(t, 0.01), solve_ivp_kwargs={"max_step": 1e-3})
ours = cdf.event_response(loop, t, np.full_like(t, 0.01))
print("events:", [(round(float(e.time), 4), e.kind) for e in ours.events][:4])

# %%
# **Result.** A step of 10 mm. With events located the mass stops where friction holds it, and stays.
# Stepped over, the friction changes its sign at every step instead:

speeds = [float(np.abs(np.asarray(r.outputs)[1, t > 0.5]).max()) for r in (theirs, ours)]
print(f"greatest speed after it has stopped: python-control {speeds[0]:.1e} m/s, here {speeds[1]:.1e} m/s")

figure, ax = plt.subplots(layout="constrained")
ax.plot(t, 1e3 * np.asarray(theirs.outputs)[0], "0.6", lw=3, label="ct.input_output_response")
ax.plot(t, 1e3 * np.asarray(ours.outputs)[0], "k", lw=1, label="cdf.event_response")
ax.set_xlabel("time [s]")
ax.set_ylabel("position [mm]")
ax.legend(frameon=False)

# %%
# **Check.** The mass rests where the controller's force is below the friction:

rest = float(np.asarray(ours.outputs)[0, -1])
print(f"rests at {1e3 * rest:.3f} mm; the controller pushes with {2000 * (0.01 - rest):.2f} N of 5 N")
assert isinstance(mine, ct.DescribingFunctionResponse)
assert abs(abs(phase) - 180) < 1e-6
assert abs(omega - 1.4090) < 2e-4
assert np.allclose(np.sort(linear.poles().real), [-0.5 / 9, 0], atol=1e-6)
assert abs(2000 * (0.01 - rest)) <= 5
assert abs(float(np.asarray(ours.outputs)[1, -1])) < 1e-12
plt.show()
