"""A gap and stops in one machine: a load that hits a motor held at a stop, and rests on it.

The engine against time stepping that knows no modes: short steps, colliding bodies thrown apart one after the
other until none approach.
"""

import numba
import numpy as np
import pytest

import ctrl_df as cdf
from ctrl_df.simulate.engine import Engine
from ctrl_df.simulate.program.layout import Drive
from ctrl_df.status import Status

STEP, RUN = 2000, 2.0  # steps between samples, seconds


@numba.njit
def collide(v0, v1, m0, m1, e):
    """Speeds after a collision of two bodies."""
    common, apart = (m0 * v0 + m1 * v1) / (m0 + m1), e * (v1 - v0)
    return common + m1 / (m0 + m1) * apart, common - m0 / (m0 + m1) * apart


@numba.njit
def stepped(t, u, steps, masses, gap, e, low, high, e_stop, dry, gains, out):
    """Positions of load and motor under a force u, or under a PID (kp, ki, kd) with the reference u."""
    (m0, m1), (kp, ki, kd), tiny = masses, gains, 1e-13
    x0 = v0 = x1 = v1 = integral = 0.0
    for k in range(len(t)):
        out[k] = x0, x1
        if k + 1 == len(t):
            return
        h = (t[k + 1] - t[k]) / steps
        for s in range(steps):
            force = u[k] + (u[k + 1] - u[k]) * (s + 0.5) / steps
            if kp > 0:
                error = force - x0
                force = kp * error + ki * integral - kd * v0
                integral += error * h
            w0, w1 = v0, v1 + h * force / m1
            w0 = np.sign(w0) * max(abs(w0) - h * dry[0] / m0, 0.0)
            w1 = np.sign(w1) * max(abs(w1) - h * dry[1] / m1, 0.0)
            x0, x1 = x0 + h * (v0 + w0) / 2, x1 + h * (v1 + w1) / 2
            v0, v1 = w0, w1
            for _ in range(100_000):
                hit = (x1 - x0 <= 0 and v1 - v0 < -tiny) or (x1 - x0 >= gap and v1 - v0 > tiny)
                stop = (x1 >= high and v1 > tiny) or (x1 <= low and v1 < -tiny)
                if hit:
                    v0, v1 = collide(v0, v1, m0, m1, e)
                elif stop:
                    v1 = -e_stop * v1
                else:
                    break
            x1 = min(max(x1, low), high)
            x0 = min(max(x0, x1 - gap), x1)


def machine(rng, kind):
    """Return a block and its numbers: masses (load, motor), gap, restitutions, stops, dry friction."""
    motor, load = 10 ** rng.uniform(-0.7, 0.7, 2)
    gap, high = 10 ** rng.uniform(-2.5, -1.3), 10 ** rng.uniform(-1.7, -1)
    low, (e, e_stop) = -high * rng.uniform(0.2, 1), rng.uniform(0, 0.8, 2) * rng.choice([0, 1, 1, 1], 2)
    dry = 0.1 * (load + motor) * rng.random(2) * rng.choice([0, 1], 2)
    if kind == "mass":
        block = cdf.Mass(load + motor).with_effect(cdf.Backlash(gap, e, load / (load + motor)))
    else:
        block = {"masses": cdf.TwoMass, "inertias": cdf.TwoInertias}[kind](motor, load)
        block = block.with_effect(cdf.Backlash(gap, e))
    block = block.with_effect(cdf.HardStop(high, e_stop, lower=low))
    for effect, level in ((cdf.LoadFriction, dry[0]), (cdf.Coulomb, dry[1])):
        if level:
            block = block.with_effect(effect(level))
    return block, ((load, motor), gap, e, low, high, e_stop, tuple(dry))


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("kind", ["masses", "inertias", "mass"])
def test_a_gap_and_stops_against_time_stepping(kind, seed):
    rng = np.random.default_rng([42, seed, len(kind)])
    block, numbers = machine(rng, kind)
    (load, motor), high = numbers[0], numbers[4]
    t, force, omega = (
        np.linspace(0, RUN, 201),
        (load + motor) * 10 ** rng.uniform(-0.9, 0.1),
        rng.uniform(2, 9),
    )
    if seed % 4 < 2:
        system, gains = block, (0.0, 0.0, 0.0)
        u = force * (np.ones_like(t) * rng.choice([-1, 1]) if seed % 4 else 1.5 * np.sin(omega * t))
    else:
        kp = force / high
        gains = kp, kp * rng.choice([0.0, 2.0]), 0.6 * np.sqrt(kp * (load + motor))
        system = cdf.closed_loop(cdf.pid(*gains), block)
        u = high * (2 * np.ones_like(t) if seed % 4 == 2 else 1.8 * np.sin(omega * t))
    run = cdf.event_response(system, t, u, return_states=True)
    assert run.status is Status.CONVERGED and run.event_count < 200
    first = next(i for i, name in enumerate(system.state_labels) if name.split("_")[-1] in ("x", "angle"))
    got, expected = np.asarray(run.states)[[first, first + 2]].T, np.empty((len(t), 2))
    stepped(t, u, STEP, *numbers, gains, expected)
    # steps of 5 us are off by their length times a speed, a little more at every impact; worst of 36: 1.9e-4
    assert np.abs(got - expected).max() < 1e-3 * high


