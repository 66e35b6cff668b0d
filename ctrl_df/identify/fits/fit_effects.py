"""The fits of all effects that may be added to a model: started from many values, the best completed."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from ...simulate.parallel import side_by_side
from ..estimation.segmented import CandidateFit, SegmentedData
from ..starting.extend import applicable, divisions, extended
from ..starting.resonance_grid import is_joint
from ..starting.screen import Screen
from ..thresholds import GIVE_UP, GROWTH
from .attempts import (
    Attempt,
    Places,
    as_divided,
    attempt_from_special,
    attempts_beside,
    attempts_of,
    joint_attempts,
    linear_attempts,
    own_names,
    places_of,
)
from .rounds import Best, Rounds, best_of_each_effect
from .thresholds import JOINTS, KEPT, LOAD_SHARES


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

    def run(function: Callable, jobs: list) -> list:
        return side_by_side(function, jobs, executor)

    kinds = [c for c in classes if applicable(c, screen.block)]
    places = places_of(screen, short, nominal, free, motion=not (known or small))
    begun = attempts_beside if known else linear_attempts if small else attempts_of
    started = run(begun, [(c, screen, places, free) for c in kinds])
    if on_screened is not None:
        on_screened(_ranked_starts(started, screen))
    joints = [c for c in kinds if is_joint(c, screen)] if screen.block.core.bodies == 1 and not small else []
    resonating = run(joint_attempts, [(c, s, screen, free) for c in joints for s in LOAD_SHARES])
    resonating = best_of_each_effect([a for found in resonating for a in found], JOINTS)
    attempts = resonating + [a for _, found in started for a in found]
    kept, within = (1, 0.0) if known else (KEPT, GROWTH)
    rounds = Rounds(run, places, float(np.ptp(screen.motion.x)), kept, within, GIVE_UP * reached)
    general = [c for c in kinds if c.generalizes in kinds]
    later = {c.id for c in general}
    best = Best({}, min(screen.base.rmse, reached))
    best = rounds.fitted([a for a in attempts if a.key not in later], best)
    further = _generalizing(general, attempts, best, places, free)
    if not (small or screen.block.core.loose):  # beside noise a small error tells no side
        loose = {a.key for a in attempts if a.block.core.loose and best.near(a.key)}
        near = [c for c in kinds if c.id in loose]
        further += _divided(near, resonating, places, free, partial(run, begun))
    best = rounds.fitted(further, best)
    return [best.fits[c.id] for c in kinds if c.id in best.fits]


def _generalizing(general, attempts, best: Best, places: Places, free) -> list[Attempt]:
    """Return the attempts at effects whose special case promises them, one of them from its fit."""
    screen = places.screen
    promised = [c for c in general if best.promises(c.generalizes.id, screen.base.rmse)]
    begun = [attempt_from_special(c, best.fits[c.generalizes.id], screen, places, free) for c in promised]
    begun += [a for a in attempts if any(a.key == c.id for c in promised)]
    return [a for a in begun if a is not None]


def _divided(kinds, resonating, places: Places, free, begin: Callable) -> list[Attempt]:
    """Return attempts at joints with what acts on the machine divided otherwise between motor and load.

    Every division is begun anew, by `begin`, and where a resonance has `resonating` begin.
    """
    found, keys = [], {c.id for c in kinds}
    for block in divisions(places.screen.block) if kinds else ():
        there = places.divided(block)
        found += [a for _, begun in begin([(c, there.screen, there, free) for c in kinds]) for a in begun]
        found += [replace(a, block=as_divided(a.block, block)) for a in resonating if a.key in keys]
    return found


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
