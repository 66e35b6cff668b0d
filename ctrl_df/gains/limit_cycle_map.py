"""`limit_cycle_map`: what a loop does over the plane of two gains."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..checks import count, number, unknown_keywords
from ..df.work import progress_bar
from ..drawing import draw
from ..table import Table, frame
from .arguments import bounds, free_gains, gain_units
from .balance import Cycles, cycles_along, polished, settled
from .border import Border, deep_points, refined, spread_points
from .controller import GAINS, Structure
from .folds import folds
from .plane import Plane, plane_of, require_linear
from .simulated import Simulated, all_simulated, simulated, worded
from .stability import linear_border, unstable_poles

_OWNER = "limit_cycle_map"
_SPREAD = 0.4  # of the exact checks: spread evenly; the others close in on borders
_LEAST = 8  # exact checks


@dataclass(frozen=True)
class PredictedCycle:
    """A cycle that the describing function predicts at some gains.

    Attributes
    ----------
    amplitude : float
        At the block's input.
    omega : float
        [rad/s].
    stable : bool or None
        Loeb's criterion; None where it is degenerate.
    """

    amplitude: float
    omega: float
    stable: bool | None

    def __repr__(self) -> str:
        words = {True: "stable", False: "unstable", None: "stability unknown"}[self.stable]
        return f"<PredictedCycle: {self.amplitude:.5g} @ {self.omega:.5g} rad/s, {words}>"


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
        ``rests``, ``cycles``, ``diverges``, or several joined by "or": as simulated where the map was checked,
        else as predicted.
    predicted : ndarray of str, shape (nx, ny)
        The same by the describing function alone.
    amplitude, omega : ndarray, shape (nx, ny)
        Of the smallest cycle predicted stable: amplitude at the block's input, frequency [rad/s]; NaN without
        one.
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
        Share of the evenly spread ones of these at which the describing function is right about whether there is
        a stable cycle; NaN without checks.
    marks : dict
        Gains to be marked in the picture, by name.
    """

    structure: Structure
    free: tuple[str, str]
    fixed: dict[str, float]
    x: np.ndarray
    y: np.ndarray
    verdict: np.ndarray
    predicted: np.ndarray
    amplitude: np.ndarray
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
        """
        if set(gains) != set(self.free):
            raise TypeError(f"at needs the free gains {' and '.join(self.free)}; got {', '.join(gains) or 'none'}.")
        for name, axis in zip(self.free, (self.x, self.y), strict=True):
            number("at", name, gains[name], lower=float(axis[0]), upper=float(axis[-1]),
                   remedy="The map knows nothing beyond: make a larger one.")  # fmt: skip
        every = {name: float({**self.fixed, **gains}[name]) for name in GAINS}
        cycles = _at_one(self.plane, every, self.free[1])
        poles = int(unstable_poles(self.plane, every["kp"], every["ki"], every["kd"]))
        stable = np.array([np.nan if c.stable is None else float(c.stable) for c in cycles])
        predicted = worded(*_fates(stable, poles))
        verdict, truth = predicted, None
        if exact:
            truth = simulated(self.structure, every)
            verdict = truth.verdict
        elif self.border is not None:
            verdict = str(_corrected(self.border, self._unit([every]), np.array([poles > 0]))[0])
        return GainPoint(every, verdict, predicted, cycles, truth)

    def summary(self) -> str:
        """Return the map in words: shares of the plane, agreement of the predictions with what was simulated."""
        box = ", ".join(
            f"{name} {axis[0]:.6g} to {axis[-1]:.6g}" for name, axis in zip(self.free, (self.x, self.y), strict=True)
        )
        third = ", ".join(f"{name}={value:.6g}" for name, value in self.fixed.items())
        lines = [f"{box} at {third}:"]
        names, numbers = np.unique(self.verdict, return_counts=True)
        shares = [f"{name} on {100 * n / self.verdict.size:.3g} %" for name, n in
                  sorted(zip(names.tolist(), numbers.tolist(), strict=True), key=lambda pair: -pair[1])]  # fmt: skip
        lines.append(f"the loop {', '.join(shares)} of the plane.")
        if self.checks:
            lines.append(
                f"{len(self.checks)} points were simulated from twelve starts each; the describing function is right "
                f"about a stable cycle at {100 * self.agreement:.3g} % of those spread evenly."
            )
        else:
            lines.append("Predicted by the describing function only; exact_check=50 holds it against simulations.")
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
                "amplitude": self.amplitude[i, k], "omega": self.omega[i, k],
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
            f"<LimitCycleMap over {self.free[0]} and {self.free[1]}: {self.x.size} x {self.y.size} gains, cycles on "
            f"{100 * cycling.mean():.3g} %; {len(self.checks)} simulated>"
        )

    def _repr_html_(self) -> str:
        text = self.summary().replace("<", "&lt;").replace("\n", "<br>")
        return f"<p>{text}</p>" + (self.table()._repr_html_() if self.checks else "")

    def _predicted_at(self, gains) -> str:
        return self.at(**{name: gains[name] for name in self.free}).predicted

    def _unit(self, gains) -> np.ndarray:
        return _to_unit(gains, self.free, (self.x, self.y))


def limit_cycle_map(
    block,
    *,
    kp: Any,
    ki: Any = 0.0,
    kd: Any = 0.0,
    tf: float = 0.0,
    plant: Any = None,
    output: str | None = None,
    n: int = 30,
    amplitude: Any = None,
    omega: Any = None,
    exact_check: int = 50,
    marks: Mapping[str, Mapping[str, float]] | None = None,
    seed: int = 0,
    progress: bool | None = None,
    **keywords: Any,
) -> LimitCycleMap:
    """Map what a PID loop around a block does over two of its gains: whether it rests, cycles or diverges.

    One family of describing functions N(a, omega) serves all gains: a cycle of amplitude a and frequency omega needs
    ``P C = -1/N``, which are two equations for two gains. Folds, where cycles appear in pairs, and the border of
    linear stability are followed as curves.

    A share of the gains is simulated from twelve starts each, half of them spread evenly, the others where what
    the loop does changes: so the map is right also where the describing function is not (friction whose static level
    lies above the kinetic one hunts where it predicts nothing).

    Parameters
    ----------
    block : block
        A mechanism, a memoryless or hysteretic element, or what else `describing_function` takes and
        `closed_loop` runs.
    kp, ki, kd : float, (low, high) or array
        Gains of `pid`: two of them as ranges or values, the third a number.
    tf : float
        Time constant of the derivative filter [s], as in `pid`.
    plant : LTI system, optional
        Linear part beside the controller: what an element acts on. Continuous.
    output : str, optional
        Output of the block that is fed back; default the first.
    n : int
        Values of each range.
    amplitude, omega : (low, high), optional
        Amplitudes at the block's input and frequencies [rad/s] at which cycles are looked for; chosen from the block
        and the gains if left out.
    exact_check : int
        Points simulated, 0 or at least 8.
    marks : mapping, optional
        Gains to be marked, by name: ``{"paper": {"kp": 2000, "ki": 44250}}``.
    seed : int
        Of the points spread over the plane.
    progress : bool, optional
        Progress bar; default: only on a terminal and only after two seconds.

    Returns
    -------
    LimitCycleMap

    Raises
    ------
    TypeError, ValueError
        Gains that are not two ranges and a number; a plant that is discrete or measured; what `closed_loop` refuses.

    Examples
    --------
    >>> import ctrl_df as cdf
    >>> axis = cdf.friction_mass(mass=9, coulomb=5, viscous=0.5)
    >>> gains = cdf.limit_cycle_map(axis, kp=(500, 4000), ki=(0, 80000), kd=130, exact_check=0)
    >>> gains.at(kp=3500, ki=10000).verdict
    'rests'
    >>> gains.at(kp=600, ki=70000).verdict
    'diverges'
    >>> gains.at(kp=2000, ki=44250).cycles
    (<PredictedCycle: 9.5359 @ 13.055 rad/s, stable>, <PredictedCycle: 11.082 @ 13.898 rad/s, unstable>)

    The smaller of the two does not exist; simulations tell, at one pair of gains or over the map:

    >>> gains.at(kp=2000, ki=44250, exact=True).verdict
    'rests or diverges'
    """
    unknown_keywords(keywords)
    points = count(_OWNER, "n", n, 2, meaning="values of each range")
    checks = count(_OWNER, "exact_check", exact_check, 0, meaning="points simulated")
    if 0 < checks < _LEAST:
        raise ValueError(f"{_OWNER} needs exact_check=0, or at least {_LEAST} points; got {checks}.")
    free, fixed, axes = free_gains(_OWNER, {"kp": kp, "ki": ki, "kd": kd}, points)
    tf = number(_OWNER, "tf", tf, "s", lower=0.0, meaning="filter time constant")
    if plant is not None:
        require_linear(plant)
    structure = Structure(block, tf, plant, output)
    wanted = bounds(_OWNER, "amplitude", amplitude, ""), bounds(_OWNER, "omega", omega, "rad/s")
    corners = [
        {**fixed, free[0]: float(x), free[1]: float(y)}
        for x in (axes[0][0], axes[0].mean(), axes[0][-1]) for y in (axes[1][0], axes[1].mean(), axes[1][-1])
    ]  # fmt: skip
    plane = plane_of(structure, corners, *wanted, progress=progress)

    grid = np.meshgrid(*axes, indexing="ij")
    gains = {**fixed, free[0]: grid[0], free[1]: grid[1]}
    poles = unstable_poles(plane, *(gains[name] for name in GAINS))
    cycles = _over_grid(plane, free, fixed, axes)
    predicted, amplitudes, frequencies, numbers = _summed_up(cycles, poles)
    border, found, agreement, verdict = None, [], np.nan, predicted
    if checks:
        border, found, agreement = _checked(structure, free, fixed, axes, predicted, checks, seed, progress)
        unit = np.stack([_unit_axis(g, axis) for g, axis in zip(grid, axes, strict=True)], axis=-1)
        verdict = _corrected(border, unit.reshape(-1, 2), (poles > 0).ravel()).reshape(poles.shape)
    traced = folds(plane, free, fixed, axes)
    ranges = tuple((float(axis[0]), float(axis[-1])) for axis in axes)
    return LimitCycleMap(
        structure, free, fixed, *axes, verdict, predicted, amplitudes, frequencies, numbers,
        linear_border(plane, free, fixed, ranges),
        [np.column_stack([c[:, :2], np.exp(c[:, 2:])]) for c in traced],
        tuple(found), agreement, {k: dict(v) for k, v in (marks or {}).items()}, plane, border,
    )  # fmt: skip


# --- predicted ----------------------------------------------------------------------------------------------


def _over_grid(plane, free, fixed, axes) -> list[Cycles]:
    """Cycles along every value of the first gain."""
    return [cycles_along(plane, {**fixed, free[0]: float(x)}, free[1], axes[1]) for x in axes[0]]


def _summed_up(cycles, poles):
    """Words, smallest stable cycle and number of cycles at every point of the grid."""
    words = np.empty(poles.shape, dtype="U32")
    amplitude, omega = np.full(poles.shape, np.nan), np.full(poles.shape, np.nan)
    numbers = np.zeros(poles.shape, dtype=int)
    for i, column in enumerate(cycles):
        stable = settled(column.sine)
        for k in range(poles.shape[1]):
            here = np.flatnonzero(column.index == k)
            here = here[np.argsort(column.p[here])]
            words[i, k] = worded(*_fates(stable[here], poles[i, k]))
            numbers[i, k] = here.size
            first = here[stable[here] == 1]
            if first.size:
                amplitude[i, k], omega[i, k] = np.exp([column.p[first[0]], column.q[first[0]]])
    return words, amplitude, omega, numbers


def _fates(stable, poles) -> tuple[bool, bool, bool]:
    """(rests, cycles, diverges) of cycles by rising amplitude (1 stable, 0 unstable, NaN) and poles in the large."""
    grows = bool(poles > 0)
    rests = not grows if not len(stable) else bool(stable[0] != 1)
    return rests, bool((np.asarray(stable) == 1).any()), grows


def _at_one(plane, gains, sought) -> tuple[PredictedCycle, ...]:
    """Cycles at one pair of gains, each brought to convergence."""
    near = cycles_along(plane, gains, sought, np.array([gains[sought]]))
    found: list[tuple[float, float, float]] = []
    for p, q, sine in sorted(zip(near.p, near.q, near.sine, strict=True)):
        exact = polished(plane, gains, float(p), float(q)) or (float(p), float(q), float(sine))
        if not any(abs(exact[0] - o[0]) < 1e-6 and abs(exact[1] - o[1]) < 1e-6 for o in found):
            found.append(exact)
    loeb = settled(np.array([f[2] for f in found]))
    return tuple(
        PredictedCycle(float(np.exp(p)), float(np.exp(q)), None if np.isnan(s) else bool(s))
        for (p, q, _), s in zip(found, loeb, strict=True)
    )


# --- checked ------------------------------------------------------------------------------------------------


def _checked(structure, free, fixed, axes, predicted, budget, seed, progress):
    """Simulate at points spread and at points where the answer changes; see `border.refined`."""
    even = spread_points(max(int(_SPREAD * budget), 4), seed)
    deep = deep_points(predicted)[: budget // 8]
    first = np.concatenate([even, [d for d in deep if np.linalg.norm(even - d, axis=1).min() > 1e-3] or even[:0]])
    found: list[Simulated] = []
    with progress_bar(budget, progress, "simulating gains", "point") as bar:

        def ask(unit):
            gains = [_from_unit(u, free, fixed, axes) for u in unit]
            new = all_simulated(structure, gains, bar.update)
            found.extend(new)
            return np.array([[s.cycles, s.rests] for s in new])

        def predict(unit):
            return np.char.find(_nearest(predicted, unit), "cycles") >= 0

        border = refined(first, budget, ask, predict)
    right = predict(even) == np.array([s.cycles for s in found[: len(even)]])
    return border, found, float(right.mean())


def _corrected(border, unit, grows) -> np.ndarray:
    """Words at points of the unit square; whether motions grow without bound in the large is known exactly."""
    cycles, rests = border(unit).T
    return np.array([worded(r or not (c or g), c, g) for r, c, g in zip(rests, cycles, grows, strict=True)])


def _nearest(values, unit):
    size = np.array(values.shape) - 1
    i, k = np.round(np.clip(unit, 0, 1) * size).astype(int).T
    return values[i, k]


def _unit_axis(values, axis):
    return (values - axis[0]) / (axis[-1] - axis[0])


def _to_unit(gains, free, axes) -> np.ndarray:
    return np.array([[_unit_axis(g[name], axis) for name, axis in zip(free, axes, strict=True)] for g in gains])


def _from_unit(unit, free, fixed, axes) -> dict[str, float]:
    given = {name: float(axis[0] + u * (axis[-1] - axis[0])) for name, u, axis in zip(free, unit, axes, strict=True)}
    return {name: float({**fixed, **given}[name]) for name in GAINS}