@pytest.mark.parametrize("seed", range(40))
def test_a_load_hits_a_motor_at_a_stop(seed):
    """All collisions of an instant, one after the other: the bodies part, or come to rest for good."""
    rng = np.random.default_rng([43, seed])
    m0, m1 = 10 ** rng.uniform(-1.5, 1.5, 2)
    e, e_stop = rng.uniform(0, 1, 2) * rng.choice([0, 1, 1], 2)
    side, v = rng.choice([-1, 1]), rng.uniform(0.1, 2)
    v0, v1 = v, 0.0
    for _ in range(200_000):
        if v0 - v1 <= 1e-13 * v:
            break
        v0, v1 = collide(v0, v1, m0, m1, e)
        v1 = -e_stop * v1 if v1 > 0 else v1
    block = cdf.TwoMass(m1, m0).with_effect(cdf.Backlash(0.01, e)).with_effect(cdf.HardStop(0.1, e_stop))
    engine = Engine(block)
    at_stop = engine.start([side * 0.1 - 0.005, side * v, side * 0.1, 0.0])
    run = engine.run(at_stop, 1.0, stop_at_event=True)
    hits = 0
    while run.state.time == 0.0 or (run.state.x[1] == side * v and run.state.time < 1.0):
        run = engine.run(run.state, 1.0, stop_at_event=True)
        hits += 1
        assert hits < 5
    assert run.state.time == pytest.approx(0.005 / v, rel=1e-9)
    # speeds that shrink to nothing are left at 1e-13 above; worst of 200: 1.0e-13
    assert side * run.state.x[[1, 3]] == pytest.approx([v0, v1], abs=1e-12 * v)


def test_a_load_stays_pressed_on_a_held_motor():
    """The motor pushes into its stop, the load leans on it there: one event each, then nothing happens."""
    block = cdf.TwoMass(0.8, 2.3).with_effect(cdf.Backlash(0.006, 0.4)).with_effect(cdf.HardStop(0.03, 0.2))
    t = np.linspace(0, 3, 301)
    run = cdf.event_response(block, t, 2.0 * np.ones_like(t))
    x, v, x_motor, v_motor = np.asarray(run.outputs)
    assert run.status is Status.CONVERGED and run.event_count < 40  # 26; 2038 and an early end before
    assert x[-1] == x_motor[-1] == 0.03 and v[-1] == v_motor[-1] == 0.0
    u = np.where(t < 2, 2.0, -2.0)
    back = np.asarray(cdf.event_response(block, t, u).outputs)
    assert back[2, -1] < 0.03 and back[0, -1] < 0.03  # the contacts let go where the force turns


def test_friction_gap_and_stops_of_one_mass():
    """An OverflowError before: five hundred times as many events as a log holds."""
    block = cdf.Mass(1.3).with_effect(cdf.Backlash(0.01, 0.1)).with_effect(cdf.Coulomb(0.5))
    block = block.with_effect(cdf.HardStop(0.05, 0.2))
    t = np.linspace(0, 1.5, 151)
    run = cdf.event_response(block, t, 4 * np.sin(7 * t))
    assert run.status is Status.CONVERGED and run.event_count < 100  # 52


def test_a_run_of_many_short_chunks():
    """Every full log is a chunk, after which the next one may be four times as long: not without bound."""
    engine = Engine(cdf.quantizer(1e-3))
    t = np.linspace(0, 1, 3)
    drive = Drive(t, np.array([[0.0, 1.0, 0.0]]), 1, np.zeros((1, 0), complex), 0.0, 0)
    run = engine.run(engine.start(), 1.0, drive, log=2)
    assert run.status is Status.CONVERGED and run.event_count == 2000


def test_what_chatters_is_named():
    """The warning names the last events: no relay where there is none."""
    import control as ct

    integrator = ct.ss([[0.0]], [[1.0]], [[1.0]], [[0.0]], inputs="u", outputs="y", name="plant")
    loop = ct.interconnect(
        [cdf.relay(1.0).copy(name="switch"), integrator],
        connections=[["switch.u", "-plant.y"], ["plant.u", "switch.y"]],
        inplist=["switch.u"], outlist=["plant.y"], inputs=["r"], outputs=["y"],
    )  # fmt: skip
    with pytest.warns(RuntimeWarning, match=r"last: switch in .*switch\): infinitely many events"):
        cdf.event_response(loop, [0, 1], 0, 0.1)
