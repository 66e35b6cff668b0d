"""Every tuned number of predicted and exact limit cycles, with what it follows from or what chose it.

``trust`` is `benchmarks/trust.py`, predictions beside exact orbits. Where nothing else is said a number
bounds work, or parts what rounding and tolerances leave from what a motion does, by a few powers of ten on
either side.
"""

from __future__ import annotations

import math

import numpy as np

# --- rounding ---------------------------------------------------------------------------------------

NOTHING = 1e-300
"""What quotients are divided by where their divisor may be zero."""

ROUNDED = 1e-12
"""Relative difference of two numbers of some terms that are one; a pole of a sampled system at the origin."""

ON_EDGE = 1e-9
"""Relative excess of a place over the edge of a range that is none."""

RANK = 1e-12
"""Singular value, over the largest, that steps of Newton's method leave out."""

# --- exact orbits -----------------------------------------------------------------------------------

CLOSED, ACCEPTED = 3e-10, 1e-7
"""Mismatch after a period, relative to the size of each state: what runs at `PERIOD_RTOL` allow, and where
events limit what can be reached."""

PERIOD_RTOL, COURSE_RTOL, LOOK_RTOL = 1e-11, 1e-8, 1e-6
"""Tolerance of periods that are differentiated; of courses that are followed; of a first look at sizes."""

RETURN_RTOL = 1e-9
"""The same of a course whose returns are sought."""

NEWTON_LONGEST, STRETCH = 0.3, 4.0
"""Longest step, in sizes of the orbit; change of the period on the way, as a factor."""

STALLED, STALLS = 0.9, 6
"""Mismatch over the best one that is no progress, and how many such steps end the search."""

STILL = 1e-6
"""Swing, relative to the motion that Newton started from, below which there is no orbit."""

REPEATED = 100
"""Times `ACCEPTED`: mismatch of a part of an orbit that went round several times."""

MOST_ROUNDS = 32
"""An orbit closed after so many rounds or fewer is told from the one of a single round."""

ON_CIRCLE = 1e-6
"""Distance from the unit circle below which a multiplier says nothing of stability: differences are that
good."""

ORBIT_POINTS = 1025
"""Instants of an orbit that is returned: a picture shows no more."""

FREE_POINTS = 65
"""Instants among which the middle of a free stretch is looked for."""

SAME_ORBIT, SAME_ROUGHLY, SAME_SIZES = 1e-4, 2e-2, 10
"""Difference of frequency of two orbits that are one, of averages; times that, of amplitudes."""

# --- monodromy --------------------------------------------------------------------------------------

PERIOD_EVENTS, PERIOD_STEPS = 5000, 200_000
"""Events of a period, and steps between two of them."""

PERIOD_REACH, REACH_AT_FIRST = 1e-6, 1e-9
"""Of a period: the time over which rates of inputs are taken; in seconds, until one is known."""

TOLD = 1e-7
"""Of what the other states move a state by in a period: a size below that is rounding."""

SLOPE_NUDGE, FLOW_NUDGE, EVENT_NUDGE = 1e-4, 1e-5, 1e-6
"""Differences by a state, over its size: of rates whose magnitude alone counts; of flows, whose second order
is the cube root of eps squared; of margins and jumps, which are nearly linear."""

# --- symmetry ---------------------------------------------------------------------------------------

MODE_SAMPLES = 4
"""States of each mode an orbit visits that are asked."""

SHIFT_NUDGE = 1e-4
"""Of the difference quotients, relative to the size of a state."""

NULL = 1e-8
"""Singular values below, relative to the largest, make candidates."""

SHIFT_SAME = 1e-11
"""Relative change of rates and margins by a shift of half the size; rounding leaves 1e-15."""

# --- other ways to close an orbit -------------------------------------------------------------------

PIECES, PIECES_CLOSED, PIECES_ITERATIONS, PIECES_LONGEST = 8, 1e-9, 30, 0.5
"""Of multiple shooting: pieces, mismatch at every joint relative to the size of each state, Newton's steps,
and the largest change of a state in one."""

SHRINK_STEPS, SHRINK_FIRST, SHRINK_LONGEST, SHRINK_LONGER = 120, 0.1, 0.2, 1.5
"""Steps along the curve of a shrinking mismatch, their lengths in sizes of the orbit, and their growth."""

SHRINK_BEND = 0.8
"""Cosine of the angle between the tangents at its ends from which a step is short enough."""

SHRINK_CLOSED, ACROSS, SHRINK_SHORTEST = 1e-4, 1e-3, 1e-5
"""Over the first mismatch: defect of a point on the curve; step across a corner; step at which the curve is
taken to have one."""

