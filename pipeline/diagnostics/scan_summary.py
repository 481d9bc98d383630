"""Summary of a scan file, found in one pass: only a sample of the points is kept."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

from ..readers import (
    AS_THE_FILE_SAYS,
    Block,
    LookedAt,
    Markers,
    Placer,
    PointRows,
    RawCloud,
    ReadOptions,
    RowProgress,
    find_markers,
    open_cloud,
    silent,
)
from ..units import to_metres
from ..vectors import Array
from .plausibility import CLOUD_SIZES_M, lone_fact

SAMPLE = 100_000
_SEED = 0
# Odd multipliers of a product hash of three coordinates' bits.
_MIX = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], np.uint64)


@dataclass
class PointCounts:
    """One scan of the file. T_file_scan: (4, 4) in metres, None where the file states none.

    note: the reader's assumptions, as a sentence.
    """

    name: str
    T_file_scan: Array | None
    note: str = ""
    points: int = 0
    invalid_points: int = 0


@dataclass
class ScanSummary:
    """Summary of a scan file. low_m, high_m: (3,) corners of the box; intensity: its range.

    declared: rows by the header; may_mark: whether some may mark missing returns. at_origin: points
    at 0 0 0. raster: rows and columns. sample_m: (S, 3) one random point of each run of `stride`
    rows. looked_at_m: (L, 3) those by which missing returns are known. keys: hashes of the points
    whose hash is a multiple of `stride`, so that equal points are either all among them or none.
    middle_m: (3,) of the first points. far: number of points further from it than any scan reaches,
    farthest_m: the farthest; near_low_m, near_high_m: corners of the box without them.
    """

    format: str
    file_bytes: int
    length_unit: str
    stride: int
    declared: int
    may_mark: bool = True
    points: int = 0
    invalid_points: int = 0
    at_origin: int = 0
    low_m: Array = field(default_factory=lambda: np.full(3, np.inf))
    high_m: Array = field(default_factory=lambda: np.full(3, -np.inf))
    intensity: tuple[float, float] | None = None
    raster: tuple[int, int] | None = None
    scans: list[PointCounts] = field(default_factory=list)
    sample_m: Array = field(default_factory=lambda: np.empty((0, 3)))
    looked_at_m: Array = field(default_factory=lambda: np.empty((0, 3)))
    keys: npt.NDArray[np.uint64] = field(default_factory=lambda: np.empty(0, np.uint64))
    middle_m: Array = field(default_factory=lambda: np.empty(0))
    far: int = 0
    farthest_m: float = 0.0
    near_low_m: Array = field(default_factory=lambda: np.full(3, np.inf))
    near_high_m: Array = field(default_factory=lambda: np.full(3, -np.inf))

    @property
    def lone(self) -> str:
        """Note on few points far from the others; empty without."""
        return lone_fact(self.far, self.points, self.farthest_m)

    @property
    def extent_m(self) -> Array:
        """(3,) sides of the box, without lone points."""
        if self.lone:
            return np.asarray(self.near_high_m - self.near_low_m)
        return np.asarray(self.high_m - self.low_m)

    @property
    def near_sample_m(self) -> Array:
        """Sample (S, 3) without lone points."""
        if not self.lone:
            return self.sample_m
        return self.sample_m[_near(self.sample_m, self.middle_m)]


def summarise_scan(
    path: Path,
    length_unit: str,
    name: str | None = None,
    progress: RowProgress = silent,
    options: ReadOptions = AS_THE_FILE_SAYS,
) -> ScanSummary:
    """Summarise a scan file in one pass over its points; two where points mark missing returns.

    Raises InputError, one line, for what `read_scan` refuses; a file without points is summarised.
    """
    summary = _one_pass(path, length_unit, name, progress, options)
    markers = find_markers(summary.looked_at_m) if summary.may_mark else None
    if not markers:
        return summary
    return _one_pass(path, length_unit, name, progress, options, markers)


def _one_pass(
    path: Path,
    length_unit: str,
    name: str | None,
    progress: RowProgress,
    options: ReadOptions,
    markers: Markers | None = None,
) -> ScanSummary:
    """Summarise the points of a scan file but for those that mark missing returns."""
    rng = np.random.default_rng(_SEED)
    with open_cloud(path, length_unit, name, options) as (cloud, source):
        summary = ScanSummary(
            format=source.path.suffix.lower().removeprefix("."),
            file_bytes=path.stat().st_size,
            length_unit=length_unit,
            stride=max(1, cloud.rows // SAMPLE),
            declared=cloud.rows,
            may_mark=cloud.may_mark,
            scans=[
                PointCounts(p.name, _metres(p.T_file_scan, length_unit), p.note)
                for p in cloud.parts
            ],
        )
        placer = Placer(cloud, source, length_unit, markers)
        samples, keys, whole = [], [], []
        looked_at = LookedAt()
        with np.errstate(over="ignore", invalid="ignore"):
            for block in cloud.blocks:
                rows = _place(placer, block, cloud, summary)
                looked_at.add(rows.points)
                picked = np.arange(0, len(rows.points), summary.stride)
                picked += rng.integers(summary.stride, size=len(picked))
                samples.append(rows.points[picked[picked < len(rows.points)]])
                if summary.points <= SAMPLE:  # fewer than declared, it may be
                    whole.append(rows.points)
                hashes = _hash(rows.points)
                keys.append(hashes[hashes % np.uint64(summary.stride) == 0])
                progress(placer.seen, cloud.rows)
    if samples:
        few = summary.points <= SAMPLE
        summary.sample_m = np.concatenate(whole if few else samples)
        summary.keys = np.concatenate(keys)
        summary.looked_at_m = looked_at.points_m()
    return summary


def _place(placer: Placer, block: Block, cloud: RawCloud, summary: ScanSummary) -> PointRows:
    """Return the block's points in metres; add them to the counts."""
    room = PointRows.room(len(block.xyz[0]), cloud)
    kept = placer.place(block, room)
    missing = len(room.points) - kept
    summary.points += kept
    summary.invalid_points += missing
    if summary.scans:
        summary.scans[block.part].points += kept
        summary.scans[block.part].invalid_points += missing
    rows = room.part(0, kept)
    if kept:
        _extend(summary, rows)
    return rows


