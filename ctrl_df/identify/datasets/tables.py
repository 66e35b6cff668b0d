"""Tables N(A, omega): compared by the describing function, all points at once."""

from __future__ import annotations

from ..planning.sines import stepped_sines
from ..results.table_diagnosis import FrequencyDiagnosis
from ..tables.compare import comparison_of_tables, inner_block
from ..tables.fit import fit_table
from ..tables.points import points_of, table_scales
from ..tables.search import TableSearch
from ..tables.thresholds import TABLE_ITERATIONS, TABLE_STEPS
from ..tables.uncertainty import uncertainty
from .dataset import Dataset, Estimate


class TableDataset(Dataset):
    """Describing functions measured over amplitude and frequency."""

    diagnosis = FrequencyDiagnosis

    def __init__(self, records, validation=()):
        self.records, self.validation = tuple(records), tuple(validation)

    def block_of(self, model):
        """Return the block itself, or that of a loop."""
        return inner_block(model)

    def compare(self, model, mode, window):
        """Compute N of the model at the points."""
        self.check_segments(mode, window)
        return comparison_of_tables(inner_block(model), self.records)

    def fit(self, model, names, start, *, whole, mode, window, robust, budget):
        """Fit the relative errors of all points."""
        block = inner_block(model)
        begin = block.with_parameters(dict(start)) if start else block
        points = points_of(self.records)
        scales = table_scales(begin, points)
        found = fit_table(
            begin,
            points,
            names,
            scales,
            iterations=TABLE_ITERATIONS["last"],
            tolerance=TABLE_STEPS["last"],
            budget=budget,
        )
        covariance, errors, doubtful = uncertainty(found)
        table = found.block.parameters
        at_bound = tuple(
            table[k].value in (v.lower, v.upper) for k, v in zip(names, found.variables, strict=True)
        )
        return Estimate(
            found.block, errors, at_bound, doubtful, tuple(doubtful.values()), covariance,
            comparison_of_tables(found.block, self.records), found.converged, found.evaluations,
        )  # fmt: skip

    def search(self, block, free):
        """Return the search over the points."""
        return TableSearch(block, self.records, self.validation, free)

    def plan(self, diagnosis, models, names, **limits):
        """Return the sines, one after another, at which the models' N differ most."""
        return stepped_sines(diagnosis, models, names, **limits)
