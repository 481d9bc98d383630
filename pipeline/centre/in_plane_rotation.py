"""In-plane rotation of a target, by its edges or by its print."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np

from ..system import frozen
from ..vectors import Array

RotationMark = Literal["edges", "print"]


@frozen(eq=False)
class PlaneRotation:
    """Rotation of a target's axes against those of a plane, by one method.

    mark: what shows it. period_rad: smallest rotation that leaves the mark as it is. noise: (3,)
    covariances of its noise with that of the centre along u and v (m rad), and with itself (rad^2).
    model_rad2: variance by what its model leaves out. by_plane: (3,) its derivatives by the
    plane's height at the centre, and by its slopes.
    """

    mark: RotationMark
    angle_rad: float
    period_rad: float
    noise: Array
    model_rad2: float
    by_plane: Array

    def with_noise(self, centre_m2: Array) -> Array:
        """Return the covariance (3, 3) of the noise of centre (2, 2) and rotation."""
        beside = self.noise[:2]
        return np.block([[centre_m2, beside[:, None]], [beside[None], self.noise[2:, None]]])

    def with_model(self, centre_m2: Array) -> Array:
        """Return the covariance (3, 3) of the model errors of centre (2, 2) and rotation."""
        none = np.zeros((2, 1))
        return np.block([[centre_m2, none], [none.T, np.array([[self.model_rad2]])]])

    def in_scan(self, basis: Array) -> InPlaneRotation:
        """Return the axis in the scan, by the plane's axes (3, 3)."""
        c, s = math.cos(self.angle_rad), math.sin(self.angle_rad)
        return InPlaneRotation(self.mark, c * basis[0] + s * basis[1], self.period_rad)


@frozen(eq=False)
class InPlaneRotation:
    """Axis u of a target in the scan (3,), unit, known up to a rotation by period_rad.

    mark: what shows it; the print's axis may be rotated on a board against the edges'.
    """

    mark: RotationMark
    axis: Array
    period_rad: float


def combined_rotation(
    rotations: Sequence[PlaneRotation | None], weights: Sequence[Array]
) -> PlaneRotation | None:
    """Return the rotation by the print if known, else the mean of all edges by inverse variance.

    weights: (2, 2) of each method's centre in the common centre.
    """
    shown = [(t, W) for t, W in zip(rotations, weights, strict=True) if t is not None]
    printed = [(t, W) for t, W in shown if t.mark == "print"]
    shown = printed or shown
    if not shown:
        return None
    inverse = np.array([1.0 / (t.noise[2] + t.model_rad2) for t, _ in shown])
    share = inverse / inverse.sum()
    first = shown[0][0]
    parts = list(zip(share, shown, strict=True))
    with_centre = sum((s * (W @ t.noise[:2]) for s, (t, W) in parts), np.zeros(2))
    variance = sum(s * s * float(t.noise[2]) for s, (t, _) in parts)
    return PlaneRotation(
        mark=first.mark,
        angle_rad=sum(s * t.angle_rad for s, (t, _) in parts),
        period_rad=max(t.period_rad for t, _ in shown),
        noise=np.array([*with_centre, variance]),
        model_rad2=sum(s * s * t.model_rad2 for s, (t, _) in parts),
        by_plane=np.asarray(sum((s * t.by_plane for s, (t, _) in parts), np.zeros(3))),
    )
