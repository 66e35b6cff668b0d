"""A refit to records: short segments first, then those that blur least, restarted where minima are many."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ...blocks.mechanism import Mechanism
from ...numerals import listed
from ..data.measurement import Measurement
from ..data.signals import step_of
from ..prediction.segments import facts, make_segments
from ..prediction.values import block_of, has_many_minima, with_values
from ..shooting.problem import Settings
from ..shooting.thresholds import SHORTEST_SEGMENT
from ..shooting.variables import priors, step_of_sensor
from ..thresholds import PROCESS_NOISE
from .fit import FitResult, fit_records, fit_segments, in_null_directions
from .lengths import segment_lengths
from .multistart import nonsmooth_names, restarted, thresholds_known, trimmed
from .per_record import start_with_angles, unknown_angles
from .segmented import prepare
from .static_levels import with_levels_scanned
from .thresholds import COST_GAIN, EFFORT_REFIT, HOLDOUT_PARTS, POLISH


def refit_records(
    model, records, names, start, *, whole, mode, window, robust, budget, prior=None, settled=False
) -> tuple[FitResult, FitResult]:
    """Return the fit, and the one whose segments and initial states the comparison is to show.

    Parameters
    ----------
    model : block or loop
    records : sequence of Measurement
    names : tuple of str
        Parameters to move.
    start : mapping or None
        Start values other than the model's.
    whole : bool
        Whether the step of a sensor that rounds is to be found as well.
    mode, window, robust, budget, prior
        As for `ctrl_df.refit`.
    settled : bool
        Whether the model begins in its right minimum, so that no other one is sought.
    """
    steps, tolerance = EFFORT_REFIT
    settings: dict[str, Any] = dict(
        budget=budget,
        lengths=segment_lengths(with_values(model, start), records, mode, window),
        robust=robust,
        tolerance=tolerance,
        central=True,
        polish=POLISH,
        prior=prior,
    )
    model = _with_angles(model, records, names)
    # short segments lead from far off; from nearby they may lead away, into another minimum
    ways = [True, False] if start is None and has_many_minima(model) else [start is None]
    fits = [fit_records(model, records, start, names, coarse=w, iterations=steps, **settings) for w in ways]
    divided = mode == "auto" and window is None and names and _divides(model, records)
    if divided and len(ways) > 1:
        led = _led_by_segments(model, records, names, prior)
        fits.append(fit_records(led, records, None, names, coarse=False, iterations=steps, **settings))
    found = min(fits, key=lambda f: f.rmse)
    shown = None
    if divided:
        short = _short_segment(found.model, records)
        if short is not None:
            shown = settings | {"coarse": False, "starts": found.starts}
            settings["lengths"] = [short] * len(records)
            # from the start again: longer segments may have left the right minimum (of a ripple, say)
            found = fit_records(model, records, start, names, coarse=False, iterations=steps, **settings)
    beside = _Beside(records, found.segments, priors(block_of(model), prior))
    if nonsmooth_names(found) and not settled:
        better = restarted(with_levels_scanned(found, beside, records), beside, nonsmooth_names(found))
        if better is not found:
            found = fit_records(
                better.model, records, None, names, coarse=False, starts=better.starts, **settings
            )
    found = thresholds_known(_with_step(found, records, names, whole), beside)
    # a model that errs over short segments of its own fit would look better than it is
    seen = found if shown is None else fit_records(found.model, records, None, (), **shown)
    return found, seen


def _with_angles(model, records: Sequence[Measurement], names):
    """Return the model with the angles that every record has for itself, sought over half strokes."""
    if not unknown_angles(model, names, records):
        return model
    segments = [make_segments(r, max(0.5 * facts(r).period, SHORTEST_SEGMENT * facts(r).dt)) for r in records]

    def fit(trial, moved, starts, iterations) -> FitResult:
        return fit_segments(trial, records, segments, moved, starts=starts, iterations=iterations)

    return start_with_angles(model, names, records, None, fit)[0]


def _short_segment(model, records: Sequence[Measurement]) -> float | None:
    """Return the length [s] of `SegmentedData.short_segments` where disturbance forces prevail; or None.

    Not for models of which something is hidden.
    """
    data = prepare(model, records, records)
    near, disturbed = (
        data.segmentations[0].states_of(model),
        data.with_process_noise,
    )
    if near.rmse <= PROCESS_NOISE * data.noise or data.noise_free or disturbed.continues(model):
        return None
    segments = disturbed.short_segments.train.segments
    spans = [r.t[w.stop - 1] - r.t[w.first] for r, w in zip(records, segments, strict=True)]
    return float(np.median(np.concatenate(spans)))


def _divides(model, records: Sequence[Measurement]) -> bool:
    """Whether records are divided as a diagnosis divides them: not short ones, nor of imposed motions."""
    if not isinstance(model, Mechanism) or any(facts(r).imposed for r in records):
        return False
    return min(map(len, records)) >= HOLDOUT_PARTS * SHORTEST_SEGMENT


def _led_by_segments(model, records: Sequence[Measurement], names, prior):
    """Return the model fitted over the segments of a diagnosis, from one length to the next.

    These hold few events each, so that one that comes too early or too late is not compared with the next.
    """
    short, *longer = prepare(model, records, records, prior).segmentations
    found = short.fit(model, names)
    for data in longer:
        found = data.moved(found)
        if found.model.nonsmooth:
            found = trimmed(found, data)
    return found.model


class _Beside:
    """Fits over the segments of a refit, at the full rate."""

    def __init__(self, records, segments, about):
        self.records, self.segments, self.about = records, segments, about

    def __call__(
        self, model, names, *, starts, iterations, tolerance=COST_GAIN, give_up=math.inf
    ) -> FitResult:
        return fit_segments(
            model, self.records, self.segments, names, Settings(about=self.about, give_up=give_up),
            decimation=1, starts=starts, iterations=iterations, tolerance=tolerance,
        )  # fmt: skip


def _with_step(found: FitResult, records, names, whole) -> FitResult:
    """Take the step of a rounding sensor from the records themselves: least squares cannot see it."""
    key = step_of_sensor(block_of(found.model))
    if key is None or not (whole or key in names):
        return found
    steps = [step_of((r.outputs or {}).get("position", np.zeros(0))) for r in records]
    if min(steps) == 0:
        return found
    return replace(found, model=with_values(found.model, {key: float(np.median(steps))}))


def undetermined(found: FitResult) -> set[str]:
    """Return the parameters in a null direction, or uncertain by more than themselves.

    Of one that may be zero, uncertain by more than its scale, too: else it is known to be next to nothing.
    Those that every record has for itself where that holds in all records.
    """
    names = in_null_directions(found)
    errors = np.sqrt(np.maximum(np.diag(found.covariance), 0)) if len(found.names) else np.zeros(0)
    for k, value, error, scale in zip(found.names, found.values, errors, found.scale, strict=True):
        if k not in found.own and not error <= max(abs(value), scale):
            names.add(k)
    return names | {k for k, own in found.own.items() if not any(v.determined for v in own.values())}


def indistinguishable_parameters(found: FitResult) -> tuple[str, ...]:
    """Return a sentence for every null direction of several parameters."""
    lines = []
    for parts in _directions(found):
        moves: dict[str, float] = {}
        for k, _, d in sorted(parts, key=lambda p: -abs(p[2])):
            moves.setdefault(k, d)
        if len(moves) == 1:
            continue
        names = {k: _of(k, [r for n, r, _ in parts if n == k], found) for k in moves}
        first = next(iter(moves.values()))
        up = ", ".join(names[k] for k, d in moves.items() if d * first > 0)
        down = ", ".join(names[k] for k, d in moves.items() if d * first <= 0)
        change = f"raising {up}" + (f" while lowering {down}" if down else "") + " together"
        lines.append(
            f"{listed(names.values())} cannot be distinguished on these data: {change} leaves the "
            "output unchanged. State one of them (prior), or excite the drive otherwise."
        )
    return tuple(lines)


def doubts(found: FitResult) -> tuple[str, ...]:
    """Return a sentence for every direction the data do not determine."""
    lines, covered, alone = list(indistinguishable_parameters(found)), set(), {}
    for parts in _directions(found):
        covered |= {(k, r) for k, r, _ in parts}
        if len({k for k, _, _ in parts}) == 1:
            for k, record, _ in parts:
                alone.setdefault(k, {})[record] = None
    for k, records in alone.items():
        lines.append(
            f"{_of(k, [*records], found)} has no influence on these data, which do not tell its value."
        )
    doubtful = undetermined(found)
    for k in found.names:
        if k in found.own:
            open_ = [r for r, own in found.own[k].items() if not own.determined]
            left = [r for r in open_ if not {(k, r), (k, None)} & covered]
            if left and len(left) < len(found.own[k]):
                lines.append(f"{k} is not determined by {' and '.join(left)}.")
                continue
            doubt = bool(left)
        else:
            doubt = k in doubtful and (k, None) not in covered
        if doubt:
            lines.append(f"{k} has a standard error larger than its value: these data do not determine it.")
    return tuple(lines)


def _directions(found: FitResult) -> list:
    """Return the null directions, those of own parameters alone by record."""
    return [part for _, whole in found.null for part in _by_record(whole)]


def _by_record(parts) -> list[list]:
    """Return a direction as it is, or, of own parameters alone, that of each record: they do not meet."""
    if any(record is None for _, record, _ in parts):
        return [parts]
    records = dict.fromkeys(record for _, record, _ in parts)
    return [[p for p in parts if p[1] == record] for record in records]


def _of(name, records, found: FitResult) -> str:
    """Return a name with the records it is of, unless these are all."""
    every = found.own.get(name, {})
    return name if None in records or len(records) == len(every) else f"{name} of {' and '.join(records)}"
