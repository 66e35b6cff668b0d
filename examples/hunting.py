# %% [markdown]
# # Why does my axis hunt, when the describing function says it should not?

# %%
from _shown import finish

import ctrl_df as cdf

# %% [markdown]
# A mass of 9 kg, Coulomb friction 5 N, and a PID with much integral action. At standstill the integral winds
# up until the force exceeds the *static* level; the mass jumps, overshoots, sticks again. Only a few per cent
# of difference between static and kinetic friction do it.

# %%
pid = cdf.pid(2000, 44250, 130)
exact = {}
for static in (5.25, 5.5, 5.75):
    plant = cdf.friction_mass(mass=9, coulomb=5, viscous=0.5, static=static)
    orbit = cdf.find_limit_cycle(cdf.closed_loop(pid, plant))  # no guess: searched by simulation
    exact[static] = orbit
    print(f"static {static:4.2f} N: hunts at {orbit.omega:.6f} rad/s, {1e3 * orbit.peak:.3f} mm, "
          f"{'stable' if orbit.stable else 'unstable'}")  # fmt: skip

# %% [markdown]
# The describing function answers 13.06 to 13.13 rad/s for all three, and the same 13.05 rad/s without
# stiction, where there is no such cycle at all: it weighs a whole period and hardly sees the short instant of
# breakaway.

# %%
finish(exact[5.5].plot().figure)

assert abs(exact[5.25].omega - 8.600097) < 1e-5
assert abs(exact[5.5].omega - 11.628680) < 1e-5
assert abs(exact[5.75].omega - 13.175267) < 1e-5
assert all(orbit.stable for orbit in exact.values())
