"""Measured tables N(A, omega): compared, refitted, diagnosed, climbed; from their own integrator."""

import functools

import matplotlib.pyplot as plt
import numpy as np
import pytest
import rig_physics as physics

import ctrl_df as cdf
from ctrl_df.identify.compare import compare
from ctrl_df.identify.datasets.choice import dataset_of
from ctrl_df.identify.diagnose import diagnose
from ctrl_df.identify.improve import improve
from ctrl_df.identify.refit import refit
from ctrl_df.identify.tables.compare import FrequencyComparison, scatter

TRUE = dict(MOTOR=9.0, COULOMB=5.0, VISCOUS=20.0)
A = np.geomspace(9.0, 60.0, 5)
OMEGA = np.geomspace(2.0, 40.0, 6)
MIDDLE = (tuple(np.geomspace(9.0, 60.0, 4)), tuple(np.geomspace(2.0, 40.0, 5)))
FEWEST = (tuple(np.geomspace(9.0, 60.0, 3)), tuple(np.geomspace(2.0, 40.0, 3)))
SMALL = (tuple(np.geomspace(9.0, 60.0, 3)), tuple(np.geomspace(2.0, 40.0, 4)))
FEW = ("quadratic_drag", "linear_spring", "input_delay", "sensor_delay", "stribeck")


def stepped_sine(numbers, amplitude, omega, periods=24, samples=200):
    """Return (Y1/A) exp(j phi) of the rigs' plant under ``A cos(omega t)``, held, `samples` a period.

    The position's fundamental is fitted together with its mean and drift over the last four periods.
    """
    dt = 2 * np.pi / omega / samples
    t = dt * np.arange(periods * samples)
    u = amplitude * np.cos(omega * (t + 0.5 * dt))
    y = physics.run(numbers, u, dt=dt, substeps=4)["y"][-4 * samples :]
    t = t[-4 * samples :]
    columns = np.column_stack([np.cos(omega * t), np.sin(omega * t), np.ones(len(t)), t - t[0]])
    (c, s, *_), *_ = np.linalg.lstsq(columns, y, rcond=None)
    # the staircase is centred on the cosine; its fundamental is less by sinc(1/samples)
    return (c - 1j * s) / (amplitude * np.sinc(1 / samples))


@functools.cache
def table(noise=0.003, seed=0, grid=(tuple(A), tuple(OMEGA)), **added):
    rng = np.random.default_rng(seed)
    numbers = physics.numbers(**TRUE, **added)
    clean = np.array([[stepped_sine(numbers, a, w) for w in grid[1]] for a in grid[0]])
    scatter = rng.standard_normal(clean.shape) + 1j * rng.standard_normal(clean.shape)
    return cdf.FrequencyMeasurement(*grid, clean * (1 + noise / np.sqrt(2) * scatter))


def user_block():
    """The model in use: the right structure, parameters 20 to 25 % off."""
    return cdf.friction_mass(mass=9 * 1.2, coulomb=5 * 0.8, viscous=20 * 1.25)


def true_block():
    return cdf.friction_mass(mass=9, coulomb=5, viscous=20)


def test_the_true_model_errs_by_the_scatter():
    found = compare(true_block(), table())
    assert isinstance(found, FrequencyComparison)
    assert found.nrmse == pytest.approx(0.003, rel=0.35)  # 30 points; seen 0.0031
    assert found.white and found.fit_percent > 99
    assert found.simulated.shape == found.residual.shape == (len(A), len(OMEGA))
    assert "errors of neighbours agree no more than by chance" in str(found)


def test_sixteen_points_tell_a_model_far_off_from_scatter():
    amplitudes, omega = np.geomspace(6, 40, 4), np.geomspace(2, 12, 4)
    true = cdf.friction_mass(2.2, 3, 6).with_effect(cdf.LinearSpring(40))
    N = cdf.describing_function_family(true, amplitudes, omega).N
    found = compare(cdf.friction_mass(2, 2.5, 5), cdf.FrequencyMeasurement(amplitudes, omega, N))
    # before, one direction at a time: p = 0.015 with a correlation of 0.97
    assert found.nrmse > 0.5 and not found.white


def test_a_wrong_model_errs_alike_at_neighbours_and_is_told_where():
    found = compare(true_block(), table(DRAG=60.0))
    assert not found.white
    worst = found.where.significant[0]
    # drag grows with the square of speed: large amplitudes at low frequency
    assert {r.kind for r in found.where.significant} <= {"amplitude", "frequency"}
    assert worst.sentence in found.where.sentences and worst.share > worst.expected_share
    low = found.where.of("frequency")[0]
    assert low.share > low.expected_share


def test_a_loop_is_compared_and_refitted_through_its_block():
    loop = cdf.closed_loop(cdf.pid(2000, 0, 130), user_block())
    assert compare(loop, table()).nrmse == compare(user_block(), table()).nrmse
    fitted = refit(loop, table())
    assert fitted.model.parts.block.parameters["mass"].value == pytest.approx(9, rel=0.01)


