"""Tuned numbers of the search for limit cycles, its verification, and what both wings have in common.

Those of predicted and of exact limit cycles stand in the thresholds of the wings.

Where nothing else is said a number bounds work, or parts what rounding and tolerances leave from what a
motion does, by a few powers of ten on either side. ``orbits``: half and twice of the number change no cycle
of thirteen loops or more (`benchmarks/half_and_twice.py orbits`).
"""

from __future__ import annotations

from ..thresholds import EPS, ROUNDED

# --- other ways to close an orbit -------------------------------------------------------------------

VISIT_SAMPLES, VISITS = 1 << 15, 60
"""Of a waveform, among which visits of the straight pieces of a law are looked for, five hundred for each of
as many pieces as a cycle may visit: a shorter one would be hard to tell from a touch (orbits)."""

VISIT_CLOSED, VISIT_SIZE = 10 * ROUNDED, 1e-3
"""Defect, relative to the sizes of the orbit, of one put together from exact pieces: ten times what a long
sum errs by. Size of a state, over the largest, at least: one that hardly moves is measured by the others
(orbits)."""

# --- starts -----------------------------------------------------------------------------------------

FORCED_PERIODS = 40
"""Of forced motion before it is measured, which is a start only: a transient that falls by a tenth a period
is then within 1.5 % (orbits)."""

FORCED_STARTS = ((0.1, 0.0), (0.5, 3.0), (0.5, -3.0))
"""Relative position at a joint, over its gap, and speed over a gap a radian: starts of forced motions, near
one wall, and in the middle fast enough to hit either, besides in touch and at rest."""

# --- trajectories ----------------------------------------------------------------------------------------

RETURNS, CROSSINGS_A_PERIOD, AVERAGED_LEAST = 4, 4, 4
"""Returns of a trajectory that are tried as periods (orbits), crossings that one period may have (two lose
the cycles of two dead zones, eight gain nothing: orbits), and periods of an average that are shown, and
needed."""

ENOUGH = CROSSINGS_A_PERIOD + 2
"""Crossings from which an orbit can be told: those of the longest period, its end, and one for which it has
gone on. With twice as many the cycles of two dead zones are lost, half change nothing (orbits)."""

RECENT_CLOSED = 3 * CROSSINGS_A_PERIOD
"""Crossings, the last ones, among which the pair is sought that nearly repeats: three of the longest periods.
A trajectory that brings no more within its work is no use."""

MET_LEAST = 2 * CROSSINGS_A_PERIOD
"""Crossings of a verifying simulation at least: two of the longest periods."""

RETURN_POINTS, RETURN_GONE, RETURN_NEAR = 1024 * RETURNS + 1, 0.1, 0.5
"""Instants among which a trajectory's returns are sought; distance, over the size of the motion, that is
away, and near again. From a state beside a chattering orbit half and twice lead to the same one."""

AVERAGE_POINTS, EVENTS_KEPT = 512 * AVERAGED_LEAST + 1, 200
"""Instants of an averaged motion that is returned, a picture shows no more; and events."""

# --- curves, followed by steps along them ----------------------------------------------------------

CURVE_FIRST, CURVE_LONGER, CURVE_BEND = 0.1, 1.6, 0.8
"""First step, in sizes of the unknowns (orbits); growth of the step after one that was right, two of which
make up for one that was halved: without any growth curves are not followed to their end, 1.5 and twice as
much lead to the same (friction loops of `tests/test_trust.py`). Cosine of the angle between the tangents at a
step's ends, 37 degrees, from which it is short enough: a step of that bend errs by an eighth of its length
times the angle, a twelfth of it."""

LOG_NUDGE = 1e-5
"""Step of difference quotients in ln a, ln omega and unknowns relative to them: near the cube root of eps,
central ones err by some 1e-10 of curvature and 1e-11 of rounding, those to one side by 1e-5, by which a step
of Newton's method is then short of the solution."""

CURVE_RANK = 4 * EPS / LOG_NUDGE
"""Singular value, over the largest, that is none, 9e-11: what rounding leaves of such differences."""

# --- predictions beside orbits ----------------------------------------------------------------------

SAME_CYCLE, SAME_AS_PATH = (1.25, 2.0), (1.1, 1.3)
"""Factors of frequency and amplitude within which a prediction and an orbit are taken for one cycle; for the
end of a path, which lacks the highest harmonics only (orbits)."""

AMPLITUDE_COUNTS, STABILITY_COUNTS = 0.5, 2.0
"""Distance of an orbit from a prediction: weight of ln a beside ln omega, which is predicted better
(`SAME_CYCLE`); factor where the two disagree on stability (orbits)."""

AT_ITS_END = 1e-3
"""Distance of an orbit from the end of its path that harmonics left out may explain (orbits)."""

NEAR_MISS = 0.3
"""Mismatch after a period, relative to the orbit, from which it is worth following. With half of it a
prediction of the friction loop that has no orbit is not shown to have none; twice
changes nothing (orbits)."""

CONFIRMED_WITHIN = 0.05
"""In frequency and amplitude: within, a prediction is called confirmed; beyond, it is the same cycle,
shifted. What describing functions are used for, gain margins and choices of parts, asks for no more."""

SET_ASIDE = 0.01
"""Of the state of an orbit, by which a simulation beside it begins off it: a hundredth, seen and near."""

LEFT_ALONE = (0.2, 5)
"""Amplitude of a simulation beside an orbit, over the orbit's, that has not left it (orbits): on a stable one
it comes back to one."""
