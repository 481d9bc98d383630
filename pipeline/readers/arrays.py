"""Points in memory as a scan: arrays, lists, and the clouds of other libraries."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from io import BufferedReader, BytesIO, StringIO
from pathlib import Path
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from ..errors import InputError
from ..units import LENGTH_UNITS
from .faults import fault
from .gather import gather
from .parsing.columns import check_unnamed, find_layout, unnamed_layout
from .scan import Scan
from .source import Layout, RawCloud, Source

BLOCK_ROWS, CHECKED_ROWS = 1 << 16, 1000
COLUMNS = (3, 4)
AMBIGUOUS = (3, 4)  # three points x y z and intensity, or four points in three rows
NUMBER_KINDS = "fiu"
BY_NAME = "a data frame with the columns"


def scan_of_points(points: object, length_unit: str = "m", name: str = "points") -> Scan:
    """Copy points once, to float64 metres, and drop the missing returns, as of a file.

    points: (N, 3), or (N, 4) with the intensity, (3, N) with N > 4, a raster (H, W, 3), a list of
    rows; masked or NaN where there is no return; a data frame or records, whose columns are found
    by their names, as of a text; an Open3D or trimesh cloud or mesh. Raises InputError, one line
    that begins with `name`.
    """
    if length_unit not in LENGTH_UNITS:
        known = ", ".join(LENGTH_UNITS)
        raise InputError(f"{name}: the length unit '{length_unit}' is unknown: use {known}")
    nowhere = cast(BufferedReader, BytesIO())
    source = Source(nowhere, StringIO(), 0, name, Path(name), ExitStack())
    names = _column_names(points)
    if names is None:
        rows = _rows(_array(points, name), name)
        check_unnamed(np.asarray(rows[:CHECKED_ROWS], dtype=float), source, BY_NAME)
        layout = unnamed_layout(rows.shape[1])
    else:
        rows, layout = _named_rows(points, names, source)
        _check_unit(layout.unit, length_unit, source)
    blocks = (
        layout.block(rows[start : start + BLOCK_ROWS]) for start in range(0, len(rows), BLOCK_ROWS)
    )
    joined = _is_joined(points)
    cloud = RawCloud(len(rows), layout.has_intensity, blocks, unit=layout.unit, is_mesh=joined)
    return gather(cloud, source, length_unit)


def _is_joined(points: object) -> bool:
    """Return whether another library's points are the corners of triangles."""
    return any(np.size(getattr(points, name, ())) > 0 for name in ("triangles", "faces"))


def _column_names(points: Any) -> list[Any] | None:
    """Return the names of a data frame's columns, or of records' fields; None where none has one.

    Columns that were only counted, as pandas and polars do, have no names.
    """
    holders = (
        (getattr(points, "dtype", None), "names"),
        (points, "column_names"),
        (points, "columns"),
    )
    found = (getattr(holder, attribute, None) for holder, attribute in holders)
    names = next((list(one) for one in found if one is not None and not callable(one)), None)
    if names is None:
        return None
    counted = [*range(len(names))], [f"column_{index}" for index in range(len(names))]
    return None if names in counted else names


def _named_rows(
    points: Any, names: Sequence[Any], source: Source
) -> tuple[npt.NDArray[Any], Layout]:
    """Return the columns x, y, z, and the intensity or else the colour if there is one."""
    try:
        layout = find_layout([str(name) for name in names])
    except ValueError as error:
        action = "name the columns x, y and z, and intensity if there is one"
        raise fault(source, str(error), action) from None
    columns = [_numbers(points[names[index]]) for index in layout.used]
    for index, column in zip(layout.used, columns, strict=True):
        if column.dtype.kind not in NUMBER_KINDS or column.shape != columns[0].shape:
            fact = f"the column {names[index]} is of the type {column.dtype}"
            raise fault(source, fact, "give numbers, NaN where there is no return")
    rows = np.column_stack([_filled(column).ravel() for column in columns])
    return rows, layout.in_order


def _check_unit(stated: str | None, length_unit: str, source: Source) -> None:
    """Raise InputError where names of columns state a unit other than the given one."""
    if stated in (None, length_unit):
        return
    fact = f"the names of its columns state {stated}, but {length_unit} is the length unit"
    action = f'give length_unit="{stated}"'
    if stated not in LENGTH_UNITS:
        action = f"give them in {', '.join(LENGTH_UNITS)}"
    raise fault(source, fact, action)


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
    array = _numbers(held)
    if array.dtype.kind not in NUMBER_KINDS:
        kind = type(points).__name__
        fact = f"a {kind} of the type {array.dtype} is no cloud of points"
        raise InputError(f"{name}: {fact}: give numbers, N rows of x y z in an array")
    return _filled(array)


def _numbers(held: object) -> npt.NDArray[Any]:
    """Return an array, masked if it was; of the type object where it has no regular shape."""
    try:
        return held if isinstance(held, np.ma.MaskedArray) else np.asarray(held)
    except (ValueError, TypeError):
        return np.asarray(None)


def _filled(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Return the array with NaN where it is masked."""
    if isinstance(array, np.ma.MaskedArray):
        return np.asarray(np.ma.filled(array.astype(float), np.nan))
    return array


def _rows(array: npt.NDArray[Any], name: str) -> npt.NDArray[Any]:
    """Return points as rows of x y z, perhaps with an intensity: a view of the array."""
    if array.shape == AMBIGUOUS:
        fact = "an array of the shape (3, 4) may be three points with intensities, or four points"
        raise InputError(f"{name}: {fact}: give (N, 3), rows of x y z, such as its transpose")
    if array.ndim == 3 and array.shape[2] in COLUMNS:
        array = array.reshape(-1, array.shape[2])
    if array.ndim == 2 and array.shape[1] not in COLUMNS and array.shape[0] == 3:
        array = array.T
    if array.ndim != 2 or array.shape[1] not in COLUMNS:
        fact = f"an array of the shape {array.shape} is no cloud of points"
        raise InputError(f"{name}: {fact}: give N rows of x y z, or of x y z and intensity")
    return array
