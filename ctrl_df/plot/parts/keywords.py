"""Keywords of pictures: their own, and properties of lines, checked before anything is drawn."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import control as ct
from matplotlib.artist import ArtistInspector
from matplotlib.lines import Line2D

from ...calls import keywords_of, unknown_keywords

LEGEND = ("legend_loc", "legend_map", "show_legend")
_SECTIONS = {
    "nyquist_plot": ("nyquist", "freqplot", "ctrlplot"),
    "time_response_plot": ("timeplot", "ctrlplot"),
}


class UnknownProperty(TypeError, AttributeError):
    """An unknown keyword, as everywhere; and an unknown property of a line, as matplotlib raises it."""


def check_keywords(
    owner: str, own: Sequence[str], keywords: Mapping[str, Any], upstream: Callable | None = None
) -> None:
    """Refuse keywords of a picture that neither it nor a line of matplotlib has.

    Parameters
    ----------
    owner : str
        What was called.
    own : sequence of str
        Keywords of the picture itself.
    keywords : mapping
        Those beyond its own.
    upstream : callable or None
        python-control's picture that takes the rest.

    Raises
    ------
    UnknownProperty
    """
    lines = ArtistInspector(Line2D)
    taken = {*own, *lines.get_setters(), *(a for names in lines.aliasd.values() for a in names)}
    more = " and properties of a line (color, lw, ls, ...), which has no property of this name"
    if upstream is not None:
        taken |= {*keywords_of(upstream), *LEGEND}
        taken |= {key for section in _SECTIONS[upstream.__name__] for key in _settings(section)}
        more = f", what ct.{upstream.__name__} takes,{more}"
    unknown = {k: v for k, v in keywords.items() if k not in taken}
    try:
        unknown_keywords(owner, unknown, own, (more, taken))
    except TypeError as error:
        raise UnknownProperty(str(error)) from None


def _settings(section: str) -> list[str]:
    """Return the keywords that stand for a section of python-control's configuration."""
    split = (key.split(".", 1) for key in ct.config.defaults)
    return [name for first, name in split if first == section]
