"""Records over time: compared by simulation of the model, in segments with initial states of their own."""

from __future__ import annotations

import warnings
from copy import copy
from types import MappingProxyType

from ..arguments import check_segment_length
from ..estimation.lengths import segment_lengths
from ..estimation.refit_records import doubts, refit_records, undetermined
from ..estimation.thresholds import BEGINNINGS_KEPT, UNCOUNTED
from ..planning.inputs import input_that_separates
from ..prediction.loop_force import driven_by_force, warn_of_references
from ..prediction.prepared import recorded_reference
from ..prediction.segments import make_segments
from ..prediction.sensed import sensed
from ..prediction.simulators import simulator_of
from ..prediction.values import block_of, for_record, warn_of_means, with_own
from ..results.comparison import Comparison, RecordComparison
from ..selection.structure_search import StructureSearch
from ..shooting.known_fits import KnownFits
from ..shooting.least_squares import Stage
from ..shooting.problem import Problem, Settings
from ..shooting.states import find_states
from .dataset import Dataset, Estimate


class TimeDataset(Dataset):
    """Records of the input and the output over time."""

    def __init__(self, records, validation=()):
        self.records, self.validation = tuple(records), tuple(validation)
        self.known = KnownFits()

    def with_prior(self, prior):
        """Return the same data, of a machine of which that is known."""
        other = copy(self)
        other.prior = prior
        return other

    def begun_with(self, model):
        """Return the same data, of a machine whose parameters are about those of the model."""
        stated = {k: (p.value, None) for k, p in model.parameters.items()}
        return self.with_prior({**stated, **self.prior})

    def driven_by_force(self, model):
        """Return the same data, a reference replaced by the force that the controller of the loop makes."""
        other = copy(self)
        other.records, other.validation = (
            tuple(driven_by_force(model, r) for r in records) for records in (self.records, self.validation)
        )
        return other

    def check_segments(self, mode, window):
        """Check the mode, and a length of segment that holds samples enough."""
        check_segment_length(self.records, mode, window)

    def block_of(self, model):
        """Return the block itself, or that of a loop."""
        return block_of(model)

    def warn_of_doubts(self, model, moved=()):
        """Warn of records that the model has no values of, and of inputs that a loop hardly follows."""
        warn_of_means(model, self.records, moved)
        warn_of_references(model, self.records)

    def with_own(self, model, names):
        """Return the model marked so; of one record alone it is as it was."""
        return with_own(model, names) if len(self.records) + len(self.validation) > 1 else model

    def compare(self, model, mode, window):
        """Simulate the model over segments of the records, their initial states fitted."""
        self.check_segments(mode, window)
        mode = "windows" if mode == "auto" and window is not None else mode
        lengths = segment_lengths(model, self.records, mode, window)
        problem = Problem(model, self.records, (), UNCOUNTED, Settings(followed=BEGINNINGS_KEPT))
        segments = [make_segments(r, n) for r, n in zip(self.records, lengths, strict=True)]
        return self._comparison(model, segments, find_states(Stage(problem, segments, 1)))

    def _comparison(self, model, segments, starts, fitted: int = 0) -> Comparison:
        """Return the comparison of a model whose initial states in each segment are known already."""
        rows = []
        for record, w, start in zip(self.records, segments, starts, strict=True):
            simulator = simulator_of(model, record)
            run, early = simulator.run_reporting(w, start, rounded=True)
            _warn_of_early(simulator, early, len(w))
            simulated = sensed(record).apart(run)
            beside = simulated[record.output]
            rows.append(
                RecordComparison(
                    record,
                    beside,
                    record.y - beside,
                    w.edges,
                    fitted,
                    for_record(model, record.name),
                    MappingProxyType(simulated),
                )  # fmt: skip
            )
        return Comparison(model, tuple(rows))

    def fit(self, model, names, start, *, whole, mode, window, robust, budget):
        """Fit by multiple shooting; a loop by its block where the recorded force can drive that."""
        if getattr(model, "parts", None) is not None and self._tells_references():
            model = model.parts.block
        found, seen = refit_records(
            model, self.records, names, start, whole=whole, mode=mode, window=window, robust=robust,
            budget=budget, prior=self.prior,
        )  # fmt: skip
        comparison = self._comparison(found.model, seen.segments, seen.starts, fitted=len(names))
        return Estimate(
            self.block_of(found.model), found.standard_errors, found.at_bound, undetermined(found),
            doubts(found), found.whole_covariance, comparison, found.converged, found.nfev, found.own,
        )  # fmt: skip

    def _tells_references(self) -> bool:
        return all(recorded_reference(r) is not None for r in self.records)

    def search(self, block, free):
        """Return the search over segments of the records."""
        return StructureSearch(block, self.records, self.validation, free, self.prior, self.known)

    def plan(self, diagnosis, models, names, **limits):
        """Return the input, of a few shapes and sizes, whose outputs differ most."""
        return input_that_separates(diagnosis, models, names, **limits)


def _warn_of_early(simulator, early, segments: int) -> None:
    """Warn where runs of a model on a record did not reach their end."""
    if not early:
        return
    time, status = min(early, key=lambda end: end[0])
    where = f" (as do {len(early)} of {segments} segments)" if segments > 1 else ""
    warnings.warn(
        f"the simulation of {simulator.block.name} on {simulator.record.name} ends early, at t = {time:.6g} s"
        f"{where}: {status}. From there on its output is set far outside the record, and the errors given "
        "say nothing of the model. See what it does there with event_response on the same input, and change "
        "its parameters.",
        RuntimeWarning,
        stacklevel=6,
    )
