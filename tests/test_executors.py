"""Executors: the same numbers by any of them, and one clear error for each that cannot do the work."""

import multiprocessing
import os
import subprocess
import sys
import textwrap
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool

import control as ct
import numpy as np
import pytest

import ctrl_df as cdf
from ctrl_df.df import executors, work
from ctrl_df.df.dispatch import method_for
from ctrl_df.df.saving.journal import lines_done

pytestmark = [
    pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning"),  # Python 3.12, with threads about
    pytest.mark.filterwarnings("ignore:.*aperiodic:RuntimeWarning"),  # backlash rattles somewhere on a grid
]

A, OMEGA = [6.0, 8.0, 12.0, 20.0], [20.0, 30.0]
BACKLASH = cdf.backlash_masses(1, 8, 0.018, 0.2)


class Plain:
    """An executor that knows submit and result, nothing else."""

    def submit(self, f, *args):
        class Future:
            def result(self):
                return f(*args)

        return Future()


class Relay:
    """A law that keeps its own memory."""

    def __init__(self):
        self.branch = 1.0

    def __call__(self, u):
        if abs(u) > 0.3:
            self.branch = np.sign(u)
        return self.branch


def corner(u):
    return max(abs(u) - 0.3, 0.0) * np.sign(u)


def dies(method, a, omega, orders):
    if a[0] == 12.0:
        os._exit(1)
    return method.harmonics(a, omega, orders)


def raises(method, a, omega, orders):
    if a[0] == 12.0:
        raise FloatingPointError("a law of the user's")
    return method.harmonics(a, omega, orders)


SUBJECTS = {
    "friction": (cdf.friction_mass(9, 5, 0.5), dict(A=np.geomspace(4, 40, 30), omega=np.geomspace(1, 50, 7))),
    "velocity": (
        cdf.friction_mass(9, 5, 0.5),
        dict(A=np.geomspace(4, 40, 30), omega=np.geomspace(1, 50, 7), output="v"),
    ),
    "backlash": (BACKLASH, dict(A=np.geomspace(1, 40, 6), omega=np.geomspace(10, 40, 70))),
    "law": (corner, dict(A=np.geomspace(0.1, 30, 150))),
    "element": (cdf.cubic(2.0), dict(A=np.geomspace(0.1, 30, 150), omega=[1.0, 2.0])),
    "memory": (Relay(), dict(A=np.geomspace(0.5, 30, 6))),
    "rate": (cdf.rate_limiter(2.0), dict(A=np.geomspace(0.5, 30, 20), omega=np.geomspace(0.1, 9, 5))),
    "linear": (
        ct.ss([[-1.0, 2.0], [-3.0, 0.0]], [[1], [0]], [[1, 1]], 0),
        dict(A=[1.0, 2.0, 3.0], omega=OMEGA),
    ),
    "orbit": (
        cdf.Mass(9).with_effect(cdf.Stribeck(6.0, 0.01)).with_effect(cdf.Coulomb(5.0)),
        dict(A=[8.0, 10.0, 14.0], omega=[4.0, 6.0]),
    ),
}


@pytest.fixture(scope="module")
def processes():
    with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("fork")) as pool:
        yield pool


@pytest.mark.parametrize("kind", SUBJECTS)
def test_any_executor_gives_bitwise_the_same(kind, processes):
    block, grid = SUBJECTS[kind]
    here = cdf.describing_function_family(block, **grid)
    with ThreadPoolExecutor(3) as threads:
        for executor in (threads, processes, Plain()):
            there = cdf.describing_function_family(block, **grid, executor=executor)
            assert there.harmonics.tobytes() == here.harmonics.tobytes()
            assert (there.regime == here.regime).all()
            assert np.array_equal(there.residual, here.residual, equal_nan=True)


@pytest.mark.parametrize("kind", ["friction", "velocity", "backlash"])
def test_pieces_are_bitwise_the_same_as_the_whole(kind, monkeypatch):
    block, grid = SUBJECTS[kind]
    whole = cdf.describing_function_family(block, **grid)
    monkeypatch.setattr(type(method_for(block)), "at_once", 3)
    pieces = cdf.describing_function_family(block, **grid)
    assert pieces.harmonics.tobytes() == whole.harmonics.tobytes() and (pieces.regime == whole.regime).all()


def test_a_law_with_a_memory_is_not_disturbed():
    mine = Relay()
    cdf.describing_function_family(mine, [0.1, 2.0])
    assert mine.branch == 1.0


