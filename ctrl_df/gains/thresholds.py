"""Every tuned number of maps over gains and of tuning, with what it follows from.

Numbers that name no derivation spread points or bound work: more of them cost time, fewer lose features
finer than their spacing. Lengths in the plane of gains are shares of its box. ``maps``: half and twice of the
number change neither verdicts nor folds nor borders (`benchmarks/half_and_twice.py maps`).
"""

from __future__ import annotations

import numpy as np

from ..limit_cycles.thresholds import LOG_NUDGE
from ..thresholds import ROUNDED

# --- the plane of amplitudes and frequencies --------------------------------------------------------

BELOW, ABOVE = 0.03, 1e3
"""Amplitudes looked at, in units of the scale at which the block bends: beyond, it is linear to a percent.
Half and twice of the former name 1 and 4 gains in a hundred otherwise, of the latter one at most."""

FASTER = 10.0
"""Frequencies looked at, beyond the corner frequencies of the loop, either way: where asymptotes hold. Half
and twice, which move the points of the plane, name one gain in a hundred otherwise where nothing is
checked."""

SIZE = {True: (240, 320), False: (48, 64)}
"""Points of the plane: of a closed form, which costs microseconds a point; of computed orbits."""

CLOSER = 4.0 ** np.arange(-12.0, -1.0)
"""Distances, relative, from the least amplitude that moves the block on: N is zero there and grows as their
root, so that it doubles from one to the next."""

SMALL_BETWEEN = 0.25
"""Step of difference quotients, of the grid, where N lies between its points: both ends are then in cells
beside a point, and a cubic spline is smooth across it."""

# --- cycles and folds -------------------------------------------------------------------------------

MOTION_JUMPS = 0.7
"""Relative change of Z within a triangle, beyond which the block changes between motions there: a smooth one,
as a^-1 omega^-2 or less, changes by 0.6 at most over the steps of the coarser grid (`SIZE`), 0.2 in ln a and
ln omega. Half of it, which such a change exceeds, names one gain in ten otherwise, twice three in a
hundred."""

POLISHED = LOG_NUDGE**2
"""Step in ln a and ln omega at which Newton's method has converged: what its differences err by."""

POLISH_REACH = 3
"""Steps of the grid that it may lead away: further off lies another cycle. Of 117 it led one step at most
(maps)."""

FOLD_STEP, FOLD_LEAST = 0.02, 1e-2
"""Step along a fold, of the box of gains and of a unit of ln a and ln omega: half and twice follow the same
folds; over it, the least one tried (maps)."""

FOLD_AHEAD = 0.5
"""Of a step along a fold, what must lead ahead: the cosine of 60 degrees. Less, and it is halved. Half of it
changes nothing; all of a step never does, and folds break into pieces (maps)."""

FOLD_POINTS = round(12 / FOLD_STEP)
"""Steps of one curve, either way: twelve times across the box."""

FOLD_NUDGE = 1e-4
"""Step of its difference quotients, whose functions are such quotients themselves, known to some 1e-10: that
leaves 1e-6 of them, curvature 1e-8 (maps)."""

FOLD_CLOSED = 1e-7
"""Newton's step at which a point lies on it: the next one would be its square, or a millionth of it as its
derivatives err (`FOLD_NUDGE`; maps)."""

FOLD_REACH = 0.5
"""Distance from a start to the fold it belongs to, in those units (maps)."""

FOLD_BEYOND = 0.05
"""Of the box, by which a curve is followed out of it: it may come back. With half of it one of three folds is
found in two pieces, with twice all of them are the same."""

# --- borders of stability ---------------------------------------------------------------------------

BORDER_POINTS, BORDER_LINE = 4000, 400
"""Points of a border over frequency, which runs through the box within a small part of them; of a straight
one, as many as tell where it parts stable from unstable to `POLES_ASIDE` or so."""

PHASES, PHASES_AT_ONCE = 2000, 1 << 20
"""Frequencies of a phase count: half a per cent apart over four decades, so that a resonance with a damping
ratio down to that turns by less than half a turn from one to the next; numbers of it in memory at once, 16 MB
of complex ones."""

