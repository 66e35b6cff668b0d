"""The ladder, over time and over the (A, omega) plane alike: its steps, and the study that they make."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from ...blocks.effect import Effect
from ...drawing import draw, go_on
from ...numerals import percent
from ...table import Brief
from ..monitor import COMPLETE
from .diagnosis import EFFECT, NONE, UNKNOWN, Diagnosis, require_known, which_errors
from .explain import driven_to_bounds, moved_to_load, named
from .neighbours import Neighbours
from .thresholds import LEAST_WIDTH


@dataclass(frozen=True, eq=False, repr=False)
class Step(Brief):
    """One model of the ladder.

    Attributes
    ----------
    effect : str
        Id of the effect added; empty for the refitted start, and where others were exchanged or dropped.
    dropped : tuple of str
        Ids of effects added earlier that are no longer needed, or that others replace.
    instead : tuple of str
        Ids of the effects that replace them.
    model : block
    nrmse, nrmse_holdout : float
        Over segments with fitted starts.
    evidence : float
        Log-likelihood ratio over the step before.
    parameters : dict
        All parameters of the model.
    equivalents : tuple of str
        Ids of effects that make the same output on these data, within noise, in the place of the step's own:
        in the last model, as far as it was tried there, else at this step.
    diagnosis : Diagnosis
        The diagnosis of the model of this step; of a step under way, until it is known, the one that led to
        it.
    """

    effect: str = ""
    dropped: tuple[str, ...] = ()
    model: Any = None
    nrmse: float = math.nan
    nrmse_holdout: float = math.nan
    evidence: float = 0.0
    parameters: Mapping[str, float] = field(default_factory=dict)
    equivalents: tuple[str, ...] = ()
    diagnosis: Diagnosis | None = None
    instead: tuple[str, ...] = ()

    @property
    def explanation(self) -> str:
        """What the diagnosis says of this model; empty where it is only of the one that led to it."""
        if self.diagnosis is None:
            return ""
        ours, theirs = ([e.id for e in m.effects] for m in (self.model, self.diagnosis.model))
        return self.diagnosis.explanation if ours == theirs else ""

    @property
    def changes(self) -> list[tuple[str, str]]:
        """What became of effects added earlier: sign and id."""
        return [*(("-", d) for d in self.dropped), *(("+", d) for d in self.instead)]

    @property
    def signs(self) -> tuple[str, ...]:
        """What the step did: every id with its sign; none for the refitted start."""
        added = [f"+ {self.effect}"] if self.effect else []
        return (*added, *(f"{sign} {key}" for sign, key in self.changes))

    @property
    def name(self) -> str:
        """The same in one line."""
        return " ".join(self.signs) or "refitted"

    def __str__(self) -> str:
        return (
            f"{self.name}, nrmse {percent(self.nrmse)}, held out {percent(self.nrmse_holdout)}, evidence "
            f"{self.evidence:.1f}"
        )

    @property
    def sentence(self) -> str:
        """What became of effects added earlier, in a sentence; empty where they all stayed."""
        if not self.changes:
            return ""
        gone, new = _named(self.dropped), _named(self.instead)
        better, it = f"{new} {_explain(self.instead)} the data better than {gone}", _it(self.dropped)
        if self.effect:
            beside = f"With {_words(self.effect)} in the model,"
            if not new:
                return f"{beside} {gone} {_are(self.dropped)} no longer needed."
            return f"{beside} {better}, and replaced {it}."
        if not new:
            return f"The final model does not need {gone}, which {_were(self.dropped)} dropped."
        if not gone:
            return f"The ladder went back and continued with {new}: the model before left more than noise."
        if self.evidence > 0:
            gain = f"log-likelihood higher by {self.evidence:.0f}"
            return f"At the end of the ladder {better} ({gain}), and replaced {it}."
        return f"The ladder went back and took {new} in place of {gone}, with which more than noise was left."


@dataclass(frozen=True, eq=False, repr=False)
class Study(Brief):
    """Outcome of `improve`.

    Attributes
    ----------
    steps : tuple of Step
        The refitted start first.
    model : block
        The improved one.
    verdict : {'none', 'effect', 'unknown'}
        Nothing was missing; what was missing is found; something remains that the library does not explain.
    noise : float
        Noise over the rms of the centred output: the least error that a model can reach.
    status : {'complete', 'under way', 'budget spent', 'interrupted'}
        How far the ladder came. Before it is complete the last step holds what is known so far.
    neighbours : Neighbours
        The model against all that differ from it by one effect.

    Examples
    --------
    >>> names = ["constant_force", "quadratic_drag"]
    >>> t = np.arange(0, 4, 0.01)
    >>> F = 9 * np.sin(3 * t) + 5 * np.sin(8 * t)
    >>> machine = cdf.friction_mass(2.2, 3.0, 6.0).with_effect(cdf.ConstantForce(1.0))
    >>> x = np.asarray(cdf.event_response(machine, t, F, input_hold="zoh").outputs)[0]
    >>> record = cdf.Measurement(t, F, x + 1e-4 * np.random.default_rng(1).standard_normal(t.size))
    >>> study = cdf.improve(cdf.friction_mass(2.0, 2.5, 5.0), record, candidates=names)
    >>> [step.effect for step in study.steps], study.model.parameters["constant_force.force"].unit
    (['', 'constant_force'], 'N')
    """

    steps: tuple[Step, ...]
    model: Any
    verdict: str
    noise: float
    start: Any
    train: tuple
    holdout: tuple
    seconds: float = 0.0
    status: str = COMPLETE
    neighbours: Neighbours = Neighbours()

    @classmethod
    def unknown(cls, diagnosis: Diagnosis):
        """Return what is known before the first result: the model as it was given."""
        model = diagnosis.model
        step = Step(
            model=model, parameters={k: p.value for k, p in model.parameters.items()}, diagnosis=diagnosis
        )
        return cls(
            (step,), model, UNKNOWN, math.nan, model, diagnosis.train, diagnosis.holdout,
            status=diagnosis.status, neighbours=Neighbours(complete=False),
        )  # fmt: skip

    @property
    def effects(self) -> tuple[str, ...]:
        """Ids of the effects that were added and kept."""
        return tuple(e.id for e in self._added)

    @property
    def _added(self) -> tuple[Effect, ...]:
        return self.model.effects[len(self.start.effects) :]

    @property
    def story(self) -> list[str]:
        """What became of effects on the way, and what the neighbours come to, in sentences."""
        notes = [s.sentence for s in self.steps]
        notes.append(moved_to_load(self.model, self.start, "In the model found"))
        notes += [self.neighbours.sentence if self.neighbours else "", self._at_bounds()]
        return [note for note in notes if note]

    def _at_bounds(self) -> str:
        return driven_to_bounds(self.model, self.start) if self.effects else ""

    @property
    def measure(self) -> str:
        """What the errors of the steps are of."""
        return last_diagnosis(self.steps).measure

    def table(self) -> str:
        """Return one line a step."""
        w = max(LEAST_WIDTH, *(len(step.name) for step in self.steps))
        lines = [f"{'step':<{w}} {'nrmse':>9} {'held out':>9} {'evidence':>10}"]
        for step in self.steps:
            lines.append(
                f"{step.name:<{w}} {step.nrmse:>9.3g} {step.nrmse_holdout:>9.3g} {step.evidence:>10.1f}"
            )
        lines.append(f"{'noise floor':<{w}} {self.noise:>9.3g}")
        return "\n".join(lines)

    def summary(self) -> str:
        """Return the outcome in plain words."""
        head = self._outcome()
        if self.status != COMPLETE:
            found = last_diagnosis(self.steps)
            done = found.verdict == NONE and found.status == COMPLETE
            left = (
                "models that differ by one effect were not all tried"
                if done
                else "the ladder would have continued"
            )
            head = f"Not complete ({self.status}): {left}. {head}"
        notes = [line for line in (which_errors(self.measure, ladder=True),) if line]
        lines = [" ".join([head, *self.story]), "", self.table(), *notes, ""]
        if self.neighbours:
            lines += [str(self.neighbours.table()), ""]
        for name, p in self.model.parameters.items():
            lines += _values(name, p)
        return "\n".join(lines)

    def _outcome(self) -> str:
        first, last = self.steps[0], self.steps[-1]
        if math.isnan(first.nrmse):
            return last_diagnosis(self.steps).explanation
        if self.verdict == NONE:
            return (
                f"Nothing is missing: with refitted parameters the model errs by {percent(first.nrmse)}, "
                "the noise of these data."
            )
        far, notes = ("", last.diagnosis) if self.status == COMPLETE else (" so far", None)
        held_out = math.isfinite(first.nrmse_holdout + last.nrmse_holdout)
        if self.effects:
            on = f", on held-out data from {percent(first.nrmse_holdout)} to {percent(last.nrmse_holdout)}"
            head = (
                f"Added{far}: {', '.join(map(named, self._added))}. The error falls from "
                f"{percent(first.nrmse)} to {percent(last.nrmse)}{on if held_out else ''} "
                f"(noise {percent(self.noise)})."
            )
        else:
            on = f"held out {percent(last.nrmse_holdout)}, " if held_out else ""
            head = (
                f"Nothing is added{far}: with refitted parameters the model errs by {percent(last.nrmse)} "
                f"({on}noise {percent(self.noise)})."
            )
        if self.verdict == UNKNOWN and notes is not None:
            told = " ".join((*notes.doubts, notes.remains))
            nothing = "What is missing no effect of the library explains."
            more = "More is missing than this, and no effect of the library explains it."
            left = f"{more if self.effects else nothing} {told}"
            head += f" {left if notes.remains else notes.explanation}"
        elif self.status != COMPLETE and last.explanation:
            head += f" {last.explanation}"
        return head

    def plot(self, **keywords):
        """Draw the error of every step beside the noise; returns a ``ct.ControlPlot``."""
        require_known(self.steps[0].nrmse)
        return draw("ladder", self, **keywords)

    def report(self, path) -> str:
        """Write one self-contained HTML file and return its path."""
        require_known(self.steps[0].nrmse)
        return go_on("report", self, path)

    def __str__(self) -> str:
        return self.summary()


def last_diagnosis(steps: Sequence[Step]) -> Diagnosis:
    """Return what was asked of the last model of a ladder."""
    found = steps[-1].diagnosis
    assert found is not None
    return found


def outcome(steps: Sequence[Step]) -> str:
    """Return the verdict of a ladder; where it ended early, something that is not in it yet is unknown."""
    last = last_diagnosis(steps)
    if last.verdict == NONE:
        return NONE if len(steps) == 1 else EFFECT
    ended_early = len(steps) == 1 or last.status != COMPLETE
    return UNKNOWN if last.verdict == UNKNOWN or ended_early else EFFECT


def _words(name: str) -> str:
    return name.replace("_", " ")


def _named(names: Sequence[str]) -> str:
    return " and ".join(_words(n) for n in names)


def _are(names) -> str:
    return "is" if len(names) == 1 else "are"


def _were(names) -> str:
    return "was" if len(names) == 1 else "were"


def _explain(names) -> str:
    return "explains" if len(names) == 1 else "explain"


def _it(names) -> str:
    return "it" if len(names) == 1 else "them"


def _values(name: str, parameter) -> list[str]:
    """Return the lines of a parameter: its value, or that of each record where these differ."""
    own = getattr(parameter.value, "values", None)
    rows = [(name, parameter.value)] if not own else [(f"  {k}", v) for k, v in own.items()]
    head = [f"  {name}, of each record:"] if own else []
    return head + [f"  {label:<35} {value + 0.0:>12.6g} {parameter.unit}".rstrip() for label, value in rows]
