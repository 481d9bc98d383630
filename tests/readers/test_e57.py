"""E57: every field type, pose and flag against an independent computation; every lie refused."""

from __future__ import annotations

import dataclasses
import importlib.util
import random
import re
import struct

import numpy as np
import pye57
import pytest
from scipy.spatial.transform import Rotation

from tests.support.native_files import (
    PAYLOAD,
    Double,
    E57Scan,
    Integer,
    Scaled,
    Single,
    crc32c,
    paged,
    payload,
    pose,
    with_bytes,
    with_xml,
    write_e57,
    write_las,
    xml_of,
    xyz,
)
from tests.support.paths import FORMATS
from tests.support.sources import opened
from wheelplane.diagnostics.findings import findings
from wheelplane.diagnostics.scan_summary import summarise_scan
from wheelplane.errors import InputError, MissingDependencyError
from wheelplane.readers import read_scan
from wheelplane.readers.e57 import pages as e57_pages
from wheelplane.readers.e57 import reader as e57
from wheelplane.readers.e57 import xml as e57_xml
from wheelplane.readers.e57.scans import find_scans
from wheelplane.readers.e57.section import check_sections

EPS = np.finfo(np.float64).eps
COUNT = 50


def cloud(count=COUNT, centre=(0.0, 0.0, 0.0), seed=5):
    return np.random.default_rng(seed).normal(0.0, 3.0, (count, 3)) + centre


def read(tmp_path, *scans):
    return read_scan(write_e57(tmp_path / "rr.e57", *scans))


def refusal(tmp_path, data, pattern=None):
    path = tmp_path / "rr.e57"
    path.write_bytes(data)
    with pytest.raises(InputError, match=pattern) as caught:
        read_scan(path, name="rr.e57")
    return one_line(caught.value)


def one_line(error):
    text = str(error)
    assert text.startswith("rr.e57: ")
    assert text.isprintable()
    assert text.count(": ") >= 2
    return text


def small(tmp_path):
    """The bytes of a file of two scans, and of other fields than coordinates."""
    more = {"intensity": (Scaled(0, 1023, 0.5), range(COUNT))}
    scans = [E57Scan(xyz(cloud(seed=n)) | more, f"setup {n}", pose((1, 0, 0, 0))) for n in (1, 2)]
    return write_e57(tmp_path / "small.e57", *scans).read_bytes()


def test_doubles_at_1e7_m_survive_bit_for_bit(tmp_path):
    points = cloud(centre=(1e7, -1e7, 123.0))
    scan = read(tmp_path, E57Scan(xyz(points)))
    assert scan.points_m.tobytes() == points.tobytes()
    assert scan.points_m.flags.c_contiguous
    assert scan.intensity is None
    assert scan.grid is None
    assert scan.invalid_points == 0
    assert [(part.name, part.start, part.stop) for part in scan.parts] == [("scan", 0, COUNT)]
    assert scan.parts[0].T_file_scan is None


def test_singles_are_read_as_they_are(tmp_path):
    points = cloud().astype(np.float32)
    scan = read(tmp_path, E57Scan(xyz(points, Single())))
    assert scan.points_m.tobytes() == points.astype(np.float64).tobytes()


@pytest.mark.parametrize("bits", [1, 7, 8, 9, 16, 17, 31, 32, 33, 53])
def test_scaled_integers_of_any_width_are_scaled_once(tmp_path, bits):
    low = -(2 ** (bits - 1))
    scale = 2.0**-bits * 1e3 / 3
    kind = Scaled(low, low + 2**bits - 1, scale, 1e6)
    raw = np.random.default_rng(1).integers(low, low + 2**bits, (COUNT, 3))
    raw[0], raw[1] = low, low + 2**bits - 1
    scan = read(tmp_path, E57Scan(xyz(raw, kind)))
    np.testing.assert_allclose(scan.points_m, raw * scale + 1e6, rtol=2 * EPS, atol=0)


def test_integers_are_coordinates_too(tmp_path):
    raw = np.random.default_rng(1).integers(-(2**40), 2**33, (COUNT, 3))
    full = Integer(-(2**63), 2**63 - 1)
    scan = read(tmp_path, E57Scan(xyz(raw % 2**33, full)))
    assert scan.points_m.tolist() == (raw % 2**33).tolist()


