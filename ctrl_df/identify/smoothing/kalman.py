# pyright: reportCallIssue=false
"""Kalman filter and Rauch-Tung-Striebel smoother over affine steps, with the likelihood of what was measured.

s_(k+1) = A_k s_k + b_k + w_k, w_k of covariance Q_k; of each s_k the measurements say, up to a constant,
log p(y_k | s_k) = h_k s_k - s_k J_k s_k / 2. Source: Sarkka & Svensson, Bayesian Filtering and Smoothing, 2nd
ed. (2023), ch. 6 and 12.
"""

from __future__ import annotations

import math

import numpy as np

from ...simulate.compiler.compiled import njit, part
from ...simulate.compiler.views import lean


@part
def _solve(a, b):
    """Replace b (n, k) by the solution of a x = b; returns log |det a|. `a` is used up."""
    n, logdet = a.shape[0], 0.0
    for i in range(n):
        best = i
        for j in range(i + 1, n):
            if abs(a[j, i]) > abs(a[best, i]):
                best = j
        if best != i:
            for j in range(n):
                a[i, j], a[best, j] = a[best, j], a[i, j]
            for j in range(b.shape[1]):
                b[i, j], b[best, j] = b[best, j], b[i, j]
        if a[i, i] == 0.0:
            return -math.inf
        logdet += math.log(abs(a[i, i]))
        for j in range(i + 1, n):
            factor = a[j, i] / a[i, i]
            if factor != 0.0:
                for m in range(i, n):
                    a[j, m] -= factor * a[i, m]
                for m in range(b.shape[1]):
                    b[j, m] -= factor * b[i, m]
    for i in range(n - 1, -1, -1):
        for m in range(b.shape[1]):
            value = b[i, m]
            for j in range(i + 1, n):
                value -= a[i, j] * b[j, m]
            b[i, m] = value / a[i, i]
    return logdet


@part
def _measure(info, vector, m, p, mean, cov, left, right):
    """Write mean (n,) and covariance of a state m, p after it is measured; return the evidence of that.

    P <- (I + P J)^-1 P.
    """
    n = mean.shape[0]
    for i in range(n):
        for j in range(n):
            value = 1.0 if i == j else 0.0
            for c in range(n):
                value += p[i, c] * info[c, j]
            left[i, j] = value
            right[i, j] = p[i, j]
    evidence = -0.5 * _solve(left, right)
    for i in range(n):
        value, square = vector[i], 0.0
        for j in range(n):
            value -= info[i, j] * m[0, j]
            square += info[i, j] * m[0, j]
        m[1, i] = value
        evidence += m[0, i] * (vector[i] - 0.5 * square)
    for i in range(n):
        value = m[0, i]
        for j in range(n):
            value += 0.5 * (right[i, j] + right[j, i]) * m[1, j]
            evidence += 0.5 * m[1, i] * right[i, j] * m[1, j]
        mean[i] = value
    for i in range(n):
        for j in range(n):
            cov[i, j] = 0.5 * (right[i, j] + right[j, i])
    return evidence


@part
def _predict(a, b, q, mean, cov, left, m, p):
    """Write the mean m[0] and covariance p a step after `mean` and `cov`; and P A^T to `left`."""
    n = mean.shape[0]
    for i in range(n):
        value = b[i]
        for j in range(n):
            value += a[i, j] * mean[j]
        m[0, i] = value
        for j in range(n):
            total = 0.0
            for c in range(n):
                total += cov[i, c] * a[j, c]
            left[i, j] = total
    for i in range(n):
        for j in range(n):
            total = q[i, j]
            for c in range(n):
                total += a[i, c] * left[c, j]
            p[i, j] = total


@part
def _go_back(gain, m, p, mean, cov, left, right):
    """Add to mean and covariance what is known after the step: m[0] and p more than was predicted."""
    n = mean.shape[0]
    for i in range(n):
        value = mean[i]
        for j in range(n):
            value += gain[i, j] * m[0, j]
            total = 0.0
            for c in range(n):
                total += gain[i, c] * p[c, j]
            left[i, j] = total
        mean[i] = value
    for i in range(n):
        for j in range(n):
            total = 0.0
            for c in range(n):
                total += left[i, c] * gain[j, c]
            right[i, j] = total
    for i in range(n):
        for j in range(n):
            cov[i, j] += 0.5 * (right[i, j] + right[j, i])


@njit(error_model="numpy")
def smooth(a, b, q, info, info_vector, mean0, cov0, mean, cov, scratch, back):
    """Write means (N + 1, n) and covariances (N + 1, n, n) given all measurements; return their evidence.

    a (N, n, n), b (N, n), q (N, n, n): the steps; info (N + 1, n, n), info_vector (N + 1, n): J and h; mean0,
    cov0: before anything is measured. scratch (N + 5, n, n). The evidence lacks what depends on the
    measurements and their noise alone. Without `back` only it is computed: what is written is that of the
    filter.
    """
    a, b, q, info, info_vector, mean0 = lean(a), lean(b), lean(q), lean(info), lean(info_vector), lean(mean0)
    cov0, mean, cov, scratch = lean(cov0), lean(mean), lean(cov), lean(scratch)
    n, steps = mean0.shape[0], a.shape[0]
    m, p, left, right = scratch[steps], scratch[steps + 1], scratch[steps + 2], scratch[steps + 3]
    before = scratch[steps + 4]
    for i in range(n):
        m[0, i] = mean0[i]
        for j in range(n):
            p[i, j] = cov0[i, j]
    evidence = 0.0
    for k in range(steps + 1):
        evidence += _measure(info[k], info_vector[k], m, p, mean[k], cov[k], left, right)
        if k == steps:
            break
        _predict(a[k], b[k], q[k], mean[k], cov[k], left, m, p)
        if not back:
            continue
        # gain of the way back: G = P A^T (P^-)^-1, from P^- G^T = A P
        for i in range(n):
            for j in range(n):
                before[i, j] = p[i, j]
                right[i, j] = left[j, i]
        _solve(before, right)
        for i in range(n):
            for j in range(n):
                scratch[k, i, j] = right[j, i]
    for k in range(steps - 1 if back else -1, -1, -1):
        _predict(a[k], b[k], q[k], mean[k], cov[k], left, m, p)
        for i in range(n):
            m[0, i] = mean[k + 1, i] - m[0, i]
            for j in range(n):
                p[i, j] = cov[k + 1, i, j] - p[i, j]
        _go_back(scratch[k], m, p, mean[k], cov[k], left, right)
    return evidence


def smoothed(a, b, q, info, info_vector, mean0, cov0, back=True):
    """Return (means, covariances, evidence); see `smooth`."""
    steps, n = b.shape
    mean, cov = np.zeros((steps + 1, n)), np.zeros((steps + 1, n, n))
    scratch = np.zeros((steps + 5, max(n, 2), n))
    evidence = smooth(a, b, q, info, info_vector, mean0, cov0, mean, cov, scratch, back)
    return mean, cov, evidence
