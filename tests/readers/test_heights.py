"""Matrices of heights: text, arrays, and the CSV of Gocator; with the pitch stated, or refused."""

from __future__ import annotations

import io

import numpy as np
import pytest

from tests.support.sources import opened
from wheelplane.diagnostics import summarise_scan
from wheelplane.errors import InputError
from wheelplane.readers import ReadOptions, read_scan
from wheelplane.readers.formats import npy as npy_format
from wheelplane.readers.formats.gocator import UNIT, is_gocator
from wheelplane.readers.parsing import lines as text_lines
from wheelplane.readers.parsing.heights import Heights, stated_heights

ROWS, COLUMNS = 7, 16
PITCH = (0.05, 0.2)
HEIGHTS = np.round(np.random.default_rng(5).normal(-1.0, 0.3, (ROWS, COLUMNS)), 4)


def expected(heights=HEIGHTS, pitch=PITCH):
    row, column = np.mgrid[: heights.shape[0], : heights.shape[1]]
    points = np.stack([column * pitch[0], row * pitch[1], heights], axis=-1).reshape(-1, 3)
    return points[np.isfinite(points[:, 2])]


def matrix(delimiter=",", heights=HEIGHTS, none="", end=""):
    cells = [[none if np.isnan(z) else f"{z:.4f}" for z in row] for row in heights]
    return "".join(delimiter.join(row) + end + "\n" for row in cells)


def holed(value=np.nan):
    heights = HEIGHTS.copy()
    heights[0, :3] = heights[4, 5] = heights[6, 15] = value
    return heights


def read(folder, data, name="rr.csv", pitch=PITCH, unit="m"):
    path = folder / name
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    return read_scan(path, unit, name, ReadOptions(pitch=pitch))


def refuse(folder, data, pattern, name="rr.csv", pitch=None, unit="m"):
    with pytest.raises(InputError, match=pattern) as caught:
        read(folder, data, name, pitch, unit)
    assert str(caught.value).startswith(f"{name}: ")
    assert len(str(caught.value).splitlines()) == 1


@pytest.mark.parametrize("delimiter", [",", ";", "\t", " "])
@pytest.mark.parametrize("head", ["", "Height\n", "Model,LJ-X8000\nPoints: 112\n"])
@pytest.mark.parametrize("end", ["", ","])
def test_a_matrix_is_read_by_its_pitch(tmp_path, delimiter, head, end):
    scan = read(tmp_path, head + matrix(delimiter, end=end and delimiter.strip(" ")))
    assert scan.points_m.tolist() == expected().tolist()
    assert scan.grid.tolist() == [[r, c] for r in range(ROWS) for c in range(COLUMNS)]
    assert scan.intensity is None


@pytest.mark.parametrize("delimiter", [",", ";", "\t", " "])
def test_without_a_pitch_it_is_refused_and_never_taken_for_x_y_z(tmp_path, delimiter):
    says = r"line 1 has 16 columns without names: .* give --pitch DX,DY if they are a matrix of hei"
    refuse(tmp_path, matrix(delimiter), says)
    refuse(tmp_path, "LJ-X8000\n" + matrix(delimiter), says.replace("line 1", "line 2"))


def test_any_pitch_scales_and_mirrors(tmp_path):
    for pitch in ((1.0, -0.5), (-2.5, 1e-3)):
        scan = read(tmp_path, matrix(), pitch=pitch)
        assert scan.points_m.tolist() == expected(pitch=pitch).tolist()
    in_mm = read(tmp_path, matrix(), unit="mm")
    assert in_mm.points_m.tobytes() == (expected() / 1000).tobytes()


NONES = ["", "NaN", "N/A", "-99999.9999", "-9999", "99.9999", "1.#QNAN", "-32768", "-2147483648"]


@pytest.mark.parametrize("none", NONES)
def test_missing_heights_are_missing_returns(tmp_path, none):
    """Keyence writes -99999.9999, Gocator an empty cell."""
    scan = read(tmp_path, matrix(heights=holed(), none=none))
    assert scan.invalid_points == 5
    assert scan.points_m.tolist() == expected(holed()).tolist()
    assert not (scan.points_m[:, 2] < -5).any()


