"""Ripples much shorter than the stroke: found in the motion as measured, known elsewhere by another phase."""

import math

import numpy as np
import pytest

import ctrl_df as cdf
from ctrl_df.identify.estimation.segmented import prepare
from ctrl_df.identify.prediction.segments import equal_segments, facts
from ctrl_df.identify.starting.ripple_spectrum import RippleSpectrum
from ctrl_df.identify.starting.screen import Screen

MASS, DRY, VISCOUS, DT = 5.0, 0.5, 20.0, 1e-3


def drive(seed, amplitude, wavelength, phase, noise, seconds=6.0):
    """Return a run of a mass with friction and ripple, by steps of a tenth of a sample; force held."""
    rng = np.random.default_rng(seed)
    t, u = np.arange(round(seconds / DT)) * DT, np.zeros(round(seconds / DT))
    tones = zip(rng.uniform(1.0, 6.0, 3), rng.uniform(0, 7, 3), strict=True)
    for w, p in tones:
        u += 8.0 * np.sin(w * t + p)
    x, v, k, h, places = 0.0, 0.0, 2 * math.pi / wavelength, DT / 10, []
    for force in u.tolist():
        places.append(x)
        for _ in range(10):
            dry = DRY * math.tanh(v / 1e-3)
            v += h / MASS * (force - dry - VISCOUS * v + amplitude * math.sin(k * x + phase))
            x += h * v
    return cdf.Measurement(t, u, np.array(places) + noise * rng.standard_normal(len(t)))


@pytest.mark.parametrize("seed", [1, 4, 5, 8])
def test_short_waves(seed):
    """Forty wavelengths and more a second, under noise of a thirtieth of one."""
    rng = np.random.default_rng(seed)
    wavelength, phase = rng.uniform(4e-3, 9e-3), rng.uniform(-3, 3)
    run = drive(seed, 4.0, wavelength, phase, wavelength / 30)
    assert np.max(np.abs(facts(run).velocity)) > 40 * wavelength
    first, second = RippleSpectrum([run], [equal_segments(run, 8)]).best(2)
    # measured at worst 1.3e-3, 3.6 %, 0.03 rad, 2.4e-3; the second best explains 23 nats less or fewer
    assert first.wavelength == pytest.approx(wavelength, rel=5e-3)
    assert first.amplitude == pytest.approx(4.0, rel=0.12)
    assert abs(math.remainder(first.phase - phase, 2 * math.pi)) < 0.1
    assert first.mass == pytest.approx(MASS, rel=0.01)
    assert first.gain > second.gain + 10


def test_beside_a_spring_that_the_model_has():
    """A slow axis held stiffly: without the spring, which hides it, its mass came out below nothing."""
    t = np.arange(4000) * 2e-3
    x, v, h, k, places, forces = 0.0, 0.0, 2e-4, 2 * math.pi / 0.032, [], []
    for wanted in (0.15 * np.sin(0.4 * math.pi * t)).tolist():
        places.append(x)
        forces.append(2e4 * (wanted - x) - 400 * v)
        for _ in range(10):
            pull = forces[-1] - 1.4 * math.sin(k * x + 1) - 60 * x
            free = v + h / MASS * (pull - VISCOUS * v)
            v = math.copysign(max(abs(free) - h / MASS * 5.0, 0.0), free)
            x += h * v
    noise = 1e-6 * np.random.default_rng(0).standard_normal(t.size)
    run = cdf.Measurement(t, np.array(forces), np.array(places) + noise)
    plain, beside = (
        RippleSpectrum([run], [equal_segments(run, 4)], elastic=e).best(1) for e in (False, True)
    )
    assert not plain or abs(plain[0].wavelength - 0.032) > 0.01
    # measured 5.08 kg, 0.03194 m, 1.39 N
    assert beside[0].wavelength == pytest.approx(0.032, rel=5e-3)
    assert beside[0].amplitude == pytest.approx(1.4, rel=0.1)
    assert beside[0].mass == pytest.approx(MASS, rel=0.05)


@pytest.mark.parametrize("known", ["position_ripple", "position_dependent_friction"])
def test_beside_another_wave(known):
    """A ripple hides friction that differs over ten of its waves, until it is taken for one of force."""
    ripple = cdf.PositionRipple(3.0, wavelength=0.03, phase=1.1)
    friction = cdf.PositionDependentFriction(0.6, wavelength=0.31, phase=0.7)
    plain, t = cdf.friction_mass(4.6, 6.0, 12.0), np.arange(0, 8, 2e-3)
    u = 25 * np.sign(np.cos(5.0 * t)) + 8 * np.sin(13.0 * t)
    truth = plain.with_effect(ripple).with_effect(friction)
    x = np.asarray(cdf.event_response(truth, t, u, input_hold="zoh").outputs)[0]
    run = cdf.Measurement(t, u, x + 1e-6 * np.random.default_rng(1).standard_normal(t.size))
    model, sought = plain.with_effect(ripple), friction
    if known != "position_ripple":
        model, sought = plain.with_effect(friction), ripple
    data = prepare(model, [run])
    free = ("mass", "coulomb.level", "viscous.coefficient")
    screen = Screen(data.fit(model, free, iterations=5), data)
    wave, _ = next(screen.waves(reversing=known == "position_ripple"))
    # measured at worst 2.5 %, 3 %, 0.04 rad, 3e-4; with the ripple left in, friction was found at 0.028 m
    assert wave.wavelength == pytest.approx(sought.wavelength, rel=0.02)
    assert wave.amplitude == pytest.approx(sought.amplitude, rel=0.1)
    assert abs(math.remainder(wave.phase - sought.phase, 2 * math.pi)) < 0.1
    assert wave.mass == pytest.approx(4.6, rel=0.01)


