"""Every tuned number of predicted limit cycles, with what it follows from or what chose it.

``trust`` is `benchmarks/trust.py`, predictions beside exact orbits. Where nothing else is said a number
bounds work, or parts what rounding and tolerances leave from what a motion does, by a few powers of ten on
either side.
"""

from __future__ import annotations

import math

import numpy as np

# --- rounding ---------------------------------------------------------------------------------------

ON_EDGE = 1e-9
"""Relative excess of a place over the edge of a range that is none."""

# --- scanning for crossings -------------------------------------------------------------------------

ORDERS = 9
"""Harmonics that a prediction keeps."""

OMEGA_POINTS, OMEGA_POINTS_DRAWN = {True: 1000, False: 200}, 500
"""Frequencies of a range: memoryless, dynamic; of a measured H that is drawn."""

OMEGA_BEYOND, OMEGA_SPAN, OMEGA_LEAST = 100, 1e4, 1e-3
"""Frequencies looked at, beyond poles and zeros either way; least span; lowest one of a range from zero."""

SAME_STEPS, SPREADS = 3, 3
"""Steps of the grid within which an interpolated crossing is one already found; standard errors of an average
that |1 + N H| may come to at a crossing. Half and twice of either change nothing in seven loops verified."""

ROUGH_POLE = 1e-8
"""Pole or zero, over the largest, that is one at the origin: the root of eps."""

SCAN_CHANGE, SCAN_HALVINGS, SCAN_STEP, SCAN_MOST = 0.15, 12, 1e-5, 3000
"""Change of H from point to point up to which steps of ln omega are halved, how often, to what step, to how
many."""

SCAN_QUICK = 60_000
"""Points of a closed form that depends on frequency up to which a grid is refined."""

LEVELS, BEYOND_CORNER = 200, 4.0 ** np.arange(-10.0, -3.0)
"""Of a quantizer, whose corners enter the grid: beyond N differs from 1 by less than 1e-3; distances from a
corner on, relative, that enter as well."""

SCAN_AT_ONCE, CELLS_AT_ONCE = 1 << 16, 1 << 18
"""Points of a closed form between two chances to interrupt it; grid points looked at together, what bounds
the memory of a large grid."""

JUMPY = 1e-6
"""Spread of an average from which N jumps from point to point."""

MARGIN, CUTS, MOST_PER_CELL = 0.3, 4, 4
"""Of a cell's spread of values, by which a zero may hide beyond its corners; parts of a side of such a cell
from which Newton's method starts, the nearest few."""

MOST_STARTS = 600
"""Of Newton's method."""

CROSSING_NUDGE = 1e-5
"""Of the difference quotients, in ln a and ln omega: error 1e-10 beside rounding 1e-10."""

ACCEPT, CONVERGED, SETTLED, GIVE_UP = 1e-8, 1e-14, 1e-13, 1e-3
"""|1 + N H| of a crossing, and of one that needs no other step; step that moves nothing; |1 + N H| that
quadratic convergence leaves behind after eight steps."""

CROSSING_STEPS, BISECTIONS = 40, 60
"""Of Newton's method, at most; of a bisection, to the last digit."""

CROSSING_RANK = 1e-9
"""Singular value, over the largest, from which a step is one of least squares: a tangential crossing."""

SAME, TOGETHER = 1e-5, 1e-3
"""Difference of ln a and ln omega below which two zeros are one; of a cell: starts so near to each other
converge to one zero."""

NOT_REAL = 1e-6
"""Imaginary part of H, over it, at a crossing of the real axis: more is a pole, where the phase jumps."""

SMOOTH_STEP = 0.5 * math.pi
"""Largest phase step between data points for which their phase is followed [rad]."""

INDENT = 1e-4
"""Radius of the contour's way round a pole, relative to the frequencies looked at."""

# --- branches ---------------------------------------------------------------------------------------

NEAR, FAR = 0.2, 0.5
"""|1 + N H| on the grid up to which coexisting motions are looked for: their N differ by some 15 %. To it
comes what a grid step changes, as a^-1 omega^-2."""

BRANCH_SAME, BRANCH_AGREES = 1e-4, 1e-6
"""Of ln a, ln omega: two crossings at one place; relative difference of N between branch and block: the block
names this motion itself."""

BRANCH_NUDGE, BRANCH_FOLD, BRANCH_SLACK, BRANCH_POINTS = 1e-5, 1e-9, 1e-9, 100
"""Difference of s and ln omega, for the slope of ln a; slope that is a fold; excess over the ends of a branch
that is none; frequencies at least."""

# --- harmonics fed back -----------------------------------------------------------------------------

