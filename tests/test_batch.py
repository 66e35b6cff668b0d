"""Many runs in one call: each is what `event_response` gives, whatever the threads and the neighbours."""

import pickle
import re
import threading
import time
from dataclasses import dataclass

import control as ct
import numpy as np
import pytest

import ctrl_df as cdf
from ctrl_df.simulate.batch import _require_room
from ctrl_df.simulate.engine import Engine, sampled_drive
from ctrl_df.simulate.groups import Group, assigned, groups_of
from ctrl_df.simulate.runs import harmonic_drives, run_many, sampled_drives
from ctrl_df.values.column import Column, Differs

T = np.linspace(0, 0.8, 401)
U = 15 * np.sin(9 * T) + 9 * np.sin(41 * T + 1)
RUNS = 6
PLAIN = cdf.friction_mass(9, 5, 0.5)
LOOP = cdf.closed_loop(cdf.pid(2000, 44250, 130), cdf.friction_mass(9, 5, 0.5, 5.5))


def several(low, high, seed=0, runs=RUNS):
    return np.random.default_rng(seed).uniform(low, high, runs)


def same(batch, run, single, rtol=1e-9):
    """Whether a run of a batch is what `event_response` gave: to rounding in parts of the whole motion."""
    n = len(single.time)
    scale = np.max(np.abs(single.outputs), axis=-1, keepdims=True)
    mine = batch.outputs[run].reshape(len(batch.output_labels), -1)
    theirs = np.reshape(single.outputs, (len(batch.output_labels), -1))
    np.testing.assert_array_less(np.abs(mine[:, :n] - theirs) - rtol * scale.reshape(-1, 1), 1e-300)
    assert np.isnan(mine[:, n:]).all()
    assert batch.status[run] is single.status
    assert batch.event_counts[run] == single.event_count


# each: block, parameters with a low and a high value, start
MECHANISMS = {
    "friction": (cdf.friction_mass(9, 5, 0.5, 5.5), {"mass": (7, 11), "coulomb.level": (3, 5)}, 0),
    "gap": (
        cdf.backlash_masses(1, 8, 0.002, 0.3),
        {"backlash.gap": (1e-3, 5e-3), "backlash.restitution": (0, 0.9), "motor_mass": (0.5, 2)},
        0,
    ),
    "gap in one mass": (
        PLAIN.with_effect(cdf.Backlash(1e-3)).with_effect(cdf.LinearSpring(500)),
        {"backlash.load_fraction": (0.2, 0.8), "backlash.gap": (1e-4, 2e-3), "mass": (5, 12)},
        0,
    ),
    "stops": (
        PLAIN.with_effect(cdf.HardStop(0.004, 0.4)),
        {"hard_stop.limit": (0.003, 0.006), "hard_stop.restitution": (0, 0.8)},
        0,
    ),
    "Stribeck": (
        cdf.Mass(3, [cdf.Coulomb(3), cdf.Stribeck(5, 0.02), cdf.CubicSpring(1e5)]),
        {"stribeck.velocity": (0.005, 0.05), "stribeck.level": (4, 7), "cubic_spring.stiffness": (0, 1e6)},
        0,
    ),
    "bristle": (
        cdf.Mass(3, [cdf.Coulomb(3), cdf.Bristle(1e5, 300)]),
        {"bristle.stiffness": (5e4, 2e5), "coulomb.level": (1, 4)},
        0,
    ),
    "elastic joint": (
        PLAIN.with_effect(cdf.Compliance(2e4, 5)).with_effect(cdf.LoadFriction(1)),
        {"compliance.load_fraction": (0.2, 0.8), "load_friction.level": (0, 2)},
        0,
    ),
    "channels": (
        PLAIN.with_effect(cdf.InputSaturation(12.0))
        .with_effect(cdf.InputLag(5e-3))
        .with_effect(cdf.SensorOffset(1e-3))
        .with_effect(cdf.Drift(1e-3)),
        {"input_saturation.level": (8, 20), "input_lag.time_constant": (1e-3, 1e-2), "drift.rate": (0, 1)},
        0,
    ),
    "delay": (
        PLAIN.with_effect(cdf.InputDelay(4e-3)).with_effect(cdf.SensorDelay(2e-3)),
        {"input_delay.delay": (1e-3, 8e-3), "mass": (8, 10)},
        0,
    ),
    "loop": (LOOP, {"mass": (8, 10), "stiction.level": (5, 6)}, [0, 1e-3, 0]),
    "digital loop": (
        cdf.closed_loop(cdf.pid(2000, 44250, 130), PLAIN, 2e-3),
        {"viscous.coefficient": (0, 1)},
        [0, 0, 1e-3, 0],
    ),
    "element": (cdf.saturation(2.0), {"ub": (1, 12)}, 0),
    "relay loop": (
        cdf.closed_loop(ct.tf([5.0], [1, 3, 2, 0]), cdf.relay_with_hysteresis(1.0, 0.1)),
        {"level": (0.5, 2)},
        [0.1, 0.2, 0, 1],
    ),
}