def test_a_coordinate_that_is_the_same_for_all_points_takes_no_bytes(tmp_path):
    columns = xyz(cloud()) | {"cartesianZ": (Scaled(7, 7, 0.5), [7] * COUNT)}
    scan = read(tmp_path, E57Scan(columns))
    assert scan.points_m[:, 2].tolist() == [3.5] * COUNT


@pytest.mark.parametrize(
    "kind", [Double(), Single(), Scaled(0, 2**16, 1.0), Integer(0, 2**16), Integer(0, 70_000)]
)
def test_intensity_is_kept_in_its_own_scale(tmp_path, kind):
    shown = np.arange(COUNT) * 1000
    scan = read(tmp_path, E57Scan(xyz(cloud()) | {"intensity": (kind, shown)}))
    assert scan.intensity.dtype == np.float32
    assert scan.intensity.tolist() == shown.tolist()


@pytest.mark.parametrize("kind", ["intensity", "colour"])
def test_an_intensity_or_colour_that_is_marked_as_invalid_is_not_known(tmp_path, kind):
    """Its point is: only what stands for its brightness is none."""
    names, flag = {
        "intensity": (("intensity",), "isIntensityInvalid"),
        "colour": (e57.COLOUR, "isColorInvalid"),
    }[kind]
    unknown = np.arange(COUNT) % 5 == 0
    shown = {name: (Integer(0, 255), np.where(unknown, 0, 200)) for name in names}
    path = tmp_path / "rr.e57"
    points = cloud()
    write_e57(path, E57Scan(xyz(points) | shown | {flag: (Integer(0, 1), unknown.astype(int))}))
    scan = read_scan(path)
    assert scan.points_m.tobytes() == points.tobytes()
    assert np.isnan(scan.intensity).tolist() == unknown.tolist()
    np.testing.assert_allclose(scan.intensity[~unknown], 200.0)
    np.testing.assert_allclose(summarise_scan(path, "m").intensity, [200.0, 200.0])


def test_row_and_column_are_kept(tmp_path):
    rows, columns = np.divmod(np.arange(COUNT) * 7_001, 100_003)
    shown = {"rowIndex": (Integer(0, 10**6), rows), "columnIndex": (Integer(0, 10**6), columns)}
    scan = read(tmp_path, E57Scan(xyz(cloud()) | shown))
    assert scan.grid.tolist() == np.transpose([rows, columns]).tolist()


@pytest.mark.parametrize("bad", [2**31, -(2**31), 2**63 - 1, -(2**63)])
def test_a_row_beyond_any_raster_is_refused(tmp_path, bad):
    whole = Integer(-(2**63), 2**63 - 1)
    shown = {"rowIndex": (whole, [*range(COUNT - 1), bad]), "columnIndex": (whole, range(COUNT))}
    data = write_e57(tmp_path / "a.e57", E57Scan(xyz(cloud()) | shown)).read_bytes()
    refusal(tmp_path, data, "a point lies in row or column")


@pytest.mark.parametrize("system", ["cartesian", "spherical"])
def test_invalid_states_are_missing_returns(tmp_path, system):
    """1: a direction without a distance; 2: nothing. What stands in such a row is no point."""
    state = np.arange(COUNT) % 3
    points = cloud()
    names = (e57.CARTESIAN, e57.SPHERICAL)[system == "spherical"]
    columns = {name: (Double(), column) for name, column in zip(names, points.T, strict=True)}
    flags = {f"{system}InvalidState": (Integer(0, 2), state), "intensity": (Double(), state + 5)}
    scan = read(tmp_path, E57Scan(columns | flags))
    valid = state == 0
    assert scan.invalid_points == np.count_nonzero(~valid)
    assert len(scan.points_m) == np.count_nonzero(valid)
    assert scan.intensity.tolist() == [5.0] * np.count_nonzero(valid)
    if system == "cartesian":
        assert scan.points_m.tobytes() == points[valid].tobytes()
    nothing = flags | {f"{system}InvalidState": (Integer(0, 2), np.full(COUNT, 2))}
    path = write_e57(tmp_path / "none.e57", E57Scan(columns | nothing))
    refusal(tmp_path, path.read_bytes(), "all its 50 points are invalid")


