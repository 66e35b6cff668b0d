"""Start values and first evidence for every effect of the library, from the residual of the refitted baseline.

What a candidate would change in the output is simulated; what the baseline's own parameters and starts could
explain is projected out of that and of the residual first. The share of the residual that remains explained is
the screening evidence, and the values that explain most are where the refit begins.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..blocks import effects as library
from ..blocks.effect import Effect
from .attach import attach
from .candidate import Candidate
from .proposals import PROPORTIONAL, proposals
from .simulator import Simulator
from .trial import Data, Scales, carried
from .windows import facts


@dataclass(frozen=True)
class Motion:
    """Samples of all records: force [N], reported position [m], smoothed velocity [m/s], acceleration [m/s^2]."""

    u: np.ndarray
    x: np.ndarray
    v: np.ndarray
    a: np.ndarray


def motion_of(view, thin: int) -> Motion:
    """Return every `thin`-th sample within the windows."""
    parts = []
    for record, windows in zip(view.records, view.windows, strict=True):
        velocity = facts(record).velocity
        acceleration = np.gradient(velocity, record.t)
        some = windows.samples[::thin]
        parts.append([np.asarray(c)[some] for c in (record.u, record.y, velocity, acceleration)])
    return Motion(*(np.concatenate(c) for c in zip(*parts, strict=True)))


class Screen:
    """The refitted baseline seen as a linear map: its residual, and all that refitting could change projected out.

    Parameters
    ----------
    base : Candidate
        The baseline fitted to windows that are short: there even a strong effect changes the output nearly linearly.
    data : Data
        In those windows.
    """

    def __init__(self, base: Candidate, data: Data):
        self.base, self.data = base, data
        self.view = data.train
        self.motion = motion_of(data.train, data.thin)
        self.tangent = base.tangent
        self.residual = self.project(base.residual)
        self.simulators = [Simulator(base.model, r, thin=data.thin) for r in self.view.records]

    @property
    def scales(self) -> Scales:
        """Typical sizes in the records."""
        return self.data.scales

    @property
    def block(self):
        """The refitted baseline."""
        return self.base.model

    def project(self, signals) -> np.ndarray:
        """Remove what the baseline's parameters and initial states can explain."""
        return self.tangent.project(signals) if self.tangent is not None else np.concatenate(signals)

    def starts(self, block) -> list[np.ndarray]:
        """Return the baseline's initial states as those of a block with an effect more."""
        return [
            carried(Simulator(block, r, thin=self.data.thin), w, old, start)
            for r, w, old, start in zip(
                self.view.records, self.view.windows, self.simulators, self.base.starts, strict=True
            )
        ]

    def change(self, block) -> list[np.ndarray] | None:
        """Return the change of output that `block` makes against the baseline; None if it cannot be simulated."""
        change = []
        for record, windows, start, y in zip(
            self.view.records, self.view.windows, self.starts(block), self.base.simulated, strict=True
        ):
            simulator = Simulator(block, record, thin=self.data.thin)
            change.append(simulator.run(windows, None, start, rounded=True) - y)
        return change if all(np.all(np.isfinite(c)) for c in change) else None


@dataclass(frozen=True)
class Start:
    """An effect with start values and the share of the residual it is expected to leave (1: explains nothing)."""

    effect: Effect
    left: float
    values: tuple[tuple[str, float], ...] = ()  # baseline parameters that go with it


def starts_for(cls, screen: Screen, keep: int = 2) -> list[Start]:
    """Return the best start values for one effect class, best first."""
    found: list[Start] = []
    total = float(screen.residual @ screen.residual)
    for effect in proposals(cls, screen):
        found += _judged(effect, screen, total)
    found.sort(key=lambda s: s.left)
    chosen: list[Start] = list(_regressed(cls, screen))
    keep += len(chosen)
    for start in found:
        if all(_apart(start.effect, other.effect) for other in chosen):
            chosen.append(start)
        if len(chosen) == keep:
            break
    return chosen


