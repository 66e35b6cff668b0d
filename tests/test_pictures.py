"""Every picture at the width of a column and of a page: labels whole and apart, no rcParams changed."""

import control as ct
import matplotlib.pyplot as plt
import numpy as np
import pytest
from legible import boxes, illegible

import ctrl_df as cdf

PID, GAINS = cdf.pid(1800, 19500, 100), cdf.pid(2000, 44250, 130)
DRIVE, STICKING = cdf.backlash_masses(1, 8, 0.018, 0.2), cdf.friction_mass(9, 5, 0.5, static=5.5)


@pytest.fixture(scope="module")
def record():
    t = np.arange(0, 4, 0.01)
    force = 9 * np.sin(3 * t) + 5 * np.sin(8 * t)
    machine = cdf.friction_mass(2.2, 3.0, 6.0).with_effect(cdf.ConstantForce(1.0))
    x = np.asarray(cdf.event_response(machine, t, force, input_hold="zoh").outputs)[0]
    return cdf.Measurement(t, force, x + 1e-4 * np.random.default_rng(1).standard_normal(t.size))


@pytest.fixture(scope="module")
def pictures(record):
    """Functions that draw, by name."""
    axis, base = cdf.friction_mass(9, 5, 0.5), cdf.friction_mass(2.0, 2.5, 5.0)
    family = cdf.describing_function_family(axis, np.geomspace(6, 60, 12), np.geomspace(2, 30, 12))
    relay = cdf.describing_function_family(cdf.relay(1), np.geomspace(0.1, 10, 30))
    turned = cdf.describing_function_family(cdf.relay_with_hysteresis(1, 0.2), np.geomspace(0.3, 3, 30))
    gap = cdf.describing_function_response(PID, DRIVE, np.geomspace(5, 60, 12), np.geomspace(8, 40, 12))
    hunting = cdf.describing_function_response(
        GAINS, STICKING, np.geomspace(5.6, 60, 30), np.geomspace(2, 60, 30)
    )
    stable = next(c for c in hunting.limit_cycles if c.stable)
    rattle = cdf.find_limit_cycle(cdf.closed_loop(PID, DRIVE), guess=gap.limit_cycles[0])
    stick = cdf.find_limit_cycle(cdf.closed_loop(GAINS, STICKING), guess=stable)
    seen = cdf.compare(base, record)
    fitted = cdf.refit(base, record).comparison
    names = ["constant_force", "quadratic_drag"]
    study = cdf.improve(base, record, candidates=names, max_effects=1)
    A, w = np.geomspace(6, 50, 4), np.geomspace(3, 20, 4)
    N = cdf.describing_function_family(axis.with_effect(cdf.QuadraticDrag(30.0)), A, w).N
    table = cdf.FrequencyMeasurement(A, w, N)
    found = cdf.diagnose(axis, table, candidates=["quadratic_drag", "viscous"])
    return {
        "family": family.plot,
        "harmonics": family.plot_harmonics,
        "relay": relay.plot,
        "hysteresis": turned.plot,
        "gap": gap.plot,
        "hunting": hunting.plot,
        "with exact orbits": lambda **k: hunting.plot(exact=[stick], **k),
        "rattle": rattle.plot,
        "stick": stick.plot,
        "comparison": seen.plot,
        "two models": lambda **k: seen.plot(beside=fitted, labels=("nominal", "refitted"), **k),
        "diagnosis": study.steps[0].diagnosis.plot,
        "ladder": study.plot,
        "missing force": seen.missing_force.plot,
        "over velocity": lambda **k: seen.missing_force.plot(against="velocity", **k),
        "table": cdf.compare(axis, table).plot,
        "table diagnosis": found.plot,
    }


@pytest.mark.parametrize("width", [3.3, 7.0])
def test_every_label_can_be_read(pictures, width):
    before = dict(plt.rcParams)
    wrong = {}
    for name, draw in pictures.items():
        plt.close("all")
        drawn = draw(width=width)
        assert isinstance(drawn, ct.ControlPlot) and drawn.figure.get_figwidth() == width
        cut, over = illegible(drawn.figure)
        if cut or over:
            wrong[name] = cut, over
    plt.close("all")
    assert wrong == {}
    assert dict(plt.rcParams) == before


