"""The 3D scene: wheels, axles, axes and some of the points, in the vehicle's frame.

Right-handed, metres: x forward, y left, z up, from the middle of the rear axle.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ...measurement import (
    Conformity,
    Measurement,
    Stated,
    WheelResult,
    by_kind,
    smoothed,
    stated,
)
from ...vectors import Array
from ...vehicle import VehicleFrame
from ..format.language import Translations, load_translations
from ..format.view import PAPER, View
from ..format.writer import Writer
from .points import OFF_TARGET, base64_bytes, cloud_tree
from .points import to_view as to_view

SCHEMA = "wheelplane/scene/1"
SYMBOL_M = 0.1  # radius that stands for a plane of five points, whose target is not known
CORNERS = 64
ARROW, OVERHANG = 0.2, 0.12  # of the wheelbase: the axes' arrows; lines beyond the axles
STEERING_AXIS_M = 0.35  # up and down from the height of the wheel's centre


def scene(
    measurement: Measurement,
    conformity: Conformity | None = None,
    words: Translations | None = None,
    view: View = PAPER,
) -> dict[str, Any]:
    """Return the scene as plain data, without wheels that were not measured."""
    words = words or load_translations("en")
    failed = _nonconforming(conformity)
    texts = wheel_texts(measurement, Writer(words, view))
    measured = [wheel for wheel in measurement.wheels if wheel.angles is not None]
    return {
        "schema": SCHEMA,
        "wheels": [
            _wheel(wheel, measurement.frame, failed) | texts[wheel.observation.name]
            for wheel in measured
        ],
        "lines": [
            *_axes(measurement, words),
            *_frame(measurement, words),
            *_steering_axes(measurement, words),
        ],
        "cloud": cloud_tree(measurement),
    }


def wheel_texts(measurement: Measurement, writer: Writer) -> dict[str, dict[str, str]]:
    """Return what is written at each wheel that was measured, by its name."""
    known = by_kind(stated(measurement), writer.view.axis)
    names = [wheel.observation.name for wheel in measurement.wheels if wheel.angles is not None]
    return {name: _texts(name, known, writer) for name in names}


def outlines(result: WheelResult) -> list[Array]:
    """Return the target's edges (K, 3), scanner coordinates; for five points a circle as symbol."""
    evidence = result.observation.evidence
    assert evidence is not None
    assert result.normal is not None
    centre = evidence.target.centre_m
    if evidence.face is not None and evidence.plane is not None:
        return [centre + edge @ evidence.plane.basis[:2] for edge in evidence.face.edges_m]
    across = np.cross(result.normal, np.eye(3)[int(np.argmin(np.abs(result.normal)))])
    across /= np.linalg.norm(across)
    angle = np.arange(CORNERS)[:, None] * (2.0 * math.pi / CORNERS)
    circle = np.cos(angle) * across + np.sin(angle) * np.cross(result.normal, across)
    return [centre + SYMBOL_M * circle]


def _nonconforming(conformity: Conformity | None) -> set[str]:
    verdicts = conformity.verdicts if conformity else ()
    return {v.quantity.subject for v in verdicts if v.decision == "not conform"}


def _texts(name: str, known: Mapping[tuple[str, str], Stated], writer: Writer) -> dict[str, str]:
    toe, camber = (writer.value(known[name, kind]) for kind in ("toe", "camber"))
    return {
        "label": writer.wheel(name),
        "toe_text": writer.words("scene.toe", angle=toe),
        "camber_text": writer.words("scene.camber", angle=camber),
    }


def _wheel(result: WheelResult, frame: VehicleFrame, failed: set[str]) -> dict[str, Any]:
    seen = result.observation
    assert result.normal is not None
    role = "reference" if seen.role == "reference" else "trial"
    normal = (frame.R_vehicle_scanner @ result.normal)[[1, 0, 2]]
    return {
        "name": seen.name,
        "role": seen.role,
        "wheel": result.wheel,
        "status": seen.status,
        "centre": _rounded(to_view(frame, seen.fitted.centre_m)),
        "normal": _rounded(normal, 9),
        "outline": [_rounded(to_view(frame, edge)) for edge in outlines(result)],
        "colour_class": "bad" if seen.name in failed else role,
        "form": _form(result, frame),
    }


def _form(result: WheelResult, frame: VehicleFrame) -> dict[str, Any] | None:
    """Return the smoothed deviation of the target from its plane; None without points."""
    evidence = result.observation.evidence
    if evidence is None or evidence.face is None or evidence.plane is None:
        return None
    form, plane = smoothed(evidence.face), evidence.plane
    off_m = (evidence.target.centre_m - plane.centroid_m) @ plane.normal
    centre_m = evidence.target.centre_m - off_m * plane.normal
    axes = (frame.R_vehicle_scanner @ plane.basis.T).T[:, [1, 0, 2]]
    deviation_um = np.nan_to_num(1e6 * form.deviation_m, nan=OFF_TARGET)
    most_um = float(np.nanmax(np.abs(form.deviation_m), initial=1e-9)) * 1e6
    return {
        "centre": _rounded(to_view(frame, centre_m)),
        "u": _rounded(axes[0], 9),
        "v": _rounded(axes[1], 9),
        "half_width_m": round(form.half_width_m, 6),
        "cells": len(deviation_um),
        "deviation": base64_bytes(deviation_um, most_um),
        "most_um": round(most_um, 3),
        "width_mm": round(1e3 * form.width_m, 2),
        "u_mm": round(1e3 * form.u_m, 4),
    }


def _axes(measurement: Measurement, words: Translations) -> list[dict[str, Any]]:
    """Return arrows from the origin."""
    length = ARROW * measurement.frame.wheelbase_m
    names = ("forward", "left", "up")
    return [
        _line(words(f"scene.{name}"), "axes", np.zeros(3), length * way)
        for name, way in zip(names, np.eye(3), strict=True)
    ]


def _frame(measurement: Measurement, words: Translations) -> list[dict[str, Any]]:
    """Return the axles, the geometric centreline and the thrust line."""
    frame = measurement.frame
    RR, RL, FR, FL = (
        to_view(frame, wheel.observation.fitted.centre_m) for wheel in measurement.wheels[:4]
    )
    over = OVERHANG * frame.wheelbase_m
    turn = measurement.vehicle["thrust_angle"]
    thrust = np.array([math.cos(turn), -math.sin(turn), 0.0])
    ahead = (FR + FL) / 2.0
    along = ahead / np.linalg.norm(ahead)
    return [
        _line(words("scene.rear_axle"), "frame", RR, RL),
        _line(words("scene.front_axle"), "frame", FR, FL),
        _line(words("scene.centreline"), "frame", -over * along, ahead + over * along),
        _line(
            words("scene.thrust_line"), "frame", -over * thrust, (frame.wheelbase_m + over) * thrust
        ),
    ]


def _steering_axes(measurement: Measurement, words: Translations) -> list[dict[str, Any]]:
    frame = measurement.frame
    return [
        _line(
            words("scene.kingpin", wheel=words.wheel(found.wheel)),
            "kingpin",
            *(
                to_view(frame, found.point_m + way * STEERING_AXIS_M * found.axis)
                for way in (-1.0, 1.0)
            ),
        )
        for found in measurement.steering_axes
        if found.axis is not None and found.point_m is not None
    ]


def _line(name: str, layer: str, start: Array, end: Array) -> dict[str, Any]:
    return {"name": name, "layer": layer, "from": _rounded(start), "to": _rounded(end)}


def _rounded(numbers: Array, decimals: int = 6) -> Any:
    return (np.round(numbers, decimals) + 0.0).tolist()
