"""Parameters that every one of several records has for itself: refitted, judged, estimated on others."""

import pickle
from types import SimpleNamespace

import numpy as np
import pytest

import ctrl_df as cdf
from ctrl_df.identify.data.as_data import distinguished
from ctrl_df.identify.estimation.own_values import OwnValue
from ctrl_df.identify.estimation.refit_records import doubts, undetermined
from ctrl_df.identify.prediction.segments import make_segments
from ctrl_df.identify.prediction.values import for_record, with_own, with_values
from ctrl_df.identify.shooting.least_squares import Stage
from ctrl_df.identify.shooting.problem import Problem
from ctrl_df.values.per_record import PerRecord

START = cdf.friction_mass(2.0, 2.5, 5.0).with_effect(cdf.ConstantForce(0.0))
OWN = {"viscous.coefficient": (4.0, 6.0, 9.0), "constant_force.force": (0.5, -1.0, 1.5)}
NAMES = ("cold", "usual", "warm")


def recorded(machines, noise=1e-4, seconds=4.0, names=NAMES):
    """Return a record of each machine, under forces of its own."""
    rng, t, records = np.random.default_rng(8), np.arange(0, seconds, 0.01), []
    for i, (machine, name) in enumerate(zip(machines, names, strict=False)):
        force = 9 * np.sin(3 * t + i) + 5 * np.sin(8 * t + 2 * i)
        x = np.asarray(cdf.event_response(machine, t, force, input_hold="zoh").outputs)[0]
        records.append(cdf.Measurement(t, force, x + noise * rng.standard_normal(t.size), name=name))
    return records


def machines(*effects):
    """Return three machines that differ in what `OWN` names."""
    rows = zip(*OWN.values(), strict=True)
    made = [cdf.friction_mass(2.2, 3.0, b).with_effect(cdf.ConstantForce(f)) for b, f in rows]
    for effect in effects:
        made = [m.with_effect(effect) for m in made]
    return made


@pytest.fixture(scope="module")
def records():
    return recorded(machines())


@pytest.fixture(scope="module")
def fit(records):
    return cdf.refit(START, records, own=["viscous", "constant_force"])


# --- refit ----------------------------------------------------------------------------------------


def test_refit_finds_shared_and_own_values(fit):
    assert set(fit.parameters) == {"mass", "coulomb.level"} and fit.covariance.shape == (2, 2)
    pulls = [(fit.parameters[k].value - v) / fit.parameters[k].standard_error for k, v in SHARED.items()]
    for name, truth in OWN.items():
        assert tuple(fit.own[name]) == NAMES
        found = fit.own[name].values()
        pulls += [(p.value - v) / p.standard_error for p, v in zip(found, truth, strict=True)]
        assert all(p.identifiable and not p.at_bound and p.name == name for p in found)
        assert all(p.standard_error < 5e-3 for p in found)  # 1e-3 at most
    assert np.max(np.abs(pulls)) < 3.5  # eight values
    assert fit.comparison.white


SHARED = {"mass": 2.2, "coulomb.level": 3.0}


def test_the_comparison_takes_each_records_own_values(fit, records):
    assert cdf.compare(fit.model, records).nrmse == pytest.approx(fit.nrmse, rel=1e-3)
    for r in records:
        assert cdf.compare(fit.model_of(r), r).nrmse == pytest.approx(cdf.compare(fit.model, r).nrmse)
    # a record of another name: the mean of all
    with pytest.warns(UserWarning, match="of viscous.coefficient and constant_force.force, and none for ano"):
        other = cdf.compare(fit.model, records[0].replaced(name="another")).nrmse
    assert other > 20 * cdf.compare(fit.model, records[0]).nrmse


def test_the_model_shows_the_mean_and_knows_the_records(fit):
    name = "viscous.coefficient"
    values = [p.value for p in fit.own[name].values()]
    precisions = [p.standard_error**-2 for p in fit.own[name].values()]
    assert fit.model.parameters[name].value == pytest.approx(np.average(values, weights=precisions))
    for record, value in zip(NAMES, values, strict=True):
        assert fit.model_of(record).parameters[name].value == value
    with pytest.raises(ValueError, match=r"model_of needs record out of cold, usual, warm; got 'hot'"):
        fit.model_of("hot")
    one = fit.model.with_parameters({name: 5.0})  # shared again
    assert for_record(one, "cold").parameters[name].value == 5.0


