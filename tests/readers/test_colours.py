"""Colours of points: their luminance stands for the intensity where a file holds none."""

from __future__ import annotations

import laspy
import numpy as np
import pytest
from laspy.vlrs.vlrlist import VLRList

from tests.support.native_files import E57Scan, Integer, write_e57, xyz
from tests.support.scenes import Setup, make
from wheelplane.config import Config
from wheelplane.detection import find_target
from wheelplane.plane import fit_plane
from wheelplane.readers import ReadOptions, read_scan
from wheelplane.readers.colour import luminance
from wheelplane.targets import load_target

COUNT = 40
RNG = np.random.default_rng(4)
XYZ = np.round(RNG.normal(0.0, 3.0, (COUNT, 3)), 3)
RGB = RNG.integers(0, 256, (COUNT, 3))
SHADE = np.arange(1, COUNT + 1)
PACKED = (RGB @ [1 << 16, 1 << 8, 1]).astype("<u4")
BYTES = [(name, "u1") for name in ("red", "green", "blue")]


def records(points, colours, fields):
    """Records of x y z and a colour."""
    made = np.empty(len(points), [("x", "<f8"), ("y", "<f8"), ("z", "<f8"), *fields])
    for name, column in zip(made.dtype.names, [*points.T, *np.atleast_2d(colours.T)], strict=True):
        made[name] = column
    return made


def write_ply(path, points, colours):
    made = records(points, colours, BYTES)
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n"
    head += "".join(f"property double {axis}\n" for axis in "xyz")
    head += "".join(f"property uchar {name}\n" for name, _ in BYTES)
    path.write_bytes(f"{head}end_header\n".encode() + made.tobytes())
    return path


def pcd_head(kind, data):
    head = f"VERSION 0.7\nFIELDS x y z rgb\nSIZE 8 8 8 4\nTYPE F F F {kind}\nCOUNT 1 1 1 1\n"
    return f"{head}WIDTH {COUNT}\nHEIGHT 1\nPOINTS {COUNT}\nDATA {data}\n"


def pcd_binary(path, kind="F"):
    made = records(XYZ, PACKED, [("rgb", "<u4")])  # the bits are the same
    path.write_bytes(pcd_head(kind, "binary").encode() + made.tobytes())


def pcd_text(path, kind="F"):
    shown = PACKED.view("<f4") if kind == "F" else PACKED
    rows = [f"{x} {y} {z} {c!r}" for (x, y, z), c in zip(XYZ.tolist(), shown.tolist(), strict=True)]
    path.write_text(pcd_head(kind, "ascii") + "\n".join(rows) + "\n")


def text(path, heading=""):
    rows = [" ".join(map(str, row)) for row in np.column_stack([XYZ, RGB]).tolist()]
    path.write_text(heading + "\n".join(rows) + "\n")


def commas():
    rows = np.column_stack([XYZ, RGB]).tolist()
    return f"{COUNT}\n" + "".join(",".join(map(str, row)) + "\n" for row in rows)


def raster():
    return records(XYZ, RGB, BYTES).reshape(-1, 5)


def las(path, point_format, intensity=0, following=()):
    """Write points that are the last returns of their pulses, and records that follow them."""
    header = laspy.LasHeader(point_format=point_format, version="1.4")
    header.scales = np.full(3, 0.001)
    made = laspy.LasData(header)
    made.return_number = made.number_of_returns = np.full(COUNT, 2)
    made.evlrs = VLRList(following)
    made.x, made.y, made.z = XYZ.T
    made.red, made.green, made.blue = RGB.T
    made.intensity = np.broadcast_to(intensity, COUNT)
    made.write(str(path))


def e57(path, **more):
    byte = Integer(0, 255)
    names = ("colorRed", "colorGreen", "colorBlue")
    colours = {name: (byte, column) for name, column in zip(names, RGB.T, strict=True)}
    write_e57(path, E57Scan(xyz(XYZ) | colours | more))


WRITERS = {
    "binary.ply": lambda path: write_ply(path, XYZ, RGB),
    "float.pcd": pcd_binary,
    "integer.pcd": lambda path: pcd_binary(path, "U"),
    "text.pcd": pcd_text,
    "integers.pcd": lambda path: pcd_text(path, "U"),
    "six.pts": lambda path: text(path, f"{COUNT}\n"),
    "named.csv": lambda path: text(path, "X Y Z R G B\n"),
    "comment.xyz": lambda path: text(path, "# x y z red green blue\n"),
    **{f"{form}.las": lambda path, form=form: las(path, form) for form in (2, 3, 5, 7, 8, 10)},
    **{f"{form}.laz": lambda path, form=form: las(path, form) for form in (2, 3, 7, 8)},
    "colours.e57": e57,
    "commas.pts": lambda path: path.write_text(commas()),
    "records.npy": lambda path: np.save(path, records(XYZ, RGB, BYTES)),
    "raster.npy": lambda path: np.save(path, np.asfortranarray(raster())),
    "raster.npz": lambda path: np.savez(path, points=raster()),
}