@pytest.mark.parametrize("name", MECHANISMS)
def test_every_run_is_what_event_response_gives(name):
    block, params, start = MECHANISMS[name]
    u = 1e-3 * U if "loop" in name else U
    columns = {key: several(low, high, i) for i, (key, (low, high)) in enumerate(params.items())}
    batch = cdf.batch_response(block, T, u, start, columns, input_hold="zoh")
    for run in range(RUNS):
        mine = {key: float(v[run]) for key, v in columns.items()}
        same(batch, run, cdf.event_response(block, T, u, start, params=mine, input_hold="zoh"))
    by_two = cdf.batch_response(block, T, u, start, columns, input_hold="zoh", threads=3)
    np.testing.assert_array_equal(batch.outputs, by_two.outputs)


def test_inputs_and_starts_differ_from_run_to_run():
    u = np.outer(several(5, 20), U / 15)
    starts = np.random.default_rng(1).normal(size=(RUNS, 2)) * 0.1
    for inputs, x0 in ((u, starts), (u[:, None], starts[0]), (U, starts), (3.0, starts), (0, starts)):
        batch = cdf.batch_response(PLAIN, T, inputs, x0, return_states=True, keep_events=True)
        assert len(batch) == RUNS and batch.ok.all()
        for run in range(RUNS):
            single = cdf.event_response(
                PLAIN,
                T,
                np.squeeze(inputs[run]) if np.ndim(inputs) > 1 else inputs,
                np.broadcast_to(x0, (RUNS, 2))[run],
                return_states=True,
            )
            same(batch, run, single)
            np.testing.assert_allclose(batch.states[run], single.states, rtol=1e-9, atol=1e-12)
            assert [e.kind for e in batch.events[run]] == [e.kind for e in single.events]
            np.testing.assert_allclose(
                [e.time for e in batch.events[run]], [e.time for e in single.events], rtol=1e-9
            )
            assert batch.events[run][0].subsystem == single.events[0].subsystem


def test_several_inputs_and_a_batch_of_one():
    block = ct.ss(-np.eye(2), np.eye(2), np.eye(2), 0)
    u = np.stack([U, np.cos(T)])
    batch = cdf.batch_response(block, T, np.stack([u, 2 * u]))
    assert batch.outputs.shape == (2, 2, len(T))
    np.testing.assert_allclose(batch.outputs[1], 2 * batch.outputs[0], rtol=1e-6, atol=1e-9)
    same(batch, 0, cdf.event_response(block, T, u))
    one = cdf.batch_response(PLAIN, T, U)
    assert len(one) == 1 and one.outputs.shape == (1, 2, len(T)) and one.states is one.events is None
    same(cdf.batch_response(ct.tf([1], [1, 1]), T, U), 0, cdf.event_response(ct.tf([1], [1, 1]), T, U))


def test_the_numbers_depend_on_neither_threads_nor_neighbours():
    runs = 300
    params = {"mass": several(8, 10, 0, runs), "coulomb.level": several(0, 6, 1, runs)}
    block = PLAIN.with_effect(cdf.Backlash(1e-3))
    batches = [
        cdf.batch_response(block, T, U, 0, params, threads=k, keep_events=True, input_hold="zoh")
        for k in (1, 2, 5)
    ]
    for other in batches[1:]:
        np.testing.assert_array_equal(batches[0].outputs, other.outputs)
        assert batches[0].events == other.events
    order = np.random.default_rng(2).permutation(runs)
    mixed = cdf.batch_response(block, T, U, 0, {k: v[order] for k, v in params.items()}, input_hold="zoh")
    np.testing.assert_array_equal(mixed.outputs, batches[0].outputs[order])


