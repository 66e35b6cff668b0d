"""What `limit_cycle_map` returns: words, numbers and curves over the plane of two gains."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.interpolate import RBFInterpolator

from ..checks import number
from ..drawing import draw
from ..table import Table, frame
from .arguments import Box, gain_units
from .border import Border
from .controller import GAINS, Structure
from .plane import Plane
from .predicted import PredictedCycle, at_one, fates, over_grid, summed_up
from .simulated import Simulated, simulated, worded
from .stability import unstable_poles
from .thresholds import CHECKS_ENOUGH, FINE_GAINS


@dataclass(frozen=True, eq=False)
class Fine:
    """A map on a fine grid: words, and frequency and output amplitude of the cycle, exact or predicted."""

    x: np.ndarray
    y: np.ndarray
    verdict: np.ndarray
    omega: np.ndarray
    output_amplitude: np.ndarray
    exact: bool


@dataclass(frozen=True)
class GainPoint:
    """What a map says of one pair of gains.

    Attributes
    ----------
    gains : dict
        kp, ki, kd.
    verdict : str
        ``rests``, ``cycles``, ``diverges``, or several of these, which the start decides between: as
        simulated where the map was checked, else as predicted.
    predicted : str
        The same by the describing function alone.
    cycles : tuple of PredictedCycle
        By rising amplitude.
    simulated : Simulated or None
        The loop itself from twelve starts, where ``exact=True`` asked for it.
    """

    gains: Mapping[str, float]
    verdict: str
    predicted: str
    cycles: tuple[PredictedCycle, ...]
    simulated: Simulated | None = None

    def __repr__(self) -> str:
        at = ", ".join(f"{name}={value:.6g}" for name, value in self.gains.items())
        return f"<GainPoint {at}: {self.verdict} (predicted: {self.predicted})>"


@dataclass(frozen=True, repr=False, eq=False)
class LimitCycleMap:
    """What a loop does over the plane of two gains.

    Attributes
    ----------
    free : (str, str)
        Names of the two gains.
    fixed : dict
        Name and value of the third.
    x, y : ndarray, shapes (nx,), (ny,)
        Values of the two gains.
    verdict : ndarray of str, shape (nx, ny)
        ``rests``, ``cycles``, ``diverges``, or several joined by "or": as simulated where the map was
        checked, else as predicted.
    predicted : ndarray of str, shape (nx, ny)
        The same by the describing function alone.
    amplitude, output_amplitude, omega : ndarray, shape (nx, ny)
        Of the smallest cycle predicted stable: amplitudes at the block's input and output, frequency [rad/s];
        NaN without one.
    number : ndarray of int, shape (nx, ny)
        Cycles predicted, unstable ones included.
    linear_border : list of ndarray, shape (n, 2)
        Curves on which the loop in the large, where friction, gap and the like are negligible, loses its
        stability.
    folds : list of ndarray, shape (n, 4)
        Curves on which two predicted cycles meet and vanish: the two gains, amplitude, frequency.
    checks : tuple of Simulated
        The loop itself at some gains, simulated from twelve starts, cycles closed exactly.
    agreement : float
        Share of the evenly spread ones of these at which the describing function is right about whether there
        is a stable cycle; NaN without checks.
    marks : dict
        Gains to be marked in the picture, by name.

    Examples
    --------
    >>> import ctrl_df as cdf
    >>> axis = cdf.friction_mass(mass=9, coulomb=5, viscous=0.5)
    >>> gains = cdf.limit_cycle_map(axis, kp=(500, 4000), ki=(0, 80000), kd=130, n=10, exact_check=0)
    >>> gains.verdict[0, -1], gains.verdict[-1, 0], gains.number.max()
    (np.str_('diverges'), np.str_('rests'), np.int64(2))
    """

    structure: Structure
    box: Box
    verdict: np.ndarray
    predicted: np.ndarray
    amplitude: np.ndarray
    output_amplitude: np.ndarray
    omega: np.ndarray
    number: np.ndarray
    linear_border: list[np.ndarray]
    folds: list[np.ndarray]
    checks: tuple[Simulated, ...]
    agreement: float
    marks: dict[str, dict[str, float]]
    plane: Plane
    border: Border | None = field(default=None)

    @property
    def free(self) -> tuple[str, str]:
        """Names of the two gains."""
        return self.box.free

    @property
    def fixed(self) -> dict[str, float]:
        """Name and value of the third."""
        return self.box.fixed

    @property
    def x(self) -> np.ndarray:
        """Values of the first gain."""
        return self.box.axes[0]

    @property
    def y(self) -> np.ndarray:
        """Values of the second gain."""
        return self.box.axes[1]

    @property
    def units(self) -> dict[str, str]:
        """Units of kp, ki, kd; empty where the block tells none."""
        return gain_units(self.structure.block, self.structure.output)

    def at(self, *, exact: bool = False, **gains: float) -> GainPoint:
        """Tell what the map says of one pair of gains.

        Parameters
        ----------
        exact : bool
            Also simulate the loop there; `verdict` is then what it does.
        **gains
            The two free gains by name, within the map.

        Raises
        ------
        TypeError, ValueError
            Gains that are not the two free ones, or outside the map.

        Examples
        --------
        >>> import ctrl_df as cdf
        >>> axis = cdf.friction_mass(mass=9, coulomb=5, viscous=0.5, static=5.5)
        >>> gains = cdf.limit_cycle_map(axis, kp=(500, 4000), ki=(0, 80000), kd=130, n=10, exact_check=0)
        >>> gains.at(kp=2000, ki=44250, exact=True).simulated.orbit
        <Orbit: 7.945402 @ 11.62868 rad/s, stable>
        """
        if set(gains) != set(self.free):
            raise TypeError(
                f"at needs the free gains {' and '.join(self.free)}; got {', '.join(gains) or 'none'}."
            )
        for name, axis in zip(self.free, (self.x, self.y), strict=True):
            number("at", name, gains[name], lower=float(axis[0]), upper=float(axis[-1]),
                   remedy="The map knows nothing beyond: make a larger one.")  # fmt: skip
        every = self.box.every(*(float(gains[name]) for name in self.free))
        cycles = at_one(self.plane, every, self.free[1])
        poles = int(unstable_poles(self.plane, every["kp"], every["ki"], every["kd"]))
        stable = np.array([np.nan if c.stable is None else float(c.stable) for c in cycles])
        predicted = worded(*fates(stable, poles))
        verdict, truth = predicted, None
        if exact:
            truth = simulated(self.structure, every)
            verdict = truth.verdict
        elif self.border is not None:
            place, here = self.box.to_unit(*(every[name] for name in self.free)), np.array([poles])
            words = corrected(
                self.border, place[None], self.box.side(here, every), here > 0, np.array([predicted])
            )
            verdict = str(words[0])
        return GainPoint(every, verdict, predicted, cycles, truth)

    def summary(self) -> str:
        """Return the map in words: shares of the plane, agreement of prediction and simulation."""
        box = ", ".join(
            f"{name} {axis[0]:.6g} to {axis[-1]:.6g}"
            for name, axis in zip(self.free, (self.x, self.y), strict=True)
        )
        third = ", ".join(f"{name}={value:.6g}" for name, value in self.fixed.items())
        lines = [f"{box} at {third}:"]
        names, numbers = np.unique(self.verdict, return_counts=True)
        order = np.argsort(-numbers)
        shares = [f"{names[k]} on {100 * numbers[k] / self.verdict.size:.3g} %" for k in order]
        lines.append(f"the loop {', '.join(shares)} of the plane.")
        if self.checks:
            lines.append(
                f"{len(self.checks)} points were simulated from twelve starts each; the describing function "
                f"is right about a stable cycle at {100 * self.agreement:.3g} % of those spread evenly."
            )
        else:
            lines.append(
                "Predicted by the describing function only; exact_check=50 holds it against simulations."
            )
        return "\n".join(lines)

    def table(self) -> Table:
        """Return the points simulated, a row each."""
        return Table(
            (*GAINS, "simulated", "predicted", "exact a @ w"),
            tuple(
                (
                    *(f"{c.gains[name]:.5g}" for name in GAINS), c.verdict, self._predicted_at(c.gains),
                    f"{c.orbit.amplitude:.5g} @ {c.orbit.omega:.5g}" if c.orbit else "",
                )
                for c in self.checks
            ),
        )  # fmt: skip

    def to_pandas(self):
        """Return the whole grid as a pandas DataFrame, a row a pair of gains."""
        return frame(
            {
                self.free[0]: x, self.free[1]: y, **self.fixed, "verdict": self.verdict[i, k],
                "predicted": self.predicted[i, k], "number": self.number[i, k],
                "amplitude": self.amplitude[i, k], "output_amplitude": self.output_amplitude[i, k],
                "omega": self.omega[i, k],
            }
            for i, x in enumerate(self.x) for k, y in enumerate(self.y)
        )  # fmt: skip

    def plot(self, **kwargs) -> Any:
        """Draw the map; see `ctrl_df.plot.gains.plot_limit_cycle_map`."""
        return draw("gains", self, **kwargs)

    def __repr__(self) -> str:
        """Return the gains and how much of the plane cycles."""
        cycling = np.char.find(self.verdict.astype(str), "cycles") >= 0
        return (
            f"<LimitCycleMap over {self.free[0]} and {self.free[1]}: {self.x.size} x {self.y.size} gains, "
            f"cycles on {100 * cycling.mean():.3g} %; {len(self.checks)} simulated>"
        )

    def _repr_html_(self) -> str:
        text = self.summary().replace("<", "&lt;").replace("\n", "<br>")
        return f"<p>{text}</p>" + (self.table()._repr_html_() if self.checks else "")

    def _predicted_at(self, gains) -> str:
        return self.at(**{name: gains[name] for name in self.free}).predicted

    def fine(self, n: int = FINE_GAINS) -> Fine:
        """Return the map on n x n gains, for pictures: between the simulated points, or predicted."""
        unit = np.linspace(0.0, 1.0, n)
        x, y = self.box.from_unit(np.stack([unit, unit], axis=-1))
        gains = self.box.every(x[:, None], y[None, :])
        grows = unstable_poles(self.plane, *(gains[name] for name in GAINS)) > 0
        found = summed_up(over_grid(self.plane, self.box, x, y), grows)
        loop_gain = self.structure.loop_gain(gains, found.omega)
        predicted = Fine(x, y, found.words, found.omega, found.amplitude / np.abs(loop_gain), False)
        if self.border is None:
            return predicted
        square = np.stack(np.meshgrid(unit, unit, indexing="ij"), axis=-1).reshape(-1, 2)
        words = corrected(
            self.border, square, self.box.side(grows, gains).ravel(), grows.ravel(), found.words.ravel()
        )
        words = words.reshape(grows.shape)
        known = [c for c in self.checks if c.orbit is not None]
        if len(known) < CHECKS_ENOUGH:
            return replace(predicted, verdict=words)
        at = np.array([self.box.to_unit(*(c.gains[name] for name in self.free)) for c in known])
        sizes = np.log([(c.orbit.omega, c.orbit.output_amplitude) for c in known if c.orbit])
        between = np.exp(RBFInterpolator(at, sizes, kernel="linear")(square)).reshape(n, n, 2)
        between[np.char.find(words, "cycles") < 0] = np.nan
        return Fine(x, y, words, between[..., 0], between[..., 1], True)


def corrected(border: Border, unit, sides, grows, predicted) -> np.ndarray:
    """Return words at points of the unit square, given predictions and whether motions grow without bound."""
    cycles, rests = border(unit, sides, np.char.find(predicted, "cycles") >= 0).T
    return np.array([worded(r or not (c or g), c, g) for r, c, g in zip(rests, cycles, grows, strict=True)])
