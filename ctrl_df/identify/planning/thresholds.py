"""Inputs and sines that are planned: tuned numbers, each with what it follows from."""

from __future__ import annotations

PLAN_SIZES = (1.0, 0.8, 0.6, 0.45, 0.35, 0.25, 0.15, 0.08, 0.04)
"""Of inputs, over the largest that the limits allow."""

PLAN_MARGIN = 0.9
"""Share of the stroke that candidates may use: the drive itself is like them, not one of them."""

SETTLE, COUNTED, SINES = 12, 8, 6
"""Periods before and while a point is measured, and points of a plan."""

PLAN_SLACK = 1.0001
"""Over a limit, that is rounding."""

PLAN_MOVES = 0.2
"""Least swing of the candidates' outputs, over the largest: below, one of them does not move."""

PLAN_BAND, PLAN_SINES = (0.3, 8.0, 10.0), 20
"""Frequencies over that of the motion: lowest, highest of a multisine, of a chirp; sines of the former."""

PLAN_STEPS, PLAN_STEP_RATE, PLAN_STEP_SIZES = 400, 0.5, (0.4, 0.6)
"""Random steps, their rate over that of the motion, and their sizes: at least, and how much more at most."""

PLAN_TRIANGLE = 0.4
"""Rate of a triangle, over that of the motion."""

SIGMA_LEAST = 1e-6
"""Relative noise of a table that plans count with at least."""

PLAN_SAMPLES = 2500
"""Samples of an input that is tried, about: as many as candidates are screened with."""

PLAN_LEAST = 20
"""Samples of an input at least: two swings of ten."""

PLAN_SWING = (40, 10)
"""Samples of a swing at least: of a reference, which a controller has to follow, and of an input."""

PLAN_PEAK = 4
"""Standard deviations of noise that its peaks reach."""

PLAN_SMOOTH = 0.25
"""Of a to-and-fro motion, over which a reference is smoothed to either side."""

PLANE, PLANE_BEYOND, SINE_SAMPLES = (9, 11), (0.5, 2.0), 100
"""Amplitudes and frequencies among which sines are chosen; lowest and highest frequency, over those of the
tables; samples of the fastest period."""
