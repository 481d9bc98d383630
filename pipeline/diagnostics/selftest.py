"""The fits that measure, on data with certified answers."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import numpy as np

from ..centre import fit_edge_points
from ..errors import InputError
from ..plane import (
    ClipSlab,
    find_planes,
    fit_clipped_plane,
    plane_of_all,
    total_least_squares,
)
from ..readers import read_scan
from ..system import frozen
from ..targets import Circle, Region
from ..vectors import Array, plane_basis

PLANES = tuple(f"pla{number}" for number in range(1, 31))
CIRCLES = ("cir7", "cir10", "cir20", "cir25")
BOUND = 1e-9  # degrees for directions, the data's own unit for lengths
START_TILT = 0.01  # rad, of the slab in which the clipping starts, as detection may leave it
# Length taken for the data's unit where circles are fitted: residuals are then so far below the
# edge fit's least robust scale (20 um) that all points weigh alike, as NIST's definition has it.
CIRCLE_UNIT_M = 1e-7
PCL_PLANE, PCL_BOUND = (-0.8964, -0.5868, -1.208), 0.1  # (a, b, c) / d
PCL_INLIERS, PCL_WITHIN_M = 2000, 0.03


@frozen
class FittedPlane:
    """Plane through centroid_m (3,) with the unit normal (3,)."""

    normal: Array
    centroid_m: Array


FitPlane = Callable[[Array], FittedPlane]


@frozen
class Figure:
    """One figure and its bound: at most the bound or, where `above`, more than it."""

    name: str
    unit: str
    value: float
    bound: float
    above: bool = False

    @property
    def passed(self) -> bool:
        """Whether the figure keeps its bound; False for NaN."""
        return self.value > self.bound if self.above else self.value <= self.bound


@frozen
class Check:
    """Data set and the deviations of a fit from its certified answer. kind: of the fit."""

    kind: str
    name: str
    points: int
    figures: tuple[Figure, ...]

    @property
    def passed(self) -> bool:
        """Whether all figures keep their bounds."""
        return all(figure.passed for figure in self.figures)


def certified_folder() -> Path:
    """Return the folder of the certified data, which ships with the package."""
    return Path(__file__).parent / "certified"


def least_squares_plane(points: Array) -> FittedPlane:
    """Fit points (N, 3) by total least squares, as sparse scans and `wheelplane plane` do."""
    plane = plane_of_all(points)
    return FittedPlane(plane.normal, plane.centroid_m)


def clipped_plane(points: Array) -> FittedPlane:
    """Fit points (N, 3) as the points of a target are, but with nothing clipped.

    The slab is tilted at first, and its resolution is so coarse that it keeps every point.
    """
    local = points - points[0]
    reach = float(np.linalg.norm(local, axis=1).max())
    first, _, normal = total_least_squares(local).basis
    normal = normal + START_TILT * first
    slab = ClipSlab(plane_basis(normal / np.linalg.norm(normal)), 0.0, 0.0, 2.0 * reach)
    region = Region(Circle(2.0 * reach))
    fit = fit_clipped_plane(local, region, slab, reach, across=1, max_iterations=20)
    return FittedPlane(fit.normal, points[0] + fit.centroid_m)


PLANE_FITS: Mapping[str, FitPlane] = {
    "plane": least_squares_plane,
    "clipped-plane": clipped_plane,
}


def run_selftest(
    folder: Path | None = None, plane_fits: Mapping[str, FitPlane] = PLANE_FITS
) -> Iterator[Check]:
    """Yield the checks: the planes of NIST by each fit, the circles of NIST, the plane of PCL.

    plane_fits: the fits under test by the kind of their checks; circles take 'clipped-plane'.
    Raises InputError for a data file that is missing or damaged.
    """
    folder = folder or certified_folder()
    for kind, fit_plane in plane_fits.items():
        for name in PLANES:
            points, answer = _pair(folder / "nist" / "plane" / name, 6)
            yield Check(kind, name, len(points), _plane_figures(fit_plane(points), answer))
    for name in CIRCLES:
        points, answer = _pair(folder / "nist" / "circle" / name, 7)
        plane = plane_fits["clipped-plane"](points)
        yield Check("circle", name, len(points), _circle_figures(points, answer, plane))
    scan = read_scan(folder / "pcl" / "sac_plane_test.pcd")
    yield Check("scene", "sac_plane_test", len(scan.points_m), _pcl_figures(scan.points_m))


def digest(folder: Path | None = None) -> str:
    """Return the digest of the names and bytes of all certified files: `sha256:` and 64 digits."""
    folder = folder or certified_folder()
    total = hashlib.sha256()
    for path in sorted(
        path for path in folder.rglob("*") if path.suffix in (".ds", ".fit", ".pcd")
    ):
        total.update(f"{path.relative_to(folder).as_posix()}\0".encode())
        total.update(hashlib.sha256(path.read_bytes()).digest())
    return f"sha256:{total.hexdigest()}"


def _pair(path: Path, numbers: int) -> tuple[Array, Array]:
    """Read points (N, 3) and certified answer (`numbers`,) from the files `path`.ds and .fit."""
    count, *coordinates = _numbers(path.with_suffix(".ds")) or [0.0]
    answer = _numbers(path.with_suffix(".fit"))
    if count < 3 or len(coordinates) != 3 * count or len(answer) != numbers:
        fact = f"{len(coordinates)} coordinates of {count:g} points, {len(answer)} of the answer"
        raise _damaged(path.with_suffix(".ds"), fact)
    return np.reshape(coordinates, (-1, 3)), np.array(answer)


def _numbers(path: Path) -> list[float]:
    """Read all numbers of a file; float() rounds a decimal of any length correctly."""
    try:
        return [float(word) for word in path.read_text(encoding="ascii").split()]
    except (OSError, ValueError) as error:
        raise _damaged(path, str(error)) from error


def _damaged(path: Path, fact: str) -> InputError:
    return InputError(f"{path}: certified data are damaged ({fact}): install wheelplane again")


def _plane_figures(plane: FittedPlane, certified: Array) -> tuple[Figure, ...]:
    """Return the angle between the normals and the centroid's distance from the certified plane."""
    point, normal = certified[:3], certified[3:]
    return (
        Figure("angle", "deg", _angle_deg(plane.normal, normal), BOUND),
        Figure("offset", "unit", abs(float((plane.centroid_m - point) @ normal)), BOUND),
    )


