"""Straight line fit with uncertainties in both coordinates (York regression)."""

from __future__ import annotations

import math

import numpy as np

from ...system import frozen
from ...uncertainty import chi_square_beyond
from ...vectors import Array

ITERATIONS = 200
CONVERGED = 1e-14  # relative change of the slope


@frozen
class Line:
    """Line y = intercept + slope x, its standard uncertainties and goodness of fit.

    covariance: of intercept and slope. chi_square: with `dof` degrees of freedom; probability: its
    p-value.
    """

    intercept: float
    slope: float
    u_intercept: float
    u_slope: float
    covariance: float
    chi_square: float
    dof: int
    probability: float


def fit_line(x: Array, y: Array, u_x: Array, u_y: Array, correlation: Array) -> Line | None:
    """Fit the line of maximum likelihood; None for fewer than 3 points, no spread or no error.

    Nor is there a line where a point would weigh infinitely, as where all y are equal and u_y is 0.
    x, y, u_x, u_y, correlation: (N,); correlation is that of a point's two errors. With all equal
    and none correlated it is the Deming regression.
    Source: York, Evensen, Martinez and De Basabe Delgado, Am. J. Phys. 72 (2004) 367, section III.
    """
    if len(x) < 3 or not float(np.ptp(x)) > 0.0 or not np.all(u_x + u_y > 0.0):
        return None
    if not float(np.ptp(y)) > 0.0 and not np.all(u_y > 0.0):
        return None
    both = correlation * u_x * u_y
    slope = float(np.polyfit(x - x.mean(), y - y.mean(), 1)[0])
    for _ in range(ITERATIONS):
        across = u_y**2 + slope**2 * u_x**2 - 2.0 * slope * both
        if not np.all(across > 0.0):
            return None
        weight = 1.0 / across
        x_mean, y_mean = np.average(x, weights=weight), np.average(y, weights=weight)
        U, V = x - x_mean, y - y_mean
        beta = weight * (U * u_y**2 + slope * V * u_x**2 - (slope * U + V) * both)
        before, slope = slope, float(np.sum(weight * beta * V) / np.sum(weight * beta * U))
        if abs(slope - before) <= CONVERGED * abs(slope):
            break
    adjusted = x_mean + beta
    centre = float(np.average(adjusted, weights=weight))
    variance = 1.0 / float(np.sum(weight * (adjusted - centre) ** 2))
    intercept = float(y_mean - slope * x_mean)
    square = float(np.sum(weight * (y - slope * x - intercept) ** 2))
    dof = len(x) - 2
    return Line(
        intercept=intercept,
        slope=slope,
        u_intercept=math.sqrt(1.0 / float(np.sum(weight)) + centre**2 * variance),
        u_slope=math.sqrt(variance),
        covariance=-centre * variance,
        chi_square=square,
        dof=dof,
        probability=chi_square_beyond(square, dof),
    )
