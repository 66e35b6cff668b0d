"""Start values of every effect for a table N(A, omega): sizes at which it would show somewhere on the plane.

Forces, amplitudes of the motion, speeds and frequencies of a table span decades. A gap shows where it is
comparable with an amplitude, a delay where it is comparable with a period, and so on: every effect is tried
at sizes spread over the range in which it matters, and where it takes over a part of the friction that the
refitted model has, that is taken from the model.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ...blocks.core import kinetic_level
from ..estimation.common_friction import dry_level
from ..shooting.scales import Scales
from ..shooting.variables import total_inertia
from ..starting.extend import extended
from ..thresholds import NEARLY_NOTHING
from .force_balance import ForceBalance, can_be_imposed
from .points import Points
from .simulated import relative_error, simulate_table
from .thresholds import (
    BALANCED_STARTS,
    DELAYS,
    DRY_SHARES,
    GIVE_UP_START,
    START_COMMON,
    START_SAME,
    TABLE_SIZES,
    UNKNOWN_SIZES,
)


@dataclass(frozen=True)
class Span:
    """Least and largest of something over the points where the mass moved."""

    low: float
    high: float

    def over(self, count: int, below: float = 1.0, above: float = 1.0) -> list[float]:
        """Return values in even ratios from ``below * low`` to ``above * high``."""
        return np.geomspace(below * self.low, above * self.high, count).tolist()


@dataclass(frozen=True)
class Plane:
    """What a table spans: forces [N], amplitudes of the motion [m], speeds [m/s], frequencies [rad/s].

    `friction` and `mass` are the model's, `stuck` is the largest force that moved nothing, 0 where all
    points moved.
    """

    force: Span
    amplitude: Span
    speed: Span
    omega: Span
    friction: float
    mass: float
    stuck: float

    def taken_from_friction(self, make) -> Iterator:
        """Yield effects of sizes of the model's friction, and the share of it that stays."""
        for f in DRY_SHARES:
            yield make(f * self.friction if self.friction > 0 else f * self.force.low), 1.0 - f
        yield make(DRY_SHARES[0] * self.force.low), 1.0

    def in_periods(self, make) -> Iterator:
        """Yield effects of times comparable with the shortest period."""
        for f in DELAYS:
            yield make(f / self.omega.high), 1.0

    @property
    def scales(self) -> Scales:
        """Scales at which an effect of any unit shows at the largest amplitudes."""
        return Scales(self.force.high, self.amplitude.high, self.speed.high, self.mass, self.force.high)


def plane_of(block, points: Points) -> Plane:
    """Return what the points span, seen from the refitted model."""
    moved = points.N != 0
    amplitude = (points.A * np.abs(points.N))[moved]
    spans = (points.A[moved], amplitude, amplitude * points.omega[moved], points.omega[moved])
    still = points.A[~moved]
    force, amplitudes, speed, omega = (Span(float(s.min()), float(s.max())) for s in spans)
    friction, stuck = kinetic_level(block.effects), float(still.max(initial=0.0))
    return Plane(force, amplitudes, speed, omega, friction, total_inertia(block), stuck)


def _any(cls, plane: Plane):
    """Yield an effect of which nothing is known, at sizes by the units of its parameters."""
    fields = [f for f in dataclasses.fields(cls) if f.metadata.get("parameter") is not None]
    grids = {}
    for f in fields:
        spec = f.metadata["parameter"]
        if f is fields[0]:
            grids[f] = (*TABLE_SIZES, *(-m for m in TABLE_SIZES)) if spec["lower"] < 0 else TABLE_SIZES
        elif f.default is dataclasses.MISSING:
            grids[f] = UNKNOWN_SIZES
    for multiples in itertools.product(*grids.values()):
        sized = {}
        for f, multiple in zip(grids, multiples, strict=True):
            sized[f.name] = multiple * plane.scales.of(f.metadata["parameter"]["unit"])
        try:
            yield cls(**sized), 1.0
        except ValueError:
            continue


def proposals(cls, block, points: Points) -> Iterator:
    """Yield blocks grown by an effect of the class at several sizes.

    Parameters
    ----------
    cls : Effect class
    block : Mechanism
        The refitted model.
    points : Points
        Of the table.
    """
    plane, dry = plane_of(block, points), dry_level(block)
    level = None if dry is None else block.parameters[dry]
    own = cls.suggest_on_plane(plane)
    for effect, share in _any(cls, plane) if own is None else own:
        less = block
        if share < 1.0 and level is not None and level.free:
            less = block.with_parameters({dry: share * level.value})
        grown = extended(less, effect)
        if grown is not None:
            yield grown


def balanced(grown: Sequence, names: Sequence[str], points: Points, scales: Scales) -> list:
    """Return the most promising of some blocks (of one structure) with their forces balanced.

    None of blocks that answer no imposed motion.
    """
    if not grown or not can_be_imposed(grown[0]):
        return []
    balance = ForceBalance(points)
    order = np.argsort(balance.error(grown), kind="stable")[:BALANCED_STARTS]
    return [balance.solved(grown[i], names, scales) for i in order]


def best_starts(
    cls,
    block,
    points: Points,
    slopes,
    free: Sequence[str],
    scales: Scales,
    keep: int,
    work,
) -> tuple[list, bool]:
    """Return the blocks grown by the most promising starts, best first, and whether any promises anything.

    A start is ranked by what remains of its errors once the model's own parameters have moved along `slopes`
    (2 n, p), those of the weighted errors. An effect that changes no point has no signature, and no start.
    """
    q = np.linalg.qr(slopes)[0] if slopes.size else np.zeros((2 * len(points), 0))

    def left(table):
        e = points.weight * relative_error(table, points)
        e = np.concatenate([np.real(e), np.imag(e)])
        e = e - q @ (q.T @ e)
        return e[: len(points)] ** 2 + e[len(points) :] ** 2

    before = simulate_table(block, points, work)
    size = left(before)
    # a single point of another motion must not hide a good start
    common = START_COMMON * float(np.mean(size)) + NEARLY_NOTHING
    scored, unanswered = [], int(np.isnan(before).sum())
    starts = list(proposals(cls, block, points))
    table = starts[0].parameters if starts else {}
    own = [k for k, p in table.items() if k not in block.parameters and p.estimated]
    for grown in [*balanced(starts, (*free, *own), points, scales), *starts]:
        try:
            table = simulate_table(grown, points, work)
        except (ValueError, ArithmeticError):
            continue
        if not np.allclose(table, before, rtol=START_SAME, atol=0, equal_nan=True):
            # a model that runs away where the machine moved steadily comes after all that do not
            lost = int(np.isnan(table).sum()) > unanswered
            scored.append((lost, float(np.sum(np.log(left(table) + common))), len(scored), grown))
    scored.sort(key=lambda s: s[:3])
    bound = float(np.sum(np.log(size + common))) + 2 * len(points) * math.log(GIVE_UP_START)
    promising = [g for _, size, _, g in scored[:keep] if size < bound]
    return promising or [g for *_, g in scored[:1]], bool(promising)
