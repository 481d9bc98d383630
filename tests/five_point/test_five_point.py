"""The paper's file and numbers: reading, total least squares, the software of 2013, its texts."""

import csv
import math
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.support.batches import call
from tests.support.paths import DATA
from wheelplane.diagnostics.plausibility import COMMON_UNITS, length
from wheelplane.diagnostics.selftest import certified_folder
from wheelplane.errors import InputError
from wheelplane.five_point.file import read_five_point
from wheelplane.five_point.fit_block import fit_block
from wheelplane.five_point.measure import measure_five_point
from wheelplane.five_point.tcgc_2013 import tcgc_2013
from wheelplane.plane.least_squares import total_least_squares
from wheelplane.report.format.view import View
from wheelplane.report.text.report import detailed_report, summary_table
from wheelplane.report.text.tcgc_2013 import tcgc_2013_text
from wheelplane.units import LENGTH_UNITS, in_metres
from wheelplane.vehicle.angles import WheelAngles, nearest_wheel, wheel_angles
from wheelplane.vehicle.frame import REFERENCE_WHEELS, build_reference_frame

PAPER = DATA / "paper"
SECOND = math.radians(1 / 3600)
RIGHT = ("RR", "FR")
SWAP = {"RR": "RL", "RL": "RR", "FR": "FL", "FL": "FR"}

# PAPER.md: azimuth and elevation (down positive) of the normal that points to the left.
LEFT_POINTING = """
RR +00°19'40.7" -01°40'11.5"
RL +00°25'10.4" +01°11'29.6"
FR +00°15'09.6" +00°12'26.4"
FL +00°23'21.6" +00°53'03.0"
RL +01°30'52.1" +01°20'49.1"
RL -00°58'13.4" +01°24'29.8"
RR +00°19'10.9" -00°03'58.9"
RR +00°33'07.8" +02°59'47.2"
"""


def seconds(text: str) -> float:
    sign, degrees, minutes, rest = re.fullmatch(r"([+-]) ?(\d+)°(\d+)'([\d.]+)\"", text).groups()
    return float(f"{sign}1") * (3600 * int(degrees) + 60 * int(minutes) + float(rest))


def figure_4() -> np.ndarray:
    return read_five_point(PAPER / "figure-4.txt").blocks_m


def measure(blocks: np.ndarray) -> tuple[list[str], list[WheelAngles]]:
    fits = [fit_block(block) for block in blocks]
    centres = np.array([fit.centre_m for fit in fits])
    frame = build_reference_frame(centres[:4])
    wheels = [*REFERENCE_WHEELS, *(nearest_wheel(centres[:4], c) for c in centres[4:])]
    pairs = zip(fits, wheels, strict=True)
    return wheels, [wheel_angles(frame, fit.normal, wheel) for fit, wheel in pairs]


def table(angles: list[WheelAngles]) -> np.ndarray:
    return np.array([[a.toe_rad, a.camber_rad, a.camber_iso_rad] for a in angles])


def resolution_rad(blocks: np.ndarray) -> float:
    """Most that float64 coordinates turn a plane or the frame: half a step on the short lever."""
    half_step = np.sqrt(3) * np.spacing(np.abs(blocks).max()) / 2
    centred = blocks - blocks.mean(axis=1, keepdims=True)
    lever = np.linalg.svd(centred, compute_uv=False)[:, 1].min() / np.sqrt(5)
    return 8 * half_step / lever


def test_total_least_squares_gives_the_reference_table():
    """For right wheels both signs flip: the outward normal is minus the left-pointing one.

    n_out = -n_left: n_out.forward = -n_left.forward against the same n_out.outward, so toe =
    -azimuth; camber = -asin(n_out.up) = asin(n_left.up) = -elevation along w, as w = -up. For left
    wheels n_out = n_left: toe = azimuth, camber = -asin(n.up) = elevation along w.
    """
    wheels, angles = measure(figure_4())
    rows = [line.split() for line in LEFT_POINTING.split("\n") if line]
    for (expected_wheel, *texts), wheel, angle in zip(rows, wheels, angles, strict=True):
        sign = -1 if wheel in RIGHT else 1
        assert wheel == expected_wheel
        # half of the last printed digit, 0.1", and rounding
        assert sign * angle.toe_rad / SECOND == pytest.approx(seconds(texts[0]), abs=0.0501)
        assert sign * angle.camber_rad / SECOND == pytest.approx(seconds(texts[1]), abs=0.0501)
        assert abs(angle.toe_rad) > 100 * SECOND


def test_sample_has_the_printed_sizes():
    frame = build_reference_frame(figure_4().mean(axis=1)[:4])
    sizes = (frame.rear_track_m, frame.front_track_m, frame.wheelbase_m)
    assert [f"{size:.5f}" for size in sizes] == ["1.36527", "1.34236", "1.52220"]


