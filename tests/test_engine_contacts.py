"""Contacts as properties: over random loops no wall is passed, momentum kept, energy never made."""

import numpy as np
import pytest

import ctrl_df as cdf
from ctrl_df.simulate.engine import Engine, constant_drive, harmonic_drive
from ctrl_df.simulate.program import layout as L
from ctrl_df.status import Status


def random_backlash(rng):
    """A gap under a PID or a harmonic force; (engine, drive, start, masses, gap, offset of the mechanism)."""
    load, motor = 10.0 ** rng.uniform(-1, 1.3), 10.0 ** rng.uniform(-1, 1)
    gap, restitution = 10.0 ** rng.uniform(-4, -1), rng.choice([0.0, 1.0, rng.uniform(0, 1)])
    block = cdf.backlash_masses(motor, load, gap, restitution)
    if rng.random() < 0.5:
        block = block.with_effect(cdf.LoadFriction(rng.uniform(0, 3))).with_effect(
            cdf.Viscous(rng.uniform(0, 2))
        )
    if rng.random() < 0.3:
        block = block.with_effect(cdf.QuadraticDrag(0.1))  # takes the other path: not affine
    omega = 10.0 ** rng.uniform(0.3, 1.7)
    if rng.random() < 0.5:
        total = load + motor
        gains = total * omega**2, 0.3 * total * omega**3 * rng.random(), total * omega * rng.uniform(0.2, 2)
        engine, first = Engine(cdf.closed_loop(cdf.pid(*gains), block)), 1
        drive = constant_drive([gap * rng.uniform(-30, 30)])
    else:
        engine, first = Engine(block), 0
        drive = harmonic_drive([[0.0, total_force(rng, load + motor, gap, omega)]], omega)
    x0 = np.zeros(engine.nstates)
    x0[first] = gap * rng.choice([0.0, 1.0, 1e4]) * rng.normal()
    x0[first + 1] = rng.normal() * gap * omega
    x0[first + 2] = x0[first] + min(max(gap * rng.uniform(-0.2, 1.2), 0.0), gap)
    x0[first + 3] = rng.normal() * gap * omega * 3
    return engine, drive, x0, (load, motor), gap, first, 12 / omega


def total_force(rng, mass, gap, omega):
    return mass * gap * omega**2 * 10.0 ** rng.uniform(-0.5, 1.5)


@pytest.mark.parametrize("seed", range(40))
def test_nothing_passes_a_gap(seed):
    rng = np.random.default_rng(1000 + seed)
    engine, drive, x0, (load, motor), gap, first, t_end = random_backlash(rng)
    states, worst, size = [], 0.0, abs(x0[first]) + gap
    state, events = engine.start(x0), 0
    while state.time < t_end and events < 400:
        before = state.time
        run = engine.run(state, t_end, drive, np.linspace(before, t_end, 40), stop_at_event=True, log=2)
        assert run.status in (Status.CONVERGED, Status.DIVERGED), run.status
        state = run.state
        states.append(run.states[: run.recorded])
        if len(run.events[2]) and L.EVENT_KINDS[int(run.events[2][0])] in ("impact", "contact"):
            events += 1
            (v0, v1), (w0, w1) = run.before[[first + 1, first + 3]], state.x[[first + 1, first + 3]]
            momentum, scale = load * v0 + motor * v1, load * abs(v0) + motor * abs(v1)
            worst = max(worst, abs(load * w0 + motor * w1 - momentum) / (scale + 1e-300))
            energy = load * v0**2 + motor * v1**2
            assert load * w0**2 + motor * w1**2 <= energy * (1 + 1e-14)
    delta = np.concatenate(
        [s[:, first + 2] - s[:, first] for s in states] + [[state.x[first + 2] - state.x[first]]]
    )
    size += np.abs(np.concatenate([s[:, first] for s in states])).max()
    # worst of 1500 seeds: momentum 6e-16, penetration 1.4 roundings of the place
    assert worst < 2e-15
    beyond = max(-delta.min(), (delta - gap).max())
    assert beyond <= 1e-12 * gap + 1e-15 * size


@pytest.mark.parametrize("seed", range(30))
def test_nothing_passes_a_stop(seed):
    rng = np.random.default_rng(2000 + seed)
    mass, at, lower = 10.0 ** rng.uniform(-1, 1), rng.uniform(0.01, 0.5), -rng.uniform(0.01, 0.5)
    restitution, omega = rng.choice([0.0, 1.0, rng.uniform(0, 1)]), 10.0 ** rng.uniform(0, 1.5)
    block = cdf.Mass(mass).with_effect(cdf.HardStop(at, restitution, lower=lower))
    if rng.random() < 0.5:
        block = block.with_effect(cdf.Coulomb(rng.uniform(0, 0.2) * mass * at * omega**2))
    if rng.random() < 0.3:
        block = block.with_effect(cdf.CubicSpring(mass * omega**2 / at**2))
    engine = Engine(block)
    drive = harmonic_drive([[0.0, mass * omega**2 * at * 10.0 ** rng.uniform(-0.5, 1.0)]], omega)
    start = engine.start([rng.uniform(lower, at), rng.normal() * at * omega])
    run = engine.run(start, 30 / omega, drive, np.linspace(0, 30 / omega, 600), max_steps=200_000)
    assert run.status is Status.CONVERGED
    x = run.states[:, 0]
    assert x.max() <= at * (1 + 1e-12) + 1e-14 and x.min() >= lower * (1 + 1e-12) - 1e-14
    state, hits = engine.start([0.0, at * omega]), 0
    while state.time < 30 / omega and hits < 60:
        run = engine.run(state, 30 / omega, drive, stop_at_event=True, log=2)
        state = run.state
        if len(run.events[2]) and L.EVENT_KINDS[int(run.events[2][0])] in ("stop", "stop contact"):
            hits += 1
            assert abs(state.x[1]) <= abs(run.before[1]) * (1 + 1e-15)
            assert state.x[0] in (at, lower)


def test_impacts_far_from_zero_are_met_once():
    """A snapped place may lie one rounding beyond the gap: at 1e4 m that is 1e-12, far above a tiny atol."""
    for x in (3e2, 7.1e3, 1e4):
        block = cdf.backlash_masses(1.0, 8.0, 0.018, 0.7)
        engine = Engine(block)
        run = engine.run(engine.start([x, 0.0, x + 0.009, 0.4]), 1.0, atol=1e-20)
        assert run.status is Status.CONVERGED and 5 < run.event_count < 30


def test_a_full_event_log_hides_no_chatter():
    """A relay that pushes its own input back switches for ever; the bound on such events must hold."""
    import control as ct

    relay, lag = (
        cdf.relay(1.0),
        ct.ss([[0.0]], [[1.0]], [[1.0]], [[0.0]], inputs="u", outputs="y", name="plant"),
    )
    loop = ct.interconnect(
        [relay.copy(name="relay"), lag], connections=[["relay.u", "-plant.y"], ["plant.u", "relay.y"]],
        inplist=["relay.u"], outlist=["plant.y"], inputs=["r"], outputs=["y"],
    )  # fmt: skip
    engine = Engine(loop)
    run = engine.run(engine.start([0.1]), 1.0, log=16, max_steps=100_000)
    assert run.status is Status.CHATTERING
    assert run.state.time == pytest.approx(0.1, abs=1e-6)
