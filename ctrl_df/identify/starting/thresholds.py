"""Where fits begin: tuned numbers, each with what it follows from or what chose it (`../thresholds.py`)."""

from __future__ import annotations

SPECTRUM_SAMPLES = 25_000
"""Samples of a record beyond which ripples are sought in means over several: bounds the time of a scan, in
which every one of up to 1,300 wavelengths costs a Fourier transform."""

JOINTS_TRIED = 4
"""Joints of a share of load from which those that begin are chosen, a third of those tried at least. Half and
twice change nothing on a rig with a joint."""

STRONG = 0.5
"""Share of the mean squared force that is missing up to which a single law leaves: it takes more of it than
all that is left, and the model's own parameters are bent by it."""

DEAD_TIME_LONGEST, DEAD_TIME_STEP, DEAD_TIMES = 0.25, 0.5, 200
"""Dead times tried: the longest over the record, of which three quarters then judge all of them; step over
half the span in which a state is read off, so that one lies within a sixteenth of the shortest period of the
right one; how many at most, a regression of a millisecond each."""

RESONANCES, RESONANCE_STEP, RESONANCE_SAMPLES, JOINT_DAMPING = (1.5, 40.0), (40.0 / 1.5) ** (1 / 11), 6.0, 0.1
"""Joints tried: resonance over the rate of the motion (its speed over its stroke) from and to, and a factor
from each to the next, a third, so that one is within 16 % of any. The stroke of a drive that runs far tells
nothing of its joint: on to what shows, with as many samples a period at least, which are enough to tell a
frequency. Damping ratio, of which the resonance is 20 % wide at half its power."""

LONG_WAVES, LONG_WAVE_TURNS = 5, 30.0
"""Ripples that fits begin with by what they change in the output (half and twice change nothing on a rig with
a ripple); wavelengths to the stroke up to which they are sought there: 200 runs of the segments, a second at
most. With 6, ripples of 9 and of 16 wavelengths beside Stribeck friction, which the motion does not show
above its noise, were not found (pairs 59 and 87 of the second generator); with 30 and 40 they are."""

RIPPLE_SAMPLES = 2**14
"""Samples of waves examined at once: a processor keeps them in its cache (of 2**12 to 2**17 the fastest)."""

RIPPLE_TURNS, RIPPLE_STEP, RIPPLE_COARSEST = 400.0, 0.3, 6.0
"""Ripples tried: wavelengths to the stroke at most, finer than encoders and cogging have (bounds work);
between two of them: one turn apart they are orthogonal, and of one 0.15 turns off the nearest that is tried
93 % of the power are seen; shortest wavelength over the error of the smoothed position: a phase is then known
to one radian."""

PROPORTIONAL_SIZES, SIZES = (0.02, 0.1, 0.4), (0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0)
"""Sizes of an effect of which nothing is known, over the natural one: where the change of the output is
proportional to them, and what is left scaled; of any other, half a decade apart."""

AS_IT_IS, FACTOR_MOST = 1.25, 300.0
"""Factor up to which such a start is not scaled, as it leaves (1 - 1/1.25)^2, 4 %, of what the effect takes
away; by which it is at most: beyond nothing is proportional."""

MOVING = 0.03
"""Speed, over the typical one, from which a sample shows forces: below, friction may be anything; a sine
leaves 1 % of its samples there. """

DRY_LEAST, VISCOUS_LEAST = 0.01, 1e-3
"""Regressed dry and viscous friction at least, over the typical force: both are moved by factors, so that
none may be zero; less would show in no output. """

JOINT_GAIN = 3e-2
"""Relative gain of the cost at which the initial states of a joint are found well enough to compare it: its
error is then known to 1.5 %, and neighbours on the grid differ by factors."""

RIPPLE_LONGEST = 0.6
"""Wavelengths to the stroke at least: of a longer wave a stroke shows no more than of a spring."""

WAVES_AT_ONCE = 16
"""Waves whose change of the output is simulated in one call: it bounds memory and changes no result."""

WAVE_TRIED = 0.01
"""Amplitude of a ripple whose change of the output is simulated, over the typical force: linear to a
hundredth, and a thousand times the error of simulations (`RTOL_COARSE`)."""

RUN_LEAST = 12
"""Samples of a part of a record without holes that is asked for ripples, at least: its second differences,
two fewer, are then more than the nine forces that are regressed from them (the one given, six without waves,
two of a wave)."""

GRID_RANGE, GRID_STEPS, GRID_CONTRAST = (0.3, 3.0), (10, 4000), 0.9
"""Steps of a sensor that rounds: about the one whose error is the one seen, by half a decade; how many are
tried (and samples asked), at least and at most; contrast over the largest from which a grid stands out: the
true step lies a twelfth of a turn over the span off one that is tried (`GRID_PER_TURN`), and there keeps 0.99
of its contrast, the rest is for noise."""

LIKE_LEFT, LIKE_SAMPLES = 0.1, 100
"""Share of the power of one law's force that another may leave to begin a fit in its place: beyond, its error
is no longer near the other's. Samples of a motion that tell it: more than enough for a few parameters."""

RIPPLE_BAND, RIPPLE_RUN, RIPPLE_NEAR, RIPPLE_ROUNDS = 4, 32, 13, 3
"""Part of the span over which a state is read off within which means are taken, so that they keep the motion;
parts of the longest run at least, of which the nine forces that are regressed (`RUN_LEAST`) leave two thirds;
ripples about the best one, a twentieth of a turn apart; rounds in which frequencies are weighted.
Half and twice of the first two and of the rounds change nothing on a rig with a ripple."""

SPECTRUM_AROUND, SPECTRUM_WIDTH = 40, 1.4
"""Frequencies at which the power around them is taken, and how far around, as a factor: half an octave to
either side, so that of 40 over four decades neighbours overlap. """

FADES = 0.25
"""Power of Hann's window that fades the ends of a run: it leaves no step there, and 2 / pi of the run's
power, where the window itself leaves three eighths."""

RIPPLES = 3
"""Ripples of the spectrum that fits begin with. Half and twice change nothing on a rig with a ripple."""

STARTS_APART = 0.25
"""Relative difference of a value up to which two starts are one: the one leaves a sixteenth, 6 %, of the
power of the other's effect."""

GRID_PER_TURN, GRID_FINE = 6, 201
"""Steps tried to a value more over the span, a sixth of a turn of its ends apart; steps about the best one: a
hundredth of that."""

PAIR_DEPENDENT = 0.01
"""Share of the power of one effect's change that another's must not explain for the two to be told apart: of
two that differ by a tenth of their amplitude the difference decides, and that is not linear to a tenth."""

PAIRS = 4
"""Pairs of effects that are fitted, of those that explain most over segments of either length. On twelve rigs
of the second generator (pairs 52, 55, 59, 65, 68, 69, 72, 76, triples 7 to 10) two effects that are hidden
are among them on ten."""