def test_report_of_2013_angle_by_angle():
    result = tcgc_2013(figure_4(), "report")
    printed = (PAPER / "printed-report.txt").read_text("utf-8").split("\n")
    rows = [re.findall(r"[+-] \d+°\d+'\d+\"", line) for line in printed if "°" in line]
    expected = np.array([[seconds(toe), seconds(camber)] for toe, camber in rows])
    computed = np.column_stack([result.toe_rad, result.camber_rad]) / SECOND
    assert expected.shape == (8, 2)
    assert np.abs(computed - expected).max() < 13
    other = tcgc_2013(figure_4(), "matrix")
    assert np.abs(np.column_stack([other.toe_rad, other.camber_rad]) / SECOND - expected).max() > 60


def test_matrix_of_2013_angle_by_angle():
    result = tcgc_2013(figure_4(), "matrix")
    with (PAPER / "printed-matrix-1.csv").open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(line for line in stream if not line.startswith("#")))
    expected = []
    for row in rows:
        for angle in ("toe", "camber"):
            parts = [float(row[f"{angle}_{unit}"]) for unit in ("deg", "min", "sec")]
            sign = -1 if min(parts) < 0 else 1
            expected.append(sign * np.abs(parts) @ [3600, 60, 1])
    computed = np.column_stack([result.toe_rad, result.camber_rad]).ravel() / SECOND
    assert len(expected) == 16
    assert np.abs(computed - expected).max() < 13
    proper = tcgc_2013(figure_4()[[2, 3, 0, 1, 4, 5, 6, 7]], "report")  # not transposed
    proper_camber = proper.camber_rad[[2, 3, 0, 1, 4, 5, 6, 7]] / SECOND
    assert np.abs(proper_camber - expected[1::2]).max() > 1000


def test_report_of_2013_prints_the_geometry_to_every_digit():
    """Zeros are printed as -0.000 or +0.000 by rounding alone, so their sign is not compared."""
    printed = (PAPER / "printed-report.txt").read_text("utf-8").replace("-0.000", "+0.000")
    text = tcgc_2013_text(tcgc_2013(figure_4(), "report"))
    head = printed.split("TD")[0]
    assert "eixo impulso [-0.289;0.957;0.00909]" in head
    assert text.split("TD")[0] == head
    assert [line.split()[0] for line in text.split("TD")[1].split("\n")[1:8]] == [
        "TE", "FD", "FE", "1", "2", "3", "4"
    ]  # fmt: skip
    assert tcgc_2013(figure_4(), "report").frame.front_track_m == pytest.approx(1.36527, abs=5e-6)


def test_matrix_of_2013_prints_the_sign_once():
    rows = tcgc_2013_text(tcgc_2013(figure_4(), "matrix")).split("\n")
    assert rows[5].split()[:2] == ["0", "-58"]
    assert len(rows[:-1]) == 8


def test_regression_of_an_upright_plane_is_refused():
    blocks = figure_4()[[2, 3, 0, 1, 4]]  # the variant takes blocks 3 and 4 as the rear axle
    frame = build_reference_frame(blocks.mean(axis=1)[[2, 3, 0, 1]])
    phase = 2 * np.pi * np.arange(5) / 5
    ring = 0.1 * np.column_stack([np.zeros(5), np.cos(phase), np.sin(phase)])
    blocks[4] = frame.origin_m + ring @ frame.R_vehicle_scanner
    with pytest.raises(InputError, match=r"block 5: its x and y lie on one line"):
        tcgc_2013(blocks, "report")


def turned_blocks(rng: np.random.Generator) -> tuple[np.ndarray, list[tuple[float, float]]]:
    """Exact five-point rings on wheels of known toe and camber: tilted, then steered and posed."""
    centres = [[0, -0.7, 0], [0, 0.7, 0], [2.6, -0.7, 0], [2.6, 0.7, 0], [0.02, -0.71, 0.01]]
    blocks, truth = [], []
    for wheel, centre in zip((*REFERENCE_WHEELS, "RR"), centres, strict=True):
        toe, camber = rng.uniform(-0.05, 0.05, 2)
        side = -1 if wheel in RIGHT else 1
        pose = Rotation.from_rotvec([0, 0, -side * toe]) * Rotation.from_rotvec(
            [-side * camber, 0, 0]
        )
        phase = 2 * np.pi * (np.arange(5) / 5 + rng.random())
        ring = 0.088 * np.column_stack([np.cos(phase), np.zeros(5), np.sin(phase)])
        blocks.append(pose.apply(ring) + centre)
        truth.append((toe, camber))
    pose = Rotation.random(rng=rng)
    return np.array([pose.apply(block) for block in blocks]), truth


