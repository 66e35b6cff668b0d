"""What does a real linear drive hide? The EMPS benchmark (Janot, Gautier & Brunot 2019) climbed step by step.

    python examples/emps.py FOLDER [REPORT.html]

FOLDER holds DATA_EMPS.mat and DATA_EMPS_PULSES.mat; the data are not part of this repository.
"""

import sys
from pathlib import Path

import numpy as np
from scipy.io import loadmat

import ctrl_df as cdf
from ctrl_df.identify.improve import improve
from ctrl_df.identify.measurement import Measurement


def record(path: Path) -> Measurement:
    """Return one run: the force is the drive gain times the controller's volts."""
    data = {k: np.ravel(v) for k, v in loadmat(path).items() if not k.startswith("__")}
    return Measurement(data["t"], float(data["gtau"][0]) * data["vir"], data["qm"], name=path.stem)


def free_run_rmse(model, run: Measurement) -> float:
    """Return the position error [m] of a free run over the whole record, from rest at the first sample."""
    from ctrl_df.identify.simulator import free_run

    y = free_run(model, run, position=float(run.y[0]))
    return float(np.sqrt(np.mean((run.y - y) ** 2)))


def main(folder, report=None):
    """Tell the story; returns the study."""
    train, test = (record(Path(folder) / f"{name}.mat") for name in ("DATA_EMPS", "DATA_EMPS_PULSES"))
    # The published symmetric model is where a user would begin.
    start = cdf.Mass(95.1, [cdf.Coulomb(20.4), cdf.Viscous(203.5), cdf.ConstantForce(3.16)])
    study = improve(start, train, test)
    print(study.summary())
    print(f"\nFree run over the test record, published parameters: {1e3 * free_run_rmse(start, test):.2f} mm")
    for step in study.steps:
        print(
            f"  {'+ ' + step.effect if step.effect else 'refitted':<24} {1e3 * free_run_rmse(step.model, test):.2f} mm"
        )
    if report:
        print("Report:", study.report(report))
    return study


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    main(*sys.argv[1:3])