def test_the_table_has_them(fit):
    lines = str(fit).split("\n")
    at = lines.index("viscous.coefficient, of each record:")
    assert [line.split()[0] for line in lines[at + 1 : at + 4]] == list(NAMES)
    assert "±" in lines[at + 1] and "N s/m" in lines[at + 1]


def test_derivatives_cost_no_more_than_of_shared_parameters(records):
    names, stages = tuple(START.parameters), []
    for model in (START, with_own(START, OWN)):
        problem = Problem(model, records, names, 1000)
        stage = Stage(problem, [make_segments(r, 1.0) for r in records], 1)
        theta = problem.start()
        base = stage.simulate(theta, stage.initial_states.values)
        before = problem.nfev
        slopes = stage.jacobian(theta, stage.initial_states, base)
        stages.append((problem, stage, slopes, problem.nfev - before, base))
    (_, _, shared, cost, _), (problem, stage, own, same, base) = stages
    assert same == cost
    assert len(problem.variables) == 2 + 2 * 3
    for a, b in zip(shared[0], own[0], strict=True):  # at one point they are the same, record by record
        np.testing.assert_array_equal(a, b)
    residual = [m - y for m, y in zip(stage.measured, base, strict=True)]
    products = stage.products(*own, residual, [np.ones(len(r)) for r in residual])
    h, g, back = stage.normal(products, stage.initial_states)
    apart = h[2:5, 2:5]  # of the viscous coefficients
    np.testing.assert_array_equal(apart - np.diag(np.diag(apart)), 0)
    assert np.all(np.diag(apart) > 0) and np.all(h[0, 2:5] != 0) and len(g) == 8
    step = np.zeros(8)
    step[2] = 1e-3  # in the first record alone states follow
    moved = [np.any(a != b) for a, b in zip(back(step).values, back(0 * step).values, strict=True)]
    assert moved == [True, False, False]


def test_with_one_record_own_is_free(records):
    own = cdf.refit(START, records[0], own=["viscous"])
    free = cdf.refit(START, records[0])
    assert own.parameters == free.parameters and not own.own
    assert own.model == free.model


def test_own_names_are_moved_whatever_is_free(records):
    for free in (["viscous", "mass"], ["mass"]):
        brief = [r.slice(0, 2) for r in records[:2]]
        fit = cdf.refit(START, brief, free=free, own=["viscous"], mode="windows", window=0.5)
        assert tuple(fit.parameters) == ("mass",) and tuple(fit.own) == ("viscous.coefficient",)
        assert fit.model.parameters["coulomb.level"].value == 2.5


def test_records_of_one_name_are_numbered(records):
    same = [r.slice(0, 2).replaced(name="run") for r in records[:2]]
    fit = cdf.refit(START, same, free=["mass"], own=["constant_force"], mode="windows", window=0.5)
    assert list(fit.own["constant_force.force"]) == ["run 1", "run 2"]


def test_numbers_are_those_that_no_name_has(records):
    names = [
        [r.replaced(name=name) for r, name in zip(records, ("a", "a", last), strict=True)]
        for last in ("a 1", "b")
    ]
    assert [[r.name for r in distinguished(tuple(rs))] for rs in names] == [
        ["a 2", "a 3", "a 1"],
        ["a 1", "a 2", "b"],
    ]


@pytest.fixture(scope="module")
def unnamed(records):
    """Return records without names of their own."""
    return [cdf.Measurement(r.t[:200], r.u[:200], r.y[:200]) for r in records]


BRIEFLY = {"mode": "windows", "window": 0.5}


@pytest.fixture(scope="module")
def fit_of_unnamed(unnamed):
    return cdf.refit(START, unnamed[:2], own=["viscous", "constant_force"], **BRIEFLY)


def test_records_without_names_are_known_by_their_data(fit_of_unnamed, unnamed):
    a, b, _ = unnamed
    model, name = fit_of_unnamed.model, "viscous.coefficient"
    values = [p.value for p in fit_of_unnamed.own[name].values()]
    assert list(fit_of_unnamed.own[name]) == ["measurement 1", "measurement 2"]
    numbered = [r.record for r in fit_of_unnamed.comparison.records]
    again = pickle.loads(pickle.dumps(a))
    for record, i in ((a, 0), (b, 1), (again, 0), (numbered[1], 1), (b.slice(0, 1), 1), ("measurement 2", 1)):
        assert fit_of_unnamed.model_of(record).parameters[name].value == values[i]
    for given in ([b, a], numbered[1]):
        assert cdf.compare(model, given, **BRIEFLY).nrmse < 2e-3  # 1e-3 at most


