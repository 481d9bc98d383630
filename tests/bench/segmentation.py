"""Plane of a target in a cloud in memory: time, error and memory, beside other programs.

    .venv/bin/python -m tests.bench.segmentation [--points 1000000 5000000] [--runs 7]
    .venv/bin/python -m tests.bench.segmentation --growth [--largest 100000000] [--svg growth.svg]

35 % of the points lie on the target, the others on rim, tyre, body panel and floor, 1 % anywhere.
One process, warm, the ways in turn (A B A B ...); median and spread. Open3D gets 1,000 iterations,
3 points and our threshold. pyRANSAC-3D and scikit-learn are compared where they are found: install
them with `pip install --target DIR pyransac3d scikit-learn` and name the folder by --rivals DIR.
"""

from __future__ import annotations

import argparse
import ctypes
import json
import os
import resource
import statistics
import subprocess
import sys
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

os.environ["OPENBLAS_NUM_THREADS"] = "1"  # as the command does; Open3D's own threads are left to it

import numpy as np

from tests.support.vehicle_scenes import RADIUS_M, VehicleCloud, face_cloud
from wheelplane.centre.locate_centre import locate_centre
from wheelplane.centre.target_view import TargetView
from wheelplane.config import Config
from wheelplane.detection.find_target import find_target
from wheelplane.plane.fit_plane import PlaneFit, fit_plane
from wheelplane.report.plots.drawing import CircleMark, Drawing, Mark, Text
from wheelplane.report.plots.drawing import Path as Line
from wheelplane.report.plots.validation import BLUE, GREY, ORANGE
from wheelplane.targets.plates import DiscTarget

CONFIG = Config()
DISC = DiscTarget(shape="disc", diameter=2.0 * RADIUS_M)
THRESHOLD_M = CONFIG.segment.threshold_of_diameter * DISC.diameter
ITERATIONS = 1000
ARCSEC = np.degrees(1.0) * 3600.0
GIBIBYTE = 1 << 30
Way = Callable[[], np.ndarray]


def ours(points_m: np.ndarray) -> PlaneFit:
    """The target found, and its plane."""
    patch = find_target(points_m, DISC, CONFIG.segment, 0)
    return fit_plane(patch, DISC, CONFIG.plane)


def open3d_way(points_m: np.ndarray) -> Way:
    """segment_plane on a cloud that is in Open3D's memory before the clock starts."""
    try:
        import libusb_package

        ctypes.CDLL(str(libusb_package.get_library_path()), mode=ctypes.RTLD_GLOBAL)
    except ImportError:
        pass
    import open3d

    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points_m))
    return lambda: np.array(cloud.segment_plane(THRESHOLD_M, 3, ITERATIONS)[0][:3])


def pyransac_way(points_m: np.ndarray) -> Way:
    """pyRANSAC-3D's plane, all points, as many iterations."""
    import pyransac3d

    return lambda: np.array(
        pyransac3d.Plane().fit(points_m, thresh=THRESHOLD_M, maxIteration=ITERATIONS)[0][:3]
    )


def sklearn_way(points_m: np.ndarray) -> Way:
    """scikit-learn's RANSACRegressor of z on x, y; it stops when it is 99 % sure."""
    from sklearn.linear_model import RANSACRegressor

    def way() -> np.ndarray:
        regressor = RANSACRegressor(
            min_samples=3, residual_threshold=THRESHOLD_M, max_trials=ITERATIONS, random_state=0
        )
        regressor.fit(points_m[:, :2], points_m[:, 2])
        return np.array([*regressor.estimator_.coef_, -1.0])

    return way


def off_rad(normal: np.ndarray, truth: np.ndarray) -> float:
    """Angle between two lines."""
    return float(np.arctan2(np.linalg.norm(np.cross(normal, truth)), abs(normal @ truth)))


