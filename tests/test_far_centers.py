"""A spring of the model whose center lies far outside the stroke: a preload, which no fit takes away."""

import numpy as np

import ctrl_df as cdf
from ctrl_df.identify.estimation.segmented import prepare

TIMES = 5e-3 * np.arange(1200)
VALVE = cdf.friction_mass(2.0, 6.0, 300.0).with_effect(cdf.LinearSpring(2e4, center=-0.1))
STATED = VALVE.with_parameters({"mass": 2.3, "viscous.coefficient": 250.0, "coulomb.level": 5.0})
NAMES = ("mass", "viscous.coefficient", "coulomb.level", "linear_spring.stiffness", "linear_spring.center")
KNOWN_STIFFNESS = [n for n in NAMES if n != "linear_spring.stiffness"]


def run(machine):
    """Return a record that moves by 4 mm, 120 mm from where the spring would be at rest."""
    rng = np.random.default_rng(3)
    force = 2400 + sum(
        a * np.sin(2 * np.pi * f * TIMES + k) for a, f, k in ((20, 0.4, 0), (14, 1.1, 1), (9, 2.3, 2))
    )
    x = cdf.event_response(machine, TIMES, force, initial_state={"x": 0.02}, input_hold="zoh").outputs[0]
    noise = 4e-6 * rng.standard_normal(TIMES.size)
    return cdf.Measurement(TIMES, force, np.asarray(x) + noise, input_unit="N", output_unit="m")


def test_a_stated_center_is_where_fits_begin():
    data = prepare(STATED, [run(VALVE)])
    assert data.record_scales.stroke < 0.006
    for level in data.segmentations:
        assert level.fit(STATED, NAMES, iterations=0).parameters["linear_spring.center"] == -0.1


def test_what_is_missing_beside_a_preload_is_found():
    # fits began where the center is within ten strokes: "the refitted model errs by 8033%", and `unknown`
    names = ["quadratic_drag", "input_lag"]
    for hidden, verdict in ((cdf.QuadraticDrag(2e4), "effect"), (None, "none")):
        machine = VALVE if hidden is None else VALVE.with_effect(hidden)
        found = cdf.diagnose(STATED, run(machine), candidates=names, free=KNOWN_STIFFNESS)
        assert found.verdict == verdict, found.explanation
        assert abs(found.baseline.model.parameters["linear_spring.center"].value + 0.1) < 5e-3
