"""The front face of a target as a region of its plane: within the outer edge, outside the holes."""

from __future__ import annotations

import math
from dataclasses import field, replace

import numpy as np

from ..system import frozen
from ..vectors import Array, Mask
from .outline import Holes, OuterEdge, is_symmetric

NO_HOLES = np.zeros((0, 3))


@frozen
class Region:
    """Points in a target's axes u, v within its outer edge and outside its round holes.

    edge: about the target's centre, the origin. holes_m: rows (u, v, radius) of (K, 3). margin_m:
    width left out along all edges; where negative, what lies that far beyond them belongs to it.
    """

    edge: OuterEdge
    holes_m: Array = field(default_factory=lambda: NO_HOLES)
    margin_m: float = 0.0

    @property
    def radius_m(self) -> float:
        """Radius of the smallest circle about the face, less the margin."""
        return self.edge.radius_m - self.margin_m

    @property
    def reach_m(self) -> float:
        """Distance of the farthest point from the centre, where the margin is not negative."""
        return self.edge.reach_m(self.margin_m)

    @property
    def half_m(self) -> tuple[float, float]:
        """Largest |u| and |v| of the face, without the margin."""
        return self.edge.half_m

    @property
    def area_m2(self) -> float:
        """Area of the face, without the margin."""
        return self.edge.area_m2 - math.pi * float(np.sum(self.holes_m[:, 2] ** 2))

    @property
    def sides_m(self) -> Array:
        """Straight sides, rows (a, b, c) of (K, 3): a u + b v < c inside."""
        return np.asarray(self.edge.sides_m - np.array([0.0, 0.0, self.margin_m]))

    @property
    def bounds_m(self) -> tuple[float, Array, Array]:
        """The region as loops over points take it: `reach_m`, `sides_m` and its holes."""
        return self.reach_m, self.sides_m, self.holes_m + np.array([0.0, 0.0, self.margin_m])

    @property
    def period_rad(self) -> float:
        """The smallest rotation about the centre that leaves it as it is; 0 where any does."""
        off = self.holes_m[np.any(self.holes_m[:, :2] != 0.0, axis=1)]
        most = self.edge.symmetries or len(off)
        if most == 0:
            return 0.0
        fits = (n for n in range(most, 0, -1) if most % n == 0 or self.edge.symmetries == 0)
        return 2.0 * math.pi / next(n for n in fits if is_symmetric(off, n))

    @property
    def lever_m2(self) -> float:
        """Mean square lever of a rotation on the outer edge; of a round one, on its holes."""
        return self.edge.lever_m2 if self.edge.shows_rotation else Holes(self.holes_m).lever_m2

    @property
    def filled(self) -> Region:
        """The region without its holes."""
        return replace(self, holes_m=NO_HOLES)

    def shrunk(self, margin_m: float) -> Region:
        """Return the region less a margin along all its edges, those of the holes too."""
        return replace(self, margin_m=self.margin_m + margin_m)

    def holds(self, uv_m: Array) -> Mask:
        """Return which of uv_m (N, 2) lie in it: (N,)."""
        u, v = uv_m[:, 0], uv_m[:, 1]
        inside = u * u + v * v < self.radius_m**2
        for a, b, c in self.sides_m.tolist():
            inside &= a * u + b * v < c
        for a, b, radius in self.holes_m.tolist():
            inside &= (u - a) ** 2 + (v - b) ** 2 > (radius + self.margin_m) ** 2
        return np.asarray(inside)

    def polygons_m(self, count: int) -> tuple[Array, ...]:
        """Return closed polygons (K, 2): the outer edge, then holes; circles of `count` corners."""
        angle = np.arange(count) * (2.0 * np.pi / count)
        circle = np.column_stack([np.cos(angle), np.sin(angle)])
        holes = (np.array([u, v]) + radius * circle for u, v, radius in self.holes_m.tolist())
        return (self.edge.polygon_m(count), *holes)
