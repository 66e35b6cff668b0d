"""Ctrl-C while a long computation runs: never lost, wherever it meets Python."""

from __future__ import annotations

import signal
import threading

from ..simulate.program import pointers

_DROPS = ("weakref", "_weakrefset", pointers.__name__)
"""Modules whose functions are called back where an exception would be printed and dropped."""


class Interrupts:
    """Receives Ctrl-C in the main thread, in the place of Python's own handler, which is put back at the end.

    It is raised as KeyboardInterrupt where it arrives. Where that cannot be caught (in a callback of a weak
    reference, on the threshold of a law called back by machine code), or was dropped, it is raised at the
    next `check`. A handler that someone else has set stays.
    """

    def __init__(self):
        self.received = self._mine = False

    def __enter__(self):
        self._mine = (
            threading.current_thread() is threading.main_thread()
            and signal.getsignal(signal.SIGINT) is signal.default_int_handler
        )
        if self._mine:
            signal.signal(signal.SIGINT, self._hear)
        return self

    def __exit__(self, *_):
        if self._mine:
            signal.signal(signal.SIGINT, signal.default_int_handler)

    def _hear(self, number, frame):
        self.received = True
        module = "" if frame is None else frame.f_globals.get("__name__", "")
        if module == pointers.__name__:
            pointers.raised.append(KeyboardInterrupt())  # ends the run that has called back
        if module not in _DROPS:
            signal.default_int_handler(number, frame)

    def check(self) -> None:
        """Raise KeyboardInterrupt where a Ctrl-C was received."""
        if self.received:
            raise KeyboardInterrupt
