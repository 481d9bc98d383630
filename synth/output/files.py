"""Names and bytes of the files of a capture."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence

import numpy as np

from ..arrays import Array, Array32
from ..parameters.plate_file import TargetFile
from ..vehicle.vehicle import Wheel


def scan_file(wheel: Wheel) -> str:
    """Return the file name of the scan of a wheel, a trial, a sweep or a run-out."""
    if wheel.role in ("sweep", "runout"):
        return f"{wheel.name.lower().replace(' ', '-')}.ply"
    return f"{wheel.name.lower()}.ply" if wheel.role == "reference" else f"trial-{wheel.name}.ply"


def ply(points_m: Array, intensity: Array32) -> bytes:
    """Return points (N, 3) and intensity (N,) as binary little-endian PLY, double and float."""
    return ply_header(len(points_m)) + ply_rows(points_m, intensity)


def ply_header(count: int, comment: str = "") -> bytes:
    """Return the header of such a file; comment: a line of it."""
    line = f"comment {comment}\n" if comment else ""
    return (
        f"ply\nformat binary_little_endian 1.0\n{line}"
        f"element vertex {count}\n"
        "property double x\nproperty double y\nproperty double z\nproperty float intensity\n"
        "end_header\n"
    ).encode("ascii")


def ply_rows(points_m: Array, intensity: Array32) -> bytes:
    """Return the bytes after the header."""
    rows = np.empty(
        len(points_m), dtype=[("x", "<f8"), ("y", "<f8"), ("z", "<f8"), ("intensity", "<f4")]
    )
    rows["x"], rows["y"], rows["z"] = points_m.T
    rows["intensity"] = intensity
    return rows.tobytes()


def five_point_text(rows_m: Array) -> str:
    """Return points (N, 3), one per line, in metres."""
    return "".join(f"{x:.6f},{y:.6f},{z:.6f}\n" for x, y, z in rows_m)


def capture_toml(
    vehicle: str,
    target: TargetFile,
    wheels: Sequence[Wheel],
    more: Sequence[str] = (),
    clamped: Mapping[str, TargetFile] | None = None,
) -> str:
    """Return the text of capture.toml; lengths in metres. A JSON string is a TOML basic string.

    more: lines that follow. clamped: targets of single wheels.
    """
    lines = [
        f"vehicle = {json.dumps(vehicle, ensure_ascii=False)}",
        'length_unit = "m"',
        "",
        "[target]",
        *_target_lines(target),
    ]
    for name, own in (clamped or {}).items():
        lines += ["", f"[targets.{name}]", *_target_lines(own)]
    lines += ["", "[reference]"]
    lines += [f'{w.name} = "{scan_file(w)}"' for w in wheels if w.role == "reference"]
    for wheel in wheels:
        if wheel.role == "trial":
            lines += ["", "[[trial]]", f'name = "{wheel.name}"', f'file = "{scan_file(wheel)}"']
            lines += [f'wheel = "{wheel.wheel}"']
    return "\n".join([*lines, *more]) + "\n"


def _target_lines(target: TargetFile) -> list[str]:
    """Return the lines of [target]; without the thickness of a disc, which is not needed."""
    left_out = {"thickness"} if target.shape == "disc" else set()
    stated = {k: v for k, v in target.stated.items() if k not in left_out and v not in (None, 0.0)}
    return [f"{key} = {_toml_value(value)}" for key, value in stated.items()]


def _toml_value(value: object) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{k} = {json.dumps(v)}" for k, v in value.items()) + " }"
    return json.dumps(value)
