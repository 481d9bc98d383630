"""Regular pentagon through the points of a block, five or four of them."""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np

from ..system import frozen
from ..vectors import Array

SIDES = 5
# Share of a point's own error in its residual: four of ten coordinates are fitted, each point's
# alike.
KEPT = 0.6


@frozen
class Pentagon:
    """Regular pentagon fitted to points in a plane.

    centre: (2,). radius_m. residuals_m: (n, 2) of the points from its corners, of 2 n - 4 degrees
    of freedom. free: (2,) the corner without a point; of five points, the last one.
    """

    centre: Array
    radius_m: float
    residuals_m: Array
    free: Array

    @cached_property
    def square_m2(self) -> float:
        """Sum of the squared residuals."""
        return float(np.sum(self.residuals_m**2))


def fit_pentagon(uv_m: Array) -> Pentagon:
    """Fit a regular pentagon to points uv_m (n, 2), n = 5 or 4, in any order.

    As complex numbers, in their order round the mean, its corners are c + a w^k, w = exp(2 pi i/5);
    of four points any gap may be the wide one.
    """
    z = uv_m[:, 0] + 1j * uv_m[:, 1]
    order = np.argsort(np.angle(z - z.mean()))
    gaps = range(SIDES - 1) if len(z) < SIDES else (SIDES - 1,)
    found = min((_fit(z[order], gap) for gap in gaps), key=lambda one: one.square_m2)
    return Pentagon(found.centre, found.radius_m, found.residuals_m[np.argsort(order)], found.free)


def _fit(z: np.ndarray, gap: int) -> Pentagon:
    """Fit c and a by least squares; the corner after that of point `gap` has no point."""
    corners = np.exp(2j * math.pi / SIDES * np.arange(SIDES))
    free = corners[(gap + 1) % SIDES if len(z) < SIDES else gap]
    if len(z) < SIDES:
        corners = np.delete(corners, gap + 1)
    A = np.column_stack([np.ones(len(z)), corners])
    (c, a), *_ = np.linalg.lstsq(A, z, rcond=None)
    residuals, at = z - A @ (c, a), c + a * free
    return Pentagon(
        np.array([c.real, c.imag]),
        abs(a),
        np.column_stack([residuals.real, residuals.imag]),
        np.array([at.real, at.imag]),
    )
