"""Lengths of the segments of records in which a model runs freely, its state set again where each begins."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ...blocks.probing import stiffness
from ...thresholds import NOTHING
from ..data.measurement import Measurement
from ..prediction.segments import facts, make_segments, usual_segment
from ..prediction.simulators import simulator_of
from ..prediction.thresholds import USUAL_SEGMENT_LEAST
from ..thresholds import NOISE_FREE, SEGMENT_SAMPLES
from .thresholds import FIRST_PERIODS, FIRST_STROKES, SEVERAL, STAGE_FACTOR, STAGES


def segment_lengths(model, records: Sequence[Measurement], mode="auto", window=None) -> list[float | None]:
    """Return per record the length of segment [s] that `mode` means; None: the whole record.

    "auto" is the whole record where something pulls the model back, or where it is so short as to be one
    segment; else two to-and-fro motions. Of a chaotic motion it is less, until derivatives by the state where
    a segment begins tell what noise makes of it.
    """
    return [_length(simulator_of(model, record), record, mode, window) for record in records]


def _length(simulator, record: Measurement, mode: str, window: float | None) -> float | None:
    """Return the length of the segments [s] of one record; None: the whole record."""
    if mode == "free" or simulator.closed:
        return None
    if window is not None:
        return float(window)
    usual = usual_segment(record)
    if mode != "auto":
        return usual
    whole = simulator.restoring or record.duration < SEVERAL * usual
    length = None if whole else usual
    while _is_chaotic(simulator, record, length):
        length = usual if length is None else 0.5 * length
    return length


def _is_chaotic(simulator, record, length: float | None) -> bool:
    """Whether the noise of where segments begin makes more by its square than it is itself, in most of them.

    Derivatives by the initial state, on which all steps of a fit rest, then say nothing of the motion. Where
    it is chaotic (impacts between stops: di Bernardo et al. 2008) that is so after a few impacts. A linear
    machine moves as derivatives have it, stable or not.
    """
    known, segments, names = facts(record), make_segments(record, length), simulator.free_states
    if not {"x", "v"} <= set(names) or len(record) < 2 * SEGMENT_SAMPLES * len(segments):
        return False  # there is nothing to restart, or segments are as short as they may be
    share = max(known.noise / known.spread, NOISE_FREE)
    sides = [
        sign * share * np.array([[size * (name == moved) for name in names]] * len(segments))
        for moved, size in (("x", known.position), ("v", known.speed))
        for sign in (1, -1)
    ]
    y, *others = simulator.run_all([(segments, None, s) for s in (np.zeros_like(sides[0]), *sides)])
    curved = [0.5 * (up + down) - y for up, down in zip(others[::2], others[1::2], strict=True)]
    squares = np.sum([segments.means(c**2) for c in curved], axis=0)
    return float(np.median(squares)) > (share * known.spread) ** 2


def shorter_lengths(simulator, records: Sequence[Measurement], lengths) -> list[list[float | None]]:
    """Return the lengths of segments of the stages before the last, shortest first.

    Over half a stroke an error of a parameter has not grown beyond what its slope tells. An elastic joint
    rings faster than the drive turns: there a few periods of it come first, then more of them.
    """
    spans = [r.duration if n is None else n for r, n in zip(records, lengths, strict=True)]
    first = [FIRST_STROKES * facts(r).period for r in records]
    core = simulator.block.core if simulator.mechanism else None
    joint = None if core is None or core.coupling is None else core.coupling.effect
    if core is not None and joint is not None:
        stiff = stiffness(joint, simulator.facts.force)
        first = [
            min(f, FIRST_PERIODS * 2 * math.pi * math.sqrt(core.reduced_mass / max(stiff, NOTHING)))
            for f in first
        ]
    first = [max(f, USUAL_SEGMENT_LEAST * facts(r).dt) for f, r in zip(first, records, strict=True)]
    stages: list[list[float | None]] = []
    factor = 1.0
    while (
        any(SEVERAL * factor * f < span for f, span in zip(first, spans, strict=True))
        and len(stages) < STAGES
    ):
        stages.append([min(factor * f, span) for f, span in zip(first, spans, strict=True)])
        if joint is None:
            break
        factor *= STAGE_FACTOR
    return stages
