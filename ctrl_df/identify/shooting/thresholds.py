"""Numbers of multiple shooting that were chosen, each with its reason."""

from __future__ import annotations

from ..thresholds import RTOL_FINEST

BETTER_MINIMUM = 0.99
"""Error over the one before that counts as a better minimum: a hundredth less is 10 nats of 1,000 samples,
half of what makes an effect."""

CLEARLY = 1 - 1e-6
"""Squared error over another one's from which it is less: tries that come to the same differ by rounding,
which must not choose between them."""

OUTLYING_SEGMENT, OUTLYING_NOISE = 1.5, 2.0
"""Error of a segment over that of the good quarter, and over the noise, from which its initial state is
sought again: 1.5 lies three standard deviations, 1 / sqrt(2 n), above the rms of n = 20 independent samples
(`SEGMENT_SAMPLES`), 2 six."""

TRUSTED = 2.0
"""Mean square of a segment's error, over the median, up to which it counts in full: of 20 independent samples
(`SEGMENT_SAMPLES`) twice the usual lies three standard deviations, sqrt(2 / n), off."""

DOUBTED = 0.5
"""Weight below which a segment is left out at first: an error of 1.7 times the usual."""

RIGHT_SHARE = 0.25
"""Share of the segments that are taken to be right when others are compared with them: the quartile stays
right as long as three of four segments are wrong."""

SIZE_PRIOR = 3.0
"""Factor by which the model's own parameters may be off before any data, one standard deviation: beyond two
and a quarter lies `PARAMETER_RANGE`."""

SHORTEST_SEGMENT = 50
"""Samples of the shortest segment of a diagnosis: the four initial states of two bodies are then fewer than a
tenth of its samples."""

DAMPING = 1e-3
"""Damping of Levenberg and Marquardt over the curvature, at the start: for a start that may be far off
(Madsen, Nielsen & Tingleff 2004, section 3.2)."""

DAMPING_LEAST, DAMPING_MOST = 1e-7, 1e4
"""Least damping, where steps are those of Gauss and Newton to 1e-7; largest, where a refused step is 1e-4 of
these, too short to gain."""

NUDGE_FIRST = 1e-3
"""Step of scaled parameters that the first derivatives are differences over."""

NUDGE_LEAST = 100 * RTOL_FINEST
"""Such a step at least: a hundred times what the finest simulations err by."""

NUDGE_MOST = (0.05, 0.02)
"""Such a step at most, on a linear and on a logarithmic scale."""

NUDGE_FALLS = 0.05
"""The next step over the last one, at least."""

OUTPUT_MOVES = 0.3
"""Of the noise: what the output is to move by over such a step, seen well and linear still."""

OUTPUT_ROUNDED = 1e-13
"""Change of the output, over its largest value, that is rounding: a few hundred steps of 2e-16 each. A tenth
of the least noise (`NOISE_FREE`) is a hundred thousand times that."""

RESOLVED = 1 / 16
"""Grid to which steps are rounded, over the standard error that a parameter or an initial state has by
itself: it costs (1/16)^2 / 24 of one sample each, a six-thousandth. Arithmetic errs by 1e-10 to 1e-8 of a
step, far below the grid; without it every fit of a gap made ten times as much of that."""

COARSEST = 2.0**-12
"""The grid at most, of a scaled value."""

STATE_NUDGE = 3e-3
"""Step of place and speed of initial states that derivatives are differences over, over the typical ones. The
difference errs by as much of the curvature, and simulations by as much of it at most (`RTOL_COARSE`)."""

HIDDEN_NUDGE = 1e-3
"""The same of what is hidden, over its reach; smaller, as an event may leave it only a small part of that
reach. Half and twice end alike. Over a tenth of the reach, where the other body meets another face of its
gap, 19 of 60 segments of 50 samples ended beside their minimum, in place of 2."""

NUDGE_FINER = 0.1
"""Factor to finer differences by initial states, of segments that err more than others where no step gains
with coarser ones. Where the true model of pair 183 of the second generator comes to rest on a ridge, the
error falls from 15 times the noise to it over 1.2e-3 of the typical speed, and rises as far within the next
0.6e-3."""

NUDGE_FINEST = 0.05
"""Share of the usual differences from which there are finer ones: up to a hundredth of the usual."""

SLACK_TURNED = 0.8
"""Share of a gap from which its state is nudged backwards, so that the nudge stays inside."""

AT_BOUND, ON_BOUND = 1e-6, 1e-9
"""Distance of a scaled parameter from a bound that leaves no room; difference that rounding makes."""

