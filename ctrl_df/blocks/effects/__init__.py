"""The library of effects: friction, contact, springs, input channel, sensor."""

from .asymmetric_coulomb import AsymmetricCoulomb
from .asymmetric_viscous import AsymmetricViscous
from .backlash import Backlash
from .bristle import Bristle
from .compliance import Compliance
from .constant_force import ConstantForce
from .coulomb import Coulomb
from .cubic_spring import CubicSpring
from .gravity import Gravity
from .hard_stop import HardStop
from .hysteresis import Hysteresis
from .input_channel import InputDeadZone, InputDelay, InputGain, InputLag, InputSaturation
from .linear_spring import LinearSpring
from .load_dependent_friction import LoadDependentFriction
from .load_friction import LoadFriction
from .loose_linkage import LooseLinkage
from .maxwell_slip import MaxwellSlip
from .position_dependent_friction import PositionDependentFriction
from .position_ripple import PositionRipple
from .quadratic_drag import QuadraticDrag
from .sensor_channel import Drift, SensorDelay, SensorOffset, SensorQuantization
from .stiction import Stiction
from .stribeck import Stribeck
from .torque_constant import TorqueConstant
from .viscous import Viscous

__all__ = [
    "AsymmetricCoulomb",
    "AsymmetricViscous",
    "Backlash",
    "Bristle",
    "Compliance",
    "ConstantForce",
    "Coulomb",
    "CubicSpring",
    "Drift",
    "Gravity",
    "HardStop",
    "Hysteresis",
    "InputDeadZone",
    "InputDelay",
    "InputGain",
    "InputLag",
    "InputSaturation",
    "LinearSpring",
    "LoadDependentFriction",
    "LoadFriction",
    "LooseLinkage",
    "MaxwellSlip",
    "PositionDependentFriction",
    "PositionRipple",
    "QuadraticDrag",
    "SensorDelay",
    "SensorOffset",
    "SensorQuantization",
    "Stiction",
    "Stribeck",
    "TorqueConstant",
    "Viscous",
]
