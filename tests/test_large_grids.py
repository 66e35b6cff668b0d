"""Large grids: bounded memory, Ctrl-C within a second, the same crossings; too large ones are refused."""

import re
import signal
import subprocess
import sys
import textwrap
import time
import tracemalloc

import control as ct
import numpy as np
import pytest

import ctrl_df as cdf
from ctrl_df.df.work import require_room
from ctrl_df.limit_cycles.predicted import crossings
from ctrl_df.limit_cycles.predicted.crossings import find_crossings

FRICTION = cdf.friction_mass(9, 5, 0.5)
PID = cdf.pid(2000, 44250, 130)


def box(na, nw=None):
    return np.geomspace(4, 60, na), np.geomspace(4, 40, nw or na)


def test_a_family_that_does_not_fit_is_refused_at_once_with_the_size_that_would_do():
    start = time.monotonic()
    for call in (
        lambda: cdf.describing_function_family(FRICTION, *box(100_000)),
        lambda: cdf.describing_function_response(PID, FRICTION, *box(100_000)),
    ):
        with pytest.raises(ValueError, match="100000 x 100000 points with 9 harmonics needs 2.32e.*GB") as no:
            call()
    assert time.monotonic() - start < 5
    side = int(re.search(r"at most (\d+) x \1 points", str(no.value))[1])
    require_room(side, side, 9)
    with pytest.raises(ValueError):
        require_room(side + 1, side + 1, 9)
    assert side > 3000


def peak(call):
    call()  # what is compiled or imported on the way does not count
    tracemalloc.start()
    try:
        result = call()
        return tracemalloc.get_traced_memory()[1], result
    finally:
        tracemalloc.stop()


def size(family):
    return family.harmonics.nbytes + family.regime.nbytes + family.residual.nbytes


@pytest.mark.parametrize("block", [FRICTION, cdf.saturation(5.0), lambda x: np.clip(x, -5, 5)])
def test_a_family_needs_little_more_memory_than_its_result(block):
    most, family = peak(lambda: cdf.describing_function_family(block, *box(600)))
    assert most < 1.3 * size(family)  # 1.03 to 1.2 measured


@pytest.mark.parametrize(("H", "block"), [(PID, FRICTION), (ct.tf([30], [1, 2, 1, 0]), cdf.saturation(5.0))])
def test_the_search_for_crossings_needs_little_more_memory_than_the_family(H, block):
    most, found = peak(lambda: cdf.describing_function_response(H, block, *box(800)))
    assert most < 1.6 * size(found.family)


def test_a_fine_grid_finds_the_same_crossings_as_a_coarse_one():
    coarse = cdf.describing_function_response(PID, FRICTION, *box(30))
    fine = cdf.describing_function_response(PID, FRICTION, *box(500))
    places = [[(c.amplitude, c.omega) for c in r.limit_cycles] for r in (coarse, fine)]
    assert len(places[0]) == 2 and np.allclose(*places, rtol=1e-11, atol=0)


def test_cells_are_the_same_in_blocks(monkeypatch):
    rng = np.random.default_rng(1)
    values = rng.normal(size=(60, 41)) + 1j * rng.normal(size=(60, 41))
    values += np.linspace(-3, 3, 60)[:, None]
    values[rng.random(values.shape) < 0.1] = np.nan
    whole = crossings._may_hold_zero(values)
    for points in (1, 41, 200):
        monkeypatch.setattr(crossings, "CELLS_AT_ONCE", points)
        assert np.array_equal(crossings._may_hold_zero(values), whole)


def test_where_the_search_is_cut_short_it_looks_where_zeros_are_likeliest(monkeypatch):
    """A zero at the far end of the grid, and hundreds of cells before it that only might hold one."""

    def D(p, q):
        return (p - 0.9) + 1j * (q - 0.8) * (p - 0.9) + 1e-3j * np.sin(40 * q) + 1j * (q - 0.8)

    p, q = np.linspace(0, 1, 80), np.linspace(0, 1, 80)
    P, Q = np.meshgrid(p, q, indexing="ij")
    values = D(P, Q)
    values[:40:2, ::2] = np.nan  # every cell around may hold anything
    values[1:40:2, :] *= 0.3
    whole = find_crossings(D, p, q, values)
    monkeypatch.setattr(crossings, "MOST_STARTS", 20)
    few = find_crossings(D, p, q, values)
    assert few.truncated and len(whole.crossings) == len(few.crossings) == 1
    assert few.crossings[0].omega == pytest.approx(whole.crossings[0].omega, rel=1e-10)


