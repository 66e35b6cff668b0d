"""Dead times between force and motion, by regression of the force as it was earlier, or will be later."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ..estimation.segmented import SegmentedData
from ..prediction.segments import facts, load_of
from .regression import ForceFit, Motion, force_fit, motion_of
from .thresholds import DEAD_TIME_LONGEST, DEAD_TIME_STEP, DEAD_TIMES, STRONG


def dead_times(data: SegmentedData, block) -> Iterator[tuple[float, dict[str, float]]]:
    """Yield the dead time [s] that leaves least of the force, where it is a strong one.

    With values of the model's own parameters beside: without the dead time they are bent far from the truth.
    """
    delay, best, without = _best(data, block, 1.0)
    if best.sensible and best.left < STRONG * without.left:
        yield delay, best.values


def lead(data: SegmentedData, block) -> float:
    """Return the time [s] by which motion runs ahead of a force that would explain it; 0 where none does.

    No machine does that: the clocks of two recorders differ.
    """
    if block.core.bodies != 1:
        return 0.0
    delay, best, without = _best(data, block, -1.0)
    _, behind, _ = _best(data, block, 1.0)
    explains = best.sensible and best.left < STRONG * min(without.left, behind.left)
    return -delay if explains else 0.0


def _best(data: SegmentedData, block, sign: float) -> tuple[float, ForceFit, ForceFit]:
    """Return the delay of this sign that leaves least of the force, its regression, and that without one."""
    records, motion = data.train.records, motion_of(data.train, data.decimation, block)
    longest = DEAD_TIME_LONGEST * min(r.duration for r in records)
    step = DEAD_TIME_STEP * min(facts(r).half * facts(r).dt for r in records)
    delays = np.arange(DEAD_TIMES) * step
    parts = []
    for record, segments in zip(records, data.train.segments, strict=True):
        t = record.t[segments.every(data.decimation).samples]
        parts.append((record.t, load_of(block, record), t))
    # all over the same samples: those whose force the record has, whatever the delay
    aside = [t - r[0] if sign > 0 else r[-1] - t for r, _, t in parts]
    inside = np.concatenate(aside) >= longest

    def regressed(delay: float) -> ForceFit:
        u = np.concatenate([np.interp(t - sign * delay, r, u) for r, u, t in parts])
        return force_fit(_only(replace(motion, u=u), inside), data.scales, block, [])

    fits = [regressed(float(d)) for d in delays[delays <= longest]]
    at = int(np.argmin([f.left for f in fits]))
    return sign * float(delays[at]), fits[at], fits[0]


def _only(motion: Motion, inside) -> Motion:
    u, x, v, a = (c[inside] for c in (motion.u, motion.x, motion.v, motion.a))
    return replace(motion, u=u, x=x, v=v, a=a, own=tuple((n, c[inside]) for n, c in motion.own))
