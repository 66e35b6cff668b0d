"""Simulation with located events, in python-control's dialect."""

from __future__ import annotations

import html
import re
import threading
import warnings
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import control as ct
import numpy as np

from ..blocks.coordinates import LINE, Coordinates
from ..blocks.mechanism import Mechanism
from ..checks import choice, count, flag, mapping, number, positive, real_array, shown
from ..drawing import draw
from ..status import Status
from ..table import Table
from ..thresholds import ROUNDED
from .engine import Engine, Event, callback_drive, constant_drive, sampled_drive
from .program import layout as L
from .program.parameters import checked_parameters, with_values
from .thresholds import CALLBACK_STEP, LOG, MAX_STEPS, RTOL, RTOL_RANGE, SHOWN

_kept = threading.local()  # the mechanism that each thread has simulated last, and its engine


class EventResponse(ct.TimeResponseData):
    """`ct.TimeResponseData` with the events met on the way.

    Attributes
    ----------
    events : list of Event
        Time, subsystem and kind (``stick``, ``breakaway``, ``reversal``, ``impact``, ``contact``,
        ``release``, ...).
    event_count : int
        Number of events, those not kept included.
    status : Status
        How the simulation ended; anything but CONVERGED means that `time` ends early, at the last valid
        state.
    signal_units : dict
        Unit of each signal by its label, as far as the blocks tell.
    propagated : int
        Steps between samples and outputs that were taken at once, by the constant matrices of a mode, where
        no event could lie inside: exactly where all laws are affine between events, else by an exponential
        Runge-Kutta method within the tolerance; 0 for systems with delays, plays, rate limits, static laws
        that are smooth or more than one mechanism, and without a grid of samples or outputs.

    Examples
    --------
    >>> axis = cdf.friction_mass(mass=9, coulomb=5)
    >>> run = cdf.event_response(axis, np.linspace(0, 1, 11), 10.0)
    >>> isinstance(run, ct.TimeResponseData), np.asarray(run.outputs).shape
    (True, (2, 11))
    """

    events: list[Event]
    event_count: int
    status: Status
    signal_units: Mapping[str, str] = MappingProxyType({})
    propagated: int = 0

    def plot(self, *args, **kwargs):
        """Draw it as ``ct.time_response_plot`` does, with units, events, and times of sticking shaded.

        Parameters
        ----------
        *args, **kwargs
            Of ``ct.time_response_plot``; `events`, True unless told otherwise, marks them.

        Returns
        -------
        control.ControlPlot
        """
        return draw("event response", self, fmt=args, **kwargs)

    def __repr__(self) -> str:
        """Return what was simulated: signals, span, events."""
        signals = ", ".join(map(str, self.output_labels or ()))
        span = (
            f"{self.time[0]:g} to {self.time[-1]:g} s, {len(self.time)} times"
            if len(self.time)
            else "no time"
        )
        return f"<EventResponse of {signals}: {span}, {self.event_count} events, {self.status.name.lower()}>"

    def _repr_html_(self) -> str:
        """Return the same above its first events."""
        rows = tuple((f"{e.time:.6g}", e.subsystem, e.kind) for e in self.events[:SHOWN])
        table = Table(("time [s]", "in", "event"), rows)._repr_html_() if rows else ""
        return f"<p>{html.escape(repr(self)[1:-1])}</p>{table}"


