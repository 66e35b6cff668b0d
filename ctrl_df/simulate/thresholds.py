"""Every tuned number of the engine, with what it follows from, or what chose it.

A number that names no derivation bounds work or memory and changes no result, or is the choice of the
textbook named: Hairer, Norsett & Wanner, Solving Ordinary Differential Equations I (HNW). What a method is
made of (its tableau, the terms of a formula) stands beside it.
"""

from __future__ import annotations

import numpy as np

from ..thresholds import EPS

# --- rounding ---------------------------------------------------------------------------------------

ROUNDING = 4.0 * EPS
"""Error of a difference of two numbers that are rounded themselves, over their size: a few half eps. Instants
that differ by less are one, and roots are found to so much of a step."""

RATE_ROUNDING = 32.0 * EPS
"""Error that rounding of a rate leaves in the error estimate of a step, over the rate's largest term: the
weights of the estimates add up to some ten."""

TICK = 1e-6
"""Share of a period within which an instant is a tick: rounding of a billion periods stays below."""

INPUT_JUMPED = 1e-6
"""Of the way that a rate limiter allows in a step: what its input does beyond was no motion. Its rate is a
central difference of eight digits (`INPUT_REACH`)."""

# --- steps ------------------------------------------------------------------------------------------

RTOL = 1e-9
"""Default relative tolerance of a step: differences of runs by a millionth still have three digits."""

RTOL_RANGE = (1e-14, 0.1)
"""Tolerances that may be asked for: rounding leaves fifty eps; with an error of a tenth in every step a run
says nothing."""

MAX_STEPS = 20_000_000
"""Steps of a run at most: 20 s of a small system (`STEP_TIME`), minutes of others."""

STATE_MOST = 1e50
"""State beyond which a system has run away: NaN is then no mistake of a law, whose seventh power
overflows."""

STEP_SAFETY, STEP_SHRINK, STEP_GROWTH = 0.9, 0.2, 5.0
"""Share of the step that an error would just allow; least, largest change from step to step (HNW, II.4)."""

STEP_TIME = 1e-6
"""Time [s] of a step of a small system at most (0.3 to 1 us)."""

GROWS_8, GROWS_5 = (STEP_SAFETY / STEP_GROWTH) ** 8, (STEP_SAFETY / STEP_GROWTH) ** 5
"""Error below which a step of order 8 or 5 grows as far as it may: no root need be taken."""

FIRST_CHANGE = 0.01
"""Change of some state, over itself, in a first step: the guess of HNW, II.4, for any order."""

FIRST_LEAST, FIRST_BLIND = 1e-9, 1e-6
"""Share of the span ahead that a first step takes at least, and where all states are zero: fourteen
steps, each five times the last, lead from it to any length."""

FADING = 0.98
"""What is left of a state's size after a step, exp(-1/50): over fifty steps, more than half a period takes,
tolerances do not tighten by more than e while a state passes zero."""

DENSE = 1e-3
"""Error of a step, times its tolerance, below which a lower order is tried: if the terms of both series fall
alike, order 5 errs by (1e-3)^(5/8), 1 % of the tolerance."""

ORDER_PATIENCE = 40
"""Steps before a lower order that failed, or a lower rank of steps at a pace, is tried again: a failure costs
one, a fortieth."""

SAMPLES_DENSER = 2.0
"""Step that its error allows, over the way to the next sample, from which a pair of lower order makes that
way: twice as dense as need be, samples set the pace."""

ROUNDING_STEPS = 200
"""Steps after which rounding is estimated again: as many rates as states each time, 0.5 % of the work."""

ROUNDING_NUDGE = 1e-4
"""Of the difference quotients that ask for rounding, over the size of a state: only magnitudes count."""

INPUT_REACH = 1e-4
"""Share of a step over which rates of inputs are differenced: they do not bend in it, and rounding leaves
them eight digits."""

TERM_ROUGH = 0.1
"""Share of the interpolant's last term that stands for its error: of a step that is right the terms of its
series fall at least so much from one to the next."""

LAST_BASIS = (4 / 7) ** 4 * (3 / 7) ** 3
"""Largest value of that term's basis function, theta^4 (1 - theta)^3, which is at theta = 4/7: 0.0084."""

WAVE_ROUGH = 3.0
"""Error of the interpolant, in tolerances, where outputs are only integrated: over a step it is 0.42 of its
largest, 1/280 over `LAST_BASIS`, and the errors of steps cancel in part."""

