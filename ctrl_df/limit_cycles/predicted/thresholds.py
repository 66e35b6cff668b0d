"""Every tuned number of predicted limit cycles, with what it follows from or what chose it.

``trust`` is `benchmarks/trust.py`, predictions beside exact orbits; ``predictions``: half and twice of the
number change no prediction of fourteen loops (`benchmarks/half_and_twice.py predictions`). Where nothing else
is said a number bounds work, or parts what rounding and tolerances leave from what a motion does, by a few
powers of ten on either side.
"""

from __future__ import annotations

import math

import numpy as np

from ...thresholds import FEW_ROUNDED, SQRT_EPS
from ..thresholds import LOG_NUDGE

# --- rounding ---------------------------------------------------------------------------------------

ON_EDGE = 1e-9
"""Relative excess of a place over the edge of a range, or the end of a branch, that is none: users write an
end with some eps of rounding, and nothing else is meant by a place so near to it."""

# --- scanning for crossings -------------------------------------------------------------------------

ORDERS = 9
"""Harmonics that a prediction keeps, by which it is told what they feed back: of a square wave they have all
but a fifth of the power beyond the fundamental, (1/9 + 1/25 + 1/49 + 1/81) / (pi^2 / 8 - 1)."""

OMEGA_POINTS, OMEGA_POINTS_DRAWN = {True: 1000, False: 200}, 500
"""Frequencies of a range: memoryless, where a point costs one H, dynamic, where it costs an orbit; of a
measured H that is drawn, as many as a picture has dots or so. Crossings lie between them all the same: steps
across which H changes are halved (`SCAN_CHANGE`)."""

OMEGA_BEYOND, OMEGA_SPAN, OMEGA_LEAST = 100, 1e4, 1e-3
"""Frequencies looked at, beyond poles and zeros either way: there H is its asymptote to 1e-4 of its size and
0.01 rad; least span, the same either way of one pole; lowest one of a range from zero."""

SAME_STEPS, SPREADS = 3, 3
"""Steps of the grid within which an interpolated crossing is one already found; standard errors of an average
that |1 + N H| may come to at a crossing. Half and twice of either change nothing in seven loops verified."""

SCAN_CHANGE, SCAN_HALVINGS, SCAN_STEP, SCAN_MOST = 0.15, 12, LOG_NUDGE, 3000
"""Change of H from point to point up to which steps of ln omega are halved: a chord then errs by an eighth of
its square, 0.3 %; how often, to what step, that of difference quotients, to how many."""

SCAN_QUICK = 60_000
"""Points of a closed form that depends on frequency up to which a grid is refined: of a mass with friction,
of 0.6 us each, they take 0.04 s, of a gap, of 0.2 ms each, 12 s."""

QUANTIZER_LEVELS, BEYOND_CORNER = 200, 4.0 ** np.arange(-10.0, -3.0)
"""Of a quantizer, whose corners enter the grid: beyond N differs from 1 by less than 1e-3; distances from a
corner on, relative, that enter as well."""

SCAN_AT_ONCE, CELLS_AT_ONCE = 1 << 16, 1 << 18
"""Points of a closed form between two chances to interrupt it; grid points looked at together, what bounds
the memory of a large grid."""

JUMPY = 1e-6
"""Spread of an average from which N jumps from point to point: more than orbits that close err by."""

MARGIN, CUTS, MOST_PER_CELL = 0.3, 4, 4
"""Of a cell's spread of values, by which a zero may hide beyond its corners; parts of a side of such a cell
from which Newton's method starts, the nearest few (predictions)."""

MOST_STARTS = 600
"""Of Newton's method: bounds work. Where there are more, the result says so, and crossings are sought by a
search without this bound."""

CROSSING_ACCEPTED, CROSSING_SETTLED, CROSSING_GIVEN_UP = SQRT_EPS, 1e-13, 1e-3
"""|1 + N H| of a crossing: thirty times what orbits leave of N; step that moves nothing, 450 eps; |1 + N H|
that quadratic convergence leaves behind after eight steps (predictions). One that needs no other step: where
rounding begins (`FEW_ROUNDED`)."""

CROSSING_RANK = FEW_ROUNDED / LOG_NUDGE
"""Singular value, over the largest, below which rounding is what differences show, 1.4e-9: at a tangential
crossing, or near a fold, a step is then one of least squares."""

SAME_CROSSING, TOGETHER = 1e-5, 1e-3
"""Difference of ln a and ln omega below which two zeros are one: where |1 + N H| is rounding (`FEW_ROUNDED`)
one that is tangential is known to the root of it, 1e-7; of a cell: starts so near to each other converge to
one zero (predictions)."""

NOT_REAL = 1e-6
"""Imaginary part of H, over it, at a crossing of the real axis: bisection leaves 1e-15 or so, and more is a
pole, where the phase jumps."""

SMOOTH_STEP = 0.5 * math.pi
"""Largest phase step between data points for which their phase is followed [rad]: half of what would leave
its direction open."""

INDENT = 1e-4
"""Radius of the contour's way round a pole, relative to the frequencies looked at: to a picture a point."""

# --- branches ---------------------------------------------------------------------------------------

BRANCH_NEAR, BRANCH_FAR = 0.2, 0.5
"""|1 + N H| on the grid up to which coexisting motions are looked for: their N differ by some 15 %. To it
comes what a grid step changes, as a^-1 omega^-2."""

BRANCH_SAME, BRANCH_AGREES = 1e-4, 1e-6
"""Of ln a, ln omega: two crossings at one place; relative difference of N between branch and block, a
thousand times the error of orbits: the block names this motion itself."""

BRANCH_FOLD, BRANCH_POINTS = 1e-9, 100
"""Slope that is a fold, where a does not follow s; frequencies at least."""

