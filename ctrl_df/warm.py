"""Compiling ahead: all that the package compiles on first use, side by side, kept for every process."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

from .checks import flag


def warm_up(progress: bool | None = None) -> None:
    """Compile ahead what is compiled on first use, in several processes at once.

    For an image, the workers of a cluster, or a lecture: afterwards nothing in the package waits for a
    compiler. What is compiled already takes seconds.

    Parameters
    ----------
    progress : bool, optional
        Whether to tell on stderr what is done; by default where that is a terminal.

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
    told = sys.stderr.isatty() if progress is None else progress
    began, done, total = time.perf_counter(), 0, sum(map(len, STAGES))
    for stage in STAGES:
        for name in _side_by_side(stage):
            done += 1
            if told:
                spent = time.perf_counter() - began
                print(
                    f"ctrl-df warm-up: {done} of {total}, {name}, {spent:.0f} s", file=sys.stderr, flush=True
                )


def is_warm() -> bool:
    """Return whether machine code of the engine is kept, as new as its sources (or none is wanted)."""
    from .simulate.kernel import driver

    kept = getattr(driver.advance, "_cache", None)  # none where numba is switched off
    return kept is None or kept.known


def step(name: str) -> None:
    """Compile one step (a name in `STAGES`) in this process."""
    next(stage[name] for stage in STAGES if name in stage)()


def _side_by_side(names):
    """Run steps in processes of their own, as many at once as there are processors; yield those done."""
    from .simulate.runs import processors

    waiting, running = list(names), {}
    try:
        while waiting or running:
            while waiting and len(running) < processors():
                name = waiting.pop(0)
                running[name] = _start(name)
            for name, process in list(running.items()):
                if process.poll() is None:
                    continue
                del running[name]
                said = process.communicate()[1].decode(errors="replace").strip().splitlines()
                if process.returncode != 0:
                    raise RuntimeError(f"compiling {name} failed: {said[-1] if said else process.returncode}")
                yield name
            time.sleep(0.05)
    finally:
        for process in running.values():
            process.kill()
            process.communicate()


def _start(name):
    """Begin a step in a process that imports this very package, whatever folder it is started in."""
    code = f"from ctrl_df.warm import step; step({name!r})"
    paths = os.pathsep.join([str(Path(__file__).parents[1]), *filter(None, sys.path)])
    return subprocess.Popen(
        [sys.executable, "-P", "-c", code],
        env={**os.environ, "PYTHONPATH": paths},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
    )


def _simulation():
    from .blocks.mechanism import friction_mass
    from .simulate.response import event_response

    event_response(friction_mass(1, 1, 1), np.linspace(0, 1, 9), 2.0)


def _curved_laws():
    from .blocks.effects import Coulomb, CubicSpring
    from .blocks.mechanism import Mass
    from .simulate.response import event_response

    event_response(
        Mass(1.0).with_effect(Coulomb(1.0)).with_effect(CubicSpring(1.0)), np.linspace(0, 1, 9), 2.0
    )


def _laws():
    from .blocks.effect import effect_library
    from .blocks.memoryless import cubic
    from .simulate.engine import Engine
    from .simulate.program.nodes import signature_of
    from .simulate.program.pointers import address

    for effect in effect_library().values():
        law = getattr(effect, "law", None)
        if law is not None:
            address(law, signature_of(effect))
    Engine(cubic(1.0))


def _friction_family():
    from .blocks.mechanism import friction_mass

    _family(friction_mass(9, 5, 0.5))


def _backlash_family():
    from .blocks.mechanism import backlash_masses

    _family(backlash_masses(1, 8, 0.018, 0.2))


def _general_family():
    from .blocks.effects import Coulomb, CubicSpring
    from .blocks.mechanism import Mass

    _family(Mass(9.0).with_effect(Coulomb(5.0)).with_effect(CubicSpring(1e4)))


def _family(block):
    from .df.describing import describing_function_family

    describing_function_family(block, np.array([20.0, 24.0, 30.0]), np.array([9.0, 10.0]))


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


def _imposed_motion():
    from .blocks.effects import Coulomb
    from .blocks.massless import Massless
    from .simulate.imposed_response import imposed_response

    imposed_response(Massless().with_effect(Coulomb(5.0)), np.linspace(0, 1, 9), np.linspace(0, 1, 9) ** 2)


# the engine is compiled in the first stage, once; what calls it in the second
STAGES = (
    {"simulation": _simulation, "backlash family": _backlash_family, "laws": _laws,
     "friction family": _friction_family},
    {"curved laws": _curved_laws, "general family": _general_family, "exact orbits": _orbit,
     "many runs": _many_runs, "imposed motion": _imposed_motion},
)  # fmt: skip
