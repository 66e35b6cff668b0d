"""A digest of a computation: equal if and only if everything that decides its numbers is.

Blocks, systems, functions and data are followed to plain numbers, names and bytecode. A function is its code,
its constants, defaults, closure and the globals it uses; an object its class and its state; what belongs to
an installed package is its name and the package's version. Names that the user gives for reading (of
systems, signals, functions), memory addresses and the order of dicts and sets do not count, so that the same
lines give the same digest in every process. What hides its state from Python is refused rather than guessed.
"""

from __future__ import annotations

import builtins
import ctypes
import dis
import enum
import functools
import hashlib
import importlib
import struct
import sys
import types
from collections.abc import Mapping
from importlib import metadata
from pathlib import Path
from typing import Any

import control as ct
import numpy as np

# Of a system: what it and its signals are called, and what follows from the rest.
_NAMES = {
    "name", "_numbered", "input_index", "output_index", "state_index", "syslist_index", "_repr_format",
    "display_format", "connection_type", "_current_params", "_core", "_keys", "_specs", "_parameters",
}  # fmt: skip
# Of a class: what Python and dataclasses add to what the user wrote.
_BOOKKEEPING = {
    "__dict__", "__weakref__", "__module__", "__doc__", "__qualname__", "__annotations__", "__annotate__",
    "__dataclass_fields__", "__dataclass_params__", "__match_args__", "__firstlineno__",
    "__static_attributes__", "__parameters__", "__orig_bases__", "_abc_impl", "__abstractmethods__",
    "__classcell__", "__classdict__", "__annotations_cache__", "__annotate_func__", "__slotnames__",
}  # fmt: skip
_CODE = (
    "co_code", "co_names", "co_varnames", "co_freevars", "co_cellvars", "co_flags", "co_argcount",
    "co_kwonlyargcount", "co_posonlyargcount", "co_exceptiontable",
)  # fmt: skip


def fingerprint(*parts) -> str:
    """Return the digest of objects, hexadecimal.

    Parameters
    ----------
    *parts
        Numbers, arrays, containers, functions, systems, objects. One with an attribute ``fingerprint`` (a
        text or an integer) is its class and that.

    Raises
    ------
    ValueError
        Something cannot be identified: a function of a C library, an open file, a lock ...
    """
    try:
        return _Walk().digest(parts).hex()
    except RecursionError:
        raise _refused("data nested too deeply", []) from None


def _refused(what, trail):
    where = f" ({' of '.join(reversed(trail))})" if trail else ""
    return ValueError(
        f"save= needs a block of which it can be told whether it is the same next time; got {what}{where}. "
        "Give the block an attribute `fingerprint`, a text that you change when the block changes, or leave "
        "save out."
    )


