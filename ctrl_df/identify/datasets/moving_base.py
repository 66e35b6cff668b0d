"""Records of a base that moves and of the mass on it, seen from the base: forces per mass."""

from __future__ import annotations

from ..selection.moving_base_search import MovingBaseSearch
from .over_time import TimeDataset


class MovingBaseDataset(TimeDataset):
    """Records with the force of inertia as input: it is the mass times what was recorded."""

    def free_parameters(self, block, free=None):
        """Return the parameters that a fit moves: never the mass, which forces are known by."""
        masses = [k for k in block.parameters if "." not in k]
        if free is None:
            return tuple(k for k in super().free_parameters(block) if k not in masses)
        names = super().free_parameters(block, free)
        for name in masses:
            if name in names:
                raise ValueError(
                    f"free needs parameters that records tell; a base that moves tells forces per "
                    f"{name} only. State it in the model, and leave it out here."
                )
        return names

    def with_own(self, model, names):
        """Return the model marked so; the mass is no record's own either."""
        self.free_parameters(self.block_of(model), names)
        return super().with_own(model, names)

    def search(self, block, free):
        """Return the search among what acts between a base and a mass."""
        return MovingBaseSearch(block, self.records, self.validation, free, self.prior)
