"""One diagnosis at work: the baseline, every candidate fitted, the best confirmed at the full rate."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from .attach import applicable, attach
from .equivalence import indistinguishable
from .evidence import ROUNDED, ranked
from .joint_search import resonant
from .proposals import proposals
from .regression import Start, force_regression, motion_of
from .screen import Screen, starts_for
from .simulator import feasible
from .trial import FORCED, Data, Trial, prepare
from .valleys import all_hopped, begun_at, hopped, own, settled

CONFIRMED = 6
"""Most candidates that are refitted at the full rate: two, and all that the first look left near the best."""

CONFIRMED_FORCED = 10
"""The same where the machine's own forces wander."""

# Best error over windows four times as long that still counts as the same.
_GROWTH = 1.35
# Evidence [nats] by which candidates may differ because their fits stopped early.
_CLOSE = 60.0
# Width of a Stribeck bump over the typical speed below which it is stiction.
_NARROW = 1e-3
# Error over the least that windows of the shortest length leave, up to which a fit has nothing to gain.
_FLOOR = 1.03

# Effects whose error has many valleys over long windows: short ones first.
_CURVED = frozenset(
    {
        "stribeck",
        "stiction",
        "bristle",
        "backlash",
        "compliance",
        "position_ripple",
        "hard_stop",
        "load_friction",
    }  # fmt: skip
)


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
        data = prepare(block, records, held)
        self.nominal = {k: p.value for k, p in block.parameters.items()}
        self._look_at(data, 1)
        self.base = self._baseline(block)
        self.floor = 0.0  # error that a fit can come down to at best, from `confirm` on
        # friction that wanders drowns all else over longer windows
        near = self.levels[0].moved(self.base.train)
        if near.rmse > FORCED * data.noise and not data.clean:
            self._look_at(self.levels[0].wandering, 0)
            self.base = Trial("", self.data.fit(near.model, self.free))

    def _look_at(self, data: Data, which: int):
        self.levels = data.levels
        self.data = self.levels[which]

    def _baseline(self, block) -> Trial:
        """Fit the baseline from its own values and from a regression of the force; keep the better."""
        shortest, data = self.levels[:2]
        begins, table = [block], block.parameters
        names = {"mass", "coulomb.level", "viscous.coefficient"}
        w, _ = force_regression(motion_of(data.train, data.thin), data.scales, names)
        guess = dict(zip(("mass", "coulomb.level", "viscous.coefficient"), w, strict=False))
        guess = {k: float(v) for k, v in guess.items() if k in table and k in self.free and v > 0}
        if guess:
            begins.append(block.with_parameters(feasible(block, guess)))
        found = []
        for begin in begins:
            found.append(data.moved(shortest.fit(begin, self.free, iterations=8), 12))
        return Trial("", min(found, key=lambda f: f.rmse))

    # --- every effect, coarsely -----------------------------------------------------------------------

    def candidates(self, classes, executor=None) -> list[Trial]:
        """Return every effect that can be added, fitted, the one with most evidence first."""
        longest = self.levels[-1]
        base, found = self._look(classes, executor, self.data.sampled)
        there = base.rmse if self.data.forced else longest.moved(base).rmse
        if there > _GROWTH * base.rmse:
            # Short windows show nothing, long ones do: what is missing acts seldom, or slowly.
            moved = self._over_long_windows(base.rmse, there, found)
            if moved is not None:
                base, again = self._look(classes, executor, longest)
                found = _best_of(base, [*moved, *again])
        if found:
            self._rebase(found)
        return found

    def _over_long_windows(self, here, there, found) -> list[Trial] | None:
        """Return the best by error moved to the longest windows; None where they explain enough there.

        `here`, `there`: error of the baseline where the trials were fitted, and over the longest windows.
        """
        if found and found[0].train.rmse <= 0.8 * here:
            return None
        longest = self.levels[-1]
        best = sorted(found, key=lambda t: t.train.rmse)[:CONFIRMED]
        moved = [replace(t, train=longest.moved(t.train, 4, 1e-2)) for t in best]
        shows = found and found[0].train.rmse <= 0.97 * here
        return None if shows and min(t.train.rmse for t in moved) <= 0.5 * there else moved

    def _look(self, classes, executor, data: Data):
        """Fit every effect over one set of windows; return the baseline there and the effects, best first."""
        base = data.moved(self.base.train, 3)
        screen = Screen(base, data)
        run = map if executor is None else executor.map
        kinds = [c for c in classes if applicable(c, screen.block)]
        nominal = {k: self.nominal[k] for k in self.free if k in screen.block.parameters}
        jobs = [(cls, screen, self.levels[0].sampled, self.free, nominal) for cls in kinds]
        found = [t for t in run(_try, jobs) if t is not None]
        return base, ranked(Trial("", base), found)[0]

    def _rebase(self, found):
        """Refit the baseline from what the best candidates say of its parameters: it may have been stuck."""
        for tried in found[:2]:
            values = {k: tried.block.parameters[k].value for k in self.free}
            block = self.base.block
            again = self.data.fit(block.with_parameters(feasible(block, values)), self.free, iterations=8)
            if again.rmse < self.base.train.rmse:
                self.base = Trial("", again)

    # --- the best, carefully --------------------------------------------------------------------------

    def confirm(self, found) -> list[Trial]:
        """Refit baseline and best candidates at the full rate; return these candidates, best first.

        The windows are of the length that suits these data (`_longest_coherent`).
        """
        # Wandering forces let the first look tell little.
        found = _promising(found, CONFIRMED_FORCED, 0.0) if self.data.forced else _promising(found)
        stages, floor = self._stages([self.base.train, *(t.train for t in found)])
        self.floor = floor
        levels, at = list(self.levels), _longest_coherent(stages)
        if at == 0 and not self.data.forced:
            # Longer windows show what no candidate explains: hidden states, fitted anew in many short ones,
            # would pass for it.
            levels[0] = levels[0].chained
            stages[0] = [levels[0].moved(f) if levels[0].carries(f.model) else f for f in stages[0]]
            at = _longest_coherent(stages)
        if found and found[0].key == ROUNDED and not self.data.forced:
            # An error of whole steps of the sensor is averaged out by long windows, followed by short ones.
            at = len(stages) - 1
        self.data = levels[at]
        fine = self.data.fine
        best = [
            fine.judged(replace(t, train=fine.moved(f, 3, 1e-3), confirmed=True))
            for t, f in zip((self.base, *found), stages[at], strict=True)
        ]
        self.base = best[0]
        chosen, self.noise = ranked(self.base, best[1:])
        if not chosen:
            return []
        chosen = self._again(chosen, chosen[:1])
        # Near equals are told apart by fits that have come to an end, and in the right valley.
        near = [t for t in chosen if chosen[0].evidence - t.evidence < _CLOSE]
        close = [t for t in chosen if t in near or t.evidence > 0.5 * chosen[0].evidence]
        least = min(t.train.rmse for t in chosen)
        ended = [self._ended(t, t in near and len(near) > 1, floor, least) for t in close]
        if any(a is not b for a, b in zip(ended, close, strict=True)):
            chosen = self._again([*ended, *(t for t in chosen if t not in close)], ended)
        span = max(float(np.ptp(r.y)) for r in self.data.train.records)
        chosen, self.noise = ranked(self.base, [t for t in chosen if _itself(t, span)])
        return chosen

    def _stages(self, fits):
        """Return the fits in windows of every length that may judge, the shortest first, and their floor.

        The floor is the error that a fit can come down to at best: over short windows nearly every model
        follows. Where forces wander, the shortest windows alone may judge.
        """
        shortest, middle, longest = self.levels
        if self.data.forced:
            short = [shortest.moved(f) for f in fits]
            return [short], _FLOOR * min(f.rmse for f in short)
        fits = [middle.moved(f) for f in fits]
        short = [shortest.moved(f) for f in fits]
        floor = _FLOOR * min(f.rmse for f in short)
        fits = all_hopped(fits, middle, floor)
        return [short, fits, all_hopped([longest.moved(f) for f in fits], longest, floor)], floor

    def _ended(self, tried: Trial, exactly: bool, floor: float, least: float) -> Trial:
        """Return a candidate in its best valley, unless nothing better is possible.

        `exactly`: iterated to the end first. `least`: error of the best of all [m].
        """
        fine, fit = self.data.fine, tried.train
        if exactly:
            fit = fine.moved(fit, 8, 1e-6)
        if own(fit) and fit.rmse > floor and least > floor and not fine.forced:
            fit = hopped(fit, fine.fit, own(fit))
        return settled(tried if fit is tried.train else fine.judged(replace(tried, train=fit)), fine)

    def _again(self, chosen, those) -> list[Trial]:
        """Begin candidates once more where each of `those` ended; keep every effect's best, best first."""
        fine = self.data.fine
        begun = [begun_at(t, best, fine) for best in those for t in chosen if t is not best]
        judged, _ = ranked(self.base, [*chosen, *(t for t in begun if t is not None)])
        return [next(t for t in judged if t.key == key) for key in dict.fromkeys(t.key for t in judged)]

    def alike(self, a: Trial, b: Trial) -> bool:
        """Whether two candidates make the same of these data, within noise or as the limit of each other."""
        if {a.key, b.key} == {"stiction", "stribeck"}:
            # a bump this narrow is passed within a sample: only breaking away is seen of it
            narrow = next(t for t in (a, b) if t.key == "stribeck").block.effects[-1].velocity
            if narrow < _NARROW * self.data.scales.speed:
                return True
        return indistinguishable(a.outputs, b.outputs, self.noise)


