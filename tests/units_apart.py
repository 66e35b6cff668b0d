"""One rig diagnosed in two systems of units, and what has to be the same."""

import functools

import pytest
import rigs
import scaled

import ctrl_df as cdf

# Fits of laws with events have many minima side by side: there the last digit of a number decides between
# two of them (worst seen: 8e-4 of the evidence, 7e-3 of a restitution).
CLOSE, ALIKE = 1e-6, 2e-2

SCALES = [(1.0, 2.0**20), (2.0**-20, 2.0**10), (2.0**20, 2.0**-20)]
"""Factors of forces and of lengths: powers of two, so that hardly anything rounds otherwise."""

SEEDS = {"position_ripple": 6001, "bristle": 22}  # ripple of seed 21: none that fits can follow
LENGTHS = {"hard_stop": 5000, "backlash": 1600}  # samples until stop and gap have been met often enough


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
    close = ALIKE if first.effect.nonsmooth else CLOSE
    assert second.evidence == pytest.approx(first.evidence, rel=close, abs=1e-6)
    assert scaled.back(second, *scale) == pytest.approx(dict(first.parameters), rel=close)
