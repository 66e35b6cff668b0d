"""An effect of the library, copied into a file of a user's own under another name."""

from __future__ import annotations

import ast
import contextlib
import importlib.util
import inspect
from pathlib import Path

from ctrl_df.blocks import effect as registry

NAMED = "Own{}"


def source_of(cls) -> str:
    """Return a file with the class alone: its imports made absolute, its name another one."""
    tree = ast.parse(Path(inspect.getfile(cls)).read_text())
    kept = []
    for node in tree.body:
        if isinstance(node, ast.ImportFrom) and node.level:
            package = {1: "ctrl_df.blocks.effects", 2: "ctrl_df.blocks", 3: "ctrl_df"}[node.level]
            node.module, node.level = f"{package}.{node.module}", 0
        if isinstance(node, ast.ClassDef):
            if node.name != cls.__name__:
                continue
            node.name = NAMED.format(node.name)
        kept.append(node)
    tree.body = kept
    return ast.unparse(tree)


@contextlib.contextmanager
def copied(cls, folder):
    """Register the copy of an effect class, written to a folder, for as long as the context lasts."""
    path = Path(folder) / f"own_{cls.id}.py"
    path.write_text(source_of(cls))
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    before = dict(registry._LIBRARY)
    try:
        spec.loader.exec_module(module)
        yield getattr(module, NAMED.format(cls.__name__))
    finally:
        registry._LIBRARY.clear()
        registry._LIBRARY.update(before)