def test_a_height_of_nines_among_others_is_a_height(tmp_path):
    heights = HEIGHTS.copy()
    heights[2, 2] = 0.9999  # of its row's middle: neither lowest nor highest
    heights[3, 3] = -99999.9998
    scan = read(tmp_path, matrix(heights=heights))
    assert scan.invalid_points == 0


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_greatest_height_is_no_mark_for_its_digits(tmp_path, sign):
    """A surface of up to 9.999 is read whole; one far from 9.999 has marks there."""
    heights = sign * np.round(9.9 + 0.09 * np.random.default_rng(2).uniform(size=HEIGHTS.shape), 4)
    heights[2, 2:5] = sign * 9.999
    scan = read(tmp_path, matrix(heights=heights))
    assert scan.invalid_points == 0
    assert scan.points_m.tolist() == expected(heights).tolist()
    heights -= sign * 5.0
    heights[2, 2:5] = sign * 9.999
    assert read(tmp_path, matrix(heights=heights)).invalid_points == 3


def test_marks_at_both_ends_are_marks(tmp_path):
    heights = HEIGHTS.copy()
    heights[1, 3], heights[4, 4:6] = 99999.9999, -99999.9999
    assert read(tmp_path, matrix(heights=heights)).invalid_points == 3


@pytest.mark.parametrize(
    ("head", "pitch", "unit"),
    [
        ("X pitch,0.05\nY pitch,0.2\n", PITCH, "m"),
        ("X pitch,0.05,mm\nY pitch,0.2,mm\n", PITCH, "mm"),
        ("XPitch = 50 µm\nYPitch = 200 µm\nUnit: mm\n", PITCH, "mm"),
        ('"XY calibration","2.5","um/pixel"\n"Unit","mm"\n', (0.0025, 0.0025), "mm"),
        ("# X resolution: 0.05 mm\n# Y resolution: 0.2 mm\n", PITCH, "mm"),
        ("ncols 16\nnrows 7\nxllcorner 5.0\nyllcorner 6.0\ncellsize 0.2\n", (0.2, -0.2), "m"),
    ],
)
def test_the_pitch_of_a_header_is_used(tmp_path, head, pitch, unit):
    scan = read(tmp_path, head + matrix(), pitch=None, unit=unit)
    scale = 1e3 if unit == "mm" else 1.0
    np.testing.assert_allclose(scan.points_m, expected(pitch=pitch) / scale, rtol=1e-12, atol=0)
    if unit == "mm":
        refuse(tmp_path, head + matrix(), "the file states lengths in mm, but they would be taken")


def test_few_columns_below_a_pitch_need_a_word(tmp_path):
    few = "X pitch,0.05\nY pitch,0.2\n" + matrix(heights=HEIGHTS[:, :4])
    refuse(tmp_path, few, "line 3 has 4 columns below a pitch: .* else name them by --columns")
    scan = read(tmp_path, few)
    assert scan.points_m.tolist() == expected(HEIGHTS[:, :4]).tolist()


def test_esri_nodata_and_the_northern_row_first(tmp_path):
    head = "NCOLS 16\nNROWS 7\nXLLCENTER 5.0\nYLLCENTER 6.0\nCELLSIZE 0.5\nNODATA_VALUE -5\n"
    scan = read(tmp_path, head + matrix(" ", holed(), "-5"), "rr.asc", pitch=None)
    assert scan.invalid_points == 5
    assert scan.points_m[-1, 1] == -3.0