@pytest.mark.parametrize("name", WRITERS)
def test_the_luminance_is_read_where_there_is_no_intensity(tmp_path, name):
    WRITERS[name](tmp_path / name)
    scan = read_scan(tmp_path / name)
    np.testing.assert_allclose(scan.points_m, XYZ, atol=1e-9)
    np.testing.assert_allclose(scan.intensity, RGB @ [0.2126, 0.7152, 0.0722], rtol=1e-6)


@pytest.mark.parametrize("order", "CF")
def test_columns_that_are_named_by_option_are_a_colour_in_a_text_and_in_an_array(tmp_path, order):
    names = ReadOptions(columns=("x", "y", "z", "r", "g", "b"))
    text(tmp_path / "rr.xyz")
    np.save(tmp_path / "rr.npy", np.array(np.column_stack([XYZ, RGB]), order=order))
    for name in ("rr.xyz", "rr.npy"):
        scan = read_scan(tmp_path / name, options=names)
        np.testing.assert_array_equal(scan.points_m, XYZ)
        np.testing.assert_allclose(scan.intensity, RGB @ [0.2126, 0.7152, 0.0722], rtol=1e-6)


@pytest.mark.parametrize("orders", ["CC", "CF", "FC", "FF"])
def test_an_array_of_intensities_belongs_to_the_points_of_records_in_any_order(tmp_path, orders):
    points, shades = raster(), SHADE.reshape(-1, 5)
    kept = [
        np.array(array, order=order) for array, order in zip((points, shades), orders, strict=True)
    ]
    for held in (kept[0], kept[0][["x", "y", "z"]].copy(order="K")):
        np.savez(tmp_path / "rr.npz", points=held, intensity=kept[1])
        scan = read_scan(tmp_path / "rr.npz")
        np.testing.assert_array_equal(scan.points_m, XYZ)
        assert scan.intensity.tolist() == SHADE.tolist()


@pytest.mark.parametrize("name", ["rr.las", "rr.laz", "rr.e57", "rr.csv"])
def test_an_intensity_goes_before_colours(tmp_path, name):
    path = tmp_path / name
    if name == "rr.e57":
        e57(path, intensity=(Integer(0, 255), SHADE))
    elif name == "rr.csv":
        rows = np.column_stack([XYZ, RGB, SHADE]).tolist()
        text = "\n".join(" ".join(map(str, row)) for row in rows)
        path.write_text(f"x y z r g b intensity\n{text}\n")
    else:
        las(path, 7, SHADE)
    assert read_scan(path).intensity.tolist() == SHADE.tolist()


def test_what_follows_the_points_is_no_intensity(tmp_path):
    las(tmp_path / "rr.las", 7, following=[laspy.VLR("others", 1, "all ones", b"\xff" * 999)])
    scan = read_scan(tmp_path / "rr.las")
    np.testing.assert_allclose(scan.intensity, RGB @ [0.2126, 0.7152, 0.0722], rtol=1e-6)


@pytest.mark.parametrize("names", ["x y z", "x y z r", "x y z r g", "x y z r g g"])
def test_a_part_of_a_colour_is_none(tmp_path, names):
    rows = [" ".join(map(str, row)) + " 5" * (len(names.split()) - 3) for row in XYZ.tolist()]
    (tmp_path / "rr.csv").write_text("\n".join([names, *rows]) + "\n")
    scan = read_scan(tmp_path / "rr.csv")
    np.testing.assert_array_equal(scan.points_m, XYZ)
    assert scan.intensity is None


def pcd_of(path, fields):
    """Write points and further fields: names, type, values of a point (N, count)."""
    names, kinds, columns = zip(*fields, strict=True)
    sizes, counts = [c.dtype.itemsize for c in columns], [c.shape[1] for c in columns]
    head = f"VERSION 0.7\nFIELDS x y z {' '.join(names)}\nSIZE 8 8 8 {' '.join(map(str, sizes))}\n"
    head += f"TYPE F F F {' '.join(kinds)}\nCOUNT 1 1 1 {' '.join(map(str, counts))}\n"
    head += f"WIDTH {COUNT}\nHEIGHT 1\nPOINTS {COUNT}\nDATA binary\n"
    parts = [XYZ.astype("<f8"), *columns]
    rows = [b"".join(part[i].tobytes() for part in parts) for i in range(COUNT)]
    path.write_bytes(head.encode() + b"".join(rows))


