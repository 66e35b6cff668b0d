"""The data of a diagnosis, made ready for many fits: segments to fit, segments to validate on."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any

import numpy as np

from ...thresholds import NOTHING
from ...values.per_record import PerRecord
from ..data import signals
from ..data.measurement import Measurement
from ..prediction.decimated import decimable
from ..prediction.initial_states import CONTINUED, FREE, MEASURED
from ..prediction.segments import equal_segments, facts
from ..prediction.sensed import sensed
from ..prediction.simulator import Simulator
from ..prediction.simulators import simulator_of, tolerance
from ..prediction.values import is_own, knowing
from ..shooting.known_fits import KnownFits, by_value
from ..shooting.noise_model import NoiseModel, acceleration_filter
from ..shooting.problem import Settings
from ..shooting.scales import Scales, scales_of
from ..shooting.segmented_records import SegmentedRecords
from ..shooting.thresholds import EFFORT_ALONE
from ..shooting.variables import Prior, RecordScales, priors, seen_by
from ..thresholds import FULL_SAMPLES, GROWTH, LACKS_MORE, NOISE_FREE
from .fit import FitResult, fit_segments
from .per_record import own_values_of, reestimated
from .starts import begin_alike, better_initial_states, continued_states, matching_initial_states
from .static_levels import with_levels_scanned
from .thresholds import (
    BEGINNINGS_KEPT,
    COST_GAIN,
    EFFORT_MOVED_ON,
    EFFORT_OWN,
    EFFORT_STATES,
    FILTERED,
    HOLDOUT_PARTS,
    ITERATIONS,
    PARAMETER_RANGE,
    RESTARTS_KEPT,
    SCREEN_SAMPLES,
    SEGMENT_MOTIONS,
    SEGMENT_SCALES,
    SEGMENT_USUAL,
    SEGMENTS,
    SHORT,
    SHORTEST,
    STROKE_SAMPLES,
)


@dataclass(frozen=True, eq=False)
class CandidateFit:
    """A model fitted to the segments fitted, and (once validated) run over those held out.

    `beside`: other fits of the same, which the segments fitted do not tell from this one. `unseen`: the last
    fit that has not seen what is held out, where that is not `train`: `validation` is of that one.
    """

    key: str
    train: FitResult
    validation: FitResult | None = None
    extra: int = 0  # parameters beyond the baseline's
    evidence: float = 0.0
    evidence_fitted: float = 0.0  # of the segments fitted alone
    evidence_validation: float = 0.0  # of those held out alone
    confirmed: bool = False
    linear: Callable[[], FitResult] | None = field(repr=False, default=None)
    beside: tuple[CandidateFit, ...] = field(repr=False, default=())
    unseen: FitResult | None = field(repr=False, default=None)

    @property
    def validated(self) -> FitResult:
        """The fit whose parameters were run over the segments held out."""
        return self.unseen or self.train

    @property
    def validation_slopes(self) -> FitResult | None:
        """The model as it is over the segments held out, with its derivatives there by what was fitted."""
        return self.linear() if self.linear is not None else None

    @property
    def block(self):
        """The fitted model."""
        return self.train.model

    @property
    def validation_rmse(self) -> float:
        """Error over the segments to validate on; NaN before it was run over them."""
        return self.validation.rmse if self.validation is not None else math.nan

    @property
    def residuals(self) -> list[np.ndarray]:
        """Of all segments, as evidence takes them."""
        validation = self.validation.residual_pieces if self.validation is not None else ()
        return [*self.train.residual_pieces, *validation]

    @property
    def outputs(self) -> list[np.ndarray]:
        """Simulated, of all segments, as evidence takes them."""
        validation = self.validation.simulated_pieces if self.validation is not None else ()
        return [*self.train.simulated_pieces, *validation]

    def with_fit(self, train: FitResult) -> CandidateFit:
        """Return the candidate with another fit, and none beside it."""
        return replace(self, train=train, beside=())

    @property
    def size(self) -> float:
        """Sum of squared residuals."""
        return float(sum(np.sum(r * r) for r in self.residuals))


@dataclass(frozen=True, eq=False)
class SegmentedData:
    """Everything the fits of one diagnosis share: segments of one length, and those of others."""

    train: SegmentedRecords
    validation: SegmentedRecords
    decimation: int
    scales: Scales
    limits: Mapping[str, tuple[float, float]]  # of the model's own parameters
    about: Mapping[str, Prior]  # what is known of these before any data
    record_scales: RecordScales  # of effects
    known: KnownFits = field(repr=False)
    whole: tuple[SegmentedRecords, SegmentedRecords] | None = None
    full_rate: bool = False  # as `fine` makes it: its fits work out standard errors
    before: int = 1  # samples a step of the input before that
    error_filter: NoiseModel | None = None  # of errors that forces make which no model has, beyond the noise
    initial: str = FREE  # initial states of segments
    robust: bool = False  # whether errors far beyond the usual one count linearly only
    beyond: frozenset[str] = frozenset()  # parameters stated to be beyond what the records show

    def level(self, factor: int) -> SegmentedData:
        """Return the same data in segments `factor` times as many as the longest."""
        train, validation = self.whole or (self.train, self.validation)
        return replace(
            self,
            train=train.shorter(factor),
            validation=validation.shorter(factor),
            whole=(train, validation),
        )

    @property
    def parts_held_out(self) -> bool:
        """Whether parts of the records fitted are held out, and no other records: both have one tuple."""
        return self.validation.records is self.train.records

    @property
    def noise(self) -> float:
        """Noise floor of the records fitted."""
        return math.sqrt(float(np.mean([facts(r).noise ** 2 for r in self.train.records])))

    @property
    def segmentations(self) -> list[SegmentedData]:
        """The same in segments of three lengths, the shortest first."""
        return [self.level(f) for f in SEGMENT_SCALES]

    @property
    def noise_free(self) -> bool:
        """Whether the records lack the noise of any sensor: then evidence has no scale."""
        outputs = [y for r in self.train.records for y in sensed(r).values]
        return all(signals.resolution(y) < NOISE_FREE * max(float(np.std(y)), NOTHING) for y in outputs)

    def lacks_more(self, error: float) -> bool:
        """Whether what errs so much lacks something that no other minimum of its cost makes up for."""
        return error > LACKS_MORE * self.noise and not (self.disturbed or self.noise_free)

    @property
    def disturbed(self) -> bool:
        """Whether disturbance forces (friction that drifts) outweigh the noise."""
        return self.error_filter is not None

    @property
    def with_process_noise(self) -> SegmentedData:
        """The same for a machine with disturbance forces.

        The slow error that such forces leave would drown all else: what counts are the forces, averaged. Of
        several outputs that one counts whose accelerations have less noise.
        """
        length = float(np.median(np.concatenate([w.stop - w.first for w in self.train.segments])))
        decimation = max(self.decimation // 2, 1)
        step = max(decimation, round(length / FILTERED), 2)
        record = self.train.records[0]
        measured, span = sensed(record), step * facts(record).dt
        order = [2 - column for column in measured.columns]
        noise = [
            math.sqrt(math.comb(2 * k, k)) / w / span**k for k, w in zip(order, measured.weights, strict=True)
        ]
        best = int(np.argmin(noise))
        return replace(
            self._only(measured.quantities[best])._sampled_by(1),
            error_filter=acceleration_filter(step, measured.columns[best]),
            decimation=decimation,
            initial=MEASURED,
        )

    def _only(self, quantity: str) -> SegmentedData:
        """Return the same with one output alone, by quantity."""
        if len(sensed(self.train.records[0]).quantities) == 1:
            return self
        pairs = []
        for train, validation in ((self.train, self.validation), *([self.whole] if self.whole else [])):
            one, other = train.only(quantity), validation.only(quantity)
            if validation.records is train.records:
                other = replace(other, records=one.records)
            pairs.append((one, other))
        (train, validation), *whole = pairs
        return replace(self, train=train, validation=validation, whole=whole[0] if whole else None)

    @property
    def short_segments(self) -> SegmentedData:
        """The same by position over segments in which slow forces move nothing far: for parameters alone.

        Disturbance forces blur parameters least there. What hides in a joint or in bristles is not
        determined: their states, re-estimated in every segment, pass for it. No limits: models of any step of
        a ladder begin near.
        """
        return replace(self.level(SHORT), error_filter=None, initial=FREE, limits={})

    @property
    def continued(self) -> SegmentedData:
        """The same with hidden states that go on from segment to segment."""
        return replace(self, initial=CONTINUED)

    @property
    def sampled(self) -> SegmentedData:
        """The same with every second segment to fit, for screening."""
        return replace(self, train=self.train.every(2))

    @property
    def fine(self) -> SegmentedData:
        """The same at the records' full rate, or as many steps of a longer one as do."""
        longest = max(len(r) for view in (self.train, self.validation) for r in view.records)
        decimation = min(max(1, round(longest / FULL_SAMPLES)), self.decimation)
        return replace(self._sampled_by(1), decimation=decimation, full_rate=True, before=self.decimation)

    def coarse(self, decimation: int, step: int) -> SegmentedData:
        """Return the same with `decimation` samples a step of the input, every `step`-th one of the output.

        A filter of errors sees all samples.
        """
        step = step if self.error_filter is None else 1
        return replace(self._sampled_by(step), decimation=decimation)

    def _sampled_by(self, step: int) -> SegmentedData:
        train, validation, *whole = [
            view.decimated(step) for view in (self.train, self.validation, *(self.whole or ()))
        ]
        return replace(
            self, train=train, validation=validation, whole=(whole[0], whole[1]) if whole else None
        )

    def simulator(self, block, record, **keywords) -> Simulator:
        """Return a model on one of the records, as these fits run it."""
        return simulator_of(
            block, record, decimation=self.decimation, initial=self.initial,
            rtol=tolerance(record, self.error_filter is not None), **keywords,
        )  # fmt: skip

    def continues(self, block) -> bool:
        """Whether the block has hidden states that go on from segment to segment."""
        return any(self.simulator(block, r).continued for r in self.train.records)

    def count(self, block, names) -> int:
        """Return the number of values that a fit of these parameters finds."""
        records = len(self.train.records)
        return sum(records if is_own(block.parameters[k]) else 1 for k in names)

    def fit(
        self,
        block,
        names,
        *,
        view=None,
        starts=None,
        iterations=ITERATIONS,
        tolerance=COST_GAIN,
        give_up=math.inf,
        steps_left=0,
        followed=0,
        restarts=True,
    ) -> FitResult:
        """Fit the named parameters over the segments fitted (or those of `view`)."""
        view = view or self.train
        settings = Settings(
            self.limits_of(block), self.about, self.error_filter, self.initial, give_up, steps_left, followed,
            restarts,
        )  # fmt: skip
        how: dict[str, Any] = dict(
            decimation=self.decimation, starts=starts, iterations=iterations, tolerance=tolerance,
            errors=self.full_rate and bool(names), robust=self.robust,
        )  # fmt: skip

        def made() -> FitResult:
            return fit_segments(block, view.records, view.segments, names, settings, **how)

        if not iterations:  # a simulation: to remember it would put fits out
            return made()
        # blocks are equal where what records have for themselves has the same mean
        own = {k: p.value.values for k, p in block.parameters.items() if isinstance(p.value, PerRecord)}
        asked = by_value((block, own, view, tuple(names), replace(settings, give_up=math.inf), how))
        return self.known.of(asked, give_up, made)

    def states_of(
        self, block, *, view=None, starts=None, effort=EFFORT_STATES, followed=0, give_up=math.inf
    ) -> FitResult:
        """Fit the initial states alone; by default, well enough for a fit that goes on from them.

        `effort`: steps at most and the relative gain that is none; `followed`: as for `fit`.
        """
        iterations, tolerance = effort
        return self.fit(
            block, (), view=view, starts=starts, iterations=iterations, tolerance=tolerance,
            followed=followed, give_up=give_up,
        )  # fmt: skip

    def limits_of(self, block) -> dict[str, tuple[float, float]]:
        """Return least and largest values: the model's own, and what the records show of its effects.

        What the model states of a place beyond what they show is kept, as the zero of a spring far outside
        the stroke: they tell nothing against it.
        """
        limits = {k: span for k, span in _shown(block, self.record_scales).items() if k not in self.beyond}
        return limits | {k: _within(span, limits.get(k)) for k, span in self.limits.items()}

    def moved(
        self, found: FitResult, iterations=EFFORT_MOVED_ON[0], tolerance=EFFORT_MOVED_ON[1], give_up=math.inf
    ) -> FitResult:
        """Fit a model found over other segments to these; those that begin at one sample share states."""
        starts = matching_initial_states(found, self.train.segments)
        if not begin_alike(found, self.train.segments):
            # The initial states of new segments first: parameters would bend to make up for them.
            states = self.states_of(found.model, starts=starts, give_up=give_up)
            starts = states.starts
        return self.fit(
            found.model, found.names, starts=starts, iterations=iterations, tolerance=tolerance,
            give_up=give_up,
        )  # fmt: skip

    def as_it_is(self, found: FitResult, *before: FitResult) -> FitResult:
        """Return a model found over other segments over these, with initial states of its own alone.

        Each segment begins as the fit found does, as short ones give or as fits before do, whichever errs
        least.
        """
        starts = [matching_initial_states(f, self.train.segments) for f in (found, *before)]
        begun = [self._ran(found.model), *(self.states_of(found.model, starts=s) for s in starts)]
        return self.fit(found.model, found.names, starts=self._begun_best(begun).starts, iterations=0)

    def _begun_best(self, begun: Sequence[FitResult], view=None) -> FitResult:
        """Return a model begun in several ways with each segment begun as that which errs least in it."""
        starts = better_initial_states(*begun)
        both = self.states_of(begun[0].model, view=view, starts=starts, effort=(0, 0.0))
        return min(*begun, both, key=lambda f: f.rmse)

    def reached(self, found: FitResult, give_up=math.inf) -> FitResult:
        """As `moved`, and started once more where the error grows: the model may have left its minimum.

        What a parameter is off by grows with at least the square of the length of segments, and over long
        ones minima are narrow. Short ones leave a static level open by more than long ones do.
        """
        there = self.moved(found, give_up=give_up)
        if there.rmse <= GROWTH * found.rmse:
            return there
        again = self.fit(found.model, found.names, followed=RESTARTS_KEPT, give_up=there.rmse)
        return self.with_levels(min(there, again, key=lambda f: f.rmse))

    def with_levels(self, found: FitResult) -> FitResult:
        """Return a fit to these segments with its static levels sought over all that records can show."""
        return with_levels_scanned(found, self.fit, self.train.records)

    def validate(self, tried: CandidateFit, give_up: float = math.inf) -> CandidateFit:
        """Run a fitted model over the segments to validate on, from initial states of their own.

        These are not sought to the last where the error would stay above `give_up`. Segments also begin as
        they did for the candidate with other values.
        """
        validation, view = self._ran(tried.block, held_out=True, give_up=give_up), self.validation
        before = tried.validation
        if before is not None and begin_alike(before, view.segments):
            starts = matching_initial_states(before, view.segments)
            again = self.states_of(validation.model, view=view, starts=starts, give_up=give_up)
            validation = self._begun_best([validation, again], view)
        return self.validated_as(replace(tried, unseen=None), validation)

    def validated_as(self, tried: CandidateFit, validation: FitResult) -> CandidateFit:
        """Return a candidate with this fit of the initial states held out."""
        names = tried.train.names

        @cache
        def linear() -> FitResult:
            return self.fit(
                validation.model, names, view=self.validation, starts=validation.starts, iterations=0
            )

        return replace(tried, validation=validation, linear=linear)

    def starts_as(self, block, records, other: FitResult) -> list[np.ndarray]:
        """Return where segments of records begin for a model as they do for another."""
        return [
            continued_states(self.simulator(block, r), w, self.simulator(other.model, r), starts)
            for r, w, starts in zip(records, other.segments, other.starts, strict=True)
        ]

    def evaluated(self, model) -> tuple[Any, float, float]:
        """Return a model as it is with its nrmse over the segments fitted and those held out.

        It then knows what the records held out have for themselves: by that their error is.
        """
        train, validation = self._ran(model), self._ran(model, held_out=True)
        if (names := own_values_of(validation.model)) and not self.parts_held_out:
            # found over short segments; here every one of them counts
            whole = self.fit(
                validation.model, names, view=self.validation, starts=validation.starts, iterations=EFFORT_OWN
            )  # fmt: skip
            validation = min(validation, whole, key=lambda f: f.rmse)
        records = [[r.name for r in view.records] for view in (self.train, self.validation)]
        return knowing(model, validation.model, *records), train.nrmse, validation.nrmse

    def _view(self, held_out: bool) -> SegmentedRecords:
        return self.validation if held_out else self.train

    def _ran(self, model, *, held_out: bool = False, give_up: float = math.inf) -> FitResult:
        """Fit the initial states alone: short segments first, found without fail; the others begin there."""
        step, segments = self.before if self.full_rate else self.decimation, self._view(held_out).segments
        rough = self.coarse(step, step)
        short = rough.level(SHORTEST)._view(held_out)
        near = rough.states_of(model, view=short)
        if held_out and not self.parts_held_out:
            near = reestimated(near, lambda b, n, s, i: rough.fit(b, n, view=short, starts=s, iterations=i))
            model = near.model
        # single segments may have started in a wrong minimum: each goes on by itself
        for data in (rough, self):
            near = data.states_of(
                model, view=data._view(held_out), starts=matching_initial_states(near, segments),
                effort=EFFORT_ALONE, followed=BEGINNINGS_KEPT, give_up=give_up,
            )  # fmt: skip
        return near


