"""What a fit asks: records, the parameters that move, what is known of them before any data."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ...values.per_record import PerRecord
from ..prediction.initial_states import FREE
from ..prediction.segments import facts_of
from ..prediction.simulator import Simulator
from ..prediction.simulators import simulator_of, tolerance
from ..prediction.values import block_of, feasible, for_record, in_record, is_own, with_values
from .noise_model import NoiseModel
from .thresholds import NUDGE_FIRST
from .variables import Prior, beforehand, variables_of


@dataclass(frozen=True)
class Settings:
    """How a fit is made, whatever its records and parameters; compared by value, as what is asked of it is.

    Attributes
    ----------
    limits : mapping or None
        Least and largest values of some parameters, within their ranges.
    about : mapping or None
        What is known of some of them beforehand.
    error_filter : NoiseModel or None
        The `acceleration_filter` whose squares are made least, where disturbance forces make the error.
    initial : str
        Initial states of segments: `initial_states.FREE`, `CONTINUED` or `MEASURED`.
    give_up : float
        Error (rms) above which the fit is of no use: it ends where it would stay there at the pace of its
        last steps.
    steps_left : int
        Iterations that are to follow in other fits.
    followed : int
        Tries of where a segment begins that are followed to their end; with none the best is taken where it
        errs far less as it is.
    restarts : bool
        Whether segments that err far more than others are begun elsewhere.
    """

    limits: Mapping[str, tuple[float, float]] | None = None
    about: Mapping[str, Prior] | None = None
    error_filter: NoiseModel | None = None
    initial: str = FREE
    give_up: float = math.inf
    steps_left: int = 0
    followed: int = 0
    restarts: bool = True


USUAL = Settings()


class Problem:
    """Records and free parameters of one fit, whatever segments it goes over (`least_squares.Stage`).

    A parameter is one variable, which all records share, or (`is_own`) as many as there are records, one for
    each: `of_record[k]` tells which variables, (names,), the parameters are in record k, `first` which is the
    first of each. Models carry values by record as `PerRecord`.

    `nfev` counts simulations of all records, up to `budget`. `given_up` is no longer empty once the limit of
    the error has ended something, in it or in a problem made of it.
    """

    def __init__(
        self, model, records, names, budget, settings: Settings = USUAL, whole: Problem | None = None
    ):
        self.model, self.records, self.names, self.budget = model, list(records), tuple(names), budget
        self.settings = settings
        self.block = block_of(model)
        self.blocks = [for_record(self.block, r.name) for r in self.records]
        self.raised = [
            _raised_in(b, self.block, r.name) for b, r in zip(self.blocks, self.records, strict=True)
        ]
        self.known = [facts_of(self.block, r) for r in records]
        self.own = frozenset(k for k in names if len(self.records) > 1 and is_own(self.block.parameters[k]))
        self.variables = variables_of(
            self.block, names, self.records, self.known[0], settings.limits, self.own
        )
        copies = [len(self.records) if k in self.own else 1 for k in names]
        self.first = np.cumsum([0, *copies])[:-1]
        apart = np.array([k in self.own for k in names], bool)
        self.of_record: list[np.ndarray] = [self.first + k * apart for k in range(len(self.records))]
        self.about, self.precision, self.stated = beforehand(self.variables, settings.about or {})
        self.steps = np.full(len(self.variables), NUDGE_FIRST)
        self.nfev = 0.0
        self.given_up: list[bool] = [] if whole is None else whole.given_up
        self._simulators: dict[int, list[Simulator]] = {}
        self.noise = math.sqrt(float(np.mean([k.noise**2 for k in self.known])))

    def start(self) -> np.ndarray:
        """Return the scaled parameters of the model as it is."""
        return np.array([v.clip(v.q(v.begin)) for v in self.variables])

    def simulators(self, decimation: int) -> list[Simulator]:
        """Return the model on every record, ready to be run; kept for all stages of the fit."""
        kept = self._simulators.get(decimation)
        if kept is None:
            initial, accelerations = self.settings.initial, self.settings.error_filter is not None
            kept = self._simulators[decimation] = [
                simulator_of(
                    self.model, r, decimation=decimation, initial=initial, rtol=tolerance(r, accelerations)
                )
                for r in self.records
            ]
        return kept

    def finish(self) -> None:
        """Let the simulators go: what is kept of a fit needs none."""
        self._simulators.clear()

    def values(self, theta, k):
        """Return the parameters in record `k` by name, static levels kept above the kinetic one."""
        given = {self.variables[i].name: self.variables[i].p(theta[i]) for i in self.of_record[k]}
        return feasible(self.blocks[k], self.raised[k] | given) if given else None

    def named(self, theta, weights=None) -> dict[str, float]:
        """Return the parameters by name, those that differ from record to record for each of them.

        A shared static level stays what it is where it lies below the kinetic one of some record: there
        `for_record` raises it. Below that of a record not known it cannot stay, and is one of each record.

        `weights`: of all variables, in means over the records; None: all count the same.
        """
        tables = [self.values(theta, k) or {} for k in range(len(self.records))]
        found: dict[str, float] = {}
        split: dict[str, PerRecord] = {}
        for name in dict.fromkeys(name for table in tables for name in table):
            known = [b.parameters[name].value for b in self.blocks]
            each = [float(t[name] if name in t else v) for t, v in zip(tables, known, strict=True)]
            if name not in self.own and min(each) == max(each):
                found[name] = each[0]
                continue
            by_record = {r.name: value for r, value in zip(self.records, each, strict=True)}
            angle, counts = self.block.parameters[name].per_record, None
            if name in self.own and weights is not None:
                first = self.first[self.names.index(name)]
                counts = list(weights[first : first + len(self.records)])
            value = PerRecord.over(by_record, angle, counts)
            if name in self.own:
                found[name] = value
                continue
            split[name] = value
            found[name] = self.block.parameters[name].value
            if name in self.names:
                i = self.first[self.names.index(name)]
                found[name] = self.variables[i].p(theta[i])
        usual = feasible(self.block, found) if split else found
        return found | {k: v for k, v in split.items() if usual[k] != found[k]}

    def model_at(self, theta):
        """Return the model with these parameters."""
        return with_values(self.model, self.named(theta))

    def in_columns(self, k, slopes) -> np.ndarray:
        """Return derivatives (n, names) of the output in record `k` as those by all variables, (n, p)."""
        every = np.zeros((len(self.variables), len(slopes)))
        every[self.of_record[k]] = slopes.T
        return every.T

    def alone(self, theta, which=slice(None)) -> Problem:
        """Return the problem of the initial states alone, for some of the records."""
        return Problem(self.model_at(theta), self.records[which], (), self.budget, self.settings, self)

    def gives_up(self, square: float) -> bool:
        """Whether an error of this mean square is of no use."""
        if useless := square > self.settings.give_up**2:
            self.given_up[:] = [True]
        return useless

    def count(self, runs: float):
        """Count simulations of all records."""
        self.nfev += runs

    def count_beside(self, runs: float):
        """Count simulations that seek initial states: bounded by themselves, outside the descent's budget."""
        self.nfev += runs
        self.budget += runs

    @property
    def spent(self) -> bool:
        """Whether the budget is used up."""
        return self.nfev >= self.budget

    @property
    def nonsmooth(self) -> bool:
        """Whether events of the model come and go as its parameters move."""
        events = getattr(self.block, "nonsmooth", False)
        return bool(self.names) and self.settings.error_filter is None and events

    @property
    def unit(self) -> float:
        """Unit of what the cost sees: accelerations make second differences of their step squared."""
        if self.settings.error_filter is None:
            return 1.0
        return (self.settings.error_filter.step * self.known[0].dt) ** self.settings.error_filter.order


def _raised_in(own, block, record) -> dict[str, float]:
    """Return the static levels, as a block has them, that are raised in that of a record."""
    if own is block:
        return {}
    statics = {k: in_record(p.value, record) for k, p in block.parameters.items() if p.threshold}
    return {k: v for k, v in statics.items() if own.parameters[k].value != v}
