"""Start values for every effect of the library, read off the data where they can be.

An effect class may bring its own: a function ``suggest(screen)`` that yields effects. For the rest the main
parameter is tried from small to large.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from ...blocks import effects as library
from ...blocks.core import kinetic_level
from .attach import attach

if TYPE_CHECKING:
    from .screen import Screen


def proposals(cls, screen: Screen):
    """Return effects of one class to begin with."""
    own = getattr(cls, "suggest", None)
    if own is not None:
        return own(screen)
    maker = _MAKERS.get(cls.id)
    if maker is not None:
        return maker(screen)
    return _generic(cls, screen)


def _generic(cls, screen: Screen):
    """Yield the effect with its main parameter from small to large, others at default or typical size."""
    values, main = {}, None
    for f in dataclasses.fields(cls):
        spec = f.metadata.get("parameter")
        if spec is None:
            continue
        if main is None:
            main = (f.name, spec)
        elif f.default is dataclasses.MISSING:
            values[f.name] = screen.scales.of(spec["unit"])
    if main is None:
        yield cls()
        return
    name, spec = main
    usual = screen.scales.of(spec["unit"])
    sizes = (0.02, 0.1, 0.4) if cls.proportional else (0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0)
    signs = (1.0, -1.0) if spec["lower"] < 0 and not cls.proportional else (1.0,)
    for size, sign in itertools.product(sizes, signs):
        try:
            yield cls(**{name: sign * size * usual, **values})
        except ValueError:
            continue


def _stiction(screen):
    kinetic, force = kinetic_level(screen.block.effects), screen.scales.force
    levels = (
        {kinetic * f for f in (1.03, 1.08, 1.15, 1.3, 1.5, 1.8, 2.3, 3.0)}
        if kinetic > 0.01 * force
        else set()
    )
    return [
        library.Stiction(x) for x in sorted(levels | {0.1 * force, 0.3 * force, 0.6 * force}) if x > kinetic
    ]


def _stribeck(screen):
    kinetic, s = kinetic_level(screen.block.effects), screen.scales
    low = max(kinetic, 0.02 * s.force)
    grid = itertools.product((1.1, 1.35, 1.8, 2.4), (0.05, 0.12, 0.3, 0.8))
    return [library.Stribeck(low * a, s.speed * b) for a, b in grid]


def _bristle(screen):
    kinetic, s = kinetic_level(screen.block.effects), screen.scales
    found = []
    for bend in (0.001, 0.003, 0.01, 0.03, 0.1, 0.3):
        k = max(kinetic, 0.05 * s.force) / (bend * s.position)
        found.append(library.Bristle(k, 0.5 * math.sqrt(k * s.mass)))
    return found


def _hard_stop(screen):
    reach = float(np.max(np.abs(screen.motion.x)))
    return [library.HardStop(reach * f, e) for f in (0.999, 0.99, 0.96, 0.9) for e in (0.05, 0.5)]


def _saturation(screen):
    top = float(np.quantile(np.abs(screen.motion.u), 0.999))
    return [library.InputSaturation(top * f) for f in (0.97, 0.93, 0.87, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3)]


def _gain(screen):
    return [library.InputGain(g) for g in (0.7, 0.9, 0.97, 1.03, 1.1, 1.3)]


def _backlash(screen):
    s = screen.scales
    gaps = (0.003, 0.01, 0.03, 0.08, 0.2, 0.5)
    if screen.block.core.bodies == 2:
        return [library.Backlash(s.position * g, 0.2) for g in gaps]
    return [library.Backlash(s.position * g, 0.2, f) for g in gaps for f in (0.3, 0.6)]


def _compliance(screen):
    s = screen.scales
    shares = (0.3, 0.6) if screen.block.core.bodies == 1 else (0.5,)
    found = []
    for bend, share in itertools.product((0.003, 0.01, 0.03, 0.08, 0.2, 0.5), shares):
        k = share * s.force / (bend * s.position)
        damping = 0.12 * math.sqrt(k * share * (1 - share) * s.mass)
        found.append(library.Compliance(k, damping, share))
    return found


def _quantization(screen):
    """Find the grid to which values keep: where the mean of exp(2 pi j y / step) has modulus near one."""
    y = np.concatenate(screen.data.train.outputs)
    span = float(np.ptp(y))
    noise = math.sqrt(float(screen.residual @ screen.residual) / len(screen.residual))
    if span == 0 or noise == 0:
        return []
    # An error of the size seen belongs to a step of sqrt(12) times it; look half a decade to both sides.
    guess = math.sqrt(12) * noise
    low, high = 0.3 * guess, min(3.0 * guess, 2 * span)
    count = int(min(max((1 / low - 1 / high) * span * 6, 10), 4000))
    inverse = np.linspace(1 / high, 1 / low, count)
    some = y[:: max(1, len(y) // 4000)]
    contrast = _contrast(some, inverse)
    # Finer grids that hold this one fit as well: of all that stand out, the coarsest.
    inner = contrast[1:-1]
    tops = 1 + np.flatnonzero(
        (inner >= contrast[:-2]) & (inner >= contrast[2:]) & (inner > 0.9 * contrast.max())
    )
    at = int(tops[0]) if len(tops) else int(np.argmax(contrast))
    fine = np.linspace(inverse[max(at - 1, 0)], inverse[min(at + 1, count - 1)], 201)
    return [library.SensorQuantization(1 / fine[int(np.argmax(_contrast(some, fine)))])]


def _contrast(values, inverse) -> np.ndarray:
    """Return how well values keep to grids of the steps ``1 / inverse``, evenly spaced: 1 on the grid."""
    phases = np.exp(2j * math.pi * values * inverse[0])
    turn = np.exp(2j * math.pi * values * (inverse[1] - inverse[0]))
    found = np.empty(len(inverse))
    for i in range(len(inverse)):
        found[i] = abs(np.mean(phases))
        phases *= turn
    return found


def _ripple(screen):
    """Try long waves: sine and cosine are two small changes, fitted together.

    `WaveSearch` finds the short ones.
    """
    s = screen.scales
    span = float(np.ptp(screen.motion.x))
    turns = np.geomspace(0.6, 6.0, 20)
    amplitude = 0.01 * s.force
    total = float(screen.residual @ screen.residual)
    scored = []
    for turn in turns:
        pair = []
        for phase in (0.0, math.pi / 2):
            block = attach(screen.block, library.PositionRipple(amplitude, span / turn, phase))
            change = screen.change(block)
            if change is None:
                break
            pair.append(screen.project(change))
        if len(pair) < 2:
            continue
        matrix = np.array(pair).T
        weights, *_ = np.linalg.lstsq(matrix, screen.residual, rcond=None)
        left = screen.residual - matrix @ weights
        scored.append((float(left @ left) / total, turn, weights))
    scored.sort(key=lambda x: x[0])
    found = []
    for _, turn, weights in scored[:5]:
        size = amplitude * float(np.hypot(*weights))
        phase = math.atan2(weights[1], weights[0])
        for factor in (1.0, 0.5):
            found.append(library.PositionRipple(min(size * factor, 2 * s.force), span / turn, phase))
    return found


_MAKERS: dict[str, Callable] = {
    "stiction": _stiction,
    "stribeck": _stribeck,
    "bristle": _bristle,
    "hard_stop": _hard_stop,
    "input_saturation": _saturation,
    "input_gain": _gain,
    "backlash": _backlash,
    "compliance": _compliance,
    "sensor_quantization": _quantization,
    "position_ripple": _ripple,
}