SHRINK_FAR = 2.0
"""Change of a state, in sizes of the orbit, or of the logarithm of the period: given up beyond."""

VISIT_SAMPLES, VISITS = 1 << 15, 60
"""Of a waveform, among which visits of the straight pieces of a law are looked for; pieces of a cycle."""

VISIT_CLOSED, VISIT_ITERATIONS, VISIT_LONGEST = 1e-11, 30, 0.5
"""Defect, relative to the sizes of the orbit, of one put together from exact pieces; Newton's steps, and the
longest."""

VISIT_SIZE, VISIT_RANK = 1e-3, 1e-14
"""Size of a state, over the largest, at least; singular value that a step leaves out."""

# --- starts -----------------------------------------------------------------------------------------

FACTORS = (0.3, 1.0, 0.1, 3.0, 0.03, 10.0)
"""Sizes of kicks, of the scale, in the order tried."""

INSIDE_STOPS = 0.9
"""Share of the way to a stop that a kick may take."""

DECADES, BENT, JUMPED = np.arange(-40.0, 41.0), 0.01, 1e6
"""Sizes over which a smooth law is asked where it bends; change of its slope, relative, from which it does;
factor over which any power grows by more than twofold, unless a jump hides it."""

BEND_HALVINGS = 60
"""Halvings to the bend itself: decades belong to a unit."""

POLE_AT_ZERO, REAL_ROOT = 1e-9, 1e-6
"""Pole frequency, over the largest, of an integrator; imaginary part of a real root: the root of eps,
thrice."""

SAMPLED_SLOWEST, SAMPLED_POINTS, SAMPLED_PACE = 1e-6, 600, 0.1
"""Of a sampled controller: frequencies looked at, over the Nyquist frequency, and how many; the pace of one
without poles, over a sample."""

FORCED_PERIODS, FORCED_STEPS = 40, 400_000
"""Of forced motion before it is measured, and their work."""

FORCED_STARTS = ((0.1, 0.0), (0.5, 3.0), (0.5, -3.0))
"""Stretch of a joint, over its gap, and speed over a gap a radian, from which motions are forced."""

MEAN_SEEN = 1e-9
"""Mean of an output, over its harmonics, that an integrator has to hold."""

# --- courses ----------------------------------------------------------------------------------------

WORK, SAMPLED_WORK, LOOK_WORK = 300_000, 400_000, 50_000
"""Integration steps of one course, of one stride between samples, of a first look."""

FEW = 12
"""Crossings within that work, below which it is no use."""

CROSSINGS, CROSSINGS_AVERAGED, CROSSINGS_VERIFIED = 1000, 40, 200
"""Of one course; that an average takes; of the simulation beside a verified orbit."""

STRIDE, LOOK, LOOK_POINTS = 20, 0.1, 129
"""Half swings, at the loop's own pace, of a stride; share of it that shows sizes, and points in it."""

QUIET, PATIENCE = 40, 400
"""Strides without a passage after which a loop is called at rest: if nothing in it moves on, and while
something does (an integral that winds up, a slow mode)."""

DEAD = 1e-9
"""Of the largest state met, below which a loop without passages is at rest."""

STRIDE_SAMPLES, ON_TICK = 1024, 1e-6
"""In a stride, where passages are looked for among samples; share of a sample within which an instant is
one."""

FAINT = 1e-6
"""Of the highest peak met, below which swings count as rest."""

REPEATS, REPEATS_EXACTLY, REPEATS_LEAST = 1e-7, 1e-9, 1e-6
"""Change of a passage, over the size of the state, that is none: where Newton follows, and where none does;
size at least, over the largest."""

EVEN, STEPS, TENFOLD = 0.05, 3, math.log(10.0)
"""Spread of logarithmic growths within which a growth counts as steady; such growths in a row, at least; two
do where each is as large."""

WITHIN = 0.1
"""Of the input up to which a block is a straight line: there the loop is linear."""

RECENT, RECENT_CLOSED = 64, 12
"""Laps among which steady growths are looked for; among which the pair is that comes nearest to repeating."""

BEYOND = 10.0
"""Times the largest kick's first swing: growth at a steady ratio from there has no bound."""

GONE = 1e4
"""Times what the largest kick sets in motion: a loop beyond it has run away."""

STEADY, LASTING_GROWTH, LASTING_DECAY = 1.25, 0.5, 0.9
"""Change of the swings from the third to the last quarter of a course below which they keep their size, and
the share of it (logarithmic) of the quarter before: a decay is geometric, growth may be a power (0.66 if
quadratic)."""

ENOUGH = 6
"""Swings from which an orbit can be judged."""