def test_of_two_packed_colours_the_first_counts(tmp_path):
    other = np.full((COUNT, 1), 7, "<u4")
    pcd_of(tmp_path / "rr.pcd", [("rgb", "U", PACKED[:, None]), ("rgba", "U", other)])
    scan = read_scan(tmp_path / "rr.pcd")
    np.testing.assert_allclose(scan.intensity, RGB @ [0.2126, 0.7152, 0.0722], rtol=1e-6)


@pytest.mark.parametrize("count", [1, 2])
def test_a_colour_has_one_value_a_point(tmp_path, count):
    red, green, blue = (RGB[:, [i]].astype("<u2") for i in range(3))
    fields = [("r", "U", red), ("g", "U", green.repeat(count, axis=1)), ("b", "U", blue)]
    pcd_of(tmp_path / "rr.pcd", fields)
    scan = read_scan(tmp_path / "rr.pcd")
    np.testing.assert_array_equal(scan.points_m, XYZ)
    if count == 1:
        np.testing.assert_allclose(scan.intensity, RGB @ [0.2126, 0.7152, 0.0722], rtol=1e-6)
    else:
        assert scan.intensity is None


@pytest.mark.parametrize("alpha", [0, 1, 127, 255])
def test_a_packed_colour_is_in_the_lowest_three_bytes_whatever_the_fourth(alpha):
    bits = PACKED + np.uint32(alpha << 24)
    grey = RGB @ [0.2126, 0.7152, 0.0722]
    for packed in (bits, bits.view("<i4"), bits.view("<f4")):
        np.testing.assert_allclose(luminance(packed), grey)


def test_a_packed_colour_that_text_calls_nan_is_not_known():
    assert np.isnan(luminance(np.array([np.nan], "<f4"))).all()


def fitted(folder, points_m, colours):
    """The plane of a disc in a PLY of coloured points."""
    scan = read_scan(write_ply(folder / "rr.ply", points_m, colours))
    config, target = Config(), load_target("disc-250")
    patch = find_target(scan.points_m, target, config.segment, 0, scan.intensity)
    return fit_plane(patch, target, config.plane)


def test_ranges_that_follow_the_colour_tilt_no_plane(tmp_path):
    cloud = make(Setup(spacing_m=0.002, half_width_m=0.15), 3)
    u = cloud.in_target(cloud.points_m)[:, 0]
    beams = cloud.points_m - cloud.viewpoint_m
    beams /= np.linalg.norm(beams, axis=1, keepdims=True)
    points = cloud.points_m + np.where(u > 0.0, 0.5e-3, 0.0)[:, None] * beams
    half = np.where(u > 0.0, 40, 200)[:, None].repeat(3, axis=1)
    blind = fitted(tmp_path, points, np.full_like(half, 90))
    plane = fitted(tmp_path, points, half)
    off = [np.linalg.norm(np.cross(one.normal, cloud.normal)) for one in (plane, blind)]
    assert off[0] < 3.5 * plane.tilt_rad
    assert off[1] > 5.0 * blind.tilt_rad
    assert plane.brightness.significant


def test_halves_of_two_colours_that_ranges_do_not_follow_cost_no_more_than_they_add_to_u(tmp_path):
    cloud = make(Setup(spacing_m=0.002, half_width_m=0.15), 7)
    u = cloud.in_target(cloud.points_m)[:, 0]
    half = np.where(u > 0.0, 40, 200)[:, None].repeat(3, axis=1)
    plane, blind = (fitted(tmp_path, cloud.points_m, c) for c in (half, np.full_like(half, 90)))
    assert not plane.brightness.significant
    moved = np.linalg.norm(np.cross(plane.normal, blind.normal))
    assert moved < 3.5 * np.sqrt(2.0 * (plane.tilt_rad**2 - blind.tilt_rad**2))


def test_colours_that_ranges_do_not_follow_change_no_digit(tmp_path):
    cloud = make(Setup(spacing_m=0.002, half_width_m=0.15), 5)
    colours = np.random.default_rng(8).integers(0, 256, (len(cloud.points_m), 3))
    plane = fitted(tmp_path, cloud.points_m, colours)
    blind = fitted(tmp_path, cloud.points_m, np.full_like(colours, 90))
    assert plane.brightness is None
    assert plane.basis.tobytes() == blind.basis.tobytes()
