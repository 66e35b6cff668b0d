"""Memoryless and hysteretic elements: blocks, closed forms, quadrature, families."""

import pickle
from concurrent.futures import ThreadPoolExecutor

import control as ct
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from ctrl_df.blocks.elements.hysteresis import play, rate_limiter, relay_with_hysteresis
from ctrl_df.blocks.elements.memoryless import (
    cubic,
    dead_zone,
    piecewise_linear,
    preload,
    quantizer,
    relay,
    relay_with_dead_zone,
    saturation,
)
from ctrl_df.blocks.mechanism import friction_mass
from ctrl_df.blocks.primitives import PiecewiseAffine
from ctrl_df.df import work
from ctrl_df.df.describing import describing_function, describing_function_family
from ctrl_df.df.family import load_family
from ctrl_df.df.warning import DescribingFunctionWarning

STATIC = [
    saturation(2),
    saturation(2, -1),
    saturation(2, 0.5),
    dead_zone(1),
    relay(1.3),
    relay_with_dead_zone(1, 0.5),
    quantizer(0.3),
    preload(1, -0.3),
    piecewise_linear([-1, 0.2, 0.9, 2], [0.4, 0, 3, 1]),
    cubic(0.7),
]
MEMORY = [play(0.2), relay_with_hysteresis(1.3, 0.4), rate_limiter(2.0)]
kind = [e.kind for e in STATIC]


def by_quad(f, a, corners, k):
    cuts = sorted({0.0, np.pi, *(float(np.arccos(c / a)) for c in corners if abs(c) < a)})
    parts = [
        quad(
            lambda t: f(a * np.cos(t)) * np.cos(k * t),
            lo + 1e-13,
            hi - 1e-13,
            epsabs=1e-11,
            epsrel=1e-11,
            limit=200,
        )[0]
        for lo, hi in zip(cuts[:-1], cuts[1:], strict=True)
    ]
    return sum(parts) * (1 if k == 0 else 2) / np.pi / a


def corners_of(element):
    if isinstance(element.primitive, PiecewiseAffine):
        return element.primitive.corners
    return 0.3 * (np.arange(-20, 21) + 0.5) if element.kind == "quantizer" else ()


@pytest.mark.filterwarnings("ignore:The occurrence of roundoff error")
@pytest.mark.parametrize("element", STATIC, ids=kind)
def test_closed_forms_against_quad(element):
    A = np.array([0.31, 1.1, 4.7])
    harmonics = describing_function_family(element, A).harmonics[:, 0]
    for i, a in enumerate(A):
        for k in (0, 1, 2, 3, 9):
            ref = by_quad(element, a, corners_of(element), k)
            assert harmonics[i, k] == pytest.approx(ref, abs=2e-12 * max(1, a * a))  # measured 4e-13


@pytest.mark.parametrize("element", STATIC, ids=kind)
def test_quadrature_of_the_bare_law_agrees(element):
    A = np.geomspace(0.2, 20, 25)
    family = describing_function_family(lambda u: element(float(u)), A)
    exact = describing_function_family(element, A)
    scale = np.abs(exact.harmonics).max()
    assert np.abs(family.harmonics - exact.harmonics).max() < 1e-11 * scale  # measured 6e-15 to 1e-13
    assert family.residual.max() < 1e-9


def sampled(element, a, n=200_000):
    state, out = (1 if element.kind != "play" else 0.0), np.empty(2 * n)
    theta = (np.arange(2 * n) + 0.5) * 2 * np.pi / n
    for i, u in enumerate(a * np.cos(theta)):
        out[i], state = element.step(u, state)
    k = np.arange(1, 10)
    return np.exp(-1j * np.outer(k, theta[n:])) @ out[n:] * 2 / n / a


@pytest.mark.parametrize(
    "element, a, tol", [(play(0.2), 0.15, 1e-9), (play(0.2), 3, 1e-9), (MEMORY[1], 0.7, 2e-4)]
)
def test_hysteresis_against_stepping(element, a, tol):
    got = describing_function_family(element, [a]).harmonics[0, 0, 1:]
    assert np.abs(got - sampled(element, a)).max() < tol  # a jump between two of 2e5 samples: 5e-5


@pytest.mark.parametrize("excess", [0.7, 1.05, 1.3, 1.8, 1.86])
def test_rate_limiter_against_stepping(excess):
    n = 100_000
    y, out, dt = 0.0, np.empty(3 * n), 2 * np.pi / n
    theta = np.arange(1, 3 * n + 1) * dt
    for i, u in enumerate(np.cos(theta)):
        y = min(max(u, y - dt / excess), y + dt / excess)
        out[i] = y
    ref = np.exp(-1j * np.outer(np.arange(1, 10), theta[2 * n :])) @ out[2 * n :] * 2 / n
    got = describing_function_family(rate_limiter(2.0), [excess * 2 / 3.0], [3.0]).harmonics[0, 0, 1:]
    assert np.abs(got - ref).max() < 2e-8  # first-order stepping: measured 3e-10


