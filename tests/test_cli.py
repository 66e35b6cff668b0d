"""The command line: answers, JSON, errors of one line with exit code 2, the demo's pictures."""

import dataclasses
import functools
import importlib
import json
import queue
import re
import struct
import sys

import numpy as np
import pytest

import ctrl_df as cdf
from ctrl_df import warm
from ctrl_df.cli import main
from ctrl_df.demo import hidden
from ctrl_df.demo.run import _study
from ctrl_df.df.forced_orbit.kernel import newton
from ctrl_df.df.forced_orbit.kernel.period_map import apply
from ctrl_df.identify import improve
from ctrl_df.model_file import EXAMPLE, read_model
from ctrl_df.simulate.imposed import imposed_forces, path_of
from ctrl_df.simulate.kernel.imposed import force_along
from ctrl_df.simulate.program.imposed import laws_of

FIGURES = ("fig3", "fig4", "fig5", "fig7", "fig8", "fig9", "fig10")


@pytest.fixture
def model(tmp_path):
    path = tmp_path / "model.toml"
    path.write_text(EXAMPLE)
    return path


def test_example_of_the_help_is_the_papers_friction_loop(model):
    read = read_model(model)
    assert read.plant.parameters["coulomb.level"].value == 5.0
    assert read.plant.mass == 9.0
    assert read.omega[[0, -1]] == pytest.approx([4, 40])
    assert read.columns["output_unit"] == "mm"


def test_list_of_effects_is_the_same_model(tmp_path, model):
    other = tmp_path / "list.toml"
    listed = EXAMPLE.replace("[effects.coulomb] ", '[[effects]]\nid = "coulomb"\n')
    other.write_text(listed.replace("[effects.viscous]", '[[effects]]\nid = "viscous"'))
    assert read_model(other).plant == read_model(model).plant


def test_a_block_without_mass(tmp_path):
    path = tmp_path / "damper.toml"
    path.write_text('[plant]\nkind = "massless"\n[effects.coulomb]\nlevel = 3.0\n')
    assert read_model(path).plant == cdf.Massless([cdf.Coulomb(3.0)])


