"""Diagnosis and ladder tell what they know while they work, and stop when they are asked to."""

import functools
import logging
import math
import signal
import threading
import time
import weakref

import matplotlib as mpl
import numpy as np
import pytest
import rigs

mpl.use("Agg")

import matplotlib.pyplot as plt

import ctrl_df as cdf
from ctrl_df.identify.datasets.over_time import TimeDataset
from ctrl_df.identify.monitor import Monitor
from ctrl_df.simulate import parallel

FEW = ("constant_force", "linear_spring")


@functools.cache
def rig():
    """Return the model, the record to fit and the one held out."""
    drawn = rigs.draw("linear_spring", 11, snr_db=60, n=4000)
    train, held = (record[0].measurement().decimate(4) for record in (drawn.train, drawn.holdout))
    return drawn.baseline, train, held


def ask(**keywords):
    model, train, held = rig()
    return cdf.diagnose(model, train, holdout=held, candidates=FEW, **keywords)


def interrupted_ladder(**keywords):
    return cdf.improve(*rig(), candidates=FEW, max_effects=1, **keywords)


@pytest.fixture(scope="module")
def told():
    known, lines = [], []
    return ask(callback=lambda d: known.append(d) or "ignored", progress=lines.append), known, lines


def test_what_is_known_so_far_is_told_on_the_way(told):
    found, known, _ = told
    assert found.status == "complete" and found.verdict == "effect"
    assert len(known) >= 3 and all(d.status == "under way" for d in known)
    first, last = known[0], known[-1]
    assert [c.id for c in first.ranking] == ["linear_spring", "constant_force"]
    assert not any(c.confirmed or c.determined for c in first.ranking)
    assert first.verdict == "ambiguous" and "not complete" in first.explanation
    assert last.ranking[0].confirmed and math.isfinite(last.nrmse_holdout)
    assert first.seconds < last.seconds <= found.seconds
    for d in known:
        assert str(d) and d.where is not None
        assert len(d.plot().lines[0]) == 1 + len(d.ranking)
        plt.close("all")


def test_what_a_callback_raises_ends_the_diagnosis():
    class Enough(Exception):
        pass

    def stop(_):
        raise Enough

    with pytest.raises(Enough):
        ask(callback=stop)
    with pytest.raises(Enough):
        interrupted_ladder(callback=stop)


@pytest.mark.parametrize("budget", [1e-3, 0.4])
def test_a_budget_returns_what_is_known(budget):
    began = time.perf_counter()
    found = ask(budget=budget)
    assert time.perf_counter() - began < 20
    assert found.status == "budget spent" and found.ranking
    assert found.verdict in ("ambiguous", "unknown")
    study = interrupted_ladder(budget=budget)
    text = study.summary()
    assert study.status == "budget spent" and study.steps and "budget spent" in text
    # no fall of an error that did not fall, nothing outside the library that was not tried
    assert "so far" in text and "Added: nothing" not in text and "outside the library" not in text
    assert "nan" not in study.summary().split("\n")[0]
    study.plot()
    plt.close("all")


def test_a_long_budget_changes_nothing(told):
    assert str(ask(budget=1e4)) == str(told[0])


def test_ctrl_c_returns_what_is_known_and_leaves_nothing_running():
    heard = threading.Event()

    def interrupt():
        heard.wait(60)
        time.sleep(0.1)
        signal.pthread_kill(threading.main_thread().ident, signal.SIGINT)

    sender = threading.Thread(target=interrupt)
    sender.start()
    found = ask(callback=lambda d: heard.set())
    sender.join()
    assert found.status == "interrupted" and found.ranking
    assert found.verdict in ("ambiguous", "unknown") and "(interrupted)" in str(found)
    assert ask(budget=1e-3).ranking  # the next one is not stopped


def test_ctrl_c_in_a_ladder_keeps_the_steps_made():
    def stop(study):
        if len(study.steps) == 2:
            raise KeyboardInterrupt

    study = interrupted_ladder(callback=stop)
    assert study.status == "interrupted" and study.effects == ("linear_spring",)
    assert study.verdict == "effect" and study.model is study.steps[-1].model
    assert "Added so far: linear spring" in str(study) and "Missing" not in str(study)


def test_ctrl_c_while_the_last_result_is_made_takes_what_is_there():
    """The parameters of a step under way take a second or two, and are made where somebody receives them."""

    def interrupted(*_):
        raise KeyboardInterrupt

    def work():
        monitor.within(interrupted, lambda found: found).known(interrupted_ladder(budget=1e-3))
        raise KeyboardInterrupt

    monitor = Monitor("improve", progress=False)
    study = monitor.run(work, lambda: None)
    assert study.status == "interrupted" and study.steps

    monitor = Monitor("improve", progress=False, callback=lambda _: None)
    assert monitor.run(work, lambda: None).status == "interrupted"  # not lost where a callback asks for it


