"""Laws as machine addresses: how one compiled engine runs any effect.

A law is a plain Python function. `address` compiles it (cached beside its file where possible) and returns
the address of the machine code; the engine, compiled once, calls through that address. What numba cannot
compile is called back in Python, slower but with the same result. What it raises
may not cross machine code: it is kept, and raised again by `raise_kept` once the machine code has returned.
"""

from __future__ import annotations

import ctypes
import signal
import threading
import weakref
from collections.abc import Callable
from contextlib import contextmanager
from typing import Any

import numba
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from ...status import Status
from ..compiler.compiled import cfunc

_D, _P = types.float64, types.CPointer(types.float64)
SIGNATURES = {
    # t, x, v, z, p, dz -> force
    "force": _D(_D, _D, _D, _P, _P, _P),
    # moving, direction, speed, base, p -> level
    "friction": _D(_D, _D, _D, _D, _P),
    # the same, x, drive, load -> level
    "asking": _D(_D, _D, _D, _D, _P, _D, _D, _D),
    # v, level, z, p, dz -> force
    "presliding": _D(_D, _D, _P, _P, _P),
    # u, p -> y
    "smooth": _D(_D, _P),
}
_C_D, _C_P = ctypes.c_double, ctypes.POINTER(ctypes.c_double)
_CALLBACKS = {
    "force": ctypes.CFUNCTYPE(_C_D, _C_D, _C_D, _C_D, _C_P, _C_P, _C_P),
    "friction": ctypes.CFUNCTYPE(_C_D, _C_D, _C_D, _C_D, _C_D, _C_P),
    "asking": ctypes.CFUNCTYPE(_C_D, _C_D, _C_D, _C_D, _C_D, _C_P, _C_D, _C_D, _C_D),
    "presliding": ctypes.CFUNCTYPE(_C_D, _C_D, _C_D, _C_P, _C_P, _C_P),
    "smooth": ctypes.CFUNCTYPE(_C_D, _C_D, _C_P),
    # t, x, u, dx, y, what: 0 outputs, 1 rates
    "system": ctypes.CFUNCTYPE(None, _C_D, _C_P, _C_P, _C_P, _C_P, ctypes.c_long),
    # t, r
    "input": ctypes.CFUNCTYPE(None, _C_D, _C_P),
}

_compiled: weakref.WeakKeyDictionary[Callable, tuple[Any, object]] = weakref.WeakKeyDictionary()
_called_back: weakref.WeakValueDictionary[int, Any] = weakref.WeakValueDictionary()
"""What stands at the addresses of laws that numba cannot compile, for as long as these live."""
raised: list[BaseException] = []
"""Exceptions of laws called back in Python, newest last; the engine sees them as NaN."""
gave_nan: list[str] = []
"""Which law returned NaN last, and where, from numbers that were finite."""


def address(law: Callable, kind: str) -> int:
    """Return the machine address of a law of the given kind (a key of `SIGNATURES`)."""
    known = _compiled.get(law)
    if known is None:
        known = _compiled.setdefault(law, _compile(law, kind))
    return known[0]  # pyright: ignore[reportReturnType]


def calls_python(address: int) -> bool:
    """Whether a law's address leads back into Python, because numba could not compile the law."""
    return address in _called_back


def _compile(law, kind):
    try:
        compiled = cfunc(SIGNATURES[kind], law)
    except numba.core.errors.NumbaError:  # pyright: ignore[reportAttributeAccessIssue]
        place, kept = callback(law, kind)
        _called_back[place] = kept
        return place, kept
    return compiled.address, compiled


def callback(function: Callable, kind: str) -> tuple[int, object]:
    """Return (address, keep-alive object) of a Python function called back from the engine."""
    c = _CALLBACKS[kind](_Guarded(function, kind))
    return ctypes.cast(c, ctypes.c_void_p).value or 0, c


class _Guarded:
    """A function as machine code calls it: what it raises is kept, and NaN is handed back."""

    made = False  # whether there is any; without one Ctrl-C needs no care

    def __init__(self, function: Callable, kind: str):
        self.function, self.kind, self.overflown = function, kind, False
        _Guarded.made = True

    def __call__(self, *args):
        try:
            if not interrupted():
                value = self.function(*args)
                self.overflown = False
                return value
        except OverflowError as error:
            # a state that runs away leaves the range of floats: divergence, no mistake of the law
            self.overflown = True
            if self.kind == "input":
                raised.append(error)
        except BaseException as error:  # noqa: BLE001 - no exception may cross machine code
            if not (self.overflown and isinstance(error, ValueError | ArithmeticError)):
                raised.append(error)
        if self.kind == "input":
            args[1][0] = float("nan")
        elif self.kind == "system":
            args[3][0] = args[4][0] = float("nan")
        return float("nan")


def interrupted() -> bool:
    """Whether Ctrl-C came while machine code was calling back."""
    return bool(raised) and isinstance(raised[-1], KeyboardInterrupt)


