"""A model driven by a recorded input: whole, or segment by segment from initial states of its own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import accumulate, pairwise
from typing import Any

import numpy as np

from ...blocks.mechanism import Mechanism
from ...blocks.primitives import Delay, Lag, Ramp
from ...cached import cached_property
from ...simulate.groups import grouped
from ...simulate.kernel.many import Drives
from ...simulate.parallel import require_compiled
from ...simulate.runs import run_many, sampled_drives
from ...status import Status
from ..data.measurement import Measurement
from ..thresholds import RTOL
from . import initial_states
from .prepared import PreparedModel, of_block, of_loop, of_system
from .segments import Segments, facts_of
from .sensed import POSITION, sensed
from .thresholds import EARLIER_INPUTS, FAR_LIMIT, FORGOTTEN, RESTORING, STEPS_AT_LEAST, STEPS_PER_SAMPLE
from .values import block_of, feasible, for_record, with_values

Request = tuple[Segments, Mapping[str, float] | None, np.ndarray | None]
"""Segments, parameters that differ from the model's, corrections of the initial states."""

_PREPARED = 16  # parameter sets whose models are kept ready: those of a Jacobian, and the one they are about


class _Inputs:
    """Times and values of inputs, each pair of arrays once: they are shared by segments and by models."""

    def __init__(self):
        self.pairs: list[tuple[np.ndarray, np.ndarray]] = []
        self._known: dict[tuple[int, int], int] = {}

    def add(self, time: np.ndarray, value: np.ndarray) -> int:
        """Return the number of a pair, which is kept."""
        number = self._known.setdefault((id(time), id(value)), len(self.pairs))
        if number == len(self.pairs):
            self.pairs.append((time, value))
        return number


def most_steps(samples):
    """Return how many steps a run over so many samples may take; an integer, or an array of them."""
    return STEPS_PER_SAMPLE * samples + STEPS_AT_LEAST


