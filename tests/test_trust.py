"""Three honest answers (an orbit, none, not found), what the loop does, and the same in every unit."""

import functools
import time

import control as ct
import numpy as np
import pytest

import ctrl_df as cdf
from ctrl_df.limit_cycles.exact import poincare
from ctrl_df.limit_cycles.exact.closing import Closing
from ctrl_df.limit_cycles.exact.poincare import Crossing
from ctrl_df.limit_cycles.finder import OrbitFinder
from ctrl_df.limit_cycles.pieces import by_pieces
from ctrl_df.limit_cycles.predicted.path import End
from ctrl_df.status import Status

FRICTION = cdf.pid(2000, 44250, 130)
RELAY_PLANT = ct.tf([25], [1, 3, 3, 1])
DEAD_ZONE = cdf.relay_with_dead_zone(1, 2)
NEAR_FOLD = (
    cdf.pid(9.71, 40.74, 1.527),
    cdf.friction_mass(mass=0.72, coulomb=1.81, viscous=0.017, static=2.34),
)


def near_fold():
    return cdf.describing_function_response(*NEAR_FOLD, np.geomspace(2.4, 90, 30), np.geomspace(1, 11, 40))


# --- finding 2: trusted predictions of a loop that diverges from every start --------------------------------


def test_predictions_that_merge_are_not_trusted():
    response = near_fold()
    assert len(response.limit_cycles) == 2
    assert {c.grade for c in response.limit_cycles} == {"unreliable"}
    assert all("would merge" in c.why for c in response.limit_cycles)


def test_merged_predictions_are_shown_to_have_no_orbit_and_the_loop_diverges():
    check = cdf.verify(near_fold())
    assert [row.verdict for row in check] == ["no such orbit"] * 2
    assert all("merged" in row.why for row in check)
    assert check.orbits == [] and len(check.fate.diverges) == len(check.fate) == 6
    assert "diverges" in check.table()


def test_saturated_pid_that_winds_up_is_said_to_diverge():
    plant = cdf.friction_mass(9, 5, 0.5).with_effect(cdf.InputSaturation(60))
    check = cdf.verify(
        cdf.describing_function_response(
            cdf.pid(2000, 44250, 60), plant, np.geomspace(6, 50, 10), np.geomspace(2, 40, 12)
        )
    )
    assert len(check.fate.diverges) >= 1
    assert "winding up" in str(check.fate)


def test_fate_tells_rest_cycle_and_the_border_between():
    """Rest starts below 4.122415 mm decay, above they diverge (from the exact orbit between them)."""
    omega = np.geomspace(5, 40, 12)
    check = cdf.verify(
        cdf.describing_function_response(
            FRICTION, cdf.friction_mass(9, 5, 0.5), np.geomspace(5.8, 60, 12), omega
        )
    )
    assert {row.fate for row in check.fate} == {"rests", "diverges"}
    (border,) = check.fate.borders
    assert border.below < 4.122415e-3 * (1 + 1e-3) and border.above > 4.122415e-3 * (1 - 1e-3)
    hunting = cdf.verify(
        cdf.describing_function_response(
            FRICTION, cdf.friction_mass(9, 5, 0.5, 5.5), np.geomspace(5.8, 60, 12), omega
        )
    )
    assert {round(row.orbit.omega, 4) for row in hunting.fate.cycles} == {11.6287}


# --- finding 3: unstable orbits, guesses, states ------------------------------------------------------------


@pytest.mark.parametrize(
    ("H", "block", "guess", "exact"),
    [
        (RELAY_PLANT, DEAD_ZONE, (1.0357, 1.732), (1.004744, 1.478835)),
        (
            ct.tf([4946.419840248048], [1, 16.981330561312625, 83.87806358282589, 125.87243947849767]),
            cdf.relay_with_dead_zone(0.5751066650361315, 1.9339922519550605),
            None,
            (0.98941464, 7.93813754),
        ),
    ],
)
def test_unstable_orbits_of_a_relay_with_dead_zone(H, block, guess, exact):
    if guess is None:
        dead = 0.5751066650361315
        response = cdf.describing_function_response(
            H, block, dead * np.geomspace(1.001, 30, 40), np.geomspace(1, 60, 60)
        )
        guess = min(response.limit_cycles, key=lambda c: c.amplitude)
    orbit = cdf.find_limit_cycle(cdf.closed_loop(H, block), guess=guess)
    assert orbit and orbit.stable is False and not orbit.note
    assert (orbit.amplitude, orbit.omega) == pytest.approx(exact, rel=2e-6)


