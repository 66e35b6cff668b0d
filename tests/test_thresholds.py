"""Tuned numbers of a package stand in one file, each with its reason; those that follow from others do."""

import ast
import collections
import functools
import math
import re
from pathlib import Path

import pytest

import ctrl_df
from ctrl_df.identify import thresholds
from ctrl_df.identify.estimation import thresholds as estimation
from ctrl_df.identify.residuals import thresholds as residuals
from ctrl_df.identify.selection import thresholds as selection

PACKAGE = Path(ctrl_df.__file__).parent

EFFECTS = {f"effects/{path.name}" for path in (PACKAGE / "blocks" / "effects").glob("*.py")}

MATHEMATICS = {
    "blocks": {
        *EFFECTS,  # numbers of one effect stand in its class
        "coordinates.py: 256",  # a size of memory
        "mechanism.py: 64",  # the same
        "probing.py: 4096",  # the same
    },
    "simulate": {
        "program/layout.py",  # what stands where in arrays
        "program/pack.py: 256",  # a size of memory
        "compiler/packed.py",  # the same, for LLVM
        "kernel/run/kept.py",  # the same, of what a run keeps
        "kernel/space.py: 32",  # a size of memory
    },
    "df": {
        "closed_form/kronrod.py",  # nodes and weights
        "closed_form/friction.py: 24.0",  # of a quadratic equation
    },
    "limit_cycles": set(),
    "gains": set(),
    "identify": {
        "prediction/prepared.py: 16",  # a size of memory
        "starting/ripple_spectrum.py: 64",  # the same
    },
}
"""Files, and numbers in them, that are no choice, of the packages that have their tuned ones in one place."""

ELSEWHERE = {
    "_AT_ONCE",
    "_READY",  # sizes of memories
    "_KEPT",
    "OUTPUT_COLUMNS",  # where an engine puts out what
    "_SPEEDS",  # where laws are probed
}

PER_CENT = 100.0

ROOMS = (
    "",
    "data",
    "datasets",
    "estimation",
    "fits",
    "ladder",
    "planning",
    "prediction",
    "residuals",
    "results",
    "selection",
    "shooting",
    "smoothing",
    "starting",
    "tables",
)


@functools.cache
def parsed(path):
    return ast.parse(path.read_text())


def numbers_of(path):
    """Yield names of a file's module-level constants that hold numbers."""
    for node in parsed(path).body:
        if not isinstance(node, ast.Assign | ast.AnnAssign) or node.value is None:
            continue
        if any(isinstance(n, ast.Constant) and type(n.value) in (int, float) for n in ast.walk(node.value)):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            yield from (n.id for t in targets for n in ast.walk(t) if isinstance(n, ast.Name))


def test_they_stand_in_one_place():
    root = PACKAGE / "identify"
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
    bump = math.exp(-((selection.PASSED / 1e-3) ** 2))
    assert 0.9 * selection.BUMP_LEFT < bump < selection.BUMP_LEFT
    assert residuals.ROUNDING_COARSE > 1 / math.sqrt(12)
    assert max(estimation.SEGMENT_SCALES) == estimation.SHORTEST < estimation.SHORT


def test_rooms_share_what_stands_above_them():
    root, users = PACKAGE / "identify", {}
    for path in sorted(root.rglob("*.py")):
        for node in ast.walk(parsed(path)):
            if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load):
                users.setdefault(node.id, set()).add(path.parent)
    of_one = [
        names
        for names in assigned(root / "thresholds.py")
        for rooms in [set().union(*(users[n] for n in names))]
        if len(rooms) == 1 and root not in rooms
    ]
    assert not of_one, of_one


def test_each_name_has_one_meaning():
    places = collections.defaultdict(set)
    for path in sorted(PACKAGE.rglob("thresholds.py")):
        for name, _ in reasons(path):
            places[name].add(str(path.relative_to(PACKAGE)))
    twice = {name: found for name, found in places.items() if len(found) > 1}
    assert not twice, twice


def test_what_stands_above_all_packages_is_shared_by_some():
    used = {
        top: {w for p in (PACKAGE / top).rglob("*.py") for w in re.findall(r"\w+", p.read_text())}
        for top in MATHEMATICS
    }
    for name, told in reasons(PACKAGE / "thresholds.py"):
        users = [top for top, words in used.items() if name in words]
        assert told and len(users) > 1, (name, users)


