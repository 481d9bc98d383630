"""Planes of scans thinned to a least distance between points, in the order of the file."""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import KDTree

from tests.support.thinned import least_distance
from wheelplane.cloud import Steps
from wheelplane.config import PlaneConfig
from wheelplane.plane.fit_plane import fit_plane
from wheelplane.plane.patch import Patch
from wheelplane.plane.thinned.distance_pull import ENOUGH, distance_pull
from wheelplane.targets.registry import load_target
from wheelplane.vectors import plane_basis

DISC, NORMAL = load_target("disc-250"), np.array([0.6, 0.0, 0.8])
ORIGIN_M = np.array([0.4, -2.0, 1.1])


def scan(seed, slope=0.4, sigma_m=8e-4, spacing_m=1.4e-3, jitter=0.05, hole_m=0.0):
    """Points (N, 3) of a face in lines, about its centre, and the scanner's position (3,)."""
    rng, basis = np.random.default_rng(seed), plane_basis(NORMAL)
    steps = np.arange(-0.14, 0.14, spacing_m)
    q = np.stack(np.meshgrid(steps, steps, indexing="ij"), axis=-1).reshape(-1, 2)
    way, turn = rng.uniform(0.0, 2.0 * np.pi, 2)
    q += rng.normal(0.0, jitter * spacing_m, q.shape)
    q = q @ np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    q = q[(np.hypot(*q.T) < DISC.radius_m) & (np.hypot(*q.T) > hole_m)]
    scanner = 2.5 * np.array([slope * np.cos(way), slope * np.sin(way), 1.0])
    points = np.column_stack([q, np.zeros(len(q))])
    beam = scanner - points
    beam /= np.linalg.norm(beam, axis=1)[:, None]
    points += rng.normal(0.0, sigma_m, (len(q), 1)) * beam
    return points @ basis, scanner @ basis


def thinned(points, distance_m, order=None):
    """Points (M, 3) that are left in an order, of the file unless given."""
    points = points if order is None else points[order]
    return points[least_distance(points, distance_m)]


def patch_of(points):
    return Patch(ORIGIN_M, points, np.zeros((0, 3), np.float32), 1.0, plane_basis(NORMAL), 8e-4)


def fitted(patch):
    """Height of the plane at the centre, its tilts, and their u (k = 1); the noise."""
    plane = fit_plane(patch, DISC, PlaneConfig())
    tilt = plane.normal @ patch.basis[:2].T / (plane.normal @ patch.basis[2])
    off_m = (plane.centroid_m - ORIGIN_M) @ plane.normal / (plane.normal @ patch.basis[2])
    return np.array([off_m, *tilt]), np.sqrt(np.diag(plane.noise_covariance)), plane


@functools.cache
def pulls(distance_m, sigma_m):
    """Error of height, u without it, and the pull (16,) each, of 16 scans."""
    found = []
    for seed in range(16):
        points, scanner = scan(seed, sigma_m=sigma_m)
        patch = patch_of(thinned(points, distance_m))
        (off_m, *_), (u_m, *_), plane = fitted(patch)
        pull = distance_pull(patch, plane, ORIGIN_M + scanner, DISC.radius_m)
        assert pull.distance_m == pytest.approx(distance_m, rel=2e-3)
        found.append((off_m, u_m, pull.pull_m))
    return np.array(found).T


THINNED = pytest.mark.parametrize(
    ("distance_m", "sigma_m"), [(2e-3, 8e-4), (4e-3, 8e-4), (2e-3, 4e-4)]
)


@pytest.mark.slow
@THINNED
def test_planes_are_off_by_the_pull_where_the_file_s_order_is_that_of_thinning(distance_m, sigma_m):
    off_m, u_m, pull_m = pulls(distance_m, sigma_m)
    before, after = (np.sqrt(np.mean((one / u_m) ** 2)) for one in (off_m, off_m - pull_m))
    assert before > 2.5
    assert 0.5 < after < 1.5  # chi-square of 16, 0.9999


@pytest.mark.slow
@THINNED
def test_errors_are_within_the_pull_and_the_noise(distance_m, sigma_m):
    off_m, u_m, pull_m = pulls(distance_m, sigma_m)
    assert 0.7 < np.sqrt(np.mean(off_m**2) / np.mean(u_m**2 + pull_m**2)) < 1.2


