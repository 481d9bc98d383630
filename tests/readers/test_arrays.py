"""Points in memory as a scan: what is taken, and what is refused in one line."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import open3d
import pandas as pd
import pytest
import trimesh

from wheelplane.errors import InputError
from wheelplane.readers import read_scan, scan_of_points
from wheelplane.readers.arrays import BLOCK_ROWS

POINTS = np.random.default_rng(0).normal(size=(50, 3))
INDEXED = np.column_stack([np.arange(50.0), POINTS])
MASK = np.zeros(POINTS.shape, dtype=bool)
MASK[3, 1] = True


@pytest.mark.parametrize(
    ("given", "wanted"),
    [
        (POINTS, POINTS),
        (POINTS.T, POINTS),
        (np.asfortranarray(POINTS), POINTS),
        (POINTS.reshape(5, 10, 3), POINTS),
        (POINTS[::-1], POINTS[::-1]),
        (POINTS.tolist(), POINTS),
        (tuple(map(tuple, POINTS)), POINTS),
        (POINTS.astype(np.float32), POINTS.astype(np.float32)),
        ((1e3 * POINTS).astype(np.int16), (1e3 * POINTS).astype(np.int16)),
        (np.ma.MaskedArray(POINTS, MASK), np.delete(POINTS, 3, axis=0)),
        (np.where(MASK, np.nan, POINTS), np.delete(POINTS, 3, axis=0)),
        (open3d.geometry.PointCloud(open3d.utility.Vector3dVector(POINTS)), POINTS),
        (open3d.t.geometry.PointCloud(POINTS), POINTS),
        (trimesh.PointCloud(POINTS), POINTS),
        (SimpleNamespace(points=POINTS, vertices=np.arange(9)), POINTS),  # as scipy's ConvexHull
    ],
)
def test_points_of_any_holder_are_copied_once(given, wanted):
    scan = scan_of_points(given)
    assert np.array_equal(scan.points_m, wanted)
    assert scan.points_m.dtype == np.float64
    assert scan.points_m.flags.c_contiguous
    assert scan.invalid_points == len(POINTS) - len(wanted)
    assert scan.intensity is None
    if isinstance(given, np.ndarray):
        assert not np.shares_memory(scan.points_m, given)


SHADE = np.random.default_rng(2).uniform(size=len(POINTS)).astype(np.float32)


def frame(names: str, *columns: np.ndarray) -> pd.DataFrame:
    return pd.DataFrame(np.column_stack(columns), columns=names.split())


@pytest.mark.parametrize(
    "given",
    [
        frame("x y z intensity", POINTS, SHADE),
        frame("I Z Y X", SHADE, POINTS[:, ::-1]),
        frame("id X y Z nx reflectance", np.arange(50), POINTS, SHADE, SHADE),
        frame("northing easting elevation i", POINTS[:, [1, 0, 2]], SHADE),
        frame("z x y label i", POINTS[:, [2, 0, 1]], SHADE, SHADE).astype({"label": str}),
        np.rec.fromarrays([SHADE, *POINTS.T[::-1]], names="intensity,z,y,x"),
        np.rec.fromarrays([*POINTS.T[::-1], SHADE], names="z,y,x,i").reshape(5, 10),
    ],
)
def test_named_columns_are_found_by_name_in_any_order(given):
    scan = scan_of_points(given)
    assert np.array_equal(scan.points_m, POINTS)
    assert np.array_equal(scan.intensity, SHADE)


COLOUR = np.random.default_rng(3).integers(0, 256, (len(POINTS), 3)).astype(np.uint8)


@pytest.mark.parametrize(
    "given",
    [
        frame("x y z red green blue", POINTS, COLOUR),
        frame("b z g y r x", *np.column_stack([COLOUR, POINTS]).T[[2, 5, 1, 4, 0, 3]]),
        np.rec.fromarrays([*COLOUR.T, *POINTS.T], names="red,green,blue,x,y,z"),
    ],
)
def test_without_intensity_the_luminance_of_a_colour_counts_as_of_a_file(given, tmp_path):
    scan, file = scan_of_points(given), tmp_path / "a.xyz"
    rows = [" ".join(map(repr, row)) for row in np.column_stack([POINTS, COLOUR]).tolist()]
    file.write_text("x y z red green blue\n" + "\n".join(rows) + "\n")
    assert np.array_equal(scan.points_m, POINTS)
    assert np.array_equal(scan.intensity, read_scan(file).intensity)
    shaded = scan_of_points(frame("x y z red green blue i", POINTS, COLOUR, SHADE))
    assert np.array_equal(shaded.intensity, SHADE)


def test_columns_that_are_only_counted_are_x_y_z_and_those_without_intensity_have_none():
    class Counted(SimpleNamespace):
        def __array__(self, dtype=None, copy=None):
            return POINTS

    polars = Counted(columns=["column_0", "column_1", "column_2"])
    for given in (pd.DataFrame(POINTS), polars, frame("z y x", POINTS[:, ::-1])):
        scan = scan_of_points(given)
        assert np.array_equal(scan.points_m, POINTS)
        assert scan.intensity is None


def test_named_columns_keep_masks_gaps_and_units():
    masked = np.ma.MaskedArray(
        np.rec.fromarrays(POINTS.T, names="x,y,z"), [tuple(row) for row in MASK]
    )
    gaps = frame("x y z", POINTS).convert_dtypes()
    gaps.loc[3, "y"] = pd.NA
    for given in (masked, gaps):
        assert np.array_equal(scan_of_points(given).points_m, np.delete(POINTS, 3, axis=0))
    in_mm = scan_of_points(frame("x_mm y_mm z_mm", POINTS), "mm")
    assert np.array_equal(in_mm.points_m, scan_of_points(POINTS, "mm").points_m)


def test_three_points_are_rows():
    """The shape (3, 3) fits rows and their transpose: rows are the first of the two forms."""
    assert np.array_equal(scan_of_points(POINTS[:3]).points_m, POINTS[:3])


def test_a_fourth_column_is_the_intensity_and_blocks_join():
    rows = np.random.default_rng(1).normal(size=(2 * BLOCK_ROWS + 7, 4))
    rows[BLOCK_ROWS, 2] = np.nan
    before = rows.copy()
    scan = scan_of_points(rows, "mm")
    kept = np.delete(rows, BLOCK_ROWS, axis=0)
    assert np.allclose(scan.points_m, kept[:, :3] / 1e3, rtol=1e-15)
    assert np.array_equal(scan.intensity, kept[:, 3].astype(np.float32))
    assert np.array_equal(rows, before, equal_nan=True)


def test_missing_returns_are_dropped_as_of_files():
    rows = np.vstack([POINTS, np.zeros((40, 3))])
    assert scan_of_points(rows).invalid_points == 40


def test_an_unknown_unit_is_one_line():
    with pytest.raises(InputError, match="'km' is unknown"):
        scan_of_points(POINTS, "km")


def test_a_cloud_without_points_of_another_library_is_no_cloud():
    with pytest.raises(InputError, match="a SimpleNamespace of the type object"):
        scan_of_points(SimpleNamespace(points=None))


@pytest.mark.parametrize(
    ("points", "says"),
    [
        (None, "a NoneType"),
        (np.zeros((5, 2)), r"shape \(5, 2\)"),
        (np.zeros((5, 7)), r"shape \(5, 7\)"),
        ([[1, 2, 3], [4]], "a list"),
        (np.array([["a", "b", "c"]]), "type <U1"),
        (np.zeros((4, 3), dtype=complex), "type complex128"),
        (np.full((4, 3), np.inf), "all its 4 points are invalid"),
        (np.full((4, 3), np.nan), "all its 4 points are invalid"),
        (np.full((4, 3), 3e11), "beyond any site"),
        (np.zeros((0, 3)), "0 points"),
        (INDEXED, "counts the rows.*: give a data frame with the columns -,x,y,z or"),
        (np.zeros((3, 4)), r"shape \(3, 4\) may be three points .*: give \(N, 3\)"),
        (frame("a b c", POINTS), "x is missing among the columns a, b, c: name the columns"),
        (frame("x y x", POINTS), "x is there 2 times among the columns x, y, x: "),
        (pd.DataFrame(POINTS)[[2, 1, 0]], "x is missing among the columns 2, 1, 0: "),
        (frame("x y z", POINTS).astype({"y": str}), "the column y is of the type .*: give numbers"),
        (frame("x_mm y_mm z_mm", POINTS), 'state mm, but m is .*: give length_unit="mm"$'),
        (frame("x_cm y_cm z_cm", POINTS), 'state cm, but m is .*: give length_unit="cm"$'),
        (frame("x_nm y_nm z_nm", POINTS), "state nm, but m is .*: give them in m, mm, in, cm, ft$"),
    ],
)
def test_what_is_no_cloud_is_one_clear_line(points, says):
    with pytest.raises(InputError, match=says) as caught:
        scan_of_points(points, name="mine")
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith("mine: ")
