"""Maps over gains, tuning and the explorer: against closed forms, single predictions and simulations."""

import control as ct
import matplotlib.pyplot as plt
import numpy as np
import pytest
from legible import illegible

import ctrl_df as cdf
from ctrl_df.gains.border import Border, distinct, refined, spread_points

FRICTION = cdf.friction_mass(9, 5, 0.5)
STICTION = cdf.friction_mass(9, 5, 0.5, static=5.5)
DRIVE = cdf.backlash_masses(1, 8, 0.018, restitution=0.2)
LAG = ct.tf([1], [1, 2, 2, 1])  # critical gain 3 at sqrt(2) rad/s


@pytest.fixture(scope="module")
def hunting():
    return cdf.limit_cycle_map(STICTION, kp=(500, 4000), ki=(0, 80000), kd=130, n=10, exact_check=16)


def _predicted(block, kp, ki, kd, A, omega):
    found = cdf.describing_function_response(cdf.pid(kp, ki, kd), block, A, omega).limit_cycles
    return sorted((c.amplitude, c.omega, c.stable) for c in found)


# --- predicted ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("free", "gains"),
    [
        (("kp", "ki"), {"kp": 2000, "ki": 44250, "kd": 130}),
        (("ki", "kd"), {"kp": 2000, "ki": 40000, "kd": 120}),
        (("kp", "kd"), {"kp": 2500, "ki": 50000, "kd": 100}),
    ],
)
def test_a_point_of_the_map_is_the_single_prediction(free, gains):
    box = {name: (0.2 * v, 2 * v) if name in free else v for name, v in gains.items()}
    at = cdf.limit_cycle_map(FRICTION, **box, n=8, exact_check=0).at(**{name: gains[name] for name in free})
    single = _predicted(FRICTION, **gains, A=np.geomspace(5.01, 2000, 120), omega=[2, 80])
    assert len(single) == len(at.cycles) == 2
    for cycle, (amplitude, omega, stable) in zip(at.cycles, single, strict=True):
        assert cycle.amplitude == pytest.approx(amplitude, rel=1e-7)
        assert cycle.omega == pytest.approx(omega, rel=1e-7)
        assert cycle.stable == stable


@pytest.mark.parametrize("fixed", ["kp", "ki", "kd"])
def test_the_linear_border_is_that_of_the_cubic(fixed):
    box = {"kp": (500, 4000), "ki": (1000, 80000), "kd": (20, 300)} | {
        fixed: {"kp": 2000, "ki": 30000, "kd": 130}[fixed]
    }
    found = cdf.limit_cycle_map(FRICTION, **box, n=6, exact_check=0)
    assert found.linear_border
    for curve in found.linear_border:
        every = found.box.every(curve[:, 0], curve[:, 1])
        # m s^3 + (B + kd) s^2 + kp s + ki: Routh
        np.testing.assert_allclose(9 * every["ki"], (every["kd"] + 0.5) * every["kp"], rtol=2e-3)


@pytest.mark.quick
def test_across_a_fold_two_cycles_vanish():
    found = cdf.limit_cycle_map(FRICTION, kp=(500, 4000), ki=(0, 80000), kd=130, n=10, exact_check=0)
    (fold,) = found.folds
    assert len(fold) > 20
    for kp, ki, *_ in fold[5:-5:8]:
        if 520 < kp < 3900 and ki < 78000:
            counts = [len(found.at(kp=kp, ki=ki * f).cycles) for f in (0.99, 1.01)]
            assert sorted(counts) == [0, 2]


def test_units_alter_nothing():
    scale = 1e-6  # of force; of length 1e3
    block = cdf.friction_mass(9 * scale / 1e3, 5 * scale, 0.5 * scale / 1e3)
    one = cdf.limit_cycle_map(FRICTION, kp=(500, 4000), ki=(0, 80000), kd=130, n=8, exact_check=0)
    k = scale / 1e3
    other = cdf.limit_cycle_map(
        block, kp=(500 * k, 4000 * k), ki=(0, 80000 * k), kd=130 * k, n=8, exact_check=0
    )
    assert (one.verdict == other.verdict).all()
    np.testing.assert_allclose(other.omega, one.omega, rtol=1e-6)
    np.testing.assert_allclose(other.amplitude, one.amplitude * scale, rtol=1e-6)


