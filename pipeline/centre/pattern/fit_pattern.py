"""The centre of a board from what is printed on it, by the intensities of the face's points."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...targets import PatternTarget
from ...vectors import Array, turned
from .detect import marker_bits
from .image import target_image
from .pose import Pose, first_pose, marker_corners, rigid
from .refine import Shade, crossing, place_feature, round_spot

PIXELS_OF_FEATURE = 20  # a picture need not be finer than that, for a feature or a marker's module
MIN_FEATURES = 3
ROUNDS = 3
OUTLIER = 4.0  # times the robust scatter of the features about their places


@dataclass(frozen=True)
class PatternFit:
    """A printed pattern laid on what is seen of it, in the plane's coordinates.

    centre_m: (2,) of the face, as the pattern has it. covariance_m2: (2, 2) from the residuals of
    the features, with its freedom; turn_noise: (3,) covariances of the turn with the centre, and
    its variance. rms_m: of them, per axis. features: used, of `printed`.
    marker_ids: seen. wheel: that they name, if any.
    """

    centre_m: Array
    turn_rad: float
    covariance_m2: Array
    dof: float
    rms_m: float
    features: int
    printed: int
    marker_ids: tuple[int, ...]
    wheel: str | None
    turn_noise: Array

    def mirrored(self) -> PatternFit:
        """The same with the axis v turned over."""
        over = np.array([1.0, -1.0])
        return replace(
            self,
            centre_m=self.centre_m * over,
            turn_rad=-self.turn_rad,
            covariance_m2=self.covariance_m2 * np.outer(over, over),
            turn_noise=self.turn_noise * np.array([-1.0, 1.0, 1.0]),
        )


@dataclass(frozen=True)
class IntensityPoints:
    """Points of a face: uv_m (N, 2) where their beams met the plane, intensity (N,).

    beam: (2,) in-plane run of the beams per depth, zeros where it is not known. spot_m: radius of
    the laser spot.
    """

    uv_m: Array
    intensity: Array
    beam: Array
    spot_m: float

    def mirrored(self) -> IntensityPoints:
        """The same with the axis v turned over."""
        over = np.array([1.0, -1.0])
        return IntensityPoints(self.uv_m * over, self.intensity, self.beam * over, self.spot_m)


@dataclass(frozen=True)
class _Feature:
    """One feature: its place (2,) in target axes, half the window about it, and how it shades."""

    place_m: Array
    window_m: float
    shade: Shade


def find_pattern(
    face: IntensityPoints, target: PatternTarget, near: tuple[Array, float], side_known: bool
) -> PatternFit | None:
    """The pattern on a face whose outline has the centre and turn `near`; None where not found.

    side_known: whether the plane's axes are those of the face as it is seen, and not from behind,
    as they may be where nothing stands behind the plate.
    """
    found = [fit_pattern(face, target, near)]
    if not side_known:
        behind = near[0] * np.array([1.0, -1.0]), -near[1]
        fitted = fit_pattern(face.mirrored(), target, behind)
        found.append(fitted.mirrored() if fitted else None)
    apart = [float(np.hypot(*(f.centre_m - near[0]))) if f else np.inf for f in found]
    return found[int(np.argmin(apart))]


def fit_pattern(
    face: IntensityPoints, target: PatternTarget, near: tuple[Array, float]
) -> PatternFit | None:
    """The same where the plane's axes are those of the face as it is seen."""
    finest = _module_m(target) / PIXELS_OF_FEATURE
    pose = first_pose(target_image(face.uv_m, face.intensity, finest), target, near)
    if pose is None:
        return None
    fitted = None
    for _ in range(ROUNDS):
        features = _features(target, pose)
        seen = [_seen(face, feature, pose) for feature in features]
        kept = [k for k, place in enumerate(seen) if place is not None]
        if len(kept) < MIN_FEATURES:
            return None
        local = np.array([features[k].place_m for k in kept])
        places = np.array([seen[k] for k in kept], dtype=np.float64)
        fitted = _laid(local, places, len(features), pose, target)
        if fitted is None:
            return None
        pose = Pose(fitted.centre_m, fitted.turn_rad, len(kept), pose.marker_ids, pose.name)
    return fitted


