"""What the best candidate leaves of records over time: noise, structure, and where that is."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from ...thresholds import NOTHING
from ..data.measurement import Measurement
from ..estimation.segmented import CandidateFit, SegmentedData
from ..prediction.segments import facts
from ..prediction.sensed import place_unit
from ..residuals.input_noise import made_by_input_noise
from ..residuals.left_open import moved_by_parameters
from ..residuals.missing_forces import FittedForces, missing_forces
from ..residuals.regions import error_regions
from ..residuals.rounding import steps_of_outputs
from ..results.explain import followed_when_fitted, places
from ..shooting.noise_model import NoiseModel, prediction_errors
from ..shooting.thresholds import GROSS_ERROR, NOISE_ORDER
from ..smoothing.missing_force import MissingForce, missing_force
from ..thresholds import BY_CHANCE, ONLY_NOISE, QUARTILE
from .evidence import rounding_error, rounds
from .search import Located, Remainder
from .thresholds import (
    CURVE_MOST,
    CURVE_SHARE,
    FORCE_ALIKE,
    HEAVY_TAILS,
    INDEPENDENT_MOST,
    LEFT,
    LEFT_BY_ANSWER,
    by_chance,
)

_SMOOTHED: WeakKeyDictionary[Measurement, dict[Any, MissingForce | None]] = WeakKeyDictionary()
_KEPT = 4  # models a record, of which it is known: those of one question

CURVES = {
    "time": "time", "position": "position", "velocity": "low_speed", "load": "load",
    "reversal": "after_reversal", "acceleration": "acceleration",
}  # fmt: skip
"""Region of an error that a force makes which is a curve over a quantity."""


def remainder(
    base: CandidateFit,
    best: CandidateFit,
    data: SegmentedData,
    noise: NoiseModel,
    noise_model: NoiseModel,
    most: float,
    significant: float,
    missed: list[FittedForces] | None = None,
) -> Remainder:
    """Return what the best model leaves.

    Structure shows on the segments fitted by what missing forces explain, and on those held out by an error
    beyond the noise and what the parameters are known to. The noise is that of the fitted segments, times
    what its spectrum and the records' own noise floors say of the two.

    Parameters
    ----------
    base, best : CandidateFit
    data : SegmentedData
    noise : NoiseModel
        Of the best model's residual.
    noise_model : NoiseModel
        The same as far as it may be slow.
    most : float
        Error over the segments fitted that noise alone may make.
    significant : float
        Evidence that missing forces need [nats].
    missed : list of FittedForces or None
        Those of the segments fitted, where they are known (`Remainder.about`).
    """
    # Where an encoder rounds, the errors of single samples are whole steps: missing forces show in what is
    # not rounded.
    rounded = rounds(best)
    missed = missing_forces(base if rounded else best, data, noise) if missed is None else missed
    # what rounding errs by may go with the motion
    driven = made_by_input_noise(best.train, data)
    least = max(rounding_error(best), driven, missed[0].by_rounding if missed else 0.0)
    telling = bool(missed) and missed[0].evidence > significant and missed[0].rms > least
    structure = max(missed[0].rms if telling else 0.0, _as_curve(best, data))
    if not rounded and not data.disturbed:
        # what the right model misses over long segments it misses over short ones
        most = math.hypot(min(most, _noise_most(best, data), _noise_usual(best, noise, data.noise)), driven)
        structure = max(structure, _beyond(best.train.rmse, most))
    spread = _beyond(best.train.rmse, structure)
    held_out = _held_out(best, data, noise_model, spread, driven)
    # the share of what the model without it leaves, and of its own error
    share = max(
        structure / max(_beyond(base.train.rmse, spread), structure, NOTHING),
        held_out.structure / max(_beyond(base.validation_rmse, held_out.noise), held_out.structure, NOTHING),
    )
    own = structure / max(best.train.rmse, NOTHING)
    own_held_out = held_out.structure / max(best.validation_rmse, NOTHING)
    unexplained = telling if rounded else share > LEFT
    # Disturbance forces leave some of every model, and where there is no noise what a fit leaves is none.
    shows = telling if rounded else max(own, own_held_out) > LEFT and share > LEFT_BY_ANSWER
    more = shows and not (data.disturbed or data.noise_free)
    only = unexplained and own <= LEFT < own_held_out
    doubt = followed_when_fitted(best) if only else ""
    return Remainder(
        spread, max(structure, held_out.structure), unexplained, missed, doubt, more, only, held_out.uncertain
    )  # fmt: skip


@dataclass(frozen=True)
class _HeldOut:
    """The error held out that is structure, and that which noise makes.

    `uncertain`: whether it is no structure because parameters are as uncertain.
    """

    structure: float
    noise: float
    uncertain: bool


def _held_out(
    best: CandidateFit, data: SegmentedData, noise_model: NoiseModel, spread: float, driven: float
) -> _HeldOut:
    """Return what of the error on the segments held out noise, and parameters off by chance, do not make.

    `spread`: noise of the segments fitted; `driven`: error that noise of the input makes.
    """
    floors = [
        math.sqrt(float(np.mean([facts(r).noise ** 2 for r in v.records])))
        for v in (data.train, data.validation)
    ]
    # the floors see what is fast: of two records with slow noise neither counts as the quieter one
    noise = max(spread * max(1.0, floors[1] / floors[0]), _rounded_by(data))
    expected = _noisier(best, noise_model) * noise
    if best.validation_rmse <= expected:
        return _HeldOut(0.0, expected, False)
    most = math.hypot(_at_most(expected, best, noise_model, data), driven)
    return _HeldOut(_beyond(best.validation_rmse, most), most, best.validation_rmse <= most)


def _beyond(error: float, noise: float) -> float:
    """Return what of an error (rms) noise of this size does not make."""
    return math.sqrt(max(error**2 - noise**2, 0.0))


def _as_curve(best: CandidateFit, data: SegmentedData) -> float:
    """Return how much of an error of forces is a curve over a quantity of the motion.

    That is under an imposed motion, or where disturbance forces are taken to act: a force that repeats over
    the place, say, is no noise, however much its spectrum looks like that of slow noise. A model of the
    spectrum predicts any sum of sines. What varies over time alone may be noise.
    """
    if not (data.disturbed or all(facts(r).imposed for r in data.train.records)):
        return 0.0
    force = _smoothed(best, data)
    law = force.law if force is not None else None
    return math.sqrt(law.share) * best.train.rmse if law is not None and law.share > CURVE_SHARE else 0.0


def _noise_most(best: CandidateFit, data: SegmentedData) -> float:
    """Return how much of an error noise may make: none is harder to predict than a record that has it.

    From as many values before; a predictor errs by the noise and by the signal, which do not know each other.
    """
    segments, outputs = data.train.segments, data.train.segments[0].outputs
    recorded = [y[w] for y, ws in zip(data.train.outputs, segments, strict=True) for w in ws.slices]
    residuals, shares = best.train.residual_pieces, []
    for i in range(outputs):
        most, least = (prediction_errors(s[i::outputs], NOISE_ORDER) for s in (recorded, residuals))
        n = min(len(most), len(least))
        shares.append(float(np.min(most[:n] / np.maximum(least[:n], NOTHING))))
    return best.train.rmse * min(by_chance(sum(map(len, recorded)) / outputs) * max(shares), 1.0)


def _noise_usual(best: CandidateFit, noise: NoiseModel, floor: float) -> float:
    """Return how much of an error noise may make whose usual sample, predicted from those before, is this.

    Slips and impacts at other times are few errors that are large, whatever spectrum they have together.
    Outliers, as a fit takes them, count as much as the smallest of them. An error as large as the noise floor
    of the records is noise: what an encoder rounds stays for a while, and then jumps.
    """
    if best.train.rmse <= ONLY_NOISE * floor:
        return best.train.rmse
    pieces = enumerate(best.train.residual_pieces)
    new = np.concatenate([np.abs(noise.weighed(piece, i)) for i, piece in pieces])
    usual = max(float(np.median(new)) / QUARTILE, NOTHING)
    size = math.sqrt(float(np.mean(np.minimum(new / usual, GROSS_ERROR) ** 2)))
    return best.train.rmse * min(HEAVY_TAILS / max(size, NOTHING), 1.0)


def _rounded_by(data: SegmentedData) -> float:
    """Return the rms of what rounding of the records held out errs by: initial states need not absorb it."""
    if data.disturbed:
        return 0.0
    steps = [q for r in data.validation.records for q in steps_of_outputs(r)]
    return math.sqrt(float(np.mean(np.square(steps))) / 12)


def _noisier(best: CandidateFit, noise_model: NoiseModel) -> float:
    """Return the error of noise alone held out over that on segments fitted, at most."""
    assert best.validation is not None
    shares = [noise_model.memory / f.spanned for f in (best.train, best.validation)]
    return by_chance(min(2 / sum(shares), INDEPENDENT_MOST))


def _at_most(expected: float, best: CandidateFit, noise_model: NoiseModel, data: SegmentedData) -> float:
    """Return the error held out that noise makes, and parameters that are off by as much as may be chance.

    `expected`: of noise that initial states take as much of as on the segments fitted.
    """
    covariance, there = best.validated.covariance, best.validation_slopes
    if there is None or len(there.slopes) != len(covariance):
        return expected
    known, known_validation = best.validated.sensitivity, there.sensitivity
    if known is None or known_validation is None:
        return expected
    left = known_validation.left_by_starts(noise_model) / known.left_by_starts(noise_model)
    columns = np.concatenate(known_validation.parameters) / there.slopes
    if not (np.all(np.isfinite(covariance)) and np.all(np.isfinite(columns))):
        return math.inf  # nothing is known of some: they may be off by anything
    power = float(np.sum((columns @ covariance) * columns)) / len(columns) / there.unit**2
    of_noise, off = math.sqrt(max(left, 1.0)) * expected, BY_CHANCE * math.sqrt(power)
    if best.validation_rmse > math.hypot(of_noise, off):
        # derivatives do not tell whether a motion, on its way to rest, stops or goes on
        off = max(off, moved_by_parameters(best, data))
    most = math.hypot(of_noise, off)
    return most if math.isfinite(most) else math.inf


def located(
    base: CandidateFit,
    best: CandidateFit,
    data: SegmentedData,
    noise,
    left: Remainder,
    unknown: bool,
    significant: float,
    measure: str,
) -> Located:
    """Return where the error of the baseline is, or (`unknown`) that which nothing explains."""
    shown, missed = base, left.about
    if unknown:
        # what the model misses, which an effect that stands in for it would bend; where that shows in long
        # segments alone, what the best one misses
        before = missing_forces(base, data, noise)
        if before and before[0].evidence > significant:
            missed = before
        else:
            shown = best
    where = find_regions(shown, data.train)
    if not unknown:
        return Located(where, tuple(where.kinds) if where is not None else ())
    kinds = [m.kind for m in missed if m.evidence > FORCE_ALIKE * missed[0].evidence - significant]
    curve, said = _curve(base, data)
    kinds += [k for k in curve if k not in kinds]
    # of two accounts that differ both are given
    other = said if missed and missed[0].kind not in curve else ""
    note = _left(left, measure, _unit(data))
    return Located(where, tuple(kinds), f"{note} {_acts(missed)}{other}{places(where)}".rstrip())


def _curve(base: CandidateFit, data: SegmentedData) -> tuple[list[str], str]:
    """Return the region in which the smoothed missing force of the longest record is a curve, if any.

    And that in a sentence.
    """
    force = _smoothed(base, data)
    if force is None:
        return [], ""
    words, (name, share) = force.words, next(iter(force.shares.items()))
    said = (
        f"As a signal over the longest record, {share:.0%} of the missing {words['force']} is a function of "
        f"the {words[name]}. "
    )
    return [CURVES[name]] if share > CURVE_SHARE else [], said if share > CURVE_MOST else ""


def _smoothed(tried: CandidateFit, data: SegmentedData) -> MissingForce | None:
    """Return the smoothed missing force of the longest record; None if not significant."""
    record = max(data.train.records, key=len)
    known = _SMOOTHED.setdefault(record, {})
    if tried.block in known:
        return known[tried.block]
    found = None
    with suppress(ValueError):  # it is not to be had of this record
        force = missing_force(tried.block, record)
        found = force if force.significant else None
    if len(known) >= _KEPT:
        known.pop(next(iter(known)), None)
    known[tried.block] = found
    return found


def _unit(data: SegmentedData) -> str:
    """Return the unit of an error, a space before it; empty where outputs of several units share it."""
    train = data.train
    if train.segments[0].outputs > 1:
        return ""
    record = train.records[0]
    return f" {place_unit(record)}/s^2" if data.disturbed else f" {record.output_unit}"


def _left(left: Remainder, measure: str, unit: str) -> str:
    """Return how much of the residual is structure, and how much may be noise."""
    size = f"{left.structure:.2g}{unit}"
    if left.noise <= NOTHING:
        return f"All of the residual is structure, {size} (rms of the {measure})."
    return (
        f"The residual contains structure of {size} and a remainder of {left.noise:.2g}{unit} that may be "
        f"noise (rms of the {measure})."
    )


def _acts(missed: list[FittedForces]) -> str:
    return f"It behaves like {missed[0].sentence}. " if missed and missed[0].evidence > 0 else ""


def find_regions(tried, view):
    """Return the regions of error of a fitted candidate on its longest record."""
    i = max(range(len(view.records)), key=lambda k: len(view.records[k]))
    record, segments = view.records[i], tried.train.segments[i]
    inside, residual = segments.samples, np.asarray(tried.train.residual[i])[segments.blocks[0]]
    if not np.all(np.isfinite(residual)):
        return None
    error_filter = tried.train.error_filter
    if error_filter is not None:
        parts = segments.slices
        inside = inside[error_filter.rows(parts)]
        residual = error_filter.filtered(residual, parts) / tried.train.unit
    known = facts(record)
    return error_regions(
        record.t[inside], residual, position=known.place[inside], velocity=known.velocity[inside],
        force=known.load[inside], units=known.units,
    )  # fmt: skip
