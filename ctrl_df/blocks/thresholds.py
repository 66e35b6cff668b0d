"""Tuned numbers of blocks, each with its reason; sizes that fits begin with stand in the effects."""

from __future__ import annotations

# --- probing laws -----------------------------------------------------------------------------------

PROBED_POWERS = 100
"""Powers of two either way within which laws are probed: from 1e-30 to 1e30, whatever the unit."""

SLIPS = 0.9
"""Share of the most that a joint can carry to which a larger pull bends it: it may take any bend to reach all
of it."""

NEARER = 16.0
"""Factor by which a bend is reduced until it carries less than the pull: fifty such lead from 1e30 to
1e-30."""

REST_STEPS = 3
"""Newton's steps to where internal states rest: where rates are linear one of them leads there, the others
remove what its differences err by."""

ZERO_SIZE = 2.0**-10
"""What stands for the size of a state that is zero, where differences are taken: where rates are linear any
does."""

LONGER, LONGER_SETTLED = 4.0, 16.0
"""Growth of implicit Euler's steps, and its square after one that changes nothing: a state has come to rest
if the next one, so much longer, changes nothing either."""

REST = 4 * PROBED_POWERS
"""Power of two of the longest such step: from 2^-100 on 250 of them, then nothing comes to rest."""

SHORT_TIME = 0.1
"""Change of rates, over them, within a time that is short for the states: they hardly change in it."""

SPEEDS, SLIDES_ALIKE = (1.0, 2.0), 1e-6
"""Speeds at which states in motion are asked what they come to; their relative difference up to which that
depends on no speed: with it even the twentieth root of a speed changes a state by 3 %."""

SPEEDS_ALIKE, PARAMETER_ASKED = (0.5, 1.0, 3.0), 2.0
"""Speeds at which a law is recognized that is the same at all, or proportional: to be both at three is no
chance; and the level of a static one, asked beside kinetic levels of half of it, of it, and beyond."""

PLACES = (0.0, 0.137, 0.271, 0.389, 0.513, 0.642, 0.777, 0.913)
"""Of a length, where a law is asked whether it repeats after it: no two a simple share of it apart."""

PLACE_REPEATS, VARIES = 1e-9, 1e-6
"""Difference over such a length, of the largest value, that is rounding: a phase of a million radians keeps
ten digits; and between places, from which the law depends on the place at all, as no force of a millionth is
worth a law."""

SHARE_MOST = 0.999
"""Share of the mass behind a joint at most: a thousandth of it lies on either side."""

# --- the compliant form -----------------------------------------------------------------------------

STICK_VELOCITY, CONTACT_TIME, FOLLOW_TIME = 1e-4, 1e-3, 1e-3
"""Defaults of ``control.config``: speed [m/s] up to which dry friction rises, so that a stuck body creeps by
0.1 mm in a second at most; duration [s] of a contact, and time constant of elements with memory, a hundredth
of a motion at 10 Hz. Smaller is nearer to the exact laws, and stiffer."""

CARRIED_ROUNDS = 200
"""Rounds in which friction and the force carried are balanced: friction of nine tenths of that force is then
right to 0.9^200, 7e-10. Less are made where the next would change it by rounding alone."""

RESTITUTION_LEAST = 1e-3
"""Restitution whose logarithm is taken at least, a damping ratio of 0.91: at zero the damping has none."""

NEAR_CREEP = 10.0
"""Speed, over that of creep, up to which the compliant form bends friction: exp(-9), 1e-4, of what sticking
adds to the level is left there."""

# --- effects ------------------------------------------------------------------------------------------

INSIDE, REBOUNDS = (0.999, 0.99, 0.96, 0.9), (0.05, 0.5)
"""Stops that fits begin with: within the stroke recorded by these shares; restitutions."""

EVEN_STOPS, FAR_STOP = 0.001, 4.0
"""Middle of the motion, over half its stroke, that is none: the nearest of these stops. Half the distance of
two stops of which one is hit, over half the stroke: the other is out of reach."""

FAR_STROKES = 10.0
"""Strokes within which a spring has its center: over one stroke the force of others changes by less than a
tenth, as a constant force may in its place."""

# --- fits -------------------------------------------------------------------------------------------

KEPT_EFFECTS = 64
"""Effects with other values that a block keeps: twice what central differences by sixteen parameters ask
for."""