def in_turn(ways: dict[str, Way], runs: int) -> dict[str, list[float]]:
    """Seconds of each way, A B A B ..., after one of each that does not count."""
    seconds: dict[str, list[float]] = {name: [] for name in ways}
    for run in range(runs + 1):
        for name, way in ways.items():
            start = time.perf_counter()
            way()
            if run:
                seconds[name].append(time.perf_counter() - start)
    return seconds


def spread(seconds: Sequence[float]) -> str:
    """Median, least and most."""
    low, middle, high = min(seconds), statistics.median(seconds), max(seconds)
    return f"{middle * 1e3:,.0f} ms ({low * 1e3:,.0f} to {high * 1e3:,.0f})"


def compare_speed(count: int, runs: int) -> None:
    """Against Open3D, and against copying the points."""
    cloud = face_cloud(count)
    points = cloud.points_m
    theirs = open3d_way(points)
    mine = {"ours": lambda: ours(points).normal}
    seconds = in_turn({**mine, "Open3D": theirs}, runs)
    beside = in_turn({**mine, "copy": lambda: points.copy()}, runs)
    seconds["copy"] = beside["copy"]
    medians = {name: statistics.median(times) for name, times in seconds.items()}
    print(
        f"| {count:,} | {spread(seconds['ours'])} | {spread(seconds['Open3D'])} "
        f"| {medians['Open3D'] / medians['ours']:.0f} x | {spread(seconds['copy'])} "
        f"| {statistics.median(beside['ours']) / medians['copy']:.1f} "
        f"| {_error(ours(points).normal, cloud)} | {_error(theirs(), cloud)} |",
        flush=True,
    )


def _error(normal: np.ndarray, cloud: VehicleCloud) -> str:
    normal = normal / np.linalg.norm(normal)
    return f'{off_rad(normal, cloud.normal) * ARCSEC:.1f}"'


def compare_rivals(count: int, folder: Path | None, runs: int) -> None:
    """Against pyRANSAC-3D and scikit-learn."""
    if folder is not None:
        sys.path.append(str(folder))
    cloud = face_cloud(count)
    points = cloud.points_m
    for name, rival in (("pyRANSAC-3D", pyransac_way), ("RANSACRegressor", sklearn_way)):
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                way = rival(points)
        except ImportError as error:
            print(f"| {name} | left out ({error}): see the top of this file | | |")
            continue
        seconds = in_turn({"ours": lambda: ours(points).normal, name: way}, runs)
        ratio = statistics.median(seconds[name]) / statistics.median(seconds["ours"])
        print(
            f"| {name} | {count:,} | {spread(seconds[name])} | {ratio:.0f} x "
            f"| {_error(way(), cloud)} | {_error(ours(points).normal, cloud)} |",
            flush=True,
        )


def compare_accuracy(count: int, seeds: int) -> None:
    """Against least squares on the points that truly lie on the target."""
    errors = []
    for seed in range(seeds):
        cloud = face_cloud(count, seed)
        on_face = cloud.points_m[cloud.on_face]
        oracle = np.linalg.svd(on_face - on_face.mean(axis=0), full_matrices=False)[2][2]
        found = (ours(cloud.points_m).normal, oracle)
        errors.append([off_rad(normal, cloud.normal) * ARCSEC for normal in found])
    error, best = np.array(errors).T
    rms, rms_best = np.sqrt(np.mean(error**2)), np.sqrt(np.mean(best**2))
    print(
        f'{seeds} seeds of {count:,} points: rms {rms:.2f}", least squares on the true points '
        f'{rms_best:.2f}", ratio {rms / rms_best:.3f}; worst {error.max():.2f}" '
        f"= {error.max() / rms_best:.2f} times its rms",
        flush=True,
    )


def answer(points_m: np.ndarray) -> np.ndarray:
    """Normal (3,), offset, centre (3,) of the target."""
    patch = find_target(points_m, DISC, CONFIG.segment, 0)
    plane = fit_plane(patch, DISC, CONFIG.plane)
    fitted = locate_centre(TargetView(patch, plane, DISC, CONFIG.centre))
    return np.array([*plane.normal, -plane.normal @ plane.centroid_m, *fitted.centre_m])


