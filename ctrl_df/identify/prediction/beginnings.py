"""Where segments of a record begin: the states of the model there, and what may be corrected in them."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...blocks.primitives import Delay, Lag, Ramp
from ...cached import cached_property
from . import initial_states
from .prepared import Models, PreparedModel
from .segments import Facts, Segments
from .sensed import POSITION, sensed
from .thresholds import EARLIER_INPUTS, FORGOTTEN


class Beginnings:
    """Initial states of segments of one record.

    Parameters
    ----------
    models : Models
        The block, or the loop that it runs in, made ready for the record.
    known : Facts
        Scales of the record as the block sees them.
    initial : str
        `initial_states.FREE`, `CONTINUED` or `MEASURED`.
    """

    def __init__(self, models: Models, known: Facts, initial: str):
        self.models, self.known, self.initial = models, known, initial
        self.block, self.record = models.block, models.record
        self.placed = POSITION in sensed(self.record).columns
        self._kept_held: Any = None, 0.0, None

    # --- which there are ------------------------------------------------------------------------------

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the initial states estimated beside the parameters, per segment."""
        if not self.models.mechanism:
            return ()
        fitted = initial_states.fitted_names(self.block.core, self.initial)
        return (*fitted, *self._first, *self._unsettled, *self._earlier)

    @cached_property
    def _first(self) -> tuple[str, ...]:
        """Names of those that go on from segment to segment, and are fitted where one follows no other."""
        if self.initial != initial_states.CONTINUED:
            return ()
        return initial_states.continued_names(self.block.core, self.initial)

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
        return not self.models.driven_alone or self.initial != initial_states.FREE

    @cached_property
    def continued(self) -> bool:
        """Whether some of the initial states go on from one segment into the next."""
        return self.models.mechanism and bool(initial_states.continued_names(self.block.core, self.initial))

    def hidden(self, part: PreparedModel) -> np.ndarray | None:
        """Return the projection (nx, nx) on the states that go on into the next segment, if any do."""
        if not self.continued:
            return None
        found = np.zeros((part.engine.nstates,) * 2)
        found[part.offset :, part.offset :] = initial_states.continued(part.core, self.initial)
        return found

    # --- how far off they may be ----------------------------------------------------------------------

    def priors(self, segments: Segments) -> np.ndarray:
        """Return how far each initial state may be from its estimate, (nw, number of them)."""
        if not self.names:
            return np.zeros((len(segments), 0))
        unsettled, earlier = self._unsettled, self._earlier
        states = [n for n in self.names if n not in unsettled and n not in earlier]
        reach = initial_states.reach(states, self.block.core, self.known, segments)
        since = self.record.t[segments.first] - self.record.t[0]
        # a lag forgets: deep in the record its state is known
        first = abs(float(self.record.u[0])) + self.known.force
        forgets = [np.maximum(np.exp(-since / p.time_constant), FORGOTTEN) for p in unsettled.values()]
        forgets += [np.where(self.acts(n, segments), 1.0, FORGOTTEN) for n in earlier]
        return np.column_stack((reach, *(first * left for left in forgets)))

    def acts(self, name: str, segments: Segments) -> np.ndarray:
        """Return in which segments (nw,) an initial state shows: others go on, or were before the record."""
        if name in self._first:
            return ~segments.follow
        if name not in self._earlier:
            return np.full(len(segments), True)
        return self._unseen(self.models.ready(None), segments)

    def _unseen(self, part, segments: Segments) -> np.ndarray:
        """Return whether segments begin while what came before the record still acts, (nw,) booleans."""
        return self.record.t[segments.first] - part.late < part.drive_time[1 + part.earlier]

    # --- what they come to ----------------------------------------------------------------------------

    def states(self, part: PreparedModel, segments: Segments, start) -> np.ndarray:
        """Return the states (nw, nx) in which segments begin, where no hidden ones go on.

        `start`, here and below: corrections (nw, number of names), or None.
        """
        x0 = np.zeros((len(segments), part.engine.nstates))
        if part.core is None:
            return x0
        given = {} if start is None else dict(zip(self.names, np.asarray(start).T, strict=True))
        states, usual = x0[:, part.offset :], self._usual(part, segments, slice(None))
        initial_states.fill(states, part.core, given, usual, self.known.speed)
        for state, samples in part.lags:
            off = given.get(part.core.state_names[state], 0.0)
            states[:, state] = samples[segments.first] + off
        return x0

    def inputs(self, part: PreparedModel, segments: Segments, start):
        """Return the inputs that drive segments, (time, value) each, and which of them drives which (nw,).

        They differ by what acted before the record.
        """
        found, which = [(part.drive_time, part.drive_value)], np.zeros(len(segments), int)
        if start is not None and self._earlier and part.earlier:
            off = np.asarray(start)[:, -EARLIER_INPUTS:]
            for w in np.flatnonzero(self._unseen(part, segments) & np.any(off != 0, axis=1)):
                value = part.drive_value.copy()
                value[1 : 1 + part.earlier] += off[w]
                which[w] = len(found)
                found.append((part.drive_time, value))
        return found, which

    def corrections(self, part: PreparedModel, segments: Segments, w: int, states) -> list[float]:
        """Return the corrections that let a segment begin in these states (nx,)."""
        usual = self._usual(part, segments, w)
        found = initial_states.corrections(states[part.offset :], part.core, usual, self.known.speed)
        return [found.get(name, 0.0) for name in self.names]

    def at_rest(self, segments: Segments, values) -> np.ndarray:
        """Return the corrections (nw, number of names) with which every segment begins at rest.

        Where its first sample was measured: a parabola through the neighbours is off where the body has just
        come to rest, or breaks away.
        """
        part, rows = self.models.ready(values), []
        for w, first in enumerate(segments.first):
            usual, sampled = self._usual(part, segments, w), self.known.place[first] - segments.x[w]
            given = initial_states.at_rest(part.core, usual, self.known.speed, sampled)
            rows.append([given.get(name, 0.0) for name in self.names])
        return np.array(rows)

    def in_gap(self, segments: Segments, values, places) -> tuple[int, list] | None:
        """Return which of the names says where in its gap the other body stands, and its values (nw,) there.

        Of each of the places, 0 to 1. The name after it is its rate. None where there is no gap, or where it
        is no state that is fitted.
        """
        name = initial_states.gap_state(self.block.core) if self.models.mechanism else None
        if name not in self.names:
            return None
        part = self.models.ready(values)
        _, _, a = self._usual(part, segments, slice(None))
        return self.names.index(name), [
            initial_states.in_gap(part.core, self.known, a, place) for place in places
        ]

    def _usual(self, part, segments, w) -> tuple[Any, Any, Any]:
        """Return position, speed and acceleration with which segments begin, without what sensors add.

        Noise can make of the acceleration what no force of the record does: it is held within what one does.
        """
        x, v = segments.x[w], segments.v[w]
        for ramp, later in part.output if self.placed else ():  # else of no sensor that is read
            if isinstance(ramp, Ramp):
                x = x - ramp.offset - ramp.rate * (self.record.t[segments.first[w]] - later)
                v = v - ramp.rate
        usual = self.known.force / sum(part.core.masses)
        kept, of, held = self._kept_held
        if kept is not segments or of != usual:
            held = usual * np.tanh(segments.a / usual)
            self._kept_held = segments, usual, held
        return x, v, held[w]
