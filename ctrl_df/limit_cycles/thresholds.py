"""Tuned numbers of the search for limit cycles, its verification, and what both wings have in common.

Those of predicted and of exact limit cycles stand in the thresholds of the wings. Where nothing else is said
a number bounds work, or parts what rounding and tolerances leave from what a motion does, by a few powers of
ten on either side.
"""

from __future__ import annotations

# --- rounding ---------------------------------------------------------------------------------------

NOTHING = 1e-300
"""What quotients are divided by where their divisor may be zero."""

ROUNDED = 1e-12
"""Relative difference of two numbers of some terms that are one; a pole of a sampled system at the origin."""

# --- exact orbits -----------------------------------------------------------------------------------

RETURN_RTOL = 1e-9
"""Relative error of a step of a trajectory whose returns are sought."""

# --- other ways to close an orbit -------------------------------------------------------------------

VISIT_SAMPLES, VISITS = 1 << 15, 60
"""Of a waveform, among which visits of the straight pieces of a law are looked for; pieces of a cycle."""

VISIT_CLOSED, VISIT_ITERATIONS, VISIT_LONGEST = 1e-11, 30, 0.5
"""Defect, relative to the sizes of the orbit, of one put together from exact pieces; Newton's steps, and the
longest."""

VISIT_SIZE, VISIT_RANK = 1e-3, 1e-14
"""Size of a state, over the largest, at least; singular value that a step leaves out."""

# --- starts -----------------------------------------------------------------------------------------

FORCED_PERIODS, FORCED_STEPS = 40, 400_000
"""Of forced motion before it is measured, and their work."""

FORCED_STARTS = ((0.1, 0.0), (0.5, 3.0), (0.5, -3.0))
"""Relative position at a joint, over its gap, and speed over a gap a radian: starts of forced motions."""

MEAN_SEEN = 1e-9
"""Mean of an output, over its harmonics, that an integrator has to hold."""

# --- trajectories ----------------------------------------------------------------------------------------

ENOUGH = 6
"""Crossings from which an orbit can be told."""

RETURN_POINTS, RETURN_GONE, RETURN_NEAR = 4097, 0.1, 0.5
"""Instants among which a trajectory's returns are sought; distance, over the size of the motion, that is
away, and near again."""

AVERAGE_POINTS, EVENTS_KEPT = 2049, 200
"""Instants of an averaged motion that is returned, and events."""

# --- predictions beside orbits ----------------------------------------------------------------------

SAME_CYCLE, SAME_AS_PATH = (1.25, 2.0), (1.1, 1.3)
"""Factors of frequency and amplitude within which a prediction and an orbit are taken for one cycle; for the
end of a path, which lacks the highest harmonics only."""

AMPLITUDE_COUNTS, STABILITY_COUNTS = 0.5, 2.0
"""Distance of an orbit from a prediction: weight of ln a beside ln omega, which is predicted better
(`SAME_CYCLE`); factor where the two disagree on stability. Half and twice were not tried."""

AT_ITS_END = 1e-3
"""Distance of an orbit from the end of its path that harmonics left out may explain."""

NEAR_MISS = 0.3
"""Mismatch after a period, relative to the orbit, from which it is worth following."""

CONFIRMED_WITHIN = 0.05
"""In frequency and amplitude: within, a prediction is called confirmed; beyond, it is the same cycle,
shifted."""

SET_ASIDE = 0.01
"""Of the state of an orbit, by which a simulation beside it begins off it: a hundredth, seen and near."""

LEFT_ALONE = (0.2, 5)
"""Amplitude of a simulation beside an orbit, over the orbit's, that has not left it."""

RETURNS, CROSSINGS_A_PERIOD, AVERAGED_LEAST = 4, 4, 4
"""Returns of a trajectory that are tried as periods, crossings that one period may have, and periods of an
average that are shown, and needed."""

MET_LEAST = 8
"""Crossings of a verifying simulation at least."""
