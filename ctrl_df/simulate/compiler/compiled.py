"""Compiled functions and where their machine code is kept: `njit` and `cfunc` for this package.

numba keeps machine code beside the source or, failing that, under the home directory, refuses to decorate
where neither can be written, reads only where it can write, and takes code for fresh while the file of the
function itself is unchanged. Here the code is

- read from every place that may hold it: ``NUMBA_CACHE_DIR``, the ``__pycache__`` beside the source (also
  where that cannot be written: an image built by root and run by another), the user's cache folder;
- written to the first of these that takes it; where none does, everything runs as well, recompiled in
  memory by every process, and one warning names the remedy;
- fresh as long as nothing has changed that it was compiled from: the file and all it imports, so that a
  function edited in one file is never called in its old form from another.
"""

from __future__ import annotations

import functools
import hashlib
import inspect
import re
import warnings
from pathlib import Path
from typing import Any

import numba
from numba import types
from numba.core import ccallback, config, event, sigutils
from numba.core.caching import CompileResultCacheImpl, FunctionCache, IndexDataCacheFile
from numba.misc.appdirs import AppDirs

from .garbage import FewerCollections
from .notice import Notice
from .parts import LeanCompiler, PartCompiler

_PACKAGE = Path(__file__).resolve().parents[2]
_IMPORT = re.compile(r"^from[ ]+(\.+)([\w.]*)[ ]+import[ ]+(\([^)]*\)|[^\n(]*)", re.MULTILINE)
_COMPILED = re.compile(r"^@(njit|part|apart|intrinsic|numba\.njit)\b|^\w+ = \w+\.opener\(", re.MULTILINE)


def njit(cache=True, **options) -> Any:
    """Decorate as ``numba.njit(**options)``, with the machine code kept where `KeptCode` finds a place."""

    def decorate(function):
        dispatcher: Any = numba.njit(pipeline_class=LeanCompiler, **options)(function)
        if cache and hasattr(dispatcher, "_cache"):  # a plain function under NUMBA_DISABLE_JIT
            _keep(dispatcher, function)
        return dispatcher

    return decorate


def apart(function) -> Any:
    """Decorate a function that is called by its address alone (`native`), on views."""
    return njit(error_model="numpy", _nrt=False, no_cpython_wrapper=True, no_cfunc_wrapper=True)(function)


def part(function=None, *, inline=False) -> Any:
    """Decorate a function that only compiled functions call; its machine code is a part of theirs.

    Parts take views (`views`) or arrays, count no references, and cannot be called from
    Python. `inline` copies the code to every place that calls it.
    """
    if function is None:
        return functools.partial(part, inline=inline)
    # `forceinline` is told either way: numba hands it down to what an inlined function is the first to call
    options: dict[str, Any] = dict(
        error_model="numpy", _nrt=False, no_cpython_wrapper=True, no_cfunc_wrapper=True, forceinline=inline
    )
    return _once(numba.njit(pipeline_class=PartCompiler, **options)(function))


def _once(dispatcher: Any) -> Any:
    """Let a constant among the arguments be a number like any other: no form of the function for each."""
    template = getattr(dispatcher, "get_call_template", None)
    if template is not None:
        dispatcher.get_call_template = lambda args, kws: template(tuple(map(types.unliteral, args)), kws)
    return dispatcher


def cfunc(signature, law) -> Any:
    """Compile a law as ``numba.cfunc(signature, cache=True)`` does; one that has no file is not kept."""
    args, returns = sigutils.normalize_signature(signature)

    def uncompiled() -> Any:
        compiler: Any = LeanCompiler
        return ccallback.CFunc(law, (args, returns), {}, {}, pipeline_class=compiler)

    compiled = uncompiled()
    if _is_ours(law):
        _keep(compiled, law)
        compiled.compile()
        return compiled
    try:
        compiled._cache = CodeOfModule(law)
        compiled.compile()
    except (RuntimeError, OSError, ImportError, AttributeError):
        # Typed at the prompt, in a place that cannot be written, or kept by a process that knew the file by a
        # name this one does not (a script that another has imported).
        compiled = uncompiled()
        compiled.compile()
    return compiled


def _is_ours(function) -> bool:
    return _PACKAGE in Path(inspect.getfile(function)).resolve().parents


def _keep(compiled, function):
    try:
        compiled._cache = KeptCode(function)
    except OSError:  # the source is not there to tell fresh code from stale (a zip, bytecode alone)
        pass


class CodeOfModule(FunctionCache):
    """The machine code of a user's function, apart for every name that its module has.

    numba imports the module in which kept code was made: that of a file imported before would run the file
    a second time where it is a script.
    """

    def _index_key(self, sig, codegen):
        return (*super()._index_key(sig, codegen), self._py_func.__module__)


