"""Motion of machines by an integrator that shares nothing with the engine.

Runge-Kutta steps of a fixed length within a mode (each body slides to one side or sticks; the joint is open,
closed or bent; the machine leans against a stop), halved until they hold together with the event where a mode
ends. What it makes is checked by shorter steps and by SciPy. All is without unit: the generator scales.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

NAMES = (
    "motor", "load", "joint", "gap", "gap_restitution", "joint_stiffness", "joint_damping",
    "viscous", "coulomb", "breakaway", "static", "stribeck_speed", "drag", "uneven_coulomb", "uneven_viscous",
    "ripple", "ripple_wave", "ripple_phase", "constant", "spring", "cubic", "weight", "hangs_at",
    "stop_high", "stop_low", "stop_restitution", "load_coulomb", "carried", "place", "place_wave",
    "place_phase", "pad", "pad_stroke", "pad_shape", "bristle", "bristle_damping", "limit", "dead", "gain",
    "lag", "cogging", "cogging_wave", "cogging_speed", "warming", "warming_time", "eddy", "eddy_speed",
    "power", "hum", "hum_omega", "greasy", "greasy_wave", "memory", "derating", "derating_time",
)  # fmt: skip
AT = {name: i for i, name in enumerate(NAMES)}
RIGID, LOOSE, SPRUNG = 0, 1, 2
STATES = 8  # x, v of the motor; motor less load: place, speed; bristle; pad; lag; friction with a memory
HALVINGS = 60
MOST_STEPS = 1_000_000  # between two ticks: a hundred thousand times what any machine here takes
# only compiled functions call these: no references are counted, nothing is made for Python
_part = njit(error_model="numpy", _nrt=False, no_cpython_wrapper=True, no_cfunc_wrapper=True)
REST = 1e-7  # rebounds slower than this (of a speed of the order of one) end in contact

MOTOR, LOAD, JOINT, GAP, GAP_E, JK, JC = range(7)
B, FC, KS, FS, VS, DRAG, DC, DB = range(7, 15)
RA, RW, RP, CONST, K, K3, WEIGHT, HANG = range(15, 23)
HIGH, LOW, STOP_E, FL, CARRIED, PLACE, PW, PP, PAD, PADS, PADN = range(23, 34)
S0, S1, LIMIT, DEAD, GAIN, LAG = range(34, 40)
COG, COGW, COGV, WARM, WARMT, EDDY, EDDYV, POWER, HUM, HUMW, GREASE, GREASEW, MEM, DER, DERT = range(40, 55)


def blank():
    """Return the parameters of a free unit mass."""
    p = np.zeros(len(NAMES))
    p[[MOTOR, GAIN]] = 1.0
    p[[HIGH, LIMIT, POWER]] = np.inf
    p[LOW] = -np.inf
    p[[VS, RW, PW, PADS, COGW, COGV, WARMT, EDDYV, GREASEW, DERT]] = 1.0
    p[PADN] = 2.0
    return p


@_part
def _force_in(t, u, y, p):
    """Return the force on the motor that a command comes to, and the rate of the drive's lag."""
    f = u * p[GAIN]
    if p[DEAD] > 0.0:
        f = math.copysign(max(abs(f) - p[DEAD], 0.0), f)
    f = min(max(f, -p[LIMIT]), p[LIMIT])
    rate = 0.0
    if p[LAG] > 0.0:
        rate = (f - y[6]) / p[LAG]
        f = y[6]
    if p[DER] > 0.0:
        f *= 1.0 - p[DER] * (1.0 - math.exp(-t / p[DERT]))
    if abs(f * y[1]) > p[POWER]:
        f = math.copysign(p[POWER] / abs(y[1]), f)
    return f, rate


@_part
def _around(t, x, v, p):
    """Return the forces on the motor that are neither drive, dry friction nor joint."""
    f = p[CONST] - p[B] * v - p[DRAG] * v * abs(v) - 0.5 * p[DB] * abs(v)
    f -= p[K] * x + p[K3] * x * x * x
    if p[RA] != 0.0:
        f += p[RA] * math.sin(2.0 * math.pi * x / p[RW] + p[RP])
    if p[WEIGHT] != 0.0:
        f -= p[WEIGHT] * math.sin(x - p[HANG])
    if p[COG] != 0.0:
        f += p[COG] * math.tanh(v / p[COGV]) ** 2 * math.sin(2.0 * math.pi * x / p[COGW])
    if p[EDDY] != 0.0:
        f -= p[EDDY] * v / (1.0 + (v / p[EDDYV]) ** 2)
    if p[HUM] != 0.0:
        f += p[HUM] * math.sin(p[HUMW] * t)
    if p[GREASE] != 0.0:
        f -= p[GREASE] * v * (1.0 + math.sin(2.0 * math.pi * x / p[GREASEW]))
    return f


