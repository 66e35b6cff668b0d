# pyright: reportCallIssue=false
# (numba's stubs know neither its private options nor the arguments of an intrinsic)
"""Single states looked at from Python: rates, margins and outputs there, and the jump of one event."""

from __future__ import annotations

from ..compiler.compiled import njit
from ..compiler.views import lean
from ..dynamics.flow import combine, rates
from ..dynamics.modes import event, settle
from ..program.layout import H_OUT, H_TRACK
from ..thresholds import HEIGHT
from .locate import complete


@njit(error_model="numpy")
def look(prog, drive, t, x, mode, work, dx, g, y, settled, reach):
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
def jump(prog, drive, t, x, mode, work, dx, g, node, slot, reach):
    """Let the event of margin `slot` of a node happen at (t, x), in place."""
    prog, drive, x, mode, work, dx, g = (
        lean(prog), lean(drive), lean(x), lean(mode), lean(work), lean(dx), lean(g),
    )  # fmt: skip
    rates(prog, drive, 0, t, x, mode, work, dx, g, False)
    event(prog, drive, 0, t, x, mode, work, dx, g, node, slot, HEIGHT, reach)
