"""What a recorded channel must be; every complaint gives rule, value, remedy."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ...checks import is_number, shown
from .signals import noise_floor, resolution, step_of
from .thresholds import (
    ABOVE_REST,
    BETWEEN_STEPS,
    JUMP_BESIDE,
    JUMP_FAST,
    JUMP_STANDS_OUT,
    MINIMUM,
    MISSING,
    SAME_VALUE,
    SINGLE,
    USUAL_STEPS,
)


def as_channel(owner: str, name: str, values, length: int | None = None) -> np.ndarray:
    """Return a private 1-D float array without NaN or infinity, of the given length."""
    if values is None or isinstance(values, str | bytes | Mapping | set) or is_number(values):
        raise TypeError(f"{owner} needs {name} as a 1-D array of numbers; got {shown(values)}.")
    hidden = np.ma.getmaskarray(values) if isinstance(values, np.ma.MaskedArray) else np.zeros(0, bool)
    masked = np.flatnonzero(hidden)
    if len(masked):
        raise ValueError(
            f"{owner} needs every sample; {name} has {len(masked)} masked, the first at sample {masked[0]}. "
            "Take the parts between them as records of their own (Measurement.in_parts), or fill them "
            "yourself where that is justified."
        )
    try:
        raw = np.asarray(values)
    except ValueError:
        raise ValueError(
            f"{owner} needs {name} as a 1-D array of numbers; got rows of unequal length."
        ) from None
    if raw.dtype.kind == "c":
        raise ValueError(
            f"{owner} needs real numbers in {name}; got complex ones. Is this a frequency response?"
        )
    raw = seconds(raw) if name == "t" else raw
    mixed = raw.dtype.kind == "O" and not all(is_number(v) for v in raw.ravel())
    if mixed or raw.dtype.kind not in "fiuO" + ("b" if name not in ("t", "u", "y") else ""):
        kind = {"U": "text", "S": "text", "b": "truth values", "M": "dates", "m": "durations"}
        got = kind.get(raw.dtype.kind, f"dtype {raw.dtype}")
        raise TypeError(f"{owner} needs numbers in {name}; got {got}. Convert the column first.")
    array = np.array(raw, dtype=float)
    if array.ndim == 2 and 1 in array.shape:
        array = array.ravel()
    if array.ndim != 1:
        raise ValueError(
            f"{owner} needs {name} as a 1-D array, one number a sample; got shape {array.shape}."
        )
    if length is not None and len(array) != length:
        raise ValueError(
            f"{owner} needs arrays of equal length; t has {length} samples and {name} {len(array)}."
        )
    if length is None and len(array) < MINIMUM:
        raise ValueError(f"{owner} needs at least {MINIMUM} samples; got {len(array)}. Record longer.")
    bad = np.flatnonzero(~np.isfinite(array))
    if len(bad):
        raise ValueError(
            f"{owner} needs finite numbers; {name} has {len(bad)} NaN or infinite, the first at "
            f"sample {bad[0]}. "
            "Take the parts between them as records of their own (Measurement.in_parts), or interpolate them "
            "yourself where that is justified."
        )
    return array


def seconds(times) -> np.ndarray:
    """Return dates and durations as seconds from the first; what is neither as it is."""
    raw = np.ma.asanyarray(times) if np.ma.isMaskedArray(times) else np.asarray(times)
    if raw.dtype.kind not in "mM" or raw.ndim != 1 or not len(raw):
        return raw
    return (raw - raw[0]) / np.timedelta64(1, "s")


def check_times(owner: str, t: np.ndarray) -> None:
    """Check that times rise strictly and that regular sampling has no hole."""
    steps = np.diff(t)
    if np.any(steps < 0):
        i = int(np.argmax(steps < 0))
        raise ValueError(
            f"{owner} needs increasing times; t falls from {t[i]:.9g} to {t[i + 1]:.9g} s at sample {i + 1}. "
            "Sort the rows, or split the file where a new run begins."
        )
    if np.any(steps == 0):
        i = int(np.argmax(steps == 0))
        count = int(np.count_nonzero(steps == 0))
        raise ValueError(
            f"{owner} needs each time once; t = {t[i]:.9g} s appears twice at sample {i + 1} "
            f"({count} repetitions in all). "
            "Drop the repeated rows, or write the times with more digits."
        )
    missing = holes(t)
    if len(missing):
        # the mean: times may be those of a regular clock, rounded
        i, usual = int(missing[0]), float(np.mean(np.delete(steps, missing)))
        raise ValueError(
            f"{owner} needs gapless sampling; {len(missing)} gap(s) in a regular {usual:.6g} s grid, "
            f"the first from {t[i]:.9g} to {t[i + 1]:.9g} s ({steps[i] / usual:.3g} intervals). "
            "Give the parts as separate records: Measurement.in_parts."
        )


def holes(t: np.ndarray) -> np.ndarray:
    """Return the samples after which others are missing in an otherwise regular sampling."""
    steps = np.diff(t)
    middle = float(np.median(steps))
    low, high = np.quantile(steps, USUAL_STEPS)
    if high > MISSING * low:
        return np.zeros(0, int)  # irregular on purpose: every interval is as good as another
    return np.flatnonzero(steps > max(MISSING * middle, MISSING * high))


def check_motion(
    owner: str, t: np.ndarray, u: np.ndarray, outputs: Sequence[np.ndarray], imposed: bool
) -> None:
    """Check that outputs vary: with the input, or under one that is constant, as after a release."""
    for y in outputs:
        if np.ptp(y) == 0:
            raise ValueError(
                f"{owner} needs an output that varies; y is {y[0]:g} throughout. "
                "Check the column and the sensor, or apply a larger force."
            )
    if at_rest(t, u, outputs, imposed):
        raise ValueError(
            f"{owner} needs an input that varies, or a free motion; u is {u[0]:g} throughout, and the output "
            f"is {'the force of a motion that is imposed' if imposed else 'noise'}. Check the columns, "
            "excite the drive, or release the machine away from its rest."
        )


def at_rest(t: np.ndarray, u: np.ndarray, outputs: Sequence[np.ndarray], imposed: bool) -> bool:
    """Return whether the input is constant, and is a motion itself or moves no output beyond its noise."""
    return np.ptp(u) == 0 and (imposed or all(np.std(y) < ABOVE_REST * noise_floor(t, y) for y in outputs))


def check_apart(owner: str, quantity: str, u: np.ndarray, y: np.ndarray) -> None:
    """Check that an input and an output of the same quantity differ by more than a constant."""
    if np.ptp(u - y) <= SAME_VALUE * np.max(np.abs(y)):
        raise ValueError(
            f"{owner} needs an input and an output that differ; got the same {quantity} as both, but for a "
            "constant at most. Was a column given twice? Give the force, or the motion of the base, as input."
        )


def check_turns(owner: str, t: np.ndarray, angle: np.ndarray, turn: float) -> None:
    """Check that an angle goes on beyond a turn, at whatever speed below half a turn a sample.

    One that wraps stays within a turn, and steps by more than half of one where none of its accelerations
    would be large if the turn were taken off.
    """
    steps = np.diff(angle)
    wraps = np.flatnonzero(np.abs(steps) > turn / 2)
    rest = steps - turn * np.round(steps / turn)
    if (
        len(wraps)
        and np.ptp(angle) <= turn * (1 + SAME_VALUE)
        and JUMP_FAST * np.max(np.abs(np.diff(rest))) < turn
    ):
        i = int(wraps[0])
        raise ValueError(
            f"{owner} needs a position without jumps; this angle falls back by a turn {len(wraps)} time(s), "
            f"the first from {angle[i]:.6g} to {angle[i + 1]:.6g} at t = {t[i + 1]:.6g} s. Unwrap it: "
            f"np.unwrap(angle, period={turn:.9g})."
        )


def check_jumps(owner: str, t: np.ndarray, x: np.ndarray) -> None:
    """Check that a measured place does not jump."""
    found = jumps(t, x)
    if len(found):
        i = int(found[0])
        raise ValueError(
            f"{owner} needs a position without jumps; it has {len(found)}, the first from {x[i]:.6g} to "
            f"{x[i + 1]:.6g} at t = {t[i + 1]:.6g} s, more than the velocities before and after explain. Was "
            "the encoder reset? Give the parts as separate records: Measurement.in_parts (an angle that "
            "wraps: np.unwrap first)."
        )


def jumps(t: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return the samples after which a place jumps, as it does where an encoder is reset or an angle wraps.

    Between two samples a machine moves at a velocity between those before and after, impacts included, but
    for what its acceleration may add. A jump is farther by far: than what the accelerations around it would
    add, than what any other of the record would, and than noise and rounding.
    """
    steps = np.diff(x)
    seen = JUMP_STANDS_OUT * max(step_of(x), resolution(x))
    # by the clock, and by the count of samples: a clock may be read late
    found = np.flatnonzero(_thrown(steps, np.diff(t), seen) & _thrown(steps, np.ones(len(steps)), seen))
    jumped = np.zeros(len(steps))
    jumped[found] = steps[found]
    between = np.ptp(x[1:] - np.cumsum(jumped))
    # A coarse sensor that rounds moves by its steps alone: nothing is seen between them, or, where noise
    # comes after it, less than half a step. After a reset the next one jumps by what the machine moved.
    if len(found) > SINGLE and between < BETWEEN_STEPS * np.min(np.abs(steps[found])):
        return found[:0]
    return found[np.minimum(np.abs(steps[found]), seen) < between]


def _thrown(steps, dt, seen) -> np.ndarray:
    """Return which steps of a place, over these times, go beyond the velocities to either side by far."""
    v = steps / dt
    before, after = np.concatenate([[-v[1]], v[:-1]]), np.concatenate([v[1:], [-v[-2]]])
    beyond = np.maximum(v - np.maximum(before, after), np.minimum(before, after) - v)
    a = np.abs(np.diff(v)) * 2 / (dt[1:] + dt[:-1])
    around = np.zeros(len(v))
    for lag in range(1, JUMP_BESIDE + 1):  # accelerations without the step itself
        around[lag + 1 :] = np.maximum(around[lag + 1 :], a[: len(a) - lag])
        around[: -lag - 1] = np.maximum(around[: -lag - 1], a[lag:])
    alone = beyond * dt > np.maximum(JUMP_STANDS_OUT * around * dt**2, seen)
    others = a[~(alone[1:] | alone[:-1])]
    return alone & (beyond > JUMP_FAST * np.max(others, initial=0.0) * dt)