def event_response(
    sys,
    timepts,
    inputs: Any = 0,
    initial_state: Any = 0,
    *,
    params=None,
    input_hold="linear",
    rtol=RTOL,
    atol=None,
    max_step=None,
    max_steps=MAX_STEPS,
    keep_events=True,
    return_states=None,
    squeeze=None,
) -> EventResponse:
    """Simulate a block or a loop with every event located; otherwise like ``ct.input_output_response``.

    Parameters
    ----------
    sys : block, LTI system, or interconnection of them
        What to simulate.
    timepts : (nt,) array
        Times of the answer [s], ascending; the simulation runs from the first to the last.
    inputs : float, (nt,) or (ninputs, nt) array, list, or callable
        A constant, samples at `timepts`, or a function of time (called with t, returning a number or one for
        each input).
    initial_state : float, (nstates,) array or mapping
        State at the first time, in the order of ``sys.state_labels``; a scalar fills all. A mapping gives
        some by name, the others being zero: ``{"plant_x": 1e-3}``, or ``{"x": 1e-3}`` where one alone ends
        so. A pure delay (input_delay, sensor_delay) runs exactly; before the first time its input is taken
        to have always been what it is then (its own entry here is for ordinary solvers and has no effect).
        To see a step arrive late, begin the times before the step.
    params : dict
        Parameters that differ from those of the block, or of the one block in an interconnection that has
        them.
    input_hold : {'linear', 'zoh'}
        How samples are read between the times. Held ones jump at the times: outputs that answer at once (of
        a saturation, of a controller) are those after the jump.
    rtol, atol : float
        Tolerances of the integration, relative to the running size of each state: 1e-14 <= rtol <= 0.1, and,
        if asked, absolute in the units of the states: atol > 0.
    max_step : float
        Longest step [s], > 0; inf: no bound. Needed only where a callable input has features shorter than
        five time points.
    max_steps : int
        Bound on the work.
    keep_events : bool
        False counts events without keeping them, so that memory does not grow with time.

    Returns
    -------
    EventResponse
        Ends early, with a RuntimeWarning and its `status` telling why, if the loop diverges, chatters or
        exhausts its steps.

    Raises
    ------
    ValueError
        Times not ascending, wrong shapes, NaN, tolerances or steps that are not positive, an initial state
        inside a stop or outside a gap, algebraic loops.
    TypeError
        Text, complex numbers or truth values in the place of numbers; unknown keywords.
    RuntimeError
        A user-written law or input raised, or returned NaN; its exception is the cause.

    Examples
    --------
    >>> axis = cdf.friction_mass(mass=9, coulomb=5, static=5.5)
    >>> t = np.linspace(0, 2, 201)
    >>> run = cdf.event_response(axis, t, 7 * np.sin(3 * t))
    >>> [(round(float(e.time), 4), e.kind) for e in run.events]
    [(0.3013, 'breakaway'), (1.0564, 'stick'), (1.3485, 'breakaway')]
    """
    for name, value in dict(keep_events=keep_events, return_states=return_states, squeeze=squeeze).items():
        if value is not None:
            flag("event_response", name, value)
    times = checked_times("event_response", timepts)
    limits = checked_limits("event_response", rtol, atol, max_step, max_steps, float(times[-1] - times[0]))
    engine = _engine(sys, params)
    system = engine.system
    x0 = _initial(system, initial_state)
    wrong = misplaced(engine, engine.par, x0[None])
    if wrong is not None:
        raise ValueError(wrong[1])
    drive, samples, keep = _drive(inputs, engine.ninputs, times, input_hold)
    if max_step is None and callable(inputs):
        limits["max_step"] = CALLBACK_STEP * float(np.median(np.diff(times)))
    run = engine.run(
        engine.start(x0, times[0]), times[-1], drive, times, log=LOG if keep_events else 1, **limits
    )
    del keep
    if isinstance(sys, Mechanism) and params is None:
        _kept.last = (sys, engine)
    n = run.recorded
    if not np.all(np.isfinite(run.outputs[:n])):
        n = int(np.argmin(np.isfinite(run.outputs[:n]).all(axis=1)))
        run.status = Status.DIVERGED
    if not run.status.ok:
        warnings.warn(
            f"event_response ended at t = {run.state.time:.6g} s{_last_events(engine, run)}: {run.status}",
            RuntimeWarning,
            stacklevel=2,
        )
    response = EventResponse(
        times[:n],
        _Given(run.outputs[:n].T),
        _Given(run.states[:n].T),
        _Given(samples[:, :n]),
        issiso=system.issiso(),
        output_labels=system.output_labels,
        input_labels=system.input_labels,
        state_labels=system.state_labels,
        return_x=bool(return_states),
        squeeze=squeeze,
        sysname=system.name,
        title=_title(sys, system.name),
    )
    response.signal_units = _units_of(sys)
    response.events = engine.name_events(run.events) if keep_events else []
    response.event_count = run.event_count
    response.status = run.status
    response.propagated = run.propagated
    return response


def _last_events(engine, run) -> str:
    """Say which events a run that chatters has met last, where they were kept."""
    if run.status is not Status.CHATTERING:
        return ""
    last = engine.name_events([column[-2:] for column in run.events])
    found = dict.fromkeys(f"{event.kind} in {event.subsystem}" for event in last)
    return f" (last: {', '.join(found)})" if found else ""


class _Given:
    """An array that is handed over: who asks for a copy is given the array itself, which nobody else has."""

    def __init__(self, array: np.ndarray):
        self._array = array

    def __array__(self, dtype=None, copy=None):
        return self._array


def _units_of(sys) -> dict[str, str]:
    """Return the units of a mechanism's signals, or of a loop about one."""
    block = getattr(getattr(sys, "parts", None), "block", sys)
    if not isinstance(block, Mechanism):
        return {}
    return dict(block.signals) | {"r": block.coordinates.unit}


