"""Every tuned number of exact limit cycles, with what it follows from or what chose it.

Where nothing else is said a number bounds work, or parts what rounding and tolerances leave from what a
motion does, by a few powers of ten on either side. ``orbits``: half and twice of the number change no cycle
of thirteen loops or more (`benchmarks/half_and_twice.py orbits`).
"""

from __future__ import annotations

import math

import numpy as np

from ...simulate.thresholds import RTOL, STEPS_AT_ONCE_MANY
from ...thresholds import ROUNDED, SQRT_EPS

# --- exact orbits -----------------------------------------------------------------------------------

PERIOD_RTOL, TRAJECTORY_RTOL, LOOK_RTOL = RTOL / 100, 10 * RTOL, 1e-6
"""Tolerance of periods that are differentiated; of trajectories that are followed to where Newton's method
begins; of a first look at sizes, of which two digits are asked."""

CLOSED, ACCEPTED = 30 * PERIOD_RTOL, 10 * TRAJECTORY_RTOL
"""Mismatch after a period, relative to the size of each state: what runs of some thirty steps at that
tolerance allow; and where events limit what can be reached, ten times what trajectories that are only
followed err by."""

NEWTON_LONGEST, PERIOD_CHANGE = 0.3, 4.0
"""Longest step, in sizes of the orbit; change of the period on the way, as a factor: beyond, another orbit is
nearer (orbits)."""

STALLED, STALLS = 0.9, 6
"""Mismatch over the best one that is no progress, and how many such steps end the search (orbits)."""

STILL = 10 * ACCEPTED
"""Amplitude, relative to the motion that Newton started from, below which there is no orbit, 1e-6: a mismatch
that is accepted would be a tenth of it."""

REPEATED = 100
"""Times `ACCEPTED`: mismatch of a part of an orbit that went round several times, below which it is one
round. Those of another orbit, of a doubled period, come apart from it by more."""

MOST_ROUNDS = 32
"""An orbit closed after so many rounds or fewer is told from the one of a single round: five doublings of a
period."""

SLOPE_NUDGE, FLOW_NUDGE, EVENT_NUDGE = 1e-4, 1e-5, 1e-6
"""Differences by a state, over its size: of rates, central ones err by the square of it, 1e-8; of flows, by
what tolerances leave over it; of margins and jumps, which are nearly linear."""

ON_CIRCLE = PERIOD_RTOL / FLOW_NUDGE
"""Distance from the unit circle below which a multiplier says nothing of stability: 1e-6, what the tolerance
leaves of differences of flows."""

ORBIT_POINTS = 1025
"""Instants of an orbit that is returned: a picture, some thousand dots wide, shows no more."""

FREE_POINTS = 65
"""Instants among which the largest values of states are looked for: within 1 - cos(pi / 64), 0.1 %, of those
of a sine (orbits)."""

SAME_ORBIT, SAME_ROUGHLY, SAME_SIZES = 1000 * ACCEPTED, 2e-2, 10
"""Difference of frequency of two orbits that are one, 1e-4: what `ACCEPTED` makes of a period whose
multiplier is within a thousandth of one; of averages, whose period varies; times that, of amplitudes, which
change by more."""

# --- monodromy --------------------------------------------------------------------------------------

PERIOD_EVENTS, PERIOD_STEPS = 5000, 2 * STEPS_AT_ONCE_MANY
"""Events of a period, each of which takes a few runs to differentiate, and steps between two of them, 0.2 s:
bounds work."""

PERIOD_REACH = 1e-6
"""Of a period: the time over which rates of inputs are taken, in which they do not bend (orbits)."""

COUPLED = 1e-7
"""Of what the other states move a state by in a period: a size below that is rounding, beyond the root of
eps (orbits)."""

FORCED = 1e-3
"""Of what a margin changes by over the sizes of the states: how far beyond zero it stands where an event
before has put it there. Events that chance alone brings together are located to `PERIOD_RTOL` (orbits)."""

