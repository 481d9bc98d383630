"""Findings about a scan file, for the user before measuring, and its point spacing."""

from __future__ import annotations

import math

import numpy as np

from ..cloud import coordinate_steps
from ..vectors import Array
from .plausibility import better_unit, float32_fact, float32_step, length
from .scan_summary import ScanSummary

USUAL_SIZES_M = (0.05, 500.0)
COARSE_STEP_M = 0.5e-3
FLAT = 1e-4  # rms across a plane, over the spread along it
RIGID = 1e-5  # how far a pose may be from a rotation
QUERIES = 200
BESIDE = 20  # points before and behind in the order of an axis, whose nearest bounds the rest


def spacing_m(summary: ScanSummary) -> float | None:
    """Estimate the distance of neighbours on the scanned surfaces from the sample, metres.

    Points thinned at random are a Poisson process of density d on a surface, whose median distance
    to the nearest is sqrt(ln 2 / (pi d)); a file's own points are a raster of spacing 1 / sqrt(d),
    of which a sixth is enough that most of them still have a neighbour at it. Points in the places
    of others count once.
    """
    sample, places = summary.near_sample_m, float(summary.points)
    if distinct := _distinct(summary):
        sample = np.unique(sample, axis=0)
        places *= distinct / len(summary.keys)
    if len(sample) < 2:
        return None
    chosen = np.random.default_rng(0).permutation(len(sample))[:QUERIES]
    centred = sample - sample.mean(axis=0)
    axis = int(np.argmax(np.ptp(centred, axis=0)))
    order = np.argsort(centred[:, axis], kind="stable")
    rank = np.empty(len(order), np.int64)
    rank[order] = np.arange(len(order))
    ordered = centred.T.take(order, axis=1)
    median = float(np.median([_nearest_m(ordered, axis, int(rank[query])) for query in chosen]))
    poisson = math.sqrt(math.log(2.0) / math.pi)
    return min(median, median / poisson / math.sqrt(places / len(sample)))


def _nearest_m(ordered: Array, axis: int, at: int) -> float:
    """Return the distance of point `at` to its nearest; points (3, N) in the order of an axis."""
    query, place = ordered[:, at], ordered[axis]
    beside = slice(max(at - BESIDE, 0), at + BESIDE + 1)
    bound = _second_m(ordered[:, beside], query) * (1.0 + 1e-9)
    first, last = np.searchsorted(place, [place[at] - bound, place[at] + bound])
    return _second_m(ordered[:, min(first, beside.start) : max(last, beside.stop)], query)


def _second_m(points: Array, query: Array) -> float:
    """Return the distance of `query`, one of the points (3, N), to the nearest of the others."""
    square = np.sum((points - query[:, None]) ** 2, axis=0)
    return math.sqrt(np.partition(square, 1)[1])


def findings(summary: ScanSummary) -> list[str]:
    """Return one sentence for each unusual property."""
    if not summary.points:
        rows = summary.invalid_points
        if not rows:
            return ["it declares 0 points"]
        return [f"it holds no point ({rows} rows, all invalid points)"]
    found = [
        _few_points(summary),
        summary.lone,
        _size(summary),
        _steps(summary),
        _duplicates(summary),
        _origin(summary),
        _flat(summary.near_sample_m),
        *(_pose(scan.name, scan.T_file_scan) for scan in summary.scans),
        *(f"scan {scan.name}: {scan.note}" for scan in summary.scans if scan.note),
        *(f"scan {scan.name} holds no point" for scan in summary.scans if not scan.points),
    ]
    return [text for text in found if text]


def _few_points(summary: ScanSummary) -> str:
    rows = summary.points + summary.invalid_points
    return f"it ends after {rows} of {summary.declared} rows" if _is_short(summary, rows) else ""


def _is_short(summary: ScanSummary, rows: int) -> bool:
    # A text's rows are bounded by its lines, of which some are a header or blank.
    return rows < summary.declared and summary.format not in ("xyz", "asc", "csv", "txt", "pts")


def _size(summary: ScanSummary) -> str:
    size = float(summary.extent_m.max())
    if size == 0.0 or USUAL_SIZES_M[0] <= size <= USUAL_SIZES_M[1]:
        return ""
    hint = better_unit(size, summary.length_unit, "--length-unit {}")
    return f"it is {length(size)} wide: {hint}"


def _steps(summary: ScanSummary) -> str:
    sample = summary.near_sample_m
    if not len(sample):  # a few points among many rows
        return ""
    step, distance = float32_step(sample, summary.length_unit)
    if step >= COARSE_STEP_M:
        return float32_fact(step, distance)
    step = float(coordinate_steps(sample).step_m.max())
    coarse = step >= COARSE_STEP_M * (1.0 - 1e-6)
    return f"its coordinates lie in steps of {length(step)}" if coarse else ""


def _duplicates(summary: ScanSummary) -> str:
    distinct = _distinct(summary)
    if not distinct:
        return ""
    about = "" if summary.stride == 1 else "about "
    return f"{about}{(len(summary.keys) - distinct) * summary.stride} duplicate points"


def _distinct(summary: ScanSummary) -> int:
    """Return how many of the keys differ; 0 where all do."""
    keys = np.sort(summary.keys)
    repeated = int(np.count_nonzero(keys[1:] == keys[:-1]))
    return len(keys) - repeated if repeated else 0


def _origin(summary: ScanSummary) -> str:
    if not summary.at_origin:
        return ""
    return f"{summary.at_origin} points at 0 0 0, probably beams without a return"


def _flat(sample: Array) -> str:
    if len(sample) < 4:
        return ""
    spread = np.linalg.svd(sample - sample.mean(axis=0), compute_uv=False)
    if spread[0] == 0.0:
        return "all points have the same position"
    if spread[1] < FLAT * spread[0]:
        return "all points lie on one line: a coordinate may be lost"
    if spread[2] < FLAT * spread[1]:
        rms = spread[2] / math.sqrt(len(sample))
        return f"all points lie on one plane, rms {rms * 1e3:.3g} mm"
    return ""


def _pose(name: str, T: Array | None) -> str:
    if T is None or np.abs(T[:3, :3].T @ T[:3, :3] - np.eye(3)).max() < RIGID:
        return ""
    scales = np.linalg.norm(T[:3, :3], axis=0)
    factors = ", ".join(f"{scale:.6g}" for scale in scales)
    return f"the pose of scan {name} is not a rotation: it scales its axes by {factors}"
