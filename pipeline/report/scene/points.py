"""Scanned points of the 3D view, in its axes: x forward, y left, z up."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from ...measurement import SIGMAS, Measurement, WheelResult
from ...vectors import Array
from ...vehicle import VehicleFrame

MOST_POINTS = 100_000
BEYOND_M = 1.5  # around the wheel centres, sideways and along; points beyond are not shown
ABOVE_M, BELOW_M = 2.0, 1.0
OFF_TARGET = -32768  # in place of a distance from a target's plane


def to_view(frame: VehicleFrame, points_m: npt.ArrayLike) -> Array:
    """Return scanner points (..., 3) as x forward, y left, z up from the rear axle's middle."""
    return np.asarray(frame.to_vehicle(points_m)[..., [1, 0, 2]])


def cloud_tree(measurement: Measurement) -> dict[str, Any] | None:
    """Return points of all scans near the vehicle as 16-bit integers; None without points."""
    kept = [w for w in measurement.wheels if w.observation.cloud is not None]
    parts, flags, residuals = [], [], []
    low, high = _bounds(measurement)
    range_um = residual_range_um(measurement)
    for result in kept:
        assert result.observation.cloud is not None
        points = result.observation.cloud.points_m[: MOST_POINTS // len(kept)]
        local = to_view(measurement.frame, points)
        near = np.all((local > low) & (local < high), axis=1)
        parts.append(local[near])
        flag, residual_um = on_target([result], points[near])
        flags.append(flag)
        residuals.append(residual_um)
    if not parts or not sum(map(len, parts)):
        return None
    points = np.concatenate(parts)
    origin = (points.min(axis=0) + points.max(axis=0)) / 2.0
    step_m = max(float(np.abs(points - origin).max()) / 32767.0, 1e-9)
    grid = np.rint((points - origin) / step_m).astype("<i2")
    scans = {wheel.observation.source.partition(":")[0]: wheel.observation for wheel in kept}
    return {
        "count": len(points),
        "total": sum(observed.points_total for observed in scans.values()),
        "origin": origin.tolist(),
        "step_m": step_m,
        "positions": _base64(grid),
        "class": _base64(np.concatenate(flags)),
        "residual": base64_bytes(np.concatenate(residuals), range_um),
        "residual_um": range_um,
        "scans": [
            {"name": wheel.observation.name, "count": len(part)}
            for wheel, part in zip(kept, parts, strict=True)
        ],
    }


def on_target(
    results: Sequence[WheelResult], points_m: Array
) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.int16]]:
    """Return 1 for points (N, 3) on a target, and distances from its plane, micrometres.

    The distances are positive towards the scanner; OFF_TARGET for points that are on none.
    """
    flags = np.zeros(len(points_m), np.uint8)
    residual_um = np.full(len(points_m), OFF_TARGET, "<i2")
    for result in results:
        evidence = result.observation.evidence
        if evidence is None or evidence.face is None or evidence.plane is None:
            continue
        offsets_m = points_m - evidence.target.centre_m
        reach_m = 1.5 * evidence.face.radius_m
        rows = np.nonzero(np.einsum("ij,ij->i", offsets_m, offsets_m) < reach_m**2)[0]
        uvw = offsets_m[rows] @ evidence.plane.basis.T
        on = evidence.face.on_face(uvw)
        from_plane_m = (points_m[rows[on]] - evidence.plane.centroid_m) @ evidence.plane.normal
        flags[rows[on]] = 1
        residual_um[rows[on]] = np.rint(np.clip(1e6 * from_plane_m, -32767, 32767))
    return flags, residual_um


def residual_range_um(measurement: Measurement) -> float:
    """Return half the range of the residuals' colours: three times the largest noise."""
    found = [w.observation.evidence for w in measurement.wheels if w.observation.evidence]
    noise_m = [e.face.span_m / SIGMAS for e in found if e.face is not None]
    return 3e6 * max(noise_m, default=0.0)


def _bounds(measurement: Measurement) -> tuple[Array, Array]:
    centres = [w.observation.fitted.centre_m for w in measurement.wheels[:4]]
    positions = to_view(measurement.frame, np.stack(centres))
    below = np.array([BEYOND_M, BEYOND_M, BELOW_M])
    above = np.array([BEYOND_M, BEYOND_M, ABOVE_M])
    return positions.min(axis=0) - below, positions.max(axis=0) + above


def base64_bytes(numbers: npt.NDArray[Any], most: float) -> str:
    """Return numbers from -most to most in 127 steps as signed bytes; OFF_TARGET is -128."""
    steps = np.rint(np.clip(numbers / max(most, 1e-9), -1.0, 1.0) * 127.0)
    return _base64(np.where(numbers == OFF_TARGET, -128, steps).astype("i1"))


def _base64(numbers: npt.NDArray[Any]) -> str:
    return base64.b64encode(numbers.tobytes()).decode("ascii")
