"""The event engine from Python: a compiled program of one system, run between given times."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from time import perf_counter
from typing import Any, NamedTuple

import control as ct
import numpy as np

from ..cached import cached_property
from ..status import Status
from .dynamics import history
from .kernel import driver
from .kernel.pace import keep_pace
from .kernel.run import reasons
from .kernel.run.kept import GOES_ON
from .kernel.space import Space, workspace
from .program import layout as L
from .program import pointers
from .program.flatten import flatten
from .program.layout import EVENT_KINDS, Drive, Program
from .program.pack import pack
from .thresholds import (
    CHUNK_CHANGE,
    CHUNK_LEAST,
    CHUNK_TIME,
    FEWEST_STEPS,
    HEIGHT,
    LOG,
    MAX_STEPS,
    MOST_OUTPUTS,
    RTOL,
    STATE_MOST,
    STEPS_AT_ONCE,
    steps_at_once,
)

STATUS = {
    reasons.DONE: Status.CONVERGED,
    reasons.EVENT: Status.CONVERGED,
    reasons.SECTION: Status.CONVERGED,
    reasons.STEPS: Status.WORK_LIMIT,
    reasons.NAN: Status.DIVERGED,
    reasons.CHATTER: Status.CHATTERING,
    reasons.TINY: Status.STEP_TOO_SMALL,
    reasons.HISTORY: Status.HISTORY_FULL,
}


class Event(NamedTuple):
    """One located event: time [s], the subsystem it happened in, and its kind."""

    time: float
    subsystem: str
    kind: str


@dataclass
class State:
    """Everything needed to go on: time, state, discrete modes, step size, what pure delays remember."""

    time: float
    x: np.ndarray
    mode: np.ndarray
    step: float = 0.0
    segment: int = 0
    on_section: bool = False
    fresh: bool = True
    scale: np.ndarray | None = None
    history: np.ndarray | None = None

    def copy(self) -> State:
        """Return an independent copy."""
        scale = None if self.scale is None else self.scale.copy()
        # a history is written by no one once it stands in a state
        return State(
            self.time, self.x.copy(), self.mode.copy(), self.step, self.segment, self.on_section, self.fresh,
            scale, self.history,
        )  # fmt: skip


@dataclass
class Run:
    """Outcome of `Engine.run`."""

    state: State
    status: Status
    reason: int
    outputs: np.ndarray  # (nt, ny)
    states: np.ndarray  # (nt, nx)
    recorded: int
    steps: int
    propagated: int  # steps taken by constant propagators, see `ctrl_df.simulate.kernel.propagators`
    event_count: int
    events: tuple[np.ndarray, np.ndarray, np.ndarray]  # time, node, kind
    before: np.ndarray  # state just before the event that stopped the run
    margin: int  # index of the margin that event crossed


def constant_drive(values) -> Drive:
    """External inputs that do not change."""
    values = np.atleast_1d(np.asarray(values, float))
    return harmonic_drive(values[:, None].astype(complex), 0.0)


def harmonic_drive(coefficients, omega: float) -> Drive:
    """External inputs ``Re sum_k c_k exp(j k omega t)``; `coefficients` (nr, nh) complex, k = 0, 1, ..."""
    c = np.ascontiguousarray(coefficients, dtype=complex)
    return Drive(np.zeros(0), np.zeros((c.shape[0], 0)), 1, c, float(omega), 0)


def sampled_drive(time, samples, hold: str) -> Drive:
    """External inputs from samples (nr, nt), ``hold`` = 'zoh' or 'linear'."""
    samples = np.ascontiguousarray(np.atleast_2d(samples), dtype=float)
    time = np.ascontiguousarray(time, dtype=float)
    return Drive(time, samples, int(hold == "linear"), np.zeros((samples.shape[0], 0), complex), 0.0, 0)


def callback_drive(function, nr: int) -> tuple[Drive, Any]:
    """External inputs from a function of time returning `nr` values; keep the second return value alive."""

    def call(t, r):
        values = np.atleast_1d(function(t))
        if len(values) != nr:
            raise ValueError(f"the input function must return {nr} values; got {len(values)}.")
        for i, v in enumerate(values):
            r[i] = float(v)

    pointer, keep = pointers.callback(call, "input")
    return Drive(np.zeros(0), np.zeros((nr, 0)), 1, np.zeros((nr, 0), complex), 0.0, pointer), keep


class Engine:
    """A system compiled to arrays, ready to run from any state.

    Parameters
    ----------
    system : block, its core, LTI system or interconnection
        What to run; see `ctrl_df.simulate.program.flatten`.
    values : mapping
        Parameters that differ from those of its blocks, checked already. With columns of numbers in it (see
        `ctrl_df.values.column`) the engine runs the first of these systems, and ``par`` has the packed
        parameters of all, for `ctrl_df.simulate.runs`.
    """

    def __init__(self, system, values: Mapping[str, Any] | None = None):
        if isinstance(system, ct.TransferFunction):
            system = ct.ss(system)  # a transfer function has no state to integrate
        self.system = system
        self._flat = flatten(system, values)
        self.nstates = system.nstates or 0
        self.layout, self.par = pack(self._flat, self.nstates)
        self.program = Program(self.layout.nodes, self.layout.ints, self.par[0].copy())
        self.ninputs, self.noutputs = int(self.program.ints[L.H_NR]), int(self.program.ints[L.H_NY])

    @cached_property
    def space(self) -> Space:
        """Scratch of runs made from here; `ctrl_df.simulate.runs` has its own."""
        return workspace(self.program, delays=True)

    @property
    def node_names(self) -> list[str]:
        """Names of the nodes, in their order."""
        return [self._flat.names[i] for i in self.layout.order]

    @property
    def kind(self) -> tuple[bytes, bytes, bytes]:
        """What engines whose systems differ in numbers alone have in common."""
        return self.layout.kind

    @property
    def delayed(self) -> bool:
        """Whether a pure delay stands inside, whose state is a history."""
        return bool(self.program.ints[L.H_DELAYS])

    @cached_property
    def calls_python(self) -> bool:
        """Whether a run calls functions back in Python (a user's system, a law that numba cannot compile)."""
        return any(
            node.kind == L.SYSTEM or any(pointers.calls_python(law[0]) for law in node.laws)
            for node in self._flat.nodes
        )

    @property
    def modes(self) -> np.ndarray:
        """Modes of a fresh state, for those who set states by themselves: not possible with a history."""
        if self.delayed:
            workspace(self.program)
        return self.layout.modes

    def start(self, x0=None, time: float = 0.0) -> State:
        """Return a fresh state; its modes are settled when the run begins."""
        x = np.zeros(self.nstates) if x0 is None else np.array(x0, dtype=float)
        return State(float(time), x, self.layout.modes.copy())

    def run(
        self,
        state: State,
        t_end: float,
        drive: Drive | None = None,
        times=None,
        *,
        order: int = 8,
        rtol: float = RTOL,
        atol: float | None = None,
        max_step: float = np.inf,
        locate: bool = True,
        stop_at_event: bool = False,
        watch: int = -1,
        level: float = 0.0,
        direction: int = 1,
        height: float | None = None,
        max_steps: int = MAX_STEPS,
        log: int = LOG,
        spectrum: np.ndarray | None = None,
        omega: float = 0.0,
    ) -> Run:
        """Run to `t_end`, or to the next event or section.

        Parameters
        ----------
        state : State
            Where to begin; not changed.
        t_end : float
            End of the run [s].
        drive : Drive
            External inputs; zero by default.
        times : (nt,) array
            Times at which outputs and states are recorded.
        order : {8, 5}
            Runge-Kutta order; 5 is faster where inputs are sampled finely.
        rtol, atol : float
            Error tolerances of a step: relative to the running size of each state, and (default 0) absolute,
            in the units of the states.
        locate : bool
            False integrates on in the fixed mode, events ignored.
        stop_at_event : bool
            Return after every event.
        watch : int
            Signal whose passage through `level` in `direction` (+1 upward) ends the run; -1: none.
        height : float
            Relative flight below which chatter ends (default rtol, at least 1e-10).
        max_steps : int
            Bound on the work.
        log : int
            Events kept between returns to Python; all are returned. 1: none kept.
        spectrum : (ny, kmax + 1) complex array
            Receives (is added) the integrals of the outputs against exp(-j k omega t).

        Raises
        ------
        RuntimeError
            A user-written law or system raised (its exception is the cause), or returned NaN.
        KeyboardInterrupt
            Ctrl-C, within a fraction of a second.
        """
        atol = 0.0 if atol is None else atol
        height = max(rtol, HEIGHT) if height is None else height
        if drive is None:
            drive = constant_drive(np.zeros(self.ninputs))
        spectrum = np.zeros((self.noutputs, 0), complex) if spectrum is None else spectrum
        times = np.zeros(0) if times is None else np.ascontiguousarray(times, dtype=float)
        now = state.copy()
        ng, address = int(self.program.ints[L.H_NG]) + 1, driver.address()
        scale = now.scale if now.scale is not None else np.zeros((4, ng))
        xout, yout = np.empty((len(times), self.nstates)), np.empty((len(times), self.noutputs))
        clock = np.array([now.time, 0, now.step, 0, 0, 0, now.segment, float(now.on_section), -1, 0])
        log = max(log, 1)
        log_t, log_n, log_k = np.empty(log), np.empty(log, np.int64), np.empty(log, np.int64)
        before = now.x.copy()
        kept: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
        fresh = int(now.fresh)
        pointers.raised.clear()
        pointers.gave_nan.clear()
        space = self.space
        memo = space.memo
        memo[GOES_ON] = 0.0
        if len(times) + len(drive.time) > 2:
            keep_pace(self.program, space)
        chunk = steps_at_once(STEPS_AT_ONCE, self.nstates)
        past = history.stored(self.program, space.work[0])
        if self.delayed and not fresh:
            if now.history is None:
                raise ValueError(
                    "a state of a system with pure delays is its history as well; "
                    "go on from the state that a run returned."
                )
            past[:] = now.history
        while True:
            # Python sees Ctrl-C between the chunks only: none may take long
            began = perf_counter()
            until = t_end
            if len(times) - int(clock[1]) > MOST_OUTPUTS:
                until = min(t_end, times[int(clock[1]) + MOST_OUTPUTS])
            with pointers.interruptible():
                reason = driver.run(
                    address, self.program, drive, clock, now.x, now.mode, until, times, xout, yout, order,
                    rtol, atol, max_step, locate, stop_at_event, watch, level, -direction, height,
                    min(max_steps - int(clock[3]), chunk), log_t, log_n, log_k, before, scale, fresh,
                    space.at, spectrum, omega,
                )  # fmt: skip
            pointers.raise_kept()
            pace = CHUNK_TIME / max(perf_counter() - began, CHUNK_LEAST)
            changed = chunk * min(max(pace, CHUNK_CHANGE[0]), CHUNK_CHANGE[1])
            chunk = max(int(min(changed, MAX_STEPS)), FEWEST_STEPS)
            fresh = 0
            used = min(int(clock[5]), len(log_t))
            if log > 1 and used:
                kept.append((log_t[:used].copy(), log_n[:used].copy(), log_k[:used].copy()))
            if (
                reason == reasons.FULL
                or (reason == reasons.STEPS and int(clock[3]) < max_steps)
                or (reason == reasons.DONE and until < t_end)
            ):
                memo[GOES_ON] = 1.0
                continue
            break
        recorded = int(clock[1])
        xout[recorded:] = yout[recorded:] = np.nan
        status = STATUS[reason]
        if reason == reasons.NAN and pointers.gave_nan and np.max(np.abs(now.x), initial=0.0) < STATE_MOST:
            raise RuntimeError(f"{Status.USER_ERROR} ({pointers.gave_nan[0]}).")
        events: Any = (
            tuple(np.concatenate(c) for c in zip(*kept, strict=True))
            if kept
            else (log_t[:0], log_n[:0], log_k[:0])
        )
        after = State(
            float(clock[0]), now.x, now.mode, float(clock[2]), int(clock[6]), clock[7] > 0.5, False, scale,
            past.copy() if self.delayed else None,
        )  # fmt: skip
        return Run(
            after,
            status,
            reason,
            yout,
            xout,
            recorded,
            int(clock[3]),
            int(clock[9]),
            int(clock[4]),
            events,
            before,
            int(clock[8]),
        )

    def name_events(self, events) -> list[Event]:
        """Turn the event arrays of a run into `Event` values."""
        names, rows = self.node_names, zip(*(column.tolist() for column in events), strict=True)
        return [Event(time, names[node], EVENT_KINDS[kind]) for time, node, kind in rows]
