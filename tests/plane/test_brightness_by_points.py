"""Range by brightness by the points themselves: what is removed, its cells, and what it costs."""

import importlib
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from tests.support.shaded_discs import Disc, checkerboard, gradient, halves
from wheelplane.config import PlaneConfig
from wheelplane.plane.brightness import (
    SETTLED,
    RangeByBrightness,
    _is_significant,
    fit_brightness,
)
from wheelplane.plane.clipped_plane import ClipSlab, fit_clipped_plane
from wheelplane.plane.correlated_noise import Cells, CorrelatedNoise, cells_across
from wheelplane.targets.plates import DiscTarget

module = importlib.import_module("wheelplane.plane.brightness")
TARGET = DiscTarget(shape="disc", diameter=0.25)
REGION = TARGET.region.shrunk(PlaneConfig().edge_margin_m)


def fitted(patch, spread=1.0):
    """Fit of the plane alone, and of range by brightness with it."""
    slab = ClipSlab(patch.basis, 0.0, spread * patch.sigma_m, 1e-12)
    across = cells_across(len(patch.face_m))
    alone = fit_clipped_plane(patch.face_m, REGION, slab, REGION.radius_m, across, 50)
    given = patch.face_m, patch.face_intensity, REGION, alone, across, 50, 1e-12
    return alone, fit_brightness(*given)


def used_by(fit, points_m):
    """Coordinates of points in the axes of a fit's slab, and which the plane was fitted to."""
    uvw = points_m @ fit.slab.basis.T
    a, b = fit.plane.tilt
    u, v, w = (uvw - fit.plane.centroid_m).T
    off = np.abs(w - a * u - b * v) / math.sqrt(1.0 + a * a + b * b)
    return uvw, (np.hypot(*uvw[:, :2].T) < REGION.radius_m) & (off < fit.slab.limit_m)


CASES = {
    "halves": Disc(halves(0.6), 3000, 0.5e-3),
    "beside the middle": Disc(halves(0.2, 0.4), 4000, 1e-3, noise_m=0.2e-3),
    "large": Disc(halves(1.0), 3000, 6e-3, noise_m=0.3e-3),
    "squares": Disc(checkerboard(0.06), 3000, -1e-3, incidence_deg=30.0),
    "few": Disc(halves(0.6), 400, 3e-3),
}


@pytest.mark.parametrize("name", CASES)
def test_the_step_is_removed_about_the_mean_brightness(name):
    """Heights of all points follow their brightness by g; the plane is that of the mean one."""
    patch, _ = CASES[name].scan(2)
    alone, found = fitted(patch, 10.0 if name == "large" else 1.0)
    moved = patch.face_m - found.level_m
    np.testing.assert_allclose(
        moved, (found.step_m * found.shade)[:, None] * alone.normal, atol=1e-15
    )
    _, used = used_by(alone, patch.face_m)
    assert found.shade[used].mean() == pytest.approx(0.0, abs=1e-12)
    assert np.ptp(found.shade) == pytest.approx(1.0)
    # The plane of what is left, by the points.
    uvw, used = used_by(found.fit, found.level_m)
    local = found.level_m[used]
    normal = np.linalg.svd(local - local.mean(axis=0), full_matrices=False)[2][2]
    assert np.linalg.norm(np.cross(normal, found.fit.normal)) < 1e-5
    np.testing.assert_allclose(uvw[used].mean(axis=0), found.fit.plane.centroid_m, atol=1e-4)


@pytest.mark.parametrize("name", CASES)
def test_cells_hold_the_mean_brightness_of_their_points_and_no_step_is_left(name):
    patch, _ = CASES[name].scan(2)
    _, found = fitted(patch, 10.0 if name == "large" else 1.0)
    cells = found.cells
    uvw, used = used_by(found.fit, found.level_m)
    across = cells_across(len(patch.face_m))
    place = np.floor(uvw[:, :2] / cells.side_m + 0.5 * across).astype(int)
    for index, count, extra in zip(cells.index, cells.count, cells.extra, strict=True):
        own = used & np.all(place == index, axis=1)
        assert own.sum() == pytest.approx(count, abs=1)
        assert extra[0] == pytest.approx(found.shade[own].mean(), abs=1e-9)
    terms = np.column_stack([np.ones(len(cells.uv_m)), cells.uv_m, cells.extra])
    normal_matrix = (terms.T * cells.count) @ terms
    left = np.linalg.solve(normal_matrix, (terms.T * cells.count) @ cells.mean_m)[3]
    u = math.sqrt(cells.white_variance * np.linalg.inv(normal_matrix)[3, 3])
    assert abs(left) < 2.0 * SETTLED * u


