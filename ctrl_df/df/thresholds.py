"""Every tuned number of describing functions, with what it follows from.

eps is the spacing of floats at one, 2.2e-16. Where nothing else is said a number bounds work or memory, or
parts what rounding and tolerances leave from what a motion does, by a few powers of ten on either side. A(n)
is the dimensionless amplitude a/(M2 h omega^2) of two masses with a gap.
"""

from __future__ import annotations

import math

import numpy as np

# --- rounding ---------------------------------------------------------------------------------------

DIGIT = 4e-16
"""Relative step at which Newton's method has converged to the last digit: two eps."""

NOTHING = 1e-300
"""What quotients are divided by where their divisor may be zero."""

ANALYTIC = 1e-15
"""Residual stated for closed forms: rounding."""

ROOT = 1e-15
"""To which roots of smooth functions are found: five eps."""

ON_GRID = 1e-12
"""Relative difference within which an amplitude is one of a grid: how users write it."""

PROBED, SAME_BLOCK = 8, 1e-6
"""Points of a loaded family at which a block is asked whether it is the one that the family was computed of,
and the relative difference of N up to which it is: orbits close to 1e-9 or so. One point that agrees will do:
where motions coexist the neighbours of a point decide which of them a family follows."""

# --- memoryless laws --------------------------------------------------------------------------------

EVEN_SEEN = 1e-9
"""Even harmonics, over the largest, from which a response is asymmetric."""

MOST_STAIRS = 2_000_000
"""Edges of a quantizer that are summed one by one."""

DEPTH = 52
"""Halvings of an interval of a quadrature: to the last digit of an angle."""

MOST_INTERVALS, MOST_CORNERS = 20_000, 600
"""Intervals for one amplitude; kinks of a law that are located."""

SHARPENED, SHARPENED_POWER = 200, 1.5
"""Of QUADPACK's estimate (200 d)^1.5 from the relative distance d of Gauss's sum to Kronrod's."""

NULL_SHARE = 0.1
"""Share of what the two highest of fifteen polynomials pick up that stands for an error: a law with a corner
leaves as much in those beyond."""

INTERVAL_SHARE = 0.02
"""Share of the tolerance that one interval may have: fifty of them are many."""

LAW_PROBES = 25
"""Points at which a law is asked whether it takes arrays."""

SCAN_LEAST = 1e-6
"""Smallest argument at which corners are looked for, over the largest."""

CORNER, CORNER_LEAST = 20, 1e-7
"""Change of slope that is a corner: over the median around it, and over the largest slope, beyond
rounding."""

CORNER_WINDOW = 7
"""Changes of slope whose median is that around one. A kink makes two of them, most of three: at 3 it escapes,
for up to seven times the calls; at 15 the corners of nine laws are those found at 7."""

CORNER_HALVINGS = 60
"""Halvings toward a corner: to the last digit."""

JUMPS = 10
"""Step between samples, over the median, that is a jump."""

SAMPLES = 4096
"""Calls a period of a block that keeps its own memory: its fundamental is then right to 1e-3."""

SMALL, NO_GAIN, UNBOUNDED = (1e-9, 1e-8, 1.0), 1e-13, 5
"""Amplitudes, over the largest, from which N(0) is taken; what of it is rounding; growth of N from the second
to the first from which N(0) is infinite: a jump makes it ten, a slope one."""

STATIC_PROBES = 33
"""Arguments at which a callable is asked, up and down, whether it has a memory: hystereses of width 1e-3 to
0.3 of the range show at half and at twice as many."""

# --- dry friction -----------------------------------------------------------------------------------

SHORT_ARC = 0.5
"""Arc [rad] below which the closed form of its harmonics cancels (velocity ~ arc^3, force ~ arc^2): it is
integrated by Gauss's rule instead, which loses nothing."""

ARC_NODES, PANEL = 16, 8.0
"""Nodes of that rule; phase [rad] of the highest harmonic that they integrate to 1e-15."""

