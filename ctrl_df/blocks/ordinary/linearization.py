"""What a linearization of a block does not say: where a law has no slope, a warning with the remedy."""

from __future__ import annotations

import warnings
from typing import Any

import control as ct
import numpy as np

from ..core import IMPACT, Core, level
from ..primitives import PiecewiseAffine, Play, Quantizer, RateLimiter
from ..thresholds import NEAR_CREEP


def warn_of_mechanism(core: Core, effects, x0, name) -> None:
    """Warn where a mechanism has no linearization at `x0`: dry friction at rest, a closed contact."""
    x = _states(x0, core.nstates)
    if x is None:
        return
    creep = ct.config.defaults["ctrl_df.stick_velocity"]
    bent = NEAR_CREEP * creep
    for body, chain in enumerate(core.friction):
        speed = abs(float(x[2 * body + 1]))
        static = level(chain, 0.0, 1.0, 0.0) if chain else 0.0
        if static > 0 and speed <= bent and not (core.presliding is not None and body == core.driven):
            ids = ", ".join(e.id for e in effects if e.role == "friction")
            pole = static / creep / core.masses[body]
            _warn(
                f"the linearization of {name} at v = {speed:g} m/s is no property of the machine: dry "
                f"friction ({ids}, {static:g} N) jumps there, and the compliant form puts creep in its place "
                f"(a pole near -{pole:.4g} 1/s). Linearize at a speed above {bent:g} m/s, leave the "
                "friction out (without_effect), or ask describing_function for the answer at an amplitude."
            )
            break
    delta = float(x[2] - x[0]) if core.bodies == 2 else np.nan
    at = float(x[2 * core.driven])
    pressed = core.joint == IMPACT and not 0.0 < delta < core.gap
    if pressed or (core.stop is not None and not core.stop.span[0] < at < core.stop.span[1]):
        _warn(
            f"the linearization of {name} with a contact closed is that of the contact's stand-in, a spring "
            "of control.config.defaults['ctrl_df.contact_time'], on one side only. Linearize away from the "
            "contact, or ask describing_function for the answer at an amplitude."
        )


def warn_of_element(kind: str, primitive: Any, u0, eps: float) -> None:
    """Warn where an element has no slope at the input `u0`: at a jump or corner, or with memory."""
    if isinstance(primitive, Play | RateLimiter) or getattr(primitive, "hysteretic", False):
        _warn(
            f"the linearization of {kind} is that of its compliant form (time constant "
            "control.config.defaults['ctrl_df.follow_time']), not of the element, whose answer depends on "
            "its past. Ask describing_function for the answer at an amplitude."
        )
        return
    u = float(np.ravel(u0)[0]) if np.size(u0) else 0.0
    if isinstance(primitive, Quantizer):
        edge = (np.floor(u / primitive.step) + 0.5) * primitive.step
        broken = abs(u - edge) <= eps
    elif isinstance(primitive, PiecewiseAffine):
        broken = any(abs(u - corner) <= eps for corner in primitive.corners)
    else:
        broken = False
    if broken:
        _warn(
            f"{kind} has a jump or a corner at u = {u:g}, no slope: its linearization there is a difference "
            f"over eps = {eps:g}. Linearize beside the corner, or ask describing_function for the answer at "
            "an amplitude."
        )


def _states(x0, count):
    x0 = getattr(x0, "states", x0)
    try:
        x = np.atleast_1d(np.asarray(x0, dtype=float)).ravel()
    except (TypeError, ValueError):
        return None  # python-control says what is wrong with it
    if x.size == 1:
        x = np.full(count, x[0])
    return np.append(x, np.zeros(max(count - x.size, 0)))


def _warn(text):
    warnings.warn(text, UserWarning, stacklevel=5)
