"""The raster of a plane, with cv2."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipeline.kernels import Array


@dataclass(frozen=True)
class DiscPlacement:
    """Where a disc of known radius fits the occupied cells best.

    centre_m: (2,) in the plane. match: 1 for a whole disc, the visible share of the rim for a
    hidden one, much less for part of a larger face. points: how many the raster held. cell_m: the
    edge of its cells.
    """

    centre_m: Array
    match: float
    points: int
    cell_m: float


def match_disc(uv_m: Array, radius_m: float) -> DiscPlacement:
    """Place a disc on the points uv_m (N, 2) of a plane, to about half a cell.

    Cells are a sixtieth of the radius, or as large as the points need to leave few of them empty.
    """
    import cv2

    if len(uv_m) < 10:
        return DiscPlacement(np.zeros(2), 0.0, len(uv_m), radius_m)
    cell = _cell_size(uv_m, radius_m)
    reach = 1.4 * radius_m
    low = uv_m.min(axis=0) - reach
    shape = np.ceil((uv_m.max(axis=0) + reach - low) / cell).astype(int) + 1
    index = ((uv_m - low) / cell).astype(np.int64)
    occupied = np.zeros((shape[1], shape[0]), dtype=np.uint8)
    occupied[index[:, 1], index[:, 0]] = 1
    occupied = cv2.morphologyEx(occupied, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
    kernel = _disc_less_ring(radius_m / cell, reach / cell)
    score = cv2.filter2D(
        occupied.astype(np.float32), cv2.CV_32F, kernel, borderType=cv2.BORDER_CONSTANT
    )
    peak = np.array(np.unravel_index(np.argmax(score), score.shape))[::-1]
    middle = _plateau_centre(score, peak)
    match = _rim_match(occupied, middle, radius_m / cell)
    return DiscPlacement(low + (middle + 0.5) * cell, match, len(uv_m), cell)


def _cell_size(uv_m: Array, radius_m: float) -> float:
    """Cells of a mean of four points, by the density about the median point."""
    middle = np.median(uv_m, axis=0)
    inner = 0.5 * radius_m
    count = np.count_nonzero(np.sum((uv_m - middle) ** 2, axis=1) < inner**2)
    density = float(max(int(count), 4)) / (np.pi * inner**2)
    return float(np.clip(np.sqrt(4.0 / density), radius_m / 60.0, radius_m / 4.0))


def _disc_less_ring(radius: float, reach: float) -> npt.NDArray[np.float32]:
    """+1 over the disc, -1 over the ring up to `reach` (in cells), each of unit sum."""
    half = int(np.ceil(reach))
    axis = np.arange(-half, half + 1)
    distance = np.hypot(axis[:, None], axis[None, :])
    disc = (distance <= radius).astype(np.float32)
    ring = ((distance > radius + 1.5) & (distance <= reach)).astype(np.float32)
    return np.asarray(disc / disc.sum() - ring / max(ring.sum(), 1.0), dtype=np.float32)


def _plateau_centre(score: npt.NDArray[np.float32], peak: npt.NDArray[np.int64]) -> Array:
    """Centre of the cells about the peak that score nearly as high: (2,) column, row."""
    row, column = np.nonzero(score > score.max() - 0.01)
    near = np.hypot(column - peak[0], row - peak[1]) < 4
    return np.array([column[near].mean(), row[near].mean()])


def _rim_match(occupied: npt.NDArray[np.uint8], middle: Array, radius: float) -> float:
    """Share of the rim where the face ends, times that over where it ends or goes on.

    By the occupied shares just inside and just outside the rim, in 48 sectors; where nothing is
    inside, the rim is hidden, and counts for neither.
    """
    row, column = np.indices(occupied.shape)
    column, row = column - middle[0], row - middle[1]
    reach = np.hypot(column, row)
    sector = ((np.arctan2(row, column) / (2.0 * np.pi)) % 1.0 * 48).astype(int) % 48
    step = max(0.08 * radius, 2.0)
    gap = max(0.03 * radius, 1.0)
    inside = (reach < radius - gap) & (reach > radius - gap - step)
    outside = (reach > radius + gap) & (reach < radius + gap + step)
    shares = [
        np.bincount(sector[ring], occupied[ring], minlength=48)
        / np.maximum(np.bincount(sector[ring], minlength=48), 1)
        for ring in (inside, outside)
    ]
    ends = float(np.clip(shares[0] - shares[1], 0.0, None).mean())
    goes_on = float(np.minimum(*shares).mean())
    return ends * ends / (ends + goes_on) if ends > 0.0 else 0.0


def connected(uv_m: Array, radius_m: float) -> npt.NDArray[np.bool_]:
    """Which points uv_m (N, 2) hang together, cell to cell, with those about 0, 0: (N,)."""
    import cv2

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
