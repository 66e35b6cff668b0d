"""Every effect tried: fits from many starts begun, those with a chance brought to their end.

The fits of all effects run side by side in rounds: a few steps of every start, the two that are then ahead to
their end, and the rest against them. Which fits these are follows from the data alone, so that
results are the same however many run at once.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...simulate.parallel import side_by_side
from ..estimation.fit import FitResult
from ..estimation.per_record import begun_with_angles
from ..estimation.segmented import CandidateFit, SegmentedData
from ..prediction.values import feasible
from ..starting.extend import applicable, extended
from ..starting.proposals import proposals
from ..starting.regression import Start
from ..starting.resonance_grid import resonating
from ..starting.screen import Screen, starts_for
from ..thresholds import GIVE_UP
from .thresholds import (
    ANOTHER_START,
    BEGUN,
    EFFORT_BENT,
    EFFORT_MOVED,
    EFFORT_TRIED,
    JOINTS,
    KEPT,
    LOAD_SHARES,
    PROMISES,
)


@dataclass(frozen=True, eq=False)
class Attempt:
    """One fit of one effect, on its way.

    Attributes
    ----------
    key : str
        Id of the effect.
    block : Mechanism
        Where the fit begins, or has come to.
    names : tuple of str
        Parameters that it moves.
    data : SegmentedData
        The segments it is in.
    steps, tolerance : int, float
        Iterations left in these, and when to end them.
    extra : int
        Parameters beyond the baseline's.
    starts : list of arrays or None
        Initial states with which it begins.
    fit : FitResult or None
        What it has come to.
    nominal : bool
        Whether it begins at the user's values.
    """

    key: str
    block: Any
    names: tuple[str, ...]
    data: SegmentedData
    steps: int
    tolerance: float
    extra: int
    starts: list[np.ndarray] | None = None
    fit: FitResult | None = None
    nominal: bool = False

    @property
    def error(self) -> float:
        """Error it has come to."""
        assert self.fit is not None
        return self.fit.rmse

    @property
    def multimodal(self) -> bool:
        """Whether fits of its effect begin in short segments."""
        return self.block.effects[-1].multimodal

    @property
    def trial(self) -> CandidateFit:
        """What it has come to."""
        assert self.fit is not None
        return CandidateFit(self.key, self.fit, extra=self.extra)


def tried(
    classes,
    screen: Screen,
    short: SegmentedData | None,
    free,
    nominal,
    executor=None,
    screened=None,
    reached: float = math.inf,
) -> list[CandidateFit]:
    """Return every effect that can be added, fitted over the segments of the screen.

    Parameters
    ----------
    classes : sequence of effect classes
    screen : Screen
    short : SegmentedData or None
        In short segments, where fits of effects with many minima begin; None: in those of the screen, with
        the initial states of the model without them.
    free : tuple of str
        Parameters of the baseline that are refitted.
    nominal : mapping
        Their values as the user has them.
    executor : concurrent.futures.Executor or None
        Runs the fits side by side; None: threads do.
    screened : callable or None
        Takes every effect by what its best start explains, before any fit.
    reached : float
        Error of a model that is known: all begin at the nominal values, too, what cannot come near it is left
        where that shows, and joints are not sought over the plane.
    """
    known = math.isfinite(reached)
    span = float(np.ptp(screen.motion.x))

    def run(function: Callable, jobs: list) -> list:
        return side_by_side(function, jobs, executor)

    kinds = [c for c in classes if applicable(c, screen.block)]
    user = screen.block.with_parameters(feasible(screen.block, dict(nominal)))
    states = screen.data.states_of(user)
    about = screen.data.fit(user, tuple(free), starts=states.starts, iterations=0)
    places = _Places(screen, short, Screen(about, screen.data), tuple(nominal.items()))
    joints = [c for c in kinds if c.role == "coupling" and screen.block.core.bodies == 1 and not known]
    begun = run(_begin, [(c, screen, places, free, known) for c in kinds])
    if screened is not None:
        screened(_screened(begun, screen))
    resonating = run(_begin_joint, [(c, s, screen, free) for c in joints for s in LOAD_SHARES])
    attempts = _best([a for found in resonating for a in found], JOINTS)
    attempts += [a for _, found in begun for a in found]
    rounds = _Rounds(run, screen, span, 1 if known else KEPT, GIVE_UP * reached)
    later = {c.id: c.generalizes for c in kinds if c.generalizes in kinds}
    best = rounds.fitted(
        [a for a in attempts if a.key not in later], _Best({}, min(screen.base.rmse, reached))
    )
    again = [a for a in attempts if a.key in later and best.promises(later[a.key].id, screen.base.rmse)]
    best = rounds.fitted(again, best)
    return [best.fits[c.id] for c in kinds if c.id in best.fits]


@dataclass(frozen=True, eq=False)
class _Places:
    """Where fits begin.

    Attributes
    ----------
    screen : Screen
    short : SegmentedData or None
        Where those of effects with many minima do; None: where all others do.
    user : Screen
        About the model as the user has it.
    values : tuple of (str, float)
        What the user has.
    """

    screen: Screen
    short: SegmentedData | None
    user: Screen
    values: tuple[tuple[str, float], ...]

    def data(self, multimodal: bool) -> SegmentedData:
        """Return the segments in which a fit begins."""
        return self.screen.data if self.short is None or not multimodal else self.short

    def starts(self, block, values, multimodal: bool) -> list[np.ndarray] | None:
        """Return the initial states of the model without an effect as those of a block with one.

        None where fits begin with what is measured. `values`: of the model, where the block has not those of
        the screen.
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

    def promises(self, key: str, base: float) -> bool:
        """Whether an effect has come so near that one which contains it may be the right one.

        `base`: error of the model without it.
        """
        if key not in self.fits:
            return False
        error = self.fits[key].train.rmse
        explained, most = base**2 - error**2, base**2 - self.least**2
        return error < GIVE_UP * self.least and explained > PROMISES * most