@pytest.mark.parametrize("executor", [3, "threads", ProcessPoolExecutor])
def test_an_executor_without_submit_is_refused(executor):
    with pytest.raises(TypeError, match="anything with submit.*Leave it out"):
        cdf.describing_function_family(BACKLASH, A, OMEGA, executor=executor)


def test_a_lambda_and_a_process_pool_are_refused_with_the_remedy(processes, tmp_path):
    with pytest.raises(TypeError, match="can be pickled.*top of a module.*ThreadPoolExecutor"):
        cdf.describing_function_family(
            lambda u: u**3, [1.0, 2.0], executor=processes, save=tmp_path / "f.npz"
        )
    system = ct.nlsys(lambda t, x, u, p: -x + u, inputs=1, outputs=1, states=1)
    with pytest.raises(TypeError, match="can be pickled"):
        cdf.describing_function_family(system, [1.0, 2.0], [1.0], executor=processes)


def test_what_a_foreign_executor_cannot_pickle_is_said_too():
    class Sends(Plain):
        def submit(self, f, *args):
            import pickle

            pickle.dumps(args)

    with pytest.raises(TypeError, match="can be pickled.*top of a module"):
        cdf.describing_function_family(lambda u: u**3, [1.0, 2.0], executor=Sends())


def test_an_executor_that_is_shut_down_is_refused(tmp_path):
    pool = ThreadPoolExecutor(1)
    pool.shutdown()
    with pytest.raises(RuntimeError, match="shut down.*one that is open"):
        cdf.describing_function_family(BACKLASH, A, OMEGA, executor=pool, save=tmp_path / "f.npz")
    assert not list(tmp_path.iterdir())


def test_a_worker_that_dies_is_one_error_and_finished_lines_are_kept(tmp_path, monkeypatch):
    path, whole = tmp_path / "f.npz", cdf.describing_function_family(BACKLASH, A, OMEGA)
    with monkeypatch.context() as patch:
        patch.setattr(work, "compute_part", dies)
        with (
            ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("fork")) as pool,
            pytest.raises(RuntimeError, match="a worker process died. 2 of 4 lines are kept") as died,
        ):
            cdf.describing_function_family(BACKLASH, A, OMEGA, executor=pool, save=path)
    assert not isinstance(died.value, BrokenProcessPool) and lines_done(path) == 2
    done = []
    compute = work.compute_part
    monkeypatch.setattr(work, "compute_part", lambda m, a, *rest: done.append(a[0]) or compute(m, a, *rest))
    again = cdf.describing_function_family(BACKLASH, A, OMEGA, save=path)
    assert done == [12.0, 20.0] and again.harmonics.tobytes() == whole.harmonics.tobytes()


def test_a_law_that_raises_in_a_worker_is_that_error_and_the_rest_is_kept(tmp_path, monkeypatch):
    path = tmp_path / "f.npz"
    monkeypatch.setattr(work, "compute_part", raises)
    with ThreadPoolExecutor(1) as pool, pytest.raises(FloatingPointError, match="a law of the user's"):
        cdf.describing_function_family(BACKLASH, A, OMEGA, executor=pool, save=path)
    assert lines_done(path) >= 2


def test_no_more_is_submitted_than_is_needed(monkeypatch):
    monkeypatch.setattr(executors, "PARTS_AHEAD", 2)
    waiting, most = [0], [0]

    class Counts(Plain):
        def submit(self, f, *args):
            waiting[0] += 1
            most[0] = max(most[0], waiting[0])

            class Future:
                def result(self):
                    waiting[0] -= 1
                    return f(*args)

            return Future()

    cdf.describing_function_family(BACKLASH, A, OMEGA, executor=Counts())
    assert most == [2]


UNGUARDED = """
    import multiprocessing, sys
    from concurrent.futures import ProcessPoolExecutor
    import ctrl_df as cdf
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        cdf.describing_function_family(cdf.backlash_masses(1, 8, .018, .2), [6., 8.], [20.], executor=pool)
"""


def test_spawn_without_a_guard_names_the_guard(tmp_path):
    script = tmp_path / "unguarded.py"
    script.write_text(textwrap.dedent(UNGUARDED))
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, timeout=120)
    last = done.stderr.strip().splitlines()[-1]
    assert last.startswith("RuntimeError: a worker process died") and "__main__" in last
