"""ctrl_df: limit cycles of drives with friction and backlash, for python-control."""

from .blocks.effect import Effect, effect_library, register_effect
from .blocks.effects import *  # noqa: F403
from .blocks.mechanism import Mass, Mechanism, TwoMass, backlash_masses, friction_mass
from .blocks.parameter import Parameter, parameter
from .blocks.pid import pid
