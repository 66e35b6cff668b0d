# pyright: reportCallIssue=false
# (numba's stubs know neither its private options nor the arguments of an intrinsic)
"""What Python asks of single states: rates, margins and outputs there, and the jump of one event."""

from __future__ import annotations

from ..compiler.compiled import njit
from ..compiler.views import lean
from ..dynamics.flow import combine, rates
from ..dynamics.modes import event, settle
from ..program.layout import H_OUT, H_TRACK
from ..thresholds import HEIGHT
from .locate import complete


@njit(error_model="numpy")
def evaluate(prog, drive, t, x, mode, work, dx, g, y, settled, reach):
    """Write rates to `dx`, margins to `g` and outputs to `y` (as many as it has room for) at one state.

    With `settled` the modes (and what they reset) are brought in line first. Margins that need the rate of an
    input take it over +-`reach` seconds; at 0 they are left out.
    """
    prog, drive, x, mode, work, dx, g = (
        lean(prog), lean(drive), lean(x), lean(mode), lean(work), lean(dx), lean(g),
    )  # fmt: skip
    if settled:
        settle(prog, drive, 0, t, x, mode, work, dx)
    rates(prog, drive, 0, t, x, mode, work, dx, g, True)
    for i in range(y.shape[0]):
        y[i] = combine(prog, prog.ints[prog.ints[H_OUT] + i], work[0])
    if reach > 0.0 and prog.ints[H_TRACK] == 1:
        complete(prog, drive, 0, t, x, mode, work, dx, g, reach, -1, 0.0, 1)


@njit(error_model="numpy")
def evaluate_each(prog, drive, t, x, u, mode, work, dx, g, y):
    """Write rates `dx`, margins `g` and outputs `y` at each of many states `x` (m, n), modes settled first.

    All inputs are held at `u` (m,) at the times `t` (m,), as the harmonics of order zero of `drive`; every
    state is settled from the same `mode`.
    """
    now = mode.copy()
    prog, work, constant = lean(prog), lean(work), drive.harmonics
    inputs, modes = lean(drive), lean(now)
    for row in range(x.shape[0]):
        now[:] = mode
        constant[:, 0] = u[row]
        state, slope, margins = lean(x[row]), lean(dx[row]), lean(g[row])
        settle(prog, inputs, 0, t[row], state, modes, work, slope)
        rates(prog, inputs, 0, t[row], state, modes, work, slope, margins, True)
        for i in range(y.shape[1]):
            y[row, i] = combine(prog, prog.ints[prog.ints[H_OUT] + i], work[0])


@njit(error_model="numpy")
def jump(prog, drive, t, x, mode, work, dx, g, node, slot, reach):
    """Let the event of margin `slot` of a node happen at (t, x), in place."""
    prog, drive, x, mode, work, dx, g = (
        lean(prog), lean(drive), lean(x), lean(mode), lean(work), lean(dx), lean(g),
    )  # fmt: skip
    rates(prog, drive, 0, t, x, mode, work, dx, g, False)
    event(prog, drive, 0, t, x, mode, work, dx, g, node, slot, HEIGHT, reach)