@pytest.mark.parametrize("seed", range(10))
def test_exact_planes_give_exact_angles(seed):
    blocks, truth = turned_blocks(np.random.default_rng(seed))
    wheels, angles = measure(blocks)
    assert wheels == [*REFERENCE_WHEELS, "RR"]
    np.testing.assert_allclose(table(angles)[:, :2], truth, rtol=0, atol=1e-12)
    assert np.abs(truth).max() > 1e-3  # zeros would not pass


@pytest.mark.parametrize("seed", range(5))
def test_turn_shift_and_order_of_points_change_nothing(seed):
    rng = np.random.default_rng(seed)
    blocks, before = figure_4(), table(measure(figure_4())[1])
    shuffled = rng.permuted(np.broadcast_to(np.arange(5), (8, 5)), axis=1)
    moved = np.take_along_axis(blocks, shuffled[:, :, None], axis=1)
    turn = Rotation.random(rng=rng)
    near = turn.apply(moved.reshape(-1, 3) - [95, 98, 51]).reshape(-1, 5, 3)
    far = near + rng.uniform(-1, 1, 3) * 1e7
    for other in (moved, near, far):
        after = table(measure(other)[1])
        assert np.abs(after - before).max() < resolution_rad(other) + resolution_rad(blocks)
    assert resolution_rad(far) < 0.1 * np.abs(before).max()


def test_mirrored_vehicle_has_the_same_toe_and_camber():
    blocks = figure_4()
    order = [1, 0, 3, 2, 4, 5, 6, 7]
    mirrored = (blocks * [1, -1, 1])[order]
    wheels, angles = measure(blocks)
    other_wheels, other_angles = measure(mirrored)
    assert [other_wheels[i] for i in order] == [SWAP[wheel] for wheel in wheels]
    tolerance = 2 * resolution_rad(blocks)
    np.testing.assert_allclose(table(other_angles)[order], table(angles), rtol=0, atol=tolerance)
    assert np.abs(table(measure(blocks * [1, -1, 1])[1]) - table(angles)).max() > 100 * SECOND


@pytest.mark.parametrize("number", range(1, 31))
def test_planes_certified_by_nist(number):
    file = certified_folder() / "nist" / "plane" / f"pla{number}.ds"
    points = np.loadtxt(file, skiprows=1)
    certified = np.loadtxt(file.with_suffix(".fit"))
    plane = total_least_squares(points)
    centroid, axes = plane.centroid_m, plane.basis[::-1]
    normal = certified[3:] / np.linalg.norm(certified[3:])
    across = np.linalg.norm(np.cross(axes[0], normal))
    # 1e-8", or what rounding of the decimal coordinates to float64 turns the plane by
    lever = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)[1] / np.sqrt(len(points))
    rounding = np.spacing(np.abs(points).max()) / 2 / lever
    assert np.arctan2(across, abs(axes[0] @ normal)) < max(1e-8 * SECOND, 3 * rounding)
    assert abs((centroid - certified[:3]) @ normal) < 1e-12 * np.abs(points).max()
    assert np.linalg.norm(np.cross(axes[1], normal)) > 0.9  # another axis would not pass


def test_block_fit_holds_its_evidence():
    rng = np.random.default_rng(2)
    points = figure_4()[0] + rng.normal(0, 1e-4, (5, 3))
    fit = fit_block(points)
    residuals = points @ fit.normal + fit.offset_m
    assert residuals.mean() == pytest.approx(0, abs=1e-12)
    assert fit.rms_m == pytest.approx(np.sqrt(np.mean(residuals**2)), rel=1e-9)
    assert fit.rms_m > 1e-5
    singular = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)[::-1]
    np.testing.assert_allclose(fit.scatter_m2, singular**2, rtol=1e-9)
    assert fit.normal[np.abs(fit.normal).argmax()] > 0


@pytest.mark.slow
def test_scatter_gives_the_covariance_of_the_normal():
    """Tilt towards axes[i] is sigma/sqrt(scatter[i]): 20,000 draws, 0.5 % of standard error."""
    rng = np.random.default_rng(7)
    exact = fit_block(turned_blocks(rng)[0][0])
    points, sigma = turned_blocks(np.random.default_rng(7))[0][0], 1e-5
    tilts = [
        exact.axes[1:] @ fit_block(points + rng.normal(0, sigma, (5, 1)) * exact.normal).normal
        for _ in range(20_000)
    ]
    expected = sigma / np.sqrt(exact.scatter_m2[1:])
    np.testing.assert_allclose(np.std(tilts, axis=0), expected, rtol=4 * 0.005)


ROWS = (PAPER / "figure-4.txt").read_text("ascii").split()


