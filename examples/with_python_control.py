# %% [markdown]
# # Can I keep my python-control script and only get better numbers?

# %%
import control as ct
import numpy as np
from _shown import finish

import ctrl_df as cdf

# %% [markdown]
# The call is the same; H may be discrete. A sampled version of a third-order plant at 10 ms, with
# python-control's own saturation.

# %%
H = ct.c2d(ct.tf([8], [1, 2, 2, 1]), 0.01)
F = ct.saturation_nonlinearity(1)
A = np.linspace(1, 5, 20)
mine = cdf.describing_function_response(H, F, A)
a, omega = mine.intersections[0]
print(f"ctrl_df: {a:.5f} at {omega:.5f} rad/s")

# %% [markdown]
# python-control 0.10.2 evaluates the refined crossing of a discrete H on the imaginary axis instead of the
# unit circle. A plain linear check tells who is right: at the crossing the phase of H is -180 degrees.

# %%
phase = np.degrees(np.angle(H(np.exp(1j * omega * 0.01))))
print(f"phase of H there: {phase:.6f} degrees")

# %% [markdown]
# A block is a python-control system: interconnect it, linearize it, plot with it.

# %%
plant = cdf.friction_mass(mass=9, coulomb=0, viscous=0.5)
linear = ct.linearize(plant, np.zeros(2), np.zeros(1))
print("poles of the frictionless mass:", np.sort(linear.poles().real))
finish(mine.plot().figure)

assert isinstance(mine, ct.DescribingFunctionResponse)
assert abs(abs(phase) - 180) < 1e-6
assert abs(omega - 1.4090) < 2e-4
assert np.allclose(np.sort(linear.poles().real), [-0.5 / 9, 0], atol=1e-6)