SERIES, SERIES_TERMS, SERIES_END = 1e-8, 24, 1e-17
"""Argument below which the first term of a series is all of it, the root of eps; terms of one up to half a
radian, and the size of the last, over the sum."""

ARC_STEPS = 60
"""Newton's steps to the end of an arc, kept inside by halving: to the last digit even by halving alone."""

# --- a ball between two walls -----------------------------------------------------------------------

CHATTER, TURNED = 3e-4, 0.01
"""Time [rad] left of a chatter below which contact is sustained, and the change of what presses in it."""

EXACT, ROUGH = 1e-6, 1e-3
"""Halley's step, over the time of an impact, at which it is taken. The step is still made: the time is then
good to its cube. Rough serves where a motion is only followed."""

IMPACT_STEPS = 80
"""Such steps at most, kept inside by halving."""

LONGEST_FLIGHT = 1e4
"""Periods of one flight beyond which the motion counts as free of contact."""

NEAR_ELASTIC = 0.9
"""Restitution from which the speed of the two-impact motion is taken from the sum, not the difference, of the
speeds before and after."""

LAG_SERIES = 0.3
"""Angle up to which r - sin(r) is a series of five terms, whose rest is below eps."""

CLOSES = 1e-6
"""Mismatch, relative, of a flight with the closed form of its motion, and of N of one motion found twice."""

RECURS = 1e-5
"""Distance of a recurrence from which Newton's method is tried."""

BLOCKS, RARE = 8, 8
"""Parts from which an average's spread is estimated; impacts in each of them, at least."""

SHORT_AVERAGE = BLOCKS
"""Periods of an average that nobody has a use for: one for each part."""

ATTRACTOR_STARTS, ATTRACTOR_PERIODS, ATTRACTOR_TRANSIENT = (8, 5), 600, 300
"""Phases and speeds of the impacts from which coexisting motions are listed by default; periods of an
average, and given to settle: bounds work."""

IMPACTS = 200
"""Bound on impacts per period of the budget, chatter included."""

SETTLED_IMPACTS, MEMORIES, MEMORY_LEAST = 200, 20.0, 0.01
"""Impacts given to settle where they are rare, besides 20 times the memory 1/(1 - eps) of them, at most
100."""

MOST_TRIES, MOST_APART = 100, 4096
"""Recurrences that are tried; impacts between two states that recurrences are measured from."""

POLISH_STEPS, POLISHED, POLISHED_LATE = 15, 1e-14, 1e-10
"""Newton's steps for one orbit; mismatch at which it is closed, at once or where it shrinks no more."""

PERIOD_OFF = 0.01
"""Time [rad] by which an orbit may miss its half periods before it is another one."""

POLISHED_SHRINKS = 0.25
"""Mismatch over the one before, beyond which it shrinks no more: near an orbit each step squares it."""

DIVERGES = 10.0
"""Growth of the mismatch from step to step at which Newton's method is left."""

ELASTIC_RADIUS = 1e-9
"""By how much a multiplier may exceed one where nothing is lost: it is one, but for rounding."""

MOST_PERIODS = 2000
"""Of a subharmonic motion: a longer one is followed by no search here."""

VAGUE = 0.5
"""Spread from which an average says little: other starts may lead to a motion with a period."""

IMPACT_STARTS = np.array([[-0.5 * math.pi, 0.0], [-1.0, 0.7], [0.9, 0.4], [2.2, 1.3], [-2.6, 0.2]])
"""Starts (phi, w in units of 1 + A) tried in turn: from sustained contact, then from impacts of some
speed."""

FIRST_PHASE = 0.1
"""Phase [rad] of the first of a grid of impacts: none falls on a symmetry."""

GRID_STEP = 0.02
"""Of s, in the grids of two-impact motions."""

LEAST_FOLD = 1e-9
"""Least A of a fold: without dissipation (eps = 1) it lies at 0."""

COEXISTING, AROUND = 0.01, 5
"""Steps of ln A with which coexisting motions are looked for, and how many on either side of a place."""

MOST_PLACES = 800
"""Amplitudes at which they are looked for."""

