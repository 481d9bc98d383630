"""Reading speed, side by side: each format with the project's reader and with the fastest known.

    .venv/bin/python -m tests.bench.reading [--runs 7] [--scale 1.0] [--only ply,text] [--cpu]

Both readers in one process, in turn, A B A B ..., after one run of each to warm up. The ratio is of
the least times, which other work on the machine disturbs least; a missed limit is printed and gives
exit code 1. --cpu counts processor time, that of children too, where the machine is busy.
"""

from __future__ import annotations

import argparse
import ctypes
import importlib.util
import os
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ[variable] = "1"  # as the command sets it; Open3D and lazrs have threads of their own

import numpy as np  # noqa: E402

from tests.fuzzing.e57 import UPRIGHT, e57_file  # noqa: E402
from wheelplane.readers import read_scan  # noqa: E402

Columns = tuple[np.ndarray, np.ndarray]  # points (N, 3), intensity (N,)


@dataclass(frozen=True)
class Contest:
    """A format: its suffix, its size, who writes a file, who reads it, what is demanded.

    limit: of our time over theirs.
    """

    name: str
    suffix: str
    points: int
    write: Callable[[Path, Columns], None]
    rival: str
    read: Callable[[Path], np.ndarray]
    limit: float
    needs: str = ""


def cloud(points: int) -> Columns:
    """A rough plane of 10 m with coordinates on a grid of 0.1 mm, as LAS stores them."""
    rng = np.random.default_rng(0)
    xyz = rng.uniform(-5.0, 5.0, (points, 3)) * [1.0, 1.0, 0.02]
    return np.round(xyz, 4), np.floor(rng.uniform(0, 4096, points))


def write_ply(path: Path, columns: Columns) -> None:
    table = records(columns)
    head = ["ply", "format binary_little_endian 1.0", f"element vertex {len(table)}"]
    head += [*(f"property double {axis}" for axis in "xyz"), "property float intensity"]
    path.write_bytes(("\n".join([*head, "end_header"]) + "\n").encode() + table.tobytes())


def write_pcd(path: Path, columns: Columns) -> None:
    table = records(columns)
    head = (
        "VERSION 0.7\nFIELDS x y z intensity\nSIZE 8 8 8 4\nTYPE F F F F\nCOUNT 1 1 1 1\n"
        f"WIDTH {len(table)}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {len(table)}\nDATA binary\n"
    )
    path.write_bytes(head.encode() + table.tobytes())


def records(columns: Columns) -> np.ndarray:
    xyz, shade = columns
    table = np.empty(len(xyz), [("x", "<f8"), ("y", "<f8"), ("z", "<f8"), ("i", "<f4")])
    table["x"], table["y"], table["z"], table["i"] = *xyz.T, shade
    return table


def write_text(path: Path, columns: Columns, delimiter: str = " ") -> None:
    np.savetxt(path, columns[0], fmt="%.6f", delimiter=delimiter)


def write_csv(path: Path, columns: Columns) -> None:
    write_text(path, columns, ",")


def write_e57(path: Path, columns: Columns) -> None:
    path.write_bytes(e57_file(columns[0], (UPRIGHT,)))


def write_single_e57(path: Path, columns: Columns) -> None:
    """Coordinates and intensity in single precision, as pye57 writes them."""
    import pye57

    xyz, shade = columns
    x, y, z = (np.ascontiguousarray(xyz[:, axis]) for axis in range(3))
    with pye57.E57(str(path), mode="w") as file:
        file.write_scan_raw(
            {"cartesianX": x, "cartesianY": y, "cartesianZ": z, "intensity": shade.astype("f4")}
        )


def write_las(path: Path, columns: Columns) -> None:
    import laspy

    xyz, shade = columns
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.scales, header.offsets = np.full(3, 1e-4), np.zeros(3)
    las = laspy.LasData(header)
    las.x, las.y, las.z, las.intensity = *xyz.T, shade.astype(np.uint16)
    las.write(str(path))


def open3d_tensor(path: Path) -> np.ndarray:
    import open3d

    return open3d.t.io.read_point_cloud(str(path)).point.positions.numpy()


def loadtxt(path: Path) -> np.ndarray:
    return np.loadtxt(path, delimiter="," if path.suffix == ".csv" else None)


