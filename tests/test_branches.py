"""Solutions of 1 + N H = 0 on motions of the block that its describing function does not name.

The symmetric motion with two impacts a period is computed here apart from the package: its N from the
equations of one half period, its closing and its multiplier from flights followed by dense sampling.
"""

import math

import control as ct
import matplotlib
import numpy as np
import pytest
from scipy.optimize import brentq

import ctrl_df as cdf
from ctrl_df.df.closed_form.backlash import backlash_attractors
from ctrl_df.df.closed_form.backlash_branches import coexisting_branches, symmetric_branch

matplotlib.use("Agg")
import matplotlib.pyplot as plt

PID = cdf.pid(1800, 19500, 100)
BOXES = [(np.geomspace(3, 60, n), np.geomspace(8, 200, m)) for n, m in ((30, 40), (24, 36), (15, 20))]


def drive(restitution, motor=1.0, load=8.0, gap=0.018):
    return cdf.backlash_masses(motor_mass=motor, load_mass=load, gap=gap, restitution=restitution)


@pytest.fixture(autouse=True)
def no_open_figures():
    yield
    plt.close("all")


# --- the motion, computed apart ---------------------------------------------------------------------------


def impact_phases(A, eps):
    """(tau, speed) of the impact on the upper wall, both solutions, from the half period written out.

    Between the walls y' = eps v + A (sin t + sin tau) from t = tau - pi on; it has to reach y = 1/2 with
    y' = v at t = tau: 2 A sin(tau) = (1 - eps) v and pi (eps v + A sin tau) - 2 A cos(tau) = 1.
    """
    if eps == 1:
        roots = [0.0, math.pi]
    else:

        def miss(tau):
            return math.pi * A * math.sin(tau) * (1 + eps) / (1 - eps) - 2 * A * math.cos(tau) - 1

        t = np.linspace(0, math.pi, 4001)
        values = [miss(x) for x in t]
        roots = [
            brentq(miss, t[i], t[i + 1], xtol=1e-15) for i in range(4000) if values[i] * values[i + 1] < 0
        ]
    pairs = [(tau, (1 + 2 * A * math.cos(tau)) * 2 / math.pi / (1 + eps)) for tau in roots]
    return [(tau, v) for tau, v in pairs if v > 1e-9]


def n_of(A, eps, tau, v):
    """N (M1 + M2) omega^2 of the load: the walls give y impulses -(1 + eps) v at tau, the opposite later.

    The load moves by -M2/(M1 + M2) y and with the centre of mass, which alone has no wall term.
    """
    wall = -2 * (1 + eps) * v / math.pi * np.exp(-1j * tau)  # harmonic of y'' that the walls add
    return wall / A


def flight(A, eps, t, y, rate, until):
    """Follow (y, y') from t to `until` by sampling; returns (y, y', impacts)."""
    hits = 0
    while t < until - 1e-13:

        def place(s, t=t, y=y, rate=rate):
            return y + (rate - A * math.sin(t)) * (s - t) - A * (math.cos(s) - math.cos(t))

        s = np.linspace(t, until, 4000)
        over = np.abs([place(x) for x in s]) - 0.5
        over[0] = min(over[0], -1e-15)
        if hits:  # the wall just left
            over[:2] = np.minimum(over[:2], -1e-15)
        out = np.nonzero(over > 0)[0]
        if not out.size:
            end = until
        else:
            side = math.copysign(0.5, place(s[out[0]]))
            end = brentq(lambda x, f=place, side=side: f(x) - side, s[out[0] - 1], s[out[0]], xtol=1e-15)
        y, rate, t = place(end), rate + A * (math.sin(end) - math.sin(t)), end
        if out.size:
            y, rate, hits = side, -eps * rate, hits + 1
    return y, rate, hits


def clears(A, eps, tau, v):
    """Whether the flight from the lower wall stays between the walls for half a period."""
    t = np.linspace(tau - math.pi, tau, 3001)[1:-1]
    rate = eps * v + A * math.sin(tau)
    y = -0.5 + rate * (t - tau + math.pi) - A * (np.cos(t) + math.cos(tau))
    return bool((np.abs(y) < 0.5).all())


