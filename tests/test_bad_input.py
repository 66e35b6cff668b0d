"""Bad input over the whole public surface: one error at once, of the right type, with rule, value, remedy.

Every case is a call, the type of its error, and words that the message must hold. `refused` asks besides that
it takes less than two seconds, is one readable sentence or two, and comes from no inner part by accident.
"""

import copy
import dataclasses
import inspect
import os
import pickle
import re
import time
import types
import warnings
from dataclasses import dataclass

import control as ct
import matplotlib.pyplot as plt
import numpy as np
import pytest

import ctrl_df as cdf
from ctrl_df.cli import main
from ctrl_df.model_file import EXAMPLE, read_model

NAN, INF = float("nan"), float("inf")
MASKED = np.ma.masked_equal([0.0, 1.0, 2.0], 1.0)


def refused(call, error, *words):
    """Return the message of the error that a call must raise at once."""
    began = time.perf_counter()
    with warnings.catch_warnings(), pytest.raises(error) as caught:
        warnings.simplefilter("ignore")
        call()
    text = str(caught.value)
    assert type(caught.value) in (
        ValueError,
        TypeError,
        AttributeError,
        FileNotFoundError,
        RuntimeError,
    ) or isinstance(caught.value, OSError)
    assert time.perf_counter() - began < 2.0, "an error that comes late"
    for word in words:
        assert word in text, f"{word!r} is not in {text!r}"
    assert 20 < len(text) < 1000 and "\n" not in text, text
    assert text[-1] in ".)" or re.search(r"Did you mean [^?]+\?$", text), text
    return text


def table(cases):
    """Parametrize over (name, call, error, words ...)."""
    return pytest.mark.parametrize("case", cases, ids=[c[0] for c in cases])


MASS = cdf.Mass(9)
DRIVE = cdf.friction_mass(9, 5, 0.5)
PID = cdf.pid(2000, 44250, 130)

# --- blocks ------------------------------------------------------------------------------------------------


@table(
    [
        ("saturation(-1)", lambda: cdf.saturation(-1), ValueError, "ub > 0", "-1", "saturation(ub, lb)"),
        ("saturation(0)", lambda: cdf.saturation(0), ValueError, "ub > 0"),
        ("saturation(lb=ub)", lambda: cdf.saturation(1, 1), ValueError, "lb < ub"),
        ("saturation(True)", lambda: cdf.saturation(True), TypeError, "one real number", "True"),
        ("mass=True", lambda: cdf.Mass(True), TypeError, "one real number [kg]", "True"),
        ("mass='9'", lambda: cdf.Mass("9"), TypeError, "one real number", "'9'", "float()"),
        ("mass=b'9'", lambda: cdf.Mass(b"9"), TypeError, "one real number", "float()"),
        ("mass=[9]", lambda: cdf.Mass([9]), TypeError, "one real number", "[9]"),
        ("mass=array", lambda: cdf.Mass(np.array([9.0])), TypeError, "one real number"),
        ("mass complex", lambda: cdf.Mass(9 + 0j), TypeError, "one real number", "9+0j"),
        ("mass np.complex", lambda: cdf.Mass(np.complex128(9)), TypeError, "one real number"),
        ("mass np.bool", lambda: cdf.Mass(np.True_), TypeError, "one real number"),
        ("mass=None", lambda: cdf.Mass(None), TypeError, "one real number", "None"),
        ("mass nan", lambda: cdf.Mass(NAN), ValueError, "mass > 0 and finite", "nan"),
        ("mass=10**400", lambda: cdf.Mass(10**400), ValueError, "finite"),
        ("effects=5", lambda: cdf.Mass(9, effects=5), TypeError, "Coulomb(5)", "got 5"),
        ("effects='coulomb'", lambda: cdf.Mass(9, effects="coulomb"), TypeError, "'coulomb'"),
        ("effect class", lambda: cdf.Mass(9, [cdf.Coulomb]), TypeError, "Call the class"),
        ("with_effect(None)", lambda: MASS.with_effect(None), TypeError, "None"),
        ("without_effect(5)", lambda: DRIVE.without_effect(5), ValueError, "coulomb", "5"),
        ("measured", lambda: cdf.Mass(9, measured="motr"), ValueError, "'load' or 'motor'", "motr"),
        ("with_parameters(None)", lambda: MASS.with_parameters(None), TypeError, "mapping", "None"),
        ("with_parameters(list)", lambda: MASS.with_parameters(["mass"]), TypeError, "mapping"),
        ("parameter text", lambda: MASS.with_parameters({"mass": "9"}), TypeError, "'9'"),
        ("parameter number", lambda: MASS.with_parameters({5: 9}), TypeError, "mass", "5"),
        ("parameter unknown", lambda: DRIVE.with_parameters({"coulom": 1}), ValueError, "coulomb.level"),
        ("element parameters", lambda: cdf.relay(1).with_parameters(None), TypeError, "mapping"),
        ("element unknown", lambda: cdf.relay(1).with_parameters({"lvl": 1}), ValueError, "level"),
        ("params= of a call", lambda: MASS.dynamics(0, [0, 0], [1], {"mass": "9"}), TypeError, "'9'"),
        ("params= negative", lambda: MASS.dynamics(0, [0, 0], [1], {"mass": -9}), ValueError, "mass > 0"),
        ("coulomb text", lambda: cdf.Coulomb("5"), TypeError, "level", "'5'"),
        ("stop lower text", lambda: cdf.HardStop(1, lower="a"), TypeError, "lower", "'a'"),
        ("stop lower nan", lambda: cdf.HardStop(1, lower=NAN), ValueError, "lower", "nan"),
        ("stop lower True", lambda: cdf.HardStop(1, lower=True), TypeError, "lower", "True"),
        ("stop upside down", lambda: cdf.HardStop(1, lower=2), ValueError, "lower < limit"),
        ("pid('2')", lambda: cdf.pid("2"), TypeError, "kp", "'2'"),
        ("pid(None)", lambda: cdf.pid(1, None), TypeError, "ki", "None"),
        ("pid complex", lambda: cdf.pid(1, 0, 1j), TypeError, "kd"),
        ("pid nan", lambda: cdf.pid(NAN), ValueError, "kp finite", "nan"),
        ("pid tf < 0", lambda: cdf.pid(1, tf=-1), ValueError, "tf >= 0", "ideal PID"),
        ("line text", lambda: cdf.piecewise_linear([0, 1], ["a", 2]), TypeError, "y", "text"),
        ("line ragged", lambda: cdf.piecewise_linear([0, [1]], [1, 2]), ValueError, "unequal length"),
        ("line nan", lambda: cdf.piecewise_linear([0, NAN], [1, 2]), ValueError, "NaN at index 1"),
        ("line None", lambda: cdf.piecewise_linear(None, [1, 2]), TypeError, "x", "None"),
        ("line masked", lambda: cdf.piecewise_linear([0, 1], MASKED[:2]), ValueError, "mask"),
        ("line falling", lambda: cdf.piecewise_linear([1, 0], [1, 2]), ValueError, "ascending", "Sort"),
        ("play(0)", lambda: cdf.play(0), ValueError, "gap > 0", "tight joint"),
        ("relay(inf)", lambda: cdf.relay(INF), ValueError, "finite", "inf"),
        ("rate text", lambda: cdf.rate_limiter("1"), TypeError, "rate", "'1'"),
        ("cubic None", lambda: cdf.cubic(None), TypeError, "coefficient"),
        ("element called with text", lambda: cdf.saturation(1)("2"), TypeError, "real numbers", "'2'"),
        ("element called with j", lambda: cdf.saturation(1)(1j), TypeError, "real numbers"),
        ("effect_class(list)", lambda: cdf.effect_class(["mass"]), TypeError, "effect id", "coulomb"),
        ("effect_class('x')", lambda: cdf.effect_class("x"), ValueError, "'x'", "register_effect"),
        ("register_effect(5)", lambda: cdf.register_effect(5), TypeError, "ctrl_df.Effect", "5"),
        ("keyword of a block", lambda: cdf.friction_mass(9, columb=5), TypeError, "columb=5", "n coulomb?"),
        ("keyword of an effect", lambda: cdf.Coulomb(levl=5), TypeError, "levl=5", "it takes level, side."),
        ("keyword of replace", lambda: cdf.Coulomb(5).replace(lvl=5), TypeError, "lvl=5", "level?"),
        ("keyword in capitals", lambda: cdf.pid(1, kI=5), TypeError, "kI=5", "Did you mean ki?"),
        ("too many", lambda: cdf.Mass(9, [], "motor"), TypeError, "2 without a name", "Name the others"),
        ("too few", lambda: cdf.TwoMass(1), TypeError, "load_mass", "Add"),
        ("by place and name", lambda: cdf.Mass(9, mass=9), TypeError, "mass once"),
        ("two of a kind", lambda: cdf.Mass(9, [cdf.Coulomb(1)] * 2), ValueError, "one Coulomb", "got two"),
        ("two gaps", lambda: cdf.Mass(9, [cdf.Backlash(1)] * 2), ValueError, "one Backlash"),
        ("name=5", lambda: cdf.Mass(9, name=5), TypeError, "name as text", "5"),
        ("name with a point", lambda: cdf.play(1, name="a.b"), ValueError, "without a point", "'a.b'"),
        ("name of a controller", lambda: cdf.pid(1, name=5), TypeError, "name as text"),
        ("name of a loop", lambda: cdf.closed_loop(PID, DRIVE, name="a.b"), ValueError, "without a point"),
        ("python-control's names", lambda: cdf.relay_hysteresis_nonlinearity("a", 1), TypeError, "'a'"),
    ]
)  # fmt: skip
def test_blocks(case):
    refused(*case[1:])


