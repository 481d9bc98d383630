"""The plane by sums of points: that of least squares over the kept points, whatever the slab."""

from __future__ import annotations

import numpy as np
import pytest

from tests.support.scenes import rotation
from wheelplane.cloud.moments import sums_by
from wheelplane.errors import NotMeasuredError
from wheelplane.plane.clipped_plane import ClippedPlane, ClipSlab, fit_clipped_plane
from wheelplane.plane.least_squares import total_least_squares
from wheelplane.plane.sigma_clipping import Clipping, converge
from wheelplane.targets.outline import Circle, rectangle
from wheelplane.targets.region import Region

SIGMA, RADIUS, ACROSS = 0.0008, 0.125, 12
DISC = Region(Circle(RADIUS))
RESOLUTION = 1e-12


def disc(seed, count=20_000, outliers=0.05):
    """Points of a disc in z = 0 with noise, and outliers of 3.5 to 30 sigma to one side."""
    rng = np.random.default_rng(seed)
    uv = rng.uniform(-RADIUS, RADIUS, (count, 2))
    w = rng.normal(0.0, SIGMA, count)
    far = rng.random(count) < outliers
    w[far] = rng.uniform(3.5, 30.0, np.count_nonzero(far)) * SIGMA
    points = np.column_stack([uv, w])
    return points[np.hypot(*uv.T) < RADIUS]


def tilted(angle, axis=0):
    """Axes (3, 3) tilted about u or v."""
    c, s = np.cos(angle), np.sin(angle)
    about_u = np.array([[1.0, 0.0, 0.0], [0.0, c, s], [0.0, -s, c]])
    return about_u if axis == 0 else np.roll(np.roll(about_u, 1, 0), 1, 1)


def fit(points, slab, region=DISC, across=ACROSS):
    return fit_clipped_plane(points, region, slab, RADIUS, across, 50)


def plain(points):
    """The same by sigma clipping of the points themselves."""
    start = Clipping(np.eye(3), np.zeros(3), 2.0 * SIGMA)
    return converge(points, start, RESOLUTION)


@pytest.mark.parametrize("seed", range(4))
def test_plane_is_that_of_sigma_clipping_of_the_points(seed):
    points = disc(seed)
    found = fit(points, ClipSlab(np.eye(3), 0.0, 2.0 * SIGMA, RESOLUTION))
    clipping, moments = plain(points)
    assert found.plane.count == moments.count < len(points)
    np.testing.assert_allclose(np.abs(found.normal), np.abs(moments.normal), atol=1e-13)
    np.testing.assert_allclose(found.centroid_m, moments.centroid_m, atol=1e-14)
    assert found.plane.sigma_m == pytest.approx(clipping.sigma, rel=1e-9)
    everything = total_least_squares(points)  # the null answer
    assert abs(everything.centroid_m[2] - found.centroid_m[2]) > 10.0 * SIGMA / np.sqrt(len(points))


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("tilt", [1e-4, 5e-3, 2e-2])
@pytest.mark.parametrize("height", [0.0, 2.0, -4.0])  # sigmas
def test_plane_does_not_depend_on_the_slab_it_starts_from(axis, tilt, height):
    points = disc(7)
    best = fit(points, ClipSlab(np.eye(3), 0.0, SIGMA, RESOLUTION))
    slab = ClipSlab(tilted(tilt, axis), height * SIGMA, 4.0 * SIGMA, RESOLUTION)
    found = fit(points, slab)
    # An edge of the region tilted by 0.02 moves by 25 um, so a few points may be others.
    limit = 3.0 * SIGMA / RADIUS * np.sqrt(12.0) / len(points) if tilt < 1e-3 else 1e-5
    np.testing.assert_allclose(found.normal, best.normal, atol=limit)
    assert found.plane.sigma_m == pytest.approx(best.plane.sigma_m, rel=1e-2)


@pytest.mark.parametrize("seed", range(3))
def test_rotated_and_permuted_points_give_the_rotated_plane(seed):
    rng = np.random.default_rng(seed)
    points, R = disc(seed), rotation(rng)
    before = fit(points, ClipSlab(np.eye(3), 0.0, SIGMA, RESOLUTION))
    after = fit(rng.permutation(points) @ R.T, ClipSlab(R.T, 0.0, SIGMA, RESOLUTION))
    np.testing.assert_allclose(after.basis, before.basis @ R.T, atol=1e-12)
    np.testing.assert_allclose(after.centroid_m, R @ before.centroid_m, atol=1e-12)
    assert after.plane.count == before.plane.count