def moves(ripple, dt=4e-3):
    """Return a run of a servo: three moves of 30 rad/s, held in between by torques below friction."""
    rng = np.random.default_rng(2)
    t = np.arange(0, 4.5, dt)
    u = 0.012 * np.sin(9.0 * t) + 2e-4 * rng.standard_normal(t.size)
    for begin, sign in ((0.2, 1), (1.6, -1), (3.0, 1)):
        speed = np.clip(np.minimum(300 * (t - begin), 300 * (begin + 0.7 - t)), 0, 30)
        on = (t >= begin) & (t < begin + 0.7)
        u[on] = sign * (1.5e-4 * np.gradient(speed, dt) + 0.02 + 2e-5 * speed)[on]
    x, v, h, places = 0.0, 0.0, dt / 80, []
    for torque in u.tolist():
        places.append(x)
        for _ in range(80):
            v += h / 1.5e-4 * (torque - 2e-5 * v + ripple * math.sin(5 * x + 1.0))
            v = math.copysign(max(abs(v) - h / 1.5e-4 * 0.02, 0.0), v)
            x += h * v
    y = np.array(places) + 9e-5 * rng.standard_normal(t.size)
    return cdf.Measurement(t, u, y, input_unit="N m", output_unit="rad")


def test_pauses_in_which_friction_holds():
    """What friction takes up in a pause is no broad noise in which a ripple of a twentieth of it drowns."""
    run = moves(1e-3)
    first, second = RippleSpectrum([run], [equal_segments(run, 8)]).best(2)
    # measured 1.5e-3, 8 %, 280 and 45 nats; with the pauses 21 and 9, and the inertia 15 % off
    assert first.wavelength == pytest.approx(2 * math.pi / 5, rel=5e-3)
    assert first.amplitude == pytest.approx(1e-3, rel=0.2)
    assert first.mass == pytest.approx(1.5e-4, rel=0.01)
    assert first.gain > second.gain + 100


def test_no_waves():
    """Where nothing repeats over position nothing is gained."""
    run = drive(4, 0.0, 1.0, 0.0, 3e-4)
    assert RippleSpectrum([run], [equal_segments(run, 8)]).best(1)[0].gain < 25


def test_other_phase_of_the_record_held_out():
    """The encoder began elsewhere: the ripple is the same but for its phase, and is confirmed."""
    run, held = (drive(seed, 4.0, 8e-3, phase, 2e-4, 2.5) for seed, phase in ((5, 0.3), (6, 2.0)))
    model = cdf.Mass(6.0, [cdf.Coulomb(0.6), cdf.Viscous(17.0)])
    found = cdf.diagnose(model, run, holdout=held, candidates=["position_ripple", "constant_force"])
    assert found.verdict == "effect"
    best = found.best
    assert best.id == "position_ripple"
    assert best.parameters["wavelength"] == pytest.approx(8e-3, rel=1e-2)
    assert (
        abs(math.remainder(best.parameters["phase"] - 0.3, 2 * math.pi)) < 0.3
    )  # that of the training record
    data = prepare(best.model, [run], [held])
    *_, error = data.segmentations[0].evaluated(best.model)
    assert error * np.std(held.y) < 1.1 * 2e-4


def test_behind_an_elastic_joint():
    """The sensor sees the load, the ripple acts on the motor: the motion of one body does not show it."""
    known = [cdf.Coulomb(1.5), cdf.Viscous(15.0), cdf.Compliance(1200.0, damping=8.0, load_fraction=0.4)]
    model, ripple = cdf.Mass(5.0, known), cdf.PositionRipple(0.6, wavelength=0.025, phase=1.0)
    rng, t = np.random.default_rng(3), np.arange(0, 6, 2e-3)
    runs = []
    for phase in (0.0, 2.0):
        u = 12 * np.sin(2.1 * t + phase) + 6 * np.sin(5.3 * t + 2 * phase)
        x = np.asarray(cdf.event_response(model.with_effect(ripple), t, u, input_hold="zoh").outputs)[0]
        runs.append(cdf.Measurement(t, u, x + 1e-4 * rng.standard_normal(t.size)))
    found = cdf.diagnose(model, runs[0], holdout=runs[1], candidates=["position_ripple", "drift"])
    assert found.verdict == "effect"
    assert found.best.parameters["wavelength"] == pytest.approx(0.025, rel=2e-3)
    assert found.best.parameters["amplitude"] == pytest.approx(0.6, rel=0.05)


def test_a_drive_that_moves_one_way_tells_its_friction_from_no_constant_force():
    rng, t = np.random.default_rng(48), np.arange(0, 8, 0.004)
    torque = np.repeat(0.4 + 1.2 * rng.uniform(-1, 1, 10), 200)
    spindle = cdf.Inertia(0.02, [cdf.Coulomb(0.3), cdf.Viscous(0.03)])
    true = spindle.with_effect(cdf.PositionDependentFriction(0.1, wavelength=2 * np.pi, phase=0.7))
    angle = np.asarray(cdf.event_response(true, t, torque, input_hold="zoh").outputs)[0]
    angle = angle + 2e-4 * rng.standard_normal(t.size)
    run = cdf.Measurement(t, torque, angle, input_unit="N m", output_unit="rad")
    (wave,) = RippleSpectrum([run], [equal_segments(run, 4)], reversing=True).best(1)
    assert wave.wavelength == pytest.approx(2 * np.pi, rel=0.005)
    assert wave.coulomb == pytest.approx(0.3, rel=0.05)  # 1e8, less as much of a constant force