def test_a_state_on_an_unstable_orbit_leads_to_it():
    x0 = np.array([-0.03502952840986681, 0.012278210833613192, 0.04])
    orbit = cdf.find_limit_cycle(cdf.closed_loop(RELAY_PLANT, DEAD_ZONE), guess=x0)
    assert orbit and orbit.period == pytest.approx(4.248739809365323, rel=1e-7) and orbit.stable is False


def test_an_unstable_orbit_is_found_without_a_guess():
    """It stands between starts that come to rest and starts that diverge."""
    orbit = cdf.find_limit_cycle(cdf.closed_loop(FRICTION, cdf.friction_mass(9, 5, 0.5)))
    assert orbit and orbit.omega == pytest.approx(13.792124, rel=1e-6) and orbit.stable is False


def test_a_guess_that_leads_elsewhere_says_so():
    loop = cdf.closed_loop(ct.tf([8], [1, 2, 2, 1]), cdf.saturation(1))
    orbit = cdf.find_limit_cycle(loop, guess=(40.0, 9.0))
    assert orbit and "led to another orbit" in orbit.note
    assert not cdf.find_limit_cycle(loop, guess=(3.3, 1.4)).note


@pytest.mark.filterwarnings("ignore:overflow:RuntimeWarning")
def test_van_der_pol_at_five():
    response = cdf.describing_function_response(
        ct.tf([5.0, 0], [1, -5.0, 1]),
        lambda u: u**3 / 3,
        np.geomspace(0.5, 5, 10),
        np.geomspace(0.3, 3, 12),
    )
    (row,) = cdf.verify(response, search=False)
    assert row.exact.omega == pytest.approx(0.5410834, rel=1e-6) and row.verdict == "shifted"


def test_strongly_repelling_orbits_are_closed():
    """A quantizer just beyond its first step: a multiplier of over a thousand."""
    plant = ct.tf([1.563e4], [1, 24.41, 353.5, 4445])
    response = cdf.describing_function_response(
        plant, cdf.quantizer(0.533), np.geomspace(0.267, 16, 30), np.geomspace(0.5, 400, 40)
    )
    orbit = cdf.find_limit_cycle(cdf.closed_loop(plant, cdf.quantizer(0.533)), guess=response.limit_cycles[0])
    assert orbit and orbit.multiplier > 500 and orbit.residual < 1e-7


def test_no_orbit_is_false_and_says_what_was_tried():
    answer = cdf.find_limit_cycle(cdf.closed_loop(*NEAR_FOLD))
    assert isinstance(answer, cdf.NoOrbit) and not answer
    assert answer.status is Status.NOT_FOUND and len(answer.tried) == 6
    assert "diverges" in str(answer)
    with pytest.raises(RuntimeError, match="no proof"):
        cdf.find_limit_cycle(cdf.closed_loop(*NEAR_FOLD), raise_on_failure=True)


# --- finding 4: the same in every unit ----------------------------------------------------------------------


def _friction(force, length, time):
    m = force * time**2 / length
    block = cdf.friction_mass(
        mass=9 * m, coulomb=5 * force, viscous=0.5 * force * time / length, static=5.25 * force
    )
    return cdf.pid(2000 * force / length, 44250 * force / length / time, 130 * force * time / length), block


def _gap(force, length, time):
    m = force * time**2 / length
    pid = cdf.pid(1800 * force / length, 19500 * force / length / time, 100 * force * time / length)
    return pid, cdf.backlash_masses(m, 8 * m, 0.018 * length, 0.2)


def _relay(force, length, time):
    del length
    t = time
    return ct.tf([1 / t**3], [1, 2 / t, 1 / t**2, 0]), cdf.relay(force)


BOXES = {_friction: ((5.8, 60), (5, 40)), _gap: ((5, 60), (8, 60)), _relay: ((0.05, 5), (0.1, 10))}


@functools.cache
def verified(make, units):
    """Return a loop verified, in units so many times larger."""
    force, _, time = units
    (a, b), (low, high) = BOXES[make]
    A, omega = np.geomspace(a, b, 12) * force, np.geomspace(low, high, 14) / time
    return cdf.verify(cdf.describing_function_response(*make(*units), A, omega))