@_part
def _level(still, side, speed, t, x, drive, p):
    """Return the dry friction of the motor against motion to one side."""
    base = p[FC] + p[CARRIED] * abs(drive)
    if p[WARM] != 0.0:
        base *= 1.0 + p[WARM] * math.sin(2.0 * math.pi * t / p[WARMT])
    if p[FS] > base:
        base += (p[FS] - base) * math.exp(-((speed / p[VS]) ** 2))
    if still:
        base = max(base, p[KS])
    base += 0.5 * side * p[DC]
    if p[PLACE] != 0.0:
        base += p[PLACE] * math.sin(2.0 * math.pi * x / p[PW] + p[PP])
    return max(base, 0.0)


@_part
def _bend(y, region, p):
    """Return the force of an elastic joint on the load."""
    d, w = y[2], y[3]
    if p[GAP] == 0.0:
        return p[JK] * d + p[JC] * w
    if region == 0:
        return 0.0
    return p[JK] * (d if region == 1 else d - p[GAP]) + p[JC] * w


@_part
def _is_dry(p):
    return p[FC] + p[KS] + p[FS] + abs(p[DC]) + p[CARRIED] + p[PLACE] > 0.0


@_part
def _push(t, y, u, region, p):
    """Return the force on the motor without dry friction, the drive's, and that of the joint on the load."""
    drive, _ = _force_in(t, u, y, p)
    f = drive + _around(t, y[0], y[1], p) - p[PAD] * y[5]
    joint = _bend(y, region, p) if p[JOINT] == SPRUNG else 0.0
    return f - joint, drive, joint


@_part
def _rates(t, y, u, mode, p, dy):
    """Write the rates of all states in a mode (side of the motor, side of the load, joint, stop)."""
    _, dy[6] = _force_in(t, u, y, p)
    f, drive, joint = _push(t, y, u, mode[2], p)
    v, w = y[1], y[3]
    two, dry = p[JOINT] != RIGID, _is_dry(p)
    dy[4] = dy[5] = dy[7] = 0.0
    if p[PAD] != 0.0:
        dy[5] = (v - abs(v) * abs(y[5]) ** (p[PADN] - 1.0) * y[5]) / p[PADS]
    level = _level(False, float(mode[0]), abs(v), t, y[0], drive, p) if dry else 0.0
    if p[S0] > 0.0:
        dy[4] = v - p[S0] * abs(v) * y[4] / level
        friction = -(p[S0] * y[4] + p[S1] * dy[4])
    elif p[MEM] > 0.0:
        friction = -y[7]
        dy[7] = (level * math.tanh(v / p[VS]) - y[7]) / p[MEM]
    else:
        friction = -mode[0] * level
    stuck = dry and mode[0] == 0 and p[S0] == 0.0 and p[MEM] == 0.0
    a = 0.0 if stuck or mode[3] != 0 else (f + friction) / p[MOTOR]
    b = 0.0
    if two:
        if p[JOINT] == LOOSE and mode[2] != 0:
            total = f + friction - mode[0] * p[FL]
            still = mode[0] == 0 and (dry or p[FL] > 0.0)
            a = b = 0.0 if still else total / (p[MOTOR] + p[LOAD])
        elif p[FL] > 0.0:
            b = 0.0 if mode[1] == 0 else (joint - mode[1] * p[FL]) / p[LOAD]
        else:
            b = joint / p[LOAD]
    dy[0], dy[1] = v, a
    dy[2], dy[3] = (w, a - b) if two else (0.0, 0.0)


@_part
def _step(t, y, h, u0, slope, mode, p, k, z, out):
    """Make one Runge-Kutta step of order four; the command is u0 + slope t."""
    for stage in range(4):
        share = 0.0 if stage == 0 else (1.0 if stage == 3 else 0.5)
        for i in range(STATES):
            z[i] = y[i] + share * h * k[stage - 1, i] if stage > 0 else y[i]
        _rates(t + share * h, z, u0 + slope * (t + share * h), mode, p, k[stage])
    for i in range(STATES):
        out[i] = y[i] + h / 6.0 * (k[0, i] + 2.0 * k[1, i] + 2.0 * k[2, i] + k[3, i])