def _module_m(target: PatternTarget) -> float:
    """Width of the smallest printed piece that carries an edge."""
    if target.kind != "aruco":
        return target.feature_size_m
    assert target.dictionary is not None
    return target.feature_size_m / marker_bits(target.dictionary)


def _features(target: PatternTarget, pose: Pose) -> list[_Feature]:
    """What is printed; of the markers, those that were seen."""
    if target.kind == "circles":
        radius = target.feature_size_m / 2.0
        window = min(radius + 0.4 * (target.pitch - 2.0 * radius), 1.6 * radius)
        return [_Feature(place, window, round_spot(radius)) for place in target.places_m]
    shade = crossing(pose.turn_rad + np.radians(target.turn_deg))
    if target.kind == "checkerboard":
        return [_Feature(place, 0.45 * target.pitch, shade) for place in target.places_m]
    ids = target.id_sets[str(pose.name)]
    mine = [index for index, marker in enumerate(ids) if marker in pose.marker_ids]
    gap = target.pitch - target.feature_size_m
    window = min(0.9 * _module_m(target), 0.9 * gap)
    corners = np.concatenate([marker_corners(target, index) for index in mine])
    return [_Feature(place, window, shade) for place in corners]


def _seen(face: IntensityPoints, feature: _Feature, pose: Pose) -> Array | None:
    """Where the feature is in the plane (2,), if the points show it."""
    expected = pose.places(feature.place_m[None])[0]
    q = face.uv_m - expected
    near = np.abs(q).max(axis=1) < 1.5 * feature.window_m
    q, intensity = q[near], face.intensity[near]
    inside = np.sum(q**2, axis=1) < feature.window_m**2
    q, intensity = q[inside], intensity[inside]
    spacing = feature.window_m * np.sqrt(np.pi / max(len(q), 1))
    reach = np.maximum(np.hypot(q[:, 0], q[:, 1]), 1e-9)
    slant = np.sqrt(1.0 + (q @ face.beam / reach) ** 2)
    place = place_feature(q, intensity, np.maximum(face.spot_m * slant, spacing), feature.shade)
    if place is None or float(np.hypot(*place)) > 0.5 * feature.window_m:
        return None
    return np.asarray(expected + place)


def _laid(
    local: Array, places: Array, printed: int, pose: Pose, target: PatternTarget
) -> PatternFit | None:
    """Rigid fit of the features, without those far off; covariance s^2 (A'A)^-1."""
    keep = np.ones(len(local), dtype=bool)
    for _ in range(5):
        centre, turn = rigid(local[keep], places[keep])
        residual = places - centre - turned(local, turn)
        reach = np.hypot(residual[:, 0], residual[:, 1])
        limit = OUTLIER * max(float(np.median(reach[keep])) / 1.1774, 1e-6)
        again = reach < limit
        if np.array_equal(again, keep):
            break
        if np.count_nonzero(again) < MIN_FEATURES:
            return None
        keep = again
    count = int(np.count_nonzero(keep))
    dof = 2.0 * count - 3.0
    square = float(np.sum(residual[keep] ** 2))
    q = turned(local[keep], turn)
    slopes = np.zeros((2 * count, 3))
    slopes[:count, 0] = slopes[count:, 1] = 1.0
    slopes[:count, 2], slopes[count:, 2] = -q[:, 1], q[:, 0]
    covariance = square / dof * np.linalg.inv(slopes.T @ slopes)
    return PatternFit(
        centre_m=centre,
        turn_rad=turn,
        covariance_m2=np.asarray(covariance[:2, :2]),
        dof=dof,
        rms_m=float(np.sqrt(square / (2.0 * count))),
        features=count,
        printed=printed,
        marker_ids=pose.marker_ids,
        wheel=target.wheel_of(pose.marker_ids),
        turn_noise=np.asarray(covariance[2]),
    )
