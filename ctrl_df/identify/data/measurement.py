"""Recorded runs as values: checked once, in SI units, ready to be compared with a model."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np

from ...cached import cached_property
from ...calls import keywords_of, unknown_keywords
from ...checks import choice, count, mapping, number, shown
from ...units import si_unit, to_si
from ...values.record_name import RecordName, digest
from ..thresholds import ON_SAMPLE
from . import quantities, readers, signals
from .checks import as_channel, check_apart, check_jumps, check_motion, check_times, check_turns
from .frequency_measurement import FrequencyMeasurement
from .parts import in_parts
from .thresholds import DECIMATED_BAND, MINIMUM, REGULAR, WINDOW_LEAST

__all__ = ["FrequencyMeasurement", "Measurement"]

HOLDS = ("zoh", "linear")
_CHANNELS = ("channels", "outputs")  # fields that hold arrays by name


@dataclass(frozen=True, eq=False, repr=False)
class Measurement:
    """One recorded run: time, input, output, and whatever else was measured.

    All arrays are converted to SI (angles in rad) and read-only; sampling may be irregular. Times
    of a regular clock that were rounded (300 Hz in whole milliseconds) are read as that clock's; a comparison
    says so.

    Parameters
    ----------
    t : array_like, shape (n,)
        Sample times, strictly increasing, n >= 10.
    u : array_like, shape (n,)
        Applied force, voltage or current; constant where a motion is free, as after a release.
    y : array_like, shape (n,)
        Measured output, usually the position, not constant; left out where `outputs` has all that was
        measured.
    name : str
        Shown in tables and pictures.
    input_unit, output_unit : str or None
        Units of the arrays given, such as ``mm``, ``um``, ``deg``, ``kN``; afterwards the SI unit. None: N
        and m, or the SI unit of the quantity that is named.
    time_unit : str
        Of `t`, such as ``ms``.
    input_hold : {'zoh', 'linear'}
        What the input did between samples: held its value, or varied linearly. A motion that is imposed, or
        that of a base, is smooth whatever is said here.
    velocity : array_like or None, shape (n,)
        Measured velocity, if there was a sensor for it.
    velocity_unit : str or None
        Its unit; None: output unit per second.
    channels : mapping or None
        Further signals by name, each an array in SI or a pair (array, unit).
    output, input : str or None
        What `y` and `u` are of: ``position`` (or ``x``, ``angle``), ``velocity`` (``v``, ``speed``),
        ``force`` (``F``, ``torque``), ``voltage``, ``current``, ``acceleration``; ``motion`` is a position
        that is imposed, where `y` is a force, or a position, a velocity or an acceleration of the base.
        None: the unit decides. Afterwards the first of these words.
    outputs : mapping or None
        All that was measured, by quantity, where that is more than one: ``{"x": x, "v": (v, "mm/s")}``, each
        an array in SI or a pair (array, unit). Each is weighted by its own noise; `y` is then the position,
        or the first. `velocity` is not fitted: drives compute it from the position.
    units : mapping
        SI unit of each output, by quantity.
    band : float
        Share of the Nyquist frequency that the outputs fill: 1, or less where the record was decimated.
    note : str
        How the record was read if it was changed on reading; otherwise empty.

    Raises
    ------
    ValueError
        NaN, unequal lengths, unsorted or repeated times, a hole in otherwise regular sampling, a position
        that jumps (an encoder that was reset), a constant output, or noise alone under a constant input,
        fewer than 10 samples, an unknown unit; the message gives rule, value, remedy.

    Examples
    --------
    >>> t = np.arange(0, 2, 0.01)
    >>> record = cdf.Measurement(1e3 * t, np.sin(3 * t), 5 * np.cos(3 * t), time_unit="ms", output_unit="mm")
    >>> record
    Measurement('measurement': 200 samples, 0 to 1.99 s, dt 0.01 s, input [N] zoh, output [m])
    """

    t: np.ndarray
    u: np.ndarray
    y: Any = None
    name: str = "measurement"
    input_unit: Any = None
    output_unit: Any = None
    input_hold: str = "zoh"
    velocity: np.ndarray | None = None
    channels: Mapping[str, Any] | None = None
    time_unit: str = "s"
    velocity_unit: str | None = None
    output: str | None = None
    input: str | None = None
    outputs: Mapping[str, Any] | None = None
    units: Mapping[str, str] = field(init=False)
    note: str = field(init=False, default="")
    band: float = field(init=False, default=1.0)

    def __post_init__(self):
        choice("Measurement", "input_hold", self.input_hold, HOLDS)
        if not isinstance(self.name, str):
            raise TypeError(f"Measurement needs name as text; got {shown(self.name)}.")
        if self.channels is not None:
            mapping("Measurement", "channels", self.channels, "{'current': (i, 'A')}")
        owner = f"Measurement {self.name!r}"
        t = as_channel(owner, "t", self.t)
        n = len(t)
        u = as_channel(owner, "u", self.u, n)
        input_quantity, scale_u, input_unit = quantities.stated("input", self.input, self.input_unit, "N")
        measured = self._measured(owner, n)
        t = to_si(t, self._seconds())[0]
        check_times(owner, t)
        t, rounded = signals.regular_clock(t)
        imposed = input_quantity == "position" and "position" not in measured
        check_motion(owner, t, u, [array for array, _, _ in measured.values()], imposed)
        for quantity, (array, scale, unit) in measured.items():
            if quantity == input_quantity:
                check_apart(owner, quantity, u * scale_u, array * scale)
            if unit == "rad":
                check_turns(owner, t, array, 2 * math.pi / scale)
            if quantity == "position":
                check_jumps(owner, t, array)
        outputs = {quantity: values * scale for quantity, (values, scale, _) in measured.items()}
        units = {quantity: unit for quantity, (_, _, unit) in measured.items()}
        output = quantities.leading(outputs)
        scale_y, output_unit = measured[output][1:]
        values: dict[str, Any] = dict(
            t=t, u=u * scale_u, y=outputs[output], input_unit=input_unit, output_unit=output_unit,
            input=input_quantity, output=output, units=MappingProxyType(units),
            outputs=MappingProxyType({k: _frozen(v) for k, v in outputs.items()}),
        )  # fmt: skip
        velocity_unit = f"{output_unit}/s"
        if self.velocity is not None:
            v = as_channel(owner, "velocity", self.velocity, n)
            scale_v, velocity_unit = (
                (scale_y, velocity_unit) if self.velocity_unit is None else si_unit(self.velocity_unit)
            )
            values["velocity"] = v * scale_v
        values["velocity_unit"], values["time_unit"] = velocity_unit, "s"
        values["note"] = f"times rounded to {rounded:.3g} s, read as a regular clock's" if rounded else ""
        extra = {}
        for key, given in (self.channels or {}).items():
            array, unit = quantities.with_unit(given)
            extra[key] = to_si(as_channel(owner, f"channel {key!r}", array, n), unit or "")[0]
        values["channels"] = MappingProxyType({k: _frozen(v) for k, v in extra.items()})
        given = self.name != type(self).name and getattr(self.name, "given", True)
        run = digest((values["t"], values["u"], *values["outputs"].values()))
        values["name"] = RecordName(self.name, run, given)
        for key, value in values.items():
            object.__setattr__(self, key, _frozen(value) if isinstance(value, np.ndarray) else value)

    def _measured(self, owner, n) -> dict[str, tuple[np.ndarray, float, str]]:
        """Return the outputs as given, their factor to SI and their SI unit, by quantity."""
        if self.outputs is None:
            y = as_channel(owner, "y", self.y, n)
            quantity, scale, unit = quantities.stated("output", self.output, self.output_unit, "m")
            return {quantity: (y, scale, unit)}
        given = mapping("Measurement", "outputs", self.outputs, "{'x': x, 'v': (v, 'mm/s')}")
        if not given or self.y is not None or self.output is not None or self.output_unit is not None:
            raise ValueError(
                f"{owner} needs either y (with output= and output_unit=) or outputs=, with one channel at "
                f"least; got {'no output' if not given else 'both'}. Give each unit beside its array: "
                "outputs={'x': (x, 'mm')}."
            )
        found: dict[str, tuple[np.ndarray, float, str]] = {}
        for word, channel in given.items():
            array, unit = quantities.with_unit(channel)
            quantity, scale, unit = quantities.stated("output", word, unit, "")
            if quantity in found:
                raise ValueError(
                    f"{owner} needs each quantity once in outputs; got {', '.join(map(repr, given))}. "
                    "Keep the better one as output, the other in channels."
                )
            found[quantity] = (as_channel(owner, f"output {word!r}", array, n), scale, unit)
        return found

    def _seconds(self):
        if si_unit(self.time_unit)[1] != "s":
            raise ValueError(
                f"Measurement needs a unit of time for t, such as s or ms; got {self.time_unit!r}."
            )
        return self.time_unit

    # --- from files and other objects -------------------------------------------------------------

    @classmethod
    def from_csv(
        cls, path, *, time="t", input="u", output="y", outputs=None, velocity=None, channels=(),
        delimiter=None, decimal=None, **keywords,
    ):  # fmt: skip
        """Read a text table with a header line.

        Read rightly, or refused with the line that is wrong: UTF-8, UTF-16 or Latin-1; units in the header or
        in a row below it; decimal commas; thousands marks; times as numbers, ISO (``2026-01-31T12:00:00.5``)
        or clock times (``12:00:00.5``), the last two in seconds from the first.

        Parameters
        ----------
        path : path-like
            Comma, semicolon, tab or blank separated; lines starting with ``#`` are skipped.
        time, input, output, velocity : str or int
            Column names, or numbers from 0. A unit in the header, as in ``x [mm]``, is used unless one is
            given, and need not be repeated in the name. The units tell the quantities (`input` and
            `output` are columns here).
        outputs : mapping or None
            Columns by quantity, in the place of `output`: ``{"x": "pos", "v": ("tacho", "rpm")}``, with a
            unit where the header has none.
        channels : sequence of str
            Further columns to keep.
        delimiter : str or None
            None: found from the first lines.
        decimal : {'.', ','} or None
            Decimal mark; None: as the numbers show it.
        **keywords
            As for `Measurement`: ``name``, ``input_unit``, ``output_unit``, ``time_unit``, ``input_hold`` ...

        Raises
        ------
        ValueError
            An unknown column (the message lists those there are), one column asked for twice, a cell that
            is no number (with its line), a file that is no text.
        """
        cls._check_keywords(keywords, cls.from_csv)
        table = readers.read_csv(path, delimiter, decimal)
        keywords.setdefault("name", readers.stem(path))
        return cls(
            **readers.select(table, time, input, output, outputs, velocity, channels, keywords, str(path))
        )

    @classmethod
    def from_mat(
        cls, path, *, time="t", input="u", output="y", outputs=None, velocity=None, channels=(), **keywords
    ):
        """Read variables of a MATLAB file (version 4 to 7.2).

        ``data.x`` reaches into a struct, ``data.0`` is the first column of a matrix.

        See `from_csv` for the parameters.
        """
        cls._check_keywords(keywords, cls.from_mat)
        table = readers.read_mat(path)
        keywords.setdefault("name", readers.stem(path))
        return cls(
            **readers.select(table, time, input, output, outputs, velocity, channels, keywords, str(path))
        )

    @classmethod
    def from_dataframe(
        cls, frame, *, time="t", input="u", output="y", outputs=None, velocity=None, channels=(), **keywords
    ):
        """Take columns of a pandas DataFrame; ``time=None`` takes its index.

        See `from_csv` for the parameters.
        """
        cls._check_keywords(keywords, cls.from_dataframe)
        table = readers.read_dataframe(frame, time)
        time = readers.INDEX if time is None else time
        columns = (time, input, output, outputs, velocity, channels)
        return cls(**readers.select(table, *columns, keywords, "the DataFrame"))

    @classmethod
    def from_response(cls, response, *, input=0, output=0, outputs=None, **keywords):
        """Take one input and one output of a ``ct.TimeResponseData``, by number or label.

        Several outputs by quantity: ``outputs={"x": 0, "v": 1}``, or ``{"x": "x", "v": ("v", "m/s")}``.
        The input of python-control's simulations runs straight between samples: ``input_hold='linear'``
        unless stated otherwise.
        """
        cls._check_keywords(keywords, cls.from_response)
        if outputs is not None:
            output = mapping("from_response", "outputs", outputs, "{'x': 0, 'v': 1}")
        t, u, y = readers.read_response(response, input, output)
        keywords.setdefault("input_hold", "linear")
        # every response of that system has this name
        keywords.setdefault("name", RecordName(getattr(response, "sysname", None) or "response", given=False))
        return cls(t, u, **({"y": y} if outputs is None else {"outputs": y}), **keywords)

    @classmethod
    def in_parts(cls, t, u, y=None, **keywords) -> tuple[Measurement, ...]:
        """Take a run that has breaks as several records, which share the parameters of a model.

        A break is where the recorder paused or dropped samples (a hole in a regular sampling, NaN, None or
        masked samples in any channel), where times start again, and where a position jumps (an encoder was
        reset; places are then counted from elsewhere). Nothing is filled in. Parts that are too short to
        teach anything (under 10 samples, output constant, or noise alone under a constant input) are left
        out, and a warning says how many samples that were.

        Parameters
        ----------
        t, u, y : array_like, shape (n,)
            As for `Measurement`; each may be a masked array.
        **keywords
            As for `Measurement`; every part has the `name` and its number.

        Returns
        -------
        tuple of Measurement

        Raises
        ------
        ValueError
            As for `Measurement`; no part that can be used.

        Examples
        --------
        >>> t = np.arange(0, 6, 0.01)
        >>> u, y = np.sin(3 * t), np.cos(3 * t)
        >>> [len(part) for part in cdf.Measurement.in_parts(t, u, y + 5 * (t > 2.495))]  # reset at 2.5 s
        [250, 350]
        """
        cls._check_keywords(keywords, cls.in_parts)
        return in_parts(cls, t, u, y, keywords)

    @classmethod
    def _check_keywords(cls, keywords, reader):
        """Refuse keywords that neither a reader knows by itself nor the record that it makes."""
        known = [f.name for f in dataclasses.fields(cls) if f.init and f.name not in ("t", "u", "y")]
        wrong = {k: v for k, v in keywords.items() if k not in known}
        if wrong:
            unknown_keywords(f"{cls.__name__}.{reader.__name__}", wrong, (*keywords_of(reader), *known))

    # --- what it is -------------------------------------------------------------------------------

    def __len__(self) -> int:
        return len(self.t)

    @property
    def duration(self) -> float:
        """Time from first to last sample [s]."""
        return float(self.t[-1] - self.t[0])

    @property
    def dt(self) -> float:
        """Sample time [s]; for irregular sampling the median interval."""
        return self.duration / (len(self.t) - 1) if self.regular else float(np.median(np.diff(self.t)))

    @cached_property
    def regular(self) -> bool:
        """Whether all intervals agree within 1 %."""
        steps = np.diff(self.t)
        middle = np.median(steps)
        return bool(np.all(np.abs(steps - middle) <= REGULAR * middle))

    def noise_floor(self) -> float:
        """Estimate the rms of the output's noise [output unit] from the top of its spectrum.

        The level found between half and 95 % of the Nyquist frequency is extended over the whole band: right
        for white noise, too low for noise that fades with frequency. An encoder's rounding is found from the
        smallest step in the record and counted as step/sqrt(12), the larger of both being returned.
        """
        return signals.noise_floor(self.t, self.y)

    def velocity_estimate(self, cutoff=None) -> np.ndarray:
        """Estimate the velocity [output unit/s] from the output.

        Central differences of the output passed forwards and backwards (no lag) through a 4th-order
        Butterworth low-pass; irregular sampling is interpolated to the median interval first. The ends (about
        1/`cutoff` seconds) are less exact.

        Parameters
        ----------
        cutoff : float or None
            [Hz]; None: where the spectrum of the output sinks into its noise floor.
        """
        return signals.derivative(self.t, self.y, 1, cutoff)

    def acceleration_estimate(self, cutoff=None) -> np.ndarray:
        """Estimate the acceleration [output unit/s^2]; see `velocity_estimate`."""
        return signals.derivative(self.t, self.y, 2, cutoff)

    # --- parts ------------------------------------------------------------------------------------

    def slice(self, start=None, stop=None) -> Measurement:
        """Return the samples with ``start <= t <= stop`` [s]; at least 10 must remain."""
        low = self.t[0] if start is None else number("slice", "start", start, "s", infinite=True)
        high = self.t[-1] if stop is None else number("slice", "stop", stop, "s", infinite=True)
        margin = ON_SAMPLE * max(self.dt, abs(low), abs(high))
        first = int(np.searchsorted(self.t, low - margin, "left"))
        last = int(np.searchsorted(self.t, high + margin, "right"))
        if last - first < MINIMUM:
            raise ValueError(
                f"a slice needs 10 samples or more; {low:g} to {high:g} s holds {max(last - first, 0)} of "
                f"{self.name!r}, which runs from {self.t[0]:g} to {self.t[-1]:g} s. Widen it."
            )
        return self._part(slice(first, last), self.name)

    def windows(self, length, overlap=0.0) -> tuple[Measurement, ...]:
        """Cut the record into windows.

        Parameters
        ----------
        length : float
            [s], at least 10 samples; a record shorter than that is one window.
        overlap : float
            Share of a window that the next one repeats, 0 <= overlap < 1.

        Returns
        -------
        tuple of Measurement
            Of `length` each; what is left at the end joins the last one.
        """
        length, overlap = number("windows", "length", length, "s"), number("windows", "overlap", overlap)
        if not 0 <= overlap < 1:
            raise ValueError(f"windows needs 0 <= overlap < 1 (share of a window); got overlap={overlap!r}.")
        if not length > WINDOW_LEAST * self.dt:
            raise ValueError(
                f"windows needs a length over {WINDOW_LEAST} samples ({WINDOW_LEAST * self.dt:g} s); got "
                f"length={length!r}."
            )
        if not length * (1 - overlap) > 0.5 * self.dt:
            raise ValueError(
                f"windows needs an overlap that moves on by a sample at least; got overlap={overlap!r} of "
                f"{length:g} s. Lower it."
            )
        number_of = max(int((self.duration - length) / (length * (1 - overlap)) + 1 + ON_SAMPLE), 1)
        starts = self.t[0] + length * (1 - overlap) * np.arange(number_of)
        edges = np.searchsorted(self.t, starts - ON_SAMPLE * self.dt)
        ends = np.searchsorted(self.t, starts + length - ON_SAMPLE * self.dt)
        ends[-1] = len(self.t)
        pairs = [(a, b) for a, b in zip(edges, ends, strict=True) if b - a >= MINIMUM]
        return tuple(self._part(slice(a, b), f"{self.name} [{i}]") for i, (a, b) in enumerate(pairs))

    def decimate(self, factor) -> Measurement:
        """Return every `factor`-th sample.

        Output, velocity and channels pass a zero-phase low-pass at 70 % of the new Nyquist frequency first.
        A held input is averaged over each new interval, which keeps its impulse; a linear one is filtered
        like the output.

        Raises
        ------
        ValueError
            Irregular sampling, a factor that is no integer >= 1, or fewer than 10 samples left.
        """
        factor = count("decimate", "factor", factor)
        if not self.regular:
            raise ValueError(
                "decimate needs regular sampling; these intervals differ by more than 1 %. Resample first."
            )
        if len(self.t) // factor < MINIMUM:
            raise ValueError(
                f"decimate needs 10 samples left; {len(self.t)} samples over {factor} are too few."
            )
        if factor == 1:
            return self
        outputs = {k: signals.decimated(v, factor) for k, v in self.outputs.items()}  # type: ignore[union-attr]
        velocity = None if self.velocity is None else signals.decimated(self.velocity, factor)
        channels = {k: _frozen(signals.decimated(v, factor)) for k, v in self.channels.items()}  # type: ignore[union-attr]
        zoh = self.input_hold == "zoh"
        u = signals.block_means(self.u, factor) if zoh else signals.decimated(self.u, factor)
        return self.replaced(
            t=self.t[::factor], u=u, outputs=outputs, velocity=velocity, channels=MappingProxyType(channels),
            band=DECIMATED_BAND,
        )  # fmt: skip

    def _part(self, where, name):
        channels = MappingProxyType({k: v[where] for k, v in self.channels.items()})  # type: ignore[union-attr]
        velocity = None if self.velocity is None else self.velocity[where]
        outputs = {k: v[where] for k, v in self.outputs.items()}  # type: ignore[union-attr]
        return self.replaced(
            t=self.t[where], u=self.u[where], outputs=outputs, velocity=velocity, channels=channels, name=name
        )

    def only(self, quantity: str) -> Measurement:
        """Return the record with one of its outputs alone, by quantity."""
        return self.replaced(outputs={quantity: self.outputs[quantity]})  # type: ignore[index]

    def replaced(self, **changes):
        """Copy without checking again: a part of a good record may well have a constant input.

        A `y` alone takes the place of all outputs. The copy is still of the run that the record is of.
        """
        if "y" in changes:
            changes["outputs"] = {self.output: changes["y"]}
        if "outputs" in changes:
            changes |= self._led(changes["outputs"])
        if not isinstance(name := changes.get("name", self.name), RecordName):
            changes["name"] = RecordName(
                name, getattr(self.name, "run", ""), getattr(self.name, "given", True)
            )
        part = object.__new__(type(self))
        for f in dataclasses.fields(self):
            value = changes.get(f.name, getattr(self, f.name))
            object.__setattr__(part, f.name, _frozen(value) if isinstance(value, np.ndarray) else value)
        return part

    def noted(self, note: str, **changes):
        """Copy as `replaced` does; `note` is added to what is said of how the record was read."""
        return self.replaced(note="; ".join(filter(None, (self.note, note))), **changes)

    def _led(self, outputs) -> dict[str, Any]:
        """Return the fields that go with these outputs."""
        output = quantities.leading(outputs)
        return {
            "outputs": MappingProxyType({k: _frozen(v) for k, v in outputs.items()}),
            "units": MappingProxyType({k: self.units.get(k, "") for k in outputs}),
            "output": output, "y": outputs[output], "output_unit": self.units.get(output, ""),
        }  # fmt: skip

    def __getstate__(self):
        """Return the fields for pickling (worker processes); a mapping proxy cannot be."""
        state = {f.name: getattr(self, f.name) for f in dataclasses.fields(self)}
        return {k: dict(v) if isinstance(v, MappingProxyType) else v for k, v in state.items()}

    def __setstate__(self, given):
        """Take the fields back, read-only again."""
        state: dict[str, Any] = {k: _frozen(v) if isinstance(v, np.ndarray) else v for k, v in given.items()}
        state |= {k: MappingProxyType({n: _frozen(v) for n, v in state[k].items()}) for k in _CHANNELS}
        state["units"] = MappingProxyType(state["units"])
        for key, value in state.items():
            object.__setattr__(self, key, value)

    def __repr__(self) -> str:
        rate = f"dt {self.dt:g} s" if self.regular else f"irregular, median dt {self.dt:g} s"
        extra = "" if self.velocity is None else ", velocity"
        extra += "".join(f", {k}" for k in self.channels)  # type: ignore[union-attr]
        between = quantities.between_samples(self.input_unit, self.output_unit, self.input_hold)
        return (
            f"Measurement({self.name!r}: {len(self)} samples, {self.t[0]:g} to {self.t[-1]:g} s, {rate}, "
            f"input [{self.input_unit}] {between}, output [{', '.join(self.units.values())}]{extra})"
        )


def _frozen(array: np.ndarray) -> np.ndarray:
    view = array.view()
    view.flags.writeable = False
    return view