def pye57_raw(path: Path) -> np.ndarray:
    import pye57

    with pye57.E57(str(path)) as file:
        columns = file.read_scan_raw(0)
    return np.array([columns[f"cartesian{axis}"][[0, -1]] for axis in "XYZ"]).T


def laspy_read(path: Path) -> np.ndarray:
    import laspy

    las = laspy.read(str(path))
    return np.asarray(las.xyz)


CONTESTS = (
    Contest("PLY, binary", ".ply", 2_000_000, write_ply, "Open3D t.io", open3d_tensor, 1.0),
    Contest("PCD, binary", ".pcd", 2_000_000, write_pcd, "Open3D t.io", open3d_tensor, 1.0),
    Contest("E57, double", ".e57", 5_000_000, write_e57, "pye57 raw", pye57_raw, 1.2, "pye57"),
    Contest(
        "E57, single", ".e57", 5_000_000, write_single_e57, "pye57 raw", pye57_raw, 1.2, "pye57"
    ),
    Contest("LAS", ".las", 5_000_000, write_las, "laspy", laspy_read, 1.2, "laspy"),
    Contest("LAZ", ".laz", 5_000_000, write_las, "laspy, lazrs", laspy_read, 1.2, "lazrs"),
    Contest("text, blanks", ".xyz", 1_000_000, write_text, "numpy.loadtxt", loadtxt, 1.2),
    Contest("text, commas", ".csv", 1_000_000, write_csv, "numpy.loadtxt", loadtxt, 1.2),
)


@dataclass(frozen=True)
class Times:
    """Seconds of each run, ours and theirs in turn."""

    ours: list[float]
    theirs: list[float]

    @property
    def ratio(self) -> float:
        """Our least time over theirs."""
        return min(self.ours) / min(self.theirs)


def processor_time() -> float:
    """Seconds of this process and of the children that have ended."""
    return time.process_time() + sum(os.times()[2:4])


def compete(contest: Contest, path: Path, runs: int, clock: Callable[[], float]) -> Times:
    """Read the file in turn, and check that both read the same points."""
    ours, theirs = read_scan(path).points_m, contest.read(path)
    assert np.array_equal(ours[[0, -1]], theirs[[0, -1]]), f"{contest.name}: other points were read"
    del ours, theirs
    times = Times([], [])
    for _ in range(runs):
        for reader, seconds in ((read_scan, times.ours), (contest.read, times.theirs)):
            start = clock()
            reader(path)
            seconds.append(clock() - start)
    return times


def load_libusb() -> None:
    """What Open3D needs of the system on a bare server."""
    if importlib.util.find_spec("libusb_package"):
        import libusb_package

        ctypes.CDLL(str(libusb_package.get_library_path()), mode=ctypes.RTLD_GLOBAL)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--runs", type=int, default=7)
    parser.add_argument("--scale", type=float, default=1.0, help="of the numbers of points")
    parser.add_argument("--only", default="", help="suffixes or names, comma between")
    parser.add_argument("--cpu", action="store_true", help="processor time, not time")
    options = parser.parse_args()
    clock = processor_time if options.cpu else time.perf_counter
    load_libusb()
    wanted = [word for word in options.only.lower().split(",") if word]
    print("| format | points | MB | ours, s: min, median | rival | theirs, s | ratio | limit | |")
    print("|---|---|---|---|---|---|---|---|---|")
    missed = 0
    for contest in CONTESTS:
        if wanted and not any(word in contest.name.lower() for word in wanted):
            continue
        if contest.needs and not importlib.util.find_spec(contest.needs):
            print(f"| {contest.name} | needs {contest.needs} |")
            continue
        points = int(contest.points * options.scale)
        with tempfile.TemporaryDirectory() as scratch:
            path = Path(scratch) / f"scan{contest.suffix}"
            contest.write(path, cloud(points))
            times = compete(contest, path, options.runs, clock)
            size = path.stat().st_size / 1e6
        met = times.ratio <= contest.limit
        missed += not met
        print(
            f"| {contest.name} | {points} | {size:.0f} | {shown(times.ours)} | {contest.rival} "
            f"| {shown(times.theirs)} | {times.ratio:.2f} | {contest.limit} "
            f"| {'met' if met else 'MISSED'} |",
            flush=True,
        )
    sys.exit(1 if missed else 0)


def shown(seconds: list[float]) -> str:
    return f"{min(seconds):.3f}, {statistics.median(seconds):.3f}"


if __name__ == "__main__":
    main()
