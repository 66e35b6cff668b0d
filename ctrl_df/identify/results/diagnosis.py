"""What a diagnosis answers: the verdict, the candidates in order, and how sure it is."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

from ...blocks.effect import Effect
from ...cached import cached_property
from ...drawing import draw, go_on
from ...numerals import certainty as sure
from ...numerals import digits, percent
from ...table import Brief
from ..data.measurement import Measurement
from ..monitor import COMPLETE, UNDER_WAY
from ..residuals.horizons import ErrorByHorizon, error_by_horizon
from ..thresholds import RULED_OUT
from .thresholds import SHOWN_PROBABILITY

CALIBRATED = (
    "These are posterior probabilities of the candidates, which are equally probable a priori, and of "
    "nothing being missing, whose prior odds over each candidate are the likelihood ratio from which an "
    "effect is significant; likelihoods are of whitened residuals. Checked on virtual rigs of an independent "
    "generator (benchmarks/second.py; figures and rigs in docs/calibration.md): 993 rigs with one hidden "
    "effect, named first in 95 %; 464 with nothing hidden, verdict none in 98 %; of 495 statements made with "
    "a probability of 95 % or more, 97 % were right. This has not been counted on real machines: there a "
    "probability holds only if the true law is among the candidates."
)
"""On what the probabilities rest, in words; the counts are those of docs/calibration.md."""

_WHICH = (
    "nrmse: rms error over rms of the {of}, over the segments of {over}, each from a fitted initial state. "
    "{others} segments of its own, or a free run, so that its nrmse of the same model differs."
)
"""Why one model has several errors; said where they are printed."""

EFFECT, AMBIGUOUS, NONE, UNKNOWN = "effect", "ambiguous", "none", "unknown"


NOTHING_KNOWN = (
    "Nothing is known yet: it ended before the model was refitted and the first effects were tried. The "
    "model is as it was given."
)
"""What is said of a diagnosis that ended before its first result."""


def require_known(error: float) -> None:
    """Refuse to show the errors of a model that was not fitted any more."""
    if math.isnan(error):
        raise ValueError(
            "a picture or report needs errors; got a result that ended before the first was known. "
            "Repeat the call, and let it run until its callback is called."
        )


def which_errors(measure: str, ladder: bool = False) -> str:
    """Return which errors a ranking or ladder has; nothing for a table N(A, omega), which has one alone."""
    if measure == "N":
        return ""
    if ladder:
        return _WHICH.format(
            of=measure, over="the last search", others="The diagnosis of each step has, as compare(),"
        )
    return _WHICH.format(of=measure, over="this search", others="compare() uses")


@dataclass(frozen=True, eq=False)
class Predicting:
    """A model and the records that its free prediction is compared with.

    Attributes
    ----------
    model : block
        The refitted one.
    predicted : (block, tuple of Measurement) or None
        What is to be predicted, and by which model: that of `model`, angles of the records its own. None
        where there is nothing to predict (a table).
    """

    model: Any = None
    predicted: tuple[Any, tuple[Measurement, ...]] | None = field(default=None, repr=False, kw_only=True)

    @cached_property
    def error_by_horizon(self) -> ErrorByHorizon | None:
        """Error of free prediction against its length, up to the whole record; worked out when asked for.

        Of the records held out, or of those fitted where there are none; None for a table.
        """
        return None if self.predicted is None else error_by_horizon(*self.predicted)


@dataclass(frozen=True, eq=False)
class Baseline(Predicting):
    """The refitted model without any of the candidates, and its errors.

    Attributes
    ----------
    nrmse, nrmse_holdout : float
        As of a `CandidateEffect`.
    """

    nrmse: float = math.nan
    nrmse_holdout: float = math.nan


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class CandidateEffect(Brief, Predicting):
    """One effect of the library, fitted to the data.

    Attributes
    ----------
    effect : Effect
        With fitted parameters.
    id : str
        Canonical id.
    nrmse, nrmse_holdout : float
        Error of the block with this effect on training and on held-out data, over the rms of the centred
        output.
    evidence : float
        Log-likelihood ratio over the refitted baseline, less the penalty for its parameters (Schwarz). Of
        several segments held out the one that speaks most for the effect does not count.
    probability : float
        Among all candidates, equal before the data, and "nothing missing", of which the prior odds are the
        evidence that chance makes: an effect that is not significant is less likely than nothing. 0 of
        candidates that are not confirmed.
    parameters : dict
        Fitted parameters of the effect.
    equivalents : tuple of str
        Ids of candidates with the same output on these data, within noise.
    model : block
        The refitted block with the effect.
    evidence_fitted : float
        Evidence of the data fitted alone, with a noise of their own.
    evidence_holdout : float
        Log-likelihood ratio on the held-out data alone, without the same segment.
    confirmed : bool
        Whether it was refitted at the full rate and tried on held-out data. The best few are; of a model that
        leaves only noise only those that come near to being significant.
    errors : dict
        Standard errors of `parameters`, for residuals of any spectrum; only of confirmed candidates.
    undetermined : tuple of str
        Parameters of the effect that the data do not determine: at a bound of their range, or less certain
        than they are large.
    displaced : tuple of str
        Parameters of the model that end at a bound of their range with the effect, and do not without it.

    Examples
    --------
    >>> names = ["constant_force", "quadratic_drag"]
    >>> t = np.arange(0, 4, 0.01)
    >>> F = 9 * np.sin(3 * t) + 5 * np.sin(8 * t)
    >>> machine = cdf.friction_mass(2.2, 3.0, 6.0).with_effect(cdf.ConstantForce(1.0))
    >>> x = np.asarray(cdf.event_response(machine, t, F, input_hold="zoh").outputs)[0]
    >>> record = cdf.Measurement(t, F, x + 1e-4 * np.random.default_rng(1).standard_normal(t.size))
    >>> best = cdf.diagnose(cdf.friction_mass(2.0, 2.5, 5.0), record, candidates=names).best
    >>> best.id, best.confirmed, best.probability > 0.99
    ('constant_force', True, True)
    """

    effect: Effect
    id: str
    nrmse: float
    nrmse_holdout: float
    evidence: float
    probability: float
    parameters: Mapping[str, float]
    equivalents: tuple[str, ...] = ()
    confirmed: bool = False
    errors: Mapping[str, float] = field(default_factory=dict)
    evidence_fitted: float = 0.0
    evidence_holdout: float = 0.0
    undetermined: tuple[str, ...] = ()
    displaced: tuple[str, ...] = ()

    @property
    def determined(self) -> bool:
        """Whether it is confirmed, and the data determine all parameters of the effect."""
        return self.confirmed and not self.undetermined

    @property
    def size_undetermined(self) -> bool:
        """Whether the data leave the size of the effect open, its first parameter."""
        return next(iter(self.parameters), None) in self.undetermined

    def __str__(self) -> str:
        known = f"probability {sure(self.probability)}" if self.confirmed else "not confirmed"
        return f"{self.id}, nrmse {percent(self.nrmse)}, held out {percent(self.nrmse_holdout)}, {known}"


def _number(value: float) -> str:
    """Return an error as the table shows it; of what is not known a dash."""
    return "-" if math.isnan(value) else f"{value:.3g}"


def rivals(ranking) -> list[CandidateEffect]:
    """Return the confirmed candidates that the data hardly tell from the first."""
    first = ranking[0]
    return [c for c in ranking[1:] if c.confirmed and first.evidence - c.evidence < RULED_OUT]


def certainty(ranking) -> float:
    """Return the probability of the first candidate and its equivalents together."""
    first = ranking[0]
    return first.probability + sum(c.probability for c in ranking if c.id in first.equivalents)


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosis(Brief):
    """What is missing in a model, or that nothing is.

    Attributes
    ----------
    verdict : {'effect', 'ambiguous', 'none', 'unknown'}
        One effect (or one class of equivalent effects) is missing; several candidates remain; nothing is
        missing; something outside the library is.
    ranking : tuple of CandidateEffect
        Best first.
    baseline : Baseline
        The refitted model without any of them: `model`, `nrmse`, `nrmse_holdout`, `error_by_horizon`.
    noise, structure : float
        Of the best candidate's residual (of the refitted model's where that is refuted): rms of noise and of
        what the model still misses [unit of `measure`].
    measure : {'output', 'acceleration', 'N'}
        What all errors are of: the output, or (where disturbance forces, such as friction that drifts,
        outweigh the noise of the sensor) its acceleration, averaged over some samples.
    remains : str
        Of 'unknown' over time: how much the library does not explain, and where, in sentences.
    status : {'complete', 'under way', 'budget spent', 'interrupted'}
        How far the diagnosis came. Before it is complete the verdict is of what is known: at most 'ambiguous'
        as long as nothing is confirmed.
    doubts : tuple of str
        Why the first of the ranking is not named although the evidence is for it, or why more than that
        effect may be missing, in sentences.
    held_out_only : bool
        Of 'unknown' over time: whether the model follows the fitted data to their noise, so that what is
        missing acts in the held-out data alone, and no fit can find it.

    Examples
    --------
    >>> names = ["constant_force", "quadratic_drag"]
    >>> t = np.arange(0, 4, 0.01)
    >>> F = 9 * np.sin(3 * t) + 5 * np.sin(8 * t)
    >>> machine = cdf.friction_mass(2.2, 3.0, 6.0).with_effect(cdf.ConstantForce(1.0))
    >>> x = np.asarray(cdf.event_response(machine, t, F, input_hold="zoh").outputs)[0]
    >>> record = cdf.Measurement(t, F, x + 1e-4 * np.random.default_rng(1).standard_normal(t.size))
    >>> diagnosis = cdf.diagnose(cdf.friction_mass(2.0, 2.5, 5.0), record, candidates=names)
    >>> [candidate.id for candidate in diagnosis.ranking]
    ['constant_force', 'quadratic_drag']
    """

    screened: ClassVar[str] = "screened over some of the segments, its error is of these alone"
    """Of a candidate that is not confirmed."""

    verdict: str
    ranking: tuple[CandidateEffect, ...]
    model: Any
    baseline: Any
    nrmse: float
    nrmse_holdout: float
    noise: float
    structure: float
    explanation: str
    regions: tuple[str, ...]
    where: Any
    train: tuple[Measurement, ...]
    holdout: tuple[Measurement, ...]
    seconds: float = 0.0
    limits: Mapping[str, float] = field(default_factory=dict)
    measure: str = "output"
    remains: str = ""
    status: str = COMPLETE
    doubts: tuple[str, ...] = ()
    held_out_only: bool = False

    @classmethod
    def unknown(cls, model, train, holdout, limits):
        """Return what is known before the first result: the model as it was given."""
        nothing = Baseline(model)
        return cls(
            UNKNOWN, (), model, nothing, math.nan, math.nan, math.nan, math.nan, NOTHING_KNOWN, (), None,
            tuple(train), tuple(holdout), limits=limits, status=UNDER_WAY,
        )  # fmt: skip

    @property
    def calibrated(self) -> str:
        """On what the probabilities of the ranking rest."""
        return CALIBRATED

    @property
    def best(self) -> CandidateEffect | None:
        """The first of the ranking; None where nothing is missing."""
        return None if self.verdict == NONE or not self.ranking else self.ranking[0]

    @property
    def remaining(self) -> tuple[CandidateEffect, ...]:
        """Candidates the data leave open."""
        if self.verdict == NONE:
            return ()
        return (
            tuple(c for c in self.ranking if c.confirmed and c.probability > SHOWN_PROBABILITY)[:4]
            or self.ranking[:2]
        )

    @property
    def next_experiment(self):
        """The input that would separate the candidates that remain; see `ctrl_df.identify.experiment`."""
        return go_on("next experiment", self)

    @property
    def names_effects(self) -> bool:
        """Whether one of the ranking is missing; if not, or not known yet, probabilities say nothing."""
        return self.verdict in (EFFECT, AMBIGUOUS) and self.status == COMPLETE

    def table(self, rows: int = 8) -> str:
        """Return the ranking as text."""
        shown = self.ranking[:rows]
        names = [" = ".join(filter(None, (c.id, ", ".join(c.equivalents)))) for c in shown]
        none = "(none: refitted)"
        w = max(map(len, (none, *names)))
        named = self.names_effects
        probable = f" {'prob.':>7}" if named else ""
        lines = [f"{'effect':<{w}} {'nrmse':>9} {'held out':>9} {'evidence':>9}{probable}  parameters"]
        lines.append(f"{none:<{w}} {self.nrmse:>9.3g} {_number(self.nrmse_holdout):>9} {0:>9.1f}")
        for name, c in zip(names, shown, strict=True):
            its = (
                c.model.parameters
            )  # of two bodies a joint divides none: its share of a mass is no parameter
            values = ", ".join(
                f"{k} {digits(v, 4)}" for k, v in c.parameters.items() if f"{c.model.newest}.{k}" in its
            )
            probable = f" {sure(c.probability) if c.confirmed else '-':>7}" if named else ""
            errors = f"{c.nrmse:>9.3g} {_number(c.nrmse_holdout):>9}"
            lines.append(f"{name:<{w}} {errors} {c.evidence:>9.1f}{probable}  {values}")
        if any(not c.confirmed for c in shown):
            lines.append(f"-: {self.screened}")
        if any(c.equivalents for c in shown):
            lines.append("a = b: the records do not tell them apart")
        return "\n".join(lines)

    def plot(self, **keywords):
        """Draw the ranking and the residual before and after; returns a ``ct.ControlPlot``."""
        require_known(self.nrmse)
        return draw("diagnosis", self, **keywords)

    def __str__(self) -> str:
        how = "" if self.status == COMPLETE else f" ({self.status})"
        lines = f"{self.verdict}{how}: {self.explanation}", self.table(), which_errors(self.measure)
        return "\n".join(filter(None, lines))
