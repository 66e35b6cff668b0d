"""Inertias with effects: `Mass`, `TwoMass`, and the factories of the paper's two mechanisms."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from functools import lru_cache
from types import MappingProxyType
from typing import Any

import numpy as np

from ..cached import cached_property
from ..checks import known_name, mapping, number, shown, system_name
from ..nearest import did_you_mean
from ..table import Table
from ..units import driven
from .coordinates import LINE, Coordinates
from .core import Core, build_core, kinetic_level
from .effect import Effect
from .effects import Backlash, Coulomb, Stiction, Viscous
from .immutable import Immutable
from .ordinary import compliant
from .ordinary.linearization import warn_of_mechanism
from .parameter import Parameter, checked
from .stated import share_name, stated_parameters, static_levels
from .thresholds import KEPT_EFFECTS

_PLAIN = (float, np.float64)
_MASS = dict(unit="kg", lower=0.0, upper=float("inf"), strict=True, free=True, meaning="inertia")


class Mechanism(Immutable):
    """An inertia plus a tuple of effects; immutable, its rates a function of ``(t, x, u, params)`` alone.

    Use `Mass` or `TwoMass`. ``updfcn`` is the compliant form (`ctrl_df.blocks.ordinary.compliant`); the event
    engine runs the exact laws.

    Examples
    --------
    >>> axis = cdf.friction_mass(mass=9, coulomb=5)
    >>> isinstance(axis, cdf.Mechanism), isinstance(axis, ct.NonlinearIOSystem)
    (True, True)
    >>> axis.effects
    (Coulomb(level=5.0), Viscous(coefficient=0.0))
    """

    _inertias: tuple[str, ...] = ()
    _coordinates: Coordinates = LINE

    def __init__(self, inertias: dict[str, float], effects=(), *, measured="load", name=None):
        owner = type(self).__name__
        system_name(owner, name)
        self._values = self._checked(inertias)
        self._effects = _as_effects(effects)
        if measured not in ("load", "motor"):
            raise ValueError(
                f"{owner} needs measured='load' or 'motor' (the body the sensor sees); got {measured!r}."
            )
        self._measured = measured
        self._keys = _effect_keys(self._effects)
        _check_levels(self._effects)
        _check_repeated(self._effects)
        for effect in self._effects if self._coordinates is LINE else ():
            if effect.turns:
                raise ValueError(
                    f"{effect.id} needs a machine that turns (Inertia, TwoInertias); got {owner}. "
                    f"{effect.remedy}"
                )
        self._core = self._build(self._values, self._effects)
        inputs, outputs, states = self._labels()
        super().__init__(
            self._updfcn,
            self._outfcn,
            inputs=inputs,
            outputs=outputs,
            states=states,
            dt=0,
            name=name,
            params=self._numbers(),
        )

    def _numbers(self) -> dict[str, float]:
        """Return the values of `parameters` by name."""
        return dict(self._values) | {name: value for name, value, _ in self._of_effects()}

    def _of_effects(self) -> Iterator[tuple[str, float, dict[str, Any]]]:
        """Yield the parameters of its effects: full name, value, what is stated of it."""
        beside = self._core.bodies == 2
        motor = max((i for i, e in enumerate(self._effects) if e.input_unit), default=-1)
        for i, (key, effect) in enumerate(zip(self._keys, self._effects, strict=True)):
            idle = share_name(type(effect)) if len(self._inertias) == 2 else ""
            unit = self._effects[motor].input_unit if effect.role == "input" and i < motor else ""
            for (name, spec), value in zip(stated_parameters(type(effect)), effect.values, strict=True):
                if name != idle:
                    spec = {**spec, "unit": driven(spec["unit"], unit)} if unit else spec
                    if beside and effect.side != type(effect).side:
                        spec = {**spec, "meaning": f"{spec['meaning']}, on the {effect.side}"}
                    yield f"{key}.{name}", value, spec

    def _labels(self) -> tuple[list[str], list[str], list[str]]:
        """Return the names of inputs, outputs and states."""
        called = self._coordinates.name
        out = [called(signal) for signal in self._core.motions]
        return [called("F")], out, [*out, *self._core.state_names[len(out) :]]

    def _build(self, values, effects) -> Core:
        masses = tuple(values[k] for k in self._inertias)
        return build_core(masses, len(masses) == 2, effects, self._measured)

    # --- a value --------------------------------------------------------------------------------------

    @property
    def effects(self) -> tuple[Effect, ...]:
        """The effects, in the order they were added."""
        return self._effects

    @property
    def named_effects(self) -> dict[str, Effect]:
        """The effects by the names that their parameters begin with; a second of a kind has a number."""
        return dict(zip(self._keys, self._effects, strict=True))

    @property
    def nonsmooth(self) -> bool:
        """Whether events of some effect come and go as parameters move (`Effect.nonsmooth`)."""
        return any(effect.nonsmooth for effect in self.effects)

    @property
    def many_minima(self) -> bool:
        """Whether the error over its parameters has many minima: for events, or the law of an effect."""
        return any(effect.nonsmooth or effect.multimodal for effect in self.effects)

    @property
    def newest(self) -> str:
        """Name of the effect that was added last."""
        return self._keys[-1]

    @property
    def core(self) -> Core:
        """The mechanism as numbers, for the engine."""
        return self._core

    @property
    def coordinates(self) -> Coordinates:
        """How it moves: words and units of its quantities."""
        return self._coordinates

    @property
    def signals(self) -> Mapping[str, str]:
        """Unit of its input and of each output, by label."""
        given = next((e.input_unit for e in self._effects if e.input_unit), "N")
        units = {"F": given, "x": "m", "v": "m/s", "x_motor": "m", "v_motor": "m/s"}
        mine = self._coordinates
        return {mine.name(k): mine.unit_of(units[k]) for k in ("F", *self._core.motions)}

    @property
    def measured(self) -> str:
        """The body whose position is the output `x` where a joint separates two: ``load`` or ``motor``."""
        return self._measured

    @property
    def parameters(self) -> Mapping[str, Parameter]:
        """Ordered mapping of name (``mass``, ``coulomb.level``, ...) to `Parameter` (value, unit, bounds)."""
        return self._parameters

    @cached_property
    def _parameters(self) -> Mapping[str, Parameter]:
        table = {
            k: self._own(Parameter(v, **{**_MASS, "meaning": k.replace("_", " ")}))
            for k, v in self._values.items()
        }
        for name, value, spec in self._of_effects():
            table[name] = self._own(Parameter(value, **spec))
        return MappingProxyType(table)

    def _own(self, parameter: Parameter) -> Parameter:
        """Return a parameter in the units and words of this machine."""
        mine = self._coordinates
        if mine is LINE:
            return parameter
        return replace(parameter, unit=mine.unit_of(parameter.unit), meaning=mine.text(parameter.meaning))

    def with_effect(self, effect: Effect) -> Mechanism:
        """Return the block with one more effect."""
        return self._remade(self._values, (*self._effects, *_as_effects([effect])))

    def with_effects(self, effects: Iterable[Effect]) -> Mechanism:
        """Return the block with these effects in the place of its own."""
        return self._remade(self._values, _as_effects(effects))

    def without_effect(self, id: str) -> Mechanism:
        """Return the block without the effect of that id; ValueError if it has none."""
        if id not in self._keys:
            raise ValueError(
                f"without_effect needs an id the block has ({', '.join(self._keys) or 'none'}); got {id!r}."
                f"{did_you_mean(id, self._keys, 'Look at the effects of the block.')}"
            )
        kept = [e for k, e in zip(self._keys, self._effects, strict=True) if k != id]
        return self._remade(self._values, kept)

    def with_parameters(self, values: Mapping[str, float]) -> Mechanism:
        """Return the block with some parameters changed; unknown names raise ValueError with those known."""
        inertias, effects = self._changed(values)
        return self._remade(inertias, effects)

    def effects_at(self, values: Mapping[str, float]) -> dict[str, Effect]:
        """Return the effects by name with some parameters changed."""
        return dict(zip(self._keys, self._changed(values)[1], strict=True))

    def core_at(self, values: Mapping[str, float], effects: Iterable[Effect]) -> Core:
        """Return the core of the block with some inertias changed and these effects.

        For fits, which need the numbers of many parameter sets: a system of python-control that is made for
        each takes as long as all else. Levels of friction and repeated effects are not checked again.
        """
        changed = self._checked({k: values[k] for k in self._values if k in values})
        return self._build({**self._values, **changed}, tuple(effects))

    def _checked(self, inertias: Mapping[str, float]) -> dict[str, float]:
        """Return inertias as numbers, each within its bounds."""
        owner, unit = type(self).__name__, self._coordinates.unit_of("kg")
        return {
            k: checked(owner, k, v, {**_MASS, "unit": unit, "meaning": k.replace("_", " ")})
            for k, v in inertias.items()
        }

    def with_measured(self, measured: str) -> Mechanism:
        """Return the block with its sensor on the other body (``load`` or ``motor``)."""
        return self._make(self._values, self._effects, measured, self.given_name)

    def with_name(self, name: str) -> Mechanism:
        """Return the block under another name."""
        return self._make(self._values, self._effects, self._measured, name)

    def _changed(self, values: Mapping[str, float]):
        known = self.parameters
        for name in mapping("with_parameters", "values", values):
            known_name("with_parameters", "names", name, known)
        inertias = {k: values.get(k, v) for k, v in self._values.items()}
        effects = []
        for key, effect in zip(self._keys, self._effects, strict=True):
            mine = {n.split(".", 1)[1]: v for n, v in values.items() if n.startswith(key + ".")}
            effects.append(self._lately_replaced(key, effect, mine) if mine else effect)
        return inertias, tuple(effects)

    @cached_property
    def _lately(self) -> dict[Any, Effect]:
        """Effects with other values, by name and these."""
        return {}

    def _lately_replaced(self, key: str, effect: Effect, values: dict[str, Any]) -> Effect:
        """Return an effect with other values: derivatives by many parameters move one effect at a time."""
        # zero has two signs, and what records have for themselves is equal to its mean
        if not all(type(v) in _PLAIN and v != 0 for v in values.values()):
            return self._replaced(effect, values)
        told = key, *values.items()
        found = self._lately.get(told)
        if found is None:
            if len(self._lately) >= KEPT_EFFECTS:
                self._lately.clear()
            found = self._lately[told] = self._replaced(effect, values)
        return found

    def _replaced(self, effect: Effect, values: dict[str, Any]) -> Effect:
        """Return an effect of this machine with other values; what is refused has the machine's units."""
        try:
            return effect.replace(**values)
        except (TypeError, ValueError) as error:
            refused = error
        stated = dict(stated_parameters(type(effect)))
        for name, value in values.items():
            spec, mine = stated[name], self._coordinates
            own = {**spec, "unit": mine.unit_of(spec["unit"]), "meaning": mine.text(spec["meaning"])}
            checked(type(effect).__name__, name, value, own, effect.remedy)
        raise refused

    def _remade(self, inertias, effects) -> Mechanism:
        return self._make(inertias, effects, self._measured, self.given_name)

    @classmethod
    def _make(cls, inertias, effects, measured, name=None) -> Mechanism:
        return cls(**inertias, effects=effects, measured=measured, name=name)  # type: ignore[call-arg]

    def __reduce__(self):
        made = (type(self), self._values, self._effects, self._measured, self.given_name)
        return _unpickle, made, self._called

    def __eq__(self, other: Any) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        mine = (self._values, self._effects, self._measured, self.given_name)
        return mine == (other._values, other._effects, other._measured, other.given_name)

    def __hash__(self) -> int:
        return hash((type(self), tuple(self._values.items()), self._effects, self._measured, self.given_name))

    def __repr__(self) -> str:
        inertias = ", ".join(f"{k}={v:g}" for k, v in self._values.items())
        return f"{type(self).__name__}({inertias})" + "".join(f".with_effect({e})" for e in self._effects)

    def __str__(self) -> str:
        signals = ", ".join(f"{name} [{unit}]" for name, unit in self.signals.items())
        return f"{type(self).__name__} {self.name}: {signals}\n{self._table()}"

    def _repr_html_(self) -> str:
        return self._table()._repr_html_()

    def _table(self) -> Table:
        rows = ((k, f"{p.value:g}", p.unit, p.meaning) for k, p in self.parameters.items())
        return Table(("parameter", "value", "unit", "meaning"), tuple(rows))

    # --- the dialect of python-control -------------------------------------------------------------------

    def _core_for(self, params) -> Core:
        if not params:
            return self._core
        known = self.parameters
        changed = {
            k: number(type(self).__name__, k, v)
            for k, v in params.items()
            if k in known and known[k].value != v
        }
        return self._core if not changed else _core_with(self, tuple(sorted(changed.items())))

    def linearize(self, x0, u0=None, t=0, params=None, eps=1e-6, copy_names=False, **kwargs):
        """Linearize the compliant form; see `ct.linearize`. Warns where the machine itself has no slope."""
        warn_of_mechanism(self._core_for(params), self._effects, x0, self.name)
        return super().linearize(x0, u0, t, params, eps, copy_names, **kwargs)

    def _updfcn(self, t, x, u, params):
        return np.array(compliant.rates(self._core_for(params), t, x, float(u[0])))

    def _outfcn(self, t, x, u, params):
        return np.array(compliant.outputs(self._core_for(params), t, x))


