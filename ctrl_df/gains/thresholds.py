"""Every tuned number of maps over gains and of tuning, with what it follows from.

Numbers that name no derivation spread points or bound work: more of them cost time, fewer lose features finer
than their spacing. Lengths in the plane of gains are shares of its box.
"""

from __future__ import annotations

import numpy as np

# --- the plane of amplitudes and frequencies --------------------------------------------------------

BELOW, ABOVE = 0.03, 1e3
"""Amplitudes looked at, in units of the scale at which the block bends: beyond, it is linear to a percent."""

FASTER = 10.0
"""Frequencies looked at, beyond the corner frequencies of the loop, either way: where asymptotes hold."""

SIZE = {True: (240, 320), False: (48, 64)}
"""Points of the plane: of a closed form, which costs microseconds a point; of computed orbits."""

CLOSER = 4.0 ** np.arange(-12.0, -1.0)
"""Distances, relative, from the least amplitude that moves the block on: N has a root there."""

BISECTIONS = 50
"""Halvings of a logarithm to that amplitude: to the last digit."""

SMALL = 1e-5
"""Step of difference quotients in ln a and ln omega: their error 1e-10, rounding makes 1e-11."""

SMALL_BETWEEN = 0.25
"""The same in steps of the grid, where N lies between its points: both ends are then in cells beside a
point, and a cubic spline is smooth across it."""

LARGE = 1e3
"""Times the largest amplitude: there a law that is linear in the large has become so."""

RIGHT = 1e-9
"""Real part of a pole, over the largest, from which it lies to the right: half the digits of a double one."""

# --- cycles and folds -------------------------------------------------------------------------------

JUMP = 0.7
"""Relative change of Z within a triangle, beyond which the block changes between motions there."""

POLISHED = 1e-10
"""Step in ln a and ln omega at which Newton's method has converged: what `SMALL` leaves."""

POLISH_STEPS = 12
"""Steps of it at most: from a cell of the grid it takes four or five."""

POLISH_REACH = 3
"""Steps of the grid that it may lead away: further off lies another cycle. Of 117 it led one step at most."""

SAME = 1e-6
"""Difference in ln a and ln omega below which two cycles are one."""

SINGULAR = 1e-9
"""Singular value, over the largest, that a step leaves out: near a fold one is small, not zero."""

FOLD_SINGULAR = 1e-10
"""The same of the equations of a fold, where none is small."""

FOLD_STEP, FOLD_LEAST = 0.02, 1e-2
"""Step along a fold, of the box of gains and of a unit of ln a and ln omega; over it, the least one tried."""

FOLD_AHEAD = 0.5
"""Of a step along a fold, what must lead ahead: the cosine of 60 degrees. Less, and it is halved."""

FOLD_POINTS = 600
"""Steps of one curve, either way: twelve times across the box."""

FOLD_NUDGE = 1e-4
"""Step of its difference quotients, whose functions are such quotients themselves."""

FOLD_CLOSED = 1e-7
"""Newton's step at which a point lies on it."""

FOLD_NEWTON = 8
"""Newton's steps at most to a point of a fold: from its neighbour 1,265 of 1,270 took two, one took four."""

FOLD_REACH = 0.5
"""Distance from a start to the fold it belongs to, in those units."""

FOLD_BEYOND = 0.05
"""Of the box, by which a curve is followed out of it: it may come back."""

# --- borders of stability ---------------------------------------------------------------------------

BORDER_POINTS, BORDER_LINE = 4000, 400
"""Points of a border over frequency, and of a straight one."""

PHASES, PHASES_AT_ONCE = 2000, 1 << 20
"""Frequencies of a phase count; numbers of it in memory at once."""

ASIDE = 2e-3
"""Of the box: how far on either side of a curve the poles are counted."""

NOWHERE = 1e-9
"""Determinant, relative, below which two gains are one and the same at a frequency."""

ON_RIM = 1e-9
"""Of the box or a triangle, by which a place on its rim may lie beyond, by rounding."""

WITHIN_RIM = 1e-6
"""Of its size, by which a place beyond the rim is moved in."""

# --- simulations ------------------------------------------------------------------------------------

STARTS = tuple(np.geomspace(0.03, 30.0, 12))
"""Sizes of the starts, of that at which the block's nonlinearity matters: three decades, four a decade."""

ORDER = tuple(STARTS[k] for k in (5, 8, 3, 10, 1, 6, 4, 7, 2, 9, 0, 11))
"""Those that meet cycles soonest come first: later starts that end there are not followed to their end."""

SPREAD = 0.4
"""Share of the exact checks that is spread evenly; the others close in on borders."""

CHECKS_LEAST, CHECKS_ENOUGH = 8, 6
"""Exact checks at least; exact cycles from which sizes between them are told."""

APART = 1e-3
"""Of the unit square: least distance of two points simulated."""

WORTH = (1.0, 0.35, 0.125)
"""An edge is cut by its length times this: between answers that differ as no model has it, across what may be
a border, between none. At the ends of the range an edge of 0.2 that nothing is known against waits for
borders of 0.025 to be resolved."""

CUTS_APART = 0.5
"""Of an edge's length: how far from the middles cut already its own must lie to be cut in the same round."""

COARSE = 0.1
"""Length up to which an edge across the line is cut like one with different answers."""

ROUND = 8
"""Rounds of cutting."""

LEAST_SHARE = 1e-12
"""Share of a corner in a triangle, at least: a place on an edge asks both its ends."""

OFF = 0.02
"""Of the range of ki: how near to zero the loop is asked; below, hunting takes ever so long."""

# --- tuning -----------------------------------------------------------------------------------------

WIDER = 1.5
"""Times the least bandwidth: the greatest, where only one is given."""

INTEGRAL = (0.02, 1.0)
"""Integral action looked among, ki / (kp bandwidth)."""

SOFTER = 0.1
"""Of the gain that crosses over at a frequency by itself: the least proportional one, with a derivative."""

EXTREME, FURTHER = 1e9, 10.0
"""An amplitude at which a block is linear that is so in the large (one over it: in the small), and how many
times further out its gain is asked again."""

LINEAR_CHANGE = 0.5
"""Change of N, relative, over a further factor of ten in amplitude, below which a block is linear there: N
that falls as a^-0.3 or faster changes by more, that of a relay by 0.9."""

MEMBERS, GENERATIONS = 6, 12
"""Of the search: six members a gain."""

DECADES, MARGIN_POINTS = 100.0, 600
"""Frequencies looked at, beyond the bandwidth, either way, and points at which margins are read."""

VERIFIED = (60, 80)
"""Amplitudes and frequencies of the prediction that is verified at the gains chosen."""
