"""Every code block of README and docs runs, and prints what is printed below it.

Blocks of one page share their names and a temporary directory, in the order of the page. A ``text`` block
that follows a block of code is what it prints: words alike, numbers within a hundredth, ``...`` stands for
anything. A block of TOML is a model file and is written under the name in its first line. In ``console``
blocks the lines ``$ ctrl-df`` run; others (installing) are what .ci/run does.
"""

import io
import os
import re
import shlex
import warnings
from contextlib import redirect_stdout
from pathlib import Path

import matplotlib.pyplot as plt
import pytest

from ctrl_df.cli import main
from ctrl_df.model_file import read_model

ROOT = Path(__file__).parent.parent
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.M | re.S)
TOKEN = re.compile(r"[-+]?\d+\.?\d*(?:e[-+]?\d+)?|[^\W\d]+|[^\w\s]")
WITHIN = 0.01


def blocks(path):
    """Return (language, code, line) of every fenced block."""
    text = path.read_text()
    return [(m[1], m[2], text.count("\n", 0, m.start()) + 2) for m in BLOCK.finditer(text)]


def tokens(text):
    """Return the numbers and words of a text; rules drawn in dashes are none."""
    return TOKEN.findall(re.sub(r"-{3,}", " ", text))


def alike(said, printed):
    """Whether two tokens are one: numbers within a hundredth."""
    try:
        return said == printed or abs(float(said) - float(printed)) <= WITHIN * abs(float(said)) + 1e-12
    except ValueError:
        return False


def same(said, printed):
    """Whether what a page shows is what was printed; ``...`` stands for any tokens."""
    pieces, rest = [tokens(part) for part in said.split("...")], tokens(printed)
    for k, piece in enumerate(pieces):
        size, last = len(piece), k == len(pieces) - 1
        places = range(len(rest) - size + 1) if k else [0]
        if last:
            places = [i for i in places if i + size == len(rest)]
        fits = [i for i in places if all(map(alike, piece, rest[i : i + size])) and len(rest) >= i + size]
        if not fits:
            return False
        rest = rest[fits[0] + size :]
    return True


def shell(code):
    """Run the lines ``$ ctrl-df ...``."""
    for line in re.findall(r"^\$ (ctrl-df .*)$", code, re.M):
        words = shlex.split(line)[1:]
        assert main(words) == 0, line


def run(language, code, names, path, line):
    """Run one block; return what it printed."""
    out = io.StringIO()
    with redirect_stdout(out):
        if language == "python":
            exec(compile("\n" * (line - 1) + code, str(path), "exec"), names)
        elif language == "console":
            shell(code)
        elif language == "toml":
            name = re.match(r"# (\S+\.toml)\n", code)
            target = Path(name[1] if name else "model.toml")
            target.write_text(code)
            read_model(target)
    return out.getvalue()


# both questions of the package, one of them put to the whole library: the first thing that must not break
QUICK = pytest.param(PAGES[0], marks=pytest.mark.quick)


@pytest.mark.parametrize("path", [QUICK, *(p for p in PAGES[1:] if blocks(p))], ids=lambda p: p.stem)
def test_code_blocks_run_as_printed(path, tmp_path):
    before = os.getcwd()
    os.chdir(tmp_path)
    names, printed = {"__name__": "page"}, ""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)
            for language, code, line in blocks(path):
                if language == "text":
                    assert same(code, printed), f"{path.name}, line {line}: printed was\n{printed}"
                else:
                    printed = run(language, code, names, path, line)
    finally:
        os.chdir(before)
        plt.close("all")


def test_every_block_states_a_language():
    known = {"python", "text", "toml", "console", "json", "matlab", "mermaid"}
    for path in PAGES:
        fences = re.findall(r"^```(\S*)$", path.read_text(), re.M)
        assert all(not word or word in known or word.startswith("{") for word in fences), path
        assert all(word for word in fences[::2]), f"{path.name}: a block without a language"


def test_links_lead_somewhere():
    for path in PAGES:
        for target in re.findall(r"\]\((?!https?:|#)([^)#\s]+)", path.read_text()):
            assert (path.parent / target).exists() or target.startswith(("gallery/", "api/", "effects/")), (
                f"{path.name} links to {target}"
            )


@pytest.mark.parametrize(
    ("said", "printed", "agree"),
    [
        ("a 1.000 b", "a 1.001 b", True),
        ("a 1.00 b", "a 1.05 b", False),
        ("a 1 b", "c 1 b", False),
        ("a 1 b", "a 1 b c", False),
        ("a ... c", "a b", False),
        ("found ... of 3", "found five or six of 3", True),
    ],
)
def test_what_counts_as_the_same(said, printed, agree):
    assert same(said, printed) == agree
