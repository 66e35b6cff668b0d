# %% [markdown]
# # A gear with 18 mm of play under PID: will it rattle, how fast, how far?

# %%
import numpy as np
from _shown import finish

import ctrl_df as cdf

# %% [markdown]
# Motor 1 kg, load 8 kg, restitution 0.2: the drive of Azenha & Machado (1997), Fig. 9.

# %%
drive = cdf.backlash_masses(motor_mass=1, load_mass=8, gap=0.018, restitution=0.2)
pid = cdf.pid(1800, 19500, 100)
resp = cdf.describing_function_response(pid, drive, np.geomspace(5, 60, 30), np.geomspace(8, 60, 40))
cycle = resp.limit_cycles[0]
print(
    f"predicted: {cycle.omega:.4f} rad/s, load amplitude {1e3 * cycle.output_amplitude:.2f} mm, {cycle.grade}"
)
print(f"  why: {cycle.why}")

# %%
check = cdf.verify(resp)
print(check.table())
finish(resp.plot().figure)

# %% [markdown]
# The frequency is right to 0.8 %, the amplitude 13 % short: the two curves cross almost along each other, so
# that a small error in N slides the crossing far along the amplitude. The cycle says so itself.

# %%
orbit = check.rows[0].exact
assert abs(orbit.omega - 14.733968) < 1e-5
assert abs(cycle.omega / orbit.omega - 1) < 0.01
assert 0.10 < 1 - cycle.amplitude / orbit.amplitude < 0.15
print(f"exact: {orbit.omega:.6f} rad/s, {1e3 * orbit.output_amplitude:.3f} mm")
