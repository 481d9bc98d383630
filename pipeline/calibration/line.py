"""Zero error, sensitivity and linearity: a straight line through readings over references."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..measurement import Estimate, estimate
from ..uncertainty import Effect, f_beyond
from ..validation import fit_line
from ..vectors import Array
from .records import Characteristic, Origin

LEAST_KNOWN = 0.5  # U of the sensitivity above which the spread of the points shows none


def characteristic(
    names: list[str],
    references: list[Estimate],
    errors: Array,
    budget: Sequence[tuple[Origin, Effect]],
) -> Characteristic:
    """Fit the line of N points; below three, or without spread, their mean error is the zero error.

    errors: (N,) readings less references; budget: effects on these. The line is York's, with the
    uncertainties of reading and reference; its covariance is propagated from all effects, so that
    what references of one frame share counts in full. Of an error of a reference, the line sees the
    slope's part.
    """
    count, effects = len(names), [effect for _, effect in budget]
    x = np.array([one.value for one in references])
    u_x = np.array([one.u for one in references])
    variance = sum((np.sum(e.factor**2, axis=1) for e in effects), np.zeros(count))
    u_y = np.sqrt((variance - u_x**2).clip(min=0.0))
    mean = Characteristic(estimate(float(errors.mean()), np.full(count, 1.0 / count), effects))
    line = fit_line(x, x + errors, u_x, u_y, np.zeros(count))
    if line is None or not line.u_slope < LEAST_KNOWN:
        return mean
    weights = 1.0 / (u_y**2 + (line.slope * u_x) ** 2)
    residuals = x + errors - line.intercept - line.slope * x
    adjusted = x + line.slope * u_x**2 * weights * residuals
    X = np.column_stack([np.ones(count), adjusted])
    solution = np.linalg.solve(X.T @ (weights[:, None] * X), X.T * weights)
    seen = [
        replace(effect, factor=line.slope * effect.factor) if origin == "reference" else effect
        for origin, effect in budget
    ]
    sensitivity = estimate(line.slope, solution[1], seen)
    if not sensitivity.expanded < LEAST_KNOWN:
        return mean
    left = np.eye(count) - X @ solution
    worst = int(np.argmax(np.abs(residuals)))
    return Characteristic(
        zero=estimate(line.intercept, solution[0], seen),
        sensitivity=sensitivity,
        linearity=estimate(float(residuals[worst]), left[worst], seen),
        worst_point=names[worst],
        fits=_probability(residuals, left, seen),
    )


def _probability(residuals: Array, left: Array, effects: list[Effect]) -> float | None:
    """Return the probability of residuals as large; left: (N, N) their derivatives by the errors.

    Hotelling's form r' C^-1 r of N - 2 degrees of freedom, over those of the largest effect.
    """
    count = len(residuals) - 2
    covariance = sum((left @ e.factor @ (left @ e.factor).T for e in effects), 0.0 * left)
    values, vectors = np.linalg.eigh(covariance)
    if not values[-count] > 1e-12 * values[-1]:
        return None
    square = float(np.sum((vectors[:, -count:].T @ residuals) ** 2 / values[-count:]))
    shares = [(float(np.trace(left @ e.factor @ (left @ e.factor).T)), e.dof) for e in effects]
    dof = max(shares)[1]
    return f_beyond(square / count, count, dof)
