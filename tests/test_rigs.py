"""The rigs themselves: their integrator against scipy, their promises on size, noise and repeatability."""

import math

import numpy as np
import pytest
import rig_physics as physics
import rigs
from scipy.integrate import solve_ivp

DT = 1e-3


def force(rng, n, peak):
    """Return a held force: two sines and steps."""
    t = DT * np.arange(n)
    u = np.sin(2 * np.pi * rng.uniform(0.8, 2) * t) + 0.4 * np.sin(2 * np.pi * rng.uniform(3, 6) * t + 1)
    return peak * (u + 0.3 * np.sign(np.sin(2 * np.pi * 1.3 * t)))


def smooth(rates, u, state):
    """Integrate a smooth right-hand side sample by sample with DOP853."""
    states = [np.array(state, float)]
    for k in range(len(u) - 1):
        sol = solve_ivp(
            lambda t, s, f=u[k]: rates(t, s, f),
            (k * DT, (k + 1) * DT),
            states[-1],
            "DOP853",
            rtol=1e-11,
            atol=1e-14,
        )
        states.append(sol.y[:, -1])
    return np.array(states)


@pytest.mark.parametrize("seed", [0, 1])
def test_smooth_forces_agree_with_dop853(seed):
    rng = np.random.default_rng(seed)
    m, b, c, d = rng.uniform(1, 5), rng.uniform(1, 5), rng.uniform(1, 5), rng.uniform(-1, 1)
    k, k3, a, wave, lag = rng.uniform(5, 20), rng.uniform(50, 200), rng.uniform(0.5, 2), 0.05, 0.01
    u = force(rng, 350, 6.0)

    def rates(t, s, f):
        x, v, z = s
        total = z - b * v - c * v * abs(v) - 0.5 * d * abs(v) - k * (x - 0.01) - k3 * x**3 + 0.3
        return [v, (total + a * math.sin(2 * math.pi * x / wave + 0.4)) / m, (f - z) / lag]

    p = physics.numbers(
        MOTOR=m, VISCOUS=b, DRAG=c, ASYM_VISCOUS=d, SPRING=k, SPRING_X=0.01, CUBIC=k3, RIPPLE=a,
        RIPPLE_LENGTH=wave, RIPPLE_PHASE=0.4, FORCE=0.3, LAG=lag,
    )  # fmt: skip
    x = physics.run(p, u, substeps=5)["x"]
    reference = smooth(rates, u, [0, 0, 0])[:, 0]
    assert np.max(np.abs(x - reference)) < 1e-10 * np.ptp(reference)  # seen: 8e-13


@pytest.mark.parametrize("seed", [0, 1])
def test_elastic_joint_agrees_with_dop853(seed):
    rng = np.random.default_rng(seed)
    m1, m0, k, c = rng.uniform(1, 5), rng.uniform(1, 5), rng.uniform(500, 5000), rng.uniform(1, 10)
    u = force(rng, 350, 6.0)

    def rates(t, s, f):
        joint = k * (s[2] - s[0]) + c * (s[3] - s[1])
        return [s[1], joint / m0, s[3], (f - joint - 2 * s[3]) / m1]

    p = physics.numbers(MOTOR=m1, LOAD=m0, JOINT=physics.ELASTIC, JOINT_K=k, JOINT_C=c, VISCOUS=2)
    x = physics.run(p, u, substeps=5)["x"]
    reference = smooth(rates, u, [0, 0, 0, 0])[:, 0]
    assert np.max(np.abs(x - reference)) < 1e-10 * np.ptp(reference)  # seen: 1.2e-11


def stick_slip(m, b, kinetic, static, u, stribeck=None):
    """Event-driven reference: stands or slides; DOP853 between stops."""
    x, v, sliding, out = 0.0, 0.0, 0, [0.0]

    def level(v):
        return (
            kinetic if stribeck is None else kinetic + (static - kinetic) * math.exp(-((v / stribeck) ** 2))
        )

    def stop(t, s):
        return s[1]

    stop.terminal = True
    for f in u[:-1]:
        left = DT
        while left > 1e-15:
            if sliding == 0:
                if abs(f) <= static:
                    break
                sliding = int(np.sign(f))
            stop.direction = -sliding
            sol = solve_ivp(
                lambda t, s, f=f, d=sliding: [s[1], (f - b * s[1] - d * level(s[1])) / m],
                (0, left), [x, v], "DOP853", events=stop, rtol=1e-11, atol=1e-15, max_step=2e-4,
            )  # fmt: skip
            x, v = sol.y[:, -1]
            left -= sol.t[-1]
            if sol.status == 1:
                v, sliding = 0.0, 0
        out.append(x)
    return np.array(out)


