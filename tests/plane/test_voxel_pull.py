"""Planes of scans thinned on a voxel grid: the lattice is recognised and its pull is honest."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from tests.support.thinned import face, means, nearest
from wheelplane.cloud import VoxelLattice, find_lattice
from wheelplane.config import PlaneConfig
from wheelplane.plane import Patch, fit_plane
from wheelplane.plane.thinned.voxel_pull import _form, fit_pull
from wheelplane.targets.plates import DiscTarget

DISC = DiscTarget(shape="disc", diameter=0.25, thickness=0.01)
TRUST = 1e-4  # probability that a right program fails a test


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


SQUARE_TO_AXES = {"toe_deg": (-0.2, 0.2), "camber_deg": (-0.2, 0.2)}


def in_one_layer(edge_m, sigma_m, spacing_m, count):
    """Planes of faces that lie in one layer, thinned to the points nearest to the middles."""
    for seed in range(count):
        rng = np.random.default_rng([seed, 7])
        scan = {"sigma_m": sigma_m, "spacing_m": spacing_m}
        points, normal = face(rng, **scan, **SQUARE_TO_AXES)
        points[:, 1] += rng.uniform(0.4, 0.6) * edge_m - np.median(points[:, 1])
        yield fit(nearest(points, edge_m), normal), normal, points


ONE_LAYER = [(5e-3, 3e-4, 1e-3), (5e-3, 8e-4, 2e-3), (8e-3, 8e-4, 2e-3), (8e-3, 8e-4, 1e-3)]


@pytest.mark.slow
@pytest.mark.parametrize(("edge_m", "sigma_m", "spacing_m"), ONE_LAYER)
def test_nearest_points_in_one_layer_are_within_their_u(edge_m, sigma_m, spacing_m):
    """Least squares of them are up to 10 of their own u off: the layer's middle draws them."""
    planes = list(in_one_layer(edge_m, sigma_m, spacing_m, 12))
    found = [scores(plane, normal) for plane, normal, _ in planes]
    assert np.sum(np.square(found)) < 1.25**2 * stats.chi2.isf(TRUST, np.size(found))
    assert sum(plane.thinning is not None for plane, *_ in planes) >= 11


def test_the_pull_in_one_layer_is_seen_by_where_points_lie_along_the_face():
    """Least squares find a tilt smaller by the part that is expected, within a half of it."""
    edge_m, tilts, trues, expected = 5e-3, [], [], []
    for plane, normal, points in in_one_layer(edge_m, 4e-4, 1e-3, 6):
        assert plane.thinning is not None
        assert plane.thinning.edge_m == pytest.approx(edge_m, rel=0.01)
        kept = nearest(points, edge_m)
        terms = np.column_stack([np.ones(len(kept)), kept[:, [0, 2]]])
        tilts.append(np.linalg.lstsq(terms, kept[:, 1], rcond=None)[0][1:])
        trues.append(-normal[[0, 2]] / normal[1])
        expected.append(find_lattice(kept, np.eye(3), normal).to_middle)
    part = 1.0 - np.sum(np.multiply(tilts, trues)) / np.sum(np.square(trues))
    assert part > 0.2
    assert np.mean(expected) == pytest.approx(part, rel=0.5)


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


def test_rounded_coordinates_count_as_rounded_alone():
    points, normal = face(np.random.default_rng(4))
    assert fit(points.round(3), normal).thinning is None


@pytest.mark.parametrize("to_middle", [0.0, 0.4])
def test_pull_follows_its_definition(to_middle):
    """The form for n points a column is the mean of simulated columns, thinned by definition.

    to_middle: part of its distance by which each kept point is moved to its layer's middle.
    """
    rng = np.random.default_rng(1)
    noise, count, depths = 0.2, 6, np.array([0.05, 0.15, 0.3, 0.5, 0.8])
    got = _form(depths, noise, float(count), to_middle)
    for depth, pull in zip(depths, got, strict=True):
        z = depth + noise * rng.normal(size=(20_000, count))
        kept = []
        for layer in range(-2, 3):
            inside = np.floor(z) == layer
            some = inside.any(axis=1)
            mean = (z * inside).sum(axis=1)[some] / inside.sum(axis=1)[some]
            kept.append(mean + to_middle * (layer + 0.5 - mean))
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
        lattice = VoxelLattice(5e-3, np.array([0.0, 0.0, 1.0]), 0.0, 1e-4, 6e-4, 0.1)
        found = fit_pull(points, lattice, np.eye(3))
        added.append(np.sqrt(np.diag(found.added)[1:].max()))
    assert added[0] > 5.0 * added[1]
