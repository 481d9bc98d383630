"""Generalised least squares of values with a covariance, and their scatter beyond it."""

from __future__ import annotations

import numpy as np

from ..vectors import Array

BISECTIONS = 60


def least_squares(slopes: Array, values: Array, covariance: Array) -> tuple[Array, Array, float]:
    """Return coefficients (p,), their standard uncertainties, and chi-square of the residuals.

    slopes: (n, p) of values (n,) by the coefficients; covariance: (n, n) of the values.
    Raises ValueError where that is zero. Source: generalised least squares, Aitken (1935).
    """
    scale = float(np.trace(covariance)) / len(covariance)
    if not scale > 0.0:
        raise ValueError("values without any uncertainty cannot be compared")
    # Shared components add to the pooled value and nothing to the differences; 1e-12 keeps the
    # matrix regular where nothing else distinguishes the values.
    V = covariance / scale + 1e-12 * np.eye(len(values))
    weighted = np.linalg.solve(V, slopes)
    inverse = np.linalg.inv(slopes.T @ weighted)
    found = inverse @ (weighted.T @ values)
    residual = values - slopes @ found
    chi_square = float(residual @ np.linalg.solve(V, residual)) / scale
    return found, np.sqrt(np.diag(inverse) * scale), chi_square


def scatter_beyond(slopes: Array, values: Array, covariance: Array, most: float) -> float:
    """Return the standard deviation of each of values (n,) beyond their covariance (n, n).

    With it, the squares of the residuals are n - p; without it, they are more. At most `most`.
    Source: Paule and Mandel, J. Res. NBS 87 (1982) 377.
    """
    low, high, expected = 0.0, most, len(values) - slopes.shape[1]
    for _ in range(BISECTIONS):
        middle = (low + high) / 2.0
        wider = covariance + middle**2 * np.eye(len(values))
        chi_square = least_squares(slopes, values, wider)[2]
        low, high = (middle, high) if chi_square > expected else (low, middle)
    return high
