"""Functions that exist only within those that call them, and how all machine code of the package is made.

numba makes machine code of every function it compiles, then copies what a function calls into it and
optimizes everything again. Of a part of the engine nobody wants machine code: `PartCompiler` ends with its
LLVM code, which is optimized once, together with the function that uses it.

numba optimizes for long loops over arrays: it vectorizes and unrolls, each loop in several versions. The
engine's loops go over the few states of a system; there such versions cost time to make and time to choose
from. `LeanCompiler` leaves them out, and simplifies each function once instead of three times.
"""

from __future__ import annotations

from llvmlite import binding as llvm
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import register_pass
from numba.core.typed_passes import NativeLowering, NopythonRewrites
from numba.core.untyped_passes import InlineClosureLikes

from ..thresholds import INLINED, SPEED


class LeanLibrary(JITCodeLibrary):
    """Machine code of a function and its parts, optimized once, without versions of its loops."""

    def _optimize_functions(self, ll_module):
        """Leave it to the one time that all are optimized."""
        ll_module.data_layout = self._codegen._data_layout

    def _optimize_final_module(self):
        if not hasattr(llvm, "create_pipeline_tuning_options"):  # before llvmlite 0.44
            super()._optimize_final_module()
            return
        tuning = llvm.create_pipeline_tuning_options(speed_level=SPEED)
        tuning.loop_vectorization = tuning.slp_vectorization = False
        tuning.loop_unrolling = tuning.loop_interleaving = False
        tuning.inlining_threshold = INLINED
        builder = llvm.create_pass_builder(self._codegen._tm, tuning)
        builder.getModulePassManager().run(self._final_module, builder)


class PartLibrary(LeanLibrary):
    """Code that others link in: neither optimized by itself nor turned into machine code."""

    def finalize(self):
        """Gather what the part itself calls."""
        self._raise_if_finalized()
        for library in dict.fromkeys(self._linking_libraries):
            self._reload_init.update(library._reload_init)
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        self._finalized = True


@register_pass(mutates_CFG=True, analysis_only=False)
class LeanLowering(NativeLowering):
    """Lower a function into a `LeanLibrary`."""

    _name = "lean_lowering"

    def run_pass(self, state):
        """Lower as numba does."""
        state.library = LeanLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        return super().run_pass(state)


@register_pass(mutates_CFG=True, analysis_only=False)
class PartLowering(NativeLowering):
    """Lower a function into a `PartLibrary`, and let other functions call it there."""

    _name = "part_lowering"

    def run_pass(self, state):
        """Lower without an entry from Python."""
        state.library = PartLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.flags.no_compile = True
        super().run_pass(state)
        lowered = state["cr"]
        key = object().__dir__  # the dispatcher wants a built-in function, and each its own
        state.targetctx.insert_user_function(key, lowered.fndesc, [state.library])
        state["cr"] = lowered._replace(cfunc=key)
        return True


class LeanCompiler(CompilerBase):
    """numba's pipeline with a lowering of its own in the place of numba's."""

    lowering = LeanLowering
    needless = ()

    def define_pipelines(self):
        """Return the one pipeline."""
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes._finalized = False
        passes.add_pass_after(self.lowering, NativeLowering)
        passes.passes = [p for p in passes.passes if p[0] not in (NativeLowering, *self.needless)]
        passes.finalize()
        return [passes]


class PartCompiler(LeanCompiler):
    """The same for parts, in which there are neither closures nor expressions of arrays."""

    lowering = PartLowering
    needless = (InlineClosureLikes, NopythonRewrites)
