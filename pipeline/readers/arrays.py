"""Points in memory as a scan: arrays, lists, and the clouds of other libraries."""

from __future__ import annotations

from contextlib import ExitStack
from io import BufferedReader, BytesIO, StringIO
from pathlib import Path
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from ..errors import InputError
from ..units import LENGTH_UNITS
from .gather import gather
from .parsing.columns import check_unnamed, unnamed_layout
from .scan import Scan
from .source import RawCloud, Source

BLOCK_ROWS, CHECKED_ROWS = 1 << 16, 1000
COLUMNS = (3, 4)


def scan_of_points(points: object, length_unit: str = "m", name: str = "points") -> Scan:
    """Copy points once, to float64 metres, and drop the missing returns, as of a file.

    points: (N, 3), or (N, 4) with the intensity, (3, N), a raster (H, W, 3), a list of rows; masked
    or NaN where there is no return; an Open3D or trimesh cloud or mesh. Raises InputError, one line
    that begins with `name`.
    """
    if length_unit not in LENGTH_UNITS:
        known = ", ".join(LENGTH_UNITS)
        raise InputError(f"{name}: the length unit '{length_unit}' is unknown: use {known}")
    rows = _rows(_array(points, name), name)
    nowhere = cast(BufferedReader, BytesIO())
    source = Source(nowhere, StringIO(), 0, name, Path(name), ExitStack())
    check_unnamed(np.asarray(rows[:CHECKED_ROWS], dtype=float), source)
    layout = unnamed_layout(rows.shape[1])
    blocks = (
        layout.block(rows[start : start + BLOCK_ROWS]) for start in range(0, len(rows), BLOCK_ROWS)
    )
    has_intensity, joined = layout.intensity is not None, _is_joined(points)
    cloud = RawCloud(len(rows), has_intensity, blocks, is_mesh=joined)
    return gather(cloud, source, length_unit)


def _is_joined(points: object) -> bool:
    """Return whether another library's points are the corners of triangles."""
    return any(np.size(getattr(points, name, ())) > 0 for name in ("triangles", "faces"))


def _array(points: object, name: str) -> npt.NDArray[Any]:
    """Return the numbers of an array, a list, or another library's cloud, not copied if possible.

    A cloud of Open3D has `points` or `point.positions`, one of trimesh `vertices`.
    """
    held = points
    for path in (("point", "positions"), ("points",), ("vertices",)):
        found: Any = points
        for attribute in path:
            found = getattr(found, attribute, None)
        if found is not None and not callable(found):
            held = found.cpu().numpy() if hasattr(found, "cpu") else found
            break
    try:
        array = held if isinstance(held, np.ma.MaskedArray) else np.asarray(held)
    except (ValueError, TypeError):
        array = np.asarray(None)
    if array.dtype.kind not in "fiu":
        kind = type(points).__name__
        fact = f"a {kind} of the type {array.dtype} is no cloud of points"
        raise InputError(f"{name}: {fact}: give numbers, N rows of x y z in an array")
    if isinstance(array, np.ma.MaskedArray):
        return np.asarray(np.ma.filled(array.astype(float), np.nan))
    return array


def _rows(array: npt.NDArray[Any], name: str) -> npt.NDArray[Any]:
    """Return points as rows of x y z, perhaps with an intensity: a view of the array."""
    if array.ndim == 3 and array.shape[2] in COLUMNS:
        array = array.reshape(-1, array.shape[2])
    if array.ndim == 2 and array.shape[1] not in COLUMNS and array.shape[0] == 3:
        array = array.T
    if array.ndim != 2 or array.shape[1] not in COLUMNS:
        fact = f"an array of the shape {array.shape} is no cloud of points"
        raise InputError(f"{name}: {fact}: give N rows of x y z, or of x y z and intensity")
    return array
