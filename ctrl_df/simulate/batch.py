"""Many simulations in one call: `batch_response` and what it returns."""

from __future__ import annotations

import warnings
from collections import Counter
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..checks import choice, count, flag, real_array, shown
from ..status import Status
from ..thresholds import LARGEST
from .engine import EVENT_KINDS, Engine, Event
from .groups import Group, groups_of
from .program.parameters import checked_parameters
from .response import EventResponse, checked_limits, checked_times, misplaced
from .runs import Drives, Runs, harmonic_drives, run_many, sampled_drives
from .thresholds import MAX_STEPS, RTOL

_OWNER = "batch_response"


@dataclass(frozen=True, repr=False, eq=False)
class BatchResponse:
    """The results of many runs of one system, read-only; ``batch[i]`` is run i as an `EventResponse`.

    Attributes
    ----------
    time : (times,) array
        [s].
    inputs : (runs, inputs, times) array
        Runs with the same inputs share their memory.
    outputs : (runs, outputs, times) array
        NaN after the end of a run that ended early.
    states : (runs, states, times) array or None
        Where ``return_states=True`` asked for them; NaN as in `outputs`.
    status : tuple of Status
        How each run ended.
    end_times : (runs,) array
        Time at which each run ended [s]; the last of `time` where nothing failed.
    propagated : (runs,) int array
        As `EventResponse.propagated`.
    event_counts : (runs,) int array
        Number of events of each run, those not kept included.
    events : tuple of list of Event, or None
        Those of each run, where ``keep_events=True`` asked for them.
    errors : dict
        What a user-written law or system raised, by the number of the run (`Status.USER_ERROR`).
    input_labels, output_labels, state_labels : tuple of str
    name : str
        Of the system.

    Examples
    --------
    >>> axis = cdf.friction_mass(mass=9, coulomb=5)
    >>> runs = cdf.batch_response(axis, np.linspace(0, 1, 11), [[10.0] * 11, [4.0] * 11])
    >>> len(runs), runs[1].outputs.shape
    (2, (2, 11))
    """

    time: np.ndarray
    inputs: np.ndarray
    outputs: np.ndarray
    states: np.ndarray | None
    status: tuple[Status, ...]
    end_times: np.ndarray
    event_counts: np.ndarray
    propagated: np.ndarray
    events: tuple[list[Event], ...] | None
    errors: dict[int, Exception]
    input_labels: tuple[str, ...]
    output_labels: tuple[str, ...]
    state_labels: tuple[str, ...]
    name: str
    recorded: np.ndarray = field(default_factory=lambda: np.zeros(0, int))

    def __post_init__(self):
        for name, value in vars(self).items():
            if isinstance(value, np.ndarray):
                view = value.view()
                view.flags.writeable = False
                object.__setattr__(self, name, view)

    @property
    def ok(self) -> np.ndarray:
        """Whether each run reached the last time, (runs,) bool."""
        return np.array([s.ok for s in self.status])

    def __len__(self) -> int:
        return len(self.status)

    def __iter__(self):
        return (self[i] for i in range(len(self)))

    def __getitem__(self, run) -> EventResponse:
        """Return one run as `event_response` would."""
        if isinstance(run, bool | np.bool_) or not isinstance(run, int | np.integer):
            raise TypeError(f"a batch needs the number of one run as its index; got {shown(run)}.")
        if not -len(self) <= run < len(self):
            raise IndexError(f"the batch has {len(self)} runs; got run {run}.")
        n = self.recorded[run]
        states = np.zeros((0, n)) if self.states is None else self.states[run, :, :n]
        response = EventResponse(
            self.time[:n], self.outputs[run, :, :n], states, self.inputs[run, :, :n],
            issiso=len(self.output_labels) == len(self.input_labels) == 1,
            output_labels=list(self.output_labels), input_labels=list(self.input_labels),
            state_labels=[] if self.states is None else list(self.state_labels),
            return_x=self.states is not None, sysname=self.name,
            title=f"Event-located response of {self.name}, run {run}",
        )  # fmt: skip
        response.events = [] if self.events is None else self.events[run]
        response.event_count = int(self.event_counts[run])
        response.status = self.status[run]
        response.propagated = int(self.propagated[run])
        return response

    def __repr__(self) -> str:
        ended = Counter(s.name.lower().replace("_", " ") for s in self.status)
        ends = ", ".join(f"{n} {name}" for name, n in ended.most_common())
        return (
            f"<BatchResponse of {self.name}: {len(self)} runs, {len(self.output_labels)} outputs, "
            f"{len(self.time)} times; {ends}>"
        )


