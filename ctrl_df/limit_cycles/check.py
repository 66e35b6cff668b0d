"""What `verify` returns: predictions beside the truth, a row a cycle."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

from ..table import Table, frame, without_empty
from .exact.basins import Fate
from .exact.orbit import Orbit
from .predicted.grade import LimitCycle

_HEAD = (
    "predicted a @ w", "corrected a @ w", "exact a @ w", "multiplier", "simulated y @ w", "error a",
    "error w", "grade", "verdict", "why",
)  # fmt: skip


@dataclass(frozen=True, eq=False, repr=False)
class Row:
    """One cycle: predicted, exact, simulated.

    Attributes
    ----------
    predicted : LimitCycle or None
        None for a cycle the describing function missed.
    exact : Orbit or None
        The orbit found from the prediction, or by the search; None for loops with a pure delay. Of a sampled
        loop it holds averages (its ``stable`` is None).
    simulated : tuple of (omega, output amplitude) or None
        What a simulation started beside the orbit settles to; None where it leaves (an unstable orbit).
    verdict : str
        ``confirmed`` (within 5 %), ``shifted``, ``no such orbit`` (shown numerically), ``not found`` (which
        is no proof), ``missed by the describing function``, ``not tested``.
    why : str
        The reason for the verdict where there is no exact orbit: with which prediction this one merges, or
        what was tried and how each try ended.
    motion : Orbit or None
        Where only a simulation can tell (a pure delay): the motion it settles to, averaged over its periods.
    """

    predicted: LimitCycle | None
    exact: Orbit | None
    simulated: tuple[float, float] | None
    verdict: str
    why: str = ""
    motion: Orbit | None = None

    def __repr__(self) -> str:
        """Return the verdict, the prediction and the orbit."""
        return f"<Row: {self.verdict}, {self.predicted or 'not predicted'}, {self.exact or 'no orbit'}>"

    @property
    def omega_error(self) -> float:
        """Relative error of the predicted frequency; nan without a pair."""
        return self._error("omega")

    @property
    def amplitude_error(self) -> float:
        """Relative error of the predicted amplitude at the block's input; nan without a pair."""
        return self._error("amplitude")

    @property
    def in_band(self) -> bool | None:
        """Whether the stated error bands hold the exact orbit; None without a pair."""
        truth = self.exact or self.motion
        if self.predicted is None or truth is None:
            return None
        return in_band(self.predicted, truth)

    def texts(self) -> tuple[str, ...]:
        """Return its cells, as `Check.table` prints them."""
        p, e, s = self.predicted, self.exact, self.simulated
        leaves = "leaves" if e is not None and e.stable is False else ""
        return (
            f"{p.amplitude:.6g} @ {p.omega:.6g}" if p else "",
            "{:.6g} @ {:.6g}".format(*p.corrected) if p and p.corrected else "",
            f"{e.amplitude:.7g} @ {e.omega:.7g}" if e else "",
            _multiplier(e),
            f"{s[1]:.4g} @ {s[0]:.6g}" if s else leaves,
            _percent(self.amplitude_error),
            _percent(self.omega_error),
            p.grade if p else "",
            self.verdict,
            self.why,
        )

    def numbers(self) -> dict[str, Any]:
        """Return its cells by name, in numbers."""
        p, e, nothing = self.predicted, self.exact, (math.nan, math.nan)
        corrected = (p.corrected if p else None) or nothing
        simulated = self.simulated or nothing
        return {
            "predicted_amplitude": p.amplitude if p else math.nan,
            "predicted_omega": p.omega if p else math.nan,
            "corrected_amplitude": corrected[0],
            "corrected_omega": corrected[1],
            "exact_amplitude": e.amplitude if e else math.nan,
            "exact_omega": e.omega if e else math.nan,
            "multiplier": e.multiplier if e else math.nan,
            "stable": e.stable if e else None,
            "simulated_output_amplitude": simulated[1],
            "simulated_omega": simulated[0],
            "amplitude_error": self.amplitude_error,
            "omega_error": self.omega_error,
            "grade": p.grade if p else "",
            "verdict": self.verdict,
            "why": self.why,
        }

    def _error(self, name):
        truth = self.exact or self.motion
        if self.predicted is None or truth is None:
            return float("nan")
        return getattr(self.predicted, name) / getattr(truth, name) - 1.0


@dataclass(frozen=True, eq=False)
class Check:
    """Predictions of one loop beside its exact orbits and simulations.

    Attributes
    ----------
    rows : tuple of Row
        One a cycle, predicted ones first.
    orbits : list of Orbit
        All exact orbits found, those the prediction missed included; none for loops with a pure delay.
    note : str
        What could not be tested, and why.
    fate : Fate
        What the loop does from the starts simulated: a row a start, ``rests``, ``cycles`` (on which orbit) or
        ``diverges``, and the sizes at which that changes.

    Examples
    --------
    >>> H = ct.tf([8], [1, 2, 2, 1])
    >>> resp = cdf.describing_function_response(H, cdf.saturation(1), np.linspace(1, 5, 20))
    >>> check = cdf.verify(resp)
    >>> check.rows[0].verdict, check.rows[0].exact
    ('confirmed', <Orbit: 3.39494 @ 1.406702 rad/s, stable>)
    """

    rows: tuple[Row, ...]
    orbits: list[Orbit]
    note: str = ""
    loop: Any = field(repr=False, default=None)
    fate: Fate = field(default_factory=Fate)

    def table(self) -> str:
        """Return the rows as text: predicted, corrected by harmonics fed back, exact, simulated; verdicts."""
        fate = [f"simulated {self.fate}."] if len(self.fate) else []
        return "\n".join([str(self._table()), *fate] + ([self.note] if self.note else []))

    def to_pandas(self):
        """Return the rows as a pandas DataFrame, in numbers: NaN where there is none."""
        return frame(row.numbers() for row in self.rows)

    def _table(self) -> Table:
        if not self.rows:
            nothing = ("no cycle", "no orbit found", "none predicted, none found")
            return Table(("predicted", "exact", "verdict"), (nothing,))
        return without_empty(_HEAD, [row.texts() for row in self.rows])

    def __str__(self) -> str:
        return self.table()

    def __repr__(self) -> str:
        """Return the verdicts, one a cycle."""
        return f"<Check: {', '.join(row.verdict for row in self.rows) or 'no cycle predicted, none found'}>"

    def _repr_html_(self) -> str:
        return self._table()._repr_html_()

    def __iter__(self):
        return iter(self.rows)

    def __len__(self) -> int:
        return len(self.rows)


def in_band(cycle: LimitCycle, orbit: Orbit) -> bool:
    """Whether the error bands of a prediction hold an orbit."""
    low_w, high_w = cycle.omega_band
    low_a, high_a = cycle.amplitude_band
    return bool(low_w <= orbit.omega <= high_w and low_a <= orbit.amplitude <= high_a)


def _multiplier(orbit) -> str:
    if orbit is None:
        return ""
    if orbit.stable is None:
        return "irregular"
    return f"{orbit.multiplier:.5g} {'stable' if orbit.stable else 'unstable'}"


def _percent(value) -> str:
    return "" if math.isnan(value) else f"{100 * value:+.2f} %"