@pytest.mark.quick
def test_refit_finds_the_parameters_within_their_errors():
    fit = refit(user_block(), [table(), table(seed=1)])
    truth = {"mass": 9.0, "coulomb.level": 5.0, "viscous.coefficient": 20.0}
    assert fit.converged and set(fit.parameters) == set(truth)
    for name, value in truth.items():
        p = fit.parameters[name]
        assert p.identifiable and not p.at_bound
        assert abs(p.value - value) < 4 * p.standard_error  # worst seen 1.6
        assert p.standard_error < 0.02 * value
    assert fit.nrmse == pytest.approx(0.003, rel=0.35)
    assert "mass" in fit.report()


def test_what_leaves_no_trace_is_named():
    block = user_block().with_effect(cdf.SensorOffset(0.01))
    fit = refit(block, table())
    assert not fit.parameters["sensor_offset.offset"].identifiable
    assert any("sensor_offset.offset" in s for s in fit.unidentifiable)


@pytest.mark.parametrize(
    ("name", "added", "rivals"),
    [
        ("linear_spring", dict(SPRING=150.0), ("quadratic_drag", "input_delay")),
        ("input_delay", dict(DELAY=0.012), ("sensor_delay", "quadratic_drag")),
    ],
)
def test_a_hidden_effect_is_named_from_its_print(name, added, rivals):
    known = []
    found = diagnose(
        user_block(), table(grid=SMALL, **added), candidates=(name, *rivals), callback=known.append
    )
    assert known and {d.status for d in known} == {"under way"} and found.status == "complete"
    assert found.verdict == "effect", found.explanation
    assert found.best.determined and found.best.error_by_horizon is None
    # two delays are one map of such data
    alike = {"input_delay", "sensor_delay"} if name == "input_delay" else {name}
    assert {found.best.id, *found.best.equivalents} == alike
    assert found.best.nrmse_holdout < 0.006
    assert found.best.probability > 0.3 and found.best.evidence > 20
    value = next(iter(found.best.parameters.values()))
    assert value == pytest.approx(next(iter(added.values())), rel=0.05)  # worst seen 1 %
    assert name.replace("_", " ") in found.explanation
    assert found.best.effect in found.best.model.effects


@functools.cache
def lower(**added):
    """Return a table that reaches below breakaway: 0 where nothing moved."""
    forces = np.geomspace(4.5, 40.0, 6)
    numbers = physics.numbers(**TRUE, **added)
    N = np.array([[stepped_sine(numbers, a, w) for w in OMEGA] for a in forces])
    N[np.abs(N) < 1e-9 * np.abs(N).max()] = 0.0
    rng = np.random.default_rng(4)
    scatter = rng.standard_normal(N.shape) + 1j * rng.standard_normal(N.shape)
    return cdf.FrequencyMeasurement(forces, OMEGA, N * (1 + 0.003 / np.sqrt(2) * scatter))


def test_standing_still_is_told_by_zeros():
    data = lower(STATIC=8.5)
    assert np.count_nonzero(data.N == 0) == 2 * len(OMEGA)
    found = diagnose(user_block(), data, candidates=("stiction", "quadratic_drag"))
    assert found.best is not None and found.best.id == "stiction"
    # 8.5 lies between the largest force that moved nothing and the least that did
    assert data.A[1] < found.best.parameters["level"] < data.A[2]
    drawn = compare(found.best.model, data).plot()
    plt.close(drawn.figure)


def test_a_gap_is_named_although_one_point_is_of_another_motion():
    grid = MIDDLE[0], tuple(OMEGA)
    data = table(grid=grid, JOINT=physics.IMPACT, LOAD=4.0, GAP=2e-3, RESTITUTION=0.3)
    N = np.array(data.N)
    N[2, 4] *= 1.8 - 0.9j
    spoilt = cdf.FrequencyMeasurement(*grid, N)
    found = diagnose(user_block(), spoilt, candidates=("backlash",))
    assert found.verdict == "effect" and found.best.id == "backlash", found.explanation
    assert found.best.parameters["gap"] == pytest.approx(2e-3, rel=0.1)
    assert "of 24 points err" in found.explanation


def test_nothing_hidden_is_none():
    found = diagnose(user_block(), table(seed=3), candidates=FEW[:1])
    assert found.verdict == "none" and found.best is None
    assert "Nothing is missing" in found.explanation
    assert found.next_experiment is None


@pytest.mark.parametrize("grid", [FEWEST, MIDDLE])
def test_outside_the_candidates_is_unknown(grid):
    """Of 58 % error few frequencies tell nothing by their neighbours; amplitudes do, and so does its size."""
    data = table(grid=grid, SPRING=150.0)
    found = diagnose(user_block(), data, candidates=("input_delay", "input_gain"))
    assert found.verdict == "unknown" and "outside the library" in found.explanation
    if grid is MIDDLE:
        assert "frequencies" in found.explanation
    else:
        assert "explains nothing" in found.explanation


