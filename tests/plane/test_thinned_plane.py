"""Planes of scans thinned on a voxel grid: the lattice is recognised and its pull is honest."""

from __future__ import annotations

import importlib

import numpy as np
import pytest
from scipy import stats

from wheelplane.cloud import VoxelLattice, find_lattice
from wheelplane.config import PlaneConfig
from wheelplane.plane import Patch, fit_plane
from wheelplane.plane.thinned_plane import fit_pull
from wheelplane.targets.plates import DiscTarget

thinned_plane = importlib.import_module("wheelplane.plane.thinned_plane")

DISC = DiscTarget(shape="disc", diameter=0.25, thickness=0.01)
CENTRE_M = np.array([0.1, 0.75, 0.3])
TRUST = 1e-4  # probability that a right program fails a test


def face(rng, sigma_m=8e-4, spacing_m=2e-3, yaw_deg=0.0, incidence_deg=15.0):
    """Points (N, 3) of a disc near CENTRE_M that faces y, of a grid of beams; its normal (3,)."""
    toe, camber = np.radians([yaw_deg + rng.uniform(-0.5, 0.5), rng.uniform(-1.8, 1.5)])
    normal = np.array([np.sin(toe), np.cos(toe), -np.tan(camber)])
    normal /= np.linalg.norm(normal)
    first = np.cross([0.0, 0.0, 1.0], normal)
    first /= np.linalg.norm(first)
    axes = np.stack([first, np.cross(normal, first)])
    way, tilt = rng.uniform(0.0, 2.0 * np.pi), np.radians(incidence_deg)
    beam = np.cos(tilt) * normal + np.sin(tilt) * np.array([np.cos(way), np.sin(way)]) @ axes
    side = np.cross(beam, [0.0, 0.0, 1.0])
    side /= np.linalg.norm(side)
    grid = np.arange(-0.15, 0.15, spacing_m) + rng.uniform(0.0, spacing_m)
    a, b = (each.reshape(-1, 1) for each in np.meshgrid(grid, grid))
    points = a * side + b * np.cross(side, beam)
    points -= (points @ normal / (beam @ normal))[:, None] * beam
    points = points[np.hypot(*(axes @ points.T)) < 0.125]
    points += rng.normal(0.0, sigma_m, (len(points), 1)) * beam
    return points + CENTRE_M + rng.uniform(-0.01, 0.01, 3), normal


def means(points, edge_m):
    """One point a cell: the mean of its points, as of Open3D and PCL."""
    cell = np.floor(points / edge_m).astype(int)
    _, own, count = np.unique(cell, axis=0, return_inverse=True, return_counts=True)
    return np.stack([np.bincount(own.ravel(), axis) / count for axis in points.T], axis=1)


def nearest(points, edge_m):
    """One point a cell: the one nearest to its middle, as of the octree of CloudCompare."""
    cell = np.floor(points / edge_m).astype(int)
    order = np.argsort(np.linalg.norm(points - (cell + 0.5) * edge_m, axis=1))
    return points[order[np.unique(cell[order], axis=0, return_index=True)[1]]]


def fit(points, normal):
    """Plane of the points, by fit_plane from a patch about them."""
    first = np.cross([0.0, 0.0, 1.0], normal)
    first /= np.linalg.norm(first)
    basis = np.stack([first, np.cross(normal, first), normal])
    origin = points.mean(axis=0)
    none = np.zeros((0, 3), np.float32)
    return fit_plane(Patch(origin, points - origin, none, 1.0, basis, 1e-3), DISC, PlaneConfig())


def scores(plane, normal):
    """Errors of the two tilts over u, (2,)."""
    across = plane.basis[:2]
    off = across @ (plane.normal - normal)
    return off / np.sqrt(np.diag(across @ plane.normal_covariance @ across.T))


CASES = [
    (means, 3e-3, {}),
    (means, 6e-3, {}),
    (means, 2e-3, {"spacing_m": 1e-3}),
    (means, 5e-3, {"sigma_m": 3e-4}),
    (nearest, 3.7e-3, {"sigma_m": 2e-3}),
]


@pytest.mark.slow
@pytest.mark.parametrize(("thin", "edge_m", "scan"), CASES)
def test_plane_is_within_three_u_whatever_the_phase(thin, edge_m, scan):
    found = []
    for seed in range(12):
        points, normal = face(np.random.default_rng(seed), **scan)
        found.append(scores(fit(thin(points, edge_m), normal), normal))
    assert np.sum(np.square(found)) < 1.25**2 * stats.chi2.isf(TRUST, np.size(found))
    assert np.abs(found).max() < stats.norm.isf(TRUST / np.size(found))