FOLLOWED, FOLLOWED_LEAST = 0.004, 1e-4
"""Steps of ln A along a motion that attracts, and the least where it ends."""

FOLLOWS = 0.05
"""Difference of phase and speed, relative, between two such steps that is still one motion."""

MOST_NODES = 2000
"""Such steps at most: eight of ln A."""

BRANCH_TRANSIENT = 100
"""Periods; coexisting motions that attract any slower are left to the family."""

SAME_CURVE = 1e-3
"""Relative distance of n between a motion found and a curve known: one curve."""

# --- forced periodic orbits -------------------------------------------------------------------------

RTOL, COARSE = 5e-10, 1e-6
"""Tolerance of shots, and while a transient is followed: it only leads near the orbit."""

TOLERANCE = 5e-10
"""Error of an orbit's state, relative to its size: that of the shots themselves."""

SHOTS, SHOTS_ALONE = 20, 24
"""For one orbit in a line and alone, beside those for Jacobians: while it comes nearer, no other start is
cheaper."""

NOISE = 4.0
"""Errors in tolerances of a shot below which it is the shots that differ, not the states."""

SHARP = (100, 1e3)
"""Mismatch and error, in tolerances of a shot, that are taken where fresh Jacobians bring it no nearer: along
directions that hardly attract the error is larger than the mismatch."""

ROUGHLY, SHARPER = 3e-5, 1e-2
"""Tolerance of shots far from the orbit, and over the mismatch expected of them, a hundredth of which spoils
no correction of the Jacobian: of several both took the fewest steps over thirteen families."""

STALE, JACOBIANS = 0.9, 5
"""What is left of a mismatch after a step where the Jacobian is differenced again, and how often:
beyond, following the motion is cheaper."""

WORSE = 1.5
"""Growth of the mismatch after a step by a fresh Jacobian, the second one or later, from which no orbit is
near. Up to it the errors of shots may be what grows. Half and twice were not tried."""

TOO_FAR = 2.0
"""Newton's step, in sizes of the motion, that leads out of its reach: the shot itself leads nearer."""

EXPECTED, SHRINKS, SHRINKS_FIRST = 1e-2, 0.1, 0.01
"""Mismatch expected of the first shot; ratio of two that is expected to hold, and that of the first two."""

SOON = 20.0
"""Closing error expected, in tolerances, from which a shot takes its integrals along: it costs half as much
again, one that closes without them is made twice."""

FAR_OFF = 0.1
"""Shift of a free position, over its travel, beyond which a shot is taken again about its new centre."""

STILL = 1e-14
"""Square of a step, relative, below which it measures rounding and corrects no Jacobian."""

ASIDE = 0.05
"""Share of a step, squared, that has to lead aside of those before for what they have shown to be kept: of
0.01, 0.05 and 0.2 the middle one took the fewest steps over sixteen families."""

ONE_SIDED = 0.5
"""Of differences to one side, relative, over the root of a shot's tolerance: there what the tolerance leaves
of them and curvature are as large as each other."""

PIVOT = 1e-9
"""Pivot, relative, below which a step is singular."""

SQUARINGS = 12
"""Squarings of a matrix from which its spectral radius is taken: its 4096th power, to a few 1e-4."""

NEUTRAL_SHOT = 1e-3
"""By how much a multiplier may exceed one: neutral directions, differenced, come out near it."""

SIZE_KEPT, SIZE_FORGOTTEN = 0.05, 0.1
"""What is left of the size of a coordinate, and of a state, after a shot: that of a larger motion before must
be forgotten."""

TOUCHING = 1e-9
"""Distance and speed, relative, within which contact survives what rounding leaves of it."""

CHATTER_ROOM, SHOT_EVENTS = 60, 256
"""Times that a run goes on where the event log is full; events in it."""

FIRST_STEP, FIRST_LONGEST, FIRST_STALE = 0.02, 0.1, 5.0
"""Of a period: first step of a shot, and the longest one left by the shot before; how many times the former
one left by another run may be."""

AT_ONCE = 64
"""Shots, or points of a line, between two chances to interrupt them."""