def test_a_table_held_out():
    data, held = (table(grid=SMALL, DRAG=60.0, seed=seed) for seed in (0, 9))
    found = diagnose(user_block(), data, holdout=held, candidates=("quadratic_drag", "stribeck"))
    assert found.verdict == "effect" and found.best.id == "quadratic_drag" and found.best.determined
    assert found.best.parameters["coefficient"] == pytest.approx(60.0, rel=0.05)
    assert found.best.nrmse_holdout < 0.006 and not found.best.equivalents
    assert found.holdout[0] is held
    drawn = found.plot()
    assert drawn.axes.size == 3 and "quadratic drag" in drawn.axes.flat[2].get_title()
    plt.close(drawn.figure)


def test_a_ladder_ends_where_points_are_too_few_for_another_parameter():
    grid = ((9.0, 60.0), (2.0, 40.0))
    study = improve(user_block(), table(grid=grid, SPRING=150.0), candidates=("linear_spring",))
    assert study.verdict == "unknown"
    assert "Linear spring was not added: a diagnosis needs more points" in str(study)


def test_two_effects_are_climbed():
    study = improve(user_block(), table(grid=FEWEST, DRAG=60.0, SPRING=150.0), candidates=FEW[:2])
    assert set(study.effects) == {"quadratic_drag", "linear_spring"}
    assert study.verdict == "effect"
    assert study.steps[-1].nrmse_holdout < 0.006
    assert study.steps[0].nrmse_holdout > 10 * study.steps[-1].nrmse_holdout


def test_a_picture_of_a_comparison():
    drawn = compare(user_block(), table(DRAG=60.0)).plot()
    assert drawn.axes.size == 3
    assert len(drawn.lines[0]) == len(drawn.lines[1]) == len(A)
    plt.close(drawn.figure)


def test_scatter_test_keeps_its_level():
    rng = np.random.default_rng(5)
    tables = [[rng.standard_normal((5, 6)) + 1j * rng.standard_normal((5, 6))] for _ in range(400)]
    alarms = np.mean([not scatter(e) for e in tables])
    assert alarms < 0.03  # level 0.01; seen 0.010


def test_stated_noise_weighs_points():
    poor = table()
    spoilt = np.array(poor.N)
    spoilt[0] *= 1.3  # one amplitude measured badly, and said so
    noise = np.full(spoilt.shape, 0.003)
    noise[0] = 0.3
    fit = refit(user_block(), cdf.FrequencyMeasurement(A, OMEGA, spoilt, noise=noise))
    assert fit.parameters["mass"].value == pytest.approx(9, rel=0.005)
    without = refit(user_block(), cdf.FrequencyMeasurement(A, OMEGA, spoilt))
    assert abs(without.parameters["mass"].value - 9) > 0.05


def test_errors_are_clear():
    with pytest.raises(ValueError, match="noise > 0"):
        cdf.FrequencyMeasurement([1.0], [1.0], [[1j]], noise=0.0)
    with pytest.raises(ValueError, match="noise as one number"):
        cdf.FrequencyMeasurement([1.0], [1.0, 2.0], [[1j, 1j]], noise=[1.0, 2.0, 3.0])
    t = np.linspace(0, 1, 100)
    mixed = [table(), cdf.Measurement(t, np.sin(t), t**2)]
    with pytest.raises(TypeError, match="tables only"):
        diagnose(user_block(), mixed)
    with pytest.raises(ValueError, match="more points than parameters"):
        diagnose(user_block(), cdf.FrequencyMeasurement([10.0], [1.0, 2.0], [[1j, 1j]]))


def test_a_spring_with_its_resonance_on_the_table_is_found():
    """Errors of N have a resonance between start and truth; a balance of forces has none."""
    axis, A, w = cdf.friction_mass(9, 5, 0.5), np.geomspace(6, 50, 4), np.geomspace(3, 20, 6)
    N = cdf.describing_function_family(axis.with_effect(cdf.LinearSpring(200.0)), A, w).N
    noise = 1 + 3e-3 * np.random.default_rng(0).standard_normal(N.shape)
    table = cdf.FrequencyMeasurement(A, w, N * noise)
    found = diagnose(axis, table, candidates=["linear_spring", "viscous"])
    assert found.verdict == "effect" and found.best.id == "linear_spring"
    assert found.best.parameters["stiffness"] == pytest.approx(200, rel=2e-3)


def test_what_was_screened_is_known_of_a_search_over_tables():
    data = dataset_of(user_block(), table(grid=SMALL, SPRING=150.0))
    search = data.search(user_block(), data.free_parameters(user_block()))
    after, found = search.candidates([cdf.LinearSpring, cdf.QuadraticDrag])
    assert [t.key for t in after.screened] == [t.key for t in found] and not search.screened
    with pytest.raises(AttributeError, match="first_look"):
        search.after(first_look=found)
