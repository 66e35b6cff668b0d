"""What every kind of data answers: comparison, refit, diagnosis, ladder and plans are written once."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np

from ...checks import shown
from ..arguments import check_mode, free_parameters
from ..estimation.own_values import OwnValue
from ..residuals.comparison_base import ComparisonBase
from ..results.diagnosis import Diagnosis
from ..results.experiment import Experiment
from ..selection.search import Search


@dataclass(frozen=True, eq=False)
class Estimate:
    """Parameters of a block fitted to data.

    Attributes
    ----------
    block : Mechanism
        With the values found.
    errors : dict
        Standard errors by name.
    at_bound : tuple of bool
        Whether each parameter stands at a bound of its range.
    undetermined : collection of str
        Parameters that the data do not determine.
    doubts : tuple of str
        Sentences about these.
    covariance : (p, p) array
    comparison : ComparisonBase
        The fitted model beside the data.
    converged : bool
    simulations : int
    own : mapping of str to mapping of str to OwnValue
        Of the parameters that every record has for itself: by name, then by record. What stands above is of
        their mean.
    """

    block: Any
    errors: dict[str, float]
    at_bound: tuple[bool, ...]
    undetermined: Any
    doubts: tuple[str, ...]
    covariance: np.ndarray
    comparison: Any
    converged: bool
    simulations: int
    own: Mapping[str, Mapping[str, OwnValue]] = field(default_factory=dict)


class Dataset(ABC):
    """Data that a model can be fitted to, and others that it is validated on.

    Attributes
    ----------
    diagnosis : type
        What a diagnosis of such data is.
    records, validation : tuples
        To fit; to validate on (may be empty: a part of `records` is then held out).
    prior : mapping of str to (float, float)
        Value and standard deviation of parameters known beforehand.
    """

    diagnosis: type[Diagnosis] = Diagnosis
    records: tuple
    validation: tuple
    prior: Mapping[str, tuple[float, float | None]] = MappingProxyType({})

    def free_parameters(self, block, free=None) -> tuple[str, ...]:
        """Return the parameters that a fit to these data moves (see `arguments.free_parameters`)."""
        return free_parameters(block, free)

    def estimated_parameters(self, block, kept: Collection[str]) -> list[str]:
        """Return the parameters of a model with effects added that a fit moves, but those `kept`."""
        added = {k for k, p in block.parameters.items() if p.estimated and not p.free}
        names = added.union(self.free_parameters(block)).difference(kept)
        return [k for k in block.parameters if k in names]

    def check_segments(self, mode, window) -> None:
        """Check how records are divided into segments; tables are not."""
        check_mode(mode)
        if mode == "windows" or window is not None:
            raise ValueError(
                f"segments need records over time; got tables N(A, omega), mode={mode!r} and "
                f"window={shown(window)}. Leave both out."
            )

    def driven_by_force(self, model):
        """Return the same data, the force on the block of a loop as input; tables have no reference."""
        return self

    @abstractmethod
    def block_of(self, model):
        """Return the block whose parameters a fit to these data moves."""

    @abstractmethod
    def compare(self, model, mode: str, window: float | None) -> ComparisonBase:
        """Set a model beside the records."""

    @abstractmethod
    def fit(self, model, names, start, *, whole, mode, window, robust, budget) -> Estimate:
        """Adjust the named parameters; `whole`: everything that can be found besides, too."""

    @abstractmethod
    def search(self, block, free) -> Search:
        """Return the search for an effect that the block misses, its parameters `free` being refitted."""

    @abstractmethod
    def plan(self, diagnosis, models: Sequence, names, **limits) -> Experiment:
        """Return the input that separates the models best."""

    def with_prior(self, prior):
        """Return the same data, of a machine of which that is known; tables take no such knowledge."""
        if prior:
            raise ValueError(
                f"prior needs records over time; got tables N(A, omega), and prior of {', '.join(prior)}. "
                "Hold these parameters instead: leave them out of free."
            )
        return self

    def begun_with(self, model):
        """Return the same data, of a machine that its user has stated so, whatever a ladder makes of it."""
        return self

    def warn_of_doubts(self, model, moved=()) -> None:
        """Warn of what may not be meant by model and data; of tables nothing is known.

        `moved`: parameters that are about to be fitted to these.
        """
        return None

    def with_own(self, model, names):
        """Return a model of which every record has these parameters for itself; tables share all of them."""
        if names:
            raise ValueError(
                f"own needs records over time; got tables N(A, omega), and own={shown(list(names))}. Leave "
                "own out, or refit the tables one after the other."
            )
        return model
