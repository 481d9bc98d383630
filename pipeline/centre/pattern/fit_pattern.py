"""Centre of a board from its printed pattern, by the intensities of its points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...system import frozen
from ...targets import PatternTarget
from ...vectors import Array, turned
from .detect import marker_bits
from .image import target_image
from .pose import Pose, first_pose, marker_corners, rigid
from .refine import Shade, crossing, place_feature, round_spot

PIXELS_OF_FEATURE = 20  # finest useful image, per feature or module of a marker
MIN_FEATURES = 3
ROUNDS = 3
OUTLIER = 4.0  # times the robust scatter of the features about their positions


@frozen(eq=False)
class PatternFit:
    """Pose of a printed pattern in the plane's coordinates.

    centre_m: (2,) of the target. covariance_m2: (2, 2) from the residuals of the features, with dof
    degrees of freedom; rotation_noise: (3,) covariances of the rotation with the centre, and its
    variance. rms_m: of the residuals, per axis. features: number used, of `printed`.
    marker_ids: of markers found. wheel: that they name, if any.
    """

    centre_m: Array
    rotation_rad: float
    covariance_m2: Array
    dof: float
    rms_m: float
    features: int
    printed: int
    marker_ids: tuple[int, ...]
    wheel: str | None
    rotation_noise: Array

    def mirrored(self) -> PatternFit:
        """Return the mirror image about the axis u."""
        over = np.array([1.0, -1.0])
        return replace(
            self,
            centre_m=self.centre_m * over,
            rotation_rad=-self.rotation_rad,
            covariance_m2=self.covariance_m2 * np.outer(over, over),
            rotation_noise=self.rotation_noise * np.array([-1.0, 1.0, 1.0]),
        )


@frozen(eq=False)
class IntensityPoints:
    """Points on a target: uv_m (N, 2) where their beams met the plane, intensity (N,).

    beam: (2,) in-plane slope of the beams per depth, zeros where unknown. spot_m: radius of the
    footprint.
    """

    uv_m: Array
    intensity: Array
    beam: Array
    spot_m: float

    def mirrored(self) -> IntensityPoints:
        """Return the mirror image about the axis u."""
        over = np.array([1.0, -1.0])
        return IntensityPoints(self.uv_m * over, self.intensity, self.beam * over, self.spot_m)


@frozen(eq=False)
class _Feature:
    """One feature: position (2,) in target axes, half the window about it, and its shading."""

    position_m: Array
    window_m: float
    shade: Shade


def find_pattern(
    face: IntensityPoints, target: PatternTarget, near: tuple[Array, float], side_known: bool
) -> PatternFit | None:
    """Find the pattern on a target whose outline has the centre and rotation `near`, or None.

    side_known: whether the plane's axes are as the scanner sees them; without a background they may
    be mirrored.
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
    """Fit the pattern in plane axes that are not mirrored; None where not found."""
    finest = _module_m(target) / PIXELS_OF_FEATURE
    pose = first_pose(target_image(face.uv_m, face.intensity, finest), target, near)
    if pose is None:
        return None
    fitted = None
    for _ in range(ROUNDS):
        features = _features(target, pose)
        located = [_locate(face, feature, pose) for feature in features]
        kept = [k for k, position in enumerate(located) if position is not None]
        if len(kept) < MIN_FEATURES:
            return None
        local = np.array([features[k].position_m for k in kept])
        places = np.array([located[k] for k in kept], dtype=np.float64)
        fitted = _laid(local, places, len(features), pose, target)
        if fitted is None:
            return None
        pose = Pose(fitted.centre_m, fitted.rotation_rad, len(kept), pose.marker_ids, pose.name)
    return fitted


def _module_m(target: PatternTarget) -> float:
    """Return the width of the smallest printed element with an edge."""
    if target.kind != "aruco":
        return target.feature_size_m
    assert target.dictionary is not None
    return target.feature_size_m / marker_bits(target.dictionary)


def _features(target: PatternTarget, pose: Pose) -> list[_Feature]:
    """Return the printed features; of markers, those that were found."""
    if target.kind == "circles":
        radius = target.feature_size_m / 2.0
        window = min(radius + 0.4 * (target.pitch - 2.0 * radius), 1.6 * radius)
        return [_Feature(place, window, round_spot(radius)) for place in target.places_m]
    shade = crossing(pose.rotation_rad + np.radians(target.turn_deg))
    if target.kind == "checkerboard":
        return [_Feature(place, 0.45 * target.pitch, shade) for place in target.places_m]
    ids = target.id_sets[str(pose.name)]
    mine = [index for index, marker in enumerate(ids) if marker in pose.marker_ids]
    gap = target.pitch - target.feature_size_m
    window = min(0.9 * _module_m(target), 0.9 * gap)
    corners = np.concatenate([marker_corners(target, index) for index in mine])
    return [_Feature(place, window, shade) for place in corners]


def _locate(face: IntensityPoints, feature: _Feature, pose: Pose) -> Array | None:
    """Return the position of a feature in the plane (2,), or None if the points do not show it."""
    expected = pose.places(feature.position_m[None])[0]
    u, v = face.uv_m.T - expected[:, None]
    inside = u * u + v * v < feature.window_m**2
    q, intensity = np.stack([u[inside], v[inside]], axis=1), face.intensity[inside]
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
    """Fit the pose to the features, without outliers; covariance s^2 (A'A)^-1."""
    keep = np.ones(len(local), dtype=bool)
    for _ in range(5):
        centre, rotation = rigid(local[keep], places[keep])
        residual = places - centre - turned(local, rotation)
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
    q = turned(local[keep], rotation)
    slopes = np.zeros((2 * count, 3))
    slopes[:count, 0] = slopes[count:, 1] = 1.0
    slopes[:count, 2], slopes[count:, 2] = -q[:, 1], q[:, 0]
    covariance = square / dof * np.linalg.inv(slopes.T @ slopes)
    return PatternFit(
        centre_m=centre,
        rotation_rad=rotation,
        covariance_m2=np.asarray(covariance[:2, :2]),
        dof=dof,
        rms_m=float(np.sqrt(square / (2.0 * count))),
        features=count,
        printed=printed,
        marker_ids=pose.marker_ids,
        wheel=target.wheel_of(pose.marker_ids),
        rotation_noise=np.asarray(covariance[2]),
    )
