"""Line of two methods whose points share errors, with uncertainties of few degrees of freedom."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ...system import frozen
from ...uncertainty import f_beyond
from ...vectors import Array
from .joint_test import Spread
from .line_fit import Line, fit_line

# Degrees of freedom with which the mean of all captures counts in a point's weight: weights by u
# of eight are worth less than equal ones, and from some hundred on they are a point's own.
COMMON = 60.0


@frozen
class LinePoints:
    """Points (N,) of two methods x and y, their variances and covariance, and dof of y - x.

    spreads: covariances of x - y by capture, of its points in their order; captures share nothing.
    """

    x: Array
    y: Array
    variance_x: Array
    variance_y: Array
    both: Array
    dof: Array
    spreads: tuple[Spread, ...]


@frozen
class _Errors:
    """Moments of the residuals' sum S, and the covariance (2, 2) of the line in terms of B.

    mean: tr(A V). square: tr(A V A V). spread: sum over sources of tr(A V_k)^2 / dof_k.
    """

    mean: float
    square: float
    spread: float
    within: Array


def fit_shared_line(points: LinePoints) -> Line | None:
    """Fit York's line; its covariance and p-value count shared errors and degrees of freedom.

    The weights of points are York's, with variances that lean on the mean of all captures by their
    degrees of freedom; the covariance of intercept and slope is that of all errors through these
    weights. The residuals' sum S = d' A d has the mean tr(A V) and, by its variance, f degrees of
    freedom (Box), as V has nu (Satterthwaite): S / tr(A V) is F(f, nu). chi_square is S scaled so
    that its mean is N - 2. With independent points of known u all this is York's fit. None as
    `fit_line`.
    Source: Box, Annals of Mathematical Statistics 25 (1954) 290; JCGM 100, G.4.
    """
    v_x, v_y, both = (
        _leaning(values, points.dof)
        for values in (points.variance_x, points.variance_y, points.both)
    )
    u_x, u_y = np.sqrt(v_x), np.sqrt(v_y)
    line = fit_line(points.x, points.y, u_x, u_y, both / np.maximum(u_x * u_y, 1e-300))
    if line is None:
        return None
    slope = line.slope
    weights = 1.0 / (v_y + slope**2 * v_x - 2.0 * slope * both)
    residuals = points.y - slope * points.x - line.intercept
    adjusted = points.x + (slope * v_x - both) * weights * residuals
    X = np.column_stack([np.ones(len(adjusted)), adjusted])
    root = np.linalg.cholesky(np.linalg.inv(X.T @ (weights[:, None] * X)))
    errors = _errors(points, slope, weights, weights[:, None] * (X @ root))
    if not errors.mean > 0.0:
        return None
    ratio = float(np.sum(weights * residuals**2)) / errors.mean
    covariance = root @ errors.within @ root.T
    dof = errors.mean**2 / errors.spread if errors.spread > 0.0 else math.inf
    return replace(
        line,
        u_intercept=math.sqrt(covariance[0, 0]),
        u_slope=math.sqrt(covariance[1, 1]),
        covariance=float(covariance[0, 1]),
        chi_square=ratio * line.dof,
        probability=f_beyond(ratio, errors.mean**2 / errors.square, dof),
    )


def _leaning(values: Array, dof: Array) -> Array:
    """Return variances or covariances (N,) that lean on their mean by their dof."""
    common = 1.0 / (1.0 + dof / COMMON)
    return np.asarray((1.0 - common) * values + common * values.mean())


def _errors(points: LinePoints, slope: float, weights: Array, B: Array) -> _Errors:
    """Return moments of errors through A = W - B B', with the line's (N, 2) B, by captures."""
    ratios = _variance(points, slope) / np.maximum(_variance(points, 1.0), 1e-300)
    scales = np.sqrt(ratios)  # the spreads are those of differences, of slope 1
    mean, square, total, within, start = 0.0, 0.0, 0.0, np.zeros((2, 2)), 0
    for spread in points.spreads:
        rows = slice(start, start + len(spread.parts[0]))
        start = rows.stop
        w, b, scale = weights[rows], B[rows], np.outer(scales[rows], scales[rows])
        A = np.diag(w) - b @ b.T
        for part, dof in zip(spread.parts, spread.dofs, strict=True):
            own = float(np.sum(A * part * scale))
            mean, total = mean + own, total + own**2 / dof
        V = spread.covariance * scale
        seen = b.T @ V
        square += float(np.sum((w[:, None] * V) * (w[:, None] * V).T))
        square -= 2.0 * float(np.trace(seen @ (w[:, None] * seen.T)))
        within += seen @ b
    return _Errors(mean, square + float(np.sum(within * within.T)), total, within)


def _variance(points: LinePoints, slope: float) -> Array:
    """Return the variances (N,) of y - slope x."""
    return np.asarray(points.variance_y + slope**2 * points.variance_x - 2.0 * slope * points.both)
