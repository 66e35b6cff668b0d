"""Save files: taken up by the very same computation only, never by another; damaged ones are refused with the
remedy; whatever ends a computation, no finished line is lost."""

import ctypes
import functools
import os
import signal
import subprocess
import sys
import textwrap
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from dataclasses import dataclass

import control as ct
import numpy as np
import pytest

import ctrl_df as cdf
from ctrl_df.df.saving.family_file import read_arrays
from ctrl_df.df.saving.fingerprint import fingerprint
from ctrl_df.df.saving.journal import MAGIC, Journal, is_journal, lines_done

pytestmark = pytest.mark.filterwarnings("ignore:.*aperiodic:RuntimeWarning")  # backlash rattles somewhere

FRICTION = cdf.friction_mass(9, 5, 0.5)
GAIN = 2.0
TABLE = np.array([0.0, 1.0, 4.0])


def scaled(x):
    return GAIN * cubed(x)


def cubed(x):
    return x**3


def family(F, save, A=(1.0, 2.0), omega=None, **kwargs):
    return cdf.describing_function_family(F, list(A), omega, save=save, **kwargs)


class Valve:
    opening = 0.5

    def __init__(self, gain):
        self.gain = gain

    def __call__(self, u):
        return self.opening * self.gain * u

    def squared(self, u):
        return self.gain * u * abs(u)


@dataclass(frozen=True)
class Magnet(cdf.Effect):
    role = "force"
    pull: float = cdf.parameter("N/m", default=1.0)

    @staticmethod
    def law(t, x, v, z, p, dz):
        return -p[0] * x


@dataclass(frozen=True)
class Repeller(cdf.Effect):
    role = "force"
    pull: float = cdf.parameter("N/m", default=1.0)

    @staticmethod
    def law(t, x, v, z, p, dz):
        return p[0] * x


Repeller.__name__ = Repeller.__qualname__ = "Magnet"  # a law changed, its name kept


def made(power):
    return lambda x: x**power


def ratio(poles, name=None):
    return ct.tf([1.0], poles, name=name)


def static(gain):
    return ct.nlsys(None, lambda t, x, u, params: params["k"] * u, inputs=1, outputs=1, params={"k": gain})


def lag(gain):
    return ct.nlsys(
        lambda t, x, u, params: -x + gain * u, lambda t, x, u, params: x, inputs=1, outputs=1, states=1
    )


def joined(gain):
    one, two = ct.ss(-1, 1, 1, 0, name="one"), ct.ss(-2, 1, 1, 0, name="two")
    one.input_labels, one.output_labels = ["u"], ["w"]
    two.input_labels, two.output_labels = ["w"], ["y"]
    return ct.InterconnectedSystem(
        [one, two], connections=[["two.w", (0, 0, gain)]], inplist=["one.u"], outlist=["two.y"]
    )


PAIRS = {
    "python-control's saturation": (ct.saturation_nonlinearity(1), ct.saturation_nonlinearity(3)),
    "lambdas": (lambda x: x**3, lambda x: x**5),
    "closures": (made(3), made(5)),
    "defaults": (lambda x, k=1.0: k * x, lambda x, k=2.0: k * x),
    "partials": (functools.partial(pow, exp=3), functools.partial(pow, exp=5)),
    "arrays in a closure": (
        (lambda t: lambda x: np.interp(x, [0, 1, 2], t))(TABLE),
        (lambda t: lambda x: np.interp(x, [0, 1, 2], t))(TABLE + [0, 0, 1e-15]),
    ),
    "objects": (Valve(1.0), Valve(2.0)),
    "bound methods": (Valve(1.0).squared, Valve(2.0).squared),
    "methods": (Valve(1.0).squared, Valve(1.0)),
    "state spaces of one name": (ct.ss(-1, 1, 1, 0, name="p"), ct.ss(-2, 1, 1, 0, name="p")),
    "transfer functions": (ratio([1.0, 1.0], "p"), ratio([1.0, 1.0 + 1e-15], "p")),
    "parameters of an nlsys": (static(1.0), static(3.0)),
    "functions of an nlsys": (lag(1.0), lag(2.0)),
    "connections": (joined(1.0), joined(2.0)),
    "the last digit of a block": (FRICTION, cdf.friction_mass(9, 5, 0.5000000000000001)),
    "laws of an effect": (cdf.Mass(9).with_effect(Magnet(3.0)), cdf.Mass(9).with_effect(Repeller(3.0))),
    "points of a broken line": (
        cdf.piecewise_linear([0, 1, 2], [0, 1, 1]),
        cdf.piecewise_linear([0, 1, 2], [0, 1, 2]),
    ),
}


