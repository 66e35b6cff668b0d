"""Start values by regression of the force on the motion: for an effect and the model's own parameters together.

The refitted baseline has bent its own parameters towards the truth as far as it could; where an effect is strong
the right start lies elsewhere for all parameters at once.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..blocks import effects as library
from ..blocks.effect import Effect
from .trial import Scales
from .windows import facts


@dataclass(frozen=True)
class Motion:
    """Samples of all records: force [N], reported position [m], smoothed velocity [m/s], acceleration [m/s^2]."""

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
    """An effect with start values and the share of the residual it is expected to leave (1: explains nothing)."""

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
    s, m = screen.scales, screen.full_motion
    span = float(np.ptp(m.x))
    scored = []
    for turn in ripple_turns(m, s):
        for near in turn + np.linspace(-0.6, 0.6, 13):
            k = 2 * math.pi * max(near, 0.3) / span
            weights, left = force_regression(m, s, names, [-np.sin(k * m.x), -np.cos(k * m.x)])
            scored.append((left, k, weights))
    scored.sort(key=lambda x: x[0])
    chosen: list[float] = []
    for _, k, w in scored:
        values = _values(w, names, s)
        if values is None or any(abs(k - other) < 4 * math.pi / span for other in chosen):
            continue
        chosen.append(k)
        effect = library.PositionRipple(math.hypot(w[3], w[4]), 2 * math.pi / k, math.atan2(w[4], w[3]))
        yield Start(effect, 0.0, tuple(values.items()))
        if len(chosen) == 2:
            return


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
        mass [kg], Coulomb level [N], viscous coefficient [N s/m], then of the columns; 0 for those not in `names`.
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


def ripple_turns(m: Motion, scales: Scales, count: int = 5) -> list[float]:
    """Return the strongest periods of the force residual over position, as turns over the stroke.

    The force that motion demands minus the force given, cleaned of mass, friction and offset by least squares
    where the mass moves; its spectrum is taken over position, not time.
    """
    span = float(np.ptp(m.x))
    moving = np.abs(m.v) > 0.2 * scales.speed
    if np.count_nonzero(moving) < 100 or span == 0:
        return []
    x, v, u = m.x[moving], m.v[moving], m.u[moving]
    columns = np.column_stack(
        [m.a[moving], np.sign(v), v, np.abs(v), np.ones(len(v)), x, x * x, v * np.abs(v)]
    )
    columns = columns / (np.linalg.norm(columns, axis=0) + 1e-300)
    w, *_ = np.linalg.lstsq(columns, u, rcond=None)
    left = u - columns @ w
    # as fine as the places visited are apart, at most 4000 to the stroke
    bins = int(min(4000, max(64, span / (2 * float(np.median(np.abs(v))) * m.dt))))
    at = np.clip(((x - x.min()) / span * bins).astype(int), 0, bins - 1)
    counts = np.bincount(at, minlength=bins)
    mean = np.bincount(at, left, minlength=bins) / np.maximum(counts, 1)
    power = np.abs(np.fft.rfft(mean, 8 * bins)) ** 2
    turns = np.arange(len(power)) / 8
    # forces of nature have more power at long waves: what stands out is judged against its neighbours
    from scipy.ndimage import median_filter

    ratio = power / (median_filter(power, 201, mode="nearest") + 1e-300)
    ratio[turns < 0.5] = 0.0
    tops = []
    for _ in range(count):
        i = int(np.argmax(ratio))
        if ratio[i] == 0:
            break
        tops.append(float(turns[i]))
        ratio[max(i - 10, 0) : i + 11] = 0.0
    return tops