class _Walk:
    """One descent through objects; remembers functions and classes it has been through."""

    def __init__(self):
        self.known: dict[int, tuple[Any, bytes]] = {}
        self.open: dict[int, int] = {}  # objects being walked: where in the descent
        self.back = sys.maxsize  # the outermost of them that something inside has led back to
        self.trail: list[str] = []

    def digest(self, obj, name="") -> bytes:
        """Return the digest of one object; `name` says in an error where it was."""
        if id(obj) in self.known:
            return self.known[id(obj)][1]
        if id(obj) in self.open:  # a circle: a function that calls itself, a method's class
            self.back = min(self.back, self.open[id(obj)])
            return _hash("circle", str(len(self.open) - self.open[id(obj)]).encode())
        depth, outer = len(self.open), self.back
        self.open[id(obj)], self.back = depth, sys.maxsize
        if name:
            self.trail.append(name)
        result = self._of(obj)
        if name:
            self.trail.pop()
        del self.open[id(obj)]
        if self.back >= depth and isinstance(obj, type | types.FunctionType):
            self.known[id(obj)] = obj, result  # independent of how it was reached
        self.back = min(outer, self.back if self.back < depth else sys.maxsize)
        return result

    # --- by kind --------------------------------------------------------------------------------------------

    def _of(self, obj) -> bytes:
        plain = _plain(obj)
        if plain is not None:
            return plain
        if isinstance(obj, type):
            return self._class(obj)
        own = getattr(obj, "fingerprint", None)
        if isinstance(own, str | int):
            return _hash("own", type(obj).__qualname__.encode(), self.digest(own))
        if isinstance(obj, np.ndarray | np.generic):
            return self._array(np.asarray(obj), np.ma.getmaskarray(obj) if np.ma.isMA(obj) else None)
        if isinstance(obj, types.FunctionType):
            return self._function(obj)
        if isinstance(obj, types.CodeType):
            return self._code(obj)
        if isinstance(obj, types.ModuleType):
            return _hash("module", obj.__name__.encode(), (_package(obj.__name__) or "").encode())
        if type(obj) in (tuple, list):
            return _hash(type(obj).__name__, *[self.digest(item) for item in obj])
        if type(obj) in (set, frozenset):
            return _hash("set", *sorted(self.digest(item) for item in obj))
        if type(obj) in (dict, types.MappingProxyType):
            return self._mapping("mapping", obj)
        if isinstance(obj, types.BuiltinFunctionType | types.MethodWrapperType):
            return self._builtin(obj)
        if isinstance(obj, np.ufunc | types.WrapperDescriptorType | types.MethodDescriptorType):
            return self._named(obj)
        if isinstance(obj, types.MemberDescriptorType | types.GetSetDescriptorType):
            return _hash("slot", obj.__name__.encode())
        if isinstance(obj, ct.InputOutputSystem):
            state = {k: v for k, v in vars(obj).items() if k not in _NAMES}
            return _hash("system", self.digest(type(obj)), self._mapping("state", state))
        parts = _inside(obj)
        if parts is not None:
            return _hash(type(obj).__name__, *[self.digest(part, of) for of, part in parts])
        return self._state(obj)

    def _mapping(self, kind, items: Mapping) -> bytes:
        pairs = [self.digest(k) + self.digest(v, str(k)) for k, v in items.items()]
        return _hash(kind, *sorted(pairs))

    def _array(self, array, mask) -> bytes:
        masked = b"" if mask is None else mask.tobytes()
        if array.dtype.hasobject:
            items = [self.digest(item) for item in array.ravel().tolist()]
            return _hash("objects", str(array.shape).encode(), masked, *items)
        text = f"{array.dtype.descr if array.dtype.names else array.dtype.str}|{array.shape}"
        return _hash("array", text.encode(), masked, array.tobytes())

    def _function(self, f) -> bytes:
        self.trail.append(f"function {f.__name__}")
        package = _package(f.__module__)
        parts = [self.digest([_cell_contents(cell) for cell in f.__closure__ or ()], "its closure")]
        if package is not None and "<" not in f.__qualname__:
            parts += [package.encode(), _source(f.__module__), f"{f.__module__}.{f.__qualname__}".encode()]
        else:
            parts += [
                self._code(f.__code__),
                self.digest(f.__defaults__, "a default"),
                self.digest(f.__kwdefaults__, "a default"),
                self._mapping("attributes", vars(f)),
            ]
            parts += [package.encode()] if package is not None else [self._globals(f)]
        self.trail.pop()
        return _hash("function", *parts)

    def _globals(self, f) -> bytes:
        """Digest the globals that a function and those inside it use; of modules what they use of them."""
        codes = _codes(f.__code__)
        attributes = {name for code in codes for name in code.co_names}
        steps = [(step.opname, step.argval) for code in codes for step in dis.get_instructions(code)]
        used = {name for what, name in steps if what in ("LOAD_GLOBAL", "LOAD_NAME")}
        imported = {name for what, name in steps if what == "IMPORT_NAME"}
        here, builtin = f.__globals__, vars(builtins)
        parts = [
            name.encode() + self._global(_module(name, here), name, attributes) for name in sorted(imported)
        ]
        for name in sorted(used):
            if name in here:
                parts.append(name.encode() + self._global(here[name], name, attributes))
            else:
                parts.append(name.encode() + (b"builtin" if name in builtin else b"missing"))
        return _hash("globals", *parts)

    def _global(self, value, name, attributes) -> bytes:
        if not isinstance(value, types.ModuleType) or _package(value.__name__) is not None:
            return self.digest(value, f"global {name}")
        if id(value) in self.open:
            return b"circle"
        self.open[id(value)] = len(self.open)
        parts = [
            n.encode() + self._global(vars(value)[n], f"{name}.{n}", attributes)
            for n in sorted(attributes)
            if n in vars(value)
        ]
        del self.open[id(value)]
        return _hash("module", *parts)

    def _code(self, code) -> bytes:
        fields = [repr(getattr(code, name, "")).encode() for name in _CODE]
        return _hash("code", sys.version_info[:2].__repr__().encode(), *fields, self.digest(code.co_consts))

    def _class(self, cls) -> bytes:
        package = _package(cls.__module__)
        if package is not None:
            name = f"{cls.__module__}.{cls.__qualname__}".encode()
            return _hash("class", name, package.encode(), _source(cls.__module__))
        members = {k: v for k, v in vars(cls).items() if k not in _BOOKKEEPING and not k.startswith("_abc_")}
        bases = [self.digest(base) for base in cls.__bases__]
        return _hash("class", *bases, self._mapping(f"class {cls.__name__}", members))

    def _builtin(self, obj) -> bytes:
        owner = obj.__self__
        if owner is None or isinstance(owner, types.ModuleType):
            return self._named(obj)
        return _hash("method", obj.__name__.encode(), self.digest(owner))

    def _named(self, obj) -> bytes:
        """Digest of what is compiled and has a name in an installed package; anything else is refused."""
        module = getattr(obj, "__module__", None) or getattr(
            getattr(obj, "__objclass__", None), "__module__", None
        )
        home = module or ("numpy" if isinstance(obj, np.ufunc) and hasattr(np, obj.__name__) else "")
        home = home or _home_of_ufunc(obj)
        package = _package(home) if home else None
        if package is None:
            raise _refused(repr(obj), self.trail)
        name = getattr(obj, "__qualname__", obj.__name__)
        return _hash("compiled", package.encode(), f"{home}.{name}".encode())

    def _state(self, obj) -> bytes:
        """Digest of an object as pickle would take it apart, its parts followed as everything else."""
        if isinstance(obj, ctypes.CDLL):  # its state is an address
            raise _refused(f"the library {obj._name}", self.trail)
        try:
            reduced = obj.__reduce_ex__(4)
        except Exception as error:  # any way in which a class says that its state is nobody's business
            raise _refused(f"{type(obj).__name__} object: {error}", self.trail) from None
        if isinstance(reduced, str):
            if _package(type(obj).__module__) is None and _package(getattr(obj, "__module__", "")) is None:
                raise _refused(repr(obj), self.trail)
            return _hash("global", reduced.encode(), self.digest(type(obj)))
        make, arguments, state, *items = (*reduced, None, None, None)[:5]
        self.trail.append(f"{type(obj).__name__} object")
        parts = [self.digest(make), self.digest(arguments), self.digest(state, "its state")]
        parts += [self.digest(None if each is None else list(each)) for each in items]
        self.trail.pop()
        return _hash("object", *parts)


