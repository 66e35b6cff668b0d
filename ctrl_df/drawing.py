"""The one way up: results draw themselves and go on by name, and what does it is imported only then.

Every other import of the package runs downwards. A result knows what its picture is called; which function
draws it stands here, so that no computation depends on matplotlib. So does an element that is asked for its
describing function, as python-control asks its own.
"""

from __future__ import annotations

import importlib
from typing import Any

from .calls import explained

PICTURES = {
    "family": "family.plot_family",
    "harmonics": "harmonics.plot_harmonics",
    "analysis": "describing.describing_function_plot",
    "event response": "response.event_response_plot",
    "orbit": "orbit.orbit_plot",
    "comparison": "identification.compare.comparison_plot",
    "table comparison": "identification.table.table_comparison_plot",
    "diagnosis": "identification.diagnosis.plot_diagnosis",
    "table diagnosis": "identification.table.plot_frequency_diagnosis",
    "ladder": "identification.ladder.plot_ladder",
    "horizons": "identification.horizons.horizons_plot",
    "missing force": "identification.missing_force.missing_force_plot",
    "gains": "gains.plot_limit_cycle_map",
}


STEPS = {
    "describing function": "df.describing.describing_function",
    "next experiment": "identify.experiment.next_experiment",
    "report": "identify.report.write_report",
}
"""What a result or an element may be asked for besides, and the function that has the answer."""


def draw(picture: str, result, **keywords) -> Any:
    """Draw a result.

    Parameters
    ----------
    picture : str
        A key of `PICTURES`.
    result : object
        What the function of `ctrl_df.plot` takes first.
    **keywords
        Its other arguments.

    Returns
    -------
    ct.ControlPlot
    """
    module, _, function = PICTURES[picture].rpartition(".")
    drawn = getattr(importlib.import_module(f"ctrl_df.plot.{module}"), function)
    return explained(drawn, "plot", given=1)(result, **keywords)


def go_on(step: str, result, *arguments) -> Any:
    """Ask a result for more: `step`, a key of `STEPS`; `arguments`: further ones of its function."""
    module, _, function = STEPS[step].rpartition(".")
    return getattr(importlib.import_module(f"ctrl_df.{module}"), function)(result, *arguments)