@pytest.mark.parametrize(
    "block", [DRIVE, cdf.Inertia(2.0), cdf.play(1), cdf.relay(1), cdf.Massless(cdf.Coulomb(1))]
)
def test_a_block_is_a_value_for_python_control_too(block):
    name, before = next(iter(block.params)), dict(block.params)

    def assign():
        block.params[name] = 30.0

    refused(assign, TypeError, "params['", "= 30.0", "with_parameters")
    refused(lambda: block.params.update({name: 30.0}), TypeError, "with_parameters")
    for attribute in ("params", "updfcn", "outfcn"):
        refused(
            lambda a=attribute: setattr(block, a, {}), AttributeError, f"{attribute}={{}}", "Make another"
        )
    assert block.params == before
    again = pickle.loads(pickle.dumps(block)), copy.deepcopy(block)
    assert all(other == block and other.name == block.name and other.params == before for other in again)
    block.params.copy()[name] = 30.0  # as python-control does
    if block.ninputs == 1 and block.nstates:
        loop = cdf.closed_loop(ct.tf([1], [1, 1]), block)
        refused(lambda: loop.params.update({name: 30.0}), TypeError, "give params=")
    for size in ("nstates", "ninputs", "noutputs"):
        setattr(block, size, getattr(block, size))  # is no change
        refused(lambda a=size: setattr(block, a, 7), AttributeError, f"{size}=7", "Make another")
    refused(lambda: block.set_outputs(9), AttributeError, "noutputs=9", "Make another")
    refused(lambda: setattr(block, "foo", 1), AttributeError, "no further attributes", "foo=1")
    assert not hasattr(block, "foo") and block.noutputs == len(block.output_labels)
    renamed = block.copy(name="second")
    renamed.name, renamed.output_labels = "third", [f"z{i}" for i in range(block.noutputs)]
    renamed.update_names(inputs=[f"w{i}" for i in range(block.ninputs)])
    assert renamed.input_labels != block.input_labels and renamed.noutputs == block.noutputs
    assert pickle.loads(pickle.dumps(block.params)) == before


def test_blocks_whose_parameters_stay_run_in_python_control():
    loop = cdf.closed_loop(cdf.pid(20, 0, 13), cdf.Mass(3.7))
    assert loop.params["mass"] == 3.7
    for params, mass in ((None, 3.7), ({"mass": 30.0}, 30.0)):
        own = ct.input_output_response(loop, [0, 0.1, 0.2], 1.0, params=params).outputs[0]
        alone = ct.input_output_response(
            cdf.closed_loop(cdf.pid(20, 0, 13), cdf.Mass(mass)), [0, 0.1, 0.2], 1.0
        ).outputs[0]
        assert own == pytest.approx(alone, rel=1e-9)
    slope = ct.linearize(cdf.Mass(3.7), [0, 0], [0], params={"mass": 2.0}).B
    assert slope[1, 0] == pytest.approx(0.5)


def test_every_effect_refuses_text_truth_and_nan():
    for effect in cdf.effect_library().values():
        fields = effect.__dataclass_fields__
        first = next(name for name in fields if "parameter" in fields[name].metadata)
        for value, error in (("1", TypeError), (True, TypeError), (NAN, ValueError), (None, TypeError)):
            refused(lambda e=effect, v=value: e(v), error, effect.__name__, first)


@pytest.mark.parametrize("name", sorted(set(cdf.__all__)))
def test_every_public_call_names_a_wrong_keyword(name):
    """By one mechanism, which leaves signatures as they are and what can be pickled so."""
    public = getattr(cdf, name)
    if isinstance(public, type) and not (dataclasses.is_dataclass(public) or "__init__" in vars(public)):
        return
    assert "__wrapped__" not in str(inspect.signature(public))
    if isinstance(public, types.FunctionType):
        assert pickle.loads(pickle.dumps(public)) is public
    stated = inspect.signature(public).parameters.values()
    if any(p.kind is p.VAR_KEYWORD for p in stated) or not stated:
        return
    refused(lambda: public(wrong_word=1), TypeError, public.__name__, "unrecognized keyword: wrong_word=1")


@table(
    [
        ("with_parameters", lambda: MASS.with_parameters(mass=2), TypeError, "mass=2", "Give values"),
        ("with_effect()", lambda: MASS.with_effect(), TypeError, "with_effect needs effect", "Add"),
        ("with_effect, two", lambda: MASS.with_effect(cdf.Coulomb(1), cdf.Viscous(1)), TypeError, "got 2"),
        ("without_effect()", lambda: DRIVE.without_effect(), TypeError, "without_effect needs id"),
        ("of an element", lambda: cdf.relay(1).with_parameters(level=2), TypeError, "level=2", "values"),
        ("of an effect", lambda: cdf.Coulomb(1).replace(2), TypeError, "replace", "got 1"),
        ("of a family", lambda: SMALL.frd(), TypeError, "frd needs amplitude"),
        ("of a result", lambda: cdf.verify(CHECKED).table(foo=1), TypeError, "foo=1", "no keywords"),
    ]
)  # fmt: skip
def test_methods_name_what_is_wrong_with_a_call_as_functions_do(case):
    refused(*case[1:])


@table(
    [
        ("part", lambda: DRIVE.with_parameters({"coulomb": 1}), "Did you mean coulomb.level?"),
        ("letter", lambda: DRIVE.with_parameters({"coulomb.levl": 1}), "Did you mean coulomb.level?"),
        ("effect", lambda: DRIVE.without_effect("colomb"), "Did you mean coulomb?"),
        ("id", lambda: cdf.effect_class("stribek"), "Did you mean stribeck?"),
        ("params", lambda: cdf.event_response(DRIVE, T, params={"masss": 1}), "Did you mean mass?"),
        ("owner", lambda: cdf.event_response(LOOP, T, params={"plant.mass": 1}), "Did you mean mass?"),
        ("hold", lambda: cdf.event_response(DRIVE, T, input_hold="linaer"), "Did you mean linear?"),
        ("no hold", lambda: cdf.event_response(DRIVE, T, input_hold="foh"), "Give one of these."),
        ("unit", lambda: cdf.parameter("mms"), "Did you mean mm s or ms? Known are m, "),
    ]
)  # fmt: skip
def test_a_name_that_is_nearly_right_is_recognized(case):
    refused(case[1], ValueError, case[2])


PICTURES = {
    "family": lambda: SMALL.plot(foo=2),
    "element": lambda: STATIC.plot(foo=2),
    "harmonics": lambda: SMALL.plot_harmonics(foo=2),
    "Nyquist": lambda: cdf.describing_function_plot(CHECKED, foo=2),
    "run": lambda: cdf.event_response(DRIVE, T, 1.0).plot(foo=2),
    "orbit": lambda: cdf.find_limit_cycle(LOOP).plot(foo=2),
}


@pytest.mark.parametrize("picture", PICTURES)
def test_a_picture_names_a_wrong_keyword_before_it_draws(picture):
    before = plt.get_fignums()
    with pytest.raises(TypeError, match=r"unrecognized keyword: foo=2; it takes .*title|what ct\.") as caught:
        PICTURES[picture]()
    assert isinstance(caught.value, AttributeError)  # as matplotlib's own
    assert plt.get_fignums() == before