def test_a_pulled_plane_is_corrected_and_named():
    """Least squares of the same points are beyond 5 u of their own in many scans."""
    plain, mine = [], []
    for seed in range(8):
        points, normal = face(np.random.default_rng(seed))
        thinned = means(points, 6e-3)
        plane = fit(thinned, normal)
        if plane.thinning is None:
            continue
        assert plane.thinning.edge_m == pytest.approx(6e-3, rel=0.01)
        terms = np.column_stack([np.ones(len(thinned)), thinned[:, [0, 2]]])
        by_squares, square, *_ = np.linalg.lstsq(terms, thinned[:, 1], rcond=None)
        u = np.sqrt(square / len(thinned) * np.diag(np.linalg.inv(terms.T @ terms)))[1:]
        plain.append((by_squares[1:] + normal[[0, 2]] / normal[1]) / u)
        mine.append(scores(plane, normal))
    assert len(mine) > 4
    assert np.abs(plain).max() > 5.0
    assert np.abs(mine).max() < 3.5


@pytest.mark.parametrize(("thin", "edge_m"), [(means, 3e-3), (means, 5e-3), (nearest, 5e-3)])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_lattice_is_found_with_its_edge_and_boundary(thin, edge_m, axis):
    points, normal = face(np.random.default_rng(7))
    points, normal = np.roll(points, axis, axis=1), np.roll(normal, axis)
    lattice = find_lattice(thin(points, edge_m), np.eye(3), normal)
    assert lattice is not None
    assert lattice.edge_m == pytest.approx(edge_m, rel=0.005)
    assert abs(lattice.axis @ np.roll([0.0, 1.0, 0.0], axis)) == 1.0
    # Lattices start at the origin; the nearest boundary counts, so far as the edge is known.
    off = np.angle(np.exp(2j * np.pi * lattice.boundary_m / edge_m)) / (2.0 * np.pi)
    assert abs(off) * edge_m < 4.0 * lattice.boundary_u_m + 0.02 * edge_m


def test_lattice_along_a_rotated_pose_is_found_by_its_axes():
    points, normal = face(np.random.default_rng(7))
    turn = np.linalg.qr(np.random.default_rng(4).normal(size=(3, 3)))[0]
    thinned = means(points, 4e-3) @ turn
    lattice = find_lattice(thinned, turn, normal @ turn)
    assert lattice is not None
    assert lattice.edge_m == pytest.approx(4e-3, rel=0.005)
    assert find_lattice(thinned, np.eye(3), normal @ turn) is None


def on_raster(points, normal):
    """Exact positions along x and z, the height of the points measured."""
    number = np.unique(np.rint(points[:, [0, 2]] / 2e-3), axis=0) * 2e-3
    height = number @ (-normal[[0, 2]] / normal[1])
    noise = np.random.default_rng(1).normal(0.0, 8e-4, len(number))
    return np.column_stack([number[:, 0], height + noise, number[:, 1]])


UNTHINNED = {
    "as scanned": lambda points, _: points,
    "at random": lambda points, _: points[np.random.default_rng(1).random(len(points)) < 0.1],
    "twice": lambda points, _: np.concatenate([points, points]),
    "two stations": lambda points, _: np.concatenate(
        [points, points + np.array([7e-4, 4e-3, 3e-4])]
    ),
    "a raster": on_raster,
}


@pytest.mark.parametrize("kind", UNTHINNED)
@pytest.mark.parametrize("scan", [{}, {"incidence_deg": 0.01}, {"spacing_m": 1e-3}])
def test_no_lattice_where_none_was_used(kind, scan):
    for seed in range(4):
        points, normal = face(np.random.default_rng(seed), **scan)
        assert find_lattice(UNTHINNED[kind](points, normal), np.eye(3), normal) is None


def test_rounded_coordinates_count_as_rounded_alone():
    points, normal = face(np.random.default_rng(4))
    assert fit(points.round(3), normal).thinning is None


def test_pull_follows_its_definition():
    """The form for n points a column is the mean of simulated columns, thinned by definition."""
    rng = np.random.default_rng(1)
    noise, count, depths = 0.2, 6, np.array([0.05, 0.15, 0.3, 0.5, 0.8])
    got = thinned_plane._form(depths, noise, float(count))
    for depth, pull in zip(depths, got, strict=True):
        z = depth + noise * rng.normal(size=(20_000, count))
        kept = []
        for layer in range(-2, 3):
            inside = np.floor(z) == layer
            some = inside.any(axis=1)
            kept.append((z * inside).sum(axis=1)[some] / inside.sum(axis=1)[some])
        values = np.concatenate(kept)
        assert values.mean() - depth == pytest.approx(
            pull, abs=5.0 * values.std() / np.sqrt(len(values))
        )


def test_covariance_grows_where_less_than_a_layer_is_crossed():
    """A tilt is then hardly distinguished from the pull; across many layers it is."""
    added = []
    for tilt in (0.002, 0.06):
        rng = np.random.default_rng(5)
        xy = rng.uniform(-0.1, 0.1, (4000, 2))
        depth = 1e-3 + xy @ [tilt, 0.0] + rng.normal(0.0, 5e-4, 4000)
        points = np.column_stack([xy, depth])
        lattice = VoxelLattice(5e-3, np.array([0.0, 0.0, 1.0]), 0.0, 1e-4, 1e-3)
        found = fit_pull(points, lattice, np.eye(3))
        added.append(np.sqrt(np.diag(found.added)[1:].max()))
    assert added[0] > 5.0 * added[1]