def test_parameters_that_change_the_structure():
    block = PLAIN.with_effect(cdf.InputDelay(0.0)).with_effect(cdf.InputDeadZone(0.0))
    params = {
        "input_delay.delay": np.array([0, 1e-3, 0, 2e-3, 5e-3, 0]),
        "input_dead_zone.threshold": np.array([0, 0, 1, 2.0, 0, 3]),
        "coulomb.level": np.array([0, 5.0, 0, 4, 3, 2]),
    }
    batch = cdf.batch_response(block, T, U, 0, params)
    for run in range(RUNS):
        same(batch, run, cdf.event_response(block, T, U, params={k: v[run] for k, v in params.items()}))
    groups = groups_of("a test", block, {k: np.array(v) for k, v in params.items()}, RUNS)
    assert len(groups) == 2 and sorted(np.concatenate([g.runs for g in groups])) == list(range(RUNS))


def test_many_systems_are_packed_at_once(monkeypatch):
    packed = []
    init = Engine.__init__
    monkeypatch.setattr(Engine, "__init__", lambda self, *a: (packed.append(1), init(self, *a))[1])
    block = cdf.Mass(
        3, [cdf.Coulomb(3), cdf.Stribeck(9, 0.02), cdf.Backlash(1e-3), cdf.HardStop(1), cdf.InputGain(1)]
    )
    names = [n for n in block.parameters if n != "hard_stop.lower"]
    values = {n: block.parameters[n].value * several(0.5, 0.9, i, 500) for i, n in enumerate(names)}
    values["stribeck.level"] = several(8, 9, 7, 500)
    (group,) = groups_of("a test", block, values, 500)
    assert len(packed) == 3  # all, the first, the last
    for run in (0, 77, 499):
        alone = Engine(block.with_parameters({n: float(v[run]) for n, v in values.items()}))
        np.testing.assert_array_equal(group.par[group.row[run]], alone.program.par)
        np.testing.assert_array_equal(group.engine.program.ints, alone.program.ints)


@dataclass(frozen=True)
class OddGain(cdf.Effect):
    """A gain that is computed as no column can be."""

    gain: float = cdf.parameter("", meaning="gain")
    role = "input"

    def channel(self):
        from ctrl_df.blocks.primitives import PiecewiseAffine

        return (PiecewiseAffine.from_corners((), (float(np.sqrt(float(self.gain))),), (0.0,)),)


def test_a_block_that_takes_no_columns_is_packed_run_by_run():
    block = PLAIN.with_effect(OddGain(4.0))
    gains = several(1, 9)
    batch = cdf.batch_response(block, T, U, 0, {"odd_gain.gain": gains})
    for run in range(RUNS):
        same(batch, run, cdf.event_response(block, T, U, params={"odd_gain.gain": gains[run]}))
    assert len(groups_of("a test", block, {"odd_gain.gain": gains}, RUNS)) == 1


def test_a_failure_stays_in_its_run():
    away = ct.ss([[0, 1], [4.0, 0]], [[0], [1.0]], np.eye(2), 0)
    stretch = np.array([0, 1.0, 1e100, 0.0])
    long = np.linspace(0, 500, 401)
    with pytest.warns(RuntimeWarning, match=r"2 of 4 runs ended early, the first of them run 1 at t = 3\d\d"):
        batch = cdf.batch_response(away, long, 0, np.outer(stretch, [1, 1]))
    assert [s.ok for s in batch.status] == batch.ok.tolist() == [True, False, False, True]
    assert batch.status[1] is cdf.Status.DIVERGED and "2 diverged" in repr(batch)
    assert (batch.outputs[[0, 3]] == 0).all()
    n = np.isfinite(batch.outputs[1, 0]).sum()
    assert 50 < n < 400 and np.isnan(batch.outputs[1, :, n:]).all() and len(batch[1].time) == n
    assert batch.end_times[1] < 500 == batch.end_times[0]
    with pytest.warns(RuntimeWarning, match="3 of 4 runs"):
        batch = cdf.batch_response(PLAIN, T, 0, [[0, 0], [0, 0.01], [1, -0.02], [0, 0.1]], max_steps=1)
    assert [s.name for s in batch.status] == ["CONVERGED"] + ["WORK_LIMIT"] * 3


