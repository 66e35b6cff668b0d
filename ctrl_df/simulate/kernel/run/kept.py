# pyright: reportCallIssue=false
# (numba's stubs know neither its private options nor the arguments of an intrinsic)
"""What a run that is made by several calls keeps from one to the next: where it is cut alters no number.

How many steps a call makes is a matter of the clock, so that Ctrl-C is seen in time.
"""

from __future__ import annotations

from ...compiler.compiled import part

GOES_ON = 0
"""Of `Space.memo`: 1.0 where the next call goes on with the same run."""

KEPT = 14
"""Numbers in it."""


@part(inline=True)
def keep(now, memo):
    """Keep what `advance` has not written elsewhere; whoever goes on has to say so."""
    memo[GOES_ON] = 0.0
    memo[1], memo[2], memo[3] = now.idle, now.progressed, now.shortest
    memo[4], memo[5], memo[6] = now.level, now.patience, now.stale
    memo[7], memo[8], memo[9] = now.skip, now.wait, now.slot
    memo[10], memo[11] = now.generation, 1.0 if now.armed else 0.0
    memo[12], memo[13] = 1.0 if now.known else 0.0, 1.0 if now.jumped else 0.0


@part(inline=True)
def take_up(now, memo):
    """Go on with it; rates and margins at hand stand in the space as they did."""
    now.idle, now.progressed, now.shortest = int(memo[1]), memo[2], memo[3]
    now.level, now.patience, now.stale = int(memo[4]), int(memo[5]), int(memo[6])
    now.skip, now.wait, now.slot = int(memo[7]), int(memo[8]), int(memo[9])
    now.generation, now.armed = memo[10], memo[11] == 1.0
    now.known, now.jumped = memo[12] == 1.0, memo[13] == 1.0