def test_python_controls_answer_is_told_from_ours():
    own = ct.describing_function_response(ct.tf([8], [1, 2, 2, 1]), ct.saturation_nonlinearity(1), [1, 4])
    for call in (cdf.verify, cdf.describing_function_plot):
        refused(lambda c=call: c(own), TypeError, "control.descfcn.", "ctrl_df.describing_function_response")


def test_a_class_that_is_no_effect_is_not_registered():
    @dataclass(frozen=True)
    class Rope:
        level: float

    refused(lambda: cdf.register_effect(Rope), TypeError, "derived from ctrl_df.Effect")


def test_numbers_of_every_kind_are_taken():
    for value in (9, 9.0, np.float32(9), np.int64(9), np.array(9.0), MASS.parameters["mass"]):
        assert cdf.Mass(value).mass == 9.0
    assert cdf.Mass(9, effects=cdf.Coulomb(5)).effects == (cdf.Coulomb(5),)
    assert cdf.saturation_nonlinearity(-1).ub == 1.0  # python-control's own meaning


# --- linearizations that mean nothing ----------------------------------------------------------------------


def test_linearizing_friction_at_rest_warns_with_reason_and_remedy():
    with pytest.warns(UserWarning, match="dry friction .coulomb, 5 N. jumps.*-5556.*Linearize at a speed"):
        ct.linearize(DRIVE, [0, 0], [0])
    with pytest.warns(UserWarning, match="a jump or a corner at u = 0"):
        ct.linearize(cdf.relay(1), [], [0])
    with pytest.warns(UserWarning, match="depends on its past"):
        ct.linearize(cdf.play(1), [0], [0])
    with pytest.warns(UserWarning, match="contact closed"):
        ct.linearize(cdf.backlash_masses(1, 8, 0.1), np.zeros(4), [0])


