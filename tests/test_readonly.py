"""Installations that cannot be written: machine code is read where it lies, else compiled again in memory,
with one warning that names the remedy. Edited sources never leave machine code of their callers behind."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import ctrl_df
from ctrl_df import cli
from ctrl_df.model_file import EXAMPLE
from ctrl_df.simulate.compiler import compiled

PACKAGE = Path(ctrl_df.__file__).parent
STICTION = "[effects.stiction]\nlevel = 5.75\n"  # what slides on for long is simulated for long
NOWHERE = "/dev/null/nowhere"  # not even root can make it
FRICTION = "import ctrl_df as cdf; print(cdf.describing_function(cdf.friction_mass(9, 5, .5), 10., 5.))"
LIGHT = "import sys, ctrl_df; print('numba imported:', 'numba' in sys.modules); "
COUNTED = FRICTION + (
    "; from ctrl_df.df.closed_form.friction import _family"
    "; print('hits', sum(_family.stats.cache_hits.values()))"
)

SMALL = (
    "from ctrl_df.df.closed_form.impact_map import wrap"
    "; print(wrap(7.0), 'hits', sum(wrap.stats.cache_hits.values()))"
)
PLACES = sorted({file.parent.relative_to(PACKAGE) for file in PACKAGE.rglob("*.py")})
MODULES = {
    "sizes": "FIVE = 5.0\n",
    "inner": """
from .compiler.compiled import njit
from .sizes import FIVE

@njit()
def inner(x):
    return FIVE * x
""",
    "outer": """
from .compiler.compiled import njit
from .inner import (  # over several lines
    inner as called,
)

@njit()
def outer(x):
    return called(x) + 1.0