@pytest.mark.parametrize("none", [np.nan, np.inf, -np.inf])
def test_nan_and_infinity_are_missing_returns(tmp_path, none):
    points = cloud()
    points[3:9, 1] = none
    scan = read(tmp_path, E57Scan(xyz(points)))
    assert scan.invalid_points == 6
    assert scan.points_m.tobytes() == np.delete(points, np.s_[3:9], axis=0).tobytes()


def test_spherical_coordinates_turn_from_x_to_y_and_rise_to_z(tmp_path):
    """Known directions, and then all: turned about z by the azimuth, about y by the elevation."""
    half = np.pi / 2
    reach = np.array([2.0, 2.0, 2.0, 2.0, 3.0, 3.0, 0.0])
    azimuth = np.array([0.0, half, np.pi, -half, 0.0, 1.0, 1.0])
    elevation = np.array([0.0, 0.0, 0.0, 0.0, half, -half, 1.0])
    known = [[2, 0, 0], [0, 2, 0], [-2, 0, 0], [0, -2, 0], [0, 0, 3], [0, 0, -3], [0, 0, 0]]
    rng = np.random.default_rng(2)
    reach = np.append(reach, rng.uniform(0, 100, COUNT))
    azimuth = np.append(azimuth, rng.uniform(-np.pi, np.pi, COUNT))
    elevation = np.append(elevation, rng.uniform(-half, half, COUNT))
    columns = zip(e57.SPHERICAL, (reach, azimuth, elevation), strict=True)
    scan = read(tmp_path, E57Scan({name: (Double(), column) for name, column in columns}))
    np.testing.assert_allclose(scan.points_m[:7], known, atol=8 * EPS)
    turned = Rotation.from_euler("ZY", np.transpose([azimuth, -elevation]))
    truth = turned.apply([[1.0, 0.0, 0.0]]) * reach[:, None]
    np.testing.assert_allclose(scan.points_m, truth, atol=100 * 8 * EPS)


def test_cartesian_goes_before_spherical(tmp_path):
    points = cloud()
    wrong = {name: (Double(), np.ones(COUNT)) for name in e57.SPHERICAL}
    assert read(tmp_path, E57Scan(wrong | xyz(points))).points_m.tobytes() == points.tobytes()


TURN = Rotation.from_rotvec([0.3, -1.1, 2.0])
QUATERNION = TURN.as_quat(scalar_first=True)
SHIFT = (12.5, -3.0, 0.75)


@pytest.mark.parametrize(
    ("shown", "turn", "shift"),
    [
        (pose(QUATERNION, SHIFT), TURN, SHIFT),
        (pose(-QUATERNION, SHIFT), TURN, SHIFT),
        (pose(7.5 * QUATERNION, SHIFT), TURN, SHIFT),
        (pose(1e-9 * QUATERNION, SHIFT), TURN, SHIFT),
        (pose(QUATERNION), TURN, (0, 0, 0)),
        (pose(None, SHIFT), Rotation.identity(), SHIFT),
        (pose((0, 0, 0, 0), SHIFT), Rotation.identity(), SHIFT),
        (pose((2, 0, 0, 0), (0, 0, 0)), Rotation.identity(), (0, 0, 0)),
        (pose(), Rotation.identity(), (0, 0, 0)),
        (None, Rotation.identity(), (0, 0, 0)),
    ],
)
def test_a_pose_is_applied_once(tmp_path, shown, turn, shift):
    """Without a rotation, or with the quaternion 0 0 0 0 of older writers, nothing turns."""
    points = cloud()
    scan = read(tmp_path, E57Scan(xyz(points), pose=shown))
    truth = turn.apply(points) + shift
    np.testing.assert_allclose(scan.points_m, truth, atol=64 * EPS * np.abs(truth).max())
    T = scan.parts[0].T_file_scan
    assert (T is None) == (shown is None)
    if shown is None:
        assert scan.points_m.tobytes() == points.tobytes()
    else:
        np.testing.assert_allclose(T[:3, :3], turn.as_matrix(), atol=8 * EPS)
        np.testing.assert_allclose(T[:3, 3], shift, atol=0)


@pytest.mark.parametrize(
    ("shown", "note"),
    [
        (pose((0, 0, 0, 0), SHIFT), "the quaternion of its pose is 0 0 0 0: taken as the identity"),
        (pose(None, SHIFT), "its pose has no rotation: taken as the identity"),
        (pose(2 * QUATERNION), "the quaternion of its pose has the length 2: it was normalised"),
        (pose(QUATERNION.astype(np.float32), SHIFT), None),
        (None, None),
    ],
)
def test_what_had_to_be_settled_is_reported(tmp_path, shown, note):
    path = write_e57(tmp_path / "a.e57", E57Scan(xyz(cloud()), pose=shown))
    found = [text for text in findings(summarise_scan(path, "m")) if "pose" in text]
    assert found == ([f"scan scan: {note}"] if note else [])


