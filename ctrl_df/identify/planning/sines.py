"""The points of the (A, omega) plane that separate candidates, as a sequence of sines ready to be played."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np

from ...blocks.coordinates import moving_in
from ...numerals import digits
from ...thresholds import NOTHING
from ..results.experiment import Experiment, separated
from ..tables.thresholds import SCATTER_LEAST, WORK_MEDIUM
from .thresholds import COUNTED, PLANE, PLANE_BEYOND, SETTLE, SINE_SAMPLES, SINES


def stepped_sines(
    diagnosis, models, names, *, force=None, stroke=None, duration=None, dt=None, loop=None
) -> Experiment:
    """Return the `Experiment` of up to six sines at which the models differ most, relative to the scatter.

    Parameters
    ----------
    diagnosis : FrequencyDiagnosis
    models : sequence of block
        Two or more.
    names : tuple of str
        What is separated.
    force, stroke : float or None
        Largest amplitude, and largest distance from the start; None: the largest of the tables; no limit.
    duration, dt : float or None
        [s]; None: what twenty periods of each sine need; a hundred samples of the fastest period.
    loop
        Of no meaning here: a sine is held by its own amplitude.

    Returns
    -------
    Experiment
    """
    from ...df.describing import quiet_describing_function as describing_function
    from ...df.dispatch import method_for

    tables = diagnosis.train
    long, strong = tables[0].output_unit, tables[0].input_unit
    moves = moving_in(long)
    force = float(force or max(float(r.A[-1]) for r in tables))
    reach = float(stroke or math.inf)
    if not (force > 0 and reach > 0):
        raise ValueError(
            f"next_experiment needs {moves.force} > 0 and {moves.reach} > 0; got {force}, {reach}."
        )
    low = min(float(r.A[0]) for r in tables)
    A = np.geomspace(min(low, force), force, PLANE[0])
    omega = np.geomspace(
        PLANE_BEYOND[0] * min(r.omega[0] for r in tables),
        PLANE_BEYOND[1] * max(r.omega[-1] for r in tables),
        PLANE[1],
    )
    found = []
    for m in models:
        options: dict[str, Any] = dict(WORK_MEDIUM) if method_for(m).takes_options else {}
        found.append(np.asarray(describing_function(m, A[:, None], omega[None], **options)))
    size = np.max(np.abs(np.nan_to_num(found)), axis=0)
    far = A[:, None] * size
    sigma = max(diagnosis.noise, SCATTER_LEAST)
    gaps = [
        np.abs(np.nan_to_num(a) - np.nan_to_num(b)) / np.maximum(size, NOTHING)
        for a, b in itertools.combinations(found, 2)
    ]
    separation = np.where((far <= reach) & (size > 0), np.min(gaps, axis=0) / sigma, 0.0)
    order = np.argsort(separation, axis=None)[::-1][:SINES]
    i, k = np.unravel_index(order[separation.ravel()[order] > 0], separation.shape)
    if len(i) == 0:
        raise ValueError(
            f"no sine of up to {force:g} {strong} within {reach:g} {long} separates {' and '.join(names)}. "
            f"Allow more {moves.force} or {moves.reach}, or record a run over time."
        )
    chosen = sorted(zip(A[i].tolist(), omega[k].tolist(), strict=True), key=lambda p: (p[1], p[0]))
    needed = sum((SETTLE + COUNTED) * 2 * math.pi / w for _, w in chosen)
    factor = 1.0 if duration is None else float(duration) / needed
    dt = float(dt or 2 * math.pi / (SINE_SAMPLES * max(w for _, w in chosen)))
    parts = []
    for a, w in chosen:
        periods = max(int(round((SETTLE + COUNTED) * factor)), 2)
        n = max(int(round(periods * 2 * math.pi / w / dt)), 2)
        # from rest with the sine, not the cosine: the mass then drifts off least
        parts.append(a * np.sin(w * dt * np.arange(n)))
    u = np.concatenate(parts)
    least, stroke_used = float(separation[i, k].min()), float(far[i, k].max())
    points = ", ".join(f"{digits(a)} {strong} at {digits(w)} rad/s" for a, w in chosen)
    reason = (
        f"sines of {points}: there {separated(names)} differ by {digits(least, 2)} to "
        f"{digits(float(separation[i, k].max()), 2)} times the scatter, within {digits(stroke_used)} {long} "
        "of the centre."
    )
    return Experiment(
        dt * np.arange(len(u)), u, "stepped sine", names, least, stroke_used, reason, tuple(chosen), max(a for
        a, _ in chosen)
    )  # fmt: skip
