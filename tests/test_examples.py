"""Every example runs, headless, and the number it prints is the one it asserts."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = sorted(p for p in (Path(__file__).parent.parent / "examples").glob("*.py") if p.name[0] != "_")


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda p: p.stem)
def test_example(path, tmp_path):
    environment = {**os.environ, "MPLBACKEND": "Agg", "PYTHONWARNINGS": "error::RuntimeWarning"}
    if "FOLDER" in "".join(path.read_text().splitlines()[:12]):
        pytest.skip("this example takes data as an argument")
    run = subprocess.run(
        [sys.executable, str(path)],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert run.returncode == 0, run.stdout + run.stderr
    assert "assert" in path.read_text()
    assert any(c.isdigit() for c in run.stdout)
    assert not list(tmp_path.iterdir()), "an example saves a picture only when asked"
