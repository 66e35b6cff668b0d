"""MODEL.toml: a plant, its controller, the box to search and the columns of a record, in one text file."""

from __future__ import annotations

import dataclasses
import inspect
import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .blocks.effect import Effect, effect_class
from .blocks.massless import Massless
from .blocks.mechanism import Mass, Mechanism, TwoMass
from .blocks.pid import pid
from .blocks.rotary import Inertia, TwoInertias
from .checks import choice, is_number, number, path_of, shown
from .units import si_unit

EXAMPLE = """\
[plant]
kind = "mass"              # "two_mass" (then motor_mass, load_mass), "inertia", "two_inertias"
mass = 9.0                 # kg
# measured = "motor"       # where the sensor sees the motor of a joint, found or given; else the load

[effects.coulomb]          # any effect id, parameters by name, SI units; several: one table each
level = 5.0                # N
# side = "load"            # of two masses the one it acts on; else the motor
[effects.viscous]
coefficient = 0.5          # N s/m

[controller]               # F = kp e + ki (integral of e) + kd (rate of e)
kp = 2000.0
ki = 44250.0               # optional, as all below
kd = 130.0
tf = 0.0                   # filter of the derivative [s]; 0: ideal, on the measured velocity
dt = 0.0                   # sample time of a digital controller [s]; 0: continuous

[box]                      # where limit cycles are sought
amplitude = [5.2, 100.0]   # at the plant's input [N], peak
omega = [4.0, 40.0]        # rad/s
points = [40, 60]          # of the grid, optional

[data]                     # columns of DATA.csv for improve
time = "t"
input = "F"
output = "x"
input_unit = "N"           # optional; also time_unit, velocity, velocity_unit, input_hold, decimal
output_unit = "mm"         # its unit tells the quantity: mm/s is a velocity, V a voltage
# outputs = { x = "x", v = ["tacho", "mm/s"] }  # instead of output: several, by quantity
closed_loop = false        # true: the input is the reference of the loop with [controller], in output_unit
"""

MOST_POINTS = 1_000_000
"""Grid points of a box: some 200 MB, and more than any search for cycles needs."""

_GAINS = ("kp", "ki", "kd", "tf", "dt")
_PLANTS: dict[str, type[Mechanism]] = {
    "mass": Mass, "two_mass": TwoMass, "inertia": Inertia, "two_inertias": TwoInertias,
    "massless": Massless,
}  # fmt: skip
_SECTIONS = ("plant", "effects", "controller", "box", "data")
_COLUMNS = ("time", "input", "output", "outputs", "velocity", "channels", "delimiter", "decimal")
_DATA = (
    *_COLUMNS,
    "name",
    "input_unit",
    "output_unit",
    "time_unit",
    "velocity_unit",
    "input_hold",
    "closed_loop",
)


@dataclass(frozen=True)
class ModelFile:
    """What a MODEL.toml says.

    Attributes
    ----------
    path : str
    plant : Mechanism
    controller : ct.TransferFunction or None
    dt : float
        Sample time of the controller [s], 0: continuous.
    amplitudes, omega : ndarray or None
        The grid of [box].
    columns : dict
        Keywords for ``Measurement.from_csv``.
    closed_loop : bool
        Whether records were taken with the loop closed.
    """

    path: str
    plant: Mechanism
    controller: Any = None
    dt: float = 0.0
    amplitudes: np.ndarray | None = None
    omega: np.ndarray | None = None
    columns: dict[str, Any] = field(default_factory=dict)
    closed_loop: bool = False