LOW_ORDER = 0.01
"""Weight of the error of order 3 beside that of order 5 in Dormand and Prince's 8(5,3) pair (HNW, II.5)."""

SERIES_REACH = 2.5
"""Angle [rad] of the forcing's highest harmonic in a step of `TERMS` terms, the last 2.5^20/20! = 4e-11."""

GAUSS = 10
"""Nodes of the Gauss quadrature with which outputs are integrated over a step."""

GAUSS_REACH, GAUSS_REACH_AFFINE = 10.0, 6.0
"""Angle [rad] of the highest harmonic between these: L^21 (10!)^4 / (21 (20!)^3) is 6e-10, and 1e-14 where
the states themselves are exact."""

GAUSS_FEW, GAUSS_REACH_FEW = 6, 2.0
"""The same where few do: L^13 (6!)^4 / (13 (12!)^3) is 2e-12 at this angle."""

# --- events -----------------------------------------------------------------------------------------

HEIGHT = RTOL / 10
"""Relative flight below which a bounce has ended, unless the tolerance is larger: below what any step of the
default tolerance tells."""

SETTLING = 50
"""Rounds of settling modes: each one changes a mode, and few loops have as many; more is sliding."""

ZENO = 2000
"""Events without progress after which a run slides: chatter ends after `HEIGHT` = eps^n within 1,200 bounces
at a restitution of 0.98."""

ROUNDS = 10_000_000
"""Collisions at one instant of a load with a motor against its stop, a tenth of a second of work: without
loss they are pi/2 sqrt(m0/m1) (Galperin 2003), which a load has that is 4e13 times as heavy as the motor."""

UNSETTLED = ZENO // 20
"""Events that modes which do not settle count for: twenty such in a row are sliding."""

PROGRESS = RTOL
"""Relative time between events that is progress: more than a step of the default tolerance errs by."""

MARGIN_GROWTH = 100.0
"""By how much a margin that rounding crossed counts as larger: six such widen its tolerance to all of it."""

AFTER_EVENT = 3.0
"""Step after an event over the way to it: a step cut short says little of what follows."""

BUMP_REACH = 6.0
"""Speeds of a narrow feature of friction beyond which it is gone: exp(-36) is below rounding."""

BUMP_KEPT = 0.7
"""Share of a step that such a feature may take away before it is computed again: what is asked is a change of
speed by half, what is caught one by 0.7."""

LOOKS_POWER, LOOKS = 4, 12
"""Pieces of a step in which crossings are looked for: of a series of up to four terms, whose margins turn
thrice at most, and of one of order 7."""

SERIES_LOOKS = 8
"""The same of the series of affine modes, which are looked at with their slopes: a margin may turn once in
each piece and is seen."""

TOUCH_HALVINGS = round(-np.log2(ROUNDING))
"""Halvings toward the begin of a step, where a margin rises from zero before it falls: 50, to four eps."""

BOTTOM_HALVINGS = 40
"""Halvings toward the bottom of a margin, which is flat there: 2^-26, the root of eps, would be all that its
values tell; its slopes, which are halved here, tell 2^-40 of a piece."""

TOUCH_STEPS, TOUCH_CLOSER = 4, 0.25
"""Parabolas through three margins that lead to their lowest, at most, and spacing of the three over that
before: the fourth spans 1/64 of a piece on either side."""

ROOT_STEPS, BISECTED = 100, 10
"""Steps to a root at most, and which of them halve (every eighth of affine modes). Four or so find it; those
that halve bring any other within a thousandth of where it was."""

PROBED_INPUTS = (0.0, 1.0, 10.0)
"""Sizes of random inputs by which a system's output is asked whether it reads them."""

# --- affine modes and series ------------------------------------------------------------------------

TERMS = 20
"""Terms of the series of an affine flow: at 1e-9 a step may turn by 2.3 rad, where the last one is 1e-11."""

SLOTS = 16
"""Modes whose matrices are kept, the latest ones; others are made again when they are met."""

HARMONICS = 32
"""Harmonics of a periodic input that affine steps take: more than the 21 that predictions feed back."""

AFFINE_SHARE = 0.01
"""Share of the tolerance that the neglected terms may have: beside the events they cost nothing."""