def edited(number: int, row: str) -> bytes:
    return "\n".join([*ROWS[: number - 1], row, *ROWS[number:]]).encode()


GOOD = {
    "commas": "\n".join(ROWS),
    "end of line": "\n".join(ROWS) + "\n",
    "blank end": "\n".join(ROWS) + "\n\n \t\n",
    "windows": "\r\n".join(ROWS) + "\r\n",
    "old mac": "\r".join(ROWS),
    "byte order mark": "\ufeff" + "\n".join(ROWS),
    "spaces": "\n".join("  " + row.replace(",", "   ") + " " for row in ROWS),
    "tabs": "\n".join(row.replace(",", "\t") for row in ROWS),
    "comma and space": "\n".join(row.replace(",", " , ") for row in ROWS),
    "exponents": "\n".join(",".join(f"{float(x):+.8E}" for x in row.split(",")) for row in ROWS),
}


@pytest.mark.parametrize("name", GOOD)
def test_tolerated_forms_read_alike(tmp_path, name):
    path = tmp_path / "five.txt"
    path.write_bytes(GOOD[name].encode())
    read = read_five_point(path)
    np.testing.assert_array_equal(read.blocks_m, np.loadtxt(ROWS, delimiter=",").reshape(8, 5, 3))
    assert read.source == str(path)
    assert read.notes == ()


@pytest.mark.parametrize(
    ("unit", "metres"), [("mm", 1e-3), ("in", 0.0254), ("cm", 1e-2), ("ft", 0.3048)]
)
def test_length_unit(tmp_path, unit, metres):
    path = tmp_path / "five.txt"
    np.savetxt(path, figure_4().reshape(-1, 3) / metres, fmt="%.17g", delimiter=" ")
    blocks = read_five_point(path, length_unit=unit).blocks_m
    np.testing.assert_allclose(blocks, figure_4(), rtol=1e-15)


@pytest.mark.parametrize("size_m", [1.25, 2.04, 12.0])
@pytest.mark.parametrize("written", COMMON_UNITS)
@pytest.mark.parametrize("read", COMMON_UNITS)
def test_a_vehicle_of_any_size_in_another_unit_is_refused(tmp_path, size_m, written, read):
    """From a kart to a long lorry; the message names the distance as read and the right unit."""
    path = tmp_path / "five.txt"
    centres = figure_4()[:4].mean(axis=1)
    blocks = figure_4()
    blocks[:4] += (size_m / 2.0417 - 1.0) * (centres - centres[0])[:, None]
    np.savetxt(path, blocks.reshape(-1, 3) / in_metres(1.0, written), fmt="%.9f", delimiter=",")
    if read == written:
        assert len(read_five_point(path, length_unit=read).blocks_m) == 8
        return
    far = length(size_m * in_metres(1.0, read) / in_metres(1.0, written))
    with pytest.raises(InputError) as caught:
        read_five_point(path, name="five.txt", length_unit=read)
    found = re.match(
        r"five.txt: the wheel centres lie up to (\S+) (\S+) apart in (\w+), ", str(caught.value)
    )
    assert found is not None
    assert float(found[1]) == pytest.approx(float(far.split()[0]), rel=0.03)
    assert (found[2], found[3]) == (far.split()[1], read)
    if size_m == 2.04:
        assert str(caught.value).endswith(f"give --length-unit {written}")


def test_one_wild_coordinate_is_no_wrong_unit(tmp_path):
    path = tmp_path / "five.txt"
    path.write_bytes(edited(1, "95297,97.912,51.191"))
    with pytest.raises(InputError, match=r"lines 1-5: block 1: its point 1 lies"):
        read_five_point(path)


