"""All points of a capture around the vehicle, as a tree for the 3D view (see tree.py).

points.json: {"origin", "edge_m": of the cube about it, "box": [low, high] of the points, "groups":
[name of each scan, ...], "count": points of the tree, "total": of the scans, "residual_um": half
the range of the distances from the targets' planes, "intensity": [value of byte 0, of byte 255] or
null, "nodes": [[depth, column, row, level, points], ...] in the order of points.bin}.
"""

from __future__ import annotations

import json
import math
import shutil
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

from ...capture import Capture, ScanEntry
from ...errors import InputError
from ...measurement import Measurement, WheelResult
from ...readers import PlacedBlock, read_blocks
from ...report.scene.points import on_target, residual_range_um, to_view
from ...vectors import Array, Array32
from .tree import RECORD, Records, Spill, TreeWriter, disk_errors

MARGIN_M = 1.5  # around the target centres; points farther away are not shown
INTENSITY_SHARES = (0.01, 0.99)  # of the points, at the ends of the range of the intensity
INTENSITY_EVERY = 16  # points, of which one counts for that range
IN_MEMORY_ROWS = 1 << 17

Stamps = dict[Path, tuple[int, int]]


@dataclass
class Collected:
    """Spilled points of the scans around the vehicle, and what holds for all of them.

    low, high: (3,) their limits. total: number of the points of the scans. intensities: a sample.
    """

    spill: Spill
    groups: list[str] = field(default_factory=list)
    total: int = 0
    low: Array32 = field(default_factory=lambda: np.full(3, np.inf, np.float32))
    high: Array32 = field(default_factory=lambda: np.full(3, -np.inf, np.float32))
    has_intensity: bool = True
    intensities: list[Array32] = field(default_factory=list)

    def add(self, records: Records) -> None:
        """Spill points, in the axes of the tree."""
        for axis, values in enumerate(records["xyz"].T if len(records) else ()):
            self.low[axis] = min(self.low[axis], values.min())
            self.high[axis] = max(self.high[axis], values.max())
        sampled = records["intensity"][::INTENSITY_EVERY]
        self.intensities.append(sampled[np.isfinite(sampled)])
        self.spill.add(records)

    @property
    def intensity_range(self) -> list[float] | None:
        """Values at the ends of the colour scale; None unless every scan has them."""
        every = np.concatenate([np.zeros(0, np.float32), *self.intensities])
        if not self.has_intensity or not len(every):
            return None
        low, high = (float(value) for value in np.quantile(every, INTENSITY_SHARES))
        return [low, high] if high > low else None


def stamps(capture: Capture) -> Stamps:
    """Return size and time of each file of a capture, which show whether it changes."""
    return {entry.path: _stamp(entry.path) for entry in _entries(capture) if entry.scan is None}


def write_points(
    capture: Capture,
    measurement: Measurement,
    folder: Path,
    measured: Stamps,
    most_bytes: int,
    progress: Callable[[float], None],
) -> None:
    """Read the scans of `capture` again and write points.bin and points.json to `folder`.

    measured: `stamps` before the measurement. most_bytes: of the points on disk. progress: called
    with the share that is done. Raises InputError for a file that has changed since, and where the
    disk has no room.
    """
    box = _box(measurement)
    edge_m = 2.0 ** math.ceil(math.log2(float(np.ptp(box, axis=0).max())))
    with disk_errors(), tempfile.TemporaryDirectory() as scratch:
        found = Collected(Spill(Path(scratch), edge_m, most_bytes))
        entries = _entries(capture)
        for done, entry in enumerate(entries):
            _collect(found, capture, entry, measurement, box)
            if measured.get(entry.path, ()) not in ((), _stamp(entry.path)):
                name = capture.called(entry)
                raise InputError(f"{name}: it has changed since it was measured: measure it again")
            progress(0.5 * (done + 1) / len(entries))
        count = found.spill.counts.total()
        scale = found.intensity_range
        with (Path(scratch) / "points.bin").open("wb") as stream:
            writer = TreeWriter(
                stream, lambda records: _bytes(records["intensity"], scale),
                lambda done: progress(0.5 + 0.5 * done / count),
            )  # fmt: skip
            writer.write(found.spill)
        head = {
            "origin": box.mean(axis=0).tolist(),
            "edge_m": edge_m,
            "box": [found.low.tolist(), found.high.tolist()] if count else None,
            "groups": found.groups,
            "count": count,
            "total": found.total,
            "residual_um": residual_range_um(measurement),
            "intensity": scale,
            "nodes": writer.nodes,
        }
        shutil.move(Path(scratch) / "points.bin", folder / "points.bin")
        (folder / "points.json").write_text(json.dumps(head), encoding="utf-8")


