"""Records of a base that moves and of the mass on it, seen from the base: forces per mass."""

from __future__ import annotations

from ..data.moving_base import measured_in_space, moves_base, seen_from_base
from ..selection.kinematic_searches import MovingBaseSearch
from .over_time import TimeDataset


class MovingBaseDataset(TimeDataset):
    """Records with the force of inertia as input: it is the mass times what was recorded.

    Parameters
    ----------
    model : Mechanism
        Whose mass that is.
    records, validation : sequences of Measurement
        As they were recorded.
    """

    def __init__(self, model, records, validation=()):
        for record in (*records, *validation):
            if not moves_base(model, record):
                force = model.coordinates.force
                raise ValueError(
                    f"records of a moving base cannot be combined with records with a {force} as input; got "
                    f"{record.name!r} (input in {record.input_unit}) among the former. Fit them one after "
                    "the other."
                )
        self.in_space = any(measured_in_space(r) for r in (*records, *validation))
        super().__init__(*([seen_from_base(model, r) for r in rs] for rs in (records, validation)))

    def free_parameters(self, block, free=None):
        """Return the parameters that a fit moves: never the mass, which forces are known by."""
        names = super().free_parameters(block, free)
        if free is None:
            return tuple(k for k in names if "." in k)
        self._refuse_masses("free", names)
        return names

    def with_own(self, model, names):
        """Return the model marked so; the mass is no record's own either."""
        self._refuse_masses("own", names)
        return super().with_own(model, names)

    def fit(self, model, names, start, **how):
        """Fit by multiple shooting; from another mass the force would be another one."""
        self._refuse_masses("start", start or ())
        return super().fit(model, names, start, **how)

    @staticmethod
    def _refuse_masses(argument, names) -> None:
        masses = [k for k in names if "." not in k]
        if masses:
            raise ValueError(
                f"{argument} needs parameters that the records determine; a moving base shows forces per "
                f"{masses[0]} only. State it in the model, and leave it out here."
            )

    def search(self, block, free):
        """Return the search among what acts between a base and a mass."""
        return MovingBaseSearch(
            block, self.records, self.validation, free, self.prior, self.known, in_space=self.in_space
        )
