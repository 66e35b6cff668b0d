"""Limit cycles of drives with friction and backlash, for python-control.

Two flows run through the package::

    physics block --> describing function family --> predicted limit cycles --> exact orbit --> verdict
       Mass             describing_function_            describing_function_       find_limit_    verify
       TwoMass, Inertia family                          response, ..._plot         cycle

    measurement --> compare --> diagnose --> add the effect --> refit --> compare again
    Measurement     compare     diagnose     block.with_effect   refit    improve (the whole ladder)
"""

import sys as _sys
from importlib import import_module as _import_module
from typing import TYPE_CHECKING as _TYPE_CHECKING

from .blocks.effect import Effect, effect_class, effect_library, register_effect
from .blocks.effects import *  # noqa: F403
from .blocks.effects import __all__ as _effects
from .blocks.elements.hysteresis import (
    friction_backlash_nonlinearity,
    play,
    rate_limiter,
    relay_hysteresis_nonlinearity,
    relay_with_hysteresis,
)
from .blocks.elements.memoryless import (
    DescribingFunctionNonlinearity,
    cubic,
    dead_zone,
    piecewise_linear,
    preload,
    quantizer,
    relay,
    relay_with_dead_zone,
    saturation,
    saturation_nonlinearity,
)
from .blocks.massless import Massless
from .blocks.mechanism import Mass, Mechanism, TwoMass, backlash_masses, friction_mass
from .blocks.parameter import Parameter, parameter
from .blocks.pid import pid
from .blocks.rotary import Inertia, TwoInertias
from .calls import explained as _explained
from .drawing import install as _install
from .handlers import handler as _handler
from .status import Status

_install(_handler)

# Names loaded on first use, so that importing the package stays cheap.
_LAZY = {
    "describing_function": "df.describing",
    "describing_function_family": "df.describing",
    "DescribingFunctionWarning": "df.warning",
    "Family": "df.family",
    "load_family": "df.family",
    "closed_loop": "simulate.loop",
    "sampled": "simulate.sampled",
    "event_response": "simulate.response",
    "batch_response": "simulate.batch",
    "BatchResponse": "simulate.batch",
    "imposed_response": "simulate.imposed_response",
    "DescribingFunctionResponse": "limit_cycles.predicted.predict",
    "describing_function_response": "limit_cycles.predicted.predict",
    "LimitCycle": "limit_cycles.predicted.grade",
    "find_limit_cycle": "limit_cycles.finder",
    "Orbit": "limit_cycles.exact.orbit",
    "NoOrbit": "limit_cycles.exact.orbit",
    "verify": "limit_cycles.verify",
    "limit_cycle_map": "gains.limit_cycle_map",
    "LimitCycleMap": "gains.map",
    "tune_pid": "gains.tune",
    "TunedPID": "gains.tune",
    "explore": "plot.explore",
    "describing_function_plot": "plot.describing",
    "Measurement": "identify.data.measurement",
    "FrequencyMeasurement": "identify.data.frequency_measurement",
    "compare": "identify.compare",
    "refit": "identify.refit",
    "diagnose": "identify.diagnose",
    "improve": "identify.improve",
    "warm_up": "warm",
    "show_versions": "versions",
}

if _TYPE_CHECKING:  # the same names for editors and type checkers, which run nothing
    from .df.describing import describing_function as describing_function
    from .df.describing import describing_function_family as describing_function_family
    from .df.family import Family as Family
    from .df.family import load_family as load_family
    from .df.warning import DescribingFunctionWarning as DescribingFunctionWarning
    from .gains.limit_cycle_map import limit_cycle_map as limit_cycle_map
    from .gains.map import LimitCycleMap as LimitCycleMap
    from .gains.tune import TunedPID as TunedPID
    from .gains.tune import tune_pid as tune_pid
    from .identify.compare import compare as compare
    from .identify.data.frequency_measurement import FrequencyMeasurement as FrequencyMeasurement
    from .identify.data.measurement import Measurement as Measurement
    from .identify.diagnose import diagnose as diagnose
    from .identify.improve import improve as improve
    from .identify.refit import refit as refit
    from .limit_cycles.exact.orbit import NoOrbit as NoOrbit
    from .limit_cycles.exact.orbit import Orbit as Orbit
    from .limit_cycles.finder import find_limit_cycle as find_limit_cycle
    from .limit_cycles.predicted.grade import LimitCycle as LimitCycle
    from .limit_cycles.predicted.predict import DescribingFunctionResponse as DescribingFunctionResponse
    from .limit_cycles.predicted.predict import describing_function_response as describing_function_response
    from .limit_cycles.verify import verify as verify
    from .plot.describing import describing_function_plot as describing_function_plot
    from .plot.explore import explore as explore
    from .simulate.batch import BatchResponse as BatchResponse
    from .simulate.batch import batch_response as batch_response
    from .simulate.imposed_response import imposed_response as imposed_response
    from .simulate.loop import closed_loop as closed_loop
    from .simulate.response import event_response as event_response
    from .simulate.sampled import sampled as sampled
    from .versions import show_versions as show_versions
    from .warm import warm_up as warm_up

__all__ = [  # pyright: ignore[reportUnsupportedDunderAll]
    "DescribingFunctionNonlinearity",
    "Effect",
    "Inertia",
    "Mass",
    "Massless",
    "Mechanism",
    "Parameter",
    "Status",
    "TwoInertias",
    "TwoMass",
    "backlash_masses",
    "cubic",
    "dead_zone",
    "effect_class",
    "effect_library",
    "friction_backlash_nonlinearity",
    "friction_mass",
    "parameter",
    "pid",
    "piecewise_linear",
    "play",
    "preload",
    "quantizer",
    "rate_limiter",
    "register_effect",
    "relay",
    "relay_hysteresis_nonlinearity",
    "relay_with_dead_zone",
    "relay_with_hysteresis",
    "saturation",
    "saturation_nonlinearity",
    *_effects,
    *_LAZY,
]

# Every public call that does not fit says what the function takes.
globals().update({_name: _explained(globals()[_name]) for _name in __all__ if _name not in _LAZY})


def __getattr__(name):
    if name == "__version__":
        return _import_module(".versions", __name__).version()
    if name in _LAZY:
        value = _explained(getattr(_import_module(f".{_LAZY[name]}", __name__), name))
        globals()[name] = value
        return value
    message = f"module {__name__!r} has no attribute {name!r}"
    raise AttributeError(message, name=name, obj=_sys.modules[__name__])  # Python suggests the nearest


def __dir__():
    return sorted(__all__)