def assigned(path):
    """Yield the names of a file's constants, assignment by assignment."""
    for node in parsed(path).body:
        if isinstance(node, ast.Assign):
            yield [n.id for n in ast.walk(node.targets[0]) if isinstance(n, ast.Name)]


def reasons(path):
    """Yield the names of a file's constants, and whether a docstring follows."""
    body = parsed(path).body
    for node, after in zip(body, [*body[1:], None], strict=True):
        if isinstance(node, ast.Assign):
            told = isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant)
            yield from ((n.id, told) for n in ast.walk(node.targets[0]) if isinstance(n, ast.Name))


def literals(path):
    """Yield lines and numbers of a file that look chosen: no small multiple of an eighth, no bound of a loop.

    A number that a formula divides by, divides or raises to a power belongs to the formula. Defaults have
    a test of their own (`defaults`); places in arrays, shapes and texts choose nothing.
    """
    tree = parsed(path)
    passed_over, limits = subscripts(tree), set()
    for node in ast.walk(tree):
        if isinstance(node, ast.arguments):
            passed_over |= {id(n) for d in [*node.defaults, *node.kw_defaults] if d for n in ast.walk(d)}
        elif isinstance(node, ast.JoinedStr):
            passed_over |= {id(n) for n in ast.walk(node)}
        elif isinstance(node, ast.BinOp) and isinstance(node.op, ast.Div):
            passed_over |= {id(n) for n in (node.left, node.right) if whole(n)}
        elif isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow):
            passed_over |= {id(node.left)} if whole(node.left) else set()
        elif isinstance(node, ast.Compare):
            limits |= {id(n) for n in [node.left, *node.comparators]}
        elif isinstance(node, ast.Call) and getattr(node.func, "id", "") in ("range", "min", "max"):
            limits |= {id(n) for n in node.args}
        elif isinstance(node, ast.keyword):
            limits.add(id(node.value))
    for node in tree.body:
        if isinstance(node, ast.Assign) and not any(isinstance(n, ast.Call) for n in ast.walk(node.value)):
            limits |= {id(n) for n in ast.walk(node.value)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and id(node) not in passed_over:
            chosen = isinstance(node.value, float) and not (node.value < 10 and node.value % 0.125 == 0)
            if chosen or (type(node.value) is int and node.value >= 10 and id(node) in limits):
                yield node.lineno, node.value


def subscripts(tree):
    """Return which whole numbers of a file say where something stands in an array.

    Those of subscripts, but for one that is an end of a slice, which may be how many are taken.
    """
    inside, ends = set(), set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Subscript):
            inside |= {id(n) for n in ast.walk(node.slice) if number(n) and isinstance(n.value, int)}
            parts = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
            ends |= {id(part.upper) for part in parts if isinstance(part, ast.Slice)}
    return inside - ends


def number(node):
    """Whether a node is a number."""
    return isinstance(node, ast.Constant) and type(node.value) in (int, float)


def whole(node):
    """Whether a node of a formula is a whole number."""
    return isinstance(node, ast.Constant) and isinstance(node.value, float) and node.value % 1 == 0


@pytest.mark.parametrize("package", MATHEMATICS)
def test_every_tuned_number_of_a_package_has_its_place_and_its_reason(package):
    root = PACKAGE / package
    files = {str(p.relative_to(root)): p for p in sorted(root.rglob("*.py"))}
    places = {name: p for name, p in files.items() if p.name == "thresholds.py"}
    found = [
        f"{package}/{name}:{line}: {value}"
        for name in files.keys() - MATHEMATICS[package] - places.keys()
        for line, value in literals(files[name])
        if f"{name}: {value}" not in MATHEMATICS[package] and value != PER_CENT
    ]
    assert not found, sorted(found)
    named = {name: told for path in places.values() for name, told in reasons(path)}
    assert all(named.values()), [name for name, told in named.items() if not told]
    for path in places.values():
        twice = collections.Counter(name for name, _ in reasons(path))
        assert max(twice.values(), default=1) == 1, f"{path}: {twice.most_common(1)}"
    words = collections.Counter(w for p in files.values() for w in re.findall(r"\w+", p.read_text()))
    assert not [name for name in named if words[name] < 2], "nobody asks for it"