LINE = "0.1,0.2,0.3\n"
BAD = {
    "short row": (edited(17, "96.4 99.6"), "line 17: 2 numbers where 3 are needed (x y z): compl"),
    "one number": (edited(1, "96.4"), "line 1: 1 number where"),
    "long row": (edited(40, "40 95.3 97.9 51.1"), "line 40: 4 numbers where 3 are needed"),
    "decimal commas": (edited(2, "95,2 97,8 51,1,"), "line 2: nothing before or after a comma"),
    "semicolons": (edited(3, "95.2;97.8;;51.1"), "line 3: nothing before or after a semicolon"),
    "both marks": (edited(3, "1,095.2;97.8;51.1"), "line 3: '1.095.2' is not a number"),
    "header": (edited(1, "x,y,z"), "line 1: 'x' is not a number: write x y z only"),
    "comment": (edited(6, "# rear left"), "line 6: '#' is not a number"),
    "unit": (edited(7, "95.2m,97.8,51.1"), "line 7: '95.2m' is not a number"),
    "underscore": (edited(7, "9_5.2,97.8,51.1"), "line 7: '9_5.2' is not a number"),
    "other digits": (edited(7, "٩٥,97.8,51.1"), "line 7: "),
    "line separator": (edited(7, "95.2\u2028,97.8,51.1"), "line 7: '95.2\\u2028' is not a number"),
    "nan": (edited(8, "nan,97.8,51.1"), "line 8: nan where a finite number is needed"),
    "inf": (edited(9, "95.2,-Inf,51.1"), "line 9: -Inf where a finite number is needed"),
    "overflow": (edited(9, "95.2,1e999,51.1"), "line 9: a number beyond 1.8e308"),
    "far": (edited(9, "95.2,1e200,51.1"), "line 9: a coordinate of 1e+200 m"),
    "two commas": (edited(10, "95.2,,97.8,51.1"), "line 10: nothing before or after a comma"),
    "end comma": (edited(10, "95.2,97.8,51.1,"), "line 10: nothing before or after a comma"),
    "blank line": (edited(11, ""), "line 11: a blank line between rows: remove it"),
    "blank start": (("\n" + "\n".join(ROWS)).encode(), "line 1: a blank line"),
    "38 rows": ("\n".join(ROWS[:38]).encode(), "line 36: the last block has 3 of its 5 rows (38"),
    "three blocks": ("\n".join(ROWS[:15]).encode(), "line 15: ends after 3 of the 4 blocks"),
    "empty": (b"", "is empty"),
    "blank": (b" \n\r\n", "is empty"),
    "binary": (b"12\n\x00\x01\x02", "line 2: a zero byte, so not plain text"),
    "utf-16": (
        "\n".join(ROWS).encode("utf-16"),
        "line 1: a zero byte, so not plain text: save the points",
    ),
    "latin-1": (edited(5, "º").decode().encode("latin-1"), "line 5: byte 0xba is not UTF-8"),
    "collinear": (
        "\n".join([*ROWS[:20], *(f"{i},{i},1" for i in range(5))]).encode(),
        "lines 21-25: block 5: its five points lie on one line",
    ),
    "coincident": (
        "\n".join([*ROWS[:20], *["95.2,97.8,51.1"] * 5, *ROWS[25:]]).encode(),
        "lines 21-25: block 5: its five points lie within 0.0e+00 m of each other",
    ),
    "same wheel": (
        "\n".join(ROWS[:15] + ROWS[5:10]).encode(),
        "lines 1-20: the centres of wheels RL and FL are only 0.0000 m apart",
    ),
    "huge": (LINE.encode() * 1_500_000, "is larger than 16777216 bytes"),
}


@pytest.mark.parametrize("name", BAD)
def test_malformed_file_is_one_line_that_names_file_line_fact_and_fix(tmp_path, name):
    data, fact = BAD[name]
    path = tmp_path / "five.txt"
    path.write_bytes(data)
    with pytest.raises(InputError) as caught:
        read_five_point(path, name="five.txt")
    text = str(caught.value)
    assert text.startswith(f"five.txt: {fact}")
    assert text.isprintable()
    assert len(text.split(": ")) >= 3  # file, fact, fix


def test_missing_file_and_folder(tmp_path):
    with pytest.raises(InputError, match=r"^five.txt: no such file: check the path$"):
        read_five_point(tmp_path / "absent.txt", name="five.txt")
    with pytest.raises(InputError, match=r"^five.txt: is a folder: name the text file"):
        read_five_point(tmp_path, name="five.txt")
    with pytest.raises(InputError, match=r"^five.txt: cannot be read \(.*null byte"):
        read_five_point("a\0b", name="five.txt")


@pytest.mark.parametrize(
    ("options", "fact"),
    [
        ({"length_unit": "km"}, "--length-unit is 'km': give one of m, mm, in, cm, ft"),
        ({"coordinates": "polar"}, "--coordinates is 'polar'"),
        ({"coordinates": "spherical"}, "give --angle-unit deg, gon or rad"),
        ({"coordinates": "spherical", "angle_unit": "grad"}, "--angle-unit is 'grad'"),
        ({"azimuth": "left"}, "--azimuth is 'left'"),
        ({"angle_unit": "deg"}, "cartesian rows have no angles"),
        ({"azimuth": "clockwise"}, "cartesian rows have no angles"),
        (
            {"length_unit": "mm"},
            r"the wheel centres lie up to 2.042 mm apart in mm, .* --length-unit m$",
        ),
    ],
)
def test_options_are_checked(options, fact):
    with pytest.raises(InputError, match=f"^five.txt: {fact}|^five.txt: .*{fact}"):
        read_five_point(PAPER / "figure-4.txt", name="five.txt", **options)