def _title(sys, name: str) -> str:
    """Return a title; names that python-control numbers are none."""
    if not re.fullmatch(r"sys\[\d+\]", name or "sys[0]"):
        return f"Response of {name}"
    return "Response of the closed loop" if hasattr(sys, "parts") else "Response"


def misplaced(engine, par: np.ndarray, x0: np.ndarray) -> tuple[int, str] | None:
    """Return the first state that violates a gap or a stop, with what to say of it; None where all are right.

    Parameters
    ----------
    engine : Engine
    par : (n, npar) array
        Packed parameters, one row a state.
    x0 : (n, nx) array
    """
    nodes, ints = engine.program.nodes, engine.program.ints
    found: list[tuple[int, str]] = []
    for node, name in zip(nodes, engine.node_names, strict=True):
        if node[L.KIND] != L.MECHANISM:
            continue
        aux, number_at, at = node[L.AUX], node[L.PAR], node[L.X]
        moves = _coordinates_of(engine.system, name)
        x = x0[:, at]
        driven = x0[:, at + 2] if ints[aux + L.A_BODIES] == 2 else x
        joint = ints[aux + L.A_JOINT]
        if ints[aux + L.A_BODIES] == 2 and joint in (L.J_RIGID, L.J_IMPACT):
            gap = par[:, number_at + L.P_GAP] * (joint == L.J_IMPACT)
            delta, slack = driven - x, ROUNDED * (gap + abs(x) + abs(driven))
            for i in np.flatnonzero(~((-slack <= delta) & (delta <= gap + slack)))[:1]:
                load, motor = moves.name("x"), moves.name("x_motor")
                found.append((int(i), (
                    f"the initial state of {name} needs 0 <= {motor} - {load} <= {gap[i]:g} {moves.unit} "
                    f"(the clearance of its joint); got {delta[i]:g}. Start with {motor} = {load}."
                )))  # fmt: skip
        if ints[aux + L.A_STOP]:
            low, high = par[:, number_at + L.P_LOW], par[:, number_at + L.P_HIGH]
            for i in np.flatnonzero(~((low <= driven) & (driven <= high)))[:1]:
                found.append((int(i), (
                    f"the initial {moves.position} of {name} must lie between its stops {low[i]:g} and "
                    f"{high[i]:g} {moves.unit}; got {driven[i]:g}."
                )))  # fmt: skip
    return min(found, key=lambda wrong: wrong[0], default=None)


def _coordinates_of(system, name: str) -> Coordinates:
    """Return how the mechanism of a node moves, by the name of the node in a system of any depth."""
    if isinstance(system, Mechanism):
        return system.coordinates
    parts = getattr(system, "syslist", ())
    named = [p for p in parts if not isinstance(p, Mechanism) or p.name == name.rpartition(".")[2]]
    found = (_coordinates_of(p, name) for p in named)
    return next((moves for moves in found if moves is not LINE), LINE)


def checked_limits(owner: str, rtol, atol, max_step, max_steps, span: float) -> dict[str, Any]:
    """Return the checked tolerances and bounds as keywords of `Engine.run`; `span` [s] has to be covered."""
    rtol = number(
        owner, "rtol", rtol, lower=RTOL_RANGE[0], upper=RTOL_RANGE[1], meaning="relative tolerance",
        remedy=f"Leave it out for {RTOL:g}; floats resolve no less than 1e-14.",
    )  # fmt: skip
    if atol is not None:
        atol = positive(owner, "atol", atol, remedy="Leave it out: rtol alone bounds the error.")
    if max_step is not None:
        max_step = positive(
            owner, "max_step", max_step, "s", infinite=True, meaning="longest step",
            remedy="Leave it out where the step may be as long as the tolerance allows.",
        )  # fmt: skip
    max_steps = count(owner, "max_steps", max_steps, meaning="bound on the work")
    if max_step is not None and span / max_step > max_steps:
        raise ValueError(
            f"{owner} needs max_step >= {span / max_steps:.3g} s to cover {span:g} s within "
            f"max_steps={max_steps} steps; got max_step={max_step:g}. Raise max_step or max_steps, or "
            "shorten the time."
        )
    return dict(rtol=rtol, atol=atol, max_step=np.inf if max_step is None else max_step, max_steps=max_steps)