def test_a_saturation_cycles_above_the_critical_gain():
    critical, plant = 4.0, 0.75 * LAG
    found = cdf.limit_cycle_map(
        cdf.saturation(1), kp=(0.5 * critical, 3 * critical), ki=(0.0, 0.02), plant=plant, n=9, exact_check=0
    )
    assert found.at(kp=0.9 * critical, ki=0.0).verdict == "rests"
    assert found.at(kp=2 * critical, ki=0.0).verdict == "cycles"
    cycle = found.at(kp=8 / 3 * critical, ki=0.0).cycles[0]
    assert cycle.amplitude == pytest.approx(3.343998730, rel=1e-6) and cycle.omega == pytest.approx(
        np.sqrt(2)
    )


@pytest.mark.parametrize(
    ("element", "plant", "checks"),
    [
        (cdf.relay(1.0), LAG, 0),
        (cdf.dead_zone(0.5), LAG, 0),
        (cdf.relay_with_hysteresis(1.0, 0.1), LAG, 8),
        (cdf.play(0.2), ct.tf([1], [1, 1, 0]), 0),
    ],
    ids=["relay", "dead zone", "hysteresis", "play"],
)
def test_elements_have_maps_as_well(element, plant, checks):
    found = cdf.limit_cycle_map(
        element, kp=(0.5, 12), ki=(0.0, 0.5), plant=plant, tf=0.05, n=6, exact_check=checks
    )
    assert found.verdict.shape == (6, 6) and not (found.verdict == "undecided").any()
    assert len(found.checks) == checks


def test_a_block_without_closed_form_has_a_map():
    block = (
        cdf.Mass(9)
        .with_effect(cdf.Coulomb(5))
        .with_effect(cdf.Viscous(0.5))
        .with_effect(cdf.QuadraticDrag(0.1))
    )
    found = cdf.limit_cycle_map(block, kp=(1000, 3000), ki=(10000, 60000), kd=130, n=5, exact_check=0)
    plain = cdf.limit_cycle_map(FRICTION, kp=(1000, 3000), ki=(10000, 60000), kd=130, n=5, exact_check=0)
    same = np.isfinite(found.omega) & np.isfinite(plain.omega)
    assert same.sum() >= 3
    np.testing.assert_allclose(found.omega[same], plain.omega[same], rtol=0.05)


# --- checked ------------------------------------------------------------------------------------------------


def test_simulations_correct_the_map(hunting):
    assert len(hunting.checks) == 16 and 0 <= hunting.agreement < 1
    assert "cycles" in hunting.at(kp=3000, ki=30000).verdict
    assert hunting.at(kp=700, ki=75000).verdict == "diverges"
    assert hunting.at(kp=2000, ki=44250, exact=True).simulated.orbit.omega == pytest.approx(
        11.62868, rel=1e-6
    )
    plain = cdf.limit_cycle_map(FRICTION, kp=(500, 4000), ki=(0, 80000), kd=130, n=8, exact_check=8)
    assert (np.char.find(plain.predicted, "cycles") >= 0).any()
    assert not (np.char.find(plain.verdict, "cycles") >= 0).any()


def test_the_map_shows_itself(hunting):
    assert len(repr(hunting)) < 200 and "\n" not in repr(hunting)
    assert "16 points were simulated" in hunting.summary() and "simulated" in str(hunting.table())
    frame = hunting.to_pandas()
    assert len(frame) == 100 and set(frame) >= {"kp", "ki", "kd", "verdict", "predicted", "omega"}
    assert "<table" in hunting._repr_html_()
    assert hunting.units == {"kp": "N/m", "ki": "N/(m s)", "kd": "N s/m"}


