# pyright: reportCallIssue=false
# (numba's stubs know neither its private options nor the arguments of an intrinsic)
"""Numbers that the parts of a compiled function have in common, read and written under their names.

A part cannot change a number that it is handed. What `Numbers.opener` returns makes room for a set of them
within the function that calls it; parts are handed the set, and read and write its fields as attributes.
Where all of these parts are copied into the function (`inline`), the fields are what its own variables are:
LLVM keeps them in registers.
"""

from __future__ import annotations

from typing import Any, get_type_hints

import numba
import numpy as np
from numba.extending import intrinsic


class Numbers:
    """The fields of a class, each annotated with `float`, `int` or `bool`."""

    def __init__(self, fields: type):
        self._type: Any = numba.from_dtype(np.dtype(list(get_type_hints(fields).items()), align=True))

    def opener(self) -> Any:
        """Return the compiled function that makes room for them; they have no values yet."""

        @intrinsic
        def opened(typingctx):
            def codegen(context, builder, sig, args):
                # not `alloca_once`: it writes zeros byte by byte, which keeps LLVM from taking fields apart
                with builder.goto_entry_block():
                    room = builder.alloca(context.get_data_type(self._type))
                room.align = self._type.dtype.alignment
                return room

            return self._type(), codegen

        return opened
