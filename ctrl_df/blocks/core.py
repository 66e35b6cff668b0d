"""A mechanism as numbers: what the event engine and the compliant form both read.

Bodies are numbered from the output side: body 0 carries the output `x`; in a two-mass block body 1 is the
motor, which the force drives. States: ``x, v`` of body 0, then of body 1, then the internal states of force
effects, those of presliding, and one state for every lag or delay of the channels.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from .effect import Effect
from .primitives import Delay, Lag, Play, Primitive, RateLimiter
from .stated import known

RIGID, IMPACT, ELASTIC = "rigid", "impact", "elastic"
BOTH = -1


@dataclass(frozen=True)
class ForceTerm:
    """A law with the body it acts on (`BOTH` of a joint) and the offset of its internal states."""

    effect: Effect
    body: int
    state: int


@dataclass(frozen=True)
class Core:
    """Masses, laws, contacts and channels of one mechanism."""

    masses: tuple[float, ...]
    joint: str | None
    forces: tuple[ForceTerm, ...]
    friction: tuple[tuple[Effect, ...], ...]
    gap: float = 0.0
    restitution: float = 0.0
    stop: Any = None
    stop_restitution: float = 0.0
    presliding: ForceTerm | None = None
    coupling: ForceTerm | None = None
    contact: ForceTerm | None = None
    input_channel: tuple[tuple[Primitive, int], ...] = ()
    output_channel: tuple[tuple[Primitive, int], ...] = ()
    measured: int = 0
    nstates: int = 2
    state_names: tuple[str, ...] = field(default=("x", "v"))

    @property
    def bodies(self) -> int:
        """Number of bodies, 1 or 2."""
        return len(self.masses)

    @property
    def loose(self) -> bool:
        """Whether two bodies move against each other."""
        return self.joint in (IMPACT, ELASTIC)

    @property
    def reduced_mass(self) -> float:
        """Mass with which two bodies move against each other."""
        return self.masses[0] * self.masses[-1] / sum(self.masses)

    @property
    def motions(self) -> tuple[str, ...]:
        """Names of the positions and speeds, the first states."""
        return ("x", "v", "x_motor", "v_motor")[: 2 * self.bodies]

    @property
    def wall(self) -> tuple[float, float]:
        """Where stops stand, rigid or yielding; zeros where there are none."""
        wall: Any = self.stop if self.contact is None else self.contact.effect
        return wall.span if wall is not None else (0.0, 0.0)

    @property
    def position_dependent(self) -> bool:
        """Whether a law depends on the place, or may do so: where a run begins then matters."""
        asked = any("x" in effect.asks for chain in self.friction for effect in chain)
        stopped = self.stop is not None or self.contact is not None
        return stopped or asked or any(not term.effect.place_free for term in self.forces)

    @property
    def driven(self) -> int:
        """Index of the body the force acts on."""
        return self.bodies - 1


def build_core(masses: tuple[float, ...], two_mass: bool, effects: Sequence[Effect], measured: str) -> Core:
    """Lay out states and sort effects by role; `masses` is (mass,) or (load, motor)."""
    backlash = _only(e for e in effects if e.role == "contact" and e.divides)
    compliance = _only(e for e in effects if e.role == "coupling")
    joint: str | None = None
    if compliance is not None:
        joint = ELASTIC
    elif backlash is not None:
        joint = IMPACT
    elif two_mass:
        joint = RIGID
    if joint is not None and not two_mass:
        dividing: Any = compliance or backlash
        share = known(dividing, "load_fraction")
        masses = (share * masses[0], (1 - share) * masses[0])
    motor = len(masses) - 1
    names = ["x", "v"] + (["x_motor", "v_motor"] if motor else [])

    forces = []
    friction: list[list[Effect]] = [[] for _ in masses]
    for effect in effects:
        body = 0 if effect.side == "load" else motor
        if effect.role == "force" or (effect.role == "input" and effect.law is not None):
            forces.append(ForceTerm(effect, body, len(names)))
            names += [f"{effect.id}_{i}" for i in range(effect.states)]
        elif effect.role == "friction":
            friction[body].append(effect)
    presliding = _only(e for e in effects if e.role == "presliding")
    stop = _only(e for e in effects if e.role == "contact" and not e.divides)
    yielding = stop if stop is not None and stop.law is not None else None
    terms = {}
    for effect, body in ((presliding, motor), (compliance, BOTH), (yielding, motor)):
        if effect is not None:
            terms[effect.role] = ForceTerm(effect, body, len(names))
            many = effect.states > 1
            names += [f"{effect.id}_{i}" if many else effect.id for i in range(effect.states)]
    channels: dict[str, list[tuple[Primitive, int]]] = {"input": [], "output": []}
    for effect in effects:
        if effect.role in channels:
            for primitive in effect.channel():
                has_state = isinstance(primitive, Lag | Delay | Play | RateLimiter)
                channels[effect.role].append((primitive, len(names) if has_state else -1))
                if has_state:
                    names.append(effect.id)
    return Core(
        masses=tuple(masses),
        joint=joint,
        forces=tuple(forces),
        friction=tuple(tuple(sorted(group, key=lambda e: e.rank)) for group in friction),
        gap=known(backlash, "gap") if backlash else 0.0,
        restitution=known(backlash, "restitution") if backlash else 0.0,
        stop=stop if yielding is None else None,
        stop_restitution=known(stop, "restitution") if stop and not yielding else 0.0,
        **terms,
        input_channel=tuple(channels["input"]),
        output_channel=tuple(channels["output"]),
        measured=motor if measured == "motor" else 0,
        nstates=len(names),
        state_names=tuple(_unique(names)),
    )


def level(
    effects: Sequence[Effect],
    moving: float,
    direction: float,
    speed: float,
    place: float = 0.0,
    drive: float = 0.0,
    load: float = 0.0,
) -> float:
    """Dry friction level [N] of a chain of friction effects; laws that ask are told place, drive, load."""
    value = 0.0
    for effect in effects:
        arguments = (place, drive, load) if effect.asks else ()
        value = type(effect).law(moving, direction, speed, value, effect.values, *arguments)  # type: ignore[misc]
    return value


def is_kinetic(effect: Effect) -> bool:
    """Whether an effect is of the dry friction on the moving motor; static levels add to it."""
    return effect.role == "friction" and effect.side == "motor" and effect.rank == 0


def kinetic_level(effects: Sequence[Effect]) -> float:
    """Dry friction level [N] on the moving motor."""
    return level([e for e in effects if is_kinetic(e)], 1.0, 1.0, 0.0)


def _only(kind) -> Any:
    found = list(kind)
    if len(found) > 1:
        names = " and ".join(dict.fromkeys(type(e).__name__ for e in found))
        raise ValueError(
            f"a block takes one {names} at most; got {len(found)}. Change it with with_parameters."
        )
    return found[0] if found else None


def _unique(names):
    seen: dict[str, int] = {}
    for name in names:
        seen[name] = seen.get(name, 0) + 1
        yield name if seen[name] == 1 else f"{name}_{seen[name]}"