FORCING_SHARE = 1e-3
"""The same of the terms of the forcing, of which there are many."""

WIDEST_AFFINE, WIDEST_CURVED = 24, 10
"""States up to which a product with a full matrix is cheaper than the rates themselves; and where curved laws
stand beside, whose steps take several such products."""

EXPONENTIAL_TERMS = 16
"""Terms of an exponential's series: after a turn of half a radian the last is 0.5^16/16! = 7e-19; a step that
turns further is halved."""

EXPONENTIAL_TURN = 2.0
"""Turn [rad] up to which a step is not halved beforehand: beyond, the last of these terms is more than
2^16/16! = 3e-9, and the series ends nowhere."""

EXPONENTIAL_HALVINGS, CURVED_HALVINGS = 12, 40
"""Halvings of a step at most before its exponential is summed: a mode that needs more is left to other steps;
and where stiff laws decay within the step."""

CURVATURE_TERMS, CURVATURE_SHARE, CURVATURE_EXCESS = 64, 1e-6, 1.001
"""Terms at most of the series that limits a margin's curvature, all of one sign; the share of its sum at
which it ends; what stands for the rest. More terms sum exp(20), a limit that no margin keeps."""

EXPONENTIAL_SHARE, CURVED_SHARE = 1e-3, 0.1
"""Share of an eps at which its series ends: twelve squarings make four eps of it; and where steps
double one by one."""

AHEAD = 1.5
"""Steps ahead of which kinks on their way out of a delay are looked for."""

# --- steps at a pace --------------------------------------------------------------------------------

SAME_LENGTH = 1e-3
"""Times the tolerance: how far a step may be from a known length, relative to it. The state is then off by a
thousandth of the tolerance."""

PACED_SHARE = 0.1
"""Share of a step's tolerance that one between samples may have: ten of them, or more, stand for one."""

STIFF, MILD = 0.05, 0.003
"""Contraction h |dR/dx| of a sweep beyond which K is renewed where steps fail, once K is not zero even where
they are right: what is left of a change after a node is that share of it."""

MORE_NODES = 0.25
"""Share of the error that is left by more nodes, above which still more are of no use: a third of the terms
of a series that converges leaves less."""

PART_TURN = 0.5
"""Radians by which the fastest mode may turn, or decay, in a part of a step: of a margin's second differences
that beside the part is then at least (1 - exp(-0.5))^2 / 0.5^2 = 0.62 of the largest in it, so that it lies
within 0.2 of it of the chord, where `CHORD_ROOM` is asked."""

RATE_SQUARINGS = 4
"""Of a matrix, whose trace then tells its largest eigenvalue: of six states at most 6^(1/16) = 1.12 of it."""

PARTS_LEAST, PARTS_MOST = 4, 1024
"""Parts of a step at least, with two changes of a margin's second difference, and at most: a mode that needs
more is left to other steps."""

CHORD_ROOM = 2 / 8
"""Of the largest second difference of a margin at the nodes of a step: how far it must stay above zero. It
lies within an eighth of it of the chord; the other eighth is for a difference that varies."""

CURVED_NUDGE = 1e-6
"""Of difference quotients of the curved laws, over the size of a state: K need not be exact."""

PACE_WAIT = 3
"""Steps at most until constant propagators are tried again, after one and three: a try that fails costs a
step at most, one in four then."""

MADE_IN_STEPS = 200.0
"""Operations, n^3 m (m + 2) for n states and steps of m parts, over the steps by propagators that are worth
the matrices of one. On average these take 3 us for a bristle (three states) and 13 us for Maxwell elements
(six); a step by other methods takes 1 us, one by propagators about half of it."""

WORTH_MOST, PACE_REST = 150.0, 300
"""Steps by propagators that their matrices may cost beyond what they were worth, and that may be set aside
for them; steps by other methods that follow before propagators are tried again. Of 12 the stiff bristle of
`benchmarks/run.py` took a quarter longer, of 40 one beside a Stribeck curve a sixth; of 150 none of twelve
models did; bristles and Maxwell elements that bend at every sample (two stiffnesses of each, segments of two
lengths) took 0.43 to 1.01 of the time."""

# --- forces under an imposed motion -----------------------------------------------------------------

IMPOSED_RTOL = 1e-7
"""Relative tolerance of hidden states: forces are then right to about six digits."""