class Mass(Mechanism):
    """A mass on a line, driven by a force; add physics with `with_effect`.

    ``mass dv/dt = F + effects``; input ``F`` [N]; outputs ``x`` [m], ``v`` [m/s]. With `Backlash` or
    `Compliance` the mass divides into motor and load, and ``x_motor``, ``v_motor`` are outputs too.

    Parameters
    ----------
    mass : float
        [kg], > 0.
    effects : sequence of Effect
        What acts on it.
    measured : {'load', 'motor'}
        Where the sensor sits once a joint divides the mass.
    name : str
        System name.

    Raises
    ------
    ValueError
        Mass not positive, contradictory effects; the message gives rule, value, remedy.

    Examples
    --------
    >>> axis = cdf.Mass(9).with_effect(cdf.Coulomb(5)).with_effect(cdf.Viscous(0.5))
    >>> axis.input_labels, axis.output_labels, axis.state_labels
    (['F'], ['x', 'v'], ['x', 'v'])
    >>> {name: p.value for name, p in axis.parameters.items()}
    {'mass': 9.0, 'coulomb.level': 5.0, 'viscous.coefficient': 0.5}
    >>> axis.without_effect("viscous").with_parameters({"mass": 10})
    Mass(mass=10).with_effect(Coulomb(level=5.0))
    """

    _inertias = ("mass",)

    def __init__(self, mass, effects=(), *, measured="load", name=None):
        super().__init__({"mass": mass}, effects, measured=measured, name=name)

    @property
    def mass(self) -> float:
        """Inertia [kg]."""
        return self._values["mass"]


