"""Assembly of blocks of raw columns into one scan, common to all formats."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from ..cloud import all_within
from ..system import frozen, lent
from ..units import to_metres
from ..vectors import Array, Array32, Mask
from .faults import fault
from .memory import check_memory
from .missing import Markers, find_markers, is_huge, rows_looked_at
from .scan import Part, Scan
from .source import Block, RawCloud, RawPart, Source

RowProgress = Callable[[int, int], None]

MAX_COORDINATE_M = 1e10  # float64 still resolves 2 um here


@frozen(eq=False)
class PointRows:
    """Preallocated arrays for points, intensity and grid, or views into them."""

    points: Array
    intensity: Array32 | None
    grid: npt.NDArray[np.int32] | None

    @staticmethod
    def row_bytes(cloud: RawCloud) -> int:
        """Return the bytes of memory that a row of the cloud takes."""
        return 24 + 4 * cloud.has_intensity + 8 * cloud.has_grid

    @classmethod
    def room(cls, rows: int, cloud: RawCloud) -> PointRows:
        """Allocate `rows` rows of the columns that the cloud holds."""
        return cls(
            np.empty((rows, 3)),
            np.empty(rows, np.float32) if cloud.has_intensity else None,
            np.empty((rows, 2), np.int32) if cloud.has_grid else None,
        )

    def part(self, start: int, stop: int) -> PointRows:
        """Return rows start:stop as views."""
        return PointRows(
            self.points[start:stop],
            None if self.intensity is None else self.intensity[start:stop],
            None if self.grid is None else self.grid[start:stop],
        )

    def keep(self, chosen: Mask) -> int:
        """Move the chosen ones of the first rows to the front and return their number."""
        count = int(chosen.sum())
        for column in (self.points, self.intensity, self.grid):
            if column is not None:
                column[:count] = column[: len(chosen)][chosen]
        return count


class Placer:
    """Writer of the successive blocks of a cloud into rows of points in metres.

    markers: of missing returns, where they are known; such points are dropped as well.
    """

    def __init__(
        self, cloud: RawCloud, source: Source, length_unit: str, markers: Markers | None = None
    ) -> None:
        self._source, self._unit, self._markers = source, length_unit, markers
        self._poses = [checked_pose(part, source) for part in cloud.parts]
        self.seen = 0

    def place(self, block: Block, rows: PointRows) -> int:
        """Fill the first rows with the valid points of the block and return their number.

        Raises InputError for a coordinate beyond any site.
        """
        count = _fill(rows, block)
        pose = self._poses[block.part] if self._poses else None
        if block.invalid is None and pose is None and are_usual(rows.points[:count]):
            kept = count
            to_metres(rows.points[:kept], self._unit)
        else:
            kept = self._drop_invalid(block, rows, count)
            if pose is not None:
                apply_pose(rows.points[:kept], pose)
            to_metres(rows.points[:kept], self._unit)
            self._check_size(rows.points[:kept])
        self.seen += count
        if not self._markers:
            return kept
        return rows.keep(~self._markers.mask(rows.points[:kept]))

    def _drop_invalid(self, block: Block, rows: PointRows, count: int) -> int:
        valid = self._valid(rows.points[:count])
        if block.invalid is not None and block.invalid.any():
            valid = ~block.invalid if valid is None else valid & ~block.invalid
        if valid is None:
            return count
        return rows.keep(valid)

    def _valid(self, points: Array) -> Mask | None:
        """Return the mask of the rows that hold a point; None when all do."""
        if are_usual(points):
            return None
        missing = ~np.isfinite(points)
        huge = ~missing & (np.abs(points) > MAX_COORDINATE_M)
        missing[huge] = is_huge(points[huge])
        x, y, z = missing.T
        return np.asarray(~(x | y | z))

    def _check_size(self, points: Array) -> None:
        if len(points) and max(points.max(), -points.min()) > MAX_COORDINATE_M:
            raise fault(
                self._source,
                f"a coordinate of {np.abs(points).max():.3g} m is beyond any site",
                f"check the length unit, {self._unit}",
            )


def are_usual(points: Array) -> bool:
    """Return whether all coordinates are finite and within any site."""
    return all_within(points, MAX_COORDINATE_M)


def _fill(rows: PointRows, block: Block) -> int:
    count = len(block.xyz[0])
    for axis, column in enumerate(block.xyz):
        rows.points[:count, axis] = column
    if rows.intensity is not None:
        rows.intensity[:count] = block.intensity
    if rows.grid is not None and block.grid is not None:
        rows.grid[:count, 0], rows.grid[:count, 1] = block.grid
    return count


def silent(_done: int, _total: int) -> None:
    """Ignore progress."""


def gather(
    cloud: RawCloud,
    source: Source,
    length_unit: str,
    progress: RowProgress = silent,
    in_place: bool = False,
) -> Scan:
    """Fill the arrays block by block, drop invalid points, apply the poses, scale to metres.

    Points that mark missing returns (see missing.py) are dropped as invalid ones are.
    progress: called with the number of rows read and the total. in_place: whether the points may
    lie in the file itself, where it holds them as they are returned. Raises InputError for a
    coordinate beyond any site, and when no point is left.
    """
    if cloud.rows == 0:
        raise fault(source, "it declares 0 points")
    check_memory(cloud.rows, PointRows.row_bytes(cloud), source)
    if in_place and length_unit == "m" and (scan := _scan_in_place(cloud, source)):
        progress(cloud.rows, cloud.rows)
        return scan
    all_rows = PointRows.room(cloud.rows, cloud)
    placer = Placer(cloud, source, length_unit)
    kept, held = 0, [0] * len(cloud.parts)
    # A float64 intensity or a longdouble coordinate may overflow; coordinates are checked.
    with np.errstate(over="ignore", invalid="ignore"):
        for block in cloud.blocks:
            if placer.seen + len(block.xyz[0]) > cloud.rows:
                raise fault(source, f"it holds more than the {cloud.rows} points it declares")
            placed = placer.place(block, all_rows.part(kept, cloud.rows))
            kept += placed
            if held:
                held[block.part] += placed
            progress(placer.seen, cloud.rows)
    if kept == 0:
        invalid = f"all its {placer.seen} points are invalid (no return)"
        raise fault(source, invalid if placer.seen else "it holds 0 points")
    looked_at = all_rows.points[rows_looked_at(0, kept, kept)] if cloud.may_mark else None
    if looked_at is not None and (markers := find_markers(looked_at)):
        missing = markers.mask(all_rows.points[:kept])
        ends = np.concatenate([[0], np.cumsum(held)]).astype(np.int64)
        held = [n - int(missing[a:b].sum()) for n, a, b in zip(held, ends, ends[1:], strict=False)]
        kept = all_rows.keep(~missing)
    rows = all_rows.part(0, kept)
    return Scan(
        points_m=rows.points,
        intensity=rows.intensity,
        source=source.name,
        invalid_points=placer.seen - kept,
        grid=rows.grid,
        parts=_parts(cloud, held, length_unit),
        is_mesh=cloud.is_mesh,
    )


def _scan_in_place(cloud: RawCloud, source: Source) -> Scan | None:
    """Return the points where the file holds them, mapped into memory; None where some are invalid.

    None as well where the file holds them in another form, or the system does not lend it.
    """
    if cloud.record is None or (content := lent(source.stream)) is None:
        return None
    table = np.frombuffer(content, cloud.record, cloud.rows, source.stream.tell())
    points_m = table["xyz"]
    if not are_usual(points_m):
        return None
    if cloud.may_mark and find_markers(points_m[rows_looked_at(0, cloud.rows, cloud.rows)]):
        return None
    with np.errstate(over="ignore", invalid="ignore"):
        intensity = np.asarray(table["intensity"], np.float32) if cloud.has_intensity else None
    return Scan(points_m, intensity, source.name, invalid_points=0, is_mesh=cloud.is_mesh)


def _parts(cloud: RawCloud, held: list[int], length_unit: str) -> tuple[Part, ...]:
    stops = np.cumsum(held).tolist()
    return tuple(
        Part(part.name, stop - count, stop, _pose_m(part.T_file_scan, length_unit))
        for part, count, stop in zip(cloud.parts, held, stops, strict=True)
    )


def _pose_m(T: Array | None, length_unit: str) -> Array | None:
    if T is None:
        return None
    T = T.copy()
    to_metres(T[:3, 3], length_unit)
    return T


def checked_pose(part: RawPart, source: Source) -> Array | None:
    """Return the part's pose (4, 4), or None where it is the identity.

    Raises InputError for no pose of a scanner: not finite, singular, mirrored or projective.
    """
    T = part.T_file_scan
    if T is None or np.array_equal(T, np.eye(4)):
        return None
    with np.errstate(all="ignore"):
        proper = np.isfinite(T).all() and np.linalg.det(T[:3, :3]) > 0.0
    if not (proper and np.array_equal(T[3], [0.0, 0.0, 0.0, 1.0])):
        raise fault(source, f"the pose of its scan {part.name} is not a rotation and a translation")
    return T


def apply_pose(points: Array, T: Array) -> None:
    """Transform points (N, 3) to R p + t, in place.

    Rotates about the first point c, so that large coordinates are never multiplied by R:
    R (p - c) + (R c + t), the last term in extended precision.
    """
    if not len(points):
        return
    centre = points[0].copy()
    exact = T.astype(np.longdouble)
    shift = (exact[:3, :3] @ centre.astype(np.longdouble) + exact[:3, 3]).astype(np.float64)
    np.subtract(points, centre, out=points)
    points[:] = points @ T[:3, :3].T
    points += shift
