"""The physics of the virtual rigs: an integrator of its own, sharing no code with the library's engine.

Fixed sub-steps (20 kHz by default) of classical Runge-Kutta 4. A sub-step in which a body stops, breaks away,
hits or lets go is cut there by bisection, the event is applied, and the rest of the sub-step follows. Signs
and meanings of all numbers are those of the library's effect classes. The controller is digital: it reads
the measured position (noise and encoder included) at every sample and holds its force until the next.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

# Where each number stands in the parameter vector. A single mass is a motor without a load.
(
    MOTOR, LOAD, JOINT, GAP, RESTITUTION, JOINT_K, JOINT_C, SEES_MOTOR,
    COULOMB, STRIBECK, STRIBECK_V, STATIC, ASYM_COULOMB, LOAD_COULOMB, BRISTLE_K, BRISTLE_C, BRISTLE_LEVEL,
    VISCOUS, DRAG, ASYM_VISCOUS, SPRING, SPRING_X, CUBIC, CUBIC_X, RIPPLE, RIPPLE_LENGTH, RIPPLE_PHASE, FORCE,
    STOP, STOP_LOW, STOP_HIGH, STOP_RESTITUTION,
    GAIN, SATURATION, DEAD_ZONE, DELAY, LAG,
    SENSOR_DELAY, SENSOR_STEP, SENSOR_OFFSET, SENSOR_DRIFT,
    MASS_RATE, COULOMB_RATE, ZONE, ZONE_LOW, ZONE_HIGH, HYSTERESIS_K, HYSTERESIS_B, HUM, HUM_OMEGA, HUM_PHASE,
    FORCE_FRICTION, WARMING, GAIN_RIPPLE, GAIN_LENGTH, WELL, WELL_X, WELL_WIDTH, PUSH, PUSH_FROM, PUSH_TO,
    PENDULUM, PENDULUM_ANGLE, PLACED, PLACED_LENGTH, PLACED_PHASE,
    N_NUMBERS,
) = range(67)  # fmt: skip

NO_JOINT, IMPACT, ELASTIC = 0, 1, 2
# State: load and motor motion, bristle deflection, lagged force, hysteresis deflection, frictional work.
XL, VL, XM, VM, BEND, LAGGED, HYST, WORK, N_STATES = range(9)
# Mode: standing flags and friction directions of motor and load, closed face of the gap, stop leaned on.
M_STANDS, M_DIR, L_STANDS, L_DIR, FACE, LEAN, N_MODES = range(7)
# Only compiled functions call these: no references are counted (six times as fast), no entry from Python.
_part = njit(error_model="numpy", _nrt=False, no_cpython_wrapper=True, no_cfunc_wrapper=True)
_PLASTIC = 1e-7  # relative speed after an impact [m/s] below which the bodies stay together
_BISECTIONS = 44
_MAX_EVENTS = 400  # in one sub-step


def numbers(**given: float) -> np.ndarray:
    """Return a parameter vector; every effect not named is absent."""
    p = np.zeros(N_NUMBERS)
    p[GAIN], p[SATURATION], p[STRIBECK_V], p[RIPPLE_LENGTH], p[GAIN_LENGTH] = 1.0, math.inf, 1.0, 1.0, 1.0
    p[WELL_WIDTH] = p[PLACED_LENGTH] = 1.0
    for name, value in given.items():
        p[globals()[name]] = value
    return p


def run(p, u, *, dt=1e-3, substeps=20, noise=None, quantum=0.0, start=(0.0, 0.0), slack=0.0, controller=None):
    """Play a force record (or, with a controller, a position reference) and return what is recorded.

    Parameters
    ----------
    p : ndarray
        From `numbers`.
    u : ndarray, shape (n,)
        Force [N] held over each sample, or the reference [m].
    noise : ndarray or None
        Added to the reported position [m], inside the loop.
    quantum : float
        Encoder step after the noise [m]; 0: none.
    start : (float, float)
        Position and velocity of the measured body at t = 0.
    slack : float
        ``x_motor - x`` at t = 0.
    controller : (kp, ki, kd, tf, limit) or None
        Digital PID, derivative filter tf [s], force limit [N].

    Returns
    -------
    dict of ndarray
        ``u`` force, ``y`` reported position, ``clean`` the same without noise and quantum, ``v`` velocity of
        the measured body, ``x`` its true position, ``x_motor`` that of the motor.
    """
    n = len(u)
    noise = np.zeros(n) if noise is None else np.asarray(noise, float)
    gains = np.array(controller if controller is not None else (0.0, 0.0, 0.0, 1.0, 0.0), float)
    out = np.zeros((6, n))
    u = np.ascontiguousarray(u, float)
    _play(p, u, noise, quantum, dt, substeps, start[0], start[1], slack, controller is not None, gains, out)
    return dict(zip(("u", "y", "clean", "v", "x", "x_motor"), out, strict=True))


@njit(cache=True, error_model="numpy")
def _play(p, given, noise, quantum, dt, substeps, x0, v0, slack, closed, gains, out):
    n = len(given)
    s = np.zeros(N_STATES)
    mode = np.zeros(N_MODES, np.int64)
    k = np.zeros((6, N_STATES))
    work = (k[0], k[1], k[2], k[3], k[4], k[5])
    s[XL], s[VL], s[XM], s[VM] = x0, v0, x0 + slack, v0
    if p[JOINT] == NO_JOINT or p[SEES_MOTOR] > 0:
        s[XL], s[XM] = x0 - slack, x0
    whole = int(math.floor(p[DELAY] / dt + 1e-9))
    part = max(p[DELAY] - whole * dt, 0.0)
    integral, filtered, last = 0.0, 0.0, 0.0
    command = np.zeros(n)  # force after the static elements of the drive
    for k in range(n):
        t = k * dt
        seen_x, seen_v = (s[XM], s[VM]) if (p[JOINT] == NO_JOINT or p[SEES_MOTOR] > 0) else (s[XL], s[VL])
        out[4, k], out[3, k], out[5, k] = seen_x, seen_v, s[XM]
        clean = _report(p, out[4], out[3], k, dt, t)
        y = clean + noise[k]
        if quantum > 0:
            y = quantum * np.round(y / quantum)
        out[1, k], out[2, k] = y, clean
        force = given[k]
        if closed:
            error = given[k] - y
            if k == 0:
                last = error
            filtered += (dt / (gains[3] + dt)) * ((error - last) / dt - filtered)
            last = error
            force = gains[0] * error + gains[1] * (integral + error * dt) + gains[2] * filtered
            if abs(force) <= gains[4]:
                integral += error * dt
            force = min(max(force, -gains[4]), gains[4])
        out[0, k] = force
        command[k] = _drive(p, force)
        if not (abs(s[XM]) < 1e9):
            out[1, k:] = np.nan
            return
        before = command[k - whole - 1] if k - whole - 1 >= 0 else 0.0
        after = command[k - whole] if k - whole >= 0 else 0.0
        if part > 1e-12:
            _advance(p, s, mode, work, t, part, max(int(math.ceil(substeps * part / dt)), 1), before)
            _advance(p, s, mode, work, t + part, dt - part, substeps, after)
        else:
            _advance(p, s, mode, work, t, dt, substeps, after)


@_part
def _drive(p, u):
    u = min(max(p[GAIN] * u, -p[SATURATION]), p[SATURATION])
    if abs(u) <= p[DEAD_ZONE]:
        return 0.0
    return u - p[DEAD_ZONE] if u > 0 else u + p[DEAD_ZONE]


@_part
def _report(p, x, v, k, dt, t):
    """Reported position: delay (cubic Hermite between samples), then steps, offset, drift."""
    y = x[k]
    if p[SENSOR_DELAY] > 0:
        place = k - p[SENSOR_DELAY] / dt
        if place <= 0:
            y = x[0]
        else:
            i = int(math.floor(place))
            h = place - i
            if i < k and h > 1e-12:
                a, b = x[i], x[i + 1]
                y = (
                    (1 + 2 * h) * (1 - h) ** 2 * a
                    + h * (1 - h) ** 2 * dt * v[i]
                    + h * h * (3 - 2 * h) * b
                    + h * h * (h - 1) * dt * v[i + 1]
                )
            else:
                y = x[i]
    if p[SENSOR_STEP] > 0:
        y = p[SENSOR_STEP] * np.round(y / p[SENSOR_STEP])
    return y + p[SENSOR_OFFSET] + p[SENSOR_DRIFT] * t


@_part
def _advance(p, s, mode, work, t, span, pieces, u):
    trial = work[5]
    h = span / pieces
    for i in range(pieces):
        left, now = h, t + i * h
        for event in range(_MAX_EVENTS):
            _settle(p, now, s, u, mode)
            _rk4(p, now, s, left, u, mode, trial, work)
            if event == _MAX_EVENTS - 1 or not _broken(p, now + left, trial, u, mode):
                for j in range(N_STATES):
                    s[j] = trial[j]
                break
            low, high = 0.0, left
            for _ in range(_BISECTIONS):
                middle = 0.5 * (low + high)
                _rk4(p, now, s, middle, u, mode, trial, work)
                if _broken(p, now + middle, trial, u, mode):
                    high = middle
                else:
                    low = middle
            _rk4(p, now, s, high, u, mode, trial, work)
            for j in range(N_STATES):
                s[j] = trial[j]
            now, left = now + high, left - high
            _apply(p, now, s, u, mode)
            if left <= 0:
                break


@_part
def _rk4(p, t, s, h, u, mode, out, work):
    k1, k2, k3, k4, w = work[0], work[1], work[2], work[3], work[4]
    _rates(p, t, s, u, mode, k1)
    for i in range(N_STATES):
        w[i] = s[i] + 0.5 * h * k1[i]
    _rates(p, t + 0.5 * h, w, u, mode, k2)
    for i in range(N_STATES):
        w[i] = s[i] + 0.5 * h * k2[i]
    _rates(p, t + 0.5 * h, w, u, mode, k3)
    for i in range(N_STATES):
        w[i] = s[i] + h * k3[i]
    _rates(p, t + h, w, u, mode, k4)
    for i in range(N_STATES):
        out[i] = s[i] + h / 6 * (k1[i] + 2 * k2[i] + 2 * k3[i] + k4[i])


@_part
def _rates(p, t, s, u, mode, d):
    force_m, force_l = _forces(p, t, s, u)
    d[LAGGED] = (u - s[LAGGED]) / p[LAG] if p[LAG] > 0 else 0.0
    d[HYST] = (
        s[VM] - p[HYSTERESIS_B] ** 2 * abs(s[VM]) * s[HYST] * abs(s[HYST]) if p[HYSTERESIS_K] > 0 else 0.0
    )
    d[BEND] = _bend_rate(p, t, s, u)
    d[WORK] = 0.0
    if p[BRISTLE_K] == 0:
        friction = mode[M_DIR] * _level(p, t, s, u, True, mode[M_DIR])
        force_m -= friction
        if p[WARMING] > 0:
            d[WORK] = abs(friction * s[VM])
    force_l -= mode[L_DIR] * p[LOAD_COULOMB]
    d[XM], d[XL] = s[VM], s[VL]
    if mode[FACE] != 0:
        a = 0.0 if mode[M_STANDS] else (force_m + force_l) / (_motor_mass(p, t) + p[LOAD])
        d[VM], d[VL] = a, a
        return
    d[VM] = 0.0 if mode[M_STANDS] else force_m / _motor_mass(p, t)
    d[VL] = 0.0 if (mode[L_STANDS] or p[JOINT] == NO_JOINT) else force_l / p[LOAD]


@_part
def _motor_mass(p, t):
    return p[MOTOR] * (1.0 + p[MASS_RATE] * t)


@_part
def _drive_force(p, s, u):
    force = s[LAGGED] if p[LAG] > 0 else u
    if p[GAIN_RIPPLE] != 0:
        force *= 1.0 + p[GAIN_RIPPLE] * math.sin(2 * math.pi * s[XM] / p[GAIN_LENGTH])
    return force


@_part
def _forces(p, t, s, u):
    """All forces on motor and load except dry friction."""
    x, v = s[XM], s[VM]
    f = _drive_force(p, s, u) + p[FORCE] - p[VISCOUS] * v - p[SPRING] * (x - p[SPRING_X])
    f -= p[DRAG] * v * abs(v) + 0.5 * p[ASYM_VISCOUS] * abs(v)
    if p[CUBIC] != 0:
        f -= p[CUBIC] * (x - p[CUBIC_X]) ** 3
    if p[RIPPLE] != 0:
        f += p[RIPPLE] * math.sin(2 * math.pi * x / p[RIPPLE_LENGTH] + p[RIPPLE_PHASE])
    if p[PENDULUM] != 0:
        f -= p[PENDULUM] * math.sin(x - p[PENDULUM_ANGLE])
    if p[HUM] != 0:
        f += p[HUM] * math.sin(p[HUM_OMEGA] * t + p[HUM_PHASE])
    if p[WELL] != 0:
        d = (x - p[WELL_X]) / p[WELL_WIDTH]
        f -= p[WELL] * d * math.exp(0.5 - 0.5 * d * d)
    if p[PUSH] != 0 and p[PUSH_FROM] <= t < p[PUSH_TO]:
        f += p[PUSH] * math.sin(math.pi * (t - p[PUSH_FROM]) / (p[PUSH_TO] - p[PUSH_FROM])) ** 2
    f -= p[HYSTERESIS_K] * s[HYST]
    if p[BRISTLE_K] > 0:
        f -= p[BRISTLE_K] * s[BEND] + p[BRISTLE_C] * _bend_rate(p, t, s, u)
    load = 0.0
    if p[JOINT] == ELASTIC:
        delta = x - s[XL]
        bend = delta if p[GAP] == 0 else delta - min(max(delta, 0.0), p[GAP])
        if bend != 0 or p[GAP] == 0:
            load = p[JOINT_K] * bend + p[JOINT_C] * (v - s[VL])
            f -= load
    return f, load


@_part
def _bend_rate(p, t, s, u):
    if p[BRISTLE_K] == 0:
        return 0.0
    v = s[VM]
    g = _level(p, t, s, u, True, 1 if v >= 0 else -1) + p[BRISTLE_LEVEL]
    return v if g <= 0 else v - p[BRISTLE_K] * abs(v) * s[BEND] / g


@_part
def _level(p, t, s, u, moving, direction):
    """Dry friction level on the motor [N]."""
    level = p[COULOMB] * (1.0 + p[COULOMB_RATE] * t) + p[WARMING] * s[WORK]
    if p[FORCE_FRICTION] != 0:
        level += p[FORCE_FRICTION] * abs(_drive_force(p, s, u))
    if p[PLACED] != 0:
        wave = math.sin(2 * math.pi * s[XM] / p[PLACED_LENGTH] + p[PLACED_PHASE])
        level = max(level + p[PLACED] * wave, 0.0)
    if p[ZONE] != 0:
        edge = 0.1 * (p[ZONE_HIGH] - p[ZONE_LOW])
        level += (
            p[ZONE]
            * 0.5
            * (math.tanh((s[XM] - p[ZONE_LOW]) / edge) - math.tanh((s[XM] - p[ZONE_HIGH]) / edge))
        )
    if p[STRIBECK] > level:
        ratio = s[VM] / p[STRIBECK_V] if moving else 0.0
        level += (p[STRIBECK] - level) * math.exp(-ratio * ratio)
    if not moving and p[STATIC] > level:
        level = p[STATIC]
    if p[ASYM_COULOMB] != 0:
        level = max(level + 0.5 * direction * p[ASYM_COULOMB], 0.0)
    return level


@_part
def _goes(f, up, down):
    """Direction in which `f` moves a standing body that holds `up` against +x and `down` against -x."""
    if f > up:
        return 1
    if f < -down:
        return -1
    return 0


@_part
def _motor_goes(p, t, s, u, f):
    if p[BRISTLE_K] > 0:
        return _goes(f, 0.0, 0.0)
    return _goes(f, _level(p, t, s, u, False, 1), _level(p, t, s, u, False, -1))


@_part
def _together(p, t, s, u, face):
    """Standing in contact: (part?, motor direction, load direction)."""
    force_m, force_l = _forces(p, t, s, u)
    go_m, go_l = _motor_goes(p, t, s, u, force_m), _goes(force_l, p[LOAD_COULOMB], p[LOAD_COULOMB])
    held = 0.0 if p[BRISTLE_K] > 0 else 1.0
    a_m = (force_m - go_m * held * _level(p, t, s, u, True, go_m)) / _motor_mass(p, t) if go_m != 0 else 0.0
    a_l = (force_l - go_l * p[LOAD_COULOMB]) / p[LOAD] if go_l != 0 else 0.0
    if (a_m - a_l) * face < 0:
        return True, go_m, go_l
    up = held * _level(p, t, s, u, False, 1) + p[LOAD_COULOMB]
    down = held * _level(p, t, s, u, False, -1) + p[LOAD_COULOMB]
    go = _goes(force_m + force_l, up, down)
    return False, go, go


@_part
def _pressed(p, t, s, u, mode):
    """Contact force on the load, positive when the faces press (moving together)."""
    force_m, force_l = _forces(p, t, s, u)
    if p[BRISTLE_K] == 0:
        force_m -= mode[M_DIR] * _level(p, t, s, u, True, mode[M_DIR])
    force_l -= mode[L_DIR] * p[LOAD_COULOMB]
    a = (force_m + force_l) / (_motor_mass(p, t) + p[LOAD])
    return mode[FACE] * (p[LOAD] * a - force_l)


@_part
def _settle(p, t, s, u, mode):
    """Decide, for the present state, who stands, who moves where, and who parts."""
    if mode[FACE] != 0:
        if s[VM] == 0.0:
            part, go_m, go_l = _together(p, t, s, u, mode[FACE])
            mode[M_DIR], mode[L_DIR] = go_m, go_l
            mode[M_STANDS], mode[L_STANDS] = go_m == 0, go_l == 0
            if part:
                mode[FACE] = 0
            return
        mode[M_DIR] = mode[L_DIR] = 1 if s[VM] > 0 else -1
        mode[M_STANDS] = mode[L_STANDS] = 0
        if _pressed(p, t, s, u, mode) >= 0:
            return
        mode[FACE] = 0
    go = 1 if s[VM] > 0 else -1
    if s[VM] == 0.0:
        force_m, force_l = _forces(p, t, s, u)
        go = _motor_goes(p, t, s, u, force_m)
        if mode[LEAN] != 0 and force_m * mode[LEAN] >= 0:
            go = 0
    mode[M_DIR], mode[M_STANDS] = go, go == 0
    if go != 0 and mode[LEAN] != 0:
        mode[LEAN] = 0
    if p[JOINT] == NO_JOINT:
        return
    go = 1 if s[VL] > 0 else -1
    if s[VL] == 0.0:
        force_m, force_l = _forces(p, t, s, u)
        go = _goes(force_l, p[LOAD_COULOMB], p[LOAD_COULOMB])
    mode[L_DIR], mode[L_STANDS] = go, go == 0


@_part
def _gap_hit(p, s, mode):
    if p[JOINT] != IMPACT or mode[FACE] != 0:
        return 0
    delta, rate = s[XM] - s[XL], s[VM] - s[VL]
    if delta > p[GAP] and rate > 0:
        return 1
    return -1 if (delta < 0 and rate < 0) else 0


@_part
def _stop_hit(p, s):
    if p[STOP] == 0:
        return 0
    if s[XM] > p[STOP_HIGH] and s[VM] > 0:
        return 1
    return -1 if (s[XM] < p[STOP_LOW] and s[VM] < 0) else 0


@_part
def _broken(p, t, s, u, mode):
    """Whether an event lies at or before this state."""
    if not mode[M_STANDS] and s[VM] * mode[M_DIR] < 0:
        return True
    if p[JOINT] != NO_JOINT and not mode[L_STANDS] and s[VL] * mode[L_DIR] < 0:
        return True
    if _gap_hit(p, s, mode) != 0 or _stop_hit(p, s) != 0:
        return True
    if mode[FACE] != 0:
        if mode[M_STANDS]:
            part, go_m, go_l = _together(p, t, s, u, mode[FACE])
            return part or go_m != 0
        return s[VM] != 0 and _pressed(p, t, s, u, mode) < 0
    if not mode[M_STANDS] and not mode[L_STANDS]:
        return False
    force_m, force_l = _forces(p, t, s, u)
    if mode[M_STANDS]:
        leans = mode[LEAN] != 0 and force_m * mode[LEAN] >= 0
        if not leans and _motor_goes(p, t, s, u, force_m) != 0:
            return True
    if p[JOINT] != NO_JOINT and mode[L_STANDS]:
        return _goes(force_l, p[LOAD_COULOMB], p[LOAD_COULOMB]) != 0
    return False


@_part
def _apply(p, t, s, u, mode):
    """Carry out the event found: stop, impact, leave."""
    hit, stop = _gap_hit(p, s, mode), _stop_hit(p, s)
    if not mode[M_STANDS] and s[VM] * mode[M_DIR] < 0:
        s[VM] = 0.0
        if mode[FACE] != 0:
            s[VL] = 0.0
    if p[JOINT] != NO_JOINT and not mode[L_STANDS] and s[VL] * mode[L_DIR] < 0:
        s[VL] = 0.0
        if mode[FACE] != 0:
            s[VM] = 0.0
    if stop != 0:
        s[XM] = p[STOP_HIGH] if stop > 0 else p[STOP_LOW]
        s[VM] = -p[STOP_RESTITUTION] * s[VM]
        if abs(s[VM]) < _PLASTIC:
            s[VM], mode[LEAN] = 0.0, stop
    if hit != 0:
        m, ml = _motor_mass(p, t), p[LOAD]
        rate, common = s[VM] - s[VL], (m * s[VM] + ml * s[VL]) / (m + ml)
        s[XM] = s[XL] + (p[GAP] if hit > 0 else 0.0)
        if abs(p[RESTITUTION] * rate) < _PLASTIC:
            s[VM] = s[VL] = common
            mode[FACE] = hit
        else:
            s[VM] = common - p[RESTITUTION] * rate * ml / (m + ml)
            s[VL] = common + p[RESTITUTION] * rate * m / (m + ml)
