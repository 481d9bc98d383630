"""Range by brightness: removed with its uncertainty where it is, and nothing moves elsewhere."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from tests.support.shaded_discs import Disc, checkerboard, gradient, halves, plain
from wheelplane.config import PlaneConfig
from wheelplane.plane import Patch
from wheelplane.plane.brightness import DARK, FALSE_ALARM, _cells, dof_of_both
from wheelplane.plane.clipped_plane import ClipSlab, fit_clipped_plane
from wheelplane.plane.fit_plane import fit_plane
from wheelplane.targets.plates import DiscTarget, RectangleTarget

TARGET = DiscTarget(shape="disc", diameter=0.25)


def fit(patch):
    return fit_plane(patch, TARGET, PlaneConfig())


def blind(patch):
    return fit(replace(patch, face_intensity=None))


def errors(plane, true):
    """Two slopes of the true normal in the plane's axes, and their standard uncertainties."""
    axes = plane.basis[:2]
    return axes @ true, np.sqrt(np.diag(axes @ plane.normal_covariance @ axes.T))


@pytest.mark.parametrize("ratio", [0.1, 1.0, 4.0])
def test_degrees_of_freedom_of_two_variances_are_those_of_a_chi_square_of_their_scatter(ratio):
    """The sum's estimate scatters as that chi-square does: var / mean^2 = 2 / dof."""
    dof, field = 7.0, 0.3
    drawn = ratio * field + field * stats.chi2(dof).rvs(200_000, random_state=1) / dof
    expected = 2.0 * drawn.mean() ** 2 / drawn.var()
    assert dof_of_both(ratio * field, field, dof) == pytest.approx(expected, rel=0.02)
    assert dof_of_both(1.0, 0.0, dof) == math.inf


@pytest.mark.slow
@pytest.mark.parametrize("bias_mm", [0.1, 0.3, 1.0])
@pytest.mark.parametrize(("points", "incidence_deg"), [(300, 20.0), (3000, 0.0), (3000, 45.0)])
def test_errors_are_those_stated_where_half_of_the_face_is_dark(points, incidence_deg, bias_mm):
    ratios, ignored = [], []
    for seed in range(30):
        shade = halves(0.2 * seed)
        disc = Disc(shade, points, 1e-3 * bias_mm, incidence_deg=incidence_deg)
        patch, true = disc.scan(seed)
        error, u = errors(fit(patch), true)
        ratios += list(error / u)
        ignored += list(np.divide(*errors(blind(patch), true)))
    assert 0.75 < np.sqrt(np.mean(np.square(ratios))) < 1.25
    if bias_mm > 0.3 or (points, bias_mm) == (3000, 0.3):
        assert np.sqrt(np.mean(np.square(ignored))) > 3.0


@pytest.mark.parametrize("shade", [halves(1.0), halves(0.0, 0.5), checkerboard(0.06)])
def test_the_difference_of_ranges_is_found(shade):
    for seed in range(5):
        patch, _ = Disc(shade, 10_000, 0.5e-3).scan(seed)
        found = fit(patch).brightness
        assert found.significant
        assert abs(found.step_m + 0.5e-3) < 4.0 * found.u_m < 0.2e-3


def test_the_tilt_across_halves_costs_what_the_step_shares_with_it():
    """On a disc sgn(x) and x have the squared correlation 64 / (9 pi^2), which cells increase."""
    patch, _ = Disc(halves(0.7), 20_000).scan(3)
    plane = fit(patch)
    known, all_of_it = plane.noise_covariance[1:, 1:], plane.point_covariance[1:, 1:]
    growth = np.sort(np.linalg.eigvals(np.linalg.solve(known, all_of_it)).real)
    assert growth[0] == pytest.approx(1.0, abs=1e-9)
    least = 1.0 / (1.0 - 64.0 / (9.0 * math.pi**2))
    assert least < growth[1] < 1.3 * least
    assert not plane.brightness.significant


