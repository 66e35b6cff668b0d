"""What a record holds of a model's outputs, as one vector of values, each output over its own noise."""

from __future__ import annotations

from collections.abc import Mapping

OUTPUT_COLUMNS: Mapping[str, int] = {"position": 0}
"""Where an engine puts out the quantities that records may hold, of the body that is measured."""