def _collect(
    found: Collected,
    capture: Capture,
    entry: ScanEntry,
    measurement: Measurement,
    box: Array,
) -> None:
    """Spill the points around the vehicle of each scan of the entry's file."""
    seen = [
        wheel
        for wheel in measurement.wheels
        if wheel.observation.evidence is not None
        and entry.name in (wheel.observation.name, "vehicle")
    ]
    first = len(found.groups)
    for block in _blocks(capture, entry, seen):
        if len(found.groups) == first:
            found.groups += _part_names(entry, block.parts)
        scan = first + (block.part if len(block.parts) > 1 else 0)
        found.add(_records(block, scan, measurement, seen, box))
        found.total += len(block.points_m)
        found.has_intensity &= block.intensity is not None


def _blocks(
    capture: Capture, entry: ScanEntry, seen: Sequence[WheelResult]
) -> Iterator[PlacedBlock]:
    """Yield the points of an entry; a scan that was measured says whether some are missing."""
    if entry.scan is None:
        has_missing = any(wheel.observation.invalid_points for wheel in seen) or not seen
        name = capture.called(entry)
        yield from read_blocks(
            entry.path, capture.length_unit, name, capture.reading, has_missing=has_missing
        )
        return
    scan, intensity = entry.scan, entry.scan.intensity
    for start in range(0, len(scan.points_m), IN_MEMORY_ROWS):
        rows = slice(start, start + IN_MEMORY_ROWS)
        bright = None if intensity is None else intensity[rows]
        yield PlacedBlock(scan.points_m[rows], bright, 0, ())


def _records(
    block: PlacedBlock,
    scan: int,
    measurement: Measurement,
    seen: Sequence[WheelResult],
    box: Array,
) -> Records:
    local = to_view(measurement.frame, block.points_m)
    kept = np.ones(len(local), bool)
    for values, low, high in zip(local.T, *box, strict=True):
        kept &= (values > low) & (values < high)
    inside = np.flatnonzero(kept)
    records = np.empty(len(inside), RECORD)
    records["xyz"] = local[inside] - box.mean(axis=0)
    records["intensity"] = np.nan if block.intensity is None else block.intensity[inside]
    _, records["residual"] = on_target(seen, block.points_m[inside])
    records["scan"] = scan
    return records


def _part_names(entry: ScanEntry, parts: Sequence[str]) -> list[str]:
    """Return the name of the entry, or of each scan of its file, none twice."""
    if len(parts) < 2:
        return [entry.name]
    names = [part or str(number) for number, part in enumerate(parts, start=1)]
    return [
        name if names.count(name) == 1 else f"{name} ({number})"
        for number, name in enumerate(names, start=1)
    ]


def _entries(capture: Capture) -> list[ScanEntry]:
    return [capture.cloud] if capture.cloud else list(capture.entries)


def _stamp(path: Path) -> tuple[int, int]:
    """Return size and time of a file; of one that is gone, what no file has."""
    try:
        found = path.stat()
    except OSError:
        return -1, -1
    return found.st_size, found.st_mtime_ns


def _box(measurement: Measurement) -> Array:
    """Return the lowest and highest corner (2, 3) of the displayed box, vehicle frame."""
    centres_m = np.stack([wheel.observation.fitted.centre_m for wheel in measurement.wheels[:4]])
    centres = to_view(measurement.frame, centres_m)
    return np.stack([centres.min(axis=0) - MARGIN_M, centres.max(axis=0) + MARGIN_M])


def _bytes(intensity: Array32, scale: list[float] | None) -> npt.NDArray[np.uint8]:
    if scale is None:
        return np.zeros(len(intensity), np.uint8)
    share = (np.nan_to_num(intensity, nan=scale[0]) - scale[0]) / (scale[1] - scale[0])
    return np.asarray(np.rint(255.0 * np.clip(share, 0.0, 1.0)), np.uint8)
