"""The force that is missing, as a signal: against dense algebra and known laws, within its errors."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
import rigs

import ctrl_df as cdf
from ctrl_df.identify.smoothing.kalman import smoothed
from ctrl_df.identify.smoothing.missing_force import missing_force


def test_the_smoother_is_the_gaussian_conditional():
    rng = np.random.default_rng(0)
    steps, n, noise = 30, 3, 0.3
    a = np.eye(n) + 0.1 * rng.normal(size=(steps, n, n))
    b, q = rng.normal(size=(steps, n)), np.array([np.diag(d) for d in rng.uniform(0.1, 1, (steps, n))])
    c, y = rng.normal(size=(steps + 1, 2, n)), rng.normal(size=(steps + 1, 2))
    mean0, cov0 = rng.normal(size=n), 2 * np.eye(n)
    info, told = np.einsum("kmi,kmj->kij", c, c) / noise, np.einsum("kmi,km->ki", c, y) / noise
    mean, cov, evidence = smoothed(a, b, q, info, told, mean0, cov0)

    size = n * (steps + 1)
    mu, sigma, h = np.zeros(size), np.zeros((size, size)), np.zeros((2 * (steps + 1), size))
    mu[:n], sigma[:n, :n] = mean0, cov0
    for k in range(steps):
        i, j = slice(n * k, n * k + n), slice(n * k + n, n * k + 2 * n)
        mu[j] = a[k] @ mu[i] + b[k]
        sigma[j, : n * k + n] = a[k] @ sigma[i, : n * k + n]
        sigma[: n * k + n, j] = sigma[j, : n * k + n].T
        sigma[j, j] = a[k] @ sigma[i, i] @ a[k].T + q[k]
    for k in range(steps + 1):
        h[2 * k : 2 * k + 2, n * k : n * k + n] = c[k]
    seen = h @ sigma @ h.T + noise * np.eye(len(h))
    gain = np.linalg.solve(seen, h @ sigma).T
    off = y.ravel() - h @ mu
    np.testing.assert_allclose(mean.ravel(), mu + gain @ off, atol=1e-10)
    whole = sigma - gain @ h @ sigma
    for k in range(steps + 1):
        block = slice(n * k, n * k + n)
        np.testing.assert_allclose(cov[k], whole[block, block], atol=1e-10)
    known = -0.5 * (off @ np.linalg.solve(seen, off) + np.linalg.slogdet(seen)[1])
    assert evidence - 0.5 * (np.sum(y**2) / noise + y.size * np.log(noise)) == pytest.approx(known)


def without(rig):
    """Return the block without the hidden effect, its other parameters true."""
    mine = rig.baseline.parameters
    return rig.baseline.with_parameters({k: v for k, v in rig.truth.items() if k in mine})


def spring(truth, m):
    return -truth["linear_spring.stiffness"] * m.quantities["position"]


def drag(truth, m):
    v = m.quantities["velocity"]
    return -truth["quadratic_drag.coefficient"] * v * np.abs(v)


@pytest.mark.parametrize(
    ("hidden", "law", "against"),
    [("linear_spring", spring, "position"), ("quadratic_drag", drag, "velocity")],
)
def test_a_hidden_law_is_read_off(hidden, law, against):
    rig = rigs.draw(hidden, 4, ratio=1.0, snr_db=50, n=5000)
    m = cdf.compare(without(rig), rig.train[0].measurement()).missing_force
    true = law(rig.truth, m)
    # seen: 0.996 and 1.0 of the truth within two standard deviations, correlated by 0.99
    assert np.mean(np.abs(m.force - true)[m.known] < 2 * m.std[m.known]) > 0.9
    assert np.corrcoef(m.force[m.known], true[m.known])[0, 1] > 0.95
    assert next(iter(m.shares)) == against and m.shares[against] > 0.5
    assert m.noise == pytest.approx(rig.train[0].noise, rel=0.05)
    assert m.force.shape == m.std.shape == m.time.shape and m.unit == "N"


def test_nothing_missing_is_nothing():
    """Of a record by the model itself, the force is nothing within its standard deviation."""
    rng = np.random.default_rng(3)
    block = cdf.Inertia(0.02).with_effect(cdf.Coulomb(0.1)).with_effect(cdf.Viscous(0.05))
    t = np.arange(3000) * 2e-3
    u = 0.4 * np.sin(4 * t) + 0.2 * np.sin(11 * t)
    angle = np.asarray(cdf.event_response(block, t, u, input_hold="zoh").outputs)[0]
    y = angle + 1e-4 * rng.standard_normal(len(t))
    record = cdf.Measurement(t, u, y, input_unit="N m", output_unit="rad")
    m = missing_force(block, record)
    assert m.unit == "N m" and m.units["velocity"] == "rad/s"
    assert np.sqrt(np.mean(m.force**2)) < 0.02 * np.std(u)
    assert np.mean(np.abs(m.force) < 2.5 * m.std) > 0.9
    for against in ("time", "position", "velocity", "load", "reversal"):
        m.plot(against)
        plt.close("all")
    assert "rms" in m.summary() and len(repr(m)) < 300
    with pytest.raises(ValueError, match="against"):
        m.plot("speed")


def test_what_has_no_missing_force_is_refused():
    record = cdf.Measurement(np.arange(300) * 1e-3, np.sin(np.arange(300)), np.arange(300) * 1e-3)
    loop = cdf.closed_loop(cdf.pid(10, 0, 1, tf=0.01), cdf.friction_mass(1, 1, 1))
    with pytest.raises(ValueError, match="force that was recorded"):
        missing_force(loop, record)
    with pytest.raises(TypeError, match="mechanism|masses and effects"):
        missing_force(3, record)
