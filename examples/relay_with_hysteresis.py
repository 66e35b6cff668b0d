# %% [markdown]
# # How much does the describing function miss for a thermostat?

# %%
import control as ct
import numpy as np
from _shown import finish
from scipy.optimize import brentq

import ctrl_df as cdf

# %% [markdown]
# A relay with hysteresis drives an integrator with a lag. Its output is a square wave whatever the loop
# does, so the exact cycle follows from one equation in omega (Tsypkin): at the instant of switching up the
# input stands at the hysteresis.

# %%
H, level, hysteresis = ct.tf([1], [1, 1, 0]), 1.0, 0.1
k = np.arange(1, 20_001, 2)


def excess(omega):
    return -4 * level / np.pi * np.sum(np.imag(H(1j * k * omega)) / k) - hysteresis


tsypkin = brentq(excess, 0.5, 10)
print(f"Tsypkin:             {tsypkin:.6f} rad/s")

# %%
relay = cdf.relay_with_hysteresis(level, hysteresis)
resp = cdf.describing_function_response(H, relay, np.geomspace(0.11, 5, 20))
cycle = resp.limit_cycles[0]
low, high = cycle.omega_band
print(f"describing function: {cycle.omega:.6f} rad/s, band {low:.4f} to {high:.4f}")

# %%
orbit = cdf.find_limit_cycle(cdf.closed_loop(H, relay), guess=cycle)
print(f"exact orbit:         {orbit.omega:.6f} rad/s, {'stable' if orbit.stable else 'unstable'}")
finish(orbit.plot().figure)

# %% [markdown]
# The square wave's harmonics come back through a plant that attenuates them by 9 or more: the prediction is
# off by less than the band it states.

# %%
error = cycle.omega / tsypkin - 1
print(f"error of the describing function: {100 * error:+.2f} %")
assert abs(orbit.omega / tsypkin - 1) < 1e-6
assert cycle.omega_band[0] < tsypkin < cycle.omega_band[1]
