"""The edges of a face: how far a place lies outside of them, which way, and how they bend."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from ..vectors import Array, Mask
from .plates import ANY_WIDTH, Region

CORNER_M = 0.01  # of a straight edge at each end, left out: there two edges mix


@dataclass(frozen=True)
class ClosestPoints:
    """Places in a target's axes against the nearest edge of an outline; (N,) each, normal (N, 2).

    x_m: outside the plate, positive in a hole too. normal: unit, away from the plate. support_m:
    of the edge's place along the normal, seen from the target's centre. curve: of the line of equal
    x through the place, and bend: of the edge itself, 1/m, positive where the plate is convex.
    share: of the way along the outline, from 0 to 1. clear: away from where edges meet.
    """

    x_m: Array
    normal: Array
    support_m: Array
    curve: Array
    bend: Array
    share: Array
    clear: Mask


class Outline(Protocol):
    """One or more closed edges that move as one."""

    @property
    def size_m(self) -> float:
        """Half its width where it is narrowest."""

    @property
    def turns(self) -> bool:
        """Whether a turn about the target's centre changes it."""

    @property
    def axis_share(self) -> float:
        """Of its length, what tells of the axis of which it tells least."""

    @property
    def words(self) -> str:
        """What messages call it."""

    def closest(self, q_m: Array) -> ClosestPoints:
        """Of the places q_m (N, 2)."""
        ...

    def outside_m(self, u: Array, v: Array) -> Array:
        """How far places u, v, arrays of one shape, lie outside, as Feet.x_m."""
        ...

    def normals(self, share: Array) -> Array:
        """Unit normals (K, 2) at shares (K,) of the way along it."""
        ...


@dataclass(frozen=True)
class Circle:
    """A plate's round rim."""

    size_m: float
    words: str
    turns: bool = False
    axis_share: float = 2.0 / 3.0

    def closest(self, q_m: Array) -> ClosestPoints:
        """Of the places q_m (N, 2)."""
        outside = self.outside_m(*q_m.T)
        far = np.maximum(outside + self.size_m, 1e-9)
        same = np.ones(len(q_m))
        return ClosestPoints(
            x_m=outside,
            normal=q_m / far[:, None],
            support_m=self.size_m * same,
            curve=1.0 / far,
            bend=same / self.size_m,
            share=_turn(q_m),
            clear=np.ones(len(q_m), dtype=bool),
        )

    def outside_m(self, u: Array, v: Array) -> Array:
        """How far places u, v lie outside."""
        return np.asarray(np.sqrt(u * u + v * v) - self.size_m)

    def normals(self, share: Array) -> Array:
        """Unit normals (K, 2) at shares (K,) of the way along it."""
        return _direction(share)


@dataclass(frozen=True)
class Rectangle:
    """Four straight edges at half_m from the centre, along u and v; from the one at +u, turning."""

    half_m: tuple[float, float]
    words: str
    turns: bool = True

    @property
    def size_m(self) -> float:
        """Half the shorter side."""
        return min(self.half_m)

    @property
    def axis_share(self) -> float:
        """The two shorter edges alone tell of the place along the longer ones."""
        return min(self.half_m) / sum(self.half_m)

    def closest(self, q_m: Array) -> ClosestPoints:
        """Of the places q_m (N, 2)."""
        half = np.array(self.half_m)
        outside = np.abs(q_m) - half
        axis = (outside[:, 1] > outside[:, 0]).astype(int)
        rows = np.arange(len(q_m))
        sign = np.where(q_m[rows, axis] < 0.0, -1.0, 1.0)
        normal = np.zeros(q_m.shape)
        normal[rows, axis] = sign
        along = q_m[rows, 1 - axis] * sign * np.where(axis == 0, 1.0, -1.0)
        length = half[1 - axis]
        place = np.clip(along / length, -1.0, 1.0) * length + length
        before = np.where(axis == 0, 0.0, 2.0 * half[1]) + (sign < 0.0) * 2.0 * half.sum()
        return ClosestPoints(
            x_m=outside[rows, axis],
            normal=normal,
            support_m=half[axis],
            curve=np.zeros(len(q_m)),
            bend=np.zeros(len(q_m)),
            share=((before + place) / (4.0 * half.sum())) % 1.0,
            clear=np.abs(along) < length - np.minimum(CORNER_M, 0.2 * length),
        )

    def outside_m(self, u: Array, v: Array) -> Array:
        """How far places u, v lie outside."""
        return np.maximum(np.abs(u) - self.half_m[0], np.abs(v) - self.half_m[1])

    def normals(self, share: Array) -> Array:
        """Unit normals (K, 2) at shares (K,) of the way along it."""
        u, v = self.half_m
        edge = np.searchsorted(np.array([v, v + u, 2 * v + u]) / (2 * (u + v)), share, side="right")
        return np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])[edge]


@dataclass(frozen=True)
class Holes:
    """Round holes, rows (u, v, radius) of (K, 3), one after the other."""

    holes_m: Array
    words: str
    axis_share: float = 2.0 / 3.0

    @property
    def size_m(self) -> float:
        """Radius of the smallest."""
        return float(self.holes_m[:, 2].min())

    @property
    def turns(self) -> bool:
        """Whether a turn about the target's centre moves a hole."""
        return bool(np.any(self.holes_m[:, :2]))

    def closest(self, q_m: Array) -> ClosestPoints:
        """Of the places q_m (N, 2)."""
        apart = q_m[:, None, :] - self.holes_m[:, :2]
        reach = np.hypot(apart[..., 0], apart[..., 1])
        nearest = np.argmax(self.holes_m[:, 2] - reach, axis=1)
        rows = np.arange(len(q_m))
        far = np.maximum(reach[rows, nearest], 1e-9)
        away = apart[rows, nearest]
        hole, normal = self.holes_m[nearest], -away / far[:, None]
        radius = hole[:, 2]
        return ClosestPoints(
            x_m=radius - far,
            normal=normal,
            support_m=np.sum(normal * hole[:, :2], axis=1) - radius,
            curve=-1.0 / far,
            bend=-1.0 / radius,
            share=(nearest + _turn(away)) / len(self.holes_m),
            clear=far > 0.3 * radius,
        )

    def outside_m(self, u: Array, v: Array) -> Array:
        """How far places u, v lie from the edge of the nearest hole, positive inside of it."""
        within = [radius - np.hypot(u - a, v - b) for a, b, radius in self.holes_m]
        return np.asarray(np.max(within, axis=0))

    def normals(self, share: Array) -> Array:
        """Unit normals (K, 2) at shares (K,) of the way along it."""
        return -_direction(share * len(self.holes_m))


def outer_edge(region: Region, words: str) -> Circle | Rectangle:
    """The outer edge of a face."""
    if region.half_m == ANY_WIDTH:
        return Circle(region.radius_m, words)
    return Rectangle(region.half_m, words)


def holes_of(region: Region, words: str) -> Holes | None:
    """The edges of a face's holes, where it has any."""
    return Holes(region.holes_m, words) if len(region.holes_m) else None


def sector(share: Array, count: int) -> npt.NDArray[np.int64]:
    """Which of `count` equal parts of the outline each share (N,) falls in."""
    return np.minimum((share * count).astype(np.int64), count - 1)


def _turn(vectors: Array) -> Array:
    return np.asarray((np.arctan2(vectors[:, 1], vectors[:, 0]) / (2.0 * np.pi)) % 1.0)


def _direction(share: Array) -> Array:
    angle = share * 2.0 * np.pi
    return np.column_stack([np.cos(angle), np.sin(angle)])