def test_a_title_of_the_user_takes_the_place_of_ours(pictures):
    for name in ("hunting", "missing force", "ladder", "relay", "diagnosis"):
        plt.close("all")
        drawn = pictures[name](width=3.3)
        ax = np.ravel(drawn.axes)[0]
        ours = ax.get_title()
        ax.set_title("Run 3, after greasing")
        words = [text for text, _ in boxes(drawn.figure)]
        assert ours and ours not in words and "Run 3, after greasing" in words
        assert illegible(drawn.figure) == ([], []), name
    plt.close("all")


def test_a_picture_takes_an_empty_figure_as_it_is(pictures):
    plt.close("all")
    figure = plt.figure(figsize=(3.3, 3.0))
    assert pictures["ladder"]().figure is figure and tuple(figure.get_size_inches()) == (3.3, 3.0)
    assert pictures["ladder"]().figure is not figure
    plt.close("all")


def test_a_nyquist_picture_in_a_column():
    plt.close("all")
    plt.figure(figsize=(3.3, 2.8))
    drawn = cdf.describing_function_plot(ct.tf([8], [1, 2, 2, 1]), cdf.saturation(1), np.linspace(1, 4, 20))
    assert illegible(drawn.figure) == ([], [])
    plt.close("all")


def test_exact_orbits_stand_beside_predictions():
    plt.close("all")
    response = cdf.describing_function_response(ct.tf([8], [1, 2, 2, 1]), cdf.saturation(1), [1.1, 5])
    check = cdf.verify(response)
    ax = response.plot(exact=check).axes[0, 0]
    stars = [line for line in ax.lines if line.get_marker() == "*"]
    orbit = check.orbits[0]
    assert stars[0].get_xdata()[0] == pytest.approx((8 / np.polyval([1, 2, 2, 1], 1j * orbit.omega)).real)
    assert f"{orbit.amplitude:.2g}" in " ".join(t.get_text() for t in ax.texts)
    plt.close("all")


def test_an_unreliable_prediction_is_not_drawn_as_stable(pictures):
    plt.close("all")
    said = [t.get_text() for t in pictures["hunting"]().axes[0, 0].get_legend().get_texts()]
    assert "prediction, unreliable" in said and "predicted cycle, stable" not in said
    plt.close("all")


@pytest.mark.quick
def test_curves_between_coarse_nodes_are_smooth():
    family = cdf.describing_function_family(
        cdf.friction_mass(9, 5, 0.5), np.geomspace(6, 60, 5), np.geomspace(2, 30, 5)
    )
    drawn = family.plot()
    ax = drawn.axes[0, 0]
    for line in [*drawn.lines[0], *drawn.lines[1]]:
        at = ax.transAxes.inverted().transform(ax.transData.transform(np.column_stack(line.get_data())))
        at = at[((at > 0) & (at < 1)).all(axis=1)]
        step = np.diff(at, axis=0)
        size = np.hypot(*step.T)
        turn = np.abs(np.diff(np.unwrap(np.arctan2(step[:, 1], step[:, 0]))))
        assert np.degrees(turn[np.minimum(size[1:], size[:-1]) > 5e-3]).max(initial=0) < 8
    plt.close("all")


def test_comparisons_in_one_picture_need_one_record(pictures, record):
    base = cdf.friction_mass(2.0, 2.5, 5.0)
    whole, half = cdf.compare(base, record), cdf.compare(base, record.slice(0, 2))
    with pytest.raises(ValueError, match="same records"):
        whole.plot(beside=half)
    with pytest.raises(ValueError, match="width"):
        whole.plot(width=-1)


def test_a_run_shows_units_events_and_where_it_sticks():
    plt.close("all")
    t = np.linspace(0, 2, 201)
    run = cdf.event_response(cdf.friction_mass(9, 5, static=5.5), t, 7 * np.sin(3 * t))
    drawn = run.plot(plot_inputs=True)
    assert [ax.get_ylabel() for ax in drawn.axes[:, 0]] == ["x [m]", "v [m/s]", "F [N]"]
    told = [text.get_text() for text in drawn.axes[0, 0].get_legend().get_texts()]
    assert told == ["stuck", "stick", "breakaway"] and len(drawn.axes[0, 0].patches) == 2
    assert "sys[" not in drawn.figure.get_suptitle()
    plt.close("all")
    plain = run.plot(events=False)
    assert plain.axes[0, 0].get_legend() is None
    plt.close("all")