def test_rate_limiter_triangle():
    N = describing_function(
        rate_limiter(2.0), 5.0, 3.0
    )  # far above: a triangle of N = (4/pi)(R/a w) e^-j acos(pi R/2aw)
    ratio = 2.0 / 15.0
    assert N == pytest.approx(4 / np.pi * ratio * np.exp(-1j * np.arccos(np.pi * ratio / 2)), rel=1e-13)
    with pytest.raises(ValueError, match="give omega"):
        describing_function(rate_limiter(2.0), 5.0)


@settings(deadline=None, max_examples=40)
@given(st.floats(0.01, 1e3), st.floats(1e-3, 1e3))
def test_play_depends_on_the_ratio_and_loses_its_loop_area(a, gap):
    N = complex(describing_function(play(gap), a))
    assert N == pytest.approx(complex(describing_function(play(1.0), a / gap)), rel=1e-9, abs=1e-12)
    area = (
        max(2 * gap * (2 * a - gap), 0.0) if a > gap / 2 else 0.0
    )  # parallelogram: gap wide, 2a - gap high, both flanks
    assert -np.pi * a**2 * N.imag == pytest.approx(area / 2, rel=1e-9, abs=1e-12 * a * a)


@settings(deadline=None, max_examples=40)
@given(st.lists(st.floats(0.1, 2), min_size=2, max_size=4), st.floats(0.05, 20))
def test_odd_laws_have_odd_harmonics(steps, a):
    x = np.cumsum(steps)
    y = np.cumsum(np.sin(3 * x))
    law = piecewise_linear(np.concatenate([-x[::-1], x]), np.concatenate([-y[::-1], y]))
    harmonics = describing_function_family(law, [a]).harmonics[0, 0]
    assert np.abs(harmonics[::2]).max() < 1e-12 * max(np.abs(harmonics).max(), 1)
    assert np.abs(harmonics.imag).max() == 0


@pytest.mark.parametrize("element", STATIC + MEMORY, ids=kind + ["play", "relay_h", "rate"])
def test_elements_are_values(element):
    assert isinstance(element, ct.NonlinearIOSystem) and isinstance(
        element, ct.DescribingFunctionNonlinearity
    )
    again = pickle.loads(pickle.dumps(element))
    assert again == element and hash(again) == hash(element) and again.name == element.name
    for name, p in element.parameters.items():
        changed = element.with_parameters({name: p.value * 1.25})
        assert changed.parameters[name].value == p.value * 1.25 and changed != element
    with pytest.raises(TypeError):
        element.values["x"] = 1


@pytest.mark.parametrize(
    "element", [play(0.1), relay_with_hysteresis(1, 0.3), rate_limiter(1.0), saturation(1)]
)
def test_elements_run_in_python_control(element):
    t = np.linspace(0, 8, 801)
    fine = {"max_step": 2e-3}
    response = ct.input_output_response(
        element, t, np.sin(t), 0 if element.nstates else None, solve_ivp_kwargs=fine
    )
    if element.nstates == 0:
        assert np.allclose(response.outputs, np.clip(np.sin(t), -1, 1))
    elif element.kind == "rate_limiter":
        assert np.abs(np.diff(response.outputs)).max() < 0.0101
    else:
        state, exact = (0.0 if element.kind == "play" else 1), []
        for u in np.sin(t):
            y, state = element.step(u, state)
            exact.append(y)
        wrong = np.abs(np.array(exact) - response.outputs)
        assert np.sort(wrong)[-12] < 2e-3  # all but the few samples within a switching


def test_parameters_may_be_passed_in():
    assert saturation(1).output(0, [], [5.0], {"ub": 3.0}) == pytest.approx(3.0)


@pytest.mark.parametrize(
    "make",
    [
        lambda: saturation(1, 2),
        lambda: saturation(np.nan),
        lambda: dead_zone(-1),
        lambda: relay(0),
        lambda: quantizer(0),
        lambda: play(0),
        lambda: rate_limiter(-1),
        lambda: relay_with_hysteresis(1, 0),
        lambda: piecewise_linear([0, 0], [1, 2]),
        lambda: piecewise_linear([0], [1]),
        lambda: piecewise_linear([0, 1], [1, np.nan]),
    ],
)
def test_bad_elements(make):
    with pytest.raises(ValueError, match="needs"):
        make()


@pytest.mark.parametrize(
    "call, error, words",
    [
        (lambda: describing_function(relay(1), -1), ValueError, "cannot evaluate"),
        (lambda: describing_function(relay(1), np.nan), ValueError, "finite"),
        (lambda: describing_function(friction_mass(9, 5), 7.0), ValueError, "give omega"),
        (lambda: describing_function(friction_mass(9, 5), 7.0, 0.0), ValueError, "omega > 0"),
        (lambda: describing_function(friction_mass(9, 5), 0.0, 1.0), ValueError, "A = 0"),
        (lambda: describing_function("no block", 1.0), TypeError, "callable"),
        (lambda: describing_function(lambda u: np.nan, 1.0), ValueError, "finite numbers"),
        (lambda: describing_function_family(relay(1), []), ValueError, "at least one"),
        (lambda: describing_function_family(relay(1), [0.0, 1.0]), ValueError, "A > 0"),
        (lambda: describing_function_family(relay(1), [1.0], orders=0), ValueError, "orders"),
        (lambda: describing_function(friction_mass(9, 5), 7.0, 1.0, output="z"), ValueError, "out of x, v"),
        (lambda: describing_function(relay(1), 1.0, wrong=2), TypeError, "unrecognized keyword"),
    ],
)
def test_bad_calls(call, error, words):
    with pytest.raises(error, match=words):
        call()


