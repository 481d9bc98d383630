"""Edges of a target: signed distance of points from them, their normals and curvature."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import cached_property
from typing import ClassVar, Protocol

import numpy as np
import numpy.typing as npt

from ..system import frozen
from ..vectors import Array, Mask, Rows

CORNER_M = 0.01  # of a straight side at each end, left out: there two sides mix


@frozen
class ClosestPoints:
    """Points in a target's axes against the nearest edge of an outline; (N,) each, normal (N, 2).

    x_m: distance outside the target, positive in a hole too. normal: unit, away from the target.
    support_m: distance of the edge from the target's centre along the normal. curve: curvature of
    the line of equal x through the point, and bend: of the edge itself, 1/m, positive where the
    target is convex. share: position along the outline, from 0 to 1. clear: away from corners.
    """

    x_m: Array
    normal: Array
    support_m: Array
    curve: Array
    bend: Array
    share: Array
    clear: Mask


class Outline(Protocol):
    """One or more closed edges of a rigid target."""

    @property
    def size_m(self) -> float:
        """Half its width where it is narrowest."""

    @property
    def shows_rotation(self) -> bool:
        """Whether a rotation about the target's centre changes it."""

    @property
    def axis_share(self) -> float:
        """Share of its length that determines the centre along the worst determined direction."""

    @property
    def description(self) -> str:
        """Name in messages."""

    def closest(self, q_m: Array) -> ClosestPoints:
        """Return the points q_m (N, 2) against the nearest edge."""
        ...

    def outside_m(self, u: Array, v: Array) -> Array:
        """Return how far points u, v, arrays of one shape, lie outside, as ClosestPoints.x_m."""
        ...

    def normals(self, share: Array) -> Array:
        """Return unit normals (K, 2) at positions `share` (K,) along the outline."""
        ...

    def stretch(self, share: Array) -> Array | None:
        """Return how far out the edge moves there (K,) where it is wider by 2 and lower by 2.

        None of an outline that is made round.
        """
        ...


@frozen
class Circle:
    """A round outer edge.

    It and Polygon offer the same; radius_m: of the smallest circle about the centre that holds the
    edge. corners_m: (K, 2) counterclockwise. sides_m: rows (a, b, c) of (K, 3), a u + b v < c
    inside. symmetries: number of rotations in a full one that leave it as it is, 0 where any does.
    lever_m2: mean square, along the edge, of the lever by which a rotation moves it outwards.
    """

    radius_m: float
    description: str = "the target"

    shows_rotation: ClassVar[bool] = False
    axis_share: ClassVar[float] = 2.0 / 3.0
    corners_m: ClassVar[Array] = np.zeros((0, 2))
    sides_m: ClassVar[Array] = np.zeros((0, 3))
    symmetries: ClassVar[int] = 0
    lever_m2: ClassVar[float] = 0.0

    @property
    def size_m(self) -> float:
        """Its radius."""
        return self.radius_m

    @property
    def half_m(self) -> tuple[float, float]:
        """Largest |u| and |v|."""
        return self.radius_m, self.radius_m

    @property
    def area_m2(self) -> float:
        """Area within it."""
        return math.pi * self.radius_m**2

    @property
    def size_text(self) -> str:
        """Its diameter in mm."""
        return f"{self.radius_m * 2e3:g} mm across"

    def reach_m(self, margin_m: float) -> float:
        """Return the radius less a margin."""
        return self.radius_m - margin_m

    def polygon_m(self, count: int) -> Array:
        """Return a polygon (count, 2) on it."""
        angle = np.arange(count) * (2.0 * np.pi / count)
        return self.radius_m * np.column_stack([np.cos(angle), np.sin(angle)])

    def closest(self, q_m: Array) -> ClosestPoints:
        """Return the points q_m (N, 2) against the edge."""
        outside = self.outside_m(*q_m.T)
        far = np.maximum(outside + self.radius_m, 1e-9)
        same = np.ones(len(q_m))
        return ClosestPoints(
            x_m=outside,
            normal=q_m / far[:, None],
            support_m=self.radius_m * same,
            curve=1.0 / far,
            bend=same / self.radius_m,
            share=_angle_share(q_m),
            clear=np.ones(len(q_m), dtype=bool),
        )

    def outside_m(self, u: Array, v: Array) -> Array:
        """Return how far points u, v lie outside."""
        return np.asarray(np.sqrt(u * u + v * v) - self.radius_m)

    def normals(self, share: Array) -> Array:
        """Return unit normals (K, 2) at positions `share` (K,) along it."""
        return _direction(share)

    def stretch(self, share: Array) -> None:
        """Return None: it is turned, or drilled."""

    def resized(self, by_m: float) -> Circle:
        """Return it with a radius larger by that."""
        return replace(self, radius_m=self.radius_m + by_m)


