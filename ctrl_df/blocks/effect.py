"""What an effect is, and the library of effects that users may extend.

An effect is one piece of physics that can be added to an inertia. It is a frozen dataclass whose fields are
declared with `parameter`; its class states the role and the law. The law is a plain function of floats that
numba can compile; it then runs at full speed inside the event engine, and the same function serves the
ordinary ``updfcn``. A law numba cannot compile still runs, slowly.

============  ==================================================================================
role          what the class provides
============  ==================================================================================
``force``     ``law(t, x, v, z, p, dz) -> force`` [N] along +x, smooth; ``states`` internal states
              z, whose rates the law writes into dz
``friction``  ``law(moving, direction, speed, base, p) -> level`` [N]: the dry friction level given the
              level `base` of the effects before it; ``moving`` 1.0 kinetic, 0.0 static. One that
              `asks` for more is called ``law(moving, direction, speed, base, p, x, drive, load)``
``contact``   ``law(t, depth, rate, z, p, dz) -> force`` [N] of stops at ``span`` = (lower, upper) [m] that
              yield by `depth`: they push, a negative force is set to zero. Without a law the engine's law of
              impact applies, with a ``restitution`` and, for one that `divides` the mass, a ``gap`` and a
              ``load_fraction`` (`Backlash`) instead of the span (`HardStop`)
``coupling``  ``law(t, x, v, z, p, dz) -> force`` [N] on the load, of a joint whose motor side is `x` ahead;
              beside `Backlash` outside the gap only. A ``load_fraction`` divides a single mass
``presliding`` ``law(v, level, z, p, dz) -> force`` [N] of friction that yields before it slides, instead
              of sticking; `level` is that of the block's dry friction
``input``     ``channel() -> tuple of primitives`` that the applied force passes through; may have the
              ``law`` of a force besides, as the drive's own (back-EMF)
``output``    ``channel() -> tuple of primitives`` that the measured position passes through
============  ==================================================================================

Parameters may have any name that `Effect` does not use itself. Those that the engine must know state their
role there, ``parameter(unit, known_as="gap")``; a field or property of that name serves as well. All else
follows from the law (`ctrl_df.blocks.probing`): the deflection of a joint, the steady state of presliding,
the period of a force over position.
"""

from __future__ import annotations

import dataclasses
import re
import sys
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, TypeVar

from ..cached import cached_property
from ..calls import explained
from ..checks import shown
from ..nearest import did_you_mean
from ..units import si_unit
from . import probing
from .coordinates import either
from .parameter import Parameter, checked, plainly_within
from .primitives import Primitive
from .stated import require_complete, share_name, stated_parameters

SIDES, SIDED = ("motor", "load"), ("force", "friction")
"""The bodies that an effect may act on, and the roles of those that act on one alone."""
_LIBRARY: dict[str, type[Effect]] = {}
_EffectClass = TypeVar("_EffectClass", bound="type[Effect]")


