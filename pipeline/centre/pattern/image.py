"""Image of a target in its plane, from the intensities of its points."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ...system import frozen
from ...vectors import Array

GREY_LIMITS = (0.02, 0.98)  # quantiles of the intensities that become black and white
MAX_PIXELS = 1600  # along an edge
FILL_ROUNDS = 4


@frozen(eq=False)
class TargetImage:
    """Grey image as seen from the scanner, u to the right and v up.

    grey: (H, W) uint8. pixel_m: edge of a pixel. left_m, top_m: where its upper left corner lies.
    """

    grey: npt.NDArray[np.uint8]
    pixel_m: float
    left_m: float
    top_m: float

    def places_m(self, pixels: Array) -> Array:
        """Return positions in the plane of pixels (..., 2), column and row from the first."""
        corner = np.array([self.left_m, self.top_m])
        return np.asarray(corner + (pixels + 0.5) * self.pixel_m * np.array([1.0, -1.0]))


def target_image(uv_m: Array, intensity: Array, finest_m: float) -> TargetImage:
    """Average the intensities (N,) of points uv_m (N, 2) in pixels of about two points each.

    finest_m: the smallest useful pixel. Empty pixels are filled from their neighbours.
    """
    low, high = uv_m.min(axis=0), uv_m.max(axis=0)
    area = float(np.prod(np.maximum(high - low, 1e-6)))
    pixel = max(np.sqrt(2.0 * area / len(uv_m)), finest_m, float((high - low).max()) / MAX_PIXELS)
    columns, rows = (np.ceil((high - low) / pixel).astype(int) + 3).tolist()
    left, top = low[0] - pixel, high[1] + pixel
    column = ((uv_m[:, 0] - left) / pixel).astype(np.int64)
    cell = ((top - uv_m[:, 1]) / pixel).astype(np.int64) * columns + column
    count = np.bincount(cell, minlength=rows * columns).reshape(rows, columns)
    total = np.bincount(cell, intensity, minlength=rows * columns).astype(np.float64)
    mean = _filled(total.reshape(rows, columns), count.astype(np.float64))
    black, white = np.quantile(intensity, GREY_LIMITS)
    grey = np.clip((mean - black) / max(float(white - black), 1e-12), 0.0, 1.0) * 255.0
    return TargetImage(np.round(grey).astype(np.uint8), pixel, float(left), float(top))


def _filled(total: Array, count: Array) -> Array:
    """Return means (H, W); empty pixels take that of the eight about them, then that of all."""
    for _ in range(FILL_ROUNDS):
        empty = count == 0.0
        if not empty.any():
            break
        around = [_of_nine(values) for values in (total, count)]
        total, count = (np.where(empty, a, v) for a, v in zip(around, (total, count), strict=True))
    mean = float(total.sum() / count.sum())
    return np.where(count > 0.0, total / np.maximum(count, 1e-300), mean)


def _of_nine(values: Array) -> Array:
    """Return the sum over each pixel and the eight about it."""
    padded = np.pad(values, 1)
    rows = padded[:-2] + padded[1:-1] + padded[2:]
    return np.asarray(rows[:, :-2] + rows[:, 1:-1] + rows[:, 2:])
