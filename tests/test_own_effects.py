"""What is known of an effect is stated by its class: a user's effect has every right a library effect has."""

import ast
import dataclasses
from pathlib import Path

import numpy as np
import pytest
from units_apart import alike, diagnosed, scales_of
from user_copies import copied

import ctrl_df as cdf
from ctrl_df.blocks.effect import effect_class
from ctrl_df.blocks.stated import ROLES, stated_parameters

PACKAGES = ("identify", "df", "limit_cycles", "simulate")

# one of every role and of every hook, each on a rig with the physics that it stands for; a gap:
# `test_unit_scaling`
RIVALS = {"linear_spring": ("quadratic_drag", "asymmetric_coulomb")}
COPIED = (
    "linear_spring",
    "input_saturation",
    "drift",
    "input_gain",
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


def test_no_effect_is_looked_up_by_its_class():
    root = Path(cdf.__file__).parent
    found = [
        f"{path.relative_to(root)}:{node.lineno}"
        for package in PACKAGES
        for path in sorted((root / package).rglob("*.py"))
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.Import | ast.ImportFrom) and "effects" in imported(node)
    ]
    assert not found, "\n".join(found)


def imported(node):
    """Return the names of packages and modules that an import goes through."""
    names = [alias.name for alias in node.names]
    return ".".join([getattr(node, "module", None) or "", *names]).split(".")


@pytest.mark.slow
@pytest.mark.parametrize(("hidden", "scale"), [(e, scales_of(e)[2 - i % 3]) for i, e in enumerate(COPIED)])
def test_a_copy_in_other_units_is_found_as_the_original_is(hidden, scale, tmp_path):
    rivals = RIVALS.get(hidden, ())
    original = diagnosed(hidden, [hidden, *rivals])
    with copied(effect_class(hidden), tmp_path) as own:
        copy = diagnosed(hidden, [own, *rivals], *scale)
    assert original.verdict == "effect" and original.best.id == hidden
    assert copy.best.id == own.id == f"own_{hidden}"
    alike(original, copy, scale)


def test_the_copies_stand_for_every_role():
    assert {effect_class(e).role for e in COPIED} == set(ROLES)
    assert len(COPIED) > len(cdf.effect_library()) / 3


def test_a_copy_is_a_class_of_its_own(tmp_path):
    with copied(cdf.Stiction, tmp_path) as own:
        assert own is not cdf.Stiction and not issubclass(own, cdf.Stiction)
        mine, original = (stated_parameters(c) for c in (own, cdf.Stiction))
        assert not {name for name, _ in mine} & {name for name, _ in original}
        assert [stated for _, stated in mine] == [stated for _, stated in original]
        assert own.id in cdf.effect_library()
    assert "own_stiction" not in cdf.effect_library()


@pytest.mark.parametrize("plain", [cdf.Coulomb, cdf.Viscous, cdf.Stiction])
def test_friction_has_its_closed_form_whatever_its_name(plain, tmp_path):
    effects = [cdf.Coulomb(3.0), cdf.Viscous(2.0), cdf.Stiction(4.0)]
    A, omega = [3.5, 6.0, 20.0], [2.0, 9.0]
    library = cdf.describing_function_family(cdf.Mass(2.0, effects), A, omega)
    with copied(plain, tmp_path) as own:
        copies = [own(*e.values) if isinstance(e, plain) else e for e in effects]
        family = cdf.describing_function_family(cdf.Mass(2.0, copies), A, omega)
    np.testing.assert_array_equal(family.N, library.N)
    np.testing.assert_array_equal(family.regime, library.regime)


def test_a_gap_has_its_branches_whatever_its_name(tmp_path):
    # N(a, omega) of a gap has branches that no family shows: without them a loop had no limit cycle
    loop, A, omega = cdf.pid(1800, 19500, 100), np.geomspace(5, 60, 12), np.geomspace(8, 60, 12)
    library = cdf.describing_function_response(loop, cdf.backlash_masses(1, 8, 0.018, 0.8), A, omega)
    with copied(cdf.Backlash, tmp_path) as own:
        block = cdf.TwoMass(1, 8, [own(0.018, 0.8)])
        found = cdf.describing_function_response(loop, block, A, omega)
    assert len(library.limit_cycles) == len(found.limit_cycles) == 1
    assert found.limit_cycles[0].omega == library.limit_cycles[0].omega


def test_a_law_without_a_role_is_refused_registered_or_not():
    @dataclasses.dataclass(frozen=True)
    class Nameless(cdf.Effect):
        level: float = cdf.parameter("N")

        @staticmethod
        def law(t, x, v, z, p, dz):
            return -p[0]

    with pytest.raises(ValueError, match="needs a role out of force, friction"):
        Nameless(1.0)