@pytest.mark.parametrize("pair", PAIRS, ids=lambda name: name.replace(" ", "-"))
def test_another_block_never_gets_the_saved_results(pair, tmp_path):
    one, other = PAIRS[pair]
    dynamic = getattr(one, "nstates", 0) != 0
    omega = [2.0] if dynamic else None
    A = [6.0, 8.0] if isinstance(one, cdf.Mechanism) else [1.0, 2.0]
    first = family(one, tmp_path / "f.npz", A, omega)
    again = family(one, tmp_path / "f.npz", A, omega)
    assert np.array_equal(first.harmonics, again.harmonics, equal_nan=True)
    with pytest.raises(ValueError, match="another computation.*remove that file"):
        family(other, tmp_path / "f.npz", A, omega)


@pytest.mark.parametrize(
    "change",
    [
        dict(A=[1.0, 2.0000000000000004]),
        dict(omega=[3.0]),
        dict(orders=4),
        dict(output="v"),
        dict(A=[1.0]),
    ],
    ids=["amplitude", "frequency", "orders", "output", "grid"],
)
def test_every_argument_that_decides_numbers_is_in_the_fingerprint(change, tmp_path):
    same = dict(A=[1.0, 2.0], omega=[2.0], orders=3)
    block = cdf.friction_mass(9, 0.5, 0.5)
    family(block, tmp_path / "f.npz", **same)
    with pytest.raises(ValueError, match="another computation"):
        family(block, tmp_path / "f.npz", **{**same, **change})


def test_solver_options_and_own_methods_are_in_the_fingerprint(tmp_path):
    block = cdf.Mass(9).with_effect(cdf.Stribeck(6.0, 0.01)).with_effect(cdf.Coulomb(5.0))
    family(block, tmp_path / "f.npz", [10.0], [5.0])
    with pytest.raises(ValueError, match="another computation"):
        family(block, tmp_path / "f.npz", [10.0], [5.0], averages=32)

    class Own(cdf.DescribingFunctionNonlinearity):
        def __call__(self, u):
            return u

        def describing_function(self, A):
            return 7.0

        def _isstatic(self):
            return True

    assert family(Own(), tmp_path / "own.npz").N[0, 0] == 7
    with pytest.raises(ValueError, match="another computation"):
        family(Own(), tmp_path / "own.npz", try_method=False)


def test_a_change_in_a_global_or_in_a_function_called_is_seen(monkeypatch):
    before = fingerprint(scaled)
    monkeypatch.setitem(globals(), "GAIN", 3.0)
    assert fingerprint(scaled) != before
    monkeypatch.setitem(globals(), "GAIN", 2.0)
    assert fingerprint(scaled) == before
    monkeypatch.setitem(globals(), "cubed", lambda x: x**5)
    assert fingerprint(scaled) != before
    before = fingerprint(Valve(1.0))
    monkeypatch.setattr(Valve, "opening", 0.25)
    assert fingerprint(Valve(1.0)) != before


def test_names_and_places_are_not_in_the_fingerprint():
    def cubed_elsewhere(y):
        return y**3

    first = lambda x: x**3  # noqa: E731

    second = lambda x: x**3  # noqa: E731
    assert fingerprint(first) == fingerprint(second)
    assert fingerprint(cubed_elsewhere) != fingerprint(lambda x: x**5)
    assert fingerprint(ct.ss(-1, 1, 1, 0, name="a")) == fingerprint(ct.ss(-1, 1, 1, 0, name="b"))
    assert fingerprint(cdf.friction_mass(9, 5, name="a")) == fingerprint(cdf.friction_mass(9, 5, name="b"))
    assert fingerprint(joined(1.0)) == fingerprint(joined(1.0))


STABLE = """
    import functools, math
    import control as ct, numpy as np, ctrl_df as cdf
    from ctrl_df.df.saving.fingerprint import fingerprint
    table = {"b": np.arange(3.0), "a": {"x", "y", "z"}}
    class Law:
        def __init__(self): self.table = table
        def __call__(self, u): return math.sin(u) + len(self.table["a"]) + super().__hash__() * 0
    def count(n): return 1 if n < 2 else n * count(n - 1)
    print(fingerprint(lambda x: x * len(table), Law(), Law().__call__, functools.partial(count, 3), np.tanh,
        ct.relay_hysteresis_nonlinearity(1, 2), ct.nlsys(ct.ss(-1, 1, 1, 0)), ct.tf([1], [1, 2]),
        cdf.closed_loop(cdf.pid(20, 1, 3, tf=0.01), cdf.friction_mass(9, 5, 0.5)), cdf.play(1.0),
        cdf.backlash_masses(1, 8, 0.018, 0.2)))
"""