def test_axles_in_the_wrong_order_are_noted(tmp_path):
    path = tmp_path / "five.txt"
    path.write_text("\n".join(ROWS[5:10] + ROWS[:5] + ROWS[15:20] + ROWS[10:15]))
    (note,) = read_five_point(path).notes
    assert "up . z = -1.000" in note


def total_station(tmp_path, sense: str, unit: str, rows: dict[int, str] | None = None) -> Path:
    """Write the sample as an instrument among the wheels reads it; `rows` replaces lines."""
    turn = {"deg": 360, "gon": 400, "rad": 2 * math.pi}[unit]
    lines = []
    for x, y, z in figure_4().reshape(-1, 3) - [95.8, 98.7, 50.0]:
        length = math.sqrt(x * x + y * y + z * z)
        start = math.atan2(x, y) if sense == "clockwise" else math.atan2(y, x)
        angles = (start % (2 * math.pi), math.acos(z / length))
        lines.append(
            " ".join(f"{v:.13f}" for v in (length, *(a / math.tau * turn for a in angles)))
        )
    for number, row in (rows or {}).items():
        lines[number - 1] = row
    path = tmp_path / "station.txt"
    path.write_text("\n".join(lines))
    return path


@pytest.mark.parametrize("unit", ["deg", "gon", "rad"])
@pytest.mark.parametrize("sense", ["clockwise", "counterclockwise"])
def test_total_station_rows_give_the_same_angles(tmp_path, sense, unit):
    path = total_station(tmp_path, sense, unit)
    options = {"coordinates": "spherical", "angle_unit": unit}
    read = read_five_point(path, **options)
    expected = table(measure(figure_4())[1])
    # 1e-13 in the file over rings of 88 mm, and rounding of coordinates near 100 m
    tolerance = 1e-11 + resolution_rad(figure_4())
    np.testing.assert_allclose(table(measure(read.blocks_m)[1]), expected, rtol=0, atol=tolerance)
    (note,) = read.notes
    assert f"taken {sense} from" in note
    named = read_five_point(path, azimuth=sense, **options)
    np.testing.assert_array_equal(named.blocks_m, read.blocks_m)
    assert named.notes == ()
    other = {"clockwise": "counterclockwise", "counterclockwise": "clockwise"}[sense]
    with pytest.raises(InputError, match=f"--azimuth {other} turns the vehicle upside down: give"):
        read_five_point(path, azimuth=other, **options)
    mirrored = table(measure(read.blocks_m[..., [1, 0, 2]])[1])
    assert np.abs(mirrored - expected).max() > 100 * SECOND  # the wrong sense would not pass


@pytest.mark.parametrize(
    ("row", "fact"),
    [
        ("0 10 90", "line 12: range 0 m is not positive"),
        ("-1.5 10 90", "line 12: range -1.5 m is not positive"),
        ("1.5 361 90", "line 12: azimuth 361 is over a turn of 360 deg: check --angle-unit"),
        ("1.5 10 270", "line 12: zenith 270 is outside 0 to 180 deg: reduce to face I"),
        ("1.5 10 -1", "line 12: zenith -1 is outside 0 to 180 deg"),
        ("1.5 10", "line 12: 2 numbers where 3 are needed (range azimuth zenith)"),
    ],
)
def test_bounds_of_total_station_rows(tmp_path, row, fact):
    path = total_station(tmp_path, "clockwise", "deg", {12: row})
    with pytest.raises(InputError, match=re.escape(f"station.txt: {fact}")):
        read_five_point(path, coordinates="spherical", angle_unit="deg")


def test_detailed_report_says_all_that_the_paper_lists():
    blocks = figure_4()
    measurement = measure_five_point(read_five_point(PAPER / "figure-4.txt"))
    frame = measurement.frame
    text = detailed_report(measurement)
    for part in (
        "Points read (pontos lidos): 40",
        "rear track (largura): 1.36527 m",
        "front track (largura): 1.34236 m",
        "distância entre vias): 1.52220 m",
        "positive is toe-in",
        "Camber (sopé): positive where the top leans outward",
        summary_table(measurement),
    ):
        assert part in text
    equation = re.search(r"equation: (\S+) x (\S+) y (\S+) z (\S+) m = 0", text).groups()
    plane = np.array(equation, dtype=float)
    # printed to 8 digits, coordinates near 100 m
    assert plane[:3] @ frame.origin_m + plane[3] == pytest.approx(0, abs=3 * 100 * 5e-9 + 5e-7)
    rows = [line.split() for line in text.split("Planes (")[1].split("\n")[2:10]]
    for row, block in zip(rows, blocks, strict=True):
        a, b, c, d, rms_mm = map(float, row[1:6])
        residuals = block @ [a, b, c] + d
        assert 1e3 * np.sqrt(np.mean(residuals**2)) == pytest.approx(rms_mm, abs=1.6e-3)
    assert text.isascii() is False
    assert "-0.00000 " not in text