@dataclass(frozen=True)
class Effect:
    """Base of every effect; see the module docstring for what a subclass states.

    Attributes
    ----------
    id : str
        Canonical name, the class name in snake_case.
    role : str
        One of the roles in the table at the head of `ctrl_df.blocks.effect`.
    shows : str
        How the effect shows in the residual of a model without it, in plain words.
    source : str
        Where the law comes from.
    asks : tuple of str
        Further arguments of a friction law, out of three: ``x``, the position [m]; ``drive`` [N], the driving
        force; ``load`` [N], all other forces on the body except dry friction, positive against the drive. A
        transmission carries the drive where all inertia lies behind it, the load where all lies before it. A
        law that asks for any of them receives all three. Such laws are integrated by adaptive steps.
    rank : int
        Order among friction effects: levels that add (0) before laws that shape them (1).
    side : str
        The body on which a force or friction acts in a two-mass block, ``motor`` or ``load``: a keyword of
        every effect, ``Gravity(2.0, side="load")``, unless its class states it. A rigid block has one side.
    usual_side : str
        Where it usually acts on a machine with a joint; a diagnosis that adds the joint tries both, as it
        does for friction.
    states : int
        Internal states of a force law.
    affine : bool
        Whether a force or friction law is an affine function of place and speed as long as the direction of
        motion stays: such laws run on constant propagators, exactly.
    place_free : bool
        Whether a force law is the same wherever the machine stands.
    proportional : bool
        Whether the effect vanishes as its first parameter goes to zero, in proportion to it.
    nonsmooth : bool
        Whether events of its law come and go with its parameters, so that the error jumps over them.
    multimodal : bool
        Whether the error has many local minima over its parameters in long segments: fits begin in short
        ones.
    ill_conditioned : bool
        Whether changes of its parameters and of those of the machine nearly cancel, along a long and curved
        valley of the error: fits take more iterations there.
    repeatable : bool
        Whether a block may hold several; a second one of any other effect is refused.
    turns : bool
        Whether only machines that turn may have it.
    input_unit : str
        Unit of the input, where an input effect converts another quantity into a force.
    divides : bool
        Whether a contact is a joint, which divides a single mass in motor and load.
    costly : bool
        Whether a point of a table N(A, omega) takes many times as long with it as with others.
    table_starts : int
        Starts on a table from which it is fitted.
    generalizes : effect class or None
        A special case of this effect that takes less time to try: a diagnosis tries it first, and this effect
        only where the special case comes near the best of all.

    Raises
    ------
    TypeError
        A parameter that is not a real number.
    ValueError
        A parameter out of its bounds; the message gives rule, value, remedy.

    Examples
    --------
    >>> axis = cdf.friction_mass(mass=9, coulomb=5, viscous=0.5)
    >>> [(e.id, e.role) for e in axis.effects]
    [('coulomb', 'friction'), ('viscous', 'force')]
    >>> axis.effects[0].replace(level=6.0)
    Coulomb(level=6.0)
    """

    id: ClassVar[str] = ""
    role: ClassVar[str] = ""
    shows: ClassVar[str] = ""
    source: ClassVar[str] = ""
    asks: ClassVar[tuple[str, ...]] = ()
    rank: ClassVar[int] = 0
    usual_side: ClassVar[str] = "motor"
    states: ClassVar[int] = 0
    affine: ClassVar[bool] = False
    place_free: ClassVar[bool] = False
    proportional: ClassVar[bool] = False
    nonsmooth: ClassVar[bool] = False
    multimodal: ClassVar[bool] = False
    ill_conditioned: ClassVar[bool] = False
    repeatable: ClassVar[bool] = False
    turns: ClassVar[bool] = False
    input_unit = ""
    divides: ClassVar[bool] = False
    costly: ClassVar[bool] = False
    table_starts: ClassVar[int] = 3
    generalizes: ClassVar[type[Effect] | None] = None
    law: ClassVar[Callable | None] = None
    side: str = dataclasses.field(default="motor", kw_only=True)

    def __init_subclass__(cls, **kwargs):
        super().__init_subclass__(**kwargs)
        for name, value in vars(cls).items():
            if isinstance(value, dataclasses.Field) and hasattr(Effect, name):
                raise ValueError(
                    f"{cls.__name__} needs parameters by names of their own; got {name!r}, which every "
                    "effect has. Choose another name."
                )
        if "__repr__" not in vars(cls):
            cls.__repr__ = Effect.__repr__  # type: ignore[method-assign]  # a dataclass keeps what is there
        cls.id = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", cls.__name__).lower()

    def __post_init__(self):
        require_complete(type(self))
        for name, spec in stated_parameters(type(self)):
            value = getattr(self, name)
            if not plainly_within(value, spec):
                alone = {**spec, "unit": either(spec["unit"], self.turns)}
                object.__setattr__(self, name, checked(type(self).__name__, name, value, alone, self.remedy))
        if self.side not in SIDES or (self.side != type(self).side and self.role not in SIDED):
            where = f"side={SIDES[0]!r} or {SIDES[1]!r}" if self.role in SIDED else "no side but the motor's"
            raise ValueError(
                f"{type(self).__name__} (role {self.role}) takes {where}; got {shown(self.side)}. "
                "Leave it out for the motor."
            )
        self.check()

    def __repr__(self) -> str:
        names = [f.name for f in dataclasses.fields(self) if f.name != "side"]
        names += ["side"] if self.side != type(self).side else []
        own = (f"{name}={getattr(self, name)!r}" for name in names)
        return f"{type(self).__name__}({', '.join(own)})"

    remedy: ClassVar[str] = ""

    def check(self) -> None:
        """Raise ValueError where parameters contradict each other; the base class has nothing to check."""

    def channel(self) -> tuple[Primitive, ...]:
        """Return the primitives of an input or output effect, in the order the signal passes them."""
        raise NotImplementedError(f"{type(self).__name__} has role {self.role!r}, which is no channel.")

    # --- what a diagnosis should know of it ------------------------------------------------------------

    @classmethod
    def applicable(cls, block) -> bool:
        """Return whether adding one to the block says anything that it, or plainer effects, do not."""
        return True

    @classmethod
    def suggest(cls, screen) -> Iterable[Effect] | None:
        """Return effects with which fits may begin, read off a `Screen`; None: sizes from small to large."""
        return None

    @classmethod
    def regress(cls, screen) -> Iterable[tuple[Effect, Mapping[str, float]]]:
        """Return effects fitted to the force of a `Screen`, with values of the model's parameters beside."""
        return ()

    @classmethod
    def suggest_on_plane(cls, plane) -> Iterable[tuple[Effect, float]] | None:
        """Return effects with which fits to a table N(A, omega) may begin; None: sizes of all kinds.

        Each comes with the share of the model's own Coulomb friction that stays beside it. `plane`: the
        `Plane` of the table.
        """
        return None

    def bounds(self, seen) -> dict[str, tuple[float, float]]:
        """Return ranges of parameters that the records do not prove wrong; `seen`: their `RecordScales`."""
        return {}

    def ranges(self, seen) -> dict[str, tuple[float, float]]:
        """Return ranges of parameters beyond which the records show nothing of the effect itself."""
        return {}

    def about_zero(self) -> Iterable[Effect]:
        """Return effects counted from zero that act as this one does in records that show a part of it.

        A stop at one end of the stroke says nothing of the other. The base class has none.
        """
        return ()

    def distinct(self, stroke: float, at_bound) -> bool:
        """Return whether it is what its name says over a stroke [m], and no stand-in for another effect.

        `at_bound`: names of its parameters that a fit has left at a bound.
        """
        return True

    def steady(self, level: float) -> tuple[float, ...]:
        """Return the internal states that motion along +x comes to, under a dry friction of `level` [N].

        The base class asks the law.
        """
        return probing.sliding(self, level)

    def periods(self) -> tuple[float, ...]:
        """Return lengths over which its law repeats from place to place [m]; the base class asks the law."""
        return probing.periods(self)

    @classmethod
    def from_spring(
        cls, stiffness: float, damping: float, load_fraction: float, usual: Callable[[str], float]
    ) -> Effect | None:
        """Return a joint that is nearly a spring [N/m] with a damper [N s/m]; None for all other effects.

        The base class goes by units: the first parameter of each takes it, others are left at their defaults
        or take sizes that are `usual` for their unit in the records. None where no parameter is a stiffness.
        """
        if cls.role != "coupling":
            return None
        given = {"N/m": stiffness, "N s/m": damping}
        values, defaults = {}, {f.name: f.default for f in dataclasses.fields(cls)}
        for name, spec in stated_parameters(cls):
            unit = si_unit(spec["unit"])[1]
            if name == share_name(cls):
                values[name] = load_fraction
            elif unit in given:
                values[name] = given.pop(unit)
            elif defaults[name] is dataclasses.MISSING:
                values[name] = usual(spec["unit"])
        try:
            return None if "N/m" in given else cls(**values)
        except (TypeError, ValueError):  # it needs more than parameters, or refuses these
            return None

    @classmethod
    def from_special(cls, special: Effect) -> Effect | None:
        """Return one that begins as the special case that it `generalizes`; None where that says too little.

        The base class takes over the parameters that both have, and leaves others at their defaults.
        """
        names = {name for name, _ in stated_parameters(cls)}
        shared: dict[str, Any] = {k: p.value for k, p in special.parameters.items() if k in names}
        if special.side != cls.side:
            shared["side"] = special.side
        try:
            return cls(**shared)
        except (TypeError, ValueError):
            return None

    @property
    def parameters(self) -> dict[str, Parameter]:
        """Its parameters by field name."""
        return {name: Parameter(getattr(self, name), **spec) for name, spec in stated_parameters(type(self))}

    @cached_property
    def values(self) -> tuple[float, ...]:
        """Parameter values in declaration order: the `p` its law sees."""
        return tuple(getattr(self, name) for name, _ in stated_parameters(type(self)))

    def replace(self, **changes: Any) -> Effect:
        """Return the same effect with other parameter values."""
        return dataclasses.replace(self, **changes)