def test_a_border_is_closed_in_on():
    def inside(points):
        return (np.hypot(*(points - 0.4).T) < 0.3)[:, None]

    def nothing(points):
        return np.zeros(len(points), bool)

    border = refined(spread_points(20, 0), 80, inside, nothing, nothing)
    places = np.random.default_rng(1).random((2000, 2))
    blind, no = border(places, nothing(places), nothing(places)), inside(places)
    assert (blind[:, 0] == no[:, 0]).mean() > 0.97
    # a model that is right everywhere tells where the border runs between few points
    known = refined(spread_points(12, 0), 16, inside, lambda p: inside(p)[:, 0], nothing)
    assert (known(places, nothing(places), no[:, 0])[:, 0] == no[:, 0]).mean() > 0.95


def test_no_point_is_asked_twice():
    points = np.array([[0, 0], [0.5, 0.5], [0.5, 0.5], [1, 1e-9], [1, 0]])
    assert distinct(points).tolist() == points[[0, 1, 3]].tolist()

    def beside(p):
        return np.where(np.abs(p[:, 0] - 0.5) < 1e-9, -1, p[:, 0] > 0.5)

    # the middle of two corners lies on a line known beforehand, and has been asked
    first = np.concatenate([spread_points(4, 0), [[0.5, 0.0], [0.5, 0.5]]])
    border = refined(first, 40, lambda p: p[:, :1] > 0.3, lambda p: p[:, 0] > 0.3, beside)
    assert len(distinct(border.points)) == len(border.points)


def test_sides_do_not_speak_for_each_other():
    points = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
    right = points[:, 0] > 0.3
    border = Border(points, right[:, None], right, ~right)
    places = np.array([[0.25, 0.5], [0.35, 0.5]])
    assert border(places, places[:, 0] > 0.3, [True, True])[:, 0].tolist() == [False, True]


def test_gains_without_integral_action_do_not_speak_for_others(hunting):
    """With static friction any integral action ends in hunting; without it the axis stays where it sticks."""
    assert hunting.at(kp=2000, ki=0).verdict == "rests"
    for kp, ki in ((1500, 20), (3000, 800), (2000, 3000)):
        assert "cycles" in hunting.at(kp=kp, ki=ki).verdict


@pytest.mark.parametrize(
    ("keywords", "error"),
    [
        ({"kp": 1.0, "ki": 2.0, "kd": 3.0}, ValueError),
        ({"kp": (1, 2), "ki": (1, 2), "kd": (1, 2)}, ValueError),
        ({"kp": (2, 1), "ki": (1, 2)}, ValueError),
        ({"kp": "much", "ki": (1, 2)}, TypeError),
        ({"kp": (1, 2), "ki": (1, 2), "exact_check": 3}, ValueError),
        ({"kp": (1, 2), "ki": (1, 2), "omega": (5, 1)}, ValueError),
        ({"kp": (1, 2), "ki": (1, 2), "speed": 1}, TypeError),
        ({"kp": (1, 2), "ki": (1, 2), "plant": ct.tf([1], [1, 1], 0.1)}, ValueError),
    ],
)
def test_what_cannot_be_mapped_is_refused(keywords, error):
    with pytest.raises(error):
        cdf.limit_cycle_map(FRICTION, **keywords)


def test_a_map_knows_nothing_beyond(hunting):
    with pytest.raises(ValueError, match="larger one"):
        hunting.at(kp=5000, ki=100)
    with pytest.raises(TypeError, match="free gains"):
        hunting.at(kp=1000)


# --- tuned --------------------------------------------------------------------------------------------------


def test_tuned_friction_rests_within_its_margins():
    tuned = cdf.tune_pid(FRICTION, bandwidth=(12, 20), max_sensitivity=1.6, tf=0.0)
    assert tuned.feasible and tuned.verdict == "rests" and tuned.simulated.orbit is None
    L = tuned.controller * ct.tf([1], [9, 0.5, 0])
    w = np.geomspace(0.1, 1000, 4000)
    response = np.squeeze(L(1j * w))
    assert 1 / np.abs(1 + response).min() <= 1.6 * 1.001
    assert 12 * 0.999 <= ct.margin(L)[3] <= 20 * 1.001  # python-control's own crossover
    assert len(repr(tuned)) < 200 and "crossover" in tuned.summary() and "kp" in str(tuned.table())