def left_alone(points, scanner):
    patch = patch_of(points)
    return distance_pull(patch, fitted(patch)[2], ORIGIN_M + scanner, DISC.radius_m) is None


@pytest.mark.parametrize("sigma_m", [5e-5, 4e-4, 8e-4, 2e-3])
@pytest.mark.parametrize("jitter", [0.0, 0.05])
@pytest.mark.parametrize("hole_m", [0.0, 0.08])
def test_a_grid_of_beams_is_left_alone(sigma_m, jitter, hole_m):
    for slope in (0.0, 0.4, 1.0):
        assert left_alone(*scan(5, slope, sigma_m, jitter=jitter, hole_m=hole_m))


@pytest.mark.parametrize("sigma_m", [1e-4, 5e-4, 1.4e-3])
@pytest.mark.parametrize("slope", [0.4, 1.7])
def test_points_of_a_regular_raster_are_left_alone(sigma_m, slope):
    """As of a camera's export, or of noise across the face: the points lie in equal steps."""
    points, scanner = scan(5, slope, sigma_m=0.0, spacing_m=4e-3, jitter=0.02)
    noise = np.random.default_rng(0).normal(0.0, sigma_m, (len(points), 1))
    assert left_alone(points + noise * NORMAL, scanner)


@pytest.mark.parametrize("step_m", [1e-3, 2e-3])
def test_rounded_coordinates_are_left_alone(step_m):
    """They lie a step apart, whatever their beams do."""
    points, scanner = scan(5)
    patch = patch_of(np.rint(points / step_m) * step_m)
    patch = replace(patch, steps=Steps(np.full(3, step_m)))
    plane = fit_plane(patch, DISC, PlaneConfig())
    assert distance_pull(patch, plane, ORIGIN_M + scanner, DISC.radius_m) is None


def test_many_points_are_looked_at_in_a_strip():
    """Those of all give the same, within what chance leaves of fewer."""
    points, scanner = scan(9, spacing_m=7e-4)
    patch = patch_of(thinned(points, 1e-3))
    plane = fitted(patch)[2]
    found = distance_pull(patch, plane, ORIGIN_M + scanner, DISC.radius_m)
    assert len(patch.face_m) > 2 * ENOUGH
    with pytest.MonkeyPatch.context() as change:
        change.setattr("wheelplane.plane.thinned.distance_pull.ENOUGH", len(points))
        every = distance_pull(patch, plane, ORIGIN_M + scanner, DISC.radius_m)
    assert found.distance_m == pytest.approx(every.distance_m, rel=1e-3)
    assert found.pull_m == pytest.approx(every.pull_m, abs=4.0 * 8e-4 / ENOUGH**0.5)


@pytest.mark.parametrize("kept", [0.02, 0.1, 0.5])
def test_points_thinned_at_random_are_left_alone(kept):
    points, scanner = scan(6)
    assert left_alone(points[np.random.default_rng(1).random(len(points)) < kept], scanner)


def test_voxel_means_are_left_alone():
    points, scanner = scan(7)
    cell = np.floor(points / 3e-3).astype(int)
    _, own, count = np.unique(cell, axis=0, return_inverse=True, return_counts=True)
    mean = [np.bincount(own.ravel(), axis) / count for axis in points.T]
    assert left_alone(np.stack(mean, axis=1), scanner)


def test_too_few_points_are_left_alone():
    points, scanner = scan(8)
    few = thinned(points, 2e-3)[:199]
    patch = patch_of(few)
    plane = fitted(patch_of(thinned(points, 2e-3)))[2]
    assert distance_pull(patch, plane, ORIGIN_M + scanner, DISC.radius_m) is None


@pytest.mark.slow
def test_of_points_thinned_in_another_order_the_pull_is_no_smaller_than_their_error():
    """Their own order shows nothing of it; at random nothing is off, but u allows for it."""
    squares = []
    for seed in range(12):
        points, scanner = scan(seed)
        order = np.random.default_rng(seed).permutation(len(points))
        kept = thinned(points, 2e-3, order)
        _, rows = KDTree(points).query(kept)
        patch = patch_of(points[np.sort(rows)])
        (off_m, *_), (u_m, *_), plane = fitted(patch)
        pull = distance_pull(patch, plane, ORIGIN_M + scanner, DISC.radius_m)
        squares.append(off_m**2 / (u_m**2 + pull.pull_m**2))
    assert np.sqrt(np.mean(squares)) < 1.0