def crossings_apart(H, eps, motor, load, gap, box):
    """All (a, omega) of 1 + N H = 0 on the symmetric motion, from its curve cut with that of -1/H."""
    a_box, w_box = box
    unit, total = motor * gap, motor + load
    w = np.geomspace(w_box[0], w_box[-1], 1000)
    wanted = -total * w**2 / H(1j * w)
    A = np.geomspace(a_box[0] / (unit * w[-1] ** 2), a_box[-1] / (unit * w[0] ** 2), 1500)
    found = []
    for side in (0, 1):
        nodes = [impact_fast(x, eps, side) for x in A]
        for i in range(A.size - 1):
            if nodes[i] is None or nodes[i + 1] is None:
                continue
            p, d = nodes[i], nodes[i + 1] - nodes[i]
            e, gone = np.diff(wanted), wanted[:-1] - p
            det = d.real * -e.imag + e.real * d.imag
            with np.errstate(all="ignore"):
                s = (gone.real * -e.imag + e.real * gone.imag) / det
                t = (d.real * gone.imag - d.imag * gone.real) / det
            for k in np.nonzero((s >= 0) & (s < 1) & (t >= 0) & (t < 1))[0]:
                at, omega = A[i] * (A[i + 1] / A[i]) ** s[k], w[k] * (w[k + 1] / w[k]) ** t[k]
                pairs = impact_phases(at, eps)
                if len(pairs) > side and clears(at, eps, *pairs[side]):
                    found.append((at * unit * omega**2, omega))
    return [(a, o) for a, o in found if a_box[0] <= a <= a_box[-1]]


def impact_fast(A, eps, side):
    """n on one side of the fold, from the phase in closed form."""
    r = (1 + eps) / (1 - eps)
    level = 1 / (A * math.hypot(2, math.pi * r))
    if level > 1:
        return None
    turn = math.asin(level)
    tau = math.atan2(2, math.pi * r) + (math.pi - turn if side else turn)
    v = 2 * A * math.sin(tau) / (1 - eps)
    return n_of(A, eps, tau, v) if v > 1e-9 else None


def drawn(seed):
    """Draw a drive and a PID under which the symmetric motion balances on either side of its fold."""
    rng = np.random.default_rng(seed)
    while True:
        eps = rng.uniform(0.3, 0.92)
        motor, load, gap = rng.uniform(0.2, 3), rng.uniform(0.5, 12), 10 ** rng.uniform(-4, -1)
        w, A = 10 ** rng.uniform(0.3, 2), 10 ** rng.uniform(-1.5, 0.6)
        pairs = impact_phases(A, eps)
        side = int(rng.integers(0, 2)) if len(pairs) > 1 else 0
        if not pairs or not clears(A, eps, *pairs[side]):
            continue
        H = -(motor + load) * w**2 / n_of(A, eps, *pairs[side])
        kd = rng.uniform(0.2, 2) * abs(H) / w + max(H.imag, 0) / w
        if H.real <= 0:
            continue
        loop = (H.real, w * (kd * w - H.imag), kd)
        return eps, motor, load, gap, A * motor * gap * w**2, w, cdf.pid(*loop)


# --- tests ------------------------------------------------------------------------------------------------