@pytest.mark.parametrize("bad", [b"nan", b"inf", b"-inf", b"1e999"])
@pytest.mark.parametrize("where", [b"<w type='Float'>", b"<z type='Float'>"])
def test_a_pose_that_is_none_is_refused(tmp_path, where, bad):
    """z is of the quaternion and of the translation."""
    scan = E57Scan(xyz(cloud()), pose=pose((2, 2, 2, 2), (2, 2, 2)))
    data = write_e57(tmp_path / "a.e57", scan).read_bytes()
    xml = xml_of(data).replace(b'"', b"'")
    shown = re.sub(re.escape(where) + rb"[^<]*", where + bad, xml)
    assert shown != xml
    refusal(tmp_path, with_xml(data, shown), "the pose of its scan scan is not a rotation")


def test_several_scans_keep_their_names_poses_and_places(tmp_path):
    """One without points, one without a name, one without intensity or raster, one spherical."""
    a, b, d = cloud(40, seed=1), cloud(30, seed=2), cloud(20, seed=4)
    grid = {name: (Integer(0, 99), range(40)) for name in e57.GRID}
    more = {"intensity": (Single(), range(40))} | grid
    polar = {name: (Double(), column) for name, column in zip(e57.SPHERICAL, d.T, strict=True)}
    scan = read(
        tmp_path,
        E57Scan(xyz(a) | more, "front", pose(QUATERNION, SHIFT)),
        E57Scan(xyz(np.empty((0, 3))), "nothing"),
        E57Scan(xyz(b), None),
        E57Scan(polar, "polar\n  one", pose(None, SHIFT)),
    )
    names = [("front", 0, 40), ("nothing", 40, 40), ("{guid-2}", 40, 70), ("polar one", 70, 90)]
    assert [(part.name, part.start, part.stop) for part in scan.parts] == names
    np.testing.assert_allclose(scan.points_m[:40], TURN.apply(a) + SHIFT, atol=1e-13)
    assert scan.points_m[40:70].tobytes() == b.tobytes()
    lengths = np.linalg.norm(scan.points_m[70:] - SHIFT, axis=1)
    np.testing.assert_allclose(lengths, np.abs(d[:, 0]), atol=1e-13)
    assert scan.intensity[:40].tolist() == list(range(40))
    assert np.isnan(scan.intensity[40:]).all()
    assert summarise_scan(tmp_path / "rr.e57", "m").intensity == (0.0, 39.0)
    assert scan.grid[:40].tolist() == [[i, i] for i in range(40)]
    assert (scan.grid[40:] == -1).all()


@pytest.mark.parametrize("rows", [1, 7, COUNT, 1 << 16])
def test_many_blocks_are_one_cloud(tmp_path, monkeypatch, rows):
    """Blocks that end within packets, and packets that end within a value."""
    monkeypatch.setattr(e57, "SLOT_ROWS", rows)
    count = 20_011 if rows > 1 else 40
    points = cloud(count)
    raw = np.random.default_rng(3).integers(0, 2**13, count)
    columns = xyz(points) | {"intensity": (Scaled(0, 2**13 - 1, 1.0), raw)}
    scan = read(tmp_path, E57Scan(columns), E57Scan(columns, "again"))
    assert scan.points_m.tobytes() == np.vstack([points, points]).tobytes()
    assert scan.intensity.tolist() == [*raw, *raw]


@pytest.mark.parametrize("kind", [Double(), Single(), Scaled(-(2**31), 2**31 - 1, 1e-4)])
def test_the_library_reads_the_same(tmp_path, kind):
    """Against pye57's own reader of whole scans, pose and all."""
    raw = cloud() if not isinstance(kind, Scaled) else np.round(cloud() * 1e4).astype(np.int64)
    path = write_e57(tmp_path / "a.e57", E57Scan(xyz(raw, kind), pose=pose(QUATERNION, SHIFT)))
    theirs = pye57.E57(str(path))
    columns = theirs.read_scan(0, ignore_missing_fields=True)
    theirs.close()
    truth = np.transpose([columns[name] for name in e57.CARTESIAN])
    np.testing.assert_allclose(read_scan(path).points_m, truth, atol=1e-13)


