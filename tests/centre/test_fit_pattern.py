"""A printed pattern is fitted as a rigid body, in order of no points, and mirrored when seen so."""

from __future__ import annotations

import functools

import numpy as np
import pytest

from tests.support.printing import brightness
from wheelplane.centre.pattern.fit_pattern import IntensityPoints, find_pattern, fit_pattern
from wheelplane.targets.registry import load_target
from wheelplane.vectors import turned

TARGETS = {
    "circles": load_target("pattern-circles"),
    "checkerboard": load_target("pattern-checkerboard"),
    "aruco": load_target("pattern-aruco"),
}
SPOT_M = 0.0015


@functools.cache
def points(name, centre=(0.003, -0.002), angle=0.02, noise=0.02, seed=0):
    """Points on a board at a pose, each the mean over a footprint of what is printed."""
    target, rng = TARGETS[name], np.random.default_rng(seed)
    half = target.edge.half_m
    q = rng.uniform(-1.0, 1.0, (20_000, 2)) * half
    at = brightness(target, wheel="RR")
    reach, way = SPOT_M * np.sqrt((np.arange(8) + 0.5) / 8), np.arange(8) * 2.399963
    spot = np.column_stack([reach * np.cos(way), reach * np.sin(way)])
    spot = np.concatenate([spot, -spot])
    light = np.mean([at(*(q + d).T) for d in spot], axis=0)
    intensity = light * (1.0 + noise * rng.normal(size=len(q)))
    return IntensityPoints(turned(q, angle) + centre, intensity, np.zeros(2), SPOT_M)


NEAR = np.array([0.003, -0.002]), 0.02


@pytest.mark.parametrize("name", TARGETS)
def test_centre_and_rotation_are_the_true_ones(name):
    found = fit_pattern(points(name), TARGETS[name], NEAR)
    u = np.sqrt(np.trace(found.covariance_m2) / 2.0)
    assert np.hypot(*(found.centre_m - NEAR[0])) < min(4.5 * u, 1e-4)
    period = TARGETS[name].print_period_rad
    off = (found.rotation_rad - NEAR[1] + period / 2.0) % period - period / 2.0
    assert abs(off) < 4.5 * np.sqrt(found.rotation_noise[2])
    assert found.features > 0.9 * found.printed
    assert found.wheel == ("RR" if name == "aruco" else None)


@pytest.mark.parametrize("name", TARGETS)
def test_gain_and_order_of_the_points_do_not_matter(name):
    here = fit_pattern(points(name), TARGETS[name], NEAR)
    face = points(name)
    order = np.random.default_rng(1).permutation(len(face.uv_m))
    other = IntensityPoints(
        face.uv_m[order], 900.0 * face.intensity[order] + 50.0, face.beam, face.spot_m
    )
    there = fit_pattern(other, TARGETS[name], NEAR)
    np.testing.assert_allclose(there.centre_m, here.centre_m, atol=1e-8)
    assert there.rotation_rad == pytest.approx(here.rotation_rad, abs=1e-7)


@pytest.mark.parametrize("name", TARGETS)
def test_a_view_from_behind_gives_the_mirror_image(name):
    """Markers are read from one side alone; for the others either side serves."""
    here = fit_pattern(points(name), TARGETS[name], NEAR)
    behind = points(name).mirrored()
    near = NEAR[0] * [1.0, -1.0], -NEAR[1]
    found = find_pattern(behind, TARGETS[name], near, side_known=False)
    np.testing.assert_allclose(found.centre_m, here.centre_m * [1.0, -1.0], atol=2e-5)
    if name == "aruco":
        assert find_pattern(behind, TARGETS[name], near, side_known=True) is None


def test_mirroring_twice_is_nothing():
    found = fit_pattern(points("circles"), TARGETS["circles"], NEAR)
    twice = found.mirrored().mirrored()
    np.testing.assert_array_equal(twice.centre_m, found.centre_m)
    np.testing.assert_array_equal(twice.covariance_m2, found.covariance_m2)
    np.testing.assert_array_equal(twice.rotation_noise, found.rotation_noise)
    assert found.mirrored().rotation_rad == -found.rotation_rad


@pytest.mark.parametrize("name", TARGETS)
def test_a_bare_board_shows_no_pattern(name):
    face, rng = points(name), np.random.default_rng(2)
    bare = 1.0 + 0.02 * rng.normal(size=len(face.uv_m))
    assert (
        fit_pattern(IntensityPoints(face.uv_m, bare, face.beam, face.spot_m), TARGETS[name], NEAR)
        is None
    )