def test_linearizing_a_loop_warns_as_its_block_does():
    loop = cdf.closed_loop(PID, DRIVE)
    with pytest.warns(UserWarning, match="dry friction"):
        ct.linearize(loop, 0, 0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ct.linearize(loop, [0, 0, 0.1], 0)


def test_linearizing_where_there_is_a_slope_does_not_warn():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert ct.linearize(DRIVE, [0, 0.1], [0]).poles().real.min() == pytest.approx(-0.5 / 9, rel=1e-3)
        assert ct.linearize(cdf.saturation(1), [], [0]).D[0, 0] == pytest.approx(1)
        ct.linearize(cdf.friction_mass(9, 0, 0.5), [0, 0], [0])
        ct.linearize(cdf.backlash_masses(1, 8, 0.1), [0, 0, 0.05, 0], [0])


# --- simulation --------------------------------------------------------------------------------------------

LOOP = cdf.closed_loop(PID, DRIVE)
T = np.linspace(0, 1, 11)


def run(**keywords):
    return lambda: cdf.event_response(LOOP, **{"timepts": T, "inputs": 0, **keywords})


@table(
    [
        ("rtol=0", run(rtol=0), ValueError, "rtol", "got rtol=0", "1e-09"),
        ("rtol=-1", run(rtol=-1), ValueError, "rtol", "-1"),
        ("rtol=nan", run(rtol=NAN), ValueError, "rtol", "nan"),
        ("rtol=1", run(rtol=1.0), ValueError, "rtol", "1"),
        ("rtol='1e-6'", run(rtol="1e-6"), TypeError, "rtol", "'1e-6'"),
        ("rtol=None", run(rtol=None), TypeError, "rtol", "None"),
        ("rtol of each state", run(rtol=[1e-6] * 3), TypeError, "one real number"),
        ("atol=0", run(atol=0), ValueError, "atol > 0"),
        ("atol=nan", run(atol=NAN), ValueError, "atol > 0"),
        ("max_step=0", run(max_step=0), ValueError, "max_step > 0", "got max_step=0"),
        ("max_step=nan", run(max_step=NAN), ValueError, "max_step > 0"),
        ("max_step too short", run(max_step=1e-300), ValueError, "max_step >=", "1e-300", "Raise"),
        ("max_step=True", run(max_step=True), TypeError, "max_step"),
        ("max_steps=0", run(max_steps=0), ValueError, "max_steps", "integer >= 1"),
        ("max_steps=nan", run(max_steps=NAN), ValueError, "max_steps", "nan"),
        ("max_steps=1.5", run(max_steps=1.5), ValueError, "max_steps", "1.5"),
        ("inputs=nan", run(inputs=NAN), ValueError, "inputs finite", "NaN"),
        ("inputs with nan", run(inputs=np.where(T > 0.5, NAN, 0)), ValueError, "NaN at index 6"),
        ("inputs=inf", run(inputs=INF), ValueError, "inputs finite", "infinity"),
        ("inputs complex", run(inputs=1j * T), TypeError, "real numbers", "complex"),
        ("inputs one complex", run(inputs=0j), TypeError, "real numbers", "complex"),
        ("inputs text", run(inputs="0"), TypeError, "real numbers", "'0'"),
        ("inputs None", run(inputs=None), TypeError, "None"),
        ("inputs truth", run(inputs=T > 0.5), TypeError, "truth values"),
        ("inputs too few", run(inputs=T[:-1]), ValueError, "(1, 11)", "(1, 10)"),
        ("inputs too many", run(inputs=[T, T]), ValueError, "(1, 11)"),
        ("inputs ragged", run(inputs=[[0, 1], [0]]), ValueError, "got shape (2,)", "Sample"),
        ("inputs masked", run(inputs=np.ma.masked_greater(T, 0.5)), ValueError, "masked"),
        ("input law of text", run(inputs=lambda t: "a"), TypeError, "inputs(t=0)", "'a'"),
        ("input law of nan", run(inputs=lambda t: NAN), ValueError, "inputs(t=0)", "NaN"),
        ("input law of two", run(inputs=lambda t: [0, 1]), ValueError, "return 1 numbers", "got 2"),
        ("input law raises", run(inputs=lambda t: 1 / 0), RuntimeError, "ZeroDivisionError"),
        ("input law of two arguments", run(inputs=lambda t, x: 0), RuntimeError, "input at t = 0"),
        ("state nan", run(initial_state=[0, NAN, 0]), ValueError, "initial_state finite", "index 1"),
        ("state text", run(initial_state="0"), TypeError, "initial_state"),
        ("state None", run(initial_state=None), TypeError, "initial_state"),
        ("state complex", run(initial_state=1j), TypeError, "initial_state", "complex"),
        ("state too short", run(initial_state=[0, 0]), ValueError, "3", "(2,)"),
        ("state a matrix", run(initial_state=np.zeros((2, 2))), ValueError, "(2, 2)"),
        ("hold", run(input_hold="cubic"), ValueError, "'linear' or 'zoh'", "'cubic'"),
        ("hold None", run(input_hold=None), TypeError, "'linear' or 'zoh'", "None"),
        ("times falling", run(timepts=T[::-1]), ValueError, "ascending", "Sort"),
        ("times repeated", run(timepts=[0, 1, 1]), ValueError, "ascending"),
        ("times one", run(timepts=10), ValueError, "at least two", "linspace"),
        ("times nan", run(timepts=[0, NAN]), ValueError, "timepts finite"),
        ("times text", run(timepts="10"), TypeError, "timepts"),
        ("times complex", run(timepts=T + 0j), TypeError, "timepts", "complex"),
        ("times a table", run(timepts=np.ones((2, 2))), ValueError, "ascending"),
        ("params", lambda: cdf.event_response(DRIVE, T, 0, params=[1]), TypeError, "params", "mapping"),
        ("params text", lambda: cdf.event_response(DRIVE, T, 0, params={"mass": "9"}), TypeError, "'9'"),
        ("squeeze", run(squeeze="yes"), TypeError, "squeeze", "True or False"),
        ("keep_events", run(keep_events=5), TypeError, "keep_events", "True or False"),
        ("rtol masked", run(rtol=np.ma.masked), TypeError, "rtol"),
        ("keyword", run(rtoll=1), TypeError, "unrecognized keyword", "rtoll"),
        ("system", lambda: cdf.event_response(5, T), TypeError, "block", "int"),
        ("FRD", lambda: cdf.event_response(ct.frd([1], [1]), T), TypeError, "fitted transfer function"),
    ]
)  # fmt: skip
def test_event_response(case):
    refused(*case[1:])


def test_constants_for_each_input_are_taken():
    two = ct.ss([[-1]], [[1, 1]], [[1]], [[0, 0]])
    assert cdf.event_response(two, T, [1, 2]).states[0, -1] == pytest.approx(3 * (1 - np.exp(-1)))
    assert cdf.event_response(two, T, [T, 2]).inputs.shape == (2, 11)


@table(
    [
        ("output=9", lambda: cdf.closed_loop(PID, DRIVE, output=9), ValueError, "x, v", "0 to 1", "9"),
        ("output=-1", lambda: cdf.closed_loop(PID, DRIVE, output=-1), ValueError, "x, v", "-1"),
        ("output=True", lambda: cdf.closed_loop(PID, DRIVE, output=True), TypeError, "x, v", "True"),
        ("output='z'", lambda: cdf.closed_loop(PID, DRIVE, output="z"), ValueError, "x, v", "'z'"),
        ("dt text", lambda: cdf.closed_loop(PID, DRIVE, "1e-3"), TypeError, "dt", "'1e-3'"),
        ("dt < 0", lambda: cdf.closed_loop(PID, DRIVE, -1e-3), ValueError, "dt >= 0", "dt=0"),
        ("dt nan", lambda: cdf.closed_loop(PID, DRIVE, NAN), ValueError, "dt >= 0", "nan"),
        ("controller text", lambda: cdf.closed_loop("PID", DRIVE), TypeError, "TransferFunction"),
        ("controller nan", lambda: cdf.closed_loop(NAN, DRIVE), ValueError, "nan"),
        ("controller True", lambda: cdf.closed_loop(True, DRIVE), TypeError, "TransferFunction"),
        ("coefficients", lambda: cdf.closed_loop(ct.tf([INF], [1, 1]), DRIVE), ValueError, "finite"),
        ("MIMO controller", lambda: cdf.closed_loop(ct.ss([], [], [], np.eye(2)), DRIVE), ValueError, "SISO"),
        ("block", lambda: cdf.closed_loop(PID, 5), TypeError, "block", "5"),
        ("sampled(5)", lambda: cdf.sampled(5), TypeError, "discrete-time", "ct.c2d"),
        ("sampled(continuous)", lambda: cdf.sampled(ct.tf([1], [1, 1])), ValueError, "discrete-time"),
    ]
)  # fmt: skip
def test_closed_loop(case):
    refused(*case[1:])


# --- describing functions ----------------------------------------------------------------------------------

H = ct.tf([8], [1, 2, 2, 1])
N, FAMILY, RESPONSE = (
    cdf.describing_function,
    cdf.describing_function_family,
    cdf.describing_function_response,
)
SQUARE = ct.ss(-np.eye(2), np.eye(2), np.eye(2), np.zeros((2, 2)))


SMALL = FAMILY(DRIVE, [9.0], [2.0])
STATIC = cdf.describing_function_family(cdf.relay(1), [1.0, 2.0])


def family(**keywords):
    return lambda: FAMILY(DRIVE, [9.0], [2.0], **keywords)


@table(
    [
        ("A nan", lambda: N(DRIVE, NAN, 1.0), ValueError, "A finite", "NaN", "peak value"),
        ("A text", lambda: N(DRIVE, "9", 1.0), TypeError, "A as real numbers", "'9'"),
        ("A None", lambda: N(DRIVE, None, 1.0), TypeError, "A as real numbers", "None"),
        ("A True", lambda: N(DRIVE, True, 1.0), TypeError, "A as real numbers", "truth"),
        ("A masked", lambda: N(DRIVE, MASKED, 1.0), ValueError, "masked"),
        ("A < 0", lambda: N(DRIVE, [1, -2], 1.0), ValueError, "A < 0", "-2"),
        ("omega complex", lambda: N(DRIVE, 9.0, 1j), TypeError, "omega as real numbers", "complex"),
        ("omega 0", lambda: N(DRIVE, 9.0, 0), ValueError, "omega > 0", "got omega=0"),
        ("omega inf", lambda: N(DRIVE, 9.0, INF), ValueError, "omega finite"),
        ("two by two", lambda: N(SQUARE, 1.0, 1.0), ValueError, "one input and one output", "F[i, j]"),
        ("family two by two", lambda: FAMILY(SQUARE, [1.0], [1.0]), ValueError, "one input and one output"),
        ("FRD", lambda: N(ct.frd([1], [1]), 1.0, 1.0), TypeError, "measured points"),
        ("law of text", lambda: N(lambda u: "a", 1.0), RuntimeError, "user-written", "real numbers", "'a'"),
        ("law of j", lambda: N(lambda u: 1j * u, 1.0), RuntimeError, "user-written", "real numbers"),
        ("law of None", lambda: N(lambda u: None, 1.0), RuntimeError, "user-written", "None"),
        ("law of two arguments", lambda: N(lambda u, v: u, 1.0), RuntimeError, "user-written"),
        ("no law", lambda: N("saturation", 1.0), TypeError, "block or a callable"),
        ("num_points", lambda: N(DRIVE, 9.0, 1.0, num_points="a"), TypeError, "num_points", "'a'"),
        ("num_points=0", lambda: N(DRIVE, 9.0, 1.0, num_points=0), ValueError, "num_points", "0"),
        ("keyword", lambda: N(DRIVE, 9.0, 1.0, wrong=1), TypeError, "unrecognized keyword", "wrong"),
        ("save=3", family(save=3), TypeError, "save", "path", "got 3"),
        ("save=''", family(save=""), ValueError, "save", "path"),
        ("executor=3", family(executor=3), TypeError, "executor", "submit", "got 3"),
        ("executor class", family(executor="threads"), TypeError, "executor", "'threads'"),
        ("progress", family(progress="yes"), TypeError, "progress", "True or False"),
        ("orders=nan", family(orders=NAN), ValueError, "orders", "nan"),
        ("orders=True", family(orders=True), TypeError, "orders", "True"),
        ("orders=2.5", family(orders=2.5), ValueError, "orders", "2.5"),
        ("family of A = 0", lambda: FAMILY(DRIVE, [0.0], [1.0]), ValueError, "A > 0"),
        ("family of nothing", lambda: FAMILY(DRIVE, [], [1.0]), ValueError, "at least one value"),
        ("response omega=[0, 0]", lambda: RESPONSE(H, DRIVE, [9, 10], [0, 0]), ValueError, "omega", "[0, 0]"),
        ("response omega text", lambda: RESPONSE(H, DRIVE, [9, 10], "all"), TypeError, "omega as real"),
        ("response omega nan", lambda: RESPONSE(H, DRIVE, [9, 10], [NAN, 1]), ValueError, "omega finite"),
        ("response omega < 0", lambda: RESPONSE(H, DRIVE, [9, 10], [-1, 1]), ValueError, "positive", "-1"),
        ("response A text", lambda: RESPONSE(H, DRIVE, "9", [1, 2]), TypeError, "A as real numbers"),
        ("response H", lambda: RESPONSE("H", DRIVE, [9, 10], [1, 2]), TypeError, "H must be a linear system"),
        ("response H huge", lambda: RESPONSE(10**400, DRIVE, [9, 10], [1, 2]), ValueError, "H finite"),
        ("response H True", lambda: RESPONSE(True, DRIVE, [9, 10], [1, 2]), TypeError, "linear system"),
        ("frd text", lambda: SMALL.frd("9"), TypeError, "amplitude", "'9'"),
        ("frd outside", lambda: SMALL.frd(99), ValueError, "the family's grid", "99"),
        ("harmonics outside", lambda: SMALL.plot_harmonics(omega=99), ValueError, "<= omega <=", "99"),
        ("harmonics without", lambda: STATIC.plot_harmonics(omega=9), ValueError, "omega", "Leave it out"),
        ("save(5)", lambda: SMALL.save(5), TypeError, "path", "5"),
        ("load_family(1)", lambda: cdf.load_family(1), TypeError, "path", "1"),
        ("response save", lambda: RESPONSE(H, DRIVE, [9, 10], [1, 2], save=3), TypeError, "save", "path"),
    ]
)  # fmt: skip
def test_describing_functions(case):
    refused(*case[1:])


def test_a_law_may_return_a_comparison():
    assert N(lambda u: u > 0, 1.0).real == pytest.approx(2 / np.pi)


# --- exact orbits ------------------------------------------------------------------------------------------


def find(**keywords):
    return lambda: cdf.find_limit_cycle(LOOP, **keywords)


CHECKED = RESPONSE(H, cdf.saturation(1), [2.0, 4.0])


@table(
    [
        ("max_iterations=-3", find(max_iterations=-3), ValueError, "max_iterations", "integer >= 1", "-3"),
        ("max_iterations=2.5", find(max_iterations=2.5), ValueError, "max_iterations", "2.5"),
        ("max_iterations='9'", find(max_iterations="9"), TypeError, "max_iterations", "'9'"),
        ("search_time=-1", find(search_time=-1), ValueError, "search_time > 0", "-1", "Leave it out"),
        ("search_time=nan", find(search_time=NAN), ValueError, "search_time > 0", "nan"),
        ("search_time text", find(search_time="1"), TypeError, "search_time", "'1'"),
        ("guess nan", find(guess=[NAN, 0, 0]), ValueError, "guess finite", "NaN at index 0"),
        ("guess array nan", find(guess=np.array([NAN, 0, 0])), ValueError, "guess finite"),
        ("guess pair nan", find(guess=(NAN, 1)), ValueError, "guess finite"),
        ("guess pair < 0", find(guess=(5, -1)), ValueError, "omega > 0", "-1"),
        ("guess text", find(guess="10 at 13"), TypeError, "guess", "'10 at 13'"),
        ("guess number", find(guess=10.0), TypeError, "guess", "10.0", "(3,)"),
        ("guess of four", find(guess=[1, 2, 3, 4]), TypeError, "guess", "(3,)"),
        ("guess complex", find(guess=[1, 1j]), TypeError, "guess", "1j"),
        ("raise_on_failure", find(raise_on_failure="yes"), TypeError, "True or False", "'yes'"),
        ("loop", lambda: cdf.find_limit_cycle(5), TypeError, "loop", "int"),
        ("keyword", find(max_iteration=3), TypeError, "unrecognized keyword"),
        ("verify search_time", lambda: cdf.verify(CHECKED, search_time=0), ValueError, "search_time > 0"),
        ("verify search", lambda: cdf.verify(CHECKED, search="all"), TypeError, "True or False"),
        ("verify loop", lambda: cdf.verify(CHECKED, loop=5), TypeError, "loop", "int"),
        ("verify keyword", lambda: cdf.verify(CHECKED, serach=1), TypeError, "unrecognized keyword"),
    ]
)  # fmt: skip
def test_searches(case):
    refused(*case[1:])


def test_a_loop_that_comes_to_rest_is_not_told_to_raise_iterations():
    loop = cdf.closed_loop(cdf.pid(200, 0, 30), DRIVE)
    with pytest.raises(RuntimeError, match="(?s)no periodic orbit was found.*comes to rest") as caught:
        cdf.find_limit_cycle(loop, raise_on_failure=True)
    assert "max_iterations" not in str(caught.value)


def test_a_state_may_be_given_as_a_list():
    orbit = cdf.find_limit_cycle(LOOP, guess=[0.0, 0.02, 0.0])
    other = cdf.find_limit_cycle(LOOP, guess=np.array([0.0, 0.02, 0.0]))
    assert bool(orbit) == bool(other)


# --- measurements ------------------------------------------------------------------------------------------

TIME = 1e-3 * np.arange(40)
U, Y = np.sin(300 * TIME) * 1234.5678, 50 * np.cos(300 * TIME)
HIDDEN = np.ma.masked_where(TIME == TIME[7], U)


def record(t=TIME, u=U, y=Y, **keywords):
    return lambda: cdf.Measurement(t, u, y, **keywords)


RECORD = record()()
RUN = cdf.event_response(DRIVE, TIME, U)
FROM = cdf.Measurement.from_response
TABLE = cdf.FrequencyMeasurement


@table(
    [
        ("masked u", record(u=HIDDEN), ValueError, "u has 1 masked", "sample 7", "records of their own"),
        ("masked y", record(y=HIDDEN), ValueError, "y has 1 masked"),
        ("masked t", record(t=np.ma.masked_less(TIME, 1e-9)), ValueError, "t has 1 masked"),
        ("masked channel", record(channels={"i": HIDDEN}), ValueError, "'i' has 1 masked"),
        ("masked velocity", record(velocity=HIDDEN), ValueError, "velocity has 1 masked"),
        ("numbers as text", record(u=[str(v) for v in U]), TypeError, "numbers in u", "text"),
        ("bytes", record(u=[b"1"] * 40), TypeError, "numbers in u", "text"),
        ("truth", record(u=U > 0), TypeError, "numbers in u", "truth values"),
        ("mixed", record(u=[None, *U[1:]]), TypeError, "numbers in u", "object"),
        ("ragged", record(u=[[1, 2], [1]]), ValueError, "unequal length"),
        ("one number", record(u=5.0), TypeError, "1-D array", "5.0"),
        ("mapping", record(u={"u": U}), TypeError, "1-D array"),
        ("dates as output", record(y=TIME.astype("M8[s]")), TypeError, "dates"),
        ("name", record(name=5), TypeError, "name as text", "5"),
        ("unit", record(input_unit=5), TypeError, "unit", "5"),
        ("hold", record(input_hold=None), TypeError, "'zoh' or 'linear'", "None"),
        ("channels", record(channels=[U]), TypeError, "channels as a mapping"),
        ("slice text", lambda: RECORD.slice("0"), TypeError, "start", "'0'"),
        ("slice nan", lambda: RECORD.slice(NAN), ValueError, "start", "nan"),
        ("slice nothing", lambda: RECORD.slice(5, 1), ValueError, "10 samples", "Widen"),
        ("windows text", lambda: RECORD.windows("1"), TypeError, "length", "'1'"),
        ("windows nan", lambda: RECORD.windows(NAN), ValueError, "length", "nan"),
        ("windows 1e-9", lambda: RECORD.windows(1e-9), ValueError, "over 9 samples", "1e-09"),
        ("windows that stand still", lambda: RECORD.windows(0.02, 1 - 1e-12), ValueError, "overlap", "Lower"),
        ("decimate nan", lambda: RECORD.decimate(NAN), ValueError, "factor", "nan"),
        ("decimate text", lambda: RECORD.decimate("2"), TypeError, "factor", "'2'"),
        ("decimate 0", lambda: RECORD.decimate(0), ValueError, "factor", "0"),
        ("cutoff nan", lambda: RECORD.velocity_estimate(NAN), ValueError, "cutoff", "nan"),
        ("cutoff text", lambda: RECORD.velocity_estimate("5"), TypeError, "cutoff", "'5'"),
        ("cutoff 1e9", lambda: RECORD.velocity_estimate(1e9), ValueError, "Nyquist", "cutoff"),
        ("from_csv(5)", lambda: cdf.Measurement.from_csv(5), TypeError, "path", "got 5"),
        ("from_csv(None)", lambda: cdf.Measurement.from_csv(None), TypeError, "path", "None"),
        ("from_csv keyword", lambda: cdf.Measurement.from_csv("x", units="mm"), TypeError, "units"),
        ("from_response keyword", lambda: FROM(RUN, column=1), TypeError, "unrecognized keyword", "column"),
        ("from_response outputs", lambda: FROM(RUN, outputs=1), TypeError, "outputs as a mapping", "got 1"),
        ("from_mat(5)", lambda: cdf.Measurement.from_mat(5), TypeError, "path", "got 5"),
        ("from_dataframe(5)", lambda: cdf.Measurement.from_dataframe(5), TypeError, "DataFrame", "int"),
        ("from_response row", lambda: FROM(RUN, input=INF), ValueError, "0 to 0", "inf"),
        ("from_response label", lambda: FROM(RUN, output="z"), ValueError, "x, v", "'z'"),
        ("from_response None", lambda: FROM(RUN, output=None), TypeError, "0 to 1"),
        ("from_response(5)", lambda: cdf.Measurement.from_response(5), TypeError, "TimeResponseData", "5"),
        ("table N text", lambda: TABLE([1.0], [1.0], [["a"]]), TypeError, "N as complex numbers"),
        ("table N truth", lambda: TABLE([1.0], [1.0], [[True]]), TypeError, "N as complex numbers"),
        ("table N shape", lambda: TABLE([1.0], [1.0, 2.0], [[1], [2]]), ValueError, "shape", "Transpose"),
        ("table A nan", lambda: TABLE([NAN], [1.0], [[1]]), ValueError, "A finite"),
        ("table A text", lambda: TABLE("1", [1.0], [[1]]), TypeError, "A as real numbers"),
        ("table omega falls", lambda: TABLE([1.0], [2.0, 1.0], [[1, 1]]), ValueError, "increasing"),
        ("table noise text", lambda: TABLE([1.0], [1.0], [[1]], noise="1"), TypeError, "noise"),
        ("table noise 0", lambda: TABLE([1.0], [1.0], [[1]], noise=0), ValueError, "noise > 0"),
        ("table frd text", lambda: TABLE([1.0], [1.0], [[1]]).frd("1"), TypeError, "amplitude", "'1'"),
        ("table frd nan", lambda: TABLE([1.0], [1.0], [[1]]).frd(NAN), ValueError, "amplitude > 0"),
    ]
)  # fmt: skip
def test_measurements(case):
    refused(*case[1:])


def test_dates_as_times_are_seconds_from_the_first():
    dates = np.datetime64("2026-01-31T23:59:59.990") + np.arange(40).astype("m8[ms]")
    assert np.allclose(record(t=dates)().t, TIME)
    assert np.allclose(record(t=np.arange(40).astype("m8[ms]"))().t, TIME)
    assert record(channels={"on": U > 0})().channels["on"].sum() == np.count_nonzero(U > 0)


def test_masked_points_of_a_table_were_not_measured():
    found = TABLE([1.0, 2.0], [1.0], np.ma.masked_equal([[1.0], [2.0]], 2.0))
    assert np.isnan(found.N[1, 0]) and found.N[0, 0] == 1


# --- files of records --------------------------------------------------------------------------------------


def point(v):
    return f"{v:.6f}"


def comma(v):
    return f"{v:.6f}".replace(".", ",")


def german(v):
    return f"{v:,.4f}".translate(str.maketrans(",.", ".,"))


def english(v):
    return f'"{v:,.4f}"'


def lines(form=point, mark=",", times=None, head="t,u,y"):
    stamps = [form(v) for v in TIME] if times is None else times
    body = [mark.join((t, form(u), form(y))) for t, u, y in zip(stamps, U, Y, strict=True)]
    return "\n".join([head.replace(",", mark), *body])


STAMPS = [str(np.datetime64("2026-01-31T23:59:59.990") + np.timedelta64(i, "ms")) for i in range(40)]
PLAIN = lines()


@pytest.mark.parametrize(
    "content",
    {
        "utf-8": PLAIN.encode(),
        "latin-1": lines(head="t,u,y,°").replace("\n", ",0\n").replace("°,0", "°").encode("latin-1") + b",0",
        "byte order mark": PLAIN.encode("utf-8-sig"),
        "utf-16": PLAIN.encode("utf-16"),
        "utf-16 without mark": PLAIN.encode("utf-16-le"),
        "utf-16 big-endian": b"\xfe\xff" + PLAIN.encode("utf-16-be"),
        "windows line ends": PLAIN.replace("\n", "\r\n").encode(),
        "row of units": PLAIN.replace("t,u,y", "t,u,y\ns,N,m").encode(),
        "row of units in brackets": PLAIN.replace("t,u,y", "t,u,y\n[s],[N],[m]").encode(),
        "decimal commas": lines(comma, ";").encode(),
        "decimal commas, tabs": lines(comma, "\t").encode(),
        "decimal commas, blanks": lines(comma, " ").encode(),
        "German thousands": lines(german, ";").encode(),
        "English thousands": lines(english, ",").encode(),
        "what Excel is told": ("sep=;\n" + lines(comma, ";")).encode(),
        "delimiter at the end": (PLAIN.replace("\n", ",\n") + ",").encode(),
        "ISO times": lines(times=STAMPS).encode(),
        "ISO times with zone": lines(times=[s.replace("T", " ") + "+01:00" for s in STAMPS]).encode(),
        "times of day over midnight": lines(times=[s[11:] for s in STAMPS]).encode(),
        "comment lines": ("# rig 3\n\n" + PLAIN).encode(),
    }.items(),
    ids=lambda item: item[0],
)
def test_tables_read_rightly(tmp_path, content):
    path = tmp_path / "run.csv"
    path.write_bytes(content[1])
    m = cdf.Measurement.from_csv(path)
    assert np.allclose(m.t, TIME) and np.allclose(m.u, U, atol=1e-4) and np.allclose(m.y, Y, atol=1e-4)
    assert m.input_unit == "N" and m.output_unit == "m"


def test_units_of_a_row_under_the_header_count(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text(lines(head="time,F,pos").replace("pos", "pos\ns,kN,µm"), encoding="latin-1")
    m = cdf.Measurement.from_csv(path, time="time", input="F", output="pos")
    assert np.allclose(m.u, 1e3 * U, atol=1) and np.allclose(m.y, 1e-6 * Y, atol=1e-9)


AMBIGUOUS = "t;u;y\n" + "\n".join(f"{i};{1 + i % 9},23{i % 10};{1 + i % 7}" for i in range(20))


@table(
    [
        ("binary", bytes(range(256)) * 20, {}, "binary", "Export it as CSV"),
        ("workbook", b"PK\x03\x04" + bytes(99), {}, "workbook", "save the sheet as CSV"),
        ("MATLAB", b"MATLAB 5.0 MAT-file", {}, "from_mat"),
        ("gzip", b"\x1f\x8b\x08", {}, "unpack"),
        ("utf-16 cut short", PLAIN.encode("utf-16")[:-1], {}, "binary"),
        ("empty", b"", {}, "empty"),
        ("blank", b"\n \n# only words\n", {}, "empty"),
        ("header only", b"t,u,y\n", {}, "rows of numbers"),
        ("header and units", b"t,u,y\ns,N,m\n", {}, "rows of numbers"),
        ("doubled names", b"t,u,u\n0,1,2\n", {}, "'u' more than once", "Rename"),
        ("nameless columns", b"t,,,u,y\n0,1,2,3,4\n", {}, "several without one"),
        ("ragged", b"t,u,y\n0,1,2\n1,2\n", {}, "line 3", "3 cells", "got 2", "Complete or delete"),
        ("too wide", b"t,u,y\n0,1,2\n1,2,3,4\n", {}, "line 3", "got 4"),
        ("two readings", AMBIGUOUS.encode(), {}, "two ways", "decimal=','"),
        ("two marks", b"t;u;y\n0;1.5;2,25\n1;2.5;3,25\n", {}, "one decimal mark", "'1.5'", "'2,25'"),
        ("word", PLAIN.replace("0.005000", "oops").encode(), {}, "line 7", "'oops'", "'t'"),
        ("hole", PLAIN.replace("0.005000", "").encode(), {}, "line 7", "empty cell", "Fill it"),
        ("day first", lines(times=["31.01.2026 " + s[11:] for s in STAMPS]).encode(), {}, "line 2", "ISO"),
        ("broken clock", lines(times=[*STAMPS[:-1], "later"]).encode(), {}, "'t [s]'", "line 41", "'later'"),
        ("no such column", PLAIN.encode(), {"input": "F"}, "'F'", "t, u, y"),
        ("number too large", PLAIN.encode(), {"input": 3}, "0 to 2", "3"),
        ("u twice", PLAIN.encode(), {"output": "u"}, "input and output", "'u'"),
        ("u twice by number", PLAIN.encode(), {"output": 1}, "input and output", "'u'"),
        ("t twice", PLAIN.encode(), {"input": "t"}, "time and input", "'t'"),
        ("velocity twice", PLAIN.encode(), {"velocity": "y"}, "output and velocity", "'y'"),
        ("channel", PLAIN.encode(), {"channels": "i"}, "'i'", "t, u, y"),
        ("delimiter", PLAIN.encode(), {"delimiter": ";;"}, "one character", "';;'"),
        ("decimal", PLAIN.encode(), {"decimal": "x"}, "decimal", "'x'"),
    ]
)  # fmt: skip
def test_tables_refused_rightly(tmp_path, case):
    _, content, keywords, *words = case
    path = tmp_path / "run.csv"
    path.write_bytes(content)
    refused(lambda: cdf.Measurement.from_csv(path, **keywords), ValueError, *words)


def test_an_ambiguous_table_is_read_as_said(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text(AMBIGUOUS)
    assert cdf.Measurement.from_csv(path, decimal=",").u[0] == pytest.approx(1.23)
    assert cdf.Measurement.from_csv(path, decimal=".").u[0] == pytest.approx(1230)


def test_columns_must_be_names_or_numbers(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text(PLAIN)
    for keywords in (
        {"input": None},
        {"input": True},
        {"input": 1.0},
        {"channels": [None]},
        {"delimiter": 5},
    ):
        refused(lambda k=keywords: cdf.Measurement.from_csv(path, **k), TypeError)


def test_files_that_are_not_there(tmp_path):
    for read in (cdf.Measurement.from_csv, cdf.Measurement.from_mat):
        with pytest.raises(FileNotFoundError, match=r"none\."):
            read(tmp_path / "none.mat")
        with pytest.raises(OSError, match="directory"):
            read(tmp_path)


def test_a_million_rows_take_seconds(tmp_path):
    path = tmp_path / "long.csv"
    n = 250_000
    body = "\n".join(f"{i * 1e-4:.4f},{i % 97},{abs(i % 178 - 89)}.25" for i in range(n))
    path.write_text("t,u,y\n" + body)
    began = time.process_time()
    assert len(cdf.Measurement.from_csv(path)) == n
    assert time.process_time() - began < 1.5  # measured 0.4 s; 1.5 s for a million


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "empty"),
        (b"junk that no one wrote as a mat file" * 9, "cannot be read"),
        (b"\0" * 400, "cannot be read"),
        (b"MATLAB 7.3 MAT-file, Platform: x" + bytes(400), "-v7"),
        (b"\x89HDF\r\n\x1a\n" + bytes(400), "-v7"),
        (PLAIN.encode(), "from_csv"),
    ],
)
def test_mat_files_refused_rightly(tmp_path, content, words):
    path = tmp_path / "run.mat"
    path.write_bytes(content)
    refused(lambda: cdf.Measurement.from_mat(path), ValueError, words, "run.mat")


def test_columns_of_matrices_are_offered(tmp_path):
    from scipy.io import savemat

    path = tmp_path / "run.mat"
    savemat(path, {"t": TIME, "data": np.c_[U, Y], "wide": np.array([U, Y])})
    refused(lambda: cdf.Measurement.from_mat(path), ValueError, "t, data.0, data.1, wide.0, wide.1")
    for name in ("data", "wide"):
        m = cdf.Measurement.from_mat(path, input=f"{name}.0", output=f"{name}.1")
        assert np.allclose(m.u, U) and np.allclose(m.y, Y)


def test_frequency_tables_name_the_line(tmp_path):
    path = tmp_path / "n.csv"
    path.write_text("A,omega,re,im\n1,2,3,4\n1,3,x,4\n")
    refused(lambda: TABLE.from_csv(path, real="re", imag="im"), ValueError, "line 3", "'x'")
    path.write_text("A,omega,re,im\n1,2,3,4\n1,2,3,4\n")
    refused(lambda: TABLE.from_csv(path, real="re", imag="im"), ValueError, "twice", "Average")


# --- judging -----------------------------------------------------------------------------------------------

DATA = [RECORD]
ONE = cdf.friction_mass(1, 5, 0.5)


def compare(**keywords):
    return lambda: cdf.compare(**{"model": ONE, "data": RECORD, **keywords})


def refit(**keywords):
    return lambda: cdf.refit(**{"model": ONE, "data": RECORD, **keywords})


def diagnose(**keywords):
    return lambda: cdf.diagnose(**{"model": ONE, "data": RECORD, **keywords})


def improve(**keywords):
    return lambda: cdf.improve(**{"model": ONE, "train": RECORD, **keywords})


POINTS = TABLE([1.0, 2.0], [1.0, 2.0], np.ones((2, 2)))


@table(
    [
        ("compare window", compare(window=1e-9), ValueError, "window needs a length", "20 samples", "1e-09"),
        ("compare window text", compare(window="1"), TypeError, "window", "'1'"),
        ("compare window nan", compare(window=NAN), ValueError, "window", "nan"),
        ("compare mode", compare(mode="whole"), ValueError, "mode", "'whole'", "windows"),
        ("compare mode None", compare(mode=None), TypeError, "mode", "None"),
        ("compare of points, mode", compare(data=POINTS, mode="x"), ValueError, "mode", "'x'"),
        ("compare of points, window", compare(data=POINTS, window=1.0), ValueError, "tables", "Leave both"),
        ("compare data", compare(data=3), TypeError, "Measurement", "int"),
        ("compare no data", compare(data=[]), TypeError, "empty sequence"),
        ("compare text", compare(data="run.csv"), TypeError, "Measurement", "str"),
        ("compare both kinds", compare(data=[RECORD, POINTS]), TypeError, "two calls"),
        ("compare model", compare(model=3), TypeError, "block or a loop", "int"),
        ("compare law", compare(model=PID), TypeError, "block or a loop"),
        ("compare keyword", compare(windows=1), TypeError, "unrecognized keyword"),
        ("refit free=3", refit(free=3), TypeError, "free", "sequence of names", "got 3"),
        ("refit free of numbers", refit(free=["coulomb", 3]), TypeError, "free", "got 3"),
        ("refit free unknown", refit(free=["coulom"]), ValueError, "free", "coulomb.level", "'coulom'"),
        ("refit own=3", refit(own=3), TypeError, "own", "sequence of names", "got 3"),
        ("refit own unknown", refit(own=["coulom"]), ValueError, "own", "coulomb.level", "'coulom'"),
        ("refit of points, own", refit(data=POINTS, own="coulomb"), ValueError, "own", "Leave own out"),
        ("refit start", refit(start=[1]), TypeError, "start as a mapping"),
        ("refit start unknown", refit(start={"coulom": 1}), ValueError, "coulomb.level"),
        ("refit start text", refit(start={"mass": "1"}), TypeError, "mass", "'1'"),
        ("refit start nan", refit(start={"mass": NAN}), ValueError, "mass > 0", "nan"),
        ("refit budget=0", refit(budget=0), ValueError, "budget", "integer >= 1"),
        ("refit budget text", refit(budget="all"), TypeError, "budget", "'all'"),
        ("refit robust", refit(robust="yes"), TypeError, "robust", "True or False"),
        ("refit window", refit(window=1e-9), ValueError, "window needs a length", "1e-09"),
        ("refit mode", refit(mode="x"), ValueError, "mode", "'x'"),
        ("refit model", refit(model=cdf.Mass), TypeError, "type"),
        ("refit of points, mode", refit(data=POINTS, mode="windows"), ValueError, "tables", "Leave both out"),
        ("refit of points, free=3", refit(data=POINTS, free=3), TypeError, "free", "got 3"),
        ("diagnose free=3", diagnose(free=3), TypeError, "free", "got 3"),
        ("diagnose free unknown", diagnose(free=["coulom"]), ValueError, "free", "'coulom'"),
        ("diagnose own unknown", diagnose(own=["coulom"]), ValueError, "own", "'coulom'"),
        ("diagnose candidates", diagnose(candidates="coulom"), ValueError, "effect id", "'coulom'"),
        ("diagnose candidates=3", diagnose(candidates=3), TypeError, "effect id", "got 3"),
        ("diagnose what is there", diagnose(candidates=["coulomb", "load_friction"]), ValueError,
         "candidates needs an effect that can be added", "coulomb (the model has it), load_friction (the"),
        ("diagnose no candidates", diagnose(candidates=[]), ValueError, "one effect id at least"),
        ("diagnose limits", diagnose(limits=40), TypeError, "limits as a mapping", "stroke"),
        ("diagnose limits key", diagnose(limits={"forse": 1}), ValueError, "force, stroke", "'forse'"),
        ("diagnose limits < 0", diagnose(limits={"force": -1}), ValueError, "force", "-1"),
        ("diagnose executor", diagnose(executor=4), TypeError, "executor", "submit", "got 4"),
        ("diagnose holdout", diagnose(holdout=3), TypeError, "holdout", "int"),
        ("diagnose the same twice", diagnose(holdout=RECORD), ValueError, "not fitted", "Leave holdout out"),
        ("diagnose model", diagnose(model=cdf.saturation(1)), TypeError, "inertia", "ctrl_df.Mass"),
        ("diagnose points held out", diagnose(data=POINTS, holdout=3), TypeError, "holdout", "int"),
        ("improve max_effects=nan", improve(max_effects=NAN), ValueError, "max_effects", "nan"),
        ("improve max_effects=-1", improve(max_effects=-1), ValueError, "max_effects", "-1"),
        ("improve max_effects='5'", improve(max_effects="5"), TypeError, "max_effects", "'5'"),
        ("improve max_effects=True", improve(max_effects=True), TypeError, "max_effects", "True"),
        ("improve free", improve(free="coulom"), ValueError, "free", "'coulom'"),
        ("improve own", improve(own="coulom"), ValueError, "own", "'coulom'"),
        ("improve executor", improve(executor="x"), TypeError, "executor", "'x'"),
        ("improve candidates", improve(candidates=[None]), TypeError, "effect id", "None"),
        ("improve of points", improve(train=POINTS, max_effects=NAN), ValueError, "max_effects"),
        ("improve keyword", improve(max_effect=1), TypeError, "Did you mean max_effects?"),
    ]
)  # fmt: skip
def test_judging(case):
    refused(*case[1:])


def test_diagnose_takes_the_names_that_refit_takes():
    from ctrl_df.identify.arguments import free_parameters

    assert free_parameters(ONE, ["coulomb"]) == ("coulomb.level",) == free_parameters(ONE, "coulomb")
    assert free_parameters(ONE, ["mass", "coulomb.level", "coulomb"]) == ("mass", "coulomb.level")


def test_the_place_of_a_report_is_tried_before_it_is_drawn(tmp_path):
    from ctrl_df.identify.report import write_report

    refused(lambda: write_report(None, tmp_path / "no" / "r.html"), FileNotFoundError, "existing directory")
    refused(lambda: write_report(None, tmp_path), IsADirectoryError, "directory", "file name")
    refused(lambda: write_report(None, 5), TypeError, "path", "5")
    kept = tmp_path / "kept.html"
    kept.write_text("old")
    with pytest.raises(AttributeError):
        write_report(None, kept)
    assert kept.read_text() == "old" and list(tmp_path.iterdir()) == [kept]


# --- MODEL.toml and the command line -----------------------------------------------------------------------


def told(capsys, *arguments):
    """Return the one line that the command line says of bad input."""
    began = time.perf_counter()
    assert main(list(map(str, arguments))) == 2
    captured = capsys.readouterr()
    assert time.perf_counter() - began < 2.0, "an error that comes late"
    assert captured.out == "" and captured.err.count("\n") == 1, captured
    assert captured.err.startswith("ctrl-df: error: ") and len(captured.err) < 1000
    return captured.err


@table(
    [
        ("kind list", 'kind = "mass"', 'kind = ["mass"]', "kind must be one of", "['mass']"),
        ("kind number", 'kind = "mass"', "kind = 5", "kind must be one of", "5"),
        ("mass true", "mass = 9.0 ", "mass = true ", "mass as one real number [kg]", "True"),
        ("mass text", "mass = 9.0 ", 'mass = "9" ', "mass as one real number", "'9'", "without quotes"),
        ("level text", "level = 5.0", 'level = "5"', "level as one real number", "without quotes"),
        ("mass date", "mass = 9.0 ", "mass = 2026-01-31 ", "mass as one real number", "date"),
        ("mass table", "mass = 9.0 ", "mass = {a = 1} ", "mass as one real number"),
        ("mass nan", "mass = 9.0 ", "mass = nan ", "mass > 0", "nan"),
        ("name number", "mass = 9.0 ", "mass = 9.0\nname = 5 ", "name as text", "5"),
        ("measured list", "mass = 9.0 ", "mass = 9.0\nmeasured = [1] ", "'load' or 'motor'"),
        ("level true", "level = 5.0", "level = true", "level as one real number", "True"),
        ("level list", "level = 5.0", "level = [5.0]", "level as one real number"),
        ("level missing", "level = 5.0", "", "coulomb needs level [N]", "add it"),
        ("effect no table", "[effects.coulomb] ", "[effects]\ncoulomb = 5\n[box2] ", "box2"),
        ("effects a number", "[effects.coulomb] ", "[x] ", "knows the keys", "'x'"),
        ("kp text", "kp = 2000.0", 'kp = "2000"', "kp as one real number", "'2000'", "without quotes"),
        ("kp true", "kp = 2000.0", "kp = true", "kp as one real number", "True"),
        ("kp nan", "kp = 2000.0", "kp = nan", "kp finite", "nan"),
        ("dt < 0", "dt = 0.0", "dt = -1e-3", "dt >= 0", "-0.001"),
        ("amplitude text", "[5.2, 100.0]", '["a", 100.0]', "amplitude as one real number", "'a'"),
        ("amplitude number", "[5.2, 100.0]", "5.2", "pair [low, high]", "5.2"),
        ("amplitude inf", "[5.2, 100.0]", "[5.2, inf]", "both finite", "inf"),
        ("points", "[40, 60]", "[100000000, 100000000]", "1,000,000 in all", "[1000, 1000]", "1e+16"),
        ("points long", "[40, 60]", "[2, 600000]", "1,000,000 in all"),
        ("points true", "[40, 60]", "[true, 60]", "two integers >= 2", "True"),
        ("points one", "[40, 60]", "[40]", "two integers >= 2", "[40]"),
        ("points float", "[40, 60]", "[40.0, 60.0]", "two integers >= 2"),
        ("closed_loop text", "closed_loop = false", 'closed_loop = "false"', "true or false", "'false'"),
        ("time list", 'time = "t"', 'time = ["t"]', "time must be a column's name"),
        ("time true", 'time = "t"', "time = true", "time must be a column's name", "True"),
        ("unit number", 'output_unit = "mm"', "output_unit = 5", "output_unit must be text", "5"),
        ("unit unknown", 'output_unit = "mm"', 'output_unit = "furlong"', "unit must be one of", "furlong"),
        ("hold", "closed_loop = false", 'input_hold = "cubic"', "'zoh' or 'linear'", "'cubic'"),
        ("channels", "closed_loop = false", 'channels = "i"', "a list of columns", "'i'"),
        ("section a number", "[box] ", "[x]\n", "knows the keys"),
        ("not closed", "[plant]", "[plant", "no TOML file", "--help"),
        ("twice", "mass = 9.0 ", "mass = 9.0\nmass = 8.0 ", "no TOML file"),
    ]
)  # fmt: skip
def test_model_files(tmp_path, capsys, case):
    _, old, new, *words = case
    assert old in EXAMPLE, old
    path = tmp_path / "model.toml"
    path.write_text(EXAMPLE.replace(old, new, 1))
    text = told(capsys, "limit-cycles", path)
    for word in ("model.toml", *words):
        assert word in text, text


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "section [plant]"),
        (b"plant = 5", "section [plant]"),
        (b"effects = 5\n[plant]\nmass = 1.0", "effects must be tables"),
        (b"[[effects]]\nlevel = 5.0\n[plant]\nmass = 1.0", "needs an id"),
        (b"[[effects]]\nid = 5\n[plant]\nmass = 1.0", "effect id"),
        (EXAMPLE.encode("utf-16"), "UTF-8"),
        (EXAMPLE.replace("# kg", "# µ").encode("latin-1"), "UTF-8"),
        (bytes(range(256)), "UTF-8"),
        (b"a = " + b"[" * 5000, "no TOML file"),
    ],
)
def test_model_files_that_are_none(tmp_path, capsys, content, words):
    path = tmp_path / "model.toml"
    path.write_bytes(content)
    assert words in told(capsys, "limit-cycles", path)


