# pyright: reportCallIssue=false
# (numba's stubs know neither its private options nor the arguments of an intrinsic)
"""Steps at a regular pace, called by the driver through their address: compiled for runs that have one."""

from __future__ import annotations

import functools

from ..compiler.compiled import apart, part
from ..compiler.native import COUNTS, NUMBERS, ROWS, native_address
from ..program.layout import H_AFFINE, NO_DRIVE, NO_PROGRAM, Program
from .propagators import propagate
from .space import Space, space_at, workspace


def keep_pace(program: Program, space: Space) -> None:
    """Let runs in a space take steps at a regular pace, where the laws of the program allow them."""
    if program.ints[H_AFFINE] and not space.paced[0]:
        space.paced[0] = address(program.ints[H_AFFINE] == 2)


@functools.cache
def address(curved: bool) -> int:
    """Return the address of the steps, `curved_pace` or `affine_pace`, compiled now if need be."""
    arguments = (
        NO_PROGRAM, NO_DRIVE, workspace(NO_PROGRAM).at, 0, 0.0, 0.0, 0.0, 0, 0, NUMBERS, COUNTS, NUMBERS,
        ROWS, ROWS, ROWS, 0.0, 0.0, 0.0, 0.0,
    )  # fmt: skip
    return native_address(curved_pace if curved else affine_pace, arguments)


@apart
def affine_pace(
    prog, drive, space, slot, t, t_end, hmax, segment, index, x, mode, tout, xout, yout, scale, rtol, atol,
    long, next_tick,
):  # fmt: skip
    """`propagate` where all laws are affine; returns the number of steps, `Space.led` has where they led."""
    ws = space_at(space)
    return _led(ws, propagate(
        prog, drive, ws.work, ws.store, ws.tracks, slot, t, t_end, hmax, segment, index, x, mode, tout,
        xout, yout, ws.size, scale, rtol, atol, long, ws.rounding, next_tick, ws.x1, ws.xi, ws.dx,
        ws.g, None,
    ))  # fmt: skip


@apart
def curved_pace(
    prog, drive, space, slot, t, t_end, hmax, segment, index, x, mode, tout, xout, yout, scale, rtol, atol,
    long, next_tick,
):  # fmt: skip
    """Do the same where some laws are not."""
    ws = space_at(space)
    return _led(ws, propagate(
        prog, drive, ws.work, ws.store, ws.tracks, slot, t, t_end, hmax, segment, index, x, mode, tout,
        xout, yout, ws.size, scale, rtol, atol, long, ws.rounding, next_tick, ws.x1, ws.xi, ws.dx,
        ws.g, ws.bend,
    ))  # fmt: skip


@part(inline=True)
def _led(ws, gone):
    """Keep where `propagate` has led; return the steps gone."""
    ws.led[0], ws.led[1], ws.led[2], ws.led[3] = gone[1], gone[2], gone[3], gone[4]
    ws.led[4], ws.led[5] = 1.0 if gone[5] else 0.0, 1.0 if gone[6] else 0.0
    return gone[0]