def read_model(path) -> ModelFile:
    """Read a MODEL.toml.

    Raises
    ------
    ValueError
        No TOML, an unknown section, effect or key, a value out of range; the message names file and section.
    OSError
        The file cannot be read.
    """
    raw = path_of("read_model", "path", path).read_bytes()
    try:
        table = tomllib.loads(raw.decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        raise ValueError(
            f"{path} is no TOML file: it must be text in UTF-8, byte {error.start} is not. Save it as UTF-8."
        ) from None
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise ValueError(f"{path} is no TOML file: {error}. See ctrl-df --help for an example.") from None
    _known(path, "file", table, _SECTIONS)
    plant = _within(path, "plant and effects", lambda: _plant(table))
    controller = dt = None
    if "controller" in table:
        controller, dt = _within(path, "[controller]", lambda: _controller(table["controller"], plant))
    amplitudes, omega = _within(path, "[box]", lambda: _box(table.get("box")))
    data = _within(path, "[data]", lambda: _data(table.get("data", {})))
    closed = bool(data.pop("closed_loop", False))
    if closed and controller is None:
        raise ValueError(f"{path}, [data]: closed_loop = true needs a [controller] section; add it.")
    if closed:  # a reference is of the output, unless said otherwise
        data.setdefault("input_unit", data.get("output_unit", plant.coordinates.unit))
    return ModelFile(str(path), plant, controller, dt or 0.0, amplitudes, omega, data, closed)


def _plant(table) -> Mechanism:
    if "plant" not in table:
        raise ValueError(f"a model needs a section [plant] with kind = {' or '.join(map(repr, _PLANTS))}.")
    given = dict(_mapping(table["plant"], "plant"))
    kind = given.pop("kind", "mass")
    if not isinstance(kind, str) or kind not in _PLANTS:
        raise ValueError(f"kind must be one of {', '.join(_PLANTS)}; got {shown(kind)}. Write it in quotes.")
    cls = _PLANTS[kind]
    needed = [n for n, p in inspect.signature(cls).parameters.items() if p.default is inspect.Parameter.empty]
    _known(None, kind, given, (*needed, "measured", "name"))
    any_values: dict[str, Any] = dict.fromkeys(needed, 1.0)
    unit_of = cls(**any_values).coordinates.unit_of
    for name in needed:
        if name not in given:
            raise ValueError(f"{kind} needs {name} [{unit_of('kg')}]; add it.")
        _unquoted(kind, name, given[name])
    return cls(**given, effects=_effects(table.get("effects", {}), unit_of))


def _effects(given, unit_of) -> list[Effect]:
    """Build effects from tables [effects.ID] or from a list [[effects]] with id."""
    if isinstance(given, Mapping):
        pairs = [(key, dict(_mapping(values, f"effects.{key}"))) for key, values in given.items()]
    elif isinstance(given, list):
        pairs = []
        for entry in given:
            values = dict(_mapping(entry, "effects"))
            if "id" not in values:
                raise ValueError('every table of [[effects]] needs an id, such as id = "coulomb".')
            pairs.append((values.pop("id"), values))
    else:
        raise ValueError(
            f"effects must be tables [effects.ID] with parameters; got {shown(given)}. See --help."
        )
    made = []
    for key, values in pairs:
        cls = effect_class(key)
        fields = dataclasses.fields(cls)
        _known(None, f"effect {key}", values, [f.name for f in fields])
        for name, value in values.items():
            if name != "side":
                _unquoted(f"effect {key}", name, value)
        for f in fields:
            if f.name not in values and f.default is f.default_factory is dataclasses.MISSING:
                unit = f.metadata.get("parameter", {}).get("unit", "")
                raise ValueError(f"effect {key} needs {f.name} [{unit_of(unit) or '-'}]; add it.")
        made.append(cls(**values))
    return made


def _controller(given, plant):
    given = dict(_mapping(given, "controller"))
    _known(None, "controller", given, _GAINS)
    if "kp" not in given:
        raise ValueError(
            f"a controller needs kp [{plant.coordinates.unit_of('N/m')}]; add it (0 if there is none)."
        )
    numbers = {k: _number(k, v) for k, v in given.items()}
    dt = numbers.pop("dt", 0.0)
    number(
        "controller", "dt", dt, "s", lower=0.0, meaning="sample time", remedy="Use 0 for a continuous one."
    )
    return pid(**numbers), dt


def _box(given):
    if given is None:
        return None, None
    given = _mapping(given, "box")
    _known(None, "box", given, ("amplitude", "omega", "points"))
    points = given.get("points", [40, 60])
    whole = isinstance(points, list) and all(type(n) is int and n >= 2 for n in points)
    if not whole or len(points) != 2:
        raise ValueError(
            f"points must be two integers >= 2 (amplitudes, frequencies); got {shown(points)}. "
            "Leave it out for [40, 60]."
        )
    if points[0] * points[1] > MOST_POINTS:
        side = math.isqrt(MOST_POINTS)
        raise ValueError(
            f"points may be {MOST_POINTS:,} in all, such as [{side}, {side}]; got {points!r}, "
            f"{points[0] * points[1]:.3g}. [40, 60] finds cycles; a finer grid only splits what lies close."
        )
    edges = []
    for key, count in zip(("amplitude", "omega"), points, strict=True):
        pair = given.get(key)
        if not (isinstance(pair, list) and len(pair) == 2):
            raise ValueError(f"{key} must be a pair [low, high]; got {shown(pair)}. Give both ends.")
        low, high = (v if is_number(v) else _number(key, v) for v in pair)
        if not 0 < low < high < np.inf:
            raise ValueError(f"{key} needs 0 < low < high, both finite; got {pair!r}. Put them in order.")
        edges.append(np.geomspace(low, high, count))
    return tuple(edges)


def _data(given):
    given = dict(_mapping(given, "data"))
    _known(None, "data", given, _DATA)
    for key, value in given.items():
        if key in ("time", "input", "output", "velocity"):
            good, what = isinstance(value, str) or type(value) is int, "a column's name or number"
        elif key == "channels":
            good = isinstance(value, list) and all(isinstance(v, str) or type(v) is int for v in value)
            what = "a list of columns"
        elif key == "outputs":
            good = isinstance(value, Mapping) and all(map(_column, value.values()))
            what = 'a table of columns by quantity, such as { x = "x", v = ["tacho", "mm/s"] }'
        elif key == "closed_loop":
            good, what = isinstance(value, bool), "true or false, without quotes"
        else:
            good, what = isinstance(value, str), "text in quotes"
        if not good:
            raise ValueError(f"{key} must be {what}; got {shown(value)}. Correct it.")
        if key.endswith("_unit"):
            si_unit(str(value))
        if key == "input_hold":
            choice("data", key, value, ("zoh", "linear"))
    return given


def _column(value) -> bool:
    """Whether a value is a column, or a pair of a column and its unit."""
    if isinstance(value, list) and len(value) == 2 and isinstance(value[1], str):
        value = value[0]
    return isinstance(value, str) or type(value) is int


def _number(name, value) -> float:
    owner = "controller" if name in _GAINS else "box"
    _unquoted(owner, name, value)
    return number(owner, name, value)


def _unquoted(owner, name, value) -> None:
    """Refuse text in the place of a number, with how this file writes one."""
    if isinstance(value, str):
        raise ValueError(
            f"{owner} needs {name} as one real number; got the text {shown(value)}. Write it without quotes."
        )


def _mapping(value, name) -> Mapping:
    if not isinstance(value, Mapping):
        raise ValueError(
            f"{name} must be a section [{name}] of key = value lines; got {shown(value)}. See --help."
        )
    return value


def _known(path, where, given, known):
    unknown = [k for k in given if k not in known]
    if unknown:
        place = f"{path}: " if path else ""
        raise ValueError(f"{place}{where} knows the keys {', '.join(known)}; got {unknown[0]!r}. Correct it.")


def _within(path, section, work):
    try:
        return work()
    except (ValueError, TypeError) as error:
        raise ValueError(f"{path}, {section}: {error}") from None
