"""Points of a capture for the 3D view, on a 16-bit grid; each prefix is an even sample.

File format: a line of JSON {"origin", "step_m", "groups": [name, ...]}, then blocks, each of two
little-endian uint32 (group, number n of points), n rows of int16 x y z, and n bytes, 1 for a point
on a target. Blocks of all groups alternate.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from ...capture import Capture, ScanEntry
from ...cloud import sample
from ...measurement import Evidence, Measurement
from ...readers import read_scan
from ...report.scene.points import to_view
from ...vectors import Array, Mask

MOST_POINTS = 5_000_000
BLOCK = 60_000
STEPS = 32767
MARGIN_M = 1.5  # around the target centres; points farther away are not shown


def write_points(capture: Capture, measurement: Measurement, path: Path) -> None:
    """Read the scans of `capture` again and write their points to `path`, x forward, y left."""
    entries = [capture.cloud] if capture.cloud else list(capture.entries)
    low, high = _box(measurement)
    origin = (low + high) / 2.0
    step_m = float((high - low).max()) / (2 * STEPS)
    parts = [
        _grid(_read(capture, entry, len(entries)), entry, measurement, (low, high), step_m)
        for entry in entries
    ]
    head = {
        "origin": origin.tolist(),
        "step_m": step_m,
        "groups": [entry.name for entry in entries],
        "count": sum(len(xyz) for xyz, _ in parts),
    }
    part = path.with_suffix(".part")
    with part.open("wb") as stream:
        stream.write(json.dumps(head).encode() + b"\n")
        for block in _blocks(parts):
            stream.write(block)
    part.replace(path)


def _read(capture: Capture, entry: ScanEntry, scans: int) -> Array:
    name = capture.called(entry)
    scan = read_scan(entry.path, capture.length_unit, name, capture.reading)
    return sample(scan.points_m, MOST_POINTS // scans)


def _grid(
    points_m: Array,
    entry: ScanEntry,
    measurement: Measurement,
    box: tuple[Array, Array],
    step_m: float,
) -> tuple[npt.NDArray[np.int16], npt.NDArray[np.uint8]]:
    """Return grid steps (N, 3) of the points in the box from its centre, and target flags (N,)."""
    low, high = box
    local = to_view(measurement.frame, points_m)
    near = np.all((local > low) & (local < high), axis=1)
    shown = points_m[near]
    on_target = np.zeros(len(shown), bool)
    for result in measurement.wheels:
        observed = result.observation
        if observed.evidence is not None and entry.name in (observed.name, "vehicle"):
            on_target |= _on_target(observed.evidence, shown)
    steps = np.rint((local[near] - (low + high) / 2.0) / step_m)
    return steps.astype("<i2"), on_target.astype(np.uint8)


def _on_target(evidence: Evidence, points_m: Array) -> Mask:
    if evidence.face is None or evidence.plane is None:
        return np.zeros(len(points_m), bool)
    uvw = (points_m - evidence.target.centre_m) @ evidence.plane.basis.T
    return np.asarray(evidence.face.on_face(uvw))


def _box(measurement: Measurement) -> tuple[Array, Array]:
    """Return the lowest and highest corner of the displayed box, vehicle frame."""
    centres_m = np.stack([wheel.observation.fitted.centre_m for wheel in measurement.wheels[:4]])
    centres = to_view(measurement.frame, centres_m)
    return centres.min(axis=0) - MARGIN_M, centres.max(axis=0) + MARGIN_M


def _blocks(
    parts: Sequence[tuple[npt.NDArray[np.int16], npt.NDArray[np.uint8]]],
) -> Iterator[bytes]:
    """Yield an equal fraction of every group in each round."""
    rounds = max(1, -(-max(len(xyz) for xyz, _ in parts) // BLOCK))
    for index in range(rounds):
        for group, (xyz, shade) in enumerate(parts):
            rows = slice(index * len(xyz) // rounds, (index + 1) * len(xyz) // rounds)
            head = np.array([group, rows.stop - rows.start], "<u4")
            yield head.tobytes() + xyz[rows].tobytes() + shade[rows].tobytes()
