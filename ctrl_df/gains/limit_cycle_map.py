"""`limit_cycle_map`: what a loop does over the plane of two gains."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..checks import count, number
from ..df.work import progress_bar
from .arguments import bounds, box_of
from .border import deep_points, distinct, refined, spread_points
from .controller import GAINS, Structure
from .folds import folds
from .map import LimitCycleMap, corrected
from .plane import plane_of, require_linear
from .predicted import at_one, over_grid, summed_up
from .simulated import Simulated, all_simulated
from .stability import linear_border, unstable_poles
from .thresholds import CHECKS_LEAST, SPREAD

_OWNER = "limit_cycle_map"


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
) -> LimitCycleMap:
    """Map what a PID loop around a block does, over two of its gains: whether it rests, cycles or diverges.

    One family of describing functions N(a, omega) serves all gains: a cycle of amplitude a and frequency
    omega needs ``P C = -1/N``, which are two equations for two gains. Folds, where cycles appear in pairs,
    and the border of linear stability are followed as curves.

    A share of the gains is simulated from twelve starts each, half of them spread evenly, the others where
    what the loop does changes: so the map is right also where the describing function is not (friction whose
    static level lies above the kinetic one hunts where it predicts nothing). Gains with ki = 0 are answered
    apart; between there and a fiftieth of the range of ki the answer is the one at that fiftieth.

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
        Amplitudes at the block's input and frequencies [rad/s] at which cycles are looked for; chosen from
        the block and the gains if left out.
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
        Gains that are not two ranges and a number; a plant that is discrete or measured; what `closed_loop`
        refuses.

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
    points = count(_OWNER, "n", n, 2, meaning="values of each range")
    checks = count(_OWNER, "exact_check", exact_check, 0, meaning="points simulated")
    if 0 < checks < CHECKS_LEAST:
        raise ValueError(f"{_OWNER} needs exact_check=0, or at least {CHECKS_LEAST} points; got {checks}.")
    box = box_of(_OWNER, {"kp": kp, "ki": ki, "kd": kd}, points)
    tf = number(_OWNER, "tf", tf, "s", lower=0.0, meaning="filter time constant")
    if plant is not None:
        require_linear(plant)
    structure = Structure(block, tf, plant, output)
    wanted = bounds(_OWNER, "amplitude", amplitude, ""), bounds(_OWNER, "omega", omega, "rad/s")
    plane = plane_of(structure, box.corners(), *wanted, progress=progress)

    x, y = np.meshgrid(*box.axes, indexing="ij")
    gains = box.every(x, y)
    poles = unstable_poles(plane, *(gains[name] for name in GAINS))
    predicted = summed_up(over_grid(plane, box, *box.axes), poles)
    verdict, border, found, agreement = predicted.words, None, [], np.nan
    if checks:
        border, found, agreement = _checked(plane, box, predicted.words, checks, seed, progress)
        unit = box.to_unit(x, y).reshape(-1, 2)
        words = corrected(border, unit, box.side(poles, gains).ravel(), (poles > 0).ravel(), verdict.ravel())
        verdict = words.reshape(poles.shape)
    curves = folds(plane, box.free, box.fixed, box.axes)
    output_amplitude = predicted.amplitude / np.abs(structure.loop_gain(gains, predicted.omega))
    return LimitCycleMap(
        structure,
        box,
        verdict,
        predicted.words,
        predicted.amplitude,
        output_amplitude,
        predicted.omega,
        predicted.number,
        linear_border(plane, box.free, box.fixed, box.ranges),
        [np.column_stack([c[:, :2], np.exp(c[:, 2:])]) for c in curves],
        tuple(found),
        agreement,
        {k: dict(v) for k, v in (marks or {}).items()},
        plane,
        border,
    )


def _checked(plane, box, predicted, budget, seed, progress):
    """Simulate at points spread and at points where the answer changes; see `border.refined`."""
    even = box.off_the_rim(spread_points(max(int(SPREAD * budget), 4), seed))
    first = distinct(np.concatenate([even, deep_points(predicted)[: budget // 8], box.rim()]))
    found: list[Simulated] = []
    with progress_bar(budget, progress, "simulating gains", "point") as bar:

        def ask(unit):
            gains = [box.every(float(x), float(y)) for x, y in zip(*box.from_unit(unit), strict=True)]
            new = all_simulated(plane.structure, gains, bar.update)
            found.extend(new)
            return np.array([[s.cycles, s.rests] for s in new])

        def predict(unit):
            gains = (box.every(float(x), float(y)) for x, y in zip(*box.from_unit(unit), strict=True))
            return np.array([any(c.stable for c in at_one(plane, g, box.free[1])) for g in gains])

        def side_of(unit):
            gains = box.every(*box.from_unit(unit))
            return box.side(unstable_poles(plane, *(gains[name] for name in GAINS)), gains)

        border = refined(first, budget, ask, predict, side_of)
    right = predict(even) == np.array([s.cycles for s in found[: len(even)]])
    return border, found, float(right.mean())
