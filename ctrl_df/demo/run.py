"""``ctrl-df demo``: compute, print, draw."""

from __future__ import annotations

import textwrap
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import matplotlib

from ..table import Table
from .findings import Finding, find
from .hidden import study_text
from .systems import paper_loops

WIDTHS = (22, 36, 36, 34)


def run(folder: Path) -> list[Path]:
    """Run the whole demo; return the paths of the pictures.

    Parameters
    ----------
    folder : Path
        Where the pictures go; created if missing.

    Raises
    ------
    ValueError
        `folder` is a file.
    """
    if folder.exists() and not folder.is_dir():
        raise ValueError(f"--out needs a directory; got the file {folder}. Give another name.")
    folder.mkdir(parents=True, exist_ok=True)
    begin = time.perf_counter()
    with ProcessPoolExecutor(1, get_context("spawn")) as beside:
        hidden = beside.submit(_study, folder)
        beside.shutdown(wait=False)  # nothing else is to come
        paths = _paper(folder)
        if text := hidden.result():
            print("\n" + text)
    print(f"\ndemo: {time.perf_counter() - begin:.1f} s")
    return paths


def _study(folder: Path) -> str:
    """Make the hidden-effect study; its report is drawn without a window."""
    matplotlib.use("Agg")
    return study_text(folder)


def _paper(folder: Path) -> list[Path]:
    """Check the paper's loops, print what is true of them, draw."""
    print(
        "Azenha & Machado (1997), checked. F1, x1: fundamental amplitudes of force and position.\n",
        flush=True,
    )
    findings: dict[str, Finding] = {}
    rows = []
    for loop in paper_loops():
        finding = find(loop, list(findings.values()))
        findings[loop.key] = finding
        claim, predicted, exact, simulated = finding.cells()
        rows.append((f"{loop.title}:\n{claim}", predicted, exact, simulated))
    head = ("paper's claim", "describing function", "exact", "simulated")
    print(Table(head, tuple(rows), WIDTHS))
    print("\nWhere the paper holds, and where it does not:")
    lessons: dict[str, list[str]] = {}
    for loop in paper_loops():
        lessons.setdefault(loop.lesson, []).append(loop.title)
    for lesson, titles in lessons.items():
        print(textwrap.fill(f"- {'; '.join(titles)}. {lesson}", 120, subsequent_indent="  "))
    print(_GENERAL, flush=True)

    # pictures into files: no window, whatever the machine's display
    with matplotlib.rc_context():
        matplotlib.use("Agg", force=False)
        from .pictures import draw_all

        paths = draw_all(findings, folder)
    print(f"\n{len(paths)} pictures in {folder}: {', '.join(p.name for p in paths)}")
    return paths


_GENERAL = """\
- The response of the friction mass has half-wave symmetry and a dominant fundamental (Fig. 4): holds.
- "No closed form" for the friction mass: does not hold; ctrl_df uses one, with stiction and without.
- "A higher restitution brings high-order harmonics" (Fig. 8): it brings even harmonics and motion without a
  period; the odd harmonics hardly grow."""