def test_summary_is_in_degrees_minutes_seconds():
    measurement = measure_five_point(read_five_point(PAPER / "figure-4.txt"))
    row = summary_table(measurement).split("\n")[1].split()
    assert row[:3] == ["RR", "RR", "-00°19'40\""]  # U is 890 seconds
    assert row[4] == "+01°40'10\""
    full = summary_table(measurement, View(digits="full")).split("\n")[1].split()
    assert full[:3] == ["RR", "RR", "-00°19'40.7\""]
    assert full[4] == "+01°40'11.5\""


@pytest.mark.parametrize("written", LENGTH_UNITS)
@pytest.mark.parametrize("read", LENGTH_UNITS)
def test_a_usual_vehicle_in_another_unit_is_refused_or_noted(tmp_path, written, read):
    """Metres and feet, or inches and centimetres, are too alike for vehicles of any size."""
    path = tmp_path / "five.txt"
    np.savetxt(path, figure_4().reshape(-1, 3) / in_metres(1.0, written), fmt="%.9f")
    try:
        notes = measure_five_point(read_five_point(path, length_unit=read), check=False).notes
    except InputError as error:
        notes = [str(error)]
    named = [note for note in notes if "unit" in note and "vehicle" in note]
    assert len(named) == (read != written)


@pytest.mark.parametrize(
    ("factor", "unit", "proposed"),
    [
        (1e3, "m", "mm"),
        (1e3 / 25.4, "m", "in"),
        (1e-3, "mm", "m"),
        (100.0, "m", "cm"),
        (1e5, "m", None),
    ],
)
def test_a_unit_is_proposed_only_if_it_makes_a_vehicle(tmp_path, factor, unit, proposed):
    """No unit is right for a track of 150 km, and none is proposed."""
    path = tmp_path / "five.txt"
    own = in_metres(1.0, unit) if unit == "mm" else 1.0
    scale = factor if unit == "m" else factor / own
    np.savetxt(path, scale * figure_4().reshape(-1, 3), fmt="%.9f")
    with pytest.raises(InputError, match="the wheel centres lie up to") as caught:
        read_five_point(path, length_unit=unit)
    found = re.search(r"give --length-unit (\w+)$", str(caught.value))
    assert (found[1] if found else None) == proposed


@pytest.mark.parametrize(("scale", "noted"), [(1.0, False), (1.0 / 0.3048, True), (0.6, True)])
def test_lengths_of_no_usual_vehicle_are_noted(tmp_path, scale, noted):
    """Feet, of which no angle shows anything."""
    path = tmp_path / "five.txt"
    np.savetxt(path, scale * figure_4().reshape(-1, 3), fmt="%.9f")
    notes = measure_five_point(read_five_point(path), check=False).notes
    assert sum("are not those of usual vehicles" in note for note in notes) == noted


@pytest.mark.parametrize("rounded", [9, 5])
@pytest.mark.parametrize("order", [[0, 1, 2, 3, 4], [3, 4, 0, 1, 2]])
@pytest.mark.parametrize("check", [True, False])
def test_a_copied_block_adds_nothing_to_the_noise(tmp_path, rounded, order, check):
    """The u of every other wheel stays; another trial of as little noise changes it."""
    path, rng = tmp_path / "five.txt", np.random.default_rng(0)
    blocks = figure_4()[:5]
    np.savetxt(path, blocks.reshape(-1, 3), fmt="%.9f")
    alone = measure_five_point(read_five_point(path), check=check)
    for copied, alike in ((blocks[0], True), (blocks[0] + rng.normal(0, 5e-4, (5, 3)), False)):
        more = np.concatenate([blocks, copied[None, order].round(rounded)])
        np.savetxt(path, more.reshape(-1, 3), fmt="%.9f")
        found = measure_five_point(read_five_point(path), check=check)
        u = [[wheel.u_toe_rad for wheel in one.wheels[:5]] for one in (alone, found)]
        assert (u[0] == pytest.approx(u[1], rel=1e-9)) == alike


@pytest.mark.parametrize("form", ["; ", ";", "\t", " ", "D", "d"])
def test_forms_of_numbers_say_the_same(tmp_path, form):
    """Decimal commas between semicolons, tabs or blanks; exponents of Fortran."""
    path, rows = tmp_path / "five.txt", figure_4().reshape(-1, 3)
    np.savetxt(path, rows, fmt="%.9e")
    wanted = read_five_point(path).blocks_m
    text = path.read_text()
    marks = {"e": form} if form in "Dd" else {".": ",", " ": form}
    path.write_text(text.translate(str.maketrans(marks)))
    np.testing.assert_array_equal(read_five_point(path).blocks_m, wanted)