# --- harmonics fed back -----------------------------------------------------------------------------

WAVE_SAMPLES, STATIC_HARMONICS, DYNAMIC_HARMONICS = 2048, 63, 21
"""Of a waveform, 32 to the shortest wave kept (predictions); harmonics of it that are fed back to laws
without time, and to blocks with dynamics, which answer them hardly (`DYNAMIC_ERROR`): of a square wave the
first that is left out is 1/65, 1.5 %, and 1/23, 4.3 %, of the fundamental before a low-pass H attenuates it.
With half of the former the cycle of a relay comes out 1.4e-5 off in a and 5e-6 in omega, with twice as many
by less than 1e-5."""

CHORD_POINTS = 64
"""Points of the chord between two samples where a law jumps: it is then known to a 64th of 2048 samples
(predictions)."""

JUMP_DENSER, STEP_LEFT = 4, 0.5
"""How many times as many samples tell whether a law jumps, and what is left of its largest step then: of a
smooth one a quarter, of a jump all; half is as far from either."""

WAVE_FLAT = 1e-9
"""Step between samples, over the largest, that is none, of an input or of a law's values."""

PATH_CLOSED = 1e-7
"""Defect, relative to the fundamental, of a point on the curve: far below the least band (`BAND_LEAST`)."""

PATH_LATE = 100
"""Times `PATH_CLOSED`: defect of a point that Newton's method brings no nearer."""

PATH_LONGEST, PATH_SHORTEST, PATH_STEPS = 0.25, 1e-3, 80
"""Steps along the curve: the longest, a quarter of what feeds all harmonics back; the shortest, and how many
(predictions). With half of the longest the curve of one gap, on which motions coexist, is not followed to its
end."""

ASTRAY = 0.3
"""Share of a step by which the corrector may move: more, and the step is halved, as where the curve bends
(`CURVE_BEND`); else the next one is longer (predictions)."""

PATH_ENDS_NEAR = 2 * PATH_LONGEST
"""Change of an unknown that the last point of a curve may be off what its tangent predicts: farther off it
lies on another curve."""

PATH_SLOW = 0.5, 0.9
"""Defect over the one before from which Newton's matrix is recomputed, or the search is over. Half and twice
change where the curve of one gap, on which motions coexist, ends, and no other prediction."""

PROBE = 0.05 * np.exp(0.7j)
"""Third harmonic, relative, that asks for oddness: small, of no special phase (predictions)."""

NAMED = 0.01
"""|1 + N H| of a motion that is taken for the one of the prediction: N of motions that coexist differ by some
15 % (predictions)."""

PATH_REACH = np.log([30.0, 10.0])
"""In amplitude and frequency, beyond which a curve is given up: bands of `unreliable` are narrower
(`BAND`)."""

# --- grades and bands -------------------------------------------------------------------------------

SAFETY = {False: 1.5, True: 4.0}
"""On the shift that the returned harmonics cause, by whether the block has dynamics: of an impact's
harmonics, which fall slowly, fewer are kept (worst of ``trust``: 3.1 for a gap)."""

MEMORYLESS_ERROR, DYNAMIC_ERROR = (1.5, 0.0), (0.01, 0.4)
"""Relative error of N from returned harmonics d where they cannot be carried, c1 d + c2 d^2. A jump or a
corner responds to its harmonics at once; a mass hardly (friction and backlash loops of tests/problems.py:
0.003 at 0.10, 0.007 at 0.20, 0.21 at 0.79)."""

BAND_LEAST, BAND_MOST = 1e-3, 50.0
"""Least half width of a band, half of the third digit that tables show; largest, whose exponential is still a
number."""

FOLD = (SAFETY[False], 1.15)
"""Times the harmonics there are, at which a fold makes a prediction doubtful, as the shift that they cause is
taken times that; unreliable: those that are left out may make up the difference (`WAVE_SAMPLES`)."""

VAGUE, IRREGULAR = 0.3, 0.05
"""|1 + N H| beyond which an average over irregular motion places no crossing, however it spreads, and up to
which it does, however little."""

GUESSED = 1e-6
"""Harmonic, over the fundamental, whose H outside the data matters: a thousandth of the least band."""

DISTORTION = (0.2, 0.6)
"""Fed-back harmonics, relative: doubtful, unreliable above. By `DYNAMIC_ERROR` they change N by 2 % and by
15 %."""

SENSITIVITY = (6.0, 40.0)
"""Relative change of a for a relative error of N: doubtful, unreliable above. An error of N of 2 % then moves
a by 12 % and 80 %, about as far as `BAND` has it."""

BAND = (0.15, 0.7)
"""Half width of the bands, in ln a and ln omega: doubtful, unreliable above, a factor of 1.16 and of two."""

LOEB = 0.02
"""Sine of the angle between the curves below which Loeb's sign means nothing: an error of N of 2 % may turn
them by as much."""

BOUND_HARMONICS = np.arange(3, 62, 2)
"""Of the bound of Mees and Bergen: those beyond are bounded together."""

WINDOWS, BOUND_POINTS = (0.1, 0.4, 1.2), 161
"""Half widths tried, in ln a and ln omega; points of a side."""

BESIDE_CORNER = 0.37
"""Distance from a corner, over its place and one, at which a law is asked whether it is odd: no symmetry
meets it."""

SHOWS_BY, STRAYED, OWNED_WITHIN, LINE_HALVINGS = 8, 6, 3, 5
"""Steps by which quadratic convergence shows, twice the four that lead to all digits; how far from its start,
in steps of the grid, a search has strayed; how near a crossing another one owns it; halvings of a step that
does not come nearer (predictions)."""