def test_limit_cycles_as_text_and_json(model, capsys):
    assert main(["limit-cycles", str(model)]) == 0
    text = capsys.readouterr().out
    assert "13.79212" in text and "unstable" in text and "verdict" in text
    model.write_text(EXAMPLE + "[effects.stiction]\nlevel = 5.5\n")
    assert main(["limit-cycles", str(model), "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    exact = [c["exact"] for c in answer["cycles"] if c["exact"]]
    stable = {c["stable"]: c["omega"] for c in exact}
    assert stable == {True: pytest.approx(11.628680, abs=1e-5), False: pytest.approx(13.792124, abs=1e-5)}


@pytest.mark.quick
def test_limit_cycles_of_a_loop_with_a_delay(tmp_path, capsys):
    path = tmp_path / "late.toml"
    path.write_text(
        '[plant]\nkind = "mass"\nmass = 1.5\n[effects.viscous]\ncoefficient = 0.8\n'
        "[effects.input_saturation]\nlevel = 4.0\n[effects.input_delay]\ndelay = 0.06\n"
        "[controller]\nkp = 60.0\nkd = 3.0\ntf = 0.02\n[box]\namplitude = [4.1, 100.0]\nomega = [1.0, 30.0]\n"
    )
    assert main(["limit-cycles", str(path), "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    (cycle,) = answer["cycles"]
    assert cycle["exact"] is None and cycle["verdict"] == "confirmed"
    assert cycle["simulated"]["omega"] == pytest.approx(6.09831, rel=1e-6)  # tests/test_special_loops.py
    assert "simulation" in cycle["why"] and "delay" in answer["note"]


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("mass = 9.0 ", "mass = -9.0 ", ["mass > 0", "-9.0"]),
        ("mass = 9.0 ", "", ["needs mass"]),
        ("effects.coulomb", "effects.coulom", ["effect id", "coulom"]),
        ("level = 5.0", "levl = 5.0", ["levl", "level"]),
        ("level = 5.0", 'level = "five"', ["level", "five"]),
        ('kind = "mass"', 'kind = "wheel"', ["two_mass", "wheel"]),
        ("kp = 2000.0", "kq = 2000.0", ["kq", "kp"]),
        ("omega = [4.0, 40.0]", "omega = [40.0, 4.0]", ["low < high"]),
        ("omega = [4.0, 40.0]", "omega = [nan, 4.0]", ["low < high"]),
        ("[plant]", "[plant", ["TOML"]),
        ("[box]", "[bocks]", ["bocks", "box"]),
    ],
)
def test_bad_model_is_one_line_and_exit_code_2(model, capsys, old, new, words):
    assert old in EXAMPLE
    model.write_text(EXAMPLE.replace(old, new))
    assert main(["limit-cycles", str(model)]) == 2
    captured = capsys.readouterr()
    assert captured.err.startswith("ctrl-df: error:") and captured.err.count("\n") == 1
    assert captured.out == ""
    for word in words:
        assert word in captured.err


def test_missing_files_are_one_line(tmp_path, model, capsys):
    assert main(["limit-cycles", str(tmp_path / "none.toml")]) == 2
    assert main(["improve", str(tmp_path / "none.csv"), "--model", str(model)]) == 2
    assert main(["improve", "x.csv", "--model", str(model), "--report", str(tmp_path / "no" / "x.html")]) == 2
    assert capsys.readouterr().err.count("\n") == 3


def test_no_command_shows_usage(capsys):
    with pytest.raises(SystemExit) as stop:
        main([])
    assert stop.value.code == 2
    with pytest.raises(SystemExit) as stop:
        main(["limit-cycles", "--help"])
    assert stop.value.code == 0
    assert "[effects.coulomb]" in capsys.readouterr().out


def study_of_few(folder):
    """Make the demo's study of half the record with one candidate; the tutorial tries all on this drive."""
    record = hidden.embedded_data().slice(0, 2.5)
    hidden.embedded_data = lambda: record
    improve.improve = functools.partial(improve.improve, candidates=("position_ripple",), max_effects=1)
    return _study(folder)


def coarse(loops):
    """Return loops of the demo, predicted on every fifth amplitude and frequency of their boxes.

    Of those that hunt one: what is exact of the others is held by `test_exact_orbits`.
    """
    boxes = {}  # loops of one box are to share it
    for loop in loops:
        if loop.key in ("static 5.25", "static 5.75"):
            continue
        thin = boxes.setdefault(id(loop.box), tuple(side[::5] for side in loop.box))
        yield dataclasses.replace(loop, box=thin)


def test_demo_prints_the_exact_answers_and_draws_the_figures(tmp_path, capsys, monkeypatch):
    """On coarse grids: neither the exact answers nor that pictures can be read depend on them."""
    demo, pictures = sys.modules["ctrl_df.demo.run"], importlib.import_module("ctrl_df.demo.pictures")
    loops, family = list(coarse(demo.paper_loops())), pictures.quiet_family
    monkeypatch.setattr(demo, "_study", study_of_few)
    monkeypatch.setattr(demo, "paper_loops", lambda: loops)
    monkeypatch.setattr(pictures, "quiet_family", lambda block, A, omega: family(block, A[::5], omega[::5]))
    out = tmp_path / "pictures"
    assert main(["demo", "--out", str(out)]) == 0
    text = capsys.readouterr().out
    # figures of the table of exact answers, digits as printed (cells are wrapped, numbers are not)
    for number in ("13.792124", "11.628680", "14.733968", "156.045031"):
        assert number in text, number
    assert "Added: position ripple" in text and (out / "hidden-effect.html").exists()
    assert "paper's claim" in text and "grows without bound" in text
    names = [p.name for p in out.glob("*.png")]
    for figure in FIGURES:
        assert any(n.startswith(figure) for n in names), figure
    for path in out.glob("*.png"):
        data = path.read_bytes()
        width, height = struct.unpack(">II", data[16:24])
        assert data[:8] == b"\x89PNG\r\n\x1a\n" and width > 600 and height > 400
        import matplotlib.image as image

        pixels = image.imread(path)[..., :3]
        assert 0.003 < np.mean(pixels.min(axis=-1) < 0.6) < 0.6, path.name  # neither empty nor a blot


def test_demo_refuses_a_file_as_directory(tmp_path, capsys):
    path = tmp_path / "taken"
    path.write_text("")
    assert main(["demo", "--out", str(path)]) == 2
    assert "directory" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["demo", "limit-cycles", "improve", "warm-up"])
def test_help_of_every_command_has_an_example(command, capsys):
    with pytest.raises(SystemExit):
        main([command, "--help"])
    said = capsys.readouterr().out
    assert f"example:\n  ctrl-df {command}" in said


def test_a_missing_file_is_named(capsys):
    assert main(["limit-cycles", "nowhere.toml"]) == 2
    said = capsys.readouterr().err
    assert "nowhere.toml: no such file" in said and "Errno" not in said


def test_what_is_compiled_ahead_is_this_package(tmp_path, monkeypatch):
    """Also in a folder with another one: sources beside which the package is installed."""
    (tmp_path / "ctrl_df").mkdir()
    (tmp_path / "ctrl_df" / "__init__.py").write_text("raise ImportError('another one')")
    monkeypatch.chdir(tmp_path)
    messages = queue.Queue()
    worker = warm._Worker(messages)
    worker.begin("laws")
    assert messages.get(timeout=60) == (worker, "laws"), worker.last_words()
    worker.end()


def test_what_stops_compiling_ahead_is_said(monkeypatch):
    """By the last line of the process that died, at once."""
    monkeypatch.setattr(warm, "STEPS", {"nothing": warm.Step(print)})
    with pytest.raises(RuntimeError, match="compiling nothing failed: KeyError: 'nothing'"):
        warm.warm_up()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('[plant]\nkind = "inertia"\n', "inertia [kg m^2]"),
        ('[plant]\nkind = "inertia"\ninertia = 1.0\n[effects.coulomb]\n', "level [N m]"),
        ('[plant]\nkind = "inertia"\ninertia = 1.0\n[controller]\nki = 1.0\n', "kp [N m/rad]"),
        ('[plant]\nkind = "mass"\n', "mass [kg]"),
        ('[plant]\nkind = "mass"\nmass = 1.0\n[effects.coulomb]\n', "level [N]"),
    ],
)
def test_what_a_model_lacks_is_asked_for_in_the_units_of_its_machine(tmp_path, text, words):
    path = tmp_path / "model.toml"
    path.write_text(text)
    with pytest.raises(ValueError, match=re.escape(words)):
        read_model(path)


def test_families_and_imposed_motions_are_compiled_ahead():
    warm.STEPS["general family"].compile()
    of_general = (
        newton.mismatch_of,
        newton.differentiate_of,
        newton.newton_step_of,
        newton.spectral_radius_of,
    )
    if hasattr(apply, "signatures"):  # numba is not switched off
        assert all(f.signatures for f in (*of_general, apply))
    t = np.linspace(0, 1, 50)
    damper = cdf.Massless([cdf.Coulomb(5.0), cdf.Hysteresis(5.0)])
    path, start = path_of(t, np.sin(t)), np.zeros((1, laws_of((damper.core,)).states))
    for z0 in (start, np.broadcast_to(start, start.shape)):  # which is read-only
        imposed_forces((damper.core,), path, z0, rtol=1e-8)
    assert len(getattr(force_along, "signatures", [()])) == 1
