"""Every tuned number of describing functions, with what it follows from.

Where nothing else is said a number bounds work or memory, or parts what rounding and tolerances leave from
what a motion does, by a few powers of ten on either side. A(n) is the dimensionless amplitude
a/(M2 h omega^2) of two masses with a gap.
"""

from __future__ import annotations

import math

import numpy as np

from ..simulate.thresholds import HEIGHT, STEP_GROWTH, STEP_TIME, STEPS_AT_ONCE
from ..thresholds import EPS

# --- rounding ---------------------------------------------------------------------------------------

DIGIT = 2 * EPS
"""Relative step at which Newton's method has converged to the last digit."""

ROOT = 4 * EPS
"""To which roots of smooth functions are found, the least that SciPy's ``brentq`` takes; what rounding leaves
of closed forms."""

PROBED_POINTS, SAME_BLOCK = 8, 1e-6
"""Points of a loaded family at which a block is asked whether it is the one that the family was computed of,
and the relative difference of N up to which it is: orbits close to 1e-9 or so. One point that agrees will do:
where motions coexist the neighbours of a point decide which of them a family follows."""

# --- memoryless laws --------------------------------------------------------------------------------

QUADRATURE_RTOL = 1e-10
"""Error that quadratures aim at, over the largest value of the law: a fifth of the tolerance of orbits, so
that N of a law without memory is at least as good as one with dynamics."""

EVEN_SEEN = 10 * QUADRATURE_RTOL
"""Even harmonics, or a mean, over the largest, from which a response is asymmetric, 1e-9: ten times the error
that quadratures aim at."""

MOST_STAIRS = 2_000_000
"""Edges of a quantizer that are summed one by one: beyond, N differs from 1 by some
(step / a)^(3/2), 4e-10."""

DEPTH = 52
"""Halvings of an interval of a quadrature: to the last digit of an angle."""

MOST_INTERVALS, MOST_CORNERS = 20_000, 600
"""Intervals for one amplitude: a jump that was not located takes two at each of `DEPTH` halvings, so that 200
of them may be missed. Kinks of a law that are located, of a thousand points at which it is scanned."""

SHARPENED, SHARPENED_POWER = 200, 1.5
"""Of QUADPACK's estimate (200 d)^1.5 from the relative distance d of Gauss's sum to Kronrod's."""

NULL_SHARE = 0.1
"""Share of what the two highest of fifteen polynomials pick up that stands for an error: a law with a corner
leaves as much in those beyond."""

INTERVAL_SHARE = 0.02
"""Share of the tolerance that one interval may have: fifty of them are many."""

LAW_PROBES = 25
"""Points at which a law is asked whether it takes arrays: one that compares, or takes its argument for a
number, fails on any that differ."""

SCAN_POINTS = 401
"""Arguments to either side of zero at which corners are looked for, and a quarter as many in ratios, where a
law bends near zero: corners a four hundredth of the range apart are told from each other."""

SCAN_LEAST = 1e-6
"""Smallest argument at which corners are looked for, over the largest: one nearer to zero changes N by as
little."""

CORNER, CORNER_LEAST = 20, 1e-7
"""Change of slope that is a corner: over the median around it, of 400 points over the range, so that a kink
is seen that changes the slope by a twentieth of what a smooth law changes it by over all of it; and over the
largest slope, beyond rounding."""

CORNER_WINDOW = 7
"""Changes of slope whose median is that around one. A kink makes two of them, most of three: at 3 it escapes,
for up to seven times the calls; at 15 the corners of nine laws are those found at 7."""

JUMPS = 10
"""Step between samples, over the median, that is a jump: of a sine the largest is 1.4 times the median."""

NUM_POINTS = 100
"""Calls a period that users ask for by default: python-control's default, and less than are made
(`SAMPLES`)."""

SAMPLES = 4096
"""Calls a period of a block that keeps its own memory: its fundamental is then right to 1e-3."""

SMALL_AMPLITUDES, NO_GAIN, UNBOUNDED = (1e-9, 1e-8, 1.0), 1e-13, 5
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

SERIES_TERMS, SERIES_END = 24, EPS / 16
"""Terms of a series for arguments of one up to half a radian, 0.5^24 = 6e-8 over 24!; size of the last, over
the sum, that no longer changes it."""

# --- a ball between two walls -----------------------------------------------------------------------