def register_effect(cls: _EffectClass) -> _EffectClass:
    """Class decorator: add an effect to the library, so that diagnosis screens it and blocks accept it.

    The same class again (a cell run twice, a script that is imported as well) takes the place of the first.

    Raises
    ------
    TypeError
        If it is no dataclass derived from `Effect`.
    ValueError
        If the id is taken, the role unknown, or something that the role needs not stated.

    Examples
    --------
    >>> from dataclasses import dataclass
    >>> @cdf.register_effect
    ... @dataclass(frozen=True)
    ... class SquareRootDrag(cdf.Effect):
    ...     level: float = cdf.parameter("N s/m")
    ...     role = "force"
    ...     @staticmethod
    ...     def law(t, x, v, z, p, dz):
    ...         return -p[0] * v / (1.0 + abs(v)) ** 0.5
    >>> cdf.Mass(2.0).with_effect(SquareRootDrag(3.0)).parameters["square_root_drag.level"].value
    3.0
    """
    if not (isinstance(cls, type) and issubclass(cls, Effect) and dataclasses.is_dataclass(cls)):
        raise TypeError(
            f"register_effect needs a frozen dataclass derived from ctrl_df.Effect; got {shown(cls)}. "
            "Decorate the class: @register_effect above @dataclass(frozen=True)."
        )
    require_complete(cls)
    taken = _LIBRARY.get(cls.id)
    if taken is not None and _origin(taken) != _origin(cls):
        raise ValueError(
            f"effect id {cls.id!r} is taken by {taken.__module__}.{taken.__qualname__}; rename the class."
        )
    _LIBRARY[cls.id] = cls
    return explained(cls)


