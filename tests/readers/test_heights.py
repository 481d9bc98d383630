"""Matrices of heights: text, arrays, and the CSV of Gocator; with the pitch stated, or refused."""

from __future__ import annotations

import io

import numpy as np
import pytest

from tests.support.sources import opened
from wheelplane.diagnostics import summarise_scan
from wheelplane.errors import InputError
from wheelplane.readers import ReadOptions, read_scan
from wheelplane.readers.formats.gocator import UNIT, is_gocator
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


@pytest.mark.parametrize("none", ["", "NaN", "N/A", "-99999.9999", "-9999", "99.9999", "1.#QNAN"])
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
    points = np.round(np.random.default_rng(2).normal(0, 9, (3, 4, 3)), 4)
    rows = "".join(",".join(f"{v:.4f}" for v in row.ravel()) + "\n" for row in points)
    values = "0,0,123,3,4,0,0,0"
    data = f"{INFO}SurfacePointCloud\n{NAMES}\n{values}\n0,1,2,3\n{rows}End\n"
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