@pytest.mark.parametrize("seed", range(3))
def test_closed_form_is_that_of_the_eigenvectors_of_the_scatter(seed):
    """With tilts of up to 0.3 to the axes of the sums, and in cells as in one."""
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(500, 3)) * [0.1, 0.06, SIGMA] @ tilted(rng.uniform(-0.3, 0.3))
    points += rng.normal(0.0, 0.02, 3)
    moments = total_least_squares(points)
    for cells in (1, 9):
        sums = sums_by(rng.integers(cells, size=len(points)), points, cells)
        plane = ClippedPlane.of(sums)
        normal = plane.basis(np.eye(3))[2]
        assert np.linalg.norm(np.cross(normal, moments.normal)) < 1e-9
        np.testing.assert_allclose(plane.centroid_m, moments.centroid_m, atol=1e-14)
        assert plane.square_m2 == pytest.approx(moments.scatter_m2[2], rel=1e-6)
        off = (points - moments.centroid_m) @ moments.normal * np.sign(normal @ moments.normal)
        np.testing.assert_allclose(plane.distance_m(points), off, atol=1e-10)


def test_residual_sums_are_the_sums_of_the_residuals():
    rng = np.random.default_rng(5)
    points = rng.normal(size=(600, 3)) * [0.1, 0.06, SIGMA] @ tilted(0.02) + [0.01, -0.02, 0.03]
    cell = rng.integers(4, size=len(points))
    plane = ClippedPlane.of(sums_by(cell, points, 4))
    across = points - plane.centroid_m
    across[:, 2] = plane.distance_m(points)
    expected = sums_by(cell, across, 4)
    filled = [0, 1, 2, 3, 9]  # n, u, v, w and ww
    np.testing.assert_allclose(plane.residual_sums()[:, filled], expected[:, filled], atol=1e-13)
    assert np.abs(expected[:, 3]).max() > 1e-3  # so a cell's mean is no zero by itself


def test_basis_is_orthonormal_with_its_first_axis_above_that_of_the_slab():
    axes = tilted(0.4)
    found = fit(disc(3) @ axes, ClipSlab(axes, 0.0, 2.0 * SIGMA, RESOLUTION))
    np.testing.assert_allclose(found.basis @ found.basis.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(found.basis) > 0.0
    above = axes[0] - (axes[0] @ found.normal) * found.normal
    # A slab that has moved with the plane rotates it by the product of the two tilts, below 1e-6.
    np.testing.assert_allclose(found.basis[0], above / np.linalg.norm(above), atol=1e-6)
    assert np.linalg.norm(np.cross(found.normal, axes[2])) > 1e-6


def test_points_outside_the_region_do_not_matter():
    rng = np.random.default_rng(6)
    inside = rng.uniform(-1.0, 1.0, (5000, 3)) * [0.09, 0.05, SIGMA]
    outside = rng.uniform(-1.0, 1.0, (5000, 3)) * [0.12, 0.12, SIGMA] + [0.0, 0.0, 2.0 * SIGMA]
    outside = outside[(np.abs(outside[:, 0]) > 0.09) | (np.abs(outside[:, 1]) > 0.05)]
    region, slab = Region(rectangle(0.18, 0.1)), ClipSlab(np.eye(3), 0.0, SIGMA, RESOLUTION)
    alone, both = (fit(points, slab, region) for points in (inside, np.vstack([inside, outside])))
    np.testing.assert_array_equal(both.basis, alone.basis)
    assert both.plane.count == alone.plane.count == len(inside)


@pytest.mark.parametrize("axes", [(0,), (), (2,)], ids=["line", "point", "across"])
def test_points_that_span_no_plane_are_refused(axes):
    points = np.zeros((100, 3))
    for axis in axes:
        points[:, axis] = np.linspace(-0.1, 0.1, 100)
    with pytest.raises(NotMeasuredError) as caught:
        fit(points, ClipSlab(np.eye(3), 0.0, 1.0, RESOLUTION))
    assert caught.value.status == "too-few-points"


def test_three_points_are_refused():
    points = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.1, 0.0]])
    with pytest.raises(NotMeasuredError, match="fewer than 4 points agree"):
        fit(points, ClipSlab(np.eye(3), 0.0, SIGMA, RESOLUTION))


@pytest.mark.parametrize("tilt", [(0.0, 0.0), (0.4, -0.7), (-0.2, 0.05)])
def test_distances_of_points_in_other_axes_are_those_from_the_plane(tilt):
    """By rows (3, 3) from the axes of the scan, by the plane's own, and by its nearest point."""
    rng = np.random.default_rng(3)
    axes, uvw = rotation(rng), rng.normal(size=(50, 3))
    plane = ClippedPlane(np.zeros((1, 10)), rng.normal(size=3), np.array(tilt), np.eye(2), 0.0, 9)
    rows, away = plane.distances(axes)
    local = uvw @ axes @ rows.T
    np.testing.assert_allclose(local[:, :2], uvw[:, :2], atol=1e-14)
    np.testing.assert_allclose(local[:, 2] - away, plane.distance_m(uvw), atol=1e-14)
    normal = plane.basis(axes)[2] @ axes.T
    nearest = uvw - np.outer(plane.distance_m(uvw), normal)
    u, v, w = (nearest - plane.centroid_m).T
    np.testing.assert_allclose(w, tilt[0] * u + tilt[1] * v, atol=1e-14)
