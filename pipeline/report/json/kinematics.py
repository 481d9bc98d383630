"""Steering sweeps and run-outs as plain data: degrees and metres, null where unknown."""

from __future__ import annotations

import math
from typing import Any

from ...measurement import Estimate, Measurement, Runout, SteeringAxis


def turned_tree(measurement: Measurement) -> dict[str, Any]:
    """Return `steering`: steering axes and toe-out on turns; `runouts`: one a wheel."""
    return {
        "steering": {
            "kingpins": [_steering_axis(found) for found in measurement.steering_axes],
            "toe_out_on_turns": [
                {
                    "turn": found.turn,
                    "inner_wheel_deg": math.degrees(found.inner_rad),
                    "of": found.of,
                    "status": found.status,
                    "reason": found.reason,
                    **_angle("difference", found.difference),
                    "u_interpolation_deg": math.degrees(found.u_interpolation_rad)
                    if found.difference
                    else None,
                }
                for found in measurement.toe_out
            ],
        },
        "runouts": [_runout(found) for found in measurement.runouts],
    }


def _steering_axis(found: SteeringAxis) -> dict[str, Any]:
    return {
        "wheel": found.wheel,
        "scans": list(found.scans),
        "status": found.status,
        "reason": found.reason,
        "frame": found.frame,
        "sweep_deg": math.degrees(found.sweep_rad),
        **_angle("caster", found.caster),
        **_angle("inclination", found.inclination),
        **_angle("included_angle", found.included_angle),
        **_angle("caster_by_camber", found.caster_by_camber),
        **_length("inwards", found.lateral_offset),
        **_length("ahead", found.longitudinal_offset),
        "scans_with_turn": found.with_rotation,
        "turn_by": found.mark,
        "axis": None if found.axis is None else found.axis.tolist(),
        "point_m": None if found.point_m is None else found.point_m.tolist(),
        **_fit(found),
    }


def _runout(found: Runout) -> dict[str, Any]:
    angles = found.angles
    return {
        "wheel": found.wheel,
        "scans": list(found.scans),
        "status": found.status,
        "reason": found.reason,
        "frame": found.frame,
        **_angle("toe", angles.toe if angles else None),
        **_angle("camber", angles.camber if angles else None),
        **_angle("camber_iso", angles.camber_iso if angles else None),
        **_angle("wobble", found.axial_runout),
        **_angle("wobble_clock", found.axial_clock),
        **_length("eccentricity", found.radial_runout),
        **_angle("eccentricity_clock", found.radial_clock),
        "turns_deg": [math.degrees(turn) for turn in found.turns_rad],
        "axis": None if found.axis is None else found.axis.tolist(),
        "axle_centre_m": None if found.centre_m is None else found.centre_m.tolist(),
        **_fit(found),
    }


def _fit(found: SteeringAxis | Runout) -> dict[str, Any]:
    if not found.dof:
        return {"chi_square": None, "freedom": None, "probability": None}
    return {
        "chi_square": found.chi_square,
        "freedom": found.dof,
        "probability": found.probability,
    }


def _angle(name: str, known: Estimate | None) -> dict[str, float | None]:
    numbers = (known.value, known.u, known.expanded) if known else None
    return _three(name, "deg", None if numbers is None else [math.degrees(x) for x in numbers])


def _length(name: str, known: Estimate | None) -> dict[str, float | None]:
    return _three(name, "m", [known.value, known.u, known.expanded] if known else None)


def _three(name: str, unit: str, numbers: list[float] | None) -> dict[str, float | None]:
    keys = (f"{name}_{unit}", f"u_{name}_{unit}", f"expanded_{name}_{unit}")
    return dict(zip(keys, numbers or (None, None, None), strict=True))
