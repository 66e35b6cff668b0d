"""Every example runs, headless, and the number it prints is the one it asserts."""

import os
import runpy
import subprocess
import sys
import warnings
from pathlib import Path

import matplotlib.pyplot as plt
import pytest

from ctrl_df.blocks import effect

EXAMPLES = sorted(p for p in (Path(__file__).parent.parent / "examples").glob("*.py") if p.name[0] != "_")


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda p: p.stem)
def test_example(path, tmp_path, monkeypatch, capsys):
    text = path.read_text()
    if "FOLDER" in "".join(text.splitlines()[:12]):
        pytest.skip("this example takes data as an argument")
    monkeypatch.chdir(tmp_path)
    if "__main__" in text:  # processes that it starts import it
        printed = alone(path, tmp_path)
    else:
        monkeypatch.setattr(effect, "_LIBRARY", dict(effect._LIBRARY))  # an effect registered here ends here
        monkeypatch.setattr(sys, "argv", [str(path)])
        with warnings.catch_warnings():
            warnings.simplefilter("default")
            warnings.simplefilter("error", RuntimeWarning)
            runpy.run_path(str(path), run_name="__main__")
        plt.close("all")
        printed = capsys.readouterr().out
    assert "assert" in text
    assert any(c.isdigit() for c in printed)
    assert not list(tmp_path.iterdir()), "an example saves a picture only when asked"


def alone(path, folder):
    """Run an example in a process of its own; return what it printed."""
    environment = {**os.environ, "MPLBACKEND": "Agg", "PYTHONWARNINGS": "error::RuntimeWarning"}
    run = subprocess.run(
        [sys.executable, str(path)], cwd=folder, env=environment, capture_output=True, text=True, timeout=300
    )
    assert run.returncode == 0, run.stdout + run.stderr
    return run.stdout