@pytest.mark.parametrize("name", CASES)
def test_what_the_step_costs_is_what_one_more_unknown_adds(name):
    """The covariance of height and slopes with the column, less that without; and u of g."""
    patch, _ = CASES[name].scan(1)
    _, found = fitted(patch, 10.0 if name == "large" else 1.0)
    cells, variance = found.cells, 3e-7
    terms = np.column_stack([np.ones(len(cells.uv_m)), cells.uv_m, cells.extra])
    whole = variance * np.linalg.inv((terms.T * cells.count) @ terms)
    plane = variance * np.linalg.inv((terms[:, :3].T * cells.count) @ terms[:, :3])
    by_brightness = found.found(variance)
    assert by_brightness.u_m == pytest.approx(math.sqrt(whole[3, 3]))
    sizes = np.sqrt(np.outer(*[np.diag(whole)[:3]] * 2))
    np.testing.assert_allclose(
        by_brightness.covariance / sizes, (whole[:3, :3] - plane) / sizes, atol=1e-9
    )
    assert (by_brightness.step_m, by_brightness.significant) == (found.step_m, found.significant)


def many_shades(u, v):
    """Five shades that no tilt follows."""
    return 0.2 + 0.15 * ((np.floor(u / 0.04) + 3 * np.floor(v / 0.04)) % 5)


@pytest.mark.parametrize("shade", [many_shades, gradient(0.5)])
def test_of_more_than_two_shades_only_a_step_beyond_doubt_is_removed(shade):
    for seed in range(3):
        patch, _ = Disc(shade, 3000, 0.0, speckle=0.02).scan(seed)
        assert fitted(patch)[1] is None
    patch, _ = Disc(many_shades, 3000, 3e-3, speckle=0.02).scan(1)
    assert fitted(patch, 3.0)[1].significant


def cells(step):
    """Cells on a disc with a brightness that neither tilt nor bowl follows, and a step by it."""
    index = np.argwhere(np.hypot(*np.indices((11, 11)) - 5.0) < 5.5)
    uv, count = (index - 5.0) * 0.02, np.full(len(index), 50.0)
    shade = (index.sum(axis=1) % 2).astype(float)
    u, v = uv.T
    terms = np.column_stack([np.ones(len(u)), u, v, u * u, u * v, v * v])
    rest = shade - terms @ np.linalg.lstsq(terms, shade)[0]
    return Cells(uv, step * shade, count, index, 0.02, 1e-8, shade[:, None]), 1e-8 / (
        50.0 * np.sum(rest**2)
    )


@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize(("noise", "form", "dof"), [(0, 0, 9), (3, 0, 40), (0, 2, 25), (1, 4, 60)])
def test_correlated_noise_and_form_count_in_the_test_of_a_step(noise, form, dof, sign, monkeypatch):
    """Student's t of the degrees of freedom of both variances (JCGM 100, G.4)."""
    white = cells(0.0)[1]
    added = [np.diag([5.0, 6.0, 7.0, 8.0, 9.0, 10.0, k]) * white for k in (noise, form)]
    field = CorrelatedNoise(1e-4, 0.01, *added, float(dof), 1e-4)
    monkeypatch.setattr(module, "correlated_noise", lambda *_: field)
    of_both = dof * (1.0 + noise + form) ** 2 / (noise + form) ** 2 if noise + form else np.inf
    limit = stats.t.isf(0.5e-6, of_both) * math.sqrt((1.0 + noise + form) * white)
    for share, seen in ((0.997, False), (1.003, True)):
        assert _is_significant(cells(sign * share * limit)[0], 0.1, 0.0) == seen


def test_missing_intensities_count_as_the_middle_one():
    patch, _ = Disc(many_shades, 4000, 3e-3, speckle=0.0).scan(3)
    _, whole = fitted(patch, 3.0)
    intensity = patch.face_intensity.copy()
    intensity[::9] = np.nan
    _, some = fitted(replace(patch, face_intensity=intensity), 3.0)
    assert some.step_m == pytest.approx(whole.step_m, rel=0.2)
    assert np.unique(some.shade[::9]).size == 1


def test_the_level_s_square_is_that_of_half_the_true_step():
    """Estimates scatter by u about the step: their squares are larger by u^2 on average."""
    step, u = -1.0, 0.2
    drawn = np.random.default_rng(1).normal(step, u, 20_000)
    levels = np.array([RangeByBrightness(g, u, True, np.eye(3)).level_m for g in drawn])
    scatter = np.std(drawn**2) / 4.0 / math.sqrt(len(drawn))
    assert np.mean(levels**2) == pytest.approx(step**2 / 4.0, abs=5.0 * scatter)
    assert np.all(levels * drawn >= 0.0)
    assert RangeByBrightness(0.99 * u, u, False, np.eye(3)).level_m == 0.0
