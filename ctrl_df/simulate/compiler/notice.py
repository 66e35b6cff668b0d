"""What is said on stderr while machine code is made for the first time: nobody waits without a word."""

from __future__ import annotations

import functools
import sys
import threading
import time
from typing import Any

from numba.core import event

_HINT = "ctrl_df: machine code is made once and kept; `ctrl-df warm-up` does it ahead, on all cores"
PATIENCE = 1.0
"""Seconds that pass without a word: a wait that people notice."""


class Notice(event.Listener):
    """Says what is being compiled, and when it is done; of functions for which `wanted` holds."""

    def __init__(self, wanted):
        """Listen; `wanted` says of a dispatcher whether it is announced."""
        self._wanted = wanted
        self._waiting: list[_Wait] = []  # of functions compiled within each other

    def on_start(self, event):
        """Begin to wait for a function's machine code."""
        self._waiting.append(_Wait(event.data["dispatcher"], self._wanted(event.data["dispatcher"])))

    def on_end(self, event):
        """Stop waiting: it is there, or has failed."""
        if self._waiting:
            self._waiting.pop().over()


class _Wait:
    """One function on its way; silent if it is there soon."""

    def __init__(self, dispatcher: Any, wanted: bool):
        function = dispatcher.py_func
        self._name = f"{function.__module__.partition('.')[2]}.{function.__name__}"
        self._began, self._announced = time.perf_counter(), False
        self._timer = threading.Timer(PATIENCE, self._tell)
        self._timer.daemon = True
        if wanted:
            self._timer.start()

    def _tell(self):
        self._announced = True
        _say_once(_HINT)
        _say(f"ctrl_df: compiling {self._name} ...")

    def over(self):
        self._timer.cancel()
        if self._announced:
            _say(f"ctrl_df: {self._name} compiled in {time.perf_counter() - self._began:.0f} s")


@functools.cache
def _say_once(words: str):
    _say(words)


def _say(words: str):
    if sys.stderr is not None:  # none under pythonw
        print(words, file=sys.stderr, flush=True)