@_part
def _sign(x):
    return 1 if x > 0.0 else (-1 if x < 0.0 else 0)


@_part
def _event(t, y, u, mode, p):
    """Return what ended a mode by this state: 0 nothing, else the kind of event."""
    two, dry = p[JOINT] != RIGID, _is_dry(p)
    loose = p[JOINT] == LOOSE
    v, d, w = y[1], y[2], y[3]
    f, drive, joint = _push(t, y, u, mode[2], p)
    smooth = p[S0] > 0.0 or p[MEM] > 0.0
    if mode[3] == 0 and (y[0] > p[HIGH] or y[0] < p[LOW]):
        return 1
    if mode[3] != 0:
        return 2 if -mode[3] * f > _level(True, -float(mode[3]), 0.0, t, y[0], drive, p) * dry else 0
    if loose and mode[2] == 0 and (d < 0.0 or d > p[GAP]):
        return 3
    if p[JOINT] == SPRUNG and p[GAP] > 0.0:
        if (
            (mode[2] == 0 and (d < 0.0 or d > p[GAP]))
            or (mode[2] == 1 and d > 0.0)
            or (mode[2] == 2 and d < p[GAP])
        ):
            return 4
    if loose and mode[2] != 0:
        still = mode[0] == 0 and (dry or p[FL] > 0.0)
        side = 1.0 if mode[2] == 2 else -1.0
        own = _level(True, _sign(f), 0.0, t, y[0], drive, p) if dry else 0.0
        if still:
            return 5 if side * f > own + p[FL] or -side * f > own else 0
        if mode[0] * v < 0.0:
            return 6
        friction = mode[0] * (_level(False, float(mode[0]), abs(v), t, y[0], drive, p) if dry else 0.0)
        a = (f - friction - mode[0] * p[FL]) / (p[MOTOR] + p[LOAD])
        return 7 if side * (p[LOAD] * a + mode[0] * p[FL]) < 0.0 else 0
    if mode[0] != 0 and mode[0] * v < 0.0:
        return 8
    if dry and mode[0] == 0 and not smooth and abs(f) > _level(True, _sign(f), 0.0, t, y[0], drive, p):
        return 9
    if two and p[FL] > 0.0:
        if mode[1] != 0 and mode[1] * (v - w) < 0.0:
            return 10
        if mode[1] == 0 and abs(joint) > p[FL]:
            return 11
    return 0


@_part
def _meet(kind, t, y, u, mode, p):
    """Change the mode, and the speeds of an impact, at an event."""
    dry, two = _is_dry(p), p[JOINT] != RIGID
    if kind == 1:
        side = 1 if y[0] > 0.5 * (p[HIGH] + p[LOW]) else -1
        y[0] = p[HIGH] if side > 0 else p[LOW]
        y[1] *= -p[STOP_E]
        if abs(y[1]) < REST:
            y[1], mode[3] = 0.0, side
        mode[0] = _sign(y[1])
    elif kind == 2:
        mode[0], mode[3] = -mode[3], 0
    elif kind == 3:
        side = 2 if y[2] > 0.5 * p[GAP] else 1
        y[2] = p[GAP] if side == 2 else 0.0
        load = y[1] - y[3]
        common = (p[MOTOR] * y[1] + p[LOAD] * load) / (p[MOTOR] + p[LOAD])
        back = -p[GAP_E] * y[3]
        if abs(back) < REST:
            back, mode[2] = 0.0, side
        y[1] = common + p[LOAD] / (p[MOTOR] + p[LOAD]) * back
        y[3] = back
        mode[0], mode[1] = _sign(y[1]), _sign(y[1] - y[3])
        if mode[2] != 0:
            _stand(t, y, u, mode, p)
    elif kind == 4:
        if mode[2] == 0:
            mode[2] = 2 if y[2] > 0.5 * p[GAP] else 1
        else:
            mode[2] = 0
    elif kind == 5:
        f, drive, _ = _push(t, y, u, mode[2], p)
        side = 1 if mode[2] == 2 else -1
        if _sign(f) == side:
            mode[0] = mode[1] = side
        else:
            mode[0], mode[1], mode[2] = -side, 0, 0
    elif kind == 6:
        y[1] = y[3] = 0.0
        mode[0] = mode[1] = 0
        _stand(t, y, u, mode, p)
    elif kind == 7:
        mode[2] = 0
    elif kind == 8:
        if dry and p[S0] == 0.0 and p[MEM] == 0.0:
            if two:
                y[3] -= y[1]
            y[1], mode[0] = 0.0, 0
        else:
            mode[0] = -mode[0]
    elif kind == 9:
        f, _, _ = _push(t, y, u, mode[2], p)
        mode[0] = _sign(f)
    elif kind == 10:
        y[3], mode[1] = y[1], 0
    elif kind == 11:
        _, _, joint = _push(t, y, u, mode[2], p)
        mode[1] = _sign(joint)