class Simulator:
    """One model on one record, ready to be run with many parameter values.

    Parameters
    ----------
    model : block or loop of `ctrl_df.closed_loop`
        A block is driven by the recorded input (the force). A loop runs on the reference: the channel
        ``reference`` of the record, or its input where there is none. It has this record's own values.
    record : Measurement
        The run.
    decimation : int
        The input is given in steps of that many samples (their impulse and its moment kept), which makes the
        run as many times faster and the result a little coarser; for first iterations.
    rtol : float
        Relative tolerance of the engine.
    initial : str
        Initial states of segments: `initial_states.FREE`, `CONTINUED` or `MEASURED`.

    Raises
    ------
    TypeError
        A model that is neither.
    """

    def __init__(
        self,
        model,
        record: Measurement,
        *,
        decimation: int = 1,
        rtol: float = RTOL,
        initial: str = initial_states.FREE,
    ):
        model = for_record(model, record.name)
        self.model, self.record, self.rtol, self.initial = model, record, rtol, initial
        self.input = np.asarray(record.u)
        self.closed = getattr(model, "parts", None) is not None
        self.block = block_of(model)
        self.mechanism = isinstance(self.block, Mechanism)
        self.decimation = (
            decimation if record.regular and record.input_hold == "zoh" and not self.closed else 1
        )
        self.facts, self.sensed = facts_of(self.block, record), sensed(record)
        self.runs = 0
        self.early: list[tuple[float, Status]] = []
        """When runs of the last call ended that did not reach their end [s], and how."""
        self._prepared: dict[Any, PreparedModel] = {}
        self._kept_drives: Any = (), None
        self._kept_held: Any = None, 0.0, None

    @property
    def position_dependent(self) -> bool:
        """Whether the block's laws depend on the place (a spring, a ripple, a stop, or a law not known)."""
        return self.closed or not self.mechanism or self.block.core.position_dependent

    @property
    def restoring(self) -> bool:
        """Whether something pulls the model back, so that a free run does not drift."""
        if self.closed or not self.mechanism:
            return True
        pull, s = 0.0, 2 * self.facts.position
        for term in self.block.core.forces:
            if any(p.per_record for p in term.effect.parameters.values()):
                continue  # what restarts in every record holds nothing in one place
            law, p = type(term.effect).law, term.effect.values
            z = np.zeros(max(term.effect.states, 1))
            centre = float(np.mean(self.facts.place))
            forces = [float(law(0.0, centre + d, 0.0, z, p, z.copy())) for d in (-s, s)]  # type: ignore[misc]
            pull += forces[0] - forces[1]
        return pull > RESTORING * self.facts.force

    @cached_property
    def free_states(self) -> tuple[str, ...]:
        """Names of the initial states estimated beside the parameters, per segment."""
        if not self.mechanism:
            return ()
        return (*initial_states.fitted_names(self.block.core, self.initial), *self._unsettled, *self._earlier)

    @cached_property
    def _unsettled(self) -> dict[str, Lag]:
        """Lags of the input, whose first states nobody knows, by the names of their corrections."""
        if self._settled:
            return {}
        core = self.block.core
        return {core.state_names[state]: p for p, state in core.input_channel if isinstance(p, Lag)}

    @cached_property
    def _earlier(self) -> tuple[str, ...]:
        """Names of the inputs before the record that dead times let act in it, less its first one."""
        if self._settled:
            return ()
        channels = (p for e in self.block.effects if e.role in ("input", "output") for p in e.channel())
        if not any(isinstance(p, Delay) for p in channels):
            return ()
        return tuple(f"input {i} before" for i in range(EARLIER_INPUTS))

    @property
    def _settled(self) -> bool:
        """Whether what came before the record is taken as its first sample has it."""
        return not self.mechanism or self.closed or self.initial != initial_states.FREE

    @cached_property
    def continued(self) -> bool:
        """Whether some of the initial states go on from one segment into the next."""
        return self.mechanism and bool(initial_states.continued_names(self.block.core, self.initial))

    @property
    def apart(self) -> bool:
        """Whether segments have initial states of their own, which nothing else moves."""
        return not self.continued

    def priors(self, segments: Segments) -> np.ndarray:
        """Return how far each initial state may be from its estimate, (nw, number of them)."""
        if not self.free_states:
            return np.zeros((len(segments), 0))
        unsettled, earlier = self._unsettled, self._earlier
        states = [n for n in self.free_states if n not in unsettled and n not in earlier]
        reach = initial_states.reach(states, self.block.core, self.facts, segments)
        since = self.record.t[segments.first] - self.record.t[0]
        # a lag forgets: deep in the record its state is known
        first = abs(float(self.input[0])) + self.facts.force
        forgets = [np.maximum(np.exp(-since / p.time_constant), FORGOTTEN) for p in unsettled.values()]
        forgets += [np.where(self.acts(n, segments), 1.0, FORGOTTEN) for n in earlier]
        return np.column_stack((reach, *(first * left for left in forgets)))

    def acts(self, name: str, segments: Segments) -> np.ndarray:
        """Return in which segments (nw,) an initial state shows: one of the time before the record in few."""
        if name not in self._earlier:
            return np.full(len(segments), True)
        return self._unseen(self.prepared(None), segments)

    def run(
        self,
        segments: Segments,
        values: Mapping[str, float] | None = None,
        start: np.ndarray | None = None,
        *,
        rounded: bool = False,
    ) -> np.ndarray:
        """Simulate and return the outputs at the samples within the segments, shape (n,).

        As `sensed.Sensed` has them: one after the other, each over its own noise.

        Parameters
        ----------
        segments : Segments
            Where the state is set again.
        values : mapping or None
            Parameters that differ from the model's.
        start : (nw, number of them) array or None
            Corrections of the initial states: position [m], velocity [m/s], then for a joint with a gap its
            slack (0 to 1, None: from the acceleration) and its rate [m/s], for an elastic joint its
            deflection [m] and rate [m/s] beyond the steady one, for bristles the share of full deflection
            beyond the steady one, for lags and dead times the force before the record beyond its first [N].
        rounded : bool
            Whether an encoder of the model rounds the output. Fits leave it out: its steps have no slope.

        Returns
        -------
        array
            Where the model ran away, ten times the spread of the record beside its mean.
        """
        return self.run_all([(segments, values, start)], rounded=rounded)[0]

    def run_all(self, asked: Sequence[Request], *, rounded: bool = False) -> list[np.ndarray]:
        """Do what `run` does for several (segments, values, start) in one call, on all cores.

        Returns
        -------
        list of (n,) arrays
            One for each that is asked for.
        """
        return self._run([self.prepared(values) for _, values, _ in asked], asked, rounded)

    def run_driven(self, segments: Segments, start: np.ndarray | None, inputs) -> list[np.ndarray]:
        """Do what `run` does under each of several inputs (n,) in place of the recorded one, in one call.

        Returns
        -------
        list of (n,) arrays
            One for each input.
        """
        engine = self.prepared(None).engine
        parts = [self._driven(None, u, engine) for u in inputs]
        return self._run(parts, [(segments, None, start)] * len(parts), False)

    def _run(self, parts: Sequence[PreparedModel], asked: Sequence[Request], rounded: bool):
        """Run models made ready over what is asked for, with the values that they have."""
        self.runs += len(asked)
        self.early = []
        return [
            self._read(part, segments, out, rounded)
            for part, (segments, _, _), out in zip(parts, asked, self._together(parts, asked), strict=True)
        ]

    def _together(self, parts: Sequence[PreparedModel], asked: Sequence[Request]) -> list[np.ndarray]:
        """Run all segments of all that is asked for at once, except where systems differ in their states."""
        outputs: list[np.ndarray] = [np.empty(0)] * len(asked)
        hidden = [self._hidden(p) for p in parts]
        sizes = [
            (p.engine.nstates, len(p.drive_time), p.hold, None if h is None else h.tobytes())
            for p, h in zip(parts, hidden, strict=True)
        ]
        for size in dict.fromkeys(sizes):
            which = [i for i, s in enumerate(sizes) if s == size]
            done = self._alike([parts[i] for i in which], [asked[i] for i in which], hidden[which[0]])
            for i, out in zip(which, done, strict=True):
                outputs[i] = out
        return outputs

    def _alike(
        self, parts: Sequence[PreparedModel], asked: Sequence[Request], hidden: np.ndarray | None
    ) -> list[np.ndarray]:
        """Run all segments of systems alike in their states; the `hidden` ones go on."""
        edges = [0, *accumulate(len(segments) for segments, _, _ in asked)]
        ranges = [np.arange(i, j) for i, j in pairwise(edges)]
        x0, since, lengths, drive = [], [], [], []
        drives = _Inputs()
        for part, (segments, _, start) in zip(parts, asked, strict=True):
            x0.append(self._starts(part, segments, start))
            since.append(self.record.t[segments.first] - self.late(part))
            lengths.append(segments.counts)
            drive.append(self._driving(part, segments, start, drives))
        length, begin = self._joined(lengths), self._joined(x0)
        groups = grouped([(p.engine, rows) for p, rows in zip(parts, ranges, strict=True)])
        sampled, outputs, result = self._sampled(drives, parts[0].hold), {}, None
        which, until = (np.zeros(0, int), 0.0) if hidden is None else self._followed(parts, asked)
        for columns, delays in self._readings(parts):
            if hidden is not None and result is not None:
                # what is read beside it begins where that has begun
                on = which[[result.status[i].ok for i in which]]
                begin[on + 1] += (result.x[on] - begin[on + 1]) @ hidden.T
                which, until = which[:0], 0.0
            times, first = self._instants(asked, delays)
            after, end = np.full(len(length), -1), times[first + length - 1]
            after[which + 1], end[which] = which, until
            result = run_many(
                groups, begin, self._joined(since), end, times, sampled,
                drive=self._joined(drive), first=first, count=length, order=5, rtol=self.rtol,
                max_steps=most_steps(length), after=after, hidden=hidden,
            )  # fmt: skip
            for error in result.errors.values():
                raise error
            for i in (result.recorded < length).nonzero()[0]:
                self.early.append((float(result.time[i]), result.status[i]))
            outputs |= {column: result.outputs[:, column] for column in columns}
        ends = [0, *accumulate(len(segments.samples) for segments, _, _ in asked)]
        return [self._joined([outputs[c][i:j] for c in self.sensed.columns]) for i, j in pairwise(ends)]

    def _instants(self, asked: Sequence[Request], delays) -> tuple[np.ndarray, np.ndarray]:
        """Return the times (nt,) at which outputs are read, each once, and where segments begin in them."""
        times, first, known, count = [], [], {}, 0
        for (segments, _, _), delay in zip(asked, delays, strict=True):
            key = id(segments), delay
            if key not in known:
                known[key] = count
                times.append(self.record.t[segments.samples] - delay)
                count += len(times[-1])
            first.append(known[key] + segments.begins[: len(segments)])
        return self._joined(times), self._joined(first)

    def _followed(self, parts, asked: Sequence[Request]) -> tuple[np.ndarray, np.ndarray]:
        """Return which of all segments another follows, after a pause of at most two, and when [s]."""
        which, begin, at = [], [], 0
        for part, (segments, _, _) in zip(parts, asked, strict=True):
            pause = segments.first[1:] - segments.stop[:-1]
            w = np.flatnonzero((pause >= 0) & (pause <= 2 * (segments.stop - segments.first)[:-1]))
            which.append(at + w)
            begin.append(self.record.t[segments.first[w + 1]] - self.late(part))
            at += len(segments)
        return np.concatenate(which), np.concatenate(begin)

    def _driving(self, part, segments: Segments, start, drives: _Inputs) -> np.ndarray:
        """Return which of the inputs drives each of the segments (nw,); those that are new are added."""
        which = np.full(len(segments), drives.add(part.drive_time, part.drive_value))
        if start is not None and self._earlier and part.earlier:
            off = np.asarray(start)[:, -EARLIER_INPUTS:]
            for w in np.flatnonzero(self._unseen(part, segments) & np.any(off != 0, axis=1)):
                value = part.drive_value.copy()
                value[1 : 1 + part.earlier] += off[w]
                which[w] = drives.add(part.drive_time, value)
        return which

    def _unseen(self, part, segments: Segments) -> np.ndarray:
        """Return whether segments begin while what came before the record still acts, (nw,) booleans."""
        return self.record.t[segments.first] - self.late(part) < part.drive_time[1 + part.earlier]

    def _sampled(self, drives: _Inputs, hold: str) -> Drives:
        """Return what drives these, as the engine takes it; the last is kept, mostly asked for again."""
        inputs = tuple(array for pair in drives.pairs for array in pair)
        kept, sampled = self._kept_drives
        if len(kept) != len(inputs) or any(a is not b for a, b in zip(kept, inputs, strict=True)):
            sampled = sampled_drives(
                np.array(inputs[::2]),
                np.array(inputs[1::2])[:, None],
                hold or self.record.input_hold,
            )
            self._kept_drives = inputs, sampled
        return sampled

    def late(self, part) -> float:
        """Return by how much what is seen first of a segment lies before its first sample [s]."""
        return part.delay if POSITION in self.sensed.columns else 0.0

    def _readings(self, parts) -> list[tuple[tuple[int, ...], list[float]]]:
        """Return outputs that are read at the same instants, and how long after these they are seen [s].

        Sensors that delay are of the position: those that segments begin with come first.
        """
        delays, columns = [p.delay for p in parts], self.sensed.columns
        none = [0.0] * len(parts)
        if not any(delays):
            return [(columns, none)]
        return [
            ((c,), delays if c == POSITION else none) for c in sorted(columns, key=lambda c: c != POSITION)
        ]

    @staticmethod
    def _joined(outputs) -> np.ndarray:
        return outputs[0] if len(outputs) == 1 else np.concatenate(outputs)

    def _starts(self, part, segments: Segments, start) -> np.ndarray:
        """Return the states (nw, nx) in which segments begin, where no hidden ones go on."""
        x0 = np.zeros((len(segments), part.engine.nstates))
        if part.core is None:
            return x0
        given = {} if start is None else dict(zip(self.free_states, np.asarray(start).T, strict=True))
        states, usual = x0[:, part.offset :], self._usual(part, segments, slice(None))
        initial_states.fill(states, part.core, given, usual, self.facts.speed)
        for state, samples in part.lags:
            off = given.get(part.core.state_names[state], 0.0)
            states[:, state] = samples[segments.first] + off
        return x0

    def _hidden(self, part) -> np.ndarray | None:
        """Return the projection (nx, nx) on the states that go on into the next segment, if any do."""
        if not self.continued:
            return None
        found = np.zeros((part.engine.nstates,) * 2)
        found[part.offset :, part.offset :] = initial_states.continued(part.core, self.initial)
        return found

    def _read(self, part, segments: Segments, out: np.ndarray, rounded: bool) -> np.ndarray:
        """Return what the sensors make of outputs; what ran away is set aside."""
        record, inside, measured = self.record, segments.samples, self.sensed
        read = []
        for block, column, (centre, limit), weight in zip(
            segments.blocks, measured.columns, measured.spans, measured.weights, strict=True
        ):
            x = out[block]
            for primitive, later in part.output if column == POSITION else ():
                if isinstance(primitive, Ramp):
                    x += primitive.offset + primitive.rate * (record.t[inside] - later)
                elif rounded:
                    x = primitive.value(x)
            low, high = centre - FAR_LIMIT * limit, centre + FAR_LIMIT * limit
            if not (x.min() >= low and x.max() <= high):  # NaN fails both
                with np.errstate(invalid="ignore"):
                    x = np.where(np.isfinite(x), np.clip(x, low, high), centre + limit)
            read.append(x if len(measured.columns) == 1 else weight * x)
        return self._joined(read)

    def at_rest(self, segments: Segments, values) -> np.ndarray:
        """Return the initial states (nw, number of them) with which every segment begins at rest.

        Where its first sample was measured: a parabola through the neighbours is off where the body has just
        come to rest, or breaks away.
        """
        part, rows = self.prepared(values), []
        for w, first in enumerate(segments.first):
            usual, sampled = self._usual(part, segments, w), self.facts.place[first] - segments.x[w]
            given = initial_states.at_rest(part.core, usual, self.facts.speed, sampled)
            rows.append([given.get(name, 0.0) for name in self.free_states])
        return np.array(rows)

    def in_gap(self, segments: Segments, values, places: Sequence[float]) -> tuple[int, list] | None:
        """Return which initial state says where in its gap the other body stands, and its values (nw,) there.

        Of each of the places, 0 to 1. The state after it is its rate. None where there is no gap, or where it
        is no state that is fitted.
        """
        name = initial_states.gap_state(self.block.core) if self.mechanism else None
        if name not in self.free_states:
            return None
        part = self.prepared(values)
        _, _, a = self._usual(part, segments, slice(None))
        return self.free_states.index(name), [
            initial_states.in_gap(part.core, self.facts, a, place) for place in places
        ]

    def continued_from(self, segments: Segments, values, start: np.ndarray) -> np.ndarray:
        """Return the initial states that let every segment go on where the one before it ends.

        Returns
        -------
        (nw, number of them) array
            NaN for segments that follow no other.
        """
        part, found = self.prepared(values), np.full_like(start, np.nan)
        follows = np.flatnonzero(segments.stop[:-1] == segments.first[1:])
        if part.core is None or not follows.size:
            return found
        some = segments.only(follows)
        times = self.record.t[np.column_stack((some.first, segments.first[follows + 1]))] - self.late(part)
        engine, runs, drives = part.engine, np.arange(len(follows)), _Inputs()
        drive = self._driving(part, some, start[follows], drives)
        result = run_many(
            grouped([(engine, runs)]), self._starts(part, some, start[follows]), times[:, 0], times[:, 1],
            times.ravel(), self._sampled(drives, part.hold), drive=drive,
            first=2 * runs, count=2, order=5, rtol=self.rtol,
            max_steps=most_steps(some.stop - some.first),
        )  # fmt: skip
        for error in result.errors.values():
            raise error
        for i, w in enumerate(follows):
            if result.status[i].ok:
                usual = self._usual(part, segments, w + 1)
                came = initial_states.corrections(
                    result.x[i, part.offset :], part.core, usual, self.facts.speed
                )
                found[w + 1] = [came.get(name, 0.0) for name in self.free_states]
        return found

    # --- preparing ------------------------------------------------------------------------------------

    def prepared(self, values) -> PreparedModel:
        """Return the model with these values (None: its own) ready to run; the latest stay so."""
        key = None if values is None else tuple(values.items())
        if key in self._prepared:
            return self._prepared[key]
        part = self._driven(values, self.input)
        require_compiled(part.engine)
        if len(self._prepared) >= _PREPARED:
            del self._prepared[next(iter(self._prepared))]
        self._prepared[key] = part
        return part

    def _driven(self, values, u, engine=None) -> PreparedModel:
        """Return the model with these values ready to run under the input `u` (n,).

        `engine`: of it, where there is one; then with its own values (None).
        """
        if self.mechanism and not self.closed:
            known = feasible(self.block, values) if values else None
            return of_block(self.block, self.record, u, self.decimation, engine, known)
        model = with_values(self.model, values)
        if self.closed:
            return of_loop(model, self.record, u, self.mechanism, engine)
        return of_system(model, self.record, u, engine)

    def _usual(self, part, segments, w) -> tuple[Any, Any, Any]:
        """Return position, speed and acceleration with which segments begin, without what sensors add.

        Noise can make of the acceleration what no force of the record does: it is held within what one does.
        """
        x, v = segments.x[w], segments.v[w]
        for ramp, later in part.output if POSITION in self.sensed.columns else ():  # else of no sensor there
            if isinstance(ramp, Ramp):
                x = x - ramp.offset - ramp.rate * (self.record.t[segments.first[w]] - later)
                v = v - ramp.rate
        usual = self.facts.force / sum(part.core.masses)
        kept, of, held = self._kept_held
        if kept is not segments or of != usual:
            held = usual * np.tanh(segments.a / usual)
            self._kept_held = segments, usual, held
        return x, v, held[w]


def free_run(
    model, record: Measurement, *, position=0.0, velocity=0.0, slack=0.5, decimation: int = 1
) -> np.ndarray:
    """Return the output of a model over a whole record, shape (n,), from a state that is known.

    Parameters
    ----------
    model : block
        Driven by the record's input.
    position, velocity : float
        Reported by the model at the first sample [m], [m/s].
    slack : float
        Share of a gap taken up there, 0 to 1.
    decimation : int
        Samples a step of the input; 1 is exact.
    """
    simulator = Simulator(model, record, decimation=decimation)
    known = {"x": position, "v": velocity, "slack": slack}
    one = np.zeros(1)
    whole = Segments(np.array([0]), np.array([len(record)]), one, one, one, one, one)
    start = np.array([[known.get(name, 0.0) for name in simulator.free_states]])
    return simulator.run(whole, None, start, rounded=True)