FAMILIAR = 1e3
"""Factor between sizes of motion for which laws need not be evaluated again."""

BINS = 2
"""Decades of force and of frequency: within them sizes, up to A / omega^2, differ by `FAMILIAR`."""

SIZING_STEPS = 20_000
"""Steps of the run that shows the sizes of states which belong to no mechanism."""

SIZE_AT_FIRST = 1e-3
"""Size of the states before any motion, over those of a free inertia."""

WITHIN = 0.3
"""Of a gap, off its faces and its middle: where a motion from rest begins."""

NUDGE = 1e-3
"""Of the size of each coordinate: far above rounding, within the reach of Newton's method."""

GAP_STARTS = ((0.0, 0.0), (0.0, 0.7), (1.0, -0.4), (0.0, 1.3), (1.0, -0.2))
"""Face of a gap to begin at, and speed to leave it with over that which crosses it in a radian: none, and
some below and above; one that stays in touch is enough."""

GAP_PERIODS, NUDGED, LATER, LATEST = 20, 30, 27, 40
"""Periods followed from such a state, and after what breaks a symmetry then; where the first ones did not do,
and before a motion is taken to have no period."""

SETTLED_AT_FIRST, SETTLED_BETTER, SETTLED_AT_LAST = 3e-2, 0.1, 1e-5
"""Change from shot to shot, relative, at which a motion is taken to be near its orbit; by how much less it
must be where none was found; and where no more is tried before the periods are over: coarse shots differ by
little less."""

WAITS = (64, 256, 1024, 4096)
"""Periods followed where a motion is seen to be still on its way."""

PUSHED = 1e-6
"""Speed gained in a period, over that of a free inertia: beyond the error of a closed orbit."""

LINEAR = 1e-3
"""Change of a speed's growth from the one half to the other that is steady."""

EVENLY = 0.5
"""Spread of growths from shot to shot, over their mean, below which a motion grows evenly: none of them is
then without growth."""

RUNS_AWAY = (100, 1e4)
"""Growth of a state over the second half of a trail that is running away, if it grew so much in the first."""

NAN_AHEAD = 1e-6
"""Of a period: how far ahead of a state a law is asked for NaN."""

LONGEST_PERIOD = 12
"""Periods of a subharmonic motion that is recognised."""

LONGER_LEAST, LONGER_BETTER = 3e-3, 0.3
"""Mismatch of the shorter periods: a multiple that closes no better, by this factor, is not tried."""

CHANGES_SEEN = 4
"""Changes from shot to shot by which a slow transient is told from chaos. Half and twice give 18 and 22 of
2,949 motions another name, where several motions coexist or none is periodic, in the same time: none is
better."""

SLOW_CHANGE = 0.3
"""Change from shot to shot, over the size, of a transient that may be followed: chaos changes by all of
it."""

STEADY_SLOPE, STEADY_ERRORS = 1e-6, 4
"""Trend of averages that is none, over their size: what tolerances make; and in its standard errors: for
eight blocks (six degrees of freedom) one steady motion in 140 is then followed longer than need be, for each
of three averages. Half of it follows 22 of 2,949 motions longer, twice changes two names."""

EVENS = 1e-2
"""A motion that repeats so much better after two half periods than after one is not symmetric."""

EVEN_LEAST, EVEN_MISS = 1e-7, 1e3
"""Even harmonics, over the fundamental, of an asymmetric motion: at least, and in mismatches of the orbit."""

TRAVEL = 1e-6
"""Way in a period, relative to the amplitude, from which a motion is called drifting."""

# --- orbits from far off, by damped steps -----------------------------------------------------------

FINE = 2e-13
"""Tolerance of shots."""

GOOD, POOR = 3e-10, 1e-3
"""Last step, relative, from which an orbit counts as closed, and where rounding forbids more: the residual
says so."""

BETTER, GOOD_LATE, FINE_LATE = 1e-3, 30, 100
"""Of `GOOD`: a step that needs no other, and one that will do in the end; of `FINE`: the mismatch of one
where rounding rules."""