def _engine(system, params) -> Engine:
    """Return the engine of a system with some parameters changed; that of the last call, if it is the same.

    A mechanism never changes. While an engine runs nobody else has it: inputs may simulate as well.
    """
    if isinstance(system, Mechanism) and params is None:
        known, engine = _kept.__dict__.pop("last", (None, None))
        return engine if known is system else Engine(system)
    if isinstance(system, ct.InterconnectedSystem):
        values = checked_parameters("event_response", system, params)
        several = [name for name, v in values.items() if v.ndim]
        if several:
            raise ValueError(
                f"event_response needs params[{several[0]!r}] as one number; got an array. "
                "For many runs in one call use batch_response."
            )
        return Engine(system, {name: float(v) for name, v in values.items()})
    return Engine(with_values(system, {} if params is None else mapping("event_response", "params", params)))


def checked_times(owner: str, timepts) -> np.ndarray:
    """Return times [s] in ascending order, at least two."""
    times = np.atleast_1d(real_array(owner, "timepts", timepts, "s"))
    if times.ndim != 1 or len(times) < 2 or not np.all(times[1:] > times[:-1]):
        raise ValueError(
            f"{owner} needs timepts as at least two times in ascending order [s], each once; got "
            f"{shown(timepts)}. Sort them; for a run to 10 s give np.linspace(0, 10, 1001)."
        )
    return np.ascontiguousarray(times)


def _initial(system, initial_state):
    n = system.nstates or 0
    if isinstance(initial_state, Mapping):
        x0 = np.zeros(n)
        for name, value in initial_state.items():
            x0[_place(system, name)] = number("event_response", f"initial_state[{name!r}]", value)
        return x0
    x0 = real_array("event_response", "initial_state", initial_state)
    if x0.ndim == 0:
        return np.full(n, float(x0))
    if x0.size != n or max(x0.shape) != x0.size:
        raise ValueError(
            f"initial_state needs {n} numbers ({', '.join(system.state_labels)}), or one for all; got shape "
            f"{x0.shape}. Give the states in that order."
        )
    return x0.ravel()


def _place(system, name) -> int:
    """Return which state has a name, or alone has it as its last part (``x`` of ``plant_x``)."""
    labels = list(system.state_labels)
    if name in labels:
        return labels.index(name)
    found = [k for k, label in enumerate(labels) if label.endswith(f"_{name}")]
    if len(found) != 1:
        raise ValueError(
            f"initial_state names {name!r}, which {'no state has' if not found else 'several states have'}. "
            f"The states are {', '.join(labels)}."
        )
    return found[0]


def _drive(inputs, nr, times, hold):
    owner = "event_response"
    choice(owner, "input_hold", hold, ("linear", "zoh"))
    if callable(inputs):
        samples = np.array([_values(inputs, float(t), nr) for t in times]).T
        drive, keep = callback_drive(inputs, nr)
        return drive, samples, keep
    if isinstance(inputs, list | tuple) and any(np.ndim(u) for u in inputs):
        rows = [real_array(owner, f"inputs[{i}]", u) for i, u in enumerate(inputs)]
        if not all(r.shape in ((), times.shape) for r in rows):
            wrong = next(r for r in rows if r.shape not in ((), times.shape))
            raise ValueError(
                f"event_response needs each of its inputs as one number or {len(times)}, one a time; got "
                f"shape {wrong.shape}. Sample it at timepts."
            )
        u = np.array([np.broadcast_to(r, times.shape) for r in rows])
    else:
        u = real_array(owner, "inputs", inputs)
        if isinstance(inputs, list | tuple) and u.shape == (nr,):  # a constant for each
            u = np.repeat(u[:, None], len(times), axis=1)
    if u.ndim == 0:
        samples = np.full((nr, len(times)), float(u))
        return constant_drive(np.full(nr, float(u))), samples, None
    u = np.atleast_2d(u)
    if u.shape != (nr, len(times)):
        raise ValueError(
            f"event_response needs inputs of shape ({nr}, {len(times)}) (inputs, times), or one number; got "
            f"shape {u.shape}. Sample them at timepts, or give a function of time."
        )
    return sampled_drive(times, u, hold), u, None


def _values(function, t, count) -> np.ndarray:
    """Return what an input function says at a time; what it raises or returns wrongly is told once."""
    try:
        given = function(t)
    except Exception as error:
        raise RuntimeError(f"{Status.USER_ERROR} (the input at t = {t:g}: {error!r}).") from error
    values = real_array("event_response", f"inputs(t={t:g})", given)
    if values.size not in (1, count):
        raise ValueError(
            f"event_response needs inputs(t) to return {count} numbers; got {values.size} at t = {t:g}. "
            "Return one for each input."
        )
    return np.broadcast_to(values.ravel(), count)
