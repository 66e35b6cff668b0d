"""Simulation with located events, in python-control's dialect."""

from __future__ import annotations

import warnings
from typing import Any

import control as ct
import numpy as np

from ..status import Status
from .engine import RTOL, Engine, Event, callback_drive, constant_drive, sampled_drive


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
        How the simulation ended; anything but CONVERGED means that `time` ends early, at the last state that
        is right.
    """

    events: list[Event]
    event_count: int
    status: Status


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
    max_steps=20_000_000,
    keep_events=True,
    return_states=None,
    squeeze=None,
    **keywords,
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
    initial_state : float or (nstates,) array
        State at the first time, in the order of ``sys.state_labels``; a scalar fills all. A pure delay
        (input_delay, sensor_delay) runs exactly; before the first time its input is taken to have always been
        what it is then (its own entry here is for ordinary solvers and has no effect). To see a step arrive
        late, begin the times before the step.
    params : dict
        Parameters of blocks that differ from their own values.
    input_hold : {'linear', 'zoh'}
        How samples are read between the times.
    rtol, atol : float
        Tolerances of the integration, relative to the running size of each state; `atol` defaults to
        rtol/1000.
    max_step : float
        Longest step [s]. Needed only where a callable input has features shorter than five time points.
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
        Times not ascending, wrong shapes, NaN, an initial state inside a stop or outside a gap, algebraic
        loops.
    """
    if keywords:
        raise TypeError(f"unrecognized keyword(s): {', '.join(keywords)}")
    times = _times(timepts)
    engine = Engine(_with_params(sys, params))
    system = engine.system
    x0 = _initial(system, initial_state)
    check_positions(system, x0)
    drive, samples, keep = _drive(inputs, engine.ninputs, times, input_hold)
    if max_step is None:
        max_step = 5 * float(np.median(np.diff(times))) if callable(inputs) else np.inf
    run = engine.run(
        engine.start(x0, times[0]), times[-1], drive, times, rtol=rtol, atol=atol, max_step=max_step,
        max_steps=max_steps, log=4096 if keep_events else 1,
    )  # fmt: skip
    del keep
    n = run.recorded
    if not np.all(np.isfinite(run.outputs[:n])):
        n = int(np.argmin(np.isfinite(run.outputs[:n]).all(axis=1)))
        run.status = Status.DIVERGED
    if not run.status.ok:
        warnings.warn(
            f"event_response ended at t = {run.state.time:.6g} s: {run.status}", RuntimeWarning, stacklevel=2
        )
    response = EventResponse(
        times[:n],
        run.outputs[:n].T,
        run.states[:n].T,
        samples[:, :n],
        issiso=system.issiso(),
        output_labels=system.output_labels,
        input_labels=system.input_labels,
        state_labels=system.state_labels,
        return_x=bool(return_states),
        squeeze=squeeze,
        sysname=system.name,
        title=f"Event-located response of {system.name}",
    )
    response.events = engine.name_events(run.events) if keep_events else []
    response.event_count = run.event_count
    response.status = run.status
    return response


def check_positions(system, x0) -> None:
    """Raise ValueError where an initial state violates a gap or a stop of one of the blocks."""
    for core, first, name in _cores(system):
        x = x0[first : first + core.nstates]
        if core.bodies == 2 and core.joint in ("impact", "rigid"):
            gap = core.gap if core.joint == "impact" else 0.0
            delta = x[2] - x[0]
            if not -1e-12 <= delta <= gap * (1 + 1e-12) + 1e-12:
                raise ValueError(
                    f"the initial state of {name} needs 0 <= x_motor - x <= {gap:g} m (the clearance of its "
                    f"joint); got {delta:g}. Start with x_motor = x."
                )
        if core.stop is not None:
            low, high = core.stop.span
            at = x[2 * core.driven]
            if not low <= at <= high:
                raise ValueError(
                    f"the initial position of {name} must lie between its stops {low:g} and {high:g} m; "
                    f"got {at:g}."
                )


def _cores(system, first=0):
    if isinstance(system, ct.InterconnectedSystem):
        for part in system.syslist:
            yield from _cores(part, first)
            first += part.nstates or 0
    elif getattr(system, "core", None) is not None:
        yield system.core, first, system.name


def _with_params(system, params):
    if not params:
        return system
    if isinstance(system, ct.InterconnectedSystem):
        raise ValueError(
            "params of an interconnection: change the block itself with with_parameters, then interconnect."
        )
    if hasattr(system, "with_parameters"):
        return system.with_parameters(params)
    return ct.NonlinearIOSystem(
        system.updfcn, system.outfcn, inputs=system.input_labels, outputs=system.output_labels,
        states=system.state_labels, params={**system.params, **params}, name=system.name,
    )  # fmt: skip


def _times(timepts):
    times = np.atleast_1d(np.asarray(timepts, dtype=float))
    if times.ndim != 1 or len(times) < 2 or not np.all(np.isfinite(times)) or np.any(np.diff(times) <= 0):
        raise ValueError(
            f"timepts must be at least two finite times in ascending order [s]; got {timepts!r}."
        )
    return np.ascontiguousarray(times)


def _initial(system, initial_state):
    n = system.nstates or 0
    x0 = np.asarray(initial_state, dtype=float)
    if x0.ndim == 0:
        x0 = np.full(n, float(x0))
    x0 = x0.ravel()
    if len(x0) != n:
        raise ValueError(f"initial_state needs {n} values ({', '.join(system.state_labels)}); got {len(x0)}.")
    if not np.all(np.isfinite(x0)):
        raise ValueError(f"initial_state must be finite; got {x0}.")
    return x0


def _drive(inputs, nr, times, hold):
    if hold not in ("linear", "zoh"):
        raise ValueError(f"input_hold must be 'linear' or 'zoh'; got {hold!r}.")
    if callable(inputs):
        drive, keep = callback_drive(inputs, nr)
        samples = np.array([np.broadcast_to(np.asarray(inputs(t), float), nr) for t in times]).T
        return drive, samples, keep
    if isinstance(inputs, list | tuple):
        rows = [np.broadcast_to(np.asarray(u, float), times.shape) for u in inputs]
        u = np.array(rows).reshape(len(rows), len(times))
    else:
        u = np.asarray(inputs, dtype=float)
    if u.ndim == 0:
        samples = np.full((nr, len(times)), float(u))
        return constant_drive(np.full(nr, float(u))), samples, None
    u = np.atleast_2d(u)
    if u.shape != (nr, len(times)):
        raise ValueError(f"inputs must have shape ({nr}, {len(times)}) (inputs, times); got {u.shape}.")
    if not np.all(np.isfinite(u)):
        raise ValueError("inputs must be finite; got NaN or inf among them.")
    return sampled_drive(times, u, hold), u, None