def test_the_fingerprint_is_the_same_in_every_process(capsys):
    """Here and in one that orders sets otherwise."""
    code, other = textwrap.dedent(STABLE), "2" if os.environ.get("PYTHONHASHSEED") == "1" else "1"
    exec(code, {"__name__": "__main__"})
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "PYTHONHASHSEED": other},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout == capsys.readouterr().out and len(done.stdout.strip()) == 64


def _opaque():
    lock, c = threading.Lock(), ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_double)(abs)

    def locked(x):
        with lock:
            return x

    return {"a C function": lambda x: c(x), "a lock": locked, "ufunc of Python": np.frompyfunc(abs, 1, 1)}


@pytest.mark.parametrize("name", ["a C function", "a lock", "ufunc of Python"])
def test_what_hides_its_state_is_refused_with_the_remedy(name, tmp_path):
    law = _opaque()[name]
    with pytest.raises(ValueError, match="attribute `fingerprint`.*leave save out"):
        family(law, tmp_path / "f.npz")
    assert not list(tmp_path.iterdir())
    if name == "a lock":
        law.fingerprint = "version 1"
        family(law, tmp_path / "f.npz")
        law.fingerprint = "version 2"
        with pytest.raises(ValueError, match="another computation"):
            family(law, tmp_path / "f.npz")


# --- files that are wrong -----------------------------------------------------------------------------------


@pytest.fixture
def saved(tmp_path):
    path = tmp_path / "f.npz"
    family(FRICTION, path, [4.0, 8.0, 12.0], [2.0, 5.0], orders=3)
    return path


def damaged(change):
    def write(path):
        data = read_arrays(path)
        change(data)
        np.savez(path, **data)

    return write


def cut_off(path):
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


BAD = {
    "half a file": (cut_off, "half copied"),
    "a broken byte": (lambda p: p.write_bytes(_flipped(p.read_bytes())), "damaged"),
    "an empty file": (lambda p: p.write_bytes(b""), "damaged"),
    "a text": (lambda p: p.write_text("t,F,x\n0,1,2\n"), "no family file"),
    "a stranger": (lambda p: np.savez(p, a=1), "lacks"),
    "harmonics cut": (damaged(lambda d: d.update(harmonics=d["harmonics"][:2])), "harmonics must have shape"),
    "text in omega": (damaged(lambda d: d.update(omega=np.array(["2", "5"]))), "omega must be real numbers"),
    "omega negative": (damaged(lambda d: d.update(omega=-d["omega"])), "omega must be positive"),
    "amplitude nan": (damaged(lambda d: d.update(amplitudes=d["amplitudes"] * np.nan)), "amplitudes must be"),
    "real harmonics": (damaged(lambda d: d.update(harmonics=d["harmonics"].real)), "complex numbers"),
    "regime as numbers": (damaged(lambda d: d.update(regime=np.zeros((3, 2)))), "regime must be text"),
    "regime of one row": (damaged(lambda d: d.update(regime=d["regime"][0])), "regime must have shape"),
    "regime empty": (damaged(lambda d: d.update(regime=np.full((3, 2), ""))), "regime must name"),
    "infinite": (damaged(lambda d: d["harmonics"].__setitem__((2, 0), np.inf)), "must be finite"),
    "residual transposed": (
        damaged(lambda d: d.update(residual=d["residual"].T)),
        "residual must have shape",
    ),
    "from the future": (damaged(lambda d: d.update(format=np.array(99))), "newer ctrl_df"),
}


def _flipped(data):
    inside = data.index(b"harmonics.npy") + 60  # of the packed numbers, not of a zip's idle fields
    return data[:inside] + bytes([data[inside] ^ 255]) + data[inside + 1 :]


@pytest.mark.parametrize("name", BAD, ids=lambda name: name.replace(" ", "-"))
def test_a_damaged_file_gives_one_clear_error(name, saved):
    damage, message = BAD[name]
    damage(saved)
    with pytest.raises(ValueError, match=message) as refused:
        cdf.load_family(saved)
    assert str(saved) in str(refused.value)
    with pytest.raises(ValueError, match=message):
        family(FRICTION, saved, [4.0, 8.0, 12.0], [2.0, 5.0], orders=3)


