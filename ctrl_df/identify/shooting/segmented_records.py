"""Records and the segments of each that count: shorter, fewer, decimated, of one output."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ..data.measurement import Measurement
from ..prediction.segments import Segments, subdivided
from ..prediction.sensed import sensed
from .thresholds import BEGINNINGS, SHORTEST_SEGMENT


@dataclass(frozen=True)
class SegmentedRecords:
    """Records and the segments of each that count."""

    records: tuple[Measurement, ...]
    segments: tuple[Segments, ...]

    def shorter(self, factor: int) -> SegmentedRecords:
        """Return up to `factor` times as many segments over the same samples, none too short."""
        pairs = zip(self.records, self.segments, strict=True)
        return SegmentedRecords(
            self.records, tuple(subdivided(r, w, factor, SHORTEST_SEGMENT) for r, w in pairs)
        )

    def beginnings(self) -> Iterator[SegmentedRecords]:
        """Yield the beginnings of the segments, shortest first, each once."""
        whole, before = [len(w.samples) for w in self.segments], [0]
        for share in BEGINNINGS:
            pairs = zip(self.shorter(share).segments, self.segments, strict=True)
            first = tuple(parts.only(np.isin(parts.first, w.first)) for parts, w in pairs)
            lengths = [len(w.samples) for w in first]
            if lengths not in (before, whole):
                before = lengths
                yield replace(self, segments=first)

    def every(self, step: int) -> SegmentedRecords:
        """Return every `step`-th segment."""
        return SegmentedRecords(
            self.records, tuple(w.only(np.arange(len(w)) % step == 0) for w in self.segments)
        )

    def decimated(self, step: int) -> SegmentedRecords:
        """Return the same segments, of which every `step`-th sample counts."""
        return replace(self, segments=tuple(w.every(step) for w in self.segments))

    @property
    def outputs(self) -> list[np.ndarray]:
        """Measured outputs within the segments, as fits see them."""
        return [sensed(r).within(w.samples) for r, w in zip(self.records, self.segments, strict=True)]

    def only(self, quantity: str) -> SegmentedRecords:
        """Return the same with one output alone, by quantity."""
        return SegmentedRecords(
            tuple(r.only(quantity) for r in self.records), tuple(replace(w, outputs=1) for w in self.segments)
        )
