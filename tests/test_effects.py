"""Effects state what is known of them; what they state is true."""

import numpy as np
import pytest

import ctrl_df as cdf
from ctrl_df.blocks.stated import stated_parameters
from ctrl_df.identify.shooting.scales import Scales
from ctrl_df.identify.starting.extend import why_not
from ctrl_df.units import dimension

LIBRARY = cdf.effect_library()
SIZES = {"N": 2.0, "m": 0.3, "s": 0.7, "kg": 1.9}


def _made(cls, factor=1.0):
    """An effect with every parameter of a typical size; its first one times a factor."""
    values = {}
    for i, (name, stated) in enumerate(stated_parameters(cls)):
        value = 0.4 if stated["upper"] == 1.0 else 1.3
        values[name] = value * (factor if i == 0 else 1.0)
    return cls(**values)


def _laws(said=lambda cls: True):
    laws = {k: c for k, c in LIBRARY.items() if c.law is not None and c.role in ("force", "friction")}
    return [(k, c) for k, c in laws.items() if said(c)]


@pytest.mark.parametrize(("key", "cls"), _laws(lambda cls: cls.affine))
def test_laws_said_to_be_affine_are(key, cls):
    effect, rng = _made(cls), np.random.default_rng(3)
    for direction in (-1.0, 1.0):

        def at(x, v, direction=direction):
            if cls.role == "friction":
                return cls.law(
                    1.0, direction, abs(v), 2.0, effect.values, *((x, 0.0, 0.0) if cls.asks else ())
                )
            return cls.law(0.0, x, v, np.zeros(1), effect.values, np.zeros(1))

        for _ in range(20):
            (x, v), (a, b) = rng.uniform(0.1, 9, 2), rng.uniform(0.1, 9, 2)
            v, b = direction * v, direction * b
            assert at((x + a) / 2, (v + b) / 2) == pytest.approx((at(x, v) + at(a, b)) / 2, rel=1e-12)


@pytest.mark.parametrize(("key", "cls"), _laws(lambda cls: cls.role == "force"))
def test_laws_said_to_be_free_of_the_place_are_and_the_others_are_not(key, cls):
    effect = _made(cls)
    forces = {
        cls.law(0.0, x, 0.8, np.zeros(1), effect.values, np.zeros(1)) for x in (-3.0, -0.4, 0.1, 0.9, 7.0)
    }
    assert (len(forces) == 1) == cls.place_free


@pytest.mark.parametrize(("key", "cls"), _laws(lambda cls: cls.proportional))
def test_effects_said_to_vanish_in_proportion_do(key, cls):
    def at(factor):
        p = _made(cls, factor).values
        if cls.role == "friction":
            told = (0.3, 5.0, -2.0) if cls.asks else ()
            return cls.law(1.0, 1.0, 0.8, 20.0, p, *told) - 20.0
        return cls.law(0.0, 2.0, 0.8, np.zeros(1), p, np.zeros(1))

    assert at(0.1) == pytest.approx(0.1 * at(1.0), rel=1e-9)


def test_thresholds_are_static_levels():
    marked = {k for k, c in LIBRARY.items() if any(s.get("threshold") for _, s in stated_parameters(c))}
    assert marked == {k for k, c in LIBRARY.items() if c.role == "friction" and _static(c)}


def _static(cls):
    """Whether a friction law holds a resting body by more than a moving one."""
    p = tuple(9.0 for _ in stated_parameters(cls))
    told = (0.3, 5.0, -2.0) if cls.asks else ()
    return cls.law(0.0, 1.0, 0.0, 5.0, p, *told) > cls.law(1.0, 1.0, 1e9, 5.0, p, *told)


def test_sizes_follow_from_the_unit_whatever_it_is():
    scales = Scales(SIZES["N"], SIZES["m"], SIZES["m"] / SIZES["s"], SIZES["kg"], SIZES["N"])
    assert scales.of("N s^3/m^3") == pytest.approx(SIZES["N"] * (SIZES["s"] / SIZES["m"]) ** 3)
    assert scales.of("N/m^2") == pytest.approx(SIZES["N"] / SIZES["m"] ** 2) and scales.of("") == 1.0
    with pytest.raises(ValueError, match="a unit must be one of"):
        scales.of("furlong")
    for cls in LIBRARY.values():
        for _, stated in stated_parameters(cls):
            unit = stated["unit"]
            # of a voltage nothing is scaled
            force, place, speed = (1e3 * v for v in (scales.force, scales.position, scales.speed))
            in_mm = Scales(force, place, speed, scales.mass, scales.drive)
            power = sum(dimension(unit).get(b, 0) for b in ("N", "m"))
            assert in_mm.of(unit) == pytest.approx(1e3**power * scales.of(unit))


@pytest.mark.parametrize("law", [cdf.AsymmetricCoulomb, cdf.Bristle, cdf.MaxwellSlip, cdf.LooseLinkage])
def test_what_changes_a_friction_level_is_a_candidate_where_there_is_one(law):
    """Without one, unequal levels are the map of a Coulomb level and a constant force. A servo missing both
    was told to have these."""
    bare = cdf.Mass(2.0).with_effect(cdf.Viscous(1.0))
    assert why_not(law, bare) and not why_not(law, bare.with_effect(cdf.Coulomb(3.0)))
