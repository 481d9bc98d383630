"""One car, written in every format by writers of our own: the same angles from all of them."""

from __future__ import annotations

import functools
import gzip
import struct
import zipfile
from pathlib import Path

import numpy as np
import pytest

from tests.measurement.test_measure import NAMES, scans
from tests.support.native_files import Double, E57Scan, pose, write_e57, write_las, xyz
from tests.support.scenes import Setup, rotation
from wheelplane.capture.open_capture import open_capture
from wheelplane.config import Config
from wheelplane.errors import InputError
from wheelplane.measure import measure_capture

SEED = 4
SETUP = Setup(spacing_m=0.004, half_width_m=0.17, pairs=6)
LAS_STEP_M = 1e-4
ARCSEC = np.pi / 648_000


@functools.cache
def clouds():
    """Points in metres of the four wheels, rounded to what every format below can hold."""
    _, found = scans(SEED, SETUP)
    return [np.round(points / LAS_STEP_M) * LAS_STEP_M for points in found]


def quaternion(R):
    """w, x, y, z of a rotation, by its largest part (Shepperd 1978)."""
    w = np.sqrt(max(0.0, 1.0 + np.trace(R))) / 2
    x, y, z = (R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]) / (4 * w)
    return w, x, y, z


def turned(seed):
    """A rotation by less than half a turn, and a shift."""
    rng = np.random.default_rng(seed)
    R = rotation(rng)
    while np.trace(R) < 0.0:
        R = rotation(rng)
    return R, rng.uniform(-50, 50, 3)


def text(points, delimiter=" ", comma=False):
    lines = "".join(delimiter.join(map(repr, row)) + "\n" for row in points.tolist())
    return lines.replace(".", ",") if comma else lines


def write_ptx(path, points):
    R, t = turned(1)
    local = (points - t) @ R
    T = np.vstack([np.column_stack([R.T, np.zeros(3)]), [*t, 1.0]])
    head = [f"{len(local) + 1}", "1", text(t[None]), text(R.T), text(T), "0 0 0 0.5\n"]
    body = text(np.column_stack([local, np.full(len(local), 0.5)]))
    path.write_text("\n".join(part.rstrip("\n") for part in head) + "\n" + body)


def write_pts(path, points):
    half = len(points) // 2
    path.write_text("".join(f"{len(p)}\n{text(p)}" for p in (points[:half], points[half:])))


def write_ply(path, points):
    head = f"ply\nformat binary_big_endian 1.0\nelement vertex {len(points)}\n"
    head += "".join(f"property double {axis}\n" for axis in "xyz") + "end_header\n"
    path.write_bytes(head.encode() + points.astype(">f8").tobytes())


def write_pcd(path, points):
    head = "VERSION 0.7\nFIELDS x y z\nSIZE 8 8 8\nTYPE F F F\nCOUNT 1 1 1\n"
    head += f"WIDTH {len(points)}\nHEIGHT 1\nPOINTS {len(points)}\nDATA binary\n"
    path.write_bytes(head.encode() + points.astype("<f8").tobytes())


def write_posed_e57(path, points):
    R, t = turned(2)
    write_e57(path, E57Scan(xyz((points - t) @ R, Double()), pose=pose(quaternion(R), t)))


def write_whole_las(path, points):
    integers = np.rint(points / LAS_STEP_M).astype(np.int64)
    none = np.zeros(len(points), np.int64)
    write_las(path, integers, none, scale=(LAS_STEP_M,) * 3, shift=(0.0,) * 3)


def write_stl(path, points):
    """A speck of a triangle a point: as float32, as the format is."""
    specks = np.repeat(points.astype("<f4"), 3, axis=0).reshape(-1, 9)
    body = b"".join(struct.pack("<12fH", 0, 0, 1, *speck, 0) for speck in specks.tolist())
    path.write_bytes(bytes(80) + struct.pack("<I", len(points)) + body)


def write_zip(path, points):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("scan.xyz", text(points))


WRITERS = {
    "ply": write_ply,
    "pcd": write_pcd,
    "ptx": write_ptx,
    "pts": write_pts,
    "xyz": lambda path, points: path.write_text(text(points)),
    "csv": lambda path, points: path.write_text("X;Y;Z\n" + text(points, ";", comma=True)),
    "npy": np.save,
    "npz": lambda path, points: np.savez(path, points=points),
    "obj": lambda path, points: path.write_text("v " + text(points).replace("\n", "\nv ")[:-2]),
    "stl": write_stl,
    "e57": write_posed_e57,
    "las": write_whole_las,
    "laz": write_whole_las,
    "txt.gz": lambda path, points: path.write_bytes(gzip.compress(text(points).encode())),
    "zip": write_zip,
}
# Poses and scaled integers round once or twice more; STL is float32, 0.24 um at 4 m.
BOUND_M = {"ptx": 1e-13, "e57": 1e-13, "las": 1e-14, "laz": 1e-14, "stl": 1e-6}


def measured(folder: Path, suffix: str):
    """Toe and camber (4, 2), radians, and what was seen, by the whole way from files."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, points in zip(NAMES, clouds(), strict=True):
        WRITERS[suffix](folder / f"{name.lower()}.{suffix}", points)
    with open_capture(folder, "disc-250") as capture:
        return measure_capture(capture, Config())


def angles(measurement):
    return np.array(
        [[wheel.angles.toe_rad, wheel.angles.camber_rad] for wheel in measurement.wheels]
    )


@pytest.fixture(scope="module")
def reference(tmp_path_factory):
    return measured(tmp_path_factory.mktemp("reference"), "ply")


@pytest.mark.parametrize("suffix", sorted(set(WRITERS) - {"ply"}))
def test_every_format_gives_the_same_angles(suffix, reference, tmp_path):
    found = measured(tmp_path / suffix, suffix)
    # A plane turns by at most a shift of its points over its radius; the centres turn the frame by
    # less. The search is robust: points change sides only where they lie on a threshold.
    bound = 0.01 * ARCSEC + 20 * BOUND_M.get(suffix, 0.0) / 0.125
    assert np.abs(angles(found) - angles(reference)).max() <= bound
    if suffix not in BOUND_M:
        assert angles(found).tolist() == angles(reference).tolist()


def test_the_bound_would_see_a_scan_in_another_order_of_its_wheels(reference):
    assert np.ptp(angles(reference), axis=0).min() > 100 * ARCSEC


@pytest.mark.parametrize(
    ("shown", "factor", "says"),
    [
        ("m", 1e3, r'wide in m, and nowhere .* if the file is in mm, .* give length_unit = "mm"'),
        ("mm", 1.0, r'wide in mm, its target 250 mm: .* give length_unit = "m"'),
    ],
)
def test_a_capture_in_another_unit_is_refused_with_the_right_one(shown, factor, says, tmp_path):
    for name, points in zip(NAMES, clouds(), strict=True):
        np.save(tmp_path / f"{name.lower()}.npy", points * factor)
    reference = "".join(f'{name} = "{name.lower()}.npy"\n' for name in NAMES)
    (tmp_path / "capture.toml").write_text(f'length_unit = "{shown}"\n[reference]\n{reference}')
    with (
        open_capture(tmp_path, "disc-250") as capture,
        pytest.raises(InputError, match=rf"rr\.npy: .*{says}"),
    ):
        measure_capture(capture, Config())
