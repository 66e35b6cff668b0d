"""The final model of a ladder beside all models that differ from it by one effect."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from ...numerals import percent
from ...table import Table, frame

BETTER, UNCONFIRMED, EQUAL, WORSE = "better", "unconfirmed", "equal", "worse"
DROP, EXCHANGE, ADD = "drop", "exchange", "add"


@dataclass(frozen=True, eq=False)
class Neighbour:
    """A model that differs from the final one by one effect.

    Attributes
    ----------
    change : {'drop', 'exchange', 'add'}
        What was done to the final model. An exchange of two effects for one that does both is an exchange.
    dropped : tuple of str
        Ids of the effects taken out.
    added : str
        Id of the effect put in; empty where none was.
    evidence : float
        Log-likelihood ratio over the final model, less the penalty for parameters (Schwarz): positive
        where the data speak for the neighbour.
    nrmse, nrmse_holdout : float
        Errors, on training and on held-out data (NaN: not `refitted`). Where held-out data err by more than
        three times as much as with the model, initial states there are not sought to the last: a bound.
    verdict : {'better', 'unconfirmed', 'equal', 'worse'}
        ``equal``: within chance. A model that has an effect more needs the evidence of any effect;
        ``unconfirmed``: the fitted data give that, but held-out data or long horizons do not confirm it.
    refitted : bool
        Whether it was fitted to all data. If not, screening has shown that it errs far more.
    given : bool
        Whether the effect dropped is the user's own: such effects stay, whatever the data say.
    parameters : dict
        All parameters of the neighbour.
    model : block
    """

    change: str
    dropped: tuple[str, ...]
    added: str
    evidence: float
    nrmse: float
    nrmse_holdout: float
    verdict: str
    refitted: bool
    given: bool = False
    parameters: Mapping[str, float] = field(default_factory=dict)
    model: Any = field(default=None, repr=False)

    @property
    def name(self) -> str:
        """What was done, in signs."""
        signs = [*(f"- {d}" for d in self.dropped), *([f"+ {self.added}"] if self.added else [])]
        return " ".join(signs)


@dataclass(frozen=True, eq=False)
class Neighbours(Sequence):
    """The final model of a ladder against all models that differ by one effect, nearest first.

    Attributes
    ----------
    rows : tuple of Neighbour
    nrmse, nrmse_holdout : float
        Errors of the final model.
    complete : bool
        Whether all were tried; False where the time ran out before.

    Examples
    --------
    >>> names = ["constant_force", "quadratic_drag"]
    >>> t = np.arange(0, 4, 0.01)
    >>> F = 9 * np.sin(3 * t) + 5 * np.sin(8 * t)
    >>> machine = cdf.friction_mass(2.2, 3.0, 6.0).with_effect(cdf.ConstantForce(1.0))
    >>> x = np.asarray(cdf.event_response(machine, t, F, input_hold="zoh").outputs)[0]
    >>> record = cdf.Measurement(t, F, x + 1e-4 * np.random.default_rng(1).standard_normal(t.size))
    >>> study = cdf.improve(cdf.friction_mass(2.0, 2.5, 5.0), record, candidates=names)
    >>> [(n.name, n.verdict) for n in study.neighbours if n.change == "exchange"]
    [('- constant_force + quadratic_drag', 'worse')]
    """

    rows: tuple[Neighbour, ...] = ()
    nrmse: float = math.nan
    nrmse_holdout: float = math.nan
    complete: bool = True

    def __len__(self) -> int:
        return len(self.rows)

    def __getitem__(self, index):
        return self.rows[index]

    def __iter__(self) -> Iterator[Neighbour]:
        return iter(self.rows)

    def of(self, *verdicts: str) -> tuple[Neighbour, ...]:
        """Return the neighbours of these verdicts."""
        return tuple(n for n in self.rows if n.verdict in verdicts)

    @property
    def sentence(self) -> str:
        """The result in sentences."""
        if not self.rows:
            return ""
        count = len(self.rows)
        differ, were = ("model that differs", "was") if count == 1 else ("models that differ", "were")
        how = f"{count} {differ} from it by one effect {were} tried"
        how += "" if self.complete else " before the time ran out"
        better, equal = self.of(BETTER), [n for n in self.of(EQUAL) if n.change != ADD]
        found = [f"{how}: {_listed(better)} would be better." if better else f"{how}: none is better."]
        own = [n for n in equal if n.given]
        others = [n for n in equal if not n.given]
        if others:
            found.append(f"Equally good, within chance: {_listed(others)}.")
        if own:
            names = ", ".join(_words(n.dropped[0]) for n in own)
            found.append(f"The data do not need {names} of the given model; given effects are never dropped.")
        nearest = next((n for n in self.rows if n.verdict == WORSE and n.change == EXCHANGE), None)
        if nearest is not None and not others and not better:
            found.append(
                f"The best with one effect replaced, {_described(nearest)}, has a log-likelihood lower by "
                f"{-nearest.evidence:.0f}" + ("." if nearest.refitted else " (not refitted in full).")
            )
        return " ".join(found)

    def table(self, rows: int = 5) -> Table:
        """Return the final model and the nearest ones as a table."""
        lines = [("final model", "", _percent(self.nrmse), _percent(self.nrmse_holdout), "")]
        for n in self.rows[:rows]:
            errors = _percent(n.nrmse), _percent(n.nrmse_holdout)
            lines.append((_described(n), f"{n.evidence:.0f}", *errors, n.verdict))
        if (left := len(self.rows) - rows) > 0:
            lines.append((f"... {left} more", "", "", "", ""))
        return Table(("neighbour", "evidence", "error", "held out", "verdict"), tuple(lines), 60)

    def to_pandas(self):
        """Return one row a neighbour as a pandas DataFrame."""
        return frame(
            {
                "change": n.change, "dropped": ", ".join(n.dropped), "added": n.added, "evidence": n.evidence,
                "nrmse": n.nrmse, "nrmse_holdout": n.nrmse_holdout, "verdict": n.verdict,
                "refitted": n.refitted, "given": n.given,
            }
            for n in self.rows
        )  # fmt: skip

    def __str__(self) -> str:
        return f"{self.sentence}\n{self.table()}"

    def _repr_html_(self) -> str:
        return self.table()._repr_html_()


def _described(n: Neighbour) -> str:
    gone = " and ".join(_words(d) for d in n.dropped)
    if n.change == ADD:
        return f"with {_words(n.added)} in addition"
    if n.change == DROP:
        return f"without {gone}"
    return f"{_words(n.added)} in place of {gone}"


def _listed(rows) -> str:
    return "; ".join(_described(n) for n in rows)


def _words(name: str) -> str:
    return name.replace("_", " ")


def _percent(value: float) -> str:
    return percent(value)