@frozen
class Polygon:
    """A convex outer edge of straight sides: corners_m (K, 2) counterclockwise about the origin.

    Side k runs from corner k to the next. The distance of a point is that from the line of the side
    it lies farthest outside of: exact beside a side, short beside a corner.
    """

    corners_m: Array
    description: str = "the target"

    shows_rotation: ClassVar[bool] = True

    def __post_init__(self) -> None:
        """Raise ValueError where the corners are no convex polygon about the origin."""
        ahead = np.roll(self._along, -1, axis=0)
        bends = self._along[:, 0] * ahead[:, 1] - self._along[:, 1] * ahead[:, 0]
        if not (np.all(bends > 0.0) and np.all(self.sides_m[:, 2] > 0.0)):
            raise ValueError(
                "an outline's corners have to run counterclockwise and be convex about the origin"
            )

    @cached_property
    def _along(self) -> Array:
        """Sides as vectors (K, 2)."""
        return np.roll(self.corners_m, -1, axis=0) - self.corners_m

    @cached_property
    def _lengths_m(self) -> Array:
        """Lengths of the sides (K,)."""
        return np.hypot(self._along[:, 0], self._along[:, 1])

    @cached_property
    def _perimeter_m(self) -> float:
        return math.fsum(self._lengths_m)

    @cached_property
    def _ends_m(self) -> Array:
        """Begin and end of each side along its own line, from the foot of the centre (K, 2)."""
        a, b, _ = self.sides_m.T
        begin, end = self.corners_m, np.roll(self.corners_m, -1, axis=0)
        return np.column_stack([a * p[:, 1] - b * p[:, 0] for p in (begin, end)])

    @cached_property
    def sides_m(self) -> Array:
        """Rows (a, b, c) of (K, 3): unit normal, and distance of the side from the centre."""
        normal = np.column_stack([self._along[:, 1], -self._along[:, 0]])
        normal = normal / self._lengths_m[:, None] + 0.0  # no negative zeros
        return np.column_stack([normal, np.sum(normal * self.corners_m, axis=1)])

    @cached_property
    def radius_m(self) -> float:
        """Distance of the farthest corner."""
        return max(math.hypot(u, v) for u, v in self.corners_m.tolist())

    @property
    def half_m(self) -> tuple[float, float]:
        """Largest |u| and |v|."""
        u, v = np.abs(self.corners_m).max(axis=0).tolist()
        return u, v

    @property
    def size_m(self) -> float:
        """Distance of the nearest side."""
        return float(self.sides_m[:, 2].min())

    @property
    def area_m2(self) -> float:
        """Area within it (shoelace formula)."""
        (u, v), (du, dv) = self.corners_m.T, np.roll(self.corners_m, -1, axis=0).T
        return float(np.sum(u * dv - v * du)) / 2.0

    @property
    def symmetries(self) -> int:
        """Number of rotations in a full one that leave it as it is."""
        count = len(self.corners_m)
        return max(n for n in range(1, count + 1) if is_symmetric(self.corners_m, n))

    @property
    def axis_share(self) -> float:
        """(sum l w)^2 / (L sum l w^2) with w = (n . e)^2, for the worst of the normals e.

        That is the effective number of equal observations that determine the centre along e, over
        their number (Welch and Satterthwaite).
        """
        normals = self.sides_m[:, :2]
        weight = (normals @ normals.T) ** 2
        total, square = weight @ self._lengths_m, weight**2 @ self._lengths_m
        return float(np.min(total * (total / square))) / self._perimeter_m

    @property
    def lever_m2(self) -> float:
        """Mean square, along the edge, of the distance from the foot of the centre on each side."""
        cubes = self._ends_m**3
        return math.fsum(cubes[:, 1] - cubes[:, 0]) / (3.0 * self._perimeter_m)

    @property
    def size_text(self) -> str:
        """Width along u by height along v, in mm."""
        return f"{self.half_m[0] * 2e3:g} x {self.half_m[1] * 2e3:g} mm"

    def reach_m(self, margin_m: float) -> float:
        """Return the distance of the farthest corner where all sides lie a margin farther in."""
        a, b, c = self.sides_m.T - np.array([[0.0], [0.0], [margin_m]])
        a2, b2, c2 = (np.roll(values, -1) for values in (a, b, c))
        u, v = c * b2 - c2 * b, a * c2 - a2 * c
        return float(np.max(np.hypot(u, v) / (a * b2 - a2 * b)))

    def polygon_m(self, count: int) -> Array:
        """Return its corners (K, 2), beginning with the last; `count` is of no use here."""
        return np.roll(self.corners_m, 1, axis=0)

    def closest(self, q_m: Array) -> ClosestPoints:
        """Return the points q_m (N, 2) against the nearest side."""
        u, v = q_m.T
        side, x_m = _farthest(self._beyond_m(u, v))
        half = self._lengths_m / 2.0
        before = np.cumsum(np.append(0.0, self._lengths_m[:-1]))
        clear = half - np.minimum(CORNER_M, 0.2 * half)
        middle = self._ends_m.mean(axis=1)
        of_sides = np.stack([*self.sides_m.T, half, middle, before, clear])
        a, b, c, half, middle, before, clear = of_sides.take(side, axis=1)
        along = a * v - b * u - middle
        position = np.clip(along / half, -1.0, 1.0) * half + half
        share = (before + position) / self._perimeter_m
        return ClosestPoints(
            x_m=x_m,
            normal=np.stack([a, b]).T,
            support_m=c,
            curve=np.zeros(len(q_m)),
            bend=np.zeros(len(q_m)),
            share=share - (share >= 1.0),
            clear=np.abs(along) < clear,
        )

    def outside_m(self, u: Array, v: Array) -> Array:
        """Return how far points u, v lie outside; of single precision where they are."""
        return np.asarray(np.maximum.reduce([*self._beyond_m(u, v)]))

    def _beyond_m(self, u: Array, v: Array) -> Iterator[Array]:
        """Yield how far points u, v lie beyond the line of each side."""
        for a, b, c in self.sides_m.tolist():
            yield a * u + b * v - c

    def normals(self, share: Array) -> Array:
        """Return unit normals (K, 2) at positions `share` (K,) along it."""
        ends = np.cumsum(self._lengths_m)[:-1] / self._perimeter_m
        return np.asarray(self.sides_m[np.searchsorted(ends, share, side="right"), :2])

    def stretch(self, share: Array) -> Array:
        """Return how far out each side moves (K,): n_u^2 - n_v^2 by its normal n."""
        return np.asarray(self.normals(share) ** 2 @ [1.0, -1.0])

    def resized(self, by_m: Array) -> Polygon:
        """Return it with half its width and half its height (2,) larger by that."""
        return replace(self, corners_m=self.corners_m * (1.0 + by_m / self.half_m))