def test_user_systems_and_outputs():
    def law(t, x, u, params):
        return [max(u[0], 0.0), u[0] ** 3]

    system = ct.NonlinearIOSystem(None, law, inputs=1, outputs=["half", "cube"])
    assert describing_function(system, 2.0) == pytest.approx(0.5, rel=1e-10)
    assert describing_function(system, 2.0, output="cube") == pytest.approx(3.0, rel=1e-10)
    family = describing_function_family(system, [2.0])
    assert family.harmonics[0, 0, 0] == pytest.approx(1 / np.pi, rel=1e-10)
    assert family.regime[0, 0] == "asymmetric"


def test_a_callable_with_memory_is_seen_and_swept():
    class Relay:
        branch = -1.0

        def __call__(self, u):
            if abs(u) > 0.3:
                self.branch = np.sign(u)
            return self.branch

    mine = Relay()
    N = describing_function(mine, 1.0, zero_check=False)
    assert N == pytest.approx(complex(describing_function(relay_with_hysteresis(1, 0.3), 1.0)), abs=2e-3)
    family = describing_function_family(Relay(), [1.0])
    assert 1e-4 < family.residual[0, 0] < 5e-3 and family.regime[0, 0] == "hysteresis"
    assert mine.branch in (-1.0, 1.0)


def test_family_saves_loads_and_makes_frd(tmp_path):
    block = friction_mass(9, 5, 0.5)
    family = describing_function_family(block, [4.0, 8.0, 10.0, 12.0, 16.0], [5.0, 10.0, 20.0])
    assert family.regime[0, 0] == "stuck" and np.isnan(family.N[0, 0])
    back = load_family(family.save(tmp_path / "f.npz"))
    assert (
        np.array_equal(back.harmonics, family.harmonics, equal_nan=True)
        and (back.regime == family.regime).all()
    )
    assert np.allclose(family.frd(11.0).frdata[0, 0], describing_function(block, 11.0, family.omega))
    assert np.array_equal(back.frd(8.0).frdata[0, 0], family.N[1])
    with pytest.warns(DescribingFunctionWarning, match="at 11 is interpolated from 10 and 12.*load_family"):
        between = back.frd(11.0).frdata[0, 0, 0]
    assert between == pytest.approx(family.frd(11.0).frdata[0, 0, 0], rel=0.02)
    with_block = load_family(tmp_path / "f.npz", block)
    assert np.array_equal(with_block.frd(11.0).frdata, family.frd(11.0).frdata)  # no warning
    with pytest.raises(ValueError, match="the block that the family was computed of.*mass=9.1"):
        load_family(tmp_path / "f.npz", friction_mass(9.1, 5, 0.5))
    with pytest.warns(DescribingFunctionWarning, match="stuck at 3 of 3 points, first A=4, omega=5"):
        family.frd(4.0)
    with pytest.raises(ValueError, match="<= amplitude <="):
        family.frd(40.0)
    np.savez(tmp_path / "bad.npz", a=np.array([{}], dtype=object))
    with pytest.raises(ValueError, match="written by Family.save") as refused:
        load_family(tmp_path / "bad.npz")
    assert "allow_pickle" not in str(refused.value)  # numpy's advice would run what the file holds


def test_interrupted_work_resumes(tmp_path, monkeypatch):
    path, calls = tmp_path / "part.npz", []
    block, A = friction_mass(9, 5, 0.5), [6.0, 8.0, 12.0, 20.0]

    def interrupted(method, a, omega, orders):
        calls.append(float(a[0]))
        if len(calls) == 3:
            raise KeyboardInterrupt
        return method.harmonics(a, omega, orders)

    monkeypatch.setattr(work, "compute_part", interrupted)
    with ThreadPoolExecutor(1) as pool, pytest.raises(KeyboardInterrupt):
        describing_function_family(block, A, [5.0, 9.0], executor=pool, save=path)
    with pytest.raises(ValueError, match="[23] of 4"):
        load_family(path)
    with ThreadPoolExecutor(2) as pool:
        family = describing_function_family(block, A, [5.0, 9.0], executor=pool, save=path)
    assert calls.count(6.0) == 1 and calls.count(8.0) == 1
    assert np.array_equal(family.N, describing_function_family(block, A, [5.0, 9.0]).N)
    assert np.array_equal(load_family(path).N, family.N)
    with pytest.raises(ValueError, match="another computation"):
        describing_function_family(friction_mass(9, 5, 0.500000001), A, [5.0, 9.0], save=path)