def test_a_model_file_with_a_byte_order_mark_is_read(tmp_path):
    path = tmp_path / "model.toml"
    path.write_bytes(EXAMPLE.encode("utf-8-sig"))
    assert read_model(path).plant.mass == 9.0
    refused(lambda: read_model(5), TypeError, "path", "5")


def test_the_place_of_the_report_is_tried_first(tmp_path, capsys):
    model, data = tmp_path / "model.toml", tmp_path / "run.csv"
    model.write_text(EXAMPLE)
    data.write_text("no table at all")  # never looked at
    closed = tmp_path / "closed"
    closed.mkdir()
    for place, words in (
        (tmp_path / "no" / "r.html", "existing directory"),
        (closed, "is a directory"),
        (tmp_path / ("n" * 300), "place that can be written"),
    ):
        assert words in told(capsys, "improve", data, "--model", model, "--report", place)
    closed.chmod(0o500)
    if not os.access(closed, os.W_OK):  # root writes everywhere
        place = closed / "r.html"
        assert "can be written" in told(capsys, "improve", data, "--model", model, "--report", place)


def test_bad_records_on_the_command_line(tmp_path, capsys):
    model, data = tmp_path / "model.toml", tmp_path / "run.csv"
    model.write_text(EXAMPLE)
    for content, words in (
        (b"", "empty"),
        (bytes(range(256)), "binary"),
        (b"PK\x03\x04", "workbook"),
        (b"t,F,y\n0,1,2\n", "'x'"),
        (b"t,F,x\n0,1,2\n1,2,word\n", "line 3"),
        (lines(head="t,F,x").encode("utf-16")[:-1], "binary"),
    ):
        data.write_bytes(content)
        assert words in told(capsys, "improve", data, "--model", model)
    assert "directory" in told(capsys, "improve", tmp_path, "--model", model)
    assert "none.csv" in told(capsys, "improve", tmp_path / "none.csv", "--model", model)
    assert "directory" in told(capsys, "limit-cycles", tmp_path)