def compare_orders(count: int, permutations: int = 3) -> None:
    """Other orders of the points, and one thread against two."""
    points = face_cloud(count).points_m
    first = answer(points)
    rng = np.random.default_rng(1)
    off = max(
        float(np.abs(answer(rng.permutation(points)) - first).max()) for _ in range(permutations)
    )
    shown = {threads: _child(["--answer", str(count)], threads) for threads in (1, 2)}
    same = "the same bits" if shown[1] == shown[2] else "DIFFERENT"
    print(
        f"{count:,} points: other orders change normal, offset and centre by {off:.1e} at most; "
        f"1 and 2 threads give {same}",
        flush=True,
    )


def _child(arguments: Sequence[str], threads: int | None = None) -> str:
    """What this file prints as a process of its own."""
    environment = dict(os.environ)
    if threads is not None:
        environment["WHEELPLANE_THREADS"] = str(threads)
    command = [sys.executable, "-m", "tests.bench.segmentation", *arguments]
    return subprocess.run(
        command, env=environment, check=True, capture_output=True, text=True
    ).stdout


@dataclass(frozen=True)
class Size:
    """Of one cloud: points, median seconds of ours and of a copy, peak memory, the points' own."""

    points: int
    seconds: float
    copy_seconds: float
    peak_gib: float

    @property
    def own_gib(self) -> float:
        return self.points * 24.0 / GIBIBYTE


def one_size(count: int, runs: int) -> Size:
    """Within 8 GiB of address space, for which this process is alone."""
    resource.setrlimit(resource.RLIMIT_AS, (8 * GIBIBYTE, 8 * GIBIBYTE))
    points = face_cloud(count).points_m
    mine = in_turn({"ours": lambda: ours(points).normal}, runs)["ours"]
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / GIBIBYTE
    copy = in_turn({"copy": lambda: points.copy()}, runs)["copy"]
    return Size(count, statistics.median(mine), statistics.median(copy), peak)


def growth(largest: int, runs: int, svg: Path | None) -> None:
    """Time and memory from 1e5 points up, a process each."""
    steps = round(2.0 * np.log10(largest / 1e5))
    counts = [round(1e5 * 10.0 ** (step / 2.0)) for step in range(steps + 1)]
    print("| points | time | ns a point | one copy | copies | peak memory | the cloud's own |")
    print("|---:|---:|---:|---:|---:|---:|---:|")
    sizes = []
    for count in counts:
        shown = _child(["--one", str(count), "--runs", str(runs)])
        size = Size(**json.loads(shown))
        sizes.append(size)
        print(
            f"| {count:,} | {size.seconds * 1e3:,.0f} ms | {size.seconds / count * 1e9:.1f} "
            f"| {size.copy_seconds * 1e3:,.0f} ms | {size.seconds / size.copy_seconds:.1f} "
            f"| {size.peak_gib:.2f} GiB | {size.own_gib:.2f} GiB |",
            flush=True,
        )
    print(f"slope over all {_slope(sizes):.2f}, over the larger half {_slope(_larger(sizes)):.2f}")
    if svg is not None:
        svg.write_text(growth_svg(sizes), encoding="utf-8")
        print(f"wrote {svg}")