CHATTER, TURNED = 3e-4, 0.01
"""Time [rad] left of a chatter below which contact is sustained, and the change of what presses, g, in it.
The area left out is g CHATTER^3 / 12 at most, 2e-12 g (measured: 7e-13 of N)."""

IMPACT_EXACT, IMPACT_ROUGH = 1e-6, 1e-3
"""Halley's step, over the time of an impact, at which it is taken. The step is still made: the time is then
good to its cube, 1e-18 and 1e-9. Rough serves where a motion is only followed."""

IMPACT_STEPS = 80
"""Such steps at most, kept inside by halving: to the last digit of a time that is 2^-28 of the interval in
which it is looked for, as where the force is far too weak to cross the gap: there 60 miss impacts, and the
motion takes another name."""

LONGEST_FLIGHT = 1e4
"""Periods of one flight beyond which the motion counts as free of contact: more than averages take
(`ATTRACTOR_PERIODS`)."""

NEAR_ELASTIC = 0.9
"""Restitution from which the speed of the two-impact motion is taken from the sum, not the difference, of the
speeds before and after: 1 - 0.9 costs one digit, more costs more."""

LAG_SERIES = 0.3
"""Angle up to which r - sin(r) is a series of five terms, whose rest is below eps."""

CLOSES = 1e-6
"""Mismatch, relative, of a flight with the closed form of its motion, and of N of one motion found twice."""

RECURS = 1e-5
"""Distance of a recurrence from which Newton's method is tried: two steps that square it reach rounding."""

BLOCKS, RARE = 8, 8
"""Parts from which an average's spread is estimated, to 1 / sqrt(2 x 7), a quarter of it; impacts in each of
them, at least."""

SHORT_AVERAGE = BLOCKS
"""Periods of an average that nobody has a use for: one for each part."""

ATTRACTOR_STARTS = (8, 5)
"""Phases and speeds of the impacts from which coexisting motions are listed by default: bounds work."""

ATTRACTOR_TRANSIENT = 300
"""Periods that a motion is given to settle, by default: bounds work."""

ATTRACTOR_PERIODS, FAMILY_PERIODS = 600, 400
"""Periods of an average by default, where motions are listed and in a family, of which many points ask for
one: bounds work."""

IMPACTS = 200
"""Bound on impacts per period of the budget: a chatter takes as many from a radian to `CHATTER` at a
restitution of 0.96, log(3e-4) / log(0.96)."""

SETTLED_IMPACTS, MEMORIES, MEMORY_LEAST = 200, 20.0, 0.01
"""Impacts given to settle where they are rare, as many as of one period (`IMPACTS`), besides 20 times the
memory 1/(1 - eps) of them, which leave exp(-20) = 2e-9 of a start; of the memory at most 100."""

MOST_TRIES = 100
"""Recurrences that are tried: bounds work."""

FIRST_APART, MOST_APART = 8, 4096
"""Impacts between two states that recurrences are measured from: at first, doubled from one to the next, so
that it is soon longer than any motion; at most, which bounds the length of a motion that is found."""

POLISHED_LATE = 1e-10
"""Mismatch at which an orbit is closed where it shrinks no more; at once it is where rounding begins
(`FEW_ROUNDED`). The square of a `RECURS`: one step at least was right."""

PERIOD_OFF = 0.01
"""Time [rad] by which an orbit may miss its half periods before it is another one: a half period is 3.1."""

POLISHED_SHRINKS = 0.25
"""Mismatch over the one before, beyond which it shrinks no more: near an orbit each step squares it, so that
it is rounding that is left."""

DIVERGES = 10.0
"""Growth of the mismatch from step to step at which Newton's method is left: the start was no recurrence."""

MOST_PERIODS = MOST_APART // 2
"""Of a subharmonic motion that is found, which has two impacts a period."""

AVERAGE_VAGUE = 0.5
"""Spread from which an average says little: other starts may lead to a motion with a period."""

IMPACT_STARTS = np.array([[-0.5 * math.pi, 0.0], [-1.0, 0.7], [0.9, 0.4], [2.2, 1.3], [-2.6, 0.2]])
"""Starts (phi, w in units of 1 + A) tried in turn: from sustained contact, then from impacts of some
speed."""

FIRST_PHASE = 0.1
"""Phase [rad] of the first of a grid of impacts: none falls on a symmetry, which multiples of pi / 8 may."""

