"""Records of an imposed motion and the force that it took: compared in force."""

from __future__ import annotations

from ...blocks.coordinates import moving_in
from ..data.imposed import imposes_motion, without_ends
from ..planning.motions import motion_that_separates
from ..selection.kinematic_searches import ImposedSearch
from .over_time import TimeDataset


class ImposedDataset(TimeDataset):
    """Records with motion as input and force as output, but for their ends, which low-passes do not know."""

    def __init__(self, records, validation=()):
        for record in (*records, *validation):
            if not imposes_motion(record):
                force = moving_in(record.output_unit).force
                raise ValueError(
                    "records with motion as input cannot be combined with records with "
                    f"{force} as input; got {record.name!r} (input in {record.input_unit}) among the former. "
                    "Fit them one after the other."
                )
        super().__init__(*(map(without_ends, rs) for rs in (records, validation)))

    def search(self, block, free):
        """Return the search in force."""
        return ImposedSearch(block, self.records, self.validation, free, self.prior, self.known)

    def plan(self, diagnosis, models, names, **limits):
        """Return the motion, of a few shapes and sizes, under which the forces differ most."""
        return motion_that_separates(diagnosis, models, names, **limits)