def _itself(tried: Trial, span) -> bool:
    """Whether the newest effect is what its name says, and no stand-in for another.

    A ripple of which the stroke `span` [m] shows less than a period is a spring, a joint with nothing behind
    it (or before it) is a dashpot.
    """
    bounds = dict(zip(tried.train.names, tried.train.at_bound, strict=True))
    if bounds.get(f"{tried.block._keys[-1]}.load_fraction", False):
        return False
    return getattr(tried.block.effects[-1], "wavelength", 0.0) < 0.9 * span


def _best_of(base, trials) -> list[Trial]:
    """Return every effect's best fit, best first."""
    best: dict[str, Trial] = {}
    for t in trials:
        if t.key not in best or t.train.rmse < best[t.key].train.rmse:
            best[t.key] = t
    return ranked(Trial("", base), best.values())[0]


def _promising(found, most=CONFIRMED, share=0.2) -> list[Trial]:
    """Return the candidates to confirm: the first two, and all near the best by evidence or by error.

    `most`: of them by evidence, `share` of the best one's that is near.
    """
    close = sorted(found, key=lambda t: t.train.rmse)[:3]
    close = [t for t in close if t.train.rmse < 1.5 * close[0].train.rmse]
    likely = found[:2] + [t for t in found[2:most] if t.evidence > share * found[0].evidence]
    return likely + [t for t in close if not any(t is o for o in likely)]


