"""Points of a capture for the 3D view, on a 16-bit grid; each prefix is an even sample.

File format: a line of JSON, then blocks, each of two little-endian uint32 (scan, number n of
points), n rows of int16 x y z, n int16 distances from the target's plane in micrometres (-32768
off the targets), n bytes of intensity, and n bytes, 1 for a point on a target. Blocks of all scans
alternate. The JSON: {"origin", "step_m", "groups": [name of each scan, ...], "count": points of
the file, "near": of the scans around the vehicle, "total": of the scans, "residual_um": half the
range of the distances, "intensity": [value of byte 0, of byte 255] or null}.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from ...capture import Capture, ScanEntry
from ...cloud import sample_rows
from ...measurement import Measurement, WheelResult
from ...readers import Scan
from ...report.scene.points import on_target, residual_range_um, to_view
from ...vectors import Array, Array32, Mask

MOST_POINTS = 5_000_000
OF_TARGETS = 0.5  # of a scan's points, at most, are those near targets
REACH, REACH_M = 1.4, 0.4  # around a target, relative to its radius; around a wheel without one
BLOCK = 60_000
ROWS = 2_000_000  # of a scan are looked at at once
STEPS = 32767
MARGIN_M = 1.5  # around the target centres; points farther away are not shown
INTENSITY_SHARES = (0.01, 0.99)  # of the points, at the ends of the range of the intensity


@dataclass(frozen=True)
class Shown:
    """Points of one scan that are shown: xyz (N, 3) grid steps, residual_um, intensity, flags (N,).

    near, total: number of its points around the vehicle, and of all.
    """

    name: str
    xyz: npt.NDArray[np.int16]
    residual_um: npt.NDArray[np.int16]
    intensity: Array32 | None
    flags: npt.NDArray[np.uint8]
    near: int
    total: int


def write_points(capture: Capture, measurement: Measurement, path: Path) -> None:
    """Read the scans of `capture` again and write their points to `path`, x forward, y left."""
    entries = [capture.cloud] if capture.cloud else list(capture.entries)
    box = _box(measurement)
    step_m = float((box[1] - box[0]).max()) / (2 * STEPS)
    parts = [
        part
        for entry in entries
        for part in _shown(capture, entry, measurement, box, step_m, MOST_POINTS // len(entries))
    ]
    scale = _intensity_range(parts)
    head = {
        "origin": box.mean(axis=0).tolist(),
        "step_m": step_m,
        "groups": [part.name for part in parts],
        "count": sum(len(part.xyz) for part in parts),
        "near": sum(part.near for part in parts),
        "total": sum(part.total for part in parts),
        "residual_um": residual_range_um(measurement),
        "intensity": scale,
    }
    unfinished = path.with_suffix(".part")
    with unfinished.open("wb") as stream:
        stream.write(json.dumps(head).encode() + b"\n")
        for block in _blocks(parts, scale):
            stream.write(block)
    unfinished.replace(path)


def _shown(
    capture: Capture,
    entry: ScanEntry,
    measurement: Measurement,
    box: Array,
    step_m: float,
    most: int,
) -> Iterator[Shown]:
    """Yield the shown points of each scan of the entry's file, about `most` in all."""
    scan = entry.read(capture.length_unit, capture.called(entry), capture.reading)
    seen = [
        wheel
        for wheel in measurement.wheels
        if wheel.observation.evidence is not None
        and entry.name in (wheel.observation.name, "vehicle")
    ]
    near, close = _near(scan.points_m, measurement, seen, box)
    rows = near[_chosen(scan.points_m[near], close, most)]
    names = _part_names(scan, entry)
    starts = [part.start for part in scan.parts[1:]] if len(names) > 1 else []
    part_of, near_of = (np.searchsorted(starts, each, side="right") for each in (rows, near))
    for index, name in enumerate(names):
        own = rows[part_of == index]
        points_m = scan.points_m[own]
        flags, residual_um = on_target(seen, points_m)
        local = to_view(measurement.frame, points_m)
        part = scan.parts[index] if starts else None
        yield Shown(
            name=name,
            xyz=np.rint((local - box.mean(axis=0)) / step_m).astype("<i2"),
            residual_um=residual_um,
            intensity=None if scan.intensity is None else scan.intensity[own],
            flags=flags,
            near=int(np.count_nonzero(near_of == index)),
            total=part.stop - part.start if part else len(scan.points_m),
        )


