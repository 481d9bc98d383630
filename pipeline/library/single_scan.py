"""Planes and targets of single clouds."""

from __future__ import annotations

from dataclasses import field
from numbers import Integral

import numpy as np

from ..diagnostics import check_cloud, check_poses, check_wheel_scan
from ..errors import InputError
from ..measure import fit_target
from ..plane import CloudPlane, plane_of_all
from ..plane import find_planes as planes_of
from ..system import frozen
from ..units import LengthUnit
from ..vectors import Array
from ..wheel import find_patch
from .messages import library_errors
from .scans import Settings, TargetName, as_config, as_scan, as_target
from .value import EqualByFields


@frozen(eq=False)
class Plane(EqualByFields):
    """Plane normal . x + offset = 0 of a cloud, metres.

    normal: (3,) unit, largest component positive. centroid_m: (3,) mean of its points. rms_m: of
    their distances. extents_m: sides of the smallest rectangle about them, the longer first.
    """

    normal: Array
    offset_m: float
    centroid_m: Array
    rms_m: float
    points: int
    extents_m: tuple[float, float]

    def __repr__(self) -> str:
        a, b, c = self.normal
        size = " x ".join(f"{side:.3f}" for side in self.extents_m)
        return (
            f"<Plane {a:+.6f} x {b:+.6f} y {c:+.6f} z {self.offset_m:+.6f} m = 0: "
            f"{self.points} points, rms {1e3 * self.rms_m:.3f} mm, {size} m>"
        )


@frozen(eq=False)
class FoundTarget(EqualByFields):
    """Target of one scan: its plane and centre, coordinates of the scan.

    centre_m: (3,). normal: (3,) unit, towards the scanner. covariance: (6, 6) of the normal (rad),
    then the centre (m). rms_m: of the plane's residuals. points: number on the target. method: by
    which the centre was found.
    """

    centre_m: Array
    normal: Array
    covariance: Array = field(repr=False)
    rms_m: float
    points: int
    method: str

    def __repr__(self) -> str:
        centre = " ".join(f"{x:+.5f}" for x in self.centre_m)
        normal = " ".join(f"{x:+.6f}" for x in self.normal)
        u = 1e3 * float(np.sqrt(np.trace(self.covariance[3:, 3:])))
        return (
            f"<FoundTarget at {centre} m (u {u:.3f} mm, {self.method}), normal {normal}: "
            f"{self.points} points, rms {1e3 * self.rms_m:.3f} mm>"
        )


@library_errors
def fit_plane(points: object, *, length_unit: LengthUnit = "m") -> Plane:
    """Fit the least-squares plane to all points, none left out.

    points: (N, 3) or (3, N), a cloud of Open3D or trimesh, or a path; at least 3 points. Raises
    InputError.
    """
    scan = as_scan(points, length_unit, "points")
    check_poses(scan.parts, scan.source)
    return _plane(plane_of_all(scan.points_m))


@library_errors
def find_planes(
    points: object, max_planes: int = 5, *, length_unit: LengthUnit = "m", seed: int = 0
) -> list[Plane]:
    """Find the planes of a cloud, the largest first; its points determine the threshold.

    points: as `fit_plane`. Raises InputError, and NotMeasuredError where no plane stands out.
    """
    for what, number in (("max_planes", max_planes), ("seed", seed)):
        if not isinstance(number, Integral) or number < 0:
            raise InputError(f"{what} {number!r} is no whole number: give one from 0")
    scan = as_scan(points, length_unit, "points")
    check_poses(scan.parts, scan.source)
    check_cloud(scan.points_m, length_unit, scan.source)
    return [_plane(one) for one in planes_of(scan.points_m, max_planes, seed)]


@library_errors
def find_target(
    points: object,
    target: TargetName,
    *,
    length_unit: LengthUnit = "m",
    scanner: str | None = None,
    config: Settings = None,
) -> FoundTarget:
    """Find the target in one scan, and fit its plane and centre.

    points: as `fit_plane`. target, scanner, config: as `measure`. Raises InputError, and
    NotMeasuredError with the `status` that measurement.json would show.
    """
    scan, known = as_scan(points, length_unit, "points"), as_target(target)
    settings = as_config(config, scanner)
    check_poses(scan.parts, scan.source)
    check_wheel_scan(scan.points_m, 2.0 * known.radius_m, length_unit, scan.source)
    patch = find_patch(scan.points_m, known, settings, scan.intensity)
    fit = fit_target(patch, known, settings)
    found, front = fit.target, patch.basis[2] if fit.plane is None else fit.plane.normal
    towards = np.sign(found.normal @ front)
    return FoundTarget(
        found.centre_m,
        towards * found.normal,
        found.covariance,
        found.plane_rms_m,
        found.points_on_target,
        found.method,
    )


def _plane(found: CloudPlane) -> Plane:
    return Plane(
        found.normal,
        found.offset_m,
        found.centroid_m,
        found.rms_m,
        found.points,
        found.extents_m,
    )
