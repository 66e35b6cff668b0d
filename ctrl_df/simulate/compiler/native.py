"""Calling compiled code through its address.

numba links what a function calls into it and optimises the whole again; with an engine inside, every caller
would take half a minute to compile. Called through its address, the engine is compiled once and its callers
in seconds. What is passed are views (`views`): few values, and one form of each function.
"""

from __future__ import annotations

import numba
import numpy as np
from numba import types
from numba.extending import intrinsic

from .views import lean_type

NUMBERS, COUNTS = np.zeros(0), np.zeros(0, np.int64)
ROWS, SPECTRA = np.zeros((0, 0)), np.zeros((0, 0), complex)
"""Arrays of nothing: arguments of `native_address`, where types alone count."""


def native_address(function, arguments) -> int:
    """Return the address of an `apart` function's code for such arguments, compiled now if need be."""
    signature = tuple(lean_type(numba.typeof(a)) for a in arguments)
    function.compile(signature)
    result = function.overloads[signature]
    return int(result.library.get_pointer_to_function(result.fndesc.llvm_func_name))


@intrinsic
def call_native(typingctx, address, arguments):
    """Call the function at an address of `native_address` with a tuple of arguments; it returns an int64."""
    if not isinstance(arguments, types.BaseTuple):
        return None
    sig = types.int64(types.int64, arguments)

    def codegen(context, builder, signature, values):
        argument_types = list(signature.args[1].types)
        arguments = [builder.extract_value(values[1], i) for i in range(len(argument_types))]
        kind = context.call_conv.get_function_type(types.int64, argument_types)
        callee = builder.inttoptr(values[0], kind.as_pointer())
        status, result = context.call_conv.call_function(
            builder, callee, types.int64, argument_types, arguments
        )
        with builder.if_then(status.is_error, likely=False):
            context.call_conv.return_status_propagate(builder, status)
        return result

    return sig, codegen