GRID_STEP = 0.02
"""Of s, 2 % of A, in the grids of two-impact motions: crossings lie between its points, where Newton's method
finds them."""

GRID_LEAST, GRID_LEAST_FOLLOWED = 8, 6
"""Points of a grid at least: of the two-impact motion, which has two sides, and of one that is followed. A
range of a few `GRID_STEP` is then still looked at several times."""

LEAST_FOLD = 1e-9
"""Least A of a fold: without dissipation (eps = 1) it lies at 0, whose logarithm is none."""

COEXISTING, COEXISTING_AROUND = 0.01, 5
"""Steps of ln A with which coexisting motions are looked for, and how many on either side of a place: each is
followed from where it is met (`FOLLOWED`), so that those of a range of 1 % are found."""

MOST_PLACES = 800
"""Amplitudes at which they are looked for: eight of ln A, as far as a motion is followed (`MOST_NODES`)."""

FOLLOWED, FOLLOWED_LEAST = 0.004, 1e-4
"""Steps of ln A along a motion that attracts, between which it is interpolated linearly, to 0.004^2 / 8,
2e-6, of its curvature; and the least where it ends."""

FOLLOWS = 0.05
"""Difference of phase and speed, relative, between two such steps that is still one motion: a dozen times
what A changes by."""

MOST_NODES = round(8 / FOLLOWED)
"""Such steps at most: eight of ln A."""

BRANCH_TRANSIENT = 100
"""Periods; coexisting motions that attract any slower are left to the family."""

SAME_CURVE = 1e-3
"""Relative distance of n between a motion found and a curve known: one curve. Far above what interpolation
errs by (`FOLLOWED`), below what coexisting motions differ by, some 15 %."""

# --- forced periodic orbits -------------------------------------------------------------------------

RTOL_SHOTS, RTOL_FOLLOWED = 5e-10, 1e-6
"""Tolerance of shots, and while a transient is followed: it only leads near the orbit."""

TRANSIENT, AVERAGES = 4, 8 * BLOCKS
"""Periods, by default: followed before Newton's method begins where no neighbour leads to the orbit, so that
a transient that halves in each is down to a sixteenth; and averaged where a motion has no period, eight in
each of the parts that tell the spread."""

ORBIT_STEPS = round(1 / STEP_TIME)
"""Integration steps for one point at most, by default: a million, a second of a small system."""

ORBIT_ERROR = RTOL_SHOTS
"""Error of an orbit's state, relative to its size: that of the shots themselves."""

SHOTS, SHOTS_ALONE = 20, 24
"""For one orbit in a line and alone, beside those for Jacobians: while it comes nearer, no other start is
cheaper."""

SHOTS_COUNTED = 4
"""Shots that closing one orbit counts as, each of the steps of its last one: a bound on work need not be
exact."""

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
"""Mismatch expected of the first shot, for which any above `ROUGHLY` / `SHARPER`, 3e-3, does the same; ratio
of two that is expected to hold, and that of the first two."""

SOON = 20.0
"""Closing error expected, in tolerances, from which a shot takes its integrals along: it costs half as much
again, one that closes without them is made twice."""

FAR_OFF = 0.1
"""Shift of a free position, over its travel, beyond which a shot is taken again about its new centre: what it
was off by counted as its size, which tolerances are relative to."""

STEP_ROUNDED = 1e-14
"""Square of a step, relative, below which it measures rounding and corrects no Jacobian."""

LEADS_ASIDE = 0.05
"""Share of a step, squared, that has to lead aside of those before for what they have shown to be kept: of
0.01, 0.05 and 0.2 the middle one took the fewest steps over sixteen families."""

ONE_SIDED = 0.5
"""Of differences to one side, relative, over the root of a shot's tolerance: there what the tolerance leaves
of them and curvature are as large as each other."""

PIVOT = 2 * RTOL_SHOTS
"""Pivot, relative, below which a step is singular: a mismatch of one tolerance then makes a step of half the
motion's size."""

SQUARINGS = 12
"""Squarings of a matrix from which its spectral radius is taken: its 4096th power, to a few 1e-4."""

NEUTRAL_SHOT = 1e-3
"""By how much a multiplier may exceed one: neutral directions, differenced, come out near it."""

