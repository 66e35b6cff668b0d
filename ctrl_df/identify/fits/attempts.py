"""Attempts: fits of one effect that are yet to be made, and where they start."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..estimation.fit import FitResult
from ..estimation.segmented import CandidateFit, SegmentedData
from ..prediction.values import with_values
from ..starting.extend import extended
from ..starting.proposals import proposals
from ..starting.read_again import read_again
from ..starting.regression import Start, regressed
from ..starting.resonance_grid import resonating
from ..starting.screen import Screen, starts_for
from .compared import penalized
from .thresholds import ANOTHER_START, EFFORT_ILL_CONDITIONED, EFFORT_TRIED, JOINTS


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


@dataclass(frozen=True, eq=False)
class Places:
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

    def divided(self, block) -> Places:
        """Return the same places where what acts on the machine is divided as in `block`; it moves alike."""

        def moved(screen: Screen) -> Screen:
            return Screen(replace(screen.base, model=as_divided(screen.block, block)), screen.data)

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


def places_of(screen: Screen, short: SegmentedData | None, nominal, free, motion: bool) -> Places:
    """Return where fits start; `motion`: also from what the motion tells of the model's own laws.

    `short`: short segments, where fits of multimodal effects start; `nominal`: the user's values.
    """
    places = Places(screen, short, _screen_about(screen, nominal, free), tuple(nominal.items()))
    read = read_again(screen.block, screen.data) if motion else {}
    read = {k: v for k, v in read.items() if k in free}
    if not read:
        return places
    return replace(places, motion=_screen_about(screen, read, free), read=tuple(read.items()))


def _screen_about(screen: Screen, values: Mapping[str, float], free) -> Screen:
    """Return the screen about the model with other values."""
    model = with_values(screen.block, values)
    starts = screen.data.states_of(model).starts
    return Screen(screen.data.fit(model, tuple(free), starts=starts, iterations=0), screen.data)


def attempts_of(job) -> tuple[list[Start], list[Attempt]]:
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


def linear_attempts(job) -> tuple[list[Start], list[Attempt]]:
    """Return the same with the attempts that linear estimates put first."""
    cls, screen, places, free = job
    starts = starts_for(cls, screen, proposals(cls, screen))
    return starts, _attempts_at(starts[: 1 + cls.multimodal], screen, places, free)


def attempts_beside(job) -> tuple[list[Start], list[Attempt]]:
    """Return the same with the other parameters as the model has them, or as they are without the effect."""
    cls, screen, places, free = job
    starts, best = linear_attempts(job)
    there = starts_for(cls, places.user, proposals(cls, places.user), 1)[:1]
    own = [replace(s, values=places.values) for s in (*there, *starts[:1])]
    return starts, [*_attempts_at(own, screen, places, free), *best]


def joint_attempts(job) -> list[Attempt]:
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


def attempt_from_special(cls, special: CandidateFit, screen, places: Places, free) -> Attempt | None:
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


def _attempt_at_user(cls, screen: Screen, places: Places, free, starts) -> Attempt | None:
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


def _attempt_as_read(cls, screen: Screen, places: Places, free) -> Attempt | None:
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


def _attempts_at(starts, screen: Screen, places: Places, free) -> list[Attempt]:
    found = (_attempt_at(s, screen, places, free) for s in starts)
    return [a for a in found if a is not None]


def _attempt_at(start: Start, screen: Screen, places: Places, free) -> Attempt | None:
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


def _spread(effects, count):
    """Return some of the effects, evenly from the first to the last."""
    return [effects[round((i + 0.5) * len(effects) / count - 0.5)] for i in range(min(count, len(effects)))]


def as_divided(block, other):
    """Return a block with what acts on it on the sides that it has in another one."""
    moved = {e.id: e.side for e in other.effects if e.side != block.named_effects[e.id].side}
    return block.with_effects([e.replace(side=moved[e.id]) if e.id in moved else e for e in block.effects])


def own_names(block) -> tuple[str, ...]:
    """Return the parameters of a block's newest effect that a fit may move."""
    key = block.newest + "."
    return tuple(k for k, p in block.parameters.items() if k.startswith(key) and p.estimated)