def _near(points_m: Array, middle_m: Array) -> npt.NDArray[np.bool_]:
    """Return which points (N, 3) lie within the reach of a scan."""
    x, y, z = CLOUD_SIZES_M[1] >= np.abs(points_m - middle_m).T
    return np.asarray(x & y & z)


def _extend(summary: ScanSummary, rows: PointRows) -> None:
    columns = rows.points.T  # one at a time: ten times as fast as along the first axis
    low = np.array([x.min() for x in columns])
    high = np.array([x.max() for x in columns])
    summary.low_m = np.minimum(summary.low_m, low)
    summary.high_m = np.maximum(summary.high_m, high)
    if not len(summary.middle_m):
        summary.middle_m = np.median(rows.points, axis=0)
    if not _near(np.stack([low, high]), summary.middle_m).all():
        near = _near(rows.points, summary.middle_m)
        off = np.linalg.norm(rows.points[~near] - summary.middle_m, axis=1)
        summary.far += len(off)
        summary.farthest_m = max(summary.farthest_m, float(off.max()))
        low = rows.points[near].min(axis=0, initial=np.inf)
        high = rows.points[near].max(axis=0, initial=-np.inf)
    summary.near_low_m = np.minimum(summary.near_low_m, low)
    summary.near_high_m = np.maximum(summary.near_high_m, high)
    on_plane = rows.points[columns[0] == 0.0]
    summary.at_origin += int((on_plane == 0.0).all(axis=1).sum())
    # Of several scans some may have no intensity, and of a point it may be nan or inf.
    known = None if rows.intensity is None else rows.intensity[np.isfinite(rows.intensity)]
    if known is not None and known.size:
        least, most = float(known.min()), float(known.max())
        before = summary.intensity or (least, most)
        summary.intensity = (min(least, before[0]), max(most, before[1]))
    if rows.grid is not None:
        row, column = (int(n) + 1 for n in rows.grid.max(axis=0))
        before_rows, before_columns = summary.raster or (0, 0)
        summary.raster = (max(row, before_rows), max(column, before_columns))


def _hash(points: Array) -> npt.NDArray[np.uint64]:
    """Hash each point, equal for equal points; + 0.0 makes -0.0 equal to 0.0."""
    total = np.zeros(len(points), np.uint64)
    for column, mix in zip(points.T, _MIX, strict=True):
        bits = (column + 0.0).view(np.uint64)
        mixed = (bits ^ (bits >> np.uint64(29))) * mix
        total += mixed ^ (mixed >> np.uint64(32))
    total *= _MIX[0]
    return total ^ (total >> np.uint64(31))


def _metres(T: Array | None, length_unit: str) -> Array | None:
    if T is None:
        return None
    T = T.copy()
    to_metres(T[:3, 3], length_unit)
    return T
