"""Units are a matter of writing: others alter neither verdict nor evidence nor, converted, parameters."""

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

FAST = ("linear_spring",)
OTHERS = ("quadratic_drag", "asymmetric_coulomb")
SEEDS = {"position_ripple": 6001}  # of seed 21 it is none that fits can follow


@functools.cache
def rig_of(hidden):
    rig = rigs.draw(hidden, SEEDS.get(hidden, 21), excitation="multisine", snr_db=60, n=2500)
    free = [k for k, p in rig.baseline.parameters.items() if p.free and k not in rig.known]
    return rig.baseline, rig.train[0].measurement(), rig.holdout[0].measurement(), free


@functools.cache
def diagnosed(hidden, force=1.0, length=1.0):
    model, train, held, free = rig_of(hidden)
    return cdf.diagnose(
        scaled.block(model, force, length), scaled.record(train, force, length),
        holdout=scaled.record(held, force, length), free=free,
        candidates=(hidden, *OTHERS) if hidden in FAST else (hidden,),
    )  # fmt: skip


# the sine of an angle knows no other unit of it
LINEAR = [e for e in rigs.ORDER if not cdf.effect_library()[e].turns]
KINDS = [e for e in LINEAR if e not in OTHERS]
# all scales of the fast ones; the others take turns
CASES = [(e, s) for e in FAST for s in SCALES]
CASES += [(e, SCALES[i % len(SCALES)]) for i, e in enumerate(KINDS) if e not in FAST]


@pytest.mark.parametrize(
    ("hidden", "scale"),
    [pytest.param(e, s, marks=pytest.mark.quick if e in FAST else pytest.mark.slow) for e, s in CASES],
)
def test_other_units_alter_nothing(hidden, scale):
    before, after = diagnosed(hidden), diagnosed(hidden, *scale)
    assert after.verdict == before.verdict
    assert [c.id for c in after.ranking] == [c.id for c in before.ranking]
    first, second = before.ranking[0], after.ranking[0]
    close = ALIKE if first.effect.nonsmooth else CLOSE
    assert second.evidence == pytest.approx(first.evidence, rel=close, abs=1e-6)
    assert scaled.back(second, *scale) == pytest.approx(dict(first.parameters), rel=close)
