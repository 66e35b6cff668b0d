"""Jobs side by side: in order, each with its runs in one thread, the first failure told, Ctrl-C heard."""

import signal
import threading
import time

import control as ct
import numpy as np
import pytest
import rigs

import ctrl_df as cdf
from ctrl_df.identify.prediction.segments import equal_segments
from ctrl_df.identify.prediction.simulator import Simulator
from ctrl_df.simulate import parallel, runs

T = 1e-3 * np.arange(2000)
RECORD = cdf.Measurement(T, np.sin(9 * T), 0.01 * np.sin(9 * T) + 1e-5 * np.cos(777 * T))
BLOCK = cdf.Mass(2.0, [cdf.Coulomb(0.2), cdf.Viscous(3.0)])


@pytest.fixture(autouse=True)
def two_threads(monkeypatch):
    monkeypatch.setattr(parallel, "processors", lambda: 2)
    monkeypatch.setattr(runs, "STEPS_ALONE", 0)  # no run is too small to be shared


def output(mass):
    block = BLOCK.with_parameters({"mass": mass})
    return Simulator(block, RECORD).run(equal_segments(RECORD, 4))


def test_numbers_are_those_of_one_thread_and_in_order():
    masses = np.linspace(1, 3, 9)
    first, second = (parallel.side_by_side(output, masses) for _ in range(2))
    for a, b, mass in zip(first, second, masses, strict=True):
        assert np.array_equal(a, b)
        assert np.array_equal(a, output(mass))


def test_a_job_that_is_the_last_has_its_runs_made_by_processors_without_one(monkeypatch):
    alone, threads, work = output(1.5), set(), runs._Work._work

    def seen(self, todo):
        threads.add(threading.current_thread().name)
        work(self, todo)

    monkeypatch.setattr(runs._Work, "_work", seen)
    monkeypatch.setattr(parallel, "spare", lambda: 1)
    many = parallel.side_by_side(output, [1.5, 2.5])
    assert np.array_equal(many[0], alone) and np.array_equal(many[1], output(2.5))
    assert {name.rpartition("_")[0] for name in threads} == {"ctrl_df jobs", "ctrl_df runs"}


def test_a_diagnosis_repeats_itself_to_the_last_bit(monkeypatch):
    """Laws that are not smooth make much of a last bit: which one is named must not hang on who ran first."""
    rig = rigs.draw("stiction", 5, ratio=1.0, snr_db=40, n=400)
    record, found = rig.train[0].measurement(), []
    for threads in (2, 1):
        monkeypatch.setattr(parallel, "processors", lambda threads=threads: threads)
        diagnosis = cdf.diagnose(rig.baseline, record, candidates=("stiction",))
        found.append([(c.id, c.evidence, dict(c.parameters)) for c in diagnosis.ranking])
    assert found[0] == found[1]


def test_threads_without_a_job_help_with_jobs_within_jobs():
    def inner(i):
        time.sleep(0.05)
        return i, threading.get_ident()

    def job(i):
        return parallel.side_by_side(inner, range(4)) if i else []

    _, found = parallel.side_by_side(job, range(2))
    assert [i for i, _ in found] == [0, 1, 2, 3]
    assert len({ident for _, ident in found}) == 2 and threading.get_ident() not in {t for _, t in found}


def test_jobs_within_jobs_within_jobs_come_to_an_end():
    def of(depth):
        def job(i):
            return i if depth == 0 else sum(parallel.side_by_side(of(depth - 1), range(3)))

        return job

    assert parallel.side_by_side(of(4), range(3)) == [3**4] * 3


def test_the_first_failure_of_jobs_within_jobs_is_told():
    def inner(i):
        time.sleep(0.02 * (3 - i))
        if i:
            raise ValueError(f"job {i}")

    with pytest.raises(ValueError, match="job 1"):
        parallel.side_by_side(lambda i: parallel.side_by_side(inner, range(3)) if i else None, range(2))


def test_the_first_failure_in_order_is_told():
    def job(i):
        if i:
            raise ValueError(f"job {i}")
        time.sleep(0.05)

    with pytest.raises(ValueError, match="job 1"):
        parallel.side_by_side(job, range(4))


def test_runs_that_call_python_back_are_done_where_ctrl_c_is_heard():
    python = ct.nlsys(
        lambda t, x, u, p: [x[1], u[0] - x[1]],
        lambda t, x, u, p: [x[0]], states=2, inputs=1, outputs=1,
    )  # fmt: skip
    seen = []

    def job(i):
        y = Simulator(python, RECORD).run(equal_segments(RECORD, 1))
        seen.append(threading.current_thread() is threading.main_thread())
        return y

    first, second = parallel.side_by_side(job, range(2))
    assert seen == [True, True] and np.array_equal(first, second)


def test_ctrl_c_ends_all_jobs():
    def job(_):
        for _ in range(2000):
            output(2.0)

    main = threading.main_thread().ident
    threading.Timer(0.5, lambda: signal.pthread_kill(main, signal.SIGINT)).start()
    began = time.perf_counter()
    with pytest.raises(KeyboardInterrupt):
        parallel.side_by_side(job, range(4))
    assert time.perf_counter() - began < 5
    assert len(parallel.side_by_side(output, (1.0, 2.0))) == 2