def prepare(
    block,
    records: Sequence[Measurement],
    validation: Sequence[Measurement] = (),
    prior=None,
    out: int = 2,
    known: KnownFits | None = None,
) -> SegmentedData:
    """Divide records into segments; without records held out, every third ninth of each is.

    Of records too short for that (parts of a run with gaps) every third is held out as a whole.

    `prior`: value and standard deviation of parameters known beforehand, by name; None of those that a model
    has stated. `out`: which of three parts that follow each other is held out where no records are, 0 to 2.
    `known`: fits made before.
    """
    records = tuple(records)
    if validation:
        train, validate = (
            SegmentedRecords(tuple(rs), tuple(equal_segments(r, _count(r)) for r in rs))
            for rs in (records, validation)
        )
    else:
        train, validate = _divided(records, out)
    decimation = max(1, round(float(np.mean([len(r) for r in records])) / SCREEN_SAMPLES))
    decimation = min(
        decimation, *(max(1, int(facts(r).period / (STROKE_SAMPLES * facts(r).dt))) for r in records)
    )
    step, decimation = decimation, decimable((*records, *validation), decimation)
    scales, about = scales_of(block, records), priors(block, prior)
    limits = {
        k: _range(p.value, about[k].value)
        for k, p in block.parameters.items()
        if p.lower >= 0 and p.value > 0
    }
    seen = seen_by(block, records, scales)
    table, shown = block.parameters, _shown(block, seen)
    beyond = frozenset(
        k
        for k, (low, high) in shown.items()
        if k in table and k not in limits and not low <= table[k].value <= high
    )
    known = known or KnownFits()
    data = SegmentedData(train, validate, 1, scales, limits, about, seen, known, beyond=beyond)
    return data.coarse(decimation, step)


