"""Rough pose of a printed pattern, from the features found in the image."""

from __future__ import annotations

import numpy as np

from ...system import frozen
from ...targets import PatternTarget
from ...vectors import Array, turned
from .detect import Markers, find_circles, find_corners, find_markers
from .image import TargetImage

NEAR_OF_PITCH = 0.3  # how far a feature may lie from where it is expected
FOUND_SHARE = 0.3  # of the features, at least, that must be found
ROTATION_STEP_OF_PITCH = 0.25  # step of the rotations that are tried, at the pattern's border


@frozen(eq=False)
class Pose:
    """A target's axes in the plane: centre_m (2,), rotation_rad. found: number of matched features.

    marker_ids: of the target's, found; name: of the set that they belong to, see id_sets.
    """

    centre_m: Array
    rotation_rad: float
    found: int
    marker_ids: tuple[int, ...] = ()
    name: str | None = None

    def places(self, local_m: Array) -> Array:
        """Return points local_m (N, 2) of the target's axes in the plane's."""
        return self.centre_m + turned(local_m, self.rotation_rad)


def rigid(local_m: Array, seen_m: Array) -> tuple[Array, float]:
    """Return shift (2,) and rotation of least squares from local_m (K, 2) to seen_m; no scale.

    Source: Arun, Huang, Blostein, IEEE PAMI 9 (1987) 698, which in two dimensions is one arctan2.
    """
    a, b = local_m.mean(axis=0), seen_m.mean(axis=0)
    p, q = local_m - a, seen_m - b
    cross = float(np.sum(p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]))
    rotation = float(np.arctan2(cross, float(np.sum(p * q))))
    return np.asarray(b - turned(a[None], rotation)[0]), rotation


def first_pose(image: TargetImage, target: PatternTarget, near: tuple[Array, float]) -> Pose | None:
    """Return the pose of the pattern in the image, None where it is not found.

    near: centre and rotation by the outline.
    """
    if target.kind == "aruco":
        assert target.dictionary is not None
        return _of_markers(find_markers(image.grey, target.dictionary), image, target)
    if target.kind == "circles":
        pixels = find_circles(image.grey, target.feature_size_m / image.pixel_m)
    else:
        pixels = find_corners(image.grey, target.rows, target.columns)
    if len(pixels) < max(3, FOUND_SHARE * target.rows * target.columns):
        return None
    return _of_places(image.places_m(pixels), target, near)


def marker_corners(target: PatternTarget, index: int) -> Array:
    """Return corners (4, 2) of a marker in target axes, clockwise from the upper left."""
    half = target.feature_size_m / 2.0 * np.array([[-1, 1], [1, 1], [1, -1], [-1, -1]])
    return np.asarray(target.places_m[index] + turned(half, np.radians(target.turn_deg)))


def _of_markers(markers: Markers, image: TargetImage, target: PatternTarget) -> Pose | None:
    """Return the pose by the corners of the markers of the set of which most are found."""
    seen = {int(m): image.places_m(c) for m, c in zip(markers.ids, markers.corners, strict=True)}
    sets = target.id_sets
    name = max(sets, key=lambda key: len(set(sets[key]) & set(seen)))
    mine = [(index, marker) for index, marker in enumerate(sets[name]) if marker in seen]
    if not mine:
        return None
    local = np.concatenate([marker_corners(target, index) for index, _ in mine])
    centre, rotation = rigid(local, np.concatenate([seen[marker] for _, marker in mine]))
    return Pose(centre, rotation, len(mine), tuple(sorted(marker for _, marker in mine)), name)


def _of_places(seen: Array, target: PatternTarget, near: tuple[Array, float]) -> Pose | None:
    """Return the pose of unordered features: the rotation with most matches, nearest to `near`."""
    local = target.places_m
    poses = [
        _laid(seen, local, Pose(near[0], angle, 0), target) for angle in _rotations(target, near[1])
    ]
    most = max(pose.found for pose in poses)
    if most < max(3, FOUND_SHARE * len(local)):
        return None
    best = [pose for pose in poses if pose.found > 0.95 * most]
    return min(best, key=lambda pose: float(np.hypot(*(pose.centre_m - near[0]))))


def _rotations(target: PatternTarget, near: float) -> Array:
    """Return the rotations to try: those that leave the outline as it is."""
    if target.turn_period_rad:
        return near + np.arange(0.0, 2.0 * np.pi - 1e-9, target.turn_period_rad)
    reach = float(np.hypot(*(target.places_m - np.array(target.offset)).T).max())
    step = ROTATION_STEP_OF_PITCH * target.pitch / max(reach, target.pitch)
    return np.linspace(0.0, 2.0 * np.pi, int(np.ceil(2.0 * np.pi / step)), endpoint=False)


def _laid(seen: Array, local: Array, pose: Pose, target: PatternTarget) -> Pose:
    """Refine a pose by fitting it to the features near their expected positions, four times."""
    for _ in range(4):
        apart = seen[:, None] - pose.places(local)
        square = np.sum(apart**2, axis=2)
        nearest = np.argmin(square, axis=1)
        close = np.sqrt(square.min(axis=1)) < NEAR_OF_PITCH * target.pitch
        if np.count_nonzero(close) < 3:
            return Pose(pose.centre_m, pose.rotation_rad, 0)
        centre, rotation = rigid(local[nearest[close]], seen[close])
        pose = Pose(centre, rotation, int(np.count_nonzero(close)))
    return pose
