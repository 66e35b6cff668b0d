"""Parts of a computation by an executor: in order, no more ahead than needed, every failure said once."""

from __future__ import annotations

import pickle
from collections import deque
from collections.abc import Callable, Iterable
from concurrent.futures import BrokenExecutor
from typing import Any

from .thresholds import PARTS_AHEAD


def check_picklable(executor, example) -> None:
    """Refuse a process pool for work that cannot be sent to one (TypeError), before it begins."""
    from concurrent.futures import ProcessPoolExecutor  # whoever has no pool need not wait for its import

    if isinstance(executor, ProcessPoolExecutor):
        try:
            pickle.dumps(example)
        except Exception as error:  # pickle has many ways to refuse
            raise _unpicklable(error) from None


def by_executor(
    executor: Any,
    function: Callable,
    tasks: Iterable[tuple[Any, tuple]],
    take: Callable,
    kept: Callable,
    ahead: int | None = None,
):
    """Call ``take(key, function(*arguments))`` for every task, in order.

    Whatever ends it early cancels what has not started, and takes first what is done.

    Parameters
    ----------
    executor : concurrent.futures.Executor or alike
    function : callable
        Of a module, so that it can be sent.
    tasks : iterable of (key, arguments)
    take : callable
    kept : callable
        Says in a sentence what of the work is kept, for the errors.
    ahead : int, optional
        Parts submitted before the first is taken.

    Raises
    ------
    RuntimeError
        A worker died, or the executor is shut down.
    TypeError
        The work cannot be sent to the workers.
    """
    waiting: deque = deque()
    tasks, ahead = iter(tasks), PARTS_AHEAD if ahead is None else ahead
    try:
        while True:
            for key, arguments in tasks:
                waiting.append((key, executor.submit(function, *arguments)))
                if len(waiting) >= ahead:
                    break
            if not waiting:
                return
            value = waiting[0][1].result()
            take(waiting.popleft()[0], value)
    except BaseException as error:
        for _, future in waiting:
            getattr(future, "cancel", bool)()
        for key, future in waiting:
            if _succeeded(future):
                take(key, future.result())
        explained = _explained(error, kept)
        if explained is error:
            raise
        raise explained from error


def _succeeded(future) -> bool:
    try:
        return bool(future.done() and not future.cancelled() and future.exception() is None)
    except AttributeError:  # a future that only knows result()
        return False


def _explained(error, kept):
    if isinstance(error, BrokenExecutor):
        return RuntimeError(
            f"a worker process died. {kept()} Usual causes: no memory left (give fewer workers), a block "
            "from the prompt or a notebook, which workers cannot import (write it into a module), or a "
            'script without `if __name__ == "__main__":` around what it runs.'
        )
    if isinstance(error, RuntimeError) and "schedule new futures after" in str(error):
        return RuntimeError(f"the executor is shut down. {kept()} Give one that is open.")
    if isinstance(error, pickle.PicklingError) or "pickle" in str(error).lower().split("(")[0]:
        return _unpicklable(error)
    return error


def _unpicklable(error):
    return TypeError(
        f"a process pool needs a block that can be pickled; got {error}. Write the function with def at the "
        "top of a module, use a ThreadPoolExecutor, or leave executor out."
    )