@_part
def _stand(t, y, u, mode, p):
    """Settle two joined bodies that stand still: they stay, go on together or part."""
    if y[1] != 0.0:
        return
    dry = _is_dry(p)
    f, drive, _ = _push(t, y, u, mode[2], p)
    side = 1 if mode[2] == 2 else -1
    own = _level(True, _sign(f), 0.0, t, y[0], drive, p) if dry else 0.0
    if side * f > own + p[FL]:
        mode[0] = mode[1] = side
    elif -side * f > own:
        mode[0], mode[1], mode[2] = -side, 0, 0
    else:
        mode[0] = mode[1] = 0


@_part
def _advance(t, y, end, h, u0, slope, mode, p, k, z, a, b):
    """Carry the state from t to `end` in steps of at most h, through all events; returns their number.

    Where events follow each other without end (an accumulation that no rule here resolves) the state is lost.
    """
    events, same, steps = 0, 0, 0
    while t < end:
        steps += 1
        if steps > MOST_STEPS:
            for i in range(STATES):
                y[i] = np.nan
            break
        kind = _event(t, y, u0 + slope * t, mode, p)
        if kind != 0 and same < 20:
            _meet(kind, t, y, u0 + slope * t, mode, p)
            same += 1
            events += 1
            continue
        same = 0
        if mode[0] == 0 and (not _is_dry(p) or p[S0] > 0.0 or p[MEM] > 0.0):
            mode[0] = _sign(y[1])
        step = min(h, end - t)
        if end - t < 1.000001 * step:
            step = end - t
        _step(t, y, step, u0, slope, mode, p, k, z, a)
        if _event(t + step, a, u0 + slope * (t + step), mode, p) != 0 and kind == 0:
            low, high = 0.0, step
            for _ in range(HALVINGS):
                middle = 0.5 * (low + high)
                _step(t, y, middle, u0, slope, mode, p, k, z, b)
                if _event(t + middle, b, u0 + slope * (t + middle), mode, p) != 0:
                    high = middle
                    for i in range(STATES):
                        a[i] = b[i]
                else:
                    low = middle
                if high - low < 1e-15 * (abs(t) + step):
                    break
            if high == step:
                _step(t, y, step, u0, slope, mode, p, k, z, a)
            step = high
        for i in range(STATES):
            y[i] = a[i]
        t = end if step == end - t else t + step
    return events


