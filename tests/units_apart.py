"""One rig diagnosed in two systems of units, and what has to be the same."""

import functools

import numpy as np
import pytest
import rigs
import scaled
from test_imposed import BASE, GUESS
from test_imposed import record as imposed

import ctrl_df as cdf

CLOSE = 1e-6

SCALES = [(1.0, 1e6, 1.0), (1e-6, 1e3, 2.0**10), (1e6, 1e-6, 2.0**-10)]
"""Factors of forces, of lengths and of times; powers of two leave samples where they are to the last digit:
an event that comes to lie on the other side of one is another motion, and may end a fit elsewhere."""

SEEDS = {"position_ripple": 6001, "bristle": 22}  # ripple of seed 21: none that fits can follow
LENGTHS = {
    "hard_stop": 3000,
    "sensor_offset": 2000,
    **dict.fromkeys(("backlash", "hysteresis", "stiction"), 1200),
    **dict.fromkeys(("bristle", "compliance", "drift", "input_saturation", "sensor_quantization"), 500),
}  # samples until they have been met, or are told well enough; 800 else

PULLED = {"loose_linkage": cdf.LooseLinkage(5e4, 0.004), "maxwell_slip": cdf.MaxwellSlip(1e5, 30.0)}
"""Dampers on a test machine that imposes the motion."""

MOTOR = cdf.Mass(2.0, [cdf.TorqueConstant(20.0, 4.0), cdf.Coulomb(3.0), cdf.Viscous(5.0)])
"""What is driven by voltage: a spring is hidden behind it."""

OTHER = (*PULLED, "torque_constant")
"""Effects that `rigs` do not hide."""


def scales_of(hidden):
    """Return the factors: the sine of an angle knows no other unit."""
    turns = cdf.effect_library()[hidden].turns
    return [(force, 1.0 if turns else length, time) for force, length, time in SCALES]


@functools.cache
def rig_of(hidden):
    """Return the user's model, a record to fit and one held out, and the parameters that are refitted."""
    if hidden in PULLED:
        truth = BASE.with_effect(PULLED[hidden])
        return GUESS, imposed(truth, 1), imposed(truth, 2), None
    if hidden == "torque_constant":
        records = [driven(seed) for seed in (1, 2)]
        return (
            MOTOR.with_parameters({"coulomb.level": 2.5}),
            *records,
            ["coulomb.level", "viscous.coefficient"],
        )
    rig = drawn(hidden)
    free = [k for k, p in rig.baseline.parameters.items() if p.free and k not in rig.known]
    return rig.baseline, rig.train[0].measurement(), rig.holdout[0].measurement(), free


def drawn(hidden):
    """Return the rig of an effect that `rigs` hide."""
    seed, n = SEEDS.get(hidden, 21), LENGTHS.get(hidden, 800)
    return rigs.draw(hidden, seed, excitation="multisine", snr_db=60, n=n)


def driven(seed):
    """Return a record of voltage and motion of a motor against a spring."""
    rng, t = np.random.default_rng(seed), 4e-3 * np.arange(800)
    volts = 3.0 * np.sin(4.0 * t + seed) + 2.0 * np.sin(11.0 * t) + np.sin(23.0 * t)
    x, _ = np.asarray(
        cdf.event_response(MOTOR.with_effect(cdf.LinearSpring(40.0)), t, volts, input_hold="zoh").outputs
    )
    noise = 1e-3 * np.std(x) * rng.standard_normal(t.size)
    return cdf.Measurement(t, volts, x + noise, input_unit="V", output_unit="m")


def candidate(hidden):
    """Return the id of what a rig of an effect is to show: what goes into a motor is no candidate."""
    return "linear_spring" if hidden == "torque_constant" else hidden


def diagnosed(hidden, candidates, *scale):
    """Diagnose the rig with its forces, lengths and times in units so many times smaller."""
    scale = scale or (1.0, 1.0, 1.0)
    model, train, held, free = rig_of(hidden)
    return cdf.diagnose(
        scaled.block(model, *scale), scaled.record(train, *scale),
        holdout=scaled.record(held, *scale), free=free, candidates=candidates,
    )  # fmt: skip


def alike(before, after, scale):
    """Assert that verdict, evidence and, converted, parameters are the same, whatever they are called."""
    assert after.verdict == before.verdict
    for first, second in zip(before.ranking, after.ranking, strict=True):
        assert second.id.removeprefix("own_") == first.id
        assert second.evidence == pytest.approx(first.evidence, rel=CLOSE, abs=CLOSE)
        named = {k.removeprefix("own_"): v for k, v in scaled.back(second, *scale).items()}
        assert named == pytest.approx(dict(first.parameters), rel=CLOSE)