@pytest.mark.filterwarnings("ignore:.*aperiodic:RuntimeWarning")
@pytest.mark.parametrize("seed", range(4, 12, 2))
def test_the_symmetric_motion_is_searched_completely(seed):
    """Solutions listed solve the equation with N computed apart; none that a dense curve holds is missed."""
    eps, motor, load, gap, a, w, controller = drawn(seed)
    box = np.geomspace(a / 4, a * 4, 14), np.geomspace(w / 3, w * 3, 16)
    response = cdf.describing_function_response(controller, drive(eps, motor, load, gap), *box)
    mine = [c for c in response.limit_cycles if c.branch.startswith("symmetric")]
    for cycle in mine:
        A = cycle.amplitude / (motor * gap * cycle.omega**2)
        H = controller(1j * cycle.omega)
        values = [
            1 + n_of(A, eps, *pair) / ((motor + load) * cycle.omega**2) * H for pair in impact_phases(A, eps)
        ]
        assert min(map(abs, values)) < 1e-8  # measured 2e-11, where brentq ends
        assert cycle.residual < 1e-9 and cycle.grade != "trusted"
        named = cdf.describing_function_family(response.block, [cycle.amplitude], [cycle.omega]).N[0, 0]
        assert abs(1 + named * H) > 1e-6  # else it would be no branch
    truth = crossings_apart(controller, eps, motor, load, gap, box)
    assert any(abs(x / a - 1) < 1e-3 and abs(y / w - 1) < 1e-3 for x, y in truth)
    for x, y in truth:
        assert any(
            abs(c.amplitude / x - 1) < 3e-3 and abs(c.omega / y - 1) < 3e-3 for c in response.limit_cycles
        )
    for cycle in mine:
        assert any(abs(cycle.amplitude / x - 1) < 3e-3 for x, _ in truth)
    places = [(c.amplitude, c.omega) for c in response.limit_cycles]
    assert places == response.intersections and len(set(places)) == len(places)
    assert len(response.positions) == len(places)


@pytest.mark.parametrize("seed", range(20, 26))
def test_the_motion_listed_is_the_motion_of_the_masses(seed):
    """From the state of the listing two masses followed for a period come back; growth is the multiplier."""
    eps, motor, load, gap, a, w, controller = drawn(seed)
    box = np.geomspace(a / 1.5, a * 1.5, 8), np.geomspace(w / 1.3, w * 1.3, 8)
    response = cdf.describing_function_response(controller, drive(eps, motor, load, gap), *box)
    cycle = min(
        response.limit_cycles, key=lambda c: abs(math.log(c.omega / w)) + abs(math.log(c.amplitude / a))
    )
    A = cycle.amplitude / (motor * gap * cycle.omega**2)
    if not cycle.branch:  # where it attracts it is the describing function's own, and has no listing apart
        pytest.skip("drawn where the symmetric motion attracts")
    x1, v1, x2, v2 = cycle.motion.state
    y, rate = (x2 - x1) / gap - 0.5, (v2 - v1) / (gap * cycle.omega)
    again = flight(A, eps, 0.0, y, rate, 2 * math.pi)
    assert again[2] == 2
    assert again[:2] == pytest.approx((y, rate), abs=1e-7 * max(1, cycle.forced_multiplier))
    assert motor * v2 + load * v1 == pytest.approx(0, abs=1e-12 * motor * abs(v2))
    h = 1e-6
    columns = [
        np.subtract(
            flight(A, eps, 0.0, y + h * i, rate + h * (1 - i), 2 * math.pi)[:2],
            flight(A, eps, 0.0, y - h * i, rate - h * (1 - i), 2 * math.pi)[:2],
        )
        / (2 * h)
        for i in (1, 0)
    ]
    growth = np.abs(np.linalg.eigvals(np.array(columns).T)).max()
    assert growth == pytest.approx(cycle.forced_multiplier, rel=1e-3)
    assert cycle.stable is False or cycle.forced_multiplier < 1


def test_the_loop_with_restitution_08():
    """A rattle, a motion of three periods beside another, a motion that repels."""
    response = cdf.describing_function_response(PID, drive(0.8), *BOXES[-1])
    three, symmetric, rattle = response.limit_cycles
    assert (three.omega, three.amplitude) == pytest.approx((15.6159202, 3.4540451), rel=1e-7)
    assert three.regime == "subharmonic 3" and three.grade == "unreliable" and three.branch == ""
    assert (symmetric.omega, symmetric.amplitude) == pytest.approx((14.8580540, 5.5174685), rel=1e-7)
    assert symmetric.stable is False and symmetric.grade == "unreliable"
    assert symmetric.branch == "symmetric motion with two impacts a period"
    assert symmetric.forced_multiplier == pytest.approx(16.93368, rel=1e-5)
    assert "unstable under this force alone" in symmetric.why and "0.14" in symmetric.why
    assert (rattle.omega, rattle.amplitude) == pytest.approx((125.7539479, 10.2780778), rel=1e-7)
    assert rattle.stable is True and rattle.branch == ""
    assert "3 solutions" in response.status and "1 of them on the symmetric motion" in response.status


