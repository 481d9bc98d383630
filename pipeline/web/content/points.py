"""The points of a capture for the 3D view: on a grid of 16 bits, each prefix a fair sample.

The file: a line of JSON {"origin", "step_m", "groups": [name, ...]}, then blocks, each of two
little-endian uint32, the group and the number n of its points, n rows of int16 x y z, and n bytes,
1 where the point lies on a target. Blocks of all groups take turns.
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
BEYOND_M = 1.5  # about the wheels' centres: what is farther off is not shown


def write_points(capture: Capture, measurement: Measurement, path: Path) -> None:
    """Read the scans of `capture` once more and write their points to `path`, x forward, y left."""
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
    points_m = read_scan(entry.path, capture.length_unit, capture.called(entry)).points_m
    return sample(points_m, MOST_POINTS // scans)


def _grid(
    points_m: Array,
    entry: ScanEntry,
    measurement: Measurement,
    box: tuple[Array, Array],
    step_m: float,
) -> tuple[npt.NDArray[np.int16], npt.NDArray[np.uint8]]:
    """Points in the box as steps (N, 3) from its middle, and whether each is on a target (N,)."""
    low, high = box
    local = to_view(measurement.frame, points_m)
    near = np.all((local > low) & (local < high), axis=1)
    shown = points_m[near]
    on_target = np.zeros(len(shown), bool)
    for result in measurement.wheels:
        seen = result.observation
        if seen.evidence is not None and entry.name in (seen.name, "vehicle"):
            on_target |= _on_face(seen.evidence, shown)
    steps = np.rint((local[near] - (low + high) / 2.0) / step_m)
    return steps.astype("<i2"), on_target.astype(np.uint8)


def _on_face(evidence: Evidence, points_m: Array) -> Mask:
    if evidence.face is None or evidence.plane is None:
        return np.zeros(len(points_m), bool)
    uvw = (points_m - evidence.target.centre_m) @ evidence.plane.basis.T
    return np.asarray(evidence.face.on_face(uvw))


def _box(measurement: Measurement) -> tuple[Array, Array]:
    """What is shown, vehicle frame: from the lowest to the highest corner."""
    centres_m = np.stack([wheel.observation.fitted.centre_m for wheel in measurement.wheels[:4]])
    places = to_view(measurement.frame, centres_m)
    return places.min(axis=0) - BEYOND_M, places.max(axis=0) + BEYOND_M


def _blocks(
    parts: Sequence[tuple[npt.NDArray[np.int16], npt.NDArray[np.uint8]]],
) -> Iterator[bytes]:
    """A like share of every group in turn."""
    turns = max(1, -(-max(len(xyz) for xyz, _ in parts) // BLOCK))
    for turn in range(turns):
        for group, (xyz, shade) in enumerate(parts):
            rows = slice(turn * len(xyz) // turns, (turn + 1) * len(xyz) // turns)
            head = np.array([group, rows.stop - rows.start], "<u4")
            yield head.tobytes() + xyz[rows].tobytes() + shade[rows].tobytes()