class TwoMass(Mechanism):
    """A motor and a load on a line, rigidly joined until `Backlash` or `Compliance` loosens the joint.

    Input ``F`` [N] on the motor; outputs ``x`` (load position), ``v``, ``x_motor``, ``v_motor``. Friction and
    springs act on the motor, or with ``side="load"`` on the load.

    Parameters
    ----------
    motor_mass, load_mass : float
        [kg], > 0.
    effects, measured, name
        As in `Mass`.

    Raises
    ------
    TypeError, ValueError
        A mass not a positive number, contradictory effects; the message gives rule, value, remedy.

    Examples
    --------
    >>> drive = cdf.TwoMass(1.0, 8.0).with_effect(cdf.Compliance(500.0))
    >>> drive.output_labels
    ['x', 'v', 'x_motor', 'v_motor']
    """

    _inertias = ("load_mass", "motor_mass")

    def __init__(self, motor_mass, load_mass, effects=(), *, measured="load", name=None):
        super().__init__(
            {"load_mass": load_mass, "motor_mass": motor_mass}, effects, measured=measured, name=name
        )

    @property
    def motor_mass(self) -> float:
        """Inertia of the motor [kg], M2 of the paper."""
        return self._values["motor_mass"]

    @property
    def load_mass(self) -> float:
        """Inertia of the load [kg], M1 of the paper."""
        return self._values["load_mass"]


