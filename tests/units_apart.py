"""One rig diagnosed in two systems of units, and what has to be the same."""

import functools

import pytest
import rigs
import scaled

import ctrl_df as cdf

CLOSE = 1e-6

SCALES = [(1.0, 2.0**20), (2.0**-20, 2.0**10), (2.0**20, 2.0**-20)]
"""Factors of forces and of lengths from 1e-6 to 1e6: powers of two, so that nothing rounds otherwise.

By powers of ten the last digits differ. That is seen in fits of laws with events alone, whose cost has many
minima side by side: of all effects by a stiction (6e-6 of the evidence) and a gap (9e-4, 6e-3 of its
restitution).
"""

SEEDS = {"position_ripple": 6001, "bristle": 22}  # ripple of seed 21: none that fits can follow
LENGTHS = {"hard_stop": 5000, "backlash": 1600}  # samples until stop and gap have been met often enough


def scales_of(hidden):
    """Return the factors: the sine of an angle knows no other unit of it."""
    return [(force, 1.0 if cdf.effect_library()[hidden].turns else length) for force, length in SCALES]


@functools.cache
def rig_of(hidden):
    seed, n = SEEDS.get(hidden, 21), LENGTHS.get(hidden, 1200)
    rig = rigs.draw(hidden, seed, excitation="multisine", snr_db=60, n=n)
    free = [k for k, p in rig.baseline.parameters.items() if p.free and k not in rig.known]
    return rig.baseline, rig.train[0].measurement(), rig.holdout[0].measurement(), free


def diagnosed(hidden, candidates, force=1.0, length=1.0):
    """Diagnose the rig with its forces and lengths in units so many times smaller."""
    model, train, held, free = rig_of(hidden)
    return cdf.diagnose(
        scaled.block(model, force, length), scaled.record(train, force, length),
        holdout=scaled.record(held, force, length), free=free, candidates=candidates,
    )  # fmt: skip


def alike(before, after, scale):
    """Assert that verdict, evidence and, converted, parameters are the same."""
    assert after.verdict == before.verdict
    first, second = before.ranking[0], after.ranking[0]
    assert second.evidence == pytest.approx(first.evidence, rel=CLOSE, abs=CLOSE)
    assert scaled.back(second, *scale) == pytest.approx(dict(first.parameters), rel=CLOSE)