def _divided(records: tuple[Measurement, ...], out: int) -> tuple[SegmentedRecords, SegmentedRecords]:
    """Return segments to fit and to hold out: every third part of records, every third of short ones."""
    whole = [equal_segments(r, HOLDOUT_PARTS * max(round(_count(r) / HOLDOUT_PARTS), 1)) for r in records]
    third = [_of_three(np.arange(len(w)) * HOLDOUT_PARTS // len(w), out) for w in whole]
    short = [i for i, t in enumerate(third) if not np.any(t) or np.all(t)]
    for n, i in enumerate(short):
        whole[i], third[i] = equal_segments(records[i], 1), _of_three(np.array([n]), out)
    fitted, held_out = (
        [(r, w.only(t)) for r, w, t in zip(records, whole, chosen, strict=True) if np.any(t)]
        for chosen in ([~t for t in third], third)
    )
    if not (fitted and held_out):
        raise ValueError(
            "diagnose needs a record of at least 180 samples, or three shorter ones, where none is held "
            f"out; got {len(records)}, of up to {max(map(len, records))} samples. Give holdout=, or a longer "
            "record."
        )
    # see `SegmentedData.parts_held_out`
    train, validate = (
        SegmentedRecords(tuple(r for r, _ in part) if short else records, tuple(w for _, w in part))
        for part in (fitted, held_out)
    )
    return train, validate


def _of_three(parts: np.ndarray, out: int) -> np.ndarray:
    """Return which parts, by their numbers from 0, are this one of three that follow each other."""
    return parts % 3 == out


def _shown(block, seen: RecordScales) -> dict[str, tuple[float, float]]:
    """Return the ranges of a block's parameters in which the records show something of its effects."""
    return {
        f"{key}.{name}": span
        for key, effect in block.named_effects.items()
        for name, span in effect.ranges(seen).items()
    }


def _range(value: float, stated: float) -> tuple[float, float]:
    """Return where a parameter may lie: about the value stated, or about its own, once that has left it."""
    about = stated if stated / PARAMETER_RANGE <= value <= stated * PARAMETER_RANGE else value
    return about / PARAMETER_RANGE, about * PARAMETER_RANGE


def _within(own, shown) -> tuple[float, float]:
    """Return what both ranges have in common, or the model's own where that is nothing."""
    if shown is None:
        return own
    low, high = max(own[0], shown[0]), min(own[1], shown[1])
    return (low, high) if low < high else own


def _count(record) -> int:
    """Return the number of segments: two to-and-fro motions and a half each, 60 samples at least."""
    known, n = facts(record), len(record)
    fewest, most = SEGMENTS
    length = max(SEGMENT_MOTIONS * known.period, SEGMENT_USUAL * record.duration / n)
    return int(min(max(round(record.duration / length), fewest), most))