def friction_mass(mass, coulomb, viscous=0.0, static=None, *, name=None) -> Mass:
    """Build a mass with Coulomb and viscous friction, and stiction if `static` is given.

    Parameters
    ----------
    mass : float
        M [kg], > 0.
    coulomb : float
        Kinetic level K [N], >= 0.
    viscous : float
        B [N s/m], >= 0.
    static : float or None
        Breakaway level Ks [N], >= `coulomb`; None: no stiction (Ks = K).

    Raises
    ------
    TypeError, ValueError
        A value that is not a number or out of its range, a static level below `coulomb`.

    References
    ----------
    Azenha & Machado (1997), Fig. 2 and eq. (6).

    Examples
    --------
    >>> axis = cdf.friction_mass(mass=9, coulomb=5, viscous=0.5, static=7.5)
    >>> [e.id for e in axis.effects]
    ['coulomb', 'viscous', 'stiction']
    """
    effects: list[Effect] = [Coulomb(coulomb), Viscous(viscous)]
    if static is not None:
        effects.append(Stiction(static))
    return Mass(mass, effects, name=name)


def backlash_masses(motor_mass, load_mass, gap, restitution=0.0, *, name=None) -> TwoMass:
    """Two masses with a gap between them: the force drives the motor, the load is measured.

    Parameters
    ----------
    motor_mass, load_mass : float
        M2 and M1 of the paper [kg], > 0.
    gap : float
        Total clearance h [m], > 0: contact at ``x_motor = x`` and at ``x_motor = x + gap``.
    restitution : float
        Newton's coefficient, 0 (plastic) to 1 (elastic).

    Raises
    ------
    TypeError, ValueError
        A mass or gap that is not a positive number, a restitution outside 0 to 1.

    References
    ----------
    Azenha & Machado (1997), Fig. 6 and eqs. (9)-(13).

    Examples
    --------
    >>> cdf.backlash_masses(motor_mass=1, load_mass=8, gap=0.018, restitution=0.2)
    TwoMass(load_mass=8, motor_mass=1).with_effect(Backlash(gap=0.018, restitution=0.2, load_fraction=0.5))
    """
    return TwoMass(motor_mass, load_mass, [Backlash(gap, restitution)], name=name)