def _longest_coherent(stages) -> int:
    """Return the level to judge at: the longest windows over which the best model's error does not grow.

    `stages`: fits per level, short windows first, the baseline's and then the candidates'. Where the
    best grows with the length (motion that is sensitive to its start, force noise in a real machine, an
    effect outside the library) short windows are clearer, provided that they show what is missing as well
    as long ones do.
    """
    errors = [[f.rmse for f in stage] for stage in stages]
    base, best = [e[0] for e in errors], [min(e) for e in errors]
    at = 0
    while at + 1 < len(errors) and best[at + 1] <= _GROWTH * best[at]:
        at += 1
    if at + 1 < len(errors) and best[at] > 0.8 * base[at] and _left(base, best, at) > _left(base, best, -1):
        return len(errors) - 1
    return at


def _left(base, best, at) -> float:
    """Return the share of the baseline's error beyond noise that the best leaves; 1 where hardly any is."""
    noise = best[0] ** 2
    there = base[at] ** 2 - noise
    return math.sqrt(max(best[at] ** 2 - noise, 0.0) / there) if there > 0.1 * noise else 1.0


def _try(job) -> Trial | None:
    """Fit one effect class from its best start values (a job of its own, for executors)."""
    cls, screen, shortest, free, nominal = job
    found = []
    starts = starts_for(cls, screen)
    for i, start in enumerate(starts):
        if i and not starts[0].values and start.left > 1.5 * starts[0].left + 0.02:
            break
        found += _fitted(start, screen, shortest, free)
    if cls.id in _CURVED or screen.block.core.bodies == 2:
        # The baseline may have bent far from the truth to make up for what is missing: begin where the user
        # does.
        for effect in _spread(list(proposals(cls, screen)), 1 + screen.block.core.bodies):
            found += _fitted(Start(effect, 0.0, tuple(nominal.items())), screen, shortest, free)
    if cls.role == "coupling" and screen.block.core.bodies == 1:
        for near in resonant(screen, 3):
            added = _own_names(near.model)
            fitted = screen.data.fit(
                near.model, (*free, *added), starts=near.starts, iterations=14, tolerance=3e-3
            )
            found.append(Trial(cls.id, fitted, extra=len(added)))
    span = float(np.ptp(screen.motion.x))
    found = [t for t in found if _itself(t, span)]
    return min(found, key=lambda t: t.train.rmse, default=None)


def _spread(effects, count):
    """Return some of the effects, evenly from the first to the last."""
    return [effects[round((i + 0.5) * len(effects) / count - 0.5)] for i in range(min(count, len(effects)))]


def _fitted(start: Start, screen: Screen, shortest: Data, free):
    base = screen.block.with_parameters(feasible(screen.block, dict(start.values)))
    block = attach(base, start.effect)
    if block is None:
        return
    data, added = screen.data, _own_names(block)
    names = (*free, *(() if start.effect.id == ROUNDED else added))
    if start.effect.id in _CURVED:
        # a joint changes everything at once, and so does what rubs behind it: their valleys are long and bent
        bent = start.effect.role in ("contact", "coupling") or start.effect.id == "load_friction"
        steps, tolerance = (14, 3e-3) if bent else (6, 1e-2)
        fitted = data.moved(shortest.fit(block, names, iterations=steps, tolerance=tolerance), 4, 1e-2)
    else:
        begin = None if start.values else screen.starts(block)
        fitted = data.fit(block, names, starts=begin, iterations=6, tolerance=1e-2)
    yield Trial(start.effect.id, fitted, extra=len(added))


def _own_names(block) -> tuple[str, ...]:
    """Return the parameters of a block's newest effect that a fit may move."""
    key = block._keys[-1] + "."
    return tuple(k for k, p in block.parameters.items() if k.startswith(key) and p.free)