def _origin(cls) -> tuple[str, str]:
    """Return where a class is written: its file (a script has two module names), or its module."""
    module = sys.modules.get(cls.__module__)
    return getattr(module, "__file__", None) or cls.__module__, cls.__qualname__


def effect_library() -> dict[str, type[Effect]]:
    """Return every registered effect class by id, built-in and user-registered.

    Examples
    --------
    >>> "stribeck" in cdf.effect_library()
    True
    >>> cdf.effect_library()["stribeck"].shows
    'error concentrated at low speed: more friction there than at full speed'
    """
    return dict(_LIBRARY)


def effect_class(effect_id: str) -> type[Effect]:
    """Return the class of an effect by its id.

    Parameters
    ----------
    effect_id : str
        Id of an effect of the library or of a registered one, such as ``linear_spring``.

    Raises
    ------
    ValueError
        An unknown id; the message lists those known.

    Examples
    --------
    >>> cdf.effect_class("linear_spring")(200.0)
    LinearSpring(stiffness=200.0, center=0.0)
    """
    if not isinstance(effect_id, str) or effect_id not in _LIBRARY:
        raise (ValueError if isinstance(effect_id, str) else TypeError)(
            f"an effect id must be one of the library's; got {shown(effect_id)}. "
            f"Known: {', '.join(sorted(_LIBRARY))}. "
            "Register your own with ctrl_df.register_effect." + did_you_mean(effect_id, _LIBRARY)
        )
    return _LIBRARY[effect_id]
