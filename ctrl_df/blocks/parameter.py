"""A physical parameter: value, unit, bounds; how effects declare theirs."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

from ..checks import CHECK_VALUE, above, number
from ..units import dimension

KNOWN_AS = ("gap", "restitution", "load_fraction")
"""What the engine must know of contacts and joints: clearance [m], rebound speed over impact speed, the share
of a single mass that lies behind a joint."""


@dataclass(frozen=True)
class Parameter:
    """One named number of a block.

    Parameters
    ----------
    value : float
        SI value.
    unit : str
        SI unit, ``""`` if dimensionless.
    lower, upper : float
        Bounds, inclusive unless `strict`.
    strict : bool
        Whether `lower` itself is excluded; without a lower bound, zero.
    free : bool
        Whether a refit moves it unless told otherwise.
    meaning : str
        What it is, in a few words.
    threshold : bool
        Whether it is a static level, which shows only when the body breaks away: records leave ranges of it
        undetermined. It may not lie below the kinetic level.
    per_record : bool
        Whether it is an angle that differs from record to record (an encoder counts from another zero).
    origin : bool
        Whether it is the position from which a law counts, which depends on the zero of the encoder. A refit
        keeps the value of the model, unless told otherwise; a diagnosis estimates it for an effect that it
        adds, where that explains more than a parameter costs.
    between : bool
        Whether a diagnosis, of an effect that it adds, estimates it between its bounds alone: at either of
        them the law is a simpler one.
    stepped : bool
        Whether outputs change in steps with it, so that it is read from the record and not fitted by least
        squares.
    known_as : str
        Its role in the engine, ``gap``, ``restitution`` or ``load_fraction``; "" where only its law uses it.
    line_unit : str
        Unit of the same parameter in a machine on a line, `unit` by default; its size follows from that.

    Examples
    --------
    >>> level = cdf.friction_mass(mass=9, coulomb=5).parameters["coulomb.level"]
    >>> level.value, level.unit, level.bounds
    (5.0, 'N', (0.0, inf))
    """

    value: float
    unit: str
    lower: float = -math.inf
    upper: float = math.inf
    strict: bool = False
    free: bool = True
    meaning: str = ""
    threshold: bool = False
    per_record: bool = False
    origin: bool = False
    between: bool = False
    stepped: bool = False
    known_as: str = ""
    line_unit: str = ""

    def __post_init__(self):
        if not self.line_unit:
            object.__setattr__(self, "line_unit", self.unit)

    @property
    def bounds(self) -> tuple[float, float]:
        """Least and greatest value, ``(lower, upper)`` [unit]; `strict`: without the least itself."""
        return self.lower, self.upper

    @property
    def one_sign(self) -> bool:
        """Whether a value may have any size but not change its sign."""
        return self.strict and self.lower in (0.0, -math.inf) and math.isinf(self.upper)

    @property
    def estimated(self) -> bool:
        """Whether a fit moves it that has added its effect to a model: an origin only once it is off zero."""
        inside = self.between and self.lower < self.value < self.upper
        return self.free or inside or (self.origin and self.value != 0)

    def __float__(self) -> float:
        return self.value


def parameter(
    unit,
    *,
    lower=0.0,
    upper=math.inf,
    strict=False,
    free=True,
    default: Any = dataclasses.MISSING,
    meaning="",
    threshold=False,
    per_record=False,
    origin=False,
    between=False,
    stepped=False,
    known_as="",
) -> Any:
    """Declare a dataclass field that is a physical parameter (unit, bounds, what it means).

    Parameters
    ----------
    unit : str
        SI unit of the parameter in a machine on a line, ``""`` if dimensionless.
    default : float
        Value of a field that is left out; without one the field has to be given.
    lower, upper, strict, free, meaning, threshold, per_record, origin, between, stepped, known_as
        As in `Parameter`.

    Raises
    ------
    ValueError
        The unit is unknown: the sizes that a fit begins with follow from it. Or `known_as` is none of
        ``gap``, ``restitution``, ``load_fraction``.

    Examples
    --------
    >>> from dataclasses import dataclass
    >>> @dataclass(frozen=True)
    ... class Spring(cdf.Effect):
    ...     role = "force"
    ...     stiffness: float = cdf.parameter("N/m", meaning="of the spring")
    ...     @staticmethod
    ...     def law(t, x, v, z, p, dz):
    ...         return -p[0] * x
    >>> Spring(200.0).parameters["stiffness"].unit
    'N/m'
    """
    dimension(unit)
    if known_as and known_as not in KNOWN_AS:
        raise ValueError(
            f"a parameter may be known_as {', '.join(KNOWN_AS)}; got {known_as!r}. Leave it out where the "
            "law alone uses the parameter."
        )
    stated = dict(
        unit=unit, lower=lower, upper=upper, strict=strict, free=free, meaning=meaning, threshold=threshold,
        per_record=per_record, origin=origin, between=between, stepped=stepped, known_as=known_as,
    )  # fmt: skip
    return dataclasses.field(default=default, metadata={"parameter": stated})


def plainly_within(value, spec: dict) -> bool:
    """Whether a value is a finite float within its bounds, which `checked` returns as it is.

    Fits make effects by the thousand, whose values are such numbers.
    """
    within = type(value) is float and above(value, spec["lower"], spec["strict"]) and value <= spec["upper"]
    return within and abs(value) < math.inf


def checked(owner: str, name: str, value, spec: dict, remedy: str = "") -> float:
    """Return `value` as a float, or raise TypeError or ValueError naming rule, value and remedy."""
    return number(
        owner, name, value, spec["unit"], lower=spec["lower"], upper=spec["upper"], strict=spec["strict"],
        meaning=spec["meaning"], remedy=remedy or CHECK_VALUE,
    )  # fmt: skip
