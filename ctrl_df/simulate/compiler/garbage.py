"""Python looks for garbage less often while machine code is made.

The compiler makes millions of small objects and keeps most of them to the end of a function: looking through
them every few hundred, as Python does, takes a tenth of its time.
"""

from __future__ import annotations

import gc

from numba.core import event

from ..thresholds import COLLECTED


class FewerCollections(event.Listener):
    """Sets the thresholds of collections to `COLLECTED` while what is `wanted` is compiled."""

    def __init__(self, wanted):
        """Listen; `wanted` tells of a dispatcher whether it is one of these."""
        self._wanted, self._within, self._usual = wanted, 0, gc.get_threshold()

    def on_start(self, event):
        """Begin with a function that is compiled within no other of these."""
        if self._within or self._wanted(event.data["dispatcher"]):
            self._within += 1
            if self._within == 1:
                self._usual = gc.get_threshold()
                if 0 < self._usual[0] < COLLECTED[0]:  # else the user wants fewer still, or none
                    gc.set_threshold(*COLLECTED)

    def on_end(self, event):
        """Leave everything as it was, after the outermost."""
        if self._within:
            self._within -= 1
            if not self._within:
                gc.set_threshold(*self._usual)
