"""Start values by regression of the force on the motion.

An effect and the model's own parameters are sought together: the refitted baseline has bent its own
parameters towards the truth as far as it could, and where an effect is strong the right start lies elsewhere
for all of them at once.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ...blocks.effect import Effect
from ..estimation.common_friction import dry_level, inertia, viscous_slope
from ..estimation.segmented import Scales
from ..estimation.segments import facts, load_of


@dataclass(frozen=True)
class Motion:
    """Samples of all records: force u [N], place x [m], smoothed v [m/s] and a [m/s^2]."""

    u: np.ndarray
    x: np.ndarray
    v: np.ndarray
    a: np.ndarray
    dt: float  # between samples of the records [s]


def motion_of(view, thin: int, block) -> Motion:
    """Return every `thin`-th sample of the segments; the force as the drive of a block makes it."""
    parts = []
    for record, segments in zip(view.records, view.segments, strict=True):
        known = facts(record)
        acceleration = np.gradient(known.velocity, record.t)
        some = segments.every(thin).samples
        parts.append(
            [np.asarray(c)[some] for c in (load_of(block, record), known.place, known.velocity, acceleration)]
        )
    return Motion(*(np.concatenate(c) for c in zip(*parts, strict=True)), dt=view.records[0].dt)


@dataclass(frozen=True)
class Start:
    """An effect with start values, and the share of the residual it should leave (1: explains nothing)."""

    effect: Effect
    left: float
    values: tuple[tuple[str, float], ...] = ()  # baseline parameters that go with it


@dataclass(frozen=True)
class ForceFit:
    """The force regressed on the motion and on further columns.

    Attributes
    ----------
    weights : tuple of float
        Of the further columns.
    left : float
        Mean squared force that remains [N^2].
    friction : float
        Level of plain dry friction [N], 0 where the model has none.
    values : dict
        The model's own parameters; empty where they make no sense.
    sensible : bool
        Whether they do.
    """

    weights: tuple[float, ...]
    left: float
    friction: float
    values: dict[str, float]
    sensible: bool


def regressed(cls, screen) -> Iterator[Start]:
    """Yield the start values that a class takes from the force; only a single body makes them possible."""
    if screen.block.core.bodies == 1:
        for effect, values in cls.regress(screen):
            yield Start(effect, 0.0, tuple(values.items()))


def force_fit(motion: Motion, scales: Scales, block, columns) -> ForceFit:
    """Regress the force on the model's own inertia and friction, and on further columns."""
    dry, viscous = dry_level(block), viscous_slope(block)
    weights, left = force_regression(
        motion, scales, columns, heavy=heavy(block), dry=dry is not None, viscous=viscous is not None
    )
    values = own_values(block, weights[:3], scales)
    return ForceFit(
        tuple(map(float, weights[3:])), left, (values or {}).get(dry or "", 0.0), values or {},
        values is not None,
    )  # fmt: skip


def own_values(block, weights, scales: Scales) -> dict[str, float] | None:
    """Return inertia, dry level and viscous slope as regressed, by name; None where they make no sense."""
    mass, kinetic, slope = weights
    if mass <= 0 and heavy(block):
        return None
    names = (inertia(block), dry_level(block), viscous_slope(block))
    sizes = (mass, max(kinetic, 0.01 * scales.force), max(slope, 1e-3 * scales.force / scales.speed))
    return {k: float(v) for k, v in zip(names, sizes, strict=True) if k is not None}


def heavy(block) -> bool:
    """Whether a block has a mass."""
    return any(mass > 0 for mass in block.core.masses)


def force_regression(motion: Motion, scales: Scales, extra=(), *, heavy=True, dry=True, viscous=True):
    """Regress the force on acceleration, direction, speed and further columns where the mass moves.

    Returns
    -------
    weights : array
        mass [kg], Coulomb level [N], viscous coefficient [N s/m], then of the columns; 0 for a mass
        (`heavy`), a `dry` level or `viscous` friction that is left out.
    left : float
        Mean squared force that remains [N^2].
    """
    moving = np.abs(motion.v) > 0.03 * scales.speed
    v, force = motion.v[moving], motion.u[moving]
    matrix = np.column_stack([
        motion.a[moving] * heavy,
        np.sign(v) * dry,
        v * viscous,
        *(column[moving] for column in extra),
    ])  # fmt: skip
    size = np.linalg.norm(matrix, axis=0)
    size[size == 0] = 1.0
    weights = np.linalg.lstsq(matrix / size, force, rcond=None)[0] / size
    return weights, float(np.mean((force - matrix @ weights) ** 2))