@pytest.mark.parametrize("make", BOXES)
@pytest.mark.parametrize(
    "units",
    [(1e-9, 1, 1e9), (1, 1e9, 1e-9), (1e6, 1e-5, 1e-6)],
)
def test_predictions_orbits_verdicts_and_fates_in_other_units(make, units):
    force, _, time = units
    one, two = verified(make, (1.0, 1.0, 1.0)), verified(make, units)
    assert [r.verdict for r in one] == [r.verdict for r in two]
    assert [r.predicted and r.predicted.grade for r in one] == [
        r.predicted and r.predicted.grade for r in two
    ]
    assert [s.fate for s in one.fate] == [s.fate for s in two.fate]
    for p, q in zip(one, two, strict=True):
        if p.predicted:
            assert q.predicted.omega * time == pytest.approx(p.predicted.omega, rel=1e-6)
            assert q.predicted.amplitude / force == pytest.approx(p.predicted.amplitude, rel=1e-6)
        if p.exact:
            assert q.exact.omega * time == pytest.approx(p.exact.omega, rel=1e-6)
            assert q.exact.amplitude / force == pytest.approx(p.exact.amplitude, rel=1e-6)


@pytest.mark.parametrize("units", [(1e-9, 1, 1), (1, 1e9, 1), (1, 1, 1e-9), (1, 1, 1e9)])
def test_simulations_in_other_units(units):
    """Stick-slip, impacts, and a smooth law: measured 7e-10 of the largest output."""
    times = np.linspace(0, 2, 101)

    def smooth(f, x, t):
        m = f * t**2 / x
        block = (
            cdf.Mass(9 * m)
            .with_effect(cdf.Coulomb(4 * f))
            .with_effect(cdf.Stribeck(6 * f, velocity=0.02 * x / t))
        )
        block = block.with_effect(cdf.QuadraticDrag(3 * f * (t / x) ** 2)).with_effect(
            cdf.CubicSpring(1e5 * f / x**3)
        )
        return cdf.pid(2000 * f / x, 30000 * f / x / t, 130 * f * t / x), block

    for make in (_friction, _gap, smooth):
        runs = []
        for f, x, t in ((1.0, 1.0, 1.0), units):
            loop = cdf.closed_loop(*make(f, x, t))
            start = np.zeros(loop.nstates)
            start[1] = 0.003 * x
            if make is _gap:
                start[3] = 0.012 * x
            response = cdf.event_response(loop, times * t, 0, start)
            runs.append((np.asarray(response.outputs)[0] / x, response.event_count))
        assert runs[0][1] == runs[1][1]
        assert np.abs(runs[0][0] - runs[1][0]).max() < 1e-8 * np.abs(runs[0][0]).max()


# --- findings 5 and 9: several rounds, centres --------------------------------------------------------------


@pytest.mark.parametrize("rounds", [2, 3, 5, 7, 11])
def test_an_orbit_closed_after_several_rounds_is_the_one_of_a_single_round(rounds):
    loop = cdf.closed_loop(cdf.pid(1800, 19500, 100), cdf.backlash_masses(1, 8, 0.018, 0.2))
    closing = OrbitFinder(loop).closing
    orbit = cdf.find_limit_cycle(loop, guess=(17.75, 14.84))
    again = closing.close(orbit.states[:, 0], rounds * orbit.period)
    assert again.period == pytest.approx(orbit.period, rel=1e-8)
    assert again.multiplier == pytest.approx(orbit.multiplier, rel=1e-6)


def test_a_centre_is_no_limit_cycle():
    loop = cdf.closed_loop(cdf.pid(2000), cdf.Mass(9))
    for guess in (None, (1.0, float(np.sqrt(2000 / 9)))):
        answer = cdf.find_limit_cycle(loop, guess=guess)
        assert not answer and answer.status is Status.CENTRE


# --- fates by trend, not by waiting -------------------------------------------------------------------------


def _crossings(durations, peaks):
    times = np.cumsum(np.concatenate([[0.0], durations]))
    return [Crossing(t, np.zeros(1), p) for t, p in zip(times, peaks, strict=True)]


def test_growth_without_end_is_told_from_growth_towards_a_limit():
    """exp(c (1 - 0.9^n)) rises by e^c and no more; a steady ratio is told after a few steps."""
    n = np.arange(40)
    assert poincare._endless(1.3 ** n[:6], 1e4) and poincare._endless(12.0 ** n[:3], 1e4)
    assert not poincare._endless(np.exp(5 * (1 - 0.9**n)), 1e4)
    assert not poincare._endless(1.0 + n, 1e4) and not poincare._endless(np.ones(40), 1e4)


