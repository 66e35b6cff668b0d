"""A block beside measured points: its N there, and the relative errors.

Where the block has no periodic answer or stands still, its N counts as zero.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ...blocks.core import level
from ...blocks.probing import slip
from ...thresholds import NOTHING
from .points import Points
from .thresholds import AS_DRY, RESONANT, RIGID, WORK_HIGH


def simulate_table(model, points: Points, work=None) -> np.ndarray:
    """Return N of the model at the points; NaN where it has no answer within the work allowed."""
    N = np.empty(len(points), complex)
    rigid = _rigid(model, points, RIGID[1] if work in (None, WORK_HIGH) else RIGID[0])
    for some, block in ((rigid, _without_bristles(model) if rigid.any() else model), (~rigid, model)):
        if some.any():
            N[some] = _described(block, points.A[some], points.omega[some], work or WORK_HIGH)
    return N


def _described(model, A, omega, work) -> np.ndarray:
    from ...df.describing import quiet_describing_function as describing_function
    from ...df.dispatch import method_for

    options: dict[str, Any] = dict(work) if method_for(model).takes_options else {}
    return np.asarray(describing_function(model, A, omega, **options))


def _without_bristles(model):
    return model.with_effects([e for e in model.effects if e.role != "presliding"])


def _rigid(model, points: Points, share: float) -> np.ndarray:
    """Return where the presliding of a model yields over next to nothing of the measured amplitude.

    There it is stiff and costs thousands of steps a period, and N differs from that of rigid friction by
    less than that share. Its level must be the block's dry friction and no more.
    """
    nowhere = np.zeros(len(points), bool)
    presliding = [e for e in getattr(model, "effects", ()) if e.role == "presliding"]
    if not presliding:
        return nowhere
    dry = level([e for e in model.effects if e.role == "friction" and e.side == "motor"], 0.0, 1.0, 0.0)
    if not dry > 0:
        return nowhere
    stroke, force = slip(presliding[0], dry)
    if not math.isclose(force, dry, rel_tol=AS_DRY):
        return nowhere
    return stroke < share * points.A * np.abs(points.N)


def relative_error(simulated, points: Points) -> np.ndarray:
    """Return ``(measured - simulated) / scale``, complex; a NaN of the model counts as N = 0."""
    filled = np.where(np.isfinite(simulated), simulated, 0.0)
    # a resonance on the grid must not outweigh all other points while a fit is on its way
    error = (points.N - filled) / points.scale
    size = np.abs(error)
    return np.where(size > RESONANT, RESONANT * error / np.maximum(size, NOTHING), error)