# --- shift invariance -------------------------------------------------------------------------------

MODE_SAMPLES = 4
"""States of each mode an orbit visits that are asked: no law is blind to a shift at all of them by chance
(orbits)."""

NULL = SLOPE_NUDGE**2
"""Singular values below, relative to the largest, make candidates: what the differences err by."""

SHIFT_SAME = 1e-11
"""Relative change of rates and margins by a shift of half the size; rounding leaves 1e-15 (orbits)."""

# --- other ways to close an orbit -------------------------------------------------------------------

PIECES, PIECES_CLOSED, PIECES_LONGEST = 8, 100 * PERIOD_RTOL, 0.5
"""Of multiple shooting: pieces, mismatch at every joint relative to the size of each state, from which
closing the orbit as a whole goes on, and the largest change of a state in one step of Newton's method."""

SHRINK_STEPS, SHRINK_LONGEST = 120, 0.2
"""Steps along the curve of a shrinking mismatch, twelve times `SHRINK_FAR` at their longest, and that length
in sizes of the orbit (orbits)."""

SHRINK_CLOSED, ACROSS, SHRINK_SHORTEST = 1e-4, 1e-3, 1e-5
"""Over the first mismatch: defect of a point on the curve; step across a corner, well above it; step at which
the curve is taken to have one, well below (orbits)."""

CORNER_BEYOND = 0.5
"""Difference of the Jacobian from that beyond a corner, over its jump there: a point within half of it is
beyond, another one still before (orbits)."""

SHRINK_FAR = 2.0
"""Change of a state, in sizes of the orbit, or of the logarithm of the period, a factor of 7: given up
beyond. Newton's method that leads so far off a point ahead, which is ten times nearer, diverges."""

# --- starts -----------------------------------------------------------------------------------------

FACTORS = (0.3, 1.0, 0.1, 3.0, 0.03, 10.0)
"""Sizes of starts, of the scale, half a decade apart, those first that a motion is likeliest to be of."""

INSIDE_STOPS = 0.9
"""Share of the way to a stop that a start may take: it begins free of contact."""

DECADES, BENT, LAW_JUMPED, JUMP_HIDES = np.arange(-40.0, 41.0), 0.01, 1e6, 0.5
"""Sizes over which a smooth law is asked where it bends, whatever the unit; change of its slope, relative,
from which it does; factor over which any power grows by more than twofold, unless a jump hides it (a power of
a twentieth does); share of the value there from which a jump does."""

REAL_ROOT = 64 * SQRT_EPS
"""Imaginary part of a real root, over it, 1e-6: some sixty times what rounding makes of a double one."""

SAMPLED_SLOWEST, SAMPLED_POINTS, SAMPLED_OMEGA = 1e-6, 600, 0.1
"""Of a sampled controller: frequencies looked at, over the Nyquist frequency, and how many, a hundred a
decade, so that a corner is known to 2 %, where a scale is asked; the frequency of one without poles, over a
sample: some sixty samples a period."""

# --- trajectories ----------------------------------------------------------------------------------------

WORK, LOOK_WORK = 3 * STEPS_AT_ONCE_MANY, STEPS_AT_ONCE_MANY // 2
"""Integration steps of one trajectory, 0.3 s of work; of a first look, at a tolerance at which steps are
longer."""

CROSSINGS, CROSSINGS_AVERAGED, CROSSINGS_VERIFIED = 1000, 40, 200
"""Of one trajectory, in which one that falls by 1.4 % each falls to `FAINT`; that an average takes,
whose period is then known to a fortieth of what one varies by; of the simulation beside a verified orbit."""

LONGEST_INTERVAL = 20
"""Half periods, at the loop's own frequency, of the longest interval without a crossing: a loop may cycle ten
times as slowly (orbits)."""

LOOK = 2 / LONGEST_INTERVAL
"""Share of it that shows sizes: the first period."""

