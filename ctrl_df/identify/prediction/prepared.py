"""A model made ready for a record: what the record's clock can do exactly is taken out of the engine.

A dead time shifts the axis of the input or the instants at which the output is read, static laws of a held
input act on its samples, offset, drift and rounding act on the output's samples.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from ...blocks.mechanism import Mechanism
from ...blocks.primitives import Delay, Lag, PiecewiseAffine, Quantizer, Ramp
from ...simulate.engine import Engine
from ...simulate.parallel import require_compiled
from ..data.measurement import Measurement
from .decimated import decimated, lagged
from .sensed import POSITION, sensed
from .thresholds import EARLIER_INPUTS, LONG_BEFORE
from .values import block_of, feasible, with_values

_DRIVES: WeakKeyDictionary[Measurement, dict] = WeakKeyDictionary()
REFERENCE = ("reference", "r")
_READY = 16  # parameter sets whose models are kept ready: those of a Jacobian, and the one they are about


@dataclass
class PreparedModel:
    """An engine, what drives it, and what acts outside of it."""

    engine: Engine
    core: Any
    offset: int  # of the block's states in the engine's
    drive_time: np.ndarray
    drive_value: np.ndarray
    delay: float = 0.0  # of the output
    output: list = field(default_factory=list)  # (primitive, delay still to come)
    lags: list = field(default_factory=list)  # (state, samples)
    hold: str = ""  # between the values of the drive; as recorded if not said
    late: float = 0.0  # what is seen first of a segment lies so long before its first sample [s]
    earlier: int = 0  # values of the drive before the record that dead times let act in it, after the first


class Models:
    """A model made ready for a record, with many parameter values.

    Parameters
    ----------
    model : block or loop
    record : Measurement
    decimation : int
        The input of a block is given in steps of that many samples.
    """

    def __init__(self, model, record: Measurement, decimation: int = 1):
        self.model, self.record, self.block = model, record, block_of(model)
        self.closed = getattr(model, "parts", None) is not None
        self.mechanism = isinstance(self.block, Mechanism)
        exact = not record.regular or record.input_hold != "zoh" or self.closed
        self.decimation = 1 if exact else decimation
        self._ready: dict[Any, PreparedModel] = {}

    @property
    def driven_alone(self) -> bool:
        """Whether it is a mechanism that the record's input drives."""
        return self.mechanism and not self.closed

    def ready(self, values: Mapping[str, float] | None) -> PreparedModel:
        """Return the model with these values (None: its own) ready to run; the latest stay so."""
        key = None if values is None else tuple(values.items())
        if key in self._ready:
            return self._ready[key]
        part = self.driven(values, self.record.u)
        require_compiled(part.engine)
        if len(self._ready) >= _READY:
            del self._ready[next(iter(self._ready))]
        self._ready[key] = part
        return part

    def driven(self, values, u, engine: Engine | None = None) -> PreparedModel:
        """Return the model with these values ready to run under the input `u` (n,).

        `engine`: of it, where there is one; then with its own values (None).
        """
        if self.driven_alone:
            known = feasible(self.block, values) if values else None
            return of_block(self.block, self.record, u, self.decimation, engine, known)
        model = with_values(self.model, values)
        if self.closed:
            return of_loop(model, self.record, u, self.mechanism, engine)
        return of_system(model, self.record, u, engine)


def recorded_reference(record) -> np.ndarray | None:
    """Return the reference of a loop that a record has beside the force, (n,); None where it has none."""
    channels = record.channels or {}
    return next((channels[k] for k in REFERENCE if k in channels), None)


def of_system(system, record, u, engine: Engine | None = None) -> PreparedModel:
    """Return a system of which nothing is known, driven by the input `u` (n,).

    `engine`, here and below: of the same model under another input.
    """
    return PreparedModel(engine or Engine(system), None, 0, *_before(record, record.t, u))


def of_loop(loop, record, u, mechanism: bool, engine: Engine | None = None) -> PreparedModel:
    """Return a loop, driven by the record's reference, or by `u` where it has none."""
    reference, block = recorded_reference(record), loop.parts.block
    driven = u if reference is None else reference
    offset = (loop.nstates or 0) - (block.nstates or 0)
    core = block.core if mechanism else None
    return PreparedModel(engine or Engine(loop), core, offset, *_before(record, record.t, driven))


