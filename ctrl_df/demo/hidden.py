"""A hidden-effect study on data made on the spot: the second flow of the package, start to end."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np

from ..blocks.effect import effect_class
from ..blocks.mechanism import Mechanism, friction_mass

_WHY = "The hidden-effect study needs ctrl_df.identify.improve, which this version does not have."


def rig() -> Mechanism:
    """Return the drive that is measured: unknown to the model, a ripple over position."""
    ripple = effect_class("position_ripple")(amplitude=1.5, wavelength=0.12)  # type: ignore[call-arg]
    return friction_mass(2.2, 3.0, 6.0).with_effect(ripple)


def model() -> Mechanism:
    """Return what its user believes: friction, nominal values."""
    return friction_mass(2.0, 2.5, 5.0)


def embedded_data():
    """Measure the rig for 5 s at 200 Hz: a multisine force, 60 dB of white sensor noise."""
    from ..identify.data.measurement import Measurement
    from ..simulate.response import event_response

    t = np.arange(0, 5, 5e-3)
    random = np.random.default_rng(1997)
    frequencies = np.array([0.3, 0.7, 1.1, 1.9, 3.1, 5.3])
    phases = random.uniform(0, 2 * np.pi, frequencies.size)
    waves = np.sin(2 * np.pi * np.outer(frequencies, t) + phases[:, None])
    force = np.array([9, 7, 6, 5, 5, 5]) @ waves
    response = event_response(rig(), t, force, input_hold="zoh", keep_events=False)  # type: ignore[arg-type]
    x = np.asarray(response.outputs)[0]
    noise = 1e-3 * np.std(x) * random.standard_normal(t.size)
    return Measurement(t, force, x + noise, name="embedded rig")


def study_text(folder: Path) -> str:
    """Improve the model with the embedded data; return the summary, write the report beside the pictures."""
    if importlib.util.find_spec("ctrl_df.identify.improve") is None:
        return _WHY
    from ..identify.improve import improve

    study = improve(model(), embedded_data(), progress=False)
    where = ""
    if importlib.util.find_spec("ctrl_df.identify.report") is not None:
        path = folder / "hidden-effect.html"
        study.report(path)
        where = f"\nreport: {path}"
    return (
        "Hidden effect: a drive is measured (5 s at 200 Hz, 60 dB); its model knows dry and viscous friction "
        "only.\n"
        f"The drive also has a force ripple of 120 mm period.\n{study.summary()}{where}"
    )
