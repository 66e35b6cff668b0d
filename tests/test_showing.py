"""Results show themselves: short in a shell, as tables in a notebook, as numbers in a DataFrame."""

import os
import re
import subprocess
import sys
from html.parser import HTMLParser

import numpy as np
import pytest

import ctrl_df as cdf
from ctrl_df.table import WIDEST, Table, frame, without_empty

GAINS, DRIVE = cdf.pid(2000, 44250, 130), cdf.friction_mass(9, 5, 0.5)
STICKING = cdf.friction_mass(9, 5, 0.5, static=5.75)  # comes to its orbit soonest


@pytest.fixture(scope="module")
def response():
    return cdf.describing_function_response(
        GAINS, STICKING, np.linspace(5.8, 100, 20), np.linspace(4, 40, 30)
    )


@pytest.fixture(scope="module")
def check(response):
    return cdf.verify(response)


def _cells(html):
    class Parser(HTMLParser):
        cells: list

        def handle_data(self, data):
            self.cells.append(data.strip())

    parser = Parser()
    parser.cells = []
    parser.feed(html)
    return [c for c in parser.cells if c]


def test_nothing_shows_its_fields_at_length(response, check):
    orbit = check.orbits[0]
    event = cdf.event_response(DRIVE, [0, 0.5, 1.0], 20.0)
    for thing in (
        response,
        response.limit_cycles[0],
        check,
        check.rows[0],
        orbit,
        event,
        DRIVE,
        response.family,
    ):
        assert len(repr(thing)) < 200 and "\n" not in repr(thing) and "0x" not in repr(thing)
    assert repr(check).startswith("<Check: ") and repr(orbit).startswith("<Orbit: ")
    assert "1 s, 3 times" in repr(event)


def test_where_no_orbit_is_there_is_nothing_to_draw():
    answer = cdf.find_limit_cycle(cdf.closed_loop(cdf.pid(2000, 0, 130), DRIVE))
    assert not answer and len(repr(answer)) < 80 and "comes to rest" in _cells(answer._repr_html_())
    with pytest.raises(AttributeError, match="no orbit was found"):
        answer.plot()


def test_states_are_given_by_name():
    loop = cdf.closed_loop(GAINS, DRIVE)
    named = cdf.event_response(loop, [0, 0.1], 0, {"x": 1e-3})
    listed = cdf.event_response(loop, [0, 0.1], 0, [0, 1e-3, 0])
    assert named.outputs[0, 0] == 1e-3 and (named.outputs == listed.outputs).all()
    assert (cdf.event_response(loop, [0, 0.1], 0, {"plant_x": 1e-3}).outputs == listed.outputs).all()
    with pytest.raises(ValueError, match="controller_x"):
        cdf.event_response(loop, [0, 0.1], 0, {"y": 1e-3})


def test_blocks_print_signals_and_parameters():
    text = str(cdf.Inertia(2.0, [cdf.Coulomb(0.3)], name="axis"))
    assert "axis" in text and "torque [N m]" in text and "bound method" not in text
    assert re.search(r"coulomb.level\s+0.3\s+N m", text)
    assert "coulomb.level" in _cells(cdf.Mass(1.0, [cdf.Coulomb(0.3)])._repr_html_())
    block, t = cdf.friction_mass(2, 5, 0.5), np.linspace(0, 2, 50)
    assert "breakaway" in _cells(cdf.event_response(block, t, 8 * np.sin(6 * t))._repr_html_())
    assert "stick-slip" in _cells(cdf.describing_function_family(block, [6.0, 8.0], [3.0])._repr_html_())


def test_the_prediction_with_its_harmonics_is_in_the_tables(response, check):
    corrected = next(c.corrected for c in response.limit_cycles if c.corrected)
    shown = f"{corrected[0]:.6g} @ {corrected[1]:.6g}"
    assert shown in check.table() and shown in _cells(check._repr_html_())
    assert "corrected" in _cells(response._repr_html_())


def test_frames_hold_numbers(response, check):
    table = check.to_pandas()
    assert len(table) == len(check) and table.predicted_omega.dtype == float
    row = check.rows[0]
    assert table.verdict[0] == row.verdict and table.predicted_omega[0] == row.predicted.omega
    assert list(response.to_pandas().omega) == [c.omega for c in response.limit_cycles]


def test_no_pandas_says_how_to_get_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(ImportError, match="pip install pandas"):
        frame([])


def test_long_cells_wrap_and_empty_columns_go():
    table = without_empty(("a", "b", "c"), [("1", "", "word " * 40), ("2", "", "")])
    assert table.head == ("a", "c") and max(map(len, str(table).splitlines())) < WIDEST + 20
    assert "&lt;b&gt;" in Table(("x",), (("<b>",),))._repr_html_()


def test_versions(capsys):
    cdf.show_versions()
    said = capsys.readouterr().out
    assert said.startswith(f"ctrl_df {cdf.__version__}") and "numba" in said
    done = subprocess.run([sys.executable, "-m", "ctrl_df", "--version"], capture_output=True, text=True)
    assert done.stdout.strip() == f"ctrl-df {cdf.__version__}"


@pytest.mark.skipif(os.name == "nt", reason="pipes of a shell")
def test_a_reader_that_leaves_early_is_no_error():
    code = (
        "import sys; from ctrl_df import cli; cli._demo = lambda options: print('x' * 10**7) or 0; "
        "sys.exit(cli.main(['demo']))"
    )
    done = subprocess.run(
        ["sh", "-c", '"$0" -c "$1" | head -c 10', sys.executable, code], capture_output=True, text=True
    )
    assert done.stdout == "x" * 10 and done.stderr == ""
