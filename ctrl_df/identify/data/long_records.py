"""Long records with fewer samples, where nothing is lost by that."""

from __future__ import annotations

import logging

from . import signals
from .imposed import imposes_motion
from .measurement import Measurement
from .thresholds import CUTOFFS_KEPT, DECIMATED_BAND, LONG

_LOGGER = logging.getLogger("ctrl_df")


def shortened(record: Measurement, motion: bool = False) -> Measurement:
    """Return a record of more than `LONG` samples with fewer, where these hold all of its motion.

    Every n-th sample is taken of what a zero-phase low-pass leaves (see `Measurement.decimate`), where the
    spectra of all outputs have sunk into their noise far below the new band; the record's `note` says so.

    Parameters
    ----------
    record : Measurement
    motion : bool
        Whether its input is a motion too, whose derivatives count.
    """
    if len(record) <= LONG or not record.regular:
        return record
    recorded = [*(record.outputs or {}).values(), *([record.u] if motion or imposes_motion(record) else [])]
    highest = max(signals.automatic_cutoff(y, record.dt) for y in recorded)
    factor = min(int(DECIMATED_BAND * 0.5 / record.dt / (CUTOFFS_KEPT * highest)), -(-len(record) // LONG))
    if factor < 2:
        return record
    note = f"1 of {factor} samples, of what is below {DECIMATED_BAND * 0.5 / (factor * record.dt):.3g} Hz"
    _LOGGER.info("record %r: %s", record.name, note)
    return record.decimate(factor).noted(note)
