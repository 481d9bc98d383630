"""Template matching with cv2: where the target fits the occupied cells of a plane's raster."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from ..cloud import load_opencv
from ..system import frozen
from ..targets import Region
from ..vectors import Array, Array32, Mask

Image = Array32
Occupied = npt.NDArray[np.uint8]

COARSE_ROTATION = np.radians(15.0)
FINE_STEPS = 5  # that a coarse rotation is divided into
NEARLY = 0.1  # of the score: what refining a rotation may add to it; what does not decide
HIDDEN = 0.9  # match below which a part of the target is hidden, which may fit elsewhere as well
APART, APART_RAD = 0.15, 0.2  # of the radius, and rotation: from where it is elsewhere
MOST_ELSEWHERE = 4
RING_REACH = 1.4  # of the radius: how far around the target emptiness counts
SECTORS = 48
FINEST, COARSEST = 1.0 / 60.0, 1.0 / 3.0  # cells, of the radius
OUTNUMBERED = 2.0  # points off the plane for each on it: fewer are its own noise
OFF_PLANE = 2.0  # times the depth within which points are on the plane: between, they are off
COARSE, FINE = 0.1, 1.0 / 30.0  # of the radius: cells too coarse for the outline, and finer ones
NO_POINTS = np.zeros((0, 2))
TOP = 0.15  # of the score: height of the top of a peak


@frozen(eq=False)
class Placement:
    """Best position of the target on the occupied cells.

    centre_m: (2,) in the plane. rotation_rad: of the target's axes in it. match: 1 for a whole
    target, the visible share of the outline for a partly hidden one, much less for part of a larger
    surface. cell_m: edge of the cells. elsewhere: other centres, from this one, and rotations, from
    this one, at which what is seen of a partly hidden target fits nearly as well.
    """

    centre_m: Array
    rotation_rad: float
    match: float
    cell_m: float
    elsewhere: tuple[tuple[Array, float], ...] = ()


def match_template(
    uv_m: Array, region: Region, period_rad: float, radius_m: float, off_m: Array = NO_POINTS
) -> Placement:
    """Match the target to the points uv_m (N, 2) of a plane, to about half a cell.

    period_rad: rotation that maps the target on itself, 0 for any. radius_m: of the circle about
    it. off_m: (M, 2) points just off the plane; where these are many more, there is another
    surface, whose noise reaches the plane.
    Cells are a sixtieth of the radius, or larger where the points are so sparse that many would be
    empty; above a third of the radius, the outline of so few points carries no information.
    """
    cv2 = load_opencv()
    if len(uv_m) < 10:
        return Placement(np.zeros(2), 0.0, 0.0, radius_m)
    cell = _cell_size(uv_m, radius_m)
    if cell > COARSEST * radius_m:
        return Placement(np.zeros(2), 0.0, 0.0, cell)
    low, occupied = _occupied(uv_m, cell, RING_REACH * radius_m, off_m)
    coarse = cell > COARSE * radius_m
    on_target = uv_m[_in_cells(uv_m, low, occupied, cell)] if coarse else NO_POINTS
    occupied = cv2.morphologyEx(occupied, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
    angles = np.arange(0.0, period_rad, COARSE_ROTATION) if period_rad else np.zeros(1)
    scores = _rotated_scores(occupied, region, radius_m, cell, angles)
    if period_rad:
        steps = np.linspace(-0.5, 0.5, FINE_STEPS) * COARSE_ROTATION
        tops = np.array([score.max() for score in scores])
        angles = np.concatenate([angles[k] + steps for k in _likely(tops)])
        scores = _rotated_scores(occupied, region, radius_m, cell, angles)
    best = int(np.argmax([score.max() for score in scores]))
    peak, angle = _plateau_centre(scores[best]), float(angles[best])
    centre, edge = low + (peak + 0.5) * cell, cell
    if len(on_target) > 0:
        low, occupied, edge = _finer(on_target, cell, radius_m)
        peak = (centre - low) / edge - 0.5
    resolved = max(min(cell, COARSE * radius_m), 0.5 * cell)
    match = _outline_match(occupied, peak, angle, region, radius_m, edge, resolved)
    elsewhere: tuple[tuple[Array, float], ...] = ()
    if period_rad and match < HIDDEN:
        others = _elsewhere(scores, angles, best, period_rad, APART * radius_m / cell)
        elsewhere = tuple((by * cell, turn) for by, turn in others)
    return Placement(centre, angle, match, cell, elsewhere)


def _elsewhere(
    scores: Sequence[Image], angles: Array, best: int, period_rad: float, apart: float
) -> list[tuple[Array, float]]:
    """Return other peaks that are nearly as high as the best: cells (2,) from it, and rotation.

    apart: number of cells from where a peak of the same rotation is another.
    """
    least = float(scores[best].max()) - NEARLY
    tops: list[tuple[Array, float]] = [(_plateau_centre(scores[best]), float(angles[best]))]
    column, row = np.meshgrid(*(np.arange(n) for n in scores[best].shape[::-1]))
    for k in np.argsort([-float(score.max()) for score in scores], kind="stable"):
        score = scores[k].copy()
        while len(tops) <= MOST_ELSEWHERE and float(score.max()) > least:
            peak, angle = _plateau_centre(score), float(angles[k])
            if not any(
                np.hypot(*(peak - at)) < apart
                and abs(math.remainder(angle - turn, period_rad)) < APART_RAD
                for at, turn in tops
            ):
                tops.append((peak, angle))
            top_row, top_column = np.unravel_index(np.argmax(score), score.shape)
            score[np.hypot(column - top_column, row - top_row) < apart] = -np.inf
    at, turn = tops[0]
    return [(other - at, angle - turn) for other, angle in tops[1:]]


def _finer(uv_m: Array, cell: float, radius_m: float) -> tuple[Array, Occupied, float]:
    """Return the lower corner, the cells and their edge of a raster that resolves the outline.

    Each coarse cell in parts; gaps as wide as two coarse cells are closed by a disc, which keeps
    the edge of few points where they end.
    """
    cv2 = load_opencv()
    parts = math.ceil(cell / (FINE * radius_m))
    low, occupied = _occupied(uv_m, cell / parts, RING_REACH * radius_m)
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * parts + 1, 2 * parts + 1))
    return low, cv2.morphologyEx(occupied, cv2.MORPH_CLOSE, disc), cell / parts


def peaks(
    uv_m: Array, cell_m: float, region: Region, period_rad: float, radius_m: float, floor: float
) -> list[tuple[Array, float]]:
    """Find candidate positions (2,) on a coarse raster of uv_m (N, 2), with scores, best first.

    Score: occupied share of the target, less twice that of a ring around it; above `floor`.
    So a corner of a larger surface scores less than half a target.
    """
    cv2 = load_opencv()
    low, occupied = _occupied(uv_m, cell_m, RING_REACH * radius_m)
    occupied = cv2.morphologyEx(occupied, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
    angles = np.arange(0.0, period_rad, 2.0 * COARSE_ROTATION) if period_rad else np.zeros(1)
    images = [_coarse_score(occupied, region, radius_m, cell_m, angle) for angle in angles]
    score = np.max(images, axis=0)
    found = []
    column, row = np.meshgrid(np.arange(score.shape[1]), np.arange(score.shape[0]))
    while float(score.max()) > floor:
        peak = np.unravel_index(np.argmax(score), score.shape)
        found.append((low + (np.array(peak[::-1]) + 0.5) * cell_m, float(score[peak])))
        score[np.hypot(column - peak[1], row - peak[0]) * cell_m < radius_m] = -np.inf
    return found


def _occupied(
    uv_m: Array, cell: float, reach: float, off_m: Array = NO_POINTS
) -> tuple[Array, Occupied]:
    """Return the lower corner of a raster with `reach` around the points, and its occupied cells.

    Cells where points off_m (M, 2) outnumber those on the plane count as empty.
    """
    axes = np.ascontiguousarray(uv_m.T)
    low, high = axes.min(axis=1) - reach, axes.max(axis=1) + reach
    across, along = (np.ceil((high - low) / cell).astype(int) + 1).tolist()

    def cells(columns_m: Array) -> npt.NDArray[np.int64]:
        column, row = ((axis - at) / cell for axis, at in zip(columns_m, low, strict=True))
        return np.asarray(row.astype(np.int64) * across + column.astype(np.int64))

    occupied = np.zeros(along * across, dtype=np.uint8)
    on_plane = cells(axes)
    occupied[on_plane] = 1
    off_plane = off_m[((off_m >= low) & (off_m <= high)).all(axis=1)].T
    if off_plane.size:
        on, off = (_about(cell, along, across) for cell in (on_plane, cells(off_plane)))
        occupied &= (OUTNUMBERED * on > off).ravel()
    return low, occupied.reshape(along, across)


def _about(cell: npt.NDArray[np.int64], along: int, across: int) -> Image:
    """Return the mean number of points of cells (N,) in each cell and its eight neighbours."""
    cv2 = load_opencv()
    count = np.bincount(cell, minlength=along * across).reshape(along, across)
    return np.asarray(cv2.blur(count.astype(np.float32), (3, 3), borderType=cv2.BORDER_CONSTANT))


def outnumbered(uv_m: Array, off_m: Array, cell_m: float) -> Mask:
    """Return which of uv_m (N, 2) on a plane lie where many more, off_m (M, 2), lie off it."""
    low, occupied = _occupied(uv_m, cell_m, 2.0 * cell_m, off_m)
    return ~_in_cells(uv_m, low, occupied, cell_m)


def _in_cells(uv_m: Array, low: Array, occupied: Occupied, cell: float) -> Mask:
    """Return which of uv_m (N, 2) lie in occupied cells of a raster with that lower corner."""
    column, row = ((uv_m - low) / cell).astype(np.int64).T
    return np.asarray(occupied[row, column] == 1)


def _cell_size(uv_m: Array, radius_m: float) -> float:
    """Return the edge of cells of four points on average, by the density at the median point."""
    u, v = (axis - np.median(axis) for axis in np.ascontiguousarray(uv_m.T))
    inner = 0.5 * radius_m
    count = np.count_nonzero(u * u + v * v < inner**2)
    density = float(max(int(count), 4)) / (np.pi * inner**2)
    return max(float(np.sqrt(4.0 / density)), FINEST * radius_m)


def _rotated_scores(
    occupied: Occupied, region: Region, radius_m: float, cell: float, angles: Array
) -> list[Image]:
    """Return the scores of all positions for each of the rotations.

    Score: occupied share of the target, less that of the ring about it; for several angles, plus
    the same for narrow bands along the outline, since part of a rectangle fits at many positions.
    """
    scores = []
    for angle in angles:
        uv = _template_grid(radius_m, cell, angle)
        ring = _ring(uv, region, radius_m, 1.5 * cell)
        kernel = _share(region.holds(uv)) - _share(ring)
        if len(angles) > 1:
            inner, outer = _bands(uv, region.filled, radius_m, cell)
            kernel = kernel + _share(inner) - _share(outer)
        scores.append(_correlated(occupied, kernel))
    return scores


def _likely(tops: Image) -> list[int]:
    """Return which of the coarse rotations, a period of them, may be the best once refined.

    tops: the best score of each. The best, and others of nearly its score that are no neighbours.
    """
    best = int(np.argmax(tops))
    apart = np.abs(np.arange(len(tops)) - best)
    others = (np.minimum(apart, len(tops) - apart) > 1) & (tops > tops[best] - NEARLY)
    return [best, *np.flatnonzero(others).tolist()]


def _coarse_score(
    occupied: Occupied, region: Region, radius_m: float, cell: float, angle: float
) -> Image:
    """Return the occupied share of the target, less twice that of the ring, for all positions."""
    uv = _template_grid(radius_m, cell, angle)
    inside = region.shrunk(0.5 * cell).holds(uv)
    return _correlated(occupied, _share(inside) - 2.0 * _share(_ring(uv, region, radius_m, cell)))


def _template_grid(radius_m: float, cell: float, angle: float) -> Array:
    """Return the cells (N, 2) of a square template about a target's centre, in its axes, metres."""
    half = int(np.ceil(RING_REACH * radius_m / cell))
    return _grid((2 * half + 1, 2 * half + 1), np.array([half, half]), angle) * cell


