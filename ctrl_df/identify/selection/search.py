"""The interface between the search for a missing effect and data of any kind."""

from __future__ import annotations

import copy
import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol, Self

from ..monitor import Monitor
from ..results.diagnosis import Diagnosis
from ..thresholds import ONLY_NOISE


class Candidate(Protocol):
    """A model fitted to data, with the evidence for its newest effect over the baseline."""

    key: str
    extra: int
    evidence: float
    evidence_fitted: float
    evidence_validation: float
    confirmed: bool

    @property
    def block(self) -> Any:
        """The fitted model."""
        ...


@dataclass(frozen=True)
class Remainder:
    """What the best model leaves.

    Attributes
    ----------
    noise, structure : float
        rms of noise, and of what is no noise.
    unexplained : bool
        Whether that is too much for the best candidate to be the answer.
    about : object
        What the data know besides, for `Search.located`.
    doubt : str
        What else speaks against the verdict, in a sentence.
    more : bool
        Whether more is missing beside the best candidate: what it leaves is too much for noise.
    held_out_only : bool
        Whether the data fitted are followed to their noise, and those held out are not.
    uncertain : bool
        Whether those held out are followed as far as the parameters are known, and not to their noise.
    """

    noise: float
    structure: float
    unexplained: bool
    about: Any = None
    doubt: str = ""
    more: bool = False
    held_out_only: bool = False
    uncertain: bool = False

    def doubted(self, doubt: str, **changes) -> Self:
        """Return the same with another doubt, one that the data fitted raise, and further changes."""
        return replace(self, doubt=doubt, held_out_only=False, **changes)


@dataclass(frozen=True)
class Located:
    """Where the error is: ranked regions, their kinds, and what remains unexplained in sentences."""

    where: Any
    kinds: tuple[str, ...]
    remains: str = ""
    note: str = ""


@dataclass(frozen=True)
class Words:
    """The words of a verdict on these data."""

    data: str
    noise: str
    of: str
    separates: str
    shows: str


class TooFewData(ValueError):
    """Raised where data are too few for a search with the parameters that a model has."""


