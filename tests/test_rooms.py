"""Rooms keep their privacy and their size, and docs/architecture.md names the files there are."""

import ast
import functools
import re
from pathlib import Path

import ctrl_df
from ctrl_df.handlers import handler

ROOT = Path(ctrl_df.__file__).parent

OF_PYTHON_CONTROL = {"_isstatic"}  # which blocks answer as its own systems do

MOST_FILES = 15

ALIKE = {"blocks/effects", "demo", "plot", "plot/identification", "plot/parts"}
"""Folders whose files are of one kind: an effect, a picture; no page names them one by one."""


@functools.cache
def trees():
    """Return the files of the package, read."""
    return {path: ast.parse(path.read_text(encoding="utf-8")) for path in sorted(ROOT.rglob("*.py"))}


def room(path):
    """Name of the package that a file belongs to; those of `identify` are rooms of their own."""
    parts = path.relative_to(ROOT).parts
    return "/".join(parts[:2]) if parts[0] == "identify" and len(parts) > 2 else parts[0]


def private(name):
    return name.startswith("_") and not name.startswith("__")


def defined(tree):
    """Yield the private names that a file gives something."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            yield node.name
        elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
            yield node.attr
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield node.id


def read(tree):
    """Yield line and name of private attributes read of anything but `self` and `cls`."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Load) and private(node.attr):
            if not (isinstance(node.value, ast.Name) and node.value.id in ("self", "cls")):
                yield node.lineno, node.attr


def test_no_private_attribute_is_read_from_outside_its_package():
    owners: dict[str, set] = {}
    for path, tree in trees().items():
        for name in filter(private, defined(tree)):
            owners.setdefault(name, set()).add(room(path))
    found = [
        f"{path.relative_to(ROOT)}:{line}: {name}, of {', '.join(sorted(owners[name]))}"
        for path, tree in trees().items()
        for line, name in read(tree)
        if name in owners and room(path) not in owners[name] and name not in OF_PYTHON_CONTROL
    ]
    assert not found, found


def test_no_private_name_is_imported_from_another_package():
    found = [
        f"{path.relative_to(ROOT)}:{node.lineno}: {alias.name}"
        for path, tree in trees().items()
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and node.level != 1
        for alias in node.names
        if private(alias.name)
    ]
    assert not found, found


def test_editors_know_every_name_that_is_loaded_on_first_use():
    tree = ast.parse(Path(ctrl_df.__file__).read_text(encoding="utf-8"))
    (block,) = (n for n in tree.body if isinstance(n, ast.If) and ast.unparse(n.test) == "_TYPE_CHECKING")
    stated = {a.asname: n.module for n in block.body if isinstance(n, ast.ImportFrom) for a in n.names}
    assert stated == ctrl_df._LAZY


def calls(tree):
    """Yield the calls of a file: the function's last name, and the call."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            yield ast.unparse(node.func).rpartition(".")[2], node


def test_no_file_imports_by_a_string_what_the_import_rules_cannot_see():
    """But the package itself, for its public names, and a fingerprint, which reads no code but a caller's."""
    found = {
        path.relative_to(ROOT).as_posix()
        for path, tree in trees().items()
        for name, _ in calls(tree)
        if name in ("import_module", "_import_module", "__import__")
    }
    assert found == {"__init__.py", "df/saving/fingerprint.py"}


def test_what_results_ask_for_is_what_the_handlers_do():
    asked = {
        call.args[0].value
        for path, tree in trees().items()
        if any(isinstance(n, ast.ImportFrom) and n.module == "drawing" for n in ast.walk(tree))
        for name, call in calls(tree)
        if name in ("draw", "go_on")
    }
    tree = ast.parse((ROOT / "handlers.py").read_text(encoding="utf-8"))
    done = {n.value.value for n in ast.walk(tree) if isinstance(n, ast.MatchValue)}
    assert asked == done
    for name in done:
        assert callable(handler(name))


SHARED_BY_WINGS = {
    "blocks", "drawing", "limit_cycles.arclength", "limit_cycles.thresholds", "table", "thresholds",
}  # fmt: skip
"""What predicted and exact limit cycles import alike: values, the ways out, linear algebra, and rounding."""


def imported(folder):
    """Yield what the files of a folder import of the package from outside it, blocks as one."""
    home = folder.relative_to(ROOT).parts
    for path in folder.glob("*.py"):
        for node in ast.walk(trees()[path]):
            if isinstance(node, ast.ImportFrom) and node.level > 1:
                name = ".".join([*home[: len(home) + 1 - node.level], node.module])
                yield "blocks" if name.startswith("blocks.") else name


def test_prediction_and_exact_orbit_share_no_method():
    wings = ROOT / "limit_cycles"
    assert {*imported(wings / "predicted")} & {*imported(wings / "exact")} == SHARED_BY_WINGS


def test_no_folder_has_more_than_fifteen_unlike_files():
    folders: dict[str, int] = {}
    for path in ROOT.rglob("*.py"):
        folder = path.parent.relative_to(ROOT).as_posix()
        if not path.name.startswith("__") and folder not in ALIKE:
            folders[folder] = folders.get(folder, 0) + 1
    assert max(folders.values()) <= MOST_FILES, folders


def test_architecture_names_the_files_there_are():
    page = (ROOT.parent / "docs" / "architecture.md").read_text(encoding="utf-8")
    named = set(re.findall(r"[\w/]+\.py", page))
    files = {p.relative_to(ROOT.parent).as_posix() for p in ROOT.parent.glob("*/**/*.py")}
    gone = {n for n in named if not any(f == n or f.endswith(f"/{n}") for f in files)}
    assert not gone, gone
    inside = {p.relative_to(ROOT) for p in ROOT.rglob("*.py")}
    unnamed = {
        path.as_posix()
        for path in inside
        if path.name not in ("__init__.py", "thresholds.py")
        and path.parent.as_posix() not in ALIKE
        and path.name not in {n.rpartition("/")[2] for n in named}
        and not re.search(rf"\b{path.stem}\b", page)
    }
    assert not unnamed, unnamed
