"""What a user would take today to find a missing term: sparse regression of the force on motion.

Both peers see the smoothed motion and a library of terms; each returns the effect ids it would name, an empty
tuple where it finds nothing beyond mass, Coulomb and viscous friction.
"""

from __future__ import annotations

import warnings

import numpy as np

BASE = ("mass", "coulomb", "viscous")


def terms(record):
    """Return the force, the columns by effect id, and where the mass moves."""
    v, a = record.velocity_estimate(), record.acceleration_estimate()
    x, u = record.y, record.u
    columns = {
        "mass": a, "coulomb": np.sign(v), "viscous": v, "quadratic_drag": v * np.abs(v),
        "asymmetric_viscous": np.abs(v),
        "constant_force": np.ones_like(v), "linear_spring": x, "cubic_spring": x**3,
        "stribeck": np.sign(v) * np.exp(-np.square(v / (0.1 * np.std(v) + 1e-12))),
        "input_delay": np.gradient(u, record.t),
    }  # fmt: skip
    return u, columns, np.abs(v) > 0.02 * np.std(v)


def lasso(record):
    """LASSO, its penalty cross-validated, on the residual of the inverse dynamics of the base model."""
    from sklearn.linear_model import LassoCV

    force, columns, good = terms(record)
    base = np.column_stack([columns[k] for k in BASE])[good]
    q, _ = np.linalg.qr(base / np.linalg.norm(base, axis=0))
    extra = [k for k in columns if k not in BASE]
    matrix = np.column_stack([columns[k][good] for k in extra])
    matrix = matrix - q @ (q.T @ matrix)
    matrix /= np.std(matrix, axis=0) + 1e-12
    target = force[good] - q @ (q.T @ force[good])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        weights = np.abs(LassoCV(cv=5).fit(matrix, target).coef_)
    best = int(np.argmax(weights))
    return (extra[best],) if weights[best] > 0.05 * np.std(force) else ()


def sindy(record):
    """Sparse identification of the acceleration, sequentially thresholded (pysindy's STLSQ)."""
    import pysindy

    force, columns, good = terms(record)
    others = [k for k in columns if k != "mass"]
    matrix = np.column_stack([force[good], *(columns[k][good] for k in others)])
    size = np.linalg.norm(matrix, axis=0) + 1e-12
    target = columns["mass"][good]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        optimizer = pysindy.STLSQ(threshold=0.02 * np.linalg.norm(target), alpha=1e-6)
        optimizer.fit(matrix / size, target[:, None])
    weights = np.abs(np.ravel(optimizer.coef_))[1:]
    left = {k: w for k, w in zip(others, weights, strict=True) if k not in BASE and w > 0}
    return (max(left, key=lambda k: left[k]),) if left else ()


def installed():
    """Return the peers that can be run here."""
    found = {}
    for module, name, peer in (("sklearn", "LASSO", lasso), ("pysindy", "SINDy", sindy)):
        try:
            __import__(module)
        except ImportError:
            continue
        found[name] = peer
    return found


PEERS = installed()