def raise_kept() -> None:
    """Raise what a law called back has raised: Ctrl-C as it is, anything else as one RuntimeError."""
    if not raised:
        return
    error = next((e for e in raised if not isinstance(e, Exception)), raised[0])
    raised.clear()
    if not isinstance(error, Exception):
        raise error
    raise RuntimeError(f"{Status.USER_ERROR} ({error!r}).") from error


@contextmanager
def interruptible():
    """Keep a Ctrl-C that arrives on the very threshold of a function called back.

    Python acts on signals as it enters a function. Where machine code has just called it, nobody could catch
    the exception that is raised there: ctypes would print and drop it. Such a signal is kept as if the
    function itself had raised it; any other is raised where it meets Python.
    """
    mine = (
        _Guarded.made
        and threading.current_thread() is threading.main_thread()
        and signal.getsignal(signal.SIGINT) is signal.default_int_handler
    )
    if mine:
        signal.signal(signal.SIGINT, _keep_or_raise)
    try:
        yield
    finally:
        if mine:
            signal.signal(signal.SIGINT, signal.default_int_handler)


def _keep_or_raise(number, frame):
    if frame is not None and frame.f_code is _Guarded.__call__.__code__:
        raised.append(KeyboardInterrupt())
    else:
        signal.default_int_handler(number, frame)


def _call(builder, returns, address_value, values, is_pointer):
    double = ir.DoubleType()
    kinds = [double.as_pointer() if p else double for p in is_pointer]
    function = builder.inttoptr(address_value, ir.FunctionType(returns, kinds).as_pointer())
    args = [
        builder.inttoptr(v, double.as_pointer()) if p else v for v, p in zip(values, is_pointer, strict=True)
    ]
    return builder.call(function, args)


@intrinsic
def call_force(typingctx, address, t, x, v, z, p, dz):
    """Call a force law; z, p, dz are addresses."""
    sig = types.float64(types.int64, _D, _D, _D, types.int64, types.int64, types.int64)

    def codegen(context, builder, signature, args):
        return _call(builder, ir.DoubleType(), args[0], args[1:], (0, 0, 0, 1, 1, 1))

    return sig, codegen


@intrinsic
def call_friction(typingctx, address, moving, direction, speed, base, p):
    """Call a friction law; p is an address."""
    sig = types.float64(types.int64, _D, _D, _D, _D, types.int64)

    def codegen(context, builder, signature, args):
        return _call(builder, ir.DoubleType(), args[0], args[1:], (0, 0, 0, 0, 1))

    return sig, codegen


@intrinsic
def call_asking(typingctx, address, moving, direction, speed, base, p, x, drive, load):
    """Call a friction law that asks for place and load; p is an address."""
    sig = types.float64(types.int64, _D, _D, _D, _D, types.int64, _D, _D, _D)

    def codegen(context, builder, signature, args):
        return _call(builder, ir.DoubleType(), args[0], args[1:], (0, 0, 0, 0, 1, 0, 0, 0))

    return sig, codegen


@intrinsic
def call_presliding(typingctx, address, v, level, z, p, dz):
    """Call a presliding law; z, p, dz are addresses."""
    sig = types.float64(types.int64, _D, _D, types.int64, types.int64, types.int64)

    def codegen(context, builder, signature, args):
        return _call(builder, ir.DoubleType(), args[0], args[1:], (0, 0, 1, 1, 1))

    return sig, codegen


@intrinsic
def call_smooth(typingctx, address, u, p):
    """Call a static law; p is an address."""
    sig = types.float64(types.int64, _D, types.int64)

    def codegen(context, builder, signature, args):
        return _call(builder, ir.DoubleType(), args[0], args[1:], (0, 1))

    return sig, codegen


@intrinsic
def call_system(typingctx, address, t, x, u, dx, y, what):
    """Call a user-written system; x, u, dx, y are addresses."""
    sig = types.void(types.int64, _D, types.int64, types.int64, types.int64, types.int64, types.int64)

    def codegen(context, builder, signature, args):
        double, long = ir.DoubleType(), ir.IntType(64)
        pointer = double.as_pointer()
        kind = ir.FunctionType(ir.VoidType(), [double, pointer, pointer, pointer, pointer, long])
        function = builder.inttoptr(args[0], kind.as_pointer())
        pointers = [builder.inttoptr(a, pointer) for a in args[2:6]]
        builder.call(function, [args[1], *pointers, args[6]])
        return context.get_dummy_value()

    return sig, codegen


@intrinsic
def call_input(typingctx, address, t, r):
    """Call an input function; r is an address."""
    sig = types.void(types.int64, _D, types.int64)

    def codegen(context, builder, signature, args):
        pointer = ir.DoubleType().as_pointer()
        kind = ir.FunctionType(ir.VoidType(), [ir.DoubleType(), pointer])
        function = builder.inttoptr(args[0], kind.as_pointer())
        builder.call(function, [args[1], builder.inttoptr(args[2], pointer)])
        return context.get_dummy_value()

    return sig, codegen
