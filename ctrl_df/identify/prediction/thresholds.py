"""What a model makes of a record: tuned numbers, each with what it follows from."""

from __future__ import annotations

from ..thresholds import SEGMENT_SAMPLES

HIDDEN_RTOL = 1e-4
"""Tolerance of hidden states under an imposed motion: of steps no longer than a sample it leaves errors of
some 1e-6 of the force, and is twice as fast as 1e-6 (records)."""

RTOL_OVER_NOISE = 1e-3
"""Relative tolerance of simulations that are fitted to a record, as a share of the noise of its sensors over
the motion. Derivatives are differences over which the output moves by 0.3 times the noise (`OUTPUT_MOVES`):
errors of a thousandth of it change them by less than a hundredth."""

INPUT_ROUGH = 0.05
"""Distance of samples of an input from its decimated form, over its rms, beyond which it stays whole, if a
quarter of them lie farther off: the model would break away elsewhere (rigs)."""

PLACE_REACH, SPEED_REACH = (5, 0.02), (2, 0.01)
"""How far place and speed at the begin of a segment may be off: multiples of their error, and shares of the
typical ones, which are added as what events do is smoothed (rigs)."""

RATE_REACH = 0.7
"""How far the rate of a gap may be off at the begin of a segment, over the typical speed. States end at three
times it (`WIDEST`): two bodies that move against each other, each at its typical speed."""

BEND_REACH = 0.6
"""The same of the bend of a joint, and of its rate, over those that the typical force makes. Three times it
is a joint bent by a sudden force, twice as far as at rest. Half gains 4 nats of 3840, twice loses 28 (a
joint)."""

FREE_FORCE = 0.1
"""Force that matters in a motion that no input drives, over that of inertia: what damps it by a twentieth of
the critical damping."""

FORGOTTEN = 1e-3
"""Share of what a lag may be off by at the first sample below which its state counts as known: after seven
time constants."""

EARLIER_INPUTS = 8
"""Values of the input before a record that a dead time lets act in it: two to half a period, so that a dead
time of two periods is followed. Of 0.6 s and motions up to 1.9 Hz the rest is 1.00 times the noise, of half
as many 1.1 to 1.8 times, of a quarter 3.5 to 7.7 times."""

LONG_BEFORE = 1e3
"""Durations of a record before it from which its first value has held: a lag that is seen at all, of ten
durations, has settled to exp(-100)."""

RESTORING = 0.1
"""Force between two rms positions to either side, over the typical one, with which free runs do not drift: a
force that the model lacks of one per cent then moves its rest by 0.4 rms positions at most."""

STEPS_PER_SAMPLE, STEPS_AT_LEAST = 30, 5_000
"""Steps of a run at most, a sample and besides: a run that takes more moves far faster than the record can
show (chatter, laws far stiffer than it), is of no use to a fit, and would hold up the others. The best fits
of nine rigs take 4 a sample at most, 14 on their way; a joint in presliding sampled slowly is lost at 10 and
found at 20. 60 let a gap of a micrometre that bounces without loss take over a quarter of an hour."""

TURNS_SAMPLES = 2000
"""Samples among which turning points are counted: a record of a hundred periods has twenty in each."""

USUAL_SEGMENT_LEAST = 2 * SEGMENT_SAMPLES
"""Samples of a segment of usual length at least: twice the shortest one that may be asked for."""

HALF_PERIOD = 0.25
"""Half of the span over which a parabola is laid to read off a state, in periods of the cutoff. Its slope is
then 3 % low for a sine of a third of that frequency, 23 % at it."""

HALF_LEAST = 4
"""Samples in this half at least: nine in all, for three coefficients."""

HALF_MOST = 8
"""Part of a record that this half is at most: an eighth, a quarter of it in all."""

FRICTION_SLOPE = 3.0
"""Slope of the hyperbolic tangent that stands for a presliding force over the speed: at the typical speed
friction acts in full, tanh(3) = 0.995."""

FAR_OUT = 10.0
"""Spreads of an output from its mean that stand for one that is no number: a hundred times the power of the
best constant, which no fit prefers."""

FAR_LIMIT = 100.0
"""Times `FAR_OUT`: where an output that grows without bound is cut off. Of two such runs the worse one is
still recognised, and no square overflows."""

MOST_SAMPLES = 0.75
"""Quantile of the distances from a decimated input: see `INPUT_ROUGH`."""

POINTS_OF_A_SAMPLE = 4
"""Points of a sample at which a controller's force is worked out; its mean is of every second, the middles
of two halves: that of a parabola then errs by a quarter of what its value in the middle does."""

FOLLOWED_AS_REFERENCE = 0.5
"""Spread of input minus output over that of the output, below which the input looks like a reference: values
of a force, in another unit, have no reason to lie that near. Worse loops are not recognized."""

HARDLY_FOLLOWED = 100.0
"""The same beyond which a reference is doubted: a loop that sticks most of the time still moves by more than
a hundredth of it (one with a twelfth is in the tests), and forces [N] are rarely that near to paths [m]."""