OPEN_BOUND = 1e-3
"""Distance from a bound that a share must not reach."""

LOG_MOST = 40.0
"""Logarithm of a factor by which a parameter may be off its scale: 17 decades are any number."""

NO_SIZE = 1e-9
"""Size of a value over the natural one of its unit, up to which it is none: a derivative by one of that size
would be lost in the rounding of what it changes."""

NATURAL = 0.1
"""Size of a parameter that matters, over what the scales of a record make of its unit, but of a mass: a force
of a tenth of the typical one. Steps and ranges begin with it where the model says nothing; half or twice of
it moves evidence by 0.02 nats at most (springs, unequal friction)."""

GAP_PLACES, GAP_RATES = (0.02, 0.25, 0.5, 0.75, 0.98), (0.0, -0.3, 0.3, -1.0, 1.0)
"""Where in a gap segments may begin: at its faces, in the middle, between; and how fast they cross it, over
how far that rate may be off: not at all, at a third of it, at all of it."""

EFFORT_ALONE = (8, 1e-4)
"""Steps of initial states alone at most, and relative gain of the cost at which they end: to their end."""

EFFORT_BEGUN = (5, 1e-2)
"""The same over beginnings of segments, and where tries of them lead."""

EFFORT_FOLLOWED = (2, 1e-2)
"""The same behind one step of the parameters."""

DAMPED = 4
"""Times that a refused step of an initial state is damped tenfold: from 1e-3 to 1, a step half as long."""

TURNS_PAST = 6
"""Steps past events at most, of which each takes about a second of a gap. Of a gap under a PID (nothing
hidden) six steps left 1.15 times the noise over short segments, two to three 1.4, none 1.7."""

SHARES_PAST = (1.0, 0.5)
"""Shares of each of these steps that are tried."""

UNFOLLOWED = 0.7
"""Mean squared error over the one before below which another start of a segment is taken as it is (rigs)."""

RESTART_SPEEDS = (-1, -0.6, -0.3, -0.15, 0, 0.15, 0.3, 0.6, 1)
"""Speeds to start a segment with, over how far the estimate may be off: each about twice the one before, so
that one lies within a third of any but the smallest."""

BEGINNINGS = (16, 8, 4, 2)
"""Parts that a segment is divided into: the state that it begins in is found over the first of them, then
over twice that."""

NOISE_ORDER = 12
"""Largest order of the noise model of a residual that evidence is whitened by: six resonances, of two
coefficients each. Half and twice name the same effects on three rigs, half with evidence of 706 for 690."""

IMPULSE_GONE, IMPULSE_END = 1e-6, 8
"""Size over its peak of an impulse response that has died out; the last eighth of it is asked, so that a
resonance is met at its crests."""

TRIES = 6
"""Tries of a step, each damped more by `DAMPED_BY`: together a million, from 1e-3 of the curvature to a
thousand times it, where the step follows the gradient and is as much shorter."""

DAMPED_BY = 10
"""Factor by which the damping of a refused step grows."""

AGAIN_LEAST = 3
"""Steps after segments have been restarted, at least."""

RESTART_ROUNDS = 4
"""Rounds of restarts where no parameter moves."""

GROSS_ERROR = 4.0
"""Standard deviations of the usual error beyond which a sample counts less: one of 16,000 of normal noise."""

NOISE_ORDER_MOST, NOISE_ORDER_LEFT = 30, 4
"""Largest order of a noise model, 15 resonances, and of one of what another has left, two. Half and twice
change nothing on three rigs."""

IMPULSE_FIRST, IMPULSE_LONGER, IMPULSE_LONGEST = 4096, 4, 1 << 18
"""Samples of an impulse response at first, factor by which it is prolonged until it has died out, and samples
at most, three such steps: bounds work."""

WIDEST = 3
"""Reaches of an initial state that it ends at (see `../prediction/thresholds.py`)."""

TIME_SAMPLES = 5
"""Samples from which a time is seen."""

PLACE_NOISE = 4 * 8
"""Noise floors that the largest position may hold: four standard deviations of noise that is eight times its
floor, as noise of the first order is whose corner lies at a hundredth of the highest frequency. Four floors
kept stops of the second generator from where they are in three of eight rigs with slow noise, by 0.5 to 0.9 %
of their distance, and fits of two ended five standard errors off; with 32 all fifteen stops are named."""

KNOWN_BYTES = 2**28
"""Bytes of fits that are remembered for one question, lest they be made again: a diagnosis of 3,000 samples
makes 1,400 fits of 0.2 MB, of which a repeated search asks for the first half."""
