# pyright: reportCallIssue=false
# (numba's stubs know neither its private options nor the arguments of an intrinsic)
"""States beside one another, in one call: where the flow of a mode takes them."""

from __future__ import annotations

import math

import numpy as np

from .compiler.compiled import njit
from .compiler.native import call_native
from .compiler.views import lean
from .dynamics.matrices import copy
from .engine import Engine, State
from .kernel import driver
from .kernel.run import reasons
from .kernel.run.kept import GOES_ON
from .kernel.space import space_at
from .program import pointers
from .program.layout import H_NG, Drive
from .thresholds import HEIGHT, MAX_STEPS, STEPS_AT_ONCE_MANY


def flow(engine: Engine, state: State, x, span: float, drive: Drive, rtol: float) -> np.ndarray:
    """Return where states `x` (k, n) are a time `span` [s] later, in the mode of `state`, events ignored."""
    x = np.array(x, dtype=float, order="C")
    scale = np.zeros((4, int(engine.program.ints[H_NG]) + 1)) if state.scale is None else state.scale
    clock = np.array(
        [state.time, 0, state.step, 0, 0, 0, state.segment, float(state.on_section), -1, 0], float
    )
    pointers.raised.clear()
    with pointers.interruptible():
        _flow(
            driver.address(), engine.program, drive, clock, x, state.mode, state.time + span, rtol,
            max(rtol, HEIGHT), scale, int(state.fresh), engine.space.at, np.zeros(0),
            np.zeros((0, engine.nstates)), np.zeros((0, engine.noutputs)), np.zeros(1), np.zeros(1, np.int64),
            np.zeros(1, np.int64), np.zeros(engine.nstates), np.zeros((engine.noutputs, 0), complex),
            clock.copy(), state.mode.copy(), scale.copy(),
        )  # fmt: skip
    pointers.raise_kept()
    return x


@njit(error_model="numpy", nogil=True)
def _flow(
    engine, prog, drive, clock, x, mode, end, rtol, height, scale, fresh, space, none, none_x, none_y,
    log_t, log_n, log_k, before, spectrum, my_clock, my_mode, my_scale,
):  # fmt: skip
    """Run every row of `x`, in place, from the same clock, mode and scale."""
    prog, drive, x, memo = lean(prog), lean(drive), lean(x), space_at(space).memo
    clock, mode, scale = lean(clock), lean(mode), lean(scale)
    my_clock, my_mode, my_scale = lean(my_clock), lean(my_mode), lean(my_scale)
    for row in range(x.shape[0]):
        copy(clock, my_clock)
        copy(mode, my_mode)
        for i in range(scale.shape[0]):
            copy(scale[i], my_scale[i])
        begin = fresh
        memo[GOES_ON] = 0.0
        while True:
            reason = call_native(
                engine,
                (
                    prog, drive, my_clock, x[row], my_mode, end, lean(none), lean(none_x),
                    lean(none_y), 8, rtol, 0.0, math.inf, False, False, -1, 0.0, -1, height,
                    min(MAX_STEPS - int(my_clock[3]), STEPS_AT_ONCE_MANY), lean(log_t), lean(log_n),
                    lean(log_k), lean(before), my_scale, begin, space, lean(spectrum), 0.0,
                ),
            )  # fmt: skip
            begin = 0
            if reason != reasons.STEPS or int(my_clock[3]) >= MAX_STEPS:
                break
            memo[GOES_ON] = 1.0
