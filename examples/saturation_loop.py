# %% [markdown]
# # At what gain does a saturating servo start to swing, and how far?

# %%
import control as ct
import numpy as np
from _shown import finish

import ctrl_df as cdf

# %% [markdown]
# A third-order plant with gain 8 lies above its critical gain 3: the linear loop is unstable. Saturation
# bounds the growth. N falls from 1 as the amplitude grows; the loop swings where N has come down to 3/8.
# The phase of H is -180 degrees at sqrt(2) rad/s, whatever the amplitude.

# %%
H = ct.tf([8], [1, 2, 2, 1])
resp = cdf.describing_function_response(H, cdf.saturation(1), np.linspace(1, 5, 20))
cycle = resp.limit_cycles[0]
print(f"predicted: {cycle.amplitude:.6f} at {cycle.omega:.6f} rad/s ({cycle.grade})")

# %% [markdown]
# The picture: -1/N leaves -1 to the left along the real axis and meets the Nyquist curve at -8/3.

# %%
cplt = resp.plot()
finish(cplt.figure)

# %% [markdown]
# The clipped wave has a small third harmonic, H attenuates it 20-fold, so the truth is near.

# %%
orbit = cdf.find_limit_cycle(cdf.closed_loop(H, cdf.saturation(1)), guess=cycle)
print(f"exact:     {orbit.amplitude:.6f} at {orbit.omega:.6f} rad/s, multiplier {orbit.multiplier:.4f}")

assert abs(cycle.omega - np.sqrt(2)) < 1e-9
assert abs(cycle.amplitude - 3.343998730) < 1e-7
assert abs(orbit.omega - 1.40670188630) < 1e-6  # DOP853 after long settling
