"""The plane's parts by their definitions: points used, covariances, coarse and fine steps."""

import importlib
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from wheelplane.cloud.steps import Steps
from wheelplane.config import PlaneConfig
from wheelplane.plane.clipped_plane import fit_clipped_plane
from wheelplane.plane.correlated_noise import CorrelatedNoise
from wheelplane.plane.face_break import noise_and_break
from wheelplane.plane.fit_plane import PlaneFit, _white_variance, fit_plane
from wheelplane.plane.patch import Patch
from wheelplane.plane.rounded_plane import fit_rounded
from wheelplane.plane.scan_lines import cells_along_lines
from wheelplane.targets.plates import DiscTarget

module = importlib.import_module("wheelplane.plane.fit_plane")
DISC = DiscTarget(shape="disc", diameter=0.25)
RADIUS = 0.125 - PlaneConfig().edge_margin_m
ORIGIN = np.array([3.0, -1.0, 0.5])
NONE = CorrelatedNoise(0.0, 0.0, np.zeros((3, 3)), np.zeros((3, 3)), math.inf, 1.0)


def axes_about(normal, first):
    """Right-handed axes (3, 3) with that normal."""
    u = np.asarray(first) - (first @ normal) * normal
    u /= np.linalg.norm(u)
    return np.stack([u, np.cross(normal, u), normal])


def patch_of(seed, noise_m, step_m=0.0, axis=2, tilt_deg=0.6, count=4000, turn=None, others=0):
    """Patch of two thirds of a disc, and its true axes; nothing is symmetric about the origin.

    Its normal lies near an axis, along which coordinates are rounded to steps. turn: (3, 3), of all
    axes. others: points 30 mm behind it. The face lies 1 mm before the origin.
    """
    rng = np.random.default_rng(seed)
    normal, first = np.roll(np.eye(3), axis - 2, axis=1)[[2, 0]]
    tilt = np.tan(np.radians(tilt_deg)) * np.array([math.cos(1.0), math.sin(1.0), 0.0])
    normal = np.roll([*tilt[:2], 1.0], axis - 2) / np.linalg.norm([*tilt[:2], 1.0])
    axes = axes_about(normal, first)
    uv = rng.uniform(-RADIUS, RADIUS, (3 * count, 2))
    uv = uv[(np.hypot(*uv.T) < 0.99 * RADIUS) & (uv[:, 0] > -0.03)][:count]
    local = np.column_stack([uv, 1e-3 + noise_m * rng.standard_normal(len(uv))])
    local[: 3 * others : 3, 2] -= 0.03
    points = local @ axes
    if step_m:
        points[:, axis] = (np.rint(points[:, axis] / step_m - 0.25) + 0.25) * step_m
    start = axes_about(np.roll([1e-3, -5e-4, 1.0], axis - 2) / np.sqrt(1.0 + 1.25e-6), first)
    turn = np.eye(3) if turn is None else turn
    steps = Steps(step_m * np.eye(3)[axis], turn.T)
    nowhere = np.zeros((0, 3), np.float32)
    return (
        Patch(ORIGIN, points @ turn.T, nowhere, 1.0, start @ turn.T, noise_m, steps=steps),
        axes @ turn.T,
    )


TURNS = {
    "z": (2, None),
    "x": (0, None),
    "y": (1, None),
    "turned": (1, np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]),
}


def at(plane, covariance, points_m):
    """Variances of the plane's height at points of the scan, (N,)."""
    uv = (points_m - plane.centroid_m) @ plane.basis[:2].T
    J = np.column_stack([np.ones(len(uv)), uv])
    return np.einsum("ni,ij,nj->n", J, covariance, J)