@frozen
class Holes:
    """Round holes, rows (u, v, radius) of (K, 3), one after the other."""

    holes_m: Array
    description: str = "the holes of the target"

    axis_share: ClassVar[float] = 2.0 / 3.0

    @property
    def size_m(self) -> float:
        """Radius of the smallest."""
        return float(self.holes_m[:, 2].min())

    @property
    def shows_rotation(self) -> bool:
        """Whether a rotation about the target's centre moves a hole."""
        return bool(np.any(self.holes_m[:, :2]))

    @property
    def lever_m2(self) -> float:
        """Half the mean square distance of the edges' centres from the target's."""
        return float(np.sum(self.holes_m[:, :2] ** 2)) / (2.0 * len(self.holes_m))

    def closest(self, q_m: Array) -> ClosestPoints:
        """Return the points q_m (N, 2) against the edge of the nearest hole."""
        nearest, x_m = _farthest(self._within_m(*q_m.T))
        u, v, radius = self.holes_m.T.take(nearest, axis=1)
        far = np.maximum(radius - x_m, 1e-9)
        away = q_m.T - np.stack([u, v])
        normal = away / -far
        return ClosestPoints(
            x_m=radius - far,
            normal=normal.T,
            support_m=normal[0] * u + normal[1] * v - radius,
            curve=-1.0 / far,
            bend=-1.0 / radius,
            share=(nearest + _angle_share(away.T)) / len(self.holes_m),
            clear=far > 0.3 * radius,
        )

    def outside_m(self, u: Array, v: Array) -> Array:
        """Return how far points u, v lie from the edge of the nearest hole, positive inside it."""
        return np.asarray(np.maximum.reduce([*self._within_m(u, v)]))

    def _within_m(self, u: Array, v: Array) -> Iterator[Array]:
        """Yield how far points u, v lie within each hole."""
        for a, b, radius in self.holes_m.tolist():
            yield radius - np.sqrt((u - a) ** 2 + (v - b) ** 2)

    def normals(self, share: Array) -> Array:
        """Return unit normals (K, 2) at positions `share` (K,) along the edges."""
        return -_direction(share * len(self.holes_m))

    def stretch(self, share: Array) -> None:
        """Return None: they are drilled."""


