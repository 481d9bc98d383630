"""The result as JSON: the contract `wheelplane/measurement/1`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ...centre import OtherCentre
from ...errors import Doubt
from ...measurement import Conformity, Measurement, Naming, WheelResult, against, stated
from ...plane import PlaneFit
from ...uncertainty import UncertainTarget
from ...vehicle import Axis
from ..format.earlier import Earlier
from ..format.language import load_translations
from ..tables.vehicle import SIGNED, in_words
from .axes import axes_tree, pair
from .before import before_tree
from .conformity import conformity_tree, tolerance_tree
from .kinematics import turned_tree
from .poses import poses_tree
from .text import json_text
from .uncertainty import monte_carlo_tree, repeats_tree, uncertainty_tree
from .verticals import verticals_tree

OF_FRAME = ("rear_track", "front_track", "wheelbase")
SCHEMA = "wheelplane/measurement/1"


def doubts_tree(doubts: Sequence[Doubt]) -> list[dict[str, Any]]:
    """Return notes of doubt, each with the trial that it is about."""
    return [{"trial": doubt.parts.get("trial"), "note": doubt} for doubt in doubts]


def to_json(
    measurement: Measurement,
    conformity: Conformity | None = None,
    axis: Axis = "rear-axle",
    before: Earlier | None = None,
) -> str:
    """Return the text of measurement.json; same measurement, same bytes."""
    return f"{json_text(to_tree(measurement, conformity, axis, before))}\n"


def to_tree(
    measurement: Measurement,
    conformity: Conformity | None = None,
    axis: Axis = "rear-axle",
    before: Earlier | None = None,
) -> dict[str, Any]:
    """Return the measurement as plain data: degrees, metres, null where unmeasured.

    axis: the longitudinal axis of the text report; `wheels` and `vehicle` use the rear-axle normal.
    """
    frame, vehicle, found = measurement.frame, measurement.vehicle, stated(measurement)
    u = measurement.uncertainty.vehicle_standard
    provenance, english = measurement.provenance, load_translations("en")
    return {
        "schema": SCHEMA,
        "capture": provenance.source,
        "vehicle_name": provenance.vehicle,
        "date": provenance.date,
        "wheels": [_wheel(wheel) for wheel in measurement.wheels],
        "frame": {
            "origin_m": frame.origin_m.tolist(),
            "left": frame.left.tolist(),
            "forward": frame.forward.tolist(),
            "up": frame.up.tolist(),
            "rear_track_m": frame.rear_track_m,
            "front_track_m": frame.front_track_m,
            "wheelbase_m": frame.wheelbase_m,
            "u_rear_track_m": u["rear_track"],
            "u_front_track_m": u["front_track"],
            "u_wheelbase_m": u["wheelbase"],
            "longitudinal_axis": "normal to the rear axle",
        },
        "vehicle": {
            key: number
            for quantity in against(found, "rear-axle")
            if quantity.subject == "vehicle" and quantity.kind not in OF_FRAME
            for key, number in pair(quantity.kind, quantity, quantity.unit).items()
        }
        | {kind: in_words(kind, vehicle[kind], english) for kind in SIGNED if kind in vehicle},
        "axis_in_use": axis,
        "axes": axes_tree(measurement, found),
        **verticals_tree(measurement),
        **conformity_tree(conformity),
        **uncertainty_tree(measurement, found),
        "poses": poses_tree(measurement),
        "repeats": repeats_tree(measurement),
        **turned_tree(measurement),
        "monte_carlo": monte_carlo_tree(measurement),
        "before": before_tree(measurement, before),
        "notes": list(measurement.notes),
        "doubts": doubts_tree(measurement.doubts),
        "provenance": {
            "version": provenance.version,
            "inputs": provenance.inputs,
            "config": provenance.config | tolerance_tree(conformity),
            "seed": provenance.seed,
            "naming": _naming(provenance.naming),
        },
    }


def _naming(naming: Naming | None) -> dict[str, Any] | None:
    """Return how the wheels of one cloud were named; null where each has its own scan."""
    return None if naming is None else {"front": naming.front, "up": naming.up}


def _wheel(result: WheelResult) -> dict[str, Any]:
    observation = result.observation
    angles = result.angles
    fitted = observation.evidence.target if observation.evidence else None
    plane = observation.evidence.plane if observation.evidence else None
    pose, plate = result.pose, result.plate or result
    mounted = plate.angles
    return {
        "name": observation.name,
        "role": observation.role,
        "wheel": result.wheel,
        "status": observation.status,
        "reason": observation.reason,
        "suspect": _suspect(result),
        "toe_deg": _degrees(angles.toe_rad if angles else None),
        "camber_deg": _degrees(angles.camber_rad if angles else None),
        "camber_iso_deg": _degrees(angles.camber_iso_rad if angles else None),
        "u_toe_deg": _degrees(result.u_toe_rad),
        "u_camber_deg": _degrees(result.u_camber_rad),
        "u_camber_iso_deg": _degrees(result.u_camber_iso_rad),
        "compensated": result.compensated,
        "plate_toe_deg": _degrees(mounted.toe_rad if mounted else None),
        "plate_camber_deg": _degrees(mounted.camber_rad if mounted else None),
        "plate_camber_iso_deg": _degrees(mounted.camber_iso_rad if mounted else None),
        "u_plate_toe_deg": _degrees(plate.u_toe_rad),
        "u_plate_camber_deg": _degrees(plate.u_camber_rad),
        "u_plate_camber_iso_deg": _degrees(plate.u_camber_iso_rad),
        "centre_m": pose.centre_m.tolist() if pose else None,
        "normal": result.normal.tolist() if result.normal is not None else None,
        "offset_m": _offset(result, pose),
        "u_centre_m": _largest_deviation(pose) if pose else None,
        "plate_centre_m": fitted.centre_m.tolist() if fitted else None,
        "plate_normal": plate.normal.tolist() if plate.normal is not None else None,
        "plane_rms_m": fitted.plane_rms_m if fitted else None,
        "points_total": observation.points_total,
        "points_on_target": fitted.points_on_target if fitted else None,
        "points_effective": plane.effective_count if plane else None,
        "noise_m": plane.sigma_m if plane else None,
        "correlated_noise_m": plane.correlated.sigma_m if plane else None,
        "correlation_length_m": plane.correlated.length_m if plane else None,
        "u_plane_deg": _degrees(plane.tilt_rad if plane else None),
        "u_plane_if_independent_deg": _degrees(plane.tilt_if_independent_rad if plane else None),
        **_rounding(plane),
        **_brightness(plane),
        "missing_returns": observation.invalid_points,
        "file": observation.source,
        "centre_method": fitted.method if fitted else None,
        "centres": [_other(other) for other in fitted.others] if fitted else [],
        "marker_ids": list(fitted.marker_ids) if fitted else [],
    }


def _suspect(result: WheelResult) -> dict[str, Any] | None:
    """Return the point that contradicts the others of its block, and the angles without it."""
    suspect, angles = result.observation.suspect, result.provisional
    if suspect is None or angles is None:
        return None
    return {
        "point": suspect.number,
        "line": suspect.line,
        "off_m": suspect.off_m.tolist(),
        "toe_without_deg": _degrees(angles.toe_rad),
        "camber_without_deg": _degrees(angles.camber_rad),
    }


def _rounding(plane: PlaneFit | None) -> dict[str, Any]:
    """Return the steps of a scan's coordinates and what they add to u; null where it is nothing."""
    rounding = plane.rounding if plane else None
    if plane is None or rounding is None:
        return {"steps_m": None, "u_rounding_deg": None}
    by_axis = np.trace(rounding.covariance[1:, 1:]).clip(min=0.0) / 2.0
    return {
        "steps_m": rounding.steps.step_m.tolist(),
        "u_rounding_deg": math.degrees(math.sqrt(by_axis)),
    }


