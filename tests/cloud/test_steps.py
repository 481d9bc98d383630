"""Steps of rounded coordinates are found from the points, and none where there is none."""

from __future__ import annotations

import numpy as np
import pytest

from tests.support.scenes import Setup, make, rotation
from wheelplane.cloud.steps import EXACT, Steps, coordinate_steps, level_step
from wheelplane.units import LENGTH_UNITS, in_metres
from wheelplane.vectors import fraction

SQUARE = Setup(spacing_m=0.004, half_width_m=0.2, pairs=4, turned=False, incidence_deg=10.0)
SCAN = make(SQUARE.but(shift_m=(3.0, -7.0, 1.5)), 1)
STEPS_M = (1e-5, 1e-4, 5e-4, 1e-3, 2e-3, 1e-2)


def rounded(points_m, step_m):
    return np.round(points_m / step_m) * step_m


@pytest.mark.parametrize("step", STEPS_M)
@pytest.mark.parametrize("kind", ["double", "single", "mm", "offset"])
def test_a_step_is_found_in_any_precision_and_unit(step, kind):
    points = rounded(SCAN.points_m, step)
    points = {
        "double": points,
        "single": points.astype(np.float32).astype(np.float64),
        "mm": np.round(points * 1e3, 6) / 1e3,
        "offset": points + np.array([512_345.67, 4_123_456.78, 31.4159]),
    }[kind]
    found = coordinate_steps(points)
    np.testing.assert_allclose(found.step_m, step, rtol=1e-3)


@pytest.mark.parametrize("unit", LENGTH_UNITS)
@pytest.mark.parametrize("offset", [300.0, 4096.3, 20_000.0])
def test_float32_has_the_step_of_its_coordinates_axis_by_axis(offset, unit):
    unit_m = in_metres(1.0, unit)
    raw = ((SCAN.points_m + np.array([offset, 0.0, 3.0 * offset])) / unit_m).astype(np.float32)
    about = np.array([offset + 3.0, -7.0, 3.0 * offset + 1.5])
    found = coordinate_steps(raw.astype(np.float64) * unit_m, about)
    wanted = np.spacing(np.abs(about / unit_m).astype(np.float32)) * unit_m
    np.testing.assert_allclose(found.step_m[[0, 2]], wanted[[0, 2]], rtol=1e-6)
    assert found.step_m[1] <= 1.001 * wanted[1]


def test_exact_coordinates_have_none():
    assert coordinate_steps(SCAN.points_m).step_m.tolist() == [0.0, 0.0, 0.0]
    assert coordinate_steps(SCAN.points_m[:0]).step_m.tolist() == [0.0, 0.0, 0.0]
    cloud = make(SQUARE.but(noise_m=0.0, spot_m=0.0), 2)
    assert coordinate_steps(cloud.points_m).step_m[:2].tolist() == [0.0, 0.0]


@pytest.mark.parametrize("digits", [None, 7])
@pytest.mark.parametrize("pitch", [2.5e-3, 1e-3])
def test_a_raster_was_not_rounded(pitch, digits):
    x, y = (axis.ravel() for axis in np.meshgrid(*[np.arange(200) * pitch] * 2))
    noise = np.random.default_rng(4).normal(0.0, 1e-4, len(x))
    z = 0.01 * x + noise
    points = np.column_stack([x, y, z if digits is None else z.round(digits)])
    assert coordinate_steps(points).step_m.max() <= 1e-7 * (1.0 + 1e-6)
    points[:, 2] = 0.75
    assert coordinate_steps(points).step_m[:2].tolist() == [0.0, 0.0]


@pytest.mark.parametrize("step", [1e-4, 5e-4, 1e-3])
def test_few_levels_of_a_raster_are_rounding_and_surfaces_are_not(step):
    """A step is found at any offset and scale of the noise; levels a pitch apart are none."""
    x, y = (axis.ravel() for axis in np.meshgrid(*[np.arange(100) * 2e-3] * 2))
    noise = np.random.default_rng(7).normal(0.0, 0.1 * step, len(x))
    z = rounded(5.0 + step * (x + y) / 0.15 + noise, step)
    assert 1 < len(np.unique(z)) < 6
    points = np.column_stack([x, y, z])
    np.testing.assert_allclose(coordinate_steps(points).step_m, [0.0, 0.0, step], rtol=1e-6)
    turned = np.roll(points, 1, axis=1)
    np.testing.assert_allclose(coordinate_steps(turned).step_m, [step, 0.0, 0.0], rtol=1e-6)
    points[:, 2] = np.where(x < 0.1, 5.0, 5.03)
    assert coordinate_steps(points).step_m.tolist() == [0.0, 0.0, 0.0]


def test_a_face_square_to_an_axis_has_the_step_of_the_others():
    rng = np.random.default_rng(5)
    points = rounded(rng.uniform(0.0, 0.25, (3000, 3)) * [1.0, 1.0, 1e-3] + 0.77, 1e-3)
    assert len(np.unique(points[:, 2])) <= 2
    np.testing.assert_allclose(coordinate_steps(points).step_m, 1e-3, rtol=1e-6)


def test_a_pose_hides_the_steps_but_for_the_axes_of_the_scan():
    R = rotation(np.random.default_rng(6))
    moved = rounded(SCAN.points_m, 1e-3) @ R.T + [10.0, -20.0, 3.0]
    assert coordinate_steps(moved).step_m.max() < 1e-8
    found = coordinate_steps(moved, axes=R.T)
    np.testing.assert_allclose(found.step_m, 1e-3, rtol=1e-3)
    np.testing.assert_allclose(found.along(R[:, 2]), [0.0, 0.0, 1e-3], atol=1e-9)


def test_the_part_across_a_plane():
    steps = Steps(np.array([1e-3, 2e-3, 0.0]))
    assert steps.across(np.array([0.6, -0.8, 0.0])) == pytest.approx(2.2e-3)
    assert EXACT.across(np.ones((5, 3))).tolist() == [0.0] * 5


def test_levels_of_irregular_distance_have_about_their_own():
    """A depth camera's: disparities, of which no step is a divisor."""
    depth = 1.0 / np.linspace(0.5, 0.6, 60)
    values = np.random.default_rng(7).choice(depth, 4000)
    step = level_step(values, 1e-16)
    assert np.diff(np.sort(depth)).min() <= step <= np.diff(np.sort(depth)).max()
    assert level_step(values[:5], 1e-16) is None


@pytest.mark.parametrize("seed", range(3))
def test_fractions_are_those_of_the_remainder(seed):
    rng = np.random.default_rng(seed)
    values = rng.normal(size=10_000) * 2.0 ** rng.uniform(-70, 70, 10_000)
    values = np.concatenate([values, [0.0, -0.0, 0.5, -1.0, 2.0**53 - 1.0]])
    assert np.array_equal(fraction(values), values % 1.0)
