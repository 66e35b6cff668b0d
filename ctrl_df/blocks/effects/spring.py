"""What springs to ground have in common: a center, which may lie anywhere along the encoder."""

from typing import ClassVar

from ..effect import Effect
from ..thresholds import FAR_STROKES


class Spring(Effect):
    """A force that is zero at its `center` [m] and grows to both sides."""

    usual_side: ClassVar[str] = "load"

    def ranges(self, seen):
        """Return centers within ten strokes: over one, the force of others changes by less than a tenth."""
        if not seen.stroke > 0:
            return {}
        middle, far = 0.5 * (seen.lowest + seen.highest), FAR_STROKES * seen.stroke
        return {"center": (middle - far, middle + far)}

    def distinct(self, stroke, at_bound):
        """Return whether its force changes over the stroke: else it is a constant force."""
        return "center" not in at_bound