@pytest.mark.parametrize("stribeck", [None, 0.03])
def test_stick_slip_agrees_with_located_events(stribeck):
    rng = np.random.default_rng(5)
    m, b, kinetic = rng.uniform(1, 5), rng.uniform(1, 5), rng.uniform(2, 4)
    static = kinetic * rng.uniform(1.2, 1.8)
    u = force(rng, 600, 5.0)
    given = dict(STATIC=static) if stribeck is None else dict(STRIBECK=static, STRIBECK_V=stribeck)
    run = physics.run(physics.numbers(MOTOR=m, VISCOUS=b, COULOMB=kinetic, **given), u, substeps=10)
    reference = stick_slip(m, b, kinetic, static, u, stribeck)
    assert np.count_nonzero(run["v"] == 0) > 5  # it does stick
    assert np.max(np.abs(run["x"] - reference)) < 1e-12 * np.ptp(reference)  # seen: 6e-15


@pytest.mark.parametrize("restitution", [0.2, 0.7])
def test_impacts_agree_with_ballistic_flight(restitution):
    # A constant force on the motor of a frictionless pair: flights are parabolas, impact times are roots.
    m1, m0, gap, f = 1.3, 2.1, 0.01, 0.8
    p = physics.numbers(MOTOR=m1, LOAD=m0, JOINT=physics.IMPACT, GAP=gap, RESTITUTION=restitution)
    run = physics.run(p, np.full(1200, f), substeps=5)
    t_now, x1, v1, x0, v0 = 0.0, 0.0, 0.0, 0.0, 0.0
    motor, load = [], []
    times = DT * np.arange(1200)
    together = False
    for t in times:
        while not together:
            # gap - (x1 - x0) - (v1 - v0) s - f s^2 / (2 m1) = 0, next positive root
            rate, room = v1 - v0, gap - (x1 - x0)
            s = (-rate + math.sqrt(rate * rate + 2 * f / m1 * max(room, 0.0))) * m1 / f
            if t_now + s > t:
                break
            x1, v1, x0 = x1 + v1 * s + f * s * s / (2 * m1), v1 + f * s / m1, x0 + v0 * s
            rate, common, t_now = v1 - v0, (m1 * v1 + m0 * v0) / (m1 + m0), t_now + s
            if restitution * rate < 1e-7:
                together, v1, v0 = True, common, common
            else:
                v1 = common - restitution * rate * m0 / (m1 + m0)
                v0 = common + restitution * rate * m1 / (m1 + m0)
        s = t - t_now
        a1, a0 = (f / (m1 + m0),) * 2 if together else (f / m1, 0.0)
        motor.append(x1 + v1 * s + a1 * s * s / 2)
        load.append(x0 + v0 * s + a0 * s * s / 2)
    assert together  # the bounces die out into contact
    assert np.max(np.abs(run["x_motor"] - motor)) < 1e-12  # seen: 1.2e-14
    assert np.max(np.abs(run["x"] - load)) < 1e-12


def test_hard_stop_bounces_with_newtons_restitution_and_rests():
    e, f, m, limit = 0.6, 2.0, 0.5, 0.03
    p = physics.numbers(MOTOR=m, STOP=1, STOP_LOW=-limit, STOP_HIGH=limit, STOP_RESTITUTION=e)
    run = physics.run(p, np.full(1500, f))
    first = math.sqrt(2 * limit * m / f)
    k = int(first / DT) + 1
    s = k * DT - first
    assert run["x"][k] == pytest.approx(limit - e * f / m * first * s + f / m * s * s / 2, abs=1e-12)
    assert run["x"][-1] == limit and run["v"][-1] == 0


def test_bristle_agrees_with_an_implicit_solver():
    m, b, kinetic, k, c = 2.0, 1.5, 3.0, 2e4, 60.0
    u = force(np.random.default_rng(1), 600, 5.0)

    def rates(t, s, f):
        rate = s[1] - k * abs(s[1]) * s[2] / kinetic
        return [s[1], (f - b * s[1] - k * s[2] - c * rate) / m, rate]

    run = physics.run(physics.numbers(MOTOR=m, VISCOUS=b, COULOMB=kinetic, BRISTLE_K=k, BRISTLE_C=c), u)
    states = [np.zeros(3)]
    for f in u[:-1]:
        sol = solve_ivp(
            lambda t, s, f=f: rates(t, s, f), (0, DT), states[-1], "LSODA", rtol=1e-10, atol=1e-13
        )
        states.append(sol.y[:, -1])
    reference = np.array(states)[:, 0]
    assert np.max(np.abs(run["x"] - reference)) < 5e-8 * np.ptp(reference)  # seen: 5e-9, the solver's own


