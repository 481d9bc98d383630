"""Faces that step or bend along a line: found, noted, and within the plane's uncertainty."""

from __future__ import annotations

import numpy as np
import pytest

from wheelplane.config import PlaneConfig
from wheelplane.plane import Patch, fit_plane
from wheelplane.plane.face_break import FaceBreak
from wheelplane.targets.plates import DiscTarget
from wheelplane_synth.scanner.noise import gaussian_field

RADIUS_M = 0.125
DISC = DiscTarget(shape="disc", diameter=2.0 * RADIUS_M, thickness=0.01)
SPACING_M, SIGMA_M = 0.0025, 0.0004
RAD = 180.0 * 3600.0 / np.pi


def plane_of(height, seed=0, turn=0.3):
    """Plane of a face w = height(s, t), s along a direction at `turn`, in noise; its slopes, RAD.

    The points lie at random in the cells of a grid, the centre anywhere in one of these.
    """
    rng = np.random.default_rng(seed)
    ticks = np.arange(-RADIUS_M, RADIUS_M, SPACING_M)
    u, v = np.meshgrid(ticks, ticks)
    uv = np.stack([u.ravel(), v.ravel()], axis=1) + rng.uniform(0.0, SPACING_M, (u.size, 2))
    uv = uv[np.hypot(*uv.T) < RADIUS_M]
    s = uv @ [np.cos(turn), np.sin(turn)]
    t = uv @ [-np.sin(turn), np.cos(turn)]
    w = height(s, t) + rng.normal(0.0, SIGMA_M, len(uv))
    return plane_of_points(np.column_stack([uv, w]))


def plane_of_points(points):
    none = np.zeros((0, 3), np.float32)
    patch = Patch(np.zeros(3), points, none, 1.0, np.eye(3), 1e-3)
    return fit_plane(patch, DISC, PlaneConfig())


def tilts_and_u(plane):
    """Slopes (2,) of the plane and their covariance (2, 2), with that of the face's form."""
    slopes = -plane.normal[:2] / plane.normal[2]
    parts = plane.point_covariance + plane.correlated.covariance + plane.correlated.form_covariance
    return slopes, parts[1:, 1:]


def step(size_m, at_m=0.0):
    return lambda s, t: size_m * (s > at_m)


def bend(size_m, at_m=0.0):
    return lambda s, t: size_m * (s - at_m).clip(min=0.0) / (RADIUS_M - at_m)


BREAKS = {
    "step": (step(3e-4), "step", 3e-4),
    "step down aside": (step(-3e-4, 0.04), "step", -3e-4),
    "step on the other side": (step(3e-4, -0.04), "step", -3e-4),
    "bend": (bend(8e-4), "bend", 8e-4),
    "bend back": (bend(-8e-4, 0.03), "bend", -8e-4),
}


@pytest.mark.parametrize("turn", [0.0, 1.1, 2.7, 4.0])
@pytest.mark.parametrize("name", BREAKS)
def test_the_face_beside_a_step_or_bend_lies_within_the_uncertainty(name, turn):
    """The greater part of the face has no slope; by its noise alone the plane would be 6 u off."""
    height, kind, size_m = BREAKS[name]
    plane = plane_of(height, seed=1, turn=turn)
    assert plane.broken is not None
    assert plane.broken.is_noted
    assert plane.broken.kind == kind
    assert abs(plane.broken.height_m) == pytest.approx(abs(size_m), rel=0.25)
    if "aside" in name or "other" in name:
        assert np.sign(plane.broken.height_m) == np.sign(size_m)
    slopes, covariance = tilts_and_u(plane)
    assert np.sqrt(slopes @ np.linalg.solve(covariance, slopes)) < 3.0
    by_noise = plane.noise_covariance[1:, 1:]
    assert np.sqrt(slopes @ np.linalg.solve(by_noise, slopes)) > 6.0


@pytest.mark.parametrize("seed", range(20))
def test_noise_shows_no_line(seed):
    plane = plane_of(lambda s, t: 0.0 * s, seed)
    assert plane.broken is None or plane.broken.belief < 0.5
    form = plane.correlated.form_covariance[1:, 1:]
    assert np.trace(form) < 0.5 * np.trace(plane.noise_covariance[1:, 1:])


@pytest.mark.parametrize("seed", range(6))
def test_noise_correlated_along_scan_lines_shows_no_line(seed):
    """Strips of 40 mm by 4 mm, which cells as wide as long show worst."""
    rng = np.random.default_rng(seed)
    ticks = np.arange(-RADIUS_M, RADIUS_M, 0.0013)
    u, v = (axis.ravel() for axis in np.meshgrid(ticks, ticks))
    strips = 0.0002 * gaussian_field((len(ticks),) * 2, (3.0, 30.0), rng).ravel()
    w = strips + rng.normal(0.0, 0.0008, len(u))
    found = plane_of_points(np.column_stack([u, v, w])[np.hypot(u, v) < RADIUS_M])
    assert found.correlated.sigma_m == pytest.approx(0.0002, rel=0.3)
    assert found.broken is None or not found.broken.is_noted


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("size_m", [1e-4, 3e-4, 1e-3])
@pytest.mark.parametrize("name", ["bowl", "saddle", "waves"])
def test_smooth_forms_show_no_line(name, size_m, seed):
    shapes = {
        "bowl": lambda s, t: (s * s + t * t) / RADIUS_M**2,
        "saddle": lambda s, t: s * t / RADIUS_M**2,
        "waves": lambda s, t: np.sin(40.0 * s) * np.sin(50.0 * t),
    }
    found = plane_of(lambda s, t: size_m * shapes[name](s, t), seed).broken
    assert found is None or not found.is_noted


def test_the_form_of_a_step_turns_with_the_face():
    """The greatest tilt by it lies across the line."""
    for turn in (0.0, 0.9, np.pi / 2):
        found = plane_of(step(3e-4), turn=turn).correlated.form_covariance[1:, 1:]
        across = np.array([np.cos(turn), np.sin(turn)])
        assert across @ found @ across > 0.98 * np.trace(found)


def test_a_line_is_noted_from_belief_of_nine_tenths():
    none = np.zeros((3, 3))
    assert not FaceBreak("step", 1e-3, 0.89, none).is_noted
    assert FaceBreak("step", 1e-3, 0.91, none).is_noted
