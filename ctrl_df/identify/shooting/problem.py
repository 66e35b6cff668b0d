"""What a fit asks: records, the parameters that move, what is known of them before any data."""

from __future__ import annotations

import math

import numpy as np

from ..prediction.initial_states import FREE
from ..prediction.segments import facts_of
from ..prediction.simulator import feasible
from ..prediction.simulators import simulator_of
from .thresholds import NUDGE_FIRST
from .variables import beforehand, variables_of


class Problem:
    """Records and free parameters of one fit, whatever segments it goes over (`multiple_shooting.Stage`).

    `followed`: tries of where a segment begins that are followed to their end; with none the best is taken
    where it errs far less as it is. `nfev` counts simulations of all records, up to `budget`.
    """

    def __init__(
        self,
        model,
        records,
        names,
        budget,
        limits=None,
        error_filter=None,
        begins=FREE,
        hopeless=(math.inf, 0),
        about=None,
        followed=0,
    ):
        self.model, self.records, self.names, self.budget = model, list(records), tuple(names), budget
        self.error_filter, self.begins = error_filter, begins
        self.hopeless, self.outlook = hopeless
        self.followed = followed
        self.first = simulator_of(model, records[0])
        self.block = self.first.block
        self.known = [facts_of(self.block, r) for r in records]
        self.variables = variables_of(self.block, names, self.records, self.known[0], limits)
        self.about, self.precision = beforehand(self.variables, about or {})
        self.steps = np.full(len(names), NUDGE_FIRST)
        self.nfev = 0.0
        self.noise = math.sqrt(float(np.mean([k.noise**2 for k in self.known])))

    def start(self) -> np.ndarray:
        """Return the scaled parameters of the model as it is."""
        return np.array([v.clip(v.q(self.block.parameters[v.name].value)) for v in self.variables])

    def values(self, theta):
        """Return the parameters by name, static levels kept above the kinetic one."""
        given = {v.name: v.p(q) for v, q in zip(self.variables, theta, strict=True)}
        return feasible(self.block, given) if given else None

    def alone(self, theta, which=slice(None)) -> Problem:
        """Return the problem of the initial states alone, for some of the records."""
        model = self.first.with_values(self.values(theta) or {})
        hopeless, records = (self.hopeless, self.outlook), self.records[which]
        return Problem(
            model, records, (), self.budget, None, self.error_filter, self.begins, hopeless,
            followed=self.followed,
        )  # fmt: skip

    def count(self, runs):
        """Count simulations that seek initial states: bounded by themselves, outside the descent's budget."""
        self.nfev += runs
        self.budget += runs

    @property
    def nonsmooth(self) -> bool:
        """Whether events of the model come and go as its parameters move."""
        events = getattr(self.block, "nonsmooth", False)
        return bool(self.names) and self.error_filter is None and events

    @property
    def unit(self) -> float:
        """Unit of what the cost sees: accelerations make second differences of their step squared."""
        if self.error_filter is None:
            return 1.0
        return (self.error_filter.step * self.known[0].dt) ** self.error_filter.order