def _larger(sizes: Sequence[Size]) -> Sequence[Size]:
    return sizes[len(sizes) // 2 :]


def _slope(sizes: Sequence[Size]) -> float:
    """Power of the points by which the time grows."""
    if len(sizes) < 2:
        return float("nan")
    count, seconds = ([getattr(s, key) for s in sizes] for key in ("points", "seconds"))
    return float(np.polyfit(np.log10(count), np.log10(seconds), 1)[0])


WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 720, 460, 80, 150, 64, 60


def growth_svg(sizes: Sequence[Size]) -> str:
    """Time against points, both logarithmic; a line of slope 1, and that of a copy beside it."""
    all_seconds = [s for size in sizes for s in (size.seconds, size.copy_seconds)]
    low, high = (int(f(np.log10(g(all_seconds)))) for f, g in ((np.floor, min), (np.ceil, max)))
    first, last = np.log10(sizes[0].points), np.log10(sizes[-1].points)

    def x(points: float) -> float:
        return LEFT + (np.log10(points) - first) / (last - first) * (WIDTH - LEFT - RIGHT)

    def y(seconds: float) -> float:
        share = (np.log10(seconds) - low) / (high - low)
        return HEIGHT - BOTTOM - share * (HEIGHT - TOP - BOTTOM)

    slope = _slope(_larger(sizes))
    title = "A target's plane out of a cloud in memory"
    marks: list[Mark] = [
        Text(LEFT, 24, title, bold=True),
        Text(LEFT, 44, f"slope {slope:.2f} over the larger half; dotted: slope 1"),
        Text((LEFT + WIDTH - RIGHT) / 2, HEIGHT - 14, "points", anchor="middle"),
        Text(12, TOP - 8, "seconds"),
    ]
    for power in range(int(np.ceil(first)), int(last) + 1):
        at = x(10.0**power)
        marks.append(Line([(at, TOP), (at, HEIGHT - BOTTOM)], GREY, 0.2))
        marks.append(Text(at, HEIGHT - BOTTOM + 18, f"{10**power:,}", anchor="middle"))
    for power in range(low, high + 1):
        at = y(10.0**power)
        marks.append(Line([(LEFT, at), (WIDTH - RIGHT, at)], GREY, 0.2))
        marks.append(Text(LEFT - 8, at + 4, f"{10.0**power:g}", anchor="end"))
    end = sizes[-1]
    start_s = max(end.seconds * sizes[0].points / end.points, 10.0**low)
    start = end.points * start_s / end.seconds
    ends = [(x(start), y(start_s)), (x(end.points), y(end.seconds))]
    marks.append(Line(ends, GREY, 1.0, dash=(2.0, 4.0)))
    for key, name, colour in (
        ("seconds", "wheelplane", BLUE),
        ("copy_seconds", "one copy", ORANGE),
    ):
        track = [(x(size.points), y(getattr(size, key))) for size in sizes]
        marks.append(Line(track, colour, 1.6))
        marks += [CircleMark(a, b, 3.5, colour) for a, b in track]
        label = f"{name}, {getattr(end, key):.2g} s"
        marks.append(Text(track[-1][0] + 10, track[-1][1] + 4, label, colour=colour))
    return Drawing(WIDTH, HEIGHT, title, marks).svg


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--points", type=int, nargs="*", default=[1_000_000, 5_000_000])
    parser.add_argument("--runs", type=int, default=7)
    parser.add_argument("--seeds", type=int, default=100)
    parser.add_argument("--rivals", type=Path)
    parser.add_argument("--growth", action="store_true")
    parser.add_argument("--largest", type=int, default=100_000_000)
    parser.add_argument("--svg", type=Path)
    parser.add_argument("--answer", type=int, help=argparse.SUPPRESS)
    parser.add_argument("--one", type=int, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.answer:
        print(answer(face_cloud(options.answer).points_m).tobytes().hex())
    elif options.one:
        print(json.dumps(vars(one_size(options.one, options.runs))))
    elif options.growth:
        growth(options.largest, options.runs, options.svg)
    else:
        print("| points | wheelplane | Open3D | ratio | one copy | copies | error | Open3D's |")
        print("|---:|---:|---:|---:|---:|---:|---:|---:|")
        for count in options.points:
            compare_speed(count, options.runs)
        print("\n| | points | time | ratio | error | ours |\n|---|---:|---:|---:|---:|---:|")
        for count in options.points:
            compare_rivals(count, options.rivals, max(options.runs // 3, 1))
        print()
        compare_accuracy(200_000, options.seeds)
        for count in options.points:
            compare_orders(count)


if __name__ == "__main__":
    main()
