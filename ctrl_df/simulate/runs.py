"""Many runs in one call: shared out among threads, none of which needs the interpreter."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Sequence
from concurrent.futures import wait
from contextlib import ExitStack
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..cached import cached_property
from ..status import Status
from . import parallel
from .engine import STATUS
from .groups import Group
from .kernel import many
from .kernel.many import Drives, Rows
from .kernel.run import reasons
from .kernel.space import pooled_space
from .kernel.task import Accuracy
from .parallel import processors
from .program import pointers
from .program.layout import H_AFFINE
from .thresholds import HEIGHT, MAX_STEPS, RTOL, STATE_MOST, STEPS_ALONE, TOGETHER_RUNS

_ready: set[int] = set()  # kinds of laws (`H_AFFINE`) for which this process has the machine code
_SHARES = 8  # a thread's part is cut into so many, so that all end at about the same time


def sampled_drives(time, samples, hold: str) -> Drives:
    """External inputs as of `sampled_drive`: `time` (nt,) or (k, nt) [s], `samples` (k, nr, nt)."""
    samples = np.require(samples, float, ["C", "W"])
    time = np.array(np.atleast_2d(time), dtype=float, order="C")
    k, nr, _ = samples.shape
    return Drives(time, samples, int(hold == "linear"), np.zeros((k, nr, 0), complex), np.zeros(k))


def harmonic_drives(coefficients, omega) -> Drives:
    """External inputs as of `harmonic_drive`: `coefficients` (k, nr, nh) complex, `omega` (k,) [rad/s]."""
    c = np.array(coefficients, dtype=complex, order="C")
    omega = np.array(np.broadcast_to(omega, c.shape[:1]), dtype=float, order="C")
    return Drives(np.zeros((1, 0)), np.zeros((*c.shape[:2], 0)), 1, c, omega)


@dataclass
class Runs:
    """Outcome of `run_many`; the first axis is the run, unless said otherwise."""

    rows: Rows
    states: np.ndarray | None  # (total, nx), if kept
    events: tuple[np.ndarray, ...] | None = None  # run, time, node, kind, in the order of runs, if kept
    errors: dict[int, Exception] = field(default_factory=dict)  # what functions called back raised, by run

    @property
    def outputs(self) -> np.ndarray:
        """Outputs at the output times, (total, ny): those of each run behind those of the one before."""
        return self.rows.outputs

    @property
    def x(self) -> np.ndarray:
        """State in which each ended, (runs, nx)."""
        return self.rows.x

    @property
    def recorded(self) -> np.ndarray:
        """Output times reached; NaN stands behind them."""
        return self.rows.clock[:, 1].astype(int)

    @property
    def time(self) -> np.ndarray:
        """When each ended [s]."""
        return self.rows.clock[:, 0].copy()

    @property
    def steps(self) -> np.ndarray:
        """Steps taken."""
        return self.rows.clock[:, 3].astype(int)

    @property
    def propagated(self) -> np.ndarray:
        """Those of them by constant propagators."""
        return self.rows.clock[:, 9].astype(int)

    @property
    def event_count(self) -> np.ndarray:
        """Events located."""
        return self.rows.events

    @cached_property
    def status(self) -> list[Status]:
        """How each ended."""
        status = [STATUS[int(r)] for r in self.rows.reason]
        for run in self.errors:
            status[run] = Status.USER_ERROR
        return status


def run_many(
    groups: Sequence[Group],
    x0,
    begin,
    end,
    times,
    drives: Drives,
    *,
    drive: Any = 0,
    first: Any = 0,
    count: Any = None,
    order: int = 8,
    rtol: float = RTOL,
    atol: float | None = None,
    max_step: float = np.inf,
    height: float | None = None,
    max_steps: Any = MAX_STEPS,
    after: Any = -1,
    hidden: np.ndarray | None = None,
    states: bool = False,
    events: bool = False,
    threads: int | None = None,
) -> Runs:
    """Run many systems or one system many times, each from a fresh state, on all cores.

    What is said to be "(runs,)" may be one number for all runs. The numbers are the same to the last bit
    whatever the number of threads and whatever other runs are made in the same call.

    Parameters
    ----------
    groups : sequence of Group
        The systems; every run is in one group. All have the same numbers of states, inputs and outputs.
    x0 : (runs, nx) array
        States to begin with.
    begin, end : (runs,) arrays
        From when to when each runs [s].
    times : (nt,) array
        Output times [s], ascending within a run: all runs have all of them, or run i has
        ``times[first[i] : first[i] + count[i]]``.
    drives : Drives
        External inputs, from `sampled_drives` or `harmonic_drives`.
    drive : (runs,) int array
        Which of them drives each run.
    first, count : (runs,) int arrays
        See `times`; `count` None: up to the end of `times`.
    order, rtol, atol, max_step, height
        As in `Engine.run`, the same for all runs.
    max_steps : (runs,) int array
        Bound on the work of each.
    after : (runs,) int array
        Behind which run, one of the same system that its group names before it, each goes on in its `hidden`
        states; -1, and where that run fails: behind none.
    hidden : (nx, nx) array or None
        Projection on these states: a run begins in ``x0 + hidden (x - x0)``, x being where the other ended.
    states, events : bool
        Whether to keep the states at the output times, and the events.
    threads : int or None
        How many at once; None: as many as there are processors for this process. Runs that call Python back
        are made one after the other whatever is asked.

    Returns
    -------
    Runs
        A run that fails leaves NaN behind what it has reached; no run stops the others.

    Raises
    ------
    KeyboardInterrupt
        Ctrl-C, within a fraction of a second.
    parallel.Stopped, parallel.TimeUp
        Nobody waits for these runs any more.
    """
    parallel.check()
    runs = sum(len(g.runs) for g in groups)
    engine = groups[0].engine
    rows = _rows(groups, runs, x0, begin, end, times, drive, first, count, max_steps, after, hidden, engine)
    kept = np.empty((len(rows.outputs) if states else int(rows.count.max(initial=0)), engine.nstates))
    atol = 0.0 if atol is None else float(atol)
    height = max(rtol, HEIGHT) if height is None else float(height)
    accuracy = Accuracy(int(order), float(rtol), atol, float(max_step), height)
    alone = any(g.engine.calls_python for g in groups)
    job = None if alone else parallel.flag()
    stop = np.zeros(1, np.int64) if job is None else job
    work = _Work(groups, rows, drives, accuracy, kept, states, events, stop)
    if alone:
        work.one_by_one()
    elif work.small:
        work.here()
    else:
        share = work.on_threads if job is None else work.as_job
        share(processors() if threads is None else threads)
    return Runs(rows, kept if states else None, work.events() if events else None, work.failed)


def _rows(groups, runs, x0, begin, end, times, drive, first, count, max_steps, after, hidden, engine):
    def each(values, kind: Any = float, shape: tuple[int, ...] = (runs,)):
        found = np.empty(shape, kind)
        found[...] = values
        return found

    times = np.require(times, float, ("C", "W"))
    first = each(first, np.int64)
    count = len(times) - first if count is None else each(count, np.int64)
    at = np.zeros(runs + 1, np.int64)
    count.cumsum(out=at[1:])
    clock = np.zeros((runs, 10))
    clock[:, 0], clock[:, 8] = begin, -1
    par, modes = np.zeros(runs, np.int64), np.zeros(runs + 1, np.int64)
    for group in groups:
        par[group.runs] = group.row
        modes[1 + group.runs] = len(group.engine.layout.modes)
    modes.cumsum(out=modes)
    mode = np.empty(int(modes[-1]), engine.layout.modes.dtype)
    for group in groups:
        initial = group.engine.layout.modes
        mode[modes[group.runs][:, None] + np.arange(len(initial))] = initial
    return Rows(
        each(x0, shape=(runs, engine.nstates)), mode, modes, clock, each(end), each(max_steps, np.int64),
        each(drive, np.int64), par, each(after, np.int64),
        each(0.0 if hidden is None else hidden, shape=(engine.nstates, engine.nstates)),
        times, first, count, at[:-1].copy(),
        np.empty((int(at[-1]), engine.noutputs)), each(many.NOT_STARTED, np.int64), np.zeros(runs, np.int64),
    )  # fmt: skip


class _Work:
    """The runs of one call, done and to do; all end soon once ``stop[0]`` is set."""

    def __init__(self, groups, rows, drives, accuracy, kept, states, events, stop):
        for array in (*drives, *(g.par for g in groups)):
            # compiled code takes them for that; the rows are made here
            if isinstance(array, np.ndarray):
                assert array.flags.c_contiguous and array.flags.writeable
        self.groups, self.rows, self.drives, self.accuracy = groups, rows, drives, accuracy
        self.kept, self.states, self.logged = kept, states, events
        self.stop = stop
        self.log: list[tuple[np.ndarray, ...]] = []
        self.failed: dict[int, Exception] = {}

    @property
    def small(self) -> bool:
        """Whether the runs end so soon that to ask other threads, or to be stopped, takes no less time."""
        return int(self.rows.max_steps.sum()) <= STEPS_ALONE

    def here(self) -> None:
        """Make all runs in this thread."""
        self._work(deque((group, group.runs.astype(np.int64)) for group in self.groups))
        if self.stop[0]:
            raise parallel.Stopped

    def on_threads(self, threads: int) -> None:
        """Make all runs, so many at once."""
        todo = deque(self._parts(threads))
        threads = max(min(threads, len(todo)), 1)
        curved = int(self.groups[0].engine.program.ints[H_AFFINE])
        if curved not in _ready:
            # compiled, or read from its file, before any thread asks for it
            with ExitStack() as stack:
                self._run(self._context(self.groups[0], stack), self.groups[0], np.zeros(0, np.int64))
            _ready.add(curved)
        # this thread only waits: it is the one that receives Ctrl-C
        workers = [
            parallel.pool(os.getpid(), threads, "runs").submit(self._work, todo) for _ in range(threads)
        ]
        try:
            for worker in workers:
                if not wait([worker], parallel.left()).done:
                    raise parallel.TimeUp
                worker.result()
        except BaseException:
            self.stop[0] = 1
            wait(workers)
            raise

    def as_job(self, threads: int) -> None:
        """Make all runs in this thread, and in those of processors that have no job."""
        others = min(parallel.spare(), threads - 1)
        if not others:
            self.here()
            return
        todo = deque(self._parts(1 + others))
        pool = parallel.pool(os.getpid(), parallel.processors(), "runs")
        helpers = [pool.submit(self._work, todo) for _ in range(min(others, len(todo) - 1))]
        try:
            self._work(todo)
        finally:
            todo.clear()
            started = [helper for helper in helpers if not helper.cancel()]
            wait(started)
        for helper in started:
            helper.result()
        if self.stop[0]:
            raise parallel.Stopped

    def one_by_one(self) -> None:
        """Make all runs in this thread: they call functions back that nobody knows to be safe elsewhere."""
        with ExitStack() as stack:
            for group in self.groups:
                context = self._context(group, stack)
                for run in group.runs:
                    self._called_back(context, group, run)

    def _called_back(self, context, group, run):
        """Make one run that calls functions back."""
        pointers.raised.clear()
        pointers.gave_nan.clear()
        with pointers.interruptible():
            self._run(context, group, np.array([run]))
        try:
            pointers.raise_kept()
        except RuntimeError as error:
            self._fail(run, error)
            return
        far = np.max(np.abs(self.rows.x[run]), initial=0.0) >= STATE_MOST
        if self.rows.reason[run] == reasons.NAN and pointers.gave_nan and not far:
            self._fail(run, RuntimeError(f"{Status.USER_ERROR} ({pointers.gave_nan[0]})."))

    def events(self) -> tuple[np.ndarray, ...]:
        """Return all events that were logged: run, time [s], node, kind."""
        if not self.log:
            none = np.zeros(0, np.int64)
            return none, np.zeros(0), none, none
        run, time, node, kind = (np.concatenate(column) for column in zip(*self.log, strict=True))
        order = np.argsort(run, kind="stable")
        return run[order], time[order], node[order], kind[order]

    def _parts(self, threads):
        """Yield (group, runs) in parts small enough to be shared out evenly."""
        for group in self.groups:
            size = min(max(len(group.runs) // (_SHARES * threads), 1), TOGETHER_RUNS)
            # what goes on behind another stays with it
            begins = np.flatnonzero(self.rows.after[group.runs] < 0)
            at = np.searchsorted(begins, np.arange(0, len(group.runs), size), "right") - 1
            for runs in np.split(group.runs.astype(np.int64), np.unique(begins[at])[1:]):
                yield group, runs

    def _work(self, todo):
        context = at = None
        with ExitStack() as stack:
            while not self.stop[0]:
                try:
                    group, runs = todo.popleft()
                except IndexError:
                    return
                if group is not at:
                    context, at = self._context(group, stack), group
                self._run(context, group, runs)

    def _context(self, group, stack: ExitStack):
        space = stack.enter_context(pooled_space(group.engine.program, group.engine.kind))
        states = self.kept if self.states else np.empty_like(self.kept)
        return many.make_context(group.engine, space, states, self.states, self.logged, self.stop)

    def _run(self, context, group, runs):
        done = 0
        while True:
            done = many.run_rows(context, self.rows, self.drives, group.par, self.accuracy, runs, done)
            used = int(context.tally[0])
            if used:
                log = (context.log_row, context.log_t, context.log_n, context.log_k)
                self.log.append(tuple(column[:used].copy() for column in log))
                context.tally[0] = 0
            if done == len(runs) or self.stop[0]:
                return

    def _fail(self, run, error):
        """Let a run end with what a function called back has raised."""
        self.failed[int(run)] = error