""",
}


def run(folder, *arguments, home=NOWHERE, locked=False, **environment):
    """Run Python on the package in `folder`, where nothing can be written but what `environment` names."""
    environment = {
        **{k: v for k, v in os.environ.items() if k not in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME")},
        "PYTHONPATH": str(folder),
        "HOME": str(home),
        "LOCALAPPDATA": str(home),
        "MPLCONFIGDIR": str(folder.parent),
        **{k: str(v) for k, v in environment.items()},
    }
    # root writes through permissions unless it gives that right up
    drop = ["setpriv", "--bounding-set=-all", "--inh-caps=-all"] if locked and os.geteuid() == 0 else []
    return subprocess.run(
        [*drop, sys.executable, *arguments],
        env=environment,
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=300,
    )


def words(done):
    """Return what was said on stderr, but for waiting: a machine with other work may be slow."""
    news = re.compile("ctrl_df: (machine code is made once|compiling |.* compiled in )")
    return [line for line in done.stderr.splitlines() if not news.match(line)]


def copied(folder, bare=False):
    """Copy the package without machine code; `bare`: what is imported of it imports nothing else of it."""
    shutil.copytree(PACKAGE, folder / "ctrl_df", ignore=shutil.ignore_patterns("__pycache__"))
    if bare:
        (folder / "ctrl_df" / "__init__.py").write_text("")
    return folder


def close(folder):
    """Put files where machine code would go."""
    for place in PLACES:
        (folder / "ctrl_df" / place / "__pycache__").write_text("no folder")
    return folder


@pytest.fixture
def cold(tmp_path):
    return close(copied(tmp_path / "cold", bare=True))


@pytest.fixture
def warm(tmp_path):
    """A copy of the package with its machine code, which cannot be written."""
    if os.geteuid() == 0 and shutil.which("setpriv") is None:
        pytest.skip("root without setpriv writes everywhere")
    folder = copied(tmp_path / "warm")
    for place in PLACES:
        (into := folder / "ctrl_df" / place / "__pycache__").mkdir()
        for kept in compiled.folders(PACKAGE / place / "_.py"):
            for file in kept.glob("*.nb*") if kept.is_dir() else ():
                if not (into / file.name).exists():
                    shutil.copy(file, into)
    locked = [folder, *folder.rglob("*")]
    for path in locked:
        path.chmod(0o555 if path.is_dir() else 0o444)
    yield folder
    for path in locked:
        path.chmod(0o755)


@pytest.fixture(scope="module")
def homeless(tmp_path_factory):
    """What a process said that can keep machine code nowhere."""
    return run(close(copied(tmp_path_factory.mktemp("homeless") / "cold")), "-c", LIGHT + COUNTED)


def test_a_read_only_installation_without_a_home_compiles_in_memory_and_says_so_once(homeless):
    done = homeless
    assert done.returncode == 0, done.stderr
    assert "\n(-0.00218" in done.stdout and "hits 0" in done.stdout
    assert done.stderr.count("Warning") == 1
    assert re.search("no place to keep.*Set NUMBA_CACHE_DIR to a folder that can be written", done.stderr)


def test_an_unwritable_cache_folder_compiles_in_memory_too(cold):
    done = run(cold, "-c", SMALL, NUMBA_CACHE_DIR=NOWHERE)
    assert done.returncode == 0 and done.stderr.count("NUMBA_CACHE_DIR") == 1, done.stderr


def test_a_law_of_the_users_compiles_where_nothing_can_be_kept(cold):
    (cold / "own.py").write_text("def law(t, x, v, z, p, dz):\n    return -p[0] * x\n")
    (cold / "__pycache__").write_text("no folder")
    code = (
        "from ctrl_df.simulate.program import pointers as p; import own; "
        "print(p.address(own.law, 'force') != 0, 'CFunc' in repr(type(p._compiled[own.law][1])))"
    )
    done = run(cold, "-c", code)
    assert done.stdout == "True True\n" and not words(done), done.stderr


def test_a_law_that_was_imported_compiles_in_a_script_that_others_start(tmp_path):
    script = tmp_path / "own_law.py"
    script.write_text(
        "from ctrl_df.simulate.program import pointers as p\n"
        "def law(t, x, v, z, p, dz):\n    return -p[0] * x\n"
        "print(p.address(law, 'force') != 0)\n"
    )
    folder = copied(tmp_path / "bare", bare=True)
    elsewhere = f"import runpy; runpy.run_path({str(script)!r}, run_name='__main__')"
    imported = f"import sys; sys.path.insert(0, {str(tmp_path)!r}); import own_law"
    # kept of the import, it is not imported again by the script: that would run twice
    for code in (imported, elsewhere, f"import sys; sys.path.insert(0, {str(tmp_path)!r}); {elsewhere}"):
        done = run(folder, "-c", code, NUMBA_CACHE_DIR=tmp_path / "kept")
        assert done.stdout == "True\n", done.stderr


def test_where_the_package_cannot_be_written_the_next_place_is_used(cold, tmp_path):
    done = run(cold, "-c", SMALL, home=tmp_path / "place")
    assert "hits 0" in done.stdout and not words(done), done.stderr
    assert len(list((tmp_path / "place").rglob("impact_map.wrap*.nbi"))) == 1


def test_machine_code_in_a_read_only_place_is_used(warm):
    ctrl_df.describing_function(ctrl_df.friction_mass(9, 5, 0.5), 10.0, 5.0)
    done = run(warm, "-c", COUNTED, locked=True)
    assert done.returncode == 0 and "hits 1" in done.stdout and not done.stderr, done.stderr


def test_damaged_machine_code_is_compiled_anew(cold, tmp_path):
    """In the folder that NUMBA_CACHE_DIR names, where the package cannot be written."""
    place = tmp_path / "place"
    first = run(cold, "-c", SMALL, NUMBA_CACHE_DIR=place)
    assert "hits 0" in first.stdout and not words(first), first.stderr
    files = list(place.rglob("impact_map.wrap*.nb*"))
    assert len(files) == 2
    for file in files:
        file.write_bytes(file.read_bytes()[:40])
    again, third = (run(cold, "-c", SMALL, NUMBA_CACHE_DIR=place) for _ in range(2))
    assert again.stdout.split()[1:] == ["hits", "0"] and third.stdout.split()[1:] == ["hits", "1"]


def test_the_command_line_works_in_a_read_only_installation(tmp_path, request, capsys):
    model = tmp_path / "model.toml"
    model.write_text(EXAMPLE + STICTION)
    assert cli.main(["limit-cycles", str(model)]) == 0  # whatever it needs is compiled now
    here = capsys.readouterr().out
    done = run(request.getfixturevalue("warm"), "-m", "ctrl_df", "limit-cycles", str(model), locked=True)
    assert done.returncode == 0 and done.stdout == here and "Warning" not in done.stderr, done.stderr


def test_a_caller_is_compiled_anew_when_what_it_calls_is_edited(tmp_path):
    folder = copied(tmp_path / "mypackage", bare=True)
    simulate = folder / "ctrl_df" / "simulate"
    for name, text in MODULES.items():
        (simulate / f"{name}.py").write_text(text)
    code = "from ctrl_df.simulate.outer import outer; print(outer(1.0), sum(outer.stats.cache_hits.values()))"
    said = [run(folder, "-c", code).stdout.split()]
    (simulate / "program" / "nodes.py").write_text("# no part of it")
    said.append(run(folder, "-c", code).stdout.split())
    (simulate / "sizes.py").write_text("FIVE = 7.0\n")
    said.append(run(folder, "-c", code).stdout.split())
    assert said == [["6.0", "0"], ["6.0", "1"], ["8.0", "0"]]


def test_every_compiled_file_of_the_package_keeps_its_code_here():
    for file in PACKAGE.rglob("*.py"):
        text = file.read_text(encoding="utf-8")
        if file.name != "compiled.py":
            assert not re.search(r"from numba import .*\bnjit|numba\.(njit|cfunc)", text), file


def test_the_package_is_imported_without_numba(homeless):
    assert homeless.stdout.startswith("numba imported: False\n"), homeless.stderr