class Search(ABC):
    """The fits of one diagnosis so far: a value, of which `candidates` and `confirm` return the next one.

    Attributes
    ----------
    block : Mechanism
        The model as it stands.
    base : Candidate
        The model refitted.
    free : tuple of str
        Parameters of the model that are refitted.
    significant, significant_validation : float
        Evidence [nats] an effect needs on the data fitted, and on those held out alone.
    measure : str
        What errors are of: ``output``, ``acceleration`` or ``N``.
    words : Words
    kind : type
        Class of the answer.
    screened : sequence of Candidate
        The candidates as screened, before any was confirmed.
    """

    block: Any
    free: tuple[str, ...]
    significant: float
    significant_validation: float
    measure: str
    words: Words
    kind: type[Diagnosis] = Diagnosis
    screened: Sequence[Candidate] = ()

    def after(self, **found) -> Self:
        """Return the search as it stands after this was found; it itself stays what it is."""
        if unknown := [name for name in found if not hasattr(self, name)]:
            raise AttributeError(f"a search finds no {', '.join(unknown)}")
        other = copy.copy(self)
        vars(other).update(found)
        return other

    def following(self, before: Self) -> Self:
        """Return this search as one after another over the same data: where that has ended it begins.

        Only the order of work depends on it.
        """
        return self

    @property
    @abstractmethod
    def base(self) -> Any:
        """The model refitted."""

    @property
    @abstractmethod
    def records(self) -> tuple[tuple, tuple]:
        """The data to fit, and those held out."""

    @abstractmethod
    def candidates(self, classes, executor=None, monitor: Monitor | None = None) -> tuple[Self, list[Any]]:
        """Return the search that knows them, and every effect fitted that can be added, best evidence first.

        Parameters
        ----------
        classes : sequence of effect classes
        executor : concurrent.futures.Executor or None
        monitor : Monitor or None
            Receives the intermediate results.
        """

    def lengths(self) -> list[Self]:
        """Return this search over all lengths of segments over which several effects are sought at once."""
        return [self]

    def pairs(self, classes) -> list[Any]:
        """Return models with two effects more, and the share of the residual's power that each should leave.

        Tuples of a block and that share, the most promising first; none where linear estimates tell nothing.
        """
        return []

    def singles(self, candidate, classes) -> list[Any]:
        """Return the same with one effect more than a model fitted here, which promises to be significant."""
        return []

    @abstractmethod
    def based_on(self, block, fitted, free) -> Self:
        """Return a search over the same data for what another model misses.

        Parameters
        ----------
        block : Mechanism
            That model, with the values that it has otherwise.
        fitted : Candidate
            The same as `fitted` returns it.
        free : sequence of str
            Its parameters that are refitted.
        """

    def rivals(self, model, names, classes, executor=None) -> list[Any]:
        """Return effects that may replace the last one of a model, with evidence over it, best first.

        They start from its values; fits that come nowhere near it need not be completed.

        Parameters
        ----------
        model : Mechanism
        names : sequence of str
            Its parameters that are fitted.
        classes : sequence of effect classes
        executor : concurrent.futures.Executor or None
        """
        search, found = self.candidates(classes, executor)
        known, more = search.fitted(model, names, 2), len(names) - len(self.free)
        return search.ranked(known, [replace(t, extra=t.extra - more) for t in found])

    @abstractmethod
    def confirm(
        self, found, monitor: Monitor | None = None, clear: float = math.inf
    ) -> tuple[Self, list[Any]]:
        """Refit baseline and best candidates carefully; return the search that knows them, and these.

        `found`, what is returned: candidates, best first; `monitor`: see `candidates`; `clear`: evidence by
        which the first has to be ahead of the model and of all others for its parameters not to matter.
        """

    @abstractmethod
    def errors(self, candidate) -> tuple[float, float]:
        """Return the relative errors of a model on the data fitted, and on those held out."""

    @abstractmethod
    def standard_errors(self, candidate) -> dict[str, float]:
        """Return the standard errors of the parameters fitted, as far as they are known."""

    def takes_only_noise(self, candidate) -> bool:
        """Whether all that a candidate takes of the error may be noise that its initial states absorb."""
        return True

    def undetermined(self, candidate) -> tuple[str, ...]:
        """Return the parameters of the newest effect of a confirmed candidate that data do not determine."""
        return ()

    def displaced(self, candidate) -> tuple[str, ...]:
        """Return the model's parameters at a bound with the newest effect that are within without it."""
        return ()

    def open_directions(self, candidate) -> tuple[str, ...]:
        """Return a sentence for every direction of a fit's parameters that leaves its output as it is."""
        return ()

    def record_faults(self) -> tuple[str, ...]:
        """Return a sentence for every fault of the records that would explain what no effect does."""
        return ()

    def predicted(self, candidate) -> tuple[Any, tuple] | None:
        """Return a model and the records that it is to predict; None where there is nothing to predict."""
        return None

    def so_far(self, candidate) -> Remainder:
        """Return what a model leaves, as far as that is known without further fits."""
        return Remainder(0.0, 0.0, False)

    def errs_as_sensor(self, candidate) -> bool:
        """Whether a model errs by the noise of the sensor alone."""
        left = self.so_far(candidate)
        return math.hypot(left.noise, left.structure) <= ONLY_NOISE * left.noise

    def leaves_only_noise(self, candidate) -> bool:
        """Whether a model fitted here leaves only noise: that of the sensor, or slow noise."""
        return self.errs_as_sensor(candidate)

    @abstractmethod
    def equivalent(self, a, b) -> bool:
        """Whether two confirmed candidates are equivalent on these data, within noise."""

    def alike(self, a, b) -> bool:
        """Whether two models, fitted and validated here, have the same output on these data, within noise."""
        return self.equivalent(a, b)

    def acting_as(self, effect, other):
        """Return an effect with the values with which it acts as another one along the motion; or None."""
        return None

    def divided_otherwise(self) -> Self | None:
        """Return the same search with other parts of the data held out; None: they are not parts."""
        return None

    def in_full(self):
        """Return the model without an effect as a whole refit has it; None: no better than it is."""
        return None

    @abstractmethod
    def remainder(self, best, significant: bool) -> Remainder:
        """Return what the best model leaves."""

    @abstractmethod
    def located(self, best, remainder: Remainder, unknown: bool) -> Located:
        """Return where the error is: of the model, or (`unknown`) of what is left."""

    def as_recorded(self, candidate) -> str:
        """Return what a candidate adds, where the records show it as noise without any model."""
        return ""

    def exact(self) -> bool:
        """Whether the model errs by rounding alone."""
        return False

    def answer(self, best) -> dict[str, Any]:
        """Return further fields of the answer."""
        return {}

    @abstractmethod
    def fitted(self, block, names, iterations: int, near=None) -> Any:
        """Return a block with these parameters fitted, and validated on the data held out.

        `near`: a model fitted here that others are compared with. Where data held out err by more than
        `GIVE_UP` times as much with a model, its initial states there are not sought to the last.
        """

    def begun(self, block, names, iterations: int) -> Any:
        """Return the same with less care, to be compared over the data fitted alone: one of many."""
        return self.fitted(block, names, iterations)

    @abstractmethod
    def ranked(self, base, candidates: Sequence) -> list[Any]:
        """Return models with their evidence over `base`, best first."""

    def ranked_over(self, base, candidates: Sequence) -> list[Any]:
        """Return models with their evidence over one that was fitted as they were, best first."""
        return self.ranked(base, [replace(t, extra=t.extra - base.extra) for t in candidates])

    def sharpened(self, model, free):
        """Return a model with the parameters that a ladder reports; they are compared as they are.

        `free`: parameters of a model that may be refitted.
        """
        return model

    def final(self, models: Sequence, free) -> list[tuple[Any, float, float]] | None:
        """Return the models of a ladder with their two errors, all over the same data; None: as they are.

        `free`: parameters of a model that may be refitted.
        """
        return None

    def relative(self, noise: float) -> float:
        """Return noise as a share of what errors are relative to."""
        return noise