def zeros_one_by_one(log_a, log_w, values, chosen):
    found = []
    for i, k in zip(*np.nonzero(chosen), strict=True):
        for corner, along_a, along_w, sign in (
            ((i, k), (i + 1, k), (i, k + 1), 1),
            ((i + 1, k + 1), (i, k + 1), (i + 1, k), -1),
        ):
            D0 = values[corner]
            Da, Dw = values[along_a] - D0, values[along_w] - D0
            M = np.array([[Da.real, Dw.real], [Da.imag, Dw.imag]])
            if np.isfinite(M).all():
                s, t = np.linalg.solve(M, [-D0.real, -D0.imag])
                if s >= 0 and t >= 0 and s + t <= 1:
                    step = s * (log_a[i + 1] - log_a[i]), t * (log_w[k + 1] - log_w[k])
                    found.append((log_a[corner[0]] + sign * step[0], log_w[corner[1]] + sign * step[1]))
    return np.array(found)


def test_zeros_of_the_interpolant_are_found_all_at_once(monkeypatch):
    monkeypatch.setattr(crossings, "CELLS_AT_ONCE", 100)
    rng = np.random.default_rng(2)
    a, w = np.sort(rng.random(40)), np.sort(rng.random(30))
    values = rng.normal(size=(40, 30)) + 1j * rng.normal(size=(40, 30))
    values[rng.random(values.shape) < 0.1] = np.nan
    chosen = rng.random((39, 29)) < 0.7
    expected = zeros_one_by_one(a, w, values, chosen)
    assert len(expected) > 100
    assert np.allclose(crossings.linear_zeros(a, w, values, chosen), expected, rtol=1e-9, atol=1e-12)
    assert crossings.linear_zeros(a, w, values, chosen & False).shape == (0, 2)


LONG = {
    "one line of orbits": """
        block = cdf.Mass(9).with_effect(cdf.Stribeck(6.0, 0.01)).with_effect(cdf.Coulomb(5.0))
        warm, A, omega = [8.0, 9.0, 10.0], np.geomspace(7, 400, 40000), [5.0]
    """,
    "irregular impacts": """
        block = cdf.backlash_masses(1, 8, 0.018, 0.98)
        warm, A, omega = [8.0], np.geomspace(.3, 400, 500), np.geomspace(10, 40, 2000)
    """,
    "dry friction": """
        block = cdf.friction_mass(9, 5, 0.5)
        warm, A, omega = [8.0], np.geomspace(4, 60, 20), np.geomspace(.1, 1e3, 400_000)
    """,
}
RUN = """{grid}
cdf.describing_function_family(block, warm, [5.0])
print("begins", flush=True)
try:
    cdf.describing_function_family(block, A, omega, progress=False)
except KeyboardInterrupt as stopped:
    print(stopped, flush=True)
"""


def test_an_interrupt_ends_compiled_work_within_a_second():
    """One kind of work after another, in a process of their own."""
    work = [RUN.format(grid=textwrap.dedent(grid)) for grid in LONG.values()]
    process = subprocess.Popen(
        [
            sys.executable,
            "-c",
            "import warnings; warnings.simplefilter('ignore')\nimport ctrl_df as cdf, numpy as np"
            + "".join(work),
        ],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        for kind in LONG:
            assert process.stdout.readline() == "begins\n", kind
            time.sleep(0.5)
            assert process.poll() is None
            sent = time.monotonic()
            process.send_signal(signal.SIGINT)
            said = process.stdout.readline()
            assert time.monotonic() - sent < 2, kind  # 0.5 s measured, on a busy machine
            assert re.match(r"stopped. \d+ of \d+ lines", said), kind
        assert process.communicate(timeout=30)[1] == "" and process.returncode == 0
    finally:
        process.kill()
        process.wait()
