"""Every tuned number of exact limit cycles, with what it follows from or what chose it.

Where nothing else is said a number bounds work, or parts what rounding and tolerances leave from what a
motion does, by a few powers of ten on either side.
"""

from __future__ import annotations

import math

import numpy as np

# --- rounding ---------------------------------------------------------------------------------------

RANK = 1e-12
"""Singular value, over the largest, that steps of Newton's method leave out."""

# --- exact orbits -----------------------------------------------------------------------------------

CLOSED, ACCEPTED = 3e-10, 1e-7
"""Mismatch after a period, relative to the size of each state: what runs at `PERIOD_RTOL` allow, and where
events limit what can be reached."""

PERIOD_RTOL, TRAJECTORY_RTOL, LOOK_RTOL = 1e-11, 1e-8, 1e-6
"""Tolerance of periods that are differentiated; of trajectories that are followed; of a first look at
sizes."""

NEWTON_LONGEST, PERIOD_CHANGE = 0.3, 4.0
"""Longest step, in sizes of the orbit; change of the period on the way, as a factor."""

STALLED, STALLS = 0.9, 6
"""Mismatch over the best one that is no progress, and how many such steps end the search."""

STILL = 1e-6
"""Amplitude, relative to the motion that Newton started from, below which there is no orbit."""

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
"""Instants among which the middle of an interval of free motion is looked for."""

SAME_ORBIT, SAME_ROUGHLY, SAME_SIZES = 1e-4, 2e-2, 10
"""Difference of frequency of two orbits that are one, of averages; times that, of amplitudes."""

# --- monodromy --------------------------------------------------------------------------------------

PERIOD_EVENTS, PERIOD_STEPS = 5000, 200_000
"""Events of a period, and steps between two of them."""

PERIOD_REACH = 1e-6
"""Of a period: the time over which rates of inputs are taken."""

COUPLED = 1e-7
"""Of what the other states move a state by in a period: a size below that is rounding."""

SLOPE_NUDGE, FLOW_NUDGE, EVENT_NUDGE = 1e-4, 1e-5, 1e-6
"""Differences by a state, over its size: of rates whose magnitude alone counts; of flows, whose second order
is the cube root of eps squared; of margins and jumps, which are nearly linear."""

FORCED = 1e-3
"""Of what a margin changes by over the sizes of the states: how far beyond zero it stands where an event
before has put it there. Events that chance alone brings together are located to `PERIOD_RTOL`."""

# --- shift invariance -------------------------------------------------------------------------------

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

CORNER_BEYOND = 0.5
"""Difference of the Jacobian from that beyond a corner, over its jump there: a point within half of it is
beyond, another one still before."""

SHRINK_FAR = 2.0
"""Change of a state, in sizes of the orbit, or of the logarithm of the period: given up beyond."""

# --- starts -----------------------------------------------------------------------------------------

FACTORS = (0.3, 1.0, 0.1, 3.0, 0.03, 10.0)
"""Sizes of starts, of the scale, in the order tried."""

INSIDE_STOPS = 0.9
"""Share of the way to a stop that a start may take."""

DECADES, BENT, JUMPED, JUMP_HIDES = np.arange(-40.0, 41.0), 0.01, 1e6, 0.5
"""Sizes over which a smooth law is asked where it bends; change of its slope, relative, from which it does;
factor over which any power grows by more than twofold, unless a jump hides it; share of the value there from
which a jump does."""

BEND_HALVINGS = 60
"""Halvings to the bend itself: decades belong to a unit."""

POLE_AT_ZERO, REAL_ROOT = 1e-9, 1e-6
"""Pole frequency, over the largest, of an integrator; imaginary part of a real root: the root of eps,
thrice."""

SAMPLED_SLOWEST, SAMPLED_POINTS, SAMPLED_OMEGA = 1e-6, 600, 0.1
"""Of a sampled controller: frequencies looked at, over the Nyquist frequency, and how many; the frequency of
one without poles, over a sample."""

