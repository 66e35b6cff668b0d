"""Jobs in Python side by side, each in a thread of its own, with its runs; all end at Ctrl-C."""

from __future__ import annotations

import functools
import math
import os
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from typing import Any, Protocol

import numpy as np
from numba.core import config

_here = threading.local()
_at_work: set[int] = set()  # threads that have a job
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_at_work.clear)


class Stopped(Exception):  # noqa: N818 - not an error: the thread that waits was interrupted
    """Raised in a job whose result nobody waits for any more."""


class Elsewhere(Exception):  # noqa: N818 - not an error: the job is done again
    """A job's runs call Python back: they belong in the thread that receives Ctrl-C."""


class TimeUp(Exception):  # noqa: N818 - not an error: no more time was given
    """Raised in the thread that waits when the time of its `Watch` is over and all jobs have stopped."""


class Watch(Protocol):
    """Who waits for the work of a thread.

    Attributes
    ----------
    beat : float
        Seconds after which it is told that jobs go on.
    """

    beat: float

    def left(self) -> float | None:
        """Return how many seconds are left; None: as many as it takes."""
        ...

    def done(self) -> None:
        """Note that one job of many is done."""
        ...

    def waiting(self) -> None:
        """Note now and then that jobs go on."""
        ...


@contextmanager
def watched(watch: Watch) -> Iterator[None]:
    """Let all work of this thread, and its jobs, be watched."""
    before = getattr(_here, "watch", None)
    _here.watch = watch
    try:
        yield
    finally:
        _here.watch = before


@contextmanager
def one_thread_each() -> Iterator[None]:
    """Let linear algebra stay in the thread that asks for it.

    Fits solve many small systems. Threads of BLAS make none of them faster, and wait for the next one by
    keeping the processor busy that another fit could have.
    """
    from threadpoolctl import threadpool_limits

    with threadpool_limits(limits=1, user_api="blas"):
        yield


def check() -> None:
    """Raise `Stopped` or `TimeUp` where the work of this thread is to end; asked between units of work."""
    stop = flag()
    if stop is not None:
        if stop[0]:
            raise Stopped
        return
    seconds = left()
    if seconds is not None and seconds <= 0:
        raise TimeUp


def left() -> float | None:
    """Return how many seconds the work of this thread has; None: as many as it takes."""
    watch = getattr(_here, "watch", None)
    return None if watch is None else watch.left()


def _done() -> None:
    watch = getattr(_here, "watch", None)
    if watch is not None:
        watch.done()


def _await(job: Future) -> None:
    """Wait for a job.

    Raises
    ------
    TimeUp
        The time of this thread's `Watch` is over.
    """
    watch = getattr(_here, "watch", None)
    beat = math.inf if watch is None else watch.beat
    while True:
        rest = left()
        seconds = beat if rest is None else min(rest, beat)
        if wait([job], None if math.isinf(seconds) else seconds).done:
            return
        if rest == seconds:
            raise TimeUp
        if watch is not None:
            watch.waiting()


def processors() -> int:
    """Return how many processors this process may use; ``NUMBA_NUM_THREADS`` bounds it."""
    available = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return max(min(available or 1, getattr(config, "NUMBA_NUM_THREADS", 1)), 1)


@functools.lru_cache(maxsize=8)
def pool(process: int, threads: int, purpose: str) -> ThreadPoolExecutor:
    """Threads for all calls of one process (those of its parent do not survive a fork)."""
    return ThreadPoolExecutor(threads, thread_name_prefix=f"ctrl_df {purpose}")


def spare() -> int:
    """Return how many processors have no job of this process now."""
    return max(processors() - len(_at_work), 0)


def flag() -> np.ndarray | None:
    """Return what asks the jobs of this thread to stop (not zero), (1,); None: it has no such jobs."""
    return getattr(_here, "flag", None)


def require_compiled(engine) -> None:
    """Raise `Elsewhere` where this is a job's thread and an engine calls Python back."""
    if flag() is not None and engine.calls_python:
        raise Elsewhere


def side_by_side(function: Callable, items: Iterable, executor: Executor | None = None) -> list[Any]:
    """Return what a function makes of every item, in their order, on all processors.

    A job that calls side by side itself does its own, and threads that have no job left help. `executor`:
    runs the jobs in place of threads of this process; those that run are waited for.

    Raises
    ------
    KeyboardInterrupt
        Ctrl-C, once all jobs have stopped: with the run they are at, within a fraction of a second.
    TimeUp
        The time of this thread's `Watch` is over; jobs have stopped likewise.
    """
    items = list(items)
    if executor is None and min(processors(), len(items)) < 2:
        return [_alone(function, item) for item in items]
    outer = flag()
    if executor is None and outer is not None:
        return _Shared(function, items, outer).results()
    stop = np.zeros(1, np.int64)
    check()
    if executor is None:
        jobs = [_jobs().submit(_in_a_job, function, item, stop) for item in items]
    else:
        jobs = [executor.submit(function, item) for item in items]
    results = []
    try:
        for item, awaited in zip(items, jobs, strict=True):
            _await(awaited)
            try:
                results.append(awaited.result())
            except Elsewhere:
                results.append(function(item))
            _done()
    except BaseException:
        stop[0] = 1
        wait([started for started in jobs if not started.cancel()])
        raise
    return results


def _jobs() -> ThreadPoolExecutor:
    return pool(os.getpid(), processors(), "jobs")


def _in_a_job(function: Callable, item, stop: np.ndarray):
    """Do one job in this thread, which has none."""
    _here.flag = stop
    _at_work.add(threading.get_ident())
    try:
        if stop[0]:
            raise Stopped
        return function(item)
    finally:
        _here.flag = None
        _at_work.discard(threading.get_ident())


def _alone(function: Callable, item):
    check()
    result = function(item)
    _done()
    return result


class _Shared:
    """Jobs within a job: taken in their order by its thread, and by threads that have none."""

    def __init__(self, function: Callable, items: list, stop: np.ndarray):
        self.function, self.stop = function, stop
        self.waiting = deque((item, Future()) for item in items)
        self.jobs = [job for _, job in self.waiting]

    def results(self) -> list[Any]:
        """Return what the function makes of the items; the first failure in order is raised."""
        # behind all jobs that wait for a thread: who comes to these has nothing else to do
        most = min(processors(), len(self.jobs)) - 1
        helpers = [_jobs().submit(_in_a_job, _Shared.work, self, self.stop) for _ in range(most)]
        self.work()
        _at_work.discard(threading.get_ident())  # its processor is free for runs of the others
        wait([h for h in helpers if not h.cancel()])
        _at_work.add(threading.get_ident())
        return [job.result() for job in self.jobs]

    def work(self) -> None:
        """Do jobs until none is left that nobody does."""
        while self.waiting:
            try:
                item, job = self.waiting.popleft()
            except IndexError:  # another thread was faster
                return
            try:
                job.set_result(_alone(self.function, item))
            except BaseException as failure:
                job.set_exception(failure)
                self.waiting.clear()