POLES_ASIDE = 2e-3
"""Of the box: how far on either side of a curve the poles are counted: below what a picture shows, above what
its points, 1/4000 apart at least, err by (maps)."""

WITHIN_RIM = 1e-6
"""Of its size, by which a place beyond the rim is moved in: no answer changes over so little."""

# --- simulations ------------------------------------------------------------------------------------

STARTS = tuple(np.geomspace(0.03, 30.0, 12))
"""Sizes of the starts, of that at which the block's nonlinearity matters: three decades, four a decade."""

ORDER = tuple(STARTS[k] for k in (5, 8, 3, 10, 1, 6, 4, 7, 2, 9, 0, 11))
"""Those that meet cycles soonest come first: later starts that end there are not followed to their end."""

SPREAD = 0.4
"""Share of the exact checks that is spread evenly; the others close in on borders. Half and twice name 8 and
16 of 100 gains otherwise after 16 checks."""

CHECKS_LEAST, CHECKS_ENOUGH = 8, 6
"""Exact checks at least, two for each corner of the box; exact cycles from which sizes between them are told:
a plane takes three, twice as many show what it bends by."""

POINTS_APART = 1e-3
"""Of the unit square: least distance of two points simulated, less than which no picture shows (maps)."""

WORTH = (1.0, 0.35, 0.125)
"""An edge is cut by its length times this: between answers that differ as no model has it, across what may be
a border, between none. At the ends of the range an edge of 0.2 that nothing is known against waits for
borders of 0.025 to be resolved."""

CUTS_APART = 0.5
"""Of an edge's length: how far from the middles cut already its own must lie to be cut in the same round
(maps)."""

EDGE_COARSE = 0.1
"""Length up to which an edge across the line is cut like one with different answers (maps)."""

ROUND = 8
"""Rounds of cutting. With half as many 8 of 100 gains are named otherwise after 16 checks, twice as many
change none."""

CORNER_SHARE = ROUNDED
"""Share of a corner in a triangle, at least: a place on an edge asks both its ends, however it is rounded."""

OFF = 0.02
"""Of the range of ki: how near to zero the loop is asked; below, hunting takes ever so long. Half changes
nothing, twice names 7 of 100 gains otherwise after 16 checks."""

FINE_GAINS = 120
"""Gains either way of a map that is drawn, by default: four to each of its own, thirty by default, so that
borders look like curves."""

# --- tuning -----------------------------------------------------------------------------------------

WIDER = 1.5
"""Times the least bandwidth: the greatest, where only one is given. What is asked for is about the least."""

MAX_SENSITIVITY = 1.7
"""Largest sensitivity M by default, which keeps a gain margin of M / (M - 1), 2.4, and a phase margin of
2 arcsin(1 / (2 M)), 34 degrees: between 1.4 and 2.0, for which Åström & Hägglund (PID Controllers,
1995) tune."""

INTEGRAL = (0.02, 1.0)
"""Integral action looked among, ki / (kp bandwidth), whose phase lag at crossover is its arc tangent: 1 to 45
degrees."""

SOFTER = 0.1
"""Of the gain that crosses over at a frequency by itself: the least proportional one, with a derivative,
whose phase lead is then 84 degrees."""

EXTREME, FURTHER = 1e9, 10.0
"""An amplitude at which a block is linear that is so in the large (one over it: in the small), a billion of a
unit that blocks are written in; and how many times further out its gain is asked again."""

LINEAR_CHANGE = 0.5
"""Change of N, relative, over a further factor of ten in amplitude, below which a block is linear there: N
that falls as a^-0.3 or faster changes by more, that of a relay by 0.9."""

MEMBERS, GENERATIONS = 6, 12
"""Of the search: six members a gain, some 230 gains tried for three: bounds work, each is simulated."""

MARGIN_POINTS = 600
"""Frequencies at which margins are read, from `OMEGA_BEYOND` times below the bandwidth to as far above: 1.5 %
apart, two degrees of phase where it turns by a right angle within an octave."""

VERIFIED = (60, 80)
"""Amplitudes and frequencies of the prediction that is verified at the gains chosen: bounds work where N is
computed; crossings lie between them all the same."""