def _near(
    points_m: Array, measurement: Measurement, seen: Sequence[WheelResult], box: Array
) -> tuple[npt.NDArray[np.int64], Mask]:
    """Return the rows of the points in the box, and which of them are close to a target."""
    rows, close = [], []
    for start in range(0, len(points_m), ROWS):
        part = points_m[start : start + ROWS]
        local = to_view(measurement.frame, part)
        inside = np.nonzero(np.all((local > box[0]) & (local < box[1]), axis=1))[0]
        by_target = np.zeros(len(inside), bool)
        for wheel in seen:
            evidence = wheel.observation.evidence
            face = None if evidence is None else evidence.face
            reach_m = REACH_M if face is None else REACH * face.radius_m
            apart = part[inside] - wheel.observation.fitted.centre_m
            by_target |= np.einsum("ij,ij->i", apart, apart) < reach_m**2
        rows.append(inside + start)
        close.append(by_target)
    return np.concatenate([*rows, np.zeros(0, np.int64)]), np.concatenate(
        [*close, np.zeros(0, bool)]
    )


def _chosen(points_m: Array, close: Mask, most: int) -> npt.NDArray[np.int64]:
    """Return about `most` rows of points_m (N, 3), mixed: of those close to targets up to half."""
    rows = np.nonzero(close)[0], np.nonzero(~close)[0]
    of_targets = min(len(rows[0]), max(int(OF_TARGETS * most), most - len(rows[1])))
    counts = of_targets, most - of_targets
    kept = [own[sample_rows(points_m[own], count)] for own, count in zip(rows, counts, strict=True)]
    rank = [(np.arange(len(each)) + 0.5) / max(1, len(each)) for each in kept]
    return np.concatenate(kept)[np.argsort(np.concatenate(rank), kind="stable")]


def _part_names(scan: Scan, entry: ScanEntry) -> list[str]:
    """Return the name of the entry, or of each scan of its file, none twice."""
    if len(scan.parts) < 2:
        return [entry.name]
    names = [part.name or str(number) for number, part in enumerate(scan.parts, start=1)]
    return [
        name if names.count(name) == 1 else f"{name} ({number})"
        for number, name in enumerate(names, start=1)
    ]


def _box(measurement: Measurement) -> Array:
    """Return the lowest and highest corner (2, 3) of the displayed box, vehicle frame."""
    centres_m = np.stack([wheel.observation.fitted.centre_m for wheel in measurement.wheels[:4]])
    centres = to_view(measurement.frame, centres_m)
    return np.stack([centres.min(axis=0) - MARGIN_M, centres.max(axis=0) + MARGIN_M])


def _intensity_range(parts: Sequence[Shown]) -> list[float] | None:
    """Return the values at the ends of the colour scale; None unless every scan has them."""
    if any(part.intensity is None for part in parts):
        return None
    every = np.concatenate([part.intensity for part in parts if part.intensity is not None])
    every = every[np.isfinite(every)]
    if not len(every):
        return None
    low, high = (float(value) for value in np.quantile(every, INTENSITY_SHARES))
    return [low, high] if high > low else None


def _blocks(parts: Sequence[Shown], scale: list[float] | None) -> Iterator[bytes]:
    """Yield an equal fraction of every scan in each round."""
    rounds = max(1, -(-max(len(part.xyz) for part in parts) // BLOCK))
    bright = [_bytes(part, scale) for part in parts]
    for index in range(rounds):
        for group, part in enumerate(parts):
            count = len(part.xyz)
            rows = slice(index * count // rounds, (index + 1) * count // rounds)
            head = np.array([group, rows.stop - rows.start], "<u4")
            columns = (part.xyz, part.residual_um, bright[group], part.flags)
            yield b"".join([head.tobytes(), *(column[rows].tobytes() for column in columns)])


def _bytes(part: Shown, scale: list[float] | None) -> npt.NDArray[np.uint8]:
    if scale is None or part.intensity is None:
        return np.zeros(len(part.xyz), np.uint8)
    share = (np.nan_to_num(part.intensity, nan=scale[0]) - scale[0]) / (scale[1] - scale[0])
    return np.asarray(np.rint(255.0 * np.clip(share, 0.0, 1.0)), np.uint8)
