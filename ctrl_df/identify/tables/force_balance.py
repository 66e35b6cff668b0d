"""Start values by the balance of forces: what a block would take to follow the measured motions.

A table says how far the mass swings under each force. Near a sine, the force that imposes this swing on a
block has a first harmonic that is linear in masses, levels, coefficients and stiffnesses: least squares find
these at once, from anywhere, where errors of N itself have a resonance in between (the equation error of
Ljung, System Identification, for tables).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...simulate.imposed import harmonics, imposed_forces, sine_path
from ...simulate.imposed_response import imposable
from ..prediction.thresholds import HIDDEN_RTOL
from ..prediction.values import with_values
from ..shooting.scales import Scales
from ..thresholds import NEARLY_NOTHING
from .points import Points
from .thresholds import (
    BALANCE_GAIN,
    BALANCE_LOWEST,
    BALANCE_PERIODS,
    BALANCE_RANK,
    BALANCE_ROUNDS,
    BALANCE_SAMPLES,
    GROSS_BALANCE,
    TABLE_NUDGE,
)


def can_be_imposed(block) -> bool:
    """Whether a block answers an imposed motion with a force."""
    try:
        imposable(block)
    except (TypeError, ValueError):
        return False
    return True


class ForceBalance:
    """The measured motions as sines, imposed on blocks.

    Parameters
    ----------
    points : Points
        Those that stood still have no say.
    """

    def __init__(self, points: Points):
        moved = points.take((points.N != 0) & np.isfinite(points.N) & (points.weight > 0))
        self.weight = moved.weight
        self.applied = np.exp(-1j * np.angle(moved.N))  # over A, where the motion is a cosine
        self.amplitude = moved.A
        angle = 2 * np.pi * np.arange(BALANCE_SAMPLES * BALANCE_PERIODS + 1) / BALANCE_SAMPLES
        self.paths = [
            sine_path(x, w, angle) for x, w in zip(moved.A * np.abs(moved.N), moved.omega, strict=True)
        ]
        self._last = slice(-BALANCE_SAMPLES - 1, -1)
        self._angle = angle[self._last]

    def forces(self, blocks: Sequence) -> np.ndarray:
        """Return first harmonics of the forces over A, (blocks, points)."""
        cores = [b.core for b in blocks]
        z0 = np.zeros((len(blocks), cores[0].nstates - 2))
        forces = [imposed_forces(cores, path, z0, rtol=HIDDEN_RTOL)[0][:, self._last] for path in self.paths]
        return harmonics(np.stack(forces, axis=1), self._angle, 1)[..., 1] / self.amplitude

    def error(self, blocks: Sequence) -> np.ndarray:
        """Return the root mean square of what misses in each block's balance, over A."""
        missing = self.weight * (self.applied - self.forces(blocks))
        return np.sqrt(np.mean(np.abs(np.nan_to_num(missing, nan=1.0)) ** 2, axis=1))

    def solved(self, block, names, scales: Scales):
        """Return a block with the named parameters balanced; as it is where that does not help."""
        best = (float(self.error([block])[0]), block)
        for _ in range(BALANCE_ROUNDS):
            moved = self._step(best[1], names, scales)
            if moved is None:
                break
            size = float(self.error([moved])[0])
            done = not size < (1 - BALANCE_GAIN) * best[0]
            best = min(best, (size, moved), key=lambda pair: pair[0])
            if done:
                break
        return best[1]

    def _step(self, block, names, scales):
        """Return the block after a step of Gauss and Newton, inside its bounds."""
        table, moved, steps = block.parameters, [], []
        for name in names:
            p = table[name]
            step = TABLE_NUDGE * (abs(p.value) or scales.of(p.line_unit))
            if p.value + step > p.upper:
                step = -step
            moved.append(with_values(block, {name: p.value + step}))
            steps.append(step)
        rows = self.forces([block, *moved])
        missing = self.weight * (self.applied - rows[0])
        slopes = self.weight * (rows[1:] - rows[0]) / np.array(steps)[:, None]
        known = np.isfinite(missing) & np.isfinite(slopes).all(axis=0)
        if np.count_nonzero(known) < len(names):
            return None
        usual = np.median(np.abs(missing[known]))
        trust = 1 / np.sqrt(
            1 + (np.abs(missing[known]) / (GROSS_BALANCE * usual + NEARLY_NOTHING)) ** 2
        )  # a few err grossly
        size = np.linalg.norm(slopes[:, known], axis=1)
        size[size == 0] = 1.0
        left = (trust * slopes[:, known] / size[:, None]).T
        right = trust * missing[known]
        change, *_ = np.linalg.lstsq(
            np.concatenate([left.real, left.imag]),
            np.concatenate([right.real, right.imag]),
            rcond=BALANCE_RANK,
        )
        values = {}
        for name, delta in zip(names, change / size, strict=True):
            p = table[name]
            low, high = p.lower, p.upper
            if p.strict and low <= 0:  # it keeps its sign
                nearest = BALANCE_LOWEST * p.value
                low, high = (nearest, high) if nearest > 0 else (low, nearest)
            values[name] = float(np.clip(p.value + delta, low, high))
        try:
            return with_values(block, values)
        except ValueError:
            return None
