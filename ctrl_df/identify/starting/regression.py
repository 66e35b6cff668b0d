"""Start values by regression of the force on the motion.

An effect and the model's own parameters are sought together: the refitted baseline has bent its own
parameters towards the truth as far as it could, and where an effect is strong the right start lies elsewhere
for all of them at once.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ...blocks import effects as library
from ...blocks.effect import Effect
from ..estimation.segments import facts
from ..estimation.trial import Scales
from .ripple_spectrum import WaveSearch


@dataclass(frozen=True)
class Motion:
    """Samples of all records: force u [N], reported x [m], smoothed v [m/s] and a [m/s^2]."""

    u: np.ndarray
    x: np.ndarray
    v: np.ndarray
    a: np.ndarray
    dt: float  # between samples of the records [s]


def motion_of(view, thin: int) -> Motion:
    """Return every `thin`-th sample within the windows."""
    parts = []
    for record, windows in zip(view.records, view.windows, strict=True):
        velocity = facts(record).velocity
        acceleration = np.gradient(velocity, record.t)
        some = windows.samples[::thin]
        parts.append([np.asarray(c)[some] for c in (record.u, record.y, velocity, acceleration)])
    return Motion(*(np.concatenate(c) for c in zip(*parts, strict=True)), dt=view.records[0].dt)


@dataclass(frozen=True)
class Start:
    """An effect with start values, and the share of the residual it should leave (1: explains nothing)."""

    effect: Effect
    left: float
    values: tuple[tuple[str, float], ...] = ()  # baseline parameters that go with it


def regressed(cls, screen) -> Iterator[Start]:
    """Yield start values for effects of a shape that enters the force linearly: Stribeck friction, ripple."""
    block = screen.block
    names = {"mass", "coulomb.level", "viscous.coefficient"} & set(block.parameters)
    if "mass" not in names or block.core.bodies > 1:
        return
    if cls is library.Stribeck:
        yield from _stribeck(screen, names)
    elif cls is library.PositionRipple:
        yield from _ripple(screen, names)


def _stribeck(screen, names):
    s, m = screen.scales, screen.motion
    scored = []
    for speed in s.speed * np.array([0.04, 0.08, 0.15, 0.3, 0.6]):
        weights, left = force_regression(m, s, names, [np.sign(m.v) * np.exp(-np.square(m.v / speed))])
        scored.append((left, speed, weights))
    _, speed, w = min(scored, key=lambda x: x[0])
    values = _values(w, names, s)
    if values is None or w[3] <= 0:
        return
    kinetic = values.get("coulomb.level", 0.0)
    yield Start(library.Stribeck(kinetic + w[3], speed), 0.0, tuple(values.items()))


def _ripple(screen, names):
    view, _ = screen.data.whole or (screen.view, None)
    if not all(r.regular for r in view.records):
        return
    ripples = [e for e in screen.block.effects if e.id == "position_ripple"]
    search = WaveSearch(view.records, view.windows, [2 * math.pi / e.wavelength for e in ripples])
    # where friction wanders the fit over windows knows the mass better than whitened forces do
    plain = all(e.id in ("coulomb", "viscous", "constant_force") for e in screen.block.effects)
    plain = plain and not screen.data.forced
    for wave in search.best(3):
        weights = (wave.mass, wave.coulomb, wave.viscous)
        values = (_values(weights, names, screen.scales) if plain else None) or {}
        effect = library.PositionRipple(wave.amplitude, wave.wavelength, wave.phase)
        yield Start(effect, 0.0, tuple(values.items()))


def _values(weights, names, s):
    """Return the model's own parameters as regressed; None where they make no sense."""
    mass, kinetic, viscous = weights[:3]
    if mass <= 0:
        return None
    values = {
        "mass": mass,
        "coulomb.level": max(kinetic, 0.01 * s.force),
        "viscous.coefficient": max(viscous, 1e-3 * s.force / s.speed),
    }
    return {k: float(v) for k, v in values.items() if k in names}


def force_regression(motion: Motion, scales: Scales, names, extra=()):
    """Regress the force on acceleration, direction, speed and further columns where the mass moves.

    Returns
    -------
    weights : array
        mass [kg], Coulomb level [N], viscous coefficient [N s/m], then of the columns; 0 for those not in
        `names`.
    left : float
        Mean squared force that remains [N^2].
    """
    moving = np.abs(motion.v) > 0.03 * scales.speed
    v, force = motion.v[moving], motion.u[moving]
    matrix = np.column_stack([
        motion.a[moving],
        np.sign(v) * ("coulomb.level" in names),
        v * ("viscous.coefficient" in names),
        *(column[moving] for column in extra),
    ])  # fmt: skip
    size = np.linalg.norm(matrix, axis=0)
    size[size == 0] = 1.0
    weights = np.linalg.lstsq(matrix / size, force, rcond=None)[0] / size
    return weights, float(np.mean((force - matrix @ weights) ** 2))