def _circle_figures(points: Array, certified: Array, plane: FittedPlane) -> tuple[Figure, ...]:
    """Project the points on their plane and fit a target's edge of the certified diameter to them.

    Centre and growth of the edge are free: with the radius of least squares given, the centre of
    least squares is that of the certified circle, and the growth, which the scan's erosion of the
    edge needs, is nothing.
    """
    basis = plane_basis(plane.normal)
    edge_m = CIRCLE_UNIT_M * ((points - plane.centroid_m) @ basis[:2].T)
    radius_m = CIRCLE_UNIT_M * float(certified[6]) / 2.0
    circle = fit_edge_points(edge_m, Circle(radius_m), np.zeros(2), 0.0)
    centre = plane.centroid_m + circle.centre_m / CIRCLE_UNIT_M @ basis[:2]
    growth = circle.growth_m / CIRCLE_UNIT_M
    return (
        Figure("centre", "unit", float(np.linalg.norm(centre - certified[:3])), BOUND),
        Figure("normal", "deg", _angle_deg(plane.normal, certified[3:6]), BOUND),
        Figure("diameter", "unit", abs(2.0 * growth), BOUND),
    )


def _pcl_figures(points_m: Array) -> tuple[Figure, ...]:
    """Compare the largest plane of a real scene with PCL's own bounds."""
    plane = find_planes(points_m, 1)[0]
    off = float(np.abs(plane.normal / plane.offset_m - PCL_PLANE).max())
    near = np.abs(points_m @ plane.normal + plane.offset_m) < PCL_WITHIN_M
    return (
        Figure("(a, b, c)/d", "1/m", off, PCL_BOUND),
        Figure("inliers", "points", int(np.count_nonzero(near)), PCL_INLIERS, above=True),
    )


def _angle_deg(a: Array, b: Array) -> float:
    """Return the angle between two directions without sign: atan2(|a x b|, |a . b|)."""
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b)), abs(a @ b))))