OuterEdge = Circle | Polygon


def rectangle(width_m: float, height_m: float) -> Polygon:
    """Return the outline of a rectangle, width along u; its first side lies at +u."""
    half = np.array([width_m / 2.0, height_m / 2.0])
    return Polygon(half * np.array([[1.0, -1.0], [1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0]]))


def is_symmetric(rows_m: Array, count: int) -> bool:
    """Return whether 1 / count of a full rotation maps rows_m, (u, v, ...), onto each other."""
    angle = 2.0 * math.pi / count
    c, s = math.cos(angle), math.sin(angle)
    there = rows_m.copy()
    there[:, :2] = rows_m[:, :2] @ np.array([[c, s], [-s, c]])
    apart = np.abs(there[:, None] - rows_m[None]).max(axis=2, initial=0.0)
    return bool(np.all(apart.min(axis=1, initial=np.inf) < 1e-9)) if len(rows_m) else True


def sector(share: Array, count: int) -> npt.NDArray[np.int64]:
    """Return which of `count` equal parts of the outline each share (N,) falls in."""
    return np.minimum((share * count).astype(np.int64), count - 1)


def _farthest(outside_m: Iterable[Array]) -> tuple[Rows, Array]:
    """Return the edge that each point lies farthest outside of (N,), and how far; (N,) of each."""
    edges = iter(outside_m)
    x_m = next(edges)
    nearest = np.zeros(len(x_m), np.intp)
    for k, one_m in enumerate(edges, 1):
        farther = one_m > x_m
        nearest = np.where(farther, k, nearest)  # with a mask of many changes faster than copyto
        x_m = np.where(farther, one_m, x_m)
    return nearest, x_m


def _angle_share(vectors: Array) -> Array:
    """Return the angle of vectors (N, 2) from u towards v, as a share of a full rotation."""
    share = np.arctan2(vectors[:, 1], vectors[:, 0]) / (2.0 * np.pi)
    return np.asarray(share + (share < 0.0))


def _direction(share: Array) -> Array:
    angle = share * 2.0 * np.pi
    return np.column_stack([np.cos(angle), np.sin(angle)])
