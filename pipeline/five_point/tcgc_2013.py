"""The estimator of the paper's software of 2013, kept to reproduce its two printed tables.

For measuring use `five-point` with its default method: here z is regressed on x and y, while the
plane of a wheel is nearly vertical, so |camber| is too large by about sigma^2/(camber var z).
"""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
import numpy.typing as npt

from ..errors import InputError
from ..system import frozen
from ..vectors import Array
from ..vehicle import VehicleFrame, build_reference_frame, rotation_by_basis

Variant = Literal["report", "matrix"]

# Blocks taken as RR, RL, FR, FL: the printed report exchanges the axles.
_REFERENCE_BLOCKS = {"report": [2, 3, 0, 1], "matrix": [0, 1, 2, 3]}


@frozen
class Tcgc2013Result:
    """Result of the software of 2013, for M blocks.

    toe_rad: (M,) raw azimuth of the normal that points to +x. camber_rad: (M,) absolute elevation.
    frame: in file coordinates; its left, forward and -up are the paper's u_R, v and w.
    R_applied: (3, 3), applied to the points: R_paper_file, or its transpose in "matrix".
    centres_vehicle_m: (M, 3), and plane_coefficients: (M, 3) a, b, c (m) of z = a x + b y + c, both
    in the coordinates after that rotation.
    """

    variant: Variant
    toe_rad: Array
    camber_rad: Array
    frame: VehicleFrame
    R_applied: Array
    centres_vehicle_m: Array
    plane_coefficients: Array


def tcgc_2013(blocks_m: npt.ArrayLike, variant: Variant = "report") -> Tcgc2013Result:
    """Compute toe and camber as the software of 2013 did.

    blocks_m: (M, 5, 3) in file coordinates, metres, M >= 4.
    variant: "report" takes blocks 3 and 4 as the rear axle and 1 and 2 as the front one; "matrix"
    keeps the order of the text and applies the transposed rotation.
    Raises InputError if the centres define no frame, or x and y of a block no regression.
    Source: the paper, its printed report and its matrix (1).
    """
    if variant not in _REFERENCE_BLOCKS:
        raise InputError(f"unknown variant {variant!r} of tcgc-2013: name report or matrix")
    blocks = np.asarray(blocks_m, dtype=np.float64)
    if blocks.ndim != 3 or blocks.shape[0] < 4 or blocks.shape[1:] != (5, 3):
        raise InputError(f"tcgc-2013 needs 4 or more blocks of 5 points, got {blocks.shape}")
    base = blocks[0, 0]
    local = blocks - base
    frame = build_reference_frame(local.mean(axis=1)[_REFERENCE_BLOCKS[variant]])
    R_paper_file = rotation_by_basis(frame)
    R_applied = R_paper_file if variant == "report" else R_paper_file.T
    rotated = (local - frame.origin_m) @ R_applied.T
    planes = np.array([_regress_z(points, block) for block, points in enumerate(rotated, start=1)])
    toe_rad, elevation_rad = _azimuth_and_elevation(planes)
    return Tcgc2013Result(
        variant=variant,
        toe_rad=toe_rad,
        camber_rad=np.abs(elevation_rad),
        frame=replace(frame, origin_m=frame.origin_m + base),
        R_applied=R_applied,
        centres_vehicle_m=rotated.mean(axis=1),
        plane_coefficients=planes,
    )


def _regress_z(points: Array, block: int) -> Array:
    """Fit z = a x + b y + c by least squares of the residuals in z (Matlab `fit`, `poly11`)."""
    centre = points.mean(axis=0)
    xy, z = (points - centre)[:, :2], (points - centre)[:, 2]
    (a, b), _, rank, singular = np.linalg.lstsq(xy, z, rcond=1e-9)
    if rank < 2:
        raise InputError(
            f"block {block}: its x and y lie on one line within {singular[1]:.1e} m, so "
            "z = a x + b y + c has no solution: use the total least squares estimator"
        )
    return np.array([a, b, centre[2] - a * centre[0] - b * centre[1]])


def _azimuth_and_elevation(planes: Array) -> tuple[Array, Array]:
    """Return Matlab's `cart2sph` of the normals (a, b, -1), oriented to +x, radians."""
    normals = np.column_stack([planes[:, :2], np.full(len(planes), -1.0)])
    x, y, z = (normals * np.where(normals[:, :1] < 0, -1.0, 1.0)).T
    return np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))
