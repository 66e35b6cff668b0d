"""The one way up: results draw themselves by name, and the drawing layer is imported only then.

Every other import of the package runs downwards. A result knows what its picture is called; which function
draws it stands here, so that no computation depends on matplotlib.
"""

from __future__ import annotations

import importlib
from typing import Any

PICTURES = {
    "family": "family.plot_family",
    "harmonics": "harmonics.plot_harmonics",
    "analysis": "describing.describing_function_plot",
    "orbit": "orbit.orbit_plot",
    "comparison": "compare.comparison_plot",
    "table comparison": "table.table_comparison_plot",
    "diagnosis": "diagnosis.plot_diagnosis",
    "table diagnosis": "table.plot_frequency_diagnosis",
    "ladder": "ladder.plot_ladder",
    "gains": "gains.plot_limit_cycle_map",
}


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
    module, function = PICTURES[picture].split(".")
    return getattr(importlib.import_module(f"ctrl_df.plot.{module}"), function)(result, **keywords)