def batch_response(
    sys,
    timepts,
    inputs: Any = 0,
    initial_states: Any = 0,
    params=None,
    *,
    threads=None,
    input_hold="linear",
    rtol=RTOL,
    atol=None,
    max_step=None,
    max_steps=MAX_STEPS,
    keep_events=False,
    return_states=False,
) -> BatchResponse:
    """Simulate one system many times, every run as `event_response` does it, on all cores at once.

    Whatever has a first axis of length `runs` differs from run to run; everything else is shared. Without
    any, one run is made. The numbers do not depend on `threads`, nor on the other runs of the batch.

    Parameters
    ----------
    sys : block, LTI system, or interconnection of them
        What to simulate.
    timepts : (times,) array
        Times of the answer [s], ascending, the same for all runs.
    inputs : float, (times,), (runs, times) or (runs, inputs, times) array
        A constant or samples at `timepts`, in the units of the inputs. The second and third shape are for
        systems with one input; for the same samples in all runs of a system with several, give
        (1, inputs, times).
    initial_states : float, (states,) or (runs, states) array
        States at the first time, in the order of ``sys.state_labels``; a scalar fills all.
    params : mapping
        Name, as in ``block.parameters``, to one number or a (runs,) array, in SI units. In an interconnection
        the names are those of its blocks, each known to one of them.
    threads : int
        Runs made at once, >= 1; None: as many as this process may use processors. Runs of systems that are
        called back in Python are made one after the other.
    input_hold : {'linear', 'zoh'}
        How samples are read between the times.
    rtol, atol, max_step, max_steps
        As in `event_response`, for each run.
    keep_events : bool
        Whether to keep the events; else they are counted.
    return_states : bool
        Whether to keep the states at `timepts`.

    Returns
    -------
    BatchResponse
        A run that diverges, chatters, exhausts its steps, or whose user-written law raises, ends early: its
        `status` tells why, its values after the end are NaN, and one RuntimeWarning says how many did. The
        others are not affected.

    Raises
    ------
    ValueError
        Shapes that do not fit or do not agree in the number of runs; NaN; unknown parameters, parameters out
        of bounds or contradicting each other (with the number of the first such run); an initial state inside
        a stop or outside a gap; ``threads < 1``; results of more than 2 GiB; whatever `event_response`
        refuses.
    TypeError
        Text, complex numbers or truth values in the place of numbers; a function as input; unknown keywords.
    KeyboardInterrupt
        Ctrl-C, within a fraction of a second.

    Examples
    --------
    >>> block = cdf.friction_mass(9, 5, 0.5)
    >>> t = np.linspace(0, 2.5, 2501)
    >>> levels = np.linspace(3, 6, 100)
    >>> batch = cdf.batch_response(block, t, 15 * np.sin(7 * t), params={"coulomb.level": levels})
    >>> batch.outputs.shape
    (100, 2, 2501)
    """
    for name, value in dict(keep_events=keep_events, return_states=return_states).items():
        flag(_OWNER, name, value)
    threads = None if threads is None else count(
        _OWNER, "threads", threads, meaning="runs made at once", remedy="Leave it out to use all processors."
    )  # fmt: skip
    times = checked_times(_OWNER, timepts)
    limits = checked_limits(_OWNER, rtol, atol, max_step, max_steps, float(times[-1] - times[0]))
    choice(_OWNER, "input_hold", input_hold, ("linear", "zoh"))
    system = Engine(sys).system
    values = checked_parameters(_OWNER, system, params)
    samples = _inputs(inputs, int(system.ninputs or 0), times)
    x0 = _states(initial_states, system)
    runs = _runs(samples, x0, values)
    _require_room(runs, len(times), system.noutputs + x0.shape[1] * return_states)
    groups = groups_of(_OWNER, system, values, runs)
    x0 = np.broadcast_to(x0, (runs, x0.shape[1]))
    _check_positions(groups, x0)
    drives = _drives(samples, times, input_hold)
    result = run_many(
        groups, x0, times[0], times[-1], times, drives, drive=np.arange(runs) if len(samples) > 1 else 0,
        states=return_states, events=keep_events, threads=threads, **limits,
    )  # fmt: skip
    _tell_of_failures(result)
    return BatchResponse(
        times, np.broadcast_to(samples, (runs, samples.shape[1], len(times))),
        result.outputs.reshape(runs, len(times), -1).swapaxes(1, 2),
        None if result.states is None else result.states.reshape(runs, len(times), -1).swapaxes(1, 2),
        tuple(result.status), result.time, result.event_count,
        result.propagated, _events(result, groups), result.errors,
        tuple(system.input_labels), tuple(system.output_labels), tuple(system.state_labels), str(system.name),
        result.recorded,
    )  # fmt: skip


