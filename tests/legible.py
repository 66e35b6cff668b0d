"""Texts of a figure that are cut by its rim or lie on each other."""


def boxes(figure):
    """Texts of a figure and their boxes [pixels], after its layout came to rest."""
    figure.draw_without_rendering()
    renderer = figure.canvas.get_renderer()
    texts = list(figure.texts) + [t for legend in figure.legends for t in legend.get_texts()]
    if figure._suptitle is not None and figure._suptitle not in texts:
        texts.append(figure._suptitle)
    for ax in figure.axes:
        texts += [ax.title, ax._left_title, ax._right_title, *ax.texts]
        if ax.get_legend():
            texts += ax.get_legend().get_texts()
        if ax.axison:
            texts += [ax.xaxis.label, ax.yaxis.label]
            for axis, limits in ((ax.xaxis, ax.get_xlim()), (ax.yaxis, ax.get_ylim())):
                ticks = [*axis.get_major_ticks(), *axis.get_minor_ticks()]
                low, high = sorted(limits)
                texts += [t.label1 for t in ticks if low <= t.get_loc() <= high]
    texts = [t for t in texts if t.get_visible() and t.get_text().strip()]
    return [(t.get_text(), t.get_window_extent(renderer)) for t in texts]


def illegible(figure):
    """Return the texts cut by the figure's rim, and the pairs that lie on each other."""
    placed = [(text, box) for text, box in boxes(figure) if box.width > 0]
    width, height = figure.canvas.get_width_height()
    cut = [t for t, b in placed if b.x0 < -1 or b.y0 < -1 or b.x1 > width + 1 or b.y1 > height + 1]
    over = [
        (t, u)
        for i, (t, b) in enumerate(placed)
        for u, c in placed[i + 1 :]
        if min(b.x1, c.x1) - max(b.x0, c.x0) > 1 and min(b.y1, c.y1) - max(b.y0, c.y0) > 1
    ]
    return cut, over
