"""Monitor of a long computation: results so far, who receives them, how long it may last.

Work is done in units, between which it may end: where the time given is over, or at Ctrl-C, it is left where
it stands, and the last result counts.
"""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

from ..checks import CHECK_VALUE, positive, shown
from ..df.work import progress_bar
from ..simulate import parallel
from .interrupts import Interrupts
from .thresholds import PROGRESS_EVERY, PROGRESS_POLL

COMPLETE, UNDER_WAY, BUDGET_SPENT, INTERRUPTED = "complete", "under way", "budget spent", "interrupted"
"""Status of a result."""

_log = logging.getLogger("ctrl_df")
_log.addHandler(logging.NullHandler())


class Monitor:
    """Progress, results and time of a long computation.

    Parameters
    ----------
    owner : str
        The function that was called.
    progress : bool, callable or None
        Whether to tell on stderr what is being done (None: where that is a terminal), or what takes a line
        of text instead.
    callback : callable or None
        Takes every result as it stands; what it returns is ignored, what it raises ends the computation.
    budget : float or None
        Seconds from now on; the first result is waited for in any case.

    Raises
    ------
    TypeError, ValueError
        A `progress` or `callback` that cannot be called, a `budget` that is no positive number.
    """

    def __init__(self, owner: str = "", progress: Any = None, callback: Any = None, budget: Any = None):
        for name, given, others in (
            ("progress", progress, "True, False, None or a function of a line of text"),
            ("callback", callback, "None or a function of the result so far"),
        ):
            truth = name == "progress" and isinstance(given, bool)
            if not (given is None or truth or callable(given)):
                raise TypeError(f"{owner} needs {name} as {others}; got {shown(given)}.")
        self.owner, self.started = owner, time.perf_counter()
        self._latest: tuple[Callable[[], Any], Callable[[], Any]] | None = None  # with care, and at once
        self._callback, self._progress = callback, progress
        self._until = math.inf
        if budget is not None:
            seconds = positive(owner, "budget", budget, "s", remedy=CHECK_VALUE)
            self._until = self.started + seconds
        self._jobs, self._stage, self._bar = 0, "", None
        self._interrupts = Interrupts()
        self._reported = self.started

    # --- what happens on the way ----------------------------------------------------------------------

    def stage(self, text: str) -> None:
        """Tell what is done from here on."""
        parallel.check()
        self._stage, self._jobs = text, 0
        self._tell(text)
        if self._bar is not None:
            self._bar.set_description_str(f"{self.owner}: {text}")

    def _tell(self, text: str) -> None:
        """Log a line, and hand it to who takes lines."""
        line = f"{self.owner}: {time.perf_counter() - self.started:.1f} s, {text}"
        self._reported = time.perf_counter()
        _log.info(line)
        if callable(self._progress):
            self._progress(line)

    def detail(self, text: str, *values) -> None:
        """Log what only a developer wants to know."""
        _log.debug("%s: " + text, self.owner, *values)

    def known(self, result: Any) -> None:
        """Keep a result as it stands, and pass it on."""
        self._keep(lambda: result, lambda: result)

    def _keep(self, make: Callable[[], Any], at_once: Callable[[], Any]) -> None:
        """Keep a result that is made where it is passed on, or where it is the last one known.

        `at_once`: makes it in no time, where a Ctrl-C ends the making of the last one.
        """
        self._latest = make, at_once
        if self._callback is not None or _log.isEnabledFor(logging.DEBUG):
            made = make()
            self._latest = (lambda: made), (lambda: made)
            _log.debug("%s: known so far\n%s", self.owner, made)
            if self._callback is not None:
                self._callback(made)
        parallel.check()

    def within(self, whole: Callable[[Any], Any], at_once: Callable[[Any], Any] | None = None) -> Monitor:
        """Return the monitor of a part: its results count as what `whole` makes of them.

        `at_once`: makes that in no time, where `whole` takes its time.
        """
        return _Part(self, whole, at_once or whole)

    # --- parallel.Watch -----------------------------------------------------------------------------------

    beat = PROGRESS_POLL

    def left(self) -> float | None:
        """Return how many seconds are left; None: no end is set, or nothing is known yet.

        Asked between units of work, it raises KeyboardInterrupt where a Ctrl-C was received and dropped.
        """
        self._interrupts.check()
        if self._latest is None or math.isinf(self._until):
            return None
        return max(self._until - time.perf_counter(), 0.0)

    def done(self) -> None:
        """Count a job."""
        self._jobs += 1
        if self._bar is not None:
            self._bar.update(1)
        self.waiting()

    def waiting(self) -> None:
        """Tell of a stage that lasts how many jobs it has made."""
        if time.perf_counter() - self._reported > PROGRESS_EVERY:
            self._tell(f"{self._stage} ({self._jobs} jobs done)")

    # --- from begin to end ----------------------------------------------------------------------------

    def run(self, work: Callable[[], Any], nothing: Callable[[], Any]) -> Any:
        """Return what `work` comes to, or the last result known where it is ended before.

        `nothing` makes the result as long as none is known.
        """
        try:
            with self._interrupts, parallel.watched(self), parallel.one_thread_each(), self._shown():
                return work()
        except parallel.TimeUp:
            status = BUDGET_SPENT
        except KeyboardInterrupt:
            status = INTERRUPTED
        _log.info("%s: %s after %.1f s, at: %s", self.owner, status, self.seconds, self._stage)
        return replace(self._last(nothing), status=status, seconds=self.seconds)

    def _last(self, nothing: Callable[[], Any]) -> Any:
        """Return the last result known, which a Ctrl-C meanwhile leaves as it is."""
        make, at_once = self._latest or (nothing, nothing)
        try:
            return make()
        except KeyboardInterrupt:
            return at_once()

    @property
    def seconds(self) -> float:
        """Seconds since it started."""
        return time.perf_counter() - self.started

    @contextmanager
    def _shown(self):
        """Show a bar on stderr meanwhile, if one is wanted."""
        if not callable(self._progress):
            self._bar = progress_bar(None, self._progress, self.owner, "job")
        try:
            yield
        finally:
            if self._bar is not None:
                self._bar.close()
                self._bar = None


class _Part(Monitor):
    """The monitor of a part of something larger."""

    def __init__(self, outer: Monitor, whole: Callable[[Any], Any], at_once: Callable[[Any], Any]):
        self.outer, self.whole, self.at_once = outer, whole, at_once
        self.owner, self.started = outer.owner, time.perf_counter()

    def stage(self, text):
        self.outer.stage(text)

    def detail(self, text, *values):
        self.outer.detail(text, *values)

    def known(self, result):
        self._keep(lambda: result, lambda: result)

    def _keep(self, make, at_once):
        self.outer._keep(lambda: self.whole(make()), lambda: self.at_once(at_once()))

    def left(self):
        return self.outer.left()

    def done(self):
        self.outer.done()

    def waiting(self):
        self.outer.waiting()
