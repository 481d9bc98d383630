"""The plane of the target: exact without noise, at the Cramér-Rao bound with it, and honest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import optimize, stats

from tests.support.scenes import WHEEL, Setup, Sheet, make, rotation
from wheelplane.config import PlaneConfig, SegmentConfig
from wheelplane.detection.find_target import find_target
from wheelplane.errors import NotMeasuredError
from wheelplane.plane.correlated_noise import CorrelatedNoise
from wheelplane.plane.fit_plane import PlaneFit, _white_variance, fit_plane
from wheelplane.targets.plates import DiscTarget

DISC = DiscTarget(shape="disc", diameter=0.25, thickness=0.01)
EPS = np.finfo(float).eps
MARGIN_M = PlaneConfig().edge_margin_m
COARSE = Setup(spacing_m=0.0025, half_width_m=0.2, pairs=8)


def fit(points, target=DISC, seed=0):
    patch = find_target(points, target, SegmentConfig(), seed)
    return patch, fit_plane(patch, target, PlaneConfig())


def tilt(a, b):
    return float(np.arctan2(np.linalg.norm(np.cross(a, b)), abs(a @ b)))


def tilt_sigma(setup, count):
    """2 sigma / (r sqrt N) per axis: a disc, and the noise along the beam seen across the plane."""
    sigma = setup.noise_m * np.cos(np.radians(setup.incidence_deg))
    return 2.0 * sigma / ((setup.radius_m - MARGIN_M) * np.sqrt(count))


SETUPS = {
    "plain": COARSE,
    "wheel": WHEEL,
    "head-on": COARSE.but(incidence_deg=0.0),
    "60 degrees": COARSE.but(incidence_deg=60.0),
    "60 degrees, wide spot": COARSE.but(incidence_deg=60.0, spot_m=0.003),
    "thin, wide spot": COARSE.but(thickness_m=0.003, spot_m=0.003),
    "thick": COARSE.but(thickness_m=0.02),
    "near background": COARSE.but(background_m=0.02),
    "no background": COARSE.but(background_m=None),
    "sparse": COARSE.but(spacing_m=0.005),
    "strip before it": COARSE.but(extra=(Sheet((0.03, 0, 0.06), half=(0.02, 0.5)),)),
    "parallel rim": COARSE.but(extra=(Sheet((0, 0, -0.02), inner=0.09, outer=0.2),)),
}


@pytest.mark.parametrize("name", SETUPS)
def test_noise_free_cloud_gives_the_exact_plane(name):
    cloud = make(SETUPS[name].but(noise_m=0.0), 3)
    _, plane = fit(cloud.points_m)
    assert tilt(plane.normal, cloud.normal) < 1e-9
    assert abs((plane.centroid_m - cloud.centre_m) @ cloud.normal) < 1e-9
    assert plane.normal @ cloud.normal > 0
    near = cloud.points_m[np.linalg.norm(cloud.points_m - cloud.centre_m, axis=1) < 0.15]
    untrimmed = np.linalg.svd(near - near.mean(axis=0), full_matrices=False)[2][2]
    assert tilt(untrimmed, cloud.normal) > 1e-6


@pytest.mark.parametrize("name", SETUPS)
def test_noisy_cloud_stays_within_the_formula(name):
    cloud = make(SETUPS[name], 7)
    _, plane = fit(cloud.points_m)
    sigma = cloud.setup.noise_m * np.cos(np.radians(cloud.setup.incidence_deg))
    inside = np.linalg.norm(cloud.face_m - cloud.centre_m, axis=1) < 0.125 - MARGIN_M - 0.004
    assert tilt(plane.normal, cloud.normal) < 5.0 * tilt_sigma(cloud.setup, plane.count)
    assert plane.count > 0.97 * np.count_nonzero(inside)
    assert plane.sigma_m == pytest.approx(sigma, abs=5 * sigma / np.sqrt(2 * plane.count) + 2e-5)


def test_refining_beats_the_plane_that_was_handed_over():
    start, end = [], []
    for seed in range(12):
        cloud = make(COARSE, seed)
        patch, _ = fit(cloud.points_m)
        turned = replace(patch, basis=patch.basis + 1e-3 * patch.basis[[2, 0, 0]])
        turned = replace(turned, basis=np.linalg.qr(turned.basis.T)[0].T)
        plane = fit_plane(turned, DISC, PlaneConfig())
        start.append(tilt(turned.basis[2], cloud.normal))
        end.append(tilt(plane.normal, cloud.normal))
    bound = tilt_sigma(COARSE, plane.count) * np.sqrt(2.0)
    limit = np.sqrt(stats.chi2.ppf(0.999, 24) / 24)
    assert np.sqrt(np.mean(np.square(end))) < bound * limit
    assert np.sqrt(np.mean(np.square(start))) > bound * limit


def test_agrees_with_a_robust_minimiser_over_the_true_target():
    cloud = make(WHEEL, 5)
    _, plane = fit(cloud.points_m)
    local = cloud.in_target(cloud.face_m)
    local = local[np.hypot(local[:, 0], local[:, 1]) < 0.125 - MARGIN_M]
    best = optimize.least_squares(
        lambda p: (local[:, 2] - local[:, :2] @ p[:2] - p[2]) / 8e-4, np.zeros(3)
    )
    normal = np.array([-best.x[0], -best.x[1], 1.0]) / np.sqrt(1 + best.x[:2] @ best.x[:2])
    # Points that only one of the two uses (margin, 3 sigma) are a twentieth at most.
    assert tilt(plane.normal @ cloud.R, normal) < 5 * 0.05**0.5 * tilt_sigma(WHEEL, plane.count)


@pytest.mark.parametrize("shift", [0.0, 1e4, 1e7])
def test_rotated_shifted_permuted_mirrored(shift):
    cloud = make(COARSE.but(shift_m=(0.0, 0.0, 0.0)), 8)
    _, plane = fit(cloud.points_m)
    rng = np.random.default_rng(3)
    t = shift * np.array([1.0, 0.7, -1.0])
    for move in (np.eye(3), rotation(rng), np.diag([1.0, -1.0, 1.0])):
        _, moved = fit(rng.permutation(cloud.points_m) @ move.T + t)
        # Another start keeps other points at the margin and at 3 sigma: a fraction of the noise.
        change = 0.5 * tilt_sigma(COARSE, plane.count) + 8 * EPS * shift / 0.06
        assert tilt(move @ plane.normal, moved.normal) < change
        assert moved.sigma_m == pytest.approx(plane.sigma_m, rel=0.01)


@pytest.mark.parametrize("shift", [0.0, 1e4, 1e7])
def test_exact_plane_far_away_is_known_to_the_resolution_of_its_coordinates(shift):
    cloud = make(COARSE.but(noise_m=0.0, shift_m=(shift, -shift, 0.5 * shift)), 2)
    _, plane = fit(cloud.points_m)
    rounding = EPS * max(shift, 10.0)
    assert tilt(plane.normal, cloud.normal) < max(
        1e-14, 5 * 2 * rounding / (0.12 * np.sqrt(plane.count))
    )
    assert np.isfinite(plane.sigma_m)


@pytest.mark.parametrize("factor", [2, 4])
def test_more_points_less_error_as_stated(factor):
    def stated(spacing):
        _, plane = fit(make(COARSE.but(spacing_m=spacing), 4).points_m)
        return np.sqrt(np.trace(plane.normal_covariance) / 2), plane.count

    (coarse, few), (fine, many) = stated(0.004), stated(0.004 / np.sqrt(factor))
    assert many / few == pytest.approx(factor, rel=0.1)
    assert coarse / fine == pytest.approx(np.sqrt(factor), rel=0.1)


def errors(seeds, setup):
    """Tilts (K, 2) of the normal in the plane, and their covariances (K, 2, 2)."""
    found, stated = [], []
    for seed in seeds:
        cloud = make(setup, seed)
        _, plane = fit(cloud.points_m)
        found.append((plane.normal @ cloud.R)[:2])
        stated.append((cloud.R.T @ plane.normal_covariance @ cloud.R)[:2, :2])
    return np.array(found), np.array(stated)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("setup", "count"),
    [(COARSE.but(spacing_m=0.004), 60), (COARSE.but(incidence_deg=50.0, spacing_m=0.004), 40)],
    ids=["15 degrees", "50 degrees"],
)
def test_stated_covariance_covers_the_errors(setup, count):
    found, stated = errors(range(count), setup)
    nees = np.einsum("ki,kij,kj->k", found, np.linalg.inv(stated), found)
    low, high = stats.chi2.ppf([0.0005, 0.9995], 2 * count)  # 99.9 % two-sided
    assert low < nees.sum() < high
    assert not low < nees.sum() * 4 < high
    assert not low < nees.sum() / 4 < high


@pytest.mark.parametrize(
    "setup",
    [
        pytest.param(
            COARSE.but(noise_m=0.003),
        ),
        pytest.param(
            COARSE.but(radius_m=0.04, half_width_m=0.08, spacing_m=0.001),
        ),
    ],
    ids=["noise of 3 mm", "disc of 80 mm"],
)
def test_noise_beyond_a_fortieth_of_the_radius(setup):
    count, total = 8, 0.0
    target = DiscTarget(shape="disc", diameter=2 * setup.radius_m)
    for seed in range(count):
        cloud = make(setup, seed)
        _, plane = fit(cloud.points_m, target)
        tilts = (plane.normal @ cloud.R)[:2]
        covariance = (cloud.R.T @ plane.normal_covariance @ cloud.R)[:2, :2]
        total += tilts @ np.linalg.solve(covariance, tilts)
    assert total < stats.chi2.ppf(0.9995, 2 * count)


def test_covariance_lies_in_the_plane():
    _, plane = fit(make(WHEEL, 1).points_m)
    covariance = plane.normal_covariance
    np.testing.assert_allclose(covariance, covariance.T, atol=0)
    np.testing.assert_allclose(covariance @ plane.normal, 0.0, atol=1e-12 * np.trace(covariance))
    values = np.linalg.eigvalsh(covariance)
    sigma = tilt_sigma(WHEEL, plane.count)
    np.testing.assert_allclose(np.sqrt(values[1:]), sigma, rtol=0.15)


def test_a_bowl_is_no_plane_and_its_residual_shows_it():
    cloud = make(COARSE, 6)
    local = cloud.in_target(cloud.points_m)
    depth = 0.002 * (local[:, 0] ** 2 + local[:, 1] ** 2) / 0.125**2
    _, flat = fit(cloud.points_m)
    _, bowl = fit(cloud.points_m - depth[:, None] * cloud.normal)
    # A paraboloid of depth d over a disc has the rms d / sqrt(12).
    expected = np.hypot(flat.rms_m, 0.002 * (0.12 / 0.125) ** 2 / np.sqrt(12))
    assert bowl.rms_m == pytest.approx(expected, rel=0.1)
    assert bowl.rms_m > 1.1 * flat.rms_m


def test_points_on_a_line_span_no_plane():
    line = np.column_stack([np.linspace(-0.12, 0.12, 500), np.zeros((500, 2))])
    with pytest.raises(NotMeasuredError):
        fit(line)


@pytest.mark.parametrize("seed", range(3))
def test_order_of_the_points_changes_rounding_alone(seed):
    cloud = make(WHEEL, seed)
    _, plane = fit(cloud.points_m)
    shuffled = np.random.default_rng(seed).permutation(cloud.points_m)
    patch, again = fit(shuffled)
    assert tilt(plane.normal, again.normal) < 1e-12
    assert np.abs(plane.centroid_m - again.centroid_m).max() < 1e-12
    assert again.count == plane.count
    assert again.sigma_m == pytest.approx(plane.sigma_m, rel=1e-9)
    assert not np.array_equal(patch.face_m, fit(cloud.points_m)[0].face_m)


def test_threads_change_no_bit(monkeypatch):
    cloud = make(WHEEL, 3)
    answers = []
    for count in ("1", "2", "3"):
        monkeypatch.setenv("WHEELPLANE_THREADS", count)
        _, plane = fit(cloud.points_m)
        answers.append((plane.normal.tobytes(), plane.centroid_m.tobytes(), plane.sigma_m))
    assert answers[0] == answers[1] == answers[2]


def test_independent_noise_makes_the_tilt_that_is_stated():
    """Slopes of many planes through the same points scatter as tilt_if_independent_rad says."""
    rng = np.random.default_rng(3)
    uv = rng.uniform(-0.1, 0.1, (60, 2)) * [1.0, 0.4]
    uv -= uv.mean(axis=0)
    sigma_m, count = 0.001, 20_000
    slopes = np.linalg.lstsq(uv, rng.normal(0.0, sigma_m, (60, count)), rcond=None)[0]
    none = CorrelatedNoise(0.0, 0.0, np.zeros((3, 3)), np.zeros((3, 3)), 1.0, sigma_m)
    plane = PlaneFit(np.zeros(3), np.eye(3), sigma_m, sigma_m, uv.T @ uv, 60, 1, none)
    found = np.sqrt(np.mean(slopes**2))
    assert plane.tilt_if_independent_rad == pytest.approx(found, rel=5 / np.sqrt(4 * count))
    assert plane.tilt_rad == pytest.approx(plane.tilt_if_independent_rad, rel=1e-12)
    assert plane.effective_count == pytest.approx(60)


def test_noise_within_cells_is_corrected_for_the_clipping():
    """What lies beyond three sigma is not in the cells, which show 1.3 % less."""
    noise = np.random.default_rng(5).normal(0.0, 1.0, 4_000_000)
    clipped = float(np.std(noise[np.abs(noise) < 3.0]))
    found = CorrelatedNoise(0.1, 0.01, np.zeros((3, 3)), np.zeros((3, 3)), 9.0, clipped)
    variance = _white_variance(1.2, found)
    assert variance == pytest.approx(1.0, abs=5 * np.sqrt(2 / len(noise)))
    assert _white_variance(0.5, found) == 0.25  # no more than all noise
