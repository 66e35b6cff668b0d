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

DEAD_TIME_LONGEST = 0.25
"""Longest dead time tried, over the record, of which three quarters then judge all of them."""

DEAD_TIME_STEP = 0.5
"""Step from one to the next, over half the span in which a state is read off: one lies then within a
sixteenth of the shortest period of the right one."""

DEAD_TIMES = 200
"""Dead times tried at most: each is a regression of a millisecond."""

RESONANCES = (1.5, 40.0)
"""Lowest and highest resonance tried, over the rate of the motion (its speed over its stroke). The stroke of
a drive that runs far tells nothing of its joint: there they go on to what shows (`RESONANCE_SAMPLES`)."""

RESONANCE_STEP = (40.0 / 1.5) ** (1 / 11)
"""Factor from one to the next, a third: one is within 16 % of any."""

RESONANCE_SAMPLES = 6.0
"""Samples a period of the highest resonance that shows: enough to tell a frequency."""

JOINT_DAMPING = 0.1
"""Damping ratio of these joints: the resonance is then 20 % wide at half its power."""

LONG_WAVES = 5
"""Ripples that fits begin with by what they change in the output. Half and twice change nothing on a rig with
a ripple."""

LONG_WAVE_TURNS = 30.0
"""Wavelengths to the stroke up to which ripples are sought by what they change in the output: 200 runs of the
segments, a second at most. Ripples of 9 and of 16 wavelengths beside Stribeck friction, which the motion does
not show above its noise, are found with 30 and 40, and were not with 6 (pairs 59 and 87 of the second
generator)."""

RIPPLE_SAMPLES = 2**14
"""Samples of waves examined at once: a processor keeps them in its cache (of 2**12 to 2**17 the fastest)."""

RIPPLE_TURNS = 400.0
"""Wavelengths to the stroke at most, of ripples that are tried: finer than encoders and cogging have (bounds
work)."""

RIPPLE_STEP = 0.3
"""Step between two of them, in wavelengths to the stroke: one turn apart they are orthogonal, and of one 0.15
turns off the nearest that is tried 93 % of the power are seen."""

RIPPLE_COARSEST = 6.0
"""Shortest wavelength over the error of the smoothed position: a phase is then known to one radian."""

PROPORTIONAL_SIZES = (0.02, 0.1, 0.4)
"""Sizes, over the natural one, of an effect of which nothing is known, where the change of the output is
proportional to its size: what is left is scaled (`AS_IT_IS`)."""

SIZES = (0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0)
"""The same of any other effect: half a decade apart."""

AS_IT_IS = 1.25
"""Factor up to which a start that is proportional is not scaled: it leaves (1 - 1/1.25)^2, 4 %, of what the
effect takes away."""

FACTOR_MOST = 300.0
"""Factor by which it is scaled at most: beyond, nothing is proportional."""

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

GRID_RANGE = (0.3, 3.0)
"""Steps of a sensor that rounds, tried from and to, over the one whose error is the one seen: half a decade
either way."""

GRID_STEPS = (10, 4000)
"""Steps tried, and samples asked, at least and at most: bounds work."""

GRID_CONTRAST = 0.9
"""Contrast over the largest from which a grid stands out. The true step lies a twelfth of a turn over the
span off one that is tried (`GRID_PER_TURN`), and there keeps 0.99 of its contrast; the rest is for noise."""

LIKE_LEFT = 0.1
"""Share of the power of one law's force that another one may leave to begin a fit in its place: beyond, its
error is no longer near the other's."""

LIKE_SAMPLES = 100
"""Samples of a motion that tell it: more than enough for a few parameters."""

RIPPLE_BAND = 4
"""Part of the span over which a state is read off, within which means are taken: they keep the motion. Half
and twice change nothing on a rig with a ripple."""

RIPPLE_RUN = 32
"""Parts of the longest run at least, of which the nine forces that are regressed (`RUN_LEAST`) leave two
thirds. Half and twice change nothing on a rig with a ripple."""

RIPPLE_NEAR = 13
"""Ripples tried about the best one, a twentieth of a turn apart."""

RIPPLE_ROUNDS = 3
"""Rounds in which frequencies are weighted. Half and twice change nothing on a rig with a ripple."""

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

GRID_PER_TURN = 6
"""Steps tried for each value more that the span then has: their ends are a sixth of a turn apart."""

GRID_FINE = 201
"""Steps about the best one, a hundredth of that apart."""

PAIR_DEPENDENT = 0.01
"""Share of the power of one effect's change that another's must not explain for the two to be told apart: of
two that differ by a tenth of their amplitude the difference decides, and that is not linear to a tenth."""

PAIRS = 4
"""Pairs of effects that are fitted, of those that explain most over segments of either length. On twelve rigs
of the second generator (pairs 52, 55, 59, 65, 68, 69, 72, 76, triples 7 to 10) two effects that are hidden
are among them on ten."""