SIZE_KEPT, SIZE_FORGOTTEN = 0.05, 0.1
"""What is left of the size of a coordinate, and of a state, after a shot: that of a larger motion before must
be forgotten."""

TOUCHING = 10 * HEIGHT
"""Distance and speed, relative, within which contact survives what rounding leaves of it: ten times the
flight below which a bounce has ended."""

CHATTER_ROOM = 60
"""Times that a run goes on where its log of `EVENTS` is full: 15,000 events of one shot, a bound on work."""

FIRST_STEP, FIRST_LONGEST, FIRST_STALE = 0.02, 0.1, STEP_GROWTH
"""Of a period: first step of a shot, which its error corrects at once, and the longest one left by the shot
before; how many times the former one left by another run may be: what one step makes up for."""

SHOTS_AT_ONCE = 64
"""Shots, or points of a line, between two chances to interrupt them: some 10 ms, if a shot takes a hundred
steps and more (`STEP_TIME`)."""

FAMILIAR = 1e3
"""Factor between sizes of motion for which laws need not be evaluated again."""

BINS = 2
"""Decades of force and of frequency: within them sizes, up to A / omega^2, differ by `FAMILIAR`."""

SIZING_STEPS = 2 * STEPS_AT_ONCE
"""Steps of the run that shows the sizes of states which belong to no mechanism: 20 ms."""

SIZE_AT_FIRST = 1e-3
"""Size of the states before any motion, over those of a free inertia: one that is larger shows at once, one
that is smaller hardly moves."""

WITHIN_GAP = 0.3
"""Of a gap, off its faces and its middle, of which either is special: where a motion from rest begins."""

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
"""Periods followed where a motion is seen to be still on its way: each four times the one before, so that
none goes on for much longer than it has to."""

DRIFTS = 2 * SHARP[1] * RTOL_SHOTS
"""Way in a period over the amplitude from which a motion drifts, and speed gained in one, over that of a free
inertia, from which it is pushed: twice the largest error of a closed orbit, 1e-6."""

LINEAR = 1e-3
"""Change of a speed's growth from the one half to the other that is steady: one that saturates shows more
over a dozen periods."""

EVENLY = 0.5
"""Spread of growths from shot to shot, over their mean, below which a motion grows evenly: none of them is
then without growth."""

RUNS_AWAY = 100
"""Growth of a state over the second half of a trail, a dozen periods, that is running away, if it grew so
much in the first half as well."""

NAN_AHEAD = 1e-6
"""Of a period: how far ahead of a state a law is asked for NaN, beyond where rounding may have left it."""

LONGEST_PERIOD = 12
"""Periods of a subharmonic motion that is recognised: each one more is a further multiple that is tried;
longer ones count as irregular, and their average is the same."""

LONGER_LEAST, LONGER_BETTER = 3e-3, 0.3
"""Mismatch after some periods, 1e-3, from which closing the motion over them is tried: about what Newton's
method needs. A multiple that closes no better than the shorter ones, by the latter factor, is not tried."""

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
"""A motion that repeats so much better after two half periods than after one is not symmetric, and the least
by which it is not."""

EVEN_LEAST, EVEN_MISS = 200 * RTOL_SHOTS, 1e3
"""Even harmonics, over the fundamental, of an asymmetric motion: at least, 1e-7; and in mismatches of the
orbit."""

# --- orbits from far off, by damped steps -----------------------------------------------------------

RTOL_FINE = 2e-13
"""Tolerance of shots: a thousand eps, below which rounding of a period's steps is all that it would tell."""

STEP_GOOD, STEP_POOR = 3e-10, 1e-3
"""Last step, relative, from which an orbit counts as closed, near the tolerance of other shots
(`RTOL_SHOTS`), and where rounding forbids more: the residual says so."""

STEP_ENDS, STEP_GOOD_LATE, FINE_LATE = 1e-3, 30, 100
"""Of `STEP_GOOD`: a step that needs no other, and one that will do in the end; of `RTOL_FINE`: the mismatch
of one where rounding rules."""

CENTRAL = RTOL_FINE ** (1 / 3) / 3
"""Of central differences, relative, 2e-5: a third of where the tolerance, over it, and third derivatives of
the size of one, times its square, leave as much, as events come and go near by."""