def test_a_row_of_positions_is_no_row_of_heights(tmp_path):
    positions = ",".join(f"{0.05 * k:.4f}" for k in range(COLUMNS)) + "\n"
    refuse(tmp_path, positions + matrix(), "first row of its heights rises in equal", pitch=PITCH)
    refuse(tmp_path, ",".join(map(str, range(COLUMNS))) + "\n" + matrix(), "rises", pitch=PITCH)
    ramp = np.add.outer(np.arange(ROWS), 0.5 * np.arange(COLUMNS))
    assert len(read(tmp_path, matrix(heights=ramp)).points_m) == ramp.size


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (matrix() + "1,2,3\n", "line 8 has 3 columns instead of 16"),
        (matrix().replace("\n", "x\n", 1), "line 1 holds"),
        ("9\n" + matrix(), "declares 9 points, the file holds 7"),
    ],
)
def test_a_damaged_matrix_is_refused(tmp_path, text, says):
    refuse(tmp_path, text, says, pitch=PITCH)


@pytest.mark.parametrize("kind", ["<f4", ">f8", "<i2", "<u2"])
@pytest.mark.parametrize("order", "CF")
@pytest.mark.parametrize("name", ["rr.npy", "rr.npz"])
def test_an_array_of_heights(tmp_path, kind, order, name):
    heights = np.asarray(np.round(HEIGHTS * -100), dtype=kind, order=order)
    stream = io.BytesIO()
    if name.endswith("npy"):
        np.save(stream, heights)
    else:
        np.savez(stream, depth=heights)
    scan = read(tmp_path, stream.getvalue(), name)
    assert scan.points_m.tolist() == expected(heights.astype(float)).tolist()
    refuse(tmp_path, stream.getvalue(), r"shape '\(7, 16\)': .* give --pitch DX,DY", name)


INFO = "Info\nCSV Version,Sensor Count,Trigger Mode\n2,1,0\nEnd\nDeviceInfo\nID,Model\n1,2\nEnd\n"
INFO += "Ranges\nFrame,Source,Range\n0,0,1.25\nEnd\n"
NAMES = "Frame,Source,Time,Row Count,Column Count,X Offset,Y Offset,Z Offset"


def gocator_surface(heights=HEIGHTS, section="Part", corner="Y\\X"):
    x, y = PITCH[0] * np.arange(COLUMNS), PITCH[1] * np.arange(ROWS)
    top = ",".join([corner, *(f"{v:.5f}" for v in x)])
    body = "".join(
        f"{v:.5f},{row}\n" for v, row in zip(y, matrix(heights=heights).splitlines(), strict=True)
    )
    values = f"0,0,123,{ROWS},{COLUMNS},0,0,0"
    return f"{INFO}{section}\n{NAMES}\n{values}\n{top}\n{body}End\n"


def gocator_cloud():
    points = np.round(np.random.default_rng(2).normal(0, 9, (3, 4, 3)), 4)
    rows = "".join(",".join(f"{v:.4f}" for v in row.ravel()) + "\n" for row in points)
    values = "0,0,123,3,4,0,0,0"
    return points, f"{INFO}SurfacePointCloud\n{NAMES}\n{values}\n0,1,2,3\n{rows}End\n"


@pytest.mark.parametrize("section", ["Part", "Surface"])
@pytest.mark.parametrize("corner", ["", "Y\\X"])
def test_a_surface_of_gocator(tmp_path, section, corner):
    data = gocator_surface(holed(), section, corner)
    scan = read(tmp_path, data, pitch=None, unit="mm")
    np.testing.assert_allclose(scan.points_m, expected(holed()) / 1e3, rtol=1e-12, atol=0)
    assert scan.invalid_points == 5
    refuse(tmp_path, data, "the file states lengths in mm, but they would be taken as m")
    crlf = data.replace("\n", "\r\n").encode()
    assert read(tmp_path, crlf, pitch=None, unit="mm").points_m.tobytes() == scan.points_m.tobytes()


