"""Jobs in Python side by side, each with all its runs in a thread of its own; all of them end at Ctrl-C."""

from __future__ import annotations

import functools
import os
import threading
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor, wait
from typing import Any

import numpy as np
from numba.core import config

_here = threading.local()


class Stopped(Exception):  # noqa: N818 - not an error: the thread that waits was interrupted
    """Raised in a job whose result nobody waits for any more."""


class Elsewhere(Exception):  # noqa: N818 - not an error: the job is done again
    """A job's runs call Python back: they belong in the thread that hears Ctrl-C."""


def processors() -> int:
    """Return how many processors this process may use; ``NUMBA_NUM_THREADS`` bounds it."""
    available = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return max(min(available or 1, getattr(config, "NUMBA_NUM_THREADS", 1)), 1)


@functools.lru_cache(maxsize=8)
def pool(process: int, threads: int, purpose: str) -> ThreadPoolExecutor:
    """Threads for all calls of one process (those of its parent do not survive a fork)."""
    return ThreadPoolExecutor(threads, thread_name_prefix=f"ctrl_df {purpose}")


def flag() -> np.ndarray | None:
    """Return what asks the jobs of this thread to stop (not zero), (1,); None: it has no such jobs."""
    return getattr(_here, "flag", None)


def require_compiled(engine) -> None:
    """Raise `Elsewhere` where this is a job's thread and an engine calls Python back."""
    if flag() is not None and engine.calls_python:
        raise Elsewhere


def side_by_side(function: Callable, items: Iterable) -> list[Any]:
    """Return what a function makes of every item, in their order, on all processors.

    A job that calls side by side itself has its own done one after the other.

    Raises
    ------
    KeyboardInterrupt
        Ctrl-C, once all jobs have stopped: with the run they are at, within a fraction of a second.
    """
    items = list(items)
    threads = min(processors(), len(items))
    if threads < 2 or flag() is not None:
        return [function(item) for item in items]
    stop = np.zeros(1, np.int64)

    def job(item):
        _here.flag = stop
        try:
            if stop[0]:
                raise Stopped
            return function(item)
        finally:
            _here.flag = None

    jobs = [pool(os.getpid(), threads, "jobs").submit(job, item) for item in items]
    results = []
    try:
        for item, done in zip(items, jobs, strict=True):
            try:
                results.append(done.result())
            except Elsewhere:
                results.append(function(item))
    except BaseException:
        stop[0] = 1
        wait(jobs)
        raise
    return results
