"""The result as JSON: the contract `wheelplane/measurement/1`."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np

from pipeline.locate_centre import TargetFit
from pipeline.measurement import Measurement, WheelResult

SCHEMA = "wheelplane/measurement/1"


def to_json(measurement: Measurement) -> str:
    """Text of measurement.json; the same measurement gives the same bytes."""
    text = json.dumps(to_tree(measurement), indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    return text.encode(errors="backslashreplace").decode()  # a path may hold bytes that are no text


def to_tree(measurement: Measurement) -> dict[str, Any]:
    """The measurement as plain data: degrees, metres, null where unmeasured."""
    frame, vehicle, u = measurement.frame, measurement.vehicle, measurement.uncertainty
    made = measurement.provenance
    return {
        "schema": SCHEMA,
        "capture": made.source,
        "vehicle_name": made.vehicle,
        "wheels": [_wheel(wheel) for wheel in measurement.wheels],
        "frame": {
            "origin_m": frame.origin_m.tolist(),
            "left": frame.left.tolist(),
            "forward": frame.forward.tolist(),
            "up": frame.up.tolist(),
            "rear_track_m": frame.rear_track_m,
            "front_track_m": frame.front_track_m,
            "wheelbase_m": frame.wheelbase_m,
            "u_rear_track_m": u.rear_track_m,
            "u_front_track_m": u.front_track_m,
            "u_wheelbase_m": u.wheelbase_m,
            "longitudinal_axis": "normal to the rear axle",
        },
        "vehicle": {
            "rear_total_toe_deg": _degrees(vehicle.rear_total_toe_rad),
            "front_total_toe_deg": _degrees(vehicle.front_total_toe_rad),
            "thrust_angle_deg": _degrees(vehicle.thrust_angle_rad),
            "u_rear_total_toe_deg": _degrees(u.rear_total_toe_rad),
            "u_front_total_toe_deg": _degrees(u.front_total_toe_rad),
            "u_thrust_angle_deg": _degrees(u.thrust_angle_rad),
        },
        "notes": list(measurement.notes),
        "provenance": {
            "version": made.version,
            "inputs": made.inputs,
            "config": made.config,
            "seed": made.seed,
        },
    }


def _wheel(result: WheelResult) -> dict[str, Any]:
    seen = result.observation
    angles = result.angles
    fitted = seen.evidence.target if seen.evidence else None
    plane = seen.evidence.plane if seen.evidence else None
    return {
        "name": seen.name,
        "role": seen.role,
        "wheel": result.wheel,
        "status": seen.status,
        "reason": seen.reason,
        "toe_deg": _degrees(angles.toe_rad if angles else None),
        "camber_deg": _degrees(angles.camber_rad if angles else None),
        "camber_iso_deg": _degrees(angles.camber_iso_rad if angles else None),
        "u_toe_deg": _degrees(result.u_toe_rad),
        "u_camber_deg": _degrees(result.u_camber_rad),
        "u_camber_iso_deg": _degrees(result.u_camber_iso_rad),
        "centre_m": fitted.centre_m.tolist() if fitted else None,
        "normal": result.normal.tolist() if result.normal is not None else None,
        "offset_m": _offset(result, fitted),
        "u_centre_m": _largest_deviation(fitted) if fitted else None,
        "plane_rms_m": fitted.plane_rms_m if fitted else None,
        "points_total": seen.points_total,
        "points_on_target": fitted.points_on_target if fitted else None,
        "points_effective": plane.count / plane.inflation if plane else None,
        "noise_m": plane.sigma_m if plane else None,
        "missing_returns": seen.missing_returns,
        "file": seen.source,
        "centre_method": fitted.method if fitted else None,
    }


def _degrees(angle_rad: float | None) -> float | None:
    return None if angle_rad is None or not math.isfinite(angle_rad) else math.degrees(angle_rad)


def _offset(result: WheelResult, fitted: TargetFit | None) -> float | None:
    """Offset of the plane, normal . x + offset = 0, metres."""
    if fitted is None or result.normal is None:
        return None
    return -float(result.normal @ fitted.centre_m)


def _largest_deviation(fitted: TargetFit) -> float:
    """Standard uncertainty of the centre along its least certain direction, metres."""
    return float(np.sqrt(np.linalg.eigvalsh(fitted.centre_covariance_m2)[-1].clip(min=0.0)))