def test_a_cloud_of_gocator(tmp_path):
    points, data = gocator_cloud()
    scan = read(tmp_path, data, pitch=None, unit="mm")
    assert scan.points_m.tobytes() == (points.reshape(-1, 3) / 1e3).tobytes()


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("Part\n", "Profile\n", "no section Part or Surface"),
        (f",{ROWS},{COLUMNS},", f",x,{COLUMNS},", "row count 'x'"),
        (f",{ROWS},{COLUMNS},", f",{ROWS},15,", "16 positions of x, 15 columns are declared"),
        (f",{ROWS},{COLUMNS},", f",9,{COLUMNS},", "."),
        (f",{ROWS},{COLUMNS},", f",6,{COLUMNS},", "declares 6 rows, and .* follows, not End"),
        ("\n0.20000,", "\nx.20000,", "line 18 holds 'x.20000'"),
        ("End\n", "", "."),
        (f",{ROWS},{COLUMNS},", f",5000,{COLUMNS},", "declares 80000 points, and for their bytes"),
    ],
)
def test_a_damaged_file_of_gocator_is_refused(tmp_path, old, new, says):
    data = gocator_surface()
    head, _, tail = data.rpartition(old) if old == "End\n" else data.partition(old)
    refuse(tmp_path, head + new + tail, says, unit="mm")


def test_gocator_is_known_by_its_first_lines(tmp_path):
    assert UNIT == "mm"
    for data, expected in ((INFO, True), (INFO.replace("\n", "\r\n"), True), (matrix(), False)):
        with opened(tmp_path, data.encode()) as source:
            assert is_gocator(source) == expected
            assert source.stream.tell() == 0


def test_only_a_pitch_along_both_axes_is_a_pitch():
    assert stated_heights([]) is None
    assert stated_heights(["X pitch 0.05", "scan speed 3"]) is None
    assert stated_heights(["X pitch: 0", "Y pitch: 1"]) is None
    assert stated_heights(["x pitch 1e-3 m", "y pitch 1 mm"]) == Heights((1e-3, 1e-3), "m")
    assert stated_heights(["pixel size; 0.5"]) == Heights((0.5, 0.5))


def test_inspect_shows_the_raster(tmp_path):
    path = tmp_path / "rr.csv"
    path.write_text(matrix())
    summary = summarise_scan(path, "mm", options=ReadOptions(pitch=PITCH))
    assert summary.raster == (ROWS, COLUMNS)
    assert summary.points == HEIGHTS.size


@pytest.mark.parametrize("piece", [1, 200, 1 << 19])
def test_the_raster_of_gocator_is_the_same_in_pieces_of_any_size(tmp_path, monkeypatch, piece):
    monkeypatch.setattr(text_lines, "_PIECE", piece)
    surface = read(tmp_path, gocator_surface(), pitch=None, unit="mm")
    assert surface.grid.tolist() == [[r, c] for r in range(ROWS) for c in range(COLUMNS)]
    cloud = read(tmp_path, gocator_cloud()[1], pitch=None, unit="mm")
    assert cloud.grid.tolist() == [[r, c] for r in range(3) for c in range(4)]


def test_what_follows_the_end_of_gocator_s_surface_is_no_matter(tmp_path):
    for data in (gocator_surface(), gocator_cloud()[1]):
        alone = read(tmp_path, data, pitch=None, unit="mm").points_m
        more = read(tmp_path, f"{data}Profile\n1,2\nEnd\n", pitch=None, unit="mm").points_m
        assert more.tobytes() == alone.tobytes()


def test_a_surface_of_gocator_that_ends_early_or_has_a_wrong_row_is_refused(tmp_path):
    rows = gocator_surface().splitlines(keepends=True)
    refuse(tmp_path, "".join(rows[:-2]), f"declares {ROWS} rows, the file holds 6", unit="mm")
    rows = gocator_cloud()[1].splitlines(keepends=True)
    refuse(tmp_path, "".join(rows[:-2]), "declares 3 rows, the file holds 2", unit="mm")
    number = len(rows) - 1  # the last row, above End
    rows[number - 1] = "x" + rows[number - 1]
    refuse(tmp_path, "".join(rows), f"line {number} holds 'x", unit="mm")