NEUTRAL, SQUARINGS_FINE = 100 * RTOL_FINE / CENTRAL, 28
"""By how much a multiplier may exceed one, 1e-6: a hundred times what the tolerance leaves of a difference;
squarings that tell it to a tenth of that, of a matrix whose powers grow by 1e12 at first: log(1e12) /
2^28."""

DAMPED_SETTLED = 1e-5, 0.3
"""A step so short that shrinks no more than so far is what rounding leaves: one of Newton's method would be
squared."""

DAMPED_LEAST = {True: 1e-3, False: 0.3}
"""Of a Newton step that is tried, by patience."""

DESCENT = 0.25
"""Of the share taken of a step: by how much the next step must be shorter, the restricted monotonicity test
of Deuflhard, Newton Methods for Nonlinear Problems (2004), section 3.3."""

SHORTENED, SHORTENED_BY = 0.1, (0.5, 0.25)
"""Share of a step down to which it is halved, and then quartered: bounds the tries."""

STEP_REACH = 30
"""First step, in sizes of the motion, from which an irregular one is given up: no orbit lies so far off."""

# --- linear orbits and symmetries -------------------------------------------------------------------

PROBES, ALIKE, RIPPLED = 24, 1e-9, 1e-6
"""Random states at which laws are asked; relative difference of two values that are one; and after a
wavelength, which users round. What rounding leaves of a small value is a share of the largest
(`FEW_ROUNDED`): the force of a joint that is hardly compressed is a difference of large positions."""

STATE_DECADES, INPUT_DECADES, AT_REST = (-4, 1), (-1, 2), 3
"""Of random states and inputs, over their sizes: below and above what the motion reaches; every third state
has its bodies at rest, where dry friction sets what is held. Half and twice the decades, every second or
sixth at rest: the same symmetries in 23 families."""

SHIFTS = {"place": 1.7, "speed": 0.37, "state": 0.83, "output": 3.7}
"""Shifts of states, over their sizes, that laws are asked about: no simple multiple of anything."""

# --- forces under an imposed motion -----------------------------------------------------------------

IMPOSED_SAMPLES = 1024
"""A period: harmonics of a dry friction's square wave are then right to 1e-6 (the square of a step)."""

PERIODS_AT_MOST, HIDDEN_SETTLED, CREEPING = 64, 1e-8, 1e-3
"""Periods at most until what is hidden repeats; its change over one, over the largest it is, that counts as
none, and up to which an orbit that creeps on ever more slowly is taken for its limit, to that accuracy."""

# --- other waveforms --------------------------------------------------------------------------------

WAVE_PERIODS, WAVE_PERIODS_MORE, WAVE_PERIODS_GAP = 3, 30, 20
"""Periods followed before an orbit is closed: at first, then ten times as many, and where a gap lets motions
coexist, so that it is the one that attracts there."""

WAVE_STEPS = 60_000
"""Integration steps for one answer at most, by default: 0.06 s of a small system (`STEP_TIME`), as a curve
asks for hundreds of answers. Half and twice were not tried."""

WAVE_STARTS = ((3.0, 0.0), (0.0, 1.0), (0.0, -1.0), (0.0, 2.0), (-1.0, 0.0))
"""Speeds in the middle of a gap tried in turn: shares of that of the free inertia, and of that which crosses
the gap in half a period. Of 200 waveforms on five joints 157, 171, 175, 185 and 188 are answered with the
first one to all five; with half and twice the speeds 189 and 187."""

# --- families ---------------------------------------------------------------------------------------

COMPRESSED = 64 << 20
"""Memory [bytes] of a family up to which its file is made small: beyond, that takes too long."""

SCANNED, SCANNED_LAW, SCANNED_ELEMENT = 60, 160, 480
"""Amplitudes of a scan for crossings at least: of any block, of a law by quadrature, whose points cost less,
and of an element, whose points cost next to nothing. Over three decades they lie 12, 4 and 1.5 % apart: steps
of a quantizer put two crossings within 4 %."""

MOTIONS_AT_ONCE = 64
"""Points of two masses with a gap between two chances to interrupt them: each takes up to 10 ms where its
motion has no period, all of them 0.6 s."""

HERE, LAW_ROWS = 1 << 14, 64
"""Points of a quick method in one part, and between two chances to interrupt it: some milliseconds;
amplitudes of a static law computed together: its corners are looked for once for them."""

PARTS_AHEAD = 256
"""Parts submitted before the first is taken: what is done and waits takes memory."""