def _inputs(inputs, nr: int, times) -> np.ndarray:
    """Return samples (runs or 1, inputs, times), or (1, inputs, 1) for a constant."""
    if callable(inputs):
        raise TypeError(
            f"{_OWNER} needs inputs as samples at timepts; got a function. Sample it: "
            "np.array([function(t) for t in timepts]), or use event_response."
        )
    u = real_array(_OWNER, "inputs", inputs)
    if u.ndim == 0:
        return np.full((1, nr, 1), float(u))
    if u.ndim == 1 and nr == 1:
        u = u[None, None]
    elif u.ndim == 2 and nr == 1:
        u = u[:, None]
    if u.ndim != 3 or u.shape[1:] != (nr, len(times)) or not len(u):
        short = f"({len(times)},), (runs, {len(times)}) or " if nr == 1 else ""
        raise ValueError(
            f"{_OWNER} needs inputs of shape {short}(runs, {nr}, {len(times)}) (runs, inputs, times), or one "
            f"number; got shape {np.shape(inputs)}. Sample them at timepts; for the same inputs in all runs "
            "let runs be 1."
        )
    return u


def _states(initial_states, system) -> np.ndarray:
    """Return states (runs or 1, states)."""
    n = system.nstates or 0
    x0 = real_array(_OWNER, "initial_states", initial_states)
    if x0.ndim == 0:
        return np.full((1, n), float(x0))
    if x0.ndim > 2 or x0.shape[-1] != n or not len(np.atleast_2d(x0)):
        raise ValueError(
            f"{_OWNER} needs initial_states of shape ({n},) or (runs, {n}) "
            f"({', '.join(system.state_labels)}), or one number for all; got shape {x0.shape}. Give the "
            "states of a run in that order, one run a row."
        )
    return np.atleast_2d(x0)


def _runs(samples, x0, values) -> int:
    """Return the number of runs that inputs, states and parameters agree on."""
    asked = {"inputs": len(samples), "initial_states": len(x0)}
    numbers = {name: n for name, n in asked.items() if n > 1}
    numbers |= {f"params[{name!r}]": len(v) for name, v in values.items() if v.size != 1}
    if len(set(numbers.values())) > 1:
        counts = ", ".join(f"{name} {n}" for name, n in numbers.items())
        raise ValueError(
            f"{_OWNER} needs the same number of runs in all that differs from run to run; got {counts}. "
            "Repeat what is shared, or give it without the axis of runs."
        )
    runs = next(iter(numbers.values()), 1)
    if runs < 1:
        raise ValueError(f"{_OWNER} needs at least one run; got {next(iter(numbers))} of length 0.")
    return runs


def _require_room(runs: int, times: int, columns: int) -> None:
    """Refuse results that would not fit into memory, with the size that would."""
    row = 8 * times * columns
    if runs * row > LARGEST:
        raise ValueError(
            f"a batch of {runs} runs with {times} times of {columns} outputs and states needs "
            f"{runs * row / 1e9:.3g} GB; at most {LARGEST / 1e9:.3g} GB are computed at once. Give at most "
            f"{LARGEST // row} runs of these times, fewer times, or several batches one after another."
        )


def _check_positions(groups: list[Group], x0) -> None:
    """Refuse states inside a stop or outside a gap, with the number of the first such run."""
    found = []
    for group in groups:
        wrong = misplaced(group.engine, group.par[group.row], x0[group.runs])
        if wrong is not None:
            found.append((int(group.runs[wrong[0]]), wrong[1]))
    if found:
        run, what = min(found)
        raise ValueError(f"{_OWNER}, run {run}: {what}")


def _drives(samples, times, hold) -> Drives:
    if samples.shape[2] == 1:
        return harmonic_drives(samples, 0.0)
    return sampled_drives(times, samples, hold)


def _events(result: Runs, groups: list[Group]) -> tuple[list[Event], ...] | None:
    """Return the events of each run by name."""
    if result.events is None:
        return None
    names: list[Any] = [None] * len(result.status)
    for group in groups:
        for run in group.runs:
            names[run] = group.engine.node_names
    lists: tuple[list[Event], ...] = tuple([] for _ in names)
    for run, time, node, kind in zip(*(column.tolist() for column in result.events), strict=True):
        lists[run].append(Event(time, names[run][node], EVENT_KINDS[kind]))
    return lists


def _tell_of_failures(result: Runs) -> None:
    failed = [i for i, s in enumerate(result.status) if not s.ok]
    if not failed:
        return
    first = failed[0]
    why = result.errors.get(first, result.status[first])
    warnings.warn(
        f"{_OWNER}: {len(failed)} of {len(result.status)} runs ended early, the first of them run {first} at "
        f"t = {result.time[first]:.6g} s: {why}",
        RuntimeWarning,
        stacklevel=3,
    )