@njit(cache=True, error_model="numpy")
def run(
    p, y0, command, closed, tick, h, linear, late_in, late_out, measured_load, pid, noise, step_of_sensor
):
    """Run a machine over ticks.

    Parameters
    ----------
    p : ndarray
        As `NAMES`.
    y0 : ndarray, shape (8,)
        State at the first tick.
    command : ndarray, shape (n,)
        Force, or the reference of the place where `closed`.
    tick, h : float
        Time between ticks, and of the longest step.
    linear : bool
        Whether the force runs straight from tick to tick, else it is held.
    late_in, late_out : float
        Delays of the drive and of the sensor.
    measured_load : bool
    pid : ndarray (kp, ki, kd, filter time, ticks a sample, largest force)
    noise : ndarray, shape (n,)
        What the controller's sensor adds.
    step_of_sensor : float
        Of the controller's sensor; 0: none.

    Returns
    -------
    reported place, its rate, command of force, all states
    """
    n = len(command)
    place, speed, force = np.zeros(n), np.zeros(n), np.zeros(n)
    states = np.zeros((n, STATES))
    y = y0.copy()
    mode = np.zeros(4, np.int64)
    mode[0], mode[1] = _sign(y[1]), _sign(y[1] - y[3])
    k = np.zeros((4, STATES))
    z, a, b = np.zeros(STATES), np.zeros(STATES), np.zeros(STATES)
    back_in = int(math.floor(late_in / tick))
    part_in = late_in - back_in * tick
    back_out = int(math.ceil(late_out / tick - 1e-12))
    ahead = back_out * tick - late_out  # into the tick at which the sensor looks
    seen_x, seen_v = np.zeros(n), np.zeros(n)
    integral, filtered, last, held = 0.0, 0.0, 0.0, 0.0
    every = max(int(pid[4]), 1)
    first = y[0] - (y[2] if measured_load else 0.0)
    if p[JOINT] == SPRUNG and p[GAP] > 0.0:
        mode[2] = 1 if y[2] < 0.0 else (2 if y[2] > p[GAP] else 0)
    for i in range(n):
        t = i * tick
        states[i] = y
        if ahead <= 0.0:
            seen_x[i] = y[0] - (y[2] if measured_load else 0.0)
            seen_v[i] = y[1] - (y[3] if measured_load else 0.0)
        if i >= back_out:
            place[i], speed[i] = seen_x[i - back_out], seen_v[i - back_out]
        else:
            place[i], speed[i] = first, 0.0
        if not closed:
            force[i] = command[i]
        else:
            if i % every == 0:
                got = place[i] + noise[i]
                if step_of_sensor > 0.0:
                    got = step_of_sensor * math.floor(got / step_of_sensor + 0.5)
                dt = every * tick
                if i == 0:
                    last = got
                weight = dt / (dt + pid[3])
                filtered += weight * ((got - last) / dt - filtered)
                last = got
                error = command[i] - got
                integral += pid[1] * error * dt
                integral = min(max(integral, -pid[5]), pid[5])
                held = min(max(pid[0] * error + integral - pid[2] * filtered, -pid[5]), pid[5])
            force[i] = held
        # the force in this tick: what was commanded late_in ago, in two pieces
        marks = np.array([0.0, part_in, ahead, tick])
        marks.sort()
        for m in range(3):
            low, high = marks[m], marks[m + 1]
            if low == ahead and ahead > 0.0:
                seen_x[i] = y[0] - (y[2] if measured_load else 0.0)
                seen_v[i] = y[1] - (y[3] if measured_load else 0.0)
            if high - low <= 1e-14 * tick:
                continue
            j = i - back_in - (1 if low < part_in else 0)
            u0 = force[j] if j >= 0 else 0.0
            slope = 0.0
            if linear and not closed:
                following = force[j + 1] if 0 <= j + 1 <= i else (command[j + 1] if 0 <= j + 1 < n else u0)
                slope = (following - u0) / tick
                u0 -= slope * ((j + back_in) * tick + part_in)
            _advance(t + low, y, t + high, h, u0, slope, mode, p, k, z, a, b)
    return place, speed, force, states


def longest_step(p, tick, speed, accel, place=1.0):
    """Return a step that resolves the fastest thing in a machine, a share of a tick."""
    rates = [2.0 * math.pi * 3.0, p[B] / p[MOTOR], math.sqrt(abs(p[K]) / p[MOTOR])]
    rates += [math.sqrt(3.0 * abs(p[K3])) * place / math.sqrt(p[MOTOR]), p[DRAG] * 2.0 * speed / p[MOTOR]]
    if p[JOINT] == SPRUNG:
        inverse = 1.0 / p[MOTOR] + 1.0 / p[LOAD]
        rates += [math.sqrt(p[JK] * inverse), p[JC] * inverse]
    if p[S0] > 0.0:
        rates += [math.sqrt(p[S0] / p[MOTOR]), p[S1] / p[MOTOR], p[S0] * speed / max(p[FC], 1e-9)]
    for amount, wave in ((RA, RW), (PLACE, PW), (COG, COGW), (GREASE, GREASEW)):
        if p[amount] != 0.0:
            rates.append(2.0 * math.pi * speed / p[wave])
            rates.append(math.sqrt(2.0 * math.pi * abs(p[amount]) / p[wave] / p[MOTOR]))
    if p[PAD] != 0.0:
        rates += [2.0 * speed / p[PADS], math.sqrt(p[PAD] / p[PADS] / p[MOTOR])]
    if p[FS] > 0.0 or p[MEM] > 0.0:
        rates.append(accel / p[VS])
    for time in (LAG, MEM):
        if p[time] > 0.0:
            rates.append(1.0 / p[time])
    if p[EDDY] > 0.0:
        rates += [p[EDDY] / p[MOTOR], accel / p[EDDYV]]
    return tick / max(math.ceil(tick * max(rates) / 0.1), 1)
