"""Parts of a family on threads of this process: compiled code, which leaves the interpreter to the others."""

from __future__ import annotations

import os
import threading
from concurrent.futures import CancelledError, Future

from ..simulate.parallel import pool

_here = threading.local()


class Threads:
    """An executor whose work, once started, can be asked to stop.

    Parameters
    ----------
    count : int
        How many work at once.

    Attributes
    ----------
    ahead : int
        Parts to submit before the first is taken: none waits for work, few for being taken.
    """

    def __init__(self, count: int):
        self.ahead = count + 1
        self._pool, self._stop = pool(os.getpid(), count, "family"), threading.Event()

    def submit(self, function, *arguments) -> Future:
        """As `concurrent.futures.Executor.submit`."""
        return self._pool.submit(self._run, function, arguments)

    def stop(self) -> None:
        """Let what has started end at its next `go_on`."""
        self._stop.set()

    def _run(self, function, arguments):
        _here.stop = self._stop
        try:
            return function(*arguments)
        finally:
            _here.stop = None


def on_threads(function, tasks, count: int) -> list:
    """Return ``function(*task)`` for every task, in order, so many at once."""
    count = min(count, len(tasks))
    if count < 2:
        return [function(*task) for task in tasks]
    threads = Threads(count)
    try:
        futures = [threads.submit(function, *task) for task in tasks]
        return [future.result() for future in futures]
    except BaseException:
        threads.stop()
        raise


def go_on() -> None:
    """Raise CancelledError where this thread's work is no longer wanted."""
    stop = getattr(_here, "stop", None)
    if stop is not None and stop.is_set():
        raise CancelledError
