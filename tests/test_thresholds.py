"""Tuned numbers of identification stand in one file, and those that follow from others do."""

import ast
import math
from pathlib import Path

import ctrl_df
from ctrl_df.identify import thresholds

ELSEWHERE = {
    "_PREPARED",  # a size of memory
    "OUTPUT_COLUMNS",  # where an engine puts out what
    "_SPEEDS",  # where laws are probed
}

ROOMS = (
    "",
    "datasets",
    "estimation",
    "planning",
    "residuals",
    "results",
    "selection",
    "smoothing",
    "starting",
    "tables",
)


def numbers_of(path):
    """Yield names of a file's module-level constants that hold numbers."""
    for node in ast.parse(path.read_text()).body:
        if not isinstance(node, ast.Assign | ast.AnnAssign) or node.value is None:
            continue
        if any(isinstance(n, ast.Constant) and type(n.value) in (int, float) for n in ast.walk(node.value)):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            yield from (n.id for t in targets for n in ast.walk(t) if isinstance(n, ast.Name))


def test_they_stand_in_one_place():
    root = Path(ctrl_df.__file__).parent / "identify"
    found = [
        f"{path.relative_to(root)}: {name}"
        for room in ROOMS
        for path in sorted((root / room).glob("*.py"))
        for name in numbers_of(path)
        if path.name != "thresholds.py" and name not in ELSEWHERE
    ]
    assert not found, found


def test_what_follows_follows():
    chance = thresholds.SHAPES * math.exp(-thresholds.SIGNIFICANT)
    assert 0.1 * thresholds.FALSE_ALARM < chance < thresholds.FALSE_ALARM
    assert abs(math.log(thresholds.GROWTH) - 3 / math.sqrt(100)) < 5e-3
    assert abs(math.log(thresholds.NOISIER) - 3 / math.sqrt(80)) < 5e-3
    assert abs(thresholds.FLOOR - 1 - 1 / math.sqrt(2 * 500)) < 2e-3
    bump = math.exp(-((thresholds.PASSED / 1e-3) ** 2))
    assert 0.009 < bump < 0.01
    assert thresholds.COARSE > 1 / math.sqrt(12)
    assert max(thresholds.LEVELS) == thresholds.SHORTEST < thresholds.BRIEF