def test_strangers_get_the_mean_and_a_warning(fit_of_unnamed, unnamed):
    c = unnamed[2]
    usual = fit_of_unnamed.model.with_parameters(
        {k: float(fit_of_unnamed.model.parameters[k].value) for k in OWN}
    )
    expected = cdf.compare(usual, c, **BRIEFLY).nrmse
    for name in ("measurement", "measurement 1"):  # as one of the fit is called, by its number alone
        stranger = cdf.Measurement(c.t, c.u, c.y, name=name)
        with pytest.warns(UserWarning, match=f"none for {name}: the mean .* Give every record a name"):
            assert cdf.compare(fit_of_unnamed.model, stranger, **BRIEFLY).nrmse == pytest.approx(expected)
        with pytest.raises(ValueError, match="model_of needs"):
            fit_of_unnamed.model_of(stranger)
    with pytest.warns(UserWarning, match="none for measurement: the mean"):
        cdf.refit(fit_of_unnamed.model, c, free=["mass"], **BRIEFLY)


def test_parts_of_one_run_are_told_apart(records):
    run = records[0]
    parts = [run.slice(0, 2), run.slice(2, 4)]
    for given in (parts, [cdf.Measurement(r.t, r.u, r.y) for r in parts]):
        first, second = distinguished(tuple(given))
        value = PerRecord.over({first.name: 1.0, second.name: 2.0})
        other, one = distinguished(tuple(given[::-1]))
        assert [value.of(r.name) for r in (first, second, one, other)] == [1.0, 2.0, 1.0, 2.0]
        assert value.knows(run.name) is False


def test_a_static_level_stays_above_each_records_kinetic_one():
    block = cdf.friction_mass(2.0, 3.0, 1.0, static=4.0)
    block = block.with_parameters({"coulomb.level": PerRecord(3.5, {"dry": 5.0, "oiled": 2.0})})
    assert for_record(block, "dry").parameters["stiction.level"].value == 5.0
    assert for_record(block, "oiled").parameters["stiction.level"].value == 4.0


STATIC = cdf.friction_mass(2.0, 3.0, 1.0, static=5.0)


def test_a_shared_static_level_is_raised_in_records_alone(records):
    pair = [r.replaced(name=name) for r, name in zip(records, ("oiled", "dry"), strict=False)]
    names = ("coulomb.level", "stiction.level")
    problem = Problem(with_own(STATIC, names[:1]), pair, names, 1000)
    theta = problem.start()

    def found(*levels):
        theta[:3] = [v.q(x) for v, x in zip(problem.variables, levels, strict=True)]
        model = problem.model_at(theta)
        for k, r in enumerate(pair):  # every record gets what was fitted to it
            table, used = for_record(model, r.name).parameters, problem.values(theta, k)
            assert [table[n].value for n in names] == pytest.approx([used[n] for n in names])
        return model.parameters["stiction.level"].value

    level = found(2.0, 6.5, 5.0)
    assert level == pytest.approx(5.0) and not isinstance(level, PerRecord)
    level = found(6.0, 6.5, 5.0)  # in both
    assert [level.of(k) for k in ("oiled", "dry")] == pytest.approx([6.0, 6.5])
    level = found(2.0, 9.0, 5.0)  # below that of a record not known it cannot stay
    assert [level.of(k) for k in ("oiled", "dry")] == pytest.approx([5.0, 9.0])
    # held, it is raised in the records alone as well, and no longer where the kinetic one came down
    begun = STATIC.with_parameters({"coulomb.level": PerRecord(3.0, {"oiled": 2.0, "dry": 6.0})})
    held = Problem(begun, pair, names[:1], 1000)
    theta = np.array([v.q(x) for v, x in zip(held.variables, (2.0, 5.5), strict=True)])
    assert held.values(theta, 1)["stiction.level"] == pytest.approx(5.5)
    assert not isinstance(held.model_at(theta).parameters["stiction.level"].value, PerRecord)


def test_own_static_levels_stay_own_where_the_mean_is_raised():
    block = with_values(
        with_own(STATIC, ["stiction.level"]), {"stiction.level": PerRecord(4.0, {"a": 3.5, "b": 4.5})}
    )
    level = with_values(block, {"coulomb.level": 4.2}).parameters["stiction.level"].value
    assert (
        level == 4.2
        and level.of("a") == 3.5
        and for_record(block, "b").parameters["stiction.level"].value == 4.5
    )