QUIET, QUIET_LONG = 40, 400
"""Intervals without a crossing after which a loop is called at rest: if nothing in it moves on, and while
something does (an integral that winds up, a slow mode), ten times as long (orbits)."""

DEAD = TRAJECTORY_RTOL / 10
"""Of the largest state met, below which a loop without crossings is at rest: below what trajectories err by
(orbits)."""

INTERVAL_SAMPLES = 1024
"""In an interval, where crossings are looked for among samples: some seventeen periods of sixty samples."""

FAINT = 1e-6
"""Of the highest peak met, below which oscillations count as rest (orbits): a hundred tolerances of a
trajectory."""

REPEATS, REPEATS_EXACTLY, REPEATS_LEAST = 10 * TRAJECTORY_RTOL, TRAJECTORY_RTOL / 10, 1e-6
"""Change of a crossing, over the size of the state, that is none: where Newton follows, within ten tolerances
of the steps; where none does, a tenth of one, as a motion that repeats takes the same steps again. Size at
least, over the largest."""

SIZED = 6
"""Crossings, the last ones, whose largest states are the sizes that a change is compared with. Half and twice
as many change nothing in seven loops verified."""

GROWTH_EVEN, STEPS, TENFOLD = 0.05, 3, math.log(10.0)
"""Spread of logarithmic growths within which a growth counts as steady; such growths in a row, at least; two
do where each is as large (orbits)."""

STRAIGHT_WITHIN = 0.1
"""Of the input up to which a block is a straight line: there the loop is linear (orbits)."""

RECENT = 64
"""Crossings among which steady growths are looked for: a growth of 1.1 % each is then told, as `GROWTH_EVEN`
has it (orbits)."""

BEYOND = 10.0
"""Times the largest start's first peak: growth at a steady ratio from there has no bound (orbits)."""

DIVERGED_SIZE = 1e4
"""Times what the largest start sets in motion: a loop beyond it has run away. The starts themselves span a
factor of 300 (`FACTORS`; orbits)."""

STEADY, SUSTAINED_GROWTH, SUSTAINED_DECAY = 1.25, 0.5, 0.9
"""Change of the peaks from the third to the last quarter of a trajectory below which they keep their size,
and the share of it (logarithmic) of the quarter before: a decay is geometric, growth may be a power (0.66 if
quadratic)."""

EDGE_HALVINGS = round(-math.log2(ROUNDED))
"""Of the interval between two starts of different fate, 40."""

CLOSED_AFTER, WIDTH = (6, 12, 18, 26, EDGE_HALVINGS), 1e-3
"""Halvings after which the motion on the border is tried for an orbit: it stays beside one for longer the
nearer it starts, 6 halvings more by a factor of 64. Relative width of a border whose orbit is known, three
digits."""

LINGERING = 6
"""Crossings, up to the one after the slowest, from which the orbit that a trajectory lingers near is closed.
Half and twice as many change nothing in seven loops verified."""

LINGERS, WIND_UP_LEAST = 0.3, 1e-9
"""Change from crossing to crossing of a trajectory that lingers (orbits); factor of growth that is at least
more than one, so that a start that diverged is told from others."""

REACHED, REACHED_UNSTABLE, ON, APPROACHING = 1e-3, 0.03, 1e-5, 3
"""Of an orbit's size: a crossing so near a stable one, and coming nearer, ends on it; the same for one that
lingers beside an unstable one; relative difference of the time between crossings from the period within which
it is that near; crossings in a row that come nearer (orbits)."""

ORBIT_SIZE = 1e-9
"""Size of a state of an orbit at least, over what it is measured in: one that stays at zero is divided by
it."""

STEPS_A_PERIOD = 8
"""Steps of a period at least, four of a half wave, so that none passes over a wave (orbits)."""

PIECE_HALVINGS = 6
"""Times that a step of Newton's method is halved while pieces come apart, to 1/64 of it."""