def _judged(effect, screen, total) -> Iterator[Start]:
    block = attach(screen.block, effect)
    change = None if block is None else screen.change(block)
    if block is None or change is None or total == 0:
        return
    change = screen.project(change)
    power = float(change @ change)
    if power == 0:
        return
    left = screen.residual - change
    yield Start(block.effects[-1], float(left @ left) / total)
    if effect.id in PROPORTIONAL:
        # For a small effect the change is proportional to it: scale it to the residual.
        factor = float(change @ screen.residual) / power
        scaled = _scaled(effect, factor)
        if scaled is not None and not 0.8 < factor < 1.25:
            again = attach(screen.block, scaled)
            moved = None if again is None else screen.change(again)
            if again is not None and moved is not None:
                left = screen.residual - screen.project(moved)
                yield Start(again.effects[-1], float(left @ left) / total)


def _scaled(effect, factor):
    name, p = next(iter(effect.parameters.items()))
    value = p.value * min(max(factor, -300.0), 300.0)
    if value < p.lower or value > p.upper or (p.strict and value <= p.lower) or value == 0:
        return None
    return effect.replace(**{name: value})


def _apart(a, b):
    return any(
        abs(x - y) > 0.25 * max(abs(x), abs(y), 1e-300) for x, y in zip(a.values, b.values, strict=True)
    )


def _regressed(cls, screen) -> Iterator[Start]:
    """Yield start values for Stribeck friction and the baseline together, by regression of the force on motion.

    The refitted baseline has bent its own friction towards the truth as far as it could; the right start lies
    elsewhere for all parameters at once.
    """
    if cls is not library.Stribeck:
        return
    s = screen.scales
    names = {"mass", "coulomb.level", "viscous.coefficient"} & set(screen.block.parameters)
    if "mass" not in names or screen.block.core.bodies > 1:
        return
    scored = []
    for speed in s.speed * np.array([0.04, 0.08, 0.15, 0.3, 0.6]):
        weights, left = force_regression(
            screen.motion,
            s,
            lambda v, speed=speed: np.sign(v) * np.exp(-np.square(v / speed)),
            friction=names,
        )
        scored.append((left, speed, weights))
    _, speed, w = min(scored, key=lambda x: x[0])
    mass, kinetic, viscous, extra = w
    if mass <= 0 or extra <= 0:
        return
    values = {
        "mass": mass,
        "coulomb.level": max(kinetic, 0.01 * s.force),
        "viscous.coefficient": max(viscous, 1e-3 * s.force / s.speed),
    }
    kinetic = values["coulomb.level"] if "coulomb.level" in names else 0.0
    yield Start(
        library.Stribeck(kinetic + extra, speed), 0.0, tuple((k, v) for k, v in values.items() if k in names)
    )


def force_regression(motion: Motion, scales, shape=None, friction=("coulomb.level", "viscous.coefficient")):
    """Regress the force on acceleration, direction, speed (and a further shape of speed) where the mass moves.

    Returns
    -------
    weights : array
        mass [kg], Coulomb level [N], viscous coefficient [N s/m], weight of the shape [N]; 0 for those left out.
    left : float
        Mean squared force that remains [N^2].
    """
    moving = np.abs(motion.v) > 0.03 * scales.speed
    v, force = motion.v[moving], motion.u[moving]
    matrix = np.column_stack([
        motion.a[moving],
        np.sign(v) * ("coulomb.level" in friction),
        v * ("viscous.coefficient" in friction),
        np.zeros(len(v)) if shape is None else shape(v),
    ])  # fmt: skip
    size = np.linalg.norm(matrix, axis=0)
    size[size == 0] = 1.0
    weights = np.linalg.lstsq(matrix / size, force, rcond=None)[0] / size
    return weights, float(np.mean((force - matrix @ weights) ** 2))
