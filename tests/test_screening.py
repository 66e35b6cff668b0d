"""Effects that only long segments show, and fits that the segments fitted do not tell apart."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from ctrl_df.identify.estimation.segmented import CandidateFit
from ctrl_df.identify.fits.compared import nearest
from ctrl_df.identify.selection import screening
from ctrl_df.identify.selection.equivalence import told_by_held_out
from ctrl_df.identify.selection.screening import _over_long_segments


@dataclass(frozen=True)
class Tried:
    key: str
    train: SimpleNamespace
    beside: tuple = ()

    def with_fit(self, train):
        return replace(self, train=train, beside=())


def error(rmse):
    return SimpleNamespace(rmse=rmse)


@pytest.mark.parametrize(
    ("short", "long", "moved", "enough"),
    [
        # a ripple in a neighbouring minimum (nine tenths of the error), in the right one over long segments
        ({"ripple": 0.9, "spring": 0.98}, {"ripple": 0.05, "spring": 0.9}, ["ripple", "spring"], ["ripple"]),
        # nothing shows over short segments: what does over long ones is fitted there
        ({"ripple": 0.999, "spring": 1.0}, {"ripple": 0.05, "spring": 0.9}, ["ripple", "spring"], []),
        # long segments show no more
        ({"ripple": 0.9, "spring": 0.98}, {"ripple": 0.9, "spring": 1.0}, ["ripple", "spring"], []),
        # short ones are clear
        ({"ripple": 0.01, "spring": 0.98}, {"ripple": 0.01, "spring": 1.0}, [], []),
    ],
)
def test_what_explains_enough_over_long_segments_is_told(short, long, moved, enough):
    found = [Tried(k, SimpleNamespace(rmse=e, key=k)) for k, e in short.items()]
    longest = SimpleNamespace(moved=lambda train, *effort: error(long[train.key]))
    at = SimpleNamespace(segmentations=[longest], base=SimpleNamespace(train=error(1.0)))
    there, explains = _over_long_segments(at, 1.0, found)
    assert [t.key for t in there] == moved and [t.key for t in explains] == enough


def fit(rmse, output=0.0, key="ripple"):
    train = SimpleNamespace(rmse=rmse, count=1000, simulated_pieces=[np.full(1000, output)])
    return CandidateFit(key, train)


class HeldOut:
    """Data that err held out as told, by error of the fit."""

    def __init__(self, errors):
        self.errors, self.asked = errors, []

    def validate(self, tried, give_up=np.inf):
        self.asked.append(tried.train.rmse)
        return SimpleNamespace(validation_rmse=self.errors[tried.train.rmse])


def test_fits_that_err_alike_stand_beside_the_better_one():
    best = nearest(nearest(fit(1.004, 1.0), fit(1.0, 0.0)), fit(1.002, -1.0))
    assert best.train.rmse == 1.0 and [t.train.rmse for t in best.beside] == [1.002, 1.004]
    assert not any(t.beside for t in best.beside)


@pytest.mark.parametrize("other", [fit(1.01, 1.0), fit(1.001, 1e-3)], ids=["errs more", "same minimum"])
def test_a_fit_that_is_told_from_the_better_one_is_dropped(other):
    assert nearest(other, fit(1.0)).beside == ()


def test_held_out_data_choose_between_fits_that_err_alike():
    best = nearest(fit(1.004, 1.0), fit(1.0))
    chosen = told_by_held_out(best, HeldOut({1.0: 3.0, 1.004: 2.0}))
    assert chosen.train.rmse == 1.004 and chosen.beside == ()
    assert told_by_held_out(best, HeldOut({1.0: 2.0, 1.004: 3.0})).train.rmse == 1.0


def test_only_effects_to_be_confirmed_are_run_over_held_out_data(monkeypatch):
    found = [nearest(fit(e, 0.0, k), fit(1.001 * e, 1.0, k)) for k, e in (("a", 1.0), ("b", 2.0), ("c", 9.0))]
    monkeypatch.setattr(screening, "ranked", lambda base, fits: (list(fits), None))
    data = HeldOut({1.0: 3.0, 1.001: 2.0, 2.0: 2.0, 2.002: 3.0})
    first, second, last = screening._decided(fit(10.0), found, data)
    assert (first.train.rmse, second.train.rmse, last.train.rmse) == (1.001, 2.0, 9.0)
    assert len(last.beside) == 1 and len(data.asked) == 4
