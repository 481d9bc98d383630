"""The uncertainty of every quantity as plain data: budget, covariance, Monte Carlo."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ...measurement import Measurement, PooledAngle, Stated, pool_repeats, stated
from ...uncertainty import TOLERANCE

IN_REPORT = {"rad": (math.degrees(1.0), "deg"), "m": (1.0, "m")}


def uncertainty_tree(measurement: Measurement, found: list[Stated]) -> dict[str, Any]:
    """Return `uncertainty`, one entry per quantity, and the `covariance` for the rear-axle normal.

    found: all stated quantities. Degrees and metres. Toe relative to another axis is toe minus
    (left) or plus (right) the angle of that axis, which the covariance contains as well.
    """
    rows = [i for i, quantity in enumerate(found) if quantity.axis in (None, "rear-axle")]
    related = [found[i] for i in rows]
    scale = np.array([IN_REPORT[quantity.unit][0] for quantity in related])
    matrix = measurement.uncertainty.covariance[np.ix_(rows, rows)] * np.outer(scale, scale)
    components = measurement.uncertainty.components
    return {
        "uncertainty": [_entry(quantity, components) for quantity in found],
        "covariance": {
            "quantities": [quantity.name for quantity in related],
            "units": [IN_REPORT[quantity.unit][1] for quantity in related],
            "matrix": ((matrix + matrix.T) / 2.0).tolist(),
        },
    }


def _entry(quantity: Stated, components: tuple[str, ...]) -> dict[str, Any]:
    scale, unit = IN_REPORT[quantity.unit]
    return {
        "quantity": quantity.name,
        "unit": unit,
        "value": quantity.value * scale,
        "u": quantity.u * scale,
        "degrees_of_freedom": quantity.dof if math.isfinite(quantity.dof) else None,
        "coverage_factor_95": quantity.coverage_factor,
        "expanded_95": quantity.expanded * scale,
        "share_of_variance": dict(zip(components, quantity.contributions.tolist(), strict=True)),
        "share_through_frame": quantity.through_frame,
    }


def monte_carlo_tree(measurement: Measurement) -> dict[str, Any] | None:
    """Return the Monte Carlo check; null where none was requested."""
    drawn = measurement.monte_carlo
    if drawn is None:
        return None
    found = stated(measurement)
    columns = (drawn.mean, drawn.standard, drawn.low, drawn.high, drawn.half, drawn.end_difference)
    rows = zip(found, *columns, strict=True)
    entries = []
    for quantity, *numbers in rows:
        scale, unit = IN_REPORT[quantity.unit]
        mean, u, low, high, half, difference = (float(number) * scale for number in numbers)
        entries.append(
            {
                "quantity": quantity.name,
                "unit": unit,
                "mean": mean,
                "u": u,
                "interval_95": [low, high],
                "expanded_95": half,
                "apart": difference,
            }
        )
    return {
        "trials": drawn.draws,
        "status": drawn.status,
        "tolerance_of_u": TOLERANCE,
        "quantities": entries,
    }


def repeats_tree(measurement: Measurement) -> list[dict[str, Any]]:
    """Return the pooled repeat scans; degrees."""
    return [
        {
            "of": group.of,
            "scans": list(group.scans),
            **{angle.kind: _pooled(angle) for angle in group.angles},
        }
        for group in pool_repeats(measurement)
    ]


def _pooled(angle: PooledAngle) -> dict[str, Any]:
    drift, u_drift = angle.drift, angle.u_drift
    return {
        "pooled_deg": math.degrees(angle.pooled),
        "u_deg": math.degrees(angle.u),
        "chi_square": angle.chi_square,
        "degrees_of_freedom": angle.dof,
        "probability": angle.probability,
        "drift_deg_per_scan": None if drift is None else math.degrees(drift),
        "u_drift_deg_per_scan": None if u_drift is None else math.degrees(u_drift),
        "status": angle.status,
        "scatter_deg": math.degrees(angle.scatter),
    }
