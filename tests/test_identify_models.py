"""What the measurement flow accepts: loops for blocks, executors, effects of the user's own."""

import runpy
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
import rigs

import ctrl_df as cdf
from ctrl_df.blocks import effect as registry
from ctrl_df.identify.compare import compare
from ctrl_df.identify.diagnose import diagnose
from ctrl_df.identify.improve import improve
from ctrl_df.identify.refit import refit

FEW = ("linear_spring", "quadratic_drag")


@pytest.fixture(scope="module")
def rig():
    return rigs.draw("linear_spring", 14, snr_db=60, n=4000)


@pytest.fixture(scope="module")
def records(rig):
    return tuple(record[0].measurement().slice(0, 2).decimate(2) for record in (rig.train, rig.holdout))


@pytest.fixture(scope="module")
def alone(rig, records):
    return diagnose(rig.baseline, records[0], holdout=records[1], candidates=FEW)


def test_an_executor_changes_nothing(rig, records, alone):
    train, held = records
    with ThreadPoolExecutor(2) as executor:
        study = improve(rig.baseline, train, held, candidates=FEW[:1], max_effects=1, executor=executor)
    with ProcessPoolExecutor(2) as executor:
        found = diagnose(rig.baseline, train, holdout=held, candidates=FEW, executor=executor)
    assert found.verdict == alone.verdict == "effect"
    assert [c.id for c in found.ranking] == [c.id for c in alone.ranking]
    assert found.best.parameters == alone.best.parameters  # to the last bit
    assert study.effects == ("linear_spring",)


@pytest.fixture
def eddy_brake(monkeypatch, tmp_path):
    """Register for one test the effect with which examples/own_effect.py begins."""
    monkeypatch.setattr(registry, "_LIBRARY", dict(registry._LIBRARY))
    example = Path(__file__).parents[1] / "examples" / "own_effect.py"
    alone = tmp_path / "brake.py"
    alone.write_text(example.read_text().partition("# %%")[0])
    return runpy.run_path(str(alone))["EddyBrake"]


def brake_record(seed, dt=4e-3, n=1250):
    """Return a run of mass, viscous drag and brake, integrated here, with white noise."""
    rng = np.random.default_rng(seed)
    t = dt * np.arange(n)
    phases = rng.uniform(0, 2 * np.pi, 6)
    u = 6.0 * sum(
        np.cos(2 * np.pi * f * t + p) for f, p in zip((0.3, 0.5, 0.8, 1.3, 2.1, 3.4), phases, strict=True)
    )

    def rate(v, force):
        ratio = v / 0.12
        return (force - 3.0 * v - 2 * 5.0 * ratio / (1 + ratio**2)) / 2.0

    x, place, v, h = np.zeros(n), 0.0, 0.0, dt
    for i, force in enumerate(u[:-1].tolist()):  # a step a sample of the Runge-Kutta method of order 4
        a = rate(v, force)
        b = rate(v + h / 2 * a, force)
        c = rate(v + h / 2 * b, force)
        d = rate(v + h * c, force)
        place += h * v + h**2 / 6 * (a + b + c)
        v += h / 6 * (a + 2 * b + 2 * c + d)
        x[i + 1] = place
    return cdf.Measurement(t, u, x + 1e-3 * np.std(x) * rng.standard_normal(n))


def test_an_effect_of_the_users_own_is_found(eddy_brake):
    start = cdf.Mass(2.4, [cdf.Viscous(2.5)])
    candidates = ("eddy_brake", "quadratic_drag")
    found = diagnose(start, brake_record(1), holdout=brake_record(2), candidates=candidates)
    assert found.verdict == "effect", found.explanation
    assert found.best.id == "eddy_brake"
    assert found.best.parameters["peak"] == pytest.approx(5.0, rel=0.05)
    assert found.best.parameters["velocity"] == pytest.approx(0.12, rel=0.05)
    assert isinstance(found.best.effect, eddy_brake)
    assert "eddy brake" in found.explanation and "falls again" in found.explanation


def test_a_loop_is_accepted_for_its_block():
    rig = rigs.draw("linear_spring", 3, snr_db=60, closed_loop=True, n=800)
    train, held = rig.train[0].measurement(), rig.holdout[0].measurement()
    loop = cdf.closed_loop(cdf.pid(*rig.controller[:4]), rig.baseline)
    channels = {"reference": rig.train[0].r}
    known = cdf.Measurement(train.t, train.u, train.y, channels=channels)
    assert compare(loop, known).nrmse > 0
    fitted = refit(loop, known)
    assert fitted.model.parts.controller is loop.parts.controller
    assert fitted.model.parts.block.parameters["mass"].value > 0
    block = diagnose(rig.baseline, train, holdout=held, candidates=FEW[:1])
    study = improve(loop, train, held, candidates=FEW[:1], max_effects=1)
    found = study.steps[0].diagnosis
    assert found.best.id == block.best.id == "linear_spring" == study.effects[0]
    # the step of a ladder is not refitted where it is clear
    assert found.best.evidence == pytest.approx(block.best.evidence, rel=1e-4)  # measured: 4e-6
    # and by itself
    assert diagnose(loop, train, candidates=FEW[:1], budget=1e-3).ranking[0].id == "linear_spring"