@dataclass(frozen=True, eq=False)
class _Rounds:
    """How fits of many effects go against each other.

    Attributes
    ----------
    run : callable
        Runs jobs side by side.
    screen : Screen
    span : float
        Stroke of the records [m].
    kept : int
        Fits of an effect that go on after the first steps.
    near : float
        Error that a fit must be able to come below.
    """

    run: Callable
    screen: Screen
    span: float
    kept: int
    near: float

    def fitted(self, attempts: list[Attempt], best: _Best) -> _Best:
        """Bring the attempts that have a chance against the best to their end; return the best then."""
        # those of few steps first: what they come to tells of the others which need no long look
        begun = self.run(_first, [(a, self.near) for a in attempts if not a.multimodal])
        least = min([best.least, *(a.error for a in begun)])
        begun += self.run(_first, [(a, GIVE_UP * least) for a in attempts if a.multimodal])
        begun = [a for a in begun if distinct(a.trial, self.span)]
        kept = _best(begun, self.kept)
        # few steps from where the user begins tell little: the baseline may have ended in another minimum
        own = _best([a for a in begun if a.nominal], 1)
        begun = [*kept, *(a for a in own if not any(a is o for o in kept))]
        ahead = _best(begun, 1)[:2]
        found = self.run(_finish, [(a, self.screen.data, self.near) for a in ahead])
        least = min([least, *(t.train.rmse for t in found)])
        rest = [a for a in begun if not any(a is o for o in ahead)]
        found += self.run(_finish, [(a, self.screen.data, GIVE_UP * least) for a in rest])
        fits = dict(best.fits)
        for t in found:
            known = fits.get(t.key)
            if distinct(t, self.span) and (known is None or t.train.rmse < known.train.rmse):
                fits[t.key] = t
        return _Best(fits, min([least, *(t.train.rmse for t in found)]))


def _screened(begun, screen: Screen) -> list[CandidateFit]:
    """Return every effect by what its best start explains, before any fit, that of most evidence first.

    The share of the residual that a start leaves is of a linear estimate: it ranks, and promises no more.
    """
    base, found = screen.base, []
    samples = len(screen.residual)
    for starts, attempts in begun:
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


def distinct(tried: CandidateFit, span) -> bool:
    """Whether the newest effect is what its name says over the stroke `span` [m]."""
    own = tried.block.newest + "."
    at_bound = {name.removeprefix(own) for name in tried.train.names_at_bound if name.startswith(own)}
    return tried.block.effects[-1].distinct(span, at_bound)


def _best(attempts, count) -> list[Attempt]:
    """Return the best of each effect, so many, the best first."""
    ordered, kept = sorted(attempts, key=lambda a: a.error), []
    for a in ordered:
        if sum(a.key == o.key for o in kept) < count:
            kept.append(a)
    return kept


# --- jobs -----------------------------------------------------------------------------------------


def _begin_joint(job) -> list[Attempt]:
    """Return where fits of a joint begin that has a share of the load behind it."""
    cls, share, screen, free = job
    found = []
    for near in resonating(cls, screen, share, JOINTS):
        names = own_names(near.model)
        found.append(
            Attempt(
                cls.id,
                near.model,
                (*free, *names),
                screen.data,
                *EFFORT_BENT,
                screen.data.count(near.model, names),
                near.starts,
                near,
            )  # fmt: skip
        )
    return found


