"""An effect of the library, copied into a file of a user's own: class and parameters under other names."""

from __future__ import annotations

import ast
import contextlib
import importlib.util
import inspect
from pathlib import Path

from ctrl_df.blocks import effect as registry

NAMED, FIELD = "Own{}", "own_{}"


class Renamed(ast.NodeTransformer):
    """Fields of a class under other names, where they are declared and wherever its functions use them."""

    def __init__(self, body):
        self.fields = {n.target.id for n in body if isinstance(n, ast.AnnAssign) and not _of_class(n)}
        self.inside = False

    def name(self, name):
        return FIELD.format(name) if name in self.fields else name

    def visit_AnnAssign(self, node):
        if not self.inside:  # what a parameter states is left as it is
            node.target.id = self.name(node.target.id)
            return node
        return self.generic_visit(node)

    def visit_FunctionDef(self, node):
        self.inside = True
        self.generic_visit(node)
        self.inside = False
        return node

    def visit_Attribute(self, node):
        if isinstance(node.value, ast.Name) and node.value.id == "self":
            node.attr = self.name(node.attr)
        return self.generic_visit(node)

    def visit_Constant(self, node):
        if self.inside and isinstance(node.value, str):
            node.value = self.name(node.value)
        return node

    def visit_Call(self, node):
        if "cls" in ast.unparse(node.func) or "self" in ast.unparse(node.func):
            for keyword in node.keywords:
                keyword.arg = keyword.arg and self.name(keyword.arg)
        return self.generic_visit(node)


def _of_class(node) -> bool:
    return ast.unparse(node.annotation).startswith("ClassVar")


def source_of(cls) -> str:
    """Return a file with the class alone: its imports made absolute, its name and its fields others."""
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
            Renamed(node.body).generic_visit(node)
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
