# pyright: reportCallIssue=false
# (numba's stubs know neither its private options nor the arguments of an intrinsic)
"""Many arrays handed to compiled code as one number: the address where their addresses and lengths lie.

A run works in dozens of arrays that stay where they are from call to call. Passed one by one, each is checked
and taken apart at every call from Python, by code that is made for every function. `Layout.pack` writes them
down once, word by word; what `Layout.opener` returns reads from there a field at a time, as it is asked for.
"""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.typing.templates import AttributeTemplate
from numba.extending import infer_getattr, intrinsic, lower_getattr_generic, models, register_model

from .views import View, lean_type

WIDE = 8  # fields of a tuple within another from which it stays where it is, and is not copied


class Packed(types.Type):
    """A named tuple where it lies in memory; its fields are those of the lean one."""

    def __init__(self, kind):
        self.kind = kind
        super().__init__(f"Packed({kind.instance_class.__name__})")

    @property
    def key(self):
        """What tells such types apart."""
        return self.kind


class Layout:
    """Named tuples of one kind, of arrays, whole numbers and tuples of them.

    All of one layout have arrays of the same element types and dimensions in the same places.
    """

    def __init__(self):
        self._type: Any = None

    def learn(self, value) -> None:
        """Take the types of a tuple, which what reads such tuples is compiled for."""
        if self._type is None:
            self._type = Packed(lean_type(numba.typeof(value)))

    def pack(self, value) -> np.ndarray:
        """Return the words, which keep `value` alive; compiled code is given the `address_of` them."""
        self.learn(value)
        words: list[int] = []
        _lay(value, words)
        return np.asarray(_Words(np.array(words, np.int64), value))

    def opener(self) -> Any:
        """Return the compiled function that turns the address of words into the tuple."""

        @intrinsic
        def opened(typingctx, address):
            return self._type(types.int64), lambda context, builder, sig, args: args[0]

        return opened


class _Words:
    """Words, and what they tell the places of."""

    def __init__(self, words: np.ndarray, value):
        self._kept, self.__array_interface__ = (words, value), words.__array_interface__


def address_of(words: np.ndarray) -> int:
    """Return where an array lies."""
    return words.__array_interface__["data"][0]


def _lay(value, words: list[int]):
    if isinstance(value, tuple):
        for part in value:
            _lay(part, words)
    elif isinstance(value, np.ndarray):
        words.append(address_of(value))
        words.extend(value.shape)
    else:
        words.append(np.float64(value).view(np.int64).item() if isinstance(value, float) else int(value))


def _words(kind: Any) -> int:
    """Return how many words a value of a lean type takes."""
    if isinstance(kind, types.BaseTuple):
        return sum(map(_words, kind.types))  # pyright: ignore[reportAttributeAccessIssue]
    return 1 + kind.ndim if isinstance(kind, View) else 1


def _field(kind: Any) -> Any:
    """Return the type that a field is read as."""
    wide = isinstance(kind, types.NamedTuple) and len(kind.types) > WIDE
    return Packed(kind) if wide else kind


@register_model(Packed)
class _Model(models.PrimitiveModel):
    def __init__(self, manager, packed):
        super().__init__(manager, packed, ir.IntType(64))


@infer_getattr
class _Attributes(AttributeTemplate):
    key = Packed

    def generic_resolve(self, packed, name):
        """Type of a field."""
        fields = packed.kind.fields
        return _field(packed.kind.types[fields.index(name)]) if name in fields else None


@lower_getattr_generic(Packed)
def _getattr(context, builder, packed, address, name):
    index = packed.kind.fields.index(name)
    at = builder.add(address, ir.IntType(64)(8 * sum(map(_words, packed.kind.types[:index]))))
    kind = packed.kind.types[index]
    if isinstance(_field(kind), Packed):
        return at
    return _load(context, builder, kind, builder.inttoptr(at, ir.IntType(64).as_pointer()), [0])


def _load(context, builder, kind: Any, pointer, at: list[int]):
    """Return a value of a lean type from the words at `at`, which moves on behind them."""

    def word(of):
        place = builder.gep(pointer, [ir.IntType(64)(at[0])], inbounds=True)
        loaded = builder.load(builder.bitcast(place, of.as_pointer()))
        # words stay what they are while compiled code has them
        loaded.set_metadata("invariant.load", builder.module.add_metadata([]))
        at[0] += 1
        return loaded

    if isinstance(kind, View):
        made: Any = cgutils.create_struct_proxy(kind)(context, builder)
        made.data = word(made.data.type)
        for k in range(kind.ndim):
            setattr(made, f"n{k}", word(ir.IntType(64)))
        return made._getvalue()
    if isinstance(kind, types.BaseTuple):
        parts: Any = kind.types  # pyright: ignore[reportAttributeAccessIssue]
        return context.make_tuple(builder, kind, [_load(context, builder, k, pointer, at) for k in parts])
    return word(context.get_value_type(kind))
