"""Scanned points of the 3D view, in its axes: x forward, y left, z up."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np
import numpy.typing as npt

from ...measurement import Evidence, Measurement
from ...vectors import Array
from ...vehicle import VehicleFrame

MOST_POINTS = 100_000
BEYOND_M = 1.5  # around the wheel centres, sideways and along; points beyond are not shown
ABOVE_M, BELOW_M = 2.0, 1.0


def to_view(frame: VehicleFrame, points_m: npt.ArrayLike) -> Array:
    """Return scanner points (..., 3) as x forward, y left, z up from the rear axle's middle."""
    return np.asarray(frame.to_vehicle(points_m)[..., [1, 0, 2]])


def cloud_tree(measurement: Measurement) -> dict[str, Any] | None:
    """Return points of all scans near the vehicle as 16-bit integers; None without points."""
    kept = [(w, w.observation.cloud) for w in measurement.wheels if w.observation.cloud is not None]
    parts, classes = [], []
    low, high = _bounds(measurement)
    for result, cloud in kept:
        points = cloud.points_m[: MOST_POINTS // len(kept)]
        local = to_view(measurement.frame, points)
        near = np.all((local > low) & (local < high), axis=1)
        parts.append(local[near])
        classes.append(_on_target(result.observation.evidence, points[near]))
    if not parts or not sum(map(len, parts)):
        return None
    points = np.concatenate(parts)
    origin = (points.min(axis=0) + points.max(axis=0)) / 2.0
    step_m = max(float(np.abs(points - origin).max()) / 32767.0, 1e-9)
    grid = np.rint((points - origin) / step_m).astype("<i2")
    return {
        "count": len(points),
        "origin": origin.tolist(),
        "step_m": step_m,
        "positions": _base64(grid),
        "class": _base64(np.concatenate(classes)),
    }


def _bounds(measurement: Measurement) -> tuple[Array, Array]:
    centres = [w.observation.fitted.centre_m for w in measurement.wheels[:4]]
    positions = to_view(measurement.frame, np.stack(centres))
    below = np.array([BEYOND_M, BEYOND_M, BELOW_M])
    above = np.array([BEYOND_M, BEYOND_M, ABOVE_M])
    return positions.min(axis=0) - below, positions.max(axis=0) + above


def _on_target(evidence: Evidence | None, points_m: Array) -> npt.NDArray[np.uint8]:
    """Return 1 for points (N, 3) on the target, 0 for others."""
    if evidence is None or evidence.face is None or evidence.plane is None:
        return np.zeros(len(points_m), np.uint8)
    uvw = (points_m - evidence.target.centre_m) @ evidence.plane.basis.T
    return evidence.face.on_face(uvw).astype(np.uint8)


def _base64(numbers: npt.NDArray[Any]) -> str:
    return base64.b64encode(numbers.tobytes()).decode("ascii")