def test_what_is_no_file_is_said(saved, tmp_path):
    with pytest.raises(FileNotFoundError, match="none.npz. Check the path."):
        cdf.load_family(tmp_path / "none.npz")
    with pytest.raises(TypeError, match="path of a file"):
        cdf.load_family(0)  # to open() a number is an open file
    for place, error in ((3, TypeError), (tmp_path, IsADirectoryError)):
        with pytest.raises(error, match="save needs (the )?path"):
            cdf.load_family(saved).save(place)


@pytest.mark.parametrize("executor", [None, ThreadPoolExecutor])
def test_a_finished_file_is_taken_up_as_it_is(executor, saved):
    before, when = saved.read_bytes(), saved.stat().st_mtime_ns
    with (executor or nullcontext)(**({"max_workers": 1} if executor else {})) as pool:
        again = family(FRICTION, saved, [4.0, 8.0, 12.0], [2.0, 5.0], orders=3, executor=pool)
    assert saved.read_bytes() == before and saved.stat().st_mtime_ns == when
    assert np.array_equal(again.harmonics, cdf.load_family(saved).harmonics, equal_nan=True)


def test_a_file_of_format_1_is_read_but_not_taken_up(saved):
    data = read_arrays(saved)
    data |= dict(format=np.array(1), fingerprint=np.array("0" * 64), done=np.ones(3, dtype=bool))
    del data["lines"]
    np.savez(saved, **data)
    assert np.array_equal(cdf.load_family(saved).harmonics, data["harmonics"], equal_nan=True)
    with pytest.raises(ValueError, match="earlier ctrl_df.*remove that file"):
        family(FRICTION, saved, [4.0, 8.0, 12.0], [2.0, 5.0], orders=3)
    data["done"][1:] = False
    data["regime"][1:], data["harmonics"][1:] = "", np.inf
    np.savez(saved, **data)
    with pytest.raises(ValueError, match="1 of 3 lines"):
        cdf.load_family(saved)


