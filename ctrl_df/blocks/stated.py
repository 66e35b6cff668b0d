"""What the class of an effect states of its parameters, and whether it states what its role needs."""

from __future__ import annotations

import dataclasses
import functools
from typing import Any

from .thresholds import SHARE_MOST

ROLES = ("force", "friction", "contact", "coupling", "presliding", "input", "output")
TOLD = ("x", "drive", "load")


@functools.cache
def stated_parameters(cls: type) -> tuple[tuple[str, dict[str, Any]], ...]:
    """Return the names of the parameters of an effect class, in declaration order, with what is stated."""
    share, stated = share_name(cls), []
    for f in dataclasses.fields(cls):
        if "parameter" in f.metadata:
            spec = f.metadata["parameter"]
            if f.name == share:  # something lies on either side
                spec = {**spec, "upper": min(spec["upper"], SHARE_MOST)}
                spec |= {"lower": 0.0, "strict": True} if spec["lower"] <= 0 else {}
            stated.append((f.name, spec))
    return tuple(stated)


@functools.cache
def _name_of(cls: type, what: str) -> str:
    """Return the name of the attribute that holds what the engine must know; "" where there is none."""
    fields = dataclasses.fields(cls)
    for f in fields:
        if f.metadata.get("parameter", {}).get("known_as") == what:
            return f.name
    return what if any(f.name == what for f in fields) or hasattr(cls, what) else ""


def known(effect: Any, what: str) -> float:
    """Return a number that the engine must know of a contact or joint: one of `KNOWN_AS`.

    Raises
    ------
    ValueError
        The effect does not state it.
    """
    name = _name_of(type(effect), what)
    if not name:
        raise ValueError(_missing(type(effect), what))
    return getattr(effect, name)


def share_name(cls: type) -> str:
    """Return the name of the parameter of a joint that is the share of a single mass behind it, or ""."""
    return _name_of(cls, "load_fraction") if cls.role == "coupling" or cls.divides else ""


def _missing(cls, what) -> str:
    remedy = f"Declare a parameter(..., known_as={what!r}), or a field or property of that name."
    if what == "load_fraction":
        return (
            f"a single mass needs to know which share of it lies behind {cls.__name__} (load_fraction); it "
            f"is not stated. {remedy} In a TwoMass it needs none."
        )
    kind = "joint with a gap" if cls.divides else "stop"
    return f"{cls.__name__} is a {kind} without a law of its own and needs {what}; got none. {remedy}"


@functools.cache
def require_complete(cls: type) -> None:
    """Raise ValueError where a class does not state its role, or what the role needs."""
    if cls.role not in ROLES:
        raise ValueError(
            f"{cls.__name__} needs a role out of {', '.join(ROLES)}; got {cls.role!r}. State it "
            'in the class, as role = "force".'
        )
    if not set(cls.asks) <= set(TOLD) or (cls.asks and cls.role != "friction"):
        raise ValueError(
            f"{cls.__name__} may ask for {', '.join(TOLD)}, if its role is friction; got role {cls.role!r}, "
            f"asks={cls.asks!r}."
        )
    if cls.role in ("force", "friction", "coupling", "presliding") and cls.law is None:
        raise ValueError(
            f"{cls.__name__} has role {cls.role!r} and needs a law; got none. Define a static function law, "
            "as listed in ctrl_df/blocks/effect.py."
        )
    if cls.role != "contact":
        return
    if cls.divides and cls.law is not None:
        raise ValueError(
            f"{cls.__name__} divides the mass by a gap and cannot have a law; got one. Put a coupling with "
            "that law beside a gap without."
        )
    if not cls.divides and not _name_of(cls, "span"):
        raise ValueError(
            f"{cls.__name__} is a stop and needs span (lower and upper stop [m]); got none. Define a "
            "property span that returns both; a gap between motor and load states divides = True."
        )
    for what in ("gap", "restitution") if cls.divides else ("restitution",) if cls.law is None else ():
        if not _name_of(cls, what):
            raise ValueError(_missing(cls, what))


@functools.cache
def static_levels(cls: type) -> tuple[str, ...]:
    """Return the parameters of an effect class that are static levels, none below the kinetic one."""
    return tuple(name for name, spec in stated_parameters(cls) if spec.get("threshold"))
