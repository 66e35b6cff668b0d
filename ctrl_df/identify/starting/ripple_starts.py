"""Ripples with which fits begin: long waves by what they change in the output, all others by the motion."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from itertools import chain
from weakref import WeakKeyDictionary, ref

import numpy as np

from ...blocks.effect import Effect
from ...values.per_record import PerRecord
from ..data.measurement import Measurement
from ..prediction.segments import facts
from .extend import extended
from .regression import own_values
from .ripple_spectrum import ImposedSpectrum, RippleSpectrum, Wave, apart, intervals_of
from .thresholds import (
    LONG_WAVE_TURNS,
    LONG_WAVES,
    RIPPLE_LONGEST,
    RIPPLE_STEP,
    RIPPLES,
    WAVE_TRIED,
    WAVES_AT_ONCE,
)

_FOUND: WeakKeyDictionary[Measurement, dict[tuple, list[Wave]]] = WeakKeyDictionary()  # by the first record


def long_waves(screen, make: Callable[..., Effect]) -> Iterator[Effect]:
    """Yield the long waves that explain most of the residual, and half of each.

    Sine and cosine are two small changes, fitted together. What the motion shows (`waves`) is that of one
    body whose friction is plain; a model that runs may have any other.

    Parameters
    ----------
    screen : Screen
    make : callable
        ``make(amplitude, wavelength, phase)``, the effect.
    """
    span = float(np.ptp(screen.motion.x))
    turns = np.arange(RIPPLE_LONGEST, LONG_WAVE_TURNS, RIPPLE_STEP)
    parts = (turns[i : i + WAVES_AT_ONCE] for i in range(0, len(turns), WAVES_AT_ONCE))
    tried = chain.from_iterable(waves_of(screen, make, (span / part).tolist()) for part in parts)
    found = {turn: wave for turn, wave in zip(turns, tried, strict=True) if wave is not None}
    best = []
    for turn in sorted(found, key=lambda turn: found[turn][0]):
        # nearer than a turn it is the same wave
        if len(best) < LONG_WAVES and all(abs(turn - b) > 1.0 for b in best):
            best.append(turn)
    for turn in best:
        _, amplitude, phase = found[turn]
        for factor in (1.0, 0.5):
            yield make(min(amplitude * factor, 2 * screen.scales.force), span / turn, phase)


def long_wave(screen, make: Callable, wavelength: float) -> tuple[float, float, float] | None:
    """Return what a wave of this length leaves of the residual (its square), its amplitude and phase.

    Of several records each has a phase of its own where the effect says so. None where it cannot be
    simulated.
    """
    return waves_of(screen, make, [wavelength])[0]


def waves_of(screen, make: Callable, lengths: Sequence[float]) -> list[tuple[float, float, float] | None]:
    """Do what `long_wave` does for several wavelengths, in one call."""
    size, phases = WAVE_TRIED * screen.scales.force, (0.0, math.pi / 2)
    effects = [make(size, length, phase) for length in lengths for phase in phases]
    blocks = [extended(screen.block, effect) for effect in effects]
    if any(block is None for block in blocks):
        return [None] * len(lengths)
    own = any(p.per_record for p in effects[0].parameters.values())
    changes = screen.changes(blocks)
    return [_wave(screen, pair, size, own) for pair in zip(changes[::2], changes[1::2], strict=True)]


def _wave(screen, changes, size: float, own: bool) -> tuple[float, float, float] | None:
    """Return the same of one wavelength, from the changes of two waves a quarter of a turn apart.

    `size`: their amplitude; `own`: whether every record has a phase of its own.
    """
    pair = []
    for change in changes:
        if change is None:
            return None
        each = apart(change, range(len(change)), len(change)) if own else [change]
        pair.append([screen.project(c) for c in each])
    matrix = np.array([column for columns in zip(*pair, strict=True) for column in columns]).T
    w, *_ = np.linalg.lstsq(matrix, screen.residual, rcond=None)
    left = float(np.sum((screen.residual - matrix @ w) ** 2))
    each = w.reshape(-1, 2)
    phase = PerRecord.angles([r.name for r in screen.view.records], [math.atan2(b, a) for a, b in each])
    return left, size * float(np.mean(np.hypot(*each.T))), phase


def waves(screen, reversing: bool) -> Iterator[tuple[Wave, dict[str, float]]]:
    """Yield the waves of any length that explain most, and values of the model's parameters beside them.

    Those that the model has already are taken out first. `reversing`: whether waves of friction are sought.
    """
    view, _ = screen.data.whole or (screen.view, None)
    if not all(r.regular for r in view.records):
        return
    has = [(2 * math.pi / s, e.role == "friction") for e in screen.block.effects for s in e.periods()]
    elastic = screen.block.core.position_dependent
    imposed = all(facts(r).imposed for r in view.records)
    spectrum = ImposedSpectrum if imposed else RippleSpectrum
    # where friction drifts the fit over segments knows the mass better than whitened forces do
    plain = all(map(_linear, screen.block.effects)) and not screen.data.disturbed
    for wave in _found(spectrum, view, has, elastic, reversing):
        weights = (wave.mass, wave.coulomb, wave.viscous)
        yield wave, (own_values(screen.block, weights, screen.scales) if plain else None) or {}


def _found(
    spectrum: type[RippleSpectrum], view, has: Sequence[tuple[float, bool]], *about: bool
) -> list[Wave]:
    """Return the waves that explain most of the motion recorded, whatever the model; they are kept.

    All screens over the same samples have them in common, however these are cut into segments.
    """
    first, *others = view.records
    pairs = zip(view.segments, view.records, strict=True)
    covered = tuple(intervals_of(w, len(r)).tobytes() for w, r in pairs)
    key = spectrum, *map(ref, others), covered, tuple(has), *about
    known = _FOUND.setdefault(first, {})
    if key not in known:
        known[key] = spectrum(view.records, view.segments, has, *about).best(RIPPLES)
    return known[key]


def _linear(effect) -> bool:
    """Whether a law is linear in what a regression of the force may take for it: direction, speed, one."""
    placed = effect.role == "friction" or (effect.role == "force" and effect.place_free)
    return placed and effect.affine and effect.proportional and effect.rank == 0