def test_the_loop_with_restitution_02_is_as_before():
    response = cdf.describing_function_response(PID, drive(0.2), *BOXES[0])
    (cycle,) = response.limit_cycles
    assert (cycle.omega, cycle.amplitude) == pytest.approx((14.844564, 17.750443), rel=1e-7)
    assert cycle.branch == "" and cycle.motion is None and math.isnan(cycle.forced_multiplier)


def test_velocity_output_has_the_same_cycles():
    """N of the velocity is j omega times N: the PID on it is divided by s."""
    onto_velocity = PID * ct.tf([1], [1, 0])
    response = cdf.describing_function_response(onto_velocity, drive(0.8), *BOXES[2], output="v")
    places = [(c.amplitude, c.omega) for c in response.limit_cycles if c.branch]
    assert places == [pytest.approx((5.5174685, 14.8580540), rel=1e-6)]


def test_verify_and_picture_tell_them_apart():
    box = np.geomspace(3, 12, 20), np.geomspace(10, 30, 20)
    response = cdf.describing_function_response(PID, drive(0.8), *box)
    check = cdf.verify(response, search=False)
    row = next(r for r in check if r.predicted is not None and r.predicted.branch)
    assert row.verdict == "not found" and "Newton's method from this motion" in row.why
    assert "Newton's method from this motion" in check.table()
    ax = response.plot().axes[0, 0]
    diamonds = [line for line in ax.lines if line.get_marker() == "D"]
    assert len(diamonds) == 1 and diamonds[0].get_markerfacecolor() == "white"
    assert any("unstable motion" in text.get_text() for text in ax.texts)


def test_no_branch_without_dissipation_is_called_attracting():
    """At eps = 1 the map keeps areas: no multiplier is below one, and A reaches down to zero."""
    branch = symmetric_branch(1.0, 2.0, 0.01, 1.0, 5.0)
    motions = branch.motions(branch.grid, np.full(branch.grid.size, 3.0), 3)
    assert np.isfinite(motions.harmonics).all() and motions.exists.any()
    assert (motions.multiplier[motions.exists] >= 1 - 1e-9).all()


@pytest.mark.parametrize(("eps", "A"), [(0.8, 0.787), (0.8, 1.22), (0.6, 0.7), (0.7, 0.8), (0.5, 1.5)])
def test_coexisting_branches_are_the_attractors(eps, A):
    """At one A the branches that exist there are the periodic attractors found from many starts."""
    branches = coexisting_branches(1.0, 1.0, 1.0, eps, np.array([A]))
    found = []
    for branch in branches:
        if branch.grid[0] <= math.log(A) <= branch.grid[-1]:
            at = branch.motions(np.array([math.log(A)]), np.array([1.0]), 1)
            if at.exists[0]:
                assert at.multiplier[0] < 1 and at.amplitude[0] == pytest.approx(A)
                found.append(2 * at.harmonics[0, 1])
    listed = [
        -(1 + m.q)
        for m in backlash_attractors(A, eps)
        if m.regime not in ("aperiodic", "free") and m.share > 0.05 and not (m.impacts == 2 and m.period == 1)
    ]
    for n in listed:
        assert any(abs(n - f) < 1e-9 for f in found)
    for f in found:
        assert any(abs(-(1 + m.q) - f) < 1e-6 for m in backlash_attractors(A, eps))


def test_a_follow_ends_where_the_motion_ceases_to_attract():
    """The asymmetric motion of three impacts at eps 0.8 lives between two bifurcations."""
    branches = coexisting_branches(1.0, 1.0, 1.0, 0.8, np.array([0.5]))
    (branch,) = [b for b in branches if b.name == "asymmetric motion of 3 impacts a period"]
    low, high = np.exp(branch.grid[[0, -1]])
    assert 0.45 < low < 0.46 and 0.687 < high < 0.688
    at = branch.motions(branch.grid[[-1]], np.array([1.0]), 1)
    assert at.exists[0] and at.multiplier[0] > 0.98