def test_delays_shift_and_static_elements_clip():
    u = force(np.random.default_rng(2), 1500, 5.0)
    base = dict(MOTOR=2.0, VISCOUS=3.0)
    plain = physics.run(physics.numbers(**base), u)
    late = physics.run(physics.numbers(**base, DELAY=0.013), u)
    assert np.allclose(late["x"][13:], plain["x"][:-13], atol=1e-13)
    seen_late = physics.run(physics.numbers(**base, SENSOR_DELAY=0.0134), u)["y"]
    acted_late = physics.run(physics.numbers(**base, DELAY=0.0134), u)["x"]
    assert np.max(np.abs(seen_late - acted_late)) < 1e-10  # the same map; Hermite between samples
    clipped = physics.run(physics.numbers(**base, SATURATION=2.0), u)["x"]
    assert np.allclose(clipped, physics.run(physics.numbers(**base), np.clip(u, -2, 2))["x"], atol=1e-13)
    dead = physics.run(physics.numbers(**base, DEAD_ZONE=1.0), u)["x"]
    shrunk = np.sign(u) * np.maximum(np.abs(u) - 1.0, 0)
    assert np.allclose(dead, physics.run(physics.numbers(**base), shrunk)["x"], atol=1e-13)


SHORT = dict(n=2000)


@pytest.mark.parametrize("name", rigs.ORDER)
def test_every_effect_of_the_library_has_a_rig(name):
    seed = rigs.ORDER.index(name)
    rig = rigs.draw(name, seed, closed_loop=seed % 2 == 1, excitation=rigs.EXCITATIONS[seed % 3], **SHORT)
    assert 3 <= rig.ratio <= 200
    ids = {e.id for e in rig.true_block.effects}
    assert name in ids and name not in {e.id for e in rig.baseline.effects}
    assert ids - {name} == {e.id for e in rig.baseline.effects}
    for key, p in rig.true_block.parameters.items():
        if key in rig.truth:
            assert p.value == rig.truth[key]
    for key, p in rig.baseline.parameters.items():
        off = abs(p.value / rig.truth[key] - 1) if rig.truth.get(key) else 0.0
        exact = key in rig.known or key.endswith((".center", ".restitution")) or key not in rig.truth
        assert off == 0 if exact else (0.0999 <= off <= 0.3001 or key.endswith("load_fraction"))
    train, held = rig.train[0], rig.holdout[0]
    assert train.excitation != held.excitation
    assert np.std(train.y - train.clean) == pytest.approx(train.noise, rel=0.15)
    assert train.noise == pytest.approx(1e-3 * np.std(train.clean), rel=0.25)  # closed loops feed noise back


def test_the_library_is_covered():
    from ctrl_df.blocks.effect import effect_library

    builtin = {k for k, c in effect_library().items() if c.__module__.startswith("ctrl_df.")}
    builtin -= {"torque_constant"}  # what goes in is known
    builtin -= {"loose_linkage", "maxwell_slip"}  # their rig is a test machine, in test_imposed.py
    assert set(rigs.ORDER) == set(rigs.EFFECTS) == builtin


@pytest.mark.parametrize("kind", sorted(rigs.OUTSIDE))
def test_effects_outside_the_library(kind):
    rig = rigs.draw_outside(3, kind=kind, **SHORT)
    assert rig.true_block is None and rig.regions and 3 <= rig.ratio <= 200


@pytest.mark.parametrize("noise", rigs.NOISES)
@pytest.mark.parametrize("snr_db", [40, 60])
def test_noise_has_the_stated_level_and_colour(noise, snr_db):
    rig = rigs.draw_wrong_parameters(4, noise=noise, snr_db=snr_db)
    record = rig.train[0]
    e = record.y - record.clean
    assert np.std(e) == pytest.approx(10 ** (-snr_db / 20) * np.std(record.clean), rel=0.2)
    correlation = np.corrcoef(e[1:], e[:-1])[0, 1]
    assert correlation > 0.6 if noise == "coloured" else abs(correlation) < 0.15
    assert (len(np.unique(record.y)) < 6000) == (noise == "encoder")


def test_the_same_seed_gives_the_same_rig_and_another_one_another():
    a, b, c = (rigs.draw("stribeck", seed, **SHORT) for seed in (1, 1, 2))
    assert a.truth == b.truth and np.array_equal(a.train[0].y, b.train[0].y)
    assert a.truth != c.truth


def test_two_hidden_effects_are_both_in_the_true_block():
    rig = rigs.draw(("position_ripple", "quadratic_drag"), 3, **SHORT)
    assert {"position_ripple", "quadratic_drag"} <= {e.id for e in rig.true_block.effects}
    assert len(rig.hidden) == 2


def test_nothing_hidden():
    none, wrong = rigs.draw_none(1, **SHORT), rigs.draw_wrong_parameters(1, **SHORT)
    assert none.baseline == none.true_block and none.hidden == ()
    assert wrong.baseline != wrong.true_block and wrong.hidden == ()


def test_closed_loops_track_and_records_become_measurements():
    rig = rigs.draw("coulomb", 2, closed_loop=True, velocity=True, **SHORT)
    record = rig.train[0]
    assert np.std(record.y - record.r) < 0.5 * np.std(record.r)
    assert np.std(record.v) > 0
    data = record.measurement()
    assert data.dt == pytest.approx(1e-3) and np.array_equal(data.velocity, record.v)
