"""The fits that measure, on data whose right answers others have certified."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..plane import CloudPlane, find_planes, plane_of_all
from ..readers import read_scan
from ..vectors import Array, plane_basis
from .circle import fit_circle

PLANES = tuple(f"pla{number}" for number in range(1, 31))
CIRCLES = ("cir7", "cir10", "cir20", "cir25")
BOUND = 1e-9  # degrees for directions, the data's own unit for lengths
PCL_PLANE, PCL_BOUND = (-0.8964, -0.5868, -1.208), 0.1  # (a, b, c) / d
PCL_INLIERS, PCL_WITHIN_M = 2000, 0.03

FitPlane = Callable[[Array], CloudPlane]


@dataclass(frozen=True)
class Figure:
    """One number against its bound: at most the bound or, where `above`, more than it."""

    name: str
    unit: str
    value: float
    bound: float
    above: bool = False

    @property
    def passed(self) -> bool:
        """False for NaN as well."""
        return self.value > self.bound if self.above else self.value <= self.bound


@dataclass(frozen=True)
class Check:
    """A data set and how far from its certified answer the fit came. kind: a heading."""

    kind: str
    name: str
    points: int
    figures: tuple[Figure, ...]

    @property
    def passed(self) -> bool:
        """Whether all figures keep their bounds."""
        return all(figure.passed for figure in self.figures)


def certified_folder() -> Path:
    """The folder of the certified data, which ships with the package."""
    return Path(__file__).parent / "certified"


def run_selftest(folder: Path | None = None, fit_plane: FitPlane = plane_of_all) -> Iterator[Check]:
    """Check by check: the planes and circles of NIST in the order of their numbers, PCL's plane.

    fit_plane: the fit under test. Raises InputError for a data file that is missing or damaged.
    """
    folder = folder or certified_folder()
    for name in PLANES:
        points, answer = _pair(folder / "nist" / "plane" / name, 6)
        yield Check("plane", name, len(points), _plane_figures(fit_plane(points), answer))
    for name in CIRCLES:
        points, answer = _pair(folder / "nist" / "circle" / name, 7)
        yield Check("circle", name, len(points), _circle_figures(points, answer, fit_plane))
    scan = read_scan(folder / "pcl" / "sac_plane_test.pcd")
    yield Check("scene", "sac_plane_test", len(scan.points_m), _pcl_figures(scan.points_m))


def digest(folder: Path | None = None) -> str:
    """Of all certified files, their names and their bytes: `sha256:` and 64 hexadecimal digits."""
    folder = folder or certified_folder()
    total = hashlib.sha256()
    for path in sorted(
        path for path in folder.rglob("*") if path.suffix in (".ds", ".fit", ".pcd")
    ):
        total.update(f"{path.relative_to(folder).as_posix()}\0".encode())
        total.update(hashlib.sha256(path.read_bytes()).digest())
    return f"sha256:{total.hexdigest()}"


def _pair(path: Path, numbers: int) -> tuple[Array, Array]:
    """Points (N, 3) and certified answer (`numbers`,) of the pair of files `path`.ds and .fit."""
    count, *coordinates = _numbers(path.with_suffix(".ds")) or [0.0]
    answer = _numbers(path.with_suffix(".fit"))
    if count < 3 or len(coordinates) != 3 * count or len(answer) != numbers:
        held = f"{len(coordinates)} coordinates of {count:g} points, {len(answer)} of the answer"
        raise _damaged(path.with_suffix(".ds"), held)
    return np.reshape(coordinates, (-1, 3)), np.array(answer)


def _numbers(path: Path) -> list[float]:
    """All numbers of a file; float() rounds a decimal of any length correctly."""
    try:
        return [float(word) for word in path.read_text(encoding="ascii").split()]
    except (OSError, ValueError) as error:
        raise _damaged(path, str(error)) from error


def _damaged(path: Path, fact: str) -> InputError:
    return InputError(f"{path}: certified data are damaged ({fact}): install wheelplane again")


def _plane_figures(plane: CloudPlane, certified: Array) -> tuple[Figure, ...]:
    """Angle between the normals; distance of the fitted centroid from the certified plane."""
    point, normal = certified[:3], certified[3:]
    return (
        Figure("angle", "deg", _angle_deg(plane.normal, normal), BOUND),
        Figure("offset", "unit", abs(float((plane.centroid_m - point) @ normal)), BOUND),
    )


def _circle_figures(points: Array, certified: Array, fit_plane: FitPlane) -> tuple[Figure, ...]:
    """The plane first, the points projected on it, then the geometric circle."""
    plane = fit_plane(points)
    basis = plane_basis(plane.normal)
    circle = fit_circle((points - plane.centroid_m) @ basis[:2].T)
    centre = plane.centroid_m + circle.centre_m @ basis[:2]
    return (
        Figure("centre", "unit", float(np.linalg.norm(centre - certified[:3])), BOUND),
        Figure("normal", "deg", _angle_deg(plane.normal, certified[3:6]), BOUND),
        Figure("diameter", "unit", abs(2.0 * circle.radius_m - float(certified[6])), BOUND),
    )


def _pcl_figures(points_m: Array) -> tuple[Figure, ...]:
    """The largest plane of a real scene, by PCL's own bounds."""
    plane = find_planes(points_m, 1)[0]
    off = float(np.abs(plane.normal / plane.offset_m - PCL_PLANE).max())
    near = np.abs(points_m @ plane.normal + plane.offset_m) < PCL_WITHIN_M
    return (
        Figure("(a, b, c)/d", "1/m", off, PCL_BOUND),
        Figure("inliers", "points", int(np.count_nonzero(near)), PCL_INLIERS, above=True),
    )


def _angle_deg(a: Array, b: Array) -> float:
    """Angle between two directions without sign: atan2(|a x b|, |a . b|)."""
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b)), abs(a @ b))))
