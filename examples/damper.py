r"""
What gives way in a friction damper?
====================================

**Problem.** A banded rotary friction damper stands on a test machine: a displacement is imposed as a sine, a
load cell records the force (data set "Friction damper with backlash", ARTS Laboratory, CC BY-SA 4.0). The
building's engineers want a model that holds at other strokes and frequencies than the one measured. Run with
``python examples/damper.py FOLDER``: FOLDER holds the CSV files, columns ``t_s``, ``displacement_m``,
``force_N``. The data are no part of this repository, and this page is not run when the site is built.

.. code-block:: text

    test machine ---x(t)--->[ linkage ]---[ band on a drum ]---| ground
                                 F <--- load cell

**Method.** Motion goes in, force comes out: the model is a `Massless` and every error is one of force. Start
from dry and viscous friction, look at the force that is missing, let `improve` name it on one record, held
against another of half the stroke, and validate the answer at another frequency too.
"""

import sys
from functools import partial
from pathlib import Path

import matplotlib.pyplot as plt

import ctrl_df as cdf

TRAIN, HELD_OUT = "1Hz30lbtension1amplitude", "1Hz30lbtension0.5amplitude"


# %%
def records(folder) -> dict[str, cdf.Measurement]:
    """Return the records of a folder by name: frequency, preload of the band, amplitude in inches."""
    return {
        path.stem: cdf.Measurement.from_csv(
            path, time="t_s", input="displacement_m", output="force_N", input_unit="m", output_unit="N",
            input_hold="linear",
        )
        for path in sorted(Path(folder).glob("*.csv"))
    }  # fmt: skip


def loops(runs, model):
    """Draw force over displacement, measured and modelled, a picture for each record."""
    fig, axes = plt.subplots(
        1, len(runs), figsize=(4 * len(runs), 3.8), sharey=True, squeeze=False, layout="constrained"
    )
    for ax, (name, run) in zip(axes[0], runs.items(), strict=True):
        beside = cdf.compare(model, run)
        ax.plot(1e3 * run.u, 1e-3 * run.y, color="0.7", lw=0.8, label="measured")
        (used,) = (r.record for r in beside.records)  # without the ends, where its speed is not known
        ax.plot(1e3 * used.u, 1e-3 * beside.simulated, color="#c8501e", lw=1.0, label="model")
        ax.set(title=f"{name}\nerror {beside.nrmse:.3f}", xlabel="displacement [mm]")
        ax.title.set_fontsize(8)
    axes[0, 0].set_ylabel("force [kN]")
    fig.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=2, frameon=False)


# %%
# The first model is the usual one of a damper. Its parameters are refitted before it is judged. The summary
# of `missing_force` says how much force this model lacks, and of which quantity it is a function; the picture
# shows it over the distance since the last reversal.


# %%
def main(folder):
    """Tell the story; returns the ladder."""
    runs = records(folder)
    if TRAIN not in runs:
        sys.exit(f"{folder} holds no {TRAIN}.csv: see the top of this file for what is needed.")
    others = {name: run for name, run in runs.items() if name != TRAIN}
    begin = cdf.Massless().with_effect(cdf.Coulomb(8000.0)).with_effect(cdf.Viscous(1000.0))
    plain = cdf.refit(begin, runs[TRAIN])
    print(f"Dry and viscous friction alone: {plain.comparison}\n")
    missing = plain.comparison.missing_force
    print(missing.summary(), "\n")
    missing.plot("reversal")

    # Half the stroke is held out: what describes one record, not the damper, makes the error there larger.
    # The third record is not touched before the end.
    tell = partial(print, file=sys.stderr, flush=True)  # what is being done, a line a stage
    study = cdf.improve(begin, runs[TRAIN], runs.get(HELD_OUT), max_effects=2, progress=tell)
    print(study.summary(), "\n")

    print("Error of force, relative rms, on records that were not fitted:")
    errors = {name: cdf.compare(study.model, run).nrmse for name, run in others.items()}
    lugre = cdf.refit(plain.model.with_effect(cdf.Bristle(2e6, 1e4)), runs[TRAIN]).model
    for name, error in errors.items():
        print(f"  {name:<32} {error:.3f}   (LuGre {cdf.compare(lugre, others[name]).nrmse:.3f})")
    assert not errors or max(errors.values()) < 0.15
    loops(runs, study.model)
    if "loose_linkage" in study.effects:
        gap = study.model.parameters["loose_linkage.gap"]
        print(f"\nFound: a linkage with play, free travel {1e3 * gap.value:.3g} mm in all.")
    plt.show()
    return study


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__ or "usage: python examples/damper.py FOLDER")
    main(sys.argv[1])