def _brightness(plane: PlaneFit | None) -> dict[str, Any]:
    """Return by how much bright points lie nearer than dark ones; null where it was not fitted."""
    brightness = plane.brightness if plane else None
    if brightness is None:
        return {"brightness_step_m": None, "u_brightness_step_m": None, "u_brightness_deg": None}
    by_axis = np.trace(brightness.covariance[1:, 1:]) / 2.0
    return {
        "brightness_step_m": brightness.step_m,
        "u_brightness_step_m": brightness.u_m,
        "u_brightness_deg": math.degrees(math.sqrt(by_axis)),
    }


def _other(other: OtherCentre) -> dict[str, Any]:
    """Return one of several estimates of a wheel's centre."""
    return {
        "method": other.method,
        "centre_m": other.centre_m.tolist(),
        "u_centre_m": float(np.sqrt(np.linalg.eigvalsh(other.centre_covariance_m2)[-1])),
    }


def _degrees(angle_rad: float | None) -> float | None:
    return None if angle_rad is None or not math.isfinite(angle_rad) else math.degrees(angle_rad)


def _offset(result: WheelResult, pose: UncertainTarget | None) -> float | None:
    """Return the offset of the plane, normal . x + offset = 0, metres."""
    if pose is None or result.normal is None:
        return None
    return -float(result.normal @ pose.centre_m)


def _largest_deviation(pose: UncertainTarget) -> float:
    """Return the centre's standard uncertainty along its least certain direction, metres."""
    covariance = sum((part.covariance for part in pose.components), np.zeros((6, 6)))[3:, 3:]
    return float(np.sqrt(np.linalg.eigvalsh(covariance)[-1].clip(min=0.0)))