# --- trajectories ----------------------------------------------------------------------------------------

WORK, SAMPLED_WORK, LOOK_WORK = 300_000, 400_000, 50_000
"""Integration steps of one trajectory, of one interval between samples, of a first look."""

CROSSINGS_LEAST = 12
"""Crossings within that work, below which it is no use."""

CROSSINGS, CROSSINGS_AVERAGED, CROSSINGS_VERIFIED = 1000, 40, 200
"""Of one trajectory; that an average takes; of the simulation beside a verified orbit."""

LONGEST_INTERVAL, LOOK, LOOK_POINTS = 20, 0.1, 129
"""Half periods, at the loop's own frequency, of the longest interval without a crossing; share of it that
shows sizes, and points in it."""

QUIET, PATIENCE = 40, 400
"""Intervals without a crossing after which a loop is called at rest: if nothing in it moves on, and while
something does (an integral that winds up, a slow mode)."""

DEAD = 1e-9
"""Of the largest state met, below which a loop without crossings is at rest."""

INTERVAL_SAMPLES, ON_TICK = 1024, 1e-6
"""In an interval, where crossings are looked for among samples; share of a sample within which an instant is
one."""

FAINT = 1e-6
"""Of the highest peak met, below which oscillations count as rest."""

REPEATS, REPEATS_EXACTLY, REPEATS_LEAST = 1e-7, 1e-9, 1e-6
"""Change of a crossing, over the size of the state, that is none: where Newton follows, and where none does;
size at least, over the largest."""

SIZED = 6
"""Crossings, the last ones, whose largest states are the sizes that a change is compared with. Half and twice
as many change nothing in seven loops verified."""

EVEN, STEPS, TENFOLD = 0.05, 3, math.log(10.0)
"""Spread of logarithmic growths within which a growth counts as steady; such growths in a row, at least; two
do where each is as large."""

WITHIN = 0.1
"""Of the input up to which a block is a straight line: there the loop is linear."""

RECENT, RECENT_CLOSED = 64, 12
"""Crossings among which steady growths are looked for; among which the pair is sought that nearly repeats."""

BEYOND = 10.0
"""Times the largest start's first peak: growth at a steady ratio from there has no bound."""

DIVERGED_SIZE = 1e4
"""Times what the largest start sets in motion: a loop beyond it has run away."""

STEADY, SUSTAINED_GROWTH, SUSTAINED_DECAY = 1.25, 0.5, 0.9
"""Change of the peaks from the third to the last quarter of a trajectory below which they keep their size,
and the share of it (logarithmic) of the quarter before: a decay is geometric, growth may be a power (0.66 if
quadratic)."""

HALVINGS, CLOSED_AFTER, WIDTH = 40, (6, 12, 18, 26, 40), 1e-3
"""Of the interval between two starts of different fate; halvings after which the motion on the border is
tried for an orbit; relative width of a border whose orbit is known."""

LINGERING = 6
"""Crossings, up to the one after the slowest, from which the orbit that a trajectory lingers near is closed.
Half and twice as many change nothing in seven loops verified."""

LINGERS, WIND_UP_LEAST = 0.3, 1e-9
"""Change from crossing to crossing of a trajectory that lingers; factor of growth that is at least more than
one."""

REACHED, BESIDE, ON, APPROACHING = 1e-3, 0.03, 1e-5, 3
"""Of an orbit's size: a crossing so near a stable one, and coming nearer, ends on it; the same for one that
lingers beside an unstable one; relative difference of the time between crossings from the period within which
it is that near; crossings in a row that come nearer."""

ORBIT_SIZE = 1e-9
"""Size of a state of an orbit at least, over what it is measured in."""

STEPS_A_PERIOD = 8
"""Steps of a period at least, four of a half wave."""

PIECE_HALVINGS, SHRINK_NEWTON = 6, 8
"""Times that a step of Newton's method is halved while pieces come apart; its steps on the way that a
mismatch shrinks."""
