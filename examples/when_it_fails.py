# %% [markdown]
# # When is the prediction wrong, and how does one see it beforehand?

# %%
import numpy as np
from _shown import finish

import ctrl_df as cdf

# %% [markdown]
# The backlash drive again, with hard steel instead of soft: restitution 0.8. Everything else stays.

# %%
drive = cdf.backlash_masses(motor_mass=1, load_mass=8, gap=0.018, restitution=0.8)
pid = cdf.pid(1800, 19500, 100)
resp = cdf.describing_function_response(pid, drive, np.geomspace(6, 30, 14), np.geomspace(80, 200, 14))
cycle = max(resp.limit_cycles, key=lambda c: c.omega)
print(f"predicted: {cycle.omega:.2f} rad/s, F1 {cycle.amplitude:.2f} N: {cycle.grade}")
print(f"  why: {cycle.why}")

# %% [markdown]
# Three warnings before any simulation: the grade, the harmonics fed back, the error band. Heed them.

# %%
assert cycle.grade == "unreliable"
print(f"harmonics fed back: {100 * cycle.distortion:.0f} % of the fundamental")
print(f"band of omega: {cycle.omega_band[0]:.0f} to {cycle.omega_band[1]:.0f} rad/s")

# %% [markdown]
# The exact orbit is a rattle of the motor within the gap, two impacts a period, a quarter faster than
# predicted.

# %%
orbit = cdf.find_limit_cycle(cdf.closed_loop(pid, drive), guess=cycle)
print(f"exact: {orbit.omega:.6f} rad/s, F1 {orbit.amplitude:.4f} N, multiplier {orbit.multiplier:.5f}")
finish(orbit.plot().figure)

# %% [markdown]
# A multiplier this near to one also says that the rattle is reached slowly: minutes of irregular motion come
# first. The paper's Fig. 10 shows those.

# %%
assert abs(orbit.omega - 156.045031) < 1e-5
assert cycle.omega_band[0] < orbit.omega < cycle.omega_band[1]
print(f"error of the prediction: {100 * (cycle.omega / orbit.omega - 1):+.0f} %")
