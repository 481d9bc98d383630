"""The plane by sums of points: that of least squares over the kept points, whatever the slab."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.support.scenes import rotation
from wheelplane.cloud.moments import sums_by
from wheelplane.errors import NotMeasuredError
from wheelplane.plane.clipped_plane import (
    MARGIN,
    ClippedPlane,
    ClipSlab,
    _converge,
    fit_clipped_plane,
)
from wheelplane.plane.least_squares import total_least_squares
from wheelplane.plane.sigma_clipping import CLIPPED_SIGMA_RATIO, Clipping, converge
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


@pytest.mark.parametrize("height", [0.0, 1.5, -1.0])  # sigmas
def test_as_many_fits_as_sigma_clipping_from_there_takes(height):
    """A slab so near that the points are summed once: fits and refits by plain least squares."""
    points = disc(4)
    points[:, 2] += 0.02  # so that heights in the axes are no distances from the slab
    slab = ClipSlab(np.eye(3), 0.02 + height * SIGMA, 1.3 * SIGMA, RESOLUTION)
    keep, fits = np.abs(points[:, 2] - slab.height_m) < 3.9 * SIGMA, 0
    counts = []
    while True:
        fits += 1
        terms = np.column_stack([np.ones(keep.sum()), points[keep, :2]])
        best = np.linalg.lstsq(terms, points[keep, 2])[0]
        off = points[:, 2] - best[0] - points[:, :2] @ best[1:]
        sigma = np.sqrt(np.sum(off[keep] ** 2) / (keep.sum() - 3)) / CLIPPED_SIGMA_RATIO
        counts.append(keep.sum())
        before, keep = keep, np.abs(off) < 3.0 * sigma
        if np.array_equal(before, keep):
            break
    assert fits > 2
    moments = slab.sums(points, DISC, ACROSS)
    wide = replace(moments, sums=np.zeros_like(moments.sums), edge=points)  # all are near the limit
    plane, steps = _converge(wide, slab, 50)
    assert (steps, plane.count) == (fits, counts[-1])
    for most in (1, 2):
        plane, steps = _converge(wide, slab, most)
        assert (steps, plane.count) == (most, counts[most - 1])


def test_fits_are_counted_over_all_slabs_up_to_the_most():
    points = disc(5)
    far = ClipSlab(tilted(0.01), 0.0, 4.0 * SIGMA, RESOLUTION)
    assert fit_clipped_plane(points, DISC, far, RADIUS, ACROSS, 1).iterations == 1
    whole = fit_clipped_plane(points, DISC, far, RADIUS, ACROSS, 50)
    here = fit_clipped_plane(points, DISC, whole.slab, RADIUS, ACROSS, 50)
    assert here.iterations < whole.iterations < 20
    assert here.slab is whole.slab


@pytest.mark.parametrize("height", [0.0, 0.5, -0.5])
@pytest.mark.parametrize(("share", "near"), [(0.97, True), (1.03, False)])
def test_a_slab_is_near_a_plane_if_its_limits_move_by_less_than_the_margin(height, share, near):
    """By height, tilt at the radius or noise; each alone, either way, and all together."""
    slab, radius = ClipSlab(np.eye(3), height, 2e-4, RESOLUTION), 0.3
    most = MARGIN * slab.limit_m * share

    def plane(up, tilt, limit):
        sigma = slab.sigma_m + limit / 3.0
        square = (sigma * CLIPPED_SIGMA_RATIO) ** 2 * 97
        mean = np.array([0.1, 0.2, height + up])
        return ClippedPlane(np.zeros((1, 10)), mean, np.array(tilt), np.eye(2), square, 100)

    for sign in (-1.0, 1.0):
        by = sign * most
        for tilt in ((by / radius, 0.0), (0.6 * by / radius, -0.8 * by / radius)):
            assert slab.is_near(plane(0.0, tilt, 0.0), radius) == near
        assert slab.is_near(plane(by, (0.0, 0.0), 0.0), radius) == near
        assert slab.is_near(plane(0.0, (0.0, 0.0), by), radius) == near
        third = by / 3.0
        assert slab.is_near(plane(third, (0.0, third / radius), third), radius) == near


def test_four_points_give_a_plane_and_a_strip_narrower_than_its_noise_gives_none():
    corners = np.array([[1.0, 1.0, 1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0], [1.0, -1.0, -1.0]])
    plane = ClippedPlane.of(sums_by(np.zeros(4, int), corners * [0.1, 0.1, 1e-3], 1))
    assert plane.count == 4
    assert plane.sigma_m * CLIPPED_SIGMA_RATIO == pytest.approx(2e-3)
    strip = np.random.default_rng(1).normal(size=(500, 3)) * [0.1, 1e-3, 2e-3]
    with pytest.raises(NotMeasuredError, match="span no plane"):
        ClippedPlane.of(sums_by(np.zeros(500, int), strip, 1))