def _plain(obj) -> bytes | None:
    """Digest of an immutable value without parts, else None."""
    if obj is None or obj is Ellipsis or obj is NotImplemented:
        return _hash(repr(obj))
    if isinstance(obj, enum.Enum):
        return _hash("enum", f"{type(obj).__qualname__}.{obj.name}".encode())
    if type(obj) in (bool, int, str):
        return _hash(type(obj).__name__, repr(obj).encode())
    if type(obj) is float:
        return _hash("float", struct.pack("<d", obj))
    if type(obj) is complex:
        return _hash("complex", struct.pack("<dd", obj.real, obj.imag))
    if type(obj) in (bytes, bytearray):
        return _hash("bytes", bytes(obj))
    if isinstance(obj, range | slice | np.dtype):
        return _hash(type(obj).__name__, repr(obj).encode())
    return None


def _inside(obj) -> list[tuple[str, Any]] | None:
    """Return what a wrapper of functions holds, each with a word for it; None if it is no such wrapper."""
    if isinstance(obj, functools.partial):
        return [("the partial", obj.func), ("an argument", obj.args), ("an argument", obj.keywords)]
    if isinstance(obj, functools.partialmethod):
        return [("the partial", obj.func), ("an argument", obj.args), ("an argument", obj.keywords)]
    if isinstance(obj, types.MethodType):
        return [("the method", obj.__func__), ("its object", obj.__self__)]
    if isinstance(obj, staticmethod | classmethod):
        return [("the method", obj.__func__)]
    if isinstance(obj, property):
        return [("the property", [obj.fget, obj.fset])]
    if isinstance(obj, functools.cached_property):
        return [("the property", obj.func)]
    if isinstance(obj, functools._lru_cache_wrapper):
        return [("the cached function", obj.__wrapped__)]  # pyright: ignore[reportAttributeAccessIssue]
    if isinstance(obj, np.vectorize):
        return [("the vectorized function", obj.pyfunc), ("", [obj.otypes, obj.excluded, obj.signature])]
    python = getattr(obj, "py_func", getattr(obj, "__wrapped__", None))
    if isinstance(python, types.FunctionType) and type(obj).__module__.startswith("numba."):
        return [("the compiled function", python), ("", getattr(obj, "targetoptions", None))]
    return None


