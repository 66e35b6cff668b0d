"""The fits of all effects: started from many values, completed where they may still be the best.

They run in parallel, in rounds: a few steps from every start, then the two best until they converge, then the
rest, each given up as soon as it is hopeless against these. Which fits these are follows from the data alone,
so that results do not depend on how many run at once.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...simulate.parallel import side_by_side
from ..estimation.fit import FitResult
from ..estimation.per_record import start_with_angles
from ..estimation.segmented import CandidateFit, SegmentedData
from ..prediction.values import with_values
from ..starting.extend import applicable, divisions, extended
from ..starting.proposals import proposals
from ..starting.read_again import read_again
from ..starting.regression import Start, regressed
from ..starting.resonance_grid import is_joint, resonating
from ..starting.screen import Screen, starts_for
from ..thresholds import GIVE_UP, GROWTH, STILL_POSSIBLE
from .equivalence import nearest, penalized
from .thresholds import (
    ANOTHER_START,
    BEGUN,
    EFFORT_ILL_CONDITIONED,
    EFFORT_MOVED,
    EFFORT_TRIED,
    JOINTS,
    KEPT,
    LOAD_SHARES,
    PROMISES,
)


@dataclass(frozen=True, eq=False)
class Attempt:
    """One fit of one effect, not yet completed.

    Attributes
    ----------
    key : str
        Id of the effect.
    block : Mechanism
        The model where the fit starts, or as fitted so far.
    names : tuple of str
        Parameters that are fitted.
    short : bool
        Whether it begins over short segments, not over those of the screen.
    steps, tolerance : int, float
        Iterations left there, and the relative gain of the cost at which they end.
    extra : int
        Parameters beyond the baseline's.
    starts : list of arrays or None
        Initial states of segments at the start.
    fit : FitResult or None
        The result so far.
    nominal : bool
        Whether it starts from the user's values, or from what the motion tells of the model's laws.
    """

    key: str
    block: Any
    names: tuple[str, ...]
    short: bool
    steps: int
    tolerance: float
    extra: int
    starts: list[np.ndarray] | None = None
    fit: FitResult | None = None
    nominal: bool = False

    @property
    def error(self) -> float:
        """Error of the fit so far, by as much more as its parameters cost."""
        return penalized(self.trial)

    @property
    def multimodal(self) -> bool:
        """Whether fits of its effect start in short segments."""
        return self.block.effects[-1].multimodal

    @property
    def trial(self) -> CandidateFit:
        """The fit so far, as a candidate."""
        assert self.fit is not None
        return CandidateFit(self.key, self.fit, extra=self.extra)


def fit_effects(
    classes,
    screen: Screen,
    short: SegmentedData | None,
    free,
    nominal,
    executor=None,
    on_screened=None,
    reached: float = math.inf,
    small: bool = False,
) -> list[CandidateFit]:
    """Return every effect that can be added, fitted over the segments of the screen.

    Parameters
    ----------
    classes : sequence of effect classes
    screen : Screen
    short : SegmentedData or None
        Short segments, where fits of multimodal effects start; None: they start in those of the screen, with
        the initial states of the model without them.
    free : tuple of str
        Parameters of the baseline that are refitted.
    nominal : mapping
        Their values as the user has them.
    executor : concurrent.futures.Executor or None
        Runs the fits in parallel; None: threads do.
    on_screened : callable or None
        Takes every effect by what its best start explains, before any fit.
    reached : float
        Error of a known model: all fits start from the nominal values, too, and those that cannot come near
        it are given up.
    small : bool
        Whether what is missing is small beside the noise. What it changes is then linear in its size: linear
        estimates know where the best fit of an effect starts, and the model has its values already.
    """
    known = math.isfinite(reached)
    span = float(np.ptp(screen.motion.x))

    def run(function: Callable, jobs: list) -> list:
        return side_by_side(function, jobs, executor)

    kinds = [c for c in classes if applicable(c, screen.block)]
    read = {} if known or small else read_again(screen.block, screen.data)
    read = {k: v for k, v in read.items() if k in free}
    places = _Places(screen, short, _screen_about(screen, nominal, free), tuple(nominal.items()))
    if read:
        places = replace(places, motion=_screen_about(screen, read, free), read=tuple(read.items()))
    joints = [c for c in kinds if is_joint(c, screen)] if screen.block.core.bodies == 1 and not small else []
    begun = _attempts_beside if known else _linear_attempts if small else _attempts_of
    started = run(begun, [(c, screen, places, free) for c in kinds])
    if on_screened is not None:
        on_screened(_ranked_starts(started, screen))
    resonating = run(_joint_attempts, [(c, s, screen, free) for c in joints for s in LOAD_SHARES])
    resonating = _best_of_each_effect([a for found in resonating for a in found], JOINTS)
    attempts = resonating + [a for _, found in started for a in found]
    kept, within = (1, 0.0) if known else (KEPT, GROWTH)
    rounds = _Rounds(run, places, span, kept, within, GIVE_UP * reached)
    later = {c.id: c for c in kinds if c.generalizes in kinds}
    best = rounds.fitted(
        [a for a in attempts if a.key not in later], _Best({}, min(screen.base.rmse, reached))
    )
    promising = [c for c in later.values() if best.promises(c.generalizes.id, screen.base.rmse)]
    further = [_attempt_from_special(c, best.fits[c.generalizes.id], screen, places, free) for c in promising]
    further += [a for a in attempts if any(a.key == c.id for c in promising)]
    # beside noise a small error tells no side
    divided = not (small or screen.block.core.loose)
    loose = {a.key for a in attempts if divided and a.block.core.loose and best.near(a.key)}
    for block in divisions(screen.block) if loose else ():
        at = places.divided(block)
        begun_there = run(begun, [(c, at.screen, at, free) for c in kinds if c.id in loose])
        further += [a for _, found in begun_there for a in found]
        further += [replace(a, block=_as_divided(a.block, block)) for a in resonating if a.key in loose]
    best = rounds.fitted([a for a in further if a is not None], best)
    return [best.fits[c.id] for c in kinds if c.id in best.fits]


def _screen_about(screen: Screen, values: Mapping[str, float], free) -> Screen:
    """Return the screen about the model with other values."""
    model = with_values(screen.block, values)
    starts = screen.data.states_of(model).starts
    return Screen(screen.data.fit(model, tuple(free), starts=starts, iterations=0), screen.data)


@dataclass(frozen=True, eq=False)
class _Places:
    """Where fits start.

    Attributes
    ----------
    screen : Screen
    short : SegmentedData or None
        Where those of multimodal effects start; None: where all others do.
    user : Screen
        About the user's model without an effect.
    values : tuple of (str, float)
        Values of the user's model.
    motion : Screen or None
        About the model with what the motion tells of it; None: that is nothing.
    read : tuple of (str, float)
        What the motion tells.
    """

    screen: Screen
    short: SegmentedData | None
    user: Screen
    values: tuple[tuple[str, float], ...]
    motion: Screen | None = None
    read: tuple[tuple[str, float], ...] = ()

    def divided(self, block) -> _Places:
        """Return the same places where what acts on the machine is divided as in `block`; it moves alike."""

        def moved(screen: Screen) -> Screen:
            return Screen(replace(screen.base, model=_as_divided(screen.block, block)), screen.data)

        motion = self.motion and moved(self.motion)
        return replace(self, screen=moved(self.screen), user=moved(self.user), motion=motion)

    def begins_short(self, multimodal: bool) -> bool:
        """Whether a fit begins over short segments."""
        return multimodal and self.short is not None and self.short is not self.screen.data

    def data(self, attempt: Attempt) -> SegmentedData:
        """Return the segments in which an attempt begins."""
        return self.short if attempt.short and self.short is not None else self.screen.data

    def starts(self, block, values, multimodal: bool) -> list[np.ndarray] | None:
        """Return the initial states of the model without an effect as those of a block with one.

        None where fits start from the measured states. `values`: of the model, where the block has not those
        of the screen.
        """
        if (self.short is not None and multimodal) or (values and values != self.values):
            return None
        data = self.screen.data
        return data.starts_as(block, data.train.records, self.user.base if values else self.screen.base)


@dataclass(frozen=True, eq=False)
class _Best:
    """The best fit of every effect so far, and the least error of any model."""

    fits: Mapping[str, CandidateFit]
    least: float

    def near(self, key: str) -> bool:
        """Whether an effect may yet turn out to be the right one."""
        return key in self.fits and self.fits[key].train.rmse < STILL_POSSIBLE * self.least

    def promises(self, key: str, base: float) -> bool:
        """Whether an effect fits so well that one which contains it may be the right one.

        `base`: error of the model without it.
        """
        if key not in self.fits:
            return False
        error = self.fits[key].train.rmse
        explained, most = base**2 - error**2, base**2 - self.least**2
        return error < GIVE_UP * self.least and explained > PROMISES * most


@dataclass(frozen=True, eq=False)
class _Rounds:
    """Rounds in which the fits of many effects compete.

    Attributes
    ----------
    run : callable
        Runs jobs in parallel.
    places : _Places
    span : float
        Stroke of the records [m].
    kept : int
        Fits of an effect that are continued after the first steps.
    within : float
        Those within so many times the error of the best are continued, too.
    near : float
        Error above which a fit is given up.
    """

    run: Callable
    places: _Places
    span: float
    kept: int
    within: float
    near: float

    def fitted(self, attempts: list[Attempt], best: _Best) -> _Best:
        """Complete the attempts that may be the best of their effect; return the best of all effects."""
        # those of few steps first: their errors show which of the others can be given up early
        started = self._run(_first_steps, [a for a in attempts if not a.multimodal], self.near)
        least = min([best.least, *(a.error for a in started)])
        started += self._run(_first_steps, [a for a in attempts if a.multimodal], GIVE_UP * least)
        started = [a for a in started if distinct(a.trial, self.span)]
        kept = _best_of_each_effect(started, self.kept, self.within)
        # a few steps from the user's values show little: the baseline may have ended in another minimum
        own = [a for a in started if a.nominal]
        own = [
            a
            for short in (False, True)
            for a in _best_of_each_effect([a for a in own if a.short is short], 1)
        ]
        started = [*kept, *(a for a in own if not any(a is o for o in kept))]
        ahead = _best_of_each_effect(started, 1)[:2]
        found = self._run(_completed, ahead, self.near)
        least = min([least, *(t.train.rmse for t in found)])
        rest = [a for a in started if not any(a is o for o in ahead)]
        found += self._run(_completed, rest, GIVE_UP * least)
        fits = dict(best.fits)
        for t in found:
            known = fits.get(t.key)
            if distinct(t, self.span):
                fits[t.key] = t if known is None else nearest(t, known)
        return _Best(fits, min([least, *(t.train.rmse for t in found)]))

    def _run(self, function: Callable, attempts, give_up: float) -> list:
        there = self.places.screen.data
        return self.run(function, [(a, self.places.data(a), there, give_up) for a in attempts])


def _ranked_starts(started, screen: Screen) -> list[CandidateFit]:
    """Return every effect with what its best start explains, before any fit, best evidence first.

    The share of the residual that a start leaves is a linear estimate: good enough for an order.
    """
    base, found = screen.base, []
    samples = len(screen.residual)
    for starts, attempts in started:
        known = [s for s in starts if s.left > 0]  # of regressions of the force it is not known
        if not known or not attempts:
            continue
        best = min(known, key=lambda s: s.left)
        block = extended(screen.block, best.effect)
        if block is None:
            continue
        left, extra = math.sqrt(best.left), screen.data.count(block, own_names(block))
        fit = replace(base, model=block, rmse=base.rmse * left, nrmse=base.nrmse * left, linear=None)
        evidence = -samples * math.log(left) - 0.5 * extra * math.log(samples)
        found.append(CandidateFit(best.effect.id, fit, extra=extra, evidence=evidence))
    return sorted(found, key=lambda t: -t.evidence)


def distinct(fitted: CandidateFit, span) -> bool:
    """Whether the newest effect is what its name says over the stroke `span` [m]."""
    own = fitted.block.newest + "."
    at_bound = {name.removeprefix(own) for name in fitted.train.names_at_bound if name.startswith(own)}
    return fitted.block.effects[-1].distinct(span, at_bound)


def _best_of_each_effect(attempts, count, within=0.0) -> list[Attempt]:
    """Return the best of each effect, the best first: so many, and all within so many times its error."""
    kept = []
    for a in sorted(attempts, key=lambda a: a.error):
        same = [o for o in kept if o.key == a.key]
        if len(same) < count or a.error <= within * same[0].error:
            kept.append(a)
    return kept


# --- jobs -----------------------------------------------------------------------------------------


def _joint_attempts(job) -> list[Attempt]:
    """Return the attempts at a joint with a share of the mass behind it."""
    cls, share, screen, free = job
    found = []
    for near in resonating(cls, screen, share, JOINTS):
        names = own_names(near.model)
        found.append(
            Attempt(
                cls.id,
                near.model,
                (*free, *names),
                False,
                *EFFORT_ILL_CONDITIONED,
                screen.data.count(near.model, names),
                near.starts,
                near,
            )  # fmt: skip
        )
    return found


def _attempts_of(job) -> tuple[list[Start], list[Attempt]]:
    """Return the start values of one effect class, and the attempts from them."""
    cls, screen, places, free = job
    proposed = proposals(cls, screen)
    found, starts = [], starts_for(cls, screen, proposed)
    for i, start in enumerate(starts):
        share, beyond = ANOTHER_START
        if i and not starts[0].values and start.left > share * starts[0].left + beyond:
            break
        found.append(_attempt_at(start, screen, places, free))
    if not (cls.multimodal or screen.block.core.bodies == 2):
        found.append(_attempt_at_user(cls, screen, places, free, starts))
    else:
        # What is missing may bias the baseline far from the truth: start from the user's values, too, once
        # for an effect that is proportional to its size.
        several = cls.multimodal or not cls.proportional
        spread = _spread(proposed, 1 + screen.block.core.bodies if several else 1)
        for effect in spread:
            attempt = _attempt_at(Start(effect, 0.0, places.values), screen, places, free)
            if attempt is None:
                continue
            attempt = replace(attempt, nominal=True)
            found.append(attempt)
            if effect is spread[-1] and effect.states and attempt.short:
                # the softest: its states, re-estimated in short segments, leave open what the parameters are
                found.append(replace(attempt, short=False))
    found.append(_attempt_as_read(cls, screen, places, free))
    return starts, [a for a in found if a is not None]


def _linear_attempts(job) -> tuple[list[Start], list[Attempt]]:
    """Return the same with the attempts that linear estimates put first."""
    cls, screen, places, free = job
    starts = starts_for(cls, screen, proposals(cls, screen))
    return starts, _attempts_at(starts[: 1 + cls.multimodal], screen, places, free)


def _attempts_beside(job) -> tuple[list[Start], list[Attempt]]:
    """Return the same with the other parameters as the model has them, or as they are without the effect."""
    cls, screen, places, free = job
    starts, best = _linear_attempts(job)
    there = starts_for(cls, places.user, proposals(cls, places.user), 1)[:1]
    own = [replace(s, values=places.values) for s in (*there, *starts[:1])]
    return starts, [*_attempts_at(own, screen, places, free), *best]


def _attempt_at_user(cls, screen: Screen, places: _Places, free, starts) -> Attempt | None:
    """Return the attempt from the user's values; None where `starts` promise no larger error.

    Without an effect as strong as all else, the refitted model is biased far from the truth, and there
    nothing that is small beside that effect explains much. Where that drove a parameter to its bound no start
    tells what the effect would explain.
    """
    about = places.user
    promised = [s.left * screen.power for s in starts if s.left > 0]
    own = [s for s in starts_for(cls, about, proposals(cls, about), 1) if s.left > 0]
    biased = bool(screen.base.names_at_bound)
    if not own or (own[0].left * about.power >= min(promised, default=math.inf) and not biased):
        return None
    attempt = _attempt_at(Start(own[0].effect, own[0].left, places.values), screen, places, free)
    return attempt and replace(attempt, nominal=True)


def _attempt_as_read(cls, screen: Screen, places: _Places, free) -> Attempt | None:
    """Return the attempt from what the motion tells of the model's own laws; None where it tells nothing.

    A law with many minima makes them for every effect beside it: it begins in short segments.
    """
    about = places.motion
    if about is None:
        return None
    linear = (s for s in starts_for(cls, about, proposals(cls, about), 1) if s.left > 0)
    start = next(itertools.chain(regressed(cls, about, math.inf), linear), None)
    if start is None:
        return None
    values = {**dict(places.read), **dict(start.values)}
    attempt = _attempt_at(replace(start, values=tuple(values.items())), screen, places, free)
    return attempt and replace(attempt, nominal=True, short=places.begins_short(True), starts=None)


def _attempts_at(starts, screen: Screen, places: _Places, free) -> list[Attempt]:
    found = (_attempt_at(s, screen, places, free) for s in starts)
    return [a for a in found if a is not None]


def _attempt_at(start: Start, screen: Screen, places: _Places, free) -> Attempt | None:
    """Return the attempt from a start; None where the effect contradicts the block."""
    values = {k: v for k, v in start.values if k in free}
    base = with_values(screen.block, values)
    block, key = extended(base, start.effect), start.effect.id
    if block is None:
        return None
    added, many = own_names(block), start.effect.multimodal
    names = (*free, *(n for n in added if not block.parameters[n].stepped))
    initial = places.starts(block, start.values, many)
    effort = EFFORT_ILL_CONDITIONED if start.effect.ill_conditioned else EFFORT_TRIED
    short = places.begins_short(many)
    return Attempt(key, block, names, short, *effort, screen.data.count(block, added), initial)


def _attempt_from_special(cls, special: CandidateFit, screen, places: _Places, free) -> Attempt | None:
    """Return the attempt at an effect from the fit of its special case; None where that says too little."""
    effect = cls.from_special(special.block.effects[-1])
    if effect is None:
        return None
    values = tuple((k, special.block.parameters[k].value) for k in free)
    attempt = _attempt_at(Start(effect, 0.0, values), screen, places, free)
    if attempt is None:
        return None
    # near a minimum long segments have no others, once its own hidden states are found
    return replace(attempt, short=False, starts=screen.data.states_of(attempt.block).starts)


def _first_steps(job) -> Attempt:
    """Take the first steps; fewer where the rate of descent excludes an error below `give_up`."""
    attempt, data, _, give_up = job
    block = attempt.block

    def fit(model, names, starts, iterations) -> FitResult:
        return data.fit(model, names, starts=starts, iterations=iterations)

    block, starts = start_with_angles(block, own_names(block), data.train.records, attempt.starts, fit)
    attempt = replace(attempt, block=block, starts=starts)
    return _continued(attempt, data, min(BEGUN, attempt.steps), give_up)


def _continued(attempt: Attempt, data: SegmentedData, steps, give_up) -> Attempt:
    fit = data.fit(
        attempt.block, attempt.names, starts=attempt.starts, iterations=steps, tolerance=attempt.tolerance,
        give_up=give_up, steps_left=attempt.steps if steps < attempt.steps else 0,
    )  # fmt: skip
    left = 0 if fit.converged else attempt.steps
    return replace(attempt, block=fit.model, fit=fit, starts=fit.starts, steps=left)


def _completed(job) -> CandidateFit:
    """Take the steps that are left, then those over the segments of the screen.

    They are left out where the rate of descent excludes an error below `give_up`.
    """
    attempt, begun, there, give_up = job
    if attempt.steps:
        attempt = _continued(attempt, begun, attempt.steps, give_up)
    trial = attempt.trial
    if not attempt.short:
        return trial
    return replace(trial, train=there.moved(trial.train, *EFFORT_MOVED, give_up))


def _spread(effects, count):
    """Return some of the effects, evenly from the first to the last."""
    return [effects[round((i + 0.5) * len(effects) / count - 0.5)] for i in range(min(count, len(effects)))]


def _as_divided(block, other):
    """Return a block with what acts on it on the sides that it has in another one."""
    moved = {e.id: e.side for e in other.effects if e.side != block.named_effects[e.id].side}
    return block.with_effects([e.replace(side=moved[e.id]) if e.id in moved else e for e in block.effects])


def own_names(block) -> tuple[str, ...]:
    """Return the parameters of a block's newest effect that a fit may move."""
    key = block.newest + "."
    return tuple(k for k, p in block.parameters.items() if k.startswith(key) and p.estimated)
