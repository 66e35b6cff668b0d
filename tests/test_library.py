"""The library of effects: what may be registered, and what is refused."""

import importlib.util
import sys

import pytest

import ctrl_df as cdf
from ctrl_df.blocks import effect as library

OWN = """
from dataclasses import dataclass
import ctrl_df as cdf


@cdf.register_effect
@dataclass(frozen=True)
class Magnet(cdf.Effect):
    "A pull towards zero."
    id = "magnet"
    role = "force"
    shows = "a pull"
    pull: float = cdf.parameter("N", default=1.0)

    @staticmethod
    def law(t, x, v, z, p, dz):
        return -p[0]
"""


@pytest.fixture(autouse=True)
def as_before(monkeypatch):
    monkeypatch.setattr(library, "_LIBRARY", dict(library._LIBRARY))


def loaded(path, name, monkeypatch):
    spec = importlib.util.spec_from_file_location(name, path)
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, name, module)
    spec.loader.exec_module(module)
    return module


def test_a_script_may_be_imported_as_well(tmp_path, monkeypatch):
    # numba does so itself with a law whose compiled form it finds on disk
    path = tmp_path / "own.py"
    path.write_text(OWN)
    loaded(path, "script", monkeypatch)
    again = loaded(path, "own", monkeypatch)
    assert cdf.effect_library()["magnet"] is again.Magnet


def test_a_taken_id_is_refused(tmp_path, monkeypatch):
    for name in ("one", "other"):
        (tmp_path / f"{name}.py").write_text(OWN)
    loaded(tmp_path / "one.py", "one", monkeypatch)
    with pytest.raises(ValueError, match="'magnet' is taken by one.Magnet; rename"):
        loaded(tmp_path / "other.py", "other", monkeypatch)