def _hash(kind: str, *parts: bytes) -> bytes:
    """Digest of a kind and its parts, each with its length, so that no two lists run together."""
    digest = hashlib.sha256(kind.encode())
    for part in parts:
        digest.update(len(part).to_bytes(8, "little"))
        digest.update(part)
    return digest.digest()


def _cell_contents(cell):
    """Return what a closure cell holds; an empty one (a name not assigned yet) holds NotImplemented."""
    try:
        return cell.cell_contents
    except ValueError:
        return NotImplemented


def _codes(code) -> list[types.CodeType]:
    """Return a function's code and that of all functions inside it."""
    found = [code]
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            found += _codes(constant)
    return found


def _module(name, here):
    """Return a module that a function imports when it runs."""
    for full in (name, f"{here.get('__package__')}.{name}"):
        try:
            return importlib.import_module(full)
        except ImportError:
            continue
    return None


@functools.cache
def _package(module: str | None) -> str | None:
    """Return package and version of an installed module (or Python's own); None of one of the user's."""
    top = (module or "").partition(".")[0]
    if not top or top == "__main__":
        return None
    if top == "ctrl_df":  # what it computes is held by FORMAT
        return top
    if top in sys.stdlib_module_names:
        return f"python {sys.version_info[0]}.{sys.version_info[1]}"
    file = getattr(sys.modules.get(top), "__file__", None)
    if file is None or not {"site-packages", "dist-packages"} & set(Path(file).parts):
        return None
    version = getattr(sys.modules[top], "__version__", None)
    if version is None:
        try:
            version = metadata.version(top)
        except metadata.PackageNotFoundError:
            version = ""
    return f"{top} {version}"


@functools.cache
def _source(module: str) -> bytes:
    """Digest of an installed module's source: a package under development keeps its version."""
    file = getattr(sys.modules.get(module), "__file__", None) or ""
    if module.partition(".")[0] in sys.stdlib_module_names | {"ctrl_df"} or not file.endswith(".py"):
        return b""
    try:
        return hashlib.sha256(Path(file).read_bytes()).digest()
    except OSError:
        return b""


def _home_of_ufunc(obj) -> str:
    """Return the installed module in which a ufunc stands under its name, "" if there is none."""
    if not isinstance(obj, np.ufunc):
        return ""
    for name in ("numpy", "scipy.special"):
        if getattr(sys.modules.get(name), obj.__name__, None) is obj:
            return name
    return ""