def test_a_motion_that_slows_down_by_a_ratio_each_swing_comes_to_rest():
    slower = 1.6 ** np.arange(8)
    assert poincare._creeps(_crossings(slower, np.full(9, 0.05)))
    assert not poincare._creeps(_crossings(slower, 1.3 ** np.arange(9)))  # its swings grow: it does not creep
    assert not poincare._creeps(_crossings(np.full(8, 2.0), np.full(9, 0.05)))
    loop = cdf.closed_loop(ct.tf([429], [1, 17.01, 63.17, 0]), cdf.play(0.3725))
    begun = time.perf_counter()
    fate = OrbitFinder(loop).explorer.explore()
    assert {row.fate for row in fate} == {"rests"} and time.perf_counter() - begun < 20


def test_a_simulation_that_spends_its_work_is_undecided(monkeypatch):
    monkeypatch.setattr(poincare, "WORK", 30)
    finder = OrbitFinder(cdf.closed_loop(ct.tf([8], [1, 2, 2, 1]), np.tanh))
    assert {row.fate for row in finder.explorer.explore(edges=False)} == {"undecided"}


@pytest.mark.parametrize("force", [1e-9, 1e-4, 1e9])
def test_the_scale_of_a_smooth_law_in_other_units(force):
    """A straight line near zero is no jump, however it is rounded."""

    def scale(f):
        loop = cdf.closed_loop(ct.tf([11.5], [1, 1.92, 2.15, 1.65]), lambda v: f * (v / f) / (1 + abs(v / f)))
        return OrbitFinder(loop).poincare.starts.scale / f

    assert scale(force) == pytest.approx(scale(1.0), rel=1e-6)


def test_a_known_orbit_is_closed_once(monkeypatch):
    closed = []
    close = Closing.close
    monkeypatch.setattr(Closing, "close", lambda self, *at: closed.append(1) or close(self, *at))
    H = ct.tf([11.5], [1, 1.92, 2.15, 1.65])
    check = cdf.verify(
        cdf.describing_function_response(H, np.tanh, np.geomspace(0.1, 60, 20), np.geomspace(0.1, 20, 30))
    )
    assert [row.verdict for row in check] == ["confirmed"] and len(check.fate.cycles) == 6
    assert all(row.orbit is check.orbits[0] for row in check.fate) and len(closed) == 1


def test_a_start_beside_an_unstable_orbit_does_not_cycle_on_it():
    loop = cdf.closed_loop(cdf.pid(1800, 19500, 100), cdf.backlash_masses(1, 8, 0.018, 0.5))
    fate = OrbitFinder(loop).explorer.explore(edges=False)
    stable = [row.orbit.stable for row in fate.cycles if row.orbit is not None]
    assert False not in stable and stable.count(True) == 4


@pytest.mark.quick
def test_the_path_of_a_rattle_reaches_its_orbit():
    """Under one force the gap has several motions; the path stays on the one it began on."""
    response = cdf.describing_function_response(
        cdf.pid(1800, 19500, 100),
        cdf.backlash_masses(1, 8, 0.018, 0.8),
        np.geomspace(8, 13, 6),
        np.geomspace(100, 160, 6),
    )
    (cycle,) = response.limit_cycles
    assert cycle.path.end is End.REACHED and cycle.corrected == pytest.approx(
        (12.717699, 156.045031), rel=0.03
    )


def test_a_sample_may_take_months():
    dt = 5e6
    H = ct.tf([0.005468, 0.01967, 0.004416], [1, -2.609, 2.263, -0.6523], dt)
    response = cdf.describing_function_response(
        H, cdf.saturation(1.0), np.geomspace(1.01, 40, 10), np.geomspace(1e-3, 2.7, 20) / dt
    )
    assert np.isfinite(response.response.response).all()


@pytest.mark.parametrize("grid", [(14, 17), (30, 40), (47, 61)])
def test_two_solutions_beside_a_jump_of_a_quantizer_are_found_on_any_grid(grid):
    """N rises with the square root of what the amplitude is beyond a level: 0.05 % there."""
    step = 0.2146
    probe = 1.5003 * step
    N = float(np.real(complex(cdf.describing_function(cdf.quantizer(step), probe))))
    H = ct.tf([8 / N], [1, 3, 3, 1])  # |H| is 1 / N where its phase is -180 degrees
    response = cdf.describing_function_response(
        H, cdf.quantizer(step), np.geomspace(1.2 * step, 2 * step, grid[0]), np.geomspace(0.1, 20, grid[1])
    )
    amplitudes = [c.amplitude for c in response.limit_cycles]
    assert len(amplitudes) == 2 and min(abs(a / probe - 1) for a in amplitudes) < 1e-6