def test_ctrl_c_before_anything_is_known_returns_the_model_as_given(monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(TimeDataset, "search", interrupted)
    found, study = ask(), interrupted_ladder()
    for result in (found, study):
        assert (result.status, result.verdict, result.model) == ("interrupted", "unknown", rig()[0])
        assert "Nothing is known yet" in str(result).split("\n")[0]
        with pytest.raises(ValueError, match="ended before the first was known"):
            result.plot()
    assert found.best is None and found.remaining == () and found.next_experiment is None
    assert found.train == (rig()[1],) and study.effects == () and len(study.steps) == 1
    with pytest.raises(ValueError, match="ended before the first was known"):
        study.report("none.html")


def test_ctrl_c_where_python_would_drop_it_ends_the_work_all_the_same(monkeypatch, capsys):
    """The callback of a weak reference: what is raised there is printed and forgotten."""

    heard = {"__name__": "weakref", "signal": signal}
    exec("def gone(_):\n    signal.raise_signal(signal.SIGINT)\n    return None", heard)

    def interrupted(*_):
        thing = threading.Event()
        name = weakref.ref(thing, heard["gone"])
        del thing
        assert name() is None
        parallel.check()
        raise AssertionError("it was lost")

    monkeypatch.setattr(TimeDataset, "search", interrupted)
    assert ask().status == "interrupted"
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    assert "ignored" not in capsys.readouterr().err


def test_progress_and_log(told, caplog, capsys):
    assert len(told[2]) >= 4 and all(line.startswith("diagnose: ") for line in told[2])
    lines = []
    with caplog.at_level(logging.INFO, logger="ctrl_df"):
        ask(progress=lines.append, budget=1e-3)
    *stages, end = [r.message for r in caplog.records if r.levelno == logging.INFO]
    assert stages == lines and "budget spent" in end
    assert capsys.readouterr().err == ""
    ask(progress=True, budget=1e-3)
    assert "diagnose" in capsys.readouterr().err


def test_a_stage_that_lasts_tells_that_it_goes_on(monkeypatch):
    monkeypatch.setattr("ctrl_df.identify.monitor.PROGRESS_EVERY", 0.05)
    monkeypatch.setattr(Monitor, "beat", 0.02)
    lines = []
    monitor = Monitor("improve", lines.append)
    monitor.stage("four rests")
    with parallel.watched(monitor):
        parallel.side_by_side(time.sleep, [0.3, 0.1, 0.1, 0.1])
    assert len(lines) > 3 and all("s, four rests" in line for line in lines)
    assert "jobs done" in lines[1]


def test_errors_are_clear():
    with pytest.raises(ValueError, match="budget > 0"):
        ask(budget=0)
    with pytest.raises(TypeError, match="budget"):
        interrupted_ladder(budget="a minute")
    with pytest.raises(TypeError, match="callback"):
        ask(callback=3)
    with pytest.raises(TypeError, match="progress"):
        interrupted_ladder(progress="yes")


def test_error_of_free_prediction_against_its_length(told):
    found = told[0]
    best, before = found.best.error_by_horizon, found.baseline.error_by_horizon
    assert found.best.determined
    assert np.all(np.diff(best.horizon) > 0) and best.horizon[-1] == pytest.approx(rig()[2].duration)
    assert best.horizon.shape == best.nrmse.shape == best.rmse.shape
    assert np.all(best.nrmse < 0.3 * before.nrmse)
    compared = cdf.compare(found.best.model, rig()[2], mode="free")
    assert best.whole == pytest.approx(compared.nrmse, rel=1e-2)
    assert compared.error_by_horizon.whole == best.whole
    drawn = best.plot(before, labels=("with the spring", "without"))
    assert len(drawn.lines) == 2
    plt.close("all")
    assert "docs/calibration.md" in found.calibrated


def joint(seed):
    """Return a record of a robot joint in presliding: 6 N m against a breakaway level of 10.75 N m."""
    t = np.arange(0, 6, 4e-3)
    u = 6 * np.sin(2 * np.pi * 0.5 * t)
    true = cdf.Inertia(2.5).with_effect(cdf.Coulomb(10.75)).with_effect(cdf.Viscous(40.0))
    y = cdf.event_response(true.with_effect(cdf.Bristle(30156.0, 100.0)), t, u, input_hold="zoh").outputs[0]
    noise = 1e-6 * np.random.default_rng(seed).standard_normal(t.size)
    return cdf.Measurement(t, u, y + noise, name=f"joint {seed}", input_unit="N m", output_unit="rad")


def test_a_joint_in_presliding_is_not_elastic():
    """Where bristles are no candidate; where they are: `test_starts`."""
    model = cdf.Inertia(3.0).with_effect(cdf.Coulomb(8.0)).with_effect(cdf.Viscous(30.0))
    train, held = (joint(seed).decimate(8) for seed in (1, 2))
    found = cdf.diagnose(model, train, holdout=held, candidates=("compliance",))
    # short segments, whose hidden states are fitted again, speak for a joint by thousands of nats
    assert found.verdict in ("unknown", "ambiguous") and found.doubts
    assert not found.best.determined
    assert "evenly" not in cdf.compare(found.model, held).report()