@pytest.mark.parametrize(
    ("save", "error"),
    [(3, TypeError), (b"f.npz", TypeError), ("missing/f.npz", FileNotFoundError), (".", IsADirectoryError)],
)
def test_a_place_that_cannot_be_is_refused_before_the_work(save, error, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("ctrl_df.df.work.compute_part", lambda *args: pytest.fail("computed"))
    with pytest.raises(error, match="save (as|needs)|needs save"):
        family(FRICTION, save, [6.0], [2.0])


# --- ends of all kinds --------------------------------------------------------------------------------------

LONG = """
    import sys
    import numpy as np, ctrl_df as cdf
    block = cdf.backlash_masses(1, 8, 0.018, 0.2)
    print("begins", flush=True)
    cdf.describing_function_family(block, np.geomspace(1, 40, 100), np.geomspace(10, 40, 150), orders=3,
        save=sys.argv[1])
"""
GRID = dict(A=np.geomspace(1, 40, 100), omega=np.geomspace(10, 40, 150), orders=3)


def _stopped(path, sign):
    """Run LONG until it has saved some lines, send it a signal, and return it with what it had saved."""
    code = textwrap.dedent(LONG)
    process = subprocess.Popen(
        [sys.executable, "-c", code, str(path)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    try:
        end = time.monotonic() + 60
        while time.monotonic() < end and process.poll() is None:
            if path.exists() and lines_done(path) >= 5:
                break
            time.sleep(0.02)
        before, sent = lines_done(path), time.monotonic()
        process.send_signal(sign)
        _, errors = process.communicate(timeout=30)
        return before, time.monotonic() - sent, errors
    finally:
        process.kill()
        process.wait()


@pytest.mark.parametrize("sign", [signal.SIGINT, signal.SIGKILL])
def test_a_signal_loses_no_finished_line_and_the_same_call_goes_on(sign, tmp_path):
    path = tmp_path / "f.npz"
    before, took, errors = _stopped(path, sign)
    assert 5 <= before <= lines_done(path) < 100
    if sign == signal.SIGINT:
        assert took < 3  # a second, and the interpreter's end
        assert f"{lines_done(path)} of 100 lines are kept" in errors.splitlines()[-1]
    with pytest.raises(ValueError, match=f"{lines_done(path)} of 100 lines.*same save="):
        cdf.load_family(path)
    held = {int(i): record["harmonics"] for i, record in _records(path)}
    block = cdf.backlash_masses(1, 8, 0.018, 0.2)
    resumed = family(block, path, **GRID)
    assert not is_journal(path) and all(np.array_equal(resumed.harmonics[i], y[0]) for i, y in held.items())
    rows = [0, max(held), 99]
    fresh = family(block, None, GRID["A"][rows], GRID["omega"], orders=3)
    assert np.array_equal(resumed.harmonics[rows], fresh.harmonics, equal_nan=True)
    assert np.array_equal(cdf.load_family(path).regime, resumed.regime)


def _records(path):
    journal, records = Journal.resume(path)
    found = [(record["lines"][0], record) for record in records]
    journal.close()
    return found


def test_a_record_torn_by_a_crash_is_computed_anew(tmp_path, monkeypatch):
    path = tmp_path / "f.npz"
    grid = dict(A=[6.0, 8.0, 12.0, 20.0], omega=[20.0, 30.0])
    block = cdf.backlash_masses(1, 8, 0.018, 0.2)
    whole = family(block, None, **grid)
    _interrupted(block, path, grid, monkeypatch, after=3)
    assert lines_done(path) == 3
    with open(path, "r+b") as file:
        file.truncate(path.stat().st_size - 10)
    assert lines_done(path) == 2
    assert np.array_equal(family(block, path, **grid).harmonics, whole.harmonics)


def test_a_journal_cut_anywhere_gives_the_lines_before_the_cut(tmp_path):
    path = tmp_path / "f.npz"
    journal = Journal.begin(path, {"lines": 3})
    ends = [path.stat().st_size]
    for line in range(3):
        journal.append(
            lines=np.array([line]), harmonics=np.full((1, 2, 2), line + 1j), regime=np.array([["slip"] * 2])
        )
        ends.append(path.stat().st_size)
    journal.close()
    whole = path.read_bytes()
    for cut in range(ends[0], len(whole) + 1):
        path.write_bytes(whole[:cut])
        assert lines_done(path) == sum(end <= cut for end in ends[1:])
    for flipped in range(ends[1], ends[2], 7):  # in the second record
        path.write_bytes(whole[:flipped] + bytes([whole[flipped] ^ 1]) + whole[flipped + 1 :])
        assert lines_done(path) == 1
        assert [int(i) for i, _ in _records(path)] == [0] and path.stat().st_size == ends[1]


def _interrupted(block, path, grid, monkeypatch, after):
    from ctrl_df.df import work

    compute, calls = work.compute_part, []

    def stops(*args):
        if len(calls) == after:
            raise KeyboardInterrupt
        calls.append(1)
        return compute(*args)

    with (
        monkeypatch.context() as patch,
        pytest.raises(KeyboardInterrupt, match=f"{after} of 4 lines|No line"),
    ):
        patch.setattr(work, "compute_part", stops)
        family(block, path, **grid)


def test_an_interruption_says_what_is_kept(tmp_path, monkeypatch):
    block, grid = cdf.backlash_masses(1, 8, 0.018, 0.2), dict(A=[6.0, 8.0, 12.0, 20.0], omega=[20.0, 30.0])
    from ctrl_df.df import work

    monkeypatch.setattr(work, "compute_part", lambda *args: (_ for _ in ()).throw(KeyboardInterrupt))
    with pytest.raises(KeyboardInterrupt, match="0 of 4 lines were done and are lost; save= keeps them"):
        family(block, None, **grid)
    with pytest.raises(KeyboardInterrupt, match="nothing is kept"):
        family(block, tmp_path / "f.npz", **grid)
    assert not list(tmp_path.iterdir())


def test_two_processes_do_not_write_one_file(tmp_path, monkeypatch):
    pytest.importorskip("fcntl")
    path, grid = tmp_path / "f.npz", dict(A=[6.0, 8.0, 12.0, 20.0], omega=[20.0, 30.0])
    block = cdf.backlash_masses(1, 8, 0.018, 0.2)
    _interrupted(block, path, grid, monkeypatch, after=1)
    code = """if True:
        import fcntl, sys
        file = open(sys.argv[1], "r+b")
        fcntl.lockf(file, fcntl.LOCK_EX)
        print(flush=True)
        input()"""
    holder = subprocess.Popen(
        [sys.executable, "-c", code, str(path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    with holder:
        holder.stdout.readline()
        with pytest.raises(BlockingIOError, match="written by another process"):
            family(block, path, **grid)
        holder.communicate(b"\n")
    assert family(block, path, **grid).N.shape == (4, 2)


def test_a_torn_header_is_refused(tmp_path):
    (tmp_path / "f.npz").write_bytes(MAGIC + b'{"format": 2, "fing')
    with pytest.raises(ValueError, match="Remove it"):
        cdf.load_family(tmp_path / "f.npz")
