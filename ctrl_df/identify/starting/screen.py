"""Start values and first evidence for every effect, from the residual of the refitted baseline.

What a candidate would change in the output is simulated; what the baseline's own parameters and starts could
explain is projected out of that and of the residual first. The share of the residual that remains explained
is the screening evidence, and the values that explain most are where the refit begins.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from ...blocks.core import kinetic_level
from ...blocks.effect import Effect
from ...cached import cached_property
from ...checks import above
from ...thresholds import NOTHING
from ..estimation.fit import FitResult
from ..estimation.segmented import SegmentedData
from ..estimation.starts import continued_states
from ..shooting.scales import Scales
from .dead_times import dead_times
from .extend import extended
from .regression import ForceFit, Start, force_fit, motion_of, regressed
from .ripple_spectrum import Wave
from .ripple_starts import long_wave, long_waves, waves
from .thresholds import AS_IT_IS, FACTOR_MOST, STARTS_APART
from .value_grid import value_grid


class Screen:
    """The refitted baseline as a linear map: its residual, what refitting could change projected out.

    What `Effect.suggest` and `Effect.regress` may ask of it: `block`, `bodies`, `friction`, `scales`
    (``force``, ``position``, ``speed``, ``mass``, ``of(unit)``), `motion` (``u``, ``x``, ``v``, ``a``),
    `force_fit`, `step`, `long_waves`, `waves`, `dead_times`.

    Parameters
    ----------
    base : FitResult
        The baseline fitted to segments that are short: there even a strong effect changes the output nearly
        linearly.
    data : SegmentedData
        In those segments.
    """

    def __init__(self, base: FitResult, data: SegmentedData):
        self.base, self.data = base, data
        self.view = data.train
        self.motion = motion_of(data.train, data.decimation, base.model)
        self.sensitivity = base.sensitivity
        self.residual = self.project(base.residual)
        self.simulators = [data.simulator(base.model, r) for r in self.view.records]

    @property
    def power(self) -> float:
        """Sum of the squared residual."""
        return float(self.residual @ self.residual)

    @property
    def scales(self) -> Scales:
        """Typical sizes in the records."""
        return self.data.scales

    @property
    def block(self):
        """The refitted baseline."""
        return self.base.model

    @property
    def friction(self) -> float:
        """Its dry friction while it moves [N]."""
        return kinetic_level(self.block.effects)

    @property
    def bodies(self) -> int:
        """Its bodies, 1 or 2."""
        return self.block.core.bodies

    def step(self) -> float:
        """Return the step of the grid to which measured values keep [m]; 0 where there is none."""
        noise = math.sqrt(self.power / len(self.residual))
        return value_grid(np.concatenate(self.data.train.outputs), noise)

    def force_fit(self, columns) -> ForceFit:
        """Regress the force on the motion, by the model's own laws and further columns over `motion`."""
        return force_fit(self.motion, self.scales, self.block, columns)

    def long_waves(self, make: Callable[..., Effect]) -> Iterator[Effect]:
        """Yield ripples ``make(amplitude [N], wavelength [m], phase)``, the long ones that explain most."""
        return long_waves(self, make)

    def long_wave(self, make: Callable, wavelength: float) -> tuple[float, float, float] | None:
        """Return what a ripple of this length leaves of the residual, its amplitude [N] and its phase."""
        return long_wave(self, make, wavelength)

    def waves(self, reversing: bool = False) -> Iterator[tuple[Wave, dict[str, float]]]:
        """Yield ripples of any length that explain most, with values of the model's parameters beside.

        `reversing`: ripples of friction.
        """
        return waves(self, reversing)

    @cached_property
    def dead_times(self) -> tuple[tuple[float, dict[str, float]], ...]:
        """A dead time [s] that explains most of the force, with values of the model's parameters, if any."""
        return tuple(dead_times(self.data, self.block))

    def project(self, signals) -> np.ndarray:
        """Remove what the baseline's parameters and initial states can explain."""
        return self.sensitivity.project(signals) if self.sensitivity is not None else np.concatenate(signals)

    def starts(self, block) -> list[np.ndarray]:
        """Return the baseline's initial states as those of a block with an effect more."""
        return [
            continued_states(self.data.simulator(block, r), w, old, start)
            for r, w, old, start in zip(
                self.view.records, self.view.segments, self.simulators, self.base.starts, strict=True
            )
        ]

    def change(self, block) -> list[np.ndarray] | None:
        """Return the change of output from the baseline to `block`; None if it cannot be simulated."""
        return self.changes([block])[0]

    def changes(self, blocks: Sequence) -> list[list[np.ndarray] | None]:
        """Return the same of blocks that differ by the values of their newest effect alone, in one call."""
        first, *others = blocks
        own = [k for k in first.parameters if k.startswith(f"{first.newest}.")]
        values = [None, *({k: b.parameters[k].value for k in own} for b in others)]
        found: list[list[np.ndarray]] = [[] for _ in blocks]
        for record, segments, start, y in zip(
            self.view.records, self.view.segments, self.starts(first), self.base.simulated, strict=True
        ):
            simulator = self.data.simulator(first, record)
            outputs = simulator.run_all([(segments, v, start) for v in values], rounded=True)
            for change, out in zip(found, outputs, strict=True):
                change.append(out - y)
        return [change if all(np.all(np.isfinite(c)) for c in change) else None for change in found]


def starts_for(cls, screen: Screen, proposed, keep: int = 2) -> list[Start]:
    """Return the best start values for one effect class, best first; `proposed`: effects of it."""
    found: list[Start] = []
    total = screen.power
    for effect in proposed:
        found += _ranked_starts(effect, screen, total)
    found.sort(key=lambda s: s.left)
    chosen: list[Start] = list(regressed(cls, screen))
    keep += len(chosen)
    for start in found:
        if all(_apart(start.effect, other.effect) for other in chosen):
            chosen.append(start)
        if len(chosen) == keep:
            break
    return chosen


def _ranked_starts(effect, screen, total) -> Iterator[Start]:
    block = extended(screen.block, effect)
    change = None if block is None else screen.change(block)
    if block is None or change is None or total == 0:
        return
    change = screen.project(change)
    power = float(change @ change)
    if power == 0:
        return
    left = screen.residual - change
    yield Start(block.effects[-1], float(left @ left) / total)
    if effect.proportional:
        # For a small effect the change is proportional to it: scale it to the residual.
        factor = float(change @ screen.residual) / power
        other = scaled(effect, factor)
        if other is not None and not 1 / AS_IT_IS < factor < AS_IT_IS:
            again = extended(screen.block, other)
            moved = None if again is None else screen.change(again)
            if again is not None and moved is not None:
                left = screen.residual - screen.project(moved)
                yield Start(again.effects[-1], float(left @ left) / total)


def scaled(effect, factor: float):
    """Return an effect with its first parameter larger by a factor; None where its range excludes that."""
    name, p = next(iter(effect.parameters.items()))
    value = p.value * min(max(factor, -FACTOR_MOST), FACTOR_MOST)
    if not (above(value, p.lower, p.strict) and value <= p.upper and value):
        return None
    return effect.replace(**{name: value})


def _apart(a, b):
    return a.side != b.side or any(
        abs(x - y) > STARTS_APART * max(abs(x), abs(y), NOTHING)
        for x, y in zip(a.values, b.values, strict=True)
    )
