"""Targets arranged as the wheels of a vehicle: two axles, which run along the normals."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations

import numpy as np

from ..system import frozen
from ..vectors import Array

Ends = tuple[int, int]

TRACK_M, WHEELBASE_M = (0.8, 2.6), (1.5, 7.0)
MIN_TRACK_RATIO = 0.7  # of the smaller to the larger
MAX_TWIST_DEG = 10.0  # between the axles
MAX_SKEW_DEG = 15.0  # of the line through the axles' middles, from the square to them
MAX_STEERED_DEG = 50.0  # of a wheel's normal to its axle: 40 of steering, and camber
MAX_STRAIGHT_DEG = 20.0  # the same of an axle that is not steered; there must be one
IN_LINE_M, IN_LINE_DEG, LIKE_TRACKS = 0.05, 2.0, 0.8  # of the axles of a vehicle without damage
RIVAL = 1.25  # all limits that much wider: another set of four that keeps these is a rival


@frozen(eq=False)
class FoundTarget:
    """Target found in a cloud. centre_m: (3,). normal: (3,) unit, away from its back."""

    centre_m: Array
    normal: Array
    match: float


def vehicles(
    targets: Sequence[FoundTarget], among: Sequence[int], slack: float
) -> list[tuple[Ends, Ends]]:
    """Return all pairs of axles that are arranged as a vehicle's, all limits `slack` times as wide.

    among: indices of the targets that may be wheels.
    """
    return [
        (first, same)
        for first, second in combinations(axles_among(targets, among, MAX_STEERED_DEG, slack), 2)
        if not set(first) & set(second)
        for same in (second, second[::-1])
        if _stand_square(targets, (first, same), slack)
    ]


def axles_among(
    targets: Sequence[FoundTarget], among: Sequence[int], steered_deg: float, slack: float = 1.0
) -> list[Ends]:
    """Return the pairs of targets that face away from each other, a track apart.

    steered_deg: largest angle of their normals to the line through both.
    """
    return [
        (i, j)
        for i, j in combinations(among, 2)
        if _within(distance_m(targets[i], targets[j]), TRACK_M, slack)
        and _steered_deg(targets, (i, j)) < steered_deg * slack
    ]


def are_in_line(targets: Sequence[FoundTarget], ends: tuple[Ends, Ends]) -> bool:
    """Return whether two axles, the ends of both in the same order, lie as one vehicle's do.

    Those of two vehicles seldom do. Limits are those of setback, and of targets' rough centres.
    """
    centres = centres_of(targets, ends)
    across = centres[:, 0] - centres[:, 1]
    tracks_m = np.linalg.norm(across, axis=1)
    along = centres[1].mean(axis=0) - centres[0].mean(axis=0)
    both = across.sum(axis=0)
    return (
        _angle_deg(across[0], across[1]) < IN_LINE_DEG
        and abs(float(along @ both)) < IN_LINE_M * float(np.linalg.norm(both))
        and float(tracks_m.min() / tracks_m.max()) > LIKE_TRACKS
    )


def centres_of(targets: Sequence[FoundTarget], ends: tuple[Ends, Ends]) -> Array:
    """Return the centres (2, 2, 3) of two axles: axle, end, coordinate."""
    return np.array([[targets[i].centre_m for i in axle] for axle in ends])


def _steered_deg(targets: Sequence[FoundTarget], ends: Ends) -> float:
    """Return the largest angle between the outward normals of an axle's ends and the axle."""
    one, other = (targets[i] for i in ends)
    out = (one.centre_m - other.centre_m) / distance_m(one, other)
    return max(_angle_deg(one.normal, out), _angle_deg(other.normal, -out))


def _stand_square(targets: Sequence[FoundTarget], ends: tuple[Ends, Ends], slack: float) -> bool:
    """Return whether two axles lie behind each other, alike, and at least one not steered."""
    centres = centres_of(targets, ends)
    across = centres[:, 0] - centres[:, 1]
    tracks_m = np.linalg.norm(across, axis=1)
    along = centres[1].mean(axis=0) - centres[0].mean(axis=0)
    return (
        _angle_deg(across[0], across[1]) < MAX_TWIST_DEG * slack
        and _within(float(np.linalg.norm(along)), WHEELBASE_M, slack)
        and abs(90.0 - _angle_deg(along, across.sum(axis=0))) < MAX_SKEW_DEG * slack
        and float(tracks_m.min() / tracks_m.max()) > MIN_TRACK_RATIO / slack
        and min(_steered_deg(targets, axle) for axle in ends) < MAX_STRAIGHT_DEG * slack
    )


def _within(size: float, limits: tuple[float, float], slack: float) -> bool:
    return limits[0] / slack <= size <= limits[1] * slack


def distance_m(one: FoundTarget, other: FoundTarget) -> float:
    """Return the distance between the targets' centres."""
    return float(np.linalg.norm(one.centre_m - other.centre_m))


def _angle_deg(a: Array, b: Array) -> float:
    return math.degrees(math.atan2(float(np.linalg.norm(np.cross(a, b))), float(a @ b)))