def test_decimal_commas_between_commas_are_refused(tmp_path):
    path = tmp_path / "five.txt"
    path.write_bytes(edited(2, "95,2,97,8,51,1"))
    with pytest.raises(InputError, match="line 2: 6 numbers where 3 are needed"):
        read_five_point(path)


@pytest.mark.parametrize(
    ("order", "lines"),
    [
        ([4, 5, 7, 6, 0, 1], "lines 21-40"),
        ([5, 4, 6, 7], "lines 21-40"),
        ([4, 1, 7, 6], "lines 6-10, 21-25, 31-35, 36-40"),
    ],
)
def test_blocks_in_a_stated_order_are_named_by_their_own_lines(tmp_path, order, lines):
    """The file has the four trials of the sample first, and an axle named from left to right."""
    rows = (PAPER / "figure-4.txt").read_text().splitlines()
    path = tmp_path / "points.txt"
    path.write_text("\n".join(rows[20:40] + rows[:20]) + "\n")
    with pytest.raises(InputError, match=f"{lines}: the front axle .* runs against"):
        read_five_point(path, arrange=lambda _: order)


def test_axles_in_one_place_are_refused(tmp_path):
    """Wheelbases of 0.3 m, with tracks of a vehicle."""
    path, blocks = tmp_path / "five.txt", figure_4()
    middles = blocks[:4].mean(axis=1)
    ahead = middles[2:] - middles[:2]
    shift = 0.3 * ahead / np.linalg.norm(ahead, axis=1)[:, None] - ahead
    blocks[2:4] += shift[:, None]
    np.savetxt(path, blocks.reshape(-1, 3), fmt="%.9f")
    with pytest.raises(InputError, match=r"wheel centres of R[RL] and F[RL] lie 300 mm apart"):
        measure_five_point(read_five_point(path), check=False)


def test_a_trial_that_faces_along_the_vehicle_is_not_measured_and_all_others_are(tmp_path):
    """A reference wheel's ends the measurement, as it makes the frame."""
    path, blocks = tmp_path / "five.txt", figure_4()
    others = measure_five_point(read_five_point(PAPER / "figure-4.txt"))
    frame, turned = others.frame, blocks.copy()
    for block in (0, 5):
        local = blocks[block] - blocks[block].mean(axis=0)
        axes = np.stack([frame.forward, frame.left, frame.up])
        turned[block] = local @ axes.T @ axes[[1, 0, 2]] + blocks[block].mean(axis=0)
    np.savetxt(path, np.concatenate([blocks[:5], turned[5:6], blocks[6:]]).reshape(-1, 3))
    found = measure_five_point(read_five_point(path))
    assert [one.observation.status for one in found.wheels] == ["ok"] * 5 + ["no-wheel"] + [
        "ok"
    ] * 2
    trial = found.wheels[5]
    assert trial.angles is None
    assert re.fullmatch(
        r"wheel RL: the normal .* at 8\d\.\d° to the rear axle, so its outer side is undefined",
        trial.observation.reason,
    )
    for one, other in zip(found.wheels, others.wheels, strict=True):
        if one is not trial:
            assert one.angles.toe_rad == pytest.approx(other.angles.toe_rad, abs=1e-12)
    np.savetxt(path, np.concatenate([turned[:1], blocks[1:]]).reshape(-1, 3))
    with pytest.raises(InputError, match=r"five.txt: wheel RR: the normal .* check the order"):
        measure_five_point(read_five_point(path))


@pytest.mark.parametrize("option", ["-o", "--html", "--pdf"])
@pytest.mark.parametrize("method", ["tls", "tcgc-2013"])
def test_the_points_are_not_replaced_by_their_report(tmp_path, option, method):
    """A survey was lost so, with exit code 0."""
    file = tmp_path / "points.txt"
    file.write_bytes((PAPER / "figure-4.txt").read_bytes())
    again = tmp_path / ".." / tmp_path.name / "points.txt"
    done = call("five-point", file, "--method", method, option, again)
    assert done.returncode == 2
    assert f"{again}: this command reads it: give another path" in done.stderr
    assert file.read_bytes() == (PAPER / "figure-4.txt").read_bytes()


@pytest.mark.parametrize("option", ["--tolerance", "--total-station", "--config"])
def test_what_is_stated_is_not_replaced_by_the_report(tmp_path, option):
    stated = tmp_path / "mine.toml"
    stated.write_text("[front.toe]\nlower_deg = -0.1\n")
    done = call("five-point", PAPER / "figure-4.txt", option, stated, "-o", stated)
    assert done.returncode == 2
    assert f"{stated}: this command reads it: give another path" in done.stderr
    assert stated.read_text() == "[front.toe]\nlower_deg = -0.1\n"