def test_a_weak_record_does_not_condemn_the_name():
    block = cdf.friction_mass(2.2, 0.01, 6.0).with_effect(cdf.CubicSpring(20.0))
    large, small = recorded([block, block], seconds=3.0, names=("large", "small"))
    t, rng = small.t, np.random.default_rng(2)
    x = np.asarray(cdf.event_response(block, t, 0.01 * small.u, input_hold="zoh").outputs)[0]
    small = cdf.Measurement(t, 0.01 * small.u, x + 1e-4 * rng.standard_normal(t.size), name="small")
    start = block.with_parameters({"cubic_spring.stiffness": 15.0})
    free = ["mass", "viscous"]
    fit = cdf.refit(start, [large, small], free, own="cubic_spring")
    values = fit.own["cubic_spring.stiffness"]
    assert [p.identifiable for p in values.values()] == [True, False]
    assert fit.unidentifiable == ("cubic_spring.stiffness is not determined by small.",)
    assert fit.model.parameters["cubic_spring.stiffness"].value == pytest.approx(20.0, abs=0.01)


def test_directions_are_told_by_record():
    own = {"k": {r: OwnValue(1.0, 9.0, False, r == "c") for r in "abc"}}
    null = [
        (0.0, [("k", "a", 1.0), ("k", "b", 0.5)]),
        (0.0, [("k", "b", 1.0)]),
        (0.0, [("m", None, 1.0), ("k", "a", -0.4)]),
    ]
    fit = SimpleNamespace(
        names=("m", "k"), values=(1.0, 1.0), covariance=np.eye(2), scale=(2.0, 2.0), null=null, own=own
    )
    told = doubts(fit)
    assert told[0].startswith(
        "m and k of a cannot be distinguished on these data: raising m while lowering k of a"
    )
    assert told[1] == "k of a and b has no influence on these data, which do not tell its value."
    assert len(told) == 2 and undetermined(fit) == {"m"}
    own["k"]["c"] = own["k"]["a"]
    fit.null = [(0.0, [("k", r, 1.0)]) for r in "abc"]
    assert doubts(fit) == ("k has no influence on these data, which do not tell its value.",)
    assert undetermined(fit) == {"k"}


def test_unknown_names_and_tables_are_refused(records):
    with pytest.raises(ValueError, match=r"own needs names out of mass, .*; got 'viscus'"):
        cdf.refit(START, records, own="viscus")
    table = cdf.FrequencyMeasurement([9.0, 12.0], [5.0, 9.0], np.full((2, 2), -2e-3 - 1e-3j))
    for ask in (cdf.refit, cdf.diagnose, cdf.improve):
        with pytest.raises(ValueError, match=r"own needs records over time; got tables .* Leave own out"):
            ask(cdf.friction_mass(2.0, 2.5, 5.0), table, own="viscous")


def test_loops_are_refitted_so_as_well():
    controller, t, rng = cdf.pid(400.0, 200.0, 40.0), np.arange(0, 3, 0.01), np.random.default_rng(3)
    records = []
    for i, viscous in enumerate((4.0, 8.0)):
        reference = 0.1 * np.sin(3 * t) + 0.05 * np.sin(7 * t + i)
        loop = cdf.closed_loop(controller, cdf.friction_mass(2.2, 3.0, viscous))
        x = np.asarray(cdf.event_response(loop, t, reference).outputs)[0]
        noisy = x + 1e-5 * rng.standard_normal(t.size)
        records.append(
            cdf.Measurement(t, reference, noisy, name=f"loop {i}", input_unit="m", input_hold="linear")
        )
    loop = cdf.closed_loop(controller, cdf.friction_mass(2.0, 2.5, 5.0))
    fit = cdf.refit(loop, records, own="viscous")
    found = fit.own["viscous.coefficient"]
    assert [found[r.name].value for r in records] == pytest.approx([4.0, 8.0], rel=0.03)
    assert fit.model_of("loop 1").parts.block.parameters["viscous.coefficient"].value > 7


# --- ripples --------------------------------------------------------------------------------------

PHASES = (0.3, 2.5, -1.4)


@pytest.fixture(scope="module")
def rippled():
    ripples = [cdf.PositionRipple(1.5, wavelength=0.12, phase=p) for p in PHASES]
    return recorded([cdf.friction_mass(2.2, 3.0, 6.0).with_effect(r) for r in ripples], seconds=4.0)


def test_phases_are_of_each_record(rippled):
    fit = cdf.refit(cdf.friction_mass(2.0, 2.5, 5.0).with_effect(cdf.PositionRipple(1.2, 0.12)), rippled)
    phases = fit.own["position_ripple.phase"]
    for record, truth in zip(NAMES, PHASES, strict=True):
        p = phases[record]
        assert abs(p.value - truth) < 4 * p.standard_error < 0.03
    assert fit.parameters["position_ripple.wavelength"].value == pytest.approx(0.12, rel=1e-3)