def test_e57_las_and_npy_hold_the_same_cloud(tmp_path):
    points = np.round(cloud(400), 4) + np.array([1000.0, 2000.0, 10.0])
    np.save(tmp_path / "a.npy", points)
    write_e57(tmp_path / "a.e57", E57Scan(xyz(points)))
    integers = np.round(points * 1e4).astype(np.int64)
    for suffix in ("las", "laz"):
        path = tmp_path / f"a.{suffix}"
        write_las(path, integers, np.zeros(400), scale=(1e-4,) * 3, shift=(0.0,) * 3)
    scans = {s: read_scan(tmp_path / f"a.{s}").points_m for s in ("npy", "e57", "las", "laz")}
    assert scans["npy"].tobytes() == scans["e57"].tobytes() == points.tobytes()
    for suffix in ("las", "laz"):
        np.testing.assert_allclose(scans[suffix], points, rtol=4 * EPS, atol=0)


@pytest.mark.parametrize("kind", ["Float", "Double"])
def test_files_of_other_programs_are_read_whole(kind):
    """The faces of a cube of 1 m, 1,280 points on each."""
    points = read_scan(FORMATS / f"ColouredCube{kind}.e57").points_m
    assert points.shape == (7680, 3)
    assert np.abs(points).max(axis=1).tolist() == [0.5] * 7680
    on_faces = np.count_nonzero(np.abs(points) == 0.5, axis=0)
    assert (on_faces >= 2 * 1280).all()


def test_a_sheet_of_paper_is_read():
    scan = read_scan(FORMATS / "A4.e57")
    assert scan.parts[0].name == "A4 - Cloud"
    assert scan.points_m.min(axis=0) == pytest.approx([-44.9522, -1.3493, -0.6077], abs=1e-5)
    assert scan.points_m.max(axis=0) == pytest.approx([-44.3001, -0.886, 0.3694], abs=1e-5)
    assert scan.intensity.tolist() == [0.0] * 4


@pytest.mark.parametrize(
    ("file", "fact"),
    [
        ("ZeroPoints.e57", "it declares 0 points"),
        ("bad-crc.e57", "the checksum of its page 1 does not match"),
    ],
)
def test_files_of_other_programs_are_refused(tmp_path, file, fact):
    refusal(tmp_path, (FORMATS / file).read_bytes(), fact)


def test_a_file_without_a_scan_is_refused(tmp_path):
    data = write_e57(tmp_path / "a.e57").read_bytes()
    refusal(tmp_path, data, r"it holds no scan \(0 images\)")
    images = b"<images2D type='Vector'><vectorChild type='Structure'/></images2D></e57Root>"
    xml = xml_of(data).replace(b"</e57Root>", images)
    refusal(tmp_path, with_xml(data, xml), r"it holds no scan \(1 images\)")


def test_groups_of_points_and_other_extensions_are_passed_over(tmp_path):
    data = small(tmp_path)
    groups = b"<pointGroupingSchemes type='Structure'><groupingByLine type='Structure'/></"
    xml = xml_of(data).replace(b"<pose ", groups + b"pointGroupingSchemes><pose ")
    xml = xml.replace(b"<e57Root ", b"<e57Root xmlns:nor='http://example.org/normals' ")
    xml = xml.replace(b"<intensity ", b"<nor:normalX type='Float'/><intensity ")
    xml = xml.replace(b"</e57Root>", b"<nor:cartesianX type='Float'/></e57Root>")
    # The field more has no stream in the packets, so that the points are refused, not the words.
    refusal(tmp_path, with_xml(data, xml), "is not of its points")
    xml = xml.replace(b"<nor:normalX type='Float'/><intensity ", b"<intensity ")
    (tmp_path / "a.e57").write_bytes(with_xml(data, xml))
    assert len(read_scan(tmp_path / "a.e57").points_m) == 2 * COUNT


def test_checksums_are_those_of_the_standard():
    assert crc32c(b"123456789") == 0xE3069283
    rows = np.random.default_rng(1).integers(0, 256, (3, PAYLOAD), np.uint8)
    assert e57_pages.checksums(rows).tolist() == [crc32c(row.tobytes()) for row in rows]


