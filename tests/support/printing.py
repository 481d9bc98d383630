"""What is printed on a board, as brightness at each place of its face; and boards as scenes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from tests.support.scenes import Setup
from wheelplane.targets.pattern_board import PatternTarget
from wheelplane.targets.registry import Target

Array = np.ndarray
DARK = 0.25


def setup_of(target: Target, base: Setup) -> Setup:
    """The scene `base` with that target's plate in it."""
    region = target.region
    base = base.but(
        thickness_m=target.thickness,
        radius_m=region.radius_m,
        holes=tuple(tuple(hole) for hole in region.holes_m),
        half_m=region.half_m if region.edge.shows_rotation else None,
    )
    if isinstance(target, PatternTarget):
        return base.but(printed=brightness(target))
    return base


def brightness(
    target: PatternTarget, wheel: str | None = None, inverted: bool = False
) -> Callable[[Array, Array], Array]:
    """1 on bare plate, DARK where ink is; the other way round if inverted. wheel: whose markers."""
    ink = {"circles": _circles, "checkerboard": _squares, "aruco": _markers}[target.kind]

    def at(u: Array, v: Array) -> Array:
        turn = np.radians(target.turn_deg)
        du, dv = u - target.offset[0], v - target.offset[1]
        a = np.cos(turn) * du + np.sin(turn) * dv
        b = np.cos(turn) * dv - np.sin(turn) * du
        dark = ink(target, a, b, wheel)
        return np.where(dark ^ inverted, DARK, 1.0)

    return at


def _circles(target: PatternTarget, a: Array, b: Array, wheel: str | None) -> Array:
    column = np.clip(np.round(a / target.pitch + (target.columns - 1) / 2), 0, target.columns - 1)
    row = np.clip(np.round((target.rows - 1) / 2 - b / target.pitch), 0, target.rows - 1)
    da = a - (column - (target.columns - 1) / 2) * target.pitch
    db = b - ((target.rows - 1) / 2 - row) * target.pitch
    return np.hypot(da, db) < target.circle_diameter / 2


def _squares(target: PatternTarget, a: Array, b: Array, wheel: str | None) -> Array:
    column = np.floor(a / target.pitch + (target.columns + 1) / 2).astype(int)
    row = np.floor((target.rows + 1) / 2 - b / target.pitch).astype(int)
    inside = (column >= 0) & (column <= target.columns) & (row >= 0) & (row <= target.rows)
    return inside & ((column + row) % 2 == 0)


def _markers(target: PatternTarget, a: Array, b: Array, wheel: str | None) -> Array:
    import cv2

    ids = target.id_sets[wheel or next(iter(target.id_sets))]
    known = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, target.dictionary))
    bits = known.markerSize + 2
    dark = np.zeros(np.shape(a), dtype=bool)
    for index, marker in enumerate(ids):
        row, column = divmod(index, target.columns)
        left = (column - (target.columns - 1) / 2) * target.pitch - target.marker_size / 2
        top = ((target.rows - 1) / 2 - row) * target.pitch + target.marker_size / 2
        image = cv2.aruco.generateImageMarker(known, marker, bits)
        j = np.floor((a - left) / target.marker_size * bits).astype(int)
        i = np.floor((top - b) / target.marker_size * bits).astype(int)
        here = (j >= 0) & (j < bits) & (i >= 0) & (i < bits)
        dark[here] = image[i[here], j[here]] == 0
    return dark