HALVINGS, ASKED, WIDTH = 40, (6, 12, 18, 26, 40), 1e-3
"""Of the interval between two starts of different fate; halvings after which the motion on the border is
tried for an orbit; relative width of a border whose orbit is known."""

LINGERS, WOUND = 0.3, 1e-9
"""Change from passage to passage of a course that lingers; factor of growth that is at least more than
one."""

RETURN_POINTS, RETURN_GONE, RETURN_NEAR = 4097, 0.1, 0.5
"""Instants among which a course's returns are sought; distance that is away, and near again."""

AVERAGE_POINTS, EVENTS_KEPT = 2049, 200
"""Instants of an averaged motion that is returned, and events."""

THERE, BESIDE, ON, PASSAGES = 1e-3, 0.03, 1e-5, 3
"""Of an orbit's size: a passage so near a stable one, and coming nearer, ends on it; the same for one that
lingers beside an unstable one; relative difference of the time between crossings from the period within which
it is that near; passages in a row that come nearer."""

ORBIT_SIZE = 1e-9
"""Size of a state of an orbit at least, over what it is measured in."""

# --- predictions beside orbits ----------------------------------------------------------------------

SAME_CYCLE, SAME_AS_PATH = (1.25, 2.0), (1.1, 1.3)
"""Factors of frequency and amplitude within which a prediction and an orbit are taken for one cycle; for the
end of a path, which lacks the highest harmonics only."""

AT_ITS_END = 1e-3
"""Distance of an orbit from the end of its path that harmonics left out may explain."""

NEAR_MISS = 0.3
"""Mismatch after a period, relative to the orbit, from which it is worth following."""

CONFIRMED_WITHIN = 0.05
"""In frequency and amplitude: within, a prediction is called confirmed; beyond, it is the same cycle,
shifted."""

LEFT_ALONE = (0.2, 5)
"""Amplitude of a simulation beside an orbit, over the orbit's, that has not left it."""

# --- scanning for crossings -------------------------------------------------------------------------

ORDERS = 9
"""Harmonics that a prediction keeps."""

OMEGA_POINTS, OMEGA_POINTS_DRAWN = {True: 1000, False: 200}, 500
"""Frequencies of a range: memoryless, dynamic; of a measured H that is drawn."""

OMEGA_BEYOND, OMEGA_SPAN, OMEGA_LEAST = 100, 1e4, 1e-3
"""Frequencies looked at, beyond poles and zeros either way; least span; lowest one of a range from zero."""

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

ACCEPT, CONVERGED, SETTLED, HOPELESS = 1e-8, 1e-14, 1e-13, 1e-3
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

PATH_NEWTON = 12
"""Newton's steps for one point."""

SLOW = 0.5, 0.9
"""Defect over the one before from which Newton's matrix is taken anew, or the search is over."""

PROBE = 0.05 * np.exp(0.7j)
"""Third harmonic, relative, that asks for oddness: small, of no special phase."""

NAMED = 0.01
"""|1 + N H| of a motion that is taken for the one of the prediction."""

PATH_REACH = np.log([30.0, 10.0])
"""In amplitude and frequency, beyond which a curve is given up."""

ODD = 1e-7
"""Even harmonics and mean of the answer to an odd waveform, below which a block is odd."""

# --- grades and bands -------------------------------------------------------------------------------

SAFETY = {False: 1.5, True: 4.0}
"""On the shift that the returned harmonics cause, by whether the block has dynamics: of an impact's
harmonics, which fall slowly, fewer are kept (worst of ``trust``: 3.1 for a gap)."""

MEMORYLESS_ERROR, DYNAMIC_ERROR = (1.5, 0.0), (0.01, 0.4)
"""Relative error of N from returned harmonics d where they cannot be carried, c1 d + c2 d^2. A jump or a
corner answers its harmonics at once; a mass hardly (friction and backlash loops of tests/problems.py: 0.003
at 0.10, 0.007 at 0.20, 0.21 at 0.79)."""

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
"""Half width of the amplitude band, in ln a: doubtful, unreliable above."""

LOEB = 0.02
"""Sine of the angle between the curves below which Loeb's sign means nothing."""

BOUND_HARMONICS = np.arange(3, 62, 2)
"""Of the bound of Mees and Bergen: those beyond are bounded together."""

WINDOWS, BOUND_POINTS = (0.1, 0.4, 1.2), 161
"""Half widths tried, in ln a and ln omega; points of a side."""

BESIDE_CORNER = 0.37
"""Distance from a corner, over its place and one, at which a law is asked whether it is odd: no symmetry
meets it."""