def test_laws_called_back_in_python():
    def rates(t, x, u, params):
        if x[0] > params["most"]:
            raise ValueError("too far")
        return [u[0] - params["k"] * x[0]]

    plain = ct.nlsys(rates, None, states=1, inputs=1, outputs=1, params={"k": 1.0, "most": 1e9})
    ks = np.array([1.0, 2, 0.1, 4])
    with pytest.warns(RuntimeWarning, match="1 of 4 runs ended early, the first of them run 2 .*too far"):
        batch = cdf.batch_response(plain, T, 1.0, 0, {"k": ks, "most": [9, 9, 0.5, 9]}, threads=2)
    assert batch.status[2] is cdf.Status.USER_ERROR and "too far" in str(batch.errors[2])
    for run in (0, 1, 3):
        same(batch, run, cdf.event_response(plain, T, 1.0, params={"k": ks[run]}))
    loop = cdf.closed_loop(5.0, cdf.Mass(2.0, [cdf.Viscous(3.0), Slow(2.0)]))
    masses = several(1, 3)
    batch = cdf.batch_response(loop, T, 1.0, 0, {"mass": masses})
    same(batch, 3, cdf.event_response(loop, T, 1.0, params={"mass": masses[3]}))


@dataclass(frozen=True)
class Slow(cdf.Effect):
    """A law that numba cannot compile."""

    level: float = cdf.parameter("N", meaning="level")
    role = "force"

    @staticmethod
    def law(t, x, v, z, p, dz):
        return -sum({"a": p[0]}.values()) * [*(v,)][0]


def test_answers():
    batch = cdf.batch_response(PLAIN, T, U, 0, {"mass": [8.0, 9]}, return_states=True, keep_events=True)
    run = batch[-1]
    assert run.event_count == len(run.events) and run.states.shape == (2, len(T)) and run.status.ok
    assert run.outputs.shape == (2, len(T)) and len(list(batch)) == 2
    assert re.fullmatch(r"<BatchResponse of \S+: 2 runs, 2 outputs, 401 times; 2 converged>", repr(batch))
    assert batch.inputs.shape == (2, 1, len(T)) and batch.state_labels == ("x", "v")
    again = pickle.loads(pickle.dumps(batch))
    np.testing.assert_array_equal(again.outputs, batch.outputs)
    with pytest.raises(IndexError, match="2 runs"):
        batch[2]
    with pytest.raises(TypeError, match="the number of one run"):
        batch["x"]


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (dict(inputs=np.ones((3, 7))), ValueError, r"of shape \(401,\), \(runs, 401\) or \(runs, 1, 401\)"),
        (dict(inputs=np.full(401, np.nan)), ValueError, "inputs finite"),
        (dict(inputs=lambda t: t), TypeError, "a function.*Sample it"),
        (dict(inputs="no"), TypeError, "inputs as real numbers"),
        (dict(inputs=np.ones((0, 401))), ValueError, "inputs of shape"),
        (dict(initial_states=[1, 2, 3]), ValueError, r"initial_states of shape \(2,\) or \(runs, 2\)"),
        (dict(initial_states=np.zeros((2, 2)), inputs=np.ones((3, 401))), ValueError, "3, initial_states 2"),
        (dict(params={"mass": [8.0, 9]}, inputs=np.ones((3, 401))), ValueError, r"3, params\['mass'\] 2"),
        (dict(params={"mass": []}), ValueError, "at least one run"),
        (dict(params={"mas": 8.0}), ValueError, "names of params out of mass, coulomb.level"),
        (dict(params={"mass": [8.0, -1]}), ValueError, "params of run 1, needs mass > 0"),
        (dict(params={"mass": [8.0, np.nan]}), ValueError, r"params\['mass'\] finite; got NaN at index 1"),
        (dict(params={"mass": np.ones((2, 2))}), ValueError, "Give one dimension"),
        (dict(params={"mass": "heavy"}), TypeError, "real numbers"),
        (dict(params=[8.0]), TypeError, "params as a mapping"),
        (dict(threads=0), ValueError, "threads as an integer >= 1"),
        (dict(threads=1.5), ValueError, "threads as an integer >= 1"),
        (dict(input_hold="foh"), ValueError, "input_hold"),
        (dict(rtol=0), ValueError, "batch_response needs 1e-14 <= rtol"),
        (dict(keep_events=1), TypeError, "keep_events as True or False"),
        (dict(thread=1), TypeError, "unrecognized keyword"),
        (dict(initial_states=np.zeros((10_000_000, 2))), ValueError, "needs 64.2 GB.*Give at most"),
    ],
)  # fmt: skip
def test_bad_input_is_refused_with_rule_value_and_remedy(call, error, message):
    with pytest.raises(error, match=message):
        cdf.batch_response(PLAIN, T, **call)


