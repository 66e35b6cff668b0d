"""Labels clear of each other, of the frame and, as far as there is room, of the curves."""

from __future__ import annotations

import numpy as np
from matplotlib.transforms import Bbox

_ROOM = 4.0  # [pt] around a label: two of them side by side stand a letter apart


class Labels:
    """Labels of one axes, put where nothing lies; call `settle` on the figure before (a layout moves axes).

    Parameters
    ----------
    ax : Axes
        With its limits, labels and title set.
    curves : sequence of (n, 2) arrays
        What labels should not cover, in data.
    """

    def __init__(self, ax, curves=()):
        self.ax = ax
        self.renderer = ax.figure.canvas.get_renderer()
        self.frame = ax.get_window_extent(self.renderer)
        self.taken: list[Bbox] = []
        points = [self._dense(np.asarray(c, dtype=float)) for c in curves]
        self.points = np.concatenate(points) if points else np.zeros((0, 2))

    def _dense(self, curve):
        """Return a curve in pixels, points a few apart."""
        with np.errstate(invalid="ignore"):
            at = self.ax.transData.transform(curve[np.isfinite(curve).all(axis=1)])
        inside = (np.abs(at - 0.5 * (self.frame.p0 + self.frame.p1)) < 2 * self.frame.size).all(axis=1)
        at = at[inside]
        if len(at) < 2:
            return at
        steps = np.linalg.norm(np.diff(at, axis=0), axis=1)
        pieces = [
            a + (b - a) * np.linspace(0, 1, max(int(s / 3), 1), endpoint=False)[:, None]
            for a, b, s in zip(at[:-1], at[1:], steps, strict=True)
            if s < 0.5 * float(np.max(self.frame.size))
        ]
        return np.concatenate([*pieces, at[-1:]])

    def block(self, box) -> None:
        """Keep a box, in pixels, free of labels."""
        self.taken.append(Bbox(np.asarray(box)))

    def block_points(self, places, size) -> None:
        """Keep markers of that size [pt] free of labels."""
        reach = 0.5 * size * self.ax.figure.dpi / 72
        for x, y in self.ax.transData.transform(np.reshape(places, (-1, 2))):
            self.block([[x - reach, y - reach], [x + reach, y + reach]])

    def covers(self, place) -> bool:
        """Whether a label or a marker kept free of labels lies on a place in data."""
        return any(box.contains(*self.ax.transData.transform(place)) for box in self.taken)

    def write(self, text, places, *, offsets=((4, 4),), must=False, avoid=True, **style):
        """Write a label at the first of some places, or of those the one that covers least; None: nowhere.

        Parameters
        ----------
        text : str
        places : sequence of (x, y)
            In data, the best first.
        offsets : sequence of (right, up)
            From the place [pt]; to the left and below labels end where these point to.
        must : bool
            Whether the label is written even where it covers another.
        avoid : bool
            Whether it stands clear of curves where it can.
        """
        style = {"zorder": 5, **style}
        best = None
        for place in places:
            for right, up in offsets:
                note = self.ax.annotate(
                    text, place, xytext=(right, up), textcoords="offset points",
                    ha="left" if right > 0 else "right" if right < 0 else "center",
                    va="bottom" if up > 0 else "top" if up < 0 else "center", annotation_clip=False, **style,
                )  # fmt: skip
                box = note.get_window_extent(self.renderer)
                cost = self._cost(box, avoid)
                if best is None or cost < best[0]:
                    if best is not None:
                        best[1].remove()
                    best = (cost, note, box)
                else:
                    note.remove()
                if best[0] == 0:
                    break
            if best is not None and best[0] == 0:
                break
        if best is None:
            return None
        cost, note, box = best
        if cost >= _COVERED and not must:
            note.remove()
            return None
        self.taken.append(box)
        return note

    def _cost(self, box, avoid) -> float:
        """Return what a label covers: points of curves, or far more for another label and for the frame."""
        frame, cost = self.frame, 0.0
        out = max(frame.x0 - box.x0, box.x1 - frame.x1, frame.y0 - box.y0, box.y1 - frame.y1)
        if out > 0:
            cost += _COVERED * (1 + out)
        spared = box.padded(_ROOM * self.ax.figure.dpi / 72)
        cost += _COVERED * sum(spared.overlaps(other) for other in self.taken)
        if not avoid:
            return cost
        p = self.points
        inside = (p[:, 0] > box.x0) & (p[:, 0] < box.x1) & (p[:, 1] > box.y0) & (p[:, 1] < box.y1)
        return cost + float(np.count_nonzero(inside))


_COVERED = 1e4


def settle(figure) -> None:
    """Let the layout of a figure come to rest, so that places in pixels hold."""
    layout = figure.get_layout_engine()
    if layout is None:
        figure.draw_without_rendering()
    else:
        layout.execute(figure)
