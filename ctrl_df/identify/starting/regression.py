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

from ...blocks.effect import Effect
from ..estimation.common_friction import dry_level, inertia, viscous_slope
from ..prediction.segments import facts, load_of
from ..shooting.scales import Scales
from .extend import extended
from .own_laws import Columns, allowed, own_columns
from .thresholds import DRY_LEAST, MOVING, STRONG, VISCOUS_LEAST


@dataclass(frozen=True)
class Motion:
    """Samples of all records: force u [N], place x [m], smoothed v [m/s] and a [m/s^2].

    `own`: what the laws of the model take of the force, beside its inertia and plain friction.
    """

    u: np.ndarray
    x: np.ndarray
    v: np.ndarray
    a: np.ndarray
    dt: float  # between samples of the records [s]
    own: Columns = ()


def motion_of(view, decimation: int, block) -> Motion:
    """Return every `decimation`-th sample of the segments; the force as the drive of a block makes it."""
    parts = []
    for record, segments in zip(view.records, view.segments, strict=True):
        known = facts(record)
        acceleration = np.gradient(known.velocity, record.t)
        some = segments.every(decimation).samples
        parts.append(
            [np.asarray(c)[some] for c in (load_of(block, record), known.place, known.velocity, acceleration)]
        )
    u, x, v, a = (np.concatenate(c) for c in zip(*parts, strict=True))
    return Motion(u, x, v, a, view.records[0].dt, own_columns(block, u, x, v))


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
    dry : str or None
        Name of the level of dry friction among them.
    """

    weights: tuple[float, ...]
    left: float
    friction: float
    values: dict[str, float]
    sensible: bool
    dry: str | None = None

    def with_friction(self, share: float) -> dict[str, float]:
        """Return the model's own parameters with a share of the dry friction."""
        return {k: share * v if k == self.dry else v for k, v in self.values.items()}


def regressed(cls, screen, share: float = STRONG) -> Iterator[Start]:
    """Yield the start values that a class takes from the force.

    Of two bodies the force moves both: only what acts on the load by its class may have some there, too.

    `share`: of the missing force, up to which an effect proportional to its first parameter may leave.
    """
    one = screen.block.core.bodies == 1
    found = cls.regress(screen) if one or cls.side == "load" else ()
    for effect, values in (*found, *(_strong(cls, screen, share) if one else ())):
        yield Start(effect, 0.0, tuple(values.items()))


def _strong(cls, screen, share: float) -> Iterator[tuple[Effect, dict[str, float]]]:
    """Yield an effect proportional to its first parameter that takes most of the force that is missing.

    A baseline without one so strong is bent far from the truth: a pendulum without gravity loses its inertia.
    """
    if not cls.proportional or cls.regress.__func__ is not Effect.regress.__func__:
        return
    try:
        one = cls(1.0)
    except (TypeError, ValueError):
        return
    block, motion = extended(screen.block, one), screen.motion
    if block is None:
        return
    p, most = next(iter(one.parameters.values())), share * screen.force_fit([]).left
    name = f"{block.newest}.{next(iter(one.parameters))}"
    column = dict(own_columns(block, motion.u, motion.x, motion.v)).get(name)
    if column is not None:
        fit = screen.force_fit([column])
        size, values = fit.weights[0], fit.values
    elif name in (dry_level(block), viscous_slope(block)):
        # plain friction: of a model that has it the regression is where fits begin, however much it takes
        fit, most = force_fit(motion, screen.scales, block, []), math.inf
        size, values = fit.values.get(name, 0.0), {k: v for k, v in fit.values.items() if k != name}
    else:
        return
    if fit.sensible and fit.left < most and p.lower <= size <= p.upper:
        yield cls(size), values


def force_fit(motion: Motion, scales: Scales, block, columns) -> ForceFit:
    """Regress the force on the model's own laws, and on further columns."""
    dry = dry_level(block)
    plain, own, weights, left = force_regression(motion, scales, block, columns)
    values = own_values(block, plain, scales)
    sensible = values is not None
    return ForceFit(
        tuple(map(float, weights)), left, (values or {}).get(dry or "", 0.0),
        {**values, **own} if sensible else {}, sensible, dry,
    )  # fmt: skip


def own_values(block, weights, scales: Scales) -> dict[str, float] | None:
    """Return inertia, dry level and viscous slope as regressed, by name; None where they make no sense."""
    mass, kinetic, slope = weights
    if mass <= 0 and heavy(block):
        return None
    names = (inertia(block), dry_level(block), viscous_slope(block))
    dry, viscous = DRY_LEAST * scales.force, VISCOUS_LEAST * scales.force / scales.speed
    sizes = (mass, max(kinetic, dry), max(slope, viscous))
    return {k: float(v) for k, v in zip(names, sizes, strict=True) if k is not None}


def heavy(block) -> bool:
    """Whether a block has a mass."""
    return any(mass > 0 for mass in block.core.masses)


def force_regression(motion: Motion, scales: Scales, block, extra=()):
    """Regress the force on a model's own laws and on further columns, where the mass moves.

    Returns
    -------
    plain : (3,) array
        mass [kg], Coulomb level [N], viscous coefficient [N s/m]; 0 for what the model has not.
    own : mapping of str to float
        Parameters of its other laws that are proportional to one.
    weights : array
        Of the further columns.
    left : float
        Mean squared force that remains [N^2].
    """
    moving = np.abs(motion.v) > MOVING * scales.speed
    v, force = motion.v[moving], motion.u[moving]
    matrix = np.column_stack([
        motion.a[moving] * heavy(block),
        np.sign(v) * (dry_level(block) is not None),
        v * (viscous_slope(block) is not None),
        *(column[moving] for column in extra),
        *(column[moving] for _, column in motion.own),
    ])  # fmt: skip
    size = np.linalg.norm(matrix, axis=0)
    size[size == 0] = 1.0
    weights = np.linalg.lstsq(matrix / size, force, rcond=None)[0] / size
    plain, others, own = np.split(weights, [3, len(weights) - len(motion.own)])
    left = float(np.sum((force - matrix @ weights) ** 2)) / max(len(force), 1)
    return plain, allowed(block, motion.own, own), others, left