def test_a_flipped_bit_anywhere_is_noticed(tmp_path):
    """Every page is covered by its checksum, but for what no reader needs."""
    data = small(tmp_path)
    rng = random.Random(3)
    for at in [*range(8, 48), *(rng.randrange(48, len(data)) for _ in range(60))]:
        broken = bytearray(data)
        broken[at] ^= 1 << rng.randrange(8)
        refusal(tmp_path, bytes(broken))


def test_every_cut_is_refused(tmp_path):
    data = small(tmp_path)
    for length in [*range(8, 64, 5), *range(64, len(data), 211), len(data) - 1]:
        refusal(tmp_path, data[:length], "it is|incomplete")
        # A cut that fix the header must be seen by what the header leads to.
        whole = data[: length // 1024 * 1024]
        if whole:
            content = payload(whole)
            shown = struct.pack("<Q", len(whole))
            refusal(tmp_path, paged(content[:16] + shown + content[24:]))


@pytest.mark.parametrize(
    ("at", "form", "value", "fact"),
    [
        (8, "<I", 2, "E57 version 2.0 is not 1.0"),
        (16, "<Q", 1, "the header declares 1 bytes"),
        (16, "<Q", 2**64 - 1, "the header declares 18446744073709551615 bytes"),
        (24, "<Q", 0, "is not within its"),
        (24, "<Q", 2**63, "is not within its"),
        (24, "<Q", 1022, "is not within its"),
        (32, "<Q", 0, "is not within its"),
        (32, "<Q", 2**40, "is not within its"),
        (40, "<Q", 0, "pages of 0 bytes"),
        (40, "<Q", 2**20, "pages of 1048576 bytes"),
        (48, "<B", 2, "are not within it"),
        (56, "<Q", 2**50, "are not within it"),
        (64, "<Q", 0, "are not within it"),
        (64, "<Q", 2**63, "are not within it"),
        (80, "<B", 7, "is not of its points"),
        (82, "<H", 0xFFFF, "is not of its points"),
        (82, "<H", 2, "is not of its points"),
        (84, "<H", 3, "is not of its points"),
        (86, "<H", 0, "declares 50 points, the file holds 0"),
        (86, "<H", 399, "declares 50 points, the file holds 49"),
        (86, "<H", 0xFFFF, "is not of its points"),
    ],
)
def test_a_binary_part_that_lies_is_refused(tmp_path, at, form, value, fact):
    """Header at 0, section at 48, its first packet at 80, the bytes of four streams at 86."""
    refusal(tmp_path, with_bytes(small(tmp_path), at, struct.pack(form, value)), fact)


@pytest.mark.parametrize(
    ("old", "new", "fact"),
    [
        (b'recordCount="50"', b'recordCount="49"', "declares 49 points, but more points"),
        (b'recordCount="50"', b'recordCount="51"', "declares 51 points, the file holds 50"),
        (b'recordCount="50"', b'recordCount="9223372036854775807"', "the file holds 50"),
        (b'recordCount="50"', b'recordCount="9223372036854775808"', "beyond 64 bits"),
        (b'recordCount="50"', b'recordCount="-1"', "declares -1 points"),
        (b'recordCount="50"', b'recordCount="many"', "recordCount is 'many'"),
        (b'recordCount="50"', b"", "recordCount is ''"),
        (b'fileOffset="48"', b'fileOffset="0"', "are not within it"),
        (b'fileOffset="48"', b'fileOffset="-48"', "are not within it"),
        (b'fileOffset="48"', b'fileOffset="99999999999"', "are not within it"),
        (b'type="CompressedVector"', b'type="Vector"', "it has no points"),
        (b'maximum="1023"', b'maximum="-1"', "'intensity' lies between 0 and -1"),
        (b'maximum="1023"', b'maximum="9223372036854775807"', "the file holds 8"),
        (b'maximum="1023"', b'maximum="1e3"', "maximum is '1e3'"),
        (b"cartesianX", b"cartesianW", "neither x, y, z nor range"),
        (b'cartesianX type="Float"', b'cartesianX type="Blob"', "is of the type 'Blob'"),
        (b'cartesianX type="Float"', b'cartesianX type="String"', "neither x, y, z nor range"),
        (b"e57Root", b"e58Root", "begins with 'e58Root'"),
        (b"</e57Root>", b"", "its XML cannot be read"),
        (b"<pose ", b"<pose <", "its XML cannot be read"),
        (b"<guid", b"\xff<guid", "its XML cannot be read"),
        (b'<w type="Float">1', b'<w type="Float">one', "w of its rotation is 'one"),
    ],
)
def test_words_that_lie_are_refused(tmp_path, old, new, fact):
    data = small(tmp_path)
    xml = xml_of(data)
    assert old in xml
    refusal(tmp_path, with_xml(data, xml.replace(old, new)), fact)


def test_constants_cannot_declare_points_without_end(tmp_path):
    """Fields of no bits take no bytes, however many points are declared."""
    columns = {name: (Integer(3, 4), [3] * 5) for name in e57.CARTESIAN}
    data = write_e57(tmp_path / "a.e57", E57Scan(columns)).read_bytes()
    xml = xml_of(data).replace(b'maximum="4"', b'maximum="3"')
    (tmp_path / "a.e57").write_bytes(with_xml(data, xml))
    assert read_scan(tmp_path / "a.e57").points_m.tolist() == [[3.0] * 3] * 5
    for shown in (b"1000000000", b"9223372036854775807"):
        lie = xml.replace(b'recordCount="5"', b'recordCount="%s"' % shown)
        refusal(tmp_path, with_xml(data, lie), f"declares {shown.decode()} points, the file holds")
    without_packets = {name: (Integer(3, 3), [3] * 5) for name in e57.CARTESIAN}
    data = write_e57(tmp_path / "a.e57", E57Scan(without_packets)).read_bytes()
    refusal(tmp_path, data, "are not within it")


def test_scans_cannot_share_their_points(tmp_path):
    """However many scans point to them, points are read once."""
    data = write_e57(tmp_path / "a.e57", E57Scan(xyz(cloud(900)))).read_bytes()
    xml = xml_of(data)
    start, end = xml.index(b"<vectorChild"), xml.index(b"</vectorChild>") + len(b"</vectorChild>")
    again = with_xml(data, xml[:end] + xml[start:end] * 3 + xml[end:])
    refusal(tmp_path, again, "several of its scans have the same points")


def test_a_flood_of_empty_packets_is_refused(tmp_path):
    data = write_e57(tmp_path / "a.e57", E57Scan(xyz(cloud(900)))).read_bytes()
    length = struct.unpack_from("<Q", payload(data), 56)[0]
    flood = struct.pack("<BBH", 2, 0, 3) * ((length - 32) // 4)
    refusal(tmp_path, with_bytes(data, 80, flood), "is not of its points")


LAUGHS = b"".join(
    b'<!ENTITY a%d "%s">' % (n, b"&a%d;" % (n - 1) * 10) if n else b'<!ENTITY a0 "ha">'
    for n in range(10)
)


@pytest.mark.parametrize(
    ("before", "text", "fact"),
    [
        (b"<!DOCTYPE e57Root [" + LAUGHS + b"]>", b"&a9;", "declares a document type"),
        (b'<!DOCTYPE e57Root SYSTEM "file:///etc/passwd">', b"", "declares a document type"),
        (b"", b"&a9;", "its XML cannot be read"),
        (b"", b"<a>" * 5000 + b"</a>" * 5000, "nests deeper than 64"),
        (b"", b"<a/>" * 1000, "has more than 300 elements"),
    ],
)
def test_xml_cannot_grow_while_it_is_read(tmp_path, monkeypatch, before, text, fact):
    monkeypatch.setattr(e57_xml, "MAX_ELEMENTS", 300)
    data = small(tmp_path)
    xml = xml_of(data).replace(b"<e57Root", before + b"<e57Root", 1)
    refusal(tmp_path, with_xml(data, xml.replace(b"{file}", b"]]>" + text + b"<![CDATA[")), fact)


def test_xml_beyond_any_scan_file_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(e57_pages, "MAX_XML_BYTES", 1000)
    refusal(tmp_path, small(tmp_path), "its XML has [0-9]+ bytes, 1000 at most")


def test_damaged_bytes_end_in_points_or_in_one_line(tmp_path):
    """Damage with right checksums, as no accident but a program would leave it."""
    data = small(tmp_path)
    rng = random.Random(1)
    content = payload(data)
    path = tmp_path / "rr.e57"
    for _ in range(60):
        broken = bytearray(content)
        for _ in range(rng.randint(1, 3)):
            broken[rng.randrange(40, len(content))] = rng.choice([0, 255, rng.randrange(256)])
        path.write_bytes(paged(bytes(broken)))
        try:
            scan = read_scan(path, name="rr.e57")
        except InputError as error:
            one_line(error)
        else:
            assert len(scan.points_m) + scan.invalid_points == 2 * COUNT


def test_without_its_library_it_says_what_to_install(tmp_path, monkeypatch):
    """Before anything else: the file may be anything that begins like an E57 file."""
    monkeypatch.setattr(importlib.util, "find_spec", lambda _name: None)
    path = tmp_path / "rr.e57"
    path.write_bytes(b"ASTM-E57 and no more")
    with pytest.raises(MissingDependencyError, match=r"pip install 'wheelplane\[e57\]'"):
        read_scan(path)


XML = """<e57Root type="Structure" xmlns="http://www.astm.org/COMMIT/E57/2010-e57-v1.0">
<data3D type="Vector"><vectorChild type="Structure"><name>setup</name><pose type="Structure">
<rotation type="Structure"><w>{w}</w><x>{x}</x><y>{y}</y><z>{z}</z></rotation>
<translation type="Structure"><x>1</x><y>-2</y><z>3e6</z></translation></pose>
<points type="CompressedVector" fileOffset="48" recordCount="{rows}"><prototype type="Structure">
<cartesianX type="Float"/><cartesianY type="Float" precision="single"/>
<cartesianZ type="ScaledInteger" minimum="{low}" maximum="{high}" scale="1e-3"/>
</prototype></points></vectorChild></data3D></e57Root>"""


def declared(folder, rows=5, low=0, high=255, quaternion=(1, 0, 0, 0)):
    text = XML.format(rows=rows, low=low, high=high, **dict(zip("wxyz", quaternion, strict=True)))
    with opened(folder, b"?", "rr.e57") as source:
        (scan,) = find_scans(e57_xml.parse_xml(text.encode(), source), source)
    return scan


@pytest.mark.parametrize("values", [1, 2, 3, 4, 5, 255, 256, 257, 2**32, 2**63, 2**64])
def test_an_integer_field_takes_the_fewest_bits_that_tell_its_values_apart(tmp_path, values):
    """2^bits >= values > 2^(bits - 1), wherever the range begins (table 9)."""
    for low in {-(2**63), -(values // 2), 0} if values < 2**63 else {-(2**63)}:
        scan = declared(tmp_path, low=low, high=low + values - 1)
        bits = {field.name: field.bits for field in scan.fields}
        assert (bits["cartesianX"], bits["cartesianY"]) == (64, 32)
        assert 2 ** bits["cartesianZ"] >= values > 2 ** bits["cartesianZ"] // 2


def test_a_pose_is_that_of_its_quaternion_of_any_length(tmp_path):
    for rotation in Rotation.random(20, random_state=3):
        w_last = rotation.as_quat()
        for length in (1.0, -1.0, 3.0):
            quaternion = (length * w_last[[3, 0, 1, 2]]).tolist()
            T = declared(tmp_path, quaternion=quaternion).part.T_file_scan
            np.testing.assert_allclose(T[:3, :3], rotation.as_matrix(), rtol=0, atol=8 * EPS)
            assert T[:, 3].tolist() == [1.0, -2.0, 3e6, 1.0]


def test_a_scan_holds_the_points_that_were_written_and_no_other_number(tmp_path):
    for kind in (None, Single(), Scaled(0, 1023, 0.5)):
        points = np.arange(3 * COUNT).reshape(-1, 3) if isinstance(kind, Scaled) else cloud()
        path = write_e57(tmp_path / "one.e57", E57Scan(xyz(points, kind)))
        with opened(tmp_path, path.read_bytes(), "rr.e57") as source:
            pages = e57_pages.Pages(source)
            (scan,) = find_scans(e57_xml.parse_xml(e57_pages.read_xml(pages), source), source)
            check_sections(pages, [scan])
            for rows in (COUNT - 20, COUNT + 20, 10 * COUNT):
                with pytest.raises(InputError, match=f"declares {rows} points"):
                    check_sections(pages, [dataclasses.replace(scan, rows=rows)])
            with pytest.raises(InputError, match="have the same points"):
                check_sections(pages, [scan] * 100)
