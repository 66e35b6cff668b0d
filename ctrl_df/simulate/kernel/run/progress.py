"""Numbers of a run and of the step it tries, which all of its parts read and move."""

from __future__ import annotations

from typing import NamedTuple

from ...compiler.compiled import part
from ...compiler.numbers import Numbers
from ...dynamics.modes import settle


class Progress(NamedTuple):
    """How far a run has come. The first ten stay as they are."""

    hmax: float  # longest step [s]
    shortest: float  # steps and intervals between events no longer than that are no progress [s]
    held: bool  # inputs jump from sample to sample
    tracked: bool  # margins need the rates of inputs
    bumpy: bool  # a friction law has a narrow feature over speed
    delays: bool  # the state is a history as well
    affine: bool  # all laws are: steps are power series
    curved: bool  # some laws of one mechanism are not
    gliding: bool  # steps by propagators are tried
    waves: bool  # outputs are integrated
    t: float  # time [s]
    h: float  # next step [s]; 0: none has been made
    index: int  # next output
    segment: int  # of the inputs
    next_tick: float  # of a sampled controller [s]
    steps: int
    events: int
    reason: int  # why it returns, see `reasons`
    known: bool  # k[0] and g0 hold rates and margins at (t, x)
    jumped: bool  # something outside the states jumped just now: modes may be out of line
    armed: bool  # it has been before the section: beyond it is a passage, at an event too
    blocked: int  # margin of the section where that has just been passed (-1: not)
    idle: int  # events without progress
    progressed: float  # time of the last event with progress [s]
    generation: float  # of the record that a delay opens next
    slot: int  # of the present mode, where it is affine
    skip: int  # steps until those by propagators are tried again
    wait: int  # how many that were
    level: int  # order of steps that samples cut short
    patience: int  # steps until a lower order is tried
    stale: int  # steps until rounding is estimated again


class Trial(NamedTuple):
    """A step that is tried, of `length` seconds."""

    limit: float  # where it ends at the latest: inputs, delays or controllers may jump or kink there [s]
    length: float
    truncated: bool  # it ends there
    rank: int  # order of its method; of a power series 0
    terms: int  # of its interpolant, see `inside`
    prepared: bool  # whether that is there
    following: float  # the step after it [s]
    suspect: bool  # it may hold an event
    theta: float  # fraction before the event; 1: none
    at: int  # margin of the event; -1: none


new_progress = Numbers(Progress).opener()
new_trial = Numbers(Trial).opener()


@part(inline=True)
def line_up(task, now):
    """Bring the modes in line with all that acts on them now; False where they do not settle."""
    ws = task.space
    return settle(task.prog, task.drive, now.segment, now.t, task.x, task.mode, ws.work, ws.dx)