def of_block(
    block,
    record,
    u,
    decimation: int,
    engine: Engine | None = None,
    values: Mapping[str, float] | None = None,
) -> PreparedModel:
    """Return a mechanism, driven by the input `u` (n,) in steps of `decimation` samples.

    `values`: parameters that differ from the block's.
    """
    effects = block.effects_at(values) if values else block.named_effects
    beside = _Beside(effects, u, held=record.input_hold == "zoh")
    if engine is None:
        kept = [e for k, e in effects.items() if k not in beside.names]
        if values:
            engine = Engine(block.core_at(values, kept))
        else:
            engine = Engine(block.with_effects(kept) if beside.names else block)
    system: Any = engine.system
    core = system if values else system.core
    time, value, hold = _driven(record, beside.shaped, decimation)
    time = time + beside.input_delay if beside.input_delay else time
    delay = beside.output_delay
    late = delay if POSITION in sensed(record).columns else 0.0
    time, value, earlier = _with_earlier(time, value, beside.input_delay + late)
    t = record.t
    lags = [
        (state, np.interp(t - beside.input_delay, t, s)) for state, s in _lags(core, record, beside.shaped)
    ]
    return PreparedModel(engine, core, 0, time, value, delay, beside.output, lags, hold, late, earlier)


class _Beside:
    """Effects that act outside of the engine: on the samples of the input, on the clock, on the output.

    Parameters
    ----------
    effects : dict of str to Effect
    u : (n,) array
        The input.
    held : bool
        Whether it is constant between samples.

    Attributes
    ----------
    names : list of str
        Those effects.
    input_delay, output_delay : float
        Dead times before and behind what is left [s].
    shaped : (n,) array
        The input as it is left.
    output : list of (primitive, float)
        What acts on the samples of the output, and the delay that it has behind it [s].
    """

    def __init__(self, effects, u, held: bool):
        self.names, self.input_delay, self.shaped = [], 0.0, u
        static = held
        for key, effect in effects.items():
            if effect.role != "input":
                continue
            channel = effect.channel()
            if effect.law is not None:
                static = False  # what is more than a channel stays where the motion is known
            elif all(isinstance(p, Delay) for p in channel):
                # a dead time commutes with every law that does not know the time of day
                self.input_delay += sum(p.delay for p in channel)
                self.names.append(key)
            elif static and all(isinstance(p, PiecewiseAffine) and not p.hysteretic for p in channel):
                for p in channel:
                    self.shaped = p.value(self.shaped)
                self.names.append(key)
            else:
                static = False
        tail: list = []
        for key, effect in reversed(list(effects.items())):
            if effect.role == "output":
                channel = effect.channel()
                if not all(isinstance(p, Delay | Ramp | Quantizer) for p in channel):
                    break
                tail = [*channel, *tail]
                self.names.append(key)
        delays = [p.delay if isinstance(p, Delay) else 0.0 for p in tail]
        self.output_delay = float(sum(delays))
        later = [float(sum(delays[i + 1 :])) for i in range(len(tail))]
        self.output = [(p, rest) for p, rest in zip(tail, later, strict=True) if not isinstance(p, Delay)]


def _driven(record, shaped, decimation):
    """Return times and values of an input in steps of `decimation` samples, and how to join them.

    Kept for as long as the record lives where no law has changed its input.
    """
    known = _DRIVES.setdefault(record, {}) if shaped is record.u else {}
    if decimation not in known:
        time, value, hold = record.t, shaped, record.input_hold
        if decimation > 1:
            time, value, hold = decimated(time, shaped, decimation)
        known[decimation] = (*_before(record, time, value), hold)
    return known[decimation]


def _with_earlier(time, value, unseen: float):
    """Give the last `unseen` seconds before a drive's first value places of their own, which values hold it.

    Returns times, values, and how many these are.
    """
    if not unseen:
        return time, value, 0
    places = time[1] - unseen * np.arange(EARLIER_INPUTS, 0, -1) / EARLIER_INPUTS
    shaped = np.full(EARLIER_INPUTS, value[0])
    return np.insert(time, 1, places), np.insert(value, 1, shaped), EARLIER_INPUTS


def _lags(core, record, signal):
    """Yield (state, samples) of every lag that the input passes, as the whole record drives it."""
    for primitive, state in core.input_channel:
        if isinstance(primitive, Lag):
            if record.input_hold == "zoh":
                signal = lagged(record.t, signal, primitive.time_constant)
            yield state, signal
        elif state < 0:
            signal = primitive.value(signal)


def _before(record, t, u):
    """Let the first value hold for all time before the record."""
    return np.concatenate(([t[0] - LONG_BEFORE * record.duration - 1.0], t)), np.concatenate(([u[0]], u))
