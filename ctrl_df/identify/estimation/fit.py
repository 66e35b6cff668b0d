"""Fit a model to records: stages from short segments and a decimated input to whole ones at full rate."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from ...cached import cached_property
from ...thresholds import NOTHING
from ..data.measurement import Measurement
from ..prediction.decimated import decimable
from ..prediction.segments import Segments, make_segments
from ..prediction.simulators import simulator_of
from ..prediction.values import block_of, has_many_minima, with_values
from ..shooting.least_squares import Solution, Stage
from ..shooting.noise_model import NoiseModel
from ..shooting.problem import USUAL, Problem, Settings
from ..shooting.sigma_points import sigma_points
from ..shooting.thresholds import AT_BOUND, ON_BOUND
from ..shooting.variables import default_free, priors, step_of_sensor
from ..thresholds import ONLY_NOISE
from .covariance import covariance_of
from .lengths import segment_lengths, shorter_lengths
from .own_values import OwnValue, at_bounds, by_name, merged, own_values, parts_of, weights_of
from .sensitivity import OutputSensitivity
from .thresholds import (
    COST_GAIN,
    DECIMATION,
    EFFORT_SHORT,
    ITERATIONS,
    RECORDS_BUDGET,
    RESTARTS_KEPT,
    UNCOUNTED,
)


@dataclass(frozen=True, eq=False)
class FitResult:
    """Outcome of `fit_records`.

    Attributes
    ----------
    model : block
        With the parameters found.
    records : tuple of str
        Names of the records.
    names, values : tuple of str, tuple of float
        The free parameters. Of those that every record has for itself (`PerRecord`) what follows is of their
        mean over the records, weighted by one over the variance where that is known.
    covariance : (p, p) array
        Of `values`, for residuals of the spectrum seen, within the directions that the data determine.
    residual, simulated : list of (n,) array
        Per record, measured minus simulated.
    count : int
        Values that the cost is of.
    unit : float
        Of these values, where they are not in the unit of `rmse`.
    error_filter : NoiseModel or None
        What the cost sees of the output where it is of forces (see `fit_segments`).
    rmse, nrmse : float
        Error over all records; nrmse over the rms of the centred outputs. Where the cost is of forces (see
        `fit_segments`): rms of the acceleration that is wrong [output unit/s^2], and over that measured.
    nfev : int
        Simulations of all records together.
    converged : bool
        Whether the last step promised less than a thousandth of the cost.
    given_up : bool
        Whether the limit of its error has ended it, or the search of some initial states.
    at_bound : tuple of bool
        Per parameter; of those that every record has for itself, whether it stands there in all of them.
    null : list of (float, list of (str, str or None, float))
        Directions that the data do not determine: relative singular value, and what takes part, by name and
        record (None: shared by all), with its move in scaled parameters.
    scale : (p,) array
        Natural scale of each parameter that may be zero, 0 of the others: what is known to a small part of it
        is known, though it be next to nothing.
    slopes : (pv,) array
        Derivatives of the parameters by the scaled ones that `sensitivity` is of: as many as `names`, unless
        records have some for themselves.
    own : mapping of str to mapping of str to OwnValue
        Of the parameters that every record has for itself: by name, then by record.
    starts : list of (nw, ns) array
        Initial states, as corrections (see `Simulator.run`).
    segments : list of Segments
        Where the model was restarted.
    linear : callable or None
        Works out `sensitivity`, once it is asked for.
    about : callable or None
        Works out `sigma_points`, given the curvature of the cost and the variance of the error.
    """

    model: Any
    records: tuple[str, ...]
    names: tuple[str, ...]
    values: tuple[float, ...]
    covariance: np.ndarray
    residual: list
    simulated: list
    count: int
    unit: float
    error_filter: NoiseModel | None
    rmse: float
    nrmse: float
    nfev: int
    converged: bool
    given_up: bool
    at_bound: tuple[bool, ...]
    null: list
    scale: np.ndarray
    slopes: np.ndarray
    own: Mapping[str, Mapping[str, OwnValue]]
    starts: list
    segments: list
    linear: Callable[[], OutputSensitivity] | None = field(repr=False, default=None)
    about: Callable[..., list[dict[str, float]]] | None = field(repr=False, default=None)

    @property
    def bytes(self) -> int:
        """Size of its residual and output, and of their derivatives by parameters and initial states."""
        columns = len(self.slopes) + self.starts[0].shape[1]
        derivatives = sum(columns * e.nbytes for e in self.residual)
        return derivatives + sum(e.nbytes for e in (*self.residual, *self.simulated))

    @cached_property
    def sensitivity(self) -> OutputSensitivity | None:
        """The fitted model as a linear map of its parameters and initial states; None without parameters."""
        return self.linear() if self.linear is not None and self.names else None

    def starts_open(self, k: int) -> np.ndarray | None:
        """Return how far white noise of variance 1 leaves the initial states of a record open.

        See `OutputSensitivity.starts_open`; None where they were not fitted.
        """
        return None if self.linear is None else self.linear().starts_open(k)

    @property
    def sigma_points(self) -> list[dict[str, float]]:
        """Values one standard error off, for white errors, along every principal axis of the covariance."""
        if self.sensitivity is None or self.about is None:
            return []
        slopes = np.concatenate(self.sensitivity.parameters)
        return self.about(slopes.T @ slopes, max((self.rmse * self.unit) ** 2, NOTHING))

    def points_off(self, errors: float) -> list[dict[str, float]]:
        """Return values so many standard errors off, to both sides along every axis of the covariance.

        Empty where the covariance is not of what was fitted, each parameter for all records.
        """
        if self.about is None or len(self.slopes) != len(self.names) or not np.all(self.slopes):
            return []
        precision = np.linalg.pinv(self.covariance / np.outer(self.slopes, self.slopes), hermitian=True)
        return self.about(precision, errors**2)

    def __getstate__(self):
        # what works them out stays behind with the simulations of the fit
        return {**self.__dict__, "linear": None, "about": None}

    @property
    def residual_pieces(self) -> list[np.ndarray]:
        """The residual as evidence takes it: of each output of a record, or, of forces, each segment."""
        return self._pieces(self.residual)

    @property
    def simulated_pieces(self) -> list[np.ndarray]:
        """The simulated output, as `residual_pieces`."""
        return self._pieces(self.simulated)

    @property
    def response_pieces(self) -> list[np.ndarray]:
        """Derivatives of the output by the parameters, as `residual_pieces`; none without parameters."""
        if self.sensitivity is None:
            return []
        return self._pieces([columns / self.slopes for columns in self.sensitivity.responses])

    @property
    def squares(self) -> list[float]:
        """Per record, the sum of squares of what the cost sees."""
        errors = self.residual
        if self.error_filter is not None:
            filtered = self.error_filter.filtered
            errors = [filtered(x, w.slices) for x, w in zip(self.residual, self.segments, strict=True)]
        return [float(e @ e) for e in errors]

    @property
    def spanned(self) -> int:
        """How many samples of the records the segments span, those left out included."""
        return sum(int(np.sum(w.stop - w.first)) for w in self.segments)

    @property
    def outputs(self) -> int:
        """How many outputs the records hold."""
        return self.segments[0].outputs

    def _pieces(self, signals) -> list[np.ndarray]:
        if self.error_filter is not None:
            return self.by_segment(signals)
        return [x[b] for w, x in zip(self.segments, signals, strict=True) for b in w.blocks]

    def with_errors(self, errors: Mapping[str, float]) -> FitResult:
        """Return the same with further standard errors of some parameters, beside what slopes tell of them.

        Where slopes tell nothing, these are all there is: in a null direction of such parameters alone. In
        one with others they do not tell the value.
        """
        if not len(self.covariance):
            return self
        covariance, undetermined = self.covariance.copy(), in_null_directions(self)
        for name, error in errors.items():
            i = self.names.index(name)
            if name in undetermined:
                covariance[i, :] = covariance[:, i] = 0.0
            covariance[i, i] += error**2
        null = [(size, parts) for size, parts in self.null if not {k for k, *_ in parts} <= set(errors)]
        return replace(self, covariance=covariance, null=null)

    @property
    def segment_powers(self) -> list[np.ndarray]:
        """Mean squares of the residual in each segment, by record."""
        return [w.means(e**2) for w, e in zip(self.segments, self.residual, strict=True)]

    @property
    def segment_of(self) -> list[np.ndarray]:
        """Of every sample of `residual_pieces` the number of its segment, counted over all records."""
        first, found = 0, []
        for w in self.segments:
            numbers = first + np.arange(len(w))
            parts = [np.repeat(numbers, w.counts)]
            if self.error_filter is not None:
                parts = [np.full(n, k) for k, n in zip(numbers, w.counts, strict=True)]
            found += parts * w.outputs
            first += len(w)
        return found

    def by_segment(self, signals) -> list[np.ndarray]:
        """Return signals, one a record, segment by segment."""
        return [x[where] for w, x in zip(self.segments, signals, strict=True) for where in w.slices]

    @property
    def parameters(self) -> dict[str, float]:
        """Free parameters by name."""
        return dict(zip(self.names, self.values, strict=True))

    @property
    def standard_errors(self) -> dict[str, float]:
        """Standard errors by name; infinite where the data do not determine a parameter."""
        return dict(zip(self.names, np.sqrt(np.diag(self.whole_covariance)).tolist(), strict=True))

    @property
    def names_at_bound(self) -> set[str]:
        """Parameters that end at a bound of their range."""
        return {name for name, bound in zip(self.names, self.at_bound, strict=True) if bound}

    @property
    def whole_covariance(self) -> np.ndarray:
        """The covariance, infinite and by itself for parameters that take part in a null direction."""
        if not len(self.covariance):
            return self.covariance
        found = self.covariance.copy()
        part = in_null_directions(self)
        lost = np.array([name in part for name in self.names])
        found[lost], found[:, lost] = 0.0, 0.0
        found[lost, lost] = math.inf
        return found


def in_null_directions(found: FitResult) -> set[str]:
    """Return the parameters in a null direction but those that every record has for itself."""
    return {name for _, parts in found.null for name, _, _ in parts if name not in found.own}


def fit_records(
    model,
    records: Sequence[Measurement],
    start: Mapping[str, float] | None = None,
    free: Sequence[str] | None = None,
    *,
    budget: int = RECORDS_BUDGET,
    lengths: Sequence[float | None] | None = None,
    decimation: int = DECIMATION,
    polish: int = 2,
    coarse: bool | None = None,
    robust: bool = True,
    starts: Sequence[np.ndarray] | None = None,
    tolerance: float = COST_GAIN,
    central: bool = False,
    iterations: int = ITERATIONS,
    prior: Mapping[str, tuple[float, float | None]] | None = None,
) -> FitResult:
    """Fit a model to records, fast.

    Parameters
    ----------
    model : block or loop
        Structure and start values.
    records : sequence of Measurement
    start : mapping or None
        Parameters that start elsewhere than the model's own values (all others keep theirs).
    free : sequence of str or None
        Parameters to move; None: `default_free`.
    budget : int
        Bound on the simulations of all records.
    lengths : sequence of float or None
        Of the segments of each record [s] (see `segment_lengths`); None: those of its mode "auto".
    decimation : int
        Samples a step of the input in all but the last iterations, at most; 1: never decimated.
    polish : int
        Iterations at full rate at the end; 0 leaves the fit at the decimated input.
    coarse : bool or None
        Whether to begin with short segments, which converge from far off; None: unless `start` is given.
    robust : bool
        Huber's loss beyond four times the median deviation.
    starts : sequence of arrays or None
        Initial states of an earlier fit with the same segments, to begin with.
    tolerance : float
        Relative decrease of the cost that is not worth another iteration.
    central : bool
        Whether the last Jacobian is by central differences.
    iterations : int
        Bound on the iterations over the full segments.
    prior : mapping or None
        Value and standard deviation of parameters known beforehand; of the others see `Prior`.
    """
    records = list(records)
    decimation = decimable(records, decimation)
    model = with_values(model, start)
    first, block = simulator_of(model, records[0]), block_of(model)
    names = tuple(default_free(block) if free is None else free)
    lengths = segment_lengths(model, records) if lengths is None else lengths
    about = priors(block, prior) if names else {}
    problem = Problem(model, records, names, budget, Settings(about=about, followed=RESTARTS_KEPT))
    theta = problem.start()
    if coarse is None:
        coarse = start is None
    if coarse and names and not first.closed:
        for short in shorter_lengths(first, records, lengths):
            stage = Stage(problem, _cut(records, short), decimation)
            theta = stage.solve(theta, *EFFORT_SHORT, robust=False).theta
    stage = Stage(problem, _cut(records, lengths), decimation if polish else max(decimation, 1), starts)
    found = stage.solve(theta, iterations=iterations, tolerance=tolerance, robust=robust)
    if polish and decimation > 1:
        stage = Stage(problem, stage.segments, 1, found.states.values)
        found = stage.solve(found.theta, iterations=polish, tolerance=tolerance, robust=robust)
        error = stage.error(found.residual)
        if names and has_many_minima(model) and error > ONLY_NOISE * problem.noise:
            directly = Stage(problem, stage.segments, 1, starts)
            begun = directly.solve(theta, 0, tolerance, robust, restarts=False)
            if directly.error(begun.residual) < error:
                # longer steps of the input have led away from a better minimum
                stage = Stage(problem, stage.segments, 1, begun.states.values)
                found = stage.solve(theta, iterations=iterations, tolerance=tolerance, robust=robust)
    if names:
        found = _with_slopes(stage, found, central)
    return _outcome(stage, found, errors=True)


def fit_segments(
    model,
    records: Sequence[Measurement],
    segments: Sequence[Segments],
    names: Sequence[str],
    settings: Settings = USUAL,
    *,
    decimation: int = DECIMATION,
    starts: Sequence[np.ndarray] | None = None,
    iterations: int = ITERATIONS,
    tolerance: float = COST_GAIN,
    robust: bool = False,
    errors: bool = False,
) -> FitResult:
    """Fit the named parameters over given segments in one stage.

    Parameters
    ----------
    model : block
    records, segments : sequences
        Records and the parts of each that count.
    names : sequence of str
        Parameters to move; an empty one fits the initial states alone.
    settings : Settings
    decimation : int
        Samples a step of the input.
    starts : sequence of arrays or None
        Initial states to begin with.
    iterations, tolerance, robust
        As for `fit_records`; with no iterations the model stays as it is, and is made linear there.
    errors : bool
        Whether to work out the covariance (where the model is fitted, from central differences), else it is
        empty; and for initial states alone these derivatives (`FitResult.starts_open`).

    Returns
    -------
    FitResult
    """
    problem = Problem(model, records, names, UNCOUNTED, settings)
    stage = Stage(problem, list(segments), decimation, starts)
    restarts = iterations > 0 and settings.restarts
    found = stage.solve(
        problem.start(), iterations=iterations, tolerance=tolerance, robust=robust, restarts=restarts
    )
    moved = names or (errors and any(a.size for a in found.states.values))
    # differences to one side hide directions along which the output stays as it is; of a model taken as it is
    # steps are not fitted to what the output does, and reach over more events to two sides than to one
    central = errors and bool(names) and iterations > 0
    if moved and (central or found.slopes is None):
        found = _with_slopes(stage, found, central)
    if step_of_sensor(problem.block) is not None:
        found = replace(found, residual=stage.rounded(found.theta, found.states.values))
    return _outcome(stage, found, errors)


def _cut(records, lengths) -> list[Segments]:
    return [make_segments(r, n) for r, n in zip(records, lengths, strict=True)]


# --- the answer -----------------------------------------------------------------------------------


def _with_slopes(stage: Stage, found: Solution, central: bool = False) -> Solution:
    """Return a solution with derivatives about itself, in place of those before its last step."""
    base = [m - e for m, e in zip(stage.measured, found.residual, strict=True)]
    return replace(found, slopes=stage.jacobian(found.theta, found.states, base, central))


def _outcome(stage: Stage, found: Solution, errors: bool) -> FitResult:
    """Return the outcome of a fit; `errors`: with covariance, from the derivatives of its last step."""
    problem, theta, residual = stage.problem, found.theta, found.residual
    covariance, null, linear = np.zeros((0, 0)), [], None
    slopes = np.array([v.slope(q) for v, q in zip(problem.variables, theta, strict=True)])
    if found.slopes is not None:
        by_parameter = [problem.in_columns(k, slopes) for k, slopes in enumerate(found.slopes[0])]
        parts = (stage.segments, stage.precision(found.states), problem.settings.error_filter)
        linear = partial(OutputSensitivity, by_parameter, found.slopes[1], *parts)
        if errors and problem.names:
            covariance, null = covariance_of(stage, found, linear())
            covariance = covariance * np.outer(slopes, slopes)
    weights = weights_of(problem, covariance, null)
    values = problem.named(theta, weights)
    at_bound = at_bounds(problem, theta, _at_bound)
    scale = np.array([0.0 if v.log else max(v.scale, v.natural) for v in problem.variables])
    problem.finish()
    total, count = stage.power(residual)
    spread, _ = stage.power([w.centred(y) for w, y in zip(stage.segments, stage.measured, strict=True)])
    return FitResult(
        model=with_values(problem.model, values),
        records=tuple(r.name for r in problem.records),
        names=problem.names,
        values=tuple(values[k] for k in problem.names),
        covariance=merged(problem, covariance, weights),
        residual=residual,
        simulated=[m - e for m, e in zip(stage.measured, residual, strict=True)],
        count=count,
        unit=problem.unit,
        error_filter=problem.settings.error_filter,
        rmse=math.sqrt(total / count),
        nrmse=math.sqrt(total / spread),
        nfev=round(problem.nfev),
        converged=found.converged,
        given_up=bool(problem.given_up),
        at_bound=tuple(by_name(problem, at_bound, all)),
        null=[(size, parts_of(problem, direction)) for size, direction in null],
        scale=np.array(by_name(problem, scale, max)),
        slopes=slopes,
        own=own_values(problem, values, covariance, null, at_bound, scale),
        starts=found.states.values,
        segments=stage.segments,
        linear=linear,
        about=partial(_values_about, problem, theta),
    )


def _values_about(problem: Problem, theta, curvature, variance) -> list[dict[str, float]]:
    """Return the values by name at the `sigma_points` about a fit."""
    points = sigma_points(problem.variables, theta, problem.precision, curvature, variance)
    return [problem.named(q) for q in points]


def _at_bound(variable, q, value) -> bool:
    return bool(
        not (variable.has_room(q, AT_BOUND) and variable.has_room(q, -AT_BOUND))
        or abs(value - variable.p(q)) > ON_BOUND * variable.scale
    )