@pytest.mark.parametrize("chunk", [1, 100, 1 << 20])
@pytest.mark.parametrize("heights", [HEIGHTS, HEIGHTS.T])
def test_an_array_of_heights_is_the_same_in_chunks_of_any_size(
    tmp_path, monkeypatch, chunk, heights
):
    monkeypatch.setattr(npy_format, "CHUNK_BYTES", chunk)
    np.save(tmp_path / "rr.npy", heights)
    scan = read_scan(tmp_path / "rr.npy", options=ReadOptions(pitch=PITCH))
    assert scan.points_m.tolist() == expected(heights).tolist()
    assert scan.grid.tolist() == [list(at) for at in np.ndindex(heights.shape)]
    assert scan.intensity is None


@pytest.mark.parametrize(
    ("one", "other"),
    [
        *(("1 m", "100 cm"), ("1 cm", "10 mm"), ("1 mm", "1000 µm"), ("1 µm", "1000 nm")),
        *(("1 in", "25.4 mm"), ("1 ft", "12 in"), ("0.3048 m", "1 ft")),
    ],
)
def test_pitches_in_different_units_are_in_that_of_x(one, other):
    for x, y in ((one, other), (other, one)):
        found = stated_heights([f"x pitch {x}", f"y pitch {y}"])
        assert found.pitch == pytest.approx((float(x.split()[0]),) * 2, rel=1e-12)
        assert found.unit == x.split()[1]


@pytest.mark.parametrize("value", [-99999.9999, -9999.0, -32768.0, -2147483648.0, 0.0, 1.5])
def test_a_row_of_one_value_is_no_row_of_positions(tmp_path, value):
    """The first row of a profiler is often without heights: all of it is a mark."""
    heights = HEIGHTS.copy()
    heights[0] = value
    scan = read(tmp_path, matrix(heights=heights))
    missing = COLUMNS if value < -2.0 else 0
    assert scan.points_m.tolist() == expected(heights)[missing:].tolist()
    assert scan.invalid_points == missing
    positions = ",".join(f"{0.05 * k:.4f}" for k in range(COLUMNS)) + "\n"
    refuse(tmp_path, positions + matrix(heights=heights), "rises in equal steps", pitch=PITCH)


@pytest.mark.parametrize(
    ("rows", "columns", "positions"),
    [(1, 16, False), (2, 16, True), (2, 8, True), (2, 7, False), (9, 8, True)],
)
def test_positions_are_known_by_two_rows_of_eight(tmp_path, rows, columns, positions):
    heights = np.vstack([0.05 * np.arange(columns), HEIGHTS[:1, :columns].repeat(rows - 1, 0)])
    heights[1:] += np.round(np.random.default_rng(1).normal(0.0, 0.1, (rows - 1, columns)), 4)
    if positions:
        refuse(tmp_path, matrix(heights=heights), "rises in equal steps", pitch=PITCH)
    else:
        assert len(read(tmp_path, matrix(heights=heights)).points_m) == heights.size


def test_a_surface_that_is_tilted_or_falls_in_equal_steps_is_read(tmp_path):
    ramp = 0.05 * np.arange(COLUMNS)
    for heights in (np.tile(ramp, (3, 1)), np.vstack([ramp[::-1], HEIGHTS])):
        assert len(read(tmp_path, matrix(heights=heights)).points_m) == heights.size


def test_a_pitch_without_a_unit_is_in_that_of_the_file():
    assert stated_heights(["x pitch 1 mm", "y pitch 2"]) == Heights((1.0, 2.0), "mm")
    assert stated_heights(["Unit: mm", "x pitch 1", "y pitch 2"]) == Heights((1.0, 2.0), "mm")
    assert stated_heights(["Unit: mm", "x pitch 1 cm", "y pitch 2"]).pitch == (10.0, 2.0)


def test_steps_that_are_nearly_equal_are_a_slope(tmp_path):
    """Steps of 0.05 that differ by a tenth, above and below a row of equal ones."""
    ramp = 0.05 * np.arange(COLUMNS)
    rough = ramp + np.where(np.arange(COLUMNS) % 2, 0.005, 0.0)
    refuse(tmp_path, matrix(heights=np.array([ramp, rough])), "rises in equal steps", pitch=PITCH)
    read(tmp_path, matrix(heights=np.array([rough, ramp])))
    read(tmp_path, matrix(heights=np.array([rough, HEIGHTS[0]])))
