"""A model driven by a recorded input: whole, or segment by segment from initial states of its own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ...blocks.primitives import Ramp
from ..data.measurement import Measurement
from ..thresholds import RTOL_FINEST
from . import initial_states
from .batch import Batch, Course, Early, joined
from .beginnings import Beginnings
from .prepared import Models, PreparedModel
from .segments import Segments, facts_of
from .sensed import POSITION, sensed
from .thresholds import FAR_LIMIT, RESTORING
from .values import for_record

Request = tuple[Segments, Mapping[str, float] | None, np.ndarray | None]
"""Segments, parameters that differ from the model's, corrections of the initial states."""


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
        rtol: float = RTOL_FINEST,
        initial: str = initial_states.FREE,
    ):
        model = for_record(model, record.name)
        self.record = record
        self.models = Models(model, record, decimation)
        self.block, self.closed, self.mechanism = (
            self.models.block, self.models.closed, self.models.mechanism,
        )  # fmt: skip
        self.facts, self.sensed = facts_of(self.block, record), sensed(record)
        self.beginnings = self._beginnings(initial)
        self._batch = Batch(record, self.sensed.columns, rtol)

    def _beginnings(self, initial: str) -> Beginnings:
        return Beginnings(self.models, self.facts, initial)

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

    @property
    def free_states(self) -> tuple[str, ...]:
        """Names of the initial states estimated beside the parameters, per segment."""
        return self.beginnings.names

    @property
    def continued(self) -> bool:
        """Whether some of the initial states go on from one segment into the next."""
        return self.beginnings.continued

    @property
    def apart(self) -> bool:
        """Whether segments have initial states of their own, which nothing else moves."""
        return not self.continued

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
        return self._run(self._ready(asked), asked, rounded)[0]

    def run_reporting(
        self, segments: Segments, start: np.ndarray | None, *, rounded: bool = False
    ) -> tuple[np.ndarray, list[Early]]:
        """Do what `run` does with the model's own values, and tell which runs did not reach their end."""
        asked: list[Request] = [(segments, None, start)]
        (y,), early = self._run(self._ready(asked), asked, rounded)
        return y, early

    def run_driven(self, segments: Segments, start: np.ndarray | None, inputs) -> list[np.ndarray]:
        """Do what `run` does under each of several inputs (n,) in place of the recorded one, in one call.

        Returns
        -------
        list of (n,) arrays
            One for each input.
        """
        engine = self.models.ready(None).engine
        parts = [self.models.driven(None, u, engine) for u in inputs]
        return self._run(parts, [(segments, None, start)] * len(parts), False)[0]

    def _ready(self, asked: Sequence[Request]) -> list[PreparedModel]:
        return [self.models.ready(values) for _, values, _ in asked]

    def _run(
        self, parts: Sequence[PreparedModel], asked: Sequence[Request], rounded: bool
    ) -> tuple[list[np.ndarray], list[Early]]:
        """Run models made ready over what is asked for, with the values that they have."""
        courses = [self._course(part, w, start) for part, (w, _, start) in zip(parts, asked, strict=True)]
        outputs, early = self._batch.outputs(courses)
        read = zip(courses, outputs, strict=True)
        return [self._read(c.part, c.segments, out, rounded) for c, out in read], early

    def _course(self, part: PreparedModel, segments: Segments, start) -> Course:
        begin = self.beginnings
        inputs, drive = begin.inputs(part, segments, start)
        return Course(part, segments, begin.states(part, segments, start), inputs, drive, begin.hidden(part))

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
        return joined(read)

    # --- where segments begin -------------------------------------------------------------------------

    def continued_from(self, segments: Segments, values, start: np.ndarray) -> np.ndarray:
        """Return the initial states that let every segment go on where the one before it ends.

        Returns
        -------
        (nw, number of them) array
            NaN for segments that follow no other.
        """
        part, found = self.models.ready(values), np.full_like(start, np.nan)
        follows = np.flatnonzero(segments.stop[:-1] == segments.first[1:])
        if part.core is None or not follows.size:
            return found
        some = self._course(part, segments.only(follows), start[follows])
        ends, reached = self._batch.ends(some, segments.first[follows + 1])
        for w, state in zip(follows[reached] + 1, ends[reached], strict=True):
            found[w] = self.beginnings.corrections(part, segments, w, state)
        return found


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
