"""Fits started from those of other models: minima are many where events make the error jump."""

from dataclasses import replace

import numpy as np
import pytest

import ctrl_df as cdf
from ctrl_df.identify.estimation.from_others import started_from, with_starts_exchanged
from ctrl_df.identify.estimation.segmented import CandidateFit, prepare
from ctrl_df.identify.prediction.simulator import free_run

GAP = cdf.Mass(2.0).with_effect(cdf.Viscous(3.0)).with_effect(cdf.Backlash(0.01, 0.3, 0.4))
NAMES = ("mass", "viscous.coefficient")


@pytest.fixture(scope="module")
def lengths():
    """The data in segments of three lengths; noise of 1e-6 m."""
    rng, t = np.random.default_rng(5), 1e-3 * np.arange(3000)

    def made(seed):
        u = np.repeat(np.random.default_rng(seed).uniform(-6, 6, len(t) // 100), 100)
        blank = cdf.Measurement(t, u, np.sin(t))
        return cdf.Measurement(t, u, free_run(GAP, blank, slack=0.5) + 1e-6 * rng.normal(size=len(t)))

    return [data.fine for data in prepare(GAP, [made(1)], [made(2)]).segmentations]


@pytest.fixture(scope="module")
def data(lengths):
    return lengths[1]


def test_segments_of_a_gap_begin_where_they_did(lengths):
    """By derivatives over a tenth of the gap 19 of 60 short ones ended beside their minimum."""
    for data, least in zip(lengths, (50, 16, 4), strict=True):
        found = data.states_of(GAP)
        (segments,), (residual,) = found.segments, found.residual
        assert len(segments) >= least
        far = np.sqrt(segments.means(residual**2)) > 2e-6
        assert np.sum(far) < 5  # measured: 2, 0, 0
        tried = data.validate(CandidateFit("", found))
        assert tried.validation_rmse < 1.5e-6  # measured: 1.0e-6


def elsewhere(fit, segment, data, view):
    """Return a fit of which one segment begins at the other face of the gap, and goes away from it."""
    starts = [rows.copy() for rows in fit.starts]
    starts[0][segment, 2:] = 1.0 - starts[0][segment, 2], 0.2
    return data.fit(fit.model, fit.names, view=view, starts=starts, iterations=0)


@pytest.mark.parametrize("held_out", [False, True])
def test_a_segment_begins_as_that_of_a_model_that_errs_less_in_it(data, held_out):
    view = data.validation if held_out else data.train
    right = data.fit(GAP, NAMES, view=view)
    sprung = GAP.with_effect(cdf.LinearSpring(1e-3))
    beside = data.fit(sprung, NAMES, view=view, starts=right.starts, iterations=0)
    lost = [elsewhere(f, k, data, view) for f, k in ((right, 1), (beside, 2))]
    assert all(f.rmse > 5 * right.rmse for f in lost)
    one, none, other = with_starts_exchanged([lost[0], None, lost[1]], data, held_out)
    assert none is None
    assert [f.rmse for f in (one, other)] == pytest.approx([right.rmse] * 2, rel=0.01)
    # nothing to gain: as they are
    assert all(
        a is b for a, b in zip(with_starts_exchanged([one, other], data, held_out), (one, other), strict=True)
    )


def test_models_without_events_are_left_as_they_are(data):
    plain = cdf.Mass(2.0).with_effect(cdf.Viscous(3.0))
    sprung = plain.with_effect(cdf.LinearSpring(5.0))
    fits = [data.fit(m, NAMES) for m in (plain, sprung)]
    moved = replace(fits[0], residual=[3 * e for e in fits[0].residual])
    assert with_starts_exchanged([moved, fits[1]], data) == [moved, fits[1]]


def test_the_model_without_an_effect_is_started_from_all_that_come_nearer(data):
    """What each of several candidates gains by a better minimum alone is no evidence for its effect."""
    off = GAP.with_parameters({"mass": 1.9})
    base = data.validate(CandidateFit("", data.fit(off, NAMES, iterations=0)))
    near = {
        key: CandidateFit(
            key, data.fit(GAP.with_effect(effect).with_parameters({"mass": m}), NAMES, iterations=0)
        )
        for key, effect, m in (
            ("spring", cdf.LinearSpring(1e-3), 1.99),
            ("drag", cdf.QuadraticDrag(1e-3), 1.95),
        )
    }
    assert all(t.train.rmse < base.train.rmse for t in near.values())
    found = started_from(base, list(near.values()), data)
    least = data.fit(GAP, NAMES).rmse
    assert found.train.rmse < 1.1 * least and found.validation_rmse < base.validation_rmse
    # one that errs more leaves it as it is
    assert started_from(found, list(near.values()), data) is found
