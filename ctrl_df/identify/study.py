"""One diagnosis at work: the baseline, every candidate fitted, the best confirmed at the full rate."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from .attach import applicable, attach
from .equivalence import indistinguishable, whitened_power, whitener
from .screen import Screen, Start, force_regression, motion_of, starts_for
from .simulator import feasible
from .trial import Data, Trial, prepare

CONFIRMED = 6
"""Candidates that are refitted at the full rate."""

# Effects whose error has many valleys over long windows: short ones first.
_CURVED = frozenset({"stribeck", "stiction", "bristle", "backlash", "compliance", "position_ripple"})


class Study:
    """The fits of one diagnosis.

    Parameters
    ----------
    block : Mechanism
        The model as it stands.
    records, held : sequences of Measurement
        To learn from; to be judged by (may be empty).
    free : tuple of str
        Parameters of the model that may be refitted.
    """

    def __init__(self, block, records, held, free):
        self.free = free
        self.data = prepare(block, records, held)
        self.base = self._baseline(block)

    def _baseline(self, block) -> Trial:
        """Fit the baseline from its own values and from a regression of the force on motion; keep the better."""
        begins, table, data = [block], block.parameters, self.data
        w, _ = force_regression(motion_of(data.train, data.thin), data.scales)
        guess = dict(zip(("mass", "coulomb.level", "viscous.coefficient"), w, strict=False))
        guess = {k: float(v) for k, v in guess.items() if k in table and k in self.free and v > 0}
        if guess:
            begins.append(block.with_parameters(feasible(block, guess)))
        found = []
        for begin in begins:
            near = data.fit(begin, self.free, view=data.short, iterations=10)
            found.append(data.fit(near.model, self.free, iterations=20))
        return data.judged("", min(found, key=lambda f: f.rmse))

    # --- every effect, coarsely -----------------------------------------------------------------------

    def candidates(self, classes, executor=None) -> list[Trial]:
        """Return every effect that can be added, fitted, the one with most evidence first."""
        data = self.data
        # Start values are read off short windows: there even a strong effect changes the output nearly linearly.
        screen = Screen(data.fit(self.base.block, self.free, view=data.short, iterations=6), data)
        run = map if executor is None else executor.map
        jobs = [(cls, screen, self.free) for cls in classes if applicable(cls, screen.block)]
        span = float(np.ptp(screen.motion.x))
        found = [t for t in run(_try, jobs) if t is not None and _periodic_enough(t, span)]
        self._rebase(self.ranked(found))
        return self.ranked(found)

    def ranked(self, trials) -> list[Trial]:
        """Return the trials with their evidence over the baseline, best first.

        Residuals are whitened by the noise model of the best one's.
        """
        best = min([self.base, *trials], key=lambda t: t.size)
        self.noise = noise = whitener(best.residuals)
        base_power, count = whitened_power(self.base.residuals, noise)
        judged = []
        for t in trials:
            power, _ = whitened_power(t.residuals, noise)
            gain = 0.5 * count * math.log(base_power / power) - 0.5 * t.extra * math.log(count)
            judged.append(replace(t, evidence=gain))
        return sorted(judged, key=lambda t: -t.evidence)

    def _rebase(self, found):
        """Refit the baseline from what the best candidates say of its parameters: it may have been stuck."""
        for tried in found[:2]:
            values = {k: tried.block.parameters[k].value for k in self.free}
            block = self.base.block
            again = self.data.fit(block.with_parameters(feasible(block, values)), self.free, iterations=10)
            if again.rmse < self.base.train.rmse:
                self.base = self.data.judged("", again)

    # --- the best, carefully --------------------------------------------------------------------------

    def confirm(self, found) -> list[Trial]:
        """Refit the baseline and the best candidates at the full rate; return these, best first."""
        fine = self.data.fine
        self.base = self._polished(self.base, fine)
        chosen = self.ranked([self._polished(t, fine) for t in found[:CONFIRMED]])
        return chosen

    def _polished(self, tried: Trial, fine: Data) -> Trial:
        better = fine.fit(tried.block, tried.train.names, starts=tried.train.starts, iterations=3)
        return fine.judged(tried.key, better, tried.extra, tried, confirmed=True)

    def alike(self, a: Trial, b: Trial) -> bool:
        """Whether two candidates make the same of these data, within noise."""
        return indistinguishable(a.outputs, b.outputs, self.noise)


def _periodic_enough(tried: Trial, span) -> bool:
    """Refuse a ripple of which the stroke shows less than a period: that is a spring by another name."""
    return getattr(tried.block.effects[-1], "wavelength", 0.0) < 0.9 * span


def _try(job) -> Trial | None:
    """Fit one effect class from its best start values (a job of its own, for executors)."""
    cls, screen, free = job
    found = []
    starts = starts_for(cls, screen)
    for i, start in enumerate(starts):
        if i and not starts[0].values and start.left > 1.5 * starts[0].left + 0.02:
            break
        found += _fitted(start, screen, free)
    if not found:
        return None
    key, candidate, extra = min(found, key=lambda f: f[1].rmse)
    return screen.data.judged(key, candidate, extra)


def _fitted(start: Start, screen: Screen, free):
    base = screen.block.with_parameters(feasible(screen.block, dict(start.values)))
    block = attach(base, start.effect)
    if block is None:
        return
    key, data = list(block._keys)[-1], screen.data
    own = [
        f"{key}.{n}"
        for n, p in start.effect.parameters.items()
        if p.free and f"{key}.{n}" in block.parameters
    ]
    rough = "sensor_quantization" in key
    names = (*free, *(() if rough else own))
    if start.effect.id in _CURVED:
        near = data.fit(
            block, names, view=data.short, starts=screen.starts(block), iterations=8, tolerance=3e-3
        )
        block = near.model
    yield start.effect.id, data.fit(block, names, iterations=1 if rough else 12), len(own)