def test_a_relay_that_switches_at_samples_only_has_its_band_as_wide():
    """The loop's swing is a whole number of samples, anywhere within half a sample of the mean."""
    H = ct.sample_system(ct.tf([1.0], [1, 3, 3, 1]), 0.07, "zoh")
    response = cdf.describing_function_response(
        H, cdf.relay(1.0), np.geomspace(0.01, 1, 12), np.geomspace(0.3, 10, 20)
    )
    (cycle,) = response.limit_cycles
    width = np.log(cycle.omega_band[1] / cycle.omega)
    assert width > 0.5 * cycle.omega * 0.07 * cycle.sensitivity.omega
    (row,) = cdf.verify(response)
    assert row.in_band


@pytest.mark.parametrize("grid", [(14, 17), (47, 61)])
def test_a_quantizer_may_balance_a_loop_at_very_many_amplitudes(grid):
    """|H| = 1 at the phase of -180 degrees: N of a quantizer swings about 1, twice a level."""
    step = 0.05
    H = ct.tf([8], [1, 3, 3, 1])
    response = cdf.describing_function_response(
        H,
        cdf.quantizer(step),
        np.geomspace(0.501 * step, 20.3 * step, grid[0]),
        np.geomspace(0.1, 20, grid[1]),
    )
    assert len(response.limit_cycles) == 40 and "bound on work" not in response.status
    levels = [c.amplitude / step for c in response.limit_cycles]
    assert all(0.4 < k < 0.6 for k in np.diff(levels)[4:])


def test_swings_of_a_law_fade_where_it_is_straight():
    """A start below the bend decays as the linear loop does; a tenth of the crossings to 1e-6 tell so."""
    loop = cdf.closed_loop(ct.tf([6.0], [1, 3, 3, 1]), lambda v: v + v**3)
    search = OrbitFinder(loop).poincare
    assert search.starts.straight == pytest.approx(search.starts.scale)
    course = search.iterate(search.starts.state(0.03 * search.starts.scale), 1000)
    assert course.fate == "rests" and len(course.crossings) < 40
    assert OrbitFinder(cdf.closed_loop(FRICTION, cdf.friction_mass(9, 5, 0.5))).poincare.starts.straight == 0


def test_no_passage_is_lost_between_two_strides_of_samples():
    """Intervals of 1024 samples: a loop of 137 samples a swing, followed over many swings."""
    H = ct.sample_system(ct.tf([30.0], [1, 3, 3, 1]), 2 * np.pi / np.sqrt(3) / 137, "zoh")
    response = cdf.describing_function_response(
        H, cdf.saturation(1.0), np.geomspace(1.01, 40, 12), np.geomspace(0.3, 10, 20)
    )
    check = cdf.verify(response)
    assert [row.verdict for row in check] == ["confirmed"]
    search = OrbitFinder(check.loop).poincare
    crossings = search.iterate(check.orbits[0].states[:, 0], 500, until_repeated=False).crossings
    spans = np.diff([c.time for c in crossings])[10:]
    assert len(spans) > 400 and spans.max() < 1.5 * np.median(spans)


def test_an_orbit_that_visits_a_level_briefly_is_closed_by_its_pieces():
    """Newton on the state from the same waveform meets the neighbour that does not visit it."""
    step = 0.2146
    N = float(np.real(complex(cdf.describing_function(cdf.quantizer(step), 1.51 * step))))
    H = ct.tf([8 / N], [1, 3, 3, 1])
    response = cdf.describing_function_response(
        H, cdf.quantizer(step), np.geomspace(1.2 * step, 2 * step, 20), np.geomspace(0.1, 20, 30)
    )
    cycle = max(response.limit_cycles, key=lambda c: c.amplitude)
    loop = cdf.closed_loop(H, cdf.quantizer(step))
    assert cycle.path is not None
    found = by_pieces(loop, cycle.path)
    assert found is not None and 2 * np.pi / found[1] == pytest.approx(cycle.path.omega, rel=1e-4)
    orbit = OrbitFinder(loop).closing.close(*found, stay=True)
    assert orbit.period == pytest.approx(found[1], rel=1e-8) and orbit.stable is False
    assert by_pieces(cdf.closed_loop(*NEAR_FOLD), cycle.path) is None
