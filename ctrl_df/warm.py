"""Compiling ahead: all that the package compiles on first use, side by side, kept for every process."""

from __future__ import annotations

import contextlib
import os
import queue
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .checks import flag


def warm_up(progress: bool | None = None) -> None:
    """Compile in advance what would be compiled on first use, in several processes at once.

    For an image, the workers of a cluster, or a lecture: afterwards nothing in the package waits for a
    compiler. If everything is compiled already it takes seconds.

    Parameters
    ----------
    progress : bool, optional
        Whether to report progress on stderr; by default if that is a terminal.

    Raises
    ------
    RuntimeError
        A step failed; its message is the last line of what it wrote.

    Examples
    --------
    >>> cdf.warm_up()  # doctest: +SKIP
    """
    if progress is not None:
        flag("warm_up", "progress", progress)
    shows = sys.stderr.isatty() if progress is None else progress
    began = time.perf_counter()
    for done, name in enumerate(_side_by_side(), 1):
        if shows:
            spent = time.perf_counter() - began
            print(
                f"ctrl-df warm-up: {done} of {len(STEPS)}, {name}, {spent:.0f} s", file=sys.stderr, flush=True
            )


def is_warm() -> bool:
    """Return whether machine code of the engine is kept, as new as its sources (or none is wanted)."""
    from .simulate.kernel import driver

    kept = getattr(driver.advance, "_cache", None)  # none where numba is switched off
    return kept is None or kept.known


def work() -> None:
    """Compile steps whose names come line by line on stdin, and say the name of each that is done."""
    for name in map(str.strip, sys.stdin):
        STEPS[name].compile()
        print(name, flush=True)


def _side_by_side():
    """Yield the steps as they are done, by as many processes as there are processors.

    Each goes on with step after step: what functions have in common it types and lowers once.
    """
    from .simulate.parallel import processors

    waiting, done, workers, free = list(STEPS), set(), [], []
    messages: queue.Queue = queue.Queue()
    try:
        while len(done) < len(STEPS):
            while name := next((name for name in waiting if STEPS[name].after in done | {None}), None):
                if not free and len(workers) < processors():
                    workers.append(_Worker(messages))
                    free.append(workers[-1])
                if not free:
                    break
                waiting.remove(name)
                free.pop(0).begin(name)
            worker, name = messages.get()
            if not name:
                raise RuntimeError(f"compiling {worker.name} failed: {worker.last_words()}")
            free.append(worker)
            done.add(name)
            yield name
    finally:
        for worker in workers:
            worker.end()


class _Worker:
    """A process that compiles steps of this very package, whatever folder it is started in."""

    def __init__(self, messages: queue.Queue):
        paths = os.pathsep.join([str(Path(__file__).parents[1]), *filter(None, sys.path)])
        self.name, self._messages, self._errors = "", messages, tempfile.TemporaryFile()
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-c", "from ctrl_df.warm import work; work()"],
            env={**os.environ, "PYTHONPATH": paths},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            text=True,
        )
        self._listener = threading.Thread(target=self._listen, daemon=True)
        self._listener.start()

    def begin(self, name: str):
        """Let it compile a step."""
        self.name = name
        with contextlib.suppress(OSError):  # it has died: `_listen` tells
            print(name, file=self._process.stdin, flush=True)

    def _listen(self):
        for line in self._process.stdout or ():
            self._messages.put((self, line.strip()))
        self._messages.put((self, ""))

    def last_words(self) -> str:
        """Return the last line of what it wrote before it died."""
        code = self._process.wait()
        self._errors.seek(0)
        said = self._errors.read().decode(errors="replace").strip().splitlines()
        return said[-1] if said else f"exit code {code}"

    def end(self):
        """End the process, whatever it is doing."""
        self._process.kill()
        self._process.wait()
        self._listener.join()
        for stream in (self._process.stdin, self._process.stdout, self._errors):
            with contextlib.suppress(OSError):  # what nobody reads any more
                stream.close()  # type: ignore[union-attr]


def _engine():
    from .blocks.mechanism import friction_mass
    from .simulate.response import event_response

    event_response(friction_mass(1, 1, 1), [0.0, 1.0], 2.0)


def _paces():
    from .simulate.kernel import pace

    for curved in (False, True):
        pace.address(curved)


def _laws():
    from .blocks.effect import effect_library
    from .blocks.elements.memoryless import cubic
    from .identify.smoothing.steps import Disturbance
    from .simulate.engine import Engine
    from .simulate.program.nodes import signature_of
    from .simulate.program.pointers import address

    for effect in (*effect_library().values(), Disturbance):
        law = getattr(effect, "law", None)
        if law is not None:
            address(law, signature_of(effect))
    Engine(cubic(1.0))


def _friction_family():
    from .blocks.mechanism import friction_mass

    _family(friction_mass(9, 5, 0.5))


def _backlash():
    from .blocks.mechanism import backlash_masses
    from .df.closed_form.backlash_branches import backlash_branches

    block = backlash_masses(1, 8, 0.018, 0.8)
    _family(block)
    force, omega = np.array([10.0]), np.array([125.0])
    for branch in backlash_branches(block, force, omega, force, omega):
        branch.motions(branch.grid, np.full(branch.grid.size, 125.0), 1)


def _general_family():
    from .blocks.effects import Coulomb, CubicSpring
    from .blocks.mechanism import Mass

    _family(Mass(9.0).with_effect(Coulomb(5.0)).with_effect(CubicSpring(1e4)))
    # a motion that never repeats itself: all that looks for periods has then run
    _family(Mass(2.0).with_effect(CubicSpring(2e4)).with_effect(Coulomb(1.0)), [26.0], [4.9])


def _family(block, amplitudes=(20.0, 24.0, 30.0), omega=(9.0, 10.0)):
    from .df.describing import quiet_family

    quiet_family(block, np.array(amplitudes), np.array(omega))


def _orbit():
    from .blocks.mechanism import friction_mass
    from .blocks.pid import pid
    from .limit_cycles.finder import find_limit_cycle
    from .simulate.loop import closed_loop

    loop = closed_loop(pid(2000, 44250, 130), friction_mass(9, 5, 0.5))
    find_limit_cycle(loop, (11, 13.8))
    find_limit_cycle(loop)


def _many_runs():
    from .blocks.mechanism import friction_mass
    from .simulate.batch import batch_response

    batch_response(friction_mass(1, 1, 1), np.linspace(0, 1, 9), 2.0)


def _smoother():
    from .identify.smoothing.kalman import smoothed

    one, rows, more = np.ones((1, 1, 1)), np.ones((1, 1)), np.ones((2, 1, 1))
    smoothed(one, rows, one, more, np.ones((2, 1)), np.ones(1), rows)


def _imposed_motion():
    from .blocks.effects import Coulomb
    from .blocks.massless import Massless
    from .simulate.imposed_response import imposed_response

    imposed_response(Massless().with_effect(Coulomb(5.0)), np.linspace(0, 1, 9), np.linspace(0, 1, 9) ** 2)


@dataclass(frozen=True)
class Step:
    """What compiles a part of the package, and the step that must be done before it, if any."""

    compile: Callable[[], None]
    after: str | None = None


# the long ones first
STEPS = {
    "engine": Step(_engine), "paces": Step(_paces), "backlash": Step(_backlash),
    "exact orbits": Step(_orbit, after="engine"), "general family": Step(_general_family, after="engine"),
    "friction family": Step(_friction_family), "smoother": Step(_smoother),
    "imposed motion": Step(_imposed_motion), "many runs": Step(_many_runs, after="engine"),
    "laws": Step(_laws),
}  # fmt: skip