@pytest.mark.parametrize("where", TURNS)
def test_a_plane_of_coarse_steps_is_that_of_its_likelihood_in_any_axes(where, monkeypatch):
    """By fit_rounded in the true axes, about another origin and another height."""
    noise, step = 2e-4, 1e-3
    axis, turn = TURNS[where]
    patch, axes = patch_of(1, noise, step, axis, turn=turn, others=300)
    cells, levels = [], []
    monkeypatch.setattr(
        module,
        "noise_and_break",
        lambda c, *rest: (cells.append(c), noise_and_break(c, *rest))[1],
    )
    monkeypatch.setattr(
        module,
        "fit_rounded",
        lambda uvw, n, *rest: (levels.append(n), fit_rounded(uvw, n, *rest))[1],
    )
    plane = fit_plane(patch, DISC, PlaneConfig())
    face = patch.face_m[patch.face_m @ axes[2] > -0.01]
    uvw = face @ axes.T - [0.02, 0.01, 1e-3]
    along = (face @ patch.steps.axes[axis]) / step - 0.25
    level = np.rint(along).astype(int)
    np.testing.assert_allclose(along, level, atol=1e-9)
    np.testing.assert_array_equal(np.diff(levels[0]), np.diff(level))
    exact = fit_rounded(uvw, level, step, noise, 12, 0.02)
    assert plane.count == exact.kept.sum() == len(face)
    normal = axes[2] - exact.slopes @ axes[:2]
    u = np.sqrt(np.diag(exact.covariance)[1:])
    off = (plane.normal / (plane.normal @ axes[2]) - normal) @ axes[:2].T
    assert np.all(np.abs(off) < 0.02 * u)
    assert np.sum((exact.slopes / u) ** 2) < stats.chi2.isf(1e-4, 2)
    on_plane = (plane.centroid_m - ORIGIN) @ axes.T - [0.02, 0.01, 1e-3]
    height = exact.height_m + exact.slopes @ on_plane[:2]
    assert on_plane[2] == pytest.approx(height, abs=0.02 * math.sqrt(exact.covariance[0, 0]))
    J = np.column_stack([np.ones(len(uvw)), uvw[:, :2]])
    wanted = np.einsum("ni,ij,nj->n", J, exact.covariance, J)
    here = face + ORIGIN
    np.testing.assert_allclose(at(plane, plane.point_covariance, here), wanted, rtol=0.02)
    assert plane.rounding.sigma_m == pytest.approx(exact.sigma_m, rel=1e-3)
    assert plane.rounding.step_m == pytest.approx(step, rel=1e-3)
    local = (here - plane.centroid_m) @ plane.basis.T
    np.testing.assert_allclose(local[:, :2].mean(axis=0), 0.0, atol=1e-5)
    np.testing.assert_allclose(
        plane.scatter_m2, local[:, :2].T @ local[:, :2], rtol=1e-3, atol=1e-3
    )
    assert plane.rms_m == pytest.approx(np.sqrt(np.mean(local[:, 2] ** 2)), rel=1e-4)
    assert plane.sigma_m**2 * (plane.count - 3) == pytest.approx(plane.rms_m**2 * plane.count)
    np.testing.assert_allclose(plane.basis @ plane.basis.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(plane.basis) > 0.0
    assert abs(plane.basis[0] @ patch.basis[1]) < 1e-4
    # Each cell lies where its points do, about the plane's centroid.
    (found,) = cells
    shift = (plane.centroid_m - ORIGIN) @ patch.basis[:2].T
    middle = (found.index + 0.5) * found.side_m - RADIUS - shift
    assert np.abs(found.uv_m - middle).max() < 0.55 * found.side_m


def test_fine_steps_are_a_part_of_the_noise():
    """Their s^2 / 12 is taken from the noise: both parts together are what all of it makes."""
    noise, step = 4e-4, 5e-4
    patch, axes = patch_of(2, noise, step, tilt_deg=12.0)
    steps = Steps(step * np.array([0.0, 0.5, 1.0]))
    plane = fit_plane(replace(patch, steps=steps), DISC, PlaneConfig())
    variance = float(np.sum((steps.step_m * axes[2]) ** 2)) / 12.0
    whole = plane.rounding.sigma_m**2 + variance
    assert whole == pytest.approx(plane.sigma_m**2, rel=1e-4)
    assert plane.correlated.sigma_m == 0.0
    expected = variance * np.linalg.inv(plane.scatter_m2)
    np.testing.assert_allclose(plane.rounding.covariance[1:, 1:], expected, rtol=1e-3)
    assert plane.rounding.covariance[0, 0] == pytest.approx(variance / plane.count, rel=1e-3)
    np.testing.assert_array_equal(plane.rounding.covariance[0, 1:], 0.0)
    uv = (patch.face_m + ORIGIN - plane.centroid_m) @ plane.basis[:2].T
    J = np.column_stack([np.ones(len(uv)), uv])
    by_points = plane.sigma_m**2 * np.linalg.inv(J.T @ J)  # nearly all are used
    sizes = np.sqrt(np.outer(*[np.diag(by_points)] * 2))
    np.testing.assert_allclose(plane.point_covariance / sizes, by_points / sizes, atol=0.02)


def test_a_step_is_noted_from_a_hundredth_of_the_noise_s_variance_on():
    """Uniform within the step, it has a twelfth of its square."""
    patch, _ = patch_of(2, 4e-4)
    sigma = fit_plane(patch, DISC, PlaneConfig()).sigma_m
    for share, noted in ((0.0095, False), (0.0110, True)):
        steps = Steps(np.sqrt(12.0 * share) * sigma * np.eye(3)[2])
        plane = fit_plane(replace(patch, steps=steps), DISC, PlaneConfig())
        assert (plane.rounding is not None) == noted


@pytest.mark.parametrize("shade", [None, "halves"])
def test_scan_lines_are_shown_the_residuals_of_the_points_used(shade, monkeypatch):
    patch, _ = patch_of(3, 4e-4, tilt_deg=3.0, others=200)
    if shade:
        uv = patch.face_m @ patch.basis[:2].T
        bright = (uv[:, 1] > 0.01).astype(np.float32)
        raised = patch.face_m + 1e-3 * bright[:, None] * patch.basis[2]
        patch = replace(patch, face_m=raised, face_intensity=0.2 + bright)
    shown = []

    def lines(blocks, step_m):
        shown.extend(blocks(lambda uvw, extra: (uvw, extra)))
        return cells_along_lines(blocks, step_m)

    monkeypatch.setattr(module, "cells_along_lines", lines)
    plane = fit_plane(patch, DISC, PlaneConfig())
    uvw = np.concatenate([one for one, _ in shown])
    face = patch.face_m
    if shade:
        assert plane.brightness.step_m == pytest.approx(1e-3, rel=0.1)
        extra = np.concatenate([extra for _, extra in shown])
        assert extra.mean() == pytest.approx(0.0, abs=1e-3)
        face = face - plane.brightness.step_m * (bright - bright.mean())[:, None] * plane.normal
    local = (face + ORIGIN - plane.centroid_m) @ plane.basis.T
    used = np.abs(local[:, 2]) < 3.0 * plane.sigma_m
    assert len(uvw) == plane.count == pytest.approx(used.sum(), abs=3)
    np.testing.assert_allclose(uvw.mean(axis=0), 0.0, atol=2e-6)
    if not shade:  # of a step, the last digits are its own
        np.testing.assert_allclose(uvw[:, 2], local[used][:, 2], atol=1e-9)
        np.testing.assert_allclose(uvw[:, :2], local[used][:, :2], atol=1e-5)
    assert np.std(uvw[:, 2]) == pytest.approx(plane.rms_m, rel=1e-3)


@pytest.mark.parametrize("origin", [(0.0, 0.0, 0.0), (1e6, 0.1, -3.0), (0.0, 2.0, -40.0)])
@pytest.mark.parametrize("step_m", [0.0, 1e-4])
def test_no_point_within_the_resolution_of_the_coordinates_is_clipped(origin, step_m, monkeypatch):
    slabs = []
    monkeypatch.setattr(
        module,
        "fit_clipped_plane",
        lambda *given: (slabs.append(given[2]), fit_clipped_plane(*given))[1],
    )
    patch, _ = patch_of(4, 4e-4)
    patch = replace(patch, origin_m=np.array(origin), steps=Steps(step_m * np.array([0, 0.5, 1])))
    plane = fit_plane(patch, DISC, PlaneConfig())
    last_place = np.spacing(np.abs(origin).max() + 0.125)
    across = patch.steps.across(patch.basis[2])
    assert max(4.0 * last_place, 1.5 * across) <= slabs[0].resolution_m
    assert slabs[0].resolution_m <= max(32.0 * last_place, 1.5 * across)
    np.testing.assert_allclose(plane.centroid_m - origin, patch.face_m.mean(axis=0), atol=2e-4)


def with_noise(covariance, sigma_m=1e-3):
    none = replace(NONE, covariance=covariance)
    return PlaneFit(ORIGIN, np.eye(3), sigma_m, sigma_m, np.diag([2.0, 0.5]), 100, 1, none)


def test_correlated_noise_adds_to_the_tilt_and_counts_for_fewer_points():
    alone = with_noise(np.zeros((3, 3)))
    added = np.diag([1.0, 3e-6, 1e-6])
    both = with_noise(added)
    np.testing.assert_allclose(
        both.normal_covariance - alone.normal_covariance, np.diag([3e-6, 1e-6, 0.0]), atol=1e-20
    )
    assert both.tilt_rad**2 == pytest.approx(alone.tilt_rad**2 + 2e-6)
    # As many points of independent noise on the same face: the variance goes with 1 / N.
    assert alone.tilt_rad**2 * 100 / both.effective_count == pytest.approx(both.tilt_rad**2)
    assert with_noise(-0.5 * alone.noise_covariance).effective_count == 100  # no more than all
    assert with_noise(np.zeros((3, 3)), 0.0).effective_count == 100


def test_independent_noise_is_that_within_cells_where_there_is_correlated_noise():
    """Clipped at three sigma; never more than all noise, and all of it where there is no other."""
    clipped = stats.truncnorm(-3.0, 3.0).std()
    for sigma in (1e-9, 1e-4, 0.4):
        found = replace(NONE, sigma_m=sigma, white_sigma_m=0.8 * clipped)
        assert _white_variance(1.0, found) == pytest.approx(0.64, rel=1e-4)
        assert _white_variance(0.7, found) == pytest.approx(0.49)
    assert _white_variance(1.0, replace(NONE, white_sigma_m=0.8)) == 1.0