DEFAULTS = {
    "linearize: eps",  # python-control's own signature
    "free_run: slack",  # the middle of a gap
}
"""Arguments of functions that are not public, and fields of classes, whose default is a number that is no
choice."""


@pytest.mark.parametrize("package", MATHEMATICS)
def test_defaults_of_functions_that_are_not_public_have_names(package):
    root = PACKAGE / package
    found = [
        f"{name}:{line}: {of} = {value}"
        for name, path in ((str(p.relative_to(root)), p) for p in sorted(root.rglob("*.py")))
        if name not in MATHEMATICS[package] and path.name != "thresholds.py"
        for of, line, value in defaults(parsed(path))
        if of not in DEFAULTS
    ]
    assert not found, found


def defaults(tree):
    """Yield what has a number as its default that looks chosen, its line, and the number.

    Signatures of public functions show numbers to their users. Whole numbers below ten, zero and one choose
    nothing.
    """
    for node in ast.walk(tree):
        given = []
        if isinstance(node, ast.FunctionDef | ast.Lambda):
            of, a = getattr(node, "name", "lambda"), node.args
            places = [*a.posonlyargs, *a.args][-len(a.defaults) :] if a.defaults else []
            given = [*zip(places, a.defaults, strict=True), *zip(a.kwonlyargs, a.kw_defaults, strict=True)]
            given = [] if of in ctrl_df.__all__ else [(x.arg, default) for x, default in given if default]
        elif isinstance(node, ast.ClassDef):
            of, fields = node.name, [n for n in node.body if isinstance(n, ast.Assign | ast.AnnAssign)]
            given = [(ast.unparse(n.target if isinstance(n, ast.AnnAssign) else n.targets[0]), n.value)
                     for n in fields if n.value]  # fmt: skip
        for name, default in given:
            for n in ast.walk(default):
                if number(n) and (
                    n.value >= 10 or (isinstance(n.value, float) and n.value not in (0.0, 1.0))
                ):
                    yield f"{of}: {name}", n.lineno, n.value


LEFT = {"identify": 74, "df": 56, "limit_cycles": 9, "gains": 11, "simulate": 134, "blocks": 7}
"""Numbers from three on that stand in formulas (coefficients, orders, places in arrays) or as a default in a
signature, and halves and quarters in comparisons. One that could as well be twice as large is a choice and
has to be named."""

STARTS = 195
"""The same of the effects, in whose classes they stand: most are sizes that fits begin with."""

MEMORY = {"zeros", "ones", "empty", "full", "reshape", "eye"}
"""Functions whose arguments are sizes of arrays."""


@pytest.mark.parametrize("package", LEFT)
def test_no_more_bare_numbers(package):
    root = PACKAGE / package
    names = {str(p.relative_to(root)): p for p in sorted(root.rglob("*.py")) if p.name != "thresholds.py"}
    files = [p for name, p in names.items() if name not in MATHEMATICS[package]]
    assert sum(sum(1 for _ in bare(parsed(p))) for p in files) <= LEFT[package]


def test_no_more_bare_numbers_of_effects():
    files = [PACKAGE / "blocks" / name for name in EFFECTS]
    assert sum(sum(1 for _ in bare(parsed(p))) for p in files) <= STARTS


def bare(tree):
    """Yield numbers that are not small and plain, and that no rule tells to be no choice.

    Places in arrays, texts, sizes of arrays, powers and their bases, and quotients of two whole numbers.
    """
    inside, compared = subscripts(tree), set()
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            inside |= {id(n) for n in ast.walk(node)}
        elif isinstance(node, ast.Call) and getattr(node.func, "attr", "") in MEMORY:
            inside |= {id(n) for argument in node.args for n in ast.walk(argument)}
        elif isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow):
            inside |= {id(node.left), id(node.right)}
        elif isinstance(node, ast.BinOp) and isinstance(node.op, ast.Div):
            inside |= {id(n) for n in (node.left, node.right) if number(node.left) and number(node.right)}
        elif isinstance(node, ast.Compare):
            compared |= {id(n) for side in (node.left, *node.comparators) for n in ast.walk(side)}
    for node in ast.walk(tree):
        if not number(node) or id(node) in inside or node.value in (0, 1, 100):
            continue
        plain = node.value in (0.25, 0.5, 1.5, 2)
        if not plain or (isinstance(node.value, float) and id(node) in compared):
            yield node.value