WAVE_SAMPLES, STATIC_HARMONICS, DYNAMIC_HARMONICS = 2048, 63, 21
"""Of a waveform; harmonics of it that are fed back to laws without time, and to blocks with dynamics."""

CHORD_POINTS = 64
"""Points of the chord between two samples where a law jumps."""

DENSER, STEP_LEFT = 4, 0.5
"""How many times as many samples tell whether a law jumps, and what is left of its largest step then: of a
smooth one a quarter, of a jump all; half is as far from either."""

WAVE_JUMP, WAVE_FLAT = 20, 1e-9
"""Step between samples, over the median, that is a jump; over the largest, that is none."""

PATH_CLOSED, PATH_NUDGE = 1e-7, 1e-5
"""Defect, relative to the fundamental, of a point on the curve; of the difference quotients, all unknowns
being relative."""

PATH_LATE = 100
"""Times `PATH_CLOSED`: defect of a point that Newton's method brings no nearer."""

PATH_LONGEST, PATH_SHORTEST, PATH_FIRST, PATH_STEPS = 0.25, 1e-3, 0.1, 80
"""Steps along the curve."""

PATH_BEND, ASTRAY, PATH_LONGER = 0.8, 0.3, 1.6
"""A step is halved where the tangents at its ends differ by more than 37 degrees (cosine), or the corrector
moves by more than that share of it; else the next one is longer."""

PATH_ENDS_NEAR = 0.5
"""Change of an unknown, twice the longest step, that the last point of a curve may be off what its tangent
foretells: farther off it lies on another curve."""

PATH_NEWTON = 12
"""Newton's steps for one point."""

SLOW = 0.5, 0.9
"""Defect over the one before from which Newton's matrix is recomputed, or the search is over."""

PROBE = 0.05 * np.exp(0.7j)
"""Third harmonic, relative, that asks for oddness: small, of no special phase."""

NAMED = 0.01
"""|1 + N H| of a motion that is taken for the one of the prediction."""

PATH_REACH = np.log([30.0, 10.0])
"""In amplitude and frequency, beyond which a curve is given up."""

ODD = 1e-7
"""Even harmonics and mean of the response to an odd waveform, below which a block is odd."""

# --- grades and bands -------------------------------------------------------------------------------

SAFETY = {False: 1.5, True: 4.0}
"""On the shift that the returned harmonics cause, by whether the block has dynamics: of an impact's
harmonics, which fall slowly, fewer are kept (worst of ``trust``: 3.1 for a gap)."""

MEMORYLESS_ERROR, DYNAMIC_ERROR = (1.5, 0.0), (0.01, 0.4)
"""Relative error of N from returned harmonics d where they cannot be carried, c1 d + c2 d^2. A jump or a
corner responds to its harmonics at once; a mass hardly (friction and backlash loops of tests/problems.py:
0.003 at 0.10, 0.007 at 0.20, 0.21 at 0.79)."""

FLOOR, BAND_MOST = 1e-3, 50.0
"""Least half width of a band; largest, whose exponential is still a number."""

FOLD = (1.5, 1.15)
"""Times the harmonics there are, at which a fold makes a prediction doubtful, unreliable."""

VAGUE, IRREGULAR = 0.3, 0.05
"""|1 + N H| beyond which an average over irregular motion places no crossing, however it spreads, and up to
which it does, however little."""

GUESSED = 1e-6
"""Harmonic, over the fundamental, whose H outside the data matters."""

DISTORTION = (0.2, 0.6)
"""Fed-back harmonics, relative: doubtful, unreliable above."""

SENSITIVITY = (6.0, 40.0)
"""Relative change of a for a relative error of N: doubtful, unreliable above."""

BAND = (0.15, 0.7)
"""Half width of the bands, in ln a and ln omega: doubtful, unreliable above."""

LOEB = 0.02
"""Sine of the angle between the curves below which Loeb's sign means nothing."""

BOUND_HARMONICS = np.arange(3, 62, 2)
"""Of the bound of Mees and Bergen: those beyond are bounded together."""

WINDOWS, BOUND_POINTS = (0.1, 0.4, 1.2), 161
"""Half widths tried, in ln a and ln omega; points of a side."""

BESIDE_CORNER = 0.37
"""Distance from a corner, over its place and one, at which a law is asked whether it is odd: no symmetry
meets it."""

SHOWS_BY, STRAYED, APART, LINE_HALVINGS = 8, 6, 3, 5
"""Steps by which quadratic convergence shows; how far from its start, in steps of the grid, a search has
strayed; how near a crossing another one owns it; halvings of a step that
does not come nearer."""
