"""A model under a recorded motion, compared by the force that it answers with."""

from __future__ import annotations

import numpy as np

from ...blocks.core import Core
from ...simulate.imposed import imposed_forces
from ...simulate.imposed_response import imposable
from ..data.imposed import imposed_motion
from . import initial_states
from .beginnings import Beginnings
from .segments import Segments
from .simulator import Simulator
from .thresholds import FAR_OUT, HIDDEN_RTOL
from .values import feasible


class ImposedSimulator(Simulator):
    """One model on one record of an imposed motion; the interface of `Simulator`.

    The force is a function of the motion and of what effects hide. The latter goes on over the whole record,
    whatever its segments: its only initial states are those at the record's begin, the corrections that the
    first segment has. Where noise hides which way it moves, dry friction takes the value, between its two
    levels, that comes nearest to the force recorded.
    """

    def __init__(self, model, record, **keywords):
        super().__init__(model, record, **keywords)
        imposable(self.block)
        self.motion = imposed_motion(record)

    @property
    def position_dependent(self) -> bool:
        """Whether the place matters: outputs are never shifted as positions are."""
        return True

    @property
    def restoring(self) -> bool:
        """Whether a free run does not drift: no force does."""
        return True

    @property
    def apart(self) -> bool:
        """Whether segments have initial states of their own: they share those of the record."""
        return False

    def _beginnings(self, initial: str) -> Beginnings:
        return _OfRecord(self.models, self.facts, initial)

    def run_all(self, asked, *, rounded: bool = False) -> list[np.ndarray]:
        """Return the forces of several (segments, values, start), all in one call."""
        forces = self._forces(asked)
        return [self._within(f, w) for f, (w, _, _) in zip(forces, asked, strict=True)]

    def run_reporting(self, segments, start, *, rounded: bool = False):
        """Do what `run` does; the motion is given, and all of it is run."""
        return self.run(segments, None, start, rounded=rounded), []

    def run_driven(self, segments, start, inputs) -> list[np.ndarray]:
        """Return the forces where others (n,) act in place of the recorded load: by so much more."""
        (force,) = self._forces([(segments, None, start)])
        return [self._within(force + (u - self.facts.load), segments) for u in inputs]

    def _forces(self, asked) -> np.ndarray:
        """Return the forces of several (segments, values, start) at all samples of the record."""
        cores = [self._core(values) for _, values, _ in asked]
        z0 = np.array([self._begin(c, w, s) for c, (w, _, s) in zip(cores, asked, strict=True)])
        forces, back, _ = imposed_forces(cores, self.motion.path, z0, rtol=HIDDEN_RTOL)
        at = self.motion.path.open
        # at rest dry friction may be anything between its two levels: no error within
        between = np.sort([forces[:, at], back], axis=0)
        forces[:, at] = np.clip(self.record.y[at], *between)
        return forces

    def _within(self, force, segments: Segments) -> np.ndarray:
        """Return a force (n,) at the samples of segments; what ran away is set aside."""
        away = float(np.mean(self.record.y)) + FAR_OUT * self.facts.spread
        return np.where(np.isfinite(force), force, away)[segments.samples]

    def _core(self, values) -> Core:
        if not values:
            return self.block.core
        known = feasible(self.block, values)
        return self.block.core_at(known, self.block.effects_at(known).values())

    def _begin(self, core, segments: Segments, start) -> np.ndarray:
        """Return the hidden states at the record's first sample."""
        m, states = self.motion, np.zeros((1, core.nstates))
        given = {} if start is None else dict(zip(self.free_states, np.asarray(start)[0], strict=True))
        usual = tuple(np.array([signal[0]]) for signal in (m.x, m.v, m.a))
        initial_states.fill(states, core, given, usual, self.facts.speed)
        return states[0, 2:]

    def continued_from(self, segments, values, start):
        """Return that no segment needs the state in which the one before it ended."""
        return np.full_like(start, np.nan)


class _OfRecord(Beginnings):
    """Hidden states at the begin of a record: the first segment has them for all."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the hidden states."""
        named = initial_states.fitted_names(self.block.core, initial_states.FREE)
        return tuple(n for n in named if n not in initial_states.SEEN)

    @property
    def continued(self) -> bool:
        """Whether initial states of segments have to be continued: they are, always, within a run."""
        return False

    def acts(self, name, segments):
        """Return that every initial state shows in all segments."""
        return np.full(len(segments), True)

    def at_rest(self, segments, values):
        """Return the usual initial states: nothing is known of rest."""
        return np.zeros((len(segments), len(self.names)))
