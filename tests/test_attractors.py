"""Every attractor of two masses with a gap is named by its period: an independent map of both masses."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

import ctrl_df as cdf
from ctrl_df.df.closed_form.backlash import backlash_attractors

pytestmark = pytest.mark.filterwarnings("ignore:.*aperiodic:RuntimeWarning")  # some drives rattle

NODE, WEIGHT = np.polynomial.legendre.leggauss(16)
LONGEST = 24  # periods
ONE_PERIOD = ("impact", "contact", "asymmetric")


class Masses:
    """A motor (mass 1, driven by ``a cos(t)``) in the gap (width 1) of a load, impact by impact.

    Between impacts the load moves straight on and the motor by ``-a cos(t)`` and a straight line. Masses that
    press on each other and part at almost no speed move on together until the force turns.
    """

    def __init__(self, load, restitution, a, t, speed):
        self.load, self.eps, self.a, self.t = load, restitution, a, t
        # on the lower face (x2 = x1), leaving at `speed`; the centre of mass at rest on average
        v = a * math.sin(t) / (1 + load)
        self.x1, self.v1, self.x2, self.v2 = 0.0, v - speed / (1 + load), 0.0, v + speed * load / (1 + load)
        self.strobe, self.sums, self.impacts = [], 0j, 0
        self.next_tick = 2 * math.pi * (math.floor(t / (2 * math.pi)) + 1)

    def motor(self, r):
        """Motor a time r from now, in free flight."""
        t, a = self.t, self.a
        line = self.v2 - a * math.sin(t)
        return (
            self.x2 + line * r + a * (math.cos(t) - np.cos(t + r)),
            line + a * np.sin(t + r),
        )

    def gap(self, r):
        return self.motor(r)[0] - self.x1 - self.v1 * r

    def next_impact(self):
        """Time to the next impact and its face: between two turns of the distance it is monotone."""
        q = math.sin(self.t) - (self.v2 - self.v1) / self.a
        at, before = 0.0, self.gap(0.0)
        for _ in range(4000):
            if abs(q) <= 1:
                turns = [(b - self.t) % (2 * math.pi) for b in (math.asin(q), math.pi - math.asin(q))]
                later = [r + 2 * math.pi * math.ceil((at - r) / (2 * math.pi) + 1e-12) for r in turns]
                then = min(r for r in later if r > at + 1e-12)
            else:
                then = at + 1.0
            after = self.gap(then)
            for face in (0.0, 1.0):
                if (after - face) * (1 if face else -1) > 0 and (before - face) * (1 if face else -1) < 0:
                    return brentq(lambda r, f=face: self.gap(r) - f, at, then, xtol=1e-15, rtol=1e-14), face
            at, before = then, after
        return None, None

    def together(self, r, face, t_end):
        """Both masses moving on at the common acceleration for a time r."""
        total, t, a = 1 + self.load, self.t, self.a
        v = (self.v2 + self.load * self.v1) / total

        def load(s):
            return self.x1 + (v - a / total * math.sin(t)) * s + a / total * (math.cos(t) - np.cos(t + s))

        self._record(r, load, lambda s: (face, 0.0))
        x, speed = float(load(r)), v + a / total * (math.sin(t + r) - math.sin(t))
        self.x1, self.x2, self.v1, self.v2, self.t = x, x + face, speed, speed, t_end

    def _record(self, r, load, relative):
        """Fundamental of the load over a stretch, and (gap, its rate) at whole periods inside."""
        edges = sorted({0.0, r, *(self.next_tick - self.t + 2 * math.pi * k for k in range(int(r / 6) + 2))})
        edges = [e for e in edges if 0 <= e <= r]
        for low, high in zip(edges[:-1], edges[1:], strict=True):
            pieces = max(1, math.ceil((high - low) / 2))
            for i in range(pieces):
                half = (high - low) / pieces / 2
                s = low + half * (2 * i + 1 + NODE)
                self.sums += half * np.sum(WEIGHT * load(s) * np.exp(-1j * (self.t + s)))
            if high + self.t >= self.next_tick - 1e-13:
                g, rate = relative(high)
                self.strobe.append((float(g), float(rate), float(load(high)), self.sums))
                self.next_tick += 2 * math.pi

    def step(self):
        """One flight and its impact; False where no impact comes."""
        r, face = self.next_impact()
        if r is None:
            return False
        self._record(r, lambda s: self.x1 + self.v1 * s, lambda s: (self.gap(s), self.motor(s)[1] - self.v1))
        x2, v2 = self.motor(r)
        self.x1, self.t = self.x1 + self.v1 * r, self.t + r
        self.x2 = self.x1 + face
        common, after = (v2 + self.load * self.v1) / (1 + self.load), -self.eps * (v2 - self.v1)
        self.v1, self.v2 = common - after / (1 + self.load), common + after * self.load / (1 + self.load)
        self.impacts += 1
        press = self.a * math.cos(self.t) * (1 if face else -1)
        if press > 0 and 2 * abs(after) < 1e-4 * press * (1 - self.eps):
            release = math.ceil(self.t / math.pi - 0.5) * math.pi + math.pi / 2
            self.v1 = self.v2 = common
            self.together(release - self.t, face, release)
            self._leave(face)
        return True

    def _leave(self, face):
        """At the turn of the force the distance opens as the cube of time: set off a little way on."""
        r = 1e-4
        self._record(r, lambda s: self.x1 + self.v1 * s, lambda s: (self.gap(s), self.motor(s)[1] - self.v1))
        x2, v2 = self.motor(r)
        self.x1, self.x2, self.v2, self.t = self.x1 + self.v1 * r, float(x2), float(v2), self.t + r


def independent(load, eps, a, t, speed, settle=300, most=60_000):
    """(periods or None, N m w^2) of the motion that a start leads to; periods 0 where no impact comes."""
    m = Masses(load, eps, a, t, speed)
    while len(m.strobe) < settle + 2 * LONGEST and m.impacts < most:
        if not m.step():
            return 0, 0j
    s = m.strobe
    if len(s) < settle + 2 * LONGEST:
        return None, None
    for p in range(1, LONGEST + 1):
        apart = max(abs(s[-1 - k][i] - s[-1 - k - p][i]) for k in range(p) for i in (0, 1))
        if apart < 1e-7 * (1 + a):
            drift = s[-1][2] - s[-1 - p][2]
            X = (s[-1][3] - s[-1 - p][3]) / (math.pi * p) - 1j * drift / (math.pi * p)
            return p, X / a * (1 + load)
    return None, None


def drives(count):
    rng = np.random.default_rng(12)
    yield 0.861, 0.25, 8.0
    for _ in range(count - 1):
        yield (
            rng.uniform(0, 0.95),
            float(np.exp(rng.uniform(np.log(0.1), np.log(10)))),
            float(np.exp(rng.uniform(np.log(0.1), np.log(20)))),
        )


@pytest.mark.parametrize(("eps", "a", "load"), [*drives(44)])
def test_every_random_drive_is_named_by_the_period_an_independent_map_has(eps, a, load):
    family = cdf.describing_function_family(cdf.backlash_masses(1.0, load, 1.0, eps), [a], [1.0])
    n, regime = complex(family.N[0, 0] * (1 + load)), str(family.motion[0, 0])
    starts = [(-math.pi / 2, 1e-12), (-1.0, 0.7 * (1 + a)), (0.9, 0.4 * (1 + a)), (2.2, 1.3 * (1 + a))]
    starts.append((-2.6, 0.2 * (1 + a)))  # the starts that backlash_family documents
    found = []
    for settle in (int(40 + 12 / (1 - eps)), 600, 3000):  # longer where no start has led to the motion named
        for start in starts:
            periods, other = independent(load, eps, a, *start, settle=settle)
            found.append((periods, other))
            if periods == 0:
                named = regime == "free"
            elif periods is None:
                named = regime == "aperiodic"
            else:
                names = ONE_PERIOD if periods == 1 else (f"subharmonic {periods}",)
                named = regime in names and abs(other - n) < 1e-6 * abs(n)  # measured 2e-9
            if named:
                return
    raise AssertionError((n, regime, found))


def test_period_three_beside_period_one_is_listed_with_its_period():
    """One drive of the findings: the symmetric motion is named, a release leads to period three."""
    eps, a = 0.861, 0.25
    periods, n = independent(8.0, eps, a, -math.pi / 2, 1e-12)
    listed = backlash_attractors(a, eps)
    assert periods == 3
    three = [m for m in listed if m.period == 3]
    assert three and min(abs(-1 - m.q - n) for m in three) < 1e-7 and three[0].regime == "subharmonic 3"
    assert any(m.regime == "impact" and m.period == 1 for m in listed)


def test_a_gap_too_wide_to_be_crossed_leaves_the_load_alone():
    plant = cdf.backlash_masses(1, 8, 1e9, 0.2)
    family = cdf.describing_function_family(plant, [10.0], [10.0])
    assert family.regime[0, 0] == "free" and family.N[0, 0] == 0
    motor = cdf.describing_function_family(plant, [10.0], [10.0], output="x_motor")
    assert motor.regime[0, 0] == "free" and motor.N[0, 0] == pytest.approx(-1 / 100, rel=1e-9)


@pytest.mark.parametrize(("eps", "a"), [(0.059, 0.0383), (0.026, 0.0643), (0.182, 0.146)])
def test_slow_motions_under_weak_forces_are_found_by_their_impacts(eps, a, tmp_path):
    family = cdf.describing_function_family(cdf.backlash_masses(1.0, 3.0, 1.0, eps), [a], [1.0])
    periods, n = independent(3.0, eps, a, -1.0, 0.7 * (1 + a))
    assert (family.regime[0, 0], family.periods[0, 0]) == ("subharmonic", periods)
    assert family.motion[0, 0] == f"subharmonic {periods}"
    saved = cdf.load_family(family.save(tmp_path / "slow.npz"))
    assert (saved.regime == family.regime).all() and (saved.periods == family.periods).all()
    assert abs(family.N[0, 0] * 4 - n) < 1e-6 * abs(n)
