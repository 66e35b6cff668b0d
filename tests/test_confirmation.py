"""Candidates over segments of every length: none falls behind for where it began, or for another one."""

from dataclasses import dataclass, field, replace
from types import SimpleNamespace

import numpy as np

from ctrl_df.identify.selection import confirmation, named


@dataclass
class Fit:
    rmse: float
    model: object = field(default_factory=lambda: SimpleNamespace(nonsmooth=False))


def test_a_fit_over_short_segments_errs_no_more_than_over_longer_ones():
    shorter = SimpleNamespace(moved=lambda f: Fit(0.9 * f.rmse))
    near, far = confirmation._reconciled(shorter, None, Fit(2.0), Fit(1.0), 5.0)
    assert (near.rmse, far.rmse) == (0.9, 1.0)
    near, _ = confirmation._reconciled(shorter, None, Fit(0.95), Fit(1.0), 5.0)
    assert near.rmse == 0.95


@dataclass
class Reference:
    stroke: float = 1.0
    base: object = None
    noise: object = None
    data: object = None


def test_what_is_not_what_its_name_says_takes_no_other_with_it(monkeypatch):
    at = Reference()
    real = {"spring": True, "joint": False, "gap": False}
    asked = []

    def confirmed(at, found, *_):
        asked.append([t.key for t in found])
        return replace(at, noise="theirs"), list(found[:2])  # beside the first two all others are give_up

    monkeypatch.setattr(confirmation, "_confirmed", confirmed)
    monkeypatch.setattr(confirmation, "distinct", lambda t, span: real[t.key])
    monkeypatch.setattr(confirmation, "ranked", lambda base, trials: (list(trials), "of those left"))
    found = [SimpleNamespace(key=k) for k in ("joint", "gap", "spring")]
    now, chosen = confirmation.confirmed(at, found, None, None, None)
    assert asked == [["joint", "gap", "spring"], ["spring"]]
    assert [t.key for t in chosen] == ["spring"] and now.noise == "theirs"
    _, chosen = confirmation.confirmed(at, found[::-1], None, None, None)
    assert [t.key for t in chosen] == ["spring"]
    now, chosen = confirmation.confirmed(at, found[:2], None, None, None)
    assert not chosen and np.all(asked[-1] == [])


def candidate(key, rmse, nonsmooth=True):
    return SimpleNamespace(key=key, size=rmse, train=Fit(rmse), block=SimpleNamespace(nonsmooth=nonsmooth))


def chosen_first(base, monkeypatch, noise=1.0):
    """Name and evidence of the first candidate, beside a model whose refit errs 1.0."""

    def ranked(base, trials):
        for t in trials:
            t.evidence = 100 * (base.size - t.size)
        return sorted(trials, key=lambda t: -t.evidence), noise

    def refit(at, tried):
        return candidate(tried.key, min(tried.size, 1.0), tried.block.nonsmooth)

    monkeypatch.setattr(named, "ranked", ranked)
    monkeypatch.setattr(named, "validated_from", lambda *_: [])
    data = SimpleNamespace(lacks_more=lambda error: error > 10 * noise, fine=None)
    at = Reference(base=base, noise=noise, data=data)
    (first, *_) = named.refitted(at, [candidate("dead zone", 1.0)], 3.0, refit)[1]
    return round(first.evidence)


def test_a_model_in_a_wrong_minimum_is_refitted_as_its_rivals_are(monkeypatch):
    """A gap under a PID: the dead zone that stands in for nothing let its own fit leave the minimum."""
    assert chosen_first(candidate("", 1.07), monkeypatch) == 0
    # one minimum, or an error that no minimum makes
    assert chosen_first(candidate("", 1.07, nonsmooth=False), monkeypatch) == 7
    assert chosen_first(candidate("", 1.07), monkeypatch, noise=0.1) == 7