def _ring(uv: Array, region: Region, radius_m: float, gap: float) -> Mask:
    """Return which of uv (N, 2) lie around the target, beyond a gap, within RING_REACH."""
    around = np.hypot(uv[:, 0], uv[:, 1]) <= RING_REACH * radius_m
    return np.asarray(around & ~region.filled.shrunk(-gap).holds(uv))


def _bands(uv: Array, outline: Region, radius_m: float, cell: float) -> tuple[Mask, Mask]:
    """Return which of uv (N, 2) lie in narrow bands just inside and just outside the outline."""
    step, gap = _band_widths(radius_m, cell)
    held = [outline.shrunk(by).holds(uv) for by in (gap + step, gap, -gap, -gap - step)]
    return held[1] & ~held[0], held[3] & ~held[2]


def _band_widths(radius_m: float, cell: float) -> tuple[float, float]:
    """Return the width of a band, and of the gap between it and the outline."""
    return max(0.08 * radius_m, 2.0 * cell), max(0.03 * radius_m, cell)


def _share(mask: Mask) -> Image:
    """Return a square template whose sum over an image is the occupied share of the mask."""
    side = math.isqrt(len(mask))
    return (mask / max(int(mask.sum()), 1)).astype(np.float32).reshape(side, side)


def _correlated(occupied: Occupied, kernel: Image) -> Image:
    cv2 = load_opencv()
    image = occupied.astype(np.float32)
    return np.asarray(cv2.filter2D(image, cv2.CV_32F, kernel, borderType=cv2.BORDER_CONSTANT))