def _unpickle(cls, inertias, effects, measured, name):
    return cls._make(inertias, effects, measured, name)


@lru_cache(maxsize=64)
def _core_with(block: Mechanism, changed) -> Core:
    inertias, effects = block._changed(dict(changed))
    type(block)._make(inertias, effects, block.measured)  # checks them
    return block._build(inertias, effects)


def _as_effects(effects) -> tuple[Effect, ...]:
    if isinstance(effects, Effect):
        return (effects,)
    given: tuple[Any, ...] = (
        tuple(effects) if isinstance(effects, Iterable) and not isinstance(effects, str) else (effects,)
    )
    for effect in given:
        if not isinstance(effect, Effect):
            raise TypeError(
                "effects must be instances of ctrl_df's effects, such as [Coulomb(5), Viscous(0.5)]; got "
                f"{shown(effect)}. Call the class with its parameters."
            )
    return given


def _effect_keys(effects) -> tuple[str, ...]:
    keys: list[str] = []
    for effect in effects:
        count = sum(e.id == effect.id for e in effects[: len(keys)])
        keys.append(effect.id if count == 0 else f"{effect.id}_{count + 1}")
    return tuple(keys)


def _check_repeated(effects) -> None:
    seen = set()
    for effect in effects:
        if (effect.id, effect.side) in seen and not effect.repeatable:
            name = type(effect).__name__
            raise ValueError(
                f"a block takes one {name} on a side; got two on the {effect.side}. Combine them in one; a "
                "class of your own of which a block may hold several of states repeatable = True."
            )
        seen.add((effect.id, effect.side))


def _check_levels(effects) -> None:
    kinetic = kinetic_level(effects)
    for effect in effects:
        for name in static_levels(type(effect)):
            if getattr(effect, name) < kinetic:
                raise ValueError(
                    "a static level must be >= the Coulomb level of the block; "
                    f"got {effect.id} {name} {getattr(effect, name):g} "
                    f"below {kinetic:g}. Without stiction leave it out (static=None)."
                )