class KeptCode(FunctionCache):
    """The machine code of one function, in all the places that may hold it."""

    def __init__(self, function):
        self._name, self._py_func = repr(function), function
        source = Path(inspect.getfile(function)).resolve()
        self._impl: Any = _Files(function, source)
        stamp = source_stamp(source)
        self._places = [
            (folder, IndexDataCacheFile(str(folder), self._impl.filename_base, stamp))
            for folder in folders(source)
        ]
        self.enable()

    @property
    def cache_path(self) -> str:
        """The folder that is tried first."""
        return str(self._places[0][0])

    @property
    def known(self) -> bool:
        """Whether machine code is kept that is as new as the sources."""
        return any(files._load_index() for _, files in self._places)

    def flush(self):
        """Forget the code wherever it can be forgotten."""
        for _, files in self._places:
            try:
                files.flush()
            except OSError:
                continue

    def _load_overload(self, sig, target_context):
        if not self._enabled:
            return None
        key = self._index_key(sig, target_context.codegen())
        for _, files in self._places:
            try:
                data = files.load(key)
                if data is not None:
                    return self._impl.rebuild(target_context, data)
            except Exception:  # a damaged or unreadable file, in any of pickle's many ways: not there
                continue
        return None

    def _save_overload(self, sig, data):
        if not self._enabled or not self._impl.check_cachable(data):
            return
        key, reduced = self._index_key(sig, data.codegen), self._impl.reduce(data)
        for folder, files in self._places:
            try:
                folder.mkdir(parents=True, exist_ok=True)
                files.save(key, reduced)
                return
            except OSError:
                continue
            except Exception:  # an index that cannot be read: start it again
                try:
                    files.flush()
                    files.save(key, reduced)
                    return
                except OSError:
                    continue
        _say_once()


class _Files(CompileResultCacheImpl):
    """How machine code becomes a file, without numba's search for a place."""

    def __init__(self, function, source):
        self._locator = self
        self._py_file, self._lineno = str(source), function.__code__.co_firstlineno
        name = f"{source.stem}.{function.__qualname__}"
        self._filename_base = self.get_filename_base(name, "")

    def get_disambiguator(self):
        """Tell functions of one name in one file apart."""
        return str(self._lineno)


def folders(source: Path) -> list[Path]:
    """Return the folders that may hold the machine code of a file, the one to write to first."""
    apart = f"{source.parent.name}_{hashlib.sha1(str(source.parent).encode()).hexdigest()}"
    found = [source.parent / "__pycache__", Path(AppDirs("numba", False).user_cache_dir) / apart]
    chosen = getattr(config, "CACHE_DIR", "")  # NUMBA_CACHE_DIR
    if chosen:
        found.insert(0, Path(chosen) / apart)
    return found


@functools.cache
def source_stamp(source: Path) -> str:
    """Digest of a file and of all that its compiled functions may be made of."""
    digest, known, waiting = hashlib.sha256(), set(), [source]
    while waiting:
        known.add(waiting[-1])
        waiting += [path for path in _read(waiting.pop())[1] if path not in known]
    for path in sorted(known):
        digest.update(f"{path.name}:".encode() + _read(path)[0])
    return digest.hexdigest()


@functools.cache
def _read(source: Path) -> tuple[bytes, tuple[Path, ...]]:
    """Digest of a file, and the files of the package it takes compiled code or constants from."""
    text = source.read_text(encoding="utf-8")
    taken = []
    for dots, module, names in _IMPORT.findall(text):
        base = source.parents[len(dots) - 1].joinpath(*filter(None, module.split(".")))
        wanted = re.findall(r"(\w+)(?:[ ]+as[ ]+\w+)?[ ]*(?:,|\n|$)", re.sub(r"#.*|[()]", "", names))
        modules = [path for name in wanted if (path := base / f"{name}.py").is_file()]
        taken += modules
        file = base.with_suffix(".py")
        # from a file without compiled functions these can only use constants and types
        used = any(name.lstrip("_")[:1].isupper() for name in wanted)
        if module and file.is_file() and (used or _COMPILED.search(file.read_text(encoding="utf-8"))):
            taken.append(file)
    return hashlib.sha256(text.encode()).digest(), tuple(taken)


@functools.cache
def _say_once():
    warnings.warn(
        "ctrl_df finds no place to keep its machine code and recompiles it in every process (a minute or "
        "two). Set NUMBA_CACHE_DIR to a folder that can be written, or run `ctrl-df warm-up` as the user who "
        "installed it.",
        RuntimeWarning,
        stacklevel=2,
    )


def _ours(dispatcher) -> bool:
    return isinstance(getattr(dispatcher, "_cache", None), KeptCode)


event.register("numba:compile", Notice(_ours))
event.register("numba:compile", FewerCollections(_ours))