NEUTRAL, SQUARINGS_FINE = 1e-6, 28
"""By how much a multiplier may exceed one: central differences are that good; squarings that tell it to a
tenth of that."""

CENTRAL = 2e-5
"""Of central differences, relative: the root of `FINE` times some forty."""

DAMPED_STEPS = 40
"""Newton's steps at most."""

DAMPED_SETTLED = 1e-5, 0.3
"""A step so short that shrinks no more than so far is what rounding leaves."""

LEAST_SHARE = {True: 1e-3, False: 0.3}
"""Of a Newton step that is tried, by patience."""

DESCENT = 0.25
"""Of the share taken of a step: by how much the next step must be shorter, the restricted monotonicity test
of Deuflhard, Newton Methods for Nonlinear Problems (2004), section 3.3."""

SHORTENED, SHORTENED_BY = 0.1, (0.5, 0.25)
"""Share of a step down to which it is halved, and then quartered: bounds the tries."""

REACH = 30
"""First step, in sizes of the motion, from which an irregular one is given up."""

# --- linear orbits and symmetries -------------------------------------------------------------------

UNIT = 2.0**200
"""Of the states and inputs probed: exact, and no constant force is seen beside it."""

RESONANT = 64 * np.finfo(float).eps
"""Distance of a pole from the frequency, relative, that rounding makes."""

UNSTABLE_POLE = 1e-9
"""Real part of a pole, over the largest, that is not rounding: half the digits of a double one and some."""

FORCED = 1e-12
"""Rate of a free speed, over its terms, that a constant force makes, and not rounding."""

PROBES, ALIKE, RIPPLED, ROUNDING = 24, 1e-9, 1e-6, 64 * np.finfo(float).eps
"""Random states at which laws are asked; relative difference of two values that are one; and after a
wavelength, which users round; of the largest value, what rounding leaves of a small one: the force of a
joint that is hardly compressed is a difference of large positions."""

STATE_DECADES, INPUT_DECADES, AT_REST = (-4, 1), (-1, 2), 3
"""Of random states and inputs, over their sizes: below and above what the motion reaches; every third state
has its bodies at rest, where dry friction sets what is held. Half and twice the decades, every second or
sixth at rest: the same symmetries in 23 families."""

SHIFTS = {"place": 1.7, "speed": 0.37, "state": 0.83, "output": 3.7}
"""Shifts of states, over their sizes, that laws are asked about: no simple multiple of anything."""

# --- forces under an imposed motion -----------------------------------------------------------------

IMPOSED_SAMPLES = 1024
"""A period: harmonics of a dry friction's square wave are then right to 1e-6 (the square of a step)."""

PERIODS_AT_MOST, SETTLED, CREEPING = 64, 1e-8, 1e-3
"""Periods at most until what is hidden repeats; its change over one, over the largest it is, that counts as
none, and up to which an orbit that creeps on ever more slowly is taken for its limit, to that accuracy."""

# --- other waveforms --------------------------------------------------------------------------------

WAVE_PERIODS, WAVE_PERIODS_MORE, WAVE_PERIODS_GAP = 3, 30, 20
"""Periods followed before an orbit is closed: at first, then, and where a gap lets motions coexist."""

WAVE_STARTS = ((3.0, 0.0), (0.0, 1.0), (0.0, -1.0), (0.0, 2.0), (-1.0, 0.0))
"""Speeds in the middle of a gap tried in turn: shares of that of the free inertia, and of that which crosses
the gap in half a period. Of 200 waveforms on five joints 157, 171, 175, 185 and 188 are answered with the
first one to all five; with half and twice the speeds 189 and 187."""

# --- families ---------------------------------------------------------------------------------------

LARGEST, COMPRESSED = 2 << 30, 64 << 20
"""Memory [bytes] of a family; up to which its file is made small: beyond, that takes too long."""

HERE, LAW_ROWS = 1 << 14, 64
"""Points of a quick method in one part: some milliseconds; amplitudes of a static law computed together: its
corners are looked for once for them."""

PARTS_AHEAD = 256
"""Parts submitted before the first is taken: what is done and waits takes memory."""
