"""What is known of an effect is stated by its class: a user's effect has every right a library effect has."""

import ast
import dataclasses
import functools
from pathlib import Path

import pytest
import rigs
from user_copies import copied

import ctrl_df as cdf
from ctrl_df.blocks.effect import ROLES, effect_class

PACKAGES = ("identify", "df", "limit_cycles", "simulate")

# one of every role and of every hook, each on a rig with the physics that it stands for; the fast ones first
FAST = ("linear_spring",)
SLOW = (
    "input_saturation",
    "stribeck",
    "backlash",
    "compliance",
    "hard_stop",
    "bristle",
    "position_ripple",
    "sensor_quantization",
    "hysteresis",
    "load_dependent_friction",
)

# words that stand for something else as well: a regime of N(a, omega)
REGIMES = {"hysteresis"}


def strings(path):
    """Yield (line, value) of the string constants of a file that are no docstrings."""
    tree = ast.parse(path.read_text())
    owners = (ast.Module, ast.FunctionDef, ast.ClassDef)
    documents = {
        id(node.body[0].value)
        for node in ast.walk(tree)
        if isinstance(node, owners) and node.body and isinstance(node.body[0], ast.Expr)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in documents:
            yield node.lineno, node.value


def test_no_id_of_an_effect_stands_as_a_string():
    root, ids = Path(cdf.__file__).parent, set(cdf.effect_library()) - REGIMES
    found = [
        f"{path.relative_to(root)}:{line}: {text}"
        for package in PACKAGES
        for path in sorted((root / package).rglob("*.py"))
        for line, text in strings(path)
        if text.partition(".")[0] in ids
    ]
    assert not found, "\n".join(found)


@functools.cache
def rig_of(hidden):
    # of seed 21 the ripple is none that fits can follow
    rig = rigs.draw(hidden, 6001 if hidden == "position_ripple" else 21, excitation="multisine", n=2500)
    return rig, rig.train[0].measurement(), rig.holdout[0].measurement()


def found_by(hidden, cls):
    rig, train, held = rig_of(hidden)
    free = [k for k, p in rig.baseline.parameters.items() if p.free and k not in rig.known]
    return cdf.diagnose(rig.baseline, train, holdout=held, free=free, candidates=[cls])


@pytest.mark.parametrize(
    "hidden",
    [
        *(pytest.param(e, marks=pytest.mark.quick) for e in FAST),
        *(pytest.param(e, marks=pytest.mark.slow) for e in SLOW),
    ],
)
def test_a_copy_is_found_as_the_original_is(hidden, tmp_path):
    original = found_by(hidden, effect_class(hidden))
    with copied(effect_class(hidden), tmp_path) as own:
        copy = found_by(hidden, own)
    assert original.verdict == copy.verdict == "effect"
    assert original.best.id == hidden and copy.best.id == own.id == f"own_{hidden}"
    assert copy.best.evidence == pytest.approx(original.best.evidence, rel=1e-6)
    assert dict(copy.best.parameters) == pytest.approx(dict(original.best.parameters), rel=1e-6)


def test_the_copies_stand_for_every_role():
    roles = {effect_class(e).role for e in (*FAST, *SLOW)}
    assert roles == set(ROLES)
    assert len(FAST) + len(SLOW) > len(cdf.effect_library()) / 3


def test_a_copy_is_a_class_of_its_own(tmp_path):
    with copied(cdf.Stiction, tmp_path) as own:
        assert own is not cdf.Stiction and not issubclass(own, cdf.Stiction)
        assert [f.name for f in dataclasses.fields(own)] == [f.name for f in dataclasses.fields(cdf.Stiction)]
        assert own.id in cdf.effect_library()
    assert "own_stiction" not in cdf.effect_library()
