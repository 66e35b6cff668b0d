"""Which function draws a result, or answers what else it is asked for (`drawing.py`).

A function is imported when it is first asked for, so that numba and the report load with it only.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any


def handler(name: str) -> Callable[..., Any]:
    """Return the function for a picture or a further step; it takes the result first."""
    match name:
        case "family":
            from .plot.family import plot_family as found
        case "harmonics":
            from .plot.harmonics import plot_harmonics as found
        case "analysis":
            from .plot.describing import describing_function_plot as found
        case "event response":
            from .plot.response import event_response_plot as found
        case "orbit":
            from .plot.orbit import orbit_plot as found
        case "comparison":
            from .plot.identification.compare import comparison_plot as found
        case "table comparison":
            from .plot.identification.table import table_comparison_plot as found
        case "diagnosis":
            from .plot.identification.diagnosis import plot_diagnosis as found
        case "table diagnosis":
            from .plot.identification.table import plot_frequency_diagnosis as found
        case "ladder":
            from .plot.identification.ladder import plot_ladder as found
        case "horizons":
            from .plot.identification.horizons import horizons_plot as found
        case "missing force":
            from .plot.identification.missing_force import missing_force_plot as found
        case "gains":
            from .plot.gains import plot_limit_cycle_map as found
        case "describing function":
            from .df.describing import describing_function as found
        case "next experiment":
            from .identify.experiment import next_experiment as found
        case "report":
            from .identify.report import write_report as found
        case _:
            raise LookupError(name)
    return found
