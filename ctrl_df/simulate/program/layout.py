"""The engine's view of a system: plain arrays, and what their columns mean.

A *node* is an elementary part (a mechanism, a linear system, a piecewise-affine element, ...). Its inputs are
linear combinations of node outputs (signals `s`) and external inputs `r`. Nodes stand in an order in which
every node with direct feedthrough follows those it depends on.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

# kinds of nodes
LTI, PWA, QUANTIZER, SMOOTH, MECHANISM, SAMPLED, PLAY, RATE, SYSTEM, DELAY, RAMP = range(11)

# columns of the node table
KIND, NIN, NOUT, IN, OUT, X, NX, PAR, MODE, G, NG, AUX, FEED = range(13)

# modes of a mechanism (offsets in the mode vector): direction of body 0 and 1, joint, rigid wall,
# yielding wall
DIR0, DIR1, JOINT, WALL, TOUCH = range(5)
STUCK, FREE = 0, 2  # besides the directions -1 and +1

# integer layout of a mechanism in the aux table
A_BODIES, A_JOINT, A_STOP, A_BRISTLE, A_MEASURED, A_NFORCE, A_NFRIC0, A_NFRIC1, A_LAWS = range(9)
A_INNER = 9  # states of its laws, which follow those of its bodies
A_ASKING = 10  # whether a friction law asks for more than the motion
# number of laws; places in the list of the laws of a bristle, a joint, a yielding wall (-1: none). They stand
# behind those of forces and friction.
A_COUNT, A_PRESLIDING, A_COUPLING, A_CONTACT = range(11, 15)
# joint kinds
J_NONE, J_RIGID, J_IMPACT, J_ELASTIC = range(4)

# float layout of a mechanism in the parameter table
P_M0, P_M1, P_GAP, P_REST, P_LOW, P_HIGH, P_STOP_REST = range(7)
P_BUMP0, P_BUMP1 = 7, 8  # narrowest feature of each body's friction over speed [m/s], inf: none

# event slots of a mechanism
G_BODY0, G_BODY1, G_JOINT_LOW, G_JOINT_HIGH, G_WALL_LOW, G_WALL_HIGH = range(6)

EVENT_KINDS = (
    "reversal",
    "stick",
    "breakaway",
    "impact",
    "contact",
    "release",
    "stop",
    "stop contact",
    "corner",
    "switch",
    "engage",
    "disengage",
    "section",
)
(
    E_REVERSAL,
    E_STICK,
    E_BREAKAWAY,
    E_IMPACT,
    E_CONTACT,
    E_RELEASE,
    E_STOP,
    E_STOP_CONTACT,
    E_CORNER,
    E_SWITCH,
    E_ENGAGE,
    E_DISENGAGE,
    E_SECTION,
) = range(13)


# header of the integer table: sizes of state, signals, inputs, outputs, modes, margins; widest node input;
# whether margins need input rates; position of the output rows; offsets of node inputs and of scratch in the
# work vector; whether a friction law has a narrow feature over speed; whether the flow of every mode is
# affine (1), or is but for the curved laws of one mechanism (2); number of delays, and where their history
# begins in the work vector; whether an output answers at once to an external input
H_NX, H_NS, H_NR, H_NY, H_NM, H_NG, H_NIN, H_TRACK, H_OUT, H_U, H_SCRATCH, H_BUMP = range(12)
H_AFFINE, H_DELAYS, H_HISTORY, H_DIRECT = 12, 13, 14, 15

# a law's record in the integer table. A joint's acts on BOTH bodies
R_ADDRESS, R_PAR, R_STATE, R_BODY, R_SORT, R_SIZE = range(6)
BOTH = -1
# sorts of laws: affine in place and speed while the mode lasts, or not; a friction law is of the sort of its
# whole chain
STRAIGHT, CURVED = 1, 2
ASKING = 4  # added to the sort of a friction law that asks for more than the motion
DRIVING = 8  # added to that of a force which is the drive's own (back-EMF)

# forces of a mechanism in the scratch of a run: on its two bodies; those given from outside on either; which
# sorts of laws are asked; what friction laws that ask are told of either body: place, drive, load
F_GIVEN, F_ASKED, F_LAW_INPUTS, F_SIZE = 2, 4, 5, 11

# the history of a delay in the work vector: three numbers, then a ring of records: start, length,
# generation, values; see `ctrl_df.simulate.dynamics.history`
Y_RING, Y_POINTS, Y_RECORDS, Y_VALUES = 4096, 8, 3, 3
Y_RECORD = Y_VALUES + Y_POINTS
Y_SIZE = Y_RECORDS + Y_RING * Y_RECORD


class Program(NamedTuple):
    """A system as arrays; everything a compiled function needs to run it.

    Few arrays, since each is passed from function to function by value. ``ints`` holds the header, aux
    tables, law records and, for every input or output, a row: its length, then pairs (index in the work
    vector, index of its weight in ``par``). The work vector is signals, external inputs, inputs of the node
    at hand, scratch.
    """

    nodes: np.ndarray  # (n, 13) int64
    ints: np.ndarray  # int64
    par: np.ndarray  # float64


class Drive(NamedTuple):
    """External inputs: value + slope (t - t0) + Re sum_k c_k exp(j k w t) each, or a function called back."""

    time: np.ndarray  # sample times (may be empty), segments of `samples`
    samples: np.ndarray  # (nr, nt)
    linear: int  # 0: held over a sample, 1: interpolated
    harmonics: np.ndarray  # (nr, nh) complex, k = 0, 1, ...
    omega: float
    address: int  # of a function called back, or 0


NO_PROGRAM = Program(np.zeros((0, 13), np.int64), np.zeros(H_DIRECT + 1, np.int64), np.zeros(0))
NO_DRIVE = Drive(np.zeros(0), np.zeros((0, 0)), 0, np.zeros((0, 0), complex), 0.0, 0)
"""Of no nodes and no inputs: arguments that code is compiled for."""