def _begin(job) -> tuple[list[Start], list[Attempt]]:
    """Return the starts of one effect class, and where fits begin there."""
    cls, screen, places, free, known = job
    proposed = proposals(cls, screen)
    found, starts = [], starts_for(cls, screen, proposed)
    if known:
        # with the other parameters as the model has them, or as they are without the effect
        best = starts[: 1 + cls.multimodal]
        own = [replace(s, values=places.values) for s in best[:1]]
        begun = [_from(s, screen, places, free) for s in (*own, *best)]
        return starts, [a for a in begun if a is not None]
    for i, start in enumerate(starts):
        share, beyond = ANOTHER_START
        if i and not starts[0].values and start.left > share * starts[0].left + beyond:
            break
        found.append(_from(start, screen, places, free))
    if not (cls.multimodal or screen.block.core.bodies == 2):
        found.append(_from_user(cls, screen, places, free, starts))
    else:
        # The baseline may have bent far from the truth to make up for what is missing: begin where the user
        # does. What changes in proportion to its size finds that within a step.
        several = cls.multimodal or not cls.proportional
        for effect in _spread(proposed, 1 + screen.block.core.bodies if several else 1):
            attempt = _from(Start(effect, 0.0, places.values), screen, places, free)
            found.append(attempt and replace(attempt, nominal=True))
    return starts, [a for a in found if a is not None]


def _from_user(cls, screen: Screen, places: _Places, free, starts) -> Attempt | None:
    """Return the attempt that begins at the user's values; None where `starts` promise no larger error.

    A model without an effect as strong as all else is bent by the refit far from the truth, where nothing
    that is small beside it explains much.
    """
    about = places.user
    promised = [s.left * screen.power for s in starts if s.left > 0]
    own = [s for s in starts_for(cls, about, proposals(cls, about), 1) if s.left > 0]
    if not own or own[0].left * about.power >= min(promised, default=math.inf):
        return None
    attempt = _from(Start(own[0].effect, own[0].left, places.values), screen, places, free)
    return attempt and replace(attempt, nominal=True)


def _from(start: Start, screen: Screen, places: _Places, free) -> Attempt | None:
    """Return the attempt that begins at a start; None where the effect contradicts the block."""
    values = {k: v for k, v in start.values if k in free}
    base = screen.block.with_parameters(feasible(screen.block, values))
    block, key = extended(base, start.effect), start.effect.id
    if block is None:
        return None
    added, many = own_names(block), start.effect.multimodal
    names = (*free, *(n for n in added if not block.parameters[n].stepped))
    # a joint changes everything at once, and so does what rubs behind it: their minima are long and bent
    bent = many and (start.effect.role in ("contact", "coupling") or start.effect.side == "load")
    begin = places.starts(block, start.values, many)
    effort = EFFORT_BENT if bent else EFFORT_TRIED
    return Attempt(key, block, names, places.data(many), *effort, screen.data.count(block, added), begin)


def _first(job) -> Attempt:
    """Take the first steps, fewer where all would not lead to an error below `give_up` at their pace."""
    attempt, give_up = job
    data, block = attempt.data, attempt.block

    def fit(model, names, starts, iterations) -> FitResult:
        return data.fit(model, names, starts=starts, iterations=iterations)

    block, starts = begun_with_angles(block, own_names(block), data.train.records, attempt.starts, fit)
    attempt = replace(attempt, block=block, starts=starts)
    return _on(attempt, min(BEGUN, attempt.steps), give_up)


def _on(attempt: Attempt, steps, give_up) -> Attempt:
    fit = attempt.data.fit(
        attempt.block, attempt.names, starts=attempt.starts, iterations=steps, tolerance=attempt.tolerance,
        give_up=give_up, steps_left=attempt.steps if steps < attempt.steps else 0,
    )  # fmt: skip
    left = 0 if fit.converged else attempt.steps
    return replace(attempt, block=fit.model, fit=fit, starts=fit.starts, steps=left)


def _finish(job) -> CandidateFit:
    """Take the steps that are left, then those over the segments of the screen.

    Where they would not lead to an error below `give_up` at the pace of the last ones they are left out.
    """
    attempt, data, give_up = job
    if attempt.steps:
        attempt = _on(attempt, attempt.steps, give_up)
    trial = attempt.trial
    if attempt.data is data:
        return trial
    return replace(trial, train=data.moved(trial.train, *EFFORT_MOVED, give_up))


def _spread(effects, count):
    """Return some of the effects, evenly from the first to the last."""
    return [effects[round((i + 0.5) * len(effects) / count - 0.5)] for i in range(min(count, len(effects)))]


def own_names(block) -> tuple[str, ...]:
    """Return the parameters of a block's newest effect that a fit may move."""
    key = block.newest + "."
    return tuple(k for k, p in block.parameters.items() if k.startswith(key) and p.free)