IMPOSED_NUDGE, IMPOSED_ALONG = 1e-7, 1e-6
"""Differences by a state, over its size, a bit more than the root of eps; by time, over the piece."""

IMPOSED_SHRINK = 0.1
"""Least change of a step: a bristle's rate may grow tenfold from one to the next."""

SECANT_STEPS, SECANT_CLOSED = 60, 1e-13
"""Secant steps for friction that grows with the force carried (two where laws are linear), and share of the
force to which that balance is found: 450 eps, what rounding leaves of a sum of laws."""

BLIND = 1e-30
"""Size of a state that has never been any, for differences: of so small a number squares still are
numbers."""

# --- machine code -----------------------------------------------------------------------------------

SPEED, INLINED = 2, 100
"""LLVM's level (1 makes the steps of Runge-Kutta methods half as fast, 3 nothing faster), and the size up to
which functions are copied into others (larger ones are no faster for it)."""

COLLECTED = (100_000, 20, 50)
"""New objects, and younger collections, after which Python looks for garbage while the compiler works: saves
a tenth of its time for a quarter more memory; never to collect saves no more, and takes twice the memory."""

# --- work and memory --------------------------------------------------------------------------------

CHUNK_TIME, CHUNK_LEAST, CHUNK_CHANGE = 0.2, 1e-6, (0.05, 4.0)
"""Time [s] that compiled code may run before Python looks whether Ctrl-C was pressed: nobody waits for so
little. Shortest time that a clock tells; least and largest change of the number of steps in it, one step
being some twenty times as long as another at most."""

STEPS_AT_ONCE_MANY = round(CHUNK_TIME / (2 * STEP_TIME))
"""Steps of a small system where many runs or intervals are made in one call: 100,000, half of that time."""

STEPS_AT_ONCE = STEPS_AT_ONCE_MANY // 10
"""The same until the pace is known: steps may take ten times as long, as laws of users do."""

STEPS_ALONE = 5 * STEPS_AT_ONCE_MANY
"""Steps that many runs may take together up to which the thread that asks for them makes them: Ctrl-C waits
half a second at most. Asking another thread takes 0.1 ms, more than most runs."""

SMALL_STATES, FEWEST_STEPS = 6, 10
"""States of a small system: of so many the products with matrices take as long as all else in a step, of
twice as many four times as long. Steps at once at least."""

MOST_OUTPUTS = STEPS_AT_ONCE_MANY
"""Outputs recorded in one go: as many as steps, each of which may have one."""

EVENTS, LOGS = 256, 16
"""Events of one run of many that are logged before its log is emptied; logs kept until Python takes them: 24
bytes for each of 4,096 events, of every thread."""

LOG = LOGS * EVENTS
"""Events of a single run between two returns to Python."""

TOGETHER_RUNS, TOGETHER_INTERVALS, SPLITS = 256, 64, 64
"""Runs in one call, for each of which the 0.1 ms that asking a thread takes are then 0.4 us, less than a
step; intervals in one call, which take as many steps as `STEPS_AT_ONCE` if each takes 150; kinds of systems
in a batch, all answers to six questions about their parameters, beyond which they are packed one by one."""

PEAK_DECADES = 6.0
"""Decades below the longest first interval in which the first crossings may lie, 21 points in each: a cycle
may be a million times as fast as the slowest pole."""

INTERVAL_LONGER = 4.0
"""Longest interval without a crossing, over the one before. Of ten loops verified all come out as at half of
it, in the same time; at twice one start of a relay's loop is taken to come to rest, which it does not."""

PEAK_SAMPLES = 32 * round(INTERVAL_LONGER) + 1
"""Points of an interval from which the peak of an output is read, 32 between two crossings: the highest of
them is within 1 - cos(pi / 32), 0.5 %, of that of a sine."""

INTERVAL_STEPS = 4 * STEPS_AT_ONCE_MANY
"""Steps of an interval, or of a forced motion before it is measured, at most: 0.4 s of work."""

CALLBACK_STEP = 5
"""Longest step, in those between output times, where the input is a function of time: it may jump anywhere,
and a longer step would pass over what it does between two outputs."""

SHOWN = 10
"""Events that a notebook shows: the others are in the result."""


def steps_at_once(small: int, states: int) -> int:
    """Return how many steps take as long as `small` steps of a small system."""
    return max(int(small / (1 + (states / SMALL_STATES) ** 2)), FEWEST_STEPS)