CLEAN = {
    "plain": Disc(plain),
    "at an incidence": Disc(plain, incidence_deg=45.0, speckle=1e-3),
    "trend": Disc(gradient(0.5), speckle=1e-3),
    "trend and speckle": Disc(gradient(0.5), speckle=0.2),
    "bowl under a trend": Disc(
        gradient(0.5), bowl_m=0.5e-3, noise_m=0.2e-3, speckle=1e-3, incidence_deg=45.0
    ),
    "waves under a trend": Disc(gradient(0.5), waves_m=0.2e-3, noise_m=0.2e-3, speckle=0.05),
    "glints": Disc(plain, glints=DARK / 2.0),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", CLEAN)
def test_nothing_moves_where_ranges_do_not_follow(name):
    for seed in range(10):
        patch, _ = CLEAN[name].scan(seed)
        plane, other = fit(patch), blind(patch)
        assert plane.brightness is None
        assert np.array_equal(plane.basis, other.basis)
        assert np.array_equal(plane.normal_covariance, other.normal_covariance)


def test_a_bowl_would_pass_for_brightness_if_only_planes_were_fitted():
    """The law above is not empty: heights and intensities of such a face are correlated."""
    patch, _ = CLEAN["bowl under a trend"].scan(0)
    plane = blind(patch)
    uvw = (patch.face_m + patch.origin_m - plane.centroid_m) @ plane.basis.T
    inside = np.hypot(*uvw[:, :2].T) < 0.11
    terms = np.column_stack([np.ones(inside.sum()), uvw[inside, :2]])
    both = np.column_stack([uvw[inside, 2], patch.face_intensity[inside]])
    rest = both - terms @ np.linalg.lstsq(terms, both, rcond=None)[0]
    share = np.corrcoef(rest.T)[0, 1]
    assert math.erfc(abs(share) * math.sqrt(inside.sum() / 2.0)) < FALSE_ALARM


def test_glints_do_not_steer():
    for seed in range(5):
        patch, true = Disc(halves(1.0), 5000, 1e-3, glints=0.03).scan(seed)
        error, u = errors(fit(patch), true)
        assert np.all(np.abs(error) < 4.0 * u)
        assert fit(patch).brightness.significant


def test_a_step_found_in_print_of_more_shades_is_removed():
    def shade(u, v):
        return halves(0.3)(u, v) + checkerboard(0.03, 0.0, 0.6)(u, v)

    ratios = []
    for seed in range(20):
        patch, true = Disc(shade, 5000, 1e-3, incidence_deg=10.0, speckle=0.02).scan(seed)
        plane = fit(patch)
        assert plane.brightness.significant
        error, u = errors(plane, true)
        ratios += list(error / u)
    assert 0.7 < np.sqrt(np.mean(np.square(ratios))) < 1.3


@pytest.mark.parametrize("value", [np.nan, 0.0, np.inf])
def test_intensities_that_show_nothing_are_left_alone(value):
    patch, _ = Disc(halves(1.0), 2000, 1e-3).scan(1)
    empty = replace(patch, face_intensity=np.full_like(patch.face_intensity, value))
    assert fit(empty).brightness is None


def test_a_face_without_noise_is_measured_whatever_its_intensities():
    """As in steps of coordinates wider than the noise, which ended in a division by zero."""
    patch, true = Disc(halves(1.0), 4000, 0.0, noise_m=0.0).scan(1)
    flat = patch.face_m - np.outer(patch.face_m @ true, true)
    found = fit(replace(patch, face_m=flat))
    assert found.brightness is None
    assert np.linalg.norm(found.normal - true) < 1e-9


def test_single_missing_intensities_are_no_matter():
    patch, true = Disc(halves(1.0), 5000, 1e-3).scan(1)
    patch.face_intensity[::10] = np.nan
    error, u = errors(fit(patch), true)
    assert np.all(np.abs(error) < 4.0 * u)


def raster(columns, rows, step_m, slopes, seed=2):
    """Patch of a square of 0.25 m in row order: three shades, and ranges that follow them."""
    rng = np.random.default_rng(seed)
    u, v = (
        axis.ravel()
        for axis in np.meshgrid(
            *((np.arange(count) + 0.5) / count * 0.24 - 0.12 for count in (columns, rows))
        )
    )
    shade = 0.5 * (u > -0.05) + 0.5 * ((u > 0.03) & (v > -0.06))
    w = u * slopes[0] + v * slopes[1] + step_m * shade + 8e-4 * rng.standard_normal(len(u))
    seen = 100.0 * shade + 20.0 + 2.0 * rng.standard_normal(len(u))
    return Patch(
        origin_m=np.array([1.0, 2.0, 3.0]),
        face_m=np.column_stack([u, v, w]),
        around_m=np.zeros((0, 3), np.float32),
        match=1.0,
        basis=np.eye(3),
        sigma_m=8e-4,
        face_intensity=seen.astype(np.float32),
    )


@pytest.mark.parametrize(("columns", "rows"), [(100, 990), (200, 2450)])
def test_the_order_of_the_points_is_no_matter(columns, rows):
    """Rows of a multiple of any stride: a first look at every tenth point saw ten columns."""
    square = RectangleTarget(shape="rectangle", width=0.25, height=0.25)
    slopes = np.array([0.01, 0.02])
    patch = raster(columns, rows, 3e-4, slopes)
    order = np.random.default_rng(3).permutation(len(patch.face_m))
    mixed = replace(patch, face_m=patch.face_m[order], face_intensity=patch.face_intensity[order])
    found = [fit_plane(one, square, PlaneConfig()) for one in (patch, mixed)]
    for plane in found:
        error, u = errors(plane, np.append(-slopes, 1.0) / np.sqrt(1.0 + slopes @ slopes))
        assert np.all(np.abs(error) < 4.0 * u)
        assert abs(plane.brightness.step_m - 3e-4) < 4.0 * plane.brightness.u_m
        assert plane.brightness.significant
    apart = np.linalg.norm(found[0].normal - found[1].normal)
    assert apart < 0.1 * found[0].tilt_rad


def test_cells_without_a_looked_at_point_are_left_out():
    patch = raster(100, 100, 0.0, np.zeros(2))
    region = RectangleTarget(shape="rectangle", width=0.25, height=0.25).region
    slab = ClipSlab(np.eye(3), 0.0, 8e-4, 0.0)
    fit = fit_clipped_plane(patch.face_m, region, slab, region.radius_m, 12, 30)
    bright = np.ones(len(patch.face_m))
    whole = _cells(patch.face_m, bright, region, fit, 12)
    half = patch.face_m[:, 0] < 0.0
    cells = _cells(patch.face_m[half], bright[half], region, fit, 12)
    assert 0.4 < len(cells.count) / len(whole.count) < 0.7
    assert np.all(cells.extra == 1.0)
    assert _cells(patch.face_m[:5], bright[:5], region, fit, 12) is None


def test_few_points_are_fitted_without():
    patch, _ = Disc(halves(1.0), 90, 1e-3).scan(1)
    assert fit(patch).brightness is None
