"""What laws tell when they are asked: how far they bend, what they come to, where they repeat.

An effect states its law; what else a fit should know of it follows from that, whatever its parameters are
called. Laws are called here as plain functions of floats.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from ..thresholds import NOTHING, ROUNDED, SQRT_EPS
from ..units import dimension
from .thresholds import (
    LONGER,
    LONGER_SETTLED,
    NEARER,
    PLACE_REPEATS,
    PLACES,
    PROBED_POWERS,
    REST,
    REST_STEPS,
    SHORT_TIME,
    SLIDES_ALIKE,
    SLIPS,
    SPEEDS,
    VARIES,
    ZERO_SIZE,
)

# --- joints -----------------------------------------------------------------------------------------------


def deflection(joint, pull) -> np.ndarray:
    """Return how far a joint is bent by forces at rest [m], its internal states settled; signed.

    Zero where it has no stiffness at all. A pull beyond what the joint can carry bends it as far as nine
    tenths of that.

    Parameters
    ----------
    joint : Effect
        Of role ``coupling``.
    pull : array
        Forces on the load [N].
    """
    pull, slope = np.asarray(pull, float), _slope(joint)
    if slope is not None:
        preload = _force_at(joint, 0.0)
        return (pull - preload) / slope if slope > 0 else np.zeros_like(pull)
    return np.array([_bent(joint, p) for p in pull.ravel().tolist()]).reshape(pull.shape)


def stiffness(joint, pull: float) -> float:
    """Return the stiffness of a joint [N/m], secant up to this force [N]; zero where it has none."""
    slope = _slope(joint)
    if slope is not None:
        return max(slope, 0.0)
    bent = abs(float(deflection(joint, pull)))
    return abs(_force_at(joint, bent) - _force_at(joint, 0.0)) / bent if bent > 0 else 0.0


def states_at(joint, bent: float) -> tuple[float, ...]:
    """Return what the internal states of a joint come to where it stays bent so far [m]."""
    law, p = type(joint).law, joint.values
    return _relaxed(lambda z, dz: law(0.0, bent, 0.0, z, p, dz), joint.states) or (0.0,) * joint.states


def _slope(joint) -> float | None:
    """Return the stiffness of an affine law; None of any other."""
    if not joint.affine or joint.states:
        return None
    return _force_at(joint, 1.0) - _force_at(joint, 0.0)


def _force_at(joint, bent: float) -> float:
    z = list(states_at(joint, bent)) if joint.states else [0.0]
    return _tried(lambda: type(joint).law(0.0, bent, 0.0, z, joint.values, [0.0] * len(z)))


def _bent(joint, pull: float) -> float:
    from scipy.optimize import brentq

    preload = _force_at(joint, 0.0)
    need, side = abs(pull - preload), math.copysign(1.0, pull - preload)
    if not need > 0:
        return 0.0

    def carried(bent):
        return side * (_force_at(joint, side * bent) - preload)

    # as far as a linear law would go: a joint that softens goes further, one that hardens less far
    bent = 2.0**-PROBED_POWERS
    first = carried(bent)
    far = need / first * bent if first > 0 else 1.0
    best = carried(far)
    while best < need and far < 2.0**PROBED_POWERS:
        more = carried(2.0 * far)
        if not more > best:
            if best > 0:
                break
            more = best
        far, best = 2.0 * far, more
    if not best > 0:
        return 0.0
    if best < need:  # it slips
        need = SLIPS * best
    near = far / NEARER
    while carried(near) >= need and near > bent:
        near, far = near / NEARER, near
    if carried(far) == need:
        return side * far
    root: Any = brentq(lambda bent: carried(bent) - need, near, far, xtol=NOTHING)
    return side * float(root)


# --- internal states --------------------------------------------------------------------------------------


def sliding(effect, level: float) -> tuple[float, ...]:
    """Return what internal states come to in motion along +x, under a dry friction of `level` [N].

    Zeros where they come to nothing, or to what depends on the speed.
    """
    return _sliding(type(effect), effect.values, level)


@functools.lru_cache(maxsize=4096)
def _sliding(cls, p, level):
    nothing = (0.0,) * cls.states
    if cls.role not in ("presliding", "force"):
        return nothing

    def at(v):
        def law(z, dz):
            arguments = (v, level) if cls.role == "presliding" else (0.0, 0.0, v)
            return cls.law(*arguments, z, p, dz)

        return law

    slow, fast = (_relaxed(at(v), cls.states) for v in SPEEDS)
    if slow is None or fast is None:
        return nothing
    alike = all(math.isclose(a, b, rel_tol=SLIDES_ALIKE) for a, b in zip(slow, fast, strict=True))
    return slow if alike else nothing


def slip(effect, level: float) -> tuple[float, float]:
    """Return the stroke over which presliding gives way [m], and the force it carries from there on [N].

    `level`: of the block's dry friction [N], > 0.
    """
    settled = effect.steady(level)
    law, p, rates = type(effect).law, effect.values, [0.0] * effect.states
    _tried(lambda: law(1.0, level, [0.0] * effect.states, p, rates))
    stroke = max((abs(z / rate) for z, rate in zip(settled, rates, strict=True) if rate), default=0.0)
    return stroke, -_tried(lambda: law(1.0, level, list(settled), p, [0.0] * effect.states))


def _relaxed(law: Callable[[list, list], Any], count: int) -> tuple[float, ...] | None:
    """Return where states come to rest from zero; None if nowhere."""
    if not count:
        return ()

    def rates(z):
        dz = [0.0] * count
        try:
            law(z.tolist(), dz)
        except (ArithmeticError, ValueError):
            return np.full(count, np.nan)
        return np.array(dz, float)

    z = _by_newton(rates, count)
    z = _by_euler(rates, count) if z is None else z
    return None if z is None else tuple(z.tolist())


def _by_newton(rates, count) -> np.ndarray | None:
    """Return where rates vanish if Newton's method finds that at once, as it does where they are linear."""
    z = np.zeros(count)
    begin = f = rates(z)
    for _ in range(REST_STEPS):
        if not f.any():
            return z
        change = _step(rates, z, f, ZERO_SIZE, math.inf)
        if change is None:
            return None
        z = z + change
        f = rates(z)
        if not np.all(np.isfinite(f)):
            return None
    return z if np.all(np.abs(f) <= ROUNDED * np.max(np.abs(begin))) else None


