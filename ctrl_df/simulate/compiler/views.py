# pyright: reportCallIssue=false, reportOptionalCall=false
# (numba's stubs know neither its private options nor the arguments of an intrinsic)
"""Arrays as compiled code hands them on: an address and the lengths, nothing else.

numba passes an array as seven values, counts references and looks after negative indices at every access;
functions that take dozens of arrays compile slowly for it, and calling them costs. `lean` turns arrays (and
named tuples of them) into views: C-contiguous, indices from zero, rows of a matrix views themselves. A view
does not keep its memory alive; whoever makes one holds the array. Views exist in compiled code only.
"""

from __future__ import annotations

import operator
from typing import Any

from numba import types
from numba.core import cgutils
from numba.core.typing.templates import AbstractTemplate, AttributeTemplate, infer_global, signature
from numba.extending import (
    infer_getattr,
    intrinsic,
    lower_builtin,
    lower_getattr,
    models,
    register_model,
)


class View(types.Type):
    """A view of `ndim` dimensions with elements of one type."""

    def __init__(self, dtype, ndim):
        self.dtype, self.ndim = dtype, ndim
        super().__init__(f"View({dtype}, {ndim})")


@register_model(View)
class _Model(models.StructModel):
    def __init__(self, manager, view):
        members: list[tuple[str, Any]] = [("data", types.CPointer(view.dtype))]
        members += [(f"n{i}", types.intp) for i in range(view.ndim)]
        super().__init__(manager, view, members)


@infer_getattr
class _Attributes(AttributeTemplate):
    key = View

    def resolve_shape(self, view):
        """Lengths, as those of an array."""
        return types.UniTuple(types.intp, view.ndim)

    def resolve_address(self, view):
        """Where the first element lies."""
        return types.intp


@lower_getattr(View, "shape")
def _shape(context, builder, view, value):
    made = cgutils.create_struct_proxy(view)(context, builder, value)
    return cgutils.pack_array(builder, [getattr(made, f"n{i}") for i in range(view.ndim)])


@lower_getattr(View, "address")
def _address(context, builder, view, value):
    made = cgutils.create_struct_proxy(view)(context, builder, value)
    return builder.ptrtoint(made.data, context.get_value_type(types.intp))


def _indices(index: Any) -> list[Any] | None:
    """Types of the indices, or None if they are no integers."""
    found: list[Any] = list(index.types) if isinstance(index, types.BaseTuple) else [index]  # pyright: ignore
    return found if all(isinstance(i, types.Integer) for i in found) else None


@infer_global(operator.getitem)
class _GetItem(AbstractTemplate):
    def generic(self, args, kws):
        view, index = args
        kinds = _indices(index)
        if not isinstance(view, View) or kinds is None:
            return None
        left = view.ndim - len(kinds)
        if left < 0:
            return None
        return signature(view.dtype if left == 0 else View(view.dtype, left), view, index)


@infer_global(operator.setitem)
class _SetItem(AbstractTemplate):
    def generic(self, args, kws):
        view, index, value = args
        kinds = _indices(index)
        if not isinstance(view, View) or kinds is None or len(kinds) != view.ndim:
            return None
        if not isinstance(value, types.Number | types.Boolean):
            return None
        return signature(types.none, view, index, view.dtype)


def _place(context, builder, view, value, index, at):
    """Pointer to an element or a row, and the view's fields."""
    made = cgutils.create_struct_proxy(view)(context, builder, value)
    kinds: list[Any] = _indices(index) or []
    places = cgutils.unpack_tuple(builder, at) if isinstance(index, types.BaseTuple) else [at]
    offset = None
    for k in range(view.ndim):
        step = None
        if k < len(kinds):
            step = context.cast(builder, places[k], kinds[k], types.intp)
        if offset is None:
            offset = step
        else:
            offset = builder.mul(offset, getattr(made, f"n{k}"), flags=["nsw"])
            if step is not None:
                offset = builder.add(offset, step, flags=["nsw"])
    return builder.gep(made.data, [offset], inbounds=True), made, len(kinds)


@lower_builtin(operator.getitem, View, types.Integer)
@lower_builtin(operator.getitem, View, types.BaseTuple)
def _getitem(context, builder, sig, args):
    view, index = sig.args
    pointer, made, used = _place(context, builder, view, args[0], index, args[1])
    if isinstance(sig.return_type, View):
        row = cgutils.create_struct_proxy(sig.return_type)(context, builder)
        row.data = pointer
        for k in range(sig.return_type.ndim):
            setattr(row, f"n{k}", getattr(made, f"n{used + k}"))
        return row._getvalue()
    return context.unpack_value(builder, view.dtype, pointer)


@lower_builtin(operator.setitem, View, types.Integer, types.Any)
@lower_builtin(operator.setitem, View, types.BaseTuple, types.Any)
def _setitem(context, builder, sig, args):
    view, index, value = sig.args
    pointer, _, _ = _place(context, builder, view, args[0], index, args[1])
    context.pack_value(builder, view.dtype, context.cast(builder, args[2], value, view.dtype), pointer)
    return context.get_dummy_value()


def lean_type(kind: Any) -> Any:
    """Type of a value once it is lean."""
    if isinstance(kind, types.Array):
        return View(kind.dtype, kind.ndim)
    if isinstance(kind, types.NamedTuple | types.NamedUniTuple):
        return types.NamedTuple([lean_type(k) for k in kind.types], kind.instance_class)
    if isinstance(kind, types.Tuple | types.UniTuple):
        return types.Tuple([lean_type(k) for k in kind.types])
    return types.unliteral(kind)


def _lean_value(context, builder, kind: Any, value):
    target = lean_type(kind)
    if isinstance(kind, types.Array):
        array = cgutils.create_struct_proxy(kind)(context, builder, value)
        made = cgutils.create_struct_proxy(target)(context, builder)
        made.data = array.data
        for k, n in enumerate(cgutils.unpack_tuple(builder, array.shape)):
            setattr(made, f"n{k}", n)
        return made._getvalue()
    if isinstance(kind, types.Tuple | types.UniTuple | types.NamedTuple | types.NamedUniTuple):
        values = [
            _lean_value(context, builder, k, builder.extract_value(value, i))
            for i, k in enumerate(kind.types)
        ]
        return context.make_tuple(builder, target, values)
    return context.cast(builder, value, kind, target)


@intrinsic
def cut(typingctx, view, first, count):
    """Return `count` elements, or rows, of a view from `first` on, as a view."""
    if not isinstance(view, View):
        return None

    def codegen(context, builder, sig, args):
        at, made, _ = _place(context, builder, view, args[0], sig.args[1], args[1])
        made.data, made.n0 = at, args[2]
        return made._getvalue()

    return view(view, types.intp, types.intp), codegen


@intrinsic
def lean(typingctx, value):
    """Return arrays, alone or within tuples, as views; numbers as they are."""

    def codegen(context, builder, sig, args):
        return _lean_value(context, builder, sig.args[0], args[0])

    return lean_type(value)(value), codegen