def test_tuned_stiction_hunts_least():
    tuned = cdf.tune_pid(STICTION, bandwidth=12, kp=(500, 1500), ki=1000)
    assert tuned.feasible and "cycles" in tuned.verdict
    soft = cdf.find_limit_cycle(cdf.closed_loop(cdf.pid(600, 1000, tuned.gains["kd"]), STICTION))
    assert tuned.simulated.orbit.output_amplitude < soft.output_amplitude


def test_a_saturated_loop_is_tuned_below_its_limits():
    """There it is linear: margins are those of the loop without the saturation."""
    plant = ct.tf([1], [1, 1, 0])
    tuned = cdf.tune_pid(cdf.saturation(1), bandwidth=1, kp=1.5, ki=0, kd=1, plant=plant, tf=0.01)
    L = tuned.controller * plant
    response = np.squeeze(L(1j * np.geomspace(0.01, 100, 4000)))
    assert tuned.max_sensitivity == pytest.approx(1 / np.abs(1 + response).min(), rel=1e-3)
    assert tuned.bandwidth == pytest.approx(ct.margin(L)[3], rel=1e-3)
    assert tuned.feasible and tuned.verdict == "rests"
    limited = cdf.Mass(9).with_effect(cdf.Viscous(3)).with_effect(cdf.InputSaturation(50))
    found = cdf.tune_pid(limited, bandwidth=12, ki=0, kd=89)
    assert found.feasible and found.verdict == "rests" and 12 <= found.bandwidth <= 18


def test_what_is_linear_nowhere_is_refused():
    for block in (cdf.relay(1.0), cdf.relay_with_hysteresis(1.0, 0.1)):
        with pytest.raises(ValueError, match="keeps its gain"):
            cdf.tune_pid(block, bandwidth=1.0, plant=LAG)
    with pytest.raises(ValueError, match="without the limit"):
        cdf.tune_pid(FRICTION.with_effect(cdf.InputSaturation(50)), bandwidth=12)
    with pytest.raises(ValueError, match="bandwidth"):
        cdf.tune_pid(FRICTION, bandwidth=-1.0)


# --- drawn --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("width", [3.3, 7.0])
def test_the_map_is_drawn_legibly(hunting, width):
    hunting.marks["paper"] = {"kp": 2000, "ki": 44250}
    figure = plt.figure(figsize=(width, 1.1 * width if width < 4 else 0.72 * width), layout="constrained")
    cplt = hunting.plot(ax=figure.add_subplot())
    assert len(cplt.lines[0]) and len(cplt.lines[1]) and len(cplt.lines[3]) == 1
    assert illegible(figure) == ([], [])
    plt.close(figure)


@pytest.mark.parametrize("width", [3.3, 7.0])
def test_sliders_move_the_explorer(width):
    view = cdf.explore(STICTION, kp=(500, 2000, 4000), ki=(0, 44250, 80000), kd=130, width=width)
    assert view.simulated.orbit.omega == pytest.approx(11.62868, rel=1e-6)
    assert len(view.cycles) == 2
    view.sliders["ki"].set_val(10000.0)
    assert view.gains == {"kp": 2000.0, "ki": 10000.0, "kd": 130.0} and view.simulated.verdict == "cycles"
    single = _predicted(STICTION, 2000, 10000, 130, np.geomspace(5.51, 2000, 120), [0.5, 80])
    assert [c.omega for c in view.cycles] == pytest.approx([omega for _, omega, _ in single], rel=1e-6)
    view.set(kp=1000)
    assert view.sliders["kp"].val == 1000 and "kp=1000" in repr(view)
    assert illegible(view.figure) == ([], [])
    with pytest.raises(TypeError, match="sliders"):
        view.set(kd=1.0)
    plt.close(view.figure)


def test_the_explorer_draws_elements_and_refuses_numbers():
    view = cdf.explore(cdf.saturation(1), kp=(0.5, 8, 20), plant=LAG, exact=False)
    assert view.cycles[0].amplitude == pytest.approx(3.343998730, rel=1e-6) and view.simulated is None
    plt.close(view.figure)
    with pytest.raises(ValueError, match="at least one gain"):
        cdf.explore(FRICTION, kp=1000.0)