def _by_euler(rates, count) -> np.ndarray | None:
    """Return where states come to rest: implicit Euler in steps that grow, Newton's method in the end."""
    z, last = np.zeros(count), False
    step = 2.0 ** _quick(rates, rates(z))
    while step < 2.0**REST:
        f = rates(z)
        if not f.any():
            return z
        change = _step(rates, z, f, step * float(np.max(np.abs(f))), step)
        if change is None:
            return None
        z = z + change
        small = bool(np.all(np.abs(change) <= ROUNDED * np.abs(z)))
        if small and last:
            return z
        # small changes of small steps tell nothing: a step more, many times as long
        last, step = small, step * (LONGER_SETTLED if small else LONGER)
    return None


def _step(rates, z, f, size, time) -> np.ndarray | None:
    """Return the change of states over a time, linearized; None where there is none. `size`: of a zero."""
    count = len(z)
    slopes = np.empty((count, count))
    for j in range(count):
        moved = z.copy()
        moved[j] += SQRT_EPS * (abs(z[j]) or size)
        slopes[:, j] = (rates(moved) - f) / (moved[j] - z[j])
    try:
        change = np.linalg.solve(np.eye(count) / time - slopes, f)
    except np.linalg.LinAlgError:
        return None
    return change if np.all(np.isfinite(change)) else None


def _quick(rates, first) -> int:
    """Return the power of two of a time that is short for the states: rates hardly change within it."""
    low, high = -PROBED_POWERS, PROBED_POWERS
    if not np.all(np.isfinite(first)) or not first.any():
        return low
    size = np.max(np.abs(first))
    while high - low > 1:
        middle = (low + high) // 2
        changed = rates(2.0**middle * first) - first
        if np.all(np.isfinite(changed)) and np.max(np.abs(changed)) < SHORT_TIME * size:
            low = middle
        else:
            high = middle
    return low


# --- places -----------------------------------------------------------------------------------------------


def periods(effect) -> tuple[float, ...]:
    """Return those parameters that are lengths over which the law repeats from place to place [m]."""
    placed = effect.role == "force" and not effect.place_free
    if not placed and not (effect.role == "friction" and "x" in effect.asks):
        return ()
    lengths = {p.value for p in effect.parameters.values() if dimension(p.unit) == {"m": 1} and p.value > 0}
    return tuple(sorted(length for length in lengths if _repeats(effect, float(length))))


def _repeats(effect, length: float) -> bool:
    here, there = (
        np.array([[f(x + shift) for x in (length * share for share in PLACES)] for f in _over_place(effect)])
        for shift in (0.0, length)
    )
    size = np.max(np.abs(here), axis=1)
    if not np.all(np.isfinite(here)) or not np.all(np.isfinite(there)):
        return False
    moved = np.max(np.abs(there - here), axis=1)
    return bool(np.all(moved <= PLACE_REPEATS * size) and np.any(np.ptp(here, axis=1) > VARIES * size))


def _over_place(effect) -> list[Callable[[float], float]]:
    """Return a law over place: of a force at rest and in motion, of friction alone and beside another."""
    law, p = type(effect).law, effect.values
    if effect.role == "friction":
        return [
            lambda x, base=base: _tried(lambda: law(1.0, 1.0, 1.0, base, p, x, 0.0, 0.0))
            for base in (0.0, 1.0)
        ]
    none = [0.0] * max(effect.states, 1)
    return [lambda x, v=v: _tried(lambda: law(0.0, x, v, list(none), p, list(none))) for v in (0.0, 1.0)]


def _tried(call: Callable[[], float]) -> float:
    """Return what a law answers; NaN where it has no answer."""
    try:
        return float(call())
    except (ArithmeticError, ValueError):
        return math.nan