def test_what_runs_contradict_is_told_with_the_number_of_the_run():
    block = cdf.friction_mass(9, 5, 0.5, 5.5).with_effect(cdf.HardStop(0.1))
    with pytest.raises(ValueError, match=r"run 2: a static level must be >= the Coulomb level"):
        cdf.batch_response(block, T, 0, 0, {"coulomb.level": [1.0, 5.5, 5.6, 6]})
    with pytest.raises(ValueError, match=r"run 3: the initial position .* stops -0.05 and 0.05 m; got 0.07"):
        cdf.batch_response(block, T, 0, [[0, 0], [0.09, 0], [0.05, 0], [0.07, 0]], {
            "hard_stop.limit": [0.1, 0.1, 0.05, 0.05]})  # fmt: skip
    with pytest.raises(ValueError, match=r"run 1: .* 0 <= x_motor - x <= 0.001 m"):
        two = cdf.backlash_masses(1, 8, 0.002)
        cdf.batch_response(two, T, 0, [0, 0, 0.0015, 0], {"backlash.gap": [2e-3, 1e-3]})
    with pytest.raises(TypeError, match="needs a block"):
        cdf.batch_response("no system", T)
    twice = ct.interconnect(
        [cdf.friction_mass(9, 5, name="a"), cdf.friction_mass(8, 5, name="b")],
        connections=[["b.F", "a.x"]], inplist=["a.F"], outlist=["b.x"], check_unused=False,
    )  # fmt: skip
    with pytest.raises(ValueError, match="'mass' is known to a and b"):
        cdf.batch_response(twice, T, 0, 0, {"mass": 9})


def test_what_does_not_fit_is_refused_with_the_size_that_would_do():
    with pytest.raises(ValueError, match=r"Give at most (\d+) runs") as no:
        _require_room(10**9, 2500, 2)
    most = int(re.search(r"at most (\d+) runs", str(no.value))[1])
    _require_room(most, 2500, 2)
    with pytest.raises(ValueError):
        _require_room(most + 1, 2500, 2)


