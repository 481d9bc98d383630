"""The files of a capture: their names and their bytes."""

from __future__ import annotations

import json
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from synth.parameters import TargetFile
from synth.vehicle import Wheel

STATED = ("flatness", "clamp_tilt_deg", "clamp_shift")  # of a target that is not perfect


def scan_file(wheel: Wheel) -> str:
    """Name of a wheel's, a trial's, or a turned wheel's scan."""
    if wheel.role in ("sweep", "runout"):
        return f"{wheel.name.lower().replace(' ', '-')}.ply"
    return f"{wheel.name.lower()}.ply" if wheel.role == "reference" else f"trial-{wheel.name}.ply"


def ply(points_m: npt.NDArray[np.float64], intensity: npt.NDArray[np.float32]) -> bytes:
    """Points (N, 3) and intensity (N,) as binary little-endian PLY, double and float."""
    rows = np.empty(
        len(points_m), dtype=[("x", "<f8"), ("y", "<f8"), ("z", "<f8"), ("intensity", "<f4")]
    )
    rows["x"], rows["y"], rows["z"] = points_m.T
    rows["intensity"] = intensity
    header = (
        "ply\nformat binary_little_endian 1.0\n"
        f"element vertex {len(rows)}\n"
        "property double x\nproperty double y\nproperty double z\nproperty float intensity\n"
        "end_header\n"
    )
    return header.encode("ascii") + rows.tobytes()


def capture_toml(
    vehicle: str, target: TargetFile, wheels: Sequence[Wheel], more: Sequence[str] = ()
) -> str:
    """The text of capture.toml; lengths in metres. A JSON string is a TOML basic string.

    more: lines that follow.
    """
    lines = [
        f"vehicle = {json.dumps(vehicle, ensure_ascii=False)}",
        'length_unit = "m"',
        "",
        "[target]",
        f'shape = "{target.shape}"',
        f"diameter = {target.diameter!r}",
        *(f"{key} = {getattr(target, key)!r}" for key in STATED if getattr(target, key) > 0.0),
        "",
        "[reference]",
    ]
    lines += [f'{w.name} = "{scan_file(w)}"' for w in wheels if w.role == "reference"]
    for wheel in wheels:
        if wheel.role == "trial":
            lines += ["", "[[trial]]", f'name = "{wheel.name}"', f'file = "{scan_file(wheel)}"']
            lines += [f'wheel = "{wheel.wheel}"']
    return "\n".join([*lines, *more]) + "\n"