def _grid(shape: tuple[int, int], middle: Array, angle: float) -> Array:
    """Return the cells (N, 2) of a raster about its middle (column, row), in rotated axes."""
    row, column = np.indices(shape).reshape(2, -1) - middle[::-1, None]
    cos, sin = np.cos(angle), np.sin(angle)
    return np.stack([cos * column + sin * row, cos * row - sin * column], axis=1)


def _plateau_centre(score: Image) -> Array:
    """Return the top of the peak, (2,) column, row: mean of its cells, weighted by height."""
    peak = np.unravel_index(np.argmax(score), score.shape)
    row, column = np.nonzero(score > score.max() - TOP)
    near = np.hypot(column - peak[1], row - peak[0]) < 6
    row, column = row[near], column[near]
    weight = score[row, column] - (score.max() - TOP)
    return np.asarray(np.array([column @ weight, row @ weight]) / weight.sum(), dtype=float)


def _outline_match(
    occupied: Occupied,
    middle: Array,
    angle: float,
    region: Region,
    radius_m: float,
    cell: float,
    resolved: float,
) -> float:
    """Return ends * (ends / (ends + goes_on))^2: the share of the outline where the surface ends.

    By the occupied shares just inside and just outside the outline, in 48 sectors; where nothing is
    inside, the outline is hidden, and counts for neither. resolved: to which the points show it.
    """
    reach = math.ceil((radius_m + sum(_band_widths(radius_m, resolved))) / cell) + 1
    column, row = (max(round(at) - reach, 0) for at in middle.tolist())
    occupied = occupied[row : row + 2 * reach + 1, column : column + 2 * reach + 1]
    uv = _grid((occupied.shape[0], occupied.shape[1]), middle - [column, row], angle) * cell
    sector = ((np.arctan2(uv[:, 1], uv[:, 0]) / (2.0 * np.pi)) % 1.0 * SECTORS).astype(int)
    sector %= SECTORS
    filled = occupied.ravel()
    shares = []
    for ring in _bands(uv, region.filled, radius_m, resolved):
        cells = np.maximum(np.bincount(sector[ring], minlength=SECTORS), 1)
        shares.append(np.bincount(sector[ring], filled[ring], minlength=SECTORS) / cells)
    ends = float(np.clip(shares[0] - shares[1], 0.0, None).mean())
    goes_on = float(np.minimum(*shares).mean())
    return float(ends * (ends / (ends + goes_on)) ** 2) if ends > 0.0 else 0.0


def connected(uv_m: Array, radius_m: float) -> Mask:
    """Return which points uv_m (N, 2) are connected, cell to cell, with those about 0, 0: (N,)."""
    cv2 = load_opencv()
    near = uv_m[np.sum(uv_m**2, axis=1) < radius_m**2]
    if len(near) == 0:
        return np.zeros(len(uv_m), dtype=bool)
    cell = _cell_size(near, radius_m)
    index = np.floor((uv_m - uv_m.min(axis=0)) / cell).astype(np.int64)
    occupied = np.zeros(index.max(axis=0)[::-1] + 1, dtype=np.uint8)
    occupied[index[:, 1], index[:, 0]] = 1
    label = cv2.connectedComponents(occupied, connectivity=8)[1][index[:, 1], index[:, 0]]
    middle = np.sum(uv_m**2, axis=1) < (0.5 * radius_m) ** 2
    chosen = np.bincount(label[middle] if middle.any() else label).argmax()
    return np.asarray(label == chosen)