def test_a_ripple_is_found_whatever_its_phases(rippled):
    names = ["position_ripple", "constant_force"]
    found = cdf.diagnose(cdf.friction_mass(2.0, 2.5, 5.0), rippled[:2], candidates=names)
    assert found.verdict == "effect" and found.best.id == "position_ripple"
    table = found.best.model.parameters
    for record, truth in zip(NAMES[:2], PHASES[:2], strict=True):
        assert table["position_ripple.phase"].value.of(record) == pytest.approx(truth, abs=0.03)


# --- diagnose -------------------------------------------------------------------------------------


def test_own_parameters_are_refitted_and_estimated_anew_on_records_held_out():
    *train, last = recorded(machines(cdf.QuadraticDrag(4.0)))
    names = ["quadratic_drag", "linear_spring"]
    found = cdf.diagnose(START, train, holdout=last, candidates=names, own=["viscous", "constant_force"])
    assert found.verdict == "effect" and found.best.id == "quadratic_drag"
    assert found.best.parameters["coefficient"] == pytest.approx(4.0, rel=0.02)
    assert found.best.nrmse_holdout < 2 * found.best.nrmse  # its viscous friction is another one
    table = found.best.model.parameters
    for name, truth in OWN.items():
        assert [table[name].value.of(r) for r in NAMES[:2]] == pytest.approx(truth[:2], abs=0.05)


def test_the_model_of_a_ladder_knows_what_records_held_out_have():
    *train, last = recorded(machines(cdf.QuadraticDrag(4.0)))
    names = ["quadratic_drag"]
    study = cdf.improve(START, train[:1], last, 1, candidates=names, own=["viscous", "constant_force"])
    assert study.effects == ("quadratic_drag",)
    assert study.summary().count(", of each record:") == 2
    table = study.model.parameters
    for name, truth in OWN.items():
        assert table[name].value == table[name].value.of(NAMES[0])
        assert [table[name].value.of(r) for r in (NAMES[0], NAMES[2])] == pytest.approx(truth[::2], abs=0.05)
    # no warning: with these the error is the one the ladder tells
    beside = cdf.compare(study.model, last)
    assert beside.rmse < 1.1 * cdf.compare(study.model, train[0]).rmse  # of the same noise


# --- the number -----------------------------------------------------------------------------------


def test_a_number_of_each_record_is_a_number():
    value = PerRecord.over({"a": 1.0, "b": 3.0})
    assert value == 2.0 and value.of("b") == 3.0 and value.of("c") == 2.0
    assert value != PerRecord.over({"a": 2.0, "b": 2.0})
    again = pickle.loads(pickle.dumps(value))
    assert again == value and dict(again.values) == dict(value.values)
    # angles are within half a turn, and their mean is a direction
    turned = PerRecord.over({"a": np.pi - 0.1, "b": np.pi + 0.3}, angle=True)
    assert turned.of("b") == pytest.approx(0.3 - np.pi) and turned == pytest.approx(0.1 - np.pi)


def test_a_ripple_is_found_beside_what_the_record_held_out_has_for_itself():
    """Its angle was settled with the friction of other records: 19 times the noise, `unknown`."""
    rng, t, records = np.random.default_rng(40), 4e-3 * np.arange(1000), []
    ripple = cdf.PositionRipple(0.9, wavelength=0.05, phase=1.0)
    for k, level in enumerate((12.0, 7.0, 8.0)):
        machine = cdf.friction_mass(4.0, level, 10.0).with_effect(ripple)
        force = sum(
            9 * np.sin(w * t + p) for w, p in zip((2, 5, 11, 17, 29), rng.uniform(0, 6.28, 5), strict=True)
        )
        x = np.asarray(cdf.event_response(machine, t, force, input_hold="zoh").outputs)[0]
        records.append(cdf.Measurement(t, force, x + 2e-5 * rng.standard_normal(t.size), name=f"run {k}"))
    *train, held = records
    few, model = ["position_ripple"], cdf.friction_mass(5, 10, 7)
    found = cdf.diagnose(model, train, holdout=held, candidates=few, own=["coulomb"])
    assert found.verdict == "effect" and found.best.effect.amplitude == pytest.approx(0.9, rel=0.01)
    assert found.best.nrmse_holdout * np.std(held.y) < 2 * 2e-5  # measured 1.0 times the noise
