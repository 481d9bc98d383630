"""Blocks of raw columns to one scan: what is common to all formats."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pipeline.readers.faults import fault
from pipeline.readers.raw import Block, RawCloud, Source
from pipeline.readers.scan import Scan

Points = npt.NDArray[np.float64]
Shades = npt.NDArray[np.float32]

UNITS = ("m", "mm", "in")
MAX_COORDINATE_M = 1e10  # float64 still resolves 2 um here


def gather(cloud: RawCloud, source: Source, length_unit: str) -> Scan:
    """Fill the arrays block by block, drop missing returns, and scale to metres.

    Raises InputError for an infinite coordinate, and when no point is left.
    """
    if cloud.rows == 0:
        raise fault(source, "it declares 0 points")
    points = np.empty((cloud.rows, 3))
    intensity = np.empty(cloud.rows, np.float32) if cloud.has_intensity else None
    seen = kept = 0
    # A float64 intensity or a longdouble coordinate may overflow; coordinates are checked below.
    with np.errstate(over="ignore", invalid="ignore"):
        for block in cloud.blocks:
            count = len(block.xyz[0])
            rows = points[kept : kept + count]
            shades = None if intensity is None else intensity[kept : kept + count]
            there = _fill(rows, shades, block, source, seen)
            _to_metres(rows[:there], length_unit)
            _check_size(rows[:there], source, length_unit)
            seen, kept = seen + count, kept + there
    if kept == 0:
        raise fault(source, f"of its {seen} points all are missing returns (NaN)")
    return Scan(
        points_m=points[:kept],
        intensity=None if intensity is None else intensity[:kept],
        source=source.name,
        missing_returns=seen - kept,
    )


def _fill(rows: Points, shades: Shades | None, block: Block, source: Source, first: int) -> int:
    """Copy a block into its place, the points that are there to the front; their number."""
    for axis, column in enumerate(block.xyz):
        rows[:, axis] = column
    if shades is not None:
        shades[:] = block.intensity
    present = _present(rows, source, first)
    if present is None:
        return len(rows)
    kept = int(present.sum())
    rows[:kept] = rows[present]
    if shades is not None:
        shades[:kept] = shades[present]
    return kept


def _present(rows: Points, source: Source, first: int) -> npt.NDArray[np.bool_] | None:
    """Which rows hold a return; None when all do, the usual case, for the price of a sum.

    A sum is finite only if every term is.
    """
    if np.isfinite(rows.sum()):
        return None
    infinite = np.flatnonzero(np.isinf(rows))
    if len(infinite):
        raise fault(source, f"point {first + infinite[0] // 3 + 1} has an infinite coordinate")
    return np.asarray(~np.isnan(rows).any(axis=1))


def _to_metres(rows: Points, length_unit: str) -> None:
    if length_unit == "mm":
        # A division rounds once; 0.001 is not a binary fraction and a product would round twice.
        rows /= 1000.0
    elif length_unit == "in":
        rows *= 0.0254


def _check_size(rows: Points, source: Source, length_unit: str) -> None:
    if len(rows) and max(rows.max(), -rows.min()) > MAX_COORDINATE_M:
        raise fault(
            source,
            f"a coordinate of {np.abs(rows).max():.3g} m is beyond any site",
            f"check the length unit, {length_unit}",
        )