def test_run_many_has_a_time_span_a_start_and_outputs_for_each_run():
    engine = Engine(cdf.friction_mass(9, 5, 0.5, 5.5))
    windows = [(0, 90), (30, 31), (100, 260), (259, 401)]
    first, last = np.array(windows).T
    x0 = np.random.default_rng(0).normal(size=(4, 2)) * [1e-3, 0.1]
    drives = sampled_drives(T, np.stack([U, 2 * U])[:, None], "zoh")
    which, steps = np.array([0, 1, 0, 1]), np.array([10**6, 10**6, 10**6, 1])
    group = Group(engine, engine.par, np.arange(4), np.zeros(4, int))
    runs = run_many(
        [group], x0, T[first], T[last - 1], T, drives, drive=which, first=first, count=last - first, order=5,
        rtol=1e-8, max_steps=steps, states=True, threads=2,
    )  # fmt: skip
    for i, (a, b) in enumerate(windows):
        drive = sampled_drive(T, (1 + which[i]) * U, "zoh")
        single = engine.run(
            engine.start(x0[i], T[a]), T[b - 1], drive, T[a:b], order=5, rtol=1e-8, log=1, max_steps=steps[i]
        )
        mine = slice(runs.rows.at[i], runs.rows.at[i] + runs.rows.count[i])
        assert runs.status[i] is single.status and runs.recorded[i] == single.recorded
        np.testing.assert_allclose(runs.outputs[mine], single.outputs, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(runs.states[mine], single.states, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(runs.x[i], single.state.x, rtol=1e-9, atol=1e-12)
    assert [s.ok for s in runs.status] == [True, True, True, False]


def test_runs_take_their_systems_in_any_order():
    block = PLAIN.with_effect(cdf.InputDelay(0.0))
    delays, windows = np.array([0.0, 2e-3, 0, 5e-3]), np.array([[0, 100], [100, 250]])
    system, window = np.repeat(np.arange(4), 2), np.tile(np.arange(2), 4)
    groups = assigned(groups_of("a test", block, {"input_delay.delay": delays}, 4), system)
    first, last = windows[window].T
    runs = run_many(
        groups, np.zeros((1, 3)), T[first], T[last - 1], T, sampled_drives(T, U[None, None], "zoh"),
        first=first, count=last - first,
    )  # fmt: skip
    for i in range(8):
        t, u = T[first[i] : last[i]], U[first[i] : last[i]]
        single = cdf.event_response(
            block, t, u, input_hold="zoh", params={"input_delay.delay": delays[system[i]]}
        )
        mine = runs.outputs[runs.rows.at[i] : runs.rows.at[i] + runs.rows.count[i]]
        np.testing.assert_allclose(mine, single.outputs.T, rtol=1e-9, atol=1e-12)


def test_run_many_under_waves():
    engine = Engine(PLAIN)
    amplitudes, omega = np.array([8.0, 20]), np.array([5.0, 30])
    drives = harmonic_drives(np.stack([[[0, a]] for a in amplitudes]), omega)
    group = Group(engine, engine.par, np.arange(2), np.zeros(2, int))
    runs = run_many([group], np.zeros((1, 2)), 0.0, T[-1], T, drives, drive=np.arange(2))
    for i in range(2):
        single = cdf.event_response(PLAIN, T, lambda t, i=i: amplitudes[i] * np.cos(omega[i] * t))
        mine = runs.outputs[runs.rows.at[i] :][: len(T)].T
        np.testing.assert_allclose(mine, single.outputs, rtol=1e-5, atol=1e-7)


def test_columns_are_numbers_side_by_side():
    a = Column(np.array([1.0, 2.0, 4.0]))
    np.testing.assert_array_equal((1 / a - 2 * (a + 1) / -a).values, [5.0, 3.5, 2.75])
    assert a > 0 and not a == 9 and abs(-a) >= 1 and np.float64(2) * a > 1
    with pytest.raises(Differs) as question:
        bool(a > 1)
    assert question.value.mask.tolist() == [False, True, True]
    for one_number in (float, np.sqrt, np.float64, lambda v: v * np.ones(3), lambda v: 2**v, hash):
        with pytest.raises(TypeError):
            one_number(a)
    with pytest.raises(ZeroDivisionError):
        1 / (a - 1)


def test_other_threads_of_python_go_on():
    block, beats = cdf.friction_mass(9, 5, 0.5, 5.5), []

    def runs(many):
        cdf.batch_response(block, np.arange(2500) * 1e-3, 9.0, np.zeros((many, 2)), threads=1)

    runs(1)  # machine code is read by one thread
    call = threading.Thread(target=runs, args=(2000,))
    call.start()
    while call.is_alive():
        beats.append(time.perf_counter())
        time.sleep(1e-3)
    # one that waits for the call beats at its two ends alone
    assert len(beats) > 3 and max(np.diff(beats)) < 0.5 * (beats[-1] - beats[0])


def test_answers_are_not_to_be_written():
    batch = cdf.batch_response(PLAIN, T, U, return_states=True)
    for values in (
        batch.time,
        batch.inputs,
        batch.outputs,
        batch.states,
        batch.end_times,
        batch.event_counts,
    ):
        with pytest.raises(ValueError, match="read-only"):
            values[...] = 0
    again = pickle.loads(pickle.dumps(batch))
    assert np.array_equal(again.outputs, batch.outputs)
